//! Candidates for properties, mined from passing runs: their rules, their values in stored runs, and
//! trials with injected faults.
//!
//! A candidate is a rule file with a limit to fill in. With the limit 0, its margin is the value in
//! a run: candidates are measured by the rules that they become.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use crate::oracles::{Fault, Trial, TrialOptions, try_faults};
use crate::rule_set::RuleSet;
use crate::{Env, judge_stored};
use actcheck_base::{Diagnostics, Source, names};
use actcheck_history::{History, RunRow};
use actcheck_ontology::{self as ontology, Action, Ontology, Property, RuleFile};
use actcheck_rules::RuleBook;

/// How a value is limited.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// It is at most the limit.
    Most,
    /// It is at least the limit.
    Least,
    /// It is positive: one event is before another one.
    Before,
}

/// A candidate for a property of an action.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Local name of the action.
    pub action: String,
    /// Local name of the property.
    pub name: String,
    /// The limited value, such as `the largest speed of the object to pick`.
    pub measure: String,
    /// Unit of the value; empty for numbers.
    pub unit: &'static str,
    /// How it is limited.
    pub side: Side,
    /// Rules that define `value(?value)`.
    rules: String,
    /// Names of the designators that they read.
    needs: BTreeSet<String>,
}

/// A quantity of things over time, or the start of an event.
struct Measured {
    name: &'static str,
    words: &'static str,
    unit: &'static str,
}

/// Quantities of a body, whose largest values may be limited.
const OF_BODIES: [Measured; 8] = [
    Measured {
        name: "speed",
        words: "speed",
        unit: "m/s",
    },
    Measured {
        name: "acceleration",
        words: "acceleration",
        unit: "m/s2",
    },
    Measured {
        name: "jerk",
        words: "jerk",
        unit: "m/s3",
    },
    Measured {
        name: "pathLength",
        words: "path length",
        unit: "m",
    },
    Measured {
        name: "displacement",
        words: "displacement",
        unit: "m",
    },
    Measured {
        name: "rise",
        words: "rise",
        unit: "m",
    },
    Measured {
        name: "tilt",
        words: "tilt",
        unit: "rad",
    },
    Measured {
        name: "angularSpeed",
        words: "angular speed",
        unit: "rad/s",
    },
];

/// Quantities that only objects have.
const OF_OBJECTS: [&str; 2] = ["tilt", "angularSpeed"];
/// Quantities that the robot's base has.
const OF_BASES: [&str; 4] = ["speed", "acceleration", "pathLength", "displacement"];

/// The bodies that are measured: part of a name, words, and conditions on `?thing`.
const BODIES: [(&str, &str, &str); 4] = [
    (
        "Object",
        "the object to pick",
        "parameter(act:pickObject, ?thing)",
    ),
    (
        "Other",
        "any other object",
        "before(?thing, w:fixed, false), ~parameter(act:pickObject, ?thing)",
    ),
    ("Hand", "the hand", "?thing = w:gripper"),
    ("Base", "the base", "?thing = w:robot"),
];

/// Pairs of bodies whose contacts are measured: part of a name, words, and conditions on `?a` and
/// `?b`.
const PAIRS: [(&str, &str, &str); 3] = [
    (
        "Grip",
        "the robot and the object to pick",
        "?a = w:robot, parameter(act:pickObject, ?b)",
    ),
    (
        "Bump",
        "the robot and other things",
        "?a = w:robot, before(?b, w:fixed, _), ~parameter(act:pickObject, ?b)",
    ),
    (
        "Carry",
        "the object to pick and other things",
        "parameter(act:pickObject, ?a), before(?b, w:fixed, _), ?a != ?b",
    ),
];

const PICK: &str = "pickObject";

impl Candidate {
    /// Returns the statement with a limit as a sentence without a full stop.
    pub fn sentence(&self, limit: f64) -> String {
        let unit = if self.unit.is_empty() {
            String::new()
        } else {
            format!(" {}", self.unit)
        };
        match self.side {
            Side::Most => format!("{} is at most {limit}{unit}", self.measure),
            Side::Least => format!("{} is at least {limit}{unit}", self.measure),
            Side::Before => self.measure.clone(),
        }
    }

