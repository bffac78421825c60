//! The programs of a campaign: one for each concurrent run.

use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

use crate::log::LineSink;
use crate::session::Session;
use actcheck_config::Skill;

/// The pool of programs.
#[derive(Debug)]
pub struct Programs {
    pub(super) skill: Skill,
    /// The actions of all tests.
    pub(super) tested: BTreeSet<String>,
    /// Receives the lines that the programs print.
    pub(super) sink: Option<LineSink>,
    workers: Mutex<Workers>,
}

#[derive(Debug, Default)]
struct Workers {
    free: Vec<Worker>,
    n_workers: usize,
}

/// A slot for one program, which may not be started yet.
#[derive(Debug, Default)]
pub(super) struct Worker {
    pub number: usize,
    pub session: Option<Session>,
}

/// A worker reserved for one run; dropping it returns the worker to the pool.
#[derive(Debug)]
pub(super) struct Lent<'a> {
    pub programs: &'a Programs,
    pub worker: Worker,
}

impl Programs {
    /// An empty pool. `tested` are the actions of all tests.
    pub fn new(skill: Skill, tested: BTreeSet<String>) -> Self {
        Self {
            skill,
            tested,
            sink: None,
            workers: Mutex::default(),
        }
    }

    /// Sets the receiver of the lines that the programs print, for runs that begin from now on.
    pub fn set_line_sink(&mut self, sink: LineSink) {
        self.sink = Some(sink);
    }

    /// Takes a free worker, or creates one whose program is not started yet.
    pub(super) fn lend(&self) -> Lent<'_> {
        let mut workers = self.workers.lock().unwrap_or_else(PoisonError::into_inner);
        let worker = workers.free.pop().unwrap_or_else(|| {
            workers.n_workers += 1;
            Worker {
                number: workers.n_workers - 1,
                session: None,
            }
        });
        Lent {
            programs: self,
            worker,
        }
    }
}

impl Drop for Lent<'_> {
    fn drop(&mut self) {
        let worker = std::mem::take(&mut self.worker);
        self.programs
            .workers
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .free
            .push(worker);
    }
}

impl Drop for Programs {
    fn drop(&mut self) {
        let workers = std::mem::take(
            self.workers
                .get_mut()
                .unwrap_or_else(PoisonError::into_inner),
        );
        workers
            .free
            .into_iter()
            .filter_map(|worker| worker.session)
            .for_each(Session::bye);
    }
}
