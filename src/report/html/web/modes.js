// Failure modes, and failures that are associated with later failures.

function modeBars({ summary, list }, shown = Infinity) {
  const modes = summary.findings.failure_modes;
  return make("ol", { class: "bars" }, modes.slice(0, shown).map((mode, number) => make("li", {},
    make("a", { href: list({ mode: String(number) }) },
      make("span", { class: "name" }, mode.failed.length ? mode.failed.map((iri, i) => [i > 0 && make("i", {}, " + "), breakable(local(iri))]) : make("em", {}, "nothing failed")),
      rateBar(mode.share, mode.failed.length ? "failed" : "passed"),
      make("span", { class: "faint" }, `${interval(mode.share)} · ${counted(mode.count, "run")}`)))));
}

function modes(report) {
  const { runs, summary, to } = report, cascades = summary.findings.cascades;
  const judged = ({ step, action, property }) => `${step}. ${local(action)}: ${local(property)}`;
  return [
    make("h1", {}, "Failure modes"),
    make("p", { class: "lead" }, "Runs that share the same set of failed properties, and their share of all runs that tested anything."),
    make("section", {}, modeBars(report)),
    make("section", {}, make("h2", {}, "See one of each"), make("ul", { class: "examples" },
      summary.findings.failure_modes.filter((mode) => mode.failed.length).map((mode) => {
        const run = mode.example;
        return make("li", {}, make("a", { href: to(run) }, runs.id(run)), " ", runs.happened(run));
      }))),
    cascades.length > 0 && make("section", {}, make("h2", {}, "Cascades"),
      make("p", { class: "lead" }, "Failures of a later action that are more frequent if an earlier one failed (Fisher's exact test, corrected for all pairs)."),
      scroller("Cascades", make("table", {},
        make("thead", {}, make("tr", {}, ["when this fails", "then this fails", "in", "otherwise in", "adjusted p"].map((word) => make("th", { scope: "col" }, word)))),
        make("tbody", {}, cascades.map(({ first, later, table, q }) => make("tr", {},
          make("td", {}, judged(first)), make("td", {}, judged(later)),
          make("td", {}, rateCell(wilson(table.failed_in, table.failed_in + table.passed_in))),
          make("td", {}, rateCell(wilson(table.failed_out, table.failed_out + table.passed_out))),
          make("td", {}, q < 1e-4 ? q.toExponential(0) : number(q)))))))),
  ];
}
