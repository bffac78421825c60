//! Draws an image of bodies.

use std::sync::LazyLock;

use nalgebra::{Isometry3, Point3, Vector3};

use crate::rays::Lens;
use crate::render::buffer::{Buffer, EMPTY, ScreenCorner};
use crate::render::finish::{Finish, to_light};
use crate::render::shadow::Shadows;
use crate::render::skin::{Facet, Skin};
use actcheck_data::Colour;

/// Samples of a pixel in each direction.
const SAMPLES: usize = 2;
/// Points further from the eye receive no shadows, so that those near it are sharp. Unit: metres.
const SHADOWED_M: f64 = 3.0;
/// Every so many samples in each direction, a visible point decides on the extent of shadows.
const RECEIVER_STRIDE: usize = 4;
/// The share of ambient light that reaches a surface that faces down.
const AMBIENT_BELOW: f64 = 0.5;
/// Where nothing is: a wall far away.
const BACKGROUND: Colour = Colour([196, 204, 212]);
/// Steps of the table from light to bytes.
const STEPS: usize = 4096;

/// A body to draw.
#[derive(Debug, Clone)]
pub struct Drawn<'a> {
    /// Its surface.
    pub skin: &'a Skin,
    /// Its pose. Frame: world.
    pub pose: Isometry3<f64>,
    /// Its size as a factor of that of its surface.
    pub scale: f64,
    /// The colour of triangles that have none of their own.
    pub plain: Colour,
    /// Replaces all colours.
    pub finish: Option<Finish>,
    /// Surfaces nearer to the eye are not seen. Unit: metres.
    pub near_m: f64,
    /// Whether it throws a shadow.
    pub has_shadow: bool,
}

/// A distant light, and the light from all around.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Light {
    /// Unit vector to the distant light. Frame: world.
    pub towards: Vector3<f64>,
    /// Brightness of a white surface that faces the distant light.
    pub brightness: f64,
    /// Brightness of a white surface that faces upwards in the light from all around.
    pub ambient: f64,
}

/// A colour image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RgbImage {
    /// Unit: pixels.
    pub width: usize,
    /// Unit: pixels.
    pub height: usize,
    /// Three bytes for each pixel, row by row from the upper left: red, green and blue in sRGB.
    pub bytes: Vec<u8>,
}

impl RgbImage {
    /// Returns the image as a PNG file. Empty if it has no pixels.
    pub fn png(&self) -> Vec<u8> {
        let size = |pixels: usize| u32::try_from(pixels).unwrap_or(0);
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, size(self.width), size(self.height));
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let written = encoder
            .write_header()
            .and_then(|mut writer| writer.write_image_data(&self.bytes));
        match written {
            Ok(()) => file,
            Err(_) => Vec::new(),
        }
    }
}

/// Draws bodies as a lens at a pose sees them. Frame: world.
pub fn draw(lens: Lens, eye: &Isometry3<f64>, bodies: &[Drawn<'_>], light: &Light) -> RgbImage {
    let fine = Lens {
        width: lens.width * SAMPLES,
        height: lens.height * SAMPLES,
        focal_px: lens.focal_px * SAMPLES as f64,
    };
    let mut first = 0_usize;
    let placed = bodies.iter().map(|body| {
        let placed = Placed::new(body, eye, light, first);
        first += body.skin.facets.len();
        placed
    });
    let scene = Scene {
        lens: fine,
        placed: placed.collect(),
        light: *light,
    };
    let buffer = scene.seen();
    let shadows = scene.shadows(eye, &buffer);
    scene.shaded(lens, &buffer, &shadows)
}

/// A body in front of the eye.
struct Placed<'a> {
    body: &'a Drawn<'a>,
    /// Its points. Frame: camera.
    points: Vec<Point3<f64>>,
    /// Number of its first triangle.
    first: usize,
    /// The pose of the body in the frame of the camera.
    pose: Isometry3<f64>,
    /// Directions to the light and upwards. Frame: the body's.
    light: Vector3<f64>,
    up: Vector3<f64>,
    /// Where the eye is. Frame: the body's.
    eye: Point3<f64>,
}

impl<'a> Placed<'a> {
    fn new(body: &'a Drawn<'a>, eye: &Isometry3<f64>, light: &Light, first: usize) -> Self {
        let pose = eye.inverse() * body.pose;
        let points = body.skin.points.iter();
        Self {
            points: points.map(|point| pose * (point * body.scale)).collect(),
            first,
            light: body.pose.inverse() * light.towards,
            up: body.pose.inverse() * Vector3::z(),
            eye: pose.inverse() * Point3::origin(),
            body,
            pose,
        }
    }

