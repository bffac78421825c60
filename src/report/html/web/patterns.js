// Patterns: conditions and effects that go with failures, with their evidence and a plot.

function patterns(report) {
  const tried = report.summary.findings.properties.reduce((sum, property) => sum + property.patterns.tried + property.effects.tried, 0);
  return [
    make("h1", {}, "Patterns"),
    make("p", { class: "lead" }, `When and how properties fail more often than elsewhere: corrected for all ${count(tried)} conditions and effects tried, and confirmed on a held-out third of the runs.`),
    make("h2", {}, "When: conditions of the scene and of the errors drawn"), causesOf(report, "patterns"),
    make("h2", {}, "How: effects during the action"), causesOf(report, "effects"),
  ];
}

/** The confirmed patterns of conditions or effects; for properties that fail without one, the strongest. */
function causesOf(report, kind) {
  const { summary } = report;
  const cards = summary.findings.properties.flatMap((property, of) =>
    property[kind].found.filter((pattern) => pattern.confirmed).map((pattern) => patternCard(report, property, of, pattern)));
  const unsure = summary.findings.properties.filter((property) => property.outcomes.failed > 0 && !property[kind].found.some((pattern) => pattern.confirmed));
  return [cards, unsure.length > 0 && make("section", { class: "card unsure" },
    make("h3", {}, "Not beyond chance"),
    make("p", { class: "faint" }, "The strongest of each of these properties. They may be due to chance."),
    unsure.map((property) => unsureList(property, kind)))];
}

function unsureList(property, kind) {
  const strongest = property[kind].strongest;
  if (!strongest.length) return make("p", {}, `${local(property.property)}: nothing differs between its failures and passes.`);
  return make("ul", { class: "sentences" }, strongest.map((one) => make("li", {}, one.sentence,
    make("span", { class: "faint" }, ` (p ${probability(one.p)}, corrected ${probability(one.p_corrected)}`,
      one.runs_needed !== null && `; if it is real, about ${count(one.runs_needed)} runs would show it`, ")"))));
}

function probability(p) {
  return p < 1e-3 ? p.toExponential(0) : p.toFixed(3);
}

function patternCard({ runs, list, open }, property, of, pattern) {
  const facts = [
    ["runs in it", count(pattern.all.failed_in + pattern.all.passed_in)], ["lift", number(pattern.lift)],
    ["confirmed on", `${count(pattern.held_out.failed_in)} of ${count(pattern.held_out.failed_in + pattern.held_out.passed_in)} held out`],
    ["q", pattern.q < 1e-4 ? pattern.q.toExponential(0) : number(pattern.q)],
  ];
  return make("section", { class: "card pattern" },
    make("h2", {}, pattern.plain),
    make("dl", { class: "facts" }, facts.map(([name, value]) => make("div", {}, make("dt", {}, name), make("dd", {}, value)))),
    make("div", { class: "rates" },
      make("span", {}, "with it"), rateBar(pattern.rate, "failed"), make("span", {}, interval(pattern.rate)),
      pattern.elsewhere && [make("span", {}, "elsewhere"), rateBar(pattern.elsewhere, "failed"), make("span", {}, interval(pattern.elsewhere))]),
    patternPlot(runs, of, pattern, open),
    make("p", {}, make("a", { class: "button", href: list({ pattern: pattern.name }) }, `Show its ${count(pattern.runs.length)} runs`)),
    pattern.more && make("p", { class: "faint" }, "More such scenes: ", make("code", {}, pattern.more), " prints the rule for ", make("code", {}, "[scene] require"), "."));
}

/** Failed and other runs over the parameters of the pattern, or over other usual parameters if it has fewer than two ranges. */
function patternPlot(runs, of, pattern, open) {
  const ranges = pattern.conditions.filter((condition) => !("kind" in condition) && varies(runs.parameter.get(condition.parameter)));
  const box = Object.fromEntries(ranges.map((range) => [range.parameter, range]));
  const others = ["surface_x_m", "surface_y_m", "robot_distance_m", "target_turned_rad", "target_friction", "target_mass_kg"]
    .filter((name) => !box[name] && varies(runs.parameter.get(name)));
  const place = planes(runs)[0];
  const axes = ranges.length >= 2 ? [ranges[0].parameter, ranges[1].parameter]
    : ranges.length === 1 && others.length ? [ranges[0].parameter, others.find((name) => runs.parameter.get(name).unit === runs.parameter.get(ranges[0].parameter).unit) ?? others[0]]
      : place ? [place[1], place[2]] : null;
  if (!axes) return null;
  const within = new Set(pattern.runs);
  const slots = runs.slots.map((slot, at) => [slot, at]).filter(([slot]) => slot.of === of).map(([, at]) => at);
  // Runs excluded by a condition on kinds would hide the effect of the ranges.
  const kinds = pattern.conditions.filter((condition) => "kind" in condition);
  const shown = (run) => !kinds.length || within.has(run) || ranges.length > 0;
  const outcome = (run) => {
    const found = slots.map((slot) => runs.outcome(run, slot));
    if (found.includes(FAILED)) return "failed";
    return found.includes(PASSED) ? "passed" : null;
  };
  const kindOf = (run) => !kinds.length || within.has(run) ? outcome(run) : ranges.length ? null : null;
  const [element, draw] = scatter(runs, { height: 300, open, box, label: `Plot of the pattern: ${pattern.sentence}` });
  requestAnimationFrame(() => draw(axes[0], axes[1], false, kinds.length ? (run) => shown(run) && kindOf(run) : outcome));
  return make("figure", {}, element, make("figcaption", { class: "faint" },
    `${kinds.length ? `Runs with ${kinds.map((condition) => condition.kind).join(" and ")} that the pattern applies to` : "All runs"}: crosses failed, dots passed${ranges.length ? "; the marked area is the range" : ""}. Click a dot to open its run.`));
}
