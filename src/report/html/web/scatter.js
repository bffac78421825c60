// Scatter plots of runs, for the table from above and for patterns.

const DOT = { failed: 3.4, other: 2.4 };

/** The pairs of axes for plots of positions, if the runs have these parameters. */
function planes(runs) {
  return [
    ["on its surface", "surface_x_m", "surface_y_m", true],
    ["from the robot's base", "target_ahead_m", "target_left_m", true],
    ["in the world", "target_x_m", "target_y_m", true],
    ["turned against distance", "target_turned_rad", "robot_distance_m", false],
    ["mass against friction", "target_mass_kg", "target_friction", false],
  ].filter(([, x, y]) => [x, y].every((name) => varies(runs.parameter.get(name))));
}

function varies(parameter) {
  return parameter && parameter.values.kind !== "texts" && parameter.values.some((value) => !Number.isNaN(value) && value !== parameter.values[0]);
}

/**
 * Dots over two parameters. `dots`: the outcome by which each run is drawn (`null`: hidden); `box`: ranges to mark;
 * `outlines`: of tables, in the plane of the two parameters.
 * Returns the element and a function that draws it anew.
 */
function scatter(runs, { height = 420, open, box = {}, label }) {
  const canvas = make("canvas", { class: "scatter", role: "img", "aria-label": label, style: { height: `${height}px` } });
  const tip = make("div", { class: "tip", hidden: true });
  const element = make("div", { class: "scatterbox" }, canvas, tip);
  let placed = [], shown = null;

  const draw = (x, y, equal, dots, outlines = []) => {
    shown = [x, y, equal, dots, outlines];
    const width = canvas.clientWidth, scale = Math.min(2, devicePixelRatio);
    if (!width) return;
    canvas.width = width * scale;
    canvas.height = height * scale;
    const pen = canvas.getContext("2d");
    pen.scale(scale, scale);
    const frame = axes(pen, runs, x, y, equal, width, height, box, outlines);
    placed = [];
    const order = ["inapplicable", "untested", "passed", "broken", "timeout", "failed"];
    const colours = Object.fromEntries(OUTCOMES.map((name) => [name, colourOf(name)]));
    const groups = Object.fromEntries(order.map((name) => [name, []]));
    for (const run of runs.details) {
      const outcome = dots(run);
      if (outcome && frame.has(run)) groups[outcome].push(run);
    }
    const total = order.reduce((sum, name) => sum + groups[name].length, 0);
    const small = total > 3000 ? 0.62 : total > 800 ? 0.8 : total > 200 ? 1 : 1.5;
    for (const name of order) {
      pen.fillStyle = colours[name];
      pen.globalAlpha = name === "passed" ? (total > 3000 ? 0.32 : 0.5) : 0.85;
      const radius = (name === "failed" ? DOT.failed : DOT.other) * small;
      for (const run of groups[name]) {
        const [px, py] = frame.at(run);
        placed.push([px, py, run]);
        if (name === "failed") cross(pen, px, py, radius);
        else { pen.beginPath(); pen.arc(px, py, radius, 0, 7); pen.fill(); }
      }
    }
    pen.globalAlpha = 1;
  };
  const near = (event) => {
    const at = canvas.getBoundingClientRect(), [x, y] = [event.clientX - at.left, event.clientY - at.top];
    let best = null, least = 144;
    for (const dot of placed) {
      const distance = (dot[0] - x) ** 2 + (dot[1] - y) ** 2;
      if (distance <= least) [best, least] = [dot, distance];
    }
    return best;
  };
  canvas.addEventListener("pointermove", (event) => {
    const dot = near(event);
    tip.hidden = !dot;
    canvas.style.cursor = dot ? "pointer" : "";
    if (!dot) return;
    const failed = runs.failures(dot[2]).map((slot) => runs.slots[slot].property);
    fill(tip, make("b", {}, runs.id(dot[2])), ` ${runs.value("target_model", dot[2]) || ""}`, make("br"), failed.join(", ") || "nothing failed");
    tip.style.left = `${Math.min(dot[0] + 12, canvas.clientWidth - 190)}px`;
    tip.style.top = `${dot[1] + 12}px`;
  });
  canvas.addEventListener("pointerleave", () => { tip.hidden = true; });
  canvas.addEventListener("click", (event) => {
    const dot = near(event);
    if (dot) open(dot[2]);
  });
  new ResizeObserver(() => shown && draw(...shown)).observe(canvas);
  document.addEventListener("theme", () => shown && canvas.isConnected && draw(...shown));
  return [element, draw];
}

/** A cross, so that failures are recognisable without colour. */
function cross(pen, x, y, radius) {
  pen.lineWidth = radius * 0.75;
  pen.strokeStyle = pen.fillStyle;
  pen.beginPath();
  pen.moveTo(x - radius, y - radius);
  pen.lineTo(x + radius, y + radius);
  pen.moveTo(x + radius, y - radius);
  pen.lineTo(x - radius, y + radius);
  pen.stroke();
}

