//! Settings of a whole MJCF file: included files, default classes, units, and meshes.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use nalgebra::{
    Isometry3, Matrix3, Point3, Quaternion, Rotation3, Translation3, Unit, UnitQuaternion, Vector3,
};

use crate::foreign::colours;
use crate::foreign::lookup::beside;
use crate::foreign::mjcf_budget::Budget;
use crate::foreign::xml::{self, Bound, Node, Pieces, Reader};
use actcheck_base::{Diagnostic, Diagnostics, Files, Source, did_you_mean};
use actcheck_data::{Spread, TreeColour, TreeInertial};

/// Most files in a chain of inclusions: a longer chain comes back to its first file.
const DEEPEST: usize = 8;
/// Most copies of a `<replicate>`.
const MOST_COPIES: usize = 1_000;
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
/// Kinds of actuators: each is a general actuator with other defaults, and all share the defaults
/// of a class.
const ACTUATORS: [&str; 9] = [
    "general",
    "motor",
    "position",
    "velocity",
    "intvelocity",
    "damper",
    "cylinder",
    "muscle",
    "adhesion",
];

/// The words of attributes of `<compiler>`.
const KEYWORDS: [(&str, &[&str]); 7] = [
    ("angle", &["radian", "degree"]),
    ("coordinate", &["local", "global"]),
    ("autolimits", &["true", "false"]),
    ("balanceinertia", &["true", "false"]),
    ("strippath", &["true", "false"]),
    ("fitaabb", &["true", "false"]),
    ("inertiafromgeom", &["true", "false", "auto"]),
];
/// Attributes of rotations other than `quat`.
const TURNS: [&str; 4] = ["axisangle", "euler", "xyaxes", "zaxis"];
/// Shapes that may be stated by their ends.
const LONG: [&str; 4] = ["capsule", "cylinder", "box", "ellipsoid"];

type Values = BTreeMap<String, String>;

/// Settings, default classes and meshes of a file.
pub(super) struct Compiler {
    /// Radians per unit of angle.
    pub(super) angle: f64,
    euler: String,
    /// Default attributes by class and element.
    defaults: BTreeMap<String, BTreeMap<String, Values>>,
    /// By the mesh's name.
    pub(super) meshes: BTreeMap<String, Rc<MeshAsset>>,
    /// The colours of materials, by their names.
    pub(super) materials: BTreeMap<String, TreeColour>,
    /// Files of other models, by their names.
    pub(super) models: BTreeMap<String, String>,
    /// Geoms that a `<pair>` lets collide.
    pub(super) paired: BTreeSet<String>,
    /// The basis of masses.
    pub(super) masses: MassRules,
    /// Whether a range is a limit unless the file says otherwise.
    limits_itself: bool,
    /// Whether primitives are fitted to the boxes around meshes instead of to their moments.
    pub(super) fits_boxes: bool,
}

/// The colour in `rgba`. Reports one that is not four numbers (W036).
fn own_colour(
    node: Node,
    attributes: &MjcfAttributes<'_>,
    reader: &mut Reader,
) -> Option<TreeColour> {
    let text = attributes.get("rgba")?;
    let numbers = colours::numbers(text).filter(|numbers| numbers.len() == 4);
    if numbers.is_none() {
        let message = format!(
            "`rgba` is ignored: it must be four numbers, but is `{}`",
            xml::short(text)
        );
        reader.warning("W036", node, message, colours::NO_EFFECT);
    }
    colours::whole(&numbers?)
}

