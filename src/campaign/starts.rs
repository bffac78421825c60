//! Looks at some scenes of a campaign before its first run: whether the robot can start, and
//! whether each test can begin.
//!
//! Never: simulates a step.

use crate::Env;
use crate::preconditions::{facts_before, facts_of_state};
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_data::{Choices, Scene};
use actcheck_scenario as scenario;
use actcheck_verdict::reason_not_to_perform;
use actcheck_world as world;
use actcheck_world::World;

/// Number of scenes that are drawn for each test.
const N_SCENES: u64 = 8;

impl Env {
    /// Draws some scenes of each test, as [`check_starts`](Self::check_starts) does. Returns an
    /// error if the robot overlaps something in all of them, and warnings if it does in some
    /// (S025), or if the first action of a test can't be performed (S026).
    pub fn starts(&self) -> Diagnostics {
        let mut found = Diagnostics::new();
        for test in 0..self.space.tests() {
            let scenes = self.some_scenes(test);
            let worlds: Vec<(Scene, World)> =
                scenes.filter_map(|scene| self.built(scene)).collect();
            let overlaps: Vec<String> = worlds
                .iter()
                .filter_map(|(_, world)| world.overlaps().first().map(ToString::to_string))
                .collect();
            let n_scenes = worlds.len() as u64;
            match overlaps.first() {
                Some(first) if overlaps.len() == worlds.len() => {
                    found.push(self.overlaps_at_start(first, n_scenes));
                    // Most likely the same is wrong in the other tests.
                    return found;
                }
                Some(first) => {
                    let message = format!(
                        "{first} in {} of {n_scenes} scenes: such scenes are discarded",
                        overlaps.len()
                    );
                    found.push(
                        self.campaign
                            .warning("S025", START, message)
                            .help(MOVE_ROBOT),
                    );
                }
                None => {}
            }
            let unable = worlds
                .iter()
                .find_map(|(scene, world)| self.reason_not_to_begin(test, scene, world));
            if let Some(reason) = unable {
                let action = self.campaign.tests.get(test).and_then(|test| test.first());
                let action = action.map_or(String::new(), |step| step.action.clone());
                let message =
                    format!("`{action}` is never performed as the first action: {reason}");
                let help = "let another action come first that makes it hold";
                found.push(
                    self.campaign
                        .warning("S026", &format!("tests.{test}.0"), message)
                        .help(help),
                );
            }
        }
        found
    }

    /// Returns an error (S025) if the robot overlaps something in all of some scenes of a test: its
    /// runs can't begin.
    pub fn check_starts(&self) -> Result<(), Diagnostics> {
        for test in 0..self.space.tests() {
            let (mut first, mut n_scenes) = (None, 0);
            let scenes = self.some_scenes(test);
            for (_, world) in scenes.filter_map(|scene| self.built(scene)) {
                n_scenes += 1;
                let overlap = world.overlaps().into_iter().next();
                if overlap.is_none() {
                    first = None;
                    break;
                }
                first = first.or(overlap);
            }
            if let Some(first) = first {
                return Err(self.overlaps_at_start(&first.to_string(), n_scenes).into());
            }
        }
        Ok(())
    }

    /// S025: the robot overlaps something in all scenes, as `first` says of one.
    pub(super) fn overlaps_at_start(&self, first: &str, n_scenes: u64) -> Diagnostic {
        let scenes = match n_scenes {
            1 => String::new(),
            _ => format!(", in all of {n_scenes} scenes"),
        };
        self.campaign
            .fault("S025", START, format!("{first}{scenes}"))
            .help(MOVE_ROBOT)
    }

    fn some_scenes(&self, test: usize) -> impl Iterator<Item = Scene> {
        let choices: Vec<Choices> = match &self.campaign.case {
            Some(case) => vec![Choices::named(&case.choices)],
            None => (0..N_SCENES)
                .map(|index| Choices::random(self.campaign.seed, index))
                .collect(),
        };
        choices
            .into_iter()
            .filter_map(move |mut choices| scenario::draw(&self.space, test, &mut choices).ok())
    }

    fn built(&self, scene: Scene) -> Option<(Scene, World)> {
        world::build_with(&scene, &self.robot)
            .ok()
            .map(|world| (scene, world))
    }

    /// The reason why the first action of a test can't be performed. At the start, the robot
    /// touches nothing.
    fn reason_not_to_begin(&self, test: usize, scene: &Scene, world: &World) -> Option<String> {
        let step = self.campaign.tests.get(test)?.first()?;
        let action = self
            .ontology
            .actions
            .get(&step.action)
            .filter(|action| !action.preconditions.is_empty())?;
        let values = scene.steps.first().unwrap_or(&scene.designators);
        let facts = facts_of_state(&world.snapshot(), values, &scene.map);
        let found = self.rules.held_before(
            &facts_before(&facts),
            &action.preconditions,
            &self.rule_budget,
        );
        reason_not_to_perform(&self.ontology, action, &found)
    }
}

/// The key of the robot in configurations.
const START: &str = "robot.profile";
const MOVE_ROBOT: &str = "move the robot by `start_x_m`, `start_y_m` and `start_heading_rad` in `[robot]`, change `home` or \
    `mount_height_m` in its profile, or choose other furniture";
