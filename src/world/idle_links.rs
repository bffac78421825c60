//! The links that can touch nothing in a tick.
//!
//! Where only the hand can touch something, the engine need not look for contacts of the other
//! links. Of an arm of a hundred pieces, it would move each piece in its tree of boxes in every
//! step. A link that never moves is not idle: an object may fall onto it.

use rapier3d::prelude::RigidBody;

use crate::bodies::Bodies;
use crate::reach::Reach;

/// Takes the shapes of idle links out of the engine's search for contacts, and puts back those
/// of the others, in a tick in which the robot can touch this.
pub(super) fn leave_out_idle(bodies: &mut Bodies, reach: Reach) {
    if !bodies.robot.model.has_many_pieces() {
        return;
    }
    for (link, body) in bodies.robot.bodies.iter().enumerate() {
        let is_idle = is_idle(bodies, link, reach);
        for handle in bodies
            .physics
            .bodies
            .get(*body)
            .map(RigidBody::colliders)
            .unwrap_or_default()
        {
            // Asking for a change would already be one.
            if bodies
                .physics
                .colliders
                .get(*handle)
                .is_some_and(|collider| collider.is_enabled() == is_idle)
                && let Some(collider) = bodies.physics.colliders.get_mut(*handle)
            {
                collider.set_enabled(!is_idle);
            }
        }
    }
}

fn is_idle(bodies: &Bodies, link: usize, reach: Reach) -> bool {
    let of_hand = bodies
        .robot
        .hand
        .as_ref()
        .is_some_and(|hand| hand.has(link));
    let can_touch = reach == Reach::All || reach == Reach::Hand && of_hand;
    !can_touch && bodies.robot.joints_to(link).next().is_some()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use rapier3d::prelude::RigidBodyHandle;

    use super::*;
    use crate::World;
    use crate::robot::tests::{alone, lonely};
    use crate::simulation::tests::{bodies, bodies_mut, step_with};
    use actcheck_geometry::from_pose;

    /// The shipped robot with a forearm of many pieces.
    fn with_pieces() -> World {
        let mut profile = bodies(&lonely()).robot.profile.as_ref().clone();
        let link = "<link name=\"wrist_flex_link\">";
        assert!(profile.core.urdf.text.contains(link));
        let piece =
            "<collision><geometry><box size=\"0.02 0.02 0.02\"/></geometry></collision>".repeat(4);
        let text = profile
            .core
            .urdf
            .text
            .replace(link, &format!("{link}{piece}"));
        let urdf = actcheck_base::Source::new("pieces.urdf", text);
        profile.core = actcheck_config::robot::with_urdf(profile.core, urdf).expect("it is a URDF");
        alone(profile)
    }

    /// Returns the names of the links whose shapes are in the search.
    fn searched(world: &World) -> BTreeSet<String> {
        let is_searched = |body: RigidBodyHandle| {
            let mut colliders = bodies(world).physics.bodies[body].colliders().iter();
            colliders.any(|handle| bodies(world).physics.colliders[*handle].is_enabled())
        };
        let links = bodies(world)
            .robot
            .model
            .links
            .iter()
            .zip(&bodies(world).robot.bodies);
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
            leave_out_idle(bodies_mut(&mut world), reach);
            assert_eq!(searched(&world), *expected, "{reach:?}");
        }
        let mut world = lonely();
        leave_out_idle(bodies_mut(&mut world), Reach::Hand);
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
            leave_out_idle(bodies_mut(&mut world), Reach::Hand);
            (0..30).for_each(|_| step_with(&mut world, &command, reach));
            for body in &bodies(&world).robot.bodies {
                for handle in bodies(&world).physics.bodies[*body].colliders() {
                    let collider = &bodies(&world).physics.colliders[*handle];
                    let on_link = collider.position_wrt_parent().expect("it is on a link");
                    let expected = from_pose(bodies(&world).physics.bodies[*body].position())
                        * from_pose(on_link);
                    let off = from_pose(collider.position()).translation.vector
                        - expected.translation.vector;
                    assert!(off.norm() < 1e-5, "{} m off", off.norm());
                }
            }
        }
    }
}
