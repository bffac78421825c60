//! `actcheck health --integrity`

use std::path::Path;

use serde_json::{Value, json};

use crate::options::{Format, HistoryArgs};
use crate::{history_dir, output};
use actcheck_analysis::Mirror;
use actcheck_base::{Diagnostic, Diagnostics, ShellLine};
use actcheck_history::{Damage, History, Integrity};
use actcheck_report::Table;

/// Examines the files of a history and prints the damaged ones. Returns the exit code.
pub(super) fn examine(args: &HistoryArgs, format: Format) -> Result<u8, Diagnostics> {
    let dir = history_dir::folder(args)?;
    let (mut found, history) = History::examine(&dir).map_err(|faults| advised(faults, &dir))?;
    let damaged = Mirror::damage(&history).map_err(|faults| advised(faults, &dir))?;
    let reason = "it differs from the runs";
    found.damage.extend(damaged.iter().map(|file| Damage {
        file: file.strip_prefix(&dir).unwrap_or(file).to_path_buf(),
        run: None,
        reason: reason.to_owned(),
    }));
    output::print(&match format {
        Format::Text => output::page().set(&text(&found, &dir)),
        Format::Csv => table(&found).render(format.into(), output::page()),
        Format::Json => format!("{:#}\n", summary(&found, &dir)),
    });
    // A mirror is not written from damaged runs.
    if !damaged.is_empty() && found.damage.len() == damaged.len() {
        let told = Mirror::rebuild(&history)
            .map_or_else(|faults| faults, |_| mended(damaged.len()).into());
        output::print_diagnostics(&told);
    }
    if found.damage.is_empty() {
        return Ok(0);
    }
    if found.damage.len() > damaged.len() {
        output::print_diagnostics(&fault(&found, damaged.len(), &dir).into());
    }
    Ok(1)
}

/// Damage because of which a history can't be examined, with advice that does not name this command.
fn advised(faults: Diagnostics, dir: &Path) -> Diagnostics {
    let advised = |fault: Diagnostic| match fault.code {
        "H007" => fault.help(recovery(dir)),
        _ => fault,
    };
    faults.into_iter().map(advised).collect()
}

/// How the readable data of a damaged history are recovered.
fn recovery(dir: &Path) -> String {
    format!(
        "restore the files from a backup; or `{}` copies all readable data, and \
             `actcheck run --resume ID --history NEW` makes the lost runs again",
        ShellLine::default()
            .fixed("actcheck merge --salvage")
            .file(dir)
            .fixed("--into NEW")
    )
}

fn mended(files: usize) -> Diagnostic {
    let files = if files == 1 {
        "a file of the mirror was".to_owned()
    } else {
        format!("{files} files of the mirror were")
    };
    Diagnostic::warning(
        "A002",
        format!("{files} damaged, and the mirror was written anew from the runs"),
    )
    .help("tables and reports made before may be wrong: make them again")
}

fn fault(found: &Integrity, mirror: usize, dir: &Path) -> Diagnostic {
    let parts = found.damage.len() - mirror;
    let parts = if parts == 1 {
        "a part is".to_owned()
    } else {
        format!("{parts} parts are")
    };
    Diagnostic::error(
        "H007",
        format!(
            "the history `{}` is damaged: {parts} not as written",
            dir.display()
        ),
    )
    .help(recovery(dir))
}

fn text(found: &Integrity, dir: &Path) -> String {
    let mut text = String::new();
    for damage in &found.damage {
        let run = damage
            .run
            .as_ref()
            .map_or_else(String::new, |run| format!(" (run {run})"));
        text.push_str(&format!(
            "{}{run}: {}\n",
            dir.join(&damage.file).display(),
            damage.reason
        ));
    }
    if found.damage.is_empty() {
        text = format!(
            "{}: {} runs and mirror are intact\n",
            dir.display(),
            found.runs
        );
    }
    for file in &found.unfinished {
        text.push_str(&format!(
            "{}: its last run is not complete: a process is writing it, or was killed; `actcheck run --resume` makes it again\n",
            dir.join(file).display()
        ));
    }
    text
}

fn table(found: &Integrity) -> Table {
    let mut table = Table::new(["file", "run", "damage"]);
    let row = |damage: &Damage| {
        vec![
            damage.file.display().to_string().into(),
            damage.run.clone().into(),
            damage.reason.clone().into(),
        ]
    };
    table.rows = found.damage.iter().map(row).collect();
    table
}

fn summary(found: &Integrity, dir: &Path) -> Value {
    let damage = |damage: &Damage| json!({ "file": damage.file, "run": damage.run, "damage": damage.reason });
    json!({
        "history": dir.display().to_string(),
        "runs": found.runs,
        "damage": found.damage.iter().map(damage).collect::<Vec<_>>(),
        "unfinished": found.unfinished,
    })
}
