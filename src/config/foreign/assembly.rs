//! The bodies that the links of an object form: those joined by fixed joints move as one, and all
//! other joints move a body.

use std::collections::{BTreeSet, VecDeque};

use crate::foreign::body::{Body, MovingBody};
use crate::foreign::words::words_at;
use crate::foreign::xml;
use actcheck_base::{Diagnostic, Diagnostics, SourceSpan};
use actcheck_data::PartJoint;

/// A joint between two links, by their indices.
pub(crate) struct Join {
    pub(crate) place: SourceSpan,
    pub(crate) parent: usize,
    pub(crate) child: usize,
    /// `None` if it is fixed.
    pub(crate) joint: Option<PartJoint>,
}

/// The body of each link, and the joint that moves each body. Body 0 is the object itself; each of
/// the others comes after the one that carries it.
pub(crate) struct Assembly {
    bodies: Vec<usize>,
    moved: Vec<Moved>,
}

/// A body that a joint moves.
struct Moved {
    place: SourceSpan,
    carrier: usize,
    /// A link of it.
    link: usize,
    joint: PartJoint,
}

impl Assembly {
    /// Finds the bodies of links. Reports W035 if two joints move one body or joints form a cycle;
    /// then all links are one.
    pub(crate) fn of(n_links: usize, joins: &[Join], found: &mut Diagnostics) -> Self {
        let rigid = Self {
            bodies: vec![0; n_links],
            moved: Vec::new(),
        };
        let mut groups: Vec<usize> = (0..n_links).collect();
        for join in joins.iter().filter(|join| join.joint.is_none()) {
            let (from, to) = (groups[join.child], groups[join.parent]);
            groups
                .iter_mut()
                .filter(|group| **group == from)
                .for_each(|group| *group = to);
        }
        let moving: Vec<(&Join, PartJoint)> = joins
            .iter()
            .filter_map(|join| join.joint.map(|joint| (join, joint)))
            .collect();
        let mut driven = BTreeSet::new();
        let twice = moving
            .iter()
            .filter(|(join, _)| !driven.insert(groups[join.child]));
        let twice: Vec<&Join> = twice.map(|(join, _)| *join).collect();
        for join in &twice {
            let message = "two joints move the same links";
            let help = "links form one tree: remove one of the joints";
            found.push(fault(Diagnostic::error("W035", message), &join.place, help));
        }
        if !twice.is_empty() {
            return rigid;
        }
        // All links that no joint moves are the object itself.
        let mut bodies: Vec<Option<usize>> = groups
            .iter()
            .map(|group| (!driven.contains(group)).then_some(0))
            .collect();
        let (mut moved, mut left): (Vec<Moved>, VecDeque<_>) =
            (Vec::new(), moving.iter().collect());
        let mut tries = left.len();
        while let Some(next @ (join, joint)) = left.pop_front() {
            if let Some(carrier) = bodies[join.parent] {
                moved.push(Moved {
                    place: join.place.clone(),
                    carrier,
                    link: join.child,
                    joint: *joint,
                });
                let of_child = |link: &usize| groups[*link] == groups[join.child];
                (0..n_links)
                    .filter(of_child)
                    .for_each(|link| bodies[link] = Some(moved.len()));
                tries = left.len();
            } else if tries > 0 {
                tries -= 1;
                left.push_back(next);
            } else {
                let error = Diagnostic::error("W035", "the joints form a cycle");
                found.push(fault(error, &join.place, "links form one tree"));
                return rigid;
            }
        }
        Self {
            bodies: bodies.into_iter().map(Option::unwrap_or_default).collect(),
            moved,
        }
    }

    /// Returns bodies without shapes, one for each.
    pub(crate) fn empty_bodies(&self, fixed: bool) -> Vec<Body> {
        let empty = |idx| Body {
            fixed: fixed && idx == 0,
            ..Body::default()
        };
        (0..=self.moved.len()).map(empty).collect()
    }

    /// Returns the body of a link, by its index.
    pub(crate) fn body_of(&self, link: usize) -> usize {
        self.bodies[link]
    }

    /// Attaches the bodies that joints move to the first. `names` are those of the links. A body
    /// without shapes is left out with a warning (W036), or refused if it carries others (W035).
    /// Also returns the moving part that each body became; `None` for the first and those left out.
    pub(crate) fn attach(
        &self,
        bodies: Vec<Body>,
        names: &[&str],
        found: &mut Diagnostics,
    ) -> (Body, Vec<Option<usize>>) {
        let mut bodies = bodies.into_iter();
        let mut whole = bodies.next().unwrap_or_default();
        let mut parts: Vec<Option<usize>> = vec![None];
        for (idx, (moved, body)) in self.moved.iter().zip(bodies).enumerate() {
            let link = names[moved.link];
            if body.parts.is_empty() {
                let solid = words_at(&moved.place).solid;
                let message = format!("the link `{link}` has no {solid}");
                if self.moved.iter().any(|other| other.carrier == idx + 1) {
                    let help = "a link that a joint moves and that carries others needs one";
                    found.push(fault(
                        Diagnostic::error("W035", message),
                        &moved.place,
                        help,
                    ));
                } else {
                    let help = "the link is left out: nothing can touch it";
                    found.push(fault(
                        Diagnostic::warning("W036", message),
                        &moved.place,
                        help,
                    ));
                }
                parts.push(None);
                continue;
            }
            let name = free_name(link, &whole.moving);
            parts.push(Some(whole.moving.len()));
            whole.moving.push(MovingBody {
                name,
                body,
                on: parts[moved.carrier],
                joint: moved.joint,
            });
        }
        (whole, parts)
    }
}

fn fault(fault: Diagnostic, at: &SourceSpan, help: &str) -> Diagnostic {
    fault.at(&at.source, xml::tag(at)).help(help)
}

/// Returns a name for a part: letters and digits of that of its link, with a number if it is taken.
pub(crate) fn free_name(link: &str, taken: &[MovingBody]) -> String {
    let plain: String = link
        .chars()
        .map(|letter| {
            if letter.is_ascii_alphanumeric() {
                letter
            } else {
                '_'
            }
        })
        .collect();
    let plain = if plain.is_empty() {
        "part".to_owned()
    } else {
        plain
    };
    let is_free = |name: &String| taken.iter().all(|part| part.name != *name);
    let numbered = (2..).map(|number| format!("{plain}_{number}"));
    std::iter::once(plain.clone())
        .chain(numbered)
        .find(is_free)
        .unwrap_or_default()
}
