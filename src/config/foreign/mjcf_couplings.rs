//! The actuators of an MJCF robot, and the equalities that couple its joints to others.

use std::collections::{BTreeMap, BTreeSet};

use crate::foreign::mjcf_compiler::{Compiler, MjcfAttributes};
use crate::foreign::mjcf_loops::{self, BodyTree};
use crate::foreign::xml::{self, Node, Reader};
use actcheck_base::{Diagnostic, SourceSpan};

/// A joint that another one follows, with the factor and the offset of the coupling.
pub(super) type Mimic = (String, f64, f64);

/// A joint that an element names.
#[derive(Debug, Clone)]
pub(super) struct NamedJoint {
    pub(super) name: String,
    place: SourceSpan,
    /// The use of the joint by the element, and the way in which the element names it.
    role: &'static str,
    key: &'static str,
}

impl NamedJoint {
    fn new(name: &str, element: Node, [role, key]: [&'static str; 2], reader: &Reader) -> Self {
        Self {
            name: name.to_owned(),
            place: reader.place(element),
            role,
            key,
        }
    }

    /// Returns the error for a joint that the model lacks (W051).
    pub(super) fn unknown(&self) -> Diagnostic {
        let message = format!(
            "the model has no movable joint `{}` to {}",
            self.name, self.role
        );
        Diagnostic::error("W051", message)
            .at(&self.place.source, xml::tag(&self.place))
            .help(self.key)
    }
}

/// Couplings and motors of a file, by names of joints.
#[derive(Debug, Clone, Default)]
pub(super) struct Couplings {
    /// Couplings of the joints that follow others.
    pub(super) mimics: BTreeMap<String, Mimic>,
    /// Largest efforts by the force limits of actuators. Units: newtons or newton metres.
    pub(super) efforts: BTreeMap<String, f64>,
    /// Ranges of position servos, for joints that have none of their own. Units: radians or metres.
    pub(super) ranges: BTreeMap<String, [f64; 2]>,
    /// Positions where the file's bodies are as it places them, of the joints for which these are
    /// not 0.
    pub(super) starts: BTreeMap<String, f64>,
    /// The joints that elements name, with the places of these.
    pub(super) named: Vec<NamedJoint>,
    /// Joints with an actuator. `None` if the file has no actuators, and none are known.
    pub(super) actuated: Option<BTreeSet<String>>,
}

impl Couplings {
    pub(super) fn read(root: Node, compiler: &Compiler, reader: &mut Reader) -> Self {
        for tendon in elements(root, "tendon").filter(|tendon| tendon.has_tag_name("spatial")) {
            let name = tendon.attribute("name").unwrap_or_default();
            let message = format!("the spatial tendon `{name}` is left out: it pulls nothing");
            let help = "the joints that it moves are free here, or follow their equalities";
            reader.warning("W036", tendon, message, help);
        }
        for soft in elements(root, "deformable") {
            let name = soft.tag_name().name();
            let message = format!("`<{name}>` can't be simulated: bodies are rigid here");
            reader.error("W035", soft, message, "leave it out");
        }
        let tendons = tendons(root, reader);
        let tree = BodyTree::read(root, compiler, reader);
        let mut found = Self {
            starts: tree.starts(),
            ..Self::default()
        };
        found.add_actuators(root, compiler, &tendons, reader);
        found.add_equalities_of_joints(root, reader);
        found.add_equalities_of_tendons(root, (&tendons, &tree), reader);
        let loops = mjcf_loops::couplings(root, compiler, (tree, &found), reader);
        found.mimics.extend(loops);
        found
    }

    /// Returns whether only its links, springs or contacts move a joint.
    pub(super) fn is_passive(&self, joint: &str) -> bool {
        self.actuated
            .as_ref()
            .is_some_and(|actuated| !actuated.contains(joint))
    }

    /// Returns the position of a joint where the bodies are as the file places them.
    pub(super) fn start(&self, joint: &str) -> f64 {
        self.starts.get(joint).copied().unwrap_or(0.0)
    }

