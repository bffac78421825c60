//! Lays out the picture of a run: header, panels, legend.

use std::collections::BTreeSet;

use crate::picture::Caption;
use crate::picture::drawing::{Drawing, Paint, Rect, Words};
use crate::picture::outline::bounds_of;
use crate::picture::panel::{Moment, PanelData};
use crate::picture::paths::{Mover, paths};
use crate::picture::window::{Bounds, View, Window, close_ups, overview};
use crate::picture::{charts, header, legend, paint, panel};
use crate::pressed::hardest_of_run;
use actcheck_data::{Role, Trace};

/// Width of a picture. Unit: pixels.
const WIDTH_PX: f64 = 1200.0;
/// Margin, and distance between panels. Unit: pixels.
const GAP_PX: f64 = 18.0;
/// Height of a panel's title. Unit: pixels.
const TITLE_PX: f64 = 20.0;
/// Maximum panel heights: map, view from above, side view. Unit: pixels.
const HIGHEST_PX: [f64; 3] = [330.0, 430.0, 340.0];

/// Draws a run. Returns `None` if it has no state to draw.
///
/// On the left is the state before the first action with percepts; on the right is the state after
/// the last action with the paths of base, hand and target, in the colour of the action, and a mark
/// at the hardest contact of the robot with something that it is not to touch. The top row is a
/// map, if the world is larger than the close-ups; below it are close-ups from above and from the
/// side, and charts of the signals that decided failed properties about time.
pub fn run_picture(caption: &Caption, trace: &Trace) -> Option<Drawing> {
    let of_role = |role: Role| {
        caption
            .roles
            .iter()
            .filter(move |(_, other)| **other == role)
            .map(|(id, _)| id.as_str())
    };
    let target = of_role(Role::Target).next();
    let subjects: BTreeSet<&str> = match target {
        Some(target) => BTreeSet::from([target]),
        None => of_role(Role::Other).collect(),
    };
    let paths = paths(trace, target);
    let data = PanelData {
        trace,
        paths: &paths,
        roles: &caption.roles,
        seen: &caption.seen,
        pressed: hardest_of_run(
            trace,
            caption
                .witnesses
                .iter()
                .map(|(idx, witness)| (*idx, witness.as_str())),
        ),
        forms: trace
            .forms
            .iter()
            .map(|form| (form.name.as_str(), form))
            .collect(),
    };
    let close_ups = close_ups(
        trace,
        &subjects,
        data.pressed.as_ref().map(|pressed| pressed.point_m),
        mount(trace),
    )?;
    let base_path: Vec<[f64; 3]> = paths
        .iter()
        .filter(|path| path.mover == Mover::Base)
        .flat_map(|path| path.points.iter().copied())
        .collect();
    let mut drawing = Drawing::new(WIDTH_PX);
    let inner = WIDTH_PX - 2.0 * GAP_PX;
    let area = Rect {
        left: GAP_PX,
        top: GAP_PX - 4.0,
        width: inner,
        height: 0.0,
    };
    let mut y = header::draw(&mut drawing, caption, data.pressed.as_ref(), area) + 12.0;
    let side = View {
        across: across(trace, &close_ups[0]),
        up: 2,
    };
    let whole = overview(trace, &close_ups, &base_path).map(|whole| (View::TOP, [whole; 2], 0));
    for (view, bounds, kind) in whole
        .into_iter()
        .chain([(View::TOP, close_ups, 1), (side, close_ups, 2)])
    {
        y = row(&mut drawing, &data, view, &bounds, kind, y);
    }
    let below = Rect {
        left: GAP_PX,
        top: y,
        width: inner,
        height: 0.0,
    };
    y = charts::draw(&mut drawing, &caption.charts, below, GAP_PX);
    drawing.height = legend::draw(&mut drawing, &data, GAP_PX, y, inner) + GAP_PX / 2.0;
    Some(drawing)
}

/// The box around the links of the robot that no joint moves, such as its pedestal.
fn mount(trace: &Trace) -> Option<Bounds> {
    let links = trace.still_links(trace.snapshots.first()?);
    Bounds::union(links.filter_map(|(form, pose)| bounds_of(&form.parts, &pose.to_isometry())))
}

/// Horizontal axis of the side view: the axis along which the robot approaches, so that hand and
/// target do not hide each other.
fn across(trace: &Trace, about: &Bounds) -> usize {
    let base = trace
        .snapshots
        .first()
        .map_or([0.0; 3], |snapshot| snapshot.robot.base_true);
    let distance =
        |axis: usize| (f64::midpoint(about.low[axis], about.high[axis]) - base[axis]).abs();
    usize::from(distance(1) > distance(0))
}

