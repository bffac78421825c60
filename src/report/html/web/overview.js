// The start page: counts, then scores, then the most frequent failures.

function overview(report) {
  const { runs, summary, list } = report;
  const all = Array.from({ length: runs.count }, (_, run) => run);
  const counts = runs.counts(all);
  const { scores, findings } = summary;
  const statuses = Object.entries(scores.statuses).map(([word, times]) => `${count(times)} ${word}`).join(", ");
  const between = (found) => found ? `[${found.low.toFixed(2)}–${found.high.toFixed(2)}] ·` : "";
  const tile = (word) => make("a", { class: `tile ${word}`, title: MEANING[word], href: list({ outcome: word }) }, make("span", { class: "large" }, count(counts[word])), make("span", {}, `${SIGNS[word]} ${word}`));
  const score = (name, value, told, found) => make("div", { class: "score" },
    make("span", { class: "large" }, value), make("b", {}, name), found && rateBar(found, "passed"), make("span", { class: "faint" }, told));
  const ofScore = (rate, found) => found && { rate, ...found };
  return [
    make("section", {},
      make("h1", {}, `${counted(scores.runs, "run")}, ${findings.properties.length === 1 ? "one property" : `${count(findings.properties.length)} properties`}`),
      make("p", { class: "lead" }, `Every property of every action of every run has one of six outcomes. Runs: ${statuses}.${scores.twins ? ` ${counted(scores.twins, "more run")} ${scores.twins === 1 ? "is" : "are"} bit-identical to a later one: each counts once.` : ""}`),
      make("div", { class: "tiles" }, OUTCOMES.map(tile)),
      shares(counts, "Outcomes"),
      runs.sampled && make("p", {}, `Counts, rates, margins and failure modes are of all runs. Patterns, collisions, and the parameters and explanations of single runs are of a sample of ${counted(runs.detailed.length, "run")}.`),
      Object.keys(summary.contested).length > 0 && make("p", {}, `${counted(Object.keys(summary.contested).length, "run")} ${Object.keys(summary.contested).length === 1 ? "is" : "are"} contested: MuJoCo, or one of its settings, decides a property otherwise (actcheck cross-check).`),
      scores.stopped && make("p", {}, "Outcomes ended a campaign (--max-failures, or an interrupt): shares of passes and failures are biased, and the intervals are wider, so that they are valid whenever one stops."),
      scores.bounds && make("p", {}, `${counted(scores.bounds.lost, "run")} ${scores.bounds.lost === 1 ? "was" : "were"} lost (broken or timed out), perhaps because they would have failed. Counted as failures, everything passed in ${percent(scores.bounds.as_failures.rate)}; counted as passes, in ${percent(scores.bounds.as_passes.rate)}.`),
      summary.campaigns.filter((row) => row.privileged).map((row) => make("p", {}, `In ${row.id} ${summary.privileged}.`))),
    make("section", { class: "scores" },
      score("T", scores.T === null ? "–" : scores.T.toFixed(4), `${between(scores.T_interval)} mean score of ${counted(scores.runs, "run")}`, ofScore(scores.T, scores.T_interval)),
      score("T without broken runs", scores.without_broken === null ? "–" : scores.without_broken.toFixed(4), `${between(scores.without_broken_interval)} the robot's alone`, ofScore(scores.without_broken, scores.without_broken_interval)),
      score("everything passed", scores.bounds ? `${percent(scores.bounds.as_failures.rate)} to ${percent(scores.bounds.as_passes.rate)}` : scores.all_passed && !scores.stopped ? percent(scores.all_passed.rate) : "–",
        scores.all_passed ? `[${(scores.all_passed.low * 100).toFixed(0)}–${(scores.all_passed.high * 100).toFixed(0)}] · ${count(scores.passed)} of ${counted(scores.tested, "run")} that tested anything` : "no run tested anything", scores.all_passed)),
    make("section", { class: "card" }, make("h2", {}, "Properties"), propertyTable(summary),
      make("p", { class: "more" }, make("a", { href: "#/properties" }, "margins and heat maps →"))),
    summary.relations.length > 0 && make("section", { class: "card" }, make("h2", {}, "Relations between runs"), relationTable(summary), brokenPairs(report)),
    make("div", { class: "columns" },
      make("section", {}, make("h2", {}, "Failure modes"), modeBars(report, 6),
        make("p", { class: "more" }, make("a", { href: "#/modes" }, "all failure modes →"))),
      make("section", {}, make("h2", {}, "Patterns"), patternList(summary, 6),
        make("p", { class: "more" }, make("a", { href: "#/patterns" }, "patterns with plots →")))),
  ];
}

