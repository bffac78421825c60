//! Records the outcomes of a run as a text document.

use std::fmt::Write as _;

use crate::Caption;
use crate::formats::plain;
use crate::html::Explained;
use actcheck_base::{Judgement, Outcome, names};
use actcheck_history::{ActionDetail, RunDetail};

/// Name of a recording.
pub(super) fn title(run: &RunDetail) -> String {
    Caption::of(run).title
}

/// Formats the outcomes of all properties with witness, margin and explanation (Markdown). Text of
/// models, rules and messages is escaped.
pub(super) fn document(run: &RunDetail, explained: &[Explained]) -> String {
    let caption = Caption::of(run);
    let mut out = format!("# {}\n", plain(&caption.title));
    if let Some(reason) = &run.reason {
        let _ = writeln!(out, "\n{}", plain(reason));
    }
    for (action, caption) in run.actions.iter().zip(&caption.actions) {
        let _ = writeln!(out, "\n## {}\n", plain(caption));
        for judgement in &action.judgements {
            judgement_text(&mut out, action, judgement, explained);
        }
    }
    out
}

fn judgement_text(
    out: &mut String,
    action: &ActionDetail,
    judgement: &Judgement,
    explained: &[Explained],
) {
    let (property, outcome) = (names::local(&judgement.property), judgement.outcome.word());
    let outcome = if judgement.outcome == Outcome::Passed {
        outcome.to_owned()
    } else {
        format!("**{outcome}**")
    };
    let _ = write!(out, "- {}: {outcome}", plain(property));
    if let Some(margin) = judgement.margin {
        let _ = write!(out, ", margin {margin:.4}");
    }
    if !judgement.witness.is_empty() {
        let _ = write!(out, ". {}", plain(&judgement.witness));
    }
    out.push('\n');
    let why = explained
        .iter()
        .find(|why| why.step == action.step && why.property == judgement.property);
    if let Some(why) = why {
        // Indented text is shown verbatim.
        out.push('\n');
        why.text.lines().for_each(|line| {
            let _ = writeln!(out, "      {line}");
        });
        out.push('\n');
    }
}
