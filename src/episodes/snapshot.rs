//! The snapshot of a state, as the rules see it.

use std::collections::{BTreeMap, BTreeSet};

use actcheck_data::{BodyState, JointState, LinkState, Part, Pose, RobotState, Snapshot};
use nalgebra::Point3;

use crate::cast::{Owner, Thing};
use crate::forms::{parts_of, parts_of_thing};
use crate::solids::{Solids, bounds};
use crate::{Cast, Episode, State};

/// Contact forces below this are solver noise. Unit: newtons. As in our own simulation.
pub(crate) const CONTACT_FLOOR_NEWTONS: f64 = 0.05;
/// Share of a body's weight that a contact must carry for the body to rest on it. As in our own
/// simulation.
const CARRIED_SHARE: f64 = 0.1;
/// Unit: m/s².
const GRAVITY: f64 = 9.81;
/// A thing that fell this far below everything that is fixed has left the world. Unit: metres.
const FALL_M: f64 = 0.5;

/// An episode with the shapes that its snapshots need.
pub(crate) struct Watched<'a> {
    pub(crate) episode: &'a Episode,
    pub(crate) cast: &'a Cast,
    /// The parts of each thing. Frame: the thing's.
    pub(crate) parts: Vec<Vec<Part>>,
    /// The same as solids.
    pub(crate) solids: Vec<Solids>,
    /// The solids of each link, by the index of its body.
    pub(crate) links: BTreeMap<usize, Solids>,
    /// Size of each thing in its own frame. Unit: metres.
    sizes: Vec<[f64; 3]>,
    /// Height below which things have left the world. Unit: metres.
    lowest_m: f64,
}

/// The contact of two owners at one moment.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Touch {
    /// Sum of the magnitudes of the normal forces. Unit: newtons.
    pub(crate) normal_n: f64,
    /// Penetration depth. Unit: metres.
    pub(crate) depth_m: f64,
    /// Upward force on the second. Unit: newtons.
    pub(crate) lift_on_second_n: f64,
    /// Position of the point with the largest normal force. Unit: metres. Frame: world.
    pub(crate) point_m: [f64; 3],
    strongest_n: f64,
}

impl<'a> Watched<'a> {
    pub(crate) fn new(episode: &'a Episode, cast: &'a Cast) -> Self {
        let parts: Vec<Vec<Part>> = (0..cast.things.len())
            .map(|thing| parts_of_thing(episode, cast, thing))
            .collect();
        let sizes = parts.iter().map(|parts| {
            bounds(parts, &nalgebra::Isometry3::identity()).map_or([0.0; 3], |[low, high]| {
                std::array::from_fn(|axis| high[axis] - low[axis])
            })
        });
        let links = cast
            .links
            .iter()
            .map(|body| (*body, Solids::new(&parts_of(&episode.model, *body))))
            .collect();
        let sizes = sizes.collect();
        let mut watched = Self {
            solids: parts.iter().map(|parts| Solids::new(parts)).collect(),
            episode,
            cast,
            parts,
            links,
            sizes,
            lowest_m: 0.0,
        };
        watched.lowest_m = watched.lowest_fixed() - FALL_M;
        watched
    }

    /// Height of the lowest fixed thing, at most 0. Unit: metres.
    fn lowest_fixed(&self) -> f64 {
        let Some(first) = self.episode.states.first() else {
            return 0.0;
        };
        let fixed = self.cast.things.iter().zip(&self.parts);
        fixed
            .filter(|(thing, _)| thing.fixed)
            .filter_map(|(thing, parts)| bounds(parts, &thing.pose(&first.poses)))
            .map(|[low, _]| low[2])
            .fold(0.0, f64::min)
    }

    /// Returns the contacts of a state by ordered pair of owners. Contacts within a thing are left
    /// out.
    pub(crate) fn touches(&self, state: &State) -> BTreeMap<(Owner, Owner), Touch> {
        let mut touches: BTreeMap<(Owner, Owner), Touch> = BTreeMap::new();
        for contact in &state.contacts {
            let owners = contact
                .bodies
                .map(|body| self.cast.owners.get(body).copied().unwrap_or(Owner::Floor));
            let (pair, lift) = if owners[0] <= owners[1] {
                ((owners[0], owners[1]), contact.force_n[2])
            } else {
                ((owners[1], owners[0]), -contact.force_n[2])
            };
            if pair.0 == pair.1 {
                continue;
            }
            let touch = touches.entry(pair).or_default();
            touch.normal_n += contact.normal_n;
            touch.lift_on_second_n += lift;
            touch.depth_m = touch.depth_m.max(-contact.distance_m);
            if contact.normal_n >= touch.strongest_n {
                touch.strongest_n = contact.normal_n;
                touch.point_m = contact.point_m;
            }
        }
        let has_forces = !self.episode.lacks.has(crate::Quantity::ContactForces);
        touches.retain(|_, touch| {
            if has_forces {
                touch.normal_n >= CONTACT_FLOOR_NEWTONS
            } else {
                touch.depth_m >= 0.0
            }
        });
        touches
    }