    /// Returns the rule file with a limit. `evidence` becomes comments.
    pub fn rule(&self, limit: f64, evidence: &[String]) -> String {
        let mut text = format!("% Required: {}.\n", self.sentence(limit));
        for line in evidence {
            let _ = writeln!(text, "% {line}");
        }
        let limit = number(limit);
        let (compared, margin) = match self.side {
            Side::Most => (format!("?value <= {limit}"), format!("{limit} - ?value")),
            Side::Least => (format!("?value >= {limit}"), format!("?value - {limit}")),
            Side::Before => (format!("?value > {limit}"), format!("?value - {limit}")),
        };
        let words = match self.side {
            Side::Most => format!("{}, at most {limit}", self.unit),
            Side::Least => format!("{}, at least {limit}", self.unit),
            Side::Before => "s between them".to_owned(),
        };
        let _ = write!(
            text,
            "\n@prefix act: <http://actions#> .\n@prefix w: <https://w3id.org/actcheck/world#> .\n\n\
             success(?value) :- value(?value), {compared} .\n\
             % A run without this value says nothing.\n\
             applicable(?value) :- value(?value) .\n\
             margin(?m) :- value(?value), ?m = {margin} .\n\
             because(?text) :- value(?value), ?rounded = ROUND(?value * 1000.0) / 1000.0,\n    \
             ?text = CONCAT(\"{}: \", STR(?rounded), \" {}\") .\n\n{}",
            self.measure,
            words.trim_start(),
            self.rules
        );
        text
    }

    /// Whether its rules read a designator.
    pub fn reads(&self, designator: &str) -> bool {
        self.needs.contains(designator)
    }

    /// Its IRI.
    pub fn iri(&self) -> String {
        names::act(&self.name)
    }

    /// Returns its value in a run from the margin with the limit 0.
    fn value(&self, margin: f64) -> f64 {
        match self.side {
            Side::Most => -margin,
            Side::Least | Side::Before => margin,
        }
    }

    fn property(&self, limit: f64, evidence: &[String]) -> Property {
        let text = self.rule(limit, evidence);
        let source = Source::new(format!("{}.rls", self.name), text);
        let mut property = Property::new(self.iri(), RuleFile::new(source));
        property.needs.clone_from(&self.needs);
        property
    }
}

/// Formats a limit as a number of a rule.
fn number(limit: f64) -> String {
    format!("{limit:?}")
}

/// Returns the candidates for an action. `phases` are the names of its phases in passing runs.
pub fn candidates(action: &Action, phases: &BTreeSet<String>) -> Vec<Candidate> {
    let name = names::local(&action.iri).to_owned();
    let mut found = Vec::new();
    let mut add = |part: String, measure: String, unit, side, rules: String| {
        let reads_pick = rules.contains(PICK);
        if reads_pick && !action.parameters.contains(PICK) {
            return;
        }
        found.push(Candidate {
            action: name.clone(),
            name: format!("{name}{part}"),
            measure,
            unit,
            side,
            rules,
            needs: reads_pick.then(|| PICK.to_owned()).into_iter().collect(),
        });
    };
    for (body, of, condition) in BODIES {
        for quantity in &OF_BODIES {
            let has = match body {
                "Hand" => !OF_OBJECTS.contains(&quantity.name),
                "Base" => OF_BASES.contains(&quantity.name),
                _ => true,
            };
            if !has {
                continue;
            }
            add(
                format!("{body}{}", capitalised(quantity.name)),
                format!("the largest {} of {of}", quantity.words),
                quantity.unit,
                Side::Most,
                format!(
                    "value(#max(?v)) :- {condition}, course(?thing, w:{}, _, ?v) .\n",
                    quantity.name
                ),
            );
        }
    }
    for (quantity, words, unit) in [("tilt", "tilt", "rad"), ("speed", "speed", "m/s")] {
        add(
            format!("Held{}", capitalised(quantity)),
            format!("the largest {words} of the object to pick while it is held"),
            unit,
            Side::Most,
            format!(
                "value(#max(?v)) :- parameter(act:pickObject, ?o), course(?o, w:held, ?t, true), course(?o, w:{quantity}, ?t, ?v) .\n"
            ),
        );
    }
    for (pair, of, condition) in PAIRS {
        add(
            format!("{pair}Force"),
            format!("the largest force between {of}"),
            "N",
            Side::Most,
            format!(
                "value(#max(?f)) :- force(?f) .\nforce(?f) :- {condition}, contact_interval(_, ?a, ?b, ?f) .\n\
                 force(0.0) :- parameter(act:pickObject, _) .\n"
            ),
        );
    }
    let held = "parameter(act:pickObject, ?o), hold_interval(?i, ?o)";
    for (side, word) in [(Side::Least, "Least"), (Side::Most, "Most")] {
        add(
            format!("{word}Hold"),
            "the longest hold of the object to pick".to_owned(),
            "s",
            side,
            format!("value(#max(?d)) :- {held}, lasts(?i, ?d) .\n"),
        );
        add(
            format!("{word}OpeningAtEnd"),
            "the opening of the hand at the end".to_owned(),
            "m",
            side,
            format!("{LAST}value(#max(?v)) :- last(?t), course(w:gripper, w:opening, ?t, ?v) .\n"),
        );
        add(
            format!("{word}RiseAtEnd"),
            "the rise of the object to pick at the end".to_owned(),
            "m",
            side,
            format!(
                "{LAST}value(#max(?v)) :- last(?t), parameter(act:pickObject, ?o), course(?o, w:rise, ?t, ?v) .\n"
            ),
        );
        add(
            format!("{word}Duration"),
            "the duration of the action".to_owned(),
            "s",
            side,
            format!("{LAST}value(?t) :- last(?t) .\n"),
        );
        for phase in phases {
            add(
                format!("{word}{}Duration", capitalised(phase)),
                format!("the duration of the phase `{phase}`"),
                "s",
                side,
                format!("value(#max(?d)) :- phase_interval(?i, {phase:?}), lasts(?i, ?d) .\n"),
            );
        }
    }
    add(
        "Holds".to_owned(),
        "the number of holds of the object to pick".to_owned(),
        "",
        Side::Most,
        format!("value(#count(?i)) :- {held} .\n"),
    );
    for order in orders(phases) {
        let [(first, first_words, _), (second, second_words, _)] = &order;
        add(
            format!("{first}Before{second}"),
            format!("{first_words} before {second_words}"),
            "s",
            Side::Before,
            format!(
                "value(?d) :- first(?s), second(?t), ?d = ?t - ?s .\nfirst(#min(?s)) :- {} .\nsecond(#min(?s)) :- {} .\n",
                order[0].2, order[1].2
            ),
        );
    }
    found
}

