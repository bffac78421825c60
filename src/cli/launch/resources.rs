//! `--resources`: the needs of a shard, and where it runs.

use crate::launch::args::On;
use crate::option_fault::OptionFault;
use actcheck_base::{Diagnostic, Diagnostics, did_you_mean};
use actcheck_config::duration_secs;

/// Each key, where it has a meaning, and an example.
const KEYS: [(&str, &[On], &str); 12] = [
    ("account", &[On::Slurm], "account=robots"),
    ("address", &[On::Ray], "address=10.0.0.1:6379"),
    (
        "cpus",
        &[On::Local, On::Slurm, On::Kubernetes, On::Ray],
        "cpus=2",
    ),
    (
        "image",
        &[On::Kubernetes],
        "image=registry.example.org/actcheck:0.1.0",
    ),
    ("memory", &[On::Slurm, On::Kubernetes, On::Ray], "memory=4G"),
    ("mount", &[On::Kubernetes], "mount=/data"),
    ("namespace", &[On::Kubernetes], "namespace=robots"),
    ("partition", &[On::Slurm], "partition=short"),
    (
        "program",
        &[On::Slurm, On::Kubernetes, On::Ray],
        "program=/opt/actcheck/bin/actcheck",
    ),
    ("python", &[On::Ray], "python=/opt/ray/bin/python3"),
    ("time", &[On::Slurm, On::Kubernetes], "time=2h"),
    ("volume", &[On::Kubernetes], "volume=projects"),
];

/// Largest number of workers of a shard.
const MOST_CPUS: u64 = 1024;

/// The needs of a shard.
#[derive(Debug, Clone, Default)]
pub(super) struct Resources {
    /// Workers of a shard.
    pub cpus: Option<u64>,
    /// Memory of a shard. Unit: MiB.
    pub memory_mib: Option<u64>,
    /// Longest time of a shard. Unit: seconds.
    pub time_secs: Option<u64>,
    pub partition: Option<String>,
    pub account: Option<String>,
    pub image: Option<String>,
    /// Name of the claim of the shared volume.
    pub volume: Option<String>,
    /// Folder at which the shared volume is mounted, here and in the pods.
    pub mount: Option<String>,
    pub namespace: Option<String>,
    /// Address of the cluster.
    pub address: Option<String>,
    /// The Python that has the package of the scheduler.
    pub python: Option<String>,
    /// Path of actcheck where the shards run.
    pub program: Option<String>,
}

impl Resources {
    /// Reads the texts `key=value`. All faults are reported.
    ///
    /// # Errors
    /// `X076` a key is unknown, has no meaning there, is named twice, or has a wrong value.
    pub fn parse(texts: &[String], on: On) -> Result<Self, Diagnostics> {
        let mut resources = Self::default();
        let mut faults = Diagnostics::new();
        let mut seen: Vec<&str> = Vec::new();
        for text in texts {
            let (key, value) = text
                .split_once('=')
                .map_or((text.trim(), ""), |(key, value)| (key.trim(), value.trim()));
            let here = || KEYS.iter().filter(|(_, places, _)| places.contains(&on));
            let Some((_, _, example)) = here().find(|(name, ..)| *name == key) else {
                faults.push(unknown(key, on, here().map(|(name, ..)| *name)));
                continue;
            };
            if seen.contains(&key) {
                let message = format!("`--resources` has `{key}` twice");
                faults.push(Diagnostic::error("X076", message).help("remove one of them"));
            } else if let Err(reason) = resources.set(key, value) {
                let message = format!("`--resources {key}`: {reason}");
                faults.push(
                    Diagnostic::error("X076", message)
                        .help(format!("write `--resources {example}`")),
                );
            }
            seen.push(key);
        }
        faults.or(resources)
    }

    fn set(&mut self, key: &str, value: &str) -> Result<(), OptionFault> {
        // Files and commands of schedulers hold the value in one line.
        if value.is_empty() || value.chars().any(char::is_control) {
            return Err("the value is missing, or has a control character".into());
        }
        match key {
            "cpus" => {
                self.cpus = Some(
                    count(value)
                        .filter(|&cpus| cpus <= MOST_CPUS)
                        .ok_or("expected 1 to 1024")?,
                )
            }
            "memory" => {
                self.memory_mib =
                    Some(mebibytes(value).ok_or("expected a size such as 500M or 4G")?)
            }
            "time" => {
                let secs = duration_secs(value).map_err(|fault| fault.to_string())?;
                self.time_secs = Some(whole_secs(secs));
            }
            _ => *self.name(key) = Some(value.to_owned()),
        }
        Ok(())
    }

    fn name(&mut self, key: &str) -> &mut Option<String> {
        match key {
            "partition" => &mut self.partition,
            "account" => &mut self.account,
            "image" => &mut self.image,
            "volume" => &mut self.volume,
            "mount" => &mut self.mount,
            "namespace" => &mut self.namespace,
            "address" => &mut self.address,
            "python" => &mut self.python,
            _ => &mut self.program,
        }
    }
}

/// X076: a key without a meaning where the shards run.
fn unknown<'a>(key: &str, on: On, here: impl Iterator<Item = &'a str> + Clone) -> Diagnostic {
    let elsewhere = KEYS.iter().find(|(name, ..)| *name == key);
    let message = match elsewhere {
        Some(_) => format!(
            "`--resources {key}` has no meaning with `--on {}`",
            on.name()
        ),
        None => format!("`--resources` has no key `{key}`"),
    };
    let help = match elsewhere {
        Some((_, places, _)) => {
            let places: Vec<String> = places
                .iter()
                .map(|place| format!("`--on {}`", place.name()))
                .collect();
            format!("remove it, or use {}", places.join(" or "))
        }
        None => did_you_mean(key, here),
    };
    Diagnostic::error("X076", message).help(help)
}

fn count(text: &str) -> Option<u64> {
    text.parse().ok().filter(|&number| number > 0)
}

/// Parses a size in units of 1024: `500M`, `4G`, `4Gi`, `4GiB` or `1T`.
fn mebibytes(text: &str) -> Option<u64> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let factor = match text[digits.len()..].to_ascii_uppercase().as_str() {
        "M" | "MI" | "MB" | "MIB" => 1,
        "G" | "GI" | "GB" | "GIB" => 1 << 10,
        "T" | "TI" | "TB" | "TIB" => 1 << 20,
        _ => return None,
    };
    count(digits)?.checked_mul(factor)
}

fn whole_secs(secs: f64) -> u64 {
    // At most a year: exact.
    secs.ceil() as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_several_spellings() {
        for (text, mib) in [("500M", 500), ("4G", 4096), ("4GiB", 4096), ("1t", 1 << 20)] {
            assert_eq!(mebibytes(text), Some(mib), "{text}");
        }
        for text in [
            "",
            "4",
            "G",
            "0G",
            "1.5G",
            "-1G",
            "99999999999999999999G",
            "18446744073709551615T",
        ] {
            assert_eq!(mebibytes(text), None, "{text}");
        }
    }
}
