//! Paths of base, hand and target during a run, one for each action.

use nalgebra::{Isometry3, Point3};

use actcheck_data::{Pose, Snapshot, Trace};

/// The body that moves along a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Mover {
    Base,
    Hand,
    Target,
}

/// A path during one action.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Path {
    pub(super) mover: Mover,
    /// Index of the action.
    pub(super) action: usize,
    /// Frame: world. Unit: metres.
    pub(super) points: Vec<[f64; 3]>,
}

/// Minimum length of a path. Unit: metres.
const SHORTEST_M: f64 = 0.01;
/// Drift below this is not measurable, because frames are rounded and the last one is up to 0.1 s
/// old. Unit: metres.
const MEASURABLE_M: f64 = 0.003;

/// All paths that are long enough to draw.
pub(super) fn paths(trace: &Trace, target: Option<&str>) -> Vec<Path> {
    let followed = [
        (Mover::Base, base(trace)),
        (Mover::Hand, hand(trace)),
        (
            Mover::Target,
            target.and_then(|id| Some((slot(trace, id)?, Isometry3::identity()))),
        ),
    ];
    let spans = spans(trace);
    let mut paths = Vec::new();
    for (mover, (track, offset)) in followed
        .into_iter()
        .filter_map(|(mover, found)| Some((mover, found?)))
    {
        let points: Vec<[f64; 3]> = (0..trace.frames.rows.len())
            .filter_map(|row| pose_at(trace, row, track))
            .map(|pose| (pose * offset * Point3::origin()).coords.into())
            .collect();
        for (action, (first, last)) in spans.iter().enumerate() {
            let Some(points) = points.get(*first..=(*last).min(points.len().saturating_sub(1)))
            else {
                continue;
            };
            if length(points) > SHORTEST_M {
                paths.push(Path {
                    mover,
                    action,
                    points: points.to_vec(),
                });
            }
        }
    }
    paths
}

/// First and last frame of each action. The last frame of an action is the first of the next.
fn spans(trace: &Trace) -> Vec<(usize, usize)> {
    let mut first = 0;
    let mut spans = Vec::new();
    for pair in trace.snapshots.windows(2) {
        let frames = (pair[1].time_secs - pair[0].time_secs) / trace.frames.period_secs + 1e-6;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "frames of one run"
        )]
        let last = first + frames.clamp(0.0, 1e9) as usize;
        spans.push((first, last));
        first = last;
    }
    spans
}

/// Pose of a track in a frame. Returns `None` if it is missing or not finite.
pub(super) fn pose_at(trace: &Trace, row: usize, slot: usize) -> Option<Isometry3<f64>> {
    let values = trace.frames.rows.get(row)?.get(7 * slot..7 * slot + 7)?;
    let value = |idx: usize| f64::from(values[idx]);
    let pose = Pose {
        position: [value(0), value(1), value(2)],
        rotation: [value(3), value(4), value(5), value(6)],
    };
    let finite = values.iter().all(|value| value.is_finite());
    finite.then(|| pose.to_isometry())
}

fn slot(trace: &Trace, name: &str) -> Option<usize> {
    trace.frames.names.iter().position(|track| track == name)
}

/// The link that carries the grasp frame, and the frame's pose relative to it.
fn hand(trace: &Trace) -> Option<(usize, Isometry3<f64>)> {
    carrier(trace, |snapshot| snapshot.robot.gripper.to_isometry())
}

/// The link that carries the base frame, and the frame's pose relative to it.
fn base(trace: &Trace) -> Option<(usize, Isometry3<f64>)> {
    let base = |snapshot: &Snapshot| {
        let [x, y, heading] = snapshot.robot.base_true;
        Pose::upright([x, y, 0.0], heading).to_isometry()
    };
    carrier(trace, base)
}

/// The link to which a frame is fixed: the frame's relative pose is the same at the start and at
/// the end. If there are several, the nearest.
fn carrier(
    trace: &Trace,
    frame: impl Fn(&Snapshot) -> Isometry3<f64>,
) -> Option<(usize, Isometry3<f64>)> {
    let (first, last) = (
        frame(trace.snapshots.first()?),
        frame(trace.snapshots.last()?),
    );
    let links = trace
        .frames
        .names
        .iter()
        .enumerate()
        .filter(|(_, name)| name.starts_with("robot/"));
    let n_rows = trace.frames.rows.len();
    let offsets = links.filter_map(|(slot, _)| {
        let began = pose_at(trace, 0, slot)?.inverse() * first;
        let ended = pose_at(trace, n_rows.checked_sub(1)?, slot)?.inverse() * last;
        let drift = (began.translation.vector - ended.translation.vector).norm();
        Some((
            drift.max(MEASURABLE_M) * 100.0 + began.translation.vector.norm(),
            slot,
            began,
        ))
    });
    offsets
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, slot, offset)| (slot, offset))
}

fn length(points: &[[f64; 3]]) -> f64 {
    points
        .windows(2)
        .map(|pair| {
            (0..3)
                .map(|axis| (pair[1][axis] - pair[0][axis]).powi(2))
                .sum::<f64>()
                .sqrt()
        })
        .sum()
}
