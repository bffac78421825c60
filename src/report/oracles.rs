//! Results of testing the oracles: the matrix of faults × properties as text, table and JSON.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::Table;
use crate::table::ruled;
use actcheck_analysis::{LEVEL, Notice, OracleCell, OracleGap, OracleMatrix, OracleRow};
use actcheck_base::{Diagnostic, Diagnostics};

/// Result of testing the oracles of a configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct OracleSummary {
    /// The configuration, as the user named it.
    pub config: String,
    /// Seed of the scenes.
    pub seed: u64,
    /// Number of planned runs without a fault, and with each fault.
    pub planned: u64,
    /// Name and description of each fault, in row order.
    pub faults: Vec<(String, String)>,
    /// Name of each property, in column order.
    pub names: Vec<String>,
    /// The results.
    pub matrix: OracleMatrix,
    /// Gaps that the results show.
    pub gaps: Vec<OracleGap>,
}

impl OracleSummary {
    /// 0: every fault is noticed and every property notices a fault. 1: there is a gap.
    pub fn exit_code(&self) -> u8 {
        u8::from(!self.gaps.is_empty())
    }

    /// The gaps as warnings with help.
    pub fn warnings(&self) -> Diagnostics {
        let mut found = Diagnostics::new();
        for gap in &self.gaps {
            found.push(self.warning(gap));
        }
        found
    }

    fn warning(&self, gap: &OracleGap) -> Diagnostic {
        match gap {
            OracleGap::FaultUnnoticed(fault) => Diagnostic::warning(
                "V001",
                format!("no property notices the fault `{fault}`: {}", self.what(fault)),
            )
            .help("add a property that fails with this fault (`actcheck new property`), or tighten one that should"),
            OracleGap::PropertyNoticesNothing(property) => {
                let name = self.name(property);
                Diagnostic::warning("V002", format!("the property `{name}` notices no fault")).help(
                    "it passes with every fault as it does without: check whether its rule is too weak or its threshold too wide",
                )
            }
            OracleGap::FaultTooRare(fault, scenes) => Diagnostic::warning(
                "V003",
                format!("the fault `{fault}` took effect in {scenes} of {} scenes: too few to judge", self.planned),
            )
            .help("run more scenes (`--runs`), or scenes in which the action succeeds more often"),
            OracleGap::PropertyTooRare(property, passed) => {
                let (name, scenes) = (self.name(property), self.matrix.scenes);
                Diagnostic::warning(
                    "V004",
                    format!("the property `{name}` passed in {passed} of {scenes} scenes without a fault: too few to judge which faults it notices"),
                )
                .help("run more scenes (`--runs`), or scenes in which it passes more often")
            }
            OracleGap::NothingPasses(fault, scenes) => Diagnostic::warning(
                "V005",
                format!("an action passes with the fault `{fault}` in {scenes} scenes: {}", self.what(fault)),
            )
            .help("add a property that checks the action's effect on the world"),
        }
    }

    fn what(&self, fault: &str) -> &str {
        self.faults.iter().find(|(name, _)| name == fault).map_or("", |(_, what)| what)
    }

    fn name<'a>(&'a self, property: &'a str) -> &'a str {
        let place = self.matrix.properties.iter().position(|(iri, ..)| iri == property);
        place.and_then(|idx| self.names.get(idx)).map_or(property, String::as_str)
    }

    fn cells(&self) -> impl Iterator<Item = (&OracleRow, &str, &OracleCell)> {
        self.matrix
            .rows
            .iter()
            .flat_map(|row| self.names.iter().zip(&row.cells).map(move |(name, cell)| (row, name.as_str(), cell)))
    }
}

fn word(notice: Notice) -> &'static str {
    match notice {
        Notice::Noticed => "noticed",
        Notice::Unnoticed => "unnoticed",
        Notice::TooFew => "too few",
    }
}

