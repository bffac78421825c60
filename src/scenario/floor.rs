//! What is drawn on the floor: where the robot starts, and what stands in its way.

use std::f64::consts::PI;
use std::sync::Arc;

use nalgebra::Point3;

use crate::base::Pose;
use crate::config::{ObjectModel, Part, Shape, Surface};
use crate::scenario::draw::{Discard, Hand, TRIES};
use crate::scenario::overlap::Solid;
use crate::scenario::surroundings::Surroundings;
use crate::scenario::{Role, SceneObject};

/// Gap between the surface's edge and the middle of the robot's base. Unit: metres. Shape: least, nominal, most.
const BASE_GAP_M: [f64; 3] = [0.59, 0.69, 0.79];
/// The same for an arm that stays where it is: near enough to reach to the far edge of a table, and a little in front of it.
const FIXED_GAP_M: [f64; 3] = [0.18, 0.22, 0.26];
/// The base stands at most this far beside the surface's middle. Unit: metres.
const BASE_SIDE_M: f64 = 0.05;
/// The base heads at most this far beside the surface's middle. Unit: radians.
const BASE_HEADING_RAD: f64 = 0.05;
/// Where a base stands or shall stand, nothing else does within this distance. Unit: metres. That of a slim mobile
/// manipulator, with room to turn.
const BASE_ROOM_M: f64 = 0.4;
/// The same for a base that stays where it is, which is as slim as its pedestal.
const FIXED_ROOM_M: f64 = 0.17;
/// How high that room is. Unit: metres.
const BASE_HEIGHT_M: f64 = 1.2;
/// Without rooms obstacles stand this far around the robot's side of the surface. Unit: metres.
const FIELD_M: f64 = 2.0;

