//! The `<state>` of a world that Gazebo has saved: where its models are, and which it lacks.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Isometry3;

use crate::foreign::elements::Children;
use crate::foreign::nested::Tree;
use crate::foreign::sdf_pose::pose;
use crate::foreign::xml::{self, Bound, Node, Reader};
use actcheck_base::Span;
use actcheck_data::Shape;

/// Nothing moves in a world here: times and lights have no effect.
const STATE: Children = Children {
    read: &[
        "model",
        "insertions",
        "deletions",
        "sim_time",
        "wall_time",
        "real_time",
        "iterations",
        "light",
        "joint",
    ],
    harmless: &[],
    refused: &[],
};
/// Joints stay where the poses of their links put them.
const MODEL: Children = Children {
    read: &["pose", "scale", "link", "model", "joint", "frame"],
    harmless: &[],
    refused: &[],
};
const LINK: Children = Children {
    read: &["pose", "velocity", "acceleration", "wrench", "collision"],
    harmless: &[],
    refused: &[],
};
/// Links that are this close to where the pose of their model puts them have only settled. Units:
/// metres and radians.
const SETTLED: f64 = 1e-3;
/// Smaller differences are those of rounded numbers. Units: metres and radians.
const ROUNDED: f64 = 1e-9;

/// The first `<state>` of a world; Gazebo applies no other.
#[derive(Default)]
pub(super) struct WorldState<'a> {
    models: BTreeMap<String, ModelState>,
    /// Models that are added to the world.
    pub(super) inserted: Vec<Node<'a>>,
    /// Names of models that are removed.
    pub(super) deleted: BTreeSet<String>,
}

/// The state of a model.
pub(super) struct ModelState {
    /// Frame: world.
    pub(super) pose: Isometry3<f64>,
    /// Of each solid along its own axes.
    scale: [f64; 3],
    /// Poses of links by name. Frame: world.
    links: BTreeMap<String, Isometry3<f64>>,
    at: Span,
}

impl<'a> WorldState<'a> {
    /// Reads the state of a world; it is empty if the world has none.
    pub(super) fn of(world: Node<'a>, reader: &mut Reader) -> Self {
        let mut state = Self::default();
        let Some(first) = xml::child(world, "state") else {
            return state;
        };
        STATE.check(first, reader);
        for model in xml::children(first, "model") {
            if let Some(name) = reader.attribute(model, "name")
                && let Some(model) = ModelState::of(model, reader)
            {
                state.models.entry(name.to_owned()).or_insert(model);
            }
        }
        for insertions in xml::children(first, "insertions") {
            state.inserted.extend(xml::children(insertions, "model"));
        }
        for deletions in xml::children(first, "deletions") {
            let names = xml::children(deletions, "name").map(|name| xml::text(name).to_owned());
            state.deleted.extend(names);
        }
        state
    }

    /// Takes the state of a model by its name.
    pub(super) fn take(&mut self, name: &str) -> Option<ModelState> {
        self.models.remove(name)
    }

    /// Warns of the states of models that the world lacks (W036).
    pub(super) fn warn_of_others(&self, known: &BTreeSet<String>, reader: &mut Reader) {
        for (name, model) in &self.models {
            if !known.contains(name) {
                let message =
                    format!("the state of `{name}` has no effect: the world has no such model");
                let help = "Gazebo ignores it, too: remove it";
                reader.warning_at("W036", model.at.clone(), message, help);
            }
        }
    }
}

impl ModelState {
    fn of(model: Node, reader: &mut Reader) -> Option<Self> {
        let scale = match xml::child(model, "scale") {
            Some(scale) => reader.numbers(scale, xml::text(scale), Bound::Positive)?,
            None => [1.0; 3],
        };
        let mut links = BTreeMap::new();
        collect(model, "", &mut links, reader)?;
        Some(Self {
            pose: pose(model, reader)?,
            scale,
            links,
            at: xml::span(model),
        })
    }

    /// Whether the state only moves a model as a whole. `links` are the poses of its links in its
    /// frame.
    pub(super) fn is_rigid(&self, links: &BTreeMap<String, Isometry3<f64>>) -> bool {
        self.scale == [1.0; 3]
            && links.iter().all(|(name, pose)| {
                self.shift(name, pose)
                    .is_none_or(|by| is_smaller(&by, SETTLED))
            })
    }

    /// Moves the links of a model and scales its solids, as the state says. Reports links that the
    /// model lacks (W036).
    pub(super) fn apply(&self, tree: &mut Tree, reader: &mut Reader) {
        for link in &mut tree.links {
            if let Some(by) = self.shift(&link.name, &link.pose)
                && !is_smaller(&by, ROUNDED)
            {
                link.body.transform(&by);
                link.pose = by * link.pose;
            }
            if self.scale != [1.0; 3] {
                for part in &mut link.body.parts {
                    part.shape = scaled(&part.shape, self.scale);
                }
            }
        }
        let is_known = |name: &&String| tree.links.iter().any(|link| link.name == **name);
        if let Some(name) = self.links.keys().find(|name| !is_known(name)) {
            let message =
                format!("the state of `{name}` has no effect: the model has no such link");
            let help = "Gazebo ignores it, too: remove it";
            reader.warning_at("W036", self.at.clone(), message, help);
        }
    }

    /// Returns the motion of a link from where its model has it, in the frame of the model.
    fn shift(&self, name: &str, pose: &Isometry3<f64>) -> Option<Isometry3<f64>> {
        let placed = self.links.get(name)?;
        Some(self.pose.inverse() * placed * pose.inverse())
    }
}

/// Collects the poses of the links of a model and of those nested in it.
fn collect(
    model: Node,
    prefix: &str,
    links: &mut BTreeMap<String, Isometry3<f64>>,
    reader: &mut Reader,
) -> Option<()> {
    MODEL.check(model, reader);
    for link in xml::children(model, "link") {
        LINK.check(link, reader);
        let name = reader.attribute(link, "name")?;
        if xml::child(link, "pose").is_some() {
            links.insert(format!("{prefix}{name}"), pose(link, reader)?);
        }
    }
    for nested in xml::children(model, "model") {
        let name = reader.attribute(nested, "name")?;
        if xml::child(nested, "pose").is_some() && xml::child(nested, "link").is_none() {
            let message = format!("the state of `{name}` inside another model can't be applied");
            let help = "add the poses of its links to the `<state>`";
            reader.error("W035", nested, message, help);
        }
        collect(nested, &format!("{prefix}{name}::"), links, reader)?;
    }
    Some(())
}

fn is_smaller(motion: &Isometry3<f64>, limit: f64) -> bool {
    motion.translation.vector.norm() <= limit && motion.rotation.angle() <= limit
}

/// Returns a solid with another scale. The radius of a round one has the larger factor, as in
/// Gazebo.
fn scaled(shape: &Shape, [x, y, z]: [f64; 3]) -> Shape {
    let around = x.max(y);
    match shape {
        Shape::Box { size } => Shape::Box {
            size: [size[0] * x, size[1] * y, size[2] * z],
        },
        Shape::Cylinder { radius, height } => Shape::Cylinder {
            radius: radius * around,
            height: height * z,
        },
        Shape::Capsule { radius, height } => Shape::Capsule {
            radius: radius * around,
            height: height * z,
        },
        Shape::Sphere { radius } => Shape::Sphere {
            radius: radius * around.max(z),
        },
        other => other.scaled([x, y, z]),
    }
}
