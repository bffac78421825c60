// A run in 3D: fixed bodies, moving bodies, lights and a camera that follows the hand and the target.

/** Margin around the framed points. Unit: metres. */
const AROUND_M = 0.3;
/** A contact is framed from so long before it until so long after it. Unit: seconds. */
const BESIDE_SECS = 0.5;
/** Things further than this from the centre of the view have no label. Unit: metres. */
const LABELLED_M = 1.5;
/** Width of the star at a contact, at any distance: as wide as this at 1 m. Unit: metres. */
const STAR_M = 0.08;
/** Vertical angle of the picture, and of that of the robot's camera. Unit: degrees. */
const VIEW_DEG = 38;
const CAMERA_DEG = 44;
/** Angle between the camera's direction and the robot's reach. Unit: radians. */
const ASIDE = 1.95;

class Stage {
  constructor(three, replay, course, forms, canvas) {
    this.three = three;
    this.course = course;
    this.canvas = canvas;
    this.target = replay.objects.find((object) => object.role === "target" && this.course.slot.has(object.id))?.id;
    this.renderer = new three.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = three.PCFShadowMap;
    this.renderer.toneMapping = three.ACESFilmicToneMapping;
    this.scene = new three.Scene();
    this.camera = new three.PerspectiveCamera(VIEW_DEG, 1, 0.02, 60);
    this.camera.up.set(0, 0, 1);
    this.lights();
    this.labels = new Labels();
    this.fill(replay, forms);
    this.name(replay, forms);
    this.orbit = new Orbit(this.camera, canvas, () => { this.eye = null; this.draw(); });
    this.sight = sightOf(course, replay.camera);
    /** The views that this run has. */
    this.views = ["side", "top", this.course.grasp && "hand", this.sight && "camera"].filter(Boolean);
    this.begin(0);
  }

  lights() {
    const { three, scene } = this;
    scene.add(new three.HemisphereLight(0xffffff, 0xa89f94, 2.1));
    this.sun = new three.DirectionalLight(0xfff4e4, 2.2);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(1024, 1024);
    Object.assign(this.sun.shadow.camera, { left: -2.2, right: 2.2, top: 2.2, bottom: -2.2, near: 0.5, far: 12 });
    this.sun.shadow.bias = -0.0006;
    this.sun.shadow.normalBias = 0.01;
    scene.add(this.sun, this.sun.target);
  }

  fill(replay, forms) {
    const { three, scene } = this;
    this.floor = new three.Mesh(new three.PlaneGeometry(40, 40), new three.MeshStandardMaterial({ roughness: 1, map: this.tiles() }));
    this.floor.receiveShadow = true;
    this.floor.position.z = -0.001;
    scene.add(this.floor);
    for (const body of replay.still) {
      const group = bodyOf(three, forms[body.seen ?? body.form], body.kind === "Wall" ? "wall" : body.role ?? "platform");
      group.position.set(...body.at.slice(0, 3));
      group.quaternion.set(...body.at.slice(3)).normalize();
      scene.add(group);
    }
    this.moving = this.course.tracks.map((track) => {
      const group = bodyOf(three, forms[track.seen ?? track.form], track.name.startsWith("robot/") ? "robot" : track.role ?? "other");
      scene.add(group);
      return group;
    });
    this.seen = new three.Group();
    this.boxes = replay.actions.flatMap((action) => action.seen ?? []).map((thing) => {
      const box = new three.LineSegments(new three.EdgesGeometry(new three.BoxGeometry(...thing.size)), new three.LineBasicMaterial({ color: 0xb43cb0 }));
      const [x, y, z] = thing.at;
      box.quaternion.set(...thing.at.slice(3)).normalize();
      box.position.set(x, y, z + thing.size[2] / 2);
      this.seen.add(box);
      return { thing, box };
    });
    this.gap = new three.Line(new three.BufferGeometry().setFromPoints([new three.Vector3(), new three.Vector3()]), new three.LineBasicMaterial({ color: LOOKS.target[0], depthTest: false, transparent: true }));
    this.gap.renderOrder = 1;
    this.gap.frustumCulled = false;
    scene.add(this.gap);
    scene.add(this.seen, this.trail());
    this.pressed = replay.pressed && { ...replay.pressed, mark: this.mark(replay.pressed) };
    if (this.pressed) scene.add(this.pressed.mark);
  }

