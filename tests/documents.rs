//! The pages of `docs/`: every command is run, every link leads somewhere, and generated pages are
//! up to date.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use regex::Regex;

use crate::support::checkout::{Checkout, blocks};
use crate::support::expected::assert_expected;
use crate::support::{actcheck, edit, root, script, stderr, stdout};

/// Pages with commands. Each has a test, so that they run side by side.
const WITH_COMMANDS: [&str; 11] = [
    "bisect.md",
    "cookbook.md",
    "episodes.md",
    "failures.md",
    "history.md",
    "launch.md",
    "own-skill.md",
    "properties.md",
    "time.md",
    "verdicts.md",
    "whole-task.md",
];

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Runs all commands of a page in the order of the page, after README's first command.
fn commands_work(page: &str) {
    commands_work_in(&Checkout::after_first_run(), page, &[]);
}

fn commands_work_in(checkout: &Checkout, page: &str, environment: &[(&str, &str)]) {
    let blocks = blocks(&read(&root().join("docs").join(page)), "sh");
    assert!(!blocks.is_empty(), "docs/{page} has no commands");
    for block in &blocks {
        checkout.run(block, environment);
    }
}

#[test]
fn commands_of_the_page_about_bisection_work() {
    let checkout = Checkout::after_first_run();
    let [author, committer] =
        ["GIT_AUTHOR", "GIT_COMMITTER"].map(|who| [format!("{who}_NAME"), format!("{who}_EMAIL")]);
    let identity: Vec<(&str, &str)> = author
        .iter()
        .chain(&committer)
        .map(|name| (name.as_str(), "ada@example.org"))
        .collect();
    let files = "configs/*.toml ontology rules models";
    checkout.run(
        &format!("git init --quiet && git add {files} && git commit --quiet --message project"),
        &identity,
    );
    commands_work_in(&checkout, "bisect.md", &identity);
}

#[test]
fn commands_of_the_cookbook_work() {
    commands_work("cookbook.md");
}

#[test]
fn commands_of_the_page_about_episodes_work() {
    commands_work("episodes.md");
}

#[test]
fn commands_of_the_page_about_failures_work() {
    commands_work("failures.md");
}

#[test]
fn commands_of_the_page_about_histories_work() {
    commands_work("history.md");
}

#[test]
fn commands_of_the_page_about_launches_work() {
    commands_work("launch.md");
}

#[test]
fn commands_of_the_page_about_own_skills_work() {
    commands_work("own-skill.md");
}

#[test]
fn commands_of_the_page_about_properties_work() {
    commands_work("properties.md");
}

#[test]
fn commands_of_the_page_about_time_work() {
    commands_work("time.md");
}

#[test]
fn commands_of_the_page_about_verdicts_work() {
    commands_work("verdicts.md");
}

#[test]
fn commands_of_the_page_about_the_whole_task_work() {
    commands_work("whole-task.md");
}

/// The pages of `docs/`, sorted, without the table of contents.
fn pages() -> Vec<String> {
    let entries = std::fs::read_dir(root().join("docs")).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<String> = names
        .filter(|name| name.ends_with(".md") && name != "SUMMARY.md")
        .collect();
    names.sort();
    names
}

#[test]
fn every_page_with_commands_has_a_test() {
    let with_commands = pages()
        .into_iter()
        .filter(|page| !blocks(&read(&root().join("docs").join(page)), "sh").is_empty());
    assert_eq!(with_commands.collect::<Vec<_>>(), WITH_COMMANDS);
}

#[test]
fn the_cookbook_answers_twenty_questions() {
    let text = read(&root().join("docs/cookbook.md"));
    let questions: Vec<&str> = text.split("\n### ").skip(1).collect();
    assert_eq!(questions.len(), 20);
    for question in questions {
        assert!(
            !blocks(question, "sh").is_empty(),
            "no command answers: {}",
            question.lines().next().unwrap()
        );
    }
}

#[test]
fn the_table_of_contents_lists_every_page_once() {
    let summary = read(&root().join("docs/SUMMARY.md"));
    let mut listed: Vec<String> = links(&summary)
        .into_iter()
        .map(|link| link.trim_start_matches("./").to_owned())
        .collect();
    listed.sort();
    assert_eq!(listed, pages());
}

/// The targets of Markdown links and pictures, without fenced code.
fn links(text: &str) -> Vec<String> {
    let mut fenced = false;
    let prose: Vec<&str> = text
        .lines()
        .filter(|line| {
            let fence = line.trim_start().starts_with("```");
            fenced ^= fence;
            !fence && !fenced
        })
        .collect();
    let link = Regex::new(r"\]\(([^()\s]+)\)").unwrap();
    let prose = Regex::new("`[^`]*`")
        .unwrap()
        .replace_all(&prose.join("\n"), "")
        .into_owned();
    link.captures_iter(&prose)
        .map(|found| found[1].to_owned())
        .collect()
}

/// The anchors of a page's headings, as GitHub and mdBook write them.
fn anchors(text: &str) -> BTreeSet<String> {
    let headings = text.lines().filter(|line| line.starts_with('#'));
    let anchor = |line: &str| -> String {
        let words = line.trim_start_matches('#').trim().to_lowercase();
        let kept = words
            .chars()
            .filter(|c| c.is_alphanumeric() || " -_".contains(*c));
        kept.map(|c| if c == ' ' { '-' } else { c }).collect()
    };
    headings.map(anchor).collect()
}

/// Documents outside `docs/` whose links are checked.
const FURTHER: [&str; 9] = [
    "README.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "clients/PROTOCOL.md",
    "clients/python/README.md",
    "fuzz/README.md",
    "models/README.md",
    "notebooks/README.md",
    "rules/README.md",
];

