// Outlines of tables from above, from the shapes of runs that can be played back.

/** Surfaces of at most so many models are outlined. */
const MOST_OUTLINES = 4;

let outlinesFound;

/** For each model of surface: its outline by the first axis of the plane, in that plane's frame. */
function outlinesOf(runs) {
  outlinesFound ??= findOutlines(runs);
  return outlinesFound;
}

async function findOutlines(runs) {
  const byModel = new Map(), found = [];
  for (const id of runs.summary.served ? Array.from(runs.order, (run) => runs.id(run)) : runs.replayed.keys()) {
    const model = runs.value("surface_model", runs.find(id));
    if (model && !byModel.has(model) && byModel.size < MOST_OUTLINES) byModel.set(model, id);
  }
  for (const [model, id] of byModel) {
    const { replay, forms } = await replayOf(runs, id);
    const surface = replay.objects.find((object) => object.role === "platform" && object.model === model);
    const body = replay.still?.find((still) => still.name === surface?.id);
    const points = body && outlineOf(forms[body.form]);
    if (!points) continue;
    // In the world, only surfaces that stay where they are can be outlined.
    const inTheWorld = sameSurface(runs) ? [{ model, points: points.map((point) => inWorld(point, surface)) }] : [];
    found.push({ surface_x_m: [{ model, points }], target_x_m: inTheWorld });
  }
  return found;
}

/** Whether all runs have their surface at the same place. */
function sameSurface(runs) {
  const of = (name) => runs.parameter.get(name)?.values;
  const [sx, sy, wx, wy] = ["surface_x_m", "surface_y_m", "target_x_m", "target_y_m"].map(of);
  if (!sx || !sy || !wx || !wy) return false;
  const shifts = (a, b) => { const [low, high] = rangeOf(a.map((value, run) => b[run] - value), 0); return high - low; };
  return shifts(sx, wx) < 0.005 && shifts(sy, wy) < 0.005;
}

function inWorld([x, y], { x: left, y: ahead, yaw }) {
  return [left + Math.cos(yaw) * x - Math.sin(yaw) * y, ahead + Math.sin(yaw) * x + Math.cos(yaw) * y];
}

/** The outline of a shape from above: that of its part with the largest area. Frame: the body's. */
function outlineOf(form) {
  const outlines = form.map(partOutline).filter((points) => points.length > 2);
  const area = (points) => Math.abs(points.reduce((sum, [x, y], i) => {
    const [nextX, nextY] = points[(i + 1) % points.length];
    return sum + x * nextY - nextX * y;
  }, 0));
  return outlines.sort((a, b) => area(b) - area(a))[0] ?? null;
}

function partOutline(part) {
  const place = (point) => { const [x, y] = placed(part.at, point); return [x, y]; };
  const round = (radius) => Array.from({ length: 48 }, (_, i) => place([radius * Math.cos(i * Math.PI / 24), radius * Math.sin(i * Math.PI / 24), 0]));
  switch (part.kind) {
    case "box": return around([0, 1, 2, 3, 4, 5, 6, 7].map((corner) => place(part.size.map((size, axis) => (corner >> axis & 1 ? size : -size) / 2))));
    case "cylinder": case "capsule": case "sphere": return round(part.radius);
    case "tube": return round(Math.max(part.low, part.high));
    case "hull": return around(part.points.map(place));
    default: return [];
  }
}

/** The convex hull of points in a plane, counter-clockwise (Andrew's monotone chain). */
function around(points) {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const half = (list) => {
    const chain = [];
    for (const point of list) {
      while (chain.length > 1 && turn(chain.at(-2), chain.at(-1), point) <= 1e-12) chain.pop();
      chain.push(point);
    }
    return chain.slice(0, -1);
  };
  const turn = (a, b, c) => (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  return [...half(sorted), ...half(sorted.reverse())];
}
