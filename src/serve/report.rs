//! The report of the present history, and the replays of its runs. Rendering the report takes
//! seconds, so it is cached until the history changes.

use std::collections::BTreeMap;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant, SystemTime};

use hyper::body::Bytes;
use serde_json::{Value, json};

use crate::question::Refusal;
use crate::worker::{Ended, Worker};

/// Time limit; a report takes longer than a query.
const MOST_TIME: Duration = Duration::from_secs(300);
/// Time limit of a replay, which may be simulated again.
const REPLAY_TIME: Duration = Duration::from_secs(60);
/// Maximum size of the page, and of a replay. Unit: bytes.
const MOST_BYTES: u64 = 1 << 30;
/// Longest id of a run that is looked up. Unit: bytes.
const LONGEST_ID: usize = 100;
/// While a campaign is writing, rendering for pages that are open takes at most this part of the
/// time.
const RENDERING_SHARE: u32 = 4;
/// How deep the folders of a history are.
const DEEPEST: usize = 3;

/// Paths, sizes and modification times of a history's files.
type State = BTreeMap<PathBuf, (u64, Option<SystemTime>)>;

/// A rendered report.
#[derive(Debug, Clone)]
pub(super) struct Rendered {
    /// The page.
    pub page: Bytes,
    /// Its data without the page, in JSON: `state`, `summary` and `runs`.
    pub data: Bytes,
    /// Name of this state of the data.
    pub state: String,
}

#[derive(Debug)]
struct Kept {
    of: State,
    rendered: Rendered,
    /// When rendering the next one for pages that are open is due.
    next: Instant,
}

/// Renders the report and caches the last one.
#[derive(Debug)]
pub(super) struct LiveReport {
    worker: Worker,
    history: PathBuf,
    kept: Mutex<Option<Kept>>,
}

impl LiveReport {
    /// `worker` prints a line with the data, then the page; with the option `--run`, a replay.
    pub fn new(worker: Worker, history: &Path) -> Self {
        Self {
            worker,
            history: history.to_owned(),
            kept: Mutex::new(None),
        }
    }

    /// Returns the last report if the history is unchanged.
    pub fn cached(&self) -> Option<Rendered> {
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let kept = kept.as_ref()?;
        (kept.of == state(&self.history)).then(|| kept.rendered.clone())
    }

    /// As [`LiveReport::cached`], but returns an older report, too, if the next one is not due.
    pub fn recent(&self) -> Option<Rendered> {
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let kept = kept.as_ref()?;
        (Instant::now() < kept.next || kept.of == state(&self.history))
            .then(|| kept.rendered.clone())
    }

    /// Renders the report.
    ///
    /// # Errors
    /// A refusal if the page can't be rendered, and no page was rendered before, or if that takes
    /// too long.
    pub fn render(&self) -> Result<Rendered, Refusal> {
        // Another request may have rendered it while this one waited.
        if let Some(rendered) = self.cached() {
            return Ok(rendered);
        }
        let began = Instant::now();
        let ended = self.worker.run(MOST_TIME, MOST_BYTES);
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let why = match ended {
            Ended::Itself {
                code: Some(0),
                output,
                ..
            } => match rendered(output) {
                Some(rendered) => {
                    *kept = Some(Kept {
                        // Rendering updates the tables beside the history.
                        of: state(&self.history),
                        rendered: rendered.clone(),
                        next: Instant::now() + began.elapsed() * RENDERING_SHARE,
                    });
                    return Ok(rendered);
                }
                None => "the report process printed no report".to_owned(),
            },
            Ended::Itself { errors, .. } => String::from_utf8_lossy(&errors).into_owned(),
            other => return Err(unfinished(other, "report")),
        };
        // Such as a damaged history: the previous page is served.
        match &*kept {
            Some(kept) => Ok(kept.rendered.clone()),
            None => Err(Refusal::new(503, why)),
        }
    }

