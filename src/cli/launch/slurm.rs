//! Slurm: one array of jobs, one task for each shard.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use crate::launch::args::On;
use crate::launch::plan::Plan;
use crate::launch::resources::Resources;
use crate::launch::scheduler::{Job, Look, Place, Scheduler, ask, refused, words_of};
use actcheck_base::{Diagnostic, Diagnostics, ShellLine};

/// Name of the script in the folder of the launch.
pub(super) const SCRIPT: &str = "slurm.sh";
/// Parts of reasons that don't go away by themselves, in lower case. An array that asks for more
/// cores than any node has is accepted, and waits for `PartitionConfig`.
const TROUBLES: [&str; 5] = [
    "held",
    "badconstraints",
    "timelimit",
    "partitionconfig",
    "partitionnodelimit",
];

/// Slurm through its commands.
pub(super) struct Slurm {
    program: String,
}

impl Slurm {
    /// # Errors
    /// `X074` a folder's name has a line break, which an `#SBATCH` line can't have; `X052` as
    /// [`Place::program`].
    pub fn new(plan: &Plan, place: &Place) -> Result<Self, Diagnostics> {
        let folder = place.absolute(&plan.folder).display().to_string();
        if folder.contains(['\n', '\r']) {
            let message = format!(
                "the name of the folder `{folder}` has a line break, which Slurm can't read"
            );
            return Err(Diagnostic::error("X074", message)
                .help("name another folder with `--history DIR`")
                .into());
        }
        Ok(Self {
            program: place.program()?,
        })
    }

    fn directives(job: &Job<'_>) -> String {
        let (plan, place) = (job.plan, job.place);
        let Resources {
            memory_mib,
            time_secs,
            partition,
            account,
            ..
        } = &place.resources;
        let at_once = place
            .parallel
            .map_or_else(String::new, |number| format!("%{number}"));
        let logs = place
            .absolute(&plan.folder.join("logs"))
            .display()
            .to_string();
        let mut lines = vec![
            ("job-name", job.name.clone()),
            ("array", ranges(&job.shards) + &at_once),
            ("chdir", place.folder.display().to_string()),
            // Slurm replaces `%a` by the number of the task.
            ("output", format!("{}/%a.log", logs.replace('%', "%%"))),
            ("open-mode", "append".to_owned()),
            ("ntasks", "1".to_owned()),
            ("cpus-per-task", place.cpus().to_string()),
        ];
        lines.extend(memory_mib.map(|mib| ("mem", format!("{mib}M"))));
        lines.extend(time_secs.map(|secs| ("time", secs.div_ceil(60).to_string())));
        lines.extend(partition.clone().map(|name| ("partition", name)));
        lines.extend(account.clone().map(|name| ("account", name)));
        let line =
            |(key, value): (&str, String)| format!("#SBATCH --{key}={}\n", in_directive(&value));
        lines.into_iter().map(line).collect::<String>() + "#SBATCH --requeue\n"
    }
}

impl Scheduler for Slurm {
    fn on(&self) -> On {
        On::Slurm
    }

    fn title(&self) -> &'static str {
        "Slurm"
    }

    fn files(&self, job: &Job<'_>) -> Vec<(&'static str, String)> {
        let task = ShellLine::default()
            .in_script(&self.program)
            .fixed("launch-task")
            .in_script(&job.plan.folder);
        let mut text = format!("#!/bin/sh\n{}", Self::directives(job));
        // A requeue delays a task by two minutes, so it is first tried again here.
        let _ = write!(
            text,
            "# A task that ends early is started again, and resumes its shard. Exit code 2 is a fault that would come again.\n\
             try=1\n\
             while :; do\n\
             \x20   {task} \"$SLURM_ARRAY_TASK_ID\"\n\
             \x20   code=$?\n\
             \x20   case $code in 0 | 2) exit $code ;; esac\n\
             \x20   [ $try -lt {tries} ] || exit $code\n\
             \x20   try=$((try + 1))\n\
             \x20   sleep 1\n\
             done\n",
            tries = job.place.tries,
        );
        vec![(SCRIPT, text)]
    }

    fn command(&self, job: &Job<'_>) -> Vec<String> {
        let script = job.plan.folder.join(SCRIPT).display().to_string();
        vec!["sbatch".to_owned(), "--parsable".to_owned(), script]
    }

    fn submit(&mut self, job: &Job<'_>) -> Result<String, Diagnostics> {
        let output = ask(self.title(), &self.command(job))?;
        let text = String::from_utf8_lossy(&output.stdout);
        // `--parsable` prints the id, or the id and the cluster: 1234;north.
        let id = text
            .lines()
            .last()
            .unwrap_or_default()
            .split(';')
            .next()
            .unwrap_or_default()
            .trim();
        if output.status.success() && id.parse::<u64>().is_ok() {
            return Ok(id.to_owned());
        }
        let help = "change `--resources`; if it is about the array, take fewer shards: the largest number of a task is below \
                    MaxArraySize in `scontrol show config`";
        Err(refused(self.title(), &words_of(&output), help))
    }

    fn find(&mut self, name: &str) -> Result<Option<String>, Diagnostics> {
        let words = [
            "squeue",
            "--noheader",
            "--me",
            "--name",
            name,
            "--format",
            "%A",
        ]
        .map(str::to_owned);
        let output = ask(self.title(), &words)?;
        let text = String::from_utf8_lossy(&output.stdout);
        let found = text
            .lines()
            .map(str::trim)
            .find(|id| id.parse::<u64>().is_ok());
        Ok(found.map(str::to_owned))
    }

    fn look(&mut self, id: &str) -> Result<Look, Diagnostics> {
        let words = [
            "squeue",
            "--noheader",
            "--array",
            "--jobs",
            id,
            "--format",
            "%T|%r",
        ]
        .map(str::to_owned);
        let output = ask(self.title(), &words)?;
        if !output.status.success() {
            let words = words_of(&output);
            // A job leaves the queue's memory minutes after its end.
            return Ok(match words.contains("Invalid job id") {
                true => Look::Ended,
                false => Look::Unanswered(words),
            });
        }
        Ok(look_of(&String::from_utf8_lossy(&output.stdout)))
    }

    fn cancel(&self, id: &str) -> Option<String> {
        Some(format!("scancel {id}"))
    }
}

