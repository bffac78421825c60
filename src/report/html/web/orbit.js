// An orbit camera, controlled by mouse, touch or keys.

/** Largest height of the camera, as an angle: just short of above, where it has no direction. Unit: radians. */
const STEEPEST = 1.565;

class Orbit {
  constructor(camera, element, changed) {
    Object.assign(this, { camera, element, changed, turn: -0.9, height: 0.5, distance: 2, scale: 1, centre: [0, 0, 0.6], fingers: new Map() });
    element.addEventListener("pointerdown", (event) => {
      element.setPointerCapture(event.pointerId);
      this.fingers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    element.addEventListener("pointermove", (event) => this.drag(event));
    for (const name of ["pointerup", "pointercancel"]) element.addEventListener(name, (event) => this.fingers.delete(event.pointerId));
    element.addEventListener("wheel", (event) => { event.preventDefault(); this.zoom(Math.exp(event.deltaY * 0.001)); }, { passive: false });
    element.addEventListener("contextmenu", (event) => event.preventDefault());
    element.addEventListener("keydown", (event) => {
      // Arrows alone are the player's.
      const step = event.shiftKey && { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.08], ArrowDown: [0, -0.08] }[event.key];
      if (step) this.rotate(...step);
      else if (event.key === "+" || event.key === "=") this.zoom(0.9);
      else if (event.key === "-") this.zoom(1.1);
      else return;
      event.preventDefault();
    });
  }

  drag(event) {
    const before = this.fingers.get(event.pointerId);
    if (!before) return;
    const [x, y] = [event.clientX - before[0], event.clientY - before[1]];
    const other = [...this.fingers].find(([id]) => id !== event.pointerId)?.[1];
    this.fingers.set(event.pointerId, [event.clientX, event.clientY]);
    if (other) {
      const apart = ([ax, ay]) => Math.hypot(ax - other[0], ay - other[1]);
      this.zoom(apart(before) / Math.max(1, apart([event.clientX, event.clientY])));
    } else if (event.buttons & 2 || event.shiftKey) this.pan(x, y);
    else this.rotate(-x * 0.008, y * 0.006);
  }

  rotate(turn, height) {
    this.turn += turn;
    this.height = Math.min(STEEPEST, Math.max(-0.1, this.height + height));
    this.changed();
  }

  zoom(by) {
    this.scale = Math.min(8, Math.max(0.12, this.scale * by));
    this.changed();
  }

  pan(x, y) {
    const scale = this.distance * this.scale / this.element.clientHeight, [sin, cos] = [Math.sin(this.turn), Math.cos(this.turn)];
    this.centre = [this.centre[0] + sin * x * scale, this.centre[1] - cos * x * scale, this.centre[2] + y * scale];
    this.held = true;
    this.changed();
  }

  place() {
    const away = this.distance * this.scale, flat = Math.cos(this.height) * away, [x, y, z] = this.centre;
    this.camera.position.set(x + flat * Math.cos(this.turn), y + flat * Math.sin(this.turn), z + Math.sin(this.height) * away);
    this.camera.lookAt(x, y, z);
  }
}
