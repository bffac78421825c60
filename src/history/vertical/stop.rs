//! The reasons why a query is not answered from columns.

use std::path::PathBuf;

use oxigraph::sparql::QueryEvaluationError;
use oxigraph::store::StorageError;

/// The reason why there is no answer from columns.
pub(crate) enum Stop {
    /// The query needs the store: the part of it that does.
    Unfit(String),
    /// A file of outlines was removed meanwhile.
    Gone,
    /// A file of outlines is damaged.
    Damaged(PathBuf, String),
    /// The query was stopped.
    Cancelled,
    /// The evaluator of the rest failed.
    Failed(QueryEvaluationError),
    Crashed,
    Store(StorageError),
}

pub(super) fn unfit<T>(part: impl Into<String>) -> Result<T, Stop> {
    Err(Stop::Unfit(part.into()))
}
