// The page of a comparison: the answer, the rates, and scenes that flipped, with both replays side by side.

const SIDES = ["A", "B"];
const ANSWERS = { worse: "failed", better: "passed", same: "inapplicable", "no difference": "inapplicable", underpowered: "timeout" };
const SAID = { underpowered: "undecided" };
/** The largest number of lines of a list that is open from the start. */
const MOST_OPEN = 12;

function nameOf(line) {
  return [local(line.action), line.property === null ? "whole run" : local(line.property)].filter(Boolean).join(" ");
}

/** A rate difference with its interval, on a scale from −100 to 100 %. */
function differenceBar({ value, low, high }, answer) {
  const x = (share) => 100 + 100 * share;
  return make("svg", { class: `difference ${ANSWERS[answer]}`, viewBox: "0 0 200 16", role: "img",
    "aria-label": `${signed(value)}, from ${signed(low)} to ${signed(high)}` },
    make("line", { class: "axis", x1: 0, x2: 200, y1: 8, y2: 8 }),
    make("line", { class: "zero", x1: 100, x2: 100, y1: 0, y2: 16 }),
    make("rect", { class: "span", x: x(low), width: Math.max(1, x(high) - x(low)), y: 5, height: 6, rx: 3 }),
    make("circle", { class: "dot", cx: x(value), cy: 8, r: 5 }));
}

/** A difference of shares in points: `+2.5`. */
function signed(share) {
  const points = (100 * share).toFixed(1).replace("-", "−");
  return `${share > 0 ? "+" : ""}${points}`;
}

function rateTable(compared) {
  const row = (line) => {
    const { both, only_first: a, only_second: b, neither } = line.table, all = both + a + b + neither;
    const wide = line.difference ? [differenceBar(line.difference, line.answer), make("span", { class: "faint" }, `${signed(line.difference.value)} [${signed(line.difference.low)}, ${signed(line.difference.high)}]`)] : "none decided";
    return make("tr", {}, make("th", { scope: "row" }, nameOf(line)),
      make("td", {}, badge(ANSWERS[line.answer], SAID[line.answer] ?? line.answer)),
      make("td", {}, `${both + a}/${all}`), make("td", {}, `${both + b}/${all}`), make("td", { class: "span" }, wide),
      make("td", {}, String(a)), make("td", {}, String(b)),
      make("td", {}, line.p_holm < 0.0001 ? "< 0.0001" : line.p_holm.toFixed(4)));
  };
  const heads = ["passes in", "B is", "A", "B", "B − A, points [95 %]", "only in A", "only in B", "p, corrected"];
  return make("section", {}, make("h2", {}, "Better, worse, undecided"), scroller("Rates of both sides", make("table", { class: "compared" },
    make("thead", {}, make("tr", {}, heads.map((word) => make("th", { scope: "col" }, word)))),
    make("tbody", {}, compared.lines.map(row)))),
    make("p", { class: "faint more" }, `${count(compared.pairs)} scenes in both. The p-values are exact, two-sided, and corrected for ${counted(compared.lines.length, "line")}.`));
}

function sideLine(side, name) {
  return make("div", {}, make("dt", {}, name), make("dd", {}, `${side.campaign} · ${side.config} · ${counted(side.runs, "run")}${side.runs < side.planned ? ` of ${side.planned}` : ""} · ${moment(side.started)}`));
}

/** The inputs that differ: program, skill, rules, models, and the lines of the configuration. */
function changes(compared) {
  const short = (digest) => digest === null ? "absent" : String(digest).replace(/[0-9a-f]{16,}/g, (digits) => digits.slice(0, 8));
  const lines = [["−", compared.config_only_in_a], ["+", compared.config_only_in_b]];
  return make("section", { class: "card changes" }, make("h2", {}, "Differences"),
    compared.changes.length === 0 && make("p", {}, "Nothing: program, skill, configuration, models, ontology and rules are the same."),
    make("ul", {}, compared.changes.map((change) => make("li", {}, make("b", {}, change.kind), ` ${change.name} `, make("span", { class: "faint" }, `${short(change.a)} → ${short(change.b)}`)))),
    lines.some(([, texts]) => texts.length > 0) && make("div", { class: "diff", tabindex: "0", role: "group", "aria-label": "Lines of the configuration that differ" },
      lines.map(([sign, texts]) => texts.map((text) => make("div", { class: sign === "+" ? "added" : "removed" }, `${sign} ${text}`)))));
}

