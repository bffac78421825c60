//! The history: stored data is returned unchanged, writes are atomic, and every fault of the folder
//! is reported clearly.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use actcheck::base::{Diagnostics, Judgement, Outcome, RunFacts, Source, Term, digest_of, names};
use actcheck::data::{
    ActionEnd, Camera, Choice, ChoiceKind, CupState, DecorRanges, Hand, LinkFrame, ObjectModel,
    Odometry, Physics, Pose, Quality, RobotCore, RobotProfile, RobotStart, Role, Scene,
    SceneObject, Sensing,
};
use actcheck::facts::extract;
use actcheck::history::RunScene;
use actcheck::history::{
    CampaignEnd, CampaignRecord, Cancel, History, QueryAnswer, RunFilter, RunRecord, RunStatus,
    SkillRecord,
};
use tempfile::TempDir;

use crate::facts::{BODIES, sample_trace};
use crate::support::copy;
use crate::support::foreign::left_out;

fn model(name: &str) -> Arc<ObjectModel> {
    Arc::new(ObjectModel {
        name: name.to_owned(),
        category: names::act("Glass"),
        mass_kg: 0.3,
        friction: 0.8,
        restitution: 0.1,
        size_m: [0.1; 3],
        parts: Vec::new(),
        origin_m: [0.0; 3],
        fixed: false,
        inertia: None,
        surface: None,
        moving: Vec::new(),
        digest: digest_of(name),
    })
}

fn robot() -> Arc<RobotProfile> {
    let none = LinkFrame {
        link: String::new(),
        offset_m: [0.0; 3],
        turned_rad: [0.0; 3],
    };
    let core = RobotCore {
        name: "mobile manipulator".to_owned(),
        urdf: Source::new("robot.urdf", "<robot/>"),
        tree: Arc::default(),
        base_joints: None,
        planar_base: false,
        mount_height_m: 0.0,
        mount_turned_rad: 0.0,
        on_surface: false,
        reach_m: None,
        head_joints: Vec::new(),
        other_joints: Vec::new(),
        parked: Vec::new(),
        no_collision_links: Vec::new(),
        meshes: BTreeMap::new(),
        surfaces: BTreeMap::new(),
        digest: String::new(),
    };
    Arc::new(RobotProfile {
        core,
        arm_joints: Vec::new(),
        hand: Hand {
            grasp: none.clone(),
            finger_joints: vec![String::new(), String::new()],
            finger_links: [String::new(), String::new()],
            max_opening_m: 0.135,
            finger_friction: 1.0,
            grip_force_n: 10.0,
            suction: None,
        },
        camera: none,
        home: Vec::new(),
        postures: Vec::new(),
    })
}

/// Objects in a row, 0.2 m apart; the target is the second.
fn scene() -> Scene {
    let object = |(place, id): (usize, &&str)| SceneObject {
        id: (*id).to_owned(),
        model: model(&id[..id.len() - 2]),
        role: [Role::Platform, Role::Target, Role::Other][place.min(2)],
        pose: Pose::upright([0.2 * place as f64, 0.0, 0.7], 0.5),
        mass_kg: 0.31,
        friction: 0.7,
        restitution: 0.05,
        attached: None,
    };
    Scene {
        map: actcheck::data::SceneMap::default(),
        world: "living room".to_owned(),
        objects: BODIES.iter().enumerate().map(object).collect(),
        robot: RobotStart {
            profile: robot(),
            base: [-0.6, 0.0, 0.1],
            root_height_m: 0.0,
            knows: Arc::new([]),
        },
        designators: sample_trace(0).actions[0].parameters.clone(),
        steps: Vec::new(),
        sensing: Sensing {
            position_noise_m: 0.005,
            height_noise_m: 0.002,
            yaw_noise_rad: 0.05,
            size_noise_m: 0.003,
            localisation_noise_m: 0.01,
            heading_noise_rad: 0.01,
            gripper_noise_m: 0.001,
            odometry: Odometry::IDEAL,
            camera: Camera::IDEAL,
            decor: DecorRanges::PLAIN,
        },
        physics: Physics {
            mass_scale: (1.0, 1.0),
            friction_scale: (1.0, 1.0),
            size_scale: (1.0, 1.0),
            restitution: (0.0, 0.0),
            steps_per_second: 240,
            iterations: 4,
            shortcuts: true,
        },
    }
}

const PROPERTIES: [&str; 5] = [
    "CloseObject",
    "MovedObject",
    "NoGraspCollisions",
    "ObjectGrasped",
    "ObjectInGripper",
];

fn judgement(property: &str, outcome: Outcome) -> Judgement {
    Judgement {
        property: names::act(property),
        outcome,
        margin: (outcome == Outcome::Failed).then_some(-0.04),
        witness: format!("{property}: glass_1 \"moved\" 0.4 cm"),
        rule_digest: digest_of(property),
        held_before: (outcome == Outcome::Passed).then_some(property == "CloseObject"),
        vacuous: (outcome == Outcome::Passed).then_some(property == "MovedObject"),
    }
}

