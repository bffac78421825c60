//! Draws the appearance of bodies: the nearest surface at each pixel, shaded, with dark edges.

use nalgebra::{Isometry3, Point3, Vector3};
use tiny_skia::{Pixmap, PremultipliedColorU8};

use crate::picture::drawing::DENSITY;
use crate::picture::outline::{corners, corners_around};
use crate::picture::window::Window;
use actcheck_data::{Colour, SeenPart, Shape, convex_hull};

/// Samples of a pixel of the file in each direction.
const SAMPLES: usize = 2;
/// A surface that is further behind its neighbour has an edge. Unit: metres.
const EDGE_M: f64 = 0.02;
/// Brightness of an edge and of a surface that no light reaches, and the share that light adds.
const EDGE: f64 = 0.5;
const SHADE: f64 = 0.5;
const LIGHT: f64 = 0.55;
/// Direction to the light: right, up, towards the viewer.
const LIGHT_AT: [f64; 3] = [-0.35, 0.55, 0.76];

/// The surfaces that are visible in a window.
pub(super) struct Facets {
    window: Window,
    /// Whether the horizontal axis points left.
    is_mirrored: bool,
    width: usize,
    height: usize,
    /// The colour of each sample, and how near it is. Unit: metres.
    samples: Vec<Option<(f64, [u8; 3])>>,
    is_empty: bool,
}

/// Samples in a pixel of the drawing.
fn per_pixel() -> f64 {
    DENSITY * SAMPLES as f64
}

