//! Consistency of repeated scenes, for each property and for whole runs.

use std::collections::BTreeMap;

use crate::{CampaignSummary, RunSummary};
use actcheck_analysis::{Consistency, Interval, Repeated, consistency};
use actcheck_base::{Judgement, Outcome};
use actcheck_verdict::Counts;

/// Consistency of repeated runs in one property, or of whole runs.
#[derive(Debug, Clone, PartialEq)]
pub struct RepeatedProperty {
    /// IRI of the property. `None` for whole runs, which pass if everything passes.
    pub property: Option<String>,
    /// Its label.
    pub label: String,
    /// Measured consistency.
    pub found: Consistency,
}

impl CampaignSummary {
    /// Consistency of each property, then of whole runs. Empty if every scene was run once.
    pub fn repeated(&self) -> Vec<RepeatedProperty> {
        if !self.is_repeated() {
            return Vec::new();
        }
        let properties = self
            .properties
            .iter()
            .map(|(iri, label, _)| (Some(iri), label.as_str()));
        properties
            .chain([(None, "everything")])
            .map(|(iri, label)| RepeatedProperty {
                property: iri.cloned(),
                label: label.to_owned(),
                found: consistency(&self.decided(iri.map(String::as_str)), self.sampling()),
            })
            .collect()
    }

    /// Runs of a scene, in order of repetition.
    pub fn runs_of_scene(&self, scene: u64) -> impl Iterator<Item = &RunSummary> {
        self.runs.iter().filter(move |run| {
            run.repetition
                .is_some_and(|repetition| repetition.scene == scene)
        })
    }

    /// Interval of a pass rate that accounts for repeated scenes and bit-identical runs. Returns
    /// `None` if every scene was run once.
    pub(super) fn interval_of_alike(&self, property: Option<&str>) -> Option<Interval> {
        let is_alike = self.is_repeated()
            || self
                .scenes()
                .iter()
                .zip(0..)
                .any(|(scene, place)| *scene != place);
        if is_alike {
            consistency(&self.decided(property), self.sampling()).rate
        } else {
            None
        }
    }

    /// The scene of each run: its number if scenes are repeated, else the position of the first run
    /// with the same trace.
    fn scenes(&self) -> Vec<u64> {
        let mut first = BTreeMap::new();
        let mut scenes = Vec::new();
        for (run, place) in self.runs.iter().zip(0..) {
            scenes.push(match run.repetition {
                Some(repetition) => repetition.scene,
                None if run.trace_hash.is_empty() => place,
                None => *first.entry(&run.trace_hash).or_insert(place),
            });
        }
        scenes
    }

    pub(super) fn is_repeated(&self) -> bool {
        self.runs.iter().any(|run| run.repetition.is_some())
    }

    /// The runs in which a property was decided. Without a property, all runs that are not broken.
    fn decided(&self, property: Option<&str>) -> Vec<Repeated> {
        let of = |(run, scene): (&RunSummary, u64)| {
            let Some(property) = property else {
                let judged = run.status != actcheck_history::RunStatus::Broken;
                return judged.then(|| Repeated {
                    scene,
                    passed: run.passed(),
                    margin: None,
                });
            };
            let judgements = run.actions.iter().flat_map(|action| &action.judgements);
            let own: Vec<&Judgement> = judgements
                .filter(|judgement| judgement.property == property)
                .collect();
            let counts = Counts::of(own.iter().map(|judgement| judgement.outcome));
            let margins: Option<Vec<f64>> = own
                .iter()
                .filter(|judgement| is_decided(judgement))
                .map(|judgement| judgement.margin)
                .collect();
            let margin = margins.and_then(|margins| margins.into_iter().reduce(f64::min));
            (counts.decided() > 0).then_some(Repeated {
                scene,
                passed: counts.failed == 0,
                margin,
            })
        };
        self.runs.iter().zip(self.scenes()).filter_map(of).collect()
    }
}

fn is_decided(judgement: &Judgement) -> bool {
    matches!(judgement.outcome, Outcome::Passed | Outcome::Failed)
}
