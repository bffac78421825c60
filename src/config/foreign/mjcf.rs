//! Reads a robot or an object in MJCF, MuJoCo's format: bodies, joints, geoms, inertias, equalities
//! of joints.
//!
//! Sites and cameras become links, so that a profile can name them. Spatial tendons are left out with
//! a warning, and of the options only another gravity is reported.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::rc::Rc;

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::foreign::lookup::{Lookup, beside};
use crate::foreign::mjcf_budget::Budget;
use crate::foreign::mjcf_compiler::{Compiler, Item, MjcfAttributes, Whole, with_includes};
use crate::foreign::mjcf_couplings::Couplings;
use crate::foreign::mjcf_elements;
use crate::foreign::mjcf_graft::Graft;
use crate::foreign::mjcf_masks::{Contacts, Mask, collides};
use crate::foreign::solid_mass::{MeshMasses, SolidMass};
use crate::foreign::xml::{self, Bound, Node, Reader};
use actcheck_base::{Diagnostics, Source, SourceSpan};
use actcheck_data::{
    Mesh, ModelTree, Spread, TreeInertial, TreeJoint, TreeLink, TreeMimic, TreeMotion, TreeSolid,
};

/// Largest effort of a joint without limits of its actuator. Units: newtons or newton metres.
const EFFORT: f64 = 100.0;
/// Largest velocity of joints, which MJCF does not have. Units: rad/s and m/s.
const VELOCITY: [f64; 2] = [2.0, 0.5];
/// Range of an unlimited sliding joint. Unit: metres.
const SLIDES_M: f64 = 10.0;
/// Most models in a chain of attachments: a longer chain comes back to its first model.
const DEEPEST: usize = 8;

/// A tree, its text with those of all included files and attached models, and warnings.
pub(crate) type MjcfRead = (ModelTree, Source, Diagnostics);

/// Reads a robot.
///
/// # Errors
/// Faults of the text: W031 to W037, W051, W055.
pub(crate) fn robot(
    source: &Source,
    path: &Path,
    lookup: &Lookup,
) -> Result<MjcfRead, Diagnostics> {
    let budget = Budget::default();
    whole(source, File::first(path, lookup, &budget), Purpose::Robot)
        .map(|(built, text, said)| (built.tree, text, said))
}

/// Reads an object: its joints without a name of their own move its parts, and it moves freely
/// whatever the file says.
///
/// # Errors
/// As [`robot`].
pub(crate) fn object(
    source: &Source,
    path: &Path,
    lookup: &Lookup,
) -> Result<MjcfRead, Diagnostics> {
    let budget = Budget::default();
    whole(source, File::first(path, lookup, &budget), Purpose::Object)
        .map(|(built, text, said)| (built.tree, text, said))
}

/// The use of a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Purpose {
    Robot,
    Object,
    /// The objects are furniture.
    World,
}

/// A model that has been read, with the data for a model that it is attached to.
struct Built {
    tree: ModelTree,
    contacts: Contacts,
    /// Positions of joints where the bodies are as the file places them, if these are not 0.
    starts: BTreeMap<String, f64>,
}

fn whole(
    source: &Source,
    file: File<'_>,
    purpose: Purpose,
) -> Result<(Built, Source, Diagnostics), Diagnostics> {
    with_model(source, file, purpose, |root, mut model, reader| {
        let world = model.unique("world");
        model.link(TreeLink::frame(world.clone(), reader.place(root)));
        if xml::child(root, "worldbody").is_none() {
            reader.error(
                "W033",
                root,
                "`<mujoco>` has no `<worldbody>`".to_owned(),
                "add the bodies",
            );
        }
        for worldbody in xml::children(root, "worldbody") {
            model.worldbody(worldbody, &world, reader);
        }
        model.finish(root, reader);
        model.weigh(reader);
        model.tree.name = root.attribute("model").unwrap_or("robot").to_owned();
        let own = model.couplings.starts.iter();
        model
            .starts
            .extend(own.map(|(name, at)| (name.clone(), *at)));
        Built {
            tree: model.tree,
            contacts: model.contacts,
            starts: model.starts,
        }
    })
}

