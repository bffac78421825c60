//! Reads the state before or after an action.

use std::collections::{BTreeMap, BTreeSet};

use actcheck_base::{did_you_mean, names};
use actcheck_data::{
    BodyState, CupState, JointState, Location, NamedSurface, Part, Pose, RobotState, Room,
    SceneMap, Shape, Snapshot,
};
use actcheck_ontology::Ontology;

use crate::Value;
use crate::lacks::{ANGULAR, BASE, BELIEVED, BOUNDS, LIMITS, LINEAR, Lacks, ROTATION, SIZE};
use crate::reader::At;
use crate::shapes;

/// Contact forces below this are solver noise. Unit: newtons. As in our own simulation.
pub(crate) const CONTACT_FLOOR_NEWTONS: f64 = 0.05;
/// Share of a body's weight that a contact must carry for the body to rest on it. As in our own
/// simulation.
const CARRIED_SHARE: f64 = 0.1;
/// Unit: m/s².
const GRAVITY: f64 = 9.81;
/// A thing that fell this far below everything that is fixed has left the world. Unit: metres.
const FALL_M: f64 = 0.5;

/// A state with the facts that it lacks.
#[derive(Debug, Clone)]
pub(crate) struct State {
    pub(crate) snapshot: Snapshot,
    /// The known quantities of each body, in the order of the snapshot.
    pub(crate) known: Vec<Known>,
    /// The known quantities of the robot.
    pub(crate) robot: RobotKnown,
    pub(crate) map: SceneMap,
    /// The contacts; `None` if they are not given.
    pub(crate) contacts: Option<Vec<Touch>>,
    pub(crate) lacks: Lacks,
}

/// The known quantities of a body.
#[derive(Debug, Clone, Default)]
pub(crate) struct Known {
    /// Its shapes; empty if they are not known.
    pub(crate) parts: Vec<Part>,
    pub(crate) rotation: bool,
    pub(crate) velocities: [bool; 2],
    size: bool,
    bounds: bool,
    mass: bool,
    friction: bool,
    restitution: bool,
    asleep: bool,
    touches: bool,
    rests_on: bool,
    distance: bool,
    left_world: bool,
    class: bool,
}

/// The known quantities of the robot.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct RobotKnown {
    pub(crate) base: bool,
    pub(crate) believed: bool,
    pub(crate) gripper: bool,
    pub(crate) opening: bool,
    pub(crate) fingers: bool,
    pub(crate) joints: bool,
    pub(crate) joint_velocities: bool,
    pub(crate) joint_limits: bool,
    pub(crate) max_velocities: bool,
    max_efforts: bool,
}

/// The contact of two bodies, links, or the floor.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Touch {
    /// Ids of objects, `robot/LINK`, or `floor`; sorted.
    pub(crate) pair: [String; 2],
    /// Sum of the normal forces; `None` if it is unknown. Unit: newtons.
    pub(crate) force_n: Option<f64>,
    /// Upward force on the second of the pair; `None` if it is unknown. Unit: newtons.
    lift_n: Option<f64>,
    /// Position of the point with the largest force. Unit: metres. Frame: world.
    pub(crate) point_m: Option<[f64; 3]>,
    strongest_n: f64,
}

/// Reads a state. A state after an action has the constants of the state before it.
pub(crate) fn read(at: &At<'_>, before: Option<&State>, ontology: &Ontology) -> State {
    let table = at.table(&["bodies", "robot", "contacts", "map", "time"]);
    let mut state = State {
        snapshot: Snapshot {
            time_secs: table.get("time").and_then(|at| at.number()).unwrap_or(0.0),
            bodies: Vec::new(),
            robot: nowhere(),
        },
        known: Vec::new(),
        robot: RobotKnown::default(),
        map: SceneMap::default(),
        contacts: None,
        lacks: Lacks::default(),
    };
    if let Some(bodies) = table.required("bodies") {
        for (id, at) in bodies.named("bodies by their ids") {
            read_body(&mut state, id, &at, before, ontology);
        }
    }
    let fingers = table
        .get("robot")
        .filter(|at| !at.is_none())
        .map(|at| read_robot(&mut state, &at, before))
        .unwrap_or_default();
    state.contacts = table.get("contacts").map(|at| read_contacts(&at, &state));
    if let Some(contacts) = state.contacts.take() {
        apply_contacts(&mut state, &contacts, fingers.as_ref());
        state.contacts = Some(contacts);
    }
    match table.get("map") {
        Some(at) if !at.is_none() => state.map = read_map(&at),
        _ => {
            if let Some(before) = before {
                state.map = before.map.clone();
            }
        }
    }
    derive(&mut state);
    check_names(at, &state);
    note_missing(&mut state);
    state
}

