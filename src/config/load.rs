//! Loads a configuration file into a validated campaign.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::Launcher;
use crate::designators::{self, Designators};
use crate::paths::{check_unnamed, resolve_path};
use crate::robot::{MendedUrdf, mended};
use crate::table::WrittenStep;
use crate::{Campaign, Overrides, Step, Table, case, model_library, ranges, relations, skill};
use actcheck_base::{
    Diagnostic, Diagnostics, Files, Keep, Keeping, Severity, Source, Span, did_you_mean,
};
use actcheck_search::Strategy;

/// The ontology embedded in the program.
const SHIPPED_ONTOLOGY: &str = "ontology/actions.ttl";
/// The default history folder, next to the configuration.
const HISTORY_DIR: &str = ".actcheck";
/// Largest accepted `test_count`; a larger one is most likely a typing error.
const MOST_RUNS: i64 = 10_000_000;
/// Largest accepted `repeat`: a thousand runs of one scene give its pass rate to within ±0.03.
const MOST_REPETITIONS: i64 = 1000;

/// Reads a configuration with its models and robot. Its paths are relative to its folder.
///
/// # Errors
/// All faults at once: the file can't be read or is a program (C001), is not TOML (C002), has
/// unknown, missing or invalid keys (C003 to C009), names missing models, robots or files (C010 to
/// C014), or a model or robot has errors (W…).
pub fn load(path: &Path, overrides: &Overrides) -> Result<Campaign, Diagnostics> {
    if path.extension().is_some_and(|ending| ending == "py") {
        let fault = format!("{} is a program, not a configuration", path.display());
        return Err(Diagnostic::error("C001", fault)
            .help("name it in `test_launcher` of a configuration, and run that: docs/own-skill.md")
            .into());
    }
    let source = Files::Disk.read(path).map_err(|reason| {
        Diagnostic::error(
            "C001",
            format!("cannot read the configuration {}: {reason}", path.display()),
        )
        .help("name a TOML file, such as configs/pick.toml")
    })?;
    load_text(source, path.parent().unwrap_or(Path::new("")), overrides)
}

