//! Grasp planning for an arm with a fixed base.

use nalgebra::{Isometry3, Point3, Translation3, Vector3};

use crate::grasp::{Approach, Grasp, rolled};
use crate::hindrance::{Hindrance, Nearest, NoPlan};
use crate::motion::{self, ArmClearance, ArmSpace, Samples};
use crate::operator::Operator;
use crate::plan::{
    AMPLE_CLEAR_M, APPROACH_M, FURNITURE_CLEAR_M, LEAST_CLEAR_M, LIFTS_M, Plan, PlanRequest,
};
use crate::route::{Block, Pillar, wrapped};
use crate::slant::{self, Hand};
use actcheck_world::{JointKind, Kinematics, Layout, Sighting, ik};

/// Samples allowed for one plan over all grasps: half a second's work together with the limit per
/// grasp.
const MOST_SAMPLES: u32 = 3000;
/// Samples allowed per grasp.
const SAMPLES_A_GRASP: u32 = 500;
/// Clearance that the arm keeps on its path if both ends have it. Unit: metres.
const WAY_CLEAR_M: f64 = 0.03;
/// Margin of an arm's length. Unit: metres. More than the error of inverse kinematics.
const SPAN_MARGIN_M: f64 = 2e-3;
/// How much the clearance of a turning link may change. Unit: metres.
const TURNING_M: f64 = 1e-3;
/// Cost of a hand heading that deviates from the direction base to object. Unit: cost per radian.
const ASIDE_COST: f64 = 0.15;
/// The same for a hand that points straight down, where the deviation only affects the last joint.
const TURNED_COST: f64 = 0.03;
/// Cost per metre of the arm's path.
const WAY_COST: f64 = 0.02;
/// A straight path is rejected if a joint moves further than this between two postures, because the
/// arm flips over. Unit: radians or metres.
const LARGEST_STEP: f64 = 0.6;
/// Step length of a straight path. Unit: metres.
const STEP_M: f64 = 0.03;
/// An arm with fewer joints reaches only some orientations at each place.
const FULL_ARM: usize = 6;
/// How far such an arm may turn its hand on a straight path. Unit: radians. The sides of a held
/// object then stay between the fingers.
const SMALL_TURN_RAD: f64 = 0.1;
/// Largest turn: somewhat more than half the angle between two candidates. Unit: radians.
const LARGEST_TURN_RAD: f64 = 0.2;
/// Lift heights of an arm on the surface, which is short, and the length of its level approach.
/// Unit: metres.
const SHORT_LIFTS_M: [f64; 3] = [0.12, 0.09, 0.06];
const SHORT_APPROACH_M: f64 = 0.08;
/// How far a hand whose fingers would touch the object is moved across, in order of preference.
/// Unit: metres.
const ASIDE_M: [f64; 5] = [0.0, 0.006, -0.006, 0.012, -0.012];
/// Clearances at the object and on the way from it.
const LEAST_CLEARANCE: ArmClearance = ArmClearance {
    furniture_m: FURNITURE_CLEAR_M,
    things_m: LEAST_CLEAR_M,
};
/// Distances to retreat with the object, in order of preference. Unit: metres.
const RETREATS_M: [f64; 2] = [0.1, 0.05];

