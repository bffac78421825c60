//! Projects of others: commands that read a history start no program unasked, say which one they
//! would start, and go on with the stored data. Printed commands can be copied into a shell,
//! whatever a project names its folders.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::support::{
    COARSEST, actcheck, edit, project_with, root, script, shipped_project, stderr, stdout,
};

/// A program that leaves a mark in its folder when it is started, and performs picks by doing
/// nothing.
const SKILL: &str = "import os, wire\n\
    open(os.path.join(os.path.dirname(os.path.abspath(__file__)), 'mark'), 'w').close()\n\
    wire.serve(lambda link, begin: {'type': 'end', 'succeeded': True, 'message': 'did nothing'})\n";

/// A downloaded project: `their project/c.toml` names a program, and the history beside it keeps
/// outcomes.
struct Downloaded {
    folder: tempfile::TempDir,
    run: String,
}

impl Downloaded {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let project = folder.path().join("their project");
        std::fs::create_dir(&project).unwrap();
        std::fs::copy(
            root().join("tests/protocol/wire.py"),
            project.join("wire.py"),
        )
        .unwrap();
        std::fs::write(project.join("skill.py"), SKILL).unwrap();
        let text = "tests = [[\"Pick\"]]\ntest_count = 2\ntest_launcher = \"python3 skill.py 'an argument'\"\n\
                    [physics]\nsteps_per_second = 60\niterations = 1\n\
                    [objectSurface]\nobject_surfaces = [\"coffee_table\"]\n[pickObject]\nmodel_list = [\"glass\"]\n\
                    [history]\nkeep = \"outcomes\"\n";
        std::fs::write(project.join("c.toml"), text).unwrap();
        let made = actcheck(
            folder.path(),
            &["run", "their project/c.toml", "--format", "json"],
        );
        let made: Value =
            serde_json::from_str(&stdout(&made)).unwrap_or_else(|_| panic!("{}", stderr(&made)));
        let downloaded = Self {
            run: made["runs"][0]["run"].as_str().unwrap().to_owned(),
            folder,
        };
        std::fs::remove_file(downloaded.mark()).expect("the campaign started the program");
        downloaded
    }

    fn mark(&self) -> PathBuf {
        self.folder.path().join("their project/mark")
    }

    fn command(&self, words: &[&str]) -> Output {
        actcheck(
            self.folder.path(),
            &[words, &["--history", "their project/.actcheck"]].concat(),
        )
    }
}

/// The words of an output, without line breaks and margins.
fn words(text: &str) -> String {
    text.split_whitespace()
        .filter(|word| *word != "│")
        .collect::<Vec<_>>()
        .join(" ")
}

/// `report`, `export` and `show` started the program of a downloaded project to simulate motion
/// again.
#[test]
fn reading_commands_start_no_program_and_name_the_one_that_they_would_start() {
    let downloaded = Downloaded::new();
    let run = downloaded.run.as_str();
    for (command, needs_motion) in [
        (&["report", "--html", "r.html"][..], true),
        (&["report", "--allure", "allure"], true),
        (
            &[
                "report",
                "--markdown",
                "--junit",
                "j.xml",
                "--earl",
                "e.ttl",
                "--jsonl",
                "o.jsonl",
            ],
            false,
        ),
        (&["export", "tables", "d", "--dataset"], true),
        (&["export", "tables", "d", "--course"], true),
        (&["export", "tables", "p", "--complete"], false),
        (&["export", "rdf", "n.nq", "--complete"], false),
        (&["export", "tables", "c", "--csv"], false),
        (&["export", "rdf", "t.ttl"], false),
        (&["export", "run", run, "-o", "case.toml"], false),
        (&["show", run, "--picture", "s.svg"], true),
        (&["show", run], false),
        (&["why", run], false),
        (&["list"], false),
        (&["analyse"], false),
        (&["health"], false),
        (&["list", "--rules"], false),
        (&["query", "SELECT * { ?run a act:Run }"], false),
    ] {
        let output = downloaded.command(command);
        let said = words(&stderr(&output));
        assert!(
            !downloaded.mark().exists(),
            "{command:?} started the program: {said}"
        );
        assert!(
            output.status.code().is_some_and(|code| code < 2),
            "{command:?}: {said}"
        );
        let names = said.contains("X059") && said.contains("--trust") && said.contains("python3");
        assert_eq!(
            names && said.contains("skill.py 'an argument'"),
            needs_motion,
            "{command:?}: {said}"
        );
    }
    let case = std::fs::read_to_string(downloaded.folder.path().join("case.toml")).unwrap();
    assert!(case.contains("[case]"), "{case}");
    assert!(
        downloaded.folder.path().join("s.svg").exists(),
        "the stored states are drawn"
    );
}

