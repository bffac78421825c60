//! The gripper: which joints move its fingers, and how far apart these are at any position of the joints.
//!
//! Two fingers that slide apart from 0 need no table: each is at half of the opening. For all other grippers (turning
//! fingers, other directions, couplings, one moving finger), the opening is measured on the model, see
//! [`crate::finger_gap`], at evenly spaced positions between open and closed.

use nalgebra::Isometry3;

use crate::WorldError;
use crate::description::{JointKind, RobotModel};
use crate::finger_gap::{Gap, Probe};
use actcheck_data::RobotProfile;

/// Intervals of the table. At this number, the error between entries is about 0.01 mm for a finger of 10 cm.
const INTERVALS: usize = 60;
/// A difference of openings below this is none. Unit: metres.
const LEAST_CHANGE_M: f64 = 1e-6;
/// Least difference between the widest and the smallest opening. Unit: metres.
const LEAST_TRAVEL_M: f64 = 0.005;
/// Two sliding fingers whose measured opening differs by less than this from the sum of their positions need no table.
/// Unit: metres.
const SLIDING_SLACK_M: f64 = 0.005;
/// Tolerance of limits, which are often rounded. Unit: metres.
const LIMIT_SLACK_M: f64 = 1e-3;
/// Largest speed of a fingertip. Unit: m/s. A finger that is faster throws the object away before the other arrives.
const FASTEST_M_S: f64 = 0.1;

/// A joint that a motor of the gripper moves.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Leader {
    joint: usize,
    /// Position where the gripper is closed.
    closed: f64,
    /// Position where it is open.
    open: f64,
    /// Way of the fingertips per way of the joint, on average. Unit: 1, or metres per radian.
    lever_m: f64,
}

/// A joint that follows a leader.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Follower {
    joint: usize,
    leader: usize,
    factor: f64,
    offset: f64,
}

/// The gripper at one share of the way from closed to open.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Entry {
    share: f64,
    gap: Gap,
}

/// The opening of a gripper as a function of its joints.
#[derive(Debug, Clone, PartialEq)]
pub struct Gripper {
    leaders: Vec<Leader>,
    /// Joints that mimic a leader, without a motor of their own.
    followers: Vec<Follower>,
    /// Index of the leader that moves the left and the right finger. A finger that does not move has the other's.
    sides: [usize; 2],
    /// From closed to open; empty for two sliding fingers, each at half of the opening.
    table: Vec<Entry>,
    /// Widest opening; for two sliding fingers, twice the smaller upper limit. Unit: metres.
    widest_m: f64,
}

impl Gripper {
    /// Finds the gripper of a profile. `links` are the fingers, `grasp` is the grasp frame with its link.
    ///
    /// # Errors
    /// [`WorldError::Gripper`] if the opening can't be measured, [`WorldError::Missing`] for an unknown joint.
    pub(crate) fn find(
        profile: &RobotProfile,
        model: &RobotModel,
        links: [usize; 2],
        grasp: (usize, Isometry3<f64>),
    ) -> Result<Self, WorldError> {
        let named = profile.finger_joints.iter().map(|name| model.joint(name)).collect::<Result<Vec<_>, _>>()?;
        let [left, right] = links;
        // Some robots name their fingers as seen from the front.
        let probes = [[left, right], [right, left]].map(|links| Probe::new(model, links, grasp));
        if let Some(sliding) = probes.iter().find_map(|probe| sliding(&named, model, probe)) {
            return Ok(sliding);
        }
        let [usual, swapped] = probes.map(|probe| measured(&named, model, &probe));
        let found = match (usual, swapped) {
            (Ok(usual), Ok(swapped)) if swapped.widest_m > usual.widest_m => Ok(swapped.with_sides_swapped()),
            (Err(_), Ok(swapped)) => Ok(swapped.with_sides_swapped()),
            (usual, _) => usual,
        };
        found.map_err(|what| WorldError::Gripper { name: profile.urdf.name.to_string(), what })
    }

    /// The same gripper with the fingers in the profile's order.
    fn with_sides_swapped(mut self) -> Self {
        self.sides.reverse();
        self
    }