    fn numbered(&self) -> impl Iterator<Item = (u32, &Facet)> {
        let numbers = self.first..;
        numbers
            .map(|number| u32::try_from(number).unwrap_or(EMPTY))
            .zip(&self.body.skin.facets)
    }
}

struct Scene<'a> {
    lens: Lens,
    placed: Vec<Placed<'a>>,
    light: Light,
}

impl Scene<'_> {
    /// The nearest triangle at each sample.
    fn seen(&self) -> Buffer {
        let mut buffer = Buffer::new(self.lens.width, self.lens.height);
        for placed in &self.placed {
            for (number, facet) in placed.numbered() {
                let corners = facet.corners.map(|idx| placed.points[idx as usize]);
                let [a, b, c] = corners;
                let is_back = || (b - a).cross(&(c - a)).dot(&a.coords) >= 0.0;
                if facet.is_closed && is_back() {
                    continue;
                }
                self.fill(&mut buffer, corners, placed.body.near_m, number);
            }
        }
        buffer
    }

    /// Fills the part of a triangle that is in front of the eye.
    fn fill(&self, buffer: &mut Buffer, corners: [Point3<f64>; 3], near_m: f64, number: u32) {
        let n_before = corners.iter().filter(|corner| corner.x > near_m).count();
        let all = |points: &[Point3<f64>]| -> Option<Vec<ScreenCorner>> {
            let corner = |point: &Point3<f64>| {
                let [x, y] = self.lens.pixel(point)?;
                Some([x, y, 1.0 / point.x])
            };
            points.iter().map(corner).collect()
        };
        let polygon = match n_before {
            0 => return,
            3 => all(&corners),
            _ => all(&clipped(&corners, near_m)),
        };
        let polygon = polygon.unwrap_or_default();
        for idx in 2..polygon.len() {
            buffer.fill([polygon[0], polygon[idx - 1], polygon[idx]], number);
        }
    }

    /// The point that a sample sees. Frame: camera.
    fn point(&self, buffer: &Buffer, sample: usize) -> Point3<f64> {
        let [left, up] = self
            .lens
            .slopes(sample % buffer.width, sample / buffer.width);
        let depth = 1.0 / f64::from(buffer.nearness[sample]);
        Point3::new(depth, depth * left, depth * up)
    }

    /// The shadows that visible points may be in.
    fn shadows(&self, eye: &Isometry3<f64>, buffer: &Buffer) -> Shadows {
        let rows = (0..buffer.height).step_by(RECEIVER_STRIDE);
        let samples = rows.flat_map(|row| {
            let columns = (0..buffer.width).step_by(RECEIVER_STRIDE);
            columns.map(move |column| row * buffer.width + column)
        });
        let points = samples
            .filter(|sample| buffer.facets[*sample] != EMPTY)
            .map(|sample| self.point(buffer, sample))
            .filter(|point| point.x < SHADOWED_M)
            .map(|point| eye * point);
        let mut shadows = Shadows::of(&self.light.towards, points);
        let drawn = self.placed.iter().filter(|placed| placed.body.has_shadow);
        for placed in drawn {
            let Drawn {
                skin, pose, scale, ..
            } = placed.body;
            let points = skin.points.iter();
            let corners: Vec<ScreenCorner> = points
                .map(|point| shadows.corner(&(pose * (point * *scale))))
                .collect();
            for facet in &skin.facets {
                shadows.add(facet.corners.map(|idx| corners[idx as usize]));
            }
        }
        shadows
    }

    fn shaded(&self, lens: Lens, buffer: &Buffer, shadows: &Shadows) -> RgbImage {
        let mut bytes = Vec::with_capacity(lens.width * lens.height * 3);
        let everywhere = self.light.ambient + self.light.brightness / 2.0;
        let background = to_light(BACKGROUND).map(|channel| f64::from(channel) * everywhere);
        for row in 0..lens.height {
            for column in 0..lens.width {
                let first = row * SAMPLES * buffer.width + column * SAMPLES;
                let samples = [0, 1, buffer.width, buffer.width + 1].map(|step| first + step);
                let mut sum = [0.0; 3];
                let mut known: Option<(u32, [f64; 3])> = None;
                for sample in samples {
                    let facet = buffer.facets[sample];
                    let light = match known {
                        Some((last, light)) if last == facet => light,
                        _ if facet == EMPTY => background,
                        _ => self.light_at(buffer, sample, shadows),
                    };
                    known = Some((facet, light));
                    sum = [0, 1, 2].map(|channel| sum[channel] + light[channel]);
                }
                bytes.extend(sum.map(|light| to_byte(light / samples.len() as f64)));
            }
        }
        RgbImage {
            width: lens.width,
            height: lens.height,
            bytes,
        }
    }

    /// The light that a sample gets from the surface that it sees.
    fn light_at(&self, buffer: &Buffer, sample: usize, shadows: &Shadows) -> [f64; 3] {
        let number = buffer.facets[sample] as usize;
        let after = self.placed.partition_point(|placed| placed.first <= number);
        let placed = &self.placed[after - 1];
        let body = placed.body;
        let facet = &body.skin.facets[number - placed.first];
        let seen = placed
            .pose
            .inverse_transform_point(&self.point(buffer, sample));
        let mut normal = normal_at(&body.skin.points, facet, &(seen / body.scale));
        if !facet.is_closed && normal.dot(&(seen - placed.eye)) > 0.0 {
            normal = -normal;
        }
        let colour = match &body.finish {
            Some(finish) => finish.at(&seen),
            None => facet.colour.unwrap_or_else(|| to_light(body.plain)),
        };
        let facing = normal.dot(&placed.light).max(0.0);
        let reached = match facing > 0.0 {
            true => facing * shadows.lit(&body.pose, &seen, &normal),
            false => 0.0,
        };
        let above = (normal.dot(&placed.up) + 1.0) / 2.0;
        let around = AMBIENT_BELOW + (1.0 - AMBIENT_BELOW) * above;
        let light = self.light.ambient * around + self.light.brightness * reached;
        colour.map(|share| f64::from(share) * light)
    }
}

