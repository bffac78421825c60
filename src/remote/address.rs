//! Addresses of servers.

use std::fmt;

use ureq::http::Uri;

use actcheck_base::{Diagnostic, Diagnostics};

/// An address with the scheme `http`, or `https` if the program was built with it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Address {
    uri: Uri,
}

impl Address {
    /// Reads an address.
    ///
    /// # Errors
    /// `X090` it is not an address of a server, contains credentials, or needs another build.
    pub fn parse(text: &str) -> Result<Self, Diagnostics> {
        let wrong = |why: &str, help: &str| {
            // Credentials must not get into logs.
            let shown = without_credentials(text);
            Err(Diagnostic::error(
                "X090",
                format!("`{shown}` can't be used as an address: {why}"),
            )
            .help(help)
            .into())
        };
        let example = "write it as in `http://localhost:3030/history/update`";
        let Ok(uri) = text.trim().parse::<Uri>() else {
            return wrong("it is not a URL", example);
        };
        let (Some(scheme), Some(authority)) = (uri.scheme_str(), uri.authority()) else {
            return wrong("it has no scheme or no server", example);
        };
        match scheme {
            "http" => {}
            "https" if cfg!(feature = "https") => {}
            "https" => {
                return wrong(
                    "this build has no encryption",
                    "build with `--features https`, or reach the server through a tunnel (`ssh -L`) or a local proxy",
                );
            }
            _ => return wrong("its scheme must be http or https", example),
        }
        if authority.as_str().contains('@') {
            return wrong(
                "it contains a name or a password, which other processes could read",
                "set ACTCHECK_SPARQL_USER and ACTCHECK_SPARQL_PASSWORD",
            );
        }
        if authority.host().is_empty() {
            return wrong("it names no server", example);
        }
        Ok(Self { uri })
    }

    /// The address that a redirect names, relative to this one. Returns `None` if it is not an
    /// address.
    pub(crate) fn redirected(&self, location: &str) -> Option<Self> {
        let location = location.trim().split('#').next().unwrap_or_default();
        let root = || {
            format!(
                "{}://{}",
                self.uri.scheme_str().unwrap_or("http"),
                self.server()
            )
        };
        let absolute = if location.contains("://") {
            location.to_owned()
        } else if location.starts_with("//") {
            format!("{}:{location}", self.uri.scheme_str().unwrap_or("http"))
        } else if location.starts_with('/') {
            format!("{}{location}", root())
        } else {
            let folder = self
                .uri
                .path()
                .rsplit_once('/')
                .map_or("", |(folder, _)| folder);
            format!("{}{folder}/{location}", root())
        };
        Self::parse(&absolute).ok()
    }

    /// Whether requests to another address may have the credentials of this one: it is the same
    /// server, and not less protected.
    pub(crate) fn is_trusted(&self, other: &Self) -> bool {
        let is_encrypted = |address: &Self| address.uri.scheme_str() == Some("https");
        self.host().eq_ignore_ascii_case(other.host())
            && (self.port() == other.port() || (is_encrypted(other) && !is_encrypted(self)))
            && (is_encrypted(other) || !is_encrypted(self))
    }

    /// The same address with one more parameter. Without a value, only its name is added.
    pub(crate) fn with_parameter(&self, name: &str, value: Option<&str>) -> String {
        let text = self.to_string();
        let separator = match text.rsplit_once('?') {
            None => "?",
            Some((_, "")) => "",
            Some(_) => "&",
        };
        let encoded = value
            .map(|value| form_urlencoded::byte_serialize(value.as_bytes()).collect::<String>());
        match encoded {
            // A space is `%20` in all servers, `+` only in forms.
            Some(value) => format!("{text}{separator}{name}={}", value.replace('+', "%20")),
            None => format!("{text}{separator}{name}"),
        }
    }

    /// The server's name, without its port.
    pub fn host(&self) -> &str {
        self.uri.host().unwrap_or_default()
    }

    fn port(&self) -> u16 {
        let usual = if self.uri.scheme_str() == Some("https") {
            443
        } else {
            80
        };
        self.uri.port_u16().unwrap_or(usual)
    }

    fn server(&self) -> &str {
        self.uri
            .authority()
            .map_or("", |authority| authority.as_str())
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.uri.fmt(f)
    }
}

/// An address without the part before `@`.
fn without_credentials(text: &str) -> String {
    match (text.split_once("://"), text.rsplit_once('@')) {
        (Some((scheme, _)), Some((_, rest))) => format!("{scheme}://…@{rest}"),
        (None, Some((_, rest))) => format!("…@{rest}"),
        _ => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn address(text: &str) -> Address {
        Address::parse(text).expect("it is valid")
    }

    #[test]
    fn wrong_addresses_are_refused_without_showing_passwords() {
        for wrong in [
            "",
            "history",
            "ftp://a/b",
            "http://",
            "/a/b",
            "http:///a",
            "http://a b/",
            "http://ü/",
        ] {
            assert!(Address::parse(wrong).is_err(), "{wrong}");
        }
        let refused =
            Address::parse("http://me:secret@example.org/x").expect_err("it has credentials");
        let message = refused.iter().map(ToString::to_string).collect::<String>();
        assert!(
            !message.contains("secret") && message.contains("…@example.org"),
            "{message}"
        );
        assert_eq!(
            address("http://localhost:3030/ds").to_string(),
            "http://localhost:3030/ds"
        );
    }

    #[test]
    fn https_depends_on_the_build() {
        assert_eq!(
            Address::parse("https://example.org/").is_ok(),
            cfg!(feature = "https")
        );
    }

    #[test]
    fn redirects_are_relative_to_the_address() {
        let from = address("http://a:80/x/y?z");
        for (location, to) in [
            ("http://b/c", "http://b/c"),
            ("//b/c", "http://b/c"),
            ("/c", "http://a:80/c"),
            ("c#part", "http://a:80/x/c"),
        ] {
            assert_eq!(
                from.redirected(location)
                    .map(|to| to.to_string())
                    .as_deref(),
                Some(to),
                "{location}"
            );
        }
        assert_eq!(from.redirected("ftp://b"), None);
        assert!(from.is_trusted(&address("http://A/c")));
        assert!(
            !from.is_trusted(&address("http://a:81/c")) && !from.is_trusted(&address("http://b/c"))
        );
    }

    #[test]
    fn parameters_are_encoded_and_appended() {
        assert_eq!(
            address("http://a/g").with_parameter("default", None),
            "http://a/g?default"
        );
        assert_eq!(
            address("http://a/g?b=1").with_parameter("graph", Some("http://c/d e?#")),
            "http://a/g?b=1&graph=http%3A%2F%2Fc%2Fd%20e%3F%23"
        );
    }
}
