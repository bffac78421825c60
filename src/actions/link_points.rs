//! Points on the surface of the robot's links, grouped for fast distance queries.

use nalgebra::{Isometry3, Point3};

/// Margin for rounding when a link is skipped by its bounding sphere. Unit: metres.
const ROUNDING_M: f64 = 1e-9;

/// Largest number of points in a cluster: about as many as cost as much as its sphere saves.
const CLUSTER: usize = 6;

/// Points on one link, in the link's frame.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkPoints {
    /// The link's index.
    pub link: usize,
    /// Unit: metres.
    pub points: Vec<Point3<f64>>,
    around: Sphere,
    /// The same points in clusters of neighbours.
    clusters: Vec<(Sphere, Vec<Point3<f64>>)>,
}

/// A bounding sphere. Unit: metres.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sphere {
    centre: Point3<f64>,
    radius: f64,
}

impl Sphere {
    /// The sphere around points with its centre at their mean.
    fn around(points: &[Point3<f64>]) -> Self {
        let sum = points.iter().fold(Point3::origin(), |sum, point| sum + point.coords);
        let centre = sum / points.len().max(1) as f64;
        Self { centre, radius: points.iter().map(|point| (point - centre).norm()).fold(0.0, f64::max) }
    }

    /// Whether all points in it are farther than `least` from an obstacle. Unit: metres.
    fn is_beyond(&self, pose: &Isometry3<f64>, least: f64, distance: impl Fn(&Point3<f64>) -> f64) -> bool {
        distance(&(pose * self.centre)) - self.radius - ROUNDING_M > least
    }
}

/// Splits points along the longest side of their box until each cluster is small.
fn clusters(mut points: Vec<Point3<f64>>, found: &mut Vec<(Sphere, Vec<Point3<f64>>)>) {
    if points.len() <= CLUSTER {
        found.push((Sphere::around(&points), points));
        return;
    }
    let side = |axis: &usize| {
        let along = || points.iter().map(|point| point[*axis]);
        along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
    };
    let longest = (0..3).max_by(|a, b| side(a).total_cmp(&side(b))).unwrap_or(0);
    points.sort_by(|a, b| a[longest].total_cmp(&b[longest]));
    let upper = points.split_off(points.len() / 2);
    clusters(points, found);
    clusters(upper, found);
}

impl LinkPoints {
    /// Groups points (link, position on it) by link.
    pub fn grouped(points: &[(usize, Point3<f64>)]) -> Vec<Self> {
        let mut grouped: Vec<(usize, Vec<Point3<f64>>)> = Vec::new();
        for (link, point) in points {
            match grouped.iter_mut().find(|(known, _)| known == link) {
                Some((_, group)) => group.push(*point),
                None => grouped.push((*link, vec![*point])),
            }
        }
        let of_link = |(link, points): (usize, Vec<Point3<f64>>)| {
            let mut found = Vec::new();
            clusters(points.clone(), &mut found);
            Self { link, around: Sphere::around(&points), clusters: found, points }
        };
        grouped.into_iter().map(of_link).collect()
    }

    /// The smaller of `least` and the smallest distance of a point to the obstacle. Unit: metres.
    ///
    /// `distance` is the signed distance to the obstacle, which must not change by more than the point moves: the
    /// points in a bounding sphere that is farther than `least` are skipped.
    pub fn nearest(&self, pose: &Isometry3<f64>, least: f64, distance: impl Fn(&Point3<f64>) -> f64) -> f64 {
        if self.around.is_beyond(pose, least, &distance) {
            return least;
        }
        self.clusters.iter().fold(least, |least, (around, points)| match around.is_beyond(pose, least, &distance) {
            true => least,
            false => points.iter().fold(least, |least, point| least.min(distance(&(pose * point)))),
        })
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
