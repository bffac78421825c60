//! MJCF files as MuJoCo itself reads them: masses, centres and moments of every body, every geom
//! and every joint, to 1e-6. Files are those of this test and of packages from PyPI.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use actcheck::base::{Files, Severity};
use actcheck::config;
use actcheck::data::{ModelTree, TreeGeometry, TreeJoint, TreeMotion, TreeSolid};
use nalgebra::{Isometry3, Matrix3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use serde_json::Value;

use crate::support::{foreign, root, stderr, stdout};

/// Largest difference of lengths and of unit vectors, and of masses and moments relative to the
/// largest of the body.
const NEAR: f64 = 1e-6;

/// Largest difference of moments: MuJoCo ends its search for principal axes at products of inertia
/// of 1e-12 kg·m².
const ROUNDED: f64 = 2e-12;

/// Largest difference of the moments of a body with meshes, relative to the largest: MuJoCo finds
/// the axes of a mesh at a density of 1 kg/m³, where the same products are much for a small mesh. The
/// sum of the moments does not depend on the axes.
const ROUNDED_MESH: f64 = 2e-2;

/// The outcome of a file.
#[derive(Debug, Default)]
struct Counts {
    agree: usize,
    /// Files that MuJoCo refuses: they are parts of others.
    fragments: usize,
    refused: BTreeMap<String, usize>,
    differ: Vec<String>,
}

/// The handed and our own files.
#[test]
fn files_of_every_kind_are_read_as_mujoco_reads_them() {
    let Some(python) = foreign::mujoco() else {
        return;
    };
    let folder = root().join("tests/models/mjcf");
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "xml"))
        .collect();
    files.sort();
    assert!(files.len() >= 20, "{}", files.len());
    let counts = compared(python, &files);
    assert_eq!(counts.differ, Vec::<String>::new());
    assert_eq!(counts.refused, BTreeMap::new());
    assert_eq!(counts.fragments, 0);
}

/// All files of robosuite; with `ACTCHECK_MUJOCO_PACKAGES=NAME,…`, those of these packages in the
/// Python that `ACTCHECK_MUJOCO_PYTHON` names.
#[test]
fn files_of_packages_are_read_as_mujoco_reads_them() {
    let named = std::env::var("ACTCHECK_MUJOCO_PACKAGES");
    let (python, packages) = match (named, std::env::var_os("ACTCHECK_MUJOCO_PYTHON")) {
        (Ok(packages), Some(python)) => (PathBuf::from(python), packages),
        _ => match foreign::mujoco() {
            Some(python) => (python.to_owned(), "robosuite".to_owned()),
            None => return,
        },
    };
    let mut list = Command::new(&python);
    list.arg(root().join("tests/foreign/mujoco_models.py"))
        .arg("--packages")
        .args(packages.split(','));
    let listed = list.output().unwrap();
    let files: Vec<PathBuf> = stdout(&listed).lines().map(PathBuf::from).collect();
    assert!(!files.is_empty(), "{}", stderr(&listed));
    let counts = compared(&python, &files);
    println!(
        "{} files: {} agree, {} are refused by MuJoCo too, refused here: {:?}",
        files.len(),
        counts.agree,
        counts.fragments,
        counts.refused
    );
    assert_eq!(counts.differ, Vec::<String>::new());
    assert!(counts.agree > 0);
}

/// Reads files with MuJoCo and here, and compares both.
fn compared(python: &Path, files: &[PathBuf]) -> Counts {
    let mut command = Command::new(python);
    command
        .arg(root().join("tests/foreign/mujoco_models.py"))
        .args(files);
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let mut counts = Counts::default();
    for line in stdout(&output).lines() {
        let theirs: Value = serde_json::from_str(line).unwrap();
        let path = PathBuf::from(theirs["file"].as_str().unwrap());
        if theirs.get("refused").is_some() {
            counts.fragments += 1;
            continue;
        }
        match config::robot::bare(&Files::Disk, &path, &[], &[]) {
            Err(said) => {
                let first = said
                    .iter()
                    .find(|fault| fault.severity == Severity::Error)
                    .unwrap();
                let reason: String = first
                    .message
                    .chars()
                    .map(|letter| if letter.is_ascii_digit() { '0' } else { letter })
                    .collect();
                *counts
                    .refused
                    .entry(format!("{} {reason}", first.code))
                    .or_default() += 1;
            }
            Ok(ours) => {
                let found = differences(&ours.tree, &theirs);
                if found.is_empty() {
                    counts.agree += 1;
                } else {
                    let few: Vec<&String> = found.iter().take(4).collect();
                    counts.differ.push(format!(
                        "{}: {} differences: {few:?}",
                        path.display(),
                        found.len()
                    ));
                }
            }
        }
    }
    counts
}

