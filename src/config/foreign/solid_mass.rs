//! Mass, centre and inertia of solids: of single shapes, of meshes as MuJoCo and as Gazebo weigh them,
//! and of several solids together.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use nalgebra::{Isometry3, Matrix3, Vector3};

use crate::foreign::hull::convex_hull;
use actcheck_data::{Amount, Matter, Mesh, Shape, Spread, TreeGeometry, TreeSolid};

/// Smallest volume with moments of inertia of its own. Unit: cubic metres.
const LEAST_VOLUME: f64 = 1e-15;

/// The mass of a body. Frame: that of the shape, or of the link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SolidMass {
    /// Unit: kilograms.
    pub(crate) kg: f64,
    /// Centre of mass. Unit: metres.
    pub(crate) com: Vector3<f64>,
    /// Inertia tensor about the centre of mass, along the axes of the frame. Unit: kg·m².
    pub(crate) about_com: Matrix3<f64>,
}

impl SolidMass {
    const NONE: Self = Self {
        kg: 0.0,
        com: Vector3::new(0.0, 0.0, 0.0),
        about_com: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    };

    /// Returns the masses of one frame as one, by the parallel axis theorem; a mass of 0 if all are 0.
    pub(crate) fn together(masses: &[Self]) -> Self {
        let kg: f64 = masses.iter().map(|mass| mass.kg).sum();
        if kg <= 0.0 {
            return Self::NONE;
        }
        let first: Vector3<f64> = masses.iter().map(|mass| mass.com * mass.kg).sum();
        let com = first / kg;
        let about = |mass: &Self| {
            let arm = mass.com - com;
            mass.about_com
                + (Matrix3::identity() * arm.norm_squared() - arm * arm.transpose()) * mass.kg
        };
        Self {
            kg,
            com,
            about_com: masses.iter().map(about).sum(),
        }
    }

    /// Returns the mass of a shape with a density of 1, in its own frame; `None` if it encloses no
    /// volume.
    pub(crate) fn of_shape(shape: &Shape) -> Option<Self> {
        let primitive = match shape {
            Shape::Box { size } => TreeGeometry::Box { size: *size },
            Shape::Sphere { radius } => TreeGeometry::Sphere { radius: *radius },
            Shape::Cylinder { radius, height } => TreeGeometry::Cylinder {
                radius: *radius,
                length: *height,
            },
            Shape::Capsule { radius, height } => TreeGeometry::Capsule {
                radius: *radius,
                length: *height,
            },
            Shape::Mesh { mesh } => return enclosed(mesh),
            Shape::Tube { .. } | Shape::Hull { .. } => return None,
        };
        Some(Self::of_primitive(&primitive))
    }

    /// Returns the mass of a primitive with a density of 1, in its own frame; a mass of 0 for a mesh.
    pub(crate) fn of_primitive(geometry: &TreeGeometry) -> Self {
        of_primitive(geometry, false)
    }

    /// Returns the mass of a cone with a density of 1, its tip above and the middle of its height at
    /// the origin. Unit: metres.
    pub(crate) fn of_cone(radius: f64, length: f64) -> Self {
        let kg = PI * radius * radius * length / 3.0;
        let across = 3.0 / 20.0 * radius * radius + 3.0 / 80.0 * length * length;
        let about_z = 3.0 / 10.0 * radius * radius;
        Self {
            kg,
            com: Vector3::new(0.0, 0.0, -length / 4.0),
            about_com: Matrix3::from_diagonal(&Vector3::new(across, across, about_z)) * kg,
        }
    }

    /// Returns the mass in another frame, in which its own is at `by`.
    pub(crate) fn moved(self, by: &Isometry3<f64>) -> Self {
        let turned = by.rotation.to_rotation_matrix();
        Self {
            kg: self.kg,
            com: (by * nalgebra::Point3::from(self.com)).coords,
            about_com: turned.matrix() * self.about_com * turned.matrix().transpose(),
        }
    }

    pub(crate) fn times(self, factor: f64) -> Self {
        Self {
            kg: self.kg * factor,
            com: self.com,
            about_com: self.about_com * factor,
        }
    }
}