#[test]
fn with_consent_the_motion_is_simulated_again() {
    let downloaded = Downloaded::new();
    for command in [
        &[
            "show",
            downloaded.run.as_str(),
            "--picture",
            "s.svg",
            "--trust",
        ][..],
        &["report", "--html", "r.html", "--trust"],
        &["export", "tables", "d", "--dataset", "--trust"],
    ] {
        let output = downloaded.command(command);
        let said = words(&stderr(&output));
        assert!(
            output.status.code() == Some(0) && !said.contains("X059"),
            "{command:?}: {said}"
        );
        assert!(downloaded.mark().exists(), "{command:?}: {said}");
        std::fs::remove_file(downloaded.mark()).unwrap();
    }
}

/// Rules about time need the motion: their properties are not judged without it.
#[test]
fn rules_about_time_are_not_explained_and_not_judged_without_the_program() {
    let downloaded = Downloaded::new();
    let ontology = root().join("ontology/time.ttl");
    let ontology = ontology.display().to_string();
    let why = downloaded.command(&["why", &downloaded.run, "--ontology", &ontology]);
    let said = words(&stderr(&why));
    assert!(
        said.contains("X059") && said.contains("skill.py"),
        "{said}{}",
        stdout(&why)
    );
    let recheck = downloaded.command(&["recheck", "--ontology", &ontology]);
    let said = words(&stderr(&recheck));
    assert!(
        said.contains("X059") && said.contains("H031") && said.contains("--trust"),
        "{said}"
    );
    assert_eq!(recheck.status.code(), Some(2));
    assert!(!downloaded.mark().exists());
    let trusted = downloaded.command(&["recheck", "--ontology", &ontology, "--trust"]);
    assert!(
        trusted.status.code().is_some_and(|code| code < 2),
        "{}",
        stderr(&trusted)
    );
    assert!(downloaded.mark().exists());
}

/// The answer to a request by GET.
fn get(address: &str, path: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    write!(
        stream,
        "GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n"
    )
    .unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    String::from_utf8_lossy(&answer).into_owned()
}

#[test]
fn a_server_starts_no_program_of_the_project() {
    let downloaded = Downloaded::new();
    let mut server = Command::new(env!("CARGO_BIN_EXE_actcheck"))
        .args([
            "serve",
            "--port",
            "0",
            "--history",
            "their project/.actcheck",
        ])
        .current_dir(downloaded.folder.path())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut printed = String::new();
    let until = Instant::now() + Duration::from_secs(60);
    let output = server.stdout.as_mut().unwrap();
    while !printed.contains('\n') && Instant::now() < until {
        let mut byte = [0];
        output.read_exact(&mut byte).unwrap();
        printed.push(char::from(byte[0]));
    }
    let address = printed
        .split("http://")
        .nth(1)
        .and_then(|rest| rest.split('/').next())
        .unwrap()
        .to_owned();
    let report = get(&address, "/report");
    assert!(
        report.starts_with("HTTP/1.1 200"),
        "{}",
        &report[..report.len().min(300)]
    );
    let query = get(
        &address,
        "/sparql?query=SELECT%20*%20%7B%20%3Frun%20a%20act%3ARun%20%7D",
    );
    assert!(query.starts_with("HTTP/1.1 200"), "{query}");
    server.kill().unwrap();
    server.wait().unwrap();
    assert!(!downloaded.mark().exists());
}

/// A folder with a program `xacro` that behaves as the shell text says, and the robot `r.toml`
/// whose file it expands.
fn with_xacro(shell: &str, arguments: &str) -> tempfile::TempDir {
    let folder = project_with(COARSEST);
    let here = folder.path();
    std::fs::create_dir(here.join("tools")).unwrap();
    script(
        &here.join("tools/xacro"),
        &format!("#!/bin/sh\n{shell}\ncat \"$1\"\n"),
    );
    let robots = here.join("models/robots");
    let profile = std::fs::read_to_string(robots.join("fixed_arm.toml")).unwrap();
    let profile = format!(
        "{arguments}\n{}",
        profile.replace("fixed_arm.urdf", "r.urdf.xacro")
    );
    std::fs::write(robots.join("r.toml"), profile).unwrap();
    std::fs::copy(robots.join("fixed_arm.urdf"), robots.join("r.urdf.xacro")).unwrap();
    let config = here.join("configs/fixed_arm.toml");
    edit(
        &config,
        "profile = \"fixed_arm\"",
        "profile = \"../models/robots/r.toml\"",
    );
    folder
}

