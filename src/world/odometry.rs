//! Localisation of the base while it drives: wheel odometry drifts, landmarks correct it.
//!
//! The relative wheel errors are constant within a stretch of the path. Each stretch has its own
//! choices, `sense.odometry.*`. A landmark measures the true pose with noise; its weight depends on
//! the current uncertainty of the estimate (a Kalman filter with one variance for the position and
//! one for the heading).

use nalgebra::Vector2;

use actcheck_data::{ChoiceName, Choices, Odometry, PlanarAxis, Sensing, WheelAxis};

/// Length of a stretch with constant wheel errors: distance plus rotation. Units: metres and
/// radians.
const STRETCH: f64 = 0.5;
/// Largest rate at which corrections are applied, so that a base that follows its estimate does not
/// jerk. Units: m/s and rad/s.
const CORRECTION_SPEED: f64 = 0.05;

/// The state of the base's odometry.
#[derive(Debug, Clone, Default)]
pub(super) struct Tracker {
    /// True base pose at the previous tick.
    last: Option<[f64; 3]>,
    /// Errors in this stretch: along and across the path (shares), of the heading per radian turned
    /// and per metre driven.
    off: [f64; 4],
    /// Remaining length of this stretch.
    left: f64,
    /// Distance since the last landmark. Unit: metres.
    since_landmark_m: f64,
    /// Variances of position and heading. Units: m² and rad².
    variances: [f64; 2],
    /// Corrections not applied yet: x, y, heading.
    pending: [f64; 3],
}

/// The true motion of the base in one tick.
struct Step {
    along: Vector2<f64>,
    way_m: f64,
    turn_rad: f64,
}

impl Tracker {
    /// Starts with the uncertainty of the initial localisation.
    pub(super) fn begin(sensing: &Sensing) -> Self {
        let (place, heading) = (sensing.localisation_noise_m, sensing.heading_noise_rad);
        Self {
            variances: [place * place, heading * heading],
            ..Self::default()
        }
    }

    /// Starts the next step at the current pose, after the base was moved without turning its
    /// wheels.
    pub(super) fn forget_way(&mut self) {
        self.last = None;
    }

    /// Returns the believed pose after a motion of the base to `now` since the last call. Call it
    /// after every tick. `believed` converts a true pose to the one that was believed so far.
    /// Returns `None` if nothing changes this belief.
    pub(super) fn track(
        &mut self,
        sensing: &Sensing,
        now: [f64; 3],
        believed: impl Fn([f64; 3]) -> [f64; 3],
        tick_secs: f64,
        choices: &mut Choices,
    ) -> Option<[f64; 3]> {
        let odometry = &sensing.odometry;
        if *odometry == Odometry::IDEAL {
            return None;
        }
        let last = self.last.replace(now)?;
        let along = Vector2::new(now[0] - last[0], now[1] - last[1]);
        let step = Step {
            along,
            way_m: (along.x * along.x + along.y * along.y).sqrt(),
            turn_rad: now[2] - last[2],
        };
        let at = believed(last);
        let mut believed = self.by_wheels(odometry, at, at[2] - last[2], &step, choices);
        let every_m = odometry.landmark_every_m;
        if every_m > 0.0 && self.since_landmark_m >= every_m {
            self.see_landmark(odometry, now, believed, choices);
        }
        let most = CORRECTION_SPEED * tick_secs;
        for (belief, pending) in believed.iter_mut().zip(&mut self.pending) {
            let change = pending.clamp(-most, most);
            *belief += change;
            *pending -= change;
        }
        Some(believed)
    }

