//! A depth camera on the robot's camera link, or fixed in the world: casts one ray per pixel
//! against all colliders, including the robot's own links.
//!
//! An image's noise is one recorded choice, `sense.camera.frame`: a seed from which the noise of
//! each pixel is derived. Its nominal value, 0, is an image without noise. So a replay sees the
//! same image, and a shrunk run shows whether the failure needs camera noise.

use nalgebra::{Isometry3, Point3};
use parry3d::shape::Shape;
use rapier3d::prelude::Collider;

use crate::bodies::Bodies;
use crate::drive::Drive;
use crate::physics::{Owner, SHELL};
use actcheck_data::{Camera, ChoiceName, Choices, Stream};
use actcheck_geometry::{Lens, RayScene};
use actcheck_geometry::{from_pose, to_real, to_vector};

/// Distance from the lens within which the camera does not see its own link: housings surround
/// their lens, and their convex hulls close its opening. Unit: metres.
pub(super) const HOUSING_M: f64 = 0.1;

/// Number of noise seeds, including 0 (no noise).
pub(super) const FRAMES: usize = 1 << 32;

/// A depth image. Frame of its points: the camera's, x forwards, y left, z up.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthImage {
    /// Width. Unit: pixels.
    pub width: usize,
    /// Height. Unit: pixels.
    pub height: usize,
    /// Focal length. Unit: pixels.
    pub focal_px: f64,
    /// Depth along the forward axis of each pixel, row by row from the upper left; 0 if nothing was
    /// measured. Unit: metres.
    pub depths: Vec<f32>,
}

impl DepthImage {
    /// Returns the point measured by a pixel, or `None` if it has no depth. Frame: camera.
    pub fn point(&self, column: usize, row: usize) -> Option<Point3<f64>> {
        let depth = f64::from(*self.depths.get(row * self.width + column)?);
        let [left, up] = self.lens().slopes(column, row);
        (depth > 0.0).then(|| Point3::new(depth, depth * left, depth * up))
    }

    /// Projects a point to the image: column from the left, row from the top. Returns `None` if it
    /// is behind the camera.
    pub fn pixel(&self, point: &Point3<f64>) -> Option<[f64; 2]> {
        self.lens().pixel(point)
    }

    fn lens(&self) -> Lens {
        Lens {
            width: self.width,
            height: self.height,
            focal_px: self.focal_px,
        }
    }
}

/// Takes an image from the camera's current true pose, of which only every n-th pixel of every n-th
/// row is measured, from the first on: the others are 0.
pub(super) fn look(
    bodies: &Bodies,
    drive: &Drive,
    stride: usize,
    choices: &mut Choices,
) -> DepthImage {
    let camera = drive.camera();
    let frame = choices.index(ChoiceName::CameraFrame, FRAMES);
    let noise = (frame > 0).then(|| Noise {
        camera,
        stream: Stream::new(frame as u64),
    });
    let eye = bodies.robot.kinematics.camera(&bodies.robot.state().0);
    let solids = RayScene::new(lens(camera), &eye, solids(bodies, drive, &eye));
    picture(camera, &solids, noise.as_ref(), stride)
}

/// All shapes at the poses where sensors see them, except for the housing of a lens here.
fn solids<'a>(
    bodies: &'a Bodies,
    drive: &'a Drive,
    eye: &Isometry3<f64>,
) -> impl Iterator<Item = (Isometry3<f64>, &'a dyn Shape)> {
    let lens = to_vector(&eye.translation.vector);
    let own = bodies.robot.kinematics.camera_link();
    let visible = bodies
        .physics
        .colliders
        .iter()
        .map(|(_, collider)| collider)
        .filter(move |collider| {
            let Owner::Link(link) = Owner::from_tag(collider.user_data) else {
                return collider.user_data & SHELL == 0;
            };
            let away = f64::from(collider.shape().distance_to_point(
                collider.position(),
                lens,
                true,
            ));
            away > if Some(link) == own { HOUSING_M } else { 0.0 }
        });
    visible.map(|collider| (shown_at(drive, collider), collider.shape()))
}

