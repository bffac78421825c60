//! Packs runs for playback: their details and the trajectories of all bodies.

use std::collections::BTreeMap;
use std::num::NonZero;
use std::sync::Arc;
use std::thread::available_parallelism;

use serde_json::{Value, json};

use crate::html::Explained;
use crate::html::events::action;
use crate::html::film::{FilmImage, packed_film};
use crate::html::joints::joints;
use crate::html::pack::{Pack, packed};
use crate::html::shapes::Shapes;
use crate::json::skill_json;
use crate::pressed::hardest_of_run;
use actcheck_base::{Outcome, names};
use actcheck_data::{
    Appearances, BodyState, CameraPlace, Form, Pose, Role, SeenPart, Snapshot, Trace,
};
use actcheck_history::{ObjectDetail, RunDetail};

/// Smallest quantisation step of positions, which is the resolution of traces. The step is larger
/// if a run spans more than 6.5 m. Unit: metres.
const GRAIN_M: f64 = 1e-4;
/// Quantisation step of quaternion components, as in traces.
const GRAIN_TURN: f64 = 2e-4;
/// Kind and role of the robot's links that never move.
const ROBOT: &str = "robot";

/// A run with its trace, unless it has none, and the explanations of its failures.
pub type ReplayedRun = (RunDetail, Option<Trace>, Vec<Explained>);

/// Packed runs for playback.
#[derive(Debug, Default)]
pub struct Replays {
    shapes: Shapes,
    /// The appearance of the bodies of campaigns, by the campaign's id.
    appearances: BTreeMap<String, Arc<Appearances>>,
    /// The images of runs that are not added yet, by the run's id.
    films: BTreeMap<String, Vec<FilmImage>>,
    runs: BTreeMap<String, String>,
    bytes: usize,
}

impl Replays {
    /// Whether the appearance of the bodies of a campaign is known.
    pub fn knows(&self, campaign: &str) -> bool {
        self.appearances.contains_key(campaign)
    }

    /// Sets the appearance of the bodies of a campaign, for runs that are added from now on.
    pub fn set_appearances(&mut self, campaign: &str, appearances: Arc<Appearances>) {
        self.appearances.insert(campaign.to_owned(), appearances);
    }

    /// Sets the images that a run's program asked for, before the run is added.
    pub fn set_film(&mut self, run: &str, film: Vec<FilmImage>) {
        self.films.insert(run.to_owned(), film);
    }

    /// Adds a run. A run without a trace can't be played back, but its details are included.
    pub fn add(&mut self, run: &RunDetail, trace: Option<&Trace>, explained: &[Explained]) {
        let bodies = self.filmed_bodies(run, trace);
        let packed = bodies.packed(run, trace, explained);
        self.insert(run, packed);
    }