    fn add_actuators(
        &mut self,
        root: Node,
        compiler: &Compiler,
        tendons: &Tendons,
        reader: &mut Reader,
    ) {
        for actuator in elements(root, "actuator") {
            let attributes = compiler.attributes(actuator, None);
            let direct = attributes
                .get("joint")
                .or(attributes.get("jointinparent"))
                .map(|joint| (joint.to_owned(), 1.0));
            let by_tendon = attributes
                .get("tendon")
                .and_then(|name| tendons.get(name))
                .map(|tendon| tendon.joints.clone());
            let moved: Vec<(String, f64)> = direct
                .into_iter()
                .chain(by_tendon.into_iter().flatten())
                .collect();
            let role = [
                "drive",
                "an actuator names a joint, and a tendon those that it pulls",
            ];
            let named = moved
                .iter()
                .map(|(joint, _)| NamedJoint::new(joint, actuator, role, reader));
            self.named.extend(named);
            self.actuated
                .get_or_insert_default()
                .extend(moved.iter().map(|(joint, _)| joint.clone()));
            if let Some(range) = servo_range(actuator, &attributes, compiler, reader) {
                // A tendon is as long as the sum of its joints, which move alike.
                let sum: f64 = moved.iter().map(|(_, share)| share.abs()).sum();
                let ends = range.map(|end| end / sum);
                let range_of = |share: f64| {
                    if share < 0.0 {
                        [-ends[1], -ends[0]]
                    } else {
                        ends
                    }
                };
                let ranges = moved
                    .iter()
                    .filter(|_| sum > 0.0)
                    .map(|(joint, share)| (joint.clone(), range_of(*share)));
                self.ranges.extend(ranges);
            }
            let Some([lower, upper]) = force_range(actuator, &attributes, compiler, reader) else {
                continue;
            };
            let most =
                f64::max(-lower, upper) * attributes.number("gear", reader).unwrap_or(1.0).abs();
            for (joint, share) in moved {
                let effort = most * share.abs();
                let known = self.efforts.entry(joint).or_insert(effort);
                *known = known.max(effort);
            }
        }
    }

    fn add_equalities_of_joints(&mut self, root: Node, reader: &mut Reader) {
        for joint in elements(root, "equality").filter(|equality| equality.has_tag_name("joint")) {
            if joint.attribute("active") == Some("false") {
                continue;
            }
            let Some(follower) = reader.attribute(joint, "joint1") else {
                continue;
            };
            let Some(leader) = joint.attribute("joint2") else {
                let message =
                    format!("an equality that holds `{follower}` in place can't be simulated");
                let help = "remove the joint, or name the joint that it follows in `joint2`";
                reader.error("W035", joint, message, help);
                continue;
            };
            for (name, role) in [
                (
                    leader,
                    ["mimic", "`joint2` names the joint that `joint1` follows"],
                ),
                (
                    follower,
                    ["couple", "`joint1` names the joint that follows `joint2`"],
                ),
            ] {
                self.named.push(NamedJoint::new(name, joint, role, reader));
            }
            let written = joint.attribute("polycoef").unwrap_or("0 1 0 0 0");
            let Some(numbers) = reader.list(joint, "polycoef", written) else {
                continue;
            };
            let (offset, factor) = (
                numbers.first().copied().unwrap_or(0.0),
                numbers.get(1).copied().unwrap_or(1.0),
            );
            if numbers.iter().skip(2).any(|number| *number != 0.0) {
                not_linear(joint, follower, leader, reader);
            }
            let offset = offset + self.start(follower) - factor * self.start(leader);
            self.mimics
                .insert(follower.to_owned(), (leader.to_owned(), factor, offset));
        }
    }

