//! The appearance of the simulated links, which are merged from several links of the file.

use std::collections::BTreeMap;

use crate::RobotModel;
use actcheck_data::{SeenLink, SeenPart};

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
}
