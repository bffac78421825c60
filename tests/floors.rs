//! Checks the crates under `src/` against the architecture in `src/lib.rs`: a crate depends only on
//! crates above it in the table, and a library of the field is a dependency only of the crates that
//! the table names.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Each crate and the crates that it may depend on, in the order of the pipeline. `cli` may depend
/// on all.
const FLOORS: [(&str, &[&str]); 22] = [
    ("base", &[]),
    ("data", &["base"]),
    ("search", &[]),
    ("config", &["base", "data", "search"]),
    ("ontology", &["base"]),
    ("scenario", &["base", "data", "config", "ontology"]),
    ("geometry", &["base", "data"]),
    ("robot", &["base", "data", "geometry"]),
    ("world", &["base", "data", "scenario", "geometry", "robot"]),
    ("actions", &["base", "data", "scenario", "world"]),
    (
        "protocol",
        &["base", "data", "config", "scenario", "world", "actions"],
    ),
    ("facts", &["base", "data"]),
    ("episodes", &["base", "data", "config", "scenario"]),
    ("rules", &["base", "ontology"]),
    ("verdict", &["base", "data", "ontology", "rules"]),
    (
        "judge",
        &["base", "data", "ontology", "facts", "rules", "verdict"],
    ),
    ("history", &["base", "data", "facts", "verdict"]),
    (
        "campaign",
        &[
            "base", "data", "search", "config", "ontology", "scenario", "world", "actions",
            "protocol", "facts", "episodes", "rules", "verdict", "history",
        ],
    ),
    ("analysis", &["base", "data", "history", "verdict"]),
    (
        "report",
        &["base", "data", "verdict", "history", "analysis"],
    ),
    ("serve", &["base", "history"]),
    ("remote", &["base"]),
];

/// Libraries of the field and the crates that may depend on them.
const FENCES: [(&str, &[&str]); 35] = [
    ("toml", &["config"]),
    ("roxmltree", &["config"]),
    ("mesh-loader", &["config"]),
    ("encoding_rs", &["base"]),
    ("shlex", &["base", "config"]),
    ("nix", &["protocol"]),
    ("statrs", &["search", "analysis"]),
    ("oxigraph", &["rules", "history"]),
    ("oxrdf", &["ontology", "rules"]),
    ("oxrdfio", &["ontology", "rules"]),
    ("rapier3d", &["world"]),
    (
        "parry3d",
        &["geometry", "robot", "world", "scenario", "episodes"],
    ),
    ("png", &["geometry"]),
    ("mcap", &["episodes", "report"]),
    ("prost", &["episodes"]),
    ("pyo3", &["judge"]),
    ("urdf-rs", &["config"]),
    ("datafrog", &["rules"]),
    ("polars", &["analysis"]),
    ("rayon", &["campaign"]),
    ("clap", &["cli"]),
    ("clap_complete", &["cli"]),
    ("clap_mangen", &["cli"]),
    ("hyper", &["serve"]),
    ("hyper-util", &["serve"]),
    ("tokio", &["serve"]),
    ("spargebra", &["history", "rules"]),
    ("ureq", &["remote"]),
    ("rustls", &["remote"]),
    ("rustls-native-certs", &["remote"]),
    ("re_chunk", &["report"]),
    ("re_log_encoding", &["report"]),
    ("re_log_types", &["report"]),
    ("re_protos", &["report"]),
    ("re_sdk_types", &["report"]),
];

fn source_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

/// Names of the folders of `src`.
fn folders() -> Vec<String> {
    let entries = std::fs::read_dir(source_folder())
        .unwrap()
        .map(|entry| entry.unwrap());
    let folders = entries.filter(|entry| entry.file_type().unwrap().is_dir());
    let mut names: Vec<String> = folders
        .map(|entry| entry.file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

fn manifest(path: &Path) -> toml::Table {
    let text =
        std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    text.parse().unwrap()
}

/// Names of a crate's dependencies, without those of its tests.
fn dependencies(folder: &str) -> BTreeSet<String> {
    let manifest = manifest(&source_folder().join(folder).join("Cargo.toml"));
    let found = manifest.get("dependencies").and_then(toml::Value::as_table);
    found
        .into_iter()
        .flat_map(|table| table.keys().cloned())
        .collect()
}

#[test]
fn every_crate_depends_only_on_crates_above_it() {
    let mut wrong = Vec::new();
    for (folder, allowed) in FLOORS {
        for dependency in dependencies(folder) {
            let Some(ours) = dependency.strip_prefix("actcheck-") else {
                continue;
            };
            if !allowed.contains(&ours) {
                wrong.push(format!("src/{folder} depends on `{ours}`"));
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "against the architecture in src/lib.rs:\n{}",
        wrong.join("\n")
    );
}

#[test]
fn the_table_lists_only_crates_above() {
    for (idx, (folder, allowed)) in FLOORS.iter().enumerate() {
        let above: Vec<&str> = FLOORS[..idx].iter().map(|(name, _)| *name).collect();
        let wrong: Vec<&&str> = allowed
            .iter()
            .filter(|name| !above.contains(name))
            .collect();
        assert!(
            wrong.is_empty(),
            "`{folder}` may not depend on {wrong:?}, which come after it"
        );
    }
}

#[test]
fn every_library_is_used_only_in_its_crates() {
    let mut wrong = Vec::new();
    for folder in folders() {
        let dependencies = dependencies(&folder);
        for (library, allowed) in FENCES {
            if dependencies.contains(library) && !allowed.contains(&folder.as_str()) {
                wrong.push(format!("src/{folder} depends on `{library}`"));
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "against the fences in src/lib.rs:\n{}",
        wrong.join("\n")
    );
}

#[test]
fn every_folder_is_a_crate_in_the_table() {
    let workspace = manifest(&Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml"));
    let members = workspace["workspace"]["members"].as_array().unwrap();
    let members: BTreeSet<&str> = members
        .iter()
        .map(|member| member.as_str().unwrap())
        .collect();
    for folder in folders() {
        assert!(
            folder == "cli" || FLOORS.iter().any(|(name, _)| *name == folder),
            "no floor for src/{folder}"
        );
        assert!(
            members.contains(format!("src/{folder}").as_str()),
            "src/{folder} is not a member of the workspace"
        );
        let name =
            manifest(&source_folder().join(&folder).join("Cargo.toml"))["package"]["name"].clone();
        assert_eq!(name.as_str(), Some(format!("actcheck-{folder}").as_str()));
    }
}

/// The parts of a world don't know it: only its own file does.
#[test]
fn no_file_of_a_part_names_the_world() {
    let mut n_files = 0;
    for file in std::fs::read_dir(source_folder().join("world")).unwrap() {
        let path = file.unwrap().path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let is_part = name.ends_with(".rs") && !name.ends_with("_tests.rs");
        if !is_part || name == "lib.rs" || name == "simulation.rs" {
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap();
        let code = text
            .lines()
            .take_while(|line| *line != "mod tests {" && *line != "pub(super) mod tests {");
        let mut code = code.filter(|line| !line.trim_start().starts_with("//"));
        let names_it = |line: &&str| {
            let mut words = line.split(|letter: char| !letter.is_alphanumeric());
            words.any(|word| word == "World")
        };
        assert_eq!(code.find(names_it), None, "{name}");
        n_files += 1;
    }
    assert!(n_files > 30, "{n_files} files");
}
