//! Simulation against closed-form answers, and its reaction to faults.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use actcheck::actions::{ActionCall, perform};
use actcheck::base::Files;
use actcheck::data::{
    ActionEnd, BodyState, Budget, Camera, Choices, DecorRanges, ObjectModel, Odometry, Part,
    Physics, Pose, RobotProfile, RobotStart, Role, Scene, SceneObject, Sensing, Shape, Trace,
};
use actcheck::world::{GRAVITY, Poison, Shortcuts, World, build};

const PERFECT: Sensing = Sensing {
    position_noise_m: 0.0,
    height_noise_m: 0.0,
    yaw_noise_rad: 0.0,
    size_noise_m: 0.0,
    localisation_noise_m: 0.0,
    heading_noise_rad: 0.0,
    gripper_noise_m: 0.0,
    odometry: Odometry::IDEAL,
    camera: Camera::IDEAL,
    decor: DecorRanges::PLAIN,
};

fn robot() -> Arc<RobotProfile> {
    let path = Path::new("models/robots/mobile_manipulator.toml");
    let stated =
        actcheck::config::robot::read(&Files::Shipped, path).expect("the shipped robot is right");
    Arc::new(stated.complete().expect("it states all roles"))
}

pub(crate) fn shipped(name: &str) -> Arc<ObjectModel> {
    let path = format!("models/objects/{name}.toml");
    let source = Files::Shipped
        .read(Path::new(&path))
        .expect("the model is shipped");
    Arc::new(actcheck::config::model::read(&source).expect("the shipped models are right"))
}

/// A robot has a map of its world, without the objects that a scene adds, even if these can't move.
#[test]
fn immovable_objects_are_known_only_if_they_are_on_the_map() {
    let fixed = Arc::new(ObjectModel {
        fixed: true,
        ..Arc::unwrap_or_clone(block([0.2, 0.2, 0.2]))
    });
    let at = |x: f64| Pose::upright([x, 0.0, 0.0], 0.0);
    let objects = vec![
        object(
            "table",
            block([0.5, 0.5, 0.5]),
            Role::Platform,
            at(0.0),
            1.0,
            0.5,
        ),
        object(
            "pillar",
            Arc::clone(&fixed),
            Role::Obstacle,
            at(1.0),
            1.0,
            0.5,
        ),
        object("statue", fixed, Role::Other, at(2.0), 1.0, 0.5),
    ];
    let world = world(objects);
    let known: Vec<String> = world
        .known_furniture()
        .into_iter()
        .map(|piece| piece.id)
        .collect();
    assert_eq!(known, ["table"]);
}

/// A box of 1 kg, unless the scene says otherwise.
pub(crate) fn block(size: [f64; 3]) -> Arc<ObjectModel> {
    let pose = Pose::upright([0.0, 0.0, size[2] / 2.0], 0.0);
    Arc::new(ObjectModel {
        name: "block".to_owned(),
        category: "http://actions#Box".to_owned(),
        mass_kg: 1.0,
        friction: 0.5,
        restitution: 0.0,
        size_m: size,
        parts: vec![Part {
            pose,
            shape: Shape::Box { size },
        }],
        origin_m: [0.0; 3],
        fixed: false,
        inertia: None,
        surface: None,
        moving: Vec::new(),
        digest: String::new(),
    })
}

pub(crate) fn object(
    id: &str,
    model: Arc<ObjectModel>,
    role: Role,
    pose: Pose,
    mass_kg: f64,
    friction: f64,
) -> SceneObject {
    SceneObject {
        id: id.to_owned(),
        restitution: model.restitution,
        model,
        role,
        pose,
        mass_kg,
        friction,
        attached: None,
    }
}

/// A scene with the robot far away.
pub(crate) fn scene(objects: Vec<SceneObject>) -> Scene {
    Scene {
        map: actcheck::data::SceneMap::default(),
        world: "empty".to_owned(),
        objects,
        robot: RobotStart {
            profile: robot(),
            base: [-5.0, 0.0, 0.0],
            root_height_m: 0.0,
            knows: Arc::new([]),
        },
        designators: BTreeMap::new(),
        steps: Vec::new(),
        sensing: PERFECT,
        physics: Physics {
            mass_scale: (1.0, 1.0),
            friction_scale: (1.0, 1.0),
            size_scale: (1.0, 1.0),
            restitution: (0.0, 0.0),
            steps_per_second: 240,
            iterations: 2,
            shortcuts: true,
        },
    }
}

