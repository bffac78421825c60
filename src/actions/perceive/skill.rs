//! The skill: look ahead until there is a surface, look where it runs out of the picture, say what stands on it.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Point3};

use crate::actions::operator::{Interrupt, Operator};
use crate::actions::perceive::cloud::{points, thinned};
use crate::actions::perceive::gaze::towards;
use crate::actions::perceive::interpret::{GRID_M, Surface};
use crate::actions::{ActionCall, ActionReport, Perceived};
use crate::base::names;
use crate::world::{DepthImage, OwnBody};

/// Where a surface is looked for: distance in front of the base, and height. Unit: metres. A table, a low table, a far one.
const AHEAD_M: [[f64; 2]; 3] = [[1.0, 0.7], [0.8, 0.35], [1.8, 0.8]];
/// Pictures that are taken at most.
const MOST_VIEWS: usize = 7;
/// Time for the head to come to rest. Unit: seconds.
const REST_SECS: f64 = 0.3;
/// What is nearer to the robot's own shapes is itself. Unit: metres. Calibration and noise.
const OWN_M: f64 = 0.02;
/// Corners that are nearer to each other are the same. Unit: metres.
const SAME_M: f64 = 0.03;
/// Part of the picture at its border in which a corner does not count as seen: what is beyond may belong to it.
const BORDER_SHARE: f64 = 0.05;

/// Looks for a surface and for what stands on it, and keeps that for later actions.
///
/// # Errors
/// [`Interrupt`] if simulation broke or time ran out.
pub fn perceive_plane(_: &ActionCall, robot: &mut Operator<'_>) -> Result<ActionReport, Interrupt> {
    let mut sight = Sight::default();
    let mut surface = None;
    for ahead in AHEAD_M {
        robot.begin("look ahead");
        let point = in_front(robot, ahead);
        sight.add_look_at(&point, robot)?;
        surface = Surface::find(&sight.points);
        if surface.is_some() {
            break;
        }
    }
    let Some(mut surface) = surface else {
        robot.remember(Perceived::default());
        return Ok(ActionReport { succeeded: false, message: "no level surface was found".to_owned() });
    };
    let mut last: Option<Point3<f64>> = None;
    while sight.views.len() < MOST_VIEWS {
        let Some(corner) = sight.unseen(&surface) else { break };
        // Looking at it has not brought it into the picture: the head does not reach.
        if last.is_some_and(|last| (last - corner).norm() < SAME_M) {
            break;
        }
        last = Some(corner);
        robot.begin("look at a corner");
        sight.add_look_at(&corner, robot)?;
        // More points only make more of it; were there none any more, what was found before would stand.
        surface = Surface::find(&sight.points).unwrap_or(surface);
    }
    robot.begin("interpret");
    let things = surface.things(&sight.points, &sight.eye(), robot.known_kinds());
    let perceived = Perceived { plane: Some(surface.perceived()), things };
    let report = report(&perceived, sight.unseen(&surface).is_none());
    robot.remember(perceived);
    Ok(report)
}

/// A point so far in front of the base, so high. Frame: world, by the base's belief.
fn in_front(robot: &Operator<'_>, [distance, height]: [f64; 2]) -> Point3<f64> {
    let mut point = robot.base() * Point3::new(distance, 0.0, 0.0);
    point.z = height;
    point
}

/// All that was seen so far.
#[derive(Default)]
struct Sight {
    /// What there is besides the robot. Frame: world, by the base's belief.
    points: Vec<Point3<f64>>,
    views: Vec<View>,
}

/// One picture and where it was taken.
struct View {
    image: DepthImage,
    camera: Isometry3<f64>,
}

impl Sight {
    /// Turns the head to a point and takes a picture.
    fn add_look_at(&mut self, point: &Point3<f64>, robot: &mut Operator<'_>) -> Result<(), Interrupt> {
        let posture = towards(robot.kinematics(), robot.layout(), robot.commanded(), point);
        robot.follow(&[posture], 0.0)?;
        robot.wait(REST_SECS)?;
        let positions = robot.observe().positions;
        let camera = robot.kinematics().camera(&positions);
        let own = OwnBody::new(robot.kinematics(), &positions);
        let image = robot.look();
        let seen = thinned(&points(&image, &camera), GRID_M);
        self.points.extend(seen.into_iter().filter(|point| !own.is_near(point, OWN_M)));
        // Points of several pictures together are as many as those of one.
        self.points = thinned(&self.points, GRID_M);
        self.views.push(View { image, camera });
        Ok(())
    }

    /// A corner of the surface that no picture shows well inside of its borders.
    fn unseen(&self, surface: &Surface) -> Option<Point3<f64>> {
        surface.corners().into_iter().find(|corner| !self.views.iter().any(|view| view.shows(corner)))
    }

    /// Where the last picture was taken from. (The head turns about its neck: others were taken a few centimetres away.)
    fn eye(&self) -> Point3<f64> {
        self.views.last().map_or(Point3::origin(), |view| Point3::from(view.camera.translation.vector))
    }
}

impl View {
    /// Whether a point is in the picture and not at its border. It may be hidden.
    fn shows(&self, point: &Point3<f64>) -> bool {
        let extent = [self.image.width, self.image.height].map(|count| count as f64);
        let inside = |(at, extent): (f64, f64)| (BORDER_SHARE..=1.0 - BORDER_SHARE).contains(&(at / extent));
        let pixel = self.image.pixel(&(self.camera.inverse() * point));
        pixel.is_some_and(|pixel| pixel.into_iter().zip(extent).all(inside))
    }
}

fn report(perceived: &Perceived, whole: bool) -> ActionReport {
    let Some(plane) = perceived.plane else {
        return ActionReport { succeeded: false, message: "no level surface was found".to_owned() };
    };
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for thing in &perceived.things {
        *counts.entry(thing.category.as_deref().map_or("unknown", names::local)).or_default() += 1;
    }
    let things: Vec<String> = counts.into_iter().map(|(kind, count)| format!("{count} {kind}")).collect();
    let things = if things.is_empty() { "nothing".to_owned() } else { things.join(", ") };
    let ([_, _, height], [width, depth]) = (plane.pose.position, plane.size_m);
    let found = format!("a surface of {width:.2} × {depth:.2} m, {height:.2} m high, and on it {things}");
    if !whole {
        return ActionReport { succeeded: false, message: format!("{found}; it goes on beyond what the head can see") };
    }
    ActionReport { succeeded: true, message: found }
}
