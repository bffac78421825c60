//! The appearance of the simulated links, which are merged from several links of the file.

use std::collections::BTreeMap;

use crate::RobotModel;
use crate::layout::moved;
use actcheck_data::{CameraPlace, LinkFrame, Pose, RobotProfile, SeenLink, SeenPart};

impl RobotModel {
    /// Returns the appearance of the simulated links by their names in traces, from the file's links
    /// by theirs. Simulated links that look like their collision shapes are left out. Frame: the
    /// link's.
    pub fn seen(&self, of_file: &BTreeMap<String, SeenLink>) -> BTreeMap<String, Vec<SeenPart>> {
        let mut of_links: BTreeMap<usize, SeenLink> = BTreeMap::new();
        for (name, (link, at)) in self.frames() {
            let Some(seen) = of_file.get(name) else {
                continue;
            };
            let mut seen = seen.clone();
            seen.transform(at);
            of_links.entry(*link).or_default().add(seen);
        }
        of_links
            .into_iter()
            .filter(|(_, seen)| seen.has_look)
            .map(|(link, seen)| (format!("robot/{}", self.links[link].name), seen.parts))
            .collect()
    }

    /// Returns the place of a camera by its simulated link. Returns `None` if the file has no such
    /// link.
    pub fn camera_place(&self, camera: &LinkFrame) -> Option<CameraPlace> {
        let found = self.frames().find(|(name, _)| *name == camera.link);
        if let Some((_, (link, at))) = found {
            return Some(CameraPlace {
                link: Some(format!("robot/{}", self.links[*link].name)),
                pose: Pose::from_isometry(&(at * moved(camera))),
            });
        }
        (camera.link == RobotProfile::MAP).then(|| CameraPlace {
            link: None,
            pose: Pose::from_isometry(&moved(camera)),
        })
    }
}
