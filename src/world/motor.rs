//! The motor of one joint: its control law, and where the engine knows the stops of the joint.

use rapier3d::prelude::{GenericJoint, JointAxis, MultibodyJointHandle, PhysicsWorld};

use crate::assemble::WIDEST_RANGE;
use crate::motor_law::{Law, State};
use actcheck_geometry::to_real;
use actcheck_robot::Joint;

/// The motor of one joint.
#[derive(Debug, Clone)]
pub(super) struct Motor {
    pub(super) joint: MultibodyJointHandle,
    pub(super) axis: JointAxis,
    pub(super) stiffness: f64,
    pub(super) damping: f64,
    pub(super) max_effort: f64,
    /// Final target position.
    pub(super) target: f64,
    /// Current target position: approaches `target` within the joint's velocity limit.
    pub(super) setpoint: f64,
    pub(super) setpoint_velocity: f64,
    /// Commanded effort, instead of a position.
    pub(super) push: Option<f64>,
    /// Its law in this step.
    pub(super) law: Law,
    /// Position at the start of the step.
    pub(super) began: f64,
    /// Mean effort in the last control tick, without gravity compensation.
    pub(super) effort: f64,
    /// Inertia of its rotor, as the joint feels it. Unit: kilograms or kg·m².
    pub(super) armature: f64,
    /// Largest speed of its setpoint.
    pub(super) fastest: f64,
    /// Viscous friction of the joint, if it is strong compared with the motor's damping; otherwise 0.
    pub(super) friction: f64,
    /// Largest commanded effort as a multiple of the joint's limit: 1 unless the motor is
    /// overdriven.
    pub(super) strength: f64,
}

/// Share of the largest speed over which an effort-controlled motor reduces its effort, to limit
/// its speed.
const SLACK: f64 = 0.02;
/// Distance to a joint limit below which the engine knows of the limit, for joints at rest. Units:
/// metres or radians.
const STOP_RANGE: f64 = 0.02;

impl Motor {
    /// Returns whether its targets are numbers, and its limits are not below 0.
    pub(super) fn is_valid(&self) -> bool {
        let targets = [
            self.target,
            self.setpoint,
            self.setpoint_velocity,
            self.push.unwrap_or(0.0),
        ];
        let limits = [self.max_effort, self.stiffness, self.damping, self.fastest];
        targets.iter().all(|target| target.is_finite())
            && limits.iter().all(|limit| *limit >= 0.0)
            && self.stiffness.is_finite()
    }

    /// Returns its mean effort in a step that ended at this position, without gravity compensation
    /// (`held`).
    ///
    /// The engine applies the control law in each of `n_substeps`, with the target position ahead
    /// by the way of one substep at the target velocity, and does not report the motor's impulse.
    /// The mean over the substeps follows from the positions at both ends of the step.
    pub(super) fn effort_of_step(&self, position: f64, held: f64, dt: f64, n_substeps: f64) -> f64 {
        if let Some(effort) = self.push {
            return effort;
        }
        let ahead = self.setpoint_velocity * dt / n_substeps * (n_substeps + 1.0) / 2.0;
        let velocity = (position - self.began) / dt;
        let law = self.stiffness * (self.setpoint + ahead - position)
            + self.damping * (self.setpoint_velocity - velocity);
        let given = (law + held).clamp(-self.max_effort, self.max_effort) - held;
        given.clamp(-self.max_effort, self.max_effort)
    }

    /// Keeps the setpoint near the joint's position: a setpoint that ran ahead of a blocked joint
    /// would make it shoot off, once it is free. The joint catches up at a speed at which damping
    /// balances stiffness, in the engine's implicit steps of `substep_secs`; together with the
    /// setpoint's velocity this must not exceed its largest speed. Against viscous friction, the
    /// setpoint must be faster than the joint.
    pub(super) fn keep_near(&mut self, position: f64, fastest: f64, substep_secs: f64) {
        let fastest = fastest * (1.0 + self.friction / self.damping.max(f64::MIN_POSITIVE));
        let damping = self.damping + self.stiffness * substep_secs;
        let most = (damping * fastest).max(self.max_effort) / self.stiffness;
        self.setpoint = self.setpoint.clamp(position - most, position + most);
        let catching_up = self.stiffness * (self.setpoint - position) / damping;
        self.setpoint_velocity = self
            .setpoint_velocity
            .clamp(-fastest - catching_up, fastest - catching_up);
    }

    /// Returns how far a joint that is this far behind its setpoint can approach it in a time.
    pub(super) fn catches_up(&self, lag: f64, secs: f64) -> f64 {
        if self.damping > 0.0 {
            lag.min(lag * secs * self.stiffness / self.damping)
        } else {
            lag
        }
    }

    /// Applies an effort for a step: a velocity motor with the target speed `top` and `effort` as
    /// its limit gives this effort until it reaches that speed. Also resets the setpoint, so that
    /// position control later resumes at the current position.
    pub(super) fn give(&mut self, position: f64, velocity: f64, effort: f64, top: f64) {
        self.setpoint = position;
        self.setpoint_velocity = velocity;
        self.target = position;
        let damping = effort.abs() / (SLACK * top).max(1e-6);
        self.law = Law {
            target: 0.0,
            velocity: top.copysign(effort),
            stiffness: 0.0,
            damping,
            most: effort.abs(),
        };
    }

