// All quantities over time that can be drawn: those of rules about time, from the recorded poses, joints and contacts. A list
// entry has a name, a group and a unit; its values are made when it is first drawn.

/** Units that are not shown: those of truth values, and of joints, which are metres or radians. */
const BARE = "";

/** The list of a run's quantities. */
function quantitiesOf(replay, course, forms) {
  const times = Array.from({ length: course.frames }, (_, frame) => frame * course.period), start = startOf(replay);
  const first = times.map((secs) => Math.min(course.frames - 1, Math.round(start(secs) / course.period)));
  const slots = course.tracks.map((track, slot) => [track, slot]).filter(([track]) => !track.name.startsWith("robot/"));
  const poses = new Map(), posesOf = (slot) => {
    if (!poses.has(slot)) poses.set(slot, times.map((secs) => course.pose(slot, secs)));
    return poses.get(slot);
  };
  const things = slots.map(([track, slot]) => ({ name: track.name, path: () => posesOf(slot), form: forms[track.form], turns: true }));
  if (course.grasp) things.push({ name: "gripper", path: () => times.map((secs) => course.hand(secs)), turns: false });
  const found = [], add = (group, name, unit, values, more = {}) => found.push({ group, name: group === "" ? name : `${group}: ${name}`, short: name, unit, values, ...more });
  for (const thing of things) quantitiesOfThing(thing, course.period, first, (...args) => add(thing.name, ...args));
  if (replay.joints?.some((of) => of)) quantitiesOfJoints(replay, times, add);
  for (const action of replay.actions) for (const [name] of action.phases ?? []) {
    if (found.some((one) => one.phase === name)) continue;
    add("phases", name, BARE, () => times.map((secs) => Number(replay.actions.some((of) => isInPhase(of, name, secs)))), { phase: name, step: true });
  }
  contactPairs(replay).forEach(([pair, episodes]) => add("contacts", `force ${pair}`, "N", () => times.map((secs) => forceAt(episodes, secs)), { step: true }));
  things.forEach((one, i) => things.slice(i + 1).forEach((other) => {
    const between = (of) => () => { const [a, b] = [one.path(), other.path()]; return times.map((_, frame) => of(a[frame], b[frame])); };
    const pair = `${one.name} – ${other.name}`;
    add("pairs", `distance ${pair}`, "m", between((a, b) => apart(a.slice(0, 3), b.slice(0, 3))));
    add("pairs", `horizontal distance ${pair}`, "m", between((a, b) => apart(a.slice(0, 2), b.slice(0, 2))));
    if (other.name === "gripper") add("pairs", `gap ${pair}`, "m", between((a, b) => closestOf(one.form, a, b.slice(0, 3)).distance));
    add("pairs", `relative speed ${pair}`, "m/s", () => speeds(between((a, b) => (one.turns ? within(a, b.slice(0, 3)) : b.slice(0, 3).map((value, axis) => value - a[axis])))(), course.period));
  }));
  return found;
}

/** Quantities of a body, or of the gripper, whose rotation is not recorded. */
function quantitiesOfThing({ path, turns }, period, first, add) {
  const part = (i) => () => path().map((pose) => pose[i]), places = () => path().map((pose) => pose.slice(0, 3));
  ["x", "y", "z"].forEach((name, i) => add(name, "m", part(i)));
  if (turns) {
    add("yaw", "rad", () => path().map(([, , , i, j, k, w]) => Math.atan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k))));
    add("tilt", "rad", () => path().map(([, , , i, j]) => Math.acos(Math.min(1, Math.max(-1, 1 - 2 * (i * i + j * j))))));
    add("angular speed", "rad/s", () => turningSpeeds(path(), period));
    ["qx", "qy", "qz", "qw"].forEach((name, i) => add(name, BARE, part(3 + i)));
  }
  ["vx", "vy", "vz"].forEach((name, i) => add(name, "m/s", () => slopes(part(i)(), period)));
  add("speed", "m/s", () => speeds(places(), period));
  add("acceleration", "m/s²", () => speeds(velocities(places(), period), period));
  add("upward acceleration", "m/s²", () => slopes(slopes(part(2)(), period), period));
  add("jerk", "m/s³", () => speeds(velocities(velocities(places(), period), period), period));
  const since = (of) => () => { const all = places(); return all.map((place, frame) => of(place, all[first[frame]])); };
  add("rise", "m", since((place, begin) => place[2] - begin[2]));
  add("displacement", "m", since((place, begin) => apart(place, begin)));
  add("path length", "m", () => {
    let length = 0;
    const all = places();
    return all.map((place, frame) => {
      length = first[frame] === frame ? 0 : length + apart(place, all[Math.max(0, frame - 1)]);
      return length;
    });
  });
}

