//! `actcheck new completions`

use clap::{Args, Command, ValueEnum};
use clap_complete::generate;
use clap_complete::shells;

use crate::output;

/// `actcheck new completions`
#[derive(Debug, Args)]
pub struct CompletionsArgs {
    /// The shell that reads the script
    #[arg(value_enum)]
    pub shell: Shell,
}

/// Shells with completions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Shell {
    /// GNU Bash
    Bash,
    /// The Z shell
    Zsh,
    /// The friendly interactive shell
    Fish,
}

/// Prints the script for a shell. `commands` is the program with all commands.
pub fn completions(args: &CompletionsArgs, mut commands: Command) {
    let mut script = Vec::new();
    match args.shell {
        Shell::Bash => generate(shells::Bash, &mut commands, "actcheck", &mut script),
        Shell::Zsh => generate(shells::Zsh, &mut commands, "actcheck", &mut script),
        Shell::Fish => generate(shells::Fish, &mut commands, "actcheck", &mut script),
    }
    output::print_bytes(&script);
}
