//! The decisions that shape a scene most, as a list that a search can be given.

use std::f64::consts::PI;

use crate::config::Range;
use crate::scenario::Space;

/// One decision of a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Parameter {
    /// The name of its choice, as [`crate::scenario::draw`] makes it.
    pub name: String,
    /// What is chosen from.
    pub kind: ParameterKind,
}

/// What a decision chooses from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ParameterKind {
    /// A range of numbers.
    Range,
    /// The range of where another object stands along one side of the surface; the target's place along the same side
    /// has this name.
    Beside(&'static str),
    /// So many things, none nearer to another.
    OneOf(usize),
    /// So many counts, smallest first.
    Count(usize),
}

impl Space {
    /// The decisions that leave a choice, those that matter most first: how many objects there are, the target, the
    /// robot's place, and of each other object its model and where it stands.
    ///
    /// What is left out (how the others are turned, their masses and friction) shapes a scene less than all the rest,
    /// and a search learns faster without it. It is drawn like everything that nobody decides.
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

    /// Ids that another object may have, the first of each model.
    pub fn other_ids(&self) -> Vec<String> {
        let targets = self.target_ids();
        let mut ids: Vec<String> = self.others.iter().map(|model| format!("{}_1", model.name)).collect();
        ids.retain(|id| !targets.contains(id));
        ids
    }

    /// Ids that the target may have, one for each model that it may be of.
    pub fn target_ids(&self) -> Vec<String> {
        self.targets.iter().map(|model| format!("{}_1", model.name)).collect()
    }
}
