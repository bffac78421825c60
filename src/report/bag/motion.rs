//! Poses and joints over time.
//!
//! Frames of the robot's links have the names of the links, so that its model fits; those of objects
//! have the objects' ids. Each has one parent, up to `map`.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Isometry3;

use crate::bag::cdr::{Cdr, Stamp};
use crate::bag::recorder::Recorder;
use crate::bag::types::{BASE_BELIEVED, JOINT_STATES, TF, TF_STATIC};
use actcheck_data::{ModelTree, Pose, Trace};

/// The frame of the world.
pub(super) const MAP: &str = "map";

/// The frames of a run.
pub(super) struct Frames {
    /// Parent of each frame but `map`.
    parents: BTreeMap<String, String>,
    /// Poses that never change. Frame: the parent's.
    fixed: BTreeMap<String, Isometry3<f64>>,
    /// Frames that move, with the places of their tracks.
    moving: BTreeMap<String, usize>,
    /// Poses in the first state. Frame: world.
    first: BTreeMap<String, Isometry3<f64>>,
    /// Names of links, which objects can't have.
    links: BTreeSet<String>,
    /// Rigid links that the trace does not know: each with its parent and its pose in that frame, after
    /// its parent.
    rigid: Vec<(String, String, Isometry3<f64>)>,
}

impl Frames {
    /// The frames of a trace. Without a tree, `map` is the parent of all links.
    pub fn of(trace: &Trace, tree: Option<&ModelTree>) -> Self {
        let first = trace.snapshots.first();
        let links = first.into_iter().flat_map(|state| &state.robot.links);
        let mut found = Self {
            parents: BTreeMap::new(),
            fixed: BTreeMap::new(),
            moving: BTreeMap::new(),
            first: BTreeMap::new(),
            links: links
                .clone()
                .map(|link| &link.name)
                .chain(
                    tree.iter()
                        .flat_map(|tree| tree.links.iter().map(|link| &link.name)),
                )
                .cloned()
                .collect(),
            rigid: Vec::new(),
        };
        let at_first: Vec<(String, Isometry3<f64>)> = links
            .map(|link| (link.name.clone(), link.pose.to_isometry()))
            .chain(first.into_iter().flat_map(|state| {
                let bodies = state.bodies.iter();
                bodies.map(|body| (found.name(&body.id), body.pose.to_isometry()))
            }))
            .collect();
        found.first.extend(at_first);
        for (slot, body) in trace.frames.names.iter().enumerate() {
            found.moving.insert(found.name(body), slot);
        }
        found.join(tree);
        found
    }

    /// The name of the frame of a body of a trace.
    pub fn name(&self, body: &str) -> String {
        match body.strip_prefix("robot/") {
            Some(link) => link.to_owned(),
            None if body == MAP || self.links.contains(body) => format!("object/{body}"),
            None => body.to_owned(),
        }
    }

    /// Gives each frame its parent.
    fn join(&mut self, tree: Option<&ModelTree>) {
        let names = self.first.keys().chain(self.moving.keys());
        self.parents = names.map(|name| (name.clone(), MAP.to_owned())).collect();
        let joints = tree.map_or(&[][..], |tree| &tree.joints);
        // Links that the trace does not know, such as marks, are rigid.
        let mut is_complete = false;
        while !is_complete {
            is_complete = true;
            for joint in joints.iter().filter(|joint| joint.child != MAP) {
                let Some(above) = self.first.get(&joint.parent).copied() else {
                    continue;
                };
                if !self.first.contains_key(&joint.child) {
                    is_complete = false;
                    let (child, parent) = (joint.child.clone(), joint.parent.clone());
                    self.first.insert(child.clone(), above * joint.origin);
                    self.rigid.push((child, parent, joint.origin));
                }
            }
        }
        let mut fixed: BTreeSet<&String> = self.rigid.iter().map(|(child, ..)| child).collect();
        for joint in joints {
            let are_known = [&joint.child, &joint.parent].map(|link| self.first.contains_key(link));
            if joint.child != MAP && are_known == [true; 2] {
                self.parents
                    .insert(joint.child.clone(), joint.parent.clone());
                if !joint.motion.moves() {
                    fixed.insert(&joint.child);
                }
            }
        }
        let carried: BTreeSet<&str> = self
            .rigid
            .iter()
            .map(|(child, ..)| child.as_str())
            .collect();
        for (name, pose) in &self.first {
            let parent = self.parents.get(name).map_or(MAP, String::as_str);
            let is_still =
                |frame: &str| !self.moving.contains_key(frame) && !carried.contains(frame);
            if fixed.contains(name) || is_still(name) && is_still(parent) {
                let above = self.first.get(parent).copied().unwrap_or_default();
                self.fixed.insert(name.clone(), above.inv_mul(pose));
            }
        }
    }

