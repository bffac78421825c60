//! Streams the values of outlines in the order of their indices. Only files whose ranges overlap
//! are in memory at the same time.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::{Scope, available_parallelism};

use crate::outlines::file::Opened;
use crate::outlines::row::{Outlined, Rows};
use crate::outlines::shelf::{IndexSet, Needed, OutlineFile, Shelf, Unread, read_parts, unread};

/// Number of files that each thread decodes ahead.
const AHEAD: usize = 8;
/// Number of files from which threads decode them: starting them takes as long as decoding a few.
const MANY: usize = 16;

impl Shelf {
    /// Calls `each` with the outlines of a campaign whose indices are not in `done`, and adds them.
    /// Called again after [`Unread::Gone`], it goes on with the others.
    pub(super) fn each_row(
        &self,
        campaign: &str,
        done: &mut IndexSet,
        each: &mut dyn FnMut(Outlined<'_>),
    ) -> Result<(), Unread> {
        let files = self.files(Some(campaign));
        std::thread::scope(|scope| {
            let mut decoded = Decoded::start(&files, scope);
            let mut open: Vec<Option<(Rows, usize)>> = Vec::new();
            // The lowest index of each open file that was not passed on.
            let mut lowest: BinaryHeap<Reverse<(u64, usize)>> = BinaryHeap::new();
            loop {
                while let Some(file) = files.get(open.len())
                    && lowest
                        .peek()
                        .is_none_or(|Reverse((index, _))| file.first <= *index)
                {
                    let rows = decoded.next(open.len())?;
                    lowest.extend(
                        rows.rows
                            .first()
                            .map(|row| Reverse((row.index, open.len()))),
                    );
                    open.push(Some((rows, 0)));
                }
                let Some(Reverse((index, at))) = lowest.pop() else {
                    return Ok(());
                };
                let Some((rows, place)) = &mut open[at] else {
                    continue;
                };
                if done.insert(index) {
                    each(rows.at(campaign, *place));
                }
                *place += 1;
                match rows.rows.get(*place) {
                    Some(row) => lowest.push(Reverse((row.index, at))),
                    None => open[at] = None,
                }
            }
        })
    }
}

/// The decoded values of files, in order.
enum Decoded<'f> {
    /// Decoded by the caller.
    Here(&'f [OutlineFile]),
    /// Decoded by threads, of which each has every n-th file.
    Threads(Vec<Receiver<Result<Rows, Unread>>>),
}

impl<'f> Decoded<'f> {
    fn start<'scope>(files: &'f [OutlineFile], scope: &'scope Scope<'scope, 'f>) -> Self {
        let threads = available_parallelism().map_or(1, usize::from);
        if files.len() < MANY || threads == 1 {
            return Self::Here(files);
        }
        let receivers = (0..threads).map(|thread| {
            let (sender, receiver) = sync_channel(AHEAD);
            scope.spawn(move || {
                for file in files.iter().skip(thread).step_by(threads) {
                    let rows = rows_of(file);
                    let is_last = rows.is_err();
                    // Without a receiver, no further file is needed.
                    if sender.send(rows).is_err() || is_last {
                        return;
                    }
                }
            });
            receiver
        });
        Self::Threads(receivers.collect())
    }

    /// The values of a file. Files must be asked for in order.
    fn next(&mut self, at: usize) -> Result<Rows, Unread> {
        match self {
            Self::Here(files) => rows_of(&files[at]),
            // A thread that ended without its file has panicked, which the scope reports.
            Self::Threads(receivers) => receivers[at % receivers.len()]
                .recv()
                .unwrap_or(Err(Unread::Gone)),
        }
    }
}

fn rows_of(file: &OutlineFile) -> Result<Rows, Unread> {
    let bytes = read_parts(&file.path, Needed::Rows).map_err(|error| unread(&file.path, &error))?;
    let rows = Opened::new(&bytes).and_then(|opened| opened.rows());
    let mut rows = rows.map_err(|why| Unread::Damaged(file.path.clone(), why))?;
    rows.rows.sort_by_key(|row| row.index);
    Ok(rows)
}