impl Facets {
    pub(super) fn new(window: &Window, is_mirrored: bool) -> Self {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few thousand samples"
        )]
        let samples = |pixels: f64| (pixels * DENSITY).ceil().max(1.0) as usize * SAMPLES;
        let (width, height) = (samples(window.panel.width), samples(window.panel.height));
        Self {
            window: *window,
            is_mirrored,
            width,
            height,
            samples: vec![None; width * height],
            is_empty: true,
        }
    }

    /// Adds a body at a pose. Parts without a colour get the plain one.
    pub(super) fn add(&mut self, parts: &[SeenPart], pose: &Isometry3<f64>, plain: u32) {
        for seen in parts {
            let [_, red, green, blue] = plain.to_be_bytes();
            let colour = seen.colour.unwrap_or(Colour([red, green, blue]));
            let placed = pose * seen.part.pose.to_isometry();
            for triangle in self.surface(&seen.part.shape, &placed) {
                self.fill(triangle, colour);
            }
        }
    }

    /// The triangles of a shape: samples to the right and down, and metres towards the viewer.
    fn surface(&self, shape: &Shape, placed: &Isometry3<f64>) -> Vec<[Point3<f64>; 3]> {
        let seen = |point: &Point3<f64>| self.seen(&(placed * point));
        let stitched = |points: &[Point3<f64>], triangles: &[[usize; 3]]| {
            let points: Vec<Point3<f64>> = points.iter().map(seen).collect();
            let of = |corners: &[usize; 3]| corners.map(|idx| points[idx]);
            triangles.iter().map(of).collect()
        };
        match shape {
            Shape::Mesh { mesh } => {
                let points = mesh
                    .vertices
                    .iter()
                    .map(|vertex| seen(&Point3::from(*vertex)));
                let points: Vec<Point3<f64>> = points.collect();
                let of = |corners: &[u32; 3]| corners.map(|idx| points[idx as usize]);
                mesh.triangles.iter().map(of).collect()
            }
            Shape::Box { .. } => stitched(&corners(shape), &BOX),
            Shape::Hull { points, .. } => {
                let points = points.iter().map(|point| seen(&Point3::from(*point)));
                flat(&points.collect::<Vec<_>>())
            }
            _ => {
                let points = corners(shape);
                let around = corners_around();
                stitched(&points, &between_rings(points.len() / around, around))
            }
        }
    }

    /// Projects a point of the world.
    fn seen(&self, point: &Point3<f64>) -> Point3<f64> {
        let [x, y] = self.window.pixel(point.coords.into());
        let panel = &self.window.panel;
        let right = match self.is_mirrored {
            true => panel.right() - x,
            false => x - panel.left,
        };
        let view = self.window.view;
        let depth = point[3 - view.across - view.up];
        // Of x to the right and z up, the third axis points away from the viewer.
        let points_away = ((view.across, view.up) == (0, 2)) != self.is_mirrored;
        let towards = if points_away { -depth } else { depth };
        Point3::new(right * per_pixel(), (y - panel.top) * per_pixel(), towards)
    }

    /// Fills the samples of a triangle at which it is the nearest surface.
    fn fill(&mut self, triangle: [Point3<f64>; 3], colour: Colour) {
        let [a, b, c] = triangle;
        let across = |p: &Point3<f64>, q: &Point3<f64>, x: f64, y: f64| {
            (q.x - p.x) * (y - p.y) - (q.y - p.y) * (x - p.x)
        };
        let area = across(&a, &b, c.x, c.y);
        if !area.is_finite() || area.abs() < 1e-9 {
            return;
        }
        let shaded = shaded(colour, &triangle, self.window.scale * per_pixel());
        let range = |axis: usize, most: usize| {
            let along = triangle.map(|corner| corner[axis]);
            let low = along.into_iter().fold(f64::INFINITY, f64::min);
            let high = along.into_iter().fold(f64::NEG_INFINITY, f64::max);
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "within the samples"
            )]
            let within = |at: f64| at.clamp(0.0, most as f64) as usize;
            within(low.floor())..within(high.ceil() + 1.0)
        };
        for row in range(1, self.height) {
            for column in range(0, self.width) {
                let (x, y) = (column as f64 + 0.5, row as f64 + 0.5);
                let shares = [
                    across(&b, &c, x, y) / area,
                    across(&c, &a, x, y) / area,
                    across(&a, &b, x, y) / area,
                ];
                if shares.iter().any(|share| *share < 0.0) {
                    continue;
                }
                let near = shares[0] * a.z + shares[1] * b.z + shares[2] * c.z;
                let sample = &mut self.samples[row * self.width + column];
                if sample.is_none_or(|(nearest, _)| nearest < near) {
                    *sample = Some((near, shaded));
                    self.is_empty = false;
                }
            }
        }
    }

    /// Returns the picture, with [`DENSITY`] pixels for each of the drawing; `None` if nothing is
    /// visible.
    pub(super) fn picture(&self) -> Option<Pixmap> {
        if self.is_empty {
            return None;
        }
        let (width, height) = (self.width / SAMPLES, self.height / SAMPLES);
        let mut pixels = Pixmap::new(u32::try_from(width).ok()?, u32::try_from(height).ok()?)?;
        for (idx, pixel) in pixels.pixels_mut().iter_mut().enumerate() {
            let (left, top) = (idx % width * SAMPLES, idx / width * SAMPLES);
            let mut sums = [0_u32; 4];
            for (row, column) in (0..SAMPLES).flat_map(|row| (0..SAMPLES).map(move |of| (row, of)))
            {
                let Some([red, green, blue]) = self.colour(left + column, top + row) else {
                    continue;
                };
                for (sum, channel) in sums.iter_mut().zip([red, green, blue, u8::MAX]) {
                    *sum += u32::from(channel);
                }
            }
            #[expect(clippy::cast_possible_truncation, reason = "a mean of bytes")]
            let [red, green, blue, opaque] =
                sums.map(|sum| (sum / (SAMPLES * SAMPLES) as u32) as u8);
            if let Some(mean) = PremultipliedColorU8::from_rgba(red, green, blue, opaque) {
                *pixel = mean;
            }
        }
        Some(pixels)
    }

    /// The colour of a sample, which is dark at an edge.
    fn colour(&self, x: usize, y: usize) -> Option<[u8; 3]> {
        let (near, colour) = self.samples[y * self.width + x]?;
        let is_behind = |x: usize, y: usize| match self.samples[y * self.width + x] {
            Some((other, _)) => other < near - EDGE_M,
            None => true,
        };
        let is_edge = (x > 0 && is_behind(x - 1, y))
            || (y > 0 && is_behind(x, y - 1))
            || (x + 1 < self.width && is_behind(x + 1, y))
            || (y + 1 < self.height && is_behind(x, y + 1));
        Some(if is_edge {
            dimmed(colour, EDGE)
        } else {
            colour
        })
    }
}

