//! A small proof checker that shares no code with the engine: it parses the rules, checks that each
//! step is an instance of its rule, requires facts at the leaves, and evaluates negations itself.
//!
//! It supports only the language features of the shipped properties; any other feature is an error,
//! so none goes unchecked.

use std::collections::BTreeMap;

use actcheck::base::{RunFacts, Term, TermId, names};
use actcheck::ontology::Ontology;
use actcheck::rules::explain::{Premise, Proof, Support};
use actcheck::rules::{Budget, RuleBook, owl_closure};

use crate::rules::{TESTED, cases, facts_of, ontology_of};

/// Number of matches of an aggregate that a proof shows.
const MATCHES_SHOWN: usize = 3;
/// Numbers in statements are rounded to six digits.
const ROUNDED: f64 = 2e-5;

#[derive(Debug, Clone, PartialEq)]
enum Value {
    Number(f64),
    Text(String),
}

type Binding = BTreeMap<String, Value>;

/// A predicate with its arguments as written.
#[derive(Debug, Clone)]
struct Atom {
    name: String,
    args: Vec<String>,
}

/// A rule or a fact of a rule file.
#[derive(Debug, Clone)]
struct Rule {
    heads: Vec<Atom>,
    body: Vec<String>,
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= ROUNDED * a.abs().max(b.abs()).max(1e-3)
}

fn same(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Number(a), Value::Number(b)) => near(*a, *b),
        (a, b) => a == b,
    }
}

fn constant(text: &str) -> Value {
    text.parse()
        .map_or_else(|_| Value::Text(text.to_owned()), Value::Number)
}

/// Parts between separators that are outside parentheses and strings.
fn split(text: &str, separator: char) -> Vec<String> {
    let (mut parts, mut depth, mut quoted) = (vec![String::new()], 0, false);
    for c in text.chars() {
        quoted ^= c == '"';
        depth += i32::from(!quoted && c == '(') - i32::from(!quoted && c == ')');
        if c == separator && depth == 0 && !quoted {
            parts.push(String::new());
        } else {
            parts.last_mut().unwrap().push(c);
        }
    }
    parts
        .iter()
        .map(|part| part.trim().to_owned())
        .filter(|part| !part.is_empty())
        .collect()
}

/// `before(…)`, `after(…)` and `during(…)` abbreviate `state(PHASE, …)`.
fn atom(text: &str) -> Atom {
    let (name, args) = text
        .trim()
        .strip_suffix(')')
        .and_then(|text| text.split_once('('))
        .expect("an atom");
    let mut atom = Atom {
        name: name.trim().to_owned(),
        args: split(args, ','),
    };
    if ["before", "after", "during"].contains(&atom.name.as_str()) {
        atom.args.insert(0, format!("act:{}", atom.name));
        atom.name = "state".to_owned();
    }
    atom
}

fn rule(text: &str) -> Rule {
    let text = text.trim().trim_end_matches('.').trim();
    let (heads, body) = text.split_once(":-").unwrap_or((text, ""));
    Rule {
        heads: split(heads, ',').iter().map(|head| atom(head)).collect(),
        body: split(body, ','),
    }
}

/// The rules of a file in which every rule ends with ` .`, as ours do.
fn rules(text: &str) -> Vec<Rule> {
    let code: Vec<&str> = text
        .lines()
        .filter(|line| !line.starts_with(['%', '@', '#']))
        .collect();
    let statements = code.join("\n") + "\n";
    statements
        .split(" .\n")
        .filter(|statement| !statement.trim().is_empty())
        .map(rule)
        .collect()
}

fn shown(term: &Term) -> Value {
    match term {
        Term::Iri(iri) => Value::Text(names::shorten(iri)),
        Term::Double(number) => Value::Number(*number),
        Term::Integer(number) => Value::Number(*number as f64),
        other => Value::Text(other.to_string()),
    }
}

/// The given facts of a case's only action.
fn given(facts: &RunFacts) -> Vec<(String, Vec<Value>)> {
    let action = facts.action(0).unwrap();
    let value = |id: &TermId| shown(facts.terms.term(*id));
    let phases = [
        ("act:before", action.before),
        ("act:after", action.after),
        ("act:during", action.during),
    ];
    let states = phases.into_iter().flat_map(|(phase, triples)| {
        triples
            .iter()
            .map(move |triple| (phase, triple))
            .collect::<Vec<_>>()
    });
    let states = states.map(|(phase, triple)| {
        let mut args = vec![Value::Text(phase.to_owned())];
        args.extend(triple.iter().map(value));
        ("state".to_owned(), args)
    });
    let parameters = action
        .parameters
        .iter()
        .map(|pair| ("parameter".to_owned(), pair.iter().map(value).collect()));
    states.chain(parameters).collect()
}

