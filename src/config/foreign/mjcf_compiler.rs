//! Settings of a whole MJCF file: included files, default classes, units, and meshes.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{
    Isometry3, Matrix3, Quaternion, Rotation3, Translation3, Unit, UnitQuaternion, Vector3,
};

use crate::foreign::xml::{self, Bound, Node, Reader};
use actcheck_base::{Diagnostic, Diagnostics, Files, Source, did_you_mean};

/// Deepest inclusion of files: deeper ones include themselves.
const DEEPEST: usize = 8;
/// Types of geoms.
const GEOMS: [&str; 9] = [
    "plane",
    "hfield",
    "sphere",
    "capsule",
    "ellipsoid",
    "cylinder",
    "box",
    "mesh",
    "sdf",
];
/// The class of elements without one.
const MAIN: &str = "main";

type Values = BTreeMap<String, String>;

/// Settings, default classes and meshes of a file.
pub(super) struct Compiler {
    /// Radians per unit of angle.
    pub(super) angle: f64,
    euler: String,
    /// Default attributes by class and element.
    defaults: BTreeMap<String, BTreeMap<String, Values>>,
    /// File and scale by the mesh's name.
    pub(super) meshes: BTreeMap<String, (String, String)>,
}

/// The attributes of an element, with the defaults of its class.
pub(super) struct Attributes<'a> {
    node: Node<'a>,
    defaults: Option<&'a Values>,
}

impl<'a> Attributes<'a> {
    /// Returns an attribute.
    pub(super) fn get(&self, name: &str) -> Option<&'a str> {
        self.node
            .attribute(name)
            .or_else(|| self.defaults?.get(name).map(String::as_str))
            .map(str::trim)
    }
}

impl Compiler {
    pub(super) fn read(root: Node, reader: &mut Reader) -> Self {
        let mut compiler = Self {
            angle: 1f64.to_radians(),
            euler: "xyz".to_owned(),
            defaults: BTreeMap::new(),
            meshes: BTreeMap::new(),
        };
        if root.tag_name().name() != "mujoco" {
            let message = format!(
                "the root is `<{}>` instead of `<mujoco>`",
                root.tag_name().name()
            );
            reader.error(
                "W032",
                root,
                message,
                "an MJCF file begins with `<mujoco model=\"…\">`",
            );
        }
        let mut folder = String::new();
        for settings in xml::children(root, "compiler") {
            if settings.attribute("angle") == Some("radian") {
                compiler.angle = 1.0;
            }
            if let Some(sequence) = settings.attribute("eulerseq") {
                sequence.clone_into(&mut compiler.euler);
            }
            if let Some(written) = settings
                .attribute("meshdir")
                .or(settings.attribute("assetdir"))
            {
                folder = format!("{}/", written.trim_end_matches('/'));
            }
        }
        for defaults in xml::children(root, "default") {
            let class = defaults.attribute("class").unwrap_or(MAIN);
            compiler.add_class(defaults, class, &BTreeMap::new());
        }
        for mesh in xml::children(root, "asset")
            .flat_map(|assets| xml::children(assets, "mesh").collect::<Vec<_>>())
        {
            let attributes = compiler.attributes(mesh, None);
            let Some(file) = attributes.get("file") else {
                continue;
            };
            let stem = Path::new(file)
                .file_stem()
                .map(|stem| stem.to_string_lossy().into_owned());
            let name = mesh
                .attribute("name")
                .map(str::to_owned)
                .or(stem)
                .unwrap_or_default();
            let scale = attributes.get("scale").unwrap_or("1 1 1").to_owned();
            let file = format!("{folder}{file}");
            compiler.meshes.insert(name, (file, scale));
        }
        compiler.check_names(root, reader);
        compiler
    }

    /// Reports classes without defaults, and types of geoms that don't exist: with other defaults
    /// or another shape than meant, verdicts would be wrong.
    fn check_names(&self, root: Node, reader: &mut Reader) {
        let in_defaults = |node: Node| node.ancestors().any(|above| above.has_tag_name("default"));
        for node in root.descendants().filter(Node::is_element) {
            let classes = ["class", "childclass"]
                .into_iter()
                .filter_map(|key| node.attribute(key))
                .filter(|_| !in_defaults(node));
            for class in
                classes.filter(|class| *class != MAIN && !self.defaults.contains_key(*class))
            {
                let help = did_you_mean(class, self.defaults.keys().map(String::as_str));
                reader.error(
                    "W051",
                    node,
                    format!("`<default>` does not define the class `{class}`"),
                    help,
                );
            }
            if let Some(kind) = node
                .attribute("type")
                .filter(|kind| node.has_tag_name("geom") && !GEOMS.contains(kind))
            {
                let help = did_you_mean(kind, GEOMS);
                reader.error(
                    "W035",
                    node,
                    format!("the geom type `{kind}` does not exist"),
                    help,
                );
            }
        }
    }

    /// Adds a class and those in it, which inherit its defaults.
    fn add_class(&mut self, node: Node, name: &str, inherited: &BTreeMap<String, Values>) {
        let mut own = self
            .defaults
            .get(name)
            .cloned()
            .unwrap_or_else(|| inherited.clone());
        for element in node
            .children()
            .filter(|child| child.is_element() && child.tag_name().name() != "default")
        {
            let values = own.entry(element.tag_name().name().to_owned()).or_default();
            values.extend(
                element
                    .attributes()
                    .map(|value| (value.name().to_owned(), value.value().to_owned())),
            );
        }
        self.defaults.insert(name.to_owned(), own.clone());
        for nested in xml::children(node, "default") {
            if let Some(class) = nested.attribute("class") {
                self.add_class(nested, class, &own);
            }
        }
    }

