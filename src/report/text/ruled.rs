//! Tables for the terminal.

use comfy_table::{ContentArrangement, TableComponent, presets};

/// Creates a terminal table with a rule below the header.
pub(crate) fn ruled() -> comfy_table::Table {
    let mut table = comfy_table::Table::new();
    table.load_preset(presets::NOTHING).set_content_arrangement(ContentArrangement::Dynamic);
    table.set_style(TableComponent::HeaderLines, '─').set_style(TableComponent::MiddleHeaderIntersections, '─');
    table
}
