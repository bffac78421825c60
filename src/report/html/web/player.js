// The player: one run, or two in step, with one clock for both.

/** A moment is noted after this pause, since browsers limit how often an address changes. Unit: milliseconds. */
const NOTED_AFTER = 200;
/** How far an arrow key goes. Unit: seconds. */
const ARROW_SECS = 0.5;
/** Speeds of playback, as in the list of them. */
const SPEEDS = [["0.25", "¼×"], ["0.5", "½×"], ["1", "1×"], ["2", "2×"], ["4", "4×"], ["8", "8×"]];
/** Elements that use Space and arrows themselves. */
const OWN_KEYS = "input, select, button, a, summary, [role=grid], .scroll, .proof";

/**
 * Plays runs on one clock. A side has a `replay` with its `forms`, the judged properties as `slots`, and a `name` if there
 * are several sides. `noted` gets each moment at which the player rests.
 */
async function player(sides, noted = () => {}) {
  const three = await loadThree(), panels = sides.map((side) => panel(three, side, (secs) => { set(false); seek(secs); }));
  const seconds = Math.max(...panels.map((one) => one.course.seconds)), listeners = new Set();
  const slider = make("input", { type: "range", min: 0, max: seconds, step: "any", value: 0, "aria-label": "Moment of the run", class: "slider" });
  const play = make("button", { type: "button", class: "play", "aria-label": "Play", title: "Space" }, "▶");
  const clock = make("output", { class: "clock" });
  const pace = make("select", { "aria-label": "Speed", title: "Up and Down keys" }, SPEEDS.map(([value, words]) => make("option", { value }, words)));
  pace.value = "1";
  let secs = 0, playing = false, last = 0, waiting = 0;
  const note = () => {
    clearTimeout(waiting);
    waiting = setTimeout(() => slider.isConnected && noted(secs), NOTED_AFTER);
  };
  const seek = (to, settled = true) => {
    secs = Math.min(seconds, Math.max(0, to));
    slider.value = secs;
    slider.setAttribute("aria-valuetext", `${secs.toFixed(1)} seconds`);
    clock.textContent = `${secs.toFixed(1)} / ${seconds.toFixed(1)} s`;
    for (const one of panels) one.show(secs, settled);
    for (const listener of listeners) listener(secs);
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
    if (!playing || !slider.isConnected) return;
    seek(secs + (now - last) / 1000 * Number(pace.value), false);
    last = now;
    if (secs >= seconds) set(false);
    else requestAnimationFrame(step);
  };
  const go = (by) => { set(false); seek(secs + by); };
  const faster = (by) => { pace.selectedIndex = Math.min(SPEEDS.length - 1, Math.max(0, pace.selectedIndex + by)); };
  const frame = Math.min(...panels.map((one) => one.course.period)) || ARROW_SECS;
  const keys = {
    " ": () => set(!playing), ArrowLeft: () => go(-ARROW_SECS), ArrowRight: () => go(ARROW_SECS), ",": () => go(-frame), ".": () => go(frame),
    ArrowUp: () => faster(1), ArrowDown: () => faster(-1), Home: () => { set(false); seek(0); }, End: () => { set(false); seek(seconds); },
  };
  const pressed = (event) => {
    const key = keys[event.key];
    if (!key || event.defaultPrevented || event.shiftKey || event.ctrlKey || event.metaKey || event.altKey) return;
    // Other keys than Space and the arrows to the sides scroll the page, unless the player has the focus.
    const within = element.contains(event.target);
    if (event.target.closest?.(OWN_KEYS) || (!within && ![" ", "ArrowLeft", "ArrowRight"].includes(event.key))) return;
    event.preventDefault();
    key();
  };
  play.addEventListener("click", () => set(!playing));
  slider.addEventListener("input", () => { set(false); seek(Number(slider.value)); });
  const check = (words, change) => {
    const box = make("input", { type: "checkbox", onchange: () => { change(box.checked); panels.forEach((one) => one.show(secs)); } });
    box.checked = true;
    change(true);
    return make("label", { class: "check" }, box, ` ${words}`);
  };
  const look = (words, view, title) => make("button", { type: "button", "data-look": view, "aria-pressed": String(view === "side"), title, onclick: (event) => {
    panels.forEach((one) => one.stage.look(view, secs));
    for (const other of event.currentTarget.parentElement.querySelectorAll("[data-look]")) other.setAttribute("aria-pressed", String(other.dataset.look === view));
  } }, words);
  const has = (what) => panels.some((one) => one.stage.views.includes(what));
  const hidden = make("span", { class: "faint hiddenlabels" });
  panels.forEach((one) => { one.stage.labels.counted = () => {
    const sum = panels.reduce((total, other) => total + other.stage.labels.crowded, 0);
    hidden.textContent = sum ? ` (${sum} hidden: no room)` : "";
  }; });
  const labels = check("labels", (on) => panels.forEach((one) => { one.stage.labels.shown = on; }));
  labels.append(hidden);
  const element = make("div", { class: panels.length > 1 ? "player pair" : "player" },
    make("div", { class: "stages" }, panels.map((one) => one.stagebox)),
    make("div", { class: "controls" }, play, slider, clock, pace),
    make("div", { class: "controls looks", role: "group", "aria-label": "View" }, look("side", "side", "The usual view, which follows the hand"), look("top", "top", "From above"),
      has("hand") && look("hand", "hand", "From behind the hand"), has("camera") && look("camera", "camera", "From the robot's camera"),
      make("button", { type: "button", title: "Back to the usual view, speed and labels", onclick: (event) => {
        pace.value = "1";
        event.currentTarget.parentElement.querySelector("[data-look=side]").click();
      } }, "reset"),
      labels, panels.some((one) => one.stage.boxes.length > 0) && check("what it perceived", (on) => panels.forEach((one) => { one.stage.seen.visible = on; }))),
    make("p", { class: "faint keys" }, "Space plays; ← and → go half a second; with the player in focus, , and . go one frame, ↑ and ↓ change the speed, and Shift with arrows turns the picture."),
    make("div", { class: "stages" }, panels.map((one) => one.below)));
  const themed = () => { for (const one of panels) one.themed(); };
  const resized = new ResizeObserver(() => panels.forEach((one) => one.stage.draw()));
  panels.forEach((one) => resized.observe(one.stage.canvas));
  document.addEventListener("theme", themed);
  document.addEventListener("keydown", pressed);
  return {
    element, seconds, seek: (to) => { set(false); seek(to); }, toggle: () => set(!playing),
    /** Calls `listener` with each moment that is shown, in seconds. */
    follow: (listener) => { listeners.add(listener); listener(secs); },
    begin: (at) => { panels.forEach((one) => one.begin(at)); seek(at); themed(); seek(at); },
    end: () => {
      set(false);
      clearTimeout(waiting);
      resized.disconnect();
      document.removeEventListener("theme", themed);
      document.removeEventListener("keydown", pressed);
      panels.forEach((one) => one.end());
    },
  };
}

