// Points of shapes that are closest to a given point. Unit: metres.

/** Steps of the search on a hull; each halves the error at least. */
const HULL_STEPS = 60;

/** The point of a body that is closest to a point, and its distance: 0 inside. */
function closestOf(form, pose, point) {
  const inBody = within(pose, point);
  let best = null;
  for (const part of form) {
    const local = within(part.at, inBody), on = closestOn(part, local), distance = apart(on, local);
    if (!best || distance < best.distance) best = { distance, on: placed(pose, placed(part.at, on)) };
  }
  return best;
}

/** The closest point of a part, in the part's frame. */
function closestOn(part, point) {
  const [x, y, z] = point, clamp = (value, half) => Math.min(half, Math.max(-half, value));
  const onBall = (centre, radius) => {
    const way = point.map((value, axis) => value - centre[axis]), length = Math.hypot(...way);
    return length <= radius ? point : centre.map((value, axis) => value + way[axis] * radius / length);
  };
  // From the inner lower corner, counter-clockwise.
  const wall = (inLow, outLow, inHigh, outHigh) => [[inLow, -part.height / 2], [outLow, -part.height / 2], [outHigh, part.height / 2], [inHigh, part.height / 2]];
  switch (part.kind) {
    case "box": return point.map((value, axis) => clamp(value, part.size[axis] / 2));
    case "sphere": return onBall([0, 0, 0], part.radius);
    case "capsule": return onBall([0, 0, clamp(z, part.height / 2)], part.radius);
    case "cylinder": return onRevolved(x, y, z, wall(0, part.radius, 0, part.radius));
    case "tube": return onRevolved(x, y, z, wall(part.low - part.wall, part.low, part.high - part.wall, part.high));
    case "hull": return onHull(part.points, point);
    default: return [0, 0, 0];
  }
}

/** The closest point of a solid of revolution about z, whose cross-section is a convex polygon of radius and height. */
function onRevolved(x, y, z, corners) {
  const away = Math.hypot(x, y);
  let best = null, inside = true;
  corners.forEach(([r0, z0], i) => {
    const [r1, z1] = corners[(i + 1) % corners.length], [dr, dz] = [r1 - r0, z1 - z0];
    if (dr * (z - z0) - dz * (away - r0) < 0) inside = false;
    const share = Math.min(1, Math.max(0, ((away - r0) * dr + (z - z0) * dz) / (dr * dr + dz * dz || 1)));
    const [r, up] = [r0 + share * dr, z0 + share * dz], distance = Math.hypot(away - r, z - up);
    if (!best || distance < best.distance) best = { distance, r, up };
  });
  if (inside) return [x, y, z];
  // On the axis, every direction is as near.
  return away > 1e-9 ? [x * best.r / away, y * best.r / away, best.up] : [best.r, 0, best.up];
}

/** The closest point of the convex hull of points, by Frank and Wolfe's method with away steps. */
function onHull(points, point) {
  const minus = (a, b) => a.map((value, axis) => value - b[axis]), dot = (a, b) => a.reduce((sum, value, axis) => sum + value * b[axis], 0);
  let at = points.reduce((best, one) => (apart(one, point) < apart(best, point) ? one : best));
  const weights = new Map([[points.indexOf(at), 1]]);
  for (let step = 0; step < HULL_STEPS; step++) {
    const slope = minus(at, point), along = points.map((one) => dot(slope, one));
    const to = along.indexOf(Math.min(...along));
    const from = [...weights.keys()].reduce((most, i) => (along[i] > along[most] ? i : most), weights.keys().next().value);
    const gain = dot(slope, at) - along[to], loss = along[from] - dot(slope, at);
    if (gain < 1e-9) break;
    const ahead = gain >= loss, way = ahead ? minus(points[to], at) : minus(at, points[from]);
    const share = weights.get(from), limit = ahead ? 1 : share / (1 - share || 1e-12);
    const length = Math.min(limit, Math.max(0, -dot(slope, way) / (dot(way, way) || 1)));
    for (const [i, weight] of weights) weights.set(i, weight * (ahead ? 1 - length : 1 + length));
    if (ahead) weights.set(to, (weights.get(to) ?? 0) + length);
    else weights.set(from, weights.get(from) - length);
    for (const [i, weight] of weights) if (weight < 1e-9) weights.delete(i);
    at = at.map((value, axis) => value + length * way[axis]);
  }
  return at;
}