const BODY: [&str; 18] = [
    "position",
    "rotation",
    "category",
    "fixed",
    "size",
    "shapes",
    "bounding_box",
    "mass",
    "friction",
    "restitution",
    "linear_velocity",
    "angular_velocity",
    "touches",
    "rests_on",
    "gripper_distance",
    "part",
    "asleep",
    "left_world",
];

fn read_body(
    state: &mut State,
    id: &str,
    at: &At<'_>,
    before: Option<&State>,
    ontology: &Ontology,
) {
    let is_reserved = ["", "robot", "floor", "gripper"].contains(&id)
        || ["robot/", "joint/"]
            .iter()
            .any(|prefix| id.starts_with(prefix));
    if is_reserved {
        at.fault("J007", "it can't be the id of a body", "choose another id");
        return;
    }
    let table = at.table(&BODY);
    let earlier = before.and_then(|before| {
        let idx = before
            .snapshot
            .bodies
            .iter()
            .position(|body| body.id == id)?;
        Some((&before.snapshot.bodies[idx], &before.known[idx]))
    });
    let mut known = Known::default();
    let mut body = unknown_body(id);
    if let Some((constant, constant_known)) = earlier {
        body.category.clone_from(&constant.category);
        body.model.clone_from(&constant.model);
        (body.fixed, body.size_m) = (constant.fixed, constant.size_m);
        (body.mass_kg, body.friction) = (constant.mass_kg, constant.friction);
        body.restitution = constant.restitution;
        known = Known {
            parts: constant_known.parts.clone(),
            size: constant_known.size,
            mass: constant_known.mass,
            friction: constant_known.friction,
            restitution: constant_known.restitution,
            class: constant_known.class,
            ..known
        };
    }
    if let Some(position) = table.required("position").and_then(|at| at.vector()) {
        body.pose.position = position;
    }
    known.rotation = set(&mut body.pose.rotation, table.get("rotation"), At::rotation);
    set(&mut body.fixed, table.get("fixed"), At::truth);
    known.class |= set(&mut body.category, table.get("category"), |at| {
        category(at, ontology)
    });
    known.mass |= set(&mut body.mass_kg, table.get("mass"), At::amount);
    known.friction |= set(&mut body.friction, table.get("friction"), At::amount);
    known.restitution |= set(&mut body.restitution, table.get("restitution"), At::amount);
    known.asleep = set(&mut body.asleep, table.get("asleep"), At::truth);
    known.left_world = set(&mut body.left_world, table.get("left_world"), At::truth);
    let still = body.fixed;
    known.velocities = [
        set(
            &mut body.linear_velocity,
            table.get("linear_velocity"),
            At::vector,
        ) || still,
        set(
            &mut body.angular_velocity,
            table.get("angular_velocity"),
            At::vector,
        ) || still,
    ];
    known.touches = set(&mut body.touches, table.get("touches"), |at| at.names());
    known.rests_on = set(&mut body.rests_on, table.get("rests_on"), |at| at.names()) || still;
    let shapes = table.get("shapes").and_then(|at| shapes::read(&at));
    let size: Option<[f64; 3]> = table.get("size").and_then(|at| at.vector());
    // A size without shapes is that of a box around the position.
    let boxed = size.map(|size| {
        vec![Part {
            pose: Pose::IDENTITY,
            shape: Shape::Box { size },
        }]
    });
    if let Some(parts) = shapes.or(boxed) {
        known.parts = parts;
    }
    if let Some(size) = size.or_else(|| shapes::size(&known.parts).filter(|_| !known.size)) {
        (body.size_m, known.size) = (size, true);
    }
    if let Some([low, high]) = table.get("bounding_box").and_then(|at| corners(&at)) {
        (body.aabb_min, body.aabb_max, known.bounds) = (low, high, true);
    }
    if let Some(at) = table.get("gripper_distance") {
        known.distance = true;
        body.grasp_distance_m = if at.is_none() { None } else { at.number() };
    }
    body.part = match table.get("part") {
        Some(at) if !at.is_none() => read_part(&at),
        _ => None,
    };
    state.snapshot.bodies.push(body);
    state.known.push(known);
}

