//! Prepares and checks everything that a campaign needs before its first run.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::appearance::skins;
use crate::budget::runs_per_test;
use crate::case::check_case;
use crate::relations::RelationRules;
use crate::requirement::Requirement;
use crate::rule_set::recorded_rules;
use crate::{plausible, solids};
use actcheck_actions as actions;
use actcheck_base::{Diagnostic, Diagnostics, Files, Source, program_digest};
use actcheck_config as config;
use actcheck_config::{Campaign, Launcher, Overrides, Starts, Step};
use actcheck_data::{Choice, ChoiceName, RobotView};
use actcheck_history::{CampaignRecord, FindingRecord, History, SkillRecord};
use actcheck_ontology as ontology;
use actcheck_ontology::Ontology;
use actcheck_protocol::{LineSink, Programs};
use actcheck_rules::{Budget, RuleBook};
use actcheck_scenario::Space;
use actcheck_search::Strategy;
use actcheck_world::{self as world, LazySkins, Robot};

/// A configuration with its ontology, scene space and rules, prepared once and shared by all
/// workers.
pub struct Env {
    /// The configuration.
    pub campaign: Campaign,
    /// Its ontology.
    pub ontology: Ontology,
    /// Its robot, compiled for all simulations.
    pub robot: Robot,
    /// The basis of all values of the robot that its profile does not state, by their keys.
    pub found_on_robot: BTreeMap<&'static str, String>,
    /// The space of scenes that it describes.
    pub space: Space,
    /// The rules of all properties, ready to judge.
    pub rules: RuleBook,
    /// Budget for judging one property.
    pub rule_budget: Budget,
    /// The configuration's text for the record: with the skills that perform the actions.
    pub(super) text: String,
    /// The requirement on scenes, if the configuration has one.
    pub(super) requirement: Option<Requirement>,
    /// The rules of the relations, if the configuration has some.
    pub(super) relations: Option<RelationRules>,
    /// The program that performs actions instead of the reference skills, if the configuration
    /// names one.
    pub(super) programs: Option<Programs>,
    /// The surfaces of its bodies, for colour images.
    skins: Arc<LazySkins>,
}

impl Env {
    /// Reads and checks everything that a campaign depends on.
    ///
    /// # Errors
    /// Returns as many faults as can be found at once: those of the configuration, else those of
    /// the ontology, else those of scene space, rules, robot and skills together.
    pub fn prepare(config: &Path, overrides: &Overrides) -> Result<Self, Diagnostics> {
        Self::prepare_within(config, overrides, Budget::default())
    }

    /// Prepares a campaign as [`Env::prepare`] does, with a budget for every evaluation of rules,
    /// now and in its runs.
    ///
    /// # Errors
    /// As [`Env::prepare`], or if the budget is spent.
    pub fn prepare_within(
        config: &Path,
        overrides: &Overrides,
        rule_budget: Budget,
    ) -> Result<Self, Diagnostics> {
        let mut campaign = config::load(config, overrides)?;
        campaign.test_count = runs_per_test(overrides).unwrap_or(campaign.test_count);
        Self::of(campaign, rule_budget)
    }

    /// Prepares a campaign of the history again: with its configuration's text as it was then, and
    /// with the present ontology, rules and models. If `config` is given, that configuration is
    /// used instead.
    ///
    /// # Errors
    /// `H014` if the history has no such campaign; else as [`Env::prepare`].
    pub fn from_history(
        history: &History,
        campaign: &str,
        config: Option<&Path>,
    ) -> Result<(Self, CampaignRecord), Diagnostics> {
        let record = history.campaign(campaign)?;
        can_be_simulated(&record)?;
        let overrides = recorded_overrides(history, &record);
        let loaded = match config {
            Some(config) => config::load(config, &overrides),
            None => {
                let (source, folder) = stored_configuration(history, &record);
                config::load_text(source, &folder, &overrides).map_err(|mut faults| {
                    let message = format!("this is the configuration of campaign {campaign} as stored in the history");
                    faults.push(
                        Diagnostic::warning("H015", message)
                            .help("if its files have moved, name the configuration's new path with `--config`"),
                    );
                    faults
                })
            }
        };
        let mut loaded = loaded?;
        loaded.test_count = Self::scenes_of_a_test(&loaded, &record);
        Ok((Self::of(loaded, Budget::default())?, record))
    }

