//! The tables of a dataset: their columns, and what each says.

use serde::Serialize;

use crate::analysis::ColumnKind;

/// One column.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct Said {
    pub name: &'static str,
    #[serde(rename = "type")]
    pub kind: ColumnKind,
    pub unit: &'static str,
    pub description: &'static str,
}

/// One table.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct TableSaid {
    pub file: &'static str,
    pub rows: &'static str,
    pub columns: &'static [Said],
}

const fn text(name: &'static str, description: &'static str) -> Said {
    Said { name, kind: ColumnKind::Text, unit: "", description }
}

const fn count(name: &'static str, description: &'static str) -> Said {
    Said { name, kind: ColumnKind::Count, unit: "", description }
}

const fn truth(name: &'static str, description: &'static str) -> Said {
    Said { name, kind: ColumnKind::Truth, unit: "", description }
}

const fn number(name: &'static str, unit: &'static str, description: &'static str) -> Said {
    Said { name, kind: ColumnKind::Number, unit, description }
}

const RUN: Said = text("run", "id of the run");
const STEP: Said = count("step", "position of the action in the test, from 1");
const TIME: Said = number("time_s", "s", "since the action began; ten rows a second, and the first is how it began");

/// What was done, and what came of it.
pub(super) const ACTIONS: TableSaid = TableSaid {
    file: "actions.parquet",
    rows: "one for each action of each run",
    columns: &[
        RUN,
        text("campaign", "id of its campaign"),
        count("index", "position of the run in the campaign, from 0"),
        STEP,
        text("action", "the action (IRI)"),
        text("parameters", "values of its designators (JSON)"),
        text("end", "how it ended: completed, broken, timeout or untested"),
        truth("reported", "whether it reported success itself"),
        text("message", "its own words, or why it did not complete"),
        number("duration_s", "s", "simulated time that it took"),
        count("properties_passed", "how many of its success properties passed; outcomes.parquet has each"),
        count("properties", "how many it has"),
        number("score", "1", "share of its properties that passed"),
    ],
};

/// What each joint measured and was told.
pub(super) const JOINTS: TableSaid = TableSaid {
    file: "joints.parquet",
    rows: "one for each action, moment and joint",
    columns: &[
        RUN,
        STEP,
        TIME,
        text("joint", "its name in the URDF"),
        number("position", "m or rad", "observation: measured position, that of the base by the robot's own belief"),
        number("velocity", "m/s or rad/s", "observation: measured velocity"),
        number("effort", "N or N m", "observation: what its motor gives beyond what holds the robot's own weight"),
        number(
            "target",
            "m or rad",
            "command: where its controller was told to go in the control tick that ended then",
        ),
    ],
};

/// What the robot as a whole measured and was told.
pub(super) const ROBOT: TableSaid = TableSaid {
    file: "robot.parquet",
    rows: "one for each action and moment",
    columns: &[
        RUN,
        STEP,
        TIME,
        number("opening_m", "m", "observation: measured gap between the fingers"),
        number("finger_left_n", "N", "observation: what the left finger presses with"),
        number("finger_right_n", "N", "observation: what the right finger presses with"),
        number("told_opening_m", "m", "command: the gap that the fingers were told to go to"),
        number("told_force_n", "N", "command: the largest force that a finger was told to give"),
        number("base_x_m", "m", "observation: where the base believes that it is"),
        number("base_y_m", "m", "observation: where the base believes that it is"),
        number("base_heading_rad", "rad", "observation: which way the base believes that it faces"),
        number("true_base_x_m", "m", "truth: where the base is"),
        number("true_base_y_m", "m", "truth: where the base is"),
        number("true_base_heading_rad", "rad", "truth: which way the base faces"),
    ],
};

/// Where things truly were.
pub(super) const OBJECTS: TableSaid = TableSaid {
    file: "objects.parquet",
    rows: "one for each action, moment and object that can move: the truth, which no robot is told",
    columns: &[
        RUN,
        STEP,
        TIME,
        text("object", "its id"),
        number("x_m", "m", "true position in the world, of the middle of its foot"),
        number("y_m", "m", "true position in the world"),
        number("z_m", "m", "true position in the world"),
        number("qx", "1", "true rotation, as a unit quaternion"),
        number("qy", "1", "true rotation"),
        number("qz", "1", "true rotation"),
        number("qw", "1", "true rotation"),
    ],
};

/// What the robot took things for.
pub(super) const PERCEPTS: TableSaid = TableSaid {
    file: "percepts.parquet",
    rows: "one for each thing that was perceived, in the order in which it was",
    columns: &[
        RUN,
        STEP,
        count("number", "which of the action's it is, from 1"),
        text("source", "detector: the reference perception was asked; reported: the action told it in its end"),
        text("object", "its id, where the perception names one"),
        text("category", "what it seems to be (IRI), where that is told"),
        number("x_m", "m", "where its foot seems to be, by the base's belief of where it stands itself"),
        number("y_m", "m", "where its foot seems to be"),
        number("z_m", "m", "where its foot seems to be"),
        number("qx", "1", "how it seems to be turned, as a unit quaternion"),
        number("qy", "1", "how it seems to be turned"),
        number("qz", "1", "how it seems to be turned"),
        number("qw", "1", "how it seems to be turned"),
        number("width_m", "m", "how large it seems to be along its own x"),
        number("depth_m", "m", "how large it seems to be along its own y"),
        number("height_m", "m", "how high it seems to be"),
    ],
};
