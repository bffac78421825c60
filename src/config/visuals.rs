//! What the bodies of a configuration look like: read only for pictures.

use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::robot;
use actcheck_base::{Diagnostics, Files};
use actcheck_data::SeenLink;

/// Where the files with the visual shapes are.
#[derive(Debug, Clone, PartialEq)]
pub struct VisualFiles {
    /// The robot's profile.
    pub(crate) robot: RobotPlace,
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
    /// Reads what the links of the robot look like: by the names of the links in its file. Adds
    /// a warning for each visual shape that can't be read (W034, W036, W037).
    pub fn robot(&self, found: &mut Diagnostics) -> BTreeMap<String, SeenLink> {
        let RobotPlace {
            files,
            profile,
            packages,
        } = &self.robot;
        robot::seen(files, profile, packages, found)
    }
}
