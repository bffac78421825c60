//! A scene as statements: each object with its initial pose and its later displacement.

use oxigraph::model::NamedNode;

use crate::statements::{Statements, iri};
use crate::stored_run::StoredScene;
use crate::{NOISE_TERMS, ObjectDetail};
use actcheck_base::names;
use actcheck_data::Role;
use actcheck_facts::thing_iri;

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
    for (name, value) in NOISE_TERMS.into_iter().zip(scene.noise.iter().copied()) {
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
