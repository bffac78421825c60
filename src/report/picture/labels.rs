//! Label placement: beside the labelled object, without overlaps between labels.

use crate::picture::drawing::{Drawing, Line, Paint, Rect, Words};
use crate::picture::font;
use crate::picture::paint;

/// Margin around a label. Unit: pixels.
const GAP_PX: f64 = 2.0;
/// Cost of a label that covers the thing that it names: more than that of the farthest place beside
/// it. Only a thing around which the panel has no room, such as a table that fills it, is covered.
const COVERS: f64 = 1e3;
/// Cost of a label that hides other objects with all of its area: a label farther away, with a
/// line to its object, is better. Unit: pixels.
const HIDES_PX: f64 = 200.0;
/// Cost of a label that lies on lines or on the robot with all of its area. Unit: pixels.
const BUSY_PX: f64 = 25.0;
/// Largest width of a label, as a share of the panel's: others would lie across everything.
const WIDEST: f64 = 0.7;
/// Steps between the places of a label on its object, in each direction.
const ON_IT: u32 = 8;
/// Labels farther than this from their object get a leader line. Unit: pixels.
const LEADER_PX: f64 = 7.0;

/// The occupied areas of a panel.
pub(super) struct Labels {
    panel: Rect,
    taken: Vec<Rect>,
    /// Objects that labels should not hide.
    things: Vec<Rect>,
    /// Lines and shapes on which labels are hard to read.
    busy: Vec<Rect>,
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
            busy: Vec::new(),
        }
    }

    /// Lets labels rather be beside some rectangles.
    pub(super) fn spare(&mut self, busy: impl IntoIterator<Item = Rect>) {
        self.busy.extend(busy);
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
        let most = self.panel.width * WIDEST;
        let text = shortened(label, most);
        let width = font::width(&text, label.size, label.bold);
        let height = label.size * 1.15;
        let at = label.at.within(&self.panel);
        let places = candidates(&at, width, height).into_iter().filter(|place| {
            self.panel.holds(place)
                && self
                    .taken
                    .iter()
                    .all(|other| other.shared(&place.grown(GAP_PX)) == 0.0)
        });
        let rated = places.map(|place| (self.cost(&place, &at), place));
        let Some((_, place)) = rated.min_by(|a, b| a.0.total_cmp(&b.0)) else {
            return;
        };
        self.taken.push(place);
        leader(drawing, &at, &place);
        let at = [place.left, place.top + label.size * 0.92];
        let (size, bold) = (label.size, label.bold);
        drawing.words(Words {
            text,
            at,
            size,
            bold,
            paint: Paint::solid(label.rgb),
            rim: true,
        });
    }

    /// Cost of a position: the distance from the object, the hidden area of objects relative to the
    /// label's area, and whether it covers the named object.
    fn cost(&self, place: &Rect, at: &Rect) -> f64 {
        let hidden: f64 = self.things.iter().map(|thing| thing.shared(place)).sum();
        let area = place.width * place.height;
        let covers = if at.shared(place) > 0.0 { COVERS } else { 0.0 };
        let crossed: f64 = self.busy.iter().map(|busy| busy.shared(place)).sum();
        gap(place, at)
            + HIDES_PX * (hidden / area).min(2.0)
            + BUSY_PX * (crossed / area).min(1.0)
            + covers
    }
}

/// Distance between two rectangles; 0 if they overlap.
fn gap(a: &Rect, b: &Rect) -> f64 {
    let across = (a.left - b.right()).max(b.left - a.right()).max(0.0);
    let down = (a.top - b.bottom()).max(b.top - a.bottom()).max(0.0);
    across.hypot(down)
}

