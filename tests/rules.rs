//! Rule files over facts: every folder of `tests/rules/` is a case.
//!
//! A case holds `rules.rls` or `rules.rq` (or `shipped`, the name of a file in `rules/`),
//! optionally its own libraries (`lib*.rls`; the default is the shipped ones), `facts.trig` with
//! the graphs `act:before`, `act:after`, `act:during` and `act:parameters` (statements
//! `act:pickObject act:value obj:…`), and `expected`: the findings, or the diagnostics.
//! `UPDATE_EXPECT=1` rewrites `expected`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use actcheck::base::{ActionFacts, Files, Findings, RuleFault, RunFacts, Source, Term, names};
use actcheck::ontology::{self, Ontology, Property, RuleFile};
use actcheck::rules::explain::{Premise, Support};
use actcheck::rules::{Budget, RuleBook, owl_closure, standalone::Program};

use crate::support::expected::assert_expected;

pub const TESTED: &str = "http://actions#Tested";

fn root() -> PathBuf {
    // The package may be in another folder than the tests; the working directory of tests is the
    // package's.
    ["tests/rules", "../../main/tests/rules"]
        .map(PathBuf::from)
        .into_iter()
        .find(|path| path.is_dir())
        .unwrap()
}

fn rule_file(path: &Path) -> RuleFile {
    let text = std::fs::read_to_string(path).unwrap();
    let name = path.file_name().unwrap().to_string_lossy().into_owned();
    RuleFile::new(Source::new(name, text))
}

/// The shipped ontology with its properties replaced by the case's single property.
pub fn ontology_of(case: &Path) -> Ontology {
    let mut ontology = shipped_ontology();
    let shipped = root().join("../../rules");
    let mut libraries: Vec<PathBuf> = list(case)
        .into_iter()
        .filter(|path| is_library(path))
        .collect();
    if libraries.is_empty() {
        libraries = list(&shipped.join("lib"))
            .into_iter()
            .filter(|path| path.extension().is_some_and(|e| e == "rls"))
            .collect();
        libraries.retain(|path| !path.ends_with("owl-rl.rls"));
    }
    ontology.libraries = libraries.iter().map(|path| rule_file(path)).collect();
    let rule = match std::fs::read_to_string(case.join("shipped")) {
        Ok(name) => rule_file(&shipped.join(name.trim())),
        Err(_) => rule_file(
            &["rules.rls", "rules.rq"]
                .map(|name| case.join(name))
                .into_iter()
                .find(|p| p.is_file())
                .unwrap(),
        ),
    };
    let of_shipped = ontology
        .properties
        .values()
        .find(|property| property.rule.path.ends_with(&format!("/{}", rule.path)));
    let unit = of_shipped.map_or(Some("m".to_owned()), |property| property.unit.clone());
    ontology.properties = tested(rule, unit);
    ontology
}

/// With the invariants, which state the units of their margins.
fn shipped_ontology() -> Ontology {
    ontology::load(&Files::Disk, &root().join("../../ontology/extra.ttl")).unwrap()
}

/// The property that a rule decides, with the unit of its margin.
fn tested(rule: RuleFile, unit: Option<String>) -> std::collections::BTreeMap<String, Property> {
    let mut property = Property::new(TESTED, rule);
    property.label = "the tested property".into();
    property.unit = unit;
    [(TESTED.to_owned(), property)].into()
}

fn is_library(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.starts_with("lib") && name.ends_with(".rls")
}

fn list(folder: &Path) -> Vec<PathBuf> {
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    paths.sort();
    paths
}

fn term(term: &oxigraph::model::Term) -> Term {
    use oxigraph::model::Term as Rdf;
    match term {
        Rdf::NamedNode(node) => Term::iri(node.as_str()),
        Rdf::BlankNode(node) => Term::Blank(node.as_str().into()),
        Rdf::Literal(literal) => match literal.datatype().as_str().strip_prefix(names::XSD) {
            Some("double") => Term::Double(literal.value().parse().unwrap()),
            Some("integer") => Term::Integer(literal.value().parse().unwrap()),
            Some("boolean") => Term::Boolean(literal.value() == "true"),
            _ => Term::string(literal.value()),
        },
    }
}

