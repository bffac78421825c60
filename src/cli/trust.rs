//! Consent to start the program that a case or a history names: both may come from others, and a program may do
//! anything.

use actcheck_base::Diagnostics;
use actcheck_campaign::Env;
use actcheck_config as config;
use actcheck_config::{Launcher, Overrides};
use actcheck_history::{CampaignRecord, History};

/// Checks that a case can be run without consent: it names no program.
///
/// # Errors
/// `X059` if the case names a program.
pub fn check_case(case: &Env) -> Result<(), Diagnostics> {
    check(case, None, "this case", "read the program, then run the case with `--trust`; `reference` starts none")
}

/// Checks that a campaign of a history can be run again without consent: its program is that of the configuration at
/// the path that the history names, which is not a case, or it names none.
///
/// # Errors
/// `X059` if the campaign names another program, or the configuration can't be read.
pub fn check_stored(env: &Env, history: &History, record: &CampaignRecord) -> Result<(), Diagnostics> {
    if env.campaign.launcher == Launcher::Reference {
        return Ok(());
    }
    let path = config::resolve_path(history.dir(), &record.config_path);
    let own = config::load(&path, &Overrides::default()).ok().filter(|own| own.case.is_none());
    let help = "its configuration is not there, or names another program; name it with `--config`, or read the program and run \
                again with `--trust`";
    check(env, own.as_ref().map(|own| &own.launcher), "this configuration from the history", help)
}

fn check(env: &Env, own: Option<&Launcher>, what: &str, help: &str) -> Result<(), Diagnostics> {
    match (&env.campaign.launcher, own) {
        (Launcher::Reference, _) => Ok(()),
        (Launcher::Program(program), Some(Launcher::Program(own))) if program.starts_as(own) => Ok(()),
        (Launcher::Program(program), _) => {
            let message = format!("{what} starts the program `{}`", program.text);
            Err(env.campaign.fault("X059", "test_launcher", message).help(help).into())
        }
    }
}
