//! The suction cup: when its seal forms, the force that it carries, and when it breaks.
//!
//! A seal is a joint with the stiffness of a soft lip between the cup's link and the body that it
//! holds, from the moment at which the whole lip lies on the body. The engine's solver gives the
//! force of the joint; beyond the cup's limits, the joint is removed.

use nalgebra::{Isometry3, Point3, Vector3};
use parry3d::query::Ray;
use rapier3d::prelude::{
    Collider, GenericJoint, ImpulseJointHandle, JointAxesMask, JointAxis, MotorModel, PhysicsWorld,
    SpringCoefficients,
};

use crate::bodies::Bodies;
use crate::contacts::{CONTACT_FLOOR_NEWTONS, Touch};
use crate::physics::{Owner, collider};
use actcheck_data::{CupState, ObjectModel, Part, Pose, Suction};
use actcheck_geometry::{from_vector, to_pose, to_real, to_vector};

/// Distance of a surface from the lip that the soft lip bridges. Unit: metres. A few millimetres
/// for cups of some centimetres.
const LIP_M: f64 = 0.003;
/// Angle between a surface and the plane of the lip that the lip still follows. Unit: cosine (of 10
/// degrees). A ball or a can that is less than six cups wide is too curved.
const FLAT_COSINE: f64 = 0.985;
/// Rays along the rim. With the one in the middle, they find edges and holes of more than half a
/// radius.
const N_RAYS: u32 = 8;
/// Natural frequency of a body on the soft lip. Unit: hertz. Under its weight, a body sags by 1.1
/// mm.
const LIP_FREQUENCY_HZ: f32 = 15.0;
/// Tilt at which the lip resists with the greatest peel moment of the seal. Unit: radians. A
/// stiffer lip would break where the hand presses a box that is not quite level on a table.
const GIVE_RAD: f64 = 0.1;
/// Ratio of the lip's damping to its stiffness against tilts. Unit: seconds. A box of 1 kg then
/// swings only once.
const GIVE_SECS: f64 = 0.1;
/// Axes about which the lip gives.
const TILTS: [JointAxis; 3] = [JointAxis::AngX, JointAxis::AngY, JointAxis::AngZ];
/// Distance behind the lip at which rays start. Unit: metres. The lip may be pressed into a surface
/// by some millimetres.
const BEHIND_M: f64 = 0.01;
/// An opening below this switches the vacuum on. Unit: metres.
const ON_M: f64 = 1e-3;

/// The vacuum of a cup.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
enum Vacuum {
    /// Switched off.
    #[default]
    Off,
    /// Switched on, with air coming in: a seal forms as soon as the lip lies on a surface.
    Open,
    /// A body is sealed.
    Sealed(Seal),
    /// The seal broke. A new one forms only after the vacuum was off.
    Broken,
}

/// The seal between the cup and a body.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Seal {
    joint: ImpulseJointHandle,
    /// Index of the object.
    object: usize,
    /// Mean load in the control tick so far, or in the last one.
    load: Load,
}

/// The load of a seal. Frame: of the lip, with x along the cup's axis away from the cup.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Load {
    /// Force of the body on the cup: positive along x where it pulls. Unit: newtons.
    pub(super) force_n: Vector3<f64>,
    /// Moment about the middle of the lip. Unit: newton metres.
    pub(super) moment_nm: Vector3<f64>,
}

impl Load {
    /// Returns whether a seal with this pull limit breaks. A body that pushes presses the lip on
    /// it, as the vacuum does.
    pub(super) fn breaks(&self, cup: &Suction, limit_n: f64) -> bool {
        let pressed_n = limit_n + (-self.force_n.x).max(0.0);
        let shear_n = self.force_n.yz().norm();
        let peel_nm = self.moment_nm.yz().norm();
        self.force_n.x > limit_n
            || shear_n > cup.most_shear_n(pressed_n)
            || peel_nm > cup.most_peel_nm(pressed_n)
    }
}

/// The suction cup of a robot.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cup {
    suction: Suction,
    vacuum: Vacuum,
    /// Greatest pull at the commanded vacuum. Unit: newtons.
    limit_n: f64,
}

impl Cup {
    /// A cup without vacuum.
    pub(super) fn new(suction: Suction) -> Self {
        Self {
            suction,
            vacuum: Vacuum::Off,
            limit_n: suction.force_n,
        }
    }

