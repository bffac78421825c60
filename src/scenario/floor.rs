//! Draws the robot's start and the obstacles on the floor.

use std::f64::consts::PI;
use std::sync::Arc;

use nalgebra::Point3;

use crate::draw::{Discard, SceneBuilder, TRIES};
use crate::floor_plan::{FRONT_GAP_M, Outline, front_of};
use crate::kept_free::{FloorAround, KeptFree};
use crate::overlap::Solid;
use crate::placement::Reach;
use crate::surroundings::Surroundings;
use actcheck_data::{
    ChoiceName, FLOOR_M, Location, ObjectAxis, ObjectModel, Part, PlacedObject, Pose, Role,
    SceneMap, SceneObject, Shape, StartAxis, Surface,
};

/// Gap between the surface's edge and the centre of the robot's base. Unit: metres. Shape: minimum,
/// nominal, maximum.
const BASE_GAP_M: [f64; 3] = [0.59, FRONT_GAP_M, 0.79];
/// The same for a fixed arm: near enough to reach the far edge of a table, with a small gap in
/// front of it.
const FIXED_GAP_M: [f64; 3] = [0.18, 0.22, 0.26];
/// The same for an arm on the surface: negative, beyond the edge.
const MOUNTED_GAP_M: [f64; 3] = [-0.09, -0.07, -0.05];
/// Maximum lateral offset of the base from the surface's centre. Unit: metres.
const BASE_SIDE_M: f64 = 0.05;
/// Maximum heading offset of the base from the surface's centre. Unit: radians.
const BASE_HEADING_RAD: f64 = 0.05;
/// Radius kept free around the start and goal of a base. Unit: metres. It fits a slim mobile
/// manipulator, with room to turn.
const BASE_ROOM_M: f64 = 0.4;
/// The same for a fixed base, which is as slim as its pedestal.
const FIXED_ROOM_M: f64 = 0.17;
/// The same for an arm on the surface. Half the width of the base of a table-top arm, and room for
/// a hand.
const MOUNTED_ROOM_M: f64 = 0.1;
/// Height of the lower end of that space above the floor, and for an arm on the surface, above
/// that. Unit: metres. The latter is the least at which it is clear of the surface itself.
const FOOT_M: f64 = 0.05;
const MOUNTED_FOOT_M: f64 = 0.005;
/// Height of that free space. Unit: metres.
const BASE_HEIGHT_M: f64 = 1.2;
/// Minimum distance between start and goal of a base that has to drive. Unit: metres.
const DRIVE_M: f64 = 1.0;
/// Nominal distance between that start and the goal. Unit: metres.
const NOMINAL_DRIVE_M: f64 = 1.5;
/// Minimum distance of the start from the ends of the rooms. Unit: metres. Half a base, half a
/// wall, and a gap as wide as a leg; no robot fits nearer to an end.
const OFF_END_M: f64 = 0.5;
/// Without rooms, a base that has to drive starts in this range around the front of the surface.
/// Unit: metres. Shape: back and forwards, to either side.
const ARENA_M: [[f64; 2]; 2] = [[-2.2, 1.2], [-2.2, 2.2]];
/// Without rooms, obstacles are placed within this distance of the robot. Unit: metres.
const FIELD_M: f64 = 2.0;

