//! Reads the `<surface>` of a collision in SDF: friction and restitution.

use crate::foreign::body::{Body, FRICTION, Role};
use crate::foreign::elements::{Children, refuse_switch, refuse_unless, warn_unless};
use crate::foreign::xml::{self, Bound, Node, Reader};
use actcheck_base::Span;

const SURFACE: Children = Children {
    read: &["friction", "bounce", "contact"],
    // Links are rigid.
    harmless: &["soft_contact"],
    refused: &[],
};
const COEFFICIENTS: Children = Children {
    read: &["ode", "bullet", "torsional"],
    harmless: &[],
    refused: &[],
};
const ODE: Children = Children {
    read: &["mu", "mu2", "fdir1", "slip1", "slip2"],
    harmless: &[],
    refused: &[],
};
const BULLET: Children = Children {
    read: &["friction", "friction2", "fdir1", "rolling_friction"],
    harmless: &[],
    refused: &[],
};
const TORSIONAL: Children = Children {
    read: &[
        "coefficient",
        "use_patch_radius",
        "patch_radius",
        "surface_radius",
        "ode",
    ],
    harmless: &[],
    refused: &[],
};
const BOUNCE: Children = Children {
    read: &["restitution_coefficient", "threshold"],
    harmless: &[],
    refused: &[],
};
/// Stiffness, damping and error correction are those of this simulation's own solver.
const CONTACT: Children = Children {
    read: &[
        "collide_without_contact",
        "collide_without_contact_bitmask",
        "collide_bitmask",
        "category_bitmask",
    ],
    harmless: &["ode", "bullet", "poissons_ratio", "elastic_modulus"],
    refused: &[],
};
/// Bodies have this category unless they state another.
const USUAL_CATEGORY: u32 = 0xffff;
const NO_SLIP: &str = "contacts do not slip under a force";
/// Slower impacts do not bounce anyway. Unit: m/s.
const SLOW: f64 = 0.05;
/// No impact of a scene is faster. Unit: m/s.
const FASTEST: f64 = 10.0;

/// Friction and restitution of a collision, as far as its file states them.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Surface {
    pub(crate) friction: Option<f64>,
    pub(crate) restitution: Option<f64>,
}

impl Surface {
    /// Reads the `<surface>` of a collision. Reports values that can't be simulated (W035).
    pub(crate) fn of(collision: Node, role: Role, reader: &mut Reader) -> Self {
        let of_drake = Self {
            friction: drake_friction(collision, reader),
            ..Self::default()
        };
        let Some(surface) = xml::child(collision, "surface") else {
            return of_drake;
        };
        SURFACE.check(surface, reader);
        if let Some(contact) = xml::child(surface, "contact") {
            check_contact(contact, reader);
        }
        Self {
            friction: xml::child(surface, "friction")
                .and_then(|friction| coefficient(friction, role, reader)),
            restitution: xml::child(surface, "bounce")
                .and_then(|bounce| restitution(bounce, reader)),
        }
        .or(of_drake)
    }

    /// Fills gaps with the values of another surface.
    pub(crate) fn or(self, other: Self) -> Self {
        Self {
            friction: self.friction.or(other.friction),
            restitution: self.restitution.or(other.restitution),
        }
    }

    /// Gives a body the material of one of its collisions.
    pub(crate) fn add_to(self, body: &mut Body, node: Node, role: Role, reader: &mut Reader) {
        self.check(body, xml::span(node), role, reader);
        body.has_usual_friction |= self.friction.is_none();
        body.friction = body.friction.or(self.friction);
        body.restitution = body.restitution.or(self.restitution);
    }

    /// Compares the material with that of a body. A body has a single material: another value is an
    /// error of an object (W035), and ignored with a warning in a world (W036).
    pub(crate) fn check(self, body: &Body, at: Span, role: Role, reader: &mut Reader) {
        for (property, known, other) in [
            ("friction", body.friction, self.friction),
            ("restitution", body.restitution, self.restitution),
        ] {
            if let (Some(known), Some(other)) = (known, other)
                && known != other
            {
                let message =
                    format!("a body has only one {property}, but this has {known} and {other}");
                let help = "give all its collisions the same value, or split it into two models";
                differs(at.clone(), message, help, role, reader);
            }
        }
    }
}

