//! Likely grasp frames between two fingers.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::body::chain;
use super::effort::Effort;
use crate::description::RobotModel;
use crate::gripper::Probe;
use crate::kinematics::motion;
use actcheck_data::{Part, Shape};

/// Distances of the grasp frame from the tips of the fingers. Unit: metres. Skills assume that
/// fingers reach as much further as the first of them; the others are for short pads, and for
/// fingers that turn, which open wider there.
const DEPTHS_M: [f64; 4] = [0.025, 0.018, 0.012, 0.045];
/// Length of the fingertips, which decide about the other directions. Unit: metres.
const TIP_M: f64 = 0.05;
/// Axes closer than this to an axis of the palm are taken to be that axis. Unit: cosine (about 10
/// degrees).
const ALIGNED_COSINE: f64 = 0.985;
/// Intervals of the way of two fingers at which their gap is compared.
const EIGHTHS: u64 = 8;
/// Least change of the gap between two fingers. Unit: metres.
pub(super) const LEAST_CHANGE_M: f64 = 0.008;
/// Weight of a direction from the palm's origin: its frame may be anywhere.
const FROM_PALM: f64 = 0.9;
/// Weight of a direction from the middle of the palm's shapes.
const FROM_SHAPES: f64 = 0.8;

/// Returns the corners of a shape, or of the box around it, in its link's frame.
pub(super) fn corners(part: &Part) -> Vec<Point3<f64>> {
    let at = part.pose.to_isometry();
    match &part.shape {
        Shape::Hull { points, .. } => points
            .iter()
            .map(|point| at * Point3::from(*point))
            .collect(),
        Shape::Mesh { mesh } => mesh
            .vertices
            .iter()
            .map(|point| at * Point3::from(*point))
            .collect(),
        _ => {
            let (low, high) = part.bounds();
            let pick = |axis: usize, bit: usize| if bit == 0 { low[axis] } else { high[axis] };
            (0..8)
                .map(|bits: usize| {
                    Point3::new(pick(0, bits & 1), pick(1, bits & 2), pick(2, bits & 4))
                })
                .collect()
        }
    }
}

/// The corners of two fingers at one opening, in the palm's frame.
struct FingerCorners {
    left: Vec<Point3<f64>>,
    right: Vec<Point3<f64>>,
}

impl FingerCorners {
    fn new(model: &RobotModel, links: [usize; 2], poses: &[Isometry3<f64>], palm: usize) -> Self {
        let [left, right] = links.map(|link| {
            let from_link = poses[palm].inverse() * poses[link];
            let points = model.links[link].solids.iter().flat_map(corners);
            points.map(|point| from_link * point).collect::<Vec<_>>()
        });
        Self { left, right }
    }

    fn apart(&self) -> Vector3<f64> {
        middle(&self.left) - middle(&self.right)
    }
}

/// Returns the middle of the box around points.
fn middle(points: &[Point3<f64>]) -> Point3<f64> {
    let (low, high) = points.iter().fold(
        (
            Vector3::repeat(f64::INFINITY),
            Vector3::repeat(f64::NEG_INFINITY),
        ),
        |(low, high), point| (low.inf(&point.coords), high.sup(&point.coords)),
    );
    Point3::from((low + high) / 2.0)
}

/// A point behind the fingers, in the palm's frame: the middle of the palm's shapes, or its origin
/// if it has none or is itself a finger.
pub(super) fn behind(model: &RobotModel, palm: usize, links: [usize; 2]) -> Point3<f64> {
    let points: Vec<Point3<f64>> = model.links[palm].solids.iter().flat_map(corners).collect();
    if points.is_empty() || links.contains(&palm) {
        Point3::origin()
    } else {
        middle(&points)
    }
}

/// Where fingers begin, and which of them point away from there.
struct Root {
    from: Point3<f64>,
    sides: [bool; 2],
}

