//! Ray casting from one eye point.
//!
//! All rays of an image start at the same point. So each shape is prepared once for that point, and
//! each ray is tested only against the shapes whose silhouette overlaps the tile of its pixel and
//! whose bounding sphere it hits, nearest first. Boxes, cylinders and balls, the most frequent
//! shapes, are intersected in closed form; the library's iterative cylinder intersection takes a
//! hundred times as long.

use nalgebra::{Isometry3, Point3, Vector3};
use parry3d::query::Ray;
use parry3d::shape::{Shape, TypedShape};

use crate::convert::{from_vector, to_real, to_vector};
use crate::silhouette::Silhouette;

/// Side of a tile in pixels: small enough for few shapes per tile, large enough for few tiles.
const TILE: usize = 8;
/// Margin of bounding spheres, so that rounding does not make a ray miss a shape. Unit: metres.
const BALL_RIM_M: f64 = 1e-4;

/// A pinhole projection between pixels and directions. Frame: camera, x forwards, y left, z up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    /// Image width. Unit: pixels.
    pub width: usize,
    /// Image height. Unit: pixels.
    pub height: usize,
    /// Focal length. Unit: pixels.
    pub focal_px: f64,
}

impl Lens {
    /// Returns how far a pixel's ray goes left and up per unit forwards.
    pub fn slopes(&self, column: usize, row: usize) -> [f64; 2] {
        let off =
            |idx: usize, count: usize| (count as f64 / 2.0 - idx as f64 - 0.5) / self.focal_px;
        [off(column, self.width), off(row, self.height)]
    }

    /// Projects a point to the image: column from the left, row from the top. Returns `None` if it
    /// is behind the eye.
    pub fn pixel(&self, point: &Point3<f64>) -> Option<[f64; 2]> {
        let scale = self.focal_px / point.x;
        let (width, height) = (self.width as f64, self.height as f64);
        (point.x > 0.0).then(|| {
            [
                width / 2.0 - point.y * scale,
                height / 2.0 - point.z * scale,
            ]
        })
    }

    fn tiles(&self) -> [usize; 2] {
        [self.width.div_ceil(TILE), self.height.div_ceil(TILE)]
    }
}

/// Shapes prepared for rays from one eye point.
pub struct RayScene<'a> {
    lens: Lens,
    /// How far the rays of each column go left, and of each row up, per unit forwards.
    slopes: [Vec<f64>; 2],
    solids: Vec<ViewedShape<'a>>,
    /// For each tile, row by row: the shapes that may be visible in it, nearest first.
    tiles: Vec<Vec<usize>>,
}

/// A hit of a ray: the shape, and the distance along the ray in lengths of its direction, whose
/// forward part is 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance along the ray, in lengths of its direction.
    pub along: f64,
    solid: usize,
}

