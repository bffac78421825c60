//! Discretisation of parameters into cells, and the conditions that are unions of cells.

use crate::patterns::likelihood::Count;
use crate::patterns::{Condition, Parameter, PatternInput, Values, simplest_between};

/// Parameters with more kinds than this are ignored: a unique name for each scene makes no pattern.
const MOST_KINDS: usize = 64;

/// A parameter divided into cells. Cell 0 holds the runs without a value.
#[derive(Debug, Clone)]
pub(super) struct Axis {
    /// Index of the parameter.
    pub parameter: usize,
    /// Number of cells.
    pub cells: usize,
    /// The cell of each run.
    pub of_run: Vec<u8>,
    /// The possible conditions.
    pub conditions: Conditions,
}

/// Conditions on one parameter.
#[derive(Debug, Clone)]
pub(super) enum Conditions {
    /// All ranges of adjacent cells, given by the cuts between cells 1, 2, ….
    Ranges(Vec<Cut>),
    /// All ranges of adjacent cells of directions, where the last cell is adjacent to cell 1: first
    /// those of [`Conditions::Ranges`], then those that contain the last cell and cell 1. Given by
    /// the cuts.
    Arcs(Vec<Cut>),
    /// Kinds with their cells.
    Kinds(Vec<(String, Vec<usize>)>),
}

/// A cut between two cells of numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cut {
    /// The smallest value above the cut.
    pub at: f64,
    /// A number between the values below and above.
    pub bound: f64,
}

impl Axis {
    /// Number of conditions.
    pub fn len(&self) -> usize {
        match &self.conditions {
            Conditions::Ranges(_) => self.ranges(),
            Conditions::Arcs(_) => self.ranges() + self.gaps().count(),
            Conditions::Kinds(kinds) => kinds.len(),
        }
    }

    /// Number of ranges of adjacent cells.
    fn ranges(&self) -> usize {
        (self.cells - 1) * self.cells / 2
    }

    /// Iterates over the ranges of cells that an arc with the last cell and cell 1 leaves out: the
    /// first and the last cell of each.
    pub(super) fn gaps(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let last = self.cells - 1;
        (2..last).flat_map(move |first| (first..last).map(move |end| (first, end)))
    }

    /// Sums counts over the cells of every condition. The input has one row of counts for each
    /// cell, the output one for each condition.
    pub fn expand(&self, cells: &[Count], width: usize, out: &mut Vec<Count>) {
        out.clear();
        out.reserve(self.len() * width);
        let row = |cell: usize| &cells[cell * width..(cell + 1) * width];
        let mut sum = vec![0; width];
        // Does not overflow: there are fewer than 2^32 runs.
        let add = |sum: &mut [Count], row: &[Count]| {
            sum.iter_mut()
                .zip(row)
                .for_each(|(sum, count)| *sum = sum.wrapping_add(*count));
        };
        match &self.conditions {
            Conditions::Ranges(_) | Conditions::Arcs(_) => {
                for first in 1..self.cells {
                    sum.fill(0);
                    for last in first..self.cells {
                        add(&mut sum, row(last));
                        out.extend_from_slice(&sum);
                    }
                }
                if let Conditions::Arcs(_) = self.conditions {
                    for (first, last) in self.gaps() {
                        sum.fill(0);
                        (1..first)
                            .chain(last + 1..self.cells)
                            .for_each(|cell| add(&mut sum, row(cell)));
                        out.extend_from_slice(&sum);
                    }
                }
            }
            Conditions::Kinds(kinds) => {
                for (_, members) in kinds {
                    sum.fill(0);
                    members.iter().for_each(|cell| add(&mut sum, row(*cell)));
                    out.extend_from_slice(&sum);
                }
            }
        }
    }

    /// Returns the condition with an index in the output of [`Axis::expand`].
    pub fn condition(&self, place: usize) -> Condition {
        match &self.conditions {
            Conditions::Kinds(kinds) => Condition::Kind {
                parameter: self.parameter,
                kind: kinds[place].0.clone(),
            },
            Conditions::Arcs(cuts) if place >= self.ranges() => {
                // The gap exists: places are below the number of conditions.
                let (first, last) = self.gaps().nth(place - self.ranges()).unwrap_or((2, 2));
                Condition::Arc {
                    parameter: self.parameter,
                    from: cuts[last - 1].bound,
                    to: cuts[first - 2].bound,
                }
            }
            Conditions::Ranges(cuts) | Conditions::Arcs(cuts) => {
                let (first, last) = self.range(place);
                let bound = |cut: usize| cuts.get(cut).map(|cut| cut.bound);
                Condition::Range {
                    parameter: self.parameter,
                    low: first.checked_sub(2).and_then(bound),
                    high: bound(last - 1),
                }
            }
        }
    }