/// Reads the settings of a text, and calls `read` with its root and a model without bodies. Returns
/// its result, the text with those of all included files and attached models, and warnings.
pub(super) fn with_model<T>(
    source: &Source,
    file: File<'_>,
    purpose: Purpose,
    read: impl FnOnce(Node, Model, &mut Reader) -> T,
) -> Result<(T, Source, Diagnostics), Diagnostics> {
    let Whole { source, pieces } =
        with_includes(source, file.path, file.lookup.files, file.budget)?;
    let document = xml::parse_model(&source, &source.text)?;
    let root = document.root_element();
    let mut reader = Reader::new(&source);
    reader.pieces = pieces;
    mjcf_elements::check(root, purpose, &mut reader);
    let compiler = Compiler::read(root, &mut reader);
    let attached = Rc::new(RefCell::new(String::new()));
    let model = Model {
        attached: Rc::clone(&attached),
        tree: ModelTree::default(),
        couplings: Rc::new(Couplings::read(root, &compiler, &mut reader)),
        bodies: Rc::new(names_of_bodies(root)),
        compiler: Rc::new(compiler),
        names: BTreeMap::new(),
        joint_names: BTreeMap::new(),
        own: BTreeMap::new(),
        contacts: Contacts::default(),
        has_springs: false,
        copies: BTreeMap::new(),
        starts: BTreeMap::new(),
        meshes: Rc::default(),
        purpose,
        file,
    };
    let read = read(root, model, &mut reader);
    let said = reader.found;
    if said.has_errors() {
        return Err(said);
    }
    // A caller that compares two models by their texts compares their attached models too.
    let attached = attached.take();
    let text = if attached.is_empty() {
        source
    } else {
        Source::new(
            source.name.to_string(),
            format!("{}{attached}", source.text),
        )
    };
    Ok((read, text, said))
}

/// Makes a name unique: a further one gets a number at its end.
pub(super) fn unique(names: &mut BTreeMap<String, u32>, name: &str) -> String {
    let count = names.entry(name.to_owned()).or_insert(0);
    *count += 1;
    if *count == 1 {
        name.to_owned()
    } else {
        format!("{name}_{count}")
    }
}

fn names_of_bodies(root: Node) -> BTreeSet<String> {
    root.descendants()
        .filter(|node| node.has_tag_name("body"))
        .filter_map(|body| body.attribute("name").map(str::to_owned))
        .collect()
}

/// The file of a model.
#[derive(Clone, Copy)]
pub(super) struct File<'a> {
    pub(super) path: &'a Path,
    pub(super) lookup: &'a Lookup<'a>,
    /// The budget that it shares with all models that it belongs to.
    pub(super) budget: &'a Budget,
    /// Number of models that it is attached to.
    depth: usize,
}

impl<'a> File<'a> {
    /// The file of the outermost model.
    pub(super) fn first(path: &'a Path, lookup: &'a Lookup<'a>, budget: &'a Budget) -> Self {
        Self {
            path,
            lookup,
            budget,
            depth: 0,
        }
    }
}

/// A model being read.
pub(super) struct Model<'a> {
    pub(super) tree: ModelTree,
    pub(super) compiler: Rc<Compiler>,
    couplings: Rc<Couplings>,
    /// Names of the file's bodies.
    bodies: Rc<BTreeSet<String>>,
    /// Names of links in use, each with the number of its copies.
    names: BTreeMap<String, u32>,
    /// The same for joints: a joint often has the name of its body.
    joint_names: BTreeMap<String, u32>,
    /// The file's own bodies by the names of their links, and whether they have joints: those of
    /// attached models are not among them.
    own: BTreeMap<String, bool>,
    contacts: Contacts,
    /// Whether a spring was reported.
    has_springs: bool,
    /// Joints that are copies, with their names and the ends of these.
    copies: BTreeMap<String, (String, String)>,
    /// Starts of the joints of attached models.
    starts: BTreeMap<String, f64>,
    /// The texts of attached models.
    attached: Rc<RefCell<String>>,
    /// Meshes of the file that differ from those of their own files; `None` for those with a fault.
    pub(super) meshes: Rc<RefCell<BTreeMap<String, Option<Rc<Mesh>>>>>,
    purpose: Purpose,
    pub(super) file: File<'a>,
}

