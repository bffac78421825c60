//! Label placement: close to the labelled object, without overlaps between labels.

use crate::picture::drawing::{Drawing, Line, Paint, Rect, Words};
use crate::picture::font;
use crate::picture::paint;

/// Margin around a label. Unit: pixels.
const GAP_PX: f64 = 2.0;
/// Labels farther than this from their object get a leader line. Unit: pixels.
const LEADER_PX: f64 = 7.0;

/// The occupied areas of a panel.
pub(super) struct Labels {
    panel: Rect,
    taken: Vec<Rect>,
    /// Objects that labels should not hide.
    things: Vec<Rect>,
}

/// A label to place.
pub(super) struct Label<'a> {
    pub(super) text: &'a str,
    pub(super) size: f64,
    pub(super) bold: bool,
    pub(super) rgb: u32,
    /// The labelled object.
    pub(super) at: Rect,
}

impl Labels {
    pub(super) fn new(panel: Rect, things: Vec<Rect>) -> Self {
        Self {
            panel: panel.grown(-3.0),
            taken: Vec::new(),
            things,
        }
    }

    /// Keeps labels out of a rectangle.
    pub(super) fn keep_out(&mut self, rect: Rect) {
        self.taken.push(rect);
    }

    /// Writes a label at the best free position. Skips it if the panel is full or does not show the
    /// object.
    pub(super) fn write(&mut self, drawing: &mut Drawing, label: &Label<'_>) {
        // Objects outside of the panel get no label.
        if self.panel.shared(&label.at.grown(1.0)) == 0.0 {
            return;
        }
        let width = font::width(label.text, label.size, label.bold);
        let height = label.size * 1.15;
        let places = candidates(&label.at, width, height)
            .into_iter()
            .filter(|place| {
                self.panel.holds(place)
                    && self
                        .taken
                        .iter()
                        .all(|other| other.shared(&place.grown(GAP_PX)) == 0.0)
            });
        let rated = places.map(|place| (self.cost(&place, &label.at), place));
        let Some((_, place)) = rated.min_by(|a, b| a.0.total_cmp(&b.0)) else {
            return;
        };
        self.taken.push(place);
        leader(drawing, &label.at, &place);
        let at = [place.left, place.top + label.size * 0.92];
        let (size, bold) = (label.size, label.bold);
        drawing.words(Words {
            text: label.text.to_owned(),
            at,
            size,
            bold,
            paint: Paint::solid(label.rgb),
            rim: true,
        });
    }

    /// Cost of a position: the distance from the object, and the hidden area of objects relative to
    /// the label's area.
    fn cost(&self, place: &Rect, at: &Rect) -> f64 {
        let hidden: f64 = self.things.iter().map(|thing| thing.shared(place)).sum();
        let area = place.width * place.height;
        gap(place, at) + 40.0 * (hidden / area).min(2.0)
    }
}

/// Distance between two rectangles; 0 if they overlap.
fn gap(a: &Rect, b: &Rect) -> f64 {
    let across = (a.left - b.right()).max(b.left - a.right()).max(0.0);
    let down = (a.top - b.bottom()).max(b.top - a.bottom()).max(0.0);
    across.hypot(down)
}

/// Candidate positions for a label: on its object, and around it at increasing distances.
fn candidates(at: &Rect, width: f64, height: f64) -> Vec<Rect> {
    let [x, y] = at.middle();
    let centred = |x: f64, y: f64| Rect {
        left: x - width / 2.0,
        top: y - height / 2.0,
        width,
        height,
    };
    let mut places = vec![centred(x, y)];
    for ring in 0..14 {
        let away = 4.0 + 13.0 * f64::from(ring);
        let (half_width, half_height) = (
            at.width / 2.0 + away + width / 2.0,
            at.height / 2.0 + away + height / 2.0,
        );
        for step in 0..20 {
            let angle = std::f64::consts::TAU * f64::from(step) / 20.0;
            let (cos, sin) = (libm::cos(angle), libm::sin(angle));
            // Rings are rectangles rather than ellipses, so that labels are close at corners too.
            let stretch = 1.0 / cos.abs().max(sin.abs());
            places.push(centred(
                x + half_width * cos * stretch,
                y + half_height * sin * stretch,
            ));
        }
    }
    places
}

/// Draws a thin line from a label to its object if they are apart.
fn leader(drawing: &mut Drawing, at: &Rect, place: &Rect) {
    if gap(place, at) < LEADER_PX {
        return;
    }
    let nearest = |rect: &Rect, [x, y]: [f64; 2]| {
        [
            x.clamp(rect.left, rect.right()),
            y.clamp(rect.top, rect.bottom()),
        ]
    };
    let from = nearest(place, at.middle());
    drawing.line(
        vec![from, nearest(at, from)],
        Line::new(Paint::new(paint::INK, 0.55), 0.7),
    );
}
