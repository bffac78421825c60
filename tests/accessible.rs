//! Accessibility of the report and the query page: contrasts, names, and the findings of axe-core.

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::json;

use crate::support::chromium::Chromium;
use crate::support::foreign::axe;
use crate::support::server::Server;
use crate::support::{actcheck, root, shipped, stderr};

const VIEWS: [&str; 9] = [
    "#/",
    "#/properties",
    "#/modes",
    "#/patterns",
    "#/collisions",
    "#/map",
    "#/history",
    "#/runs",
    "#/runs?q=no+such+run&outcome=failed",
];
/// Least contrast of text (WCAG 2.2, level AA).
const LEAST: f64 = 4.5;

/// Colours as red, green and blue, by their names.
type Colours = BTreeMap<String, [f64; 3]>;

/// The colours of each block of a style sheet that sets a `color-scheme`: light first.
fn themes(style: &str) -> Vec<Colours> {
    let blocks = style
        .split('{')
        .skip(1)
        .filter_map(|block| block.split('}').next());
    blocks
        .map(colours)
        .filter(|colours| colours.contains_key("paper"))
        .collect()
}

fn colours(block: &str) -> Colours {
    let set = block.split(';').filter_map(|line| line.split_once(':'));
    let named = set.filter_map(|(name, value)| {
        Some((
            name.trim().strip_prefix("--")?,
            value.trim().strip_prefix('#')?,
        ))
    });
    named
        .map(|(name, hex)| {
            let digits: Vec<f64> = hex
                .chars()
                .map(|digit| f64::from(digit.to_digit(16).unwrap()))
                .collect();
            let part = |at: usize| match digits.len() {
                3 => 17.0 * digits[at],
                _ => 16.0 * digits[2 * at] + digits[2 * at + 1],
            };
            (name.to_owned(), [part(0), part(1), part(2)])
        })
        .collect()
}

/// The contrast ratio of two colours, as WCAG defines it.
fn contrast(a: [f64; 3], b: [f64; 3]) -> f64 {
    let luminance = |colour: [f64; 3]| {
        let linear = colour.map(|part| {
            let part = part / 255.0;
            if part <= 0.04045 {
                part / 12.92
            } else {
                ((part + 0.055) / 1.055).powf(2.4)
            }
        });
        0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
    };
    let (a, b) = (luminance(a) + 0.05, luminance(b) + 0.05);
    a.max(b) / a.min(b)
}

/// A colour mixed into another, as `color-mix(in srgb, …)` does.
fn mixed(share: f64, a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|part| share * a[part] + (1.0 - share) * b[part])
}

fn holds(colours: &Colours, text: &str, behind: &str) {
    let found = contrast(colours[text], colours[behind]);
    assert!(found >= LEAST, "{text} on {behind}: {found:.2}");
}

#[test]
fn every_text_colour_of_the_report_has_enough_contrast() {
    let style = std::fs::read_to_string(root().join("src/report/html/web/colours.css")).unwrap();
    let themes = themes(&style);
    assert_eq!(
        themes.len(),
        3,
        "light, dark by the system's preference, dark by choice"
    );
    assert_eq!(themes[1], themes[2], "both dark themes are the same");
    for theme in &themes {
        for behind in ["paper", "card", "sunk"] {
            for text in [
                "ink", "soft", "accent", "passed", "failed", "broken", "timeout",
            ] {
                holds(theme, text, behind);
            }
        }
        for outcome in ["failed", "broken", "timeout", "passed"] {
            holds(theme, "on", outcome);
        }
        holds(theme, "passed", "kept");
        holds(theme, "ink", "quiet");
        // The cells of a heat map, up to the strongest.
        for share in [0.0, 0.23, 0.46] {
            let cell = mixed(
                share,
                theme["failed"],
                mixed(0.12, theme["passed"], theme["card"]),
            );
            assert!(
                contrast(theme["ink"], cell) >= LEAST,
                "a cell with {share} of the failed colour"
            );
        }
    }
}

#[test]
fn every_text_colour_of_the_query_page_has_enough_contrast() {
    let style = std::fs::read_to_string(root().join("src/serve/web/style.css")).unwrap();
    let themes = themes(&style);
    assert_eq!(themes.len(), 2);
    for theme in &themes {
        for text in ["ink", "faint", "accent", "bad"] {
            holds(theme, text, "paper");
        }
    }
}

