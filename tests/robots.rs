//! Robots: the shipped ones perform their tasks, and faults of a robot are reported with their
//! place.
//!
//! A wrong robot is a folder below `tests/diagnostics/robots/` that holds `robot.toml` and the
//! files it names, with its diagnostics in `expected`. A new case needs no Rust: run with
//! `UPDATE_EXPECT=1` to write the files, and review them. All are variants of `tests/models/crane`
//! with a fault.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use actcheck::base::{Files, Source};
use actcheck::campaign::Env;
use actcheck::config::{self, Overrides};
use actcheck::data::Choices;
use actcheck::scenario;
use serde_json::Value;

use crate::support::expected::assert_diagnostics;
use crate::support::{actcheck, copy, project, root, stderr, stdout};

const WRONG: &str = "tests/diagnostics/robots";

/// The diagnostics of a robot; empty if there are none.
fn said_of(folder: &Path, profile: &str) -> String {
    let text = format!("tests = [[\"Pick\"]]\ntest_count = 1\n[robot]\nprofile = \"{profile}\"\n");
    config::load_text(
        Source::new(folder.join("c.toml").display().to_string(), text),
        folder,
        &Overrides::default(),
    )
    .map_or_else(|found| found.to_string(), |_| String::new())
}

#[test]
fn every_wrong_robot_is_reported_with_its_place() {
    // The same robot in each format.
    for crane in ["crane", "crane_mjcf", "crane_sdf"] {
        assert_eq!(
            said_of(Path::new("tests/models"), &format!("{crane}/robot.toml")),
            ""
        );
    }
    let report = |case: PathBuf| {
        let profile = format!("{}/robot.toml", case.file_name().unwrap().display());
        (case.join("expected"), said_of(Path::new(WRONG), &profile))
    };
    assert_diagnostics(
        50,
        Files::Disk
            .folders(Path::new(WRONG))
            .into_iter()
            .map(report),
    );
    let said = said_of(Path::new(WRONG), "fixed_amr");
    assert!(
        said.contains("there is no robot `fixed_amr`")
            && said.contains("did you mean `fixed_arm`?"),
        "{said}"
    );
}

/// A campaign with a profile in the same folder.
fn campaign_with(profile: &str) -> String {
    format!(
        "tests = [[\"Pick\"]]\ntest_count = 4\nseed = 5\n[robot]\nprofile = \"{profile}\"\n\
         [pickObject]\nmodel_list = [\"can\"]\n[objectSurface]\nobject_surfaces = [\"coffee_table\"]\n"
    )
}

/// The lines of a proposed profile that are comments because the program finds the same, as lines.
fn uncommented(profile: &str) -> String {
    let line = |line: &str| match line.strip_prefix("# ") {
        Some("]") => "]\n".to_owned(),
        Some(found) if found.contains(" = ") => format!("{found}\n"),
        _ => format!("{line}\n"),
    };
    profile.lines().map(line).collect()
}

/// The proposed profile of a shipped robot names the joints of its own profile, and passes `check`;
/// the keys that it leaves to the program are in its comments.
#[test]
fn a_proposed_profile_is_complete() {
    let folder = tempfile::tempdir().unwrap();
    for robot in ["mobile_manipulator", "fixed_arm"] {
        let urdf = root().join(format!("models/robots/{robot}.urdf"));
        let written = actcheck(folder.path(), &["new", "robot", urdf.to_str().unwrap()]);
        assert!(written.status.success(), "{}", stderr(&written));
        let name = format!("{robot}.toml");
        let text = std::fs::read_to_string(folder.path().join(&name)).unwrap();
        let parsed = |text: &str| {
            toml::from_str::<toml::Table>(text).unwrap_or_else(|error| panic!("{error}: {text}"))
        };
        let shipped =
            parsed(&std::fs::read_to_string(root().join("models/robots").join(&name)).unwrap());
        let (short, full) = (parsed(&text), parsed(&uncommented(&text)));
        assert!((4..=10).contains(&short.len()), "{text}");
        // Both have bodies of their own.
        assert!(!short.contains_key("mount_height_m"), "{text}");
        for key in ["base_joints", "arm_joints", "head_joints"] {
            assert_eq!(short.get(key), shipped.get(key), "{key} of {robot}");
        }
        let opening = |table: &toml::Table| table["max_opening_m"].as_float().unwrap();
        assert!((opening(&full) - opening(&shipped)).abs() < 0.006, "{full}");
        std::fs::write(folder.path().join("full.toml"), uncommented(&text)).unwrap();
        for profile in [&name, "full.toml"] {
            std::fs::write(folder.path().join("c.toml"), campaign_with(profile)).unwrap();
            let checked = actcheck(folder.path(), &["check", "c.toml"]);
            assert!(checked.status.success(), "{}", stderr(&checked));
        }
    }
}