impl Root {
    /// The direction of the fingers.
    fn ahead(&self, pair: &FingerCorners) -> Vector3<f64> {
        let to = match self.sides {
            [true, false] => middle(&pair.left),
            [false, true] => middle(&pair.right),
            _ => nalgebra::center(&middle(&pair.left), &middle(&pair.right)),
        };
        to - self.from
    }
}

/// Returns likely grasp frames in the palm's frame. `ends` are the fingers at both ends of their
/// way.
fn likely(ends: &[FingerCorners; 2], from: &Root) -> Vec<Isometry3<f64>> {
    let mut found = Vec::new();
    let moved = ends[0].apart() - ends[1].apart();
    for across in [moved, ends[0].apart(), ends[1].apart()] {
        for open in ends {
            found.extend(
                DEPTHS_M
                    .into_iter()
                    .filter_map(|depth_m| at(open, &across, from, depth_m)),
            );
        }
    }
    found
}

/// The frame with its y axis along `across`, and its x axis from a point towards the fingers.
fn at(
    pair: &FingerCorners,
    across: &Vector3<f64>,
    from: &Root,
    depth_m: f64,
) -> Option<Isometry3<f64>> {
    let y = aligned(across.try_normalize(1e-4)?);
    // The axis points from the right finger to the left one.
    let y = if y.dot(&pair.apart()) < 0.0 { -y } else { y };
    let ahead = from.ahead(pair);
    let x = aligned((ahead - y * ahead.dot(&y)).try_normalize(1e-3)?);
    let x = (x - y * x.dot(&y)).try_normalize(1e-3)?;
    let z = x.cross(&y);
    let along = |axis: &Vector3<f64>, points: &[Point3<f64>]| -> (f64, f64) {
        let values = points.iter().map(|point| point.coords.dot(axis));
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        })
    };
    let (left, right) = (along(&x, &pair.left), along(&x, &pair.right));
    let (tip, root) = (left.1.min(right.1), left.0.max(right.0));
    let depth = depth_m.min((tip - root) / 2.0);
    // Only the parts near the tips decide about the other axes.
    let near = |points: &[Point3<f64>]| -> Vec<Point3<f64>> {
        points
            .iter()
            .copied()
            .filter(|point| point.coords.dot(&x) > tip - TIP_M)
            .collect()
    };
    let (left, right) = (near(&pair.left), near(&pair.right));
    let (left_z, right_z) = (along(&z, &left), along(&z, &right));
    let height = f64::midpoint(left_z.0.max(right_z.0), left_z.1.min(right_z.1));
    let (left_y, right_y) = (along(&y, &left), along(&y, &right));
    let side = f64::midpoint(left_y.0, right_y.1);
    let origin = x * (tip - depth) + y * side + z * height;
    origin.iter().all(|value| value.is_finite()).then(|| {
        let axes = Matrix3::from_columns(&[x, y, z]);
        let rotation =
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
        Isometry3::from_parts(Translation3::from(origin), rotation)
    })
}

/// Returns the nearest axis of the frame if a direction is close to it.
fn aligned(direction: Vector3<f64>) -> Vector3<f64> {
    let axis = direction.iamax();
    if direction[axis].abs() > ALIGNED_COSINE {
        let mut unit = Vector3::zeros();
        unit[axis] = direction[axis].signum();
        return unit;
    }
    direction
}

