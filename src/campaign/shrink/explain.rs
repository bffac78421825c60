//! Explains a failing list: the choices that matter, the failing range of each, and the nearest
//! passing list.

use crate::shrink::list::{ids, is_nominal, spread, with_value};
use crate::shrink::{Id, ShrinkPlan, TrialSearch, TryResult};
use actcheck_data::{Choice, ChoiceKind};

/// Bisections between a failing and a passing value: the gap shrinks to an eighth.
const HALVINGS: usize = 3;
/// Noise is drawn within this many standard deviations of 0.
const FARTHEST_SIGMAS: f64 = 4.0;
/// Tried values have four decimals, as they are printed, wherever these are fine enough.
const STEPS_PER_UNIT: f64 = 1e4;

/// The influence of one choice with all others fixed.
#[derive(Debug, Clone, PartialEq)]
pub struct Influence {
    /// The choice.
    pub id: Id,
    /// Its kind and its value in the failing list.
    pub choice: Choice,
    /// Whether the list no longer fails as required with the nominal value; `None` if limits ended
    /// the search first.
    pub matters: Option<bool>,
    /// The list fails at both of these values and at every tried value in between. In the unit of
    /// the choice.
    pub fails: (f64, f64),
    /// The nearest values below and above with which the list was tried and passed; `None` if none
    /// was found.
    pub passes: (Option<Passing>, Option<Passing>),
}

/// A value with which a list was tried and passed.
#[derive(Debug, Clone, PartialEq)]
pub struct Passing {
    /// The value, exactly as it was tried.
    pub value: f64,
    /// Names of other properties that fail there, if only one property was asked for.
    pub others: Vec<String>,
}

/// The nearest passing list, which differs in one choice.
#[derive(Debug, Clone, PartialEq)]
pub struct Neighbour {
    /// The choice.
    pub id: Id,
    /// Its passing value.
    pub passing: Passing,
    /// Distance from the failing value, as a share of the choice's spread.
    pub distance: f64,
}

/// The explanation of a failing list.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Explained {
    /// Choices that are not nominal, in order.
    pub influences: Vec<Influence>,
    /// The nearest passing list.
    pub neighbour: Option<Neighbour>,
}

/// An interval between a value that fails as required and one that does not, or the end of the
/// choice's range.
struct Bracket {
    /// Position of the influence.
    of: usize,
    fails: f64,
    /// The nearest value that does not fail as required; `None` until the end was tried.
    beyond: Option<f64>,
    /// The nearest value that passes. It may be farther than `beyond`, where the list fails in
    /// another way.
    passes: Option<Passing>,
    end: f64,
    /// Whether the choice has values in between.
    continuous: bool,
    open: bool,
}

/// Explains a failing list by changing one choice at a time.
pub fn explain(search: &mut TrialSearch<'_>, list: &[Choice], plan: &ShrinkPlan<'_>) -> Explained {
    let special = ids(list)
        .into_iter()
        .filter(|(id, choice)| !is_nominal(choice) && (plan.group)(list, &id.name).is_some());
    let mut influences: Vec<Influence> = special
        .map(|(id, choice)| Influence {
            id,
            choice: choice.clone(),
            matters: None,
            fails: (choice.value, choice.value),
            passes: (None, None),
        })
        .collect();
    let mut brackets = brackets(&influences);
    for round in 0..=HALVINGS {
        let open: Vec<usize> = (0..brackets.len())
            .filter(|at| brackets[*at].open)
            .collect();
        let points: Vec<f64> = open.iter().map(|at| brackets[*at].next()).collect();
        let lists: Vec<Vec<Choice>> = open
            .iter()
            .zip(&points)
            .map(|(at, point)| with_value(list.to_vec(), &influences[brackets[*at].of].id, *point))
            .collect();
        for ((at, point), result) in open.into_iter().zip(points).zip(search.each(&lists)) {
            let bracket = &mut brackets[at];
            let influence = &mut influences[bracket.of];
            if round == 0 && point == influence.choice.kind.nominal() {
                influence.matters = result
                    .as_ref()
                    .map(|result| !matches!(result, TryResult::Fails(_)));
            }
            bracket.learn(point, result);
        }
    }
    brackets
        .iter()
        .for_each(|bracket| bracket.apply_to(&mut influences[bracket.of]));
    Explained::of(influences)
}

