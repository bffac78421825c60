//! The prepared rules, and the judgement of one action.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use actcheck_base::{
    Diagnostic, Diagnostics, Files, RunFacts, Source, did_you_mean, guarded, names,
};
use actcheck_data::{ActionEnd, Trace};
use actcheck_ontology::{Action, Ontology, Property, RuleFile, load};
use actcheck_rules::{Budget, RuleBook};
use actcheck_verdict::judge_action;

use crate::during;
use crate::reader::{At, Faults};
use crate::snapshot::{self, State};
use crate::trace::{differing, facts_of, trace};
use crate::verdict::Verdict;
use crate::{Monitor, Value};

/// The shipped ontology.
const SHIPPED: &str = "ontology/actions.ttl";
/// Begin of the names of shipped files.
const BUILT_IN: &str = "built-in:";

/// An ontology with its rules, prepared for judging. Cheap to clone, and shared by threads.
#[derive(Clone)]
pub struct Judge {
    prepared: Arc<Prepared>,
}

pub(crate) struct Prepared {
    pub(crate) ontology: Ontology,
    pub(crate) rules: RuleBook,
    /// The properties to judge an action that the ontology does not have; `None` if there are none.
    any_action: Option<Action>,
}

impl std::fmt::Debug for Judge {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Judge")
            .field("actions", &self.prepared.ontology.actions.keys())
            .finish_non_exhaustive()
    }
}

/// A property that the caller adds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OwnRule {
    /// Local name of the property; with the ending `.rq`, its rule is a SPARQL query.
    pub name: String,
    /// The text of its rule.
    pub text: String,
}

/// One action to judge.
#[derive(Debug, Clone, Copy)]
pub struct Call<'v> {
    /// Local name of the action.
    pub action: &'v str,
    /// The state before it.
    pub before: &'v Value,
    /// The state after it.
    pub after: &'v Value,
    /// The events during it; [`Value::Null`] if none are known.
    pub during: &'v Value,
    /// The values of its designators.
    pub parameters: &'v Value,
}

impl Judge {
    /// Prepares an ontology and own rules. Without an ontology it is the shipped one; if rules are
    /// given, then only these are judged.
    ///
    /// The path may be that of a shipped file, such as `built-in:ontology/time.ttl`.
    ///
    /// # Errors
    /// All faults of the ontology and of its rules, and `J009` for a property whose name can't be one
    /// or is taken.
    pub fn new(ontology: Option<&Path>, rules: &[OwnRule]) -> Result<Self, Diagnostics> {
        guarded(|| Self::prepared(ontology, rules)).unwrap_or_else(|| Err(panicked()))
    }

    fn prepared(path: Option<&Path>, rules: &[OwnRule]) -> Result<Self, Diagnostics> {
        let shipped = path.map_or(Some(SHIPPED), |path| path.to_str()?.strip_prefix(BUILT_IN));
        let (files, file) = match (shipped, path) {
            (None, Some(path)) => (Files::Disk, path.to_owned()),
            (shipped, _) => (Files::Shipped, PathBuf::from(shipped.unwrap_or(SHIPPED))),
        };
        let mut ontology = load(&files, &file)?;
        let own = own_properties(&ontology, rules)?;
        let iris: Vec<String> = own.iter().map(|property| property.iri.clone()).collect();
        let only_own = path.is_none() && !rules.is_empty();
        if only_own {
            ontology.properties.clear();
        }
        for action in ontology.actions.values_mut() {
            if only_own {
                action.success_properties.clear();
                action.preconditions.clear();
                action.premises.clear();
            }
            action.success_properties.extend(iris.iter().cloned());
        }
        ontology.properties.extend(
            own.into_iter()
                .map(|property| (property.iri.clone(), property)),
        );
        let any_action = ontology
            .actions
            .values()
            .next()
            .cloned()
            .filter(|_| only_own);
        let rules = RuleBook::prepare(&ontology)?;
        Ok(Self {
            prepared: Arc::new(Prepared {
                ontology,
                rules,
                any_action,
            }),
        })
    }

