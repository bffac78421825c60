//! Changes the recorded course of an action, as if the robot or the object had moved otherwise.

use std::f64::consts::TAU;
use std::ops::Range;

use actcheck_data::{Samples, Series, Trace};

/// Designator of the object that the action handles.
const OBJECT: &str = "pickObject";
/// Acceleration of a falling object. Unit: m/s².
const GRAVITY: f64 = 9.81;
/// Height above its initial position from which an object counts as carried. Unit: metres.
const CARRIED_M: f64 = 0.03;

/// The recorded course of one action of a trace.
pub(super) struct Retouch<'a> {
    pub(super) trace: &'a mut Trace,
    step: usize,
    /// Id of the object that the action handles; empty if it handles none.
    pub(super) object: String,
}

impl<'a> Retouch<'a> {
    /// Returns `None` if the course of the action was not recorded.
    pub(super) fn new(trace: &'a mut Trace, step: usize) -> Option<Self> {
        let object = trace
            .actions
            .get(step)?
            .parameters
            .get(OBJECT)
            .and_then(|ids| ids.first())
            .cloned();
        let recorded = trace
            .robot_courses
            .get(step)
            .is_some_and(|course| course.samples.count > 1);
        recorded.then_some(Self {
            trace,
            step,
            object: object.unwrap_or_default(),
        })
    }

    fn samples(&self) -> &Samples {
        &self.trace.robot_courses[self.step].samples
    }

    /// Number of samples.
    pub(super) fn count(&self) -> usize {
        self.samples().count
    }

    /// Time between two samples. Unit: seconds.
    pub(super) fn period(&self) -> f64 {
        self.samples().period_secs
    }

