//! Episodes of other simulators: read, mapped, judged and kept like runs of our own.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use actcheck::base::Source;
use actcheck::episodes::{Episode, Mapping, trace};
use serde_json::Value;
use tempfile::TempDir;

use crate::support::{actcheck, stderr, stdout};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data/episodes")
        .join(name)
}

fn file(name: &str) -> String {
    data(name).display().to_string()
}

/// A folder with a history `h` into which the made episodes were imported.
fn imported() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let (files, mapping) = (file(""), file("made.toml"));
    let output = actcheck(
        folder.path(),
        &["import", &files, "--mapping", &mapping, "--history", "h"],
    );
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    folder
}

/// The outcome and the words of each property of each run, by the name of its file.
fn outcomes(folder: &Path) -> BTreeMap<String, BTreeMap<String, (String, String)>> {
    let query = "SELECT ?file ?property ?outcome ?witness WHERE {
        ?run act:episodeFile ?file . ?step act:ofRun ?run . ?a earl:subject ?step ; earl:test ?property ; earl:result ?r .
        ?r act:outcome ?outcome OPTIONAL { ?r act:witness ?witness } }";
    let output = actcheck(
        folder,
        &["query", query, "--history", "h", "--format", "json"],
    );
    let answer: Value = serde_json::from_str(&stdout(&output)).unwrap();
    let mut found: BTreeMap<String, BTreeMap<String, (String, String)>> = BTreeMap::new();
    for row in answer.as_array().unwrap() {
        let text = |name: &str| row[name].as_str().unwrap_or_default().to_owned();
        let (file, property) = (text("file"), text("property"));
        let file = file.rsplit('/').next().unwrap().to_owned();
        let property = property.rsplit('#').next().unwrap().to_owned();
        found
            .entry(file)
            .or_default()
            .insert(property, (text("outcome"), text("witness")));
    }
    found
}

/// A good pick passes; a drop, a teleport and an idle robot fail for their own reasons.
#[test]
fn rules_judge_episodes_of_others() {
    let folder = imported();
    let found = outcomes(folder.path());
    let of = |file: &str, property: &str| {
        let (outcome, words) = &found[file][property];
        (outcome.as_str(), words.as_str())
    };
    let decisive = ["CloseObject", "MovedObject", "ObjectInGripper"];
    for property in decisive {
        assert_eq!(of("good-000001.mcap", property).0, "passed", "{property}");
    }
    for (file, property, words) in [
        (
            "drop-000002.mcap",
            "ObjectInGripper",
            "cube still rests on table; the fingers do not both touch cube",
        ),
        (
            "teleport-000003.mcap",
            "ObjectInGripper",
            "the fingers do not both touch cube",
        ),
        (
            "idle-000004.mcap",
            "MovedObject",
            "cube moved 0 cm, but is only 0 cm off table, needs more than 2 cm",
        ),
    ] {
        let (outcome, found) = of(file, property);
        assert_eq!((outcome, found), ("failed", words), "{file}");
    }
}

/// A property that reads a fact that was not recorded is inapplicable and names it, in `why` too.
#[test]
fn a_missing_fact_makes_a_property_inapplicable() {
    let folder = tempfile::tempdir().unwrap();
    let (episode, mapping) = (file("good-000001.mcap"), file("made.toml"));
    let ontology = Path::new(env!("CARGO_MANIFEST_DIR")).join("ontology/extra.ttl");
    let ontology = ontology.display().to_string();
    let output = actcheck(
        folder.path(),
        &[
            "import",
            &episode,
            "--mapping",
            &mapping,
            "--ontology",
            &ontology,
            "--history",
            "h",
        ],
    );
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let found = outcomes(folder.path());
    let (outcome, words) = &found["good-000001.mcap"]["JointLimitsKept"];
    assert_eq!(outcome, "inapplicable");
    assert!(
        words.contains("`w:maxSpeedShare` was not recorded") || words.contains("were not recorded"),
        "{words}"
    );
    let run = first_run(folder.path());
    let output = actcheck(
        folder.path(),
        &[
            "why",
            &run,
            "JointLimitsKept",
            "--ontology",
            &ontology,
            "--history",
            "h",
        ],
    );
    let text = stdout(&output);
    assert!(
        text.contains("inapplicable") && text.contains("not recorded"),
        "{text}"
    );
}

