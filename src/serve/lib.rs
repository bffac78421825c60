//! Serves a history over HTTP: the report, which follows a campaign while it runs and replays every
//! run, a query page, and a read-only SPARQL 1.1 endpoint.
//!
//! Light queries, which can be stopped at any moment and can't exhaust memory before, are answered
//! by the server itself, within a slice of time. All others are answered by worker processes with
//! limits on time, memory and size of the answer. So no query can block or crash the server or
//! exhaust its memory. All of them read snapshots of the history, which other processes can use and
//! change meanwhile.
//!
//! Never: writes to a history, reads a file named in a request, connects to another host, or
//! answers a page of another origin.

mod accept;
mod answer;
mod body;
mod connections;
mod counts;
mod guard;
mod lanes;
mod page;
mod question;
mod reply;
mod report;
mod request;
mod server;
mod snapshot;
mod threads;
mod watch;
mod watchdog;
mod worker;

pub use answer::answer;
pub use counts::Counts;
pub use page::ExampleQuery;
pub use server::{ServeOptions, Serving, serve};