    /// Returns the programs that a campaign of the history starts if it is prepared and run again
    /// as [`Env::from_history`] does.
    ///
    /// # Errors
    /// `H014` if the history has no such campaign.
    pub fn starts_from_history(history: &History, campaign: &str) -> Result<Starts, Diagnostics> {
        let record = history.campaign(campaign)?;
        can_be_simulated(&record)?;
        let (source, folder) = stored_configuration(history, &record);
        Ok(config::starts(&source, &folder))
    }

    /// Prepares a campaign from a configuration's text instead of a file. Its paths are relative to
    /// `folder`.
    ///
    /// # Errors
    /// As [`Env::prepare`].
    pub fn prepare_text(
        source: Source,
        folder: &Path,
        overrides: &Overrides,
    ) -> Result<Self, Diagnostics> {
        Self::of(
            config::load_text(source, folder, overrides)?,
            Budget::default(),
        )
    }

    /// Returns an index in this campaign whose test has the actions that a stored run performed,
    /// plus the last ones that its choices left out.
    ///
    /// # Errors
    /// `S040` if the configuration has no such test.
    pub fn index_of(&self, performed: &str, choices: &[Choice]) -> Result<u64, Diagnostics> {
        let left_out = choices
            .iter()
            .find(|choice| choice.name == ChoiceName::ActionsLeftOut);
        let left_out = left_out.map_or(0.0, |choice| choice.value);
        let fits = |test: &Vec<Step>| {
            let done = test.len().checked_sub(left_out as usize);
            done.is_some_and(|done| Step::test_name(&test[..done]) == performed)
        };
        match self.campaign.tests.iter().position(fits) {
            Some(test) => Ok(test as u64 * self.runs_of_a_test()),
            None => {
                let message = format!(
                    "the configuration {} has no test `{performed}`",
                    self.campaign.source.name
                );
                let tests: Vec<String> = self
                    .campaign
                    .tests
                    .iter()
                    .map(|test| Step::test_name(test))
                    .collect();
                Err(Diagnostic::error("S040", message)
                    .help(format!("its tests: {}", tests.join("; ")))
                    .into())
            }
        }
    }

    /// Number of scenes of each test that a campaign of the history planned.
    pub(super) fn scenes_of_a_test(campaign: &Campaign, record: &CampaignRecord) -> u32 {
        let runs_of_a_scene = campaign.tests.len().max(1) as u64 * u64::from(record.repeat.max(1));
        u32::try_from(record.planned_runs / runs_of_a_scene)
            .unwrap_or(campaign.test_count)
            .max(1)
    }

    pub(super) fn of(mut campaign: Campaign, rule_budget: Budget) -> Result<Self, Diagnostics> {
        let (files, path) = &campaign.ontology;
        let mut ontology = ontology::load(files, path)?;
        forget_named(&campaign, &mut ontology);
        let mut faults = Diagnostics::new();
        categorise(&mut campaign, &ontology);
        solids::decompose_meshes(&mut campaign, &mut faults);
        check_search(&campaign, &mut faults);
        check_skills(&campaign, &ontology, &mut faults);
        let robot = solids::complete_robot(&campaign.robot)
            .map_err(|error| faults.push(error.diagnostic()))
            .ok();
        let (robot, found_on_robot) = robot.unzip();
        if let Some(Err(error)) = robot.as_ref().map(Robot::check) {
            faults.push(error.diagnostic());
        }
        let implausible = plausible::implausible(&campaign, robot.as_ref());
        campaign.warnings.extend(implausible.clone());
        let space = match &robot {
            Some(robot) => Space::new(&campaign, &ontology, &robot.profile).map(Some),
            None => Space::check(&campaign, &ontology).map(|()| None),
        };
        let space = space.map_err(|found| faults.extend(found)).ok().flatten();
        let rules = RuleBook::prepare_within(&ontology, &rule_budget)
            .map_err(|found| faults.extend(found))
            .ok();
        let requirement = Requirement::prepare(&campaign, &ontology, &rule_budget);
        let requirement = requirement
            .map_err(|found| faults.extend(found))
            .ok()
            .flatten();
        let relations = RelationRules::prepare(&campaign, &ontology, &rule_budget);
        let relations = relations
            .map_err(|found| faults.extend(found))
            .ok()
            .flatten();
        match (robot, space, rules) {
            (Some(robot), Some(space), Some(rules)) if !faults.has_errors() => {
                let of_case = check_case(&campaign, &space);
                if of_case.has_errors() {
                    faults.extend(of_case);
                } else {
                    campaign.warnings.extend(of_case);
                }
                let programs = programs(&campaign);
                let text = campaign.source.text.to_string();
                let skins = Arc::new(skins(&campaign, &robot));
                faults.or(Self {
                    campaign,
                    ontology,
                    robot,
                    found_on_robot: found_on_robot.unwrap_or_default(),
                    space,
                    rules,
                    rule_budget,
                    text,
                    requirement,
                    relations,
                    programs,
                    skins,
                })
            }
            // A length in millimetres is the cause of most that do not fit.
            _ => {
                faults.extend(implausible);
                Err(faults)
            }
        }
    }