fn with_tools(folder: &Path, words: &[&str]) -> Output {
    let path = format!(
        "{}:{}",
        folder.join("tools").display(),
        std::env::var("PATH").unwrap()
    );
    let mut command = Command::new(env!("CARGO_BIN_EXE_actcheck"));
    command
        .args(words)
        .current_dir(folder)
        .env("PATH", path)
        .env("NO_COLOR", "1")
        .output()
        .unwrap()
}

/// `xacro_args = ["-o", FILE]` made `check` write any file.
#[test]
fn only_values_are_given_to_xacro() {
    for argument in [
        "-o",
        "--output=x",
        "-o:=x",
        "--",
        ":=x",
        "x=1",
        "a b:=x",
        "out.urdf",
        "--inorder",
        "-v",
    ] {
        let folder = with_xacro(
            "touch mark",
            &format!("xacro_args = [\"arm:=left\", \"{argument}\", \"b:=1\"]"),
        );
        let checked = with_tools(folder.path(), &["check", "configs/fixed_arm.toml"]);
        let said = words(&stderr(&checked));
        assert!(
            said.contains("W013") && checked.status.code() == Some(2),
            "{argument}: {said}"
        );
        assert!(
            !folder.path().join("mark").exists(),
            "{argument}: xacro was started"
        );
    }
    let proposed = actcheck(
        root(),
        &[
            "new",
            "robot",
            "r.urdf.xacro",
            "--xacro-arg=-o",
            "--out",
            "/nonexistent/r.toml",
        ],
    );
    assert!(stderr(&proposed).contains("W013"), "{}", stderr(&proposed));
    let folder = with_xacro(
        "[ \"$2\" = arm:=left ] || exit 1",
        "xacro_args = [\"arm:=left\", \"a/b.c-d:=-o x\"]",
    );
    let checked = with_tools(folder.path(), &["check", "configs/fixed_arm.toml"]);
    assert_eq!(checked.status.code(), Some(0), "{}", stderr(&checked));
}

/// Expressions in a xacro file are code.
#[test]
fn xacro_writes_into_no_file_and_is_not_started_by_reading_commands() {
    let folder = with_xacro("echo stolen >> keys || touch mark", "");
    let here = folder.path();
    std::fs::write(here.join("keys"), "mine\n").unwrap();
    let run = [
        "run",
        "configs/fixed_arm.toml",
        "--runs",
        "1",
        "--history",
        "h",
        "--format",
        "json",
    ];
    let made = with_tools(here, &run);
    let made: Value =
        serde_json::from_str(&stdout(&made)).unwrap_or_else(|_| panic!("{}", stderr(&made)));
    let run = made["runs"][0]["run"].as_str().unwrap();
    assert_eq!(
        std::fs::read_to_string(here.join("keys")).unwrap(),
        "mine\n"
    );
    std::fs::remove_file(here.join("mark")).expect("the campaign started xacro");
    for command in [
        &["report", "--html", "r.html"][..],
        &["show", run],
        &["export", "run", run, "-o", "case.toml"],
    ] {
        let output = with_tools(here, &[command, &["--history", "h"]].concat());
        let said = words(&stderr(&output));
        assert!(!here.join("mark").exists(), "{command:?}: {said}");
        let names =
            said.contains("X059") && said.contains("xacro") && said.contains("r.urdf.xacro");
        // A report shows the collision shapes then, and says so.
        let reads_robot = !command.contains(&"show");
        assert_eq!(names, reads_robot, "{command:?}: {said}");
    }
    let trusted = with_tools(
        here,
        &[
            "export",
            "run",
            run,
            "-o",
            "case.toml",
            "--history",
            "h",
            "--trust",
        ],
    );
    assert_eq!(trusted.status.code(), Some(0), "{}", stderr(&trusted));
    assert!(here.join("mark").exists() && here.join("case.toml").exists());
}

/// The words after `more: ` in an output, split by a shell.
fn shell_words(output: &str) -> Vec<Vec<u8>> {
    let line = output
        .lines()
        .find_map(|line| line.split_once("more: "))
        .expect("a command")
        .1
        .trim();
    let print = format!("printf '%s\\0' {line}");
    let output = Command::new("bash").args(["-c", &print]).output().unwrap();
    assert!(
        output.status.success() && output.stderr.is_empty(),
        "{line}"
    );
    output
        .stdout
        .split(|byte| *byte == 0)
        .filter(|word| !word.is_empty())
        .map(<[u8]>::to_vec)
        .collect()
}

