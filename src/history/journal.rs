//! The journal of a history: statements that its owner has stored, and that are not in the tables
//! of the store yet.
//!
//! The store writes each statement to its own log with all its texts in full, then to tables that
//! it does not compress, and merges these soon. The journal takes a fiftieth of that, and many runs
//! together go into compressed tables, each written once. A record is with the operating system
//! when [`Journal::append`] returns, so that it survives a kill of the process. Readers add the
//! journal to the contents of the tables.
//!
//! A record has a header (size of the content, number of statements, checksum of the content,
//! checksum of the header so far; four bytes each, the lowest first) and the compressed content:
//! terms, and statements as numbers of terms.

use std::collections::{HashMap, HashSet};
use std::fs::File;
use std::io::{self, ErrorKind, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use flate2::read::DeflateDecoder;
use flate2::write::DeflateEncoder;
use flate2::{Compression, Crc};
use oxigraph::model::vocab::xsd;
use oxigraph::model::{
    BlankNode, GraphName, Literal, NamedNode, NamedOrBlankNode, Quad, Term, TermRef,
};
use serde::{Deserialize, Serialize};

use crate::chosen::Chosen;
use crate::inflate::read_expanded;
use crate::threads::joined;
use crate::wanted::Wanted;
use actcheck_base::Below;

/// Name of the file in the folder of a history.
pub(super) const NAME: &str = "journal";
/// Size of a record's header. Unit: bytes.
const HEADER: usize = 16;
/// Longest journal that is read: its statements go into tables long before. Unit: bytes.
const LONGEST: u64 = 512 << 20;

/// Fewer records are not worth a thread.
const FEWEST_RECORDS: usize = 20;

/// The journal of a history that this process owns.
#[derive(Debug)]
pub(super) struct Journal {
    path: PathBuf,
    /// `None` until the first record.
    file: Option<File>,
    /// Size of the complete records. Unit: bytes.
    length: u64,
    /// Number of statements in it.
    pub(super) statements: usize,
    /// Whether each record is written to the disk at once, so that it survives a power cut.
    pub(super) synced: bool,
}

impl Journal {
    /// The journal in the folder of a history, empty: the owner first puts the records of a killed
    /// process into the store.
    pub(super) fn new(dir: &Path) -> Self {
        Self {
            path: dir.join(NAME),
            file: None,
            length: 0,
            statements: 0,
            synced: false,
        }
    }

    /// Whether it has no file yet.
    pub(super) fn is_new(&self) -> bool {
        self.file.is_none()
    }

    /// Adds a record: all of it or, on an error, nothing.
    ///
    /// # Errors
    /// The disk is full or can't be written.
    pub(super) fn append(
        &mut self,
        Record {
            bytes: record,
            statements,
        }: &Record,
    ) -> io::Result<()> {
        let is_new = self.is_new();
        let file = match self.file.take() {
            Some(file) => file,
            None => below(&self.path).emptied(&self.path)?,
        };
        let file = self.file.insert(file);
        let written = file.write_all(record).and_then(|()| {
            if self.synced {
                file.sync_data()
            } else {
                Ok(())
            }
        });
        if let Err(error) = written {
            // Otherwise the next record would follow half a one. If this fails too, the disk does
            // not work.
            let _ = cut(file, self.length);
            return Err(error);
        }
        self.length += record.len() as u64;
        self.statements += statements;
        if is_new && self.synced {
            sync_folder(&self.path)
        } else {
            Ok(())
        }
    }

    /// Writes the journal to the disk.
    ///
    /// # Errors
    /// The disk is full or can't be written.
    pub(super) fn sync(&self) -> io::Result<()> {
        let Some(file) = &self.file else {
            return Ok(());
        };
        file.sync_data()?;
        sync_folder(&self.path)
    }

    /// Removes the journal, whose statements are in the store now.
    ///
    /// # Errors
    /// It can't be removed.
    pub(super) fn remove(&mut self) -> io::Result<()> {
        (self.file, self.length, self.statements) = (None, 0, 0);
        match below(&self.path).remove(&self.path) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        }
    }
}

fn cut(file: &mut File, length: u64) -> io::Result<()> {
    file.set_len(length)?;
    file.seek(SeekFrom::Start(length)).map(drop)
}