    /// Adds runs as [`Replays::add`] does, until `room` is full. All cores share the work. Unit of
    /// `room`: bytes.
    pub fn add_all(&mut self, runs: &[ReplayedRun], room: f64) {
        // Shapes are numbered in the order of the runs, so that the page does not depend on the
        // number of cores.
        let (mut numbered, mut shapes) = (
            Vec::with_capacity(runs.len()),
            Vec::with_capacity(runs.len()),
        );
        for run in runs {
            numbered.push((run, self.filmed_bodies(&run.0, run.1.as_ref())));
            shapes.push(self.shapes.all().len());
        }
        let of_a_worker = runs
            .len()
            .div_ceil(available_parallelism().map_or(1, NonZero::get))
            .max(1);
        let shares: Vec<Vec<String>> = std::thread::scope(|scope| {
            let started: Vec<_> = numbered
                .chunks(of_a_worker)
                .map(|share| scope.spawn(move || packed_runs(share)))
                .collect();
            let ended = started.into_iter().map(|share| share.join());
            ended
                .map(|share| share.unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
                .collect()
        });
        for (((run, ..), packed), shapes) in
            runs.iter().zip(shares.into_iter().flatten()).zip(shapes)
        {
            self.insert(run, packed);
            if self.bytes as f64 >= room {
                self.shapes.truncate(shapes);
                return;
            }
        }
    }

    fn filmed_bodies(&mut self, run: &RunDetail, trace: Option<&Trace>) -> Bodies {
        Bodies {
            film: self.films.remove(&run.row.run).unwrap_or_default(),
            ..self.bodies(place(run), trace)
        }
    }

    fn insert(&mut self, run: &RunDetail, packed: String) {
        self.bytes += packed.len();
        self.runs.insert(run.row.run.clone(), packed);
    }

    /// Size in the page, in bytes.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// Returns a run with the shapes of all, as the page's script reads them: a line of JSON with
    /// `forms` and `replay`. Returns `None` if the run was not added.
    pub fn data(&self, run: &str) -> Option<String> {
        let replay = self.runs.get(run)?;
        Some(json!({ "forms": self.forms(), "replay": replay }).to_string())
    }

    /// Ids of the runs, with their packed data.
    pub(super) fn runs(&self) -> impl Iterator<Item = (&str, &str)> {
        self.runs
            .iter()
            .map(|(run, packed)| (run.as_str(), packed.as_str()))
    }

    /// Returns all shapes, packed.
    pub(super) fn forms(&self) -> String {
        packed(json!(self.shapes.all()).to_string().as_bytes())
    }

    /// The bodies of a run, with the numbers of their shapes, by its campaign and its objects.
    fn bodies(
        &mut self,
        (campaign, objects): (&str, &[ObjectDetail]),
        trace: Option<&Trace>,
    ) -> Bodies {
        let Some(trace) = trace.filter(|trace| !trace.snapshots.is_empty()) else {
            return Bodies::default();
        };
        let forms: BTreeMap<&str, &Form> = trace
            .forms
            .iter()
            .map(|form| (form.name.as_str(), form))
            .collect();
        let first = trace
            .snapshots
            .iter()
            .take(1)
            .flat_map(|state| &state.bodies);
        let bodies: BTreeMap<&str, &BodyState> =
            first.map(|body| (body.id.as_str(), body)).collect();
        let objects: BTreeMap<&str, &ObjectDetail> = objects
            .iter()
            .map(|object| (object.id.as_str(), object))
            .collect();
        let appearances = self.appearances.get(campaign).cloned().unwrap_or_default();
        let shapes = &mut self.shapes;
        // The numbers of a body's shape, and of its appearance if its shape is needed, too.
        let mut body = |name: &str| -> Option<Value> {
            if let Some(parts) = appearances.links.get(name) {
                return Some(
                    json!({ "name": name, "form": shapes.of_seen([campaign, name], parts) }),
                );
            }
            let form = match (forms.get(name), bodies.get(name)) {
                (Some(form), _) => shapes.of(form),
                (None, Some(body)) => shapes.around(body),
                // A link without geometry is invisible.
                (None, None) => return None,
            };
            let object = objects.get(name);
            let role = object.map(|object| role_name(object.role));
            let mut value = json!({ "name": name, "form": form, "role": role });
            if let Some((model, parts)) = object.and_then(|object| look(&appearances, object)) {
                value["seen"] = shapes.of_seen([campaign, model], parts).into();
            }
            Some(value)
        };
        let frames = &trace.frames;
        let (mut slots, mut tracks): (Vec<usize>, Vec<Value>) = (Vec::new(), Vec::new());
        for (slot, name) in frames.names.iter().enumerate() {
            if let Some(track) = body(name) {
                slots.push(slot);
                tracks.push(track);
            }
        }
        let at = |pose: &Pose| -> Vec<f64> {
            pose.position
                .iter()
                .chain(&pose.rotation)
                .copied()
                .collect()
        };
        let mut still = Vec::new();
        for state in bodies
            .values()
            .filter(|body| !frames.names.contains(&body.id))
        {
            if let Some(mut value) = body(&state.id) {
                value["at"] = at(&state.pose).into();
                value["kind"] = names::local(&state.category).into();
                still.push(value);
            }
        }
        for (name, pose) in trace.snapshots.iter().take(1).flat_map(links) {
            if frames.names.contains(&name) {
                continue;
            }
            if let Some(mut value) = body(&name) {
                value["at"] = at(&pose).into();
                value["kind"] = ROBOT.into();
                value["role"] = ROBOT.into();
                still.push(value);
            }
        }
        Bodies {
            still,
            tracks,
            slots,
            camera: appearances.camera.as_ref().map_or(Value::Null, camera),
            film: Vec::new(),
        }
    }
}

/// The campaign and the objects of a run.
fn place(run: &RunDetail) -> (&str, &[ObjectDetail]) {
    (&run.row.campaign, &run.objects)
}

/// The appearance of an object, with the name of its model.
fn look<'a>(
    appearances: &'a Appearances,
    object: &ObjectDetail,
) -> Option<(&'a str, &'a [SeenPart])> {
    let (model, parts) = appearances.models.get_key_value(&object.model)?;
    Some((model, parts))
}

