//! Search strategies: samples to the first counterexample, and accuracy of the estimated failure
//! rate.
//!
//! Failure regions of known volume are planted in 8 dimensions: a connected one with a margin that
//! leads to it, two disjoint ones, one with a margin that leads away from it (deceptive), and one
//! with a constant margin (flat). `benches/search_peers.py` runs VerifAI and Hypothesis on the same
//! functions and prints the same columns. Run with `cargo bench --bench search -- 200` for 200
//! seeds; the default is 60. `-- points` prints values of the functions, with which the script
//! checks its own.

use actcheck::search::{Dimension, GENERATION, PropertyResult, Search, Space, Strategy};

const WIDTH: usize = 8;

/// Maximum number of samples of a search. Random sampling needs more for 0.25 % of the seeds.
const MOST_SAMPLES: usize = 10_000;

/// Number of samples after which the rate is compared with the volume.
const RATE_SAMPLES: usize = 2_000;

/// Powers of the inverse of the real root of x⁹ = x + 1, whose multiples have low discrepancy in a
/// cube (Roberts, 2018).
const STEPS: [f64; WIDTH] = [
    0.921_599_319_633_983,
    0.849_345_305_949_820,
    0.782_756_056_097_671,
    0.721_387_448_738_994,
    0.664_830_181_950_351,
    0.612_707_043_357_581,
    0.564_670_394_293_296,
    0.520_399_851_198_154,
];

const VOLUMES: [f64; 2] = [0.01, 0.0006];

#[derive(Clone, Copy, PartialEq)]
enum Shape {
    Smooth,
    Disjoint,
    Deceptive,
    Flat,
}

const SHAPES: [(Shape, &str); 4] = [
    (Shape::Smooth, "smooth"),
    (Shape::Disjoint, "disjoint"),
    (Shape::Deceptive, "deceptive"),
    (Shape::Flat, "flat"),
];

/// A planted region: shape, volume, and the seed of its position.
#[derive(Clone, Copy)]
struct Planted {
    shape: Shape,
    volume: f64,
    seed: u64,
}

impl Planted {
    /// A number in [0, 1) for an axis.
    fn placed(&self, axis: usize, which: u64) -> f64 {
        ((2 * self.seed + which + 1) as f64 * STEPS[axis]).fract()
    }

    /// Returns the margin, and the failing region that contains the point, if any.
    fn margin(&self, point: &[f64]) -> (f64, Option<usize>) {
        if self.shape == Shape::Disjoint {
            let boxes = [self.box_margin(point, 0), self.box_margin(point, 1)];
            let nearest = usize::from(boxes[1] < boxes[0]);
            return (boxes[nearest], (boxes[nearest] < 0.0).then_some(nearest));
        }
        let (radius, centre) = self.ball();
        let depth = distance(point, &centre) - radius;
        let margin = match self.shape {
            Shape::Deceptive if depth >= 0.0 => {
                let decoy = centre.map(|value| if value < 0.5 { 0.9 } else { 0.1 });
                0.05 + distance(point, &decoy)
            }
            Shape::Flat if depth >= 0.0 => 1.0,
            _ => depth,
        };
        (margin, (depth < 0.0).then_some(0))
    }

    /// Radius and centre of a ball of this volume inside the cube. The volume of the unit ball in 8
    /// dimensions is π⁴/24.
    fn ball(&self) -> (f64, [f64; WIDTH]) {
        let radius = (self.volume * 24.0 / std::f64::consts::PI.powi(4)).powf(1.0 / 8.0);
        (
            radius,
            std::array::from_fn(|axis| radius + (1.0 - 2.0 * radius) * self.placed(axis, 0)),
        )
    }

    /// Signed distance from one of two boxes of half the volume each, separated along the first
    /// axis.
    fn box_margin(&self, point: &[f64], which: u64) -> f64 {
        let half = (self.volume / 2.0 / 0.4).powf(1.0 / 7.0) / 2.0;
        let (mut outside, mut inside) = (0.0, f64::NEG_INFINITY);
        for (axis, value) in point.iter().enumerate() {
            let (centre, half) = if axis == 0 {
                (0.25 + 0.5 * which as f64, 0.2)
            } else {
                (half + (1.0 - 2.0 * half) * self.placed(axis, which), half)
            };
            let past = (value - centre).abs() - half;
            outside += past.max(0.0).powi(2);
            inside = inside.max(past);
        }
        if outside > 0.0 {
            outside.sqrt()
        } else {
            inside
        }
    }
}

