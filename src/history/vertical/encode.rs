//! Encodes the statements of many outlines property by property, so that a query reads only the
//! properties that it uses.
//!
//! The size and the checksum of the directory come first (four bytes each, the lowest first), then
//! the directory, then its parts: the nodes, and one column for each property. Each part is
//! compressed on its own.

use std::collections::HashMap;

use oxigraph::model::{GraphName, NamedOrBlankNode, Quad, Term, TermRef};
use serde::{Deserialize, Serialize};

use crate::journal;
use crate::statements::iri;
use crate::vertical::column::{Column, Value};
use crate::vertical::nodes::{Name, Nodes, Numbers, Profile};
use crate::write_run::unique;

/// Compression level: higher ones take many times as long and save some percent.
const LEVEL: i32 = 6;
/// Share of distinct values above which equal doubles are not looked for.
const FEW: usize = 2;

/// The parts after the directory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Directory {
    pub nodes: PartSize,
    /// Properties with their columns.
    pub columns: Vec<(String, PartSize)>,
}

/// A part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct PartSize {
    /// Unit: bytes.
    pub size: u32,
    pub sum: u32,
    /// Number of statements.
    pub statements: u32,
}

/// Encodes the statements about each run.
///
/// # Errors
/// A message, if they are not those of runs of one campaign, or if a part can't be encoded.
pub(crate) fn encode(runs: &[&[Quad]]) -> Result<Vec<u8>, String> {
    let read = Read::of(runs).ok_or("its statements are not those of runs of one campaign")?;
    let (mut body, mut columns) = (Vec::new(), Vec::new());
    let mut add = |part: &[u8], statements: usize| {
        let part = zstd::bulk::compress(part, LEVEL).map_err(|error| error.to_string())?;
        let size = u32::try_from(part.len()).map_err(|_| "it is larger than 4 GB".to_owned())?;
        body.extend_from_slice(&part);
        Ok::<_, String>(PartSize {
            size,
            sum: journal::sum_of(&part),
            statements: statements as u32,
        })
    };
    let nodes = add(
        &postcard::to_stdvec(&read.nodes).map_err(|error| error.to_string())?,
        0,
    )?;
    for (property, objects) in read.properties.all.iter().zip(&read.objects) {
        let subjects: Vec<u32> = objects.iter().map(|(subject, _)| *subject).collect();
        let part = column(objects).encode(&subjects)?;
        columns.push((property.clone(), add(&part, objects.len())?));
    }
    let directory =
        postcard::to_stdvec(&Directory { nodes, columns }).map_err(|error| error.to_string())?;
    let directory = zstd::bulk::compress(&directory, LEVEL).map_err(|error| error.to_string())?;
    let mut bytes = (directory.len() as u32).to_le_bytes().to_vec();
    bytes.extend(journal::sum_of(&directory).to_le_bytes());
    bytes.extend(directory);
    bytes.extend(body);
    Ok(bytes)
}