/// Returns the best plan among all grasps; if there is none, among those with the hand turned over,
/// then among hands at many slants.
///
/// # Errors
/// [`NoPlan`] if none is found.
pub fn plan(
    operator: &mut Operator<'_>,
    wanted: PlanRequest<'_>,
    others: &[Sighting],
) -> Result<Plan, NoPlan> {
    let mut samples = match wanted.taken {
        Some(_) => Samples::new(operator.choose_samples(), MOST_SAMPLES),
        None => Samples::new(0.0, 0),
    };
    let furniture = Block::around(&operator.base().translation.vector.into(), others);
    let mut things: Vec<Pillar> = wanted
        .taken
        .iter()
        .map(|thing| Pillar::new(thing))
        .collect();
    let n_taken = things.len();
    things.extend(
        others
            .iter()
            .filter(|seen| !seen.furniture)
            .map(Pillar::new),
    );
    // An arm of few joints turns its hand, whose fingers may then come down on the object.
    let taken = wanted
        .taken
        .filter(|_| operator.layout().arm.len() < FULL_ARM);
    let hand = taken.map(|thing| Hand::new(thing, operator));
    let mut arm = Arm::new(operator, &furniture, (&things, &things[n_taken..]));
    if let Some(thing) = wanted.taken {
        // The fingers close no further than to the object.
        let narrowest_m = thing.size_m[0].min(thing.size_m[1]);
        arm.closing_m.extend(
            slant::closing_m(operator)
                .into_iter()
                .filter(|opening_m| *opening_m > narrowest_m),
        );
    }
    let all = if wanted.all.is_empty() {
        wanted.grasps
    } else {
        wanted.all
    };
    let mut nearest = Nearest::default();
    let mut next = |arm: &Arm<'_>, grasps: &[Grasp]| best(arm, grasps, &mut samples, &mut nearest);
    let Some(thing) = wanted.taken else {
        let found = next(&arm, all);
        return found.ok_or_else(|| nearest.reason(None, &arm.meanwhile.surroundings()));
    };
    let mut found = None;
    if let Some(hand) = &hand {
        arm.beside = Some((hand, thing));
        found = first_plan(
            |grasps| next(&arm, grasps),
            all,
            || slant::ahead(thing, hand, operator),
        );
        arm.beside = None;
    }
    let slants = || slant::ahead(thing, &Hand::new(thing, operator), operator);
    found = found.or_else(|| first_plan(|grasps| next(&arm, grasps), all, slants));
    found.ok_or_else(|| nearest.reason(wanted.taken, &arm.meanwhile.surroundings()))
}

/// The first plan for these grasps, then for those with the hand turned over, then for hands at
/// many slants.
fn first_plan(
    mut plan: impl FnMut(&[Grasp]) -> Option<Plan>,
    all: &[Grasp],
    slants: impl FnOnce() -> Vec<Grasp>,
) -> Option<Plan> {
    plan(all).or_else(|| plan(&rolled(all))).or_else(|| {
        let slants = slants();
        plan(&slants).or_else(|| plan(&rolled(&slants)))
    })
}

/// The best plan among these grasps.
fn best(
    arm: &Arm<'_>,
    all: &[Grasp],
    samples: &mut Samples,
    nearest: &mut Nearest,
) -> Option<Plan> {
    let mut grasps: Vec<(f64, &Grasp)> = all
        .iter()
        .map(|grasp| (arm.least_cost(grasp), grasp))
        .collect();
    grasps.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut best: Option<Plan> = None;
    for (cost, grasp) in grasps {
        if arm.span.is_beyond(&grasp.pose) {
            nearest.note(Hindrance::OutOfReach);
            continue;
        }
        for seed in arm.seeds(grasp) {
            let bound = best.as_ref().map_or(f64::INFINITY, |best| best.cost);
            if cost >= bound {
                return best;
            }
            match arm.plan(grasp, &seed, (cost, bound), samples) {
                Ok(plan) => best = Some(plan),
                Err(hindrance) => nearest.note(hindrance),
            }
        }
    }
    best
}

/// The arm, its initial posture, and the obstacles around it.
struct Arm<'a> {
    kinematics: &'a Kinematics,
    layout: &'a Layout,
    /// Initial joint positions.
    start: Vec<f64>,
    postures: Vec<Vec<f64>>,
    /// Free space including the object to grasp.
    before: ArmSpace<'a>,
    /// Free space without the object to grasp.
    meanwhile: ArmSpace<'a>,
    /// Lift heights, the best first. Unit: metres.
    lifts_m: &'static [f64],
    /// Length of the last part of a level approach. Unit: metres.
    approach_m: f64,
    /// Openings at which fingers that turn have to clear the surface. Unit: metres.
    closing_m: Vec<f64>,
    span: Span,
    /// If given, the open hand may not touch the object when it is there, nor on the way down.
    beside: Option<(&'a Hand, &'a Sighting)>,
}