    /// Gives the engine the law of this step, and the joint's stops if it can reach them.
    ///
    /// The engine solves a motor by iteration, as a constraint, or, with `spring_secs` for the
    /// length of its substeps, as a spring with a damper, together with the masses. Springs are
    /// exact, but have no largest effort: motors at theirs stay constraints.
    pub(super) fn tell(
        &self,
        engine: &mut PhysicsWorld,
        joint: &Joint,
        at: State,
        largest: f64,
        spring_secs: Option<f64>,
    ) {
        let Some((multibody, link)) = engine.multibody_joints.get_mut(self.joint) else {
            return;
        };
        let Some(link) = multibody.link_mut(link) else {
            return;
        };
        let (dof, law, axis) = (link.assembly_id(), &self.law, self.axis as usize);
        limit_if_near(&mut link.joint.data, self.axis, joint, at.position, largest);
        let spring_secs =
            spring_secs.filter(|_| law.stiffness > 0.0 && law.effort(at).abs() < law.most);
        if let Some(secs) = spring_secs {
            // The target of a constraint is ahead by the way of a substep, too.
            let rest = law.target + law.velocity * (law.damping / law.stiffness + secs);
            link.joint
                .set_spring(axis, to_real(law.stiffness), to_real(rest));
            link.joint.data.motor_axes.remove(self.axis.into());
        } else {
            let [target, velocity, stiffness, damping] =
                [law.target, law.velocity, law.stiffness, law.damping].map(to_real);
            link.joint.set_spring(axis, 0.0, 0.0);
            link.joint
                .data
                .set_motor(self.axis, target, velocity, stiffness, damping);
            link.joint
                .data
                .set_motor_max_force(self.axis, to_real(law.most));
        }
        multibody.damping_mut()[dof] =
            to_real(joint.damping + spring_secs.map_or(0.0, |_| law.damping));
    }
}

/// Gives a joint its stops only where it can reach them in a step of `largest` way: far from them
/// they do nothing, but the engine would solve them.
fn limit_if_near(
    data: &mut GenericJoint,
    axis: JointAxis,
    joint: &Joint,
    position: f64,
    largest: f64,
) {
    if joint.upper - joint.lower >= WIDEST_RANGE {
        return;
    }
    let room = (position - joint.lower).min(joint.upper - position);
    data.limit_axes
        .set(axis.into(), room < STOP_RANGE + 2.0 * largest);
}

#[cfg(test)]
mod tests {
    use crate::Shortcuts;
    use crate::reach::Reach;
    use crate::robot::tests::lonely;
    use crate::simulation::tests::{bodies, bodies_mut, step_with};

    /// A joint without inertia is the fastest: it follows its law at once.
    #[test]
    fn no_joint_catches_up_by_more_than_said() {
        let world = lonely();
        let (tick_secs, finger) = (
            world.tick_secs(),
            world
                .layout()
                .gripper
                .joints()
                .next()
                .expect("it has fingers"),
        );
        for joint in [world.layout().arm[0], finger] {
            let motor = &bodies(&world).robot.motors[joint];
            for lag in [1e-4, 0.01, 0.3] {
                let motor = crate::motor::Motor {
                    setpoint: lag,
                    setpoint_velocity: 0.0,
                    ..motor.clone()
                };
                let (n_substeps, mut position) = (16, 0.0);
                let secs = tick_secs / f64::from(n_substeps);
                for _ in 0..n_substeps {
                    let catching_up = motor.stiffness * (lag - position)
                        / (motor.damping + motor.stiffness * secs);
                    position += catching_up * secs;
                }
                let most = motor.catches_up(lag, tick_secs);
                assert!(
                    position <= most && most <= lag,
                    "{position} of {most}, {lag} behind"
                );
                assert!(joint != finger || most < 0.2 * lag, "{most} of {lag}");
            }
        }
    }

    /// With motors as springs, the engine finds the motion of the exact equations, and the robot
    /// measures the same efforts.
    #[test]
    fn motors_as_springs_move_and_measure_as_the_equations_do() {
        let [mut springs, mut free] = [lonely(), lonely()];
        bodies_mut(&mut springs).robot.is_springy = true;
        for world in [&mut springs, &mut free] {
            world.take_shortcuts(Shortcuts {
                few_substeps: false,
                ..Shortcuts::ALL
            });
        }
        let mut command = springs.hold();
        let (from, arm) = (command.positions.clone(), springs.layout().arm.clone());
        for tick in 0..150 {
            // Motors that start at once are at their largest effort, and no springs.
            let done = f64::from(tick) / 150.0;
            for (joint, way) in arm.iter().zip([0.2, -0.6, 0.6, 0.4, 0.6]) {
                command.positions[*joint] = from[*joint] + way * done * done * (3.0 - 2.0 * done);
            }
            for (world, reach) in [(&mut springs, Reach::All), (&mut free, Reach::Nothing)] {
                step_with(world, &command, reach);
                assert_eq!(world.fault(), None);
            }
            let (one, other) = (springs.observe(), free.observe());
            for (idx, joint) in springs.kinematics().joints().iter().enumerate() {
                let off = (one.positions[idx] - other.positions[idx]).abs();
                assert!(off < 3e-4, "{} is {off} off in tick {tick}", joint.name);
                let off = (one.loads[idx] - other.loads[idx]).abs();
                assert!(
                    off < 0.05 * joint.effort,
                    "{}: {off} off in tick {tick}",
                    joint.name
                );
            }
        }
    }
}
