//! Results of re-running cases: whether each scene still fails as recorded.

use actcheck_verdict::Recurrence;

/// Summary of one case.
#[derive(Debug, Clone, PartialEq)]
pub struct CaseSummary {
    /// The case file's path as displayed.
    pub file: String,
    /// Id of the new run.
    pub run: String,
    /// Names of the properties that failed when the case was recorded.
    pub expected: Vec<String>,
    /// How the new result compares with the recorded one.
    pub recurrence: Recurrence,
    /// Whether the trace is bit-for-bit the same. `None` if the case has no trace hash.
    pub same_trace: Option<bool>,
    /// Why the run did not complete, if it did not.
    pub reason: Option<String>,
}

impl CaseSummary {
    /// Whether any property fails.
    pub fn fails(&self) -> bool {
        match self.recurrence {
            Recurrence::AsBefore => !self.expected.is_empty(),
            Recurrence::Otherwise(_) => true,
            Recurrence::NoLonger | Recurrence::Undecided(_) => false,
        }
    }

    /// 0: nothing fails. 1: a property fails. 2: the case could not be decided.
    pub fn exit_code(&self) -> u8 {
        match self.recurrence {
            Recurrence::Undecided(_) => 2,
            _ => u8::from(self.fails()),
        }
    }
}