fn first_run(folder: &Path) -> String {
    let output = actcheck(folder, &["list", "--history", "h", "--format", "csv"]);
    let text = stdout(&output);
    let line = text.lines().nth(1).unwrap();
    line.split(',').next().unwrap().to_owned()
}

/// Imported runs are listed, judged again, analysed and reported, but can't be simulated.
#[test]
fn imported_runs_work_everywhere_but_in_the_simulation() {
    let folder = imported();
    let run = first_run(folder.path());
    for arguments in [
        vec!["show", &run],
        vec!["why", &run],
        vec!["recheck"],
        vec!["analyse"],
        vec!["health"],
        vec!["list", "--rules"],
        vec![
            "report",
            "--html",
            "r.html",
            "--junit",
            "r.xml",
            "--markdown",
        ],
        vec!["export", "tables", "tables"],
    ] {
        let output = actcheck(
            folder.path(),
            &[&arguments[..], &["--history", "h"]].concat(),
        );
        assert!(
            matches!(output.status.code(), Some(0 | 1)),
            "{arguments:?}: {}",
            stderr(&output)
        );
    }
    let junit = fs::read_to_string(folder.path().join("r.xml")).unwrap();
    assert!(junit.contains(&run), "{junit}");
    for command in ["replay", "shrink"] {
        let output = actcheck(folder.path(), &[command, &run, "--history", "h"]);
        assert_eq!(output.status.code(), Some(2), "{command}");
        assert!(stderr(&output).contains("E020"), "{}", stderr(&output));
    }
}

/// Rates never mix engines unless the campaigns are named.
#[test]
fn engines_are_not_mixed() {
    let folder = imported();
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/pick.toml");
    let config = config.display().to_string();
    let run = actcheck(
        folder.path(),
        &["run", &config, "--runs", "1", "--history", "h"],
    );
    assert!(matches!(run.status.code(), Some(0 | 1)), "{}", stderr(&run));
    for arguments in [
        vec!["analyse"],
        vec!["list", "--rules"],
        vec!["report", "--junit", "r.xml"],
    ] {
        let output = actcheck(
            folder.path(),
            &[&arguments[..], &["--history", "h"]].concat(),
        );
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(stderr(&output).contains("E019"), "{}", stderr(&output));
    }
    let campaign = first_run(folder.path());
    let campaign = campaign.split('-').next().unwrap();
    let output = actcheck(
        folder.path(),
        &["analyse", "--campaign", campaign, "--history", "h"],
    );
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
}

