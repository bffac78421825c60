//! A run as a model in MJCF, as MuJoCo loads it.
//!
//! The model is in the state of the run's first frame as it is loaded: joints have their position
//! there as `ref`. Masses, inertias and shapes are those that were simulated. The actuators have
//! the constants of the motors: their control is a setpoint plus its velocity times damping over
//! stiffness. Frictions are approximated: the friction of a pair is the geometric
//! mean of both in pairs of fingers or furniture with objects, which are listed, and the larger of
//! both elsewhere.

use nalgebra::{Isometry3, Vector3};
use quick_xml::Writer;
use quick_xml::events::{BytesEnd, BytesStart, BytesText, Event};

use actcheck_data::{Part, Pose, Scene, SceneObject, Shape};
use actcheck_world::{GRAVITY, Joint, JointKind, Playback, PlayedObject, Robot, has_volume};

/// Steps of MuJoCo in a control tick. With half as many, things slip out of a hand that drives: its
/// contacts creep by an amount that depends on the step.
const STEPS_PER_TICK: f64 = 8.0;
/// Mass and inertia of links without any, which MuJoCo refuses. Units: kilograms and kg·m².
const LEAST_KG: f64 = 1e-4;
const LEAST_KG_M2: f64 = 1e-7;
/// Parameters of MuJoCo for the contacts of soft pads: half of its time constant, and nearly rigid.
const PAD_SOLREF: &str = "0.0085 1";
const PAD_SOLIMP: &str = "0.97 0.995 0.001 0.5 2";
/// Parameters for couplings, which are gears.
const GEAR_SOLREF: &str = "0.005 1";
/// Friction about the normal of a contact that has none here. MuJoCo needs some. Unit: metres.
const NO_TORSION_M: f64 = 1e-5;

/// Attributes of an element.
type Attributes = Vec<(&'static str, String)>;

/// Writes the model of a run.
pub(super) fn write(run: &str, robot: &Robot, scene: &Scene, playback: &Playback) -> String {
    let mut out = Document::new();
    out.open("mujoco", vec![("model", run.to_owned())]);
    out.leaf(
        "compiler",
        vec![
            ("angle", "radian".to_owned()),
            ("autolimits", "true".to_owned()),
            ("balanceinertia", "true".to_owned()),
        ],
    );
    out.leaf(
        "option",
        vec![
            ("timestep", text(playback.tick_secs / STEPS_PER_TICK)),
            ("gravity", format!("0 0 {}", text(-GRAVITY))),
            ("integrator", "implicitfast".to_owned()),
            ("cone", "elliptic".to_owned()),
            ("impratio", "10".to_owned()),
        ],
    );
    let bodies = Bodies {
        robot,
        scene,
        playback,
    };
    bodies.assets(&mut out);
    out.open("worldbody", Vec::new());
    out.leaf(
        "geom",
        vec![
            ("name", "floor".to_owned()),
            ("type", "plane".to_owned()),
            ("size", "20 20 1".to_owned()),
            ("friction", text(playback.surfaces.floor_friction)),
        ],
    );
    bodies.objects(&mut out);
    bodies.link(&mut out, 0);
    out.close("worldbody");
    bodies.contacts(&mut out);
    bodies.couplings(&mut out);
    bodies.actuators(&mut out);
    out.close("mujoco");
    out.finish()
}

/// The bodies of a run.
struct Bodies<'a> {
    robot: &'a Robot,
    scene: &'a Scene,
    playback: &'a Playback,
}

