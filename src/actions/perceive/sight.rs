//! Combines several pictures taken by the head camera.

use nalgebra::{Isometry3, Point3};

use crate::operator::{Interrupt, Operator};
use crate::perceive::cloud::{points, thinned};
use crate::perceive::gaze::way_towards;
use crate::perceive::interpret::{GRID_M, Surface};
use actcheck_world::{DepthImage, RobotBody};

/// Time for the head to come to rest. Unit: seconds.
const REST_SECS: f64 = 0.3;
/// Points closer to the robot's own shapes belong to the robot. Unit: metres. Allows for
/// calibration error and noise.
const OWN_M: f64 = 0.02;
/// Corners closer than this are the same. Unit: metres.
const SAME_M: f64 = 0.03;
/// Share of the picture at its border in which a corner does not count as seen: the surface may
/// continue beyond.
const BORDER_SHARE: f64 = 0.05;

/// Everything seen so far.
#[derive(Default)]
pub(super) struct Sight {
    /// Points that do not belong to the robot. Frame: world, by the base's belief.
    pub(super) points: Vec<Point3<f64>>,
    views: Vec<View>,
}

/// One picture and the pose of the camera.
struct View {
    image: DepthImage,
    camera: Isometry3<f64>,
}

impl Sight {
    /// Turns the head to a point and takes a picture.
    pub(super) fn add_look_at(
        &mut self,
        point: &Point3<f64>,
        robot: &mut Operator<'_>,
    ) -> Result<(), Interrupt> {
        let way = way_towards(robot, point);
        robot.follow(&way, 0.0)?;
        robot.wait(REST_SECS)?;
        let positions = robot.observe().positions;
        let camera = robot.kinematics().camera(&positions);
        let own = RobotBody::new(robot.kinematics(), &positions);
        let image = robot.look();
        let seen = thinned(&points(&image, &camera), GRID_M);
        self.points
            .extend(seen.into_iter().filter(|point| !own.is_near(point, OWN_M)));
        // Thin again: several pictures together keep the density of one.
        self.points = thinned(&self.points, GRID_M);
        self.views.push(View { image, camera });
        Ok(())
    }

    /// Looks at the corners of a surface that are in no picture yet, until all are seen or the head
    /// can't reach, and returns the updated surface. `find` finds the surface among points.
    pub(super) fn take_in(
        &mut self,
        mut surface: Surface,
        most_views: usize,
        find: impl Fn(&[Point3<f64>]) -> Option<Surface>,
        robot: &mut Operator<'_>,
    ) -> Result<Surface, Interrupt> {
        let mut last: Option<Point3<f64>> = None;
        while self.views.len() < most_views {
            let Some(corner) = self.unseen(&surface) else {
                break;
            };
            // Still not in the picture after looking at it: the head can't reach.
            if last.is_some_and(|last| (last - corner).norm() < SAME_M) {
                break;
            }
            last = Some(corner);
            robot.begin("look at a corner");
            self.add_look_at(&corner, robot)?;
            // More points should only improve the surface. If it is no longer found, keep the
            // previous one.
            surface = find(&self.points).unwrap_or(surface);
        }
        Ok(surface)
    }

    /// A corner of the surface that is not well inside the borders of any picture. Returns `None`
    /// if all corners are.
    pub(super) fn unseen(&self, surface: &Surface) -> Option<Point3<f64>> {
        surface
            .corners()
            .into_iter()
            .find(|corner| !self.views.iter().any(|view| view.shows(corner)))
    }

    /// Position of the camera at the last picture. (The head turns about its neck, so other
    /// pictures were taken within a few centimetres.)
    pub(super) fn eye(&self) -> Point3<f64> {
        self.views.last().map_or(Point3::origin(), |view| {
            Point3::from(view.camera.translation.vector)
        })
    }
}

impl View {
    /// Whether a point is in the picture and away from its border. It may be occluded.
    fn shows(&self, point: &Point3<f64>) -> bool {
        let extent = [self.image.width, self.image.height].map(|count| count as f64);
        let inside =
            |(at, extent): (f64, f64)| (BORDER_SHARE..=1.0 - BORDER_SHARE).contains(&(at / extent));
        let pixel = self.image.pixel(&(self.camera.inverse() * point));
        pixel.is_some_and(|pixel| pixel.into_iter().zip(extent).all(inside))
    }
}
