//! The report in a browser: headless Chromium reads it, filters it, plays back a failed run, and
//! reports no error.
//!
//! Afterwards, pictures of every view in both themes, and on a phone, are in the folder `report` of
//! Cargo's folder for tests.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::support::chromium::Chromium;
use crate::support::planted::Dice;
use crate::support::{actcheck, made_up, paged, project, shipped, stderr, stdout};

use actcheck::actions::Saboteur;
use actcheck::base::Outcome;
use actcheck::campaign::oracles::FAULTS;
use actcheck::campaign::{Clock, Env, RunContext, RunInput, run_sabotaged};
use actcheck::config::Overrides;
use actcheck::data::Choices;
use actcheck::history::{CampaignEnd, History};
use actcheck::report::{Explained, PropertyWords, Replays};
use actcheck::verdict::wilson;

const VIEWS: [&str; 8] = [
    "/",
    "/properties",
    "/modes",
    "/patterns",
    "/collisions",
    "/map",
    "/history",
    "/runs",
];
const DESKTOP: (u32, u32) = (1280, 860);
const PHONE: (u32, u32) = (390, 844);

/// The report of the shipped picks, with at least one failure.
fn reported(folder: &Path) -> PathBuf {
    let output = actcheck(
        folder,
        &["report", "--html", "report.html", "--history", "h"],
    );
    assert!(output.status.success(), "{}", stderr(&output));
    folder.join("report.html")
}

fn json_of(folder: &Path, arguments: &[&str]) -> Value {
    let output = actcheck(folder, arguments);
    assert!(output.status.success(), "{}", stderr(&output));
    serde_json::from_str(&stdout(&output)).unwrap()
}

/// Saves a picture for people to look at, and checks that it is not a single colour (such a picture
/// would be far smaller).
fn keep(browser: &mut Chromium, name: &str) -> Vec<u8> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("report");
    std::fs::create_dir_all(&folder).unwrap();
    let picture = browser.picture();
    std::fs::write(folder.join(format!("{name}.png")), &picture).unwrap();
    assert!(
        picture.len() > 8_000,
        "{name} is nearly empty: {} bytes",
        picture.len()
    );
    picture
}

#[test]
fn a_report_can_be_read_filtered_and_played_in_a_browser() {
    let project = shipped("pick").copied();
    let file = reported(project.path());
    let mut browser = Chromium::start();
    browser.size(DESKTOP.0, DESKTOP.1);
    shows_the_counts_of_the_program(&mut browser, &file, project.path());
    let failed = filters(&mut browser, &file, project.path());
    watches(&mut browser, &file, &failed);
    is_seen_in_every_size(&mut browser, &file, &failed);
    let loaded =
        browser.value("performance.getEntriesByType('resource').filter((it) => !it.name.startsWith('blob:')).length");
    assert_eq!(loaded, json!(0), "the page loads external resources");
    assert!(browser.complaints.is_empty(), "{:#?}", browser.complaints);
}

/// Counts on the page equal those that `analyse` prints, and intervals are computed alike.
fn shows_the_counts_of_the_program(browser: &mut Chromium, file: &Path, folder: &Path) {
    browser.open(file, "/");
    let analysed = json_of(folder, &["analyse", "--history", "h", "--format", "json"]);
    let tiles = browser.value(
        "[...document.querySelectorAll('.tile .large')].map((tile) => Number(tile.textContent.replace(/\\D/g, '')))",
    );
    let counts: Vec<&Value> = Outcome::ALL
        .iter()
        .map(|outcome| &analysed["outcomes"][outcome.word()])
        .collect();
    assert_eq!(tiles, json!(counts));
    for (successes, trials) in [(3u64, 20u64), (0, 7), (7, 7), (811, 1234)] {
        let interval = browser.value(&format!("wilson({successes}, {trials})"));
        let known = wilson(successes, trials).unwrap();
        for (name, value) in [
            ("rate", known.rate),
            ("low", known.low),
            ("high", known.high),
        ] {
            assert!(
                (interval[name].as_f64().unwrap() - value).abs() < 1e-12,
                "{successes} of {trials}: {interval}"
            );
        }
    }
    for view in VIEWS {
        browser.open(file, view);
        browser.until("document.querySelector('main h1')");
    }
}

