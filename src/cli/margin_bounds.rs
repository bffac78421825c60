//! Thresholds of margins, read from rules such as `margin(?m) :- …, ?m = 0.05 - ?distance .`, for
//! plots.

use std::collections::BTreeMap;

use actcheck_base::Source;
use actcheck_report::MarginBound;
use actcheck_rules::parse;
use actcheck_rules::syntax::{
    AtomSyntax, Comparison, Expression, ExpressionKind, LiteralSyntax, RuleSyntax, Statement,
};

/// Returns the distinct thresholds of a rule file's margins. Margins that are not a difference
/// between a number and a variable have none.
pub(super) fn margin_bounds(source: &Source) -> Vec<MarginBound> {
    let (syntax, _) = parse(source);
    let mut parameters = BTreeMap::new();
    let mut bounds: Vec<MarginBound> = Vec::new();
    for statement in &syntax.statements {
        if let Statement::Parameter {
            name,
            value: Some(value),
            ..
        } = statement
            && let Some(number) = number(value, &parameters)
        {
            parameters.insert(name.clone(), number);
        }
    }
    for statement in &syntax.statements {
        let Statement::Rule(rule) = statement else {
            continue;
        };
        let margins = rule.heads.iter().filter(|head| head.predicate == "margin");
        let found = margins
            .flat_map(|head| differences(head, rule))
            .filter_map(|term| bound(term, &parameters));
        for bound in found {
            if !bounds.contains(&bound) {
                bounds.push(bound);
            }
        }
    }
    bounds
}

/// The expressions of a margin: its argument, and the values of a variable there.
fn differences<'a>(
    head: &'a AtomSyntax,
    rule: &'a RuleSyntax,
) -> impl Iterator<Item = &'a Expression> {
    let value = head.args.first();
    let equal = rule.body.iter().filter_map(move |literal| {
        let LiteralSyntax::Comparison { op: Comparison::Equal, left, right, .. } = literal else { return None };
        let ExpressionKind::Variable(margin) = &value?.kind else { return None };
        let is_margin = |side: &Expression| matches!(&side.kind, ExpressionKind::Variable(name) if name == margin);
        if is_margin(left) { Some(right) } else { is_margin(right).then_some(left) }
    });
    value.into_iter().chain(equal)
}

/// The threshold in `0.05 - ?x` or `?x - 0.05`.
fn bound(term: &Expression, parameters: &BTreeMap<String, f64>) -> Option<MarginBound> {
    let ExpressionKind::Arithmetic('-', left, right) = &term.kind else {
        return None;
    };
    let is_variable = |side: &Expression| matches!(side.kind, ExpressionKind::Variable(_));
    if is_variable(right) {
        return number(left, parameters).map(|at| MarginBound { at, below: true });
    }
    if is_variable(left) {
        return number(right, parameters).map(|at| MarginBound { at, below: false });
    }
    None
}

fn number(term: &Expression, parameters: &BTreeMap<String, f64>) -> Option<f64> {
    match &term.kind {
        ExpressionKind::Constant(term) => term.number(),
        ExpressionKind::Global(name) => parameters.get(name).copied(),
        ExpressionKind::Negative(term) => number(term, parameters).map(|value| -value),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bounds(text: &str) -> Vec<(f64, bool)> {
        let found = margin_bounds(&Source::new("margin.rls", text));
        found
            .into_iter()
            .map(|bound| (bound.at, bound.below))
            .collect()
    }

    #[test]
    fn thresholds_are_read_from_differences_with_a_variable() {
        assert_eq!(
            bounds("margin(?m) :- near(?d), ?m = 0.05 - ?d ."),
            [(0.05, true)]
        );
        assert_eq!(
            bounds(
                "margin(?m) :- moved(?d), ?m = ?d - 0.02 . margin(?m) :- up(?d), ?m = ?d - 0.02 ."
            ),
            [(0.02, false)]
        );
        assert_eq!(
            bounds("@parameter $most = 0.5 . margin(?m) :- tilt(?t), ?m = $most - ?t ."),
            [(0.5, true)]
        );
    }

    #[test]
    fn other_margins_have_no_threshold() {
        for text in [
            "margin(-1.0) :- lost(_) .",
            "margin(?m) :- room(?m) .",
            "margin(?m) :- far(?s), ?m = MAX(1.0 - ?s, -1.0) .",
            "margin(",
        ] {
            assert!(bounds(text).is_empty(), "{text}");
        }
    }
}