fn world(objects: Vec<SceneObject>) -> World {
    build(&scene(objects)).expect("the scene is right")
}

fn run(world: &mut World, secs: f64) {
    let (command, until) = (world.hold(), world.time_secs() + secs);
    while world.time_secs() < until - 1e-9 {
        world.step(&command);
    }
    assert_eq!(world.fault(), None);
}

pub(crate) fn body(world: &World, id: &str) -> BodyState {
    world
        .snapshot()
        .bodies
        .into_iter()
        .find(|body| body.id == id)
        .expect("the object is in the scene")
}

fn distance(a: &Pose, b: &Pose) -> f64 {
    a.position
        .iter()
        .zip(&b.position)
        .map(|(a, b)| (a - b).powi(2))
        .sum::<f64>()
        .sqrt()
}

/// Half of g·t², without the integrator's first step (g·t·dt).
#[test]
fn a_body_falls_by_half_g_t_squared() {
    let pose = Pose::upright([0.0, 0.0, 3.0], 0.0);
    let mut world = world(vec![object(
        "a",
        block([0.1; 3]),
        Role::Target,
        pose,
        1.0,
        0.5,
    )]);
    run(&mut world, 0.5);
    let (time, fallen) = (world.time_secs(), 3.0 - body(&world, "a").pose.position[2]);
    let expected = GRAVITY * time * time / 2.0;
    assert!(
        (fallen - expected).abs() < GRAVITY * time / 240.0,
        "fell {fallen} m, expected {expected} m"
    );
    let speed = -body(&world, "a").linear_velocity[2];
    assert!((speed / (GRAVITY * time) - 1.0).abs() < 1e-3, "{speed}");
}

/// The distance a block slides down a slope in a second, with the friction angle given separately
/// from the slope's.
fn slide_on_slope(degrees: f64, friction: f64) -> f64 {
    let (half, model) = (degrees.to_radians() / 2.0, block([3.0, 0.5, 0.1]));
    let tilted = |position| Pose {
        position,
        rotation: [0.0, half.sin(), 0.0, half.cos()],
    };
    let slope = tilted([0.0, 0.0, 1.0]);
    let on_it = slope.to_isometry() * nalgebra::Point3::new(-1.0, 0.0, 0.1);
    let mut world = world(vec![
        object("slope", model, Role::Platform, slope, 10.0, friction),
        object(
            "a",
            block([0.2, 0.2, 0.05]),
            Role::Target,
            tilted(on_it.coords.into()),
            1.0,
            friction,
        ),
    ]);
    let start = body(&world, "a").pose;
    run(&mut world, 1.0);
    distance(&start, &body(&world, "a").pose)
}

/// Coulomb: a block rests below the angle whose tangent is µ; above it, it slides with g·(sin −
/// µ·cos).
#[test]
fn a_block_slides_above_the_friction_angle_and_rests_below_it() {
    let friction: f64 = 0.4;
    let critical = friction.atan().to_degrees();
    assert!(
        slide_on_slope(critical - 0.7, friction) < 2e-3,
        "slid {}",
        slide_on_slope(critical - 0.7, friction)
    );
    for above in [2.0, 8.0] {
        let angle = (critical + above).to_radians();
        let expected = GRAVITY * (angle.sin() - friction * angle.cos()) / 2.0;
        let slid = slide_on_slope(critical + above, friction);
        assert!(
            (slid / expected - 1.0).abs() < 0.06,
            "slid {slid} m, expected {expected} m at {above} above"
        );
    }
}

