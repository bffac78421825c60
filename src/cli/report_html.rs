//! `actcheck report --html`: collects the content of the page.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use crate::analyse::Analysed;
use crate::appearance::AppearanceReader;
use crate::camera_images::CameraImages;
use crate::margin_bounds::margin_bounds;
use crate::{clock, replayed_runs, work};
use actcheck_base::Diagnostics;
use actcheck_history::History;
use actcheck_ontology::{Ontology, RuleLanguage};
use actcheck_report::{
    FindingsSummary, HtmlReport, PackedRuns, PropertyWords, RelationsSummary, Replays, html,
    html_data, replay_order,
};

/// Renders the whole page, with as many replays as fit into `room` bytes.
///
/// # Errors
/// The history can't be read.
pub(super) fn page(
    found: &Analysed,
    history: &History,
    room: f64,
    is_trusted: bool,
) -> Result<String, Diagnostics> {
    let replays = Some((room, is_trusted));
    rendered(found, history, replays, html)
}

/// Renders the data of the page, then the page for a server, which has the replays.
///
/// # Errors
/// The history can't be read.
pub(super) fn served(found: &Analysed, history: &History) -> Result<String, Diagnostics> {
    rendered(found, history, None, |report| {
        format!("{}\n{}", html_data(report), html(report))
    })
}

/// Returns the replay of a run as a server sends it: a line of JSON.
///
/// # Errors
/// The run can't be read.
pub(super) fn replay(
    history: &History,
    ontology: &Ontology,
    run: &str,
) -> Result<String, Diagnostics> {
    let id = history.resolve(run)?;
    let looks = AppearanceReader::new(history, false);
    let replays = replays(
        history,
        (looks, CameraImages::new(history, false)),
        ontology,
        std::slice::from_ref(&id),
        f64::INFINITY,
    )?;
    match replays.data(&id) {
        Some(data) => Ok(data),
        // It was left out: its motion is not kept. Reading it alone reports the reason.
        None => Err(history.traces().whole(&id).err().unwrap_or_default()),
    }
}

/// Collects the content of the page and renders it. `embedded`: the room for replays in bytes, and
/// whether programs may be started for them; `None` if a server has the page and the replays.
fn rendered(
    found: &Analysed,
    history: &History,
    embedded: Option<(f64, bool)>,
    render: impl FnOnce(&HtmlReport<'_>) -> String,
) -> Result<String, Diagnostics> {
    let Analysed {
        table,
        sample,
        summary,
        ontology,
    } = found;
    let order = replay_order(summary, sample.as_ref().unwrap_or(table));
    // Of a million runs, each takes seconds.
    let (runs, replays) = work::both(
        || PackedRuns::of(summary, table, sample.as_ref()),
        || {
            let Some((room, is_trusted)) = embedded else {
                return Ok(Replays::default());
            };
            let looks = AppearanceReader::new(history, is_trusted);
            let images = CameraImages::new(history, is_trusted);
            replays(history, (looks, images), ontology, &order, room)
        },
    );
    let replays = replays?;
    Ok(render(&HtmlReport {
        version: env!("CARGO_PKG_VERSION"),
        made: &(clock::system().now)(),
        findings: summary,
        table,
        runs: &runs,
        campaigns: &history.campaigns()?,
        words: &words(ontology),
        replays: &replays,
        contested: &history.contested()?,
        relations: &relations(history, summary)?,
        served: embedded.is_none(),
    }))
}

/// The relations of the campaigns in a report.
fn relations(
    history: &History,
    summary: &FindingsSummary,
) -> Result<Vec<RelationsSummary>, Diagnostics> {
    let mut found = Vec::new();
    for campaign in &summary.campaigns {
        if let Some(related) = history.related(campaign)? {
            found.push(RelationsSummary {
                related,
                history: summary.history.clone(),
                program: summary.program.clone(),
            });
        }
    }
    Ok(found)
}

/// Names of all properties, by IRI.
pub(super) fn words(ontology: &Ontology) -> BTreeMap<String, PropertyWords> {
    let told = |property: &actcheck_ontology::Property| PropertyWords {
        label: property.label.clone(),
        comment: property.comment.clone(),
        rule: property.rule.path.clone(),
        bounds: match property.rule.language {
            RuleLanguage::Datalog => margin_bounds(&property.rule.source),
            _ => Vec::new(),
        },
    };
    ontology
        .properties
        .iter()
        .map(|(iri, property)| (iri.clone(), told(property)))
        .collect()
}

/// Replays of as many runs as fit into `room` bytes.
fn replays(
    history: &History,
    (mut looks, mut images): (AppearanceReader, CameraImages),
    ontology: &Ontology,
    order: &[String],
    room: f64,
) -> Result<Replays, Diagnostics> {
    let mut replays = Replays::default();
    if room <= 0.0 {
        return Ok(replays);
    }
    replayed_runs::for_each_batch(history, ontology, order, |batch| {
        for (run, trace, _) in &batch {
            let campaign = &run.row.campaign;
            if !replays.knows(campaign) {
                replays.set_appearances(campaign, looks.of(campaign)?);
            }
            if let Some(trace) = trace {
                replays.set_film(&run.row.run, images.film(run, trace)?);
            }
        }
        replays.add_all(&batch, room);
        Ok(if replays.bytes() as f64 >= room {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        })
    })?;
    Ok(replays)
}
