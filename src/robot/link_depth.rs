//! The depth of links in each other at given joint positions.

use nalgebra::Isometry3;
use parry3d::math::Pose as EnginePose;
use parry3d::query::contact;
use parry3d::shape::SharedShape;

use crate::Kinematics;
use actcheck_geometry::{convex_shape, to_pose};

impl Kinematics {
    /// Returns the largest depth of the links that one joint moves in those that another joint
    /// moves; 0 if they are apart. Joints are given by index. Unit: metres.
    pub fn depth_between(&self, positions: &[f64], first: usize, second: usize) -> f64 {
        let poses = self.links(positions);
        let (these, those) = (
            self.shapes_beyond(first, &poses),
            self.shapes_beyond(second, &poses),
        );
        let pairs = these.iter().flat_map(|a| those.iter().map(move |b| (a, b)));
        let depths = pairs.map(|((at_a, a), (at_b, b))| {
            let met = contact(at_a, a.as_ref(), at_b, b.as_ref(), 0.0)
                .ok()
                .flatten();
            met.map_or(0.0, |met| -f64::from(met.dist))
        });
        depths.fold(0.0, f64::max)
    }

    /// Returns the shapes of all links that a joint moves, with their poses.
    fn shapes_beyond(
        &self,
        joint: usize,
        poses: &[Isometry3<f64>],
    ) -> Vec<(EnginePose, SharedShape)> {
        // The link with this index is moved by the joint before it.
        let mut moved = vec![joint + 1];
        for (idx, other) in self.joints().iter().enumerate() {
            if moved.contains(&other.parent) {
                moved.push(idx + 1);
            }
        }
        let mut shapes = Vec::new();
        for (link, solids) in self
            .solids_of_links()
            .enumerate()
            .filter(|(link, _)| moved.contains(link))
        {
            for solid in solids {
                if let Some((shape, pose)) = convex_shape(solid) {
                    shapes.push((to_pose(&poses[link]) * pose, shape));
                }
            }
        }
        shapes
    }
}

#[cfg(test)]
mod tests {
    use crate::start::tests::lonely;

    #[test]
    fn a_raised_arm_is_beside_the_head_and_touches_it_when_it_turns() {
        let (kinematics, layout, mut positions) = lonely();
        let depth =
            |positions: &[f64]| kinematics.depth_between(positions, layout.arm[0], layout.head[0]);
        assert_eq!(depth(&positions), 0.0);
        positions[layout.arm[0]] = 0.5;
        let deepest = (0..20).map(|step| {
            positions[layout.head[0]] = -1.5 + 0.15 * f64::from(step);
            depth(&positions)
        });
        let deepest = deepest.fold(0.0, f64::max);
        assert!((0.01..0.1).contains(&deepest), "{deepest}");
    }
}
