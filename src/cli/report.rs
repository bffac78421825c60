//! `actcheck report`

use std::path::PathBuf;

use clap::Args;

use crate::base::{Diagnostic, Diagnostics};
use crate::cli::chosen::{ChosenRuns, is_meant};
use crate::cli::report_formats::{self, FormatArgs};
use crate::cli::{output, report_html, written};

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
    /// Room for the replays of failed runs in the page: more take longer to make and to send
    #[arg(long, value_name = "MB", default_value_t = 5.0, value_parser = megabytes)]
    pub replay_mb: f64,
    /// Of which runs, and where the history lies.
    #[command(flatten)]
    pub chosen: ChosenRuns,
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
        self.property.iter().any(|name| is_meant(property, name))
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
    let history = args.chosen.open()?;
    let mut told = report_formats::write(args, &history)?;
    if let Some(file) = &args.html {
        let page = report_html::page(args, &history)?;
        if file.as_os_str() == "-" {
            output::print(&page);
        } else {
            written::write(file, &page)?;
            told.push(format!("{} holds the report ({:.1} MB)", file.display(), page.len() as f64 / 1e6));
        }
    }
    report_formats::tell(&told, printed);
    Ok(())
}