#[test]
fn contrasts_are_those_of_the_standard() {
    let of = |hex: &str| colours(&format!("--it: #{hex};"))["it"];
    assert!((contrast(of("000"), of("ffffff")) - 21.0).abs() < 1e-9);
    assert!((contrast(of("767676"), of("fff")) - 4.54).abs() < 0.01);
}

/// Controls and pictures without a name, and scrolling boxes that can't be focused.
const NAMELESS: &str = "[...document.querySelectorAll('a[href], button, select, input, textarea, canvas, svg, [role=img], [role=group], table th')] \
    .filter((it) => !it.closest('[aria-hidden=true], [hidden]')) \
    .filter((it) => !(it.getAttribute('aria-label') || it.textContent.trim() || it.querySelector?.('[aria-label]') || it.labels?.length)) \
    .concat([...document.querySelectorAll('.scroll:not([tabindex]), .wide:not([tabindex], main)')]) \
    .map((it) => it.outerHTML.slice(0, 120))";

/// The report of the shipped picks, in a browser.
fn opened(folder: &Path) -> Chromium {
    let output = actcheck(
        folder,
        &["report", "--html", "report.html", "--history", "h"],
    );
    assert!(output.status.success(), "{}", stderr(&output));
    let mut browser = Chromium::start();
    browser.size(1440, 900);
    browser.open(&folder.join("report.html"), "/");
    browser
}

/// Goes to a view of the open report, and waits until it is complete.
fn go(browser: &mut Chromium, view: &str) {
    browser.value(&format!("location.hash = {view:?}"));
    browser.until("document.querySelector('main h1') && !document.querySelector('.watch:not([data-ready]) .waiting')");
}

/// The view of a failed run that can be played back.
fn failed_run(browser: &mut Chromium) -> String {
    go(browser, "#/runs?outcome=failed&replays=1");
    browser.until("document.querySelector('.rows .row a')");
    browser
        .value("document.querySelector('.rows .row a').getAttribute('href')")
        .as_str()
        .unwrap()
        .to_owned()
}

#[test]
fn all_controls_and_pictures_have_names() {
    let project = shipped("pick").copied();
    let mut browser = opened(project.path());
    let run = failed_run(&mut browser);
    for view in VIEWS.into_iter().chain([run.as_str()]) {
        go(&mut browser, view);
        assert_eq!(browser.value(NAMELESS), json!([]), "{view}");
    }
    let title = browser.value(
        "[document.documentElement.lang, document.title, document.querySelectorAll('main').length]",
    );
    assert_eq!(title, json!(["en", "actcheck report", 1]));
}

/// The findings of axe-core on the open page: rule, element and message.
const FINDINGS: &str = "axe.run(document, { resultTypes: ['violations'] }).then((found) => found.violations.flatMap((rule) => \
    rule.nodes.map((node) => [rule.id, node.target.join(' '), (node.any[0] ?? node.all[0] ?? node.none[0])?.message])))";

/// Opens a page in both themes and on a phone and a desktop, and asks axe-core each time.
pub fn no_findings(browser: &mut Chromium, name: &str) {
    for theme in ["light", "dark"] {
        browser.theme(theme);
        for width in [420, 1440] {
            browser.size(width, 900);
            let found = browser.value(FINDINGS);
            assert_eq!(found, json!([]), "{name}, {theme}, {width} pixels wide");
        }
    }
}

/// Without npm, or without a network on the first time, this is left out.
#[test]
fn axe_core_finds_nothing_on_the_report_and_the_query_page() {
    let Some(axe) = axe() else { return };
    let project = shipped("pick").copied();
    let mut browser = opened(project.path());
    let run = failed_run(&mut browser);
    browser.value(&format!("{axe};0"));
    let pair = run.replace("#/run/", "#/pair/");
    for view in VIEWS.into_iter().chain([run.as_str(), pair.as_str()]) {
        go(&mut browser, view);
        browser.value("document.querySelectorAll('details').forEach((it) => { it.open = true; })");
        no_findings(&mut browser, view);
    }
    let server = Server::start(&project.path().join("h"), &[]);
    browser.visit(&format!("http://127.0.0.1:{}/query", server.port));
    browser.until("typeof form !== 'undefined' && document.readyState === 'complete'");
    browser.value("form.requestSubmit()");
    browser.until("document.querySelector('#answer table')");
    browser.value(&format!("{axe};0"));
    no_findings(&mut browser, "the query page");
}
