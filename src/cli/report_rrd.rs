//! `actcheck report --rrd`: recordings of runs for the Rerun viewer.

use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::path::Path;

use crate::analyse::Analysed;
use crate::report::ReportArgs;
use crate::{output, output_file, replayed_runs};
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_history::History;
use actcheck_report::{RecordingFault, Recordings, replay_order};

/// Writes recordings of the requested runs, as many as fit into `room` bytes. Returns the message
/// to print.
///
/// # Errors
/// The history can't be read, or the file can't be written.
pub(super) fn write(
    file: &Path,
    args: &ReportArgs,
    found: &Analysed,
    history: &History,
    room: f64,
) -> Result<Option<String>, Diagnostics> {
    let order = order(found);
    let mut recordings = Recordings::new().map_err(unrecorded)?;
    replayed_runs::for_each(
        history,
        &found.ontology,
        &order,
        |(mut run, trace, explained)| {
            // The first run is always recorded, however large it is.
            if recordings.runs() > 0 && recordings.bytes() as f64 >= room {
                return Ok(ControlFlow::Break(()));
            }
            args.keep_wanted(&mut run);
            recordings
                .add(&run, trace.as_ref(), &explained)
                .map_err(unrecorded)?;
            Ok(ControlFlow::Continue(()))
        },
    )?;
    let runs = recordings.runs();
    let bytes = recordings.finish().map_err(unrecorded)?;
    if file.as_os_str() == "-" {
        output::print_bytes(&bytes);
        return Ok(None);
    }
    output_file::write(file, &bytes)?;
    let (name, all, size) = (file.display(), order.len(), bytes.len() as f64 / 1e6);
    let more = if runs < all {
        "; a higher `--replay-mb` includes more"
    } else {
        ""
    };
    Ok(Some(format!(
        "{name} holds {runs} of {all} runs ({size:.1} MB{more}): rerun {name}"
    )))
}

/// All runs: first those that the page replays, which show every failure, then the others.
fn order(found: &Analysed) -> Vec<String> {
    let mut order = replay_order(
        &found.summary,
        found.sample.as_ref().unwrap_or(&found.table),
    );
    let known: BTreeSet<String> = order.iter().cloned().collect();
    order.extend(
        found
            .table
            .text("run")
            .texts
            .iter()
            .filter(|run| !known.contains(*run))
            .cloned(),
    );
    order
}

fn unrecorded(fault: RecordingFault) -> Diagnostics {
    Diagnostic::error("X056", format!("a run can't be recorded: {fault}"))
        .help("omit `--rrd`, and report this as a bug in actcheck")
        .into()
}