/// The length of an arm, from its first joint to its last. Poses beyond it need no search for joint
/// positions.
struct Span {
    /// The first joint. Frame: world.
    from: Vector3<f64>,
    /// The last joint in the frame of the grasp, if the arm reaches any orientation of the hand;
    /// else the grasp itself.
    end: Point3<f64>,
    /// Greatest distance of the two. Unit: metres.
    length_m: f64,
}

impl Span {
    fn of(kinematics: &Kinematics, arm: &[usize], start: &[f64]) -> Self {
        let links = kinematics.links(start);
        let grasp = kinematics.grasp(start);
        let at = |idx: &usize| links[idx + 1].translation.vector;
        let mut points: Vec<Vector3<f64>> = arm.iter().map(at).collect();
        let last_turns = arm
            .last()
            .is_some_and(|idx| kinematics.joints()[*idx].kind == JointKind::Revolute);
        if arm.len() < FULL_ARM || !last_turns {
            points.push(grasp.translation.vector);
        }
        let joints = arm.iter().map(|idx| &kinematics.joints()[*idx]);
        let slides = joints.filter(|joint| joint.kind == JointKind::Prismatic);
        let slides_m: f64 = slides.map(|joint| joint.upper - joint.lower).sum();
        let links_m: f64 = points
            .windows(2)
            .map(|pair| (pair[1] - pair[0]).norm())
            .sum();
        let end = points.last().copied().unwrap_or_default();
        let from = points.first().copied().unwrap_or_default();
        Self {
            from,
            end: grasp.inverse() * Point3::from(end),
            length_m: links_m + slides_m + SPAN_MARGIN_M,
        }
    }

    /// Whether no posture brings the hand to a pose.
    fn is_beyond(&self, pose: &Isometry3<f64>) -> bool {
        ((pose * self.end).coords - self.from).norm() > self.length_m
    }
}

impl<'a> Arm<'a> {
    fn new(
        operator: &'a Operator<'_>,
        furniture: &'a [Block],
        (things, others): (&'a [Pillar], &'a [Pillar]),
    ) -> Self {
        let (kinematics, layout) = (operator.kinematics(), operator.layout());
        let start = operator.commanded().to_vec();
        let mut postures = operator.profile().postures.clone();
        postures.push(operator.profile().home.clone());
        let space =
            |right: &[Vec<f64>]| ArmSpace::new(kinematics, layout, furniture, things, right);
        let mut opened = start.clone();
        layout
            .gripper
            .set(&mut opened, operator.profile().hand.max_opening_m);
        let mut before = space(std::slice::from_ref(&start));
        if !before.clearance(&opened).1 {
            // Fingers that turn wide open come close to the wrist, wherever the arm is.
            before = space(&[start.clone(), opened]);
        }
        let meanwhile = before.among(others);
        let span = Span::of(kinematics, &layout.arm, &start);
        let (lifts_m, approach_m) = match operator.profile().core.on_surface {
            true => (SHORT_LIFTS_M.as_slice(), SHORT_APPROACH_M),
            false => (LIFTS_M.as_slice(), APPROACH_M),
        };
        Self {
            kinematics,
            layout,
            start,
            postures,
            before,
            meanwhile,
            lifts_m,
            approach_m,
            closing_m: Vec::new(),
            span,
            beside: None,
        }
    }

    /// Lower bound of a grasp's cost, independent of the path to it.
    fn least_cost(&self, grasp: &Grasp) -> f64 {
        let aside = wrapped(grasp.heading - self.bearing(&grasp.pose.translation.vector)).abs();
        let points_down = (grasp.pose.rotation * Vector3::x()).z < -0.99;
        grasp.penalty + aside * if points_down { TURNED_COST } else { ASIDE_COST }
    }