/// A draft of a mapping finds the robot, the hand, the fingers, the object and the surface.
#[test]
fn a_drafted_mapping_judges_the_episode() {
    let folder = tempfile::tempdir().unwrap();
    let episode = file("good-000001.mcap");
    let output = actcheck(folder.path(), &["import", "--propose", &episode]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    fs::write(folder.path().join("mapping.toml"), stdout(&output)).unwrap();
    let output = actcheck(
        folder.path(),
        &[
            "import",
            &episode,
            "--mapping",
            "mapping.toml",
            "--history",
            "h",
        ],
    );
    assert_eq!(
        output.status.code(),
        Some(0),
        "{} {}",
        stderr(&output),
        stdout(&output)
    );
}

/// The states of a file become the same trace each time.
#[test]
fn an_episode_has_the_same_trace_each_time() {
    let text = fs::read_to_string(data("made.toml")).unwrap();
    let mapping = Mapping::parse(&Source::new("made.toml", text)).unwrap();
    let made = || {
        let (episode, digest) = Episode::read(&data("good-000001.mcap")).unwrap();
        let cast = mapping.cast(&episode).unwrap();
        (
            trace(&episode, &cast, &mapping.actions_of(&episode).unwrap()),
            digest,
        )
    };
    let (one, other) = (made(), made());
    assert!(one == other);
    let (trace, _) = one;
    assert_eq!(trace.actions.len(), 1);
    let bodies: Vec<&str> = trace.snapshots[0]
        .bodies
        .iter()
        .map(|body| body.id.as_str())
        .collect();
    assert_eq!(bodies, ["cube", "table"]);
    assert!(
        trace.snapshots[1]
            .robot
            .left_touches
            .contains(&"cube".to_owned())
    );
    assert_eq!(trace.snapshots[0].bodies[0].rests_on, ["table"]);
    assert!(trace.lacks.contains(&"restitution".to_owned()));
}

/// Each action begins in the state in which the one before it ended, also if the mapping leaves a gap
/// between them or lets them overlap.
#[test]
fn actions_have_no_gaps() {
    let text = fs::read_to_string(data("made.toml")).unwrap();
    let (episode, _) = Episode::read(&data("good-000001.mcap")).unwrap();
    let [first, last] =
        [episode.states.first(), episode.states.last()].map(|s| s.unwrap().time_secs);
    for second_begins in [0.2, 0.6, 0.8] {
        let actions = format!(
            "\n[[actions]]\naction = \"Pick\"\nfrom = \"start\"\nto = 0.6\npickObject = \"cube\"\n\
             \n[[actions]]\naction = \"Pick\"\nfrom = {second_begins:?}\nto = \"end\"\npickObject = \"cube\"\n"
        );
        let mapping = Mapping::parse(&Source::new("made.toml", text.clone() + &actions)).unwrap();
        let cast = mapping.cast(&episode).unwrap();
        let trace = trace(&episode, &cast, &mapping.actions_of(&episode).unwrap());
        assert_eq!(trace.snapshots.len(), 3, "{second_begins}");
        let secs: Vec<f64> = trace
            .actions
            .iter()
            .map(|action| action.duration_secs)
            .collect();
        assert!((secs[0] - 0.6).abs() < 0.051, "{secs:?}");
        assert!(
            (secs.iter().sum::<f64>() - (last - first)).abs() < 1e-9,
            "{secs:?}"
        );
    }
}

/// Every fault of a mapping and of a file is reported with its code, and nothing is stored.
#[test]
fn faults_are_reported_and_store_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let written = |name: &str, text: &[u8]| fs::write(folder.path().join(name), text).unwrap();
    let good = fs::read(data("good-000001.mcap")).unwrap();
    written("cut.mcap", &good[..good.len() / 2]);
    let mut flipped = good.clone();
    let at = good.len() / 2;
    flipped[at] ^= 0x55;
    written("flipped.mcap", &flipped);
    written("empty.mcap", b"");
    written("text.mcap", b"not an episode");
    written("two.mcap", &[&good[..], &good].concat());
    let large = |name: &str, text: &[u8]| {
        written(name, text);
        let file = fs::File::options()
            .write(true)
            .open(folder.path().join(name));
        file.unwrap().set_len(2 << 30).unwrap();
    };
    large("large.mcap", &good);
    let begin = b"\x89MCAP0\r\n\x01\x14\0\0\0\0\0\0\0\x08\0\0\0actcheck";
    large("zeros.mcap", begin);
    let long = b"\x89MCAP0\r\n\x01\0\0\0\x40\0\0\0\0\x08\0\0\0actcheck";
    large("record.mcap", long);
    let mapping = fs::read_to_string(data("made.toml")).unwrap();
    written(
        "misspelt.toml",
        mapping
            .replace("body = \"cube\"", "body = \"cubee\"")
            .as_bytes(),
    );
    written(
        "axis.toml",
        format!("{mapping}up = \"w\"\nbdy = 3\n").as_bytes(),
    );
    written(
        "action.toml",
        format!("{mapping}\n[[actions]]\naction = \"Pik\"\nfrom = \"begin\"\n").as_bytes(),
    );
    written(
        "twice.toml",
        format!("{mapping}\n[objects.other]\nbody = \"cub*\"\n").as_bytes(),
    );
    written(
        "world.toml",
        format!("{mapping}\n[objects.ground]\nbody = \"world\"\n").as_bytes(),
    );
    written(
        "unknown.toml",
        format!("{mapping}\n[[actions]]\naction = \"Pik\"\npickObject = \"cub\"\n").as_bytes(),
    );
    written(
        "place.toml",
        format!("{mapping}\n[[actions]]\naction = \"MoveTo\"\nobjectLocation = \"kitchen\"\n")
            .as_bytes(),
    );
    let (good, mapping) = (file("good-000001.mcap"), file("made.toml"));
    for (episode, mapping, codes) in [
        ("cut.mcap", mapping.as_str(), vec!["E002"]),
        ("flipped.mcap", &mapping, vec!["E002"]),
        ("empty.mcap", &mapping, vec!["E0"]),
        ("text.mcap", &mapping, vec!["E0"]),
        ("two.mcap", &mapping, vec!["E002", "goes on after its end"]),
        (
            "large.mcap",
            &mapping,
            vec!["E002", "goes on after its end"],
        ),
        ("zeros.mcap", &mapping, vec!["E002", "has no kind"]),
        ("record.mcap", &mapping, vec!["E002", "exceeds limit"]),
        ("missing.mcap", &mapping, vec!["E001"]),
        (&good, "missing.toml", vec!["E005"]),
        (&good, "misspelt.toml", vec!["E010", "did you mean `cube`?"]),
        (&good, "axis.toml", vec!["E012", "C003"]),
        (&good, "action.toml", vec!["E015"]),
        (
            &good,
            "twice.toml",
            vec!["E022", "it belongs to the object `cube`", "twice.toml:"],
        ),
        (&good, "world.toml", vec!["E022", "it belongs to the floor"]),
        (
            &good,
            "unknown.toml",
            vec!["E017", "did you mean `Pick`?", "E021", "`cube`"],
        ),
        (&good, "place.toml", vec!["E021", "`kitchen`", "on no map"]),
    ] {
        let output = actcheck(
            folder.path(),
            &["import", episode, "--mapping", mapping, "--history", "h"],
        );
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{episode} {mapping}: {text}");
        for code in codes {
            assert!(
                text.contains(code),
                "{episode} {mapping}: no `{code}` in {text}"
            );
        }
        assert!(!folder.path().join("h").exists(), "{episode} {mapping}");
    }
}

