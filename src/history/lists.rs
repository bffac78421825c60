//! Lists of campaigns, runs and outcomes.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use oxigraph::model::{GraphNameRef, Literal, Term};
use oxigraph::sparql::QueryEvaluationError;
use oxigraph::store::{StorageError, Store};

use crate::detail::{outcome, status, version};
use crate::read::{Node, id_of, select, select_columns, text_of};
use crate::read_campaign::skill;
use crate::statements::iri;
use crate::threads::side_by_side;
use crate::wanted::Wanted;
use crate::write_campaign::campaign_node;
use crate::{CampaignRow, OutcomeRow, Repetition, RunFilter, RunRow};
use actcheck_base::Outcome;

const CAMPAIGNS: &str = "
SELECT ?campaign (COUNT(?run) AS ?runs) WHERE {
    ?campaign a act:Campaign ; prov:startedAtTime ?started .
    OPTIONAL { ?campaign act:number ?number }
    OPTIONAL { ?run act:campaign ?campaign }
} GROUP BY ?campaign ?number ?started ORDER BY ?number ?started ?campaign";

const STARTS: &str = "
SELECT ?campaign WHERE {
    ?campaign a act:Campaign ; prov:startedAtTime ?started .
    OPTIONAL { ?campaign act:number ?number }
} ORDER BY ?number ?started ?campaign";

const RUNS: &str = "
SELECT ?run ?campaign ?index ?test ?status ?weight WHERE {
    ?run act:campaign ?campaign . ?run act:index ?index . ?run act:test ?test . ?run act:status ?status .
    OPTIONAL { ?run act:weight ?weight }
}";

/// The other values of [`RUNS`]: two queries share the work between two threads.
const RUN_RESULTS: &str = "
SELECT ?run ?campaign ?score ?hash ?started ?scene ?repetition WHERE {
    ?run act:campaign ?campaign . ?run act:score ?score . ?run act:traceHash ?hash .
    ?run prov:startedAtTime ?started .
    OPTIONAL { ?run act:sceneNumber ?scene ; act:repetition ?repetition }
}";

const OUTCOMES: &str = "
SELECT ?run ?campaign ?index ?test ?status ?step ?action ?property ?outcome ?margin WHERE {
    ?run act:campaign ?campaign . ?run act:index ?index . ?run act:test ?test . ?run act:status ?status .
    ?execution act:ofRun ?run . ?execution act:step ?step . ?execution act:action ?action .
    ?assertion earl:subject ?execution . ?assertion earl:test ?property . ?assertion earl:result ?result .
    ?result act:outcome ?outcome .
    OPTIONAL { ?result act:margin ?margin }
}";

/// Judgements made after the run that no later one supersedes, without the run, which the store may
/// lack.
const RECHECKED: &str = "
SELECT ?execution ?property ?outcome ?margin ?rule WHERE {
    GRAPH act:rechecked {
        ?assertion earl:subject ?execution ; earl:test ?property ; earl:result ?result .
        ?result act:outcome ?outcome ; act:ruleDigest ?rule .
        OPTIONAL { ?result act:margin ?margin }
    }
    FILTER NOT EXISTS { GRAPH act:rechecked { ?later act:supersedes ?assertion } }
}";

/// All judgements made after the run, with the values that distinguish them, without the run.
const LATER_ALONE: &str = "
SELECT ?execution ?property ?at ?outcome ?rule WHERE {
    GRAPH act:rechecked {
        ?assertion earl:subject ?execution ; earl:test ?property ; act:recheckedAt ?at ; earl:result ?result .
        ?result act:outcome ?outcome ; act:ruleDigest ?rule .
    }
}";

/// Campaigns whose scenes were selected because they fail: shrunk runs, failed runs that ran again,
/// and cases, which have the table `case` in their configuration. The prefix is [`FAILED_AGAIN`].
pub(super) const SELECTED: &str = r"
SELECT DISTINCT ?campaign WHERE {
    { ?ac_run act:shrunkFrom ?ac_original ; act:campaign ?campaign }
    UNION
    { ?campaign a act:Campaign ; rdfs:label ?ac_name FILTER(STRSTARTS(?ac_name, 'failed runs of ')) }
    UNION
    { ?campaign a act:Campaign ; act:configText ?ac_text FILTER(REGEX(?ac_text, '^[ \\t]*(\\[[ \\t]*case[ \\t]*(\\]|\\.)|case[ \\t]*(\\.|=))', 'm')) }
}";

