// The player of a run: stage, slider, timeline with signals, and pictures before and after.

/** A moment is noted after this pause, since browsers limit how often an address changes. Unit: milliseconds. */
const NOTED_AFTER = 200;

/** `slots` are the judged properties; `noted` gets each moment at which the player rests, and `moved` each that it shows. */
async function player(replay, slots, noted, moved = () => {}) {
  const forms = await formsOf();
  const canvas = make("canvas", { class: "stage", tabindex: "0", "aria-label": "The run in 3D: drag or use the arrow keys to rotate, the wheel or + and − to zoom" });
  const slider = make("input", { type: "range", min: 0, step: "any", value: 0, "aria-label": "Moment of the run", class: "slider" });
  const play = make("button", { type: "button", class: "play", "aria-label": "Play" }, "▶");
  const clock = make("output", { class: "clock" });
  const pace = make("select", { "aria-label": "Speed" }, [["0.25", "¼×"], ["1", "1×"], ["2", "2×"], ["5", "5×"]].map(([value, words]) => make("option", { value }, words)));
  pace.value = "1";
  const three = await loadThree();
  const course = new Course(replay), stage = new Stage(three, replay, course, forms, canvas);
  const seconds = course.seconds;
  slider.max = seconds;
  const measured = signalsOf(replay, course, forms, stage.target), thresholds = thresholdsOf(replay, course, measured, slots);
  const signals = decidingSignals(replay).concat(measured);
  const line = timeline(replay, course, signals, thresholds, (secs) => { set(false); seek(secs); });
  let secs = 0, playing = false, last = 0, waiting = 0;
  const note = () => {
    clearTimeout(waiting);
    waiting = setTimeout(() => canvas.isConnected && noted(secs), NOTED_AFTER);
  };
  const seek = (to, settled = true) => {
    secs = Math.min(seconds, Math.max(0, to));
    stage.near = !settled;
    slider.value = secs;
    slider.setAttribute("aria-valuetext", `${secs.toFixed(1)} seconds`);
    clock.textContent = `${secs.toFixed(1)} / ${seconds.toFixed(1)} s`;
    stage.show(secs);
    line.mark(secs);
    moved(secs);
    if (settled) note();
  };
  const set = (on) => {
    playing = on;
    play.textContent = on ? "❚❚" : "▶";
    play.setAttribute("aria-label", on ? "Pause" : "Play");
    if (on && secs >= seconds) seek(0);
    if (!on) note();
    last = performance.now();
    if (on) requestAnimationFrame(step);
  };
  const step = (now) => {
    if (!playing || !canvas.isConnected) return;
    seek(secs + (now - last) / 1000 * Number(pace.value), false);
    last = now;
    if (secs >= seconds) set(false);
    else requestAnimationFrame(step);
  };
  play.addEventListener("click", () => set(!playing));
  slider.addEventListener("input", () => { set(false); seek(Number(slider.value)); });
  const check = (words, set) => {
    const box = make("input", { type: "checkbox", onchange: () => { set(box.checked); stage.show(secs, false); } });
    box.checked = true;
    set(true);
    return make("label", { class: "check" }, box, ` ${words}`);
  };
  const pictures = ["before", "after"].map((name) => [name, make("canvas", { role: "img", "aria-label": `${name} the run` })]);
  const element = make("div", { class: "player" },
    make("div", { class: "stagebox" }, canvas, stage.labels.element),
    make("div", { class: "controls" }, play, slider, clock, pace,
      check("labels", (on) => { stage.labels.shown = on; }),
      stage.boxes.length > 0 && check("what it perceived", (on) => { stage.seen.visible = on; })),
    stage.pressed && make("p", { class: "pressed" }, `★ ${stage.pressed.told} `,
      make("button", { type: "button", class: "flat", onclick: () => { set(false); seek(stage.pressed.secs[0]); } }, "show the contact")),
    line.element,
    make("div", { class: "pictures" }, pictures.map(([name, picture]) => make("figure", {},
      make("button", { type: "button", class: "flat", onclick: () => { set(false); seek(name === "before" ? 0 : seconds); } }, picture), make("figcaption", {}, name)))));
  const themed = () => { stage.theme(); snap(); };
  const snap = () => { stage.picture(0, pictures[0][1]); stage.picture(seconds, pictures[1][1]); };
  const resized = new ResizeObserver(() => stage.draw());
  resized.observe(canvas);
  document.addEventListener("theme", themed);
  return {
    element, seek: (to) => { set(false); seek(to); }, toggle: () => set(!playing),
    begin: (at) => { line.draw(); stage.begin(at); seek(at); themed(); seek(at); },
    end: () => { set(false); clearTimeout(waiting); resized.disconnect(); line.end(); document.removeEventListener("theme", themed); stage.end(); },
  };
}

let formsLoaded;

function formsOf() {
  formsLoaded ??= unpackText("forms").then(JSON.parse);
  return formsLoaded;
}