/// A profile that only names the model of an arm is completed, and the arm picks. Joints without a
/// role are rigid: a freely moving one would change how the arm falls short.
#[test]
fn a_profile_needs_only_its_model() {
    let folder = tempfile::tempdir().unwrap();
    let urdf = std::fs::read_to_string(root().join("models/robots/fixed_arm.urdf")).unwrap();
    let (head, _) = urdf.rsplit_once("</robot>").unwrap();
    let flag = "<link name=\"flag\"><inertial><mass value=\"2\"/>\
        <inertia ixx=\"0.01\" ixy=\"0\" ixz=\"0\" iyy=\"0.01\" iyz=\"0\" izz=\"0.01\"/></inertial></link>\
        <joint name=\"flag_joint\" type=\"revolute\"><parent link=\"pedestal_link\"/><child link=\"flag\"/>\
        <axis xyz=\"0 1 0\"/><limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/></joint></robot>";
    assert!(urdf.contains("\"pedestal_link\""), "{urdf}");
    std::fs::write(folder.path().join("arm.urdf"), format!("{head}{flag}")).unwrap();
    let run = |profile: &str| {
        std::fs::write(folder.path().join("robot.toml"), profile).unwrap();
        std::fs::write(folder.path().join("c.toml"), campaign_with("robot.toml")).unwrap();
        let output = actcheck(
            folder.path(),
            &["run", "c.toml", "--history", "h", "--format", "json"],
        );
        let json: Value = serde_json::from_str(&stdout(&output))
            .unwrap_or_else(|_| panic!("{}", stderr(&output)));
        json["runs_passed"]["count"].as_u64().unwrap()
    };
    let passed = run("urdf = \"arm.urdf\"\n");
    assert!(passed >= 3, "{passed} of 4 picks passed");
    // A joint with the role of being moved by programs exists; one that the model lacks does not.
    assert!(run("urdf = \"arm.urdf\"\nother_joints = [\"flag_joint\"]\n") >= 3);
    std::fs::write(
        folder.path().join("robot.toml"),
        "urdf = \"arm.urdf\"\nother_joints = [\"flag_join\"]\n",
    )
    .unwrap();
    let checked = actcheck(folder.path(), &["check", "c.toml"]);
    assert!(
        stderr(&checked).contains("did you mean `flag_joint`?"),
        "{}",
        stderr(&checked)
    );
}

/// `check --mend` writes a copy with the proposed moments beside the URDF, once, and the copy has
/// none to mend.
#[test]
fn a_mended_copy_has_possible_moments_of_inertia() {
    let folder = tempfile::tempdir().unwrap();
    copy(
        &root().join(WRONG).join("impossible_moments_of_inertia"),
        folder.path(),
    );
    let text = "tests = [[\"Pick\"]]\ntest_count = 1\n[robot]\nprofile = \"robot.toml\"\n\
        [pickObject]\nmodel_list = [\"can\"]\n[objectSurface]\nobject_surfaces = [\"coffee_table\"]\n";
    std::fs::write(folder.path().join("c.toml"), text).unwrap();
    let original = std::fs::read_to_string(folder.path().join("robot.urdf")).unwrap();
    let check = || {
        let output = actcheck(folder.path(), &["check", "c.toml", "--mend"]);
        let said = format!("{}{}", stdout(&output), stderr(&output)).replace('│', " ");
        (
            output.status.code(),
            said.split_whitespace().collect::<Vec<_>>().join(" "),
        )
    };
    let (code, said) = check();
    assert_eq!(code, Some(0), "{said}");
    assert!(
        said.contains("`beam` has the moments of inertia of a box of 80 x 10 x 10 cm"),
        "{said}"
    );
    assert!(said.contains("wrote robot.mended.urdf"), "{said}");
    assert_eq!(
        std::fs::read_to_string(folder.path().join("robot.urdf")).unwrap(),
        original
    );
    let (code, said) = check();
    assert!(
        code == Some(2) && said.contains("robot.mended.urdf already exists"),
        "{said}"
    );
    let profile = std::fs::read_to_string(folder.path().join("robot.toml")).unwrap();
    std::fs::write(
        folder.path().join("robot.toml"),
        profile.replace("robot.urdf", "robot.mended.urdf"),
    )
    .unwrap();
    assert_eq!(said_of(folder.path(), "robot.toml"), "");
}

