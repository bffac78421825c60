//! One program from start to exit: introductions, runs, and its faults.

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::frame::{Wire, out_of_turn};
use crate::hello::{Joints, introduction};
use crate::log::{LineSink, LogWriter};
use crate::message::{Hello, PROTOCOL, Plain, ToProgram, kind_of, parse};
use crate::process::Process;
use actcheck_actions::ExternalFault;
use actcheck_base::printable;
use actcheck_config::Skill;
use actcheck_data::SkillLog;
use actcheck_world::World;

/// Longest program name that is kept. Unit: characters.
const LONGEST_NAME: usize = 80;
/// Limit on a program's output in one run. Unit: bytes. More than a line for each control tick of
/// an hour.
const PRINTED_LIMIT: u64 = 32 << 20;

/// A program that has introduced itself.
#[derive(Debug)]
pub struct Session {
    process: Process,
    pub wire: Wire,
    /// The robot's joints, which are the same in all runs.
    pub joints: Joints,
    /// The actions that the program performs.
    pub actions: BTreeSet<String>,
    /// Its display name.
    pub name: String,
    /// The log of the present run.
    pub log: LogWriter,
    sink: Option<LineSink>,
    timeout_secs: f64,
    /// Number of bytes printed before the run.
    printed_before: u64,
    /// Whether it is waiting for a new run or action. A busy program can't be used for another run.
    pub idle: bool,
    /// Whether it failed to acknowledge an abort; this does not count as a fault of the run.
    pub lost: bool,
    /// Whether it was notified of its fault and may exit by itself.
    refused: bool,
}

/// The rest of a program that was ended.
#[derive(Debug, Default)]
pub struct EndedSession {
    /// The last lines that it printed.
    pub last_lines: Vec<String>,
    /// The log of its last run.
    pub log: SkillLog,
}

impl Session {
    /// Starts the program of a worker and exchanges introductions. `tested` are the actions of all
    /// tests.
    ///
    /// # Errors
    /// The program can't be started, is late, uses another protocol version, violates the protocol,
    /// or performs none of the tested actions, or `stop` is set. The error includes its last output
    /// lines.
    pub fn start(
        (skill, worker): (&Skill, usize),
        (run, sink): (&str, Option<LineSink>),
        tested: &BTreeSet<String>,
        world: &World,
        clock_secs: fn() -> f64,
        stop: &AtomicBool,
    ) -> Result<Self, (ExternalFault, Vec<String>)> {
        let mut process = Process::start(skill, worker).map_err(|fault| (fault, Vec::new()))?;
        let began = clock_secs();
        let stream = process
            .accept(skill.startup_secs, clock_secs, stop)
            .map_err(|fault| (fault, process.end()))?;
        let wire = Wire::new(stream, clock_secs).map_err(|error| {
            let reason = format!("its connection can't be used: {error}");
            (
                ExternalFault {
                    late: false,
                    reason,
                },
                process.end(),
            )
        })?;
        let mut session = Self {
            process,
            wire,
            joints: Joints::of(world),
            actions: BTreeSet::new(),
            name: String::new(),
            log: LogWriter::begin(run, sink.clone(), world.time_secs()),
            sink,
            timeout_secs: (skill.startup_secs - (clock_secs() - began)).max(0.0),
            printed_before: 0,
            idle: true,
            lost: false,
            refused: false,
        };
        match session.introduce(&introduction(world, worker, skill.privileged), tested, stop) {
            Ok(()) => {
                session.timeout_secs = skill.timeout_secs;
                Ok(session)
            }
            Err(fault) => Err((fault, session.end().last_lines)),
        }
    }

    fn introduce(
        &mut self,
        ours: &impl serde::Serialize,
        tested: &BTreeSet<String>,
        stop: &AtomicBool,
    ) -> Result<(), ExternalFault> {
        let result = self.exchange_hello(ours, tested, stop);
        result.map_err(|fault| self.refuse(fault))
    }