impl Model<'_> {
    /// Makes the name of a link unique.
    pub(super) fn unique(&mut self, name: &str) -> String {
        unique(&mut self.names, name)
    }

    pub(super) fn is_robot(&self) -> bool {
        self.purpose == Purpose::Robot
    }

    /// Another one of the same file, without bodies.
    pub(super) fn alone(&self) -> Self {
        Self {
            tree: ModelTree::default(),
            compiler: Rc::clone(&self.compiler),
            couplings: Rc::clone(&self.couplings),
            bodies: Rc::clone(&self.bodies),
            names: BTreeMap::new(),
            joint_names: BTreeMap::new(),
            own: BTreeMap::new(),
            contacts: Contacts::default(),
            has_springs: false,
            copies: BTreeMap::new(),
            starts: BTreeMap::new(),
            attached: Rc::clone(&self.attached),
            meshes: Rc::clone(&self.meshes),
            ..*self
        }
    }

    pub(super) fn link(&mut self, link: TreeLink) {
        self.tree.links.push(link);
    }

    /// Keeps a mesh that the file itself contains.
    pub(super) fn keep_mesh(&mut self, name: &str, mesh: &Mesh) {
        let known = &mut self.tree.inline_meshes;
        if !known.contains_key(name) {
            known.insert(name.to_owned(), mesh.clone());
        }
    }

    /// Adds a link without mass and shapes, fixed to another at a pose in its frame.
    fn frame(&mut self, name: &str, parent: &str, pose: Isometry3<f64>, place: SourceSpan) {
        let own = unique(&mut self.joint_names, &format!("{name}_fixed"));
        self.link(TreeLink::frame(name.to_owned(), place.clone()));
        let joint = TreeJoint::fixed(own, [parent, name], pose, place);
        self.tree.joints.push(joint);
    }

    /// Adds the parts that depend on all bodies: contacts between them, and couplings of joints.
    fn finish(&mut self, root: Node, reader: &mut Reader) {
        let is_known = |body: &str| self.names.contains_key(body);
        if self.is_robot() {
            self.contacts.read(root, is_known, reader);
        }
        if self.is_robot() && self.file.depth == 0 {
            let passing = self.contacts.passing(is_known);
            self.tree.passing.extend(passing);
        }
        let couplings = Rc::clone(&self.couplings);
        let joints = self.tree.joints.iter().map(|joint| joint.name.clone());
        let joints: BTreeSet<String> = joints.collect();
        // A name counts for all copies of a joint.
        let written: BTreeSet<&str> = root
            .descendants()
            .filter(|node| node.has_tag_name("joint") || node.has_tag_name("freejoint"))
            .filter_map(|joint| joint.attribute("name"))
            .collect();
        for named in &couplings.named {
            if !joints.contains(&named.name) && !written.contains(named.name.as_str()) {
                reader.found.push(named.unknown());
            }
        }
        for joint in &mut self.tree.joints {
            let (written, suffix) = match self.copies.get(&joint.name) {
                Some((written, suffix)) => (written.as_str(), suffix.as_str()),
                None => (joint.name.as_str(), ""),
            };
            let known = couplings.mimics.get(&joint.name);
            let Some((leader, factor, offset)) = known.or(couplings.mimics.get(written)) else {
                continue;
            };
            let copy = format!("{leader}{suffix}");
            let leader = if joints.contains(&copy) {
                &copy
            } else {
                leader
            };
            // The file that names joints of an attached model does not know where these start.
            let start = |name: &str| self.starts.get(name).copied().unwrap_or(0.0);
            joint.mimic = Some(TreeMimic {
                leader: leader.clone(),
                factor: *factor,
                offset: offset + start(&joint.name) - factor * start(leader),
                place: joint.place.clone(),
            });
        }
    }

    /// Adds the bodies of a world, and its solids, which are fixed.
    fn worldbody(&mut self, worldbody: Node, world: &str, reader: &mut Reader) {
        let compiler = Rc::clone(&self.compiler);
        let content = compiler.content(
            worldbody,
            worldbody.attribute("childclass"),
            self.file.budget,
            reader,
        );
        let [solids, visuals] = self.geoms(&content, &Isometry3::identity(), reader);
        if let Some(link) = self.tree.links.iter_mut().find(|link| link.name == world) {
            link.solids.extend(solids);
            link.visuals.extend(visuals);
        }
        let named = content.iter().filter(|geom| geom.is("geom"));
        let named = named.filter_map(|geom| Some((geom.name()?, world.to_owned())));
        self.contacts.bodies.extend(named);
        self.children(&content, world, &Isometry3::identity(), reader);
    }

    /// Adds the bodies, sites and cameras in a body. `shift` is the body's frame in the frame of
    /// its link.
    pub(super) fn children(
        &mut self,
        content: &[Item<'_>],
        link: &str,
        shift: &Isometry3<f64>,
        reader: &mut Reader,
    ) {
        let compiler = Rc::clone(&self.compiler);
        for item in content {
            let Item { node, class, .. } = *item;
            let shift = shift * item.shift;
            match node.tag_name().name() {
                "body" => self.body(item, link, &shift, reader),
                "site" | "camera" => {
                    let Some(name) = item.name() else { continue };
                    let attributes = compiler.attributes(node, class);
                    let pose = match item.is("camera") {
                        true => compiler.pose(&attributes, node, reader) * lens(),
                        false => compiler.site(&attributes, node, reader),
                    };
                    // A name that a body has, too, is that of the body's link.
                    let is_taken = self.bodies.contains(&name);
                    let ending = if is_taken { "_frame" } else { "" };
                    let name = self.unique(&format!("{name}{ending}"));
                    self.frame(&name, link, shift * pose, reader.place(node));
                }
                "attach" => self.attach(item, link, &shift, reader),
                "composite" | "flexcomp" => {
                    let name = node.tag_name().name();
                    let message = format!("`<{name}>` can't be simulated: its bodies are soft");
                    let help = "leave it out, or replace it by bodies that are rigid";
                    reader.error("W035", node, message, help);
                }
                _ => {}
            }
        }
    }

    /// Adds a body of another file.
    fn attach(&mut self, item: &Item<'_>, link: &str, shift: &Isometry3<f64>, reader: &mut Reader) {
        let node = item.node;
        let help = "or let MuJoCo write one file with all bodies: \
                    `mujoco.MjSpec.from_file(FILE)`, then `compile()` and `to_xml()`";
        let mut refused = |message: String| reader.error("W035", node, message, help);
        let name = node.attribute("model").unwrap_or_default();
        let Some(file) = self.compiler.models.get(name) else {
            return refused(format!(
                "`<asset>` has no `<model name=\"{name}\" file=\"…\"/>` to attach"
            ));
        };
        let folder = self.file.path.parent().unwrap_or(Path::new(""));
        let path = beside(self.file.lookup.files, folder, file);
        if self.file.depth >= DEEPEST {
            return refused(format!(
                "`{file}` is attached {DEEPEST} models deep: it may attach itself"
            ));
        }
        let source = match self.file.lookup.files.read(&path) {
            Ok(source) => source,
            Err(reason) => return refused(format!("cannot read {}: {reason}", path.display())),
        };
        let attached = File {
            path: &path,
            depth: self.file.depth + 1,
            ..self.file
        };
        let read = whole(&source, attached, self.purpose);
        let built = match read {
            Ok((built, text, said)) => {
                reader.found.extend(said);
                self.attached.borrow_mut().push_str(&text.text);
                built
            }
            Err(faults) => return reader.found.extend(faults),
        };
        let prefix = format!(
            "{}{}",
            node.attribute("prefix").unwrap_or_default(),
            item.suffix
        );
        let pose = {
            let attributes = self.compiler.attributes(node, item.class);
            shift * self.compiler.pose(&attributes, node, reader)
        };
        let body = node.attribute("body");
        // Its meshes are named from its own folder.
        let inside = path.parent().and_then(|own| own.strip_prefix(folder).ok());
        let folder = inside.map_or_else(String::new, |inside| inside.display().to_string());
        let graft = Graft {
            prefix: &prefix,
            folder: &folder,
            body,
        };
        match graft.of(built.tree) {
            Some(tree) => {
                self.contacts.attach(built.contacts, &prefix);
                let starts = built.starts.into_iter();
                self.starts
                    .extend(starts.map(|(joint, at)| (format!("{prefix}{joint}"), at)));
                self.graft(tree, link, &pose);
            }
            None => refused_body(node, body.unwrap_or_default(), &path, reader),
        }
    }

    /// Adds a tree to a link. Its root is dropped.
    fn graft(&mut self, tree: ModelTree, link: &str, pose: &Isometry3<f64>) {
        let mut links = tree.links.into_iter();
        let root = links.next();
        let root_name = root.as_ref().map(|root| root.name.clone());
        if let (Some(root), Some(own)) = (
            root,
            self.tree.links.iter_mut().find(|own| own.name == link),
        ) {
            let moved = |solid: TreeSolid| TreeSolid {
                pose: pose * solid.pose,
                ..solid
            };
            own.solids.extend(root.solids.into_iter().map(moved));
            own.visuals.extend(root.visuals.into_iter().map(moved));
        }
        for joint in tree.joints {
            unique(&mut self.joint_names, &joint.name);
            let is_first = Some(&joint.parent) == root_name.as_ref();
            let joint = self.driven(joint);
            self.tree.joints.push(if is_first {
                TreeJoint {
                    parent: link.to_owned(),
                    origin: pose * joint.origin,
                    ..joint
                }
            } else {
                joint
            });
        }
        for other in links {
            self.unique(&other.name);
            self.link(other);
        }
        self.tree.passing.extend(tree.passing);
        self.tree.inline_meshes.extend(tree.inline_meshes);
    }

    /// A joint of an attached model, with the effort and the range of this file's actuators.
    fn driven(&self, mut joint: TreeJoint) -> TreeJoint {
        if let Some(effort) = self.couplings.efforts.get(&joint.name) {
            let is_stated = joint.effort > 0.0 && joint.effort != EFFORT;
            joint.effort = if is_stated {
                joint.effort.min(*effort)
            } else {
                *effort
            };
        }
        let slides = joint.motion == TreeMotion::Prismatic;
        let is_free = match joint.motion {
            TreeMotion::Continuous => true,
            _ => slides && [joint.lower, joint.upper] == [-SLIDES_M, SLIDES_M],
        };
        if let Some(range) = self.couplings.ranges.get(&joint.name).filter(|_| is_free) {
            [joint.lower, joint.upper] = *range;
            if !slides {
                joint.motion = TreeMotion::Revolute;
            }
        }
        joint
    }

    pub(super) fn body(
        &mut self,
        item: &Item<'_>,
        parent: &str,
        shift: &Isometry3<f64>,
        reader: &mut Reader,
    ) {
        let compiler = Rc::clone(&self.compiler);
        let body = item.node;
        if !self.file.budget.enter(body, reader) {
            return;
        }
        let class = body.attribute("childclass").or(item.class);
        let place = reader.place(body);
        let name = item.name().unwrap_or_else(|| "body".to_owned());
        let name = self.unique(&name);
        let attributes = compiler.attributes(body, item.class);
        let mut at = shift * compiler.pose(&attributes, body, reader);
        let content = compiler.content(body, class, self.file.budget, reader);
        let inside: Vec<Item<'_>> = content
            .into_iter()
            .map(|inner| Item {
                suffix: format!("{}{}", inner.suffix, item.suffix),
                ..inner
            })
            .collect();
        // A body that moves freely is the whole robot or object.
        let is_free = |joint: &&Item| {
            joint.is("freejoint")
                || joint.is("joint")
                    && compiler.attributes(joint.node, joint.class).get("type") == Some("free")
        };
        let is_jointed = |joint: &Item| joint.is("joint") || joint.is("freejoint");
        self.own.insert(name.clone(), inside.iter().any(is_jointed));
        let joints: Vec<&Item> = inside
            .iter()
            .filter(|joint| joint.is("joint") && !is_free(joint))
            .collect();
        let mut from = parent.to_owned();
        // Position of the body's origin in the frame of its link.
        let mut own = Isometry3::identity();
        for (idx, joint) in joints.iter().enumerate() {
            let attributes = compiler.attributes(joint.node, joint.class);
            let anchor = attributes
                .get("pos")
                .and_then(|text| reader.numbers::<3>(joint.node, text, Bound::Within));
            let anchor = joint.shift * nalgebra::Point3::from(anchor.unwrap_or([0.0; 3]));
            let anchor = Translation3::from(anchor.coords);
            let link = if idx + 1 == joints.len() {
                name.clone()
            } else {
                self.unique(&format!("{name}_{}", idx + 1))
            };
            if idx + 1 < joints.len() {
                self.link(TreeLink::frame(link.clone(), reader.place(joint.node)));
            }
            if self
                .joint(joint, &attributes, [&from, &link], at * anchor, reader)
                .is_some()
            {
                (from, own) = (
                    link,
                    Isometry3::from_parts(anchor, UnitQuaternion::identity()).inverse(),
                );
                at = own;
            }
        }
        if joints.is_empty() {
            let free = inside.iter().any(|joint| is_free(&joint));
            let (motion, ending) = if free && self.purpose != Purpose::Object {
                (TreeMotion::Floating, "free")
            } else {
                (TreeMotion::Fixed, "fixed")
            };
            let own = unique(&mut self.joint_names, &format!("{name}_{ending}"));
            self.tree.joints.push(TreeJoint {
                motion,
                ..TreeJoint::fixed(own, [parent, &name], at, place.clone())
            });
        }
        let [solids, visuals] = self.geoms(&inside, &own, reader);
        if self.purpose == Purpose::Robot {
            let mut masks = BTreeSet::new();
            for geom in inside.iter().filter(|geom| geom.is("geom")) {
                let attributes = compiler.attributes(geom.node, geom.class);
                if collides(&attributes, &compiler) {
                    masks.insert(Mask::of(&attributes));
                }
                let bodies = &mut self.contacts.bodies;
                bodies.extend(geom.name().map(|geom| (geom, name.clone())));
            }
            self.contacts.masks.insert(name.clone(), masks);
        }
        let stated = inside
            .iter()
            .find(|inner| inner.is("inertial"))
            .filter(|_| compiler.masses.from_geoms != Some(true));
        let inertial = stated.and_then(|inner| inertial(inner, &own, &compiler, reader));
        self.link(TreeLink {
            name: name.clone(),
            inertial,
            solids,
            visuals,
            place,
        });
        self.children(&inside, &name, &own, reader);
        self.file.budget.leave();
    }

    /// Adds a joint. Returns `None` after it has reported a fault.
    fn joint(
        &mut self,
        item: &Item<'_>,
        attributes: &MjcfAttributes<'_>,
        [parent, child]: [&str; 2],
        origin: Isometry3<f64>,
        reader: &mut Reader,
    ) -> Option<()> {
        let joint = item.node;
        let (motion, slides) = match attributes.get("type").unwrap_or("hinge") {
            "hinge" => (TreeMotion::Revolute, false),
            "slide" => (TreeMotion::Prismatic, true),
            other => {
                let message = format!("a joint of the type {other} can't be simulated");
                reader.error(
                    "W035",
                    joint,
                    message,
                    "use `hinge` or `slide`; the joint of the whole model may be `free`",
                );
                return None;
            }
        };
        let name = item.name().unwrap_or_else(|| format!("{child}_joint"));
        let axis = attributes
            .get("axis")
            .map_or(Some([0.0, 0.0, 1.0]), |text| {
                reader.numbers(joint, text, Bound::Finite)
            })?;
        let axis = item.shift.rotation * Vector3::from(axis);
        let Some(direction) = Unit::try_new(axis, 1e-9) else {
            let message = format!("the axis of the joint `{name}` must not be zero");
            reader.error(
                "W034",
                joint,
                message,
                "write, for example, `axis=\"0 0 1\"`",
            );
            return None;
        };
        let names = [&name, joint.attribute("name").unwrap_or(&name)];
        let range = self.range(joint, attributes, (names, slides), reader);
        let (motion, [lower, upper]) = match (range, slides) {
            (Some(range), _) => (motion, range),
            (None, true) => (motion, [-SLIDES_M, SLIDES_M]),
            (None, false) => (TreeMotion::Continuous, [f64::NEG_INFINITY, f64::INFINITY]),
        };
        // A name that elements use counts for all copies of the joint.
        let written = joint.attribute("name").unwrap_or(&name);
        self.check_spring(joint, attributes, &name, reader);
        let start = self.couplings.start(&name);
        let origin = match start {
            0.0 => origin,
            _ if slides => origin * Translation3::from(direction.scale(-start)),
            _ => origin * UnitQuaternion::from_axis_angle(&direction, -start),
        };
        let place = reader.place(joint);
        let effort = self.effort(joint, attributes, [&name, written], reader);
        let unique = unique(&mut self.joint_names, &name);
        if !item.suffix.is_empty() {
            let copy = (written.to_owned(), item.suffix.clone());
            self.copies.insert(unique.clone(), copy);
        }
        self.tree.joints.push(TreeJoint {
            motion,
            axis,
            lower,
            upper,
            effort,
            velocity: VELOCITY[usize::from(slides)],
            damping: attributes.number("damping", reader).unwrap_or(0.0),
            // Robots overcome it with their motors.
            friction: attributes
                .number("frictionloss", reader)
                .filter(|_| self.purpose != Purpose::Robot)
                .unwrap_or(0.0),
            ..TreeJoint::fixed(unique, [parent, child], origin, place)
        });
        Some(())
    }

    /// Reports a spring: it is an error of an object, and an unknown force of a robot's motors.
    fn check_spring(
        &mut self,
        joint: Node,
        attributes: &MjcfAttributes<'_>,
        name: &str,
        reader: &mut Reader,
    ) {
        for key in ["springref", "ref"] {
            attributes.number(key, reader);
        }
        let stiffness = attributes.number("stiffness", reader).unwrap_or(0.0);
        let is_first = !self.has_springs;
        if stiffness <= 0.0 {
            return;
        }
        self.has_springs = true;
        if self.purpose != Purpose::Robot {
            let message = format!("the spring of the joint `{name}` can't be simulated");
            let help =
                "the model would be another one without it: remove `stiffness` if that is meant";
            reader.error("W035", joint, message, help);
        } else if is_first {
            let message = format!("the spring of the joint `{name}` is left out");
            let help = "springs decide only where closed loops leave a choice; those of other joints \
                        are left out, too";
            reader.warning("W036", joint, message, help);
        }
    }

    /// Returns the limits of a joint: its own, otherwise those of its position servo, if it has
    /// any.
    fn range(
        &self,
        joint: Node,
        attributes: &MjcfAttributes<'_>,
        ([name, written], slides): ([&str; 2], bool),
        reader: &mut Reader,
    ) -> Option<[f64; 2]> {
        let range = self
            .compiler
            .limits(joint, attributes, ["range", "limited"], reader);
        let unit = if slides { 1.0 } else { self.compiler.angle };
        let own = range.map(|range| range.map(|end| end * unit));
        let of_servo = &self.couplings.ranges;
        own.or_else(|| of_servo.get(name).or(of_servo.get(written)).copied())
    }

    /// Returns the largest effort of a joint: that of its actuators, but at most its own limit.
    fn effort(
        &self,
        joint: Node,
        attributes: &MjcfAttributes<'_>,
        [name, written]: [&str; 2],
        reader: &mut Reader,
    ) -> f64 {
        let keys = ["actuatorfrcrange", "actuatorfrclimited"];
        let own = self.compiler.limits(joint, attributes, keys, reader);
        let own = own.map(|[lower, upper]| f64::max(-lower, upper));
        let efforts = &self.couplings.efforts;
        let of_actuators = efforts.get(name).or(efforts.get(written)).copied();
        let effort = [own, of_actuators]
            .into_iter()
            .flatten()
            .filter(|effort| *effort > 0.0)
            .reduce(f64::min);
        let is_passive = [name, written].map(|name| self.couplings.is_passive(name));
        let unstated = if is_passive == [true; 2] { 0.0 } else { EFFORT };
        effort.unwrap_or(unstated)
    }

    /// Gives each body of this file without a stated mass that of its geoms, and applies the rules of
    /// `<compiler>`. Those of attached models have been weighed by their own rules, but the mass of
    /// the whole is that of all bodies.
    pub(super) fn weigh(&mut self, reader: &mut Reader) {
        let rules = Rc::clone(&self.compiler);
        let from_geoms = rules.masses.from_geoms != Some(false);
        let mut meshes = BTreeMap::new();
        let mut shapes = self.shapes();
        let mut masses = MeshMasses::default();
        let mut weighed = BTreeMap::new();
        let tree = &self.tree;
        let own = tree
            .links
            .iter()
            .filter(|link| link.inertial.is_none())
            .filter_map(|link| Some((link, *self.own.get(&link.name)?)));
        for (link, moves) in own {
            let geoms = link.solids.iter().chain(&link.visuals);
            let heavy = geoms.filter(|geom| from_geoms && geom.matter.is_some());
            for geom in heavy.clone() {
                shapes.load(geom, tree, &mut meshes, &mut reader.found);
                let spread = geom.matter.map_or(Spread::Inside, |matter| matter.spread);
                let unit = masses.of_unit(&geom.geometry, spread, &meshes);
                if spread == Spread::Exact && unit.is_some_and(|unit| unit.kg <= 0.0) {
                    let message =
                        "this mesh has no exact inertia: its triangles are turned inwards";
                    let help = "write `inertia=\"legacy\"` at its `<mesh>`, or turn its triangles";
                    let place = xml::at_tag(&geom.place);
                    reader.error_in("W037", place, message.to_owned(), help);
                }
            }
            let SolidMass { kg, com, about_com } = masses.together(heavy, &meshes);
            if kg > 0.0 || rules.masses.least[0] > 0.0 {
                let inertial = TreeInertial {
                    pose: Isometry3::translation(com.x, com.y, com.z),
                    kg,
                    about_com,
                    place: link.place.clone(),
                    moments_place: None,
                };
                weighed.insert(link.name.clone(), inertial);
            } else if !from_geoms && moves {
                let message = format!("the body `{}` moves and has no mass", link.name);
                let help =
                    "add an `<inertial>`: with `inertiafromgeom=\"false\"`, geoms have no mass";
                reader.error_in("W033", xml::at_tag(&link.place), message, help);
            }
        }
        for link in &mut self.tree.links {
            if let Some(inertial) = weighed.remove(&link.name) {
                link.inertial = Some(inertial);
            }
            if let Some(inertial) = &mut link.inertial
                && self.own.contains_key(&link.name)
            {
                rules.masses.apply(inertial);
            }
        }
        let inertials = self.tree.links.iter_mut();
        let inertials: Vec<&mut TreeInertial> = inertials
            .filter_map(|link| link.inertial.as_mut())
            .collect();
        let total: f64 = inertials.iter().map(|inertial| inertial.kg).sum();
        let wanted = rules.masses.total_kg;
        if let Some(wanted) = wanted.filter(|_| total > 0.0 && self.file.depth == 0) {
            for inertial in inertials {
                inertial.kg *= wanted / total;
                inertial.about_com *= wanted / total;
            }
        }
    }
}

