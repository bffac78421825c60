//! The unit cube of a campaign's search, and the choices that its points determine.

use std::collections::BTreeMap;

use crate::Env;
use actcheck_scenario::ParameterKind;
use actcheck_search::{Dimension, Space};

/// The axes of the cube, each with the names of the choices that it determines.
#[derive(Debug, Clone)]
pub(super) struct SearchSpace {
    axes: Vec<(Vec<String>, Dimension)>,
}

impl SearchSpace {
    /// Creates the cube from the scene's parameters and from the noise of object and robot poses. If scenes are
    /// repeated, noise is not an axis, because repetitions differ in it.
    pub fn new(env: &Env) -> Self {
        let parameters = env.space.parameters();
        let index_of = |name: &str| parameters.iter().position(|parameter| parameter.name == name);
        let of = |kind| match kind {
            ParameterKind::Range => Dimension::Continuous,
            ParameterKind::Beside(name) => index_of(name).map_or(Dimension::Continuous, Dimension::Beside),
            ParameterKind::OneOf(count) => Dimension::Categorical(count),
            ParameterKind::Count(count) => Dimension::Rising(count),
        };
        let mut axes: Vec<(Vec<String>, Dimension)> =
            parameters.iter().map(|parameter| (vec![parameter.name.clone()], of(parameter.kind))).collect();
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
    pub fn quantiles(&self, point: &[f64]) -> BTreeMap<String, f64> {
        let pairs = self.axes.iter().zip(point);
        pairs.flat_map(|((names, _), value)| names.iter().map(|name| (name.clone(), *value))).collect()
    }
}

/// Pose noise of the target, of the robot, and of the first other object of each model.
fn noises(env: &Env) -> Vec<(Vec<String>, Dimension)> {
    let (sensing, targets) = (&env.campaign.sensing, env.space.target_ids());
    let (flat, turning) = (sensing.position_noise_m, sensing.heading_noise_rad);
    let mut axes = Vec::new();
    let mut add = |names: Vec<String>, sigma: f64, dimension| {
        if sigma > 0.0 && !names.is_empty() {
            axes.push((names, dimension));
        }
    };
    for (side, sigma) in [("x", flat), ("y", flat), ("z", sensing.height_noise_m)] {
        // One axis for the target's noise, whatever its model.
        add(targets.iter().map(|id| format!("sense.{id}.{side}")).collect(), sigma, Dimension::Normal);
    }
    let itself = sensing.localisation_noise_m;
    for (side, sigma) in [("x", itself), ("y", itself), ("heading", turning)] {
        add(vec![format!("sense.localisation.{side}")], sigma, Dimension::Normal);
    }
    for id in env.space.other_ids() {
        for side in ["x", "y"] {
            add(vec![format!("sense.{id}.{side}")], flat, Dimension::Aside);
        }
    }
    axes
}
