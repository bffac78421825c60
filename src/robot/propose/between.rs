//! The exact place of a grasp frame between two fingers that were found: turned, centred and deep
//! enough.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::seat;
use crate::Gripper;
use crate::description::RobotModel;
use crate::gripper::pushes;

/// Opening at which a single moving finger is centred. Unit: metres. The width of a can.
pub(super) const CENTRED_AT_M: f64 = 0.06;
/// Diameters of an object that a jaw and a fixed one push equally: the first for which the palm
/// leaves room. Unit: metres.
const EQUAL_AT_M: [f64; 3] = [CENTRED_AT_M, 0.045, 0.03];
/// Frames that are turned by less are good enough. Unit: radians.
const EQUAL_RAD: f64 = 0.25;
/// How often a frame is turned at most: each turn moves the places at which the jaws touch the
/// object.
const MOST_TURNS: u32 = 4;
/// Largest angle between the fingers and the direction from the palm to the frame. Unit: radians.
/// Beyond it, the object is between the jaw and the palm rather than between two jaws.
const ASIDE_RAD: f64 = 0.6;
/// How much of its widest opening a gripper must keep where its frame is moved to.
const LEAST_SHARE: f64 = 0.8;

/// Two fingers of a hand. Frames are in the frame of the palm.
pub(super) struct Between<'a> {
    pub(super) model: &'a RobotModel,
    pub(super) palm: usize,
    pub(super) links: [usize; 2],
    /// The joints that drive them.
    pub(super) named: &'a [usize],
}

impl Between<'_> {
    /// The gripper with this grasp frame.
    pub(super) fn gripper(&self, frame: Isometry3<f64>) -> Option<Gripper> {
        Gripper::find(self.named, self.model, self.links, (self.palm, frame)).ok()
    }

    /// A frame between a jaw and a fixed one, turned until both push an object equally, if it is
    /// far from that. A frame that is found from both ends of the jaw's way points half of that way
    /// aside.
    pub(super) fn turned(&self, frame: Isometry3<f64>) -> Isometry3<f64> {
        let off_rad = |frame: Isometry3<f64>, diameter_m: f64| -> Option<f64> {
            let gripper = self.gripper(frame)?;
            let [left, right] = pushes(
                self.model,
                &gripper,
                self.links,
                (self.palm, frame),
                diameter_m,
            )?;
            Some(libm::atan2(left.x - right.x, right.y - left.y))
        };
        let aside_rad = |frame: &Isometry3<f64>| {
            (frame.rotation * Vector3::x()).angle(&frame.translation.vector)
        };
        let fits = |diameter_m: &f64| off_rad(frame, *diameter_m).is_some();
        let Some(diameter_m) = EQUAL_AT_M.into_iter().find(fits) else {
            return frame;
        };
        let mut turned = frame;
        for _ in 0..MOST_TURNS {
            match off_rad(turned, diameter_m) {
                Some(off_rad) if off_rad.abs() >= EQUAL_RAD => {
                    turned *= UnitQuaternion::from_axis_angle(&Vector3::z_axis(), off_rad);
                }
                Some(_) if aside_rad(&turned) < aside_rad(&frame).max(ASIDE_RAD) => return turned,
                _ => return frame,
            }
        }
        frame
    }

    /// The frame in the middle between the fingers at the width of a can.
    pub(super) fn centred(&self, frame: Isometry3<f64>) -> Isometry3<f64> {
        let Some(now) = self.gripper(frame) else {
            return frame;
        };
        let middle_m = now.middle_m(CENTRED_AT_M.min(now.widest_m()));
        let moved = frame * Translation3::new(0.0, middle_m, 0.0);
        if self.is_wide(moved, &now) {
            moved
        } else {
            frame
        }
    }

    /// A frame deeper between fingers that would squeeze a can out. Returns `None` if they hold it.
    pub(super) fn seated(&self, frame: Isometry3<f64>) -> Option<Isometry3<f64>> {
        let now = self.gripper(frame)?;
        let deeper = |depth_m: f64| frame * Translation3::new(-depth_m, 0.0, 0.0);
        let at = |depth_m: f64| self.gripper(deeper(depth_m));
        let depth_m = seat::deeper_m(self.model, self.links, (self.palm, frame), at);
        let moved = deeper(depth_m);
        (depth_m > 0.0 && self.is_wide(moved, &now)).then_some(moved)
    }

    /// Whether the gripper opens nearly as wide at another frame.
    fn is_wide(&self, moved: Isometry3<f64>, now: &Gripper) -> bool {
        self.gripper(moved)
            .is_some_and(|gripper| gripper.widest_m() > LEAST_SHARE * now.widest_m())
    }
}