    /// Returns the first and last cell of a range.
    fn range(&self, place: usize) -> (usize, usize) {
        let mut left = place;
        for first in 1..self.cells {
            let ranges = self.cells - first;
            if left < ranges {
                return (first, first + left);
            }
            left -= ranges;
        }
        (1, self.cells - 1)
    }
}

/// Divides every parameter that varies among the participating runs into cells. Of parameters with
/// equal values in all runs, or with the same partition into kinds, only the first is used.
///
/// Numbers are cut into cells of about equally many runs, or into one cell for each distinct number
/// if there are few.
pub(super) fn axes(input: &PatternInput, takes_part: &[bool], cells: usize) -> Vec<Axis> {
    let mut axes: Vec<Axis> = Vec::new();
    for (place, parameter) in input.parameters.iter().enumerate() {
        let known = axes
            .iter()
            .any(|axis| is_same(&input.parameters[axis.parameter].values, &parameter.values));
        if !known && let Some(axis) = axis(place, parameter, takes_part, cells) {
            axes.push(axis);
        }
    }
    axes
}

fn is_same(known: &Values, values: &Values) -> bool {
    match (known, values) {
        (Values::Kinds { of_run: a, .. }, Values::Kinds { of_run: b, .. }) => a == b,
        (Values::Numbers(a), Values::Numbers(b)) | (Values::Angles(a), Values::Angles(b)) => {
            a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
        }
        _ => false,
    }
}

fn axis(place: usize, parameter: &Parameter, takes_part: &[bool], cells: usize) -> Option<Axis> {
    let axis = match &parameter.values {
        Values::Numbers(numbers) | Values::Angles(numbers) => {
            let cuts = cuts(numbers, takes_part, cells);
            let cell = |value: &f64| {
                if value.is_nan() {
                    0
                } else {
                    1 + cuts.partition_point(|cut| cut.at <= *value) as u8
                }
            };
            Axis {
                parameter: place,
                cells: cuts.len() + 2,
                of_run: numbers.iter().map(cell).collect(),
                conditions: match parameter.values {
                    Values::Angles(_) => Conditions::Arcs(cuts),
                    _ => Conditions::Ranges(cuts),
                },
            }
        }
        Values::Kinds {
            of_run,
            names,
            above,
        } => {
            let kinds = (names.len() <= MOST_KINDS).then(|| kinds(names, above))?;
            let of_run = of_run
                .iter()
                .map(|of| of.map_or(0, |of| of as u8 + 1))
                .collect();
            Axis {
                parameter: place,
                cells: names.len() + 1,
                of_run,
                conditions: Conditions::Kinds(kinds),
            }
        }
    };
    let mut met = axis
        .of_run
        .iter()
        .zip(takes_part)
        .filter(|(_, part)| **part)
        .map(|(cell, _)| *cell);
    let first = met.next()?;
    met.any(|cell| cell != first).then_some(axis)
}

/// Returns the cuts between cells of about equally many values.
fn cuts(numbers: &[f64], takes_part: &[bool], cells: usize) -> Vec<Cut> {
    let mut sorted: Vec<f64> = numbers
        .iter()
        .zip(takes_part)
        .filter(|(value, part)| **part && !value.is_nan())
        .map(|(v, _)| *v)
        .collect();
    sorted.sort_by(f64::total_cmp);
    let mut distinct = sorted.clone();
    distinct.dedup();
    let cut = |above: usize| Cut {
        at: distinct[above],
        bound: simplest_between(distinct[above - 1], distinct[above]),
    };
    if distinct.len() <= cells {
        return (1..distinct.len()).map(cut).collect();
    }
    let mut places: Vec<usize> = (1..cells)
        .map(|share| {
            distinct.partition_point(|value| *value < sorted[share * sorted.len() / cells])
        })
        .filter(|place| *place > 0)
        .collect();
    places.dedup();
    places.into_iter().map(cut).collect()
}

