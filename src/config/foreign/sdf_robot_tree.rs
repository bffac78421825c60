//! Forms the tree of a robot from links at poses and joints between them.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use nalgebra::Isometry3;

use crate::foreign::sdf_ends::JointEnd;
use crate::foreign::sdf_robot_model::{Group, JointAt, LinkAt};
use crate::foreign::xml::{self, Reader};
use actcheck_base::Diagnostics;
use actcheck_data::{ModelTree, TreeJoint, TreeLink, TreeMotion};

/// Smaller poses of the root are rounded zeros. Units: metres, radians.
const ROUNDED: f64 = 1e-12;

/// A tree, and the faults of shapes that are only seen, by link.
#[derive(Default)]
pub(crate) struct Assembled {
    pub(crate) tree: ModelTree,
    pub(crate) faults_of_visuals: BTreeMap<String, Diagnostics>,
}

/// Forms a tree. A joint whose parent is farther from the root than its child is turned round. The
/// frame of a link that a joint moves is that of the joint. Reports links that no joint connects to
/// the others (W051), and joints that close a loop (W035).
pub(crate) fn assemble(name: String, mut group: Group, reader: &mut Reader) -> Assembled {
    if group.links.is_empty() {
        if !reader.found.has_errors() {
            let message = "the robot has no links".to_owned();
            let help = "add `<link name=\"base_link\"/>`";
            reader.error_at("W051", 0..0, message, help);
        }
        return Assembled::default();
    }
    leave_out_spare_links(&mut group, reader);
    warn_of_missing_masses(&group.links, reader);
    let root = add_root(&mut group, reader);
    let (above, closing) = spread(&group, root);
    // Faulty joints make connected links look disconnected.
    if !reader.found.has_errors() {
        report_loops(&group, &closing, reader);
        report_loose(&group, root, &above, reader);
    }
    let frames: Vec<Isometry3<f64>> = (0..group.links.len())
        .map(
            |idx| match above[idx].map(|(joint, _)| &group.joints[joint]) {
                Some(moved) if moved.joint.motion != TreeMotion::Fixed => moved.frame,
                _ => group.links[idx].at,
            },
        )
        .collect();
    let mut of_joint: BTreeMap<usize, usize> = BTreeMap::new();
    for (link, above) in above.iter().enumerate() {
        of_joint.extend(above.map(|(joint, _)| (joint, link)));
    }
    let joints = of_joint.iter().map(|(joint, child)| {
        let parent = above[*child].map_or(root, |(_, parent)| parent);
        placed(
            &group.joints[*joint],
            [parent, *child],
            &group.links,
            &frames,
        )
    });
    let joints = joints.collect();
    let mut faults_of_visuals = BTreeMap::new();
    let mut links = Vec::new();
    for (link, frame) in group.links.into_iter().zip(&frames) {
        if let Some(faults) = link.faults_of_visuals {
            faults_of_visuals.insert(link.link.name.clone(), faults);
        }
        // Most frames are those of their links: no digit changes then.
        links.push(match *frame == link.at {
            true => link.link,
            false => moved(link.link, &(frame.inverse() * link.at)),
        });
    }
    Assembled {
        tree: ModelTree {
            name,
            links,
            joints,
            passing: group.passing,
            inline_meshes: group.meshes,
        },
        faults_of_visuals,
    }
}