    /// Returns the opening of a gripper with the same command: 0 while the vacuum is on, otherwise
    /// the cup's diameter. Unit: metres.
    pub(super) fn opening_m(&self) -> f64 {
        if self.vacuum == Vacuum::Off {
            2.0 * self.suction.radius_m
        } else {
            0.0
        }
    }

    /// Returns the force with which the vacuum presses the lip on a body: 0 without a seal. Unit:
    /// newtons.
    pub(super) fn suction_n(&self) -> f64 {
        if matches!(self.vacuum, Vacuum::Sealed(_)) {
            self.limit_n
        } else {
            0.0
        }
    }

    fn seal(&self) -> Option<&Seal> {
        match &self.vacuum {
            Vacuum::Sealed(seal) => Some(seal),
            _ => None,
        }
    }

    /// Returns the state of the cup.
    pub(super) fn state(&self) -> CupState {
        let pull_n = self.seal().map_or(0.0, |seal| seal.load.force_n.x);
        CupState {
            force_n: self.limit_n,
            pull_n,
        }
    }

    /// Switches the vacuum on or off, by the commanded opening and force.
    pub(super) fn switch(&mut self, physics: &mut PhysicsWorld, opening_m: f64, force_n: f64) {
        self.limit_n = force_n.clamp(0.0, self.suction.force_n);
        match (opening_m < ON_M, self.vacuum) {
            (true, Vacuum::Off) => self.vacuum = Vacuum::Open,
            (true, _) | (false, Vacuum::Off) => {}
            (false, _) => {
                self.cut_seal(physics);
                self.vacuum = Vacuum::Off;
            }
        }
    }

    /// Returns the object that the cup holds, by its index.
    pub(super) fn sealed(&self) -> Option<usize> {
        self.seal().map(|seal| seal.object)
    }

    /// Seals the surface at the lip, if the cup is open and there is one.
    pub(super) fn seal_surface(&mut self, bodies: &mut Bodies) {
        if self.vacuum != Vacuum::Open {
            return;
        }
        let lip = bodies.robot.kinematics.grasp(&bodies.robot.positions);
        let objects = bodies.objects.iter().enumerate();
        let solids = objects.flat_map(|(idx, object)| {
            bodies
                .colliders_of(object.body)
                .map(move |solid| (idx, solid))
        });
        let solids: Vec<(usize, &Collider)> = solids.collect();
        let Some(object) = surface_at(&lip, self.suction.radius_m, &solids) else {
            return;
        };
        let (link, body) = (bodies.robot.finger_links[0], bodies.objects[object].body);
        let from_link =
            bodies.robot.kinematics.links(&bodies.robot.positions)[link].inverse() * lip;
        let from_body = bodies.pose_of(&bodies.objects[object]).inverse() * lip;
        let mut data = lip_joint(&self.suction);
        data.set_local_frame1(to_pose(&from_link))
            .set_local_frame2(to_pose(&from_body));
        let joint =
            bodies
                .physics
                .impulse_joints
                .insert(bodies.robot.bodies[link], body, data, true);
        self.vacuum = Vacuum::Sealed(Seal {
            joint,
            object,
            load: Load::default(),
        });
    }

    /// Measures the load of the seal in a step that is this share of its control tick.
    pub(super) fn measure_seal(&mut self, physics: &PhysicsWorld, share: f64, begins_tick: bool) {
        let Vacuum::Sealed(seal) = &mut self.vacuum else {
            return;
        };
        let Some(joint) = physics.impulse_joints.get(seal.joint) else {
            return;
        };
        let parameters = &physics.integration_parameters;
        // The engine keeps the impulses of the last substep.
        let per_second = parameters.num_solver_iterations as f64 / f64::from(parameters.dt);
        let impulse = |coordinate: usize| f64::from(joint.impulses[coordinate]);
        let force_n = Vector3::new(impulse(0), impulse(1), impulse(2)) * (per_second * share);
        let turns = TILTS.map(|axis| f64::from(joint.data.motors[axis as usize].impulse));
        let moment_nm = Vector3::from(turns) * (per_second * share);
        if begins_tick {
            seal.load = Load::default();
        }
        seal.load.force_n += force_n;
        seal.load.moment_nm += moment_nm;
    }

    /// Breaks the seal at the end of a control tick if its mean load in the tick exceeds its
    /// limits: air needs some milliseconds to come in.
    pub(super) fn judge_seal(&mut self, physics: &mut PhysicsWorld) {
        let breaks = self
            .seal()
            .is_some_and(|seal| seal.load.breaks(&self.suction, self.limit_n));
        if breaks {
            self.cut_seal(physics);
            self.vacuum = Vacuum::Broken;
        }
    }