fn shown_at(drive: &Drive, collider: &Collider) -> Isometry3<f64> {
    let decoy = match Owner::from_tag(collider.user_data) {
        Owner::Object(idx) => drive.decoy(idx),
        _ => None,
    };
    match (decoy, collider.position_wrt_parent()) {
        (Some(shown), Some(local)) => shown * from_pose(local),
        _ => from_pose(collider.position()),
    }
}

pub(super) fn lens(camera: &Camera) -> Lens {
    let (width, height) = (camera.width as usize, camera.height as usize);
    Lens {
        width,
        height,
        focal_px: camera.focal_px(),
    }
}

fn picture(
    camera: &Camera,
    solids: &RayScene<'_>,
    noise: Option<&Noise<'_>>,
    stride: usize,
) -> DepthImage {
    let lens = lens(camera);
    let Lens {
        width,
        height,
        focal_px,
    } = lens;
    let mut depths = vec![0.0; width * height];
    for row in (0..height).step_by(stride) {
        for column in (0..width).step_by(stride) {
            let [left, up] = solids.slopes(column, row);
            let stretch = (1.0 + left * left + up * up).sqrt();
            let depth = solids
                .first(column, row, camera.max_range_m / stretch)
                .and_then(|hit| {
                    let range = hit.along * stretch;
                    let pixel = (row * width + column) as u64;
                    let measured = match noise {
                        None => range,
                        Some(noise) => noise
                            .measure(pixel, range, || solids.sine(column, row, hit, stretch))?,
                    };
                    (range >= camera.min_range_m && measured > 0.0)
                        .then_some(to_real(measured / stretch))
                });
            depths[row * width + column] = depth.unwrap_or(0.0);
        }
    }
    DepthImage {
        width,
        height,
        focal_px,
        depths,
    }
}

/// The noise of one image.
struct Noise<'a> {
    camera: &'a Camera,
    stream: Stream,
}

impl Noise<'_> {
    /// Returns the measured range of a pixel, or `None` if it is dropped. `sine` computes the sine
    /// of the angle between ray and surface.
    fn measure(&self, pixel: u64, range: f64, sine: impl FnOnce() -> f64) -> Option<f64> {
        let grazing = self.camera.grazing_rad;
        let lost = if grazing > 0.0 {
            lost_at(sine(), grazing)
        } else {
            0.0
        };
        let kept = (1.0 - lost) * (1.0 - self.camera.dropout);
        let error = self.camera.range_noise_m * range * range * self.stream.bell(2 * pixel);
        (self.stream.unit(2 * pixel + 1) < kept).then_some(range + error)
    }
}