/// Selects failed runs, searches for one of them, and opens it with the keyboard. Returns its id.
fn filters(browser: &mut Chromium, file: &Path, folder: &Path) -> String {
    browser.open(file, "/runs");
    let rows = "document.querySelectorAll('.rows .row').length";
    let all = json_of(folder, &["list", "--history", "h", "--format", "json"])
        .as_array()
        .unwrap()
        .len();
    browser.until(&format!("{rows} === {all}"));
    let set = |name: &str, value: &str, event: &str| {
        format!(
            "(() => {{ const it = document.querySelector('[data-filter={name}]'); it.value = {value:?}; it.dispatchEvent(new Event('{event}')); }})()"
        )
    };
    browser.value(&set("outcome", "failed", "change"));
    let failing = browser.value(rows).as_u64().unwrap();
    assert!((1..=all as u64).contains(&failing), "{failing} of {all}");
    let id = browser
        .value("document.querySelector('.rows .row .id').firstChild.textContent")
        .as_str()
        .unwrap()
        .to_owned();
    browser.value(&set("text", &id.to_uppercase(), "input"));
    assert!(browser.value(rows).as_u64().unwrap() >= 1);
    assert_eq!(
        browser.value("document.querySelector('.told').textContent.split(' of ')[0]"),
        browser.value(&format!("String({rows})"))
    );
    browser.value(&set("text", "no such name", "input"));
    assert_eq!(browser.value(rows), json!(0));
    browser.value(&set("text", &id, "input"));
    browser.value("document.querySelector('.list').focus()");
    browser.press("ArrowDown");
    browser.press("Enter");
    browser.until("location.hash.startsWith('#/run/')");
    id
}

/// The run opens at the moment that decided it, plays, and shows more than a background.
fn watches(browser: &mut Chromium, file: &Path, id: &str) {
    browser.open(file, &format!("/run/{id}"));
    browser.until("document.querySelector('.watch').dataset.ready");
    let slider = "Number(document.querySelector('.slider').value)";
    let moment =
        browser.value("document.querySelector('.failure button').textContent.match(/[\\d.]+/)[0]");
    let decided: f64 = moment.as_str().unwrap().parse().unwrap();
    let opened = browser.value(slider).as_f64().unwrap();
    assert!(
        opened <= decided + 0.06,
        "the playback opens at {opened}, but the outcome was decided at {decided}"
    );
    for words in [
        "details",
        ".proof .line",
        ".timeline .action",
        ".timeline .decided",
        ".parameters dt",
        ".pictures canvas",
    ] {
        assert!(
            browser
                .value(&format!("document.querySelectorAll('{words}').length"))
                .as_u64()
                .unwrap()
                > 0,
            "{words}"
        );
    }
    browser.value("(() => { const it = document.querySelector('.slider'); it.value = 0; it.dispatchEvent(new Event('input')); })()");
    assert_eq!(browser.value(slider), json!(0));
    browser.value("document.querySelector('.play').click()");
    browser.until(&format!("{slider} > 0.2"));
    browser.value("document.querySelector('.play').click()");
    let stopped = browser.value(slider);
    assert_eq!(
        browser.value(&format!(
            "new Promise((done) => setTimeout(() => done({slider}), 200))"
        )),
        stopped
    );
    let colours = "(() => { const from = document.querySelector('.stage'), to = document.createElement('canvas'); \
        [to.width, to.height] = [64, 40]; const pen = to.getContext('2d'); pen.drawImage(from, 0, 0, 64, 40); \
        const bytes = pen.getImageData(0, 0, 64, 40).data; const seen = new Set(); \
        for (let i = 0; i < bytes.length; i += 4) seen.add(bytes[i] >> 4 << 8 | bytes[i + 1] >> 4 << 4 | bytes[i + 2] >> 4); return seen.size; })()";
    let seen = browser.value(colours).as_u64().unwrap();
    assert!(seen > 8, "the stage shows {seen} colours");
}

