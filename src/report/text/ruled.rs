//! Tables for the terminal.

use comfy_table::{ColumnConstraint, ContentArrangement, Table, TableComponent, Width, presets};

use crate::text::Page;

/// Width between the contents of two columns: one space of padding each, and one between.
const GAP: usize = 3;
/// Width of the padding of a column.
const PADDING: u16 = 2;
/// Padding left of the first column and right of the last one.
const EDGES: usize = 2;
/// Longest cell that stays in one line if columns can be hidden instead: a pass rate with its
/// interval and counts. Unit: characters.
const SHORT_CELL: usize = 26;

/// Creates a terminal table with a rule below the header.
pub(crate) fn ruled() -> Table {
    let mut table = Table::new();
    // The page decides about width and colours.
    table.force_no_tty();
    table
        .load_preset(presets::NOTHING)
        .set_content_arrangement(ContentArrangement::Dynamic);
    table
        .set_style(TableComponent::HeaderLines, '─')
        .set_style(TableComponent::MiddleHeaderIntersections, '─');
    table
}

/// Formats a table for a page: hides the columns in `expendable` that don't fit, the first one
/// first, and stacks the values if the others don't fit either. Ends with a line feed.
pub(crate) fn fitted(mut table: Table, page: Page, expendable: &[&str]) -> String {
    match fit(&mut table, page, expendable) {
        Some(hidden) if hidden.is_empty() => format!("{table}\n"),
        Some(hidden) => format!(
            "{table}\n (not shown at this width: {})\n",
            hidden.join(", ")
        ),
        None => stacked(&contents(&mut table)),
    }
}

/// Gives the columns of tables that are printed below each other the same widths.
pub(crate) fn align(tables: &mut [Table]) {
    let mut widths: Vec<u16> = Vec::new();
    for content in tables.iter().map(Table::column_max_content_widths) {
        widths.resize(widths.len().max(content.len()), 0);
        widths
            .iter_mut()
            .zip(content)
            .for_each(|(width, content)| *width = content.max(*width));
    }
    for table in tables {
        for (column, width) in table.column_iter_mut().zip(&widths) {
            column.set_constraint(ColumnConstraint::LowerBoundary(Width::Fixed(
                width.saturating_add(PADDING),
            )));
        }
    }
}

/// Fits a table into a page without breaking a word or a number: hides the columns in `expendable`,
/// the first one first, until the others fit. Returns the names of the hidden columns, or `None` if
/// the table is too wide without them, too.
///
/// Columns are hidden rather than breaking a short cell, such as a rate with its interval; only if
/// that isn't enough, short cells are broken between their words.
pub(crate) fn fit(table: &mut Table, page: Page, expendable: &[&str]) -> Option<Vec<String>> {
    if page.colour {
        table.enforce_styling();
    }
    let Some(width) = page.width else {
        return Some(Vec::new());
    };
    let texts = contents(table);
    let (least, shown) = [SHORT_CELL, 0].into_iter().find_map(|short| {
        let least: Vec<usize> = texts
            .iter()
            .map(|column| least_width(column, short))
            .collect();
        shown_columns(&texts, &least, width, expendable).map(|shown| (least, shown))
    })?;
    for (column, least) in table.column_iter_mut().zip(least) {
        column.set_constraint(if shown.contains(&column.index) {
            ColumnConstraint::LowerBoundary(Width::Fixed(
                u16::try_from(least)
                    .unwrap_or(u16::MAX)
                    .saturating_add(PADDING),
            ))
        } else {
            ColumnConstraint::Hidden
        });
    }
    table.set_width(u16::try_from(width).unwrap_or(u16::MAX));
    let hidden = |name: &&&str| {
        texts
            .iter()
            .enumerate()
            .any(|(idx, text)| !shown.contains(&idx) && text[0] == **name)
    };
    Some(
        expendable
            .iter()
            .filter(hidden)
            .map(|name| (*name).to_owned())
            .collect(),
    )
}

