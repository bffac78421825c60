//! Plans a reachable, collision-free path to a grasp and back.

use nalgebra::{Isometry3, Point2, Point3, Vector3};

use crate::grasp::{Approach, Grasp, rolled};
use crate::hindrance::{Hindrance, Nearest, NoPlan, Surroundings};
use crate::link_points::LinkPoints;
use crate::motion::{Samples, moved_links};
use crate::operator::Operator;
use crate::route::{Block, Ground, Pillar, length, wrapped};
use crate::slant::{self, Hand};
use crate::standing;
use actcheck_world::{Kinematics, Layout, SelfContact, Sighting, ik};

/// Joint positions for each leg of a pick.
#[derive(Debug, Clone)]
pub struct Plan {
    /// In front of the furniture, with the arm in its driving posture.
    pub drive: Vec<Vec<f64>>,
    /// The same base pose, with the arm unfolded for the grasp.
    pub reach: Vec<Vec<f64>>,
    /// To a pose of the hand a short distance before the object.
    pub near: Vec<Vec<f64>>,
    /// From there straight to the object.
    pub approach: Vec<Vec<f64>>,
    /// From there straight up.
    pub lift: Vec<Vec<f64>>,
    /// Back out with the object.
    pub retreat: Vec<Vec<f64>>,
    /// Cost for comparison with other plans. No unit.
    pub(super) cost: f64,
}

/// Lift heights, the best first: the arm may not reach higher. Unit: metres.
pub(super) const LIFTS_M: [f64; 3] = [0.17, 0.13, 0.09];
/// Length of the slow last part of the approach. Unit: metres.
pub(super) const APPROACH_M: f64 = 0.12;
/// Distance of the hand from the furniture's edge while the arm unfolds. Unit: metres.
const OFF_EDGE_M: f64 = 0.1;
/// Longest distance from there to the object. Unit: metres.
const LONGEST_WAY_M: f64 = 1.2;
/// Minimum clearance of the hand to furniture: fingertips go down to it to grasp flat objects.
/// Unit: metres.
pub(super) const FURNITURE_CLEAR_M: f64 = 0.002;
/// Minimum clearance of the base and the arm to furniture, which only the hand has to come close
/// to. Unit: metres.
pub(super) const BODY_CLEAR_M: f64 = 0.01;
/// Clearance of the base and the arm to furniture beyond which more brings no benefit. Unit:
/// metres. Three times the position error of perceived furniture.
pub(super) const AMPLE_BODY_CLEAR_M: f64 = 0.08;
/// Clearance to other objects beyond which more brings no benefit. Unit: metres.
pub(super) const AMPLE_CLEAR_M: f64 = 0.04;
/// Minimum clearance to other objects: below it, the hand would go through their middle. Unit:
/// metres.
pub(super) const LEAST_CLEAR_M: f64 = -0.025;
/// Distance between points and between postures checked for clearance. Unit: metres.
const CHECK_M: f64 = 0.03;
/// The head is turned aside by at most this. Unit: radians.
const QUARTER: f64 = std::f64::consts::FRAC_PI_2;
/// Weight of the base's heading where the hand may turn relative to the base.
const TURNED_MOBILITY: f64 = 0.1;
/// Horizontal part of the direction of a hand that has a heading.
const LEVEL: f64 = 0.3;
/// A hand that points this far aside of the base turns the base instead. Unit: radians.
const ASIDE_RAD: f64 = 0.5;
/// Postures sampled if the arm can't unfold straight to any grasp.
const MOST_SAMPLES: u32 = 4000;
/// Reason reported if no plan is found.
pub(super) const NO_WAY: &str = "no reachable, collision-free path to it was found";

/// The planner's task.
#[derive(Debug, Clone, Copy)]
pub struct PlanRequest<'a> {
    /// Usual grasps, for a mobile robot.
    pub grasps: &'a [Grasp],
    /// All grasps, for a fixed arm and for cases where none of the usual grasps is free; empty if
    /// there are no others.
    pub all: &'a [Grasp],
    /// The object to grasp, which is an obstacle until the hand is there. `None` if the hand is
    /// full; a fixed arm then only moves straight, to keep its load level.
    pub taken: Option<&'a Sighting>,
}