fn sync_folder(file: &Path) -> io::Result<()> {
    let below = below(file);
    below.sync_folder(below.root())
}

/// The folder of the journal.
fn below(file: &Path) -> Below {
    Below::new(file.parent().unwrap_or(file))
}

/// Reads the journal in the folder of a history. Returns nothing if there is none.
///
/// # Errors
/// It can't be read.
pub(super) fn read(dir: &Path) -> io::Result<Vec<u8>> {
    match Below::new(dir).read(&dir.join(NAME), LONGEST) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(Vec::new()),
        read => read,
    }
}

/// All statements of a journal.
#[derive(Debug, Default)]
pub(super) struct Statements {
    /// Those of the default graph, in order, in one list for each thread that decoded them.
    pub(super) of_default: Vec<Vec<Quad>>,
    /// Those of named graphs.
    pub(super) of_named: Vec<Vec<Quad>>,
}

impl Statements {
    /// Number of statements.
    pub(super) fn len(&self) -> usize {
        self.of_default
            .iter()
            .chain(&self.of_named)
            .map(Vec::len)
            .sum()
    }

    /// Iterates over all of them.
    pub(super) fn into_quads(self) -> impl Iterator<Item = Quad> {
        self.of_default.into_iter().chain(self.of_named).flatten()
    }
}

/// Returns the statements of a journal, and whether all of it could be read. Half a record at the
/// end was left by a killed process: it was never reported. As many threads share the work.
pub(super) fn statements(bytes: &[u8], threads: usize) -> (Statements, bool) {
    let records: Vec<Option<(usize, &[u8])>> = records(bytes).collect();
    let of_each = records.len().div_ceil(threads.max(1)).max(FEWEST_RECORDS);
    let decoded = |records: &[Option<(usize, &[u8])>]| {
        let (part, is_whole) = part_of(records.iter().copied(), &Wanted::all());
        let (of_default, of_named) = part
            .quads
            .into_iter()
            .partition(|quad| quad.graph_name.is_default_graph());
        (of_default, of_named, is_whole)
    };
    let parts: Vec<(Vec<Quad>, Vec<Quad>, bool)> = std::thread::scope(|scope| {
        let threads: Vec<_> = records
            .chunks(of_each)
            .map(|records| scope.spawn(|| decoded(records)))
            .collect();
        threads.into_iter().map(joined).collect()
    });
    let (mut all, mut all_whole) = (Statements::default(), true);
    for (of_default, of_named, is_whole) in parts {
        all.of_default.push(of_default);
        all.of_named.push(of_named);
        all_whole &= is_whole;
    }
    (all, all_whole)
}

/// Whether bytes follow the complete records of a journal. A process that was killed while it wrote
/// leaves half a record; so does a copy or a disk that lost the end.
pub(super) fn is_cut(bytes: &[u8]) -> bool {
    let complete: usize = records(bytes)
        .flatten()
        .map(|(_, content)| HEADER + content.len())
        .sum();
    complete < bytes.len()
}

/// Returns whether all of a journal can be read.
pub(super) fn is_whole(bytes: &[u8]) -> bool {
    records(bytes).all(|record| record.is_some())
}

/// Some statements of a journal.
#[derive(Debug, Default)]
pub(super) struct Part {
    pub quads: Vec<Quad>,
    /// The names of the graphs of all statements, if they were wanted.
    pub graphs: HashSet<Term>,
}

/// Returns the wanted statements of a journal, and whether all of it could be read.
pub(super) fn part(bytes: &[u8], wanted: &Wanted) -> (Part, bool) {
    part_of(records(bytes), wanted)
}

fn part_of<'b>(
    records: impl Iterator<Item = Option<(usize, &'b [u8])>>,
    wanted: &Wanted,
) -> (Part, bool) {
    let (mut part, mut is_whole, mut inflated) = (Part::default(), true, Vec::new());
    for record in records {
        let read = record.and_then(|(count, content)| {
            inflated.clear();
            read_expanded(DeflateDecoder::new(content), content.len(), &mut inflated).ok()?;
            decode(&inflated, count, wanted, &mut part)
        });
        is_whole &= read.is_some();
    }
    (part, is_whole)
}