/// Like [`load`], for a text that has already been read. Paths in it are relative to `folder`.
///
/// # Errors
/// As [`load`], except C001.
pub fn load_text(
    source: Source,
    folder: &Path,
    overrides: &Overrides,
) -> Result<Campaign, Diagnostics> {
    let mut table = Table::parse(&source)?;
    let mut found = Diagnostics::new();

    table.require(&["tests", "test_count"]);
    let (tests, mut places) = read_tests(&mut table);
    let test_count = table
        .integer("test_count", 1..=MOST_RUNS)
        .and_then(|count| u32::try_from(count).ok());
    let repeat = table
        .integer("repeat", 1..=MOST_REPETITIONS)
        .and_then(|count| u32::try_from(count).ok());
    places.extend(
        table
            .key_span("test_launcher")
            .map(|span| ("test_launcher".to_owned(), span)),
    );
    let launcher = match &overrides.launcher {
        Some(launcher) => {
            skill::pass_over(&mut table);
            launcher.clone()
        }
        None => skill::read(&mut table, folder, &mut found),
    };
    let seed = table
        .integer("seed", 0..=i64::MAX)
        .map_or(0, i64::unsigned_abs);
    let ontology = read_ontology_path(&mut table, folder);
    let scene_rule = read_scene_rule(&mut table, folder, &mut found);
    let relations = relations::read(&mut table, folder, &mut found);
    let mut library = model_library::read(&mut table, folder, &mut found);
    let robot = library.read_robot(&mut table, folder, &mut found);
    let physics = ranges::read_physics(&mut table, &mut found);
    let sensing = ranges::read_sensing(&mut table, &mut found);
    let (budget, limits) = ranges::read_budget(&mut table, &mut found);
    let search = read_search(&mut table, &mut found);
    let (history, sync_each_run, keeping) = read_history(&mut table, folder, &mut found);
    if overrides.history.is_none()
        && let Err(faults) = check_unnamed(folder, &history)
    {
        found.extend(faults);
    }
    if keeping.keep != Keep::All && launcher != Launcher::Reference {
        let span = places.get("test_launcher").cloned().unwrap_or(0..0);
        let message = "runs of a program may not be the same a second time: motion that the history does not keep may be lost";
        found.push(
            Diagnostic::warning("C018", message)
                .at(&source, span)
                .help("`keep = \"all\"` in `[history]` keeps it; outcomes, states and facts are kept in any case"),
        );
    }
    // Taken before the tables of designators, which may have any name.
    let case = table.table("case");
    places.extend(
        library
            .profile_at
            .clone()
            .map(|span| ("robot.profile".to_owned(), span)),
    );
    let designators = designators::read(&mut table, &mut library, &mut places, &mut found);
    let case = case.map(|table| case::read(table, &designators, &mut places, &mut found));
    let Designators {
        candidates,
        other_counts,
        lying,
        nav_obstacles,
        nav_obstacle_count,
        nav_may_block,
    } = designators;
    table.finish(&mut found);
    let named = designators::named_models(&candidates, &nav_obstacles);
    let report = library.report(&named);
    found.extend(report);
    let warnings: Diagnostics = found
        .iter()
        .filter(|fault| fault.severity == Severity::Warning)
        .cloned()
        .collect();

    let (robot, visuals) = match (robot, library.visuals()) {
        (Some(robot), Some(visuals)) if !found.has_errors() => (robot, visuals),
        _ => return Err(in_order_of_place(found)),
    };
    Ok(Campaign {
        source,
        tests,
        test_count: overrides.runs.or(test_count).unwrap_or(1).max(1),
        repeat: overrides.repeat.or(repeat).unwrap_or(1).max(1),
        launcher,
        seed: overrides.seed.unwrap_or(seed),
        shard: overrides.shard,
        search: overrides.search.or(search).unwrap_or(Strategy::Random),
        ontology,
        models: library.models,
        uncategorised: library.uncategorised,
        worlds: library.worlds,
        robot,
        visuals,
        nav_obstacles,
        nav_obstacle_count,
        nav_may_block,
        candidates,
        other_counts,
        lying,
        scene_rule,
        relations,
        start: library.start,
        physics,
        sensing,
        budget,
        limits: limits.overridden(overrides),
        case,
        history: overrides.history.clone().unwrap_or(history),
        sync_each_run,
        keeping,
        places,
        warnings,
    })
}

/// Mends the URDF of a configuration's robot: see [`crate::robot::mended`]. Returns `None` if there
/// is nothing to mend, or one of the files can't be read: [`load`] reports the reason.
pub fn mended_robot(path: &Path) -> Option<MendedUrdf> {
    let source = Files::Disk.read(path).ok()?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut table = Table::parse(&source).ok()?;
    let mut found = Diagnostics::new();
    let mut library = model_library::read(&mut table, folder, &mut found);
    let (files, profile, packages) = library.locate_robot(&mut table, folder, &mut found)?;
    mended(&files, &profile, &packages)
}

/// Sorts the faults of each text by position; texts keep the order in which they were read.
pub fn in_order_of_place(found: Diagnostics) -> Diagnostics {
    let mut names: Vec<String> = Vec::new();
    let mut faults: Vec<(usize, usize, Diagnostic)> = Vec::new();
    for fault in found {
        let name = fault
            .source
            .as_ref()
            .map_or(String::new(), |source| source.name.to_string());
        let rank = names
            .iter()
            .position(|known| *known == name)
            .unwrap_or_else(|| {
                names.push(name);
                names.len() - 1
            });
        faults.push((
            rank,
            fault.span.as_ref().map_or(0, |span| span.start),
            fault,
        ));
    }
    faults.sort_by_key(|(rank, start, _)| (*rank, *start));
    let mut sorted = Diagnostics::new();
    faults
        .into_iter()
        .for_each(|(.., fault)| sorted.push(fault));
    sorted
}

