//! How fast a motion through postures may be: within the speeds and the efforts of the joints.

use actcheck_world::{Dynamics, Joint, JointKind, Kinematics};

/// Share of a joint's velocity limit that skills use, so that the controller can catch up.
const SPEED_SHARE: f64 = 0.9;
/// Speeds that skills don't exceed however fast the motors are: those of fast industrial arms. In a
/// control tick, a joint then moves less than the lag at which it counts as held back. Units: m/s,
/// rad/s.
const MOST_SPEEDS: [f64; 2] = [1.0, 3.5];
/// Peak over mean speed of a motion that starts and ends at rest (of 3s² − 2s³).
const PEAK_OVER_MEAN: f64 = 1.5;
/// How far a joint may fall behind where a path turns: a third of the lag at which it is held back.
/// Units: metres, radians.
const LAGS: [f64; 2] = [0.01, 0.03];
/// Moments of a motion at which its efforts are calculated.
const N_MOMENTS: usize = 24;
/// Share of the effort that the weight of the arm leaves, for the motion: the rest is for the
/// controller, which corrects errors.
const EFFORT_SHARE: f64 = 0.4;
/// Least share of a joint's largest effort that counts as left by the weight of the arm.
const LEAST_LEFT: f64 = 0.2;
/// Factors by which a motion that needs too much effort is slowed down, again and again.
const LEAST_SLOWING: f64 = 1.05;
const MOST_SLOWING: f64 = 1.5;
/// A motion that is still too fast after so many times is made as it is.
const MOST_TRIES: usize = 40;

/// A path through postures, with straight legs in joint space.
pub(crate) struct Course {
    postures: Vec<Vec<f64>>,
    /// Shortest time of each leg at the joints' velocity limits. Unit: seconds.
    legs: Vec<f64>,
    /// Their sum. Unit: seconds.
    shortest: f64,
}

impl Course {
    pub(crate) fn new(postures: Vec<Vec<f64>>, kinematics: &Kinematics) -> Self {
        let legs: Vec<f64> = postures
            .windows(2)
            .map(|pair| leg_secs(kinematics, &pair[0], &pair[1]))
            .collect();
        Self {
            shortest: legs.iter().sum(),
            postures,
            legs,
        }
    }

    /// The time of the motion from rest to rest: at least `least_secs`, and long enough for the
    /// speeds of all joints, and for the efforts of `joints`. Unit: seconds.
    ///
    /// Motors of many robots are far faster than their efforts accelerate the arm.
    pub(crate) fn secs(
        &self,
        kinematics: &Kinematics,
        joints: &[usize],
        least_secs: f64,
        tick_secs: f64,
    ) -> f64 {
        let by_speed = (self.shortest * PEAK_OVER_MEAN / SPEED_SHARE).max(least_secs);
        if by_speed <= 0.0 {
            return by_speed;
        }
        let moments: Vec<MotionSample> = (0..=N_MOMENTS)
            .map(|idx| self.moment(kinematics, by_speed, share_of(idx)))
            .collect();
        let mut secs = by_speed;
        for _ in 0..MOST_TRIES {
            let needed = self.needed(kinematics, &moments, joints, (secs, by_speed), tick_secs);
            if needed <= 1.0 {
                break;
            }
            secs *= needed.sqrt().clamp(LEAST_SLOWING, MOST_SLOWING);
        }
        secs
    }

    /// The posture at a time of a motion that takes `secs`. Before and after it, the robot is at
    /// rest.
    pub(crate) fn at(&self, time: f64, secs: f64) -> Vec<f64> {
        let s = (time / secs).clamp(0.0, 1.0);
        along(
            &self.postures,
            &self.legs,
            self.shortest * s * s * (3.0 - 2.0 * s),
        )
    }

