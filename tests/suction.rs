//! Suction cups: seals against closed forms, and picks of an arm with a cup.

use std::path::Path;
use std::sync::Arc;

use actcheck::base::Files;
use actcheck::data::{
    Hand, LinkFrame, ObjectModel, Part, Pose, RobotProfile, RobotStart, Role, SceneObject, Shape,
    Suction,
};
use actcheck::world::{Command, GRAVITY, World, build};
use serde_json::Value;

use crate::physics::{block, object, scene};
use crate::support::{actcheck, root, shipped_project, stderr, stdout};

/// Pull that the cup of the crane holds, and radius of its lip. Units: newtons, metres.
const FORCE_N: f64 = 20.0;
const RADIUS_M: f64 = 0.02;
/// Mass that the crane lifts besides its load. Unit: kilograms.
const CRANE_KG: f64 = 4.0;
/// Top of the platform below the load. Unit: metres.
const TOP_M: f64 = 0.5;
/// Gap between the lip and the load. Unit: metres.
const GAP_M: f64 = 1e-3;
/// Joints of the crane, and the mass that the second moves besides the load. Unit: kilograms.
const LIFT: usize = 0;
const SLIDE: usize = 1;
const TROLLEY_KG: f64 = 1.0;

/// The crane, with its cup at `link` and its lift at this height. Unit: metres.
fn crane(link: &str, lift_m: f64) -> RobotProfile {
    let path = Path::new("tests/models/suction/crane.toml");
    let stated = actcheck::config::robot::read(&Files::Disk, path).expect("the crane is right");
    let profile = stated.complete().expect("it states all roles");
    let suction = profile.hand.suction.expect("the crane has a cup");
    assert_eq!(
        suction,
        Suction {
            force_n: FORCE_N,
            radius_m: RADIUS_M,
            friction: 0.5
        }
    );
    let grasp = LinkFrame {
        link: link.to_owned(),
        ..profile.hand.grasp
    };
    RobotProfile {
        hand: Hand::of_cup(grasp, suction),
        home: vec![lift_m, 0.0],
        ..profile
    }
}

/// A load on a platform, with its middle at `x` and its foot at the top of the platform.
fn load(model: Arc<ObjectModel>, x: f64, mass_kg: f64) -> SceneObject {
    object(
        "load",
        model,
        Role::Target,
        Pose::upright([x, 0.0, TOP_M], 0.0),
        mass_kg,
        0.5,
    )
}

/// The crane's world.
fn world(profile: RobotProfile, load: SceneObject) -> World {
    let platform = object(
        "platform",
        block([1.0, 1.0, TOP_M]),
        Role::Platform,
        Pose::upright([0.0, 0.0, 0.0], 0.0),
        1.0,
        0.5,
    );
    let mut scene = scene(vec![platform, load]);
    let root_height_m = profile.core.mount_height_m;
    scene.robot = RobotStart {
        profile: Arc::new(profile),
        base: [0.0; 3],
        root_height_m,
        knows: Arc::new([]),
    };
    let mut world = build(&scene).expect("the scene is right");
    world.begin_record();
    world
}

/// A box below the cup.
fn above(size_m: [f64; 3], x: f64, mass_kg: f64) -> World {
    world(
        crane("down", TOP_M + size_m[2] + GAP_M),
        load(block(size_m), x, mass_kg),
    )
}

fn steps(world: &mut World, command: &Command, secs: f64) {
    let until = world.time_secs() + secs;
    while world.time_secs() < until - 1e-9 {
        world.step(command);
    }
    assert_eq!(world.fault(), None);
}

/// Switches the vacuum on and waits.
fn close(world: &mut World) -> Command {
    let command = Command {
        gripper_opening_m: 0.0,
        ..world.hold()
    };
    steps(world, &command, 0.3);
    command
}

fn holds(world: &World) -> bool {
    let robot = world.snapshot().robot;
    assert_eq!(robot.left_touches, robot.right_touches);
    let felt = world.observe().finger_efforts_n[0] > 0.0;
    assert_eq!(
        felt,
        robot.left_touches.contains(&"load".to_owned()),
        "the pressure sensor measures the seal"
    );
    felt
}