impl SceneBuilder<'_> {
    /// Draws the start of the base: in the ranges of the configuration if it has any, else in front
    /// of the surface. Nominal: straight in front of the surface's centre, facing it.
    pub(super) fn start_robot(&mut self, surface: Option<&Surface>) -> Result<[f64; 3], Discard> {
        if let Some(ranges) = self.space.start {
            return self.start_within(ranges);
        }
        let [least, nominal, most] = match (self.space.robot.core.on_surface, self.is_fixed()) {
            (true, _) => MOUNTED_GAP_M,
            (false, true) => FIXED_GAP_M,
            (false, false) => BASE_GAP_M,
        };
        let edge = surface.map_or(0.0, |surface| surface.size_m[0] / 2.0);
        let mut draw = |axis: StartAxis, low: f64, high: f64, nominal: f64| {
            self.choices
                .real(ChoiceName::Robot(axis), low, high, nominal)
        };
        let gap = draw(StartAxis::Gap, least, most, nominal);
        let side = draw(StartAxis::Side, -BASE_SIDE_M, BASE_SIDE_M, 0.0);
        let heading = draw(StartAxis::Heading, -BASE_HEADING_RAD, BASE_HEADING_RAD, 0.0);
        Ok(self.in_world([-edge - gap, side, heading]))
    }

    /// Draws the place of a fixed arm before the objects if they depend on it: they keep clear of
    /// an arm on the surface, and targets are within its reach. Returns `None` for all other
    /// robots.
    pub(super) fn mount(&mut self, surface: &Surface) -> Result<Option<[f64; 3]>, Discard> {
        let robot = &self.space.robot.core;
        if !robot.on_surface && robot.reach_m.is_none() {
            return Ok(None);
        }
        if robot.on_surface {
            self.ground_m =
                self.platform.map_or(0.0, |platform| platform.position[2]) + surface.height_m;
        }
        let base = self.start_robot(Some(surface))?;
        if robot.on_surface {
            self.solids.push(self.own_room(base));
        }
        self.reach = robot.reach_m.map(|limits| self.reach_from(base, limits));
        Ok(Some(base))
    }

    /// Transforms a base from the world to the platform's frame.
    fn reach_from(&self, [x, y, heading]: [f64; 3], limits: [f64; 2]) -> Reach {
        let platform = self.platform.unwrap_or(Pose::IDENTITY);
        let root = platform.to_isometry().inverse() * Point3::new(x, y, 0.0);
        Reach {
            root: root.xy(),
            heading: heading - platform.yaw(),
            limits,
        }
    }

    /// Whether the robot has no mobile base.
    fn is_fixed(&self) -> bool {
        self.space.robot.core.base_joints.is_none()
    }

    /// The space that the robot occupies at the start.
    fn own_room(&self, base: [f64; 3]) -> Solid {
        let (radius, foot_m) = match (self.space.robot.core.on_surface, self.is_fixed()) {
            (true, _) => (MOUNTED_ROOM_M, self.ground_m + MOUNTED_FOOT_M),
            (false, true) => (FIXED_ROOM_M, FOOT_M),
            (false, false) => (BASE_ROOM_M, FOOT_M),
        };
        room_for_base(base, radius, foot_m)
    }

    /// Transforms x, y and heading from the platform's frame to the world.
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
        let middles = ranges.map(|(low, high)| (low + high) / 2.0);
        self.start_about(ranges, middles, |_| true, |_| true)
    }

    /// Draws a free place within the ranges that satisfies `serves` and, unless it is given,
    /// `leads`.
    fn start_about(
        &mut self,
        ranges: [(f64, f64); 3],
        nominal: [f64; 3],
        serves: impl Fn(&[f64; 3]) -> bool,
        leads: impl Fn(&[f64; 3]) -> bool,
    ) -> Result<[f64; 3], Discard> {
        for _ in 0..TRIES {
            let n_made = self.choices.made().len();
            let is_given = [StartAxis::X, StartAxis::Y]
                .into_iter()
                .any(|axis| self.choices.is_recorded(&ChoiceName::Robot(axis)));
            let mut draw = |name: StartAxis, axis: usize| {
                let (low, high) = ranges[axis];
                self.choices
                    .real(ChoiceName::Robot(name), low, high, nominal[axis])
            };
            let base = [
                draw(StartAxis::X, 0),
                draw(StartAxis::Y, 1),
                draw(StartAxis::Heading, 2),
            ];
            if !serves(&base) || !self.is_free(&self.own_room(base)) {
                continue;
            }
            if is_given || leads(&base) {
                return Ok(base);
            }
            self.choices.forget_after(n_made);
        }
        Err(Discard::NoPlace {
            model: "robot".to_owned(),
            name: "robot".to_owned(),
            tries: TRIES,
        })
    }

    /// Draws the start of a base that has to drive first: in the ranges of the configuration if it
    /// has any, else anywhere in the world except near the goal, with any heading, if a path on the
    /// map leads from there to the goal. Nominal: a short distance from the goal, with the heading
    /// of the goal.
    pub(super) fn start_elsewhere(
        &mut self,
        world: Option<&Surroundings>,
    ) -> Result<[f64; 3], Discard> {
        if let Some(ranges) = self.space.start {
            return self.start_within(ranges);
        }
        let rooms = world.and_then(Surroundings::rooms);
        let (low, high) = rooms.map_or_else(|| self.arena(world), inside);
        let goal = self.goal(world);
        let ranges = [(low[0], high[0]), (low[1], high[1]), (-PI, PI)];
        let rooms = world.map_or(&[][..], |world| &world.map.rooms);
        let around = goal.map(|goal| FloorAround::new(&self.objects, rooms, goal));
        let leads = |base: &[f64; 3]| around.as_ref().is_none_or(|around| around.leads_from(base));
        let nominal = goal.map_or([0.0; 3], |goal| {
            self.nominal_start(goal, (low, high), leads)
        });
        let serves = |base: &[f64; 3]| {
            let is_far = goal
                .is_none_or(|goal| libm::hypot(base[0] - goal[0], base[1] - goal[1]) >= DRIVE_M);
            is_far && libm::hypot(base[0], base[1]) <= FLOOR_M
        };
        self.start_about(ranges, nominal, serves, leads)
    }

    /// The first free place around the goal, beginning straight behind it.
    fn nominal_start(
        &self,
        goal: [f64; 3],
        (low, high): ([f64; 2], [f64; 2]),
        leads: impl Fn(&[f64; 3]) -> bool,
    ) -> [f64; 3] {
        let around = [4.0, 3.0, 5.0, 2.0, 6.0, 1.0, 7.0, 0.0].map(|eighths: f64| {
            let angle = goal[2] + eighths * PI / 4.0;
            let (x, y) = (
                goal[0] + NOMINAL_DRIVE_M * libm::cos(angle),
                goal[1] + NOMINAL_DRIVE_M * libm::sin(angle),
            );
            [x, y, libm::atan2(libm::sin(goal[2]), libm::cos(goal[2]))]
        });
        let serves = |base: &&[f64; 3]| {
            let inside =
                (low[0]..=high[0]).contains(&base[0]) && (low[1]..=high[1]).contains(&base[1]);
            inside && self.is_free(&self.own_room(**base)) && leads(base)
        };
        around.iter().find(serves).copied().unwrap_or(around[0])
    }

    /// The part of the floor in which a mobile base can be.
    fn arena(&self, world: Option<&Surroundings>) -> ([f64; 2], [f64; 2]) {
        if let Some(world) = world {
            return world.extent();
        }
        let [x, y, _] = self.objects.first().map_or([0.0; 3], front_of);
        let [along, beside] = ARENA_M;
        ([x + along[0], y + beside[0]], [x + along[1], y + beside[1]])
    }

    /// The place to which the robot is sent.
    fn goal(&self, world: Option<&Surroundings>) -> Option<[f64; 3]> {
        let name = self.designators.get("objectLocation")?.first()?;
        let locations = world
            .into_iter()
            .flat_map(|world| &world.map.locations)
            .chain(&self.front);
        locations
            .into_iter()
            .find(|location| location.name == *name)
            .map(|location| location.at)
    }

    /// Names the place in front of the surface, with the configuration's name for it, if the robot
    /// is sent there and the world has no location for it.
    pub(super) fn name_front(&mut self, world: Option<&Surroundings>) {
        let Some(platform) = self
            .objects
            .first()
            .filter(|object| object.role == Role::Platform)
        else {
            return;
        };
        if self.goal(world).is_some() || !self.designators.contains_key("objectSurface") {
            return;
        }
        let named = self
            .designators
            .get("objectLocation")
            .and_then(|names| names.first())
            .cloned();
        let name = named.unwrap_or_else(|| format!("{}_front", platform.id));
        let front = Location {
            name: name.clone(),
            at: front_of(platform),
            surface: Some(platform.id.clone()),
        };
        self.front = Some(front);
        self.designators
            .insert("objectLocation".to_owned(), vec![name]);
    }

    /// Places obstacles on the floor, clear of all objects and of the robot. Unless the
    /// configuration allows it, they are on no place where the robot may have to go, and close no
    /// path there.
    pub(super) fn set_obstacles(
        &mut self,
        base: [f64; 3],
        world: Option<&Surroundings>,
        drives: bool,
        map: &SceneMap,
    ) -> Result<(), Discard> {
        if self.space.obstacles.is_empty() || self.space.obstacle_count == 0 {
            return Ok(());
        }
        let mut rooms: Vec<Solid> = vec![self.own_room(base)];
        let may_block = self.space.may_block;
        let fronts: Vec<[f64; 3]> = match world {
            _ if drives || may_block => Vec::new(),
            Some(world) => world
                .map
                .locations
                .iter()
                .map(|location| location.at)
                .collect(),
            None => self.fronts(),
        };
        rooms.extend(
            fronts
                .into_iter()
                .map(|front| room_for_base(front, BASE_ROOM_M, FOOT_M)),
        );
        let range = if drives {
            self.arena(world)
        } else {
            world.map_or_else(|| field(base), Surroundings::extent)
        };
        let kept_free = (!may_block && !self.is_fixed())
            .then(|| KeptFree::new(&self.objects, map, &self.designators, base));
        let mut floor = ObstacleFloor {
            range,
            rooms,
            kept_free,
            outlines: Vec::new(),
        };
        for number in 1..=self.space.obstacle_count {
            let object = PlacedObject::Obstacle(number);
            let name = ChoiceName::Object(object, ObjectAxis::Model);
            let Some(model) = self.choose(name, &self.space.obstacles) else {
                continue;
            };
            self.set_obstacle(object, model, &mut floor)?;
        }
        Ok(())
    }

    fn set_obstacle(
        &mut self,
        object: PlacedObject,
        model: Arc<ObjectModel>,
        floor: &mut ObstacleFloor,
    ) -> Result<(), Discard> {
        for _ in 0..TRIES {
            let n_made = self.choices.made().len();
            // A given position is used: a case may block a location.
            let is_given = [ObjectAxis::X, ObjectAxis::Y]
                .into_iter()
                .any(|axis| self.choices.is_recorded(&ChoiceName::Object(object, axis)));
            let pose = self.try_obstacle(object, floor.range);
            let solid = Solid::new(&model, &pose);
            if !self.is_free(&solid) || floor.rooms.iter().any(|room| room.is_in_the_way_of(&solid))
            {
                continue;
            }
            floor.outlines.push(Outline::below(&model, &pose));
            if !is_given && floor.is_blocked() {
                floor.outlines.pop();
                self.choices.forget_after(n_made);
                continue;
            }
            self.solids.push(solid);
            self.objects.push(SceneObject {
                id: self.free_id(&model),
                role: Role::Obstacle,
                pose,
                mass_kg: model.mass_kg,
                friction: model.friction,
                restitution: model.restitution,
                model,
                attached: None,
            });
            return Ok(());
        }
        Err(Discard::NoPlace {
            model: model.name.clone(),
            name: object.to_string(),
            tries: TRIES,
        })
    }

    /// Draws the pose of an obstacle within a rectangle of the floor.
    fn try_obstacle(&mut self, object: PlacedObject, (low, high): ([f64; 2], [f64; 2])) -> Pose {
        let mut draw = |axis: ObjectAxis, low: f64, high: f64| {
            self.choices
                .simple(ChoiceName::Object(object, axis), low, high)
        };
        let x = draw(ObjectAxis::X, low[0], high[0]);
        let y = draw(ObjectAxis::Y, low[1], high[1]);
        let yaw = draw(ObjectAxis::Yaw, -PI, PI);
        Pose::upright([x, y, 0.0], yaw)
    }

    /// The places in front of the platforms.
    fn fronts(&self) -> Vec<[f64; 3]> {
        self.objects
            .iter()
            .filter(|object| object.role == Role::Platform)
            .map(front_of)
            .collect()
    }

    /// Whether a solid is clear of all platforms and placed objects.
    fn is_free(&self, solid: &Solid) -> bool {
        let standing = self
            .objects
            .iter()
            .filter(|object| matches!(object.role, Role::Platform));
        let furniture = standing.map(|object| Solid::new(&object.model, &object.pose));
        !furniture
            .into_iter()
            .any(|other| other.is_in_the_way_of(solid))
            && !self
                .solids
                .iter()
                .any(|other| other.is_in_the_way_of(solid))
    }
}