/** One row for each property: the pass rate with its interval, and the six counts. */
function propertyTable(summary) {
  const passing = ({ failing }) => failing && { rate: 1 - failing.rate, low: 1 - failing.high, high: 1 - failing.low };
  return scroller("Properties", make("table", { class: "properties" },
    make("thead", {}, make("tr", {}, ["property", "pass rate [95 %]", ...OUTCOMES.map((word) =>
      make("span", { title: `${word}: ${MEANING[word]}` }, sign(word)))].map((head) => make("th", { scope: "col" }, head)))),
    make("tbody", {}, summary.findings.properties.map((property, i) => make("tr", {},
      make("th", { scope: "row" }, make("a", { href: `#/properties/${i}` },
        make("small", {}, `${local(property.action)} `), breakable(local(property.property)))),
      make("td", {}, rateCell(passing(property), "passed")),
      OUTCOMES.map((word) => make("td", { class: property.outcomes[word] ? "" : "faint" }, count(property.outcomes[word]))))))));
}

/** One row for each relation: how often it holds for a run and the same scene with one change. */
function relationTable(summary) {
  return scroller("Relations between runs", make("table", { class: "properties" },
    make("thead", {}, make("tr", {}, ["relation", "holds [95 %]", "pairs", "inapplicable"].map((head) => make("th", { scope: "col" }, head)))),
    make("tbody", {}, summary.relations.map((relation) => make("tr", {},
      make("th", { scope: "row" }, make("small", {}, `${relation.campaign} `), breakable(relation.relation)),
      make("td", {}, rateCell(relation.holds, "passed")),
      make("td", {}, `${count(relation.kept)} of ${count(relation.of)}`),
      make("td", { class: relation.inapplicable ? "" : "faint" }, count(relation.inapplicable)))))));
}

/** The first pairs in which a relation does not hold, and the command that finds the smallest scene. */
function brokenPairs({ runs, to, summary }) {
  const pairs = summary.relations.flatMap((relation) => relation.pairs.map((pair) => ({ ...pair, relation: relation.relation })));
  const more = summary.relations.reduce((sum, relation) => sum + relation.violated, 0) - pairs.length;
  if (!pairs.length) return null;
  const first = (pair) => pair.place === null ? pair.run : make("a", { href: to(pair.place) }, runs.id(pair.place));
  return [make("ul", { class: "sentences" }, pairs.map((pair) => make("li", {}, `${pair.relation} does not hold for `, first(pair), ` and ${pair.second}: ${pair.because}. `,
    make("code", {}, pair.shrink)))), more > 0 && make("p", { class: "faint" }, `${counted(more, "more pair")}: actcheck relate --format json`)];
}

function patternList(summary, most) {
  const list = (kind) => {
    const found = summary.findings.properties.flatMap((property) => property[kind].found.filter((pattern) => pattern.confirmed));
    if (found.length) return make("ul", { class: "sentences" }, found.sort((a, b) => b.wracc - a.wracc).slice(0, most).map((pattern) => make("li", { title: pattern.sentence }, pattern.plain)));
    const strongest = summary.findings.properties.flatMap((property) => property[kind].strongest.slice(0, 1)).sort((a, b) => a.p_corrected - b.p_corrected || a.p - b.p);
    if (!strongest.length) return make("p", {}, "Nothing differs between failures and passes.");
    return [make("p", { class: "faint" }, "None is beyond chance; the strongest:"), make("ul", { class: "sentences" }, strongest.slice(0, 3).map((one) => make("li", {}, one.sentence,
      one.runs_needed !== null && make("span", { class: "faint" }, ` (about ${count(one.runs_needed)} runs would decide)`))))];
  };
  return [make("h3", {}, "When"), list("patterns"), make("h3", {}, "How"), list("effects")];
}
