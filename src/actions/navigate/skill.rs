//! The drive skill: plans a path by the map, looks ahead while driving, and replans if the path is
//! blocked.

use nalgebra::Point3;

use crate::ActionCall;
use crate::navigate::follow::{Follower, Limits};
use crate::navigate::grid::{CELL_M, Grid};
use crate::navigate::sense::{Size, look};
use crate::navigate::shorten::way;
use crate::navigate::terrain::Terrain;
use crate::operator::{Interrupt, Operator};
use crate::perceive::safely_towards;
use crate::route::{length, wrapped};
use actcheck_data::ActionReport;

/// Designators of the goal; the first one present is used.
const PLACES: [&str; 2] = ["objectLocation", "objectSurface"];
/// Clearance beside the robot on its path. Unit: metres. The combined error of the map, the
/// pictures and localisation.
const MARGIN_M: f64 = 0.04;
/// Share of the joints' velocity limits that is used, so that the controller can catch up.
const SPEED_SHARE: f64 = 0.9;
/// Speeds that drives don't exceed however fast the base is, among people and furniture. Units:
/// m/s, rad/s.
const MOST_SPEED_M_S: f64 = 0.5;
const MOST_TURN_RAD_S: f64 = 1.0;
/// Unit: m/s². At full speed the robot stops within 10 cm.
const ACCELERATION: f64 = 0.3;
/// Unit: rad/s².
const TURN_ACCELERATION: f64 = 1.5;
/// Time between two pictures while driving. Unit: seconds. The robot covers a quarter of a metre.
const LOOK_SECS: f64 = 1.0;
/// Time between two updates of the gaze. Unit: seconds.
const GAZE_SECS: f64 = 0.25;
/// Distance ahead on the path at which the robot looks at the floor. Unit: metres.
const GAZE_M: f64 = 1.4;
/// Directions in which a robot without a path looks around: to both sides and ahead. Unit: radians.
const LOOK_AROUND_RAD: [f64; 3] = [-0.9, 0.9, 0.0];
/// Time for the head to get there and come to rest. Unit: seconds.
const REST_SECS: f64 = 1.2;
/// Number of paths tried before the robot gives up.
const MOST_WAYS: usize = 12;
/// A base this far from its commanded position is blocked. Unit: metres.
const HELD_UP_M: f64 = 0.15;
/// Tolerances within which the goal is reached. Units: metres, radians.
const REACHED: [f64; 2] = [0.03, 0.03];
/// Distances from an occupied goal at which substitutes are tried, the nearest first, and the
/// number of directions. Unit of the distances: metres. From farther away, a table would be out of
/// sight.
const ASIDE_M: [f64; 4] = [0.3, 0.45, 0.6, 0.8];
const N_ASIDE: u32 = 16;
/// Longest path to a substitute goal, relative to the straight line.
const DETOUR: f64 = 1.3;
/// Distance ahead of the goal that the robot faces there. Unit: metres. The middle of a table.
const FACED_M: f64 = 1.0;
/// Shortest and longest time for the base to come to rest: it follows the corrections of its pose
/// estimate. Unit: seconds.
const ARRIVE_SECS: [f64; 2] = [0.5, 4.0];
/// Time for which the base has to be at rest. Unit: seconds.
const AT_REST_SECS: f64 = 0.3;
/// A base slower than this is at rest. Units: m/s and rad/s.
const AT_REST: f64 = 2e-3;

/// Drives to the designated place and reports whether the robot believes it is there.
///
/// # Errors
/// [`Interrupt`] if simulation broke or time ran out.
pub fn move_to(call: &ActionCall, robot: &mut Operator<'_>) -> Result<ActionReport, Interrupt> {
    let named: Vec<&str> = PLACES
        .iter()
        .filter_map(|designator| call.value(designator))
        .collect();
    let Some(first) = named.first() else {
        return Ok(failed("no place was named to drive to"));
    };
    let Some(goal) = named.iter().find_map(|name| robot.floor_plan().place(name)) else {
        return Ok(failed(format!("{first} is not on the map")));
    };
    let Some(base) = robot.layout().base else {
        return Ok(failed("the robot has no mobile base"));
    };
    let mut drive = Drive::new(robot, base, goal);
    match drive.go()? {
        Some(reason) => {
            drive.go_near()?;
            Ok(failed(format!("{first}: {reason}")))
        }
        None => drive.report(first),
    }
}

/// Drives to a pose (x, y, heading), looking ahead. Returns the reason if it did not get there.
///
/// # Errors
/// [`Interrupt`] if simulation broke or time ran out.
pub fn drive_to(goal: [f64; 3], robot: &mut Operator<'_>) -> Result<Option<String>, Interrupt> {
    match robot.layout().base {
        Some(base) => Drive::new(robot, base, goal).go(),
        None => Ok(Some("the robot has no mobile base".to_owned())),
    }
}

