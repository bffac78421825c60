//! A depth camera on the robot's camera link: one ray a pixel against everything there is, the robot's own links included.
//!
//! What a picture gets wrong is one recorded choice, `sense.camera.frame`: the number of the picture's noise, from which
//! the noise of each pixel follows by its place. Its nominal value, 0, is a picture without noise. So a replay has the same
//! picture, and a shrunk record says whether a failure needs the camera's noise at all.

use nalgebra::{Isometry3, Point3, Vector3};
use parry3d::bounding_volume::Aabb;
use parry3d::partitioning::{Bvh, BvhBuildStrategy};
use parry3d::query::Ray;
use parry3d::shape::Shape;
use rapier3d::math::Pose as EnginePose;
use rapier3d::prelude::Collider;

use crate::base::{Choices, Stream};
use crate::scenario::Camera;
use crate::world::World;
use crate::world::convert::{to_pose, to_real, to_vector};
use crate::world::engine::Owner;

/// How many different noises there are, that without any included.
const FRAMES: usize = 1 << 32;

/// A picture of distances. Frame of its points: the camera's, x forwards, y left, z up.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthImage {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Distance of the picture's plane from the eye, in pixels.
    pub focal_px: f64,
    /// Distance along the forward axis for each pixel, row by row from the upper left; 0 where nothing was measured.
    /// Unit: metres.
    pub depths: Vec<f32>,
}

impl DepthImage {
    /// What a pixel sees, if it sees anything. Frame: camera.
    pub fn point(&self, column: usize, row: usize) -> Option<Point3<f64>> {
        let depth = f64::from(*self.depths.get(row * self.width + column)?);
        let [left, up] = self.slopes(column, row);
        (depth > 0.0).then(|| Point3::new(depth, depth * left, depth * up))
    }

    /// Where a point would be in the picture: columns from the left, rows from above; nothing for what is behind.
    pub fn pixel(&self, point: &Point3<f64>) -> Option<[f64; 2]> {
        let scale = self.focal_px / point.x;
        let (width, height) = (self.width as f64, self.height as f64);
        (point.x > 0.0).then(|| [width / 2.0 - point.y * scale, height / 2.0 - point.z * scale])
    }

    /// How far a pixel's ray goes left and up on a unit of its way forwards.
    fn slopes(&self, column: usize, row: usize) -> [f64; 2] {
        let off = |idx: usize, count: usize| (count as f64 / 2.0 - idx as f64 - 0.5) / self.focal_px;
        [off(column, self.width), off(row, self.height)]
    }
}

impl World {
    /// Takes a picture with the camera as it is now, at its true place.
    pub fn look(&self, choices: &mut Choices) -> DepthImage {
        let camera = &self.sensing.camera;
        let frame = choices.index("sense.camera.frame", FRAMES);
        let noise = (frame > 0).then(|| Noise { camera, stream: Stream::new(frame as u64) });
        let eye = self.robot.kinematics.camera(&self.robot.state(&self.engine).0);
        picture(camera, &eye, &Solids::new(self.solids()), noise.as_ref())
    }

    /// All shapes, where sensors see them.
    fn solids(&self) -> impl Iterator<Item = (EnginePose, &dyn Shape)> {
        self.engine.colliders.iter().map(|(_, collider)| (self.shown_at(collider), collider.shape()))
    }

    fn shown_at(&self, collider: &Collider) -> EnginePose {
        let decoy = match Owner::from_tag(collider.user_data) {
            Owner::Object(idx) => self.decoys.get(&idx),
            _ => None,
        };
        match (decoy, collider.position_wrt_parent()) {
            (Some(shown), Some(local)) => to_pose(shown) * *local,
            _ => *collider.position(),
        }
    }
}

/// Shapes in the world, sorted by place.
struct Solids<'a> {
    shapes: Vec<(EnginePose, &'a dyn Shape)>,
    tree: Bvh,
}

