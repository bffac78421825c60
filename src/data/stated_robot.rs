//! A robot as its profile states it.

use crate::{Hand, LinkFrame, RobotCore, RobotProfile, Suction};

/// Friction of the fingertips if the profile has none: that of rubber pads.
pub const FINGER_FRICTION: f64 = 0.8;

/// Force of a finger if the profile has none and its motors can give it: a usual setting of
/// grippers that can give 40 N (HSR) to 235 N (Robotiq 2F-85). It holds a can while the arm stops
/// from its full speed. Unit: newtons.
pub const GRIP_FORCE_N: f64 = 30.0;

/// A robot as its profile states it, next to its URDF. A role is `None` if the profile leaves it
/// out: it is found on the model then.
#[derive(Debug, Clone, PartialEq)]
pub struct StatedRobot {
    /// Its links and joints, and its place.
    pub core: RobotCore,
    /// See [`RobotProfile::arm_joints`].
    pub arm_joints: Option<Vec<String>>,
    /// Its gripper.
    pub hand: StatedHand,
    /// See [`RobotProfile::camera`].
    pub camera: Option<LinkFrame>,
    /// See [`RobotProfile::home`].
    pub home: Option<Vec<f64>>,
    /// See [`RobotProfile::postures`].
    pub postures: Vec<Vec<f64>>,
}

/// A gripper as a profile states it.
#[derive(Debug, Clone, PartialEq)]
pub enum StatedHand {
    /// A suction cup with its lip at a frame.
    Cup {
        /// The frame at the lip.
        grasp: LinkFrame,
        /// The cup.
        cup: Suction,
    },
    /// Fingers.
    Fingers(StatedFingers),
}

/// The fingers of a gripper as a profile states them: each field is one of [`Hand`].
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StatedFingers {
    /// See [`Hand::grasp`].
    pub grasp: Option<LinkFrame>,
    /// See [`Hand::finger_joints`].
    pub finger_joints: Option<Vec<String>>,
    /// See [`Hand::finger_links`].
    pub finger_links: Option<[String; 2]>,
    /// See [`Hand::max_opening_m`].
    pub max_opening_m: Option<f64>,
    /// See [`Hand::finger_friction`]. `None`: [`FINGER_FRICTION`].
    pub finger_friction: Option<f64>,
    /// See [`Hand::grip_force_n`]. `None`: [`GRIP_FORCE_N`], or less if the motors can't give it.
    pub grip_force_n: Option<f64>,
}

impl StatedRobot {
    /// Returns a robot whose file has no profile, so that no role is stated.
    pub fn bare(core: RobotCore) -> Self {
        Self {
            core,
            arm_joints: None,
            hand: StatedHand::Fingers(StatedFingers::default()),
            camera: None,
            home: None,
            postures: Vec::new(),
        }
    }

    /// Returns the complete profile.
    ///
    /// # Errors
    /// The keys of the roles that it leaves out.
    pub fn complete(&self) -> Result<RobotProfile, Vec<&'static str>> {
        let (Some(arm_joints), Ok(hand), Some(camera), Some(home)) = (
            &self.arm_joints,
            self.hand.complete(),
            &self.camera,
            &self.home,
        ) else {
            return Err(self.missing());
        };
        Ok(RobotProfile {
            core: self.core.clone(),
            arm_joints: arm_joints.clone(),
            hand,
            camera: camera.clone(),
            home: home.clone(),
            postures: self.postures.clone(),
        })
    }

    /// The keys of the roles that it leaves out.
    fn missing(&self) -> Vec<&'static str> {
        let of_hand = self.hand.complete().err().unwrap_or_default();
        let others = marked([
            ("arm_joints", self.arm_joints.is_none()),
            ("camera_link", self.camera.is_none()),
            ("home", self.home.is_none()),
        ]);
        [of_hand, others].concat()
    }
}

impl StatedHand {
    /// Whether it names no part of a gripper.
    pub fn is_unknown(&self) -> bool {
        match self {
            Self::Cup { .. } => false,
            Self::Fingers(fingers) => {
                fingers.finger_joints.is_none()
                    && fingers.finger_links.is_none()
                    && fingers.grasp.is_none()
            }
        }
    }

    /// Whether the opening is to be measured.
    pub fn lacks_opening(&self) -> bool {
        matches!(self, Self::Fingers(fingers) if fingers.max_opening_m.is_none())
    }

    /// Returns the complete gripper.
    ///
    /// # Errors
    /// The keys of the roles that it leaves out.
    pub fn complete(&self) -> Result<Hand, Vec<&'static str>> {
        match self {
            Self::Cup { grasp, cup } => Ok(Hand::of_cup(grasp.clone(), *cup)),
            Self::Fingers(fingers) => fingers.complete(),
        }
    }
}