/// Returns every kind and superkind with its cells. Of kinds with equal members, only the one
/// nearest to them is used.
///
/// A kind includes all kinds below it. A kind that includes everything is not a condition.
fn kinds(names: &[String], above: &[Vec<String>]) -> Vec<(String, Vec<usize>)> {
    let mut higher: Vec<&String> = above
        .iter()
        .flatten()
        .filter(|name| !names.contains(name))
        .collect();
    let nearness = |name: &String| {
        above
            .iter()
            .filter_map(|list| list.iter().position(|known| known == name))
            .min()
    };
    higher.sort_by_key(|name| (nearness(name), *name));
    higher.dedup();
    let mut kinds: Vec<(String, Vec<usize>)> = Vec::new();
    for name in names.iter().chain(higher) {
        let belongs = |place: &usize| names[*place] == *name || above[*place].contains(name);
        let members: Vec<usize> = (0..names.len())
            .filter(belongs)
            .map(|place| place + 1)
            .collect();
        if members.len() < names.len() && !kinds.iter().any(|(_, known)| *known == members) {
            kinds.push((name.clone(), members));
        }
    }
    kinds
}

#[cfg(test)]
mod tests {
    use super::*;

    fn strings(names: &[&str]) -> Vec<String> {
        names.iter().map(|name| (*name).to_owned()).collect()
    }

    #[test]
    fn equal_superclasses_are_merged_under_the_most_specific_one() {
        let names = strings(&["Bottle", "Fork", "Glass", "Mug"]);
        let above = [
            strings(&["Container", "Graspable"]),
            strings(&["Cutlery", "Graspable"]),
            strings(&["Cup", "Container", "Graspable"]),
            strings(&["Cup", "Container", "Graspable"]),
        ];
        let found = kinds(&names, &above);
        let pairs: Vec<(&str, &[usize])> = found
            .iter()
            .map(|(name, of)| (name.as_str(), of.as_slice()))
            .collect();
        let expected: [(&str, &[usize]); 6] = [
            ("Bottle", &[1]),
            ("Fork", &[2]),
            ("Glass", &[3]),
            ("Mug", &[4]),
            ("Container", &[1, 3, 4]),
            ("Cup", &[3, 4]),
        ];
        assert_eq!(
            pairs, expected,
            "Cutlery is Fork here, and Graspable everything"
        );
    }

    #[test]
    fn cells_have_equal_counts_and_ranges_are_recovered() {
        let numbers: Vec<f64> = (0..80)
            .map(|i| f64::from(i) / 80.0)
            .chain([f64::NAN])
            .collect();
        let parameter = Parameter {
            name: "x".into(),
            unit: None,
            values: Values::Numbers(numbers),
        };
        let axis = axis(0, &parameter, &[true; 81], 4).expect("it varies");
        assert_eq!((axis.cells, axis.len()), (5, 10));
        assert_eq!(
            (0..5)
                .map(|cell| axis.of_run.iter().filter(|of| **of == cell).count())
                .collect::<Vec<_>>(),
            [1, 20, 20, 20, 20]
        );
        let mut out = Vec::new();
        axis.expand(&[100, 1, 2, 4, 8], 1, &mut out);
        assert_eq!(out, [1, 3, 7, 15, 2, 6, 14, 4, 12, 8]);
        let range = |low, high| Condition::Range {
            parameter: 0,
            low,
            high,
        };
        assert_eq!(axis.condition(0), range(None, Some(0.25)));
        assert_eq!(axis.condition(3), range(None, None));
        assert_eq!(axis.condition(5), range(Some(0.25), Some(0.75)));
        assert_eq!(axis.condition(9), range(Some(0.75), None));
    }

    #[test]
    fn an_arc_contains_both_ends_of_the_range() {
        let angles: Vec<f64> = (0..80).map(|i| f64::from(i) / 10.0 - 4.0).collect();
        let parameter = Parameter {
            name: "yaw".into(),
            unit: None,
            values: Values::Angles(angles),
        };
        let axis = axis(0, &parameter, &[true; 80], 4).expect("it varies");
        assert_eq!(
            (axis.cells, axis.len()),
            (5, 13),
            "ten ranges and three arcs"
        );
        let mut out = Vec::new();
        axis.expand(&[100, 1, 2, 4, 8], 1, &mut out);
        assert_eq!(out[10..], [13, 9, 11]);
        let arc = |from, to| Condition::Arc {
            parameter: 0,
            from,
            to,
        };
        assert_eq!(
            [10, 11, 12].map(|place| axis.condition(place)),
            [arc(0.0, -2.0), arc(2.0, -2.0), arc(2.0, 0.0)]
        );
    }
}
