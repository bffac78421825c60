//! `actcheck analyse`

use std::path::PathBuf;

use clap::Args;

use crate::chosen::{self, ChosenRuns, is_meant};
use crate::options::Format;
use crate::output;
use crate::picture::Picture;
use crate::work::{all_cores, both};
use actcheck_analysis::{
    Column, Hierarchy, JudgedProperty, Mirror, OutcomeTable, PatternOptions, RATE_COLUMNS,
    TableFilter, cascades, collisions, columns, finding_columns, flaky_scenes, judged,
    property_findings, table_failure_modes, trend, two_way,
};
use actcheck_base::{Diagnostic, Diagnostics, did_you_mean};
use actcheck_history::History;
use actcheck_ontology::Ontology;
use actcheck_report::{
    FindingsSummary, PropertyReport, collisions_picture, findings_json, findings_table,
    findings_text, maps_table, patterns_picture, scene_rule,
};
use actcheck_verdict::Counts;

/// Default heat maps of a requested property: the target's position on its surface, and its
/// category and orientation.
const USUAL_MAPS: [[&str; 2]; 2] = [
    ["surface_y_m", "surface_x_m"],
    ["target_category", "target_turned_rad"],
];

/// Maximum number of conditions of a pattern.
const MOST_CONDITIONS: usize = 3;
/// Accepted false discovery rate of patterns, after correction for multiple testing.
const LEVEL: f64 = 0.05;

/// `actcheck analyse`
#[derive(Debug, Args)]
pub struct AnalyseArgs {
    /// Only this property, by its name in the ontology (may be given several times); also prints
    /// heat maps
    #[arg(long, value_name = "P")]
    pub property: Vec<String>,
    /// Failures by one or two parameters, such as `target_category,target_turned_rad`, instead of
    /// the usual heat maps
    #[arg(long, value_name = "DOWN[,ACROSS]", value_delimiter = ',', num_args = 1..=2)]
    pub by: Vec<String>,
    /// Draw the patterns into this file, as a raster (.png) or vector image (.svg)
    #[arg(long, value_name = "FILE.png", conflicts_with = "by")]
    pub picture: Option<PathBuf>,
    /// Draw collisions from above into this file: the things that were hit, around the target or
    /// goal
    #[arg(long, value_name = "FILE.png", conflicts_with = "by")]
    pub collisions: Option<PathBuf>,
    /// Print the N-th pattern of the requested property as a rule: if `[scene] require` in a
    /// configuration names the file, every scene matches the pattern
    #[arg(long, value_name = "N", requires = "property", conflicts_with = "by")]
    pub scene_rule: Option<usize>,
    /// The runs to analyse, and their history.
    #[command(flatten)]
    pub chosen: ChosenRuns,
    /// Print intervals, p-values and other figures of the patterns, and the extent of the search
    #[arg(long, short)]
    pub verbose: bool,
    /// How it is printed (csv: the patterns, or with --by the cells of the map; json: everything)
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t)]
    pub format: Format,
}

/// Number of rows from which conditions are sought in a sample: a million runs would take minutes,
/// and find the same.
const MOST_ROWS: usize = 400_000;
/// Number of rows of the sample.
const SAMPLED_ROWS: usize = 100_000;
/// Columns of a report that are read for all runs.
const RUN_COLUMNS: [&str; 4] = ["index", "repetition", "test", "score"];

/// The result of an analysis.
pub(super) struct Analysed {
    /// The rows of the chosen runs. Of very many, it has only the columns of rates.
    pub table: OutcomeTable,
    /// A sample of the rows with all columns, if there are very many.
    pub sample: Option<OutcomeTable>,
    /// The findings.
    pub summary: FindingsSummary,
    /// The ontology, with the names of properties.
    pub ontology: Ontology,
}

/// Finds conditions that go with failures and prints them.
pub fn analyse(args: &AnalyseArgs) -> Result<(), Diagnostics> {
    check_parameters(&args.by)?;
    let picture = args.picture.as_deref().map(Picture::new).transpose()?;
    let top_view = args.collisions.as_deref().map(Picture::new).transpose()?;
    let history = args.chosen.open()?;
    let asked = Question {
        chosen: &args.chosen,
        property: &args.property,
        by: &args.by,
        // In a text about all properties they would be too long.
        usual_maps: !args.property.is_empty() || args.format != Format::Text,
    };
    let summary = analysed(&asked, &history, &[])?.summary;
    if let Some(picture) = picture {
        picture.write(&patterns_picture(&summary).ok_or_else(|| {
            Diagnostic::error("X013", "there is no pattern to draw".to_owned())
                .help("no pattern was confirmed on the held-out runs; more runs may show one")
        })?)?;
    }
    if let Some(top_view) = top_view {
        top_view.write(&collisions_picture(&summary).ok_or_else(|| {
            Diagnostic::error(
                "X013",
                "no collisions were found, so nothing was drawn".to_owned(),
            )
            .help("the robot touched nothing that it was not to touch, or the runs have no traces")
        })?)?;
    }
    if let Some(number) = args.scene_rule {
        output::print(&rule(&summary, number)?);
        return Ok(());
    }
    output::print(&match args.format {
        Format::Text => findings_text(&summary, args.verbose, output::page()),
        Format::Csv if !args.by.is_empty() => {
            maps_table(&summary).render(args.format.into(), output::page())
        }
        Format::Csv => findings_table(&summary).render(args.format.into(), output::page()),
        Format::Json => format!("{:#}\n", findings_json(&summary)),
    });
    Ok(())
}