impl<'a> Solids<'a> {
    fn new(shapes: impl Iterator<Item = (EnginePose, &'a dyn Shape)>) -> Self {
        let shapes: Vec<(EnginePose, &dyn Shape)> = shapes.collect();
        let boxes: Vec<Aabb> = shapes.iter().map(|(pose, shape)| shape.compute_aabb(pose)).collect();
        Self { tree: Bvh::from_leaves(BvhBuildStrategy::default(), &boxes), shapes }
    }

    /// The first shape on a ray's way, and how far along it is, in lengths of the ray's direction.
    fn first(&self, ray: &Ray, most: f32) -> Option<(usize, f32)> {
        let cast = |leaf: u32, best: f32| {
            let (pose, shape) = self.shapes.get(leaf as usize)?;
            shape.cast_ray(pose, ray, best, true)
        };
        self.tree.cast_ray(ray, most, cast).map(|(leaf, along)| (leaf as usize, along))
    }

    /// Angle between a ray and the surface that it met. Unit: radians.
    fn angle(&self, ray: &Ray, (idx, along): (usize, f32)) -> f64 {
        let (pose, shape) = &self.shapes[idx];
        // A little farther, so that rounding does not lose the hit.
        let met = shape.cast_ray_and_get_normal(pose, ray, along * 1.001 + 1e-4, true);
        let sine = met.map_or(1.0, |met| f64::from((met.normal.dot(ray.dir) / ray.dir.length()).abs()));
        libm::asin(sine.min(1.0))
    }
}

fn picture(camera: &Camera, eye: &Isometry3<f64>, solids: &Solids<'_>, noise: Option<&Noise<'_>>) -> DepthImage {
    let (width, height) = (camera.width as usize, camera.height as usize);
    let focal_px = f64::from(camera.width) / 2.0 / libm::tan(camera.field_of_view_rad / 2.0);
    let mut image = DepthImage { width, height, focal_px, depths: Vec::with_capacity(width * height) };
    let axis = |axis: Vector3<f64>| to_vector(&(eye.rotation * axis));
    let (forwards, left, up) = (axis(Vector3::x()), axis(Vector3::y()), axis(Vector3::z()));
    let origin = to_vector(&eye.translation.vector);
    for row in 0..height {
        for column in 0..width {
            let [to_left, upwards] = image.slopes(column, row);
            let ray = Ray::new(origin, forwards + left * to_real(to_left) + up * to_real(upwards));
            let stretch = (1.0 + to_left * to_left + upwards * upwards).sqrt();
            let hit = solids.first(&ray, to_real(camera.max_range_m / stretch));
            let depth = hit.and_then(|hit| {
                let range = f64::from(hit.1) * stretch;
                let measured = match noise {
                    None => range,
                    Some(noise) => noise.measure((row * width + column) as u64, range, || solids.angle(&ray, hit))?,
                };
                (range >= camera.min_range_m && measured > 0.0).then_some(to_real(measured / stretch))
            });
            image.depths.push(depth.unwrap_or(0.0));
        }
    }
    image
}

/// What one picture gets wrong.
struct Noise<'a> {
    camera: &'a Camera,
    stream: Stream,
}

impl Noise<'_> {
    /// The range that a pixel measures, if it measures any. `angle` is that between ray and surface.
    fn measure(&self, pixel: u64, range: f64, angle: impl FnOnce() -> f64) -> Option<f64> {
        let grazing = self.camera.grazing_rad;
        let lost = if grazing > 0.0 { (1.0 - angle() / grazing).max(0.0) } else { 0.0 };
        let kept = (1.0 - lost) * (1.0 - self.camera.dropout);
        let error = self.camera.range_noise_m * range * range * self.stream.bell(2 * pixel);
        (self.stream.unit(2 * pixel + 1) < kept).then_some(range + error)
    }
}

#[cfg(test)]
mod tests {
    use parry3d::shape::{Ball, Cuboid};
    use rapier3d::math::Vector;

    use super::*;

    const SMALL: Camera = Camera { width: 64, height: 48, ..Camera::IDEAL };

    fn at(x: f64, y: f64, z: f64) -> EnginePose {
        to_pose(&Isometry3::translation(x, y, z))
    }

