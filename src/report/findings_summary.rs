//! What analysis found, with what texts need to name.

use crate::analysis::{
    Cascade, Condition, FailureMode, FlakyScene, Parameter, Pattern, PropertyFindings, Trend, TwoWay,
};
use crate::base::names;
use crate::report::Table;
use crate::verdict::Counts;

/// Everything that `actcheck analyse` tells.
#[derive(Debug, Clone, PartialEq)]
pub struct FindingsSummary {
    /// Where the history lies, as the user named it.
    pub history: String,
    /// How the user calls this program.
    pub program: String,
    /// Options that choose the same runs again, each with a space before it.
    pub options: String,
    /// Ids of the campaigns, by their starts.
    pub campaigns: Vec<String>,
    /// Runs in the table.
    pub runs: u64,
    /// Outcomes in the table.
    pub counts: Counts,
    /// Runs that fail alike.
    pub modes: Vec<FailureMode>,
    /// Failures that lead to later ones.
    pub cascades: Vec<Cascade>,
    /// Each property of each action.
    pub properties: Vec<PropertyReport>,
    /// Chance of a false finding that is borne.
    pub level: f64,
}

/// One property.
#[derive(Debug, Clone, PartialEq)]
pub struct PropertyReport {
    /// What its outcomes say.
    pub findings: PropertyFindings,
    /// Unit of its margin.
    pub unit: Option<String>,
    /// From campaign to campaign.
    pub trend: Trend,
    /// Scenes that went both ways.
    pub flaky: Vec<FlakyScene>,
    /// Scenes that were run more than once.
    pub repeated_scenes: u64,
    /// Heat maps.
    pub maps: Vec<TwoWay>,
}

impl PropertyReport {
    /// What people call it.
    pub fn name(&self) -> &str {
        names::local(&self.findings.property)
    }

    /// The pattern in a sentence.
    pub fn sentence(&self, pattern: &Pattern) -> String {
        let all = pattern.all;
        let elsewhere = match pattern.elsewhere {
            Some(elsewhere) => format!("; elsewhere in {}", percent(elsewhere.rate)),
            None => String::new(),
        };
        format!(
            "{} fails in {} [{:.0}–{:.0}] of {} runs with {}{elsewhere}",
            self.name(),
            percent(pattern.rate.rate),
            pattern.rate.low * 100.0,
            pattern.rate.high * 100.0,
            all.failed_in + all.passed_in,
            self.conditions(pattern)
        )
    }

    /// The conditions of a pattern, as people say them.
    pub fn conditions(&self, pattern: &Pattern) -> String {
        let parameters = &self.findings.subject.parameters;
        let told: Vec<String> =
            pattern.conditions.iter().map(|condition| told(condition, &parameters[condition.parameter()])).collect();
        match told.as_slice() {
            [first @ .., last] if !first.is_empty() => format!("{} and {last}", first.join(", ")),
            all => all.join(""),
        }
    }

    /// Ids of the runs of a pattern: the failed ones first.
    pub fn runs(&self, pattern: &Pattern) -> Vec<&str> {
        let failed = &self.findings.subject.failed;
        let of = |wanted: bool| pattern.runs.iter().filter(move |run| failed[**run] == wanted);
        of(true).chain(of(false)).map(|run| self.findings.examples[*run].run.as_str()).collect()
    }
}

/// A share, such as `71 %`; small ones with a digit behind the point.
pub(super) fn percent(share: f64) -> String {
    let share = share * 100.0;
    if share > 0.0 && share < 9.95 { format!("{share:.1} %") } else { format!("{share:.0} %") }
}

/// A condition as people say it, such as `target friction < 0.35`.
fn told(condition: &Condition, parameter: &Parameter) -> String {
    let unit = parameter.unit.as_ref().map_or_else(String::new, |unit| format!(" {unit}"));
    let bare = match &parameter.unit {
        Some(unit) => parameter.name.strip_suffix(&format!("_{unit}")).unwrap_or(&parameter.name),
        None => &parameter.name,
    };
    let name = bare.replace('_', " ");
    match condition {
        Condition::Kind { kind, .. } => {
            let thing = bare.strip_suffix("_category").or_else(|| bare.strip_suffix("_model")).unwrap_or(bare);
            format!("{} {kind}", thing.replace('_', " "))
        }
        Condition::Range { low: Some(low), high: Some(high), .. } => format!("{low} ≤ {name} < {high}{unit}"),
        Condition::Range { low: Some(low), .. } => format!("{name} ≥ {low}{unit}"),
        Condition::Range { high: Some(high), .. } => format!("{name} < {high}{unit}"),
        Condition::Range { .. } => format!("any {name}"),
    }
}

/// One row for each pattern.
pub fn findings_table(summary: &FindingsSummary) -> Table {
    let mut table = Table::new([
        "action",
        "property",
        "conditions",
        "sentence",
        "runs",
        "failed",
        "rate",
        "low",
        "high",
        "elsewhere",
        "lift",
        "wracc",
        "p",
        "q",
        "held_out_runs",
        "held_out_failed",
        "p_held_out",
        "confirmed",
        "run_ids",
    ]);
    for report in &summary.properties {
        for pattern in &report.findings.patterns.patterns {
            let held_out = pattern.held_out;
            table.rows.push(vec![
                report.findings.action.clone().into(),
                report.findings.property.clone().into(),
                report.conditions(pattern).into(),
                report.sentence(pattern).into(),
                (pattern.all.failed_in + pattern.all.passed_in).into(),
                pattern.all.failed_in.into(),
                pattern.rate.rate.into(),
                pattern.rate.low.into(),
                pattern.rate.high.into(),
                pattern.elsewhere.map(|elsewhere| elsewhere.rate).into(),
                pattern.lift.into(),
                pattern.wracc.into(),
                pattern.p.into(),
                pattern.q.into(),
                (held_out.failed_in + held_out.passed_in).into(),
                held_out.failed_in.into(),
                pattern.p_held_out.into(),
                pattern.confirmed.into(),
                report.runs(pattern).join(" ").into(),
            ]);
        }
    }
    table
}

/// One row for each cell of the heat maps.
pub fn maps_table(summary: &FindingsSummary) -> Table {
    let mut table = Table::new(["action", "property", "by", "down", "across", "runs", "failed", "rate", "low", "high"]);
    for report in &summary.properties {
        for map in &report.maps {
            for (down, cells) in map.down.iter().zip(&map.cells) {
                for (across, cell) in map.across.iter().zip(cells) {
                    table.rows.push(vec![
                        report.findings.action.clone().into(),
                        report.findings.property.clone().into(),
                        map.by.join(" ").into(),
                        down.clone().into(),
                        across.clone().into(),
                        cell.runs.into(),
                        cell.failed.into(),
                        cell.failing.map(|failing| failing.rate).into(),
                        cell.failing.map(|failing| failing.low).into(),
                        cell.failing.map(|failing| failing.high).into(),
                    ]);
                }
            }
        }
    }
    table
}