/// The parameters of an analysis.
pub(super) struct Question<'a> {
    /// The runs to analyse.
    pub chosen: &'a ChosenRuns,
    /// Names of the properties to analyse; empty: all.
    pub property: &'a [String],
    /// Parameters of the requested heat map; empty: the default heat maps.
    pub by: &'a [String],
    /// Whether to compute the default heat maps.
    pub usual_maps: bool,
}

/// Updates the tables beside a history and finds conditions that go with failures; reads the
/// `further` columns into the table too.
pub(super) fn analysed(
    asked: &Question<'_>,
    history: &History,
    further: &[&'static str],
) -> Result<Analysed, Diagnostics> {
    let filter = asked.chosen.filter(history)?;
    let ontology = asked.chosen.ontology()?;
    let hierarchy = chosen::hierarchy(&ontology);
    let (mirror, _) = Mirror::update(history)?;
    let (mut table, mut sample) = read(&mirror, &filter, further)?;
    let sampling = chosen::sampling(history, |id| {
        table.text("campaign").texts.iter().any(|known| known == id)
    })?;
    table.sampling = sampling;
    sample
        .iter_mut()
        .for_each(|sample| sample.sampling = sampling);
    if table.is_empty() {
        return Err(chosen::none_of(history).into());
    }
    let all = judged(&table);
    let counts = all.iter().fold(Counts::default(), |mut sum, of| {
        sum.add_all(of.counts);
        sum
    });
    let wanted = wanted(all, asked.property)?;
    let sampled = sample.as_ref().map(|sample| (sample, judged(sample)));
    let ((modes, cascades, collisions), properties) = both(
        || {
            let collisions = collisions(sample.as_ref().unwrap_or(&table));
            (
                table_failure_modes(&table),
                cascades(&table, LEVEL),
                collisions,
            )
        },
        || {
            reports(&wanted, |of| {
                report(asked, &table, of, sampled.as_ref(), &hierarchy, &ontology)
            })
        },
    );
    let summary = FindingsSummary {
        history: history.dir().display().to_string(),
        program: std::env::args()
            .next()
            .unwrap_or_else(|| "actcheck".to_owned()),
        options: asked.chosen.typed().to_string(),
        campaigns: table.text("campaign").texts.clone(),
        runs: table.text("run").texts.len() as u64,
        sampling,
        twins: table
            .counted_runs()
            .iter()
            .filter(|counts| !**counts)
            .count() as u64,
        sampled_runs: sample
            .as_ref()
            .map(|sample| sample.text("run").texts.len() as u64),
        counts,
        modes,
        cascades,
        collisions,
        properties,
        level: LEVEL,
    };
    Ok(Analysed {
        table,
        sample,
        summary,
        ontology,
    })
}

/// A report of each property, in order. Computes as many at once as there are cores, which limits
/// the memory in use.
fn reports(
    properties: &[JudgedProperty],
    report: impl Fn(&JudgedProperty) -> PropertyReport + Sync,
) -> Vec<PropertyReport> {
    let at_once = |properties: &[JudgedProperty]| -> Vec<PropertyReport> {
        std::thread::scope(|scope| {
            let started: Vec<_> = properties
                .iter()
                .map(|of| scope.spawn(|| report(of)))
                .collect();
            let joined = started.into_iter().map(std::thread::ScopedJoinHandle::join);
            joined
                .map(|found| found.unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
                .collect()
        })
    };
    properties.chunks(all_cores()).flat_map(at_once).collect()
}

/// Reads the table, and a sample of its rows if there are very many.
fn read(
    mirror: &Mirror,
    filter: &TableFilter,
    further: &[&'static str],
) -> Result<(OutcomeTable, Option<OutcomeTable>), Diagnostics> {
    let names: Vec<&str> = finding_columns()
        .into_iter()
        .chain(further.iter().copied())
        .collect();
    if mirror.rows(filter) <= MOST_ROWS {
        return Ok((OutcomeTable::read(mirror, filter, &names)?, None));
    }
    let of_runs = further
        .iter()
        .copied()
        .filter(|name| RUN_COLUMNS.contains(name));
    let rates: Vec<&str> = RATE_COLUMNS.into_iter().chain(of_runs).collect();
    let (sample, table) = both(
        || OutcomeTable::read_sample(mirror, filter, &names, SAMPLED_ROWS),
        || OutcomeTable::read(mirror, filter, &rates),
    );
    Ok((table?, Some(sample?)))
}

/// The report of a property. `sampled`: a sample of the rows with its properties, in which patterns
/// are sought.
fn report(
    asked: &Question<'_>,
    table: &OutcomeTable,
    of: &JudgedProperty,
    sampled: Option<&(&OutcomeTable, Vec<JudgedProperty>)>,
    hierarchy: &Hierarchy,
    ontology: &Ontology,
) -> PropertyReport {
    let options = PatternOptions {
        most_conditions: MOST_CONDITIONS,
        level: LEVEL,
        ..PatternOptions::default()
    };
    let findings = match sampled {
        None => property_findings(table, of, hierarchy, &options),
        Some((sample, judged)) => {
            let is_same = |other: &&JudgedProperty| {
                other.action == of.action && other.property == of.property
            };
            let none = JudgedProperty {
                rows: Vec::new(),
                every_row: Vec::new(),
                ..of.clone()
            };
            let of_sample = judged.iter().find(is_same).unwrap_or(&none);
            property_findings(sample, of_sample, hierarchy, &options).with_rates_of(table, of)
        }
    };
    let (flaky, repeated_scenes) = flaky_scenes(table, of);
    let by: Vec<&str> = asked.by.iter().map(String::as_str).collect();
    let wanted: Vec<&[&str]> = match (by.is_empty(), asked.usual_maps) {
        (false, _) => vec![&by],
        (true, false) => Vec::new(),
        (true, true) => USUAL_MAPS.iter().map(<[&str; 2]>::as_slice).collect(),
    };
    let maps = match wanted.is_empty() {
        true => Vec::new(),
        false => {
            let all = findings.everything();
            wanted
                .into_iter()
                .filter_map(|by| two_way(&all, by))
                .collect()
        }
    };
    PropertyReport {
        maps,
        unit: ontology
            .properties
            .get(&of.property)
            .and_then(|property| property.unit.clone()),
        trend: trend(table, of, LEVEL),
        flaky,
        repeated_scenes,
        findings,
    }
}

/// The requested properties, or all if none is named.
fn wanted(all: Vec<JudgedProperty>, names: &[String]) -> Result<Vec<JudgedProperty>, Diagnostics> {
    chosen::all_judged(names, all.iter().map(|of| of.property.as_str()))?;
    let is_wanted = |of: &JudgedProperty| {
        names.is_empty() || names.iter().any(|name| is_meant(&of.property, name))
    };
    Ok(all.into_iter().filter(is_wanted).collect())
}

/// A pattern as a rule about scenes. Patterns are numbered over all requested properties, as in the
/// text.
fn rule(summary: &FindingsSummary, number: usize) -> Result<String, Diagnostics> {
    let told = |report: &PropertyReport| report.findings.patterns.confirmed().count();
    let known: usize = summary.properties.iter().map(told).sum();
    let mut patterns = summary.properties.iter().flat_map(|report| {
        report
            .findings
            .patterns
            .confirmed()
            .map(move |pattern| (report, pattern))
    });
    let Some((report, pattern)) = number
        .checked_sub(1)
        .and_then(|before| patterns.nth(before))
    else {
        return Err(Diagnostic::error(
            "X049",
            format!("there is no pattern {number}: the analysis found {known}"),
        )
        .help("`actcheck analyse` with the same options lists them with their numbers")
        .into());
    };
    scene_rule(
        &pattern.conditions,
        &report.findings.input.parameters,
        &report.sentence(pattern),
    )
    .map_err(|unknown| {
        let message = format!("a scene rule can't constrain {}", unknown.join(", "));
        Diagnostic::error("X049", message)
            .help("narrow the configuration's own ranges and lists instead")
            .into()
    })
}

fn check_parameters(by: &[String]) -> Result<(), Diagnostics> {
    let mined = |column: &&Column| column.is_condition() || column.is_effect();
    let known: Vec<&str> = columns()
        .iter()
        .filter(mined)
        .map(|column| column.name)
        .collect();
    let mut faults = Diagnostics::new();
    for name in by.iter().filter(|name| !known.contains(&name.as_str())) {
        faults.push(
            Diagnostic::error("X046", format!("runs have no parameter `{name}`"))
                .help(did_you_mean(name, known.iter().copied())),
        );
    }
    faults.or(())
}
