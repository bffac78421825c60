//! Decomposes the meshes of models and robot into convex hulls before the first run, with a cache
//! beside the history.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rayon::prelude::*;

use actcheck_base::{Below, Diagnostic, Diagnostics, Digest};
use actcheck_config::Campaign;
use actcheck_data::{Mesh, ObjectModel, Part, RobotCore, Shape, StatedRobot};
use actcheck_world::{self as world, Completed, DecompositionFault, Robot, RobotModel};

/// Cache folder in the history's folder.
const FOLDER: &str = "hulls";
/// Longest file: the solids of a mesh have some kilobytes. Unit: bytes.
const LONGEST: u64 = 64 << 20;
/// The start of each file, with the format version.
const TITLE: &str = "actcheck hulls 2";

/// Convex decompositions by the key of their mesh, cached in memory and on disk.
struct HullCache {
    history: PathBuf,
    known: BTreeMap<String, Result<Vec<Shape>, DecompositionFault>>,
}

/// Replaces the meshes of the robot and of all models that the campaign uses by convex hulls.
///
/// Adds a fault (W037) for each mesh without a convex decomposition.
pub(super) fn decompose_meshes(campaign: &mut Campaign, faults: &mut Diagnostics) {
    let mut cache = HullCache {
        history: campaign.history.clone(),
        known: BTreeMap::new(),
    };
    let used = campaign.used_models();
    let models = campaign
        .models
        .iter()
        .filter(|(name, _)| used.contains(*name))
        .map(|(_, model)| model.as_ref());
    cache.fill(
        models
            .flat_map(shapes_of)
            .chain(campaign.robot.core.meshes.values().flatten()),
    );
    for (name, model) in campaign
        .models
        .iter_mut()
        .filter(|(name, _)| used.contains(*name))
    {
        let moving = 0..model.moving.len();
        decompose_model(name, model, &mut cache, faults);
        for idx in moving
            .filter(|idx| has_mesh(&model.moving[*idx].model))
            .collect::<Vec<_>>()
        {
            decompose_model(
                name,
                &mut Arc::make_mut(model).moving[idx].model,
                &mut cache,
                faults,
            );
        }
    }
    let robot = Arc::make_mut(&mut campaign.robot);
    decompose_with(&mut cache, &mut robot.core, faults);
}

/// The shapes of a model and of its moving parts.
fn shapes_of(model: &ObjectModel) -> impl Iterator<Item = &Shape> {
    let moving = model.moving.iter().flat_map(|part| &part.model.parts);
    model.parts.iter().chain(moving).map(|part| &part.shape)
}

fn has_mesh(model: &ObjectModel) -> bool {
    model
        .parts
        .iter()
        .any(|part| matches!(part.shape, Shape::Mesh { .. }))
}

fn decompose_model(
    name: &str,
    model: &mut Arc<ObjectModel>,
    cache: &mut HullCache,
    faults: &mut Diagnostics,
) {
    if !has_mesh(model) {
        return;
    }
    match solid_parts(model, cache) {
        Ok(parts) => Arc::make_mut(model).parts = parts,
        Err(reason) => faults.push(unusable(&format!("a mesh of the model `{name}`"), reason)),
    }
}

/// Proposes a profile for a robot without roles, and for that of its hands with `hand` in a name.
/// Meshes are decomposed with the cache in the folder of a history.
///
/// # Errors
/// W037 for each mesh without a convex decomposition; W020 to W024 if no profile can be proposed.
pub fn proposed_robot(
    mut robot: RobotCore,
    history: &Path,
    hand: Option<&str>,
) -> Result<world::Proposal, Diagnostics> {
    let mut cache = HullCache {
        history: history.to_path_buf(),
        known: BTreeMap::new(),
    };
    let mut faults = Diagnostics::new();
    cache.fill(robot.meshes.values().flatten());
    decompose_with(&mut cache, &mut robot, &mut faults);
    faults.or(())?;
    Ok(world::propose(robot, hand).map_err(|error| error.diagnostic())?)
}

/// Finds the roles that the robot's profile leaves out, limits the force of its grip to that of its
/// motors, and returns the compiled robot: once for all runs of a campaign. Returns also the basis of
/// all values that the profile does not state.
///
/// # Errors
/// [`world::RobotError`] if they can't be found.
pub(super) fn complete_robot(
    stated: &StatedRobot,
) -> Result<(Robot, BTreeMap<&'static str, String>), world::RobotError> {
    let Completed { profile, notes } = world::complete(stated)?;
    let mut robot = Robot::compile(&Arc::new(profile))?;
    let limit_n = robot.grip_limit_n();
    if limit_n < robot.profile.hand.grip_force_n {
        // The links and joints don't depend on the force.
        Arc::make_mut(&mut robot.profile).hand.grip_force_n = limit_n;
    }
    Ok((robot, notes))
}

