//! Exports results for Allure 2 and 3: one file for each property of each action of a run.
//!
//! Allure treats results with the same history id as retries and hides all but the last. Version 2
//! reads the id; version 3 derives it from the test case and its parameters. Therefore both contain
//! the scene and the repetition number: each repetition is a separate result, and the same scene in
//! another campaign continues the history.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use crate::formats::identity::{case_name, scene};
use crate::{Page, run_text};
use actcheck_base::{Judgement, Outcome, digest_of, names};
use actcheck_data::Role;
use actcheck_history::{ActionDetail, RunDetail};

/// Names of the files in the results folder that do not belong to a result.
const RESULTS_COMMON_FILES: [&str; 2] = ["categories.json", "environment.properties"];

/// A file attached to results.
#[derive(Debug, Clone, PartialEq)]
pub struct Attachment {
    /// Step of the action and IRI of the property that it is about. `None` if it is about the whole
    /// run.
    pub about: Option<(u32, String)>,
    /// Display name.
    pub name: String,
    /// Its media type.
    pub media_type: &'static str,
    /// File extension.
    pub ending: &'static str,
    /// Content.
    pub bytes: Vec<u8>,
}

impl Attachment {
    fn is_about(&self, action: &ActionDetail, judgement: &Judgement) -> bool {
        self.about
            .as_ref()
            .is_none_or(|(step, property)| *step == action.step && *property == judgement.property)
    }

    fn file(&self, run: &RunDetail) -> String {
        let what = format!("{} {} {:?}", run.row.run, self.name, self.about);
        format!("{}-attachment.{}", uuid(&what), self.ending)
    }
}

/// Returns the files of a run with their names: a result for each property of each action, and the
/// attachments.
///
/// `number` is the run's number among those of its scene ([`super::Repetitions`]), `perceived` are
/// the sentences of [`run_text`]. Times are simulated times, counted from the start of the run.
pub fn allure_results(
    run: &RunDetail,
    number: u64,
    attachments: &[Attachment],
    perceived: &BTreeMap<u32, String>,
) -> Vec<(String, Vec<u8>)> {
    let whole = Attachment {
        about: None,
        name: "the whole run".to_owned(),
        media_type: "text/plain",
        ending: "txt",
        bytes: run_text(run, perceived, Page::default()).into_bytes(),
    };
    let attachments: Vec<&Attachment> = attachments.iter().chain([&whole]).collect();
    let mut files = Vec::new();
    for action in &run.actions {
        for judgement in &action.judgements {
            let attached: Vec<Value> = attachments
                .iter()
                .filter(|attachment| attachment.is_about(action, judgement))
                .map(|it| json!({ "name": it.name, "source": it.file(run), "type": it.media_type }))
                .collect();
            let result = result(run, number, action, judgement, attached);
            let name = format!(
                "{}-result.json",
                result["uuid"].as_str().unwrap_or_default()
            );
            files.push((name, result.to_string().into_bytes()));
        }
    }
    files.extend(
        attachments
            .iter()
            .map(|attachment| (attachment.file(run), attachment.bytes.clone())),
    );
    files
}

fn result(
    run: &RunDetail,
    number: u64,
    action: &ActionDetail,
    judgement: &Judgement,
    attachments: Vec<Value>,
) -> Value {
    let (case, scene) = (case_name(run, action, &judgement.property), scene(run));
    let (name, property) = (
        names::local(&action.action),
        names::local(&judgement.property),
    );
    let [start, stop] = times(run, action.step);
    let label = |name: &str, value: &str| json!({ "name": name, "value": value });
    json!({
        "uuid": uuid(&format!("{} {case}", run.row.run)),
        "historyId": digest_of(&format!("{case} {scene} {number}")),
        "testCaseId": digest_of(&case),
        "fullName": case,
        "titlePath": [run.row.test, name],
        "name": format!("{property} ({})", run.row.run),
        "description": format!("{property} of {name} in run {}, scene {scene}: `actcheck show {}`", run.row.run, run.row.run),
        "status": status(judgement.outcome),
        "statusDetails": { "message": message(judgement), "trace": details(judgement), "flaky": false, "known": false, "muted": false },
        "stage": "finished", "start": start, "stop": stop,
        "labels": [
            label("framework", "actcheck"), label("parentSuite", &run.row.test), label("suite", name), label("subSuite", property),
            label("epic", &run.row.test), label("feature", name), label("story", property), label("testClass", name),
            label("testMethod", property), label("tag", judgement.outcome.word()), label("host", &run.world),
        ],
        "parameters": parameters(run, number, &scene, judgement),
        "links": [],
        "steps": steps(run, action, judgement),
        "attachments": attachments,
    })
}

/// Allure's status of an outcome. Inapplicable and untested become skipped; timeout becomes broken.
fn status(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Passed => "passed",
        Outcome::Failed => "failed",
        Outcome::Broken | Outcome::Timeout => "broken",
        Outcome::Inapplicable | Outcome::Untested => "skipped",
    }
}

/// The actcheck outcome, which the categories match, and the witness.
fn message(judgement: &Judgement) -> String {
    format!("{}: {}", judgement.outcome, judgement.witness)
}

fn details(judgement: &Judgement) -> String {
    let margin = judgement.margin.map_or_else(
        || "no margin".to_owned(),
        |margin| format!("margin {margin:+.4}"),
    );
    format!(
        "{}\n{margin}\nrule {}",
        message(judgement),
        judgement.rule_digest
    )
}