/// A run; every third one has a failed property.
pub fn sample_run(campaign: &str, index: u64) -> RunRecord {
    let trace = sample_trace(index);
    let failed = index.is_multiple_of(3);
    let outcome = |property: &str| {
        if failed && property == "ObjectInGripper" {
            Outcome::Failed
        } else {
            Outcome::Passed
        }
    };
    let score = if failed { 0.8 } else { 1.0 };
    RunRecord {
        shrunk_from: None,
        id: format!("{campaign}-{}", index + 1),
        campaign: campaign.to_owned(),
        index,
        repetition: None,
        weight: None,
        test: "Pick".to_owned(),
        seed: u64::MAX,
        status: RunStatus::Completed,
        reason: None,
        program_output: index
            .is_multiple_of(3)
            .then(|| format!("line 1\nline {index}")),
        score,
        action_scores: vec![score],
        discards: (0..index % 2)
            .map(|_| "found no free place for `plate`".to_owned())
            .collect(),
        choices: vec![Choice {
            name: "target.yaw".into(),
            kind: ChoiceKind::Normal { sigma: 0.1 },
            value: 0.07,
        }],
        scene: RunScene::of(&scene()),
        episode: None,
        facts: extract(&trace),
        trace,
        actions: vec![names::act("Pick")],
        judgements: vec![
            PROPERTIES
                .iter()
                .map(|property| judgement(property, outcome(property)))
                .collect(),
        ],
        quality: Some(Quality {
            deepest_penetration_m: 3e-4,
            energy_gain_j: 2e-5,
        }),
        started: "2026-08-01T12:00:00Z".to_owned(),
        wall_secs: 1.25,
        elapsed_secs: 2.5,
    }
}

/// The folder of a history of the campaign `k`, which has not ended, as its owner left it when it
/// was killed. `commit` stores a run.
pub fn left_by_a_kill(runs: u64, commit: impl Fn(&History, &RunRecord)) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let (live, left) = (folder.path().join("live"), folder.path().join("left"));
    let history = History::open(&live).unwrap();
    history.begin_campaign(&sample_campaign("k", 0)).unwrap();
    (0..runs).for_each(|index| commit(&history, &sample_run("k", index)));
    copy(&live, &left);
    (folder, left)
}

/// The ids of all runs of a history.
pub fn run_ids(history: &History) -> Vec<String> {
    let runs = history.runs(&RunFilter::default()).unwrap().into_iter();
    runs.map(|run| run.run).collect()
}

/// A campaign that began in a given minute.
pub fn sample_campaign(id: &str, minute: u32) -> CampaignRecord {
    CampaignRecord {
        imported_from: None,
        id: id.to_owned(),
        name: "pick".to_owned(),
        config_text: "seed = 7\n".to_owned(),
        config_digest: digest_of("seed = 7\n"),
        config_path: "../pick.toml".to_owned(),
        ontology_digest: digest_of("ontology"),
        findings: Vec::new(),
        rules: PROPERTIES
            .iter()
            .map(|p| (names::act(p), format!("../rules/{p}.rls"), digest_of(p)))
            .collect(),
        models: vec![("glass".to_owned(), digest_of("glass"))],
        skill: Some(SkillRecord {
            command: "python3 pick.py".to_owned(),
            digest: digest_of("pick.py"),
            privileged: true,
        }),
        seed: 7,
        planned_runs: 6,
        repeat: 1,
        time_secs: Some(90.0),
        until_width: Some(0.05),
        max_failures: Some(3),
        shards: Vec::new(),
        strategy: "random".to_owned(),
        started: format!("2026-08-01T12:{minute:02}:00Z"),
        program_version: "0.1.0".to_owned(),
        program_digest: digest_of("program"),
        physics: 1,
    }
}

/// A history with campaigns `z2` and, later, `a1`, of a few runs each.
fn filled() -> (TempDir, History) {
    let folder = tempfile::tempdir().unwrap();
    let history = History::open(&folder.path().join("history")).unwrap();
    for (id, minute, runs) in [("z2", 1, 6), ("a1", 2, 2)] {
        history
            .begin_campaign(&sample_campaign(id, minute))
            .unwrap();
        for index in (0..runs).rev() {
            history.commit(&sample_run(id, index)).unwrap();
        }
    }
    (folder, history)
}

fn code(result: Result<History, Diagnostics>) -> String {
    let faults = result.err().expect("a fault");
    let fault = faults.iter().next().unwrap();
    assert!(fault.help.is_some(), "{faults}");
    faults.to_string()
}

fn table(history: &History, sparql: &str) -> Vec<Vec<Option<Term>>> {
    match history.query(sparql) {
        Ok(QueryAnswer::Table { rows, .. }) => rows,
        other => panic!("{other:?}"),
    }
}

