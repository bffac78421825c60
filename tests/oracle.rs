//! The engine against others: the naive evaluator on random programs, and Nemo's published
//! programs.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use actcheck::base::{Source, Term};
use actcheck::rules::Budget;
use actcheck::rules::explain::{Failure, Premise, Proof, Support};
use actcheck::rules::standalone::{Closure, Engine, Loading, Program, run_as};
use proptest::prelude::*;

use crate::support::foreign::left_out;
use crate::support::nulls::{Facts, are_isomorphic};

/// A rule or fact of a random program, as text.
fn statements() -> impl Strategy<Value = Vec<String>> {
    let fact = (0..4usize, 0..5i64, 0..5i64).prop_map(|(p, a, b)| format!("e{p}({a}, {b}) ."));
    proptest::collection::vec(prop_oneof![2 => fact, 3 => rule()], 4..28)
}

/// Predicates `e0 … e3` have facts, `p0 … p5` are derived. A rule negates and aggregates only over
/// smaller numbers, and reads equal or smaller ones positively, so that nearly every program is
/// stratified and many are recursive. (Several heads with a new thing are derived together, which
/// may close a cycle.) Some rules make new things.
fn rule() -> impl Strategy<Value = String> {
    let variable = || {
        prop_oneof![
            Just("?x"),
            Just("?y"),
            Just("?z"),
            Just("?u"),
            Just("_"),
            Just("1"),
            Just("2.5"),
            Just("\"a\"")
        ]
    };
    let atom = move || (0..10usize, variable(), variable());
    (
        0..6usize,
        proptest::collection::vec(atom(), 1..4),
        proptest::option::of(atom()),
        0..18usize,
    )
        .prop_map(|(head, atoms, negated, extra)| {
            let name = |number: usize, limit: usize| match number % (5 + limit) {
                number if number < 4 => format!("e{number}"),
                number => format!("p{}", (number - 4).min(limit)),
            };
            let mut body: Vec<String> = atoms
                .iter()
                .map(|(p, a, b)| format!("{}({a}, {b})", name(*p, head)))
                .collect();
            let bound: Vec<&str> = atoms
                .iter()
                .flat_map(|(_, a, b)| [*a, *b])
                .filter(|v| v.starts_with('?'))
                .collect();
            let first = bound.first().copied().unwrap_or("3");
            let last = bound.last().copied().unwrap_or("4");
            if let Some((p, a, b)) = negated.filter(|_| head > 0) {
                body.push(format!("~{}({a}, {b})", name(p, head - 1)));
            }
            let mut target = format!("p{head}({first}, {last})");
            match extra {
                0 => body.push(format!("{first} < {last}")),
                1 => body.push(format!("{first} != {last}")),
                // Bounded, so that counting up terminates.
                2 => {
                    body.push(format!("?n = {first} + 1, ?n < 8"));
                    target = format!("p{head}(?n, {last})");
                }
                3 => {
                    body.push(format!("?n = {first} * {last}, ?n <= 20"));
                    target = format!("p{head}({first}, ?n)");
                }
                4 if head > 0 => {
                    body = atoms
                        .iter()
                        .map(|(p, a, b)| format!("{}({a}, {b})", name(*p, head - 1)))
                        .collect();
                    target = format!("p{head}({first}, #count({last}))");
                }
                5 if head > 0 => {
                    body = atoms
                        .iter()
                        .map(|(p, a, b)| format!("{}({a}, {b})", name(*p, head - 1)))
                        .collect();
                    target = format!("p{head}(#sum({last}, {first}), #max({last}))");
                }
                6 => body.push(format!("isInteger({first})")),
                7 => target = format!("p{head}({first}, {last}), p{head}({last}, {first})"),
                8 => target = format!("p{head}({last}, !v)"),
                9 => {
                    target = format!(
                        "p{head}(!v, {first}), p{}({last}, !v)",
                        head.saturating_sub(1)
                    )
                }
                10 => target = format!("p{head}({first}, {last}), p{head}({last}, !v), e3(!v, !w)"),
                14 => body.push(format!("{last} = {first} + 1")),
                15 => body.push(format!("e0({first} + 1, ?k), ?k = {last}")),
                // A head without a value, and a bound, so that counting up terminates.
                16 => {
                    body.push(format!("?n = {first} + 1, ?n < 8"));
                    target = format!("p{head}(?n, {last}), p{head}({last} * 1, {first})");
                }
                17 => body.push(format!("e1(?k, ?l), ?k * 1 = {first} + ?l")),
                _ => {}
            }
            format!("{target} :- {} .", body.join(", "))
        })
}

