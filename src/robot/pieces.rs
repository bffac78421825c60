//! Links of many pieces: those whose mesh was split into convex hulls.
//!
//! A hand of such links has dozens of pairs of hulls near an object, most of which never touch it.
//! The simulation looks at them less often. Robots of few pieces gain nothing by that, and keep the
//! bits of their runs.

use nalgebra::Isometry3;
use parry3d::math::Pose as EnginePose;
use parry3d::shape::SharedShape;

use crate::description::{Link, RobotModel};
use actcheck_geometry::{BodySolids, Piece, solid_depth_m, to_pose};

/// Fewest collision shapes of a link of many pieces.
const MANY_PIECES: usize = 4;

impl Link {
    /// Returns whether it has many collision shapes.
    pub fn has_many_pieces(&self) -> bool {
        self.solids.len() >= MANY_PIECES
    }

    /// Returns the convex pieces of its shapes with the link at this pose.
    fn pieces<'a>(&'a self, form: &'a BodySolids, pose: &Isometry3<f64>) -> Vec<Piece<'a>> {
        let placed = to_pose(pose);
        let piece = |(part, shape, in_link): (usize, &'a SharedShape, &'a EnginePose)| {
            let of_part = self
                .materials
                .iter()
                .find(|(parts, _)| parts.contains(&part));
            let material = of_part.map(|(_, material)| (material.as_ref(), *pose));
            Piece {
                shape,
                pose: placed * *in_link,
                material,
            }
        };
        form.parts().map(piece).collect()
    }
}

impl RobotModel {
    /// Returns whether any of its links has.
    pub fn has_many_pieces(&self) -> bool {
        self.links.iter().any(Link::has_many_pieces)
    }

    /// Returns how deep two links are in each other where both are solid; 0 if they are apart.
    /// `between`: the pose of the second in the frame of the first. Unit: metres.
    pub fn solid_depth_m(&self, first: usize, second: usize, between: &Isometry3<f64>) -> f64 {
        let links = [first, second].map(|link| &self.links[link]);
        let forms = links.map(Link::form);
        solid_depth_m(
            &links[0].pieces(&forms[0], &Isometry3::identity()),
            &links[1].pieces(&forms[1], between),
        )
    }
}