/// Corners of the triangles of a box, in the order of its corners.
const BOX: [[usize; 3]; 12] = [
    [0, 1, 3],
    [0, 3, 2],
    [4, 6, 7],
    [4, 7, 5],
    [0, 4, 5],
    [0, 5, 1],
    [2, 3, 7],
    [2, 7, 6],
    [0, 2, 6],
    [0, 6, 4],
    [1, 5, 7],
    [1, 7, 3],
];

/// The triangles between rings of points, and those that close the first and the last.
fn between_rings(rings: usize, around: usize) -> Vec<[usize; 3]> {
    let mut triangles = Vec::new();
    for ring in 1..rings {
        let [low, high] = [(ring - 1) * around, ring * around];
        for step in 0..around {
            let next = (step + 1) % around;
            triangles.push([low + step, low + next, high + step]);
            triangles.push([high + step, low + next, high + next]);
        }
    }
    for first in [0, rings.saturating_sub(1) * around] {
        triangles.extend((2..around).map(|step| [first, first + step - 1, first + step]));
    }
    triangles
}

/// The outline of a convex shape, as if it were flat.
fn flat(points: &[Point3<f64>]) -> Vec<[Point3<f64>; 3]> {
    let depth = points.iter().map(|point| point.z).sum::<f64>() / points.len().max(1) as f64;
    let outline = convex_hull(points.iter().map(|point| [point.x, point.y]));
    let corner = |at: [f64; 2]| Point3::new(at[0], at[1], depth);
    let Some((first, rest)) = outline.split_first() else {
        return Vec::new();
    };
    rest.windows(2)
        .map(|pair| [corner(*first), corner(pair[0]), corner(pair[1])])
        .collect()
}

/// The colour of a triangle in the light, from whichever side it is seen.
fn shaded(colour: Colour, triangle: &[Point3<f64>; 3], samples_per_m: f64) -> [u8; 3] {
    let [a, b, c] = triangle.map(|corner| {
        Vector3::new(
            corner.x / samples_per_m,
            -corner.y / samples_per_m,
            corner.z,
        )
    });
    let normal = (b - a).cross(&(c - a));
    let normal = if normal.z < 0.0 { -normal } else { normal };
    let light = Vector3::from(LIGHT_AT).dot(&normal.try_normalize(0.0).unwrap_or_default());
    dimmed(colour.0, (SHADE + LIGHT * light.max(0.0)).min(1.0))
}

