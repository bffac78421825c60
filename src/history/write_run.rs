//! A run as quads: the run, its executions, its outcomes, and its facts in named graphs.

use std::collections::BTreeMap;

use oxigraph::model::{BlankNode, Literal, NamedNode, Quad};

use crate::RunRecord;
use crate::graphs::{below, during_graph, state_graph};
use crate::statements::{About, Statements, count, iri, time};
use crate::write_campaign::{campaign_node, program};
use crate::write_scene;
use actcheck_base::{Digest, Judgement, names};
use actcheck_data::{ActionEnd, ActionTrace};
use actcheck_facts::thing_iri;

/// A run's node.
pub(super) fn run_node(id: &str) -> NamedNode {
    NamedNode::new_unchecked(format!("{}{id}", names::RUN))
}

/// The quads of a run in the default graph.
pub(super) fn quads_without_facts(record: &RunRecord) -> Vec<Quad> {
    let run = run_node(&record.id);
    let mut statements = Statements::default();
    write_run(record, &run, &mut statements);
    write_discards(record, &run, &mut statements);
    write_scene::write(record, &run, &mut statements);
    for step in 0..record.trace.actions.len() {
        write_execution(record, step, &run, &mut statements);
    }
    statements.quads
}

fn write_run(record: &RunRecord, run: &NamedNode, statements: &mut Statements) {
    let mut about = statements.about(run.clone());
    about
        .is_a("act:Run")
        .is_a("prov:Activity")
        .has("act:campaign", campaign_node(&record.campaign))
        .text("act:test", &record.test)
        .has("act:seed", count(record.seed))
        .has("act:index", count(record.index))
        .optional(
            "act:sceneNumber",
            record.repetition.map(|repetition| count(repetition.scene)),
        )
        .optional(
            "act:repetition",
            record.repetition.map(|repetition| count(repetition.number)),
        )
        .optional("act:weight", record.weight.map(Literal::from))
        .has("act:score", Literal::from(record.score))
        .text("act:status", record.status.word())
        .text("act:traceHash", &record.trace.hash)
        .has("act:discards", count(record.discards.len() as u64))
        .optional(
            "act:reason",
            record.reason.as_deref().map(Literal::new_simple_literal),
        )
        .optional(
            "act:programOutput",
            record
                .program_output
                .as_deref()
                .map(Literal::new_simple_literal),
        )
        .optional(
            "act:shrunkFrom",
            record.shrunk_from.as_deref().map(run_node),
        )
        .has("prov:startedAtTime", time(&record.started))
        .has("act:wallSeconds", Literal::from(record.wall_secs))
        .has("act:elapsedSeconds", Literal::from(record.elapsed_secs))
        .optional(
            "act:deepestPenetration",
            record
                .quality
                .map(|quality| Literal::from(quality.deepest_penetration_m)),
        )
        .optional(
            "act:energyGain",
            record
                .quality
                .map(|quality| Literal::from(quality.energy_gain_j)),
        )
        .text("act:program", &program(env!("CARGO_PKG_VERSION")));
    write_designators(&record.scene.designators, record, &mut about);
}

/// Writes the scenes that were discarded before the run's own, so that their number survives
/// interrupting and resuming the campaign.
fn write_discards(record: &RunRecord, run: &NamedNode, statements: &mut Statements) {
    for (number, reason) in record.discards.iter().enumerate() {
        statements
            .about(below(run, &format!("discard/{}", number + 1)))
            .is_a("act:Discard")
            .has("act:ofRun", run.clone())
            .has("act:attempt", count(number as u64 + 1))
            .text("act:reason", reason);
    }
}

/// Writes designators: as an object if the scene has one of that name, otherwise as a text.
fn write_designators(
    designators: &BTreeMap<String, Vec<String>>,
    record: &RunRecord,
    about: &mut About<'_>,
) {
    for (designator, values) in designators {
        let property = names::act(designator);
        about.has("act:designator", iri(&property));
        for value in values {
            if record
                .scene
                .objects
                .iter()
                .any(|object| object.id == *value)
            {
                about.has(&property, iri(&thing_iri(value)));
            } else {
                about.text(&property, value);
            }
        }
    }
}

