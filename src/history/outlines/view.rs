//! A store for queries that has the statements of outlines too.

use std::sync::{Mutex, PoisonError};

use crate::folder::Folder;
use crate::graphs;
use crate::journal::{self, Part};
use crate::open::{OpenStore, Opened, read_with_outlines};
use crate::outlines::shelf::{Needed, Unread};
use crate::trace_file;
use crate::wanted::{InGraph, Wanted};
use crate::write_run::run_node;
use crate::{History, fault, pending};
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_facts::extract;

/// Largest number of statements that a query may need from outlines: they take half a minute and
/// two gigabytes of memory.
pub(crate) const MOST_STATEMENTS: usize = 5_000_000;

/// The store of a reader, with the statements of outlines that queries have asked for so far.
pub(crate) struct View {
    opened: Opened,
    /// The statements of outlines that are in it.
    loaded: Mutex<Wanted>,
}

impl History {
    /// Returns a handle of a store with the wanted statements at least, also those of outlines.
    pub(crate) fn store_for_query(
        &self,
        wanted: impl FnOnce() -> Wanted,
    ) -> Result<OpenStore, Diagnostics> {
        if !self.shelf().exists() {
            return self.store_with(wanted);
        }
        let wanted = wanted();
        let mut view = self.view.lock().unwrap_or_else(PoisonError::into_inner);
        if view
            .as_ref()
            .is_some_and(|view| view.opened.is_stale(&self.folder))
        {
            *view = None;
        }
        let view = match view.take() {
            Some(known) => view.insert(known),
            None => {
                // The owner's statements that are only in its memory so far.
                self.complete_store()?;
                let opened = read_with_outlines(&Folder::to_read(self.dir())?)?;
                view.insert(View {
                    opened,
                    loaded: Mutex::default(),
                })
            }
        };
        view.opened.load(self.dir(), || wanted.clone())?;
        let mut loaded = view.loaded.lock().unwrap_or_else(PoisonError::into_inner);
        let missing = wanted.beyond(&loaded);
        let store = view.opened.handle();
        if !missing.is_empty() {
            let part = self.outlined_statements(&missing)?;
            pending::add(&store, part).map_err(|error| fault::unread(self.dir(), &error))?;
            loaded.add(missing);
        }
        Ok(store)
    }

    /// The wanted statements of all outlines, with facts, as if the runs were kept whole.
    pub(crate) fn outlined_statements(&self, wanted: &Wanted) -> Result<Part, Diagnostics> {
        let with_facts = wanted.graphs
            || wanted
                .patterns
                .iter()
                .any(|pattern| pattern.graph != InGraph::Default);
        let found = self.of_outlines(&mut |shelf| {
            let mut part = Part::default();
            shelf.each_file(None, Needed::All, &mut |file, opened, there| {
                if part.quads.len() > MOST_STATEMENTS {
                    return Ok(());
                }
                // A run in two files has the same statements in both.
                opened.add_statements(wanted, &mut part)?;
                if with_facts {
                    for (index, head) in opened.indices()?.into_iter().zip(opened.heads()?) {
                        if there.contains(&index) {
                            continue;
                        }
                        let (_, trace) = trace_file::decode_head(&head)?;
                        let mut quads = Vec::new();
                        graphs::write(
                            &extract(&trace),
                            &run_node(&format!("{}-{}", file.campaign, index + 1)),
                            &mut quads,
                        );
                        let (terms, rows) = journal::numbered(&quads);
                        journal::collect(&terms, &rows, wanted, &mut part)
                            .ok_or("its states can't be read")?;
                    }
                }
                Ok(())
            })?;
            Ok::<Part, Unread>(part)
        })?;
        if found.quads.len() > MOST_STATEMENTS {
            return Err(too_many(self, "the query", found.quads.len() as u64));
        }
        Ok(found)
    }
}

/// Time in which the store takes in a statement. Unit: seconds.
const SECS_A_STATEMENT: f64 = 6e-6;
/// Memory of a statement in the store. Unit: gigabytes.
const GIGABYTES_A_STATEMENT: f64 = 4e-7;

/// The error of a query that needs the statements of too many outlines. `part`: the part of it that
/// does.
pub(crate) fn too_many(history: &History, part: &str, statements: u64) -> Diagnostics {
    let number = statements as f64;
    let message = format!(
        "{part} needs the store: over {} million statements about runs of `{}` that are kept as outlines, about {:.0} minutes \
         and {:.0} GB",
        statements / 1_000_000,
        history.dir().display(),
        (number * SECS_A_STATEMENT / 60.0).max(1.0),
        (number * GIGABYTES_A_STATEMENT).max(1.0),
    );
    Diagnostic::error("H030", message)
        .help("ask for one campaign's runs in a history of its own, without that part, or export the campaign's tables (`actcheck export tables DIR`)")
        .into()
}
