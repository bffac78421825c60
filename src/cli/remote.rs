//! The client of commands that use servers of others, and its credentials.

use std::ffi::OsString;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_remote::{Client, Credentials};

/// Environment variables with credentials.
const USER: &str = "ACTCHECK_SPARQL_USER";
const PASSWORD: &str = "ACTCHECK_SPARQL_PASSWORD";
const TOKEN: &str = "ACTCHECK_SPARQL_TOKEN";

/// Longest time for a request: until it is sent, until its answer begins, and between parts of the
/// answer.
const TIMEOUT: Duration = Duration::from_secs(120);

/// A client with the credentials of the environment. `stop` ends its waits.
///
/// # Errors
/// `X096`: the credentials are incomplete or can't be used.
pub(super) fn client(stop: &Arc<AtomicBool>) -> Result<Client, Diagnostics> {
    let credentials = from_environment(&|name| std::env::var_os(name))?;
    Ok(Client::new(credentials, TIMEOUT, Arc::clone(stop)))
}

fn from_environment(
    variable: &dyn Fn(&str) -> Option<OsString>,
) -> Result<Credentials, Diagnostics> {
    let text = |name: &str| -> Result<Option<String>, Diagnostics> {
        match variable(name).map(OsString::into_string) {
            None => Ok(None),
            Some(Ok(text)) => Ok(Some(text).filter(|text| !text.is_empty())),
            Some(Err(_)) => Err(
                Diagnostic::error("X096", format!("{name} is not valid Unicode"))
                    .help(format!("set {name} again, or unset it"))
                    .into(),
            ),
        }
    };
    match (text(TOKEN)?, text(USER)?, text(PASSWORD)?) {
        (None, None, None) => Ok(Credentials::default()),
        (Some(token), None, None) => Credentials::token(&token),
        (None, Some(user), password) if !user.contains(':') => Ok(Credentials::basic(
            &user,
            password.as_deref().unwrap_or_default(),
        )),
        (None, Some(_), _) => {
            let fault = Diagnostic::error(
                "X096",
                format!("{USER} has a colon, which separates name and password"),
            );
            Err(fault
                .help(format!(
                    "set {USER} to the name alone, and {PASSWORD} to the password"
                ))
                .into())
        }
        (None, None, Some(_)) => Err(Diagnostic::error(
            "X096",
            format!("{PASSWORD} is set, but {USER} is not"),
        )
        .help(format!("set both, or {TOKEN} alone"))
        .into()),
        (Some(_), ..) => Err(Diagnostic::error(
            "X096",
            format!("{TOKEN} is set together with a name or a password"),
        )
        .help(format!("unset {TOKEN}, or {USER} and {PASSWORD}"))
        .into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn given(set: &[(&str, &str)]) -> Result<Credentials, Diagnostics> {
        from_environment(&|name| {
            set.iter()
                .find(|(known, _)| *known == name)
                .map(|(_, value)| value.into())
        })
    }

    #[test]
    fn credentials_of_the_environment_are_complete_and_of_one_kind() {
        assert_eq!(given(&[]).expect("there are none"), Credentials::default());
        assert_eq!(
            given(&[(USER, "a"), (PASSWORD, "b")]).expect("they are complete"),
            Credentials::basic("a", "b")
        );
        assert_eq!(
            given(&[(USER, "a")]).expect("a name alone is enough"),
            Credentials::basic("a", "")
        );
        assert!(given(&[(TOKEN, "t"), (PASSWORD, "")]).is_ok());
        for wrong in [
            &[(PASSWORD, "b")][..],
            &[(TOKEN, "t"), (USER, "a")],
            &[(USER, "a:b")],
            &[(TOKEN, "a b")],
        ] {
            assert!(given(wrong).is_err(), "{wrong:?}");
        }
    }
}
