//! A file of outlines: the indices of its runs, their values in lists, their statements, and their
//! states.
//!
//! After the magic bytes, a table has the compressed size and the checksum of each part, and then
//! its own checksum: four bytes each, the lowest first. Each part is compressed on its own, because
//! most readers need only one. The statements are stored by property ([`crate::vertical`]), which
//! has parts and checksums of its own.

use oxigraph::model::Quad;

use crate::inflate::read_expanded;
use crate::journal::{self, Part};
use crate::outlines::row::Rows;
use crate::stored_run::StoredRun;
use crate::trace_file;
use crate::vertical::{self, CHANGED, Sheet};
use crate::wanted::Wanted;
use crate::{RunRecord, write_run};
use actcheck_base::{ByteReader, put_varint};

/// Magic bytes at the start of each file. The last one is the format version.
const MAGIC: &[u8; 8] = b"acoutln3";
/// Position of the statements among the parts.
const STATEMENTS: usize = 2;
/// Number of parts.
const PARTS: usize = 4;
/// Size of the magic bytes and the table. Unit: bytes.
pub(super) const HEADER: usize = MAGIC.len() + 8 * PARTS + 4;
/// Compression level: higher ones take many times as long and save some percent.
const LEVEL: i32 = 6;

/// The outline of one run.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Outline {
    /// The values of this run alone.
    pub rows: Rows,
    /// The statements about it in the default graph.
    pub quads: Vec<Quad>,
    /// Its choices and states, encoded as in the first part of a trace file.
    pub head: Vec<u8>,
}

impl Outline {
    /// The outline of a run.
    ///
    /// # Errors
    /// A message, if a part can't be encoded.
    pub(crate) fn of(record: &RunRecord) -> Result<Self, String> {
        let stored = StoredRun::of(record);
        Ok(Self {
            rows: Rows::of(record, stored.scene_digest()),
            quads: write_run::quads_without_facts(&stored, &record.campaign),
            head: trace_file::encode_head(&record.choices, &record.trace)?,
        })
    }
}

/// Encodes a file.
///
/// # Errors
/// A message, if a part can't be encoded.
pub(super) fn encode(outlines: &[Outline]) -> Result<Vec<u8>, String> {
    let fault = |error: postcard::Error| error.to_string();
    let rows = Rows::joined(outlines.iter().map(|outline| &outline.rows));
    let mut indices = Vec::new();
    put_varint(&mut indices, rows.rows.len() as u64);
    rows.rows
        .iter()
        .for_each(|row| put_varint(&mut indices, row.index));
    let quads: Vec<&[Quad]> = outlines
        .iter()
        .map(|outline| outline.quads.as_slice())
        .collect();
    let statements = vertical::encode(&quads)?;
    let heads: Vec<&[u8]> = outlines
        .iter()
        .map(|outline| outline.head.as_slice())
        .collect();
    let parts = [
        compressed(&indices)?,
        compressed(&postcard::to_stdvec(&rows).map_err(fault)?)?,
        statements,
        compressed(&postcard::to_stdvec(&heads).map_err(fault)?)?,
    ];
    let (mut bytes, mut body) = (MAGIC.to_vec(), Vec::new());
    for part in parts {
        let size = u32::try_from(part.len()).map_err(|_| "it is larger than 4 GB".to_owned())?;
        bytes.extend(size.to_le_bytes());
        bytes.extend(journal::sum_of(&part).to_le_bytes());
        body.extend(part);
    }
    bytes.extend(journal::sum_of(&bytes).to_le_bytes());
    bytes.extend(body);
    Ok(bytes)
}

fn compressed(part: &[u8]) -> Result<Vec<u8>, String> {
    zstd::bulk::compress(part, LEVEL).map_err(|error| error.to_string())
}

/// The parts of a file, compressed.
pub(super) struct Opened<'a> {
    parts: [&'a [u8]; PARTS],
    sums: [u32; PARTS],
}

