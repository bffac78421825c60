//! Conflicts of a merge: each fault names the campaigns and how to resolve it.

use std::collections::BTreeSet;

use crate::CampaignRecord;
use crate::merge::survey::Found;
use actcheck_base::Diagnostic;

/// Maximum number of run numbers in one message.
const MAX_LISTED: usize = 8;

/// Lists the run numbers of indices.
pub(super) fn numbers(indices: &[u64]) -> String {
    let mut text = indices
        .iter()
        .take(MAX_LISTED)
        .map(|index| (index + 1).to_string())
        .collect::<Vec<_>>()
        .join(", ");
    if indices.len() > MAX_LISTED {
        text.push_str(&format!(" and {} more", indices.len() - MAX_LISTED));
    }
    text
}

/// H020: the same run of one campaign has two different results.
pub(super) fn other_results(first: &Found, second: &Found, indices: &[u64]) -> Diagnostic {
    let message = format!(
        "`{}` and `{}` belong to one campaign, but differ in trace or outcomes of {}: {}",
        first.name(),
        second.name(),
        if indices.len() == 1 {
            "a run".to_owned()
        } else {
            format!("{} runs", indices.len())
        },
        numbers(indices)
    );
    Diagnostic::error("H020", message).help(format!(
        "something changed between them that is not in their records, such as the program; leave one out: `--leave-out {}`",
        second.name()
    ))
}

/// H021: parts of one campaign were made with different programs, rules or models.
pub(super) fn other_ingredients(first: &Found, second: &Found) -> Diagnostic {
    let message = format!(
        "`{}` and `{}` are parts of one campaign, but were made with different versions of: {}",
        first.name(),
        second.name(),
        differences(&first.record, &second.record).join(", ")
    );
    Diagnostic::error("H021", message).help(format!(
        "run the part again, or leave one out: `--leave-out {}`",
        second.name()
    ))
}

/// Names the program, ontology, models and rules in which two campaigns differ.
fn differences(first: &CampaignRecord, second: &CampaignRecord) -> Vec<String> {
    let mut found = Vec::new();
    let program =
        |record: &CampaignRecord| format!("{} {}", record.program_version, record.program_digest);
    if program(first) != program(second) {
        found.push(format!(
            "program ({}, {})",
            program(first).trim(),
            program(second).trim()
        ));
    }
    if first.ontology_digest != second.ontology_digest {
        found.push("ontology".to_owned());
    }
    if first.skill != second.skill {
        found.push("the program that performs actions".to_owned());
    }
    let models = |record: &CampaignRecord| record.models.iter().cloned().collect::<BTreeSet<_>>();
    let rules = |record: &CampaignRecord| {
        record
            .rules
            .iter()
            .map(|(_, path, of)| (path.clone(), of.clone()))
            .collect::<BTreeSet<_>>()
    };
    for (kind, [first, second]) in [
        ("model", [models(first), models(second)]),
        ("rule", [rules(first), rules(second)]),
    ] {
        let names: BTreeSet<&String> = first
            .symmetric_difference(&second)
            .map(|(name, _)| name)
            .collect();
        found.extend(names.into_iter().map(|name| format!("{kind} `{name}`")));
    }
    found
}

/// H022: two campaigns have the same id.
pub(super) fn id_taken(first: &Found, second: &Found) -> Diagnostic {
    let message = format!(
        "`{}` (started {}) and `{}` (started {}) are two campaigns with the same id",
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

/// H023: the destination holds several parts of one campaign, which can't be merged in place.
pub(super) fn parts_in_place(members: &[&Found]) -> Diagnostic {
    let names: Vec<String> = members
        .iter()
        .map(|found| format!("`{}`", found.record.id))
        .collect();
    let message = format!(
        "{} of `{}` are parts of one campaign",
        names.join(" and "),
        members[0].dir
    );
    Diagnostic::error("H023", message)
        .help("campaigns in the destination are not changed: name a new folder with `--into`, and add this one to the histories to merge")
}

/// H024: a run was rechecked in both histories with different results.
pub(super) fn other_judgements(first: &Found, second: &Found, indices: &[u64]) -> Diagnostic {
    let message = format!(
        "`{}` and `{}` were both rechecked, with different results: runs {}",
        first.name(),
        second.name(),
        numbers(indices)
    );
    Diagnostic::error("H024", message).help(format!(
        "the newest judgement can't be determined; leave one out (`--leave-out {}`) and `actcheck recheck` the result",
        second.name()
    ))
}