/// Formats the matrix: how often each property failed with each fault, and a legend.
pub fn oracles_text(summary: &OracleSummary) -> String {
    let mut table = ruled();
    table.force_no_tty();
    let names = summary.names.iter().cloned();
    table.set_header(["fault".to_owned(), "took effect".to_owned()].into_iter().chain(names));
    let matrix = &summary.matrix;
    let alone = matrix.properties.iter().map(|(_, passed, failed)| format!("{failed}/{}", passed + failed));
    let scenes = format!("{} of {}", matrix.scenes, summary.planned);
    table.add_row(["(none)".to_owned(), scenes].into_iter().chain(alone));
    for row in &matrix.rows {
        let cells = row.cells.iter().map(|cell| {
            let mark = if cell.notice == Notice::Noticed { " *" } else { "" };
            format!("{}/{}{mark}", cell.failed, cell.passed + cell.failed)
        });
        let came_about = format!("{} of {}", row.came_about, row.scenes);
        table.add_row([row.fault.clone(), came_about].into_iter().chain(cells));
    }
    let mut out = format!("{table}\n\n");
    let _ = writeln!(
        out,
        "failed/decided in the scenes in which the fault took effect; * noticed: fails significantly more often than in the\n\
         same scenes without the fault (McNemar's exact test, one-sided, p ≤ {LEVEL})\n"
    );
    for (fault, what) in &summary.faults {
        let _ = writeln!(out, "  {fault}: {what}");
    }
    let _ = match summary.gaps.len() {
        0 => writeln!(out, "\nevery fault is noticed, and every property notices a fault"),
        1 => writeln!(out, "\n1 gap"),
        gaps => writeln!(out, "\n{gaps} gaps"),
    };
    out
}

/// Returns the matrix as a table with one row for each fault and property.
pub fn oracles_table(summary: &OracleSummary) -> Table {
    let mut table = Table::new([
        "fault",
        "scenes",
        "came_about",
        "property",
        "passed",
        "failed",
        "other",
        "newly_failed",
        "newly_passed",
        "p",
        "verdict",
    ]);
    for (row, name, cell) in summary.cells() {
        table.rows.push(vec![
            row.fault.clone().into(),
            row.scenes.into(),
            row.came_about.into(),
            name.into(),
            cell.passed.into(),
            cell.failed.into(),
            cell.other.into(),
            cell.newly_failed.into(),
            cell.newly_passed.into(),
            cell.p.into(),
            word(cell.notice).into(),
        ]);
    }
    table
}

/// Returns the matrix and its gaps as JSON.
pub fn oracles_json(summary: &OracleSummary) -> Value {
    let properties = summary.matrix.properties.iter().zip(&summary.names).map(
        |((iri, passed, failed), name)| json!({ "property": iri, "name": name, "passed": passed, "failed": failed }),
    );
    let faults = summary.matrix.rows.iter().zip(&summary.faults).map(|(row, (name, what))| {
        let cells = row.cells.iter().map(|cell| {
            json!({
                "property": cell.property, "passed": cell.passed, "failed": cell.failed, "other": cell.other,
                "newly_failed": cell.newly_failed, "newly_passed": cell.newly_passed, "p": cell.p,
                "verdict": word(cell.notice),
            })
        });
        json!({
            "fault": name, "what": what, "scenes": row.scenes, "came_about": row.came_about,
            "passed_anyway": row.passed_anyway, "properties": cells.collect::<Vec<_>>(),
        })
    });
    let gaps = summary.gaps.iter().map(|gap| {
        let warning = summary.warning(gap);
        json!({ "code": warning.code, "text": warning.message, "help": warning.help })
    });
    json!({
        "config": summary.config, "seed": summary.seed, "planned_runs": summary.planned, "level": LEVEL,
        "scenes": summary.matrix.scenes, "exit_code": summary.exit_code(),
        "properties": properties.collect::<Vec<_>>(),
        "faults": faults.collect::<Vec<_>>(),
        "gaps": gaps.collect::<Vec<_>>(),
    })
}
