//! Masses and sizes that can't be meant are warned of with their numbers, and `check` prints all.

use std::path::Path;

use actcheck::base::Diagnostic;
use actcheck::campaign::Env;
use actcheck::config::Overrides;

use crate::support::{actcheck, root, shipped_project, stderr, stdout};

const CAN: &str = "category = \"act:Can\"\nmass_kg = 0.35\nfriction = 0.5\nsize_m = [0.066, 0.066, 0.122]\n\
    [[parts]]\nshape = \"cylinder\"\nat_m = [0, 0, 0.061]\nradius_m = 0.033\nheight_m = 0.122\n";

/// The exit code of `check` and its output, in one line, for a folder with the object `thing`.
fn checked(folder: &Path) -> (i32, String) {
    let config = "tests = [[\"Pick\"]]\ntest_count = 1\nseed = 1\nmodel_dir = \"models\"\n\
        [objectSurface]\nobject_surfaces = [\"coffee_table\"]\n[pickObject]\nmodel_list = [\"thing\"]\n";
    std::fs::write(folder.join("c.toml"), config).unwrap();
    said(folder)
}

fn said(folder: &Path) -> (i32, String) {
    let output = actcheck(folder, &["check", "c.toml"]);
    let words = (stdout(&output) + &stderr(&output)).replace('│', " ");
    (
        output.status.code().unwrap(),
        words.split_whitespace().collect::<Vec<_>>().join(" "),
    )
}

/// A project with the object `thing`, whose file is that of a can with replaced texts.
fn with_can(replaced: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let objects = folder.path().join("models/objects");
    std::fs::create_dir_all(&objects).unwrap();
    let text = replaced.iter().fold(CAN.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    });
    std::fs::write(objects.join("thing.toml"), text).unwrap();
    folder
}

/// The brick of a published model: 10 mg for 3 cm × 6 cm × 4 cm.
#[test]
fn a_brick_that_is_lighter_than_air_is_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let model = folder.path().join("models/thing");
    std::fs::create_dir_all(&model).unwrap();
    let config = "<model><name>thing</name><sdf version=\"1.6\">model.sdf</sdf></model>";
    std::fs::write(model.join("model.config"), config).unwrap();
    let sdf = "<sdf version=\"1.6\"><model name=\"brick\"><link name=\"body\"><inertial><mass>0.00001</mass>\
        <inertia><ixx>4.333e-09</ixx><iyy>2.083e-09</iyy><izz>3.750e-09</izz></inertia></inertial><collision name=\"c\">\
        <geometry><box><size>0.03 0.06 0.04</size></box></geometry></collision></link></model></sdf>";
    std::fs::write(model.join("model.sdf"), sdf).unwrap();
    let (code, said) = checked(folder.path());
    assert_eq!(code, 0, "{said}");
    for words in [
        "W056",
        "`thing` has 10 mg for 72 cm³: 0.139 kg/m³ is less than air",
        "thing: 10 mg, 3 × 6 × 4 cm",
    ] {
        assert!(said.contains(words), "{words}: {said}");
    }
}

#[test]
fn masses_in_grams_and_lengths_in_millimetres_are_warned_of() {
    let millimetres = [
        ("0.066, 0.066, 0.122", "66, 66, 122"),
        ("0, 0, 0.061", "0, 0, 61"),
        ("= 0.033", "= 33"),
        ("height_m = 0.122", "height_m = 122"),
    ];
    let tiny = [
        ("0.066, 0.066, 0.122", "0.000066, 0.000066, 0.000122"),
        ("0, 0, 0.061", "0, 0, 0.000061"),
        ("= 0.033", "= 0.000033"),
        ("height_m = 0.122", "height_m = 0.000122"),
    ];
    let cases: [(&[(&str, &str)], &str); 4] = [
        (
            &[("mass_kg = 0.35", "mass_kg = 350")],
            "`thing` has 350 kg for 417 cm³: 838553 kg/m³ is more than any element",
        ),
        (&millimetres, "`thing` is 66 × 66 × 122 m large"),
        (&tiny, "`thing` is only 0.066 × 0.066 × 0.122 mm large"),
        // A balloon.
        (&[("mass_kg = 0.35", "mass_kg = 0.0006")], ""),
    ];
    for (replaced, words) in cases {
        let (_, said) = checked(with_can(replaced).path());
        assert_eq!(
            said.contains("W056"),
            !words.is_empty(),
            "{replaced:?}: {said}"
        );
        assert!(said.contains(words), "{words}: {said}");
    }
}

/// The masses of the shipped arm's links, divided by ten.
#[test]
fn a_robot_that_lifts_more_than_its_own_mass_is_warned_of() {
    let project = shipped_project();
    let config = "tests = [[\"Pick\"]]\ntest_count = 1\nmodel_dir = \"models\"\nontology = \"ontology/actions.ttl\"\n\
        [robot]\nprofile = \"fixed_arm\"\n[objectSurface]\nobject_surfaces = [\"coffee_table\"]\n\
        [pickObject]\nmodel_list = [\"can\"]\n";
    std::fs::write(project.path().join("c.toml"), config).unwrap();
    let (code, whole) = said(project.path());
    assert!(code == 0 && !whole.contains("W056"), "{whole}");
    assert!(whole.contains("can: 350 g, 6.6 × 6.6 × 11.5 cm"), "{whole}");
    let file = project.path().join("models/robots/fixed_arm.urdf");
    let text = std::fs::read_to_string(&file).unwrap();
    let mut parts = text.split("<mass value=\"");
    let mut lighter = parts.next().unwrap().to_owned();
    for part in parts {
        let (number, rest) = part.split_once('"').unwrap();
        let mass_kg: f64 = number.parse().unwrap();
        lighter += &format!("<mass value=\"{}\"{rest}", mass_kg / 10.0);
    }
    std::fs::write(&file, lighter).unwrap();
    let (_, said) = said(project.path());
    assert!(
        said.contains("W056")
            && said.contains(" in every posture: no arm lifts 1.5 times its own mass"),
        "{said}"
    );
}

#[test]
fn no_shipped_configuration_has_an_implausible_model() {
    let mut n_configs = 0;
    for entry in std::fs::read_dir(root().join("configs")).unwrap().flatten() {
        let path = entry.path();
        if path.extension().is_none_or(|ending| ending != "toml") {
            continue;
        }
        let Ok(env) = Env::prepare(&path, &Overrides::default()) else {
            continue;
        };
        n_configs += 1;
        let warnings = env.warnings();
        let implausible: Vec<&Diagnostic> = warnings
            .iter()
            .filter(|found| found.code == "W056")
            .collect();
        assert!(
            implausible.is_empty(),
            "{}: {implausible:?}",
            path.display()
        );
    }
    assert!(n_configs >= 8, "{n_configs}");
}
