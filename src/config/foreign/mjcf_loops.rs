//! Closed loops of links in MJCF, such as four-bar linkages: how their joints follow the one with
//! the motor.
//!
//! A robot is a tree here. Each `<connect>` closes a loop of it, so that some of its joints follow
//! others. Their positions are found on the range of the motor's joint by Gauss-Newton steps, and a
//! straight line is fitted to them.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{DMatrix, DVector, Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::foreign::mjcf_budget::Budget;
use crate::foreign::mjcf_compiler::{Compiler, Item};
use crate::foreign::mjcf_couplings::{Couplings, Mimic, elements, not_linear};
use crate::foreign::xml::{self, Bound, Node, Reader};

/// Positions on the range of the leading joint at which its followers are found.
const SAMPLES: usize = 40;
/// Most steps of a solution.
const MOST_STEPS: usize = 30;
/// Most loops of a file that are closed, and most joints without a motor in one mechanism: a
/// gripper has a tenth of them.
const MOST_LOOPS: usize = 200;
const MOST_PASSIVE: usize = 12;
/// Weight of the distance between two points that a loop connects, against 1 for the position of
/// the stiffest spring. Unit: 1/m.
const CLOSED: f64 = 1e5;
/// Weight of a joint's own position: a joint that no spring and no loop moves stays where it is.
const AT_REST: f64 = 1e-3;
/// Largest distance between connected points. Unit: metres.
const GAP_M: f64 = 1e-3;
/// Largest deviation from a straight line that is not reported. Units: radians or metres.
const BENT: f64 = 0.02;

/// A joint in the frame of its body.
struct Hinge {
    name: String,
    axis: Unit<Vector3<f64>>,
    at: Vector3<f64>,
    slides: bool,
    range: Option<[f64; 2]>,
    /// Position where the bodies are as the file places them.
    start: f64,
    stiffness: f64,
    rest: f64,
}

struct MjcfBody {
    parent: Option<usize>,
    pose: Isometry3<f64>,
    hinges: Vec<usize>,
}

/// The context in which the bodies of a file are read.
struct Walk<'a, 'r> {
    compiler: &'a Compiler,
    budget: &'a Budget,
    reader: &'a mut Reader<'r>,
}

/// Two points that coincide, each in the frame of its body; a body that is `None` is the world.
struct Closure<'a> {
    node: Node<'a>,
    ends: [(Option<usize>, Point3<f64>); 2],
    /// Joints that move one of the points, but not both.
    hinges: BTreeSet<usize>,
}

/// The bodies and joints of a file.
#[derive(Default)]
pub(super) struct BodyTree {
    bodies: Vec<MjcfBody>,
    hinges: Vec<Hinge>,
    names: BTreeMap<String, usize>,
    /// Bodies of the sites, with their places.
    sites: BTreeMap<String, (Option<usize>, Point3<f64>)>,
}

