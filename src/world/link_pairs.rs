//! The pairs of the robot's links that collide with each other in the simulation, and of parts of
//! objects.

use std::collections::{BTreeMap, BTreeSet};

use rapier3d::dynamics::IntegrationParameters;
use rapier3d::pipeline::{ContactModificationContext, ModifiableContacts};
use rapier3d::prelude::{
    Group, InteractionGroups, InteractionTestMode, PairFilterContext, PhysicsHooks, Real,
    SolverFlags,
};

use crate::bodies::Bodies;
use crate::distances::{TOUCH_M, depth_of, gap_of_links};
use crate::object::Object;
use crate::physics::{FLOOR_GROUP, LENGTH_UNIT, Owner};
use actcheck_geometry::SURE_M;
use actcheck_geometry::{from_vector, to_real};
use parry3d::math::Vector;

/// Number of collision groups for links.
const LINK_GROUPS: u32 = 30;
/// Factor on the present speed, which motors change within the step.
const OVERSHOOT: Real = 2.0;
/// A collision group without links: objects are in all groups, and links collide with this one.
const OTHERS: Group = Group::GROUP_31;

/// Pairs of links, each with the smaller index first. All other links pass through each other:
/// neighbours, whose shapes overlap at their joint, the links of a gripper's mechanism, and links
/// that overlap or touch in the initial posture, which is known to be valid.
#[derive(Debug, Default)]
pub(super) struct LinkPairs {
    pairs: BTreeSet<(usize, usize)>,
    /// Whether these links pass through each other too, because of a fault that is injected on
    /// purpose.
    pass: bool,
    /// The whole that each part of an object belongs to, by their indices: nothing collides within
    /// a whole.
    wholes: BTreeMap<usize, usize>,
    /// Duration of a step. Unit: seconds.
    step_secs: Real,
}

impl LinkPairs {
    /// Returns the pairs of links that are apart now and are not neighbours in the tree, and the
    /// wholes of all parts.
    pub(super) fn of(bodies: &Bodies) -> Self {
        let links = &bodies.robot.model.links;
        let solid: Vec<usize> = (0..links.len())
            .filter(|idx| !links[*idx].solids.is_empty())
            .collect();
        let neighbours: BTreeSet<(usize, usize)> = solid
            .iter()
            .filter_map(|idx| {
                bodies
                    .robot
                    .kinematics
                    .solid_parent(*idx)
                    .map(|parent| (parent, *idx))
            })
            .collect();
        let pairs = solid.iter().flat_map(|first| {
            solid
                .iter()
                .filter(move |second| *second > first)
                .map(move |second| (*first, *second))
        });
        let passes = |pair: &(usize, usize)| {
            neighbours.contains(pair) || bodies.robot.kinematics.pass(pair.0, pair.1)
        };
        let apart = |pair: &(usize, usize)| !passes(pair) && !meet(bodies, pair.0, pair.1);
        let parts = bodies.objects.iter().enumerate();
        let wholes = parts.filter_map(|(idx, object)| Some((idx, object.attached.as_ref()?.whole)));
        Self {
            pairs: pairs.filter(apart).collect(),
            pass: false,
            wholes: wholes.collect(),
            step_secs: bodies.physics.integration_parameters.dt,
        }
    }

    /// Puts links that pass through each other into collision groups that do, as far as there are
    /// groups. The engine then never looks at their pairs, of which a gripper with many pieces has
    /// thousands.
    pub(super) fn group_links(&self, bodies: &mut Bodies) {
        let numbers = self.groups(bodies.robot.bodies.len());
        let group = |link: usize| Group::from_bits_retain(1 << numbers[link]);
        let mut partners = vec![OTHERS; numbers.len()];
        for (first, second) in self.iter() {
            partners[first] |= group(second);
            partners[second] |= group(first);
        }
        for (link, body) in bodies.robot.bodies.iter().enumerate() {
            let Some(body) = bodies.physics.bodies.get(*body) else {
                continue;
            };
            for handle in body.colliders() {
                let Some(collider) = bodies.physics.colliders.get_mut(*handle) else {
                    continue;
                };
                let floor = collider.collision_groups().filter & FLOOR_GROUP;
                let groups = InteractionGroups::new(
                    group(link),
                    partners[link] | floor,
                    InteractionTestMode::And,
                );
                collider.set_collision_groups(groups);
            }
        }
    }

