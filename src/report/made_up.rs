//! Made-up states of scenes for tests.

use actcheck_data::{BodyState, Pose, RobotState, Snapshot};

/// A body at the origin.
pub(crate) fn body(id: &str, fixed: bool, rests_on: &str) -> BodyState {
    BodyState {
        id: id.to_owned(),
        model: String::new(),
        category: String::new(),
        fixed,
        pose: Pose::IDENTITY,
        linear_velocity: [0.0; 3],
        angular_velocity: [0.0; 3],
        aabb_min: [0.0; 3],
        aabb_max: [0.0; 3],
        mass_kg: 1.0,
        friction: 0.5,
        restitution: 0.0,
        touches: Vec::new(),
        rests_on: vec![rests_on.to_owned()],
        asleep: false,
        size_m: [0.1; 3],
        grasp_distance_m: None,
        part: None,
        left_world: false,
    }
}

/// A glass on a table.
pub(crate) fn snapshot(time_secs: f64) -> Snapshot {
    let robot = RobotState {
        base_true: [0.0; 3],
        base_believed: [0.0; 3],
        joints: Vec::new(),
        gripper: Pose::IDENTITY,
        gripper_opening_m: 0.0,
        left_touches: Vec::new(),
        right_touches: Vec::new(),
        links: Vec::new(),
        cup: None,
    };
    Snapshot {
        time_secs,
        bodies: vec![
            body("table_1", true, "floor"),
            body("glass_1", false, "table_1"),
        ],
        robot,
    }
}
