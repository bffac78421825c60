//! A campaign as statements: its configuration, its rules and models, and its end.

use oxigraph::model::NamedNode;

use crate::campaign_state::CampaignState;
use crate::statements::{Statements, Value, iri};
use crate::{CampaignEnd, CampaignRecord};
use actcheck_base::names;

/// A campaign's node.
pub(super) fn campaign_node(id: &str) -> NamedNode {
    NamedNode::new_unchecked(format!("{}{id}", names::CAMPAIGN))
}

/// Writes the statements about a campaign.
pub(super) fn write(state: &CampaignState, statements: &mut Statements<'_>) {
    write_record(&state.record, statements);
    let mut about = statements.about(campaign_node(&state.record.id));
    about
        .has("act:number", state.number)
        .optional("act:firstId", state.first_id.as_deref());
    if let Some(end) = &state.end {
        write_end(&state.record.id, end, statements);
    }
}

fn write_record(record: &CampaignRecord, statements: &mut Statements<'_>) {
    let campaign = campaign_node(&record.id);
    statements
        .about(campaign.clone())
        .is_a("act:Campaign")
        .is_a("prov:Activity")
        .has("rdfs:label", record.name.as_str())
        .has("act:configText", record.config_text.as_str())
        .has("act:configDigest", record.config_digest.as_str())
        .has("act:configPath", record.config_path.as_str())
        .has("act:ontologyDigest", record.ontology_digest.as_str())
        .has("act:seed", record.seed)
        .has("act:plannedRuns", record.planned_runs)
        .has("act:repeat", u64::from(record.repeat))
        .optional("act:timeBudget", record.time_secs)
        .optional("act:untilWidth", record.until_width)
        .optional("act:maxFailures", record.max_failures)
        .optional("act:importedFrom", record.imported_from.as_deref())
        .has("act:strategy", record.strategy.as_str())
        .has("prov:startedAtTime", Value::Time(&record.started))
        .has("act:program", program(&record.program_version).as_str())
        .has("act:programDigest", record.program_digest.as_str())
        .has("act:physics", u64::from(record.physics));
    if let Some(skill) = &record.skill {
        statements
            .about(campaign.clone())
            .has("act:skillCommand", skill.command.as_str())
            .has("act:skillDigest", skill.digest.as_str())
            .has("act:privileged", skill.privileged);
    }
    for shard in &record.shards {
        statements
            .about(campaign.clone())
            .has("act:shard", shard.to_string().as_str());
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
            .has("act:rulePath", path.as_str())
            .has("act:ruleDigest", digest.as_str());
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
            .has("act:findingCode", found.code.as_str())
            .has("act:findingText", found.message.as_str())
            .optional("act:findingPlace", found.place.as_deref());
    }
    for (number, (name, digest)) in record.models.iter().enumerate() {
        let model = NamedNode::new_unchecked(format!("{}/model/{}", campaign.as_str(), number + 1));
        statements
            .about(campaign.clone())
            .has("act:usedModel", model.clone());
        statements
            .about(model)
            .is_a("act:UsedModel")
            .has("act:model", name.as_str())
            .has("act:digest", digest.as_str());
    }
}

fn write_end(id: &str, end: &CampaignEnd, statements: &mut Statements<'_>) {
    let mut about = statements.about(campaign_node(id));
    about
        .has("prov:endedAtTime", Value::Time(&end.ended))
        .optional("act:score", end.score)
        .optional("act:scoreWithoutBroken", end.score_without_broken)
        .has("act:discards", end.discards)
        .optional("act:endedBy", end.ended_by.as_deref())
        .has("act:interrupted", end.interrupted);
    for (outcome, times) in &end.outcomes {
        about.has(&format!("act:{outcome}Count"), *times);
    }
}

/// The program's name and version as one text.
pub(super) fn program(version: &str) -> String {
    format!("actcheck {version}")
}
