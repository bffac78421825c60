//! The schema of configurations and the program accept and refuse the same texts.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

use actcheck::base::{Diagnostics, Files, Keep, Severity};
use actcheck::config::{
    self, Campaign, CampaignTemplate, Launcher, Overrides, SCHEMA, campaign_template,
};
use actcheck::search::Strategy;
use serde_json::Value as Json;
use toml::Value;

use crate::support::{actcheck, copy_made_history, foreign, root, stderr, stdout};

/// A configuration with every key.
const EVERY_KEY: &str = r#"
tests = [["MoveTo", "PerceivePlane", "Pick", "Place"]]
test_count = 2
repeat = 2
seed = 3
test_launcher = "python3 skill.py"
ontology = "ROOT/ontology/actions.ttl"
model_dir = "ROOT/models"
nav_obstacle_list = ["box", "bottle"]
nav_obstacle_count = 2
nav = { may_block = true }
skill = { args = ["--slow"], dir = ".", privileged = true, startup_s = 20.0, timeout_s = 5.0, memory_mb = 512, cpu_s = 60, max_broken = 3, env = { SPEED = "0.5" } }
search = { strategy = "halton" }
scene = { require = "ROOT/rules/scene/reachable.rls" }
relations = { mirrored = "ROOT/rules/relations/same_verdicts.rls", more_friction = "ROOT/rules/relations/no_worse.rls", less_mass = "ROOT/rules/relations/no_worse.rls", without_far_object = "ROOT/rules/relations/same_verdicts.rls", renamed = "ROOT/rules/relations/same_verdicts.rls" }
history = { dir = "h" }
categories = { glass = "act:Glass" }
world = { worlds = ["lab", "apartment"] }
objectLocation = { location_list = ["coffee_table_front"] }
objectSurface = { object_surfaces = ["coffee_table", "left_bench"] }
placeSurface = { place_object_surfaces = ["side_table", "right_bench"], count = [1, 2] }
pickObject = { model_list = ["glass"], lying = 0.1 }
surfaceObjects = { model_list = ["mug", "can"], count = [0, 3], lying = 0.2 }
budget = { action_secs = 30.0, run_secs = 60.0, time = "10m", until_width = 0.1, max_failures = 3 }
robot = { profile = "mobile_manipulator", package_dirs = ["."], start_x_m = [-1.0, 1.0], start_y_m = [-1.0, 1.0], start_heading_rad = [0.0, 1.0] }

[physics]
mass_scale = [0.9, 1.1]
friction_scale = [0.9, 1.1]
size_scale = [0.9, 1.1]
restitution = [0.0, 0.1]
steps_per_second = 240
iterations = 4

[sensing]
position_noise_m = 0.01
height_noise_m = 0.01
yaw_noise_rad = 0.01
size_noise_m = 0.01
localisation_noise_m = 0.01
heading_noise_rad = 0.01
gripper_noise_m = 0.01
odometry_drift = 0.01
heading_drift = 0.01
landmark_every_m = 0.7
landmark_noise_m = 0.01
landmark_noise_rad = 0.01

[camera]
width = 160
height = 120
field_of_view_rad = 1.0
min_range_m = 0.3
max_range_m = 4.0
range_noise_m = 0.01
dropout = 0.01
grazing_rad = 0.1
image_noise = 0.01
light_azimuth_rad = [0.0, 6.2]
light_elevation_rad = [0.6, 1.5]
light_brightness = [0.4, 0.9]
ambient = [0.2, 0.5]
table_textures = ["plain", "checker", "wood"]
table_colours = ['#b0865c']
random_object_colours = true

[case]
from = "abcd-1"
expect = ["MovedObject"]
trace = "00"
choices = { "target.yaw" = 0.5, "target.model" = "glass", "other.count" = 2, other = { 1 = { left_out = true, x = [0.1, 0.2] } } }
"#;

/// The smallest configuration, and the tables whose keys have defaults.
const FEW_KEYS: &str = r#"
tests = [["Pick"]]
test_count = 1
test_launcher = "python3 skill.py"
skill = {}
placeSurface = { place_object_surfaces = ["table"] }
pickObject = { model_list = ["glass"] }
surfaceObjects = { model_list = ["mug"] }
robot = {}
nav = {}
physics = {}
sensing = {}
camera = {}
budget = {}
search = {}
history = {}
"#;