/// Draws two panels of one view, before and after. Returns their lower end.
fn row(
    drawing: &mut Drawing,
    data: &PanelData<'_>,
    view: View,
    bounds: &[Bounds; 2],
    kind: usize,
    top: f64,
) -> f64 {
    let width = (WIDTH_PX - 3.0 * GAP_PX) / 2.0;
    let extent = |axis: usize| bounds[0].extent(axis).max(bounds[1].extent(axis));
    let scale = (width / extent(view.across)).min(HIGHEST_PX[kind] / extent(view.up));
    let height = extent(view.up) * scale;
    let is_map = kind == 0;
    for (idx, moment) in [Moment::Before, Moment::After].into_iter().enumerate() {
        let left = GAP_PX + idx as f64 * (width + GAP_PX);
        let panel = Rect {
            left,
            top: top + TITLE_PX,
            width,
            height,
        };
        let when = if moment == Moment::Before {
            "before"
        } else {
            "after"
        };
        let what = if is_map { "the whole world " } else { "" };
        let text = format!("{when}, {what}{}", view.title());
        let paint = Paint::solid(paint::GREY);
        drawing.words(Words {
            text,
            at: [left, top + TITLE_PX - 6.0],
            size: 12.0,
            bold: false,
            paint,
            rim: false,
        });
        panel::draw(
            drawing,
            data,
            moment,
            &Window::new(view, bounds[idx], scale, panel),
            is_map,
        );
    }
    top + TITLE_PX + height + 10.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made_up::snapshot;
    use crate::picture::drawing::Mark;
    use actcheck_data::{Colour, Form, Frames, LinkState, Part, Pose, SeenPart, Shape};

    fn cube() -> Part {
        Part {
            pose: Pose::IDENTITY,
            shape: Shape::Box { size: [0.1; 3] },
        }
    }

    /// A fixed robot of a pedestal, which has no track, and of a hand.
    fn trace() -> Trace {
        let mut state = snapshot(0.0);
        for body in &mut state.bodies {
            (body.aabb_min, body.aabb_max) = ([-0.2; 3], [0.2; 3]);
        }
        let names = ["pedestal", "hand"];
        state.robot.links = names
            .iter()
            .zip([0.0, 0.3])
            .map(|(name, x)| LinkState {
                name: (*name).to_owned(),
                pose: Pose::upright([x, 0.3, 0.2], 0.0),
            })
            .collect();
        let form = |name: &&str| Form {
            name: format!("robot/{name}"),
            parts: vec![cube()],
        };
        Trace {
            snapshots: vec![state.clone(), state],
            frames: Frames {
                names: vec!["robot/hand".to_owned()],
                ..Frames::default()
            },
            forms: names.iter().map(form).collect(),
            ..Trace::default()
        }
    }

    /// For each panel with some: the number of links that are drawn by their shapes, without the
    /// sample of the legend, which is the last one; and the number of images.
    fn drawn(caption: &Caption) -> (Vec<usize>, usize) {
        let drawing = run_picture(caption, &trace()).expect("it has states");
        let links = drawing.marks.iter().filter_map(|(_, mark)| match mark {
            Mark::Shape { lines, style, .. } if *style == paint::ROBOT => Some(lines.len()),
            _ => None,
        });
        let images = drawing
            .marks
            .iter()
            .filter(|(_, mark)| matches!(mark, Mark::Image { .. }));
        let mut links: Vec<usize> = links.collect();
        assert_eq!(
            links.pop(),
            Some(1),
            "the legend explains the robot's colour"
        );
        (links, images.count())
    }

    #[test]
    fn links_that_no_joint_moves_are_drawn_too() {
        assert_eq!(drawn(&Caption::default()), (vec![2; 4], 0));
    }

    #[test]
    fn a_link_with_a_look_is_drawn_as_it_looks() {
        let look = vec![SeenPart {
            part: cube(),
            colour: Some(Colour([255, 0, 0])),
        }];
        let hand = Caption {
            seen: [("robot/hand".to_owned(), look.clone())].into(),
            ..Caption::default()
        };
        assert_eq!(drawn(&hand), (vec![1; 4], 4));
        let names = ["robot/hand", "robot/pedestal", "glass_1", "table_1"];
        let all = Caption {
            seen: names.map(|name| (name.to_owned(), look.clone())).into(),
            ..Caption::default()
        };
        let (links, images) = drawn(&all);
        assert_eq!((links, images), (vec![], 12));
        let svg = run_picture(&all, &trace()).expect("it has states").to_svg();
        assert_eq!(svg.matches("data:image/png;base64,").count(), 12);
    }
}
