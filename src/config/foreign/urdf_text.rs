//! Writes URDF: the form into which robots of other formats are converted.

use std::fmt::Write as _;

use nalgebra::{Isometry3, Matrix3, Vector3};

/// A URDF being written.
#[derive(Default)]
pub(crate) struct UrdfText {
    text: String,
}

/// A joint of a URDF.
pub(crate) struct UrdfJoint<'a> {
    pub(crate) name: &'a str,
    /// A type of URDF joints.
    pub(crate) kind: &'static str,
    pub(crate) parent: &'a str,
    pub(crate) child: &'a str,
    /// Pose of the child link at position 0, in the frame of the parent link.
    pub(crate) origin: Isometry3<f64>,
    pub(crate) axis: Vector3<f64>,
    /// Lower and upper limit. Unit: metres or radians.
    pub(crate) range: [f64; 2],
    pub(crate) effort: f64,
    pub(crate) velocity: f64,
    pub(crate) damping: f64,
    /// Unit: newtons or newton metres.
    pub(crate) friction: f64,
    /// The joint that it follows, with factor and offset.
    pub(crate) mimic: Option<(String, f64, f64)>,
}

/// The mass of a link. Frame: the link's.
pub(crate) struct Inertial {
    pub(crate) pose: Isometry3<f64>,
    pub(crate) kg: f64,
    /// About the centre of mass, along the axes of `pose`.
    pub(crate) about_com: Matrix3<f64>,
}

impl UrdfText {
    /// Writes a link with its mass and shapes, each an element of a `<geometry>` at a pose in the
    /// link's frame.
    pub(crate) fn link(
        &mut self,
        name: &str,
        inertial: Option<&Inertial>,
        solids: &[(Isometry3<f64>, String)],
    ) {
        let _ = writeln!(self.text, "  <link name=\"{}\">", escaped(name));
        if let Some(Inertial {
            pose,
            kg,
            about_com: i,
        }) = inertial
        {
            let _ = writeln!(
                self.text,
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
        for (pose, shape) in solids {
            let _ = writeln!(
                self.text,
                "    <collision>{}<geometry>{shape}</geometry></collision>",
                origin(pose)
            );
        }
        self.text.push_str("  </link>\n");
    }

    /// Writes a joint.
    pub(crate) fn joint(&mut self, joint: &UrdfJoint<'_>) {
        let UrdfJoint {
            kind,
            axis,
            range: [lower, upper],
            effort,
            velocity,
            damping,
            friction,
            ..
        } = joint;
        let _ = writeln!(
            self.text,
            "  <joint name=\"{}\" type=\"{kind}\">{}<parent link=\"{}\"/><child link=\"{}\"/>",
            escaped(joint.name),
            origin(&joint.origin),
            escaped(joint.parent),
            escaped(joint.child),
        );
        if !["fixed", "floating"].contains(kind) {
            let _ = writeln!(
                self.text,
                "    <axis xyz=\"{} {} {}\"/><limit lower=\"{lower}\" upper=\"{upper}\" effort=\"{effort}\" \
                 velocity=\"{velocity}\"/><dynamics damping=\"{damping}\"{}/>",
                axis.x,
                axis.y,
                axis.z,
                if *friction > 0.0 {
                    format!(" friction=\"{friction}\"")
                } else {
                    String::new()
                },
            );
        }
        if let Some((leader, factor, offset)) = &joint.mimic {
            let _ = writeln!(
                self.text,
                "    <mimic joint=\"{}\" multiplier=\"{factor}\" offset=\"{offset}\"/>",
                escaped(leader)
            );
        }
        self.text.push_str("  </joint>\n");
    }

    /// A link without mass and shapes, fixed to another at a pose in its frame.
    pub(crate) fn frame(&mut self, name: &str, parent: &str, pose: Isometry3<f64>) {
        self.link(name, None, &[]);
        self.joint(&UrdfJoint::fixed(
            &format!("{name}_fixed"),
            parent,
            name,
            pose,
        ));
    }

    /// Two links that pass through each other: the element of SRDF.
    pub(crate) fn passing(&mut self, links: [&str; 2]) {
        let [first, second] = links.map(escaped);
        let _ = writeln!(
            self.text,
            "  <disable_collisions link1=\"{first}\" link2=\"{second}\"/>"
        );
    }

    /// The whole text.
    pub(crate) fn finish(self, robot: &str) -> String {
        format!(
            "<robot name=\"{}\">\n{}</robot>\n",
            escaped(robot),
            self.text
        )
    }
}

impl<'a> UrdfJoint<'a> {
    pub(crate) fn fixed(
        name: &'a str,
        parent: &'a str,
        child: &'a str,
        origin: Isometry3<f64>,
    ) -> Self {
        Self {
            name,
            kind: "fixed",
            parent,
            child,
            origin,
            axis: Vector3::x(),
            range: [0.0; 2],
            effort: 0.0,
            velocity: 0.0,
            damping: 0.0,
            friction: 0.0,
            mimic: None,
        }
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
pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('"', "&quot;")
}
