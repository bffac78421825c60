//! MuJoCo in the place of the physics engine, in a Python of the user's choice.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use serde::Deserialize;
use serde_json::{Value, json};

use crate::python::{PythonModule, PythonTalk};
use actcheck_campaign::{EngineContact, EngineLink, EngineState, MovedObject, Setpoint};
use actcheck_data::Pose;

/// Processes with MuJoCo, one for each run that is being made.
pub(super) struct MujocoPool {
    python: PathBuf,
    scratch: PathBuf,
    needs: &'static str,
    free: Mutex<Vec<PythonTalk>>,
}

/// A process that makes a run, and is free afterwards.
struct MujocoLink {
    pool: Arc<MujocoPool>,
    talk: Option<PythonTalk>,
}

/// An answer to `begin`.
#[derive(Deserialize)]
struct Begun {
    #[serde(default)]
    reason: Option<String>,
}

/// A contact: both bodies, the normal force, the force on the second one, and the point.
type Contact = (String, String, f64, [f64; 3], [f64; 3]);

/// An answer to `tick`.
#[derive(Deserialize)]
struct Ticked {
    #[serde(default)]
    reason: Option<String>,
    #[serde(default)]
    positions: Vec<f64>,
    #[serde(default)]
    velocities: Vec<f64>,
    #[serde(default)]
    loads: Vec<f64>,
    #[serde(default)]
    objects: Vec<Vec<f64>>,
    #[serde(default)]
    contacts: Vec<Contact>,
}

impl MujocoPool {
    /// Processes of this Python, which find the package in the folder `scratch`.
    pub(super) fn new(python: &Path, scratch: &Path, needs: &'static str) -> Arc<Self> {
        Arc::new(Self {
            python: python.to_path_buf(),
            scratch: scratch.to_path_buf(),
            needs,
            free: Mutex::new(Vec::new()),
        })
    }

    /// Returns a link to a process, which is started when the run begins.
    pub(super) fn link(self: &Arc<Self>) -> Box<dyn EngineLink> {
        Box::new(MujocoLink {
            pool: Arc::clone(self),
            talk: None,
        })
    }

    fn free(&self) -> std::sync::MutexGuard<'_, Vec<PythonTalk>> {
        self.free.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn take(&self) -> Result<PythonTalk, String> {
        if let Some(talk) = self.free().pop() {
            return Ok(talk);
        }
        let module = PythonModule {
            python: &self.python,
            name: "actcheck.cross_check",
            needs: self.needs,
            scratch: &self.scratch,
        };
        module.talk(&["--serve".as_ref()])
    }
}

impl EngineLink for MujocoLink {
    fn begin(
        &mut self,
        mjcf: &str,
        joints: &[String],
        objects: &[String],
        tick_secs: f64,
    ) -> Result<(), String> {
        let mut talk = self.pool.take()?;
        let begin = json!({ "begin": {
            "mjcf": mjcf, "joints": joints, "objects": objects, "tick_s": tick_secs,
        } });
        let begun: Begun = talk.ask(&begin)?;
        self.talk = Some(talk);
        begun.reason.map_or(Ok(()), Err)
    }

    fn tick(&mut self, setpoints: &[Setpoint]) -> Result<EngineState, String> {
        let Some(talk) = &mut self.talk else {
            return Err("no scene was loaded".to_owned());
        };
        let rows = setpoints
            .iter()
            .map(|one| json!([one.position, one.velocity, one.limit, one.effort]));
        let ticked: Ticked = talk.ask(&json!({ "tick": rows.collect::<Vec<Value>>() }))?;
        if let Some(reason) = ticked.reason {
            return Err(reason);
        }
        let objects: Option<Vec<MovedObject>> =
            ticked.objects.iter().map(|values| moved(values)).collect();
        let contacts = ticked.contacts.into_iter();
        Ok(EngineState {
            positions: ticked.positions,
            velocities: ticked.velocities,
            loads: ticked.loads,
            objects: objects.ok_or("MuJoCo's model lacks an object")?,
            contacts: contacts
                .map(
                    |(first, second, normal_n, force_n, point_m)| EngineContact {
                        pair: [first, second],
                        normal_n,
                        force_n,
                        point_m,
                    },
                )
                .collect(),
        })
    }
}

/// Reads an object: position, rotation, linear and angular velocity.
fn moved(values: &[f64]) -> Option<MovedObject> {
    let part = |at: usize| values.get(at..at + 3)?.try_into().ok();
    Some(MovedObject {
        pose: Pose {
            position: part(0)?,
            rotation: values.get(3..7)?.try_into().ok()?,
        },
        linear: part(7)?,
        angular: part(10)?,
    })
}

impl Drop for MujocoLink {
    fn drop(&mut self) {
        if let Some(talk) = self.talk.take() {
            self.pool.free().push(talk);
        }
    }
}
