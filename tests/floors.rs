//! Holds the `use` lines under `src/` to the architecture: a module imports only from modules above it, and a library of
//! the field is used only where the module's charter names it.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Each module and the modules it may import, in the order of the pipeline. `cli` may import all.
const FLOORS: [(&str, &[&str]); 16] = [
    ("base", &[]),
    ("search", &["base"]),
    ("config", &["base", "search"]),
    ("ontology", &["base"]),
    ("scenario", &["base", "config", "ontology"]),
    ("world", &["base", "scenario"]),
    ("actions", &["base", "scenario", "world"]),
    ("protocol", &["base", "config", "scenario", "world", "actions"]),
    ("facts", &["base", "ontology", "actions"]),
    ("rules", &["base", "ontology", "facts"]),
    ("verdict", &["base", "ontology", "facts", "rules"]),
    ("history", &["base", "ontology", "scenario", "facts", "verdict", "actions"]),
    (
        "campaign",
        &[
            "base", "search", "config", "ontology", "scenario", "world", "actions", "protocol", "facts", "rules",
            "verdict", "history",
        ],
    ),
    ("analysis", &["base", "history", "verdict"]),
    ("report", &["base", "verdict", "history", "analysis"]),
    ("serve", &["base", "history"]),
];

/// Libraries of the field and the modules that may name them.
const FENCES: [(&str, &[&str]); 22] = [
    ("toml", &["config"]),
    ("roxmltree", &["config"]),
    ("mesh_loader", &["config"]),
    ("shlex", &["config"]),
    ("nix", &["protocol"]),
    ("statrs", &["search", "analysis"]),
    ("oxigraph", &["ontology", "rules", "history"]),
    ("rapier3d", &["world"]),
    ("parry3d", &["world", "scenario"]),
    ("urdf_rs", &["world"]),
    ("datafrog", &["rules"]),
    ("polars", &["analysis"]),
    ("rayon", &["campaign"]),
    ("clap", &["cli"]),
    ("clap_complete", &["cli"]),
    ("clap_mangen", &["cli"]),
    ("oxhttp", &["serve"]),
    ("re_chunk", &["report"]),
    ("re_log_encoding", &["report"]),
    ("re_log_types", &["report"]),
    ("re_protos", &["report"]),
    ("re_sdk_types", &["report"]),
];

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
}

/// Code lines of each module, without comments.
fn code() -> BTreeMap<String, Vec<(PathBuf, usize, String)>> {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&src, &mut files);
    let mut modules: BTreeMap<String, Vec<(PathBuf, usize, String)>> = BTreeMap::new();
    for file in files {
        let relative = file.strip_prefix(&src).unwrap().to_path_buf();
        let module = relative.components().next().unwrap().as_os_str().to_string_lossy().into_owned();
        let text = std::fs::read_to_string(&file).unwrap();
        // Tests inside a file are at its end and may import more.
        let outside_tests = text.lines().take_while(|line| *line != "#[cfg(test)]");
        for (idx, line) in outside_tests.enumerate() {
            let line = line.split("//").next().unwrap().to_owned();
            modules.entry(module.clone()).or_default().push((relative.clone(), idx + 1, line));
        }
    }
    modules
}

/// Names after every `crate::` in a line, groups included: `crate::{base, world}` and `crate::base::Pose`.
fn crate_modules(line: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for behind in line.split("crate::").skip(1) {
        let names: Vec<&str> = match behind.strip_prefix('{') {
            Some(group) => group.split('}').next().unwrap_or("").split(',').collect(),
            None => vec![behind],
        };
        for name in names {
            let name: String = name.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            if !name.is_empty() {
                found.insert(name);
            }
        }
    }
    found
}

#[test]
fn every_module_imports_only_modules_above_it() {
    let mut wrong = Vec::new();
    for (module, lines) in code() {
        let Some((_, allowed)) = FLOORS.iter().find(|(name, _)| *name == module) else { continue };
        for (file, number, line) in lines {
            for imported in crate_modules(&line) {
                if imported != module && !allowed.contains(&imported.as_str()) {
                    wrong.push(format!("{}:{number} imports `{imported}`", file.display()));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "against the architecture in src/lib.rs:\n{}", wrong.join("\n"));
}

#[test]
fn every_library_is_used_only_in_its_modules() {
    let mut wrong = Vec::new();
    for (module, lines) in code() {
        for (file, number, line) in lines {
            for (library, allowed) in FENCES {
                let named = line
                    .match_indices(&format!("{library}::"))
                    .any(|(at, _)| !line[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':'));
                if named && !allowed.contains(&module.as_str()) {
                    wrong.push(format!("{}:{number} uses `{library}`", file.display()));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "against the fences in src/lib.rs:\n{}", wrong.join("\n"));
}

#[test]
fn every_module_is_in_the_table() {
    let known: BTreeSet<&str> = FLOORS.iter().map(|(name, _)| *name).chain(["cli", "lib.rs", "main.rs"]).collect();
    let unknown: Vec<String> = code().into_keys().filter(|module| !known.contains(module.as_str())).collect();
    assert!(unknown.is_empty(), "no floor for {unknown:?}");
}

#[test]
fn the_import_reader_handles_groups_and_paths() {
    let names =
        crate_modules("use crate::{base::Pose, world}; crate::facts::extract(); pub(crate) use crate::rules::x;");
    assert_eq!(names.into_iter().collect::<Vec<_>>(), ["base", "facts", "rules", "world"]);
}
