//! The commands in groups, as the program's help lists them, and the command tree for completions
//! and the manual.

use clap::builder::styling::{Effects, Style};
use clap::error::{ContextKind, ContextValue};
use clap::{Arg, ArgAction, Command, CommandFactory as _};

use crate::args::Arguments;
use crate::terminal;
use actcheck_base::nearest;

/// A group of commands in the program's help.
struct Group {
    title: &'static str,
    /// Names of its commands, most used first.
    commands: &'static [&'static str],
}

/// All commands except hidden ones. They are declared in the same order, which completions and the
/// manual use.
const GROUPS: [Group; 2] = [
    Group {
        title: "First steps",
        commands: &["run", "list", "why", "report", "query", "recheck", "new"],
    },
    Group {
        title: "More",
        commands: &[
            "check",
            "show",
            "replay",
            "shrink",
            "analyse",
            "compare",
            "bisect",
            "health",
            "serve",
            "explain",
            "launch",
            "merge",
            "import",
            "check-episodes",
            "cross-check",
            "relate",
            "propose-properties",
            "calibrate",
            "export",
            "check-oracles",
            "datalog",
        ],
    },
];

/// An option that many commands have. The program's help explains it once; the help of a command
/// names it.
struct CommonOption {
    name: &'static str,
    /// The name of its value, unless it is a flag.
    value: Option<&'static str>,
    help: &'static str,
}

const COMMON: [CommonOption; 5] = [
    CommonOption {
        name: "history",
        value: Some("DIR"),
        help: "Folder of the history [default: `.actcheck` beside the configuration, here, or the only one in a subfolder]",
    },
    CommonOption {
        name: "campaign",
        value: Some("ID"),
        help: "Only the runs of this campaign; by default, analyses leave out shrunk runs, repeated failed runs and cases",
    },
    CommonOption {
        name: "ontology",
        value: Some("FILE"),
        help: "The ontology with the properties, their rules and the object categories [default: ontology/actions.ttl here, \
               or the shipped one]",
    },
    CommonOption {
        name: "trust",
        value: None,
        help: "Start the programs that a case or a history names; read them first",
    },
    CommonOption {
        name: "jobs",
        value: Some("N"),
        help: "Number of workers, each with one simulation; does not affect results [default: all cores]",
    },
];