/// Converts a term; a literal keeps its language, its datatype, and a form that is not canonical.
fn exact(of: &oxigraph::model::Term) -> Term {
    let oxigraph::model::Term::Literal(literal) = of else {
        return term(of);
    };
    let (text, datatype) = (literal.value(), literal.datatype().as_str());
    if let Some(tag) = literal.language() {
        return Term::LangString(text.into(), tag.into());
    }
    let known = match datatype.strip_prefix(names::XSD) {
        Some("string") => Some(Term::string(text)),
        Some("integer") => text.parse().ok().map(Term::Integer),
        Some("double") => text.parse().ok().map(Term::Double),
        Some("boolean") => text.parse().ok().map(Term::Boolean),
        _ => None,
    };
    known.unwrap_or_else(|| Term::Literal(text.into(), datatype.into()))
}

/// Facts of a case; empty if it has no `facts.trig`.
pub fn facts_of(case: &Path) -> RunFacts {
    let mut facts = RunFacts {
        snapshots: vec![vec![], vec![]],
        during: vec![vec![]],
        parameters: vec![vec![]],
        ..Default::default()
    };
    let prefixes: String = names::PREFIXES
        .iter()
        .map(|(prefix, iri)| format!("@prefix {prefix}: <{iri}> .\n"))
        .collect();
    let text = prefixes + &std::fs::read_to_string(case.join("facts.trig")).unwrap_or_default();
    for quad in oxigraph::io::RdfParser::from_format(oxigraph::io::RdfFormat::TriG).for_slice(&text)
    {
        let quad = quad.unwrap();
        let parts = [quad.subject.into(), quad.predicate.into(), quad.object]
            .map(|t| facts.terms.intern(term(&t)));
        match quad
            .graph_name
            .to_string()
            .trim_matches(['<', '>'])
            .strip_prefix(names::ACT)
        {
            Some("before") => facts.snapshots[0].push(parts),
            Some("after") => facts.snapshots[1].push(parts),
            Some("during") => facts.during[0].push(parts),
            Some("parameters") => facts.parameters[0].push([parts[0], parts[2]]),
            other => panic!("unknown graph {other:?}"),
        }
    }
    facts
        .snapshots
        .iter_mut()
        .chain(&mut facts.during)
        .for_each(|triples| triples.sort_unstable());
    facts
}

fn shown(findings: &Findings) -> String {
    let mut out = String::new();
    writeln!(out, "holds: {}", findings.holds).unwrap();
    if !findings.applicable {
        writeln!(out, "applicable: false").unwrap();
    }
    if let Some(margin) = findings.margin {
        writeln!(out, "margin: {margin:.6}").unwrap();
    }
    for because in &findings.because {
        writeln!(out, "because: {because}").unwrap();
    }
    for row in &findings.witness {
        let values: Vec<String> = row
            .values
            .iter()
            .map(|(name, term)| format!("{name}={term}"))
            .collect();
        writeln!(out, "{}({})", row.predicate, values.join(", ")).unwrap();
    }
    if findings.witness_count > findings.witness.len() {
        writeln!(out, "of {}", findings.witness_count).unwrap();
    }
    out
}

fn judged(book: &RuleBook, facts: &ActionFacts<'_>) -> Result<Findings, RuleFault> {
    let budget = Budget {
        tuples: 100_000,
        secs: 2.0,
        ..Budget::default()
    };
    book.judge(facts, &[TESTED.to_owned()], &budget)
        .remove(TESTED)
        .unwrap()
}

fn outcome(case: &Path) -> String {
    match RuleBook::prepare(&ontology_of(case)) {
        Err(diagnostics) => diagnostics.to_string(),
        Ok(book) => {
            let facts = facts_of(case);
            let mut out = match judged(&book, &facts.action(0).unwrap()) {
                Ok(findings) => shown(&findings),
                Err(fault) => format!("fault: {fault}\n"),
            };
            out.push_str(&book.warnings().to_string());
            out
        }
    }
}

pub fn cases() -> Vec<PathBuf> {
    list(&root())
        .into_iter()
        .filter(|path| path.is_dir())
        .collect()
}

