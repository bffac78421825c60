//! The scene parameters that a search varies: the choices with the largest effect.

use std::f64::consts::PI;

use crate::Space;
use actcheck_data::Range;

/// A parameter of a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Parameter {
    /// The name of its choice in [`crate::draw`].
    pub name: String,
    /// Its values.
    pub kind: ParameterKind,
}

/// The values of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ParameterKind {
    /// A range of numbers.
    Range,
    /// A range for the position of another object along one axis of the surface. Holds the name of the target's
    /// position along the same axis.
    Beside(&'static str),
    /// This many unordered alternatives.
    OneOf(usize),
    /// This many counts in rising order.
    Count(usize),
}

impl Space {
    /// Returns the parameters with more than one value, the most important ones first: the number of objects, the
    /// target, the robot's start, and the model and position of each other object.
    ///
    /// Yaw, mass and friction of the other objects are left out: they affect a scene least, and a search learns faster
    /// without them. They are drawn at random.
    pub fn parameters(&self) -> Vec<Parameter> {
        let mut found = Vec::new();
        let mut add = |name: String, kind: ParameterKind| match kind {
            ParameterKind::OneOf(0 | 1) | ParameterKind::Count(0 | 1) => {}
            kind => found.push(Parameter { name, kind }),
        };
        let (least, most) = self.other_counts.beside_target;
        let most = if self.others.is_empty() { 0 } else { most };
        if most > 0 {
            add("other.count".to_owned(), ParameterKind::Count((most - least + 1) as usize));
        }
        self.names.iter().for_each(|(name, values)| add(name.clone(), ParameterKind::OneOf(values.len())));
        add("surface.model".to_owned(), ParameterKind::OneOf(self.surfaces.len()));
        if !self.targets.is_empty() {
            add("target.model".to_owned(), ParameterKind::OneOf(self.targets.len()));
            let physics = &self.physics;
            let ranges: [(&str, Range); 6] = [
                ("x", (0.0, 1.0)),
                ("y", (0.0, 1.0)),
                ("yaw", (-PI, PI)),
                ("mass_scale", physics.mass_scale),
                ("friction_scale", physics.friction_scale),
                ("restitution", physics.restitution),
            ];
            let open = ranges.into_iter().filter(|(_, (low, high))| low < high);
            open.for_each(|(name, _)| add(format!("target.{name}"), ParameterKind::Range));
        }
        for name in ["gap", "side", "heading"] {
            add(format!("robot.{name}"), ParameterKind::Range);
        }
        for number in 1..=most {
            add(format!("other.{number}.model"), ParameterKind::OneOf(self.others.len()));
            add(format!("other.{number}.x"), ParameterKind::Beside("target.x"));
            add(format!("other.{number}.y"), ParameterKind::Beside("target.y"));
        }
        found
    }

    /// Possible ids of other objects: the first id of each model.
    pub fn other_ids(&self) -> Vec<String> {
        let targets = self.target_ids();
        let mut ids: Vec<String> = self.others.iter().map(|model| format!("{}_1", model.name)).collect();
        ids.retain(|id| !targets.contains(id));
        ids
    }

    /// Possible ids of the target, one for each model.
    pub fn target_ids(&self) -> Vec<String> {
        self.targets.iter().map(|model| format!("{}_1", model.name)).collect()
    }
}
