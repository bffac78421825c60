// Signals over time: measurements of the gripper and the target, derived from the recorded trajectories and contacts.

/** Largest difference between a measured value and that of its signal, by unit. */
const SAME = { m: 0.002, rad: 0.02, N: 0.6 };
/** How a unit is shown: factor and name. */
const SHOWN_UNITS = { m: [100, "cm"], rad: [180 / Math.PI, "°"], N: [1, "N"] };

/** `5 cm`, `60.8 cm` */
function inUnit(value, unit) {
  const [factor, name] = SHOWN_UNITS[unit] ?? [1, unit], shown = value * factor;
  const rounded = unit in SHOWN_UNITS ? shown.toFixed(Math.abs(shown) < 99.95 ? 1 : 0) : shown.toPrecision(3);
  return number(Number(rounded), name);
}

/** The signals of a run: name, unit, and its value at each frame (NaN: unknown). */
function signalsOf(replay, course, forms, target) {
  const times = Array.from({ length: course.frames }, (_, frame) => frame * course.period);
  const moved = target && course.slot.get(target), poses = moved !== undefined ? times.map((secs) => course.pose(moved, secs)) : null;
  const all = [
    { name: "gripper opening", unit: "m", key: "opening", values: gripOf(replay, times, "opening") },
    { name: "grip force", unit: "N", values: gripOf(replay, times, "force") },
    { name: "contact force", unit: "N", step: true, values: contactForces(replay, times) },
  ];
  if (poses) {
    const form = forms[course.tracks[moved].form], start = startOf(replay);
    const first = (secs) => poses[Math.min(course.frames - 1, Math.round(start(secs) / course.period))];
    const tilt = ([i, j]) => Math.acos(Math.min(1, Math.max(-1, 1 - 2 * (i * i + j * j))));
    all.push(
      { name: `hand to ${target}`, unit: "m", key: "distance", values: times.map((secs, frame) => { const hand = course.hand(secs); return hand ? closestOf(form, poses[frame], hand).distance : NaN; }) },
      { name: `${target} moved`, unit: "m", key: "moved", values: times.map((secs, frame) => apart(poses[frame].slice(0, 3), first(secs).slice(0, 3))) },
      { name: `${target} raised`, unit: "m", values: times.map((secs, frame) => poses[frame][2] - first(secs)[2]) },
      { name: `${target} tilt`, unit: "rad", values: poses.map((pose) => tilt(pose.slice(3))) });
  }
  return all.filter(({ values }) => values.some((value) => Number.isFinite(value)));
}

/** The signals that decided failed properties about time: at their own rate, with limit, moment and interval. */
function decidingSignals(replay) {
  const sums = (differences, step) => { let sum = 0; return differences.map((change) => (sum += change) * step); };
  return replay.actions.filter(({ start }) => start !== undefined).flatMap((action) => action.judged.flatMap((judged) =>
    (judged.signals ?? []).map((one) => ({
      name: one.name, unit: one.unit, property: local(judged.property), step: one.symbol === "", symbol: one.symbol, values: sums(one.values, one.step),
      from: action.start, period: one.period, at: action.start + one.at, during: one.during.map((secs) => action.start + secs),
      limit: Array.isArray(one.limit) ? sums(one.limit, one.step) : one.limit }))));
}

/** When the action of a moment began. */
function startOf(replay) {
  const starts = replay.actions.map((action) => action.start).filter((start) => start !== undefined);
  return (secs) => starts.filter((start) => start <= secs + 1e-6).at(-1) ?? 0;
}

/** A measurement of the gripper at some times; `null` if the trace has none. */
function gripOf(replay, times, kind) {
  const values = times.map(() => NaN);
  for (const action of replay.actions) {
    if (!action.grip || action.start === undefined) continue;
    let sum = 0;
    const known = action.grip[kind].map((change) => (sum += change) * action.grip[`${kind}_step`]);
    times.forEach((secs, frame) => {
      const at = Math.round((secs - action.start - action.grip.start) / (action.grip.period || 1));
      if (at >= 0 && at < known.length) values[frame] = known[at];
    });
  }
  return values;
}

