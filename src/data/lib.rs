//! Plain data that the stages hand to each other: poses, recorded choices, scenes, traces.
//!
//! Never: reads a file, steps the simulation, or decides anything.

mod appearance;
mod choice_name;
mod choice_parts;
mod choices;
mod clustered;
mod decor;
mod facets;
mod hull;
mod intervals;
mod mesh;
mod model;
mod motion;
mod part_joint;
mod places;
mod pose;
mod quality;
mod robot;
mod robot_course;
mod samples;
mod scene;
mod scene_map;
mod settings;
mod shape;
mod skill_log;
mod snapshot;
mod stated_robot;
mod stream;
mod trace;
mod tree;

pub use appearance::{Appearances, CameraPlace, Colour, SeenLink, SeenPart};
pub use choice_name::{ChoiceGroup, ChoiceName, OBSTACLE_LIST};
pub use choice_parts::{ObjectAxis, PlacedObject, PlanarAxis, SightingAxis, StartAxis, WheelAxis};
pub use choices::{Choice, ChoiceKind, ChoiceValue, Choices};
pub use decor::{Decor, DecorRanges, Texture};
pub use facets::Face;
pub use hull::convex_hull;
pub use intervals::{Interval, IntervalKind};
pub use mesh::{Mesh, MeshFault, Top};
pub use model::{Inertia, MovingPart, ObjectModel, Rim, Surface};
pub use motion::{JointMoment, Motion, MotionRow};
pub use part_joint::PartJoint;
pub use places::{FLOOR_M, Location, OVERHEAD_M, Room};
pub use pose::Pose;
pub use quality::Quality;
pub use robot::{
    Hand, LEAST_LINK_KG, LinkFrame, RobotCore, RobotProfile, RobotRoles, RobotView, Suction,
};
pub use robot_course::{Clearance, HeldCourse, JointCourse, RobotCourse, SelfCollision, SelfPress};
pub use samples::{Samples, Series};
pub use scene::{Attached, KnownKind, RobotStart, Role, Scene, SceneObject};
pub use scene_map::{NamedSurface, SceneMap};
pub use settings::{Budget, CONTROL_HZ, Camera, Odometry, Physics, Range, Sensing};
pub use shape::{Part, Shape, bounds};
pub use skill_log::{
    AnsweredObject, AnsweredQuestion, CommandStretch, CommandTarget, SkillDeed, SkillEntry,
    SkillLog, TargetKind,
};
pub use snapshot::{BodyState, CupState, JointState, LinkState, RobotState, Snapshot};
pub use stated_robot::{FINGER_FRICTION, GRIP_FORCE_N, StatedFingers, StatedHand, StatedRobot};
pub use stream::Stream;
pub use trace::{
    ActionEnd, ActionReport, ActionTrace, ContactEpisode, Extremes, Form, Frames, Look, Perceived,
    PerceivedPlane, PerceivedThing, Percept, Phase, Trace,
};
pub use tree::{
    Amount, Matter, ModelTree, Spread, TreeColour, TreeGeometry, TreeInertial, TreeJoint, TreeLink,
    TreeMimic, TreeMotion, TreeSolid,
};
