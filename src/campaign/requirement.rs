//! A rule file of the configuration that scenes must satisfy before a run begins.

use crate::preconditions::{facts_before, facts_of_state};
use crate::{Failure, scene_facts};
use actcheck_base::{Diagnostics, RuleFault, names};
use actcheck_config::Campaign;
use actcheck_data::Scene;
use actcheck_ontology::{Ontology, Property, RuleFile};
use actcheck_rules::{Budget, RuleBook};
use actcheck_world::World;

/// The rules that `[scene] require` names, prepared for evaluation.
pub(super) struct Requirement {
    rules: RuleBook,
    /// IRI of the property that represents them.
    iri: String,
    /// Path of the file as written in the configuration.
    path: String,
}

impl Requirement {
    /// Prepares the rules of a configuration with the ontology's libraries. Returns `None` if it
    /// has no rules for scenes.
    ///
    /// # Errors
    /// All faults of the file, each with its place; or the budget is spent.
    pub(super) fn prepare(
        campaign: &Campaign,
        ontology: &Ontology,
        budget: &Budget,
    ) -> Result<Option<Self>, Diagnostics> {
        let Some(source) = &campaign.scene_rule else {
            return Ok(None);
        };
        let iri = names::act("SceneRequirement");
        let path = source.name.to_string();
        let mut property = Property::new(iri.clone(), RuleFile::new(source.clone()));
        property.label = "the scene's requirement".to_owned();
        // The rules may use everything that scene generation sets.
        property.needs = ontology.designators.clone();
        let mut alone = ontology.clone();
        alone.warnings = Diagnostics::new();
        alone.unlinked = Diagnostics::new();
        alone.properties = [(iri.clone(), property)].into();
        alone.vocabulary.terms.extend(scene_facts::vocabulary());
        Ok(Some(Self {
            rules: RuleBook::prepare_within(&alone, budget)?,
            iri,
            path,
        }))
    }

    /// Checks that a settled scene satisfies the rules.
    ///
    /// # Errors
    /// [`Failure::Discard`] if it does not, or if the rules can't be evaluated;
    /// [`Failure::Interrupted`] if the evaluation was interrupted.
    pub(super) fn check(
        &self,
        scene: &Scene,
        world: &World,
        budget: &Budget,
    ) -> Result<(), Failure> {
        let mut facts = facts_of_state(&world.snapshot(), &scene.designators, &scene.map);
        scene_facts::add(scene, &mut facts);
        match self
            .rules
            .judge(
                &facts_before(&facts),
                std::slice::from_ref(&self.iri),
                budget,
            )
            .remove(&self.iri)
        {
            Some(Ok(found)) if found.holds => Ok(()),
            Some(Err(RuleFault::Interrupted)) => Err(Failure::Interrupted),
            Some(Err(fault)) => Err(Failure::Discard(format!(
                "{} can't be evaluated: {fault}",
                self.path
            ))),
            _ => Err(Failure::Discard(format!("does not satisfy {}", self.path))),
        }
    }
}
