//! Makes the simulated tree of a model's tree: movable links, with fixed links and those of joints
//! without a role merged into them.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Unit, Vector3};

use crate::RobotError;
use crate::assumed::{assume_efforts, assume_speeds, widen_followers};
use crate::counterweight::balance;
use crate::description::{Joint, JointKind, Link, RobotModel};
use crate::kinematics::motion;
use crate::mechanism::lead_with_carriers;
use crate::needed::Needed;
use actcheck_data::{
    LEAST_LINK_KG, Mesh, ModelTree, Part, Pose, RobotCore, RobotRoles, Shape, TreeGeometry,
    TreeJoint, TreeLink, TreeMotion, bounds,
};
use actcheck_geometry::Material;

/// Moment of inertia of links lighter than [`LEAST_LINK_KG`]: that of a ball of this mass with a
/// radius of 1 cm. Unit: kg·m².
const LEAST_INERTIA: f64 = 4e-7;

impl RobotModel {
    /// Reads a robot with these roles: joints without one are rigid.
    ///
    /// # Errors
    /// [`RobotError`] if the robot is not a single tree, or has unsupported joints.
    pub fn read(roles: RobotRoles<'_>) -> Result<Self, RobotError> {
        Folding::new(roles.core)?.fold(roles.core, Some(roles))
    }

    /// Reads a robot whose roles are not known yet: all joints move, but those that are parked.
    ///
    /// # Errors
    /// As [`RobotModel::read`].
    pub fn without_roles(core: &RobotCore) -> Result<Self, RobotError> {
        Folding::new(core)?.fold(core, None)
    }
}

/// The state while merging a URDF's links.
struct Folding<'a> {
    robot: &'a ModelTree,
    links: BTreeMap<&'a str, &'a TreeLink>,
    children: BTreeMap<&'a str, Vec<&'a TreeJoint>>,
    /// Solids by mesh file.
    meshes: &'a BTreeMap<String, Vec<Shape>>,
    /// The meshes that they are pieces of.
    surfaces: &'a BTreeMap<String, Vec<Arc<Mesh>>>,
    out: RobotModel,
}

impl<'a> Folding<'a> {
    fn new(core: &'a RobotCore) -> Result<Self, RobotError> {
        let (robot, name) = (&*core.tree, core.urdf.name.to_string());
        if robot.links.is_empty() {
            let reason = "it has no links".to_owned();
            return Err(RobotError::Urdf { name, reason });
        }
        let links = robot
            .links
            .iter()
            .map(|link| (link.name.as_str(), link))
            .collect();
        let mut children: BTreeMap<&str, Vec<&TreeJoint>> = BTreeMap::new();
        let mut parents: BTreeMap<&str, &str> = BTreeMap::new();
        for joint in &robot.joints {
            if parents
                .insert(joint.child.as_str(), joint.parent.as_str())
                .is_some()
            {
                let reason = format!("the link `{}` has two parents", joint.child);
                return Err(RobotError::Urdf { name, reason });
            }
            children
                .entry(joint.parent.as_str())
                .or_default()
                .push(joint);
        }
        let out = RobotModel {
            links: Vec::new(),
            joints: Vec::new(),
            frames: BTreeMap::new(),
            shapes: BTreeMap::new(),
            floats: robot
                .joints
                .iter()
                .any(|joint| joint.motion == TreeMotion::Floating),
            own_leaders: BTreeMap::new(),
            passing: BTreeSet::new(),
            rigid: Vec::new(),
            balanced: Vec::new(),
            assumed: Vec::new(),
            assumed_speeds: Vec::new(),
            name,
        };
        Ok(Self {
            robot,
            links,
            children,
            meshes: &core.meshes,
            surfaces: &core.surfaces,
            out,
        })
    }

