//! Names, passwords and tokens. They are never printed.

use std::fmt;

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;

use actcheck_base::{Diagnostic, Diagnostics};

/// The credentials of requests to one server.
#[derive(Clone, Default, PartialEq, Eq)]
pub struct Credentials {
    /// The value of the header `Authorization`.
    header: Option<String>,
}

impl fmt::Debug for Credentials {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.header.is_some() {
            "Credentials(…)"
        } else {
            "Credentials(none)"
        })
    }
}

impl Credentials {
    /// A name and a password (HTTP basic authentication).
    pub fn basic(user: &str, password: &str) -> Self {
        Self {
            header: Some(format!(
                "Basic {}",
                BASE64_STANDARD.encode(format!("{user}:{password}"))
            )),
        }
    }

    /// A token (bearer authentication).
    ///
    /// # Errors
    /// `X096` it has characters that a header can't have.
    pub fn token(token: &str) -> Result<Self, Diagnostics> {
        let token = token.trim();
        if token.is_empty() || !token.bytes().all(|byte| byte.is_ascii_graphic()) {
            let fault = Diagnostic::error(
                "X096",
                "the token must consist of printable ASCII characters",
            );
            return Err(fault
                .help("set ACTCHECK_SPARQL_TOKEN to the token alone, without `Bearer`")
                .into());
        }
        Ok(Self {
            header: Some(format!("Bearer {token}")),
        })
    }

    pub(crate) fn header(&self) -> Option<&str> {
        self.header.as_deref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_those_of_the_standards_and_stay_secret() {
        let basic = Credentials::basic("Aladdin", "open sesame");
        // The example of RFC 7617.
        assert_eq!(basic.header(), Some("Basic QWxhZGRpbjpvcGVuIHNlc2FtZQ=="));
        assert_eq!(format!("{basic:?}"), "Credentials(…)");
        assert_eq!(
            Credentials::token(" abc\n").expect("it is valid").header(),
            Some("Bearer abc")
        );
        assert!(Credentials::token("a\nb").is_err() && Credentials::token("").is_err());
    }
}
