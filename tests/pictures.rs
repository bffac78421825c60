//! Pictures of real runs, with the built program: PNG pixels, well-formed SVG, and refusal of other
//! file extensions.

use std::path::Path;

use actcheck::actions::Saboteur;
use actcheck::campaign::oracles::FAULTS;
use actcheck::campaign::{Clock, Env, RunContext, RunInput, run_sabotaged};
use actcheck::config::Overrides;
use actcheck::data::Choices;
use actcheck::report::{Caption, run_picture};
use tiny_skia::Pixmap;

use crate::support::{actcheck, edit, project, root, stderr, stdout};

/// The id of the first run of a new campaign.
fn first_run(folder: &Path, config: &str) -> String {
    let output = actcheck(
        folder,
        &[
            "run",
            config,
            "--runs",
            "1",
            "--history",
            "h",
            "--format",
            "csv",
        ],
    );
    assert!(output.status.code() < Some(2), "{}", stderr(&output));
    stdout(&output)
        .lines()
        .nth(1)
        .unwrap()
        .split(',')
        .next()
        .unwrap()
        .to_owned()
}

fn draw(folder: &Path, run: &str, file: &str) -> Vec<u8> {
    let output = actcheck(folder, &["show", run, "--history", "h", "--picture", file]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    std::fs::read(folder.join(file)).unwrap()
}

#[test]
fn a_pick_is_drawn_as_png_and_svg() {
    let project = project();
    let run = first_run(project.path(), "configs/pick.toml");
    let picture = Pixmap::decode_png(&draw(project.path(), &run, "pick.PNG")).unwrap();
    assert!(
        picture.width() == 2400 && picture.height() > 1200,
        "{} × {}",
        picture.width(),
        picture.height()
    );
    let count = |is: &dyn Fn([u8; 3]) -> bool| {
        picture
            .pixels()
            .iter()
            .filter(|pixel| is([pixel.red(), pixel.green(), pixel.blue()]))
            .count()
    };
    // Text, percepts, and the path of the hand.
    assert!(count(&|rgb| rgb == [0x1c, 0x24, 0x30]) > 1000);
    assert!(count(&|rgb| rgb == [0xa0, 0x2c, 0x9a]) > 1000);
    assert!(count(&|[red, green, blue]| red > 200 && green < 120 && blue < 60) > 1000);

    let lines = String::from_utf8(draw(project.path(), &run, "pick.svg")).unwrap();
    let tree = roxmltree::Document::parse(&lines).unwrap();
    let words: Vec<&str> = tree.descendants().filter_map(|node| node.text()).collect();
    for word in [
        "glass_1",
        "coffee_table_1",
        "robot",
        "before, from above   x → y ↑",
    ] {
        assert!(words.contains(&word), "{word}: {words:?}");
    }
    assert!(
        words
            .iter()
            .any(|word| word.starts_with(&format!("{run} · Pick"))),
        "{words:?}"
    );
    for node in tree.descendants().filter(|node| node.has_tag_name("text")) {
        let number = |name: &str| -> f64 { node.attribute(name).unwrap().parse().unwrap() };
        let [left, right] = [number("x"), number("x") + number("textLength")];
        assert!(left >= 0.0 && right <= 1200.0, "{:?}", node.text());
    }
    // The same run gives the same picture.
    assert_eq!(draw(project.path(), &run, "again.svg"), lines.as_bytes());
}

#[test]
fn a_world_is_drawn_with_its_rooms_places_and_walls() {
    let project = project();
    let config = project.path().join("configs/perceive.toml");
    edit(
        &config,
        "[objectSurface]\nobject_surfaces = [\"coffee_table\", \"mini_coffee_table\", \"table\"]",
        "[world]\nworlds = [\"apartment\"]\n[objectSurface]\nobject_surfaces = [\"dining_table\"]",
    );
    let run = first_run(project.path(), "configs/perceive.toml");
    let lines = String::from_utf8(draw(project.path(), &run, "world.svg")).unwrap();
    let tree = roxmltree::Document::parse(&lines).unwrap();
    let words: Vec<&str> = tree.descendants().filter_map(|node| node.text()).collect();
    for word in [
        "kitchen",
        "living_room",
        "passage",
        "sofa",
        "dining_table",
        "before, the whole world from above   x → y ↑",
    ] {
        assert!(words.contains(&word), "{word}: {words:?}");
    }
    assert!(
        words.iter().any(|word| word.starts_with("seen: ")),
        "{words:?}"
    );
}

/// A robot that was pushed against a table: the picture shows where.
#[test]
fn the_hardest_contact_is_marked_with_its_time_and_position() {
    let project = project();
    let env = Env::prepare(
        &project.path().join("configs/pick.toml"),
        &Overrides::default(),
    )
    .unwrap();
    let fault = FAULTS
        .into_iter()
        .find(|fault| fault.name == "base-pushed")
        .unwrap();
    let context = RunContext {
        clock: Clock {
            now: String::new,
            secs: || 0.0,
        },
        disturb: None,
    };
    let input = RunInput {
        campaign: "k",
        index: 0,
        choices: Choices::random(env.campaign.seed, 0),
    };
    let run = run_sabotaged(&env, input, &context, &mut Saboteur::new(fault.sabotage)).unwrap();
    let roles = run
        .scene
        .objects
        .iter()
        .map(|object| (object.id.clone(), object.role))
        .collect();
    let drawing = run_picture(
        &Caption {
            roles,
            ..Caption::default()
        },
        &run.trace,
    )
    .unwrap();
    let lines = drawing.to_svg();
    let tree = roxmltree::Document::parse(&lines).unwrap();
    let words: Vec<&str> = tree.descendants().filter_map(|node| node.text()).collect();
    let marks: Vec<&&str> = words
        .iter()
        .filter(|word| word.contains(" presses coffee_table_1: "))
        .collect();
    let headed = marks
        .iter()
        .find(|word| word.starts_with("hardest contact: "))
        .expect("the header has the contact");
    assert!(
        headed.contains(" N, from ") && headed.contains(", at x = "),
        "{headed}"
    );
    let label = marks
        .iter()
        .find(|word| word.ends_with(" N"))
        .expect("the mark has a label");
    let force: f64 = label
        .trim_end_matches(" N")
        .rsplit(' ')
        .next()
        .unwrap()
        .parse()
        .unwrap();
    assert!(force >= 70.0, "{label}");
    assert!(words.contains(&"hardest unwanted contact"), "{words:?}");
}

/// The outlines of the robot in a picture, one list of corners each. Unit: pixels.
fn outlines_of_robot(tree: &roxmltree::Document) -> Vec<Vec<[f64; 2]>> {
    let of_robot = tree
        .descendants()
        .filter(|node| node.attribute("fill") == Some("#5a7a99"));
    let paths = of_robot.filter_map(|node| node.attribute("d"));
    let polygons = paths.flat_map(|path| path.split('Z').filter(|part| !part.is_empty()));
    let corner = |pair: &str| {
        let (x, y) = pair.split_once(',').unwrap();
        [x, y].map(|number| number.parse().unwrap())
    };
    polygons
        .map(|part| {
            let corners = part.trim_start_matches('M').split(' ');
            corners.map(corner).collect()
        })
        .collect()
}

/// Runs a pick with a robot of `tests/data/robots`, and draws it.
fn drawn_robot(robot: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let file = root().join("tests/data/robots").join(robot);
    std::fs::copy(file, folder.path().join(robot)).unwrap();
    let config = "tests = [[\"Pick\"]]\ntest_count = 1\nseed = 7\n\
        [objectSurface]\nobject_surfaces = [\"mini_coffee_table\"]\n\
        [pickObject]\nmodel_list = [\"can\"]\n[robot]\nprofile = \"robot.toml\"\n";
    std::fs::write(folder.path().join("c.toml"), config).unwrap();
    let proposed = actcheck(
        folder.path(),
        &["new", "robot", robot, "--out", "robot.toml"],
    );
    assert_eq!(proposed.status.code(), Some(0), "{}", stderr(&proposed));
    let run = first_run(folder.path(), "c.toml");
    String::from_utf8(draw(folder.path(), &run, "run.svg")).unwrap()
}

/// A link that is fixed to a fixed base has no track. Its box of 24 cm × 24 cm × 40 cm is drawn in
/// the views from the side and from above.
#[test]
fn the_pedestal_of_a_fixed_robot_is_drawn() {
    let lines = drawn_robot("arm_on_a_pedestal.xml");
    let tree = roxmltree::Document::parse(&lines).unwrap();
    let sides = |corners: &Vec<[f64; 2]>| {
        let side = |axis: usize| {
            let along = || corners.iter().map(|corner| corner[axis]);
            along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
        };
        (corners.len() == 4).then(|| side(0) / side(1))
    };
    let ratios: Vec<f64> = outlines_of_robot(&tree).iter().filter_map(sides).collect();
    // The robot is turned a little, which makes its side wider.
    let count = |low: f64, high: f64| {
        let between = ratios.iter().filter(|ratio| (low..high).contains(*ratio));
        between.count()
    };
    let (side, above) = (count(0.595, 0.68), count(0.99, 1.01));
    assert!(side == 2 && above >= 2, "before and after: {ratios:?}");
}

/// The links of the base have no shapes and so no track: none of the links that move is the base.
#[test]
fn a_base_that_can_not_move_has_no_path() {
    for robot in ["arm_on_a_bare_base.urdf", "arm_on_a_pedestal.xml"] {
        let lines = drawn_robot(robot);
        let tree = roxmltree::Document::parse(&lines).unwrap();
        let words: Vec<&str> = tree.descendants().filter_map(|node| node.text()).collect();
        assert!(words.contains(&"path of the hand"), "{robot}: {words:?}");
        let of_base = words
            .iter()
            .any(|word| word.starts_with("path of the base"));
        assert!(!of_base, "{robot}: {words:?}");
    }
}

#[test]
fn other_file_extensions_are_refused_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    for file in ["run.jpg", "run", "run.png.gz"] {
        let output = actcheck(
            folder.path(),
            &["show", "abcd-1", "--history", "h", "--picture", file],
        );
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2));
        assert!(
            said.contains("X012") && said.contains(".png or .svg"),
            "{said}"
        );
    }
}