/// Returns the best plan among all grasps.
///
/// With a mobile base, the arm unfolds straight, in front of the furniture; if no grasp is possible
/// that way, unusual grasps and sampled paths are tried, then the hand turned over, then hands at
/// many slants, and last those turned relative to the base. For a fixed base, see [`standing`].
///
/// # Errors
/// [`NoPlan`] if none is found.
pub fn plan(
    operator: &mut Operator<'_>,
    wanted: PlanRequest<'_>,
    others: &[Sighting],
) -> Result<Plan, NoPlan> {
    let Some(base) = operator.layout().base else {
        return standing::plan(operator, wanted, others);
    };
    let mut nearest = Nearest::default();
    let found = best(
        &Planner::new(operator, base, others),
        wanted.grasps,
        &mut Samples::new(0.0, 0),
        &mut nearest,
    );
    if let Some(plan) = found {
        return Ok(plan);
    }
    let mut samples = match wanted.all.is_empty() {
        true => Samples::new(0.0, 0),
        false => Samples::new(operator.choose_samples(), MOST_SAMPLES),
    };
    let mut planner = Planner::new(operator, base, others);
    if wanted.all.is_empty() {
        return Err(nearest.reason(wanted.taken, &planner.surroundings()));
    }
    let all = [wanted.grasps, wanted.all].concat();
    let mut found = best(&planner, &all, &mut samples, &mut nearest);
    if let (None, Some(thing)) = (&found, wanted.taken) {
        let mut straight = |planner: &Planner<'_>, grasps: &[Grasp]| {
            best(planner, grasps, &mut Samples::new(0.0, 0), &mut nearest)
        };
        found = straight(&planner, &rolled(&all));
        let hand = Hand::new(thing, operator);
        planner.heading_mobility = TURNED_MOBILITY;
        let slants = if found.is_none() {
            slant::ahead(thing, &hand, operator)
        } else {
            Vec::new()
        };
        found = found
            .or_else(|| straight(&planner, &slants))
            .or_else(|| straight(&planner, &rolled(&slants)));
        // Where no hand ahead of the base reaches, one aside of it does not either.
        if found.is_none() && !nearest.is_out_of_reach() {
            let slants = slant::aside(thing, &hand, operator);
            let mut straight =
                |grasps: &[Grasp]| best(&planner, grasps, &mut Samples::new(0.0, 0), &mut nearest);
            found = straight(&slants).or_else(|| straight(&rolled(&slants)));
        }
    }
    if found.is_none() && wanted.taken.is_none() {
        // An arm that took the object aside of the base also sets it down there.
        planner.postures = vec![
            planner
                .layout
                .arm
                .iter()
                .map(|joint| planner.start[*joint])
                .collect(),
        ];
        found = best(&planner, &all, &mut samples, &mut nearest);
    }
    found.ok_or_else(|| nearest.reason(wanted.taken, &planner.surroundings()))
}

/// The best plan among these grasps.
fn best(
    planner: &Planner<'_>,
    grasps: &[Grasp],
    samples: &mut Samples,
    nearest: &mut Nearest,
) -> Option<Plan> {
    let mut seeds: Vec<(f64, &Grasp, Vec<f64>)> = Vec::new();
    for grasp in grasps {
        for posture in &planner.postures {
            let seed = planner.seed(grasp, posture);
            let seed = match planner.points_along(&seed, grasp) {
                true => Some(seed),
                false => planner.turned(&seed, grasp),
            };
            if let Some(seed) = seed {
                seeds.push((planner.travel_cost(&seed) + grasp.penalty, grasp, seed));
            }
        }
    }
    // The nearest first, so that most of the others can be skipped.
    seeds.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut best: Option<Plan> = None;
    for (_, grasp, seed) in seeds {
        let bound = best.as_ref().map_or(f64::INFINITY, |best| best.cost);
        match planner.plan(grasp, &seed, bound, samples) {
            Ok(plan) => best = Some(plan),
            Err(hindrance) => nearest.note(hindrance),
        }
    }
    best
}

/// A path of the base to a pose (x, y, heading) with the arm as it is. Returns `None` if there is
/// none.
pub fn drive(operator: &Operator<'_>, to: [f64; 3], others: &[Sighting]) -> Option<Vec<Vec<f64>>> {
    let [x, y, heading] = operator.layout().base?;
    let planner = Planner::new(operator, [x, y, heading], others);
    let mut posture = planner.start.clone();
    (posture[x], posture[y]) = (to[0], to[1]);
    posture[heading] += wrapped(to[2] - posture[heading]);
    planner.drive(&posture)
}

