//! Kubernetes: one Indexed Job, one pod for each shard, on a shared volume.

use std::path::{Component, Path, PathBuf};

use serde_json::{Value, json};

use crate::launch::args::On;
use crate::launch::plan::Plan;
use crate::launch::scheduler::{Job, Look, Place, Scheduler, ask, refused, words_of};
use actcheck_base::{Diagnostic, Diagnostics, ShellLine};

/// Name of the manifest in the folder of the launch.
pub(super) const MANIFEST: &str = "kubernetes.json";
/// A finished job is kept for this time, for its pods' events. Unit: seconds.
const KEPT_SECS: u64 = 86_400;
/// Reasons of a waiting container that don't go away by themselves.
const TROUBLES: [&str; 6] = [
    "CreateContainerConfigError",
    "ErrImageNeverPull",
    "ErrImagePull",
    "ImagePullBackOff",
    "InvalidImageName",
    "Unschedulable",
];

/// Kubernetes through `kubectl`.
pub(super) struct Kubernetes {
    image: String,
    volume: String,
    mount: PathBuf,
    namespace: Option<String>,
    program: String,
}

impl Kubernetes {
    /// # Errors
    /// `X076` an image or volume is missing, or a file is outside the volume.
    pub fn new(plan: &Plan, place: &Place) -> Result<Self, Diagnostics> {
        let resources = &place.resources;
        let mut faults = Diagnostics::new();
        for (key, value, help) in [
            (
                "image",
                &resources.image,
                "name an image with actcheck: `--resources image=registry.example.org/actcheck:0.1.0`",
            ),
            (
                "volume",
                &resources.volume,
                "name the claim of the volume with this folder: `--resources volume=projects`",
            ),
        ] {
            if value.is_none() {
                let message = format!("`--on kubernetes` needs the key `{key}` in `--resources`");
                faults.push(Diagnostic::error("X076", message).help(help));
            }
        }
        let mount = resources
            .mount
            .as_ref()
            .map_or_else(|| place.folder.clone(), PathBuf::from);
        for path in [
            &place.folder,
            &place.absolute(&plan.folder),
            &place.absolute(&plan.config),
        ] {
            if !mount.is_absolute() || !is_inside(path, &mount) {
                let message = format!(
                    "`{}` is not on the volume mounted at `{}`",
                    path.display(),
                    mount.display()
                );
                let help = "pods see only the volume: name the folder at which it is mounted here, with `--resources mount=/DIR`";
                faults.push(Diagnostic::error("X076", message).help(help));
                break;
            }
        }
        faults.or(Self {
            image: resources.image.clone().unwrap_or_default(),
            volume: resources.volume.clone().unwrap_or_default(),
            mount,
            namespace: resources.namespace.clone(),
            program: resources
                .program
                .clone()
                .unwrap_or_else(|| "actcheck".to_owned()),
        })
    }

    /// The Indexed Job.
    fn manifest(&self, job: &Job<'_>) -> Value {
        let number = job.shards.len();
        let labels = json!({"app.kubernetes.io/name": "actcheck", "actcheck/launch": job.plan.id});
        let mut manifest = json!({
            "apiVersion": "batch/v1",
            "kind": "Job",
            "metadata": {"name": job.name, "labels": labels},
            "spec": {
                "completionMode": "Indexed",
                "completions": number,
                "parallelism": job.place.parallel.unwrap_or(u64::MAX).min(number as u64),
                "backoffLimitPerIndex": job.place.tries.saturating_sub(1),
                "podFailurePolicy": {"rules": [
                    // Exit code 2 is a fault that would come again.
                    {"action": "FailIndex",
                     "onExitCodes": {"containerName": "shard", "operator": "In", "values": [2]}},
                    {"action": "Ignore", "onPodConditions": [{"type": "DisruptionTarget", "status": "True"}]},
                ]},
                "ttlSecondsAfterFinished": KEPT_SECS,
                "template": {"metadata": {"labels": labels}, "spec": self.pod(job)},
            },
        });
        if let Some(namespace) = &self.namespace {
            manifest["metadata"]["namespace"] = json!(namespace);
        }
        manifest
    }