impl Bodies<'_> {
    /// Writes the hulls of all bodies, each under the name of its geom.
    fn assets(&self, out: &mut Document) {
        out.open("asset", Vec::new());
        for (idx, link) in self.robot.model.links.iter().enumerate() {
            let name = self.link_name(idx);
            hulls(out, &name, &solids(&link.solids));
        }
        for object in &self.scene.objects {
            hulls(out, &object.id, &object.model.solids());
        }
        out.close("asset");
    }

    /// Writes the objects that are not parts of others.
    fn objects(&self, out: &mut Document) {
        for (idx, object) in self.scene.objects.iter().enumerate() {
            if object.attached.is_none() {
                self.object(out, idx, None);
            }
        }
    }

    /// Writes an object with the parts that it carries.
    fn object(&self, out: &mut Document, idx: usize, carrier: Option<&PlayedObject>) {
        let (object, played) = (&self.scene.objects[idx], &self.playback.objects[idx]);
        let pose = match carrier {
            Some(carrier) => Pose::from_isometry(
                &(carrier.pose.to_isometry().inverse() * played.pose.to_isometry()),
            ),
            None => played.pose,
        };
        out.open("body", with_pose(vec![("name", object.id.clone())], &pose));
        match &object.attached {
            Some(_) => part_joint(out, object, played),
            None if played.inertia.is_some() => {
                out.leaf("freejoint", vec![("name", object.id.clone())]);
            }
            None => {}
        }
        if let Some(inertia) = &played.inertia {
            let mass = ("mass", text(inertia.mass_kg));
            let moments = ("diaginertia", texts(inertia.moments));
            out.leaf("inertial", with_pose(vec![mass, moments], &inertia.frame));
        }
        for (number, solid) in object.model.solids().iter().enumerate() {
            let mut attributes = vec![("friction", text(object.friction))];
            if is_round(&solid.shape) && played.inertia.is_some() {
                let rolling = self.playback.surfaces.rolling_lever_m;
                let all = [object.friction, NO_TORSION_M, rolling];
                attributes = vec![("friction", texts(all)), ("condim", "6".to_owned())];
            }
            geom(out, &object.id, number, solid, attributes);
        }
        for (part, carried) in self.scene.objects.iter().enumerate() {
            let by_this = carried
                .attached
                .as_ref()
                .is_some_and(|by| by.to == object.id);
            if by_this {
                self.object(out, part, Some(played));
            }
        }
        out.close("body");
    }

    /// Writes a link of the robot with those that it carries.
    fn link(&self, out: &mut Document, idx: usize) {
        let (model, pose) = (&self.robot.model, self.playback.links[idx].to_isometry());
        let joint = idx
            .checked_sub(1)
            .map(|joint| (joint, &model.joints[joint]));
        let local = match joint {
            Some((_, joint)) => self.playback.links[joint.parent].to_isometry().inverse() * pose,
            None => pose,
        };
        let mut attributes = with_pose(
            vec![("name", self.link_name(idx))],
            &Pose::from_isometry(&local),
        );
        if joint.is_some() {
            attributes.push(("gravcomp", "1".to_owned()));
        }
        out.open("body", attributes);
        let link = &model.links[idx];
        if let Some((number, joint)) = joint {
            self.joint(out, number, joint);
            out.leaf("inertial", inertial(link.mass, &link.com, &link.inertia));
        }
        let friction = text(self.playback.link_friction[idx]);
        for (number, solid) in solids(&link.solids).iter().enumerate() {
            geom(
                out,
                &self.link_name(idx),
                number,
                solid,
                vec![("friction", friction.clone())],
            );
        }
        let (grasp, at) = &self.robot.named.grasp;
        if *grasp == idx {
            out.leaf(
                "site",
                with_pose(
                    vec![("name", "robot/grasp".to_owned())],
                    &Pose::from_isometry(at),
                ),
            );
        }
        for (number, child) in model.joints.iter().enumerate() {
            if child.parent == idx {
                self.link(out, number + 1);
            }
        }
        out.close("body");
    }

    fn joint(&self, out: &mut Document, idx: usize, joint: &Joint) {
        let motor = &self.playback.motors[idx];
        let kind = match joint.kind {
            JointKind::Prismatic => "slide",
            JointKind::Revolute => "hinge",
        };
        let mut attributes = vec![
            ("name", joint_name(joint)),
            ("type", kind.to_owned()),
            ("axis", texts(joint.axis.into_inner().into())),
            ("ref", text(self.playback.start[idx])),
            ("damping", text(joint.damping)),
            ("armature", text(motor.armature)),
        ];
        if joint.lower.is_finite() && joint.upper.is_finite() && joint.lower < joint.upper {
            attributes.push((
                "range",
                format!("{} {}", text(joint.lower), text(joint.upper)),
            ));
        }
        out.leaf("joint", attributes);
    }

    /// Writes which bodies pass through each other, and the pairs whose friction is the geometric
    /// mean of both.
    fn contacts(&self, out: &mut Document) {
        let playback = self.playback;
        out.open("contact", Vec::new());
        let exclude = |out: &mut Document, first: &str, second: &str| {
            let pair = vec![("body1", first.to_owned()), ("body2", second.to_owned())];
            out.leaf("exclude", pair);
        };
        let links = &self.robot.model.links;
        let solid: Vec<usize> = (0..links.len())
            .filter(|idx| !links[*idx].solids.is_empty())
            .collect();
        for first in &solid {
            for second in solid.iter().filter(|second| *second > first) {
                if !playback.link_pairs.contains(&(*first, *second)) {
                    exclude(out, &self.link_name(*first), &self.link_name(*second));
                }
            }
            if playback.off_floor[*first] && *first > 0 {
                exclude(out, "world", &self.link_name(*first));
            }
        }
        for (object, carrier) in self.wholes() {
            exclude(out, carrier, object);
        }
        for (idx, object) in self.scene.objects.iter().enumerate() {
            if playback.objects[idx].inertia.is_some() {
                self.pairs(out, object);
            }
        }
        out.close("contact");
    }

    /// The parts of each whole, by pairs: nothing collides within a whole.
    fn wholes(&self) -> Vec<(&str, &str)> {
        let whole = |object: &'_ SceneObject| match &object.attached {
            Some(attached) => attached.whole.clone(),
            None => object.id.clone(),
        };
        let objects = &self.scene.objects;
        let mut found = Vec::new();
        for (idx, one) in objects.iter().enumerate() {
            for other in objects
                .iter()
                .skip(idx + 1)
                .filter(|other| other.attached.is_some() || one.attached.is_some())
            {
                if whole(one) == whole(other) {
                    found.push((other.id.as_str(), one.id.as_str()));
                }
            }
        }
        found
    }

    /// Writes the pairs of an object that moves with the floor, furniture and the fingers.
    fn pairs(&self, out: &mut Document, object: &SceneObject) {
        let (playback, surfaces) = (self.playback, &self.playback.surfaces);
        let own = object.model.solids();
        let mean = |friction: f64| (friction * object.friction).sqrt();
        let mut all: Vec<(String, f64, bool)> =
            vec![("floor".to_owned(), surfaces.floor_friction, false)];
        for (other, played) in self.scene.objects.iter().zip(&playback.objects) {
            let is_own = object
                .attached
                .as_ref()
                .is_some_and(|by| by.whole == other.id);
            if played.inertia.is_none() && !is_own {
                let names = named(&other.id, &other.model.solids());
                all.extend(names.into_iter().map(|name| (name, other.friction, false)));
            }
        }
        for (idx, link) in self.robot.model.links.iter().enumerate() {
            if playback.pads[idx] {
                let names = named(&self.link_name(idx), &solids(&link.solids));
                all.extend(
                    names
                        .into_iter()
                        .map(|name| (name, playback.link_friction[idx], true)),
                );
            }
        }
        for (number, solid) in own
            .iter()
            .enumerate()
            .filter(|(_, solid)| has_volume(solid))
        {
            for (name, friction, is_pad) in &all {
                let slides = mean(*friction);
                let (condim, torsion, rolling) = match (*is_pad, is_round(&solid.shape)) {
                    (true, _) => ("4", slides * surfaces.pad_lever_m, 0.0),
                    (false, true) => ("6", NO_TORSION_M, surfaces.rolling_lever_m),
                    (false, false) => ("3", NO_TORSION_M, 0.0),
                };
                let frictions = [slides, slides, torsion, rolling, rolling];
                let mut attributes = vec![
                    ("geom1", name.clone()),
                    ("geom2", geom_name(&object.id, number)),
                    ("condim", condim.to_owned()),
                    ("friction", frictions.map(text).join(" ")),
                ];
                if *is_pad {
                    attributes.push(("solref", PAD_SOLREF.to_owned()));
                    attributes.push(("solimp", PAD_SOLIMP.to_owned()));
                }
                out.leaf("pair", attributes);
            }
        }
    }

    /// Writes the joints that follow others. MuJoCo counts both from their positions as loaded.
    fn couplings(&self, out: &mut Document) {
        out.open("equality", Vec::new());
        let joints = &self.robot.model.joints;
        for joint in joints {
            if let Some((leader, factor, _)) = joint.mimic {
                out.leaf(
                    "joint",
                    vec![
                        ("joint1", joint_name(joint)),
                        ("joint2", joint_name(&joints[leader])),
                        ("polycoef", format!("0 {} 0 0 0", text(factor))),
                        ("solref", GEAR_SOLREF.to_owned()),
                    ],
                );
            }
        }
        out.close("equality");
    }

    /// Writes a motor for each joint that has one, in the order of the joints.
    fn actuators(&self, out: &mut Document) {
        out.open("actuator", Vec::new());
        for (idx, joint) in self.robot.model.joints.iter().enumerate() {
            let motor = &self.playback.motors[idx];
            // The limits of the first tick: those of fingers change with the commands.
            let limit = self
                .playback
                .ticks
                .first()
                .map_or(joint.effort, |tick| tick[idx].limit);
            if joint.mimic.is_some() && limit <= 0.0 {
                continue;
            }
            let largest = limit.max(joint.effort).max(f64::MIN_POSITIVE);
            out.leaf(
                "general",
                vec![
                    ("name", joint_name(joint)),
                    ("joint", joint_name(joint)),
                    ("biastype", "affine".to_owned()),
                    ("gainprm", text(motor.stiffness)),
                    (
                        "biasprm",
                        format!("0 {} {}", text(-motor.stiffness), text(-motor.damping)),
                    ),
                    (
                        "forcerange",
                        format!("{} {}", text(-largest), text(largest)),
                    ),
                ],
            );
        }
        out.close("actuator");
    }

    fn link_name(&self, idx: usize) -> String {
        format!("robot/{}", self.robot.model.links[idx].name)
    }
}

