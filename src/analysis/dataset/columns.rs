//! The tables of a dataset about actions, percepts and motion over time, with descriptions of their
//! columns.

use serde::Serialize;

use crate::ColumnKind;

/// Description of a column.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct ColumnSpec {
    pub name: &'static str,
    #[serde(rename = "type")]
    pub kind: ColumnKind,
    pub unit: &'static str,
    pub description: &'static str,
}

/// Description of a table.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct TableSpec {
    pub file: &'static str,
    pub rows: &'static str,
    pub columns: &'static [ColumnSpec],
}

pub(super) const fn text(name: &'static str, description: &'static str) -> ColumnSpec {
    ColumnSpec {
        name,
        kind: ColumnKind::Text,
        unit: "",
        description,
    }
}

pub(super) const fn count(name: &'static str, description: &'static str) -> ColumnSpec {
    ColumnSpec {
        name,
        kind: ColumnKind::Count,
        unit: "",
        description,
    }
}

pub(super) const fn bool(name: &'static str, description: &'static str) -> ColumnSpec {
    ColumnSpec {
        name,
        kind: ColumnKind::Bool,
        unit: "",
        description,
    }
}

pub(super) const fn number(
    name: &'static str,
    unit: &'static str,
    description: &'static str,
) -> ColumnSpec {
    ColumnSpec {
        name,
        kind: ColumnKind::Number,
        unit,
        description,
    }
}

pub(super) const RUN: ColumnSpec = text("run", "id of the run");
pub(super) const STEP: ColumnSpec = count("step", "position of the action in the test, from 1");
const TIME: ColumnSpec = number(
    "time_s",
    "s",
    "time since the action began; ten rows a second, the first at its start",
);

pub(super) const TAKEN_AT: ColumnSpec = number(
    "taken_at_s",
    "s",
    "time of the picture since the action began; negative if an earlier action took it, missing without a picture of the simulated camera",
);
pub(super) const TAKEN_BASE_X: ColumnSpec =
    number("taken_base_x_m", "m", "true x of the base at that time");
pub(super) const TAKEN_BASE_Y: ColumnSpec =
    number("taken_base_y_m", "m", "true y of the base at that time");
pub(super) const TAKEN_BASE_HEADING: ColumnSpec = number(
    "taken_base_heading_rad",
    "rad",
    "true heading of the base at that time",
);
pub(super) const TAKEN_BELIEVED_X: ColumnSpec = number(
    "taken_believed_x_m",
    "m",
    "localised x of the base at that time",
);
pub(super) const TAKEN_BELIEVED_Y: ColumnSpec = number(
    "taken_believed_y_m",
    "m",
    "localised y of the base at that time",
);
pub(super) const TAKEN_BELIEVED_HEADING: ColumnSpec = number(
    "taken_believed_heading_rad",
    "rad",
    "localised heading of the base at that time",
);
pub(super) const CAMERA_X: ColumnSpec = number(
    "camera_x_m",
    "m",
    "true position of the camera at that time",
);
pub(super) const CAMERA_Y: ColumnSpec = number("camera_y_m", "m", "true position of the camera");
pub(super) const CAMERA_Z: ColumnSpec = number("camera_z_m", "m", "true position of the camera");
pub(super) const CAMERA_QX: ColumnSpec = number(
    "camera_qx",
    "1",
    "true rotation of the camera, as a unit quaternion; x is forwards, z is up in the picture",
);
pub(super) const CAMERA_QY: ColumnSpec = number("camera_qy", "1", "true rotation of the camera");
pub(super) const CAMERA_QZ: ColumnSpec = number("camera_qz", "1", "true rotation of the camera");
pub(super) const CAMERA_QW: ColumnSpec = number("camera_qw", "1", "true rotation of the camera");

/// The camera's colour images.
pub(super) const IMAGES: TableSpec = TableSpec {
    file: "images.parquet",
    rows: "an image of the camera at a time of an action",
    columns: &[
        RUN,
        STEP,
        number(
            "time_s",
            "s",
            "time since the action began; one row a second, the first at its start",
        ),
        count("width", "unit: pixels"),
        count("height", "unit: pixels"),
        CAMERA_X,
        CAMERA_Y,
        CAMERA_Z,
        CAMERA_QX,
        CAMERA_QY,
        CAMERA_QZ,
        CAMERA_QW,
        ColumnSpec {
            name: "png",
            kind: ColumnKind::Image,
            unit: "",
            description: "the image without noise of the sensor, as a PNG file",
        },
    ],
};