    /// Returns all joints that move the fingers, those with a motor first.
    pub fn joints(&self) -> impl Iterator<Item = usize> + '_ {
        let leaders = self.leaders.iter().map(|leader| leader.joint);
        leaders.chain(self.followers.iter().map(|follower| follower.joint))
    }

    /// Returns whether a joint moves a finger.
    pub fn contains(&self, joint: usize) -> bool {
        self.joints().any(|own| own == joint)
    }

    /// Returns whether a joint follows another of this gripper and has no motor.
    pub(crate) fn follows(&self, joint: usize) -> bool {
        self.followers.iter().any(|follower| follower.joint == joint)
    }

    /// Returns the joints with a motor, each with its lever: way of the fingertips per way of the joint.
    pub(crate) fn motors(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.leaders.iter().map(|leader| (leader.joint, leader.lever_m))
    }

    /// Returns the lever of a joint with a motor.
    pub(crate) fn lever_m(&self, joint: usize) -> Option<f64> {
        self.motors().find(|(own, _)| *own == joint).map(|(_, lever_m)| lever_m)
    }

    /// Returns the largest speed of a joint, given that of its URDF; fingers that were measured are slowed down.
    pub(crate) fn fastest(&self, joint: usize, velocity: f64) -> f64 {
        match self.lever_m(joint) {
            Some(lever_m) if !self.table.is_empty() => velocity.min(FASTEST_M_S / lever_m),
            _ => velocity,
        }
    }

    /// For the left and the right finger: the joint that moves it, 1 or -1 for the direction of the joint in which the
    /// finger opens, and the joint's lever.
    pub(crate) fn sides(&self) -> [(usize, f64, f64); 2] {
        self.sides.map(|side| {
            let Leader { joint, closed, open, lever_m } = self.leaders[side];
            (joint, (open - closed).signum(), lever_m)
        })
    }

    /// Returns the speeds of the left and the right fingertip. Unit: m/s; positive opens.
    pub fn speeds(&self, velocities: &[f64]) -> [f64; 2] {
        self.sides().map(|(joint, sign, lever_m)| velocities[joint] * sign * lever_m)
    }

    /// Returns the widest opening. Unit: metres.
    pub fn widest_m(&self) -> f64 {
        self.widest_m
    }

    /// Returns the gap between the fingers at these joint positions. Unit: metres.
    pub fn opening_m(&self, positions: &[f64]) -> f64 {
        if self.table.is_empty() {
            return self.leaders.iter().map(|leader| positions[leader.joint]).sum();
        }
        let shares = self.leaders.iter().map(|leader| {
            let Leader { joint, closed, open, .. } = *leader;
            (positions[joint] - closed) / (open - closed)
        });
        let gaps: f64 = shares.map(|share| interpolated(&self.table, |entry| entry.share, share).1.width_m()).sum();
        (gaps / self.leaders.len() as f64).max(0.0)
    }

    /// Returns the position of one of its joints at an opening, or `None` for any other joint.
    pub fn target(&self, joint: usize, opening_m: f64) -> Option<f64> {
        if self.table.is_empty() {
            return self.contains(joint).then_some(opening_m / 2.0);
        }
        let share = self.share(opening_m);
        let at = |leader: &Leader| leader.closed + share * (leader.open - leader.closed);
        if let Some(leader) = self.leaders.iter().find(|leader| leader.joint == joint) {
            return Some(at(leader));
        }
        let Follower { leader, factor, offset, .. } = self.followers.iter().find(|own| own.joint == joint)?;
        Some(factor * at(&self.leaders[*leader]) + offset)
    }

    /// Sets the positions of its joints to an opening.
    pub fn set(&self, positions: &mut [f64], opening_m: f64) {
        for joint in self.joints() {
            if let (Some(position), Some(target)) = (positions.get_mut(joint), self.target(joint, opening_m)) {
                *position = target;
            }
        }
    }

    /// Returns where the middle between the fingers is at an opening, along the y axis of the grasp frame: other than 0
    /// if only one finger moves. Unit: metres.
    pub fn middle_m(&self, opening_m: f64) -> f64 {
        match self.table.is_empty() {
            true => 0.0,
            false => interpolated(&self.table, |entry| entry.share, self.share(opening_m)).1.middle_m(),
        }
    }

    /// The share of the way from closed to open at an opening. Nothing closes the fingers completely.
    fn share(&self, opening_m: f64) -> f64 {
        match opening_m > 0.0 {
            true => interpolated(&self.table, |entry| entry.gap.width_m(), opening_m).0,
            false => 0.0,
        }
    }
}