/// Constant deceleration µ·g: v² / (2·µ·g).
#[test]
fn a_sliding_block_stops_after_its_stopping_distance() {
    for (friction, speed) in [(0.5, 1.5), (0.3, 1.0)] {
        let floor = block([6.0, 1.0, 0.2]);
        let on_it = Pose::upright([-2.0, 0.0, 0.2], 0.0);
        let mut world = world(vec![
            object(
                "floor",
                floor,
                Role::Platform,
                Pose::IDENTITY,
                10.0,
                friction,
            ),
            object(
                "a",
                block([0.2, 0.2, 0.04]),
                Role::Target,
                on_it,
                1.0,
                friction,
            ),
        ]);
        run(&mut world, 0.2);
        let start = body(&world, "a").pose;
        assert!(world.poison("a", Poison::Velocity([speed, 0.0, 0.0])));
        run(&mut world, 2.0);
        let slid = distance(&start, &body(&world, "a").pose);
        let expected = speed * speed / (2.0 * friction * GRAVITY);
        assert!(
            (slid / expected - 1.0).abs() < 0.05,
            "slid {slid} m, expected {expected} m"
        );
    }
}

/// A stack's contact forces are the weights above them, and supporting contacts are distinguished
/// from mere contacts.
#[test]
fn resting_forces_equal_the_weights() {
    let at = |z| Pose::upright([0.0, 0.0, z], 0.0);
    let mut world = world(vec![
        object(
            "low",
            block([0.2, 0.2, 0.1]),
            Role::Target,
            at(0.0),
            2.0,
            0.5,
        ),
        object(
            "high",
            block([0.1, 0.1, 0.1]),
            Role::Other,
            at(0.1),
            1.0,
            0.5,
        ),
    ]);
    run(&mut world, 0.4);
    world.begin_record();
    run(&mut world, 0.1);
    let record = world.end_record();
    let force = |pair: [&str; 2]| {
        let contact = record
            .contacts
            .iter()
            .find(|contact| contact.pair == pair.map(str::to_owned));
        contact
            .unwrap_or_else(|| panic!("{pair:?} touch"))
            .max_force_n
    };
    assert!(
        (force(["high", "low"]) / GRAVITY - 1.0).abs() < 0.03,
        "{}",
        force(["high", "low"])
    );
    assert!(
        (force(["floor", "low"]) / (3.0 * GRAVITY) - 1.0).abs() < 0.03,
        "{}",
        force(["floor", "low"])
    );
    assert_eq!(body(&world, "high").rests_on, ["low"]);
    assert_eq!(body(&world, "low").rests_on, ["floor"]);
    assert_eq!(body(&world, "low").touches, ["floor", "high"]);
}

fn pick(scene: &Scene, disturb: impl FnOnce(&mut World)) -> Trace {
    let mut world = build(scene).expect("the scene is right");
    assert!(world.settle().settled);
    disturb(&mut world);
    perform(
        &[call("Pick")],
        &mut world,
        &mut Choices::random(1, 0),
        &Budget { action_secs: 60.0 },
    )
}

/// A thing alone on a coffee table, a metre in front of the robot.
pub(crate) fn on_table(model: Arc<ObjectModel>, mass_kg: f64, friction: f64) -> Scene {
    let table = shipped("coffee_table");
    let mut scene = scene(vec![
        object("table_1", table, Role::Platform, Pose::IDENTITY, 14.0, 0.5),
        object(
            "thing_1",
            model,
            Role::Target,
            Pose::upright([-0.1, 0.02, 0.706], 0.0),
            mass_kg,
            friction,
        ),
    ]);
    scene.robot.base = [-1.0, 0.0, 0.0];
    scene
}

/// Two fingers that push with F each hold up to 2·µ·F. Surfaces use the geometric mean of their
/// frictions.
#[test]
fn a_grip_holds_below_its_friction_limit_and_slips_above_it() {
    let (friction, profile) = (0.2_f64, robot());
    let limit_kg =
        2.0 * (friction * profile.hand.finger_friction).sqrt() * profile.hand.grip_force_n
            / GRAVITY;
    for (share, holds) in [(0.85, true), (1.12, false)] {
        let trace = pick(
            &on_table(block([0.06, 0.06, 0.15]), share * limit_kg, friction),
            |_| {},
        );
        let after = trace.snapshots.last().expect("there is a last state");
        let thing = &after.bodies[1];
        let risen = thing.pose.position[2] - trace.snapshots[0].bodies[1].pose.position[2];
        assert_eq!(
            thing.rests_on == ["robot"],
            holds,
            "{share} of the limit: rests on {:?}",
            thing.rests_on
        );
        assert_eq!(
            risen > 0.11,
            holds,
            "{share} of the limit: rose by {risen} m"
        );
        let slipped = (after.robot.gripper.position[2] - thing.pose.position[2] - 0.075).abs();
        assert!(
            !holds || slipped < 0.008,
            "{share} of the limit: slipped by {slipped} m"
        );
        let report = trace.actions[0].report.as_ref().expect("the skill reports");
        assert_eq!(report.succeeded, holds, "{}", report.message);
    }
}

