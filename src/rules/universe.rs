//! One numbering over the terms of the rules, of a run's facts, and those that an evaluation makes.

use crate::base::{Term, TermId, Terms};

/// Terms of three origins under one numbering; the first two are shared and never copied.
#[derive(Debug)]
pub(crate) struct Universe<'a> {
    book: &'a Terms,
    run: Option<&'a Terms>,
    /// Number here of each term of the run, or [`UNKNOWN`] while nobody has asked.
    run_ids: Vec<TermId>,
    made: Terms,
}

const UNKNOWN: TermId = TermId::MAX;

impl<'a> Universe<'a> {
    /// The terms of the rules, and those of a run where there is one.
    pub(crate) fn new(book: &'a Terms, run: Option<&'a Terms>) -> Self {
        Self { book, run, run_ids: vec![UNKNOWN; run.map_or(0, Terms::len)], made: Terms::new() }
    }

    fn run_start(&self) -> usize {
        self.book.len()
    }

    fn made_start(&self) -> usize {
        self.book.len() + self.run_ids.len()
    }

    /// The number here of a term of the run.
    pub(crate) fn of_run(&mut self, id: TermId) -> TermId {
        let known = self.run_ids[id as usize];
        if known != UNKNOWN {
            return known;
        }
        let Some(run) = self.run else { return id };
        let found = self.book.id(run.term(id)).unwrap_or_else(|| number(self.run_start() + id as usize));
        self.run_ids[id as usize] = found;
        found
    }

    /// The term of a number.
    pub(crate) fn term(&self, id: TermId) -> &Term {
        let idx = id as usize;
        if idx < self.run_start() {
            return self.book.term(id);
        }
        match self.run {
            Some(run) if idx < self.made_start() => run.term(number(idx - self.run_start())),
            _ => self.made.term(number(idx - self.made_start())),
        }
    }

    /// The number of a term, if any origin has it.
    pub(crate) fn id(&self, term: &Term) -> Option<TermId> {
        self.book
            .id(term)
            .or_else(|| Some(number(self.run_start() + self.run?.id(term)? as usize)))
            .or_else(|| Some(number(self.made_start() + self.made.id(term)? as usize)))
    }

    /// The terms that the evaluation made, in the order of their numbers.
    pub(crate) fn into_made(self) -> Vec<Term> {
        (0..self.made.len()).map(|idx| self.made.term(number(idx)).clone()).collect()
    }

    /// The number of a term, given to it now if it had none.
    pub(crate) fn intern(&mut self, term: Term) -> TermId {
        if let Some(id) = self.book.id(&term) {
            return id;
        }
        if let Some(id) = self.run.and_then(|run| run.id(&term)) {
            return number(self.run_start() + id as usize);
        }
        number(self.made_start() + self.made.intern(term) as usize)
    }
}

fn number(idx: usize) -> TermId {
    TermId::try_from(idx).expect("budgets stop an evaluation long before 2^32 terms")
}
