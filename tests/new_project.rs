//! From an empty folder to a judged property, with only the program.

use std::path::Path;

use crate::support::{actcheck, foreign, stderr, stdout};

/// Runs a command that must succeed. Returns its output.
fn done(folder: &Path, arguments: &[&str]) -> String {
    let output = actcheck(folder, arguments);
    assert!(
        output.status.success(),
        "{arguments:?}: {}{}",
        stdout(&output),
        stderr(&output)
    );
    stdout(&output)
}

/// Runs a command that must be refused. Returns its message without line breaks.
fn refused(folder: &Path, arguments: &[&str]) -> String {
    let output = actcheck(folder, arguments);
    assert_eq!(
        output.status.code(),
        Some(2),
        "{arguments:?}: {}{}",
        stdout(&output),
        stderr(&output)
    );
    stderr(&output)
        .replace('│', " ")
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = entries.collect();
    names.sort();
    names
}

#[test]
fn a_new_campaign_and_a_new_property_work_in_an_empty_folder() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    assert!(refused(folder, &["run"]).contains("`actcheck new campaign` writes pick.toml"));
    let printed = done(folder, &["new", "campaign"]);
    assert!(
        printed.contains("wrote pick.toml\n")
            && printed.ends_with("next: actcheck run pick.toml\n"),
        "{printed}"
    );
    assert_eq!(names(folder), ["pick.toml"]);
    assert!(done(folder, &["check", "pick.toml"]).contains("built-in:ontology/actions.ttl"));
    let run = actcheck(folder, &["run", "pick.toml", "--runs", "1"]);
    assert!(run.status.code() < Some(2), "{}", stderr(&run));

    std::fs::write(
        folder.join("other.toml"),
        "tests = [[\"Pick\"]]\ntest_count = 1\n",
    )
    .unwrap();
    std::fs::create_dir(folder.join("configs")).unwrap();
    std::fs::copy(folder.join("pick.toml"), folder.join("configs/copy.toml")).unwrap();
    let printed = done(
        folder,
        &["new", "property", "StaysUpright", "--for", "Pick"],
    );
    for line in [
        "the shipped ontology and rules",
        "pick.toml uses ontology/actions.ttl from now on",
        "other.toml uses the shipped ontology: add `ontology = \"ontology/actions.ttl\"`",
        "configs/copy.toml uses the shipped ontology: add `ontology = \"../ontology/actions.ttl\"`",
        "edit rules/stays_upright.rls",
    ] {
        assert!(printed.contains(line), "`{line}` in:\n{printed}");
    }
    assert!(done(folder, &["check", "pick.toml"]).contains("in ontology/actions.ttl"));
    let judged = actcheck(folder, &["recheck", "StaysUpright"]);
    assert!(judged.status.code() < Some(2), "{}", stderr(&judged));
    assert!(
        stdout(&judged).contains("StaysUpright"),
        "{}",
        stdout(&judged)
    );
    // A second property is written in the usual way, and a second campaign uses the existing
    // ontology.
    let printed = done(folder, &["new", "property", "StaysLow", "--for", "Pick"]);
    assert!(
        printed.contains("wrote rules/stays_low.rls and an entry in ontology/actions.ttl"),
        "{printed}"
    );
    let printed = done(folder, &["new", "campaign", "second"]);
    assert!(
        printed.contains("second.toml uses ontology/actions.ttl, which already existed"),
        "{printed}"
    );
    let checked = done(folder, &["check", "second.toml"]);
    assert!(checked.contains("in ontology/actions.ttl"), "{checked}");
}

#[test]
fn a_new_campaign_writes_requested_parts_and_uses_them() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let printed = done(
        folder,
        &["new", "campaign", "all", "--with", "rules,skill,model"],
    );
    assert_eq!(
        names(folder),
        ["all.toml", "models", "ontology", "rules", "skills"],
        "{printed}"
    );
    for part in [
        "all.toml",
        "models/ (",
        "ontology/ (",
        "rules/ (",
        "skills/pick.py",
    ] {
        assert!(printed.contains(part), "`{part}` in:\n{printed}");
    }
    let text = std::fs::read_to_string(folder.join("all.toml")).unwrap();
    for line in [
        "ontology = \"ontology/actions.ttl\"",
        "model_dir = \"models\"",
        "test_launcher = \"skills/pick.py\"",
    ] {
        assert!(
            text.lines().any(|written| written == line),
            "`{line}` in:\n{text}"
        );
    }
    let checked = done(folder, &["check", "all.toml"]);
    assert!(
        checked.contains("in ontology/actions.ttl") && checked.contains("17 models"),
        "{checked}"
    );
    // Each part is read from this folder.
    let vase = std::fs::read_to_string(folder.join("models/objects/bottle.toml")).unwrap();
    std::fs::write(
        folder.join("models/objects/vase.toml"),
        vase.replace("\"bottle\"", "\"vase\""),
    )
    .unwrap();
    assert!(done(folder, &["check", "all.toml"]).contains("18 models"));
    std::fs::remove_file(folder.join("skills/pick.py")).unwrap();
    assert!(refused(folder, &["check", "all.toml"]).contains("skills/pick.py does not exist"));
}