/// The differences of a tree from MuJoCo's model, in words.
fn differences(tree: &ModelTree, theirs: &Value) -> Vec<String> {
    let mut found = Vec::new();
    let poses = poses(tree, theirs);
    for (name, body) in theirs["bodies"].as_object().unwrap() {
        if name.is_empty() || name == "world" {
            continue;
        }
        let (Some(link), Some(pose)) = (tree.link(name), poses.get(name.as_str())) else {
            found.push(format!("there is no link {name}"));
            continue;
        };
        let kg = body["kg"].as_f64().unwrap();
        let Some(own) = link.inertial.as_ref().filter(|own| own.kg > 0.0) else {
            if kg > 0.0 {
                found.push(format!("{name} weighs nothing instead of {kg} kg"));
            }
            continue;
        };
        if (own.kg - kg).abs() > NEAR * kg {
            found.push(format!("{name} weighs {} instead of {kg} kg", own.kg));
            continue;
        }
        let at = pose * own.pose;
        let off_m = (at.translation.vector - vector(&body["com"])).norm();
        if off_m > NEAR {
            found.push(format!("{name}: its centre is {off_m} m away"));
        }
        let turned = at.rotation.to_rotation_matrix();
        let inertia = turned.matrix() * own.about_com * turned.matrix().transpose();
        let wanted = matrix(&body["inertia"]);
        let shapes = link.solids.iter().chain(&link.visuals);
        let has_mesh = shapes.into_iter().any(|solid| {
            solid.matter.is_some() && matches!(solid.geometry, TreeGeometry::Mesh { .. })
        });
        let most = wanted.abs().max();
        let near = if has_mesh {
            ROUNDED_MESH * most + 1e3 * ROUNDED
        } else {
            NEAR * most + ROUNDED
        };
        let off = (inertia.trace() - wanted.trace()).abs();
        if (inertia - wanted).abs().max() > near || off > NEAR * most + ROUNDED {
            found.push(format!(
                "{name} has the moments {:?} instead of {:?}",
                principal(&inertia).as_slice(),
                principal(&wanted).as_slice()
            ));
        }
    }
    compare_geoms(tree, theirs, &poses, &mut found);
    compare_joints(tree, theirs, &poses, &mut found);
    found
}

/// The poses of links in the world where MuJoCo puts them at first.
fn poses<'a>(tree: &'a ModelTree, theirs: &Value) -> BTreeMap<&'a str, Isometry3<f64>> {
    let mut poses = BTreeMap::new();
    let children: BTreeSet<&str> = tree
        .joints
        .iter()
        .map(|joint| joint.child.as_str())
        .collect();
    for link in &tree.links {
        if !children.contains(link.name.as_str()) {
            poses.insert(link.name.as_str(), Isometry3::identity());
        }
    }
    for _ in 0..tree.joints.len() {
        for joint in &tree.joints {
            if let (Some(parent), false) = (
                poses.get(joint.parent.as_str()).copied(),
                poses.contains_key(joint.child.as_str()),
            ) {
                let at = theirs["joints"][&joint.name]["at"].as_f64().unwrap_or(0.0);
                poses.insert(&joint.child, parent * joint.origin * motion(joint, at));
            }
        }
    }
    poses
}

fn motion(joint: &TreeJoint, position: f64) -> Isometry3<f64> {
    let axis = Unit::new_normalize(joint.axis);
    match joint.motion {
        TreeMotion::Prismatic => Translation3::from(axis.scale(position)).into(),
        TreeMotion::Revolute | TreeMotion::Continuous => Isometry3::from_parts(
            Translation3::identity(),
            UnitQuaternion::from_axis_angle(&axis, position),
        ),
        _ => Isometry3::identity(),
    }
}

/// Compares the geoms that collide, body by body, in their order.
fn compare_geoms(
    tree: &ModelTree,
    theirs: &Value,
    poses: &BTreeMap<&str, Isometry3<f64>>,
    found: &mut Vec<String>,
) {
    let mut of_bodies: BTreeMap<&str, Vec<&Value>> = BTreeMap::new();
    for geom in theirs["geoms"].as_array().unwrap() {
        let kind = geom["type"].as_str().unwrap();
        if geom["collides"] == true && !["plane", "hfield", "sdf"].contains(&kind) {
            let body = geom["body"].as_str().unwrap();
            of_bodies.entry(body).or_default().push(geom);
        }
    }
    for (name, geoms) in of_bodies.into_iter().filter(|(name, _)| !name.is_empty()) {
        let Some(link) = tree.link(name) else {
            continue;
        };
        // A `<pair>` lets geoms collide whose masks don't.
        if link.solids.len() < geoms.len() {
            let (own, wanted) = (link.solids.len(), geoms.len());
            found.push(format!("{name} has {own} geoms instead of {wanted}"));
            continue;
        }
        for (solid, geom) in link.solids.iter().zip(geoms) {
            let difference = geom_difference(solid, geom, &(poses[name] * solid.pose));
            found.extend(difference.map(|words| format!("{name}: {words}")));
        }
    }
}

