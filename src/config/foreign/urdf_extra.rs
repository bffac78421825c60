//! Properties of objects in URDF that its standard lacks: PyBullet's `<contact>`, and the SDF in
//! `<gazebo>`.

use std::collections::BTreeMap;

use crate::foreign::body::Role;
use crate::foreign::elements::{Children, refuse_switch, refuse_unless};
use crate::foreign::sdf_link::check_drag;
use crate::foreign::sdf_surface::{Surface, drake_friction, isotropic};
use crate::foreign::xml::{self, Bound, Node, Reader};
use actcheck_base::Span;
use actcheck_data::TreeInertial;

pub(crate) const ROBOT: Children = Children {
    read: &["link", "joint", "material", "gazebo"],
    harmless: &["transmission", "sensor"],
    refused: &["loop_joint", "deformable"],
};
pub(crate) const LINK: Children = Children {
    read: &["inertial", "collision", "visual", "contact"],
    harmless: &["sensor", "self_collision_checking"],
    refused: &[],
};
pub(crate) const COLLISION: Children = Children {
    read: &[
        "origin",
        "geometry",
        "contact_coefficients",
        "drake_proximity_properties",
    ],
    harmless: &["material", "verbose"],
    refused: &[],
};
pub(crate) const INERTIAL: Children = Children {
    read: &["origin", "mass", "inertia"],
    harmless: &[],
    refused: &[],
};
/// Controllers and calibrations belong to motors, and the joints of objects have none.
pub(crate) const JOINT: Children = Children {
    read: &["origin", "parent", "child", "axis", "limit", "dynamics"],
    harmless: &["safety_controller", "calibration"],
    refused: &["mimic"],
};
/// Stiffness, damping and error correction are those of this simulation's own solver.
const CONTACT: Children = Children {
    read: &[
        "lateral_friction",
        "rolling_friction",
        "spinning_friction",
        "restitution",
        "inertia_scaling",
    ],
    harmless: &[
        "stiffness",
        "damping",
        "contact_cfm",
        "contact_erp",
        "friction_anchor",
    ],
    refused: &[],
};
/// The children of `<gazebo>` that name no part of the object.
const GAZEBO_WHOLE: Children = Children {
    read: &["static"],
    harmless: &["plugin", "allow_auto_disable"],
    refused: &["model", "include", "link", "joint"],
};
/// Of a link or a joint, each under the names of URDF and of SDF.
const GAZEBO_PART: Children = Children {
    read: &[
        "mu1",
        "mu2",
        "collision",
        "gravity",
        "turnGravityOff",
        "kinematic",
        "dampingFactor",
        "velocity_decay",
        "springStiffness",
        "springReference",
        "initial_joint_position",
        "selfCollide",
        "self_collide",
    ],
    harmless: &[
        "material",
        "visual",
        "sensor",
        "light",
        "plugin",
        "kp",
        "kd",
        "minDepth",
        "maxVel",
        "maxContacts",
        "laserRetro",
        "fdir1",
        "stopCfm",
        "stopErp",
        "fudgeFactor",
        "cfmDamping",
        "implicitSpringDamper",
        "provideFeedback",
        "preserveFixedJoint",
        "disableFixedJointLumping",
        "physics",
    ],
    refused: &["inertial", "axis"],
};
const OF_COLLISION: Children = Children {
    read: &["surface"],
    harmless: &["max_contacts", "laser_retro"],
    refused: &["pose", "geometry", "density"],
};

/// The `<gazebo>` elements of an object.
#[derive(Default)]
pub(crate) struct Extras {
    /// Whether the object never moves.
    pub(crate) is_static: bool,
    of_link: BTreeMap<String, Surface>,
    /// A switch by which links collide with each other.
    pub(crate) collides: Option<Span>,
}

/// The contact properties of a link.
#[derive(Default)]
pub(crate) struct Contact {
    surface: Surface,
    /// Factor of the moments of inertia.
    inertia_scaling: Option<f64>,
}

