//! Warns of success properties that no action can change: their rules read only facts that are the
//! same whatever the robot does.
//!
//! Such facts are the ontology, the designators, the state before the action, and constant
//! properties of bodies, joints and the map. Every other fact, and every fact about the course of
//! the action, may depend on the robot, so that only rules that never read one are reported. A
//! precondition or a premise is supposed to read the state before the action.

use std::collections::BTreeSet;

use crate::model::given::Phases;
use crate::model::program::{
    Atom, CheckedProgram, Literal, Operand, PredicateId, Predicates, Rule, RulesByHead, Scope,
};
use actcheck_base::{CONSTANT_PROPERTIES, Diagnostic, Source, Span, TermId, Terms, names};
use actcheck_ontology::{Ontology, Property};

/// Warning R046 for a property that no action can change.
pub(crate) fn warning(
    ontology: &Ontology,
    property: &Property,
    source: &Source,
    span: Span,
) -> Option<Diagnostic> {
    let has = |list: &[String]| list.contains(&property.iri);
    if ontology
        .actions
        .values()
        .any(|action| has(&action.preconditions) || has(&action.premises))
    {
        return None;
    }
    let action = ontology
        .actions
        .iter()
        .find(|(_, action)| has(&action.success_properties))?
        .0;
    let message = format!(
        "no action can change the outcome of `{}`, a success property of `{action}`",
        property.name
    );
    let help = "its rules read only the state before the action, constants such as `w:mass`, designators and the ontology: \
                read `after` or `during`, or state it as `act:precondition`";
    Some(
        Diagnostic::warning("R046", message)
            .at(source, span)
            .help(help),
    )
}

/// The rules that may derive each predicate, and the facts that they read.
pub(crate) struct Reads<'a> {
    rules: RulesByHead<'a>,
    predicates: &'a Predicates,
    phases: Phases,
    /// Ids of the constant properties.
    constant: BTreeSet<TermId>,
}

/// A predicate, and whether only its facts about the state before the action are read.
type Read = (PredicateId, bool);

impl<'a> Reads<'a> {
    pub(crate) fn new(
        library: &'a CheckedProgram,
        predicates: &'a Predicates,
        phases: Phases,
        terms: &Terms,
    ) -> Self {
        let mut reads = Self {
            rules: RulesByHead::default(),
            predicates,
            phases,
            constant: BTreeSet::new(),
        };
        reads.rules.add(library);
        let is_constant = |iri: &str| {
            iri.strip_prefix(names::W)
                .is_some_and(|local| CONSTANT_PROPERTIES.contains(&local))
        };
        let known = predicates
            .list
            .iter()
            .filter_map(|predicate| predicate.property);
        let constant = known.filter(|property| {
            let iri = terms.term(*property).as_iri();
            iri.is_some_and(|iri| is_constant(iri) || iri == format!("{}type", names::RDF))
        });
        reads.constant.extend(constant);
        reads
    }

    /// The first rule of a property's verdict, if no rule of it reads a fact that an action can
    /// change.
    pub(crate) fn unchanging(
        mut self,
        program: &'a CheckedProgram,
        scope: Scope,
    ) -> Option<&'a Rule> {
        self.rules.add(program);
        let verdict = ["success", "violation", "applicable"];
        let verdict: Vec<PredicateId> = verdict
            .into_iter()
            .filter_map(|name| self.predicates.find(scope, name, None))
            .collect();
        let mut seen = BTreeSet::new();
        let mut rules = verdict
            .iter()
            .flat_map(|predicate| self.rules.of(*predicate));
        if rules.any(|rule| self.rule_changes(rule, false, &mut seen)) {
            return None;
        }
        program
            .rules
            .iter()
            .find(|rule| verdict.contains(&rule.head.predicate))
    }

    /// Whether a rule reads a fact that an action can change. `before`: only its facts about the
    /// state before are read.
    fn rule_changes(&self, rule: &Rule, before: bool, seen: &mut BTreeSet<Read>) -> bool {
        let phase = match rule.head.args.first() {
            Some(Operand::Variable(phase)) if before => Some(*phase),
            _ => None,
        };
        let mut after = rule
            .aggregation
            .iter()
            .flat_map(|aggregation| &aggregation.after);
        let is_timed = after.any(|(_, value)| value.is_timed());
        is_timed
            || rule.body.iter().any(|literal| match literal {
                Literal::Positive(atom) | Literal::Negative(atom) => {
                    self.atom_changes(atom, phase, seen)
                }
                Literal::Assign { value, .. } | Literal::Test { value, .. } => value.is_timed(),
                Literal::Compare { left, right, .. } => left.is_timed() || right.is_timed(),
            })
    }

    /// `before` is the variable whose value is the state before the action.
    fn atom_changes(&self, atom: &Atom, before: Option<usize>, seen: &mut BTreeSet<Read>) -> bool {
        let predicate = self.predicates.get(atom.predicate);
        let is_state = predicate.given && predicate.name == "state";
        if predicate.given && !matches!(predicate.name.as_str(), "state" | "ontology" | "parameter")
        {
            return true;
        }
        let phase = atom.args.first().filter(|_| is_state);
        let is_before = match phase {
            Some(Operand::Constant(phase)) => *phase == self.phases.before,
            Some(Operand::Variable(phase)) => Some(*phase) == before,
            _ => false,
        };
        if is_state && !is_before {
            let is_after =
                matches!(phase, Some(Operand::Constant(phase)) if *phase == self.phases.after);
            return !(is_after
                && predicate
                    .property
                    .is_some_and(|property| self.constant.contains(&property)));
        }
        if !seen.insert((atom.predicate, is_before)) {
            return false;
        }
        let reads_before = |rule: &&Rule| match rule.head.args.first() {
            Some(Operand::Constant(phase)) if is_state => *phase == self.phases.before,
            _ => true,
        };
        let mut rules = self.rules.of(atom.predicate).filter(reads_before);
        rules.any(|rule| self.rule_changes(rule, is_before, seen))
    }
}