fn refused_body(node: Node, body: &str, path: &Path, reader: &mut Reader) {
    let message = format!("{} has no body `{body}` to attach", path.display());
    reader.error(
        "W035",
        node,
        message,
        "name one of its bodies, or leave out `body`",
    );
}

/// Reads the mass of an `<inertial>`. Returns `None` after it has reported a fault.
fn inertial(
    item: &Item<'_>,
    own: &Isometry3<f64>,
    compiler: &Compiler,
    reader: &mut Reader,
) -> Option<TreeInertial> {
    let node = item.node;
    let attributes = compiler.attributes(node, item.class);
    let pose = own * item.shift * compiler.pose(&attributes, node, reader);
    let written = reader.attribute(node, "mass")?;
    let [kg] = reader.numbers::<1>(node, written, Bound::Mass)?;
    let about_com = match (attributes.get("fullinertia"), attributes.get("diaginertia")) {
        (Some(text), _) => {
            let [xx, yy, zz, xy, xz, yz] = reader.numbers(node, text, Bound::Within)?;
            Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
        }
        (None, Some(text)) => Matrix3::from_diagonal(&Vector3::from(reader.numbers::<3>(
            node,
            text,
            Bound::Within,
        )?)),
        (None, None) if kg > 0.0 => {
            let message = "`<inertial>` has neither `diaginertia` nor `fullinertia`".to_owned();
            reader.error("W033", node, message, "write `diaginertia=\"XX YY ZZ\"`");
            return None;
        }
        (None, None) => Matrix3::zeros(),
    };
    let place = reader.place(node);
    Some(TreeInertial {
        pose,
        kg,
        about_com,
        moments_place: Some(place.clone()),
        place,
    })
}

/// Our camera frame in MuJoCo's, in which the view is along -z and y is up.
fn lens() -> Isometry3<f64> {
    let axes = Matrix3::from_columns(&[-Vector3::z(), -Vector3::x(), Vector3::y()]);
    let turned = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    Isometry3::from_parts(Translation3::identity(), turned)
}
