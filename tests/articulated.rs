//! Objects with joints: drawers, doors and lids load as bodies that move, by the equations of their
//! joints.

use std::sync::Arc;

use actcheck::base::Source;
use actcheck::config::{self, Overrides};
use actcheck::data::{BodyState, MovingPart, ObjectModel, PartJoint, Pose, Role, SceneObject};
use actcheck::history::History;
use actcheck::world::{GRAVITY, Poison, World, build};

use crate::physics::{block, body, object, scene};
use crate::support::{actcheck, copy, root, stderr, stdout};

/// A model of `tests/models/articulated`.
fn model(name: &str) -> Arc<ObjectModel> {
    let folder = root().join("tests/models/articulated");
    let text = format!(
        "tests = [[\"Pick\"]]\ntest_count = 1\nmodel_dir = \".\"\n[pickObject]\nmodel_list = [\"{name}\"]\n"
    );
    let source = Source::new(folder.join("c.toml").display().to_string(), text);
    let campaign = config::load_text(source, &folder, &Overrides::default()).unwrap();
    Arc::clone(&campaign.models[name])
}

/// The world with an object on the floor at the origin, with its parts.
fn alone(model: Arc<ObjectModel>, role: Role) -> World {
    let mass_kg = model.mass_kg;
    let whole = object("it", model, role, Pose::IDENTITY, mass_kg, 0.5);
    with_parts(whole)
}

fn with_parts(whole: SceneObject) -> World {
    let parts = whole.moving_parts();
    build(&scene([vec![whole], parts].concat())).unwrap()
}

fn run(world: &mut World, secs: f64) {
    let (command, until) = (world.hold(), world.time_secs() + secs);
    while world.time_secs() < until - 1e-9 {
        world.step(&command);
    }
    assert_eq!(world.fault(), None);
}

/// The position of a part's joint.
fn at(world: &World, id: &str) -> f64 {
    body(world, id).part.expect("it is a part").1
}

fn near(found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found - expected).abs() <= tolerance,
        "{found} is not {expected} ± {tolerance}"
    );
}

/// A block on a fixed one, with a joint between them whose axis goes through the moving block's
/// middle.
fn block_on_block(joint: PartJoint) -> World {
    let part = MovingPart {
        name: "part".to_owned(),
        model: block([0.1; 3]),
        pose: Pose::upright([0.0, 0.0, 1.0], 0.0),
        on: None,
        joint,
    };
    let whole = ObjectModel {
        moving: vec![part],
        ..Arc::unwrap_or_clone(block([0.1, 0.1, 0.5]))
    };
    alone(Arc::new(whole), Role::Platform)
}

/// One tick of the control.
const TICK_SECS: f64 = 1.0 / 60.0;

const RAIL: PartJoint = PartJoint {
    slides: true,
    axis: [1.0, 0.0, 0.0],
    anchor_m: [0.0, 0.0, 1.05],
    range: [f64::NEG_INFINITY, f64::INFINITY],
    damping: 0.0,
    friction: 0.0,
};

#[test]
fn a_cabinet_of_sdf_has_the_parts_of_its_file() {
    let cabinet = model("cabinet");
    let names: Vec<&str> = cabinet
        .moving
        .iter()
        .map(|part| part.name.as_str())
        .collect();
    assert_eq!(names, ["drawer", "door", "letter_flap"]);
    near(cabinet.mass_kg, 20.0, 1e-9);
    assert_eq!(cabinet.parts.len(), 4);
    let [drawer, door, flap] = [0, 1, 2].map(|idx| &cabinet.moving[idx]);
    assert_eq!([drawer.on, door.on, flap.on], [None, None, Some(1)]);
    assert!(drawer.joint.slides && !door.joint.slides);
    assert_eq!(
        (drawer.joint.range, drawer.joint.damping),
        ([0.0, 0.25], 3.0)
    );
    assert_eq!(
        (door.joint.axis, door.joint.friction),
        ([0.0, 0.0, -1.0], 0.2)
    );
    // The knob is screwed to the door.
    near(door.model.mass_kg, 2.1, 1e-9);
    assert_eq!(door.model.parts.len(), 2);
    // In the file, the front of the knob is at x = 0.23 and the back of the cabinet at −0.2; the
    // model's origin is between.
    near(cabinet.size_m[0], 0.43, 1e-6);
    for (found, expected) in door.joint.anchor_m.iter().zip([0.19 - 0.015, -0.29, 0.3]) {
        near(*found, expected, 1e-6);
    }
}

