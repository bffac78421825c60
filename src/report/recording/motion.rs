//! Records positions over time: fixed bodies, tracks of moving bodies, and percepts.

use std::collections::BTreeMap;

use re_log_types::EntityPath;
use re_sdk_types::AsComponents;
use re_sdk_types::archetypes::{Transform3D, ViewCoordinates};
use re_sdk_types::datatypes::Quaternion;

use crate::look::Look;
use crate::recording::solids::Drawn;
use crate::recording::stream::{Recording, RecordingFault, place};
use actcheck_base::names;
use actcheck_data::{BodyState, Form, Pose, Role, Trace};
use actcheck_history::RunDetail;

/// Root entity of everything in 3D. Frame: world.
const SCENE: &str = "scene";
/// Parent entity of the objects, by id. Links are its siblings, as `robot/LINK`.
const OBJECTS: &str = "objects";
/// Entity of the perceived boxes; separate from the bodies, so that it can be hidden.
const PERCEIVED: &str = "perceived";

/// Records the bodies of a run.
///
/// # Errors
/// The rerun library rejects a component.
pub(super) fn record(
    recording: &mut Recording<'_>,
    run: &RunDetail,
    trace: &Trace,
) -> Result<(), RecordingFault> {
    recording.log_static(place([SCENE]), &[&ViewCoordinates::RIGHT_HAND_Z_UP()])?;
    let known = Known::of(run, trace);
    for (slot, name) in trace.frames.names.iter().enumerate() {
        // A link without geometry is invisible.
        let Some(solids) = known.solids(name) else {
            continue;
        };
        recording.log_static(path(name), &references(&solids))?;
        let (positions, turns) = track(&trace.frames.rows, slot);
        let poses = Transform3D::update_fields()
            .with_many_translation(positions)
            .with_many_quaternion(turns);
        let secs =
            (0..trace.frames.rows.len()).map(|frame| frame as f64 * trace.frames.period_secs);
        recording.log_series(path(name), secs, poses.columns_of_unit_batches()?)?;
    }
    let moves = |body: &&&BodyState| trace.frames.names.contains(&body.id);
    for body in known.bodies.values().filter(|body| !moves(body)) {
        let Some(solids) = known.solids(&body.id) else {
            continue;
        };
        let pose = transform(&body.pose);
        let mut all = references(&solids);
        all.push(&pose);
        recording.log_static(path(&body.id), &all)?;
    }
    let first = trace.snapshots.iter().take(1);
    for (form, pose) in first.flat_map(|state| trace.still_links(state)) {
        let Some(solids) = known.solids(&form.name) else {
            continue;
        };
        let pose = transform(&pose);
        let mut all = references(&solids);
        all.push(&pose);
        recording.log_static(path(&form.name), &all)?;
    }
    perceived(recording, trace)
}

fn references(solids: &[Box<dyn AsComponents>]) -> Vec<&dyn AsComponents> {
    solids.iter().map(AsRef::as_ref).collect()
}

fn path(name: &str) -> EntityPath {
    match name.split_once('/') {
        Some((robot, link)) => place([SCENE, robot, link]),
        None => place([SCENE, OBJECTS, name]),
    }
}

/// Lookup tables of bodies by name.
struct Known<'a> {
    forms: BTreeMap<&'a str, &'a Form>,
    bodies: BTreeMap<&'a str, &'a BodyState>,
    roles: BTreeMap<&'a str, Role>,
}

impl<'a> Known<'a> {
    fn of(run: &'a RunDetail, trace: &'a Trace) -> Self {
        let first = trace
            .snapshots
            .iter()
            .take(1)
            .flat_map(|state| &state.bodies);
        Self {
            forms: trace
                .forms
                .iter()
                .map(|form| (form.name.as_str(), form))
                .collect(),
            bodies: first.map(|body| (body.id.as_str(), body)).collect(),
            roles: run
                .objects
                .iter()
                .map(|object| (object.id.as_str(), object.role))
                .collect(),
        }
    }

    /// Returns the solids of a body, or its bounding box if its shape is unknown. Returns `None` if
    /// neither is known.
    fn solids(&self, name: &str) -> Option<Vec<Box<dyn AsComponents>>> {
        let body = self.bodies.get(name).copied();
        let drawn = match (self.forms.get(name), body) {
            (Some(form), _) => Drawn::of(&form.parts),
            (None, Some(body)) => Drawn::around(body),
            (None, None) => return None,
        };
        let robot = name.starts_with("robot/");
        Some(drawn.recorded(if robot {
            Look::ROBOT
        } else {
            Look::of(self.roles.get(name).copied(), body)
        }))
    }
}

/// Positions and orientations of one track. Poses that are not finite repeat the previous one.
/// Units: metres, unit quaternions.
fn track(rows: &[Vec<f32>], slot: usize) -> (Vec<[f32; 3]>, Vec<Quaternion>) {
    let mut last = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let poses = rows.iter().map(|row| {
        let pose = row
            .get(7 * slot..7 * slot + 7)
            .and_then(|pose| <[f32; 7]>::try_from(pose).ok());
        if let Some(pose) = pose.filter(|pose| pose.iter().all(|value| value.is_finite())) {
            last = pose;
        }
        let [x, y, z, i, j, k, w] = last;
        ([x, y, z], Quaternion::from_xyzw([i, j, k, w]))
    });
    poses.unzip()
}

fn transform(pose: &Pose) -> Transform3D {
    let turn = Quaternion::from_xyzw(pose.rotation.map(|value| value as f32));
    Transform3D::from_translation(pose.position.map(|value| value as f32)).with_quaternion(turn)
}

/// Records the objects perceived during each action as wireframe boxes, shown from the end of the
/// action on.
fn perceived(recording: &mut Recording<'_>, trace: &Trace) -> Result<(), RecordingFault> {
    let begin = trace.snapshots.first().map_or(0.0, |state| state.time_secs);
    for (idx, action) in trace.actions.iter().enumerate() {
        let asked = action
            .percepts
            .iter()
            .map(|percept| (percept.id.as_str(), &percept.pose, percept.size_m));
        let things = action
            .perceived
            .iter()
            .flat_map(|perceived| &perceived.things);
        let found = things.map(|thing| {
            (
                thing.category.as_deref().map_or("?", names::local),
                &thing.pose,
                thing.size_m,
            )
        });
        let seen: Vec<(&str, &Pose, [f64; 3])> = asked.chain(found).collect();
        let state = trace.snapshots.get(idx + 1).or(trace.snapshots.last());
        let Some(end) = state.filter(|_| !seen.is_empty()) else {
            continue;
        };
        let mut boxes = Drawn::default();
        for (_, foot, size) in &seen {
            let [x, y, z] = foot.position;
            boxes.box_at(
                &Pose {
                    position: [x, y, z + size[2] / 2.0],
                    rotation: foot.rotation,
                },
                *size,
            );
        }
        let boxes = boxes
            .boxes(Look::PERCEIVED)
            .with_labels(seen.iter().map(|(name, ..)| *name))
            .with_show_labels(false);
        recording.log_at(place([SCENE, PERCEIVED]), end.time_secs - begin, &boxes)?;
    }
    Ok(())
}