/// The class hierarchy with its OWL 2 RL closure, as facts: the checker does not prove it again.
fn hierarchy(ontology: &Ontology) -> Vec<(String, Vec<Value>)> {
    let closed = owl_closure(&ontology.triples).unwrap();
    let subclasses = closed.iter().filter(|[_, property, _]| {
        property
            .as_iri()
            .is_some_and(|p| p.ends_with("#subClassOf"))
    });
    subclasses
        .map(|triple| ("ontology".to_owned(), triple.iter().map(shown).collect()))
        .collect()
}

/// Extends a binding so that the written arguments equal the values. Returns `None` if they do not
/// match.
fn unify(written: &[String], values: &[Value], binding: &Binding) -> Option<Binding> {
    if written.len() != values.len() {
        return None;
    }
    let mut binding = binding.clone();
    for (arg, value) in written.iter().zip(values) {
        let fits = match arg.as_str() {
            "_" => true,
            name if name.starts_with('?') => match binding.get(name) {
                Some(bound) => same(bound, value),
                None => {
                    binding.insert(name.to_owned(), value.clone());
                    true
                }
            },
            text => same(&constant(text), value),
        };
        if !fits {
            return None;
        }
    }
    Some(binding)
}

/// Evaluates an expression. Returns `None` if a variable has no value yet.
fn evaluate(text: &str, binding: &Binding) -> Option<Value> {
    let text = text.trim();
    for operators in [['+', '-'], ['*', '/']] {
        // The last of the weakest operators is applied last. A sign belongs to its number.
        let (mut depth, mut quoted, mut at) = (0, false, None);
        for (idx, c) in text.char_indices() {
            quoted ^= c == '"';
            depth += i32::from(c == '(') - i32::from(c == ')');
            let between = text[..idx].ends_with(' ') && text[idx + c.len_utf8()..].starts_with(' ');
            if !quoted && depth == 0 && between && operators.contains(&c) {
                at = Some((idx, c));
            }
        }
        if let Some((idx, c)) = at {
            let (Value::Number(a), Value::Number(b)) = (
                evaluate(&text[..idx], binding)?,
                evaluate(&text[idx + 1..], binding)?,
            ) else {
                panic!("{text} is not a sum of numbers");
            };
            return Some(Value::Number(match c {
                '+' => a + b,
                '-' => a - b,
                '*' => a * b,
                _ => a / b,
            }));
        }
    }
    if text.starts_with('?') {
        return binding.get(text).cloned();
    }
    if let Some((name, args)) = text.strip_suffix(')').and_then(|text| text.split_once('('))
        && !text.starts_with('"')
    {
        let args: Option<Vec<Value>> = split(args, ',')
            .iter()
            .map(|arg| evaluate(arg, binding))
            .collect();
        return Some(call(name, &args?));
    }
    Some(constant(text))
}

fn call(name: &str, args: &[Value]) -> Value {
    let numbers: Vec<f64> = args
        .iter()
        .filter_map(|arg| {
            if let Value::Number(n) = arg {
                Some(*n)
            } else {
                None
            }
        })
        .collect();
    let text = |idx: usize| match &args[idx] {
        Value::Text(text) => text.trim_matches('"').to_owned(),
        Value::Number(number) => number.to_string(),
    };
    match name {
        "ABS" => Value::Number(numbers[0].abs()),
        "COS" => Value::Number(numbers[0].cos()),
        "SIN" => Value::Number(numbers[0].sin()),
        "SQRT" => Value::Number(numbers[0].sqrt()),
        "MIN" => Value::Number(numbers.iter().copied().fold(f64::INFINITY, f64::min)),
        "MAX" => Value::Number(numbers.iter().copied().fold(f64::NEG_INFINITY, f64::max)),
        "geo3d:distance2d" => {
            Value::Number((numbers[2] - numbers[0]).hypot(numbers[3] - numbers[1]))
        }
        "geo3d:distance" => Value::Number(
            (numbers[3] - numbers[0])
                .hypot(numbers[4] - numbers[1])
                .hypot(numbers[5] - numbers[2]),
        ),
        "geo3d:angleDifference" => {
            let turn = (numbers[1] - numbers[0]).rem_euclid(std::f64::consts::TAU);
            Value::Number(if turn > std::f64::consts::PI {
                turn - std::f64::consts::TAU
            } else {
                turn
            })
        }
        "STR" => {
            let short = text(0);
            let long = names::PREFIXES.iter().find_map(|(prefix, iri)| {
                Some(format!(
                    "{iri}{}",
                    short.strip_prefix(prefix)?.strip_prefix(':')?
                ))
            });
            Value::Text(long.unwrap_or_else(|| short.trim_matches(['<', '>']).to_owned()))
        }
        "STRSTARTS" => Value::Text(text(0).starts_with(&text(1)).to_string()),
        other => panic!("{other} is not supported by the checker"),
    }
}

