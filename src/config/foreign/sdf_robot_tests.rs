//! Robots in SDF have the values that their files state, or are refused.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use crate::foreign::Lookup;
use crate::foreign::files_for_tests::{folder, sdf};
use crate::foreign::robot::{self, RobotFile};
use actcheck_base::{Diagnostics, Files};
use actcheck_data::{ModelTree, TreeMotion};

fn shipped(name: &str) -> PathBuf {
    Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/models/sdf"
    ))
    .join(name)
}

/// Reads a robot's file with the models around it.
fn read(path: &Path) -> (Option<RobotFile>, Diagnostics) {
    let source = Files::Disk.read(path).expect("it is readable");
    let folder = path.parent().expect("it is in a folder").to_path_buf();
    let lookup = Lookup::new(&Files::Disk, vec![folder]);
    let mut found = Diagnostics::new();
    let robot = robot::read(&source, path, &lookup, &mut found);
    (robot.filter(|_| !found.has_errors()), found)
}

/// Reads a robot that is made of these files; the first is its own.
fn robot(files: &[(&str, String)]) -> (Option<ModelTree>, String) {
    let folder = folder("", files);
    let (robot, said) = read(&folder.path().join(files[0].0));
    (robot.map(|robot| robot.tree), said.to_string())
}

fn model(inside: &str) -> String {
    sdf(&format!("<model name=\"arm\">{inside}</model>"))
}

fn link(name: &str) -> String {
    format!(
        "<link name=\"{name}\"><inertial><mass>1</mass></inertial><collision name=\"c\"><geometry>\
         <sphere><radius>0.1</radius></sphere></geometry></collision></link>\n"
    )
}

fn joint(name: &str, parent: &str, child: &str) -> String {
    format!(
        "<joint name=\"{name}\" type=\"revolute\"><parent>{parent}</parent><child>{child}</child><axis>\
         <xyz>0 0 1</xyz><limit><lower>-1</lower><upper>1</upper></limit></axis></joint>\n"
    )
}

fn pair() -> String {
    format!("{}{}{}", link("base"), link("a"), joint("j", "base", "a"))
}

#[test]
fn masses_of_densities_are_those_of_the_closed_forms() {
    let (read, said) = read(&shipped("auto.sdf"));
    let tree = read.unwrap_or_else(|| panic!("{said}")).tree;
    let pi = std::f64::consts::PI;
    let block = (
        [0.0; 3],
        6.0,
        [0.13 / 12.0 * 6.0, 0.1 / 12.0 * 6.0, 0.05 / 12.0 * 6.0],
    );
    let (ball, can, egg) = (
        500.0 * 4.0 / 3.0 * pi * 0.001,
        300.0 * pi * 0.01 * 0.4,
        1000.0 * 4.0 / 3.0 * pi * 0.006,
    );
    let cone = 1000.0 * pi * 0.01 * 0.4 / 3.0;
    let (r2, l2) = (0.01, 0.16);
    let across = cone * (3.0 / 20.0 * r2 + 3.0 / 80.0 * l2);
    let cylinder = can * (3.0 * r2 + l2) / 12.0;
    for (name, (centre, kg, moments)) in [
        ("box", block),
        ("mesh", block),
        (
            "scaled",
            (block.0, 12.0, block.2.map(|moment| 2.0 * moment)),
        ),
        ("ball", ([0.0, 0.0, 0.2], ball, [0.4 * ball * 0.01; 3])),
        ("can", ([0.0; 3], can, [cylinder, cylinder, can * r2 / 2.0])),
        (
            "egg",
            ([0.0; 3], egg, [0.13, 0.1, 0.05].map(|sum| egg * sum / 5.0)),
        ),
        (
            "cone",
            ([0.0, 0.0, -0.1], cone, [across, across, 0.3 * cone * r2]),
        ),
        (
            "two",
            (
                [0.0; 3],
                2.0,
                [0.02 / 6.0, 0.02 / 6.0 + 0.02, 0.02 / 6.0 + 0.02],
            ),
        ),
    ] {
        let own = tree.link(name).and_then(|link| link.inertial.as_ref());
        let own = own.unwrap_or_else(|| panic!("{name} has a mass"));
        let near = |found: f64, wanted: f64| {
            assert!(
                (found - wanted).abs() < 1e-9 * wanted.abs().max(1.0),
                "{name}: {found} is not {wanted}"
            );
        };
        near(own.kg, kg);
        for axis in 0..3 {
            near(own.pose.translation.vector[axis], centre[axis]);
            near(own.about_com[(axis, axis)], moments[axis]);
        }
    }
}

