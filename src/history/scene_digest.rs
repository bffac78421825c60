//! Digests of scenes, which show whether two runs had the same scene.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::ObjectDetail;
use actcheck_base::Digest;

/// The scene of a run, in two digests.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneDigest {
    /// The test, the world, the designators, the objects with their poses, and the pose of the
    /// robot's base.
    pub arrangement: String,
    /// Mass, friction and restitution of the objects.
    pub physics: String,
}

impl SceneDigest {
    /// The digests of a scene. `whole`: the texts of the test, the world, and the base's pose;
    /// `objects` and the values of each designator are sorted.
    pub(super) fn of(
        whole: &[String; 5],
        designators: &BTreeMap<String, Vec<String>>,
        objects: &[ObjectDetail],
    ) -> Self {
        let mut arrangement = Digest::new();
        for text in whole {
            arrangement.update(text.as_bytes());
        }
        for (designator, values) in designators {
            arrangement.update(designator.as_bytes());
            arrangement.update(values.join("\n").as_bytes());
        }
        let mut physics = Digest::new();
        for object in objects {
            add_place(object, &mut arrangement);
            add_numbers(
                [object.mass_kg, object.friction, object.restitution],
                &mut physics,
            );
        }
        Self {
            arrangement: arrangement.finish(),
            physics: physics.finish(),
        }
    }
}

fn add_place(object: &ObjectDetail, digest: &mut Digest) {
    for text in [
        &object.id,
        &object.model,
        &object.category,
        object.role.word(),
    ] {
        digest.update(text.as_bytes());
    }
    add_numbers([object.x, object.y, object.z, object.yaw], digest);
}

fn add_numbers(values: impl IntoIterator<Item = f64>, digest: &mut Digest) {
    for value in values {
        digest.update(&value.to_bits().to_le_bytes());
    }
}