    /// Returns the warnings about the ontology and the rules.
    pub fn warnings(&self) -> &Diagnostics {
        self.prepared.rules.warnings()
    }

    /// Returns the local names of the actions.
    pub fn actions(&self) -> impl Iterator<Item = &str> {
        self.prepared.ontology.actions.keys().map(String::as_str)
    }

    /// Returns the IRIs of an action's success properties, in their order.
    ///
    /// # Errors
    /// `J005` if the ontology has no such action.
    pub fn properties(&self, action: &str) -> Result<Vec<String>, Diagnostics> {
        Ok(self.action(action)?.success_properties)
    }

    /// Judges an action.
    ///
    /// # Errors
    /// All faults of its values: an unknown key (`J001`), a wrong kind or shape (`J002`), a number
    /// that is not finite (`J003`), a missing value (`J004`), an unknown action (`J005`), a
    /// designator that is unknown or missing (`J006`), an unknown name (`J007`), or different bodies
    /// before and after the action (`J008`).
    pub fn judge(&self, call: &Call<'_>) -> Result<Verdict, Diagnostics> {
        guarded(|| self.judge_values(call)).unwrap_or_else(|| Err(panicked()))
    }

    fn judge_values(&self, call: &Call<'_>) -> Result<Verdict, Diagnostics> {
        let action = self.action(call.action)?;
        let faults = Faults::default();
        let ontology = &self.prepared.ontology;
        let before = faults.argument("before", call.before);
        let before = snapshot::read(&before, None, ontology);
        let at = faults.argument("after", call.after);
        let after = snapshot::read(&at, Some(&before), ontology);
        same_bodies(&at, &before, &after);
        let at = faults.argument("during", call.during);
        let during = during::read(&at, &before, &after);
        let at = faults.argument("parameters", call.parameters);
        let parameters = self.parameters(&at, &action);
        let (trace, without_classes) = trace(call.action, &parameters, [&before, &after], during);
        faults.or(())?;
        self.verdict(&trace, &action, without_classes)
    }

    /// Judges the first action of a trace.
    ///
    /// # Errors
    /// `J005` if the ontology lacks its action, or if the trace has none.
    pub fn trace(&self, trace: &Trace) -> Result<Verdict, Diagnostics> {
        let named = trace.actions.first().map_or("", |action| &action.action);
        let action = self.action(named)?;
        guarded(|| self.verdict(trace, &action, false)).unwrap_or_else(|| Err(panicked()))
    }

    /// Returns a monitor of an action that begins in a state.
    ///
    /// # Errors
    /// As [`Judge::judge`].
    pub fn monitor(
        &self,
        action: &str,
        before: &Value,
        parameters: &Value,
    ) -> Result<Monitor, Diagnostics> {
        let known = self.action(action)?;
        let faults = Faults::default();
        let at = faults.argument("before", before);
        let state = snapshot::read(&at, None, &self.prepared.ontology);
        let at = faults.argument("parameters", parameters);
        let parameters = self.parameters(&at, &known);
        faults.or(())?;
        Ok(Monitor::new(self.clone(), action, parameters, state))
    }

    pub(crate) fn prepared_rules(&self) -> &Prepared {
        &self.prepared
    }

    pub(crate) fn action(&self, named: &str) -> Result<Action, Diagnostics> {
        let known = self.prepared.ontology.actions.get(named);
        if let Some(action) = known.or(self.prepared.any_action.as_ref()) {
            return Ok(action.clone());
        }
        let message = format!("the ontology has no action `{named}`");
        let known: Vec<&str> = self.actions().collect();
        Err(Diagnostic::error("J005", message)
            .help(did_you_mean(named, known))
            .into())
    }

    pub(crate) fn verdict(
        &self,
        trace: &Trace,
        action: &Action,
        without_classes: bool,
    ) -> Result<Verdict, Diagnostics> {
        let facts = facts_of(trace, without_classes);
        let end = trace
            .actions
            .first()
            .map_or(&ActionEnd::NotReached, |action| &action.end);
        self.of_facts(facts, action, end)
    }