/// The entry of a table at a value of an ascending key, between those of the table.
fn interpolated(table: &[Entry], key: impl Fn(&Entry) -> f64, value: f64) -> (f64, Gap) {
    let above = table.partition_point(|entry| key(entry) < value).clamp(1, table.len() - 1);
    let (from, to) = (&table[above - 1], &table[above]);
    let part = ((value - key(from)) / (key(to) - key(from))).clamp(0.0, 1.0);
    (from.share + part * (to.share - from.share), from.gap.towards(&to.gap, part))
}

/// Two fingers that slide apart from 0, where they meet.
fn sliding(named: &[usize], model: &RobotModel, probe: &Probe<'_>) -> Option<Gripper> {
    let [left, right] = *named else { return None };
    let fits = |joint: usize| {
        let joint = &model.joints[joint];
        let own = joint.mimic.is_none_or(|(leader, factor, offset)| {
            named.contains(&leader) && (factor - 1.0).abs() < 1e-9 && offset.abs() < 1e-9
        });
        own && joint.kind == JointKind::Prismatic && joint.lower > -LIMIT_SLACK_M && joint.upper > 0.0
    };
    if !(fits(left) && fits(right)) {
        return None;
    }
    let at = |end: fn(f64, f64) -> f64| {
        let mut positions = vec![0.0; model.joints.len()];
        for joint in [left, right] {
            positions[joint] = end(model.joints[joint].lower, model.joints[joint].upper);
        }
        let known = positions[left] + positions[right];
        probe.gap(&positions).is_none_or(|gap| (gap.width_m() - known).abs() < SLIDING_SLACK_M)
    };
    let leaders = [left, right].map(|joint| {
        let joint_of = &model.joints[joint];
        Leader { joint, closed: joint_of.lower, open: joint_of.upper, lever_m: 1.0 }
    });
    let widest_m = 2.0 * model.joints[left].upper.min(model.joints[right].upper);
    (at(f64::min) && at(f64::max)).then(|| Gripper {
        leaders: leaders.to_vec(),
        followers: Vec::new(),
        sides: [0, 1],
        table: Vec::new(),
        widest_m,
    })
}

