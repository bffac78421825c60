//! The table of faults.

use actcheck_actions::{Accident, Defect, Moment, Sabotage};
use actcheck_config::Step;
use actcheck_data::RobotCore;

/// A fault that properties should detect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Fault {
    /// Its name in results.
    pub name: &'static str,
    /// Description.
    pub description: &'static str,
    /// The change to robot, world or report.
    pub sabotage: Sabotage,
}

impl Fault {
    /// Whether it can occur when a robot performs a test with these actions.
    pub fn concerns(&self, test: &[Step], robot: &RobotCore) -> bool {
        let actions = self.sabotage.actions;
        // A hand that never picked holds nothing.
        let from = if self.sabotage.needs_load() {
            test.iter().position(|step| step.action == PICK[0])
        } else {
            Some(0)
        };
        let possible = from.map_or(&[][..], |from| &test[from..]);
        let performed = possible
            .iter()
            .any(|step| actions.is_empty() || actions.contains(&step.action.as_str()));
        performed && self.sabotage.suits(robot)
    }
}

/// No fault: the default for the other fields.
const NONE: Sabotage = Sabotage {
    actions: &[],
    robot: None,
    world: None,
    report: None,
};

/// The actions that a fault may be confined to.
const MOVE_TO: &[&str] = &["MoveTo"];
const PERCEIVE: &[&str] = &["PerceivePlane"];
const PERCEIVE_OR_PICK: &[&str] = &["PerceivePlane", "Pick"];
const PICK: &[&str] = &["Pick"];
const PLACE: &[&str] = &["Place"];

