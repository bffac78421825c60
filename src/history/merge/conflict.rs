//! What can't be joined, in words: each fault names the campaigns and the way out.

use std::collections::BTreeSet;

use crate::base::Diagnostic;
use crate::history::CampaignRecord;
use crate::history::merge::survey::Found;

/// Run numbers told in one message.
const TOLD: usize = 8;

/// Run numbers of indices.
pub(super) fn numbers(indices: &[u64]) -> String {
    let mut text = indices.iter().take(TOLD).map(|index| (index + 1).to_string()).collect::<Vec<_>>().join(", ");
    if indices.len() > TOLD {
        text.push_str(&format!(" and {} more", indices.len() - TOLD));
    }
    text
}

/// The same run of one campaign went two ways.
pub(super) fn other_results(first: &Found, second: &Found, indices: &[u64]) -> Diagnostic {
    let message = format!(
        "`{}` and `{}` are of one campaign, and differ in trace or outcomes of {}: {}",
        first.name(),
        second.name(),
        if indices.len() == 1 { "a run".to_owned() } else { format!("{} runs", indices.len()) },
        numbers(indices)
    );
    Diagnostic::error("H020", message).help(format!(
        "something changed between them that their records don't tell, such as the program; leave one out: `--leave-out {}`",
        second.name()
    ))
}

/// Parts that were asked for alike and made with different things.
pub(super) fn other_ingredients(first: &Found, second: &Found) -> Diagnostic {
    let message = format!(
        "`{}` and `{}` are parts of one campaign, and were made with different things: {}",
        first.name(),
        second.name(),
        differences(&first.record, &second.record).join(", ")
    );
    Diagnostic::error("H021", message)
        .help(format!("run the part again, or leave one out: `--leave-out {}`", second.name()))
}

/// Names of what two campaigns were not made with alike.
fn differences(first: &CampaignRecord, second: &CampaignRecord) -> Vec<String> {
    let mut found = Vec::new();
    let program = |record: &CampaignRecord| format!("{} {}", record.program_version, record.program_digest);
    if program(first) != program(second) {
        found.push(format!("program ({}, {})", program(first).trim(), program(second).trim()));
    }
    if first.ontology_digest != second.ontology_digest {
        found.push("ontology".to_owned());
    }
    if first.skill != second.skill {
        found.push("the program that performs actions".to_owned());
    }
    let models = |record: &CampaignRecord| record.models.iter().cloned().collect::<BTreeSet<_>>();
    let rules = |record: &CampaignRecord| {
        record.rules.iter().map(|(_, path, of)| (path.clone(), of.clone())).collect::<BTreeSet<_>>()
    };
    for (kind, [first, second]) in [("model", [models(first), models(second)]), ("rule", [rules(first), rules(second)])]
    {
        let names: BTreeSet<&String> = first.symmetric_difference(&second).map(|(name, _)| name).collect();
        found.extend(names.into_iter().map(|name| format!("{kind} `{name}`")));
    }
    found
}

/// Two campaigns have one id.
pub(super) fn id_taken(first: &Found, second: &Found) -> Diagnostic {
    let message = format!(
        "`{}` (started {}) and `{}` (started {}) are two campaigns with one id",
        first.name(),
        first.record.started,
        second.name(),
        second.record.started
    );
    Diagnostic::error("H022", message).help(format!(
        "`--rename` gives the later one a new id, also in its runs; or leave one out: `--leave-out {}`",
        second.name()
    ))
}

/// The destination holds several parts, which can't be joined in place.
pub(super) fn parts_in_place(members: &[&Found]) -> Diagnostic {
    let names: Vec<String> = members.iter().map(|found| format!("`{}`", found.record.id)).collect();
    let message = format!("{} of `{}` are parts of one campaign", names.join(" and "), members[0].dir);
    Diagnostic::error("H023", message)
        .help("what a history holds is not changed: name a new folder with `--into`, and this one among those to merge")
}

/// A run was judged later in both places, and not alike.
pub(super) fn other_judgements(first: &Found, second: &Found, indices: &[u64]) -> Diagnostic {
    let message = format!(
        "`{}` and `{}` were both rechecked, and not alike: runs {}",
        first.name(),
        second.name(),
        numbers(indices)
    );
    Diagnostic::error("H024", message).help(format!(
        "which judgement is the newest can't be told; leave one out (`--leave-out {}`) and `actcheck recheck` the result",
        second.name()
    ))
}
