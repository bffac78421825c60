//! Mutation testing of properties: which properties detect which faults, from paired outcomes of
//! the same scenes without and with each fault.

use std::collections::BTreeMap;

use crate::PairedTable;
use actcheck_base::Outcome;

/// Significance level at which a property notices a fault: of all pairs of a property and an
/// unrelated fault, at most one in a hundred counts as noticed.
pub const LEVEL: f64 = 0.01;
/// Minimum number of scenes that passed without the fault. With fewer, even failures in all of them
/// would not be significant (½⁷ < 0.01 < ½⁶).
const LEAST_SCENES: u64 = 7;

/// A scene with one fault, or without a fault.
#[derive(Debug, Clone, PartialEq)]
pub struct OracleTrial {
    /// Index of the scene.
    pub index: u64,
    /// Name of the fault. `None` for the scene without a fault.
    pub fault: Option<String>,
    /// Whether the fault occurred.
    pub came_about: bool,
    /// Outcome of each property, by IRI.
    pub outcomes: BTreeMap<String, Outcome>,
}

/// Whether a property notices a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Notice {
    /// It fails significantly more often with the fault than without it.
    Noticed,
    /// It does not fail significantly more often.
    Unnoticed,
    /// Too few scenes: the fault occurred too rarely, or the property rarely passes without it.
    TooFew,
}

/// One property with one fault, over the scenes in which the fault occurred.
#[derive(Debug, Clone, PartialEq)]
pub struct OracleCell {
    /// IRI of the property.
    pub property: String,
    /// Scenes in which the property passed with the fault.
    pub passed: u64,
    /// Scenes in which the property failed with the fault.
    pub failed: u64,
    /// Scenes in which the property neither passed nor failed with the fault.
    pub other: u64,
    /// Scenes in which it passed without the fault and failed with it.
    pub newly_failed: u64,
    /// Scenes in which it failed without the fault and passed with it.
    pub newly_passed: u64,
    /// One-sided p-value of McNemar's exact test: the probability of so many new failures among the
    /// changed outcomes if the fault had no effect on the property.
    pub p: f64,
    /// The conclusion.
    pub notice: Notice,
}

/// One fault with all properties.
#[derive(Debug, Clone, PartialEq)]
pub struct OracleRow {
    /// Name of the fault.
    pub fault: String,
    /// Scenes in which the fault occurred and that were judged with it.
    pub came_about: u64,
    /// Scenes in which the fault was injected.
    pub scenes: u64,
    /// Scenes in which the fault occurred and no property failed: the action passes despite the
    /// fault.
    pub passed_anyway: u64,
    /// One cell for each property.
    pub cells: Vec<OracleCell>,
}

/// The matrix of faults and properties.
#[derive(Debug, Clone, PartialEq)]
pub struct OracleMatrix {
    /// Scenes that were judged without a fault.
    pub scenes: u64,
    /// IRI of each property, with its numbers of passed and failed scenes without a fault.
    pub properties: Vec<(String, u64, u64)>,
    /// One row for each fault.
    pub rows: Vec<OracleRow>,
}

/// A gap in the fault detection of the properties.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum OracleGap {
    /// No property notices the fault.
    FaultUnnoticed(String),
    /// The property notices no fault.
    PropertyNoticesNothing(String),
    /// The fault occurred in this many scenes, too few to decide whether any property notices it.
    FaultTooRare(String, u64),
    /// The property passed in this many scenes without a fault, too few to decide whether it
    /// notices any.
    PropertyTooRare(String, u64),
    /// No property fails in this many scenes although the robot does nothing.
    NothingPasses(String, u64),
}

/// Computes the matrix of faults × properties, both in the given order.
pub fn oracle_matrix(
    faults: &[&str],
    properties: &[String],
    trials: &[OracleTrial],
) -> OracleMatrix {
    let judged = |trial: &&OracleTrial| !trial.outcomes.is_empty();
    let sound: BTreeMap<u64, &OracleTrial> = trials
        .iter()
        .filter(judged)
        .filter(|trial| trial.fault.is_none())
        .map(|trial| (trial.index, trial))
        .collect();
    let rows = faults.iter().map(|fault| {
        let tried: Vec<&OracleTrial> = trials
            .iter()
            .filter(|trial| trial.fault.as_deref() == Some(*fault))
            .collect();
        let came_about: Vec<(&OracleTrial, &OracleTrial)> = tried
            .iter()
            .filter(|trial| trial.came_about && judged(trial))
            .filter_map(|trial| Some((*sound.get(&trial.index)?, *trial)))
            .collect();
        let passes = |trial: &OracleTrial| {
            trial
                .outcomes
                .values()
                .all(|outcome| *outcome != Outcome::Failed)
        };
        OracleRow {
            fault: (*fault).to_owned(),
            scenes: tried.len() as u64,
            came_about: came_about.len() as u64,
            passed_anyway: came_about.iter().filter(|(_, with)| passes(with)).count() as u64,
            cells: properties
                .iter()
                .map(|property| cell(property, &came_about))
                .collect(),
        }
    });
    let alone = |property: &String, wanted: Outcome| {
        sound
            .values()
            .filter(|trial| trial.outcomes.get(property) == Some(&wanted))
            .count() as u64
    };
    OracleMatrix {
        scenes: sound.len() as u64,
        properties: properties
            .iter()
            .map(|property| {
                (
                    property.clone(),
                    alone(property, Outcome::Passed),
                    alone(property, Outcome::Failed),
                )
            })
            .collect(),
        rows: rows.collect(),
    }
}

