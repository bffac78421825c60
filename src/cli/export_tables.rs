//! `actcheck export --tables`

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::time::Duration;

use serde_json::{Value, json};

use crate::remote::RemoteArgs;
use crate::{output, stop};
use actcheck_analysis::{Mirror, columns};
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_history::History;
use actcheck_remote::{BucketSettings, Client, Credentials, Place};

/// The list of the files, which is written after them.
const INDEX: &str = "tables.json";

/// Copies the tables of a history into a folder or a bucket. Returns the exit code.
pub fn copy(name: &str, args: &RemoteArgs, history: &History) -> Result<u8, Diagnostics> {
    let settings = settings(&|name| std::env::var_os(name))?;
    stop::interruptible(|flag| {
        let timeout = Duration::from_secs_f64(args.timeout);
        let place = Place::parse(name, &settings, Client::new(Credentials::default(), timeout, flag.clone()))?;
        let (mirror, _) = Mirror::update(history)?;
        let there = place.list()?;
        let (mut files, mut copied, mut bytes) = (Vec::new(), 0, 0);
        for (campaign, path) in mirror.paths() {
            let size = path.metadata().map_err(|error| unread(&path.display().to_string(), &error))?.len();
            // Its name has the digest of its content.
            let file = path.file_name().unwrap_or_default().to_string_lossy();
            let name = format!("campaign={campaign}/{file}");
            if there.get(&name) != Some(&size) {
                place.put_file(&name, path)?;
                (copied, bytes) = (copied + 1, bytes + size);
            }
            files.push(json!({ "name": name, "campaign": campaign, "bytes": size }));
        }
        let before = place.get(INDEX)?.map(|text| names(&text)).unwrap_or_default();
        let index = index(&files);
        // Readers that go by the list have all of its files at any moment.
        place.put(INDEX, index.as_bytes())?;
        let now = names(index.as_bytes());
        let outdated: Vec<&String> = before.difference(&now).filter(|name| there.contains_key(*name)).collect();
        outdated.iter().try_for_each(|name| place.remove(name))?;
        output::print_prose(&summary(name, files.len(), copied, bytes, outdated.len()));
        Ok(0)
    })
}

fn index(files: &[Value]) -> String {
    format!("{:#}\n", json!({ "format": 1, "files": files, "columns": columns() }))
}

/// The names of the files in a list: only those that this command can have written.
fn names(index: &[u8]) -> BTreeSet<String> {
    let index: Value = serde_json::from_slice(index).unwrap_or_default();
    let files = index["files"].as_array().into_iter().flatten();
    let names = files.filter_map(|file| file["name"].as_str());
    names
        .filter(|name| name.starts_with("campaign=") && name.ends_with(".parquet") && !name.contains(".."))
        .map(str::to_owned)
        .collect()
}

fn summary(place: &str, files: usize, copied: usize, bytes: u64, removed: usize) -> String {
    let megabytes = bytes as f64 / 1e6;
    let removed = if removed == 0 { String::new() } else { format!(", {removed} outdated ones were removed") };
    format!("{place} holds {files} tables: {copied} were copied ({megabytes:.1} MB){removed}\n")
}

fn settings(variable: &dyn Fn(&str) -> Option<OsString>) -> Result<BucketSettings, Diagnostics> {
    let text =
        |name: &str| variable(name).and_then(|value| value.into_string().ok()).filter(|value| !value.trim().is_empty());
    let keys = match (text("AWS_ACCESS_KEY_ID"), text("AWS_SECRET_ACCESS_KEY")) {
        (Some(key), Some(secret)) => Some((key, secret)),
        (None, None) => None,
        (found, _) => {
            let missing = if found.is_some() { "AWS_SECRET_ACCESS_KEY" } else { "AWS_ACCESS_KEY_ID" };
            let fault = Diagnostic::error("X096", format!("{missing} is not set"));
            return Err(fault.help("set both AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY").into());
        }
    };
    Ok(BucketSettings {
        endpoint: text("AWS_ENDPOINT_URL_S3").or_else(|| text("AWS_ENDPOINT_URL")),
        region: text("AWS_REGION").or_else(|| text("AWS_DEFAULT_REGION")),
        keys,
        token: text("AWS_SESSION_TOKEN"),
    })
}

fn unread(file: &str, error: &std::io::Error) -> Diagnostics {
    Diagnostic::error("X097", format!("{file} can't be read: {error}"))
        .help("rebuild the tables with `actcheck export --rebuild-mirror`")
        .into()
}
