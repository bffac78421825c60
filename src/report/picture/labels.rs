//! Room for names: beside what they name, never over each other.

use crate::report::picture::drawing::{Drawing, Line, Paint, Rect, Words};
use crate::report::picture::font;
use crate::report::picture::paint;

/// Around a label nothing else is written. Unit: pixels.
const GAP_PX: f64 = 2.0;
/// A label farther from its thing than this has a line to it. Unit: pixels.
const LEADER_PX: f64 = 7.0;

/// What is taken on one panel.
pub(super) struct Labels {
    panel: Rect,
    taken: Vec<Rect>,
    /// What labels had better not hide.
    things: Vec<Rect>,
}

/// A name that wants a place.
pub(super) struct Label<'a> {
    pub(super) text: &'a str,
    pub(super) size: f64,
    pub(super) bold: bool,
    pub(super) rgb: u32,
    /// What it names.
    pub(super) at: Rect,
}

impl Labels {
    pub(super) fn new(panel: Rect, things: Vec<Rect>) -> Self {
        Self { panel: panel.grown(-3.0), taken: Vec::new(), things }
    }

    /// Keeps labels out of a rectangle.
    pub(super) fn keep_out(&mut self, rect: Rect) {
        self.taken.push(rect);
    }

    /// Writes a label at the best free place, or not at all where the panel is full or does not show what it names.
    pub(super) fn write(&mut self, drawing: &mut Drawing, label: &Label<'_>) {
        // What is beside the panel is not seen, and has no name there.
        if self.panel.shared(&label.at.grown(1.0)) == 0.0 {
            return;
        }
        let width = font::width(label.text, label.size, label.bold);
        let height = label.size * 1.15;
        let places = candidates(&label.at, width, height).into_iter().filter(|place| {
            self.panel.holds(place) && self.taken.iter().all(|other| other.shared(&place.grown(GAP_PX)) == 0.0)
        });
        let rated = places.map(|place| (self.cost(&place, &label.at), place));
        let Some((_, place)) = rated.min_by(|a, b| a.0.total_cmp(&b.0)) else { return };
        self.taken.push(place);
        leader(drawing, &label.at, &place);
        let at = [place.left, place.top + label.size * 0.92];
        let (size, bold) = (label.size, label.bold);
        drawing.words(Words { text: label.text.to_owned(), at, size, bold, paint: Paint::solid(label.rgb), rim: true });
    }

    /// Far away is worse, and so is what hides things (more so its own when it is small).
    fn cost(&self, place: &Rect, at: &Rect) -> f64 {
        let hidden: f64 = self.things.iter().map(|thing| thing.shared(place)).sum();
        let area = place.width * place.height;
        gap(place, at) + 40.0 * (hidden / area).min(2.0)
    }
}

/// Distance of two rectangles, 0 where they overlap.
fn gap(a: &Rect, b: &Rect) -> f64 {
    let across = (a.left - b.right()).max(b.left - a.right()).max(0.0);
    let down = (a.top - b.bottom()).max(b.top - a.bottom()).max(0.0);
    across.hypot(down)
}

/// Places for a label of some size: on its thing, around it, and on wider and wider rings.
fn candidates(at: &Rect, width: f64, height: f64) -> Vec<Rect> {
    let [x, y] = at.middle();
    let centred = |x: f64, y: f64| Rect { left: x - width / 2.0, top: y - height / 2.0, width, height };
    let mut places = vec![centred(x, y)];
    for ring in 0..14 {
        let away = 4.0 + 13.0 * f64::from(ring);
        let (half_width, half_height) = (at.width / 2.0 + away + width / 2.0, at.height / 2.0 + away + height / 2.0);
        for step in 0..20 {
            let angle = std::f64::consts::TAU * f64::from(step) / 20.0;
            let (cos, sin) = (libm::cos(angle), libm::sin(angle));
            // On the rectangle around the thing, not on an ellipse: so labels stand close at corners too.
            let stretch = 1.0 / cos.abs().max(sin.abs());
            places.push(centred(x + half_width * cos * stretch, y + half_height * sin * stretch));
        }
    }
    places
}

/// A thin line from a label to its thing, where they are apart.
fn leader(drawing: &mut Drawing, at: &Rect, place: &Rect) {
    if gap(place, at) < LEADER_PX {
        return;
    }
    let nearest = |rect: &Rect, [x, y]: [f64; 2]| [x.clamp(rect.left, rect.right()), y.clamp(rect.top, rect.bottom())];
    let from = nearest(place, at.middle());
    drawing.line(vec![from, nearest(at, from)], Line::new(Paint::new(paint::INK, 0.55), 0.7));
}