/// The theme follows the system's preference and the button, and no view is wider than a phone.
fn is_seen_in_every_size(browser: &mut Chromium, file: &Path, id: &str) {
    let run = format!("/run/{id}");
    let views: Vec<&str> = VIEWS.into_iter().chain([run.as_str()]).collect();
    for (theme, (width, height), size) in [
        ("light", DESKTOP, "desktop"),
        ("dark", DESKTOP, "desktop"),
        ("light", PHONE, "phone"),
    ] {
        browser.theme(theme);
        browser.size(width, height);
        for view in &views {
            browser.open(file, view);
            if view.starts_with("/run/") {
                browser.until("document.querySelector('.watch').dataset.ready");
            }
            let wide = browser
                .value("document.documentElement.scrollWidth")
                .as_u64()
                .unwrap();
            assert!(wide <= u64::from(width), "{view} is {wide} wide");
            let name = view.trim_start_matches('/').split('/').next().unwrap();
            keep(
                browser,
                &format!(
                    "{size}-{theme}-{}",
                    if name.is_empty() { "overview" } else { name }
                ),
            );
        }
    }
    let paper = "getComputedStyle(document.body).backgroundColor";
    let light = browser.value(paper);
    browser.value("document.querySelector('.theme').click()");
    assert_ne!(browser.value(paper), light);
    browser.theme("dark");
    let dark = browser.value(paper);
    browser.value("document.querySelector('.theme').click()");
    assert_eq!((browser.value(paper), dark != light), (light, true));
}

/// Closes a script, starts an image that runs code, and contains every quote character.
const HOSTILE: &str = "</script></textarea><img src=x onerror=\"window.hacked=1\">'\"`&amp;<b>";

/// A page in which every text is hostile.
fn hostile(folder: &Path) -> PathBuf {
    let mut dice = Dice::new(7);
    let judge = |_: &_, _: usize, dice: &mut Dice| {
        let outcome = Outcome::ALL[dice.below(6) as usize];
        vec![
            ("CloseObject", outcome),
            ("Bad<img src=x onerror='window.hacked=2'>", Outcome::Failed),
        ]
    };
    let mut replays = Replays::default();
    let runs: Vec<_> = (0..40)
        .map(|index| {
            let mut run = made_up::run("k", index, &mut dice, &["Pick"], judge);
            run.row.run = format!("k-{index}{HOSTILE}");
            run.row.test = HOSTILE.to_owned();
            run.world = HOSTILE.to_owned();
            run.reason = Some(HOSTILE.to_owned());
            run.discards = vec![HOSTILE.to_owned()];
            for object in &mut run.objects {
                (object.id, object.model) = (format!("{}{HOSTILE}", object.id), HOSTILE.to_owned());
                object.category = format!("http://actions#{HOSTILE}");
            }
            for action in &mut run.actions {
                action.message = Some(HOSTILE.to_owned());
                action
                    .parameters
                    .insert(HOSTILE.to_owned(), vec![HOSTILE.to_owned()]);
                action
                    .judgements
                    .iter_mut()
                    .for_each(|judgement| judgement.witness = HOSTILE.to_owned());
            }
            if index < 3 {
                let property = run.actions[0].judgements[1].property.clone();
                replays.add(
                    &run,
                    None,
                    &[Explained {
                        step: 1,
                        property,
                        text: HOSTILE.to_owned(),
                        deciding: Vec::new(),
                    }],
                );
            }
            run
        })
        .collect();
    let words = PropertyWords {
        label: HOSTILE.to_owned(),
        comment: Some(HOSTILE.to_owned()),
        rule: HOSTILE.to_owned(),
        bounds: Vec::new(),
    };
    let words = BTreeMap::from([("http://actions#CloseObject".to_owned(), words)]);
    let mirror = paged::mirror(&folder.join("tables"), "k", runs);
    let file = folder.join("hostile.html");
    std::fs::write(&file, paged::page(&mirror, HOSTILE, &words, &replays)).unwrap();
    file
}

