//! `actcheck merge`

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::{Value, json};

use crate::options::Format;
use crate::progress::Progress;
use crate::{output, stop};
use actcheck_analysis::Mirror;
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_history::History;
use actcheck_history::merge::{MergeOptions, MergePlan, PlannedMerge, carry_out, plan};
use actcheck_report::Table;

/// Maximum number of run numbers in a message; the JSON table has all.
const MAX_LISTED: usize = 10;

/// `actcheck merge`
#[derive(Debug, Args)]
pub struct MergeArgs {
    /// The histories to merge, in any order; they are not changed
    #[arg(value_name = "DIR", required = true)]
    pub dirs: Vec<PathBuf>,
    /// The destination: a new folder, or an existing history to add to
    #[arg(long, value_name = "DIR")]
    pub into: PathBuf,
    /// Give a campaign a new id if another campaign has the same one (not needed for parts of one
    /// campaign)
    #[arg(long)]
    pub rename: bool,
    /// Leave this campaign out: ID, or DIR#ID as messages name it; may be given several times
    #[arg(long, value_name = "CAMPAIGN")]
    pub leave_out: Vec<String>,
    /// Copy all readable data of damaged histories; lost runs are listed, and resuming their
    /// campaigns makes them again
    #[arg(long)]
    pub salvage: bool,
    /// How the resulting campaigns are printed
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: Format,
}

/// Merges histories and prints the resulting campaigns. Returns the exit code.
pub fn merge(args: &MergeArgs) -> Result<u8, Diagnostics> {
    let (sources, mut warnings) = open_all(args)?;
    let known = is_there(&args.into)
        .then(|| History::open_existing(&args.into))
        .transpose()?;
    let options = MergeOptions {
        rename: args.rename,
        leave_out: args.leave_out.clone(),
    };
    let plan = plan(&sources, known.as_ref(), &options)?;
    let into = match known {
        Some(history) => history,
        None => History::open(&args.into)?,
    };
    let progress = Progress::new(
        plan.campaigns.iter().map(|campaign| campaign.added).sum(),
        None,
    );
    let bar = progress.bar();
    let stop = stop::on_interrupt(move || {
        bar.println("stopping after these runs; merge again to continue")
    });
    let merged = carry_out(&plan, &sources, &into, &stop, || progress.judged(1, 0));
    progress.finish();
    let merged = merged?;
    if merged.interrupted {
        let fault = Diagnostic::error("X030", "interrupted");
        return Err(fault
            .help("written runs are complete; merge again to add the rest")
            .into())
        .or_else(|faults| {
            output::print_diagnostics(&faults);
            Ok(stop::INTERRUPTED)
        });
    }
    // Tables that are missing are made when they are needed.
    if let Err(faults) = Mirror::adopt(&plan, &sources, &into) {
        output::print_diagnostics(&faults);
    }
    output::print(&printed(&plan, args.format));
    plan.campaigns
        .iter()
        .filter_map(lacking)
        .for_each(|warning| warnings.push(warning));
    if !warnings.is_empty() {
        output::print_diagnostics(&warnings);
    }
    Ok(u8::from(
        plan.campaigns
            .iter()
            .any(|campaign| !campaign.missing.is_empty()),
    ))
}

/// Opens each history once for reading, except the destination: its runs need no copying. Returns
/// them with warnings about damage.
fn open_all(args: &MergeArgs) -> Result<(Vec<History>, Diagnostics), Diagnostics> {
    let same = |dir: &Path| std::fs::canonicalize(dir).unwrap_or_else(|_| dir.to_path_buf());
    let (mut seen, mut sources) = (vec![same(&args.into)], Vec::new());
    let (mut faults, mut warnings) = (Diagnostics::new(), Diagnostics::new());
    for dir in &args.dirs {
        if seen.contains(&same(dir)) {
            continue;
        }
        seen.push(same(dir));
        let opened = if args.salvage {
            History::open_to_salvage(dir)
        } else {
            History::open_to_read(dir).map(|history| (history, Vec::new()))
        };
        match opened {
            Ok((history, lost)) => {
                lost_runs(dir, &lost)
                    .into_iter()
                    .for_each(|warning| warnings.push(warning));
                sources.push(history);
            }
            Err(found) => faults.extend(found),
        }
    }
    faults.or((sources, warnings))
}

/// H007: a warning about runs that can't be read.
fn lost_runs(dir: &Path, lost: &[String]) -> Option<Diagnostic> {
    let mut named: Vec<&str> = lost.iter().take(MAX_LISTED).map(String::as_str).collect();
    if lost.len() > MAX_LISTED {
        named.push("…");
    }
    let message = format!(
        "{} runs of `{}` can't be read any more: {}",
        lost.len(),
        dir.display(),
        named.join(", ")
    );
    (!lost.is_empty()).then(|| {
        Diagnostic::warning("H007", message).help(
            "`actcheck run --resume ID --history DIR` in the merged history makes them again, with the same results",
        )
    })
}

/// Whether the folder has a version file, and so must be a history.
fn is_there(dir: &Path) -> bool {
    dir.join("VERSION").exists()
}

fn printed(plan: &MergePlan, format: Format) -> String {
    if format == Format::Json {
        return format!(
            "{:#}\n",
            Value::Array(plan.campaigns.iter().map(campaign_json).collect())
        );
    }
    let mut table = Table::new([
        "campaign", "name", "from", "runs", "added", "planned", "missing",
    ]);
    for campaign in &plan.campaigns {
        table.rows.push(vec![
            campaign.id.clone().into(),
            campaign.name.clone().into(),
            campaign.from.join(" ").into(),
            campaign.runs.into(),
            campaign.added.into(),
            campaign.planned.into(),
            campaign.missing.len().into(),
        ]);
    }
    table.render(format.into(), output::page())
}

fn campaign_json(campaign: &PlannedMerge) -> Value {
    json!({
        "campaign": campaign.id,
        "name": campaign.name,
        "from": campaign.from,
        "joined": campaign.joined,
        "runs": campaign.runs,
        "added": campaign.added,
        "planned": campaign.planned,
        "missing": campaign.missing.iter().map(|index| index + 1).collect::<Vec<u64>>(),
    })
}

/// Returns a warning if no part of a campaign has some of its runs.
fn lacking(campaign: &PlannedMerge) -> Option<Diagnostic> {
    let missing = &campaign.missing;
    let mut numbers: Vec<String> = missing
        .iter()
        .take(MAX_LISTED)
        .map(|index| (index + 1).to_string())
        .collect();
    if missing.len() > MAX_LISTED {
        numbers.push("…".to_owned());
    }
    let message = format!(
        "campaign {} lacks {} of its {} runs: {}",
        campaign.id,
        missing.len(),
        campaign.planned,
        numbers.join(", ")
    );
    (!missing.is_empty()).then(|| {
        Diagnostic::warning("X080", message).help("merge the missing parts into the same folder")
    })
}