/// A condition that is not an atom. Returns `Some` with the extended binding, `Some(None)` if it
/// does not hold, `None` if it lacks a variable.
fn condition(text: &str, binding: &Binding) -> Option<Option<Binding>> {
    for operator in [" <= ", " >= ", " != ", " < ", " > ", " = "] {
        let Some((left, right)) = text.split_once(operator) else {
            continue;
        };
        let right = evaluate(right, binding)?;
        if operator == " = " && left.starts_with('?') && !binding.contains_key(left) {
            let mut binding = binding.clone();
            binding.insert(left.to_owned(), right);
            return Some(Some(binding));
        }
        let left = evaluate(left, binding)?;
        let holds = match (&left, &right, operator.trim()) {
            (_, _, "=") => same(&left, &right),
            (_, _, "!=") => !same(&left, &right),
            (Value::Number(a), Value::Number(b), "<") => a < b,
            (Value::Number(a), Value::Number(b), "<=") => a <= b,
            (Value::Number(a), Value::Number(b), ">") => a > b,
            (Value::Number(a), Value::Number(b), ">=") => a >= b,
            _ => false,
        };
        return Some(holds.then(|| binding.clone()));
    }
    let holds = evaluate(text, binding)? == Value::Text("true".to_owned());
    Some(holds.then(|| binding.clone()))
}

/// The largest or smallest number that an aggregate such as `#max(?d)` takes over the bindings of
/// its group.
fn aggregated(text: &str, bindings: &[&Binding]) -> Value {
    let (name, of) = text
        .trim_end_matches(')')
        .split_once('(')
        .expect("an aggregate");
    let numbers = bindings.iter().map(|binding| match evaluate(of, binding) {
        Some(Value::Number(number)) => number,
        other => panic!("{text} of {other:?}"),
    });
    Value::Number(match name {
        "#max" => numbers.fold(f64::NEG_INFINITY, f64::max),
        "#min" => numbers.fold(f64::INFINITY, f64::min),
        other => panic!("{other} is not supported by the checker"),
    })
}

/// The tuples that a head concludes from the solutions of its body: one per solution, or one per
/// group of an aggregate.
fn concluded(head: &Atom, solutions: &[Binding]) -> Vec<Vec<Value>> {
    let mut groups: Vec<(Vec<Option<Value>>, Vec<&Binding>)> = Vec::new();
    let aggregates = head.args.iter().any(|arg| arg.starts_with('#'));
    for binding in solutions {
        let key = head
            .args
            .iter()
            .filter(|arg| !arg.starts_with('#'))
            .map(|arg| evaluate(arg, binding))
            .collect();
        match groups
            .iter_mut()
            .find(|(known, _)| aggregates && *known == key)
        {
            Some((_, members)) => members.push(binding),
            None => groups.push((key, vec![binding])),
        }
    }
    let value = |arg: &String, members: &[&Binding]| match arg.starts_with('#') {
        true => Some(aggregated(arg, members)),
        false => evaluate(arg, members[0]),
    };
    groups
        .iter()
        .map(|(_, members)| {
            head.args
                .iter()
                .filter_map(|arg| value(arg, members))
                .collect()
        })
        .collect()
}

fn is_atom(text: &str) -> bool {
    text.starts_with(|c: char| c.is_ascii_lowercase()) && text.contains('(')
}

/// The rules and facts of one case.
struct Case {
    facts: Vec<(String, Vec<Value>)>,
    rules: Vec<Rule>,
}