/// Leaves out links that no joint holds and that have no shape and no mass, such as those of sensors,
/// with a warning (W036). A robot without other links keeps them.
fn leave_out_spare_links(group: &mut Group, reader: &mut Reader) {
    let joined: BTreeSet<usize> = group
        .joints
        .iter()
        .flat_map(|joint| joint.ends)
        .filter_map(JointEnd::link)
        .collect();
    let is_spare = |idx: usize, link: &LinkAt| {
        let has_mass = link.link.inertial.as_ref().is_some_and(|own| own.kg > 0.0);
        !joined.contains(&idx) && link.link.solids.is_empty() && (link.lacks_mass || !has_mass)
    };
    let spare: Vec<bool> = group
        .links
        .iter()
        .enumerate()
        .map(|(idx, link)| is_spare(idx, link))
        .collect();
    // Faulty joints make connected links look disconnected.
    if reader.found.has_errors() || spare.iter().all(|spare| *spare) {
        return;
    }
    let kept = |idx: usize| spare[..idx].iter().filter(|spare| !**spare).count();
    for end in group.joints.iter_mut().flat_map(|joint| &mut joint.ends) {
        if let JointEnd::Link(idx) = end {
            *idx = kept(*idx);
        }
    }
    let (left, links) = std::mem::take(&mut group.links)
        .into_iter()
        .zip(spare)
        .partition::<Vec<_>, _>(|(_, spare)| *spare);
    group.links = links.into_iter().map(|(link, _)| link).collect();
    for (link, _) in left {
        let message = format!(
            "`{}` is left out: no joint connects it to the robot",
            link.link.name
        );
        let help = "it has no shape and no mass; a joint of the type `fixed` would hold it";
        reader.warning_in("W036", xml::at_tag(&link.link.place), message, help);
    }
}

/// Warns of each link that does not state its mass or its moments (W036): SDF has defaults for them.
fn warn_of_missing_masses(links: &[LinkAt], reader: &mut Reader) {
    for link in links {
        let missing = match (link.lacks_mass, link.lacks_moments) {
            (true, true) => "no mass and no moments of inertia: 1 kg and 1 kg·m² are used",
            (true, false) => "no mass: 1 kg is used",
            (false, true) => "no moments of inertia: 1 kg·m² is used",
            (false, false) => continue,
        };
        let message = format!("`{}` states {missing}, the default of SDF", link.link.name);
        let help = "state `<mass>` and `<inertia>` of each link";
        reader.warning_in("W036", xml::at_tag(&link.link.place), message, help);
    }
}

/// Returns the root: the only link that is fixed to the world, or else a link for the frame of the
/// model, which is added if no other is there.
fn add_root(group: &mut Group, reader: &mut Reader) -> usize {
    let is_to_world = |joint: &JointAt| joint.ends.contains(&JointEnd::World);
    let to_world: Vec<&JointAt> = group
        .joints
        .iter()
        .filter(|joint| is_to_world(joint))
        .collect();
    let root = match to_world.as_slice() {
        [] => Some(widest(group)),
        [only] if only.joint.motion == TreeMotion::Fixed => {
            only.ends.iter().find_map(|end| end.link())
        }
        _ => None,
    };
    let is_held = !to_world.is_empty();
    if let Some(root) = root {
        group.joints.retain(|joint| !is_to_world(joint));
        let at = &group.links[root].at;
        if at.translation.vector.norm() < ROUNDED && at.rotation.angle() < ROUNDED {
            return root;
        }
    }
    let mut name = if is_held { "world" } else { "base_footprint" }.to_owned();
    while group.links.iter().any(|link| link.link.name == name) {
        name.push('_');
    }
    let place = match group.links.first() {
        Some(link) => link.link.place.clone(),
        None => reader.located(0..0),
    };
    let added = group.links.len();
    if let Some(root) = root {
        let mut joint_name = format!("{name}_joint");
        while group
            .joints
            .iter()
            .any(|joint| joint.joint.name == joint_name)
        {
            joint_name.push('_');
        }
        let at = group.links[root].at;
        let joint = TreeJoint::fixed(joint_name, ["", ""], at, place.clone());
        group.joints.push(JointAt {
            joint,
            ends: [JointEnd::Link(added), JointEnd::Link(root)],
            frame: at,
        });
    }
    for end in group.joints.iter_mut().flat_map(|joint| &mut joint.ends) {
        if *end == JointEnd::World {
            *end = JointEnd::Link(added);
        }
    }
    group.links.push(LinkAt {
        link: TreeLink::frame(name, place),
        at: Isometry3::identity(),
        model: String::new(),
        collides: None,
        faults_of_visuals: None,
        lacks_mass: false,
        lacks_moments: false,
    });
    added
}