/// Compares a property over the same scenes without and with a fault.
fn cell(property: &str, pairs: &[(&OracleTrial, &OracleTrial)]) -> OracleCell {
    let mut table = PairedTable::default();
    let (mut passed, mut failed) = (0, 0);
    for (without, with) in pairs {
        let holds = |trial: &OracleTrial| match trial.outcomes.get(property) {
            Some(Outcome::Passed) => Some(true),
            Some(Outcome::Failed) => Some(false),
            _ => None,
        };
        passed += u64::from(holds(with) == Some(true));
        failed += u64::from(holds(with) == Some(false));
        if let (Some(first), Some(second)) = (holds(without), holds(with)) {
            table.add(first, second);
        }
    }
    let p = table.test().second_worse;
    let notice = if p <= LEVEL {
        Notice::Noticed
    } else if table.both + table.only_first < LEAST_SCENES {
        Notice::TooFew
    } else {
        Notice::Unnoticed
    };
    OracleCell {
        property: property.to_owned(),
        passed,
        failed,
        other: pairs.len() as u64 - passed - failed,
        newly_failed: table.only_first,
        newly_passed: table.only_second,
        p,
        notice,
    }
}

impl OracleMatrix {
    /// Returns the gaps in fault detection. `idle` is the name of the fault with which the robot
    /// does nothing, so that no action may pass.
    pub fn gaps(&self, idle: &str) -> Vec<OracleGap> {
        let mut gaps = Vec::new();
        for row in &self.rows {
            let noticed = row.cells.iter().any(|cell| cell.notice == Notice::Noticed);
            if !noticed && row.cells.iter().all(|cell| cell.notice == Notice::TooFew) {
                gaps.push(OracleGap::FaultTooRare(row.fault.clone(), row.came_about));
            } else if !noticed {
                gaps.push(OracleGap::FaultUnnoticed(row.fault.clone()));
            }
            if row.fault == idle && row.passed_anyway > 0 {
                gaps.push(OracleGap::NothingPasses(
                    row.fault.clone(),
                    row.passed_anyway,
                ));
            }
        }
        for (idx, (property, passed, _)) in self.properties.iter().enumerate() {
            let mut notices = self
                .rows
                .iter()
                .filter_map(|row| row.cells.get(idx))
                .map(|cell| cell.notice);
            if notices.clone().all(|notice| notice == Notice::TooFew) {
                gaps.push(OracleGap::PropertyTooRare(property.clone(), *passed));
            } else if !notices.any(|notice| notice == Notice::Noticed) {
                gaps.push(OracleGap::PropertyNoticesNothing(property.clone()));
            }
        }
        gaps
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Scenes whose properties pass without the fault. With it, the named properties fail if the
    /// fault occurred.
    fn trials(fault: &str, scenes: u64, came_about: u64, fails: &[&str]) -> Vec<OracleTrial> {
        let outcomes = |failed: &[&str]| {
            ["a", "b"]
                .map(|name| {
                    (
                        name.to_owned(),
                        if failed.contains(&name) {
                            Outcome::Failed
                        } else {
                            Outcome::Passed
                        },
                    )
                })
                .into_iter()
                .collect()
        };
        let one = |index, fault: Option<&str>, came_about, failed: &[&str]| OracleTrial {
            index,
            fault: fault.map(str::to_owned),
            came_about,
            outcomes: outcomes(failed),
        };
        (0..scenes)
            .flat_map(|index| {
                let here = index < came_about;
                [
                    one(index, None, true, &[]),
                    one(index, Some(fault), here, if here { fails } else { &[] }),
                ]
            })
            .collect()
    }

    fn gaps(fault: &str, trials: &[OracleTrial]) -> Vec<OracleGap> {
        oracle_matrix(&[fault], &["a".to_owned(), "b".to_owned()], trials).gaps("idle")
    }

    #[test]
    fn unnoticed_faults_and_blind_properties_are_named() {
        let b = || "b".to_owned();
        assert_eq!(gaps("slip", &trials("slip", 10, 10, &["a", "b"])), []);
        assert_eq!(
            gaps("slip", &trials("slip", 10, 10, &["a"])),
            [OracleGap::PropertyNoticesNothing(b())]
        );
        let none = gaps("slip", &trials("slip", 10, 10, &[]));
        let (fault, a) = (
            OracleGap::FaultUnnoticed("slip".into()),
            OracleGap::PropertyNoticesNothing("a".into()),
        );
        assert_eq!(none, [fault, a, OracleGap::PropertyNoticesNothing(b())]);
    }

    #[test]
    fn a_fault_that_rarely_occurs_is_not_counted_as_missed() {
        let seldom = trials("slip", 10, 3, &["a"]);
        let matrix = oracle_matrix(&["slip"], &["a".to_owned()], &seldom);
        assert_eq!((matrix.rows[0].came_about, matrix.rows[0].scenes), (3, 10));
        assert_eq!(matrix.rows[0].cells[0].notice, Notice::TooFew);
        assert!(
            matrix
                .gaps("idle")
                .contains(&OracleGap::FaultTooRare("slip".into(), 3))
        );
    }

    #[test]
    fn an_idle_robot_must_not_pass() {
        let mut some = trials("idle", 10, 10, &["a", "b"]);
        assert_eq!(gaps("idle", &some), []);
        some[1]
            .outcomes
            .values_mut()
            .for_each(|outcome| *outcome = Outcome::Passed);
        assert_eq!(
            gaps("idle", &some),
            [OracleGap::NothingPasses("idle".into(), 1)]
        );
    }
}