/// Returns the joints that follow others because of closed loops.
pub(super) fn couplings(
    root: Node,
    compiler: &Compiler,
    (mut tree, known): (BodyTree, &Couplings),
    reader: &mut Reader,
) -> BTreeMap<String, Mimic> {
    let mut found = BTreeMap::new();
    for hinge in &mut tree.hinges {
        hinge.range = hinge.range.or(known.ranges.get(&hinge.name).copied());
    }
    let follows = |hinge: &usize| known.mimics.contains_key(&tree.hinges[*hinge].name);
    let is_passive = |hinge: &usize| !follows(hinge) && known.is_passive(&tree.hinges[*hinge].name);
    let loops = elements(root, "equality")
        .filter(|node| node.has_tag_name("connect") && node.attribute("active") != Some("false"));
    let mut closures = Vec::new();
    for (idx, node) in loops.enumerate() {
        if idx == MOST_LOOPS {
            let message =
                format!("this loop of links is left open: it is not among the first {MOST_LOOPS}");
            let help = "its links then stay where the file puts them, as those of further loops do";
            reader.warning("W036", node, message, help);
            break;
        }
        match tree.closure(node, compiler, reader) {
            Some(closure) if closure.hinges.is_empty() => {}
            Some(closure) => closures.push(closure),
            None => {
                let message =
                    "this loop of links is left open: it names no body or site of this file";
                let help = "its links then stay where the file puts them; bodies of attached models \
                            can't be connected here";
                reader.warning("W036", node, message.to_owned(), help);
            }
        }
    }
    for group in together(closures, is_passive) {
        let hinges: BTreeSet<usize> = group
            .iter()
            .flat_map(|closure| closure.hinges.iter().copied())
            .collect();
        let mut passive: Vec<usize> = hinges.iter().copied().filter(is_passive).collect();
        let mut leaders: Vec<usize> = hinges
            .iter()
            .copied()
            .filter(|hinge| !is_passive(hinge))
            .collect();
        if known.actuated.is_none() {
            // The first joint of the file is then as good as any other.
            (leaders, passive) = (
                hinges.iter().copied().take(1).collect(),
                hinges.iter().copied().skip(1).collect(),
            );
        }
        let Some(node) = group.first().map(|closure| closure.node) else {
            continue;
        };
        let ([leader], false) = (leaders.as_slice(), passive.is_empty()) else {
            continue;
        };
        let ways = match passive.len() {
            0..=MOST_PASSIVE => Loop {
                tree: &tree,
                closures: &group,
                leader: *leader,
                passive: &passive,
            }
            .ways(),
            _ => Vec::new(),
        };
        let leads = &tree.hinges[*leader].name;
        if ways.len() < SAMPLES / 2 {
            let message =
                format!("the loop of links that `{leads}` moves can't be closed: it is left open");
            reader.warning(
                "W036",
                node,
                message,
                "its links then stay where the file puts them",
            );
            continue;
        }
        for (place, hinge) in passive.iter().enumerate() {
            let (factor, offset, off) =
                line(ways.iter().map(|(at, followers)| (*at, followers[place])));
            let follower = &tree.hinges[*hinge].name;
            if off > BENT {
                not_linear(node, follower, leads, reader);
            }
            found.insert(follower.clone(), (leads.clone(), factor, offset));
        }
    }
    found
}

/// Groups of closures that move joints without a motor in common.
fn together<'a>(
    closures: Vec<Closure<'a>>,
    is_passive: impl Fn(&usize) -> bool,
) -> Vec<Vec<Closure<'a>>> {
    let mut groups: Vec<Vec<Closure<'a>>> = Vec::new();
    for closure in closures {
        let shares = |other: &Closure<'_>| {
            closure
                .hinges
                .iter()
                .any(|hinge| is_passive(hinge) && other.hinges.contains(hinge))
        };
        let (with, without): (Vec<_>, Vec<_>) = groups
            .into_iter()
            .partition(|group| group.iter().any(shares));
        groups = without;
        groups.push(with.into_iter().flatten().chain([closure]).collect());
    }
    groups
}

/// Factor and offset of the straight line through points, and the largest deviation from it.
fn line(points: impl Iterator<Item = (f64, f64)> + Clone) -> (f64, f64, f64) {
    let n = points.clone().count().max(1) as f64;
    let (x, y) = points.clone().fold((0.0, 0.0), |(x, y), point| {
        (x + point.0 / n, y + point.1 / n)
    });
    let (above, below) = points.clone().fold((0.0, 0.0), |(a, b), (at, to)| {
        (a + (at - x) * (to - y), b + (at - x) * (at - x))
    });
    let factor = if below > 0.0 { above / below } else { 0.0 };
    let offset = y - factor * x;
    // Parallel links have factors of exactly 1 or -1, and no offset; a joint that a spring holds at
    // its limit does not move.
    let near = |value: f64| {
        if (value - value.round()).abs() < 1e-6 {
            value.round()
        } else {
            value
        }
    };
    let least = points
        .clone()
        .map(|(_, to)| to)
        .fold(f64::INFINITY, f64::min);
    let most = points
        .clone()
        .map(|(_, to)| to)
        .fold(f64::NEG_INFINITY, f64::max);
    if most - least < BENT / 2.0 {
        return (0.0, near(y), most - least);
    }
    let off = points
        .map(|(at, to)| (factor * at + offset - to).abs())
        .fold(0.0, f64::max);
    (near(factor), near(offset), off)
}

