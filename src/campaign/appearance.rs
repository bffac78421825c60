//! The appearance of the bodies of a stored campaign, for pictures of its runs.

use std::sync::Arc;

use crate::environment::stored_campaign;
use crate::solids;
use actcheck_base::Diagnostics;
use actcheck_config::Campaign;
use actcheck_data::{Appearances, ObjectModel, RobotCore, SeenPart, Shape};
use actcheck_history::{CampaignRecord, History};
use actcheck_world::{LazySkins, Robot, Skins};

/// Most triangles of a body: more than a picture shows.
const MOST_OF_A_BODY: usize = 2000;
/// Most triangles of all bodies, whose meshes are a part of a report.
const MOST_OF_ALL: usize = 20_000;

/// Reads the appearance of the bodies of a campaign: the visual shapes that the files of its
/// configuration name, with few triangles. Adds a warning for each that can't be read (W034, W036,
/// W037). Bodies without visual shapes are left out, as are all if the campaign can't be prepared
/// any more or has another robot now: pictures show the shapes that their traces contain.
///
/// This starts the program that expands the robot's file, if there is one.
///
/// # Errors
/// `H014` if the history has no such campaign.
pub fn appearances(
    history: &History,
    campaign: &str,
    found: &mut Diagnostics,
) -> Result<Appearances, Diagnostics> {
    let record = history.campaign(campaign)?;
    let Some(mut campaign) = with_same_robot(history, &record) else {
        return Ok(Appearances::default());
    };
    let mut all = Appearances::default();
    for name in campaign.used_models() {
        let digest = campaign.models.get(&name).map(|model| &model.digest);
        let is_same =
            digest.is_some_and(|digest| record.models.contains(&(name.clone(), digest.clone())));
        let parts = is_same.then(|| campaign.visuals.model(&name, found));
        all.models
            .extend(parts.flatten().map(|parts| (name, parts)));
    }
    let of_file = campaign.visuals.robot(found);
    let (has_look, camera) = (
        of_file.values().any(|seen| seen.has_look),
        campaign.robot.camera.clone(),
    );
    if (has_look || camera.is_some())
        && let Ok(model) = solids::robot_model(&mut campaign)
    {
        all.camera = camera.and_then(|camera| model.camera_place(&camera));
        if has_look {
            all.links = model.seen(&of_file);
        }
    }
    reduce(&mut all);
    Ok(all)
}

/// The surfaces of the bodies of a campaign, whose files are read when the first image is taken.
/// Visual shapes that can't be read are those of collisions; [`appearances`] warns of them.
pub(crate) fn skins(campaign: &Campaign, robot: &Robot) -> LazySkins {
    let (visuals, robot) = (campaign.visuals.clone(), Arc::clone(&robot.model));
    let used = campaign.used_models();
    let models: Vec<Arc<ObjectModel>> = used
        .iter()
        .filter_map(|name| campaign.models.get(name).cloned())
        .collect();
    LazySkins::new(Box::new(move || {
        let mut found = Diagnostics::new();
        let seen = models.iter().filter_map(|model| {
            let parts = visuals.model(&model.name, &mut found)?;
            Some((model.name.clone(), parts))
        });
        let models_seen = seen.collect();
        let all = Appearances {
            links: robot.seen(&visuals.robot(&mut found)),
            models: models_seen,
            camera: None,
        };
        Skins::new(&all, models.iter().map(Arc::as_ref), &robot)
    }))
}

/// Reads the robot of a campaign; `None` if the campaign can't be prepared any more, has another robot
/// now, or was imported.
///
/// This starts the program that expands the robot's file, if there is one.
///
/// # Errors
/// `H014` if the history has no such campaign.
pub fn stored_robot(history: &History, campaign: &str) -> Result<Option<RobotCore>, Diagnostics> {
    let record = history.campaign(campaign)?;
    Ok(with_same_robot(history, &record).map(|campaign| campaign.robot.core.clone()))
}

/// Reads the configuration of a campaign; `None` if it can't be read any more, or names another robot
/// now.
fn with_same_robot(history: &History, record: &CampaignRecord) -> Option<Campaign> {
    let campaign = stored_campaign(history, record).ok()?;
    let core = &campaign.robot.core;
    let robot = (core.name.clone(), core.digest.clone());
    record.models.contains(&robot).then_some(campaign)
}

/// Limits the triangles of each body and of all together.
fn reduce(all: &mut Appearances) {
    let wanted = |parts: &Vec<SeenPart>| n_triangles(parts).min(MOST_OF_A_BODY);
    let bodies = all.links.values().chain(all.models.values());
    let sum: usize = bodies.map(wanted).sum();
    for parts in all.links.values_mut().chain(all.models.values_mut()) {
        let most = match sum > MOST_OF_ALL {
            true => wanted(parts) * MOST_OF_ALL / sum,
            false => MOST_OF_A_BODY,
        };
        *parts = SeenPart::reduced(std::mem::take(parts), most);
    }
}

fn n_triangles(parts: &[SeenPart]) -> usize {
    let of_part = |seen: &SeenPart| match &seen.part.shape {
        Shape::Mesh { mesh } => mesh.triangles.len(),
        _ => 0,
    };
    parts.iter().map(of_part).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::{Mesh, Part, Pose};

    /// A report has the meshes of all bodies.
    #[test]
    fn all_bodies_together_have_a_limited_number_of_triangles() {
        let side = 100_u32;
        let vertices = (0..side * side)
            .map(|idx| [f64::from(idx % side), f64::from(idx / side), 0.0])
            .collect();
        let triangles = (0..side * (side - 1) - 1)
            .map(|idx| [idx, idx + 1, idx + side])
            .collect();
        let mesh = Mesh::new(vertices, triangles).expect("it is a mesh");
        let sheet = || {
            vec![SeenPart {
                part: Part {
                    pose: Pose::IDENTITY,
                    shape: Shape::Mesh { mesh: mesh.clone() },
                },
                colour: None,
            }]
        };
        let of = |n: usize| {
            let mut all = Appearances::default();
            for idx in 0..n {
                all.links.insert(format!("robot/{idx}"), sheet());
            }
            all.models.insert("sheet".to_owned(), sheet());
            reduce(&mut all);
            let counts = all.links.values().chain(all.models.values());
            counts.map(|parts| n_triangles(parts)).collect::<Vec<_>>()
        };
        let few = of(2);
        assert!(
            few.iter()
                .all(|count| (1000..=MOST_OF_A_BODY).contains(count)),
            "{few:?}"
        );
        let many = of(39);
        assert!(many.iter().sum::<usize>() <= MOST_OF_ALL, "{many:?}");
        assert!(many.iter().all(|count| *count > 100), "{many:?}");
    }
}