/** The largest force of each contact of the robot, while it lasts. */
function contactForces(replay, times) {
  const values = times.map(() => 0);
  let any = false;
  for (const action of replay.actions) {
    for (const [a, b, start, end, force] of action.contacts ?? []) {
      if (a === "floor" || b === "floor" || !(a.startsWith("robot/") || b.startsWith("robot/"))) continue;
      any = true;
      times.forEach((secs, frame) => {
        if (secs >= action.start + start - 1e-6 && secs <= action.start + end + 1e-6) values[frame] = Math.max(values[frame], force);
      });
    }
  }
  return any ? values : values.map(() => NaN);
}

/**
 * The thresholds of judged margins that can be drawn on a signal. A margin is the difference between a threshold and a
 * measured value, so it belongs to the signal that has this value at the end of the action, or as its extreme.
 */
function thresholdsOf(replay, course, signals, slots) {
  const found = [];
  for (const action of replay.actions.filter((one) => one.start !== undefined)) {
    const frames = [action.start, action.start + action.seconds].map((secs) => Math.min(course.frames - 1, Math.round(secs / course.period)));
    for (const judged of action.judged) {
      const slot = slots.find((one) => one.iri === judged.property);
      if (!slot || judged.margin === null) continue;
      for (const bound of slot.bounds ?? []) {
        const value = bound.below ? bound.at - judged.margin : bound.at + judged.margin;
        const signal = closestSignal(signals.filter(({ unit }) => unit === slot.unit), value, frames, bound.below);
        if (signal) found.push({ signal, at: bound.at, below: bound.below, property: local(judged.property), outcome: judged.outcome, from: action.start, to: action.start + action.seconds });
      }
    }
  }
  return found;
}

/** The signal with a value at the end of some frames or as an extreme in them. Several fit near 0: then the most usual one. */
function closestSignal(signals, value, [first, last], below) {
  const off = ({ values, unit }) => {
    const known = values.slice(first, last + 1).filter((one) => Number.isFinite(one));
    const off = known.length ? Math.min(...[known.at(-1), Math.max(...known), Math.min(...known)].map((one) => Math.abs(one - value))) : Infinity;
    return off <= SAME[unit] + 0.01 * Math.abs(value) ? off : Infinity;
  };
  const usual = ({ key }) => (key === (below ? "distance" : "moved") ? 0 : key === "opening" ? 2 : 1);
  const fitting = signals.map((signal) => [signal, off(signal), usual(signal)]).filter(([, by]) => by < Infinity);
  const least = Math.min(...fitting.map(([, by]) => by));
  const alike = fitting.filter(([{ unit }, by]) => by <= least + SAME[unit]);
  return alike.sort((a, b) => a[2] - b[2] || a[1] - b[1])[0]?.[0] ?? null;
}

const SIGNAL = 44;
/** Mean width of a letter of a label. Unit: pixels. */
const LETTER = 5.8;