fn joint_name(joint: &Joint) -> String {
    format!("robot/{}", joint.name)
}

/// Writes the joint of a part of another object. Frame of its axis: the part's.
fn part_joint(out: &mut Document, object: &SceneObject, played: &PlayedObject) {
    let Some(attached) = &object.attached else {
        return;
    };
    let joint = &attached.joint;
    let on_part: Isometry3<f64> =
        object.pose.to_isometry().inverse() * attached.frame.to_isometry();
    let axis = on_part.rotation * Vector3::from(joint.axis);
    let anchor = on_part * nalgebra::Point3::from(joint.anchor_m);
    let mut attributes = vec![
        ("name", object.id.clone()),
        (
            "type",
            if joint.slides { "slide" } else { "hinge" }.to_owned(),
        ),
        ("axis", texts(axis.into())),
        ("pos", texts(anchor.coords.into())),
        ("ref", text(played.joint_position.unwrap_or(0.0))),
        ("damping", text(joint.damping)),
        ("frictionloss", text(joint.friction)),
    ];
    if joint.range.iter().all(|end| end.is_finite()) && joint.range[0] < joint.range[1] {
        attributes.push(("range", joint.range.map(text).join(" ")));
    }
    out.leaf("joint", attributes);
}

fn inertial(mass: f64, com: &Vector3<f64>, tensor: &nalgebra::Matrix3<f64>) -> Attributes {
    // A virtual link of a base has no mass. The least inertia is small beside those of real links.
    let least = if tensor.diagonal().min() < LEAST_KG_M2 {
        LEAST_KG_M2
    } else {
        0.0
    };
    let t = tensor + nalgebra::Matrix3::identity() * least;
    let six = [t.m11, t.m22, t.m33, t.m12, t.m13, t.m23];
    vec![
        ("pos", texts((*com).into())),
        ("mass", text(mass.max(LEAST_KG))),
        ("fullinertia", six.map(text).join(" ")),
    ]
}