/// A mesh of a file.
#[derive(Debug, Clone, Default)]
pub(super) struct MeshAsset {
    /// `None` if the model's file itself contains the mesh.
    pub(super) file: Option<String>,
    /// Factors along x, y, z.
    pub(super) scale: [f64; 3],
    /// The frame that the vertices are moved to, in that of the file.
    pub(super) origin: Isometry3<f64>,
    /// Corners of a mesh that the model's file contains, and its triangles, if it has any.
    pub(super) vertices: Vec<[f64; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
    /// How its mass is spread.
    pub(super) spread: Spread,
}

/// The attributes of `<compiler>` that decide about masses.
#[derive(Debug, Clone)]
pub(super) struct MassRules {
    /// `Some(true)`: geoms decide even where a body has an `<inertial>`; `Some(false)`: they never
    /// do.
    pub(super) from_geoms: Option<bool>,
    /// Groups of the geoms that have a mass, first and last.
    pub(super) groups: [f64; 2],
    /// Whether impossible moments are replaced by their mean.
    pub(super) balances: bool,
    /// Least mass and least moment of a moving body. Units: kilograms and kg·m².
    pub(super) least: [f64; 2],
    /// Mass of the whole model. Unit: kilograms.
    pub(super) total_kg: Option<f64>,
}

impl Default for MassRules {
    fn default() -> Self {
        Self {
            from_geoms: None,
            groups: [0.0, 5.0],
            balances: false,
            least: [0.0; 2],
            total_kg: None,
        }
    }
}

impl MassRules {
    /// Raises a mass and its moments to the least ones, and replaces impossible moments.
    pub(super) fn apply(&self, inertial: &mut TreeInertial) {
        let [least_kg, least_moment] = self.least;
        inertial.kg = inertial.kg.max(least_kg);
        let eigen = inertial.about_com.symmetric_eigen();
        let moments = eigen.eigenvalues;
        let is_impossible = moments.max() > moments.sum() - moments.max();
        if !(self.balances && is_impossible) && moments.min() >= least_moment {
            return;
        }
        let mut moments = moments.map(|moment| moment.max(least_moment));
        if self.balances && moments.max() > moments.sum() - moments.max() {
            moments = Vector3::repeat(moments.mean());
        }
        let axes = eigen.eigenvectors;
        inertial.about_com = axes * Matrix3::from_diagonal(&moments) * axes.transpose();
    }
}

/// The attributes of an element, with the defaults of its class.
pub(super) struct MjcfAttributes<'a> {
    node: Node<'a>,
    defaults: Option<&'a Values>,
}

impl<'a> MjcfAttributes<'a> {
    /// Returns an attribute.
    pub(super) fn get(&self, name: &str) -> Option<&'a str> {
        self.node
            .attribute(name)
            .or_else(|| self.defaults?.get(name).map(String::as_str))
            .map(str::trim)
    }

    /// Returns the rotation that is not a quaternion, with its name: its own, otherwise that of its
    /// class.
    fn turn(&self) -> Option<(&'static str, &'a str)> {
        let own = TURNS
            .into_iter()
            .find_map(|key| Some((key, self.node.attribute(key)?)));
        own.or_else(|| {
            let of_class = |key| Some((key, self.defaults?.get(key)?.as_str()));
            TURNS.into_iter().find_map(of_class)
        })
    }

    /// Returns the first number of an attribute; `None` if there is none, and after it has reported
    /// a fault.
    pub(super) fn number(&self, name: &str, reader: &mut Reader) -> Option<f64> {
        let numbers = reader.list(self.node, name, self.get(name)?)?;
        numbers.first().copied()
    }
}

/// An element inside of a body, its `<frame>`s and `<replicate>`s.
pub(super) struct Item<'a> {
    pub(super) node: Node<'a>,
    /// The frame of the element in that of the body.
    pub(super) shift: Isometry3<f64>,
    pub(super) class: Option<&'a str>,
    /// The end of its name: the number of its copy.
    pub(super) suffix: String,
}

impl Item<'_> {
    /// Returns its name, if it has one.
    pub(super) fn name(&self) -> Option<String> {
        let name = self.node.attribute("name")?;
        Some(format!("{name}{}", self.suffix))
    }

    pub(super) fn is(&self, name: &str) -> bool {
        self.node.has_tag_name(name)
    }
}

