//! One stored run for the terminal.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::text::{Page, fitted, ruled};
use actcheck_base::{Outcome, names};
use actcheck_history::{ActionDetail, ObjectDetail, Repetition, RunDetail};

/// Formats a run: its scene, the reports of its actions, and every outcome with margin and witness.
///
/// `perceived` are sentences about the perceived target, by the action's position in the test (from
/// 1).
pub fn run_text(run: &RunDetail, perceived: &BTreeMap<u32, String>, page: Page) -> String {
    let mut out = String::new();
    let row = &run.row;
    let _ = writeln!(
        out,
        "run {} ({}), {}, S = {:.2}",
        row.run,
        row.test,
        row.status.word(),
        row.score
    );
    if let Some(reason) = &run.reason {
        let _ = writeln!(out, "{}: {reason}", row.status.word());
    }
    if let Some(printed) = run
        .program_output
        .as_ref()
        .filter(|printed| !printed.is_empty())
    {
        let _ = writeln!(out, "the program printed last:");
        printed
            .lines()
            .for_each(|line| out.push_str(&format!("  {line}\n")));
    }
    let _ = writeln!(
        out,
        "campaign {}, run {} of it, seed {}, started {}, {:.2} s of wall time, actcheck {}",
        row.campaign,
        row.index + 1,
        run.seed,
        row.started,
        run.wall_secs,
        run.program_version
    );
    if let Some(Repetition { scene, number }) = row.repetition {
        let _ = writeln!(out, "run {} of scene {}", number + 1, scene + 1);
    }
    if let Some(weight) = row.weight {
        let _ = writeln!(
            out,
            "importance weight {weight:.3}: a search chose the scene"
        );
    }
    let _ = writeln!(out, "trace {}", row.trace_hash);
    for (designator, values) in &run.designators {
        let _ = writeln!(out, "{designator} = {}", values.join(", "));
    }
    out.push('\n');
    scene(&mut out, run, page);
    for action in &run.actions {
        action_text(&mut out, action, &own_values(action, run), page);
        if let Some(sentence) = perceived.get(&action.step) {
            let _ = writeln!(out, "{sentence}");
        }
    }
    page.set(&out)
}

fn scene(out: &mut String, run: &RunDetail, page: Page) {
    let mut table = ruled();
    table.set_header([
        "object",
        "category",
        "role",
        "x m",
        "y m",
        "yaw °",
        "mass kg",
        "friction",
        "moved cm",
        "max tilt °",
    ]);
    for object in &run.objects {
        table.add_row(object_row(object));
    }
    out.push_str(&fitted(
        table,
        page,
        &[
            "friction",
            "mass kg",
            "max tilt °",
            "yaw °",
            "role",
            "category",
        ],
    ));
    let [x, y, heading] = run.robot_base;
    let _ = writeln!(
        out,
        "robot at x {x:.3} m, y {y:.3} m, heading {:.1}°",
        heading.to_degrees()
    );
}

fn object_row(object: &ObjectDetail) -> Vec<String> {
    let number = |value: Option<f64>, factor: f64, decimals: usize| {
        value.map_or_else(String::new, |value| {
            format!("{:.decimals$}", value * factor)
        })
    };
    vec![
        object.id.clone(),
        names::local(&object.category).to_owned(),
        object.role.word().to_owned(),
        format!("{:.3}", object.x),
        format!("{:.3}", object.y),
        format!("{:.1}", object.yaw.to_degrees()),
        format!("{:.3}", object.mass_kg),
        format!("{:.2}", object.friction),
        number(object.displacement_m, 100.0, 2),
        number(object.max_tilt_rad, 180.0 / std::f64::consts::PI, 1),
    ]
}

/// The designators that have other values in an action than in the scene, as
/// ` with pickObject = can_1`.
fn own_values(action: &ActionDetail, run: &RunDetail) -> String {
    let own = action.parameters.iter().filter(|(name, values)| {
        run.designators
            .get(*name)
            .is_some_and(|of_scene| of_scene != *values)
    });
    let own: Vec<String> = own
        .map(|(name, values)| format!("{name} = {}", values.join(", ")))
        .collect();
    if own.is_empty() {
        String::new()
    } else {
        format!(" with {}", own.join("; "))
    }
}

fn action_text(out: &mut String, action: &ActionDetail, own_values: &str, page: Page) {
    let reported = match action.reported {
        Some(true) => "reported success",
        Some(false) => "reported failure",
        None => "reported nothing",
    };
    let message = action
        .message
        .as_deref()
        .map_or_else(String::new, |message| format!(": {message}"));
    let reported = if action.end == Outcome::Inapplicable.word() {
        "not performed"
    } else {
        reported
    };
    let _ = writeln!(
        out,
        "\n{}. {}{own_values}: {}, {:.1} s simulated, A = {:.2}, {reported}{message}",
        action.step,
        names::local(&action.action),
        action.end,
        action.duration_secs,
        action.score
    );
    let mut table = ruled();
    table.set_header(["property", "outcome", "margin", "witness"]);
    for judgement in &action.judgements {
        let margin = judgement
            .margin
            .map_or_else(String::new, |margin| format!("{margin:+.4}"));
        table.add_row([
            names::local(&judgement.property).to_owned(),
            match (judgement.held_before, judgement.vacuous) {
                (Some(true), _) => format!("{}, held before", judgement.outcome),
                (_, Some(true)) => format!("{}, vacuously", judgement.outcome),
                _ => judgement.outcome.word().to_owned(),
            },
            margin,
            judgement.witness.clone(),
        ]);
    }
    out.push_str(&fitted(table, page, &["margin"]));
}
