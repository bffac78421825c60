//! A history over HTTP: a read-only SPARQL 1.1 endpoint, a page to ask from, and the report.
//!
//! Each query is answered by a process of its own, which is ended when its time, its memory or the room for its answer
//! is spent: so no query can hold up, fill or crash the server, and other commands have the history whenever nobody
//! asks.
//!
//! Never: writes to a history, reads a file that a request names, asks another host, or answers a page of another
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
pub use page::Example;
pub use server::{Options, Serving, serve};
