//! The columns of the table: name, type, unit, description and source.

use std::collections::BTreeSet;
use std::sync::LazyLock;

use serde::Serialize;
use serde_json::json;

use crate::tables::cell::Cell;
use crate::tables::effect_columns::{EFFECTS, NOISE};
use crate::tables::row_source::{RowSource, angle};
use actcheck_base::names;
use actcheck_data::Role;
use actcheck_history::ObjectDetail;

/// Type of a column's values. Any value may be missing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ColumnKind {
    /// Text. IRIs are not shortened.
    Text,
    /// A floating-point number.
    Number,
    /// An integer.
    Count,
    /// True or false.
    #[serde(rename = "truth")]
    Bool,
    /// An image as a PNG file.
    #[serde(rename = "png")]
    Image,
}

/// The meaning of a column's values for a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ColumnRole {
    /// The run, its outcomes, or a consequence that is nearly the outcome itself.
    Record,
    /// A parameter of the scene: a quantity fixed before the robot acts that may affect the
    /// outcome.
    Scene,
    /// Realised noise: an error drawn by chance, whatever the robot does. With the scene, it is a
    /// condition of the run.
    Noise,
    /// An event or an error during the action, as a consequence of the robot's behaviour.
    Effect,
}

/// A column of the table.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Column {
    /// Name of the column.
    pub name: &'static str,
    /// Type of its values.
    #[serde(rename = "type")]
    pub kind: ColumnKind,
    /// Unit of its numbers, empty if they have none.
    pub unit: &'static str,
    /// Whether it is a parameter of the scene.
    pub parameter: bool,
    /// The meaning of its values for a run.
    pub role: ColumnRole,
    /// Whether its numbers are directions, of which -π and π are equal.
    #[serde(skip)]
    pub wraps: bool,
    /// Description of its values.
    pub description: &'static str,
    #[serde(skip)]
    pub(super) cell: fn(&RowSource<'_>) -> Cell,
}

/// Returns all columns in order.
pub fn columns() -> &'static [Column] {
    static ALL: LazyLock<Vec<Column>> = LazyLock::new(|| [COLUMNS, NOISE, EFFECTS].concat());
    &ALL
}