/// Name prefix of campaigns that ran the failed runs of another campaign again.
pub const FAILED_AGAIN: &str = "failed runs of ";

/// All judgements made after the run, with the values that distinguish them.
const LATER: &str = "
SELECT ?run ?step ?property ?at ?outcome ?rule WHERE {
    GRAPH act:rechecked {
        ?assertion earl:subject ?execution ; earl:test ?property ; act:recheckedAt ?at ; earl:result ?result .
        ?result act:outcome ?outcome ; act:ruleDigest ?rule .
    }
    ?execution act:ofRun ?run ; act:step ?step .
}";

/// Time in which a look-up reads one run, divided by the time in which columns read one.
const LOOK_UP_COST: usize = 6;

/// Queries of the runs that count in rates.
pub(super) const COUNTED: [&str; 4] = [SELECTED, STARTS, RUNS, RUN_RESULTS];

/// The statements that [`campaigns`] reads.
pub(super) fn of_campaigns() -> Wanted {
    let mut wanted = Wanted::queries(&[CAMPAIGNS]);
    wanted.add(Wanted::campaigns());
    wanted
}

/// The statements that [`runs`] reads.
pub(super) fn of_runs() -> Wanted {
    Wanted::queries(&[STARTS, RUNS, RUN_RESULTS])
}

/// The statements that [`outcomes`] reads.
pub(super) fn of_outcomes() -> Wanted {
    Wanted::queries(&[STARTS, OUTCOMES])
}

/// The statements that [`rechecked`] reads.
pub(super) fn of_rechecked() -> Wanted {
    Wanted::queries(&[RECHECKED])
}

/// The statements that [`later_judgements`] reads.
pub(super) fn of_later_judgements() -> Wanted {
    Wanted::queries(&[LATER, LATER_ALONE])
}

/// The statements that [`selected_campaigns`] and [`campaign_ids`] read.
pub(super) fn of_selected_campaigns() -> Wanted {
    Wanted::queries(&[SELECTED, STARTS])
}

/// A pattern on one line that matches if a campaign is one of [`selected_campaigns`]. `campaign` is
/// a variable.
pub(super) fn is_selected(campaign: &str) -> String {
    let pattern = SELECTED
        .split_once('{')
        .and_then(|(_, rest)| rest.rsplit_once('}'))
        .map_or("", |(pattern, _)| pattern);
    let words: Vec<&str> = pattern.lines().map(str::trim).collect();
    words.join(" ").replace("?campaign", campaign)
}

type Row = Vec<Option<Term>>;

fn text(row: &Row, column: usize) -> String {
    row.get(column)
        .and_then(Option::as_ref)
        .map(text_of)
        .unwrap_or_default()
}

fn id(row: &Row, column: usize) -> String {
    row.get(column)
        .and_then(Option::as_ref)
        .map(id_of)
        .unwrap_or_default()
}

fn optional<T: std::str::FromStr>(row: &Row, column: usize) -> Option<T> {
    row.get(column)
        .and_then(Option::as_ref)
        .and_then(|term| text_of(term).parse().ok())
}

fn number<T: std::str::FromStr + Default>(row: &Row, column: usize) -> T {
    optional(row, column).unwrap_or_default()
}

/// All campaigns, in the order in which they were added to the history: clocks may be wrong.
pub(super) fn campaigns(store: &Store) -> Result<Vec<CampaignRow>, QueryEvaluationError> {
    let mut rows = Vec::new();
    for row in select(store, CAMPAIGNS, Vec::new())? {
        let name = id(&row, 0);
        let node = Node::read(store, &campaign_node(&name))
            .map_err(|error| QueryEvaluationError::Dataset(Box::new(error)))?;
        rows.push(campaign(name, number(&row, 1), &node));
    }
    Ok(rows)
}

fn campaign(id: String, runs: u64, node: &Node) -> CampaignRow {
    let text = |property| node.text(property).unwrap_or_default();
    CampaignRow {
        id,
        name: text("rdfs:label"),
        started: text("prov:startedAtTime"),
        ended: node.text("prov:endedAtTime"),
        ended_by: node.text("act:endedBy"),
        interrupted: node.boolean("act:interrupted").unwrap_or(true),
        seed: node.count("act:seed").unwrap_or_default(),
        planned_runs: node.count("act:plannedRuns").unwrap_or_default(),
        runs,
        score: node.number("act:score"),
        score_without_broken: node.number("act:scoreWithoutBroken"),
        outcomes: Outcome::ALL
            .into_iter()
            .filter_map(|outcome| Some((outcome, node.count(&format!("act:{outcome}Count"))?)))
            .collect(),
        program_version: version(node),
        config_digest: text("act:configDigest"),
        ontology_digest: text("act:ontologyDigest"),
        skill: skill(node),
    }
}

