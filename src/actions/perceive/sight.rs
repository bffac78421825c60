//! What the head sees in several pictures, together.

use nalgebra::{Isometry3, Point3};

use crate::actions::operator::{Interrupt, Operator};
use crate::actions::perceive::cloud::{points, thinned};
use crate::actions::perceive::gaze::towards;
use crate::actions::perceive::interpret::{GRID_M, Surface};
use crate::world::{DepthImage, OwnBody};

/// Time for the head to come to rest. Unit: seconds.
const REST_SECS: f64 = 0.3;
/// What is nearer to the robot's own shapes is itself. Unit: metres. Calibration and noise.
const OWN_M: f64 = 0.02;
/// Corners that are nearer to each other are the same. Unit: metres.
const SAME_M: f64 = 0.03;
/// Part of the picture at its border in which a corner does not count as seen: what is beyond may belong to it.
const BORDER_SHARE: f64 = 0.05;

/// All that was seen so far.
#[derive(Default)]
pub(super) struct Sight {
    /// What there is besides the robot. Frame: world, by the base's belief.
    pub(super) points: Vec<Point3<f64>>,
    views: Vec<View>,
}

/// One picture and where it was taken.
struct View {
    image: DepthImage,
    camera: Isometry3<f64>,
}

impl Sight {
    /// Turns the head to a point and takes a picture.
    pub(super) fn add_look_at(&mut self, point: &Point3<f64>, robot: &mut Operator<'_>) -> Result<(), Interrupt> {
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

    /// Looks at the corners of a surface that no picture shows yet, until all are seen or the head does not reach, and gives
    /// the surface as it is then. `find` finds it among points.
    pub(super) fn take_in(
        &mut self,
        mut surface: Surface,
        most_views: usize,
        find: impl Fn(&[Point3<f64>]) -> Option<Surface>,
        robot: &mut Operator<'_>,
    ) -> Result<Surface, Interrupt> {
        let mut last: Option<Point3<f64>> = None;
        while self.views.len() < most_views {
            let Some(corner) = self.unseen(&surface) else { break };
            // Looking at it has not brought it into the picture: the head does not reach.
            if last.is_some_and(|last| (last - corner).norm() < SAME_M) {
                break;
            }
            last = Some(corner);
            robot.begin("look at a corner");
            self.add_look_at(&corner, robot)?;
            // More points only make more of it; were there none any more, what was found before would stand.
            surface = find(&self.points).unwrap_or(surface);
        }
        Ok(surface)
    }

    /// A corner of the surface that no picture shows well inside of its borders.
    pub(super) fn unseen(&self, surface: &Surface) -> Option<Point3<f64>> {
        surface.corners().into_iter().find(|corner| !self.views.iter().any(|view| view.shows(corner)))
    }

    /// Where the last picture was taken from. (The head turns about its neck: others were taken a few centimetres away.)
    pub(super) fn eye(&self) -> Point3<f64> {
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
