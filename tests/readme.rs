//! Every command of the README is run, block by block, in a folder like a fresh checkout.

use std::process::Command;

use crate::support::checkout::{Checkout, blocks};
use crate::support::{actcheck, root, shipped_project, stderr, stdout};

#[test]
fn every_command_of_the_readme_works() {
    let readme = std::fs::read_to_string(root().join("README.md")).unwrap();
    let checkout = Checkout::fresh();
    let blocks = blocks(&readme, "sh");
    assert!(blocks.len() >= 4, "the README has too few command blocks");
    for block in &blocks {
        checkout.run(block, &[]);
    }
}

/// README's first campaign and its pattern are those that its commands print, one after another.
#[test]
fn the_outputs_in_the_readme_are_those_of_its_commands() {
    let readme = std::fs::read_to_string(root().join("README.md")).unwrap();
    let with = |words: &str| {
        let mut shown = blocks(&readme, "text").into_iter();
        shown.find(|block| block.contains(words)).unwrap()
    };
    let project = shipped_project();
    let ran = |arguments: &[&str]| {
        let output = actcheck(project.path(), arguments);
        assert!(
            output.status.code().is_some_and(|code| code < 2),
            "{}",
            stderr(&output)
        );
        without_ends(&format!("{}{}", stdout(&output), stderr(&output)))
            .replace(env!("CARGO_BIN_EXE_actcheck"), "./actcheck")
    };
    let first = ran(&["run", "configs/pick.toml"]);
    for line in with("score T").lines() {
        assert!(first.contains(line), "{line}\n{first}");
    }
    let commands = blocks(&readme, "sh");
    let property = commands
        .iter()
        .find(|block| block.contains("cat > rules/"))
        .and_then(|block| block.split_once("\n./actcheck"))
        .unwrap()
        .0;
    let written = Command::new("sh")
        .args(["-c", property])
        .current_dir(project.path())
        .status();
    assert!(written.unwrap().success());
    for line in commands
        .iter()
        .flat_map(|block| block.lines())
        .filter(|line| line.contains("--history many") && !line.contains(" report "))
    {
        let arguments: Vec<&str> = line.split_whitespace().skip(1).collect();
        let printed = ran(&arguments);
        if arguments[0] == "analyse" {
            let shown = with("held out");
            assert!(printed.contains(shown.trim_end()), "{printed}");
        }
    }
}

/// A text without spaces at the ends of its lines.
fn without_ends(text: &str) -> String {
    text.lines()
        .map(|line| format!("{}\n", line.trim_end()))
        .collect()
}
