//! Draws collisions from above: the goal in the middle, the approach of the robot upwards, every
//! movable thing as a dot, and every thing that was hit as a cross in the colour of its category,
//! larger for larger forces.

use crate::picture::drawing::{Drawing, Line, Paint, Rect, Style, Words};
use crate::picture::{font, paint};
use crate::{FindingsSummary, Proportion};
use actcheck_analysis::{Collisions, PlacedThing, Sampling};
use actcheck_base::names;

/// Width of a picture. Unit: pixels.
const WIDTH_PX: f64 = 760.0;
/// Margin, and distance between panels. Unit: pixels.
const GAP_PX: f64 = 18.0;
/// Side of a panel. Unit: pixels.
const PANEL_PX: f64 = 440.0;
/// Font sizes. Unit: pixels.
const SIZE_PX: f64 = 12.0;
const TITLE_PX: f64 = 14.0;
/// Line height. Unit: pixels.
const LINE_PX: f64 = 18.0;
/// Radii of the circles around the goal. Unit: metres.
const RINGS_M: [f64; 7] = [0.1, 0.2, 0.4, 0.6, 0.8, 1.2, 1.6];
/// Number of corners with which a circle is drawn.
const RING_CORNERS: u32 = 120;
/// Circles smaller than this share of the largest one have no label: labels would overlap.
const LABELLED: f64 = 0.25;
/// Share of the hit things that the panel must show.
const SHOWN: f64 = 0.95;
/// Half the size of a cross at 1 N and its growth with each tenfold force. Unit: pixels.
const CROSS_PX: [f64; 2] = [3.0, 1.5];
/// Colours of categories, most often hit first; the last one is for all others. (Okabe and Ito,
/// distinguishable by people with colour vision deficiencies.)
const COLOURS: [u32; 7] = [
    0xd5_5e00, 0x00_72b2, 0xcc_79a7, 0xe6_9f00, 0x56_b4e9, 0x00_9e73, 0x55_5555,
];

/// Draws the collisions of every action that has any. Returns `None` if none has a place.
pub fn collisions_picture(findings: &FindingsSummary) -> Option<Drawing> {
    let mut drawing = Drawing::new(WIDTH_PX);
    let mut top = GAP_PX;
    let with_places = findings
        .collisions
        .iter()
        .filter(|of| of.things.iter().any(|thing| thing.force_n.is_some()));
    for of in with_places {
        top = panel(&mut drawing, of, findings.sampling, top) + GAP_PX;
    }
    drawing.height = top;
    (top > GAP_PX).then_some(drawing)
}

fn panel(drawing: &mut Drawing, of: &Collisions, sampling: Sampling, top: f64) -> f64 {
    let share = Proportion::sampled(of.hit, of.executions, sampling)
        .map_or_else(String::new, |share| share.to_string());
    let title = format!("{}: collisions in {share}", names::local(&of.action));
    write(
        drawing,
        &title,
        [GAP_PX, top + TITLE_PX],
        TITLE_PX,
        true,
        paint::INK,
    );
    let view = GoalRegion::of(
        &of.things,
        Rect {
            left: GAP_PX,
            top: top + 26.0,
            width: PANEL_PX,
            height: PANEL_PX,
        },
    );
    view.draw(drawing, of);
    legend(drawing, of, [view.panel.right() + GAP_PX, view.panel.top]);
    view.panel.bottom()
}

fn write(drawing: &mut Drawing, text: &str, at: [f64; 2], size: f64, bold: bool, rgb: u32) {
    drawing.words(Words {
        text: text.to_owned(),
        at,
        size,
        bold,
        paint: Paint::solid(rgb),
        rim: false,
    });
}

/// Colour of a category.
fn colour(of: &Collisions, category: &str) -> u32 {
    let place = of
        .kinds
        .iter()
        .position(|kind| kind.category == category)
        .unwrap_or(usize::MAX);
    COLOURS[place.min(COLOURS.len() - 1)]
}

fn cross_px(force_n: f64) -> f64 {
    CROSS_PX[0] + CROSS_PX[1] * libm::log10(force_n.max(1.0))
}

/// The region around the goal that a panel shows.
struct GoalRegion {
    panel: Rect,
    /// Radius of the largest circle. Unit: metres.
    radius_m: f64,
}

impl GoalRegion {
    fn of(things: &[PlacedThing], panel: Rect) -> Self {
        let hit = things.iter().filter(|thing| thing.force_n.is_some());
        let mut away: Vec<f64> = hit
            .map(|thing| libm::hypot(thing.beyond_m, thing.left_m))
            .collect();
        away.sort_by(f64::total_cmp);
        let most = ((away.len() as f64 * SHOWN) as usize).min(away.len().saturating_sub(1));
        let far = away.get(most).copied().unwrap_or_default();
        let radius_m = RINGS_M
            .into_iter()
            .find(|ring| *ring >= far)
            .unwrap_or(RINGS_M[RINGS_M.len() - 1]);
        Self { panel, radius_m }
    }

    fn scale(&self) -> f64 {
        self.panel.width / 2.2 / self.radius_m
    }