impl<'a> RayScene<'a> {
    /// Prepares shapes, with their poses, for the rays of a lens at a pose. Frame: world.
    pub fn new(
        lens: Lens,
        eye: &Isometry3<f64>,
        shapes: impl Iterator<Item = (Isometry3<f64>, &'a dyn Shape)>,
    ) -> Self {
        let solids: Vec<ViewedShape<'_>> = shapes
            .map(|(pose, shape)| ViewedShape::new(eye, &pose, shape))
            .collect();
        let [columns, rows] = lens.tiles();
        let mut order: Vec<usize> = (0..solids.len()).collect();
        order.sort_by(|a, b| {
            solids[*a]
                .nearest
                .total_cmp(&solids[*b].nearest)
                .then(a.cmp(b))
        });
        let mut tiles = vec![Vec::new(); columns * rows];
        for idx in order {
            let Some(silhouette) = Silhouette::of(&solids[idx].corners, &lens) else {
                continue;
            };
            let [left, right, top, bottom] = silhouette.within(lens.width, lens.height);
            for row in top / TILE..=bottom / TILE {
                for column in left / TILE..=right / TILE {
                    if silhouette.meets([column * TILE, row * TILE], TILE) {
                        tiles[row * columns + column].push(idx);
                    }
                }
            }
        }
        let slopes = [
            (0..lens.width)
                .map(|column| lens.slopes(column, 0)[0])
                .collect(),
            (0..lens.height).map(|row| lens.slopes(0, row)[1]).collect(),
        ];
        Self {
            lens,
            slopes,
            solids,
            tiles,
        }
    }

    /// Returns the precomputed [`Lens::slopes`].
    pub fn slopes(&self, column: usize, row: usize) -> [f64; 2] {
        [self.slopes[0][column], self.slopes[1][row]]
    }

    /// Returns the first hit of a pixel's ray within `most` of its lengths. Returns `None` if the
    /// ray hits no solid.
    pub fn first(&self, column: usize, row: usize, most: f64) -> Option<Hit> {
        let slopes = self.slopes(column, row);
        let square = 1.0 + slopes[0] * slopes[0] + slopes[1] * slopes[1];
        let [columns, _] = self.lens.tiles();
        let mut best: Option<Hit> = None;
        for idx in &self.tiles[row / TILE * columns + column / TILE] {
            let limit = best.map_or(most, |hit| hit.along);
            let solid = &self.solids[*idx];
            if solid.nearest >= limit {
                break;
            }
            if !solid.ball.may_hit(slopes, square) {
                continue;
            }
            if let Some(along) = solid.met_at(slopes, limit) {
                best = Some(Hit { along, solid: *idx });
            }
        }
        best
    }

    /// Returns the sine of the angle between a pixel's ray, with a direction of this length, and
    /// the surface at the hit.
    pub fn sine(&self, column: usize, row: usize, hit: Hit, length: f64) -> f64 {
        let solid = &self.solids[hit.solid];
        let ray = solid.direction(self.slopes(column, row));
        if let RayShape::Box { half } = solid.form {
            return (ray[side_at(&(solid.eye + ray * hit.along), &half)] / length)
                .abs()
                .min(1.0);
        }
        let normal = solid.normal(&ray, hit.along);
        (normal.dot(&ray) / (normal.norm() * length)).abs().min(1.0)
    }
}

/// A shape as seen from the eye. Frame of its vectors: the shape's own.
struct ViewedShape<'a> {
    shape: &'a dyn Shape,
    form: RayShape,
    eye: Point3<f64>,
    forwards: Vector3<f64>,
    left: Vector3<f64>,
    up: Vector3<f64>,
    /// Corners of its bounding box. Frame: camera. Each bit of a corner's index selects the side
    /// along one axis.
    corners: [Point3<f64>; 8],
    ball: Around,
    /// Lower bound of the forward distance of its points. Unit: metres.
    nearest: f64,
}

/// A bounding sphere, prepared for rays from the eye. Frame: camera.
struct Around {
    middle: Vector3<f64>,
    /// Squared length of a tangent from the eye to the sphere; negative if the eye is inside.
    off: f64,
}

impl Around {
    /// Whether a ray may hit the shape. `square` is the squared length of its direction.
    fn may_hit(&self, [left, up]: [f64; 2], square: f64) -> bool {
        let dot = self.middle.x + self.middle.y * left + self.middle.z * up;
        self.off <= 0.0 || (dot > 0.0 && dot * dot >= self.off * square)
    }
}

/// Shapes with a closed-form ray intersection. Unit: metres.
enum RayShape {
    Box {
        half: Vector3<f64>,
    },
    /// About y, as the library has it.
    Cylinder {
        radius: f64,
        half_height: f64,
    },
    Ball {
        radius: f64,
    },
    Other,
}

impl<'a> ViewedShape<'a> {
    fn new(eye: &Isometry3<f64>, pose: &Isometry3<f64>, shape: &'a dyn Shape) -> Self {
        let form = match shape.as_typed_shape() {
            TypedShape::Cuboid(cuboid) => RayShape::Box {
                half: from_vector(cuboid.half_extents),
            },
            TypedShape::Cylinder(cylinder) => RayShape::Cylinder {
                radius: f64::from(cylinder.radius),
                half_height: f64::from(cylinder.half_height),
            },
            TypedShape::Ball(ball) => RayShape::Ball {
                radius: f64::from(ball.radius),
            },
            _ => RayShape::Other,
        };
        let around = shape.compute_local_aabb();
        let (low, high) = (from_vector(around.mins), from_vector(around.maxs));
        let shape_from_eye = pose.inverse() * eye;
        let eye_from_shape = shape_from_eye.inverse();
        let corners = [0, 1, 2, 3, 4, 5, 6, 7].map(|bits| {
            let pick = |axis: usize| {
                if bits >> axis & 1 == 1 {
                    high[axis]
                } else {
                    low[axis]
                }
            };
            eye_from_shape * Point3::new(pick(0), pick(1), pick(2))
        });
        let middle = (eye_from_shape * Point3::from((low + high) / 2.0)).coords;
        let radius = (high - low).norm() / 2.0 + BALL_RIM_M;
        let nearest = corners
            .iter()
            .map(|corner| corner.x)
            .fold(f64::INFINITY, f64::min);
        Self {
            shape,
            form,
            eye: Point3::from(shape_from_eye.translation.vector),
            forwards: shape_from_eye.rotation * Vector3::x(),
            left: shape_from_eye.rotation * Vector3::y(),
            up: shape_from_eye.rotation * Vector3::z(),
            corners,
            ball: Around {
                middle,
                off: middle.norm_squared() - radius * radius,
            },
            nearest,
        }
    }

