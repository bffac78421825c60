//! A shrunk run as text and JSON.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::Table;
use crate::table::ruled;
use actcheck_base::names;
use actcheck_history::RunDetail;

/// The result of shrinking, as plain data.
#[derive(Debug, Clone, PartialEq)]
pub struct ShrunkSummary {
    /// Id of the run that was shrunk.
    pub original: String,
    /// The shrunk run, as stored in the history.
    pub run: RunDetail,
    /// IRIs of the properties that failed in the original.
    pub failed: Vec<String>,
    /// Number of other objects in the original.
    pub others_before: usize,
    /// Number of choices that were not nominal in the original.
    pub special_before: usize,
    /// Choices that are not nominal now.
    pub choices: Vec<ShrunkChoice>,
    /// Whether the scene is minimal: nothing more can be removed.
    pub minimal: bool,
    /// Number of simulations for shrinking.
    pub simulations: u64,
    /// Number of simulations for the explanation.
    pub explaining: u64,
    /// The nearest scene that passes: name and value of the choice that differs.
    pub neighbour: Option<(String, f64)>,
    /// Number of failures with fresh noise, and number of repetitions.
    pub fresh: Option<(u32, u32)>,
    /// Whether the recorded noise had to be kept.
    pub noise_kept: bool,
    /// Explanation of each failed property, as text.
    pub why: Vec<String>,
}

/// One choice that is not nominal.
#[derive(Debug, Clone, PartialEq)]
pub struct ShrunkChoice {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its nominal value.
    pub nominal: f64,
    /// Unit of the values; empty for factors and for list indices.
    pub unit: &'static str,
    /// Whether the run passes if only this choice is set to its nominal value. `None` if that was not tried.
    pub matters: Option<bool>,
    /// Range of values with which the run fails.
    pub fails: (f64, f64),
    /// Nearest values with which the run passes, below and above that range.
    pub passes: (Option<f64>, Option<f64>),
}

impl ShrunkSummary {
    /// Number of other objects left.
    pub fn others(&self) -> usize {
        self.run.objects.iter().filter(|object| object.role.is_bystander()).count()
    }
}

/// Formats the shrunk scene, the choices that matter, and why it fails.
pub fn shrunk_text(shrunk: &ShrunkSummary) -> String {
    let mut out = String::new();
    let failed: Vec<&str> = shrunk.failed.iter().map(|iri| names::local(iri)).collect();
    let _ = writeln!(out, "{}: the smallest scene found that fails like {}", shrunk.run.row.run, shrunk.original);
    let _ = writeln!(out, "fails {}", failed.join(" + "));
    let end = if shrunk.minimal { "nothing more can be removed" } else { "stopped at a limit: it may not be minimal" };
    let _ = writeln!(
        out,
        "{} of {} other objects left, {} of {} choices not nominal; {} simulations, {} more to explain; {end}",
        shrunk.others(),
        shrunk.others_before,
        shrunk.choices.len(),
        shrunk.special_before,
        shrunk.simulations,
        shrunk.explaining
    );
    if let Some((failures, of)) = shrunk.fresh {
        let _ = writeln!(out, "with fresh noise it fails in {failures} of {of} repetitions");
    }
    if shrunk.noise_kept {
        let _ = writeln!(out, "with fresh noise the run does not fail often enough: its recorded noise is kept");
    }
    let _ = writeln!(out, "\n{}", scene_table(shrunk));
    if shrunk.choices.is_empty() {
        let _ = writeln!(out, "it fails with every choice at its nominal value");
    } else {
        let _ = writeln!(out, "\n{}", choice_table(shrunk));
    }
    if let Some((name, value)) = &shrunk.neighbour
        && let Some(choice) = shrunk.choices.iter().find(|choice| choice.name == *name)
    {
        let _ = writeln!(
            out,
            "nearest scene that passes: {name} = {} instead of {}",
            with_unit(*value, choice.unit),
            with_unit(choice.value, choice.unit)
        );
    }
    for why in &shrunk.why {
        let _ = write!(out, "\n{why}");
    }
    out
}

fn scene_table(shrunk: &ShrunkSummary) -> String {
    let mut table = ruled();
    table.set_header(["object", "role", "x m", "y m", "yaw °", "moved cm"]);
    for object in &shrunk.run.objects {
        table.add_row([
            object.id.clone(),
            object.role.word().to_owned(),
            format!("{:.3}", object.x),
            format!("{:.3}", object.y),
            format!("{:.1}", object.yaw.to_degrees()),
            object.displacement_m.map_or_else(String::new, |moved| format!("{:.1}", moved * 100.0)),
        ]);
    }
    table.to_string()
}

fn choice_table(shrunk: &ShrunkSummary) -> String {
    let mut table = ruled();
    table.set_header(["choice", "value", "nominal", "needed", "fails from … to", "passes at"]);
    for choice in &shrunk.choices {
        let (low, high) = choice.fails;
        let passes: Vec<String> = [choice.passes.0, choice.passes.1].into_iter().flatten().map(number).collect();
        table.add_row([
            choice.name.clone(),
            with_unit(choice.value, choice.unit),
            number(choice.nominal),
            choice.matters.map_or("not tried", |matters| if matters { "yes" } else { "no" }).to_owned(),
            format!("{} … {}", number(low), number(high)),
            passes.join(", "),
        ]);
    }
    table.to_string()
}

fn number(value: f64) -> String {
    // Adding 0 turns negative zero into zero.
    let text = format!("{:.4}", value + 0.0);
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

fn with_unit(value: f64, unit: &str) -> String {
    format!("{} {unit}", number(value)).trim_end().to_owned()
}

/// Adds a column to a campaign's table: the id of the shrunk run, if the row's run was shrunk.
pub fn with_shrunk(mut table: Table, shrunk: &[ShrunkSummary]) -> Table {
    let of = table.columns.iter().position(|column| column == "run");
    table.columns.push("shrunk_to".to_owned());
    for row in &mut table.rows {
        let run = of.and_then(|of| row[of].as_str());
        let small = shrunk.iter().find(|one| run == Some(one.original.as_str()));
        row.push(small.map_or(Value::Null, |one| one.run.row.run.clone().into()));
    }
    table
}

/// Returns the shrunk run as JSON.
pub fn shrunk_json(shrunk: &ShrunkSummary) -> Value {
    let choices: Vec<Value> = shrunk
        .choices
        .iter()
        .map(|c| {
            json!({
                "name": c.name, "value": c.value, "nominal": c.nominal, "unit": c.unit, "needed": c.matters,
                "fails_from": c.fails.0, "fails_to": c.fails.1, "passes_below": c.passes.0, "passes_above": c.passes.1,
            })
        })
        .collect();
    let objects: Vec<Value> = shrunk
        .run
        .objects
        .iter()
        .map(|o| json!({"id": o.id, "role": o.role.word(), "x": o.x, "y": o.y, "yaw": o.yaw}))
        .collect();
    json!({
        "run": shrunk.run.row.run, "shrunk_from": shrunk.original, "failed": shrunk.failed,
        "others_before": shrunk.others_before, "others": shrunk.others(), "special_before": shrunk.special_before,
        "minimal": shrunk.minimal, "simulations": shrunk.simulations, "explaining_simulations": shrunk.explaining,
        "fresh_noise": shrunk.fresh.map(|(failures, of)| json!({"failed": failures, "of": of})),
        "noise_kept": shrunk.noise_kept, "objects": objects, "choices": choices,
        "nearest_passing": shrunk.neighbour.as_ref().map(|(name, value)| json!({"choice": name, "value": value})),
        "why": shrunk.why,
    })
}
