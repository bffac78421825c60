//! A picture of a run: its table from above and from the side, before and after, as SVG.

use std::fmt::Write as _;

use crate::history::{BodyState, Snapshot, Trace};

/// Pixels for a metre.
const SCALE: f64 = 420.0;
/// Around each view. Unit: pixels.
const PADDING: f64 = 36.0;
/// What is shown around the platforms. Unit: metres.
const AROUND_M: f64 = 0.28;

/// Which two axes a view shows: across and up, by their indexes in x, y, z.
#[derive(Clone, Copy)]
struct View {
    title: &'static str,
    across: usize,
    up: usize,
}

const VIEWS: [View; 2] =
    [View { title: "from above", across: 0, up: 1 }, View { title: "from the side", across: 0, up: 2 }];

/// The rectangle of the world that a view shows. Unit: metres.
struct Window {
    view: View,
    low: [f64; 2],
    high: [f64; 2],
    left_px: f64,
}

/// Draws a run, or nothing where it has no state to draw.
///
/// Dashed outlines are boxes around the objects before the first action, filled ones after the last; the line is the path
/// of the hand. `target` is drawn in another colour.
pub fn run_picture(trace: &Trace, target: Option<&str>, title: &str) -> Option<String> {
    let (before, after) = (trace.snapshots.first()?, trace.snapshots.last()?);
    let mut left_px = PADDING;
    let windows: Vec<Window> = VIEWS
        .into_iter()
        .map(|view| {
            let window = window(before, after, view, left_px);
            left_px += (window.high[0] - window.low[0]) * SCALE + PADDING;
            window
        })
        .collect();
    let height = windows.iter().map(|w| (w.high[1] - w.low[1]) * SCALE).fold(0.0, f64::max) + 2.0 * PADDING + 24.0;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {left_px:.0} {height:.0}\" width=\"{left_px:.0}\" \
         height=\"{height:.0}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n\
         <text x=\"{PADDING}\" y=\"22\" font-size=\"15\" font-weight=\"bold\">{}</text>\n",
        escaped(title)
    );
    for window in &windows {
        draw(&mut out, window, (before, after), trace, target);
    }
    out.push_str("</svg>\n");
    Some(out)
}

fn window(before: &Snapshot, after: &Snapshot, view: View, left_px: f64) -> Window {
    let platforms = || before.bodies.iter().filter(|body| body.fixed);
    let low = |axis: usize| platforms().map(|body| body.aabb_min[axis]).fold(f64::INFINITY, f64::min);
    let high = |axis: usize| platforms().map(|body| body.aabb_max[axis]).fold(f64::NEG_INFINITY, f64::max);
    let mut window = Window { view, low: [-0.5; 2], high: [0.5; 2], left_px };
    for (slot, axis) in [view.across, view.up].into_iter().enumerate() {
        if low(axis).is_finite() {
            (window.low[slot], window.high[slot]) = (low(axis) - AROUND_M, high(axis) + AROUND_M);
        }
    }
    if view.up == 2 {
        // Upright, what matters is the table's top and what stands on it, up to where it was lifted.
        let highest = before.bodies.iter().chain(&after.bodies).map(|b| b.aabb_max[2]).fold(0.5, f64::max);
        (window.low[1], window.high[1]) = (0.0, (highest + 0.12).min(3.0));
    }
    window
}

fn draw(out: &mut String, window: &Window, states: (&Snapshot, &Snapshot), trace: &Trace, target: Option<&str>) {
    let (x, y) = (window.left_px, 24.0 + PADDING);
    let (width, height) = ((window.high[0] - window.low[0]) * SCALE, (window.high[1] - window.low[1]) * SCALE);
    let _ = writeln!(out, "<text x=\"{x:.1}\" y=\"{:.1}\" fill=\"#555\">{}</text>", y - 6.0, window.view.title);
    let _ = writeln!(
        out,
        "<svg x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" viewBox=\"0 0 {width:.1} {height:.1}\">\
         <rect width=\"100%\" height=\"100%\" fill=\"#f4f5f7\"/>"
    );
    for body in states.0.bodies.iter().filter(|body| body.fixed) {
        rectangle(out, window, body, "fill=\"#e3d3b8\" stroke=\"#b59b6c\"");
    }
    for body in states.0.bodies.iter().filter(|body| !body.fixed) {
        rectangle(out, window, body, "fill=\"none\" stroke=\"#8a8f98\" stroke-dasharray=\"4 3\"");
    }
    for body in states.1.bodies.iter().filter(|body| !body.fixed) {
        let colour = if Some(body.id.as_str()) == target { "#2f6fde" } else { "#7d8794" };
        rectangle(out, window, body, &format!("fill=\"{colour}\" fill-opacity=\"0.45\" stroke=\"{colour}\""));
    }
    path(out, window, trace);
    for body in states.1.bodies.iter().filter(|body| !body.fixed) {
        label(out, window, body);
    }
    out.push_str("</svg>\n");
}

fn rectangle(out: &mut String, window: &Window, body: &BodyState, style: &str) {
    let (a, b) = (window.pixel(body.aabb_min), window.pixel(body.aabb_max));
    let _ = writeln!(
        out,
        "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" rx=\"2\" {style}/>",
        a[0].min(b[0]),
        a[1].min(b[1]),
        (b[0] - a[0]).abs(),
        (b[1] - a[1]).abs()
    );
}

fn label(out: &mut String, window: &Window, body: &BodyState) {
    let middle = [0, 1, 2].map(|axis| (body.aabb_min[axis] + body.aabb_max[axis]) / 2.0);
    let [x, y] = window.pixel(middle);
    let _ = writeln!(
        out,
        "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"middle\" fill=\"#1c2430\" stroke=\"#fff\" stroke-width=\"3\" \
         paint-order=\"stroke\">{}</text>",
        escaped(&body.id)
    );
}

/// The path of the hand, from the track of the link that carries the fingers.
fn path(out: &mut String, window: &Window, trace: &Trace) {
    let Some(slot) = trace.frames.names.iter().position(|name| name.contains("finger") || name.contains("hand")) else {
        return;
    };
    let points: Vec<String> = trace
        .frames
        .rows
        .iter()
        .filter_map(|row| row.get(7 * slot..7 * slot + 3))
        .map(|p| {
            let [x, y] = window.pixel([0, 1, 2].map(|axis| f64::from(p[axis])));
            format!("{x:.1},{y:.1}")
        })
        .collect();
    let _ = writeln!(
        out,
        "<polyline points=\"{}\" fill=\"none\" stroke=\"#d8572a\" stroke-width=\"1.6\" stroke-opacity=\"0.8\"/>",
        points.join(" ")
    );
}

impl Window {
    /// Pixel of a point in the world. Frame of the result: the view's upper left corner, y down.
    fn pixel(&self, point: [f64; 3]) -> [f64; 2] {
        [(point[self.view.across] - self.low[0]) * SCALE, (self.high[1] - point[self.view.up]) * SCALE]
    }
}

/// Text that can't inject markup.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
