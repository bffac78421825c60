//! HTTP: sends statements to stores of others, and asks there. Copies files into folders and object
//! storage.
//!
//! Every request may be sent twice: a store that already has a statement ignores it, so that a
//! request whose answer was lost is repeated.
//!
//! Never: reads a history or an environment variable, or prints.

mod address;
mod ask;
#[cfg(feature = "object-storage")]
mod bucket;
mod client;
mod credentials;
mod fault;
mod ledger;
mod netrc;
mod place;
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
pub use place::{BucketSettings, Place};
pub use protocol::Protocol;
pub use upload::{Part, Sent, Upload, UploadOptions};