impl Hand<'_> {
    /// Where the base stands: nominal is straight in front of the surface's middle, facing it; or within the ranges of the
    /// configuration, where it has some.
    pub(super) fn start_robot(&mut self, surface: Option<&Surface>) -> Result<[f64; 3], Discard> {
        if let Some(ranges) = self.space.start {
            return self.start_within(ranges);
        }
        let [least, nominal, most] = if self.is_fixed() { FIXED_GAP_M } else { BASE_GAP_M };
        let edge = surface.map_or(0.0, |surface| surface.size_m[0] / 2.0);
        let gap = self.choices.real("robot.gap", least, most, nominal);
        let side = self.choices.real("robot.side", -BASE_SIDE_M, BASE_SIDE_M, 0.0);
        let heading = self.choices.real("robot.heading", -BASE_HEADING_RAD, BASE_HEADING_RAD, 0.0);
        Ok(self.in_world([-edge - gap, side, heading]))
    }

    /// Whether the robot stays where it is.
    fn is_fixed(&self) -> bool {
        self.space.robot.base_joints.is_none()
    }

    /// The room that the robot takes at the start.
    fn own_room(&self, base: [f64; 3]) -> Solid {
        room_for_base(base, if self.is_fixed() { FIXED_ROOM_M } else { BASE_ROOM_M })
    }

    /// A place of the floor, from the frame of the platform.
    fn in_world(&self, [x, y, heading]: [f64; 3]) -> [f64; 3] {
        match self.platform {
            None => [x, y, heading],
            Some(platform) => {
                let at = platform.to_isometry() * Point3::new(x, y, 0.0);
                [at.x, at.y, heading + platform.yaw()]
            }
        }
    }

    fn start_within(&mut self, ranges: [(f64, f64); 3]) -> Result<[f64; 3], Discard> {
        for _ in 0..TRIES {
            let mut draw = |name: &str, (low, high): (f64, f64)| self.choices.real(name, low, high, (low + high) / 2.0);
            let [x, y, heading] = ranges;
            let base = [draw("robot.x", x), draw("robot.y", y), draw("robot.heading", heading)];
            if self.is_free(&self.own_room(base)) {
                return Ok(base);
            }
        }
        Err(Discard { model: "robot".to_owned(), name: "robot".to_owned(), tries: TRIES })
    }

    /// Sets obstacles on the floor, clear of everything, of the robot, and of the places where it may have to go.
    pub(super) fn set_obstacles(&mut self, base: [f64; 3], world: Option<&Surroundings>) -> Result<(), Discard> {
        if self.space.obstacles.is_empty() || self.space.obstacle_count == 0 {
            return Ok(());
        }
        let mut kept_free: Vec<Solid> = vec![self.own_room(base)];
        let fronts: Vec<[f64; 3]> = match world {
            Some(world) => world.map.locations.iter().map(|location| location.at).collect(),
            None => self.fronts(),
        };
        kept_free.extend(fronts.into_iter().map(|front| room_for_base(front, BASE_ROOM_M)));
        let (low, high) = world.map_or_else(|| field(base), Surroundings::extent);
        for number in 1..=self.space.obstacle_count {
            let name = format!("obstacle.{number}");
            let Some(model) = self.choose(&format!("{name}.model"), &self.space.obstacles) else { continue };
            self.set_obstacle(&name, model, (low, high), &kept_free)?;
        }
        Ok(())
    }

    fn set_obstacle(
        &mut self,
        name: &str,
        model: Arc<ObjectModel>,
        (low, high): ([f64; 2], [f64; 2]),
        kept_free: &[Solid],
    ) -> Result<(), Discard> {
        for _ in 0..TRIES {
            let mut draw = |what: &str, low: f64, high: f64| {
                self.choices.real(&format!("{name}.{what}"), low, high, (low + high) / 2.0)
            };
            let (x, y, yaw) = (draw("x", low[0], high[0]), draw("y", low[1], high[1]), draw("yaw", -PI, PI));
            let pose = Pose::upright([x, y, 0.0], yaw);
            let solid = Solid::new(&model, &pose);
            if !self.is_free(&solid) || kept_free.iter().any(|kept| kept.is_in_the_way_of(&solid)) {
                continue;
            }
            self.solids.push(solid);
            let object = SceneObject {
                id: self.free_id(&model),
                role: Role::Obstacle,
                pose,
                mass_kg: model.mass_kg,
                friction: model.friction,
                restitution: model.restitution,
                model,
            };
            self.objects.push(object);
            return Ok(());
        }
        Err(Discard { model: model.name.clone(), name: name.to_owned(), tries: TRIES })
    }

    /// Places in front of the platforms.
    fn fronts(&self) -> Vec<[f64; 3]> {
        let platforms = self.objects.iter().filter(|object| object.role == Role::Platform);
        let front = |platform: &SceneObject| {
            let edge = platform.model.surface.map_or(0.0, |surface| surface.size_m[0] / 2.0);
            let at = platform.pose.to_isometry() * Point3::new(-edge - BASE_GAP_M[1], 0.0, 0.0);
            [at.x, at.y, platform.pose.yaw()]
        };
        platforms.map(front).collect()
    }

    /// Whether nothing that stands in the scene is in the way.
    fn is_free(&self, solid: &Solid) -> bool {
        let standing = self.objects.iter().filter(|object| matches!(object.role, Role::Platform));
        let furniture = standing.map(|object| Solid::new(&object.model, &object.pose));
        !furniture.into_iter().any(|other| other.is_in_the_way_of(solid))
            && !self.solids.iter().any(|other| other.is_in_the_way_of(solid))
    }
}

/// The part of an empty floor that the robot may cross.
fn field([x, y, _]: [f64; 3]) -> ([f64; 2], [f64; 2]) {
    ([x - FIELD_M, y - FIELD_M], [x + FIELD_M / 2.0, y + FIELD_M])
}

/// The room that a base takes.
fn room_for_base([x, y, _]: [f64; 3], radius: f64) -> Solid {
    let room = Shape::Cylinder { radius, height: BASE_HEIGHT_M };
    let pose = Pose::upright([x, y, BASE_HEIGHT_M / 2.0 + 0.05], 0.0);
    Solid::of_parts(&[Part { pose, shape: room }], &Pose::IDENTITY)
}