    /// Lets all links pass through each other, or collide again.
    pub(super) fn let_pass(&mut self, pass: bool) {
        self.pass = pass;
    }

    /// Returns whether all links pass through each other.
    pub(super) fn all_pass(&self) -> bool {
        self.pass
    }

    /// Returns the whole that an object belongs to: itself, if it is not a part. By their indices.
    pub(super) fn whole_of(&self, object: usize) -> usize {
        self.wholes.get(&object).copied().unwrap_or(object)
    }

    /// Returns the pairs in order.
    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, usize)> {
        self.pairs.iter().copied()
    }

    /// Returns the number of the collision group of each link: links that collide with the same
    /// ones share it. The last group has all links for which there are too few groups.
    fn groups(&self, links: usize) -> Vec<u32> {
        let mut partners = vec![BTreeSet::new(); links];
        for (first, second) in self.iter() {
            partners[first].insert(second);
            partners[second].insert(first);
        }
        let mut numbers = BTreeMap::new();
        let number = |partners| {
            let next = u32::try_from(numbers.len())
                .unwrap_or(u32::MAX)
                .min(LINK_GROUPS - 1);
            *numbers.entry(partners).or_insert(next)
        };
        partners.into_iter().map(number).collect()
    }
}

impl PhysicsHooks for LinkPairs {
    fn filter_contact_pair(&self, context: &PairFilterContext<'_>) -> Option<SolverFlags> {
        let owner = |handle| {
            context
                .colliders
                .get(handle)
                .map(|collider| Owner::from_tag(collider.user_data))
        };
        let collide = match (owner(context.collider1), owner(context.collider2)) {
            (Some(Owner::Link(a)), Some(Owner::Link(b))) => {
                !self.pass && self.pairs.contains(&(a.min(b), a.max(b)))
            }
            (Some(Owner::Object(a)), Some(Owner::Object(b))) => {
                self.whole_of(a) != self.whole_of(b)
            }
            _ => true,
        };
        collide.then_some(SolverFlags::COMPUTE_RIGID_IMPULSES)
    }

    /// Drops the contacts of links that can't close in this step: the engine prepares all within
    /// some millimetres, and fingers of many pieces have dozens that never close.
    fn modify_solver_contacts(&self, context: &mut ContactModificationContext<'_>) {
        let bodies = [context.rigid_body1, context.rigid_body2]
            .map(|handle| handle.and_then(|it| context.bodies.get(it)));
        let ModifiableContacts::Rigid(found) = &mut context.contacts else {
            return;
        };
        let normal = *found.normal;
        let closes = |points: [Vector; 2]| {
            let [first, second] = [0, 1].map(|side| {
                bodies[side].map_or(Vector::ZERO, |body| body.velocity_at_point(points[side]))
            });
            (first - second).dot(normal).max(0.0)
        };
        found.solver_contacts.retain(|contact| {
            let speed = closes([contact.anchor1, contact.anchor2]);
            contact.dist < SURE_M + OVERSHOOT * self.step_secs * speed
        });
    }
}

/// Distance below which contacts are prepared in a world whose robot has links of many pieces. The
/// default of 2 cm would prepare hundreds of contacts between its fingers. Unit: metres.
pub(super) const PREDICTION_M: f64 = 0.006;
/// In a tick that begins with a faster object or link, contacts are prepared at the engine's own
/// distance: it would enter others before its contact is found. Unit: m/s.
const FAST_M_S: f64 = 1.0;