    /// The surfaces of its bodies, for colour images.
    pub fn skins(&self) -> &Arc<LazySkins> {
        &self.skins
    }

    /// Warnings of the configuration, of the ontology and of the rules, such as rules without
    /// effect.
    pub fn warnings(&self) -> Diagnostics {
        let mut warnings = self.campaign.warnings.clone();
        warnings.extend(self.findings());
        warnings
    }

    /// The warnings of the ontology and of the rules, which the campaign's record contains.
    pub fn findings(&self) -> Diagnostics {
        let mut findings = self.rules.warnings().clone();
        findings.extend(self.rules.beyond(self.campaign.budget.action_secs));
        findings
    }

    /// The robot in its postures, for a picture.
    pub fn robot_views(&self) -> Vec<RobotView> {
        self.robot.views()
    }

    /// The campaign's record for the history.
    pub fn record(&self, id: String, name: String, started: String) -> CampaignRecord {
        let mut models: Vec<(String, String)> = self
            .campaign
            .models
            .values()
            .map(|model| (model.name.clone(), model.digest.clone()))
            .collect();
        models.push((
            self.campaign.robot.core.name.clone(),
            self.campaign.robot.core.digest.clone(),
        ));
        let worlds = self.campaign.worlds.values();
        models.extend(worlds.map(|world| (format!("world {}", world.name), world.digest.clone())));
        models.sort();
        let mut findings: Vec<FindingRecord> =
            self.findings().iter().map(FindingRecord::of).collect();
        findings.sort();
        CampaignRecord {
            imported_from: None,
            id,
            name,
            config_text: self.text.clone(),
            config_digest: actcheck_base::digest_of(&self.text),
            config_path: path_from(
                &self.campaign.history,
                Path::new(&*self.campaign.source.name),
            ),
            ontology_digest: self.ontology.digest.clone(),
            rules: recorded_rules(&self.ontology, &self.rules),
            findings,
            models,
            skill: self.skill(),
            seed: self.campaign.seed,
            planned_runs: self.planned_runs(),
            repeat: self.campaign.repeat,
            time_secs: self.campaign.limits.time_secs,
            until_width: self.campaign.limits.until_width,
            max_failures: self.campaign.limits.max_failures,
            shards: self.campaign.shard.into_iter().collect(),
            strategy: self.campaign.search.name().to_owned(),
            started,
            program_version: env!("CARGO_PKG_VERSION").to_owned(),
            program_digest: program_digest().to_owned(),
            physics: world::PHYSICS_VERSION,
        }
    }

    /// Digest of the inputs that a revision of a project changes: the configuration, the program that
    /// performs actions, and the rules that are not shipped ones. Campaigns of revisions in different
    /// histories have different ids by it.
    pub fn revision(&self) -> String {
        let config = actcheck_base::digest_of(&self.campaign.source.text);
        let rules = self.ontology.properties.values().map(|known| &known.rule);
        let own: BTreeSet<&str> = rules
            .filter(|rule| !is_shipped(&rule.source))
            .map(|rule| rule.digest.as_str())
            .collect();
        let skill = self.skill();
        let others = skill.iter().map(|skill| skill.digest.as_str()).chain(own);
        others.fold(config, |all, digest| {
            actcheck_base::digest_of(&format!("{all} {digest}"))
        })
    }

    /// The program that performs actions, for the record.
    fn skill(&self) -> Option<SkillRecord> {
        match &self.campaign.launcher {
            Launcher::Reference => None,
            Launcher::Program(skill) => Some(SkillRecord {
                command: skill.text.clone(),
                digest: skill.digest.clone(),
                privileged: skill.privileged,
            }),
        }
    }

