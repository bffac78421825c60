//! The changed scene of a pair: the choices of its second run.

use std::collections::BTreeMap;

use nalgebra::{Quaternion, UnitQuaternion};

use crate::Env;
use crate::shrink::drop_rejected_tries;
use actcheck_config::SceneChange;
use actcheck_data::{
    Choice, ChoiceKind, ChoiceName, Choices, ObjectAxis, PlacedObject, PlanarAxis, Pose,
    RobotProfile, Role, Scene, SightingAxis, StartAxis, WheelAxis,
};
use actcheck_scenario as scenario;

/// Change of the target's friction and mass, as a share.
const STEP: f64 = 0.1;
/// Objects nearer to the target than this may be in the robot's way. Unit: metres.
const FAR_M: f64 = 0.35;
/// Greatest difference between a scene and its mirror image, by rounding. Units: metres, radians.
const SAME: f64 = 1e-6;

/// Returns the choices of the changed scene, with the noise of the run; or the reason why the scene
/// can't be changed so.
pub(super) fn changed(
    env: &Env,
    index: u64,
    recorded: &[Choice],
    change: SceneChange,
) -> Result<Vec<Choice>, String> {
    let list = drop_rejected_tries(recorded);
    let draw = |list: &[Choice]| {
        let mut choices = Choices::recorded(list);
        scenario::draw(&env.space, env.test_of(index), &mut choices)
            .map_err(|reason| format!("the changed scene can't be built: {reason}"))
    };
    let scene = draw(&list)?;
    let list = match change {
        SceneChange::Mirrored => mirrored(env, list, &scene)?,
        SceneChange::MoreFriction => {
            scaled(list, ObjectAxis::FrictionScale, "friction", 1.0 + STEP)?
        }
        SceneChange::LessMass => scaled(list, ObjectAxis::MassScale, "mass", 1.0 - STEP)?,
        SceneChange::WithoutFarObject => without_far(list, &scene)?,
        SceneChange::Renamed => {
            let marked = with_mark(list, ChoiceName::Renamed);
            let other = draw(&marked)?;
            renamed(marked, &scene, &other)
        }
    };
    let other = draw(&list)?;
    match change {
        SceneChange::Mirrored if !is_mirror_image(&scene, &other) => {
            Err("within the configuration's ranges, the scene has no mirror image".to_owned())
        }
        _ => Ok(list),
    }
}

/// Swaps left and right of a scene on the empty floor, whose surface and robot are symmetric.
fn mirrored(env: &Env, mut list: Vec<Choice>, scene: &Scene) -> Result<Vec<Choice>, String> {
    let camera = &env.robot.profile.camera.link;
    if !env.campaign.worlds.is_empty() {
        return Err("a world has no mirror image".to_owned());
    }
    if camera == RobotProfile::MAP {
        return Err("the camera beside the robot has no mirror image".to_owned());
    }
    let n_platforms = scene
        .objects
        .iter()
        .filter(|object| object.role == Role::Platform)
        .count();
    if n_platforms > 1 {
        return Err("the surface to place on is always to the left".to_owned());
    }
    for choice in &mut list {
        if changes_sign(&choice.name) {
            choice.value = -choice.value;
        }
    }
    Ok(list)
}

/// Whether the mirror changes the sign of a choice's value.
fn changes_sign(name: &ChoiceName) -> bool {
    match name {
        ChoiceName::Object(_, axis) => matches!(axis, ObjectAxis::Y | ObjectAxis::Yaw),
        ChoiceName::Robot(axis) => {
            matches!(axis, StartAxis::Side | StartAxis::Y | StartAxis::Heading)
        }
        ChoiceName::Localisation(axis) | ChoiceName::Landmark(axis) => {
            matches!(axis, PlanarAxis::Y | PlanarAxis::Heading)
        }
        ChoiceName::Odometry(axis) => matches!(
            axis,
            WheelAxis::Across | WheelAxis::Turning | WheelAxis::Veering
        ),
        ChoiceName::Sighting { axis, .. } => {
            matches!(axis, SightingAxis::Y | SightingAxis::Yaw)
        }
        _ => false,
    }
}

fn is_mirror_image(scene: &Scene, other: &Scene) -> bool {
    let [x, y, heading] = scene.robot.base;
    let base = [x, -y, -heading];
    let same_base = base
        .iter()
        .zip(other.robot.base)
        .all(|(a, b)| (a - b).abs() < SAME);
    let pairs = scene.objects.iter().zip(&other.objects);
    let n_same = pairs.filter(|(object, image)| {
        object.id == image.id && is_same_pose(&mirror_image(&object.pose), &image.pose)
    });
    same_base && n_same.count() == scene.objects.len()
}

