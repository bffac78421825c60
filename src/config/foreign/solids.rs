//! Volume, centre and moments of inertia of solids.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

use actcheck_data::{Mesh, Shape};

/// Smallest volume with moments of inertia of its own. Unit: cubic metres.
const LEAST_VOLUME: f64 = 1e-15;

/// A solid of the density 1 kg/m³.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SolidMass {
    /// Unit: cubic metres.
    pub(crate) volume: f64,
    /// Its centre of mass.
    pub(crate) centre: Vector3<f64>,
    /// Inertia tensor about the centre of mass.
    pub(crate) about_centre: Matrix3<f64>,
}

impl SolidMass {
    /// Returns that of a shape in its own frame; `None` if it encloses no volume.
    pub(crate) fn of(shape: &Shape) -> Option<Self> {
        let volume = shape.volume();
        let moments = match shape {
            Shape::Box { size } => of_squares(size.map(|side| side * side / 12.0)),
            Shape::Sphere { radius } => of_squares([radius * radius / 5.0; 3]),
            Shape::Cylinder { radius, height } => of_squares([
                radius * radius / 4.0,
                radius * radius / 4.0,
                height * height / 12.0,
            ]),
            Shape::Capsule { radius, height } => of_squares(capsule(*radius, *height)),
            Shape::Mesh { mesh } => return Self::of_mesh(mesh),
            Shape::Tube { .. } | Shape::Hull { .. } => return None,
        };
        Some(Self {
            volume,
            centre: Vector3::zeros(),
            about_centre: moments * volume,
        })
    }

    /// An ellipsoid with its centre at the origin. Unit: metres.
    pub(crate) fn of_ellipsoid(radii: [f64; 3]) -> Self {
        let volume = 4.0 / 3.0 * std::f64::consts::PI * radii.iter().product::<f64>();
        Self {
            volume,
            centre: Vector3::zeros(),
            about_centre: of_squares(radii.map(|radius| radius * radius / 5.0)) * volume,
        }
    }

    /// A cone with its tip above and the middle of its height at the origin. Unit: metres.
    pub(crate) fn of_cone(radius: f64, length: f64) -> Self {
        let volume = std::f64::consts::PI * radius * radius * length / 3.0;
        let across = 3.0 / 20.0 * radius * radius;
        Self {
            volume,
            centre: Vector3::new(0.0, 0.0, -length / 4.0),
            about_centre: of_squares([across, across, 3.0 / 80.0 * length * length]) * volume,
        }
    }

    /// Integrates over the tetrahedra between the triangles and a corner of the mesh.
    fn of_mesh(mesh: &Mesh) -> Option<Self> {
        let origin = Vector3::from(*mesh.vertices.first()?);
        let (mut volume, mut first, mut second) = (0.0, Vector3::zeros(), Matrix3::zeros());
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|idx| Vector3::from(mesh.vertices[idx as usize]) - origin);
            let sixfold = a.dot(&b.cross(&c));
            let sum = a + b + c;
            volume += sixfold / 6.0;
            first += sum * (sixfold / 24.0);
            let squares = [sum, a, b, c].map(|at| at * at.transpose());
            second += squares.iter().sum::<Matrix3<f64>>() * (sixfold / 120.0);
        }
        if volume.abs() < LEAST_VOLUME {
            return None;
        }
        // The triangles of a mesh that is inside out enclose a negative volume.
        let (centre, sign) = (first / volume, volume.signum());
        let squares = second * sign - centre * centre.transpose() * volume.abs();
        Some(Self {
            volume: volume.abs(),
            centre: centre + origin,
            about_centre: Matrix3::identity() * squares.trace() - squares,
        })
    }

    /// Returns the solid at a pose, with another density. Unit: kg/m³.
    pub(crate) fn placed(&self, at: &Isometry3<f64>, density: f64) -> Self {
        let turn = at.rotation.to_rotation_matrix();
        Self {
            volume: self.volume * density,
            centre: (at * Point3::from(self.centre)).coords,
            about_centre: turn.matrix() * self.about_centre * turn.matrix().transpose() * density,
        }
    }

    /// Combines solids about their common centre, by the parallel axis theorem; `None` without
    /// solids.
    pub(crate) fn together(solids: &[Self]) -> Option<Self> {
        let total: f64 = solids.iter().map(|solid| solid.volume).sum();
        if solids.is_empty() || total <= 0.0 {
            return None;
        }
        let first: Vector3<f64> = solids.iter().map(|solid| solid.centre * solid.volume).sum();
        let centre = first / total;
        let about = |solid: &Self| {
            let arm = solid.centre - centre;
            let apart = Matrix3::identity() * arm.norm_squared() - arm * arm.transpose();
            solid.about_centre + apart * solid.volume
        };
        Some(Self {
            volume: total,
            centre,
            about_centre: solids.iter().map(about).sum(),
        })
    }
}