    fn exchange_hello(
        &mut self,
        ours: &impl serde::Serialize,
        tested: &BTreeSet<String>,
        stop: &AtomicBool,
    ) -> Result<(), ExternalFault> {
        self.send(ours, &[])?;
        let range = self.wait(&|| stop.load(Ordering::Relaxed))?;
        let message = self.wire.payload(range);
        expect(&kind_of(message)?, "hello")?;
        let hello: Hello = parse("hello", message)?;
        if hello.protocol != PROTOCOL {
            let told = hello.protocol;
            return Err(broke(format!(
                "it uses protocol version {told}, but version {PROTOCOL} is required"
            )));
        }
        self.actions = hello.actions.into_iter().collect();
        if self.actions.is_disjoint(tested) {
            let list = |names: &BTreeSet<String>| {
                names
                    .iter()
                    .map(String::as_str)
                    .collect::<Vec<_>>()
                    .join(", ")
            };
            let named = if self.actions.is_empty() {
                "none".to_owned()
            } else {
                list(&self.actions)
            };
            return Err(broke(format!(
                "it performs none of the tests' actions: it offers {named}, the tests use {}",
                list(tested)
            )));
        }
        self.name = printable(&hello.name.unwrap_or_default())
            .chars()
            .take(LONGEST_NAME)
            .collect();
        Ok(())
    }

    /// The log of the run that ends. It is then empty.
    pub fn take_log(&mut self) -> SkillLog {
        self.log.print(self.process.output.take_rest());
        self.log.finish()
    }

    /// Begins a new run.
    ///
    /// # Errors
    /// A fault of the program, or `stop` is set.
    pub fn reset(
        &mut self,
        reset: &ToProgram<'_>,
        (run, time_secs): (&str, f64),
        stop: &AtomicBool,
    ) -> Result<(), ExternalFault> {
        // Lines that it printed when it was started are in the log of no run: which run started it
        // depends on the number of workers.
        self.log.print(self.process.output.take_rest());
        self.log = LogWriter::begin(run, self.sink.clone(), time_secs);
        self.printed_before = self.process.output.n_bytes();
        self.send(reset, &[])?;
        let range = self.wait(&|| stop.load(Ordering::Relaxed))?;
        let message = self.wire.payload(range);
        expect(&kind_of(message)?, "ready")?;
        parse("ready", message).map(|Plain { .. }| ())
    }

    /// Checks after the last action of a run that the program is ready for another run, by the same
    /// `reset` once more: it may have exited, or sent a message out of turn, at any time after its
    /// `end`. `hurried`: waits only briefly.
    ///
    /// # Errors
    /// A fault of the program, or `stop` is set.
    pub fn check_ready(
        &mut self,
        reset: &ToProgram<'_>,
        hurried: bool,
        stop: &AtomicBool,
    ) -> Result<(), ExternalFault> {
        let patience_secs = self.timeout_secs;
        self.timeout_secs = if hurried {
            patience_secs.min(HURRIED_SECS)
        } else {
            patience_secs
        };
        self.process.notice_descendants();
        let ready = self.reset_again(reset, stop);
        self.timeout_secs = patience_secs;
        ready
    }

    fn reset_again(
        &mut self,
        reset: &ToProgram<'_>,
        stop: &AtomicBool,
    ) -> Result<(), ExternalFault> {
        self.send(reset, &[])?;
        let range = self.wait(&|| stop.load(Ordering::Relaxed))?;
        let message = self.wire.payload(range);
        if kind_of(message)? != "ready" {
            return Err(out_of_turn());
        }
        parse("ready", message).map(|Plain { .. }| ())
    }

    /// Notifies the program that its action is over, and waits for the acknowledgement: only
    /// briefly if `hurried`, because the time of the run is over.
    ///
    /// # Errors
    /// A fault of the program.
    pub fn abort(&mut self, reason: &str, hurried: bool) -> Result<(), ExternalFault> {
        let patience_secs = self.timeout_secs;
        self.timeout_secs = if hurried {
            patience_secs.min(HURRIED_SECS)
        } else {
            patience_secs
        };
        let acknowledged = self.exchange_abort(reason);
        self.timeout_secs = patience_secs;
        acknowledged
    }

