//! `actcheck report`

use std::path::PathBuf;

use clap::Args;

use crate::analyse::{Analysed, Question, analysed};
use crate::chosen::{ChosenRuns, is_meant};
use crate::options::{BYTES_IN_A_MB, megabytes};
use crate::report_formats::{self, FormatArgs};
use crate::trust::TrustArgs;
use crate::{output, output_file, report_html, restore};
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_history::{History, RunDetail};
use actcheck_report::HTML_COLUMNS;

/// `actcheck report`
#[derive(Debug, Args)]
#[group(id = "written", required = true, multiple = true, args = ["html", "allure", "junit", "earl", "jsonl", "markdown", "rrd"])]
pub struct ReportArgs {
    /// Write the report as one page (HTML); `-` prints it
    #[arg(long, value_name = "FILE.html")]
    pub html: Option<PathBuf>,
    /// Write runs in 3D over simulated time, with contacts and outcomes, for the Rerun viewer; `-`
    /// prints them
    #[cfg_attr(
        not(feature = "rerun"),
        doc = "",
        doc = "This actcheck was built without it: `cargo build --release --locked --features rerun`"
    )]
    #[arg(long, value_name = "FILE.rrd")]
    pub rrd: Option<PathBuf>,
    /// Formats of other tools.
    #[command(flatten)]
    pub formats: FormatArgs,
    /// Only this property, by its name in the ontology (may be given several times)
    #[arg(long, value_name = "P")]
    pub property: Vec<String>,
    /// Maximum size of the replays of failed runs in the page, and of recordings; larger files take
    /// longer to make and to send
    #[arg(long, value_name = "MB", default_value_t = 5.0, value_parser = megabytes)]
    pub replay_mb: f64,
    /// The runs to report, and their history.
    #[command(flatten)]
    pub chosen: ChosenRuns,
    /// The consent to start programs.
    #[command(flatten)]
    pub trust: TrustArgs,
}

impl ReportArgs {
    /// Whether a property was requested by its name or IRI.
    pub(super) fn wants(&self, property: &str) -> bool {
        self.property.iter().any(|name| is_meant(property, name))
    }

    /// Removes the outcomes that were not requested from a run.
    pub(super) fn keep_wanted(&self, run: &mut RunDetail) {
        for action in &mut run.actions {
            action
                .judgements
                .retain(|judgement| self.property.is_empty() || self.wants(&judgement.property));
        }
    }

    /// Whether a report goes to standard output.
    ///
    /// # Errors
    /// X058: several reports would go there. X055: a report needs a feature that this program was
    /// built without.
    fn prints(&self) -> Result<bool, Diagnostics> {
        let mut faults = Diagnostics::new();
        let printed =
            |file: &Option<PathBuf>| file.as_deref().is_some_and(|file| file.as_os_str() == "-");
        let files = [&self.html, &self.rrd]
            .into_iter()
            .filter(|file| printed(file))
            .count();
        let streams = self.formats.printed() + files;
        if streams > 1 {
            faults.push(
                Diagnostic::error("X058", "only one report can go to standard output")
                    .help("print one of them with `-`, and name files for the others"),
            );
        }
        if self.rrd.is_some() && !cfg!(feature = "rerun") {
            faults.push(
                Diagnostic::error("X055", "this actcheck was built without recordings for rerun (`--rrd`)").help(
                    "build it with them: `cargo build --release --locked --features rerun`; `--html` shows runs in 3D without it",
                ),
            );
        }
        faults.or(streams == 1)
    }
}

/// Writes the requested reports.
pub fn report(args: &ReportArgs) -> Result<(), Diagnostics> {
    let printed = args.prints()?;
    let history = args.chosen.open()?;
    restore::allow(&history, args.trust.trust);
    let mut told = report_formats::write(args, &history)?;
    if args.html.is_some() || args.rrd.is_some() {
        told.extend(write_reports_with_replays(args, &history)?);
    }
    output::tell(&told, printed);
    Ok(())
}

/// Writes the reports with replays, which are based on the analysis. Returns the messages to print.
fn write_reports_with_replays(
    args: &ReportArgs,
    history: &History,
) -> Result<Vec<String>, Diagnostics> {
    let found = found(args, history)?;
    let room = args.replay_mb * BYTES_IN_A_MB;
    let mut told = Vec::new();
    if let Some(file) = &args.html {
        let page = report_html::page(&found, history, room, args.trust.trust)?;
        if file.as_os_str() == "-" {
            output::print(&page);
        } else {
            output_file::write(file, &page)?;
            told.push(format!(
                "{} holds the report ({:.1} MB)",
                file.display(),
                page.len() as f64 / 1e6
            ));
        }
    }
    #[cfg(feature = "rerun")]
    if let Some(file) = &args.rrd {
        told.extend(crate::report_rrd::write(file, args, &found, history, room)?);
    }
    Ok(told)
}

fn found(args: &ReportArgs, history: &History) -> Result<Analysed, Diagnostics> {
    let asked = Question {
        chosen: &args.chosen,
        property: &args.property,
        by: &[],
        usual_maps: true,
    };
    analysed(&asked, history, &HTML_COLUMNS)
}
