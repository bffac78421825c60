// Failure modes, and failures that are associated with later failures.

function modeBars(summary, filter, most = Infinity) {
  const modes = summary.findings.failure_modes;
  const largest = Math.max(...modes.map((mode) => mode.share.rate), 1e-9);
  return make("ol", { class: "bars" }, modes.slice(0, most).map((mode, number) => make("li", {},
    make("button", { type: "button", class: "flat", onclick: () => { filter.set({ ...ANY, mode: String(number) }); location.hash = "#/runs"; } },
      make("span", { class: "name" }, mode.failed.length ? mode.failed.map((iri, i) => [i > 0 && make("i", {}, " + "), breakable(local(iri))]) : make("em", {}, "nothing failed")),
      make("span", { class: `bar ${mode.failed.length ? "failed" : "passed"}`, style: { width: `${mode.share.rate / largest * 100}%` } }),
      make("span", { class: "faint" }, `${interval(mode.share)} · ${counted(mode.runs.length, "run")}`)))));
}

function modes({ runs, summary, filter }) {
  const cascades = summary.findings.cascades;
  const judged = ({ step, action, property }) => `${step}. ${local(action)}: ${local(property)}`;
  return [
    make("h1", {}, "Failure modes"),
    make("p", { class: "lead" }, "Runs that share the same set of failed properties, and their share of all runs that tested anything."),
    make("section", {}, modeBars(summary, filter)),
    make("section", {}, make("h2", {}, "See one of each"), make("ul", { class: "examples" },
      summary.findings.failure_modes.filter((mode) => mode.failed.length).map((mode) => {
        const run = mode.runs.find((run) => runs.replayed.has(runs.runs[run])) ?? mode.runs[0];
        const slot = runs.failures(run)[0];
        return make("li", {}, make("a", { href: `#/run/${encodeURIComponent(runs.runs[run])}` }, runs.runs[run]),
          " ", slot !== undefined && runs.why(run, slot));
      }))),
    cascades.length > 0 && make("section", {}, make("h2", {}, "Cascades"),
      make("p", { class: "lead" }, "Failures of a later action that are more frequent if an earlier one failed (Fisher's exact test, corrected for all pairs)."),
      make("div", { class: "scroll", tabindex: "0" }, make("table", {},
        make("thead", {}, make("tr", {}, ["when this fails", "then this fails", "in", "otherwise in", "q"].map((word) => make("th", { scope: "col" }, word)))),
        make("tbody", {}, cascades.map(({ first, later, table, q }) => make("tr", {},
          make("td", {}, judged(first)), make("td", {}, judged(later)),
          make("td", {}, interval(wilson(table.failed_in, table.failed_in + table.passed_in))),
          make("td", {}, interval(wilson(table.failed_out, table.failed_out + table.passed_out))),
          make("td", {}, q < 1e-4 ? q.toExponential(0) : number(q)))))))),
  ];
}