    /// Position in pixels: beyond the goal is up.
    fn pixel(&self, [beyond, left]: [f64; 2]) -> [f64; 2] {
        let [x, y] = self.panel.middle();
        [x - left * self.scale(), y - beyond * self.scale()]
    }

    fn draw(&self, drawing: &mut Drawing, of: &Collisions) {
        drawing.polygon(self.panel.corners(), paint::BACKGROUND);
        self.rings(drawing);
        drawing.clip(Some(self.panel));
        let (hit, missed): (Vec<&PlacedThing>, Vec<&PlacedThing>) =
            of.things.iter().partition(|thing| thing.force_n.is_some());
        for thing in missed {
            let at = self.pixel([thing.beyond_m, thing.left_m]);
            drawing.circle(at, 1.8, Style::fill(Paint::new(paint::GREY, 0.4)));
        }
        for thing in hit {
            let ([x, y], size) = (
                self.pixel([thing.beyond_m, thing.left_m]),
                cross_px(thing.force_n.unwrap_or(1.0)),
            );
            let lines = vec![
                vec![[x - size, y - size], [x + size, y + size]],
                vec![[x - size, y + size], [x + size, y - size]],
            ];
            let line = Line::new(Paint::new(colour(of, &thing.category), 0.9), 1.8);
            drawing.shape(lines, false, Style::line(line));
        }
        drawing.circle(
            self.panel.middle(),
            4.0,
            Style::fill(Paint::solid(paint::INK)),
        );
        drawing.clip(None);
    }

    /// Draws the circles with their radii, and the arrow of the approach.
    fn rings(&self, drawing: &mut Drawing) {
        let grid = Line::new(Paint::new(paint::GREY, 0.35), 0.8);
        let middle = self.panel.middle();
        let turn = std::f64::consts::TAU / f64::from(RING_CORNERS);
        for ring in RINGS_M.into_iter().filter(|ring| *ring <= self.radius_m) {
            let on_ring = |idx: u32| {
                let (sin, cos) = libm::sincos(turn * f64::from(idx));
                self.pixel([ring * cos, ring * sin])
            };
            drawing.polygon((0..RING_CORNERS).map(on_ring).collect(), Style::line(grid));
            if ring >= LABELLED * self.radius_m {
                // At the lower right, where the approach does not cross it.
                let [x, y] = on_ring(RING_CORNERS * 5 / 8);
                let text = format!("{:.0} cm", ring * 100.0);
                let width = font::width(&text, SIZE_PX - 2.0, false);
                write(
                    drawing,
                    &text,
                    [x - width - 4.0, y - 2.0],
                    SIZE_PX - 2.0,
                    false,
                    paint::GREY,
                );
            }
        }
        let (low, tip) = (
            [middle[0], self.panel.bottom() - 8.0],
            [middle[0], self.panel.bottom() - 44.0],
        );
        let arrow = Style::line(Line::new(Paint::solid(paint::INK), 2.0));
        let head = vec![
            [tip[0] - 5.0, tip[1] + 8.0],
            tip,
            [tip[0] + 5.0, tip[1] + 8.0],
        ];
        drawing.shape(vec![vec![low, tip], head], false, arrow);
        write(
            drawing,
            "the robot's approach",
            [tip[0] + 9.0, low[1] - 4.0],
            SIZE_PX - 1.0,
            false,
            paint::INK,
        );
    }
}

fn legend(drawing: &mut Drawing, of: &Collisions, [left, top]: [f64; 2]) {
    let mut y = top + SIZE_PX;
    for kind in &of.kinds {
        let (rgb, size) = (colour(of, &kind.category), 5.0);
        let [x, middle] = [left + size, y - 4.0];
        let lines = vec![
            vec![[x - size, middle - size], [x + size, middle + size]],
            vec![[x - size, middle + size], [x + size, middle - size]],
        ];
        drawing.shape(lines, false, Style::line(Line::new(Paint::solid(rgb), 1.8)));
        let text = format!(
            "{}: hit in {} of {}",
            names::local(&kind.category),
            kind.hit,
            kind.present
        );
        write(drawing, &text, [left + 16.0, y], SIZE_PX, true, paint::INK);
        let force = format!(
            "median {:.1} N, largest {:.1} N",
            kind.force_n.p50, kind.force_n.most
        );
        write(
            drawing,
            &force,
            [left + 16.0, y + LINE_PX - 3.0],
            SIZE_PX - 1.0,
            false,
            paint::GREY,
        );
        y += 2.0 * LINE_PX + 2.0;
    }
    drawing.circle(
        [left + 5.0, y - 4.0],
        1.8,
        Style::fill(Paint::new(paint::GREY, 0.4)),
    );
    write(
        drawing,
        "not hit",
        [left + 16.0, y],
        SIZE_PX,
        false,
        paint::INK,
    );
    drawing.circle(
        [left + 5.0, y + LINE_PX - 4.0],
        4.0,
        Style::fill(Paint::solid(paint::INK)),
    );
    write(
        drawing,
        "target or goal",
        [left + 16.0, y + LINE_PX],
        SIZE_PX,
        false,
        paint::INK,
    );
    write(
        drawing,
        "larger crosses: larger forces",
        [left, y + 2.0 * LINE_PX],
        SIZE_PX - 1.0,
        false,
        paint::GREY,
    );
}
