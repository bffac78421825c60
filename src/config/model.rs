//! Models of objects and furniture.

use actcheck_base::{Diagnostic, Diagnostics, Source, digest_of, names};
use actcheck_data::{ObjectModel, Part, Pose, Shape, Surface, bounds};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::Table;

/// Tolerance between the parts' bounding box and `size_m`: the staves of a tube lie a few
/// millimetres inside it.
const SIZE_TOLERANCE_M: f64 = 0.006;

/// Reads one model. Its name is the file's name without its extension.
///
/// # Errors
/// All faults of the text: those of the table reader (`C…`), an unknown shape (W001), parts that do
/// not match `size_m` (W002), and a category that is not an IRI (W003).
pub fn read(source: &Source) -> Result<ObjectModel, Diagnostics> {
    let mut table = Table::parse(source)?;
    let mut found = Diagnostics::new();
    table.require(&["category", "mass_kg", "friction", "size_m", "parts"]);
    let category = table.string("category").and_then(|written| {
        let iri = full_iri(&written.value);
        if iri.is_none() {
            let message = format!("the category `{}` is not an IRI", written.value);
            table.fault(
                "W003",
                written.span,
                message,
                "write it like `category = \"act:Glass\"`",
            );
        }
        iri
    });
    let mass_kg = table.number("mass_kg", MASS);
    let friction = table.number("friction", 0.0..=2.0);
    let restitution = table.number("restitution", 0.0..=1.0).unwrap_or(0.0);
    let size_m = table.numbers("size_m", LENGTH);
    let parts: Vec<Part> = table
        .tables("parts")
        .into_iter()
        .filter_map(|part| read_part(part, &mut found))
        .collect();
    let surface = table
        .table("surface")
        .and_then(|surface| read_surface(surface, &mut found));
    table.finish(&mut found);
    let (Some(category), Some(mass_kg), Some(friction), Some(size_m)) =
        (category, mass_kg, friction, size_m)
    else {
        return Err(found);
    };
    let digest = digest_of(&source.text);
    let model = ObjectModel {
        name: stem(&source.name),
        category,
        mass_kg,
        friction,
        restitution,
        origin_m: [0.0; 3],
        size_m,
        parts,
        fixed: false,
        inertia: None,
        surface,
        moving: Vec::new(),
        digest,
    };
    if !found.has_errors() {
        found.extend(check_size(&model, source));
    }
    found.or(model)
}

/// Bounds of a mass: the physics engine can't calculate with much larger numbers. Unit: kilograms.
const MASS: (std::ops::Bound<f64>, std::ops::Bound<f64>) = (
    std::ops::Bound::Excluded(0.0),
    std::ops::Bound::Included(1e6),
);
/// Bounds of a length of an object: a larger one is most likely in millimetres. Unit: metres.
const LENGTH: (std::ops::Bound<f64>, std::ops::Bound<f64>) = (
    std::ops::Bound::Excluded(0.0),
    std::ops::Bound::Included(1e3),
);

/// Expands a known prefix, as in `act:Glass`; returns a full IRI unchanged, and `None` if the
/// prefix is unknown.
pub(crate) fn full_iri(text: &str) -> Option<String> {
    let full = if text.contains("://") {
        text.to_owned()
    } else {
        let (prefix, local) = text.split_once(':')?;
        let (_, namespace) = names::PREFIXES.iter().find(|(known, _)| *known == prefix)?;
        format!("{namespace}{local}")
    };
    names::is_iri(&full).then_some(full)
}

fn stem(path: &str) -> String {
    let file = path.rsplit(['/', '\\', ':']).next().unwrap_or(path);
    file.strip_suffix(".toml").unwrap_or(file).to_owned()
}

fn read_part(mut table: Table, found: &mut Diagnostics) -> Option<Part> {
    table.require(&["shape", "at_m"]);
    let at = table.numbers::<3>("at_m", ..);
    let turned = table.numbers::<3>("turned_rad", ..).unwrap_or([0.0; 3]);
    let shape = read_shape(&mut table);
    table.finish(found);
    let rotation = UnitQuaternion::from_euler_angles(turned[0], turned[1], turned[2]);
    let pose = Isometry3::from_parts(Translation3::from(Vector3::from(at?)), rotation);
    Some(Part {
        pose: Pose::from_isometry(&pose),
        shape: shape?,
    })
}

fn read_shape(table: &mut Table) -> Option<Shape> {
    let kind = table.string("shape")?;
    match kind.value.as_str() {
        "box" => {
            table.require(&["size_m"]);
            Some(Shape::Box {
                size: table.numbers("size_m", LENGTH)?,
            })
        }
        "cylinder" => {
            table.require(&["radius_m", "height_m"]);
            let (radius, height) = (
                table.number("radius_m", LENGTH),
                table.number("height_m", LENGTH),
            );
            Some(Shape::Cylinder {
                radius: radius?,
                height: height?,
            })
        }
        "sphere" => {
            table.require(&["radius_m"]);
            Some(Shape::Sphere {
                radius: table.number("radius_m", LENGTH)?,
            })
        }
        "capsule" => {
            table.require(&["radius_m", "height_m"]);
            let (radius, height) = (
                table.number("radius_m", LENGTH),
                table.number("height_m", LENGTH),
            );
            Some(Shape::Capsule {
                radius: radius?,
                height: height?,
            })
        }
        "tube" => read_tube(table),
        other => {
            let message = format!("unknown shape `{other}`");
            let help = actcheck_base::did_you_mean(
                other,
                ["box", "capsule", "cylinder", "sphere", "tube"],
            );
            table.fault("W001", kind.span, message, help);
            table.ignore(&[
                "size_m",
                "radius_m",
                "height_m",
                "radius_low_m",
                "radius_high_m",
                "wall_m",
                "staves",
            ]);
            None
        }
    }
}

