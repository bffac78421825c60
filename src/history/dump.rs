//! The history as RDF files, for other tools.

use std::fs::File;
use std::io::{self, BufWriter, Write as _};
use std::path::Path;

use oxigraph::io::{RdfFormat, RdfSerializer};
use oxigraph::model::GraphNameRef;

use crate::rdf_text::serializer;
use crate::write_run::run_node;
use crate::{History, RdfSyntax, graphs};
use actcheck_base::{Diagnostic, Diagnostics, NewFile};
use actcheck_facts::extract_complete;

impl History {
    /// Writes the whole history as N-Quads, including facts and later judgements in their named
    /// graphs.
    ///
    /// # Errors
    /// `H016` the file can't be written, or the store can't be read.
    pub fn write_nquads(&self, file: &Path) -> Result<(), Diagnostics> {
        let store = self.store()?;
        let failed = |why: &dyn std::fmt::Display| unwritten(file, &why.to_string());
        let (new, writer) = begin(file).map_err(|error| failed(&error))?;
        let mut writer = RdfSerializer::from_format(RdfFormat::NQuads).for_writer(writer);
        for quad in store.iter() {
            let quad = quad.map_err(|error| failed(&error))?;
            writer
                .serialize_quad(&quad)
                .map_err(|error| failed(&error))?;
        }
        self.each_outlines_quads(true, &mut |quads| {
            quads
                .iter()
                .try_for_each(|quad| writer.serialize_quad(quad))
                .map_err(|error| failed(&error))
        })?;
        writer
            .finish()
            .and_then(|mut writer| writer.flush())
            .and_then(|()| new.finish())
            .map_err(|error| failed(&error))
    }

    /// Writes the whole history as N-Quads like [`History::write_nquads`], but with complete facts
    /// from the traces in place of those in the store, which has only facts that queries ask for.
    ///
    /// # Errors
    /// As [`History::write_nquads`], and as [`History::trace`] for each run.
    pub fn write_complete_nquads(&self, file: &Path) -> Result<(), Diagnostics> {
        let store = self.store()?;
        let failed = |why: &dyn std::fmt::Display| unwritten(file, &why.to_string());
        let (new, writer) = begin(file).map_err(|error| failed(&error))?;
        let mut writer = RdfSerializer::from_format(RdfFormat::NQuads).for_writer(writer);
        for quad in store.iter() {
            let quad = quad.map_err(|error| failed(&error))?;
            if !graphs::holds_facts(quad.graph_name.as_ref()) {
                writer
                    .serialize_quad(&quad)
                    .map_err(|error| failed(&error))?;
            }
        }
        self.each_outlines_quads(false, &mut |quads| {
            quads
                .iter()
                .try_for_each(|quad| writer.serialize_quad(quad))
                .map_err(|error| failed(&error))
        })?;
        for run in self.ids("act:Run")? {
            let facts = extract_complete(&self.states(&run)?);
            for quad in graphs::complete(&facts, &run_node(&run)) {
                writer
                    .serialize_quad(&quad)
                    .map_err(|error| failed(&error))?;
            }
        }
        writer
            .finish()
            .and_then(|mut writer| writer.flush())
            .and_then(|()| new.finish())
            .map_err(|error| failed(&error))
    }

    /// Writes the default graph as Turtle: campaigns, runs, executions, scenes and outcomes. Turtle
    /// can't represent the named graphs.
    ///
    /// # Errors
    /// As [`History::write_nquads`].
    pub fn write_turtle(&self, file: &Path) -> Result<(), Diagnostics> {
        let store = self.store()?;
        let failed = |why: &dyn std::fmt::Display| unwritten(file, &why.to_string());
        let (new, writer) = begin(file).map_err(|error| failed(&error))?;
        let mut writer = serializer(RdfSyntax::Turtle).for_writer(writer);
        for quad in store.quads_for_pattern(None, None, None, Some(GraphNameRef::DefaultGraph)) {
            let quad = quad.map_err(|error| failed(&error))?;
            writer
                .serialize_triple(quad.as_ref())
                .map_err(|error| failed(&error))?;
        }
        self.each_outlines_quads(false, &mut |quads| {
            quads
                .iter()
                .try_for_each(|quad| writer.serialize_triple(quad.as_ref()))
                .map_err(|error| failed(&error))
        })?;
        writer
            .finish()
            .and_then(|mut writer| writer.flush())
            .and_then(|()| new.finish())
            .map_err(|error| failed(&error))
    }
}

/// A file that appears under its name when it is complete, and its writer.
fn begin(file: &Path) -> io::Result<(NewFile, BufWriter<File>)> {
    let file = NewFile::create(file)?;
    let writer = BufWriter::new(file.writer()?);
    Ok((file, writer))
}

fn unwritten(file: &Path, why: &str) -> Diagnostics {
    Diagnostic::error(
        "H016",
        format!(
            "{} can't be written: {}",
            file.display(),
            why.to_lowercase()
        ),
    )
    .help("name a file in an existing, writable folder")
    .into()
}
