//! Checks that a type's name is unique within its crate, so that a reader needs no path to know
//! which type is meant.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Crates whose names are not unique yet, with the largest number of names that occur more than
/// once. It may only be reduced.
const EXEMPT: [(&str, usize); 1] = [("remote", 1)];

/// The Rust files of a folder and its subfolders, sorted.
pub fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(rust_files(&path));
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// The name of the struct, enum, union, trait or alias that a line declares. Associated types are
/// indented and left out; types in functions and modules count.
fn declared(line: &str) -> Option<&str> {
    let text = line.trim_start();
    let text = match text.strip_prefix("pub(") {
        Some(rest) => rest.split_once(") ")?.1,
        None => text.strip_prefix("pub ").unwrap_or(text),
    };
    let (keyword, rest) = text.split_once(' ')?;
    let is_type = match keyword {
        "struct" | "enum" | "union" | "trait" => true,
        "type" => !line.starts_with(' '),
        _ => false,
    };
    let end = rest
        .find(|c: char| !c.is_alphanumeric() && c != '_')
        .unwrap_or(rest.len());
    let name = &rest[..end];
    (is_type && name.starts_with(char::is_uppercase)).then_some(name)
}

/// The declared names of a crate with their places, without those of its unit tests.
fn names(folder: &Path) -> BTreeMap<String, Vec<String>> {
    let mut names: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for file in rust_files(folder) {
        let is_tests = file.file_stem().is_some_and(|stem| {
            let stem = stem.to_string_lossy();
            stem == "tests" || stem.ends_with("_tests")
        });
        if is_tests {
            continue;
        }
        let text = std::fs::read_to_string(&file).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        for (idx, line) in lines.iter().enumerate() {
            let next = lines.get(idx + 1).copied().unwrap_or_default();
            if *line == "#[cfg(test)]" && next.starts_with("mod ") && next.ends_with('{') {
                break;
            }
            if let Some(name) = declared(line) {
                let place = format!("{}:{}", file.display(), idx + 1);
                names.entry(name.to_owned()).or_default().push(place);
            }
        }
    }
    names
}

#[test]
fn the_name_of_a_type_is_unique_within_its_crate() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut wrong = Vec::new();
    for entry in std::fs::read_dir(source).unwrap() {
        let folder = entry.unwrap().path();
        if !folder.is_dir() {
            continue;
        }
        let name = folder.file_name().unwrap().to_string_lossy().into_owned();
        let repeated: Vec<String> = names(&folder)
            .into_iter()
            .filter(|(_, places)| places.len() > 1)
            .map(|(name, places)| format!("{name}: {}", places.join(", ")))
            .collect();
        let limit = EXEMPT
            .iter()
            .find(|(exempt, _)| *exempt == name)
            .map_or(0, |(_, limit)| *limit);
        if repeated.len() > limit {
            wrong.push(format!(
                "{name} has {} names that occur more than once, at most {limit} are accepted:\n{}",
                repeated.len(),
                repeated.join("\n")
            ));
        }
    }
    wrong.sort();
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

#[test]
fn declarations_of_types_are_recognised() {
    for (line, name) in [
        ("pub(crate) struct Solid<'a> {", Some("Solid")),
        ("    enum Inner {", Some("Inner")),
        ("type Rows = Vec<u8>;", Some("Rows")),
        ("    type Item = u8;", None),
        ("// struct Solid {", None),
        ("pub trait Growing: Send {", Some("Growing")),
        ("struct Text(String);", Some("Text")),
        ("    let structure = 3;", None),
    ] {
        assert_eq!(declared(line), name, "{line}");
    }
}