impl Extras {
    /// Reads all `<gazebo>` of an object. Reports those that can't be simulated (W035).
    pub(crate) fn of(root: Node, reader: &mut Reader) -> Self {
        let mut extras = Self::default();
        for gazebo in xml::children(root, "gazebo") {
            let Some(name) = gazebo.attribute("reference").map(str::trim) else {
                GAZEBO_WHOLE.check(gazebo, reader);
                if let Some(node) = xml::child(gazebo, "static") {
                    extras.is_static |= reader.boolean(node) == Some(true);
                }
                continue;
            };
            GAZEBO_PART.check(gazebo, reader);
            check_part(gazebo, reader);
            for name in ["selfCollide", "self_collide"] {
                if let Some(node) = xml::child(gazebo, name)
                    && reader.boolean(node) == Some(true)
                {
                    extras.collides = Some(xml::span(node));
                }
            }
            let surface = extras.of_link.entry(name.to_owned()).or_default();
            let friction = isotropic(gazebo, ["mu1", "mu2"], Role::Object, reader);
            let mut found = Surface {
                friction,
                ..Surface::default()
            };
            for collision in xml::children(gazebo, "collision") {
                OF_COLLISION.check(collision, reader);
                found = Surface::of(collision, Role::Object, reader).or(found);
            }
            *surface = found.or(*surface);
        }
        extras
    }

    /// Returns the contact properties of a link: those of its `<contact>`, or else those of
    /// `<gazebo>`.
    pub(crate) fn of_link(&self, link: Node, reader: &mut Reader) -> Contact {
        let of_gazebo = link
            .attribute("name")
            .and_then(|name| self.of_link.get(name))
            .copied()
            .unwrap_or_default();
        let Some(contact) = xml::child(link, "contact") else {
            return Contact {
                surface: of_gazebo,
                inertia_scaling: None,
            };
        };
        CONTACT.check(contact, reader);
        for name in ["rolling_friction", "spinning_friction"] {
            if let Some((node, value)) = value(contact, name, reader)
                && value != 0.0
            {
                let message = format!("`<{name}>` of {value} can't be simulated");
                reader.error("W035", node, message, "remove it, or write 0");
            }
        }
        let mut number = |name: &str| value(contact, name, reader).map(|(_, value)| value);
        let surface = Surface {
            friction: number("lateral_friction"),
            restitution: number("restitution").map(|value| value.min(1.0)),
        };
        Contact {
            inertia_scaling: number("inertia_scaling"),
            surface: surface.or(of_gazebo),
        }
    }
}

impl Contact {
    /// Returns the material of a collision of the link.
    pub(crate) fn of_collision(&self, collision: Node, reader: &mut Reader) -> Surface {
        let written = xml::child(collision, "contact_coefficients")
            .and_then(|node| Some((node, node.attribute("mu")?)));
        let friction = written.and_then(|(node, mu)| {
            let [mu] = reader.numbers::<1>(node, mu, Bound::NotNegative)?;
            Some(mu)
        });
        let own = Surface {
            friction: friction.or(drake_friction(collision, reader)),
            ..Surface::default()
        };
        own.or(self.surface)
    }

    /// Scales the moments of inertia of the link. Reports a factor without moments (W035).
    pub(crate) fn scale(&self, inertial: &mut TreeInertial, link: Node, reader: &mut Reader) {
        let Some(factor) = self.inertia_scaling.filter(|factor| *factor != 1.0) else {
            return;
        };
        if inertial.moments_place.is_none() {
            let message = "`<inertia_scaling>` needs an `<inertia>`".to_owned();
            let help = "add the moments of inertia, or remove the factor";
            reader.error("W035", link, message, help);
        }
        inertial.about_com *= factor;
    }
}

/// Reports properties of a link or a joint that can't be simulated.
fn check_part(gazebo: Node, reader: &mut Reader) {
    let why = "a link without gravity can't be simulated";
    refuse_switch(gazebo, "gravity", true, why, reader);
    refuse_switch(gazebo, "turnGravityOff", false, why, reader);
    let why = "a kinematic link can't be simulated";
    refuse_switch(gazebo, "kinematic", false, why, reader);
    let why = "there is no air drag";
    refuse_unless(gazebo, "dampingFactor", 0.0, why, reader);
    if let Some(decay) = xml::child(gazebo, "velocity_decay") {
        check_drag(decay, reader);
    }
    let why = "joints have no springs";
    refuse_unless(gazebo, "springStiffness", 0.0, why, reader);
    let why = "a joint begins at 0";
    refuse_unless(gazebo, "initial_joint_position", 0.0, why, reader);
}

/// Returns an element of `<contact>` and its `value`.
fn value<'a>(contact: Node<'a>, name: &str, reader: &mut Reader) -> Option<(Node<'a>, f64)> {
    let node = xml::child(contact, name)?;
    let written = reader.attribute(node, "value")?;
    let [value] = reader.numbers::<1>(node, written, Bound::NotNegative)?;
    Some((node, value))
}
