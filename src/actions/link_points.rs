//! Points on the surface of the robot's links, grouped for fast distance queries.

use nalgebra::{Isometry3, Point3};

/// Margin for rounding when a link is skipped by its bounding sphere. Unit: metres.
const ROUNDING_M: f64 = 1e-9;

/// Points on one link, in the link's frame, with a bounding sphere.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkPoints {
    /// The link's index.
    pub link: usize,
    centre: Point3<f64>,
    /// Unit: metres.
    radius: f64,
    /// Unit: metres.
    pub points: Vec<Point3<f64>>,
}

impl LinkPoints {
    /// Groups points (link, position on it) by link.
    pub fn grouped(points: &[(usize, Point3<f64>)]) -> Vec<Self> {
        let mut grouped: Vec<Self> = Vec::new();
        for (link, point) in points {
            match grouped.iter_mut().find(|group| group.link == *link) {
                Some(group) => group.points.push(*point),
                None => {
                    grouped.push(Self { link: *link, centre: Point3::origin(), radius: 0.0, points: vec![*point] });
                }
            }
        }
        grouped.iter_mut().for_each(Self::bound);
        grouped
    }

    /// Computes the bounding sphere around the mean of the points.
    fn bound(&mut self) {
        let sum = self.points.iter().fold(Point3::origin(), |sum, point| sum + point.coords);
        self.centre = sum / self.points.len() as f64;
        self.radius = self.points.iter().map(|point| (point - self.centre).norm()).fold(0.0, f64::max);
    }

    /// The smaller of `least` and the smallest distance of a point to the obstacle. Unit: metres.
    ///
    /// `distance` is the signed distance to the obstacle, which must not change by more than the point moves: the
    /// points are skipped if the bounding sphere is farther than `least`.
    pub fn nearest(&self, pose: &Isometry3<f64>, least: f64, distance: impl Fn(&Point3<f64>) -> f64) -> f64 {
        if distance(&(pose * self.centre)) - self.radius - ROUNDING_M > least {
            return least;
        }
        self.points.iter().fold(least, |least, point| least.min(distance(&(pose * point))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Skipping links never changes a result, not even its last bit.
    #[test]
    fn the_nearest_distance_equals_that_of_all_points() {
        let at = |n: u32| libm::sin(f64::from(n * n) * 12.9898);
        let point = |n: u32| Point3::new(at(n), at(n + 1000), at(n + 2000));
        for trial in 0..500 {
            let points: Vec<(usize, Point3<f64>)> =
                (0..1 + trial % 60).map(|n| ((n % 4) as usize, point(n + 60 * trial))).collect();
            let pose = Isometry3::translation(at(trial), at(trial + 1), at(trial + 2));
            let distance = |near: &Point3<f64>| (near - point(trial + 7)).norm() - 0.3;
            let most = 1.5 + at(trial + 3);
            let links = LinkPoints::grouped(&points);
            let fast = links.iter().fold(most, |least, link| link.nearest(&pose, least, distance));
            let plain = points.iter().fold(most, |least: f64, (_, point)| least.min(distance(&(pose * point))));
            assert_eq!(fast.to_bits(), plain.to_bits(), "trial {trial}");
        }
    }
}
