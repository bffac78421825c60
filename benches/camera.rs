//! Camera: depth images of 320 × 240 and colour images of 224 × 224 per second on one core; depth
//! compared with a plain loop of ray casts.
//!
//! The scenes are a table with five objects, the shipped perception campaign, and an apartment,
//! seen by the robot. Times are CPU times. The goal is at least 60 images per second. The plain
//! loop casts the same rays against each solid of the first scene with parry and keeps the nearest
//! hit; it leaves out the robot's own links and the floor, which the camera renders.

mod support;

use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use actcheck::base::{Digest, Source};
use actcheck::campaign::Env;
use actcheck::config::Overrides;
use actcheck::data::{Choice, ChoiceKind, ChoiceName, Choices, Decor, Scene, Shape, Texture};
use actcheck::world::{DepthImage, World};
use actcheck::{scenario, world};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use parry3d::query::Ray;
use parry3d::shape::{Ball, Cuboid, Cylinder, Shape as ParryShape};

use support::thread_secs;

const PICTURES: u32 = 100;
/// Fewer, because the plain loop is slow.
const PLAIN_PICTURES: u32 = 5;
/// Tilt of the head towards the table.
const TILT_RAD: f64 = -0.5;

fn main() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (scene, built) = measured(
        "five objects on a table",
        &root.join("benches/five_others.toml"),
        None,
    );
    let solids = solids(&scene);
    let image = built.look(&mut frame(0));
    let eye = built.kinematics().camera(&built.observe().positions);
    let plain = per_second(PLAIN_PICTURES, || plain_picture(&solids, &image, &eye));
    let noisy = per_second(PICTURES, || built.look(&mut frame(7)));
    println!(
        "  plain loop of ray casts against {} solids {plain:6.1}; camera with noise is {:.1} × as fast",
        solids.len(),
        noisy / plain
    );
    measured(
        "configs/perceive.toml",
        &root.join("configs/perceive.toml"),
        None,
    );
    let world = (
        "[objectSurface]",
        "[world]\nworlds = [\"apartment\"]\n\n[objectSurface]",
    );
    let surfaces = (
        "\"coffee_table\", \"mini_coffee_table\", \"table\"",
        "\"dining_table\"",
    );
    measured(
        "the same in the apartment",
        &root.join("configs/perceive.toml"),
        Some([world, surfaces]),
    );
}

/// Builds the first scene of a configuration, after text replacements, and prints the image rate.
fn measured(name: &str, config: &PathBuf, replaced: Option<[(&str, &str); 2]>) -> (Scene, World) {
    let mut text = std::fs::read_to_string(config).expect("the configuration is there");
    for (from, to) in replaced.into_iter().flatten() {
        assert!(text.contains(from), "{} has no {from}", config.display());
        text = text.replacen(from, to, 1);
    }
    let folder = config.parent().expect("it is in a folder");
    let source = Source::new(config.display().to_string(), text);
    let env = Env::prepare_text(source, folder, &Overrides::default())
        .unwrap_or_else(|faults| panic!("{faults}"));
    let mut choices = Choices::random(env.campaign.seed, 0);
    let mut scene =
        scenario::draw(&env.space, 0, &mut choices).expect("there is room on the table");
    let camera = &mut scene.sensing.camera;
    (camera.range_noise_m, camera.dropout, camera.grazing_rad) = (0.0015, 0.01, 0.1);
    let mut built = world::build(&scene).expect("the shipped models are sound");
    built.settle();
    look_down(&mut built);
    let exact = per_second(PICTURES, || built.look(&mut frame(0)));
    let noisy = per_second(PICTURES, || built.look(&mut frame(7)));
    let images = [built.look(&mut frame(0)), built.look(&mut frame(7))];
    let seen = images[0]
        .depths
        .iter()
        .filter(|depth| **depth > 0.0)
        .count();
    let pixels = images[0].depths.len();
    println!(
        "{name}: {} × {} pixels, {:.0} % with depth",
        images[0].width,
        images[0].height,
        seen as f64 / pixels as f64 * 100.0
    );
    println!(
        "  images per second on one core (at least 60): without noise {exact:.1}, with noise {noisy:.1}"
    );
    println!("  digest of the images {}", digest(&images));
    coloured(&env, &scene);
    (scene, built)
}

