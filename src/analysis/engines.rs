//! The same runs in two physics engines: how often the verdicts agree, where the courses part, and
//! which setting of the other engine explains the disagreements.

use std::collections::{BTreeMap, BTreeSet};

use crate::Agreement;
use actcheck_base::{Outcome, names};
use actcheck_data::{Frames, Trace};
use actcheck_history::RunRecord;

/// Courses part where a body is this far from its place in the other engine. Unit: metres.
const PARTED_M: f64 = 5e-3;
/// A contact that begins earlier or later by less is the same one. Unit: seconds.
const SAME_CONTACT_SECS: f64 = 0.25;

/// Least number of runs, and least share of the disagreements, that a likely cause explains.
const LEAST_EXPLAINED: u64 = 3;
const EXPLAINED_SHARE: u64 = 2;

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

/// A property that two engines decide differently, with the explanation of each.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Disagreement {
    /// Local name of the property.
    pub property: String,
    /// The explanation here.
    pub here: String,
    /// The explanation in the other engine.
    pub there: String,
}

/// A run in both engines, and in all settings of the other one.
#[derive(Debug, Clone, PartialEq)]
pub struct RunInEngines {
    /// Id of the run.
    pub run: String,
    /// Local names of the properties that both engines decide, in order, each with whether it
    /// passes here and in the other engine.
    pub decided: Vec<(String, [bool; 2])>,
    /// The properties that they decide differently.
    pub disagreements: Vec<Disagreement>,
    /// For each setting, the properties that it decides otherwise than this program's engine.
    pub flips_here: BTreeMap<String, BTreeSet<String>>,
    /// For each setting but the plain one, the properties that it decides otherwise than that.
    pub flips_there: BTreeMap<String, BTreeSet<String>>,
    /// Where the courses part; `None` if they do not.
    pub parting: Option<Parting>,
    /// The first contact that differs.
    pub contact: Option<OwnContact>,
}

/// How often a property agrees.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PropertyAgreement {
    /// Its local name.
    pub property: String,
    /// Between the engines.
    pub engines: Agreement,
    /// Of the other engine with itself, in the setting in which that is lowest.
    pub itself: Agreement,
    /// Number of passes here that fail in the other engine.
    pub only_here: u64,
    /// Number of passes in the other engine that fail here.
    pub only_there: u64,
}

/// Runs in two engines.
#[derive(Debug, Clone, PartialEq)]
pub struct EngineComparison {
    /// Name of the setting in which the other engine has the exported parameters.
    pub plain: &'static str,
    /// The runs.
    pub runs: Vec<RunInEngines>,
}

impl RunInEngines {
    /// Compares a run here with its records in all settings of the other engine. Returns `None`
    /// without a record in the setting `plain`.
    pub fn of(here: &RunRecord, there: &BTreeMap<String, RunRecord>, plain: &str) -> Option<Self> {
        let exported = there.get(plain)?;
        let flips = |one: &RunRecord, other: &RunRecord| -> BTreeSet<String> {
            let differing = decided(one, other).into_iter();
            let differing = differing.filter(|(_, [one, other])| one != other);
            let name = |((_, property), _): (StepProperty, _)| names::local(&property).to_owned();
            differing.map(name).collect()
        };
        let both = decided(here, exported);
        let differing = both.iter().filter(|(_, [here, there])| here != there);
        Some(Self {
            run: here.id.clone(),
            disagreements: differing
                .map(|(property, _)| Disagreement {
                    property: names::local(&property.1).to_owned(),
                    here: witness(here, property),
                    there: witness(exported, property),
                })
                .collect(),
            decided: both
                .iter()
                .map(|((_, property), passes)| (names::local(property).to_owned(), *passes))
                .collect(),
            flips_here: there
                .iter()
                .map(|(setting, record)| (setting.clone(), flips(here, record)))
                .collect(),
            flips_there: there
                .iter()
                .filter(|(setting, _)| *setting != plain)
                .map(|(setting, record)| (setting.clone(), flips(exported, record)))
                .collect(),
            parting: parting(&here.trace.frames, &exported.trace.frames),
            contact: own_contact(&here.trace, &exported.trace),
        })
    }

    /// The properties that any setting decides otherwise than this program's engine, or than the
    /// plain setting.
    pub fn contested(&self) -> BTreeSet<String> {
        self.flips_here
            .values()
            .chain(self.flips_there.values())
            .flatten()
            .cloned()
            .collect()
    }
}

impl EngineComparison {
    /// How often all properties of a run agree.
    pub fn agreement(&self) -> Agreement {
        let mut agreement = Agreement::default();
        for run in &self.runs {
            agreement.add(run.disagreements.is_empty());
        }
        agreement
    }

    /// Names of the settings.
    pub fn settings(&self) -> BTreeSet<&str> {
        let settings = self.runs.iter().flat_map(|run| run.flips_here.keys());
        settings.map(String::as_str).collect()
    }

    /// How often all properties of a run agree in a setting: with this program's engine, and with
    /// the plain setting.
    pub fn of_setting(&self, setting: &str) -> [Agreement; 2] {
        let mut both = [Agreement::default(); 2];
        for run in &self.runs {
            for (agreement, flips) in both.iter_mut().zip([&run.flips_here, &run.flips_there]) {
                if let Some(flips) = flips.get(setting) {
                    agreement.add(flips.is_empty());
                }
            }
        }
        both
    }