/// Likely grasp frames of a pair, in the palm's frame, with weights: those at which both fingers
/// have surfaces at several openings. The fingers point away from their joints or, less likely,
/// from the palm's origin or shapes. The search ends early without steps left, of which each gap
/// takes some.
pub(super) fn frames(
    model: &RobotModel,
    palm: usize,
    (links, named): ([usize; 2], &[usize]),
    steps_of_gap: u64,
    effort: &mut Effort,
) -> Vec<(f64, Isometry3<f64>)> {
    let ways: &[[bool; 2]] = if named.len() == 1 {
        &[[true, true]]
    } else {
        &[[true, true], [true, false]]
    };
    let inner = chain(model, palm);
    let joints = links.map(|link| {
        chain(model, link)
            .into_iter()
            .find(|joint| !inner.contains(joint))
    });
    let origins: Vec<Point3<f64>> = joints
        .iter()
        .flatten()
        .map(|joint| Point3::from(model.joints[*joint].origin.translation.vector))
        .collect();
    let middle =
        origins.iter().map(|at| at.coords).sum::<Vector3<f64>>() / origins.len().max(1) as f64;
    let roots = [
        (
            1.0,
            Root {
                from: Point3::from(middle),
                sides: joints.map(|joint| joint.is_some()),
            },
        ),
        (
            FROM_PALM,
            Root {
                from: Point3::origin(),
                sides: [true; 2],
            },
        ),
        (
            FROM_SHAPES,
            Root {
                from: behind(model, palm, links),
                sides: [true; 2],
            },
        ),
    ];
    let mut found: Vec<(f64, Isometry3<f64>)> = Vec::new();
    for way in ways {
        let ends = [
            posture(model, named, *way, 1.0),
            posture(model, named, *way, 0.0),
        ];
        let ends =
            ends.map(|positions| FingerCorners::new(model, links, &poses(model, &positions), palm));
        for (weight, frame) in roots
            .iter()
            .flat_map(|(w, root)| likely(&ends, root).into_iter().map(move |f| (*w, f)))
        {
            let is_known = found.iter().any(|(_, known)| {
                let off = (known.translation.vector - frame.translation.vector).norm();
                off < 1e-3 && known.rotation.angle_to(&frame.rotation) < 1e-2
            });
            if is_known {
                continue;
            }
            if effort.is_spent() {
                return found;
            }
            effort.spend(2 * (EIGHTHS + 1) * steps_of_gap);
            if closes(model, palm, links, &frame, |share| {
                posture(model, named, *way, share)
            }) {
                found.push((weight, frame));
            }
        }
    }
    found
}

/// Positions at a share of the way between the ends of the named joints; of the second one, in the
/// opposite direction if the ends differ.
fn posture(model: &RobotModel, named: &[usize], at_upper: [bool; 2], share: f64) -> Vec<f64> {
    let mut positions: Vec<f64> = model
        .joints
        .iter()
        .map(|joint| 0.0_f64.clamp(joint.lower, joint.upper))
        .collect();
    for (joint, rises) in named.iter().zip(at_upper) {
        let (lower, upper) = (
            model.joints[*joint].lower.max(-2.0),
            model.joints[*joint].upper.min(2.0),
        );
        positions[*joint] = lower + (upper - lower) * if rises { share } else { 1.0 - share };
    }
    // Leaders come before their followers, or the chain is longer than one.
    for _ in 0..2 {
        for idx in 0..positions.len() {
            if let Some((leader, factor, offset)) = model.joints[idx].mimic {
                positions[idx] = factor * positions[leader] + offset;
            }
        }
    }
    positions
}

/// Whether the gap between two fingers is measurable at two openings at least, and changes.
fn closes(
    model: &RobotModel,
    palm: usize,
    links: [usize; 2],
    frame: &Isometry3<f64>,
    posture: impl Fn(f64) -> Vec<f64>,
) -> bool {
    let [left, right] = links;
    [[left, right], [right, left]].into_iter().any(|links| {
        let probe = Probe::new(model, links, (palm, *frame));
        let gaps =
            (0..=EIGHTHS).filter_map(|eighth| probe.gap(&posture(eighth as f64 / EIGHTHS as f64)));
        let widths: Vec<f64> = gaps.map(|gap| gap.width_m()).collect();
        let (least, most) = widths
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), w| {
                (a.min(*w), b.max(*w))
            });
        widths.len() >= 2 && most - least > LEAST_CHANGE_M
    })
}

fn poses(model: &RobotModel, positions: &[f64]) -> Vec<Isometry3<f64>> {
    let mut poses = vec![Isometry3::identity()];
    for (joint, position) in model.joints.iter().zip(positions) {
        poses.push(poses[joint.parent] * joint.origin * motion(joint, *position));
    }
    poses
}
