//! A scene as quads: each object with its initial pose and its later displacement.

use oxigraph::model::{Literal, NamedNode};

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
pub(super) fn write(scene: &StoredScene, run: &NamedNode, statements: &mut Statements) {
    let standing = scene
        .objects
        .iter()
        .filter(|object| object.role != Role::Platform)
        .count();
    let mut about = statements.about(run.clone());
    about
        .text("act:worldName", &scene.world)
        .text("act:robot", &scene.robot)
        .has("act:objectCount", Literal::from(standing as u64));
    for (property, value) in ["w:baseX", "w:baseY", "w:baseYaw"]
        .into_iter()
        .zip(scene.base)
    {
        about.has(property, Literal::from(value));
    }
    for (name, value) in NOISE_TERMS.into_iter().zip(scene.noise) {
        about.has(&format!("act:{name}"), Literal::from(value));
    }
    for object in &scene.objects {
        write_object(object, run, statements);
    }
}

fn write_object(object: &ObjectDetail, run: &NamedNode, statements: &mut Statements) {
    let thing = thing_iri(&object.id);
    let node = NamedNode::new_unchecked(format!("{}/scene/{}", run.as_str(), names::local(&thing)));
    let mut about = statements.about(node);
    about
        .is_a("act:SceneObject")
        .has("act:ofRun", run.clone())
        .has("act:object", iri(&thing))
        .has("act:category", iri(&object.category))
        .text("act:model", &object.model)
        .text("act:role", object.role.word());
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
        about.has(property, Literal::from(value));
    }
    for (property, value) in [
        ("act:neighbourDistance", object.neighbour_distance_m),
        ("act:targetDistance", object.target_distance_m),
        ("act:displacement", object.displacement_m),
        ("act:maxTilt", object.max_tilt_rad),
    ] {
        about.optional(property, value.map(Literal::from));
    }
}
