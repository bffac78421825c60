//! The quantities that an episode does not have, and the facts that are missing without them.

use std::collections::BTreeSet;

/// Quantities that an episode does not have.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Lacks {
    quantities: BTreeSet<Quantity>,
}

/// A quantity that a recording may lack.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Quantity {
    /// Which bodies touch each other.
    Contacts,
    /// The forces of contacts.
    ContactForces,
    /// Velocities of bodies.
    Velocities,
    /// Positions of joints.
    Joints,
    /// Velocities of joints.
    JointVelocities,
    /// Limits of the positions of joints.
    JointLimits,
    /// Largest velocities of joints.
    MaxVelocities,
    /// Largest forces and torques of joints, with the forces and torques themselves.
    JointEfforts,
    /// The environment's own success, or another report of the action.
    Report,
    /// Masses of bodies.
    Masses,
    /// Friction coefficients.
    Frictions,
    /// Shapes of bodies.
    Shapes,
    /// The fingers' contacts.
    Fingers,
    /// The gap between the fingers.
    Opening,
    /// Poses of the robot and its hand.
    Robot,
    /// Forces between the robot and other bodies: they were computed without its motors.
    RobotForces,
}

impl Quantity {
    /// All quantities with their names in files, and the local names of the facts that are missing
    /// without them.
    const ALL: [(Self, &'static str, &'static [&'static str]); 16] = [
        (
            Self::Contacts,
            "contacts",
            &[
                "touches",
                "restsOn",
                "first",
                "second",
                "start",
                "end",
                "maxForce",
                "firstLink",
                "secondLink",
                "seenAt",
                "maxDepth",
                "contactForce",
            ],
        ),
        (
            Self::ContactForces,
            "contact_forces",
            &["restsOn", "maxForce", "contactForce"],
        ),
        (
            Self::Velocities,
            "velocities",
            &[
                "vx",
                "vy",
                "vz",
                "wx",
                "wy",
                "wz",
                "maxSpeed",
                "movedObject",
            ],
        ),
        (
            Self::Joints,
            "joints",
            &[
                "position",
                "velocity",
                "effort",
                "opening",
                "maxExcess",
                "maxSpeedShare",
                "overloadTime",
                "jointPosition",
            ],
        ),
        (
            Self::JointVelocities,
            "joint_velocities",
            &["velocity", "maxSpeedShare"],
        ),
        (
            Self::JointLimits,
            "joint_limits",
            &["lower", "upper", "maxExcess"],
        ),
        (
            Self::MaxVelocities,
            "max_velocities",
            &["maxVelocity", "maxSpeedShare"],
        ),
        (
            Self::JointEfforts,
            "joint_efforts",
            &["effort", "maxEffort", "overloadTime"],
        ),
        (Self::Report, "success", &["reported", "message"]),
        (Self::Masses, "masses", &["mass", "restsOn"]),
        (Self::Frictions, "frictions", &["friction"]),
        (
            Self::Shapes,
            "shapes",
            &[
                "minX",
                "minY",
                "minZ",
                "maxX",
                "maxY",
                "maxZ",
                "sizeX",
                "sizeY",
                "sizeZ",
                "gripperDistance",
                "clearance",
            ],
        ),
        (
            Self::Fingers,
            "fingers",
            &[
                "leftTouches",
                "rightTouches",
                "heldTime",
                "heldTilt",
                "heldObject",
                "held",
                "fingersMeet",
            ],
        ),
        (Self::Opening, "opening", &["opening"]),
        (
            Self::RobotForces,
            "robot_forces",
            &["maxForce", "contactForce"],
        ),
        (
            Self::Robot,
            "robot",
            &[
                "baseX",
                "baseY",
                "baseYaw",
                "gripperDistance",
                "clearance",
                "firstLink",
                "secondLink",
                "seenAt",
                "maxDepth",
            ],
        ),
    ];

    /// Facts that no episode has: the engine's sleep, restitution, and the robot's belief.
    const NEVER: [&'static str; 5] = [
        "asleep",
        "restitution",
        "believedX",
        "believedY",
        "believedYaw",
    ];

    /// Facts about the robot's percepts, and the plane that it perceives. No recording has them; an
    /// episode that repeats a run has those of the run.
    pub(crate) const OF_PERCEPTS: [&'static str; 8] = [
        "ofObject",
        "seenAs",
        "takenAt",
        "extentX",
        "extentY",
        "takenBaseX",
        "cameraX",
        "perceivedPlane",
    ];

    /// Returns the quantity with this name in a file, or `None`.
    pub fn from_word(word: &str) -> Option<Self> {
        Self::ALL
            .iter()
            .find(|(_, name, _)| *name == word)
            .map(|(quantity, ..)| *quantity)
    }
}

impl Lacks {
    /// Removes a quantity that is known after all.
    pub fn remove(&mut self, quantity: Quantity) {
        self.quantities.remove(&quantity);
    }

    /// Notes that a quantity is missing, and with it those that are measured by it.
    pub fn add(&mut self, quantity: Quantity) {
        self.quantities.insert(quantity);
        match quantity {
            Quantity::Contacts => self.add(Quantity::Fingers),
            Quantity::Robot => {
                self.add(Quantity::Fingers);
                self.add(Quantity::Opening);
            }
            _ => {}
        }
    }

    /// Whether a quantity is missing.
    pub fn has(&self, quantity: Quantity) -> bool {
        self.quantities.contains(&quantity)
    }

    /// Returns the local names of the missing facts in the world vocabulary, sorted.
    pub fn facts(&self) -> Vec<String> {
        let of_quantities = Quantity::ALL
            .iter()
            .filter(|(quantity, ..)| self.has(*quantity))
            .flat_map(|(.., facts)| facts.iter());
        let names: BTreeSet<&str> = of_quantities
            .chain(&Quantity::NEVER)
            .chain(&Quantity::OF_PERCEPTS)
            .copied()
            .collect();
        names.into_iter().map(str::to_owned).collect()
    }
}