/** One side of a player: stage, timeline with signals, and pictures before and after. A click in it calls `seek`. */
function panel(three, { replay, forms, slots, name }, seek) {
  const canvas = make("canvas", { class: "stage", tabindex: "0", "aria-label": `${name ? `${name}: the` : "The"} run in 3D: drag or use Shift with the arrow keys to rotate, the wheel or + and − to zoom` });
  const course = new Course(replay), stage = new Stage(three, replay, course, forms, canvas), { seconds } = course;
  const measured = signalsOf(replay, course, forms, stage.target), thresholds = thresholdsOf(replay, course, measured, slots);
  const signals = decidingSignals(replay).concat(measured), line = timeline(replay, course, signals, thresholds, seek);
  const choice = chooser(quantitiesOf(replay, course, forms), signals, thresholds, seconds, line.choose);
  const skill = skillPanel(replay, seek);
  const pictures = ["before", "after"].map((when) => [when, make("canvas", { role: "img", "aria-label": `${when} the run` })]);
  const stagebox = make("div", { class: "side" }, name && make("h2", {}, name), make("div", { class: "stagebox" }, canvas, stage.labels.element));
  const below = make("div", { class: "side" },
    stage.pressed && make("p", { class: "pressed" }, `★ ${stage.pressed.told} `,
      make("button", { type: "button", class: "flat", onclick: () => seek(stage.pressed.secs[0]) }, "show the contact")),
    line.element, choice.element, skill?.element,
    make("div", { class: "pictures" }, pictures.map(([when, picture]) => make("figure", {},
      make("button", { type: "button", class: "flat", onclick: () => seek(when === "before" ? 0 : seconds) }, picture), make("figcaption", {}, when)))));
  const snap = () => { stage.picture(0, pictures[0][1]); stage.picture(seconds, pictures[1][1]); };
  return {
    course, stage, stagebox, below,
    show: (secs, settled = true) => {
      const own = Math.min(secs, seconds);
      stage.near = !settled;
      stage.show(own);
      line.mark(own);
      skill?.mark(own);
    },
    begin: (at) => { choice.update(); stage.begin(Math.min(at, seconds)); },
    themed: () => { stage.theme(); snap(); },
    end: () => { line.end(); stage.end(); },
  };
}

let formsLoaded;

/** The shapes of the replays in this page. */
function formsOf() {
  formsLoaded ??= unpackText("forms").then(JSON.parse);
  return formsLoaded;
}
