//! Events of the robot itself during one action: joints at their limits, colliding links, held
//! objects.

use serde::{Deserialize, Serialize};

use crate::{Interval, Motion, Samples};

/// The robot's course during one action.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct RobotCourse {
    /// One for each joint, in the robot's order.
    pub joints: Vec<JointCourse>,
    /// Pairs of links that pressed or penetrated each other, sorted.
    pub self_contacts: Vec<SelfCollision>,
    /// Objects that both fingers touched at the same time, in scene order.
    pub held: Vec<HeldCourse>,
    /// Objects that the robot came near, in scene order.
    pub clearances: Vec<Clearance>,
    /// Its measurements and commands. Stored with the bodies' tracks, which not every reader needs.
    #[serde(skip)]
    pub motion: Motion,
    /// Quantities of all bodies at the control rate, for rules about time. Stored with the bodies'
    /// tracks.
    #[serde(skip)]
    pub samples: Samples,
    /// When objects were held and when they moved, by [`Samples::intervals`].
    pub intervals: Vec<Interval>,
}

/// Extremes of one joint. Units: metres or radians, by kind.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct JointCourse {
    /// Name in the URDF.
    pub name: String,
    /// Largest excess of its position beyond its limits; negative if it stayed within them.
    pub max_excess: f64,
    /// Largest speed as a share of the joint's limit.
    pub max_speed_share: f64,
    /// Longest uninterrupted time at the motor's effort limit; 0 for fingers, which hold by force.
    /// Unit: seconds.
    pub overload_secs: f64,
}

/// Two links of the robot that pressed or penetrated each other, and did neither when the run
/// began.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SelfCollision {
    /// `robot/LINK`, sorted.
    pub pair: [String; 2],
    /// Time of its first detection since the action began. Unit: seconds.
    pub start_secs: f64,
    /// Largest penetration depth, of solid material only: hulls that fill the hollows of a mesh do
    /// not count. Unit: metres.
    pub max_depth_m: f64,
    /// How hard they pressed each other.
    pub press: SelfPress,
}

/// The force between two links.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SelfPress {
    /// Largest normal force; 0 if they pass through each other. Unit: newtons.
    pub max_force_n: f64,
    /// Whether both belong to the hand, whose fingers may meet.
    pub of_hand: bool,
}

/// The smallest distance of the robot to an object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Clearance {
    /// Id of the object.
    pub id: String,
    /// Smallest distance of any link to its surface; 0 if they touched. Unit: metres.
    pub smallest_m: f64,
}

/// An object held between both fingers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HeldCourse {
    /// Id of the object.
    pub id: String,
    /// Total time held. Unit: seconds.
    pub held_secs: f64,
    /// Largest angle from the vertical while held. Unit: radians.
    pub max_tilt_rad: f64,
}
