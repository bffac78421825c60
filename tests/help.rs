//! Help, completions and the manual: every command is in each of them.

use std::path::Path;
use std::process::Command;
use std::sync::OnceLock;

use crate::support::{actcheck, foreign, root, stderr, stdout};

/// The commands that the program's help lists.
fn commands() -> Vec<String> {
    let help = stdout(&actcheck(root(), &["-h"]));
    let list = help
        .split("First steps:\n")
        .nth(1)
        .and_then(|rest| rest.split("Options:").next())
        .expect("there is a list");
    let first = |line: &str| {
        line.strip_prefix("  ")?
            .split(' ')
            .next()
            .filter(|word| !word.is_empty())
            .map(str::to_owned)
    };
    list.lines().filter_map(first).collect()
}

/// The commands below a command, with its name.
fn below(command: &str) -> Vec<String> {
    let help = stdout(&actcheck(root(), &[command, "-h"]));
    let list = help.split("Commands:\n").nth(1).unwrap_or_default();
    let list = list.split("\n\n").next().unwrap_or_default();
    let names = list
        .lines()
        .filter_map(|line| line.strip_prefix("  ")?.split(' ').next())
        .filter(|name| !["", "help"].contains(name));
    names.map(|name| format!("{command} {name}")).collect()
}

/// A program with few commands and options is learned soon: options that many commands have count
/// once.
#[test]
fn commands_and_options_are_few() {
    let commands = commands();
    // 22 for campaigns, two for episodes of other simulators, and four that try the verdicts: in
    // another engine, in a changed scene, by more properties, and beside people's labels.
    assert!(commands.len() <= 28, "{}: {commands:?}", commands.len());
    let options = |arguments: &[&str]| -> Vec<String> {
        let help = stdout(&actcheck(root(), &[arguments, &["--help"]].concat()));
        let option = |line: &str| {
            let line = line.trim_start();
            let line = match line.split_once(", ") {
                Some((short, long)) if short.len() == 2 => long,
                _ => line,
            };
            let name = line
                .strip_prefix("--")?
                .split([' ', '[', '=', '.'])
                .next()?;
            (name != "help").then(|| format!("{} --{name}", arguments.join(" ")))
        };
        let list = help.split("Options:\n").skip(1).collect::<String>();
        list.lines().filter_map(option).collect()
    };
    let mut all = options(&[]);
    for command in &commands {
        all.extend(options(&[command.as_str()]));
        for command in below(command) {
            all.extend(options(&command.split(' ').collect::<Vec<_>>()));
        }
    }
    assert!(all.len() > 100, "they are found: {all:#?}");
    assert!(all.len() <= 168, "{}: {all:#?}", all.len());
}

#[test]
fn the_commands_of_the_first_steps_come_first() {
    for option in ["-h", "--help"] {
        let help = stdout(&actcheck(root(), &[option]));
        let headings: Vec<&str> = help
            .lines()
            .filter(|line| line.ends_with(':') && !line.starts_with(' '))
            .map(|line| line.trim_end_matches(':'))
            .collect();
        assert_eq!(
            headings,
            [
                "First steps",
                "More",
                "Options",
                "Options of many commands",
                "Example",
                "Environment"
            ],
            "{help}"
        );
        assert!(
            help.lines().all(|line| line.chars().count() <= 100),
            "{help}"
        );
    }
    assert_eq!(
        commands()[..7],
        ["run", "list", "why", "report", "query", "recheck", "new"]
    );
    let page = stdout(&actcheck(root(), &["new", "man"]));
    let sections: Vec<String> = page
        .lines()
        .filter_map(|line| {
            Some(
                line.strip_prefix(".SH \"actcheck ")?
                    .trim_end_matches('"')
                    .replace("\\-", "-"),
            )
        })
        .collect();
    let expected: Vec<String> = commands()
        .into_iter()
        .flat_map(|command| {
            let below = below(&command);
            if below.is_empty() {
                vec![command]
            } else {
                below
            }
        })
        .collect();
    assert_eq!(sections, expected, "the manual has the same order");
}

