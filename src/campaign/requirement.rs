//! What a scene has to satisfy before anything happens in it: a rule file of the configuration.

use crate::actions::{ActionTrace, Frames, Trace};
use crate::base::{Diagnostics, digest_of, names};
use crate::campaign::{Failure, scene_facts};
use crate::config::Campaign;
use crate::facts::{self, ActionFacts};
use crate::ontology::{Ontology, Property, RuleFile, RuleLanguage};
use crate::rules::{Budget, RuleBook, RuleFault};
use crate::scenario::Scene;
use crate::world::World;

/// The rules that `[scene] require` names, ready to be asked.
pub(super) struct Requirement {
    rules: RuleBook,
    /// The property that stands for them.
    iri: String,
    /// The file, as the configuration names it.
    path: String,
}

impl Requirement {
    /// Prepares the rules of a configuration, if it has some, with the ontology's libraries.
    ///
    /// # Errors
    /// All faults of the file, each with its place; a budget that was spent.
    pub(super) fn prepare(
        campaign: &Campaign,
        ontology: &Ontology,
        budget: &Budget,
    ) -> Result<Option<Self>, Diagnostics> {
        let Some(source) = &campaign.scene_rule else { return Ok(None) };
        let iri = names::act("SceneRequirement");
        let path = source.name.to_string();
        let property = Property {
            iri: iri.clone(),
            name: "SceneRequirement".to_owned(),
            label: "what a scene has to satisfy".to_owned(),
            comment: None,
            rule: RuleFile {
                source: source.clone(),
                language: if path.ends_with(".rq") { RuleLanguage::Sparql } else { RuleLanguage::Datalog },
                path: path.clone(),
                digest: digest_of(&source.text),
                linked_at: None,
            },
            // It may speak of everything that scene generation sets.
            needs: ontology.designators.clone(),
            unit: None,
        };
        let mut alone = ontology.clone();
        alone.properties = [(iri.clone(), property)].into();
        alone.vocabulary.terms.extend(scene_facts::vocabulary());
        Ok(Some(Self { rules: RuleBook::prepare_within(&alone, budget)?, iri, path }))
    }

    /// Whether a scene that has settled satisfies the rules.
    ///
    /// # Errors
    /// It does not, or the rules could not be asked: the scene is discarded. Somebody interrupted.
    pub(super) fn check(&self, scene: &Scene, world: &World, budget: &Budget) -> Result<(), Failure> {
        let trace = Trace {
            snapshots: vec![world.snapshot()],
            // It only says what the designators stand for.
            actions: vec![ActionTrace::not_reached("", &scene.designators)],
            frames: Frames::default(),
            hash: String::new(),
            map: scene.map.clone(),
            forms: Vec::new(),
            robot_courses: Vec::new(),
        };
        let mut facts = facts::extract(&trace);
        scene_facts::add(scene, &mut facts);
        let state = &facts.snapshots[0];
        let asked = ActionFacts {
            terms: &facts.terms,
            before: state,
            after: state,
            during: &[],
            parameters: &facts.parameters[0],
        };
        match self.rules.judge(&asked, std::slice::from_ref(&self.iri), budget).remove(&self.iri) {
            Some(Ok(found)) if found.holds => Ok(()),
            Some(Err(RuleFault::Interrupted)) => Err(Failure::Interrupted),
            Some(Err(fault)) => Err(Failure::Discard(format!("{} can't be asked: {fault}", self.path))),
            _ => Err(Failure::Discard(format!("does not satisfy {}", self.path))),
        }
    }
}
