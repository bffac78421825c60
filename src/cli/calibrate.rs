//! `actcheck calibrate`

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Args;

use crate::labels::{self, Label};
use crate::margin_bounds::margin_bounds;
use crate::options::{Format, HistoryArgs};
use crate::{history_dir, output};
use actcheck_analysis::{LabelledRun, calibrate as calibrate_labels};
use actcheck_base::{Diagnostic, Diagnostics, Outcome, did_you_mean, names};
use actcheck_history::{History, Judgements, RunFilter, Wish};
use actcheck_ontology as ontology;
use actcheck_ontology::RuleLanguage;
use actcheck_report::{
    LabelSummary, LabelledProperty, MarginBound, labels_json, labels_table, labels_text,
};

/// `actcheck calibrate`
#[derive(Debug, Args)]
pub struct CalibrateArgs {
    /// The labels: a CSV file with the columns run, property and label (pass or fail)
    pub labels: PathBuf,
    /// The ontology whose rules have the limits [default: ontology/actions.ttl here, or the shipped
    /// one]
    #[arg(long, value_name = "FILE")]
    pub ontology: Option<PathBuf>,
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
    /// How it is printed
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: Format,
}

/// Compares outcomes with people's labels, and prints how well they agree. Returns the exit code.
pub fn calibrate(args: &CalibrateArgs) -> Result<u8, Diagnostics> {
    let (labels, faults) = labels::read(&args.labels)?;
    let history = history_dir::open_to_read(&args.history)?;
    let summary = LabelSummary {
        properties: compared(args, &history, labels, faults)?,
    };
    output::print(&match args.format {
        Format::Text => labels_text(&summary, output::page()),
        Format::Csv => labels_table(&summary).render(args.format.into(), output::page()),
        Format::Json => format!("{:#}\n", labels_json(&summary)),
    });
    Ok(summary.exit_code())
}

/// Finds the outcome of each label.
fn compared(
    args: &CalibrateArgs,
    history: &History,
    labels: Vec<Label>,
    mut faults: Diagnostics,
) -> Result<Vec<LabelledProperty>, Diagnostics> {
    // By run and property: whether it passed in all its actions, and its least margin.
    let mut known: BTreeMap<String, BTreeMap<String, (bool, Option<f64>)>> = BTreeMap::new();
    let wish = Wish {
        judgements: Judgements::Newest,
        ..Wish::default()
    };
    history.each_judged(&RunFilter::default(), wish, &mut |run| {
        let own = known.entry(run.row.run.clone()).or_default();
        for one in &run.outcomes {
            let passed = match one.outcome {
                Outcome::Passed => true,
                Outcome::Failed => false,
                _ => continue,
            };
            let found = own.entry(one.property.to_string()).or_insert((true, None));
            found.0 &= passed;
            found.1 = match (found.1, one.margin) {
                (Some(one), Some(other)) => Some(one.min(other)),
                (one, other) => one.or(other),
            };
        }
    })?;
    let mut runs: BTreeMap<String, Vec<LabelledRun>> = BTreeMap::new();
    for label in labels {
        let place = format!("{}, line {}", args.labels.display(), label.line);
        let Some(of_run) = known.get(&label.run) else {
            let help = did_you_mean(&label.run, known.keys().map(String::as_str));
            let message = format!("{place}: the history has no run `{}`", label.run);
            faults.push(Diagnostic::error("X097", message).help(help));
            continue;
        };
        let found = of_run
            .iter()
            .find(|(iri, _)| **iri == label.property || names::local(iri) == label.property);
        let Some((iri, (passed, margin))) = found else {
            let help = did_you_mean(&label.property, of_run.keys().map(|iri| names::local(iri)));
            let message = format!(
                "{place}: `{}` was not decided in run {}",
                label.property, label.run
            );
            faults.push(Diagnostic::error("X097", message).help(help));
            continue;
        };
        runs.entry(iri.clone()).or_default().push(LabelledRun {
            run: label.run,
            passed: *passed,
            margin: *margin,
            label: label.passes,
        });
    }
    let runs = faults.or(runs)?;
    let limits = limits(args, runs.keys());
    Ok(runs
        .into_iter()
        .map(|(iri, runs)| LabelledProperty {
            found: calibrate_labels(&runs),
            limit: limits.get(&iri).copied(),
            property: names::local(&iri).to_owned(),
        })
        .collect())
}

/// The limits in the rules of properties. An ontology that can't be read has none: they are only
/// for the words.
fn limits<'a>(
    args: &CalibrateArgs,
    properties: impl Iterator<Item = &'a String>,
) -> BTreeMap<String, MarginBound> {
    let (files, path) = crate::why::ontology_file(args.ontology.as_deref());
    let Ok(ontology) = ontology::load(&files, &path) else {
        return BTreeMap::new();
    };
    let of = |iri: &String| {
        let rule = &ontology.properties.get(iri)?.rule;
        let bounds = match rule.language {
            RuleLanguage::Datalog => margin_bounds(&rule.source),
            _ => Vec::new(),
        };
        let [only] = bounds[..] else { return None };
        Some((iri.clone(), only))
    };
    properties.filter_map(of).collect()
}