/// The load on the lift exceeds its motor's effort: the lower stop holds, and the motor does not
/// raise it.
#[test]
fn a_joint_limit_holds_under_load() {
    let weight = Pose::upright([0.05, 0.05, 0.402], 0.0);
    let mut scene = scene(vec![object(
        "weight",
        block([0.08, 0.08, 0.08]),
        Role::Other,
        weight,
        40.0,
        0.8,
    )]);
    scene.robot.base = [0.0, 0.0, 0.0];
    let mut world = build(&scene).expect("the scene is right");
    let mut command = world.hold();
    let lift = world.layout().arm[0];
    let lift_joint = world.kinematics().joints()[lift].clone();
    command.positions[lift] = 0.2;
    for _ in 0..180 {
        world.step(&command);
    }
    assert_eq!(body(&world, "weight").rests_on, ["robot"]);
    assert!(
        40.0 * GRAVITY > lift_joint.effort,
        "the load must exceed the motor's effort"
    );
    let position = world.observe().positions[lift];
    assert!(
        (lift_joint.lower - 0.002..lift_joint.lower + 0.002).contains(&position),
        "{position}"
    );
    // Without the load the same motor gets there.
    assert!(world.poison("weight", Poison::Teleport([2.0, 0.0, 0.1])));
    for _ in 0..180 {
        world.step(&command);
    }
    assert!((world.observe().positions[lift] - 0.2).abs() < 0.002);
}

/// Commands beyond the limits end at the limits, and no joint exceeds its velocity limit.
#[test]
fn joint_limits_of_position_and_velocity_override_commands() {
    let mut world = world(Vec::new());
    // Links in contact can push each other beyond these limits.
    world.let_links_pass(true);
    let mut command = world.hold();
    let arm = world.layout().arm.clone();
    // The lift goes up first and down last, when the arm is upright again: it would hit the floor.
    let courses: [[f64; 5]; 4] = [
        [100.0, 100.0, 100.0, 100.0, 100.0],
        [100.0, -100.0, -100.0, -100.0, -100.0],
        [100.0, 100.0, -100.0, -100.0, -100.0],
        [-100.0, 100.0, -100.0, -100.0, -100.0],
    ];
    for course in courses {
        for (joint, position) in arm.iter().zip(course) {
            command.positions[*joint] = position;
        }
        for _ in 0..60 * 6 {
            world.step(&command);
            let observed = world.observe();
            for joint in &arm {
                let limits = &world.kinematics().joints()[*joint];
                let (position, speed) = (
                    observed.positions[*joint],
                    observed.velocities[*joint].abs(),
                );
                assert!(
                    (limits.lower - 0.01..limits.upper + 0.01).contains(&position),
                    "{} {position}",
                    limits.name
                );
                assert!(
                    speed < 1.15 * limits.velocity,
                    "{} moves with {speed}",
                    limits.name
                );
            }
        }
        for joint in &arm {
            let limits = &world.kinematics().joints()[*joint];
            let end = if command.positions[*joint] > 0.0 {
                limits.upper
            } else {
                limits.lower
            };
            let position = world.observe().positions[*joint];
            assert!(
                (position - end).abs() < 0.01,
                "{} is at {position} instead of {end}",
                limits.name
            );
        }
    }
}

/// The arm holds its commanded posture within a tenth of its sag without gravity compensation.
#[test]
fn the_arm_is_gravity_compensated() {
    let mut world = world(Vec::new());
    let mut command = world.hold();
    let arm = world.layout().arm.clone();
    for (joint, position) in arm.iter().zip([0.3, -1.5, 0.4, -0.5, 0.3]) {
        command.positions[*joint] = position;
    }
    for _ in 0..60 * 4 {
        world.step(&command);
    }
    let positions = world.observe().positions;
    let needed = world.kinematics().holding_efforts(&positions);
    assert!(
        needed[arm[1]].abs() > 5.0,
        "the posture must load the shoulder: {} N·m",
        needed[arm[1]]
    );
    // The motors reach full effort at an error of 0.02 rad: without compensation the shoulder would
    // sag by that much.
    let shoulder = &world.kinematics().joints()[arm[1]];
    let sag = needed[arm[1]].abs() / shoulder.effort * 0.02;
    let error_of = |joint: usize| (positions[joint] - command.positions[joint]).abs();
    assert!(
        error_of(arm[1]) < 0.1 * sag,
        "shoulder: {} rad of {sag} rad",
        error_of(arm[1])
    );
    // The lift's motor is so stiff that the engine's own step error dominates.
    assert!(error_of(arm[0]) < 5e-4, "lift: {} m", error_of(arm[0]));
}

