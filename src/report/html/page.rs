//! Assembles the page from its frame, styles, scripts and data.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::json;
use sha2::{Digest as _, Sha256};

use crate::html::pack::packed;
use crate::html::scripts::{SCRIPT, SHELL, STYLE, THREE};
use crate::html::summary::summary;
use crate::html::{HtmlReport, Replays};

/// Returns the report as one page that loads no external resources.
///
/// The same report gives the same page. Its markup has no user text: see the module.
pub fn html(report: &HtmlReport<'_>) -> String {
    let summary = summary(report, &report.runs.slots);
    assembled(
        &SCRIPT,
        &[("summary", &*summary), ("runs", &*report.runs.packed)],
        report.replays,
        report.served,
    )
}

/// Assembles a page from scripts, the packed data that these read first, and replays. `served`:
/// whether it asks its server for more.
pub(super) fn assembled(
    scripts: &[&str],
    packed_data: &[(&str, impl AsRef<str>)],
    replays: &Replays,
    served: bool,
) -> String {
    let script = format!("\"use strict\";\n{}", scripts.join("\n"));
    let before: String = packed_data
        .iter()
        .map(|(id, packed)| data(id, packed.as_ref()))
        .collect();
    let mut behind = data("forms", &replays.forms());
    for (name, text) in THREE {
        behind.push_str(&data(name, &packed(text.as_bytes())));
    }
    for (number, (_, replay)) in replays.runs().enumerate() {
        behind.push_str(&data(&format!("replay-{number}"), replay));
    }
    let mut page = String::with_capacity(before.len() + behind.len() + script.len() + 64 * 1024);
    let mut rest = SHELL;
    for (place, filling) in [
        ("{{policy}}", policy(&script, served)),
        ("{{style}}", STYLE.join("\n")),
        ("{{before}}", before),
        ("{{script}}", script),
        ("{{behind}}", behind),
    ] {
        let (head, tail) = rest.split_once(place).unwrap_or((rest, ""));
        page.push_str(head);
        page.push_str(&filling);
        rest = tail;
    }
    page.push_str(rest);
    page
}

/// Returns the data of a report without its page, as its script reads them: a line of JSON with
/// `summary` and `runs`.
pub fn html_data(report: &HtmlReport<'_>) -> String {
    let (summary, runs) = (summary(report, &report.runs.slots), &report.runs.packed);
    json!({ "summary": summary, "runs": runs }).to_string()
}

/// A data element for the script to read; browsers do not execute it.
fn data(id: &str, packed: &str) -> String {
    format!("<script type=\"text/plain\" id=\"data-{id}\">{packed}</script>\n")
}

/// The content security policy: only this script and the library that it unpacks may run. Nothing
/// may be loaded, except from the server of the page.
fn policy(script: &str, served: bool) -> String {
    let digest = STANDARD.encode(Sha256::digest(script.as_bytes()));
    let connect = if served { "'self'" } else { "'none'" };
    format!(
        "default-src 'none'; script-src 'sha256-{digest}' blob:; style-src 'unsafe-inline'; img-src data: blob:; connect-src {connect}; \
         base-uri 'none'; form-action 'none'"
    )
}