/** Draws signals below each other, on the time axis of the timeline. Returns the elements and a function that follows the moment. */
function signalRows(signals, thresholds, course, { x, left, width, top }) {
  const letters = left < 130 ? 15 : 24;
  const rows = signals.map((signal, i) => {
    const limits = thresholds.filter((one) => one.signal === signal), y0 = top + i * SIGNAL + 6, height = SIGNAL - 12;
    const known = signal.values.concat(signal.limit ?? []).filter((value) => Number.isFinite(value)).concat(limits.map((one) => one.at));
    const low = Math.min(0, ...known), high = Math.max(...known, low + (SAME[signal.unit] ?? 0.01) * 5);
    const from = signal.from ?? 0, period = signal.period ?? course.period;
    const y = (value) => y0 + height - (value - low) / (high - low) * height;
    const now = make("text", { class: "value", x: left - 8, y: y0 + 28, "text-anchor": "end" });
    const dot = make("circle", { class: "dotnow", r: 3, cx: left, cy: y(0) });
    const parts = [
      make("rect", { class: "plot", x: left, y: y0, width: width - left - 10, height }),
      make("text", { class: "small", x: left - 8, y: y0 + 12, "text-anchor": "end" }, signal.name.length > letters ? `${signal.name.slice(0, letters - 1)}…` : signal.name, make("title", { svg: true }, signal.name)),
      now,
      signal.during && make("rect", { class: "violated", x: x(signal.during[0]), width: Math.max(2, x(signal.during[1]) - x(signal.during[0])), y: y0, height },
        make("title", { svg: true }, `${signal.property}: ${number(signal.during[0], "s")} to ${number(signal.during[1], "s")}`)),
      make("path", { class: "curve", d: curve(signal, (frame) => x(from + frame * period), y) }),
      signal.at !== undefined && decided(signal, { x, y, y0, height, left, width }),
      limits.map((limit) => [
        make("line", { class: `limit ${limit.outcome}`, x1: x(limit.from), x2: x(limit.to), y1: y(limit.at), y2: y(limit.at) }),
        make("text", { class: "small limitname", x: x(limit.from) + 4, y: y(limit.at) > y0 + 14 ? y(limit.at) - 3 : y(limit.at) + 11 },
          `${limit.property} ${limit.below ? "<" : ">"} ${inUnit(limit.at, signal.unit)}`)]),
      make("text", { class: "small most", x: width - 14, y: y0 + 11, "text-anchor": "end" }, inUnit(high, signal.unit)),
      dot,
    ];
    const follow = (secs) => {
      const frame = Math.round((secs - from) / period);
      const value = signal.period ? signal.values[frame] : signal.values[Math.min(course.frames - 1, Math.max(0, frame))];
      now.textContent = Number.isFinite(value) ? inUnit(value, signal.unit) : "–";
      dot.setAttribute("visibility", Number.isFinite(value) ? "visible" : "hidden");
      dot.setAttribute("cx", x(secs));
      if (Number.isFinite(value)) dot.setAttribute("cy", y(value));
    };
    return [make("g", { class: "signal", "data-signal": signal.name }, parts), follow];
  });
  return [rows.map(([row]) => row), (secs) => rows.forEach(([, follow]) => follow(secs))];
}

/** The limit of a deciding signal, the property that it decided, and the moment. */
function decided(signal, { x, y, y0, height, left, width }) {
  const { limit, from, period, values, at } = signal, last = from + (values.length - 1) * period;
  const varies = Array.isArray(limit), isTruth = limit === null;
  const shown = isTruth ? "" : ` ${signal.symbol} ${varies ? "limit" : inUnit(limit, signal.unit)}`;
  const words = `${signal.property}:${shown} ${number(Number(at.toFixed(2)), "s")}`;
  // The label is beside the moment, on the side with more room, and never beyond the ends.
  const long = words.length * LETTER, right = x(at) < (left + width) / 2, value = values[Math.round((at - from) / period)];
  // It is above or below the limit, and beside the largest value if it is as high.
  const line = isTruth || varies ? y0 + height : y(limit), base = line > y0 + 14 ? line - 4 : line + 11;
  const end = width - (base < y0 + 24 ? 70 : 14);
  const start = Math.max(left + 4, Math.min(right ? x(at) + 6 : x(at) - 6 - long, end - long));
  return [
    !isTruth && make("path", { class: "limit failed", d: varies ? curve({ values: limit }, (frame) => x(from + frame * period), y) : `M${x(from)} ${y(limit)}H${x(last)}` }),
    make("line", { class: "decidedat", x1: x(at), x2: x(at), y1: y0, y2: y0 + height }),
    Number.isFinite(value) && make("circle", { class: "decideddot", r: 3.5, cx: x(at), cy: y(value) }),
    make("text", { class: "small limitname", x: start, y: base }, words),
  ];
}

/** The path of a signal, with gaps where it is unknown. */
function curve({ values, step }, x, y) {
  let path = "", last = NaN;
  values.forEach((value, frame) => {
    if (!Number.isFinite(value)) { last = NaN; return; }
    const [px, py] = [x(frame).toFixed(1), y(value).toFixed(1)];
    path += Number.isNaN(last) ? `M${px} ${py}` : step ? `H${px}V${py}` : `L${px} ${py}`;
    last = value;
  });
  return path;
}