/** Draws axes, grid and marked ranges, and returns the position of each run. */
function axes(pen, runs, x, y, equal, width, height, box, outlines) {
  const [xs, ys] = [runs.parameter.get(x), runs.parameter.get(y)];
  const inner = { left: 52, top: 12, width: width - 66, height: height - 54 };
  const corners = outlines.flatMap((outline) => outline.points);
  let [xr, yr] = [xs, ys].map(({ values }, axis) => corners.length ? rangeOf([...rangeOf(values, 0), ...corners.map((corner) => corner[axis])]) : rangeOf(values));
  if (equal) {
    const scale = Math.max((xr[1] - xr[0]) / inner.width, (yr[1] - yr[0]) / inner.height);
    const grown = ([low, high], size) => [(low + high - scale * size) / 2, (low + high + scale * size) / 2];
    [xr, yr] = [grown(xr, inner.width), grown(yr, inner.height)];
  }
  const px = (value) => inner.left + (value - xr[0]) / (xr[1] - xr[0]) * inner.width;
  const py = (value) => inner.top + (yr[1] - value) / (yr[1] - yr[0]) * inner.height;
  pen.fillStyle = colourOf("sunk");
  pen.fillRect(inner.left, inner.top, inner.width, inner.height);
  pen.save();
  pen.beginPath();
  pen.rect(inner.left, inner.top, inner.width, inner.height);
  pen.clip();
  for (const { points, model } of outlines) {
    pen.beginPath();
    for (const [left, up] of points) pen.lineTo(px(left), py(up));
    pen.closePath();
    pen.fillStyle = colourOf("table");
    pen.fill();
    pen.strokeStyle = colourOf("soft");
    pen.lineWidth = 1.5;
    pen.stroke();
    pen.fillStyle = colourOf("soft");
    pen.font = "11px system-ui, sans-serif";
    pen.textAlign = "left";
    pen.fillText(model.replaceAll("_", " "), px(Math.min(...points.map((point) => point[0]))) + 6, py(Math.max(...points.map((point) => point[1]))) + 14);
  }
  if (box[x] || box[y]) {
    pen.fillStyle = colourOf("mark");
    pen.strokeStyle = colourOf("failed");
    pen.setLineDash([5, 4]);
    for (const [x0, x1] of bands(box[x], xr)) {
      for (const [y0, y1] of bands(box[y], yr)) {
        const marked = [px(x0), py(y1), px(x1) - px(x0), py(y0) - py(y1)];
        pen.fillRect(...marked);
        pen.strokeRect(...marked);
      }
    }
    pen.setLineDash([]);
  }
  pen.restore();
  pen.font = "11px system-ui, sans-serif";
  pen.strokeStyle = colourOf("line");
  pen.fillStyle = colourOf("soft");
  pen.lineWidth = 1;
  for (const [values, along] of [[ticks(xr, inner.width / 90), true], [ticks(yr, inner.height / 55), false]]) {
    for (const value of values) {
      pen.beginPath();
      if (along) { pen.moveTo(px(value), inner.top); pen.lineTo(px(value), inner.top + inner.height); }
      else { pen.moveTo(inner.left, py(value)); pen.lineTo(inner.left + inner.width, py(value)); }
      pen.globalAlpha = 0.6;
      pen.stroke();
      pen.globalAlpha = 1;
      pen.textAlign = along ? "center" : "right";
      pen.fillText(number(value), along ? px(value) : inner.left - 6, along ? inner.top + inner.height + 15 : py(value) + 4);
    }
  }
  const named = ({ label, unit }) => `${label}${unit && unit !== "1" ? ` (${unit})` : ""}`;
  pen.textAlign = "center";
  pen.fillText(`${named(xs)} →`, inner.left + inner.width / 2, height - 8);
  pen.save();
  pen.translate(12, inner.top + inner.height / 2);
  pen.rotate(-Math.PI / 2);
  pen.fillText(`${named(ys)} →`, 0, 0);
  pen.restore();
  return {
    has: (run) => !Number.isNaN(runs.value(x, run)) && !Number.isNaN(runs.value(y, run)),
    at: (run) => [px(runs.value(x, run)), py(runs.value(y, run))],
  };
}

/** The bands in which a condition holds: two for an arc of directions through ±π, whose lower end is above its upper end. */
function bands(condition, [first, last]) {
  if (condition?.wraps) return [[first, condition.high], [condition.low, last]];
  return [[condition?.low ?? first, condition?.high ?? last]];
}

function rangeOf(values, share = 0.04) {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) if (!Number.isNaN(value)) [low, high] = [Math.min(low, value), Math.max(high, value)];
  const room = (high - low || 1) * share;
  return [low - room, high + room];
}

/** Round numbers in a range, about as many as requested, and at least two. */
function ticks([low, high], wanted) {
  const rough = (high - low) / Math.max(2, wanted), power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((times) => times * power).find((step) => step >= rough);
  const found = [];
  for (let value = Math.ceil(low / step) * step; value <= high; value += step) found.push(Math.abs(value) < step / 1e6 ? 0 : value);
  return found.length < 2 && wanted < 12 ? ticks([low, high], 2 * Math.max(2, wanted)) : found;
}