impl Explained {
    /// Finds the nearest passing list among the influences.
    pub(super) fn of(influences: Vec<Influence>) -> Self {
        let neighbour = neighbour(&influences);
        Self {
            influences,
            neighbour,
        }
    }
}

/// Brackets towards nominal come first, so that the influences are known before limits end the
/// search; then those away from nominal.
fn brackets(influences: &[Influence]) -> Vec<Bracket> {
    let towards = influences
        .iter()
        .enumerate()
        .map(|(of, influence)| (of, influence.choice.kind.nominal()));
    let away = influences.iter().enumerate().filter_map(|(of, influence)| {
        let value = influence.choice.value;
        let up = value > influence.choice.kind.nominal();
        let end = match influence.choice.kind {
            ChoiceKind::Real { low, high, .. } => {
                if up {
                    high
                } else {
                    low
                }
            }
            ChoiceKind::Normal { sigma } => {
                if up {
                    FARTHEST_SIGMAS * sigma
                } else {
                    -FARTHEST_SIGMAS * sigma
                }
            }
            ChoiceKind::Index { .. } | ChoiceKind::Candidate { .. } => return None,
        };
        // Inwards, to a value that is printed as it is.
        let steps = end * STEPS_PER_UNIT;
        let inwards = if up {
            libm::floor(steps)
        } else {
            libm::ceil(steps)
        } / STEPS_PER_UNIT;
        let beyond = if up { inwards > value } else { inwards < value };
        let end = if beyond { inwards } else { end };
        (end != value).then_some((of, end))
    });
    let bracket = |(of, end): (usize, f64)| {
        let choice = &influences[of].choice;
        let continuous = !matches!(
            choice.kind,
            ChoiceKind::Index { .. } | ChoiceKind::Candidate { .. }
        );
        Bracket {
            of,
            fails: choice.value,
            beyond: None,
            passes: None,
            end,
            continuous,
            open: true,
        }
    };
    towards.chain(away).map(bracket).collect()
}

impl Bracket {
    fn next(&self) -> f64 {
        let Some(beyond) = self.beyond else {
            return self.end;
        };
        let middle = (self.fails + beyond) / 2.0;
        let printed = libm::round(middle * STEPS_PER_UNIT) / STEPS_PER_UNIT;
        let (low, high) = (self.fails.min(beyond), self.fails.max(beyond));
        if low < printed && printed < high {
            printed
        } else {
            middle
        }
    }

    fn learn(&mut self, point: f64, result: Option<TryResult>) {
        match result {
            Some(TryResult::Fails(_)) => {
                self.fails = point;
                // If the list fails at the end, there is no boundary to bisect.
                self.open = self.continuous && self.beyond.is_some();
            }
            Some(TryResult::Passes(others)) => {
                (self.beyond, self.passes) = (
                    Some(point),
                    Some(Passing {
                        value: point,
                        others,
                    }),
                );
                self.open = self.continuous;
            }
            Some(TryResult::Otherwise) => {
                self.beyond = Some(point);
                self.open = self.continuous;
            }
            None => self.open = false,
        }
    }

    fn apply_to(&self, influence: &mut Influence) {
        let (low, high) = influence.fails;
        influence.fails = (low.min(self.fails), high.max(self.fails));
        if let Some(passing) = &self.passes {
            let below = passing.value < influence.choice.value;
            let side = if below {
                &mut influence.passes.0
            } else {
                &mut influence.passes.1
            };
            *side = Some(passing.clone());
        }
    }
}

fn neighbour(influences: &[Influence]) -> Option<Neighbour> {
    let passing = influences.iter().flat_map(|influence| {
        let spread = spread(&influence.choice.kind);
        [&influence.passes.0, &influence.passes.1]
            .into_iter()
            .flatten()
            .map(move |passing| Neighbour {
                id: influence.id.clone(),
                passing: passing.clone(),
                distance: (passing.value - influence.choice.value).abs() / spread,
            })
    });
    passing.min_by(|a, b| a.distance.total_cmp(&b.distance))
}
