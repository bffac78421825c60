//! Every command of the README is run, block by block, in a folder like a fresh checkout.

use std::process::Command;

use crate::support::{COARSEST, copy, edit, project_with, root, script};

/// The texts of the fenced blocks in a language.
fn blocks(text: &str, language: &str) -> Vec<String> {
    let open = format!("```{language}\n");
    text.split(&open).skip(1).map(|rest| rest.split("\n```").next().unwrap().to_owned()).collect()
}

#[test]
fn every_command_of_the_readme_works() {
    let readme = std::fs::read_to_string(root().join("README.md")).unwrap();
    let project = project_with(COARSEST);
    let folder = project.path();
    // Among four scenes there is a failure to inspect.
    edit(&folder.join("configs/pick.toml"), "test_count = 15", "test_count = 6");
    std::fs::copy(root().join("Makefile"), folder.join("Makefile")).unwrap();
    copy(&root().join("clients"), &folder.join("clients"));
    // The program as the README calls it, with its exit codes recorded.
    let program = env!("CARGO_BIN_EXE_actcheck");
    script(
        &folder.join("actcheck"),
        &format!("#!/bin/sh\n{program} \"$@\"\ncode=$?\necho \"$code $1\" >> codes\nexit $code\n"),
    );
    // `make` compiles for half an hour; here it only checks that the target exists.
    std::fs::create_dir(folder.join("bin")).unwrap();
    script(
        &folder.join("bin/make"),
        "#!/bin/sh\nPATH=${PATH#*:}\nmake -n \"$@\" > /dev/null; code=$?; echo \"$code make $1\" >> codes; exit $code\n",
    );
    let path = format!("{}:{}", folder.join("bin").display(), std::env::var("PATH").unwrap());
    let blocks = blocks(&readme, "sh");
    assert!(blocks.len() >= 4, "the README has too few command blocks");
    let mut printed = String::new();
    for block in &blocks {
        let output = Command::new("sh")
            .args(["-c", block])
            .current_dir(folder)
            .env("PATH", &path)
            .env("NO_COLOR", "1")
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code().is_some_and(|code| code <= 1), "{block}\n{text}");
        printed.push_str(&text);
    }
    let codes = std::fs::read_to_string(folder.join("codes")).unwrap();
    let wrong: Vec<&str> = codes
        .lines()
        // Exit code 1 means a campaign, or a recheck, with a failed property.
        .filter(|line| !(line.starts_with("0 ") || ["1 run", "1 recheck"].contains(line)))
        .collect();
    assert!(wrong.is_empty(), "{wrong:#?}\n{printed}");
    assert!(codes.lines().count() >= 6, "{codes}");
}