#[test]
fn the_same_scene_gives_the_same_bits() {
    let scene = on_table(shipped("glass"), 0.3, 0.45);
    let (first, again) = (pick(&scene, |_| {}), pick(&scene, |_| {}));
    assert_eq!(first, again);
    let mut other = scene.clone();
    other.objects[1].mass_kg += 1e-4;
    assert_ne!(first.hash, pick(&other, |_| {}).hash);
}

#[test]
fn a_state_that_is_not_a_number_ends_the_action_as_broken() {
    let scene = on_table(shipped("glass"), 0.3, 0.45);
    let trace = pick(&scene, |world| {
        assert!(world.poison("thing_1", Poison::NotFinite))
    });
    assert_eq!(
        trace.actions[0].end,
        ActionEnd::Broken("the state of thing_1 is not a number".to_owned())
    );
    assert_eq!(trace.actions[0].report, None);
    assert_eq!(trace.snapshots.len(), 2);
}

#[test]
fn a_body_that_leaves_the_world_ends_the_action_as_broken() {
    let scene = on_table(shipped("glass"), 0.3, 0.45);
    let trace = pick(&scene, |world| {
        assert!(world.poison("thing_1", Poison::Teleport([0.0, 0.0, -2.0])))
    });
    let ActionEnd::Broken(reason) = &trace.actions[0].end else {
        panic!("{:?}", trace.actions[0].end)
    };
    assert!(reason.starts_with("thing_1 left the world at"), "{reason}");
}

pub(crate) fn call(action: &str) -> ActionCall {
    let parameters = BTreeMap::from([("pickObject".to_owned(), vec!["thing_1".to_owned()])]);
    ActionCall {
        action: action.to_owned(),
        parameters,
    }
}

#[test]
fn a_spent_budget_and_an_unknown_action_end_the_run_with_a_record() {
    let scene = on_table(shipped("glass"), 0.3, 0.45);
    for (action, budget) in [("Pick", 2.0), ("Juggle", 60.0)] {
        let mut world = build(&scene).expect("the scene is right");
        let calls = [call(action), call("Pick")];
        let trace = perform(
            &calls,
            &mut world,
            &mut Choices::random(1, 0),
            &Budget {
                action_secs: budget,
            },
        );
        let ends: Vec<&ActionEnd> = trace.actions.iter().map(|action| &action.end).collect();
        match action {
            "Pick" => assert!(
                matches!(ends[0], ActionEnd::Timeout(reason) if reason.contains("2 s")),
                "{ends:?}"
            ),
            _ => assert!(
                matches!(ends[0], ActionEnd::Broken(reason) if reason.contains("`Juggle`")),
                "{ends:?}"
            ),
        }
        assert_eq!(*ends[1], ActionEnd::NotReached);
        assert_eq!(trace.snapshots.len(), 2);
    }
}

/// The percepts and the robot's localisation are wrong by the same error, so the robot still
/// reaches the object.
#[test]
fn a_localisation_error_alone_does_not_make_a_pick_miss() {
    let mut scene = on_table(shipped("glass"), 0.3, 0.45);
    scene.sensing.localisation_noise_m = 0.1;
    scene.sensing.heading_noise_rad = 0.1;
    let trace = pick(&scene, |_| {});
    let (before, after) = (&trace.snapshots[0], &trace.snapshots[1]);
    let [true_x, true_y, _] = before.robot.base_true;
    let [x, y, _] = before.robot.base_believed;
    assert!(
        (x - true_x).abs() + (y - true_y).abs() > 0.02,
        "the noise must be visible"
    );
    assert_eq!(after.robot.left_touches, ["thing_1"]);
    assert_eq!(after.robot.right_touches, ["thing_1"]);
}

