// Loads the data and maps addresses to views.

const VIEWS = [["", "Overview"], ["properties", "Properties"], ["modes", "Failure modes"], ["patterns", "Patterns"], ["collisions", "Collisions"], ["map", "From above"],
  ["history", "History"], ["runs", "Runs"]];

/** Number of runs indexed for search in one idle period: a few milliseconds, so that clicks are not delayed. */
const AT_A_TIME = 400;

/** The elements of a view, its reaction to the filter and to another address of the same view, and its clean-up. */
function view(report, [name, chosen, other]) {
  switch (name) {
    case "properties": return { parts: properties(report, chosen) };
    case "modes": return { parts: modes(report) };
    case "patterns": return { parts: patterns(report) };
    case "collisions": return { parts: collisions(report) };
    case "map": return tableMap(report);
    case "history": return { parts: trends(report) };
    case "run": return runView(report, chosen ?? "");
    case "pair": return pairView(report, chosen ?? "", other);
    case "runs": {
      const [bar, follow] = report.filter.bar(), [list, anew] = runList(report), [none, without] = noMatch(report.filter);
      return { parts: [make("h1", {}, "Runs"), bar, none, list], follow: () => { follow(); without(); anew(); }, wide: true };
    }
    default: return { parts: overview(report) };
  }
}

function frame(summary, main) {
  const links = VIEWS.map(([name, words]) => make("a", { href: `#/${name}`, "data-view": name }, words));
  const header = make("header", { class: "top" },
    make("a", { class: "mark", href: "#/" }, "actcheck"),
    make("span", { class: "faint whence" }, `${summary.history} · ${moment(summary.made)}`, summary.served && make("output", { class: "live" })), themeButton(),
    make("nav", { "aria-label": "Views" }, links, summary.served && make("a", { href: "/query" }, "Query")));
  const footer = make("footer", { class: "faint" }, `actcheck ${summary.version} · generated ${summary.made} from ${summary.history}. Drawn in 3D by three.js (MIT).`);
  document.body.prepend(make("a", { class: "skip", href: "#main", onclick: (event) => { event.preventDefault(); main.focus(); } }, "To the report"), header);
  main.after(footer);
  return links;
}

/** Builds the search index in idle periods, a few runs at a time, so that filters do not wait for it and the first search hardly does. */
function gatherLetters(runs) {
  const later = window.requestIdleCallback ?? setTimeout;
  const some = () => runs.gather(AT_A_TIME) || later(some);
  later(some);
}

async function main() {
  const element = document.getElementById("main");
  try {
    const [summary, columns] = await Promise.all([unpack("summary"), unpack("runs")]);
    const runs = new Runs(columns, summary), filter = new Filter(runs);
    const address = new Address(filter);
    const report = {
      runs, summary, filter, address,
      to: (run) => address.of("run", report.runs.id(run)),
      open: (run) => { location.hash = report.to(run); },
      list: (change) => addressOf(["runs"], filter.query({ ...ANY, ...change })),
    };
    const links = frame(summary, element);
    const lead = () => links.forEach((link) => link.setAttribute("href", address.of(link.dataset.view)));
    filter.listeners.add(lead);
    filter.noted = (replace) => address.note({}, replace);
    let shown = {};
    const go = (first, again = false) => {
      const opened = wayOf(location.hash), { way } = opened;
      address.opened(opened);
      // The view that is shown has older runs than the filter.
      if (again) filter.listeners.delete(shown.follow);
      if (FILTERED.has(way[0])) filter.set(filter.ofQuery(opened.query));
      // A step back or forward within a view.
      if (!first && !again && shown.key === way.join("/")) return shown.arrive?.(opened.query);
      filter.listeners.delete(shown.follow);
      shown.end?.();
      shown = { ...view(report, way), key: way.join("/") };
      if (Array.isArray(shown.parts)) fill(element, shown.parts);
      if (shown.follow) {
        filter.listeners.add(shown.follow);
        shown.follow();
      }
      element.className = shown.wide ? `wide ${way[0]}` : way[0];
      for (const link of links) {
        const here = link.dataset.view === (["run", "pair"].includes(way[0]) ? "runs" : way[0]);
        if (here) link.setAttribute("aria-current", "page");
        else link.removeAttribute("aria-current");
        if (here && !again) link.scrollIntoView({ block: "nearest", inline: "center" });
      }
      if (again) return undefined;
      if (way[0] !== "properties") scrollTo(0, 0);
      if (!first) element.focus({ preventScroll: true });
      return undefined;
    };
    addEventListener("hashchange", () => go(false));
    go(true);
    gatherLetters(runs);
    if (summary.served) keepLive(report, () => go(false, true));
    document.documentElement.dataset.ready = String(Math.round(performance.now()));
  } catch (error) {
    fill(element, make("h1", {}, "The report can't be read"), make("p", {}, error.message),
      make("p", {}, "The file may be truncated, or the browser may be older than 2023."));
    throw error;
  }
}

main();