/// No recording has percepts: whether a plane was perceived is not known, and so not failed.
#[test]
fn a_plane_that_no_recording_can_have_is_not_failed() {
    let folder = tempfile::tempdir().unwrap();
    let mapping = fs::read_to_string(data("made.toml")).unwrap();
    let mapping = format!(
        "{mapping}\n[[actions]]\naction = \"PerceivePlane\"\nfrom = \"start\"\nto = \"end\"\nobjectSurface = \"table\"\n"
    );
    fs::write(folder.path().join("plane.toml"), mapping).unwrap();
    let episode = file("good-000001.mcap");
    let output = actcheck(
        folder.path(),
        &[
            "import",
            &episode,
            "--mapping",
            "plane.toml",
            "--history",
            "h",
        ],
    );
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let (outcome, words) = &outcomes(folder.path())["good-000001.mcap"]["PlaneFound"];
    assert_eq!(outcome, "inapplicable");
    assert!(words.contains("were not recorded"), "{words}");
}

/// An import of episodes of several engines makes a campaign for each.
#[test]
fn each_engine_has_its_own_campaign() {
    let folder = tempfile::tempdir().unwrap();
    let good = fs::read(data("good-000001.mcap")).unwrap();
    let replaced = |bytes: &[u8], from: &[u8], to: &[u8]| {
        let at = bytes
            .windows(from.len())
            .position(|window| window == from)
            .unwrap();
        [&bytes[..at], to, &bytes[at + from.len()..]].concat()
    };
    let other = replaced(
        &good,
        b"\x06\0\0\0engine\0\0\0\0\x0e\0\0\0engine_version\0\0\0\0",
        b"\x06\0\0\0engine\x04\0\0\0Ours\x06\0\0\0note.a\x04\0\0\x001234",
    );
    // A checksum of 0 is not checked.
    let end = b"\x0f\x04\0\0\0\0\0\0\0";
    let at = other
        .windows(end.len())
        .rposition(|window| window == end)
        .unwrap()
        + end.len();
    let other = [&other[..at], &[0; 4], &other[at + 4..]].concat();
    for (name, bytes) in [("1.mcap", &good), ("2.mcap", &other), ("3.mcap", &good)] {
        fs::write(folder.path().join(name), bytes).unwrap();
    }
    let files = ["1.mcap", "2.mcap", "3.mcap"];
    let mapping = file("made.toml");
    let mut arguments = vec!["import", "--mapping", &mapping, "--history", "h"];
    arguments.extend(files);
    let output = actcheck(folder.path(), &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = stdout(&output);
    assert!(text.contains("2 episodes of an unknown engine"), "{text}");
    assert!(text.contains("1 episode of Ours"), "{text}");
    let query = "SELECT ?engine (COUNT(?run) AS ?runs) WHERE {
        ?run act:campaign ?campaign . ?campaign act:importedFrom ?engine } GROUP BY ?engine ORDER BY ?engine";
    let output = actcheck(
        folder.path(),
        &["query", query, "--history", "h", "--format", "csv"],
    );
    let rows: Vec<String> = stdout(&output).lines().map(str::to_owned).collect();
    assert_eq!(rows[1..], ["Ours,1", "an unknown engine,2"]);
}

