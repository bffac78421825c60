//! `actcheck serve` in a browser: the report with the replay of every run, which follows a campaign
//! while it runs.

use std::process::Command;

use serde_json::{Value, json};

use crate::support::chromium::Chromium;
use crate::support::server::Server;
use crate::support::shipped;

/// The runs of the list.
const RUNS: &str =
    "Number((document.querySelector('.told')?.textContent ?? '0').split(' of ')[1]?.split(' ')[0])";

#[test]
fn the_report_its_data_and_replays_are_served() {
    let project = shipped("pick").copied();
    let server = Server::start(&project.path().join("h"), &[]);
    let page = server.get("/");
    assert_eq!(
        (page.status, page.media_type()),
        (200, "text/html; charset=utf-8")
    );
    assert!(
        page.body.contains("connect-src 'self'"),
        "the page may ask its server"
    );
    let first = server.get("/data");
    let data: Value = serde_json::from_str(&first.body).unwrap();
    assert!(data["summary"].is_string() && data["runs"].is_string());
    let state = data["state"].as_str().unwrap();
    assert_eq!(server.get(&format!("/data?state={state}")).status, 204);
    assert_eq!(server.get("/data?state=older").status, 200);

    let list = crate::support::actcheck(
        project.path(),
        &["list", "--history", "h", "--format", "json"],
    );
    let runs: Value = serde_json::from_str(&crate::support::stdout(&list)).unwrap();
    let run = runs[0]["run"].as_str().unwrap();
    let replay = server.get(&format!("/replay?run={run}"));
    assert_eq!(
        (replay.status, replay.media_type()),
        (200, "application/json"),
        "{}",
        replay.body
    );
    let parts: Value = serde_json::from_str(&replay.body).unwrap();
    assert!(parts["forms"].is_string() && parts["replay"].is_string());
    for (target, status) in [
        ("/replay?run=nothing-7", 404),
        ("/replay?run=--help", 404),
        ("/replay?run=../../etc", 400),
        ("/replay", 400),
    ] {
        assert_eq!(server.get(target).status, status, "{target}");
    }
    for target in ["/data", "/replay", "/query"] {
        assert_eq!(
            server.request("POST", target, &[], b"x").status,
            405,
            "{target}"
        );
    }
}

/// Runs appear while the page is open; each has its replay, and two are laid side by side.
#[test]
fn a_served_report_follows_a_campaign_and_replays_every_run() {
    let project = shipped("pick").copied();
    let server = Server::start(&project.path().join("h"), &[]);
    let mut browser = Chromium::start();
    browser.size(1440, 900);
    browser.visit(&format!("http://127.0.0.1:{}/#/runs", server.port));
    browser.until("document.documentElement?.dataset.ready");
    let before = browser.value(RUNS).as_u64().unwrap();
    let playable = "document.querySelectorAll('.rows .can').length";
    assert_eq!(
        browser.value(playable),
        json!(before),
        "every run can be played"
    );

    let ran = Command::new(env!("CARGO_BIN_EXE_actcheck"))
        .args([
            "run",
            "configs/pick.toml",
            "--runs",
            "2",
            "--seed",
            "77",
            "--history",
            "h",
        ])
        .current_dir(project.path())
        .output()
        .unwrap();
    assert!(ran.status.code().is_some_and(|code| code < 2));
    browser.until(&format!("{RUNS} === {}", before + 2));
    let told = browser.value("document.querySelector('.live').textContent");
    assert!(told.as_str().unwrap().contains("up to date"), "{told}");

    // The newest run is a passed one, which a file has no space for.
    browser.value("document.querySelector('.rows .row:last-child a').click()");
    browser.until("document.querySelector('.watch')?.dataset.ready");
    browser.value("[...document.querySelectorAll('.runhead a')].find((it) => it.textContent === 'side by side').click()");
    browser.until("document.querySelectorAll('.player.pair .stage').length === 2 && document.querySelector('.watch').dataset.ready");
    browser.value("document.querySelector('.top nav a[href=\"/query\"]').click()");
    browser.until("typeof form !== 'undefined' && document.readyState === 'complete'");
    assert_eq!(
        browser.value("document.querySelector('header a').getAttribute('href')"),
        json!("/")
    );
    assert!(browser.complaints.is_empty(), "{:#?}", browser.complaints);
}
