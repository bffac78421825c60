//! A shrunk run for the terminal.

use std::fmt::Write as _;

use crate::ShrunkSummary;
use crate::text::{Page, fitted, ruled};
use actcheck_base::names;

/// Formats the shrunk scene, the choices that matter, and why it fails.
pub fn shrunk_text(shrunk: &ShrunkSummary, page: Page) -> String {
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
    let _ = write!(out, "\n{}", scene_table(shrunk, page));
    if shrunk.choices.is_empty() {
        let _ = writeln!(out, "it fails with every choice at its nominal value");
    } else {
        let _ = write!(out, "\n{}", choice_table(shrunk, page));
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
    page.set(&out)
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
            object.displacement_m.map_or_else(String::new, |moved| format!("{:.1}", moved * 100.0)),
        ]);
    }
    fitted(table, page, &["yaw °", "role"])
}

fn choice_table(shrunk: &ShrunkSummary, page: Page) -> String {
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
    fitted(table, page, &["passes at", "nominal", "needed"])
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
