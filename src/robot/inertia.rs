//! The robot's mass matrix, and the forces of gravity and of its own motion on the joints.

use std::cell::OnceCell;

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

use crate::description::{JointKind, RobotModel};
use crate::factor::Factor;
use crate::kinematics::{GRAVITY, axis_in_world, holding_efforts};

/// The robot's dynamics at one moment.
pub struct Inertias {
    /// Mass matrix, row by row. Units: kilograms or kg·m².
    pub mass: Vec<f64>,
    /// Efforts that keep all joints at their velocities: against gravity, centrifugal and Coriolis
    /// forces.
    pub bias: Vec<f64>,
    /// Motion of each joint at unit velocity.
    axes: Vec<Twist>,
    /// The factor of the mass matrix, once it is needed.
    factor: OnceCell<Factor>,
}

impl Inertias {
    /// Sets the momenta of the joints to those at these velocities.
    pub fn momenta(&self, velocities: &[f64], momenta: &mut Vec<f64>) {
        let rows = self.mass.chunks(velocities.len().max(1));
        momenta.clear();
        momenta.extend(rows.map(|row| row.iter().zip(velocities).map(|(a, b)| a * b).sum::<f64>()));
    }

    /// Adds the inertia of each joint's motor.
    pub fn with_rotors(mut self, armatures: impl Iterator<Item = f64>) -> Self {
        let n_joints = self.bias.len();
        for (idx, armature) in armatures.enumerate() {
            self.mass[idx * n_joints + idx] += armature;
        }
        self
    }

    /// Returns the effort of a force, with its torque about the world's origin, on a joint that
    /// moves its point of application.
    pub fn effort_of(&self, joint: usize, force: &Twist) -> f64 {
        self.axes[joint].dot(force)
    }

    /// Returns the inertia of one joint while all others are free to move.
    pub fn apparent(&self, joint: usize) -> f64 {
        let mut unit = vec![0.0; self.bias.len()];
        unit[joint] = 1.0;
        self.factor().solve(&mut unit);
        1.0 / unit[joint]
    }

    /// Returns the change of a link's motion by an impulse on it. `joints` are those that move the
    /// link.
    pub fn answer(&self, joints: &[usize], impulse: &Twist) -> Twist {
        let mut changes = vec![0.0; self.bias.len()];
        for joint in joints {
            changes[*joint] = self.effort_of(*joint, impulse);
        }
        self.factor().solve(&mut changes);
        joints.iter().fold(Twist::ZERO, |sum, joint| {
            sum.plus(self.axes[*joint], changes[*joint])
        })
    }

    fn factor(&self) -> &Factor {
        self.factor
            .get_or_init(|| Factor::new(self.mass.clone(), self.bias.len()))
    }
}

/// The efforts that a motion needs, at one moment of it. Units: newtons or newton metres.
pub struct Dynamics {
    inertias: Inertias,
    /// Against gravity alone.
    holding: Vec<f64>,
}

impl Dynamics {
    /// Returns the dynamics with the links at these poses and the joints at these velocities.
    pub(crate) fn new(model: &RobotModel, poses: &[Isometry3<f64>], velocities: &[f64]) -> Self {
        Self {
            inertias: inertias(model, poses, velocities),
            holding: holding_efforts(model, poses),
        }
    }

    /// Returns the effort of a joint that accelerates all joints. Units of the accelerations: m/s²
    /// or rad/s².
    pub fn effort_to_accelerate(&self, joint: usize, accelerations: &[f64]) -> f64 {
        let row = &self.inertias.mass[joint * accelerations.len()..];
        row.iter()
            .zip(accelerations)
            .map(|(inertia, acceleration)| inertia * acceleration)
            .sum()
    }

    /// Returns the effort of a joint against centrifugal and Coriolis forces. It grows with the
    /// square of the speed.
    pub fn effort_of_velocity(&self, joint: usize) -> f64 {
        self.inertias.bias[joint] - self.holding[joint]
    }

    /// Returns the effort of a joint that carries the weight of its links.
    pub fn holding_effort(&self, joint: usize) -> f64 {
        self.holding[joint]
    }
}

/// Angular and linear part of a motion, a force or a momentum, about the world's origin.
#[derive(Debug, Clone, Copy)]
pub struct Twist {
    /// Angular velocity, torque or angular momentum.
    pub turn: Vector3<f64>,
    /// Velocity of the body's point at the origin, force or momentum.
    pub shift: Vector3<f64>,
}

impl Twist {
    /// Returns a force that acts at a point.
    pub fn by_force(force: &Vector3<f64>, point: &Point3<f64>) -> Self {
        Self {
            turn: point.coords.cross(force),
            shift: *force,
        }
    }