    fn pod(&self, job: &Job<'_>) -> Value {
        let resources = &job.place.resources;
        let mut needs = json!({"requests": {"cpu": job.place.cpus().to_string()}});
        if let Some(mib) = resources.memory_mib {
            needs["requests"]["memory"] = json!(format!("{mib}Mi"));
            needs["limits"] = json!({"memory": format!("{mib}Mi")});
        }
        let mut pod = json!({
            "restartPolicy": "Never",
            "containers": [{
                "name": "shard",
                "image": self.image,
                "workingDir": job.place.folder.display().to_string(),
                "command": ["/bin/sh", "-c", self.script(job)],
                "resources": needs,
                "volumeMounts": [{"name": "project", "mountPath": self.mount.display().to_string()}],
            }],
            "volumes": [{"name": "project", "persistentVolumeClaim": {"claimName": self.volume}}],
        });
        if let Some(secs) = resources.time_secs {
            pod["activeDeadlineSeconds"] = json!(secs);
        }
        pod
    }

    /// Runs the shard of an index. The process gets the signals to the pod.
    fn script(&self, job: &Job<'_>) -> String {
        let folder = ShellLine::default().in_script(&job.plan.folder);
        let is_whole = job.shards.len() as u64 == job.plan.shards;
        let number = match is_whole {
            true => "n=$((JOB_COMPLETION_INDEX + 1))".to_owned(),
            false => {
                let shards: Vec<String> = job.shards.iter().map(u64::to_string).collect();
                format!(
                    "set -- {}; shift \"$JOB_COMPLETION_INDEX\"; n=$1",
                    shards.join(" ")
                )
            }
        };
        let program = ShellLine::default().in_script(&self.program);
        format!(
            "{number}; exec {program} launch-task {folder} \"$n\" >> {folder}/logs/\"$n\".log 2>&1"
        )
    }

    fn kubectl(&self, words: &[&str]) -> Vec<String> {
        let mut all: Vec<String> = ["kubectl", "--request-timeout=30s"]
            .map(str::to_owned)
            .to_vec();
        all.extend(
            self.namespace
                .iter()
                .map(|namespace| format!("--namespace={namespace}")),
        );
        all.extend(words.iter().map(|word| (*word).to_owned()));
        all
    }

    /// A reason for which pods of a job wait, from their states. Without the right to list pods
    /// there is none.
    fn waiting_for(&self, name: &str) -> Result<Option<String>, Diagnostics> {
        let selector = format!("--selector=batch.kubernetes.io/job-name={name}");
        let pending = "--field-selector=status.phase=Pending";
        let output = ask(
            self.title(),
            &self.kubectl(&["get", "pods", &selector, pending, "--output=json"]),
        )?;
        Ok(serde_json::from_slice(&output.stdout)
            .ok()
            .as_ref()
            .and_then(reason_of))
    }
}

impl Scheduler for Kubernetes {
    fn on(&self) -> On {
        On::Kubernetes
    }

    fn title(&self) -> &'static str {
        "Kubernetes"
    }

    fn files(&self, job: &Job<'_>) -> Vec<(&'static str, String)> {
        vec![(MANIFEST, format!("{:#}\n", self.manifest(job)))]
    }

    fn command(&self, job: &Job<'_>) -> Vec<String> {
        let manifest = job.plan.folder.join(MANIFEST).display().to_string();
        self.kubectl(&["apply", "--filename", &manifest])
    }

    fn submit(&mut self, job: &Job<'_>) -> Result<String, Diagnostics> {
        let output = ask(self.title(), &self.command(job))?;
        if output.status.success() {
            return Ok(job.name.clone());
        }
        let help = "change `--resources`, or the cluster of `kubectl config current-context`";
        Err(refused(self.title(), &words_of(&output), help))
    }

    fn find(&mut self, name: &str) -> Result<Option<String>, Diagnostics> {
        Ok(matches!(self.look(name)?, Look::Active { .. }).then(|| name.to_owned()))
    }

    fn look(&mut self, id: &str) -> Result<Look, Diagnostics> {
        let output = ask(
            self.title(),
            &self.kubectl(&["get", "job", id, "--output=json"]),
        )?;
        if !output.status.success() {
            let words = words_of(&output);
            return Ok(match words.contains("(NotFound)") {
                true => Look::Ended,
                false => Look::Unanswered(words),
            });
        }
        let Ok(job) = serde_json::from_slice::<Value>(&output.stdout) else {
            return Ok(Look::Unanswered(
                "`kubectl get job` did not print JSON".to_owned(),
            ));
        };
        let mut look = look_of(&job);
        if let Look::Active {
            running: 0,
            reason,
            trouble,
            ..
        } = &mut look
        {
            *reason = self.waiting_for(id)?;
            *trouble = reason
                .clone()
                .filter(|reason| TROUBLES.contains(&reason.as_str()));
        }
        Ok(look)
    }

    fn cancel(&self, id: &str) -> Option<String> {
        let namespace = self
            .namespace
            .as_ref()
            .map_or_else(String::new, |name| format!(" --namespace={name}"));
        Some(format!("kubectl{namespace} delete job {id}"))
    }
}