    /// Number of samples in a duration.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "durations are positive and short"
    )]
    pub(super) fn ticks(&self, secs: f64) -> usize {
        (secs / self.period()).round().max(1.0) as usize
    }

    /// Returns a quantity at each sample.
    pub(super) fn get(&self, thing: &str, quantity: &str) -> Option<Vec<f64>> {
        let found = self
            .samples()
            .series
            .iter()
            .find(|one| one.is(thing, quantity));
        found.map(|series| series.values().collect())
    }

    /// Replaces a quantity.
    pub(super) fn put(&mut self, thing: &str, quantity: &str, values: &[f64]) {
        let series = &mut self.trace.robot_courses[self.step].samples.series;
        if let Some(series) = series.iter_mut().find(|one| one.is(thing, quantity)) {
            series.steps = values
                .iter()
                .map(|value| Series::steps_of(*value, series.steps_per_unit))
                .collect();
        }
    }

    /// Returns the position of an object or of the gripper at each sample.
    pub(super) fn position(&self, thing: &str) -> Option<Vec<[f64; 3]>> {
        let (x, y, z) = (
            self.get(thing, "x")?,
            self.get(thing, "y")?,
            self.get(thing, "z")?,
        );
        Some(
            (0..self.count())
                .map(|idx| [x[idx], y[idx], z[idx]])
                .collect(),
        )
    }

    /// Replaces the position of a thing; an object gets the velocity that follows.
    pub(super) fn move_to(&mut self, thing: &str, places: &[[f64; 3]]) {
        for (axis, (position, velocity)) in [("x", "vx"), ("y", "vy"), ("z", "vz")]
            .into_iter()
            .enumerate()
        {
            let (old, period) = (self.get(thing, position).unwrap_or_default(), self.period());
            let new: Vec<f64> = places.iter().map(|place| place[axis]).collect();
            let change =
                |values: &[f64], idx: usize| (values[idx] - values[idx.saturating_sub(1)]) / period;
            if let Some(recorded) = self.get(thing, velocity) {
                let faster: Vec<f64> = recorded
                    .iter()
                    .enumerate()
                    .map(|(idx, value)| value + change(&new, idx) - change(&old, idx))
                    .collect();
                self.put(thing, velocity, &faster);
            }
            self.put(thing, position, &new);
        }
    }

    /// Adds an offset along one axis to the positions of things.
    pub(super) fn shift(&mut self, things: &[&str], axis: usize, offset: &[f64]) -> Option<()> {
        for thing in things {
            let mut places = self.position(thing)?;
            places
                .iter_mut()
                .zip(offset)
                .for_each(|(place, offset)| place[axis] += offset);
            self.move_to(thing, &places);
        }
        Some(())
    }

    /// Adds an offset to quantities of the base, or to its belief only.
    pub(super) fn shift_base(&mut self, quantities: &[&str], offset: &[f64]) -> Option<()> {
        for quantity in quantities {
            let values = self.get("robot", quantity)?;
            let moved: Vec<f64> = values
                .iter()
                .zip(offset)
                .map(|(value, offset)| value + offset)
                .collect();
            self.put("robot", quantity, &moved);
        }
        Some(())
    }

    /// Whether both fingers touch the object, at each sample.
    pub(super) fn held(&self) -> Option<Vec<bool>> {
        Some(
            self.get(&self.object, "held")?
                .into_iter()
                .map(|held| held != 0.0)
                .collect(),
        )
    }

    /// Sets whether both fingers touch the object during some samples. Without them, no other link
    /// touches it.
    pub(super) fn hold(&mut self, during: Range<usize>, is_held: bool) -> Option<()> {
        let during = during.start..during.end.min(self.count());
        let object = self.object.clone();
        let mut held = self.get(&object, "held")?;
        held[during.clone()].fill(f64::from(u8::from(is_held)));
        self.put(&object, "held", &held);
        if !is_held {
            self.contacts()
                .for_each(|series| series.steps[during.clone()].fill(0));
        }
        Some(())
    }

    /// Sets the force of one of the contacts between the robot and the object. Returns `None` if
    /// there is none.
    pub(super) fn press(&mut self, during: Range<usize>, newtons: f64) -> Option<()> {
        let during = during.start..during.end.min(self.count());
        let series = self.contacts().next()?;
        series
            .steps
            .get_mut(during)?
            .fill(Series::steps_of(newtons, series.steps_per_unit));
        Some(())
    }

    fn contacts(&mut self) -> impl Iterator<Item = &mut Series> {
        let object = self.object.clone();
        let of_robot = move |series: &&mut Series| {
            let pair = [series.thing.as_str(), series.other.as_str()];
            series.quantity == "contactForce"
                && pair.contains(&object.as_str())
                && pair.iter().any(|thing| thing.starts_with("robot/"))
        };
        self.trace.robot_courses[self.step]
            .samples
            .series
            .iter_mut()
            .filter(of_robot)
    }

    /// First sample at which the robot touches the object.
    pub(super) fn first_touch(&mut self) -> Option<usize> {
        self.contacts()
            .filter_map(|series| series.steps.iter().position(|force| *force > 0))
            .min()
    }

    /// The sample in the middle of the time in which the object is held in the air.
    pub(super) fn carrying(&self) -> Option<usize> {
        let (held, places) = (self.held()?, self.position(&self.object)?);
        let is_carried = |idx: &usize| held[*idx] && places[*idx][2] - places[0][2] > CARRIED_M;
        let first = (0..held.len()).find(is_carried)?;
        let last = (first..held.len()).take_while(is_carried).last()?;
        Some(usize::midpoint(first, last))
    }

    /// The last sample at which the object is held. Returns `None` if it is held to the end.
    pub(super) fn release(&self) -> Option<usize> {
        let held = self.held()?;
        held.iter()
            .rposition(|held| *held)
            .filter(|last| last + 1 < held.len())
    }

    /// Lets the object fall from where it is at a sample, down to a height, where it stays.
    pub(super) fn drop(&mut self, from: usize, down_to: f64) -> Option<()> {
        let object = self.object.clone();
        let (mut places, period) = (self.position(&object)?, self.period());
        let start = places[from];
        for (idx, place) in places.iter_mut().enumerate().skip(from) {
            let secs = (idx - from) as f64 * period;
            *place = [
                start[0],
                start[1],
                (start[2] - GRAVITY / 2.0 * secs * secs).max(down_to),
            ];
        }
        self.move_to(&object, &places);
        // Nothing of its own motion is left: its speed is that of the fall.
        for (axis, velocity) in ["vx", "vy", "vz"].into_iter().enumerate() {
            let mut values = self.get(&object, velocity)?;
            for (idx, value) in values.iter_mut().enumerate().skip(from + 1) {
                *value = (places[idx][axis] - places[idx - 1][axis]) / period;
            }
            self.put(&object, velocity, &values);
        }
        self.hold(from..self.count(), false)
    }

    /// An offset that grows evenly during some samples and then stays.
    pub(super) fn ramp(&self, during: Range<usize>, height: f64) -> Vec<f64> {
        let length = during.len().max(1) as f64;
        let share = |idx: usize| (idx.saturating_sub(during.start) as f64 / length).min(1.0);
        (0..self.count()).map(|idx| height * share(idx)).collect()
    }

    /// An offset that swings out and back once, from a sample on.
    pub(super) fn swing(&self, from: usize, secs: f64, height: f64) -> Vec<f64> {
        let share = |idx: usize| (idx.saturating_sub(from) as f64 * self.period() / secs).min(1.0);
        (0..self.count())
            .map(|idx| height / 2.0 * (1.0 - libm::cos(TAU * share(idx))))
            .collect()
    }

    /// An offset that swings about zero during some samples.
    pub(super) fn sway(&self, during: Range<usize>, hertz: f64, height: f64) -> Vec<f64> {
        let secs = |idx: usize| (idx - during.start) as f64 * self.period();
        let at = |idx: usize| {
            if during.contains(&idx) {
                height * libm::sin(TAU * hertz * secs(idx))
            } else {
                0.0
            }
        };
        (0..self.count()).map(at).collect()
    }

    /// An offset along one axis that lengthens a path by at least a length, over the whole action,
    /// and ends at zero.
    pub(super) fn detour(&self, length: f64, height: f64) -> Vec<f64> {
        let last = self.count() - 1;
        let swings = (length / (4.0 * height)).ceil().max(1.0);
        (0..=last)
            .map(|idx| height * libm::sin(TAU * swings * idx as f64 / last as f64))
            .collect()
    }

    /// Lets every quantity stay as it was when the action began.
    pub(super) fn freeze(&mut self) {
        for series in &mut self.trace.robot_courses[self.step].samples.series {
            let first = series.steps.first().copied().unwrap_or(0);
            series.steps.fill(first);
        }
    }
}

/// Whether a series is that quantity of one thing.
trait Named {
    fn is(&self, thing: &str, quantity: &str) -> bool;
}

impl Named for Series {
    fn is(&self, thing: &str, quantity: &str) -> bool {
        self.thing == thing && self.other.is_empty() && self.quantity == quantity
    }
}

/// Distance of two points.
pub(super) fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    [0, 1, 2]
        .map(|axis| (a[axis] - b[axis]) * (a[axis] - b[axis]))
        .iter()
        .sum::<f64>()
        .sqrt()
}
