//! The places and paths on the floor that obstacles leave free, so that a robot can do its test.

use std::collections::BTreeMap;

use nalgebra::{Isometry2, Point2, Vector2};

use crate::floor_plan::{Outline, front_of, outlines};
use actcheck_data::{Role, Room, Scene, SceneMap, SceneObject};

/// Distance of obstacles from the locations of a world. Unit: metres. A slim mobile manipulator can
/// stop there.
const LOCATION_ROOM_M: f64 = 0.4;
/// Distance of obstacles from the places where the robot has to stop: it carries an object there,
/// and does not know exactly where it is. Unit: metres.
const STOP_ROOM_M: f64 = 0.5;
/// Distance of the path of a base from obstacles and furniture. Unit: metres. A slim mobile
/// manipulator needs 0.31 m, and a path between the centres of two cells is nearer by at most half
/// a cell.
const PATH_ROOM_M: f64 = 0.36;
/// Edge of a cell of the floor. Unit: metres.
const CELL_M: f64 = 0.1;
/// Distance from a stop within which a path ends. Unit: metres. A stop is usually between the
/// centres of cells.
const END_M: f64 = 1.5 * CELL_M;
/// Width of the floor around everything that has a place, if the world has no rooms. Unit: metres.
const AROUND_M: f64 = 1.0;
/// Designators of the surfaces at which the robot works.
const SURFACES: [&str; 2] = ["objectSurface", "placeSurface"];

/// Whether an obstacle of a scene is on a location or another place where the robot has to stop, or
/// closes the last path there.
///
/// Without `[nav] may_block`, no such scene is drawn.
pub fn is_blocked(scene: &Scene) -> bool {
    if scene.robot.profile.core.base_joints.is_none() {
        return false;
    }
    let standing = scene
        .objects
        .iter()
        .filter(|object| object.role == Role::Obstacle);
    let obstacles: Vec<Outline> = standing
        .map(|object| Outline::below(&object.model, &object.pose))
        .collect();
    !KeptFree::new(
        &scene.objects,
        &scene.map,
        &scene.designators,
        scene.robot.base,
    )
    .permits(&obstacles)
}

/// The floor that obstacles must leave free.
pub(super) struct KeptFree {
    /// Places, each with the distance that obstacles keep. Unit: metres.
    places: Vec<(Point2<f64>, f64)>,
    paths: Paths,
}

impl KeptFree {
    /// The floor of a scene without its obstacles, for a robot that starts at `start`: x, y and
    /// heading.
    pub(super) fn new(
        objects: &[SceneObject],
        map: &SceneMap,
        designators: &BTreeMap<String, Vec<String>>,
        start: [f64; 3],
    ) -> Self {
        let named = |designator: &str| designators.get(designator).and_then(|names| names.first());
        let goal = map
            .locations
            .iter()
            .find(|location| Some(&location.name) == named("objectLocation"));
        let platforms = || {
            objects
                .iter()
                .filter(|object| object.role == Role::Platform)
        };
        let surfaces = SURFACES
            .iter()
            .filter_map(|surface| platforms().find(|object| Some(&object.id) == named(surface)));
        let stops = [Some(start), goal.map(|goal| goal.at)]
            .into_iter()
            .flatten()
            .chain(surfaces.map(front_of));
        let stops: Vec<Point2<f64>> = stops.map(on_floor).collect();
        let locations = map
            .locations
            .iter()
            .map(|location| (on_floor(location.at), LOCATION_ROOM_M));
        let places = locations
            .chain(stops.iter().map(|stop| (*stop, STOP_ROOM_M)))
            .collect();
        let furniture: Vec<Rectangle> = outlines(objects)
            .map(|outline| Rectangle::new(&outline))
            .collect();
        Self {
            places,
            paths: Paths::new(&furniture, &map.rooms, &stops),
        }
    }

    /// Whether obstacles keep their distance from every place, and leave a path from the start to
    /// every stop that has one without them.
    pub(super) fn permits(&self, obstacles: &[Outline]) -> bool {
        let obstacles: Vec<Rectangle> = obstacles.iter().map(Rectangle::new).collect();
        let is_clear = |(place, room): &(Point2<f64>, f64)| {
            obstacles.iter().all(|one| one.distance(place) >= *room)
        };
        self.places.iter().all(is_clear) && self.paths.stay_open(&obstacles)
    }
}

/// The floor from which a path leads to a goal.
pub(super) struct FloorAround {
    paths: Paths,
    /// Cells from which a path leads to the goal.
    open: Vec<bool>,
}

impl FloorAround {
    pub(super) fn new(objects: &[SceneObject], rooms: &[Room], goal: [f64; 3]) -> Self {
        let furniture: Vec<Rectangle> = outlines(objects)
            .map(|outline| Rectangle::new(&outline))
            .collect();
        let paths = Paths::new(&furniture, rooms, &[on_floor(goal)]);
        let open = paths.connected(&paths.free);
        Self { paths, open }
    }

