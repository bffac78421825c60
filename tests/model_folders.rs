//! Several folders of models, and the shipped models behind them.

use std::path::Path;

use crate::support::{actcheck, root, stderr, stdout};

/// An empty project with a configuration for picking `object` from `surface`, with these folders of
/// models.
fn project(model_dir: &str, surface: &str, object: &str) -> tempfile::TempDir {
    let project = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(root().join("configs/lone_glass.toml")).unwrap();
    let text = text
        .replace("ontology = \"../ontology/actions.ttl\"\n", "")
        .replace("\"../models\"", model_dir);
    let text = text
        .replace("\"glass\"", &format!("\"{object}\""))
        .replace("\"coffee_table\"", &format!("\"{surface}\""));
    std::fs::write(project.path().join("c.toml"), text).unwrap();
    project
}

/// Writes a cube with an edge of so many metres.
fn write_cube(project: &Path, path: &str, edge_m: f64) {
    let cube = std::fs::read_to_string(root().join("tests/models/low/cube.toml")).unwrap();
    let file = project.join(path);
    std::fs::create_dir_all(file.parent().unwrap()).unwrap();
    std::fs::write(file, cube.replace("0.05", &edge_m.to_string())).unwrap();
}

/// Regression: with a `model_dir` of one's own objects, no shipped table could be named.
#[test]
fn an_own_object_lies_on_a_shipped_table() {
    let project = project("\"mine\"", "coffee_table", "cube");
    write_cube(project.path(), "mine/objects/cube.toml", 0.05);
    let output = actcheck(project.path(), &["run", "c.toml", "--runs", "1"]);
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}{}",
        stdout(&output),
        stderr(&output)
    );
    let picture = stdout(&actcheck(project.path(), &["list", "--format", "csv"]));
    let id = picture
        .lines()
        .nth(1)
        .and_then(|line| line.split(',').next())
        .unwrap();
    // A case elsewhere names the folder and still finds the table.
    std::fs::create_dir(project.path().join("cases")).unwrap();
    let case = actcheck(
        project.path(),
        &["export", "run", id, "-o", "cases/case.toml"],
    );
    assert_eq!(case.status.code(), Some(0), "{}", stderr(&case));
    let text = std::fs::read_to_string(project.path().join("cases/case.toml")).unwrap();
    assert!(text.contains("model_dir = \"../mine\""), "{text}");
    let again = actcheck(project.path(), &["run", "cases/case.toml"]);
    assert_eq!(again.status.code(), Some(0), "{}", stderr(&again));
}

#[test]
fn the_first_of_several_folders_with_a_name_has_it() {
    let project = project("[\"first\", \"second\"]", "coffee_table", "cube");
    write_cube(project.path(), "first/objects/cube.toml", 0.05);
    write_cube(project.path(), "second/objects/cube.toml", 0.3);
    write_cube(project.path(), "second/objects/block.toml", 0.05);
    let check = || actcheck(project.path(), &["check", "c.toml"]);
    let said = stderr(&check())
        .replace('│', " ")
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ");
    assert!(
        said.contains("there are two models `cube`: second/objects/cube.toml is ignored"),
        "{said}"
    );
    assert!(!said.contains("S070"), "the small cube fits: {said}");

    let file = project.path().join("c.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(
        &file,
        text.replace("[\"cube\"]", "[\"block\", \"cub\", \"mug\"]"),
    )
    .unwrap();
    let said = stderr(&check());
    assert!(
        said.contains("there is no model `cub` in first/objects or second/objects"),
        "{said}"
    );
    assert!(said.contains("did you mean `cube`"), "{said}");
    assert!(
        !said.contains("`block`") && !said.contains("`mug`"),
        "both exist: {said}"
    );

    std::fs::write(&file, text.replace("\"second\"]", "\"secnd\", 3]")).unwrap();
    let said = stderr(&check());
    assert!(
        said.contains("C010") && said.contains("the model folder secnd contains no models"),
        "{said}"
    );
    assert!(
        said.contains("C004") && said.contains("c.toml:10:32"),
        "{said}"
    );
}

/// Regression: a folder of 256 public models gave 700 diagnostics for models that no scene uses.
#[test]
fn unusable_models_that_are_not_named_are_one_warning_with_a_reason_each() {
    let project = project("\"mine\"", "coffee_table", "cube");
    write_cube(project.path(), "mine/objects/cube.toml", 0.05);
    for name in ["a", "b", "c", "d"] {
        let file = project.path().join(format!("mine/objects/{name}.toml"));
        std::fs::write(file, "mass_kgg = 1\ncategory = 2\n").unwrap();
    }
    let output = actcheck(project.path(), &["check", "c.toml"]);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert_eq!(said.matches('⚠').count(), 1, "{said}");
    assert!(
        said.contains("W045") && said.contains("4 models in mine/objects can't be used"),
        "{said}"
    );
    for name in ["a", "b", "c", "d"] {
        assert_eq!(
            said.lines()
                .filter(|line| line.contains(&format!(" {name}: ")))
                .count(),
            1,
            "{said}"
        );
    }
}

/// Regression: a collection of 93 models printed the same warning 81 times.
#[test]
fn a_warning_of_many_files_is_printed_once() {
    let project = project(
        "\"mine\"",
        "coffee_table",
        "cube_1\", \"cube_2\", \"cube_3\", \"cube_4\", \"cube_5",
    );
    for number in 1..=5 {
        let folder = project.path().join(format!("mine/cube_{number}"));
        std::fs::create_dir_all(&folder).unwrap();
        let sdf = format!(
            "<sdf version=\"1.6\"><model name=\"cube_{number}\"><link name=\"l\"><collision name=\"c\">\
             <geometry><box><size>0.05 0.05 0.05</size></box></geometry><surface><mystery/></surface></collision>\
             </link></model></sdf>"
        );
        std::fs::write(folder.join("model.sdf"), sdf).unwrap();
    }
    let said = stderr(&actcheck(project.path(), &["check", "c.toml"]));
    let words = said
        .replace('│', " ")
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ");
    assert_eq!(
        words
            .matches("`<mystery>` in `<surface>` is ignored")
            .count(),
        1,
        "{said}"
    );
    let others = "the same in 4 more places: mine/cube_2/model.sdf:1:";
    assert!(
        words.contains(others) && words.contains("mine/cube_4/") && words.contains(", …"),
        "{said}"
    );
    assert!(!words.contains("mine/cube_5/"), "{said}");
}