/// The convex solids of shapes.
fn solids(parts: &[Part]) -> Vec<Part> {
    parts.iter().flat_map(Part::solids).collect()
}

/// Whether a solid rolls, or may: hulls have corners, but many of them.
fn is_round(shape: &Shape) -> bool {
    !matches!(shape, Shape::Box { .. })
}

fn geom_name(body: &str, number: usize) -> String {
    format!("{body}/{number}")
}

/// Names of the geoms of a body's solids.
fn named(body: &str, solids: &[Part]) -> Vec<String> {
    let numbered = solids
        .iter()
        .enumerate()
        .filter(|(_, solid)| has_volume(solid));
    numbered
        .map(|(number, _)| geom_name(body, number))
        .collect()
}

/// Writes the points of a body's hulls.
fn hulls(out: &mut Document, body: &str, solids: &[Part]) {
    for (number, solid) in solids.iter().enumerate() {
        if let Some(points) = corners(&solid.shape)
            && has_volume(solid)
        {
            let vertices: Vec<String> = points.iter().flatten().copied().map(text).collect();
            out.leaf(
                "mesh",
                vec![
                    ("name", geom_name(body, number)),
                    ("inertia", "shell".to_owned()),
                    ("vertex", vertices.join(" ")),
                ],
            );
        }
    }
}

