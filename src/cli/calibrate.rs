//! `actcheck calibrate`

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;

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

/// The columns of the file.
const COLUMNS: [&str; 3] = ["run", "property", "label"];

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

/// A label, with its line in the file.
struct Label {
    run: String,
    property: String,
    passes: bool,
    line: usize,
}

/// Compares outcomes with people's labels, and prints how well they agree. Returns the exit code.
pub fn calibrate(args: &CalibrateArgs) -> Result<u8, Diagnostics> {
    let (labels, faults) = read(&args.labels)?;
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

/// Reads the labels. Returns also the faults of lines, so that those of the history are reported
/// with them.
fn read(path: &Path) -> Result<(Vec<Label>, Diagnostics), Diagnostics> {
    let unreadable = |why: String| {
        Diagnostic::error(
            "X097",
            format!("can't read the labels {}: {why}", path.display()),
        )
        .help(
            "write a CSV file: `run,property,label`, then lines such as `k7f3-3,MovedObject,pass`",
        )
    };
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_path(path)
        .map_err(|error| unreadable(error.to_string()))?;
    let head = reader
        .headers()
        .map_err(|error| unreadable(error.to_string()))?
        .clone();
    let column = |name: &str| {
        head.iter()
            .position(|own| own.trim_start_matches('\u{feff}') == name)
    };
    let [Some(run), Some(property), Some(label)] = COLUMNS.map(column) else {
        let missing: Vec<&str> = COLUMNS
            .into_iter()
            .filter(|name| column(name).is_none())
            .collect();
        return Err(unreadable(format!("line 1 has no column {}", missing.join(", "))).into());
    };
    let mut faults = Diagnostics::new();
    let mut labels = Vec::new();
    for record in reader.records() {
        let record = match record {
            Ok(record) => record,
            Err(error) => {
                faults.push(unreadable(error.to_string()));
                break;
            }
        };
        let line = record
            .position()
            .map_or(0, |at| usize::try_from(at.line()).unwrap_or(0));
        let of = |column: usize| record.get(column).unwrap_or_default().to_owned();
        let passes = match of(label).to_lowercase().as_str() {
            "pass" | "passed" | "true" | "yes" | "1" | "success" => true,
            "fail" | "failed" | "false" | "no" | "0" | "failure" => false,
            other => {
                let message = format!("{}, line {line}: the label is `{other}`", path.display());
                faults.push(Diagnostic::error("X097", message).help("write pass or fail"));
                continue;
            }
        };
        labels.push(Label {
            run: of(run),
            property: of(property),
            passes,
            line,
        });
    }
    if labels.is_empty() && faults.is_empty() {
        faults.push(unreadable("it has no labels".to_owned()));
    }
    Ok((labels, faults))
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