#[test]
fn every_link_of_the_documents_leads_somewhere() {
    let mut files: Vec<PathBuf> = FURTHER.map(|name| root().join(name)).to_vec();
    files.extend(pages().iter().map(|page| root().join("docs").join(page)));
    let mut broken = Vec::new();
    let mut checked = 0;
    for file in files {
        let text = read(&file);
        for link in links(&text) {
            if link.starts_with("https://") {
                continue;
            }
            checked += 1;
            let (path, anchor) = link.split_once('#').unwrap_or((&link, ""));
            let target = if path.is_empty() {
                file.clone()
            } else {
                file.parent().unwrap().join(path)
            };
            let leads = target.exists()
                && (anchor.is_empty()
                    || (target.is_file() && anchors(&read(&target)).contains(anchor)));
            if !leads {
                broken.push(format!("{}: {link}", file.display()));
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
    assert!(checked > 80, "only {checked} links");
}

/// Run with `UPDATE_EXPECT=1` to write the page.
#[test]
fn the_configuration_reference_is_up_to_date() {
    let page = stdout(&actcheck(root(), &["new", "schema", "--markdown"]));
    assert_expected([(root().join("docs/configuration.md"), page)]);
}

/// The commands of a workflow: blocks after `run: |`, lines after `run: `, and the items of
/// `script:` lists.
fn steps(workflow: &str) -> Vec<String> {
    let indent = |line: &str| line.len() - line.trim_start().len();
    let lines: Vec<&str> = workflow.lines().collect();
    let mut steps = Vec::new();
    for (idx, line) in lines.iter().enumerate() {
        let key = line.trim_start().trim_start_matches("- ");
        let below = || {
            let inner = lines[idx + 1..]
                .iter()
                .take_while(|next| next.trim().is_empty() || indent(next) > indent(line));
            inner.map(|next| next.trim())
        };
        match key.split_once(": ") {
            Some(("run", "|")) => steps.push(below().collect::<Vec<_>>().join("\n")),
            Some(("run", command)) => steps.push(command.to_owned()),
            _ if key == "script:" => {
                steps.extend(below().filter_map(|item| Some(item.strip_prefix("- ")?.to_owned())));
            }
            _ => {}
        }
    }
    steps
}

/// A checkout that is a repository whose main branch has the project, without downloads.
fn repository() -> Checkout {
    let checkout = Checkout::fresh();
    script(
        &checkout.path().join("bin/pip"),
        "#!/bin/sh\ntest \"$1 $2\" = 'install actcheck.whl'\n",
    );
    checkout.run(
        "git init --quiet --initial-branch main && git add configs ontology rules models && \
         git -c user.name=a -c user.email=a@b.c commit --quiet --message project && \
         git remote add origin \"$PWD\" && git fetch --quiet origin",
        &[],
    );
    checkout
}

/// Runs the steps of a workflow before its comparison, each of which must succeed, and returns the
/// comparison.
fn before_the_gate(checkout: &Checkout, name: &str, environment: &[(&str, &str)]) -> String {
    let steps = steps(&read(&root().join("docs/ci").join(name)));
    assert!(steps.len() >= 4, "{steps:#?}");
    let (gate, others) = steps.split_last().unwrap();
    assert!(gate.starts_with("actcheck compare "), "{gate}");
    for step in others {
        checkout.run(&format!("set -e\n{step}"), environment);
    }
    gate.clone()
}

/// The environment of both workflows: a short campaign that shows a large change, and a file in
/// place of the wheel.
const SHORT: [(&str, &str); 3] = [
    ("CONFIG", "configs/pick.toml"),
    ("RUNS", "12"),
    ("ACTCHECK_WHEEL", "actcheck.whl"),
];

#[test]
fn the_github_workflow_reports_and_accepts_an_equal_change() {
    let environment = [
        &SHORT[..],
        &[
            ("GITHUB_BASE_REF", "main"),
            ("GITHUB_STEP_SUMMARY", "summary.md"),
        ],
    ]
    .concat();
    let checkout = repository();
    let gate = before_the_gate(&checkout, "github.yml", &environment);
    checkout.run(&gate, &environment);
    for file in ["report.html", "junit.xml", "compare.html"] {
        assert!(
            !read(&checkout.path().join(file)).is_empty(),
            "{file} is empty"
        );
    }
    let summary = read(&checkout.path().join("summary.md"));
    assert!(
        summary.starts_with("## actcheck: A and B are the same"),
        "{summary}"
    );
}

#[test]
fn the_gitlab_pipeline_reports_and_refuses_a_worse_change() {
    let environment = [
        &SHORT[..],
        &[("CI_MERGE_REQUEST_TARGET_BRANCH_NAME", "main")],
    ]
    .concat();
    let checkout = repository();
    // The change demands an impossible lift; the base in its own worktree does not.
    edit(
        &checkout.path().join("rules/moved_object.rls"),
        "?d > 0.02",
        "?d > 20.0",
    );
    let gate = before_the_gate(&checkout, "gitlab.yml", &environment);
    for file in ["report.html", "junit.xml"] {
        assert!(
            !read(&checkout.path().join(file)).is_empty(),
            "{file} is empty"
        );
    }
    let output = checkout.shell(&gate, &environment);
    assert_eq!(
        output.status.code(),
        Some(1),
        "{}{}",
        stdout(&output),
        stderr(&output)
    );
    let review = read(&checkout.path().join("compare.md"));
    assert!(
        review.starts_with("## actcheck: B is worse than A"),
        "{review}"
    );
    assert!(
        review.contains("moved\\_object.rls") && review.contains("fail in B only"),
        "{review}"
    );
    assert!(!read(&checkout.path().join("compare.html")).is_empty());
}