impl BodyTree {
    /// Reads the bodies of a file. Faults of their poses are reported where links are made of them.
    pub(super) fn read(root: Node, compiler: &Compiler, reader: &Reader) -> Self {
        let mut tree = Self::default();
        let mut unheard = Reader::new(reader.source);
        let budget = Budget::default();
        let mut walk = Walk {
            compiler,
            budget: &budget,
            reader: &mut unheard,
        };
        for worldbody in xml::children(root, "worldbody") {
            let class = worldbody.attribute("childclass");
            tree.add((worldbody, None, ""), class, &mut walk);
        }
        tree
    }

    /// Returns the positions of joints where the bodies are as the file places them, if these are
    /// not 0.
    pub(super) fn starts(&self) -> BTreeMap<String, f64> {
        let moved = self.hinges.iter().filter(|hinge| hinge.start != 0.0);
        moved
            .map(|hinge| (hinge.name.clone(), hinge.start))
            .collect()
    }

    /// Returns the limits of a joint, if it has any.
    pub(super) fn range(&self, joint: &str) -> Option<[f64; 2]> {
        self.hinges.iter().find(|hinge| hinge.name == joint)?.range
    }

    /// The positions of all joints where the bodies are as the file places them.
    fn at_start(&self) -> Vec<f64> {
        self.hinges.iter().map(|hinge| hinge.start).collect()
    }

    /// Adds the bodies, joints and sites in a body; `suffix` ends their names.
    fn add(
        &mut self,
        (node, body, suffix): (Node, Option<usize>, &str),
        class: Option<&str>,
        walk: &mut Walk<'_, '_>,
    ) {
        let compiler = walk.compiler;
        let content = compiler.content(node, class, walk.budget, walk.reader);
        let items: Vec<Item<'_>> = content
            .into_iter()
            .map(|item| Item {
                suffix: format!("{}{suffix}", item.suffix),
                ..item
            })
            .collect();
        for item in items.iter().filter(|item| item.is("site")) {
            let attributes = compiler.attributes(item.node, item.class);
            let at = item.shift * compiler.site(&attributes, item.node, walk.reader);
            if let Some(name) = item.name() {
                self.sites.insert(name, (body, at * Point3::origin()));
            }
        }
        if let Some(body) = body {
            let name = format!("{}{suffix}", node.attribute("name").unwrap_or("body"));
            let first = self.hinges.len();
            for item in items.iter().filter(|item| item.is("joint")) {
                self.hinges
                    .extend(hinge(item, &name, (compiler, walk.reader)));
            }
            self.bodies[body].hinges = (first..self.hinges.len()).collect();
            self.names.insert(name, body);
        }
        for item in items.iter().filter(|item| item.is("body")) {
            if !walk.budget.enter(item.node, walk.reader) {
                return;
            }
            let attributes = compiler.attributes(item.node, item.class);
            let pose = item.shift * compiler.pose(&attributes, item.node, walk.reader);
            self.bodies.push(MjcfBody {
                parent: body,
                pose,
                hinges: Vec::new(),
            });
            let inside = (item.node, Some(self.bodies.len() - 1), item.suffix.as_str());
            let class = item.node.attribute("childclass").or(item.class);
            self.add(inside, class, walk);
            walk.budget.leave();
        }
    }

