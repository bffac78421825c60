//! Masks of collisions of geoms in MJCF, and masses and friction of objects, which URDF can't
//! state.

use crate::foreign::mjcf::DENSITY;
use crate::foreign::mjcf_compiler::{Attributes, Compiler};
use crate::foreign::urdf::{Materials, Matter};
use crate::foreign::xml::{self, Node};

/// Whether a geom can touch others.
pub(super) fn collides(attributes: &Attributes<'_>) -> bool {
    attributes.get("contype") != Some("0") || attributes.get("conaffinity") != Some("0")
}

/// The bits of a geom that decide about its collisions: `contype` and `conaffinity`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Mask {
    kinds: u32,
    with: u32,
}

impl Mask {
    pub(super) fn of(attributes: &Attributes<'_>) -> Self {
        let bits = |name: &str| {
            attributes
                .get(name)
                .and_then(|text| text.parse().ok())
                .unwrap_or(1)
        };
        Self {
            kinds: bits("contype"),
            with: bits("conaffinity"),
        }
    }

    /// Whether two geoms collide.
    pub(super) fn meets(self, other: Self) -> bool {
        self.kinds & other.with != 0 || other.kinds & self.with != 0
    }
}

impl Materials {
    /// Adds a body without `<inertial>`: its mass, if all of its geoms state theirs, otherwise its
    /// density.
    pub(super) fn add(&mut self, name: &str, body: Node, compiler: &Compiler, class: Option<&str>) {
        let geoms: Vec<Node> = xml::children(body, "geom").collect();
        let number = |geom: &Node, name: &str| {
            let attributes = compiler.attributes(*geom, class);
            let of_vector = attributes
                .get(name)
                .and_then(|text| text.split_whitespace().next()?.parse::<f64>().ok());
            of_vector
                .filter(|_| collides(&attributes))
                .filter(|number| *number >= 0.0 && number.is_finite())
        };
        let solid: Vec<&Node> = geoms
            .iter()
            .filter(|geom| collides(&compiler.attributes(**geom, class)))
            .collect();
        let masses: Option<Vec<f64>> = solid.iter().map(|geom| number(geom, "mass")).collect();
        let kg = masses
            .map(|masses| masses.iter().sum::<f64>())
            .filter(|kg| *kg > 0.0);
        let density = solid
            .iter()
            .find_map(|geom| number(geom, "density"))
            .filter(|density| *density > 0.0);
        let matter = kg.map_or(Matter::Density(density.unwrap_or(DENSITY)), Matter::Mass);
        self.of_link.insert(name.to_owned(), matter);
        let friction = solid
            .iter()
            .filter_map(|geom| number(geom, "friction"))
            .reduce(f64::max);
        self.friction = self.friction.into_iter().chain(friction).reduce(f64::max);
    }
}
