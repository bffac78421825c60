// The table from above: the target position and the outcome of every run.

function tableMap({ runs, filter, open, address }) {
  const known = planes(runs);
  if (!known.length) return { parts: [make("h1", {}, "From above"), make("p", {}, "These scenes have no target whose place varies."), make("p", {}, make("a", { href: address.of("runs") }, "See all runs"))] };
  let plane = known[0], by = "", outlines = [];
  const [element, draw] = scatter(runs, { height: Math.max(360, Math.min(620, innerHeight - 320)), open, label: "Target positions, by outcome" });
  const shown = () => {
    const chosen = new Uint8Array(runs.count);
    for (const run of filter.shown) chosen[run] = 1;
    return chosen;
  };
  const again = () => {
    const chosen = shown();
    draw(plane[1], plane[2], plane[3], (run) => {
      if (!chosen[run]) return null;
      const outcome = by === "" ? runs.worst[run] : runs.outcome(run, Number(by));
      return outcome === NO_OUTCOME ? null : OUTCOMES[outcome];
    }, outlines.flatMap((outline) => outline[plane[1]] ?? []));
  };
  const [bar, follow] = filter.bar(), [none, without] = noMatch(filter);
  const note = () => address.note({ from: plane === known[0] ? "" : plane[1], by: by === "" ? "" : slotKey(runs.slots[Number(by)]) }, false);
  const planeChoice = make("select", { "aria-label": "Seen from", onchange: () => { plane = known[planeChoice.selectedIndex]; again(); note(); } },
    known.map(([name]) => make("option", {}, name)));
  const colour = make("select", { "aria-label": "Coloured by", onchange: () => { by = colour.value; again(); note(); } },
    make("option", { value: "" }, "coloured by the whole run"),
    runs.slots.map((slot, i) => make("option", { value: i }, `coloured by ${slot.action} · ${slot.property}`)));
  const arrive = (query) => {
    plane = known.find((one) => one[1] === query.get("from")) ?? known[0];
    planeChoice.selectedIndex = known.indexOf(plane);
    const slot = runs.slots.findIndex((one) => slotKey(one) === query.get("by"));
    colour.value = by = slot < 0 ? "" : String(slot);
    again();
  };
  requestAnimationFrame(() => arrive(wayOf(location.hash).query));
  outlinesOf(runs).then((found) => { outlines = found; if (element.isConnected) again(); }, () => {});
  return {
    parts: [make("h1", {}, "From above"), make("p", { class: "lead" }, `The target position of ${runs.sampled ? `each of ${counted(runs.detailed.length, "sampled run")}` : "every run"}, on the outline of its table. Click a dot to open its run.`), bar, none,
      make("p", { class: "filter" }, planeChoice, colour), element,
      make("p", { class: "legend" }, OUTCOMES.map((word) => badge(word)))],
    follow: () => { follow(); without(); again(); }, arrive,
  };
}