    /// Returns the attributes of an element in a body of this class.
    pub(super) fn attributes<'a>(&'a self, node: Node<'a>, class: Option<&str>) -> Attributes<'a> {
        let class = node.attribute("class").or(class).unwrap_or(MAIN);
        let defaults = self.defaults.get(class).or_else(|| self.defaults.get(MAIN));
        Attributes {
            node,
            defaults: defaults.and_then(|elements| elements.get(node.tag_name().name())),
        }
    }

    /// Returns the pose of an element; the identity after it has reported a fault.
    pub(super) fn pose(
        &self,
        attributes: &Attributes<'_>,
        node: Node,
        reader: &mut Reader,
    ) -> Isometry3<f64> {
        let at = attributes
            .get("pos")
            .and_then(|text| reader.numbers::<3>(node, text, Bound::Finite));
        let at = Translation3::from(Vector3::from(at.unwrap_or([0.0; 3])));
        Isometry3::from_parts(
            at,
            self.rotation(attributes, node, reader).unwrap_or_default(),
        )
    }

    fn rotation(
        &self,
        attributes: &Attributes<'_>,
        node: Node,
        reader: &mut Reader,
    ) -> Option<UnitQuaternion<f64>> {
        if let Some(text) = attributes.get("quat") {
            let [w, x, y, z] = reader.numbers(node, text, Bound::Finite)?;
            return UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-9);
        }
        if let Some(text) = attributes.get("axisangle") {
            let [x, y, z, angle] = reader.numbers(node, text, Bound::Finite)?;
            let axis = Unit::try_new(Vector3::new(x, y, z), 1e-9)?;
            return Some(UnitQuaternion::from_axis_angle(&axis, angle * self.angle));
        }
        if let Some(text) = attributes.get("euler") {
            let angles: [f64; 3] = reader.numbers(node, text, Bound::Finite)?;
            return Some(self.turned(angles));
        }
        if let Some(text) = attributes.get("xyaxes") {
            let [a, b, c, d, e, f] = reader.numbers(node, text, Bound::Finite)?;
            let x = Vector3::new(a, b, c).try_normalize(1e-9)?;
            let y = Vector3::new(d, e, f);
            let y = (y - x * x.dot(&y)).try_normalize(1e-9)?;
            let axes = Matrix3::from_columns(&[x, y, x.cross(&y)]);
            return Some(UnitQuaternion::from_rotation_matrix(
                &Rotation3::from_matrix_unchecked(axes),
            ));
        }
        let [x, y, z] = reader.numbers(node, attributes.get("zaxis")?, Bound::Finite)?;
        UnitQuaternion::rotation_between(&Vector3::z(), &Vector3::new(x, y, z))
    }

    /// Rotations about the axes of the file's sequence: lower-case ones turn with the body,
    /// upper-case ones are fixed.
    fn turned(&self, angles: [f64; 3]) -> UnitQuaternion<f64> {
        let mut rotation = UnitQuaternion::identity();
        for (letter, angle) in self.euler.chars().zip(angles) {
            let axis = match letter.to_ascii_lowercase() {
                'x' => Vector3::x_axis(),
                'y' => Vector3::y_axis(),
                _ => Vector3::z_axis(),
            };
            let turn = UnitQuaternion::from_axis_angle(&axis, angle * self.angle);
            rotation = if letter.is_ascii_lowercase() {
                rotation * turn
            } else {
                turn * rotation
            };
        }
        rotation
    }
}

/// Returns a text in which each `<include file="…"/>` is replaced by the elements of that file.
///
/// # Errors
/// Faults of XML (W031, W055), a file that can't be read (W035).
pub(super) fn with_includes(
    source: &Source,
    path: &Path,
    files: &Files,
    depth: usize,
) -> Result<String, Diagnostics> {
    let document = xml::parse_model(source, &source.text)?;
    let mut text = source.text.to_string();
    let includes: Vec<Node> = document
        .descendants()
        .filter(|node| node.tag_name().name() == "include")
        .collect();
    // From the last place to the first, so that the others stay valid.
    for include in includes.into_iter().rev() {
        let file = include.attribute("file").unwrap_or_default();
        let fault = |message: String| {
            let help = "the path is relative to the file that includes it";
            Diagnostics::from(
                Diagnostic::error("W035", message)
                    .at(source, xml::span(include))
                    .help(help),
            )
        };
        if depth >= DEEPEST {
            return Err(fault(format!(
                "`{file}` is included {DEEPEST} files deep: it may include itself"
            )));
        }
        let other = path.parent().unwrap_or(Path::new("")).join(file);
        let included = files
            .read(&other)
            .map_err(|reason| fault(format!("cannot read {}: {reason}", other.display())))?;
        let whole = with_includes(&included, &other, files, depth + 1)?;
        let whole = Source::new(included.name.to_string(), whole);
        let elements = xml::parse_model(&whole, &whole.text)?;
        let inside: String = elements
            .root_element()
            .children()
            .map(|child| &whole.text[child.range()])
            .collect();
        text.replace_range(include.range(), &inside);
    }
    Ok(text)
}
