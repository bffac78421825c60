//! The surface of a body, prepared for drawing.

use std::collections::BTreeMap;

use nalgebra::{Point3, Vector3};

use crate::render::finish::to_light;
use crate::render::tessellate::triangles;
use actcheck_data::{Colour, SeenPart};

/// Faces that meet at a smaller angle look like one round surface. Unit: cosine (40 degrees).
const ROUND_COSINE: f64 = 0.766;
/// Triangles with a smaller doubled area have no usable normal. Unit: square metres.
const LEAST_M2: f64 = 1e-14;

/// The surface of a body: its triangles with colours. Frame: the body's.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Skin {
    pub(super) points: Vec<Point3<f64>>,
    pub(super) facets: Vec<Facet>,
}

/// A triangle.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Facet {
    pub(super) corners: [u32; 3],
    /// Unit vectors, one for each corner.
    pub(super) normals: [Vector3<f32>; 3],
    /// Reflected shares of red, green and blue light; `None` if its files state no colour.
    pub(super) colour: Option<[f32; 3]>,
    /// Whether its back is inside of the body.
    pub(super) is_closed: bool,
}

impl Skin {
    /// Prepares the parts of a body.
    pub fn of(parts: &[SeenPart]) -> Self {
        let mut skin = Self::default();
        for seen in parts {
            skin.add(seen);
        }
        skin
    }

    /// A level square about the origin that faces upwards. Unit of its side: metres.
    pub fn ground(side_m: f64, colour: Colour) -> Self {
        let far = side_m / 2.0;
        let facet = |corners| Facet {
            corners,
            normals: [Vector3::z(); 3],
            colour: Some(to_light(colour)),
            is_closed: true,
        };
        Self {
            points: [[-far, -far], [far, -far], [far, far], [-far, far]]
                .map(|[x, y]| Point3::new(x, y, 0.0))
                .to_vec(),
            facets: vec![facet([0, 1, 2]), facet([0, 2, 3])],
        }
    }

    /// Number of triangles.
    pub fn n_triangles(&self) -> usize {
        self.facets.len()
    }

    fn add(&mut self, seen: &SeenPart) {
        let all = triangles(&seen.part.shape);
        let at = seen.part.pose.to_isometry();
        let points: Vec<Point3<f64>> = all.points.iter().map(|point| at * point).collect();
        let colour = seen.colour.map(to_light);
        let Ok(before) = u32::try_from(self.points.len()) else {
            return;
        };
        for (corners, normals) in shaded(&points, &all.corners) {
            self.facets.push(Facet {
                corners: corners.map(|idx| idx.saturating_add(before)),
                normals,
                colour,
                is_closed: all.is_closed,
            });
        }
        self.points.extend(points);
    }
}

/// Returns the triangles that have an area, with the normals of their corners: the mean of those
/// faces at the same place that are a round surface with it.
fn shaded(points: &[Point3<f64>], triangles: &[[u32; 3]]) -> Vec<([u32; 3], [Vector3<f32>; 3])> {
    let sized = triangles.iter().filter_map(|corners| {
        let [a, b, c] = corners.map(|idx| points[idx as usize]);
        let normal = (b - a).cross(&(c - a));
        (normal.norm_squared() > LEAST_M2 * LEAST_M2).then_some((*corners, normal))
    });
    let sized: Vec<([u32; 3], Vector3<f64>)> = sized.collect();
    let place = |idx: u32| points[idx as usize].coords.map(f64::to_bits);
    let mut around: BTreeMap<[u64; 3], Vec<usize>> = BTreeMap::new();
    for (face, (corners, _)) in sized.iter().enumerate() {
        for idx in corners {
            around.entry(place(*idx).into()).or_default().push(face);
        }
    }
    let smooth = |idx: u32, own: &Vector3<f64>| {
        let own = own.normalize();
        let faces = around.get::<[u64; 3]>(&place(idx).into());
        let sum: Vector3<f64> = faces
            .into_iter()
            .flatten()
            .map(|face| sized[*face].1)
            .filter(|normal| normal.normalize().dot(&own) > ROUND_COSINE)
            .sum();
        sum.try_normalize(0.0).unwrap_or(own).cast::<f32>()
    };
    sized
        .iter()
        .map(|(corners, normal)| (*corners, corners.map(|idx| smooth(idx, normal))))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::{Part, Pose, Shape};

    fn skin(shape: Shape) -> Skin {
        let pose = Pose::IDENTITY;
        let part = Part { pose, shape };
        Skin::of(&[SeenPart { part, colour: None }])
    }

    #[test]
    fn the_side_of_a_cylinder_is_round_and_its_ends_are_flat() {
        let cylinder = skin(Shape::Cylinder {
            radius: 0.1,
            height: 0.2,
        });
        for facet in &cylinder.facets {
            for (corner, normal) in facet.corners.iter().zip(facet.normals) {
                let point = cylinder.points[*corner as usize];
                let radial = Vector3::new(point.x, point.y, 0.0) / 0.1;
                let turned = normal.cast::<f64>().dot(&radial);
                let is_end = normal.z.abs() > 0.999;
                assert!(is_end || turned > 0.99, "{normal} at {point}");
            }
        }
    }

    #[test]
    fn triangles_without_an_area_are_left_out() {
        let mesh = actcheck_data::Mesh::new(
            vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            vec![[0, 1, 2], [0, 1, 3]],
        );
        let mesh = mesh.expect("it is a mesh");
        assert_eq!(skin(Shape::Mesh { mesh }).n_triangles(), 1);
    }
}
