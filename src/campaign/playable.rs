//! A stored run for another physics engine: its model, its setpoints and its actions.

use std::collections::BTreeMap;

use crate::attempt::Attempt;
use crate::finished_run::{FinishedRun, RunPlace};
use crate::replay::{cut_secs, refused};
use crate::{Env, RunContext, StoredCampaign, mjcf, setpoints};
use actcheck_actions::Cut;
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_data::{CONTROL_HZ, Choice, Choices, Scene, Trace};
use actcheck_history::{History, RunDetail, RunRecord, RunStatus};
use actcheck_scenario as scenario;
use actcheck_world::{EngineState, OtherEngine, Playback, Robot, Setpoint};

/// A run that another engine can play.
#[derive(Debug, Clone, PartialEq)]
pub struct Playable {
    /// Robot and objects at the first frame, in MJCF.
    pub mjcf: String,
    /// The robot's setpoints in each control tick, as CSV.
    pub setpoints: String,
}

/// An action of a run that another engine plays.
#[derive(Debug, Clone, PartialEq)]
pub struct PlayedAction {
    /// Name of the action.
    pub action: String,
    /// Values of its designators.
    pub parameters: BTreeMap<String, Vec<String>>,
    /// Number of control ticks before it and before its end.
    pub ticks: [u64; 2],
    /// Its report: whether it succeeded, and its words; `None` if it gave none.
    pub report: Option<(bool, String)>,
    /// Whether the fingers held an object at its end.
    pub holds: bool,
}

/// A run that was simulated again for another engine.
#[derive(Debug, Clone)]
pub struct PlayableRun {
    /// The files for the engine.
    pub files: Playable,
    /// Its actions.
    pub actions: Vec<PlayedAction>,
    /// Names of the bodies of the fingers, left and right.
    pub fingers: [Vec<String>; 2],
    /// Name of the body of the robot's base.
    pub base: String,
    /// The run here, judged by the present rules; with the performed actions only.
    pub record: RunRecord,
}

/// Another physics engine, which gets its scene in MJCF.
pub trait EngineLink: Send {
    /// Loads a scene. `joints` and `objects` are the names of the robot's joints and the ids of the
    /// objects, in the order of the states; a tick has this length in seconds.
    ///
    /// # Errors
    /// Why it can't, in words.
    fn begin(
        &mut self,
        mjcf: &str,
        joints: &[String],
        objects: &[String],
        tick_secs: f64,
    ) -> Result<(), String>;

    /// Performs a control tick.
    ///
    /// # Errors
    /// Why it can't, in words.
    fn tick(&mut self, setpoints: &[Setpoint]) -> Result<EngineState, String>;
}

/// A scene that is handed over to another engine.
struct Handed {
    run: String,
    robot: Robot,
    scene: Scene,
    link: Box<dyn EngineLink>,
}

impl OtherEngine for Handed {
    fn begin(&mut self, start: &Playback) -> Result<(), String> {
        let joints = self.robot.model.joints.iter();
        let joints: Vec<String> = joints.map(|joint| joint.name.clone()).collect();
        let objects = self.scene.objects.iter();
        let objects: Vec<String> = objects.map(|object| object.id.clone()).collect();
        let text = mjcf::write(&self.run, &self.robot, &self.scene, start);
        self.link.begin(&text, &joints, &objects, start.tick_secs)
    }

    fn tick(&mut self, setpoints: &[Setpoint]) -> Result<EngineState, String> {
        self.link.tick(setpoints)
    }
}

/// Simulates a stored run again, and returns the files with which another engine plays it.
///
/// # Errors
/// `S040` if the configuration has no such test; `S041` if the run can't be run again, or not to
/// the same states; `S053` if it has something that MJCF has no equal for.
pub fn playable(
    history: &History,
    (env, record): &StoredCampaign,
    detail: &RunDetail,
    context: &RunContext,
) -> Result<PlayableRun, Diagnostics> {
    let stored = Stored::of(history, env, detail)?;
    let choices = || Choices::recorded(&stored.choices);
    let (run, playback) = stored.make((env, &record.id), &choices, context, None)?;
    if run.trace.hash != stored.was.hash {
        let why = "it now has other states: a model, the configuration or the program changed";
        let help =
            "`actcheck replay RUN` names the first difference; a run made today can be written";
        return Err(refused(detail, why).help(help).into());
    }
    Ok(played(env, &record.id, &detail.row.run, run, &playback))
}