/// Iterates over the complete records of a journal: the number of statements and the compressed
/// content of each, or `None` for a damaged one.
fn records(mut bytes: &[u8]) -> impl Iterator<Item = Option<(usize, &[u8])>> {
    std::iter::from_fn(move || {
        // Where a power cut left room for a record, there are zeros.
        if bytes.len() < HEADER || bytes.iter().all(|byte| *byte == 0) {
            return None;
        }
        let [size, count, sum, header] = [0, 4, 8, 12]
            .map(|at| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]));
        if sum_of(&bytes[..HEADER - 4]) != header {
            bytes = &[];
            return Some(None);
        }
        let end = HEADER + size as usize;
        let content = bytes.get(HEADER..end)?;
        bytes = &bytes[end..];
        Some((sum_of(content) == sum).then_some((count as usize, content)))
    })
}

/// A term in a record.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) enum Written<'a> {
    Iri(&'a str),
    Blank(&'a str),
    Text(&'a str),
    /// Text and language.
    Tagged(&'a str, &'a str),
    /// Text and datatype.
    Typed(&'a str, &'a str),
}

/// Terms, and statements: the numbers of subject, property, value, and graph. Numbers of graphs
/// begin at 1; the default graph is 0.
pub(super) type Content<'a> = (Vec<Written<'a>>, Vec<[u32; 4]>);

/// Replaces the terms of statements by numbers.
pub(super) fn numbered<'q>(quads: impl IntoIterator<Item = &'q Quad>) -> Content<'q> {
    let mut terms = Vec::new();
    let mut known: HashMap<TermRef<'_>, u32> = HashMap::new();
    let mut number = |term| {
        *known.entry(term).or_insert_with(|| {
            terms.push(written(term));
            terms.len() as u32 - 1
        })
    };
    let rows: Vec<[u32; 4]> = quads
        .into_iter()
        .map(|quad| {
            let graph = match &quad.graph_name {
                GraphName::DefaultGraph => 0,
                GraphName::NamedNode(node) => number(node.as_ref().into()) + 1,
                GraphName::BlankNode(node) => number(node.as_ref().into()) + 1,
            };
            let [subject, property, value] = [
                quad.subject.as_ref().into(),
                quad.predicate.as_ref().into(),
                quad.object.as_ref(),
            ]
            .map(&mut number);
            [subject, property, value, graph]
        })
        .collect();
    (terms, rows)
}

/// Statements that are encoded for the journal.
#[derive(Debug)]
pub(super) struct Record {
    bytes: Vec<u8>,
    /// Number of statements in it.
    statements: usize,
}

impl Record {
    /// Encodes statements.
    ///
    /// # Errors
    /// They have more than 4 GB.
    pub(super) fn of(quads: &[Quad]) -> io::Result<Self> {
        let content = postcard::to_stdvec(&numbered(quads)).map_err(io::Error::other)?;
        let mut encoder = DeflateEncoder::new(vec![0; HEADER], Compression::fast());
        encoder.write_all(&content)?;
        let mut bytes = encoder.finish()?;
        let size = u32::try_from(bytes.len() - HEADER).map_err(io::Error::other)?;
        let sum = sum_of(&bytes[HEADER..]);
        for (at, value) in [size, quads.len() as u32, sum].into_iter().enumerate() {
            bytes[at * 4..][..4].copy_from_slice(&value.to_le_bytes());
        }
        let header = sum_of(&bytes[..HEADER - 4]);
        bytes[HEADER - 4..HEADER].copy_from_slice(&header.to_le_bytes());
        Ok(Self {
            bytes,
            statements: quads.len(),
        })
    }
}

pub(super) fn written(term: TermRef<'_>) -> Written<'_> {
    match term {
        TermRef::NamedNode(node) => Written::Iri(node.as_str()),
        TermRef::BlankNode(node) => Written::Blank(node.as_str()),
        TermRef::Literal(literal) => match literal.language() {
            Some(tag) => Written::Tagged(literal.value(), tag),
            None if literal.datatype() == xsd::STRING => Written::Text(literal.value()),
            None => Written::Typed(literal.value(), literal.datatype().as_str()),
        },
        #[expect(
            unreachable_patterns,
            reason = "other builds of the library have quoted triples, which we never write"
        )]
        _ => Written::Text(""),
    }
}