    fn fold(
        mut self,
        core: &RobotCore,
        roles: Option<RobotRoles<'_>>,
    ) -> Result<RobotModel, RobotError> {
        let is_child = |name: &str| self.robot.joints.iter().any(|joint| joint.child == name);
        let roots: Vec<&str> = self
            .robot
            .links
            .iter()
            .map(|link| link.name.as_str())
            .filter(|name| !is_child(name))
            .collect();
        let [root] = roots.as_slice() else {
            let reason = format!("it has {} roots instead of one", roots.len());
            return Err(RobotError::Urdf {
                name: self.out.name,
                reason,
            });
        };
        if let (true, Some(names)) = (core.planar_base, &core.base_joints) {
            self.add_planar_base(names);
        }
        let needed = Needed::of(core, roles);
        self.out.links.push(Link::empty(root));
        // Links whose children are still to be visited, with the merged link that they belong to.
        let mut open = vec![(*root, self.out.links.len() - 1, Isometry3::identity())];
        while let Some((name, into, at)) = open.pop() {
            self.merge(
                name,
                into,
                &at,
                !core
                    .no_collision_links
                    .iter()
                    .any(|without| without == name),
            )?;
            for joint in self
                .children
                .get(name)
                .cloned()
                .unwrap_or_default()
                .into_iter()
                .rev()
            {
                let origin = at * joint.origin;
                if is_rigid(joint) {
                    open.push((&joint.child, into, origin));
                } else if !needed.contains(joint) {
                    let rigid = self.movable(joint, into, origin)?;
                    self.out.rigid.push(joint.name.clone());
                    open.push((
                        &joint.child,
                        into,
                        origin * motion(&rigid, needed.rest(joint)),
                    ));
                } else {
                    self.out.joints.push(self.movable(joint, into, origin)?);
                    self.out.links.push(Link::empty(&joint.child));
                    open.push((
                        &joint.child,
                        self.out.links.len() - 1,
                        Isometry3::identity(),
                    ));
                }
            }
        }
        self.resolve_mimics(&needed)?;
        let link = |name: &str| self.out.frames.get(name).map(|(link, _)| *link);
        let pairs = self
            .robot
            .passing
            .iter()
            .filter_map(|[a, b]| Some((link(a)?, link(b)?)));
        self.out.passing = pairs
            .filter(|(a, b)| a != b)
            .map(|(a, b)| (a.min(b), a.max(b)))
            .collect();
        for link in &mut self.out.links {
            if link.mass == 0.0 {
                link.weigh();
            }
            if link.mass < LEAST_LINK_KG {
                link.mass = LEAST_LINK_KG;
                link.inertia = Matrix3::identity() * LEAST_INERTIA;
            }
        }
        if let Some(roles) = roles {
            self.out.assumed = assume_efforts(&mut self.out.joints);
            self.out.assumed_speeds = assume_speeds(&mut self.out.joints);
            balance(&mut self.out, roles.arm_joints);
        }
        Ok(self.out)
    }