fn mirror_image(pose: &Pose) -> Pose {
    let mut pose = pose.to_isometry();
    pose.translation.vector.y = -pose.translation.vector.y;
    let Quaternion { coords } = *pose.rotation.quaternion();
    let image = Quaternion::new(coords.w, -coords.x, coords.y, -coords.z);
    pose.rotation = UnitQuaternion::new_normalize(image);
    Pose::from_isometry(&pose)
}

fn is_same_pose(a: &Pose, b: &Pose) -> bool {
    let (a, b) = (a.to_isometry(), b.to_isometry());
    (a.translation.vector - b.translation.vector).norm() < SAME
        && a.rotation.angle_to(&b.rotation) < SAME.sqrt()
}

/// Scales a factor of the target as far as its range allows.
fn scaled(
    mut list: Vec<Choice>,
    axis: ObjectAxis,
    what: &str,
    factor: f64,
) -> Result<Vec<Choice>, String> {
    let name = ChoiceName::Object(PlacedObject::Target, axis);
    let Some(choice) = list.iter_mut().find(|choice| choice.name == name) else {
        return Err("the scene has no target".to_owned());
    };
    let ChoiceKind::Real { low, high, .. } = choice.kind else {
        return Err(format!(
            "the configuration does not vary the target's {what}"
        ));
    };
    let value = (choice.value * factor).clamp(low, high);
    if (value - choice.value).abs() < SAME {
        return Err(format!(
            "the target's {what} is at the end of the configuration's range"
        ));
    }
    choice.value = value;
    Ok(list)
}

/// Leaves out the other object that is farthest from the target.
fn without_far(list: Vec<Choice>, scene: &Scene) -> Result<Vec<Choice>, String> {
    let of_role = |role: Role| {
        scene
            .objects
            .iter()
            .filter(move |object| object.role == role)
    };
    let Some(target) = of_role(Role::Target).next() else {
        return Err("the scene has no target".to_owned());
    };
    let is_left_out = |object: PlacedObject| {
        let name = ChoiceName::Object(object, ObjectAxis::LeftOut);
        list.iter().any(|choice| choice.name == name)
    };
    let numbers = list.iter().filter_map(|choice| match choice.name {
        ChoiceName::Object(object @ PlacedObject::Other(_), ObjectAxis::Model) => Some(object),
        _ => None,
    });
    let away_m = |pose: &Pose| {
        let [x, y, _] = pose.position;
        libm::hypot(x - target.pose.position[0], y - target.pose.position[1])
    };
    let farthest = numbers
        .filter(|object| !is_left_out(*object))
        .zip(of_role(Role::Other))
        .map(|(number, object)| (number, away_m(&object.pose)))
        .max_by(|a, b| a.1.total_cmp(&b.1));
    match farthest {
        Some((number, away_m)) if away_m > FAR_M => Ok(with_mark(
            list,
            ChoiceName::Object(number, ObjectAxis::LeftOut),
        )),
        _ => Err(format!(
            "no other object is more than {} cm from the target",
            FAR_M * 100.0
        )),
    }
}

/// The choices with one more: an exception, which is asked for.
fn with_mark(mut list: Vec<Choice>, name: ChoiceName) -> Vec<Choice> {
    list.insert(
        0,
        Choice {
            name,
            kind: ChoiceKind::Index { of: 2 },
            value: 1.0,
        },
    );
    list
}

/// The choices with the new ids of all objects: errors of sensing keep their object.
fn renamed(mut list: Vec<Choice>, scene: &Scene, other: &Scene) -> Vec<Choice> {
    let new_ids: BTreeMap<&str, &str> = scene
        .objects
        .iter()
        .zip(&other.objects)
        .map(|(object, same)| (object.id.as_str(), same.id.as_str()))
        .collect();
    for choice in &mut list {
        if let ChoiceName::Sighting { id, axis } = &choice.name
            && let Some(new) = new_ids.get(id.as_str())
        {
            choice.name = ChoiceName::sighting(new, *axis);
        }
        if let (ChoiceName::Step { .. }, ChoiceKind::Candidate { names }) =
            (&choice.name, &mut choice.kind)
        {
            for name in names {
                if let Some(new) = new_ids.get(name.as_str()) {
                    *name = (*new).to_owned();
                }
            }
        }
    }
    list
}
