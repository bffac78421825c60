//! The legend of a picture. It only has the colours and lines that occur.

use crate::picture::drawing::{Drawing, Paint, Rect, Style, Words};
use crate::picture::panel::{PanelData, star};
use crate::picture::paths::Mover;
use crate::picture::{font, paint};
use actcheck_data::Role;

/// Font size. Unit: pixels.
const SIZE_PX: f64 = 11.5;
/// Line height. Unit: pixels.
const LINE_PX: f64 = 20.0;
/// Width of a symbol. Unit: pixels.
const SAMPLE_PX: f64 = 22.0;

enum Sample {
    Area(Style),
    Path(Mover),
    Star,
}

/// Draws the legend from `top` on and returns its lower end.
pub(super) fn draw(
    drawing: &mut Drawing,
    data: &PanelData<'_>,
    left: f64,
    top: f64,
    width: f64,
) -> f64 {
    let (mut x, mut y) = (left, top);
    for (sample, text) in entries(data) {
        let wide = SAMPLE_PX + 6.0 + font::width(text, SIZE_PX, false) + 20.0;
        if x + wide > left + width && x > left {
            (x, y) = (left, y + LINE_PX);
        }
        let middle = y + LINE_PX / 2.0;
        match sample {
            Sample::Area(style) => {
                let area = Rect {
                    left: x,
                    top: middle - 6.0,
                    width: SAMPLE_PX,
                    height: 12.0,
                };
                drawing.polygon(area.corners(), style);
            }
            Sample::Star => {
                drawing.polygon(star([x + SAMPLE_PX / 2.0, middle], 8.0), paint::PRESSED);
            }
            Sample::Path(mover) => {
                drawing.line(
                    vec![[x, middle], [x + SAMPLE_PX, middle]],
                    paint::path(mover, paint::action(0)),
                );
            }
        }
        let at = [x + SAMPLE_PX + 6.0, middle + SIZE_PX * 0.36];
        let ink = Paint::solid(paint::INK);
        drawing.words(Words {
            text: text.to_owned(),
            at,
            size: SIZE_PX,
            bold: false,
            paint: ink,
            rim: false,
        });
        x += wide;
    }
    y + LINE_PX
}

fn entries(data: &PanelData<'_>) -> Vec<(Sample, &'static str)> {
    let has = |role: Role| data.roles.values().any(|other| *other == role);
    let moved = |mover: Mover| data.paths.iter().any(|path| path.mover == mover);
    let perceived = data
        .trace
        .actions
        .iter()
        .any(|action| !action.percepts.is_empty() || action.perceived.is_some());
    let pressed = data.pressed.is_some();
    let all = [
        (
            has(Role::Target),
            Sample::Area(paint::movable(Role::Target)),
            "target",
        ),
        (
            has(Role::Other) || has(Role::PlaceOther),
            Sample::Area(paint::movable(Role::Other)),
            "other objects",
        ),
        (
            has(Role::Obstacle),
            Sample::Area(paint::movable(Role::Obstacle)),
            "obstacles",
        ),
        (true, Sample::Area(paint::FURNITURE), "furniture"),
        (true, Sample::Area(paint::ROBOT), "robot"),
        (
            perceived,
            Sample::Area(paint::GLIMPSE),
            "perceived, where the robot believes it",
        ),
        (
            moved(Mover::Base),
            Sample::Path(Mover::Base),
            "path of the base, in the colour of its action",
        ),
        (
            moved(Mover::Hand),
            Sample::Path(Mover::Hand),
            "path of the hand",
        ),
        (
            moved(Mover::Target),
            Sample::Path(Mover::Target),
            "path of the target",
        ),
        (pressed, Sample::Star, "hardest unwanted contact"),
    ];
    all.into_iter()
        .filter(|(there, ..)| *there)
        .map(|(_, sample, text)| (sample, text))
        .collect()
}