    /// Hands each line that the program prints to `sink`, when it is printed.
    pub fn stream_output(&mut self, sink: LineSink) {
        if let Some(programs) = &mut self.programs {
            programs.set_line_sink(sink);
        }
    }

    /// Whether the program that performs actions receives ground truth.
    pub fn is_privileged(&self) -> bool {
        self.skill().is_some_and(|skill| skill.privileged)
    }

    /// Runs of all tests together.
    pub fn planned_runs(&self) -> u64 {
        self.campaign.tests.len() as u64 * self.runs_of_a_test()
    }

    /// Number of planned runs in this shard of the campaign.
    pub fn runs_to_make(&self) -> u64 {
        self.campaign.shard.map_or(self.planned_runs(), |shard| {
            shard.share(self.planned_runs())
        })
    }

    /// Position of the test that a run performs. All runs of the first test come first; an index
    /// past the end gives the last test.
    pub fn test_of(&self, index: u64) -> usize {
        let last = self.campaign.tests.len().saturating_sub(1);
        usize::try_from(index / self.runs_of_a_test().max(1)).map_or(last, |test| test.min(last))
    }

    /// Runs of each test: scenes times repetitions.
    pub(super) fn runs_of_a_test(&self) -> u64 {
        u64::from(self.campaign.test_count) * u64::from(self.campaign.repeat)
    }
}

/// The configuration of a campaign as the history keeps it, and the folder to which its paths are
/// relative.
fn stored_configuration(history: &History, record: &CampaignRecord) -> (Source, PathBuf) {
    let path = config::resolve_path(history.dir(), &record.config_path);
    let source = Source::new(path.display().to_string(), record.config_text.as_str());
    (source, path.parent().unwrap_or(Path::new("")).to_owned())
}

/// Reads the configuration of a campaign of a history, with its robot and models.
///
/// # Errors
/// As [`config::load_text`], or if it was imported.
pub(super) fn stored_campaign(
    history: &History,
    record: &CampaignRecord,
) -> Result<Campaign, Diagnostics> {
    can_be_simulated(record)?;
    let (source, folder) = stored_configuration(history, record);
    config::load_text(source, &folder, &recorded_overrides(history, record))
}

/// The command-line overrides with which a campaign of a history began, except the number of runs.
pub(super) fn recorded_overrides(history: &History, record: &CampaignRecord) -> Overrides {
    // A campaign merged from several shards is treated as a whole, so its missing shards belong to
    // it too.
    let shard = match record.shards.as_slice() {
        [only] => Some(*only),
        _ => None,
    };
    Overrides {
        runs: None,
        seed: Some(record.seed),
        repeat: Some(record.repeat),
        search: Strategy::by_name(&record.strategy),
        shard,
        time_secs: record.time_secs,
        until_width: record.until_width,
        max_failures: record.max_failures,
        history: Some(history.dir().to_path_buf()),
        launcher: None,
    }
}

/// Whether a rule file is a copy of a shipped one.
fn is_shipped(rule: &Source) -> bool {
    let name = Path::new(&*rule.name).file_name();
    let mut shipped = Files::all_shipped(Path::new("rules")).into_iter();
    shipped.any(|path| {
        path.file_name() == name
            && Files::Shipped
                .read(&path)
                .is_ok_and(|known| known.text == rule.text)
    })
}

/// Drops the warnings O017 about the rule files that `[scene] require` and `[relations]` name.
fn forget_named(campaign: &Campaign, ontology: &mut Ontology) {
    let file = |source: &Source| std::fs::canonicalize(&*source.name).ok();
    let rules = campaign.relations.iter().map(|relation| &relation.rule);
    let named: Vec<PathBuf> = rules.chain(&campaign.scene_rule).filter_map(file).collect();
    let is_named = |found: &Diagnostic| {
        let path = found.source.as_ref().and_then(file);
        path.is_some_and(|path| named.contains(&path))
    };
    let unlinked = std::mem::take(&mut ontology.unlinked);
    ontology.unlinked = unlinked
        .into_iter()
        .filter(|found| !is_named(found))
        .collect();
}

