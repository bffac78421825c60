//! Faults in an imported file, with their places.

use std::path::Path;

/// A place in a file. Both count from 1; columns count characters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) line: u64,
    pub(super) column: u64,
}

/// Number of faults of which the place is kept.
const SHOWN: usize = 3;

/// The faults of a file.
#[derive(Debug, Default)]
pub(super) struct Faults {
    count: usize,
    first: Vec<(Place, String)>,
    /// The line from which nothing was read.
    cut: Option<u64>,
}

impl Faults {
    /// Adds a fault; `reason` is only called if it will be shown.
    pub(super) fn add(&mut self, place: Place, reason: impl FnOnce() -> String) {
        self.count += 1;
        if self.first.len() < SHOWN {
            self.first.push((place, reason()));
        }
    }

    /// Adds a fault after which the file can't be read.
    pub(super) fn add_last(&mut self, place: Place, reason: impl FnOnce() -> String) {
        self.add(place, reason);
        self.cut = Some(place.line);
    }

    pub(super) fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Returns all faults as one message.
    pub(super) fn message(&self, path: &Path) -> String {
        let path = path.display();
        let shown = self
            .first
            .iter()
            .map(|(at, why)| format!("{path}:{}:{}: {why}", at.line, at.column));
        let shown = shown.collect::<Vec<_>>().join("; ");
        let more = match self.count - self.first.len() {
            0 => String::new(),
            more => format!("; and {more} more"),
        };
        let cut = self.cut.map_or(String::new(), |line| {
            format!("; nothing is read from line {line} on")
        });
        let faults = if self.count == 1 {
            "1 fault".to_owned()
        } else {
            format!("{} faults", self.count)
        };
        format!("an imported file has {faults}: {shown}{more}{cut}")
    }
}
