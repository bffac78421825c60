//! Closed outer surfaces of hollow objects.
//!
//! The wall of a glass consists of staves, so that things can be inside: on a table they touch it
//! at 48 points. While nothing is at its mouth, a closed shell has the same surface, and touches
//! the table at 12 points and two fingers at eight.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use parry3d::bounding_volume::{Aabb, BoundingVolume};
use parry3d::query::{contact, distance};
use parry3d::shape::Cylinder;
use rapier3d::prelude::{Collider, ColliderBuilder, ColliderHandle, Pose, RigidBody};

use crate::World;
use crate::engine::SHELL;
use crate::reach::Reach;
use actcheck_data::{Part, Pose as PartPose, Shape};
use actcheck_geometry::{from_pose, from_vector, to_pose, to_real};

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
/// Distance of things at rest from an open mouth. Unit: metres. Longer than the way of a hand in a
/// tick.
const MOUTH_M: f64 = 0.02;
/// Largest penetration into a shell that appears. Unit: metres. Thinner than any wall.
const DEEPEST_M: f32 = 1e-3;

/// A tube with a foot, in an object that can move.
pub(super) struct Hollow {
    /// Pose of the mouth: its centre, and z out of the tube. Frame: the object's.
    mouth: Isometry3<f64>,
    /// Radius of the mouth. Unit: metres.
    radius: f64,
    /// The shell and the plates below it.
    closed: Vec<ColliderBuilder>,
    /// The staves and the foot, which the shell contains.
    inside: Vec<ColliderHandle>,
    /// The colliders of the shell and its plates, while they replace those inside.
    shown: Vec<ColliderHandle>,
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

impl World {
    /// Returns whether all tubes of an object are closed, and there is one: for comparisons.
    pub fn is_closed(&self, id: &str) -> bool {
        let hollows = self
            .objects
            .iter()
            .filter(|object| object.id == id)
            .flat_map(|object| &object.hollows);
        let closed: Vec<bool> = hollows.map(|hollow| !hollow.shown.is_empty()).collect();
        !closed.is_empty() && closed.iter().all(|closed| *closed)
    }

    /// Decides for each hollow object whether it is closed in the next tick.
    pub(super) fn close_hollows(&mut self, reach: Reach) {
        if !self.proximity.shortcuts.shells || reach == Reach::Nothing {
            return;
        }
        for object in 0..self.objects.len() {
            for tube in 0..self.objects[object].hollows.len() {
                let closed = self.can_be_closed(object, tube);
                if closed == self.objects[object].hollows[tube].shown.is_empty() {
                    self.close(object, tube, closed);
                }
            }
        }
    }

    /// Returns whether nothing is at the mouth of a tube, or inside.
    fn can_be_closed(&self, object: usize, tube: usize) -> bool {
        let Some(body) = self.engine.bodies.get(self.objects[object].body) else {
            return false;
        };
        let hollow = &self.objects[object].hollows[tube];
        let (asleep, shown) = (body.is_sleeping(), !hollow.shown.is_empty());
        if asleep && !shown {
            return false;
        }
        let mouth = to_pose(&(from_pose(body.position()) * hollow.mouth));
        // The axis of the engine's cylinders is y.
        let lid = Cylinder::new(to_real(1e-3), to_real(hollow.radius));
        let turned = to_pose(&Isometry3::rotation(
            Vector3::x() * std::f64::consts::FRAC_PI_2,
        ));
        let lid_at = mouth * turned;
        let around = lid.aabb(&lid_at);
        let links = self.robot.bodies.iter().copied();
        let others = self
            .objects
            .iter()
            .enumerate()
            .filter(|(idx, _)| *idx != object)
            .map(|(_, other)| other);
        // Between things at rest, nothing changes.
        let others = others.filter(|other| !asleep || !self.rests(other));
        let bodies = links.chain(others.map(|other| other.body));
        for (body_near, handle) in
            bodies.filter_map(|handle| Some((self.engine.bodies.get(handle)?, handle)))
        {
            let margin = to_real(MOUTH_M + self.way_between(body, body_near));
            // A body with an impossible state is a fault, which is found after the step.
            if !margin.is_finite() {
                return shown;
            }
            let at_mouth = |solid: &Collider| {
                around.loosened(margin).intersects(&solid.compute_aabb())
                    && distance(&lid_at, &lid, solid.position(), solid.shape())
                        .is_ok_and(|gap| gap.distance < margin)
            };
            let is_inside =
                |solid: &Collider| !shown && self.is_in_shell(hollow, body.position(), solid);
            if self
                .colliders_of(handle)
                .any(|solid| at_mouth(solid) || is_inside(solid))
            {
                return false;
            }
        }
        true
    }

    /// Returns how far two bodies can approach each other in a tick. Unit: metres.
    fn way_between(&self, one: &RigidBody, other: &RigidBody) -> f64 {
        let speed = |body: &RigidBody| from_vector(body.linvel());
        (speed(one) - speed(other)).norm() * self.tick_secs()
    }

    /// Returns whether a solid is in the shell of a tube, of which the object is here.
    fn is_in_shell(&self, hollow: &Hollow, at: &Pose, solid: &Collider) -> bool {
        let its_box: Aabb = solid.compute_aabb();
        hollow.closed.first().is_some_and(|shell| {
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

    fn close(&mut self, object: usize, tube: usize, closed: bool) {
        let body = self.objects[object].body;
        let hollow = &mut self.objects[object].hollows[tube];
        for shown in hollow.shown.drain(..) {
            self.engine.remove_collider(shown);
        }
        if closed {
            let insert =
                |built: &ColliderBuilder| self.engine.insert_collider(built.clone(), Some(body));
            hollow.shown = hollow.closed.iter().map(insert).collect();
        }
        for handle in &hollow.inside {
            if let Some(collider) = self.engine.colliders.get_mut(*handle) {
                collider.set_enabled(!closed);
            }
        }
    }
}