/// Sets the distance below which the engine prepares contacts in this tick.
pub(super) fn prepare_contacts(bodies: &mut Bodies) {
    if !bodies.robot.model.has_many_pieces() {
        return;
    }
    let is_fast = |object: &Object| {
        bodies
            .speed_of(object)
            .is_some_and(|speed| speed > FAST_M_S)
    };
    let links = bodies
        .robot
        .bodies
        .iter()
        .filter_map(|body| bodies.physics.bodies.get(*body));
    let is_link_fast = links
        .map(|body| from_vector(body.linvel()).norm())
        .any(|speed| speed > FAST_M_S);
    let distance = match is_link_fast || bodies.objects.iter().any(is_fast) {
        true => IntegrationParameters::default().normalized_prediction_distance / LENGTH_UNIT,
        false => to_real(PREDICTION_M) / LENGTH_UNIT,
    };
    bodies
        .physics
        .integration_parameters
        .normalized_prediction_distance = distance;
}

/// Returns whether two links overlap now, or touch each other and are not both of the hand,
/// whose fingers may be closed. With links that touch from the beginning, no tick would be
/// free.
fn meet(bodies: &Bodies, first: usize, second: usize) -> bool {
    let in_hand = bodies.robot.kinematics.are_of_hand(first, second);
    depth_of(bodies, first, second) > TOUCH_M
        || !in_hand && gap_of_links(bodies, first, second) <= TOUCH_M
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gripper_tests::{hand, turning};
    use crate::robot::tests::alone;
    use crate::simulation::tests::bodies;
    use actcheck_base::Source;

    /// The hand is 60 cm above the robot's root: on a block that reaches up to its fingers, or 1 mm
    /// below them.
    #[test]
    fn links_that_touch_in_the_initial_posture_pass_through_each_other() {
        for (gap_m, collide) in [(0.0, false), (0.001, true)] {
            let mut profile = hand(&turning(0.0, 0.6), &turning(-0.6, 0.0), &["left", "right"]);
            let top_m = 0.6 - 0.015 - gap_m;
            let block = format!(
                "<link name=\"base\"><collision><origin xyz=\"0 0 {}\"/><geometry><box size=\"0.5 0.5 {top_m}\"/>\
                 </geometry></collision></link>",
                top_m / 2.0
            );
            let palm = "<link name=\"palm\"><collision><geometry><sphere radius=\"0.01\"/></geometry></collision>";
            let text = profile
                .core
                .urdf
                .text
                .replace("<link name=\"base\"/>", &block)
                .replace("<link name=\"palm\">", palm);
            let urdf = Source::new("hand.urdf", text);
            profile.core =
                actcheck_config::robot::with_urdf(profile.core, urdf).expect("it is a URDF");
            let mut world = alone(profile);
            let links = bodies(&world).robot.model.links.iter();
            let names: Vec<&str> = links.map(|link| link.name.as_str()).collect();
            let collides = |one: &str, other: &str| {
                let mut pairs = world
                    .engine()
                    .link_pairs()
                    .iter()
                    .map(|(one, other)| [names[one], names[other]]);
                pairs.any(|pair| pair == [one, other] || pair == [other, one])
            };
            assert!(
                ["left_finger", "right_finger"]
                    .iter()
                    .all(|finger| collides("base", finger) == collide),
                "{gap_m}"
            );
            assert!(
                collides("left_finger", "right_finger"),
                "fingers do not pass through each other"
            );
            let hold = world.hold();
            (0..30).for_each(|_| world.step(&hold));
            assert!(
                world.proximity().moved_freely(),
                "{gap_m}: {:?}",
                world.proximity().ticks_by_reach()
            );
        }
    }

    #[test]
    fn links_with_the_same_partners_share_a_group_and_no_others_do() {
        let pairs = |pairs: &[(usize, usize)]| LinkPairs {
            pairs: pairs.iter().copied().collect(),
            ..LinkPairs::default()
        };
        assert_eq!(pairs(&[(0, 2), (1, 2)]).groups(4), [0, 0, 1, 2]);
        let all: Vec<(usize, usize)> = (0..40)
            .flat_map(|first| (first + 1..40).map(move |second| (first, second)))
            .collect();
        let groups = pairs(&all).groups(40);
        assert_eq!(groups[..30], (0..30).collect::<Vec<u32>>());
        assert!(groups[30..].iter().all(|group| *group == 29), "{groups:?}");
    }
}