    /// Whether a path leads from a base to the goal. A goal beside an obstacle or in it can be
    /// reached from nowhere: whether the robot says so is part of the test.
    pub(super) fn leads_from(&self, base: &[f64; 3]) -> bool {
        let place = on_floor(*base);
        !self.open.contains(&true) || self.paths.ends(&place).any(|cell| self.open[cell])
    }
}

fn on_floor([x, y, _]: [f64; 3]) -> Point2<f64> {
    Point2::new(x, y)
}

/// An outline, for distances.
struct Rectangle {
    from_world: Isometry2<f64>,
    half: [f64; 2],
}

impl Rectangle {
    fn new(outline: &Outline) -> Self {
        let [x, y, _] = outline.pose.position;
        let world_from_outline = Isometry2::new(Vector2::new(x, y), outline.pose.yaw());
        Self {
            from_world: world_from_outline.inverse(),
            half: outline.size_m.map(|side| side / 2.0),
        }
    }

    /// Distance of a point; 0 inside. Unit: metres.
    fn distance(&self, point: &Point2<f64>) -> f64 {
        let local = self.from_world * point;
        libm::hypot(
            (local.x.abs() - self.half[0]).max(0.0),
            (local.y.abs() - self.half[1]).max(0.0),
        )
    }

    /// Its corners. Frame: world.
    fn corners(&self) -> [Point2<f64>; 4] {
        let [x, y] = self.half;
        [(x, y), (x, -y), (-x, y), (-x, -y)]
            .map(|(x, y)| self.from_world.inverse() * Point2::new(x, y))
    }
}

/// The floor in square cells, in rows along x, with the stops of a base.
struct Paths {
    low: Point2<f64>,
    columns: usize,
    rows: usize,
    /// Whether a base can be at the centre of each cell. Without obstacles.
    free: Vec<bool>,
    start: Option<Point2<f64>>,
    /// The other stops, as far as there is a path to them without obstacles.
    reached: Vec<Point2<f64>>,
}

impl Paths {
    fn new(furniture: &[Rectangle], rooms: &[Room], stops: &[Point2<f64>]) -> Self {
        let (low, high) = if rooms.is_empty() {
            let corners = furniture.iter().flat_map(Rectangle::corners);
            let (low, high) = around(corners.chain(stops.iter().copied()));
            (
                low.map(|end| end - AROUND_M),
                high.map(|end| end + AROUND_M),
            )
        } else {
            around(
                rooms
                    .iter()
                    .flat_map(|room| [room.low_m, room.high_m])
                    .map(Point2::from),
            )
        };
        let size = (high - low).map(|side| (side / CELL_M).ceil().max(0.0));
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few hundred cells"
        )]
        let (columns, rows) = (size.x as usize, size.y as usize);
        let mut paths = Self {
            low,
            columns,
            rows,
            free: Vec::new(),
            start: stops.first().copied(),
            reached: Vec::new(),
        };
        let is_free = |cell: usize| {
            let middle = paths.middle(cell);
            is_inside(rooms, &middle)
                && furniture
                    .iter()
                    .all(|piece| piece.distance(&middle) >= PATH_ROOM_M)
        };
        paths.free = (0..columns * rows).map(is_free).collect();
        let open = paths.connected(&paths.free);
        paths.reached = stops
            .iter()
            .skip(1)
            .filter(|stop| paths.ends(stop).any(|cell| open[cell]))
            .copied()
            .collect();
        paths
    }

    /// Whether there is still a path to every stop among obstacles.
    fn stay_open(&self, obstacles: &[Rectangle]) -> bool {
        if self.reached.is_empty() {
            return true;
        }
        let is_free = |cell: usize| {
            let middle = self.middle(cell);
            self.free[cell]
                && obstacles
                    .iter()
                    .all(|obstacle| obstacle.distance(&middle) >= PATH_ROOM_M)
        };
        let free: Vec<bool> = (0..self.free.len()).map(is_free).collect();
        let open = self.connected(&free);
        self.reached
            .iter()
            .all(|stop| self.ends(stop).any(|cell| open[cell]))
    }

    /// Marks the free cells to which free cells lead from the start.
    fn connected(&self, free: &[bool]) -> Vec<bool> {
        let mut open = vec![false; free.len()];
        let Some(start) = &self.start else {
            return open;
        };
        let mut left: Vec<usize> = self.ends(start).filter(|cell| free[*cell]).collect();
        left.iter().for_each(|cell| open[*cell] = true);
        while let Some(cell) = left.pop() {
            for next in self.neighbours(cell).into_iter().flatten() {
                if free[next] && !std::mem::replace(&mut open[next], true) {
                    left.push(next);
                }
            }
        }
        open
    }

    /// The cells at which a path to a stop may end.
    fn ends<'a>(&'a self, stop: &'a Point2<f64>) -> impl Iterator<Item = usize> + 'a {
        (0..self.free.len()).filter(move |cell| (self.middle(*cell) - stop).norm() <= END_M)
    }

    fn neighbours(&self, cell: usize) -> [Option<usize>; 4] {
        let (column, row) = (cell % self.columns, cell / self.columns);
        [
            (column > 0).then(|| cell - 1),
            (column + 1 < self.columns).then(|| cell + 1),
            (row > 0).then(|| cell - self.columns),
            (row + 1 < self.rows).then(|| cell + self.columns),
        ]
    }

    fn middle(&self, cell: usize) -> Point2<f64> {
        let (column, row) = (cell % self.columns, cell / self.columns);
        self.low + Vector2::new(column as f64 + 0.5, row as f64 + 0.5) * CELL_M
    }
}

