//! A program's part in one run: it performs actions, command by command.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::answer::answer;
use crate::command::WireCommand;
use crate::message::{Ask, End, ToProgram, WireKind, kind_of, parse};
use crate::observation::Observed;
use crate::pool::{Lent, Programs};
use crate::remember::{Grasped, remember};
use crate::session::Session;
use actcheck_actions::{ActionCall, ExternalFault, ExternalSkill, Interrupt, Operator};
use actcheck_base::printable;
use actcheck_data::{ActionReport, SkillLog};
use actcheck_world::World;

/// Longest final message of an action that is kept. Unit: characters.
const LONGEST_MESSAGE: usize = 1000;

/// Longest part of the last printed line that is quoted in a fault. Unit: characters.
const LONGEST_LINE: usize = 160;

/// The data that identifies a run to a program.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RunName {
    /// The run's id.
    pub run: String,
    /// Position in the campaign, from 0.
    pub index: u64,
    /// Seed for all randomness of the program, the same in every repetition of the run.
    pub seed: u64,
}

/// A program that performs actions of one run.
#[derive(Debug)]
pub struct Performance<'a> {
    lent: Lent<'a>,
    run: RunName,
    clock_secs: fn() -> f64,
    /// Set to interrupt the campaign: the run then ends between two messages.
    stop: Arc<AtomicBool>,
    /// Whether the run ended for that reason.
    stopped: bool,
    /// Its last output lines, if it caused a fault.
    output: Option<Vec<String>>,
    /// Its log, if it was ended in this run.
    log: SkillLog,
}

impl<'a> Performance<'a> {
    /// One run with one of the campaign's programs. The program is started at the beginning of the
    /// run unless it is already running. When `stop` is set, the run ends between two messages.
    pub fn new(
        programs: &'a Programs,
        run: RunName,
        clock_secs: fn() -> f64,
        stop: Arc<AtomicBool>,
    ) -> Self {
        Self {
            lent: programs.lend(),
            run,
            clock_secs,
            stop,
            stopped: false,
            output: None,
            log: SkillLog::default(),
        }
    }

    /// Whether `stop` ended an action of the program, so that the run must not be stored.
    pub fn was_stopped(&self) -> bool {
        self.stopped
    }

    /// The last lines that the program printed. Returns `None` unless its own fault ended the run.
    pub fn output(&self) -> Option<&[String]> {
        self.output.as_deref()
    }

    /// The log of the run. It is then empty.
    pub fn take_log(&mut self) -> SkillLog {
        match &mut self.lent.worker.session {
            Some(session) => session.take_log(),
            None => std::mem::take(&mut self.log),
        }
    }

    /// The program. It is started if it is not running, or if it is still busy with an action that
    /// a crash of the simulation ended.
    fn started(&mut self, world: &World) -> Result<&mut Session, ExternalFault> {
        let stop = &*self.stop;
        let worker = &mut self.lent.worker;
        let programs = self.lent.programs;
        let session = match worker.session.take().filter(|session| session.idle) {
            Some(session) => session,
            None => Session::start(
                (&programs.skill, worker.number),
                (&self.run.run, programs.sink.clone()),
                &programs.tested,
                world,
                self.clock_secs,
                stop,
            )
            .map_err(|(fault, output)| {
                self.output = Some(output);
                fault
            })?,
        };
        Ok(worker.session.insert(session))
    }

    /// Starts the program if it is not running, and begins the run with it.
    fn reset(&mut self, world: &World) -> Result<(), ExternalFault> {
        let RunName { run, index, seed } = self.run.clone();
        let stop = Arc::clone(&self.stop);
        self.started(world).and_then(|session| {
            session.reset(
                &ToProgram::Reset {
                    run: &run,
                    index,
                    seed,
                },
                (&run, world.time_secs()),
                &stop,
            )
        })
    }

    /// Ends the program because of a fault of its own.
    fn give_up(&mut self, fault: ExternalFault) -> ExternalFault {
        if let Some(mut session) = self.lent.worker.session.take() {
            let fault = session.refuse(fault);
            let ended = session.end();
            (self.output, self.log) = (Some(ended.last_lines), ended.log);
            return self.named(fault);
        }
        self.named(fault)
    }

