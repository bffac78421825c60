//! HTTP: sends statements to stores of others, and asks there.
//!
//! Every request may be sent twice: a store that already has a statement ignores it, so that a
//! request whose answer was lost is repeated.
//!
//! Never: reads a history or an environment variable, or prints.

mod address;
mod ask;
mod client;
mod credentials;
mod fault;
mod ledger;
mod protocol;
mod response;
mod retry;
#[cfg(feature = "https")]
mod tls;
mod upload;

pub use address::Address;
pub use ask::{Answer, ask};
pub use client::Client;
pub use credentials::Credentials;
pub use protocol::Protocol;
pub use upload::{Part, Sent, Upload, UploadOptions};
