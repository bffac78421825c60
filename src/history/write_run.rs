//! A run as statements: the run, its executions, and its outcomes.

use std::collections::BTreeMap;

use oxigraph::model::{BlankNode, NamedNode};

use crate::graphs::{below, during_graph, state_graph};
use crate::segment::LaterJudgement;
use crate::statements::{About, Statements, Value, iri};
use crate::stored_run::StoredRun;
use crate::write_campaign::{campaign_node, program};
use crate::write_scene;
use actcheck_base::{Digest, Judgement, names};
use actcheck_facts::thing_iri;

/// A run's node.
pub(super) fn run_node(id: &str) -> NamedNode {
    NamedNode::new_unchecked(format!("{}{id}", names::RUN))
}

/// The graph of judgements made after the run.
pub(super) const RECHECKED: &str = "act:rechecked";

/// Writes the statements about a run of a campaign in the default graph.
pub(super) fn write(stored: &StoredRun, campaign: &str, statements: &mut Statements<'_>) {
    let run = run_node(&stored.id_in(campaign));
    write_run(stored, campaign, &run, statements);
    write_discards(stored, &run, statements);
    write_scene::write(&stored.scene, &run, statements);
    for step in 0..stored.actions.len() {
        write_execution(stored, step, &run, statements);
    }
}

/// Writes the judgements made after a run, all of them in the order in which they were made, into
/// the graph [`RECHECKED`]. Each supersedes the one before it of the same action and property.
pub(super) fn write_later(
    stored: &StoredRun,
    campaign: &str,
    later: &[&LaterJudgement],
    statements: &mut Statements<'_>,
) {
    let run = run_node(&stored.id_in(campaign));
    let mut newest: BTreeMap<(u32, &str), BlankNode> = BTreeMap::new();
    for (step, action) in (1..).zip(&stored.actions) {
        let node = below(&run, &step.to_string());
        newest.extend(action.judgements.iter().map(|own| {
            let property = own.property.as_str();
            ((step, property), assertion_of(&node, property))
        }));
    }
    for LaterJudgement {
        step,
        at,
        judgement,
        ..
    } in later
    {
        let node = below(&run, &step.to_string());
        let property = judgement.property.as_str();
        let before = newest.remove(&(*step, property));
        // Two of the same second have different predecessors, so that their nodes differ.
        let label = before.as_ref().map(ToString::to_string).unwrap_or_default();
        let of = |part| unique(&[node.as_str(), property, part, at, &label]);
        let assertion = of("recheck");
        let nodes = [assertion.clone(), of("recheck result")];
        write_assertion(judgement, &node, nodes, statements);
        statements
            .about(assertion.clone())
            .has("act:recheckedAt", Value::Time(at))
            .optional("act:supersedes", before);
        newest.insert((*step, property), assertion);
    }
}

fn write_run(stored: &StoredRun, campaign: &str, run: &NamedNode, statements: &mut Statements<'_>) {
    let mut about = statements.about(run.clone());
    about
        .is_a("act:Run")
        .is_a("prov:Activity")
        .has("act:campaign", campaign_node(campaign))
        .has("act:test", stored.test.as_str())
        .has("act:seed", stored.seed)
        .has("act:index", stored.index)
        .optional(
            "act:sceneNumber",
            stored.repetition.map(|repetition| repetition.scene),
        )
        .optional(
            "act:repetition",
            stored.repetition.map(|repetition| repetition.number),
        )
        .optional("act:weight", stored.weight)
        .has("act:score", stored.score)
        .has("act:status", stored.status.word())
        .has("act:traceHash", stored.trace_hash.as_str())
        .has("act:discards", stored.discards.len() as u64)
        .optional("act:reason", stored.reason.as_deref())
        .optional("act:programOutput", stored.program_output.as_deref())
        .optional(
            "act:shrunkFrom",
            stored.shrunk_from.as_deref().map(run_node),
        )
        .has("prov:startedAtTime", Value::Time(&stored.started))
        .has("act:wallSeconds", stored.wall_secs)
        .has("act:elapsedSeconds", stored.elapsed_secs)
        .optional(
            "act:deepestPenetration",
            stored.quality.map(|quality| quality.deepest_penetration_m),
        )
        .optional(
            "act:energyGain",
            stored.quality.map(|quality| quality.energy_gain_j),
        )
        .has("act:program", program(&stored.program_version).as_str());
    if let Some(episode) = &stored.episode {
        let about = about
            .has("act:episodeFile", episode.file.as_str())
            .has("act:episodeDigest", episode.digest.as_str());
        let stated = |name: &str| episode.about.get(name).map(String::as_str);
        about
            .optional("act:engine", stated("engine"))
            .optional("act:engineVersion", stated("engine_version"))
            .optional("act:environment", stated("environment"))
            .optional("act:taskText", stated("task"));
    }
    write_designators(&stored.scene.designators, stored, &mut about);
}