    /// The points that a `<connect>` puts together. Returns `None` if it names no known body.
    fn closure<'a>(
        &self,
        node: Node<'a>,
        compiler: &Compiler,
        reader: &mut Reader,
    ) -> Option<Closure<'a>> {
        let attributes = compiler.attributes(node, None);
        let body = |name: &str| {
            if name == "world" {
                Some(None)
            } else {
                self.names.get(name).copied().map(Some)
            }
        };
        let ends =
            if let (Some(one), Some(other)) = (attributes.get("site1"), attributes.get("site2")) {
                [*self.sites.get(one)?, *self.sites.get(other)?]
            } else {
                let anchor = reader.numbers(node, attributes.get("anchor")?, Bound::Finite)?;
                let (one, other) = (
                    body(attributes.get("body1")?)?,
                    body(attributes.get("body2").unwrap_or("world"))?,
                );
                let start = self.at_start();
                let at = Point3::from(anchor);
                [
                    (one, at),
                    (
                        other,
                        self.pose(other, &start).inverse() * (self.pose(one, &start) * at),
                    ),
                ]
            };
        let [one, other] = ends.map(|(body, _)| self.moving(body));
        Some(Closure {
            node,
            ends,
            hinges: one.symmetric_difference(&other).copied().collect(),
        })
    }

    /// Joints that move a body.
    fn moving(&self, body: Option<usize>) -> BTreeSet<usize> {
        let bodies = std::iter::successors(body, |idx| self.bodies[*idx].parent);
        bodies
            .flat_map(|idx| self.bodies[idx].hinges.iter().copied())
            .collect()
    }

    /// Pose of a body with the joints at these positions. Frame: world.
    fn pose(&self, body: Option<usize>, positions: &[f64]) -> Isometry3<f64> {
        let Some(MjcfBody {
            parent,
            pose,
            hinges,
        }) = body.map(|idx| &self.bodies[idx])
        else {
            return Isometry3::identity();
        };
        let moved = hinges.iter().fold(Isometry3::identity(), |moved, idx| {
            let hinge = &self.hinges[*idx];
            let position = positions[*idx] - hinge.start;
            let at = Translation3::from(hinge.at);
            moved
                * match hinge.slides {
                    true => Translation3::from(hinge.axis.scale(position)).into(),
                    false => {
                        at * UnitQuaternion::from_axis_angle(&hinge.axis, position) * at.inverse()
                    }
                }
        });
        self.pose(*parent, positions) * pose * moved
    }
}

/// Reads a joint that turns or slides.
fn hinge(
    item: &Item<'_>,
    body: &str,
    (compiler, reader): (&Compiler, &mut Reader),
) -> Option<Hinge> {
    let joint = item.node;
    let attributes = compiler.attributes(joint, item.class);
    let kind = attributes.get("type").unwrap_or("hinge");
    let slides = kind == "slide";
    if !slides && kind != "hinge" {
        return None;
    }
    let mut numbers = |name: &str| {
        attributes
            .get(name)
            .and_then(|text| reader.numbers::<3>(joint, text, Bound::Finite))
    };
    let (axis, at) = (
        numbers("axis").unwrap_or([0.0, 0.0, 1.0]),
        numbers("pos").unwrap_or([0.0; 3]),
    );
    let range = compiler.limits(joint, &attributes, ["range", "limited"], reader);
    let number = |name: &str| {
        attributes
            .get(name)
            .and_then(|text| text.parse::<f64>().ok())
            .unwrap_or(0.0)
    };
    let unit = if slides { 1.0 } else { compiler.angle };
    Some(Hinge {
        name: item.name().unwrap_or_else(|| format!("{body}_joint")),
        axis: Unit::try_new(item.shift.rotation * Vector3::from(axis), 1e-9)?,
        at: (item.shift * Point3::from(at)).coords,
        slides,
        range: range.map(|ends| ends.map(|end| end * unit)),
        start: number("ref") * unit,
        stiffness: number("stiffness").max(0.0),
        rest: number("springref") * unit,
    })
}

/// A mechanism that one joint moves.
struct Loop<'a> {
    tree: &'a BodyTree,
    closures: &'a [Closure<'a>],
    leader: usize,
    passive: &'a [usize],
}

