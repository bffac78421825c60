//! A shrunk run for the terminal.

use std::fmt::Write as _;

use crate::text::{Page, fitted, ruled};
use crate::{PassingValue, ShrunkChoice, ShrunkSummary};
use actcheck_base::names;

/// Formats the shrunk scene, the choices that matter, and why it fails.
pub fn shrunk_text(shrunk: &ShrunkSummary, page: Page) -> String {
    let mut out = String::new();
    let failed: Vec<&str> = shrunk.failed.iter().map(|iri| names::local(iri)).collect();
    let _ = writeln!(
        out,
        "{}: the smallest scene found that fails like {}",
        shrunk.run.row.run, shrunk.original
    );
    let _ = writeln!(out, "fails {}", failed.join(" + "));
    let end = if shrunk.minimal {
        "nothing more can be removed"
    } else {
        "stopped at a limit: it may not be minimal"
    };
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
        let _ = writeln!(
            out,
            "with fresh noise it fails in {failures} of {of} repetitions"
        );
    }
    if shrunk.noise_kept {
        let _ = writeln!(
            out,
            "with fresh noise the run does not fail often enough: its recorded noise is kept"
        );
    }
    let _ = write!(out, "\n{}", scene_table(shrunk, page));
    if shrunk.choices.is_empty() {
        let _ = writeln!(out, "it fails with every choice at its nominal value");
    } else {
        let _ = write!(out, "\n{}", choice_table(shrunk, page));
        passing(&mut out, shrunk);
    }
    for why in &shrunk.why {
        let _ = write!(out, "\n{why}");
    }
    page.set(&out)
}

/// Writes the meaning of a pass, and the nearest scene that passes.
fn passing(out: &mut String, shrunk: &ShrunkSummary) {
    let passes = shrunk
        .property
        .as_deref()
        .map_or("everything", names::local);
    let _ = writeln!(
        out,
        "passes at: with this value alone changed, the run was repeated and {passes} passed"
    );
    for choice in &shrunk.choices {
        for PassingValue { value, others } in passes_of(choice).filter(|at| !at.others.is_empty()) {
            let value = with_unit(*value, choice.unit);
            let _ = writeln!(
                out,
                "at {} = {value}, {} fails there",
                choice.name,
                others.join(" + ")
            );
        }
    }
    match &shrunk.neighbour {
        Some((name, at)) => {
            let choice = shrunk.choices.iter().find(|choice| choice.name == *name);
            let unit = choice.map_or("", |choice| choice.unit);
            let instead = choice.map_or_else(String::new, |choice| with_unit(choice.value, unit));
            let value = with_unit(at.value, unit);
            let _ = writeln!(
                out,
                "nearest scene that passes: {name} = {value} instead of {instead}"
            );
        }
        None => {
            let _ = writeln!(
                out,
                "no scene that passes was found by changing one of these within the trials: where the run no longer \
                 fails like this, it fails in another way or does not complete"
            );
        }
    }
}

fn passes_of(choice: &ShrunkChoice) -> impl Iterator<Item = &PassingValue> {
    [&choice.passes.0, &choice.passes.1].into_iter().flatten()
}

fn scene_table(shrunk: &ShrunkSummary, page: Page) -> String {
    let mut table = ruled();
    table.set_header(["object", "role", "x m", "y m", "yaw °", "moved cm"]);
    for object in &shrunk.run.objects {
        table.add_row([
            object.id.clone(),
            object.role.word().to_owned(),
            format!("{:.3}", object.x),
            format!("{:.3}", object.y),
            format!("{:.1}", object.yaw.to_degrees()),
            object
                .displacement_m
                .map_or_else(String::new, |moved| format!("{:.1}", moved * 100.0)),
        ]);
    }
    fitted(table, page, &["yaw °", "role"])
}

fn choice_table(shrunk: &ShrunkSummary, page: Page) -> String {
    let mut table = ruled();
    table.set_header([
        "choice",
        "value",
        "nominal",
        "needed",
        "fails from … to",
        "passes at",
    ]);
    for choice in &shrunk.choices {
        let (low, high) = choice.fails;
        let passes: Vec<String> = passes_of(choice).map(|at| number(at.value)).collect();
        table.add_row([
            choice.name.clone(),
            with_unit(choice.value, choice.unit),
            number(choice.nominal),
            choice
                .matters
                .map_or("not tried", |matters| if matters { "yes" } else { "no" })
                .to_owned(),
            format!("{} … {}", number(low), number(high)),
            if passes.is_empty() {
                "none found".to_owned()
            } else {
                passes.join(", ")
            },
        ]);
    }
    fitted(table, page, &["passes at", "nominal", "needed"])
}

/// Writes a number with up to four decimals, or with all of them if it is not exactly such a
/// number: the value that is printed is the one that was tried.
fn number(value: f64) -> String {
    // Adding 0 turns negative zero into zero.
    let text = format!("{:.4}", value + 0.0);
    if text.parse::<f64>() != Ok(value + 0.0) {
        return (value + 0.0).to_string();
    }
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" {
        "0".to_owned()
    } else {
        text.to_owned()
    }
}

fn with_unit(value: f64, unit: &str) -> String {
    format!("{} {unit}", number(value)).trim_end().to_owned()
}