/// Candidate positions for a label: on the visible part of its object, and around it at increasing
/// distances.
fn candidates(at: &Rect, width: f64, height: f64) -> Vec<Rect> {
    let [x, y] = at.middle();
    let centred = |x: f64, y: f64| Rect {
        left: x - width / 2.0,
        top: y - height / 2.0,
        width,
        height,
    };
    let mut places = vec![centred(x, y)];
    let steps = |extent: f64, length: f64| {
        (0..=ON_IT).map(move |step| {
            let room = (extent - length).max(0.0);
            room * (f64::from(step) / f64::from(ON_IT) - 0.5)
        })
    };
    for across in steps(at.width, width) {
        places.extend(steps(at.height, height).map(|down| centred(x + across, y + down)));
    }
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

/// The text of a label, shortened to this width. The part after its last colon stays whole as long
/// as it leaves room for others: it is the number or the name that the label is for.
fn shortened(label: &Label<'_>, most: f64) -> String {
    let whole = font::shortened(label.text, label.size, label.bold, most);
    let Some((head, tail)) = label.text.rsplit_once(": ").filter(|_| whole != label.text) else {
        return whole;
    };
    let end = format!(": {tail}");
    let room = most - font::width(&end, label.size, label.bold);
    let head = font::shortened(head, label.size, label.bold, room.max(0.0));
    if head.is_empty() { whole } else { head + &end }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::drawing::Mark;

    const PANEL: Rect = Rect {
        left: 20.0,
        top: 40.0,
        width: 500.0,
        height: 300.0,
    };

    /// Labels of things at all places of a panel, with the rectangles of their texts.
    fn placed(text: &str, at: Rect, things: Vec<Rect>) -> Vec<Rect> {
        let mut drawing = Drawing::new(560.0);
        let label = Label {
            text,
            size: 11.0,
            bold: true,
            rgb: paint::INK,
            at,
        };
        Labels::new(PANEL, things).write(&mut drawing, &label);
        let texts = drawing.marks.iter().filter_map(|(_, mark)| match mark {
            Mark::Words(words) => Some(words),
            Mark::Shape { .. } | Mark::Image { .. } => None,
        });
        let rect = |words: &Words| Rect {
            left: words.at[0],
            top: words.at[1] - words.size * 0.92,
            width: font::width(&words.text, words.size, words.bold),
            height: words.size * 1.15,
        };
        texts.map(rect).collect()
    }

    #[test]
    fn labels_are_beside_their_things_and_in_the_panel() {
        let names = [
            "can",
            "glass_with_handle_1",
            "a_thing_whose_name_is_far_wider_than_half_of_its_panel_would_be_1",
        ];
        for (name, size) in names.into_iter().flat_map(|name| {
            [2.0, 14.0, 60.0, 180.0]
                .into_iter()
                .map(move |size| (name, size))
        }) {
            for step in 0..60 {
                let share = |stride: f64| 0.05 + 0.9 * (f64::from(step) * stride).fract();
                let at = Rect {
                    left: PANEL.left + share(0.618) * PANEL.width - size / 2.0,
                    top: PANEL.top + share(0.755) * PANEL.height - size / 2.0,
                    width: size,
                    height: size,
                };
                let texts = placed(name, at, vec![at]);
                let [text] = texts.as_slice() else {
                    panic!("{name} of {size} pixels in step {step} has no label")
                };
                assert!(PANEL.holds(text), "{name}: {text:?}");
                assert_eq!(text.shared(&at), 0.0, "{name} at {at:?}: {text:?}");
            }
        }
    }

    /// There is no room beside a table that fills the panel.
    #[test]
    fn a_thing_that_fills_its_panel_is_labelled_on_it() {
        let glass = Rect {
            left: 200.0,
            top: 150.0,
            width: 80.0,
            height: 80.0,
        };
        let texts = placed("table_1", PANEL.grown(30.0), vec![glass]);
        assert!(texts.len() == 1 && PANEL.holds(&texts[0]), "{texts:?}");
        assert_eq!(texts[0].shared(&glass), 0.0);
    }

    /// The middle of a crowd.
    #[test]
    fn a_label_is_rather_far_away_than_on_another_thing() {
        let thing = |column: f64, row: f64| Rect {
            left: 200.0 + 20.0 * column,
            top: 80.0 + 44.0 * row,
            width: 18.0,
            height: 40.0,
        };
        let rows = (0..5).flat_map(|row| (0..9).map(move |column| (column, row)));
        let things: Vec<Rect> = rows
            .map(|(column, row)| thing(f64::from(column), f64::from(row)))
            .collect();
        let texts = placed("box_1", thing(4.0, 2.0), things.clone());
        let [text] = texts.as_slice() else {
            panic!("{texts:?}")
        };
        let hidden: f64 = things.iter().map(|thing| thing.shared(text)).sum();
        assert!(hidden == 0.0 && PANEL.holds(text), "{text:?}");
    }
}
