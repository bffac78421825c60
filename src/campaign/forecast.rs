//! Warnings about objects and surfaces of the scene space that the robot can't handle, from its
//! gripper, arm and camera.
//!
//! Only the reference skills are foreseen: a program that performs actions may grasp in other ways.
//! Nothing is simulated.

use std::collections::{BTreeMap, BTreeSet};

use crate::Env;
use actcheck_actions::{self as actions, PickFault};
use actcheck_base::{Diagnostic, Diagnostics};
use actcheck_config::Launcher;
use actcheck_data::{
    ChoiceName, ChoiceValue, Choices, ObjectAxis, ObjectModel, PlacedObject, Scene,
};
use actcheck_scenario as scenario;
use actcheck_world::{self as world, GRAVITY, World};

/// Places of the target on the surface at which a pick is planned: the middle and two opposite
/// corners. Values beyond the surface are limited to it. Unit: metres.
const PLACES_M: [[f64; 2]; 3] = [[0.0, 0.0], [FAR_M, FAR_M], [-FAR_M, -FAR_M]];
const FAR_M: f64 = 1e3;
/// Height of the camera above a surface below which it sees the surface edge-on. Unit: metres.
const LEAST_ABOVE_M: f64 = 0.05;
/// Share of the camera's picture on each side of the middle in which a surface's middle must be.
const IN_VIEW: f64 = 0.5;

impl Env {
    /// Predicts which objects and surfaces the robot can't handle, as warnings with numbers: the
    /// gripper is too narrow or its cup does not seal (S070), objects are out of reach (S071) or
    /// too heavy (S072), the camera does not see a surface (S073), the arm's motors can't hold its
    /// own weight (S074), efforts are unknown (S075), or a shape is between the fingers (S076).
    pub fn forecast(&self) -> Diagnostics {
        let mut found = Diagnostics::new();
        let campaign = &self.campaign;
        if !matches!(campaign.launcher, Launcher::Reference) || campaign.case.is_some() {
            return found;
        }
        found.extend(
            self.unknown_efforts()
                .into_iter()
                .chain(self.unknown_speeds())
                .chain(self.too_weak())
                .collect(),
        );
        found.extend(self.obstructed().into_iter().collect());
        let scenes = self.nominal_scenes();
        if let Some(test) = self.test_with("PerceivePlane") {
            self.foresee_views(&scenes, test, &mut found);
        }
        let Some(test) = self.test_with("Pick") else {
            return found;
        };
        for (idx, name) in campaign
            .candidates
            .get("pickObject")
            .into_iter()
            .flatten()
            .enumerate()
        {
            let Some(model) = campaign.models.get(name) else {
                continue;
            };
            let key = format!("pickObject.{idx}");
            let unheld = match self.robot.profile.hand.suction {
                Some(cup) => self.unsealed(&key, model, &cup),
                None => {
                    let narrow = self
                        .too_wide(&key, model)
                        .or_else(|| self.too_slippery(&key, model));
                    narrow.or_else(|| self.squeezed_out(&key, model))
                }
            };
            if let Some(warning) = unheld {
                found.push(warning);
                continue;
            }
            for scene in &scenes {
                found.extend(
                    self.foresee_picks(&key, model, scene, test)
                        .into_iter()
                        .collect(),
                );
            }
        }
        found
    }

    /// Index of the first test with this action.
    fn test_with(&self, action: &str) -> Option<usize> {
        self.campaign
            .tests
            .iter()
            .position(|test| test.iter().any(|step| step.action == action))
    }

    /// Choices of a scene for each world and each surface in it.
    fn nominal_scenes(&self) -> Vec<(String, BTreeMap<ChoiceName, Vec<ChoiceValue>>)> {
        let of = |designator: &str| {
            self.campaign
                .candidates
                .get(designator)
                .cloned()
                .unwrap_or_default()
        };
        let worlds = of("world");
        let worlds: Vec<Option<&String>> = match worlds.is_empty() {
            true => vec![None],
            false => worlds.iter().map(Some).collect(),
        };
        let (mut scenes, mut known) = (Vec::new(), BTreeSet::new());
        for world in worlds {
            for surface in of("objectSurface") {
                let candidate = |name: &str| vec![ChoiceValue::Candidate(name.to_owned())];
                let mut values = BTreeMap::new();
                values.extend(world.map(|world| (ChoiceName::World, candidate(world))));
                values.insert(ChoiceName::SurfaceName, candidate(&surface));
                values.insert(ChoiceName::SurfaceModel, candidate(&surface));
                // A world without this surface has another one.
                let drawn = self
                    .draw(&values, 0)
                    .and_then(|scene| designated(&scene, "objectSurface"));
                if drawn.is_some_and(|surface| known.insert((world.cloned(), surface))) {
                    scenes.push((surface, values));
                }
            }
        }
        scenes
    }

