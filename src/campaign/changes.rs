//! Inputs of a campaign that have changed since it ran, by digest.

use std::collections::BTreeMap;

use actcheck_history::CampaignRecord;

/// An input that changed since a campaign ran.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InputChange {
    /// Its kind.
    pub kind: ChangeKind,
    /// Name of the model, robot, rule file or configuration.
    pub name: String,
    /// Version or digest then; `None` if it did not exist.
    pub was: Option<String>,
    /// Version or digest now; `None` if it no longer exists.
    pub is: Option<String>,
}

/// Kinds of inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ChangeKind {
    /// This program, by its version and the digest of its sources.
    Program,
    /// The version of its physics.
    Physics,
    /// The configuration's text.
    Config,
    /// The program that performs actions: its command, or one of its files.
    Skill,
    /// The file of an object model or a robot.
    Model,
    /// The ontology.
    Ontology,
    /// A rule file with its libraries.
    Rule,
}

impl ChangeKind {
    /// Its name in messages.
    pub fn word(self) -> &'static str {
        match self {
            Self::Program => "program",
            Self::Physics => "physics",
            Self::Config => "configuration",
            Self::Skill => "skill",
            Self::Model => "model",
            Self::Ontology => "ontology",
            Self::Rule => "rule",
        }
    }
}

/// Returns the differences between the records of two campaigns, sorted by kind and name. Ontology
/// and rules are included: they change outcomes, though not traces.
pub fn changes(was: &CampaignRecord, is: &CampaignRecord) -> Vec<InputChange> {
    let single = |kind, name: &str, was: &str, is: &str| InputChange {
        kind,
        name: name.to_owned(),
        was: Some(was.to_owned()),
        is: Some(is.to_owned()),
    };
    let mut all = vec![
        single(ChangeKind::Program, "actcheck", &program(was), &program(is)),
        single(
            ChangeKind::Physics,
            "version",
            &was.physics.to_string(),
            &is.physics.to_string(),
        ),
        single(
            ChangeKind::Config,
            &was.name,
            &was.config_digest,
            &is.config_digest,
        ),
        single(
            ChangeKind::Ontology,
            "all files",
            &was.ontology_digest,
            &is.ontology_digest,
        ),
    ];
    let skill = |record: &CampaignRecord| {
        record
            .skill
            .iter()
            .map(|skill| (skill.command.clone(), skill.digest.clone()))
            .collect()
    };
    all.extend(named(ChangeKind::Skill, &skill(was), &skill(is)));
    let models = |record: &CampaignRecord| record.models.iter().cloned().collect();
    all.extend(named(ChangeKind::Model, &models(was), &models(is)));
    let rules = |record: &CampaignRecord| {
        record
            .rules
            .iter()
            .map(|(_, path, digest)| (path.clone(), digest.clone()))
            .collect::<BTreeMap<_, _>>()
    };
    all.extend(named(ChangeKind::Rule, &rules(was), &rules(is)));
    all.retain(|change| change.was != change.is);
    all.sort_by(|a, b| (a.kind, &a.name).cmp(&(b.kind, &b.name)));
    all
}

/// Says that the physics has changed since. Returns `None` if it has not: then the same scene gives
/// the same states.
pub fn other_physics(changes: &[InputChange]) -> Option<String> {
    let change = changes
        .iter()
        .find(|change| change.kind == ChangeKind::Physics)?;
    let number = |version: &Option<String>| {
        version
            .as_ref()
            .and_then(|version| version.parse::<u32>().ok())
    };
    let age = if number(&change.was) < number(&change.is) {
        "older"
    } else {
        "newer"
    };
    let (was, is) = (change.was.as_deref()?, change.is.as_deref()?);
    Some(format!(
        "made by {age} physics (version {was}; this program has {is})"
    ))
}

/// Says that a campaign was made by other physics than this program's. Returns `None` if it was
/// not.
pub fn made_by_other_physics(record: &CampaignRecord) -> Option<String> {
    let is = CampaignRecord {
        physics: actcheck_world::PHYSICS_VERSION,
        ..record.clone()
    };
    other_physics(&changes(record, &is))
}

/// Version and digest of a program.
fn program(record: &CampaignRecord) -> String {
    format!("{} ({})", record.program_version, record.program_digest)
}

/// One entry for each name on either side.
fn named(
    kind: ChangeKind,
    was: &BTreeMap<String, String>,
    is: &BTreeMap<String, String>,
) -> Vec<InputChange> {
    let mut names: Vec<&String> = was.keys().chain(is.keys()).collect();
    names.sort();
    names.dedup();
    names
        .into_iter()
        .map(|name| InputChange {
            kind,
            name: name.clone(),
            was: was.get(name).cloned(),
            is: is.get(name).cloned(),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_history::SkillRecord;

    fn record(digest: &str) -> CampaignRecord {
        CampaignRecord {
            imported_from: None,
            id: "k7f3".to_owned(),
            name: "pick".to_owned(),
            config_text: String::new(),
            config_digest: String::new(),
            config_path: String::new(),
            ontology_digest: String::new(),
            findings: Vec::new(),
            rules: Vec::new(),
            models: Vec::new(),
            skill: None,
            seed: 7,
            planned_runs: 1,
            repeat: 1,
            strategy: "random".to_owned(),
            time_secs: None,
            until_width: None,
            max_failures: None,
            shards: Default::default(),
            started: String::new(),
            program_version: "0.1.0".to_owned(),
            program_digest: digest.to_owned(),
            physics: 2,
        }
    }

    #[test]
    fn changed_and_new_skills_are_named() {
        let with = |digest: &str| CampaignRecord {
            skill: Some(SkillRecord {
                command: "pick.py".to_owned(),
                digest: digest.to_owned(),
                privileged: false,
            }),
            ..record("aa")
        };
        let found = changes(&with("1"), &with("2"));
        let [change] = found.as_slice() else {
            panic!("{found:?}")
        };
        assert_eq!(
            (change.kind.word(), change.name.as_str()),
            ("skill", "pick.py")
        );
        let found = changes(&record("aa"), &with("2"));
        let [change] = found.as_slice() else {
            panic!("{found:?}")
        };
        assert_eq!(
            (change.kind, change.was.as_deref(), change.is.as_deref()),
            (ChangeKind::Skill, None, Some("2"))
        );
    }

    #[test]
    fn other_physics_is_older_or_newer() {
        let two = record("aa");
        let three = CampaignRecord {
            physics: 3,
            ..record("aa")
        };
        assert_eq!(other_physics(&changes(&two, &two)), None);
        let told = |was, is| other_physics(&changes(was, is)).expect("it changed");
        assert_eq!(
            told(&two, &three),
            "made by older physics (version 2; this program has 3)"
        );
        assert_eq!(
            told(&three, &two),
            "made by newer physics (version 3; this program has 2)"
        );
    }

    #[test]
    fn a_changed_program_of_the_same_version_is_named() {
        let found = changes(&record("aa"), &record("bb"));
        let [change] = found.as_slice() else {
            panic!("{found:?}")
        };
        assert_eq!(
            (change.kind, change.name.as_str()),
            (ChangeKind::Program, "actcheck")
        );
        assert_eq!(
            (change.was.as_deref(), change.is.as_deref()),
            (Some("0.1.0 (aa)"), Some("0.1.0 (bb)"))
        );
        assert!(changes(&record("aa"), &record("aa")).is_empty());
    }
}
