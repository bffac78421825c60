//! Ray: one task for each shard, from a Python program that ends with this process.

use std::io::{Read as _, Seek as _, SeekFrom};
use std::os::unix::process::CommandExt as _;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

use serde_json::json;

use crate::launch::args::On;
use crate::launch::plan::Plan;
use crate::launch::scheduler::{Job, Look, Place, Scheduler, refused, unstarted};
use actcheck_base::{Diagnostic, Diagnostics, open_regular};

/// The Python program, and its name in the folder of the launch. As `ray.py`, it would import
/// itself.
pub(super) const SCRIPT: (&str, &str) = ("run_on_ray.py", include_str!("run_on_ray.py"));
/// Name of the program's settings in the folder of the launch.
pub(super) const SETTINGS: &str = "ray.json";
/// Maximum length of the end of the program's messages. Unit: bytes.
const MOST_WORDS: u64 = 1_000;
/// Exit codes of the program.
const WITHOUT_PACKAGE: i32 = 3;
const WITHOUT_CLUSTER: i32 = 4;

/// Ray through its Python package.
pub(super) struct Ray {
    python: String,
    program: String,
    /// The messages of Ray: pages about each lost node, which are not for the terminal.
    log: PathBuf,
    child: Option<Child>,
}

impl Ray {
    pub fn new(plan: &Plan, place: &Place) -> Result<Self, Diagnostics> {
        let python = place
            .resources
            .python
            .clone()
            .unwrap_or_else(|| "python3".to_owned());
        let log = plan.folder.join("logs").join("ray.log");
        Ok(Self {
            python,
            program: place.program()?,
            log,
            child: None,
        })
    }

    fn settings(&self, job: &Job<'_>) -> String {
        let place = job.place;
        let settings = json!({
            "address": place.resources.address,
            "cpus": place.cpus(),
            "cwd": place.folder.display().to_string(),
            "folder": job.plan.folder.display().to_string(),
            "memory": place.resources.memory_mib.map(|mib| mib << 20),
            "parallel": place.parallel.unwrap_or(job.plan.shards),
            "program": self.program,
            "shards": job.shards,
            "tries": place.tries,
        });
        format!("{settings:#}\n")
    }

    /// The end of the messages.
    fn words(&self) -> String {
        let mut text = Vec::new();
        if let Ok(mut log) = open_regular(&self.log) {
            let length = log.metadata().map_or(0, |about| about.len());
            // A log that can't be read is shown as empty.
            let _ = log.seek(SeekFrom::Start(length.saturating_sub(MOST_WORDS)));
            let _ = log.read_to_end(&mut text);
        }
        String::from_utf8_lossy(&text)
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ")
    }
}

impl Scheduler for Ray {
    fn on(&self) -> On {
        On::Ray
    }

    fn title(&self) -> &'static str {
        "Ray"
    }

    fn files(&self, job: &Job<'_>) -> Vec<(&'static str, String)> {
        vec![
            (SETTINGS, self.settings(job)),
            (SCRIPT.0, SCRIPT.1.to_owned()),
        ]
    }

    fn command(&self, job: &Job<'_>) -> Vec<String> {
        let file = |name: &str| job.plan.folder.join(name).display().to_string();
        vec![self.python.clone(), file(SCRIPT.0), file(SETTINGS)]
    }

    fn submit(&mut self, job: &Job<'_>) -> Result<String, Diagnostics> {
        let log = job.plan.below().emptied(&self.log);
        let log = log
            .and_then(|log| Ok((log.try_clone()?, log)))
            .map_err(|error| job.plan.unwritable(&error))?;
        let mut command = Command::new(&self.python);
        command
            .args(&self.command(job)[1..])
            .stdin(Stdio::piped())
            .stdout(log.0)
            .stderr(log.1);
        // Ctrl-C at the terminal reaches only this process, which then ends the program.
        let child = command
            .process_group(0)
            .spawn()
            .map_err(|error| unstarted("Ray", &self.python, &error))?;
        self.child = Some(child);
        Ok(job.name.clone())
    }

    fn find(&mut self, _: &str) -> Result<Option<String>, Diagnostics> {
        // The job of an earlier process has ended with it.
        Ok(None)
    }

    fn look(&mut self, _: &str) -> Result<Look, Diagnostics> {
        let Some(child) = &mut self.child else {
            return Ok(Look::Ended);
        };
        let ended = match child.try_wait() {
            Ok(None) => {
                return Ok(Look::Active {
                    running: 0,
                    waiting: 0,
                    reason: None,
                    trouble: None,
                });
            }
            Ok(Some(status)) => status.code(),
            Err(_) => None,
        };
        self.child = None;
        match ended {
            Some(WITHOUT_PACKAGE) => {
                let message = format!("`{}` lacks the package ray: {}", self.python, self.words());
                let help = "install it (`pip install ray`), or name another Python: `--resources python=/path/of/python3`";
                Err(Diagnostic::error("X077", message).help(help).into())
            }
            Some(WITHOUT_CLUSTER) => {
                let help = "start a cluster with `ray start --head`, or name one with `--resources address=HOST:PORT`";
                Err(refused("Ray", &self.words(), help))
            }
            _ => Ok(Look::Ended),
        }
    }

    fn outlives(&self) -> bool {
        false
    }

    fn cancel(&self, _: &str) -> Option<String> {
        None
    }

    fn end(&mut self) {
        if let Some(mut child) = self.child.take() {
            drop(child.stdin.take());
            // Waiting fails only if the process is gone.
            let _ = child.wait();
        }
    }
}