/// Writes the scenes that were discarded before the run's own, so that their number survives
/// interrupting and resuming the campaign.
fn write_discards(stored: &StoredRun, run: &NamedNode, statements: &mut Statements<'_>) {
    for (number, reason) in stored.discards.iter().enumerate() {
        statements
            .about(below(run, &format!("discard/{}", number + 1)))
            .is_a("act:Discard")
            .has("act:ofRun", run.clone())
            .has("act:attempt", number as u64 + 1)
            .has("act:reason", reason.as_str());
    }
}

/// Writes designators: as an object if the scene has one of that name, otherwise as a text.
fn write_designators(
    designators: &BTreeMap<String, Vec<String>>,
    stored: &StoredRun,
    about: &mut About<'_, '_>,
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
                about.has(&property, value.as_str());
            }
        }
    }
}

fn write_execution(
    stored: &StoredRun,
    step: usize,
    run: &NamedNode,
    statements: &mut Statements<'_>,
) {
    let action = &stored.actions[step];
    let node = below(run, &(step + 1).to_string());
    let mut about = statements.about(node.clone());
    about
        .is_a("act:ActionExecution")
        .has("act:ofRun", run.clone())
        .optional("act:action", action.action.as_deref().map(iri))
        .has("act:step", (step + 1) as u64)
        .optional("act:score", action.score)
        .has("act:end", action.end.as_str())
        .has("act:duration", action.duration_secs)
        .optional("act:reported", action.reported)
        .optional("act:message", action.message.as_deref());
    write_designators(&action.parameters, stored, &mut about);
    for (property, state) in [("act:before", step), ("act:after", step + 1)] {
        if state < stored.states as usize {
            about.has(property, state_graph(run, state));
        }
    }
    if action.has_events {
        about.has("act:during", during_graph(run, step));
    }
    if !statements.wants(&OF_ASSERTIONS) {
        return;
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
fn assertion_of(execution: &NamedNode, property: &str) -> BlankNode {
    unique(&[execution.as_str(), property, "assertion"])
}

/// All properties of assertions and their results in the default graph.
const OF_ASSERTIONS: [&str; 12] = [
    "rdf:type",
    "earl:subject",
    "earl:test",
    "earl:mode",
    "earl:result",
    "earl:outcome",
    "act:outcome",
    "act:margin",
    "act:witness",
    "act:ruleDigest",
    "act:heldBefore",
    "act:vacuous",
];

/// Writes a judgement as two nodes: the assertion and its result.
fn write_assertion(
    judgement: &Judgement,
    execution: &NamedNode,
    [assertion, result]: [BlankNode; 2],
    statements: &mut Statements<'_>,
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
        .has("act:outcome", judgement.outcome.word())
        .optional("act:margin", judgement.margin)
        .has("act:witness", judgement.witness.as_str())
        .has("act:ruleDigest", judgement.rule_digest.as_str())
        .optional("act:heldBefore", judgement.held_before)
        .optional("act:vacuous", judgement.vacuous);
}

/// A blank node whose label depends only on the texts.
fn unique(texts: &[&str]) -> BlankNode {
    let mut digest = Digest::new();
    for text in texts {
        digest.update(text.as_bytes());
    }
    // A digest is 32 hexadecimal digits.
    BlankNode::new_from_unique_id(u128::from_str_radix(&digest.finish(), 16).unwrap_or_default())
}