#[test]
fn texts_of_models_rules_and_messages_never_become_markup() {
    let folder = tempfile::tempdir().unwrap();
    let file = hostile(folder.path());
    let page = std::fs::read_to_string(&file).unwrap();
    assert!(
        !page.contains("onerror") && !page.contains("textarea"),
        "the page contains hostile markup"
    );
    let mut browser = Chromium::start();
    browser.size(DESKTOP.0, DESKTOP.1);
    let encoded = "encodeURIComponent([...document.querySelectorAll('.rows .id')].map((it) => it.firstChild.textContent)[0])";
    browser.open(&file, "/runs");
    browser.until("document.querySelector('.rows .row')");
    let run = format!("/run/{}", browser.value(encoded).as_str().unwrap());
    let other = format!(
        "/run/{}",
        HOSTILE
            .replace('"', "%22")
            .replace('<', "%3C")
            .replace('>', "%3E")
            .replace(' ', "%20")
    );
    for view in VIEWS.into_iter().chain([run.as_str(), other.as_str()]) {
        browser.open(&file, view);
        browser.until(
            "document.querySelector('main h1') && !document.querySelector('.watch .waiting')",
        );
        let found = browser.value(
            "[document.images.length, document.querySelectorAll('main b img, textarea').length, window.hacked ?? 0]",
        );
        assert_eq!(found, json!([0, 0, 0]), "{view}");
    }
    browser.open(&file, &run);
    browser.until("document.querySelector('.details .failure')");
    let text = browser.value("document.querySelector('.details').textContent");
    assert!(
        text.as_str().unwrap().contains(HOSTILE),
        "the hostile text is shown as text"
    );
    assert!(browser.complaints.is_empty(), "{:#?}", browser.complaints);
}

/// Stores a run in which the robot was pushed against a table. Returns its id.
fn pushed(folder: &Path) -> String {
    let now = || "2026-08-01T12:00:00Z".to_owned();
    let env = Env::prepare(&folder.join("configs/pick.toml"), &Overrides::default()).unwrap();
    let fault = FAULTS
        .into_iter()
        .find(|fault| fault.name == "base-pushed")
        .unwrap();
    let context = RunContext {
        clock: Clock { now, secs: || 0.0 },
        disturb: None,
    };
    let input = RunInput {
        campaign: "k",
        index: 0,
        choices: Choices::random(env.campaign.seed, 0),
    };
    let run = run_sabotaged(&env, input, &context, &mut Saboteur::new(fault.sabotage)).unwrap();
    let history = History::open(&folder.join("h")).unwrap();
    history
        .begin_campaign(&env.record("k".to_owned(), "pushed".to_owned(), now()))
        .unwrap();
    history.commit(&run).unwrap();
    history
        .finish_campaign(
            "k",
            &CampaignEnd {
                ended: now(),
                ..CampaignEnd::default()
            },
        )
        .unwrap();
    run.id
}

/// The failure, the player and the scene show where the robot was jammed.
#[test]
fn a_replay_marks_the_hardest_contact() {
    let project = project();
    let id = pushed(project.path());
    let file = reported(project.path());
    let mut browser = Chromium::start();
    browser.size(DESKTOP.0, DESKTOP.1);
    browser.open(&file, &format!("/run/{id}"));
    browser.until("document.querySelector('.watch').dataset.ready");
    for place in [".player .pressed", ".failure .pressed"] {
        let text = browser.value(&format!("document.querySelector('{place}').textContent"));
        let told = text.as_str().unwrap();
        let parts = [" presses coffee_table_1: ", " N, from ", ", at x = "];
        assert!(
            parts.iter().all(|part| told.contains(part)),
            "{place}: {told}"
        );
    }
    browser.value("document.querySelector('.player .pressed button').click()");
    keep(&mut browser, "pressed");
    assert!(browser.complaints.is_empty(), "{:#?}", browser.complaints);
}
