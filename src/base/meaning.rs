//! Names that mean the same in the words of the field, such as `grasp` and `pick`. The table is
//! `words.txt`.

use std::collections::HashMap;
use std::sync::LazyLock;

/// Groups of names with the same meaning, each as its words joined by spaces.
static GROUPS: LazyLock<Vec<Vec<String>>> = LazyLock::new(|| {
    let lines = include_str!("words.txt")
        .lines()
        .filter(|line| !line.is_empty() && !line.starts_with('#'));
    lines
        .map(|line| line.split(", ").map(|name| words(name).join(" ")).collect())
        .collect()
});

/// The groups of each name, by their places.
static GROUPS_OF: LazyLock<HashMap<&str, Vec<usize>>> = LazyLock::new(|| {
    let mut groups_of: HashMap<&str, Vec<usize>> = HashMap::new();
    for (place, group) in GROUPS.iter().enumerate() {
        group
            .iter()
            .for_each(|name| groups_of.entry(name).or_default().push(place));
    }
    groups_of
});

/// Least share of common meanings of two names that are similar.
const SIMILAR: f64 = 0.5;

/// Returns the candidate that means the same as `name`.
pub(crate) fn same<'a>(
    name: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    let name = words(name).join(" ");
    // The first names of a group are the usual ones.
    let places = groups_of(&name);
    if places.is_empty() {
        return None;
    }
    let rank = |candidate: &str| {
        let candidate = words(candidate).join(" ");
        places.iter().find_map(|place| {
            Some((
                GROUPS[*place]
                    .iter()
                    .position(|known| *known == candidate)?,
                *place,
            ))
        })
    };
    let ranked = candidates
        .into_iter()
        .filter_map(|candidate| Some((rank(candidate)?, candidate)));
    ranked.min().map(|(_, candidate)| candidate)
}

/// Returns the candidate whose words mean most nearly the same as those of `name`.
pub(crate) fn similar<'a>(
    name: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    let name = words(name);
    let score = |candidate: &str| {
        let other = words(candidate);
        let common = name
            .iter()
            .filter(|word| other.iter().any(|known| alike(word, known)))
            .count() as f64;
        common / (name.len() as f64 + other.len() as f64 - common)
    };
    candidates
        .into_iter()
        .map(|candidate| (score(candidate), candidate))
        .filter(|(score, _)| *score >= SIMILAR)
        .max_by(|a, b| a.0.total_cmp(&b.0).then_with(|| b.1.cmp(a.1)))
        .map(|(_, candidate)| candidate)
}

/// Whether two words are the same or in one group.
fn alike(a: &str, b: &str) -> bool {
    a == b
        || groups_of(a)
            .iter()
            .any(|group| groups_of(b).contains(group))
}

fn groups_of(name: &str) -> &'static [usize] {
    GROUPS_OF.get(name).map_or(&[], Vec::as_slice)
}

/// The words of a name in lower case, such as `test` and `count` of `testCount`, `test_count` or
/// `TestCount`. A plural counts as its singular.
fn words(name: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut begins = true;
    let mut before = ' ';
    for letter in name.chars() {
        if !letter.is_alphanumeric() {
            begins = true;
        } else {
            begins |= letter.is_uppercase() && before.is_lowercase();
            match words.last_mut() {
                Some(word) if !begins => word.extend(letter.to_lowercase()),
                _ => words.push(letter.to_lowercase().collect()),
            }
            begins = false;
        }
        before = letter;
    }
    words.iter_mut().for_each(singular);
    words
}

fn singular(word: &mut String) {
    if word.len() > 3 && word.ends_with('s') && !word.ends_with("ss") {
        word.pop();
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn names_are_split_into_words_in_every_style() {
        for name in [
            "test_count",
            "testCount",
            "TestCount",
            "test-count",
            "Test counts",
        ] {
            assert_eq!(words(name), ["test", "count"], "{name}");
        }
        assert_eq!(words("glass"), ["glass"]);
        assert!(words("").is_empty());
    }

    #[test]
    fn a_word_of_the_field_finds_the_name_with_the_same_meaning() {
        let actions = ["MoveTo", "PerceivePlane", "Pick", "Place"];
        for (name, found) in [
            ("Grasp", "Pick"),
            ("put_down", "Place"),
            ("Navigate", "MoveTo"),
            ("detect", "PerceivePlane"),
        ] {
            assert_eq!(same(name, actions), Some(found));
        }
        assert_eq!(same("banana", actions), None);
        assert_eq!(same("cup", ["can", "glass", "mug"]), Some("mug"));
        assert_eq!(same("hand", ["floor", "gripper"]), Some("gripper"));
        assert_eq!(
            same("collision", ["Contact", "touches", "tilt"]),
            Some("touches")
        );
        assert_eq!(
            same("runs", ["seed", "test_count", "tests"]),
            Some("test_count")
        );
    }

    #[test]
    fn names_with_common_meanings_are_similar() {
        assert_eq!(
            similar("handOpening", ["gripperOpening", "opening_hours"]),
            Some("gripperOpening")
        );
        assert_eq!(similar("weight", ["mass_kg", "size_m"]), Some("mass_kg"));
        assert_eq!(similar("banana", ["mass_kg"]), None);
        assert_eq!(similar("", ["mass_kg"]), None);
    }

    #[test]
    fn every_line_is_a_group_of_different_names() {
        for group in GROUPS.iter() {
            assert!(group.len() > 1, "{group:?}");
            assert!(group.iter().all(|name| !name.is_empty()), "{group:?}");
        }
        let lines: Vec<&str> = include_str!("words.txt")
            .lines()
            .filter(|line| line.contains(", "))
            .collect();
        assert_eq!(
            lines.len(),
            lines.iter().collect::<BTreeSet<_>>().len(),
            "a line twice"
        );
    }
}
