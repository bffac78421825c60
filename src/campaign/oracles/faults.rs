//! The table of faults.

use actcheck_actions::{Accident, Defect, Moment, Sabotage};

/// A fault that properties should detect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fault {
    /// Its name in results.
    pub name: &'static str,
    /// Description.
    pub what: &'static str,
    /// The change to robot, world or report.
    pub sabotage: Sabotage,
}

impl Fault {
    /// Whether it can occur in a test with these actions.
    pub fn concerns(&self, test: &[String]) -> bool {
        self.sabotage.action.is_none_or(|action| test.iter().any(|name| name == action))
    }
}

/// No fault: the default for the other fields.
const NONE: Sabotage = Sabotage { action: None, robot: None, world: None, report: None };

/// The actions that a fault may be confined to.
const MOVE_TO: Option<&str> = Some("MoveTo");
const PICK: Option<&str> = Some("Pick");
const PLACE: Option<&str> = Some("Place");

/// All faults, in the order of the table of results. To add one, add a row.
pub const FAULTS: [Fault; 16] = [
    Fault {
        name: "no-op",
        what: "the robot does nothing and reports success",
        sabotage: Sabotage { robot: Some(Defect::Idle), report: Some(true), ..NONE },
    },
    Fault {
        name: "release",
        what: "the hand opens while it carries the object",
        sabotage: Sabotage { action: PICK, world: Some((Moment::Carrying, Accident::HandOpens)), ..NONE },
    },
    Fault {
        name: "slip",
        what: "the object loses all friction while it is carried",
        sabotage: Sabotage { action: PICK, world: Some((Moment::Carrying, Accident::Slippery)), ..NONE },
    },
    Fault {
        name: "wrong-object",
        what: "the robot mistakes the nearest other object for the requested one",
        sabotage: Sabotage { action: PICK, robot: Some(Defect::WrongObject), ..NONE },
    },
    Fault {
        name: "teleport",
        what: "the object jumps half a metre away while it is carried",
        sabotage: Sabotage { action: PICK, world: Some((Moment::Carrying, Accident::Teleport)), ..NONE },
    },
    Fault {
        name: "neighbour-falls",
        what: "the object's nearest neighbour is knocked over while the hand reaches for the object",
        sabotage: Sabotage { action: PICK, world: Some((Moment::Reaching, Accident::NeighbourFalls)), ..NONE },
    },
    Fault {
        name: "false-success",
        what: "the hand drops the object, and the action reports success",
        sabotage: Sabotage {
            action: PICK,
            world: Some((Moment::Carrying, Accident::HandOpens)),
            report: Some(true),
            ..NONE
        },
    },
    Fault {
        name: "false-failure",
        what: "the action succeeds and reports failure",
        sabotage: Sabotage { report: Some(false), ..NONE },
    },
    Fault {
        name: "frozen-sensors",
        what: "all sensor readings stay as they were when the action began",
        sabotage: Sabotage { robot: Some(Defect::FrozenSensors), ..NONE },
    },
    Fault {
        name: "obstacle",
        what: "an obstacle appears right in front of the base while it drives",
        sabotage: Sabotage { action: MOVE_TO, world: Some((Moment::Driving, Accident::InTheWay)), ..NONE },
    },
    Fault {
        name: "carried-off",
        what: "the robot is moved out of its rooms while it drives; odometry and landmarks don't show it at once",
        sabotage: Sabotage { action: MOVE_TO, world: Some((Moment::Driving, Accident::CarriedOff)), ..NONE },
    },
    Fault {
        name: "dropped-on-the-way",
        what: "the hand opens while the robot drives to the place, and the action reports success",
        sabotage: Sabotage {
            action: PLACE,
            world: Some((Moment::Driving, Accident::HandOpens)),
            report: Some(true),
            ..NONE
        },
    },
    Fault {
        name: "placed-and-gone",
        what: "the object jumps half a metre away once it is released",
        sabotage: Sabotage { action: PLACE, world: Some((Moment::LetGo, Accident::Teleport)), ..NONE },
    },
    Fault {
        name: "placed-and-fallen",
        what: "the object falls over once it is released",
        sabotage: Sabotage { action: PLACE, world: Some((Moment::LetGo, Accident::Falls)), ..NONE },
    },
    Fault {
        name: "hand-jams",
        what: "the hand no longer opens when it should release the object",
        sabotage: Sabotage { action: PLACE, world: Some((Moment::Lowering, Accident::HandJams)), ..NONE },
    },
    Fault {
        name: "place-neighbour-falls",
        what: "the nearest neighbour of the place is knocked over while the object is lowered to it",
        sabotage: Sabotage { action: PLACE, world: Some((Moment::Lowering, Accident::NeighbourFalls)), ..NONE },
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_has_a_unique_name_and_an_effect() {
        for (idx, fault) in FAULTS.iter().enumerate() {
            assert_ne!(fault.sabotage, NONE, "{}", fault.name);
            assert!(FAULTS[..idx].iter().all(|other| other.name != fault.name && other.sabotage != fault.sabotage));
        }
    }
}