/// Lifts at about 5 cm/s.
fn lift(world: &mut World, mut command: Command, height_m: f64) {
    let n_ticks = (height_m / 0.05 / world.tick_secs()).round();
    let mut lifted = 0.0;
    while lifted < n_ticks {
        command.positions[LIFT] += height_m / n_ticks;
        world.step(&command);
        lifted += 1.0;
    }
    steps(world, &command, 0.3);
}

/// A mass m that is lifted at an acceleration a pulls with m·(g + a).
#[test]
fn a_seal_breaks_if_and_only_if_the_pull_of_an_accelerated_mass_exceeds_its_force() {
    let mass_kg = 1.2;
    for (pull_n, expected) in [(13.0, true), (18.5, true), (21.5, false), (30.0, false)] {
        let mut world = above([0.2, 0.2, 0.1], 0.0, mass_kg);
        let mut command = close(&mut world);
        assert!(holds(&world));
        let acceleration = pull_n / mass_kg - GRAVITY;
        command.efforts = vec![(
            LIFT,
            mass_kg * GRAVITY + (mass_kg + CRANE_KG) * acceleration,
        )];
        steps(&mut world, &command, 0.15);
        assert_eq!(holds(&world), expected, "{pull_n} N of pull");
        let contacts = world.end_record().contacts;
        let seal = contacts
            .iter()
            .find(|contact| contact.pair[1].starts_with("robot/"))
            .expect("they touched");
        // The effort begins at once, and the load swings a little on the soft lip.
        if expected {
            assert!(
                (seal.max_force_n - pull_n).abs() < 0.08 * pull_n,
                "{} N measured, {pull_n} N",
                seal.max_force_n
            );
        }
    }
}

/// A bar that is held beside its middle peels the lip off: at most F·r.
#[test]
fn a_load_aside_of_the_cup_peels_it_off_beyond_force_times_radius() {
    for (share, expected) in [(0.8, true), (1.25, false)] {
        let mass_kg = 1.0;
        let aside_m = share * FORCE_N * RADIUS_M / (mass_kg * GRAVITY);
        let mut world = above([0.4, 0.1, 0.05], aside_m, mass_kg);
        let command = close(&mut world);
        assert!(holds(&world));
        lift(&mut world, command, 0.12);
        assert_eq!(holds(&world), expected, "{aside_m} m aside");
    }
}

/// A load m that is pulled aside at an acceleration a shears the lip with m·a: at most its friction
/// times F.
#[test]
fn a_load_that_is_pulled_aside_shears_off_beyond_friction_times_force() {
    let (mass_kg, friction) = (0.6, 0.5);
    for (share, expected) in [(0.6, true), (0.8, true), (1.25, false), (1.6, false)] {
        // Flat, so that the moment of its middle about the lip does not peel it off.
        let mut world = above([0.15, 0.15, 0.02], 0.0, mass_kg);
        let command = close(&mut world);
        lift(&mut world, command, 0.05);
        assert!(holds(&world));
        let mut command = world.hold();
        command.gripper_opening_m = 0.0;
        let acceleration = share * friction * FORCE_N / mass_kg;
        command.efforts = vec![(SLIDE, (mass_kg + TROLLEY_KG) * acceleration)];
        // Until shortly before the joint's largest speed.
        let secs = (0.8 / acceleration).min(0.1);
        steps(&mut world, &command, secs);
        assert_eq!(holds(&world), expected, "{share} of the limit");
    }
}

#[test]
fn a_seal_needs_a_flat_surface_below_the_whole_lip() {
    let ball = |radius: f64| {
        let part = Part {
            pose: Pose::upright([0.0, 0.0, radius], 0.0),
            shape: Shape::Sphere { radius },
        };
        let model = ObjectModel {
            parts: vec![part],
            ..Arc::unwrap_or_clone(block([2.0 * radius; 3]))
        };
        world(
            crane("down", TOP_M + 2.0 * radius + GAP_M),
            load(Arc::new(model), 0.0, 1.0),
        )
    };
    let cases = [
        ("a wide box", above([0.2, 0.2, 0.1], 0.0, 0.5), true),
        (
            "a box at its edge",
            above([0.2, 0.2, 0.1], 0.1 - 0.5 * RADIUS_M, 0.5),
            false,
        ),
        (
            "a bar as narrow as the radius",
            above([0.2, RADIUS_M, 0.1], 0.0, 0.5),
            false,
        ),
        ("a ball smaller than the cup", ball(0.8 * RADIUS_M), false),
        ("a ball of three cups", ball(3.0 * RADIUS_M), false),
        ("a ball of twenty cups", ball(20.0 * RADIUS_M), true),
    ];
    for (case, mut world, expected) in cases {
        close(&mut world);
        assert_eq!(holds(&world), expected, "{case}");
    }
}

