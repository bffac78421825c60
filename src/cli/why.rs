//! `actcheck why`

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::Args;

use crate::options::{HistoryArgs, ProofFormat};
use crate::trust::TrustArgs;
use crate::{explanations, history_dir, output, restore, show};
use actcheck_base::{
    Diagnostic, Diagnostics, Files, Findings, Judgement, Outcome, did_you_mean, names,
};
use actcheck_history::{ActionDetail, RunDetail};
use actcheck_ontology as ontology;
use actcheck_report::{Table, TableFormat};
use actcheck_rules::{Budget, RuleBook};

/// `actcheck why`
#[derive(Debug, Args)]
pub struct WhyArgs {
    /// Id of the run, or a unique prefix
    pub run: String,
    /// Only this property, by its name in the ontology [default: all that were judged]
    pub property: Option<String>,
    /// The ontology with the rules [default: ontology/actions.ttl here, or the shipped one]
    #[arg(long, value_name = "FILE")]
    pub ontology: Option<PathBuf>,
    /// The folder of the history.
    #[command(flatten)]
    pub history: HistoryArgs,
    /// The consent to start programs.
    #[command(flatten)]
    pub trust: TrustArgs,
    /// How explanations are printed
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: ProofFormat,
}

/// Prints, for each requested outcome of a run, the proof that the property holds or how close it
/// came.
pub fn why(args: &WhyArgs, stop: &Arc<AtomicBool>) -> Result<(), Diagnostics> {
    let budget = Budget {
        stop: Arc::clone(stop),
        ..Budget::default()
    };
    let history = history_dir::open_to_read(&args.history)?;
    restore::allow(&history, args.trust.trust);
    let run = history.newest_run(&args.run)?;
    let (files, path) = ontology_file(args.ontology.as_deref());
    let rules = RuleBook::prepare_within(&ontology::load(&files, &path)?, &budget)?;
    // Without its motion, properties about time can't be explained, but the others can.
    let facts = history
        .traces()
        .allowed_facts(&run.row.run, rules.reads_course())?;
    let perceived = show::perceived(&history, &run)?;
    let mut told = 0;
    let mut table = Table::new([
        "run",
        "step",
        "action",
        "property",
        "holds",
        "margin",
        "explanation",
    ]);
    for (step, action) in run.actions.iter().enumerate() {
        let Some(seen) = facts.action(step) else {
            continue;
        };
        for property in asked(action, args) {
            let title = format!(
                "{} {}, {}",
                run.row.run,
                names::local(&action.action),
                names::local(&property)
            );
            let explained = rules.explain(&seen, &property, &budget);
            let mut explained = explained
                .map_err(|fault| Diagnostic::error("X008", format!("{title}: {fault}")))?;
            explained
                .notes
                .extend(differs(action, &property, explained.findings.as_ref()));
            let columns = [
                run.row.run.as_str(),
                &(step + 1).to_string(),
                &action.action,
                &property,
            ];
            match args.format {
                ProofFormat::Csv => table.rows.push(explanations::row(&columns, &explained)),
                ProofFormat::Text => {
                    output::print_prose(&format!("{title}\n{}\n", explained.to_text()))
                }
                ProofFormat::Json => output::print(&format!("{:#}\n\n", explained.to_json())),
                ProofFormat::Dot => output::print(&format!("{}\n", explained.to_dot())),
            }
            told += 1;
        }
        let failed = |judgement: &Judgement| {
            judgement.outcome == Outcome::Failed && is_asked(judgement, args)
        };
        if let Some(sentence) = perceived.get(&action.step)
            && args.format == ProofFormat::Text
            && action.judgements.iter().any(failed)
        {
            output::print_prose(&format!(
                "{} {}: {sentence}\n",
                run.row.run,
                names::local(&action.action)
            ));
        }
    }
    if args.format == ProofFormat::Csv && told > 0 {
        output::print(&table.render(TableFormat::Csv, output::page()));
    }
    if told == 0 {
        Err(nothing_to_tell(&run, args.property.as_deref()).into())
    } else {
        Ok(())
    }
}

/// The named ontology, else the one in this folder, else the shipped one.
pub(super) fn ontology_file(named: Option<&Path>) -> (Files, PathBuf) {
    const USUAL: &str = "ontology/actions.ttl";
    match named {
        Some(path) => (Files::Disk, path.to_owned()),
        None if Path::new(USUAL).is_file() => (Files::Disk, PathBuf::from(USUAL)),
        None => (Files::Shipped, PathBuf::from(USUAL)),
    }
}

/// The requested properties of an action: the named one, or all that were judged.
fn asked(action: &ActionDetail, args: &WhyArgs) -> Vec<String> {
    let all = action
        .judgements
        .iter()
        .filter(|judgement| is_asked(judgement, args));
    all.map(|judgement| judgement.property.clone()).collect()
}

/// Returns a remark if the run was judged otherwise than the current rules judge it.
fn differs(action: &ActionDetail, property: &str, found: Option<&Findings>) -> Option<String> {
    let recorded = action
        .judgements
        .iter()
        .find(|judgement| judgement.property == property)?
        .outcome;
    let current = found?.outcome();
    let decided = matches!(recorded, Outcome::Passed | Outcome::Failed) && recorded != current;
    decided.then(|| {
        let (recorded, current) = (recorded.word(), current.word());
        format!("the run was judged as {recorded}; by the current rules and ontology it is {current} (see `actcheck recheck`)")
    })
}

fn is_asked(judgement: &Judgement, args: &WhyArgs) -> bool {
    let iri = &judgement.property;
    args.property
        .as_ref()
        .is_none_or(|named| names::local(iri) == named || iri == named)
}

fn nothing_to_tell(run: &RunDetail, named: Option<&str>) -> Diagnostic {
    let judged: Vec<&str> = run
        .actions
        .iter()
        .flat_map(|action| &action.judgements)
        .map(|judgement| names::local(&judgement.property))
        .collect();
    match named {
        Some(named) if !judged.contains(&named) => Diagnostic::error(
            "X009",
            format!("no property `{named}` was judged in run {}", run.row.run),
        )
        .help(did_you_mean(named, judged)),
        _ => Diagnostic::error(
            "X009",
            format!("run {} has no facts to explain", run.row.run),
        )
        .help("it broke before its first action; `actcheck show` shows the reason"),
    }
}
