//! Plans a query over a history with outlines.

use std::collections::BTreeSet;
use std::sync::Arc;

use oxigraph::sparql::QueryEvaluationError;
use spargebra::Query;

use crate::light::parser;
use crate::open::OpenStore;
use crate::read::id_of;
use crate::threads::cores;
use crate::vertical::counts::{Counter, Counts};
use crate::vertical::rewrite::{MakeEvaluator, Rewriter, uses_counts};
use crate::vertical::scan::Files;
use crate::vertical::stop::Stop;
use crate::wanted::{Fixed, Wanted};
use crate::{Cancel, History, RunFilter, lists};

/// A query that needs no statements of outlines.
pub(crate) struct Plan {
    pub query: Query,
    pub counts: Option<Arc<Counts>>,
}

/// Rewrites a query. `text` is its text. `store` has the statements that it wants, except those of
/// outlines.
///
/// # Errors
/// The reason why it can't be answered so. The part that does not fit comes with the number of
/// statements of outlines that the store would need.
pub(crate) fn plan(
    history: &History,
    store: &OpenStore,
    query: Query,
    evaluator: &MakeEvaluator<'_>,
    cancel: &Cancel,
) -> Result<Plan, (Stop, u64)> {
    let files = Files::of(history, cancel).map_err(|stop| (stop, 0))?;
    let wanted = Wanted::parsed(&query);
    let planned = || {
        let mut prefix = "n".to_owned();
        let text = query.to_string();
        while text.contains(&format!("?{prefix}")) {
            prefix.push('_');
        }
        let mut rewriter = Rewriter {
            store,
            files: &files,
            counts: None,
            evaluator,
            cancel,
            prefix,
            order: Vec::new(),
            new: 0,
        };
        if uses_counts(&query) {
            rewriter.counts = Some(Arc::new(counts(&mut rewriter)?));
        }
        let query = rewriter.query(query.clone())?;
        Ok(Plan {
            query,
            counts: rewriter.counts,
        })
    };
    planned().map_err(|stop| (stop, needed(&files, &wanted)))
}

/// Number of statements of outlines, without facts, that the store would need.
fn needed(files: &Files, wanted: &Wanted) -> u64 {
    let mut properties = BTreeSet::new();
    for pattern in &wanted.patterns {
        match &pattern.property {
            Some(Fixed::Iri(iri)) => drop(properties.insert(iri.as_str())),
            _ => return files.all_statements(),
        }
    }
    properties
        .into_iter()
        .map(|property| files.statements(property))
        .sum()
}

/// The runs that count in rates.
fn counts(rewriter: &mut Rewriter<'_>) -> Result<Counts, Stop> {
    let store = rewriter.store;
    let parsed = parser()
        .parse_query(lists::SELECTED)
        .map_err(QueryEvaluationError::from);
    let Query::Select { pattern, .. } = rewriter.query(parsed.map_err(Stop::Failed)?)? else {
        return Ok(Counts::default());
    };
    let campaign = oxigraph::model::Variable::new_unchecked("campaign");
    let rows = rewriter.select(pattern, &[campaign])?;
    let selected: BTreeSet<String> = rows.iter().flatten().flatten().map(id_of).collect();
    let campaigns = lists::campaign_ids(store).map_err(Stop::Failed)?;
    let mut counter = Counter::new(&selected, &campaigns);
    rewriter.files.traced(&mut |runs| counter.add(runs))?;
    let stored = lists::runs(store, &RunFilter::default(), cores()).map_err(Stop::Failed)?;
    Ok(counter.finish(&stored))
}