/// "moved 2 cm, needs more than 2 cm": rounding hid the difference.
#[test]
fn numbers_beside_a_limit_are_rounded_away_from_it() {
    let mut checked = 0;
    for path in ["rules", "rules/lib", "rules/extra", "rules/episodes"]
        .iter()
        .flat_map(|folder| list(&root().join("../..").join(folder)))
        .filter(|path| path.extension().is_some_and(|ending| ending == "rls"))
    {
        let text = std::fs::read_to_string(&path).unwrap();
        let of_limits = text.split(" .\n").filter(|rule| {
            let words = ["(limit", "limit: \"", "needs ", "(minimum"];
            rule.contains("?text = ") && words.iter().any(|word| rule.contains(word))
        });
        for rule in of_limits.filter(|rule| {
            rule.contains("STR(ROUND") || rule.contains("STR(CEIL") || rule.contains("STR(FLOOR")
        }) {
            // Sizes in tenths of a centimetre show every difference beyond 5 cm.
            let is_away = rule.contains("?seen, ")
                || rule.contains("STR(CEIL(")
                || rule.contains("STR(FLOOR(");
            assert!(is_away, "{}: {rule}", path.display());
            checked += 1;
        }
    }
    assert!(checked > 15, "{checked}");
}

#[test]
fn every_case_gives_its_expected_findings() {
    assert_expected(
        cases()
            .iter()
            .map(|case| (case.join("expected"), outcome(case))),
    );
}

/// Each shipped property, and each case that has a file `explained`.
#[test]
fn every_explanation_is_as_expected() {
    let mut cases = cases();
    cases.retain(|case| case.join("shipped").is_file() || case.join("explained").is_file());
    assert_expected(cases.iter().map(|case| {
        let book = RuleBook::prepare(&ontology_of(case)).unwrap();
        let facts = facts_of(case);
        let explanation = book
            .explain(&facts.action(0).unwrap(), TESTED, &Budget::default())
            .unwrap();
        let text = explanation.to_text();
        assert!(explanation.to_dot().ends_with("}\n"));
        assert_eq!(
            explanation.to_json()["holds"],
            explanation.findings.unwrap().holds
        );
        (case.join("explained"), text)
    }));
}

/// Statements of one line, parsed as Turtle; a final statement with a literal as subject is parsed
/// separately.
fn statements(text: &str) -> Vec<[Term; 3]> {
    let mut prefixes: String = names::PREFIXES
        .iter()
        .map(|(prefix, iri)| format!("@prefix {prefix}: <{iri}> .\n"))
        .collect();
    prefixes.push_str("@prefix : <https://example.org/> .\n");
    let text = format!("{prefixes}{text} .");
    oxigraph::io::RdfParser::from_format(oxigraph::io::RdfFormat::Turtle)
        .for_slice(&text)
        .map(|quad| {
            let quad = quad.unwrap_or_else(|error| panic!("{error} in {text}"));
            [quad.subject.into(), quad.predicate.into(), quad.object].map(|part| exact(&part))
        })
        .collect()
}

fn owl(triples: &[[Term; 3]]) -> Program {
    let text = std::fs::read_to_string(root().join("../../rules/lib/owl-rl.rls")).unwrap();
    let mut program = Program::load(&Source::new("owl-rl.rls", text), Path::new("")).unwrap();
    program
        .add_facts("triple", triples.iter().map(|triple| triple.as_slice()))
        .unwrap();
    program
}

