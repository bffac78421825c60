//! Consistency of repeated scenes for the terminal.

use std::fmt::Write as _;

use crate::text::{Page, fitted, ruled};
use crate::{CampaignSummary, RepeatedProperty};
use actcheck_analysis::{PassPower, SceneCounts, Variance};

/// Maximum number of pass^k columns; the JSON has all.
const POWERS_SHOWN: usize = 5;

/// Maximum number of flaky scenes listed for each property; the JSON has all.
const SCENES_NAMED: usize = 6;

/// Writes the consistency of repeated scenes. Writes nothing if every scene was run once.
pub(super) fn repeated_text(out: &mut String, summary: &CampaignSummary, page: Page) {
    let repeated = summary.repeated();
    let most = repeated
        .iter()
        .map(|property| property.found.pass_powers.len())
        .max()
        .unwrap_or(0);
    if most == 0 {
        return;
    }
    let powers = shown_powers(most);
    let mut table = ruled();
    let header = ["property", "always passed", "always failed", "flaky"].map(str::to_owned);
    let of_powers: Vec<String> = powers
        .iter()
        .map(|k| format!("pass^{k} [95 % interval]"))
        .collect();
    let noise = "variance from noise";
    table.set_header(
        header
            .into_iter()
            .chain(of_powers.clone())
            .chain([noise.to_owned()]),
    );
    for RepeatedProperty { label, found, .. } in &repeated {
        let scenes = found.always_passed + found.always_failed + found.flaky.len() as u64;
        let of = |count: u64| format!("{count} of {scenes}");
        let head = [
            label.clone(),
            of(found.always_passed),
            of(found.always_failed),
            of(found.flaky.len() as u64),
        ];
        let power = |k: &u64| {
            found
                .pass_powers
                .iter()
                .find(|power| power.k == *k)
                .map_or_else(String::new, power_text)
        };
        table.add_row(
            head.into_iter()
                .chain(powers.iter().map(power))
                .chain([noise_share(found.outcome)]),
        );
    }
    // Powers between the first and the last one say least.
    let between = of_powers.iter().skip(1).rev().skip(1).map(String::as_str);
    let expendable: Vec<&str> = between
        .chain([noise, "always failed", "always passed"])
        .collect();
    out.push_str(&fitted(table, page, &expendable));
    let _ = writeln!(
        out,
        "pass^k: the probability that k runs of a scene, each with different noise, all pass\n\
         variance from noise: share of the outcomes' variance within scenes; the rest is between scenes"
    );
    repeated
        .iter()
        .for_each(|property| flaky(out, summary, property));
    out.push('\n');
}

/// The first values of k, and the last.
fn shown_powers(most: usize) -> Vec<u64> {
    (1..=most as u64)
        .filter(|k| *k < POWERS_SHOWN as u64 || *k == most as u64)
        .collect()
}

fn power_text(power: &PassPower) -> String {
    let interval = &power.probability;
    format!(
        "{:.0} % [{:.0}–{:.0}]",
        interval.rate * 100.0,
        interval.low * 100.0,
        interval.high * 100.0
    )
}

fn noise_share(variance: Option<Variance>) -> String {
    let share = variance.and_then(|variance| variance.noise_share());
    share.map_or_else(
        || "no variance".to_owned(),
        |share| format!("{:.0} %", share * 100.0),
    )
}

/// Writes the scenes in which a property only sometimes passes, each with its first run.
fn flaky(out: &mut String, summary: &CampaignSummary, property: &RepeatedProperty) {
    let scenes = &property.found.flaky;
    if scenes.is_empty() {
        return;
    }
    let named = scenes
        .iter()
        .take(SCENES_NAMED)
        .map(|SceneCounts { scene, passed, of }| {
            let run = summary
                .runs_of_scene(*scene)
                .next()
                .map_or("", |run| run.id.as_str());
            format!("{} ({passed} of {of} passed, from {run})", scene + 1)
        });
    let named: Vec<String> = named.collect();
    let rest = scenes.len().saturating_sub(SCENES_NAMED);
    let more = if rest > 0 {
        format!(" and {rest} more")
    } else {
        String::new()
    };
    let _ = writeln!(
        out,
        "  {}: flaky in scene {}{more}",
        property.label,
        named.join(", ")
    );
}
