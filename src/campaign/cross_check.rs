//! Compares runs with the same runs in another physics engine.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use crate::episode::{EpisodeFile, run_of};
use crate::playable::PlayableRun;
use crate::rule_set::RuleSet;
use actcheck_base::{Diagnostics, Outcome, Source};
use actcheck_data::{Frames, Role, Trace};
use actcheck_episodes::Mapping;
use actcheck_history::RunRecord;
use actcheck_rules::Budget;

/// Courses part where a body is this far from its place in the other engine. Unit: metres.
const PARTED_M: f64 = 5e-3;
/// A contact that begins earlier or later by less is the same one. Unit: seconds.
const SAME_CONTACT_SECS: f64 = 0.25;

/// A property of an action of a run: number of the action, from 0, and IRI.
pub type JudgedProperty = (usize, String);

/// Where two courses of the same run part.
#[derive(Debug, Clone, PartialEq)]
pub struct Parting {
    /// Time since the first frame. Unit: seconds.
    pub secs: f64,
    /// The body that is further off its place in the other engine than all others.
    pub body: String,
}

/// The first contact that only one of two engines has.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnContact {
    /// The pair, sorted.
    pub pair: [String; 2],
    /// Its start since the first frame. Unit: seconds.
    pub secs: f64,
    /// Whether it is in this program's engine, not in the other one.
    pub is_here: bool,
}

/// A run in both engines.
#[derive(Debug, Clone, PartialEq)]
pub struct RunInBoth {
    /// Outcomes here and in the other engine of the properties that both decide.
    pub decided: BTreeMap<JudgedProperty, [bool; 2]>,
    /// Where the courses part; `None` if they do not.
    pub parting: Option<Parting>,
    /// The first contact that differs.
    pub contact: Option<OwnContact>,
}

impl RunInBoth {
    /// Returns the properties with different outcomes: of each, whether it passed here.
    pub fn flips(&self) -> impl Iterator<Item = (&JudgedProperty, bool)> {
        let differing = self
            .decided
            .iter()
            .filter(|(_, [here, there])| here != there);
        differing.map(|(property, [here, _])| (property, *here))
    }
}

/// Returns the mapping of the recordings of a run. Its text is that of all runs: recordings of one
/// campaign stay together.
///
/// # Errors
/// A name of a body can't be written.
pub fn mapping_of(run: &PlayableRun, campaign: &str) -> Result<Mapping, Diagnostics> {
    let quoted = actcheck_config::quoted;
    let list = |names: &[String]| {
        let names: Vec<String> = names.iter().map(|name| quoted(name)).collect();
        format!("[{}]", names.join(", "))
    };
    let [left, right] = &run.fingers;
    let mut text = format!(
        "[robot]\nbodies = \"robot/*\"\nbase = {}\nhand = \"robot/grasp\"\nleft_finger = {}\nright_finger = {}\n",
        quoted(&run.base),
        list(left),
        list(right)
    );
    let objects = &run.record.scene.objects;
    for object in objects.iter().filter(|object| object.role != Role::Part) {
        text += &format!(
            "[objects.{}]\nbody = {}\ncategory = {}\nup = \"z\"\n",
            object.id,
            quoted(&object.id),
            quoted(&object.category)
        );
    }
    let mut mapping = Mapping::parse(&Source::new("cross-check.toml", text))?;
    mapping.source = Source::new(
        "cross-check.toml",
        format!("# The runs of campaign {campaign}, played by `actcheck cross-check`.\n"),
    );
    Ok(mapping)
}

/// Judges the recording of a run by the present rules.
///
/// # Errors
/// The recording can't be read.
pub fn judge_played(
    file: &Path,
    mapping: &Mapping,
    rules: &RuleSet,
    here: &RunRecord,
) -> Result<RunRecord, Diagnostics> {
    let file = EpisodeFile {
        path: file.to_path_buf(),
        named: file.display().to_string(),
        mapping,
        rules,
        repeats: Some(&here.trace),
    };
    run_of(&file, "", &Budget::default())
}