    fn draw(&self, values: &BTreeMap<ChoiceName, Vec<ChoiceValue>>, test: usize) -> Option<Scene> {
        scenario::draw(&self.space, test, &mut Choices::named(values)).ok()
    }

    /// S076 if a shape is between the fingers.
    fn obstructed(&self) -> Option<Diagnostic> {
        let robot = &self.robot.profile;
        if robot.hand.suction.is_some() {
            return None;
        }
        let links = self.robot.shapes_between_fingers();
        if links.is_empty() {
            return None;
        }
        let names = links.join("`, `");
        let message = format!(
            "the shape of `{names}` is between the fingers of {}: it keeps every object out of the hand",
            robot.core.name,
        );
        let quoted = links
            .iter()
            .map(|link| format!("\"{link}\""))
            .collect::<Vec<_>>()
            .join(", ");
        let help = format!(
            "if no real part is there, write `no_collision_links = [{quoted}]` into the robot's profile"
        );
        Some(
            self.campaign
                .warning("S076", "robot.profile", message)
                .help(help),
        )
    }

    /// S075 if joints with a role have no known effort.
    fn unknown_efforts(&self) -> Option<Diagnostic> {
        let robot = &self.robot.profile;
        let (joints, effort) = (self.robot.assumed_efforts(), world::UNKNOWN_EFFORT);
        if joints.is_empty() {
            return None;
        }
        let message = format!(
            "the `effort` of `{}` of {} is 0 or -1, and so unknown: {effort} N or N·m is used",
            joints.join("`, `"),
            robot.core.name,
        );
        let help = "state the largest force or torque of each joint in the robot's file: in URDF `<limit effort=\"…\">`, in SDF \
             `<effort>`, in MJCF the `forcerange` of its actuator";
        Some(
            self.campaign
                .warning("S075", "robot.profile", message)
                .help(help),
        )
    }

    /// S075 if joints with a role have no known speed.
    fn unknown_speeds(&self) -> Option<Diagnostic> {
        let robot = &self.robot.profile;
        let (joints, [turning, sliding]) = (self.robot.assumed_speeds(), world::UNKNOWN_SPEEDS);
        if joints.is_empty() {
            return None;
        }
        let message = format!(
            "the largest `velocity` of `{}` of {} is 0 or -1, and so unknown: {turning} rad/s or {sliding} m/s is used",
            joints.join("`, `"),
            robot.core.name,
        );
        let help = "state the largest speed of each joint in the robot's file: in URDF `<limit velocity=\"…\">`, in SDF \
             `<velocity>`";
        Some(
            self.campaign
                .warning("S075", "robot.profile", message)
                .help(help),
        )
    }

    /// S074 for each joint of the arm that can't hold the arm by its motor alone.
    fn too_weak(&self) -> Vec<Diagnostic> {
        let robot = &self.robot.profile;
        let warning = |joint: &world::BalancedJoint| {
            let message = format!(
                "the joint `{}` of {} can't hold the arm: its `effort` is {:.1}, and the weight of the links beyond it \
                 needs up to {:.1}; it is simulated as balanced by a spring",
                joint.name, robot.core.name, joint.effort, joint.weight,
            );
            let help = "nothing, if the robot has springs or counterweights; otherwise correct the joint's `effort`, or \
                        the masses of the links, in the robot's file";
            self.campaign
                .warning("S074", "robot.profile", message)
                .help(help)
        };
        self.robot.balanced_joints().iter().map(warning).collect()
    }

    /// S070 if the gripper opens too little for the narrower side.
    fn too_wide(&self, key: &str, model: &ObjectModel) -> Option<Diagnostic> {
        let (robot, [width, depth, _]) = (&self.robot.profile, model.size_m);
        let needed_m = actions::needed_opening_m(width.min(depth));
        let at_rim = model
            .rim()
            .is_some_and(|rim| actions::takes_rim(&rim, robot.hand.max_opening_m));
        if needed_m <= robot.hand.max_opening_m || at_rim || self.campaign.lying.0 > 0.0 {
            return None;
        }
        let message = format!(
            "`{}` is too wide for the gripper: it is {} × {} across and needs {} with room on both sides, but the \
             fingers of {} open {}",
            model.name,
            centimetres(width),
            centimetres(depth),
            centimetres(needed_m),
            robot.core.name,
            centimetres(robot.hand.max_opening_m),
        );
        let help = "every pick of it will fail: name a narrower object, or a robot whose gripper opens wider";
        Some(self.campaign.warning("S070", key, message).help(help))
    }

