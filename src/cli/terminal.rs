//! Width and colours of the streams, by the terminal and by the usual environment variables.

use std::ffi::OsString;
use std::io::{IsTerminal, stderr, stdout};
use std::os::fd::AsFd;

use actcheck_report::Page;
use terminal_size::{Width, terminal_size_of};

/// The page of results.
pub(super) fn of_results() -> Page {
    page_of(stdout())
}

/// The page of errors, warnings and progress.
pub(super) fn of_errors() -> Page {
    page_of(stderr())
}

/// The width that the environment demands.
pub(super) fn demanded_width() -> Option<usize> {
    width(&|name| std::env::var_os(name))
}

fn page_of(stream: impl IsTerminal + AsFd) -> Page {
    let is_terminal = stream.is_terminal();
    let own = if is_terminal {
        terminal_size_of(&stream).map(|(Width(columns), _)| usize::from(columns))
    } else {
        None
    };
    Page {
        width: demanded_width().or(own),
        colour: has_colours(is_terminal, &|name| std::env::var_os(name)),
    }
}

/// `COLUMNS`, if it is a number above zero.
fn width(variable: &dyn Fn(&str) -> Option<OsString>) -> Option<usize> {
    variable("COLUMNS")?
        .to_str()?
        .parse()
        .ok()
        .filter(|columns| *columns > 0)
}

/// Whether a stream has colours. `NO_COLOR` forbids them and `CLICOLOR_FORCE` demands them;
/// otherwise terminals have them, except with `CLICOLOR=0` or `TERM=dumb`.
fn has_colours(is_terminal: bool, variable: &dyn Fn(&str) -> Option<OsString>) -> bool {
    let is = |name: &str, value: &str| variable(name).is_some_and(|found| found == value);
    let is_set = |name: &str| variable(name).is_some_and(|found| !found.is_empty());
    if is_set("NO_COLOR") {
        return false;
    }
    if is_set("CLICOLOR_FORCE") && !is("CLICOLOR_FORCE", "0") {
        return true;
    }
    is_terminal && !is("CLICOLOR", "0") && !is("TERM", "dumb")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn colours(is_terminal: bool, set: &[(&str, &str)]) -> bool {
        has_colours(is_terminal, &|name| {
            set.iter()
                .find(|(known, _)| *known == name)
                .map(|(_, value)| OsString::from(value))
        })
    }

    #[test]
    fn colours_follow_the_terminal_unless_a_variable_decides() {
        for (is_terminal, set, coloured) in [
            (true, &[][..], true),
            (false, &[], false),
            (true, &[("NO_COLOR", "1")], false),
            (true, &[("NO_COLOR", "")], true),
            (true, &[("CLICOLOR", "0")], false),
            (true, &[("CLICOLOR", "1")], true),
            (true, &[("TERM", "dumb")], false),
            (true, &[("TERM", "xterm-256color")], true),
            (false, &[("CLICOLOR", "1")], false),
            (false, &[("CLICOLOR_FORCE", "1")], true),
            (false, &[("CLICOLOR_FORCE", "0")], false),
            (true, &[("CLICOLOR_FORCE", "1"), ("CLICOLOR", "0")], true),
            (true, &[("CLICOLOR_FORCE", "1"), ("TERM", "dumb")], true),
            (true, &[("CLICOLOR_FORCE", "1"), ("NO_COLOR", "1")], false),
        ] {
            assert_eq!(colours(is_terminal, set), coloured, "{is_terminal} {set:?}");
        }
    }

    #[test]
    fn columns_is_a_width_if_it_is_a_number_above_zero() {
        let with = |value: &str| width(&|name| (name == "COLUMNS").then(|| OsString::from(value)));
        assert_eq!(
            ["50", "0", "", "wide", "-3"].map(with),
            [Some(50), None, None, None, None]
        );
        assert_eq!(width(&|_| None), None);
    }
}