/// The place of a camera: its link, or where it is, and its pose there.
fn camera(place: &CameraPlace) -> Value {
    let at: Vec<f64> = (place.pose.position.iter())
        .chain(&place.pose.rotation)
        .copied()
        .collect();
    match &place.link {
        Some(link) => json!({ "link": link, "pose": at }),
        None => json!({ "at": [0, 0, 0, 0, 0, 0, 1], "pose": at }),
    }
}

/// The robot's links in a state, by their names in traces.
fn links(state: &Snapshot) -> impl Iterator<Item = (String, Pose)> {
    let links = state.robot.links.iter();
    links.map(|link| (format!("robot/{}", link.name), link.pose))
}

/// The bodies of a run: fixed ones and tracks, as the page gets them.
#[derive(Debug, Default)]
struct Bodies {
    still: Vec<Value>,
    tracks: Vec<Value>,
    /// Place of each track in the frames.
    slots: Vec<usize>,
    /// Place of the robot's camera, or `null`.
    camera: Value,
    film: Vec<FilmImage>,
}

fn packed_runs(runs: &[(&ReplayedRun, Bodies)]) -> Vec<String> {
    let packed = |((run, trace, explained), bodies): &(&ReplayedRun, Bodies)| {
        bodies.packed(run, trace.as_ref(), explained)
    };
    runs.iter().map(packed).collect()
}

impl Bodies {
    fn packed(&self, run: &RunDetail, trace: Option<&Trace>, explained: &[Explained]) -> String {
        let mut pack = Pack::default();
        details(&mut pack, run);
        let actions: Vec<Value> = run
            .actions
            .iter()
            .enumerate()
            .map(|(idx, _)| action(run, trace, idx, explained))
            .collect();
        pack.set("actions", actions);
        if let Some(trace) = trace.filter(|trace| !trace.snapshots.is_empty()) {
            pack.set("still", self.still.clone());
            pack.set("tracks", self.tracks.clone());
            set_trajectories(&mut pack, trace, &self.slots);
            pack.set("pressed", pressed(run, trace));
            let joints = joints(&mut pack, trace);
            pack.set("joints", joints);
            pack.set("skill", skill_json(trace));
            pack.set("camera", self.camera.clone());
            if !self.film.is_empty() {
                pack.set("film", packed_film(&self.film));
            }
        }
        pack.finish()
    }
}

/// Packs the trajectories of some tracks, with their scale and frame period.
fn set_trajectories(pack: &mut Pack, trace: &Trace, slots: &[usize]) {
    let (columns, low, grain) = columns(&trace.frames.rows, slots);
    pack.set("period", trace.frames.period_secs);
    pack.set("low", low.to_vec());
    pack.set("grain", grain);
    pack.set("turn", GRAIN_TURN);
    let trajectories = pack.trajectories(&columns);
    pack.set("courses", trajectories);
}

/// The hardest contact of the robot with something that it is not to touch.
fn pressed(run: &RunDetail, trace: &Trace) -> Value {
    let judged = run.actions.iter().enumerate().flat_map(|(idx, action)| {
        let failed = action
            .judgements
            .iter()
            .filter(|judgement| judgement.outcome == Outcome::Failed);
        failed.map(move |judgement| (idx, judgement.witness.as_str()))
    });
    hardest_of_run(trace, judged).map_or(
        Value::Null,
        |pressed| json!({ "at": pressed.point_m, "thing": pressed.body(), "label": pressed.label(), "told": pressed.sentence(), "secs": pressed.secs }),
    )
}

