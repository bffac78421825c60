//! `--picture FILE`: draws into a file whose extension selects the format.

use std::path::Path;

use crate::appearance::AppearanceReader;
use crate::output_file;
use crate::replayed_runs::explained;
use crate::why::ontology_file;
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_data::Trace;
use actcheck_history::{History, RunDetail};
use actcheck_ontology as ontology;
use actcheck_report::{Caption, Chart, Drawing, run_picture};
use actcheck_rules::{Budget, RuleBook};

/// A picture file in a supported format.
pub(super) struct Picture<'a> {
    file: &'a Path,
    render: fn(&Drawing) -> std::io::Result<Vec<u8>>,
}

impl<'a> Picture<'a> {
    /// Checks the extension, before any long computation begins.
    ///
    /// # Errors
    /// X012: the extension is neither `.png` nor `.svg`.
    pub(super) fn new(file: &'a Path) -> Result<Self, Diagnostics> {
        let ending = file
            .extension()
            .unwrap_or_default()
            .to_string_lossy()
            .to_lowercase();
        match ending.as_str() {
            "png" => Ok(Self {
                file,
                render: Drawing::to_png,
            }),
            "svg" => Ok(Self {
                file,
                render: |drawing| Ok(drawing.to_svg().into_bytes()),
            }),
            _ => {
                let message = format!("no picture format is known for {}", file.display());
                let help = format!(
                    "use the extension .png or .svg, such as {}",
                    file.with_extension("png").display()
                );
                Err(Diagnostic::error("X012", message).help(help).into())
            }
        }
    }

    /// Draws a run, with the signals that decided its failed properties about time by the rules of
    /// an ontology, or of the usual one. `looks` has the appearance of bodies.
    ///
    /// # Errors
    /// X006: the run has no state to draw; X007: the file can't be written.
    pub(super) fn draw(
        &self,
        history: &History,
        run: &RunDetail,
        ontology: Option<&Path>,
        mut looks: AppearanceReader<'_>,
    ) -> Result<(), Diagnostics> {
        // Without its motion, the states before and after are drawn.
        let id = &run.row.run;
        let trace = history
            .traces()
            .whole_if_allowed(id)?
            .map_or_else(|| history.traces().states(id), Ok)?;
        let appearances = looks.of(&run.row.campaign)?;
        let drawing = run_picture(
            &Caption {
                charts: charts(&trace, run, ontology),
                ..Caption::of(run).with_appearances(run, &appearances)
            },
            &trace,
        )
        .ok_or_else(|| {
            Diagnostic::error("X006", format!("run {} has no state to draw", run.row.run))
                .help("it broke before its first action; `actcheck show` shows the reason")
        })?;
        self.write(&drawing)
    }

    /// Writes a picture.
    ///
    /// # Errors
    /// X007: the file can't be written.
    pub(super) fn write(&self, drawing: &Drawing) -> Result<(), Diagnostics> {
        let bytes =
            (self.render)(drawing).map_err(|error| output_file::cannot_write(self.file, error))?;
        output_file::write(self.file, bytes)
    }
}

/// The charts of a run; none if the rules can't be read.
fn charts(trace: &Trace, run: &RunDetail, ontology: Option<&Path>) -> Vec<Chart> {
    let budget = Budget::default();
    let (files, path) = ontology_file(ontology);
    let rules = ontology::load(&files, &path)
        .and_then(|ontology| RuleBook::prepare_within(&ontology, &budget));
    rules.map_or_else(
        |_| Vec::new(),
        |rules| Chart::all_of(&explained(trace, &rules, run, &budget)),
    )
}
