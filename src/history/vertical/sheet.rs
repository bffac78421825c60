//! Reads the statements of a file of outlines by property.

use std::cell::RefCell;
use std::collections::HashMap;

use oxigraph::model::{BlankNode, GraphName, NamedNode, NamedOrBlankNode, Quad, Term};
use zstd::stream::read::Decoder;
use zstd::zstd_safe::DCtx;

use crate::inflate::read_expanded;
use crate::journal;
use crate::statements::iri;
use crate::vertical::column::Column;
use crate::vertical::encode::{Directory, PartSize};
use crate::vertical::nodes::{Name, Nodes};
use crate::write_run::unique;

/// The reason why a part can't be used.
pub(crate) const CHANGED: &str = "it has changed since it was written";

/// Where the parts are read from: from a file, or from its bytes.
pub(crate) trait Source {
    /// The bytes from a place to another, counted from the beginning of the statements.
    ///
    /// # Errors
    /// A message, if they can't be read.
    fn bytes(&self, from: usize, to: usize) -> Result<Vec<u8>, String>;
}

impl Source for &[u8] {
    fn bytes(&self, from: usize, to: usize) -> Result<Vec<u8>, String> {
        self.get(from..to)
            .map(<[u8]>::to_vec)
            .ok_or_else(|| "it ends too early".to_owned())
    }
}

impl Source for Box<dyn Source> {
    fn bytes(&self, from: usize, to: usize) -> Result<Vec<u8>, String> {
        self.as_ref().bytes(from, to)
    }
}

impl Source for Vec<u8> {
    fn bytes(&self, from: usize, to: usize) -> Result<Vec<u8>, String> {
        self.as_slice().bytes(from, to)
    }
}

/// The statements of a file, of which no column has been read yet.
pub(crate) struct Sheet<S> {
    source: S,
    directory: Directory,
    /// Where the parts begin. Unit: bytes.
    start: usize,
}

/// A column with the subject of each value.
#[derive(Debug)]
pub(crate) struct Pairs {
    pub subjects: Vec<u32>,
    pub column: Column,
}

/// Size of the size and the checksum of the directory. Unit: bytes.
const HEADER: usize = 8;
/// Bytes that are read at first: nearly all directories are shorter.
const FIRST: usize = 4096;

impl<S: Source> Sheet<S> {
    /// Reads the directory. `length`: size of the statements.
    ///
    /// # Errors
    /// A message that names the damage.
    pub(crate) fn open(source: S, length: usize) -> Result<Self, String> {
        let mut bytes = source.bytes(0, FIRST.min(length))?;
        let number = |at: usize| {
            bytes
                .get(at..at + 4)
                .and_then(|four| four.try_into().ok())
                .map(u32::from_le_bytes)
        };
        let (size, sum) = number(0).zip(number(4)).ok_or(CHANGED)?;
        let start = HEADER + size as usize;
        if start > length {
            return Err(CHANGED.to_owned());
        }
        if start > bytes.len() {
            bytes = source.bytes(0, start)?;
        }
        let directory = bytes.get(HEADER..start).ok_or(CHANGED)?;
        if journal::sum_of(directory) != sum {
            return Err(CHANGED.to_owned());
        }
        let directory: Directory =
            postcard::from_bytes(&unpacked(directory)?).map_err(|_| CHANGED)?;
        Ok(Self {
            source,
            directory,
            start,
        })
    }

    /// Number of its statements with each property.
    pub(crate) fn properties(&self) -> impl Iterator<Item = (&str, u64)> {
        self.directory
            .columns
            .iter()
            .map(|(property, part)| (property.as_str(), u64::from(part.statements)))
    }

    /// Reads its runs and nodes.
    ///
    /// # Errors
    /// A message that names the damage.
    pub(super) fn nodes(&self) -> Result<(Nodes, u32), String> {
        let bytes = self.part(self.start, self.directory.nodes)?;
        let nodes: Nodes = postcard::from_bytes(&bytes).map_err(|_| CHANGED)?;
        let count = nodes.count(self.directory.columns.len()).ok_or(CHANGED)?;
        Ok((nodes, count))
    }

