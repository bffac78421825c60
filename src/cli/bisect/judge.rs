//! The outcomes of each version, by its rules or by running scenes with it.

use std::collections::BTreeMap;
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::scenes::Scenes;
use super::stored::Stored;
use super::versions::{Version, Versions};
use super::{BisectArgs, By};
use actcheck_analysis::{Compared, ComparedRun, compared_runs};
use actcheck_base::{Diagnostics, names};
use actcheck_history::{History, OutcomeRow, RunRow, SceneDigest};
use actcheck_rules::{Budget, RuleBook};

/// Why a version has no outcomes.
#[derive(Debug)]
pub enum Unjudged {
    /// Its rules don't parse, or it can't be built or run: other versions may be.
    Skipped(Diagnostics),
    /// The bisection ends.
    Stopped(Diagnostics),
}

impl From<Diagnostics> for Unjudged {
    fn from(faults: Diagnostics) -> Self {
        Self::Stopped(faults)
    }
}

impl Unjudged {
    /// The faults.
    pub fn into_faults(self) -> Diagnostics {
        match self {
            Self::Skipped(faults) | Self::Stopped(faults) => faults,
        }
    }
}

/// Judges versions, each once for a number of scenes.
pub struct Judge<'a> {
    means: Means<'a>,
    properties: &'a [String],
    known: BTreeMap<String, (u64, Rc<Vec<ComparedRun>>)>,
}

enum Means<'a> {
    Stored(Box<Stored<'a>>),
    Scenes(Scenes<'a>),
}

impl<'a> Judge<'a> {
    /// Prepares the runs of a history, or the scenes of a configuration.
    ///
    /// # Errors
    /// The history or the configuration can't be read.
    pub fn new(
        args: &'a BisectArgs,
        versions: &'a Versions,
        scratch: &'a Path,
        stop: &'a Arc<AtomicBool>,
    ) -> Result<Self, Diagnostics> {
        let means = match (&args.config, versions.repository()) {
            (None, Some(repository)) => {
                Means::Stored(Box::new(Stored::open(args, repository, stop)?))
            }
            (None, None) => {
                return Err(crate::configurations::none_given("bisect --programs").into());
            }
            (Some(config), _) => {
                Means::Scenes(Scenes::prepare(args, config, versions, scratch, stop)?)
            }
        };
        Ok(Self {
            means,
            properties: &args.properties,
            known: BTreeMap::new(),
        })
    }

    /// How outcomes decide if no option says so.
    pub fn usual(&self) -> By {
        match &self.means {
            Means::Scenes(scenes) if !scenes.is_case() => By::Rate,
            Means::Stored(_) | Means::Scenes(_) => By::Outcome,
        }
    }

    /// Whether a version can be judged in more scenes.
    pub fn has_more_scenes(&self) -> bool {
        matches!(&self.means, Means::Scenes(scenes) if !scenes.is_case())
    }

    /// Returns the outcomes of a version in at least a number of scenes; all stored runs are judged
    /// in any case.
    pub fn runs(
        &mut self,
        version: &Version,
        scenes: u64,
    ) -> Result<Rc<Vec<ComparedRun>>, Unjudged> {
        if let Some((known, runs)) = self.known.get(&version.id)
            && *known >= scenes
        {
            return Ok(Rc::clone(runs));
        }
        let shown = spinner(version);
        let judged = match &self.means {
            Means::Stored(stored) => stored.judge(version),
            Means::Scenes(chosen) => chosen.judge(version, scenes),
        };
        shown.finish_and_clear();
        let mut judged = judged?;
        judged.outcomes.retain(|row| self.is_asked(&row.property));
        let runs = Rc::new(compared_runs(
            &judged.rows,
            &judged.scenes,
            &judged.outcomes,
        ));
        let known = if self.has_more_scenes() {
            scenes
        } else {
            u64::MAX
        };
        self.known
            .insert(version.id.clone(), (known, Rc::clone(&runs)));
        Ok(runs)
    }

    fn is_asked(&self, property: &str) -> bool {
        let named = |name: &String| name == property || name == names::local(property);
        self.properties.is_empty() || self.properties.iter().any(named)
    }

    /// Explains an outcome by the rules of a version that was judged.
    pub fn explain(
        &self,
        version: &Version,
        run: &str,
        of: &Compared,
    ) -> Result<String, Diagnostics> {
        let text = match &self.means {
            Means::Stored(stored) => stored.explain(version, run, of)?,
            Means::Scenes(scenes) => scenes.explain(version, run, of)?,
        };
        Ok(text.lines().map(|line| format!("      {line}\n")).collect())
    }
}

/// Shows on a terminal which version is being judged, and for how long: a build may take minutes.
fn spinner(version: &Version) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    let style = ProgressStyle::with_template("{spinner} judging {msg} for {elapsed}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()));
    bar.set_message(version.name.clone());
    bar.enable_steady_tick(std::time::Duration::from_millis(200));
    bar
}

/// Judged runs.
pub struct Judged {
    /// The runs.
    pub rows: Vec<RunRow>,
    /// Their scenes.
    pub scenes: BTreeMap<String, SceneDigest>,
    /// Their outcomes.
    pub outcomes: Vec<OutcomeRow>,
}

/// The proof of a property in the first execution of an action in a run, or how close it came.
/// Empty if the rules don't have the property.
pub(super) fn explain(
    rules: &RuleBook,
    history: &History,
    run: &str,
    of: &Compared,
) -> Result<String, Diagnostics> {
    let Compared::Property { action, property } = of else {
        return Ok(String::new());
    };
    let performed = history.run(run)?.actions;
    let step = performed
        .iter()
        .position(|performed| performed.action == *action)
        .unwrap_or_default();
    let facts = history.traces().facts(run, rules.reads_course())?;
    let explained = facts
        .action(step)
        .map(|seen| rules.explain(&seen, property, &Budget::default()));
    Ok(explained
        .and_then(Result::ok)
        .map_or_else(String::new, |explanation| explanation.to_text()))
}
