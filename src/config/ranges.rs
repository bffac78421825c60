//! Reads the tables of numbers: physics, sensing, camera and budget.

use actcheck_base::Diagnostics;
use actcheck_data::{
    Budget, CONTROL_HZ, Camera, Colour, DecorRanges, Odometry, Physics, Sensing, Texture,
};
use std::ops::Bound;

use crate::{Limits, Table, duration_secs};

const ABOVE_ZERO: (Bound<f64>, Bound<f64>) = (Bound::Excluded(0.0), Bound::Included(100.0));

/// Reads `[physics]`: the ranges of each object's mass, friction, size and restitution, and the
/// time step.
pub(crate) fn read_physics(root: &mut Table, found: &mut Diagnostics) -> Physics {
    let mut physics = Physics {
        mass_scale: (0.9, 1.1),
        friction_scale: (0.8, 1.2),
        size_scale: (1.0, 1.0),
        restitution: (0.0, 0.1),
        // 240 Hz with 4 iterations holds a friction grasp to 0.01 mm.
        steps_per_second: 240,
        iterations: 4,
        shortcuts: true,
    };
    let Some(mut table) = root.table("physics") else {
        return physics;
    };
    set(
        &mut physics.mass_scale,
        table.range("mass_scale", ABOVE_ZERO),
    );
    set(
        &mut physics.friction_scale,
        table.range("friction_scale", 0.0..=100.0),
    );
    // Beyond these factors it would be a different object.
    set(
        &mut physics.size_scale,
        table.range("size_scale", 0.5..=2.0),
    );
    set(
        &mut physics.restitution,
        table.range("restitution", 0.0..=1.0),
    );
    set(&mut physics.steps_per_second, read_steps(&mut table));
    set(
        &mut physics.iterations,
        table
            .integer("iterations", 1..=64)
            .and_then(|n| u32::try_from(n).ok()),
    );
    set(&mut physics.shortcuts, table.boolean("shortcuts"));
    table.finish(found);
    physics
}

fn read_steps(table: &mut Table) -> Option<u32> {
    let span = table.key_span("steps_per_second");
    let steps = u32::try_from(table.integer("steps_per_second", 60..=10_000)?).ok()?;
    if steps % CONTROL_HZ != 0 {
        let message = format!(
            "`physics.steps_per_second` is {steps}, which is not a multiple of {CONTROL_HZ}"
        );
        let help = format!(
            "it must be a multiple of the control rate, {CONTROL_HZ} Hz: use {} or {}",
            steps / CONTROL_HZ * CONTROL_HZ,
            (steps / CONTROL_HZ + 1) * CONTROL_HZ
        );
        table.fault("C013", span?, message, help);
    }
    Some(steps)
}

/// Reads `[sensing]`: standard deviations of the robot's sensing; 0, the default, is perfect.
pub(crate) fn read_sensing(root: &mut Table, found: &mut Diagnostics) -> Sensing {
    let (camera, decor) = read_camera(root, found);
    let mut sensing = Sensing {
        position_noise_m: 0.0,
        height_noise_m: 0.0,
        yaw_noise_rad: 0.0,
        size_noise_m: 0.0,
        localisation_noise_m: 0.0,
        heading_noise_rad: 0.0,
        gripper_noise_m: 0.0,
        odometry: Odometry::IDEAL,
        camera,
        decor,
    };
    let Some(mut table) = root.table("sensing") else {
        return sensing;
    };
    // Half a metre or half a turn (3.2 rad) of noise already makes sensing worthless.
    for (key, value, most) in [
        ("position_noise_m", &mut sensing.position_noise_m, 0.5),
        ("height_noise_m", &mut sensing.height_noise_m, 0.5),
        ("yaw_noise_rad", &mut sensing.yaw_noise_rad, 3.2),
        ("size_noise_m", &mut sensing.size_noise_m, 0.5),
        (
            "localisation_noise_m",
            &mut sensing.localisation_noise_m,
            0.5,
        ),
        ("heading_noise_rad", &mut sensing.heading_noise_rad, 3.2),
        ("gripper_noise_m", &mut sensing.gripper_noise_m, 0.5),
    ] {
        set(value, table.number(key, 0.0..=most));
    }
    let odometry = &mut sensing.odometry;
    // With half of the distance as drift, or 100 m between landmarks, localisation is already
    // worthless.
    for (key, value, most) in [
        ("odometry_drift", &mut odometry.drift, 0.5),
        ("heading_drift", &mut odometry.heading_drift, 0.5),
        ("landmark_every_m", &mut odometry.landmark_every_m, 100.0),
        ("landmark_noise_m", &mut odometry.landmark_noise_m, 0.5),
        ("landmark_noise_rad", &mut odometry.landmark_noise_rad, 3.2),
    ] {
        set(value, table.number(key, 0.0..=most));
    }
    table.finish(found);
    sensing
}