/// Compares a run with its course in another engine.
pub fn in_both(here: &RunRecord, there: &RunRecord) -> RunInBoth {
    RunInBoth {
        decided: decided(here, there),
        parting: parting(&here.trace.frames, &there.trace.frames),
        contact: own_contact(&here.trace, &there.trace),
    }
}

/// Returns the outcomes that both records decide.
pub fn decided(here: &RunRecord, there: &RunRecord) -> BTreeMap<JudgedProperty, [bool; 2]> {
    let passed = |outcome: Outcome| match outcome {
        Outcome::Passed => Some(true),
        Outcome::Failed => Some(false),
        _ => None,
    };
    let mut found = BTreeMap::new();
    for (step, (ours, theirs)) in here.judgements.iter().zip(&there.judgements).enumerate() {
        for one in ours {
            let other = theirs.iter().find(|other| other.property == one.property);
            let both = other.and_then(|other| passed(one.outcome).zip(passed(other.outcome)));
            if let Some((ours, theirs)) = both {
                found.insert((step, one.property.clone()), [ours, theirs]);
            }
        }
    }
    found
}

fn parting(here: &Frames, there: &Frames) -> Option<Parting> {
    let place = |row: &[f32], idx: usize| -> Option<[f64; 3]> {
        let at = row.get(7 * idx..7 * idx + 3)?;
        Some([f64::from(at[0]), f64::from(at[1]), f64::from(at[2])])
    };
    let shared: Vec<(usize, usize)> = here
        .names
        .iter()
        .enumerate()
        .filter_map(|(own, name)| Some((own, there.names.iter().position(|known| known == name)?)))
        .collect();
    for (number, (ours, theirs)) in here.rows.iter().zip(&there.rows).enumerate() {
        let way = |(own, other): &(usize, usize)| {
            let (one, two) = (place(ours, *own)?, place(theirs, *other)?);
            let squares = (0..3)
                .map(|axis| (one[axis] - two[axis]).powi(2))
                .sum::<f64>();
            Some((*own, squares.sqrt()))
        };
        let farthest = shared
            .iter()
            .filter_map(way)
            .max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((own, _)) = farthest.filter(|(_, way_m)| *way_m > PARTED_M) {
            return Some(Parting {
                secs: number as f64 * here.period_secs,
                body: here.names[own].clone(),
            });
        }
    }
    None
}

/// Contacts since the first frame, in order.
fn contacts(trace: &Trace) -> Vec<(f64, [String; 2])> {
    let mut began = 0.0;
    let mut found = Vec::new();
    for action in &trace.actions {
        let own = action.contacts.iter();
        found.extend(own.map(|contact| (began + contact.start_secs, contact.pair.clone())));
        began += action.duration_secs;
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
    found
}

fn own_contact(here: &Trace, there: &Trace) -> Option<OwnContact> {
    let both = [contacts(here), contacts(there)];
    let first_alone = |side: usize| {
        let other = &both[1 - side];
        both[side].iter().find(|(secs, pair)| {
            !other
                .iter()
                .any(|(start, known)| known == pair && (start - secs).abs() < SAME_CONTACT_SECS)
        })
    };
    let [ours, theirs] = [0, 1].map(first_alone);
    let of = |(secs, pair): &(f64, [String; 2]), is_here| OwnContact {
        pair: pair.clone(),
        secs: *secs,
        is_here,
    };
    match (ours, theirs) {
        (Some(one), Some(other)) if other.0 < one.0 => Some(of(other, false)),
        (Some(one), _) => Some(of(one, true)),
        (None, Some(other)) => Some(of(other, false)),
        (None, None) => None,
    }
}

/// The rules of a campaign, shared by the judgements of its recordings.
///
/// # Errors
/// The ontology or a rule has faults.
pub fn rules_of(env: &crate::Env) -> Result<Arc<RuleSet>, Diagnostics> {
    let (files, path) = &env.campaign.ontology;
    Ok(Arc::new(RuleSet::prepare(files, path)?))
}