fn schema() -> Json {
    serde_json::from_str(SCHEMA).unwrap()
}

fn parsed(text: &str) -> toml::Table {
    text.replace("ROOT", root().to_str().unwrap())
        .parse()
        .unwrap()
}

fn load(folder: &Path, table: &toml::Table) -> Result<Campaign, Diagnostics> {
    let path = folder.join("c.toml");
    std::fs::write(&path, table.to_string()).unwrap();
    config::load(&path, &Overrides::default())
}

/// The program's errors, without warnings: code and message.
fn faults(folder: &Path, table: &toml::Table) -> Vec<(&'static str, String)> {
    let found = load(folder, table).err().unwrap_or_default();
    let errors = found
        .iter()
        .filter(|fault| fault.severity == Severity::Error);
    errors
        .map(|fault| (fault.code, fault.message.clone()))
        .collect()
}

/// A part of the schema with its reference resolved.
fn resolved(part: &Json) -> Json {
    let mut part = part.clone();
    let Some(reference) = part.get("$ref").and_then(Json::as_str).map(str::to_owned) else {
        return part;
    };
    let target = schema()
        .pointer(reference.trim_start_matches('#'))
        .expect("the reference can be resolved")
        .clone();
    let own = part.as_object_mut().unwrap();
    for (key, value) in target.as_object().unwrap() {
        own.entry(key.clone()).or_insert(value.clone());
    }
    part
}

/// Tables with named keys, by their path: the root's is empty.
fn tables() -> BTreeMap<Vec<String>, Json> {
    fn walk(path: Vec<String>, part: &Json, tables: &mut BTreeMap<Vec<String>, Json>) {
        let part = resolved(part);
        let Some(properties) = part.get("properties").and_then(Json::as_object) else {
            return;
        };
        for (key, inner) in properties {
            walk(path.iter().chain([key]).cloned().collect(), inner, tables);
        }
        tables.insert(path, part);
    }
    let mut found = BTreeMap::new();
    walk(Vec::new(), &schema(), &mut found);
    found
}

/// Keys that hold values, by their path, with their schemas.
fn leaves() -> Vec<(Vec<String>, Json)> {
    let tables = tables();
    let each = tables.iter().flat_map(|(path, table)| {
        let properties = table["properties"].as_object().unwrap();
        properties.iter().map(|(key, part)| {
            (
                path.iter().chain([key]).cloned().collect::<Vec<_>>(),
                resolved(part),
            )
        })
    });
    each.filter(|(path, _)| !tables.contains_key(path))
        .collect()
}

/// The table at a path.
fn table_at<'a>(root: &'a mut toml::Table, path: &[String]) -> &'a mut toml::Table {
    path.iter().fold(root, |table, key| {
        table[key].as_table_mut().expect("the table exists")
    })
}

fn with(text: &str, path: &[String], value: Value) -> toml::Table {
    let mut table = parsed(text);
    let (key, tables) = path.split_last().unwrap();
    table_at(&mut table, tables).insert(key.clone(), value);
    table
}

/// A value of a type that no key accepts.
fn moment() -> Value {
    Value::Datetime("1979-05-27T07:32:00Z".parse().unwrap())
}

/// Configurations refused by the schema, by file name with the reason. Returns `None` if Python is
/// not available.
fn refused_by_schema(folder: &Path) -> Option<BTreeMap<String, String>> {
    let output = Command::new(foreign::python()?)
        .arg(root().join("tests/foreign/check_campaigns.py"))
        .arg(root().join("configs/campaign.schema.json"))
        .arg(folder)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let lines = stdout(&output);
    let parts = lines.lines().filter_map(|line| line.split_once('\t'));
    Some(
        parts
            .map(|(name, reason)| (name.to_owned(), reason.to_owned()))
            .collect(),
    )
}

#[test]
fn the_program_prints_the_schema() {
    let output = actcheck(root(), &["new", "schema"]);
    assert_eq!(
        stdout(&output),
        std::fs::read_to_string(root().join("configs/campaign.schema.json")).unwrap()
    );
}

