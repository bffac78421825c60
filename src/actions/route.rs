//! Paths of the base around obstacles on the floor.

use nalgebra::{Isometry3, Point2, Point3};

use actcheck_world::Sighting;

/// Clearance beside the base on its path. Unit: metres. The error of perceived furniture.
const ROOM_M: f64 = 0.04;
/// How much further out corners are rounded. Unit: metres.
const CORNER_M: f64 = 0.03;
/// Distance between checked points of a path. Unit: metres.
const CHECK_M: f64 = 0.05;
/// A negligible distance. Unit: metres.
const GRAIN_M: f64 = 1e-6;
/// Objects whose foot is below this are on the floor. Unit: metres.
const ON_FLOOR_M: f64 = 0.2;

/// Furniture: a box on the floor. The space below a table counts as occupied.
#[derive(Debug, Clone)]
pub struct Block {
    /// Id of the furniture.
    pub id: String,
    from_world: Isometry3<f64>,
    half: [f64; 2],
    height: f64,
}

/// Height below a piece of furniture's top from which a robot counts as mounted on it. Unit:
/// metres.
const ON_TOP_M: f64 = 0.05;

/// The vertical cylinder around an object.
#[derive(Debug, Clone)]
pub struct Pillar {
    /// Id of the object.
    pub id: String,
    centre: Point2<f64>,
    radius: f64,
    foot: f64,
    top: f64,
}

impl Block {
    /// The box of a perceived piece of furniture, extended down to the floor.
    pub fn new(seen: &Sighting) -> Self {
        let [width, depth, height] = seen.size_m;
        let half = [width / 2.0, depth / 2.0];
        Self {
            id: seen.id.clone(),
            from_world: seen.pose.to_isometry().inverse(),
            half,
            height: seen.pose.position[2] + height,
        }
    }

    /// The boxes of all perceived furniture, except of a piece around the robot: it is a room,
    /// whose box says nothing about its walls. `base` is the origin of the robot's base.
    pub fn around(base: &Point3<f64>, others: &[Sighting]) -> Vec<Self> {
        let furniture = others.iter().filter(|seen| seen.furniture).map(Self::new);
        furniture
            .filter(|block| block.beside(base) >= 0.0 || base.z > block.height - ON_TOP_M)
            .collect()
    }

    /// Horizontal distance to the outline, negative inside. Unit: metres.
    pub fn beside(&self, point: &Point3<f64>) -> f64 {
        let local = self.from_world * point;
        let (dx, dy) = (local.x.abs() - self.half[0], local.y.abs() - self.half[1]);
        if dx > 0.0 && dy > 0.0 {
            length(dx, dy)
        } else {
            dx.max(dy)
        }
    }

    /// Distance to the box (a lower bound near its upper edges), negative inside. Unit: metres.
    pub fn distance(&self, point: &Point3<f64>) -> f64 {
        self.beside(point).max(point.z - self.height)
    }

    /// Points beyond its corners: straight lines between neighbouring points keep the distance.
    fn corners(&self, out: f64) -> [Point2<f64>; 4] {
        let (x, y) = (self.half[0] + out, self.half[1] + out);
        [(x, y), (x, -y), (-x, y), (-x, -y)]
            .map(|(x, y)| (self.from_world.inverse() * Point3::new(x, y, 0.0)).xy())
    }
}

impl Pillar {
    /// The cylinder of a perceived object.
    pub fn new(seen: &Sighting) -> Self {
        let [x, y, foot] = seen.pose.position;
        let [width, depth, height] = seen.size_m;
        // Between the inscribed and the circumscribed circle: corners seldom point at the hand.
        let radius = (width.max(depth) + length(width, depth)) / 4.0;
        Self {
            id: seen.id.clone(),
            centre: Point2::new(x, y),
            radius,
            foot,
            top: foot + height,
        }
    }

    /// Distance to the cylinder (a lower bound near its edges), negative inside. Unit: metres.
    pub fn distance(&self, point: &Point3<f64>) -> f64 {
        let beside = length(point.x - self.centre.x, point.y - self.centre.y) - self.radius;
        beside.max(point.z - self.top).max(self.foot - point.z)
    }

    fn corners(&self, out: f64) -> [Point2<f64>; 4] {
        let reach = self.radius + out;
        [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)]
            .map(|(x, y)| Point2::new(self.centre.x + x * reach, self.centre.y + y * reach))
    }
}

/// Free floor for a round base.
#[derive(Debug, Clone)]
pub struct Ground {
    blocks: Vec<Block>,
    pillars: Vec<Pillar>,
    /// Radius of the base with its load. Unit: metres.
    radius: f64,
    corners: Vec<Point2<f64>>,
}