/// Sets a slot to a value that is given. Returns whether it is.
fn set<'a, T>(slot: &mut T, at: Option<At<'a>>, read: impl FnOnce(&At<'a>) -> Option<T>) -> bool {
    let Some(at) = at else { return false };
    // A faulty value ends in an error.
    if let Some(value) = read(&at) {
        *slot = value;
    }
    true
}

/// Returns the IRI of a class of objects, which the ontology must have.
pub(crate) fn category(at: &At<'_>, ontology: &Ontology) -> Option<String> {
    let text = at.text()?;
    if names::is_iri(text) {
        return Some(text.to_owned());
    }
    let iri = names::act(text);
    if ontology.has_class(&iri) {
        return Some(iri);
    }
    let known: Vec<&str> = ontology
        .superclasses
        .iter()
        .filter(|(_, above)| above.contains(&names::act("Object")))
        .map(|(class, _)| names::local(class))
        .collect();
    let help = did_you_mean(text, known);
    at.fault("J007", "the ontology has no such category", &help);
    None
}

/// Reads the lowest and the highest corner of a box.
fn corners(at: &At<'_>) -> Option<[[f64; 3]; 2]> {
    let corners: Option<Vec<[f64; 3]>> = at.list("two corners").iter().map(At::vector).collect();
    let found: Option<[[f64; 3]; 2]> = corners?.try_into().ok();
    match found {
        Some([low, high]) if (0..3).all(|axis| low[axis] <= high[axis]) => Some([low, high]),
        _ => {
            at.fault("J002", "it must be the lowest and the highest corner", "");
            None
        }
    }
}

/// Reads the whole and the joint's position of a part.
fn read_part(at: &At<'_>) -> Option<(String, f64)> {
    let table = at.table(&["of", "position"]);
    let whole = table.required("of").and_then(|at| at.text());
    let position = table.required("position").and_then(|at| at.number());
    Some((whole?.to_owned(), position?))
}

fn unknown_body(id: &str) -> BodyState {
    BodyState {
        id: id.to_owned(),
        model: id.to_owned(),
        category: String::new(),
        fixed: false,
        pose: Pose::IDENTITY,
        linear_velocity: [0.0; 3],
        angular_velocity: [0.0; 3],
        aabb_min: [0.0; 3],
        aabb_max: [0.0; 3],
        mass_kg: 0.0,
        friction: 0.0,
        restitution: 0.0,
        touches: Vec::new(),
        rests_on: Vec::new(),
        asleep: false,
        size_m: [0.0; 3],
        grasp_distance_m: None,
        part: None,
        left_world: false,
    }
}

fn nowhere() -> RobotState {
    RobotState {
        base_true: [0.0; 3],
        base_believed: [0.0; 3],
        joints: Vec::new(),
        gripper: Pose::IDENTITY,
        gripper_opening_m: 0.0,
        left_touches: Vec::new(),
        right_touches: Vec::new(),
        links: Vec::new(),
        cup: None,
    }
}

/// The links of the fingers, left and right, as contacts name them.
type Fingers = [BTreeSet<String>; 2];

fn read_robot(state: &mut State, at: &At<'_>, before: Option<&State>) -> Option<Fingers> {
    let table = at.table(&[
        "base",
        "believed_base",
        "gripper",
        "opening",
        "fingers",
        "left_touches",
        "right_touches",
        "joints",
        "cup",
    ]);
    let robot = &mut state.snapshot.robot;
    let known = &mut state.robot;
    known.base = set(&mut robot.base_true, table.get("base"), At::vector);
    known.believed = set(
        &mut robot.base_believed,
        table.get("believed_base"),
        At::vector,
    );
    known.gripper = set(&mut robot.gripper, table.get("gripper"), read_pose);
    known.opening = set(
        &mut robot.gripper_opening_m,
        table.get("opening"),
        At::number,
    );
    let left = set(&mut robot.left_touches, table.get("left_touches"), |at| {
        at.names()
    });
    let right = set(&mut robot.right_touches, table.get("right_touches"), |at| {
        at.names()
    });
    known.fingers = left && right;
    if let Some(at) = table.get("cup").filter(|at| !at.is_none()) {
        let table = at.table(&["force", "pull"]);
        let force = table.required("force").and_then(|at| at.amount());
        let pull = table.required("pull").and_then(|at| at.number());
        if let (Some(force_n), Some(pull_n)) = (force, pull) {
            robot.cup = Some(CupState { force_n, pull_n });
        }
    }
    if let Some(joints) = table.get("joints") {
        let earlier = before.map_or(&[] as &[JointState], |before| &before.snapshot.robot.joints);
        read_joints(
            robot,
            known,
            &joints,
            earlier,
            before.map(|before| before.robot),
        );
    }
    let fingers = table.get("fingers").filter(|at| !at.is_none())?;
    let table = fingers.table(&["left", "right"]);
    let links = |key| {
        let links = table.required(key).and_then(|at| at.names());
        BTreeSet::from_iter(links.unwrap_or_default())
    };
    Some([links("left"), links("right")])
}