impl Compiler {
    pub(super) fn read(root: Node, reader: &mut Reader) -> Self {
        let mut compiler = Self {
            angle: 1f64.to_radians(),
            euler: "xyz".to_owned(),
            defaults: BTreeMap::new(),
            meshes: BTreeMap::new(),
            materials: BTreeMap::new(),
            models: BTreeMap::new(),
            paired: BTreeSet::new(),
            masses: MassRules::default(),
            limits_itself: true,
            fits_boxes: false,
        };
        let help = "an MJCF file begins with `<mujoco model=\"…\">`";
        reader.root(root, "mujoco", help);
        let mut folders = Folders::default();
        for settings in xml::children(root, "compiler") {
            compiler.read_settings(settings, &mut folders, reader);
        }
        for defaults in xml::children(root, "default") {
            let class = defaults.attribute("class").unwrap_or(MAIN);
            compiler.add_class(defaults, class, &BTreeMap::new());
        }
        let sections = |name| xml::children(root, name).flat_map(|of| of.children());
        for asset in sections("asset") {
            match asset.tag_name().name() {
                "mesh" => compiler.add_mesh(asset, &folders, reader),
                "material" => compiler.add_material(asset, reader),
                "model" => compiler.add_model(asset, reader),
                _ => {}
            }
        }
        for pair in sections("contact").filter(|node| node.has_tag_name("pair")) {
            let ends = ["geom1", "geom2"].into_iter();
            compiler
                .paired
                .extend(ends.filter_map(|end| pair.attribute(end).map(str::to_owned)));
        }
        compiler.check_names(root, reader);
        compiler
    }

    fn read_settings(&mut self, settings: Node, folders: &mut Folders, reader: &mut Reader) {
        for (key, words) in KEYWORDS {
            let Some(word) = settings.attribute(key).filter(|word| !words.contains(word)) else {
                continue;
            };
            let message = format!("`{key}` can't be `{word}`");
            let help = format!("write one of these words: {}", words.join(", "));
            reader.error("W034", settings, message, help);
        }
        match settings.attribute("angle") {
            Some("radian") => self.angle = 1.0,
            Some("degree") => self.angle = 1f64.to_radians(),
            _ => {}
        }
        if let Some(sequence) = settings.attribute("eulerseq") {
            let is_axis = |letter: char| "xyzXYZ".contains(letter);
            if sequence.chars().count() == 3 && sequence.chars().all(is_axis) {
                sequence.clone_into(&mut self.euler);
            } else {
                let message = format!("`eulerseq` can't be `{sequence}`");
                let help = "write three letters of x, y, z, X, Y and Z";
                reader.error("W034", settings, message, help);
            }
        }
        let written = settings
            .attribute("meshdir")
            .or(settings.attribute("assetdir"));
        if let Some(written) = written {
            folders.meshes = format!("{}/", written.trim_end_matches('/'));
        }
        if let Some(strips) = settings.attribute("strippath") {
            folders.strips = strips == "true";
        }
        if let Some(limits) = settings.attribute("autolimits") {
            self.limits_itself = limits != "false";
        }
        self.fits_boxes |= settings.attribute("fitaabb") == Some("true");
        if settings.attribute("coordinate") == Some("global") {
            let message = "global coordinates are not read".to_owned();
            let help = "write local ones, as MuJoCo 2.3.3 and later need them";
            reader.error("W035", settings, message, help);
        }
        let masses = &mut self.masses;
        match settings.attribute("inertiafromgeom") {
            Some("true") => masses.from_geoms = Some(true),
            Some("false") => masses.from_geoms = Some(false),
            Some("auto") => masses.from_geoms = None,
            _ => {}
        }
        if let Some(balances) = settings.attribute("balanceinertia") {
            masses.balances = balances == "true";
        }
        let mut number = |key: &str, bound: Bound| {
            let written = settings.attribute(key)?;
            reader
                .numbers::<1>(settings, written, bound)
                .map(|[number]| number)
        };
        masses.least[0] = number("boundmass", Bound::Mass).unwrap_or(masses.least[0]);
        masses.least[1] = number("boundinertia", Bound::Mass).unwrap_or(masses.least[1]);
        let total = number("settotalmass", Bound::Within);
        masses.total_kg = total.filter(|kg| *kg > 0.0).or(masses.total_kg);
        if let Some(written) = settings.attribute("inertiagrouprange") {
            let groups = reader.numbers(settings, written, Bound::Finite);
            masses.groups = groups.unwrap_or(masses.groups);
        }
    }