/// The unit normal at a point of a triangle. Frame: the body's.
fn normal_at(points: &[Point3<f64>], facet: &Facet, at: &Point3<f64>) -> Vector3<f64> {
    let [a, b, c] = facet.corners.map(|idx| points[idx as usize]);
    let [first, second, third] = facet.normals.map(|normal| normal.cast::<f64>());
    if first == second && second == third {
        return first;
    }
    let whole = (b - a).cross(&(c - a));
    let square = whole.norm_squared();
    let share = |p: Point3<f64>, q: Point3<f64>| {
        ((q - p).cross(&(at - p)).dot(&whole) / square).clamp(0.0, 1.0)
    };
    let mean = first * share(b, c) + second * share(c, a) + third * share(a, b);
    mean.try_normalize(1e-9).unwrap_or(first)
}

/// The part of a triangle whose points are farther in front of the eye than `near_m`. Frame: camera.
fn clipped(corners: &[Point3<f64>; 3], near_m: f64) -> Vec<Point3<f64>> {
    let mut kept = Vec::with_capacity(4);
    for (from, to) in corners.iter().zip(corners.iter().cycle().skip(1)) {
        let [before, after] = [from.x - near_m, to.x - near_m];
        if before > 0.0 {
            kept.push(*from);
        }
        if (before > 0.0) != (after > 0.0) {
            kept.push(from + (to - from) * (before / (before - after)));
        }
    }
    kept
}