/// Ids of the campaigns that hold a shrunk run, ran failed runs again, or ran a case.
pub(super) fn selected_campaigns(store: &Store) -> Result<BTreeSet<String>, QueryEvaluationError> {
    Ok(select(store, SELECTED, Vec::new())?
        .iter()
        .map(|row| id(row, 0))
        .collect())
}

/// Ids of all campaigns, sorted by start.
pub(super) fn campaign_ids(store: &Store) -> Result<Vec<String>, QueryEvaluationError> {
    Ok(select(store, STARTS, Vec::new())?
        .iter()
        .map(|row| id(row, 0))
        .collect())
}

/// Position of each campaign in the order of their starts.
fn ranks(store: &Store) -> Result<BTreeMap<String, usize>, QueryEvaluationError> {
    Ok(campaign_ids(store)?
        .into_iter()
        .enumerate()
        .map(|(rank, id)| (id, rank))
        .collect())
}

/// Values of the variables that a filter fixes.
fn given(filter: &RunFilter) -> Vec<(&'static str, Term)> {
    let literal = |text: &str| Term::from(Literal::new_simple_literal(text));
    let campaign = filter
        .campaign
        .as_ref()
        .map(|id| ("campaign", Term::from(campaign_node(id))));
    let test = filter.test.as_ref().map(|test| ("test", literal(test)));
    let status = filter
        .status
        .map(|status| ("status", literal(status.word())));
    [campaign, test, status].into_iter().flatten().collect()
}

/// The rows of a query about runs that match a filter.
fn of_filtered(
    store: &Store,
    query: &str,
    filter: &RunFilter,
) -> Result<Vec<Row>, QueryEvaluationError> {
    let is_most = match &filter.campaign {
        None => true,
        Some(id) => has_most_runs(store, id)
            .map_err(|error| QueryEvaluationError::Dataset(Box::new(error)))?,
    };
    let read = if is_most { select_columns } else { select };
    read(store, query, given(filter))
}

/// Whether a campaign has so many of a store's runs that reading all runs takes less time than
/// looking up its own.
fn has_most_runs(store: &Store, campaign: &str) -> Result<bool, StorageError> {
    let (of, node) = (iri("act:campaign"), campaign_node(campaign));
    let runs = |value| {
        store.quads_for_pattern(
            None,
            Some(of.as_ref()),
            value,
            Some(GraphNameRef::DefaultGraph),
        )
    };
    let own = runs(Some(node.as_ref().into())).count();
    let all = runs(None).take(own * LOOK_UP_COST + 1);
    Ok(all
        .map(|quad| quad.map(drop))
        .collect::<Result<Vec<()>, _>>()?
        .len()
        <= own * LOOK_UP_COST)
}

/// The runs that match a filter, sorted by the start of their campaign, then by index. Up to two
/// threads read them.
pub(super) fn runs(
    store: &Store,
    filter: &RunFilter,
    threads: usize,
) -> Result<Vec<RunRow>, QueryEvaluationError> {
    let ranks = ranks(store)?;
    let of_campaign = RunFilter {
        campaign: filter.campaign.clone(),
        ..RunFilter::default()
    };
    let (runs, results) = side_by_side(
        threads,
        || of_filtered(store, RUNS, filter),
        || of_filtered(store, RUN_RESULTS, &of_campaign),
    );
    let mut results: HashMap<String, Row> =
        results?.into_iter().map(|row| (id(&row, 0), row)).collect();
    let joined = runs?.into_iter().filter_map(|row| {
        let run = id(&row, 0);
        let result = results.remove(&run)?;
        Some(RunRow {
            run,
            campaign: id(&row, 1),
            index: number(&row, 2),
            test: text(&row, 3),
            status: status(Some(&text(&row, 4))),
            weight: optional(&row, 5),
            score: number(&result, 2),
            trace_hash: text(&result, 3),
            started: text(&result, 4),
            repetition: repetition(&result),
        })
    });
    let mut rows: Vec<RunRow> = joined.collect();
    sort_by_rank(&ranks, &mut rows);
    Ok(rows)
}