function knownIssues(compared) {
  return compared.known.length > 0 && make("section", { class: "card" }, make("h2", {}, "Known issues"), make("ul", {}, compared.known.map((issue) => make("li", {},
    make("b", {}, issue.fails.join(", ")), ` fails in ${counted(issue.a.length, "run")} of A and ${issue.b.length} of B. ${issue.reason} `,
    make("span", { class: "faint" }, issue.expired ? `The date ${issue.until} is over: these scenes count.` : `Until ${issue.until}, these scenes do not count.`)))));
}

/** The flipped scenes in groups, each a link to its two replays. */
function flipList(review, current) {
  if (review.groups.length === 0) return make("section", {}, make("h2", {}, "Flipped scenes"), make("p", {}, "No scene has another outcome."));
  return make("section", { class: "flips" }, make("h2", {}, "Flipped scenes"), review.groups.map((group) => make("div", { class: `card group ${group.is_worse ? "failed" : "passed"}` },
    make("h3", {}, group.words), group.origin && make("p", {}, `${group.origin[0].toUpperCase()}${group.origin.slice(1)}.`),
    make("ul", { class: "pairs" }, group.pairs.slice(0, MOST_OPEN).map((pair) => make("li", {}, pairLink(pair, current)))),
    group.pairs.length > MOST_OPEN && make("details", {}, make("summary", {}, `${group.pairs.length - MOST_OPEN} more`),
      make("ul", { class: "pairs" }, group.pairs.slice(MOST_OPEN).map((pair) => make("li", {}, pairLink(pair, current))))))));
}

function pairLink(pair, current) {
  const words = pair.a === pair.b ? pair.a : `${pair.a} / ${pair.b}`;
  if (!pair.known) return make("span", { class: "faint" }, words);
  return make("a", { href: addressOf([pair.a, pair.b]), "aria-current": pair === current ? "true" : null }, words);
}

/** The text beside a replay: failures, and the output of the program. */
function sideOf(run, name, other) {
  const outcomeThere = (judged) => other.judged.find((one) => one.step === judged.step && one.property === judged.property)?.outcome;
  const flipped = run.judged.filter((judged) => outcomeThere(judged) !== judged.outcome);
  const failed = run.judged.filter((judged) => judged.outcome === "failed" && !flipped.includes(judged));
  const line = (judged) => make("li", {}, sign(judged.outcome), make("small", {}, ` ${judged.action} `), make("b", {}, judged.property), judged.witness && `: ${judged.witness}`,
    judged.margin !== null && make("span", { class: "faint" }, ` margin ${number(judged.margin)}`));
  return [
    make("h3", {}, `${name}: ${run.run}`, run.status !== "completed" && [" ", badge(run.status === "timeout" ? "timeout" : "broken", run.status)]),
    run.reason && make("p", { class: "note" }, run.reason),
    flipped.length > 0 && make("ul", { class: "outcomes" }, flipped.map(line)),
    failed.length > 0 && make("details", {}, make("summary", {}, `${counted(failed.length, "failure")} on both sides`), make("ul", { class: "outcomes" }, failed.map(line))),
    make("details", { open: Boolean(run.output) }, make("summary", {}, "Output of the skill"), run.output ? make("pre", { class: "output", tabindex: "0" }, run.output) : make("p", { class: "faint" }, "None is kept.")),
  ];
}

/** Both replays with one clock. */
class Pair {
  constructor(pair) {
    this.pair = pair;
    this.place = make("div", { class: "watch" });
    const { differ, runs } = pair.known;
    this.element = make("section", { class: "both" },
      make("h2", {}, "Side by side"),
      differ && make("p", { class: "differ" }, `${differ.words[0].toUpperCase()}${differ.words.slice(1)}. `, make("button", { type: "button", class: "flat", onclick: () => this.player?.seek(differ.secs) }, "show the moment")),
      this.place,
      make("div", { class: "two" }, runs.map((run, i) => make("div", { class: "side" }, sideOf(run, SIDES[i], runs[1 - i])))));
  }

