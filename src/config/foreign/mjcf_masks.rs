//! Which bodies of MJCF collide with each other.

use std::collections::{BTreeMap, BTreeSet};

use crate::foreign::mjcf_compiler::{Compiler, MjcfAttributes};
use crate::foreign::mjcf_couplings::elements;
use crate::foreign::xml::{Node, Reader};

/// Whether a geom can touch others.
pub(super) fn collides(attributes: &MjcfAttributes<'_>, compiler: &Compiler) -> bool {
    let is_solid = Mask::of(attributes) != Mask::default();
    is_solid
        || attributes
            .get("name")
            .is_some_and(|name| compiler.paired.contains(name))
}

/// The bits of a geom that decide about its collisions: `contype` and `conaffinity`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Mask {
    kinds: i32,
    with: i32,
}

impl Mask {
    pub(super) fn of(attributes: &MjcfAttributes<'_>) -> Self {
        let bits = |name: &str| {
            let written = attributes.get(name).and_then(|text| text.parse().ok());
            written.unwrap_or(1)
        };
        Self {
            kinds: bits("contype"),
            with: bits("conaffinity"),
        }
    }

    /// Reports masks that are not whole numbers of 32 bits (W034).
    pub(super) fn check(geom: Node, attributes: &MjcfAttributes<'_>, reader: &mut Reader) {
        for name in ["contype", "conaffinity"] {
            let is_mask = |text: &str| text.parse::<i32>().is_ok();
            if let Some(text) = attributes.get(name).filter(|text| !is_mask(text)) {
                let message =
                    format!("`{name}` must be a whole number of 32 bits, but is `{text}`");
                let help = "write -1 for all bits, or 0 for none";
                reader.error("W034", geom, message, help);
            }
        }
    }

    /// Whether two geoms collide.
    pub(super) fn meets(self, other: Self) -> bool {
        self.kinds & other.with != 0 || other.kinds & self.with != 0
    }
}

/// Two bodies, by the names of their links in order.
type Pair = [String; 2];

/// The settings of a model for the contacts of its bodies.
#[derive(Debug, Clone, Default)]
pub(super) struct Contacts {
    /// The masks of each body's colliding geoms.
    pub(super) masks: BTreeMap<String, BTreeSet<Mask>>,
    /// The body of each geom with a name.
    pub(super) bodies: BTreeMap<String, String>,
    /// Bodies that a `<pair>` of their geoms lets collide, whatever else is said.
    paired: BTreeSet<Pair>,
    /// Bodies that `<exclude>` names.
    excluded: BTreeSet<Pair>,
}

impl Contacts {
    /// Adds the settings in the sections `<contact>` of a file for bodies that are known, and warns
    /// of other bodies (W036).
    pub(super) fn read(
        &mut self,
        root: Node,
        is_known: impl Fn(&str) -> bool,
        reader: &mut Reader,
    ) {
        for contact in elements(root, "contact") {
            let keys = match contact.tag_name().name() {
                "exclude" => ["body1", "body2"],
                "pair" => ["geom1", "geom2"],
                _ => continue,
            };
            let [Some(one), Some(other)] = keys.map(|key| contact.attribute(key)) else {
                continue;
            };
            let is_pair = keys[0] == "geom1";
            let body = |name: &str| {
                if is_pair {
                    return self.bodies.get(name).cloned();
                }
                is_known(name).then(|| name.to_owned())
            };
            let unknown = [one, other].into_iter().find(|name| body(name).is_none());
            let (Some(one), Some(other)) = (body(one), body(other)) else {
                let name = unknown.unwrap_or_default();
                let what = if is_pair { "geom" } else { "body" };
                let message = format!("this contact is left out: the model has no {what} `{name}`");
                let help = "copies have their number at the end of their name";
                reader.warning("W036", contact, message, help);
                continue;
            };
            let pair = if one <= other {
                [one, other]
            } else {
                [other, one]
            };
            if is_pair {
                self.paired.insert(pair);
            } else {
                self.excluded.insert(pair);
            }
        }
    }

    /// Adds those of an attached model, whose names have another beginning here.
    pub(super) fn attach(&mut self, other: Self, prefix: &str) {
        let named = |name: String| format!("{prefix}{name}");
        let pairs = |pairs: BTreeSet<Pair>| pairs.into_iter().map(move |pair| pair.map(named));
        let masks = other.masks.into_iter();
        self.masks
            .extend(masks.map(|(body, masks)| (named(body), masks)));
        let bodies = other.bodies.into_iter();
        self.bodies
            .extend(bodies.map(|(geom, body)| (named(geom), named(body))));
        self.paired.extend(pairs(other.paired));
        self.excluded.extend(pairs(other.excluded));
    }

    /// Returns the pairs of bodies that pass through each other: those that `<exclude>` names, and
    /// those whose geoms never meet, but for those that a `<pair>` lets collide.
    pub(super) fn passing(&self, is_known: impl Fn(&str) -> bool) -> BTreeSet<Pair> {
        let mut passing = self.excluded.clone();
        let solid: Vec<(&String, &BTreeSet<Mask>)> = self
            .masks
            .iter()
            .filter(|(_, masks)| !masks.is_empty())
            .collect();
        for (idx, (first, of_first)) in solid.iter().enumerate() {
            for (second, of_second) in &solid[idx + 1..] {
                let mut pairs = of_first
                    .iter()
                    .flat_map(|one| of_second.iter().map(move |other| (*one, *other)));
                if !pairs.any(|(one, other)| one.meets(other)) {
                    passing.insert([(*first).clone(), (*second).clone()]);
                }
            }
        }
        passing
            .retain(|pair| !self.paired.contains(pair) && pair.iter().all(|body| is_known(body)));
        passing
    }
}
