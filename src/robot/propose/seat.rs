//! A grasp frame deeper between fingers that would squeeze a can out at their tips.

use nalgebra::{Isometry3, Point3, Translation3, Vector3};
use parry3d::query::Ray;

use crate::Gripper;
use crate::description::RobotModel;
use crate::gripper::{Probe, outward_push};
use actcheck_geometry::{from_pose, to_vector};

/// Diameter of a can of 0.33 litres. Unit: metres.
const CAN_M: f64 = 0.066;
/// Fingers that push a can out with this share of their force: friction seldom holds it. Unit: 1.
const SQUEEZED: f64 = 0.5;
/// Room between the can and the palm. Unit: metres. Hands on their way to an object keep as much
/// from it.
const PALM_ROOM_M: f64 = 0.003;
/// How much deeper a frame may be, and the steps that are compared. Unit: metres.
const DEEPEST_M: f64 = 0.02;
const STEP_M: f64 = 0.005;

/// Returns how much deeper between the fingers an object belongs than at this frame. Unit: metres.
/// `at` is the gripper with the frame that much deeper, if its fingers can be measured there.
///
/// A jaw that turns against a fixed one pushes the object along both until the angle between them
/// holds it: it must have room to slide, so it begins at the palm. Two fingers that turn hold it
/// where they push it out least.
pub(super) fn deeper_m(
    model: &RobotModel,
    links: [usize; 2],
    (palm, frame): (usize, Isometry3<f64>),
    at: impl Fn(f64) -> Option<Gripper>,
) -> f64 {
    let push = |depth_m: f64| -> Option<f64> {
        let moved = (palm, frame * Translation3::new(-depth_m, 0.0, 0.0));
        outward_push(model, &at(depth_m)?, links, moved, CAN_M)
    };
    let Some(now) = push(0.0).filter(|push| *push >= SQUEEZED) else {
        return 0.0;
    };
    if links.contains(&palm) {
        let behind_m = at(0.0).and_then(|gripper| palm_m(model, links, (palm, frame), &gripper));
        let room_m = behind_m.map_or(0.0, |behind_m| behind_m - CAN_M / 2.0 - PALM_ROOM_M);
        return room_m.clamp(0.0, DEEPEST_M);
    }
    let mut best = (now, 0.0);
    let mut depth_m = STEP_M;
    while depth_m <= DEEPEST_M {
        match push(depth_m) {
            // Fingers that push it inwards hold it too, but no better than those that don't push
            // it.
            Some(push) if push.max(0.0) < best.0 => best = (push.max(0.0), depth_m),
            Some(_) => {}
            None => break,
        }
        depth_m += STEP_M;
    }
    best.1
}

/// Distance from the grasp frame back to the palm when the fingers are around a can. Unit: metres.
fn palm_m(
    model: &RobotModel,
    links: [usize; 2],
    (palm, frame): (usize, Isometry3<f64>),
    gripper: &Gripper,
) -> Option<f64> {
    let mut positions: Vec<f64> = model
        .joints
        .iter()
        .map(|joint| 0.0_f64.clamp(joint.lower, joint.upper))
        .collect();
    gripper.set(&mut positions, CAN_M.min(gripper.widest_m()));
    let middle_m = gripper.middle_m(CAN_M.min(gripper.widest_m()));
    let probe = Probe::new(model, links, (palm, frame));
    let hits = (0..2).flat_map(|side| {
        let (link, in_grasp) = probe.finger(side, &positions);
        let form = model.links[link].form();
        let of_solid = form.shapes().filter_map(|(shape, pose)| {
            let into = (in_grasp * from_pose(pose)).inverse();
            let (from, back) = (into * Point3::new(0.0, middle_m, 0.0), into * -Vector3::x());
            let ray = Ray::new(to_vector(&from.coords), to_vector(&back));
            shape.cast_local_ray(&ray, 1.0, true).map(f64::from)
        });
        of_solid.collect::<Vec<f64>>()
    });
    hits.min_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_base::{Files, Source};
    use std::path::Path;

    /// A jaw of 6 cm that turns against a fixed one, 2 cm before a palm, and its frame 2.5 cm
    /// before their tips: around a can it is at 56 degrees to the fixed one. Returns how much
    /// deeper an object belongs.
    fn deeper(hinge_m: f64) -> f64 {
        let path = Path::new("models/robots/mobile_manipulator.toml");
        let shipped = actcheck_config::robot::read(&Files::Shipped, path)
            .expect("the shipped robot is valid");
        let inertial = "<inertial><mass value=\"0.1\"/>\
                        <inertia ixx=\"1e-4\" ixy=\"0\" ixz=\"0\" iyy=\"1e-4\" iyz=\"0\" izz=\"1e-4\"/></inertial>";
        let shape = |size: [f64; 3], at: [f64; 3]| {
            let words = |values: [f64; 3]| values.map(|value| value.to_string()).join(" ");
            let (size, at) = (words(size), words(at));
            format!(
                "<collision><origin xyz=\"{at}\"/><geometry><box size=\"{size}\"/></geometry></collision>"
            )
        };
        let plate = shape([0.02, 0.12, 0.04], [-0.01, 0.02, 0.0]);
        let (fixed, moving) = (
            shape([0.08, 0.01, 0.03], [0.04, -0.025, 0.0]),
            shape(
                [0.08 - hinge_m, 0.01, 0.03],
                [(0.08 - hinge_m) / 2.0, 0.005, 0.0],
            ),
        );
        let text = format!(
            "<robot name=\"hand\"><link name=\"palm\">{inertial}{plate}{fixed}</link>\
             <link name=\"jaw\">{inertial}{moving}</link>\
             <joint name=\"jaw\" type=\"revolute\"><parent link=\"palm\"/><child link=\"jaw\"/>\
             <origin xyz=\"{hinge_m} 0.02 0\"/><axis xyz=\"0 0 1\"/>\
             <limit lower=\"0\" upper=\"1.4\" effort=\"5\" velocity=\"2\"/></joint></robot>"
        );
        let core = actcheck_config::robot::with_urdf(shipped.core, Source::new("hand.urdf", text))
            .expect("it is a URDF");
        let model = RobotModel::without_roles(&core).expect("the hand is valid");
        let jaw = model.joint("jaw").expect("it has a jaw");
        let links = ["jaw", "palm"].map(|name| {
            model
                .links
                .iter()
                .position(|link| link.name == name)
                .unwrap_or(0)
        });
        let frame = |depth_m: f64| Isometry3::translation(0.055 - depth_m, 0.0, 0.0);
        let at =
            |depth_m: f64| Gripper::find(&[jaw], &model, links, (links[1], frame(depth_m))).ok();
        deeper_m(&model, links, (links[1], frame(0.0)), at)
    }

    #[test]
    fn a_jaw_that_squeezes_a_can_out_takes_it_at_the_palm() {
        // The can is 3 mm before the palm then.
        let deep_m = deeper(0.02);
        assert!((deep_m - 0.019).abs() < 1e-4, "{deep_m}");
    }

    #[test]
    fn a_long_jaw_holds_it_at_its_tips() {
        let deep_m = deeper(-0.01);
        assert!(deep_m == 0.0, "{deep_m}");
    }
}
