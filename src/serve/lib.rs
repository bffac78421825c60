//! Serves a history over HTTP: a read-only SPARQL 1.1 endpoint, a query page, and the report.
//!
//! Each query is answered by a process of its own with limits on time, memory and size of the answer. So no query can
//! block or crash the server or exhaust its memory, and other commands can use the history between queries.
//!
//! Never: writes to a history, reads a file named in a request, connects to another host, or answers a page of another
//! origin.

mod accept;
mod answer;
mod guard;
mod page;
mod question;
mod report;
mod server;
mod watch;
mod worker;

pub use answer::answer;
pub use page::ExampleQuery;
pub use server::{ServeOptions, Serving, serve};