/// The object of a statement.
enum Object<'q> {
    /// A node of the same run, by its number in the file.
    Node(u32, &'q Term),
    Term(&'q Term),
}

/// The statements of all runs by property.
#[derive(Default)]
struct Read<'q> {
    nodes: Nodes,
    properties: Numbers<String>,
    /// Subject and object of each property's statements.
    objects: Vec<Vec<(u32, Object<'q>)>>,
}

impl<'q> Read<'q> {
    fn of(runs: &[&'q [Quad]]) -> Option<Self> {
        let mut read = Self::default();
        let (mut shapes, mut names) = (Numbers::<Vec<u32>>::default(), Numbers::<Name>::default());
        let mut profiles = Numbers::<Profile>::default();
        let mut first = 0u32;
        for quads in runs {
            let (base, number) = numbered(quads.first()?)?;
            if read.nodes.numbers.is_empty() {
                base.clone_into(&mut read.nodes.base);
            } else if base != read.nodes.base {
                return None;
            }
            read.nodes.numbers.push(number);
            let mut known = Numbers::<&NamedOrBlankNode>::default();
            for quad in *quads {
                known.of(&quad.subject);
            }
            let of_run: HashMap<TermRef<'_>, u32> = known
                .all
                .iter()
                .map(|node| TermRef::from(node.as_ref()))
                .zip(0..)
                .collect();
            let NamedOrBlankNode::NamedNode(run) = &quads.first()?.subject else {
                return None;
            };
            let run = run.as_str();
            let derived = derived(quads);
            let name = |node: &NamedOrBlankNode| name(node, run, &derived);
            let mut profile = Profile {
                names: known.all.iter().map(|node| names.of(name(node))).collect(),
                segments: Vec::new(),
            };
            for about in quads.chunk_by(|one, other| one.subject == other.subject) {
                let subject = known.of(&about[0].subject);
                let mut shape = Vec::with_capacity(about.len());
                for quad in about {
                    if quad.graph_name != GraphName::DefaultGraph {
                        return None;
                    }
                    let property = read.properties.of(quad.predicate.as_str().to_owned());
                    shape.push(property);
                    if read.objects.len() <= property as usize {
                        read.objects.push(Vec::new());
                    }
                    let object = match of_run.get(&quad.object.as_ref()) {
                        Some(node) => Object::Node(first + node, &quad.object),
                        None => Object::Term(&quad.object),
                    };
                    read.objects[property as usize].push((first + subject, object));
                }
                profile.segments.push((subject, shapes.of(shape)));
            }
            first = first.checked_add(profile.names.len() as u32)?;
            read.nodes.profile_of.push(profiles.of(profile));
        }
        (read.nodes.shapes, read.nodes.names, read.nodes.profiles) =
            (shapes.all, names.all, profiles.all);
        Some(read)
    }
}

/// The IRI of a run without its number, and the number.
fn numbered(quad: &Quad) -> Option<(&str, u64)> {
    let NamedOrBlankNode::NamedNode(run) = &quad.subject else {
        return None;
    };
    let (_, digits) = run.as_str().rsplit_once('-')?;
    let number: u64 = digits.parse().ok()?;
    let base = run.as_str().strip_suffix(digits)?;
    (number.to_string() == digits).then_some((base, number))
}

/// The blank nodes whose labels follow from other statements.
fn derived(quads: &[Quad]) -> HashMap<&NamedOrBlankNode, Name> {
    let [subject, test, result] = ["earl:subject", "earl:test", "earl:result"].map(iri);
    let mut assertions: HashMap<&NamedOrBlankNode, [Option<&Term>; 3]> = HashMap::new();
    for quad in quads {
        if let Some(at) = [&subject, &test, &result]
            .iter()
            .position(|known| **known == quad.predicate)
        {
            assertions.entry(&quad.subject).or_default()[at] = Some(&quad.object);
        }
    }
    let mut derived = HashMap::new();
    for (node, parts) in assertions {
        let [
            Some(Term::NamedNode(subject)),
            Some(Term::NamedNode(test)),
            result,
        ] = parts
        else {
            continue;
        };
        let is = |node: &NamedOrBlankNode, part: &str| {
            *node == NamedOrBlankNode::from(unique(&[subject.as_str(), test.as_str(), part]))
        };
        if is(node, "assertion") {
            derived.insert(node, Name::Assertion);
        }
        let result = quads.iter().map(|quad| &quad.subject).find(|node| {
            matches!((node, result), (NamedOrBlankNode::BlankNode(node), Some(Term::BlankNode(result))) if node == result)
        });
        if let Some(result) = result.filter(|result| is(result, "result")) {
            derived.insert(result, Name::Outcome);
        }
    }
    derived
}

fn name(node: &NamedOrBlankNode, run: &str, derived: &HashMap<&NamedOrBlankNode, Name>) -> Name {
    match node {
        NamedOrBlankNode::NamedNode(node) => match node.as_str().strip_prefix(run) {
            Some(rest) if rest.is_empty() || rest.starts_with('/') => Name::Below(rest.to_owned()),
            _ => Name::Iri(node.as_str().to_owned()),
        },
        NamedOrBlankNode::BlankNode(blank) => derived
            .get(node)
            .cloned()
            .unwrap_or_else(|| Name::Blank(blank.as_str().to_owned())),
    }
}

fn column(objects: &[(u32, Object<'_>)]) -> Column {
    let nodes = objects.iter().map(|(_, object)| {
        if let Object::Node(node, _) = object {
            Some(*node)
        } else {
            None
        }
    });
    if let Some(nodes) = nodes.collect() {
        return Column::Nodes(nodes);
    }
    let value = |(_, object): &(u32, Object<'_>)| match object {
        Object::Node(_, term) | Object::Term(term) => Value::of(term),
    };
    let mut numbers = Numbers::<Value>::default();
    let codes: Vec<u32> = objects
        .iter()
        .map(|object| numbers.of(value(object)))
        .collect();
    let is_double = numbers
        .all
        .iter()
        .all(|value| matches!(value, Value::Double(_)));
    if is_double && numbers.all.len() > objects.len() / FEW {
        // A code takes more than the bytes that it saves.
        let values = objects.iter().map(value).collect();
        return Column::Values {
            values,
            codes: (0..objects.len() as u32).collect(),
        };
    }
    Column::Values {
        values: numbers.all,
        codes,
    }
}
