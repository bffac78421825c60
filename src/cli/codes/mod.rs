//! All codes of errors and warnings, with their meaning, usual causes and remedies.
//!
//! `actcheck explain` prints them, and `src/codes.md` is generated from them. A test compares them
//! with the codes in the sources.

mod commands;
mod config;
mod episodes;
mod history;
mod judge;
mod models;
mod ontology;
mod reports;
mod rules;
mod scenes;

/// A code with its explanation. Texts are sentences without a capital letter and a full stop, as
/// messages are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Code {
    /// The code, such as `C003`.
    pub code: &'static str,
    /// Its meaning.
    pub meaning: &'static str,
    /// Usual causes.
    pub cause: &'static str,
    /// The way out.
    pub remedy: &'static str,
}

/// The codes that begin with the same letter.
#[derive(Debug, Clone, Copy)]
pub(super) struct Area {
    /// The letter.
    pub letter: char,
    /// The subject of its codes.
    pub title: &'static str,
    /// Its codes, sorted.
    pub codes: &'static [Code],
}

/// All areas, in the order in which a campaign passes through them.
pub(super) static AREAS: [Area; 12] = [
    config::CONFIG,
    models::MODELS,
    ontology::ONTOLOGY,
    scenes::SCENES,
    episodes::EPISODES,
    rules::RULES,
    judge::JUDGE,
    history::HISTORY,
    reports::TABLES,
    reports::HEALTH,
    reports::ORACLES,
    commands::COMMANDS,
];

/// All codes.
pub(super) fn all() -> impl Iterator<Item = (&'static Area, &'static Code)> {
    AREAS
        .iter()
        .flat_map(|area| area.codes.iter().map(move |code| (area, code)))
}

/// Finds a code; upper and lower case are equal.
pub(super) fn find(name: &str) -> Option<(&'static Area, &'static Code)> {
    all().find(|(_, code)| code.code.eq_ignore_ascii_case(name))
}

/// Returns the known code that is most similar to an unknown one: of those with the same letter,
/// the one with the nearest number.
pub(super) fn nearest(name: &str) -> Option<&'static str> {
    let letter = name.chars().next()?.to_ascii_uppercase();
    let number = |code: &str| code.get(1..).and_then(|digits| digits.parse::<i64>().ok());
    let wanted = number(name);
    let of_area = all()
        .filter(|(area, _)| area.letter == letter)
        .map(|(_, code)| code.code);
    match wanted {
        Some(wanted) => of_area
            .min_by_key(|code| number(code).map_or(u64::MAX, |number| number.abs_diff(wanted))),
        None => {
            actcheck_base::nearest(&name.to_ascii_uppercase(), all().map(|(_, code)| code.code))
        }
    }
}

const fn code(
    code: &'static str,
    meaning: &'static str,
    cause: &'static str,
    remedy: &'static str,
) -> Code {
    Code {
        code,
        meaning,
        cause,
        remedy,
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::path::Path;

    use super::*;

    /// The codes in the sources below a folder: string literals of a capital letter and three
    /// digits, outside of tests.
    fn codes_in(folder: &Path, found: &mut BTreeSet<String>) {
        for entry in std::fs::read_dir(folder).expect("a folder of sources") {
            let path = entry.expect("an entry").path();
            if path.is_dir() && path != Path::new(env!("CARGO_MANIFEST_DIR")).join("codes") {
                codes_in(&path, found);
            } else if path.extension().is_some_and(|ending| ending == "rs") {
                let text = std::fs::read_to_string(&path).expect("a source file");
                let code = text.split("#[cfg(test)]").next().unwrap_or_default();
                found.extend(
                    code.split('"')
                        .filter(|word| is_code(word))
                        .map(str::to_owned),
                );
            }
        }
    }

    fn is_code(word: &str) -> bool {
        word.len() == 4
            && word.starts_with(|c: char| c.is_ascii_uppercase())
            && word[1..].bytes().all(|b| b.is_ascii_digit())
    }

    #[test]
    fn every_code_in_the_sources_is_explained_and_every_explained_code_is_used() {
        let sources = Path::new(env!("CARGO_MANIFEST_DIR"))
            .parent()
            .expect("the folder of all crates");
        let mut used = BTreeSet::new();
        codes_in(sources, &mut used);
        let explained: BTreeSet<String> = all().map(|(_, code)| code.code.to_owned()).collect();
        let missing: Vec<&String> = used.difference(&explained).collect();
        assert!(
            missing.is_empty(),
            "explain these in src/cli/codes: {missing:?}"
        );
        let unused: Vec<&String> = explained.difference(&used).collect();
        assert!(unused.is_empty(), "no source has these codes: {unused:?}");
    }

    #[test]
    fn codes_are_sorted_and_unique_and_their_texts_read_like_messages() {
        for area in &AREAS {
            assert!(
                area.codes.is_sorted_by(|one, next| one.code < next.code),
                "{}",
                area.title
            );
            for code in area.codes {
                assert!(
                    is_code(code.code) && code.code.starts_with(area.letter),
                    "{}",
                    code.code
                );
                for text in [code.meaning, code.cause, code.remedy] {
                    assert!(
                        !text.is_empty() && !text.ends_with('.') && text.trim() == text,
                        "{}: {text}",
                        code.code
                    );
                }
            }
        }
    }

    #[test]
    fn an_unknown_code_is_near_a_known_one_of_its_area() {
        assert_eq!(nearest("C019"), Some("C018"));
        assert_eq!(nearest("x999"), Some("X098"));
        assert_eq!(nearest("RO10"), Some("R010"));
        assert_eq!(nearest("banana"), None);
        assert_eq!(nearest(""), None);
        assert_eq!(find("c003").map(|(_, code)| code.code), Some("C003"));
    }
}