    /// Reads the columns of some properties; `None` for a property that it does not have.
    ///
    /// # Errors
    /// A message that names the damage.
    pub(super) fn columns(
        &self,
        nodes: &Nodes,
        count: u32,
        wanted: &[&str],
    ) -> Result<Vec<Option<Pairs>>, String> {
        let place: Vec<Option<usize>> = self
            .directory
            .columns
            .iter()
            .map(|(property, _)| wanted.iter().position(|wanted| wanted == property))
            .collect();
        let mut subjects = nodes.subjects(&place, wanted.len());
        let mut found: Vec<Option<Pairs>> = wanted.iter().map(|_| None).collect();
        let mut from = self.start + self.directory.nodes.size as usize;
        for ((_, part), place) in self.directory.columns.iter().zip(&place) {
            if let Some(place) = place {
                let bytes = self.part(from, *part)?;
                let subjects = std::mem::take(&mut subjects[*place]);
                let column = Column::decode(&bytes, &subjects, count).ok_or(CHANGED)?;
                found[*place] = Some(Pairs { subjects, column });
            }
            from += part.size as usize;
        }
        Ok(found)
    }

    fn part(&self, from: usize, part: PartSize) -> Result<Vec<u8>, String> {
        let bytes = self.source.bytes(from, from + part.size as usize)?;
        if journal::sum_of(&bytes) != part.sum {
            return Err(CHANGED.to_owned());
        }
        unpacked(&bytes)
    }

    /// The statements about each run that have one of the properties, or all (`None`), in their
    /// order.
    ///
    /// # Errors
    /// A message that names the damage.
    pub(crate) fn statements(&self, wanted: Option<&[&str]>) -> Result<Vec<Vec<Quad>>, String> {
        let (nodes, count) = self.nodes()?;
        let all: Vec<&str> = self
            .directory
            .columns
            .iter()
            .map(|(property, _)| property.as_str())
            .collect();
        let labels = ["earl:subject", "earl:test", "earl:result"].map(iri);
        let read: Vec<&str> = match wanted {
            None => all.clone(),
            Some(wanted) => {
                let is_read = |property: &&str| {
                    wanted.contains(property)
                        || labels.iter().any(|label| label.as_str() == *property)
                };
                all.iter().copied().filter(is_read).collect()
            }
        };
        let columns = self.columns(&nodes, count, &read)?;
        let terms = Labels::read(&nodes, &read, &columns, &labels)
            .terms(&nodes, count)
            .ok_or(CHANGED)?;
        let place: Vec<Option<usize>> = all
            .iter()
            .map(|property| read.iter().position(|read| read == property))
            .collect();
        let mut next = vec![0usize; read.len()];
        let (mut runs, mut first) = (Vec::with_capacity(nodes.numbers.len()), 0u32);
        for profile in nodes
            .profile_of
            .iter()
            .filter_map(|profile| nodes.profiles.get(*profile as usize))
        {
            let mut quads = Vec::new();
            for (node, shape) in &profile.segments {
                for property in nodes.shapes.get(*shape as usize).into_iter().flatten() {
                    let Some(place) = place[*property as usize] else {
                        continue;
                    };
                    let row = next[place];
                    next[place] += 1;
                    let property = read[place];
                    if wanted.is_some_and(|wanted| !wanted.contains(&property)) {
                        continue;
                    }
                    let object = match columns[place].as_ref().map(|pairs| &pairs.column) {
                        Some(Column::Nodes(nodes)) => terms[nodes[row] as usize].clone().into(),
                        Some(Column::Values { values, codes }) => {
                            values[codes[row] as usize].term()
                        }
                        None => continue,
                    };
                    let subject = terms[(first + node) as usize].clone();
                    quads.push(Quad::new(
                        subject,
                        NamedNode::new_unchecked(property),
                        object,
                        GraphName::DefaultGraph,
                    ));
                }
            }
            first += profile.names.len() as u32;
            runs.push(quads);
        }
        Ok(runs)
    }
}