/// Parameters that identify a result (scene and repetition), and further parameters that are
/// excluded from the identity.
fn parameters(run: &RunDetail, number: u64, scene: &str, judgement: &Judgement) -> Vec<Value> {
    let parameter =
        |name: &str, value: String| json!({ "name": name, "value": value, "excluded": true });
    let mut all = vec![
        json!({ "name": "scene", "value": scene }),
        json!({ "name": "repetition", "value": number.to_string() }),
        parameter("run", run.row.run.clone()),
        parameter("campaign", run.row.campaign.clone()),
        parameter("world", run.world.clone()),
    ];
    if let Some(margin) = judgement.margin {
        all.push(parameter("margin", format!("{margin:+.4}")));
    }
    for target in run
        .objects
        .iter()
        .filter(|object| object.role == Role::Target)
    {
        all.push(parameter(
            "target",
            names::local(&target.category).to_owned(),
        ));
        all.push(parameter(
            "target x, y, yaw",
            format!(
                "{:.3} m, {:.3} m, {:.3} rad",
                target.x, target.y, target.yaw
            ),
        ));
        all.push(parameter(
            "target mass, friction",
            format!("{:.3} kg, {:.3}", target.mass_kg, target.friction),
        ));
    }
    all.push(parameter("objects", run.objects.len().to_string()));
    all.extend(
        run.noise
            .iter()
            .map(|(name, deviation)| parameter(name, deviation.to_string())),
    );
    all
}

/// The actions up to the judged one, which has the judgement as an additional step.
fn steps(run: &RunDetail, judged: &ActionDetail, judgement: &Judgement) -> Vec<Value> {
    let until_now = run
        .actions
        .iter()
        .filter(|action| action.step <= judged.step);
    until_now
        .map(|action| {
            let [start, stop] = times(run, action.step);
            let parameters: Vec<Value> = action
                .parameters
                .iter()
                .map(|(name, values)| json!({ "name": name, "value": values.join(", ") }))
                .collect();
            let judging = json!({
                "name": format!("judge {}", names::local(&judgement.property)), "status": status(judgement.outcome),
                "statusDetails": { "message": message(judgement) }, "stage": "finished", "start": stop, "stop": stop,
                "steps": [], "attachments": [], "parameters": [],
            });
            json!({
                "name": format!("{}. {}: {}", action.step, names::local(&action.action), report_of(action)),
                "status": end(action), "statusDetails": { "message": action.message },
                "stage": "finished", "start": start, "stop": stop, "parameters": parameters, "attachments": [],
                "steps": if action.step == judged.step { vec![judging] } else { Vec::new() },
            })
        })
        .collect()
}

fn report_of(action: &ActionDetail) -> &str {
    match (action.end.as_str(), action.reported) {
        ("completed", Some(true)) => "reported success",
        ("completed", Some(false)) => "reported failure",
        ("completed", None) => "reported nothing",
        ("inapplicable", _) => "not performed",
        (end, _) => end,
    }
}

/// Status of an action itself, independent of its judgements.
fn end(action: &ActionDetail) -> &'static str {
    match (action.end.as_str(), action.reported) {
        ("completed", Some(false)) => "failed",
        ("completed", _) => "passed",
        ("untested" | "inapplicable", _) => "skipped",
        _ => "broken",
    }
}

/// Start and end of an action. Unit: milliseconds since 1970.
fn times(run: &RunDetail, step: u32) -> [i64; 2] {
    let began: jiff::Timestamp = run
        .row
        .started
        .parse()
        .unwrap_or(jiff::Timestamp::UNIX_EPOCH);
    let simulated = |until: &dyn Fn(&ActionDetail) -> bool| -> f64 {
        run.actions
            .iter()
            .filter(|action| until(action))
            .map(|action| action.duration_secs)
            .sum()
    };
    let after = |secs: f64| began.as_millisecond() + (secs * 1000.0).round() as i64;
    [
        after(simulated(&|action| action.step < step)),
        after(simulated(&|action| action.step <= step)),
    ]
}

/// Returns the common files of the results folder: the categories of results that did not pass, and
/// the environment.
pub fn allure_common(program: &str, campaigns: &[String]) -> Vec<(String, Vec<u8>)> {
    let category = |name: &str, status: &str, word: &str| json!({ "name": name, "matchedStatuses": [status], "messageRegex": format!("(?s)^{word}: .*") });
    let categories = json!([
        category("The robot failed a property", "failed", "failed"),
        category("Simulation or tool was at fault", "broken", "broken"),
        category("A budget was spent", "broken", "timeout"),
        category(
            "The property does not apply to this action",
            "skipped",
            "inapplicable"
        ),
        category("The action was never reached", "skipped", "untested"),
    ]);
    // Backslashes and newlines are special in this format, but ids and versions have none.
    let environment = format!("actcheck={program}\ncampaigns={}\n", campaigns.join(" "));
    let [first, second] = RESULTS_COMMON_FILES;
    vec![
        (first.to_owned(), format!("{categories:#}\n").into_bytes()),
        (second.to_owned(), environment.into_bytes()),
    ]
}

/// Derives a UUID, as used in Allure's file names, from a text.
fn uuid(text: &str) -> String {
    let digest = digest_of(text);
    let part = |from: usize, to: usize| digest.get(from..to).unwrap_or_default();
    format!(
        "{}-{}-{}-{}-{}",
        part(0, 8),
        part(8, 12),
        part(12, 16),
        part(16, 20),
        part(20, 32)
    )
}