    /// Direction from the base to a position. Unit: radians.
    fn bearing(&self, place: &Vector3<f64>) -> f64 {
        let root = self.kinematics.links(&self.start)[0].translation.vector;
        libm::atan2(place.y - root.y, place.x - root.x)
    }

    /// Seeds for inverse kinematics: the profile's postures, turned towards the object if the axis
    /// of the arm's first joint is vertical.
    fn seeds(&self, grasp: &Grasp) -> Vec<Vec<f64>> {
        let place = grasp.pose.translation.vector;
        let seeds = self.postures.iter().map(|posture| {
            let mut positions = self.start.clone();
            for (idx, value) in self.layout.arm.iter().zip(posture) {
                positions[*idx] = *value;
            }
            self.layout.gripper.set(&mut positions, grasp.opening_m);
            if let Some(first) = self
                .layout
                .arm
                .first()
                .filter(|first| self.stands_upright(**first))
            {
                let hand = self.kinematics.grasp(&positions).translation.vector;
                let joint = &self.kinematics.joints()[*first];
                let turned =
                    positions[*first] + wrapped(self.bearing(&place) - self.bearing(&hand));
                positions[*first] = turned.clamp(joint.lower, joint.upper);
            }
            positions
        });
        seeds.collect()
    }

    fn stands_upright(&self, joint: usize) -> bool {
        let joint = &self.kinematics.joints()[joint];
        let parent = self.kinematics.links(&self.start)[joint.parent].rotation;
        let axis = parent * (joint.origin.rotation * joint.axis.into_inner());
        joint.kind == JointKind::Revolute && axis.z > 0.99
    }

    /// A plan near a seed that costs less than `bound`. `least` is the lower bound of its cost.
    fn plan(
        &self,
        grasp: &Grasp,
        seed: &[f64],
        (least, bound): (f64, f64),
        samples: &mut Samples,
    ) -> Result<Plan, Hindrance> {
        let (at_thing, turn) = self.at_thing(seed, grasp)?;
        let lift = self
            .lifts_m
            .iter()
            .find_map(|height| self.straight(&at_thing, &(Vector3::z() * *height)));
        let lift = lift.ok_or(Hindrance::NoLift)?;
        let heading = grasp.heading + turn;
        let back = -Vector3::new(libm::cos(heading), libm::sin(heading), 0.0);
        let mut approach = match grasp.approach {
            Approach::Side => self
                .straight(&at_thing, &(back * self.approach_m))
                .ok_or(Hindrance::NoLift)?,
            Approach::Top => lift.clone(),
        };
        approach.reverse();
        let near = approach.remove(0);
        let closing = self.closing_m.iter().map(|opening_m| {
            let mut posture = at_thing.clone();
            self.layout.gripper.set(&mut posture, *opening_m);
            posture
        });
        let closing: Vec<Vec<f64>> = closing.collect();
        approach.push(at_thing);
        let legs = [approach.as_slice(), closing.as_slice(), lift.as_slice()].concat();
        let mut nearest = f64::INFINITY;
        for posture in legs {
            let (room, clear_of_itself) = self.meanwhile.clearance(&posture);
            if !clear_of_itself {
                return Err(Hindrance::Itself {
                    links: self.meanwhile.touching(&posture),
                });
            }
            let lack_m = (LEAST_CLEARANCE.furniture_m - room.furniture_m)
                .max(LEAST_CLEARANCE.things_m - room.things_m);
            if !room.holds(LEAST_CLEARANCE) {
                return Err(Hindrance::Blocked { posture, lack_m });
            }
            nearest = nearest.min(room.things_m);
        }
        let cost = least + (AMPLE_CLEAR_M - nearest).max(0.0) * 50.0;
        if cost >= bound {
            return Err(Hindrance::Dearer);
        }
        let way = self.way(&near, samples).ok_or(Hindrance::NoPath)?;
        let length: f64 = std::iter::once(&self.start)
            .chain(&way)
            .zip(&way)
            .map(|(from, to)| self.before.span(from, to))
            .sum();
        let cost = cost + length * WAY_COST;
        let lifted = lift.last().ok_or(Hindrance::NoLift)?;
        let retreat = self.retreat(lifted, &back);
        let (drive, reach) = (Vec::new(), Vec::new());
        let plan = Plan {
            drive,
            reach,
            near: way,
            approach,
            lift,
            retreat,
            cost,
        };
        if cost < bound {
            Ok(plan)
        } else {
            Err(Hindrance::Dearer)
        }
    }

