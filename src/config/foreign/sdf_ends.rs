//! The ends of joints in SDF, as a file names them.

use nalgebra::Isometry3;

use crate::foreign::sdf_pose;
use crate::foreign::xml::{self, Node, Reader};
use actcheck_base::did_you_mean;

/// An element of a model in the outermost one, before it is read.
pub(crate) struct WrittenPart<'a> {
    pub(crate) node: Node<'a>,
    /// Pose of its model in the outermost one.
    pub(crate) model: Isometry3<f64>,
    /// The beginning of the names in its model.
    pub(crate) prefix: String,
}

/// An end of a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum JointEnd {
    /// A link, by its index.
    Link(usize),
    World,
}

impl JointEnd {
    pub(crate) fn link(self) -> Option<usize> {
        match self {
            Self::Link(idx) => Some(idx),
            Self::World => None,
        }
    }
}

impl WrittenPart<'_> {
    /// Returns the link that an end of a joint names, directly or by a frame of the link. `links` are
    /// the names of all links. If the model lacks the link, reports W051 and returns `None`.
    pub(crate) fn end(&self, which: &str, links: &[&str], reader: &mut Reader) -> Option<JointEnd> {
        let element = reader.required(self.node, which)?;
        let named = xml::text(element);
        let position = |name: &str| links.iter().position(|link| *link == name);
        let carried = sdf_pose::carrier(self.node, named, reader)
            .and_then(|link| position(&format!("{}{link}", self.prefix)));
        if let Some(idx) = carried {
            return Some(JointEnd::Link(idx));
        }
        if named == "world" {
            return Some(JointEnd::World);
        }
        // Early versions name links without, or with other, names of models.
        let mut alike = (0..links.len()).filter(|idx| last_name(links[*idx]) == last_name(named));
        if let (Some(idx), None) = (alike.next(), alike.next()) {
            return Some(JointEnd::Link(idx));
        }
        let help = did_you_mean(named, links.iter().copied());
        reader.error(
            "W051",
            element,
            format!("the model has no link `{named}`"),
            help,
        );
        None
    }

    /// Returns the frame in which the pose of a joint is: that of its child. `pose_of` has the poses
    /// of links. Frame: the outermost model.
    pub(crate) fn frame_of_child(
        &self,
        child: JointEnd,
        pose_of: impl Fn(usize) -> Isometry3<f64>,
        reader: &mut Reader,
    ) -> Option<Isometry3<f64>> {
        let JointEnd::Link(link) = child else {
            return Some(self.model);
        };
        let named = xml::text(xml::child(self.node, "child")?);
        match sdf_pose::carrier(self.node, named, reader) {
            Some(carrier) if carrier != named => {
                Some(self.model * sdf_pose::frame(self.node, named, reader)?)
            }
            _ => Some(pose_of(link)),
        }
    }
}

/// The last part of a link's name.
pub(crate) fn last_name(name: &str) -> &str {
    name.rsplit("::").next().unwrap_or(name)
}
