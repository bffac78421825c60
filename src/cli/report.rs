//! `actcheck report`

use std::path::PathBuf;

use clap::Args;

use crate::base::{Diagnostic, Diagnostics, names};
use crate::cli::args::HistoryArgs;
use crate::cli::report_formats::{self, FormatArgs};
use crate::cli::{history_dir, output, report_html, since};

/// `actcheck report`
#[derive(Debug, Args)]
#[group(id = "written", required = true, multiple = true, args = ["html", "allure", "junit", "earl", "jsonl", "markdown"])]
pub struct ReportArgs {
    /// Write the report as one page (HTML); `-` prints it
    #[arg(long, value_name = "FILE.html")]
    pub html: Option<PathBuf>,
    /// The same for other tools.
    #[command(flatten)]
    pub formats: FormatArgs,
    /// Only this property, by its name in the ontology (may be given several times)
    #[arg(long, value_name = "P")]
    pub property: Vec<String>,
    /// Only runs of this campaign (may be given several times) [default: all but the smaller forms of runs]
    #[arg(long, value_name = "ID")]
    pub campaign: Vec<String>,
    /// Only runs since then, such as 2026-11-21, 2026-11-21T18:00:00Z or 12h ago as 12h
    #[arg(long, value_name = "WHEN", value_parser = since::moment)]
    pub since: Option<String>,
    /// The ontology that explains outcomes and says which kinds belong to which [default: ontology/actions.ttl here, or the one
    /// that the program carries]
    #[arg(long, value_name = "FILE")]
    pub ontology: Option<PathBuf>,
    /// Room for the replays of failed runs in the page: more take longer to make and to send
    #[arg(long, value_name = "MB", default_value_t = 5.0, value_parser = megabytes)]
    pub replay_mb: f64,
    /// Where the history lies.
    #[command(flatten)]
    pub history: HistoryArgs,
}

fn megabytes(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(megabytes) if (0.0..=1000.0).contains(&megabytes) => Ok(megabytes),
        _ => Err("a number of megabytes from 0 to 1000 is needed, such as 5".to_owned()),
    }
}

impl ReportArgs {
    /// Whether a property was asked for by its name or IRI.
    pub(super) fn wants(&self, property: &str) -> bool {
        self.property.iter().any(|name| name == property || name == names::local(property))
    }

    /// Whether a report goes to the output stream.
    fn prints(&self) -> Result<bool, Diagnostics> {
        let page = self.html.as_deref().is_some_and(|file| file.as_os_str() == "-");
        match self.formats.printed() + usize::from(page) {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(Diagnostic::error("X051", "several reports can't share the output stream")
                .help("print one of them, and name files for the others")
                .into()),
        }
    }
}

/// Writes the reports that were asked for.
pub fn report(args: &ReportArgs) -> Result<(), Diagnostics> {
    let printed = args.prints()?;
    let history = history_dir::open(&args.history)?;
    let mut told = report_formats::write(args, &history)?;
    if let Some(file) = &args.html {
        let page = report_html::page(args, &history)?;
        if file.as_os_str() == "-" {
            output::print(&page);
        } else {
            std::fs::write(file, &page).map_err(|error| report_formats::unwritten(file, &error))?;
            told.push(format!("{} holds the report ({:.1} MB)", file.display(), page.len() as f64 / 1e6));
        }
    }
    report_formats::tell(&told, printed);
    Ok(())
}