/// Reads `[camera]`: the camera, without noise by default, and the light and colours of images.
fn read_camera(root: &mut Table, found: &mut Diagnostics) -> (Camera, DecorRanges) {
    let mut camera = Camera::IDEAL;
    let Some(mut table) = root.table("camera") else {
        return (camera, DecorRanges::PLAIN);
    };
    // No depth camera has more than a million pixels, and such an image takes seconds to render.
    for (key, value) in [("width", &mut camera.width), ("height", &mut camera.height)] {
        set(
            value,
            table
                .integer(key, 16..=1024)
                .and_then(|count| u32::try_from(count).ok()),
        );
    }
    // The field of view of a perspective camera is less than pi.
    set(
        &mut camera.field_of_view_rad,
        table.number("field_of_view_rad", 0.1..=2.6),
    );
    let place = table
        .key_span("min_range_m")
        .or_else(|| table.key_span("max_range_m"));
    set(
        &mut camera.min_range_m,
        table.number("min_range_m", 0.0..=100.0),
    );
    set(
        &mut camera.max_range_m,
        table.number("max_range_m", ABOVE_ZERO),
    );
    if camera.min_range_m >= camera.max_range_m
        && let Some(place) = place
    {
        let message = format!(
            "the camera has an empty range, from {} m to {} m",
            camera.min_range_m, camera.max_range_m
        );
        table.fault(
            "C009",
            place,
            message,
            "`min_range_m` must be less than `max_range_m`",
        );
    }
    set(
        &mut camera.range_noise_m,
        table.number("range_noise_m", 0.0..=0.5),
    );
    set(&mut camera.dropout, table.number("dropout", 0.0..=1.0));
    set(
        &mut camera.grazing_rad,
        table.number("grazing_rad", 0.0..=1.5),
    );
    // With a fifth of full brightness as noise, nothing can be recognised.
    set(
        &mut camera.image_noise,
        table.number("image_noise", 0.0..=0.2),
    );
    let decor = read_decor(&mut table);
    table.finish(found);
    (camera, decor)
}

/// Reads the light and colours of images.
fn read_decor(table: &mut Table) -> DecorRanges {
    DecorRanges {
        // A whole turn to either side.
        light_azimuth_rad: table.range("light_azimuth_rad", -6.3..=6.3),
        // A light below the horizon shines through the floor.
        light_elevation_rad: table.range("light_elevation_rad", 0.1..=1.6),
        light_brightness: table.range("light_brightness", 0.0..=2.0),
        ambient: table.range("ambient", 0.0..=2.0),
        table_textures: read_words(
            table,
            "table_textures",
            "patterns: `plain`, `checker` or `wood`",
            Texture::from_word,
        ),
        table_colours: read_words(
            table,
            "table_colours",
            "colours such as `#b0865c`",
            Colour::from_hex,
        ),
        random_object_colours: table.boolean("random_object_colours").unwrap_or_default(),
    }
}

/// Reads a list of words that each mean something.
fn read_words<T>(
    table: &mut Table,
    key: &str,
    expected: &str,
    read: fn(&str) -> Option<T>,
) -> Vec<T> {
    let written = table.non_empty_strings(key).unwrap_or_default();
    let mut values = Vec::new();
    for word in written {
        match read(&word.value) {
            Some(value) => values.push(value),
            None => table.fault(
                "C004",
                word.span,
                format!(
                    "`{key}` must be a list of {expected}, but this is `{}`",
                    word.value
                ),
                format!("write {expected}"),
            ),
        }
    }
    values
}

/// Reads `[budget]`: limits on an action, on a run, and on the campaign.
pub(crate) fn read_budget(root: &mut Table, found: &mut Diagnostics) -> (Budget, Limits) {
    // A pick takes about ten seconds; after a minute it has failed.
    let (mut budget, mut limits) = (Budget { action_secs: 60.0 }, Limits::default());
    let Some(mut table) = root.table("budget") else {
        return (budget, limits);
    };
    set(
        &mut budget.action_secs,
        table.number(
            "action_secs",
            (Bound::Excluded(0.0), Bound::Included(3600.0)),
        ),
    );
    limits.run_secs = table.number(
        "run_secs",
        (Bound::Excluded(0.0), Bound::Included(86_400.0)),
    );
    limits.time_secs = read_duration(&mut table, "time");
    limits.until_width = table.number("until_width", (Bound::Excluded(0.0), Bound::Excluded(1.0)));
    limits.max_failures = table
        .integer("max_failures", 1..=i64::MAX)
        .map(i64::unsigned_abs);
    table.finish(found);
    (budget, limits)
}

fn read_duration(table: &mut Table, key: &str) -> Option<f64> {
    let written = table.string(key)?;
    match duration_secs(&written.value) {
        Ok(secs) => Some(secs),
        Err(reason) => {
            let message = format!("`budget.{key}`: {reason}");
            table.fault(
                "C006",
                written.span,
                message,
                format!("write it like `{key} = \"10m\"`"),
            );
            None
        }
    }
}

fn set<T>(place: &mut T, value: Option<T>) {
    if let Some(value) = value {
        *place = value;
    }
}
