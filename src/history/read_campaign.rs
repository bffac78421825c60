//! Reads the beginning of a campaign.

use oxigraph::model::Term;
use oxigraph::store::{StorageError, Store};

use crate::detail::version;
use crate::read::{Node, text_of};
use crate::write_campaign::campaign_node;
use crate::{CampaignRecord, FindingRecord, SkillRecord};
use actcheck_base::Shard;

/// Reads the record of a campaign. Returns `None` if the history has no such campaign.
pub(super) fn beginning(store: &Store, id: &str) -> Result<Option<CampaignRecord>, StorageError> {
    let node = Node::read(store, &campaign_node(id))?;
    if node.properties().next().is_none() {
        return Ok(None);
    }
    let text = |node: &Node, property: &str| node.text(property).unwrap_or_default();
    let mut rules = Vec::new();
    for rule in parts(store, &node, "act:usedRule")? {
        rules.push((
            text(&rule, "act:verifies"),
            text(&rule, "act:rulePath"),
            text(&rule, "act:ruleDigest"),
        ));
    }
    rules.sort();
    let mut findings = Vec::new();
    for found in parts(store, &node, "act:ruleFinding")? {
        let place = found.text("act:findingPlace");
        let (code, message) = (
            text(&found, "act:findingCode"),
            text(&found, "act:findingText"),
        );
        findings.push(FindingRecord {
            code,
            message,
            place,
        });
    }
    findings.sort();
    let mut models = Vec::new();
    for model in parts(store, &node, "act:usedModel")? {
        models.push((text(&model, "act:model"), text(&model, "act:digest")));
    }
    models.sort();
    Ok(Some(CampaignRecord {
        id: id.to_owned(),
        name: text(&node, "rdfs:label"),
        config_text: text(&node, "act:configText"),
        config_digest: text(&node, "act:configDigest"),
        config_path: text(&node, "act:configPath"),
        ontology_digest: text(&node, "act:ontologyDigest"),
        rules,
        findings,
        models,
        skill: skill(&node),
        seed: node.count("act:seed").unwrap_or_default(),
        planned_runs: node.count("act:plannedRuns").unwrap_or_default(),
        repeat: node
            .count("act:repeat")
            .and_then(|repeat| u32::try_from(repeat).ok())
            .unwrap_or(1)
            .max(1),
        time_secs: node.number("act:timeBudget"),
        until_width: node.number("act:untilWidth"),
        max_failures: node.count("act:maxFailures"),
        shards: shards(&node),
        strategy: node
            .text("act:strategy")
            .unwrap_or_else(|| "random".to_owned()),
        started: text(&node, "prov:startedAtTime"),
        program_version: version(&node),
        program_digest: text(&node, "act:programDigest"),
        physics: node
            .count("act:physics")
            .and_then(|version| u32::try_from(version).ok())
            .unwrap_or_default(),
    }))
}

/// The program that performed actions. Returns `None` if there was none.
pub(super) fn skill(node: &Node) -> Option<SkillRecord> {
    Some(SkillRecord {
        command: node.text("act:skillCommand")?,
        digest: node.text("act:skillDigest").unwrap_or_default(),
        privileged: node.boolean("act:privileged").unwrap_or_default(),
    })
}

fn shards(node: &Node) -> Vec<Shard> {
    let mut shards: Vec<Shard> = node
        .all("act:shard")
        .iter()
        .filter_map(|shard| text_of(shard).parse().ok())
        .collect();
    shards.sort();
    shards
}

/// The nodes that a property names.
fn parts(store: &Store, node: &Node, property: &str) -> Result<Vec<Node>, StorageError> {
    let named = node.all(property).iter().filter_map(|term| match term {
        Term::NamedNode(part) => Some(part),
        _ => None,
    });
    named.map(|part| Node::read(store, part)).collect()
}
