//! `docs/terms.md` is generated from the comments and labels of the ontology. Run with
//! `UPDATE_EXPECT=1` to write the page.

use std::fmt::Write as _;

use oxigraph::io::{RdfFormat, RdfParser};
use oxigraph::model::{NamedOrBlankNode, Term};

use crate::support::expected::assert_expected;
use crate::support::root;

const INTRODUCTION: &str = "\
# Terms of the ontology

Generated from the files of `ontology/` by `UPDATE_EXPECT=1 cargo test --release --locked --test all up_to_date`.

The prefixes of all rules and queries are `act: <http://actions#>` and `w: <https://w3id.org/actcheck/world#>`; `actcheck query`
also knows `obj:`, `run:`, `campaign:`, `earl:`, `prov:` and those of RDF, OWL and XML Schema. Quantities are in SI units and radians, z is
up, and poses are in the world frame. A unit of 1 means dimensionless. [Histories](history.md) shows how the terms are connected.
";

/// Prefixes of the page.
const PREFIXES: [(&str, &str); 6] = [
    ("act:", "http://actions#"),
    ("w:", "https://w3id.org/actcheck/world#"),
    ("prov:", "http://www.w3.org/ns/prov#"),
    ("owl:", "http://www.w3.org/2002/07/owl#"),
    ("rdfs:", "http://www.w3.org/2000/01/rdf-schema#"),
    ("xsd:", "http://www.w3.org/2001/XMLSchema#"),
];

fn short(iri: &str) -> String {
    let prefix = PREFIXES
        .iter()
        .find_map(|(prefix, long)| Some(format!("{prefix}{}", iri.strip_prefix(long)?)));
    prefix.unwrap_or_else(|| {
        iri.rsplit_once("/ontology/")
            .map_or(iri, |(_, file)| file)
            .to_owned()
    })
}

/// The statements of a file, in its order, with short names.
struct Statements(Vec<[String; 3]>);

impl Statements {
    fn read(name: &str) -> Self {
        let text = std::fs::read(root().join("ontology").join(name)).unwrap();
        let parser = RdfParser::from_format(RdfFormat::Turtle)
            .with_base_iri("https://x/ontology/")
            .unwrap();
        let quads = parser.for_reader(text.as_slice()).map(|quad| quad.unwrap());
        let statements = quads.filter_map(|quad| {
            let NamedOrBlankNode::NamedNode(subject) = &quad.subject else {
                return None;
            };
            let object = match &quad.object {
                Term::NamedNode(node) => short(node.as_str()),
                Term::Literal(literal) => literal.value().to_owned(),
                _ => return None,
            };
            Some([
                short(subject.as_str()),
                short(quad.predicate.as_str()),
                object,
            ])
        });
        Self(statements.collect())
    }

    fn all(&self, subject: &str, predicate: &str) -> Vec<&str> {
        let found = self
            .0
            .iter()
            .filter(|[s, p, _]| s == subject && p == predicate);
        found.map(|[_, _, object]| object.as_str()).collect()
    }

    fn one(&self, subject: &str, predicate: &str) -> &str {
        self.all(subject, predicate).first().copied().unwrap_or("")
    }

    /// Individuals of a class, in the order of the file.
    fn of_class(&self, class: &str) -> Vec<&str> {
        let is_a = "http://www.w3.org/1999/02/22-rdf-syntax-ns#type";
        let found = self.0.iter().filter(|[_, p, o]| p == is_a && o == class);
        found.map(|[subject, _, _]| subject.as_str()).collect()
    }
}

fn code(names: &[&str]) -> String {
    if names.is_empty() {
        return "–".to_owned();
    }
    names
        .iter()
        .map(|name| format!("`{name}`"))
        .collect::<Vec<_>>()
        .join(", ")
}

fn cell(text: &str) -> &str {
    if text.is_empty() { "–" } else { text }
}

fn actions(page: &mut String, ontology: &Statements) {
    page.push_str(
        "\n## Actions\n\n| action | parameters | success properties | meaning |\n| --- | --- | --- | --- |\n",
    );
    for action in ontology.of_class("act:Action") {
        let [parameters, properties] = ["act:hasParameter", "act:successProperty"]
            .map(|predicate| code(&ontology.all(action, predicate)));
        let meaning = ontology.one(action, "rdfs:comment");
        let _ = writeln!(
            page,
            "| `{action}` | {parameters} | {properties} | {} |",
            cell(meaning)
        );
    }
}

