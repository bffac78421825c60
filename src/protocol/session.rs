//! One program from its start to its end: introductions, runs, and what it does wrong.

use std::collections::BTreeSet;

use crate::actions::OutsideFault;
use crate::config::Skill;
use crate::protocol::frame::Wire;
use crate::protocol::hello::{Joints, introduction};
use crate::protocol::message::{Hello, PROTOCOL, Plain, ToProgram, kind_of, parse};
use crate::protocol::process::Process;
use crate::world::World;

/// Longest name of a program that is kept. Unit: characters.
const LONGEST_NAME: usize = 80;
/// What a program may print in one run. Unit: bytes. A line for each control tick of an hour is less.
const PRINTED_LIMIT: u64 = 32 << 20;

/// A program that has introduced itself.
#[derive(Debug)]
pub struct Session {
    process: Process,
    pub wire: Wire,
    /// The robot's joints, which are the same in all runs.
    pub joints: Joints,
    /// The actions that it performs.
    pub actions: BTreeSet<String>,
    /// Its name for people.
    pub name: String,
    timeout_secs: f64,
    /// What it had printed before the run.
    printed_before: u64,
    /// Whether it waits for a new run or action. A busy one is of no use for another run.
    pub idle: bool,
    /// Whether it has lost the thread, by no fault that ended a run.
    pub lost: bool,
    /// Whether it was told that it did something wrong, and may end for that by itself.
    refused: bool,
}

impl Session {
    /// Starts the program of a worker and lets it introduce itself. `tested` are the actions of all tests.
    ///
    /// # Errors
    /// It can't be started, is too late, speaks another version or wrongly, or performs nothing that is tested; with what it
    /// printed last.
    pub fn start(
        (skill, worker): (&Skill, usize),
        tested: &BTreeSet<String>,
        world: &World,
        clock_secs: fn() -> f64,
    ) -> Result<Self, (OutsideFault, Vec<String>)> {
        let mut process = Process::start(skill, worker).map_err(|fault| (fault, Vec::new()))?;
        let began = clock_secs();
        let stream = process.accept(skill.startup_secs, clock_secs).map_err(|fault| (fault, process.end()))?;
        let wire = Wire::new(stream, clock_secs).map_err(|error| {
            let reason = format!("its connection can't be used: {error}");
            (OutsideFault { late: false, reason }, process.end())
        })?;
        let mut session = Self {
            process,
            wire,
            joints: Joints::of(world),
            actions: BTreeSet::new(),
            name: String::new(),
            timeout_secs: (skill.startup_secs - (clock_secs() - began)).max(0.0),
            printed_before: 0,
            idle: true,
            lost: false,
            refused: false,
        };
        match session.introduce(&introduction(world, worker, skill.privileged), tested) {
            Ok(()) => {
                session.timeout_secs = skill.timeout_secs;
                Ok(session)
            }
            Err(fault) => Err((fault, session.end())),
        }
    }

    fn introduce(&mut self, ours: &impl serde::Serialize, tested: &BTreeSet<String>) -> Result<(), OutsideFault> {
        let result = self.exchange_hello(ours, tested);
        result.map_err(|fault| self.refuse(fault))
    }

    fn exchange_hello(&mut self, ours: &impl serde::Serialize, tested: &BTreeSet<String>) -> Result<(), OutsideFault> {
        self.send(ours, &[])?;
        let message = self.receive()?;
        expect(&kind_of(message)?, "hello")?;
        let hello: Hello = parse("hello", message)?;
        if hello.protocol != PROTOCOL {
            let told = hello.protocol;
            return Err(broke(format!("it speaks version {told} of the protocol, and this is version {PROTOCOL}")));
        }
        self.actions = hello.actions.into_iter().collect();
        if self.actions.is_disjoint(tested) {
            let list = |names: &BTreeSet<String>| names.iter().map(String::as_str).collect::<Vec<_>>().join(", ");
            let named = if self.actions.is_empty() { "none".to_owned() } else { list(&self.actions) };
            return Err(broke(format!(
                "it performs none of the tests' actions: it named {named}, the tests have {}",
                list(tested)
            )));
        }
        self.name = hello.name.unwrap_or_default().chars().take(LONGEST_NAME).collect();
        Ok(())
    }