    fn cut_seal(&self, physics: &mut PhysicsWorld) {
        if let Some(seal) = self.seal() {
            physics.impulse_joints.remove(seal.joint, true);
        }
    }

    /// Returns the seal as the contact of a pair of owners. Returns `None` without a seal.
    pub(super) fn touch(&self, bodies: &Bodies) -> Option<((Owner, Owner), Touch)> {
        let seal = self.seal()?;
        let lip = bodies.robot.kinematics.grasp(&bodies.robot.positions);
        let force_n = lip.rotation * seal.load.force_n;
        let pair = (
            Owner::Object(seal.object),
            Owner::Link(bodies.robot.finger_links[0]),
        );
        let normal_n = force_n.norm().max(2.0 * CONTACT_FLOOR_NEWTONS);
        Some((
            pair,
            Touch::at(normal_n, force_n, lip.translation.vector.into()),
        ))
    }
}

/// Returns the joint of a seal, with its frames at the lip still to be set.
fn lip_joint(cup: &Suction) -> GenericJoint {
    let mut data = GenericJoint::new(JointAxesMask::LIN_AXES);
    data.softness = SpringCoefficients {
        natural_frequency: LIP_FREQUENCY_HZ,
        damping_ratio: 1.0,
    };
    let stiffness = cup.most_peel_nm(cup.force_n) / GIVE_RAD;
    for axis in TILTS {
        data.set_motor_model(axis, MotorModel::ForceBased);
        // The engine's angle is that of a quaternion: half of the tilt.
        data.set_motor(
            axis,
            0.0,
            0.0,
            to_real(2.0 * stiffness),
            to_real(GIVE_SECS * stiffness),
        );
    }
    // The joint carries the push of the lip too: a contact would fight it.
    data.set_contacts_enabled(false);
    data
}

/// Returns the owner of the surface on which the whole lip lies, of solids with their owners.
fn surface_at(lip: &Isometry3<f64>, radius_m: f64, solids: &[(usize, &Collider)]) -> Option<usize> {
    let rim = (0..N_RAYS).map(|idx| {
        let angle = std::f64::consts::TAU * f64::from(idx) / f64::from(N_RAYS);
        Vector3::new(
            0.0,
            radius_m * libm::cos(angle),
            radius_m * libm::sin(angle),
        )
    });
    let mut under = None;
    for offset in rim.chain([Vector3::zeros()]) {
        let owner = surface_before(lip, &offset, solids)?;
        if *under.get_or_insert(owner) != owner {
            return None;
        }
    }
    under
}

/// Returns the owner of the surface that is at a point of the lip and parallel to it.
fn surface_before(
    lip: &Isometry3<f64>,
    offset: &Vector3<f64>,
    solids: &[(usize, &Collider)],
) -> Option<usize> {
    let axis = lip.rotation * Vector3::x();
    let from = lip * Point3::from(offset - Vector3::x() * BEHIND_M);
    let ray = Ray::new(to_vector(&from.coords), to_vector(&axis));
    let mut nearest: Option<(f64, Vector3<f64>, usize)> = None;
    for (owner, solid) in solids {
        let most = to_real(BEHIND_M + LIP_M);
        let Some(hit) = solid
            .shape()
            .cast_ray_and_get_normal(solid.position(), &ray, most, true)
        else {
            continue;
        };
        let along = f64::from(hit.time_of_impact);
        if nearest.is_none_or(|(known, ..)| along < known) {
            nearest = Some((along, from_vector(hit.normal), *owner));
        }
    }
    let (along, normal, owner) = nearest?;
    let fits = (along - BEHIND_M).abs() <= LIP_M && -normal.dot(&axis) >= FLAT_COSINE;
    fits.then_some(owner)
}

/// Returns whether a cup seals on a model, with its lip at a pose in the model's frame.
pub fn would_seal(model: &ObjectModel, lip: &Pose, cup: &Suction) -> bool {
    let parts = model.parts.iter().flat_map(Part::solids);
    let built: Vec<Collider> = parts
        .filter_map(|solid| Some(collider(&solid, Owner::Object(0), 0.0, 0.0)?.build()))
        .collect();
    let solids: Vec<(usize, &Collider)> = built.iter().map(|solid| (0, solid)).collect();
    surface_at(&lip.to_isometry(), cup.radius_m, &solids).is_some()
}
