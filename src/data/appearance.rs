//! The appearance of bodies: their visual shapes and colours, for pictures. The simulation reads none
//! of it.

use std::collections::BTreeMap;

use crate::{Mesh, Part, Pose, Shape};
use nalgebra::{Isometry3, Point3};

/// A colour in sRGB. Shape: red, green, blue.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Colour(pub [u8; 3]);

/// The largest value of a channel.
const FULL: f64 = 255.0;

impl Colour {
    /// Returns the colour of channels in sRGB, each from 0 to 1; others are clamped.
    pub fn of_srgb(channels: [f64; 3]) -> Self {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to the channel's range"
        )]
        let byte = |channel: f64| (channel.clamp(0.0, 1.0) * FULL).round() as u8;
        Self(channels.map(byte))
    }

    /// Returns the colour of channels that are proportional to the light, each from 0 to 1; others
    /// are clamped.
    ///
    /// Source: IEC 61966-2-1, the transfer function of sRGB.
    pub fn of_linear(channels: [f64; 3]) -> Self {
        let encoded = |light: f64| match light.clamp(0.0, 1.0) {
            dark if dark <= 0.003_130_8 => 12.92 * dark,
            light => 1.055 * libm::pow(light, 1.0 / 2.4) - 0.055,
        };
        Self::of_srgb(channels.map(encoded))
    }
}

/// A part of a body as it is seen. A mesh need not be closed.
#[derive(Debug, Clone, PartialEq)]
pub struct SeenPart {
    /// Its shape. Frame: the body's.
    pub part: Part,
    /// Its colour; `None` if its files state none.
    pub colour: Option<Colour>,
}

/// The appearance of a link of a model's file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SeenLink {
    /// Its visual shapes or, without these, its collision shapes. Frame: the link's.
    pub parts: Vec<SeenPart>,
    /// Whether they are visual shapes and show more than collision shapes do: a mesh or a colour.
    pub has_look: bool,
}

/// The appearance of the bodies of a campaign, as far as their files say so.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Appearances {
    /// By the name of the link in traces: `robot/LINK`. Frame: the link's.
    pub links: BTreeMap<String, Vec<SeenPart>>,
    /// Of objects, by the name of the model. Frame: the model's.
    pub models: BTreeMap<String, Vec<SeenPart>>,
    /// The place of the robot's camera, if it is known.
    pub camera: Option<CameraPlace>,
}

/// The place of a camera, whose x axis points forwards and whose z axis points up in the image.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraPlace {
    /// Name of its link in traces: `robot/LINK`; `None` if it is fixed in the world.
    pub link: Option<String>,
    /// Its pose. Frame: the link's, or the world.
    pub pose: Pose,
}

impl SeenLink {
    /// Moves it into the frame in which `by` is its pose.
    pub fn transform(&mut self, by: &Isometry3<f64>) {
        for seen in &mut self.parts {
            seen.part.pose = Pose::from_isometry(&(by * seen.part.pose.to_isometry()));
        }
    }

    /// Adds a link that moves with this one.
    pub fn add(&mut self, other: Self) {
        self.parts.extend(other.parts);
        self.has_look |= other.has_look;
    }
}

impl SeenPart {
    /// Whether it shows more than a collision shape does.
    pub fn has_look(&self) -> bool {
        self.colour.is_some() || matches!(self.part.shape, Shape::Mesh { .. })
    }

    /// Returns the parts of a body with at most `most` triangles in all its meshes. Meshes of one
    /// colour are joined, and each gets its share of the triangles. One of which less than a
    /// triangle remains becomes a box.
    pub fn reduced(parts: Vec<Self>, most: usize) -> Vec<Self> {
        let mut meshes: BTreeMap<Option<Colour>, Mesh> = BTreeMap::new();
        let mut reduced = Vec::new();
        for seen in parts {
            match seen.part.shape {
                Shape::Mesh { mesh } => {
                    let at = seen.part.pose.to_isometry();
                    meshes
                        .entry(seen.colour)
                        .or_default()
                        .append(&mesh, |point| (at * Point3::from(point)).coords.into());
                }
                _ => reduced.push(seen),
            }
        }
        let all: usize = meshes.values().map(|mesh| mesh.triangles.len()).sum();
        for (colour, mesh) in meshes {
            let share = match all > most {
                true => most * mesh.triangles.len() / all,
                false => mesh.triangles.len(),
            };
            reduced.extend(few_triangles(&mesh, share).map(|part| Self { part, colour }));
        }
        reduced
    }
}

