//! Prepares the rule book of an ontology: parses and checks every file, drops unused rules and
//! plans the rest.

use std::collections::BTreeMap;
#[cfg(feature = "sparql")]
use std::collections::BTreeSet;
use std::sync::Arc;

use crate::book::judge::{Judge, JudgeRules, RuleBook};
use crate::book::owl::owl_closure_within;
use crate::book::parts::{extend, gather_state, gathers_state, needed, split_fixed, split_timed};
use crate::check::checking::{Checking, Role, unique, used_names};
use crate::check::facts_read::{Derivations, FactsRead};
use crate::check::formulas::{self, Bound};
use crate::check::ranges::Ranges;
use crate::check::sides::Sides;
use crate::check::stratify::stratify;
use crate::check::termination::warnings;
use crate::check::unchanging::{self, Reads};
use crate::check::units::Units;
use crate::engine::budget::Budget;
use crate::engine::evaluate::{Layers, Planned, Tables, evaluate, fault};
use crate::engine::load::Given;
use crate::engine::meter::Meter;
use crate::engine::plan::Indexes;
use crate::engine::reading::Verdict;
use crate::model::given::Phases;
use crate::model::program::{CheckedProgram, Predicates, Rule};
use crate::model::universe::Universe;
#[cfg(feature = "sparql")]
use crate::sparql::{
    dataset::Statements, facts_read::facts_read, query::Query, unchanging::is_unchanging,
};
use crate::syntax::{Syntax, parse};
use crate::temporal::{add_margin, add_moment, define_moment, mark_consequents, reads_course};
use actcheck_base::{Diagnostic, Diagnostics, Digest, Term, TermId, Terms};
use actcheck_ontology::{Ontology, Property, RuleLanguage};

impl RuleBook {
    /// Parses, checks and plans the rule file of every property with all libraries.
    ///
    /// # Errors
    /// All errors of all files, each with its place.
    pub fn prepare(ontology: &Ontology) -> Result<Self, Diagnostics> {
        Self::prepare_within(ontology, &Budget::default())
    }

    /// Like [`RuleBook::prepare`], with a budget for each evaluation over the ontology alone.
    ///
    /// # Errors
    /// All errors of all files, each with its place, or an exceeded budget.
    pub fn prepare_within(ontology: &Ontology, budget: &Budget) -> Result<Self, Diagnostics> {
        Preparing::within(budget).run(ontology)
    }

    /// Prepares the rules of an ontology that differs from this book's only in having fewer
    /// properties. The closure of its statements is not computed again.
    ///
    /// # Errors
    /// As [`RuleBook::prepare`].
    pub fn restricted(&self, ontology: &Ontology) -> Result<Self, Diagnostics> {
        Preparing {
            closed: self.closed.clone(),
            ..Preparing::default()
        }
        .run(ontology)
    }
}

/// The state of preparing a book.
#[derive(Default)]
pub(crate) struct Preparing {
    terms: Terms,
    diagnostics: Diagnostics,
    /// Properties that libraries derive in the snapshots. Queries may use them.
    #[cfg(feature = "sparql")]
    derived: BTreeSet<String>,
    /// Budget of each evaluation over the ontology alone.
    budget: Budget,
    /// The ontology's statements with their closure, once they are known.
    closed: Option<Arc<[[Term; 3]]>>,
}

impl Preparing {
    pub(crate) fn within(budget: &Budget) -> Self {
        Self {
            budget: budget.clone(),
            ..Self::default()
        }
    }