#[test]
fn every_schema_key_is_accepted_by_the_program_and_described() {
    let folder = tempfile::tempdir().unwrap();
    let found = load(folder.path(), &parsed(EVERY_KEY));
    assert!(found.is_ok(), "{}", found.unwrap_err());
    for (path, part) in leaves()
        .into_iter()
        .chain(tables())
        .filter(|(path, _)| !path.is_empty())
    {
        let name = path.join(".");
        assert!(
            part["description"]
                .as_str()
                .is_some_and(|text| text.ends_with('.')),
            "{name} has no description"
        );
        let unit = [
            ("_m", "metres"),
            ("_rad", "radians"),
            ("_secs", "seconds"),
            ("_s", "seconds"),
            ("_mb", "megabytes"),
        ];
        if let Some((_, unit)) = unit.into_iter().find(|(ending, _)| name.ends_with(ending)) {
            assert!(
                part["description"]
                    .as_str()
                    .unwrap()
                    .contains(&format!("Unit: {unit}")),
                "{name} has no unit"
            );
        }
        let said = faults(folder.path(), &with(EVERY_KEY, &path, moment()));
        let is_named = |message: &str| message.contains(&format!("`{name}`"));
        assert!(
            said.iter()
                .any(|(code, message)| *code == "C004" && is_named(message)),
            "{name}: {said:?}"
        );
        assert!(
            !said
                .iter()
                .any(|(code, message)| *code == "C003" && is_named(message)),
            "{name}: {said:?}"
        );
    }
}

/// The program's message about an unknown key lists the known keys.
#[test]
fn every_key_of_the_program_is_in_the_schema() {
    let folder = tempfile::tempdir().unwrap();
    for (path, part) in tables() {
        let unknown: Vec<String> = path
            .iter()
            .cloned()
            .chain(["qqqqqqqqqqqq".to_owned()])
            .collect();
        let said = load(
            folder.path(),
            &with(EVERY_KEY, &unknown, Value::Boolean(true)),
        )
        .unwrap_err();
        let fault = said
            .iter()
            .find(|fault| fault.code == "C003")
            .unwrap_or_else(|| panic!("{path:?}: {said}"));
        let known = fault
            .help
            .as_deref()
            .unwrap()
            .strip_prefix("known names: ")
            .expect("the key resembles no known key");
        let known: BTreeSet<&str> = known.split(", ").collect();
        let properties = part["properties"].as_object().unwrap();
        assert_eq!(
            known,
            properties.keys().map(String::as_str).collect(),
            "[{}]",
            path.join(".")
        );
    }
}

#[test]
fn words_equal_the_programs() {
    let names = schema()["properties"]["search"]["properties"]["strategy"]["enum"].clone();
    assert_eq!(
        names,
        Json::from(Strategy::ALL.map(Strategy::name).to_vec())
    );
    let ways = schema()["properties"]["history"]["properties"]["keep"]["enum"].clone();
    assert_eq!(ways, Json::from(Keep::ALL.map(Keep::word).to_vec()));
}

/// A configuration with every default of the schema written out equals one without them.
#[test]
fn schema_defaults_equal_the_programs() {
    let folder = tempfile::tempdir().unwrap();
    let (few, mut all) = (parsed(FEW_KEYS), parsed(FEW_KEYS));
    let mut written = 0;
    for (path, part) in leaves() {
        let Some(default) = part.get("default") else {
            continue;
        };
        let (key, tables) = path.split_last().unwrap();
        let value = Value::try_from(default).unwrap();
        written += usize::from(
            table_at(&mut all, tables)
                .insert(key.clone(), value)
                .is_none(),
        );
    }
    assert!(written > 40, "{written}");
    let launcher = all.insert("test_launcher".to_owned(), few["test_launcher"].clone());
    assert_eq!(launcher, Some(Value::from("reference")));
    assert_eq!(
        load(
            folder.path(),
            &parsed("tests = [[\"Pick\"]]\ntest_count = 1")
        )
        .unwrap()
        .launcher,
        Launcher::Reference
    );
    let [few, all] = [few, all]
        .map(|table| load(folder.path(), &table).unwrap_or_else(|found| panic!("{found}")));
    assert_eq!(few.physics, all.physics);
    assert_eq!(few.sensing, all.sensing);
    assert_eq!((few.budget, few.limits), (all.budget, all.limits));
    assert_eq!((few.other_counts, few.lying), (all.other_counts, all.lying));
    assert_eq!(
        (few.seed, few.repeat, few.search),
        (all.seed, all.repeat, all.search)
    );
    assert_eq!(
        (few.nav_obstacles, few.nav_obstacle_count),
        (all.nav_obstacles, all.nav_obstacle_count)
    );
    assert_eq!(
        (few.launcher, few.robot, few.history),
        (all.launcher, all.robot, all.history)
    );
    assert_eq!(
        (few.keeping, few.sync_each_run),
        (all.keeping, all.sync_each_run)
    );
}

