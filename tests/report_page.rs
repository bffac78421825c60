//! The report's addresses, playback and plots in a browser: a link opens the same view again, the
//! moment of a sentence shows its numbers, and signals with their thresholds are below
//! it.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::support::chromium::Chromium;
use crate::support::{actcheck, shipped, stderr};

fn reported(folder: &Path) -> PathBuf {
    let output = actcheck(
        folder,
        &["report", "--html", "report.html", "--history", "h"],
    );
    assert!(output.status.success(), "{}", stderr(&output));
    folder.join("report.html")
}

fn choose(browser: &mut Chromium, name: &str, value: &str, event: &str) {
    browser.value(&format!(
        "(() => {{ const it = document.querySelector('[data-filter={name}]'); it.value = {value:?}; it.dispatchEvent(new Event('{event}')); }})()"
    ));
}

fn hash(browser: &mut Chromium) -> String {
    browser.value("location.hash").as_str().unwrap().to_owned()
}

/// The state of the list: the number of runs, the chosen outcome, and the search.
fn listed(browser: &mut Chromium) -> Value {
    browser.value(
        "[document.querySelector('.told').textContent, document.querySelector('[data-filter=outcome]').value, \
         document.querySelector('[data-filter=text]').value]",
    )
}

#[test]
fn a_link_opens_the_same_view_again_and_back_returns_to_the_one_before() {
    let project = shipped("pick").copied();
    let file = reported(project.path());
    let mut browser = Chromium::start();
    browser.size(1280, 860);
    browser.open(&file, "/runs");
    let all = listed(&mut browser);
    choose(&mut browser, "outcome", "failed", "change");
    let failed = listed(&mut browser);
    assert_ne!(failed, all);
    choose(&mut browser, "text", "glass", "input");
    choose(&mut browser, "text", "no such run", "input");
    let (nothing, address) = (listed(&mut browser), hash(&mut browser));
    assert_eq!(address, "#/runs?q=no+such+run&outcome=failed");

    browser.open(&file, address.trim_start_matches('#'));
    assert_eq!(
        listed(&mut browser),
        nothing,
        "the link opens the same filter"
    );
    says_that_nothing_matches(&mut browser, &failed, &all);
    opens_runs_with_the_filter(&mut browser, &file);
    assert!(browser.complaints.is_empty(), "{:#?}", browser.complaints);
}

/// An empty list says so, with two ways out; a step back undoes each.
fn says_that_nothing_matches(browser: &mut Chromium, failed: &Value, all: &Value) {
    let words = browser.value("document.querySelector('.empty').textContent");
    assert!(
        words
            .as_str()
            .unwrap()
            .contains("No run matches this filter."),
        "{words}"
    );
    assert_eq!(
        browser.value("document.querySelector('.list').hidden"),
        json!(true)
    );
    browser.value("document.querySelector('.empty li button').click()");
    assert_eq!(listed(browser), *failed, "without the search");
    browser.value("history.back()");
    browser.until("!document.querySelector('.empty').hidden");
    browser.value("document.querySelector('.empty > p button').click()");
    assert_eq!(listed(browser), *all, "all filters are cleared");
    assert_eq!(
        browser.value("document.querySelector('.empty').hidden"),
        json!(true)
    );
}

/// Runs keep the filter for the way back, and views of all runs are not filtered.
fn opens_runs_with_the_filter(browser: &mut Chromium, file: &Path) {
    browser.open(file, "/");
    browser.value("document.querySelector('.tile.failed').click()");
    browser.until("document.querySelector('.rows .row a')");
    assert_eq!(hash(browser), "#/runs?outcome=failed");
    browser.value("document.querySelector('.rows .row a').click()");
    browser.until("document.querySelector('.watch')?.dataset.ready");
    assert!(
        hash(browser).contains("outcome=failed"),
        "{}",
        hash(browser)
    );
    browser.value("history.back()");
    browser.until("document.querySelector('.rows .row')");
    assert_eq!(
        browser.value("document.querySelector('[data-filter=outcome]').value"),
        json!("failed")
    );
}

