//! External models: a folder in Gazebo's layout works unchanged, and faults of a model are reported
//! with their place.
//!
//! A wrong model is a folder below `tests/diagnostics/models/` that holds the model `thing`, with
//! its diagnostics in `expected`. A new case needs no Rust: run with `UPDATE_EXPECT=1` to write the
//! files, and review them.

use std::fs;
use std::path::{Path, PathBuf};

use actcheck::base::{Diagnostics, Files, Source};
use actcheck::campaign::Env;
use actcheck::config::{self, Campaign, Overrides};
use actcheck::data::{ObjectModel, Shape};
use actcheck::rules::Budget;

use crate::support::expected::assert_diagnostics;
use crate::support::{actcheck, copy, root, stderr, stdout};

const WRONG: &str = "tests/diagnostics/models";

fn campaign(folder: &Path, text: &str) -> Result<Campaign, Diagnostics> {
    let text = format!("tests = [[\"Pick\"]]\ntest_count = 1\n{text}");
    config::load_text(
        Source::new(folder.join("c.toml").display().to_string(), text),
        folder,
        &Overrides::default(),
    )
}

/// A folder with the models of `tests/models/gazebo` and a configuration that uses them.
fn project(text: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    copy(
        &root().join("tests/models/gazebo"),
        &folder.path().join("models"),
    );
    let path = folder.path().join("c.toml");
    std::fs::write(
        &path,
        format!("tests = [[\"Pick\"]]\ntest_count = 2\nmodel_dir = \"models\"\n{text}"),
    )
    .unwrap();
    (folder, path)
}

const USED: &str = "[objectSurface]\nobject_surfaces = [\"cafe_table\"]\n[pickObject]\nmodel_list = [\"paper_cup\"]\n\
    [surfaceObjects]\nmodel_list = [\"cheese\", \"pill_box\"]\ncount = 2\n";

#[test]
fn every_wrong_model_is_reported_with_its_place() {
    let report = |case: PathBuf| {
        let name = case.file_name().unwrap().display();
        let text = format!("model_dir = \"{name}\"\n[pickObject]\nmodel_list = [\"thing\"]\n");
        let diagnostics = campaign(Path::new(WRONG), &text)
            .err()
            .map_or_else(String::new, |found| found.to_string());
        (case.join("expected"), diagnostics)
    };
    assert_diagnostics(
        40,
        Files::Disk
            .folders(Path::new(WRONG))
            .into_iter()
            .map(report),
    );
}

/// Sizes, masses and centres as computed from the files by hand.
#[test]
fn models_of_all_formats_have_the_values_of_their_files() {
    let (folder, _) = project("");
    let campaign = campaign(folder.path(), "model_dir = \"models\"\n").unwrap();
    let names: Vec<&str> = campaign.models.keys().map(String::as_str).collect();
    assert_eq!(names, ["cafe_table", "cheese", "paper_cup", "pill_box"]);
    let near = |found: [f64; 3], expected: [f64; 3]| {
        assert!(
            found
                .iter()
                .zip(expected)
                .all(|(a, b)| (a - b).abs() < 1e-6),
            "{found:?} is not {expected:?}"
        );
    };
    let cup = &campaign.models["paper_cup"];
    near(cup.size_m, [0.076, 0.076, 0.09]);
    assert_eq!(
        (cup.mass_kg, cup.friction, cup.restitution, cup.fixed),
        (0.12, 0.6, 0.05, false)
    );
    // The link's pose lifts it, and a model is placed on the ground: its centre of mass moves with
    // it.
    near(cup.inertia.unwrap().com_m, [0.0, 0.0, 0.04]);
    near(cup.inertia.unwrap().about_com[2], [0.0, 0.0, 0.000_125]);
    let cheese = &campaign.models["cheese"];
    // 10 × 6 × 4 cm, turned by a right angle; half a box of water.
    near(cheese.size_m, [0.06, 0.1, 0.04]);
    assert!(
        (cheese.mass_kg - 0.12).abs() < 1e-6 && cheese.friction == 1.0,
        "{}",
        cheese.mass_kg
    );
    let table = &campaign.models["cafe_table"];
    near(table.size_m, [0.8, 0.5, 0.69]);
    assert!(table.fixed);
    let surface = table.surface.unwrap();
    near(
        [surface.size_m[0], surface.size_m[1], surface.height_m],
        [0.8, 0.5, 0.69],
    );
    let pill_box = &campaign.models["pill_box"];
    near(pill_box.size_m, [0.06, 0.05, 0.09]);
    assert!((pill_box.mass_kg - 0.25).abs() < 1e-9);
    near(
        pill_box.inertia.unwrap().com_m,
        [0.0, 0.0, (0.2 * 0.03 + 0.05 * 0.075) / 0.25],
    );
    assert!(matches!(pill_box.parts[1].shape, Shape::Capsule { .. }));
}