/// Share of pixels dropped on a surface seen at an angle with this sine: 1 at 0, and 0 from
/// `grazing` on.
fn lost_at(sine: f64, grazing: f64) -> f64 {
    // An angle is at least its sine, so the slow arc sine is only needed for grazing rays.
    if sine >= grazing {
        0.0
    } else {
        (1.0 - libm::asin(sine) / grazing).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use parry3d::shape::{Ball, Cuboid};

    use super::*;
    use crate::robot::tests::{alone, lonely};
    use crate::simulation::tests::bodies;

    const SMALL: Camera = Camera {
        width: 64,
        height: 48,
        ..Camera::IDEAL
    };

    fn look(shapes: &[(f64, &dyn Shape)]) -> DepthImage {
        let placed = shapes
            .iter()
            .map(|(ahead, shape)| (Isometry3::translation(*ahead, 0.0, 0.0), *shape));
        picture(
            &SMALL,
            &RayScene::new(lens(&SMALL), &Isometry3::identity(), placed),
            None,
            1,
        )
    }

    fn middle(image: &DepthImage) -> f64 {
        f64::from(image.depths[image.height / 2 * image.width + image.width / 2])
    }

    /// A lens inside of its housing takes the same image as one without: its own head is not in it.
    #[test]
    fn a_camera_does_not_see_its_housing() {
        let open = lonely();
        let mut profile = bodies(&open).robot.profile.as_ref().clone();
        let housing = "<link name=\"head_camera_link\"><collision><geometry><box size=\"0.1 0.1 0.1\"/></geometry></collision></link>";
        let text = profile
            .core
            .urdf
            .text
            .replace("<link name=\"head_camera_link\"/>", housing);
        assert_ne!(text, *profile.core.urdf.text);
        profile.core = actcheck_config::robot::with_urdf(
            profile.core,
            actcheck_base::Source::new("housed.urdf", text),
        )
        .expect("it is a URDF");
        let housed = alone(profile);
        let image = open.look(&mut Choices::random(1, 0));
        assert!(
            image.depths.iter().any(|depth| *depth > 0.0),
            "it sees the floor"
        );
        assert_eq!(housed.look(&mut Choices::random(1, 0)), image);
    }

    #[test]
    fn a_sparse_image_has_the_same_pixels() {
        let world = lonely();
        let [image, sparse] =
            [1, 3].map(|stride| world.look_at_every(stride, &mut Choices::random(2, 0)));
        for (idx, (depth, of_sparse)) in image.depths.iter().zip(&sparse.depths).enumerate() {
            let taken =
                (idx / image.width).is_multiple_of(3) && (idx % image.width).is_multiple_of(3);
            assert_eq!(*of_sparse, if taken { *depth } else { 0.0 }, "pixel {idx}");
        }
    }

    #[test]
    fn a_parallel_wall_has_the_same_depth_everywhere() {
        let image = look(&[(2.5, &Cuboid::new([0.5, 5.0, 5.0].into()))]);
        assert!(image.depths.iter().all(|depth| (depth - 2.0).abs() < 1e-5));
        // The outermost pixel centres are half a pixel inside the field of view.
        let corner = image.point(0, 0).expect("the wall fills the picture");
        let outermost = 2.0 * libm::tan(0.5) * (63.0 / 64.0);
        assert!(
            (corner.y - outermost).abs() < 1e-4
                && (corner.z - outermost * 47.0 / 63.0).abs() < 1e-4,
            "{corner}"
        );
        let [column, row] = image.pixel(&corner).expect("it is in front");
        assert!((column - 0.5).abs() < 1e-4 && (row - 0.5).abs() < 1e-4);
    }

    #[test]
    fn nearer_objects_occlude_and_range_is_limited() {
        let (ball, wall) = (Ball::new(0.2), Cuboid::new([0.1, 9.0, 9.0].into()));
        assert!((middle(&look(&[(3.0, &wall), (1.0, &ball)])) - 0.8).abs() < 2e-3);
        assert!((middle(&look(&[(3.0, &wall)])) - 2.9).abs() < 1e-4);
        assert_eq!(middle(&look(&[(6.0, &wall)])), 0.0);
        // An object that is too near is not measured, but it still occludes the objects behind it.
        assert_eq!(middle(&look(&[(3.0, &wall), (0.4, &ball)])), 0.0);
    }

    #[test]
    fn noise_grows_with_distance_and_grazing_rays_are_lost() {
        let camera = Camera {
            range_noise_m: 0.01,
            dropout: 0.25,
            grazing_rad: 0.4,
            ..SMALL
        };
        let noise = Noise {
            camera: &camera,
            stream: Stream::new(5),
        };
        let values: Vec<Option<f64>> = (0..20_000)
            .map(|pixel| noise.measure(pixel, 2.0, || 1.0))
            .collect();
        let seen: Vec<f64> = values.iter().filter_map(|value| *value).collect();
        let variance =
            seen.iter().map(|range| (range - 2.0).powi(2)).sum::<f64>() / seen.len() as f64;
        assert!((variance.sqrt() - 0.04).abs() < 0.001, "{variance}");
        assert!(
            (seen.len() as f64 / 2e4 - 0.75).abs() < 0.01,
            "{}",
            seen.len()
        );
        let grazing = (0..20_000)
            .filter(|pixel| noise.measure(*pixel, 2.0, || libm::sin(0.1)).is_some())
            .count();
        assert!(
            (grazing as f64 / 2e4 - 0.75 * 0.25).abs() < 0.01,
            "{grazing}"
        );
        assert_eq!(noise.measure(0, 2.0, || 0.0), None);
    }
}