/// Few enough that endless programs end soon.
fn small(tuples: usize) -> Budget {
    Budget {
        tuples,
        secs: 20.0,
        new_things: 300,
        ..Budget::default()
    }
}

/// Returns `None` for a program that can't be stratified.
fn loaded(text: &str) -> Option<Program> {
    match Program::load(&Source::new("random.rls", text), Path::new("")) {
        Ok(program) => Some(program),
        Err(faults) => {
            assert!(
                text.contains("!v") && faults.iter().all(|fault| fault.code != "R039"),
                "{faults}\n{text}"
            );
            assert!(
                faults.iter().any(|fault| fault.code == "R050"),
                "{faults}\n{text}"
            );
            None
        }
    }
}

fn load(text: &str) -> Program {
    Program::load(&Source::new("random.rls", text), Path::new(""))
        .unwrap_or_else(|faults| panic!("{faults}\n{text}"))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn both_evaluators_derive_the_same(statements in statements()) {
        let text = statements.join("\n");
        let Some(program) = loaded(&text) else { return Ok(()) };
        let budget = small(20_000);
        let (Ok(fast), Ok(naive)) = (program.close(Engine::Fast, &budget), program.close(Engine::Naive, &budget)) else {
            // Too large for the naive evaluator: skipped.
            return Ok(());
        };
        for predicate in naive.predicates() {
            prop_assert_eq!(fast.tuples(predicate), naive.tuples(predicate), "{} in\n{}", predicate, text);
        }
    }

    #[test]
    fn every_proof_is_valid(statements in statements()) {
        let text = statements.join("\n");
        let Some(program) = loaded(&text) else { return Ok(()) };
        let budget = small(2_000);
        let Ok(closure) = program.close(Engine::Naive, &budget) else { return Ok(()) };
        for predicate in closure.predicates() {
            for tuple in closure.tuples(predicate).into_iter().step_by(7).take(5) {
                let args: Vec<String> = tuple.iter().map(Term::to_string).collect();
                let statement = format!("{predicate}({})", args.join(", "));
                let explanation = program.explain(&statement, &budget).unwrap();
                prop_assert_eq!(explanation.proofs.len(), 1, "{} in\n{}", statement, text);
                if let Err(reason) = checked(&explanation.proofs[0], &closure, &text, &mut Vec::new(), &mut Vec::new()) {
                    prop_assert!(false, "{}: {}\n{}\n{}", statement, reason, explanation.to_text(), text);
                }
            }
        }
    }

    /// A goal is reported as derived exactly if it is, and a condition reported as missing is
    /// missing.
    #[test]
    fn every_miss_is_true(statements in statements(), first in 0..9_i64, second in 0..9_i64) {
        let text = statements.join("\n");
        let Some(program) = loaded(&text) else { return Ok(()) };
        let budget = small(2_000);
        let Ok(closure) = program.close(Engine::Naive, &budget) else { return Ok(()) };
        for predicate in closure.predicates() {
            let goal = format!("{predicate}({first}, {second})");
            let explanation = program.explain(&goal, &budget).unwrap();
            let tuple = vec![Term::Integer(first), Term::Integer(second)];
            prop_assert_eq!(explanation.holds(), closure.tuples(predicate).contains(&tuple), "{} in\n{}", goal, text);
            let mut miss = explanation.miss.as_ref();
            while let Some(found) = miss {
                let shown = || format!("{}\n{text}", explanation.to_text());
                prop_assert!(found.satisfied.iter().all(|said| matching(said, &closure) != Some(false)), "{}", shown());
                prop_assert!(matching(&found.failed, &closure) != Some(true), "{}", shown());
                miss = match &found.failure {
                    Failure::NoMatch { because, .. } => because.as_deref(),
                    _ => None,
                };
            }
        }
    }

    #[test]
    fn the_parser_never_panics(text in "[?!$#@%~(){}\\[\\]<>:=,. \\n\"\\\\a-cw0-9_^*/+-]{0,80}") {
        let _ = Program::load(&Source::new("random.rls", text), Path::new(""));
    }
}