/// Least width of a column, the header of which is broken between words, like the cells that are
/// longer than `short`.
fn least_width(column: &[String], short: usize) -> usize {
    let word = |text: &String| {
        text.split_whitespace()
            .map(|word| word.chars().count())
            .max()
            .unwrap_or(0)
    };
    let cell = |text: &String| {
        Some(text.chars().count())
            .filter(|width| *width <= short)
            .unwrap_or_else(|| word(text))
    };
    column
        .iter()
        .take(1)
        .map(word)
        .chain(column.iter().skip(1).map(cell))
        .max()
        .unwrap_or(0)
}

/// The indices of the columns that fit into a width without as few of the expendable columns as
/// possible. Returns `None` if the others don't fit.
fn shown_columns(
    texts: &[Vec<String>],
    least: &[usize],
    width: usize,
    expendable: &[&str],
) -> Option<Vec<usize>> {
    let mut shown: Vec<usize> = (0..texts.len()).collect();
    let mut names = expendable.iter();
    let needed = |shown: &[usize]| {
        shown.iter().map(|column| least[*column]).sum::<usize>()
            + GAP * shown.len().saturating_sub(1)
            + EDGES
    };
    while needed(&shown) > width {
        let name = names.next()?;
        shown.retain(|column| texts[*column].first().is_none_or(|title| title != name));
    }
    Some(shown)
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

/// One line for each value that is not empty, after the name of its column; rows are separated by
/// an empty line.
///
/// `columns` are the texts of each column, the header first.
pub(crate) fn stacked(columns: &[Vec<String>]) -> String {
    let longest = columns
        .iter()
        .filter_map(|column| column.first())
        .map(|name| name.chars().count())
        .max()
        .unwrap_or(0);
    let rows = columns.iter().map(Vec::len).max().unwrap_or(0);
    let value = |column: &Vec<String>, row: usize| -> Option<String> {
        let (name, value) = (column.first()?, column.get(row)?);
        (!value.is_empty()).then(|| format!(" {name:longest$}   {value}\n"))
    };
    let row = |row: usize| {
        columns
            .iter()
            .filter_map(|column| value(column, row))
            .collect::<String>()
    };
    (1..rows).map(row).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Table {
        let mut table = ruled();
        table.set_header(["property", "label", "file", "passed"]);
        table.add_row([
            "CloseObject",
            "the object is close to the gripper",
            "rules/close_object.rls",
            "75 % [60–86]",
        ]);
        table.add_row([
            "ObjectReleased",
            "the hand is empty",
            "rules/object_released.rls",
            "100 %",
        ]);
        table
    }

    fn page(width: usize) -> Page {
        Page {
            width: Some(width),
            colour: false,
        }
    }

    #[test]
    fn a_table_fits_every_width_without_broken_words() {
        for width in [40, 60, 80, 120, 200] {
            let mut table = sample();
            let hidden = fit(&mut table, page(width), &["file", "label"]).expect("two columns fit");
            let text = table.to_string();
            assert!(
                text.lines()
                    .all(|line| line.trim_end().chars().count() <= width),
                "{width}\n{text}"
            );
            for word in ["CloseObject", "ObjectReleased", "[60–86]"] {
                assert!(text.contains(word), "{word} at {width}\n{text}");
            }
            assert_eq!(
                hidden.contains(&"file".to_owned()),
                width < 63,
                "{hidden:?} at {width}\n{text}"
            );
            assert_eq!(text.contains("close_object.rls"), width >= 63, "{text}");
        }
    }

    #[test]
    fn a_table_that_cannot_fit_is_stacked() {
        assert_eq!(fit(&mut sample(), page(20), &["file"]), None);
        let text = fitted(sample(), page(20), &["file"]);
        let first = " property   CloseObject\n label      the object is close to the gripper\n file       rules/close_object.rls\n";
        assert!(text.starts_with(first), "{text}");
        assert_eq!(text.matches("\n\n").count(), 1, "{text}");
    }

    #[test]
    fn hidden_columns_are_named_and_only_terminals_hide_them() {
        let text = fitted(sample(), page(40), &["file", "label"]);
        assert!(
            text.ends_with("\n (not shown at this width: file, label)\n"),
            "{text}"
        );
        assert!(fitted(sample(), Page::default(), &["file"]).contains("close_object.rls"));
    }
}