    /// The path on which the object is drawn back in this direction; empty if something blocks it.
    fn retreat(&self, lifted: &[f64], back: &Vector3<f64>) -> Vec<Vec<f64>> {
        let is_free = |path: &Vec<Vec<f64>>| {
            path.iter()
                .all(|posture| self.meanwhile.is_free(posture, LEAST_CLEARANCE))
        };
        let mut ways = RETREATS_M
            .iter()
            .filter_map(|way| self.straight(lifted, &(back * *way)));
        ways.find(is_free).unwrap_or_default()
    }

    /// The posture with the hand at the object, and by how much the hand is turned from the grasp.
    ///
    /// # Errors
    /// The hindrance if there is none, or if the open hand would touch the object and may not.
    fn at_thing(&self, seed: &[f64], grasp: &Grasp) -> Result<(Vec<f64>, f64), Hindrance> {
        let mut hindrance = Hindrance::OutOfReach;
        let aside: &[f64] = if self.beside.is_some() {
            &ASIDE_M
        } else {
            &[0.0]
        };
        for aside_m in aside.iter().copied() {
            let pose = grasp.pose * Translation3::new(0.0, aside_m, 0.0);
            // Out of reach here is out of reach a centimetre beside it.
            let found = self
                .solve_turned(seed, &pose, LARGEST_TURN_RAD)
                .ok_or(hindrance.clone())?;
            // An arm of few joints turns the hand: the pose is another than the grasp's.
            let touches = |(hand, thing): (&Hand, &Sighting)| {
                !hand.is_beside(&self.kinematics.grasp(&found.0), thing)
            };
            if !self.beside.is_some_and(touches) {
                return Ok(found);
            }
            hindrance = Hindrance::Touches;
        }
        Err(hindrance)
    }

    /// A path from the current posture to another.
    fn way(&self, to: &[f64], samples: &mut Samples) -> Option<Vec<Vec<f64>>> {
        let wanted = ArmClearance {
            furniture_m: WAY_CLEAR_M,
            things_m: WAY_CLEAR_M,
        };
        let start = self.before.clearance(&self.start).0;
        let mut least = wanted.least(start).least(self.before.clearance(to).0);
        if start.furniture_m < WAY_CLEAR_M {
            // A link that only turns above the surface on which the arm is mounted keeps its
            // distance up to rounding.
            least.furniture_m -= TURNING_M;
        }
        if least.furniture_m < 0.0 || least.things_m < LEAST_CLEAR_M {
            return None;
        }
        motion::way(
            &self.before,
            &self.start,
            to,
            least,
            &mut samples.share(SAMPLES_A_GRASP),
        )
    }

    /// Inverse kinematics. An arm of few joints may turn the hand, by as much as `most_rad`;
    /// returns the turn.
    fn solve_turned(
        &self,
        seed: &[f64],
        target: &Isometry3<f64>,
        most_rad: f64,
    ) -> Option<(Vec<f64>, f64)> {
        let reach = self.reach(target, seed.len());
        match self.layout.arm.len() < FULL_ARM {
            true => ik::solve_turned(self.kinematics, seed, &reach, most_rad),
            false => ik::solve(self.kinematics, seed, &reach).map(|found| (found, 0.0)),
        }
    }