/// All faults, in the order of the table of results. To add one, add a row.
pub const FAULTS: [Fault; 27] = [
    Fault {
        name: "no-op",
        description: "the robot does nothing and reports success",
        sabotage: Sabotage {
            robot: Some(Defect::Idle),
            report: Some(true),
            ..NONE
        },
    },
    Fault {
        name: "release",
        description: "the hand opens while it carries the object",
        sabotage: Sabotage {
            actions: PICK,
            world: Some((Moment::Carrying, Accident::HandOpens)),
            ..NONE
        },
    },
    Fault {
        name: "slip",
        description: "the object loses all friction while it is carried",
        sabotage: Sabotage {
            actions: PICK,
            world: Some((Moment::Carrying, Accident::Slippery)),
            ..NONE
        },
    },
    Fault {
        name: "wrong-object",
        description: "the robot mistakes the nearest other object for the requested one",
        sabotage: Sabotage {
            actions: PICK,
            robot: Some(Defect::WrongObject),
            ..NONE
        },
    },
    Fault {
        name: "teleport",
        description: "the object jumps half a metre away while it is carried",
        sabotage: Sabotage {
            actions: PICK,
            world: Some((Moment::Carrying, Accident::Teleport)),
            ..NONE
        },
    },
    Fault {
        name: "neighbour-falls",
        description: "the object's nearest neighbour is knocked over while the hand reaches for the object",
        sabotage: Sabotage {
            actions: PICK,
            world: Some((Moment::Reaching, Accident::NeighbourFalls)),
            ..NONE
        },
    },
    Fault {
        name: "false-success",
        description: "the hand drops the object, and the action reports success",
        sabotage: Sabotage {
            actions: PICK,
            world: Some((Moment::Carrying, Accident::HandOpens)),
            report: Some(true),
            ..NONE
        },
    },
    Fault {
        name: "false-failure",
        description: "the action succeeds and reports failure",
        sabotage: Sabotage {
            report: Some(false),
            ..NONE
        },
    },
    Fault {
        name: "frozen-sensors",
        description: "all sensor readings stay as they were when the action began",
        sabotage: Sabotage {
            robot: Some(Defect::FrozenSensors),
            ..NONE
        },
    },
    Fault {
        name: "obstacle",
        description: "an obstacle appears right in front of the base while it drives",
        sabotage: Sabotage {
            actions: MOVE_TO,
            world: Some((Moment::Driving, Accident::InTheWay)),
            ..NONE
        },
    },
    Fault {
        name: "carried-off",
        description: "the robot is moved out of its rooms while it drives; odometry and landmarks don't show it at once",
        sabotage: Sabotage {
            actions: MOVE_TO,
            world: Some((Moment::Driving, Accident::CarriedOff)),
            ..NONE
        },
    },
    Fault {
        name: "dropped-on-the-way",
        description: "the hand opens while the robot drives to the place, and the action reports success",
        sabotage: Sabotage {
            actions: PLACE,
            world: Some((Moment::Driving, Accident::HandOpens)),
            report: Some(true),
            ..NONE
        },
    },
    Fault {
        name: "placed-and-gone",
        description: "the object jumps half a metre away once it is released",
        sabotage: Sabotage {
            actions: PLACE,
            world: Some((Moment::LetGo, Accident::Teleport)),
            ..NONE
        },
    },
    Fault {
        name: "placed-and-fallen",
        description: "the object falls over once it is released",
        sabotage: Sabotage {
            actions: PLACE,
            world: Some((Moment::LetGo, Accident::Falls)),
            ..NONE
        },
    },
    Fault {
        name: "hand-jams",
        description: "the hand no longer opens when it should release the object",
        sabotage: Sabotage {
            actions: PLACE,
            world: Some((Moment::Lowering, Accident::HandJams)),
            ..NONE
        },
    },
    Fault {
        name: "place-neighbour-falls",
        description: "the nearest neighbour of the place is knocked over while the object is lowered to it",
        sabotage: Sabotage {
            actions: PLACE,
            world: Some((Moment::Lowering, Accident::NeighbourFalls)),
            ..NONE
        },
    },
    Fault {
        name: "base-pushed",
        description: "the base is pushed against the nearest furniture and back before the robot picks",
        sabotage: Sabotage {
            actions: PICK,
            world: Some((Moment::Starting, Accident::PushedIntoFurniture)),
            ..NONE
        },
    },
    Fault {
        name: "arm-through-head",
        description: "the arm moves through the robot's head and back before the robot picks",
        sabotage: Sabotage {
            actions: PICK,
            world: Some((Moment::Starting, Accident::ArmThroughHead)),
            ..NONE
        },
    },
    Fault {
        name: "percepts-swapped",
        description: "the robot's percepts of the object and of another one are exchanged",
        sabotage: Sabotage {
            actions: PERCEIVE_OR_PICK,
            robot: Some(Defect::SwappedPercepts),
            ..NONE
        },
    },
    Fault {
        name: "other-kind",
        description: "the camera perceives the object as one of another kind and size",
        sabotage: Sabotage {
            actions: PERCEIVE,
            robot: Some(Defect::MistakenKind),
            ..NONE
        },
    },
    Fault {
        name: "runaway-motor",
        description: "the motor of the hand's joint runs away with three times its largest effort while the hand reaches",
        sabotage: Sabotage {
            actions: PICK,
            world: Some((Moment::Reaching, Accident::RunawayMotor)),
            ..NONE
        },
    },
    Fault {
        name: "drag-and-lift",
        description: "the hand drags the object and lifts it by less than a centimetre, and the action reports success",
        sabotage: Sabotage {
            actions: PICK,
            world: Some((Moment::Grasping, Accident::Drags)),
            report: Some(true),
            ..NONE
        },
    },
    Fault {
        name: "neighbour-put-back",
        description: "the object's nearest neighbour is moved aside and put back before the robot picks",
        sabotage: Sabotage {
            actions: PICK,
            world: Some((Moment::Starting, Accident::NeighbourMoved)),
            ..NONE
        },
    },
    Fault {
        name: "sweep",
        description: "the hand sweeps through the nearest object before the robot perceives the surface",
        sabotage: Sabotage {
            actions: PERCEIVE,
            world: Some((Moment::Starting, Accident::Sweeps)),
            ..NONE
        },
    },
    Fault {
        name: "false-height",
        description: "the camera perceives every object 40 cm above its place",
        sabotage: Sabotage {
            actions: PERCEIVE,
            robot: Some(Defect::FalseHeight),
            ..NONE
        },
    },
    Fault {
        name: "lost-on-the-way",
        description: "the hand opens while the robot drives with an object to its goal",
        sabotage: Sabotage {
            actions: MOVE_TO,
            world: Some((Moment::DrivingLoaded, Accident::HandOpens)),
            ..NONE
        },
    },
    Fault {
        name: "held-object-pushes",
        description: "the object in the hand pushes another one before the robot drives",
        sabotage: Sabotage {
            actions: MOVE_TO,
            world: Some((Moment::Starting, Accident::PushesWithHeld)),
            ..NONE
        },
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_has_a_unique_name_and_an_effect() {
        for (idx, fault) in FAULTS.iter().enumerate() {
            assert_ne!(fault.sabotage, NONE, "{}", fault.name);
            assert!(
                FAULTS[..idx]
                    .iter()
                    .all(|other| other.name != fault.name && other.sabotage != fault.sabotage)
            );
        }
    }
}