/// `dir = "h; touch PWNED #"` in a configuration became a part of a command to copy.
#[test]
fn printed_commands_name_any_folder() {
    let project = project_with(COARSEST);
    let here = project.path();
    let config = std::fs::read_to_string(here.join("configs/pick.toml")).unwrap();
    // Nothing is picked, so that each run fails.
    std::fs::write(
        here.join("rules/moved_object.rls"),
        "success(?o) :- parameter(act:pickObject, ?o), ?o = 1 .",
    )
    .unwrap();
    for name in [
        "h; touch PWNED #",
        "a b's \"c\"",
        "$(touch PWNED)`touch PWNED`",
        "-history",
        "two\nlines\tand \u{1b}[2J\u{202e}",
        "&& touch PWNED",
    ] {
        let quoted: String = name
            .chars()
            .map(|c| format!("\\u{:04x}", u32::from(c)))
            .collect();
        std::fs::write(
            here.join("configs/q.toml"),
            format!("{config}\n[history]\ndir = \"{quoted}\"\n"),
        )
        .unwrap();
        let run = actcheck(here, &["run", "configs/q.toml", "--runs", "2", "-q"]);
        let words = shell_words(&stdout(&run));
        let texts: Vec<String> = words
            .iter()
            .map(|word| String::from_utf8_lossy(word).into_owned())
            .collect();
        let wanted = format!("configs/{name}");
        assert_eq!(
            (texts[1].as_str(), texts[3].as_str(), texts[4].as_str()),
            ("show", "--history", wanted.as_str())
        );
        // The printed command works.
        let shown = actcheck(
            here,
            &texts[1..].iter().map(String::as_str).collect::<Vec<_>>(),
        );
        assert_eq!(
            shown.status.code(),
            Some(0),
            "{texts:?}: {}",
            stderr(&shown)
        );
    }
    assert!(!here.join("PWNED").exists());
}

/// Commands in messages are made by one helper, which quotes them: a value in a text that looks
/// like a command is not.
#[test]
fn commands_in_messages_are_made_by_one_helper() {
    let mut found = Vec::new();
    let pattern = regex::Regex::new(
        r#"(actcheck|program\}?|\{\}) (show|list|run|why|check|health|replay|shrink|analyse|export|merge|report|recheck|query|new|launch-task)\b[^"`]*\{|--(history|campaign|property|ontology|config) \{"#,
    )
    .unwrap();
    let mut folders = vec![root().join("src")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ending| ending == "rs") {
                let text = std::fs::read_to_string(&path).unwrap();
                let code = text
                    .lines()
                    .enumerate()
                    .filter(|(_, line)| !line.trim_start().starts_with("//"));
                let lines = code.filter(|(_, line)| {
                    pattern.is_match(line) && !ALLOWED.iter().any(|known| line.contains(known))
                });
                found.extend(lines.map(|(number, line)| {
                    format!("{}:{}: {}", path.display(), number + 1, line.trim())
                }));
            }
        }
    }
    assert!(
        found.is_empty(),
        "use `ShellLine` for:\n{}",
        found.join("\n")
    );
}

/// Commands whose only values are ids, which are letters, digits, `-` and `_`, or names of this
/// program.
const ALLOWED: [&str; 15] = [
    "`--campaign {example}` (several may be named)",
    "exec {program} launch-task {folder}",
    "actcheck query --named failure-rates --endpoint",
    "`actcheck show {}` shows one of them",
    "`actcheck show {}` shows its output",
    "`actcheck list --campaign {id}` shows its runs",
    "`actcheck explain {}`",
    "`actcheck show {}`\", run.row.run, run.row.run",
    "more: actcheck show {}\", run.row.run",
    "`--campaign {id}`\"",
    "then `actcheck {command} pick.toml`",
    "format!(\"actcheck run {name}.toml\")",
    "write `actcheck {command} {}`",
    "`actcheck check {name}.toml` finds",
    "write `actcheck query --named {text}`",
];

/// The shipped project has no xacro, so that commands on it start nothing.
#[test]
fn the_shipped_project_starts_no_program() {
    let project = shipped_project();
    let here = project.path().join("models/robots");
    let names = std::fs::read_dir(here)
        .unwrap()
        .map(|entry| entry.unwrap().file_name());
    assert!(
        names
            .into_iter()
            .all(|name| !name.to_string_lossy().contains("xacro"))
    );
}