/// A drive to a goal. All poses are by the base's belief.
struct Drive<'r, 'o> {
    robot: &'r mut Operator<'o>,
    base: [usize; 3],
    goal: [f64; 3],
    size: Size,
    limits: Limits,
    grid: Grid,
    follower: Follower,
}

impl<'r, 'o> Drive<'r, 'o> {
    fn new(robot: &'r mut Operator<'o>, base: [usize; 3], goal: [f64; 3]) -> Self {
        let at = base.map(|joint| robot.commanded()[joint]);
        let fastest = |joint: usize| SPEED_SHARE * robot.kinematics().joints()[joint].velocity;
        let limits = Limits {
            speed: fastest(base[0]).min(fastest(base[1])).min(MOST_SPEED_M_S),
            acceleration: ACCELERATION,
            turn_speed: fastest(base[2]).min(MOST_TURN_RAD_S),
            turn_acceleration: TURN_ACCELERATION,
        };
        let mut grid = Grid::new(robot.floor_plan(), &[[at[0], at[1]], [goal[0], goal[1]]]);
        grid.recall(&robot.memory().floor);
        let size = Size::of(robot);
        Self {
            robot,
            base,
            goal,
            size,
            limits,
            grid,
            follower: Follower::new(at, Vec::new(), at[2]),
        }
    }

    /// Drives to the goal and keeps the obstacles seen on the floor. Returns the reason if it did
    /// not get there.
    fn go(&mut self) -> Result<Option<String>, Interrupt> {
        let reason = self.go_on();
        self.robot.remember_floor(self.grid.standing());
        reason
    }

    fn go_on(&mut self) -> Result<Option<String>, Interrupt> {
        let mut looked_around = false;
        for _ in 0..MOST_WAYS {
            self.robot.begin("plan");
            if !self.set_out() {
                let reason = self.why_not();
                if std::mem::replace(&mut looked_around, true) {
                    return Ok(Some(reason));
                }
                self.look_around()?;
                continue;
            }
            self.robot.begin("drive");
            match self.follow()? {
                Leg::Arrived => return Ok(None),
                Leg::Blocked => {}
                Leg::HeldUp => {
                    return Ok(Some(
                        "the robot is blocked by something it does not see".to_owned(),
                    ));
                }
            }
        }
        Ok(Some("no path stayed free".to_owned()))
    }

    /// Drives to the nearest free place near an unreachable goal and faces the same point, because
    /// the next action may still be possible from there. The goal still counts as not reached.
    fn go_near(&mut self) -> Result<(), Interrupt> {
        let [x, y, heading] = self.goal;
        let faced = [
            x + FACED_M * libm::cos(heading),
            y + FACED_M * libm::sin(heading),
        ];
        let turns =
            || (0..N_ASIDE).map(|idx| std::f64::consts::TAU * f64::from(idx) / f64::from(N_ASIDE));
        let mut places = ASIDE_M.iter().flat_map(|away| {
            turns().map(move |turn| {
                let [x, y] = [x + away * libm::cos(turn), y + away * libm::sin(turn)];
                [x, y, libm::atan2(faced[1] - y, faced[0] - x)]
            })
        });
        self.robot.begin("plan");
        let is_way = places.any(|place| {
            self.goal = place;
            self.set_out() && self.is_direct()
        });
        if is_way {
            self.robot.begin("drive near");
            self.follow()?;
        }
        self.robot.remember_floor(self.grid.standing());
        Ok(())
    }

    /// Whether the path is nearly straight, and does not lead around a table to its far side.
    fn is_direct(&self) -> bool {
        let ends: Vec<[f64; 2]> = self.follower.left().collect();
        let way: f64 = ends
            .windows(2)
            .map(|pair| length(pair[1][0] - pair[0][0], pair[1][1] - pair[0][1]))
            .sum();
        let [x, y, _] = self.follower.at();
        way <= length(self.goal[0] - x, self.goal[1] - y) * DETOUR + CELL_M
    }

    /// Starts on the best path from here. Returns `false` if there is none.
    fn set_out(&mut self) -> bool {
        let at = self.follower.at();
        let (from, to) = ([at[0], at[1]], [self.goal[0], self.goal[1]]);
        match way(
            &Terrain::new(&self.grid, self.size.radius_m + MARGIN_M, from),
            from,
            to,
        ) {
            Some(way) => {
                self.follower = Follower::new(at, way, self.goal[2]);
                true
            }
            None => false,
        }
    }

    fn why_not(&self) -> String {
        let goal = self.grid.cell([self.goal[0], self.goal[1]]);
        let taken =
            goal.is_none_or(|cell| self.grid.seen_m()[cell] < self.size.radius_m + MARGIN_M);
        if taken {
            "the goal is occupied".to_owned()
        } else {
            "there is no free path".to_owned()
        }
    }

