//! Measures the quality of the simulation: penetration depth, and energy gained without a cause.
//!
//! Reads the engine's state after a tick without changing it.

use crate::bodies::Bodies;
use crate::contacts::Touches;
use crate::physics::Owner;
use actcheck_data::Quality;
use actcheck_robot::GRAVITY;

/// Measures penetration and energy tick by tick.
#[derive(Debug, Default)]
pub(super) struct QualityMeter {
    deepest_m: f64,
    /// Energy of each object after the previous tick; `None` for static objects and those the robot
    /// could push.
    before: Vec<Option<f64>>,
    /// Sum of all changes since the beginning.
    level_j: f64,
    lowest_j: f64,
    gain_j: f64,
}

impl QualityMeter {
    /// Returns the worst values so far.
    pub(super) fn quality(&self) -> Quality {
        Quality {
            deepest_penetration_m: self.deepest_m,
            energy_gain_j: self.gain_j,
        }
    }

    /// Records the contacts of a tick, and the energy of each object that the robot could not push.
    pub(super) fn record(&mut self, touches: &Touches, energies: Vec<Option<f64>>) {
        let depths = touches.values().map(|touch| touch.depth_m);
        self.tick(depths.fold(0.0, f64::max), energies);
    }

    /// Records a tick: the deepest contact, and the energy of each object that the robot could not
    /// push.
    fn tick(&mut self, deepest_m: f64, energies: Vec<Option<f64>>) {
        self.deepest_m = self.deepest_m.max(deepest_m);
        let changes = self
            .before
            .iter()
            .zip(&energies)
            .filter_map(|(before, now)| Some((*now)? - (*before)?));
        self.level_j += changes.sum::<f64>();
        self.lowest_j = self.lowest_j.min(self.level_j);
        self.gain_j = self.gain_j.max(self.level_j - self.lowest_j);
        self.before = energies;
    }
}

/// Returns the energy of each object, in scene order; `None` for static objects and those the
/// robot could push. `sealed` is the object at its suction cup. Unit: joules.
pub(super) fn free_energies(bodies: &Bodies, sealed: Option<usize>) -> Vec<Option<f64>> {
    let reached = reached_by_robot(bodies, sealed);
    let objects = bodies.objects.iter().zip(reached);
    objects
        .map(|(object, reached)| {
            let body = bodies
                .physics
                .bodies
                .get(object.body)
                .filter(|body| !reached && !body.is_fixed())?;
            let height_m = f64::from(body.center_of_mass().z);
            Some(f64::from(body.kinetic_energy()) + object.mass_kg * GRAVITY * height_m)
        })
        .collect()
}

/// Marks the objects that the robot could have pushed, directly or through others. Compares
/// bounding boxes, so that it includes contacts that began and ended within a tick.
fn reached_by_robot(bodies: &Bodies, sealed: Option<usize>) -> Vec<bool> {
    let mut reached = vec![false; bodies.objects.len()];
    let mut pairs: Vec<(usize, usize)> = Vec::new();
    for pair in bodies.physics.narrow_phase.contact_pairs() {
        let owner = |handle| {
            bodies
                .physics
                .colliders
                .get(handle)
                .map(|collider| Owner::from_tag(collider.user_data))
        };
        match (owner(pair.collider1), owner(pair.collider2)) {
            (Some(Owner::Link(_)), Some(Owner::Object(idx)))
            | (Some(Owner::Object(idx)), Some(Owner::Link(_))) => {
                reached[idx] = true;
            }
            (Some(Owner::Object(first)), Some(Owner::Object(second))) => {
                pairs.push((first, second))
            }
            _ => {}
        }
    }
    if let Some(sealed) = sealed {
        reached[sealed] = true;
    }
    // Static objects do not transmit a push.
    let fixed: Vec<bool> = bodies
        .objects
        .iter()
        .map(|object| bodies.is_fixed(object))
        .collect();
    pairs.retain(|(first, second)| !fixed[*first] && !fixed[*second]);
    while let Some((first, second)) = pairs
        .iter()
        .find(|(first, second)| reached[*first] != reached[*second])
    {
        (reached[*first], reached[*second]) = (true, true);
    }
    reached
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lost_energy_and_work_of_the_robot_are_not_gains() {
        let mut meter = QualityMeter::default();
        for (first, second) in [
            (Some(5.0), Some(1.0)),
            (Some(4.0), Some(1.5)),
            (Some(3.0), None),
            (Some(3.0), Some(9.0)),
        ] {
            meter.tick(0.0, vec![first, second, None]);
        }
        assert_eq!(meter.quality().energy_gain_j, 0.0);
    }

    #[test]
    fn the_largest_rise_counts_once() {
        let mut meter = QualityMeter::default();
        for energy in [3.0, 1.0, 1.2, 1.1, 1.6, 0.5, 0.9] {
            meter.tick(energy * 1e-3, vec![Some(energy)]);
        }
        let Quality {
            deepest_penetration_m,
            energy_gain_j,
        } = meter.quality();
        assert!((energy_gain_j - 0.6).abs() < 1e-12, "{energy_gain_j}");
        assert_eq!(deepest_penetration_m, 3e-3);
    }
}
