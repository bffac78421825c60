//! Stratification: orders rules so that a predicate is complete before it is negated or aggregated.

use std::collections::BTreeSet;

use crate::model::program::{Literal, PredicateId, Predicates, Rule};
use crate::model::universe::Universe;
use crate::syntax::limits::{CYCLE_SHOWN, FAULT_LIMIT};
use actcheck_base::{Diagnostic, Diagnostics, names};

/// Rules that are evaluated together.
#[derive(Debug, Clone)]
pub(crate) struct Stratum {
    /// Indices of the rules.
    pub(crate) rules: Vec<usize>,
    /// Predicates that the stratum completes, sorted.
    pub(crate) predicates: Vec<PredicateId>,
    /// Whether a rule reads a predicate that the stratum derives.
    pub(crate) recursive: bool,
}

/// A dependency of the head's predicate on a predicate of the body.
#[derive(Debug, Clone, Copy)]
struct Edge {
    to: PredicateId,
    /// Whether it is negated or aggregated.
    strict: bool,
    rule: usize,
}

/// Computes the strata of the rules, each after the strata that it reads.
///
/// # Errors
/// `R050` for each predicate that depends on its own negation or aggregate, with the cycle.
pub(crate) fn stratify(
    rules: &[Rule],
    predicates: &Predicates,
    terms: &Universe<'_>,
) -> Result<Vec<Stratum>, Diagnostics> {
    let graph = graph(rules, predicates.len());
    let component = components(&graph);
    let mut diagnostics = Diagnostics::new();
    for (from, edges) in graph.iter().enumerate() {
        for edge in edges
            .iter()
            .filter(|e| e.strict && component[e.to] == component[from])
        {
            if diagnostics.len() == FAULT_LIMIT {
                return Err(diagnostics);
            }
            diagnostics.push(cycle_fault(
                from, edge, &graph, &component, rules, predicates, terms,
            ));
        }
    }
    if diagnostics.has_errors() {
        return Err(diagnostics);
    }
    let count = component.iter().max().map_or(0, |last| last + 1);
    let mut strata: Vec<Stratum> = (0..count)
        .map(|_| Stratum {
            rules: Vec::new(),
            predicates: Vec::new(),
            recursive: false,
        })
        .collect();
    for (predicate, number) in component.iter().enumerate() {
        strata[*number].predicates.push(predicate);
    }
    for (idx, rule) in rules.iter().enumerate() {
        let own = component[rule.head.predicate];
        strata[own].rules.push(idx);
        let reads_own = rule
            .body
            .iter()
            .any(|literal| matches!(literal, Literal::Positive(atom) if component[atom.predicate] == own));
        strata[own].recursive |= reads_own;
    }
    strata.retain(|stratum| !stratum.rules.is_empty());
    Ok(strata)
}

fn graph(rules: &[Rule], predicates: usize) -> Vec<Vec<Edge>> {
    let mut graph: Vec<Vec<Edge>> = vec![Vec::new(); predicates];
    for (idx, rule) in rules.iter().enumerate() {
        for literal in &rule.body {
            let (atom, negated) = match literal {
                Literal::Positive(atom) => (atom, false),
                Literal::Negative(atom) => (atom, true),
                _ => continue,
            };
            let strict = negated || rule.aggregation.is_some();
            graph[rule.head.predicate].push(Edge {
                to: atom.predicate,
                strict,
                rule: idx,
            });
        }
        // New things depend on all heads, so that these are derived together.
        for head in rule.makes().into_iter().flat_map(|making| &making.heads) {
            graph[rule.head.predicate].push(Edge {
                to: head.predicate,
                strict: false,
                rule: idx,
            });
        }
    }
    graph
}