/// The load of a broken seal falls, and the cup seals again only after the vacuum was off.
#[test]
fn a_broken_seal_stays_open_until_the_next_close() {
    let mut world = above([0.2, 0.2, 0.1], 0.0, 1.0);
    let mut command = close(&mut world);
    command.grip_force_n = 5.0;
    lift(&mut world, command.clone(), 0.02);
    assert!(!holds(&world), "a weak vacuum holds 5 N");
    let foot_m = |world: &World| world.snapshot().bodies[1].pose.position[2];
    assert!(
        (foot_m(&world) - TOP_M).abs() < 2e-3,
        "it is back on the platform: {} m",
        foot_m(&world)
    );
    command.grip_force_n = FORCE_N;
    steps(&mut world, &command, 0.5);
    assert!(!holds(&world), "the vacuum is still on");
    steps(
        &mut world,
        &Command {
            gripper_opening_m: 2.0 * RADIUS_M,
            ..command.clone()
        },
        0.2,
    );
    steps(&mut world, &command, 0.2);
    assert!(holds(&world));
    lift(&mut world, command.clone(), 0.05);
    assert!(holds(&world) && foot_m(&world) > TOP_M + 0.04);
    steps(
        &mut world,
        &Command {
            gripper_opening_m: 2.0 * RADIUS_M,
            ..command
        },
        0.5,
    );
    assert!(!holds(&world), "an open cup lets go");
    assert!(
        (foot_m(&world) - TOP_M).abs() < 5e-3,
        "{} m",
        foot_m(&world)
    );
}

#[test]
fn seals_form_and_break_with_the_same_bits() {
    let digest = || {
        let mut world = above([0.2, 0.2, 0.1], 0.01, 1.9);
        let command = close(&mut world);
        lift(&mut world, command, 0.1);
        (world.recorder().state_digest(), holds(&world))
    };
    assert_eq!(digest(), digest());
}

/// A box model with a mass. Units: kilograms, metres.
fn box_model(mass_kg: f64, [x, y, z]: [f64; 3]) -> String {
    format!(
        "category = \"act:Box\"\nmass_kg = {mass_kg}\nfriction = 0.5\nrestitution = 0.05\nsize_m = [{x}, {y}, {z}]\n\
         [[parts]]\nshape = \"box\"\nat_m = [0, 0, {}]\nsize_m = [{x}, {y}, {z}]\n",
        z / 2.0
    )
}

const BALL: &str = "category = \"act:Object\"\nmass_kg = 0.2\nfriction = 0.5\nrestitution = 0.05\n\
                    size_m = [0.036, 0.036, 0.036]\n[[parts]]\nshape = \"sphere\"\nat_m = [0, 0, 0.018]\nradius_m = 0.018\n";

/// A project with a wide crate, a heavy one and a ball, in which a robot picks one of them from a
/// table without noise.
fn project(robot: &str, thing: &str) -> (tempfile::TempDir, String) {
    let project = shipped_project();
    let objects = project.path().join("models/objects");
    std::fs::write(objects.join("crate.toml"), box_model(0.8, [0.3, 0.2, 0.12])).unwrap();
    std::fs::write(objects.join("ingot.toml"), box_model(6.0, [0.2, 0.2, 0.12])).unwrap();
    std::fs::write(objects.join("ball.toml"), BALL).unwrap();
    let text = std::fs::read_to_string(root().join("configs/lone_glass.toml")).unwrap();
    let text = text.replace("\"glass\"", &format!("\"{thing}\""));
    let text = format!(
        "{text}\n[robot]\nprofile = \"{robot}\"\n[scene]\nrequire = \"../rules/scene/within_fixed_arm.rls\"\n"
    );
    (project, text)
}