impl Case {
    /// All tuples of a predicate, from facts and, by backward chaining, from rules. The shipped
    /// rules are recursive only through the property in `state`, and its constant separates the
    /// cases.
    fn tuples(&self, name: &str, pattern: &[Option<Value>]) -> Vec<Vec<Value>> {
        let fits = |values: &[Value]| {
            values.len() == pattern.len()
                && values
                    .iter()
                    .zip(pattern)
                    .all(|(value, asked)| asked.as_ref().is_none_or(|asked| same(asked, value)))
        };
        let mut found: Vec<Vec<Value>> = self
            .facts
            .iter()
            .filter(|(known, values)| known == name && fits(values))
            .map(|(_, v)| v.clone())
            .collect();
        for rule in &self.rules {
            for head in rule
                .heads
                .iter()
                .filter(|head| head.name == name && head.args.len() == pattern.len())
            {
                let possible = head.args.iter().zip(pattern).all(|(arg, asked)| {
                    arg.starts_with(['?', '_', '#'])
                        || asked
                            .as_ref()
                            .is_none_or(|asked| same(&constant(arg), asked))
                });
                // An open property matches only given facts: no shipped rule needs more.
                if !possible || (name == "state" && pattern[2].is_none()) {
                    continue;
                }
                let mut start = Binding::new();
                for (arg, asked) in head.args.iter().zip(pattern) {
                    if let (true, Some(asked)) = (arg.starts_with('?'), asked) {
                        start.insert(arg.clone(), asked.clone());
                    }
                }
                found.extend(
                    concluded(head, &self.solve(&rule.body, &start))
                        .into_iter()
                        .filter(|tuple| fits(tuple)),
                );
            }
        }
        found
    }

    fn matches(&self, atom: &Atom, binding: &Binding) -> Vec<Binding> {
        let pattern: Vec<Option<Value>> = atom
            .args
            .iter()
            .map(|arg| {
                if arg.starts_with(['?', '_']) {
                    binding.get(arg).cloned()
                } else {
                    Some(constant(arg))
                }
            })
            .collect();
        self.tuples(&atom.name, &pattern)
            .iter()
            .filter_map(|tuple| unify(&atom.args, tuple, binding))
            .collect()
    }

    /// Bindings that satisfy a body: atoms first, then computations, then negations.
    fn solve(&self, body: &[String], start: &Binding) -> Vec<Binding> {
        let mut bindings = vec![start.clone()];
        for literal in body.iter().filter(|literal| is_atom(literal)) {
            let atom = atom(literal);
            bindings = bindings
                .iter()
                .flat_map(|binding| self.matches(&atom, binding))
                .collect();
        }
        bindings
            .into_iter()
            .filter_map(|binding| self.settle(body, binding))
            .collect()
    }

    /// The conditions of a body whose atoms are bound.
    fn settle(&self, body: &[String], mut binding: Binding) -> Option<Binding> {
        let mut waiting: Vec<&String> = body
            .iter()
            .filter(|literal| !is_atom(literal) && !literal.starts_with('~'))
            .collect();
        while !waiting.is_empty() {
            let before = waiting.len();
            let mut still = Vec::new();
            for literal in waiting {
                match condition(literal, &binding) {
                    Some(settled) => binding = settled?,
                    None => still.push(literal),
                }
            }
            assert!(still.len() < before, "{still:?} can't be computed");
            waiting = still;
        }
        let absent = body.iter().filter_map(|literal| literal.strip_prefix('~'));
        absent
            .map(atom)
            .all(|atom| self.matches(&atom, &binding).is_empty())
            .then_some(binding)
    }

    /// Checks that each step is an instance of its rule and each leaf a fact. Returns the number of
    /// steps.
    fn check(&self, proof: &Proof, proved: &mut Vec<String>) -> Result<usize, String> {
        let statement = atom(&proof.statement);
        let values: Vec<Value> = statement.args.iter().map(|arg| constant(arg)).collect();
        let steps = match &proof.support {
            Support::Fact => {
                let given = |(name, known): &(String, Vec<Value>)| {
                    *name == statement.name
                        && known.len() == values.len()
                        && known.iter().zip(&values).all(|(a, b)| same(a, b))
                };
                let stated = |rule: &Rule| {
                    rule.body.is_empty()
                        && rule.heads.iter().any(|head| {
                            head.name == statement.name
                                && unify(&head.args, &values, &Binding::new()).is_some()
                        })
                };
                if !self.facts.iter().any(given) && !self.rules.iter().any(stated) {
                    return Err(format!("{} is not a fact", proof.statement));
                }
                1
            }
            Support::Cut if proved.contains(&proof.statement) => 1,
            Support::Cut => return Err(format!("{} has no proof in the tree", proof.statement)),
            Support::Rule {
                rule: cited,
                premises,
            } => 1 + self.check_step((&statement, &values), &cited.text, (1, premises), proved)?,
            Support::Aggregate {
                rule: cited,
                matches,
                premises,
            } => {
                let shown = MATCHES_SHOWN.min(*matches);
                let steps = self.check_step(
                    (&statement, &values),
                    &cited.text,
                    (shown, premises),
                    proved,
                )?;
                // It is computed again from all matches; the premises show the first few of them.
                let pattern: Vec<Option<Value>> = values.iter().cloned().map(Some).collect();
                if shown == 0 || self.tuples(&statement.name, &pattern).is_empty() {
                    return Err(format!("`{}` does not conclude {statement:?}", cited.text));
                }
                1 + steps
            }
            other => return Err(format!("no shipped property has the support {other:?}")),
        };
        proved.push(proof.statement.clone());
        Ok(steps)
    }