impl<'a> Opened<'a> {
    /// Finds the parts of a file, of which the end may be missing: its parts are then empty.
    ///
    /// # Errors
    /// A message that names the damage.
    pub(super) fn new(bytes: &'a [u8]) -> Result<Self, String> {
        let (header, mut rest) = bytes.split_at_checked(HEADER).ok_or("it ends too early")?;
        let (magic, table) = header.split_at(MAGIC.len());
        if magic != MAGIC {
            return Err("it has no outlines of this format".to_owned());
        }
        let number = |at: usize| {
            u32::from_le_bytes([table[at], table[at + 1], table[at + 2], table[at + 3]])
        };
        if journal::sum_of(&header[..HEADER - 4]) != number(8 * PARTS) {
            return Err(CHANGED.to_owned());
        }
        let (mut parts, mut sums) = ([[].as_slice(); PARTS], [0; PARTS]);
        for at in 0..PARTS {
            sums[at] = number(8 * at + 4);
            let part;
            (part, rest) = rest
                .split_at_checked(number(8 * at) as usize)
                .unwrap_or((&[], &[]));
            parts[at] = part;
        }
        Ok(Self { parts, sums })
    }

    /// Size of the file up to the end of its first `parts` parts. Unit: bytes.
    pub(super) fn size_of_start(header: &[u8], parts: usize) -> Option<usize> {
        let sizes = (0..parts).map(|part| {
            let size = header.get(MAGIC.len() + 8 * part..MAGIC.len() + 8 * part + 4)?;
            Some(u32::from_le_bytes([size[0], size[1], size[2], size[3]]) as usize)
        });
        sizes.sum::<Option<usize>>().map(|size| HEADER + size)
    }

    fn part(&self, at: usize) -> Result<Vec<u8>, String> {
        if journal::sum_of(self.parts[at]) != self.sums[at] {
            return Err(CHANGED.to_owned());
        }
        let (part, mut out) = (self.parts[at], Vec::new());
        let decoder = zstd::stream::read::Decoder::new(part).map_err(|error| error.to_string())?;
        read_expanded(decoder, part.len(), &mut out)?;
        Ok(out)
    }

    /// Compares all parts with their checksums.
    ///
    /// # Errors
    /// A message, if a part differs.
    pub(super) fn check(&self) -> Result<(), String> {
        let is_same = |(part, sum): (&&[u8], &u32)| journal::sum_of(part) == *sum;
        if self.parts.iter().zip(&self.sums).all(is_same) {
            Ok(())
        } else {
            Err(CHANGED.to_owned())
        }
    }

    /// The indices of its runs, in the order of the file.
    pub(super) fn indices(&self) -> Result<Vec<u64>, String> {
        let bytes = self.part(0)?;
        let mut reader = ByteReader { bytes: &bytes };
        let read = || -> Option<Vec<u64>> {
            let count = reader.varint()?;
            (0..count).map(|_| reader.varint()).collect()
        };
        let mut read = read;
        read().ok_or_else(|| CHANGED.to_owned())
    }

    /// The values of its runs.
    pub(super) fn rows(&self) -> Result<Rows, String> {
        postcard::from_bytes(&self.part(1)?).map_err(unread)
    }

    /// Adds the wanted statements of its runs.
    pub(super) fn add_statements(&self, wanted: &Wanted, part: &mut Part) -> Result<(), String> {
        let properties = wanted.properties();
        let quads = self.by_property()?.statements(properties.as_deref())?;
        part.quads
            .extend(quads.into_iter().flatten().filter(|quad| wanted.has(quad)));
        Ok(())
    }

    /// The statements about each run.
    pub(super) fn statements(&self) -> Result<Vec<Vec<Quad>>, String> {
        self.by_property()?.statements(None)
    }

    fn by_property(&self) -> Result<Sheet<&'a [u8]>, String> {
        let bytes = self.parts[STATEMENTS];
        Sheet::open(bytes, bytes.len())
    }

    /// The place of the statements in the file. `header`: its first bytes.
    pub(super) fn statements_at(header: &[u8]) -> Result<std::ops::Range<usize>, String> {
        Opened::new(header)?;
        let end = |parts: usize| Self::size_of_start(header, parts).ok_or(CHANGED);
        Ok(end(STATEMENTS)?..end(STATEMENTS + 1)?)
    }

    /// The choices and states of all runs, encoded.
    pub(super) fn heads(&self) -> Result<Vec<Vec<u8>>, String> {
        postcard::from_bytes(&self.part(3)?).map_err(unread)
    }

    /// All of it.
    pub(super) fn outlines(&self) -> Result<Vec<Outline>, String> {
        let (rows, statements) = (self.rows()?, self.statements()?);
        let of = |(at, (head, quads))| Outline {
            rows: rows.only(at),
            quads,
            head,
        };
        Ok(self
            .heads()?
            .into_iter()
            .zip(statements)
            .enumerate()
            .map(of)
            .collect())
    }
}

fn unread(error: postcard::Error) -> String {
    error.to_string().to_lowercase()
}