fn read_tests(table: &mut Table) -> (Vec<Vec<Step>>, BTreeMap<String, Span>) {
    let mut places = BTreeMap::new();
    let mut tests = Vec::new();
    for (idx, list) in table
        .lists_of_steps("tests")
        .unwrap_or_default()
        .into_iter()
        .enumerate()
    {
        let mut test = Vec::new();
        for (number, WrittenStep { action, values }) in list.into_iter().enumerate() {
            let place = format!("tests.{idx}.{number}");
            places.extend(
                values
                    .iter()
                    .map(|(name, value)| (format!("{place}.{name}"), value.span.clone())),
            );
            places.insert(place, action.span);
            let values = values
                .into_iter()
                .map(|(name, value)| (name, value.value))
                .collect();
            test.push(Step {
                action: action.value,
                values,
            });
        }
        tests.push(test);
    }
    (tests, places)
}

fn read_ontology_path(table: &mut Table, folder: &Path) -> (Files, PathBuf) {
    let Some(written) = table.string("ontology") else {
        return (Files::Shipped, PathBuf::from(SHIPPED_ONTOLOGY));
    };
    let path = resolve_path(folder, &written.value);
    if let Err(reason) = Files::Disk.read(&path) {
        let message = format!("cannot read the ontology {}: {reason}", path.display());
        table.fault(
            "C012",
            written.span,
            message,
            "the path is relative to the configuration; without it, the shipped ontology is used",
        );
    }
    (Files::Disk, path)
}

fn read_search(table: &mut Table, found: &mut Diagnostics) -> Option<Strategy> {
    let mut search = table.table("search")?;
    let written = search.string("strategy");
    let strategy = written
        .as_ref()
        .and_then(|written| Strategy::by_name(&written.value));
    if let (Some(written), None) = (written, strategy) {
        let help = did_you_mean(&written.value, Strategy::ALL.map(Strategy::name));
        search.fault(
            "C016",
            written.span,
            format!("there is no search strategy `{}`", written.value),
            help,
        );
    }
    search.finish(found);
    strategy
}

/// Reads `[scene] require`: a rule file.
fn read_scene_rule(table: &mut Table, folder: &Path, found: &mut Diagnostics) -> Option<Source> {
    let mut scene = table.table("scene")?;
    scene.require(&["require"]);
    let read = scene
        .string("require")
        .and_then(|written| relations::rule_file(&mut scene, "the scene's", folder, &written));
    scene.finish(found);
    read
}

/// Reads the history's folder, whether each run is written to the disk at once, and which runs are
/// kept whole.
fn read_history(
    table: &mut Table,
    folder: &Path,
    found: &mut Diagnostics,
) -> (PathBuf, bool, Keeping) {
    let (mut dir, mut sync, mut keeping) = (folder.join(HISTORY_DIR), false, Keeping::default());
    if let Some(mut history) = table.table("history") {
        if let Some(written) = history.string("dir") {
            dir = resolve_path(folder, &written.value);
        }
        sync = history.boolean("sync").unwrap_or(false);
        if let Some(written) = history.string("keep") {
            match Keep::ALL
                .into_iter()
                .find(|keep| keep.word() == written.value)
            {
                Some(keep) => keeping.keep = keep,
                None => {
                    let help = did_you_mean(&written.value, Keep::ALL.map(Keep::word));
                    history.fault(
                        "C017",
                        written.span,
                        format!("`keep` can't be `{}`", written.value),
                        help,
                    );
                }
            }
        }
        keeping.whole_share = history.number("keep_whole", 0.0..=1.0).unwrap_or(0.0);
        history.finish(found);
    }
    (dir, sync, keeping)
}