    /// S072 if friction between the fingers can't carry the heaviest variant of the object.
    fn too_slippery(&self, key: &str, model: &ObjectModel) -> Option<Diagnostic> {
        let (robot, physics) = (&self.robot.profile, &self.campaign.physics);
        let friction =
            (robot.hand.finger_friction * model.friction * physics.friction_scale.1).sqrt();
        let carried_kg = 2.0 * friction * robot.hand.grip_force_n / GRAVITY;
        let lightest_kg = model.mass_kg * physics.mass_scale.0;
        if lightest_kg <= carried_kg {
            return None;
        }
        let message = format!(
            "`{}` slips out of the gripper: it has at least {lightest_kg:.2} kg, and two fingers that press with {:.1} N carry \
             {carried_kg:.2} kg at a friction coefficient of {friction:.2}",
            model.name, robot.hand.grip_force_n,
        );
        let help = "every pick of it will fail: reduce the object's mass, or raise `grip_force_n` in the robot's profile, or \
             the `effort` of the finger joints in its file if that limits it";
        Some(self.campaign.warning("S072", key, message).help(help))
    }

    /// S072 if the fingers are so steep a wedge around the object that friction does not hold it:
    /// half of the angle between them is above the friction angle.
    fn squeezed_out(&self, key: &str, model: &ObjectModel) -> Option<Diagnostic> {
        let (robot, [width, depth, _]) = (&self.robot.profile, model.size_m);
        let width_m = width.min(depth);
        let steepness = self.robot.outward_push(width_m)?;
        let friction = (robot.hand.finger_friction * model.friction).sqrt();
        if steepness < friction {
            return None;
        }
        let degrees = |tangent: f64| libm::atan(tangent).to_degrees();
        let message = format!(
            "`{}` is squeezed out of the gripper: where the fingers of {} hold its width of {}, they are at {:.0}° to each \
             other, and friction with a coefficient of {friction:.2} holds up to {:.0}°",
            model.name,
            robot.core.name,
            centimetres(width_m),
            2.0 * degrees(steepness),
            2.0 * degrees(friction),
        );
        let help = "most picks of it will fail: name a narrower object or one with more friction, or move `grasp_offset_m` in the \
             robot's profile along the fingers, to where they squeeze it out less";
        Some(self.campaign.warning("S072", key, message).help(help))
    }

    /// S071 or S072 for an object on a surface, if the arm does not reach or hold it.
    fn foresee_picks(
        &self,
        key: &str,
        model: &ObjectModel,
        (surface, values): &(String, BTreeMap<ChoiceName, Vec<ChoiceValue>>),
        test: usize,
    ) -> Option<Diagnostic> {
        let (mut reasons, mut n_places) = (Vec::new(), 0);
        let mut weakest: Option<actions::ForeseenPick> = None;
        for [x, y] in PLACES_M {
            let mut values = values.clone();
            let mut set = |axis, value| {
                values.insert(ChoiceName::Object(PlacedObject::Target, axis), vec![value])
            };
            set(
                ObjectAxis::Model,
                ChoiceValue::Candidate(model.name.clone()),
            );
            set(ObjectAxis::X, ChoiceValue::Number(x));
            set(ObjectAxis::Y, ChoiceValue::Number(y));
            let Some(scene) = self.draw(&values, test) else {
                continue;
            };
            let (Some(target), Ok(mut world)) = (
                designated(&scene, "pickObject"),
                world::build_with(&scene, &self.robot),
            ) else {
                continue;
            };
            n_places += 1;
            match actions::foresee_pick(&target, &mut world, &mut Choices::named(&values)) {
                Ok(pick)
                    if weakest
                        .as_ref()
                        .is_none_or(|least| pick.payload_kg < least.payload_kg) =>
                {
                    weakest = Some(pick);
                }
                Ok(_) => {}
                Err(PickFault::NoPlan { why, .. }) => reasons.push(why.to_string()),
                Err(fault) => reasons.push(fault.to_string()),
            }
        }
        if let Some(reason) = reasons.first() {
            let message = format!(
                "the arm can't pick `{}` at {} of {} places on `{surface}`: {reason}",
                model.name,
                reasons.len(),
                n_places,
            );
            let help = "picks there will fail: name a lower or smaller surface, or add `postures` to the robot's profile";
            return Some(self.campaign.warning("S071", key, message).help(help));
        }
        let pick = weakest?;
        let heaviest_kg = model.mass_kg * self.campaign.physics.mass_scale.1;
        if heaviest_kg <= pick.payload_kg {
            return None;
        }
        let message = format!(
            "`{}` is too heavy for the arm: it has up to {heaviest_kg:.2} kg, and `{}` holds at most {:.2} kg above \
             `{surface}`",
            model.name, pick.weakest, pick.payload_kg,
        );
        let help = "reduce the object's mass or `mass_scale`, or correct the joint's `effort` in the robot's file";
        Some(self.campaign.warning("S072", key, message).help(help))
    }