#[test]
fn every_owl_2_rl_rule_derives_its_conclusions() {
    let text = std::fs::read_to_string(root().join("owl-rl.txt")).unwrap();
    let rules = std::fs::read_to_string(root().join("../../rules/lib/owl-rl.rls")).unwrap();
    let mut tested = 0;
    for line in text
        .lines()
        .filter(|line| !line.starts_with('#') && !line.is_empty())
    {
        let [name, given, wanted] = line.split(" | ").collect::<Vec<_>>()[..] else {
            panic!("{line}")
        };
        let given = statements(given);
        let program = owl(&given);
        assert!(
            rules.contains(&format!("#[name(\"{name}\")]")),
            "{name} is not a rule"
        );
        if wanted == "contradiction" {
            let found = program
                .explain(
                    &format!("contradiction(\"{name}\", _, _)"),
                    &Budget::default(),
                )
                .unwrap();
            assert!(!found.proofs.is_empty(), "{line}");
            assert!(
                owl_closure(&given).unwrap_err().to_string().contains(name),
                "{line}"
            );
            for left_out in 0..given.len() {
                // Statements that make up a list or a double value stay.
                let rest: Vec<_> = given
                    .iter()
                    .enumerate()
                    .filter(|(idx, _)| *idx != left_out)
                    .map(|(_, t)| t.clone())
                    .collect();
                let part_of_list = given[left_out][1].to_string().contains("rdf:");
                assert!(
                    part_of_list || owl_closure(&rest).is_ok(),
                    "{line} without {:?}",
                    given[left_out]
                );
            }
        } else {
            let goal = match wanted
                .split_once(" a ")
                .or(wanted.split_once(" owl:sameAs "))
            {
                // Turtle does not allow a literal as subject.
                Some(("1", object)) => {
                    let property = if wanted.contains(" a ") {
                        "rdf:type"
                    } else {
                        "owl:sameAs"
                    };
                    format!("t(1, {property}, {object})")
                }
                _ => {
                    let wanted = statements(wanted).remove(0);
                    format!("t({}, {}, {})", wanted[0], wanted[1], wanted[2])
                }
            };
            let found = program.explain(&goal, &Budget::default()).unwrap();
            let [proof] = found.proofs.as_slice() else {
                panic!("{line}: {}", found.to_text())
            };
            // Most triples of the closure are first those that the rules for paths and equal things
            // continue.
            let support = match &proof.support {
                Support::Rule { rule, premises } if rule.name.is_none() => {
                    match premises.as_slice() {
                        [Premise::Proof(only)] => &only.support,
                        _ => &proof.support,
                    }
                }
                support => support,
            };
            if let Support::Rule { rule, .. } = support {
                assert!(
                    rule.name.as_deref() == Some(name),
                    "{line}: by {:?}\n{}",
                    rule.name,
                    found.to_text()
                );
            }
        }
        tested += 1;
    }
    // Every named rule has a line.
    let named: std::collections::BTreeSet<&str> = rules
        .match_indices("#[name(\"")
        .map(|(at, mark)| rules[at + mark.len()..].split('"').next().unwrap())
        .collect();
    assert_eq!(tested, named.len());
}

/// Literals are compared by value and checked against their range, also as the ontology's reader
/// returns them.
#[test]
fn owl_compares_literals_by_value() {
    let functional =
        |a: &str, b: &str| format!(":p a owl:FunctionalProperty . :a :p {a} . :a :p {b}");
    let ranged = |range: &str, value: &str| format!(":p rdfs:range {range} . :a :p {value}");
    for (text, consistent) in [
        (functional("\"a\"", "\"a\"^^xsd:token"), true),
        (functional("\"a\"", "\"b\"^^xsd:token"), false),
        (functional("\"ff\"^^xsd:hexBinary", "\"FF\"^^xsd:hexBinary"), true),
        (functional("\"ff\"^^xsd:hexBinary", "\"FE\"^^xsd:hexBinary"), false),
        (functional("1", "1.0"), true),
        (functional("1", "\"1\"^^xsd:unsignedByte"), true),
        (functional("1", "1e0"), false),
        (functional("1e0", "\"1\"^^xsd:float"), false),
        (functional("\"1.0\"^^xsd:float", "\"1\"^^xsd:float"), true),
        (functional("\"a\"@en", "\"a\"@EN"), true),
        (functional("\"a\"@en", "\"a\"@de"), false),
        (functional("\"a\"@en", "\"a\""), false),
        (functional("\"x\"^^:own", "\"y\"^^:own"), true),
        (ranged("xsd:string", "\"a\"@en"), false),
        (ranged("xsd:integer", "\"a\"@en"), false),
        (ranged("rdf:langString", "\"a\"@en"), true),
        (ranged("rdf:langString", "\"a\""), false),
        (ranged("rdfs:Literal", "\"a\"@en"), true),
        (ranged("rdf:PlainLiteral", "\"a\"@en"), true),
        (ranged("rdf:PlainLiteral", "1"), false),
        (ranged("xsd:token", "\"a\""), true),
        (ranged("xsd:token", "\" a\""), false),
        (ranged("xsd:decimal", "1"), true),
        (ranged("xsd:integer", "1.0"), true),
        (ranged("xsd:integer", "1.5"), false),
        (ranged("xsd:byte", "300"), false),
        (ranged("xsd:dateTime", "\"2026-02-30T00:00:00Z\"^^xsd:dateTime"), false),
        (ranged("xsd:dateTime", "\"2026-02-28T00:00:00Z\"^^xsd:dateTimeStamp"), true),
        (ranged("xsd:anyURI", "\"a\""), false),
        (":a :p \"300\"^^xsd:byte".to_owned(), false),
        (":a :p \"yes\"^^xsd:boolean".to_owned(), false),
        (
            ":p owl:propertyDisjointWith :q . :a :p \"0f\"^^xsd:hexBinary . :a :q \"0F\"^^xsd:hexBinary".to_owned(),
            false,
        ),
        (":C owl:hasValue 1.0 . :C owl:onProperty :p . :C owl:disjointWith :D . :a :p 1 . :a a :D".to_owned(), false),
    ] {
        let found = owl_closure(&statements(&text));
        assert_eq!(
            found.is_ok(),
            consistent,
            "{text}: {}",
            found.map_or_else(|faults| faults.to_string(), |_| String::new())
        );
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.ttl");
        let prefixes: String =
            names::PREFIXES.iter().map(|(prefix, iri)| format!("@prefix {prefix}: <{iri}> .\n")).collect();
        std::fs::write(
            &file,
            format!("{prefixes}@prefix : <https://example.org/> .\nact:Wait a act:Action .\n{text} ."),
        )
        .unwrap();
        let read = ontology::load(&Files::Disk, &file).map(|ontology| ontology.triples).unwrap_or_default();
        assert!(!read.is_empty() && owl_closure(&read).is_ok() == consistent, "read from a file: {text}");
    }
}

