//! The unit cube of a campaign's search, and the choices that its points determine.

use std::collections::BTreeMap;

use crate::Env;
use actcheck_data::{ChoiceName, PlacedObject, PlanarAxis, SightingAxis};
use actcheck_scenario::ParameterKind;
use actcheck_search::{Dimension, Space};

/// The axes of the cube, each with the names of the choices that it determines.
#[derive(Debug, Clone)]
pub(super) struct SearchSpace {
    axes: Vec<(Vec<ChoiceName>, Dimension)>,
}

impl SearchSpace {
    /// Creates the cube from the scene's parameters and from the noise of object and robot poses.
    /// If scenes are repeated, noise is not an axis, because repetitions differ in it.
    pub fn new(env: &Env) -> Self {
        let parameters = env.space.parameters();
        let of_target = |axis| {
            let name = ChoiceName::Object(PlacedObject::Target, axis);
            parameters
                .iter()
                .position(|parameter| parameter.name == name)
        };
        let of = |kind| match kind {
            ParameterKind::Range => Dimension::Continuous,
            ParameterKind::Beside(axis) => {
                of_target(axis).map_or(Dimension::Continuous, Dimension::Beside)
            }
            ParameterKind::OneOf(count) => Dimension::Categorical(count),
            ParameterKind::Count(count) => Dimension::Rising(count),
        };
        let mut axes: Vec<(Vec<ChoiceName>, Dimension)> = parameters
            .iter()
            .map(|parameter| (vec![parameter.name.clone()], of(parameter.kind)))
            .collect();
        if env.campaign.repeat == 1 {
            axes.extend(noises(env));
        }
        Self { axes }
    }

    /// The cube.
    pub fn cube(&self) -> Space {
        Space::new(self.axes.iter().map(|(_, dimension)| *dimension))
    }

    /// Returns the quantiles of a point, by the name of the choice.
    pub fn quantiles(&self, point: &[f64]) -> BTreeMap<ChoiceName, f64> {
        let pairs = self.axes.iter().zip(point);
        pairs
            .flat_map(|((names, _), value)| names.iter().map(|name| (name.clone(), *value)))
            .collect()
    }
}

/// Pose noise of the target, of the robot, and of the first other object of each model.
fn noises(env: &Env) -> Vec<(Vec<ChoiceName>, Dimension)> {
    let (sensing, targets) = (&env.campaign.sensing, env.space.target_ids());
    let (flat, turning) = (sensing.position_noise_m, sensing.heading_noise_rad);
    let mut axes = Vec::new();
    let mut add = |names: Vec<ChoiceName>, sigma: f64, dimension| {
        if sigma > 0.0 && !names.is_empty() {
            axes.push((names, dimension));
        }
    };
    let height = sensing.height_noise_m;
    for (axis, sigma) in [
        (SightingAxis::X, flat),
        (SightingAxis::Y, flat),
        (SightingAxis::Z, height),
    ] {
        // One axis for the target's noise, whatever its model.
        add(
            targets
                .iter()
                .map(|id| ChoiceName::sighting(id, axis))
                .collect(),
            sigma,
            Dimension::Normal,
        );
    }
    let itself = sensing.localisation_noise_m;
    for (axis, sigma) in [
        (PlanarAxis::X, itself),
        (PlanarAxis::Y, itself),
        (PlanarAxis::Heading, turning),
    ] {
        add(
            vec![ChoiceName::Localisation(axis)],
            sigma,
            Dimension::Normal,
        );
    }
    for id in env.space.other_ids() {
        for axis in [SightingAxis::X, SightingAxis::Y] {
            add(
                vec![ChoiceName::sighting(&id, axis)],
                flat,
                Dimension::Aside,
            );
        }
    }
    axes
}