    fn add_mesh(&mut self, node: Node, folders: &Folders, reader: &mut Reader) {
        let attributes = self.attributes(node, None);
        let file = attributes.get("file").map(|file| folders.path(file));
        let stem = file.as_deref().and_then(stem);
        let Some(name) = node.attribute("name").map(str::to_owned).or(stem) else {
            return;
        };
        let numbers = |key: &str| attributes.get(key);
        let scale = numbers("scale").and_then(|text| reader.numbers(node, text, Bound::Within));
        let position =
            numbers("refpos").and_then(|text| reader.numbers::<3>(node, text, Bound::Within));
        let turn = numbers("refquat").and_then(|text| quaternion(node, text, reader));
        let mut mesh = MeshAsset {
            scale: scale.unwrap_or([1.0; 3]),
            origin: Isometry3::from_parts(
                Translation3::from(Vector3::from(position.unwrap_or_default())),
                turn.unwrap_or_default(),
            ),
            spread: spread(node, &attributes, reader),
            ..MeshAsset::default()
        };
        if file.is_none() {
            let Some(vertices) = attributes.get("vertex") else {
                let message = format!("the mesh `{name}` has neither `file` nor `vertex`");
                let help = "name a file: MuJoCo's built-in meshes are not read";
                reader.error("W035", node, message, help);
                return;
            };
            mesh.vertices = triples(node, vertices, reader).unwrap_or_default();
            if let Some(faces) = attributes.get("face") {
                mesh.triangles = triples(node, faces, reader).unwrap_or_default();
            }
        }
        mesh.file = file;
        self.meshes.insert(name, Rc::new(mesh));
    }

    fn add_material(&mut self, node: Node, reader: &mut Reader) {
        let attributes = self.attributes(node, None);
        if let (Some(name), Some(colour)) = (
            node.attribute("name"),
            own_colour(node, &attributes, reader),
        ) {
            self.materials.insert(name.to_owned(), colour);
        }
    }

    /// Returns the colour of a geom: its own, or that of its material. MuJoCo does not read the
    /// colours of mesh files.
    pub(super) fn colour(
        &self,
        geom: Node,
        attributes: &MjcfAttributes<'_>,
        reader: &mut Reader,
    ) -> Option<TreeColour> {
        own_colour(geom, attributes, reader)
            .or_else(|| self.materials.get(attributes.get("material")?).copied())
    }