/// Returns the simulated links of a campaign's robot. Its meshes are decomposed only if its profile
/// leaves out roles, which are found on them.
///
/// # Errors
/// [`world::RobotError`] if the robot is not a single tree, or the roles can't be found.
pub(super) fn robot_model(campaign: &mut Campaign) -> Result<RobotModel, world::RobotError> {
    let profile = match campaign.robot.complete() {
        Ok(profile) => profile,
        Err(_) => {
            let mut cache = HullCache {
                history: campaign.history.clone(),
                known: BTreeMap::new(),
            };
            let robot = &mut Arc::make_mut(&mut campaign.robot).core;
            cache.fill(robot.meshes.values().flatten());
            // A mesh that can't be decomposed was reported when the campaign was made.
            decompose_with(&mut cache, robot, &mut Diagnostics::new());
            world::complete(&campaign.robot)?.profile
        }
    };
    RobotModel::read(profile.roles())
}

fn decompose_with(cache: &mut HullCache, robot: &mut RobotCore, faults: &mut Diagnostics) {
    for (file, shapes) in &mut robot.meshes {
        let apart: Result<Vec<Vec<Shape>>, DecompositionFault> = shapes
            .iter()
            .map(|shape| cache.solids_or_sheet(shape))
            .collect();
        let meshes = shapes.iter().filter_map(|shape| match shape {
            Shape::Mesh { mesh } => Some(Arc::new(mesh.clone())),
            _ => None,
        });
        let meshes: Vec<Arc<Mesh>> = meshes.collect();
        if !meshes.is_empty() {
            robot.surfaces.insert(file.clone(), meshes);
        }
        match apart {
            Ok(apart) => *shapes = apart.concat().iter().map(world::simplified).collect(),
            Err(reason) => faults.push(unusable(&format!("the robot's mesh {file}"), reason)),
        }
    }
}

fn unusable(what: &str, reason: DecompositionFault) -> Diagnostic {
    Diagnostic::error("W037", format!("{what} is unusable: {reason}"))
        .help("a collision mesh is a closed surface around something solid")
}

fn solid_parts(
    model: &ObjectModel,
    cache: &mut HullCache,
) -> Result<Vec<Part>, DecompositionFault> {
    let mut parts = Vec::new();
    for part in &model.parts {
        parts.extend(
            cache
                .solids_or_sheet(&part.shape)?
                .into_iter()
                .map(|shape| Part {
                    pose: part.pose,
                    shape,
                }),
        );
    }
    Ok(parts)
}

impl HullCache {
    /// Decomposes meshes side by side: a robot has dozens, and some take seconds.
    fn fill<'a>(&mut self, shapes: impl Iterator<Item = &'a Shape>) {
        let meshes = shapes.filter_map(|shape| match shape {
            Shape::Mesh { mesh } => Some((world::decomposition_key(mesh), mesh)),
            _ => None,
        });
        let meshes: BTreeMap<String, &Mesh> = meshes.collect();
        let solids: Vec<_> = meshes
            .par_iter()
            .map(|(key, mesh)| self.cached_or_new(key, mesh))
            .collect();
        self.known.extend(meshes.into_keys().zip(solids));
    }

    /// Returns the convex hulls of a mesh, or any other shape unchanged.
    fn solids(&mut self, shape: &Shape) -> Result<Vec<Shape>, DecompositionFault> {
        let Shape::Mesh { mesh } = shape else {
            return Ok(vec![shape.clone()]);
        };
        let key = world::decomposition_key(mesh);
        if let Some(known) = self.known.get(&key) {
            return known.clone();
        }
        let solids = self.cached_or_new(&key, mesh);
        self.known.insert(key, solids.clone());
        solids
    }

    /// As [`HullCache::solids`]; a flat mesh, such as a carpet or a marker on a robot, becomes a
    /// thin solid.
    fn solids_or_sheet(&mut self, shape: &Shape) -> Result<Vec<Shape>, DecompositionFault> {
        self.solids(shape).or_else(|reason| match shape {
            Shape::Mesh { mesh } => world::sheet(mesh).map(|sheet| vec![sheet]).ok_or(reason),
            _ => Err(reason),
        })
    }

    fn cached_or_new(&self, key: &str, mesh: &Mesh) -> Result<Vec<Shape>, DecompositionFault> {
        if let Some(solids) = read(&self.history, key) {
            return Ok(solids);
        }
        let solids = world::decompose(mesh)?;
        // If the cache can't be written, the mesh is decomposed again next time.
        let _ = write(&self.history, key, &solids);
        Ok(solids)
    }
}

