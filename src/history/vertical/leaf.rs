//! Patterns whose matches stay within one run, so that they are evaluated file by file.

use std::collections::{BTreeSet, HashMap, HashSet};
use std::sync::Arc;

use oxigraph::model::{Term, Variable};
use spargebra::algebra::Expression;
use spargebra::term::{NamedNodePattern, TermPattern, TriplePattern};

use crate::statements::iri;
use crate::vertical::column::Value;
use crate::vertical::expression::Native;
use crate::vertical::stop::{Stop, unfit};
use actcheck_base::names;

/// Properties whose values are nodes of the same run.
const WITHIN_RUN: [&str; 3] = ["act:ofRun", "earl:subject", "earl:result"];
/// Classes of nodes that are never in outlines.
const OF_CAMPAIGNS: [&str; 3] = ["act:Campaign", "act:UsedRule", "act:RuleFinding"];

/// Whether the values of a property are nodes of the same run.
pub(super) fn is_within_run(property: &str) -> bool {
    WITHIN_RUN
        .iter()
        .any(|known| iri(known).as_str() == property)
}

/// One pattern, with places instead of variables.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Step {
    pub subject: usize,
    pub property: String,
    pub value: usize,
}

/// A pattern that need not match.
#[derive(Debug, Clone)]
pub(super) struct Optional {
    pub steps: Vec<Step>,
    pub conditions: Vec<Native>,
}

/// Patterns whose matches stay within one run.
#[derive(Debug, Clone, Default)]
pub(super) struct Leaf {
    pub steps: Vec<Step>,
    pub optionals: Vec<Optional>,
    /// Conditions on the steps alone.
    pub conditions: Vec<Native>,
    /// Conditions on all values.
    pub late: Vec<Native>,
    /// The content of each place.
    pub places: Vec<Place>,
    /// The values that a place may have; the others can be left out.
    pub among: Vec<(usize, Arc<Limit>)>,
}

/// Values that a place may have.
#[derive(Debug, Clone, Default)]
pub(super) struct Limit {
    pub values: HashSet<Value>,
    /// Those that are nodes of runs: by the IRI of the run without its number, by the number, and
    /// the rest of the IRI.
    pub nodes: HashMap<String, HashMap<u64, HashSet<String>>>,
}

impl Limit {
    pub(super) fn of(values: HashSet<Value>) -> Self {
        let mut nodes: HashMap<String, HashMap<u64, HashSet<String>>> = HashMap::new();
        for value in &values {
            let Value::Term(Term::NamedNode(node)) = value else {
                continue;
            };
            let Some(id) = node.as_str().strip_prefix(names::RUN) else {
                continue;
            };
            let (run, rest) = id.split_at(id.find('/').unwrap_or(id.len()));
            let Some((campaign, number)) = run.rsplit_once('-') else {
                continue;
            };
            if let Ok(number) = number.parse() {
                let of_campaign = nodes
                    .entry(format!("{}{campaign}-", names::RUN))
                    .or_default();
                of_campaign
                    .entry(number)
                    .or_default()
                    .insert(rest.to_owned());
            }
        }
        Self { values, nodes }
    }
}

/// The content of a place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Place {
    Variable(Variable),
    Constant(Term),
}

impl Leaf {
    /// The place of a variable.
    pub(super) fn place(&self, variable: &Variable) -> Option<usize> {
        self.places
            .iter()
            .position(|place| matches!(place, Place::Variable(known) if known == variable))
    }

    /// Adds a pattern to the steps, or to those of an optional part.
    pub(super) fn step(&mut self, triple: &TriplePattern) -> Result<Step, Stop> {
        let NamedNodePattern::NamedNode(property) = &triple.predicate else {
            return unfit(format!(
                "the property `{}`, which may be any",
                triple.predicate
            ));
        };
        let is_node = is_within_run(property.as_str());
        Ok(Step {
            subject: self.place_of(&triple.subject, true)?,
            property: property.as_str().to_owned(),
            value: self.place_of(&triple.object, is_node)?,
        })
    }

    /// The place of a term. Equal nodes have the same place.
    fn place_of(&mut self, term: &TermPattern, is_node: bool) -> Result<usize, Stop> {
        let place = match variable(term) {
            Some(variable) => Place::Variable(variable),
            None => Place::Constant(constant(term)?),
        };
        let known = matches!(place, Place::Variable(_)) || is_node;
        if let Some(at) = self
            .places
            .iter()
            .position(|other| *other == place)
            .filter(|_| known)
        {
            return Ok(at);
        }
        let at = self.places.len();
        if let Place::Constant(term) = &place {
            self.among
                .push((at, Arc::new(Limit::of(HashSet::from([fixed(term)?])))));
        }
        self.places.push(place);
        Ok(at)
    }

    /// The properties that it reads, each once.
    pub(super) fn properties(&self) -> Vec<&str> {
        let steps = self
            .steps
            .iter()
            .chain(self.optionals.iter().flat_map(|optional| &optional.steps));
        let all: BTreeSet<&str> = steps.map(|step| step.property.as_str()).collect();
        all.into_iter().collect()
    }
}

/// The variable of a term. A blank node is one, too.
pub(super) fn variable(term: &TermPattern) -> Option<Variable> {
    match term {
        TermPattern::Variable(variable) => Some(variable.clone()),
        TermPattern::BlankNode(node) => {
            Some(Variable::new_unchecked(format!("blank_{}", node.as_str())))
        }
        _ => None,
    }
}