/// A model of SDF with a post, an arm that turns on it, and a weight on the arm. `frames` and the
/// poses of arm, hinge, the arm's box and weight, and the axis.
fn arm_on_a_post(frames: &str, [arm, hinge, solid, weight, axis]: [&str; 5]) -> ObjectModel {
    let link = |name: &str, pose: &str, solid: &str| {
        format!(
            "<link name=\"{name}\">{pose}<collision name=\"c\">{solid}<geometry><box><size>0.1 0.05 0.2</size></box></geometry></collision></link>"
        )
    };
    let text = format!(
        "<sdf version=\"1.9\"><model name=\"thing\">{frames}{}{}{}<joint name=\"hinge\" type=\"revolute\">\
         <parent>post</parent><child>arm</child>{hinge}<axis>{axis}</axis></joint><joint name=\"screw\" type=\"fixed\">\
         <parent>arm</parent><child>weight</child></joint></model></sdf>",
        link("post", "<pose>0 0 0.1 0 0 0</pose>", ""),
        link("arm", arm, solid),
        link("weight", weight, "")
    );
    let (folder, _) = project("");
    let thing = folder.path().join("m/thing");
    fs::create_dir_all(&thing).unwrap();
    fs::write(thing.join("model.sdf"), text).unwrap();
    fs::write(
        thing.join("model.config"),
        "<model><name>thing</name><sdf>model.sdf</sdf></model>",
    )
    .unwrap();
    let campaign =
        campaign(folder.path(), "model_dir = \"m\"\n").unwrap_or_else(|faults| panic!("{faults}"));
    ObjectModel::clone(&campaign.models["thing"])
}

/// Poses relative to a `<frame>`, a link, a joint and the model, and an axis in the frame of a
/// link, are those of the same model with all poses in the frame of the parent.
#[test]
fn poses_relative_to_other_frames_are_those_of_the_parent() {
    let turned = "0 0 1.5707963267948966";
    let plain = arm_on_a_post(
        "",
        [
            &format!("<pose>0.3 0 0.1 {turned}</pose>"),
            "<pose>0.05 0 0 0 0 0</pose>",
            "<pose>0 0.1 0 0 0 0</pose>",
            &format!("<pose>0.3 0.05 0.15 {turned}</pose>"),
            "<xyz expressed_in=\"__model__\">1 0 0</xyz>",
        ],
    );
    let framed = arm_on_a_post(
        &format!(
            "<frame name=\"mount\" attached_to=\"post\"><pose>0.3 0 0 {turned}</pose></frame>"
        ),
        [
            "<pose relative_to=\"mount\"/>",
            &format!("<pose relative_to=\"__model__\">0.3 0.05 0.1 {turned}</pose>"),
            &format!("<pose relative_to=\"post\">0.2 0 0 {turned}</pose>"),
            "<pose relative_to=\"hinge\">0 0 0.05 0 0 0</pose>",
            "<xyz expressed_in=\"post\">1 0 0</xyz>",
        ],
    );
    // As the tools of Gazebo's authors write it: the hinge on the post, the arm on the hinge.
    let chained = arm_on_a_post(
        "",
        [
            "<pose relative_to=\"hinge\">-0.05 0 0 0 0 0</pose>",
            &format!("<pose relative_to=\"post\">0.3 0.05 0 {turned}</pose>"),
            "<pose>0 0.1 0 0 0 0</pose>",
            "<pose relative_to=\"arm\">0.05 0 0.05 0 0 0</pose>",
            "<xyz expressed_in=\"hinge\">0 -1 0</xyz>",
        ],
    );
    let numbers = |model: &ObjectModel| {
        let moving = &model.moving[0];
        let parts = model.parts.iter().chain(&moving.model.parts);
        let mut numbers: Vec<f64> = parts
            .flat_map(|part| [part.bounds().0, part.bounds().1].concat())
            .collect();
        numbers.extend([moving.joint.axis, moving.joint.anchor_m].concat());
        numbers
    };
    let expected = numbers(&plain);
    assert_eq!(expected.len(), 24, "three solids, an axis and a place");
    for found in [numbers(&framed), numbers(&chained)] {
        let is_near = |(found, expected): (&f64, &f64)| (found - expected).abs() < 1e-9;
        assert!(
            found.len() == 24 && found.iter().zip(&expected).all(is_near),
            "{found:?}\n{expected:?}"
        );
    }
}