    /// The dynamics of the robot at a share of a motion that takes `secs`.
    fn moment(&self, kinematics: &Kinematics, secs: f64, share: f64) -> MotionSample {
        let (time, step) = (share * secs, secs / 1e3);
        let (before, after) = (self.at(time - step, secs), self.at(time + step, secs));
        let velocities: Vec<f64> = after
            .iter()
            .zip(&before)
            .map(|(a, b)| (a - b) / (2.0 * step))
            .collect();
        MotionSample {
            share,
            dynamics: kinematics.dynamics(&self.at(time, secs), &velocities),
        }
    }

    /// The largest effort of the joints in a motion that takes `secs`, as a multiple of the effort
    /// that they have for it. The velocities of the moments are those of a motion that takes
    /// `known_secs`.
    fn needed(
        &self,
        kinematics: &Kinematics,
        moments: &[MotionSample],
        joints: &[usize],
        (secs, known_secs): (f64, f64),
        tick_secs: f64,
    ) -> f64 {
        let window = self.window_secs(kinematics, joints, secs).max(tick_secs);
        let slower = (known_secs / secs) * (known_secs / secs);
        let mut most = 0.0_f64;
        for MotionSample { share, dynamics } in moments {
            let time = share * secs;
            let [before, now, after] =
                [time - window, time, time + window].map(|time| self.at(time, secs));
            let accelerations: Vec<f64> = before
                .iter()
                .zip(now.iter().zip(&after))
                .map(|(before, (now, after))| (before - 2.0 * now + after) / (window * window))
                .collect();
            for idx in joints {
                let limit = kinematics.joints()[*idx].effort;
                let needed = dynamics.effort_to_accelerate(*idx, &accelerations)
                    + slower * dynamics.effort_of_velocity(*idx);
                let free = (limit - dynamics.holding_effort(*idx).abs()).max(LEAST_LEFT * limit);
                most = most.max(needed.abs() / (EFFORT_SHARE * free));
            }
        }
        most
    }

    /// The time over which the joints may change their velocities where the path turns: a path that
    /// is averaged over it leaves the corner by an eighth of the way of that time. Unit: seconds.
    fn window_secs(&self, kinematics: &Kinematics, joints: &[usize], secs: f64) -> f64 {
        let fastest = PEAK_OVER_MEAN * self.shortest / secs;
        let legs = self
            .postures
            .windows(2)
            .zip(&self.legs)
            .filter(|(_, leg)| **leg > 0.0);
        let windows = legs.flat_map(|(pair, leg)| {
            joints.iter().map(move |idx| {
                let speed = fastest * (pair[1][*idx] - pair[0][*idx]).abs() / leg;
                8.0 * of_kind(LAGS, &kinematics.joints()[*idx]) / speed.max(1e-9)
            })
        });
        windows.fold(secs / 8.0, f64::min)
    }
}

/// A moment of a motion.
struct MotionSample {
    /// Share of the motion's time.
    share: f64,
    dynamics: Dynamics,
}

fn share_of(idx: usize) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "both numbers are small")]
    let share = idx as f64 / N_MOMENTS as f64;
    share
}

/// Shortest time between two postures at the joints' velocity limits. Unit: seconds.
fn leg_secs(kinematics: &Kinematics, from: &[f64], to: &[f64]) -> f64 {
    let joints = kinematics.joints().iter().zip(from.iter().zip(to));
    joints
        .map(|(joint, (a, b))| {
            (b - a).abs() / joint.velocity.clamp(1e-3, of_kind(MOST_SPEEDS, joint))
        })
        .fold(0.0, f64::max)
}

/// The value for a joint that slides, or that for one that turns.
fn of_kind(values: [f64; 2], joint: &Joint) -> f64 {
    values[usize::from(joint.kind == JointKind::Revolute)]
}