    /// Returns the pose of the point between the fingertips; that of the base without a hand.
    pub(crate) fn hand(&self, state: &State) -> Pose {
        let pose_of = |body: usize| state.poses.get(body).copied().unwrap_or(Pose::IDENTITY);
        match (&self.cast.hand, self.cast.base) {
            (Some(hand), _) => {
                let at = pose_of(hand.body).to_isometry() * hand.at.to_isometry();
                Pose::from_isometry(&at)
            }
            (None, Some(base)) => pose_of(base),
            (None, None) => Pose::IDENTITY,
        }
    }

    /// Returns the gap between the fingers. Unit: metres.
    pub(crate) fn opening(&self, state: &State) -> f64 {
        self.cast.hand.as_ref().map_or(0.0, |hand| {
            hand.opening
                .iter()
                .filter_map(|joint| state.positions.get(*joint))
                .map(|position| position.abs())
                .sum()
        })
    }

    /// Returns position and heading of the base. Units: metres, radians.
    pub(crate) fn base(&self, state: &State) -> [f64; 3] {
        let Some(pose) = self.cast.base.and_then(|base| state.poses.get(base)) else {
            return [0.0; 3];
        };
        [pose.position[0], pose.position[1], pose.yaw()]
    }

    /// Returns the things that both fingers touch.
    pub(crate) fn held(&self, touches: &BTreeMap<(Owner, Owner), Touch>) -> BTreeSet<usize> {
        let [left, right] = self.touched_by_fingers(touches);
        left.intersection(&right).copied().collect()
    }

    /// Returns the things that each finger touches, left and right.
    fn touched_by_fingers(
        &self,
        touches: &BTreeMap<(Owner, Owner), Touch>,
    ) -> [BTreeSet<usize>; 2] {
        let Some(hand) = &self.cast.hand else {
            return [BTreeSet::new(), BTreeSet::new()];
        };
        [0, 1].map(|side: usize| {
            touches
                .keys()
                .filter_map(|pair| match pair {
                    (Owner::Thing(thing), Owner::Link(link))
                        if hand.fingers[side].contains(link) =>
                    {
                        Some(*thing)
                    }
                    _ => None,
                })
                .collect()
        })
    }

    /// Returns the snapshot of a state.
    pub(crate) fn snapshot(&self, state: &State) -> Snapshot {
        let touches = self.touches(state);
        let hand = self.hand(state);
        Snapshot {
            time_secs: state.time_secs,
            bodies: (0..self.cast.things.len())
                .map(|thing| self.body(thing, state, &touches, &hand))
                .collect(),
            robot: self.robot(state, &touches, hand),
        }
    }

    /// Velocities of a thing's origin. Units: m/s, rad/s.
    pub(crate) fn velocities(&self, thing: &Thing, state: &State) -> [[f64; 3]; 2] {
        let fixed = thing.fixed.then_some([[0.0; 3]; 2]);
        fixed
            .or_else(|| state.velocities.get(thing.root).copied())
            .unwrap_or([[0.0; 3]; 2])
    }