    /// Adds the messages with all poses.
    pub fn record(&self, recorder: &mut Recorder, trace: &Trace) {
        let begin = start_secs(trace);
        let fixed: Vec<(&String, Isometry3<f64>)> = self
            .fixed
            .iter()
            .map(|(name, pose)| (name, *pose))
            .collect();
        let at = Stamp::of_secs(begin);
        recorder.add(TF_STATIC, at, self.transforms(at, &fixed));
        let mut last: BTreeMap<&String, Isometry3<f64>> = self
            .first
            .iter()
            .map(|(name, pose)| (name, *pose))
            .collect();
        for (idx, row) in trace.frames.rows.iter().enumerate() {
            for (name, slot) in &self.moving {
                last.extend(track(row, *slot).map(|pose| (name, pose)));
            }
            for (child, parent, pose) in &self.rigid {
                let above = last.get(parent).copied().unwrap_or_default();
                last.insert(child, above * pose);
            }
            let moved = self
                .parents
                .iter()
                .filter(|(name, _)| !self.fixed.contains_key(*name));
            let relative = moved.filter_map(|(name, parent)| {
                let above = last.get(parent).copied().unwrap_or_default();
                Some((name, above.inv_mul(last.get(name)?)))
            });
            let all: Vec<(&String, Isometry3<f64>)> = relative.collect();
            let at = Stamp::of_secs(begin + idx as f64 * trace.frames.period_secs);
            recorder.add(TF, at, self.transforms(at, &all));
        }
    }

    /// `tf2_msgs/TFMessage`.
    fn transforms(&self, at: Stamp, poses: &[(&String, Isometry3<f64>)]) -> Cdr {
        let mut message = Cdr::new();
        message.each(poses, |message, (name, pose)| {
            message.header(at, self.parents.get(*name).map_or(MAP, String::as_str));
            message.text(name);
            message.pose(&Pose::from_isometry(pose));
        });
        message
    }
}

/// The pose of a track in a row of frames; `None` if it is not finite.
fn track(row: &[f32], slot: usize) -> Option<Isometry3<f64>> {
    let values: [f32; 7] = row.get(7 * slot..7 * slot + 7)?.try_into().ok()?;
    let [x, y, z, i, j, k, w] = values.map(f64::from);
    let pose = Pose {
        position: [x, y, z],
        rotation: [i, j, k, w],
    };
    values
        .iter()
        .all(|value| value.is_finite())
        .then(|| pose.to_isometry())
}

/// Time of the first state. Unit: seconds since the scene was built.
pub(super) fn start_secs(trace: &Trace) -> f64 {
    trace.snapshots.first().map_or(0.0, |state| state.time_secs)
}

/// Adds the measurements of the joints, and the believed pose of a base that can move.
pub(super) fn record_joints(recorder: &mut Recorder, trace: &Trace) {
    let mut recorded = None;
    for ((course, action), state) in trace
        .robot_courses
        .iter()
        .zip(&trace.actions)
        .zip(&trace.snapshots)
    {
        for moment in course.motion.moments() {
            let at = Stamp::of_secs(state.time_secs + f64::from(moment.time_secs));
            // The first moment of an action is the last one of the action before it.
            if recorded.is_some_and(|last| at <= last) {
                continue;
            }
            recorded = Some(at);
            let joints: Vec<_> = moment.joints().collect();
            let mut message = Cdr::new();
            message.header(at, "");
            message.each(&course.motion.joints, |message, name| message.text(name));
            let of_joints = [
                joints
                    .iter()
                    .map(|joint| joint.position)
                    .collect::<Vec<_>>(),
                joints.iter().map(|joint| joint.velocity).collect(),
                joints.iter().map(|joint| joint.effort).collect(),
            ];
            for values in of_joints {
                message.each(&values, |message, value| message.f64(f64::from(*value)));
            }
            recorder.add(JOINT_STATES, at, message);
            if action.base.is_some() {
                let [x, y, heading] = moment.base_believed.map(f64::from);
                let mut message = Cdr::new();
                message.header(at, MAP);
                message.pose(&Pose::upright([x, y, 0.0], heading));
                recorder.add(BASE_BELIEVED, at, message);
            }
        }
    }
}