  async load(review) {
    const { runs, differ } = this.pair.known, forms = await formsOf();
    const replays = await Promise.all(runs.map((run) => {
      const at = review.replays.indexOf(run.key);
      return at < 0 ? null : unpack(`replay-${at}`);
    }));
    const sides = replays.map((replay, i) => ({ replay, forms, slots: review.slots, name: `${SIDES[i]}: ${runs[i].run}` }));
    const known = sides.filter(({ replay }) => replay?.courses?.frames);
    const missing = sides.filter((side) => !known.includes(side)).map(({ name }) => make("p", { class: "note" }, `${name} has no replay in this file.`));
    if (!known.length) fill(this.place, missing);
    else {
      const made = await player(known);
      if (this.ended) return made.end();
      this.player = made;
      fill(this.place, missing, made.element);
      made.begin(this.deciding(replays) ?? differ?.secs ?? 0);
    }
    this.element.dataset.ready = "true";
    return undefined;
  }

  /** The moment of the first failure that only one of both runs has. */
  deciding(replays) {
    const { runs } = this.pair.known;
    for (const [side, replay] of replays.entries()) {
      const other = runs[1 - side].judged;
      for (const action of replay?.actions ?? []) {
        const there = (judged) => other.find((one) => one.step === action.step && one.property === local(judged.property))?.outcome;
        const flipped = action.judged.find((judged) => judged.outcome === "failed" && there(judged) !== "failed");
        if (flipped) return flipped.pressed && replay.pressed ? replay.pressed.secs[0] : flipped.decided ?? flipped.stated;
      }
    }
    return null;
  }

  end() {
    this.ended = true;
    this.player?.end();
  }
}

async function reviewMain() {
  const element = document.getElementById("main");
  try {
    const review = await unpack("review"), { compared } = review;
    document.title = "actcheck: comparison";
    document.body.prepend(make("header", { class: "top" }, make("span", { class: "mark" }, "actcheck"),
      make("span", { class: "faint whence" }, `${compared.a.name} → ${compared.b.name} · ${moment(review.made)}`), themeButton()));
    element.after(make("footer", { class: "faint" }, `actcheck ${review.version} · generated ${review.made}. Drawn in 3D by three.js (MIT).`));
    const place = make("div", {}), lists = make("div", {});
    element.className = "review";
    fill(element,
      make("h1", {}, review.headline, " ", badge(ANSWERS[review.answer], SAID[review.answer] ?? review.answer)),
      make("dl", { class: "facts" }, sideLine(compared.a, "A"), sideLine(compared.b, "B")),
      make("div", { class: "first" }, rateTable(compared), changes(compared)), knownIssues(compared), lists, place);
    const pairs = review.groups.flatMap((group) => group.pairs).filter((pair) => pair.known);
    let shown = null;
    const go = (chosen) => {
      const { way } = wayOf(location.hash);
      const pair = pairs.find((one) => one.a === way[0] && one.b === way[1]) ?? pairs[0];
      fill(lists, flipList(review, pair));
      if (!pair || shown?.pair === pair) return;
      shown?.end();
      shown = new Pair(pair);
      fill(place, shown.element);
      if (chosen) shown.element.scrollIntoView({ block: "start" });
      shown.load(review).catch((error) => put(place, make("p", { class: "note" }, `Can't show these runs in 3D: ${error.message}`)));
    };
    addEventListener("hashchange", () => go(true));
    go(false);
    document.documentElement.dataset.ready = String(Math.round(performance.now()));
  } catch (error) {
    fill(element, make("h1", {}, "The comparison can't be read"), make("p", {}, error.message),
      make("p", {}, "The file may be truncated, or the browser may be older than 2023."));
    throw error;
  }
}

reviewMain();
