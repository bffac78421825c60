//! The crates in `Cargo.lock`: none has a known vulnerability, and every licence is allowed.
//!
//! `deny.toml` has the exceptions and the allowed licences, in cargo-deny's format.
//! `.ci/advisories.tsv` holds the facts of the RustSec advisory database that this needs, so that
//! the check needs no network. To renew it, name a checkout of the database:
//! `ADVISORY_DB=../advisory-db cargo test --release --locked --test all dependencies::`.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

use semver::{Version, VersionReq};
use serde_json::Value;

use crate::support::foreign::left_out;
use crate::support::root;

const ADVISORIES: &str = ".ci/advisories.tsv";

/// One advisory of the database.
#[derive(Debug)]
struct Advisory {
    id: String,
    package: String,
    /// `vulnerability`, `unsound`, `unmaintained` or `notice`.
    kind: String,
    patched: Vec<VersionReq>,
    unaffected: Vec<VersionReq>,
}

impl Advisory {
    fn applies(&self, name: &str, version: &Version) -> bool {
        let is_outside = || {
            self.patched
                .iter()
                .chain(&self.unaffected)
                .any(|range| range.matches(version))
        };
        self.package == name && !is_outside()
    }
}

/// Parses a line of the table: id, crate, kind, patched and unaffected versions.
fn advisory(line: &str) -> Advisory {
    let [id, package, kind, patched, unaffected] = line
        .split('\t')
        .collect::<Vec<_>>()
        .try_into()
        .unwrap_or_else(|_| panic!("{line}"));
    let ranges = |text: &str| -> Vec<VersionReq> {
        let ranges = text
            .split(';')
            .map(str::trim)
            .filter(|range| !range.is_empty());
        ranges
            .map(|range| VersionReq::parse(range).unwrap_or_else(|error| panic!("{line}: {error}")))
            .collect()
    };
    Advisory {
        id: id.to_owned(),
        package: package.to_owned(),
        kind: kind.to_owned(),
        patched: ranges(patched),
        unaffected: ranges(unaffected),
    }
}

/// Returns the table of all advisories in a checkout of the database.
fn table(database: &Path) -> String {
    let git = |arguments: &[&str]| {
        let output = Command::new("git")
            .arg("-C")
            .arg(database)
            .args(arguments)
            .output()
            .unwrap();
        String::from_utf8(output.stdout).unwrap().trim().to_owned()
    };
    let mut lines: Vec<String> = Vec::new();
    for folder in std::fs::read_dir(database.join("crates")).unwrap() {
        for file in std::fs::read_dir(folder.unwrap().path()).unwrap() {
            let text = std::fs::read_to_string(file.unwrap().path()).unwrap();
            let head = text
                .split("```toml\n")
                .nth(1)
                .and_then(|rest| rest.split("```").next())
                .unwrap();
            let read: toml::Table = head.parse().unwrap();
            let about = &read["advisory"];
            if about.get("withdrawn").is_some() {
                continue;
            }
            let text = |key: &str| {
                about
                    .get(key)
                    .and_then(toml::Value::as_str)
                    .unwrap_or("vulnerability")
            };
            let ranges = |key: &str| {
                let list = read["versions"]
                    .get(key)
                    .and_then(toml::Value::as_array)
                    .into_iter()
                    .flatten();
                list.filter_map(toml::Value::as_str)
                    .collect::<Vec<_>>()
                    .join("; ")
            };
            let (patched, unaffected) = (ranges("patched"), ranges("unaffected"));
            lines.push(format!(
                "{}\t{}\t{}\t{patched}\t{unaffected}",
                text("id"),
                text("package"),
                text("informational")
            ));
        }
    }
    lines.sort();
    format!(
        "# https://github.com/rustsec/advisory-db at {}, written by tests/dependencies.rs\n{}\n",
        git(&["log", "-1", "--format=%h of %cs"]),
        lines.join("\n")
    )
}

/// Names and versions in a lock file, without the crates of this workspace.
fn locked(text: &str) -> Vec<(String, Version)> {
    let lock: toml::Table = text.parse().unwrap();
    let packages = lock["package"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|package| package.get("source").is_some());
    let read = |package: &toml::Value, key: &str| package[key].as_str().unwrap().to_owned();
    packages
        .map(|package| {
            (
                read(package, "name"),
                Version::parse(&read(package, "version")).unwrap(),
            )
        })
        .collect()
}

