//! The pairs of the robot's links that collide with each other in the simulation.

use std::collections::BTreeSet;

use rapier3d::prelude::{PairFilterContext, PhysicsHooks, SolverFlags};

use crate::World;
use crate::engine::Owner;
use crate::robot_course::TOUCH_M;

/// Pairs of links, each with the smaller index first. All other links pass through each other: neighbours, whose shapes
/// overlap at their joint, the links of a gripper's mechanism, and links that overlap in the initial posture, which is
/// known to be valid.
#[derive(Debug, Default)]
pub(super) struct LinkPairs {
    pairs: BTreeSet<(usize, usize)>,
    /// Whether these links pass through each other too, because of a fault that is injected on purpose.
    pub(super) pass: bool,
}

impl LinkPairs {
    /// Returns the pairs in order.
    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, usize)> {
        self.pairs.iter().copied()
    }
}

impl PhysicsHooks for LinkPairs {
    fn filter_contact_pair(&self, context: &PairFilterContext<'_>) -> Option<SolverFlags> {
        let owner = |handle| context.colliders.get(handle).map(|collider| Owner::from_tag(collider.user_data));
        let collide = match (owner(context.collider1), owner(context.collider2)) {
            (Some(Owner::Link(a)), Some(Owner::Link(b))) => !self.pass && self.pairs.contains(&(a.min(b), a.max(b))),
            _ => true,
        };
        collide.then_some(SolverFlags::COMPUTE_RIGID_IMPULSES)
    }
}

impl World {
    /// Returns the pairs of links that are apart now and are not neighbours in the tree.
    pub(super) fn find_link_pairs(&self) -> LinkPairs {
        let links = &self.robot.model.links;
        let solid: Vec<usize> = (0..links.len()).filter(|idx| !links[*idx].solids.is_empty()).collect();
        let neighbours: BTreeSet<(usize, usize)> = solid
            .iter()
            .filter_map(|idx| self.robot.kinematics.solid_parent(*idx).map(|parent| (parent, *idx)))
            .collect();
        let pairs = solid
            .iter()
            .flat_map(|first| solid.iter().filter(move |second| *second > first).map(move |second| (*first, *second)));
        let passes = |pair: &(usize, usize)| neighbours.contains(pair) || self.robot.kinematics.pass(pair.0, pair.1);
        let apart = |pair: &(usize, usize)| !passes(pair) && self.depth_of(pair.0, pair.1) <= TOUCH_M;
        LinkPairs { pairs: pairs.filter(apart).collect(), pass: false }
    }
}