#[test]
fn an_inconsistent_ontology_is_refused_with_the_proof() {
    let mut ontology = ontology_of(&root().join("moved_object_passes"));
    ontology.triples.extend(statements(
        "w:Body owl:disjointWith w:Robot . w:robot a w:Body",
    ));
    let faults = RuleBook::prepare(&ontology).unwrap_err().to_string();
    assert!(
        faults.contains("R080")
            && faults.contains("cax-dw")
            && faults.contains("t(w:robot, rdf:type, w:Body)"),
        "{faults}"
    );
}

/// The fenced blocks of the README: the words after the fence, and the text.
fn examples() -> Vec<(String, String)> {
    let text = std::fs::read_to_string(root().join("../../rules/README.md")).unwrap();
    let parts: Vec<&str> = text.split("```").collect();
    parts
        .chunks(2)
        .filter_map(|pair| pair.get(1))
        .map(|block| {
            let (words, text) = block.split_once('\n').unwrap();
            (words.to_owned(), text.to_owned())
        })
        .collect()
}

/// Every example of `rules/README.md` works on the scene of a successful pick.
/// Without one of the rules for the other order, a library reads one side.
#[test]
fn shipped_rules_read_both_sides_of_contacts_and_a_lost_one_is_noticed() {
    let load = |name: &str| {
        ontology::load(&Files::Disk, &root().join("../../ontology").join(name)).unwrap()
    };
    let one_sided = |ontology: &Ontology| {
        let book = RuleBook::prepare(ontology).unwrap();
        book.warnings()
            .iter()
            .filter(|found| found.code == "R056")
            .filter_map(|found| found.place())
            .collect::<Vec<_>>()
    };
    for name in ["actions.ttl", "extra.ttl", "time.ttl"] {
        assert_eq!(one_sided(&load(name)), [""; 0], "{name}");
    }
    for lost in [
        "harm(\"inside\", ?b, ",
        "robot_link(?link) :- during(_, w:second, ",
        "    during(?contact, w:second, ?link), during(?contact, w:first, ?thing), ",
        "contact_interval(?i, ?b, ?a, ",
    ] {
        let mut ontology = load("extra.ttl");
        let mut found = 0;
        for library in &mut ontology.libraries {
            let text = &library.source.text;
            let Some(at) = text.find(lost) else { continue };
            // From the line that begins a rule to its end.
            let start = if lost.starts_with(' ') {
                text[..at - 1].rfind('\n').unwrap() + 1
            } else {
                at
            };
            let end = at + text[at..].find(" .\n").unwrap() + 3;
            let text = format!("{}{}", &text[..start], &text[end..]);
            *library = RuleFile::new(Source::new(library.source.name.to_string(), text));
            found += 1;
        }
        assert_eq!(found, 1, "{lost}");
        let places = one_sided(&ontology);
        assert!(places.iter().any(|place| place.contains(".rls")), "{lost}");
    }
}