/// The masses of mesh files at a density of 1, each of which is computed once: a hull takes long,
/// and many shapes may have the same mesh.
#[derive(Default)]
pub(crate) struct MeshMasses {
    /// By file, the bits of the scale, and the spread.
    known: BTreeMap<(String, [u64; 3], Spread), SolidMass>,
}

impl MeshMasses {
    /// Returns the mass of all shapes that have one, in the frame of their link; a mass of 0 if none
    /// has. `meshes` are the shapes of mesh files, in the files' own scales.
    pub(crate) fn together<'a>(
        &mut self,
        solids: impl IntoIterator<Item = &'a TreeSolid>,
        meshes: &BTreeMap<String, Vec<Shape>>,
    ) -> SolidMass {
        let masses = solids
            .into_iter()
            .filter_map(|solid| Some(self.of(solid, meshes)?.moved(&solid.pose)));
        SolidMass::together(&masses.collect::<Vec<_>>())
    }

    /// Returns the mass of a shape in its own frame; `None` if it has none.
    fn of(
        &mut self,
        solid: &TreeSolid,
        meshes: &BTreeMap<String, Vec<Shape>>,
    ) -> Option<SolidMass> {
        let Matter { amount, spread } = solid.matter?;
        let unit = self.of_unit(&solid.geometry, spread, meshes)?;
        let factor = match amount {
            Amount::Mass(kg) => kg / unit.kg,
            Amount::Density(density) => density,
        };
        (factor.is_finite() && factor > 0.0).then(|| unit.times(factor))
    }

    /// Returns the mass of a shape with a density of 1, or of its surface with 1 kg/m².
    pub(crate) fn of_unit(
        &mut self,
        geometry: &TreeGeometry,
        spread: Spread,
        meshes: &BTreeMap<String, Vec<Shape>>,
    ) -> Option<SolidMass> {
        let TreeGeometry::Mesh { file, scale } = geometry else {
            return Some(of_primitive(geometry, spread == Spread::Shell));
        };
        let key = (file.clone(), scale.map(f64::to_bits), spread);
        if let Some(known) = self.known.get(&key) {
            return Some(*known);
        }
        let parts = meshes.get(file)?.iter().filter_map(|shape| match shape {
            Shape::Mesh { mesh } => Some(of_mesh(&mesh.scaled(*scale), spread)),
            _ => None,
        });
        let mass = SolidMass::together(&parts.collect::<Vec<_>>());
        self.known.insert(key, mass);
        Some(mass)
    }
}

fn of_primitive(geometry: &TreeGeometry, is_shell: bool) -> SolidMass {
    let centred = |kg: f64, moments: [f64; 3]| SolidMass {
        kg,
        com: Vector3::zeros(),
        about_com: Matrix3::from_diagonal(&Vector3::from(moments)),
    };
    match geometry {
        TreeGeometry::Mesh { .. } => SolidMass::NONE,
        TreeGeometry::Box { size } if is_shell => hollow_box(*size),
        TreeGeometry::Box { size: [x, y, z] } => {
            let (kg, [xx, yy, zz]) = (x * y * z, [x * x, y * y, z * z]);
            centred(kg, [yy + zz, xx + zz, xx + yy].map(|sum| kg * sum / 12.0))
        }
        TreeGeometry::Ellipsoid { radii: [x, y, z] } => {
            let (kg, [xx, yy, zz]) = (4.0 / 3.0 * PI * x * y * z, [x * x, y * y, z * z]);
            centred(kg, [yy + zz, xx + zz, xx + yy].map(|sum| kg * sum / 5.0))
        }
        TreeGeometry::Sphere { radius: r } if is_shell => {
            let kg = 4.0 * PI * r * r;
            centred(kg, [2.0 / 3.0 * kg * r * r; 3])
        }
        TreeGeometry::Sphere { radius: r } => {
            let kg = 4.0 / 3.0 * PI * r.powi(3);
            centred(kg, [0.4 * kg * r * r; 3])
        }
        TreeGeometry::Cylinder { radius: r, length } if is_shell => {
            let (side, ends) = (2.0 * PI * r * length, 2.0 * PI * r * r);
            let about_z = side * r * r + ends * r * r / 2.0;
            let across = side * (r * r / 2.0 + length * length / 12.0)
                + ends * (r * r / 4.0 + length * length / 4.0);
            centred(side + ends, [across, across, about_z])
        }
        TreeGeometry::Cylinder { radius: r, length } => {
            let kg = PI * r * r * length;
            let across = kg * (3.0 * r * r + length * length) / 12.0;
            centred(kg, [across, across, kg * r * r / 2.0])
        }
        TreeGeometry::Capsule { radius, length } => capsule(*radius, *length, is_shell),
    }
}

