// The timeline: actions with phases, contacts with forces, and the moments that decided failures.

const LANE = 15;
const MOST_LANES = 12;

/** Contacts that get a lane: between the robot and objects, and between moving objects and others; one lane per pair. */
function lanes(replay, seconds) {
  const found = new Map();
  for (const action of replay.actions) {
    for (const [a, b, start, end, force] of action.contacts ?? []) {
      const robot = a.startsWith("robot/") || b.startsWith("robot/");
      const name = (thing) => thing.startsWith("robot/") ? "robot" : thing;
      const pair = [name(a), name(b)].sort((x, y) => (x === "robot" ? -1 : y === "robot" ? 1 : x.localeCompare(y))).join(" – ");
      if (!found.has(pair)) found.set(pair, { pair, robot, episodes: [], most: 0, length: 0 });
      const lane = found.get(pair);
      lane.episodes.push([action.start + start, action.start + end, force]);
      lane.most = Math.max(lane.most, force);
      lane.length += end - start;
    }
  }
  return [...found.values()]
    // Permanent contacts are not informative.
    .filter((lane) => lane.robot || lane.length < 0.9 * seconds)
    .sort((a, b) => b.robot - a.robot || b.most - a.most).slice(0, MOST_LANES);
}

/** Width below which a timeline scrolls. Unit: pixels. */
const NARROWEST = 400;

/**
 * The timeline with the signals below it, drawn anew in every width so that its text stays readable. Returns the element,
 * and functions that draw it, mark a moment, and end it. A click calls `seek` with its time.
 */
function timeline(replay, course, signals, thresholds, seek) {
  const seconds = course.seconds, element = scroller("Timeline and signals");
  element.classList.add("tracks");
  let mark = () => {}, secs = 0, drawn = 0, rows = signals, limits = thresholds;
  const draw = () => {
    const width = Math.max(NARROWEST, Math.round(element.clientWidth));
    if (!element.clientWidth || width === drawn) return;
    drawn = width;
    const [drawing, follow] = timelineOf(replay, course, rows, limits, seconds, width, seek);
    fill(element, drawing);
    mark = follow;
    mark(secs);
  };
  const resized = new ResizeObserver(() => requestAnimationFrame(draw));
  resized.observe(element);
  /** Draws other signals, with other limits. */
  const choose = (signals, thresholds) => { [rows, limits, drawn] = [signals, thresholds, 0]; draw(); };
  return { element, draw, choose, mark: (to) => { secs = to; mark(to); }, end: () => resized.disconnect() };
}

function timelineOf(replay, course, signals, thresholds, seconds, width, seek) {
  const rows = lanes(replay, seconds), left = width < 600 ? 104 : 150, inner = width - left - 10, letters = width < 600 ? 17 : 26;
  const x = (secs) => left + (seconds ? secs / seconds : 0) * inner;
  const top = 54, below = top + rows.length * LANE + 4, height = below + signals.length * SIGNAL + 18;
  const marks = replay.actions.flatMap((action) => action.judged).filter((judged) => typeof judged.stated === "number");
  const now = make("line", { class: "now", x1: left, x2: left, y1: 0, y2: height - 16 });
  const [plots, follow] = signalRows(signals, thresholds, course, { x, left, width, top: below });
  const drawing = make("svg", { class: "timeline", viewBox: `0 0 ${width} ${height}`, width, height, role: "img",
    "aria-label": `Actions, contacts and failures over ${number(seconds, "s")}, and ${counted(signals.length, "signal")}: ${signals.map(({ name }) => name).join(", ")}`,
    onclick: (event) => {
      const at = drawing.getBoundingClientRect();
      seek(Math.min(seconds, Math.max(0, ((event.clientX - at.left) / at.width * width - left) / inner * seconds)));
    } },
    replay.actions.filter((action) => action.start !== undefined && action.seconds > 0).map((action, i) => actionBar(action, i, x)),
    rows.map((lane, i) => [
      make("text", { class: "small", x: left - 8, y: top + i * LANE + 10, "text-anchor": "end" }, lane.pair.length > letters ? `${lane.pair.slice(0, letters - 1)}…` : lane.pair,
        make("title", { svg: true }, lane.pair)),
      make("line", { class: "lane", x1: left, x2: width - 10, y1: top + i * LANE + 7, y2: top + i * LANE + 7 }),
      lane.episodes.map(([from, to, force]) => make("rect", {
        class: lane.robot ? "contact robot" : "contact", x: x(from), width: Math.max(2, x(to) - x(from)), y: top + i * LANE + 2, height: 10, rx: 2,
        "fill-opacity": 0.35 + 0.65 * Math.min(1, force / 20),
      }, make("title", { svg: true }, `${lane.pair}: ${number(from, "s")} to ${number(to, "s")}, up to ${number(force, "N")}`)))]),
    plots,
    ticks([0, seconds], inner / 80).map((secs) => make("text", { class: "small", x: x(secs), y: height - 4, "text-anchor": secs === 0 ? "start" : "middle" }, number(Number(secs.toFixed(2)), "s"))),
    marks.map((judged) => make("path", { class: "decided", d: `M${x(judged.stated)} 0 V${height - 16} M${x(judged.stated) - 4} 0 h8 l-4 6 z` },
      make("title", { svg: true }, `${local(judged.property)} failed`))),
    now);
  return [drawing, (secs) => { now.setAttribute("x1", x(secs)); now.setAttribute("x2", x(secs)); follow(secs); }];
}

/** An action with its phases. */
function actionBar(action, i, x) {
  const length = x(action.start + action.seconds) - x(action.start);
  return [
    make("rect", { class: `action of${i % 6}`, x: x(action.start), y: 2, width: Math.max(2, length - 1), height: 16, rx: 3 },
      make("title", { svg: true }, `${local(action.action)}: ${number(action.seconds, "s")}`)),
    make("text", { class: "name", x: x(action.start) + 5, y: 14 }, length > 40 ? local(action.action) : ""),
    phaseNames((action.phases ?? []).map(([name, start]) => [name, x(action.start + start)]), x(action.start + action.seconds))];
}

/** Height of a row of phase names. Unit: pixels. */
const PHASE_ROW = 12;

/** The names of phases in two rows, each where it has room; names without any are shortened to `…`. */
function phaseNames(phases, end) {
  const ends = [-Infinity, -Infinity];
  return phases.map(([name, from], j) => {
    const room = (row) => from + 3 >= ends[row] && from + 3 + name.length * LETTER <= (row ? end : phases[j + 1]?.[1] ?? end);
    const row = [0, 1].find(room) ?? (from + 3 >= ends[1] ? 1 : -1), fits = row >= 0 && room(row), words = fits ? name : "…";
    if (row >= 0) ends[row] = from + 3 + words.length * LETTER + 3;
    return [
      make("line", { class: "phase", x1: from, x2: from, y1: 20, y2: 22 + PHASE_ROW * 2 }, make("title", { svg: true }, name)),
      row >= 0 && make("text", { class: "small", x: from + 3, y: 30 + PHASE_ROW * row }, words, make("title", { svg: true }, name))];
  });
}
