//! A campaign as quads: its configuration, its rules and models, and its end.

use oxigraph::model::{Literal, NamedNode, Quad};

use crate::statements::{Statements, count, iri, time};
use crate::{CampaignEnd, CampaignRecord};
use actcheck_base::{Outcome, names};

/// The position of a campaign in its history.
pub(super) const NUMBER: &str = "act:number";

/// A campaign's node.
pub(super) fn campaign_node(id: &str) -> NamedNode {
    NamedNode::new_unchecked(format!("{}{id}", names::CAMPAIGN))
}

/// The quads that are written before the first run. `number`: of campaigns that the history has
/// already.
pub(super) fn beginning(record: &CampaignRecord, number: u64) -> Vec<Quad> {
    let mut statements = Statements::default();
    let campaign = campaign_node(&record.id);
    statements
        .about(campaign.clone())
        .is_a("act:Campaign")
        .is_a("prov:Activity")
        .text("rdfs:label", &record.name)
        .text("act:configText", &record.config_text)
        .text("act:configDigest", &record.config_digest)
        .text("act:configPath", &record.config_path)
        .text("act:ontologyDigest", &record.ontology_digest)
        .has(NUMBER, count(number))
        .has("act:seed", count(record.seed))
        .has("act:plannedRuns", count(record.planned_runs))
        .has("act:repeat", count(u64::from(record.repeat)))
        .optional("act:timeBudget", record.time_secs.map(Literal::from))
        .optional("act:untilWidth", record.until_width.map(Literal::from))
        .optional("act:maxFailures", record.max_failures.map(count))
        .text("act:strategy", &record.strategy)
        .has("prov:startedAtTime", time(&record.started))
        .text("act:program", &program(&record.program_version))
        .text("act:programDigest", &record.program_digest)
        .has("act:physics", count(u64::from(record.physics)));
    if let Some(skill) = &record.skill {
        statements
            .about(campaign.clone())
            .text("act:skillCommand", &skill.command)
            .text("act:skillDigest", &skill.digest)
            .has("act:privileged", Literal::from(skill.privileged));
    }
    for shard in &record.shards {
        statements
            .about(campaign.clone())
            .text("act:shard", &shard.to_string());
    }
    for (number, (property, path, digest)) in record.rules.iter().enumerate() {
        let rule = NamedNode::new_unchecked(format!("{}/rule/{}", campaign.as_str(), number + 1));
        statements
            .about(campaign.clone())
            .has("act:usedRule", rule.clone());
        statements
            .about(rule)
            .is_a("act:UsedRule")
            .has("act:verifies", iri(property))
            .text("act:rulePath", path)
            .text("act:ruleDigest", digest);
    }
    for (number, found) in record.findings.iter().enumerate() {
        let finding =
            NamedNode::new_unchecked(format!("{}/finding/{}", campaign.as_str(), number + 1));
        statements
            .about(campaign.clone())
            .has("act:ruleFinding", finding.clone());
        statements
            .about(finding)
            .is_a("act:RuleFinding")
            .text("act:findingCode", &found.code)
            .text("act:findingText", &found.message)
            .optional(
                "act:findingPlace",
                found.place.as_deref().map(Literal::new_simple_literal),
            );
    }
    for (number, (name, digest)) in record.models.iter().enumerate() {
        let model = NamedNode::new_unchecked(format!("{}/model/{}", campaign.as_str(), number + 1));
        statements
            .about(campaign.clone())
            .has("act:usedModel", model.clone());
        statements
            .about(model)
            .is_a("act:UsedModel")
            .text("act:model", name)
            .text("act:digest", digest);
    }
    statements.quads
}

/// The quads that are written after the last run.
pub(super) fn end(id: &str, end: &CampaignEnd) -> Vec<Quad> {
    let mut statements = Statements::default();
    let mut about = statements.about(campaign_node(id));
    about
        .has("prov:endedAtTime", time(&end.ended))
        .optional("act:score", end.score.map(Literal::from))
        .optional(
            "act:scoreWithoutBroken",
            end.score_without_broken.map(Literal::from),
        )
        .has("act:discards", count(end.discards))
        .optional(
            "act:endedBy",
            end.ended_by.as_deref().map(Literal::new_simple_literal),
        )
        .has("act:interrupted", Literal::from(end.interrupted));
    for (outcome, times) in &end.outcomes {
        about.has(&format!("act:{outcome}Count"), count(*times));
    }
    statements.quads
}

/// All properties that [`end`] can write.
pub(super) fn end_properties() -> Vec<NamedNode> {
    let whole = CampaignEnd {
        score: Some(0.0),
        score_without_broken: Some(0.0),
        outcomes: Outcome::ALL
            .into_iter()
            .map(|outcome| (outcome, 0))
            .collect(),
        ended_by: Some(String::new()),
        ..CampaignEnd::default()
    };
    end("", &whole)
        .into_iter()
        .map(|quad| quad.predicate)
        .collect()
}

/// The program's name and version as one text.
pub(super) fn program(version: &str) -> String {
    format!("actcheck {version}")
}
