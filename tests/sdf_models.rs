//! SDF files as libsdformat itself reads them: poses, masses and moments of every link, every
//! collision and every joint, to 1e-6.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use actcheck::base::{Files, Severity, Source};
use actcheck::config::{self, Overrides};
use actcheck::data::{ModelTree, ObjectModel, TreeGeometry, TreeJoint, TreeMotion, TreeSolid};
use nalgebra::{Isometry3, Matrix3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde_json::Value;

use crate::support::{foreign, root, stderr, stdout};

/// Largest difference of lengths, angles and unit vectors, and of other numbers relative to theirs.
const NEAR: f64 = 1e-6;

/// Larger limits are none. Units: metres, radians.
const UNLIMITED: f64 = 1e6;

/// The outcome of a file.
#[derive(Debug, Default)]
struct Counts {
    agree: usize,
    /// Files that libsdformat refuses.
    refused_there: Vec<String>,
    refused: BTreeMap<String, String>,
    differ: Vec<String>,
}

/// The handed and our own files.
#[test]
fn files_of_every_kind_are_read_as_libsdformat_reads_them() {
    let Some(program) = foreign::sdformat() else {
        return;
    };
    let folder = root().join("tests/models/sdf");
    let files = files_of(&folder);
    assert!(files.len() >= 25, "{}", files.len());
    let counts = compared(program, &folder, &files);
    assert_eq!(counts.differ, Vec::<String>::new());
    assert_eq!(counts.refused, BTreeMap::new());
    assert_eq!(counts.refused_there, Vec::<String>::new());
    assert_eq!(counts.agree, files.len());
}

/// Objects, which are one body: their mass and moments, and the distances between their shapes.
#[test]
fn objects_are_read_as_libsdformat_reads_them() {
    let Some(program) = foreign::sdformat() else {
        return;
    };
    let folder = root().join("tests/models/sdf_objects");
    let files = files_of(&folder);
    assert!(files.len() >= 6, "{}", files.len());
    assert_eq!(
        objects_differ(program, &folder, &files),
        Vec::<String>::new()
    );
}

/// Files of a folder that `ACTCHECK_SDF_FOLDER` names: each `.sdf` with a robot that both read.
#[test]
fn files_of_a_named_folder_are_read_as_libsdformat_reads_them() {
    let Some(folder) = std::env::var_os("ACTCHECK_SDF_FOLDER") else {
        return;
    };
    let Some(program) = foreign::sdformat() else {
        return;
    };
    let folder = PathBuf::from(folder);
    let counts = compared(program, &folder, &files_of(&folder));
    println!(
        "{} agree; refused by both or there: {}",
        counts.agree,
        counts.refused_there.len()
    );
    println!("refused here: {:#?}", counts.refused);
    assert_eq!(counts.differ, Vec::<String>::new());
}

/// The robots of a folder, in alphabetical order.
fn files_of(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut files: Vec<PathBuf> = entries
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "sdf"))
        .collect();
    files.sort();
    files
}

/// Reads files with libsdformat and here, and compares both.
fn compared(program: &Path, folder: &Path, files: &[PathBuf]) -> Counts {
    let output = Command::new(program)
        .arg(folder)
        .args(files)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let mut counts = Counts::default();
    for line in stdout(&output).lines() {
        let theirs: Value = serde_json::from_str(line).unwrap();
        let path = PathBuf::from(theirs["file"].as_str().unwrap());
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let faults = theirs["faults"].as_str().unwrap();
        if !faults.is_empty() {
            counts.refused_there.push(format!("{name}: {faults}"));
            continue;
        }
        match config::robot::bare(&Files::Disk, &path, &[folder.to_owned()], &[]) {
            Err(said) => {
                let first = said.iter().find(|fault| fault.severity == Severity::Error);
                counts.refused.insert(name, first.unwrap().message.clone());
            }
            Ok(ours) => {
                let found = differences(&ours.tree, &theirs, is_weighed(&path));
                match found.is_empty() {
                    true => counts.agree += 1,
                    false => counts.differ.push(format!("{name}: {found:#?}")),
                }
            }
        }
    }
    counts
}

/// Whether a file states its masses: libsdformat 12 computes none.
fn is_weighed(path: &Path) -> bool {
    let text = std::fs::read_to_string(path).unwrap();
    !text.contains("auto=") && !text.contains("<uri>model://tool")
}