    pub(crate) fn run(mut self, ontology: &Ontology) -> Result<RuleBook, Diagnostics> {
        self.diagnostics.extend(ontology.warnings.clone());
        self.diagnostics.extend(ontology.unlinked.clone());
        let phases = Phases::intern(&mut self.terms);
        let (libraries, properties) = self.parse(ontology);
        let vocabulary =
            Some(&ontology.vocabulary).filter(|vocabulary| !vocabulary.terms.is_empty());
        let mut checking = Checking::new(&mut self.terms, vocabulary);
        for syntax in &libraries {
            checking.define(syntax, Role::Library);
        }
        for (scope, _, syntax) in &properties {
            checking.define(syntax, Role::Property(*scope));
            define_moment(&mut checking, syntax, *scope);
        }
        let mut library = CheckedProgram::default();
        for syntax in &libraries {
            extend(&mut library, checking.rules(syntax, Role::Library));
        }
        let mut programs = BTreeMap::new();
        for (scope, _, syntax) in &properties {
            let mut program = checking.rules(syntax, Role::Property(*scope));
            add_margin(&mut checking, &mut program, syntax, *scope);
            add_moment(&checking, &mut program, *scope);
            programs.insert(*scope, program);
            warn_unused(&mut checking, syntax, *scope);
        }
        let (mut predicates, split, found) =
            (checking.predicates, checking.split, checking.diagnostics);
        #[cfg(feature = "sparql")]
        {
            self.derived = checking.derived_terms;
        }
        self.diagnostics.extend(found);
        self.types_and_units(ontology, &library, &programs, &properties, &predicates);
        if split {
            self.unchanging(
                ontology,
                &library,
                &programs,
                &properties,
                (&predicates, phases),
            );
            self.one_sided(&library, &programs, &properties, &predicates);
        }
        if split {
            library.rules.extend(gather_state(&mut predicates));
        }
        let reads = self.reads(ontology, &library, &programs, &properties, &predicates);
        let mut book =
            self.assemble(ontology, phases, library, programs, &properties, predicates)?;
        for (iri, reads) in reads {
            if let Some(judge) = book.properties.get_mut(&iri) {
                judge.reads = reads;
            }
        }
        Ok(book)
    }