/// Adds the wanted statements of a record's content. Returns `None` if it is damaged.
fn decode(content: &[u8], count: usize, wanted: &Wanted, part: &mut Part) -> Option<()> {
    let (written, rows): Content<'_> = postcard::from_bytes(content).ok()?;
    if rows.len() != count {
        return None;
    }
    collect(&written, &rows, wanted, part)
}

/// Adds the wanted statements. Returns `None` if they are damaged.
pub(super) fn collect(
    written: &[Written<'_>],
    rows: &[[u32; 4]],
    wanted: &Wanted,
    part: &mut Part,
) -> Option<()> {
    let chosen = Chosen::of(wanted, written);
    let mut terms: Vec<Option<Term>> = vec![None; written.len()];
    let mut term = |number: u32| {
        let (known, written) = (
            terms.get_mut(number as usize)?,
            written.get(number as usize)?,
        );
        Some(known.get_or_insert_with(|| read_term(*written)).clone())
    };
    for row in rows {
        if wanted.graphs && row[3] > 0 {
            part.graphs.insert(term(row[3] - 1)?);
        }
        if !chosen.has(row) {
            continue;
        }
        let graph = match row[3].checked_sub(1) {
            None => GraphName::DefaultGraph,
            Some(number) => NamedOrBlankNode::try_from(term(number)?).ok()?.into(),
        };
        let Term::NamedNode(property) = term(row[1])? else {
            return None;
        };
        part.quads.push(Quad::new(
            NamedOrBlankNode::try_from(term(row[0])?).ok()?,
            property,
            term(row[2])?,
            graph,
        ));
    }
    Some(())
}

pub(super) fn read_term(written: Written<'_>) -> Term {
    match written {
        Written::Iri(iri) => NamedNode::new_unchecked(iri).into(),
        Written::Blank(label) => BlankNode::new_unchecked(label).into(),
        Written::Text(text) => Literal::new_simple_literal(text).into(),
        Written::Tagged(text, tag) => {
            Literal::new_language_tagged_literal_unchecked(text, tag).into()
        }
        Written::Typed(text, datatype) => {
            Literal::new_typed_literal(text, NamedNode::new_unchecked(datatype)).into()
        }
    }
}

/// Checksum of bytes.
pub(super) fn sum_of(bytes: &[u8]) -> u32 {
    let mut crc = Crc::new();
    crc.update(bytes);
    crc.sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_base::ScratchFolder;
    use std::fs::OpenOptions;

    /// The statements of two transactions, with every kind of term.
    fn sample() -> [Vec<Quad>; 2] {
        let node = |name: &str| NamedNode::new_unchecked(format!("http://actions#{name}"));
        let values: [Term; 7] = [
            node("a").into(),
            BlankNode::new_from_unique_id(0x00ab_cdef).into(),
            BlankNode::new_unchecked("label").into(),
            Literal::new_simple_literal("\"a\"\n").into(),
            Literal::new_language_tagged_literal_unchecked("Glas", "de").into(),
            Literal::from(0.1).into(),
            Literal::from(u64::MAX).into(),
        ];
        let with = |graph: &GraphName| -> Vec<Quad> {
            values
                .iter()
                .map(|value| Quad::new(node("s"), node("p"), value.clone(), graph.clone()))
                .collect()
        };
        [with(&GraphName::DefaultGraph), with(&node("g").into())]
    }

    fn statements(bytes: &[u8]) -> (Vec<Quad>, bool) {
        let (statements, is_whole) = super::statements(bytes, 2);
        (statements.into_quads().collect(), is_whole)
    }

    fn journalled(dir: &Path) -> Vec<u8> {
        let mut journal = Journal::new(dir);
        for quads in sample() {
            journal
                .append(&Record::of(&quads).expect("they are few"))
                .expect("it can be written");
        }
        assert_eq!(journal.statements, 14);
        read(dir).expect("it can be read")
    }

    #[test]
    fn a_journal_returns_the_statements_of_all_its_records() {
        let folder = ScratchFolder::create().expect("it can be created");
        assert_eq!(
            statements(&read(folder.path()).expect("none is there")),
            (Vec::new(), true)
        );
        let bytes = journalled(folder.path());
        assert_eq!(statements(&bytes), (sample().concat(), true));
        assert_eq!(
            statements(&[bytes, vec![0; 40]].concat()),
            (sample().concat(), true)
        );
        Journal::new(folder.path())
            .remove()
            .expect("it can be removed");
        assert_eq!(
            statements(&read(folder.path()).expect("it is gone")),
            (Vec::new(), true)
        );
    }

    #[test]
    fn threads_share_the_records_of_a_long_journal() {
        let mut bytes = Vec::new();
        let [of_default, of_named] = sample();
        for _ in 0..3 * FEWEST_RECORDS {
            bytes.extend(
                Record::of(&[of_default.as_slice(), &of_named].concat())
                    .expect("memory")
                    .bytes,
            );
        }
        let expected = [
            vec![of_default; 3 * FEWEST_RECORDS].concat(),
            vec![of_named; 3 * FEWEST_RECORDS].concat(),
        ];
        assert_eq!(statements(&bytes), (expected.concat(), true));
        let last = bytes.len() - 1;
        bytes[last] ^= 1;
        assert!(!statements(&bytes).1, "the last thread's record is damaged");
    }

    #[test]
    fn a_part_of_a_journal_has_the_wanted_statements_and_no_more() {
        let folder = ScratchFolder::create().expect("it can be created");
        let bytes = journalled(folder.path());
        let count = |query: &str| part(&bytes, &Wanted::query(query)).0.quads.len();
        assert_eq!(count("SELECT * { ?s <http://actions#p> ?o }"), 7);
        assert_eq!(
            count("SELECT * { GRAPH act:g { ?s <http://actions#p> ?o } }"),
            7
        );
        assert_eq!(count("SELECT * { ?s ?p ?o . GRAPH ?g { ?s ?p ?o } }"), 14);
        assert_eq!(count("SELECT * { ?s <http://actions#q> ?o }"), 0);
        assert_eq!(count("SELECT * { ?s ?p act:a }"), 1);
        assert_eq!(count("SELECT * { ?s ?p '\"a\"\\n' }"), 1);
        // The store compares numbers by value.
        assert_eq!(count("SELECT * { ?s ?p 1 }"), 7);
        assert_eq!(
            part(&bytes, &Wanted::query("ASK { GRAPH ?g {} }"))
                .0
                .graphs
                .len(),
            1
        );
        let run = |iri: &str| part(&bytes, &Wanted::run(iri)).0.quads.len();
        assert_eq!(
            (
                run("http://actions#s"),
                run("http://actions#g"),
                run("http://actions")
            ),
            (14, 7, 0)
        );
    }

    #[test]
    fn half_a_record_at_the_end_is_left_out() {
        let folder = ScratchFolder::create().expect("it can be created");
        let bytes = journalled(folder.path());
        let [first, second] = sample().map(|quads| Record::of(&quads).expect("memory").bytes.len());
        assert_eq!(bytes.len(), first + second);
        for length in 0..bytes.len() {
            let whole = if length < first {
                Vec::new()
            } else {
                sample()[0].clone()
            };
            assert_eq!(statements(&bytes[..length]), (whole, true), "{length}");
        }
    }

    #[test]
    fn every_flipped_bit_of_a_journal_is_noticed() {
        let folder = ScratchFolder::create().expect("it can be created");
        let bytes = journalled(folder.path());
        for at in 0..bytes.len() {
            for bit in 0..8 {
                let mut bytes = bytes.clone();
                bytes[at] ^= 1 << bit;
                assert!(!statements(&bytes).1, "bit {bit} of byte {at}");
            }
        }
    }

    /// The next record would otherwise follow half a one, and be lost with it.
    #[test]
    fn a_record_that_could_not_be_written_leaves_nothing() {
        let folder = ScratchFolder::create().expect("it can be created");
        let whole = journalled(folder.path());
        let mut file = OpenOptions::new()
            .append(true)
            .open(folder.path().join(NAME))
            .expect("it exists");
        file.write_all(b"half")
            .and_then(|()| cut(&mut file, whole.len() as u64))
            .expect("it can be written");
        assert_eq!(read(folder.path()).expect("it can be read"), whole);
    }
}
