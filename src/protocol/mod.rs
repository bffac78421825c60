//! A robot's skills in another process: messages over a socket, in lockstep with simulation; the process itself, and what it does
//! wrong. `clients/PROTOCOL.md` says what goes over the wire.
//!
//! Never: lets simulated time pass that nobody asked for, shows a program the truth unless it is privileged, or leaves a process
//! behind.

mod answer;
mod command;
mod frame;
mod hello;
mod message;
mod observation;
mod output;
mod performance;
mod pool;
mod process;
mod remember;
mod session;

pub use frame::{FROM_PROGRAM_LIMIT, TO_PROGRAM_LIMIT};
pub use message::PROTOCOL;
pub use performance::{Performance, RunName};
pub use pool::Programs;
