//! The colour twin of the depth camera: the same lens at the same pose, over the visual shapes of
//! the bodies. The sensor's noise has a recorded seed, as that of depth images does.

use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock};

use nalgebra::{Isometry3, Vector3};

use crate::bodies::Bodies;
use crate::camera::{self, HOUSING_M};
use crate::drive::Drive;
use actcheck_data::{
    Appearances, Camera, ChoiceName, Choices, Colour, Decor, ObjectModel, Part, SeenPart, Stream,
    Texture,
};
use actcheck_geometry::{Drawn, Finish, Light, RgbImage, Skin, draw, from_pose};
use actcheck_robot::RobotModel;

/// Distance from the eye within which objects are not seen. Unit: metres.
const NEAR_M: f64 = 0.005;
/// Side of the drawn floor. Unit: metres.
const FLOOR_SIDE_M: f64 = 60.0;
/// Colours of bodies whose files state none.
const FLOOR: Colour = Colour([168, 160, 148]);
const TABLE: Colour = Colour([176, 134, 92]);
const WALL: Colour = Colour([228, 224, 214]);
const ROBOT: Colour = Colour([188, 192, 198]);

/// The surfaces of the bodies of a campaign, shared by all its simulations.
#[derive(Debug, Default)]
pub struct Skins {
    /// By the index of the link.
    links: BTreeMap<usize, Arc<Skin>>,
    /// By the name of the model.
    models: BTreeMap<String, ModelSkin>,
}

/// The surface of a model at its own scale.
#[derive(Debug, Clone)]
struct ModelSkin {
    skin: Arc<Skin>,
    height_m: f64,
}

/// The surfaces of a campaign, prepared when the first image is taken.
pub type LazySkins = LazyLock<Skins, Box<dyn FnOnce() -> Skins + Send + Sync>>;

impl Skins {
    /// Prepares the surfaces of models and of a robot's links: their appearance or, without one,
    /// their collision shapes.
    pub fn new<'a>(
        appearances: &Appearances,
        models: impl Iterator<Item = &'a ObjectModel>,
        robot: &RobotModel,
    ) -> Self {
        let links = robot.links.iter().enumerate().map(|(idx, link)| {
            let seen = appearances.links.get(&format!("robot/{}", link.name));
            (idx, skin(seen, &link.solids))
        });
        let models = models.map(|model| {
            let seen = appearances.models.get(&model.name);
            let skin = skin(seen, &model.parts);
            let height_m = model.size_m[2];
            (model.name.clone(), ModelSkin { skin, height_m })
        });
        Self {
            links: links.collect(),
            models: models.collect(),
        }
    }
}

fn skin(seen: Option<&Vec<SeenPart>>, solids: &[Part]) -> Arc<Skin> {
    let plain = |part: &Part| SeenPart {
        part: part.clone(),
        colour: None,
    };
    Arc::new(match seen {
        Some(parts) => Skin::of(parts),
        None => Skin::of(&solids.iter().map(plain).collect::<Vec<_>>()),
    })
}

/// The bodies of one scene, as images show them.
pub struct Stage {
    floor: Skin,
    objects: Vec<PaintedBody>,
    links: Vec<PaintedBody>,
    light: Light,
}

/// An object of a scene, for images.
#[derive(Debug, Clone, Copy)]
pub struct StagedObject<'a> {
    /// Its id.
    pub id: &'a str,
    /// Name of its model.
    pub model: &'a str,
    /// The height of its model at the scale of the scene. Unit: metres.
    pub height_m: f64,
    /// Its shapes, for models that the campaign's surfaces lack.
    pub parts: &'a [Part],
    /// Whether it is furniture, a wall or part of the building.
    pub is_fixed: bool,
    /// Whether it can hold other objects.
    pub has_surface: bool,
    /// Whether it is a part of another object.
    pub is_part: bool,
}

struct PaintedBody {
    skin: Arc<Skin>,
    scale: f64,
    plain: Colour,
    finish: Option<Finish>,
}

impl PaintedBody {
    fn at(&self, pose: Isometry3<f64>, near_m: f64) -> Drawn<'_> {
        Drawn {
            skin: &self.skin,
            pose,
            scale: self.scale,
            plain: self.plain,
            finish: self.finish,
            near_m,
            has_shadow: true,
        }
    }
}

impl Stage {
    /// Paints the bodies of a scene: its objects, and the links of a robot by their indices. Those
    /// that the campaign's surfaces lack are drawn by their collision shapes.
    pub fn new<'a>(
        skins: &Skins,
        decor: &Decor,
        objects: impl Iterator<Item = StagedObject<'a>>,
        robot: &RobotModel,
    ) -> Self {
        let links = robot.links.iter().enumerate();
        let links = links.map(|(idx, link)| PaintedBody {
            skin: match skins.links.get(&idx) {
                Some(skin) => Arc::clone(skin),
                None => skin(None, &link.solids),
            },
            scale: 1.0,
            plain: ROBOT,
            finish: None,
        });
        Self {
            floor: Skin::ground(FLOOR_SIDE_M, FLOOR),
            objects: objects
                .map(|object| painted(&object, skins, decor))
                .collect(),
            links: links.collect(),
            light: Light {
                towards: Vector3::from(decor.to_light()),
                brightness: decor.light_brightness,
                ambient: decor.ambient,
            },
        }
    }

    /// Draws the bodies at their poses, in the order of the scene; those without a pose are left
    /// out. Frame: world.
    pub fn draw(
        &self,
        camera: &Camera,
        eye: &Isometry3<f64>,
        objects: impl Iterator<Item = Option<Isometry3<f64>>>,
        links: impl Iterator<Item = Option<Isometry3<f64>>>,
    ) -> RgbImage {
        let floor = Drawn {
            skin: &self.floor,
            pose: Isometry3::identity(),
            scale: 1.0,
            plain: FLOOR,
            finish: None,
            near_m: NEAR_M,
            has_shadow: false,
        };
        let objects = self.objects.iter().zip(objects);
        let links = self.links.iter().zip(links);
        let bodies = std::iter::once(floor)
            .chain(objects.filter_map(|(body, pose)| Some(body.at(pose?, NEAR_M))))
            .chain(links.filter_map(|(body, pose)| Some(body.at(pose?, HOUSING_M))));
        let bodies: Vec<Drawn<'_>> = bodies.collect();
        draw(camera::lens(camera), eye, &bodies, &self.light)
    }
}