/// The crane as xacro, checked with `xacro` as the shell finds it in the folders of `path`.
fn check_xacro(path: &Path, body: &str) -> (Option<i32>, String) {
    let folder = tempfile::tempdir().unwrap();
    copy(&root().join("tests/models/crane"), folder.path());
    std::fs::write(folder.path().join("robot.urdf.xacro"), body).unwrap();
    let profile = std::fs::read_to_string(folder.path().join("robot.toml")).unwrap();
    let profile = profile
        .replace("robot.urdf", "robot.urdf.xacro")
        .replace("home =", "mount_height_m = 0.4\nhome =");
    std::fs::write(folder.path().join("x.toml"), profile).unwrap();
    let text = "tests = [[\"Pick\"]]\ntest_count = 1\n[robot]\nprofile = \"x.toml\"\n\
        [pickObject]\nmodel_list = [\"glass\"]\n[objectSurface]\nobject_surfaces = [\"coffee_table\"]\n";
    std::fs::write(folder.path().join("c.toml"), text).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_actcheck"))
        .args(["check", "c.toml"])
        .current_dir(folder.path())
        .env("NO_COLOR", "1")
        .env("PATH", path)
        .output()
        .unwrap();
    (
        output.status.code(),
        format!("{}{}", stdout(&output), stderr(&output)),
    )
}

/// A replacement for the program: the test covers the use of its output and the report of its
/// errors.
#[cfg(unix)]
#[test]
fn xacro_files_are_expanded_with_xacro_or_refused_with_help() {
    use std::os::unix::fs::PermissionsExt as _;
    let urdf = std::fs::read_to_string(root().join("tests/models/crane/robot.urdf")).unwrap();
    let tools = tempfile::tempdir().unwrap();
    let (code, said) = check_xacro(tools.path(), &urdf);
    assert_eq!(code, Some(2), "{said}");
    assert!(
        said.contains("W012") && said.contains("pip install xacro"),
        "{said}"
    );
    let program = tools.path().join("xacro");
    let script = "#!/bin/sh\nwhile IFS= read -r line; do\n  case \"$line\" in *xacro:if*) \
        echo \"undefined name 'arm' when processing file $1\" >&2; exit 2;; esac\n  printf '%s\\n' \"$line\"\ndone < \"$1\"\n";
    std::fs::write(&program, script).unwrap();
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
    let (code, said) = check_xacro(tools.path(), &urdf);
    assert_eq!(code, Some(0), "{said}");
    let (code, said) = check_xacro(
        tools.path(),
        "<robot><xacro:if value=\"${arm}\"/></robot>\n",
    );
    assert_eq!(code, Some(2), "{said}");
    assert!(
        said.contains("xacro cannot expand robot.urdf.xacro: undefined name 'arm'"),
        "{said}"
    );
    // Faults in the expanded text are reported with their lines in it.
    let (code, said) = check_xacro(tools.path(), &urdf.replace("value=\"3\"", "value=\"-3\""));
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("robot.urdf.xacro (expanded):10:"), "{said}");
}

/// The lone glass of `configs/lone_glass.toml`, for the fixed arm.
fn lone_glass_for_fixed_arm() -> String {
    let text = std::fs::read_to_string(root().join("configs/lone_glass.toml")).unwrap();
    format!("{text}\n[robot]\nprofile = \"fixed_arm\"\n")
}

#[test]
fn a_fixed_arm_picks_a_lone_glass_nearly_always() {
    let project = project();
    std::fs::write(
        project.path().join("configs/lone.toml"),
        lone_glass_for_fixed_arm(),
    )
    .unwrap();
    let arguments = [
        "run",
        "configs/lone.toml",
        "--runs",
        "16",
        "--history",
        "h",
        "--format",
        "json",
    ];
    let output = actcheck(project.path(), &arguments);
    let json: Value =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    let passed = json["runs_passed"]["count"].as_u64().unwrap();
    assert!(
        passed >= 15,
        "{passed} of 16 runs passed fully with a lone object and no noise"
    );
}