    fn add_model(&mut self, node: Node, reader: &mut Reader) {
        let Some(file) = reader.attribute(node, "file") else {
            return;
        };
        let name = node.attribute("name").map(str::to_owned).or(stem(file));
        self.models
            .insert(name.unwrap_or_default(), file.to_owned());
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
            let values = own
                .entry(kind(element.tag_name().name()).to_owned())
                .or_default();
            // One rotation replaces another one.
            if TURNS.iter().any(|key| element.has_attribute(*key)) {
                values.retain(|key, _| !TURNS.contains(&key.as_str()));
            }
            values.extend(
                element
                    .attributes()
                    .map(|value| (value.name().to_owned(), value.value().to_owned())),
            );
            state_gains(element.tag_name().name(), values);
        }
        self.defaults.insert(name.to_owned(), own.clone());
        for nested in xml::children(node, "default") {
            if let Some(class) = nested.attribute("class") {
                self.add_class(nested, class, &own);
            }
        }
    }

    /// Returns the attributes of an element in a body of this class.
    pub(super) fn attributes<'a>(
        &'a self,
        node: Node<'a>,
        class: Option<&str>,
    ) -> MjcfAttributes<'a> {
        let class = node.attribute("class").or(class).unwrap_or(MAIN);
        let defaults = self.defaults.get(class).or_else(|| self.defaults.get(MAIN));
        MjcfAttributes {
            node,
            defaults: defaults.and_then(|elements| elements.get(kind(node.tag_name().name()))),
        }
    }

    /// Returns the elements in a body: its own, and those of its `<frame>`s and `<replicate>`s; not
    /// all of them if the budget is spent.
    pub(super) fn content<'a>(
        &self,
        body: Node<'a>,
        class: Option<&'a str>,
        budget: &Budget,
        reader: &mut Reader,
    ) -> Vec<Item<'a>> {
        let whole = Item {
            node: body,
            shift: Isometry3::identity(),
            class,
            suffix: String::new(),
        };
        let mut found = Vec::new();
        self.add_content((&whole, 0), &mut found, budget, reader);
        found
    }

    fn add_content<'a>(
        &self,
        (of, depth): (&Item<'a>, usize),
        found: &mut Vec<Item<'a>>,
        budget: &Budget,
        reader: &mut Reader,
    ) {
        for node in of.node.children().filter(Node::is_element) {
            if !budget.element(depth, node, reader) {
                return;
            }
            let inside = |shift: Isometry3<f64>, suffix: String| Item {
                node,
                shift,
                class: node.attribute("childclass").or(of.class),
                suffix,
            };
            match node.tag_name().name() {
                "frame" => {
                    let pose = self.pose(&self.attributes(node, of.class), node, reader);
                    let frame = inside(of.shift * pose, of.suffix.clone());
                    self.add_content((&frame, depth + 1), found, budget, reader);
                }
                "replicate" => {
                    let Some((count, step)) = self.copies(node, reader) else {
                        continue;
                    };
                    let digits = count.to_string().len();
                    let separator = node.attribute("sep").unwrap_or_default();
                    let mut shift = of.shift;
                    for number in 0..count {
                        if !budget.element(depth, node, reader) {
                            return;
                        }
                        let suffix = format!("{separator}{number:0digits$}{}", of.suffix);
                        let copy = inside(shift, suffix);
                        self.add_content((&copy, depth + 1), found, budget, reader);
                        shift *= step;
                    }
                }
                _ => found.push(Item {
                    node,
                    shift: of.shift,
                    class: of.class,
                    suffix: of.suffix.clone(),
                }),
            }
        }
    }

    /// Returns the number of copies of a `<replicate>`, and the pose of each in the frame of the
    /// one before it.
    fn copies(&self, node: Node, reader: &mut Reader) -> Option<(usize, Isometry3<f64>)> {
        let written = reader.attribute(node, "count")?;
        let count = written.parse().ok().filter(|count| *count <= MOST_COPIES);
        let Some(count) = count else {
            let message = format!("`count` must be a whole number up to {MOST_COPIES}");
            reader.error("W034", node, message, "use fewer copies");
            return None;
        };
        let mut three = |key: &str| match node.attribute(key) {
            Some(text) => reader.numbers::<3>(node, text, Bound::Within),
            None => Some([0.0; 3]),
        };
        let (offset, euler) = (three("offset")?, three("euler")?);
        let step = Isometry3::from_parts(
            Translation3::from(Vector3::from(offset)),
            self.turned(euler),
        );
        Some((count, step))
    }

    /// Returns the two ends of a range of an element, unless it is switched off; `None`
    /// if the range is empty and `limited` does not ask for it, and after it has reported a fault.
    pub(super) fn limits(
        &self,
        node: Node,
        attributes: &MjcfAttributes<'_>,
        [range, limited]: [&str; 2],
        reader: &mut Reader,
    ) -> Option<[f64; 2]> {
        let written = attributes.get(range);
        let ends = match written {
            Some(text) => reader.numbers::<2>(node, text, Bound::Finite)?,
            None => [0.0; 2],
        };
        let is_range = ends[0] < ends[1];
        match attributes.get(limited) {
            Some("false") => None,
            Some("true") => {
                if !is_range {
                    let message = format!("`{limited}` is true, but `{range}` is not a range");
                    let help = "write two numbers, the smaller one first";
                    reader.error("W034", node, message, help);
                }
                is_range.then_some(ends)
            }
            None | Some("auto") => {
                if ends[0] > ends[1] {
                    let message = format!(
                        "`{range}` has a lower limit of {} above its upper limit of {}",
                        ends[0], ends[1]
                    );
                    reader.error("W034", node, message, "write the smaller number first");
                } else if is_range && !self.limits_itself {
                    let message = format!("`{range}` has no effect without `{limited}`");
                    let help =
                        format!("write `{limited}=\"true\"`, or remove `autolimits=\"false\"`");
                    reader.error("W034", node, message, help);
                }
                is_range.then_some(ends)
            }
            Some(other) => {
                let message = format!("`{limited}` can't be `{other}`");
                reader.error("W034", node, message, "write `true`, `false` or `auto`");
                None
            }
        }
    }

    /// Returns the pose of an element; the identity after it has reported a fault.
    pub(super) fn pose(
        &self,
        attributes: &MjcfAttributes<'_>,
        node: Node,
        reader: &mut Reader,
    ) -> Isometry3<f64> {
        let at = attributes
            .get("pos")
            .and_then(|text| reader.numbers::<3>(node, text, Bound::Within));
        let at = Translation3::from(Vector3::from(at.unwrap_or([0.0; 3])));
        Isometry3::from_parts(
            at,
            self.rotation(attributes, node, reader).unwrap_or_default(),
        )
    }

    /// Returns a rotation. Any other attribute than `quat` decides before it, even if it is that of
    /// the class. Returns `None` if there is none, and after it has reported a fault.
    fn rotation(
        &self,
        attributes: &MjcfAttributes<'_>,
        node: Node,
        reader: &mut Reader,
    ) -> Option<UnitQuaternion<f64>> {
        let is_own = |key: &&str| node.has_attribute(*key);
        if std::iter::once("quat").chain(TURNS).filter(is_own).count() > 1 {
            let message = "this element states its orientation twice".to_owned();
            let help = "write one of `quat`, `axisangle`, `euler`, `xyaxes` and `zaxis`";
            reader.error("W034", node, message, help);
            return None;
        }
        let Some((key, text)) = attributes.turn() else {
            return quaternion(node, attributes.get("quat")?, reader);
        };
        let found = match key {
            "axisangle" => {
                let [x, y, z, angle] = reader.numbers(node, text, Bound::Finite)?;
                let axis = Unit::try_new(Vector3::new(x, y, z), 1e-9);
                axis.map(|axis| UnitQuaternion::from_axis_angle(&axis, angle * self.angle))
            }
            "euler" => Some(self.turned(reader.numbers(node, text, Bound::Finite)?)),
            "xyaxes" => {
                let [a, b, c, d, e, f] = reader.numbers(node, text, Bound::Finite)?;
                of_axes(Vector3::new(a, b, c), Vector3::new(d, e, f))
            }
            _ => {
                let axis = reader.numbers::<3>(node, text, Bound::Finite)?;
                let axis = Vector3::from(axis).try_normalize(1e-9);
                axis.map(|axis| upright_to(&axis))
            }
        };
        if found.is_none() {
            let message = format!("`{key}` must not be zero, and its axes must differ");
            reader.error("W034", node, message, "leave it out, or state another axis");
        }
        found
    }

    /// Returns the pose between the two points of `fromto`, whose axis z points from the second to
    /// the first, and half of their distance; `None` without `fromto`, and after it has reported a
    /// fault.
    pub(super) fn between(
        &self,
        attributes: &MjcfAttributes<'_>,
        node: Node,
        reader: &mut Reader,
    ) -> Option<(Isometry3<f64>, f64)> {
        let text = attributes.get("fromto")?;
        if !LONG.contains(&attributes.get("type").unwrap_or("sphere")) {
            let message =
                "`fromto` belongs to capsules, cylinders, boxes and ellipsoids".to_owned();
            reader.error("W034", node, message, "state the `type` of the shape");
            return None;
        }
        let [ax, ay, az, bx, by, bz] = reader.numbers(node, text, Bound::Within)?;
        let (a, b) = (Point3::new(ax, ay, az), Point3::new(bx, by, bz));
        let middle = Translation3::from(nalgebra::center(&a, &b).coords);
        let turned = upright_to(&(a - b));
        Some((Isometry3::from_parts(middle, turned), (b - a).norm() / 2.0))
    }

    /// Returns the pose of a site: as that of a geom, it may follow from two points.
    pub(super) fn site(
        &self,
        attributes: &MjcfAttributes<'_>,
        node: Node,
        reader: &mut Reader,
    ) -> Isometry3<f64> {
        match attributes.get("fromto") {
            Some(_) => {
                let between = self.between(attributes, node, reader);
                between.map(|(pose, _)| pose).unwrap_or_default()
            }
            None => self.pose(attributes, node, reader),
        }
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

/// How the mass of a mesh is spread, by its `inertia`.
fn spread(node: Node, attributes: &MjcfAttributes<'_>, reader: &mut Reader) -> Spread {
    match attributes.get("inertia") {
        None | Some("legacy") => Spread::Inside,
        Some("exact") => Spread::Exact,
        Some("convex") => Spread::Hull,
        Some("shell") => Spread::Shell,
        Some(other) => {
            let message = format!("`inertia` can't be `{other}`");
            let help = "write `convex`, `exact`, `legacy` or `shell`";
            reader.error("W034", node, message, help);
            Spread::Inside
        }
    }
}

/// Reads a quaternion. Returns `None` after it has reported a fault.
fn quaternion(node: Node, text: &str, reader: &mut Reader) -> Option<UnitQuaternion<f64>> {
    let [w, x, y, z] = reader.numbers(node, text, Bound::Finite)?;
    let found = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 1e-9);
    if found.is_none() {
        let message = "a quaternion must not be zero".to_owned();
        reader.error("W034", node, message, "write `1 0 0 0` for no rotation");
    }
    found
}

