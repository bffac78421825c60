//! Comparison of tuples whose nulls (`_:0`) may have other labels.

use std::collections::hash_map::DefaultHasher;
use std::collections::{BTreeMap, BTreeSet};
use std::hash::{Hash, Hasher};

/// Tuples: a predicate with its values as text. Those that begin with `_:` are nulls.
pub type Facts = BTreeSet<(String, Vec<String>)>;

fn is_null(value: &str) -> bool {
    value.starts_with("_:")
}

fn nulls(facts: &Facts) -> BTreeSet<&str> {
    facts
        .iter()
        .flat_map(|(_, row)| row)
        .map(String::as_str)
        .filter(|value| is_null(value))
        .collect()
}

fn renamed(facts: &Facts, names: &BTreeMap<&str, u64>) -> Facts {
    let name = |value: &String| {
        names
            .get(value.as_str())
            .map_or(value.clone(), |name| format!("_:{name}"))
    };
    facts
        .iter()
        .map(|(predicate, row)| (predicate.clone(), row.iter().map(name).collect()))
        .collect()
}

/// Refines colours of nulls by the tuples in which they occur, until there are no more classes.
fn refined<'f>(facts: &'f Facts, mut colours: BTreeMap<&'f str, u64>) -> BTreeMap<&'f str, u64> {
    loop {
        let mut seen: BTreeMap<&str, Vec<u64>> = BTreeMap::new();
        for (predicate, row) in facts {
            for (place, value) in row.iter().enumerate().filter(|(_, value)| is_null(value)) {
                let mut hasher = DefaultHasher::new();
                (predicate, place).hash(&mut hasher);
                for other in row {
                    match colours.get(other.as_str()) {
                        Some(colour) => (colour, other == value).hash(&mut hasher),
                        None => other.hash(&mut hasher),
                    }
                }
                seen.entry(value).or_default().push(hasher.finish());
            }
        }
        let next: BTreeMap<&str, u64> = seen
            .into_iter()
            .map(|(null, mut places)| {
                places.sort_unstable();
                let mut hasher = DefaultHasher::new();
                (colours[null], places).hash(&mut hasher);
                (null, hasher.finish())
            })
            .collect();
        let classes =
            |colours: &BTreeMap<&str, u64>| colours.values().collect::<BTreeSet<_>>().len();
        if classes(&next) == classes(&colours) {
            return next;
        }
        colours = next;
    }
}

/// Whether two sets of tuples are equal up to the labels of their nulls.
pub fn are_isomorphic(left: &Facts, right: &Facts) -> bool {
    fn matched(
        left: &Facts,
        right: &Facts,
        of_left: BTreeMap<&str, u64>,
        of_right: BTreeMap<&str, u64>,
    ) -> bool {
        let (of_left, of_right) = (refined(left, of_left), refined(right, of_right));
        let sorted = |colours: &BTreeMap<&str, u64>| {
            let mut list: Vec<u64> = colours.values().copied().collect();
            list.sort_unstable();
            list
        };
        if sorted(&of_left) != sorted(&of_right) {
            return false;
        }
        let same = sorted(&of_left)
            .windows(2)
            .find(|pair| pair[0] == pair[1])
            .map(|pair| pair[0]);
        let Some(colour) = same else {
            return renamed(left, &of_left) == renamed(right, &of_right);
        };
        // One of several alike gets a colour of its own, and each of the other side is tried for
        // it.
        let mut chosen = of_left.clone();
        let first = of_left
            .iter()
            .find(|(_, of)| **of == colour)
            .map(|(null, _)| *null)
            .unwrap();
        chosen.insert(first, colour ^ 1);
        let alike: Vec<&str> = of_right
            .iter()
            .filter(|(_, of)| **of == colour)
            .map(|(null, _)| *null)
            .collect();
        alike.into_iter().any(|null| {
            let mut other = of_right.clone();
            other.insert(null, colour ^ 1);
            matched(left, right, chosen.clone(), other)
        })
    }
    let start = |facts| nulls(facts).into_iter().map(|null| (null, 0)).collect();
    left.len() == right.len() && matched(left, right, start(left), start(right))
}

/// Whether the nulls of some tuples can be replaced by values so that all tuples are among others.
pub fn maps_into(facts: &Facts, others: &Facts) -> bool {
    fn found<'f>(
        left: &[&'f (String, Vec<String>)],
        others: &'f Facts,
        images: &mut BTreeMap<&'f str, &'f str>,
    ) -> bool {
        let known = |fact: &(String, Vec<String>), images: &BTreeMap<&str, &str>| {
            fact.1
                .iter()
                .filter(|value| is_null(value) && !images.contains_key(value.as_str()))
                .count()
        };
        let Some(at) = (0..left.len()).min_by_key(|at| known(left[*at], images)) else {
            return true;
        };
        let fact = left[at];
        let rest: Vec<_> = left
            .iter()
            .enumerate()
            .filter(|(other, _)| *other != at)
            .map(|(_, fact)| *fact)
            .collect();
        others
            .iter()
            .filter(|other| other.0 == fact.0)
            .any(|other| {
                let before = images.clone();
                let fits = fact
                    .1
                    .iter()
                    .zip(&other.1)
                    .all(|(value, image)| match is_null(value) {
                        true => *images.entry(value).or_insert(image) == image.as_str(),
                        false => value == image,
                    });
                if fits && found(&rest, others, images) {
                    return true;
                }
                *images = before;
                false
            })
    }
    let open: Vec<_> = facts
        .iter()
        .filter(|fact| !others.contains(fact) || fact.1.iter().any(|v| is_null(v)))
        .collect();
    found(&open, others, &mut BTreeMap::new())
}

#[test]
fn labels_of_nulls_do_not_matter() {
    let facts = |rows: &[&[&str]]| -> Facts {
        rows.iter()
            .map(|row| {
                (
                    "p".to_owned(),
                    row.iter().map(|value| (*value).to_owned()).collect(),
                )
            })
            .collect()
    };
    let cycle = facts(&[&["_:0", "_:1"], &["_:1", "_:2"], &["_:2", "_:0"]]);
    let turned = facts(&[&["_:7", "_:5"], &["_:5", "_:6"], &["_:6", "_:7"]]);
    let path = facts(&[&["_:0", "_:1"], &["_:1", "_:2"], &["_:0", "_:2"]]);
    assert!(are_isomorphic(&cycle, &turned));
    assert!(!are_isomorphic(&cycle, &path));
    let (one, two) = (
        facts(&[&["a", "_:0"]]),
        facts(&[&["a", "_:0"], &["a", "b"]]),
    );
    assert!(maps_into(&two, &two) && maps_into(&one, &two) && !maps_into(&two, &one));
    assert!(
        !maps_into(&cycle, &facts(&[&["a", "b"]])) && maps_into(&cycle, &facts(&[&["a", "a"]]))
    );
}