/// The report of a campaign as JSON and as text.
fn run(robot: &str, thing: &str, runs: &str) -> (Value, String) {
    let (project, text) = project(robot, thing);
    std::fs::write(project.path().join("configs/c.toml"), text).unwrap();
    let output = actcheck(
        project.path(),
        &["run", "configs/c.toml", "--runs", runs, "--format", "json"],
    );
    let json: Value =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    let said = format!("{json}{}", stderr(&output));
    (json, said)
}

#[test]
fn a_wide_crate_that_fingers_can_t_take_is_picked_by_its_top() {
    let (json, said) = run("suction_arm", "crate", "4");
    assert_eq!(json["runs_passed"]["count"], 4, "{said}");
    let (json, said) = run("fixed_arm", "crate", "1");
    assert_eq!(json["runs_passed"]["count"], 0, "{said}");
    assert!(
        said.contains("crate_1 is too wide for the gripper"),
        "{said}"
    );
}

#[test]
fn a_heavy_crate_breaks_the_seal_and_the_robot_reports_it() {
    let (json, said) = run("suction_arm", "ingot", "2");
    assert_eq!(json["runs_passed"]["count"], 0, "{said}");
    assert_eq!(
        json["runs_completed"]["count"].as_u64().unwrap_or(2),
        2,
        "{said}"
    );
    assert!(
        said.contains("the seal on ingot_1 broke: the arm carried "),
        "{said}"
    );
    assert!(said.contains("the cup holds 40 N of pull"), "{said}");
}

#[test]
fn a_ball_smaller_than_the_cup_is_refused_or_does_not_seal() {
    let (json, said) = run("suction_arm", "ball", "1");
    assert_eq!(json["runs_passed"]["count"], 0, "{said}");
    assert!(
        said.contains("ball_1 is too small for the suction cup"),
        "{said}"
    );
    let (_, said) = run("suction_arm", "bowl", "2");
    assert!(
        said.contains("the suction cup did not seal on bowl_1"),
        "{said}"
    );
}