/// Warns of collisions that state no friction and get that of the others of their body (W036).
pub(crate) fn warn_of_usual_friction(body: &Body, at: Span, reader: &mut Reader) {
    if let Some(friction) = body.friction.filter(|friction| *friction != FRICTION)
        && body.has_usual_friction
    {
        let message = format!(
            "a body has only one friction: {friction} is used also for collisions that state none"
        );
        let help = format!("the default is {FRICTION}: give all collisions the same value");
        reader.warning_at("W036", at, message, help);
    }
}

/// Reports links that collide with each other (W035), if joints move some of them.
pub(crate) fn refuse_self_collision(body: &Body, at: Option<Span>, reader: &mut Reader) {
    if let Some(at) = at.filter(|_| !body.moving.is_empty()) {
        let message = "parts of one model that collide with each other can't be simulated";
        let help = "write false: they pass through each other";
        reader.error_at("W035", at, message.to_owned(), help);
    }
}

/// Reports a difference from the file: an error of an object; in a world, where nothing moves, a
/// warning.
fn differs(at: Span, message: String, help: &str, role: Role, reader: &mut Reader) {
    match role {
        Role::Object => reader.error_at("W035", at, message, help),
        Role::Furniture => {
            reader.warning_at("W036", at, format!("{message}: the first is used"), help);
        }
    }
}

/// Returns a child whose name has a prefix, declared or not.
pub(crate) fn prefixed<'a>(node: Node<'a>, prefix: &str, name: &str) -> Option<Node<'a>> {
    let joined = format!("{prefix}_{name}");
    let is_named = |child: &Node| {
        let tag = child.tag_name();
        tag.name() == joined || (tag.name() == name && tag.namespace().is_some())
    };
    node.children().find(is_named)
}

/// Returns the coefficient of sliding friction in Drake's `<drake:proximity_properties>`, of which
/// SDF has texts and URDF has attributes.
pub(crate) fn drake_friction(collision: Node, reader: &mut Reader) -> Option<f64> {
    let properties = prefixed(collision, "drake", "proximity_properties")?;
    let of = |name| prefixed(properties, "drake", name);
    let node = of("mu_dynamic").or_else(|| of("mu_static"))?;
    let written = node.attribute("value").unwrap_or(xml::text(node));
    let [friction] = reader.numbers::<1>(node, written, Bound::NotNegative)?;
    Some(friction)
}

/// Returns the coefficient of sliding friction: that for ODE, or else that for Bullet.
fn coefficient(friction: Node, role: Role, reader: &mut Reader) -> Option<f64> {
    COEFFICIENTS.check(friction, reader);
    if let Some(torsional) = xml::child(friction, "torsional") {
        check_torsional(torsional, role, reader);
    }
    let mut found = None;
    if let Some(ode) = xml::child(friction, "ode") {
        ODE.check(ode, reader);
        warn_unless(ode, "slip1", 0.0, NO_SLIP, reader);
        warn_unless(ode, "slip2", 0.0, NO_SLIP, reader);
        found = isotropic(ode, ["mu", "mu2"], role, reader);
    }
    if let Some(bullet) = xml::child(friction, "bullet") {
        BULLET.check(bullet, reader);
        let why = "rolling bodies have no friction of their own";
        refuse_unless(bullet, "rolling_friction", 0.0, why, reader);
        let other = isotropic(bullet, ["friction", "friction2"], role, reader);
        if let (Some(ode), Some(bullet_value)) = (found, other)
            && ode != bullet_value
        {
            let message = format!("the friction for ODE, {ode}, is used, not {bullet_value}");
            reader.warning("W036", bullet, message, "give both the same value");
        }
        found = found.or(other);
    }
    found
}