    fn exchange_abort(&mut self, reason: &str) -> Result<(), ExternalFault> {
        self.send(&ToProgram::Abort { reason }, &[])?;
        let message = self.receive()?;
        expect(&kind_of(message)?, "aborted")?;
        parse("aborted", message).map(|Plain { .. }| ())
    }

    /// Sends a message.
    ///
    /// # Errors
    /// The message can't be delivered.
    pub fn send(
        &mut self,
        message: &impl serde::Serialize,
        binaries: &[&[u8]],
    ) -> Result<(), ExternalFault> {
        let limit_secs = self.timeout_secs;
        self.wire
            .send(message, binaries, limit_secs)
            .map_err(|fault| self.cause(fault))
    }

    /// Receives the program's next message.
    ///
    /// # Errors
    /// The program is late, has exited, exceeds the output limit, or sends an invalid message.
    pub fn receive(&mut self) -> Result<&[u8], ExternalFault> {
        let range = self.wait(&|| false)?;
        Ok(self.wire.payload(range))
    }

    /// As [`Self::receive`], but also gives up once `is_over`. Returns the range of the message for
    /// [`Wire::payload`].
    ///
    /// # Errors
    /// As [`Self::receive`].
    pub fn wait(&mut self, is_over: &dyn Fn() -> bool) -> Result<Range<usize>, ExternalFault> {
        let limit_secs = self.timeout_secs;
        let (process, log, before) = (&mut self.process, &mut self.log, self.printed_before);
        let mut watch = || {
            log.print(process.output.take());
            match process.output.n_bytes() - before {
                too_much @ PRINTED_LIMIT.. => {
                    Err(broke(format!("it printed {too_much} bytes in one run")))
                }
                _ if is_over() => Err(ExternalFault {
                    late: true,
                    reason: "its run was over".to_owned(),
                }),
                _ => process.ended().map_or(Ok(()), |how| Err(broke(how))),
            }
        };
        let received = self.wire.receive(limit_secs, &mut watch);
        // What it printed before the message was printed at the same simulated time.
        self.log.print(self.process.output.take());
        received.map_err(|fault| self.cause(fault))
    }

    /// Replaces a closed connection by the exit of the process if it exits, which is more
    /// informative.
    fn cause(&mut self, fault: ExternalFault) -> ExternalFault {
        cause_of(&mut self.process, fault)
    }

    /// Notifies the program of its fault if it still reads, and returns the fault.
    pub fn refuse(&mut self, fault: ExternalFault) -> ExternalFault {
        // The run is over because of this fault; a failure to deliver the notification changes
        // nothing.
        let told = self.wire.send(
            &ToProgram::Error {
                reason: &fault.reason,
            },
            &[],
            REFUSAL_SECS,
        );
        self.refused = told.is_ok() && !fault.late;
        fault
    }

    /// Ends the program.
    pub fn end(mut self) -> EndedSession {
        // A notified program may print a more informative message before it exits.
        if self.refused {
            self.process.ends_soon();
        }
        let last_lines = self.process.end();
        EndedSession {
            last_lines,
            log: self.take_log(),
        }
    }

    /// Asks the program to exit, waits briefly, and ends it.
    pub fn bye(mut self) {
        self.process.notice_descendants();
        if self.idle && self.wire.send(&ToProgram::Bye, &[], REFUSAL_SECS).is_ok() {
            self.process.let_end();
        }
        self.process.end();
    }
}

/// Time limit for an answer if the time of the run is over. Unit: seconds.
const HURRIED_SECS: f64 = 1.0;
/// Time limit for delivering a fault notification. Unit: seconds.
const REFUSAL_SECS: f64 = 0.2;

fn cause_of(process: &mut Process, fault: ExternalFault) -> ExternalFault {
    if fault.late || !fault.reason.contains("closed the connection") {
        return fault;
    }
    process.ends_after_closing().map_or(fault, broke)
}

fn expect(kind: &str, expected: &str) -> Result<(), ExternalFault> {
    if kind == expected {
        return Ok(());
    }
    Err(broke(format!(
        "it sent `{kind}`, but `{expected}` was expected"
    )))
}

fn broke(reason: String) -> ExternalFault {
    ExternalFault {
        late: false,
        reason,
    }
}