fn constant(term: &TermPattern) -> Result<Term, Stop> {
    match term {
        TermPattern::NamedNode(node) => Ok(node.clone().into()),
        TermPattern::Literal(literal) => Ok(literal.clone().into()),
        other => unfit(format!("`{other}`")),
    }
}

/// The value that matches a constant: the store takes numbers with the same value for the same.
fn fixed(term: &Term) -> Result<Value, Stop> {
    use oxigraph::model::vocab::{rdf, xsd};
    let Term::Literal(literal) = term else {
        return Ok(Value::of(term));
    };
    let text = literal.value();
    let value = match literal.datatype() {
        xsd::STRING | rdf::LANG_STRING => Some(Value::of(term)),
        xsd::DOUBLE => text
            .parse::<f64>()
            .ok()
            .map(|number| Value::Double(number.to_bits())),
        xsd::INTEGER => text.parse().ok().map(Value::Integer),
        xsd::BOOLEAN => match text {
            "true" | "1" => Some(Value::Boolean(true)),
            "false" | "0" => Some(Value::Boolean(false)),
            _ => None,
        },
        _ => None,
    };
    match value {
        Some(value) => Ok(value),
        None => unfit(format!("the value {term}")),
    }
}

/// Groups patterns whose matches are in the same run. Returns the positions of each group's
/// patterns.
pub(super) fn components(triples: &[TriplePattern]) -> Vec<Vec<usize>> {
    let nodes = |triple: &TriplePattern| {
        let is_node = matches!(&triple.predicate, NamedNodePattern::NamedNode(node) if is_within_run(node.as_str()));
        std::iter::once(triple.subject.clone()).chain(is_node.then(|| triple.object.clone()))
    };
    let mut groups: Vec<(Vec<TermPattern>, Vec<usize>)> = Vec::new();
    for (at, triple) in triples.iter().enumerate() {
        let own: Vec<TermPattern> = nodes(triple).collect();
        let (joined, others): (Vec<_>, Vec<_>) = groups
            .into_iter()
            .partition(|(known, _)| known.iter().any(|node| own.contains(node)));
        groups = others;
        let mut group = (own, vec![at]);
        for (nodes, members) in joined {
            group.0.extend(nodes);
            group.1.extend(members);
        }
        group.1.sort_unstable();
        groups.push(group);
    }
    let mut found: Vec<Vec<usize>> = groups.into_iter().map(|(_, members)| members).collect();
    found.sort();
    found
}

/// The variables of patterns.
pub(super) fn variables<'t>(
    triples: impl IntoIterator<Item = &'t TriplePattern>,
) -> BTreeSet<Variable> {
    let mut all = BTreeSet::new();
    for triple in triples {
        all.extend(
            [variable(&triple.subject), variable(&triple.object)]
                .into_iter()
                .flatten(),
        );
        if let NamedNodePattern::Variable(variable) = &triple.predicate {
            all.insert(variable.clone());
        }
    }
    all
}

/// Whether a pattern asks for a class of which outlines have no node.
pub(super) fn is_of_campaigns(triple: &TriplePattern) -> bool {
    let NamedNodePattern::NamedNode(property) = &triple.predicate else {
        return false;
    };
    let TermPattern::NamedNode(class) = &triple.object else {
        return false;
    };
    *property == iri("rdf:type") && OF_CAMPAIGNS.iter().any(|known| *class == iri(known))
}

/// The conditions of a conjunction.
pub(super) fn conjuncts(expression: Expression, into: &mut Vec<Expression>) {
    match expression {
        Expression::And(one, other) => {
            conjuncts(*one, into);
            conjuncts(*other, into);
        }
        other => into.push(other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::parser;
    use spargebra::Query;
    use spargebra::algebra::GraphPattern;

    fn groups(text: &str) -> Vec<usize> {
        let query = parser()
            .parse_query(&format!("SELECT * {{ {text} }}"))
            .expect("it is valid");
        let Query::Select {
            pattern: GraphPattern::Project { inner, .. },
            ..
        } = query
        else {
            panic!("{text}")
        };
        let GraphPattern::Bgp { patterns } = *inner else {
            panic!("{text}")
        };
        components(&patterns).iter().map(Vec::len).collect()
    }

    #[test]
    fn patterns_about_one_run_belong_together() {
        assert_eq!(
            groups(
                "?a earl:subject/act:ofRun ?run ; earl:result/act:margin ?m . ?run act:index ?i"
            ),
            [5]
        );
        assert_eq!(groups("?run act:campaign ?c . ?c rdfs:label ?name"), [1, 1]);
        assert_eq!(
            groups(
                "?run act:shrunkFrom ?from ; act:objectCount ?n . ?from act:objectCount ?before"
            ),
            [2, 1]
        );
        assert_eq!(groups("?a act:category ?c . ?b act:category ?c"), [1, 1]);
        assert_eq!(
            groups("?a act:category ?c . ?b act:category ?c ; act:ofRun ?run . ?a act:ofRun ?run"),
            [4]
        );
        assert_eq!(groups("?e act:ofRun run:a-1 . ?f act:ofRun run:a-1"), [2]);
    }
}