    /// Returns the believed pose after a step, by wheel odometry.
    fn by_wheels(
        &mut self,
        odometry: &Odometry,
        at: [f64; 3],
        astray: f64,
        step: &Step,
        choices: &mut Choices,
    ) -> [f64; 3] {
        let [x, y, heading] = at;
        self.left -= step.way_m + step.turn_rad.abs();
        if self.left <= 0.0 && step.way_m + step.turn_rad.abs() > 0.0 {
            let mut draw =
                |axis: WheelAxis, sigma: f64| choices.normal(ChoiceName::Odometry(axis), sigma);
            self.off = [
                draw(WheelAxis::Along, odometry.drift),
                draw(WheelAxis::Across, odometry.drift),
                draw(WheelAxis::Turning, odometry.heading_drift),
                draw(WheelAxis::Veering, odometry.heading_drift),
            ];
            self.left = STRETCH;
        }
        self.grow(odometry, step);
        let [along, across, turning, veering] = self.off;
        let measured =
            step.along * (1.0 + along) + Vector2::new(-step.along.y, step.along.x) * across;
        let (sin, cos) = (libm::sin(astray), libm::cos(astray));
        [
            x + cos * measured.x - sin * measured.y,
            y + sin * measured.x + cos * measured.y,
            heading + step.turn_rad * (1.0 + turning) + step.way_m * veering,
        ]
    }

    /// Computes the correction by a landmark, to be applied gradually.
    fn see_landmark(
        &mut self,
        odometry: &Odometry,
        truth: [f64; 3],
        believed: [f64; 3],
        choices: &mut Choices,
    ) {
        let noise = [
            odometry.landmark_noise_m,
            odometry.landmark_noise_m,
            odometry.landmark_noise_rad,
        ];
        self.since_landmark_m = 0.0;
        let shares = [
            share(&mut self.variances[0], odometry.landmark_noise_m),
            share(&mut self.variances[1], odometry.landmark_noise_rad),
        ];
        for (axis, name) in PlanarAxis::ALL.into_iter().enumerate() {
            let seen = truth[axis] + choices.normal(ChoiceName::Landmark(name), noise[axis]);
            self.pending[axis] = shares[axis / 2] * (seen - believed[axis]);
        }
    }

    /// Increases the variances with the distance. Stretches are independent; a heading error
    /// displaces the position in proportion to the distance.
    fn grow(&mut self, odometry: &Odometry, step: &Step) {
        let moved = step.way_m + step.turn_rad.abs();
        self.since_landmark_m += step.way_m;
        self.variances[1] += odometry.heading_drift * odometry.heading_drift * STRETCH * moved;
        self.variances[0] += odometry.drift * odometry.drift * STRETCH * step.way_m
            + self.variances[1] * self.since_landmark_m * step.way_m;
    }
}

/// Returns the Kalman gain of a measurement, and reduces the variance.
fn share(variance: &mut f64, noise: f64) -> f64 {
    let total = *variance + noise * noise;
    if total <= 0.0 {
        return 0.0;
    }
    let share = *variance / total;
    *variance *= 1.0 - share;
    share
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn estimates_of_equal_variance_have_equal_weight() {
        let mut variance = 0.04;
        assert!((share(&mut variance, 0.2) - 0.5).abs() < 1e-12 && (variance - 0.02).abs() < 1e-12);
        let mut sure = 0.0;
        assert_eq!((share(&mut sure, 0.2), share(&mut sure, 0.0)), (0.0, 0.0));
        let mut unsure = 0.04;
        assert_eq!((share(&mut unsure, 0.0), unsure), (1.0, 0.0));
    }

    #[test]
    fn uncertainty_grows_with_distance_and_turning() {
        let odometry = Odometry {
            drift: 0.1,
            heading_drift: 0.02,
            ..Odometry::IDEAL
        };
        let mut tracker = Tracker::default();
        for _ in 0..200 {
            tracker.grow(
                &odometry,
                &Step {
                    along: Vector2::zeros(),
                    way_m: 0.01,
                    turn_rad: 0.0,
                },
            );
        }
        // Two metres: four stretches of half a metre, each with an error of a tenth.
        assert!(
            (tracker.variances[1].sqrt() - 0.02).abs() < 1e-9,
            "{}",
            tracker.variances[1].sqrt()
        );
        let straight = 0.1 * 0.5 * 2.0;
        assert!(
            tracker.variances[0].sqrt() > straight && tracker.variances[0].sqrt() < 1.2 * straight
        );
        tracker.grow(
            &odometry,
            &Step {
                along: Vector2::zeros(),
                way_m: 0.0,
                turn_rad: 1.0,
            },
        );
        assert!(tracker.variances[1].sqrt() > 0.024);
    }
}