/// A mobile robot and the obstacles around it.
pub(super) struct Planner<'a> {
    pub(super) kinematics: &'a Kinematics,
    pub(super) layout: &'a Layout,
    /// The joints of the base: x, y, heading.
    pub(super) base: [usize; 3],
    /// Initial joint positions.
    pub(super) start: Vec<f64>,
    postures: Vec<Vec<f64>>,
    pub(super) points: Vec<LinkPoints>,
    /// Whether each link is part of the hand.
    pub(super) is_hand: Vec<bool>,
    pub(super) furniture: Vec<Block>,
    pub(super) things: Vec<Pillar>,
    ground: Ground,
    /// Self-collision checks.
    pub(super) itself: SelfContact,
    /// Positions of the head's joints, the present ones first.
    heads: Vec<Vec<f64>>,
    /// Whether each link is moved by the head's joints.
    is_head: Vec<bool>,
    /// Weight of the base's heading in inverse kinematics, from 0 to 1: 1 if the hand points ahead
    /// of the base.
    heading_mobility: f64,
}

impl<'a> Planner<'a> {
    fn new(operator: &'a Operator<'_>, base: [usize; 3], others: &[Sighting]) -> Self {
        let (kinematics, layout) = (operator.kinematics(), operator.layout());
        let start = operator.commanded().to_vec();
        let points = kinematics.surface_points(CHECK_M);
        let from = Point2::new(start[base[0]], start[base[1]]);
        let furniture = Block::around(&Point3::new(from.x, from.y, 0.0), others);
        let things: Vec<Pillar> = others
            .iter()
            .filter(|seen| !seen.furniture)
            .map(Pillar::new)
            .collect();
        let ground = Ground::new(
            &furniture,
            &things,
            radius(kinematics, base, &start, &points),
            &from,
        );
        let mut postures = operator.profile().postures.clone();
        postures.push(operator.profile().home.clone());
        let itself = SelfContact::new(kinematics, std::slice::from_ref(&start));
        let is_hand = moved_links(kinematics, layout.arm.last().copied().as_slice());
        let heads = heads(kinematics, layout, &start);
        let points = LinkPoints::grouped(&points);
        let heading_mobility = 1.0;
        Self {
            kinematics,
            layout,
            base,
            start,
            postures,
            points,
            is_hand,
            furniture,
            things,
            ground,
            itself,
            heads,
            is_head: moved_links(kinematics, &layout.head),
            heading_mobility,
        }
    }

