//! The history as RDF files, for other tools.

use std::fs::File;
use std::io::{self, BufWriter, Write as _};
use std::path::Path;

use oxigraph::io::{RdfFormat, RdfSerializer};
use oxigraph::model::{Quad, TripleRef};

use crate::rdf_text::serializer;
use crate::statements::Statements;
use crate::view::{Demand, StatementMaker, WithFacts};
use crate::{History, RdfSyntax, write_campaign};
use actcheck_base::{Diagnostic, Diagnostics, NewFile};

/// A history as RDF for other tools.
#[derive(Clone, Copy)]
pub struct RdfExport<'h> {
    pub(crate) history: &'h History,
}

impl History {
    /// The history as RDF for other tools.
    pub fn rdf(&self) -> RdfExport<'_> {
        RdfExport { history: self }
    }
}

impl RdfExport<'_> {
    /// Calls `each` with all statements, campaign by campaign and run by run.
    ///
    /// # Errors
    /// A file is damaged or can't be read; those of `each`.
    fn each_statements(
        &self,
        facts: WithFacts,
        each: &mut dyn FnMut(Vec<Quad>) -> Result<(), Diagnostics>,
    ) -> Result<(), Diagnostics> {
        let demand = Demand::all();
        for state in self.history.stored.states()? {
            let mut statements = Statements::new(&demand);
            write_campaign::write(&state, &mut statements);
            each(statements.quads)?;
            let runs = self.history.stored.runs_of(&state.record.id)?;
            let maker = StatementMaker::new(&self.history.stored, &runs.id);
            for run in runs.iter() {
                let later = runs.later_of(run.row.index);
                each(maker.statements(run, &later, &demand, facts)?.quads)?;
            }
        }
        Ok(())
    }

    /// Writes the whole history as N-Quads, including facts and later judgements in their named
    /// graphs.
    ///
    /// # Errors
    /// `H016` the file can't be written; a file of the history is damaged or can't be read.
    pub fn write_nquads(&self, file: &Path) -> Result<(), Diagnostics> {
        self.write_quads(file, WithFacts::Lean)
    }

    /// Writes the whole history as N-Quads like [`RdfExport::write_nquads`], but with complete facts
    /// in place of those that queries ask for.
    ///
    /// # Errors
    /// As [`RdfExport::write_nquads`].
    pub fn write_complete_nquads(&self, file: &Path) -> Result<(), Diagnostics> {
        self.write_quads(file, WithFacts::Complete)
    }

    fn write_quads(&self, file: &Path, facts: WithFacts) -> Result<(), Diagnostics> {
        let failed = |why: io::Error| unwritten(file, &why.to_string());
        let (new, writer) = begin(file).map_err(failed)?;
        let mut writer = RdfSerializer::from_format(RdfFormat::NQuads).for_writer(writer);
        self.each_statements(facts, &mut |quads| {
            quads
                .iter()
                .try_for_each(|quad| writer.serialize_quad(quad))
                .map_err(failed)
        })?;
        writer
            .finish()
            .and_then(|mut writer| writer.flush())
            .and_then(|()| new.finish())
            .map_err(failed)
    }

    /// Writes the default graph as Turtle: campaigns, runs, executions, scenes and outcomes. Turtle
    /// can't represent the named graphs.
    ///
    /// # Errors
    /// As [`RdfExport::write_nquads`].
    pub fn write_turtle(&self, file: &Path) -> Result<(), Diagnostics> {
        let failed = |why: io::Error| unwritten(file, &why.to_string());
        let (new, writer) = begin(file).map_err(failed)?;
        let mut writer = serializer(RdfSyntax::Turtle).for_writer(writer);
        self.each_statements(WithFacts::No, &mut |quads| {
            let mut of_default = quads
                .iter()
                .filter(|quad| quad.graph_name.is_default_graph());
            of_default
                .try_for_each(|quad| writer.serialize_triple(TripleRef::from(quad.as_ref())))
                .map_err(failed)
        })?;
        writer
            .finish()
            .and_then(|mut writer| writer.flush())
            .and_then(|()| new.finish())
            .map_err(failed)
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
