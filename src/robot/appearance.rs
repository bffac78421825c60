//! What the simulated links look like, which are merged from several links of the file.

use std::collections::{BTreeMap, BTreeSet};

use crate::RobotModel;
use actcheck_data::{Part, Pose, SeenLink, SeenPart};

impl RobotModel {
    /// Returns what the simulated links look like by their names in traces, from the file's links
    /// by theirs. Simulated links that look like their collision shapes are left out. Frame: the
    /// link's.
    pub fn seen(&self, of_file: &BTreeMap<String, SeenLink>) -> BTreeMap<String, Vec<SeenPart>> {
        let mut parts_of: BTreeMap<usize, Vec<SeenPart>> = BTreeMap::new();
        let mut with_look = BTreeSet::new();
        for (name, (link, at)) in self.frames() {
            let Some(seen) = of_file.get(name) else {
                continue;
            };
            if seen.has_look {
                with_look.insert(*link);
            }
            let placed = seen.parts.iter().map(|seen| SeenPart {
                part: Part {
                    pose: Pose::from_isometry(&(at * seen.part.pose.to_isometry())),
                    shape: seen.part.shape.clone(),
                },
                colour: seen.colour,
            });
            parts_of.entry(*link).or_default().extend(placed);
        }
        parts_of
            .into_iter()
            .filter(|(link, _)| with_look.contains(link))
            .map(|(link, parts)| (format!("robot/{}", self.links[link].name), parts))
            .collect()
    }
}