fn facts_as_terms(facts: &RunFacts) -> Vec<BTreeSet<[Term; 3]>> {
    let term = |id: u32| facts.terms.term(id).clone();
    facts
        .snapshots
        .iter()
        .chain(&facts.during)
        .map(|list| list.iter().map(|t| t.map(term)).collect())
        .collect()
}

#[test]
fn a_stored_run_keeps_its_facts_trace_and_choices() {
    let (folder, history) = filled();
    let record = sample_run("z2", 3);
    drop(history);
    let history = History::open_existing(&folder.path().join("history")).unwrap();
    assert_eq!(history.traces().whole("z2-4").unwrap(), record.trace);
    assert_eq!(history.traces().choices("z2-4").unwrap(), record.choices);
    let facts = history.traces().facts("z2-4", false).unwrap();
    assert_eq!(
        (&facts.snapshots, &facts.during),
        (&record.facts.snapshots, &record.facts.during)
    );
    assert_eq!(facts.parameters, record.facts.parameters);
    assert_eq!(facts_as_terms(&facts), facts_as_terms(&record.facts));
}

#[test]
fn a_column_of_another_format_or_kind_is_refused() {
    let (folder, history) = filled();
    drop(history);
    let dir = folder.path().join("history");
    let campaign = dir.join("campaigns/z2");
    for extension in ["runs", "details", "states", "motion"] {
        let file = campaign.join("0001").with_extension(extension);
        let own = std::fs::read(&file).unwrap();
        assert_eq!(&own[..6], b"actseg", "{extension}");
        let mut newer = own.clone();
        newer[6] += 1;
        let mut other = own.clone();
        other[7] = b'x';
        for bytes in [newer, other] {
            std::fs::write(&file, bytes).unwrap();
            let (found, _) = History::examine(&dir).unwrap();
            let named: BTreeSet<&Path> = found.damage.iter().map(|damage| &*damage.file).collect();
            let name = file.strip_prefix(&dir).unwrap();
            assert_eq!(named, BTreeSet::from([name]), "{found:?}");
            if extension == "runs" {
                let listed = History::open_to_read(&dir)
                    .and_then(|history| history.runs(&RunFilter::default()));
                let fault = listed.unwrap_err().to_string();
                assert!(
                    fault.starts_with("H007") && fault.contains("campaigns/z2/0001.runs"),
                    "{fault}"
                );
            }
        }
        std::fs::write(&file, own).unwrap();
    }
    assert!(History::examine(&dir).unwrap().0.damage.is_empty());
}

/// Regression: a trace did not keep which objects are parts of others, although facts name them.
#[test]
fn a_stored_run_keeps_parts_departures_and_suction_cups() {
    let folder = tempfile::tempdir().unwrap();
    let history = History::open(&folder.path().join("history")).unwrap();
    let mut record = sample_run("z2", 3);
    for (number, state) in record.trace.snapshots.iter_mut().enumerate() {
        let number = number as f64;
        state.bodies[1].part = Some(("coffee_table_1".to_owned(), 0.125 * number));
        state.bodies[2].left_world = number > 0.0;
        state.robot.cup = Some(CupState {
            force_n: 60.0,
            pull_n: 2.5 * number,
        });
    }
    record.facts = extract(&record.trace);
    history.begin_campaign(&sample_campaign("z2", 1)).unwrap();
    history.commit(&record).unwrap();
    drop(history);
    let history = History::open_existing(&folder.path().join("history")).unwrap();
    assert_eq!(history.traces().whole("z2-4").unwrap(), record.trace);
    let facts = history.traces().facts("z2-4", false).unwrap();
    assert_eq!(facts_as_terms(&facts), facts_as_terms(&record.facts));
    let named = |local: &str| Term::iri(names::w(local));
    let has = |local: &str| {
        facts_as_terms(&facts)[1]
            .iter()
            .any(|[_, p, _]| *p == named(local))
    };
    assert!(["partOf", "jointPosition", "leftWorld", "pull"].map(has) == [true; 4]);
}

