//! Arms that are mounted on the table on which they work. The arm here is like those that students
//! build: five joints, half a metre long, one jaw that turns, and its front along −y.

use std::path::Path;

use actcheck::config::{self, Overrides};
use actcheck::data::{Choices, Role, Scene};
use actcheck::ontology;
use actcheck::scenario::{self, Space};

use crate::support::urdf::{joint, link};
use crate::support::{actcheck, robot_of, stderr, stdout};

fn desk_arm() -> String {
    let mut text = "<robot name=\"desk_arm\">\n".to_owned();
    text += &link("base", [0.08, 0.1, 0.05], [0.0, 0.0, 0.025], 0.5);
    let chain = [
        (
            "shoulder",
            "base",
            [0.0, -0.02, 0.05],
            "0 0 1",
            [-1.9, 1.9],
            [0.05, 0.05, 0.04],
            [0.0, 0.0, 0.03],
            0.1,
        ),
        (
            "upper_arm",
            "shoulder",
            [0.0, 0.0, 0.05],
            "1 0 0",
            [-1.9, 1.9],
            [0.03, 0.03, 0.08],
            [0.0, 0.0, 0.06],
            0.1,
        ),
        (
            "forearm",
            "upper_arm",
            [0.0, 0.0, 0.12],
            "1 0 0",
            [-1.7, 1.7],
            [0.03, 0.09, 0.03],
            [0.0, -0.07, 0.0],
            0.1,
        ),
        (
            "wrist",
            "forearm",
            [0.0, -0.13, 0.0],
            "1 0 0",
            [-1.7, 1.7],
            [0.03, 0.03, 0.03],
            [0.0, -0.03, 0.0],
            0.05,
        ),
        (
            "palm",
            "wrist",
            [0.0, -0.05, 0.0],
            "0 1 0",
            [-2.8, 2.8],
            [0.012, 0.1, 0.02],
            [-0.014, -0.06, 0.0],
            0.05,
        ),
    ];
    for (part, parent, at, axis, range, size, middle, mass) in chain {
        text += &link(part, size, middle, mass);
        text += &joint(
            &format!("{part}_joint"),
            "revolute",
            [parent, part],
            at,
            axis,
            range,
        );
    }
    text += &link("jaw", [0.012, 0.08, 0.02], [-0.017, -0.05, 0.0], 0.03);
    text += &joint(
        "jaw_joint",
        "revolute",
        ["palm", "jaw"],
        [0.015, -0.02, 0.0],
        "0 0 1",
        [0.0, 1.5],
    );
    text + "</robot>\n"
}

/// A cube of 4 cm on a low table.
fn write_project(folder: &Path, count: u32) {
    std::fs::write(folder.join("desk_arm.urdf"), desk_arm()).unwrap();
    std::fs::create_dir_all(folder.join("models/objects")).unwrap();
    let cube = "category = \"act:Box\"\nmass_kg = 0.05\nfriction = 0.5\nrestitution = 0.05\nsize_m = [0.04, 0.04, 0.04]\n\
        [[parts]]\nshape = \"box\"\nat_m = [0, 0, 0.02]\nsize_m = [0.04, 0.04, 0.04]\n";
    std::fs::write(folder.join("models/objects/cube.toml"), cube).unwrap();
    let config = format!(
        "tests = [[\"Pick\"]]\ntest_count = {count}\nseed = 5\nmodel_dir = \"models\"\n[objectSurface]\n\
        object_surfaces = [\"mini_coffee_table\"]\n[pickObject]\nmodel_list = [\"cube\"]\n[surfaceObjects]\n\
        model_list = [\"salt_shaker\", \"spoon\"]\ncount = [0, 2]\n[robot]\nprofile = \"desk_arm.toml\"\n"
    );
    std::fs::write(folder.join("c.toml"), config).unwrap();
    let made = actcheck(folder, &["new", "robot", "desk_arm.urdf"]);
    assert_eq!(made.status.code(), Some(0), "{}", stderr(&made));
}

fn scenes(folder: &Path, count: u64) -> Vec<Scene> {
    let campaign = config::load(&folder.join("c.toml"), &Overrides::default())
        .unwrap_or_else(|found| panic!("{found}"));
    let ontology = ontology::load(&campaign.ontology.0, &campaign.ontology.1)
        .unwrap_or_else(|found| panic!("{found}"));
    let space = Space::new(&campaign, &ontology, &robot_of(&campaign))
        .unwrap_or_else(|found| panic!("{found}"));
    (0..count)
        .filter_map(|index| scenario::draw(&space, 0, &mut Choices::random(3, index)).ok())
        .collect()
}

