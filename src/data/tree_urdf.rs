//! Writes a model's tree as URDF, for programs that read no other format, such as skills.

use std::fmt::Write as _;

use nalgebra::Isometry3;

use crate::tree::{ModelTree, TreeGeometry, TreeInertial, TreeJoint, TreeLink, TreeMotion};

impl ModelTree {
    /// Returns the model as URDF. Pairs of links that pass through each other are elements of
    /// SRDF. An ellipsoid becomes the box around it, which is its nearest shape in URDF.
    pub fn to_urdf(&self) -> String {
        let mut text = format!("<robot name=\"{}\">\n", escaped(&self.name));
        for link in &self.links {
            write_link(link, &mut text);
        }
        for joint in &self.joints {
            write_joint(joint, &mut text);
        }
        for [first, second] in &self.passing {
            let _ = writeln!(
                text,
                "  <disable_collisions link1=\"{}\" link2=\"{}\"/>",
                escaped(first),
                escaped(second)
            );
        }
        text + "</robot>\n"
    }
}

fn write_link(link: &TreeLink, text: &mut String) {
    let _ = writeln!(text, "  <link name=\"{}\">", escaped(&link.name));
    if let Some(TreeInertial {
        pose,
        kg,
        about_com: i,
        ..
    }) = &link.inertial
    {
        let _ = writeln!(
            text,
            "    <inertial>{}<mass value=\"{kg}\"/><inertia ixx=\"{}\" ixy=\"{}\" ixz=\"{}\" iyy=\"{}\" iyz=\"{}\" \
             izz=\"{}\"/></inertial>",
            origin(pose),
            i[(0, 0)],
            i[(0, 1)],
            i[(0, 2)],
            i[(1, 1)],
            i[(1, 2)],
            i[(2, 2)],
        );
    }
    let solids = link.solids.iter().map(|solid| ("collision", solid));
    let visuals = link.visuals.iter().map(|visual| ("visual", visual));
    for (element, solid) in solids.chain(visuals) {
        let _ = writeln!(
            text,
            "    <{element}>{}<geometry>{}</geometry></{element}>",
            origin(&solid.pose),
            geometry(&solid.geometry)
        );
    }
    text.push_str("  </link>\n");
}

fn write_joint(joint: &TreeJoint, text: &mut String) {
    let kind = match joint.motion {
        TreeMotion::Fixed | TreeMotion::Unknown => "fixed",
        TreeMotion::Revolute => "revolute",
        TreeMotion::Continuous => "continuous",
        TreeMotion::Prismatic => "prismatic",
        TreeMotion::Planar => "planar",
        TreeMotion::Floating => "floating",
    };
    let _ = writeln!(
        text,
        "  <joint name=\"{}\" type=\"{kind}\">{}<parent link=\"{}\"/><child link=\"{}\"/>",
        escaped(&joint.name),
        origin(&joint.origin),
        escaped(&joint.parent),
        escaped(&joint.child),
    );
    if joint.motion.moves() {
        let _ = writeln!(
            text,
            "    <axis xyz=\"{} {} {}\"/><limit lower=\"{}\" upper=\"{}\" effort=\"{}\" velocity=\"{}\"/>\
             <dynamics damping=\"{}\" friction=\"{}\"/>",
            joint.axis.x,
            joint.axis.y,
            joint.axis.z,
            finite(joint.lower),
            finite(joint.upper),
            joint.effort,
            joint.velocity,
            joint.damping,
            joint.friction,
        );
    }
    if let Some(mimic) = &joint.mimic {
        let _ = writeln!(
            text,
            "    <mimic joint=\"{}\" multiplier=\"{}\" offset=\"{}\"/>",
            escaped(&mimic.leader),
            mimic.factor,
            mimic.offset
        );
    }
    text.push_str("  </joint>\n");
}

/// A joint without limits has none in URDF: its type says so.
fn finite(limit: f64) -> f64 {
    if limit.is_finite() { limit } else { 0.0 }
}

fn geometry(geometry: &TreeGeometry) -> String {
    match geometry {
        TreeGeometry::Box { size: [x, y, z] } => format!("<box size=\"{x} {y} {z}\"/>"),
        TreeGeometry::Cylinder { radius, length } => {
            format!("<cylinder radius=\"{radius}\" length=\"{length}\"/>")
        }
        TreeGeometry::Sphere { radius } => format!("<sphere radius=\"{radius}\"/>"),
        TreeGeometry::Capsule { radius, length } => {
            format!("<capsule radius=\"{radius}\" length=\"{length}\"/>")
        }
        TreeGeometry::Ellipsoid { radii } => {
            let [x, y, z] = radii.map(|radius| 2.0 * radius);
            format!("<box size=\"{x} {y} {z}\"/>")
        }
        TreeGeometry::Mesh {
            file,
            scale: [x, y, z],
        } => format!(
            "<mesh filename=\"{}\" scale=\"{x} {y} {z}\"/>",
            escaped(file)
        ),
    }
}

fn origin(pose: &Isometry3<f64>) -> String {
    let at = pose.translation.vector;
    let (roll, pitch, yaw) = pose.rotation.euler_angles();
    format!(
        "<origin xyz=\"{} {} {}\" rpy=\"{roll} {pitch} {yaw}\"/>",
        at.x, at.y, at.z
    )
}

/// A value of an attribute.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('"', "&quot;")
}