/// Packs the details of a run, except its actions.
fn details(pack: &mut Pack, run: &RunDetail) {
    pack.set("run", run.row.run.as_str());
    pack.set("seed", run.seed);
    pack.set("reason", run.reason.clone());
    pack.set("discards", run.discards.clone());
    pack.set("world", run.world.as_str());
    pack.set("program", run.program_version.as_str());
    pack.set("base", run.robot_base.to_vec());
    pack.set("noise", json!(run.noise));
    let objects: Vec<Value> = run
        .objects
        .iter()
        .map(|object| {
            json!({
                "id": object.id, "model": object.model, "kind": names::local(&object.category), "role": role_name(object.role),
                "x": object.x, "y": object.y, "yaw": object.yaw, "mass": object.mass_kg, "friction": object.friction,
                "moved": object.displacement_m, "tilt": object.max_tilt_rad,
            })
        })
        .collect();
    pack.set("objects", objects);
}

/// Name of a role. Objects on the surface for placing are drawn like other objects.
fn role_name(role: Role) -> &'static str {
    if role == Role::PlaceOther {
        Role::Other.word()
    } else {
        role.word()
    }
}

/// Quantises seven columns for each track (position, quaternion). Returns the columns, the lowest
/// corner and the position step. Values that are not finite repeat the previous one.
fn columns(rows: &[Vec<f32>], slots: &[usize]) -> (Vec<Vec<i16>>, [f64; 3], f64) {
    let (low, grain) = corner(rows, slots);
    let mut columns: Vec<Vec<i16>> = (0..7 * slots.len())
        .map(|_| Vec::with_capacity(rows.len()))
        .collect();
    let mut last = vec![0i16; columns.len()];
    // Row by row, as they lie in memory.
    for row in rows {
        for ((slot, columns), last) in slots
            .iter()
            .zip(columns.chunks_mut(7))
            .zip(last.chunks_mut(7))
        {
            let values = row.get(7 * slot..7 * slot + 7).unwrap_or_default();
            for (part, value) in values
                .iter()
                .enumerate()
                .filter(|(_, value)| value.is_finite())
            {
                // Positions are relative to the lowest corner; quaternion components are absolute.
                let steps = match low.get(part) {
                    Some(low) => (f64::from(*value) - low) / grain,
                    None => f64::from(*value) / GRAIN_TURN,
                };
                // Positions use all 16 bits as unsigned integers; quaternion components are within
                // ±5000.
                last[part] = (steps.round().clamp(-32_768.0, 65_535.0) as i32) as i16;
            }
            for (column, last) in columns.iter_mut().zip(last) {
                column.push(*last);
            }
        }
    }
    (columns, low, grain)
}

