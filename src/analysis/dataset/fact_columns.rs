//! The tables of a dataset about the world between actions and the events during them: the true
//! facts from which outcomes follow, with descriptions of their columns.

use crate::dataset::columns::{
    CAMERA_QW, CAMERA_QX, CAMERA_QY, CAMERA_QZ, CAMERA_X, CAMERA_Y, CAMERA_Z, ColumnSpec, RUN,
    STEP, TAKEN_AT, TAKEN_BASE_HEADING, TAKEN_BASE_X, TAKEN_BASE_Y, TAKEN_BELIEVED_HEADING,
    TAKEN_BELIEVED_X, TAKEN_BELIEVED_Y, TableSpec, bool, count, number, text,
};

const STATE: ColumnSpec = count(
    "state",
    "0 before the first action; N after the action of step N, which is before the next one",
);
const X: ColumnSpec = number("x_m", "m", "position in the world");
const Y: ColumnSpec = number("y_m", "m", "position in the world");
const Z: ColumnSpec = number("z_m", "m", "position in the world");
const QX: ColumnSpec = number("qx", "1", "rotation, as a unit quaternion");
const QY: ColumnSpec = number("qy", "1", "rotation");
const QZ: ColumnSpec = number("qz", "1", "rotation");
const QW: ColumnSpec = number("qw", "1", "rotation");

/// The robot in each state.
pub(super) const STATES: TableSpec = TableSpec {
    file: "states.parquet",
    rows: "one for each state of each run: before, between and after the actions",
    columns: &[
        RUN,
        STATE,
        number("time_s", "s", "simulated time since the scene was built"),
        number("base_x_m", "m", "true x of the base"),
        number("base_y_m", "m", "true y of the base"),
        number("base_heading_rad", "rad", "true heading of the base"),
        number("believed_x_m", "m", "localised x of the base"),
        number("believed_y_m", "m", "localised y of the base"),
        number(
            "believed_heading_rad",
            "rad",
            "localised heading of the base",
        ),
        number(
            "gripper_x_m",
            "m",
            "position in the world of the point between the fingertips",
        ),
        number("gripper_y_m", "m", "position of that point"),
        number("gripper_z_m", "m", "position of that point"),
        number(
            "gripper_qx",
            "1",
            "rotation of the gripper, as a unit quaternion; x is along the fingers, y across them",
        ),
        number("gripper_qy", "1", "rotation of the gripper"),
        number("gripper_qz", "1", "rotation of the gripper"),
        number("gripper_qw", "1", "rotation of the gripper"),
        number("opening_m", "m", "gap between the fingers"),
        text(
            "left_touches",
            "ids of the objects that the left finger touches (JSON)",
        ),
        text(
            "right_touches",
            "ids of the objects that the right finger touches (JSON)",
        ),
    ],
};

/// Objects and furniture in each state.
pub(super) const BODIES: TableSpec = TableSpec {
    file: "bodies.parquet",
    rows: "one for each state and object, with furniture and walls",
    columns: &[
        RUN,
        STATE,
        text("body", "id of the object"),
        text("model", "its model"),
        text("category", "its class (IRI)"),
        text(
            "kinds",
            "local names of its class and the superclasses, nearest first",
        ),
        text(
            "role",
            "its role in the scene: platform, target, other, place-other, obstacle or part",
        ),
        bool(
            "fixed",
            "whether it is furniture: robot and objects can't carry it away",
        ),
        X,
        Y,
        Z,
        QX,
        QY,
        QZ,
        QW,
        number("vx_m_s", "m/s", "velocity of its origin"),
        number("vy_m_s", "m/s", "velocity of its origin"),
        number("vz_m_s", "m/s", "velocity of its origin"),
        number("wx_rad_s", "rad/s", "angular velocity"),
        number("wy_rad_s", "rad/s", "angular velocity"),
        number("wz_rad_s", "rad/s", "angular velocity"),
        number("min_x_m", "m", "its bounding box in the world"),
        number("min_y_m", "m", "its bounding box"),
        number("min_z_m", "m", "its bounding box"),
        number("max_x_m", "m", "its bounding box"),
        number("max_y_m", "m", "its bounding box"),
        number("max_z_m", "m", "its bounding box"),
        number(
            "size_x_m",
            "m",
            "its size along its own x, with the scene's scale",
        ),
        number("size_y_m", "m", "its size along its own y"),
        number("size_z_m", "m", "its size along its own z"),
        number("mass_kg", "kg", "its mass"),
        number("friction", "1", "its friction coefficient"),
        number("restitution", "1", "its restitution coefficient"),
        text(
            "touches",
            "ids of the things that it touches: objects, robot or floor (JSON)",
        ),
        text(
            "rests_on",
            "ids of the things that support it against gravity: objects, robot or floor (JSON)",
        ),
        bool(
            "asleep",
            "whether the simulation has put it to sleep because it does not move",
        ),
        number(
            "gripper_distance_m",
            "m",
            "distance of its surface from the point between the fingertips; negative if that is inside; missing for \
             furniture",
        ),
    ],
};