/// Computes the strongly connected component of each predicate, numbered in dependency order
/// (Tarjan's algorithm, iterative because chains of rules may be long).
fn components(graph: &[Vec<Edge>]) -> Vec<usize> {
    const NEW: usize = usize::MAX;
    let n = graph.len();
    let (mut index, mut low, mut component) = (vec![NEW; n], vec![0; n], vec![NEW; n]);
    let (mut stack, mut next, mut count) = (Vec::new(), 0, 0);
    for root in 0..n {
        if index[root] != NEW {
            continue;
        }
        let mut work = vec![(root, 0)];
        while let Some((node, at)) = work.pop() {
            if at == 0 {
                index[node] = next;
                low[node] = next;
                next += 1;
                stack.push(node);
            } else {
                let child = graph[node][at - 1].to;
                low[node] = low[node].min(low[child]);
            }
            let mut descended = false;
            for (position, edge) in graph[node].iter().enumerate().skip(at) {
                if index[edge.to] == NEW {
                    work.push((node, position + 1));
                    work.push((edge.to, 0));
                    descended = true;
                    break;
                }
                if component[edge.to] == NEW {
                    low[node] = low[node].min(index[edge.to]);
                }
            }
            if !descended && low[node] == index[node] {
                while let Some(member) = stack.pop() {
                    component[member] = count;
                    if member == node {
                        break;
                    }
                }
                count += 1;
            }
        }
    }
    component
}

/// Reports a strict edge inside a component, with the shortest cycle through it.
fn cycle_fault(
    from: PredicateId,
    edge: &Edge,
    graph: &[Vec<Edge>],
    component: &[usize],
    rules: &[Rule],
    predicates: &Predicates,
    terms: &Universe<'_>,
) -> Diagnostic {
    let rule = &rules[edge.rule];
    let span = rule
        .body
        .iter()
        .find(|literal| literal.atom().is_some_and(|atom| atom.predicate == edge.to))
        .map_or(rule.origin.span.clone(), |literal| literal.span().clone());
    let back = way_back(edge.to, from, graph, component);
    let mut way: Vec<String> = back
        .iter()
        .take(CYCLE_SHOWN)
        .map(|predicate| shown(predicates, *predicate, terms))
        .collect();
    // Parts of one rule have one name.
    way.dedup();
    if let Some(left_out) = back
        .len()
        .checked_sub(CYCLE_SHOWN + 1)
        .filter(|count| *count > 0)
    {
        way.push(format!("({left_out} more)"));
    }
    if back.len() > CYCLE_SHOWN {
        way.push(shown(predicates, from, terms));
    }
    let name = shown(predicates, from, terms);
    let word = if rule.aggregation.is_some() {
        "aggregates over"
    } else {
        "negates"
    };
    let target = shown(predicates, edge.to, terms);
    let message = format!("`{name}` {word} `{target}`, which depends on `{name}`");
    let cycle = format!("{name} → {}", way.join(" → "));
    Diagnostic::error("R050", message)
        .at(&rule.origin.source, span)
        .help(format!(
            "the cycle is {cycle}; break it with a predicate that does not depend on `{name}`"
        ))
}

/// Returns the predicates on a shortest path inside one component, both ends included.
fn way_back(
    start: PredicateId,
    goal: PredicateId,
    graph: &[Vec<Edge>],
    component: &[usize],
) -> Vec<PredicateId> {
    let mut came_from = vec![None; graph.len()];
    let mut queue = std::collections::VecDeque::from([start]);
    let mut seen = BTreeSet::from([start]);
    while let Some(node) = queue.pop_front() {
        if node == goal {
            break;
        }
        for edge in graph[node]
            .iter()
            .filter(|e| component[e.to] == component[goal])
        {
            if seen.insert(edge.to) {
                came_from[edge.to] = Some(node);
                queue.push_back(edge.to);
            }
        }
    }
    let mut way = vec![goal];
    while let Some(previous) = came_from[way[way.len() - 1]] {
        way.push(previous);
    }
    way.reverse();
    way
}

/// Formats a predicate's name with its constant property, if it has one.
pub(crate) fn shown(predicates: &Predicates, id: PredicateId, terms: &Universe<'_>) -> String {
    let predicate = predicates.get(id);
    match predicate.property.map(|property| terms.term(property)) {
        Some(term) => format!(
            "{}(… {} …)",
            predicate.name,
            term.as_iri().map_or(term.to_string(), names::shorten)
        ),
        None => predicate.helps().unwrap_or(&predicate.name).to_owned(),
    }
}