  /** Labels for the hardest contact, the hand and all things, and for the gap between hand and target. */
  name(replay, forms) {
    const { course, labels, pressed } = this, above = (form) => form.reduce((most, part) => Math.max(most, part.at[2] + heightOf(part) / 2), 0) + 0.02;
    const near = (point) => point && apart(point, this.centre ?? point) < LABELLED_M ? point : null;
    const target = this.target && course.slot.get(this.target);
    this.form = target !== undefined && forms[course.tracks[target].form];
    if (pressed) {
      const still = replay.still.find(({ name }) => name === pressed.thing), track = course.slot.get(pressed.thing);
      const form = forms[(still ?? course.tracks[track])?.form], corners = form && cornersOf(form);
      const pose = (secs) => still?.at ?? course.pose(track, secs);
      this.tag = labels.add("touch", pressed.label, () => pressed.at, (secs) => corners && corners.map((corner) => placed(pose(secs), corner)), true);
    }
    this.told = labels.add("gap", "", () => this.middle);
    const corners = new Map(course.tracks.map((track, slot) => [slot, track.name.startsWith("robot/") ? [] : cornersOf(forms[track.form])]));
    const cornersAt = (slot) => (secs) => { const pose = course.pose(slot, secs); return corners.get(slot).map((corner) => placed(pose, corner)); };
    const body = (track, slot) => labels.add(track.role === "target" ? "target" : "other", track.name, (secs) => {
      const [x, y, z] = course.position(track.name, secs);
      return near([x, y, z + above(forms[course.tracks[slot].form])]);
    }, cornersAt(slot));
    const things = course.tracks.map((track, slot) => [track, slot]).filter(([track]) => !track.name.startsWith("robot/"));
    things.forEach(([, slot]) => labels.spare(cornersAt(slot)));
    things.filter(([track]) => track.role === "target").forEach(([track, slot]) => body(track, slot));
    if (course.grasp) labels.add("hand", "gripper", (secs) => { const [x, y, z] = course.hand(secs); return [x, y, z + 0.06]; });
    things.filter(([track]) => track.role !== "target").forEach(([track, slot]) => body(track, slot));
    const furniture = new Set(replay.still.map((still) => still.name));
    for (const { thing, box } of this.boxes.filter((one) => !furniture.has(one.thing.name))) {
      const [x, y, z] = thing.at;
      labels.add("seen", `seen: ${thing.name}`, () => this.seen.visible && box.visible ? near([x, y, z + thing.size[2]]) : null);
    }
    for (const still of replay.still.filter(({ kind }) => kind !== "Wall" && kind !== "robot")) {
      const [x, y, z] = still.at;
      labels.add("other furniture", still.name, () => near([x, y, z + above(forms[still.form])]));
    }
  }

  /** The line from the hand to the nearest point of the target, with its length. */
  measure(secs) {
    const hand = this.course.hand(secs), slot = this.target && this.course.slot.get(this.target);
    const closest = hand && this.form && closestOf(this.form, this.course.pose(slot, secs), hand);
    this.gap.visible = Boolean(closest && closest.distance > 0.01 && this.labels.shown);
    this.middle = this.gap.visible ? hand.map((value, axis) => (value + closest.on[axis]) / 2) : null;
    if (!this.gap.visible) return;
    this.gap.geometry.setFromPoints([hand, closest.on].map((point) => new this.three.Vector3(...point)));
    this.told.textContent = inUnit(closest.distance, "m");
  }

  /** A star at the hardest contact. It is visible through bodies; its words are among the labels, beside the thing. */
  mark({ at }) {
    const { three } = this, size = 128, middle = size / 2;
    const picture = make("canvas", { width: size, height: size }), pen = picture.getContext("2d");
    pen.beginPath();
    for (let step = 0; step < 16; step++) {
      const angle = step * Math.PI / 8, reach = step % 2 ? 22 : 48;
      pen.lineTo(middle + reach * Math.sin(angle), middle - reach * Math.cos(angle));
    }
    pen.closePath();
    Object.assign(pen, { fillStyle: "#d3301f", strokeStyle: "#fff", lineWidth: 7, lineJoin: "round" });
    pen.stroke();
    pen.fill();
    const map = new three.CanvasTexture(picture);
    map.colorSpace = three.SRGBColorSpace;
    const sprite = new three.Sprite(new three.SpriteMaterial({ map, depthTest: false, transparent: true, toneMapped: false, fog: false, sizeAttenuation: false }));
    sprite.scale.set(STAR_M, STAR_M, 1);
    sprite.position.set(...at);
    sprite.renderOrder = 1;
    return sprite;
  }