    /// Adds an omnidirectional base below the URDF's root, with the speeds and efforts of the
    /// mobile manipulator.
    fn add_planar_base(&mut self, names: &[String; 3]) {
        let axes = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()];
        for (parent, (name, axis)) in names.iter().zip(axes).enumerate() {
            let turns = parent == 2;
            self.out.links.push(Link::empty(name));
            self.out.joints.push(Joint {
                name: name.clone(),
                kind: if turns {
                    JointKind::Revolute
                } else {
                    JointKind::Prismatic
                },
                parent,
                origin: Isometry3::identity(),
                axis,
                lower: f64::NEG_INFINITY,
                upper: f64::INFINITY,
                effort: if turns { 150.0 } else { 400.0 },
                velocity: if turns { 1.0 } else { 0.25 },
                damping: 1.0,
                mimic: None,
            });
        }
    }

    /// Merges a URDF link into a movable link: mass, inertia (by the parallel axis theorem) and
    /// shapes, if it has them.
    fn merge(
        &mut self,
        name: &str,
        into: usize,
        at: &Isometry3<f64>,
        has_shapes: bool,
    ) -> Result<(), RobotError> {
        self.out.frames.insert(name.to_owned(), (into, *at));
        let Some(source) = self.links.get(name) else {
            let reason = format!("a joint refers to a missing link `{name}`");
            return Err(RobotError::Urdf {
                name: self.out.name.clone(),
                reason,
            });
        };
        let added = match &source.inertial {
            None => Mass::NONE,
            Some(stated) => {
                let inertial = at * stated.pose;
                let turned = inertial.rotation.to_rotation_matrix();
                Mass {
                    mass: stated.kg,
                    com: inertial.translation.vector,
                    inertia: turned.matrix() * stated.about_com * turned.matrix().transpose(),
                }
            }
        };
        let mut solids: Vec<Part> = Vec::new();
        let mut materials = Vec::new();
        let before = self.out.links[into].solids.len();
        for collision in source.solids.iter().filter(|_| has_shapes) {
            let origin = at * collision.pose;
            let pose = Pose::from_isometry(&origin);
            let shapes = self.shapes(&collision.geometry, name)?;
            let first = before + solids.len();
            solids.extend(shapes.into_iter().map(|shape| Part { pose, shape }));
            let pieces = first..before + solids.len();
            materials.extend(
                self.material(&collision.geometry, origin)
                    .map(|of| (pieces, Arc::new(of))),
            );
        }
        let link = &mut self.out.links[into];
        link.materials.extend(materials);
        let sum = Mass {
            mass: link.mass,
            com: link.com,
            inertia: link.inertia,
        }
        .plus(&added);
        (link.mass, link.com, link.inertia) = (sum.mass, sum.com, sum.inertia);
        let first = link.solids.len();
        link.solids.extend(solids);
        if link.solids.len() > first {
            self.out
                .shapes
                .insert(name.to_owned(), (into, first..link.solids.len()));
        }
        Ok(())
    }

    /// Returns the solids of a collision geometry: a primitive, or the pieces of a mesh.
    fn shapes(&self, geometry: &TreeGeometry, link: &str) -> Result<Vec<Shape>, RobotError> {
        let TreeGeometry::Mesh { file, scale } = geometry else {
            return Ok(geometry.solid().into_iter().collect());
        };
        let solids = self
            .meshes
            .get(file)
            .ok_or_else(|| RobotError::Unsupported {
                name: self.out.name.clone(),
                what: format!("the mesh {file} of `{link}`, which was not loaded,"),
            })?;
        Ok(solids.iter().map(|solid| solid.scaled(*scale)).collect())
    }

    /// Returns the mesh of a collision geometry, as its file has it; `None` for a primitive.
    fn material(&self, geometry: &TreeGeometry, origin: Isometry3<f64>) -> Option<Material> {
        let TreeGeometry::Mesh { file, scale } = geometry else {
            return None;
        };
        let mesh = match self.surfaces.get(file).map(Vec::as_slice) {
            Some([only]) => Arc::clone(only),
            Some(several) => Arc::new(joined(several)),
            // Not yet divided.
            None => match self.meshes.get(file)?.first()? {
                Shape::Mesh { mesh } => Arc::new(mesh.clone()),
                _ => return None,
            },
        };
        Some(Material::new(mesh, *scale, origin))
    }

    fn movable(
        &self,
        joint: &TreeJoint,
        parent: usize,
        origin: Isometry3<f64>,
    ) -> Result<Joint, RobotError> {
        let kind = match joint.motion {
            TreeMotion::Prismatic => JointKind::Prismatic,
            TreeMotion::Revolute | TreeMotion::Continuous => JointKind::Revolute,
            _ => {
                let what = format!("the type of joint `{}`", joint.name);
                return Err(RobotError::Unsupported {
                    name: self.out.name.clone(),
                    what,
                });
            }
        };
        Ok(Joint {
            name: joint.name.clone(),
            kind,
            parent,
            origin,
            axis: Unit::try_new(joint.axis, 1e-9).unwrap_or(Vector3::x_axis()),
            lower: joint.lower,
            upper: joint.upper,
            effort: joint.effort,
            velocity: reachable(joint.velocity, joint.effort, joint.damping),
            damping: joint.damping,
            mimic: None,
        })
    }

    fn resolve_mimics(&mut self, needed: &Needed<'_>) -> Result<(), RobotError> {
        let moves = |joint: &&TreeJoint| !is_rigid(joint) && needed.contains(joint);
        for joint in self.robot.joints.iter().filter(moves) {
            let Some(mimic) = &joint.mimic else { continue };
            let (follower, leader) = (self.out.joint(&joint.name)?, self.out.joint(&mimic.leader)?);
            self.out.joints[follower].mimic = Some((leader, mimic.factor, mimic.offset));
        }
        // Each follows the joint at the end of its chain: the engine closes one coupling better
        // than two.
        for idx in 0..self.out.joints.len() {
            if let (Some(_), (leader, factor, offset)) =
                (self.out.joints[idx].mimic, self.out.leader_of(idx))
            {
                self.out.joints[idx].mimic = Some((leader, factor, offset));
            }
        }
        lead_with_carriers(&mut self.out);
        widen_followers(&mut self.out.joints);
        Ok(())
    }
}