/** Position, velocity, effort and target of each joint, and the base by truth and by belief. */
function quantitiesOfJoints(replay, times, add) {
  const columns = replay.joints.map((of) => of && columnsOf(of.rows, of.columns));
  const column = (pick) => () => {
    const values = times.map(() => NaN);
    replay.joints.forEach((of, i) => {
      const action = replay.actions[i];
      if (!of || action?.start === undefined) return;
      const [at, step] = pick(of);
      if (at < 0) return;
      times.forEach((secs, frame) => {
        const row = Math.round((secs - action.start - of.start) / (of.period || 1));
        if (row >= 0 && row < of.rows.frames) values[frame] = columns[i][at][row] * step;
      });
    });
    return values;
  };
  const [position] = replay.joints.find((of) => of).steps;
  [["true", 0], ["believed", 3]].forEach(([belief, at]) => ["x", "y", "heading"].forEach((name, i) =>
    add("base", `${belief} ${name}`, name === "heading" ? "rad" : "m", column(() => [at + i, position]))));
  const names = [...new Set(replay.joints.flatMap((of) => of?.names ?? []))];
  for (const joint of names) {
    ["position", "velocity", "effort", "target"].forEach((name, i) => add(`joint ${joint}`, name, BARE, column(({ names, steps }) => {
      const at = names.indexOf(joint);
      return [at < 0 ? -1 : 6 + 4 * at + i, steps[i] ?? steps[0]];
    })));
  }
}

function isInPhase({ start, seconds, phases }, name, secs) {
  return start !== undefined && (phases ?? []).some(([of, from], i, all) => of === name && secs >= start + from - 1e-6 && secs < start + (all[i + 1]?.[1] ?? seconds) + 1e-6);
}

/** The recorded contacts of each pair, with their times since the run began. */
function contactPairs(replay) {
  const pairs = new Map();
  for (const { start, contacts } of replay.actions) for (const [a, b, from, to, force] of contacts ?? []) {
    const pair = `${a} – ${b}`;
    if (!pairs.has(pair)) pairs.set(pair, []);
    pairs.get(pair).push([start + from, start + to, force]);
  }
  return [...pairs].sort(([a], [b]) => a.localeCompare(b));
}

function forceAt(episodes, secs) {
  return Math.max(0, ...episodes.filter(([from, to]) => secs >= from - 1e-6 && secs <= to + 1e-6).map(([, , force]) => force));
}

/** Slope of a line through the neighbours of each value. */
function slopes(values, period) {
  return values.map((_, i) => {
    const [a, b] = [Math.max(0, i - 1), Math.min(values.length - 1, i + 1)];
    return a === b ? 0 : (values[b] - values[a]) / ((b - a) * period);
  });
}

function velocities(places, period) {
  const by = [0, 1, 2].map((axis) => slopes(places.map((place) => place[axis]), period));
  return places.map((_, frame) => by.map((values) => values[frame]));
}

function speeds(places, period) {
  return velocities(places, period).map((velocity) => Math.hypot(...velocity));
}

function turningSpeeds(poses, period) {
  return poses.map((_, i) => {
    const [a, b] = [Math.max(0, i - 1), Math.min(poses.length - 1, i + 1)];
    const [one, other] = [poses[a].slice(3), poses[b].slice(3)], length = Math.hypot(...one) * Math.hypot(...other) || 1;
    const along = Math.min(1, Math.abs(one.reduce((sum, value, at) => sum + value * other[at], 0) / length));
    return a === b ? 0 : 2 * Math.acos(along) / ((b - a) * period);
  });
}