pub(crate) fn read_pose(at: &At<'_>) -> Option<Pose> {
    let table = at.table(&["position", "rotation"]);
    let position = table.required("position").and_then(|at| at.vector());
    let rotation = table.required("rotation").and_then(|at| at.rotation());
    Some(Pose {
        position: position?,
        rotation: rotation?,
    })
}

fn read_joints(
    robot: &mut RobotState,
    known: &mut RobotKnown,
    at: &At<'_>,
    earlier: &[JointState],
    earlier_known: Option<RobotKnown>,
) {
    let constants = earlier_known.unwrap_or_default();
    *known = RobotKnown {
        joints: true,
        joint_velocities: true,
        joint_limits: true,
        max_velocities: true,
        max_efforts: true,
        ..*known
    };
    for (name, at) in at.named("joints by their names") {
        let table = at.table(&[
            "position",
            "velocity",
            "limits",
            "max_velocity",
            "max_effort",
        ]);
        let constant = earlier.iter().find(|joint| joint.name == name);
        let mut joint = constant.cloned().unwrap_or_else(|| JointState {
            name: name.to_owned(),
            position: 0.0,
            velocity: 0.0,
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
            max_velocity: f64::INFINITY,
            max_effort: f64::INFINITY,
        });
        if let Some(position) = table.required("position").and_then(|at| at.number()) {
            joint.position = position;
        }
        known.joint_velocities &= set(&mut joint.velocity, table.get("velocity"), At::number);
        let mut limits = [joint.lower, joint.upper];
        let is_inherited = |known: bool| known && constant.is_some();
        known.joint_limits &= set(&mut limits, table.get("limits"), read_limits)
            || is_inherited(constants.joint_limits);
        [joint.lower, joint.upper] = limits;
        let unlimited = |at: &At<'_>| at.limit(f64::INFINITY);
        known.max_velocities &= set(
            &mut joint.max_velocity,
            table.get("max_velocity"),
            unlimited,
        ) || is_inherited(constants.max_velocities);
        known.max_efforts &= set(&mut joint.max_effort, table.get("max_effort"), unlimited)
            || is_inherited(constants.max_efforts);
        robot.joints.push(joint);
    }
}

/// Reads the limits of a position; `None` for a joint without limits.
fn read_limits(at: &At<'_>) -> Option<[f64; 2]> {
    match at.value() {
        Value::Null => Some([f64::NEG_INFINITY, f64::INFINITY]),
        Value::Numbers(numbers) => match numbers.as_slice() {
            [lower, upper] if lower <= upper => Some([*lower, *upper]),
            _ => {
                at.fault("J002", "it must be the lower and the upper limit", "");
                None
            }
        },
        _ => {
            at.wrong("the lower and the upper limit, or None");
            None
        }
    }
}

/// Reads contacts, and joins those of a pair.
fn read_contacts(at: &At<'_>, state: &State) -> Vec<Touch> {
    let mut touches: BTreeMap<[String; 2], Touch> = BTreeMap::new();
    for at in at.list("contacts") {
        let table = at.table(&["bodies", "force", "force_on_second", "point"]);
        let force = table.get("force").and_then(|at| at.number()).map(f64::abs);
        let on_second: Option<[f64; 3]> = table.get("force_on_second").and_then(|at| at.vector());
        let point = table.get("point").and_then(|at| at.vector());
        let Some(bodies) = table.required("bodies") else {
            continue;
        };
        let listed = bodies.list("names");
        let (Some(pair), [first, ..]) = (bodies.pair(), listed.as_slice()) else {
            continue;
        };
        for name in &pair {
            if !name.starts_with("robot/") && !state.is_thing(name) {
                unknown_thing(&bodies, name, state);
            }
        }
        let turned = first.text() != Some(pair[0].as_str());
        let lift = on_second.map(|force| if turned { -force[2] } else { force[2] });
        let touch = touches.entry(pair.clone()).or_insert_with(|| Touch {
            pair,
            force_n: Some(0.0),
            lift_n: Some(0.0),
            point_m: point,
            strongest_n: 0.0,
        });
        touch.force_n = touch.force_n.zip(force).map(|(sum, force)| sum + force);
        touch.lift_n = touch.lift_n.zip(lift).map(|(sum, lift)| sum + lift);
        if force.unwrap_or(0.0) >= touch.strongest_n {
            touch.strongest_n = force.unwrap_or(0.0);
            touch.point_m = point;
        }
    }
    touches
        .into_values()
        .filter(|touch| {
            touch
                .force_n
                .is_none_or(|force| force >= CONTACT_FLOOR_NEWTONS)
        })
        .collect()
}