/// A mesh with at most `most` triangles, or the box around it if that is too few. `None` if it has
/// no extent.
fn few_triangles(mesh: &Mesh, most: usize) -> Option<Part> {
    let few = mesh.clustered(most);
    let at_origin = |shape| Part {
        pose: Pose::IDENTITY,
        shape,
    };
    if !few.triangles.is_empty() {
        return Some(at_origin(Shape::Mesh { mesh: few }));
    }
    let whole = Shape::Mesh { mesh: mesh.clone() };
    let (low, high) = at_origin(whole).bounds();
    let size = [0, 1, 2].map(|axis| high[axis] - low[axis]);
    let [x, y, z] = [0, 1, 2].map(|axis| f64::midpoint(low[axis], high[axis]));
    let part = Part {
        pose: Pose::upright([x, y, z], 0.0),
        shape: Shape::Box { size },
    };
    size.iter().all(|extent| *extent >= 0.0).then_some(part)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_of_the_light_is_brighter_than_the_middle_of_srgb() {
        assert_eq!(Colour::of_srgb([0.0, 0.5, 1.0]), Colour([0, 128, 255]));
        assert_eq!(Colour::of_linear([0.0, 0.5, 1.0]), Colour([0, 188, 255]));
        assert_eq!(Colour::of_srgb([-1.0, 2.0, 0.2]), Colour([0, 255, 51]));
    }

    /// Two meshes of one colour and one of another.
    #[test]
    fn meshes_of_a_colour_are_joined_and_share_the_triangles() {
        let strip = |n: u32| {
            let vertices =
                (0..=n).flat_map(|x| [[f64::from(x), 0.0, 0.0], [f64::from(x), 1.0, 0.0]]);
            let triangles = (0..n).flat_map(|x| {
                [
                    [2 * x, 2 * x + 2, 2 * x + 1],
                    [2 * x + 1, 2 * x + 2, 2 * x + 3],
                ]
            });
            Mesh::new(vertices.collect(), triangles.collect()).expect("it is a mesh")
        };
        let seen = |mesh: Mesh, x: f64, colour| SeenPart {
            part: Part {
                pose: Pose::upright([x, 0.0, 0.0], 0.0),
                shape: Shape::Mesh { mesh },
            },
            colour,
        };
        let red = Some(Colour([255, 0, 0]));
        let parts = vec![
            seen(strip(100), 0.0, red),
            seen(strip(100), 200.0, red),
            seen(strip(2), 0.0, None),
        ];
        let kept = SeenPart::reduced(parts.clone(), 1000);
        let count = |parts: &[SeenPart]| -> Vec<(Option<Colour>, usize)> {
            let triangles = |seen: &SeenPart| match &seen.part.shape {
                Shape::Mesh { mesh } => mesh.triangles.len(),
                _ => 0,
            };
            parts
                .iter()
                .map(|seen| (seen.colour, triangles(seen)))
                .collect()
        };
        assert_eq!(count(&kept), [(None, 4), (red, 400)]);
        let (low, high) = kept[1].part.bounds();
        assert_eq!((low[0], high[0]), (0.0, 300.0));
        let few = SeenPart::reduced(parts, 101);
        assert!(
            few.iter()
                .map(|seen| count(std::slice::from_ref(seen))[0].1)
                .sum::<usize>()
                <= 101
        );
        // Of four triangles, a hundredth remains: a box around them.
        assert_eq!(
            few[0].part.shape,
            Shape::Box {
                size: [2.0, 1.0, 0.0]
            }
        );
    }
}