#[test]
fn an_object_that_falls_while_settling_is_reported_and_is_not_a_fault() {
    let mut scene = on_table(shipped("glass"), 0.3, 0.45);
    // Half of it is over the edge.
    scene.objects[1].pose = Pose::upright([0.33, 0.0, 0.706], 0.0);
    let mut world = build(&scene).expect("the scene is right");
    let settling = world.settle();
    assert!(!settling.settled);
    assert_eq!(settling.left, ["thing_1"]);
    assert_eq!(world.fault(), None);
}

/// An object tilted on its rim and released.
fn tipped(model: &Arc<ObjectModel>, tilt_rad: f64, steps_per_second: u32) -> World {
    let tilt = nalgebra::UnitQuaternion::from_axis_angle(&nalgebra::Vector3::x_axis(), tilt_rad);
    let lift = model.size_m[0].max(model.size_m[1]) / 2.0 * tilt_rad.sin();
    let pose = Pose::from_isometry(&nalgebra::Isometry3::from_parts(
        nalgebra::Translation3::new(0.0, 0.0, 0.1 + lift),
        tilt,
    ));
    let target = object(
        "thing",
        Arc::clone(model),
        Role::Target,
        pose,
        model.mass_kg,
        model.friction,
    );
    let slab = object(
        "slab",
        block([1.0, 1.0, 0.1]),
        Role::Platform,
        Pose::IDENTITY,
        1.0,
        0.5,
    );
    let mut scene = scene(vec![slab, target]);
    scene.physics.iterations = 4;
    scene.physics.steps_per_second = steps_per_second;
    build(&scene).expect("the scene is right")
}

/// How far a body leans. Unit: radian.
fn lean(world: &World, id: &str) -> f64 {
    let up = body(world, id).pose.to_isometry().rotation * nalgebra::Vector3::z();
    up.z.clamp(-1.0, 1.0).acos()
}

/// An object that rocks on its rim gains no energy: it never leans further than at first, and comes
/// to rest.
#[test]
fn slightly_tilted_objects_come_to_rest() {
    let names = [
        "bottle",
        "bowl",
        "box",
        "can",
        "fork",
        "glass",
        "mug",
        "plate",
        "salt_shaker",
        "spoon",
    ];
    let cases = names.iter().flat_map(|name| {
        [
            (name, 0.04, 240),
            (name, 0.1, 240),
            (name, 0.1, 960),
            (name, 0.2, 240),
        ]
    });
    for (name, tilt_rad, rate) in cases {
        let mut world = tipped(&shipped(name), tilt_rad, rate);
        let mut most: f64 = 0.0;
        for _ in 0..60 {
            run(&mut world, 0.05);
            most = most.max(lean(&world, "thing"));
        }
        assert!(
            most < tilt_rad + 0.01,
            "{name} tipped by {tilt_rad} at {rate} steps/s leaned by {most}"
        );
        let left = lean(&world, "thing");
        assert!(
            left < 0.02,
            "{name} tipped by {tilt_rad} at {rate} steps/s still leans by {left}"
        );
    }
}

/// A bottle that rolls around on its rim gains a little energy: its contact moves by two
/// millimetres between two steps, and the engine solves each step with the contact of its
/// beginning. This is wrong, but far below the limit of `health`, and it has nothing to do with the
/// robot's motion: the robot does not come near.
#[test]
fn a_bottle_that_rolls_on_its_rim_gains_little_energy() {
    let gain_j = |prepare: fn(&mut World)| {
        let mut world = tipped(&shipped("bottle"), 0.06, 240);
        prepare(&mut world);
        assert!(world.poison("thing", Poison::Velocity([0.14, 0.0, 0.0])));
        world.begin_record();
        run(&mut world, 3.0);
        world.recorder().quality().energy_gain_j
    };
    let (usual, in_engine) = (
        gain_j(|_| {}),
        gain_j(|world| world.take_shortcuts(Shortcuts::NONE)),
    );
    assert!(usual < 0.02, "{usual} J");
    assert!(
        (usual - in_engine).abs() < 1e-6,
        "{usual} J, without free motion {in_engine} J"
    );
}