    /// Couples the two joints of each fixed tendon whose length an equality fixes: the joint
    /// without an actuator follows, of two such joints the one that follows no other yet.
    fn add_equalities_of_tendons(
        &mut self,
        root: Node,
        (tendons, tree): (&Tendons, &BodyTree),
        reader: &mut Reader,
    ) {
        let equalities = elements(root, "equality").filter(|node| {
            node.has_tag_name("tendon") && node.attribute("active") != Some("false")
        });
        for equality in equalities {
            let tendon = equality
                .attribute("tendon1")
                .filter(|_| equality.attribute("tendon2").is_none());
            let Some(Tendon { joints, spring }) = tendon.and_then(|name| tendons.get(name)) else {
                continue;
            };
            let [first, second] = joints.as_slice() else {
                continue;
            };
            let is_free = |joint: &str| self.is_passive(joint) && !self.mimics.contains_key(joint);
            let (leader, follower) = match (is_free(&first.0), is_free(&second.0)) {
                (true, false) => (second, first),
                _ => (first, second),
            };
            if follower.1 == 0.0 || self.mimics.contains_key(&follower.0) {
                continue;
            }
            let longer = equality
                .attribute("polycoef")
                .and_then(|text| reader.list(equality, "polycoef", text)?.first().copied());
            let factor = -leader.1 / follower.1;
            let [of_leader, of_follower] = [leader, follower].map(|(joint, _)| tree.range(joint));
            let as_placed = longer.unwrap_or(0.0) / follower.1 + self.start(&follower.0)
                - factor * self.start(&leader.0);
            // The limits of a joint are as strong as an equality, and the spring of the tendon
            // decides where both disagree.
            let offset = match (of_leader, of_follower, spring) {
                (Some(from), Some([lower, upper]), Some(length)) => {
                    let to = from.map(|end| factor * end + as_placed);
                    let is_beyond =
                        f64::max(to[0], to[1]) < lower || f64::min(to[0], to[1]) > upper;
                    if is_beyond {
                        length / follower.1
                    } else {
                        as_placed
                    }
                }
                _ => as_placed,
            };
            self.mimics
                .insert(follower.0.clone(), (leader.0.clone(), factor, offset));
        }
    }
}

/// The range of an actuator's force: its limit, or that of a motor's control signal. Returns `None`
/// if it is unlimited.
fn force_range(
    actuator: Node,
    attributes: &MjcfAttributes<'_>,
    compiler: &Compiler,
    reader: &mut Reader,
) -> Option<[f64; 2]> {
    let keys = ["forcerange", "forcelimited"];
    let of_force = compiler.limits(actuator, attributes, keys, reader);
    let is = |key: &str, usual: &str| attributes.get(key).unwrap_or(usual) == usual;
    // The force of a motor, and of other actuators without a bias, is the signal times the gain.
    let gain = match actuator.tag_name().name() {
        "motor" => Some(1.0),
        "general" if is("gaintype", "fixed") && is("biastype", "none") => {
            Some(attributes.number("gainprm", reader).unwrap_or(1.0))
        }
        _ => None,
    };
    let of_signal = gain.and_then(|gain| {
        let keys = ["ctrlrange", "ctrllimited"];
        let ends = compiler.limits(actuator, attributes, keys, reader)?;
        let [a, b] = ends.map(|end| end * gain);
        Some([a.min(b), a.max(b)])
    });
    match (of_force, of_signal) {
        (Some([a, b]), Some([c, d])) => Some([a.max(c), b.min(d)]),
        (limits, None) | (None, limits) => limits,
    }
}

/// The range of positions of a position servo, those of its joint or tendon. Returns `None` for
/// other actuators.
fn servo_range(
    actuator: Node,
    attributes: &MjcfAttributes<'_>,
    compiler: &Compiler,
    reader: &mut Reader,
) -> Option<[f64; 2]> {
    let mut first = |name: &str, place: usize| {
        let numbers = reader.list(actuator, name, attributes.get(name)?)?;
        numbers.get(place).copied()
    };
    let ratio = match actuator.tag_name().name() {
        "position" => 1.0,
        "general" if attributes.get("biastype") == Some("affine") => {
            first("gainprm", 0)? / -first("biasprm", 1)?
        }
        _ => return None,
    };
    let gear = first("gear", 0).unwrap_or(1.0);
    let ends = compiler.limits(actuator, attributes, ["ctrlrange", "ctrllimited"], reader)?;
    let [a, b] = ends.map(|end| end * ratio / gear);
    // A negative gear turns the range.
    let range = [a.min(b), a.max(b)];
    (range[0] < range[1] && range.iter().all(|end| end.is_finite())).then_some(range)
}

/// Warns that a coupling is replaced by a linear one.
pub(super) fn not_linear(node: Node, follower: &str, leader: &str, reader: &mut Reader) {
    let message = format!(
        "the coupling of `{follower}` to `{leader}` is not linear: only its linear part is used"
    );
    reader.warning(
        "W036",
        node,
        message,
        "the joint then deviates from its mechanism",
    );
}

/// A fixed tendon: a weighted sum of positions of joints.
struct Tendon {
    /// Joints, with their coefficients.
    joints: Vec<(String, f64)>,
    /// Length of its spring at rest, if it has one.
    spring: Option<f64>,
}

type Tendons = BTreeMap<String, Tendon>;

fn tendons(root: Node, reader: &mut Reader) -> Tendons {
    let mut read = |tendon: Node| {
        let mut number = |node: Node, name: &str| {
            reader
                .list(node, name, node.attribute(name)?)?
                .first()
                .copied()
        };
        let stiffness = number(tendon, "stiffness");
        let spring = number(tendon, "springlength")
            .filter(|length| stiffness.is_some_and(|stiffness| stiffness > 0.0) && *length >= 0.0);
        let joint =
            |joint: Node| Some((joint.attribute("joint")?.to_owned(), number(joint, "coef")?));
        Tendon {
            joints: xml::children(tendon, "joint").filter_map(joint).collect(),
            spring,
        }
    };
    let fixed = elements(root, "tendon").filter(|tendon| tendon.has_tag_name("fixed"));
    fixed
        .filter_map(|tendon| Some((tendon.attribute("name")?.to_owned(), read(tendon))))
        .collect()
}

/// The elements in all sections of this name.
pub(super) fn elements<'a>(root: Node<'a>, section: &str) -> impl Iterator<Item = Node<'a>> {
    xml::children(root, section).flat_map(|all| all.children().filter(Node::is_element))
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_base::Source;

    fn read(text: &str) -> (Couplings, String) {
        let source = Source::new("robot.xml", text.to_owned());
        let document = xml::parse_model(&source, &source.text).expect("it is XML");
        let mut reader = Reader::new(&source);
        let root = document.root_element();
        let compiler = Compiler::read(root, &mut reader);
        let couplings = Couplings::read(root, &compiler, &mut reader);
        (couplings, reader.found.to_string())
    }

    /// A finger of a parallel gripper: `driver` carries `finger`, `bar` is parallel to the driver.
    fn linkage(anchor: &str, of_bar: &str, more: &str) -> String {
        format!(
            "<mujoco><worldbody><body name=\"palm\">\
             <body name=\"driver\" pos=\"0 0.035 0.06\"><joint name=\"driver\" axis=\"1 0 0\"/>\
             <body name=\"finger\" pos=\"0 0.035 0.042\"><joint name=\"finger\" axis=\"-1 0 0\"/></body></body>\
             <body name=\"bar\" pos=\"0 0.02 0.075\"><joint name=\"bar\" axis=\"1 0 0\" {of_bar}/></body></body></worldbody>\
             <equality><connect body1=\"finger\" body2=\"bar\" anchor=\"{anchor}\"/>{more}</equality>\
             <actuator><position joint=\"driver\" ctrlrange=\"0 0.8\"/></actuator></mujoco>"
        )
    }

    /// `<connect>` couples the joints of a parallelogram with factors of exactly 1, on the range of
    /// the servo.
    #[test]
    fn closed_loops_couple_their_joints() {
        let (found, said) = read(&linkage("0 -0.015 0.015", "", ""));
        assert_eq!(found.ranges["driver"], [0.0, 0.8]);
        assert_eq!(
            found.mimics["finger"],
            ("driver".to_owned(), 1.0, 0.0),
            "{said}"
        );
        assert_eq!(found.mimics["bar"], ("driver".to_owned(), 1.0, 0.0));
        assert!(!said.contains("W036"), "{said}");
    }

    /// Bars of other lengths: the angles of Freudenstein's equation, and a warning because these
    /// are not on a line.
    #[test]
    fn a_four_bar_linkage_agrees_with_its_equation() {
        // The ground is 0.04 m along y; crank 0.02, coupler 0.05, rocker 0.04 m; all turn about x.
        let (ground, crank, coupler, rocker) = (0.04, 0.02, 0.05, 0.04);
        let ks = [
            ground / crank,
            ground / rocker,
            (crank * crank - coupler * coupler + rocker * rocker + ground * ground)
                / (2.0 * crank * rocker),
        ];
        let of_rocker = |crank_rad: f64| {
            let (sin, cos) = (libm::sin(crank_rad), libm::cos(crank_rad));
            let (a, b, c) = (
                cos - ks[0] - ks[1] * cos + ks[2],
                -2.0 * sin,
                ks[0] - (ks[1] + 1.0) * cos + ks[2],
            );
            2.0 * libm::atan2(-b - libm::sqrt(b * b - 4.0 * a * c), 2.0 * a)
        };
        let start = 1.2;
        let end = [crank * libm::cos(start), crank * libm::sin(start)];
        let at = of_rocker(start);
        let tip = [ground + rocker * libm::cos(at), rocker * libm::sin(at)];
        // On a short way, the angles are on a line.
        for (most, is_bent) in [(0.2, false), (0.6, true)] {
            let text = format!(
                "<mujoco><compiler angle=\"radian\"/><worldbody><body name=\"palm\">\
                 <body name=\"crank\"><joint name=\"crank\" axis=\"1 0 0\" range=\"-{most} {most}\"/>\
                 <body name=\"coupler\" pos=\"0 {} {}\"><joint name=\"coupler\" axis=\"1 0 0\"/></body></body>\
                 <body name=\"rocker\" pos=\"0 {ground} 0\"><joint name=\"rocker\" axis=\"1 0 0\"/></body></body></worldbody>\
                 <equality><connect body1=\"coupler\" body2=\"rocker\" anchor=\"0 {} {}\"/></equality>\
                 <actuator><motor joint=\"crank\"/></actuator></mujoco>",
                end[0],
                end[1],
                tip[0] - end[0],
                tip[1] - end[1],
            );
            let (found, said) = read(&text);
            let (leader, factor, offset) = &found.mimics["rocker"];
            assert_eq!(leader, "crank");
            let cranks = (-40..=40).map(|n| most * f64::from(n) / 40.0);
            let off = cranks.map(|q| (factor * q + offset - (of_rocker(start + q) - at)).abs());
            let worst = off.fold(0.0, f64::max);
            assert_eq!(worst > 0.02, is_bent, "{worst}");
            assert!(worst < 0.06, "{worst}");
            assert_eq!(
                said.contains("the coupling of `rocker` to `crank` is not linear"),
                is_bent,
                "{said}"
            );
        }
    }

    /// A spring pushes one of two joints without a motor against its limit, where it stays.
    #[test]
    fn springs_decide_where_a_loop_leaves_a_choice() {
        let text = linkage("0 -0.015 0.015", "stiffness=\"0.05\" springref=\"150\"", "")
            .replace(
                "<body name=\"finger\"",
                "<body name=\"coupler\"><joint name=\"coupler\" axis=\"1 0 0\" range=\"-90 0\"/><body name=\"finger\"",
            )
            .replace("</body></body><body name=\"bar\"", "</body></body></body><body name=\"bar\"");
        let (found, said) = read(&text);
        let (_, factor, offset) = &found.mimics["coupler"];
        assert!(
            factor.abs() < 1e-3 && offset.abs() < 1e-3,
            "{factor} {offset} {said}"
        );
        let (_, factor, offset) = &found.mimics["finger"];
        assert!(
            (factor - 1.0).abs() < 1e-2 && offset.abs() < 1e-2,
            "{factor} {offset}"
        );
    }

    /// As robosuite writes the hands of Robotiq and Jaco: an equality fixes the length of a tendon.
    #[test]
    fn tendons_of_fixed_length_couple_their_joints() {
        let text = |ends: &str| {
            format!(
                "<mujoco><compiler angle=\"radian\"/><worldbody><body name=\"palm\"><body name=\"a\">\
             <joint name=\"first\" ref=\"1.1\" range=\"0 1.5\"/><body name=\"b\"><joint name=\"second\" ref=\"-0.5\" range=\"{ends}\"/>\
             </body></body></body></worldbody>\
             <tendon><fixed name=\"t\" stiffness=\"3\" springlength=\"0.2\"><joint joint=\"second\" coef=\"-0.4\"/>\
             <joint joint=\"first\" coef=\"0.4\"/></fixed></tendon><equality><tendon tendon1=\"t\"/></equality>\
             <actuator><motor joint=\"first\" ctrlrange=\"-2 1\" gear=\"5\"/></actuator></mujoco>"
            )
        };
        let (found, _) = read(&text("-2 2"));
        let (leader, factor, offset) = &found.mimics["second"];
        assert_eq!((leader.as_str(), *factor), ("first", 1.0));
        assert!((offset + 1.6).abs() < 1e-9, "{offset}");
        assert_eq!(found.efforts["first"], 10.0);
        assert!(found.is_passive("second") && !found.is_passive("first"));
        // The length where the file places the bodies is beyond these limits: the spring decides.
        let (found, _) = read(&text("0 2"));
        assert!(
            (found.mimics["second"].2 + 0.5).abs() < 1e-9,
            "{:?}",
            found.mimics
        );
    }
}
