//! Common term ids for the rules, the facts of a run, and the terms created by an evaluation.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;

use crate::model::values::text_len;
use crate::watch::{Stop, Watch};
use actcheck_base::{ActionFacts, Course, Term, TermId, Terms};

/// The IRI of a quantity over time, and the IRIs of the things it is of.
type QuantityKey = (String, Vec<String>);

/// Terms of three origins with common ids. The terms of the rules and of the run are borrowed, not
/// copied.
#[derive(Debug)]
pub(crate) struct Universe<'a> {
    book: &'a Terms,
    run: Option<&'a Terms>,
    course: Option<&'a Course>,
    /// Quantities over time that were computed so far; `None` if they are not known. Several
    /// properties read the same ones.
    quantities: RefCell<BTreeMap<QuantityKey, Option<Rc<Vec<f64>>>>>,
    /// Common id of each term of the run, or [`UNKNOWN`] until first used.
    run_ids: Vec<TermId>,
    created: Terms,
    /// Memory of the created terms. Unit: bytes.
    created_bytes: usize,
    /// The label of the next new thing, if no fact has it.
    next_label: u64,
}

/// Memory of a created term without its text: two copies of the term and its entry in the table.
/// Unit: bytes.
const TERM_BYTES: usize = 2 * size_of::<Term>() + 48;

const UNKNOWN: TermId = TermId::MAX;

impl<'a> Universe<'a> {
    /// Creates a universe of the rules' terms and, optionally, the terms of a run.
    pub(crate) fn new(book: &'a Terms, run: Option<&'a Terms>) -> Self {
        let run_ids = vec![UNKNOWN; run.map_or(0, Terms::len)];
        Self {
            book,
            run,
            course: None,
            quantities: RefCell::default(),
            run_ids,
            created: Terms::new(),
            created_bytes: 0,
            next_label: 0,
        }
    }

    /// Creates the universe of the rules' terms and the facts of an action.
    pub(crate) fn of_action(book: &'a Terms, facts: &ActionFacts<'a>) -> Self {
        Self {
            course: facts.course,
            ..Self::new(book, Some(facts.terms))
        }
    }

    /// Returns the quantities of the action over time; `None` if they were not recorded.
    pub(crate) fn course(&self) -> Option<&'a Course> {
        self.course
    }

    /// Returns a quantity at each sample, which is computed once.
    pub(crate) fn quantity(
        &self,
        iri: &str,
        things: Vec<String>,
        compute: impl FnOnce(&[String]) -> Option<Vec<f64>>,
    ) -> Option<Rc<Vec<f64>>> {
        let key = (iri.to_owned(), things);
        if let Some(known) = self.quantities.borrow().get(&key) {
            return known.clone();
        }
        let values = compute(&key.1).map(Rc::new);
        self.quantities.borrow_mut().insert(key, values.clone());
        values
    }

    fn run_start(&self) -> usize {
        self.book.len()
    }

    fn created_start(&self) -> usize {
        self.book.len() + self.run_ids.len()
    }

    /// Returns the common id of a term of the run.
    pub(crate) fn of_run(&mut self, id: TermId) -> TermId {
        let known = self.run_ids[id as usize];
        if known != UNKNOWN {
            return known;
        }
        let Some(run) = self.run else { return id };
        let found = self
            .book
            .id(run.term(id))
            .unwrap_or_else(|| number(self.run_start() + id as usize));
        self.run_ids[id as usize] = found;
        found
    }

    /// Returns the term of a common id.
    pub(crate) fn term(&self, id: TermId) -> &Term {
        let idx = id as usize;
        if idx < self.run_start() {
            return self.book.term(id);
        }
        match self.run {
            Some(run) if idx < self.created_start() => run.term(number(idx - self.run_start())),
            _ => self.created.term(number(idx - self.created_start())),
        }
    }

    /// Returns the common id of a term, or `None` if no origin contains it.
    pub(crate) fn id(&self, term: &Term) -> Option<TermId> {
        self.book
            .id(term)
            .or_else(|| Some(number(self.run_start() + self.run?.id(term)? as usize)))
            .or_else(|| {
                Some(number(
                    self.created_start() + self.created.id(term)? as usize,
                ))
            })
    }

    /// Returns the terms created by the evaluation, ordered by id.
    pub(crate) fn into_created(self) -> Vec<Term> {
        (0..self.created.len())
            .map(|idx| self.created.term(number(idx)).clone())
            .collect()
    }

    /// Returns the common id of a term, adding the term if it is new.
    pub(crate) fn intern(&mut self, term: Term) -> TermId {
        if let Some(id) = self.book.id(&term) {
            return id;
        }
        if let Some(id) = self.run.and_then(|run| run.id(&term)) {
            return number(self.run_start() + id as usize);
        }
        let (before, bytes) = (self.created.len(), TERM_BYTES + text_len(&term));
        let id = self.created.intern(term);
        if self.created.len() > before {
            self.created_bytes += bytes;
        }
        number(self.created_start() + id as usize)
    }

    /// Returns the common id of a computed term, and accounts for its memory if it is new.
    pub(crate) fn create(&mut self, term: Term, watch: &Watch) -> Result<TermId, Stop> {
        let before = self.created_bytes;
        let id = self.intern(term);
        watch.hold(self.created_bytes - before)?;
        Ok(id)
    }

    /// Returns the id of a new thing: a blank node that no fact and no rule names.
    pub(crate) fn new_thing(&mut self, watch: &Watch) -> Result<TermId, Stop> {
        loop {
            let term = Term::Blank(self.next_label.to_string().into());
            self.next_label += 1;
            if self.book.id(&term).is_none() && self.run.is_none_or(|run| run.id(&term).is_none()) {
                return self.create(term, watch);
            }
        }
    }

    /// Returns the label of the next new thing.
    pub(crate) fn next_label(&self) -> u64 {
        self.next_label
    }

    /// Labels new things from a number on, so that they don't depend on evaluations whose tuples
    /// are not read.
    pub(crate) fn label_from(&mut self, label: u64) {
        self.next_label = label;
    }

    /// Returns all terms.
    pub(crate) fn terms<'s>(&'s self) -> impl Iterator<Item = &'s Term> {
        let of = |terms: &'s Terms| (0..terms.len()).map(move |id| terms.term(number(id)));
        of(self.book)
            .chain(self.run.into_iter().flat_map(of))
            .chain(of(&self.created))
    }
}

fn number(idx: usize) -> TermId {
    TermId::try_from(idx).expect("budgets stop an evaluation long before 2^32 terms")
}
