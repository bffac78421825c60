//! Overhead of actcheck over a bare physics step.
//!
//! The scene of the first run of `configs/clutter.toml` (a table, a dozen objects, the robot) is
//! stepped by `World::step`, with the robot's controllers, the recorder and fault detection, and by
//! `rapier3d` used directly with the same settings, shapes, masses and motors. Both start with
//! everything at rest. The ratio should be at most 1.1.
//!
//! `cargo bench --bench physics -- --scene FILE` writes the scene and the rates as JSON for
//! `physics_peers.py`.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

use actcheck::campaign::Env;
use actcheck::config::Overrides;
use actcheck::data::{Choices, Role, Scene, Shape};
use actcheck::rules::Budget;
use actcheck::scenario;
use actcheck::world::{self, Command};
use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use rapier3d::prelude as engine;
use serde_json::{Value, json};

/// Steps of one measurement: two seconds of simulated time.
const STEPS: u32 = 480;
/// Measurements of each kind, alternating; the fastest counts.
const ROUNDS: usize = 15;
/// Steps before the first measurement.
const SETTLING: u32 = 480;

fn main() {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/clutter.toml");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let overrides = Overrides {
        history: Some(folder.path().join("history")),
        ..Overrides::default()
    };
    let env = Env::prepare_within(&config, &overrides, Budget::default())
        .expect("the shipped configuration is sound");
    let scene =
        scenario::draw(&env.space, 0, &mut Choices::random(env.campaign.seed, 0)).expect("a scene");

    let mut ours = Ours::new(&scene);
    let mut asleep = ByHand::new(&scene, true);
    let mut awake = ByHand::new(&scene, false);
    let mut fastest = [f64::INFINITY; 4];
    for _ in 0..ROUNDS {
        let (whole, engine_alone) = ours.measure();
        for (best, secs) in
            fastest
                .iter_mut()
                .zip([whole, engine_alone, asleep.measure(), awake.measure()])
        {
            *best = best.min(secs);
        }
    }
    let rates = fastest.map(|secs| f64::from(STEPS) / secs);
    println!(
        "steps per second, {} objects and the robot, everything at rest",
        scene.objects.len()
    );
    for (name, rate) in [
        "actcheck",
        "its engine only",
        "rapier3d by hand",
        "the same without sleeping",
    ]
    .iter()
    .zip(rates)
    {
        println!(
            "  {name:<26}{rate:>9.0}  {:>6.2} x by hand",
            rates[2] / rate
        );
    }
    if let Some(path) = std::env::args().skip_while(|arg| arg != "--scene").nth(1) {
        let text = written(&scene, &rates).to_string();
        std::fs::write(&path, text).expect("the scene's file can be written");
        println!("the scene is in {path}");
    }
}

/// The scene stepped by actcheck.
struct Ours {
    world: world::World,
    command: Command,
    ticks: u32,
}

impl Ours {
    fn new(scene: &Scene) -> Self {
        let mut world = world::build(scene).expect("a sound scene");
        // Both do the same work: free motion of the robot would take fewer steps of the engine.
        world.take_shortcuts(world::Shortcuts::NONE);
        world.watch(now_secs);
        let command = world.hold();
        let steps_per_tick =
            (world.tick_secs() * f64::from(scene.physics.steps_per_second)).round();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a handful of steps"
        )]
        let steps_per_tick = steps_per_tick as u32;
        for _ in 0..SETTLING / steps_per_tick {
            world.step(&command);
        }
        Self {
            world,
            command,
            ticks: STEPS / steps_per_tick,
        }
    }

    /// Wall time of the steps, and of the engine within them. Unit: seconds.
    fn measure(&mut self) -> (f64, f64) {
        let (start, engine_start) = (now_secs(), self.world.engine().engine_secs());
        for _ in 0..self.ticks {
            self.world.step(&self.command);
        }
        assert!(self.world.fault().is_none(), "the scene must stay sound");
        (
            now_secs() - start,
            self.world.engine().engine_secs() - engine_start,
        )
    }
}