/// Imports by one mapping have the same configuration and seed. Those of the same episodes are one
/// campaign, and those of others are not.
#[test]
fn imports_are_merged_by_their_episodes() {
    let folder = tempfile::tempdir().unwrap();
    let mapping = file("made.toml");
    let import = |episode: &str, history: &str| {
        let episode = file(episode);
        let arguments = [
            "import",
            &episode,
            "--mapping",
            &mapping,
            "--history",
            history,
        ];
        let output = actcheck(folder.path(), &arguments);
        assert!(
            output.status.code().is_some_and(|code| code < 2),
            "{}",
            stderr(&output)
        );
    };
    import("good-000001.mcap", "good");
    import("good-000001.mcap", "again");
    import("drop-000002.mcap", "drop");
    let merge = |arguments: &[&str]| {
        let arguments: Vec<&str> = [&["merge"], arguments].concat();
        let output = actcheck(folder.path(), &arguments);
        (output.status.code(), stderr(&output))
    };
    assert_eq!(merge(&["good", "again", "--into", "same"]).0, Some(0));
    let (code, text) = merge(&["good", "drop", "--into", "both"]);
    assert_eq!(code, Some(2), "{text}");
    assert!(text.contains("H022") && text.contains("--rename"), "{text}");
    assert!(!folder.path().join("both").exists());
    let all = ["drop", "again", "good", "--into", "both", "--rename"];
    let (code, text) = merge(&all);
    assert_eq!(code, Some(0), "{text}");
    let listed = |history: &str| -> Vec<(String, bool)> {
        let output = actcheck(
            folder.path(),
            &["list", "--history", history, "--format", "json"],
        );
        let runs: Value = serde_json::from_str(&stdout(&output)).unwrap();
        let run = |run: &Value| {
            let is_dropped = run["score"].as_f64().unwrap() < 1.0;
            (run["run"].as_str().unwrap().to_owned(), is_dropped)
        };
        runs.as_array().unwrap().iter().map(run).collect()
    };
    assert_eq!(listed("same").len(), 1);
    let both = listed("both");
    assert_eq!(both.len(), 2, "{both:?}");
    assert_ne!(both[0].0, both[1].0);
    assert_eq!(
        both.iter().filter(|(_, is_dropped)| *is_dropped).count(),
        1,
        "{both:?}"
    );
    let checked = actcheck(
        folder.path(),
        &["health", "--integrity", "--history", "both"],
    );
    assert_eq!(checked.status.code(), Some(0), "{}", stderr(&checked));
    // A merge into one of them adds the other.
    let (code, text) = merge(&["drop", "--into", "good", "--rename"]);
    assert_eq!(code, Some(0), "{text}");
    assert_eq!(listed("good").len(), 2);
}

/// Every cut and many flips of a file are refused or read, and never a panic.
#[test]
fn damaged_files_are_never_a_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged.mcap");
    let good = fs::read(data("idle-000004.mcap")).unwrap();
    for length in (0..good.len()).step_by(97) {
        fs::write(&path, &good[..length]).unwrap();
        assert!(Episode::read(&path).is_err(), "{length} bytes");
    }
    let (mut refused, mut tried) = (0, 0);
    for at in (0..good.len()).step_by(61) {
        let mut flipped = good.clone();
        flipped[at] ^= 1 << (at % 8);
        fs::write(&path, &flipped).unwrap();
        tried += 1;
        refused += u32::from(Episode::read(&path).is_err());
    }
    // Everything has checksums but the magic bytes and the footer.
    assert!(refused * 100 > tried * 95, "{refused} of {tried}");
}

/// The shipped mappings have no faults, and belong to the shipped ontology.
#[test]
fn shipped_mappings_are_valid() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/episodes");
    let mut count = 0;
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|ending| ending == "toml") {
            let text = fs::read_to_string(&path).unwrap();
            let mapping = Mapping::parse(&Source::new(path.display().to_string(), text));
            assert!(mapping.is_ok(), "{}: {mapping:?}", path.display());
            count += 1;
        }
    }
    assert!(count >= 4, "{count}");
}