/// Opens a run of the shipped picks with a failed `CloseObject`, whose witness is a distance after
/// the action.
fn opened_run(browser: &mut Chromium, file: &Path) {
    browser.open(
        file,
        "/runs?outcome=failed&property=1.Pick.CloseObject&replays=1",
    );
    browser.until("document.querySelector('.rows .row a')");
    browser.value("document.querySelector('.rows .row a').click()");
    browser.until("document.querySelector('.watch')?.dataset.ready");
}

#[test]
fn the_moment_of_a_sentence_shows_its_numbers() {
    let project = shipped("pick").copied();
    let file = reported(project.path());
    let mut browser = Chromium::start();
    browser.size(1280, 860);
    opened_run(&mut browser, &file);
    // The page opens at the moment that decided it; the second button shows the one of the sentence.
    browser.value("document.querySelectorAll('.failure button')[1].click()");
    // "glass_1 is 48.8 cm from the gripper, needs less than 5 cm"
    let sentence = browser.value("document.querySelector('.failure p').textContent");
    let stated: f64 = sentence
        .as_str()
        .unwrap()
        .split(" cm")
        .next()
        .unwrap()
        .rsplit(' ')
        .next()
        .unwrap()
        .parse()
        .unwrap();
    let shown = "document.querySelector('.signal[data-signal^=\"hand to\"] .value').textContent";
    let measured: f64 = browser
        .value(shown)
        .as_str()
        .unwrap()
        .split('\u{2009}')
        .next()
        .unwrap()
        .parse()
        .unwrap();
    assert!(
        (measured - stated).abs() <= 0.3,
        "the sentence is {sentence}, but {measured} cm are shown"
    );
    let label = browser.value("document.querySelector('.label.gap').textContent");
    assert_eq!(
        label,
        browser.value(shown),
        "the line from the hand to the object is labelled"
    );

    let limits =
        browser.value("[...document.querySelectorAll('.limitname')].map((it) => it.textContent)");
    let limits: Vec<&str> = limits
        .as_array()
        .unwrap()
        .iter()
        .filter_map(Value::as_str)
        .collect();
    assert!(
        limits
            .iter()
            .any(|limit| limit.starts_with("CloseObject < 5")),
        "{limits:?}"
    );
    let signals =
        browser.value("[...document.querySelectorAll('.signal')].map((it) => it.dataset.signal)");
    let signals: Vec<&str> = signals
        .as_array()
        .unwrap()
        .iter()
        .filter_map(Value::as_str)
        .collect();
    for name in [
        "gripper opening",
        "grip force",
        "hand to",
        "moved",
        "raised",
        "tilt",
    ] {
        assert!(
            signals.iter().any(|signal| signal.contains(name)),
            "{name}: {signals:?}"
        );
    }
    follows_the_moment(&mut browser, &file);
    assert!(browser.complaints.is_empty(), "{:#?}", browser.complaints);
}

/// The time is in the address, the cursor and the values of the signals follow it, and percepts are
/// shown.
fn follows_the_moment(browser: &mut Chromium, file: &Path) {
    let cursor = "document.querySelector('.timeline .now').getAttribute('x1')";
    let value = "document.querySelector('.signal[data-signal^=\"hand to\"] .value').textContent";
    let before = [browser.value(cursor), browser.value(value)];
    browser.value("(() => { const it = document.querySelector('.slider'); it.value = 1; it.dispatchEvent(new Event('input')); })()");
    let after = [browser.value(cursor), browser.value(value)];
    assert!(
        before[0] != after[0] && before[1] != after[1],
        "{before:?}, {after:?}"
    );
    browser.until("location.hash.includes('t=1.00')");
    let address = hash(browser);
    browser.open(file, address.trim_start_matches('#'));
    browser.until("document.querySelector('.watch')?.dataset.ready");
    assert_eq!(
        browser.value("Number(document.querySelector('.slider').value)"),
        json!(1)
    );
    let boxes = browser
        .value("[...document.querySelectorAll('.controls .check input')].map((it) => it.checked)");
    assert_eq!(boxes, json!([true, true]), "labels and percepts are shown");
    let labels =
        browser.value("[...document.querySelectorAll('.label.target:not([hidden])')].length");
    assert_eq!(labels, json!(1), "the target is labelled");
}