fn rules() -> toml::Table {
    std::fs::read_to_string(root().join("deny.toml"))
        .unwrap()
        .parse()
        .unwrap()
}

/// The advisories that `deny.toml` ignores; each with a reason.
fn ignored() -> BTreeSet<String> {
    let rules = rules();
    let list = rules["advisories"]["ignore"].as_array().unwrap();
    assert!(
        list.iter().all(|entry| entry["reason"]
            .as_str()
            .is_some_and(|reason| reason.len() > 20)),
        "{list:?}"
    );
    list.iter()
        .map(|entry| entry["id"].as_str().unwrap().to_owned())
        .collect()
}

#[test]
fn no_crate_has_an_advisory_without_an_exception() {
    if let Some(database) = std::env::var_os("ADVISORY_DB") {
        std::fs::write(root().join(ADVISORIES), table(Path::new(&database))).unwrap();
    }
    let text = std::fs::read_to_string(root().join(ADVISORIES)).unwrap();
    let advisories: Vec<Advisory> = text
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(advisory)
        .collect();
    assert!(advisories.len() > 1_000, "only {}", advisories.len());
    let (mut found, mut applying) = (String::new(), BTreeSet::new());
    let ignored = ignored();
    // The client in Rust is an example of the program; fuzz targets have a lock file of their own.
    for lock in ["Cargo.lock", "fuzz/Cargo.lock"] {
        for (name, version) in locked(&std::fs::read_to_string(root().join(lock)).unwrap()) {
            for advisory in advisories
                .iter()
                .filter(|advisory| advisory.applies(&name, &version))
            {
                applying.insert(advisory.id.clone());
                if !ignored.contains(&advisory.id) {
                    writeln!(
                        found,
                        "{lock}: {name} {version}: {} ({})",
                        advisory.id, advisory.kind
                    )
                    .unwrap();
                }
            }
        }
    }
    assert!(
        found.is_empty(),
        "update these, or add a reasoned exception to deny.toml:\n{found}"
    );
    let outdated: Vec<&String> = ignored.difference(&applying).collect();
    assert!(
        outdated.is_empty(),
        "these exceptions of deny.toml are no longer needed: {outdated:?}"
    );
}

/// The crates of the program with their features, in a build of these kinds of dependencies.
fn features(kinds: &str) -> BTreeSet<String> {
    let output = Command::new(env!("CARGO"))
        .current_dir(root())
        .args([
            "tree",
            "--workspace",
            "--locked",
            "--offline",
            "--prefix",
            "none",
            "--format",
            "{p} {f}",
            "--edges",
            kinds,
        ])
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let text = String::from_utf8(output.stdout).unwrap();
    text.lines()
        .map(|line| line.trim_end_matches(" (*)").to_owned())
        .filter(|line| !line.is_empty())
        .collect()
}

/// One feature more makes cargo compile a crate and all that depend on it again: `make test` after
/// `make`.
#[test]
fn tests_share_all_crates_of_the_program() {
    let other: Vec<String> = features("normal,build")
        .difference(&features("normal,build,dev"))
        .cloned()
        .collect();
    assert!(
        other.is_empty(),
        "tests compile these with other features; give them to the program too: {other:?}"
    );
}

#[test]
fn an_advisory_applies_to_versions_that_are_neither_patched_nor_unaffected() {
    let advisory = advisory("RUSTSEC-0000-0001\txml\tvulnerability\t^0.37.9; >= 0.41.0\t< 0.3.0");
    let applies = |version: &str| advisory.applies("xml", &Version::parse(version).unwrap());
    assert_eq!(
        ["0.2.9", "0.3.0", "0.37.5", "0.37.9", "0.39.4", "0.41.0"].map(applies),
        [false, true, true, false, true, false]
    );
    assert!(!advisory.applies("yml", &Version::new(0, 39, 4)));
}