/// Measures the opening on the model. The error is a sentence.
fn measured(named: &[usize], model: &RobotModel, probe: &Probe<'_>) -> Result<Gripper, String> {
    let (mut leaders, followers) = coupled(named, model);
    let moving =
        probe.moving(&leaders.iter().copied().chain(followers.iter().map(|own| own.joint)).collect::<Vec<_>>());
    if moving.grasp_frame {
        return Err("its fingers can't be measured: the joints in `finger_joints` move the `grasp_link`".to_owned());
    }
    let leader_of = |joints: &[usize]| {
        let of = |joint: &usize| {
            let followed = followers.iter().find(|own| own.joint == *joint).map(|own| own.leader);
            followed.or_else(|| leaders.iter().position(|leader| leader == joint))
        };
        joints.iter().find_map(of)
    };
    let sides = match moving.fingers.each_ref().map(|joints| leader_of(joints)) {
        [Some(left), Some(right)] => [left, right],
        [Some(only), None] | [None, Some(only)] => [only; 2],
        [None, None] => return Err("none of its `finger_joints` moves one of its `finger_links`".to_owned()),
    };
    // Joints that move neither finger stay where they are.
    leaders.truncate(sides[0].max(sides[1]) + 1);
    if let Some(joint) = leaders.iter().map(|leader| &model.joints[*leader]).find(|joint| !joint.upper.is_finite()) {
        return Err(format!("the opening of its gripper can't be measured: `{}` has no limits", joint.name));
    }
    let posture = |ends: &[(f64, f64)], share: f64| {
        let mut positions = vec![0.0; model.joints.len()];
        for (leader, (from, to)) in leaders.iter().zip(ends) {
            positions[*leader] = from + share * (to - from);
        }
        for Follower { joint, leader, factor, offset } in &followers {
            positions[*joint] = factor * positions[leaders[*leader]] + offset;
        }
        positions
    };
    let rising: Vec<(f64, f64)> =
        leaders.iter().map(|leader| (model.joints[*leader].lower, model.joints[*leader].upper)).collect();
    let samples = |ends: &[(f64, f64)]| -> Vec<Option<Gap>> {
        (0..=INTERVALS).map(|idx| probe.gap(&posture(ends, idx as f64 / INTERVALS as f64))).collect()
    };
    let falling = |(from, to): (f64, f64)| (to, from);
    // Two joints may open in opposite directions.
    let mut ways = vec![rising.clone(), rising.iter().copied().map(falling).collect()];
    if let [first, second] = rising[..] {
        ways.extend([vec![first, falling(second)], vec![falling(first), second]]);
    }
    let best = ways
        .into_iter()
        .filter_map(|ends| Some((longest_run(&samples(&ends))?, ends)))
        .max_by(|a, b| travel(&a.0).total_cmp(&travel(&b.0)));
    let Some((table, ends)) = best.filter(|(table, _)| travel(table) > LEAST_TRAVEL_M) else {
        return Err(
            "the opening of its gripper can't be measured: no two surfaces of `finger_links` that face each other at \
             the grasp frame come closer"
                .to_owned(),
        );
    };
    let gap_of = |entry: Option<&Entry>| entry.map_or(Gap::default(), |entry| entry.gap);
    let (closed, open) = (gap_of(table.first()), gap_of(table.last()));
    let shares = table.last().map_or(1.0, |last| last.share) - table[0].share;
    let travels = [open.left_m - closed.left_m, closed.right_m - open.right_m];
    let (first_share, last_share) = (table[0].share, table[0].share + shares);
    let leaders = leaders.iter().zip(&ends).enumerate().map(|(idx, (joint, (from, to)))| {
        let way = (to - from) * shares;
        let moved: f64 = (0..2).filter(|side| sides[*side] == idx).map(|side| travels[side]).sum();
        let at = |share: f64| from + share * (to - from);
        let lever_m = (moved / way).abs().max(1e-4);
        Leader { joint: *joint, closed: at(first_share), open: at(last_share), lever_m }
    });
    let leaders: Vec<Leader> = leaders.collect();
    let widest_m = open.width_m();
    let table = table.iter().map(|entry| Entry { share: (entry.share - first_share) / shares, gap: entry.gap });
    Ok(Gripper { leaders, table: table.collect(), followers, sides, widest_m })
}

fn travel(table: &[Entry]) -> f64 {
    match (table.first(), table.last()) {
        (Some(first), Some(last)) => last.gap.width_m() - first.gap.width_m(),
        _ => 0.0,
    }
}

/// The measured part of the way on which the fingers open, and open furthest.
fn longest_run(samples: &[Option<Gap>]) -> Option<Vec<Entry>> {
    let mut runs: Vec<Vec<Entry>> = vec![Vec::new()];
    for (idx, sample) in samples.iter().enumerate() {
        let Some(gap) = *sample else {
            runs.push(Vec::new());
            continue;
        };
        let last = runs.last_mut()?;
        let entry = Entry { share: idx as f64 / INTERVALS as f64, gap };
        if last.last().is_none_or(|before| gap.width_m() > before.gap.width_m() + LEAST_CHANGE_M) {
            last.push(entry);
        } else {
            runs.push(vec![entry]);
        }
    }
    runs.into_iter().filter(|run| run.len() > 1).max_by(|a, b| travel(a).total_cmp(&travel(b)))
}

/// The joints that lead the named ones, and all that follow these.
fn coupled(named: &[usize], model: &RobotModel) -> (Vec<usize>, Vec<Follower>) {
    let mut leaders: Vec<usize> = Vec::new();
    for joint in named {
        let leader = lead(*joint, model).0;
        if !leaders.contains(&leader) {
            leaders.push(leader);
        }
    }
    let followers = (0..model.joints.len()).filter(|joint| model.joints[*joint].mimic.is_some()).filter_map(|joint| {
        let (leader, factor, offset) = lead(joint, model);
        let leader = leaders.iter().position(|known| *known == leader)?;
        Some(Follower { joint, leader, factor, offset })
    });
    let followers = followers.collect();
    (leaders, followers)
}