fn geom_difference(solid: &TreeSolid, geom: &Value, at: &Isometry3<f64>) -> Option<String> {
    let size = vector(&geom["size"]);
    let (kind, own) = match &solid.geometry {
        TreeGeometry::Box { size } => ("box", Vector3::from(*size) / 2.0),
        TreeGeometry::Sphere { radius } => ("sphere", Vector3::new(*radius, 0.0, 0.0)),
        TreeGeometry::Cylinder { radius, length } => {
            ("cylinder", Vector3::new(*radius, length / 2.0, 0.0))
        }
        TreeGeometry::Capsule { radius, length } => {
            ("capsule", Vector3::new(*radius, length / 2.0, 0.0))
        }
        TreeGeometry::Ellipsoid { radii } => ("ellipsoid", Vector3::from(*radii)),
        TreeGeometry::Mesh { .. } => ("mesh", size),
    };
    let n_sizes = match kind {
        "sphere" => 1,
        "cylinder" | "capsule" => 2,
        _ => 3,
    };
    let is_sized = (0..n_sizes).all(|idx| (own[idx] - size[idx]).abs() <= NEAR);
    if geom["type"] != kind || !is_sized {
        return Some(format!(
            "a {kind} of {own:?} instead of a {} of {size:?}",
            geom["type"]
        ));
    }
    let off_m = (at.translation.vector - vector(&geom["at"])).norm();
    if off_m > NEAR {
        return Some(format!("its {kind} is {off_m} m away"));
    }
    // A form that looks the same after half a turn may be turned so.
    let turned = at.rotation.to_rotation_matrix();
    let wanted = matrix(&geom["turned"]);
    let form = match kind {
        "mesh" => None,
        "sphere" => return friction_difference(solid, geom),
        "box" | "ellipsoid" => Some(own),
        _ => Some(Vector3::new(0.0, 0.0, 1.0)),
    };
    let off = match form {
        None => (turned.matrix() - wanted).abs().max(),
        Some(form) => {
            let spread = Matrix3::from_diagonal(&form.component_mul(&form));
            let of = |turn: &Matrix3<f64>| turn * spread * turn.transpose();
            (of(turned.matrix()) - of(&wanted)).abs().max() / spread.max()
        }
    };
    if off > 10.0 * NEAR {
        return Some(format!("its {kind} is turned by {off}"));
    }
    friction_difference(solid, geom)
}

fn friction_difference(solid: &TreeSolid, geom: &Value) -> Option<String> {
    let (own, wanted) = (solid.friction.unwrap_or(1.0), geom["friction"].as_f64()?);
    ((own - wanted).abs() > NEAR).then(|| format!("friction {own} instead of {wanted}"))
}

fn compare_joints(
    tree: &ModelTree,
    theirs: &Value,
    poses: &BTreeMap<&str, Isometry3<f64>>,
    found: &mut Vec<String>,
) {
    for (name, wanted) in theirs["joints"].as_object().unwrap() {
        let Some(joint) = tree.joint(name).filter(|_| wanted.get("axis").is_some()) else {
            if !name.is_empty() && wanted.get("axis").is_some() {
                found.push(format!("there is no joint {name}"));
            }
            continue;
        };
        let at = poses[joint.child.as_str()];
        let axis = at.rotation * joint.axis.normalize();
        let off = (axis - vector(&wanted["axis"])).norm();
        if off > NEAR {
            found.push(format!("the axis of {name} is {off} off"));
        }
        let slides = joint.motion == TreeMotion::Prismatic;
        let anchor = at * Point3::origin();
        let off_m = (anchor.coords - vector(&wanted["anchor"])).norm();
        if off_m > NEAR && !slides {
            found.push(format!("the joint {name} is {off_m} m away"));
        }
        if let Some(range) = wanted["range"].as_array() {
            let range = [0, 1].map(|end| range[end].as_f64().unwrap());
            let off = (joint.lower - range[0])
                .abs()
                .max((joint.upper - range[1]).abs());
            if off > NEAR {
                found.push(format!(
                    "{name} moves from {} to {} instead of {range:?}",
                    joint.lower, joint.upper
                ));
            }
        }
        let effort = wanted["effort"].as_f64().filter(|effort| *effort > 0.0);
        if let Some(effort) = effort.filter(|effort| (effort - joint.effort).abs() > NEAR * effort)
        {
            found.push(format!("{name} has {} N instead of {effort}", joint.effort));
        }
    }
}

/// The principal moments, from the smallest to the largest.
fn principal(inertia: &Matrix3<f64>) -> Vector3<f64> {
    let mut moments: [f64; 3] = inertia.symmetric_eigenvalues().into();
    moments.sort_by(f64::total_cmp);
    Vector3::from(moments)
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    let list = value.as_array().unwrap();
    std::array::from_fn(|idx| list[idx].as_f64().unwrap())
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from(numbers::<3>(value))
}

fn matrix(value: &Value) -> Matrix3<f64> {
    Matrix3::from_row_slice(&numbers::<9>(value))
}
