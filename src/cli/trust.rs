//! Consent to start the program that a case or a history names: both may come from others, and a
//! program may do anything. `docs/strangers.md` lists the programs and files of each command.

use std::ffi::OsString;

use clap::Args;

use crate::output;
use actcheck_base::{Diagnostic, Diagnostics, ShellLine};
use actcheck_campaign::Env;
use actcheck_config as config;
use actcheck_config::{Launcher, Overrides, Starts};
use actcheck_history::{CampaignRecord, History};

/// The consent of a command that reads a history.
#[derive(Debug, Clone, Copy, Args)]
pub struct TrustArgs {
    /// Start the program that the history names, to simulate motion again that the history does not
    /// keep
    #[arg(long)]
    pub trust: bool,
}

/// Whether simulating runs of a campaign again starts no program. If it does, a warning names the
/// commands.
pub fn starts_none(campaign: &str, starts: &Starts) -> bool {
    let Some(commands) = in_words(starts.expansion.iter().chain(&starts.skill)) else {
        return true;
    };
    let message = format!(
        "the motion of runs of campaign {campaign} is not kept, and simulating it again would start {commands}: it is \
         left out"
    );
    let help = "read the program, then give the same command with `--trust`";
    output::print_diagnostics(&Diagnostic::warning("X059", message).help(help).into());
    false
}

/// Whether reading the appearance of the robot of a campaign starts no program. If it does, a warning
/// names the command.
pub fn expands_none(campaign: &str, starts: &Starts) -> bool {
    let Some(commands) = in_words(&starts.expansion) else {
        return true;
    };
    let message = format!(
        "pictures show the collision shapes of the robot of campaign {campaign}: reading its appearance would start \
         {commands}"
    );
    let help = "a xacro file may contain code: read it, then give the same command with `--trust`";
    output::print_diagnostics(&Diagnostic::warning("X059", message).help(help).into());
    false
}

/// Checks that a campaign of a history can be prepared again without consent: no program expands
/// its robot's file.
///
/// # Errors
/// `X059` if one does.
pub fn check_expansion(campaign: &str, starts: &Starts) -> Result<(), Diagnostics> {
    let Some(commands) = in_words(&starts.expansion) else {
        return Ok(());
    };
    let message = format!("reading the configuration of campaign {campaign} starts {commands}");
    let help = "a xacro file may contain code: read it, then give the same command with `--trust`";
    Err(Diagnostic::error("X059", message).help(help).into())
}

fn in_words<'a>(commands: impl IntoIterator<Item = &'a Vec<OsString>>) -> Option<String> {
    let lines = commands
        .into_iter()
        .map(|words| format!("`{}`", words.iter().collect::<ShellLine>()));
    let lines: Vec<String> = lines.collect();
    (!lines.is_empty()).then(|| lines.join(" and "))
}

/// Checks that a case can be run without consent: it names no program.
///
/// # Errors
/// `X059` if the case names a program.
pub fn check_case(case: &Env) -> Result<(), Diagnostics> {
    check(
        case,
        None,
        "this case",
        "read the program, then run the case with `--trust`; `reference` starts none",
    )
}

/// Checks that a campaign of a history can be run again without consent: its program is that of the
/// configuration at the path that the history names, which is not a case, or it names none.
///
/// # Errors
/// `X059` if the campaign names another program, or the configuration can't be read.
pub fn check_stored(
    env: &Env,
    history: &History,
    record: &CampaignRecord,
) -> Result<(), Diagnostics> {
    if env.campaign.launcher == Launcher::Reference {
        return Ok(());
    }
    let path = config::resolve_path(history.dir(), &record.config_path);
    let own = config::load(&path, &Overrides::default())
        .ok()
        .filter(|own| own.case.is_none());
    let help = "its configuration is not there, or names another program; name it with `--config`, or read the program and run \
                again with `--trust`";
    check(
        env,
        own.as_ref().map(|own| &own.launcher),
        "this configuration from the history",
        help,
    )
}

fn check(env: &Env, own: Option<&Launcher>, what: &str, help: &str) -> Result<(), Diagnostics> {
    match (&env.campaign.launcher, own) {
        (Launcher::Reference, _) => Ok(()),
        (Launcher::Program(program), Some(Launcher::Program(own))) if program.starts_as(own) => {
            Ok(())
        }
        (Launcher::Program(program), _) => {
            let message = format!(
                "{what} starts the program `{}`",
                program.words().iter().collect::<ShellLine>()
            );
            Err(env
                .campaign
                .fault("X059", "test_launcher", message)
                .help(help)
                .into())
        }
    }
}