const COLUMNS: &[Column] = &[
    text("run", "id of the run", |p| Cell::text(&p.run.row.run)),
    text("campaign", "id of the campaign", |p| {
        Cell::text(&p.run.row.campaign)
    }),
    count(
        "index",
        "position of the run in the campaign, from 0",
        |p| Cell::count(p.run.row.index),
    ),
    count(
        "scene",
        "number of the scene, if scenes are repeated",
        |p| {
            Cell::Count(
                p.run
                    .row
                    .repetition
                    .and_then(|repetition| repetition.scene.try_into().ok()),
            )
        },
    ),
    count(
        "repetition",
        "number of the run among those of its scene, from 0, if scenes are repeated",
        |p| {
            Cell::Count(
                p.run
                    .row
                    .repetition
                    .and_then(|repetition| repetition.number.try_into().ok()),
            )
        },
    ),
    number(
        "weight",
        "1",
        "importance weight of the scene, if a search chose it",
        |p| Cell::Number(p.run.row.weight),
    ),
    text(
        "test",
        "names of the run's actions, joined by a space",
        |p| Cell::text(&p.run.row.test),
    ),
    text(
        "status",
        "how the run ended: completed, broken or timeout",
        |p| Cell::text(p.run.row.status.word()),
    ),
    number("score", "1", "the run's score S", |p| {
        Cell::number(p.run.row.score)
    }),
    text("started", "when the run began (RFC 3339)", |p| {
        Cell::text(&p.run.row.started)
    }),
    text(
        "trace_hash",
        "digest of all states: runs with equal digests are identical",
        |p| Cell::text(&p.run.row.trace_hash),
    ),
    text(
        "program_version",
        "version of actcheck that performed the run",
        |p| Cell::text(&p.run.program_version),
    ),
    count("step", "position of the action in the test, from 1", |p| {
        Cell::count(p.action.step)
    }),
    text("action", "the action (IRI)", |p| {
        Cell::text(&p.action.action)
    }),
    text(
        "action_end",
        "how the action ended: completed, broken, timeout, untested or inapplicable",
        |p| Cell::text(&p.action.end),
    ),
    truth("reported", "whether the action reported success", |p| {
        Cell::Bool(p.action.reported)
    }),
    text(
        "message",
        "the action's message, or the reason why it did not complete",
        |p| Cell::Text(p.action.message.clone()),
    ),
    number(
        "duration_s",
        "s",
        "simulated time that the action took",
        |p| Cell::number(p.action.duration_secs),
    ),
    text("property", "the property (IRI)", |p| {
        Cell::text(&p.judgement.property)
    }),
    text(
        "outcome",
        "passed, failed, inapplicable, broken, timeout or untested",
        |p| Cell::text(p.judgement.outcome.word()),
    ),
    number(
        "margin",
        "the property's",
        "distance of the outcome from flipping; positive if passed",
        |p| Cell::Number(p.judgement.margin),
    ),
    text("witness", "explanation of the outcome", |p| {
        Cell::text(&p.judgement.witness)
    }),
    truth(
        "held_before",
        "whether the property already held before the action",
        |p| Cell::Bool(p.judgement.held_before),
    ),
    truth(
        "vacuous",
        "whether the property passed without any left side of an `implies` holding",
        |p| Cell::Bool(p.judgement.vacuous),
    ),
    text(
        "designators",
        "designators of the action with their values; objects are given by their models (JSON)",
        designators,
    ),
    text(
        "objects",
        "models of all objects of the scene, each with its class: `glass (Glass), mug (Mug)`",
        objects,
    ),
    text("world", "name of the world", |p| Cell::text(&p.run.world)).of_scene(),
    number(
        "base_x_m",
        "m",
        "initial x of the base, in the world",
        |p| Cell::number(p.run.robot_base[0]),
    )
    .of_scene(),
    number(
        "base_y_m",
        "m",
        "initial y of the base, in the world",
        |p| Cell::number(p.run.robot_base[1]),
    )
    .of_scene(),
    number("base_yaw_rad", "rad", "initial heading of the base", |p| {
        Cell::number(p.run.robot_base[2])
    })
    .wrapping()
    .of_scene(),
    count(
        "others",
        "number of clutter objects around the target",
        |p| Cell::count(with_role(p, Role::Other)),
    )
    .of_scene(),
    count(
        "place_others",
        "number of objects on the surface where the target is to be placed",
        |p| Cell::count(with_role(p, Role::PlaceOther)),
    )
    .of_scene(),
    count("obstacles", "number of obstacles on the floor", |p| {
        Cell::count(with_role(p, Role::Obstacle))
    })
    .of_scene(),
    text(
        "surface_category",
        "class of the platform under the target (IRI)",
        |p| category(p.scene.surface),
    )
    .of_scene(),
    text("surface_model", "model of the platform", |p| {
        model(p.scene.surface)
    })
    .of_scene(),
    text("target_category", "class of the target (IRI)", |p| {
        category(p.scene.target)
    })
    .of_scene(),
    text(
        "target_model",
        "model of the target, the object that the action handles",
        |p| model(p.scene.target),
    )
    .of_scene(),
    number(
        "target_x_m",
        "m",
        "initial x of the target, in the world",
        |p| of_target(p, |t| t.x),
    )
    .of_scene(),
    number(
        "target_y_m",
        "m",
        "initial y of the target, in the world",
        |p| of_target(p, |t| t.y),
    )
    .of_scene(),
    number(
        "target_z_m",
        "m",
        "initial z of the target, in the world",
        |p| of_target(p, |t| t.z),
    )
    .of_scene(),
    number(
        "target_yaw_rad",
        "rad",
        "initial yaw of the target, in the world",
        |p| of_target(p, |t| angle(t.yaw)),
    )
    .wrapping()
    .of_scene(),
    number("target_mass_kg", "kg", "mass of the target", |p| {
        of_target(p, |t| t.mass_kg)
    })
    .of_scene(),
    number(
        "target_friction",
        "1",
        "friction coefficient of the target",
        |p| of_target(p, |t| t.friction),
    )
    .of_scene(),
    number(
        "target_restitution",
        "1",
        "restitution coefficient of the target",
        |p| of_target(p, |t| t.restitution),
    )
    .of_scene(),
    number(
        "robot_distance_m",
        "m",
        "horizontal distance of the target from the base",
        |p| of_target(p, |t| t.robot_distance_m),
    )
    .of_scene(),
    number(
        "target_ahead_m",
        "m",
        "initial distance of the target ahead of the base",
        |p| {
            Cell::Number(
                p.scene
                    .target_from_base(p.run.robot_base)
                    .map(|[ahead, _]| ahead),
            )
        },
    )
    .of_scene(),
    number(
        "target_left_m",
        "m",
        "initial distance of the target to the left of the base",
        |p| {
            Cell::Number(
                p.scene
                    .target_from_base(p.run.robot_base)
                    .map(|[_, left]| left),
            )
        },
    )
    .of_scene(),
    number(
        "target_turned_rad",
        "rad",
        "initial yaw of the target, relative to the base",
        |p| of_target(p, |t| angle(t.yaw - p.run.robot_base[2])),
    )
    .wrapping()
    .of_scene(),
    number(
        "surface_x_m",
        "m",
        "position of the target on its surface, from the centre along the surface's x",
        |p| Cell::Number(p.scene.target_on_surface().map(|[x, _]| x)),
    )
    .of_scene(),
    number(
        "surface_y_m",
        "m",
        "position of the target on its surface, from the centre along the surface's y",
        |p| Cell::Number(p.scene.target_on_surface().map(|[_, y]| y)),
    )
    .of_scene(),
    text(
        "neighbour_category",
        "class of the object nearest to the target (IRI)",
        |p| category(neighbour(p)),
    )
    .of_scene(),
    text(
        "neighbour_model",
        "model of the object nearest to the target",
        |p| model(neighbour(p)),
    )
    .of_scene(),
    number(
        "neighbour_distance_m",
        "m",
        "horizontal distance between the centres of the nearest object and the target",
        |p| Cell::Number(p.scene.neighbour.map(|(_, distance)| distance)),
    )
    .of_scene(),
    number(
        "neighbour_direction_rad",
        "rad",
        "direction from the target to the nearest object; 0 is towards the base",
        |p| Cell::Number(p.scene.neighbour_direction(p.run.robot_base)),
    )
    .wrapping()
    .of_scene(),
    number(
        "obstacle_distance_m",
        "m",
        "distance of the nearest obstacle from the straight line to the target",
        |p| Cell::Number(p.scene.obstacle_distance_m),
    )
    .of_scene(),
    number(
        "position_noise_m",
        "m",
        "standard deviation of the error of perceived positions",
        |p| noise(p, "positionNoise"),
    )
    .of_scene(),
    number(
        "height_noise_m",
        "m",
        "standard deviation of the error of perceived heights",
        |p| noise(p, "heightNoise"),
    )
    .of_scene(),
    number(
        "yaw_noise_rad",
        "rad",
        "standard deviation of the error of perceived headings",
        |p| noise(p, "yawNoise"),
    )
    .of_scene(),
    number(
        "size_noise_m",
        "m",
        "standard deviation of the error of perceived sizes",
        |p| noise(p, "sizeNoise"),
    )
    .of_scene(),
    number(
        "localisation_noise_m",
        "m",
        "standard deviation of the error of the robot's localised position",
        |p| noise(p, "localisationNoise"),
    )
    .of_scene(),
    number(
        "heading_noise_rad",
        "rad",
        "standard deviation of the error of the robot's localised heading",
        |p| noise(p, "headingNoise"),
    )
    .of_scene(),
    number(
        "gripper_noise_m",
        "m",
        "standard deviation of the error of the gripper's opening",
        |p| noise(p, "gripperNoise"),
    )
    .of_scene(),
    number(
        "range_noise_m",
        "m",
        "standard deviation of the error of the camera's ranges",
        |p| noise(p, "rangeNoise"),
    )
    .of_scene(),
    number(
        "odometry_drift",
        "1",
        "standard deviation of the error of odometry, as a share of the distance travelled",
        |p| noise(p, "odometryDrift"),
    )
    .of_scene(),
    number(
        "heading_drift_rad",
        "rad",
        "standard deviation of the error of the odometry's heading, for each radian and metre",
        |p| noise(p, "odometryHeadingDrift"),
    )
    .of_scene(),
    number(
        "landmark_every_m",
        "m",
        "distance between landmarks; 0 without landmarks",
        |p| noise(p, "landmarkDistance"),
    )
    .of_scene(),
    number(
        "landmark_noise_m",
        "m",
        "standard deviation of the error of positions from landmarks",
        |p| noise(p, "landmarkNoise"),
    )
    .of_scene(),
    number(
        "landmark_noise_rad",
        "rad",
        "standard deviation of the error of headings from landmarks",
        |p| noise(p, "landmarkHeadingNoise"),
    )
    .of_scene(),
    number(
        "target_displacement_m",
        "m",
        "displacement of the target during the run",
        |p| Cell::Number(p.scene.target.and_then(|target| target.displacement_m)),
    ),
    number(
        "target_tilt_rad",
        "rad",
        "largest tilt of the target from the vertical during the run",
        |p| Cell::Number(p.scene.target.and_then(|target| target.max_tilt_rad)),
    ),
    number(
        "others_displacement_m",
        "m",
        "largest displacement of any other object during the run",
        |p| {
            let others = p
                .run
                .objects
                .iter()
                .filter(|object| object.role.is_bystander());
            Cell::Number(
                others
                    .filter_map(|object| object.displacement_m)
                    .max_by(f64::total_cmp),
            )
        },
    ),
    text(
        "surroundings",
        "things that the action is not to touch: where they were, and how hard they were hit (JSON)",
        |p| {
            let json = p
                .effects
                .surroundings
                .as_ref()
                .and_then(|around| serde_json::to_string(around).ok());
            Cell::Text(json)
        },
    ),
];