/// The byte of a channel in sRGB; brighter light than white is clamped.
fn to_byte(light: f64) -> u8 {
    static BYTES: LazyLock<Vec<u8>> = LazyLock::new(|| {
        let byte = |step: usize| Colour::of_linear([step as f64 / (STEPS - 1) as f64; 3]).0[0];
        (0..STEPS).map(byte).collect()
    });
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the table"
    )]
    let step = (light.clamp(0.0, 1.0) * (STEPS - 1) as f64 + 0.5) as usize;
    BYTES[step]
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::{Part, Pose, SeenPart, Shape, Texture};

    const LENS: Lens = Lens {
        width: 64,
        height: 48,
        focal_px: 60.0,
    };

    fn skin(shape: Shape) -> Skin {
        let pose = Pose::IDENTITY;
        let part = Part { pose, shape };
        Skin::of(&[SeenPart { part, colour: None }])
    }

    fn drawn(skin: &Skin, at: [f64; 3], plain: Colour) -> Drawn<'_> {
        Drawn {
            skin,
            pose: Isometry3::translation(at[0], at[1], at[2]),
            scale: 1.0,
            plain,
            finish: None,
            near_m: 0.01,
            has_shadow: true,
        }
    }

    fn light(towards: [f64; 3]) -> Light {
        Light {
            towards: Vector3::from(towards).normalize(),
            brightness: 0.8,
            ambient: 0.2,
        }
    }

    fn pixel(image: &RgbImage, column: usize, row: usize) -> [u8; 3] {
        let at = 3 * (row * image.width + column);
        [image.bytes[at], image.bytes[at + 1], image.bytes[at + 2]]
    }

    const WHITE: Colour = Colour([255; 3]);

    /// A side that faces the light has its colour times the sum of both lights.
    #[test]
    fn a_lit_side_is_as_bright_as_the_light() {
        let block = skin(Shape::Box { size: [0.5; 3] });
        let mut lamp = light([-1.0, 0.0, 0.0]);
        let image = draw(
            LENS,
            &Isometry3::identity(),
            &[drawn(&block, [1.5, 0.0, 0.0], WHITE)],
            &lamp,
        );
        // Light from around reaches an upright side to three quarters.
        let expected = Colour::of_linear([0.8 + 0.2 * 0.75; 3]).0;
        let middle = pixel(&image, 32, 24);
        assert!(
            (0..3).all(|at| middle[at].abs_diff(expected[at]) <= 1),
            "{middle:?} {expected:?}"
        );
        lamp.towards = Vector3::x();
        let dark = draw(
            LENS,
            &Isometry3::identity(),
            &[drawn(&block, [1.5, 0.0, 0.0], WHITE)],
            &lamp,
        );
        assert!(pixel(&dark, 32, 24)[0] < 110);
    }

    /// A ball between the light and the ground throws a round shadow.
    #[test]
    fn a_ball_throws_its_shadow_where_the_light_says() {
        let ball = skin(Shape::Sphere { radius: 0.1 });
        let ground = Skin::ground(40.0, WHITE);
        // The eye looks down from two metres; right of the image is negative y.
        let eye = Isometry3::new(
            Vector3::new(0.0, 0.0, 2.0),
            Vector3::y() * std::f64::consts::FRAC_PI_2,
        );
        let take = |lamp: &Light| {
            let mut floor = drawn(&ground, [0.0; 3], WHITE);
            floor.has_shadow = false;
            let bodies = [floor, drawn(&ball, [0.0, 0.0, 0.5], WHITE)];
            draw(LENS, &eye, &bodies, lamp)
        };
        // Half a metre up, at 45 degrees: the shadow is half a metre to the side.
        let image = take(&light([0.0, 1.0, 1.0]));
        let at = 32 + (0.5 / 2.0 * LENS.focal_px) as usize;
        let [shadow, bright] = [pixel(&image, at, 24), pixel(&image, 64 - at, 24)];
        assert!(shadow[0] + 60 < bright[0], "{shadow:?} {bright:?}");
        assert_eq!(image, take(&light([0.0, 1.0, 1.0])));
        let other = take(&light([0.0, -1.0, 1.0]));
        assert!(pixel(&other, 64 - at, 24)[0] + 60 < pixel(&other, at, 24)[0]);
    }

    /// Surfaces are at the pixels where the rays of the depth camera meet them.
    #[test]
    fn the_outline_of_a_box_is_that_of_its_projection() {
        let block = skin(Shape::Box { size: [0.2; 3] });
        let red = Colour([255, 0, 0]);
        let image = draw(
            LENS,
            &Isometry3::identity(),
            &[drawn(&block, [1.1, 0.0, 0.0], red)],
            &light([-1.0, 0.3, 0.5]),
        );
        let is_red = |column: usize, row: usize| {
            let [red, green, _] = pixel(&image, column, row);
            red > green.saturating_add(60)
        };
        // The near side is 1 m away and 12 pixels wide.
        let columns = (0..64).filter(|column| is_red(*column, 24)).count();
        let rows = (0..48).filter(|row| is_red(32, *row)).count();
        assert_eq!([columns, rows], [12, 12]);
    }

    #[test]
    fn a_finish_replaces_colours_and_surfaces_at_the_eye_are_cut() {
        let block = skin(Shape::Box { size: [0.5; 3] });
        let mut body = drawn(&block, [1.5, 0.0, 0.0], WHITE);
        body.finish = Some(Finish {
            texture: Texture::Plain,
            colour: Colour([0, 0, 255]),
        });
        let [red, _, blue] = pixel(
            &draw(
                LENS,
                &Isometry3::identity(),
                &[body.clone()],
                &light([-1.0, 0.0, 0.0]),
            ),
            32,
            24,
        );
        assert!(red < 5 && blue > 200, "{red} {blue}");
        body.near_m = 2.0;
        let nothing = draw(
            LENS,
            &Isometry3::identity(),
            &[body],
            &light([-1.0, 0.0, 0.0]),
        );
        assert_eq!(pixel(&nothing, 32, 24), pixel(&nothing, 1, 1));
        // A floor that goes on behind the eye.
        let ground = Skin::ground(40.0, WHITE);
        let floor = drawn(&ground, [0.0, 0.0, -1.0], WHITE);
        let image = draw(
            LENS,
            &Isometry3::identity(),
            &[floor],
            &light([0.0, 0.0, 1.0]),
        );
        assert_ne!(pixel(&image, 32, 47), pixel(&image, 32, 0));
    }
}