/// The rotation whose axis x is the first, and whose axis y is as near to the second as can be.
fn of_axes(x: Vector3<f64>, y: Vector3<f64>) -> Option<UnitQuaternion<f64>> {
    let x = x.try_normalize(1e-9)?;
    let y = (y - x * x.dot(&y)).try_normalize(1e-9)?;
    let axes = Matrix3::from_columns(&[x, y, x.cross(&y)]);
    Some(UnitQuaternion::from_rotation_matrix(
        &Rotation3::from_matrix_unchecked(axes),
    ))
}

/// The shortest rotation of the axis z to another one; downwards, that about x.
fn upright_to(axis: &Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::rotation_between(&Vector3::z(), axis).unwrap_or_else(|| {
        UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
    })
}

/// The folders of a file's meshes.
#[derive(Default)]
struct Folders {
    meshes: String,
    /// Whether only the last parts of paths count.
    strips: bool,
}

impl Folders {
    fn path(&self, file: &str) -> String {
        let last = file.rsplit(['/', '\\']).next().unwrap_or(file);
        let file = if self.strips { last } else { file };
        if is_absolute(file) {
            return file.to_owned();
        }
        format!("{}{file}", self.meshes)
    }
}

/// The element whose defaults an element has.
fn kind(element: &str) -> &str {
    if ACTUATORS.contains(&element) {
        ACTUATORS[0]
    } else {
        element
    }
}

