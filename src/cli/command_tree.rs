//! The commands as completions and the manual show them.

use clap::{Command, CommandFactory as _};

use crate::Arguments;

/// The program with all commands except the hidden ones.
pub(super) fn command_tree() -> Command {
    let all = Arguments::command();
    let shown: Vec<Command> = all.get_subcommands().filter(|command| !command.is_hide_set()).cloned().collect();
    Command::new("actcheck")
        .version(env!("CARGO_PKG_VERSION"))
        .about(all.get_about().cloned().unwrap_or_default())
        .after_help(all.get_after_help().cloned().unwrap_or_default())
        .disable_help_subcommand(true)
        .subcommand_required(true)
        .subcommands(shown)
}
