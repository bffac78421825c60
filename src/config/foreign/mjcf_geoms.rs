//! Geoms of bodies in MJCF: those that collide, with their shapes and masses.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::foreign::mjcf::{DENSITY, Robot};
use crate::foreign::mjcf_compiler::Attributes;
use crate::foreign::mjcf_materials::collides;
use crate::foreign::urdf_text::escaped;
use crate::foreign::xml::{self, Bound, Node, Reader};

impl Robot {
    /// Returns the colliding geoms of a body, each with its mass if its volume is known.
    pub(super) fn solids(
        &self,
        body: Node,
        own: &Isometry3<f64>,
        class: Option<&str>,
        reader: &mut Reader,
    ) -> Vec<(Isometry3<f64>, String, Option<f64>)> {
        xml::children(body, "geom")
            .filter_map(|geom| self.solid(geom, own, class, reader))
            .collect()
    }

    /// Returns a geom if it collides, with its mass if its volume is known.
    pub(super) fn solid(
        &self,
        geom: Node,
        own: &Isometry3<f64>,
        class: Option<&str>,
        reader: &mut Reader,
    ) -> Option<(Isometry3<f64>, String, Option<f64>)> {
        let attributes = self.compiler.attributes(geom, class);
        if !collides(&attributes) {
            return None;
        }
        let pose = own * self.compiler.pose(&attributes, geom, reader);
        let (moved, shape, volume) = self.shape(geom, &attributes, reader)?;
        let density = attributes
            .get("density")
            .and_then(|text| text.parse().ok())
            .unwrap_or(DENSITY);
        let stated = attributes.get("mass").and_then(|text| text.parse().ok());
        // An end-to-end geom has its pose from its ends.
        let pose = moved.map_or(pose, |moved| own * moved);
        Some((
            pose,
            shape,
            stated.or(volume.map(|volume| volume * density)),
        ))
    }

    /// The pose of a geom that is given by its ends, its element of a `<geometry>`, and its volume
    /// if it is known.
    fn shape(
        &self,
        geom: Node,
        attributes: &Attributes<'_>,
        reader: &mut Reader,
    ) -> Option<(Option<Isometry3<f64>>, String, Option<f64>)> {
        use std::f64::consts::PI;
        let kind = attributes
            .get("type")
            .unwrap_or(if attributes.get("mesh").is_some() {
                "mesh"
            } else {
                "sphere"
            });
        if kind == "mesh" {
            let name = attributes.get("mesh").unwrap_or_default();
            let Some((file, scale)) = self.compiler.meshes.get(name) else {
                let message = format!("there is no mesh `{name}` in `<asset>`");
                reader.error(
                    "W035",
                    geom,
                    message,
                    "add `<mesh name=\"…\" file=\"…\"/>` to `<asset>`",
                );
                return None;
            };
            let file = escaped(file);
            return Some((
                None,
                format!("<mesh filename=\"{file}\" scale=\"{scale}\"/>"),
                None,
            ));
        }
        if !["sphere", "box", "cylinder", "capsule", "ellipsoid"].contains(&kind) {
            // A plane or a height field does not belong to a robot or an object.
            return None;
        }
        let size: Vec<f64> = attributes
            .get("size")
            .unwrap_or_default()
            .split_whitespace()
            .filter_map(|word| word.parse().ok())
            .collect();
        let ends = match attributes.get("fromto") {
            Some(text) => Some(reader.numbers::<6>(geom, text, Bound::Finite)?),
            None => None,
        };
        let (moved, half_length) = match ends {
            Some([ax, ay, az, bx, by, bz]) => {
                let (a, b) = (Point3::new(ax, ay, az), Point3::new(bx, by, bz));
                let turned = UnitQuaternion::rotation_between(&Vector3::z(), &(b - a))
                    .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI));
                let middle = nalgebra::center(&a, &b);
                (
                    Some(Isometry3::from_parts(
                        Translation3::from(middle.coords),
                        turned,
                    )),
                    Some((b - a).norm() / 2.0),
                )
            }
            None => (None, size.get(1).copied()),
        };
        let wanted = match (kind, ends) {
            ("sphere", _) | ("cylinder" | "capsule", Some(_)) => 1,
            ("cylinder" | "capsule", None) => 2,
            _ => 3,
        };
        if size.len() < wanted
            || size
                .iter()
                .any(|number| !(number.is_finite() && *number >= 0.0))
        {
            let message =
                format!("a geom of the type {kind} needs {wanted} positive numbers in `size`");
            reader.error(
                "W034",
                geom,
                message,
                "sizes are radii and half lengths in metres",
            );
            return None;
        }
        let (r, half) = (size[0], half_length.unwrap_or(0.0));
        let (shape, volume) = match kind {
            "sphere" => (
                format!("<sphere radius=\"{r}\"/>"),
                4.0 / 3.0 * PI * r.powi(3),
            ),
            "cylinder" => (
                format!("<cylinder radius=\"{r}\" length=\"{}\"/>", 2.0 * half),
                2.0 * PI * r * r * half,
            ),
            "capsule" => (
                format!("<capsule radius=\"{r}\" length=\"{}\"/>", 2.0 * half),
                2.0 * PI * r * r * half + 4.0 / 3.0 * PI * r.powi(3),
            ),
            "ellipsoid" if self.materials.is_some() => {
                let [x, y, z] = [size[0], size[1], size[2]];
                (
                    format!("<ellipsoid radii=\"{x} {y} {z}\"/>"),
                    4.0 / 3.0 * PI * x * y * z,
                )
            }
            _ => {
                let [x, y, z] = [size[0], size[1], size[2]].map(|extent| 2.0 * extent);
                (format!("<box size=\"{x} {y} {z}\"/>"), x * y * z)
            }
        };
        Some((moved, shape, Some(volume)))
    }
}