fn write_execution(record: &RunRecord, step: usize, run: &NamedNode, statements: &mut Statements) {
    let action = &record.trace.actions[step];
    let node = below(run, &(step + 1).to_string());
    let mut about = statements.about(node.clone());
    about
        .is_a("act:ActionExecution")
        .has("act:ofRun", run.clone())
        .optional(
            "act:action",
            record.actions.get(step).map(|action| iri(action)),
        )
        .has("act:step", Literal::from((step + 1) as u64))
        .optional(
            "act:score",
            record.action_scores.get(step).copied().map(Literal::from),
        )
        .text("act:end", end_word(&action.end))
        .has("act:duration", Literal::from(action.duration_secs))
        .optional(
            "act:reported",
            action
                .report
                .as_ref()
                .map(|report| Literal::from(report.succeeded)),
        )
        .optional(
            "act:message",
            message(action).map(Literal::new_simple_literal),
        );
    write_designators(&action.parameters, record, &mut about);
    for (property, state) in [("act:before", step), ("act:after", step + 1)] {
        if state < record.facts.snapshots.len() {
            about.has(property, state_graph(run, state));
        }
    }
    if record
        .facts
        .during
        .get(step)
        .is_some_and(|during| !during.is_empty())
    {
        about.has("act:during", during_graph(run, step));
    }
    for judgement in record.judgements.get(step).into_iter().flatten() {
        let result = unique(&[node.as_str(), &judgement.property, "result"]);
        write_assertion(
            judgement,
            &node,
            [assertion_of(&node, &judgement.property), result],
            statements,
        );
    }
}

/// The node of the campaign's own judgement of a property in an execution.
pub(super) fn assertion_of(execution: &NamedNode, property: &str) -> BlankNode {
    unique(&[execution.as_str(), property, "assertion"])
}

/// The word for how an action ended.
fn end_word(end: &ActionEnd) -> &'static str {
    match end {
        ActionEnd::Completed => "completed",
        ActionEnd::Broken(_) => "broken",
        ActionEnd::Timeout(_) | ActionEnd::Cut(_) => "timeout",
        ActionEnd::NotReached => "untested",
        ActionEnd::NotPerformed(_) => "inapplicable",
    }
}

/// The message of an action: why it did not complete, or the message of its report.
fn message(action: &ActionTrace) -> Option<&str> {
    match &action.end {
        ActionEnd::Broken(reason)
        | ActionEnd::Timeout(reason)
        | ActionEnd::Cut(reason)
        | ActionEnd::NotPerformed(reason) => Some(reason),
        ActionEnd::Completed | ActionEnd::NotReached => {
            action.report.as_ref().map(|report| report.message.as_str())
        }
    }
}

/// Writes a judgement as two nodes: the assertion and its result.
pub(super) fn write_assertion(
    judgement: &Judgement,
    execution: &NamedNode,
    [assertion, result]: [BlankNode; 2],
    statements: &mut Statements,
) {
    statements
        .about(assertion)
        .is_a("earl:Assertion")
        .has("earl:subject", execution.clone())
        .has("earl:test", iri(&judgement.property))
        .has("earl:mode", iri("earl:automatic"))
        .has("earl:result", result.clone());
    statements
        .about(result)
        .has(
            "earl:outcome",
            iri(&format!("earl:{}", judgement.outcome.earl())),
        )
        .text("act:outcome", judgement.outcome.word())
        .optional("act:margin", judgement.margin.map(Literal::from))
        .text("act:witness", &judgement.witness)
        .text("act:ruleDigest", &judgement.rule_digest)
        .optional("act:heldBefore", judgement.held_before.map(Literal::from))
        .optional("act:vacuous", judgement.vacuous.map(Literal::from));
}

/// A blank node whose label depends only on the texts.
pub(super) fn unique(texts: &[&str]) -> BlankNode {
    let mut digest = Digest::new();
    for text in texts {
        digest.update(text.as_bytes());
    }
    // A digest is 32 hexadecimal digits.
    BlankNode::new_from_unique_id(u128::from_str_radix(&digest.finish(), 16).unwrap_or_default())
}
