//! Tables for the terminal.

use comfy_table::{ColumnConstraint, ContentArrangement, Table, TableComponent, Width, presets};

/// Width between the contents of two columns: one space of padding each, and one between.
const GAP: usize = 3;
/// Padding left of the first column and right of the last one.
const EDGES: usize = 2;

/// Creates a terminal table with a rule below the header.
pub(crate) fn ruled() -> Table {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING).set_content_arrangement(ContentArrangement::Dynamic);
    table.set_style(TableComponent::HeaderLines, '─').set_style(TableComponent::MiddleHeaderIntersections, '─');
    table
}

/// Returns the width of the terminal, or `None` if standard output is none.
pub(crate) fn terminal_width() -> Option<usize> {
    Table::new().width().map(usize::from)
}

/// Fits a table into a width without breaking a word or a number: hides the columns in `expendable`, the first one first,
/// until the others fit. Returns the names of the hidden columns, or `None` if the table is too wide without them, too.
pub(crate) fn fit(table: &mut Table, width: usize, expendable: &[&str]) -> Option<Vec<String>> {
    let texts = contents(table);
    let words = |column: &Vec<String>| {
        let words = column.iter().flat_map(|text| text.split_whitespace());
        words.map(|word| word.chars().count()).max().unwrap_or(0)
    };
    let least: Vec<usize> = texts.iter().map(words).collect();
    let mut shown: Vec<usize> = (0..texts.len()).collect();
    let mut hidden = Vec::new();
    let mut names = expendable.iter();
    let needed = |shown: &[usize]| {
        shown.iter().map(|column| least[*column]).sum::<usize>() + GAP * shown.len().saturating_sub(1) + EDGES
    };
    while needed(&shown) > width {
        let name = names.next()?;
        if let Some(place) = shown.iter().position(|column| texts[*column].first().is_some_and(|title| title == name)) {
            shown.remove(place);
            hidden.push((*name).to_owned());
        }
    }
    for (column, least) in table.column_iter_mut().zip(least) {
        column.set_constraint(if shown.contains(&column.index) {
            ColumnConstraint::LowerBoundary(Width::Fixed(u16::try_from(least + 2).unwrap_or(u16::MAX)))
        } else {
            ColumnConstraint::Hidden
        });
    }
    table.set_width(u16::try_from(width).unwrap_or(u16::MAX));
    Some(hidden)
}

/// Returns the texts of each column, the header first.
fn contents(table: &mut Table) -> Vec<Vec<String>> {
    let mut columns: Vec<Vec<String>> = vec![Vec::new(); table.column_count()];
    for row in table.header().into_iter().chain(table.row_iter()) {
        for (column, cell) in columns.iter_mut().zip(row.cell_iter()) {
            column.push(cell.content());
        }
    }
    columns
}

/// A line about columns that were hidden; empty if there are none.
pub(crate) fn hidden_columns(hidden: &[String]) -> String {
    match hidden {
        [] => String::new(),
        hidden => format!(" (not shown at this width: {}; `--format csv` has all columns)\n", hidden.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Table {
        let mut table = ruled();
        table.set_header(["property", "label", "file", "passed"]);
        table.add_row(["CloseObject", "the object is close to the gripper", "rules/close_object.rls", "75 % [60–86]"]);
        table.add_row(["ObjectReleased", "the hand is empty", "rules/object_released.rls", "100 %"]);
        table
    }

    #[test]
    fn a_table_fits_every_width_without_broken_words() {
        for width in [40, 60, 80, 120, 200] {
            let mut table = sample();
            let hidden = fit(&mut table, width, &["file", "label"]).expect("two columns fit");
            let text = table.to_string();
            assert!(text.lines().all(|line| line.trim_end().chars().count() <= width), "{width}\n{text}");
            for word in ["CloseObject", "ObjectReleased", "[60–86]"] {
                assert!(text.contains(word), "{word} at {width}\n{text}");
            }
            assert_eq!(hidden.contains(&"file".to_owned()), width < 63, "{hidden:?} at {width}\n{text}");
            assert_eq!(text.contains("close_object.rls"), width >= 63, "{text}");
        }
    }

    #[test]
    fn a_table_that_cannot_fit_is_left_to_others() {
        assert_eq!(fit(&mut sample(), 20, &["file"]), None);
    }
}