#[test]
fn stored_graphs_equal_the_facts_bit_for_bit_except_documented_omissions() {
    let (_folder, history) = filled();
    let record = sample_run("z2", 3);
    for (graph, all) in ["state/0", "state/1", "1/during"]
        .into_iter()
        .zip(facts_as_terms(&record.facts))
    {
        let iri = format!("{}z2-4/{graph}", names::RUN);
        let QueryAnswer::Graph(triples) = history
            .query(&format!(
                "CONSTRUCT {{ ?s ?p ?o }} WHERE {{ GRAPH <{iri}> {{ ?s ?p ?o }} }}"
            ))
            .unwrap()
        else {
            panic!("no graph")
        };
        let kept: BTreeSet<[Term; 3]> = triples.into_iter().collect();
        assert!(kept.is_subset(&all), "{graph}");
        let left_out: BTreeSet<String> = all
            .difference(&kept)
            .filter(|[subject, ..]| !subject.to_string().contains("contact"))
            .map(|[_, property, _]| names::local(property.as_iri().unwrap()).to_owned())
            .collect();
        let expected: &[&str] = match graph {
            "1/during" => &["type"],
            _ => &[
                "fixed",
                "friction",
                "lower",
                "mass",
                "maxEffort",
                "maxVelocity",
                "maxX",
                "maxY",
                "minX",
                "minY",
                "restitution",
                "type",
                "upper",
                "velocity",
            ],
        };
        assert_eq!(
            left_out.into_iter().collect::<Vec<_>>(),
            expected,
            "{graph}"
        );
    }
}

#[test]
fn the_graphs_keep_the_strongest_contact_of_each_pair() {
    let (_folder, history) = filled();
    let rows = table(
        &history,
        "SELECT ?second ?force WHERE { <https://w3id.org/actcheck/run/z2-4/1> act:during ?g . GRAPH ?g {
           ?c w:first obj:glass_1 ; w:second ?second ; w:maxForce ?force ; w:start ?start ; w:end ?end } } ORDER BY ?second",
    );
    let trace = sample_run("z2", 3).trace;
    let strongest = |link: &str| {
        let of_link =
            |contact: &&actcheck::data::ContactEpisode| contact.pair[1] == format!("robot/{link}");
        trace.actions[0]
            .contacts
            .iter()
            .filter(of_link)
            .map(|contact| contact.max_force_n)
            .fold(0.0, f64::max)
    };
    let links = ["finger_left", "finger_right", "hand"];
    assert_eq!(rows.len(), links.len());
    for (row, link) in rows.iter().zip(links) {
        assert_eq!(row[0], Some(Term::iri(names::w(&format!("link/{link}")))));
        let force = row[1].as_ref().and_then(Term::number).unwrap();
        assert!((force - strongest(link)).abs() < 1e-5, "{force}");
    }
}

#[test]
fn a_run_is_shown_with_all_stored_data() {
    let (_folder, history) = filled();
    let record = sample_run("z2", 3);
    let run = history.run("z2-4").unwrap();
    assert_eq!(
        (run.row.index, run.row.status, run.row.score),
        (3, RunStatus::Completed, 0.8)
    );
    assert_eq!(
        (run.row.trace_hash.as_str(), run.row.started.as_str()),
        (&*record.trace.hash, "2026-08-01T12:00:00Z")
    );
    assert_eq!(
        (run.seed, run.wall_secs, run.world.as_str()),
        (u64::MAX, 1.25, "living room")
    );
    assert_eq!(run.program_version, env!("CARGO_PKG_VERSION"));
    assert_eq!(run.robot_base, [-0.6, 0.0, 0.1]);
    assert_eq!(run.noise["yawNoise"], 0.05);
    assert_eq!((&run.discards, run.discards.len()), (&record.discards, 1));
    assert_eq!(run.designators, record.scene.designators);
    let roles: Vec<Role> = run.objects.iter().map(|object| object.role).collect();
    assert_eq!(&roles[..3], [Role::Platform, Role::Target, Role::Other]);
    let mug = run
        .objects
        .iter()
        .find(|object| object.id == "mug_1")
        .unwrap();
    assert_eq!(
        (
            mug.model.as_str(),
            mug.mass_kg,
            mug.friction,
            mug.restitution
        ),
        ("mug", 0.31, 0.7, 0.05)
    );
    assert!(
        (mug.target_distance_m.unwrap() - 0.2).abs() < 1e-12
            && (mug.robot_distance_m - 1.0).abs() < 1e-12
    );
    assert_eq!(
        mug.displacement_m,
        Some(record.trace.actions[0].extremes[2].max_displacement_m)
    );
    assert_eq!(run.objects[1].target_distance_m, None);
    let pick = &run.actions[0];
    assert_eq!(
        (pick.step, pick.end.as_str(), pick.reported),
        (1, "completed", Some(true))
    );
    assert_eq!(pick.message.as_deref(), Some("the object is held"));
    assert_eq!(pick.parameters, record.trace.actions[0].parameters);
    assert_eq!(pick.judgements, record.judgements[0]);
}