/// The corners of a hull; `None` for other shapes.
fn corners(shape: &Shape) -> Option<&[[f64; 3]]> {
    match shape {
        Shape::Hull { points, .. } => Some(points),
        Shape::Mesh { mesh } => Some(&mesh.vertices),
        _ => None,
    }
}

fn geom(out: &mut Document, body: &str, number: usize, solid: &Part, more: Attributes) {
    if !has_volume(solid) {
        return;
    }
    let name = geom_name(body, number);
    let own = match &solid.shape {
        Shape::Box { size } => ("box", ("size", texts(size.map(|x| x / 2.0)))),
        Shape::Cylinder { radius, height } => (
            "cylinder",
            ("size", format!("{} {}", text(*radius), text(height / 2.0))),
        ),
        Shape::Sphere { radius } => ("sphere", ("size", text(*radius))),
        Shape::Capsule { radius, height } => (
            "capsule",
            ("size", format!("{} {}", text(*radius), text(height / 2.0))),
        ),
        Shape::Hull { .. } | Shape::Mesh { .. } | Shape::Tube { .. } => {
            ("mesh", ("mesh", name.clone()))
        }
    };
    let mut attributes = vec![("name", name), ("type", own.0.to_owned()), own.1];
    attributes.extend(more);
    out.leaf("geom", with_pose(attributes, &solid.pose));
}

fn with_pose(mut attributes: Attributes, pose: &Pose) -> Attributes {
    let [x, y, z, w] = pose.rotation;
    attributes.push(("pos", texts(pose.position)));
    attributes.push(("quat", [w, x, y, z].map(text).join(" ")));
    attributes
}

/// The shortest text that gives the same number.
fn text(value: f64) -> String {
    format!("{value}")
}

fn texts(values: [f64; 3]) -> String {
    values.map(text).join(" ")
}

/// An XML document as it is written.
struct Document {
    writer: Writer<Vec<u8>>,
}

impl Document {
    fn new() -> Self {
        Self {
            writer: Writer::new_with_indent(Vec::new(), b' ', 2),
        }
    }

    /// Writing to memory does not fail.
    fn event(&mut self, event: Event<'_>) {
        _ = self.writer.write_event(event);
    }

    fn open(&mut self, name: &'static str, attributes: Attributes) {
        let element = element(name, &attributes);
        self.event(Event::Start(element));
    }

    fn leaf(&mut self, name: &'static str, attributes: Attributes) {
        let element = element(name, &attributes);
        self.event(Event::Empty(element));
    }

    fn close(&mut self, name: &'static str) {
        self.event(Event::End(BytesEnd::new(name)));
    }

    fn finish(mut self) -> String {
        self.event(Event::Text(BytesText::new("\n")));
        String::from_utf8_lossy(&self.writer.into_inner()).into_owned()
    }
}

fn element(name: &'static str, attributes: &Attributes) -> BytesStart<'static> {
    let attributes = attributes
        .iter()
        .map(|(name, value)| (*name, value.as_str()));
    BytesStart::new(name)
        .with_attributes(attributes)
        .into_owned()
}
