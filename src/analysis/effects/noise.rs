//! Realised noise: the errors that a run drew, summarised where one kind of error is drawn many
//! times.

use actcheck_data::{Choice, ChoiceName, PlanarAxis, SightingAxis, WheelAxis};

/// Realised noise as an action's target has it. `None` for errors that the run did not draw.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RealisedNoise {
    /// First error of the perceived target, in the order of [`SightingAxis::ALL`]. Units: metres,
    /// radians.
    pub target: [Option<f64>; SightingAxis::ALL.len()],
    /// Largest horizontal error of any other perceived object. Unit: metres.
    pub others_xy_m: Option<f64>,
    /// Error of the initial localisation, in the order of [`PlanarAxis::ALL`]. Units: metres,
    /// radians.
    pub localisation: [Option<f64>; PlanarAxis::ALL.len()],
    /// Mean error of the wheel odometry over the stretches of the path, in the order of
    /// [`WheelAxis::ALL`].
    pub odometry: [Option<f64>; WheelAxis::ALL.len()],
    /// Largest error of a landmark's measurement by size, in the order of [`PlanarAxis::ALL`].
    /// Units: metres, radians.
    pub landmark: [Option<f64>; PlanarAxis::ALL.len()],
    /// Largest error of the gap between the fingers by size. Unit: metres.
    pub gripper_m: Option<f64>,
}

impl RealisedNoise {
    /// Summarises the choices of a run for the target with an id.
    pub fn of(choices: &[Choice], target: Option<&str>) -> Self {
        let values = |name: ChoiceName| {
            choices
                .iter()
                .filter(move |choice| choice.name == name)
                .map(|it| it.value)
        };
        let first = |name| values(name).next();
        let largest = |name| values(name).max_by(|a, b| a.abs().total_cmp(&b.abs()));
        Self {
            target: SightingAxis::ALL.map(|axis| first(ChoiceName::sighting(target?, axis))),
            others_xy_m: others_xy_m(choices, target),
            localisation: PlanarAxis::ALL.map(|axis| first(ChoiceName::Localisation(axis))),
            odometry: WheelAxis::ALL.map(|axis| mean(values(ChoiceName::Odometry(axis)))),
            landmark: PlanarAxis::ALL.map(|axis| largest(ChoiceName::Landmark(axis))),
            gripper_m: largest(ChoiceName::Gripper),
        }
    }

    /// Horizontal error of the perceived target. Unit: metres.
    pub fn target_xy_m(&self) -> Option<f64> {
        let [x, y, ..] = self.target;
        Some(libm::hypot(x?, y?))
    }

    /// Horizontal error of the initial localisation. Unit: metres.
    pub fn localisation_xy_m(&self) -> Option<f64> {
        let [x, y, _] = self.localisation;
        Some(libm::hypot(x?, y?))
    }
}

/// Returns the largest horizontal error of a perceived object other than the target. The draws of
/// one object's x and y follow each other.
fn others_xy_m(choices: &[Choice], target: Option<&str>) -> Option<f64> {
    let mut largest: Option<f64> = None;
    let mut along: Option<(&str, f64)> = None;
    for choice in choices {
        match &choice.name {
            ChoiceName::Sighting {
                id,
                axis: SightingAxis::X,
            } => along = Some((id, choice.value)),
            ChoiceName::Sighting {
                id,
                axis: SightingAxis::Y,
            } if target != Some(id) => {
                if let Some((_, x)) = along.filter(|(known, _)| known == id) {
                    let off = libm::hypot(x, choice.value);
                    largest = Some(largest.map_or(off, |known| known.max(off)));
                }
            }
            _ => {}
        }
    }
    largest
}

fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values.fold((0.0, 0u32), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::ChoiceKind;

    fn draws(named: &[(&str, f64)]) -> Vec<Choice> {
        let kind = ChoiceKind::Normal { sigma: 0.01 };
        named
            .iter()
            .map(|(name, value)| Choice {
                name: (*name).into(),
                kind: kind.clone(),
                value: *value,
            })
            .collect()
    }

    #[test]
    fn draws_are_summarised_for_the_target_and_the_others() {
        let choices = draws(&[
            ("sense.localisation.x", 0.03),
            ("sense.localisation.y", -0.04),
            ("sense.glass_1.x", 0.05),
            ("sense.glass_1.y", 0.12),
            ("sense.mug_2.x", 0.003),
            ("sense.mug_2.y", 0.004),
            ("sense.can_3.x", 0.0),
            ("sense.can_3.y", -0.02),
            ("sense.odometry.along", 0.1),
            ("sense.odometry.along", -0.3),
            ("sense.gripper", 0.001),
            ("sense.gripper", -0.002),
            // A second look does not replace the first.
            ("sense.glass_1.x", 9.0),
        ]);
        let near = |found: Option<f64>, expected: f64| {
            assert!((found.unwrap_or(f64::NAN) - expected).abs() < 1e-12)
        };
        let noise = RealisedNoise::of(&choices, Some("glass_1"));
        near(noise.target_xy_m(), 0.13);
        near(noise.others_xy_m, 0.02);
        near(noise.localisation_xy_m(), 0.05);
        near(noise.odometry[0], -0.1);
        near(noise.gripper_m, -0.002);
        assert_eq!((noise.target[2], noise.landmark), (None, [None; 3]));
        assert_eq!(
            RealisedNoise::of(&[], Some("glass_1")),
            RealisedNoise::default()
        );
    }
}