/// Returns whether some tuple matches a statement with `_` for any value. Returns `None` for a text
/// that is not a statement.
fn matching(statement: &str, closure: &Closure) -> Option<bool> {
    let (name, args) = statement.strip_suffix(')')?.split_once('(')?;
    closure.arity(name)?;
    let args: Vec<&str> = args.split(", ").collect();
    let fits = |tuple: &Vec<Term>| {
        // A variable that occurs twice has one value.
        let value_of = |name: &str| {
            args.iter()
                .position(|arg| *arg == name)
                .map(|place| tuple[place].to_string())
        };
        tuple
            .iter()
            .zip(&args)
            .all(|(term, arg)| match arg.strip_prefix('?') {
                Some(_) => value_of(arg).as_deref() == Some(&*term.to_string()),
                None => *arg == "_" || term.to_string() == *arg,
            })
    };
    Some(closure.tuples(name).iter().any(fits))
}

/// Checks a proof independently of the engine's explanation: facts are in the text, and a rule
/// alone derives its conclusion from its premises.
fn checked(
    proof: &Proof,
    closure: &Closure,
    text: &str,
    above: &mut Vec<String>,
    proved: &mut Vec<String>,
) -> Result<(), String> {
    let holds = |statement: &str| {
        let (name, args) = statement.trim_end_matches(')').split_once('(').unwrap();
        closure.tuples(name).iter().any(|tuple| {
            tuple
                .iter()
                .map(Term::to_string)
                .collect::<Vec<_>>()
                .join(", ")
                == args
        })
    };
    let statement = &proof.statement;
    if !holds(statement) {
        return Err(format!("{statement} does not hold"));
    }
    if above.contains(statement) {
        return Err(format!("{statement} proves itself"));
    }
    let Support::Rule { rule, premises } = &proof.support else {
        return match proof.support {
            Support::Fact if !text.contains(&format!("{statement} .")) => {
                Err(format!("{statement} is not a fact"))
            }
            // A cut statement must be proved elsewhere in the same tree.
            Support::Cut if !proved.contains(statement) => {
                Err(format!("{statement} has no proof in the tree"))
            }
            _ => {
                proved.push(statement.clone());
                Ok(())
            }
        };
    };
    above.push(statement.clone());
    // The heads get other names, so that the rule is applied once: a rule that makes new things may
    // be endless without the rest of its program.
    let Some((heads, body)) = rule.text.split_once(":-") else {
        return Err(format!("{} has no body", rule.text));
    };
    let mut alone = format!("{} :- {body}\n", renamed(heads));
    for premise in premises {
        match premise {
            Premise::Proof(inner) => {
                checked(inner, closure, text, above, proved)?;
                alone.push_str(&format!("{} .\n", inner.statement));
            }
            // The same variable twice: the statement can't express that.
            Premise::Absent(pattern) if pattern.contains('?') => {}
            Premise::Absent(pattern) => {
                let explained = load(text)
                    .explain(pattern, &Budget::default())
                    .map_err(|fault| fault.to_string())?;
                if !explained.proofs.is_empty() {
                    return Err(format!("{pattern} is not absent"));
                }
            }
            Premise::Computed(_) => {}
            other => return Err(format!("{other:?} is not checked")),
        }
    }
    above.pop();
    proved.push(statement.clone());
    // A new thing has another label alone.
    let is_made = premises
        .iter()
        .any(|premise| matches!(premise, Premise::Computed(text) if text.contains("new thing")));
    let statement = &if is_made {
        any_null(statement)
    } else {
        statement.clone()
    };
    let derived = load(&alone)
        .explain(&renamed(statement), &small(20_000))
        .map_err(|fault| fault.to_string())?;
    if derived.proofs.is_empty() {
        Err(format!("{statement} does not follow from\n{alone}"))
    } else {
        Ok(())
    }
}

/// Puts `head_` before the names of predicates, which are `e0 … e3` and `p0 … p5`.
fn renamed(statements: &str) -> String {
    (0..6).fold(statements.to_owned(), |text, number| {
        text.replace(&format!("e{number}("), &format!("head_e{number}("))
            .replace(&format!("p{number}("), &format!("head_p{number}("))
    })
}