/// The last moment of an action.
const LAST: &str = "last(#max(?t)) :- course(w:gripper, w:z, ?t, _) .\n";

/// An event: part of a name, words, and conditions on its start `?s`.
type Event = (String, String, String);

/// Pairs of events of which one may always be before the other. Pairs of phases are left out: their
/// order is that of the program.
fn orders(phases: &BTreeSet<String>) -> Vec<[Event; 2]> {
    let events = [
        (
            "Touch",
            "the robot touches the object to pick",
            "contact_interval(?i, w:robot, ?o, _)",
        ),
        (
            "Hold",
            "the object to pick is held",
            "hold_interval(?i, ?o)",
        ),
        (
            "Motion",
            "the object to pick moves",
            "motion_interval(?i, ?o)",
        ),
    ];
    let events = events.map(|(name, words, condition)| {
        let condition = format!("parameter(act:pickObject, ?o), {condition}, interval(?i, ?s, _)");
        (name.to_owned(), words.to_owned(), condition)
    });
    let phase = |phase: &String| {
        (
            capitalised(phase),
            format!("the phase `{phase}` begins"),
            format!("phase_interval(?i, {phase:?}), interval(?i, ?s, _)"),
        )
    };
    let mut pairs = Vec::new();
    for (idx, event) in events.iter().enumerate() {
        let later = events[idx + 1..].iter().cloned();
        for other in later.chain(phases.iter().map(phase)) {
            pairs.push([event.clone(), other.clone()]);
            pairs.push([other, event.clone()]);
        }
    }
    pairs
}

/// The name with a capital letter at the beginning and after each sign that is not a letter or
/// digit, which is left out.
fn capitalised(name: &str) -> String {
    let parts = name.split(|letter: char| !letter.is_ascii_alphanumeric());
    let capital = |part: &str| {
        let mut letters = part.chars();
        let first = letters.next().map(|letter| letter.to_ascii_uppercase());
        first.into_iter().chain(letters).collect::<String>()
    };
    parts.map(capital).collect()
}

/// Names of the phases of each action, by its local name, in some runs.
///
/// # Errors
/// A run can't be read.
pub fn phases(
    history: &History,
    rows: &[RunRow],
) -> Result<BTreeMap<String, BTreeSet<String>>, Diagnostics> {
    let mut phases: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for row in rows {
        for action in history.traces().of(row, false)?.actions {
            let known = phases.entry(action.action).or_default();
            known.extend(action.phases.into_iter().map(|phase| phase.name));
        }
    }
    Ok(phases)
}