    /// S073 for each surface that the camera does not see.
    fn foresee_views(
        &self,
        scenes: &[(String, BTreeMap<ChoiceName, Vec<ChoiceValue>>)],
        test: usize,
        found: &mut Diagnostics,
    ) {
        let names = self
            .campaign
            .candidates
            .get("objectSurface")
            .into_iter()
            .flatten();
        let keys: BTreeMap<&String, usize> =
            names.enumerate().map(|(idx, name)| (name, idx)).collect();
        let is_in_front = self.campaign.tests[test]
            .first()
            .is_some_and(|first| first.action == "PerceivePlane");
        for (surface, values) in scenes {
            let Some(scene) = self.draw(values, test) else {
                continue;
            };
            let (Some(top_m), Ok(world)) = (top_of(&scene), world::build_with(&scene, &self.robot))
            else {
                continue;
            };
            let Some(why) = self.unseen(&world, top_m, is_in_front) else {
                continue;
            };
            let key = format!(
                "objectSurface.{}",
                keys.get(surface).copied().unwrap_or_default()
            );
            let message = format!(
                "the camera of {} does not see the top of `{surface}`: {why}",
                self.robot.profile.core.name
            );
            let help =
                "change `camera_link` or `home` in the robot's profile, `[camera]`, or the surface";
            found.push(self.campaign.warning("S073", &key, message).help(help));
        }
    }

    /// The reason why the camera does not see a point, with numbers. Its distance and direction
    /// only count if the robot starts `in_front` of it.
    fn unseen(&self, world: &World, point_m: [f64; 3], in_front: bool) -> Option<String> {
        let (view, camera) = (
            actions::foresee_view(world, point_m),
            &self.campaign.sensing.camera,
        );
        if view.above_m < LEAST_ABOVE_M {
            let (camera_m, top_m) = (
                centimetres(point_m[2] + view.above_m),
                centimetres(point_m[2]),
            );
            return Some(format!(
                "it is at a height of {camera_m}, and the top at {top_m}"
            ));
        }
        if !in_front {
            return None;
        }
        if !(camera.min_range_m..=camera.max_range_m).contains(&view.range_m) {
            let (near, far) = (camera.min_range_m, camera.max_range_m);
            return Some(format!(
                "its middle is {:.2} m away, and the range is {near} to {far} m",
                view.range_m
            ));
        }
        let across = camera.field_of_view_rad;
        let up = across * f64::from(camera.height) / f64::from(camera.width.max(1));
        let beyond = [across, up]
            .iter()
            .zip(view.off_rad)
            .any(|(field, off)| off.abs() > field * IN_VIEW);
        beyond.then(|| {
            let [off_across, off_up] = view.off_rad.map(|off| off.abs().to_degrees());
            format!(
                "with the head turned towards it, its middle is {off_across:.0}° aside of the picture's middle and \
                 {off_up:.0}° above or below it, and the picture is {:.0}° × {:.0}°",
                across.to_degrees(),
                up.to_degrees(),
            )
        })
    }
}

/// The first id of a designator of a scene.
fn designated(scene: &Scene, designator: &str) -> Option<String> {
    scene.designators.get(designator)?.first().cloned()
}

/// Middle of the top of the surface that holds the target. Frame: world. Unit: metres.
fn top_of(scene: &Scene) -> Option<[f64; 3]> {
    let id = designated(scene, "objectSurface")?;
    let platform = scene.objects.iter().find(|object| object.id == id)?;
    let [x, y, z] = platform.pose.position;
    Some([x, y, z + platform.model.surface?.height_m])
}

fn centimetres(metres: f64) -> String {
    format!("{:.1} cm", metres * 100.0)
}