/// The differences of a tree from libsdformat's model, in words. `weighed`: masses are compared.
fn differences(tree: &ModelTree, theirs: &Value, weighed: bool) -> Vec<String> {
    let mut found = Vec::new();
    let poses = poses(tree);
    // A robot of a world is in the frame of its first model, and has no names of a single model.
    let links = theirs["links"].as_object().unwrap();
    let joints = theirs["joints"].as_object().unwrap();
    let named = |name: &str| {
        let ends = |theirs: &&String| theirs.ends_with(&format!("::{name}"));
        let exact = links
            .keys()
            .chain(joints.keys())
            .find(|theirs| *theirs == name);
        let longer = links.keys().chain(joints.keys()).find(ends);
        exact.or(longer).cloned().unwrap_or_else(|| name.to_owned())
    };
    let to_theirs = match tree
        .links
        .iter()
        .find(|link| links.contains_key(&named(&link.name)))
    {
        Some(link) if !links.contains_key(&link.name) || theirs["world"] == true => {
            frame(&theirs["links"][named(&link.name)]["pose"]) * poses[&link.name].inverse()
        }
        _ => Isometry3::identity(),
    };
    for (name, pose) in &poses {
        let Some(wanted) = links.get(&named(name)) else {
            if !["world", "base_footprint"].contains(&name.as_str()) {
                found.push(format!("there is no link {name} there"));
            }
            continue;
        };
        let moving = |joint: &&TreeJoint| joint.child == *name && joint.motion != TreeMotion::Fixed;
        let at = to_theirs * pose;
        // The frame of a link that a joint moves is that of the joint.
        match tree.joints.iter().find(moving) {
            None => compare_poses(name, &at, &wanted["pose"], &mut found),
            Some(joint) => match joints.get(&named(&joint.name)) {
                Some(wanted) => {
                    compare_poses(&joint.name, &at, &wanted["pose"], &mut found);
                    compare_joint(joint, &at, wanted, &named, &mut found);
                }
                None if theirs["world"] == true => {}
                None => found.push(format!("there is no joint {} there", joint.name)),
            },
        }
        let link = tree.link(name).unwrap();
        compare_collisions(name, &link.solids, &at, wanted, &mut found);
        if weighed {
            compare_masses(tree, name, &at, wanted, &mut found);
        }
    }
    let is_known = |name: &String| poses.keys().any(|own| named(own) == *name);
    let missing = links
        .keys()
        .filter(|name| !is_known(name) && theirs["world"] != true);
    found.extend(missing.map(|name| format!("the link {name} is missing")));
    found
}

/// The differences of objects from libsdformat's models, in words.
fn objects_differ(program: &Path, folder: &Path, files: &[PathBuf]) -> Vec<String> {
    let output = Command::new(program)
        .arg(folder)
        .args(files)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let text = format!(
        "tests = [[\"Pick\"]]\ntest_count = 1\nmodel_dir = {:?}\n",
        folder.display().to_string()
    );
    let campaign = config::load_text(Source::new("c.toml", text), folder, &Overrides::default());
    let campaign = campaign.unwrap_or_else(|found| panic!("{found}"));
    let mut found = Vec::new();
    for line in stdout(&output).lines() {
        let theirs: Value = serde_json::from_str(line).unwrap();
        let name = Path::new(theirs["file"].as_str().unwrap())
            .file_stem()
            .unwrap();
        let name = name.to_string_lossy().into_owned();
        assert_eq!(theirs["faults"], "", "{name}");
        let Some(model) = campaign.models.get(&name) else {
            found.push(format!("{name} is refused"));
            continue;
        };
        compare_object(&name, model, &theirs, &mut found);
    }
    found
}

