//! The scene parameters that a search varies: the choices with the largest effect.

use std::f64::consts::PI;

use crate::Space;
use actcheck_data::{ChoiceName, ObjectAxis, PlacedObject, Range, StartAxis};

/// A parameter of a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Parameter {
    /// The name of its choice in [`crate::draw()`].
    pub name: ChoiceName,
    /// Its values.
    pub kind: ParameterKind,
}

/// The values of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ParameterKind {
    /// A range of numbers.
    Range,
    /// A range for the position of another object along this axis of the surface, near the
    /// target's.
    Beside(ObjectAxis),
    /// This many unordered alternatives.
    OneOf(usize),
    /// This many counts in rising order.
    Count(usize),
}

impl Space {
    /// Returns the parameters with more than one value, the most important ones first: the number
    /// of objects, the target, the robot's start, and the model and position of each other object.
    ///
    /// Yaw, mass and friction of the other objects are left out: they affect a scene least, and a
    /// search learns faster without them. They are drawn at random.
    pub fn parameters(&self) -> Vec<Parameter> {
        let mut found = Vec::new();
        let mut add = |name: ChoiceName, kind: ParameterKind| match kind {
            ParameterKind::OneOf(0 | 1) | ParameterKind::Count(0 | 1) => {}
            kind => found.push(Parameter { name, kind }),
        };
        let (least, most) = self.other_counts.beside_target;
        let most = if self.others.is_empty() { 0 } else { most };
        if most > 0 {
            add(
                ChoiceName::OtherCount,
                ParameterKind::Count((most - least + 1) as usize),
            );
        }
        self.names.iter().for_each(|(name, values)| {
            add(name.as_str().into(), ParameterKind::OneOf(values.len()))
        });
        add(
            ChoiceName::SurfaceModel,
            ParameterKind::OneOf(self.surfaces.len()),
        );
        if !self.targets.is_empty() {
            let of_target = |axis| ChoiceName::Object(PlacedObject::Target, axis);
            add(
                of_target(ObjectAxis::Model),
                ParameterKind::OneOf(self.targets.len()),
            );
            let physics = &self.physics;
            let ranges: [(ObjectAxis, Range); 6] = [
                (ObjectAxis::X, (0.0, 1.0)),
                (ObjectAxis::Y, (0.0, 1.0)),
                (ObjectAxis::Yaw, (-PI, PI)),
                (ObjectAxis::MassScale, physics.mass_scale),
                (ObjectAxis::FrictionScale, physics.friction_scale),
                (ObjectAxis::Restitution, physics.restitution),
            ];
            let open = ranges.into_iter().filter(|(_, (low, high))| low < high);
            open.for_each(|(axis, _)| add(of_target(axis), ParameterKind::Range));
        }
        for axis in [StartAxis::Gap, StartAxis::Side, StartAxis::Heading] {
            add(ChoiceName::Robot(axis), ParameterKind::Range);
        }
        for number in 1..=most {
            let of_other = |axis| ChoiceName::Object(PlacedObject::Other(number), axis);
            add(
                of_other(ObjectAxis::Model),
                ParameterKind::OneOf(self.others.len()),
            );
            for axis in [ObjectAxis::X, ObjectAxis::Y] {
                add(of_other(axis), ParameterKind::Beside(axis));
            }
        }
        found
    }

    /// Possible ids of other objects: the first id of each model.
    pub fn other_ids(&self) -> Vec<String> {
        let targets = self.target_ids();
        let mut ids: Vec<String> = self
            .others
            .iter()
            .map(|model| format!("{}_1", model.name))
            .collect();
        ids.retain(|id| !targets.contains(id));
        ids
    }

    /// Possible ids of the target, one for each model.
    pub fn target_ids(&self) -> Vec<String> {
        self.targets
            .iter()
            .map(|model| format!("{}_1", model.name))
            .collect()
    }
}