/// Whether one of the licences that an expression offers is allowed: `A OR (B AND C)`, `A/B`,
/// `A WITH B`.
fn is_allowed(expression: &str, allowed: &BTreeSet<String>) -> bool {
    let spaced = expression
        .replace('/', " OR ")
        .replace('(', " ( ")
        .replace(')', " ) ")
        .replace(" WITH ", "+WITH+");
    let words: Vec<&str> = spaced.split_whitespace().collect();
    let mut rest = words.as_slice();
    let result = any_of(&mut rest, allowed);
    assert!(
        rest.is_empty(),
        "`{expression}` is not an expression of licences"
    );
    result
}

fn any_of(rest: &mut &[&str], allowed: &BTreeSet<String>) -> bool {
    let mut result = all_of(rest, allowed);
    while let Some(("OR", behind)) = rest.split_first().map(|(word, behind)| (*word, behind)) {
        *rest = behind;
        result |= all_of(rest, allowed);
    }
    result
}

fn all_of(rest: &mut &[&str], allowed: &BTreeSet<String>) -> bool {
    let mut result = licence(rest, allowed);
    while let Some(("AND", behind)) = rest.split_first().map(|(word, behind)| (*word, behind)) {
        *rest = behind;
        result &= licence(rest, allowed);
    }
    result
}

fn licence(rest: &mut &[&str], allowed: &BTreeSet<String>) -> bool {
    let (word, behind) = rest.split_first().expect("a licence");
    *rest = behind;
    if *word != "(" {
        return allowed.contains(&word.replace("+WITH+", " WITH "));
    }
    let result = any_of(rest, allowed);
    assert_eq!(rest.first(), Some(&")"));
    *rest = &rest[1..];
    result
}

#[test]
fn expressions_of_licences_are_understood() {
    let allowed: BTreeSet<String> = ["MIT", "Apache-2.0 WITH LLVM-exception"]
        .map(str::to_owned)
        .into();
    for (expression, expected) in [
        ("MIT", true),
        ("GPL-3.0", false),
        ("GPL-3.0 OR MIT", true),
        ("GPL-3.0/MIT", true),
        ("GPL-3.0 AND MIT", false),
        ("(GPL-3.0 OR MIT) AND Apache-2.0 WITH LLVM-exception", true),
        ("MIT AND (ISC OR Zlib)", false),
        ("Apache-2.0", false),
    ] {
        assert_eq!(is_allowed(expression, &allowed), expected, "{expression}");
    }
}

/// The output of `cargo metadata` for this machine, without network.
fn metadata(more: &[&str]) -> Result<Value, String> {
    let version = Command::new("rustc")
        .arg("-vV")
        .output()
        .map_err(|error| error.to_string())?;
    let version = String::from_utf8_lossy(&version.stdout).into_owned();
    let host = version
        .lines()
        .find_map(|line| line.strip_prefix("host: "))
        .ok_or("rustc names no host")?;
    let output = Command::new(env!("CARGO"))
        .args([
            "metadata",
            "--offline",
            "--locked",
            "--format-version",
            "1",
            "--filter-platform",
            host,
        ])
        .args(more)
        .current_dir(root())
        .output()
        .map_err(|error| error.to_string())?;
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    serde_json::from_slice(&output.stdout)
        // Before its error, cargo says that it waits for the locks of another one.
        .map_err(|_| {
            let mut lines = said.lines();
            let reason = lines.find(|line| !line.trim_start().starts_with("Blocking"));
            reason.unwrap_or_default().to_owned()
        })
}

#[test]
fn every_licence_is_allowed() {
    let rules = rules();
    let list = rules["licenses"]["allow"].as_array().unwrap();
    let allowed: BTreeSet<String> = list
        .iter()
        .map(|name| name.as_str().unwrap().to_owned())
        .collect();
    // The crates of optional features may never have been downloaded.
    let read = metadata(&["--all-features"]).or_else(|why| {
        left_out("the licences of optional crates", &why);
        metadata(&[])
    });
    let read = read.unwrap();
    let packages = read["packages"].as_array().unwrap();
    assert!(packages.len() > 300, "{}", packages.len());
    let refused: Vec<String> = packages
        .iter()
        .filter(|package| {
            !package["license"]
                .as_str()
                .is_some_and(|licence| is_allowed(licence, &allowed))
        })
        .map(|package| {
            format!(
                "{} {}: {}",
                package["name"], package["version"], package["license"]
            )
        })
        .collect();
    assert!(
        refused.is_empty(),
        "not allowed by deny.toml:\n{}",
        refused.join("\n")
    );
}
