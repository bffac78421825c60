//! Failed requests, and their diagnostics.

use std::time::Duration;

use crate::Address;
use actcheck_base::{Diagnostic, Diagnostics};

/// The reason why a request has no answer.
#[derive(Debug)]
pub(crate) enum Fault {
    /// No answer came.
    Unreachable {
        why: String,
        /// Whether a later try may succeed.
        is_temporary: bool,
    },
    /// The server answered with an error.
    Refused {
        status: u16,
        words: String,
        retry_after: Option<Duration>,
    },
    /// The server named another server.
    Redirected(String),
    /// The caller stopped it.
    Stopped,
}

impl Fault {
    pub fn unreachable(why: impl Into<String>) -> Self {
        Self::Unreachable {
            why: why.into(),
            is_temporary: true,
        }
    }

    /// Adds the number of tries to the message, if there was more than one.
    pub fn after(self, tries: u32) -> Self {
        match self {
            Self::Unreachable { why, is_temporary } if tries > 1 => Self::Unreachable {
                why: format!("{why} ({tries} tries)"),
                is_temporary,
            },
            other => other,
        }
    }

    /// The diagnostic of a request to an address; `doing` completes "the server … refused …".
    pub fn into_diagnostics(self, address: &Address, doing: &str) -> Diagnostics {
        match self {
            Self::Unreachable { why, .. } => Diagnostic::error("X091", format!("{address} can't be reached: {why}"))
                .help("check the address, and that the server runs; a command that sends continues where it was")
                .into(),
            Self::Refused { status, words, .. } => {
                let words = if words.is_empty() { String::new() } else { format!(":\n{words}") };
                let message = format!("{address} refused {doing} with status {status}{words}");
                Diagnostic::error("X092", message).help(advice(status)).into()
            }
            Self::Redirected(to) => Diagnostic::error("X093", format!("{address} redirects to another server: {to}"))
                .help(
                    "name that address if you trust it: credentials and data are sent only to the server that you name",
                )
                .into(),
            Self::Stopped => {
                Diagnostic::error("X030", "interrupted").help("the same command continues where it was").into()
            }
        }
    }
}

fn advice(status: u16) -> &'static str {
    match status {
        400 => "the server does not accept this request; its message has the reason",
        401 => {
            "the server wants credentials: set ACTCHECK_SPARQL_USER and ACTCHECK_SPARQL_PASSWORD, or \
             ACTCHECK_SPARQL_TOKEN"
        }
        403 => "these credentials don't have the right to do this",
        404 | 405 | 415 | 501 => {
            "the address may be that of another service: stores often have one address for queries, one for updates and one \
             for graphs (`--protocol`)"
        }
        413 => "one run is too large for the server: raise its limit on the size of requests",
        500.. => {
            "the server failed repeatedly; its log has the reason. A command that sends continues where it was"
        }
        _ => "its message has the reason",
    }
}