    fn surroundings(&self) -> Surroundings<'_> {
        Surroundings {
            kinematics: self.kinematics,
            points: &self.points,
            is_hand: &self.is_hand,
            furniture: &self.furniture,
            things: &self.things,
            arm_farther: true,
        }
    }

    /// A plan near the seed that costs less than `bound`.
    fn plan(
        &self,
        grasp: &Grasp,
        seed: &[f64],
        bound: f64,
        samples: &mut Samples,
    ) -> Result<Plan, Hindrance> {
        let back = -Vector3::new(libm::cos(grasp.heading), libm::sin(grasp.heading), 0.0);
        let way = self
            .way_out(&grasp.pose.translation.vector, &back)
            .ok_or(Hindrance::OutOfReach)?;
        // Cost of the drive alone, before inverse kinematics. (Inverse kinematics moves the base by
        // centimetres.)
        if self.travel_cost(&self.moved(seed, &(back * way))) + grasp.penalty > bound + 0.05 {
            return Err(Hindrance::Dearer);
        }
        let at_thing = self
            .solve(seed, &grasp.pose, 1.0)
            .ok_or(Hindrance::OutOfReach)?;
        let (at_thing, lift) = self.lifted(at_thing)?;
        let lifted = lift.last().ok_or(Hindrance::NoLift)?.clone();
        let (near, approach) = match grasp.approach {
            Approach::Side => {
                let before = self.moved(&at_thing, &(back * APPROACH_M.min(way)));
                (vec![before], vec![at_thing.clone()])
            }
            // Above the object, at the height to which it will be lifted.
            Approach::Top => (
                vec![lifted.clone()],
                lift.iter()
                    .rev()
                    .skip(1)
                    .cloned()
                    .chain([at_thing.clone()])
                    .collect(),
            ),
        };
        let reach = self.moved(
            &near[0],
            &(back
                * (way
                    - if grasp.approach == Approach::Side {
                        APPROACH_M.min(way)
                    } else {
                        0.0
                    })),
        );
        let drive = self.drive(&reach).ok_or(Hindrance::NoRoute)?;
        let retreat = vec![self.moved(&lifted, &(back * way))];
        let mut plan = Plan {
            drive,
            reach: vec![reach],
            near,
            approach,
            lift,
            retreat,
            cost: 0.0,
        };
        plan.cost = grasp.penalty + self.cost(&mut plan, bound - grasp.penalty, samples)?;
        Ok(plan)
    }

    /// Whether the hand of a seed points within 45 degrees of the grasp's direction. Not required
    /// of a hand that turns relative to the base.
    fn points_along(&self, seed: &[f64], grasp: &Grasp) -> bool {
        if self.heading_mobility < 1.0 {
            return true;
        }
        let forward = |pose: &Isometry3<f64>| pose.rotation * Vector3::x();
        forward(&self.kinematics.grasp(seed)).dot(&forward(&grasp.pose))
            > std::f64::consts::FRAC_1_SQRT_2
    }

    /// The seed of a hand that points aside of the base, with the base turned so that the hand has
    /// the grasp's heading. `None` if the hand points ahead, or steeply.
    fn turned(&self, seed: &[f64], grasp: &Grasp) -> Option<Vec<f64>> {
        let heading_of = |pose: &Isometry3<f64>| {
            let forward = pose.rotation * Vector3::x();
            (length(forward.x, forward.y) > LEVEL).then(|| libm::atan2(forward.y, forward.x))
        };
        let turn = wrapped(heading_of(&grasp.pose)? - heading_of(&self.kinematics.grasp(seed))?);
        if turn.abs() < ASIDE_RAD {
            return None;
        }
        let mut positions = seed.to_vec();
        let [x, y, heading] = self.base;
        positions[heading] =
            self.start[heading] + wrapped(positions[heading] + turn - self.start[heading]);
        let miss =
            grasp.pose.translation.vector - self.kinematics.grasp(&positions).translation.vector;
        positions[x] += miss.x;
        positions[y] += miss.y;
        Some(positions).filter(|turned| self.points_along(turned, grasp))
    }

    /// Cost of driving to a posture's base pose.
    pub(super) fn travel_cost(&self, positions: &[f64]) -> f64 {
        let [x, y, heading] = self.base;
        let way = length(positions[x] - self.start[x], positions[y] - self.start[y]);
        0.4 * way + 0.12 * (positions[heading] - self.start[heading]).abs()
    }

    /// The posture with the base placed so that the hand is over the object with the grasp's
    /// heading.
    fn seed(&self, grasp: &Grasp, posture: &[f64]) -> Vec<f64> {
        let mut positions = self.start.clone();
        for (idx, value) in self.layout.arm.iter().zip(posture) {
            positions[*idx] = *value;
        }
        self.layout.gripper.set(&mut positions, grasp.opening_m);
        let [x, y, heading] = self.base;
        positions[heading] += wrapped(grasp.heading - positions[heading]);
        let miss =
            grasp.pose.translation.vector - self.kinematics.grasp(&positions).translation.vector;
        positions[x] += miss.x;
        positions[y] += miss.y;
        positions
    }

    fn solve(&self, seed: &[f64], target: &Isometry3<f64>, base_mobility: f64) -> Option<Vec<f64>> {
        let mut mobility = vec![0.0; seed.len()];
        for idx in &self.layout.arm {
            mobility[*idx] = 1.0;
        }
        for idx in self.base {
            mobility[idx] = base_mobility;
        }
        mobility[self.base[2]] *= self.heading_mobility;
        ik::solve(
            self.kinematics,
            seed,
            &ik::IkRequest {
                target: *target,
                mobility,
            },
        )
    }

    /// Distance back from the object at which the hand is in front of all furniture. Unit: metres.
    fn way_out(&self, from: &Vector3<f64>, back: &Vector3<f64>) -> Option<f64> {
        let mut way = APPROACH_M;
        while way < LONGEST_WAY_M {
            let point = Point3::from(from + back * way);
            if self
                .furniture
                .iter()
                .all(|block| block.beside(&point) >= OFF_EDGE_M)
            {
                return Some(way);
            }
            way += 0.02;
        }
        None
    }

    /// The posture with the base moved horizontally.
    fn moved(&self, positions: &[f64], by: &Vector3<f64>) -> Vec<f64> {
        let mut positions = positions.to_vec();
        let [x, y, _] = self.base;
        positions[x] += by.x;
        positions[y] += by.y;
        positions
    }

    /// Whether links of the robot are too close to each other.
    pub(super) fn touches_itself(&self, posture: &[f64]) -> bool {
        self.itself.touches(&self.kinematics.links(posture))
    }

    /// A posture and the path straight up from it, with the head out of the arm's way.
    ///
    /// # Errors
    /// The hindrance if the arm can't follow, or would collide with the robot in every posture of
    /// the head.
    fn lifted(&self, at_thing: Vec<f64>) -> Result<(Vec<f64>, Vec<Vec<f64>>), Hindrance> {
        let mut hindrance = Hindrance::NoLift;
        let touching = |posture: &Vec<f64>| self.itself.touching(&self.kinematics.links(posture));
        for height in LIFTS_M {
            let Some(lift) = self.vertically(&at_thing, height) else {
                continue;
            };
            hindrance = Hindrance::Itself { links: None };
            for head in &self.heads {
                let at_thing = self.with_head(&at_thing, head);
                let lift: Vec<Vec<f64>> = lift
                    .iter()
                    .map(|posture| self.with_head(posture, head))
                    .collect();
                let postures = std::iter::once(&at_thing).chain(&lift).enumerate();
                let touched = postures
                    .into_iter()
                    .find_map(|(step, posture)| Some((step, touching(posture)?)));
                let Some((step, links)) = touched else {
                    return Ok((at_thing, lift));
                };
                hindrance = Hindrance::Itself { links: Some(links) };
                if !self.is_head[links.0] && !self.is_head[links.1] {
                    // No other posture of the head helps, and no other lift if the links touch
                    // before it.
                    if step == 0 {
                        return Err(hindrance);
                    }
                    break;
                }
            }
        }
        Err(hindrance)
    }

    fn with_head(&self, posture: &[f64], head: &[f64]) -> Vec<f64> {
        let mut posture = posture.to_vec();
        self.layout
            .head
            .iter()
            .zip(head)
            .for_each(|(joint, position)| posture[*joint] = *position);
        posture
    }

    /// Postures a few centimetres apart on a straight path up, with a fixed base.
    fn vertically(&self, positions: &[f64], height: f64) -> Option<Vec<Vec<f64>>> {
        let from = self.kinematics.grasp(positions);
        let mut path: Vec<Vec<f64>> = Vec::new();
        for step in 1..=6 {
            let mut target = from;
            target.translation.vector.z += height * f64::from(step) / 6.0;
            let seed = path.last().map_or(positions, Vec::as_slice);
            path.push(self.solve(seed, &target, 0.0)?);
        }
        Some(path)
    }

    /// The base's path to its pose in `to`, with the arm's initial posture. The head is turned as
    /// in `to`.
    fn drive(&self, to: &[f64]) -> Option<Vec<Vec<f64>>> {
        let head: Vec<f64> = self.layout.head.iter().map(|joint| to[*joint]).collect();
        let turned = self.with_head(&self.start, &head);
        if turned != self.start && !self.keeps_off_itself(&self.start, &turned) {
            return None;
        }
        let [x, y, heading] = self.base;
        let route = self.ground.route(
            Point2::new(self.start[x], self.start[y]),
            Point2::new(to[x], to[y]),
        )?;
        let n_legs = route.len() as f64;
        let legs = route.iter().enumerate().map(|(idx, point)| {
            let share = (idx + 1) as f64 / n_legs;
            let mut positions = self.with_head(&self.start, &head);
            positions[x] = point.x;
            positions[y] = point.y;
            positions[heading] += (to[heading] - self.start[heading]) * share;
            positions
        });
        Some(legs.collect())
    }
}