    /// How often each property agrees, by name.
    pub fn of_properties(&self) -> Vec<PropertyAgreement> {
        let mut found: BTreeMap<&str, PropertyAgreement> = BTreeMap::new();
        for (property, [here, there]) in self.runs.iter().flat_map(|run| &run.decided) {
            let own = found.entry(property).or_insert_with(|| PropertyAgreement {
                property: property.clone(),
                engines: Agreement::default(),
                itself: self.lowest_with_itself(property),
                only_here: 0,
                only_there: 0,
            });
            own.engines.add(here == there);
            own.only_here += u64::from(*here && !there);
            own.only_there += u64::from(*there && !here);
        }
        found.into_values().collect()
    }

    /// The other engine's agreement with itself about a property, in the setting in which that is
    /// lowest.
    fn lowest_with_itself(&self, property: &str) -> Agreement {
        let of = |setting: &str| {
            let mut agreement = Agreement::default();
            for flips in self
                .runs
                .iter()
                .filter_map(|run| run.flips_there.get(setting))
            {
                agreement.add(!flips.contains(property));
            }
            agreement
        };
        let changed = self.settings().into_iter();
        let changed = changed.filter(|setting| *setting != self.plain);
        changed
            .map(of)
            .min_by_key(|agreement| agreement.agree)
            .unwrap_or_default()
    }

    /// The setting that is the likely cause of the disagreements, with the number of runs in which it
    /// agrees beyond those of the plain one: at least half of the disagreements vanish with it, and
    /// at least three.
    pub fn likely_cause(&self) -> Option<(&str, u64)> {
        let [plain, _] = self.of_setting(self.plain);
        let missing = plain.of - plain.agree;
        let better = self.settings().into_iter().filter_map(|setting| {
            let [agreement, _] = self.of_setting(setting);
            let gain = agreement.agree.checked_sub(plain.agree)?;
            let explains = gain >= LEAST_EXPLAINED && EXPLAINED_SHARE * gain >= missing;
            explains.then_some((setting, gain))
        });
        better.max_by_key(|(_, gain)| *gain)
    }
}

/// A property of an action of a run: number of the action, from 0, and IRI.
type StepProperty = (usize, String);

/// The explanation of an outcome.
fn witness(record: &RunRecord, (step, property): &StepProperty) -> String {
    let judgements = record.judgements.get(*step).into_iter().flatten();
    let mut own = judgements.filter(|judgement| judgement.property == *property);
    own.next()
        .map_or_else(String::new, |judgement| judgement.witness.clone())
}

/// Returns the outcomes that both records decide.
fn decided(here: &RunRecord, there: &RunRecord) -> BTreeMap<StepProperty, [bool; 2]> {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A run of which these settings decide `Held` otherwise than this program's engine, and than
    /// the plain setting.
    fn run(number: usize, here: &[&str], there: &[&str]) -> RunInEngines {
        let flips = |names: &[&str], settings: &[&str]| {
            let of = |setting: &&str| {
                let flipped = names.contains(setting).then(|| "Held".to_owned());
                ((*setting).to_owned(), flipped.into_iter().collect())
            };
            settings.iter().map(of).collect()
        };
        let disagrees = here.contains(&"plain");
        RunInEngines {
            run: format!("k-{number}"),
            decided: vec![("Held".to_owned(), [true, !disagrees])],
            disagreements: disagrees
                .then(|| Disagreement {
                    property: "Held".to_owned(),
                    here: String::new(),
                    there: String::new(),
                })
                .into_iter()
                .collect(),
            flips_here: flips(here, &["plain", "cone", "friction"]),
            flips_there: flips(there, &["cone", "friction"]),
            parting: None,
            contact: None,
        }
    }

    #[test]
    fn a_setting_that_removes_half_of_the_disagreements_is_the_likely_cause() {
        let agreeing = (0..6).map(|number| run(number, &["cone"], &["cone"]));
        let differing = (6..10).map(|number| run(number, &["plain", "cone"], &["friction"]));
        let found = EngineComparison {
            plain: "plain",
            runs: agreeing.chain(differing).collect(),
        };
        assert_eq!(found.agreement(), Agreement { agree: 6, of: 10 });
        assert_eq!(found.likely_cause(), Some(("friction", 4)));
        let [held] = &found.of_properties()[..] else {
            panic!("{:?}", found.of_properties())
        };
        assert_eq!(
            (held.engines, held.only_here, held.only_there),
            (Agreement { agree: 6, of: 10 }, 4, 0)
        );
        assert_eq!(held.itself, Agreement { agree: 4, of: 10 }, "by its cones");
        let few = EngineComparison {
            runs: found.runs[..8].to_vec(),
            ..found
        };
        assert_eq!(few.likely_cause(), None, "two runs are too few");
    }

    #[test]
    fn courses_part_where_a_body_is_elsewhere() {
        let frames = |ends_at: f32| Frames {
            period_secs: 0.1,
            names: vec!["can".to_owned()],
            rows: [0.0, ends_at]
                .map(|x| vec![x, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
                .to_vec(),
        };
        assert_eq!(parting(&frames(0.3), &frames(0.303)), None);
        let parted = parting(&frames(0.3), &frames(0.306));
        assert_eq!(
            parted,
            Some(Parting {
                secs: 0.1,
                body: "can".to_owned()
            })
        );
    }
}
