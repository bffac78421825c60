// Poses of all bodies at a moment of a run. The counterpart of `replay.rs`.

/** A vector turned by a quaternion x, y, z, w. */
function turned([i, j, k, w], [x, y, z]) {
  const [a, b, c] = [2 * (j * z - k * y), 2 * (k * x - i * z), 2 * (i * y - j * x)];
  return [x + w * a + j * c - k * b, y + w * b + k * a - i * c, z + w * c + i * b - j * a];
}

/** A point of a pose's frame, in the frame of the pose. */
function placed(pose, point) {
  return turned(pose.slice(3), point).map((value, axis) => value + pose[axis]);
}

/** A point, in the frame of a pose. */
function within(pose, point) {
  const [i, j, k, w] = pose.slice(3);
  return turned([-i, -j, -k, w], point.map((value, axis) => value - pose[axis]));
}

function apart(a, b) {
  return Math.hypot(...a.map((value, axis) => value - b[axis]));
}

class Course {
  constructor(replay) {
    this.tracks = replay.tracks;
    this.period = replay.period;
    this.columns = columnsOf(replay.courses, 7 * replay.tracks.length);
    this.frames = replay.courses.frames;
    this.seconds = Math.max(0, this.frames - 1) * replay.period;
    this.low = replay.low;
    this.grain = replay.grain;
    this.turn = replay.turn;
    this.slot = new Map(this.tracks.map((track, slot) => [track.name, slot]));
    this.grasp = this.graspOf(replay);
  }

  /** The link that carries the grasp point, and the point in its frame: the one in whose frame it moves least. */
  graspOf(replay) {
    const action = replay.actions.find(({ hand }) => hand && hand[0] && hand[1]);
    if (!action) return null;
    const end = Math.min(this.seconds, (action.start ?? 0) + action.seconds);
    const links = this.tracks.map((track, slot) => [track, slot]).filter(([track]) => track.name.startsWith("robot/"));
    const found = links.map(([, slot]) => {
      const [before, after] = [within(this.pose(slot, action.start ?? 0), action.hand[0]), within(this.pose(slot, end), action.hand[1])];
      // Of links that are fixed to each other, the nearest.
      return { slot, point: before, off: apart(before, after) + 1e-3 * Math.hypot(...before) };
    });
    return found.sort((a, b) => a.off - b.off)[0] ?? null;
  }

  /** Position of the grasp point. */
  hand(secs) {
    return this.grasp && placed(this.pose(this.grasp.slot, secs), this.grasp.point);
  }

  value(slot, part, frame) {
    const told = this.columns[7 * slot + part][frame];
    return part < 3 ? this.low[part] + (told & 0xffff) * this.grain : told * this.turn;
  }

  /** Pose of a track, interpolated between two frames: linear, with the shorter rotation. */
  pose(slot, secs) {
    const exact = Math.min(this.frames - 1, Math.max(0, secs / this.period));
    const frame = Math.min(Math.floor(exact), Math.max(0, this.frames - 2)), part = exact - frame;
    const next = Math.min(frame + 1, this.frames - 1);
    const [a, b] = [frame, next].map((at) => Array.from({ length: 7 }, (_, i) => this.value(slot, i, at)));
    const flip = a[3] * b[3] + a[4] * b[4] + a[5] * b[5] + a[6] * b[6] < 0 ? -1 : 1;
    return a.map((value, i) => value + ((i < 3 ? b[i] : flip * b[i]) - value) * part);
  }

  position(name, secs) {
    const slot = this.slot.get(name);
    return slot === undefined ? null : this.pose(slot, secs).slice(0, 3);
  }

  /** Mean position of the robot's links. */
  robot(secs) {
    const links = this.tracks.map((track, slot) => [track, slot]).filter(([track]) => track.name.startsWith("robot/"));
    if (!links.length) return null;
    const sum = [0, 0, 0];
    for (const [, slot] of links) this.pose(slot, secs).slice(0, 3).forEach((value, i) => { sum[i] += value / links.length; });
    return sum;
  }
}
