//! Made-up runs with known failure conditions: pattern mining must find exactly these.

use std::f64::consts::PI;

use actcheck::analysis::{Condition, Parameter, PatternInput, Values};

/// Kinds of objects with their ancestors, the nearest first.
pub const KINDS: [(&str, &[&str]); 8] = [
    ("Bottle", &["Container", "Graspable"]),
    ("Bowl", &["Container", "Graspable"]),
    ("Box", &["Container", "Graspable"]),
    ("Fork", &["Cutlery", "Tableware", "Graspable"]),
    ("Glass", &["Cup", "Container", "Graspable"]),
    ("Mug", &["Cup", "Container", "Graspable"]),
    ("Plate", &["Tableware", "Graspable"]),
    ("Spoon", &["Cutlery", "Tableware", "Graspable"]),
];
const SURFACES: [&str; 4] = ["coffee_table", "dining_table", "shelf", "table"];
const WORLDS: [&str; 3] = ["apartment", "lab", "room"];

/// Numbers with their ranges; all are uniform.
const NUMBERS: [(&str, f64, f64); 8] = [
    ("target_friction", 0.2, 1.0),
    ("target_mass_kg", 0.05, 1.2),
    ("target_yaw_rad", -PI, PI),
    ("target_surface_x_m", -0.6, 0.6),
    ("target_surface_y_m", -0.4, 0.4),
    ("robot_distance_m", 0.5, 1.1),
    ("position_noise_m", 0.0, 0.03),
    ("neighbour_distance_m", 0.05, 0.9),
];
/// The largest number of surrounding objects.
const MOST_OTHERS: u64 = 6;

pub const CATEGORY: usize = 0;
pub const SURFACE: usize = 1;
pub const OTHERS: usize = 3;
pub const FRICTION: usize = 4;
pub const YAW: usize = 6;
pub const X: usize = 7;

/// Failure rates without and with a planted pattern.
pub const ELSEWHERE: f64 = 0.08;
pub const WITHIN: f64 = 0.6;

/// A deterministic pseudo-random generator.
pub struct Dice(u64);

impl Dice {
    pub fn new(seed: u64) -> Self {
        Self(
            seed.wrapping_mul(0x9E37_79B9_7F4A_7C15)
                .wrapping_add(0x1234_5678_9ABC_DEF1),
        )
    }

    /// SplitMix64 (Steele, Lea and Flood, 2014).
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// A number from 0 to 1.
    pub fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn below(&mut self, count: u64) -> u64 {
        self.next() % count
    }
}

/// Runs with twelve parameters that fail more often if one of the patterns holds.
pub fn input(runs: usize, seed: u64, planted: &[Vec<Condition>]) -> PatternInput {
    let mut dice = Dice::new(seed);
    let mut parameters = vec![
        kinds(
            "target_category",
            KINDS.len(),
            |kind| KINDS[kind],
            runs,
            &mut dice,
        ),
        kinds(
            "surface",
            SURFACES.len(),
            |kind| (SURFACES[kind], &[]),
            runs,
            &mut dice,
        ),
        kinds(
            "world",
            WORLDS.len(),
            |kind| (WORLDS[kind], &[]),
            runs,
            &mut dice,
        ),
        numbers(
            "others",
            None,
            (0..runs)
                .map(|_| dice.below(MOST_OTHERS + 1) as f64)
                .collect(),
        ),
    ];
    for (name, low, high) in NUMBERS {
        let unit = name.rsplit_once('_').map(|(_, unit)| unit.to_owned());
        parameters.push(numbers(
            name,
            unit,
            (0..runs)
                .map(|_| low + (high - low) * dice.share())
                .collect(),
        ));
    }
    // Without surrounding objects there is no nearest distance.
    if let (Values::Numbers(others), rest) = (
        parameters[OTHERS].values.clone(),
        parameters.last_mut().unwrap(),
    ) {
        let Values::Numbers(distances) = &mut rest.values else {
            unreachable!("they are numbers")
        };
        distances
            .iter_mut()
            .zip(others)
            .filter(|(_, others)| *others == 0.0)
            .for_each(|(distance, _)| *distance = f64::NAN);
    }
    let held_out = (0..runs).map(|_| dice.below(3) == 0).collect();
    let mut input = PatternInput {
        failed: vec![false; runs],
        held_out,
        parameters,
        ..PatternInput::default()
    };
    let mut within = vec![false; runs];
    for conditions in planted {
        let mut all = vec![true; runs];
        for condition in conditions {
            all.iter_mut()
                .zip(condition.holds(&input))
                .for_each(|(all, holds)| *all &= holds);
        }
        within
            .iter_mut()
            .zip(all)
            .for_each(|(within, all)| *within |= all);
    }
    input.failed = within
        .iter()
        .map(|within| dice.share() < if *within { WITHIN } else { ELSEWHERE })
        .collect();
    input
}