/// A cylinder between two halves of a ball; a shell has no lids between them.
fn capsule(r: f64, length: f64, is_shell: bool) -> SolidMass {
    // Mass, moment about z, and moment across it about the own centre of the cylinder.
    let (tube, tube_z, tube_across) = if is_shell {
        let kg = 2.0 * PI * r * length;
        (kg, kg * r * r, kg * (r * r / 2.0 + length * length / 12.0))
    } else {
        let kg = PI * r * r * length;
        let across = kg * (3.0 * r * r + length * length) / 12.0;
        (kg, kg * r * r / 2.0, across)
    };
    // Both halves together: their distance from the ball's middle to their centre of mass, and the
    // moment of the whole ball about its middle.
    let (balls, centre, ball) = if is_shell {
        let kg = 4.0 * PI * r * r;
        (kg, r / 2.0, 2.0 / 3.0 * kg * r * r)
    } else {
        let kg = 4.0 / 3.0 * PI * r.powi(3);
        (kg, 3.0 / 8.0 * r, 0.4 * kg * r * r)
    };
    let half = length / 2.0;
    // Each half is moved away by half of the length along z.
    let balls_across = ball + balls * (half * half + 2.0 * half * centre);
    let across = tube_across + balls_across;
    SolidMass {
        kg: tube + balls,
        com: Vector3::zeros(),
        about_com: Matrix3::from_diagonal(&Vector3::new(across, across, tube_z + ball)),
    }
}

/// The six faces of a box.
fn hollow_box(size: [f64; 3]) -> SolidMass {
    let mut faces = Vec::new();
    for axis in 0..3 {
        let [a, b] = [size[(axis + 1) % 3], size[(axis + 2) % 3]];
        let kg = a * b;
        let mut moments = Vector3::zeros();
        moments[axis] = kg * (a * a + b * b) / 12.0;
        moments[(axis + 1) % 3] = kg * b * b / 12.0;
        moments[(axis + 2) % 3] = kg * a * a / 12.0;
        for side in [-0.5, 0.5] {
            let mut com = Vector3::zeros();
            com[axis] = side * size[axis];
            faces.push(SolidMass {
                kg,
                com,
                about_com: Matrix3::from_diagonal(&moments),
            });
        }
    }
    SolidMass::together(&faces)
}

/// The sums over the pyramids from a point to the triangles of a mesh, or over the triangles
/// themselves.
struct Sums {
    /// Volume or area.
    amount: f64,
    /// The integral of the coordinates, from the point.
    first: Vector3<f64>,
    /// The integral of the products of coordinates, from the point.
    second: Matrix3<f64>,
}

impl Sums {
    /// Unless it is exact, a pyramid counts positive however its triangle is turned, so that a mesh
    /// with some turned triangles has a mass too.
    fn from(point: Vector3<f64>, mesh: &Mesh, spread: Spread) -> Self {
        let mut sums = Self {
            amount: 0.0,
            first: Vector3::zeros(),
            second: Matrix3::zeros(),
        };
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|corner| {
                let vertex = mesh.vertices.get(corner as usize).copied();
                Vector3::from(vertex.unwrap_or([0.0; 3])) - point
            });
            let sum = a + b + c;
            let squares = a * a.transpose() + b * b.transpose() + c * c.transpose();
            // A pyramid has four corners, one of them at the point; a triangle has three.
            let volume = a.dot(&b.cross(&c)) / 6.0;
            let (own, corners) = match spread {
                Spread::Shell => ((b - a).cross(&(c - a)).norm() / 2.0, 3.0),
                Spread::Exact => (volume, 4.0),
                Spread::Inside | Spread::Hull => (volume.abs(), 4.0),
            };
            sums.amount += own;
            sums.first += sum * (own / corners);
            let share = own / (corners * (corners + 1.0));
            sums.second += (squares + sum * sum.transpose()) * share;
        }
        sums
    }
}