fn now_secs() -> f64 {
    static START: std::sync::LazyLock<Instant> = std::sync::LazyLock::new(Instant::now);
    START.elapsed().as_secs_f64()
}

/// The engine's unit of length, as in actcheck. Unit: metres.
const UNIT: f32 = 0.125;

/// The same scene written directly with `rapier3d`.
struct ByHand {
    world: engine::PhysicsWorld,
}

impl ByHand {
    fn new(scene: &Scene, may_sleep: bool) -> Self {
        let softness = |frequency| engine::SpringCoefficients {
            natural_frequency: frequency,
            damping_ratio: 10.0,
        };
        let defaults = engine::IntegrationParameters::default();
        let parameters = engine::IntegrationParameters {
            length_unit: UNIT,
            normalized_allowed_linear_error: defaults.normalized_allowed_linear_error / UNIT,
            normalized_max_corrective_velocity: defaults.normalized_max_corrective_velocity / UNIT,
            normalized_prediction_distance: defaults.normalized_prediction_distance / UNIT,
            normalized_max_linear_velocity: defaults.normalized_max_linear_velocity / UNIT,
            dt: 1.0 / real(f64::from(scene.physics.steps_per_second)),
            num_solver_iterations: scene.physics.iterations as usize,
            friction_in_bias_pass: true,
            contact_softness: softness(90.0),
            static_contact_softness: softness(30.0),
            contact_recycling: false,
            ..defaults
        };
        let gravity = vector(&Vector3::new(0.0, 0.0, -9.81));
        let mut world = engine::PhysicsWorld {
            gravity,
            integration_parameters: parameters,
            // Contacts must be discarded in the same way as in actcheck.
            narrow_phase: world::narrow_phase(),
            ..engine::PhysicsWorld::default()
        };
        let floor = engine::ColliderBuilder::cuboid(20.0, 20.0, 0.5)
            .position(pose(&Isometry3::translation(0.0, 0.0, -0.5)))
            .friction(0.5);
        world.insert_collider(floor, None);
        for object in &scene.objects {
            let fixed = object.role == Role::Platform;
            let builder = if fixed {
                engine::RigidBodyBuilder::fixed()
            } else {
                engine::RigidBodyBuilder::dynamic()
            };
            let builder = builder
                .pose(pose(&object.pose.to_isometry()))
                .can_sleep(may_sleep);
            let body = world.insert_body(builder);
            if let Some(body) = world.bodies.get_mut(body) {
                body.activation_mut().normalized_linear_threshold = 0.02 / UNIT;
                body.activation_mut().time_until_sleep = 0.3;
            }
            let density = object.mass_kg / object.model.volume();
            for solid in object.model.solids() {
                let shape = shape(&solid.shape, &solid.pose.to_isometry());
                world.insert_collider(
                    shape.density(real(density)).friction(real(object.friction)),
                    Some(body),
                );
            }
        }
        insert_robot(&mut world, scene);
        let mut this = Self { world };
        for _ in 0..SETTLING {
            this.world.step();
        }
        this
    }

    fn measure(&mut self) -> f64 {
        let start = now_secs();
        for _ in 0..STEPS {
            self.world.step();
        }
        now_secs() - start
    }
}

