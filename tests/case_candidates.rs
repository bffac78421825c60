//! Cases name their candidates, so that a case gives the same scene after its configuration gets
//! other candidates.

use std::path::Path;

use actcheck::base::{Diagnostics, Source};
use actcheck::campaign::shrink::{ShrinkOptions, shrink};
use actcheck::campaign::{Clock, Env, RunContext};
use actcheck::config::{self, CaseText, Overrides, WrittenPaths};
use actcheck::data::{Choices, Scene};
use actcheck::scenario;

/// A choice of a candidate.
struct Named {
    choice: &'static str,
    /// The list of candidates: table and key.
    list: (&'static str, &'static str),
    /// The only candidate of the list at first.
    candidate: &'static str,
    /// Another possible candidate.
    other: &'static str,
    /// The other lines of the configuration.
    rest: &'static [&'static str],
}

const fn named(
    choice: &'static str,
    list: (&'static str, &'static str),
    candidate: &'static str,
    other: &'static str,
    rest: &'static [&'static str],
) -> Named {
    Named {
        choice,
        list,
        candidate,
        other,
        rest,
    }
}

const APARTMENT: &str = "world.worlds = [\"apartment\"]\n";
const EMPTY_ROOM: &str = "world.worlds = [\"empty_room\"]\n";
const COFFEE_TABLE: &str = "objectSurface.object_surfaces = [\"coffee_table\"]\n";
const GLASS: &str = "pickObject.model_list = [\"glass\"]\n";

/// Every choice of a candidate that a scene can have.
const NAMED: [Named; 11] = [
    named(
        "world",
        ("world", "worlds"),
        "apartment",
        "empty_room",
        &[COFFEE_TABLE, GLASS],
    ),
    named(
        "surface.name",
        ("objectSurface", "object_surfaces"),
        "coffee_table",
        "dining_table",
        &[APARTMENT, GLASS],
    ),
    named(
        "surface.model",
        ("objectSurface", "object_surfaces"),
        "coffee_table",
        "table",
        &[GLASS],
    ),
    named(
        "location.name",
        ("objectLocation", "location_list"),
        "left_corner",
        "door",
        &[EMPTY_ROOM, COFFEE_TABLE, GLASS],
    ),
    named(
        "objectLocation",
        ("objectLocation", "location_list"),
        "here",
        "there",
        &[COFFEE_TABLE, GLASS],
    ),
    named(
        "place.name",
        ("placeSurface", "place_object_surfaces"),
        "side_table",
        "dining_table",
        &[APARTMENT, COFFEE_TABLE, GLASS],
    ),
    named(
        "place.model",
        ("placeSurface", "place_object_surfaces"),
        "table",
        "mini_coffee_table",
        &[COFFEE_TABLE, GLASS],
    ),
    named(
        "target.model",
        ("pickObject", "model_list"),
        "glass",
        "mug",
        &[COFFEE_TABLE],
    ),
    named(
        "other.1.model",
        ("surfaceObjects", "model_list"),
        "mug",
        "can",
        &[COFFEE_TABLE, GLASS, "surfaceObjects.count = 1\n"],
    ),
    named(
        "place_other.1.model",
        ("surfaceObjects", "model_list"),
        "mug",
        "can",
        &[
            COFFEE_TABLE,
            GLASS,
            "surfaceObjects.count = 0\n",
            "placeSurface.place_object_surfaces = [\"table\"]\n",
            "placeSurface.count = 1\n",
        ],
    ),
    named(
        "obstacle.1.model",
        ("", "nav_obstacle_list"),
        "bowl",
        "bottle",
        &["nav_obstacle_count = 1\n", COFFEE_TABLE, GLASS],
    ),
];

impl Named {
    /// The configuration, with these candidates.
    fn config(&self) -> String {
        let (table, key) = self.list;
        let dot = if table.is_empty() { "" } else { "." };
        let (candidate, rest) = (self.candidate, self.rest.concat());
        format!(
            "tests = [[\"Pick\"]]\ntest_count = 1\n{table}{dot}{key} = [\"{candidate}\"]\n{rest}"
        )
    }

    /// The text with other candidates in this list.
    fn with(&self, text: &str, candidates: &[&str]) -> String {
        let (table, key) = self.list;
        let from = if table.is_empty() {
            0
        } else {
            text.find(&format!("[{table}]")).unwrap()
        };
        let start = from + text[from..].find(&format!("{key} = [")).unwrap();
        let end = start + text[start..].find(']').unwrap() + 1;
        format!("{}{key} = {candidates:?}{}", &text[..start], &text[end..])
    }

    /// An exported case of this configuration, and its scene.
    fn case(&self) -> (String, String) {
        let env = env(&self.config()).unwrap_or_else(|found| panic!("{}: {found}", self.choice));
        let mut choices = Choices::random(3, 1);
        let scene = scenario::draw(&env.space, 0, &mut choices).unwrap();
        let case = CaseText {
            run: "k-1",
            test: &env.campaign.tests[0],
            failed: &[],
            trace: "00",
            choices: choices.made(),
            paths: WrittenPaths::default(),
            skill: None,
        };
        (
            config::case_text(&env.campaign, &case).unwrap(),
            shown(&scene),
        )
    }
}