    fn of_facts(
        &self,
        facts: RunFacts,
        action: &Action,
        end: &ActionEnd,
    ) -> Result<Verdict, Diagnostics> {
        let Prepared {
            ontology, rules, ..
        } = &*self.prepared;
        let seen = (facts.start(), facts.action(0));
        let judgements = judge_action(ontology, rules, action, end, seen, &Budget::default())
            .map_err(|interrupted| Diagnostic::error("J011", interrupted.to_string()))?;
        Ok(Verdict::new(self.clone(), facts, judgements))
    }

    /// Reads the values of designators, and checks that the properties' own ones are given.
    fn parameters(&self, at: &At<'_>, action: &Action) -> BTreeMap<String, Vec<String>> {
        let ontology = &self.prepared.ontology;
        let mut found = BTreeMap::new();
        let nothing = Value::Map(Vec::new());
        let without = at.with(&nothing);
        let at = if at.is_none() { &without } else { at };
        for (name, at) in at.named("values by designator") {
            if !ontology.designators.contains(name) {
                let help = did_you_mean(name, ontology.designators.iter().map(String::as_str));
                at.fault("J006", &format!("unknown designator `{name}`"), &help);
            }
            let values = match at.value() {
                Value::Text(text) => Some(vec![text.clone()]),
                _ => at.names(),
            };
            found.insert(name.to_owned(), values.unwrap_or_default());
        }
        let needed = action
            .success_properties
            .iter()
            .filter_map(|iri| ontology.properties.get(iri))
            .flat_map(|property| property.needs.iter().map(move |need| (need, property)));
        let mut reported: BTreeSet<&String> = BTreeSet::new();
        for (need, property) in needed {
            if !found.contains_key(need) && reported.insert(need) {
                let message = format!("`{need}` is missing: `{}` is about it", property.name);
                let help = format!("give the id of a body: `{{\"{need}\": \"…\"}}`");
                at.fault("J006", &message, &help);
            }
        }
        found
    }
}

fn same_bodies(at: &At<'_>, before: &State, after: &State) {
    let differing = differing(before, after);
    if !differing.is_empty() {
        let message = format!(
            "the states before and after must have the same bodies; only one has {}",
            differing
                .iter()
                .map(|id| format!("`{id}`"))
                .collect::<Vec<String>>()
                .join(", ")
        );
        at.fault("J008", &message, "");
    }
}

/// Returns the caller's properties.
fn own_properties(ontology: &Ontology, rules: &[OwnRule]) -> Result<Vec<Property>, Diagnostics> {
    let mut faults = Diagnostics::new();
    let mut own = Vec::new();
    let mut taken: BTreeSet<&str> = BTreeSet::new();
    for rule in rules {
        let (name, file) = match rule.name.strip_suffix(".rq") {
            Some(name) => (name, rule.name.clone()),
            None => (rule.name.as_str(), format!("{}.rls", rule.name)),
        };
        let iri = names::act(name);
        let is_name = name.starts_with(|c: char| c.is_ascii_alphabetic())
            && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        if !is_name {
            let message = format!("`{name}` can't be the name of a property");
            faults.push(
                Diagnostic::error("J009", message)
                    .help("begin with a letter, and use letters, digits and `_`"),
            );
        } else if ontology.properties.contains_key(&iri) || !taken.insert(name) {
            let message = format!("there is another property `{name}`");
            faults.push(Diagnostic::error("J009", message).help("choose another name"));
        }
        let file = RuleFile::new(Source::new(file, rule.text.as_str()));
        own.push(Property::new(iri, file));
    }
    faults.or(own)
}

/// The fault of our own code.
pub(crate) fn panicked() -> Diagnostics {
    Diagnostic::error("J011", "the judge stopped at a fault of its own")
        .help("please report it with the values that you gave")
        .into()
}