    fn direction(&self, [left, up]: [f64; 2]) -> Vector3<f64> {
        self.forwards + self.left * left + self.up * up
    }

    fn met_at(&self, slopes: [f64; 2], most: f64) -> Option<f64> {
        let ray = self.direction(slopes);
        let span = match self.form {
            RayShape::Box { half } => box_span(&self.eye, &ray, &half),
            RayShape::Cylinder {
                radius,
                half_height,
            } => cylinder_span(&self.eye, &ray, radius, half_height),
            RayShape::Ball { radius } => round_span(
                self.eye.coords.dot(&ray),
                ray.norm_squared(),
                &self.eye.coords,
                radius,
            ),
            RayShape::Other => {
                let ray = Ray::new(to_vector(&self.eye.coords), to_vector(&ray));
                let met = self.shape.cast_local_ray(&ray, to_real(most), true);
                return met.map(f64::from).filter(|along| *along < most);
            }
        };
        // If the eye is inside the shape, the hit is at the eye.
        span.filter(|(enter, leave)| enter <= leave && *leave >= 0.0)
            .map(|(enter, _)| enter.max(0.0))
            .filter(|along| *along < most)
    }

    /// Returns a vector along the surface normal at the hit, of any length.
    fn normal(&self, ray: &Vector3<f64>, along: f64) -> Vector3<f64> {
        let point = self.eye + ray * along;
        match self.form {
            RayShape::Box { half } => Vector3::ith(side_at(&point, &half), 1.0),
            RayShape::Cylinder {
                radius,
                half_height,
            } => {
                let side = (point.x * point.x + point.z * point.z).sqrt() - radius;
                if point.y.abs() - half_height > side {
                    Vector3::y()
                } else {
                    Vector3::new(point.x, 0.0, point.z)
                }
            }
            RayShape::Ball { .. } => point.coords,
            RayShape::Other => {
                let ray = Ray::new(to_vector(&self.eye.coords), to_vector(ray));
                // Cast slightly farther, so that rounding does not lose the hit.
                let met = self.shape.cast_local_ray_and_get_normal(
                    &ray,
                    to_real(along * 1.001 + 1e-4),
                    true,
                );
                met.map_or(from_vector(ray.dir), |met| from_vector(met.normal))
            }
        }
    }
}

/// Returns the axis of the side of a box about the origin that a point is nearest to.
fn side_at(point: &Point3<f64>, half: &Vector3<f64>) -> usize {
    let [x, y, z] = [0, 1, 2].map(|axis| point[axis].abs() - half[axis]);
    if z > x.max(y) { 2 } else { usize::from(y > x) }
}

/// Returns the distances at which a ray enters and leaves a box about the origin.
fn box_span(eye: &Point3<f64>, ray: &Vector3<f64>, half: &Vector3<f64>) -> Option<(f64, f64)> {
    let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
    for axis in 0..3 {
        let (first, second) = (
            (-half[axis] - eye[axis]) / ray[axis],
            (half[axis] - eye[axis]) / ray[axis],
        );
        // Parallel to a side, both are infinite, or NaN if the ray lies in it; `min` and `max` then
        // ignore the axis.
        enter = enter.max(first.min(second));
        leave = leave.min(first.max(second));
    }
    Some((enter, leave))
}

/// Returns the distances at which a ray enters and leaves a cylinder about y.
fn cylinder_span(
    eye: &Point3<f64>,
    ray: &Vector3<f64>,
    radius: f64,
    half_height: f64,
) -> Option<(f64, f64)> {
    let level = Vector3::new(eye.x, 0.0, eye.z);
    let (enter, leave) = round_span(
        eye.x * ray.x + eye.z * ray.z,
        ray.x * ray.x + ray.z * ray.z,
        &level,
        radius,
    )?;
    let (first, second) = (
        (-half_height - eye.y) / ray.y,
        (half_height - eye.y) / ray.y,
    );
    Some((enter.max(first.min(second)), leave.min(first.max(second))))
}

/// Returns the span of a ray within a radius. `dot` is eye · ray and `square` is ray · ray, over
/// the relevant components.
fn round_span(dot: f64, square: f64, eye: &Vector3<f64>, radius: f64) -> Option<(f64, f64)> {
    let off = eye.norm_squared() - radius * radius;
    if square < 1e-12 {
        return (off <= 0.0).then_some((f64::NEG_INFINITY, f64::INFINITY));
    }
    let under = dot * dot - square * off;
    (under >= 0.0).then(|| {
        let root = under.sqrt();
        ((-dot - root) / square, (-dot + root) / square)
    })
}

