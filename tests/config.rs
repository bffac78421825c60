//! Configurations: all parameters, the defaults, and files that can't be read.
//!
//! Wrong values are in `tests/diagnostics/config/`.

use std::path::{Path, PathBuf};

use actcheck::base::Files;
use actcheck::config::{self, Campaign, Launcher, Overrides, Step};

fn load(path: &Path) -> Campaign {
    config::load(path, &Overrides::default()).unwrap_or_else(|found| panic!("{found}"))
}

fn load_text(text: &str) -> Campaign {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c.toml");
    std::fs::write(&path, text).unwrap();
    load(&path)
}

fn refused(path: &Path) -> String {
    config::load(path, &Overrides::default())
        .unwrap_err()
        .to_string()
}

#[test]
fn every_shipped_configuration_loads() {
    let is_config = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "toml");
    for path in Files::Disk
        .list(Path::new("configs"))
        .into_iter()
        .filter(is_config)
    {
        let campaign = load(&path);
        assert!(!campaign.tests.is_empty(), "{}", path.display());
    }
}

/// The paper's eleven parameters, including those of later actions.
#[test]
fn all_parameters_of_the_paper_are_read() {
    let campaign = load_text(
        r#"
        tests = [["Pick"], ["MoveTo", "PerceivePlane", "Pick", "Place"]]
        test_count = 15
        test_launcher = "python3 my_robot.py"
        nav_obstacle_list = ["box", "bottle"]
        nav_obstacle_count = 2
        [world]
        worlds = ["lab", "apartment"]
        [objectLocation]
        location_list = ["coffee_table_front"]
        [objectSurface]
        object_surfaces = ["coffee_table", "left_bench"]
        [placeSurface]
        place_object_surfaces = ["side_table", "right_bench"]
        [pickObject]
        model_list = ["glass"]
        [surfaceObjects]
        model_list = ["mug", "can"]
        "#,
    );
    let whole = ["MoveTo", "PerceivePlane", "Pick", "Place"].map(Step::plain);
    assert_eq!(campaign.tests[1], whole);
    assert_eq!(campaign.test_count, 15);
    let Launcher::Program(skill) = &campaign.launcher else {
        panic!("{:?}", campaign.launcher)
    };
    assert_eq!(
        (skill.text.as_str(), skill.args.join(" ")),
        ("python3 my_robot.py", "my_robot.py".to_owned())
    );
    assert_eq!(
        (
            campaign.nav_obstacles.join(" "),
            campaign.nav_obstacle_count
        ),
        ("box bottle".to_owned(), 2)
    );
    let candidates: Vec<String> = campaign
        .candidates
        .iter()
        .map(|(name, values)| format!("{name}: {}", values.join(", ")))
        .collect();
    assert_eq!(
        candidates,
        [
            "objectLocation: coffee_table_front",
            "objectSurface: coffee_table, left_bench",
            "pickObject: glass",
            "placeSurface: side_table, right_bench",
            "surfaceObjects: mug, can",
            "world: lab, apartment",
        ]
    );
    assert_eq!(campaign.other_counts.beside_target, (1, 4));
}

#[test]
fn shipped_files_are_the_defaults() {
    let campaign = load_text("tests = [[\"Pick\"]]\ntest_count = 1\n");
    assert_eq!(
        campaign.ontology,
        (Files::Shipped, PathBuf::from("ontology/actions.ttl"))
    );
    assert!(
        campaign.models.contains_key("glass") && campaign.models["coffee_table"].surface.is_some()
    );
    assert_eq!(
        campaign
            .robot
            .core
            .urdf
            .name
            .strip_prefix("built-in:")
            .map(|name| name.contains("mobile_manipulator")),
        Some(true)
    );
    assert_eq!(
        (campaign.seed, campaign.other_counts.beside_target),
        (0, (0, 0))
    );
    assert_eq!(campaign.launcher, Launcher::Reference);
    assert!(campaign.history.ends_with(".actcheck"));
    assert_eq!(campaign.sensing.position_noise_m, 0.0);
}