#[test]
fn a_broken_run_has_its_reason() {
    let (_folder, history) = filled();
    let mut record = sample_run("a1", 7);
    record.trace.snapshots.clear();
    record.trace.actions[0].end = ActionEnd::Broken("a pose is not a number".to_owned());
    record.trace.actions[0].report = None;
    record.facts = extract(&record.trace);
    (record.status, record.reason) = (RunStatus::Broken, Some("a pose is not a number".to_owned()));
    record.judgements[0]
        .iter_mut()
        .for_each(|judgement| judgement.outcome = Outcome::Broken);
    history.commit(&record).unwrap();
    let run = history.run("a1-8").unwrap();
    assert_eq!(
        (run.row.status, run.reason.as_deref()),
        (RunStatus::Broken, Some("a pose is not a number"))
    );
    assert_eq!(
        (run.actions[0].end.as_str(), run.actions[0].reported),
        ("broken", None)
    );
    assert!(
        run.actions[0]
            .judgements
            .iter()
            .all(|judgement| judgement.outcome == Outcome::Broken)
    );
    let broken = RunFilter {
        status: Some(RunStatus::Broken),
        ..RunFilter::default()
    };
    assert_eq!(history.runs(&broken).unwrap().len(), 1);
}

#[test]
fn lists_are_ordered_and_can_be_filtered() {
    let (_folder, history) = filled();
    let runs: Vec<String> = history
        .runs(&RunFilter::default())
        .unwrap()
        .into_iter()
        .map(|row| row.run)
        .collect();
    assert_eq!(
        runs,
        [
            "z2-1", "z2-2", "z2-3", "z2-4", "z2-5", "z2-6", "a1-1", "a1-2"
        ]
    );
    let filter = RunFilter {
        campaign: Some("a1".to_owned()),
        test: Some("Pick".to_owned()),
        status: None,
    };
    assert_eq!(history.runs(&filter).unwrap().len(), 2);
    assert!(
        history
            .runs(&RunFilter {
                test: Some("Place".to_owned()),
                ..filter.clone()
            })
            .unwrap()
            .is_empty()
    );
    let outcomes = history.outcomes(&filter).unwrap();
    assert_eq!(outcomes.len(), 10);
    let failed: Vec<_> = outcomes
        .iter()
        .filter(|row| row.outcome == Outcome::Failed)
        .collect();
    assert_eq!(
        (failed[0].run.as_str(), failed[0].step, failed[0].margin),
        ("a1-1", 1, Some(-0.04))
    );
    assert_eq!(
        (failed[0].property.as_str(), failed.len()),
        (names::act("ObjectInGripper").as_str(), 1)
    );
}

#[test]
fn a_campaign_is_listed_with_its_end() {
    let (_folder, history) = filled();
    let end = CampaignEnd {
        ended: "2026-08-01T12:09:00Z".to_owned(),
        score: Some(0.9),
        score_without_broken: None,
        outcomes: BTreeMap::from([(Outcome::Passed, 28), (Outcome::Failed, 2)]),
        discards: 3,
        ended_by: Some("failures".to_owned()),
        interrupted: false,
    };
    history.finish_campaign("z2", &end).unwrap();
    let campaigns = history.campaigns().unwrap();
    let [z2, a1] = campaigns.as_slice() else {
        panic!("{campaigns:?}")
    };
    assert_eq!(
        (
            z2.id.as_str(),
            z2.name.as_str(),
            z2.runs,
            z2.planned_runs,
            z2.seed
        ),
        ("z2", "pick", 6, 6, 7)
    );
    assert_eq!(
        (z2.score, z2.score_without_broken, z2.interrupted),
        (Some(0.9), None, false)
    );
    assert_eq!(z2.ended_by.as_deref(), Some("failures"));
    assert_eq!((&z2.ended, &z2.outcomes), (&Some(end.ended), &end.outcomes));
    assert_eq!(
        (a1.id.as_str(), a1.runs, a1.interrupted, &a1.ended),
        ("a1", 2, true, &None)
    );
}

#[test]
fn a_run_is_found_by_its_id_prefixed_name_or_iri() {
    let (_folder, history) = filled();
    for name in [
        "z2-4",
        "run:z2-4",
        " z2-4 ",
        "<https://w3id.org/actcheck/run/z2-4>",
    ] {
        assert_eq!(history.resolve(name).unwrap(), "z2-4", "{name}");
    }
    let several = history.run("a1").unwrap_err().to_string();
    assert!(
        several.contains("H008: `a1` matches 2 runs") && several.contains("a1-1, a1-2"),
        "{several}"
    );
    let none = history.run("zz-4").unwrap_err().to_string();
    assert!(
        none.contains("has no run `zz-4`") && none.contains("did you mean `z2-4`?"),
        "{none}"
    );
    assert!(history.run("").is_err());
}

#[test]
fn campaign_ids_are_short_new_and_repeatable() {
    let (_folder, history) = filled();
    let id = history.next_campaign_id("abc", 7).unwrap();
    assert_eq!(id, history.next_campaign_id("abc", 7).unwrap());
    assert_ne!(id, history.next_campaign_id("abc", 8).unwrap());
    assert!(
        id.len() == 4 && id.starts_with(|c: char| c.is_ascii_lowercase()),
        "{id}"
    );
    history.begin_campaign(&sample_campaign(&id, 9)).unwrap();
    assert_ne!(id, history.next_campaign_id("abc", 7).unwrap());
}