/// The file of a mesh.
fn file_of(history: &Path, key: &str) -> PathBuf {
    history.join(FOLDER).join(format!("{key}.hulls"))
}

/// Reads the cache file of a mesh. Returns `None` if it is missing, corrupt, of another mesh, or in
/// another format.
fn read(history: &Path, key: &str) -> Option<Vec<Shape>> {
    let bytes = Below::new(history)
        .read(&file_of(history, key), LONGEST)
        .ok()?;
    let (head, body) = bytes.split_at_checked(bytes.iter().position(|byte| *byte == b'\n')? + 1)?;
    let solids: Vec<Shape> = if head == head_of(key, body).as_bytes() {
        postcard::from_bytes(body).ok()?
    } else {
        return None;
    };
    let is_solid = |shape: &Shape| matches!(shape, Shape::Hull { points, .. } if points.len() >= 4);
    (!solids.is_empty() && solids.iter().all(is_solid)).then_some(solids)
}

/// Writes a file atomically: a reader finds all of it or none.
fn write(history: &Path, key: &str, solids: &[Shape]) -> std::io::Result<()> {
    let body = postcard::to_stdvec(solids).map_err(std::io::Error::other)?;
    let below = Below::new(history);
    let entries = below.entries(history)?;
    let has = |names: &[&str]| {
        entries
            .iter()
            .any(|(name, _)| name.to_str().is_some_and(|name| names.contains(&name)))
    };
    let is_ours = has(&["VERSION"])
        || entries
            .iter()
            .all(|(name, _)| name == FOLDER || name == "lock");
    if !is_ours {
        return Err(std::io::Error::other("the folder is not that of a history"));
    }
    below.create_folder(&history.join(FOLDER))?;
    let bytes = [head_of(key, &body).as_bytes(), &body].concat();
    below.write_quickly(&file_of(history, key), &bytes)
}

/// The first line: the format, and a digest of the mesh's key and the rest.
fn head_of(key: &str, body: &[u8]) -> String {
    let mut digest = Digest::new();
    digest.update(key.as_bytes());
    digest.update(body);
    format!("{TITLE} {}\n", digest.finish())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// Values are read back bit by bit, and a modified file is rejected.
    #[test]
    fn cached_solids_are_read_back_exactly_or_rejected() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let history = folder.path().join("deep");
        let path = file_of(&history, "key");
        let third = 1.0 / 3.0;
        let solids = vec![Shape::Hull {
            points: vec![
                [third, -0.0, 1e-300],
                [1.0, 0.1, 0.2],
                [f64::MAX, 0.3, 5e-324],
                [0.7, third / 7.0, 9.9],
            ],
            volume: third,
        }];
        write(&history, "key", &solids).expect("the cache can be written");
        let Some([Shape::Hull { points, volume }]) = read(&history, "key")
            .as_deref()
            .map(|list| [list[0].clone()])
        else {
            panic!("one hull is read");
        };
        let Shape::Hull {
            points: expected, ..
        } = &solids[0]
        else {
            unreachable!()
        };
        let bits = |list: &[[f64; 3]]| {
            list.iter()
                .flatten()
                .map(|x| x.to_bits())
                .collect::<Vec<_>>()
        };
        assert_eq!(
            (bits(&points), volume.to_bits()),
            (bits(expected), third.to_bits())
        );
        let bytes = fs::read(&path).expect("the cache can be read");
        for at in [0, bytes.len() / 2, bytes.len() - 1] {
            let mut other = bytes.clone();
            other[at] ^= 1;
            fs::write(&path, other).expect("the cache can be written");
            assert!(read(&history, "key").is_none(), "byte {at}");
        }
        fs::write(&path, &bytes[..bytes.len() / 2]).expect("the cache can be written");
        assert!(read(&history, "key").is_none());
        fs::write(file_of(&history, "other"), &bytes).expect("the cache can be written");
        assert!(
            read(&history, "other").is_none(),
            "the file of another mesh"
        );
    }
}