    fn named(&self, fault: ExternalFault) -> ExternalFault {
        let text = &self.lent.programs.skill.text;
        let last = self
            .output
            .iter()
            .flatten()
            .rev()
            .find(|line| !line.trim().is_empty());
        let printed = last.map_or_else(String::new, |line| {
            let line: String = line.trim().chars().take(LONGEST_LINE).collect();
            format!("; its last output: {line}")
        });
        // The reason quotes the program, for example names of its actions.
        let reason = format!("the program `{text}`: {}{printed}", fault.reason);
        ExternalFault {
            reason: printable(&reason).into_owned(),
            ..fault
        }
    }
}

impl ExternalSkill for Performance<'_> {
    fn begin_run(&mut self, world: &World) -> Result<(), ExternalFault> {
        let is_reused = self
            .lent
            .worker
            .session
            .as_ref()
            .is_some_and(|session| session.idle);
        let mut begun = self.reset(world);
        let is_stopped = self.stop.load(Ordering::Relaxed);
        // A program that was ready at the end of its last run and is gone now belongs to no run. If
        // its fault comes from this run, a new program shows it again.
        if is_reused && !is_stopped && begun.as_ref().is_err_and(|fault| !fault.late) {
            self.lent.worker.session.take().map(Session::end);
            begun = self.reset(world);
        }
        // A stop ends the wait; the program is not at fault.
        self.stopped |= begun.is_err() && self.stop.load(Ordering::Relaxed);
        begun.map_err(|fault| self.give_up(fault))
    }

    fn performs(&self, action: &str) -> bool {
        self.lent
            .worker
            .session
            .as_ref()
            .is_some_and(|session| session.actions.contains(action))
    }

    fn perform(
        &mut self,
        call: &ActionCall,
        robot: &mut Operator<'_>,
    ) -> Result<ActionReport, Interrupt> {
        let privileged = self.lent.programs.skill.privileged;
        let Some(session) = &mut self.lent.worker.session else {
            let reason = format!("no program is running that performs {}", call.action);
            return Err(Interrupt::ExternalSkill(ExternalFault {
                late: false,
                reason,
            }));
        };
        session.idle = false;
        session.log.begin_action(robot.time_secs());
        robot.begin(&call.action);
        let (stop, grasped) = (&*self.stop, Grasped::default());
        let mut performed = Performed {
            session,
            robot,
            privileged,
            grasped,
            stop,
        };
        let ended = performed.begin(call).and_then(|()| performed.follow());
        let outcome = match ended {
            Ok(end) => remember(call, &end, performed.grasped, performed.robot)
                .map(|()| report(end))
                .map_err(Interrupt::ExternalSkill),
            Err(interrupt) => Err(performed.stop(interrupt)),
        };
        self.stopped |= outcome == Err(Interrupt::Stopped);
        match outcome {
            Err(Interrupt::ExternalSkill(fault)) => {
                Err(Interrupt::ExternalSkill(self.give_up(fault)))
            }
            other => {
                if let Some(session) = &mut self.lent.worker.session {
                    session.idle = !session.lost;
                }
                other
            }
        }
    }

    fn end_run(&mut self, is_decided: bool) -> Result<(), ExternalFault> {
        let stop = Arc::clone(&self.stop);
        let RunName { run, index, seed } = self.run.clone();
        let session = self
            .lent
            .worker
            .session
            .as_mut()
            .filter(|session| session.idle);
        let Some(session) = session.filter(|_| !stop.load(Ordering::Relaxed)) else {
            return Ok(());
        };
        let ready = session.check_ready(
            &ToProgram::Reset {
                run: &run,
                index,
                seed,
            },
            is_decided,
            &stop,
        );
        match ready {
            Err(_) if is_decided => {
                let ended = self.lent.worker.session.take().map(Session::end);
                self.log = ended.unwrap_or_default().log;
                Ok(())
            }
            ready => {
                self.stopped |= ready.is_err() && stop.load(Ordering::Relaxed);
                ready.map_err(|fault| self.give_up(fault))
            }
        }
    }
}

fn report(end: End) -> ActionReport {
    let message = printable(&end.message)
        .chars()
        .take(LONGEST_MESSAGE)
        .collect();
    ActionReport {
        succeeded: end.succeeded,
        message,
    }
}

/// An action in progress.
struct Performed<'a, 'b> {
    session: &'a mut Session,
    robot: &'a mut Operator<'b>,
    privileged: bool,
    grasped: Grasped,
    stop: &'a AtomicBool,
}