    /// No motion.
    pub const ZERO: Self = Self {
        turn: Vector3::new(0.0, 0.0, 0.0),
        shift: Vector3::new(0.0, 0.0, 0.0),
    };

    /// Returns the sum of this and a multiple of another one.
    pub fn plus(self, other: Self, times: f64) -> Self {
        Self {
            turn: self.turn + other.turn * times,
            shift: self.shift + other.shift * times,
        }
    }

    fn dot(&self, other: &Self) -> f64 {
        self.turn.dot(&other.turn) + self.shift.dot(&other.shift)
    }

    /// Returns the rate of change of another motion that is fixed to a body with this motion.
    fn carries(&self, other: &Self) -> Self {
        Self {
            turn: self.turn.cross(&other.turn),
            shift: self.turn.cross(&other.shift) + self.shift.cross(&other.turn),
        }
    }

    /// Returns the force that a momentum fixed to a body with this motion takes.
    fn bends(&self, momentum: &Self) -> Self {
        Self {
            turn: self.turn.cross(&momentum.turn) + self.shift.cross(&momentum.shift),
            shift: self.turn.cross(&momentum.shift),
        }
    }
}

/// Mass, first moment and moment of inertia about the world's origin.
#[derive(Debug, Clone, Copy)]
struct Bulk {
    mass: f64,
    moment: Vector3<f64>,
    about: Matrix3<f64>,
}

impl Bulk {
    fn momentum(&self, motion: &Twist) -> Twist {
        Twist {
            turn: self.about * motion.turn + self.moment.cross(&motion.shift),
            shift: motion.shift * self.mass + motion.turn.cross(&self.moment),
        }
    }
}

/// Returns the dynamics of a robot with its links at these poses and its joints at these
/// velocities. Units: metres, radians, seconds.
pub fn inertias(model: &RobotModel, poses: &[Isometry3<f64>], velocities: &[f64]) -> Inertias {
    let n_joints = model.joints.len();
    let axes: Vec<Twist> = model
        .joints
        .iter()
        .map(|joint| {
            let (axis, point) = axis_in_world(joint, poses);
            match joint.kind {
                JointKind::Prismatic => Twist {
                    turn: Vector3::zeros(),
                    shift: axis,
                },
                JointKind::Revolute => Twist {
                    turn: axis,
                    shift: point.cross(&axis),
                },
            }
        })
        .collect();
    let mut bulks: Vec<Bulk> = model
        .links
        .iter()
        .zip(poses)
        .map(|(link, pose)| {
            let turned = pose.rotation.to_rotation_matrix();
            let com = (pose * Point3::from(link.com)).coords;
            let spread = Matrix3::identity() * com.norm_squared() - com * com.transpose();
            let about = turned * link.inertia * turned.transpose() + spread * link.mass;
            Bulk {
                mass: link.mass,
                moment: com * link.mass,
                about,
            }
        })
        .collect();
    // The root accelerates upwards instead of gravity pulling downwards.
    let up = Twist {
        turn: Vector3::zeros(),
        shift: Vector3::z() * GRAVITY,
    };
    let (mut motions, mut changes) = (vec![Twist::ZERO], vec![up]);
    for (idx, joint) in model.joints.iter().enumerate() {
        let parent = motions[joint.parent];
        motions.push(parent.plus(axes[idx], velocities[idx]));
        changes.push(changes[joint.parent].plus(parent.carries(&axes[idx]), velocities[idx]));
    }
    let mut forces: Vec<Twist> = bulks
        .iter()
        .zip(motions.iter().zip(&changes))
        .map(|(bulk, (motion, change))| {
            bulk.momentum(change)
                .plus(motion.bends(&bulk.momentum(motion)), 1.0)
        })
        .collect();
    let (mut mass, mut bias) = (vec![0.0; n_joints * n_joints], vec![0.0; n_joints]);
    // Children come after their parents.
    for (idx, joint) in model.joints.iter().enumerate().rev() {
        let (bulk, force) = (bulks[idx + 1], forces[idx + 1]);
        bias[idx] = axes[idx].dot(&force);
        let momentum = bulk.momentum(&axes[idx]);
        let mut link = idx + 1;
        while link > 0 {
            let value = axes[link - 1].dot(&momentum);
            mass[idx * n_joints + link - 1] = value;
            mass[(link - 1) * n_joints + idx] = value;
            link = model.joints[link - 1].parent;
        }
        let onto = &mut bulks[joint.parent];
        onto.mass += bulk.mass;
        onto.moment += bulk.moment;
        onto.about += bulk.about;
        forces[joint.parent] = forces[joint.parent].plus(force, 1.0);
    }
    Inertias {
        mass,
        bias,
        axes,
        factor: OnceCell::new(),
    }
}
