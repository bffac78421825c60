//! How fast a motion through postures may be: within the speeds and the efforts of the joints.

use actcheck_world::{Dynamics, Joint, JointKind, Kinematics};

/// Share of a joint's velocity limit that skills use, so that the controller can catch up.
const SPEED_SHARE: f64 = 0.9;
/// Speeds that skills don't exceed however fast the motors are, as arms of industry: a joint that goes farther in a control tick than it
/// may fall behind can't be watched. Units: m/s, rad/s.
const MOST_SPEEDS: [f64; 2] = [1.0, 3.5];
/// Peak over mean speed of a motion that starts and ends at rest (of 3s² − 2s³).
const PEAK_OVER_MEAN: f64 = 1.5;
/// How far a joint may fall behind where a path turns: a third of the lag at which it is held back. Units: metres, radians.
const LAGS: [f64; 2] = [0.01, 0.03];
/// Moments of a motion at which its efforts are calculated.
const N_MOMENTS: usize = 24;
/// Share of the effort beyond that for the weight of the arm that a motion may need: the rest is for the controller, which corrects
/// errors.
const EFFORT_SHARE: f64 = 0.4;
/// Least share of a joint's largest effort that counts as left by the weight that it holds.
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
        let legs: Vec<f64> = postures.windows(2).map(|pair| leg_secs(kinematics, &pair[0], &pair[1])).collect();
        Self { shortest: legs.iter().sum(), postures, legs }
    }

    /// The time of the motion from rest to rest: at least `least_secs`, and long enough for the speeds of all joints, and for
    /// the efforts of `joints`. Unit: seconds.
    ///
    /// Motors of many robots are far faster than their efforts accelerate the arm.
    pub(crate) fn secs(&self, kinematics: &Kinematics, joints: &[usize], least_secs: f64, tick_secs: f64) -> f64 {
        let by_speed = (self.shortest * PEAK_OVER_MEAN / SPEED_SHARE).max(least_secs);
        if by_speed <= 0.0 {
            return by_speed;
        }
        let moments: Vec<Moment> =
            (0..=N_MOMENTS).map(|idx| self.moment(kinematics, by_speed, share_of(idx))).collect();
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

    /// The posture at a time of a motion that takes `secs`. Before and after it, the robot is at rest.
    pub(crate) fn at(&self, time: f64, secs: f64) -> Vec<f64> {
        let s = (time / secs).clamp(0.0, 1.0);
        along(&self.postures, &self.legs, self.shortest * s * s * (3.0 - 2.0 * s))
    }

    /// The dynamics of the robot at a share of a motion that takes `secs`.
    fn moment(&self, kinematics: &Kinematics, secs: f64, share: f64) -> Moment {
        let (time, step) = (share * secs, secs / 1e3);
        let (before, after) = (self.at(time - step, secs), self.at(time + step, secs));
        let velocities: Vec<f64> = after.iter().zip(&before).map(|(a, b)| (a - b) / (2.0 * step)).collect();
        Moment { share, dynamics: kinematics.dynamics(&self.at(time, secs), &velocities) }
    }

    /// The largest effort of the joints in a motion that takes `secs`, as a multiple of the effort that they have for it. The
    /// velocities of the moments are those of a motion that takes `known_secs`.
    fn needed(
        &self,
        kinematics: &Kinematics,
        moments: &[Moment],
        joints: &[usize],
        (secs, known_secs): (f64, f64),
        tick_secs: f64,
    ) -> f64 {
        let window = self.window_secs(kinematics, joints, secs).max(tick_secs);
        let slower = (known_secs / secs) * (known_secs / secs);
        let mut most = 0.0_f64;
        for Moment { share, dynamics } in moments {
            let time = share * secs;
            let [before, now, after] = [time - window, time, time + window].map(|time| self.at(time, secs));
            let accelerations: Vec<f64> = before
                .iter()
                .zip(now.iter().zip(&after))
                .map(|(before, (now, after))| (before - 2.0 * now + after) / (window * window))
                .collect();
            for idx in joints {
                let limit = kinematics.joints()[*idx].effort;
                let needed = dynamics.effort_to_accelerate(*idx, &accelerations) + slower * dynamics.effort_of_velocity(*idx);
                let free = (limit - dynamics.holding_effort(*idx).abs()).max(LEAST_LEFT * limit);
                most = most.max(needed.abs() / (EFFORT_SHARE * free));
            }
        }
        most
    }

    /// The time over which the joints may change their velocities where the path turns: a path that is averaged over it leaves
    /// the corner by an eighth of the way of that time. Unit: seconds.
    fn window_secs(&self, kinematics: &Kinematics, joints: &[usize], secs: f64) -> f64 {
        let fastest = PEAK_OVER_MEAN * self.shortest / secs;
        let legs = self.postures.windows(2).zip(&self.legs).filter(|(_, leg)| **leg > 0.0);
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
struct Moment {
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
    joints.map(|(joint, (a, b))| (b - a).abs() / joint.velocity.clamp(1e-3, of_kind(MOST_SPEEDS, joint))).fold(0.0, f64::max)
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
            return pair[0].iter().zip(&pair[1]).map(|(a, b)| a + (b - a) * share).collect();
        }
        time -= leg;
    }
    course.last().cloned().unwrap_or_default()
}