/// Runs the scene of a stored run in another engine: the skill gets that engine's observations.
/// Returns the files with which the engine plays the same run again, to record it.
///
/// # Errors
/// As [`playable`], or the engine can't go on (`S041`).
pub fn played_in(
    history: &History,
    (env, record): &StoredCampaign,
    detail: &RunDetail,
    context: &RunContext,
    link: Box<dyn EngineLink>,
) -> Result<PlayableRun, Diagnostics> {
    let stored = Stored::of(history, env, detail)?;
    // Choices that only the other engine leads to are drawn anew.
    let (seed, index) = (detail.seed, detail.row.index);
    let choices = || Choices::partly_recorded(&stored.choices, seed, index);
    let scene = scenario::draw(&env.space, env.test_of(stored.index), &mut choices())
        .map_err(|why| refused(detail, &why.to_string()))?;
    let engine = Handed {
        run: detail.row.run.clone(),
        robot: env.robot.clone(),
        scene,
        link,
    };
    let engine: Box<dyn OtherEngine> = Box::new(engine);
    let (run, playback) = stored.make((env, &record.id), &choices, context, Some(engine))?;
    if run.status == RunStatus::Broken {
        let why = run.reason.as_deref().unwrap_or("it broke");
        return Err(refused(detail, why).into());
    }
    let mut played = played(env, &record.id, &detail.row.run, run, &playback);
    // The report is the one that the skill gave in that engine.
    played
        .actions
        .iter_mut()
        .for_each(|action| action.holds = false);
    Ok(played)
}

/// A stored run to make again.
struct Stored<'a> {
    detail: &'a RunDetail,
    /// An index of its test.
    index: u64,
    choices: Vec<Choice>,
    was: Trace,
}

impl<'a> Stored<'a> {
    fn of(history: &History, env: &Env, detail: &'a RunDetail) -> Result<Self, Diagnostics> {
        if env.robot.profile.hand.suction.is_some() {
            let message = format!(
                "run {} can't be written as MJCF: its robot holds things by a suction cup, whose seal MuJoCo does not have",
                detail.row.run
            );
            let help = "runs of robots with fingers can be written";
            return Err(Diagnostic::error("S053", message).help(help).into());
        }
        let (choices, was) = history.traces().recorded(&detail.row.run)?;
        Ok(Self {
            detail,
            index: env.index_of(&detail.row.test, &choices)?,
            choices,
            was,
        })
    }

    /// Makes the run, and takes the robot's part.
    fn make(
        &self,
        (env, campaign): (&Env, &str),
        choices: &dyn Fn() -> Choices,
        context: &RunContext,
        engine: Option<Box<dyn OtherEngine>>,
    ) -> Result<(FinishedRun, Playback), Diagnostics> {
        let attempt = Attempt {
            campaign,
            index: self.index,
            choices,
            cut: cut_secs(&self.was).map_or(Cut::Never, |at_secs| Cut::Simulated { at_secs }),
        };
        let mut playback = None;
        let run = attempt
            .make_played(env, context, Some(&mut playback), engine)
            .map_err(|why| refused(self.detail, &why.to_string()))?;
        match playback {
            Some(playback) => Ok((run, playback)),
            None => Err(refused(self.detail, "its scene could not be simulated").into()),
        }
    }
}

/// A run with the files for the engine that plays it.
fn played(
    env: &Env,
    campaign: &str,
    id: &str,
    run: FinishedRun,
    playback: &Playback,
) -> PlayableRun {
    let links = &env.robot.model.links;
    let name = |link: &usize| format!("robot/{}", links[*link].name);
    let base = env
        .robot
        .named
        .layout
        .base
        .map_or(0, |[.., heading]| heading + 1);
    PlayableRun {
        files: Playable {
            mjcf: mjcf::write(id, &env.robot, &run.scene, playback),
            setpoints: setpoints::write(&env.robot, playback),
        },
        actions: played_actions(&run.trace),
        fingers: env
            .robot
            .named
            .fingers
            .each_ref()
            .map(|finger| finger.iter().map(name).collect()),
        base: name(&base),
        record: performed_only(run.into_record(RunPlace::alone(campaign))),
    }
}

/// Leaves out the actions that were not performed: another engine does not play them, and both
/// records are compared action by action.
fn performed_only(mut record: RunRecord) -> RunRecord {
    let actions = record.trace.actions.iter();
    let kept: Vec<bool> = actions.map(|action| action.end.was_begun()).collect();
    fn keep<T>(list: &mut Vec<T>, kept: &[bool]) {
        let mut kept = kept.iter();
        list.retain(|_| *kept.next().unwrap_or(&true));
    }
    keep(&mut record.trace.actions, &kept);
    keep(&mut record.trace.robot_courses, &kept);
    keep(&mut record.judgements, &kept);
    keep(&mut record.actions, &kept);
    keep(&mut record.action_scores, &kept);
    record
}

/// The actions that were performed, with their control ticks.
fn played_actions(trace: &Trace) -> Vec<PlayedAction> {
    let mut began = 0;
    let mut actions = Vec::new();
    for (action, end) in trace.actions.iter().zip(trace.snapshots.iter().skip(1)) {
        if !action.end.was_begun() {
            continue;
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a number of control ticks"
        )]
        let ticks = (action.duration_secs * f64::from(CONTROL_HZ)).round() as u64;
        let robot = &end.robot;
        actions.push(PlayedAction {
            action: action.action.clone(),
            parameters: action.parameters.clone(),
            ticks: [began, began + ticks],
            report: action
                .report
                .as_ref()
                .map(|report| (report.succeeded, report.message.clone())),
            holds: robot
                .left_touches
                .iter()
                .any(|thing| robot.right_touches.contains(thing)),
        });
        began += ticks;
    }
    actions
}
