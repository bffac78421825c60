//! `actcheck list --rules`

use std::collections::BTreeMap;

use serde_json::Value;

use crate::list::ListArgs;
use crate::options::Format;
use crate::why::ontology_file;
use crate::{chosen, history_dir, output};
use actcheck_analysis::Sampling;
use actcheck_base::{Diagnostics, Outcome};
use actcheck_history::{Judgements, RunFilter, Wish};
use actcheck_ontology as ontology;
use actcheck_ontology::{Action, Ontology, Property};
use actcheck_report::{Proportion, Table};
use actcheck_rules::RuleBook;
use actcheck_verdict::Counts;

/// Prints one line for each property of the ontology, and the warnings about its rules. Without a
/// history, there are no pass rates.
///
/// # Errors
/// Those of the ontology; and those of the rules, after the table.
pub fn rules(args: &ListArgs) -> Result<(), Diagnostics> {
    let (files, path) = ontology_file(args.ontology.as_deref());
    let ontology = ontology::load(&files, &path)?;
    let mut judged: BTreeMap<String, Counts> = BTreeMap::new();
    let mut sampling = Sampling::Fixed;
    if let Some(history) = history_dir::open_if_any(&args.history)? {
        match &args.campaign {
            Some(campaign) => drop(history.campaign(campaign)?),
            None => chosen::one_engine(&history)?,
        }
        let is_meant = |id: &str| args.campaign.as_ref().is_none_or(|campaign| campaign == id);
        let counted = history.counted_runs()?;
        sampling = chosen::sampling(&history, is_meant)?;
        let wish = Wish {
            judgements: Judgements::Newest,
            ..Wish::default()
        };
        let filter = RunFilter {
            campaign: args.campaign.clone(),
            ..RunFilter::default()
        };
        history.each_judged(&filter, wish, &mut |run| {
            for own in run
                .outcomes
                .iter()
                .filter(|_| counted.contains(&run.row.run))
            {
                judged
                    .entry(own.property.to_string())
                    .or_default()
                    .add(own.outcome);
            }
        })?;
    }
    let counts = |property: &Property| judged.get(&property.iri).copied().unwrap_or_default();
    let properties = ontology.properties.values();
    let mut table = match args.format {
        Format::Text => Table::new([
            "property", "label", "language", "file", "actions", "unit", "passed",
        ])
        .with_expendable(["language", "file", "unit", "actions", "label"]),
        Format::Csv | Format::Json => Table::new(
            [
                "property",
                "label",
                "language",
                "file",
                "actions",
                "precondition_of",
                "unit",
            ]
            .into_iter()
            .chain(Outcome::ALL.map(Outcome::word))
            .chain(["pass_rate", "low", "high"]),
        ),
    };
    table.rows = match args.format {
        Format::Text => properties
            .map(|property| for_people(property, &ontology, counts(property), sampling))
            .collect(),
        Format::Csv | Format::Json => properties
            .map(|property| for_programs(property, &ontology, counts(property), sampling))
            .collect(),
    };
    output::print(&table.render(args.format.into(), output::page()));
    output::print_diagnostics(RuleBook::prepare(&ontology)?.warnings());
    Ok(())
}

fn for_people(
    property: &Property,
    ontology: &Ontology,
    counts: Counts,
    sampling: Sampling,
) -> Vec<Value> {
    let preconditions = named(ontology, |action| {
        action.preconditions.contains(&property.iri) || action.premises.contains(&property.iri)
    });
    let mut actions = named(ontology, |action| {
        action.success_properties.contains(&property.iri)
    });
    actions.extend(
        preconditions
            .into_iter()
            .map(|name| format!("{name} (before it)")),
    );
    let rate = Proportion::sampled(counts.passed, counts.decided(), sampling);
    let rate = rate.map_or_else(|| "–".to_owned(), |share| share.to_string());
    let unit = property.unit.clone().unwrap_or_default();
    let [name, label, language, file] = described(property);
    vec![
        name,
        label,
        language,
        file,
        actions.join(", ").into(),
        unit.into(),
        rate.into(),
    ]
}

fn for_programs(
    property: &Property,
    ontology: &Ontology,
    counts: Counts,
    sampling: Sampling,
) -> Vec<Value> {
    let actions = named(ontology, |action| {
        action.success_properties.contains(&property.iri)
    });
    let preconditions = named(ontology, |action| {
        action.preconditions.contains(&property.iri) || action.premises.contains(&property.iri)
    });
    let share = Proportion::sampled(counts.passed, counts.decided(), sampling);
    let part = |part: fn(&Proportion) -> Option<f64>| Value::from(share.as_ref().and_then(part));
    let mut row: Vec<Value> = described(property).into();
    row.extend([
        actions.join(" ").into(),
        preconditions.join(" ").into(),
        property.unit.clone().into(),
    ]);
    row.extend(Outcome::ALL.map(|outcome| counts.get(outcome).into()));
    row.extend([
        part(|it| it.rate),
        part(|it| Some(it.interval.low)),
        part(|it| Some(it.interval.high)),
    ]);
    row
}

/// Name, label, language and file.
fn described(property: &Property) -> [Value; 4] {
    let language = property.rule.language.word();
    let file = &*property.rule.source.name;
    [
        property.name.as_str(),
        property.label.as_str(),
        language,
        file,
    ]
    .map(Value::from)
}

/// Names of the actions that satisfy a predicate.
fn named(ontology: &Ontology, is: impl Fn(&Action) -> bool) -> Vec<String> {
    ontology
        .actions
        .iter()
        .filter(|(_, action)| is(action))
        .map(|(name, _)| name.clone())
        .collect()
}