/// The floor on which obstacles are placed.
struct ObstacleFloor {
    /// Lowest and highest x and y. Unit: metres.
    range: ([f64; 2], [f64; 2]),
    /// Spaces that are always free of obstacles.
    rooms: Vec<Solid>,
    /// The floor that obstacles leave free unless their position is given.
    kept_free: Option<KeptFree>,
    /// Outlines of the obstacles placed so far.
    outlines: Vec<Outline>,
}

impl ObstacleFloor {
    fn is_blocked(&self) -> bool {
        self.kept_free
            .as_ref()
            .is_some_and(|kept_free| !kept_free.permits(&self.outlines))
    }
}

/// Shrinks the extent of the rooms by the distance that a base keeps from their ends, walls or not.
fn inside((low, high): ([f64; 2], [f64; 2])) -> ([f64; 2], [f64; 2]) {
    (
        low.map(|end| end + OFF_END_M),
        high.map(|end| end - OFF_END_M),
    )
}

/// The part of an empty floor that the robot may cross, around its start.
fn field([x, y, _]: [f64; 3]) -> ([f64; 2], [f64; 2]) {
    ([x - FIELD_M, y - FIELD_M], [x + FIELD_M / 2.0, y + FIELD_M])
}

/// The space that a base occupies: a cylinder above the floor, or above the surface that it is
/// mounted on.
fn room_for_base([x, y, _]: [f64; 3], radius: f64, foot_m: f64) -> Solid {
    let room = Shape::Cylinder {
        radius,
        height: BASE_HEIGHT_M,
    };
    let pose = Pose::upright([x, y, BASE_HEIGHT_M / 2.0 + foot_m], 0.0);
    Solid::of_parts(&[Part { pose, shape: room }], &Pose::IDENTITY)
}
