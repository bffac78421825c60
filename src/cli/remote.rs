//! Options of commands that use servers, and their credentials.

use std::ffi::OsString;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use clap::Args;

use crate::options::duration;
use actcheck_base::{Diagnostic, Diagnostics, read_regular};
use actcheck_remote::{Address, Client, Credentials};

/// Environment variables with credentials.
const USER: &str = "ACTCHECK_SPARQL_USER";
const PASSWORD: &str = "ACTCHECK_SPARQL_PASSWORD";
const TOKEN: &str = "ACTCHECK_SPARQL_TOKEN";

/// Time limit and credentials of requests.
#[derive(Debug, Args)]
pub struct RemoteArgs {
    /// Longest time for a request: until it is sent, until its answer begins, and between parts of
    /// the answer. Requests that fail for a reason that may pass are repeated for about 40 seconds
    #[arg(long, value_name = "DURATION", value_parser = duration, default_value = "2m")]
    pub timeout: f64,
    /// Take name and password from the file `~/.netrc`, or the one that NETRC names
    #[arg(long)]
    pub netrc: bool,
}

impl RemoteArgs {
    /// A client of the server at an address. `stop` ends its waits.
    ///
    /// # Errors
    /// `X096`: the credentials are incomplete or can't be read.
    pub(super) fn client(
        &self,
        address: &Address,
        stop: &Arc<AtomicBool>,
    ) -> Result<Client, Diagnostics> {
        let credentials = if self.netrc {
            from_netrc(address, &|name| std::env::var_os(name))?
        } else {
            from_environment(&|name| std::env::var_os(name))?
        };
        Ok(Client::new(
            credentials,
            Duration::from_secs_f64(self.timeout),
            Arc::clone(stop),
        ))
    }
}

/// Longest netrc file. Unit: bytes.
const LONGEST_NETRC: u64 = 1 << 20;

fn from_netrc(
    address: &Address,
    variable: &dyn Fn(&str) -> Option<OsString>,
) -> Result<Credentials, Diagnostics> {
    let home = || variable("HOME").map(|home| PathBuf::from(home).join(".netrc"));
    let Some(file) = variable("NETRC").map(PathBuf::from).or_else(home) else {
        return Err(Diagnostic::error(
            "X096",
            "there is no netrc file: neither NETRC nor HOME is set",
        )
        .help("set NETRC to the file's path")
        .into());
    };
    let text = read_regular(&file, LONGEST_NETRC)
        .and_then(|text| String::from_utf8(text).map_err(std::io::Error::other));
    let text = text.map_err(|error| {
        Diagnostic::error("X096", format!("{} can't be read: {error}", file.display()))
            .help("write `machine SERVER login NAME password PASSWORD` into it, or set NETRC to another file")
    })?;
    Ok(Credentials::from_netrc(&text, address))
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

    #[test]
    fn a_netrc_file_is_named_or_in_the_home_folder() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let file = folder.path().join(".netrc");
        std::fs::write(&file, "machine a login b password c").expect("it can be written");
        let address = Address::parse("http://a/x").expect("it is valid");
        let of = |name: &'static str, path: &std::path::Path| {
            let path = path.to_path_buf();
            from_netrc(&address, &move |asked| {
                (asked == name).then(|| path.clone().into())
            })
        };
        assert_eq!(
            of("NETRC", &file).expect("it exists"),
            Credentials::basic("b", "c")
        );
        assert_eq!(
            of("HOME", folder.path()).expect("it exists"),
            Credentials::basic("b", "c")
        );
        assert!(of("NETRC", folder.path()).is_err() && of("OTHER", &file).is_err());
    }
}