/// Returns the link without a joint above it that carries the most others, or the first link.
fn widest(group: &Group) -> usize {
    let n_links = group.links.len();
    let mut below = vec![Vec::new(); n_links];
    let mut is_child = vec![false; n_links];
    for joint in &group.joints {
        if let [JointEnd::Link(parent), JointEnd::Link(child)] = joint.ends {
            below[parent].push(child);
            is_child[child] = true;
        }
    }
    let n_carried = |root: usize| {
        let mut seen = vec![false; n_links];
        let mut open = vec![root];
        while let Some(link) = open.pop() {
            if !std::mem::replace(&mut seen[link], true) {
                open.extend(&below[link]);
            }
        }
        seen.iter().filter(|seen| **seen).count()
    };
    let roots = (0..n_links).filter(|link| !is_child[*link]);
    roots
        .max_by_key(|root| (n_carried(*root), std::cmp::Reverse(*root)))
        .unwrap_or(0)
}

/// A joint and the link on its other side, by their indices.
type Above = Option<(usize, usize)>;

/// Walks from the root along all joints. Returns for each link the joint above it with its parent,
/// and the joints that close a loop.
fn spread(group: &Group, root: usize) -> (Vec<Above>, Vec<usize>) {
    let mut near = vec![Vec::new(); group.links.len()];
    for (idx, joint) in group.joints.iter().enumerate() {
        if let [JointEnd::Link(parent), JointEnd::Link(child)] = joint.ends {
            near[parent].push((idx, child));
            near[child].push((idx, parent));
        }
    }
    let mut above: Vec<Above> = vec![None; group.links.len()];
    let mut is_used = vec![false; group.joints.len()];
    let mut is_reached = vec![false; group.links.len()];
    is_reached[root] = true;
    let mut open = VecDeque::from([root]);
    while let Some(link) = open.pop_front() {
        for (joint, other) in &near[link] {
            if !is_reached[*other] {
                is_reached[*other] = true;
                is_used[*joint] = true;
                above[*other] = Some((*joint, link));
                open.push_back(*other);
            }
        }
    }
    let closes = |idx: &usize| match group.joints[*idx].ends {
        [JointEnd::Link(parent), _] => is_reached[parent] && !is_used[*idx],
        _ => false,
    };
    let closing = (0..group.joints.len()).filter(closes).collect();
    (above, closing)
}

fn report_loops(group: &Group, closing: &[usize], reader: &mut Reader) {
    for idx in closing {
        let joint = &group.joints[*idx].joint;
        let message = format!("the joint `{}` closes a loop of links", joint.name);
        let help = "loops can't be simulated: remove it, and couple the joints by `<mimic>`";
        reader.error_in("W035", xml::at_tag(&joint.place), message, help);
    }
}

fn report_loose(group: &Group, root: usize, above: &[Above], reader: &mut Reader) {
    for (idx, link) in group.links.iter().enumerate() {
        if idx != root && above[idx].is_none() {
            let link = &link.link;
            let message = format!("no joint connects `{}` to the robot's root", link.name);
            let help = "links form one tree: add a joint of the type `fixed`";
            reader.error_in("W051", xml::at_tag(&link.place), message, help);
        }
    }
}

/// Returns a joint with its pose, of which `ends` are the links above and below it.
fn placed(
    joint: &JointAt,
    [parent, child]: [usize; 2],
    links: &[LinkAt],
    frames: &[Isometry3<f64>],
) -> TreeJoint {
    let axis = frames[child].rotation.inverse() * joint.joint.axis;
    let is_turned = joint.ends == [JointEnd::Link(child), JointEnd::Link(parent)];
    let name = |link: usize| links[link].link.name.clone();
    TreeJoint {
        parent: name(parent),
        child: name(child),
        origin: frames[parent].inverse() * frames[child],
        axis: if is_turned { -axis } else { axis },
        ..joint.joint.clone()
    }
}

/// Returns a link in another frame, in which its own is at `shift`.
fn moved(mut link: TreeLink, shift: &Isometry3<f64>) -> TreeLink {
    for solid in link.solids.iter_mut().chain(&mut link.visuals) {
        solid.pose = shift * solid.pose;
    }
    if let Some(inertial) = &mut link.inertial {
        inertial.pose = shift * inertial.pose;
    }
    link
}