    /// Returns the replay of a run, in JSON: `forms` and `replay`.
    ///
    /// # Errors
    /// A refusal if the run does not exist, or can't be replayed.
    pub fn replay(&self, run: &str) -> Result<Bytes, Refusal> {
        let is_known = |c: char| c.is_alphanumeric() || "-_.".contains(c);
        if run.is_empty() || run.len() > LONGEST_ID || !run.chars().all(is_known) {
            return Err(Refusal::new(400, "`run` must be the id of a run"));
        }
        let mut worker = self.worker.clone();
        worker.arguments.push(format!("--run={run}"));
        match worker.run(REPLAY_TIME, MOST_BYTES) {
            Ended::Itself {
                code: Some(0),
                output,
                ..
            } => Ok(Bytes::from(output)),
            Ended::Itself { errors, .. } => {
                Err(Refusal::new(404, String::from_utf8_lossy(&errors)))
            }
            other => Err(unfinished(other, "replay")),
        }
    }
}

/// Splits the output of the worker into the data and the page.
fn rendered(output: Vec<u8>) -> Option<Rendered> {
    let output = Bytes::from(output);
    let end = output.iter().position(|byte| *byte == b'\n')?;
    let mut data: Value = serde_json::from_slice(&output[..end]).ok()?;
    let mut hasher = DefaultHasher::new();
    output[..end].hash(&mut hasher);
    let state = format!("{:016x}", hasher.finish());
    data["state"] = json!(state);
    Some(Rendered {
        page: output.slice(end + 1..),
        data: data.to_string().into(),
        state,
    })
}

/// The refusal of a process that did not exit by itself.
fn unfinished(ended: Ended, what: &str) -> Refusal {
    match ended {
        Ended::Late => Refusal::new(504, format!("the {what} took too long")),
        Ended::TooMuch => Refusal::new(500, format!("the {what} is too large to send")),
        Ended::NotStarted(why) => Refusal::new(
            500,
            format!("the process for the {what} could not be started: {why}"),
        ),
        Ended::Itself { errors, .. } => Refusal::new(500, String::from_utf8_lossy(&errors)),
    }
}

/// The files of a history: those of its campaigns, and the tables made from them.
fn state(history: &Path) -> State {
    let mut files = State::new();
    let mut folders = vec![(history.to_owned(), 0)];
    while let Some((folder, depth)) = folders.pop() {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let Ok(data) = entry.metadata() else { continue };
            if data.is_dir() && depth < DEEPEST {
                folders.push((entry.path(), depth + 1));
            } else if data.is_file() {
                files.insert(entry.path(), (data.len(), data.modified().ok()));
            }
        }
    }
    files
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_data_precede_the_page() {
        let found = rendered(b"{\"summary\":\"a\",\"runs\":\"b\"}\n<!doctype html>\n".to_vec());
        let found = found.expect("both parts are there");
        assert_eq!(found.page, "<!doctype html>\n");
        let data: Value = serde_json::from_slice(&found.data).expect("it is JSON");
        assert_eq!(
            data,
            json!({ "summary": "a", "runs": "b", "state": found.state })
        );
        assert!(rendered(b"<!doctype html>".to_vec()).is_none());
    }

    /// A page that was made once never changed, since the folders of campaigns were not looked at.
    #[test]
    fn a_run_that_is_added_changes_the_state() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let campaign = folder.path().join("campaigns/cx23");
        std::fs::create_dir_all(&campaign).expect("a folder can be made");
        let before = state(folder.path());
        std::fs::write(campaign.join("000000.runs"), "run").expect("a file can be written");
        assert_ne!(state(folder.path()), before);
    }

    #[test]
    fn only_ids_are_passed_to_the_process() {
        let worker = Worker {
            program: "no such program".into(),
            arguments: Vec::new(),
        };
        let report = LiveReport::new(worker, Path::new("none"));
        for (run, status) in [("", 400), ("a b", 400), ("a\0", 400), ("x-1", 500)] {
            assert_eq!(
                report.replay(run).map_err(|refusal| refusal.status),
                Err(status),
                "{run}"
            );
        }
    }
}