    fn body(
        &self,
        idx: usize,
        state: &State,
        touches: &BTreeMap<(Owner, Owner), Touch>,
        hand: &Pose,
    ) -> BodyState {
        let thing = &self.cast.things[idx];
        let model = &self.episode.model;
        let pose = thing.pose(&state.poses);
        let mass_kg: f64 = thing
            .bodies
            .iter()
            .filter_map(|body| model.bodies[*body].mass_kg)
            .sum();
        let (mut touching, mut carriers) = (BTreeSet::new(), BTreeSet::new());
        for ((first, second), touch) in touches {
            let (other, lift) = match (first, second) {
                (other, Owner::Thing(own)) if *own == idx => (*other, touch.lift_on_second_n),
                (Owner::Thing(own), other) if *own == idx => (*other, -touch.lift_on_second_n),
                _ => continue,
            };
            let name = match other {
                Owner::Link(_) => "robot".to_owned(),
                other => self.cast.name(other, model),
            };
            if lift > CARRIED_SHARE * mass_kg * GRAVITY {
                carriers.insert(name.clone());
            }
            touching.insert(name);
        }
        let part = thing.part.and_then(|part| {
            let whole = &self.cast.things[part.of].id;
            Some((whole.clone(), *state.positions.get(part.joint)?))
        });
        if let Some((whole, _)) = &part {
            carriers.insert(whole.clone());
        }
        let [low, high] =
            bounds(&self.parts[idx], &pose).unwrap_or_else(|| [pose.translation.vector.into(); 2]);
        let [linear_velocity, angular_velocity] = self.velocities(thing, state);
        let hand_in_thing = pose.inverse_transform_point(&Point3::from(hand.position));
        let grasp_distance_m = (!thing.fixed && !self.solids[idx].is_empty())
            .then(|| self.solids[idx].distance_to(&hand_in_thing));
        BodyState {
            id: thing.id.clone(),
            model: model.bodies[thing.root].name.clone(),
            category: thing.category.clone(),
            fixed: thing.fixed,
            pose: Pose::from_isometry(&pose),
            linear_velocity,
            angular_velocity,
            aabb_min: low,
            aabb_max: high,
            mass_kg,
            friction: self.friction(thing),
            restitution: 0.0,
            touches: touching.into_iter().collect(),
            rests_on: carriers.into_iter().collect(),
            asleep: false,
            size_m: self.sizes[idx],
            grasp_distance_m,
            part,
            left_world: !thing.fixed && high[2] < self.lowest_m,
        }
    }

    /// Largest friction coefficient of a thing's shapes.
    fn friction(&self, thing: &Thing) -> f64 {
        let model = &self.episode.model;
        thing
            .bodies
            .iter()
            .flat_map(|body| &model.bodies[*body].shapes)
            .filter(|shape| shape.collides)
            .filter_map(|shape| shape.friction)
            .fold(0.0, f64::max)
    }

    fn robot(
        &self,
        state: &State,
        touches: &BTreeMap<(Owner, Owner), Touch>,
        gripper: Pose,
    ) -> RobotState {
        let [left, right] = self.touched_by_fingers(touches).map(|things| {
            let mut names: Vec<String> = things
                .into_iter()
                .map(|thing| self.cast.things[thing].id.clone())
                .collect();
            names.sort();
            names
        });
        let base = self.base(state);
        RobotState {
            base_true: base,
            base_believed: base,
            joints: self.joints(state),
            gripper,
            gripper_opening_m: self.opening(state),
            left_touches: left,
            right_touches: right,
            links: self
                .cast
                .links
                .iter()
                .filter_map(|body| {
                    Some(LinkState {
                        name: self.episode.model.bodies[*body].name.clone(),
                        pose: *state.poses.get(*body)?,
                    })
                })
                .collect(),
            cup: None,
        }
    }

    fn joints(&self, state: &State) -> Vec<JointState> {
        self.robot_joints()
            .filter_map(|(idx, joint)| {
                let [lower, upper] = joint.limits.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
                Some(JointState {
                    name: joint.name.clone(),
                    position: *state.positions.get(idx)?,
                    velocity: state.speeds.get(idx).copied().unwrap_or_default(),
                    lower,
                    upper,
                    max_velocity: joint.max_velocity.unwrap_or(f64::INFINITY),
                    max_effort: joint.max_effort.unwrap_or(f64::INFINITY),
                })
            })
            .collect()
    }

    /// Returns the scalar joints of the robot with their indices among all scalar joints.
    pub(crate) fn robot_joints(&self) -> impl Iterator<Item = (usize, &crate::Joint)> {
        let scalar = self
            .episode
            .model
            .joints
            .iter()
            .filter(|joint| joint.is_scalar());
        scalar
            .enumerate()
            .filter(|(_, joint)| self.cast.links.binary_search(&joint.body).is_ok())
    }

    /// Returns the rotation of a thing's frame relative to that of another pose.
    pub(crate) fn tilt(&self, thing: &Thing, state: &State) -> f64 {
        Pose::from_isometry(&thing.pose(&state.poses)).tilt()
    }
}
