//! Closed outer surfaces of hollow objects.
//!
//! The wall of a glass consists of staves, so that things can be inside: on a table they touch it
//! at 48 points. While nothing is at its mouth, a closed shell has the same surface, and touches
//! the table at 12 points and two fingers at eight.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use parry3d::bounding_volume::{Aabb, BoundingVolume};
use parry3d::query::contact;
use rapier3d::prelude::{
    Collider, ColliderBuilder, ColliderHandle, PhysicsWorld, Pose, RigidBodyHandle,
};

use crate::physics::SHELL;
use actcheck_data::{Part, Pose as PartPose, Shape};

/// Largest change of a tube's radius for its height. In wider cones the staves differ from their
/// shell.
const STEEPEST: f64 = 0.06;
/// Number of corners of a base plate.
const CORNERS: u32 = 4;
/// Height of the base plates. Unit: metres.
const PLATE_M: f64 = 6e-3;
/// Height of the shell's lower end over that of the wall, so that only the plates touch a table.
/// Unit: metres. More than the distance at which the engine prepares contacts.
const LIFT_M: f64 = 3e-3;
/// Largest distance between the lower ends of a wall and of the foot in it, and between their
/// surfaces. Unit: metres.
const FOOT_M: f64 = 3e-3;
/// Largest penetration into a shell that appears. Unit: metres. Thinner than any wall.
const DEEPEST_M: f32 = 1e-3;

/// A tube with a foot, in an object that can move.
pub(super) struct Hollow {
    /// Pose of the mouth: its centre, and z out of the tube. Frame: the object's.
    mouth: Isometry3<f64>,
    /// Radius of the mouth. Unit: metres.
    pub(super) radius: f64,
    /// The shell and the plates below it.
    closed: Vec<ColliderBuilder>,
    /// The staves and the foot, which the shell contains.
    inside: Vec<ColliderHandle>,
    /// The colliders of the shell and its plates, while they replace those inside.
    shown: Vec<ColliderHandle>,
}

impl Hollow {
    /// Returns whether the shell replaces the parts inside.
    pub(super) fn is_closed(&self) -> bool {
        !self.shown.is_empty()
    }

    /// Returns the pose of the mouth, with the object at a pose: its centre, and z out of the tube.
    pub(super) fn mouth_at(&self, at: &Isometry3<f64>) -> Isometry3<f64> {
        at * self.mouth
    }

    /// Returns whether a solid is in the shell, with the object at a pose.
    pub(super) fn contains(&self, at: &Pose, solid: &Collider) -> bool {
        let its_box: Aabb = solid.compute_aabb();
        self.closed.first().is_some_and(|shell| {
            let pose = *at * shell.position;
            shell.shape.compute_aabb(&pose).intersects(&its_box)
                && contact(
                    &pose,
                    shell.shape.as_ref(),
                    solid.position(),
                    solid.shape(),
                    0.0,
                )
                .ok()
                .flatten()
                .is_some_and(|met| met.dist < -DEEPEST_M)
        })
    }

    /// Replaces the parts inside by the shell, or the shell by them.
    pub(super) fn close(
        &mut self,
        physics: &mut PhysicsWorld,
        body: RigidBodyHandle,
        closed: bool,
    ) {
        for shown in self.shown.drain(..) {
            physics.remove_collider(shown);
        }
        if closed {
            let insert =
                |built: &ColliderBuilder| physics.insert_collider(built.clone(), Some(body));
            self.shown = self.closed.iter().map(insert).collect();
        }
        for handle in &self.inside {
            if let Some(collider) = physics.colliders.get_mut(*handle) {
                collider.set_enabled(!closed);
            }
        }
    }
}

/// Returns the tubes of a model that have a foot and are steep enough. `handles` are the colliders
/// of each part, and `collider` makes the collider of a solid.
pub(super) fn hollows_of(
    parts: &[Part],
    handles: &[Vec<ColliderHandle>],
    collider: impl Fn(&Part) -> Option<ColliderBuilder>,
) -> Vec<Hollow> {
    let of = |(idx, part): (usize, &Part)| {
        let foot = parts.iter().position(|other| is_foot(other, part))?;
        let closed: Option<Vec<_>> = closed(part)?.iter().map(&collider).collect();
        let Shape::Tube {
            radius_high,
            height,
            ..
        } = part.shape
        else {
            return None;
        };
        let stands_in = |built: ColliderBuilder| ColliderBuilder {
            user_data: built.user_data | SHELL,
            ..built
        };
        Some(Hollow {
            mouth: part.pose.to_isometry() * Translation3::new(0.0, 0.0, height / 2.0),
            radius: radius_high,
            closed: closed?
                .into_iter()
                .map(|built| stands_in(built.density(0.0)))
                .collect(),
            inside: handles[idx].iter().chain(&handles[foot]).copied().collect(),
            shown: Vec::new(),
        })
    };
    parts.iter().enumerate().filter_map(of).collect()
}

/// Returns whether a part closes a tube below, and is within it.
fn is_foot(part: &Part, tube: &Part) -> bool {
    let (
        Shape::Cylinder { radius, height },
        Shape::Tube {
            radius_low,
            wall,
            height: wall_height,
            staves,
            ..
        },
    ) = (&part.shape, &tube.shape)
    else {
        return false;
    };
    let there = tube.pose.to_isometry().inverse() * part.pose.to_isometry();
    let is_upright = there.rotation.angle() < 1e-6 && there.translation.vector.xy().norm() < 1e-6;
    let above = there.translation.z - height / 2.0 + wall_height / 2.0;
    let is_within = *radius <= radius_low * libm::cos(std::f64::consts::PI / f64::from(*staves));
    is_upright
        && is_within
        && (-1e-6..FOOT_M).contains(&above)
        && *radius > radius_low - wall - FOOT_M
}

/// Returns the shell of a tube and its base plates, or `None` if it has none. Frame: the model's.
fn closed(tube: &Part) -> Option<Vec<Part>> {
    let Shape::Tube {
        radius_low,
        radius_high,
        height,
        staves,
        ..
    } = tube.shape
    else {
        return None;
    };
    if (radius_high - radius_low).abs() > STEEPEST * height
        || height < 2.0 * PLATE_M
        || staves % CORNERS != 0
    {
        return None;
    }
    let outer = tube.pose.to_isometry();
    let step = std::f64::consts::TAU / f64::from(staves);
    let lowest = radius_low + (radius_high - radius_low) * LIFT_M / height;
    let ring = |radius: f64, z: f64| {
        (0..staves).map(move |idx| {
            let angle = step * (f64::from(idx) + 0.5);
            [radius * libm::cos(angle), radius * libm::sin(angle), z]
        })
    };
    let points = ring(lowest, LIFT_M - height / 2.0)
        .chain(ring(radius_high, height / 2.0))
        .collect();
    let mut parts = vec![Part {
        pose: tube.pose,
        shape: Shape::Hull {
            points,
            volume: 0.0,
        },
    }];
    // The corners of squares are those of the staves.
    let side = radius_low * std::f64::consts::SQRT_2;
    for idx in 0..staves / CORNERS {
        let turn = step * (f64::from(idx) + 0.5) + std::f64::consts::FRAC_PI_4;
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn);
        let at = Isometry3::from_parts(Translation3::new(0.0, 0.0, (PLATE_M - height) / 2.0), turn);
        parts.push(Part {
            pose: PartPose::from_isometry(&(outer * at)),
            shape: Shape::Box {
                size: [side, side, PLATE_M],
            },
        });
    }
    Some(parts)
}
