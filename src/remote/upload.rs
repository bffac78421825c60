//! Sends the parts of a history in batches.

use std::io;
use std::path::Path;

use ureq::http::Method;

use crate::client::{Client, Request};
use crate::fault::Fault;
use crate::ledger::{Ledger, digest};
use crate::protocol::{by_graph, quads, triples, update};
use crate::{Address, Protocol};
use actcheck_base::{Diagnostic, Diagnostics};

/// Largest body of a request, except for a part that is larger. Unit: bytes.
const MOST_BYTES: usize = 8 << 20;

/// A statement: its graph, `None` for the default graph, and its triple in N-Triples without the
/// full stop. Without blank nodes, so that it can be sent twice.
pub(crate) type Statement = (Option<String>, String);

/// A part that a store gets as a whole.
#[derive(Debug, Clone, Default)]
pub struct Part {
    /// Its name, unique in the history.
    pub name: String,
    /// A node whose statements in the default graph are replaced, because a later state of it may
    /// lack some of them. Only updates can do that.
    pub replaced: Option<String>,
    /// Its statements, sorted: the graph (`None` is the default graph) and the triple in N-Triples,
    /// without the full stop.
    pub statements: Vec<(Option<String>, String)>,
}

/// The ways in which an upload can differ.
#[derive(Debug, Clone)]
pub struct UploadOptions {
    /// The way to send statements.
    pub protocol: Protocol,
    /// Number of statements in a request. A part is not divided.
    pub batch: usize,
    /// Whether parts that were accepted before are sent again.
    pub from_start: bool,
}

/// Numbers of an upload.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Sent {
    /// Statements that the store accepted now.
    pub statements: u64,
    /// Statements of parts that it had accepted before.
    pub known: u64,
    /// Requests that it accepted now.
    pub requests: u64,
}

/// An upload to one store.
#[derive(Debug)]
pub struct Upload<'a> {
    client: &'a Client,
    address: &'a Address,
    options: UploadOptions,
    ledger: Ledger,
    batch: Batch,
    sent: Sent,
}

#[derive(Debug, Default)]
struct Batch {
    parts: Vec<u128>,
    replaced: Vec<String>,
    statements: Vec<Statement>,
    bytes: usize,
}

impl<'a> Upload<'a> {
    /// Begins or continues an upload. `record` is the file in which accepted parts are recorded.
    /// Returns a warning if it can't be written.
    pub fn new(
        client: &'a Client,
        address: &'a Address,
        options: UploadOptions,
        record: &Path,
    ) -> (Self, Option<Diagnostic>) {
        let (ledger, fault) = Ledger::open(record, &address.to_string(), options.from_start);
        let warning = fault.map(|error| unrecorded(record, &error));
        (
            Self {
                client,
                address,
                options,
                ledger,
                batch: Batch::default(),
                sent: Sent::default(),
            },
            warning,
        )
    }

    /// Adds a part, and sends the batch if it is full.
    ///
    /// # Errors
    /// `X030`, `X091`, `X092`, `X093`: the store did not accept a batch. Batches accepted before
    /// are recorded.
    pub fn add(&mut self, part: Part) -> Result<(), Diagnostics> {
        let texts = part
            .statements
            .iter()
            .map(|(graph, triple)| (graph.as_deref().unwrap_or(""), triple.as_str()));
        let id = digest(&part.name, texts);
        if self.ledger.has(id) {
            self.sent.known += part.statements.len() as u64;
            return Ok(());
        }
        let bytes = part.statements.iter().map(size).sum::<usize>();
        let is_full = self.batch.statements.len() + part.statements.len() > self.options.batch
            || self.batch.bytes + bytes > MOST_BYTES;
        if is_full {
            self.flush()?;
        }
        self.batch.parts.push(id);
        self.batch.replaced.extend(part.replaced);
        self.batch.statements.extend(part.statements);
        self.batch.bytes += bytes;
        Ok(())
    }

    /// Sends the rest.
    ///
    /// # Errors
    /// As [`Upload::add`].
    pub fn finish(mut self) -> Result<Sent, Diagnostics> {
        self.flush()?;
        Ok(self.sent)
    }

    fn flush(&mut self) -> Result<(), Diagnostics> {
        let mut batch = std::mem::take(&mut self.batch);
        if batch.parts.is_empty() {
            return Ok(());
        }
        batch.statements.sort();
        self.deliver(&batch.statements, &batch.replaced)
            .map_err(|fault| fault.into_diagnostics(self.address, "statements"))?;
        self.sent.statements += batch.statements.len() as u64;
        // The next run of the command would only send more than it has to.
        let _ = self.ledger.add(&batch.parts);
        Ok(())
    }

    /// Sends statements, which are sorted by graph; in halves if they are too large for the server.
    fn deliver(&mut self, statements: &[Statement], replaced: &[String]) -> Result<(), Fault> {
        let target = self.address.to_string();
        let sent = match self.options.protocol {
            Protocol::Update => self.post(
                target,
                "application/sparql-update; charset=utf-8",
                &update(statements, replaced),
            ),
            Protocol::Quads => self.post(target, "application/n-quads", &quads(statements)),
            Protocol::GraphStore => {
                return by_graph(statements).try_for_each(|group| self.deliver_graph(group));
            }
        };
        self.or_in_halves(sent, statements, |upload, half, is_first| {
            upload.deliver(half, if is_first { replaced } else { &[] })
        })
    }

    fn deliver_graph(&mut self, statements: &[Statement]) -> Result<(), Fault> {
        let target = match &statements[0].0 {
            Some(graph) => self.address.with_parameter("graph", Some(graph)),
            None => self.address.with_parameter("default", None),
        };
        let sent = self.post(target, "application/n-triples", &triples(statements));
        self.or_in_halves(sent, statements, |upload, half, _| {
            upload.deliver_graph(half)
        })
    }

    /// Sends both halves of statements if the server refused all of them for their size.
    fn or_in_halves(
        &mut self,
        sent: Result<(), Fault>,
        statements: &[Statement],
        mut deliver: impl FnMut(&mut Self, &[Statement], bool) -> Result<(), Fault>,
    ) -> Result<(), Fault> {
        match sent {
            Err(Fault::Refused { status: 413, .. }) if statements.len() > 1 => {
                let (first, second) = statements.split_at(statements.len() / 2);
                deliver(self, first, true)?;
                deliver(self, second, false)
            }
            other => other,
        }
    }

    fn post(&mut self, target: String, media_type: &str, body: &str) -> Result<(), Fault> {
        let request = Request {
            method: Method::POST,
            address: self.address,
            target,
            headers: vec![
                ("content-type", media_type.to_owned()),
                ("accept", "*/*".to_owned()),
            ],
            content: body.as_bytes(),
        };
        self.client.send(&request)?.finish();
        self.sent.requests += 1;
        Ok(())
    }
}

/// The size of a statement in a request, roughly. Unit: bytes.
fn size((graph, triple): &Statement) -> usize {
    graph.as_ref().map_or(0, String::len) + triple.len() + 4
}

fn unrecorded(record: &Path, error: &io::Error) -> Diagnostic {
    let message = format!(
        "{} can't be written: {error}; the upload can't be resumed",
        record.display()
    );
    Diagnostic::warning("X095", message)
        .help("if it ends early, the same command sends everything again, which does no harm")
}
