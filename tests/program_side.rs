//! The side of a user's program in the report: its output, commands and questions in step with the
//! replay; and the choice of signals.

use serde_json::{Value, json};

use crate::accessible::no_findings;
use crate::protocol::{project, run};
use crate::support::actcheck;
use crate::support::chromium::Chromium;
use crate::support::foreign::axe;

/// The texts of all elements that match a selector.
fn texts(browser: &mut Chromium, selector: &str) -> Vec<String> {
    let all = browser.value(&format!(
        "[...document.querySelectorAll({selector:?})].map((it) => it.textContent)"
    ));
    all.as_array()
        .unwrap()
        .iter()
        .filter_map(Value::as_str)
        .map(str::to_owned)
        .collect()
}

#[test]
fn the_side_of_a_program_and_chosen_signals_are_in_step_with_the_replay() {
    let folder = project("talks.py", "[[\"Pick\"]]", 1, "");
    let (_, json, complaints) = run(folder.path(), &[]);
    let id = json["runs"][0]["run"].as_str().expect(&complaints);
    let made = actcheck(
        folder.path(),
        &["report", "--html", "report.html", "--history", ".actcheck"],
    );
    assert!(made.status.success());
    let mut browser = Chromium::start();
    browser.size(1280, 860);
    browser.open(&folder.path().join("report.html"), &format!("/run/{id}"));
    browser.until("document.querySelector('.watch')?.dataset.ready");

    let lines = texts(&mut browser, ".skilllog .printed code");
    assert_eq!(lines[1], "half way", "{lines:?}");
    let commands = texts(&mut browser, ".skilllog .commanded span");
    assert!(
        commands[0].starts_with("30 commands, at last arm_flex_joint \u{2212}0.29"),
        "{commands:?}"
    );
    // A click on an entry shows its moment, and the entry of the moment is marked.
    browser.value(
        "[...document.querySelectorAll('.skilllog .printed')].find((it) => it.textContent.includes('half way')).querySelector('button').click()",
    );
    let clock = texts(&mut browser, ".clock");
    assert!(clock[0].starts_with("0.5 / "), "{clock:?}");
    let current = "document.querySelector('.skilllog [aria-current]').textContent";
    let marked = browser.value(current);
    assert!(
        !marked.as_str().unwrap().contains("30 commands"),
        "{marked}"
    );

    // Any joint and any quantity of a body, with a limit of one's own.
    browser.value("document.querySelector('.chooser summary').click()");
    browser.until("document.querySelector('.quantities .quantity')");
    browser.value(
        "(() => { const it = document.querySelector('.chooser input[type=search]'); it.value = 'arm_flex'; it.dispatchEvent(new Event('input')); })()",
    );
    let names = texts(&mut browser, ".quantity .check");
    assert_eq!(names, [" position", " velocity", " effort", " target"]);
    let before = texts(&mut browser, ".signal .value").len();
    browser.value(
        "(() => { const it = document.querySelector('.quantity input.limit'); it.value = '-0.1'; it.dispatchEvent(new Event('change')); })()",
    );
    assert_eq!(texts(&mut browser, ".signal .value").len(), before + 1);
    let limits = texts(&mut browser, ".limitname");
    assert!(
        limits.iter().any(|limit| limit.starts_with("limit <")),
        "{limits:?}"
    );
    let value = browser.value(
        "document.querySelector('[data-signal=\"position of arm_flex_joint\"] .value').textContent",
    );
    assert!(
        value.as_str().unwrap().starts_with("\u{2212}0.2"),
        "{value}"
    );
    assert_eq!(
        browser.value("document.querySelectorAll('.limit.own').length"),
        json!(1)
    );
    if let Some(axe) = axe() {
        browser.value(&format!("{axe};0"));
        no_findings(&mut browser, "a run with a program");
    }
    assert!(browser.complaints.is_empty(), "{:#?}", browser.complaints);
}