/// Compares an object, which is moved to the ground and turned, with the links of a model that
/// fixed joints connect.
fn compare_object(name: &str, model: &ObjectModel, theirs: &Value, found: &mut Vec<String>) {
    let links: Vec<&Value> = theirs["links"].as_object().unwrap().values().collect();
    let kg = |link: &Value| link["kg"].as_f64().unwrap();
    let com_of = |link: &Value| frame(&link["inertia"]["pose"]).translation.vector;
    let total: f64 = links.iter().map(|link| kg(link)).sum();
    let com = links
        .iter()
        .map(|link| com_of(link) * kg(link))
        .sum::<Vector3<f64>>()
        / total;
    let about = |link: &Value| {
        let arm = com_of(link) - com;
        let turn = frame(&link["inertia"]["pose"])
            .rotation
            .to_rotation_matrix();
        let apart = Matrix3::identity() * arm.norm_squared() - arm * arm.transpose();
        turn.matrix() * moments(link) * turn.matrix().transpose() + apart * kg(link)
    };
    let wanted = principal(&links.iter().map(|link| about(link)).sum());
    let Some(inertia) = &model.inertia else {
        found.push(format!("{name} has no moments"));
        return;
    };
    let own = principal(&Matrix3::from_fn(|row, column| {
        inertia.about_com[row][column]
    }));
    if (model.mass_kg - total).abs() > NEAR || (own - wanted).norm() > NEAR * wanted.norm() {
        found.push(format!(
            "{name}: {} kg, {own} instead of {total} kg, {wanted}",
            model.mass_kg
        ));
    }
    let mut shapes = Vec::new();
    for link in links {
        for collision in link["collisions"].as_array().unwrap() {
            let (at, friction) = (frame(&collision["pose"]), &collision["friction"]);
            shapes.push(at.translation.vector);
            if (model.friction - friction.as_f64().unwrap()).abs() > NEAR {
                found.push(format!(
                    "{name}: friction {} instead of {friction}",
                    model.friction
                ));
            }
        }
    }
    let own = model
        .parts
        .iter()
        .map(|part| part.pose.to_isometry().translation.vector);
    let own = distances(own.chain([Vector3::from(inertia.com_m)]).collect());
    let wanted = distances(shapes.into_iter().chain([com]).collect());
    let is_near = |(own, wanted): (&f64, &f64)| (own - wanted).abs() <= NEAR;
    if own.len() != wanted.len() || !own.iter().zip(&wanted).all(is_near) {
        found.push(format!(
            "{name}: shapes {own:?} apart instead of {wanted:?}"
        ));
    }
}

/// The distances between all pairs of points, from the smallest to the largest.
fn distances(points: Vec<Vector3<f64>>) -> Vec<f64> {
    let apart = |(idx, first): (usize, &Vector3<f64>)| -> Vec<f64> {
        points[idx + 1..]
            .iter()
            .map(|second| (first - second).norm())
            .collect()
    };
    let mut all: Vec<f64> = points.iter().enumerate().flat_map(apart).collect();
    all.sort_by(f64::total_cmp);
    all
}

/// The principal moments, from the smallest to the largest.
fn principal(inertia: &Matrix3<f64>) -> Vector3<f64> {
    let mut moments: [f64; 3] = inertia.symmetric_eigenvalues().into();
    moments.sort_by(f64::total_cmp);
    Vector3::from(moments)
}

/// The moments of a link there, along the axes of its `<inertial>`.
fn moments(link: &Value) -> Matrix3<f64> {
    let ([xx, yy, zz], [xy, xz, yz]) = (
        numbers::<3>(&link["inertia"]["diagonal"]),
        numbers::<3>(&link["inertia"]["products"]),
    );
    Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
}

/// The poses of links with all joints at 0.
fn poses(tree: &ModelTree) -> BTreeMap<String, Isometry3<f64>> {
    let is_child = |name: &str| tree.joints.iter().any(|joint| joint.child == name);
    let roots = tree.links.iter().filter(|link| !is_child(&link.name));
    let mut poses: BTreeMap<String, Isometry3<f64>> = roots
        .map(|link| (link.name.clone(), Isometry3::identity()))
        .collect();
    for _ in 0..tree.joints.len() {
        for joint in &tree.joints {
            if let Some(parent) = poses.get(&joint.parent) {
                poses.insert(joint.child.clone(), parent * joint.origin);
            }
        }
    }
    poses
}

fn compare_poses(name: &str, own: &Isometry3<f64>, wanted: &Value, found: &mut Vec<String>) {
    let wanted = frame(wanted);
    let off_m = (own.translation.vector - wanted.translation.vector).norm();
    let off_rad = own.rotation.angle_to(&wanted.rotation);
    if off_m > NEAR || off_rad > NEAR {
        found.push(format!("{name} is {off_m} m and {off_rad} rad away"));
    }
}

fn compare_masses(
    tree: &ModelTree,
    name: &str,
    at: &Isometry3<f64>,
    wanted: &Value,
    found: &mut Vec<String>,
) {
    let kg = wanted["kg"].as_f64().unwrap();
    let Some(own) = tree.link(name).and_then(|link| link.inertial.as_ref()) else {
        found.push(format!("{name} weighs nothing instead of {kg} kg"));
        return;
    };
    if (own.kg - kg).abs() > NEAR * kg {
        found.push(format!("{name} weighs {} instead of {kg} kg", own.kg));
    }
    compare_poses(
        &format!("the mass of {name}"),
        &(at * own.pose),
        &wanted["inertia"]["pose"],
        found,
    );
    let moments = moments(wanted);
    if (own.about_com - moments).abs().max() > NEAR * moments.abs().max() {
        found.push(format!(
            "{name} has the moments {} instead of {moments}",
            own.about_com
        ));
    }
}