#[test]
fn a_short_arm_is_mounted_on_the_table_and_picks_there() {
    let folder = tempfile::tempdir().unwrap();
    write_project(folder.path(), 6);
    let text = std::fs::read_to_string(folder.path().join("desk_arm.toml")).unwrap();
    let profile: toml::Table = toml::from_str(&text).unwrap();
    assert_eq!(profile["mount"].as_str(), Some("surface"), "{text}");
    // Its front, −y, points forwards.
    let turned_rad = profile["mount_turned_rad"].as_float().unwrap();
    assert!(
        (turned_rad - std::f64::consts::FRAC_PI_2).abs() < 1e-4,
        "{text}"
    );
    let reach: Vec<f64> = profile["reach_m"]
        .as_array()
        .unwrap()
        .iter()
        .map(|at| at.as_float().unwrap())
        .collect();
    assert!(
        reach[0] < 0.25 && reach[1] > 0.25 && reach[1] < 0.5,
        "{reach:?}"
    );
    assert!(profile.len() <= 10, "{text}");
    let ran = actcheck(
        folder.path(),
        &["run", "c.toml", "--history", "h", "--format", "json"],
    );
    let json: serde_json::Value =
        serde_json::from_str(&stdout(&ran)).unwrap_or_else(|_| panic!("{}", stderr(&ran)));
    let passed = json["runs_passed"]["count"].as_u64().unwrap();
    assert!(passed >= 4, "{passed} of 6 picks passed: {}", stderr(&ran));
}

/// The arm is on the table near its edge, targets are within its reach, and nothing is in its base.
#[test]
fn objects_are_within_reach_of_an_arm_on_the_table_and_clear_of_it() {
    let folder = tempfile::tempdir().unwrap();
    write_project(folder.path(), 1);
    let profile = std::fs::read_to_string(folder.path().join("desk_arm.toml")).unwrap();
    let reach = "reach_m = [0.2, 0.3]";
    let given = profile.lines().map(|line| {
        if line.starts_with("reach_m") {
            reach
        } else {
            line
        }
    });
    std::fs::write(
        folder.path().join("desk_arm.toml"),
        given.collect::<Vec<_>>().join("\n"),
    )
    .unwrap();
    let drawn = scenes(folder.path(), 200);
    assert!(drawn.len() > 180, "{}", drawn.len());
    for scene in drawn {
        let [x, y, _] = scene.robot.base;
        assert!(
            (scene.robot.root_height_m - 0.425).abs() < 1e-9,
            "{}",
            scene.robot.root_height_m
        );
        assert!((-0.31 + 0.05..=-0.31 + 0.09).contains(&x), "{x}");
        for object in scene
            .objects
            .iter()
            .filter(|object| object.role != Role::Platform)
        {
            let [at_x, at_y, _] = object.pose.position;
            let away = (at_x - x).hypot(at_y - y);
            if object.role == Role::Target {
                assert!((0.2..=0.3).contains(&away), "{away}");
            }
            let [width, depth, _] = object.model.size_m;
            assert!(
                away > 0.1 + width.min(depth) / 2.0,
                "{} at {away}",
                object.id
            );
        }
    }
}

/// Jaws that turn are a wedge around a wide object. Friction holds a cube of 4 cm between them, and
/// not a slippery one of 7 cm.
#[test]
fn check_predicts_objects_that_turning_jaws_squeeze_out() {
    let folder = tempfile::tempdir().unwrap();
    write_project(folder.path(), 4);
    let cube = std::fs::read_to_string(folder.path().join("models/objects/cube.toml")).unwrap();
    let wide = cube
        .replace("0.04", "0.07")
        .replace("0.02]", "0.035]")
        .replace("friction = 0.5", "friction = 0.2");
    std::fs::write(folder.path().join("models/objects/wide.toml"), wide).unwrap();
    let config = std::fs::read_to_string(folder.path().join("c.toml")).unwrap();
    std::fs::write(
        folder.path().join("w.toml"),
        config.replace("[\"cube\"]", "[\"wide\"]"),
    )
    .unwrap();
    let said = |config: &str| stderr(&actcheck(folder.path(), &["check", config]));
    assert!(!said("c.toml").contains("S072"), "{}", said("c.toml"));
    let words = said("w.toml")
        .replace('│', " ")
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ");
    assert!(
        words.contains("S072") && words.contains("`wide` is squeezed out of the gripper"),
        "{words}"
    );
    let ran = actcheck(
        folder.path(),
        &["run", "w.toml", "--history", "h", "--format", "json"],
    );
    let json: serde_json::Value =
        serde_json::from_str(&stdout(&ran)).unwrap_or_else(|_| panic!("{}", stderr(&ran)));
    assert!(
        json["runs_passed"]["count"].as_u64().unwrap() <= 1,
        "{}",
        stderr(&ran)
    );
}

#[test]
fn a_reach_without_room_for_an_object_is_named() {
    let folder = tempfile::tempdir().unwrap();
    write_project(folder.path(), 1);
    let profile = std::fs::read_to_string(folder.path().join("desk_arm.toml")).unwrap();
    let near = profile.lines().map(|line| {
        if line.starts_with("reach_m") {
            "reach_m = [0, 0.05]"
        } else {
            line
        }
    });
    std::fs::write(
        folder.path().join("desk_arm.toml"),
        near.collect::<Vec<_>>().join("\n"),
    )
    .unwrap();
    let ran = actcheck(folder.path(), &["run", "c.toml", "--history", "h"]);
    assert_eq!(ran.status.code(), Some(2), "{}", stderr(&ran));
    let words = stderr(&ran)
        .replace('│', " ")
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ");
    assert!(
        words.contains("S030") && words.contains("by `reach_m` in its profile"),
        "{words}"
    );
}