#[test]
fn shipped_new_and_exported_configurations_match_the_schema() {
    let folder = tempfile::tempdir().unwrap();
    let here = |name: &str| folder.path().join(name);
    for config in Files::Disk.list(&root().join("configs")) {
        std::fs::copy(&config, here(config.file_name().unwrap().to_str().unwrap())).unwrap();
    }
    for (name, is_used, skill) in [
        ("new", false, None),
        ("new_with_all", true, Some("skills/pick.py")),
    ] {
        let new = CampaignTemplate {
            name,
            ontology: is_used,
            models: is_used,
            skill,
        };
        std::fs::write(here(&format!("{name}.toml")), campaign_template(&new)).unwrap();
    }
    let history = here("h").display().to_string();
    copy_made_history(Path::new(&history));
    let list = stdout(&actcheck(
        root(),
        &["list", "--history", &history, "--format", "csv"],
    ));
    let run = list
        .lines()
        .nth(1)
        .and_then(|line| line.split(',').next())
        .expect("the campaign has a run");
    let case = here("case.toml").display().to_string();
    let export = actcheck(
        root(),
        &[
            "export",
            "run",
            run,
            "--history",
            &history,
            "--config",
            "configs/quick.toml",
            "-o",
            &case,
        ],
    );
    assert!(export.status.success(), "{}", stderr(&export));
    assert!(Files::Disk.list(folder.path()).len() >= 11);
    if let Some(refused) = refused_by_schema(folder.path()) {
        assert!(refused.is_empty(), "{refused:#?}");
    }
}

/// Values at the limits of a key's range, and beyond.
fn trials(part: &Json) -> Vec<Value> {
    if let Some(forms) = part.get("anyOf").and_then(Json::as_array) {
        return forms
            .iter()
            .flat_map(|form| trials(&resolved(form)))
            .collect();
    }
    match part["type"].as_str() {
        Some("integer") => integers(part).into_iter().map(Value::from).collect(),
        Some("number") => numbers(part).into_iter().map(Value::from).collect(),
        Some("string") => ["", "  ", "no-such-word"].map(Value::from).to_vec(),
        Some("boolean") => vec![Value::from(true), Value::from(1), Value::from("true")],
        Some("array") => lists(part),
        Some("object") => vec![
            Value::from(1),
            Value::Table([("a".to_owned(), moment())].into_iter().collect()),
        ],
        other => panic!("{other:?}"),
    }
}

fn integers(part: &Json) -> Vec<i64> {
    let bounds = ["minimum", "maximum"]
        .into_iter()
        .filter_map(|key| part.get(key)?.as_i64());
    let near = bounds
        .flat_map(|bound| [bound.checked_sub(1), Some(bound), bound.checked_add(1)])
        .flatten();
    near.chain([i64::MIN, -1, 0, 61, 1 << 40, i64::MAX])
        .collect()
}

fn numbers(part: &Json) -> Vec<f64> {
    let keys = ["minimum", "exclusiveMinimum", "maximum", "exclusiveMaximum"];
    let bounds = keys.into_iter().filter_map(|key| part.get(key)?.as_f64());
    bounds
        .flat_map(|bound| [bound - 1e-9, bound, bound + 1e-9])
        .chain([-1e15, 0.0, 1e15])
        .collect()
}