fn painted(object: &StagedObject<'_>, skins: &Skins, decor: &Decor) -> PaintedBody {
    let known = skins.models.get(object.model);
    let (skin, scale) = match known.filter(|_| !object.is_part) {
        Some(known) => (Arc::clone(&known.skin), object.height_m / known.height_m),
        None => (skin(None, object.parts), 1.0),
    };
    let scale = if scale.is_finite() { scale } else { 1.0 };
    let (plain, finish) = match (object.is_fixed, object.has_surface) {
        (true, true) => (TABLE, table_finish(decor)),
        (true, false) => (WALL, None),
        (false, _) => {
            let texture = Texture::Plain;
            let chosen = decor.object_colour(object.id);
            (
                Colour::of_name(object.model),
                chosen.map(|colour| Finish { texture, colour }),
            )
        }
    };
    PaintedBody {
        skin,
        scale,
        plain,
        finish,
    }
}

/// The finish of the tables, if the scene chose one.
fn table_finish(decor: &Decor) -> Option<Finish> {
    let is_chosen = decor.table_texture.is_some() || decor.table_colour.is_some();
    is_chosen.then(|| Finish {
        texture: decor.table_texture.unwrap_or(Texture::Plain),
        colour: decor.table_colour.unwrap_or(TABLE),
    })
}

/// The bodies of a simulation.
pub(super) fn stage(bodies: &Bodies, skins: &Skins, decor: &Decor) -> Stage {
    let objects = bodies.objects.iter().map(|object| StagedObject {
        id: &object.id,
        model: &object.model.name,
        height_m: object.model.size_m[2],
        parts: &object.model.parts,
        is_fixed: object.fixed,
        has_surface: object.model.surface.is_some(),
        is_part: object.attached.is_some(),
    });
    Stage::new(skins, decor, objects, &bodies.robot.model)
}

/// Takes a colour image from the camera's current true pose.
pub(super) fn picture(
    bodies: &Bodies,
    drive: &Drive,
    stage: &Stage,
    choices: &mut Choices,
) -> RgbImage {
    let camera = drive.camera();
    let eye = bodies.robot.kinematics.camera(&bodies.robot.state().0);
    let objects = (0..bodies.objects.len()).map(|idx| Some(drive.shown(bodies, idx)));
    let links = bodies.robot.bodies.iter().map(|handle| {
        let body = bodies.physics.bodies.get(*handle)?;
        Some(from_pose(body.position()))
    });
    let mut image = stage.draw(camera, &eye, objects, links);
    if camera.image_noise > 0.0 {
        let frame = choices.index(ChoiceName::CameraFrame, camera::FRAMES);
        add_noise(&mut image, frame as u64, camera.image_noise);
    }
    image
}

/// Adds noise to each channel; `deviation` is a share of full brightness. The seed 0 is an image
/// without noise.
fn add_noise(image: &mut RgbImage, seed: u64, deviation: f64) {
    if seed == 0 {
        return;
    }
    let stream = Stream::new(seed);
    for (number, byte) in (0_u64..).zip(&mut image.bytes) {
        let noisy = f64::from(*byte) / 255.0 + deviation * stream.bell(number);
        *byte = Colour::of_srgb([noisy; 3]).0[0];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::tests::lonely;

    #[test]
    fn noise_has_the_configured_deviation_and_its_seed() {
        let grey = RgbImage {
            width: 100,
            height: 50,
            bytes: vec![128; 15_000],
        };
        let noisy = |seed: u64| {
            let mut image = grey.clone();
            add_noise(&mut image, seed, 0.05);
            image
        };
        assert_eq!(noisy(0), grey);
        assert_eq!(noisy(3), noisy(3));
        assert_ne!(noisy(3), noisy(4));
        let square = |byte: &u8| (f64::from(*byte) / 255.0 - 128.0 / 255.0).powi(2);
        let variance = noisy(3).bytes.iter().map(square).sum::<f64>() / 15_000.0;
        assert!((variance.sqrt() - 0.05).abs() < 0.002, "{variance}");
    }

    /// The floor is all that the camera of this robot sees.
    #[test]
    fn an_image_without_noise_makes_no_choice() {
        let world = lonely();
        let mut choices = Choices::random(1, 0);
        let image = world.picture(&mut choices);
        assert_eq!(image, world.picture(&mut Choices::recorded(&[])));
        assert!(choices.made().is_empty());
        assert_eq!(image.bytes.len(), 3 * image.width * image.height);
        assert!(image.bytes.iter().any(|byte| *byte != image.bytes[0]));
    }
}