/// Several meshes as one.
fn joined(meshes: &[Arc<Mesh>]) -> Mesh {
    let mut all = Mesh::default();
    for mesh in meshes {
        let before = u32::try_from(all.vertices.len()).unwrap_or(u32::MAX);
        all.vertices.extend(&mesh.vertices);
        all.triangles.extend(
            mesh.triangles
                .iter()
                .map(|corners| corners.map(|idx| idx.saturating_add(before))),
        );
    }
    all
}

/// Density of links without `<inertial>`: that of water. Unit: kg/m³.
const DENSITY: f64 = 1000.0;

impl Link {
    /// Gives the link the mass of water with the volume of its shapes, spread over the box around
    /// them.
    fn weigh(&mut self) {
        if self.solids.is_empty() {
            return;
        }
        let (low, high) = bounds(&self.solids);
        let sizes = (high - low).component_mul(&(high - low));
        self.mass = DENSITY
            * self
                .solids
                .iter()
                .map(|part| part.shape.volume())
                .sum::<f64>();
        self.com = (low + high) / 2.0;
        let spread = Vector3::new(sizes.y + sizes.z, sizes.x + sizes.z, sizes.x + sizes.y);
        self.inertia = Matrix3::from_diagonal(&(spread * self.mass / 12.0));
    }
}

/// Mass, centre of mass, and inertia tensor about it.
struct Mass {
    mass: f64,
    com: Vector3<f64>,
    inertia: Matrix3<f64>,
}

impl Mass {
    const NONE: Self = Self {
        mass: 0.0,
        com: Vector3::new(0.0, 0.0, 0.0),
        inertia: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    };

    fn plus(&self, other: &Self) -> Self {
        let mass = self.mass + other.mass;
        if mass <= 0.0 {
            return Self {
                mass: 0.0,
                com: Vector3::zeros(),
                inertia: Matrix3::zeros(),
            };
        }
        let com = (self.com * self.mass + other.com * other.mass) / mass;
        Self {
            mass,
            com,
            inertia: self.about(&com) + other.about(&com),
        }
    }

    fn about(&self, point: &Vector3<f64>) -> Matrix3<f64> {
        let d = self.com - point;
        self.inertia + (Matrix3::identity() * d.norm_squared() - d * d.transpose()) * self.mass
    }
}

/// Whether a joint does not move: it is fixed, or moves the whole robot over the floor, which a
/// profile's `base` does.
fn is_rigid(joint: &TreeJoint) -> bool {
    matches!(
        joint.motion,
        TreeMotion::Fixed | TreeMotion::Planar | TreeMotion::Floating
    )
}

/// Share of a motor's largest effort with which it moves steadily; the rest accelerates and
/// carries.
const STEADY_SHARE: f64 = 0.75;

/// The largest velocity that a motor can reach against viscous friction. Many published models have
/// a friction with which their velocity limit can't be reached.
fn reachable(limit: f64, effort: f64, damping: f64) -> f64 {
    if damping > 0.0 && effort > 0.0 {
        limit.min(STEADY_SHARE * effort / damping)
    } else {
        limit
    }
}
