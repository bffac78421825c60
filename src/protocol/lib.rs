//! Robot skills in another process: messages over a socket, in lockstep with the simulation;
//! management of the process, and handling of its faults. `clients/PROTOCOL.md` specifies the
//! messages.
//!
//! Never: advances simulated time unless the program commands it, shows ground truth to an
//! unprivileged program, or leaves a process behind.

mod answer;
mod command;
mod frame;
#[cfg(test)]
mod fuzz;
mod hello;
mod log;
mod message;
#[cfg(test)]
#[path = "../../tests/support/mutations.rs"]
mod mutations;
mod observation;
mod output;
mod performance;
mod pool;
mod process;
mod remember;
mod session;

pub use log::LineSink;
pub use message::PROTOCOL;
pub use performance::{Performance, RunName};
pub use pool::Programs;