    /// Parses all libraries and all Datalog properties. Each property gets a scope, numbered from 1.
    fn parse<'o>(
        &mut self,
        ontology: &'o Ontology,
    ) -> (Vec<Syntax>, Vec<(usize, &'o Property, Syntax)>) {
        let mut libraries = Vec::new();
        for file in &ontology.libraries {
            if file.language == RuleLanguage::Sparql {
                let help = "write it in Datalog, in a file that ends in `.rls`";
                self.diagnostics.push(
                    Diagnostic::error("R034", "a rule library can't be a SPARQL query")
                        .in_source(&file.source)
                        .help(help),
                );
                continue;
            }
            let (syntax, found) = parse(&file.source);
            self.diagnostics.extend(found);
            libraries.push(syntax);
        }
        let mut properties = Vec::new();
        for (idx, property) in ontology.properties.values().enumerate() {
            if property.rule.language == RuleLanguage::Datalog {
                let (syntax, found) = parse(&property.rule.source);
                self.diagnostics.extend(found);
                properties.push((idx + 1, property, syntax));
            }
        }
        (libraries, properties)
    }

    /// Returns the facts that each property reads.
    fn reads(
        &self,
        ontology: &Ontology,
        library: &CheckedProgram,
        programs: &BTreeMap<usize, CheckedProgram>,
        properties: &[(usize, &Property, Syntax)],
        predicates: &Predicates,
    ) -> BTreeMap<String, FactsRead> {
        let derivations = Derivations::new(library, predicates, &self.terms);
        let mut reads = BTreeMap::new();
        for (scope, property, _) in properties {
            if let Some(program) = programs.get(scope) {
                reads.insert(
                    property.iri.clone(),
                    derivations.of_program(program, *scope),
                );
            }
        }
        #[cfg(feature = "sparql")]
        for property in ontology.properties.values() {
            if property.rule.language == RuleLanguage::Sparql {
                let read = facts_read(&property.rule.source.text);
                reads.insert(
                    property.iri.clone(),
                    derivations.of_query(&read.properties, read.of_any),
                );
            }
        }
        #[cfg(not(feature = "sparql"))]
        let _ = ontology;
        reads
    }

    fn assemble(
        mut self,
        ontology: &Ontology,
        phases: Phases,
        library: CheckedProgram,
        mut programs: BTreeMap<usize, CheckedProgram>,
        syntaxes: &[(usize, &Property, Syntax)],
        predicates: Predicates,
    ) -> Result<RuleBook, Diagnostics> {
        let triples = self.closed(ontology);
        let mut indexes = Indexes::new(&predicates);
        let has_sparql = ontology
            .properties
            .values()
            .any(|p| p.rule.language == RuleLanguage::Sparql);
        let library = self.stratified(library, &predicates);
        let library = {
            let reads = |rule: &Rule| !gathers_state(rule) && reads_course(rule, &predicates);
            let (timed, rest) = split_timed(library, reads);
            self.only_own_predicates(&timed, &predicates);
            for program in programs.values_mut() {
                let timed = needed(
                    timed.clone(),
                    std::iter::once(&*program),
                    false,
                    &predicates,
                );
                extend(program, timed);
            }
            rest
        };
        let library = needed(library, programs.values(), has_sparql, &predicates);
        let mut given = Given::new(&predicates, phases);
        given.restrict_course(&programs.values().chain([&library]).collect::<Vec<_>>());
        let (fixed, moving) = split_fixed(library, &predicates);
        let fixed = self.plan(fixed, &predicates, &mut indexes);
        let libraries = self.plan(moving, &predicates, &mut indexes);
        let program_reads_course = |program: &CheckedProgram| {
            program
                .rules
                .iter()
                .any(|rule| reads_course(rule, &predicates))
        };
        let bounds = programs
            .values()
            .flat_map(|program| Bound::all_of(&program.rules))
            .collect();
        let any_reads_course = programs.values().any(program_reads_course);
        let mut properties = self.queries(ontology);
        for (scope, property, syntax) in syntaxes {
            let mut program = programs.remove(scope).unwrap_or_default();
            let verdict = Verdict::new(&program, &predicates, *scope);
            let implies = verdict
                .decisive
                .as_ref()
                .is_some_and(|decisive| mark_consequents(&mut program, decisive));
            let reads_course = program_reads_course(&program);
            let planned = Box::new(self.plan(program, &predicates, &mut indexes));
            let rules = JudgeRules::Datalog {
                planned,
                verdict,
                reads_course,
                implies,
                scope: *scope,
                prefixes: syntax.prefixes.clone(),
            };
            properties.insert(property.iri.clone(), judge(ontology, property, rules));
        }
        self.diagnostics = unique(self.diagnostics);
        if self.diagnostics.has_errors() {
            return Err(self.diagnostics);
        }
        let own = given.load_ontology(&triples, &predicates, &indexes);
        let fixed_facts = given.load_ontology(&triples, &predicates, &indexes);
        #[cfg(feature = "sparql")]
        let statements = Statements::new(if has_sparql { &triples } else { &[] }, &mut self.terms);
        let fixed_tables = self.close_fixed(&fixed, own, &predicates, &indexes)?;
        Ok(RuleBook {
            terms: self.terms,
            predicates,
            indexes,
            given,
            fixed: fixed_tables,
            fixed_facts,
            fixed_rules: fixed,
            libraries,
            properties,
            closed: self.closed,
            #[cfg(feature = "sparql")]
            statements,
            warnings: self.diagnostics,
            reads_course: any_reads_course,
            bounds,
        })
    }

    /// Reports impossible values and mismatched units in the libraries and in every property.
    fn types_and_units(
        &mut self,
        ontology: &Ontology,
        library: &CheckedProgram,
        programs: &BTreeMap<usize, CheckedProgram>,
        properties: &[(usize, &Property, Syntax)],
        predicates: &Predicates,
    ) {
        let ranges = Ranges::new(ontology);
        for program in std::iter::once(library).chain(programs.values()) {
            ranges.check(
                &program.rules,
                predicates,
                &self.terms,
                &mut self.diagnostics,
            );
            formulas::check(&program.rules, &mut self.diagnostics);
        }
        let mut units = Units::new(predicates, &ontology.vocabulary, &self.terms);
        units.learn(&library.rules);
        units.check(&library.rules, &mut self.diagnostics);
        for (scope, property, _) in properties {
            let Some(program) = programs.get(scope) else {
                continue;
            };
            units.learn(&program.rules);
            units.check(&program.rules, &mut self.diagnostics);
            if let (Some(margin), Some(unit)) =
                (predicates.find(*scope, "margin", None), &property.unit)
            {
                units.check_margin(&program.rules, margin, unit, &mut self.diagnostics);
            }
        }
    }

    /// Warns of success properties that no action can change.
    fn unchanging(
        &mut self,
        ontology: &Ontology,
        library: &CheckedProgram,
        programs: &BTreeMap<usize, CheckedProgram>,
        properties: &[(usize, &Property, Syntax)],
        (predicates, phases): (&Predicates, Phases),
    ) {
        for (scope, property, syntax) in properties {
            let Some(program) = programs.get(scope).filter(|_| syntax.whole) else {
                continue;
            };
            let reads = Reads::new(library, predicates, phases, &self.terms);
            if let Some(rule) = reads.unchanging(program, *scope) {
                let (source, span) = (&rule.origin.source, rule.head.span.clone());
                self.diagnostics.extend(
                    unchanging::warning(ontology, property, source, span)
                        .map(Into::into)
                        .unwrap_or_default(),
                );
            }
        }
    }

    /// Warns of properties that depend on the order of a contact's two sides.
    fn one_sided(
        &mut self,
        library: &CheckedProgram,
        programs: &BTreeMap<usize, CheckedProgram>,
        properties: &[(usize, &Property, Syntax)],
        predicates: &Predicates,
    ) {
        let Some(sides) = Sides::new(library, predicates, &self.terms) else {
            return;
        };
        for (scope, _, syntax) in properties {
            if let Some(program) = programs.get(scope).filter(|_| syntax.whole) {
                self.diagnostics.extend(
                    sides
                        .one_sided(program, *scope)
                        .map(Into::into)
                        .unwrap_or_default(),
                );
            }
        }
    }

    /// Returns the ontology's statements with their OWL 2 RL closure.
    fn closed(&mut self, ontology: &Ontology) -> Vec<[TermId; 3]> {
        // Without statements, only the axioms of OWL itself follow.
        if ontology.triples.is_empty() {
            return Vec::new();
        }
        let closed = match self.closed.take() {
            Some(closed) => closed,
            None => owl_closure_within(&ontology.triples, &self.budget)
                .unwrap_or_else(|found| {
                    self.diagnostics.extend(found);
                    Vec::new()
                })
                .into(),
        };
        let ids = closed
            .iter()
            .map(|triple| {
                triple
                    .each_ref()
                    .map(|term| self.terms.intern(term.clone()))
            })
            .collect();
        self.closed = Some(closed);
        ids
    }

    /// Prepares the SPARQL properties.
    #[cfg(feature = "sparql")]
    fn queries(&mut self, ontology: &Ontology) -> BTreeMap<String, Judge> {
        let mut judges = BTreeMap::new();
        for property in ontology
            .properties
            .values()
            .filter(|p| p.rule.language == RuleLanguage::Sparql)
        {
            match Query::prepare(&property.rule.source, ontology, &self.derived) {
                Ok(mut query) => {
                    if is_unchanging(&property.rule.source.text) {
                        let (source, start) = (
                            &property.rule.source,
                            query.start(&property.rule.source.text),
                        );
                        let found = unchanging::warning(ontology, property, source, start);
                        self.diagnostics
                            .extend(found.map(Into::into).unwrap_or_default());
                    }
                    self.diagnostics.extend(std::mem::take(&mut query.warnings));
                    let rules = JudgeRules::Sparql(Box::new(query));
                    judges.insert(property.iri.clone(), judge(ontology, property, rules));
                }
                Err(found) => self.diagnostics.extend(found),
            }
        }
        judges
    }

    /// Reports library rules that derive facts of the snapshots from the course of the action:
    /// every property reads the snapshots, also in runs without a course.
    fn only_own_predicates(&mut self, timed: &CheckedProgram, predicates: &Predicates) {
        for rule in timed
            .rules
            .iter()
            .filter(|rule| predicates.get(rule.head.predicate).given)
        {
            let name = &predicates.get(rule.head.predicate).name;
            let message = format!("`{name}` can't depend on the course of the action");
            let help = "derive a predicate with a name of its own: every property reads the snapshots, with a course or \
                        without";
            let place = rule.head.span.clone();
            self.diagnostics.push(
                Diagnostic::error("R053", message)
                    .at(&rule.origin.source, place)
                    .help(help),
            );
        }
    }

    /// Reports the SPARQL properties, which need the feature `sparql`.
    #[cfg(not(feature = "sparql"))]
    fn queries(&mut self, ontology: &Ontology) -> BTreeMap<String, Judge> {
        for property in ontology
            .properties
            .values()
            .filter(|p| p.rule.language == RuleLanguage::Sparql)
        {
            let message = format!(
                "`{}` is a SPARQL query, which this build can't evaluate",
                property.rule.path
            );
            let help = "build `actcheck-rules` with the feature `sparql`, or write the property in Datalog (`.rls`)";
            let diagnostic = Diagnostic::error("R062", message)
                .in_source(&property.rule.source)
                .help(help);
            self.diagnostics.push(diagnostic);
        }
        BTreeMap::new()
    }

    /// Checks that the whole library can be stratified, including unused rules. Returns an empty
    /// program if it can't.
    fn stratified(&mut self, library: CheckedProgram, predicates: &Predicates) -> CheckedProgram {
        match stratify(
            &library.rules,
            predicates,
            &Universe::new(&self.terms, None),
        ) {
            Ok(_) => library,
            Err(found) => {
                self.diagnostics.extend(found);
                CheckedProgram::default()
            }
        }
    }

    fn plan(
        &mut self,
        program: CheckedProgram,
        predicates: &Predicates,
        indexes: &mut Indexes,
    ) -> Planned {
        let universe = Universe::new(&self.terms, None);
        match stratify(&program.rules, predicates, &universe) {
            Ok(strata) => {
                self.diagnostics
                    .extend(warnings(&program.rules, predicates, &universe));
                Planned::new(program, strata, indexes, &|_| None)
            }
            Err(found) => {
                self.diagnostics.extend(found);
                Planned::new(CheckedProgram::default(), Vec::new(), indexes, &|_| None)
            }
        }
    }

    /// Evaluates the rules that depend on the ontology only. Terms created here become terms of the
    /// book.
    fn close_fixed(
        &mut self,
        fixed: &Planned,
        own: Tables,
        predicates: &Predicates,
        indexes: &Indexes,
    ) -> Result<Tables, Diagnostics> {
        let book = self.terms.clone();
        let mut universe = Universe::new(&book, None);
        let mut layers = Layers {
            own,
            below: Vec::new(),
        };
        let mut meter = Meter::new(&self.budget);
        if let Err(stopped) = evaluate(
            fixed,
            predicates,
            indexes,
            &mut layers,
            &mut universe,
            &mut meter,
        ) {
            let message = fault(&meter, stopped, fixed).to_string();
            let help = "rules that read only the ontology must finish within this budget";
            self.diagnostics
                .push(Diagnostic::error("R090", message).help(help));
            return Err(std::mem::take(&mut self.diagnostics));
        }
        // Created terms follow the book's terms in the same order, so their ids stay valid.
        for term in universe.into_created() {
            self.terms.intern(term);
        }
        Ok(layers.own)
    }
}