/// Returns the lowest corner of all positions of some tracks, and the position step.
fn corner(rows: &[Vec<f32>], slots: &[usize]) -> ([f64; 3], f64) {
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for (row, slot) in rows
        .iter()
        .flat_map(|row| slots.iter().map(move |slot| (row, slot)))
    {
        let position = row.get(7 * slot..7 * slot + 3).unwrap_or_default();
        for (axis, value) in position
            .iter()
            .enumerate()
            .filter(|(_, value)| value.is_finite())
        {
            low[axis] = low[axis].min(*value);
            high[axis] = high[axis].max(*value);
        }
    }
    let low = low.map(|low| if low.is_finite() { f64::from(low) } else { 0.0 });
    let extent = low
        .iter()
        .zip(high)
        .map(|(low, high)| f64::from(high) - low)
        .fold(0.0, f64::max);
    (low, GRAIN_M.max(extent / f64::from(u16::MAX)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made_up::snapshot;
    use actcheck_data::{Colour, Frames, LinkState, Part, Shape};

    /// The mesh of a robot is in the page once, however many runs it has.
    #[test]
    fn the_appearance_of_bodies_is_shared_by_all_runs_of_a_campaign() {
        let look = |red: u8| {
            vec![SeenPart {
                part: Part {
                    pose: Pose::IDENTITY,
                    shape: Shape::Box { size: [0.1; 3] },
                },
                colour: Some(Colour([red, 0, 0])),
            }]
        };
        let mut state = snapshot(0.0);
        state.robot.links = ["hand", "pedestal"]
            .map(|name| LinkState {
                name: name.to_owned(),
                pose: Pose::IDENTITY,
            })
            .into();
        let trace = Trace {
            snapshots: vec![state],
            frames: Frames {
                names: vec!["glass_1".to_owned(), "robot/hand".to_owned()],
                ..Frames::default()
            },
            ..Trace::default()
        };
        let glass = ObjectDetail {
            id: "glass_1".to_owned(),
            model: "glass".to_owned(),
            category: String::new(),
            role: Role::Target,
            x: 0.0,
            y: 0.0,
            z: 0.0,
            yaw: 0.0,
            mass_kg: 1.0,
            friction: 1.0,
            restitution: 0.0,
            robot_distance_m: 1.0,
            neighbour_distance_m: None,
            target_distance_m: None,
            displacement_m: None,
            max_tilt_rad: None,
        };
        let mut replays = Replays::default();
        let appearances = Appearances {
            links: [("robot/hand", 1), ("robot/pedestal", 2)]
                .map(|(name, red)| (name.to_owned(), look(red)))
                .into(),
            models: [("glass".to_owned(), look(3))].into(),
            camera: None,
        };
        assert!(!replays.knows("a"));
        replays.set_appearances("a", Arc::new(appearances));
        assert!(replays.knows("a"));
        let mut of = |campaign: &str| {
            let bodies = replays.bodies((campaign, std::slice::from_ref(&glass)), Some(&trace));
            let named = |value: &Value| {
                let number = |key: &str| value[key].as_u64();
                (value["name"].to_string(), number("form"), number("seen"))
            };
            let tracks: Vec<_> = bodies.tracks.iter().map(named).collect();
            let still: Vec<_> = bodies.still.iter().map(named).collect();
            (tracks, still)
        };
        let (tracks, still) = of("a");
        // The shape of the glass is needed to measure distances.
        let of_hand = ("\"robot/hand\"".to_owned(), Some(2), None);
        assert_eq!(
            tracks,
            [("\"glass_1\"".to_owned(), Some(0), Some(1)), of_hand]
        );
        // The pedestal has no track and no collision shape.
        assert_eq!(still[1], ("\"robot/pedestal\"".to_owned(), Some(3), None));
        assert_eq!(of("a"), (tracks, still));
        // Of another campaign, nothing is known.
        let (tracks, still) = of("b");
        assert_eq!((tracks.len(), still.len()), (1, 1));
        assert_eq!(tracks[0].2, None);
        assert_eq!(replays.shapes.all().len(), 4);
    }

    /// The page may depend neither on the number of cores nor on how many runs are read at once.
    #[test]
    fn shapes_of_runs_beyond_the_room_are_forgotten() {
        let form = |size: f64| {
            let part = actcheck_data::Part {
                pose: actcheck_data::Pose::IDENTITY,
                shape: actcheck_data::Shape::Sphere { radius: size },
            };
            Form {
                name: "a".to_owned(),
                parts: vec![part],
            }
        };
        let mut shapes = Shapes::default();
        assert_eq!(
            [0.1, 0.2, 0.3].map(|size| shapes.of(&form(size))),
            [0, 1, 2]
        );
        shapes.truncate(1);
        assert_eq!([0.1, 0.3].map(|size| shapes.of(&form(size))), [0, 1]);
        assert_eq!(shapes.all().len(), 2);
    }

    #[test]
    fn trajectories_are_exact_to_a_tenth_of_a_millimetre() {
        let rows: Vec<Vec<f32>> = (0..50)
            .map(|at| vec![at as f32 * 0.02 - 3.0, 1.5, f32::NAN, 0.0, 0.0, -0.6, 0.8])
            .collect();
        let (columns, low, grain) = columns(&rows, &[0]);
        assert_eq!((columns.len(), grain), (7, GRAIN_M));
        for (row, code) in rows.iter().zip(&columns[0]) {
            let value = low[0] + f64::from(*code as u16) * grain;
            assert!((value - f64::from(row[0])).abs() <= grain / 2.0 + 1e-6);
        }
        assert!((f64::from(columns[5][7]) * GRAIN_TURN + 0.6).abs() < GRAIN_TURN);
        assert_eq!(columns[2], vec![0; 50]);
    }
}
