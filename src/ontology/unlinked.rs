//! Finds rule files that lie beside linked ones but that nothing links.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use crate::file_iri::beside;
use crate::graph::Graph;
use crate::rule_files::{language_of, relative_path};
use actcheck_base::{Diagnostic, Diagnostics, Files, Source, names};

/// Extensions of ontology files.
const ONTOLOGIES: [&str; 5] = ["ttl", "nt", "owl", "rdf", "xml"];

/// Warnings O017: rule files on disk, in the folders of linked rule files, that nothing links.
/// Subfolders are not searched.
///
/// A file counts as linked also if another ontology beside these, or a configuration in its usual
/// places, mentions it. Programs with facts of their own (`@import`) are not rules of properties,
/// and copies of shipped files are not the user's.
pub(super) fn rule_files(graph: &Graph) -> Diagnostics {
    let (mut folders, mut linked) = (BTreeMap::new(), BTreeSet::new());
    for statement in graph.statements() {
        let links = ["verifiedBy", "ruleLibrary"]
            .iter()
            .any(|local| graph.means(&statement.predicate, &names::act(local)));
        let home = graph.home(statement);
        let Some(path) =
            relative_path(&statement.object).filter(|_| links && home.files == Files::Disk)
        else {
            continue;
        };
        let file = beside(&home.folder, &path);
        let folder = file.parent().unwrap_or(Path::new("")).to_path_buf();
        linked.extend(same(&file));
        folders.entry(same(&folder)).or_insert(folder);
    }
    let candidates = folders
        .values()
        .flat_map(|folder| Files::Disk.list(or_here(folder)));
    let mut unlinked: Vec<PathBuf> = candidates
        .filter(|path| is_rule_file(path) && same(path).is_none_or(|path| !linked.contains(&path)))
        .collect();
    if !unlinked.is_empty() {
        let others = other_texts(graph);
        unlinked.retain(|path| !others.iter().any(|text| mentions(text, &name_of(path))));
    }
    let files = unlinked
        .iter()
        .filter_map(|path| Files::Disk.read(path).ok());
    files
        .filter(|file| !is_program(file) && !is_shipped(file))
        .map(warning)
        .collect()
}

fn warning(file: Source) -> Diagnostic {
    let name = name_of(Path::new(&*file.name));
    Diagnostic::warning(
        "O017",
        "no ontology links this rule file, so that it has no effect",
    )
    .in_source(&file)
    .help(format!(
        "link it, such as with `act:verifiedBy <…/{name}>`, or remove it"
    ))
}

/// The texts that may name a rule file: other ontologies in the folders of the loaded ones, and
/// configurations there, in the folder above and in `configs` beside.
fn other_texts(graph: &Graph) -> Vec<Source> {
    let loaded: BTreeSet<PathBuf> = graph
        .sources()
        .iter()
        .filter_map(|source| same(Path::new(&*source.name)))
        .collect();
    let mut folders: BTreeSet<PathBuf> = BTreeSet::new();
    for home in graph
        .homes()
        .iter()
        .filter(|home| home.files == Files::Disk)
    {
        folders.extend(same(or_here(&home.folder)));
    }
    let around = folders.iter().flat_map(|folder| {
        let above = folder.parent().unwrap_or(folder);
        [folder.clone(), above.to_path_buf(), above.join("configs")]
    });
    let all: BTreeSet<PathBuf> = around
        .flat_map(|folder| Files::Disk.list(&folder))
        .collect();
    let ending = |path: &Path| {
        path.extension().map_or_else(String::new, |ending| {
            ending.to_string_lossy().to_lowercase()
        })
    };
    let may_name = |path: &PathBuf| match ending(path).as_str() {
        "toml" => true,
        other => {
            ONTOLOGIES.contains(&other)
                && path.parent().is_some_and(|folder| folders.contains(folder))
                && same(path).is_none_or(|path| !loaded.contains(&path))
        }
    };
    all.into_iter()
        .filter(may_name)
        .filter_map(|path| Files::Disk.read(&path).ok())
        .collect()
}

/// Whether a text contains a file name as a whole.
fn mentions(text: &Source, name: &str) -> bool {
    let in_name = |c: char| c.is_alphanumeric() || c == '_' || c == '-';
    text.text
        .match_indices(name)
        .any(|(at, _)| !text.text[..at].chars().next_back().is_some_and(in_name))
}

/// Whether a file is a program for `actcheck datalog`, not the rules of a property.
fn is_program(file: &Source) -> bool {
    file.text.lines().any(|line| {
        ["@import", "@export"]
            .iter()
            .any(|word| line.trim_start().starts_with(word))
    })
}

/// Whether a file is a copy of a shipped one, such as the rules of the ontology's closure, which
/// the program itself uses.
fn is_shipped(file: &Source) -> bool {
    let name = name_of(Path::new(&*file.name));
    let mut shipped = Files::all_shipped(Path::new("rules"))
        .into_iter()
        .filter(|path| name_of(path) == name);
    shipped.any(|path| {
        Files::Shipped
            .read(&path)
            .is_ok_and(|known| known.text == file.text)
    })
}

/// Whether a file has the name of rules, and is not a hidden file or backup of an editor.
fn is_rule_file(path: &Path) -> bool {
    path.to_str().and_then(language_of).is_some() && !name_of(path).starts_with(['.', '#'])
}

fn name_of(path: &Path) -> String {
    path.file_name()
        .map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

/// A form that is equal for all paths of a file.
fn same(path: &Path) -> Option<PathBuf> {
    std::fs::canonicalize(or_here(path)).ok()
}

fn or_here(folder: &Path) -> &Path {
    if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    }
}