/// The joint at the end of a chain of mimic joints, with the factor and the offset of the whole chain.
fn lead(joint: usize, model: &RobotModel) -> (usize, f64, f64) {
    let (mut at, mut factor, mut offset) = (joint, 1.0, 0.0);
    // A chain that is longer than this is a circle.
    for _ in 0..model.joints.len() {
        let Some((leader, next_factor, next_offset)) = model.joints[at].mimic else { break };
        offset += factor * next_offset;
        factor *= next_factor;
        at = leader;
    }
    (at, factor, offset)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::Joint;
    use crate::layout::check_robot;
    use crate::robot::tests::alone;
    use actcheck_base::{Files, Source};

    /// A hand with fingers of 10 cm whose inner faces are 2 cm off its middle at position 0. The grasp frame is 10 cm
    /// from the hinges. `left` and `right` are the types and limits of the finger joints.
    fn hand(left: &str, right: &str, finger_joints: &[&str]) -> RobotProfile {
        let path = Path::new("models/robots/mobile_manipulator.toml");
        let mut profile = actcheck_config::robot::read(&Files::Shipped, path).expect("the shipped robot is valid");
        let inertial = "<inertial><mass value=\"0.1\"/>\
                        <inertia ixx=\"1e-4\" ixy=\"0\" ixz=\"0\" iyy=\"1e-4\" iyz=\"0\" izz=\"1e-4\"/></inertial>";
        let finger = |name: &str, y: f64, joint: &str| {
            format!(
                "<link name=\"{name}_finger\">{inertial}<collision><origin xyz=\"0.06 {} 0\"/><geometry>\
                 <box size=\"0.1 0.01 0.03\"/></geometry></collision></link>\
                 <joint name=\"{name}\" {joint}<parent link=\"palm\"/><child link=\"{name}_finger\"/>\
                 <origin xyz=\"0 {y} 0\"/></joint>",
                0.005_f64.copysign(y)
            )
        };
        let text = format!(
            "<robot name=\"hand\"><link name=\"base\"/>\
             <joint name=\"lift\" type=\"prismatic\"><parent link=\"base\"/><child link=\"palm\"/><axis xyz=\"0 0 1\"/>\
             <limit lower=\"0.5\" upper=\"1\" effort=\"300\" velocity=\"0.2\"/></joint>\
             <link name=\"palm\">{inertial}</link>{}{}\
             <joint name=\"tip\" type=\"fixed\"><parent link=\"palm\"/><child link=\"grasp\"/>\
             <origin xyz=\"0.1 0 0\"/></joint><link name=\"grasp\"/></robot>",
            finger("left", 0.02, left),
            finger("right", -0.02, right),
        );
        profile.urdf = Source::new("hand.urdf", text);
        profile.base_joints = None;
        profile.arm_joints = vec!["lift".to_owned()];
        profile.home = vec![0.6];
        profile.postures = Vec::new();
        profile.head_joints = Vec::new();
        profile.finger_joints = finger_joints.iter().map(|name| (*name).to_owned()).collect();
        profile.finger_links = ["left_finger", "right_finger"].map(str::to_owned);
        profile.grasp_link = "grasp".to_owned();
        profile.camera_link = "base".to_owned();
        profile.max_opening_m = 0.1;
        profile
    }

    fn turning(lower: f64, upper: f64) -> String {
        format!(
            "type=\"revolute\"><axis xyz=\"0 0 1\"/>\
             <limit lower=\"{lower}\" upper=\"{upper}\" effort=\"20\" velocity=\"2\"/>"
        )
    }

    fn sliding_from(lower: f64, upper: f64, y: f64) -> String {
        format!(
            "type=\"prismatic\"><axis xyz=\"0 {y} 0\"/>\
             <limit lower=\"{lower}\" upper=\"{upper}\" effort=\"20\" velocity=\"0.1\"/>"
        )
    }

    const FIXED: &str = "type=\"fixed\">";
    const MIMIC: &str = "<mimic joint=\"left\" multiplier=\"-1\"/>";

    /// Distance of the inner face from the middle: nearest 9 cm from the hinge, at the border of what is measured.
    fn turned(angle: f64) -> f64 {
        0.02 + 0.09 * libm::tan(angle)
    }

    /// Hands, each with its motors, the positions of left and right finger at share 0.5 of the way, and the opening
    /// there in closed form.
    fn hands() -> Vec<(RobotProfile, Vec<f64>, f64)> {
        let (left, right) = (turning(0.0, 0.6), turning(-0.6, 0.0));
        let coupled = format!("{right}{MIMIC}");
        let (down, up) = (sliding_from(-0.04, 0.0, -1.0), sliding_from(-0.04, 0.0, 1.0));
        vec![
            (hand(&left, &right, &["left", "right"]), vec![0.3, -0.3], 2.0 * turned(0.3)),
            (hand(&left, &coupled, &["left"]), vec![0.3, -0.3], 2.0 * turned(0.3)),
            (hand(&left, &coupled, &["left", "right"]), vec![0.3, -0.3], 2.0 * turned(0.3)),
            (hand(&left, FIXED, &["left"]), vec![0.3], 0.02 + turned(0.3)),
            (hand(&down, &up, &["left", "right"]), vec![-0.02, -0.02], 0.08),
        ]
    }

    #[test]
    fn the_opening_is_that_of_the_closed_form() {
        for (idx, (profile, positions, opening_m)) in hands().into_iter().enumerate() {
            let world = alone(profile);
            let gripper = &world.layout().gripper;
            let place = |joint: &Joint| ["left", "right"].iter().position(|name| *name == joint.name);
            let joints = world.kinematics().joints().iter();
            let all: Vec<f64> = joints.map(|joint| place(joint).map_or(0.6, |idx| positions[idx])).collect();
            let measured = gripper.opening_m(&all);
            assert!((measured - opening_m).abs() < 2e-5, "hand {idx}: {measured} m instead of {opening_m} m");
            let mut set = vec![0.6; all.len()];
            gripper.set(&mut set, opening_m);
            let far = set.iter().zip(&all).map(|(is, wanted)| (is - wanted).abs()).fold(0.0, f64::max);
            assert!(far < 2e-4, "hand {idx}: {set:?} instead of {all:?}");
        }
    }

    #[test]
    fn one_moving_finger_has_its_middle_beside_the_grasp_frame() {
        let world = alone(hands().swap_remove(3).0);
        let middle_m = world.layout().gripper.middle_m(0.02 + turned(0.3));
        let expected = f64::midpoint(turned(0.3), -0.02);
        assert!((middle_m - expected).abs() < 2e-5, "{middle_m} m instead of {expected} m");
    }

    /// Motors and couplings bring the fingers to the commanded opening.
    #[test]
    fn all_hands_open_and_close() {
        for (idx, (profile, _, _)) in hands().into_iter().enumerate() {
            let mut world = alone(profile);
            let mut command = world.hold();
            for opening_m in [0.07, 0.06, 0.075] {
                command.gripper_opening_m = opening_m;
                (0..120).for_each(|_| world.step(&command));
                let reached = world.observe().gripper_opening_m;
                assert!((reached - opening_m).abs() < 1e-3, "hand {idx}: {reached} m instead of {opening_m} m");
            }
        }
    }

    #[test]
    fn a_gripper_that_cannot_be_measured_is_refused() {
        let left = turning(0.0, 0.6);
        let of = |profile: &RobotProfile| check_robot(profile).expect_err("it can't be measured").diagnostic();
        let mut apart = hand(&left, FIXED, &["left"]);
        apart.grasp_offset_m = [0.0, 0.0, 0.5];
        let mut inside = hand(&left, FIXED, &["left"]);
        inside.grasp_link = "left_finger".to_owned();
        let mut wide = hand(&left, FIXED, &["left"]);
        wide.max_opening_m = 0.12;
        for (profile, part) in [
            (apart, "no two surfaces"),
            (inside, "move the `grasp_link`"),
            (wide, "no wider than 0.1"),
            (hand(FIXED, FIXED, &["lift"]), "move the `grasp_link`"),
        ] {
            let found = of(&profile);
            assert_eq!(found.code, "W024");
            assert!(found.message.contains(part), "{}", found.message);
        }
    }
}