/// Objects of MuJoCo: a file beside others, and one in a folder of its name.
#[test]
fn objects_of_mujoco_have_the_values_of_their_files() {
    let (folder, _) = project("");
    let models = folder.path().join("m");
    fs::create_dir_all(models.join("chest")).unwrap();
    let tin = "<?xml version=\"1.0\"?><!-- a tin --><mujoco><compiler angle=\"degree\"/><worldbody><body><body name=\"object\"><freejoint/>\
        <geom type=\"cylinder\" size=\"0.03 0.05\" density=\"500\" friction=\"0.7 0.3 0.1\"/>\
        <geom type=\"box\" size=\"1 1 1\" contype=\"0\" conaffinity=\"0\" mass=\"0\"/></body>\
        <site name=\"top\" pos=\"0 0 0.05\"/></body></worldbody></mujoco>";
    let chest = "<mujoco><worldbody><body name=\"chest\"><joint type=\"free\"/>\
        <geom type=\"box\" size=\"0.2 0.1 0.1\" mass=\"3\"/><geom type=\"ellipsoid\" size=\"0.05 0.05 0.02\" pos=\"0 0 0.1\" mass=\"1\"/>\
        <body name=\"lid\" pos=\"0 0.1 0.13\"><joint name=\"hinge\" axis=\"1 0 0\" range=\"0 90\" frictionloss=\"0.4\" damping=\"0.2\"/>\
        <geom type=\"box\" size=\"0.2 0.1 0.01\" pos=\"0 -0.1 0\" density=\"600\"/></body></body></worldbody></mujoco>";
    fs::write(models.join("tin.xml"), tin).unwrap();
    fs::write(models.join("chest/chest.xml"), chest).unwrap();
    fs::write(
        models.join("package.xml"),
        "<!-- <mujoco> --><package><mujoco/></package>",
    )
    .unwrap();
    let campaign =
        campaign(folder.path(), "model_dir = \"m\"\n").unwrap_or_else(|faults| panic!("{faults}"));
    assert_eq!(campaign.models.keys().collect::<Vec<_>>(), ["chest", "tin"]);
    let near = |found: f64, expected: f64| {
        assert!((found - expected).abs() < 1e-6, "{found} is not {expected}")
    };
    let tin = &campaign.models["tin"];
    near(
        tin.mass_kg,
        500.0 * std::f64::consts::PI * 0.03 * 0.03 * 0.1,
    );
    near(tin.friction, 0.7);
    assert_eq!((tin.parts.len(), tin.fixed), (1, false));
    let chest = &campaign.models["chest"];
    let lid = &chest.moving[0];
    near(chest.mass_kg, 4.0);
    near(lid.model.mass_kg, 600.0 * 0.4 * 0.2 * 0.02);
    near(lid.joint.range[1], std::f64::consts::FRAC_PI_2);
    assert_eq!(
        (lid.name.as_str(), lid.joint.friction, lid.joint.damping),
        ("lid", 0.4, 0.2)
    );
}