    /// The rule with a text, which must be in a rule file.
    fn cited(&self, text: &str) -> Result<Rule, String> {
        let cited = rule(text);
        let known =
            |known: &Rule| known.body == cited.body && known.heads.len() == cited.heads.len();
        if self.rules.iter().any(known) {
            Ok(cited)
        } else {
            Err(format!("`{text}` is in no rule file"))
        }
    }

    /// Checks that a rule's conditions, with proofs as premises, hold. Returns their binding, and
    /// the number of steps.
    fn check_body(
        &self,
        body: &[String],
        premises: &[Premise],
        proved: &mut Vec<String>,
    ) -> Result<(Binding, usize), String> {
        let (mut binding, mut steps) = (Binding::new(), 0);
        for (literal, premise) in body.iter().zip(premises) {
            match premise {
                Premise::Proof(inner) if is_atom(literal) => {
                    steps += self.check(inner, proved)?;
                    let (written, proved) = (atom(literal), atom(&inner.statement));
                    let values: Vec<Value> = proved.args.iter().map(|arg| constant(arg)).collect();
                    let fits = (written.name == proved.name)
                        .then(|| unify(&written.args, &values, &binding))
                        .flatten();
                    binding = fits.ok_or_else(|| {
                        format!("{} is not an instance of {literal}", inner.statement)
                    })?;
                }
                Premise::Absent(_) if literal.starts_with('~') => {}
                Premise::Computed(_) if !is_atom(literal) && !literal.starts_with('~') => {}
                other => return Err(format!("{other:?} can't support {literal}")),
            }
        }
        let binding = self
            .settle(body, binding)
            .ok_or_else(|| format!("a condition of {body:?} does not hold"))?;
        Ok((binding, steps))
    }

    /// Checks that each match of a rule concludes the statement, or belongs to its group if the
    /// rule aggregates.
    fn check_step(
        &self,
        (statement, values): (&Atom, &[Value]),
        text: &str,
        (matches, premises): (usize, &[Premise]),
        proved: &mut Vec<String>,
    ) -> Result<usize, String> {
        let cited = self.cited(text)?;
        let conditions = cited.body.len();
        if premises.len() != matches * conditions {
            return Err(format!(
                "{} conditions for {matches} times {conditions} of `{text}`",
                premises.len()
            ));
        }
        let mut steps = 0;
        for number in 0..matches {
            let of_match = &premises[number * conditions..][..conditions];
            let (binding, within) = self.check_body(&cited.body, of_match, proved)?;
            let concludes = |head: &Atom| {
                let plain = head
                    .args
                    .iter()
                    .zip(values)
                    .filter(|(arg, _)| !arg.starts_with('#'));
                let (args, own): (Vec<String>, Vec<Value>) =
                    plain.map(|(arg, own)| (arg.clone(), own.clone())).unzip();
                let fits = head.name == statement.name && head.args.len() == values.len();
                fits && unify(&args, &own, &binding).is_some()
            };
            if !cited.heads.iter().any(concludes) {
                return Err(format!("`{text}` does not conclude {statement:?}"));
            }
            steps += within;
        }
        Ok(steps)
    }
}

