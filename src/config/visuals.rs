//! The appearance of the bodies of a configuration: read only for pictures.

use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::foreign::{self, Found};
use crate::robot;
use actcheck_base::{Diagnostics, Files};
use actcheck_data::{SeenLink, SeenPart};

/// Where the files with the visual shapes are.
#[derive(Debug, Clone, PartialEq)]
pub struct VisualFiles {
    /// The robot's profile.
    pub(crate) robot: RobotPlace,
    /// The files that the models are read from.
    pub(crate) files: Files,
    /// The folders with models of SDF, URDF and MJCF.
    pub(crate) folders: Vec<PathBuf>,
    /// The files of these models, by the model's name.
    pub(crate) models: BTreeMap<String, PathBuf>,
}

/// Where a robot is.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RobotPlace {
    pub(crate) files: Files,
    pub(crate) profile: PathBuf,
    /// The folders of `package_dirs`.
    pub(crate) packages: Vec<PathBuf>,
}

impl VisualFiles {
    /// Reads the appearance of the links of the robot: by the names of the links in its file. Adds
    /// a warning for each visual shape that can't be read (W034, W036, W037).
    pub fn robot(&self, found: &mut Diagnostics) -> BTreeMap<String, SeenLink> {
        let RobotPlace {
            files,
            profile,
            packages,
        } = &self.robot;
        robot::seen(files, profile, packages, found)
    }

    /// Reads the appearance of a model of an object, without its moving parts. Frame: the model's.
    /// `None` if it looks like its collision shapes. Adds a warning for each visual shape that can't
    /// be read (W034, W035, W036, W037).
    pub fn model(&self, name: &str, found: &mut Diagnostics) -> Option<Vec<SeenPart>> {
        let model = Found {
            name: name.to_owned(),
            path: self.models.get(name)?.clone(),
        };
        foreign::seen_object(&model, &self.files, &self.folders, found)
    }
}
