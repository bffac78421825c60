//! `actcheck export --tables`

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::PathBuf;
use std::time::Duration;

use serde_json::{Value, json};

use crate::remote::RemoteArgs;
use crate::{output, stop};
use actcheck_analysis::{Mirror, columns, without_campaign};
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_history::History;
use actcheck_remote::{BucketSettings, Client, Credentials, Place};

/// The name of the list of the files, which is written after them, or its ending.
const INDEX: &str = "tables.json";

/// Copies the tables of a history into a folder or a bucket. Returns the exit code.
pub fn copy(name: &str, args: &RemoteArgs, history: &History) -> Result<u8, Diagnostics> {
    let settings = settings(&|name| std::env::var_os(name))?;
    stop::interruptible(|flag| {
        let timeout = Duration::from_secs_f64(args.timeout);
        let client = || Client::new(Credentials::default(), timeout, flag.clone());
        let place = Place::parse(name, &settings, client())?;
        let (around, list) = list_of(name);
        let around = Place::parse(&around, &settings, client())?;
        let (mirror, _) = Mirror::update(history)?;
        let there = place.list()?;
        let before = around
            .get(&list)?
            .map(|text| sizes(&text))
            .unwrap_or_default();
        let (mut files, mut copied, mut bytes) = (Vec::new(), 0, 0);
        for (campaign, path) in mirror.paths() {
            // Its name has the digest of the content with all columns.
            let file = path.file_name().unwrap_or_default().to_string_lossy();
            let name = format!("campaign={campaign}/{file}");
            let mut size = there.get(&name).copied().unwrap_or_default();
            if !there.contains_key(&name) || before.get(&name) != Some(&size) {
                let content = without_campaign(path)?;
                if !there.contains_key(&name) || size != content.len() as u64 {
                    place.put(&name, &content)?;
                    (copied, bytes) = (copied + 1, bytes + content.len() as u64);
                }
                size = content.len() as u64;
            }
            files.push(json!({ "name": name, "campaign": campaign, "bytes": size }));
        }
        let index = index(&files);
        // Readers that go by the list have all of its files at any moment.
        around.put(&list, index.as_bytes())?;
        let now = sizes(index.as_bytes());
        let outdated: Vec<&String> = before
            .keys()
            .filter(|name| !now.contains_key(*name) && there.contains_key(*name))
            .collect();
        outdated.iter().try_for_each(|name| place.remove(name))?;
        output::print_prose(&summary(name, files.len(), copied, bytes, outdated.len()));
        Ok(0)
    })
}

fn index(files: &[Value]) -> String {
    format!(
        "{:#}\n",
        json!({ "format": 1, "files": files, "columns": columns() })
    )
}

/// The names of the files in a list with their sizes: only of those that this command can have
/// written.
fn sizes(index: &[u8]) -> BTreeMap<String, u64> {
    let index: Value = serde_json::from_slice(index).unwrap_or_default();
    let files = index["files"].as_array().into_iter().flatten();
    let files =
        files.filter_map(|file| Some((file["name"].as_str()?.to_owned(), file["bytes"].as_u64()?)));
    files
        .filter(|(name, _)| {
            name.starts_with("campaign=") && name.ends_with(".parquet") && !name.contains("..")
        })
        .collect()
}

/// The place and name of the list of a place's files. It is beside the place: many readers take
/// each file of a folder for a table.
fn list_of(place: &str) -> (String, String) {
    if place.contains("://") {
        let place = place.trim_end_matches('/');
        return match place.rsplit_once('/') {
            Some((around, name)) if !around.ends_with('/') => {
                (around.to_owned(), format!("{name}.{INDEX}"))
            }
            // A whole bucket has no place beside it.
            _ => (place.to_owned(), INDEX.to_owned()),
        };
    }
    let written = PathBuf::from(place);
    // `.` and `..` have names, too.
    let named = if written.file_name().is_some() {
        Some(written)
    } else {
        std::fs::canonicalize(written).ok()
    };
    match named
        .as_deref()
        .and_then(|path| Some((path.parent()?, path.file_name()?)))
    {
        Some((around, name)) => (
            around.display().to_string(),
            format!("{}.{INDEX}", name.to_string_lossy()),
        ),
        None => (place.to_owned(), INDEX.to_owned()),
    }
}

fn summary(place: &str, files: usize, copied: usize, bytes: u64, removed: usize) -> String {
    let megabytes = bytes as f64 / 1e6;
    let removed = if removed == 0 {
        String::new()
    } else {
        format!(", {removed} outdated ones were removed")
    };
    format!("{place} holds {files} tables: {copied} were copied ({megabytes:.1} MB){removed}\n")
}

fn settings(variable: &dyn Fn(&str) -> Option<OsString>) -> Result<BucketSettings, Diagnostics> {
    let text = |name: &str| {
        variable(name)
            .and_then(|value| value.into_string().ok())
            .filter(|value| !value.trim().is_empty())
    };
    let keys = match (text("AWS_ACCESS_KEY_ID"), text("AWS_SECRET_ACCESS_KEY")) {
        (Some(key), Some(secret)) => Some((key, secret)),
        (None, None) => None,
        (found, _) => {
            let missing = if found.is_some() {
                "AWS_SECRET_ACCESS_KEY"
            } else {
                "AWS_ACCESS_KEY_ID"
            };
            let fault = Diagnostic::error("X096", format!("{missing} is not set"));
            return Err(fault
                .help("set both AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY")
                .into());
        }
    };
    Ok(BucketSettings {
        endpoint: text("AWS_ENDPOINT_URL_S3").or_else(|| text("AWS_ENDPOINT_URL")),
        region: text("AWS_REGION").or_else(|| text("AWS_DEFAULT_REGION")),
        keys,
        token: text("AWS_SESSION_TOKEN"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_is_beside_the_place() {
        for (place, around, list) in [
            ("to", "", "to.tables.json"),
            ("a/to/", "a", "to.tables.json"),
            ("s3://bucket/a/k7f3/", "s3://bucket/a", "k7f3.tables.json"),
            ("s3://bucket/k7f3", "s3://bucket", "k7f3.tables.json"),
            ("s3://bucket", "s3://bucket", "tables.json"),
        ] {
            assert_eq!(list_of(place), (around.to_owned(), list.to_owned()));
        }
        assert!(list_of(".").1.ends_with(".tables.json"));
    }
}