/// The statements from which labels of blank nodes follow.
struct Labels {
    /// The execution and the property of each assertion.
    subject_of: HashMap<u32, u32>,
    test_of: HashMap<u32, String>,
    /// The assertion of each result.
    assertion_of: HashMap<u32, u32>,
}

impl Labels {
    fn read(
        nodes: &Nodes,
        read: &[&str],
        columns: &[Option<Pairs>],
        labels: &[NamedNode; 3],
    ) -> Self {
        let mut found = Self {
            subject_of: HashMap::new(),
            test_of: HashMap::new(),
            assertion_of: HashMap::new(),
        };
        if !nodes
            .names
            .iter()
            .any(|name| matches!(name, Name::Assertion | Name::Outcome))
        {
            return found;
        }
        for (property, pairs) in read.iter().zip(columns) {
            let (Some(at), Some(pairs)) = (
                labels.iter().position(|label| label.as_str() == *property),
                pairs,
            ) else {
                continue;
            };
            match (&pairs.column, at) {
                (Column::Nodes(objects), 0) => {
                    found.subject_of = pairs
                        .subjects
                        .iter()
                        .copied()
                        .zip(objects.iter().copied())
                        .collect();
                }
                (Column::Nodes(objects), 2) => {
                    found.assertion_of = objects
                        .iter()
                        .copied()
                        .zip(pairs.subjects.iter().copied())
                        .collect();
                }
                (Column::Values { values, codes }, 1) => {
                    let text = |code: &u32| match values[*code as usize].term() {
                        Term::NamedNode(node) => node.into_string(),
                        _ => String::new(),
                    };
                    found.test_of = pairs
                        .subjects
                        .iter()
                        .copied()
                        .zip(codes.iter().map(text))
                        .collect();
                }
                _ => {}
            }
        }
        found
    }

    /// The terms of all nodes. Returns `None` if a label can't be made.
    fn terms(&self, nodes: &Nodes, count: u32) -> Option<Vec<NamedOrBlankNode>> {
        let mut terms: Vec<Option<NamedOrBlankNode>> = vec![None; count as usize];
        let mut first = 0;
        let mut derived = Vec::new();
        for (number, profile) in nodes.numbers.iter().zip(&nodes.profile_of) {
            let profile = nodes.profiles.get(*profile as usize)?;
            for (node, name) in (first..).zip(&profile.names) {
                let term = match nodes.names.get(*name as usize)? {
                    Name::Below(rest) => {
                        NamedNode::new_unchecked(format!("{}{number}{rest}", nodes.base)).into()
                    }
                    Name::Iri(iri) => NamedNode::new_unchecked(iri).into(),
                    Name::Blank(label) => BlankNode::new_unchecked(label).into(),
                    Name::Assertion => {
                        derived.push((node, node, "assertion"));
                        continue;
                    }
                    Name::Outcome => {
                        derived.push((
                            node,
                            *self.assertion_of.get(&(node as u32))? as usize,
                            "result",
                        ));
                        continue;
                    }
                };
                *terms.get_mut(node)? = Some(term);
            }
            first += profile.names.len();
        }
        for (node, assertion, part) in derived {
            let assertion = assertion as u32;
            let execution = terms
                .get(*self.subject_of.get(&assertion)? as usize)?
                .as_ref()?;
            let NamedOrBlankNode::NamedNode(execution) = execution else {
                return None;
            };
            let label = unique(&[execution.as_str(), self.test_of.get(&assertion)?, part]);
            *terms.get_mut(node)? = Some(label.into());
        }
        terms.into_iter().collect()
    }
}

thread_local! {
    /// A part is so short that a new context for each would take longer than its decompression.
    static CONTEXT: RefCell<DCtx<'static>> = RefCell::new(DCtx::create());
}

fn unpacked(bytes: &[u8]) -> Result<Vec<u8>, String> {
    CONTEXT.with_borrow_mut(|context| {
        let mut unpacked = Vec::with_capacity(bytes.len() * 4);
        read_expanded(
            Decoder::with_context(bytes, context),
            bytes.len(),
            &mut unpacked,
        )?;
        Ok(unpacked)
    })
}