/// States the gain and the bias of a kind of actuators among defaults, as those of a general
/// actuator: an element of another kind has them, too.
fn state_gains(kind: &str, values: &mut Values) {
    let of = |key: &str, usual: &str| values.get(key).map_or(usual, String::as_str).to_owned();
    let (proportional, damping) = (of("kp", "1"), of("kv", "0"));
    let (gain, bias, of_bias) = match kind {
        "motor" => ("1".to_owned(), "none", String::new()),
        "adhesion" => (of("gain", "1"), "none", String::new()),
        "position" | "intvelocity" => {
            let of_bias = format!("0 -{proportional} -{damping}");
            (proportional, "affine", of_bias)
        }
        "velocity" => {
            let gain = of("kv", "1");
            let of_bias = format!("0 0 -{gain}");
            (gain, "affine", of_bias)
        }
        _ => return,
    };
    for (key, value) in [
        ("gaintype", "fixed".to_owned()),
        ("gainprm", gain),
        ("biastype", bias.to_owned()),
        ("biasprm", of_bias),
    ] {
        values.insert(key.to_owned(), value);
    }
}

/// Whether a path or URI has a folder of its own, on this machine or another one.
pub(super) fn is_absolute(path: &str) -> bool {
    let has_drive = path.as_bytes().get(1) == Some(&b':');
    path.starts_with(['/', '\\']) || has_drive || path.contains("://")
}

/// The name of a file without its folders and its ending.
fn stem(file: &str) -> Option<String> {
    let last = file.rsplit(['/', '\\']).next().unwrap_or(file);
    let stem = Path::new(last).file_stem()?;
    Some(stem.to_string_lossy().into_owned())
}