/// A world of MuJoCo: bodies and walls at its top are furniture, and the robot drives on the floor
/// around a lone table.
#[test]
fn a_campaign_runs_in_a_world_of_mujoco() {
    let (folder, _) = project("");
    let worlds = folder.path().join("m/worlds");
    fs::create_dir_all(&worlds).unwrap();
    let text = "<mujoco><worldbody><geom type=\"plane\" size=\"3 3 .1\"/><body name=\"desk\" pos=\"0 0 0.2\">\
        <geom type=\"box\" size=\"0.3 0.4 0.2\"/></body><body name=\"lamp\" pos=\"0 1 0.5\"><freejoint/>\
        <geom type=\"cylinder\" size=\"0.1 0.5\"/></body><body name=\"poster\"><geom size=\"1\" contype=\"0\" conaffinity=\"0\"/>\
        </body><geom name=\"wall\" type=\"box\" size=\"0.05 1 1\" pos=\"0.6 0 1\"/></worldbody></mujoco>";
    fs::write(worlds.join("office.xml"), text).unwrap();
    let rest = "[world]\nworlds = [\"office\"]\n[objectLocation]\nlocation_list = [\"desk_front\"]\n[objectSurface]\n\
        object_surfaces = [\"desk\"]\n[pickObject]\nmodel_list = [\"can\"]\n";
    let path = folder.path().join("c.toml");
    fs::write(
        &path,
        format!("tests = [[\"MoveTo\"]]\ntest_count = 2\nseed = 1\nmodel_dir = \"m\"\n{rest}"),
    )
    .unwrap();
    let campaign = campaign(folder.path(), &format!("model_dir = \"m\"\n{rest}"))
        .unwrap_or_else(|faults| panic!("{faults}"));
    let office = &campaign.worlds["office"];
    let names: Vec<&str> = office
        .furniture
        .iter()
        .map(|piece| piece.name.as_str())
        .collect();
    assert_eq!(names, ["desk", "lamp", "wall"]);
    assert_eq!(office.furniture[1].pose.position, [0.0, 1.0, 0.0]);
    let checked = actcheck(folder.path(), &["check", "c.toml"]);
    assert!(
        stderr(&checked).contains("`lamp` can move"),
        "{}",
        stderr(&checked)
    );
    let ran = actcheck(folder.path(), &["run", "c.toml"]);
    assert!(
        !stdout(&ran).contains("did not complete"),
        "{}{}",
        stdout(&ran),
        stderr(&ran)
    );
    assert!(stdout(&ran).contains("GoalReached"), "{}", stdout(&ran));
}

/// A folder may have worlds alone.
#[test]
fn a_model_folder_may_have_worlds_alone() {
    let (folder, _) = project("");
    let worlds = folder.path().join("m/worlds");
    fs::create_dir_all(&worlds).unwrap();
    assert!(
        campaign(folder.path(), "model_dir = \"m\"\n")
            .unwrap_err()
            .to_string()
            .contains("C010")
    );
    fs::write(
        worlds.join("yard.sdf"),
        "<sdf version=\"1.9\"><world name=\"yard\"/></sdf>",
    )
    .unwrap();
    campaign(folder.path(), "model_dir = \"m\"\n").unwrap_or_else(|faults| panic!("{faults}"));
}

/// The broken model is named with all its faults; the others work.
#[test]
fn a_broken_model_is_named_and_the_others_work() {
    let (folder, _) = project(USED);
    let campaign = campaign(folder.path(), &format!("model_dir = \"models\"\n{USED}")).unwrap();
    let said = campaign.warnings.to_string();
    for part in [
        "broken_lamp/model.sdf:6:25",
        "there is no `broken_lamp/meshes/foot.stl`",
        "`hinge` is of the type universal",
    ] {
        assert!(said.contains(part), "{said}");
    }
    assert!(!said.contains("paper_cup/"), "{said}");
    // If selected by name, it is refused.
    let asked = USED.replace("paper_cup", "broken_lamp");
    let refused =
        self::campaign(folder.path(), &format!("model_dir = \"models\"\n{asked}")).unwrap_err();
    assert!(
        refused.has_errors() && !refused.to_string().contains("C008"),
        "{refused}"
    );
}

