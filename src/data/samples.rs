//! Quantities of one action over time, at the control rate.

use actcheck_base::Steps;

/// The recorded quantities of one action. The first sample of each is the initial state.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Samples {
    /// Time between two samples. Unit: seconds.
    pub period_secs: f64,
    /// Number of samples of each series.
    pub count: usize,
    /// One series for each recorded quantity, in the order of recording.
    pub series: Vec<Series>,
}

/// One quantity over time, in steps of its resolution: rules that judge a new run and rules that
/// judge a stored one read the same numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Id of the object, `robot/LINK`, `robot`, `gripper`, `floor`, or `joint/NAME`.
    pub thing: String,
    /// For a quantity of two things, the id of the second; else empty.
    pub other: String,
    /// Local name of the quantity in the world vocabulary, such as `z`.
    pub quantity: String,
    /// Number of steps in one unit of the quantity.
    pub steps_per_unit: u32,
    /// The samples, as numbers of steps. Shape: count.
    pub steps: Steps,
}

/// Quantities with the number of their steps in one unit: 50,000 in a metre, a radian, or one; 2,000
/// in 1 m/s or 1 rad/s; 50 in 1 N or 1 N·m.
const RESOLUTIONS: [(&str, u32); 25] = [
    ("x", 50_000),
    ("y", 50_000),
    ("z", 50_000),
    ("qx", 50_000),
    ("qy", 50_000),
    ("qz", 50_000),
    ("qw", 50_000),
    ("opening", 50_000),
    ("baseX", 50_000),
    ("baseY", 50_000),
    ("baseYaw", 50_000),
    ("believedX", 50_000),
    ("believedY", 50_000),
    ("believedYaw", 50_000),
    ("position", 50_000),
    ("vx", 2_000),
    ("vy", 2_000),
    ("vz", 2_000),
    ("wx", 2_000),
    ("wy", 2_000),
    ("wz", 2_000),
    ("velocity", 2_000),
    ("effort", 50),
    ("contactForce", 50),
    ("held", 1),
];

impl Series {
    /// Returns the number of steps in one unit of a recorded quantity, or `None` if no quantity with
    /// this local name is recorded.
    pub fn resolution(quantity: &str) -> Option<u32> {
        RESOLUTIONS
            .iter()
            .find(|(name, _)| *name == quantity)
            .map(|(_, steps_per_unit)| *steps_per_unit)
    }

    /// Creates an empty series.
    pub fn new(thing: &str, other: &str, quantity: &str, steps_per_unit: u32) -> Self {
        let (thing, other, quantity) = (thing.to_owned(), other.to_owned(), quantity.to_owned());
        Self {
            thing,
            other,
            quantity,
            steps_per_unit,
            steps: Steps::default(),
        }
    }

    /// Creates an empty series of a recorded quantity, with the resolution of all our recordings: one
    /// step in a unit if no quantity with this local name is recorded.
    pub fn recorded(thing: &str, other: &str, quantity: &str) -> Self {
        let steps_per_unit = Self::resolution(quantity).unwrap_or(1);
        Self::new(thing, other, quantity, steps_per_unit)
    }

    /// Adds a sample in the quantity's unit.
    pub fn push(&mut self, value: f64) {
        self.steps.push(Self::steps_of(value, self.steps_per_unit));
    }

    /// Returns a value as a number of steps; values beyond the range become its ends, and NaN
    /// becomes 0.
    pub fn steps_of(value: f64, steps_per_unit: u32) -> i32 {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "the cast saturates, as the documentation says"
        )]
        let steps = (value * f64::from(steps_per_unit)).round() as i32;
        steps
    }

    /// Returns the samples in the quantity's unit.
    pub fn values(&self) -> impl ExactSizeIterator<Item = f64> + '_ {
        let per_unit = f64::from(self.steps_per_unit.max(1));
        self.steps
            .iter()
            .map(move |steps| f64::from(*steps) / per_unit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_the_nearest_decimals() {
        let mut series = Series::new("cup", "", "z", 10_000);
        series.steps = [0.3, -0.12345, f64::INFINITY, f64::NAN]
            .map(|value| Series::steps_of(value, 10_000))
            .into_iter()
            .collect();
        let values: Vec<f64> = series.values().collect();
        assert_eq!(values[..2], [0.3, -0.1235]);
        assert_eq!(values[2], f64::from(i32::MAX) / 1e4);
        assert_eq!(values[3], 0.0);
    }
}