/// Replaces the nulls of a statement by `_`.
fn any_null(statement: &str) -> String {
    let mut parts = statement.split("_:");
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |all, part| {
        format!(
            "{all}_{}",
            part.trim_start_matches(|c: char| c.is_ascii_digit())
        )
    })
}

/// The first rule alone is endless: only the second one derives `p0(1, 1)`, which satisfies it.
#[test]
fn a_proof_with_a_rule_that_is_endless_alone_is_valid() {
    let text = "p0(!v, ?y), p0(?z, !v) :- e2(?y, _), p0(?x, ?z) .\n\
                p0(?x, ?x), p0(?x, !v), e3(!v, !w) :- e2(?x, ?x) .\n\
                e2(1, 1) .\n\
                e0(0, 0) .";
    let program = load(text);
    let closure = program.close(Engine::Naive, &small(2_000)).unwrap();
    for tuple in closure.tuples("p0") {
        let args: Vec<String> = tuple.iter().map(Term::to_string).collect();
        let explanation = program
            .explain(&format!("p0({})", args.join(", ")), &small(2_000))
            .unwrap();
        checked(
            &explanation.proofs[0],
            &closure,
            text,
            &mut Vec::new(),
            &mut Vec::new(),
        )
        .unwrap();
    }
}

#[test]
fn a_program_explains_missing_facts() {
    let program = load(
        "e(1, 2) . e(2, 3) . p(?x, ?y) :- e(?x, ?y) . p(?x, ?z) :- p(?x, ?y), e(?y, ?z), ?z < 3 .",
    );
    let explanation = program.explain("p(1, 3)", &Budget::default()).unwrap();
    let text = explanation.to_text();
    assert!(text.contains("missing ?z < 3, with 3 < 3"), "{text}");
    assert!(program.explain("q(1)", &Budget::default()).is_err());
    assert!(program.explain("p(1", &Budget::default()).is_err());
    assert!(
        program
            .explain("p(9, _)", &Budget::default())
            .unwrap()
            .proofs
            .is_empty()
    );
}

#[test]
fn recursion_computes_the_closure_of_a_chain() {
    let program = load(
        "e(1, 2) . e(2, 3) . e(3, 1) . e(3, 4) . p(?x, ?y) :- e(?x, ?y) . p(?x, ?z) :- p(?x, ?y), e(?y, ?z) .",
    );
    let closure = program.close(Engine::Fast, &Budget::default()).unwrap();
    assert_eq!(closure.count("p"), 12);
    assert!(
        closure
            .tuples("p")
            .contains(&vec![Term::Integer(1), Term::Integer(1)])
    );
}

/// A cycle takes as many rounds as it has rules, so a round must not visit all of them.
#[test]
fn long_chains_and_cycles_of_rules_are_evaluated() {
    let count = 20_000;
    let chain: String = (0..count)
        .rev()
        .map(|i| format!("p{}(?x) :- p{i}(?x) .\n", i + 1))
        .collect();
    for (text, last) in [
        (chain.clone(), count),
        (format!("{chain}p0(?x) :- p{count}(?x) ."), 0),
    ] {
        let closure = load(&format!("p0(1) .\n{text}"))
            .close(Engine::Fast, &Budget::default())
            .unwrap();
        assert_eq!(closure.count(&format!("p{last}")), 1);
    }
}

#[test]
fn a_nonterminating_program_is_stopped_and_its_rule_named() {
    let program = load("n(0) .\nn(?y) :- n(?x), ?y = ?x + 1 .");
    let budget = Budget {
        tuples: 10_000,
        secs: 10.0,
        ..Budget::default()
    };
    let fault = program
        .close(Engine::Fast, &budget)
        .unwrap_err()
        .to_string();
    assert!(fault.contains("random.rls:2"), "{fault}");
    let budget = Budget {
        tuples: usize::MAX,
        secs: 0.2,
        ..Budget::default()
    };
    let started = std::time::Instant::now();
    let fault = program
        .close(Engine::Fast, &budget)
        .unwrap_err()
        .to_string();
    assert!(
        fault.contains("0.2 s") && started.elapsed().as_secs_f64() < 5.0,
        "{fault}"
    );
}