pub(super) type CellOf = fn(&RowSource<'_>) -> Cell;

pub(super) const fn text(name: &'static str, description: &'static str, cell: CellOf) -> Column {
    Column {
        name,
        kind: ColumnKind::Text,
        unit: "",
        parameter: false,
        role: ColumnRole::Record,
        wraps: false,
        description,
        cell,
    }
}

pub(super) const fn number(
    name: &'static str,
    unit: &'static str,
    description: &'static str,
    cell: CellOf,
) -> Column {
    Column {
        name,
        kind: ColumnKind::Number,
        unit,
        parameter: false,
        role: ColumnRole::Record,
        wraps: false,
        description,
        cell,
    }
}

const fn count(name: &'static str, description: &'static str, cell: CellOf) -> Column {
    Column {
        name,
        kind: ColumnKind::Count,
        unit: "",
        parameter: false,
        role: ColumnRole::Record,
        wraps: false,
        description,
        cell,
    }
}

const fn truth(name: &'static str, description: &'static str, cell: CellOf) -> Column {
    Column {
        name,
        kind: ColumnKind::Bool,
        unit: "",
        parameter: false,
        role: ColumnRole::Record,
        wraps: false,
        description,
        cell,
    }
}

impl Column {
    const fn of_scene(mut self) -> Self {
        (self.parameter, self.role) = (true, ColumnRole::Scene);
        self
    }

    pub(super) const fn in_role(mut self, role: ColumnRole) -> Self {
        self.role = role;
        self
    }

    pub(super) const fn wrapping(mut self) -> Self {
        self.wraps = true;
        self
    }

    /// Whether it is known before the robot acts, or drawn by chance: a parameter of the scene, or
    /// noise.
    pub fn is_condition(&self) -> bool {
        matches!(self.role, ColumnRole::Scene | ColumnRole::Noise)
    }

    /// Whether it is an effect.
    pub fn is_effect(&self) -> bool {
        self.role == ColumnRole::Effect
    }
}

fn with_role(source: &RowSource<'_>, role: Role) -> usize {
    source
        .run
        .objects
        .iter()
        .filter(|object| object.role == role)
        .count()
}

fn model(object: Option<&ObjectDetail>) -> Cell {
    Cell::Text(object.map(|object| object.model.clone()))
}

fn category(object: Option<&ObjectDetail>) -> Cell {
    Cell::Text(object.map(|object| object.category.clone()))
}

fn neighbour<'a>(source: &RowSource<'a>) -> Option<&'a ObjectDetail> {
    source.scene.neighbour.map(|(object, _)| object)
}