/// Whether a point is in a room, if there are rooms.
fn is_inside(rooms: &[Room], point: &Point2<f64>) -> bool {
    let holds = |room: &Room| {
        (0..2).all(|axis| (room.low_m[axis]..=room.high_m[axis]).contains(&point[axis]))
    };
    rooms.is_empty() || rooms.iter().any(holds)
}

/// The bounding rectangle of points: its lowest and its highest corner.
fn around(points: impl Iterator<Item = Point2<f64>>) -> (Point2<f64>, Point2<f64>) {
    let start = (
        Point2::from([f64::INFINITY; 2]),
        Point2::from([f64::NEG_INFINITY; 2]),
    );
    points.fold(start, |(low, high), point| {
        (low.inf(&point), high.sup(&point))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::Pose;

    fn wall(from: [f64; 2], to: [f64; 2]) -> Outline {
        let middle = [0, 1].map(|axis| f64::midpoint(from[axis], to[axis]));
        let size = [0, 1].map(|axis| (to[axis] - from[axis]).abs().max(0.1));
        Outline {
            pose: Pose::upright([middle[0], middle[1], 0.0], 0.0),
            size_m: size,
        }
    }

    /// Two rooms with a door of 1.2 m between them; the start is in one and a stop in the other.
    fn two_rooms(stop: [f64; 2]) -> Paths {
        let walls = [wall([0.0, -2.0], [0.0, -0.6]), wall([0.0, 0.6], [0.0, 2.0])];
        let furniture: Vec<Rectangle> = walls.iter().map(Rectangle::new).collect();
        let room = |low: f64, high: f64| Room {
            name: String::new(),
            low_m: [low, -2.0],
            high_m: [high, 2.0],
        };
        Paths::new(
            &furniture,
            &[room(-3.0, 0.0), room(0.0, 3.0)],
            &[Point2::new(-2.0, 0.0), Point2::from(stop)],
        )
    }

    #[test]
    fn an_obstacle_in_the_only_door_closes_the_path() {
        let paths = two_rooms([2.0, 0.0]);
        let stays_open = |at: [f64; 2], side: f64| {
            let outline = Outline {
                pose: Pose::upright([at[0], at[1], 0.0], 0.4),
                size_m: [side, side],
            };
            paths.stay_open(&[Rectangle::new(&outline)])
        };
        assert!(!stays_open([0.0, 0.0], 0.2));
        assert!(stays_open([-1.1, 0.0], 0.3), "a path around it exists");
        assert!(!stays_open([-1.0, 0.0], 3.5));
        assert!(
            stays_open([0.0, 0.6], 0.1),
            "an obstacle at the door post leaves room beside it"
        );
    }

    #[test]
    fn a_stop_without_a_path_requires_none() {
        let beside_wall = two_rooms([2.95, 1.95]);
        assert_eq!(
            beside_wall.reached.len(),
            1,
            "the outer ends of these rooms have no walls"
        );
        let in_wall = two_rooms([0.0, 1.5]);
        assert!(in_wall.reached.is_empty());
        assert!(in_wall.stay_open(&[Rectangle::new(&wall([-1.0, -2.0], [-1.0, 2.0]))]));
    }

    #[test]
    fn distances_are_those_to_the_rotated_rectangle() {
        let outline = Outline {
            pose: Pose::upright([1.0, 2.0, 0.0], std::f64::consts::FRAC_PI_2),
            size_m: [2.0, 0.4],
        };
        let rectangle = Rectangle::new(&outline);
        assert!((rectangle.distance(&Point2::new(2.2, 2.0)) - 1.0).abs() < 1e-9);
        assert!((rectangle.distance(&Point2::new(1.0, 3.5)) - 0.5).abs() < 1e-9);
        assert_eq!(rectangle.distance(&Point2::new(1.1, 2.9)), 0.0);
    }
}