#[test]
fn rates_are_bars_with_their_interval_and_the_map_outlines_the_table() {
    let project = shipped("pick").copied();
    let file = reported(project.path());
    let mut browser = Chromium::start();
    browser.size(1280, 860);
    browser.open(&file, "/");
    let bars = browser.value(
        "[...document.querySelectorAll('.properties tbody tr')].map((row) => { \
         const [low, high] = row.querySelector('.ratecell > span:last-child').textContent.match(/\\[(\\d+)–(\\d+)\\]/).slice(1).map(Number); \
         const it = row.querySelector('.whisker').style; \
         return Math.max(Math.abs(parseFloat(it.left) - low), Math.abs(parseFloat(it.left) + parseFloat(it.width) - high)); })",
    );
    let bars: Vec<f64> = bars
        .as_array()
        .unwrap()
        .iter()
        .filter_map(Value::as_f64)
        .collect();
    assert!(
        bars.len() == 5 && bars.iter().all(|off| *off <= 0.51),
        "{bars:?}"
    );
    browser.open(&file, "/map");
    let outline = browser.value(
        "Promise.all([unpack('runs'), unpack('summary')]).then(([runs, summary]) => outlinesOf(new Runs(runs, summary))) \
         .then((found) => found.map((one) => one.surface_x_m[0]).map(({ model, points }) => [model, points.flat()]))",
    );
    let (model, points) = (&outline[0][0], &outline[0][1]);
    assert_eq!(model, "coffee_table");
    let points: Vec<f64> = points
        .as_array()
        .unwrap()
        .iter()
        .filter_map(Value::as_f64)
        .collect();
    // The shipped table is 62 cm square.
    assert!(
        points.len() == 8 && points.iter().all(|at| (at.abs() - 0.31).abs() < 1e-6),
        "{points:?}"
    );
    measures_distances_to_shapes(&mut browser);
    assert!(browser.complaints.is_empty(), "{:#?}", browser.complaints);
}

/// Distances from points to shapes, as the page computes them for the signals, against known ones.
/// Unit: metres.
fn measures_distances_to_shapes(browser: &mut Chromium) {
    let corners = "[0, 1, 2, 3, 4, 5, 6, 7].map((corner) => [0, 1, 2].map((axis) => (corner >> axis & 1 ? 0.5 : -0.5)))";
    for (part, point, known) in [
        ("{ kind: 'box', size: [1, 1, 1] }", "[1.5, 0, 0]", 1.0),
        ("{ kind: 'box', size: [1, 1, 1] }", "[0.2, 0.1, -0.4]", 0.0),
        ("{ kind: 'sphere', radius: 0.25 }", "[0, 0.3, 0.4]", 0.25),
        (
            "{ kind: 'cylinder', radius: 0.3, height: 1 }",
            "[0.7, 0, 0.8]",
            0.5,
        ),
        (
            "{ kind: 'capsule', radius: 0.2, height: 0.6 }",
            "[0, 0, 1]",
            0.5,
        ),
        (
            "{ kind: 'tube', low: 0.3, high: 0.3, wall: 0.05, height: 1 }",
            "[0, -0.4, 0]",
            0.1,
        ),
        (
            "{ kind: 'tube', low: 0.3, high: 0.3, wall: 0.05, height: 1 }",
            "[0, -0.05, 0.2]",
            0.2,
        ),
        (
            &format!("{{ kind: 'hull', points: {corners} }}"),
            "[1.5, 0.2, 0.1]",
            1.0,
        ),
        (
            &format!("{{ kind: 'hull', points: {corners} }}"),
            "[0.9, 0.8, 0]",
            0.5,
        ),
    ] {
        let found = browser
            .value(&format!("apart(closestOn({part}, {point}), {point})"))
            .as_f64()
            .unwrap();
        assert!((found - known).abs() < 5e-4, "{part} from {point}: {found}");
    }
}