/// Inserts the robot as one multibody: fixed links are merged into their parents, and all motors
/// hold position 0.
fn insert_robot(world: &mut engine::PhysicsWorld, scene: &Scene) {
    let robot =
        urdf_rs::read_from_string(&scene.robot.profile.core.urdf.text).expect("the shipped robot");
    let links: BTreeMap<&str, &urdf_rs::Link> = robot
        .links
        .iter()
        .map(|link| (link.name.as_str(), link))
        .collect();
    let root = robot.links.iter().find(|link| {
        robot
            .joints
            .iter()
            .all(|joint| joint.child.link != link.name)
    });
    let root = root.expect("a tree has a root").name.as_str();
    // Start pose of the robot; its joints stay at 0.
    let [x, y, heading] = scene.robot.base;
    let start = Isometry3::from_parts(
        Translation3::new(x, y, 0.0),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading),
    );
    let base = world.insert_body(engine::RigidBodyBuilder::fixed().pose(pose(&start)));
    // Links to visit: name, body of the link, pose on that body, pose of the body in the world.
    let mut open = vec![(root, base, Isometry3::identity(), start)];
    while let Some((name, body, at, body_at)) = open.pop() {
        add_link(world, links[name], body, &at);
        for joint in robot
            .joints
            .iter()
            .filter(|joint| joint.parent.link == name)
        {
            let origin = at * isometry(&joint.origin);
            if joint.joint_type == urdf_rs::JointType::Fixed {
                open.push((&joint.child.link, body, origin, body_at));
                continue;
            }
            let builder = engine::RigidBodyBuilder::dynamic()
                .pose(pose(&(body_at * origin)))
                .can_sleep(false);
            let child = world.insert_body(builder);
            let data = motor(joint, &origin);
            let handle = world
                .multibody_joints
                .insert(body, child, data, true)
                .expect("a tree has no loops");
            if let Some((multibody, _)) = world.multibody_joints.get_mut(handle) {
                multibody.set_self_contacts_enabled(false);
            }
            open.push((
                &joint.child.link,
                child,
                Isometry3::identity(),
                body_at * origin,
            ));
        }
    }
}

fn motor(joint: &urdf_rs::Joint, origin: &Isometry3<f64>) -> engine::GenericJoint {
    let slides = joint.joint_type == urdf_rs::JointType::Prismatic;
    let (locked, axis, saturation) = if slides {
        (
            engine::JointAxesMask::LOCKED_PRISMATIC_AXES,
            engine::JointAxis::LinX,
            1e-3,
        )
    } else {
        (
            engine::JointAxesMask::LOCKED_REVOLUTE_AXES,
            engine::JointAxis::AngX,
            0.02,
        )
    };
    let turned = UnitQuaternion::rotation_between(&Vector3::x(), &Vector3::from(joint.axis.xyz.0));
    let turned = turned.unwrap_or_else(|| {
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI)
    });
    let frame = Isometry3::from_parts(Translation3::identity(), turned);
    let mut data = engine::GenericJoint::new(locked);
    data.set_local_frame1(pose(&(origin * frame)));
    data.set_local_frame2(pose(&frame));
    data.set_motor_model(axis, engine::MotorModel::ForceBased);
    if joint.limit.upper - joint.limit.lower < 20.0 {
        data.set_limits(axis, [real(joint.limit.lower), real(joint.limit.upper)]);
    }
    let stiffness = (joint.limit.effort / saturation).max(1.0);
    data.set_motor(axis, 0.0, 0.0, real(stiffness), real(stiffness * 0.02));
    data.set_motor_max_force(axis, real(joint.limit.effort));
    data
}

fn add_link(
    world: &mut engine::PhysicsWorld,
    link: &urdf_rs::Link,
    body: engine::RigidBodyHandle,
    at: &Isometry3<f64>,
) {
    let inertial = at * isometry(&link.inertial.origin);
    let mass = link.inertial.mass.value.max(0.01);
    let i = &link.inertial.inertia;
    let inertia = Matrix3::new(
        i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz,
    );
    let rotation = inertial.rotation.to_rotation_matrix();
    let turned =
        rotation.matrix() * inertia * rotation.matrix().transpose() + Matrix3::identity() * 4e-7;
    let mut columns = [0.0_f32; 9];
    for (to, from) in columns.iter_mut().zip(turned.iter()) {
        *to = real(*from);
    }
    let matrix = rapier3d::math::Matrix::from_cols_array(&columns);
    let added = engine::MassProperties::with_inertia_matrix(
        vector(&inertial.translation.vector),
        real(mass),
        matrix,
    );
    // The mass is on a collider without contacts, so that the masses of merged links add up.
    let carrier = engine::ColliderBuilder::ball(1e-3)
        .sensor(true)
        .collision_groups(engine::InteractionGroups::none())
        .mass_properties(added);
    world.insert_collider(carrier, Some(body));
    for collision in &link.collision {
        let place = at * isometry(&collision.origin);
        let form = match collision.geometry {
            urdf_rs::Geometry::Box { size } => Shape::Box { size: size.0 },
            urdf_rs::Geometry::Cylinder { radius, length } => Shape::Cylinder {
                radius,
                height: length,
            },
            urdf_rs::Geometry::Sphere { radius } => Shape::Sphere { radius },
            _ => continue,
        };
        world.insert_collider(shape(&form, &place).density(0.0).friction(0.4), Some(body));
    }
}