/// Meshes are decomposed once. The cached result equals a new one, and a damaged cache is rebuilt.
#[test]
fn decomposed_meshes_are_cached_beside_the_history() {
    let (folder, path) = project(USED);
    let solids = || {
        let env = Env::prepare_within(&path, &Overrides::default(), Budget::default()).unwrap();
        format!("{:?}", env.campaign.models["paper_cup"].parts)
    };
    let made = solids();
    assert!(made.matches("Hull").count() >= 8, "a cup is hollow: {made}");
    let kept = Files::Disk.list(&folder.path().join(".actcheck/hulls"));
    // The cup, the cheese and the top of the table.
    assert_eq!(kept.len(), 3, "{kept:?}");
    assert_eq!(solids(), made);
    for file in &kept {
        std::fs::write(file, "damaged").unwrap();
    }
    assert_eq!(solids(), made);
    assert!(
        kept.iter()
            .all(|file| std::fs::read(file).unwrap().len() > 100)
    );
}

/// Regression: a label on a cup, or a carpet on the floor, made the model or the whole world
/// unusable.
#[test]
fn a_flat_part_of_a_model_becomes_a_sheet() {
    let (folder, path) = project(&USED.replace("paper_cup", "tag"));
    let tag = folder.path().join("models/tag");
    fs::create_dir(&tag).unwrap();
    fs::write(
        tag.join("model.config"),
        "<model><name>tag</name><sdf>model.sdf</sdf></model>",
    )
    .unwrap();
    let collision = |name: &str, geometry: &str| {
        format!("<collision name=\"{name}\"><geometry>{geometry}</geometry></collision>")
    };
    let label = collision("label", "<mesh><uri>label.obj</uri></mesh>");
    let body = collision("body", "<box><size>0.05 0.05 0.05</size></box>");
    let model = format!(
        "<sdf version=\"1.6\"><model name=\"tag\"><link name=\"l\">{body}{label}</link></model></sdf>"
    );
    fs::write(tag.join("model.sdf"), model).unwrap();
    let corners = [[-0.02, -0.01], [0.02, -0.01], [0.02, 0.01], [-0.02, 0.01]];
    let corners: String = corners
        .iter()
        .map(|[x, y]| format!("v {x} {y} 0.025\n"))
        .collect();
    fs::write(tag.join("label.obj"), format!("{corners}f 1 2 3 4\n")).unwrap();
    let env = Env::prepare_within(&path, &Overrides::default(), Budget::default()).unwrap();
    let parts = &env.campaign.models["tag"].parts;
    let [_, label] = parts.as_slice() else {
        panic!("{parts:?}")
    };
    let (low, high) = label.bounds();
    let sizes = [0, 1, 2].map(|axis| high[axis] - low[axis]);
    assert!(
        sizes
            .iter()
            .zip([0.04, 0.02, 0.001])
            .all(|(size, expected)| (size - expected).abs() < 1e-6),
        "{sizes:?}"
    );
}

/// A model's name gives its category, `[categories]` overrides it, and the default is an object.
#[test]
fn model_categories_come_from_names_and_the_configuration() {
    let category = |text: &str| {
        let (_folder, path) = project(&format!("{USED}{text}"));
        let env = Env::prepare_within(&path, &Overrides::default(), Budget::default()).unwrap();
        let all = ["paper_cup", "cafe_table", "cheese"].map(|name| {
            env.campaign.models[name]
                .category
                .replace("http://actions#", "")
        });
        (all.join(" "), env.campaign.warnings.to_string())
    };
    let (categories, said) = category("");
    assert_eq!(categories, "Cup Table Object");
    assert!(
        said.contains("W039: the model `cheese` has no category"),
        "{said}"
    );
    let (categories, said) =
        category("[categories]\ncheese = \"act:Tableware\"\npaper_cup = \"act:Glass\"\n");
    assert_eq!(categories, "Glass Table Tableware");
    assert!(!said.contains("W039"), "{said}");
}

#[test]
fn a_campaign_runs_with_a_folder_of_gazebo_models() {
    let (folder, _) = project(USED);
    let output = actcheck(
        folder.path(),
        &["run", "c.toml", "--jobs", "1", "--format", "json"],
    );
    assert!(
        output.status.code().is_some_and(|code| code <= 1),
        "{}",
        stderr(&output)
    );
    assert!(
        stderr(&output).contains("broken_lamp"),
        "{}",
        stderr(&output)
    );
    let json = stdout(&output);
    assert!(
        json.contains("\"runs\"") && !json.contains("\"broken\": 1"),
        "{json}"
    );
}