/// The same runs with randomly permuted failures.
pub fn shuffled(input: &PatternInput, seed: u64) -> PatternInput {
    let mut dice = Dice::new(seed);
    let mut failed = input.failed.clone();
    for at in (1..failed.len()).rev() {
        failed.swap(at, dice.below(at as u64 + 1) as usize);
    }
    PatternInput {
        failed,
        ..input.clone()
    }
}

fn kinds(
    name: &str,
    count: usize,
    kind: impl Fn(usize) -> (&'static str, &'static [&'static str]),
    runs: usize,
    dice: &mut Dice,
) -> Parameter {
    let values = Values::Kinds {
        of_run: (0..runs)
            .map(|_| Some(dice.below(count as u64) as u32))
            .collect(),
        names: (0..count).map(|place| kind(place).0.to_owned()).collect(),
        above: (0..count)
            .map(|place| {
                kind(place)
                    .1
                    .iter()
                    .map(|name| (*name).to_owned())
                    .collect()
            })
            .collect(),
    };
    Parameter {
        name: name.to_owned(),
        unit: None,
        values,
    }
}

fn numbers(name: &str, unit: Option<String>, numbers: Vec<f64>) -> Parameter {
    let wraps = name.ends_with("_yaw_rad");
    let values = if wraps {
        Values::Angles(numbers)
    } else {
        Values::Numbers(numbers)
    };
    Parameter {
        name: name.to_owned(),
        unit,
        values,
    }
}

pub fn kind(parameter: usize, kind: &str) -> Condition {
    Condition::Kind {
        parameter,
        kind: kind.to_owned(),
    }
}

pub fn range(parameter: usize, low: Option<f64>, high: Option<f64>) -> Condition {
    Condition::Range {
        parameter,
        low,
        high,
    }
}

pub fn arc(parameter: usize, from: f64, to: f64) -> Condition {
    Condition::Arc {
        parameter,
        from,
        to,
    }
}

/// The planted patterns, by name: each alone, and all at once.
pub fn plantings() -> Vec<(&'static str, Vec<Vec<Condition>>)> {
    let single = vec![kind(SURFACE, "shelf")];
    let conjunction = vec![kind(CATEGORY, "Bottle"), range(FRICTION, None, Some(0.35))];
    let band = vec![range(YAW, Some(0.5), Some(1.2))];
    let turned_away = vec![arc(YAW, 2.5, -2.5)];
    let higher = vec![kind(CATEGORY, "Cup")];
    let three = vec![
        kind(CATEGORY, "Tableware"),
        range(OTHERS, Some(4.0), None),
        range(X, None, Some(-0.1)),
    ];
    vec![
        ("single", vec![single.clone()]),
        ("conjunction", vec![conjunction.clone()]),
        ("band", vec![band.clone()]),
        ("arc", vec![turned_away]),
        ("higher kind", vec![higher.clone()]),
        ("three conditions", vec![three.clone()]),
        (
            "all at once",
            vec![single, conjunction, band, higher, three],
        ),
    ]
}