#[test]
fn explain_knows_every_code_and_suggests_the_nearest() {
    let known = stdout(&actcheck(root(), &["explain", "c003"]));
    assert!(
        known.starts_with("C003: ") && known.contains("way out"),
        "{known}"
    );
    let json = |arguments: &[&str]| -> Vec<serde_json::Value> {
        serde_json::from_str(&stdout(&actcheck(root(), arguments))).expect("a JSON array")
    };
    assert_eq!(json(&["explain", "C003", "--format", "json"]).len(), 1);
    let all = json(&["explain", "--format", "json"]);
    assert!(all.len() > 200, "{}", all.len());
    let list = stdout(&actcheck(root(), &["explain"]));
    for code in &all {
        assert!(
            list.contains(&format!("\n  {}  ", code["code"].as_str().unwrap())),
            "{code}"
        );
    }
    assert!(
        stdout(&actcheck(root(), &["explain", "--format", "csv"]))
            .starts_with("code,area,meaning,cause,remedy\n")
    );
    let page = stdout(&actcheck(root(), &["explain", "--format", "markdown"]));
    assert_eq!(
        page,
        std::fs::read_to_string(root().join("src/codes.md")).unwrap(),
        "src/codes.md is out of date"
    );
    for (wrong, help) in [
        ("C0003", "did you mean `C003`"),
        ("R999", "did you mean `R093`"),
        ("oops", "a letter and three digits"),
    ] {
        let output = actcheck(root(), &["explain", wrong]);
        assert_eq!(output.status.code(), Some(2));
        assert!(
            stderr(&output).contains("X017") && stderr(&output).contains(help),
            "{wrong}: {}",
            stderr(&output)
        );
    }
}

/// The value of `--format` and the durations have one spelling in the help of every command.
#[test]
fn options_have_one_spelling_in_every_command() {
    let mut with_format = 0;
    for command in commands() {
        let help = stdout(&actcheck(root(), &[&command, "-h"]));
        // Undoes line wrapping.
        let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(
            !help.contains("SECONDS") && !help.contains("-secs"),
            "{command}: {help}"
        );
        if let Some((_, rest)) = help.split_once("--format <FORMAT>") {
            let values = rest
                .split_once("[possible values: ")
                .unwrap_or_else(|| panic!("{command}: {help}"))
                .1;
            let values: Vec<&str> = values
                .split(']')
                .next()
                .unwrap()
                .split(',')
                .map(str::trim)
                .collect();
            assert_eq!(values[..3], ["text", "csv", "json"], "{command}: {help}");
            with_format += 1;
        }
    }
    assert!(with_format > 0, "no command has `--format <FORMAT>`");
}

#[test]
fn the_help_of_every_command_ends_with_an_example() {
    let commands = commands();
    let below: Vec<String> = commands.iter().flat_map(|command| below(command)).collect();
    assert!(below.len() >= 10, "{below:?}");
    for mut arguments in commands
        .iter()
        .chain(&below)
        .map(|command| command.split(' ').collect::<Vec<_>>())
    {
        let example = format!("actcheck {}", arguments.join(" "));
        arguments.push("--help");
        let help = stdout(&actcheck(root(), &arguments));
        let last = help.rsplit("\n\n").next().unwrap();
        assert!(
            last.starts_with("Example") && last.contains(&example),
            "{arguments:?}: {last}"
        );
    }
}

#[test]
fn completions_list_every_command() {
    for shell in ["bash", "zsh", "fish"] {
        let output = actcheck(root(), &["new", "completions", shell]);
        assert!(output.status.success(), "{}", stderr(&output));
        let script = stdout(&output);
        for command in commands() {
            assert!(script.contains(&command), "{shell} knows no `{command}`");
        }
        assert!(script.contains("until-width"), "{shell} knows no options");
        assert!(
            !script.contains("serve-query") && !script.contains("serve-report"),
            "{shell} offers a hidden command"
        );
        if foreign::has(shell) {
            let folder = tempfile::tempdir().unwrap();
            let file = folder.path().join("script");
            std::fs::write(&file, &script).unwrap();
            let read = Command::new(shell).arg("-n").arg(&file).output().unwrap();
            assert!(
                read.status.success() && stderr(&read).is_empty(),
                "{shell}: {}",
                stderr(&read)
            );
        } else {
            foreign::left_out(shell, "it is not installed");
        }
    }
    let wrong = actcheck(root(), &["new", "completions", "tcsh"]);
    assert_eq!(wrong.status.code(), Some(2));
}