/// Derives from the contacts which bodies touch and which carry each other.
fn apply_contacts(state: &mut State, contacts: &[Touch], fingers: Option<&Fingers>) {
    let whole = |name: &str| match name.starts_with("robot/") {
        true => "robot".to_owned(),
        false => name.to_owned(),
    };
    let lifts_known = contacts.iter().all(|touch| touch.lift_n.is_some());
    for (body, known) in state.snapshot.bodies.iter_mut().zip(&mut state.known) {
        let enough = CARRIED_SHARE * body.mass_kg * GRAVITY;
        let (mut touching, mut carriers) = (BTreeSet::new(), BTreeSet::new());
        for touch in contacts {
            let lift = touch.lift_n.unwrap_or(0.0);
            let (other, lift) = match &touch.pair {
                [other, own] if *own == body.id => (other, lift),
                [own, other] if *own == body.id => (other, -lift),
                _ => continue,
            };
            if lift > enough {
                carriers.insert(whole(other));
            }
            touching.insert(whole(other));
        }
        if !known.touches {
            (body.touches, known.touches) = (touching.into_iter().collect(), true);
        }
        if !known.rests_on && lifts_known && known.mass {
            carriers.extend(body.part.iter().map(|(whole, _)| whole.clone()));
            (body.rests_on, known.rests_on) = (carriers.into_iter().collect(), true);
        }
    }
    if let Some([left, right]) = fingers
        && !state.robot.fingers
    {
        let touched = |links: &BTreeSet<String>| -> Vec<String> {
            let things = contacts.iter().filter_map(|touch| match &touch.pair {
                [link, thing] | [thing, link]
                    if links.contains(link) && !thing.starts_with("robot/") =>
                {
                    Some(thing.clone())
                }
                _ => None,
            });
            things.collect::<BTreeSet<String>>().into_iter().collect()
        };
        let robot = &mut state.snapshot.robot;
        (robot.left_touches, robot.right_touches) = (touched(left), touched(right));
        state.robot.fingers = true;
    }
}

fn read_map(at: &At<'_>) -> SceneMap {
    let table = at.table(&["locations", "rooms", "surfaces"]);
    let mut map = SceneMap::default();
    for at in table
        .get("locations")
        .iter()
        .flat_map(|at| at.list("locations"))
    {
        let table = at.table(&["name", "at", "surface"]);
        let name = table.required("name").and_then(|at| at.text());
        let place = table.required("at").and_then(|at| at.vector());
        let surface = table.get("surface").filter(|at| !at.is_none());
        if let (Some(name), Some(at)) = (name, place) {
            map.locations.push(Location {
                name: name.to_owned(),
                at,
                surface: surface.and_then(|at| at.text()).map(str::to_owned),
            });
        }
    }
    for at in table.get("rooms").iter().flat_map(|at| at.list("rooms")) {
        let table = at.table(&["name", "low", "high"]);
        let name = table.required("name").and_then(|at| at.text());
        let low = table.required("low").and_then(|at| at.vector());
        let high = table.required("high").and_then(|at| at.vector());
        if let (Some(name), Some(low_m), Some(high_m)) = (name, low, high) {
            map.rooms.push(Room {
                name: name.to_owned(),
                low_m,
                high_m,
            });
        }
    }
    for at in table
        .get("surfaces")
        .iter()
        .flat_map(|at| at.list("surfaces"))
    {
        let table = at.table(&["id", "at", "size"]);
        let id = table.required("id").and_then(|at| at.text());
        let place = table.required("at").and_then(|at| at.vector());
        let size = table.required("size").and_then(|at| at.vector());
        if let (Some(id), Some(at), Some(size_m)) = (id, place, size) {
            map.surfaces.push(NamedSurface {
                id: id.to_owned(),
                at,
                size_m,
            });
        }
    }
    map
}