/// The state of a job from the states and reasons of its tasks, one in a line.
fn look_of(lines: &str) -> Look {
    let (mut running, mut waiting) = (0, 0);
    let mut reasons: BTreeMap<&str, u64> = BTreeMap::new();
    for line in lines.lines() {
        let (state, reason) = line.trim().split_once('|').unwrap_or((line.trim(), ""));
        match state {
            "" => {}
            "PENDING" | "REQUEUED" | "REQUEUE_HOLD" | "SPECIAL_EXIT" | "SUSPENDED" | "STOPPED"
            | "RESV_DEL_HOLD" => {
                waiting += 1;
                if !matches!(reason, "" | "None") {
                    *reasons.entry(reason).or_default() += 1;
                }
            }
            _ => running += 1,
        }
    }
    if running + waiting == 0 {
        return Look::Ended;
    }
    let needs_user = |reason: &&&str| {
        let reason = reason.to_ascii_lowercase();
        TROUBLES.iter().any(|trouble| reason.contains(trouble))
    };
    let trouble = reasons
        .keys()
        .find(needs_user)
        .map(|reason| (*reason).to_owned());
    let reason = reasons
        .iter()
        .max_by_key(|(_, number)| **number)
        .map(|(reason, _)| (*reason).to_owned());
    Look::Active {
        running,
        waiting,
        reason,
        trouble,
    }
}

/// Numbers as Slurm's array indices: `1-4,7`.
fn ranges(numbers: &BTreeSet<u64>) -> String {
    let mut ranges: Vec<(u64, u64)> = Vec::new();
    for &number in numbers {
        match ranges.last_mut() {
            Some((_, last)) if *last + 1 == number => *last = number,
            _ => ranges.push((number, number)),
        }
    }
    let text = |(first, last): (u64, u64)| {
        if first == last {
            first.to_string()
        } else {
            format!("{first}-{last}")
        }
    };
    ranges.into_iter().map(text).collect::<Vec<_>>().join(",")
}

/// A value in an `#SBATCH` line, which ends at a space and knows quotes and `\`.
fn in_directive(value: &str) -> String {
    let is_plain = |c: char| !c.is_whitespace() && !r#""'\#"#.contains(c);
    match value.chars().all(is_plain) {
        true => value.to_owned(),
        false => format!("\"{}\"", value.replace('\\', r"\\").replace('"', "\\\"")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_joined_into_ranges() {
        assert_eq!(ranges(&BTreeSet::from([1, 2, 3, 7, 9, 10])), "1-3,7,9-10");
    }

    #[test]
    fn states_of_tasks_are_counted() {
        assert_eq!(look_of(""), Look::Ended);
        let active = |running, waiting, reason: Option<&str>, trouble: Option<&str>| Look::Active {
            running,
            waiting,
            reason: reason.map(str::to_owned),
            trouble: trouble.map(str::to_owned),
        };
        let lines = "RUNNING|None\nCOMPLETING|None\nPENDING|Resources\nPENDING|Priority\nPENDING|Resources\n";
        assert_eq!(look_of(lines), active(2, 3, Some("Resources"), None));
        let held = "launch failed requeued held";
        for reason in [held, "PartitionConfig"] {
            assert_eq!(
                look_of(&format!("PENDING|{reason}\n")),
                active(0, 1, Some(reason), Some(reason))
            );
        }
    }

    #[test]
    fn values_with_spaces_are_quoted() {
        assert_eq!(in_directive("/a/%a.log"), "/a/%a.log");
        assert_eq!(in_directive("/my \"runs\""), r#""/my \"runs\"""#);
    }
}