fn objects(source: &RowSource<'_>) -> Cell {
    let named = |object: &ObjectDetail| {
        let (model, class) = (&object.model, names::local(&object.category));
        if class.is_empty() {
            model.clone()
        } else {
            format!("{model} ({class})")
        }
    };
    let all: BTreeSet<String> = source.run.objects.iter().map(named).collect();
    Cell::text(all.into_iter().collect::<Vec<_>>().join(", "))
}

fn of_target(source: &RowSource<'_>, number: impl Fn(&ObjectDetail) -> f64) -> Cell {
    Cell::Number(source.scene.target.map(number))
}

fn noise(source: &RowSource<'_>, name: &str) -> Cell {
    Cell::Number(source.run.noise.get(name).copied())
}

fn designators(source: &RowSource<'_>) -> Cell {
    let named = |value: &String| {
        let object = source.run.objects.iter().find(|object| object.id == *value);
        object.map_or_else(
            || names::local(value).to_owned(),
            |object| object.model.clone(),
        )
    };
    let values = source.action.parameters.iter();
    let json: serde_json::Map<String, serde_json::Value> = values
        .map(|(name, values)| {
            (
                name.clone(),
                json!(values.iter().map(named).collect::<Vec<_>>()),
            )
        })
        .collect();
    Cell::text(serde_json::Value::Object(json).to_string())
}
