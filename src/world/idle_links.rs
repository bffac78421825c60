//! The links that can touch nothing in a tick.
//!
//! Where only the hand can touch something, the engine need not look for contacts of the other
//! links. Of an arm of a hundred pieces, it would move each piece in its tree of boxes in every
//! step. A link that never moves is not idle: an object may fall onto it.

use rapier3d::prelude::RigidBody;

use crate::World;
use crate::reach::Reach;

impl World {
    /// Takes the shapes of idle links out of the engine's search for contacts, and puts back those
    /// of the others, in a tick in which the robot can touch this.
    pub(super) fn leave_out_idle(&mut self, reach: Reach) {
        if !self.robot.model.has_many_pieces() {
            return;
        }
        for (link, body) in self.robot.bodies.iter().enumerate() {
            let is_idle = self.is_idle(link, reach);
            for handle in self
                .engine
                .bodies
                .get(*body)
                .map(RigidBody::colliders)
                .unwrap_or_default()
            {
                // Asking for a change would already be one.
                if self
                    .engine
                    .colliders
                    .get(*handle)
                    .is_some_and(|collider| collider.is_enabled() == is_idle)
                    && let Some(collider) = self.engine.colliders.get_mut(*handle)
                {
                    collider.set_enabled(!is_idle);
                }
            }
        }
    }

    fn is_idle(&self, link: usize, reach: Reach) -> bool {
        let of_hand = self.robot.hand.as_ref().is_some_and(|hand| hand.has(link));
        let can_touch = reach == Reach::All || reach == Reach::Hand && of_hand;
        !can_touch && self.robot.joints_to(link).next().is_some()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use rapier3d::prelude::RigidBodyHandle;

    use super::*;
    use crate::robot::tests::{alone, lonely};
    use actcheck_geometry::from_pose;

    /// The shipped robot with a forearm of many pieces.
    fn with_pieces() -> World {
        let profile = lonely().robot.profile.as_ref().clone();
        let link = "<link name=\"wrist_flex_link\">";
        assert!(profile.urdf.text.contains(link));
        let piece =
            "<collision><geometry><box size=\"0.02 0.02 0.02\"/></geometry></collision>".repeat(4);
        let text = profile.urdf.text.replace(link, &format!("{link}{piece}"));
        let urdf = actcheck_base::Source::new("pieces.urdf", text);
        alone(actcheck_config::robot::with_urdf(profile, urdf).expect("it is a URDF"))
    }

    /// Returns the names of the links whose shapes are in the search.
    fn searched(world: &World) -> BTreeSet<String> {
        let is_searched = |body: RigidBodyHandle| {
            let mut colliders = world.engine.bodies[body].colliders().iter();
            colliders.any(|handle| world.engine.colliders[*handle].is_enabled())
        };
        let links = world.robot.model.links.iter().zip(&world.robot.bodies);
        let searched = links.filter(|(_, body)| is_searched(**body));
        searched.map(|(link, _)| link.name.clone()).collect()
    }

    #[test]
    fn only_links_that_can_touch_something_are_in_the_search() {
        let mut world = with_pieces();
        let all = searched(&world);
        assert!(all.contains("wrist_flex_link") && all.contains("base_link"));
        let hand = BTreeSet::from(
            ["finger_left_link", "finger_right_link", "wrist_roll_link"].map(str::to_owned),
        );
        let none = BTreeSet::new();
        for (reach, expected) in [
            (Reach::Hand, &hand),
            (Reach::Apart, &none),
            (Reach::All, &all),
            (Reach::Hand, &hand),
        ] {
            world.leave_out_idle(reach);
            assert_eq!(searched(&world), *expected, "{reach:?}");
        }
        let mut world = lonely();
        world.leave_out_idle(Reach::Hand);
        assert_eq!(searched(&world), all, "few pieces are cheap");
    }

    /// Cameras and measurements of distances need the places of all shapes.
    #[test]
    fn shapes_that_are_left_out_move_with_their_links() {
        let mut world = with_pieces();
        let mut command = world.hold();
        for joint in world.layout().arm.clone() {
            command.positions[joint] += 0.2;
        }
        for reach in [Reach::Hand, Reach::All] {
            world.leave_out_idle(Reach::Hand);
            (0..30).for_each(|_| world.step_with(&command, reach));
            for body in &world.robot.bodies {
                for handle in world.engine.bodies[*body].colliders() {
                    let collider = &world.engine.colliders[*handle];
                    let on_link = collider.position_wrt_parent().expect("it is on a link");
                    let expected =
                        from_pose(world.engine.bodies[*body].position()) * from_pose(on_link);
                    let off = from_pose(collider.position()).translation.vector
                        - expected.translation.vector;
                    assert!(off.norm() < 1e-5, "{} m off", off.norm());
                }
            }
        }
    }
}