/// Derives the quantities that follow exactly from the given ones.
fn derive(state: &mut State) {
    let robot = state.robot;
    let hand = state.snapshot.robot.gripper.position;
    for (body, known) in state.snapshot.bodies.iter_mut().zip(&mut state.known) {
        let is_placed = known.rotation && !known.parts.is_empty();
        if !known.bounds
            && is_placed
            && let Some([low, high]) = shapes::bounds(&known.parts, &body.pose)
        {
            (body.aabb_min, body.aabb_max, known.bounds) = (low, high, true);
        }
        if body.fixed {
            known.distance = true;
        } else if !known.distance && is_placed && robot.gripper {
            body.grasp_distance_m = shapes::distance(&known.parts, &body.pose, hand);
            known.distance = body.grasp_distance_m.is_some();
        }
    }
    // A thing is in the world while it is not far below everything that is fixed.
    if state.known.iter().all(|known| known.bounds) {
        let fixed = state.snapshot.bodies.iter().filter(|body| body.fixed);
        let lowest = fixed.map(|body| body.aabb_min[2]).fold(0.0, f64::min) - FALL_M;
        for (body, known) in state.snapshot.bodies.iter_mut().zip(&mut state.known) {
            if !known.left_world {
                body.left_world = !body.fixed && body.aabb_max[2] < lowest;
                known.left_world = true;
            }
        }
    }
}

/// Reports names of bodies that the state does not have.
fn check_names(at: &At<'_>, state: &State) {
    let robot = &state.snapshot.robot;
    let of_bodies = state.snapshot.bodies.iter().flat_map(|body| {
        let whole = body.part.iter().map(|(whole, _)| whole);
        body.touches.iter().chain(&body.rests_on).chain(whole)
    });
    let names = of_bodies
        .chain(&robot.left_touches)
        .chain(&robot.right_touches);
    let unknown: BTreeSet<&String> = names.filter(|name| !state.is_thing(name)).collect();
    for name in unknown {
        unknown_thing(at, name, state);
    }
}

fn unknown_thing(at: &At<'_>, name: &str, state: &State) {
    let known = state.snapshot.bodies.iter().map(|body| body.id.as_str());
    let known = known.chain(["robot", "floor"]);
    let help = did_you_mean(name, known.collect::<Vec<&str>>());
    at.fault("J007", &format!("no body has the id `{name}`"), &help);
}

impl State {
    /// Whether a name is that of a body, the robot or the floor.
    pub(crate) fn is_thing(&self, name: &str) -> bool {
        ["robot", "floor"].contains(&name)
            || self.snapshot.bodies.iter().any(|body| body.id == name)
    }

    /// Returns the ids of the objects that both fingers touch.
    pub(crate) fn held(&self) -> impl Iterator<Item = &String> {
        let robot = &self.snapshot.robot;
        let left = robot.left_touches.iter();
        left.filter(|id| robot.right_touches.contains(id))
    }
}

/// Notes the facts that are not known.
fn note_missing(state: &mut State) {
    let lacks = &mut state.lacks;
    let mut miss = |is_known: bool, facts: &[&str]| {
        if !is_known {
            lacks.add(facts);
        }
    };
    for (body, known) in state.snapshot.bodies.iter().zip(&state.known) {
        miss(known.rotation, ROTATION);
        miss(known.bounds, BOUNDS);
        miss(known.size, SIZE);
        miss(known.mass, &["mass"]);
        miss(known.friction, &["friction"]);
        miss(known.restitution, &["restitution"]);
        miss(known.asleep, &["asleep"]);
        miss(known.velocities[0] || body.asleep, LINEAR);
        miss(known.velocities[1] || body.asleep, ANGULAR);
        miss(known.touches, &["touches"]);
        miss(known.rests_on, &["restsOn"]);
        miss(known.distance, &["gripperDistance"]);
        miss(known.left_world, &["leftWorld"]);
    }
    let robot = state.robot;
    miss(robot.base, BASE);
    miss(robot.believed, BELIEVED);
    miss(robot.gripper, &["gripper"]);
    miss(robot.opening, &["opening"]);
    miss(robot.fingers, &["leftTouches", "rightTouches"]);
    miss(robot.joints, &["position"]);
    miss(robot.joint_velocities, &["velocity"]);
    miss(robot.joint_limits, LIMITS);
    miss(robot.max_velocities, &["maxVelocity"]);
    miss(robot.max_efforts, &["maxEffort"]);
    state.lacks.classes = state.known.iter().any(|known| !known.class);
}
