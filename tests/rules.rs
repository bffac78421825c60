//! Rule files over facts: every folder of `tests/rules/` is a case.
//!
//! A case holds `rules.rls` or `rules.rq` (or `shipped`, the name of a file in `rules/`), perhaps libraries of its own
//! (`lib*.rls`; otherwise the shipped ones serve), `facts.trig` with the graphs `act:before`, `act:after`, `act:during` and
//! `act:parameters` (statements `act:pickObject act:value obj:…`), and `expected`: the findings, or the diagnostics.
//! `UPDATE_EXPECT=1` rewrites `expected`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use actcheck::base::{Files, Source, Term, digest_of, names};
use actcheck::facts::{ActionFacts, RunFacts};
use actcheck::ontology::{self, Ontology, Property, RuleFile, RuleLanguage};
use actcheck::rules::{Budget, Findings, RuleBook, RuleFault};

const TESTED: &str = "http://actions#Tested";

fn root() -> PathBuf {
    // The package may stand elsewhere than the tests; the working directory of tests is the package's.
    ["tests/rules", "../../main/tests/rules"].map(PathBuf::from).into_iter().find(|path| path.is_dir()).unwrap()
}

fn rule_file(path: &Path) -> RuleFile {
    let text = std::fs::read_to_string(path).unwrap();
    let name = path.file_name().unwrap().to_string_lossy().into_owned();
    let language = if name.ends_with(".rq") { RuleLanguage::Sparql } else { RuleLanguage::Datalog };
    RuleFile { digest: digest_of(&text), source: Source::new(name.clone(), text), language, path: name, linked_at: None }
}

/// The shipped ontology with one property, the case's, in place of its own.
fn ontology_of(case: &Path) -> Ontology {
    let repository = root().join("../..");
    let mut ontology = ontology::load(&Files::Disk, &repository.join("ontology/actions.ttl")).unwrap();
    let shipped = repository.join("rules");
    let mut libraries: Vec<PathBuf> = list(case).into_iter().filter(|path| is_library(path)).collect();
    if libraries.is_empty() {
        libraries = list(&shipped.join("lib")).into_iter().filter(|path| path.extension().is_some_and(|e| e == "rls")).collect();
        libraries.retain(|path| !path.ends_with("owl-rl.rls"));
    }
    ontology.libraries = libraries.iter().map(|path| rule_file(path)).collect();
    let rule = match std::fs::read_to_string(case.join("shipped")) {
        Ok(name) => rule_file(&shipped.join(name.trim())),
        Err(_) => rule_file(&["rules.rls", "rules.rq"].map(|name| case.join(name)).into_iter().find(|p| p.is_file()).unwrap()),
    };
    let property = Property {
        iri: TESTED.into(),
        name: "Tested".into(),
        label: "the tested property".into(),
        comment: None,
        rule,
        needs: Default::default(),
        unit: Some("m".into()),
    };
    ontology.properties = [(TESTED.to_owned(), property)].into();
    ontology
}

fn is_library(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.starts_with("lib") && name.ends_with(".rls")
}

fn list(folder: &Path) -> Vec<PathBuf> {
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
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

/// Facts of a case; none where it has no such file.
fn facts_of(case: &Path) -> RunFacts {
    let mut facts = RunFacts { snapshots: vec![vec![], vec![]], during: vec![vec![]], parameters: vec![vec![]], ..Default::default() };
    let prefixes: String = names::PREFIXES.iter().map(|(prefix, iri)| format!("@prefix {prefix}: <{iri}> .\n")).collect();
    let text = prefixes + &std::fs::read_to_string(case.join("facts.trig")).unwrap_or_default();
    for quad in oxigraph::io::RdfParser::from_format(oxigraph::io::RdfFormat::TriG).for_slice(&text) {
        let quad = quad.unwrap();
        let parts = [quad.subject.into(), quad.predicate.into(), quad.object].map(|t| facts.terms.intern(term(&t)));
        match quad.graph_name.to_string().trim_matches(['<', '>']).strip_prefix(names::ACT) {
            Some("before") => facts.snapshots[0].push(parts),
            Some("after") => facts.snapshots[1].push(parts),
            Some("during") => facts.during[0].push(parts),
            Some("parameters") => facts.parameters[0].push([parts[0], parts[2]]),
            other => panic!("unknown graph {other:?}"),
        }
    }
    facts.snapshots.iter_mut().chain(&mut facts.during).for_each(|triples| triples.sort_unstable());
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
        let values: Vec<String> = row.values.iter().map(|(name, term)| format!("{name}={term}")).collect();
        writeln!(out, "{}({})", row.predicate, values.join(", ")).unwrap();
    }
    if findings.witness_count > findings.witness.len() {
        writeln!(out, "of {}", findings.witness_count).unwrap();
    }
    out
}

fn judged(book: &RuleBook, facts: &ActionFacts<'_>) -> Result<Findings, RuleFault> {
    let budget = Budget { tuples: 100_000, secs: 5.0 };
    book.judge(facts, &[TESTED.to_owned()], &budget).remove(TESTED).unwrap()
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

/// Compares with a file of the case, or rewrites it.
fn differs(file: &Path, got: &str) -> Option<String> {
    if std::env::var_os("UPDATE_EXPECT").is_some() {
        std::fs::write(file, got).unwrap();
    }
    let expected = std::fs::read_to_string(file).unwrap_or_default();
    (got != expected).then(|| format!("== {}\n-- expected\n{expected}-- got\n{got}", file.display()))
}

fn cases() -> Vec<PathBuf> {
    list(&root()).into_iter().filter(|path| path.is_dir()).collect()
}

#[test]
fn every_case_has_its_findings() {
    let wrong: Vec<String> = cases().iter().filter_map(|case| differs(&case.join("expected"), &outcome(case))).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Each shipped property, and each case that has a file `explained`.
#[test]
fn every_explanation_is_as_expected() {
    let mut wrong = Vec::new();
    for case in cases().iter().filter(|case| case.join("shipped").is_file() || case.join("explained").is_file()) {
        let book = RuleBook::prepare(&ontology_of(case)).unwrap();
        let facts = facts_of(case);
        let explanation = book.explain(&facts.action(0).unwrap(), TESTED, &Budget::default()).unwrap();
        wrong.extend(differs(&case.join("explained"), &explanation.to_text()));
        assert!(explanation.to_dot().ends_with("}\n"));
        assert_eq!(explanation.to_json()["holds"], explanation.findings.unwrap().holds);
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