fn read_tube(table: &mut Table) -> Option<Shape> {
    table.require(&[
        "radius_low_m",
        "radius_high_m",
        "wall_m",
        "height_m",
        "staves",
    ]);
    let (radius_low, radius_high) = (
        table.number("radius_low_m", LENGTH),
        table.number("radius_high_m", LENGTH),
    );
    let (wall, height) = (
        table.number("wall_m", LENGTH),
        table.number("height_m", LENGTH),
    );
    let staves = table
        .integer("staves", 3..=64)
        .and_then(|count| u32::try_from(count).ok());
    Some(Shape::Tube {
        radius_low: radius_low?,
        radius_high: radius_high?,
        wall: wall?,
        height: height?,
        staves: staves?,
    })
}

fn read_surface(mut table: Table, found: &mut Diagnostics) -> Option<Surface> {
    table.require(&["height_m", "size_m"]);
    let (height_m, size_m) = (
        table.number("height_m", LENGTH),
        table.numbers("size_m", LENGTH),
    );
    table.finish(found);
    Some(Surface {
        height_m: height_m?,
        size_m: size_m?,
    })
}

/// Checks that the bounding box of all parts has the size `size_m`, rests on the ground and is
/// centred on the origin.
fn check_size(model: &ObjectModel, source: &Source) -> Diagnostics {
    let (low, high) = bounds(&model.parts);
    let [x, y, z] = model.size_m;
    let expected = (
        Vector3::new(-x / 2.0, -y / 2.0, 0.0),
        Vector3::new(x / 2.0, y / 2.0, z),
    );
    let miss = (low - expected.0).amax().max((high - expected.1).amax());
    if miss <= SIZE_TOLERANCE_M {
        return Diagnostics::new();
    }
    let message = format!(
        "the bounding box of the parts, from {} to {}, does not match `size_m`",
        triple(&low),
        triple(&high)
    );
    Diagnostic::error("W002", message)
        .in_source(source)
        .help("`size_m` is the outer size; the origin must be on the ground below the middle")
        .into()
}

fn triple(v: &Vector3<f64>) -> String {
    format!("[{:.3}, {:.3}, {:.3}]", v.x, v.y, v.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    const GLASS: &str = "category = \"act:Glass\"\nmass_kg = 0.3\nfriction = 0.4\nsize_m = [0.08, 0.08, 0.1]\n\
        [[parts]]\nshape = \"tube\"\nat_m = [0, 0, 0.05]\nradius_low_m = 0.04\nradius_high_m = 0.04\n\
        wall_m = 0.004\nheight_m = 0.1\nstaves = 12\n";

    fn codes(text: &str) -> Vec<String> {
        match read(&Source::new("models/objects/glass.toml", text)) {
            Ok(_) => Vec::new(),
            Err(found) => found.iter().map(|d| d.code.to_owned()).collect(),
        }
    }

    #[test]
    fn a_tube_is_decomposed_into_staves_inside_its_radius() {
        let model =
            read(&Source::new("models/objects/glass.toml", GLASS)).expect("the model is valid");
        assert_eq!(
            (model.name.as_str(), model.category.as_str()),
            ("glass", "http://actions#Glass")
        );
        let solids = model.solids();
        assert_eq!(solids.len(), 12);
        for solid in &solids {
            let Shape::Box { size } = solid.shape else {
                panic!("staves are boxes")
            };
            let corner =
                solid.pose.to_isometry() * nalgebra::Point3::new(size[0] / 2.0, size[1] / 2.0, 0.0);
            assert!(corner.x.hypot(corner.y) <= 0.04 + 1e-9, "{corner}");
        }
        // Volume of a thin ring: circumference times wall times height, minus the chords.
        assert!(
            (model.volume() / (std::f64::consts::TAU * 0.038 * 0.004 * 0.1) - 1.0).abs() < 0.06
        );
    }

    #[test]
    fn wrong_models_are_refused_with_their_codes() {
        assert_eq!(codes(GLASS), Vec::<String>::new());
        assert_eq!(codes(&GLASS.replace("tube", "tubes")), ["W001"]);
        assert_eq!(
            codes(&GLASS.replace("[0.08, 0.08, 0.1]", "[0.08, 0.08, 0.2]")),
            ["W002"]
        );
        assert_eq!(codes(&GLASS.replace("act:Glass", "Glass")), ["W003"]);
        assert_eq!(
            codes(&GLASS.replace("mass_kg = 0.3", "mass_kg = 0")),
            ["C006"]
        );
    }
}