/// The program, whose help lists the commands in groups.
pub(super) fn program() -> Command {
    let heading = Style::new().effects(Effects::BOLD | Effects::UNDERLINE);
    let help = format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{}{heading}Options:{heading:#}\n{{options}}\n\n\
         {heading}Options of many commands:{heading:#}\n{}{{after-help}}",
        listed(heading),
        common_options()
    );
    let program = Arguments::command()
        .mut_subcommands(with_short_help)
        .disable_help_subcommand(false)
        .help_template(help);
    match terminal::demanded_width() {
        Some(width) => program.term_width(width),
        None => program,
    }
}

/// A command whose help names the common options instead of explaining them.
fn with_short_help(command: Command) -> Command {
    let is_common = |argument: &Arg| {
        COMMON
            .iter()
            .find(|option| argument.get_long() == Some(option.name))
    };
    let mut names: Vec<String> = Vec::new();
    for option in command.get_arguments().filter_map(is_common) {
        let value = option
            .value
            .map_or(String::new(), |value| format!(" {value}"));
        names.push(format!("--{}{value}", option.name));
    }
    let command = command
        .mut_subcommands(with_short_help)
        .mut_args(|argument| {
            let is_hidden = argument.is_hide_set() || is_common(&argument).is_some();
            argument.hide(is_hidden)
        });
    if names.is_empty() || command.is_hide_set() {
        return command;
    }
    let examples = command.get_after_help().cloned().unwrap_or_default();
    let names = names.join(", ");
    command.after_help(format!(
        "Also: {names} (see `actcheck --help`)\n\n{examples}"
    ))
}

/// The common options as clap renders them.
fn common_options() -> String {
    let list = Command::new("actcheck")
        .disable_help_flag(true)
        .max_term_width(100)
        .help_template("{options}");
    let arguments = COMMON.iter().map(|option| {
        let argument = Arg::new(option.name).long(option.name).help(option.help);
        match option.value {
            Some(value) => argument.value_name(value),
            None => argument.action(ArgAction::SetTrue),
        }
    });
    let list = match terminal::demanded_width() {
        Some(width) => list.term_width(width),
        None => list,
    };
    let text = list.args(arguments).render_help().ansi().to_string();
    text.trim_end().to_owned()
}

/// The program with all commands except the hidden ones, for completions and the manual.
pub(super) fn command_tree() -> Command {
    let all = Arguments::command();
    Command::new("actcheck")
        .version(env!("CARGO_PKG_VERSION"))
        .about(all.get_about().cloned().unwrap_or_default())
        .after_help(all.get_after_help().cloned().unwrap_or_default())
        .disable_help_subcommand(true)
        .subcommand_required(true)
        .subcommands(shown(&all).cloned())
}

/// Adds a similar command to the error about an unknown one, if clap found none.
pub(super) fn with_suggestion(mut error: clap::Error) -> clap::Error {
    let unknown = match error.get(ContextKind::InvalidSubcommand) {
        Some(ContextValue::String(name))
            if error.get(ContextKind::SuggestedSubcommand).is_none() =>
        {
            name.clone()
        }
        _ => return error,
    };
    if let Some(known) = nearest(
        &unknown,
        GROUPS.iter().flat_map(|group| group.commands).copied(),
    ) {
        error.insert(
            ContextKind::SuggestedSubcommand,
            ContextValue::Strings(vec![known.to_owned()]),
        );
    }
    error
}

fn shown(all: &Command) -> impl Iterator<Item = &Command> {
    all.get_subcommands()
        .filter(|command| !command.is_hide_set())
}

/// The list of commands as clap renders it, in the width of the terminal, with a heading before
/// each group.
fn listed(heading: Style) -> String {
    let all = Arguments::command();
    let mut list = Command::new("actcheck")
        .disable_help_subcommand(true)
        .max_term_width(100)
        .help_template("{subcommands}")
        .subcommands(
            shown(&all)
                .enumerate()
                .map(|(place, command)| command.clone().display_order(place)),
        );
    let list = list.render_help();
    let (plain, styled) = (list.to_string(), list.ansi().to_string());
    let mut text = String::new();
    for (plain, styled) in plain.lines().zip(styled.lines()) {
        let name = plain
            .split_whitespace()
            .next()
            .filter(|_| !plain.starts_with("   "));
        if let Some(group) = GROUPS
            .iter()
            .find(|group| group.commands.first().copied() == name)
        {
            let before = if text.is_empty() { "" } else { "\n" };
            text.push_str(&format!("{before}{heading}{}:{heading:#}\n", group.title));
        }
        text.push_str(&format!("{styled}\n"));
    }
    text + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A new command needs a place in the table, and the same one in the enum.
    #[test]
    fn every_command_is_in_one_group_and_declared_in_the_same_order() {
        let all = Arguments::command();
        let declared: Vec<&str> = shown(&all).map(Command::get_name).collect();
        let grouped: Vec<&str> = GROUPS
            .iter()
            .flat_map(|group| group.commands)
            .copied()
            .collect();
        assert_eq!(declared, grouped);
    }

    #[test]
    fn help_lists_every_command_below_the_heading_of_its_group() {
        let help = program().render_help().to_string();
        let mut rest = help.as_str();
        for group in GROUPS {
            rest = rest
                .split_once(&format!("\n{}:\n", group.title))
                .expect("a heading")
                .1;
            for name in group.commands {
                rest = rest
                    .split_once(&format!("  {name} "))
                    .unwrap_or_else(|| panic!("{name}:\n{help}"))
                    .1;
            }
        }
        assert!(
            rest.contains("\nOptions:\n") && rest.contains("Example:"),
            "{help}"
        );
    }

    /// The page has a row for each command, hidden ones included, and for no others.
    #[test]
    fn the_page_about_strangers_lists_every_command_once() {
        let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/strangers.md");
        let page = std::fs::read_to_string(&file).expect("the page can be read");
        let rows = page
            .lines()
            .filter_map(|line| line.strip_prefix("| `")?.split_once("` |"));
        let mut listed: Vec<String> = rows.map(|(name, _)| name.to_owned()).collect();
        let mut all: Vec<String> = Arguments::command()
            .get_subcommands()
            .map(|command| command.get_name().to_owned())
            .collect();
        listed.sort();
        all.sort();
        assert_eq!(listed, all);
    }

    /// A command that takes the option is one that the page names with it.
    #[test]
    fn commands_with_consent_are_those_of_the_page_about_strangers() {
        let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/strangers.md");
        let page = std::fs::read_to_string(&file).expect("the page can be read");
        for command in Arguments::command().get_subcommands() {
            let row = page
                .lines()
                .find(|line| line.starts_with(&format!("| `{}` |", command.get_name())));
            let has_option = command
                .get_arguments()
                .any(|argument| argument.get_long() == Some("trust"));
            let is_named =
                row.is_some_and(|row| row.contains("`--trust`") || row.contains("| as `"));
            assert!(!has_option || is_named, "{}", command.get_name());
        }
    }
}