/// Links of the robot in each state.
pub(super) const LINKS: TableSpec = TableSpec {
    file: "links.parquet",
    rows: "one for each state and link of the robot",
    columns: &[
        RUN,
        STATE,
        text("link", "name of the link in the URDF"),
        X,
        Y,
        Z,
        QX,
        QY,
        QZ,
        QW,
    ],
};

/// Contacts during actions.
pub(super) const CONTACTS: TableSpec = TableSpec {
    file: "contacts.parquet",
    rows: "one for each uninterrupted contact of two bodies during an action",
    columns: &[
        RUN,
        STEP,
        text(
            "first",
            "one of the two: id of an object, robot/LINK or floor",
        ),
        text("second", "the other one"),
        number(
            "start_s",
            "s",
            "start since the action began; 0 if the contact existed before",
        ),
        number("end_s", "s", "end since the action began"),
        number("max_force_n", "N", "largest normal force"),
        number("x_m", "m", "position in the world at the largest force"),
        number("y_m", "m", "position in the world"),
        number("z_m", "m", "position in the world"),
    ],
};

/// Links of the robot that pressed or penetrated each other.
pub(super) const SELF_CONTACTS: TableSpec = TableSpec {
    file: "self_contacts.parquet",
    rows: "one for each action and pair of links that pressed or penetrated each other",
    columns: &[
        RUN,
        STEP,
        text("first", "one of the two links: robot/LINK"),
        text("second", "the other one"),
        number("seen_at_s", "s", "first detection since the action began"),
        number(
            "max_depth_m",
            "m",
            "largest penetration depth where both are solid",
        ),
        number("max_force_n", "N", "largest normal force"),
        bool("of_hand", "both belong to the hand, whose fingers may meet"),
    ],
};