#[test]
fn a_robot_of_two_models_is_its_flat_twin() {
    let (nested, said) = read(&shipped("gripper_model.sdf"));
    let nested = nested.unwrap_or_else(|| panic!("{said}")).tree;
    assert!(said.is_empty(), "{said}");
    let text = fs::read_to_string(shipped("gripper_model.sdf")).expect("it is readable");
    let flat = text
        .replace("<model name=\"gripper\"><pose>0 0 1.11 0 0 0</pose>", "")
        .replacen("</model>", "", 1)
        .replace("\"hand\"><pose>0 0 0 ", "\"hand\"><pose>0 0 1.11 ")
        .replace("finger\"><pose>0 0 0.04 ", "finger\"><pose>0 0 1.15 ")
        .replace("gripper::", "");
    let (flat, said) = robot(&[("flat.sdf", flat)]);
    let flat = flat.unwrap_or_else(|| panic!("{said}"));
    assert_eq!(nested.links.len(), 9);
    let moving = |tree: &ModelTree| {
        let joints = tree.joints.iter().filter(|joint| joint.motion.moves());
        let all = joints.map(|joint| {
            let at = joint
                .origin
                .translation
                .vector
                .map(|number| (number * 1e9).round());
            let leader = joint.mimic.as_ref().map(|mimic| mimic.leader.clone());
            let limits = [joint.lower, joint.upper, joint.effort, joint.velocity];
            (
                joint.name.clone(),
                joint.child.clone(),
                at,
                joint.axis,
                limits,
                leader,
            )
        });
        all.collect::<Vec<_>>()
    };
    let renamed = moving(&nested)
        .into_iter()
        .map(|(name, child, at, axis, limits, leader)| {
            let short = |name: String| name.replace("gripper::", "");
            (
                short(name),
                short(child),
                at,
                axis,
                limits,
                leader.map(short),
            )
        });
    let mut renamed: Vec<_> = renamed.collect();
    let mut wanted = moving(&flat);
    renamed.sort_by(|a, b| a.0.cmp(&b.0));
    wanted.sort_by(|a, b| a.0.cmp(&b.0));
    assert_eq!(renamed.len(), 8);
    assert_eq!(renamed, wanted);
}

#[test]
fn couplings_have_the_values_of_their_files() {
    let (read, said) = read(&shipped("mimic.sdf"));
    let tree = read.unwrap_or_else(|| panic!("{said}")).tree;
    for (name, leader, factor, offset) in [
        ("plain", "lead", 1.0, 0.0),
        ("scaled", "lead", -0.5, 0.4),
        ("plugged", "lead", -1.0, 0.1),
        ("gripper::left_joint", "gripper::right_joint", -1.0, 0.0),
        ("outer", "gripper::right_joint", 2.0, 0.0),
    ] {
        let joint = tree
            .joint(name)
            .unwrap_or_else(|| panic!("there is {name}"));
        let mimic = joint.mimic.as_ref();
        let mimic = mimic.unwrap_or_else(|| panic!("{name} follows"));
        assert_eq!(mimic.leader, leader, "{name}");
        assert!((mimic.factor - factor).abs() < 1e-12, "{name}");
        assert!((mimic.offset - offset).abs() < 1e-12, "{name}");
    }
    assert!(!said.to_string().contains("plugin"), "{said}");
}

#[test]
fn links_that_do_not_collide_with_their_model_pass_through_each_other() {
    let (read, _) = read(&shipped("self_collide.sdf"));
    let pairs: BTreeSet<[String; 2]> = read.expect("it is read").tree.passing.into_iter().collect();
    let named = |pair: [&str; 2]| pair.map(str::to_owned);
    assert_eq!(
        pairs,
        BTreeSet::from([["base", "a"], ["base", "b"], ["a", "b"]].map(named))
    );
    let (silent, _) = robot(&[("r.sdf", model(&pair()))]);
    assert_eq!(
        silent.expect("it is read").passing,
        Vec::<[String; 2]>::new()
    );
}

#[test]
fn the_robot_of_a_world_is_the_one_that_moves() {
    let world = |inside: &str| sdf(&format!("<world name=\"w\">{inside}</world>"));
    let table = "<model name=\"table\"><static>1</static><link name=\"top\"><collision name=\"c\"><geometry>\
                 <plane/></geometry></collision></link></model>";
    let floor = "<include><uri>model://ground_plane</uri></include>\
                 <include><uri>https://fuel/models/Sun</uri></include>";
    let arm = format!(
        "<model name=\"arm\"><pose>1 2 0 0 0 0</pose>{}</model>",
        pair()
    );
    let (tree, said) = robot(&[("r.sdf", world(&format!("{floor}{table}{arm}")))]);
    let tree = tree.unwrap_or_else(|| panic!("{said}"));
    let names: Vec<&str> = tree.links.iter().map(|link| link.name.as_str()).collect();
    assert_eq!(names, ["base", "a"]);
    assert!(
        said.contains("`table` is left out: the robot is `arm`"),
        "{said}"
    );
    assert!(
        !said.contains("ground_plane") && !said.contains("height"),
        "{said}"
    );
    let (_, said) = robot(&[("r.sdf", world(&arm.replace("1 2 0", "1 2 0.4")))]);
    assert!(
        said.contains("the height and tilt of the whole robot"),
        "{said}"
    );
}

