//! Consent to start the program that a case names: cases come from others, and a program may do anything.

use actcheck_base::Diagnostics;
use actcheck_campaign::Env;
use actcheck_config::Launcher;

/// Checks that a case can be run without consent: its program is that of the campaign `own`, or it names none.
///
/// # Errors
/// `X059` if the case names another program.
pub fn check_case(case: &Env, own: Option<&Launcher>) -> Result<(), Diagnostics> {
    let Launcher::Program(program) = &case.campaign.launcher else { return Ok(()) };
    let is_own = matches!(own, Some(Launcher::Program(own)) if program.starts_as(own));
    if is_own {
        return Ok(());
    }
    let message = format!("this case starts the program `{}`", program.text);
    let help = match own {
        Some(_) => "it is not the campaign's own program; read it, then run again with `--trust`, or remove the case",
        None => "read the program, then run the case with `--trust`; `reference` starts none",
    };
    Err(case.campaign.fault("X059", "test_launcher", message).help(help).into())
}
