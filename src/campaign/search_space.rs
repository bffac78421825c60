//! The cube that a campaign's search looks through, and what a point of it decides in a run.

use std::collections::BTreeMap;

use crate::campaign::Env;
use crate::scenario::ParameterKind;
use crate::search::{Dimension, Space};

/// The axes of a campaign's cube, each with the names of the choices that it decides.
#[derive(Debug, Clone)]
pub(super) struct SearchSpace {
    axes: Vec<(Vec<String>, Dimension)>,
}

impl SearchSpace {
    /// The scene's parameters, and where the target seems to stand. Where scenes are repeated noise is left alone: it is
    /// what the repetitions differ in.
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
        let (targets, sensing) = (env.space.target_ids(), &env.campaign.sensing);
        if env.campaign.repeat == 1 && !targets.is_empty() {
            let noises =
                [("x", sensing.position_noise_m), ("y", sensing.position_noise_m), ("z", sensing.height_noise_m)];
            for (side, sigma) in noises {
                if sigma > 0.0 {
                    // Whichever model the target is of: one axis for the same noise.
                    let names = targets.iter().map(|id| format!("sense.{id}.{side}")).collect();
                    axes.push((names, Dimension::Normal));
                }
            }
        }
        Self { axes }
    }

    /// The cube.
    pub fn cube(&self) -> Space {
        Space::new(self.axes.iter().map(|(_, dimension)| *dimension))
    }

    /// What a point decides: quantiles by the name of the choice.
    pub fn quantiles(&self, point: &[f64]) -> BTreeMap<String, f64> {
        let pairs = self.axes.iter().zip(point);
        pairs.flat_map(|((names, _), value)| names.iter().map(|name| (name.clone(), *value))).collect()
    }
}