#[test]
fn the_root_stays_where_its_model_has_it() {
    let (read, _) = read(&shipped("rail.sdf"));
    let tree = read.expect("it is read").tree;
    let drive = tree.joint("drive").expect("the rail moves");
    assert_eq!(
        (drive.parent.as_str(), drive.motion),
        ("world", TreeMotion::Prismatic)
    );
    let joint = tree.joint("held").expect("the post is held");
    assert_eq!(
        (joint.parent.as_str(), joint.motion),
        ("world", TreeMotion::Fixed)
    );
    let (read, _) = self::read(&shipped("raised.sdf"));
    let tree = read.expect("it is read").tree;
    let joint = tree
        .joint("base_footprint_joint")
        .expect("the root is placed");
    assert!((joint.origin.translation.z - 0.15).abs() < 1e-12);
}

#[test]
fn a_fault_of_an_included_model_has_the_place_in_its_file() {
    let gripper = model(&pair().replace("<mass>1</mass>", "<mass>\n-1</mass>"));
    let arm = format!(
        "{}<include><uri>model://gripper</uri></include>{}",
        pair(),
        joint("k", "a", "arm::base")
    );
    let (tree, said) = robot(&[("r.sdf", model(&arm)), ("gripper/model.sdf", gripper)]);
    assert!(tree.is_none());
    assert!(said.contains("gripper/model.sdf:1:"), "{said}");
}

/// Each of these changes the model, and is not simulated.
#[test]
fn parts_that_would_change_a_robot_are_refused() {
    let with = |from: &str, to: &str| {
        let text = pair();
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    };
    let axis = |inside: &str| with("</limit>", &format!("</limit>{inside}"));
    let in_link = |inside: &str| with("<inertial>", &format!("{inside}<inertial>"));
    let ball = "<sphere><radius>0.1</radius></sphere>";
    let third = format!("{}{}", pair(), link("b"));
    for (code, said, text) in [
        (
            "W035",
            "springs",
            axis("<dynamics><spring_stiffness>3</spring_stiffness></dynamics>"),
        ),
        ("W035", "screw", with("revolute", "screw")),
        ("W035", "gearbox", with("revolute", "gearbox")),
        ("W035", "ball", with("type=\"revolute\"", "type=\"ball\"")),
        ("W035", "universal", with("revolute", "universal")),
        (
            "W035",
            "mimic",
            with("<axis>", "<mimic joint=\"k\"/><axis>"),
        ),
        (
            "W035",
            "second axis",
            axis("<mimic joint=\"j\" axis=\"axis2\"/>"),
        ),
        ("W051", "no movable joint `k`", axis("<mimic joint=\"k\"/>")),
        ("W034", "must not be zero", with("0 0 1", "0 0 0")),
        (
            "W034",
            "above its upper limit",
            with("<lower>-1", "<lower>2"),
        ),
        ("W035", "kinematic", in_link("<kinematic>true</kinematic>")),
        (
            "W035",
            "velocity_decay",
            in_link("<velocity_decay><linear>0.1</linear></velocity_decay>"),
        ),
        (
            "W035",
            "fluid_added_mass",
            with("</mass>", "</mass><fluid_added_mass/>"),
        ),
        ("W035", "heightmap", with(ball, "<heightmap/>")),
        (
            "W035",
            "submesh",
            with(
                ball,
                "<mesh><uri>m.obj</uri><submesh><name>a</name></submesh></mesh>",
            ),
        ),
        (
            "W034",
            "scale must not be 0",
            with(ball, "<mesh><uri>m.obj</uri><scale>1 0 1</scale></mesh>"),
        ),
        ("W033", "`<geometry>` is empty", with(ball, "")),
        (
            "W035",
            "bounces",
            with(
                "</geometry>",
                "</geometry><surface><bounce><restitution_coefficient>0.5\
            </restitution_coefficient></bounce></surface>",
            ),
        ),
        ("W035", "static", format!("<static>true</static>{}", pair())),
        (
            "W035",
            "no frame `x`",
            in_link("<pose relative_to=\"x\">0 0 1 0 0 0</pose>"),
        ),
        ("W051", "no link `c`", with("<child>a", "<child>c")),
        ("W051", "no joint connects `b`", third.clone()),
        ("W051", "two links `a`", format!("{}{}", pair(), link("a"))),
        (
            "W051",
            "two joints `j`",
            format!("{}{}{}", pair(), link("b"), joint("j", "a", "b")),
        ),
        (
            "W035",
            "closes a loop",
            format!("{third}{}{}", joint("k", "a", "b"), joint("l", "base", "b")),
        ),
        (
            "W040",
            "`model://gone` is missing",
            format!("{}<include><uri>model://gone</uri></include>", pair()),
        ),
    ] {
        let (tree, found) = robot(&[("r.sdf", model(&text))]);
        assert!(tree.is_none(), "{said}");
        let is_said = found.contains(code) && found.contains(said);
        assert!(is_said && found.contains("r.sdf:"), "{said}: {found}");
    }
    let circle = model("<include><uri>../r</uri></include>");
    let (tree, found) = robot(&[("r/model.sdf", circle)]);
    let is_said = found.contains("W035") && found.contains("8 levels deep");
    assert!(tree.is_none() && is_said, "{found}");
}