/// Prints the rate of colour images of 224 × 224 pixels of the scene, with a light from aside and
/// wooden tables.
fn coloured(env: &Env, scene: &Scene) {
    let mut scene = scene.clone();
    let camera = &mut scene.sensing.camera;
    (camera.width, camera.height, camera.image_noise) = (224, 224, 0.02);
    let mut built = world::build(&scene).expect("the shipped models are sound");
    let decor = Decor {
        table_texture: Some(Texture::Wood),
        ..Decor::PLAIN
    };
    built.show(Arc::clone(env.skins()), decor);
    built.settle();
    look_down(&mut built);
    let start = thread_secs();
    let first = built.picture(&mut frame(0));
    let first_secs = thread_secs() - start;
    let exact = per_second(PICTURES, || built.picture(&mut frame(0)));
    let noisy = per_second(PICTURES, || built.picture(&mut frame(7)));
    println!(
        "  colour images of 224 × 224 per second on one core (at least 20): without noise {exact:.1}, with noise {noisy:.1}; the first takes {:.0} ms",
        first_secs * 1e3
    );
    let mut digest = Digest::new();
    digest.update(&first.bytes);
    println!("  digest of the colour image {}", digest.finish());
}

/// Digest of images, to check that code changes do not alter them.
fn digest(images: &[DepthImage]) -> String {
    let mut digest = Digest::new();
    images
        .iter()
        .for_each(|image| digest.update_bits(&image.depths));
    digest.finish()
}

/// Choices of one image, with this noise seed.
fn frame(number: u32) -> Choices {
    let kind = ChoiceKind::Index { of: 1 << 32 };
    Choices::recorded(&[Choice {
        name: ChoiceName::CameraFrame,
        kind,
        value: f64::from(number),
    }])
}

fn per_second<T>(pictures: u32, mut take: impl FnMut() -> T) -> f64 {
    let start = thread_secs();
    for _ in 0..pictures {
        black_box(take());
    }
    f64::from(pictures) / (thread_secs() - start)
}

fn look_down(world: &mut World) {
    let mut command = world.hold();
    let tilt = world.layout().head[1];
    command.positions[tilt] = TILT_RAD;
    while world.time_secs() < 3.0 {
        world.step(&command);
    }
}

/// All solids of the scene's objects as parry shapes with poses.
fn solids(scene: &Scene) -> Vec<(parry3d::math::Pose, Box<dyn ParryShape>)> {
    let mut solids: Vec<(parry3d::math::Pose, Box<dyn ParryShape>)> = Vec::new();
    for object in &scene.objects {
        for solid in object.model.solids() {
            let mut pose = object.pose.to_isometry() * solid.pose.to_isometry();
            let shape: Box<dyn ParryShape> = match solid.shape {
                Shape::Box { size: [x, y, z] } => {
                    Box::new(Cuboid::new(vector(x / 2.0, y / 2.0, z / 2.0)))
                }
                Shape::Sphere { radius } => Box::new(Ball::new(radius as f32)),
                Shape::Cylinder { radius, height } => {
                    pose.rotation *= UnitQuaternion::from_axis_angle(
                        &Vector3::x_axis(),
                        std::f64::consts::FRAC_PI_2,
                    );
                    Box::new(Cylinder::new((height / 2.0) as f32, radius as f32))
                }
                _ => continue,
            };
            solids.push((placed(&pose), shape));
        }
    }
    solids
}

fn plain_picture(
    solids: &[(parry3d::math::Pose, Box<dyn ParryShape>)],
    image: &DepthImage,
    eye: &Isometry3<f64>,
) -> Vec<f32> {
    let origin = vector(eye.translation.x, eye.translation.y, eye.translation.z);
    let mut depths = Vec::with_capacity(image.depths.len());
    for row in 0..image.height {
        for column in 0..image.width {
            let off =
                |idx: usize, count: usize| (count as f64 / 2.0 - idx as f64 - 0.5) / image.focal_px;
            let dir =
                eye.rotation * Vector3::new(1.0, off(column, image.width), off(row, image.height));
            let ray = Ray::new(origin, vector(dir.x, dir.y, dir.z));
            let casts = solids
                .iter()
                .filter_map(|(pose, shape)| shape.cast_ray(pose, &ray, 5.0, true));
            depths.push(casts.fold(f32::INFINITY, f32::min));
        }
    }
    depths
}

fn vector(x: f64, y: f64, z: f64) -> parry3d::math::Vector {
    parry3d::math::Vector::new(x as f32, y as f32, z as f32)
}

fn placed(pose: &Isometry3<f64>) -> parry3d::math::Pose {
    let q = pose.rotation.quaternion();
    let rotation =
        parry3d::math::Rotation::from_xyzw(q.i as f32, q.j as f32, q.k as f32, q.w as f32)
            .normalize();
    parry3d::math::Pose::from_parts(
        vector(pose.translation.x, pose.translation.y, pose.translation.z),
        rotation,
    )
}