/// The inertia tensor per mass of a solid with these mean squares of x, y and z.
fn of_squares([x, y, z]: [f64; 3]) -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::new(y + z, x + z, x + y))
}

/// The mean squares of x, y and z in a capsule about z.
fn capsule(radius: f64, height: f64) -> [f64; 3] {
    let (ball, middle) = (4.0 / 3.0 * radius, height);
    let whole = ball + middle;
    let across = (ball * radius * radius / 5.0 + middle * radius * radius / 4.0) / whole;
    // Of a hemisphere: its centre is 3/8 of the radius from its flat side, where the cylinder ends.
    let end = height / 2.0;
    let cap = end * end + 2.0 * end * 3.0 / 8.0 * radius + radius * radius / 5.0;
    let along = (ball * cap + middle * height * height / 12.0) / whole;
    [across, across, along]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(found: f64, expected: f64) {
        assert!(
            (found - expected).abs() < 1e-12 * expected.abs().max(1e-3),
            "{found} is not {expected}"
        );
    }

    /// A box with corners at the origin and at `size`, as a mesh.
    fn block([x, y, z]: [f64; 3]) -> Mesh {
        let vertices = (0..8)
            .map(|idx| [0, 1, 2].map(|axis| f64::from((idx >> axis) & 1)))
            .map(|corner| [corner[0] * x, corner[1] * y, corner[2] * z])
            .collect();
        let quads: [[u32; 4]; 6] = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let triangles = quads
            .iter()
            .flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]])
            .collect();
        Mesh::new(vertices, triangles).expect("it is a mesh")
    }

    #[test]
    fn a_mesh_has_the_moments_of_the_solid_that_it_encloses() {
        let size = [0.05, 0.07, 0.1];
        let solid = SolidMass::of(&Shape::Box { size }).expect("it has a volume");
        let mut mesh = block(size);
        for _ in 0..2 {
            let found = SolidMass::of(&Shape::Mesh { mesh: mesh.clone() }).expect("it is closed");
            near(found.volume, solid.volume);
            for (axis, side) in size.into_iter().enumerate() {
                near(found.centre[axis], side / 2.0);
                near(
                    found.about_centre[(axis, axis)],
                    solid.about_centre[(axis, axis)],
                );
            }
            near(found.about_centre[(0, 1)], 0.0);
            // Inside out it is the same solid.
            mesh.triangles
                .iter_mut()
                .for_each(|corners| corners.swap(1, 2));
        }
    }

    #[test]
    fn a_capsule_is_a_cylinder_with_two_hemispheres() {
        let ball = SolidMass::of(&Shape::Sphere { radius: 0.3 }).expect("it has a volume");
        let short = SolidMass::of(&Shape::Capsule {
            radius: 0.3,
            height: 0.0,
        })
        .expect("it has a volume");
        let axes = [0, 1, 2].map(|axis| (axis, axis));
        for at in axes {
            near(short.about_centre[at], ball.about_centre[at]);
        }
        // The formula of libsdformat's authors.
        let (radius, length) = (0.2, 0.5);
        let capsule = SolidMass::of(&Shape::Capsule {
            radius,
            height: length,
        })
        .expect("it has a volume");
        let (r2, l2) = (radius * radius, length * length);
        let cylinder = std::f64::consts::PI * r2 * length;
        let sphere = std::f64::consts::PI * r2 * radius * 4.0 / 3.0;
        let across = cylinder * (l2 + 3.0 * r2) / 12.0
            + sphere * (2.0 * r2 / 5.0 + l2 / 4.0 + 3.0 / 8.0 * length * radius);
        near(capsule.about_centre[(0, 0)], across);
    }

    #[test]
    fn two_halves_are_the_whole() {
        let half = SolidMass::of(&Shape::Box {
            size: [0.1, 0.2, 0.3],
        })
        .expect("it has a volume");
        let at = |x: f64| half.placed(&Isometry3::translation(x, 0.0, 0.0), 500.0);
        let found = SolidMass::together(&[at(0.0), at(0.1)]).expect("they have a volume");
        let whole = SolidMass::of(&Shape::Box {
            size: [0.2, 0.2, 0.3],
        })
        .expect("it has a volume")
        .placed(&Isometry3::translation(0.05, 0.0, 0.0), 500.0);
        near(found.volume, whole.volume);
        near(found.centre.x, 0.05);
        for axis in 0..3 {
            near(
                found.about_centre[(axis, axis)],
                whole.about_centre[(axis, axis)],
            );
        }
    }
}
