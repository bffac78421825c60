//! The same runs in two physics engines as flat tables.

use crate::{EngineSummary, Table};
use actcheck_analysis::Agreement;

/// One row for each property.
pub fn engines_table(summary: &EngineSummary) -> Table {
    let mut table = Table::new([
        "property",
        "agrees",
        "interval",
        "mujoco_with_itself",
        "passes_only_here",
        "passes_only_in_mujoco",
    ]);
    for own in summary.comparison.of_properties() {
        table.rows.push(vec![
            own.property.into(),
            counted(own.engines).into(),
            percent_interval(own.engines).into(),
            counted(own.itself).into(),
            own.only_here.into(),
            own.only_there.into(),
        ]);
    }
    table
}

/// One row for each setting of MuJoCo.
pub(crate) fn settings_table(summary: &EngineSummary) -> Table {
    let mut table = Table::new([
        "setting of MuJoCo",
        "agrees with actcheck",
        "with MuJoCo as exported",
    ]);
    let comparison = &summary.comparison;
    for setting in comparison.settings() {
        let [here, there] = comparison.of_setting(setting);
        let itself = (setting != comparison.plain).then(|| counted(there));
        table.rows.push(vec![
            summary.setting(setting).into(),
            counted(here).into(),
            itself.unwrap_or_default().into(),
        ]);
    }
    table
}

/// An agreement in words; empty without comparisons.
fn counted(agreement: Agreement) -> String {
    match agreement.of {
        0 => String::new(),
        of => format!("{} of {of}", agreement.agree),
    }
}

/// The 95 % interval of an agreement in words; empty without comparisons.
pub(crate) fn percent_interval(agreement: Agreement) -> String {
    agreement.interval().map_or_else(String::new, |interval| {
        format!(
            "{:.0} to {:.0} %",
            100.0 * interval.low,
            100.0 * interval.high
        )
    })
}