fn dimmed(channels: [u8; 3], by: f64) -> [u8; 3] {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a part of a byte"
    )]
    channels.map(|channel| (f64::from(channel) * by) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::drawing::Rect;
    use crate::picture::window::{Bounds, View};
    use actcheck_data::{Part, Pose};

    const RED: Colour = Colour([255, 0, 0]);
    const GREEN: Colour = Colour([0, 255, 0]);

    fn facets(view: View, is_mirrored: bool) -> Facets {
        let panel = Rect {
            left: 10.0,
            top: 20.0,
            width: 100.0,
            height: 100.0,
        };
        let bounds = Bounds {
            low: [-0.5; 3],
            high: [0.5; 3],
        };
        Facets::new(&Window::new(view, bounds, 100.0, panel), is_mirrored)
    }

    fn cube(at: [f64; 3], size: f64, colour: Option<Colour>) -> SeenPart {
        SeenPart {
            part: Part {
                pose: Pose::upright(at, 0.0),
                shape: Shape::Box { size: [size; 3] },
            },
            colour,
        }
    }

    /// Which channel is the largest one at a place in shares of the panel; `None` if it is empty.
    fn at(facets: &Facets, x: f64, y: f64) -> Option<usize> {
        let picture = facets.picture()?;
        let place = |share: f64, most: u32| (share * f64::from(most)) as u32;
        let pixel = picture.pixel(place(x, picture.width()), place(y, picture.height()))?;
        let channels = [pixel.red(), pixel.green(), pixel.blue()];
        (pixel.alpha() > 0).then(|| (0..3).max_by_key(|idx| channels[*idx]).unwrap_or(0))
    }

    /// The nearest of two surfaces is seen, from each side.
    #[test]
    fn the_nearest_surface_is_seen() {
        let stacked = [
            cube([0.0; 3], 0.2, Some(RED)),
            cube([0.0, 0.0, 0.2], 0.1, Some(GREEN)),
            cube([0.3, 0.3, 0.0], 0.1, Some(GREEN)),
        ];
        let mut above = facets(View::TOP, false);
        above.add(&stacked, &Isometry3::identity(), 0);
        assert_eq!(at(&above, 0.5, 0.5), Some(1));
        assert_eq!(at(&above, 0.58, 0.5), Some(0));
        assert_eq!(at(&above, 0.8, 0.2), Some(1));
        assert_eq!(at(&above, 0.8, 0.8), None);
        // Seen along y from smaller y, x to the right.
        let mut side = facets(View { across: 0, up: 2 }, false);
        side.add(
            &[
                cube([0.1, 0.3, 0.0], 0.2, Some(RED)),
                cube([0.1, -0.3, 0.0], 0.1, Some(GREEN)),
            ],
            &Isometry3::identity(),
            0,
        );
        assert_eq!(at(&side, 0.6, 0.5), Some(1));
        assert_eq!(at(&side, 0.68, 0.5), Some(0));
        // Seen along x from greater x, y to the right; mirrored from smaller x.
        let ahead = [
            cube([0.3, 0.1, 0.0], 0.2, Some(RED)),
            cube([-0.3, 0.1, 0.0], 0.1, Some(GREEN)),
        ];
        let view = View { across: 1, up: 2 };
        let mut front = facets(view, false);
        front.add(&ahead, &Isometry3::identity(), 0);
        assert_eq!(at(&front, 0.6, 0.5), Some(0));
        let mut behind = facets(view, true);
        behind.add(&ahead, &Isometry3::identity(), 0);
        assert_eq!(at(&behind, 0.4, 0.5), Some(1));
        assert_eq!(at(&behind, 0.6, 0.5), None);
    }

    #[test]
    fn every_shape_covers_its_outline_and_parts_without_a_colour_are_plain() {
        let shapes = [
            Shape::Box { size: [0.2; 3] },
            Shape::Sphere { radius: 0.1 },
            Shape::Cylinder {
                radius: 0.1,
                height: 0.2,
            },
            Shape::Capsule {
                radius: 0.1,
                height: 0.1,
            },
            Shape::Tube {
                radius_low: 0.1,
                radius_high: 0.1,
                wall: 0.01,
                height: 0.2,
                staves: 12,
            },
            Shape::Hull {
                points: vec![
                    [-0.1, -0.1, 0.0],
                    [0.1, -0.1, 0.0],
                    [0.1, 0.1, 0.1],
                    [-0.1, 0.1, 0.0],
                ],
                volume: 1e-3,
            },
        ];
        for shape in shapes {
            let part = Part {
                pose: Pose::IDENTITY,
                shape,
            };
            let mut facets = facets(View::TOP, false);
            let seen = SeenPart { part, colour: None };
            facets.add(
                std::slice::from_ref(&seen),
                &Isometry3::identity(),
                0x00_ff00,
            );
            for (x, y) in [(0.5, 0.5), (0.43, 0.5), (0.5, 0.57)] {
                assert_eq!(at(&facets, x, y), Some(1), "{seen:?}");
            }
            assert_eq!(at(&facets, 0.3, 0.5), None, "{seen:?}");
        }
    }
}
