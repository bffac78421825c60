//! How the fingers push a round object along themselves when they close on it.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use parry3d::shape::Cylinder;

use super::Gripper;
use super::gap::Probe;
use crate::description::RobotModel;
use actcheck_geometry::{Separation, SeparationOutcome, SolidPair};
use actcheck_geometry::{from_pose, to_pose, to_real};

/// Half of the height of the part of the object between the fingertips: most are at least this
/// wide. Unit: metres.
const HALF_HEIGHT_M: f32 = 0.008;
/// Steps in which the fingers close, and halvings for their last step and for the place of the
/// object.
const N_STEPS: u32 = 40;
const N_HALVINGS: u32 = 12;
/// How far the fingers may push the object aside. Unit: metres.
const ASIDE_M: f64 = 0.04;
/// Distance that counts as far. Unit: metres.
const FAR_M: f64 = 0.5;

/// Fingers that close on an upright cylinder at the grasp frame.
struct Closing<'a> {
    model: &'a RobotModel,
    probe: &'a Probe<'a>,
    gripper: &'a Gripper,
    cylinder: Cylinder,
}

/// The fingers around a cylinder, in the grasp frame.
struct CylinderContact {
    /// Distance of both fingers. Unit: metres.
    distance_m: f64,
    /// From the left and the right finger to the cylinder.
    pushes: [Vector3<f64>; 2],
}

/// Returns the force along the fingers towards their tips, relative to that across them, with which
/// they push a cylinder of this diameter out of the hand as they close on it; negative if they push
/// it towards the palm. Friction holds the cylinder if its coefficient is greater. The cylinder is
/// parallel to the z axis of the grasp frame. Unit of the diameter: metres. Returns `None` if they
/// don't touch it from both sides.
pub(crate) fn outward_push(
    model: &RobotModel,
    gripper: &Gripper,
    links: [usize; 2],
    grasp: (usize, Isometry3<f64>),
    diameter_m: f64,
) -> Option<f64> {
    let [left, right] = pushes(model, gripper, links, grasp, diameter_m)?;
    let across = right.y - left.y;
    (across > 0.0).then(|| (left.x + right.x) / across)
}

/// Returns the directions in which the left and the right finger push a cylinder of this diameter
/// when they close on it, as unit vectors. Frame: that of the grasp. The cylinder is parallel to
/// its z axis. Unit of the diameter: metres. Returns `None` if they don't touch it from both sides.
pub(crate) fn pushes(
    model: &RobotModel,
    gripper: &Gripper,
    links: [usize; 2],
    grasp: (usize, Isometry3<f64>),
    diameter_m: f64,
) -> Option<[Vector3<f64>; 2]> {
    let mut probe = Probe::new(model, links, grasp);
    let mut positions = vec![0.0; model.joints.len()];
    gripper.set(&mut positions, gripper.widest_m());
    if probe.gap(&positions).is_none_or(|gap| gap.width_m() < 0.0) {
        // Some robots name their fingers as seen from the front.
        let [left, right] = links;
        probe = Probe::new(model, [right, left], grasp);
    }
    let cylinder = Cylinder::new(HALF_HEIGHT_M, to_real(diameter_m / 2.0));
    let closing = Closing {
        model,
        probe: &probe,
        gripper,
        cylinder,
    };
    let widest_m = gripper.widest_m();
    let at = |step: u32| widest_m * f64::from(step) / f64::from(N_STEPS);
    let apart = |opening_m: f64| {
        closing
            .touch(opening_m)
            .is_some_and(|touch| touch.distance_m > 0.0)
    };
    let first = (1..=N_STEPS).find(|step| apart(at(*step)))?;
    let (mut closed, mut open) = (at(first - 1), at(first));
    for _ in 0..N_HALVINGS {
        let middle = f64::midpoint(closed, open);
        if apart(middle) {
            open = middle
        } else {
            closed = middle
        }
    }
    closing.touch(open).map(|touch| touch.pushes)
}

impl Closing<'_> {
    /// The fingers at an opening, with the cylinder as far from the one as from the other.
    fn touch(&self, opening_m: f64) -> Option<CylinderContact> {
        let mut positions: Vec<f64> = self
            .model
            .joints
            .iter()
            .map(|joint| 0.0_f64.clamp(joint.lower, joint.upper))
            .collect();
        self.gripper.set(&mut positions, opening_m);
        let middle_m = self.gripper.middle_m(opening_m);
        let (mut low, mut high) = (middle_m - ASIDE_M, middle_m + ASIDE_M);
        let fingers = |y: f64| {
            Some([
                self.finger(0, &positions, y)?,
                self.finger(1, &positions, y)?,
            ])
        };
        for _ in 0..N_HALVINGS {
            let y = f64::midpoint(low, high);
            let [left, right] = fingers(y)?;
            // The left finger is where y is greater.
            if left.distance_m > right.distance_m {
                low = y
            } else {
                high = y
            }
        }
        let [left, right] = fingers(f64::midpoint(low, high))?;
        let distance_m = left.distance_m.min(right.distance_m);
        Some(CylinderContact {
            distance_m,
            pushes: [left.normal, right.normal],
        })
    }

    /// How far a finger is from the cylinder at this place across the hand. Frame: that of the
    /// grasp.
    fn finger(&self, side: usize, positions: &[f64], y: f64) -> Option<Separation> {
        // The axis of the engine's cylinders is y.
        let upright =
            UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2);
        let cylinder = Isometry3::from_parts(Translation3::new(0.0, y, 0.0), upright);
        let (link, from_grasp) = self.probe.finger(side, positions);
        let form = self.model.links[link].form();
        let of_solid = form.shapes().filter_map(|(shape, pose)| {
            let solid = from_grasp * from_pose(pose);
            let between = to_pose(&(solid.inverse() * cylinder));
            match SolidPair::new(&between, shape.as_support_map()?, &self.cylinder)
                .separation(Vector3::x(), FAR_M)
            {
                SeparationOutcome::Near(found) => Some(Separation {
                    normal: solid.rotation * found.normal,
                    ..found
                }),
                SeparationOutcome::Far(_) | SeparationOutcome::Nothing => None,
            }
        });
        of_solid.min_by(|a, b| a.distance_m.total_cmp(&b.distance_m))
    }
}