/// The warnings of `check` for a robot and an object, on one line.
fn checked(robot: &str, thing: &str) -> String {
    let (project, text) = project(robot, thing);
    std::fs::write(project.path().join("configs/c.toml"), text).unwrap();
    let output = actcheck(project.path(), &["check", "configs/c.toml"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    format!("{}{}", stdout(&output), stderr(&output))
        .replace('│', " ")
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}

#[test]
fn check_predicts_the_limits_of_a_cup() {
    let said = checked("suction_arm", "bowl");
    assert!(
        said.contains("S070") && said.contains("no flat place as wide as the cup, 4.0 cm"),
        "{said}"
    );
    let said = checked("suction_arm", "ingot");
    assert!(
        said.contains("S072") && said.contains("`ingot` breaks the seal"),
        "{said}"
    );
    assert!(
        said.contains("holds 4.08 kg at rest and 2.72 kg with a safety factor of 1.5"),
        "{said}"
    );
    let said = checked("suction_arm", "crate");
    assert!(!said.contains("S070") && !said.contains("S072"), "{said}");
}

#[test]
fn a_cup_is_proposed_for_a_robot_with_a_link_of_this_name() {
    let (project, text) = project("proposed.toml", "crate");
    let urdf = root().join("models/robots/suction_arm.urdf");
    let out = project.path().join("configs/proposed.toml");
    let written = actcheck(
        project.path(),
        &[
            "new",
            "robot",
            urdf.to_str().unwrap(),
            "--out",
            out.to_str().unwrap(),
        ],
    );
    assert!(written.status.success(), "{}", stderr(&written));
    assert!(
        stdout(&written).contains("a suction cup of 40 mm at suction_link"),
        "{}",
        stdout(&written)
    );
    let profile = std::fs::read_to_string(&out).unwrap();
    for line in [
        "grasp_link = \"suction_link\"",
        "suction_radius_m = 0.02",
        "suction_force_n = 75",
    ] {
        assert!(profile.contains(line), "{profile}");
    }
    assert!(!profile.contains("finger"), "{profile}");
    std::fs::write(project.path().join("configs/c.toml"), text).unwrap();
    let output = actcheck(
        project.path(),
        &["run", "configs/c.toml", "--runs", "2", "--format", "json"],
    );
    let json: Value =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    assert_eq!(json["runs_passed"]["count"], 2, "{json}{}", stderr(&output));
    let other = [
        "new",
        "robot",
        urdf.to_str().unwrap(),
        "--hand",
        "nowhere",
        "--out",
        "other.toml",
    ];
    let refused = actcheck(project.path(), &other);
    assert_eq!(refused.status.code(), Some(2));
    assert!(
        stderr(&refused).contains("no hand has `nowhere` in a name"),
        "{}",
        stderr(&refused)
    );
}

/// The mobile manipulator with a cup instead of fingers.
fn mobile_cup(folder: &Path) {
    let robots = root().join("models/robots");
    let urdf = std::fs::read_to_string(robots.join("mobile_manipulator.urdf")).unwrap();
    let (before, fingers) = urdf
        .split_once("  <!-- Position: distance of the pad")
        .unwrap();
    let (_, after) = fingers
        .split_once("  <!-- x points along the fingers")
        .unwrap();
    let cup = "<joint name=\"cup_joint\" type=\"fixed\"><parent link=\"hand_palm_link\"/><child link=\"cup_link\"/>\
               <origin xyz=\"0 0 0.01\"/></joint><link name=\"cup_link\"><collision><origin xyz=\"0 0 0.035\"/>\
               <geometry><cylinder radius=\"0.02\" length=\"0.07\"/></geometry></collision></link>\
               <!-- x points along the fingers";
    std::fs::write(
        folder.join("mobile_cup.urdf"),
        format!("{before}{cup}{after}"),
    )
    .unwrap();
    let profile = std::fs::read_to_string(robots.join("mobile_manipulator.toml")).unwrap();
    let of_fingers = ["finger_", "max_opening_m", "grip_force_n"];
    let kept = profile
        .lines()
        .filter(|line| !of_fingers.iter().any(|key| line.starts_with(key)));
    let kept: Vec<&str> = kept.collect();
    let kept = kept
        .join("\n")
        .replace("mobile_manipulator.urdf", "mobile_cup.urdf");
    let cup = "suction_force_n = 30\nsuction_radius_m = 0.02\n";
    std::fs::write(
        folder.join("mobile_cup.toml"),
        kept.replacen("home = ", &format!("{cup}home = "), 1),
    )
    .unwrap();
}

#[test]
fn a_sealed_can_is_carried_to_another_table_and_let_go() {
    let (project, text) = project("mobile_cup", "can");
    mobile_cup(&project.path().join("models/robots"));
    let text = text.replace("[[\"Pick\"]]", "[[\"Pick\", \"Place\"]]");
    let text = text.replace(
        "[pickObject]",
        "[placeSurface]\nplace_object_surfaces = [\"mini_coffee_table\"]\n[pickObject]",
    );
    let text = text.replace(
        "[scene]\nrequire = \"../rules/scene/within_fixed_arm.rls\"\n",
        "",
    );
    std::fs::write(project.path().join("configs/c.toml"), text).unwrap();
    let output = actcheck(
        project.path(),
        &["run", "configs/c.toml", "--runs", "3", "--format", "json"],
    );
    let json: Value =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    assert_eq!(json["runs_passed"]["count"], 3, "{json}{}", stderr(&output));
}

/// Half of the cup may lie beside the edge of a carton that is only a centimetre wider on each
/// side.
#[test]
fn a_cup_that_does_not_seal_is_tried_beside() {
    let project = shipped_project();
    let run = [
        "run",
        "configs/suction_arm.toml",
        "--runs",
        "20",
        "--history",
        "h",
    ];
    let output = actcheck(project.path(), &run);
    assert!(output.status.code() < Some(2), "{}", stderr(&output));
    let query = "SELECT (COUNT(*) AS ?held) { ?a earl:test act:ObjectInGripper ; earl:result/act:outcome \"passed\" }";
    let answer = stdout(&actcheck(
        project.path(),
        &["query", query, "--history", "h", "--format", "csv"],
    ));
    let held: u32 = answer.lines().nth(1).unwrap().parse().unwrap();
    assert!(
        held >= 17,
        "{held} of 20 are held (15 with a single trial)\n{}",
        stderr(&output)
    );
}