#[test]
fn a_single_list_table_may_be_named_after_any_designator() {
    let campaign =
        load_text("tests = [[\"Pour\"]]\ntest_count = 1\n[drink]\nkinds = [\"tea\", \"milk\"]\n");
    assert_eq!(campaign.candidates["drink"], ["tea", "milk"]);
    assert!(campaign.places.contains_key("drink") && campaign.places.contains_key("drink.1"));
}

#[test]
fn the_number_of_other_objects_may_be_exact() {
    let count = |text: &str| {
        load_text(&format!(
            "tests = [[\"Pick\"]]\ntest_count = 1\n[surfaceObjects]\nmodel_list = [\"mug\"]\ncount = {text}\n"
        ))
        .other_counts
        .beside_target
    };
    assert_eq!(count("3"), (3, 3));
    assert_eq!(count("0"), (0, 0));
    assert_eq!(count("[0, 7]"), (0, 7));
}

#[test]
fn paths_are_relative_to_the_configuration_and_the_command_line_wins() {
    let campaign = load(Path::new("configs/pick.toml"));
    assert_eq!(
        campaign.ontology,
        (Files::Disk, PathBuf::from("ontology/actions.ttl"))
    );
    assert_eq!(campaign.history, Path::new("configs/.actcheck"));
    let history = Some(PathBuf::from("elsewhere"));
    let overrides = Overrides {
        runs: Some(2),
        seed: Some(99),
        repeat: Some(3),
        history,
        ..Overrides::default()
    };
    let campaign = config::load(Path::new("configs/pick.toml"), &overrides).unwrap();
    assert_eq!(
        (campaign.test_count, campaign.seed, campaign.repeat),
        (2, 99, 3)
    );
    assert_eq!(campaign.history, PathBuf::from("elsewhere"));
}

#[test]
fn source_spans_are_kept_for_later_stages() {
    let campaign = load(Path::new("configs/pick.toml"));
    let written = |key: &str| &campaign.source.text[campaign.places[key].clone()];
    assert_eq!(written("tests.0.0"), "\"Pick\"");
    assert_eq!(written("pickObject.0"), "\"glass\"");
    assert_eq!(written("pickObject"), "pickObject");
}

#[test]
fn an_unreadable_configuration_is_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let missing = folder.path().join("none.toml");
    assert!(refused(&missing).contains("there is no such file"));
    assert!(refused(folder.path()).contains("it is a folder"));
    let binary = folder.path().join("binary.toml");
    std::fs::write(&binary, [0xff, 0xfe, 0x00]).unwrap();
    assert!(refused(&binary).contains("it is not UTF-8 text"));
    assert!(refused(&binary).starts_with("C001"));
    let empty = folder.path().join("empty.toml");
    std::fs::write(&empty, "").unwrap();
    assert!(refused(&empty).contains("`tests` is missing"));
}

/// Deep nesting and long lists are refused or read, without a crash.
#[test]
fn huge_and_deeply_nested_texts_do_not_crash() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c.toml");
    for text in [
        format!("tests = {}{}", "[".repeat(100_000), "]".repeat(100_000)),
        format!("tests = [[\"Pick\"]]\n{}", "[a.b.c]\n".repeat(2_000)),
        format!("tests = [{}]\ntest_count = 1", "[\"Pick\"],".repeat(10_000)),
        "\u{feff}tests = [[\"Pick\"]]\r\ntest_count = 1\r\n".to_owned(),
        "tests = [[\"Pick\"]]\ntest_count = 1\0".to_owned(),
        "\"tests\" = [[\"Päck🦀\"]]\n'test_count' = 0x10\n".to_owned(),
    ] {
        std::fs::write(&path, text).unwrap();
        // The result does not matter, as long as it returns.
        let _ = config::load(&path, &Overrides::default()).map_err(|found| found.to_string());
    }
}