/// The state of a job from its description.
fn look_of(job: &Value) -> Look {
    let status = &job["status"];
    let conditions = status["conditions"].as_array().into_iter().flatten();
    let has_ended = |condition: &Value| {
        matches!(condition["type"].as_str(), Some("Complete" | "Failed"))
            && condition["status"] == "True"
    };
    if conditions.into_iter().any(has_ended) {
        return Look::Ended;
    }
    let number = |key: &str| status[key].as_u64().unwrap_or(0);
    let (running, finished) = (number("ready"), number("succeeded") + number("failed"));
    let all = job["spec"]["completions"].as_u64().unwrap_or(0);
    let waiting = all.saturating_sub(finished + running);
    Look::Active {
        running,
        waiting,
        reason: None,
        trouble: None,
    }
}

/// The first reason for which pods wait.
fn reason_of(pods: &Value) -> Option<String> {
    let of_container = |pod: &Value| {
        let states = pod["status"]["containerStatuses"]
            .as_array()
            .into_iter()
            .flatten();
        states
            .filter_map(|state| state["state"]["waiting"]["reason"].as_str())
            .next()
            .map(str::to_owned)
    };
    let of_pod = |pod: &Value| {
        let conditions = pod["status"]["conditions"].as_array().into_iter().flatten();
        let mut unmet = conditions.filter(|condition| condition["status"] == "False");
        unmet
            .find_map(|condition| condition["reason"].as_str())
            .map(str::to_owned)
    };
    pods["items"]
        .as_array()?
        .iter()
        .find_map(|pod| of_container(pod).or_else(|| of_pod(pod)))
}

/// Whether an absolute path is in a folder by its name: in the pods, links may lead elsewhere.
fn is_inside(path: &Path, folder: &Path) -> bool {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => {
                plain.pop();
            }
            Component::CurDir => {}
            part => plain.push(part),
        }
    }
    plain.starts_with(folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_state_of_a_job_is_read_from_its_description() {
        let active = |running, waiting| Look::Active {
            running,
            waiting,
            reason: None,
            trouble: None,
        };
        let spec = json!({"completions": 4});
        assert_eq!(look_of(&json!({"spec": spec})), active(0, 4));
        let status = json!({"active": 2, "ready": 1, "succeeded": 1});
        assert_eq!(
            look_of(&json!({"spec": spec, "status": status})),
            active(1, 2)
        );
        for end in ["Complete", "Failed"] {
            let status = json!({"conditions": [{"type": end, "status": "True"}]});
            assert_eq!(
                look_of(&json!({"spec": spec, "status": status})),
                Look::Ended
            );
        }
    }

    #[test]
    fn reasons_of_waiting_pods_are_found() {
        let pulling =
            json!({"containerStatuses": [{"state": {"waiting": {"reason": "ImagePullBackOff"}}}]});
        let unplaced = json!({"conditions": [{"type": "PodScheduled", "status": "False", "reason": "Unschedulable"}]});
        for (status, reason) in [(pulling, "ImagePullBackOff"), (unplaced, "Unschedulable")] {
            assert_eq!(
                reason_of(&json!({"items": [{}, {"status": status}]})).as_deref(),
                Some(reason)
            );
        }
        assert_eq!(reason_of(&json!({"items": []})), None);
    }
}