/// Sets the category of models that come without one, and of all moving parts, from their name if
/// the ontology has such a class; else they stay `act:Object`.
fn categorise(campaign: &mut Campaign, ontology: &Ontology) {
    let used = campaign.used_models();
    for model in campaign.models.values_mut() {
        for idx in 0..model.moving.len() {
            if let Some(class) = ontology.class_called(&model.moving[idx].name) {
                let part = &mut Arc::make_mut(model).moving[idx];
                Arc::make_mut(&mut part.model).category = class.to_owned();
            }
        }
    }
    for name in &campaign.uncategorised {
        let Some(model) = campaign.models.get_mut(name) else {
            continue;
        };
        // Models that only a world has are called WORLD/NAME. Configurations can't name them.
        let own_name = name.rsplit_once('/').map(|(_, own_name)| own_name);
        match ontology.class_called(own_name.unwrap_or(name)) {
            Some(class) => Arc::make_mut(model).category = class.to_owned(),
            None if own_name.is_none() && used.contains(name) => campaign.warnings.push(
                Diagnostic::warning(
                    "W039",
                    format!("the model `{name}` has no category: it counts as `act:Object`"),
                )
                .help(format!(
                    "add it to `[categories]`, for example `{name} = \"act:Cup\"`"
                )),
            ),
            None => {}
        }
    }
}

/// Returns a path relative to a folder, so that both can be moved together; unchanged if one of
/// them does not exist.
fn path_from(folder: &Path, path: &Path) -> String {
    let absolute = |path: &Path| std::fs::canonicalize(path).ok();
    let seen = match (absolute(folder), absolute(path)) {
        (Some(folder), Some(path)) => pathdiff::diff_paths(&path, folder).unwrap_or(path),
        _ => path.to_path_buf(),
    };
    seen.display().to_string()
}

/// Checks that a search for failures is neither ended by an interval width (its raw counts are
/// biased) nor split into shards (each scene depends on earlier results).
fn check_search(campaign: &Campaign, faults: &mut Diagnostics) {
    if !campaign.search.is_guided() {
        return;
    }
    let name = campaign.search.name();
    let help = "choose the strategy `random`, `halton` or `latin-hypercube`";
    let mut refuse = |why: &str| {
        faults.push(
            campaign
                .fault(
                    "S024",
                    "search",
                    format!("a {name} search looks for failures: {why}"),
                )
                .help(help),
        );
    };
    if campaign.limits.until_width.is_some() {
        refuse("its share of failed runs is biased, so the width of an interval can't end it");
    }
    if campaign.shard.is_some() {
        refuse(
            "each scene depends on the results of earlier ones, so it can't be split into shards",
        );
    }
}

/// The program that performs actions, if the configuration names one.
fn programs(campaign: &Campaign) -> Option<Programs> {
    match &campaign.launcher {
        Launcher::Reference => None,
        Launcher::Program(skill) => {
            let tested = campaign
                .tests
                .iter()
                .flatten()
                .map(|step| step.action.clone())
                .collect();
            Some(Programs::new(skill.as_ref().clone(), tested))
        }
    }
}

/// Reports actions of the ontology that no reference skill performs. The scene space reports names
/// that the ontology lacks, and a program names its skills only when it is started.
fn check_skills(campaign: &Campaign, ontology: &Ontology, faults: &mut Diagnostics) {
    if campaign.launcher != Launcher::Reference {
        return;
    }
    for (test, listed) in campaign.tests.iter().enumerate() {
        for (step, action) in listed.iter().map(|step| &step.action).enumerate() {
            if let (true, Err(unknown)) = (
                ontology.actions.contains_key(action),
                actions::known_skill(action),
            ) {
                let diagnostic = unknown.diagnostic();
                let fault = campaign.fault(
                    diagnostic.code,
                    &format!("tests.{test}.{step}"),
                    unknown.to_string(),
                );
                faults.push(match diagnostic.help {
                    Some(help) => fault.help(help),
                    None => fault,
                });
            }
        }
    }
}

/// E020: checks that a campaign was simulated here.
fn can_be_simulated(record: &CampaignRecord) -> Result<(), Diagnostics> {
    match &record.imported_from {
        None => Ok(()),
        Some(engine) => Err(Diagnostic::error(
            "E020",
            format!(
                "campaign {} was imported from {engine}: its runs can't be simulated here",
                record.id
            ),
        )
        .help("run it again in its own simulator; `actcheck report` replays its recorded motion")
        .into()),
    }
}
