//! A run as quads: the run, its executions, its outcomes, and its facts in named graphs.

use std::collections::BTreeMap;

use oxigraph::model::{BlankNode, Literal, NamedNode, Quad};

use crate::graphs::{below, during_graph, state_graph};
use crate::statements::{About, Statements, count, iri, time};
use crate::stored_run::StoredRun;
use crate::write_campaign::{campaign_node, program};
use crate::write_scene;
use actcheck_base::{Digest, Judgement, names};
use actcheck_facts::thing_iri;

/// A run's node.
pub(super) fn run_node(id: &str) -> NamedNode {
    NamedNode::new_unchecked(format!("{}{id}", names::RUN))
}

/// The quads of a run of a campaign in the default graph.
pub(super) fn quads_without_facts(stored: &StoredRun, campaign: &str) -> Vec<Quad> {
    let run = run_node(&stored.id_in(campaign));
    let mut statements = Statements::default();
    write_run(stored, campaign, &run, &mut statements);
    write_discards(stored, &run, &mut statements);
    write_scene::write(&stored.scene, &run, &mut statements);
    for step in 0..stored.actions.len() {
        write_execution(stored, step, &run, &mut statements);
    }
    statements.quads
}

fn write_run(stored: &StoredRun, campaign: &str, run: &NamedNode, statements: &mut Statements) {
    let mut about = statements.about(run.clone());
    about
        .is_a("act:Run")
        .is_a("prov:Activity")
        .has("act:campaign", campaign_node(campaign))
        .text("act:test", &stored.test)
        .has("act:seed", count(stored.seed))
        .has("act:index", count(stored.index))
        .optional(
            "act:sceneNumber",
            stored.repetition.map(|repetition| count(repetition.scene)),
        )
        .optional(
            "act:repetition",
            stored.repetition.map(|repetition| count(repetition.number)),
        )
        .optional("act:weight", stored.weight.map(Literal::from))
        .has("act:score", Literal::from(stored.score))
        .text("act:status", stored.status.word())
        .text("act:traceHash", &stored.trace_hash)
        .has("act:discards", count(stored.discards.len() as u64))
        .optional(
            "act:reason",
            stored.reason.as_deref().map(Literal::new_simple_literal),
        )
        .optional(
            "act:programOutput",
            stored
                .program_output
                .as_deref()
                .map(Literal::new_simple_literal),
        )
        .optional(
            "act:shrunkFrom",
            stored.shrunk_from.as_deref().map(run_node),
        )
        .has("prov:startedAtTime", time(&stored.started))
        .has("act:wallSeconds", Literal::from(stored.wall_secs))
        .has("act:elapsedSeconds", Literal::from(stored.elapsed_secs))
        .optional(
            "act:deepestPenetration",
            stored
                .quality
                .map(|quality| Literal::from(quality.deepest_penetration_m)),
        )
        .optional(
            "act:energyGain",
            stored
                .quality
                .map(|quality| Literal::from(quality.energy_gain_j)),
        )
        .text("act:program", &program(&stored.program_version));
    write_designators(&stored.scene.designators, stored, &mut about);
}

/// Writes the scenes that were discarded before the run's own, so that their number survives
/// interrupting and resuming the campaign.
fn write_discards(stored: &StoredRun, run: &NamedNode, statements: &mut Statements) {
    for (number, reason) in stored.discards.iter().enumerate() {
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
    stored: &StoredRun,
    about: &mut About<'_>,
) {
    for (designator, values) in designators {
        let property = names::act(designator);
        about.has("act:designator", iri(&property));
        for value in values {
            if stored
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

fn write_execution(stored: &StoredRun, step: usize, run: &NamedNode, statements: &mut Statements) {
    let action = &stored.actions[step];
    let node = below(run, &(step + 1).to_string());
    let mut about = statements.about(node.clone());
    about
        .is_a("act:ActionExecution")
        .has("act:ofRun", run.clone())
        .optional("act:action", action.action.as_deref().map(iri))
        .has("act:step", Literal::from((step + 1) as u64))
        .optional("act:score", action.score.map(Literal::from))
        .text("act:end", &action.end)
        .has("act:duration", Literal::from(action.duration_secs))
        .optional("act:reported", action.reported.map(Literal::from))
        .optional(
            "act:message",
            action.message.as_deref().map(Literal::new_simple_literal),
        );
    write_designators(&action.parameters, stored, &mut about);
    for (property, state) in [("act:before", step), ("act:after", step + 1)] {
        if state < stored.states as usize {
            about.has(property, state_graph(run, state));
        }
    }
    if action.has_events {
        about.has("act:during", during_graph(run, step));
    }
    for judgement in &action.judgements {
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