/// The shipped Datalog properties, with their facts and explanations.
fn shipped() -> Vec<(String, Case, actcheck::rules::explain::Explanation)> {
    let mut found = Vec::new();
    for folder in cases() {
        let Ok(file) = std::fs::read_to_string(folder.join("shipped")) else {
            continue;
        };
        if !file.trim().ends_with(".rls") {
            // A query has no proof; its rows are its witnesses.
            continue;
        }
        let ontology = ontology_of(&folder);
        // The checker has no sums and counts. Their conclusions are compared with the naive
        // evaluator's.
        let text = &ontology.properties[TESTED].rule.source.text;
        if ["#sum(", "#count("]
            .iter()
            .any(|aggregate| text.contains(aggregate))
        {
            continue;
        }
        let facts = facts_of(&folder);
        let mut known = given(&facts);
        if text.contains("ontology(") {
            known.extend(hierarchy(&ontology));
        }
        let book = RuleBook::prepare(&ontology).unwrap();
        let explanation = book
            .explain(&facts.action(0).unwrap(), TESTED, &Budget::default())
            .unwrap();
        let texts = ontology
            .libraries
            .iter()
            .chain(ontology.properties.values().map(|property| &property.rule));
        let rules = texts.flat_map(|file| rules(&file.source.text)).collect();
        found.push((
            folder.display().to_string(),
            Case {
                facts: known,
                rules,
            },
            explanation,
        ));
    }
    found
}

#[test]
fn every_shipped_proof_consists_of_rule_instances_and_facts() {
    let (mut proofs, mut steps) = (0, 0);
    for (name, case, explanation) in shipped() {
        // A statement can be proved in an earlier proof of the same explanation.
        let mut proved = Vec::new();
        for proof in &explanation.proofs {
            steps += case
                .check(proof, &mut proved)
                .unwrap_or_else(|why| panic!("{name}: {why}"));
            proofs += 1;
        }
        // The checker derives the explanation's conclusion by itself.
        let derived = |predicate: &str| {
            let arities = case
                .rules
                .iter()
                .flat_map(|rule| &rule.heads)
                .filter(|head| head.name == predicate);
            arities
                .map(|head| head.args.len())
                .any(|arity| !case.tuples(predicate, &vec![None; arity]).is_empty())
        };
        let states_success = case
            .rules
            .iter()
            .flat_map(|rule| &rule.heads)
            .any(|head| head.name == "success");
        let holds = if states_success {
            derived("success")
        } else {
            !derived("violation")
        };
        assert_eq!(holds, explanation.findings.unwrap().holds, "{name}");
    }
    assert!(
        proofs >= 4 && steps >= 30,
        "{proofs} proofs of {steps} steps"
    );
}

fn with_support(proof: &Proof, support: Support) -> Proof {
    let mut copy = proof.clone();
    copy.support = support;
    copy
}

/// Every variant of a proof with one statement slightly changed.
fn spoiled(proof: &Proof) -> Vec<Proof> {
    let mut all = Vec::new();
    let (head, last) = proof
        .statement
        .rsplit_once(if proof.statement.contains(", ") {
            ", "
        } else {
            "("
        })
        .unwrap();
    let joint = if proof.statement.contains(", ") {
        ", "
    } else {
        "("
    };
    let wrong = match last.trim_end_matches(')').parse::<f64>() {
        Ok(number) => format!("{head}{joint}{})", number + 0.5),
        Err(_) => format!("{head}{joint}obj:nothing)"),
    };
    let mut copy = proof.clone();
    copy.statement = wrong;
    all.push(copy);
    let (premises, rebuilt): (_, Box<dyn Fn(Vec<Premise>) -> Support>) = match &proof.support {
        Support::Rule { rule, premises } => (
            premises,
            Box::new(|premises| Support::Rule {
                rule: rule.clone(),
                premises,
            }),
        ),
        Support::Aggregate {
            rule,
            matches,
            premises,
        } => (
            premises,
            Box::new(|premises| Support::Aggregate {
                rule: rule.clone(),
                matches: *matches,
                premises,
            }),
        ),
        _ => return all,
    };
    for (idx, premise) in premises.iter().enumerate() {
        let mut fewer = premises.clone();
        fewer.remove(idx);
        all.push(with_support(proof, rebuilt(fewer)));
        let Premise::Proof(inner) = premise else {
            continue;
        };
        for inner in spoiled(inner) {
            let mut premises = premises.clone();
            premises[idx] = Premise::Proof(inner);
            all.push(with_support(proof, rebuilt(premises)));
        }
    }
    all
}

#[test]
fn a_proof_with_one_wrong_statement_is_refused() {
    let mut refused = 0;
    for (name, case, explanation) in shipped() {
        for wrong in explanation.proofs.iter().flat_map(spoiled) {
            assert!(
                case.check(&wrong, &mut Vec::new()).is_err(),
                "{name}: {wrong:?}"
            );
            refused += 1;
        }
    }
    assert!(refused >= 60, "{refused}");
}