  /** The floor's tiles, 0.5 m wide. */
  tiles() {
    const tile = make("canvas", { width: 256, height: 256 }), pen = tile.getContext("2d");
    pen.fillStyle = "#fff";
    pen.fillRect(0, 0, 256, 256);
    pen.strokeStyle = "rgb(0 0 0 / 14%)";
    pen.lineWidth = 4;
    pen.strokeRect(0, 0, 256, 256);
    const texture = new this.three.CanvasTexture(tile);
    texture.wrapS = texture.wrapT = this.three.RepeatWrapping;
    texture.repeat.set(80, 80);
    texture.anisotropy = 8;
    texture.colorSpace = this.three.SRGBColorSpace;
    return texture;
  }

  /** The path of the target. */
  trail() {
    const { three, course, target } = this;
    const points = target ? Array.from({ length: course.frames }, (_, frame) => new three.Vector3(...course.position(target, frame * course.period))) : [];
    return new three.Line(new three.BufferGeometry().setFromPoints(points), new three.LineBasicMaterial({ color: LOOKS.target[0], transparent: true, opacity: 0.7 }));
  }

  /** A sphere around the hand and the target, and the marked contact around its time. */
  focus(secs) {
    const target = this.target && this.course.position(this.target, secs), hand = this.course.hand(secs) ?? this.course.robot(secs);
    const points = [hand, target].filter(Boolean);
    if (this.pressed && secs >= this.pressed.secs[0] - BESIDE_SECS && secs <= this.pressed.secs[1] + BESIDE_SECS) points.push(this.pressed.at);
    if (!points.length) return { centre: [0, 0, 0.5], radius: 0.9 };
    const [low, high] = [Math.min, Math.max].map((of) => [0, 1, 2].map((axis) => of(...points.map((point) => point[axis]))));
    return { centre: low.map((value, axis) => (value + high[axis]) / 2), radius: Math.min(1.6, apart(low, high) / 2 + AROUND_M) };
  }

  /** The distance from which a sphere fills the picture. */
  away(radius) {
    const up = VIEW_DEG * Math.PI / 360, across = Math.atan(Math.tan(up) * this.camera.aspect);
    return radius / Math.sin(Math.min(up, across));
  }

  /** The view of a moment: from the side of the robot's reach, on which fewer things are in the way. */
  begin(secs) {
    const target = (this.target && this.course.position(this.target, secs)) ?? [1, 0, 0], way = this.way(secs);
    const others = this.course.tracks.filter((track) => !track.name.startsWith("robot/") && track.name !== this.target).map((track) => this.course.position(track.name, secs));
    const hidden = (turn) => others.filter(([x, y]) => {
      const [ahead, aside] = [(x - target[0]) * Math.cos(turn) + (y - target[1]) * Math.sin(turn), (y - target[1]) * Math.cos(turn) - (x - target[0]) * Math.sin(turn)];
      return ahead > 0 && ahead < 1 && Math.abs(aside) < 0.12;
    }).length;
    const turn = hidden(way + ASIDE) < hidden(way - ASIDE) ? way + ASIDE : way - ASIDE, { centre, radius } = this.focus(secs);
    Object.assign(this.orbit, { turn, height: 0.46, distance: this.away(radius), centre });
  }

  /** Looks from the side as at first, from above, along the hand, or from the robot's camera. Turning the picture leaves the last two. */
  look(view, secs) {
    Object.assign(this.orbit, { held: false, scale: 1 });
    this.eye = view === "hand" ? (at) => handEye(this.course, at) : view === "camera" ? this.sight : null;
    this.begin(secs);
    if (view === "top") Object.assign(this.orbit, { turn: this.way(secs) + Math.PI, height: STEEPEST });
    this.show(secs);
  }

  /** Direction from the robot to the target. Unit: radians. */
  way(secs) {
    const robot = this.course.robot(secs) ?? [0, 0, 0], target = (this.target && this.course.position(this.target, secs)) ?? [1, 0, 0];
    return Math.atan2(target[1] - robot[1], target[0] - robot[0]);
  }