impl Performed<'_, '_> {
    fn begin(&mut self, call: &ActionCall) -> Result<(), Interrupt> {
        let parameters = call
            .parameters
            .iter()
            .map(|(name, values)| (name.as_str(), values.as_slice()))
            .collect();
        let values = call.parameters.values().flatten();
        let kinds: BTreeMap<&str, WireKind> = values
            .filter_map(|id| {
                let kind = self.robot.kind_of(id)?;
                Some((
                    id.as_str(),
                    WireKind {
                        category: kind.category,
                        size_m: kind.size_m,
                    },
                ))
            })
            .collect();
        let measured = self.robot.observe();
        self.grasped.feel(self.robot, &measured);
        let begin = ToProgram::Begin {
            action: &call.action,
            parameters,
            kinds,
            budget_s: self.robot.budget_left_secs(),
            observation: Observed::of(self.robot, &measured, self.privileged),
        };
        self.session
            .send(&begin, &[])
            .map_err(Interrupt::ExternalSkill)
    }

    /// Executes the program's commands and requests until it ends the action.
    fn follow(&mut self) -> Result<End, Interrupt> {
        loop {
            let message = self.receive()?;
            match kind_of(message).map_err(Interrupt::ExternalSkill)?.as_str() {
                "command" => {
                    let command: WireCommand =
                        parse("command", message).map_err(Interrupt::ExternalSkill)?;
                    self.obey(command)?;
                }
                "ask" => {
                    let ask: Ask = parse("ask", message).map_err(Interrupt::ExternalSkill)?;
                    self.robot.count_request()?;
                    let (answer, bytes) = answer(&ask, self.robot);
                    let binaries: Vec<&[u8]> = bytes.iter().map(Vec::as_slice).collect();
                    let size = binaries.iter().map(|binary| binary.len()).sum();
                    self.session.log.ask(answer.record(&ask, size));
                    self.session
                        .send(&answer, &binaries)
                        .map_err(Interrupt::ExternalSkill)?;
                }
                "end" => return parse("end", message).map_err(Interrupt::ExternalSkill),
                other => {
                    let reason =
                        format!("it sent `{other}`, but `command`, `ask` or `end` was expected");
                    return Err(Interrupt::ExternalSkill(ExternalFault {
                        late: false,
                        reason,
                    }));
                }
            }
        }
    }

    /// The next message. Waiting for it ends at the limits of the run, too.
    fn receive(&mut self) -> Result<&[u8], Interrupt> {
        let (robot, stop) = (&*self.robot, self.stop);
        let limits = || match stop.load(Ordering::Relaxed) {
            true => Err(Interrupt::Stopped),
            false => robot.check_cut(),
        };
        limits()?;
        let received = self.session.wait(&|| limits().is_err());
        match received {
            Ok(range) => Ok(self.session.wire.payload(range)),
            Err(fault) => Err(limits().err().unwrap_or(Interrupt::ExternalSkill(fault))),
        }
    }

    fn obey(&mut self, command: WireCommand) -> Result<(), Interrupt> {
        let (ticks, controls) = command
            .controls(&self.session.joints)
            .map_err(Interrupt::ExternalSkill)?;
        self.robot.steer(&controls);
        let stepped = self.robot.step(ticks);
        let now = self.robot.time_secs();
        self.session
            .log
            .command(&controls, &self.session.joints.names, now);
        stepped?;
        let measured = self.robot.observe();
        self.grasped.feel(self.robot, &measured);
        let observed = Observed::of(self.robot, &measured, self.privileged);
        self.session
            .send(&observed.message(), &[])
            .map_err(Interrupt::ExternalSkill)
    }

    /// Notifies the program that its action is over. If the program does not acknowledge, it is
    /// restarted for the next run; the action still ends for its own reason.
    fn stop(&mut self, interrupt: Interrupt) -> Interrupt {
        let reason = match interrupt {
            Interrupt::ExternalSkill(_) => return interrupt,
            // The steps of an external skill are not watched for joints that are held back.
            Interrupt::Fault | Interrupt::HeldUp(_) => "fault",
            Interrupt::Budget | Interrupt::Requests(_) => "budget",
            Interrupt::Cut | Interrupt::Stopped => "stopped",
        };
        let hurried = matches!(interrupt, Interrupt::Cut | Interrupt::Stopped);
        if self.session.abort(reason, hurried).is_err() {
            self.session.lost = true;
        }
        interrupt
    }
}
