//! The columns of realised noise and of effects, which come from a run's choices and its trace.
//! They are missing in runs whose trace can't be read.

use crate::tables::cell::Cell;
use crate::tables::columns::{Column, ColumnRole, number, text};
use crate::tables::row_source::RowSource;

/// Realised noise: the errors that a run drew. Errors of the target are of the first look at it.
pub(super) const NOISE: &[Column] = &[
    noise(
        "sense_target_x_m",
        "m",
        "error drawn for the target's perceived x, in the world",
        |p| of_target(p, 0),
    ),
    noise(
        "sense_target_y_m",
        "m",
        "error drawn for the target's perceived y, in the world",
        |p| of_target(p, 1),
    ),
    noise(
        "sense_target_z_m",
        "m",
        "error drawn for the target's perceived height",
        |p| of_target(p, 2),
    ),
    noise(
        "sense_target_xy_m",
        "m",
        "horizontal size of the error drawn for the target's perceived position",
        |p| Cell::Number(p.noise.target_xy_m()),
    ),
    noise(
        "sense_target_yaw_rad",
        "rad",
        "error drawn for the target's perceived yaw",
        |p| of_target(p, 3),
    ),
    noise(
        "sense_target_width_m",
        "m",
        "error drawn for the target's perceived size along its x",
        |p| of_target(p, 4),
    ),
    noise(
        "sense_target_depth_m",
        "m",
        "error drawn for the target's perceived size along its y",
        |p| of_target(p, 5),
    ),
    noise(
        "sense_target_height_m",
        "m",
        "error drawn for the target's perceived vertical size",
        |p| of_target(p, 6),
    ),
    noise(
        "sense_others_xy_m",
        "m",
        "largest horizontal error drawn for any other perceived object",
        |p| Cell::Number(p.noise.others_xy_m),
    ),
    noise(
        "sense_localisation_x_m",
        "m",
        "error drawn for the initial localisation along the world's x",
        |p| Cell::Number(p.noise.localisation[0]),
    ),
    noise(
        "sense_localisation_y_m",
        "m",
        "error drawn for the initial localisation along the world's y",
        |p| Cell::Number(p.noise.localisation[1]),
    ),
    noise(
        "sense_localisation_xy_m",
        "m",
        "horizontal size of the error drawn for the initial localisation",
        |p| Cell::Number(p.noise.localisation_xy_m()),
    ),
    noise(
        "sense_localisation_heading_rad",
        "rad",
        "error drawn for the initial heading",
        |p| Cell::Number(p.noise.localisation[2]),
    ),
    noise(
        "sense_odometry_along",
        "1",
        "mean error drawn for the odometry along the path, as a share of it",
        |p| Cell::Number(p.noise.odometry[0]),
    ),
    noise(
        "sense_odometry_across",
        "1",
        "mean error drawn for the odometry across the path, as a share of it",
        |p| Cell::Number(p.noise.odometry[1]),
    ),
    noise(
        "sense_odometry_turning",
        "1",
        "mean error drawn for the odometry's heading, as a share of the turn",
        |p| Cell::Number(p.noise.odometry[2]),
    ),
    noise(
        "sense_odometry_veering",
        "rad/m",
        "mean error drawn for the odometry's heading, by distance",
        |p| Cell::Number(p.noise.odometry[3]),
    ),
    noise(
        "sense_landmark_x_m",
        "m",
        "largest error drawn for a landmark's measurement of x, with its sign",
        |p| Cell::Number(p.noise.landmark[0]),
    ),
    noise(
        "sense_landmark_y_m",
        "m",
        "largest error drawn for a landmark's measurement of y, with its sign",
        |p| Cell::Number(p.noise.landmark[1]),
    ),
    noise(
        "sense_landmark_heading_rad",
        "rad",
        "largest error drawn for a landmark's heading, with its sign",
        |p| Cell::Number(p.noise.landmark[2]),
    ),
    noise(
        "sense_gripper_m",
        "m",
        "largest error drawn for the gap between the fingers, with its sign",
        |p| Cell::Number(p.noise.gripper_m),
    ),
];