/// Positions of the head's joints that plans try: the present ones, then each joint in the middle
/// and at both ends of its range.
fn heads(kinematics: &Kinematics, layout: &Layout, start: &[f64]) -> Vec<Vec<f64>> {
    let mut grid: Vec<Vec<f64>> = vec![Vec::new()];
    for idx in &layout.head {
        let joint = &kinematics.joints()[*idx];
        let lower = joint.lower.max(-QUARTER).min(joint.upper);
        let upper = joint.upper.min(QUARTER).max(joint.lower);
        let positions = [0.0_f64.clamp(lower, upper), lower, upper];
        grid = grid
            .iter()
            .flat_map(|head| positions.map(|position| [head.as_slice(), &[position]].concat()))
            .collect();
    }
    grid.insert(0, layout.head.iter().map(|joint| start[*joint]).collect());
    grid
}

/// Radius of the circle around the base that contains the whole robot. Unit: metres.
fn radius(
    kinematics: &Kinematics,
    [x, y, _]: [usize; 3],
    positions: &[f64],
    points: &[(usize, Point3<f64>)],
) -> f64 {
    let links = kinematics.links(positions);
    let far = |(link, point): &(usize, Point3<f64>)| {
        let point = links[*link] * point;
        length(point.x - positions[x], point.y - positions[y])
    };
    points.iter().map(far).fold(0.0, f64::max)
}
