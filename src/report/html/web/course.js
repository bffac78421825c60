// Poses of all bodies at a moment of a run. The counterpart of `replay.rs`.

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