/// Effects: events and errors during the action.
pub(super) const EFFECTS: &[Column] = &[
    effect(
        "target_perceived_off_m",
        "m",
        "horizontal distance of the target's perceived position from the true one, without the error of localisation",
        |p| Cell::Number(p.effects.perceived.map(|error| error.off_m())),
    ),
    effect(
        "target_perceived_ahead_m",
        "m",
        "the part of that distance ahead of the base",
        |p| Cell::Number(p.effects.perceived.map(|error| error.ahead_m)),
    ),
    effect(
        "target_perceived_left_m",
        "m",
        "the part of that distance to the left of the base",
        |p| Cell::Number(p.effects.perceived.map(|error| error.left_m)),
    ),
    effect(
        "target_perceived_above_m",
        "m",
        "perceived height of the target above the true one",
        |p| Cell::Number(p.effects.perceived.map(|error| error.above_m)),
    ),
    effect(
        "localisation_off_m",
        "m",
        "distance of the believed base from the true one when the action ended",
        |p| Cell::Number(p.effects.localisation_off.map(|[off, _]| off)),
    ),
    effect(
        "localisation_off_rad",
        "rad",
        "angle of the believed heading to the true one when the action ended",
        |p| Cell::Number(p.effects.localisation_off.map(|[_, off]| off)),
    ),
    noted(
        "first_contact_category",
        "class of the first thing touched that is not to be (IRI)",
        |p| {
            Cell::Text(
                p.effects
                    .first_contact
                    .as_ref()
                    .map(|first| first.category.clone()),
            )
        },
    ),
    effect(
        "first_contact_s",
        "s",
        "time of that contact, since the action began; more than 1 N counts",
        |p| Cell::Number(p.effects.first_contact.as_ref().map(|first| first.at_secs)),
    ),
    noted(
        "first_contact_phase",
        "phase of the action in which that contact began",
        |p| {
            Cell::Text(
                p.effects
                    .first_contact
                    .as_ref()
                    .and_then(|first| first.phase.clone()),
            )
        },
    ),
    effect(
        "largest_force_n",
        "N",
        "largest force on a thing that is not to be touched; 0 without a contact",
        |p| {
            Cell::Number(
                p.effects
                    .largest_force
                    .as_ref()
                    .map(|largest| largest.force_n),
            )
        },
    ),
    noted(
        "largest_force_category",
        "class of the thing with the largest force (IRI)",
        |p| {
            Cell::Text(
                p.effects
                    .largest_force
                    .as_ref()
                    .and_then(|largest| largest.category.clone()),
            )
        },
    ),
    effect(
        "base_force_n",
        "N",
        "largest force of the robot's base on such a thing; 0 without a contact",
        |p| Cell::Number(p.effects.base_pressed.map(|[force, _]| force)),
    ),
    effect(
        "base_pressed_s",
        "s",
        "total time for which the base pressed such things",
        |p| Cell::Number(p.effects.base_pressed.map(|[_, secs]| secs)),
    ),
    effect(
        "goal_off_m",
        "m",
        "distance of the base from the location it was sent to, when the action ended",
        |p| Cell::Number(p.effects.goal_off_m),
    ),
    effect(
        "target_contact_s",
        "s",
        "time at which the robot first touched the target, since the action began",
        |p| Cell::Number(p.effects.target_contact_secs),
    ),
    noted(
        "target_contact_phase",
        "phase of the action in which the robot first touched the target",
        |p| Cell::Text(p.effects.target_contact_phase.clone()),
    ),
    noted("last_phase", "phase that the action reached", |p| {
        Cell::Text(p.effects.last_phase.clone())
    }),
];

type Of = fn(&RowSource<'_>) -> Cell;

const fn noise(
    name: &'static str,
    unit: &'static str,
    description: &'static str,
    cell: Of,
) -> Column {
    number(name, unit, description, cell).in_role(ColumnRole::Noise)
}

const fn effect(
    name: &'static str,
    unit: &'static str,
    description: &'static str,
    cell: Of,
) -> Column {
    number(name, unit, description, cell).in_role(ColumnRole::Effect)
}

const fn noted(name: &'static str, description: &'static str, cell: Of) -> Column {
    text(name, description, cell).in_role(ColumnRole::Effect)
}

fn of_target(source: &RowSource<'_>, axis: usize) -> Cell {
    Cell::Number(source.noise.target[axis])
}