impl Loop<'_> {
    /// Returns positions of the leading joint where the loops close, each with those of the others.
    fn ways(&self) -> Vec<(f64, Vec<f64>)> {
        let [lower, upper] = self.tree.hinges[self.leader].range.unwrap_or([-1.0, 1.0]);
        let start = self.tree.hinges[self.leader]
            .start
            .clamp(lower.min(upper), upper.max(lower));
        let mut found = Vec::new();
        for end in [lower, upper] {
            let mut positions = self.tree.at_start();
            for idx in 0..=SAMPLES {
                positions[self.leader] = start + (end - start) * idx as f64 / SAMPLES as f64;
                self.close(&mut positions);
                if self.gap_m(&positions) < GAP_M && end != start {
                    found.push((
                        positions[self.leader],
                        self.passive.iter().map(|idx| positions[*idx]).collect(),
                    ));
                }
            }
        }
        found
    }

    /// Largest distance between connected points. Unit: metres.
    fn gap_m(&self, positions: &[f64]) -> f64 {
        self.closures
            .iter()
            .map(|closure| self.gap(closure, positions).norm())
            .fold(0.0, f64::max)
    }

    fn gap(&self, closure: &Closure<'_>, positions: &[f64]) -> Vector3<f64> {
        let [one, other] = closure
            .ends
            .map(|(body, at)| self.tree.pose(body, positions) * at);
        one - other
    }

    /// Moves the passive joints to where the loops are closed and springs are relaxed most, within
    /// the limits.
    fn close(&self, positions: &mut [f64]) {
        let mut held: BTreeSet<usize> = BTreeSet::new();
        for _ in 0..MOST_STEPS {
            let free: Vec<usize> = self
                .passive
                .iter()
                .copied()
                .filter(|hinge| !held.contains(hinge))
                .collect();
            let Some(step) = self.step(positions, &free) else {
                break;
            };
            let mut largest = 0.0f64;
            let mut is_held = false;
            for (hinge, change) in free.iter().zip(step.iter()) {
                let to = positions[*hinge] + change.clamp(-0.3, 0.3);
                let [lower, upper] = self.tree.hinges[*hinge]
                    .range
                    .unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
                let within = to.max(lower).min(upper);
                largest = largest.max((within - positions[*hinge]).abs());
                positions[*hinge] = within;
                // Springs push a joint against its limit, where it stays; loops move others away
                // again.
                if within != to && self.tree.hinges[*hinge].stiffness == 0.0 && self.is_sprung() {
                    is_held |= held.insert(*hinge);
                }
            }
            if largest < 1e-10 && !is_held {
                break;
            }
        }
    }

    fn is_sprung(&self) -> bool {
        self.passive
            .iter()
            .any(|hinge| self.tree.hinges[*hinge].stiffness > 0.0)
    }

    /// The least squares solution of the linearised closures and springs for the free joints.
    fn step(&self, positions: &[f64], free: &[usize]) -> Option<DVector<f64>> {
        let stiffest = self
            .passive
            .iter()
            .map(|idx| self.tree.hinges[*idx].stiffness)
            .fold(0.0, f64::max);
        let n_rows = 3 * self.closures.len() + free.len();
        let residual = |positions: &[f64]| {
            let mut rows = Vec::with_capacity(n_rows);
            for closure in self.closures {
                rows.extend(self.gap(closure, positions).iter().map(|gap| gap * CLOSED));
            }
            for idx in free {
                let Hinge {
                    stiffness,
                    rest,
                    start,
                    ..
                } = &self.tree.hinges[*idx];
                rows.push(match *stiffness > 0.0 {
                    true => (stiffness / stiffest).sqrt() * (positions[*idx] - rest),
                    false => AT_REST * (positions[*idx] - start),
                });
            }
            DVector::from_vec(rows)
        };
        let now = residual(positions);
        let mut slopes = DMatrix::zeros(n_rows, free.len());
        for (column, idx) in free.iter().enumerate() {
            let at = |by: f64| {
                let mut moved = positions.to_vec();
                moved[*idx] += by;
                residual(&moved)
            };
            slopes.set_column(column, &((at(1e-5) - at(-1e-5)) / 2e-5));
        }
        (slopes.transpose() * &slopes)
            .cholesky()
            .map(|solver| solver.solve(&(slopes.transpose() * -now)))
    }
}