/// If the arm must plan around obstacles, the same seed still gives the same bits with any number
/// of workers, and every run can be replayed from its record.
#[test]
fn a_fixed_arm_campaign_is_deterministic_and_replays() {
    let project = project();
    let run = |history: &str, jobs: &str| {
        let arguments = [
            "run",
            "configs/fixed_arm.toml",
            "--runs",
            "4",
            "--jobs",
            jobs,
            "--history",
            history,
            "--format",
            "csv",
        ];
        stdout(&actcheck(project.path(), &arguments))
    };
    assert_eq!(run("h1", "1"), run("h2", "2"));
    let replayed = actcheck(
        project.path(),
        &["replay", "--sample", "2", "--history", "h1"],
    );
    assert_eq!(
        replayed.status.code(),
        Some(0),
        "{}{}",
        stdout(&replayed),
        stderr(&replayed)
    );
}

/// The mobile manipulator without its base joints, replaced by `base = "planar"`, behaves as
/// before.
#[test]
fn a_planar_base_drives_a_urdf_without_a_base() {
    let project = project();
    let folder = project.path().join("models/robots");
    let urdf = std::fs::read_to_string(folder.join("mobile_manipulator.urdf")).unwrap();
    let (head, rest) = urdf.split_once("  <link name=\"odom\"/>").unwrap();
    let (_, rest) = rest.split_once("<link name=\"base_link\">").unwrap();
    std::fs::write(
        folder.join("rootless.urdf"),
        format!("{head}<link name=\"base_link\">{rest}"),
    )
    .unwrap();
    let profile = std::fs::read_to_string(folder.join("mobile_manipulator.toml")).unwrap();
    let joints = "base_joints = [\"base_x_joint\", \"base_y_joint\", \"base_heading_joint\"]";
    assert!(profile.contains(joints));
    let profile = profile
        .replace(joints, "base = \"planar\"")
        .replace("mobile_manipulator.urdf", "rootless.urdf");
    std::fs::write(folder.join("rootless.toml"), profile).unwrap();
    let text = std::fs::read_to_string(root().join("configs/lone_glass.toml")).unwrap();
    std::fs::write(
        project.path().join("configs/r.toml"),
        format!("{text}\n[robot]\nprofile = \"rootless\"\n"),
    )
    .unwrap();
    let output = actcheck(
        project.path(),
        &[
            "run",
            "configs/r.toml",
            "--runs",
            "5",
            "--history",
            "h",
            "--format",
            "json",
        ],
    );
    let json: Value =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    assert_eq!(
        json["runs_passed"]["count"].as_u64(),
        Some(5),
        "{}",
        stdout(&output)
    );
}

/// A fixed arm looks down from its mast, and picks an object found in its pictures.
#[test]
fn a_fixed_arm_picks_an_object_seen_with_its_camera() {
    let project = project();
    let text =
        lone_glass_for_fixed_arm().replace("[[\"Pick\"]]", "[[\"PerceivePlane\", \"Pick\"]]");
    std::fs::write(project.path().join("configs/see.toml"), text).unwrap();
    let arguments = [
        "run",
        "configs/see.toml",
        "--runs",
        "6",
        "--history",
        "h",
        "--format",
        "json",
    ];
    let output = actcheck(project.path(), &arguments);
    let json: Value =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    let passed = json["runs_passed"]["count"].as_u64().unwrap();
    assert!(
        passed >= 5,
        "{passed} of 6 runs passed fully with a lone object and no noise: {}",
        stdout(&output)
    );
}

/// A simulation compiles the robot again unless the scene has the profile of the campaign's robot.
#[test]
fn a_campaign_compiles_its_robot_once_for_all_scenes() {
    for name in ["pick", "fixed_arm"] {
        let config = root().join(format!("configs/{name}.toml"));
        let env = Env::prepare(&config, &Overrides::default()).unwrap();
        let scene = scenario::draw(&env.space, 0, &mut Choices::recorded(&[])).unwrap();
        assert!(Arc::ptr_eq(&env.robot.profile, &scene.robot.profile));
    }
}