/// Actions with their results.
pub(super) const ACTIONS: TableSpec = TableSpec {
    file: "actions.parquet",
    rows: "one for each action of each run",
    columns: &[
        RUN,
        text("campaign", "id of the campaign"),
        count("index", "position of the run in the campaign, from 0"),
        STEP,
        text("action", "the action (IRI)"),
        text("parameters", "values of the action's designators (JSON)"),
        text(
            "end",
            "how the action ended: completed, broken, timeout or untested",
        ),
        bool("reported", "whether the action reported success"),
        text(
            "message",
            "the action's message, or the reason why it did not complete",
        ),
        number("duration_s", "s", "simulated duration of the action"),
        count(
            "properties_passed",
            "number of success properties that passed; see outcomes.parquet for each",
        ),
        count("properties", "number of success properties"),
        number("score", "1", "share of the success properties that passed"),
        number(
            "base_min_x_m",
            "m",
            "truth: smallest x of the base during the action; missing for a fixed base",
        ),
        number(
            "base_min_y_m",
            "m",
            "truth: smallest y of the base during the action",
        ),
        number(
            "base_max_x_m",
            "m",
            "truth: largest x of the base during the action",
        ),
        number(
            "base_max_y_m",
            "m",
            "truth: largest y of the base during the action",
        ),
    ],
};

/// Observations and commands of each joint.
pub(super) const JOINTS: TableSpec = TableSpec {
    file: "joints.parquet",
    rows: "one for each action, time and joint",
    columns: &[
        RUN,
        STEP,
        TIME,
        text("joint", "name of the joint in the URDF"),
        number(
            "position",
            "m or rad",
            "observation: measured position; for joints of the base, the localised one",
        ),
        number("velocity", "m/s or rad/s", "observation: measured velocity"),
        number(
            "effort",
            "N or N m",
            "observation: effort of the motor, without gravity compensation",
        ),
        number(
            "target",
            "m or rad",
            "command: target of the controller in the control tick that ended at this time",
        ),
    ],
};

/// Observations and commands of the gripper and the base.
pub(super) const ROBOT: TableSpec = TableSpec {
    file: "robot.parquet",
    rows: "one for each action and time",
    columns: &[
        RUN,
        STEP,
        TIME,
        number(
            "opening_m",
            "m",
            "observation: measured gap between the fingers",
        ),
        number(
            "finger_left_n",
            "N",
            "observation: force of the left finger",
        ),
        number(
            "finger_right_n",
            "N",
            "observation: force of the right finger",
        ),
        number(
            "told_opening_m",
            "m",
            "command: target gap between the fingers",
        ),
        number("told_force_n", "N", "command: maximum force of each finger"),
        number("base_x_m", "m", "observation: localised x of the base"),
        number("base_y_m", "m", "observation: localised y of the base"),
        number(
            "base_heading_rad",
            "rad",
            "observation: localised heading of the base",
        ),
        number("true_base_x_m", "m", "truth: x of the base"),
        number("true_base_y_m", "m", "truth: y of the base"),
        number("true_base_heading_rad", "rad", "truth: heading of the base"),
    ],
};

/// Ground truth of objects.
pub(super) const OBJECTS: TableSpec = TableSpec {
    file: "objects.parquet",
    rows: "one for each action, time and movable object: ground truth, which no robot receives",
    columns: &[
        RUN,
        STEP,
        TIME,
        text("object", "id of the object"),
        number(
            "x_m",
            "m",
            "true position in the world, of the centre of the object's base",
        ),
        number("y_m", "m", "true position in the world"),
        number("z_m", "m", "true position in the world"),
        number("qx", "1", "true rotation, as a unit quaternion"),
        number("qy", "1", "true rotation"),
        number("qz", "1", "true rotation"),
        number("qw", "1", "true rotation"),
    ],
};

/// Perceived objects.
pub(super) const PERCEPTS: TableSpec = TableSpec {
    file: "percepts.parquet",
    rows: "one for each perceived object, in the order of perception",
    columns: &[
        RUN,
        STEP,
        count("number", "number of the percept in the action, from 1"),
        text(
            "source",
            "detector: from the reference perception; reported: from the action's final report",
        ),
        text("object", "id of the object, if the perception names one"),
        text("category", "perceived class (IRI), if reported"),
        number(
            "x_m",
            "m",
            "perceived position of the centre of the object's base, given the localised pose of the robot",
        ),
        number("y_m", "m", "perceived position"),
        number("z_m", "m", "perceived position"),
        number("qx", "1", "perceived rotation, as a unit quaternion"),
        number("qy", "1", "perceived rotation"),
        number("qz", "1", "perceived rotation"),
        number("qw", "1", "perceived rotation"),
        number("width_m", "m", "perceived size along the object's x"),
        number("depth_m", "m", "perceived size along the object's y"),
        number("height_m", "m", "perceived height"),
        TAKEN_AT,
        TAKEN_BASE_X,
        TAKEN_BASE_Y,
        TAKEN_BASE_HEADING,
        TAKEN_BELIEVED_X,
        TAKEN_BELIEVED_Y,
        TAKEN_BELIEVED_HEADING,
        CAMERA_X,
        CAMERA_Y,
        CAMERA_Z,
        CAMERA_QX,
        CAMERA_QY,
        CAMERA_QZ,
        CAMERA_QW,
    ],
};