#[test]
fn common_questions_have_short_queries() {
    let (_folder, history) = filled();
    let count = table(
        &history,
        "PREFIX act: <http://actions#> SELECT (COUNT(?r) AS ?n) WHERE { ?r a act:Run }",
    );
    assert_eq!(count, [[Some(Term::Integer(8))]]);
    let moved = table(
        &history,
        "SELECT ?run ?object ?moved ?distance WHERE { ?o act:ofRun ?run ; act:role 'other' ; act:object ?object ;
           act:displacement ?moved ; act:targetDistance ?distance FILTER(?moved > 0.01) } ORDER BY DESC(?moved)",
    );
    assert!(!moved.is_empty());
    let failed = table(
        &history,
        "SELECT ?property (COUNT(?e) AS ?n) WHERE { ?a earl:subject ?e ; earl:test ?property ;
           earl:result/earl:outcome earl:failed } GROUP BY ?property",
    );
    assert_eq!(
        failed,
        [[
            Some(Term::iri(names::act("ObjectInGripper"))),
            Some(Term::Integer(3))
        ]]
    );
    let held = table(
        &history,
        "SELECT ?z WHERE { ?e act:ofRun run:z2-4 ; act:pickObject ?o ; act:after ?g . GRAPH ?g { ?o w:z ?z } }",
    );
    assert_eq!(
        held,
        [[Some(Term::Double(
            sample_run("z2", 3).trace.snapshots[1].bodies[1]
                .pose
                .position[2]
        ))]]
        .map(|row| row.map(|z| z.map(|z| Term::Double(
            z.number()
                .map_or(f64::NAN, |z| format!("{}", z as f32).parse().unwrap())
        ))))
    );
    assert_eq!(
        history
            .query("ASK { GRAPH ?g { obj:glass_1 w:restsOn w:robot } }")
            .unwrap(),
        QueryAnswer::Boolean(true)
    );
}

/// Terms of our namespaces that the vocabulary files describe, prefixed.
fn described() -> BTreeSet<String> {
    ["history.ttl", "world.ttl", "actions.ttl"]
        .iter()
        .flat_map(|file| {
            let text = std::fs::read_to_string(crate::support::root().join("ontology").join(file))
                .unwrap();
            text.lines()
                .filter_map(|line| Some(line.split_once(" a ")?.0.to_owned()))
                .collect::<Vec<_>>()
        })
        .collect()
}

#[test]
fn every_term_of_a_history_is_described() {
    let (_folder, history) = filled();
    let end = CampaignEnd {
        score: Some(1.0),
        score_without_broken: Some(1.0),
        outcomes: Outcome::ALL
            .into_iter()
            .map(|outcome| (outcome, 1))
            .collect(),
        ended: "2026-08-01T12:09:00Z".to_owned(),
        ended_by: Some("time".to_owned()),
        ..CampaignEnd::default()
    };
    history.finish_campaign("z2", &end).unwrap();
    let described = described();
    let terms = "SELECT DISTINCT ?t WHERE { { ?s ?t ?o } UNION { ?s a ?t } UNION { GRAPH ?g { ?s ?t ?o } } }";
    let used: BTreeSet<String> = table(&history, terms)
        .iter()
        .flatten()
        .flatten()
        .map(ToString::to_string)
        .collect();
    assert!(used.len() > 70, "{}", used.len());
    let ours = |term: &&String| {
        term.starts_with("act:") || term.starts_with("w:") || term.starts_with('<')
    };
    let missing: Vec<&String> = used
        .iter()
        .filter(ours)
        .filter(|term| !described.contains(*term))
        .collect();
    assert!(missing.is_empty(), "not described: {missing:?}");
}

#[test]
fn invalid_queries_are_reported_with_their_place() {
    let (_folder, history) = filled();
    let fault = |text: &str| history.query(text).unwrap_err().to_string();
    let starts = |text: &str, expected: &str| {
        let fault = fault(text);
        assert!(
            fault.starts_with(expected) && fault.contains("help: "),
            "{fault}"
        );
    };
    starts(
        "SELECT ?r\nWHER { ?r a act:Run }",
        "H010 query:2:1: this is not a SPARQL query: unexpected `WHER`",
    );
    starts(
        "SELEC ?r WHERE { ?r a act:Run }",
        "H010 query:1:1: this is not a SPARQL query: unexpected `SELEC",
    );
    starts(
        "SELECT ?r WHERE { ?r a act:Run ",
        "H010 query:1:32: the query ends too early",
    );
    starts("", "H010 query:1:1: the query ends too early");
    starts(
        "SELECT (COUNT(?r) AS ?n WHERE { ?r ?p ?o }",
        "H010 query:1:25: this is not a SPARQL query",
    );
    starts(
        "SELECT ?r WHERE { ?r a foo:Run }",
        "H010 query:1:24: the prefix of `foo:Run` is unknown",
    );
    starts(
        "SELECT ?x (COUNT(?r) AS ?n) WHERE { ?x ?p ?r }",
        "H010 query:1:46: the SELECT contains a variable that is unbound",
    );
    let update = fault("PREFIX a: <http://a#>\n  insert data { a:b a:c a:d }");
    assert!(
        update.starts_with("H011 query:2:3: `INSERT` is an update"),
        "{update}"
    );
    let service = fault("SELECT * WHERE { SERVICE <http://localhost/> { ?s ?p ?o } }");
    assert!(service.starts_with("H012"), "{service}");
}

