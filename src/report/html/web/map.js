// The table from above: the target position and the outcome of every run.

function tableMap({ runs, filter, open }) {
  const known = planes(runs);
  if (!known.length) return [make("h1", {}, "From above"), make("p", {}, "These scenes have no target whose place varies.")];
  let plane = known[0], by = "";
  const [element, draw] = scatter(runs, { height: Math.max(360, Math.min(620, innerHeight - 320)), open, label: "Target positions, by outcome" });
  const shown = () => new Set(filter.shown);
  const again = () => {
    const chosen = shown();
    draw(plane[1], plane[2], plane[3], (run) => {
      if (!chosen.has(run)) return null;
      const outcome = by === "" ? runs.worst[run] : runs.outcome(run, Number(by));
      return outcome === NO_OUTCOME ? null : OUTCOMES[outcome];
    });
  };
  const [bar, follow] = filter.bar();
  const planeChoice = make("select", { "aria-label": "Seen from", onchange: () => { plane = known[planeChoice.selectedIndex]; again(); } },
    known.map(([name]) => make("option", {}, name)));
  const colour = make("select", { "aria-label": "Coloured by", onchange: () => { by = colour.value; again(); } },
    make("option", { value: "" }, "coloured by the whole run"),
    runs.slots.map((slot, i) => make("option", { value: i }, `coloured by ${slot.action} · ${slot.property}`)));
  requestAnimationFrame(again);
  return {
    parts: [make("h1", {}, "From above"), make("p", { class: "lead" }, "The target position of every run. Click a dot to open its run."), bar,
      make("p", { class: "filter" }, planeChoice, colour), element,
      make("p", { class: "legend" }, OUTCOMES.map((word) => badge(word)))],
    follow: () => { follow(); again(); },
  };
}