/// Rectangles of the texts of a signal's row that overlap each other or leave the drawing.
const OVERLAPS: &str = "(() => { const wrong = []; for (const row of document.querySelectorAll('.signal')) { \
    const all = row.closest('svg').getBoundingClientRect(); \
    const texts = [...row.querySelectorAll('text')].map((it) => [it.textContent, it.getBoundingClientRect()]).filter(([, r]) => r.width); \
    texts.forEach(([a, r], i) => { if (r.left < all.left - 1 || r.right > all.right + 1) wrong.push(a + ' leaves'); \
      for (const [b, s] of texts.slice(i + 1)) if (r.left < s.right - 1 && s.left < r.right - 1 && r.top < s.bottom - 3 && s.top < r.bottom - 3) wrong.push(a + ' / ' + b); }); } \
    return wrong; })()";

#[test]
fn a_failed_property_about_time_is_drawn_with_its_limit_its_interval_and_the_moment() {
    let project = shipped("pick").copied();
    let folder = project.path();
    std::fs::write(
        folder.join("lifted.rls"),
        "violation(?o) :- parameter(act:pickObject, ?o), eventually(w:rise(?o) > 0.02 and w:speed(?o) + 0 * w:speed(w:gripper) > 0.05) .",
    )
    .unwrap();
    let ontology = "@prefix act: <http://actions#> . @prefix owl: <http://www.w3.org/2002/07/owl#> .\n\
        <> owl:imports <ontology/actions.ttl> .\n\
        act:LiftedSlowly a act:Property ; act:unit \"m/s\" ; act:verifiedBy <lifted.rls> .\n\
        act:Pick act:successProperty act:LiftedSlowly .\n";
    std::fs::write(folder.join("slow.ttl"), ontology).unwrap();
    let run = |arguments: &[&str]| {
        let output = actcheck(folder, arguments);
        assert!(output.status.code() < Some(2), "{}", stderr(&output));
        String::from_utf8(output.stdout).unwrap()
    };
    run(&[
        "recheck",
        "--ontology",
        "slow.ttl",
        "--history",
        "h",
        "LiftedSlowly",
    ]);
    run(&[
        "report",
        "--html",
        "report.html",
        "--history",
        "h",
        "--ontology",
        "slow.ttl",
    ]);
    let mut browser = Chromium::start();
    for (width, theme) in [(1280, "light"), (400, "dark")] {
        browser.size(width, 860);
        browser.theme(theme);
        browser.open(
            &folder.join("report.html"),
            "/runs?outcome=failed&property=1.Pick.LiftedSlowly&replays=1",
        );
        browser.until("document.querySelector('.rows .row a')");
        browser.value("document.querySelector('.rows .row a').click()");
        browser.until("document.querySelector('.watch')?.dataset.ready && document.querySelector('.decidedat')");
        let parts = "['violated', 'decidedat', 'decideddot'].map((it) => document.querySelectorAll(`.signal .${it}`).length > 0)";
        assert_eq!(browser.value(parts), json!([true, true, true]));
        let labels = browser.value(
            "[...document.querySelectorAll('.limitname')].map((it) => it.textContent).join('; ')",
        );
        assert!(
            labels.as_str().unwrap().contains("LiftedSlowly: > "),
            "{labels}"
        );
        assert_eq!(browser.value(OVERLAPS), json!([]), "{width} px");
        // The button goes to the moment that is drawn.
        browser.value("[...document.querySelectorAll('.failure')].find((it) => it.textContent.includes('LiftedSlowly')).querySelector('button').click()");
        let apart = "Math.abs(document.querySelector('.timeline .now').getAttribute('x1') - document.querySelector('.decidedat').getAttribute('x1'))";
        browser.until(&format!("{apart} < 2"));
    }
    let id = browser.value("location.hash.match(/run\\/([^?&]+)/)[1]");
    run(&[
        "show",
        id.as_str().unwrap(),
        "--history",
        "h",
        "--ontology",
        "slow.ttl",
        "--picture",
        "run.svg",
    ]);
    assert!(browser.complaints.is_empty(), "{:#?}", browser.complaints);
    let picture = std::fs::read_to_string(folder.join("run.svg")).unwrap();
    run(&[
        "show",
        id.as_str().unwrap(),
        "--history",
        "h",
        "--picture",
        "plain.svg",
    ]);
    let plain = std::fs::read_to_string(folder.join("plain.svg")).unwrap();
    assert!(
        picture.len() > plain.len() + 2_000,
        "{} and {} bytes",
        picture.len(),
        plain.len()
    );
}
