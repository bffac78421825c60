// Properties: description, outcomes, margins, heat maps and trend.

function properties({ runs, summary, list }, chosen) {
  const cards = summary.findings.properties.map((property, i) => {
    const slots = runs.slots.map((slot, at) => [slot, at]).filter(([slot]) => slot.of === i);
    const words = slots[0]?.[0] ?? {};
    const margins = thinned(slots.map(([, at]) => runs.margins[at] ?? []));
    const unit = property.margin.unit ?? "";
    const to = (outcome) => list({ slot: String(slots[0]?.[1] ?? ""), outcome });
    const card = make("section", { class: "card", id: `property-${i}` },
      make("h2", {}, make("small", {}, `${local(property.action)} `), local(property.property)),
      make("p", { class: "lead" }, words.comment || words.label),
      words.rule && make("p", { class: "faint" }, "rule: ", make("code", {}, words.rule)),
      make("p", {}, make("b", {}, property.failing ? `fails in ${interval(property.failing)}` : "never decided"),
        ` of ${count(property.outcomes.passed + property.outcomes.failed)} decided runs`),
      property.failing && rateBar(property.failing, "failed"),
      shares(property.outcomes, local(property.property)),
      make("p", { class: "counts" }, OUTCOMES.map((word) => {
        const words = [sign(word), ` ${count(property.outcomes[word])} ${word}`];
        return property.outcomes[word] ? make("a", { href: to(word) }, words) : make("span", { class: "faint" }, words);
      })),
      make("div", { class: "maps" },
        margins.some((value) => !Number.isNaN(value)) && make("figure", {},
          make("figcaption", {}, `Margins${unit && unit !== "1" ? ` in ${unit}` : ""}: how far from flipping; below 0 it failed`), histogram(margins, unit, local(property.property))),
        property.maps.map((map) => heatMap(map, runs))),
      property.flaky.scenes > 0 && make("p", {}, `Of ${count(property.flaky.scenes)} scenes that were run more than once, ${count(property.flaky.both_ways.length)} both passed and failed.`));
    return card;
  });
  queueMicrotask(() => chosen !== undefined && document.getElementById(`property-${chosen}`)?.scrollIntoView());
  return [make("h1", {}, "Properties"), cards];
}

/** The numbers of some columns; of very many, as many as a histogram shows. */
function thinned(columns) {
  const every = Math.max(1, Math.floor(columns.reduce((sum, column) => sum + column.length, 0) / 100000));
  return columns.flatMap((column) => every === 1 ? Array.from(column) : Array.from({ length: Math.floor(column.length / every) }, (_, i) => column[i * every]));
}