/// A mesh by MuJoCo's usual rule: the centre of mass follows from the pyramids to the middle of its
/// surface, and volume and moments from those to the centre of mass. For a closed mesh, both are
/// exact.
fn of_mesh(mesh: &Mesh, spread: Spread) -> SolidMass {
    if spread == Spread::Hull {
        let triangles = convex_hull(&mesh.vertices);
        let hull = Mesh::new(mesh.vertices.clone(), triangles);
        return hull.map_or(SolidMass::NONE, |hull| of_mesh(&hull, Spread::Inside));
    }
    let surface = Sums::from(Vector3::zeros(), mesh, Spread::Shell);
    if surface.amount <= 0.0 {
        return SolidMass::NONE;
    }
    let middle = surface.first / surface.amount;
    let com = if spread == Spread::Shell {
        middle
    } else {
        let solid = Sums::from(middle, mesh, spread);
        if solid.amount <= 0.0 {
            return SolidMass::NONE;
        }
        middle + solid.first / solid.amount
    };
    let sums = Sums::from(com, mesh, spread);
    SolidMass {
        kg: sums.amount,
        com,
        about_com: Matrix3::identity() * sums.second.trace() - sums.second,
    }
}

/// The mass of the solid that a mesh encloses, with a density of 1: Gazebo's rule. A mesh that is
/// inside out encloses the same solid. Returns `None` if it encloses none.
fn enclosed(mesh: &Mesh) -> Option<SolidMass> {
    let corner = Vector3::from(*mesh.vertices.first()?);
    let sums = Sums::from(corner, mesh, Spread::Exact);
    let kg = sums.amount.abs();
    if kg < LEAST_VOLUME {
        return None;
    }
    let com = sums.first / sums.amount;
    let second = sums.second * sums.amount.signum() - com * com.transpose() * kg;
    Some(SolidMass {
        kg,
        com: corner + com,
        about_com: Matrix3::identity() * second.trace() - second,
    })
}