/// Bash completes the last word of a line, which is being typed.
#[test]
fn bash_completes_commands_and_options() {
    let script = stdout(&actcheck(root(), &["new", "completions", "bash"]));
    for (line, offered) in [
        ("actcheck rech", "recheck"),
        ("actcheck run --until-w", "--until-width"),
        ("actcheck new ca", "campaign"),
    ] {
        let words: Vec<&str> = line.split(' ').collect();
        let ask = format!(
            "{script}\nCOMP_WORDS=({line}); COMP_CWORD={}; COMP_LINE='{line}'; COMP_POINT={}\n\
             _actcheck actcheck '{}' '{}'\necho \"${{COMPREPLY[@]}}\"\n",
            words.len() - 1,
            line.len(),
            words[words.len() - 1],
            words[words.len() - 2],
        );
        let output = Command::new("bash")
            .args(["--norc", "-c", &ask])
            .output()
            .unwrap();
        assert_eq!(
            stdout(&output).trim(),
            offered,
            "{line}: {}",
            stderr(&output)
        );
    }
}

/// The rendered page, or its source if groff is not installed. A groff warning fails the test.
fn rendered(page: &Path) -> String {
    static HAS_GROFF: OnceLock<bool> = OnceLock::new();
    let has_groff = *HAS_GROFF.get_or_init(|| {
        let found = foreign::has("groff");
        if !found {
            foreign::left_out("rendering of the manual pages", "groff is not installed");
        }
        found
    });
    if !has_groff {
        return std::fs::read_to_string(page).unwrap().replace("\\-", "-");
    }
    let output = Command::new("groff")
        .args(["-Kutf8", "-man", "-Tutf8", "-P-c", "-ww"])
        .arg(page)
        .output()
        .unwrap();
    assert!(
        output.status.success() && stderr(&output).is_empty(),
        "{}",
        stderr(&output)
    );
    // Bold letters are overstruck.
    stdout(&output)
        .replace("_\u{8}", "")
        .chars()
        .fold(String::new(), |mut text, c| {
            if c == '\u{8}' {
                _ = text.pop()
            } else {
                text.push(c)
            }
            text
        })
}

#[test]
fn the_manual_has_every_command_with_options_and_examples() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("actcheck.1");
    std::fs::write(&page, stdout(&actcheck(root(), &["new", "man"]))).unwrap();
    let text = rendered(&page);
    for heading in ["NAME", "SYNOPSIS", "DESCRIPTION", "actcheck new campaign"] {
        assert!(
            text.lines().any(|line| line.contains(heading)),
            "no {heading}:\n{text}"
        );
    }
    for command in commands()
        .iter()
        .filter(|command| below(command).is_empty())
    {
        assert!(
            text.contains(&format!("actcheck {command}")),
            "no `{command}` in:\n{text}"
        );
    }
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(
        words.contains("--until-width")
            && words.contains("actcheck run configs/pick.toml --runs 5"),
        "{words}"
    );
    assert!(
        !text.contains("serve-query") && !text.contains("EXTRA"),
        "{text}"
    );

    let printed = stdout(&actcheck(folder.path(), &["new", "man", "--out", "man1"]));
    assert!(printed.contains("man -l man1/actcheck.1"), "{printed}");
    for command in commands()
        .into_iter()
        .chain(["new-campaign".to_owned(), "new-property".to_owned()])
    {
        let text = rendered(&folder.path().join(format!("man1/actcheck-{command}.1")));
        assert!(text.contains("DESCRIPTION"), "{text}");
    }
}
