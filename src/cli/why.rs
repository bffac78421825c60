//! `actcheck why`

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::args::WhyArgs;
use crate::datalog::rendered;
use crate::{history_dir, output};
use actcheck_base::{Diagnostic, Diagnostics, Files, did_you_mean, names};
use actcheck_history::{ActionDetail, RunDetail};
use actcheck_ontology as ontology;
use actcheck_rules::{Budget, RuleBook};

/// Prints, for each requested outcome of a run, the proof that the property holds or how close it came.
pub fn why(args: &WhyArgs, stop: &Arc<AtomicBool>) -> Result<(), Diagnostics> {
    let budget = Budget { stop: Arc::clone(stop), ..Budget::default() };
    let history = history_dir::open_to_read(&args.history)?;
    let run = history.run(&args.run)?;
    let facts = history.facts(&run.row.run)?;
    let (files, path) = ontology_file(args.ontology.as_deref());
    let rules = RuleBook::prepare_within(&ontology::load(&files, &path)?, &budget)?;
    let mut told = 0;
    for (step, action) in run.actions.iter().enumerate() {
        let Some(seen) = facts.action(step) else { continue };
        for property in asked(action, args.property.as_deref()) {
            let title = format!("{} {}, {}", run.row.run, names::local(&action.action), names::local(&property));
            let explained = rules.explain(&seen, &property, &budget);
            let explained = explained.map_err(|fault| Diagnostic::error("X008", format!("{title}: {fault}")))?;
            if args.format == crate::args::ProofFormat::Text {
                output::print(&format!("{title}\n"));
            }
            output::print(&format!("{}\n", rendered(&explained, args.format)));
            told += 1;
        }
    }
    if told == 0 { Err(nothing_to_tell(&run, args.property.as_deref()).into()) } else { Ok(()) }
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
fn asked(action: &ActionDetail, named: Option<&str>) -> Vec<String> {
    let all = action.judgements.iter().map(|judgement| judgement.property.clone());
    all.filter(|iri| named.is_none_or(|named| names::local(iri) == named || iri == named)).collect()
}

fn nothing_to_tell(run: &RunDetail, named: Option<&str>) -> Diagnostic {
    let judged: Vec<&str> = run
        .actions
        .iter()
        .flat_map(|action| &action.judgements)
        .map(|judgement| names::local(&judgement.property))
        .collect();
    match named {
        Some(named) if !judged.contains(&named) => {
            Diagnostic::error("X009", format!("no property `{named}` was judged in run {}", run.row.run))
                .help(did_you_mean(named, judged))
        }
        _ => Diagnostic::error("X009", format!("run {} has no facts to explain", run.row.run))
            .help("it broke before its first action; `actcheck show` shows the reason"),
    }
}