/// The posture at a time along a path whose legs take the given times at full speed.
fn along(course: &[Vec<f64>], legs: &[f64], mut time: f64) -> Vec<f64> {
    for (pair, leg) in course.windows(2).zip(legs) {
        if time <= *leg && *leg > 0.0 {
            let share = time / leg;
            return pair[0]
                .iter()
                .zip(&pair[1])
                .map(|(a, b)| a + (b - a) * share)
                .collect();
        }
        time -= leg;
    }
    course.last().cloned().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_base::{Files, Source};
    use actcheck_data::RobotStart;
    use actcheck_world::{Layout, geometry};
    use std::path::Path;
    use std::sync::Arc;

    const TICK_SECS: f64 = 1.0 / 60.0;

    /// The fixed arm; if `is_fast`, with fast motors, and a weak one for its first joint.
    fn arm(is_fast: bool) -> (Kinematics, Layout, Vec<f64>) {
        let path = Path::new("models/robots/fixed_arm.toml");
        let mut profile = actcheck_config::robot::read(&Files::Shipped, path)
            .expect("the shipped robot is valid")
            .complete()
            .expect("it states all roles");
        if is_fast {
            let fast = ["1.7", "2.2", "2.6"]
                .iter()
                .fold(profile.core.urdf.text.to_string(), |text, speed| {
                    text.replace(&format!("velocity=\"{speed}\""), "velocity=\"25\"")
                });
            let fast = fast.replacen("effort=\"120\"", "effort=\"10\"", 1);
            let fast = Source::new("fast.urdf", fast);
            profile.core =
                actcheck_config::robot::with_urdf(profile.core, fast).expect("it is a URDF");
        }
        let start = RobotStart {
            profile: Arc::new(profile),
            base: [0.0; 3],
            root_height_m: 0.0,
            knows: Arc::new([]),
        };
        geometry(&start).expect("the robot is valid")
    }

    /// The path whose arm joints turn by these angles from home, one after the other.
    fn course(
        kinematics: &Kinematics,
        layout: &Layout,
        home: &[f64],
        turns: &[(usize, f64)],
    ) -> Course {
        let mut postures = vec![home.to_vec()];
        for (joint, turn) in turns {
            let mut next = postures.last().cloned().unwrap_or_default();
            next[layout.arm[*joint]] += turn;
            postures.push(next);
        }
        Course::new(postures, kinematics)
    }

    #[test]
    fn strong_motors_are_limited_by_their_speeds_alone() {
        let (kinematics, layout, home) = arm(false);
        let way = course(
            &kinematics,
            &layout,
            &home,
            &[(0, 0.8), (1, 0.3), (3, -0.4)],
        );
        let secs = way.secs(&kinematics, &layout.arm, 0.0, TICK_SECS);
        assert!(
            (secs - (0.8 + 0.3 + 0.4) / 1.7 * 1.5 / 0.9).abs() < 1e-9,
            "{secs}"
        );
        assert!((way.secs(&kinematics, &layout.arm, 5.0, TICK_SECS) - 5.0).abs() < 1e-9);
    }

    /// A turn by an angle A from rest to rest in the time T accelerates by at most 6 A / T², at its
    /// ends.
    #[test]
    fn fast_motors_are_limited_by_their_efforts() {
        let (kinematics, layout, home) = arm(true);
        let yaw = layout.arm[0];
        let still = vec![0.0; home.len()];
        let mut unit = still.clone();
        unit[yaw] = 1.0;
        let inertia = kinematics
            .dynamics(&home, &still)
            .effort_to_accelerate(yaw, &unit);
        let effort = kinematics.joints()[yaw].effort;
        let expected = (6.0 * 0.3 * inertia / (EFFORT_SHARE * effort)).sqrt();
        let way = course(&kinematics, &layout, &home, &[(0, 0.3)]);
        let secs = way.secs(&kinematics, &layout.arm, 0.0, TICK_SECS);
        assert!(
            (secs / expected - 1.0).abs() < 0.15,
            "{secs} s instead of {expected}"
        );
        // A corner takes its time, too.
        let [one, both] = [&[(0, 0.3)][..], &[(0, 0.3), (1, 0.3)]].map(|turns| {
            course(&kinematics, &layout, &home, turns).secs(
                &kinematics,
                &layout.arm,
                0.0,
                TICK_SECS,
            )
        });
        assert!(both > 1.5 * one, "{both} s instead of {one}");
    }
}