impl StatedFingers {
    /// As [`StatedHand::complete`].
    ///
    /// # Errors
    /// The keys of the roles that it leaves out.
    pub fn complete(&self) -> Result<Hand, Vec<&'static str>> {
        let (Some(grasp), Some(finger_joints), Some(finger_links), Some(max_opening_m)) = (
            &self.grasp,
            &self.finger_joints,
            &self.finger_links,
            self.max_opening_m,
        ) else {
            return Err(marked([
                ("grasp_link", self.grasp.is_none()),
                ("finger_joints", self.finger_joints.is_none()),
                ("finger_links", self.finger_links.is_none()),
                ("max_opening_m", self.max_opening_m.is_none()),
            ]));
        };
        Ok(Hand {
            grasp: grasp.clone(),
            finger_joints: finger_joints.clone(),
            finger_links: finger_links.clone(),
            max_opening_m,
            finger_friction: self.finger_friction.unwrap_or(FINGER_FRICTION),
            grip_force_n: self.grip_force_n.unwrap_or(GRIP_FORCE_N),
            suction: None,
        })
    }
}

/// The keys that are marked.
fn marked<const N: usize>(keys: [(&'static str, bool); N]) -> Vec<&'static str> {
    let marked = keys.into_iter().filter(|(_, is_marked)| *is_marked);
    marked.map(|(key, _)| key).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_base::Source;
    use std::collections::BTreeMap;

    fn core() -> RobotCore {
        RobotCore {
            name: "arm".to_owned(),
            urdf: Source::new("arm.urdf", ""),
            tree: std::sync::Arc::default(),
            base_joints: None,
            planar_base: false,
            mount_height_m: 0.0,
            mount_turned_rad: 0.0,
            on_surface: false,
            reach_m: None,
            head_joints: Vec::new(),
            other_joints: Vec::new(),
            parked: Vec::new(),
            no_collision_links: Vec::new(),
            meshes: BTreeMap::new(),
            surfaces: BTreeMap::new(),
            digest: String::new(),
        }
    }

    fn on(link: &str) -> LinkFrame {
        LinkFrame {
            link: link.to_owned(),
            offset_m: [0.0; 3],
            turned_rad: [0.0; 3],
        }
    }

    fn fingers() -> StatedFingers {
        StatedFingers {
            grasp: Some(on("palm")),
            finger_joints: Some(vec!["left_joint".to_owned()]),
            finger_links: Some(["left", "right"].map(str::to_owned)),
            max_opening_m: Some(0.1),
            finger_friction: None,
            grip_force_n: None,
        }
    }

    /// An arm whose profile states all roles.
    fn arm() -> StatedRobot {
        StatedRobot {
            arm_joints: Some(vec!["shoulder".to_owned()]),
            hand: StatedHand::Fingers(fingers()),
            camera: Some(on("head")),
            home: Some(vec![0.5]),
            postures: vec![vec![0.7]],
            ..StatedRobot::bare(core())
        }
    }

    #[test]
    fn a_robot_that_states_all_roles_is_complete() {
        let stated = arm();
        let complete = stated.complete().expect("it states all roles");
        assert_eq!(Some(&complete.arm_joints), stated.arm_joints.as_ref());
        assert_eq!(complete.home, [0.5]);
        assert_eq!(complete.postures, [[0.7]]);
        assert_eq!(complete.hand.finger_friction, FINGER_FRICTION);
        assert_eq!(complete.hand.grip_force_n, GRIP_FORCE_N);
    }

    #[test]
    fn a_stated_friction_and_force_are_kept() {
        let hand = StatedHand::Fingers(StatedFingers {
            finger_friction: Some(0.3),
            grip_force_n: Some(12.0),
            ..fingers()
        });
        let hand = hand.complete().expect("it states all roles");
        assert_eq!((hand.finger_friction, hand.grip_force_n), (0.3, 12.0));
    }

    #[test]
    fn each_role_that_is_left_out_is_missing() {
        let with = |change: &dyn Fn(&mut StatedRobot)| {
            let mut stated = arm();
            change(&mut stated);
            stated.complete().err()
        };
        let with_fingers = |change: &dyn Fn(&mut StatedFingers)| {
            let mut own = fingers();
            change(&mut own);
            with(&|stated| stated.hand = StatedHand::Fingers(own.clone()))
        };
        let found = [
            with_fingers(&|own| own.grasp = None),
            with_fingers(&|own| own.finger_joints = None),
            with_fingers(&|own| own.finger_links = None),
            with_fingers(&|own| own.max_opening_m = None),
            with(&|stated| stated.arm_joints = None),
            with(&|stated| stated.camera = None),
            with(&|stated| stated.home = None),
        ];
        let roles = [
            "grasp_link",
            "finger_joints",
            "finger_links",
            "max_opening_m",
            "arm_joints",
            "camera_link",
            "home",
        ];
        assert_eq!(found, roles.map(|role| Some(vec![role])));
        assert_eq!(
            StatedRobot::bare(core()).complete().err(),
            Some(roles.to_vec())
        );
    }

    /// A suction cup has no fingers, and its opening is its diameter.
    #[test]
    fn a_cup_is_a_whole_hand() {
        let cup = Suction {
            force_n: 20.0,
            radius_m: 0.02,
            friction: 0.5,
        };
        let stated = StatedRobot {
            hand: StatedHand::Cup {
                grasp: on("lip"),
                cup,
            },
            ..arm()
        };
        let hand = stated.complete().expect("it states all roles").hand;
        assert_eq!(hand, Hand::of_cup(on("lip"), cup));
        assert_eq!(hand.finger_links, ["lip", "lip"]);
        assert_eq!(hand.max_opening_m, 0.04);
    }
}