/// Lists of equal elements, of several lengths.
fn lists(part: &Json) -> Vec<Value> {
    let item = resolved(&part["items"]);
    let mut trials = trials(&item);
    trials.push(moment());
    let length = part.get("minItems").and_then(Json::as_u64).unwrap_or(1) as usize;
    let mut lists: Vec<Value> = trials
        .iter()
        .map(|element| Value::Array(vec![element.clone(); length]))
        .collect();
    let fits = match item["type"].as_str() {
        Some("string") => return [lists, vec![Value::Array(Vec::new())]].concat(),
        Some("array") => return [lists, vec![Value::Array(Vec::new())]].concat(),
        Some("integer") => Value::from(item["minimum"].as_i64().unwrap_or(1)),
        _ => Value::from(1.0),
    };
    lists.extend([0, 1, 3].map(|length| Value::Array(vec![fits.clone(); length])));
    lists
}

/// Changed configurations with a description of each change: every key with values at its limits
/// and of wrong types, unknown and missing keys.
fn changed() -> Vec<(String, toml::Table)> {
    let mut changed = Vec::new();
    for (path, part) in leaves() {
        for value in trials(&part).into_iter().chain([moment()]) {
            changed.push((
                format!("{} = {value}", path.join(".")),
                with(EVERY_KEY, &path, value),
            ));
        }
    }
    for (path, part) in tables() {
        let unknown: Vec<String> = path.iter().cloned().chain(["unknown".to_owned()]).collect();
        for value in [Value::from(1), moment(), Value::Table(toml::Table::new())] {
            changed.push((
                format!("{} = {value}", unknown.join(".")),
                with(EVERY_KEY, &unknown, value),
            ));
        }
        let required = part
            .get("required")
            .and_then(Json::as_array)
            .cloned()
            .unwrap_or_default();
        let dependent = part.get("dependentRequired").and_then(Json::as_object);
        let dependent = dependent.map(|keys| {
            keys.keys()
                .map(|key| Json::from(key.as_str()))
                .collect::<Vec<_>>()
        });
        for key in required.into_iter().chain(dependent.unwrap_or_default()) {
            let mut table = parsed(EVERY_KEY);
            table_at(&mut table, &path).remove(key.as_str().unwrap());
            changed.push((format!("{}.{key} is missing", path.join(".")), table));
        }
    }
    for text in [
        "a = []",
        "a = [\"\"]",
        "a = [\"tea\"]",
        "a = [1]",
        "a = \"tea\"",
        "a = [\"tea\"], b = [\"milk\"]",
        "",
    ] {
        let table = format!("drink = {{ {text} }}")
            .parse::<toml::Table>()
            .unwrap();
        changed.push((
            format!("drink: {text}"),
            with(EVERY_KEY, &["drink".to_owned()], table["drink"].clone()),
        ));
    }
    changed
}

/// Faults that a schema can't express: relations between keys, existence of files and names, and
/// durations.
fn is_beyond_a_schema(code: &str, message: &str) -> bool {
    let names_and_files = [
        "C008", "C009", "C010", "C011", "C012", "C020", "C021", "C031", "C034", "C015",
    ];
    names_and_files.contains(&code)
        || message.contains("is not a duration")
        || message.contains("there is no obstacle to choose")
        || message.contains("there are no models to choose from")
}

#[test]
fn schema_and_program_refuse_the_same_changes() {
    let (folder, written) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let changed = changed();
    assert!(changed.len() > 500, "{}", changed.len());
    let mut refused = BTreeMap::new();
    for (number, (change, table)) in changed.iter().enumerate() {
        let said: Vec<(&str, String)> = faults(folder.path(), table)
            .into_iter()
            .filter(|(code, message)| !is_beyond_a_schema(code, message))
            .collect();
        let name = format!("{number:04}.toml");
        std::fs::write(written.path().join(&name), format!("# {change}\n{table}")).unwrap();
        refused.insert(name, said);
    }
    let Some(by_schema) = refused_by_schema(written.path()) else {
        return;
    };
    let differ = changed
        .iter()
        .zip(&refused)
        .filter_map(|((change, _), (name, said))| {
            let schema = by_schema.get(name);
            (schema.is_some() == said.is_empty())
                .then(|| format!("{change}\n  program: {said:?}\n  schema: {schema:?}"))
        });
    let differ: Vec<String> = differ.collect();
    assert!(
        differ.is_empty(),
        "{} of {}:\n{}",
        differ.len(),
        changed.len(),
        differ.join("\n")
    );
    assert!(
        by_schema.len() * 3 > changed.len() && by_schema.len() < changed.len(),
        "{} are refused",
        by_schema.len()
    );
}