#[test]
fn every_example_of_the_readme_runs() {
    let facts = facts_of(&root().join("moved_object_passes"));
    let mut counts = std::collections::BTreeMap::new();
    for (words, text) in examples() {
        *counts.entry(words.clone()).or_insert(0) += 1;
        let ending = if words.starts_with("sparql") {
            "rq"
        } else {
            "rls"
        };
        let file =
            |name: &str| RuleFile::new(Source::new(format!("{name}.{ending}"), text.clone()));
        let mut ontology = shipped_ontology();
        match words.as_str() {
            "prolog property" | "sparql property" => {
                ontology.properties = tested(file("example"), Some("m".to_owned()));
                let book = RuleBook::prepare(&ontology)
                    .unwrap_or_else(|faults| panic!("{faults}\n{text}"));
                let findings = judged(&book, &facts.action(0).unwrap()).unwrap();
                assert!(
                    findings.holds && book.warnings().is_empty(),
                    "{}{}\n{text}",
                    shown(&findings),
                    book.warnings()
                );
            }
            "prolog library" => {
                ontology.libraries.push(file("library"));
                assert!(RuleBook::prepare(&ontology).is_ok());
            }
            "prolog program" => {
                let program =
                    Program::load(&Source::new("example", text.clone()), Path::new("")).unwrap();
                let closure = program
                    .close(
                        actcheck::rules::standalone::Engine::Fast,
                        &Budget::default(),
                    )
                    .unwrap();
                assert_eq!(
                    closure.tuples("whole"),
                    [[Term::iri("https://example.org/set")]]
                );
                assert_eq!(closure.tuples("told"), [[Term::string("set has 3 parts")]]);
                assert!(program.warnings.is_empty(), "{}", program.warnings);
            }
            "prolog program with new things" => {
                let program =
                    Program::load(&Source::new("example", text.clone()), Path::new("")).unwrap();
                let closure = program
                    .close(
                        actcheck::rules::standalone::Engine::Fast,
                        &Budget::default(),
                    )
                    .unwrap();
                let shown = |tuple: Vec<Term>| {
                    tuple
                        .iter()
                        .map(Term::to_string)
                        .collect::<Vec<_>>()
                        .join(", ")
                };
                let parts: Vec<String> = closure.tuples("part").into_iter().map(shown).collect();
                assert_eq!(
                    parts,
                    [
                        "_:0, \"cup\"",
                        "_:0, \"plate\"",
                        "_:1, \"plate\"",
                        "_:1, \"spoon\""
                    ]
                );
                assert_eq!(closure.tuples("contacts"), [[Term::Integer(2)]]);
                assert!(program.warnings.is_empty(), "{}", program.warnings);
            }
            "turtle" => assert_eq!(
                statements(
                    text.replace("<..", "<file:")
                        .trim_end()
                        .trim_end_matches('.')
                )
                .len(),
                6
            ),
            "text" => {}
            other => panic!("what is {other}?"),
        }
    }
    assert_eq!(counts["prolog property"], 3);
}

/// Large, deep and invalid texts are refused or read, quickly and without a panic.
#[test]
fn hostile_texts_are_handled_in_bounded_time() {
    let long_chain = format!("p(1) . q(?x) :- p(?y), ?x = {}1 .", "?y + ".repeat(20_000));
    let many_rules: String = (0..1000)
        .map(|n| format!("p{}(?x) :- p{n}(?x) .\n", n + 1))
        .collect::<String>()
        + "p0(1) .";
    let texts = [
        long_chain,
        many_rules,
        format!("p({}1{}) .", "(".repeat(100_000), ")".repeat(100_000)),
        format!("p({}1) .", "-".repeat(100_000)),
        format!("p({}) .", "f\"{".repeat(1000)),
        format!("p({}) .", "SQRT(".repeat(10_000)),
        "p(".repeat(100_000),
        "\u{feff}p(1) .".to_owned(),
        "p(\"\\u12".to_owned(),
        "/* ".repeat(1000),
        format!("p({}) .", "1, ".repeat(10_000)),
        format!("q(?x) :- {} .", "p(?x), ".repeat(5000)),
        "p(1) . ".repeat(200_000),
        "@".repeat(10_000),
    ];
    for text in texts {
        let started = std::time::Instant::now();
        let start: String = text.chars().take(40).collect();
        if let Ok(program) = Program::load(&Source::new("hostile.rls", text), Path::new("")) {
            let _ = program.close(
                actcheck::rules::standalone::Engine::Fast,
                &Budget::default(),
            );
        }
        assert!(
            started.elapsed().as_secs() < 20,
            "{start} took {:?}",
            started.elapsed()
        );
    }
}