    /// A pose for the hand that the arm alone should reach.
    fn reach(&self, target: &Isometry3<f64>, n_joints: usize) -> ik::IkRequest {
        let mut mobility = vec![0.0; n_joints];
        self.layout.arm.iter().for_each(|idx| mobility[*idx] = 1.0);
        ik::IkRequest {
            target: *target,
            mobility,
        }
    }

    /// Postures a few centimetres apart on a straight path of the hand with fixed orientation.
    /// Returns `None` if the arm can't follow.
    fn straight(&self, from: &[f64], by: &Vector3<f64>) -> Option<Vec<Vec<f64>>> {
        let hand = self.kinematics.grasp(from);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few steps"
        )]
        let n_steps = (by.norm() / STEP_M).ceil().clamp(1.0, 100.0) as usize;
        let mut path: Vec<Vec<f64>> = Vec::new();
        for step in 1..=n_steps {
            let mut target = hand;
            target.translation.vector += by * (step as f64 / n_steps as f64);
            let last = path.last().map_or(from, Vec::as_slice);
            let (next, _) = self.solve_turned(last, &target, SMALL_TURN_RAD)?;
            if next
                .iter()
                .zip(last)
                .any(|(a, b)| (a - b).abs() > LARGEST_STEP)
            {
                return None;
            }
            path.push(next);
        }
        Some(path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_base::Files;
    use actcheck_data::{Pose, RobotStart};
    use actcheck_world::geometry;
    use std::path::Path;
    use std::sync::Arc;

    /// A hand with an object before it, and a wall at several distances behind it.
    #[test]
    fn an_arm_retreats_only_as_far_as_the_way_is_free() {
        let path = Path::new("models/robots/fixed_arm.toml");
        let profile = actcheck_config::robot::read(&Files::Shipped, path)
            .expect("the shipped robot is valid")
            .complete()
            .expect("it states all roles");
        let start = RobotStart {
            profile: Arc::new(profile),
            base: [0.0; 3],
            root_height_m: 0.0,
            knows: Arc::new([]),
        };
        let (kinematics, layout, home) = geometry(&start).expect("the shipped robot is valid");
        let mut lifted = home.clone();
        for (idx, value) in layout.arm.iter().zip([0.0, 0.7, 0.0, 1.59, 0.0, 0.85, 0.0]) {
            lifted[*idx] = value;
        }
        let hand = kinematics.grasp(&lifted).translation.vector;
        let way_m = |behind_m: f64| {
            // As high as the hand, so that the arm is above it.
            let (position, size_m) = ([hand.x - behind_m - 0.05, 0.0, 0.0], [0.1, 1.0, hand.z]);
            let pose = Pose::upright(position, 0.0);
            let wall = Sighting {
                id: "wall".to_owned(),
                pose,
                size_m,
                furniture: true,
                angular: false,
            };
            let wall = [Block::new(&wall)];
            let space = || {
                ArmSpace::new(
                    &kinematics,
                    &layout,
                    &wall,
                    &[],
                    std::slice::from_ref(&home),
                )
            };
            let arm = Arm {
                kinematics: &kinematics,
                layout: &layout,
                start: home.clone(),
                postures: Vec::new(),
                before: space(),
                meanwhile: space(),
                lifts_m: &LIFTS_M,
                approach_m: APPROACH_M,
                closing_m: Vec::new(),
                span: Span::of(&kinematics, &layout.arm, &home),
                beside: None,
            };
            let last = arm.retreat(&lifted, &-Vector3::x()).pop();
            last.map(|posture| (kinematics.grasp(&posture).translation.vector - hand).norm())
        };
        assert_eq!(way_m(0.05), None);
        for (behind_m, expected_m) in [(0.1, 0.05), (0.2, 0.1)] {
            assert!(
                way_m(behind_m).is_some_and(|way_m| (way_m - expected_m).abs() < 1e-3),
                "{behind_m}: {:?}",
                way_m(behind_m)
            );
        }
    }
}