    fn middle(image: &DepthImage) -> f64 {
        f64::from(image.depths[image.height / 2 * image.width + image.width / 2])
    }

    #[test]
    fn a_wall_is_everywhere_as_deep_as_it_is_far() {
        let wall = Cuboid::new(Vector::new(0.5, 5.0, 5.0));
        let solids = Solids::new([(at(2.5, 0.0, 0.0), &wall as &dyn Shape)].into_iter());
        let image = picture(&SMALL, &Isometry3::identity(), &solids, None);
        assert!(image.depths.iter().all(|depth| (depth - 2.0).abs() < 1e-5));
        // The outermost columns look half a pixel less than half the field of view aside.
        let corner = image.point(0, 0).expect("the wall fills the picture");
        let outermost = 2.0 * libm::tan(0.5) * (63.0 / 64.0);
        assert!((corner.y - outermost).abs() < 1e-4 && (corner.z - outermost * 47.0 / 63.0).abs() < 1e-4, "{corner}");
        let [column, row] = image.pixel(&corner).expect("it is in front");
        assert!((column - 0.5).abs() < 1e-4 && (row - 0.5).abs() < 1e-4);
    }

    #[test]
    fn the_nearer_of_two_hides_the_other_and_range_is_limited() {
        let (ball, wall) = (Ball::new(0.2), Cuboid::new(Vector::new(0.1, 9.0, 9.0)));
        let wall_at = |x| (at(x, 0.0, 0.0), &wall as &dyn Shape);
        let ball_at = |x| (at(x, 0.0, 0.0), &ball as &dyn Shape);
        let look = |shapes: Vec<(EnginePose, &dyn Shape)>| {
            picture(&SMALL, &Isometry3::identity(), &Solids::new(shapes.into_iter()), None)
        };
        assert!((middle(&look(vec![wall_at(3.0), ball_at(1.0)])) - 0.8).abs() < 2e-3);
        assert!((middle(&look(vec![wall_at(3.0)])) - 2.9).abs() < 1e-4);
        assert_eq!(middle(&look(vec![wall_at(6.0)])), 0.0);
        // What is too near is not seen, and it still hides what is behind.
        assert_eq!(middle(&look(vec![wall_at(3.0), ball_at(0.4)])), 0.0);
    }

    #[test]
    fn noise_grows_with_distance_and_grazing_rays_are_lost() {
        let camera = Camera { range_noise_m: 0.01, dropout: 0.25, grazing_rad: 0.4, ..SMALL };
        let noise = Noise { camera: &camera, stream: Stream::new(5) };
        let values: Vec<Option<f64>> = (0..20_000).map(|pixel| noise.measure(pixel, 2.0, || 1.0)).collect();
        let seen: Vec<f64> = values.iter().filter_map(|value| *value).collect();
        let variance = seen.iter().map(|range| (range - 2.0).powi(2)).sum::<f64>() / seen.len() as f64;
        assert!((variance.sqrt() - 0.04).abs() < 0.001, "{variance}");
        assert!((seen.len() as f64 / 2e4 - 0.75).abs() < 0.01, "{}", seen.len());
        let grazing = (0..20_000).filter(|pixel| noise.measure(*pixel, 2.0, || 0.1).is_some()).count();
        assert!((grazing as f64 / 2e4 - 0.75 * 0.25).abs() < 0.01, "{grazing}");
        assert_eq!(noise.measure(0, 2.0, || 0.0), None);
    }

    #[test]
    fn a_floor_seen_at_a_slant_has_its_angle() {
        let floor = Cuboid::new(Vector::new(9.0, 9.0, 0.5));
        let solids = Solids::new([(at(0.0, 0.0, -1.5), &floor as &dyn Shape)].into_iter());
        let ray = Ray::new(Vector::new(0.0, 0.0, 0.0), Vector::new(2.0, 0.0, -1.0));
        let hit = solids.first(&ray, 10.0).expect("the floor is there");
        assert!((hit.1 - 1.0).abs() < 1e-6);
        assert!((solids.angle(&ray, hit) - libm::atan(0.5)).abs() < 1e-5);
    }
}
