//! A scene as quads: each object with its initial pose and its later displacement.

use oxigraph::model::{Literal, NamedNode};

use crate::RunRecord;
use crate::statements::{Statements, iri};
use actcheck_base::names;
use actcheck_data::{Role, Scene, SceneObject};
use actcheck_facts::thing_iri;

/// Local names of the terms for sensing errors, in the order of [`noise`].
pub const NOISE_TERMS: [&str; 13] = [
    "positionNoise",
    "heightNoise",
    "yawNoise",
    "sizeNoise",
    "localisationNoise",
    "headingNoise",
    "gripperNoise",
    "rangeNoise",
    "odometryDrift",
    "odometryHeadingDrift",
    "landmarkDistance",
    "landmarkNoise",
    "landmarkHeadingNoise",
];

/// Returns the sensing errors of a scene, most of them standard deviations, with the local names of
/// their terms. Units: those of the terms.
pub fn noise(scene: &Scene) -> [(&'static str, f64); 13] {
    let sensing = &scene.sensing;
    let odometry = &sensing.odometry;
    let values = [
        sensing.position_noise_m,
        sensing.height_noise_m,
        sensing.yaw_noise_rad,
        sensing.size_noise_m,
        sensing.localisation_noise_m,
        sensing.heading_noise_rad,
        sensing.gripper_noise_m,
        sensing.camera.range_noise_m,
        odometry.drift,
        odometry.heading_drift,
        odometry.landmark_every_m,
        odometry.landmark_noise_m,
        odometry.landmark_noise_rad,
    ];
    std::array::from_fn(|idx| (NOISE_TERMS[idx], values[idx]))
}

/// Writes the scene of a run: values of the whole scene on the run's node, and one node for each
/// object.
pub(super) fn write(record: &RunRecord, run: &NamedNode, statements: &mut Statements) {
    let scene = &record.scene;
    let standing = scene
        .objects
        .iter()
        .filter(|object| object.role != Role::Platform)
        .count();
    let mut about = statements.about(run.clone());
    about
        .text("act:worldName", &scene.world)
        .text("act:robot", &scene.robot.profile.name)
        .has("act:objectCount", Literal::from(standing as u64));
    for (property, value) in ["w:baseX", "w:baseY", "w:baseYaw"]
        .into_iter()
        .zip(scene.robot.base)
    {
        about.has(property, Literal::from(value));
    }
    for (name, value) in noise(scene) {
        about.has(&format!("act:{name}"), Literal::from(value));
    }
    for object in &scene.objects {
        write_object(record, object, run, statements);
    }
}

fn write_object(
    record: &RunRecord,
    object: &SceneObject,
    run: &NamedNode,
    statements: &mut Statements,
) {
    let thing = thing_iri(&object.id);
    let node = NamedNode::new_unchecked(format!("{}/scene/{}", run.as_str(), names::local(&thing)));
    let extremes = || {
        record
            .trace
            .actions
            .iter()
            .flat_map(|action| &action.extremes)
            .filter(|extremes| extremes.id == object.id)
    };
    let targets = |other: &SceneObject| other.role == Role::Target;
    let [x, y, z] = object.pose.position;
    let mut about = statements.about(node);
    about
        .is_a("act:SceneObject")
        .has("act:ofRun", run.clone())
        .has("act:object", iri(&thing))
        .has("act:category", iri(&object.model.category))
        .text("act:model", &object.model.name)
        .text("act:role", object.role.word());
    for (property, value) in [
        ("w:x", x),
        ("w:y", y),
        ("w:z", z),
        ("w:yaw", object.pose.yaw()),
        ("w:mass", object.mass_kg),
        ("w:friction", object.friction),
        ("w:restitution", object.restitution),
        (
            "act:robotDistance",
            libm::hypot(x - scene_base(record)[0], y - scene_base(record)[1]),
        ),
    ] {
        about.has(property, Literal::from(value));
    }
    about.optional(
        "act:neighbourDistance",
        nearest(&record.scene, object, |other| other.role != Role::Platform),
    );
    if object.role != Role::Platform && object.role != Role::Target {
        about.optional(
            "act:targetDistance",
            nearest(&record.scene, object, targets),
        );
    }
    about
        .optional(
            "act:displacement",
            largest(extremes().map(|extremes| extremes.max_displacement_m)),
        )
        .optional(
            "act:maxTilt",
            largest(extremes().map(|extremes| extremes.max_tilt_rad)),
        );
}

fn scene_base(record: &RunRecord) -> [f64; 3] {
    record.scene.robot.base
}

/// Horizontal distance from an object to the nearest other object that satisfies `among`.
fn nearest(
    scene: &Scene,
    object: &SceneObject,
    among: impl Fn(&SceneObject) -> bool,
) -> Option<Literal> {
    let [x, y, _] = object.pose.position;
    scene
        .objects
        .iter()
        .filter(|other| other.id != object.id && among(other))
        .map(|other| libm::hypot(other.pose.position[0] - x, other.pose.position[1] - y))
        .min_by(f64::total_cmp)
        .map(Literal::from)
}

fn largest(values: impl Iterator<Item = f64>) -> Option<Literal> {
    values.max_by(f64::total_cmp).map(Literal::from)
}