#[test]
fn a_long_query_can_be_stopped() {
    let (_folder, history) = filled();
    let cancel = Cancel::new();
    let stopper = cancel.clone();
    let text = Source::new(
        "long.rq",
        "SELECT (COUNT(*) AS ?n) WHERE { GRAPH ?g { ?a ?b ?c } GRAPH ?h { ?d ?e ?f } GRAPH ?i { ?j ?k ?l } FILTER(?c < ?l) }",
    );
    let waiting = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(100));
        stopper.cancel();
    });
    let started = std::time::Instant::now();
    let fault = history.query_from(&text, &cancel).unwrap_err().to_string();
    assert!(
        started.elapsed() < Duration::from_secs(2),
        "{:?}",
        started.elapsed()
    );
    waiting.join().unwrap();
    assert!(
        fault.starts_with("H013 long.rq: the query was stopped"),
        "{fault}"
    );
}

#[test]
fn a_second_owner_is_refused_without_changes() {
    let (folder, history) = filled();
    let dir = folder.path().join("history");
    let fault = code(History::open(&dir));
    assert!(
        fault.starts_with("H002") && fault.contains(&dir.display().to_string()),
        "{fault}"
    );
    assert_eq!(history.runs(&RunFilter::default()).unwrap().len(), 8);
    drop(history);
    assert!(History::open_existing(&dir).is_ok());
}

#[test]
fn a_history_of_another_format_is_not_changed() {
    let (folder, history) = filled();
    drop(history);
    let dir = folder.path().join("history");
    for (version, help) in [("8", "update actcheck"), ("6", "no release wrote")] {
        std::fs::write(dir.join("VERSION"), format!("actcheck history {version}\n")).unwrap();
        for fault in [code(History::open(&dir)), code(History::open_to_read(&dir))] {
            assert!(
                fault.starts_with("H004")
                    && fault.contains(&format!("has format {version}; "))
                    && fault.contains(help),
                "{fault}"
            );
        }
    }
    std::fs::write(dir.join("VERSION"), "actcheck history 7\n").unwrap();
    assert_eq!(
        History::open_existing(&dir)
            .unwrap()
            .runs(&RunFilter::default())
            .unwrap()
            .len(),
        8
    );
}

#[test]
fn folders_without_a_history_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let none = folder.path().join("none");
    assert!(code(History::open_existing(&none)).starts_with("H003: there is no history"));
    assert!(!none.exists());
    std::fs::write(folder.path().join("thesis.tex"), "").unwrap();
    assert!(code(History::open(folder.path())).contains("it holds other files"));
    assert!(code(History::open_existing(folder.path())).contains("it holds other files"));
    let file = code(History::open(&folder.path().join("thesis.tex")));
    assert!(
        file.starts_with("H001") && file.contains("a file exists at its path"),
        "{file}"
    );
    let below = code(History::open(&folder.path().join("thesis.tex/history")));
    assert!(below.starts_with("H001"), "{below}");
}

#[test]
fn an_uncreatable_folder_is_reported() {
    // Permission bits don't stop root, so this uses a path where no user can create a folder.
    let fault = code(History::open(Path::new("/proc/actcheck")));
    assert!(
        fault.starts_with("H001") && fault.contains("/proc/actcheck"),
        "{fault}"
    );
}

/// Runs a test on a small file system of its own, which is removed afterwards. Says so if mounting
/// is not permitted.
fn on_small_disk(test: impl FnOnce(&Path) + std::panic::UnwindSafe) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().to_str().unwrap();
    if !ran(&["mount", "-t", "tmpfs", "-o", "size=12m", "tmpfs", path]) {
        left_out("a test on a small file system", "it can't be mounted here");
        return;
    }
    let outcome = std::panic::catch_unwind(|| test(folder.path()));
    assert!(ran(&["umount", path]));
    if let Err(panic) = outcome {
        std::panic::resume_unwind(panic);
    }
}

fn ran(command: &[&str]) -> bool {
    let output = std::process::Command::new(command[0])
        .args(&command[1..])
        .output();
    output.is_ok_and(|output| output.status.success())
}

