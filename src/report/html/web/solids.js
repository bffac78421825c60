// Converts shapes to three.js geometry. The counterpart of `shapes.rs`. Unit: metres; z up.

/** The geometry of one part of a shape, in the part's frame. */
function geometryOf(three, part) {
  const upright = (geometry) => geometry.rotateX(Math.PI / 2);
  switch (part.kind) {
    case "box": return new three.BoxGeometry(...part.size);
    case "sphere": return new three.SphereGeometry(part.radius, 24, 16);
    case "cylinder": return upright(new three.CylinderGeometry(part.radius, part.radius, part.height, 32));
    case "capsule": return upright(new three.CapsuleGeometry(part.radius, part.height, 8, 20));
    case "tube": return upright(tube(three, part));
    case "hull": return hull(three, part.points);
    case "mesh": return mesh(three, part);
    default: return new three.BoxGeometry(0.01, 0.01, 0.01);
  }
}

/** Height of a part that stands upright, from its middle up and down. */
function heightOf(part) {
  switch (part.kind) {
    case "box": return part.size[2];
    case "sphere": return 2 * part.radius;
    case "capsule": return part.height + 2 * part.radius;
    case "hull": return 2 * Math.max(...part.points.map((point) => point[2]));
    default: return part.height ?? 0;
  }
}

/** The corners of the box around a shape, in the body's frame. */
function cornersOf(form) {
  const low = [Infinity, Infinity, Infinity], high = low.map((value) => -value);
  const most = ({ radius, height, size, low: foot, high: top, kind }) => kind === "box" ? size.map((value) => value / 2) : kind === "tube" ? [Math.max(foot, top), Math.max(foot, top), height / 2]
    : kind === "sphere" ? [radius, radius, radius] : kind === "capsule" ? [radius, radius, height / 2 + radius] : [radius ?? 0, radius ?? 0, (height ?? 0) / 2];
  for (const part of form) {
    const half = part.kind !== "hull" && most(part);
    for (const point of part.kind === "hull" ? part.points : cornersBetween(half.map((value) => -value), half)) {
      placed(part.at, point).forEach((value, axis) => { low[axis] = Math.min(low[axis], value); high[axis] = Math.max(high[axis], value); });
    }
  }
  return cornersBetween(low, high);
}

function cornersBetween(low, high) {
  return [0, 1, 2, 3, 4, 5, 6, 7].map((corner) => low.map((value, axis) => (corner >> axis & 1 ? high[axis] : value)));
}

function tube(three, { low, high, wall, height }) {
  const corner = (radius, y) => new three.Vector2(Math.max(radius, 1e-4), y);
  return new three.LatheGeometry([corner(low, -height / 2), corner(high, height / 2), corner(high - wall, height / 2),
    corner(low - wall, -height / 2), corner(low, -height / 2)], 32);
}

/** The convex hull of a few points: all planes through three points with no point beyond them. */
function hull(three, points) {
  const at = points.map((point) => new three.Vector3(...point));
  const middle = at.reduce((sum, point) => sum.add(point), new three.Vector3()).divideScalar(Math.max(1, at.length));
  const corners = [], faces = new Set();
  const [side, other, normal] = [new three.Vector3(), new three.Vector3(), new three.Vector3()];
  for (let i = 0; i < at.length; i++) for (let j = i + 1; j < at.length; j++) for (let k = j + 1; k < at.length; k++) {
    normal.crossVectors(side.subVectors(at[j], at[i]), other.subVectors(at[k], at[i]));
    if (normal.length() < 1e-12) continue;
    normal.normalize();
    if (normal.dot(side.subVectors(at[i], middle)) < 0) normal.negate();
    const reach = normal.dot(at[i]) + 1e-6;
    if (at.some((point) => normal.dot(point) > reach)) continue;
    const face = [normal.x, normal.y, normal.z, normal.dot(at[i])].map((value) => Math.round(value * 1e4)).join();
    if (faces.has(face)) continue;
    faces.add(face);
    corners.push(...fan(three, at.filter((point) => normal.dot(point) > reach - 2e-6), normal));
  }
  const geometry = new three.BufferGeometry().setFromPoints(corners);
  geometry.computeVertexNormals();
  return geometry;
}

/** A mesh: its numbers are differences from the previous ones (see `shapes.rs`). */
function mesh(three, { points, faces }) {
  const at = [], corners = [], last = [0, 0, 0];
  points.forEach((step, i) => at.push(last[i % 3] += step));
  for (let i = 0, first = 0; i < faces.length; i += 3) {
    first += faces[i];
    for (const corner of [first, first + faces[i + 1], first + faces[i + 2]]) corners.push(...at.slice(3 * corner, 3 * corner + 3).map((value) => value / 1e4));
  }
  const geometry = new three.BufferGeometry();
  geometry.setAttribute("position", new three.Float32BufferAttribute(corners, 3));
  geometry.computeVertexNormals();
  return geometry;
}

/** Triangulates a planar convex face, counter-clockwise seen from outside. */
function fan(three, points, normal) {
  const middle = points.reduce((sum, point) => sum.add(point), new three.Vector3()).divideScalar(points.length);
  const u = new three.Vector3().subVectors(points[0], middle).normalize(), v = new three.Vector3().crossVectors(normal, u);
  const turn = (point) => { const away = point.clone().sub(middle); return Math.atan2(away.dot(v), away.dot(u)); };
  const around = [...points].sort((a, b) => turn(a) - turn(b));
  return around.slice(2).flatMap((point, i) => [around[0], around[i + 1], point]);
}

const LOOKS = {
  robot: [0x86a5c6, 0.5, 0.15], target: [0x2f7fe0, 0.35, 0.0], other: [0xaab3bd, 0.55, 0.0],
  obstacle: [0xd08a2e, 0.6, 0.0], platform: [0xd9c29a, 0.8, 0.0], wall: [0xb9c0c9, 0.9, 0.0],
};

/** A body with its shape, as a movable group. */
function bodyOf(three, form, look) {
  const [colour, roughness, metalness] = LOOKS[look] ?? LOOKS.other;
  const material = new three.MeshStandardMaterial({ color: colour, roughness, metalness, side: three.DoubleSide });
  const coloured = new Map();
  const materialOf = (part) => {
    if (part.colour === undefined) return material;
    if (!coloured.has(part.colour)) {
      const own = material.clone();
      own.color.set(part.colour);
      coloured.set(part.colour, own);
    }
    return coloured.get(part.colour);
  };
  if (look === "wall") Object.assign(material, { transparent: true, opacity: 0.16, depthWrite: false });
  const group = new three.Group();
  for (const part of form) {
    const mesh = new three.Mesh(geometryOf(three, part), materialOf(part));
    mesh.position.set(...part.at.slice(0, 3));
    mesh.quaternion.set(...part.at.slice(3)).normalize();
    mesh.castShadow = look !== "wall";
    mesh.receiveShadow = look !== "wall";
    group.add(mesh);
  }
  return group;
}