/// Runs the programs of a checkout of knowsys/nemo: `NEMO=path/to/nemo cargo test --release nemo`.
/// Left out without `NEMO`.
///
/// Every program gives the expected tables, or is listed in `nemo_deviations.tsv` with the code of
/// the fault that refuses it and the reason. A listed program that gives its tables must be removed
/// from the list.
#[test]
fn nemo_programs_give_their_expected_tables() {
    let Some(nemo) = std::env::var_os("NEMO") else {
        left_out("Nemo's programs", "NEMO names no checkout of knowsys/nemo");
        return;
    };
    let root = PathBuf::from(nemo).join("resources/testcases");
    let deviations: BTreeMap<&str, (&str, &str)> = include_str!("nemo_deviations.tsv")
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| {
            let fields: Vec<&str> = line.split('\t').collect();
            (fields[0], (fields[1], fields[2]))
        })
        .collect();
    let (mut right, mut seen, mut faults) = (0, BTreeSet::new(), Vec::new());
    for program in programs(&root) {
        let name = program
            .strip_prefix(&root)
            .unwrap()
            .with_extension("")
            .display()
            .to_string();
        match (same_tables(&program), deviations.get(name.as_str())) {
            (Ok(()), None) => right += 1,
            (Ok(()), Some(_)) => faults.push(format!(
                "{name} gives its tables now: remove it from the list"
            )),
            (Err(why), Some((code, reason))) if why.contains(code) => println!("{name}: {reason}"),
            (Err(why), Some((code, _))) => {
                faults.push(format!("{name} is not refused with {code}: {why}"))
            }
            (Err(why), None) => faults.push(format!("{name}: {why}")),
        }
        seen.insert(name);
    }
    println!(
        "{right} of {} programs give the expected tables",
        seen.len()
    );
    faults.extend(
        deviations
            .keys()
            .filter(|name| !seen.contains(**name))
            .map(|name| format!("{name} does not exist")),
    );
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// The rows of a table as lines, in any order.
fn table(path: &Path) -> BTreeSet<String> {
    std::fs::read_to_string(path)
        .unwrap_or_default()
        .trim()
        .lines()
        .map(str::to_owned)
        .collect()
}

fn programs(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(programs(&path));
        } else if path.extension().is_some_and(|extension| extension == "rls") {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// Runs a program and compares its exports with the folder of its name, in any order, and up to the
/// labels of nulls, which are the same in all tables.
fn same_tables(program: &Path) -> Result<(), String> {
    let out = tempfile::tempdir().unwrap();
    // Nemo leaves out rows that lack fields.
    let budget = Budget {
        tuples: 50_000_000,
        secs: 300.0,
        bytes: 8 << 30,
        ..Budget::default()
    };
    run_as(
        program,
        out.path(),
        &Loading {
            lenient: true,
            ..Loading::within(&budget)
        },
    )
    .map_err(|faults| faults.to_string())?;
    let (mut all_got, mut all_wanted) = (Facts::new(), Facts::new());
    for entry in std::fs::read_dir(program.with_extension("")).unwrap() {
        let expected = entry.unwrap().path();
        let name = expected.file_name().unwrap().to_string_lossy().into_owned();
        let (got, wanted) = (table(&out.path().join(&name)), table(&expected));
        let rest = |rows: &BTreeSet<String>| {
            rows.iter()
                .filter(|row| !row.contains("_:"))
                .cloned()
                .collect()
        };
        let (plain_got, plain_wanted): (BTreeSet<String>, BTreeSet<String>) =
            (rest(&got), rest(&wanted));
        if plain_got != plain_wanted || got.len() != wanted.len() {
            let missing: Vec<_> = wanted.difference(&got).take(6).collect();
            let surplus: Vec<_> = got.difference(&wanted).take(6).collect();
            return Err(format!("{name}: missing {missing:?}, surplus {surplus:?}"));
        }
        all_got.extend(with_nulls(&name, &got));
        all_wanted.extend(with_nulls(&name, &wanted));
    }
    let same = all_got == all_wanted || are_isomorphic(&all_got, &all_wanted);
    same.then_some(())
        .ok_or_else(|| format!("other nulls: {all_got:?} instead of {all_wanted:?}"))
}

/// The rows of a table that have nulls.
fn with_nulls(name: &str, rows: &BTreeSet<String>) -> Facts {
    let values = |row: &String| (name.to_owned(), row.split(',').map(str::to_owned).collect());
    rows.iter()
        .filter(|row| row.contains("_:"))
        .map(values)
        .collect()
}