/// Returns the friction along the first direction. Another one across is reported.
pub(crate) fn isotropic(
    parent: Node,
    names: [&str; 2],
    role: Role,
    reader: &mut Reader,
) -> Option<f64> {
    let [along, across] = names.map(|name| {
        let node = xml::child(parent, name)?;
        reader.number(node, Bound::NotNegative)
    });
    if let (Some(along), Some(across)) = (along, across)
        && along != across
    {
        let message =
            format!("friction can't depend on the direction, but is {along} and {across}");
        let help = format!("give `<{}>` and `<{}>` the same value", names[0], names[1]);
        differs(xml::span(parent), message, &help, role, reader);
    }
    along.or(across)
}

/// Reports friction against turning on the spot, unless it is zero: the simulation has none at a
/// point. It is an error of an object (W035), and ignored with a warning elsewhere (W036).
fn check_torsional(torsional: Node, role: Role, reader: &mut Reader) {
    TORSIONAL.check(torsional, reader);
    if let Some(ode) = xml::child(torsional, "ode") {
        warn_unless(ode, "slip", 0.0, NO_SLIP, reader);
    }
    let by_patch = match xml::child(torsional, "use_patch_radius") {
        Some(node) => reader.boolean(node),
        None => Some(true),
    };
    let mut number = |name: &str, usual: f64| match xml::child(torsional, name) {
        Some(node) => reader.number(node, Bound::NotNegative),
        None => Some(usual),
    };
    let values = (
        number("coefficient", 1.0),
        number("patch_radius", 0.0),
        number("surface_radius", 0.0),
    );
    let (Some(by_patch), (Some(coefficient), Some(patch), Some(surface))) = (by_patch, values)
    else {
        return;
    };
    let radius = if by_patch { patch } else { surface };
    if coefficient * radius > 0.0 {
        let message = format!("torsional friction of {coefficient} can't be simulated");
        let help = "write `<coefficient>0</coefficient>`, or remove `<torsional>`";
        match role {
            Role::Object => reader.error("W035", torsional, message, help),
            Role::Furniture => reader.warning("W036", torsional, message, help),
        }
    }
}

/// Reads the restitution. An impact that is slower than the threshold does not bounce.
fn restitution(bounce: Node, reader: &mut Reader) -> Option<f64> {
    BOUNCE.check(bounce, reader);
    let coefficient = xml::child(bounce, "restitution_coefficient")?;
    let value = reader.number(coefficient, Bound::NotNegative)?.min(1.0);
    let Some(node) = xml::child(bounce, "threshold") else {
        return Some(value);
    };
    let threshold = reader.number(node, Bound::NotNegative)?;
    if value == 0.0 || threshold <= SLOW {
        return Some(value);
    }
    if threshold >= FASTEST {
        return Some(0.0);
    }
    let message = format!("bouncing only from {threshold} m/s on can't be simulated");
    let help = "write 0 for bodies that always bounce, or remove `<bounce>`";
    reader.error("W035", node, message, help);
    None
}

/// Reports collisions that touch nothing (W035).
fn check_contact(contact: Node, reader: &mut Reader) {
    CONTACT.check(contact, reader);
    let why = "a collision without contact forces can't be simulated";
    refuse_switch(contact, "collide_without_contact", false, why, reader);
    for name in ["collide_bitmask", "category_bitmask"] {
        let Some(node) = xml::child(contact, name) else {
            continue;
        };
        let text = xml::text(node);
        let mask = match text.strip_prefix("0x").or(text.strip_prefix("0X")) {
            Some(digits) => u32::from_str_radix(digits, 16).ok(),
            None => text.parse().ok(),
        };
        match mask {
            Some(mask) if mask & USUAL_CATEGORY != 0 => {}
            Some(_) => {
                let message = "a collision that touches nothing can't be simulated".to_owned();
                let help = "remove the `<collision>`, or its bit mask";
                reader.error("W035", node, message, help);
            }
            None => {
                let message = format!("`<{name}>` must be a whole number");
                reader.error("W034", node, message, "write, for example, 0xffff");
            }
        }
    }
}
