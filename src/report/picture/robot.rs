//! Draws a robot in its postures, from the side and from the front, with the frames of its profile.

use nalgebra::{Isometry3, Point3};

use crate::picture::drawing::{Drawing, Line, Paint, Rect, Words};
use crate::picture::labels::{Label, Labels};
use crate::picture::outline::{bounds_of, silhouette};
use crate::picture::panel::ruler;
use crate::picture::window::{Bounds, View, Window};
use crate::picture::{font, paint};
use actcheck_data::RobotView;

/// Width of a panel and largest height. Unit: pixels.
const PANEL_PX: [f64; 2] = [330.0, 420.0];
/// Margin, and distance between panels. Unit: pixels.
const GAP_PX: f64 = 16.0;
/// Postures in one row.
const PER_ROW: usize = 2;
/// Margin around the robot. Unit: metres.
const AROUND_M: f64 = 0.12;
/// Length of the axes of a frame. Unit: pixels.
const AXIS_PX: f64 = 30.0;
/// Font sizes. Unit: pixels.
const TITLE_PX: f64 = 15.0;
const SIZE_PX: f64 = 11.0;
/// Views of each posture, with their titles.
const VIEWS: [(View, &str); 2] = [
    (View { across: 0, up: 2 }, "from the side   x → z ↑"),
    (View { across: 1, up: 2 }, "from behind   ← y   z ↑"),
];
/// Colours of the x, y and z axes. (Okabe and Ito.)
const AXES: [u32; 3] = [0xd5_5e00, 0x00_8a66, 0x00_72b2];

/// Draws a robot in each of its postures. Returns `None` if it has no shapes.
pub fn robot_picture(name: &str, postures: &[RobotView]) -> Option<Drawing> {
    let shapes = postures
        .iter()
        .filter_map(|view| bounds_of(&view.solids, &Isometry3::identity()));
    let bounds = Bounds::union(shapes)?.grown(AROUND_M);
    let widest = bounds.extent(0).max(bounds.extent(1)).max(0.1);
    let scale = (PANEL_PX[0] / widest).min(PANEL_PX[1] / bounds.extent(2).max(0.1));
    let height = bounds.extent(2) * scale;
    let columns = postures.len().min(PER_ROW) * VIEWS.len();
    let mut drawing = Drawing::new(GAP_PX + columns as f64 * (PANEL_PX[0] + GAP_PX));
    let title = format!("{name}: axes x orange, y green, z blue");
    let mut top = GAP_PX;
    for line in font::wrapped(&title, TITLE_PX, true, drawing.width - 2.0 * GAP_PX) {
        top += TITLE_PX;
        write(&mut drawing, &line, [GAP_PX, top], TITLE_PX, true);
    }
    top += GAP_PX;
    let row_px = height + GAP_PX * 2.0 + SIZE_PX;
    for (idx, posture) in postures.iter().enumerate() {
        for (side, (view, from)) in VIEWS.into_iter().enumerate() {
            let column = (idx % PER_ROW) * VIEWS.len() + side;
            let left = GAP_PX + column as f64 * (PANEL_PX[0] + GAP_PX);
            let above = top + (idx / PER_ROW) as f64 * row_px;
            write(
                &mut drawing,
                &format!("{}, {from}", posture.title),
                [left, above + SIZE_PX],
                SIZE_PX,
                false,
            );
            let panel = Rect {
                left,
                top: above + SIZE_PX + 6.0,
                width: PANEL_PX[0],
                height,
            };
            draw(
                &mut drawing,
                posture,
                &Window::new(view, bounds, scale, panel),
            );
        }
    }
    drawing.height = top + postures.len().div_ceil(PER_ROW) as f64 * row_px;
    Some(drawing)
}

/// Draws one posture on one panel.
fn draw(drawing: &mut Drawing, posture: &RobotView, window: &Window) {
    drawing.polygon(window.panel.corners(), paint::BACKGROUND);
    drawing.clip(Some(window.panel));
    let outlines = silhouette(&posture.solids, &Isometry3::identity(), window).into_iter();
    // From behind, y points left.
    let mirrored = |point: [f64; 2]| match window.view.across {
        1 => [
            window.panel.left + window.panel.right() - point[0],
            point[1],
        ],
        _ => point,
    };
    let outlines = outlines
        .map(|line| line.into_iter().map(mirrored).collect())
        .collect();
    drawing.shape(outlines, true, paint::ROBOT);
    let mut labels = Labels::new(window.panel, Vec::new());
    ruler(drawing, window, &mut labels);
    let mut spots = Vec::new();
    for (name, pose) in &posture.frames {
        let pose = pose.to_isometry();
        let origin = mirrored(window.pixel(pose.translation.vector.into()));
        let mut spot = Rect {
            left: origin[0],
            top: origin[1],
            width: 0.0,
            height: 0.0,
        };
        for (axis, rgb) in AXES.into_iter().enumerate() {
            let mut tip = Point3::origin();
            tip[axis] = AXIS_PX / window.scale;
            let end = mirrored(window.pixel((pose * tip).coords.into()));
            drawing.line(vec![origin, end], Line::new(Paint::solid(rgb), 2.2));
            spot = spot.with(end);
        }
        labels.keep_out(spot);
        spots.push((name, spot));
    }
    for (name, at) in spots {
        labels.write(
            drawing,
            &Label {
                text: name,
                size: SIZE_PX,
                bold: false,
                rgb: paint::INK,
                at,
            },
        );
    }
    drawing.clip(None);
}

fn write(drawing: &mut Drawing, text: &str, at: [f64; 2], size: f64, bold: bool) {
    let (text, paint) = (text.to_owned(), Paint::solid(paint::INK));
    drawing.words(Words {
        text,
        at,
        size,
        bold,
        paint,
        rim: false,
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::{Part, Pose, Shape};

    #[test]
    fn a_posture_is_drawn_from_two_sides_with_labelled_frames() {
        let solid = Part {
            pose: Pose::upright([0.0, 0.0, 0.5], 0.0),
            shape: Shape::Box {
                size: [0.2, 0.3, 1.0],
            },
        };
        let frames = vec![(
            "grasp: hand".to_owned(),
            Pose::upright([0.3, 0.0, 0.5], 0.0),
        )];
        let view = RobotView {
            title: "home".to_owned(),
            solids: vec![solid],
            frames,
        };
        let svg = robot_picture("Robot", &[view])
            .expect("it has shapes")
            .to_svg();
        assert_eq!(svg.matches("grasp: hand").count(), 2, "{svg}");
        assert!(svg.contains("home, from the side"), "{svg}");
        assert_eq!(robot_picture("Robot", &[]), None);
    }
}
