//! Digests of scenes, which show whether two runs had the same scene.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use oxigraph::model::NamedNode;
use oxigraph::store::StorageError;

use crate::detail::{designators, objects};
use crate::quad_source::QuadSource;
use crate::read::Node;
use crate::wanted::Wanted;
use crate::write_run::run_node;
use crate::{History, ObjectDetail, RunFilter, RunRow};
use actcheck_base::{Diagnostics, Digest};

/// The scene of a run, in two digests.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneDigest {
    /// The test, the world, the designators, the objects with their poses, and the pose of the
    /// robot's base.
    pub arrangement: String,
    /// Mass, friction and restitution of the objects.
    pub physics: String,
}

impl History {
    /// Returns the scenes of runs by run id.
    ///
    /// # Errors
    /// The store can't be read.
    pub fn scenes(&self, runs: &[RunRow]) -> Result<BTreeMap<String, SceneDigest>, Diagnostics> {
        let mut outlines = BTreeMap::new();
        self.each_outlined(&RunFilter::default(), &mut |outlined| {
            outlines.insert(outlined.run(), outlined.row.scene.clone());
        })?;
        let wanted: BTreeSet<&String> = runs.iter().map(|row| &row.run).collect();
        outlines.retain(|run, _| wanted.contains(run));
        let whole: Vec<RunRow> = runs
            .iter()
            .filter(|row| !outlines.contains_key(&row.run))
            .cloned()
            .collect();
        outlines.extend(self.whole_scenes(&whole)?);
        Ok(outlines)
    }

    /// Returns the scenes of runs that are kept whole, by run id.
    ///
    /// # Errors
    /// The store can't be read.
    pub(super) fn whole_scenes(
        &self,
        runs: &[RunRow],
    ) -> Result<BTreeMap<String, SceneDigest>, Diagnostics> {
        let store = self.store_with(Wanted::details)?;
        let scene = |row: &RunRow| {
            let digest = read(&*store, &run_node(&row.run))
                .map_err(|error| self.fault("reading scenes", &error))?;
            Ok((row.run.clone(), digest))
        };
        runs.iter().map(scene).collect()
    }
}

/// Reads the scene of a run.
///
/// # Errors
/// The store can't be read.
pub(super) fn read(store: &impl QuadSource, run: &NamedNode) -> Result<SceneDigest, StorageError> {
    let node = Node::read(store, run)?;
    let whole = [
        "act:test",
        "act:worldName",
        "w:baseX",
        "w:baseY",
        "w:baseYaw",
    ]
    .map(|property| node.text(property).unwrap_or_default());
    let objects = objects(store, run)?;
    Ok(SceneDigest::of(&whole, &designators(&node), &objects))
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