  theme() {
    const dark = colourOf("scheme") === "dark";
    this.scene.background = new this.three.Color(dark ? 0x171d26 : 0xeef0f2);
    this.scene.fog = new this.three.Fog(this.scene.background, 5, 13);
    this.floor.material.color.set(dark ? 0x2a3340 : 0xdfe2e5);
    this.draw();
  }

  /** Shows a moment. */
  show(secs, follow = true) {
    this.secs = secs;
    this.course.tracks.forEach((_, slot) => {
      const pose = this.course.pose(slot, secs), group = this.moving[slot];
      group.position.set(...pose.slice(0, 3));
      group.quaternion.set(...pose.slice(3)).normalize();
    });
    if (this.pressed) {
      const [from, to] = this.pressed.secs;
      const lasts = secs >= from && secs <= to;
      this.pressed.mark.material.opacity = lasts ? 1 : 0.35;
      this.tag.classList.toggle("over", !lasts);
    }
    for (const { thing, box } of this.boxes) {
      // Of several looks at a thing, the last one so far.
      const since = thing.secs ?? 0;
      box.visible = since <= secs && !this.boxes.some((other) => other.thing.name === thing.name && other.thing !== thing && other.thing.secs > since && other.thing.secs <= secs);
    }
    const { centre, radius } = this.focus(secs), focus = centre, distance = this.away(radius), part = this.near ? 0.12 : 1;
    this.centre = centre;
    if (follow && !this.orbit.held) {
      this.orbit.centre = this.orbit.centre.map((value, i) => value + (focus[i] - value) * part);
      this.orbit.distance += (distance - this.orbit.distance) * part;
    }
    this.measure(secs);
    this.sun.position.set(focus[0] + 1.6, focus[1] - 2.2, focus[2] + 4.2);
    this.sun.target.position.set(...focus);
    this.draw();
  }

  draw() {
    this.waiting ??= requestAnimationFrame(() => { this.waiting = null; this.paint(); });
  }

  paint() {
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    if (!width || !height) return;
    const size = this.renderer.getSize(new this.three.Vector2());
    if (size.x !== width || size.y !== height) {
      this.renderer.setPixelRatio(Math.min(2, devicePixelRatio));
      this.renderer.setSize(width, height, false);
      this.camera.aspect = width / height;
      this.camera.updateProjectionMatrix();
      if (!this.orbit.held) this.orbit.distance = this.away(this.focus(this.secs ?? 0).radius);
    }
    const eye = this.eye?.(this.secs ?? 0), angle = eye?.angle ?? VIEW_DEG;
    if (this.camera.fov !== angle) {
      this.camera.fov = angle;
      this.camera.updateProjectionMatrix();
    }
    if (eye) {
      this.camera.up.set(...eye.up);
      this.camera.position.set(...eye.from);
      this.camera.lookAt(...eye.to);
    } else {
      this.camera.up.set(0, 0, 1);
      this.orbit.place();
    }
    this.renderer.render(this.scene, this.camera);
    this.labels.element.hidden = !this.labels.shown;
    if (this.labels.shown) this.labels.place(this.three, this.camera, this.secs ?? 0, width, height);
  }

  /** Renders a moment as a picture, with its own camera. */
  picture(secs, into) {
    const { orbit, eye } = this, before = [this.secs ?? 0, this.near], view = { centre: orbit.centre, distance: orbit.distance, scale: orbit.scale, held: orbit.held };
    Object.assign(orbit, { scale: 1, held: false });
    this.near = false;
    this.eye = null;
    this.show(secs, true);
    this.paint();
    const [width, height] = [this.canvas.width, this.canvas.height], pen = into.getContext("2d");
    into.width = 480;
    into.height = Math.round(480 * height / Math.max(1, width));
    pen.drawImage(this.canvas, 0, 0, into.width, into.height);
    Object.assign(orbit, view);
    this.near = before[1];
    this.eye = eye;
    this.show(before[0], false);
  }

  end() {
    cancelAnimationFrame(this.waiting);
    this.scene.traverse((thing) => { thing.geometry?.dispose(); thing.material?.map?.dispose(); thing.material?.dispose?.(); });
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }
}