/// Reads a list of triples. Returns `None` after it has reported a fault.
fn triples<T: std::str::FromStr + Copy>(
    node: Node,
    text: &str,
    reader: &mut Reader,
) -> Option<Vec<[T; 3]>> {
    let numbers: Option<Vec<T>> = text
        .split_whitespace()
        .map(|word| word.parse().ok())
        .collect();
    let numbers = numbers.unwrap_or_default();
    if numbers.is_empty() || !numbers.len().is_multiple_of(3) {
        let message = "a mesh needs three numbers for each vertex and each face".to_owned();
        reader.error("W034", node, message, "separate numbers by spaces");
        return None;
    }
    Some(
        numbers
            .chunks_exact(3)
            .map(|three| [three[0], three[1], three[2]])
            .collect(),
    )
}

/// A text in which each `<include file="…"/>` is replaced by the elements of that file.
pub(super) struct Whole {
    pub(super) source: Source,
    pub(super) pieces: Pieces,
}

/// Replaces each `<include file="…"/>` by the elements of that file. A path is relative to the
/// first file, or to the one that includes it.
///
/// # Errors
/// Faults of XML (W031), too many or too long files (W055), a file that can't be read (W035).
pub(super) fn with_includes(
    source: &Source,
    path: &Path,
    files: &Files,
    budget: &Budget,
) -> Result<Whole, Diagnostics> {
    let mut whole = Splice {
        text: String::new(),
        pieces: Vec::new(),
        main: path.parent().unwrap_or(Path::new("")),
        files,
        budget,
    };
    whole.add(source, path, 0)?;
    Ok(Whole {
        source: Source::new(source.name.to_string(), whole.text),
        pieces: whole.pieces,
    })
}

/// A text that is being put together.
struct Splice<'a> {
    text: String,
    pieces: Pieces,
    /// Folder of the first file.
    main: &'a Path,
    files: &'a Files,
    budget: &'a Budget,
}

impl Splice<'_> {
    /// Adds a text; if it is included at a depth, only the elements below its root.
    fn add(&mut self, source: &Source, path: &Path, depth: usize) -> Result<(), Diagnostics> {
        self.budget.file(source.text.len()).map_err(|message| {
            Diagnostic::error("W055", message)
                .at(source, 0..0)
                .help("include fewer files, each once")
        })?;
        let document = xml::parse_model(source, &source.text)?;
        let root = document.root_element();
        let range = match (depth, root.first_child(), root.last_child()) {
            (0, ..) => 0..source.text.len(),
            (_, Some(first), Some(last)) => first.range().start..last.range().end,
            _ => return Ok(()),
        };
        let mut at = range.start;
        let includes = document
            .descendants()
            .filter(|node| node.tag_name().name() == "include");
        for include in includes {
            self.copy(source, at..include.range().start);
            at = include.range().end;
            let file = include.attribute("file").unwrap_or_default();
            let fault = |message: String| {
                let help = "the path is relative to the first file, or to the one that includes it";
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
            let folders = [self.main, path.parent().unwrap_or(Path::new(""))];
            let (other, included) = self.read(file, folders).map_err(fault)?;
            self.add(&included, &other, depth + 1)?;
        }
        self.copy(source, at..range.end);
        Ok(())
    }

    /// Reads a file in the first of these folders that has it.
    fn read(&self, file: &str, folders: [&Path; 2]) -> Result<(PathBuf, Source), String> {
        let mut reasons = Vec::new();
        for folder in folders {
            let path = beside(self.files, folder, file);
            match self.files.read(&path) {
                Ok(found) => return Ok((path, found)),
                Err(reason) => reasons.push(format!("cannot read {}: {reason}", path.display())),
            }
        }
        reasons.dedup();
        Err(reasons.join("; "))
    }

    fn copy(&mut self, source: &Source, range: std::ops::Range<usize>) {
        let start = range.start;
        if let Some(text) = source.text.get(range) {
            self.pieces.push((self.text.len(), source.clone(), start));
            self.text.push_str(text);
        }
    }
}