/// At rest nothing moves: the drawer is within the walls of the cabinet, and the flap hangs.
#[test]
fn closed_parts_stay_closed() {
    for role in [Role::Platform, Role::Other] {
        let mut world = alone(model("cabinet"), role);
        run(&mut world, 2.0);
        for (part, whole) in [
            ("it_drawer", "it"),
            ("it_door", "it"),
            ("it_letter_flap", "it"),
        ] {
            near(at(&world, part), 0.0, 2e-3);
            let state = body(&world, part);
            assert_eq!(state.part.as_ref().unwrap().0, whole);
            assert!(
                !state.fixed && state.asleep,
                "{part} does not come to rest as {role:?}"
            );
        }
        assert_eq!(body(&world, "it_letter_flap").rests_on, ["it_door"]);
        near(body(&world, "it").pose.position[2], 0.0, 1e-3);
    }
}

/// With viscous friction d, a mass m of speed v goes m·v / d · (1 − exp(−d·t / m)) in the time t.
#[test]
fn a_damped_drawer_slows_down_exponentially() {
    let damping = 2.0;
    let mut world = block_on_block(PartJoint { damping, ..RAIL });
    assert!(world.poison("it_part", Poison::Velocity([0.5, 0.0, 0.0])));
    run(&mut world, 1.0);
    let expected = 0.5 / damping * (1.0 - (-damping * world.time_secs()).exp());
    near(at(&world, "it_part"), expected, 0.02 * expected);
    near(body(&world, "it_part").pose.position[2], 1.0, 1e-3);
}

/// With Coulomb friction f, a mass m of speed v stops after m·v² / 2f.
#[test]
fn friction_stops_a_drawer_after_its_braking_distance() {
    let friction = 1.5;
    let mut world = block_on_block(PartJoint { friction, ..RAIL });
    assert!(world.poison("it_part", Poison::Velocity([0.6, 0.0, 0.0])));
    run(&mut world, 2.0);
    let expected = 0.6 * 0.6 / (2.0 * friction);
    near(at(&world, "it_part"), expected, 0.03 * expected);
}

#[test]
fn stops_hold_a_drawer() {
    let mut world = block_on_block(PartJoint {
        range: [-0.1, 0.2],
        ..RAIL
    });
    for (speed, end) in [(1.0, 0.2_f64), (-1.0, -0.1)] {
        assert!(world.poison("it_part", Poison::Velocity([speed, 0.0, 0.0])));
        let mut farthest = 0.0_f64;
        for _ in 0..90 {
            run(&mut world, TICK_SECS);
            farthest = farthest.max(at(&world, "it_part") * end.signum());
        }
        near(farthest, end.abs(), 5e-3);
    }
}

/// A block that hangs on an axis through its upper edge is a pendulum of the period 2π·√(I /
/// (m·g·l)).
#[test]
fn a_flap_swings_with_the_period_of_a_pendulum() {
    let mut world = block_on_block(PartJoint {
        slides: false,
        axis: [0.0, 1.0, 0.0],
        anchor_m: [0.0, 0.0, 1.1],
        ..RAIL
    });
    assert!(world.poison("it_part", Poison::Velocity([0.05, 0.0, 0.0])));
    let inertia = 0.1 * 0.1 / 6.0 + 0.05 * 0.05;
    let period = std::f64::consts::TAU * (inertia / (GRAVITY * 0.05)).sqrt();
    let (mut crossings, mut before) = (Vec::new(), 0.0);
    for _ in 0..180 {
        run(&mut world, TICK_SECS);
        let now = at(&world, "it_part");
        if before < 0.0 && now >= 0.0 || before > 0.0 && now <= 0.0 {
            crossings.push(world.time_secs() - world.tick_secs() * now / (now - before));
        }
        before = now;
    }
    let halves = crossings.len() as f64 - 1.0;
    assert!(halves >= 6.0, "{crossings:?}");
    near(
        2.0 * (crossings[crossings.len() - 1] - crossings[0]) / halves,
        period,
        0.02 * period,
    );
}