fn compare_collisions(
    name: &str,
    solids: &[TreeSolid],
    at: &Isometry3<f64>,
    wanted: &Value,
    found: &mut Vec<String>,
) {
    // Version 12 knows no cone.
    let known = |geom: &&Value| geom["type"] != "other";
    let wanted: Vec<&Value> = wanted["collisions"]
        .as_array()
        .unwrap()
        .iter()
        .filter(known)
        .collect();
    let is_cone = |solid: &&TreeSolid| matches!(&solid.geometry, TreeGeometry::Mesh { file, .. } if file.contains(' '));
    let own: Vec<&TreeSolid> = solids.iter().filter(|solid| !is_cone(solid)).collect();
    if own.len() != wanted.len() {
        found.push(format!(
            "{name} has {} collisions instead of {}",
            own.len(),
            wanted.len()
        ));
        return;
    }
    for (solid, wanted) in own.into_iter().zip(wanted) {
        compare_poses(
            &format!("a shape of {name}"),
            &(at * solid.pose),
            &wanted["pose"],
            found,
        );
        let (kind, size) = form(&solid.geometry);
        let theirs = wanted["size"].as_array().unwrap();
        let is_sized = size.len() == theirs.len()
            && size
                .iter()
                .zip(theirs)
                .all(|(own, size)| (own - size.as_f64().unwrap()).abs() <= NEAR);
        if wanted["type"] != kind || !is_sized {
            found.push(format!("{name}: a {kind} of {size:?} instead of {wanted}"));
        }
        let (own, friction) = (
            solid.friction.unwrap_or(1.0),
            wanted["friction"].as_f64().unwrap(),
        );
        if (own - friction).abs() > NEAR {
            found.push(format!("{name}: friction {own} instead of {friction}"));
        }
    }
}

fn form(geometry: &TreeGeometry) -> (&'static str, Vec<f64>) {
    match geometry {
        TreeGeometry::Box { size } => ("box", size.to_vec()),
        TreeGeometry::Sphere { radius } => ("sphere", vec![*radius]),
        TreeGeometry::Cylinder { radius, length } => ("cylinder", vec![*radius, *length]),
        TreeGeometry::Capsule { radius, length } => ("capsule", vec![*radius, *length]),
        TreeGeometry::Ellipsoid { radii } => ("ellipsoid", radii.to_vec()),
        TreeGeometry::Mesh { scale, .. } => ("mesh", scale.to_vec()),
    }
}

fn compare_joint(
    joint: &TreeJoint,
    at: &Isometry3<f64>,
    wanted: &Value,
    named: &impl Fn(&str) -> String,
    found: &mut Vec<String>,
) {
    let name = &joint.name;
    let ends = [&wanted["parent"], &wanted["child"]].map(|end| end.as_str().unwrap().to_owned());
    let mut own = [named(&joint.parent), named(&joint.child)];
    // A joint whose child is nearer to the root is turned round, with its axis.
    let is_turned = own[0] == ends[1];
    if is_turned {
        own.swap(0, 1);
    }
    if own != ends {
        found.push(format!("{name} connects {own:?} instead of {ends:?}"));
    }
    let axis = at.rotation * joint.axis * if is_turned { -1.0 } else { 1.0 };
    let off = (axis - Vector3::from(numbers::<3>(&wanted["axis"])).normalize()).norm();
    if off > NEAR {
        found.push(format!("the axis of {name} is {off} off"));
    }
    let limit = |key: &str| wanted[key].as_f64().filter(|limit| limit.abs() < UNLIMITED);
    let ends = [("lower", joint.lower), ("upper", joint.upper)];
    for (key, own) in ends
        .into_iter()
        .chain([("damping", joint.damping), ("friction", joint.friction)])
    {
        match limit(key) {
            Some(limit) if (own - limit).abs() > NEAR => {
                found.push(format!("{name}: {key} {own} instead of {limit}"));
            }
            None if joint.motion == TreeMotion::Revolute && own.abs() < 10.0 => {
                found.push(format!("{name}: {key} {own} instead of none"));
            }
            _ => {}
        }
    }
    for (key, own) in [("effort", joint.effort), ("velocity", joint.velocity)] {
        // Here 0 is unknown.
        let most = limit(key).filter(|most| *most > 0.0).unwrap_or(0.0);
        if (own - most).abs() > NEAR {
            found.push(format!("{name}: {key} {own} instead of {most}"));
        }
    }
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    let list = value.as_array().unwrap();
    std::array::from_fn(|idx| list[idx].as_f64().unwrap())
}

fn frame(value: &Value) -> Isometry3<f64> {
    let [x, y, z, w] = numbers(&value["turned"]);
    Isometry3::from_parts(
        Translation3::from(Vector3::from(numbers::<3>(&value["at"]))),
        UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)),
    )
}