fn shape(shape: &Shape, at: &Isometry3<f64>) -> engine::ColliderBuilder {
    let mut place = *at;
    let builder = match *shape {
        Shape::Box { size: [x, y, z] } => {
            engine::ColliderBuilder::cuboid(real(x / 2.0), real(y / 2.0), real(z / 2.0))
        }
        Shape::Cylinder { radius, height } => {
            place.rotation *=
                UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2);
            engine::ColliderBuilder::cylinder(real(height / 2.0), real(radius))
        }
        Shape::Sphere { radius } => engine::ColliderBuilder::ball(real(radius)),
        ref other => panic!("the scene's solids are boxes, cylinders and spheres, not {other:?}"),
    };
    builder.position(pose(&place))
}

fn isometry(pose: &urdf_rs::Pose) -> Isometry3<f64> {
    let [roll, pitch, yaw] = pose.rpy.0;
    let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    Isometry3::from_parts(Translation3::from(Vector3::from(pose.xyz.0)), rotation)
}

fn vector(v: &Vector3<f64>) -> rapier3d::math::Vector {
    rapier3d::math::Vector::new(real(v.x), real(v.y), real(v.z))
}

fn pose(at: &Isometry3<f64>) -> rapier3d::math::Pose {
    let q = at.rotation.quaternion();
    let rotation =
        rapier3d::math::Rotation::from_xyzw(real(q.i), real(q.j), real(q.k), real(q.w)).normalize();
    rapier3d::math::Pose::from_parts(vector(&at.translation.vector), rotation)
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "the engine calculates in 32 bits"
)]
fn real(value: f64) -> f32 {
    value as f32
}

/// The scene as JSON for other engines: every solid with its pose and mass. Units: metres,
/// kilograms. Quaternions: w, x, y, z.
fn written(scene: &Scene, rates: &[f64; 4]) -> Value {
    let objects = scene.objects.iter().map(|object| {
        let volume = object.model.volume();
        let solids = object.model.solids();
        let solids = solids.iter().map(|solid| {
            let mass = object.mass_kg * solid.shape.volume() / volume;
            let (kind, size) = match solid.shape {
                Shape::Box { size } => ("box", size.to_vec()),
                Shape::Cylinder { radius, height } => ("cylinder", vec![radius, height]),
                Shape::Sphere { radius } => ("sphere", vec![radius]),
                ref other => panic!("the scene's solids are boxes, cylinders and spheres, not {other:?}"),
            };
            json!({"shape": kind, "size": size, "mass": mass, "place": place(&solid.pose.to_isometry())})
        });
        json!({
            "id": object.id,
            "fixed": object.role == Role::Platform,
            "place": place(&object.pose.to_isometry()),
            "friction": object.friction,
            "solids": solids.collect::<Vec<_>>(),
        })
    });
    json!({
        "robot_base": scene.robot.base,
        "steps_per_second": scene.physics.steps_per_second,
        "iterations": scene.physics.iterations,
        "robot": scene.robot.profile.core.urdf.text.as_ref() as &str,
        "objects": objects.collect::<Vec<_>>(),
        "rates": {"actcheck": rates[0], "rapier3d by hand": rates[2], "rapier3d by hand, nothing sleeps": rates[3]},
    })
}

fn place(at: &Isometry3<f64>) -> Value {
    let (t, q) = (at.translation.vector, at.rotation.quaternion());
    json!([t.x, t.y, t.z, q.w, q.i, q.j, q.k])
}
