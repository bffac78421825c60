//! The shapes around a hull that it remembers from one step to the next.
//!
//! Between the fingers of a hand of many pieces and an object there are dozens of pairs of hulls.
//! Most of them are millimetres apart, and their contacts would be dropped (`link_pairs.rs`): they
//! are not searched again until they may have moved by as much as they were apart. A search begins
//! with the corners at which the last one ended, and takes one or two steps in place of ten.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use nalgebra::Vector3;
use parry3d::math::{Pose, Real};
use parry3d::shape::Shape;

/// Contacts nearer than this are kept at any speed: a body at rest can't move farther in a step.
/// Unit: metres.
pub const SURE_M: Real = 1.5e-3;
/// Steps of the present speed for which a pair has to stay apart: it may become faster.
const STEPS_AHEAD: Real = 3.0;
/// Error of the way between two poses in 32 bits. Unit: metres.
const ROUNDING_M: Real = 1e-6;

/// Corners of two solids that are nearest to each other, each in the frame of its solid. Unit:
/// metres.
pub type Corners = Vec<[Vector3<f64>; 2]>;

/// The shapes around a hull, by their addresses.
#[derive(Default)]
pub struct Neighbours(Mutex<BTreeMap<usize, Neighbour>>);

/// A pair of shapes. Poses are those of the second in the frame of the first.
struct Neighbour {
    searched: Pose,
    /// The least distance that they had then. Unit: metres.
    gap: Real,
    last: Pose,
    corners: Corners,
}

impl Neighbours {
    /// Forgets a shape: another one may have its address now.
    pub fn forget(&self, other: &dyn Shape) {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .remove(&address(other));
    }

    /// Returns whether the contacts of a pair, with the second shape at this pose, would be
    /// dropped. If not, returns the corners with which its search begins. `other`: the shape around
    /// this hull, the first or the second of the pair.
    pub fn look(&self, other: &dyn Shape, second: &dyn Shape, pose: &Pose) -> Result<(), Corners> {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(known) = known.get_mut(&address(other)) else {
            return Err(Corners::new());
        };
        let step = way(second, &known.last, pose);
        known.last = *pose;
        let left = known.gap - way(second, &known.searched, pose) - ROUNDING_M;
        if left > SURE_M + STEPS_AHEAD * step {
            Ok(())
        } else {
            Err(std::mem::take(&mut known.corners))
        }
    }

    /// Remembers the result of a search: the pair is at least this far apart. Unit: metres.
    pub fn note(&self, other: &dyn Shape, pose: &Pose, gap: Real, corners: Corners) {
        let found = Neighbour {
            searched: *pose,
            gap,
            last: *pose,
            corners,
        };
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .insert(address(other), found);
    }
}

fn address(shape: &dyn Shape) -> usize {
    std::ptr::from_ref(shape).cast::<()>().addr()
}

/// Returns the longest way that any point of a shape moves between two poses, or more. Unit:
/// metres.
fn way(shape: &dyn Shape, from: &Pose, to: &Pose) -> Real {
    if from == to {
        return 0.0;
    }
    let ball = shape.compute_local_bounding_sphere();
    let shift = (to.transform_point(ball.center) - from.transform_point(ball.center)).length();
    let turn = (from.rotation.inverse() * to.rotation).xyz().length();
    shift + 2.0 * turn * ball.radius
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::Choices;
    use parry3d::math::{Rotation, Vector};
    use parry3d::shape::Cuboid;

    #[test]
    fn no_corner_moves_farther_than_said() {
        let mut choices = Choices::random(11, 0);
        let shape = Cuboid::new(Vector::new(0.02, 0.05, 0.01));
        let mut close = 0;
        for trial in 0..500 {
            let mut number =
                |most: f64| crate::convert::to_real(choices.real("at".into(), -most, most, 0.0));
            let mut pose = |most: f64| {
                let turn = Rotation::from_scaled_axis(Vector::new(
                    number(most),
                    number(most),
                    number(most),
                ));
                Pose::from_parts(Vector::new(number(0.01), number(0.01), number(0.01)), turn)
            };
            let from = pose(3.0);
            let to = from * pose(if trial % 2 == 0 { 0.1 } else { 3.0 });
            let corner = Vector::new(0.02, 0.05, if trial % 3 == 0 { 0.01 } else { -0.01 });
            let moved = (to.transform_point(corner) - from.transform_point(corner)).length();
            let said = way(&shape, &from, &to);
            assert!(
                moved <= said + ROUNDING_M,
                "trial {trial}: {moved} m instead of {said} m"
            );
            close += usize::from(moved > 0.6 * said);
        }
        assert!(close > 100, "{close} of 500 are close");
    }

    #[test]
    fn pairs_are_searched_again_once_they_may_be_near() {
        let shape = Cuboid::new(Vector::splat(0.01));
        let neighbours = Neighbours::default();
        let at = |z: f64| Pose::from_translation(Vector::new(0.0, 0.0, crate::convert::to_real(z)));
        let seed = vec![[Vector3::x(), Vector3::y()]];
        assert_eq!(
            neighbours.look(&shape, &shape, &at(0.0)),
            Err(Vec::new()),
            "an unknown pair"
        );
        neighbours.note(&shape, &at(0.0), 0.004, seed.clone());
        assert_eq!(neighbours.look(&shape, &shape, &at(0.0005)), Ok(()));
        assert_eq!(neighbours.look(&shape, &shape, &at(0.0008)), Ok(()));
        assert_eq!(
            neighbours.look(&shape, &shape, &at(0.0026)),
            Err(seed),
            "it is 1.4 mm away, or less"
        );
        neighbours.note(&shape, &at(0.0), 0.004, Vec::new());
        assert_eq!(
            neighbours.look(&shape, &shape, &at(0.001)),
            Err(Vec::new()),
            "it moves fast"
        );
        neighbours.forget(&shape);
        assert_eq!(neighbours.look(&shape, &shape, &at(0.0)), Err(Vec::new()));
    }
}