fn judge(ontology: &Ontology, property: &Property, rules: JudgeRules) -> Judge {
    let mut digest = Digest::new();
    digest.update(property.rule.digest.as_bytes());
    for library in &ontology.libraries {
        digest.update(library.path.as_bytes());
        digest.update(library.digest.as_bytes());
    }
    Judge {
        digest: digest.finish(),
        label: property.label.clone(),
        rules,
        reads: FactsRead::default(),
    }
}

/// Warns about predicates of a property's file that no rule reads and that are not part of the
/// verdict.
fn warn_unused(checking: &mut Checking<'_>, syntax: &Syntax, scope: usize) {
    let has = |name: &str| checking.defined.contains_key(&(scope, name.to_owned()));
    if !has("success") && !has("violation") {
        // Reported with the same remedy (R026).
        return;
    }
    let used = used_names(syntax);
    let verdict = crate::model::given::VERDICT.map(|(name, _)| name);
    let mut unused = BTreeMap::new();
    for statement in &syntax.statements {
        if let crate::syntax::Statement::Rule(rule) = statement {
            for head in &rule.heads {
                if !used.contains(head.predicate.as_str())
                    && !verdict.contains(&head.predicate.as_str())
                {
                    unused
                        .entry(head.predicate.clone())
                        .or_insert(head.name_span.clone());
                }
            }
        }
    }
    for (name, span) in unused {
        let known = checking.defined.contains_key(&(scope, name.clone()));
        if known {
            let help = actcheck_base::did_you_mean(&name, verdict);
            checking.warning(
                "R040",
                &syntax.source,
                &span,
                format!("`{name}` is never used"),
                help,
            );
        }
    }
}
