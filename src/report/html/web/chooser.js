// Chooses the signals that are drawn below a replay, each with a limit of one's own.

/** The chosen quantities and their limits, kept from run to run. `null`: the usual signals. */
const CHOSEN = { names: new Set(), limits: new Map(), usual: true };
/** Largest number of quantities in the list at once: a run has several hundred. */
const MOST_LISTED = 200;

/** The list of quantities of a run. `redraw` gets the signals and the limits to draw whenever the choice changes. */
function chooser(quantities, usual, thresholds, seconds, redraw) {
  const filter = make("input", { type: "search", placeholder: "joint, speed, distance …", "aria-label": "Filter signals" });
  const list = make("div", { class: "quantities", tabindex: "0", role: "group", "aria-label": "Signals" });
  const summary = make("summary", {});
  const drawn = new Map();
  /** A quantity as a signal, whose values are made once. */
  const signal = (quantity) => {
    if (!drawn.has(quantity.name)) drawn.set(quantity.name, { name: quantity.name, unit: quantity.unit, step: quantity.step, values: quantity.values() });
    return drawn.get(quantity.name);
  };
  const chosen = () => quantities.filter(({ name }) => CHOSEN.names.has(name));
  const update = () => {
    const added = chosen().map(signal), signals = CHOSEN.usual ? usual.concat(added) : added;
    const limits = added.filter(({ name }) => CHOSEN.limits.has(name)).map((of) =>
      ({ signal: of, at: CHOSEN.limits.get(of.name), below: true, property: "limit", outcome: "own", from: 0, to: seconds }));
    summary.textContent = `Signals: ${counted(signals.length, "signal")} of ${quantities.length + usual.length}`;
    redraw(signals, thresholds.concat(limits));
  };
  const row = (quantity) => {
    const [factor, unit] = SHOWN_UNITS[quantity.unit] ?? [1, quantity.unit];
    const limit = make("input", { type: "number", step: "any", class: "limit", placeholder: "limit", "aria-label": `Limit of ${quantity.name}`, value: CHOSEN.limits.has(quantity.name) ? Number((CHOSEN.limits.get(quantity.name) * factor).toPrecision(6)) : undefined,
      onchange: () => {
        const value = Number.parseFloat(limit.value);
        if (Number.isFinite(value)) CHOSEN.limits.set(quantity.name, value / factor);
        else CHOSEN.limits.delete(quantity.name);
        CHOSEN.names.add(quantity.name);
        box.checked = true;
        update();
      } });
    const box = make("input", { type: "checkbox", onchange: () => {
      if (box.checked) CHOSEN.names.add(quantity.name);
      else CHOSEN.names.delete(quantity.name);
      update();
    } });
    box.checked = CHOSEN.names.has(quantity.name);
    return make("div", { class: "quantity" }, make("label", { class: "check" }, box, ` ${quantity.short}`), limit, make("span", { class: "faint" }, unit));
  };
  const show = () => {
    const words = filter.value.toLowerCase().split(/\s+/).filter((word) => word);
    const fitting = quantities.filter(({ name }) => words.every((word) => name.toLowerCase().includes(word)));
    const groups = new Map();
    for (const quantity of fitting.slice(0, MOST_LISTED)) groups.set(quantity.group, (groups.get(quantity.group) ?? []).concat(quantity));
    fill(list, [...groups].map(([group, of]) => [make("div", { class: "group" }, group), of.map(row)]),
      fitting.length > MOST_LISTED && make("p", { class: "faint" }, `${counted(fitting.length - MOST_LISTED, "more signal")}: filter the list`),
      fitting.length === 0 && make("p", { class: "faint" }, "No signal has these words in its name."));
  };
  filter.addEventListener("input", show);
  const all = make("input", { type: "checkbox", onchange: () => { CHOSEN.usual = all.checked; update(); } });
  all.checked = CHOSEN.usual;
  const clear = make("button", { type: "button", class: "flat", onclick: () => { CHOSEN.names.clear(); CHOSEN.limits.clear(); CHOSEN.usual = all.checked = true; show(); update(); } }, "reset");
  // The list is made when it is first opened.
  const element = make("details", { class: "chooser", ontoggle: () => { if (element.open && !list.childElementCount) show(); } },
    summary, make("div", { class: "choose" }, filter, make("label", { class: "check" }, all, " the usual signals"), clear), list,
    make("p", { class: "faint" }, "Speeds and accelerations are derived from the recorded poses, which are coarser than the samples that rules read. Joints: metres or radians, and N or N·m."));
  return { element, update };
}
