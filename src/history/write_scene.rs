//! A scene as statements: each object with its initial pose and its later displacement.

use oxigraph::model::NamedNode;

use crate::ObjectDetail;
use crate::statements::{Statements, iri};
use crate::stored_run::StoredScene;
use actcheck_base::names;
use actcheck_data::{Role, Scene};
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
pub(super) fn write(scene: &StoredScene, run: &NamedNode, statements: &mut Statements<'_>) {
    let standing = scene
        .objects
        .iter()
        .filter(|object| object.role != Role::Platform)
        .count();
    let mut about = statements.about(run.clone());
    about
        .has("act:worldName", scene.world.as_str())
        .has("act:robot", scene.robot.as_str())
        .has("act:objectCount", standing as u64);
    for (property, value) in ["w:baseX", "w:baseY", "w:baseYaw"]
        .into_iter()
        .zip(scene.base)
    {
        about.has(property, value);
    }
    for (name, value) in NOISE_TERMS.into_iter().zip(scene.noise) {
        about.has(&format!("act:{name}"), value);
    }
    if statements.wants(&OF_OBJECTS) {
        for object in &scene.objects {
            write_object(object, run, statements);
        }
    }
}

/// All properties of objects.
const OF_OBJECTS: [&str; 18] = [
    "rdf:type",
    "act:ofRun",
    "act:object",
    "act:category",
    "act:model",
    "act:role",
    "w:x",
    "w:y",
    "w:z",
    "w:yaw",
    "w:mass",
    "w:friction",
    "w:restitution",
    "act:robotDistance",
    "act:neighbourDistance",
    "act:targetDistance",
    "act:displacement",
    "act:maxTilt",
];

fn write_object(object: &ObjectDetail, run: &NamedNode, statements: &mut Statements<'_>) {
    let thing = thing_iri(&object.id);
    let node = NamedNode::new_unchecked(format!("{}/scene/{}", run.as_str(), names::local(&thing)));
    let mut about = statements.about(node);
    about
        .is_a("act:SceneObject")
        .has("act:ofRun", run.clone())
        .has("act:object", iri(&thing))
        .has("act:category", iri(&object.category))
        .has("act:model", object.model.as_str())
        .has("act:role", object.role.word());
    for (property, value) in [
        ("w:x", object.x),
        ("w:y", object.y),
        ("w:z", object.z),
        ("w:yaw", object.yaw),
        ("w:mass", object.mass_kg),
        ("w:friction", object.friction),
        ("w:restitution", object.restitution),
        ("act:robotDistance", object.robot_distance_m),
    ] {
        about.has(property, value);
    }
    for (property, value) in [
        ("act:neighbourDistance", object.neighbour_distance_m),
        ("act:targetDistance", object.target_distance_m),
        ("act:displacement", object.displacement_m),
        ("act:maxTilt", object.max_tilt_rad),
    ] {
        about.optional(property, value);
    }
}