/// Perceived surfaces.
pub(super) const PLANES: TableSpec = TableSpec {
    file: "planes.parquet",
    rows: "one for each action that perceived a surface",
    columns: &[
        RUN,
        STEP,
        number(
            "x_m",
            "m",
            "perceived position of its centre, given the localised pose of the robot",
        ),
        number("y_m", "m", "perceived position"),
        number("z_m", "m", "perceived position"),
        number(
            "qx",
            "1",
            "perceived rotation, as a unit quaternion; z is the normal, x runs along the first side",
        ),
        number("qy", "1", "perceived rotation"),
        number("qz", "1", "perceived rotation"),
        number("qw", "1", "perceived rotation"),
        number("length_m", "m", "perceived size along its x"),
        number("width_m", "m", "perceived size along its y"),
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

/// Extremes of each body's motion.
pub(super) const EXTREMES: TableSpec = TableSpec {
    file: "extremes.parquet",
    rows: "one for each action and object",
    columns: &[
        RUN,
        STEP,
        text("body", "id of the object"),
        number("max_tilt_rad", "rad", "largest angle from the vertical"),
        number("max_speed_m_s", "m/s", "largest speed of its origin"),
        number(
            "max_rise_m",
            "m",
            "largest rise of its origin above the initial height",
        ),
        number(
            "max_displacement_m",
            "m",
            "largest distance of its origin from the initial position",
        ),
        number(
            "held_s",
            "s",
            "total time that both fingers touched it; missing if they never did",
        ),
        number(
            "held_tilt_rad",
            "rad",
            "largest angle from the vertical while held",
        ),
        number(
            "clearance_m",
            "m",
            "smallest distance of any link to it; 0 if they touched, missing beyond 0.5 m",
        ),
    ],
};

/// Holds and motions.
pub(super) const INTERVALS: TableSpec = TableSpec {
    file: "intervals.parquet",
    rows: "one for each hold or motion of an object; none in runs of versions that did not record them",
    columns: &[
        RUN,
        STEP,
        text(
            "kind",
            "hold: both fingers touch the object; motion: it is faster than 2 cm/s",
        ),
        text("body", "id of the object"),
        number("start_s", "s", "start since the action began"),
        number("end_s", "s", "end since the action began"),
    ],
};

/// Extremes of each joint.
pub(super) const JOINT_EXTREMES: TableSpec = TableSpec {
    file: "joint_extremes.parquet",
    rows: "one for each action and joint; none in runs of versions that did not measure them",
    columns: &[
        RUN,
        STEP,
        text("joint", "name of the joint in the URDF"),
        number(
            "max_excess",
            "m or rad",
            "largest excess over its limits; negative within them, missing if it has none",
        ),
        number(
            "max_speed_share",
            "1",
            "largest speed as a share of the joint's limit",
        ),
        number(
            "overload_s",
            "s",
            "longest uninterrupted time at the motor's effort limit; 0 for fingers",
        ),
    ],
};

/// Shapes of objects and links.
pub(super) const SHAPES: TableSpec = TableSpec {
    file: "shapes.parquet",
    rows: "one for each part of each object and link of each run; a body is the union of its parts",
    columns: &[
        RUN,
        text("body", "id of the object, or robot/LINK"),
        count("part", "number of the part, from 1"),
        text(
            "shape",
            "box, cylinder, sphere, capsule, tube or hull; axes are along the part's z",
        ),
        number(
            "x_m",
            "m",
            "position of the part's centre in the body's frame",
        ),
        number("y_m", "m", "position in the body's frame"),
        number("z_m", "m", "position in the body's frame"),
        number(
            "qx",
            "1",
            "rotation in the body's frame, as a unit quaternion",
        ),
        number("qy", "1", "rotation in the body's frame"),
        number("qz", "1", "rotation in the body's frame"),
        number("qw", "1", "rotation in the body's frame"),
        number("size_x_m", "m", "size of a box"),
        number("size_y_m", "m", "size of a box"),
        number(
            "size_z_m",
            "m",
            "size of a box; height of a cylinder, a tube, or a capsule without its hemispheres",
        ),
        number(
            "radius_m",
            "m",
            "radius of a cylinder, sphere or capsule; outer radius of a tube's lower rim",
        ),
        number("radius_high_m", "m", "outer radius of a tube's upper rim"),
        number("wall_m", "m", "thickness of a tube's wall"),
        count("staves", "number of boxes that approximate a tube's wall"),
        text(
            "points",
            "corners of a hull, reduced to the outermost ones in 26 directions (JSON)",
        ),
    ],
};

/// Named places of the world's map.
pub(super) const PLACES: TableSpec = TableSpec {
    file: "places.parquet",
    rows: "one for each location, room and surface on the map of the run's world",
    columns: &[
        RUN,
        text("kind", "location, room or surface"),
        text("name", "its name; the id of the furniture for a surface"),
        number("x_m", "m", "position of a location; centre of a surface"),
        number("y_m", "m", "position of a location; centre of a surface"),
        number("z_m", "m", "height of a surface"),
        number("heading_rad", "rad", "heading of a location"),
        text(
            "surface",
            "name of the surface that a location is in front of, if any",
        ),
        number("min_x_m", "m", "smallest x of a room"),
        number("min_y_m", "m", "smallest y of a room"),
        number("max_x_m", "m", "largest x of a room"),
        number("max_y_m", "m", "largest y of a room"),
        number("length_m", "m", "size of a surface along the furniture's x"),
        number("width_m", "m", "size of a surface along the furniture's y"),
    ],
};