/// A lid that was opened falls shut, and stays on its hinge.
#[test]
fn the_lid_of_a_chest_falls_shut() {
    let chest = model("chest");
    near(chest.mass_kg, 3.0, 1e-9);
    assert_eq!(chest.moving[0].joint.range, [0.0, 2.0]);
    let mut world = alone(chest, Role::Other);
    run(&mut world, 0.5);
    assert!(world.poison("it_lid", Poison::Velocity([0.0, 0.0, 1.5])));
    let mut widest = 0.0_f64;
    for _ in 0..120 {
        run(&mut world, TICK_SECS);
        widest = widest.max(at(&world, "it_lid"));
    }
    assert!(widest > 0.1, "it opened by {widest} rad");
    near(at(&world, "it_lid"), 0.0, 0.01);
    let BodyState {
        pose: Pose {
            position: [x, ..], ..
        },
        ..
    } = body(&world, "it");
    near(x, 0.0, 0.02);
}

/// A whole run with a cabinet as the table: facts name the parts, and replay gives the same bits.
#[test]
fn a_campaign_with_a_cabinet_knows_its_parts() {
    let folder = tempfile::tempdir().unwrap();
    copy(
        &root().join("tests/models/articulated"),
        &folder.path().join("models"),
    );
    let text = "tests = [[\"Pick\"]]\ntest_count = 2\nseed = 4\nmodel_dir = \"models\"\n[objectSurface]\n\
        object_surfaces = [\"cabinet\"]\n[pickObject]\nmodel_list = [\"can\"]\n[categories]\ncabinet = \"act:Cabinet\"\n";
    std::fs::write(folder.path().join("c.toml"), text).unwrap();
    let ran = actcheck(folder.path(), &["run", "c.toml", "--jobs", "1"]);
    assert!(matches!(ran.status.code(), Some(0 | 1)), "{}", stderr(&ran));
    let query = "SELECT DISTINCT ?part ?whole ?class { GRAPH ?g { ?part w:partOf ?whole ; w:jointPosition ?at . \
        ?part a ?class } } ORDER BY ?part";
    let found = actcheck(folder.path(), &["query", query, "--format", "csv"]);
    let found = stdout(&found);
    assert_eq!(found.lines().count(), 4, "{found}");
    assert!(
        found.contains("cabinet_1_drawer") && found.contains("actions#Drawer"),
        "{found}"
    );
    // The trace keeps them, too.
    let history = History::open_to_read(&folder.path().join(".actcheck")).unwrap();
    let trace = history.traces().states("@last").unwrap();
    let parts = trace.snapshots.iter().map(|state| {
        let parts = state.bodies.iter().filter_map(|body| body.part.as_ref());
        parts.filter(|(whole, _)| whole == "cabinet_1").count()
    });
    assert!(parts.clone().count() >= 2 && parts.clone().all(|count| count == 3));
    drop(history);
    let replayed = actcheck(folder.path(), &["replay", "@last"]);
    assert_eq!(
        replayed.status.code(),
        Some(0),
        "{}{}",
        stdout(&replayed),
        stderr(&replayed)
    );
}

/// A world includes the cabinet twice: the one that is static there has no moving parts.
#[test]
fn parts_move_in_a_world_unless_their_model_is_static_there() {
    let folder = tempfile::tempdir().unwrap();
    copy(
        &root().join("tests/models/articulated"),
        &folder.path().join("models"),
    );
    let include = |name: &str, y: f64, is_static: bool| {
        format!(
            "<include><uri>model://cabinet</uri><name>{name}</name><pose>0 {y} 0 0 0 0</pose>\
            <static>{is_static}</static></include>"
        )
    };
    let world = [include("kitchen", 0.0, false), include("still", 2.0, true)].concat();
    std::fs::create_dir(folder.path().join("models/worlds")).unwrap();
    let world = format!("<sdf version=\"1.7\"><world name=\"w\">{world}</world></sdf>");
    std::fs::write(folder.path().join("models/worlds/w.world"), world).unwrap();
    let text = "tests = [[\"Pick\"]]\ntest_count = 1\nseed = 4\nmodel_dir = \"models\"\n[world]\nworlds = [\"w\"]\n\
        [objectSurface]\nobject_surfaces = [\"kitchen\"]\n[pickObject]\nmodel_list = [\"can\"]\n";
    std::fs::write(folder.path().join("c.toml"), text).unwrap();
    let ran = actcheck(folder.path(), &["run", "c.toml"]);
    assert!(matches!(ran.status.code(), Some(0 | 1)), "{}", stderr(&ran));
    let query = "SELECT DISTINCT ?whole { GRAPH ?g { ?part w:partOf ?whole } }";
    let found = stdout(&actcheck(
        folder.path(),
        &["query", query, "--format", "csv"],
    ));
    assert!(
        found.contains("kitchen") && found.lines().count() == 2,
        "{found}"
    );
}