/// The place of a run in its repetition, from a row of [`RUN_RESULTS`].
fn repetition(result: &Row) -> Option<Repetition> {
    Some(Repetition {
        scene: optional(result, 5)?,
        number: optional(result, 6)?,
    })
}

fn sort_by_rank(ranks: &BTreeMap<String, usize>, rows: &mut [RunRow]) {
    rows.sort_by(|a, b| {
        (ranks.get(&a.campaign), a.index, &a.run).cmp(&(ranks.get(&b.campaign), b.index, &b.run))
    });
}

/// Outcomes of the runs that match a filter, in the same order, then by step and property.
pub(super) fn outcomes(
    store: &Store,
    filter: &RunFilter,
) -> Result<Vec<OutcomeRow>, QueryEvaluationError> {
    let ranks = ranks(store)?;
    let mut rows: Vec<OutcomeRow> = of_filtered(store, OUTCOMES, filter)?
        .iter()
        .map(outcome_row)
        .collect();
    sort_outcomes_by_rank(&ranks, &mut rows);
    Ok(rows)
}

fn sort_outcomes_by_rank(ranks: &BTreeMap<String, usize>, rows: &mut [OutcomeRow]) {
    rows.sort_by(|a, b| {
        (ranks.get(&a.campaign), a.index, &a.run, a.step, &a.property).cmp(&(
            ranks.get(&b.campaign),
            b.index,
            &b.run,
            b.step,
            &b.property,
        ))
    });
}

/// A judgement made after the run, without its run's other values.
pub(super) struct LaterOutcome {
    pub run: String,
    pub step: u32,
    pub property: String,
    pub outcome: Outcome,
    pub margin: Option<f64>,
    /// Digest of its rule.
    pub rule: String,
}

/// The judgements made after runs that no other supersedes, also those after runs that the store
/// lacks; unsorted.
pub(super) fn rechecked(store: &Store) -> Result<Vec<LaterOutcome>, QueryEvaluationError> {
    let of = |row: &Row| {
        let (run, step) = run_and_step(row)?;
        Some(LaterOutcome {
            run,
            step,
            property: text(row, 1),
            outcome: outcome(Some(&text(row, 2))),
            margin: optional(row, 3),
            rule: text(row, 4),
        })
    };
    Ok(select(store, RECHECKED, Vec::new())?
        .iter()
        .filter_map(of)
        .collect())
}

/// The run and the step of an execution, from its IRI in the first column.
fn run_and_step(row: &Row) -> Option<(String, u32)> {
    let execution = id(row, 0);
    let (run, step) = execution.rsplit_once('/')?;
    Some((run.to_owned(), step.parse().ok()?))
}

/// As [`later_judgements`], for runs that the store lacks.
pub(super) fn later_judgements_alone(
    store: &Store,
) -> Result<Vec<(String, String)>, QueryEvaluationError> {
    let judgement = |row: &Row| {
        let (run, step) = run_and_step(row)?;
        let values = (1..5).map(|column| text(row, column));
        Some((
            run,
            std::iter::once(step.to_string())
                .chain(values)
                .collect::<Vec<_>>()
                .join(" "),
        ))
    };
    Ok(select(store, LATER_ALONE, Vec::new())?
        .iter()
        .filter_map(judgement)
        .collect())
}

/// Pairs of a run's id and a judgement made after the run, as one text; unsorted.
pub(super) fn later_judgements(
    store: &Store,
) -> Result<Vec<(String, String)>, QueryEvaluationError> {
    let judgement = |row: &Row| {
        (1..6)
            .map(|column| text(row, column))
            .collect::<Vec<_>>()
            .join(" ")
    };
    Ok(select(store, LATER, Vec::new())?
        .iter()
        .map(|row| (id(row, 0), judgement(row)))
        .collect())
}

/// A row of [`OUTCOMES`].
fn outcome_row(row: &Row) -> OutcomeRow {
    OutcomeRow {
        run: id(row, 0),
        campaign: id(row, 1),
        index: number(row, 2),
        test: text(row, 3),
        step: number(row, 5),
        action: text(row, 6),
        property: text(row, 7),
        outcome: outcome(Some(&text(row, 8))),
        margin: optional(row, 9),
    }
}