impl Ground {
    /// The floor with furniture and objects on it, for a base at `from`. The base may come as close
    /// to obstacles as it is now, because its load does not extend all around it.
    pub fn new(blocks: &[Block], pillars: &[Pillar], radius: f64, from: &Point2<f64>) -> Self {
        let pillars: Vec<Pillar> = pillars
            .iter()
            .filter(|pillar| pillar.foot < ON_FLOOR_M)
            .cloned()
            .collect();
        let mut ground = Self {
            corners: Vec::new(),
            blocks: blocks.to_vec(),
            pillars,
            radius,
        };
        let lack = (-ground.clearance(from)).clamp(0.0, radius);
        // Keeps a rounding error from shutting the base in.
        ground.radius -= if lack > 0.0 { lack + GRAIN_M } else { 0.0 };
        let out = ground.radius + ROOM_M + CORNER_M;
        let around_blocks = ground.blocks.iter().flat_map(|block| block.corners(out));
        ground.corners = around_blocks
            .chain(ground.pillars.iter().flat_map(|pillar| pillar.corners(out)))
            .collect();
        ground.corners.retain({
            let ground = ground.clone();
            move |corner| ground.clearance(corner) >= 0.0
        });
        ground
    }

    /// The shortest path over at most two corners, without its first point. Returns `None` if no
    /// path is free.
    pub fn route(&self, from: Point2<f64>, to: Point2<f64>) -> Option<Vec<Point2<f64>>> {
        if self.free(&from, &to) {
            return Some(vec![to]);
        }
        let mut best: Option<(f64, Vec<Point2<f64>>)> = None;
        let mut offer = |way: Vec<Point2<f64>>| {
            let ends = std::iter::once(&from).chain(&way);
            let total: f64 = ends
                .zip(&way)
                .map(|(a, b)| length(b.x - a.x, b.y - a.y))
                .sum();
            if best.as_ref().is_none_or(|(shortest, _)| total < *shortest) {
                best = Some((total, way));
            }
        };
        let last: Vec<&Point2<f64>> = self
            .corners
            .iter()
            .filter(|corner| self.free(corner, &to))
            .collect();
        for first in self
            .corners
            .iter()
            .filter(|corner| self.free(&from, corner))
        {
            for second in &last {
                if first == *second {
                    offer(vec![*first, to]);
                } else if self.free(first, second) {
                    offer(vec![*first, **second, to]);
                }
            }
        }
        best.map(|(_, way)| way)
    }

    fn free(&self, from: &Point2<f64>, to: &Point2<f64>) -> bool {
        let way = to - from;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few metres of centimetres"
        )]
        let n_steps = (length(way.x, way.y) / CHECK_M).ceil().clamp(1.0, 1e3) as usize;
        (0..=n_steps)
            .all(|step| self.clearance(&(from + way * (step as f64 / n_steps as f64))) >= 0.0)
    }

    /// Clearance to spare around a base at this position. Unit: metres.
    fn clearance(&self, at: &Point2<f64>) -> f64 {
        let point = Point3::new(at.x, at.y, 0.0);
        let blocks = self.blocks.iter().map(|block| block.beside(&point));
        let pillars = self
            .pillars
            .iter()
            .map(|pillar| length(at.x - pillar.centre.x, at.y - pillar.centre.y) - pillar.radius);
        blocks.chain(pillars).fold(f64::INFINITY, f64::min) - self.radius - ROOM_M
    }
}

/// Length of a horizontal vector, bitwise reproducible on all machines.
pub fn length(x: f64, y: f64) -> f64 {
    (x * x + y * y).sqrt()
}

/// Wraps an angle to (−π, π]. Unit: radians.
pub fn wrapped(angle: f64) -> f64 {
    libm::atan2(libm::sin(angle), libm::cos(angle))
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::Pose;

    fn table() -> Block {
        let pose = Pose::IDENTITY;
        Block::new(&Sighting {
            id: "t".to_owned(),
            pose,
            size_m: [0.6, 0.6, 0.7],
            furniture: true,
            angular: false,
        })
    }

    #[test]
    fn a_room_around_the_robot_does_not_block_it_but_a_table_below_it_does() {
        let seen = |size: f64, height| Sighting {
            id: "t".to_owned(),
            pose: Pose::IDENTITY,
            size_m: [size, size, height],
            furniture: true,
            angular: false,
        };
        let others = [seen(8.0, 2.5), seen(0.6, 0.7)];
        let blocks = |base| Block::around(&Point3::from(base), &others).len();
        assert_eq!([[1.0, 0.0, 0.0], [5.0, 0.0, 0.0]].map(blocks), [1, 2]);
        assert_eq!(
            Block::around(&Point3::new(0.1, 0.0, 0.7), &others[1..]).len(),
            1
        );
    }

    #[test]
    fn a_route_around_a_table_passes_its_corners() {
        let ground = Ground::new(&[table()], &[], 0.25, &Point2::new(-1.0, 0.0));
        let straight = ground
            .route(Point2::new(-1.0, 0.0), Point2::new(-1.0, 1.0))
            .expect("nothing is in the way");
        assert_eq!(straight.len(), 1);
        let around = ground
            .route(Point2::new(-1.0, 0.0), Point2::new(1.0, 0.0))
            .expect("a detour exists");
        assert_eq!(around.len(), 3);
        assert_eq!(
            ground.route(Point2::new(-1.0, 0.0), Point2::new(0.0, 0.0)),
            None
        );
    }

    #[test]
    fn a_base_near_an_obstacle_only_moves_away_from_it() {
        let near = Point2::new(-0.5, 0.0);
        let ground = Ground::new(&[table()], &[], 0.4, &near);
        assert!(ground.route(near, Point2::new(-1.0, 0.4)).is_some());
        assert_eq!(ground.route(near, Point2::new(-0.45, 0.0)), None);
    }
}