#[test]
fn the_skill_of_a_new_campaign_performs_the_pick() {
    let folder = tempfile::tempdir().unwrap();
    done(folder.path(), &["new", "campaign", "--with", "skill"]);
    assert_eq!(names(folder.path()), ["pick.toml", "skills"]);
    let bin = foreign::client_python().parent().unwrap().to_owned();
    let others = std::env::var_os("PATH").unwrap_or_default();
    let path =
        std::env::join_paths(std::iter::once(bin).chain(std::env::split_paths(&others))).unwrap();
    let run = std::process::Command::new(env!("CARGO_BIN_EXE_actcheck"))
        .args(["run", "pick.toml", "--runs", "1", "--format", "csv"])
        .current_dir(folder.path())
        .env("PATH", path)
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .output()
        .unwrap();
    assert!(run.status.code() < Some(2), "{}", stderr(&run));
    assert!(!stdout(&run).contains("broken"), "{}", stdout(&run));
}

#[test]
fn existing_files_are_kept_and_writes_are_all_or_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("pick.toml"), "mine").unwrap();
    let said = refused(folder, &["new", "campaign"]);
    assert!(
        said.contains("X015")
            && said.contains("pick.toml already exists")
            && said.contains("another name"),
        "{said}"
    );
    assert_eq!(
        std::fs::read_to_string(folder.join("pick.toml")).unwrap(),
        "mine"
    );
    std::fs::create_dir(folder.join("rules")).unwrap();
    std::fs::write(folder.join("rules/moved_object.rls"), "mine").unwrap();
    for arguments in [
        &["new", "campaign", "b", "--with", "ontology,model"][..],
        &["new", "property", "StaysUpright", "--for", "Pick"][..],
    ] {
        let said = refused(folder, arguments);
        assert!(
            said.contains("X015") && said.contains("rules/moved_object.rls already exists"),
            "{said}"
        );
        assert_eq!(names(folder), ["pick.toml", "rules"]);
    }
    for name in ["a/b", "a.toml", "", "two words", ".."] {
        let said = refused(folder, &["new", "campaign", name]);
        assert!(
            said.contains("X011") && said.contains("letters, digits, `_` and `-`"),
            "{said}"
        );
    }
    let said = refused(
        folder,
        &["new", "property", "StaysUpright", "--for", "Pikc"],
    );
    assert!(said.contains("did you mean `Pick`"), "{said}");
    assert_eq!(names(folder), ["pick.toml", "rules"]);
}

#[test]
fn without_a_configuration_run_and_check_list_the_existing_ones() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for command in ["run", "check"] {
        let said = refused(folder, &[command]);
        assert!(
            said.contains("X014") && said.contains("actcheck new campaign"),
            "{said}"
        );
    }
    std::fs::write(
        folder.join("Cargo.toml"),
        "[package]\nname = \"no campaign\"\n",
    )
    .unwrap();
    std::fs::write(folder.join("broken.toml"), "tests = [").unwrap();
    std::fs::create_dir(folder.join("configs")).unwrap();
    for name in ["b.toml", "configs/a.toml"] {
        std::fs::write(folder.join(name), "tests = [[\"Pick\"]]\ntest_count = 1\n").unwrap();
    }
    for command in ["run", "check"] {
        let said = refused(folder, &[command]);
        assert!(
            said.contains(&format!(
                "`actcheck {command} b.toml`; also here: configs/a.toml"
            )),
            "{said}"
        );
        assert!(
            !said.contains("Cargo.toml") && !said.contains("new campaign"),
            "{said}"
        );
    }
    std::fs::copy(folder.join("b.toml"), folder.join("configs/pick.toml")).unwrap();
    assert!(
        refused(folder, &["run"])
            .contains("`actcheck run configs/pick.toml`; also here: b.toml, configs/a.toml")
    );
    let checked = actcheck(folder, &["check"]);
    assert!(!stderr(&checked).contains("X014"), "{}", stderr(&checked));
}
