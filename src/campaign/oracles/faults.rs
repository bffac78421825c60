//! The faults, as data.

use crate::actions::{Accident, Defect, Moment, Sabotage};

/// A fault that properties have to notice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fault {
    /// What it is called in results.
    pub name: &'static str,
    /// What happens, in words.
    pub what: &'static str,
    /// How it is done.
    pub sabotage: Sabotage,
}

/// Nothing goes wrong: the rest of a fault that is one thing.
const NONE: Sabotage = Sabotage { robot: None, world: None, report: None };

/// All faults, in the order of the table of results. To add one, add a row.
pub const FAULTS: [Fault; 9] = [
    Fault {
        name: "no-op",
        what: "the robot does nothing and says that it succeeded",
        sabotage: Sabotage { robot: Some(Defect::Idle), report: Some(true), ..NONE },
    },
    Fault {
        name: "release",
        what: "the hand opens while it carries the object",
        sabotage: Sabotage { world: Some((Moment::Carrying, Accident::HandOpens)), ..NONE },
    },
    Fault {
        name: "slip",
        what: "the object loses all friction while it is carried",
        sabotage: Sabotage { world: Some((Moment::Carrying, Accident::Slippery)), ..NONE },
    },
    Fault {
        name: "wrong-object",
        what: "the robot takes the nearest other object for the one that was named",
        sabotage: Sabotage { robot: Some(Defect::WrongObject), ..NONE },
    },
    Fault {
        name: "teleport",
        what: "the object is half a metre farther away from one moment to the next while it is carried",
        sabotage: Sabotage { world: Some((Moment::Carrying, Accident::Teleport)), ..NONE },
    },
    Fault {
        name: "neighbour-falls",
        what: "the object's nearest neighbour is knocked over while the hand reaches for the object",
        sabotage: Sabotage { world: Some((Moment::Reaching, Accident::NeighbourFalls)), ..NONE },
    },
    Fault {
        name: "false-success",
        what: "the hand drops the object, and the action says that it succeeded",
        sabotage: Sabotage { world: Some((Moment::Carrying, Accident::HandOpens)), report: Some(true), ..NONE },
    },
    Fault {
        name: "false-failure",
        what: "the action succeeds and says that it failed",
        sabotage: Sabotage { report: Some(false), ..NONE },
    },
    Fault {
        name: "frozen-sensors",
        what: "what the robot senses stays as it was when the action began",
        sabotage: Sabotage { robot: Some(Defect::FrozenSensors), ..NONE },
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_has_a_name_of_its_own_and_something_that_goes_wrong() {
        for (idx, fault) in FAULTS.iter().enumerate() {
            assert_ne!(fault.sabotage, NONE, "{}", fault.name);
            assert!(FAULTS[..idx].iter().all(|other| other.name != fault.name && other.sabotage != fault.sabotage));
        }
    }
}