fn env(text: &str) -> Result<Env, Diagnostics> {
    Env::prepare_text(
        Source::new("case.toml", text),
        Path::new("."),
        &Overrides::default(),
    )
}

/// The scene of a case.
fn scene_of(text: &str) -> Result<String, Diagnostics> {
    let env = env(text)?;
    let choices = &env.campaign.case.as_ref().unwrap().choices;
    Ok(shown(
        &scenario::draw(&env.space, 0, &mut Choices::named(choices)).unwrap(),
    ))
}

/// Everything that is the same in equal scenes, to the last bit.
fn shown(scene: &Scene) -> String {
    let objects = scene
        .objects
        .iter()
        .map(|o| format!("{} {:?} {:?} {}", o.id, o.role, o.pose, o.model.name));
    let objects: Vec<String> = objects.collect();
    format!(
        "{} {objects:?} {:?} {:?}",
        scene.world, scene.robot.base, scene.designators
    )
}

/// The text with another value of a choice.
fn with_value(text: &str, choice: &str, value: &str) -> String {
    let is_of = |line: &&str| line.starts_with(&format!("{choice} = "));
    let line = text
        .lines()
        .find(is_of)
        .unwrap_or_else(|| panic!("no {choice} in:\n{text}"));
    text.replace(line, &format!("{choice} = {value}"))
}

#[test]
fn a_case_gives_the_same_scene_after_candidates_are_added_before_its_own() {
    let mut wrong = Vec::new();
    for named in &NAMED {
        let (text, scene) = named.case();
        assert_eq!(scene_of(&text).unwrap(), scene, "{}", named.choice);
        let expected = format!("{} = \"{}\"", named.choice, named.candidate);
        if !text.lines().any(|line| line == expected) {
            wrong.push(format!("{}: not written as {expected}", named.choice));
        }
        match scene_of(&named.with(&text, &[named.other, named.candidate])) {
            Ok(same) if same == scene => {}
            Ok(_) => wrong.push(format!("{}: another scene", named.choice)),
            Err(found) => wrong.push(format!("{}: {found}", named.choice)),
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_case_is_refused_after_its_candidate_is_removed() {
    let mut wrong = Vec::new();
    for named in &NAMED {
        let (text, _) = named.case();
        match scene_of(&named.with(&text, &[named.other])) {
            Ok(_) => wrong.push(format!("{}: another scene", named.choice)),
            Err(found) => {
                let said = found.to_string();
                if !(said.contains("C015")
                    && said.contains(named.candidate)
                    && said.contains(named.other))
                {
                    wrong.push(format!("{}: {said}", named.choice));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_candidate_that_the_scene_can_not_have_is_refused() {
    let place = NAMED
        .iter()
        .find(|named| named.choice == "place.name")
        .unwrap();
    let (text, _) = place.case();
    let text = place.with(&text, &["coffee_table", "side_table", "dining_table"]);
    let said = scene_of(&with_value(&text, "place.name", "\"coffee_table\""))
        .unwrap_err()
        .to_string();
    assert!(
        said.contains("S062") && said.contains("allowed: side_table, dining_table"),
        "{said}"
    );
}

#[test]
fn a_run_whose_candidate_is_removed_is_not_shrunk() {
    for named in &NAMED {
        let mut choices = Choices::random(3, 1);
        scenario::draw(&env(&named.config()).unwrap().space, 0, &mut choices).unwrap();
        let without = named.config().replace(
            &format!("[\"{}\"]", named.candidate),
            &format!("[\"{}\"]", named.other),
        );
        let context = RunContext {
            clock: Clock {
                now: String::new,
                secs: || 0.0,
            },
            disturb: None,
        };
        let stop = || false;
        let options = ShrinkOptions {
            property: None,
            trials: 1,
            jobs: 1,
            repeat: None,
            context,
            stop: &stop,
        };
        let said = shrink(
            &env(&without).unwrap(),
            0,
            choices.made(),
            &options,
            &mut |_| {},
        )
        .unwrap_err()
        .to_string();
        assert!(
            said.contains("S051") && said.contains(named.choice) && said.contains(named.candidate),
            "{said}"
        );
    }
}

#[test]
fn an_index_in_an_old_case_still_works_and_is_reported_if_it_is_ambiguous() {
    for named in &NAMED {
        let (text, scene) = named.case();
        let old = with_value(&text, named.choice, "0.0");
        assert_eq!(scene_of(&old).unwrap(), scene, "{}", named.choice);
        assert!(
            env(&old).unwrap().warnings().is_empty(),
            "{}: a single candidate is not ambiguous",
            named.choice
        );
        let grown = named.with(&old, &[named.candidate, named.other]);
        assert_eq!(scene_of(&grown).unwrap(), scene, "{}", named.choice);
        let said = env(&grown).unwrap().warnings().to_string();
        let help = format!("{} = \"{}\"", named.choice, named.candidate);
        assert!(
            said.contains("S066") && said.contains(&help),
            "{}: {said}",
            named.choice
        );
    }
}