#[cfg(test)]
mod tests {
    use parry3d::shape::{Ball, Cone, Cuboid, Cylinder};

    use super::*;
    use crate::convert::to_pose;
    use actcheck_data::Stream;

    const LENS: Lens = Lens {
        width: 60,
        height: 44,
        focal_px: 55.0,
    };

    fn anywhere(stream: Stream, number: u64, reach: f64) -> Isometry3<f64> {
        let [x, y, z, roll, pitch, yaw] =
            [0, 1, 2, 3, 4, 5].map(|part| 2.0 * stream.unit(6 * number + part) - 1.0);
        Isometry3::new(
            Vector3::new(x, y, z) * reach,
            Vector3::new(roll, pitch, yaw) * 3.0,
        )
    }

    /// Every ray of many random scenes has the same hit as in a plain loop over the library's ray
    /// casts.
    #[test]
    fn every_pixel_equals_that_of_a_plain_loop() {
        let shapes: [Box<dyn Shape>; 4] = [
            Box::new(Cuboid::new([0.3, 0.1, 0.5].into())),
            Box::new(Cylinder::new(0.4, 0.2)),
            Box::new(Ball::new(0.25)),
            Box::new(Cone::new(0.3, 0.2)),
        ];
        let (mut n_hits, mut n_edges) = (0, 0);
        for scene in 0..12 {
            let stream = Stream::new(scene);
            let eye = anywhere(stream, 0, 0.3);
            let placed: Vec<(Isometry3<f64>, &dyn Shape)> = (1..10)
                .map(|number| {
                    (
                        anywhere(stream, number, 2.0),
                        shapes[number as usize % 4].as_ref(),
                    )
                })
                .collect();
            let solids = RayScene::new(
                LENS,
                &eye,
                placed.iter().map(|(pose, shape)| (*pose, *shape)),
            );
            for (column, row) in (0..44).flat_map(|row| (0..60).map(move |column| (column, row))) {
                let [left, up] = LENS.slopes(column, row);
                let direction = eye.rotation * Vector3::new(1.0, left, up);
                let ray = Ray::new(to_vector(&eye.translation.vector), to_vector(&direction));
                let plain = placed
                    .iter()
                    .filter_map(|(pose, shape)| shape.cast_ray(&to_pose(pose), &ray, 4.0, true));
                let plain = plain.fold(f32::INFINITY, f32::min);
                let ours = solids
                    .first(column, row, 4.0)
                    .map_or(f64::INFINITY, |hit| hit.along);
                if plain.is_finite() {
                    n_hits += 1;
                }
                // At the very edge of a shape, the library's 32-bit result and our 64-bit result
                // may differ.
                if f64::from(plain) != ours && (f64::from(plain) - ours).abs() > 2e-3 {
                    n_edges += 1;
                }
            }
        }
        assert!(n_hits > 5000, "{n_hits}");
        assert!(n_edges * 500 < n_hits, "{n_edges} of {n_hits} differ");
    }

    #[test]
    fn the_incidence_angle_is_that_of_the_hit_surface() {
        let stream = Stream::new(4);
        let shapes: [Box<dyn Shape>; 3] = [
            Box::new(Cuboid::new([0.3, 0.1, 0.5].into())),
            Box::new(Cylinder::new(0.4, 0.2)),
            Box::new(Ball::new(0.25)),
        ];
        let mut n_met = 0;
        for number in 0..60u64 {
            let shape = shapes[number as usize % 3].as_ref();
            let mut pose = anywhere(stream, number, 0.2);
            pose.translation.x += 1.5;
            let solids = RayScene::new(LENS, &Isometry3::identity(), [(pose, shape)].into_iter());
            let (column, row) = (30, 22);
            let Some(hit) = solids.first(column, row, 9.0) else {
                continue;
            };
            let [left, up] = LENS.slopes(column, row);
            let direction = Vector3::new(1.0, left, up);
            let ray = Ray::new(to_vector(&Vector3::zeros()), to_vector(&direction));
            let met = shape
                .cast_ray_and_get_normal(&to_pose(&pose), &ray, 9.0, true)
                .expect("the ray hits the shape");
            let sine = (from_vector(met.normal).dot(&direction) / direction.norm()).abs();
            assert!(
                (solids.sine(column, row, hit, direction.norm()) - sine).abs() < 2e-2,
                "{number}"
            );
            n_met += 1;
        }
        assert!(n_met > 30, "{n_met}");
    }
}
