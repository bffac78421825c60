//! The history as RDF files, for other tools.

use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::Path;

use oxigraph::io::RdfFormat;
use oxigraph::model::GraphNameRef;

use crate::rdf_text::serializer;
use crate::{History, RdfSyntax};
use actcheck_base::{Diagnostic, Diagnostics};

impl History {
    /// Writes the whole history as N-Quads, including facts and later judgements in their named graphs.
    ///
    /// # Errors
    /// `H016` the file can't be written, or the store can't be read.
    pub fn write_nquads(&self, file: &Path) -> Result<(), Diagnostics> {
        let store = self.store()?;
        let write = || -> Result<(), String> {
            let writer = BufWriter::new(File::create(file).map_err(|error| error.to_string())?);
            let mut writer = store.dump_to_writer(RdfFormat::NQuads, writer).map_err(|error| error.to_string())?;
            writer.flush().map_err(|error| error.to_string())
        };
        write().map_err(|why| unwritten(file, &why))
    }

    /// Writes the default graph as Turtle: campaigns, runs, executions, scenes and outcomes. Turtle can't represent the
    /// named graphs.
    ///
    /// # Errors
    /// As [`History::write_nquads`].
    pub fn write_turtle(&self, file: &Path) -> Result<(), Diagnostics> {
        let store = self.store()?;
        let serializer = serializer(RdfSyntax::Turtle);
        let write = || -> Result<(), String> {
            let writer = BufWriter::new(File::create(file).map_err(|error| error.to_string())?);
            let mut writer = store
                .dump_graph_to_writer(GraphNameRef::DefaultGraph, serializer, writer)
                .map_err(|error| error.to_string())?;
            writer.flush().map_err(|error| error.to_string())
        };
        write().map_err(|why| unwritten(file, &why))
    }
}

fn unwritten(file: &Path, why: &str) -> Diagnostics {
    Diagnostic::error("H016", format!("{} can't be written: {}", file.display(), why.to_lowercase()))
        .help("name a file in an existing, writable folder")
        .into()
}