    /// A new run begins.
    ///
    /// # Errors
    /// What it does wrong.
    pub fn reset(&mut self, reset: &ToProgram<'_>) -> Result<(), OutsideFault> {
        self.printed_before = self.process.output.n_bytes();
        self.send(reset, &[])?;
        let message = self.receive()?;
        expect(&kind_of(message)?, "ready")?;
        parse("ready", message).map(|Plain { .. }| ())
    }

    /// The action is over before the program says so. What it still has to say to that is waited for.
    ///
    /// # Errors
    /// What it does wrong.
    pub fn abort(&mut self, reason: &str) -> Result<(), OutsideFault> {
        self.send(&ToProgram::Abort { reason }, &[])?;
        let message = self.receive()?;
        expect(&kind_of(message)?, "aborted")?;
        parse("aborted", message).map(|Plain { .. }| ())
    }

    /// Sends a message.
    ///
    /// # Errors
    /// It is not taken.
    pub fn send(&mut self, message: &impl serde::Serialize, binaries: &[&[u8]]) -> Result<(), OutsideFault> {
        let limit_secs = self.timeout_secs;
        self.wire.send(message, binaries, limit_secs).map_err(|fault| self.cause(fault))
    }

    /// The program's next message.
    ///
    /// # Errors
    /// It is late, has ended, prints without end, or sends what is no message.
    pub fn receive(&mut self) -> Result<&[u8], OutsideFault> {
        let limit_secs = self.timeout_secs;
        let (process, before) = (&mut self.process, self.printed_before);
        let mut watch = || match process.output.n_bytes() - before {
            too_much @ PRINTED_LIMIT.. => Err(broke(format!("it printed {too_much} bytes in one run"))),
            _ => process.ended().map_or(Ok(()), |how| Err(broke(how))),
        };
        match self.wire.receive(limit_secs, &mut watch) {
            Ok(range) => Ok(self.wire.payload(range)),
            Err(fault) => Err(cause_of(&mut self.process, fault)),
        }
    }

    /// A closed connection is often the end of the process: that says more.
    fn cause(&mut self, fault: OutsideFault) -> OutsideFault {
        cause_of(&mut self.process, fault)
    }

    /// Tells the program what it did wrong, as far as it listens. Gives the fault back.
    pub fn refuse(&mut self, fault: OutsideFault) -> OutsideFault {
        // The run is over for this fault; that the program does not hear of it changes nothing.
        let told = self.wire.send(&ToProgram::Error { reason: &fault.reason }, &[], REFUSAL_SECS);
        self.refused = told.is_ok() && !fault.late;
        fault
    }

    /// Ends the program. Gives the last lines that it printed.
    pub fn end(mut self) -> Vec<String> {
        // One that is told why it ends may print something that tells more.
        if self.refused {
            self.process.ends_soon();
        }
        self.process.end()
    }

    /// Lets the program end by itself, if it does so soon.
    pub fn bye(mut self) {
        if self.idle && self.wire.send(&ToProgram::Bye, &[], REFUSAL_SECS).is_ok() {
            self.process.let_end();
        }
        self.process.end();
    }
}

/// Time in which a program that did something wrong can take the word of it. Unit: seconds.
const REFUSAL_SECS: f64 = 0.2;

fn cause_of(process: &mut Process, fault: OutsideFault) -> OutsideFault {
    if fault.late || !fault.reason.contains("closed the connection") {
        return fault;
    }
    process.ends_after_closing().map_or(fault, broke)
}

fn expect(kind: &str, expected: &str) -> Result<(), OutsideFault> {
    if kind == expected {
        return Ok(());
    }
    Err(broke(format!("it sent `{kind}` where `{expected}` was due")))
}

fn broke(reason: String) -> OutsideFault {
    OutsideFault { late: false, reason }
}