fn distance(a: &[f64], b: &[f64; WIDTH]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b) * (a - b))
        .sum::<f64>()
        .sqrt()
}

/// The result of one search.
struct Outcome {
    first: usize,
    /// Number of regions with at least one failing sample among the first [`RATE_SAMPLES`].
    regions: usize,
    covered: bool,
    rate: f64,
}

fn search(planted: Planted, strategy: Strategy) -> Outcome {
    let space = Space::new([Dimension::Continuous; WIDTH]);
    let mut search = Search::new(space, strategy, planted.seed);
    let (mut samples, mut first) = (0, None);
    let mut seen = [false; 2];
    let (mut covered, mut rate) = (false, 0.0);
    while samples < RATE_SAMPLES || (first.is_none() && samples < MOST_SAMPLES) {
        for ask in search.ask(GENERATION) {
            samples += 1;
            let (margin, region) = planted.margin(&ask.point);
            if let Some(region) = region {
                first.get_or_insert(samples);
                seen[region] |= samples <= RATE_SAMPLES;
            }
            search.tell(vec![PropertyResult {
                failed: margin < 0.0,
                margin: Some(margin),
            }]);
        }
        if samples == RATE_SAMPLES {
            let estimate = search.estimates()[0].expect("the search has results");
            covered = (estimate.low..=estimate.high).contains(&planted.volume);
            rate = estimate.rate;
        }
    }
    Outcome {
        first: first.unwrap_or(MOST_SAMPLES),
        regions: seen.iter().filter(|seen| **seen).count(),
        covered,
        rate,
    }
}

fn median(mut values: Vec<usize>) -> usize {
    values.sort_unstable();
    values[values.len() / 2]
}

fn compare(shape: Shape, name: &str, volume: f64, seeds: u64) {
    let mut random = None;
    for strategy in Strategy::ALL {
        let outcomes: Vec<Outcome> = (0..seeds)
            .map(|seed| {
                search(
                    Planted {
                        shape,
                        volume,
                        seed,
                    },
                    strategy,
                )
            })
            .collect();
        let mean = |value: &dyn Fn(&Outcome) -> f64| {
            outcomes.iter().map(value).sum::<f64>() / outcomes.len() as f64
        };
        let first = median(outcomes.iter().map(|outcome| outcome.first).collect());
        let random = *random.get_or_insert(first);
        println!(
            "{name:<10} {:>5.2} %  {:<16} {first:>6} {:>6.2} {:>8.2} {:>9.0} % {:>10.4} %",
            volume * 100.0,
            strategy.name(),
            first as f64 / random as f64,
            mean(&|outcome| outcome.regions as f64),
            100.0 * mean(&|outcome| f64::from(u8::from(outcome.covered))),
            100.0 * mean(&|outcome| outcome.rate),
        );
    }
}

/// Prints values of every function at some points, one per line, to check implementations in other
/// languages.
fn print_points() {
    for (shape, name) in SHAPES {
        for volume in VOLUMES {
            for seed in 0..20_u64 {
                let planted = Planted {
                    shape,
                    volume,
                    seed,
                };
                let (_, centre) = planted.ball();
                // Half of the points are near the centre of the ball, so that some of them fail.
                let near = |axis: usize| {
                    let random = ((seed + 3) as f64 * STEPS[axis] * 7.0).fract();
                    if seed % 2 == 0 {
                        random
                    } else {
                        centre[axis] + 0.1 * (random - 0.5)
                    }
                };
                let point: [f64; WIDTH] = std::array::from_fn(near);
                let numbers: Vec<String> = point.iter().map(f64::to_string).collect();
                println!(
                    "{name} {volume} {seed} {} {}",
                    planted.margin(&point).0,
                    numbers.join(" ")
                );
            }
        }
    }
}

fn main() {
    // Cargo passes `--bench`.
    let arguments: Vec<String> = std::env::args()
        .skip(1)
        .filter(|argument| !argument.starts_with("--"))
        .collect();
    if arguments.iter().any(|argument| argument == "points") {
        return print_points();
    }
    let seeds = arguments
        .iter()
        .find_map(|argument| argument.parse().ok())
        .unwrap_or(60);
    println!("{seeds} seeds; rate and regions after {RATE_SAMPLES} samples");
    println!(
        "function    volume  strategy          median  ratio  regions  in interval    mean rate"
    );
    for (shape, name) in SHAPES {
        for volume in VOLUMES {
            compare(shape, name, volume, seeds);
        }
    }
}
