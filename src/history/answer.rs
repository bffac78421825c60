//! The answer of a query, and the handle that stops it.

use oxigraph::sparql::CancellationToken;

use actcheck_base::Term;

/// Result of a SPARQL query.
#[derive(Debug, Clone, PartialEq)]
pub enum QueryAnswer {
    /// Of `ASK`.
    Boolean(bool),
    /// Of `SELECT`.
    Table {
        /// Names of the variables, without `?`.
        columns: Vec<String>,
        /// One value for each column, `None` if it is unbound; in the query's order.
        rows: Vec<Vec<Option<Term>>>,
    },
    /// Of `CONSTRUCT` and `DESCRIBE`: sorted, without duplicates.
    Graph(Vec<[Term; 3]>),
}

/// Stops a query from another thread. Clones stop the same query.
#[derive(Clone, Default)]
pub struct Cancel {
    token: CancellationToken,
}

impl Cancel {
    /// Creates a handle that is not cancelled.
    pub fn new() -> Self {
        Self::default()
    }

    /// Stops the query that has this handle; it returns a diagnostic.
    pub fn cancel(&self) {
        self.token.cancel();
    }

    /// Whether [`Cancel::cancel`] was called.
    pub fn is_cancelled(&self) -> bool {
        self.token.is_cancelled()
    }

    pub(super) fn token(&self) -> CancellationToken {
        self.token.clone()
    }
}