/// Half extents of the box with the same inertia as a mesh, and the frame of its principal axes,
/// from the shortest extent along x to the longest along z. MuJoCo fits its primitives so.
pub(crate) fn equivalent_box(mesh: &Mesh) -> Option<(Isometry3<f64>, [f64; 3])> {
    let mass = of_mesh(mesh, Spread::Inside);
    if mass.kg <= 0.0 {
        return None;
    }
    let eigen = mass.about_com.symmetric_eigen();
    // The largest moment belongs to the shortest extent.
    let mut order = [0, 1, 2];
    order.sort_by(|one, other| eigen.eigenvalues[*other].total_cmp(&eigen.eigenvalues[*one]));
    let [x, y] = [order[0], order[1]].map(|idx| eigen.eigenvectors.column(idx).into_owned());
    let axes = Matrix3::from_columns(&[x, y, x.cross(&y)]);
    let rotation = nalgebra::UnitQuaternion::from_rotation_matrix(
        &nalgebra::Rotation3::from_matrix_unchecked(axes),
    );
    let moments = order.map(|idx| eigen.eigenvalues[idx]);
    let sum: f64 = moments.iter().sum();
    let half = moments.map(|own| (6.0 * (sum - 2.0 * own) / mass.kg).max(0.0).sqrt() / 2.0);
    Some((Isometry3::from_parts(mass.com.into(), rotation), half))
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_base::SourceSpan;

    fn solid(geometry: TreeGeometry, matter: Matter) -> TreeSolid {
        TreeSolid {
            pose: Isometry3::identity(),
            geometry,
            matter: Some(matter),
            friction: None,
            colour: None,
            place: SourceSpan::default(),
        }
    }

    fn kilograms(kg: f64) -> Matter {
        Matter {
            amount: Amount::Mass(kg),
            spread: Spread::Inside,
        }
    }

    /// A box as a mesh, around a point.
    fn box_mesh(half: [f64; 3], at: [f64; 3]) -> Mesh {
        let corner = |idx: u32| {
            [0, 1, 2].map(|axis| {
                let sign = if idx >> axis & 1 == 1 { 1.0 } else { -1.0 };
                at[axis] + sign * half[axis]
            })
        };
        let triangles = vec![
            [0, 2, 1],
            [1, 2, 3],
            [4, 5, 6],
            [5, 7, 6],
            [0, 1, 4],
            [1, 5, 4],
            [2, 6, 3],
            [3, 6, 7],
            [0, 4, 2],
            [2, 4, 6],
            [1, 3, 5],
            [3, 7, 5],
        ];
        Mesh::new((0..8).map(corner).collect(), triangles).expect("it is a mesh")
    }

    /// A mesh of a box has the mass, centre and moments of the box, and so has its shell.
    #[test]
    fn a_mesh_weighs_as_its_primitive() {
        let mesh = Shape::Mesh {
            mesh: box_mesh([0.1, 0.2, 0.3], [1.0, -2.0, 0.5]),
        };
        let meshes = BTreeMap::from([("box".to_owned(), vec![mesh])]);
        let as_mesh = TreeGeometry::Mesh {
            file: "box".to_owned(),
            scale: [1.0; 3],
        };
        let as_box = TreeGeometry::Box {
            size: [0.2, 0.4, 0.6],
        };
        let mut masses = MeshMasses::default();
        for (amount, spread) in [
            (Amount::Density(700.0), Spread::Inside),
            (Amount::Mass(3.0), Spread::Inside),
            (Amount::Density(2.0), Spread::Shell),
            (Amount::Mass(5.0), Spread::Shell),
            (Amount::Density(2.0), Spread::Exact),
            (Amount::Density(2.0), Spread::Hull),
        ] {
            let matter = Matter { amount, spread };
            let [one, other] = [&as_mesh, &as_box]
                .map(|geometry| masses.together([&solid(geometry.clone(), matter)], &meshes));
            assert!(
                (one.kg - other.kg).abs() < 1e-9,
                "{matter:?}: {one:?} {other:?}"
            );
            assert!(
                (one.about_com - other.about_com).abs().max() < 1e-9,
                "{matter:?}"
            );
            assert!((one.com - Vector3::new(1.0, -2.0, 0.5)).norm() < 1e-9);
        }
        let two = [
            solid(as_box.clone(), kilograms(1.0)),
            solid(as_box, kilograms(2.0)),
        ];
        assert!((masses.together(&two, &meshes).kg - 3.0).abs() < 1e-12);
    }

    /// Masses and centres of an L-shaped prism, whole and without its last two sides, as MuJoCo 3.3.1
    /// has them.
    #[test]
    fn a_mesh_weighs_by_its_inertia_as_in_mujoco() {
        let corners = [
            [0.0, 0.0],
            [2.0, 0.0],
            [2.0, 1.0],
            [1.0, 1.0],
            [1.0, 2.0],
            [0.0, 2.0],
        ];
        let level = |z: f64| corners.map(|[x, y]| [x, y, z]);
        let vertices = [level(0.0), level(1.0)].concat();
        let lids = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]];
        let mut triangles: Vec<[u32; 3]> = lids.map(|[a, b, c]| [a, c, b]).into();
        triangles.extend(lids.map(|lid| lid.map(|corner| corner + 6)));
        for a in 0..6 {
            let b = (a + 1) % 6;
            triangles.extend([[a, b, b + 6], [a, b + 6, a + 6]]);
        }
        let open = triangles[..16].to_vec();
        for (triangles, spread, kg, x) in [
            (&triangles, Spread::Inside, 300.0, 0.83333),
            (&triangles, Spread::Exact, 300.0, 0.83333),
            (&triangles, Spread::Hull, 350.0, 0.90476),
            (&triangles, Spread::Shell, 1400.0, 0.85714),
            (&open, Spread::Inside, 187.211_40, 1.08874),
            (&open, Spread::Exact, 180.840_66, 1.08999),
            (&open, Spread::Hull, 350.0, 0.90476),
            (&open, Spread::Shell, 1100.0, 1.04545),
        ] {
            let mesh = Mesh::new(vertices.clone(), triangles.clone()).expect("it is a mesh");
            let mass = of_mesh(&mesh, spread).times(100.0);
            assert!((mass.kg - kg).abs() < 1e-4, "{spread:?}: {mass:?}");
            assert!((mass.com.x - x).abs() < 1e-5, "{spread:?}: {mass:?}");
        }
    }

    /// The long box lies along the x axis of its mesh, and along z of the fitted box.
    #[test]
    fn the_equivalent_box_of_a_box_is_the_box() {
        let (pose, half) =
            equivalent_box(&box_mesh([0.3, 0.1, 0.2], [1.0, 0.0, 0.0])).expect("it has a volume");
        for (found, expected) in half.iter().zip([0.1, 0.2, 0.3]) {
            assert!((found - expected).abs() < 1e-9, "{half:?}");
        }
        assert!((pose.rotation * Vector3::z()).x.abs() > 0.999_999);
        assert!((pose.translation.vector - Vector3::x()).norm() < 1e-9);
    }

    fn near(found: f64, expected: f64) {
        assert!(
            (found - expected).abs() < 1e-12 * expected.abs().max(1e-3),
            "{found} is not {expected}"
        );
    }

    #[test]
    fn a_mesh_has_the_moments_of_the_solid_that_it_encloses() {
        let size = [0.05, 0.07, 0.1];
        let solid = SolidMass::of_shape(&Shape::Box { size }).expect("it has a volume");
        let half = size.map(|side| side / 2.0);
        let mut mesh = box_mesh(half, half);
        for _ in 0..2 {
            let found =
                SolidMass::of_shape(&Shape::Mesh { mesh: mesh.clone() }).expect("it is closed");
            near(found.kg, solid.kg);
            for (axis, side) in size.into_iter().enumerate() {
                near(found.com[axis], side / 2.0);
                near(found.about_com[(axis, axis)], solid.about_com[(axis, axis)]);
            }
            near(found.about_com[(0, 1)], 0.0);
            // Inside out it is the same solid.
            mesh.triangles
                .iter_mut()
                .for_each(|corners| corners.swap(1, 2));
        }
    }

    #[test]
    fn a_capsule_is_a_cylinder_with_two_hemispheres() {
        let ball = SolidMass::of_shape(&Shape::Sphere { radius: 0.3 }).expect("it has a volume");
        let short = SolidMass::of_shape(&Shape::Capsule {
            radius: 0.3,
            height: 0.0,
        })
        .expect("it has a volume");
        let axes = [0, 1, 2].map(|axis| (axis, axis));
        for at in axes {
            near(short.about_com[at], ball.about_com[at]);
        }
        // The formula of libsdformat's authors.
        let (radius, length) = (0.2, 0.5);
        let capsule = SolidMass::of_shape(&Shape::Capsule {
            radius,
            height: length,
        })
        .expect("it has a volume");
        let (r2, l2) = (radius * radius, length * length);
        let cylinder = std::f64::consts::PI * r2 * length;
        let sphere = std::f64::consts::PI * r2 * radius * 4.0 / 3.0;
        let across = cylinder * (l2 + 3.0 * r2) / 12.0
            + sphere * (2.0 * r2 / 5.0 + l2 / 4.0 + 3.0 / 8.0 * length * radius);
        near(capsule.about_com[(0, 0)], across);
    }

    #[test]
    fn two_halves_are_the_whole() {
        let half = SolidMass::of_shape(&Shape::Box {
            size: [0.1, 0.2, 0.3],
        })
        .expect("it has a volume");
        let at = |x: f64| {
            half.times(500.0)
                .moved(&Isometry3::translation(x, 0.0, 0.0))
        };
        let found = SolidMass::together(&[at(0.0), at(0.1)]);
        let whole = SolidMass::of_shape(&Shape::Box {
            size: [0.2, 0.2, 0.3],
        })
        .expect("it has a volume")
        .times(500.0)
        .moved(&Isometry3::translation(0.05, 0.0, 0.0));
        near(found.kg, whole.kg);
        near(found.com.x, 0.05);
        for axis in 0..3 {
            near(found.about_com[(axis, axis)], whole.about_com[(axis, axis)]);
        }
    }
}
