//! Closure of the ontology under OWL 2 RL, computed by rules in our own language.

use std::path::Path;

use crate::engine::budget::Budget;
use crate::standalone::{Engine, Program};
use actcheck_base::{Diagnostic, Diagnostics, Source, Term, names};

/// Name and text of the rule file.
const RULES: (&str, &str) = (
    "built-in:rules/lib/owl-rl.rls",
    include_str!("../shipped/owl-rl.rls"),
);
/// Maximum number of contradictions reported; each has its proof.
const CONTRADICTIONS_SHOWN: usize = 5;

/// Returns all statements that follow from the given ones under OWL 2 RL, including these, sorted.
///
/// Leaves out statements true of any term (`?x owl:sameAs ?x`) and those not allowed in RDF (a
/// literal as subject).
///
/// ```
/// use actcheck_base::{Term, names};
///
/// let ex = |local: &str| Term::iri(format!("http://example.org/{local}"));
/// let kind = Term::iri(format!("{}type", names::RDF));
/// let below = Term::iri(format!("{}subClassOf", names::RDFS));
/// let stated = [[ex("mug"), kind.clone(), ex("Mug")], [ex("Mug"), below, ex("Dish")]];
/// let closure = actcheck_rules::owl_closure(&stated)?;
/// assert!(closure.contains(&[ex("mug"), kind, ex("Dish")]));
/// # Ok::<(), actcheck_base::Diagnostics>(())
/// ```
///
/// # Errors
/// `R080` for each contradiction, with the rule of the W3C profile that finds it and its proof.
pub fn owl_closure(triples: &[[Term; 3]]) -> Result<Vec<[Term; 3]>, Diagnostics> {
    owl_closure_within(triples, &Budget::default())
}

/// Like [`owl_closure`], with a budget.
pub(crate) fn owl_closure_within(
    triples: &[[Term; 3]],
    budget: &Budget,
) -> Result<Vec<[Term; 3]>, Diagnostics> {
    let unusable = |reason: String| Diagnostics::from(Diagnostic::error("R090", reason));
    let mut program = Program::load(&Source::new(RULES.0, RULES.1), Path::new(""))?;
    program
        .add_facts("triple", triples.iter().map(|triple| triple.as_slice()))
        .map_err(|fault| unusable(fault.to_string()))?;
    let closure = program
        .close(Engine::Fast, budget)
        .map_err(|fault| unusable(fault.to_string()))?;
    let contradictions = closure.tuples("contradiction");
    if !contradictions.is_empty() {
        return Err(contradiction_diagnostics(&program, &contradictions));
    }
    let same = names::OWL.to_owned() + "sameAs";
    let mut statements: Vec<[Term; 3]> = closure
        .tuples_unsorted("t")
        .filter_map(|tuple| match tuple.as_slice() {
            [s, p, o] => Some([*s, *p, *o]),
            _ => None,
        })
        .filter(|[s, p, o]| {
            matches!(s, Term::Iri(_) | Term::Blank(_))
                && !(s == o && p.as_iri() == Some(same.as_str()))
        })
        .map(|triple| triple.map(Term::clone))
        .collect();
    statements.sort();
    Ok(statements)
}

fn contradiction_diagnostics(program: &Program, contradictions: &[Vec<Term>]) -> Diagnostics {
    let mut diagnostics = Diagnostics::new();
    for tuple in contradictions.iter().take(CONTRADICTIONS_SHOWN) {
        let args: Vec<String> = tuple.iter().map(Term::to_string).collect();
        let about = args
            .iter()
            .skip(1)
            .cloned()
            .collect::<Vec<_>>()
            .join(" and ");
        let rule = tuple
            .first()
            .map_or(String::new(), crate::model::values::lexical);
        let proof = program
            .explain(
                &format!("contradiction({})", args.join(", ")),
                &Budget::default(),
            )
            .map_or(String::new(), |explanation| explanation.to_text());
        let message =
            format!("the ontology contradicts itself about {about} (rule {rule} of OWL 2 RL)");
        diagnostics.push(
            Diagnostic::error("R080", message)
                .help(format!("remove one of the facts in this proof:\n{proof}")),
        );
    }
    diagnostics
}