    /// Follows the path, looking ahead, until it ends or is blocked.
    fn follow(&mut self) -> Result<Leg, Interrupt> {
        let tick = self.robot.tick_secs();
        let (mut since_look, mut since_gaze) = (0.0, GAZE_SECS);
        let mut blocked = false;
        while !(self.follower.has_arrived() || blocked && self.follower.is_still()) {
            if since_gaze >= GAZE_SECS {
                since_gaze = 0.0;
                self.gaze();
            }
            if since_look >= LOOK_SECS && !blocked {
                since_look = 0.0;
                look(self.robot, self.size, &mut self.grid);
                blocked = !self.is_free();
            }
            self.follower.advance(&self.limits, tick, blocked);
            self.robot.send(&self.base, &self.follower.at())?;
            if self.is_held_up() {
                return Ok(Leg::HeldUp);
            }
            since_look += tick;
            since_gaze += tick;
        }
        Ok(if blocked { Leg::Blocked } else { Leg::Arrived })
    }

    /// Whether the rest of the path is free, as far as known.
    fn is_free(&self) -> bool {
        let left: Vec<[f64; 2]> = self.follower.left().collect();
        let from = left.first().copied().unwrap_or_default();
        // Checked without the planning margin, so that a planned path does not fail by the size of
        // a cell.
        let terrain = Terrain::new(&self.grid, self.size.radius_m, from);
        left.windows(2)
            .all(|pair| terrain.straight(pair[0], pair[1]).is_some())
    }

    /// Turns the head to the floor ahead.
    fn gaze(&mut self) {
        let [x, y] = self.follower.ahead(GAZE_M);
        let [at_x, at_y, heading] = self.follower.at();
        let way = length(x - at_x, y - at_y);
        // Near the end, looks straight ahead at the same distance.
        let point = if way < GAZE_M / 2.0 {
            Point3::new(
                at_x + GAZE_M * libm::cos(heading),
                at_y + GAZE_M * libm::sin(heading),
                0.0,
            )
        } else {
            Point3::new(x, y, 0.0)
        };
        self.look_towards(&point);
    }

    fn look_towards(&mut self, point: &Point3<f64>) {
        let posture = safely_towards(self.robot, point);
        let head = self.robot.layout().head.clone();
        let positions: Vec<f64> = head.iter().map(|joint| posture[*joint]).collect();
        self.robot.aim(&head, &positions);
    }

    /// Clears the perceived evidence, which may have been noise, and looks again.
    fn look_around(&mut self) -> Result<(), Interrupt> {
        self.robot.begin("look around");
        self.grid.forget();
        let [x, y, heading] = self.follower.at();
        for aside in LOOK_AROUND_RAD {
            let to = heading + aside;
            self.look_towards(&Point3::new(
                x + GAZE_M * libm::cos(to),
                y + GAZE_M * libm::sin(to),
                0.0,
            ));
            self.robot.wait(REST_SECS)?;
            look(self.robot, self.size, &mut self.grid);
        }
        Ok(())
    }

    fn is_held_up(&self) -> bool {
        let ([x, y, _], positions) = (self.follower.at(), self.robot.observe().positions);
        length(positions[self.base[0]] - x, positions[self.base[1]] - y) > HELD_UP_M
    }

    /// Waits until the base is at rest.
    fn come_to_rest(&mut self) -> Result<(), Interrupt> {
        let [shortest, longest] = ARRIVE_SECS;
        let (tick, mut waited, mut still) = (self.robot.tick_secs(), 0.0, 0.0);
        while waited < shortest || (still < AT_REST_SECS && waited < longest) {
            self.robot.wait(tick / 2.0)?;
            waited += tick;
            let velocities = self.robot.observe().velocities;
            let moves = self
                .base
                .iter()
                .any(|joint| velocities[*joint].abs() > AT_REST);
            still = if moves { 0.0 } else { still + tick };
        }
        Ok(())
    }

    fn report(&mut self, place: &str) -> Result<ActionReport, Interrupt> {
        self.robot.begin("arrive");
        self.come_to_rest()?;
        let positions = self.robot.observe().positions;
        let [x, y, heading] = self.base.map(|joint| positions[joint]);
        let off = length(x - self.goal[0], y - self.goal[1]);
        let turned = wrapped(heading - self.goal[2]).abs();
        if off > REACHED[0] || turned > REACHED[1] {
            let (off, turned) = (off * 100.0, turned.to_degrees());
            return Ok(failed(format!(
                "{place} was missed by {off:.0} cm and {turned:.0} degrees"
            )));
        }
        Ok(ActionReport {
            succeeded: true,
            message: format!("stands at {place}"),
        })
    }
}

/// How following a path ended.
enum Leg {
    Arrived,
    Blocked,
    HeldUp,
}

fn failed(message: impl Into<String>) -> ActionReport {
    ActionReport {
        succeeded: false,
        message: message.into(),
    }
}