/// Measures candidates in stored runs. The values of each candidate are by run; of an action that
/// is performed several times, the worst counts. Runs without a value are left out.
///
/// # Errors
/// Faults of the candidates' rules, or of the history.
pub fn measure(
    history: &History,
    rows: &[RunRow],
    ontology: &Ontology,
    candidates: &[Candidate],
    (jobs, stop): (usize, &AtomicBool),
) -> Result<Vec<BTreeMap<String, f64>>, Diagnostics> {
    let mut alone = ontology.clone();
    alone.properties.clear();
    for action in alone.actions.values_mut() {
        action.success_properties.clear();
        action.preconditions.clear();
        action.premises.clear();
    }
    let unlimited = |candidate: &Candidate| candidate.property(0.0, &[]);
    let ontology = with_candidates(alone, candidates, unlimited);
    let rules = RuleSet {
        rules: RuleBook::prepare(&ontology)?,
        actions: ontology.actions.clone(),
        ontology,
    };
    let (judged, faults) = judge_stored(history, rows, &rules, jobs, stop)?;
    faults.or(())?;
    let places: BTreeMap<String, usize> = candidates
        .iter()
        .enumerate()
        .map(|(idx, candidate)| (candidate.iri(), idx))
        .collect();
    let mut values = vec![BTreeMap::new(); candidates.len()];
    for judgement in judged {
        let place = places.get(&judgement.now.property);
        let (Some(&idx), Some(margin)) = (place, judgement.now.margin) else {
            continue;
        };
        let of_run: &mut BTreeMap<String, f64> = &mut values[idx];
        let worst = of_run.get(&judgement.run).copied().unwrap_or(f64::INFINITY);
        of_run.insert(judgement.run, margin.min(worst));
    }
    for (candidate, of_run) in candidates.iter().zip(&mut values) {
        of_run
            .values_mut()
            .for_each(|margin| *margin = candidate.value(*margin));
    }
    Ok(values)
}

fn with_candidates(
    mut ontology: Ontology,
    candidates: &[Candidate],
    property: impl Fn(&Candidate) -> Property,
) -> Ontology {
    for candidate in candidates {
        if let Some(action) = ontology.actions.get_mut(&candidate.action) {
            action.success_properties.push(candidate.iri());
            let property = property(candidate);
            ontology.properties.insert(candidate.iri(), property);
        }
    }
    ontology
}

/// Tries candidates with their limits on fresh scenes of a campaign, without and with faults.
/// Returns the trials, whose outcomes are those of the candidates and of all other properties.
///
/// # Errors
/// Faults of the candidates' rules; `X010` if workers can't be started.
pub fn try_candidates(
    mut env: Env,
    limited: &[(Candidate, f64)],
    (scenes, faults): (u32, &[Fault]),
    options: &TrialOptions,
    stop: &AtomicBool,
    on_done: impl Fn() + Sync,
) -> Result<Vec<Trial>, Diagnostics> {
    let limits: BTreeMap<&str, f64> = limited
        .iter()
        .map(|(candidate, limit)| (candidate.name.as_str(), *limit))
        .collect();
    let candidates: Vec<Candidate> = limited
        .iter()
        .map(|(candidate, _)| candidate.clone())
        .collect();
    let property = |candidate: &Candidate| {
        let limit = limits.get(candidate.name.as_str()).copied();
        candidate.property(limit.unwrap_or_default(), &[])
    };
    env.ontology = with_candidates(env.ontology, &candidates, property);
    env.rules = RuleBook::prepare_within(&env.ontology, &env.rule_budget)?;
    // The campaign's own scenes are those that the limits were fitted to.
    env.campaign.seed = env.campaign.seed.wrapping_add(FRESH_SEED);
    (env.campaign.test_count, env.campaign.repeat) = (scenes, 1);
    env.campaign.shard = None;
    try_faults(&env, faults, options, stop, on_done)
}

/// Added to the seed of a campaign for scenes that it does not have.
const FRESH_SEED: u64 = 1_000_003;

/// Returns the IRI by which an ontology in `folder`, which may be new, imports another one.
///
/// # Errors
/// A folder can't be found.
pub fn import_from(folder: &Path, root: &Path) -> std::io::Result<String> {
    let (folder, root) = (std::path::absolute(folder)?, std::fs::canonicalize(root)?);
    let parent = folder.parent().map(std::fs::canonicalize).transpose();
    let folder = match (parent, folder.file_name()) {
        (Ok(Some(parent)), Some(name)) => parent.join(name),
        _ => folder,
    };
    let way = pathdiff::diff_paths(&root, folder).unwrap_or(root);
    let parts = way.components().map(|part| match part {
        std::path::Component::ParentDir => "..".to_owned(),
        part => ontology::encoded(&part.as_os_str().to_string_lossy()),
    });
    Ok(parts.collect::<Vec<String>>().join("/"))
}
