//! A camera that is fixed beside the robot (`camera_link = "map"`).

use serde_json::Value;

use crate::support::{actcheck, root, shipped_project, stderr, stdout};

/// The shipped mobile robot without its camera: one on the opposite side of the table looks down at
/// it instead.
fn project() -> tempfile::TempDir {
    let project = shipped_project();
    let profile =
        std::fs::read_to_string(root().join("models/robots/mobile_manipulator.toml")).unwrap();
    let fixed = "camera_link = \"map\"\ncamera_offset_m = [1.1, 0, 1.7]\ncamera_turned_rad = [0, 0.75, 3.1416]";
    let text = profile.replace("camera_link = \"head_camera_link\"", fixed);
    assert_ne!(text, profile);
    std::fs::write(project.path().join("models/robots/watched.toml"), text).unwrap();
    let config = std::fs::read_to_string(root().join("configs/perceive.toml")).unwrap();
    let config = config
        .replace("\"mobile_manipulator\"", "\"watched\"")
        .replace(", \"mini_coffee_table\", \"table\"", "");
    std::fs::write(project.path().join("configs/watched.toml"), config).unwrap();
    project
}

#[test]
fn a_camera_on_a_tripod_stays_where_it_is_and_sees_the_table() {
    let project = project();
    let output = actcheck(
        project.path(),
        &[
            "run",
            "configs/watched.toml",
            "--runs",
            "4",
            "--format",
            "json",
        ],
    );
    let json: Value =
        serde_json::from_str(&stdout(&output)).unwrap_or_else(|_| panic!("{}", stderr(&output)));
    let property = json["properties"]
        .as_array()
        .unwrap()
        .iter()
        .find(|property| property["label"] == "PlaneFound");
    assert_eq!(
        property.map(|property| &property["counts"]["passed"]),
        Some(&Value::from(4)),
        "{json:#}"
    );
    let query = "PREFIX w: <https://w3id.org/actcheck/world#> SELECT DISTINCT ?x ?z { GRAPH ?g { ?seen w:cameraX ?x; w:cameraZ ?z } }";
    let places = stdout(&actcheck(
        project.path(),
        &["query", query, "--format", "csv"],
    ));
    assert_eq!(
        places.lines().skip(1).collect::<Vec<_>>(),
        ["1.1,1.7"],
        "{places}"
    );
}

#[test]
fn check_names_a_place_outside_the_map() {
    let project = project();
    let file = project.path().join("models/robots/watched.toml");
    let profile = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, profile.replace("[1.1, 0, 1.7]", "[1.1, 0, 1700]")).unwrap();
    let output = actcheck(project.path(), &["check", "configs/watched.toml"]);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(
        said.contains("`camera_offset_m` is 1700") && said.contains("watched.toml:13"),
        "{said}"
    );
}