#[test]
fn a_read_only_folder_is_reported() {
    on_small_disk(|disk| {
        let dir = disk.join("history");
        drop(History::open(&dir).unwrap());
        assert!(ran(&["mount", "-o", "remount,ro", disk.to_str().unwrap()]));
        for result in [
            History::open(&dir),
            History::open_existing(&dir),
            History::open(&disk.join("new")),
        ] {
            let fault = code(result);
            assert!(
                fault.starts_with("H001") && fault.contains("read-only"),
                "{fault}"
            );
        }
    });
}

#[test]
fn damaged_or_missing_states_are_reported_and_other_data_is_readable() {
    let (folder, history) = filled();
    drop(history);
    let dir = folder.path().join("history");
    let file = dir.join("campaigns/z2/0001.states");
    let bytes = std::fs::read(&file).unwrap();
    // `z2-1` was stored last.
    std::fs::write(&file, &bytes[..bytes.len() - 1]).unwrap();
    let history = History::open_to_read(&dir).unwrap();
    assert!(
        history
            .traces()
            .whole("z2-1")
            .unwrap_err()
            .to_string()
            .starts_with("H007")
    );
    assert_eq!(history.traces().whole("z2-2").unwrap(), sample_trace(1));
    std::fs::remove_file(&file).unwrap();
    let history = History::open_to_read(&dir).unwrap();
    let fault = history
        .traces()
        .facts("z2-1", false)
        .unwrap_err()
        .to_string();
    assert!(
        fault.starts_with("H007") || fault.starts_with("H009"),
        "{fault}"
    );
    assert_eq!(history.run("z2-1").unwrap().actions.len(), 1);
    assert_eq!(history.runs(&RunFilter::default()).unwrap().len(), 8);
}

#[test]
fn files_that_killed_processes_began_are_harmless() {
    let (folder, history) = filled();
    let dir = folder.path().join("history");
    for leftover in ["VERSION.1-7.tmp", "campaigns/z2/campaign.1-7.tmp"] {
        std::fs::write(dir.join(leftover), "half").unwrap();
    }
    // A segment of which only the first file was created.
    std::fs::write(dir.join("campaigns/z2/0002.states"), "").unwrap();
    drop(history);
    let history = History::open(&dir).unwrap();
    history.begin_campaign(&sample_campaign("b3", 5)).unwrap();
    history.commit(&sample_run("z2", 6)).unwrap();
    assert_eq!(history.runs(&RunFilter::default()).unwrap().len(), 9);
    drop(history);
    let (found, history) = History::examine(&dir).unwrap();
    assert_eq!((found.damage, found.runs), (Vec::new(), 9));
    assert_eq!(history.traces().whole("z2-7").unwrap(), sample_trace(6));
}

#[test]
fn a_full_disk_is_reported_and_stored_runs_are_kept() {
    on_small_disk(|disk| fill_up(&disk.join("history")));
}

fn fill_up(dir: &Path) {
    let ballast = dir.parent().unwrap().join("ballast");
    std::fs::write(&ballast, vec![1; 11 << 20]).unwrap();
    let history = History::open(dir).unwrap();
    history.begin_campaign(&sample_campaign("a1", 1)).unwrap();
    let mut kept = 0;
    let fault = loop {
        if let Err(fault) = history
            .commit(&sample_run("a1", kept))
            .and_then(|()| history.flush())
        {
            break fault.to_string();
        }
        kept += 1;
        assert!(kept < 10_000, "the disk did not fill up");
    };
    assert!(
        fault.starts_with("H005") && fault.contains("full") && fault.contains("history"),
        "{fault}"
    );
    drop(history);
    // Readers need no room in the folder.
    let history = History::open_to_read(dir).unwrap();
    let runs = history.runs(&RunFilter::default()).unwrap();
    // The last one may have been written and not flushed.
    assert!(
        (kept..=kept + 1).contains(&(runs.len() as u64)),
        "{} of {kept}",
        runs.len()
    );
    for run in &runs {
        assert_eq!(
            history.run(&run.run).unwrap().actions[0].judgements.len(),
            PROPERTIES.len()
        );
        assert_eq!(
            history.traces().whole(&run.run).unwrap(),
            sample_trace(run.index)
        );
    }
    drop(history);
    let (found, _) = History::examine(dir).unwrap();
    assert_eq!((found.damage, found.runs), (Vec::new(), runs.len()));
    std::fs::remove_file(&ballast).unwrap();
    // The next owner goes on.
    let next = runs.len() as u64;
    let history = History::open(dir).unwrap();
    history.commit(&sample_run("a1", next)).unwrap();
    history
        .finish_campaign("a1", &CampaignEnd::default())
        .unwrap();
    drop(history);
    let (found, history) = History::examine(dir).unwrap();
    assert_eq!((found.damage, found.runs), (Vec::new(), runs.len() + 1));
    assert!(history.tail_warning().unwrap().is_none());
}
