//! Writes a robot's tree as URDF: skills read only this format.

use nalgebra::Isometry3;
use urdf_rs::{
    Axis, Collision, Dynamics, Geometry, Inertia, Inertial, Joint, JointLimit, JointType, Link,
    LinkName, Mass, Mimic, Pose, Robot, Vec3, Visual,
};

use actcheck_data::{
    ModelTree, TreeGeometry, TreeInertial, TreeJoint, TreeLink, TreeMotion, TreeSolid,
};

/// Returns a robot as URDF. An ellipsoid becomes the box around it, which is its nearest shape
/// there.
///
/// # Errors
/// The library's fault, in words.
pub(crate) fn write(tree: &ModelTree) -> Result<String, urdf_rs::UrdfError> {
    urdf_rs::write_to_string(&Robot {
        name: tree.name.clone(),
        version: None,
        links: tree.links.iter().map(link).collect(),
        joints: tree.joints.iter().map(joint).collect(),
        materials: Vec::new(),
    })
}

fn link(link: &TreeLink) -> Link {
    let visual = |solid: &TreeSolid| Visual {
        name: None,
        origin: pose(&solid.pose),
        geometry: geometry(&solid.geometry),
        material: None,
    };
    let collision = |solid: &TreeSolid| Collision {
        name: None,
        origin: pose(&solid.pose),
        geometry: geometry(&solid.geometry),
    };
    Link {
        name: link.name.clone(),
        inertial: link.inertial.as_ref().map(inertial).unwrap_or_default(),
        visual: link.visuals.iter().map(visual).collect(),
        collision: link.solids.iter().map(collision).collect(),
    }
}

fn inertial(stated: &TreeInertial) -> Inertial {
    let i = &stated.about_com;
    Inertial {
        origin: pose(&stated.pose),
        mass: Mass { value: stated.kg },
        inertia: Inertia {
            ixx: i[(0, 0)],
            ixy: i[(0, 1)],
            ixz: i[(0, 2)],
            iyy: i[(1, 1)],
            iyz: i[(1, 2)],
            izz: i[(2, 2)],
        },
    }
}

fn joint(joint: &TreeJoint) -> Joint {
    // A joint without limits has none in URDF: its type says so.
    let finite = |limit: f64| if limit.is_finite() { limit } else { 0.0 };
    Joint {
        name: joint.name.clone(),
        joint_type: match joint.motion {
            TreeMotion::Fixed | TreeMotion::Unknown => JointType::Fixed,
            TreeMotion::Revolute => JointType::Revolute,
            TreeMotion::Continuous => JointType::Continuous,
            TreeMotion::Prismatic => JointType::Prismatic,
            TreeMotion::Planar => JointType::Planar,
            TreeMotion::Floating => JointType::Floating,
        },
        origin: pose(&joint.origin),
        parent: LinkName {
            link: joint.parent.clone(),
        },
        child: LinkName {
            link: joint.child.clone(),
        },
        axis: Axis {
            xyz: Vec3(joint.axis.into()),
        },
        limit: JointLimit {
            lower: finite(joint.lower),
            upper: finite(joint.upper),
            effort: joint.effort,
            velocity: joint.velocity,
            ..JointLimit::default()
        },
        calibration: None,
        dynamics: Some(Dynamics {
            damping: joint.damping,
            friction: joint.friction,
        }),
        mimic: joint.mimic.as_ref().map(|mimic| Mimic {
            joint: mimic.leader.clone(),
            multiplier: Some(mimic.factor),
            offset: Some(mimic.offset),
        }),
        safety_controller: None,
    }
}

fn geometry(geometry: &TreeGeometry) -> Geometry {
    match geometry {
        TreeGeometry::Box { size } => Geometry::Box { size: Vec3(*size) },
        TreeGeometry::Cylinder { radius, length } => Geometry::Cylinder {
            radius: *radius,
            length: *length,
        },
        TreeGeometry::Sphere { radius } => Geometry::Sphere { radius: *radius },
        TreeGeometry::Capsule { radius, length } => Geometry::Capsule {
            radius: *radius,
            length: *length,
        },
        TreeGeometry::Ellipsoid { radii } => Geometry::Box {
            size: Vec3(radii.map(|radius| 2.0 * radius)),
        },
        TreeGeometry::Mesh { file, scale } => Geometry::Mesh {
            filename: file.clone(),
            scale: Some(Vec3(*scale)),
        },
    }
}

fn pose(pose: &Isometry3<f64>) -> Pose {
    let (roll, pitch, yaw) = pose.rotation.euler_angles();
    Pose {
        xyz: Vec3(pose.translation.vector.into()),
        rpy: Vec3([roll, pitch, yaw]),
    }
}
