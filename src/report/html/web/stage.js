// A run in 3D: fixed bodies, moving bodies, lights and a camera.

class Stage {
  constructor(three, replay, forms, canvas) {
    this.three = three;
    this.course = new Course(replay);
    this.canvas = canvas;
    this.target = replay.objects.find((object) => object.role === "target" && this.course.slot.has(object.id))?.id;
    this.renderer = new three.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = three.PCFShadowMap;
    this.renderer.toneMapping = three.ACESFilmicToneMapping;
    this.scene = new three.Scene();
    this.camera = new three.PerspectiveCamera(38, 1, 0.02, 60);
    this.camera.up.set(0, 0, 1);
    this.lights();
    this.fill(replay, forms);
    this.orbit = new Orbit(this.camera, canvas, () => this.draw());
    this.begin();
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
      const group = bodyOf(three, forms[body.form], body.kind === "Wall" ? "wall" : body.role ?? "platform");
      group.position.set(...body.at.slice(0, 3));
      group.quaternion.set(...body.at.slice(3)).normalize();
      scene.add(group);
    }
    this.moving = this.course.tracks.map((track) => {
      const group = bodyOf(three, forms[track.form], track.name.startsWith("robot/") ? "robot" : track.role ?? "other");
      scene.add(group);
      return group;
    });
    this.seen = new three.Group();
    for (const thing of replay.actions.flatMap((action) => action.seen ?? [])) {
      const box = new three.LineSegments(new three.EdgesGeometry(new three.BoxGeometry(...thing.size)), new three.LineBasicMaterial({ color: 0xb43cb0 }));
      const [x, y, z] = thing.at;
      box.quaternion.set(...thing.at.slice(3)).normalize();
      box.position.set(x, y, z + thing.size[2] / 2);
      this.seen.add(box);
    }
    this.seen.visible = false;
    scene.add(this.seen, this.trail());
    this.pressed = replay.pressed && { ...replay.pressed, mark: this.mark(replay.pressed) };
    if (this.pressed) scene.add(this.pressed.mark);
  }

  /** A star with its label at the hardest contact. It is visible through bodies. */
  mark({ at, label }) {
    const { three } = this, width = 1024, height = 128, middle = [64, 64];
    const picture = make("canvas", { width, height }), pen = picture.getContext("2d");
    pen.beginPath();
    for (let step = 0; step < 16; step++) {
      const angle = step * Math.PI / 8, reach = step % 2 ? 22 : 48;
      pen.lineTo(middle[0] + reach * Math.sin(angle), middle[1] - reach * Math.cos(angle));
    }
    pen.closePath();
    pen.font = "600 44px system-ui, sans-serif";
    Object.assign(pen, { fillStyle: "#d3301f", strokeStyle: "#fff", lineWidth: 7, lineJoin: "round" });
    pen.stroke();
    pen.fill();
    pen.strokeText(label, 124, 79, width - 130);
    pen.fillText(label, 124, 79, width - 130);
    const map = new three.CanvasTexture(picture);
    map.colorSpace = three.SRGBColorSpace;
    const sprite = new three.Sprite(new three.SpriteMaterial({ map, depthTest: false, transparent: true, toneMapped: false, fog: false }));
    sprite.center.set(middle[0] / width, middle[1] / height);
    sprite.scale.set(1.5, 1.5 * height / width, 1);
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

  /** The camera's focus: the target while the robot is near it, else the robot. */
  focus(secs) {
    const robot = this.course.robot(secs), target = this.target && this.course.position(this.target, secs);
    if (!robot) return target ?? [0, 0, 0.5];
    if (!target || Math.hypot(target[0] - robot[0], target[1] - robot[1]) > 1.6) return [robot[0], robot[1], 0.55];
    return target.map((value, i) => value + (robot[i] - value) * (i < 2 ? 0.36 : 0.1));
  }

  /** The initial view: from the side of the line from the robot to the target. */
  begin() {
    const robot = this.course.robot(0) ?? [0, 0, 0], target = (this.target && this.course.position(this.target, 0)) ?? [1, 0, 0];
    const way = Math.atan2(target[1] - robot[1], target[0] - robot[0]);
    Object.assign(this.orbit, { turn: way - 1.95, height: 0.46, distance: 2.75, centre: this.focus(0) });
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
      this.pressed.mark.material.opacity = secs >= from && secs <= to ? 1 : 0.35;
    }
    const focus = this.focus(secs);
    if (follow && !this.orbit.held) {
      this.orbit.centre = this.near ? this.orbit.centre.map((value, i) => value + (focus[i] - value) * 0.12) : focus;
    }
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
    }
    this.orbit.place();
    this.renderer.render(this.scene, this.camera);
  }

  /** Renders a moment as a picture, with its own camera. */
  picture(secs, into) {
    const before = [this.secs ?? 0, this.orbit.centre, this.near];
    this.near = false;
    this.show(secs, true);
    this.paint();
    const [width, height] = [this.canvas.width, this.canvas.height], pen = into.getContext("2d");
    into.width = 480;
    into.height = Math.round(480 * height / Math.max(1, width));
    pen.drawImage(this.canvas, 0, 0, into.width, into.height);
    [this.orbit.centre, this.near] = [before[1], before[2]];
    this.show(before[0], false);
  }

  end() {
    cancelAnimationFrame(this.waiting);
    this.scene.traverse((thing) => { thing.geometry?.dispose(); thing.material?.map?.dispose(); thing.material?.dispose?.(); });
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }
}
