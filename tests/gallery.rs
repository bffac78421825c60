//! The gallery: the committed page and a new one from a tiny campaign have the same structure.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use regex::Regex;

use crate::support::{COARSEST, project_with, root, stderr};

/// Checks a page and its pictures. Returns the failed properties of each section, from the table.
fn check(folder: &Path) -> Vec<String> {
    let page = std::fs::read_to_string(folder.join("gallery.md")).unwrap();
    let rows = Regex::new(
        r"(?m)^\| \[(\d+)\]\(#failure-\d+\) \| .+ \| `\w+` \| \d+ of \d+ runs: (.+) \|$",
    )
    .unwrap();
    let failed: Vec<String> = rows
        .captures_iter(&page)
        .map(|row| row[2].to_owned())
        .collect();
    let sections: Vec<&str> = page.split("\n## Failure ").skip(1).collect();
    assert_eq!(sections.len(), failed.len(), "one section for each row");
    for (number, section) in (1..).zip(&sections) {
        assert!(section.starts_with(&format!("{number}\n")), "{section}");
        for part in [
            "**The smallest scene** in which ",
            "**The proof**",
            "```text\n",
            "does not hold",
        ] {
            assert!(section.contains(part), "section {number} has no `{part}`");
        }
        for kind in ["run", "smallest"] {
            let picture = format!("gallery/{number:02}-{kind}.svg");
            assert!(
                section.contains(&format!("]({picture})")),
                "section {number} does not show {picture}"
            );
            let svg = std::fs::read_to_string(folder.join(&picture)).unwrap();
            let tree = roxmltree::Document::parse(&svg).unwrap();
            let drawn = tree
                .descendants()
                .filter(|node| node.has_tag_name("path"))
                .count();
            assert!(drawn > 10, "{picture} is empty");
        }
    }
    assert!(
        !page.contains("/tmp/") && !page.contains("/root/") && !page.contains("/home/"),
        "paths of a machine"
    );
    failed
}

#[test]
fn the_committed_gallery_has_ten_different_failures_in_less_than_a_megabyte() {
    let docs = root().join("docs");
    let failed = check(&docs);
    assert_eq!(failed.len(), 10);
    assert_eq!(
        failed.iter().collect::<BTreeSet<_>>().len(),
        10,
        "{failed:#?}"
    );
    let files = std::fs::read_dir(docs.join("gallery"))
        .unwrap()
        .map(|entry| entry.unwrap());
    let svgs: Vec<_> = files
        .filter(|file| {
            file.path()
                .extension()
                .is_some_and(|ending| ending == "svg")
        })
        .collect();
    assert_eq!(svgs.len(), 20);
    let bytes: u64 = svgs.iter().map(|file| file.metadata().unwrap().len()).sum();
    assert!(bytes < 1_000_000, "{bytes} bytes");
}

#[test]
fn a_tiny_campaign_makes_a_gallery() {
    let project = project_with(COARSEST);
    let into = tempfile::tempdir().unwrap();
    let output = Command::new("python3")
        .arg(root().join("docs/gallery/make.py"))
        .args([
            "--actcheck",
            env!("CARGO_BIN_EXE_actcheck"),
            "--campaigns",
            "pick",
            "--failures",
            "2",
        ])
        .args(["--runs", "2", "--trials", "3", "--project"])
        .arg(project.path())
        .arg("--into")
        .arg(into.path())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    assert!((1..=2).contains(&check(into.path()).len()));
}
