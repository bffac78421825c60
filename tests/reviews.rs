//! `compare --html`, `--markdown` and `--known-issues`: the review of a change that makes a skill worse.

use std::path::Path;
use std::process::Output;

use serde_json::{Value, json};

use crate::support::chromium::Chromium;
use crate::support::foreign::axe;
use crate::support::{actcheck, edit, project, stderr, stdout};

/// Runs the shipped pick before and after a change of a rule, with the histories `base` and
/// `change`. Returns the ids of the campaigns.
fn changed(folder: &Path) -> [String; 2] {
    let ran = |history: &str| {
        let arguments = [
            "run",
            "configs/pick.toml",
            "--runs",
            "6",
            "--format",
            "json",
        ];
        let output = actcheck(folder, &[&arguments, &["--history", history][..]].concat());
        let json: Value = serde_json::from_str(&stdout(&output))
            .unwrap_or_else(|_| panic!("{}", stderr(&output)));
        json["campaign"].as_str().unwrap().to_owned()
    };
    let base = ran("base");
    edit(
        &folder.join("rules/moved_object.rls"),
        "?d > 0.02",
        "?d > 20.0",
    );
    [base, ran("change")]
}

fn review(folder: &Path, arguments: &[&str]) -> Output {
    actcheck(
        folder,
        &[&["compare", "base", "change"], arguments].concat(),
    )
}

/// Regression: campaigns of two revisions in two histories had the same ids, so that a flip was
/// `sqqv-19/sqqv-19`.
#[test]
fn a_change_is_reviewed_in_markdown_and_in_a_browser() {
    let project = project();
    let folder = project.path();
    let [base, change] = changed(folder);
    assert_ne!(base, change, "a rule differs");
    let output = review(folder, &["--html", "c.html", "--markdown", "-"]);
    assert!(output.status.success(), "{}", stderr(&output));
    let text = stdout(&output);
    for wanted in [
        "## actcheck: Undecided: about ",
        "Pick MovedObject",
        "fail in B only",
        "moved\\_object.rls",
        &format!("`{base}-1` in A, `{change}-1` in B"),
    ] {
        assert!(text.contains(wanted), "no `{wanted}` in\n{text}");
    }
    let mut browser = Chromium::start();
    for (theme, width) in [("light", 1440), ("dark", 1024), ("light", 420)] {
        browser.theme(theme);
        browser.size(width, 900);
        browser.open(&folder.join("c.html"), "/");
        browser.until("document.querySelector('.both').dataset.ready");
        let wide = browser.value("document.documentElement.scrollWidth");
        assert!(
            wide.as_u64().unwrap() <= u64::from(width),
            "{wide} at {width}"
        );
    }
    assert_eq!(
        browser.value("document.querySelectorAll('canvas.stage').length"),
        json!(2)
    );
    moves_in_step(&mut browser);
    let first = browser.value("document.querySelector('.both h3').textContent");
    browser.value("document.querySelectorAll('.pairs a')[1].click()");
    browser.until("document.querySelector('.both').dataset.ready");
    assert_ne!(
        browser.value("document.querySelector('.both h3').textContent"),
        first
    );
    if let Some(script) = axe() {
        browser.value(&format!("{script};0"));
        let found = browser.value(
            "axe.run(document, { resultTypes: ['violations'] }).then((found) => found.violations.flatMap((rule) => rule.nodes.map((node) => `${rule.id}: ${node.html}`)))",
        );
        assert_eq!(found, json!([]), "{found:#}");
    }
    assert!(browser.complaints.is_empty(), "{:#?}", browser.complaints);
}

/// The common clock moves both replays, and so does a click on the timeline of each.
fn moves_in_step(browser: &mut Chromium) {
    let marks = "[...document.querySelectorAll('.both .timeline .now')].map((mark) => Number(mark.getAttribute('x1')))";
    let moved = |browser: &mut Chromium, before: &Value, how: &str| {
        browser.value(how);
        let after = browser.value(marks);
        let pairs = || {
            let both = before.as_array().unwrap().iter();
            both.zip(after.as_array().unwrap())
        };
        assert_eq!(pairs().count(), 2, "{how}");
        assert!(pairs().all(|(one, other)| one != other), "{how}: {after}");
        after
    };
    let begun = browser.value(marks);
    let slid = moved(
        browser,
        &begun,
        "(() => { const slider = document.querySelector('.both .slider'); slider.value = 1.5; slider.dispatchEvent(new Event('input')); })()",
    );
    let clock = "document.querySelector('.both .clock').textContent.split(' ')[0]";
    assert_eq!(browser.value(clock), json!("1.5"));
    moved(
        browser,
        &slid,
        "(() => { const at = [...document.querySelectorAll('.both .timeline')][1], { left, width, top } = at.getBoundingClientRect(); \
         at.dispatchEvent(new MouseEvent('click', { clientX: left + 0.5 * width, clientY: top + 5 })); })()",
    );
    assert_ne!(browser.value(clock), json!("1.5"));
}

#[test]
fn known_issues_are_set_apart_until_their_day() {
    let project = project();
    let folder = project.path();
    changed(folder);
    let known = |fails: &str, until: &str| {
        let text = format!(
            "[[issue]]\nfails = [{fails}]\nreason = \"the limit is too high\"\nuntil = \"{until}\"\n"
        );
        std::fs::write(folder.join("known.toml"), text).unwrap();
        let gate = ["--known-issues", "known.toml", "--fail-if-worse", "0.5"];
        review(folder, &[&gate, &["--format", "json"][..]].concat())
    };
    let counted = known("\"Pick MovedObject\"", "2020-02-29");
    assert!(stderr(&counted).contains("X098"), "{}", stderr(&counted));
    assert_eq!(counted.status.code(), Some(1), "{}", stdout(&counted));
    let apart = known("\"MovedObject\"", "9999-12-31");
    assert_eq!(
        apart.status.code(),
        Some(0),
        "{}{}",
        stdout(&apart),
        stderr(&apart)
    );
    let [counted, apart] =
        [counted, apart].map(|output| -> Value { serde_json::from_str(&stdout(&output)).unwrap() });
    let excused = apart["known"][0]["b"].as_array().unwrap().len() as u64;
    assert!(excused > 0, "{apart:#}");
    let pairs = |json: &Value| json["pairs"].as_u64().unwrap();
    assert_eq!(pairs(&counted), pairs(&apart) + excused);
    assert_eq!(
        [&counted, &apart].map(|json| json["known"][0]["expired"].clone()),
        [json!(true), json!(false)]
    );
    let wrong = known("\"MoveObject\"", "9999-12-31");
    assert_eq!(wrong.status.code(), Some(2));
    let said = stderr(&wrong);
    assert!(
        said.contains("X045") && said.contains("MovedObject"),
        "{said}"
    );
    let missing = review(folder, &["--known-issues", "none.toml"]);
    assert!(stderr(&missing).contains("C001"), "{}", stderr(&missing));
    let both = review(folder, &["--html", "-", "--markdown", "-"]);
    assert!(stderr(&both).contains("X058"), "{}", stderr(&both));
}