fn properties(page: &mut String, title: &str, ontology: &Statements) {
    let _ = write!(
        page,
        "\n## {title}\n\n| property | rule | unit of the margin | meaning |\n| --- | --- | --- | --- |\n"
    );
    for property in ontology.of_class("act:Property") {
        let rule = ontology.one(property, "act:verifiedBy");
        let rule = rule.rsplit_once("/rules/").map_or(rule, |(_, file)| file);
        let (unit, meaning) = (
            ontology.one(property, "act:unit"),
            ontology.one(property, "rdfs:comment"),
        );
        let _ = writeln!(
            page,
            "| `{property}` | [{rule}](../rules/{rule}) | {} | {meaning} |",
            cell(unit)
        );
    }
}

fn classes(page: &mut String, ontology: &Statements) {
    page.push_str("| class | subclass of | meaning |\n| --- | --- | --- |\n");
    for class in ontology.of_class("owl:Class") {
        let above = code(&ontology.all(class, "rdfs:subClassOf"));
        let _ = writeln!(
            page,
            "| `{class}` | {above} | {} |",
            cell(ontology.one(class, "rdfs:comment"))
        );
    }
}

/// Individuals, and properties by their domain.
fn vocabulary(page: &mut String, ontology: &Statements) {
    classes(page, ontology);
    let mut domains: Vec<(&str, Vec<&str>)> = Vec::new();
    let kinds = ["owl:DatatypeProperty", "owl:ObjectProperty"].map(|kind| ontology.of_class(kind));
    let mut seen = Vec::new();
    for [subject, _, _] in &ontology.0 {
        let subject = subject.as_str();
        if seen.contains(&subject) || !kinds.iter().any(|kind| kind.contains(&subject)) {
            continue;
        }
        seen.push(subject);
        let domain = ontology.one(subject, "rdfs:domain");
        match domains.iter_mut().find(|(name, _)| *name == domain) {
            Some((_, terms)) => terms.push(subject),
            None => domains.push((domain, vec![subject])),
        }
    }
    for (domain, terms) in domains {
        let title = if domain.is_empty() {
            "several classes".to_owned()
        } else {
            format!("`{domain}`")
        };
        let _ = write!(
            page,
            "\n### Properties of {title}\n\n| property | value | meaning |\n| --- | --- | --- |\n"
        );
        for term in terms {
            let value = match (
                ontology.one(term, "w:unit"),
                ontology.one(term, "rdfs:range"),
            ) {
                ("", "") => "–".to_owned(),
                ("", "xsd:string") => "text".to_owned(),
                ("", range) if range.starts_with("xsd:") => range["xsd:".len()..].to_owned(),
                ("", range) => format!("`{range}`"),
                (unit, _) => unit.to_owned(),
            };
            let _ = writeln!(
                page,
                "| `{term}` | {value} | {} |",
                cell(ontology.one(term, "rdfs:comment"))
            );
        }
    }
}

#[test]
fn the_page_of_terms_is_up_to_date() {
    let [robot, extra, objects, world, history] = [
        "actions.ttl",
        "extra.ttl",
        "objects.ttl",
        "world.ttl",
        "history.ttl",
    ]
    .map(Statements::read);
    let mut page = INTRODUCTION.to_owned();
    actions(&mut page, &robot);
    properties(&mut page, "Success properties", &robot);
    properties(
        &mut page,
        "Further properties, of `ontology/extra.ttl`",
        &extra,
    );
    page.push_str("\n## Designators\n\n| designator | meaning |\n| --- | --- |\n");
    for designator in robot.of_class("act:PropertyParameter") {
        let _ = writeln!(
            page,
            "| `{designator}` | {} |",
            cell(robot.one(designator, "rdfs:comment"))
        );
    }
    page.push_str("\n## Structure of an ontology\n\n");
    vocabulary(&mut page, &robot);
    page.push_str("\n## Categories of objects\n\n");
    classes(&mut page, &objects);
    page.push_str("\n## Facts about the world\n\n");
    vocabulary(&mut page, &world);
    page.push_str("\n### Individuals\n\n| name | class | meaning |\n| --- | --- | --- |\n");
    for class in world.of_class("owl:Class") {
        for name in world.of_class(class) {
            let _ = writeln!(
                page,
                "| `{name}` | `{class}` | {} |",
                world.one(name, "rdfs:comment")
            );
        }
    }
    page.push_str("\n## Histories: campaigns, runs and outcomes\n\n");
    vocabulary(&mut page, &history);
    assert_expected([(root().join("docs/terms.md"), page)]);
}
