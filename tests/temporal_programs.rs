//! Programs with recursion, negation and formulas about time against an evaluator that follows the
//! definitions: sets that grow until nothing is new, and a formula that asks every moment of its
//! interval.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::ops::RangeInclusive;

use actcheck::base::{Course, Signal, Term, names};
use actcheck::rules::{Facts, Rules, When};
use proptest::prelude::*;

const NODES: usize = 5;
const SAMPLES: usize = 8;

/// A quantity: a signal of the first or second variable, or a number.
#[derive(Debug, Clone, Copy)]
enum Value {
    Signal(&'static str, usize),
    Number(i32),
}

#[derive(Debug, Clone)]
enum Formula {
    Compare(Value, &'static str, Value),
    Not(Box<Formula>),
    Both(Box<Formula>, &'static str, Box<Formula>),
    Unary(&'static str, Option<[usize; 2]>, Box<Formula>),
    Binary(&'static str, Option<[usize; 2]>, Box<Formula>, Box<Formula>),
}

/// Samples of `a` and `b` of each node.
type Signals = Vec<[Vec<i32>; 2]>;

impl Formula {
    fn text(&self) -> String {
        let interval = |interval: &Option<[usize; 2]>| {
            interval
                .map(|[from, to]| format!("[{from}, {to}]"))
                .unwrap_or_default()
        };
        match self {
            Self::Compare(left, op, right) => format!("{} {op} {}", left.text(), right.text()),
            Self::Not(inner) => format!("~({})", inner.text()),
            Self::Both(left, word, right) => {
                format!("(({}) {word} ({}))", left.text(), right.text())
            }
            Self::Unary(word, bounds, inner) => {
                format!("{word}{}({})", interval(bounds), inner.text())
            }
            Self::Binary(word, bounds, left, right) => {
                format!(
                    "{word}{}({}, {})",
                    interval(bounds),
                    left.text(),
                    right.text()
                )
            }
        }
    }

    /// Whether the formula holds at a moment, by the definitions in `docs/time.md`.
    fn holds(&self, at: usize, of: &dyn Fn(Value, usize) -> i32) -> bool {
        let later = |bounds: &Option<[usize; 2]>| -> RangeInclusive<usize> {
            let [from, to] = bounds.unwrap_or([0, SAMPLES]);
            at + from..=(at + to).min(SAMPLES - 1)
        };
        let earlier = |bounds: &Option<[usize; 2]>| -> Vec<usize> {
            let [from, to] = bounds.unwrap_or([0, SAMPLES]);
            (0..=at)
                .filter(|moment| (from..=to).contains(&(at - moment)))
                .collect()
        };
        match self {
            Self::Compare(left, op, right) => {
                let (left, right) = (of(*left, at), of(*right, at));
                match *op {
                    "<" => left < right,
                    "<=" => left <= right,
                    ">" => left > right,
                    ">=" => left >= right,
                    "=" => left == right,
                    _ => left != right,
                }
            }
            Self::Not(inner) => !inner.holds(at, of),
            Self::Both(left, word, right) => {
                let (left, right) = (left.holds(at, of), right.holds(at, of));
                match *word {
                    "and" => left && right,
                    "or" => left || right,
                    _ => !left || right,
                }
            }
            Self::Unary(word, bounds, inner) => match *word {
                "always" => later(bounds).all(|moment| inner.holds(moment, of)),
                "eventually" => later(bounds).any(|moment| inner.holds(moment, of)),
                "historically" => earlier(bounds)
                    .into_iter()
                    .all(|moment| inner.holds(moment, of)),
                _ => earlier(bounds)
                    .into_iter()
                    .any(|moment| inner.holds(moment, of)),
            },
            Self::Binary("until", bounds, left, right) => later(bounds).any(|moment| {
                right.holds(moment, of) && (at..moment).all(|before| left.holds(before, of))
            }),
            Self::Binary(_, bounds, left, right) => earlier(bounds).into_iter().any(|moment| {
                right.holds(moment, of) && (moment + 1..=at).all(|after| left.holds(after, of))
            }),
        }
    }

    /// The moment at which the formula is read as a condition.
    fn moment(&self) -> usize {
        let (Self::Unary(word, ..) | Self::Binary(word, ..)) = self else {
            return 0;
        };
        if matches!(*word, "historically" | "once" | "since") {
            SAMPLES - 1
        } else {
            0
        }
    }
}

impl Value {
    fn text(self) -> String {
        match self {
            Self::Signal(name, 0) => format!("ex:{name}(?x)"),
            Self::Signal(name, _) => format!("ex:{name}(?y)"),
            Self::Number(number) => number.to_string(),
        }
    }
}

fn formula() -> impl Strategy<Value = Formula> {
    let signal = || {
        (prop_oneof![Just("a"), Just("b")], 0..2usize)
            .prop_map(|(name, of)| Value::Signal(name, of))
    };
    let right = prop_oneof![signal(), (-2..3).prop_map(Value::Number)];
    let op = prop_oneof![
        Just("<"),
        Just("<="),
        Just(">"),
        Just(">="),
        Just("="),
        Just("!=")
    ];
    let compare =
        (signal(), op, right).prop_map(|(left, op, right)| Formula::Compare(left, op, right));
    let inner = compare.prop_recursive(3, 12, 2, |inner| {
        let word = prop_oneof![Just("and"), Just("or"), Just("implies")];
        prop_oneof![
            inner.clone().prop_map(|one| Formula::Not(Box::new(one))),
            (inner.clone(), word, inner.clone()).prop_map(|(left, word, right)| Formula::Both(
                Box::new(left),
                word,
                Box::new(right)
            )),
            temporal(inner),
        ]
    });
    temporal(inner)
}

fn temporal(
    inner: impl Strategy<Value = Formula> + Clone + 'static,
) -> impl Strategy<Value = Formula> {
    let bounds = || {
        proptest::option::of(
            (0..4usize, 0..5usize).prop_map(|(from, length)| [from, from + length]),
        )
    };
    let unary = prop_oneof![
        Just("always"),
        Just("eventually"),
        Just("historically"),
        Just("once")
    ];
    prop_oneof![
        (unary, bounds(), inner.clone()).prop_map(|(word, bounds, one)| Formula::Unary(
            word,
            bounds,
            Box::new(one)
        )),
        (
            prop_oneof![Just("until"), Just("since")],
            bounds(),
            inner.clone(),
            inner
        )
            .prop_map(|(word, bounds, left, right)| Formula::Binary(
                word,
                bounds,
                Box::new(left),
                Box::new(right)
            )),
    ]
}

/// Whether a formula holds for two nodes.
fn holds(formula: &Formula, signals: &Signals, nodes: [usize; 2]) -> bool {
    let of = |value: Value, at: usize| match value {
        Value::Signal(name, of) => signals[nodes[of]][usize::from(name == "b")][at],
        Value::Number(number) => number,
    };
    formula.holds(formula.moment(), &of)
}

/// The weights of the nodes that are reached, and of the others for which the second formula holds.
fn expected(edges: &[(usize, usize)], formulas: &[Formula; 2], signals: &Signals) -> u32 {
    let mut reached = BTreeSet::from([0]);
    loop {
        let more: Vec<usize> = edges
            .iter()
            .filter(|(from, to)| {
                reached.contains(from) && holds(&formulas[0], signals, [*from, *to])
            })
            .map(|(_, to)| *to)
            .collect();
        let before = reached.len();
        reached.extend(more);
        if reached.len() == before {
            break;
        }
    }
    let others = (0..NODES)
        .filter(|node| !reached.contains(node) && holds(&formulas[1], signals, [*node, *node]));
    reached.iter().map(|node| 1 << node).sum::<u32>()
        + others.map(|node| 1 << (NODES + node)).sum::<u32>()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn programs_with_recursion_and_time_equal_the_definitions(
        edges in proptest::collection::vec((0..NODES, 0..NODES), 3..14),
        step in formula(),
        rest in formula(),
        samples in proptest::collection::vec(-2..3i32, NODES * 2 * SAMPLES),
    ) {
        let signals: Signals = samples
            .chunks(2 * SAMPLES)
            .map(|of| [of[..SAMPLES].to_vec(), of[SAMPLES..].to_vec()])
            .collect();
        let formulas = [step, rest];
        let one = formulas[1].text().replace("?y", "?x");
        let text = format!(
            "@prefix ex: <http://example.org/> .
             reached(?x) :- before(?x, ex:start, true) .
             reached(?y) :- reached(?x), before(?x, ex:edge, ?y), {} .
             other(?x) :- before(?x, ex:weight, _), ~reached(?x), {one} .
             weight(?x, ?w) :- reached(?x), before(?x, ex:weight, ?w) .
             weight(?x, ?w) :- other(?x), before(?x, ex:weight, ?v), ?w = {} * ?v .
             success(?x) :- reached(?x) .
             margin(#sum(?w, ?x)) :- weight(?x, ?w) .",
            formulas[0].text(),
            1 << NODES,
        );
        let rules = Rules::parse(&text).unwrap_or_else(|found| panic!("{found}\n{text}"));
        let ex = |local: String| Term::iri(format!("http://example.org/{local}"));
        let node = |number: usize| ex(format!("n{number}"));
        let mut facts = Facts::new();
        facts.add(When::Before, [node(0), ex("start".into()), Term::Boolean(true)]);
        for (from, to) in &edges {
            facts.add(When::Before, [node(*from), ex("edge".into()), node(*to)]);
        }
        let mut course = Course::new(1.0, SAMPLES);
        for (number, of) in signals.iter().enumerate() {
            facts.add(When::Before, [node(number), ex("weight".into()), Term::Integer(1 << number)]);
            for (name, samples) in ["a", "b"].into_iter().zip(of) {
                let mut thing = String::new();
                write!(thing, "http://example.org/n{number}").expect("a string takes everything");
                let quantity = format!("http://example.org/{name}");
                let values = samples.iter().map(|value| f64::from(*value)).collect();
                course.set([quantity, thing, String::new()], Signal::Values(values));
            }
        }
        facts.set_parameter(Term::iri(names::act("pickObject")), node(0));
        facts.set_course(course);
        let decision = rules.judge(&facts);
        prop_assert_eq!(decision.margin(), Some(f64::from(expected(&edges, &formulas, &signals))), "{}\n{:?}", text, decision);
    }
}
