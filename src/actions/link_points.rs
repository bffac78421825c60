//! Points on the surface of the robot's links, grouped for fast distance queries.

use nalgebra::{Isometry3, Point3};

use actcheck_world::{Cluster, Sphere, sphere_tree};

/// Margin for rounding when a link is skipped by its bounding sphere. Unit: metres.
const ROUNDING_M: f64 = 1e-9;

/// Largest number of points in a cluster: about as many as cost as much as its sphere saves.
const CLUSTER: usize = 6;

/// Points on one link, in the link's frame.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkPoints {
    /// The link's index.
    pub link: usize,
    /// In the order of their clusters. Unit: metres.
    points: Vec<Point3<f64>>,
    clusters: Vec<Cluster>,
}

/// Whether all points in a sphere are farther than `least` from an obstacle. Unit: metres.
fn is_beyond(
    around: &Sphere,
    pose: &Isometry3<f64>,
    least: f64,
    distance: impl Fn(&Point3<f64>) -> f64,
) -> bool {
    distance(&(pose * around.middle)) - around.radius - ROUNDING_M > least
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
        let of_link = |(link, mut points): (usize, Vec<Point3<f64>>)| {
            let clusters = sphere_tree(&mut points, CLUSTER, |point| Sphere {
                middle: *point,
                radius: 0.0,
            });
            Self {
                link,
                points,
                clusters,
            }
        };
        grouped.into_iter().map(of_link).collect()
    }

    /// The smaller of `least` and the smallest distance of a point to the obstacle. Unit: metres.
    ///
    /// `distance` is the signed distance to the obstacle, which must not change by more than the
    /// point moves: the points in a bounding sphere that is farther than `least` are skipped.
    pub fn nearest(
        &self,
        pose: &Isometry3<f64>,
        mut least: f64,
        distance: impl Fn(&Point3<f64>) -> f64,
    ) -> f64 {
        let mut idx = 0;
        while let Some(cluster) = self.clusters.get(idx) {
            if is_beyond(&cluster.around, pose, least, &distance) {
                idx = cluster.next;
            } else {
                let points = &self.points[cluster.things.clone()];
                least = points
                    .iter()
                    .fold(least, |least, point| least.min(distance(&(pose * point))));
                idx += 1;
            }
        }
        least
    }

    /// Whether any point is nearer to the obstacle than this. Unit: metres. See
    /// [`LinkPoints::nearest`].
    pub fn is_nearer(
        &self,
        pose: &Isometry3<f64>,
        least: f64,
        distance: impl Fn(&Point3<f64>) -> f64,
    ) -> bool {
        let mut idx = 0;
        while let Some(cluster) = self.clusters.get(idx) {
            if is_beyond(&cluster.around, pose, least, &distance) {
                idx = cluster.next;
            } else if self.points[cluster.things.clone()]
                .iter()
                .any(|point| distance(&(pose * point)) < least)
            {
                return true;
            } else {
                idx += 1;
            }
        }
        false
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
            let points: Vec<(usize, Point3<f64>)> = (0..1 + trial % 60)
                .map(|n| ((n % 4) as usize, point(n + 60 * trial)))
                .collect();
            let pose = Isometry3::translation(at(trial), at(trial + 1), at(trial + 2));
            let distance = |near: &Point3<f64>| (near - point(trial + 7)).norm() - 0.3;
            let most = 1.5 + at(trial + 3);
            let links = LinkPoints::grouped(&points);
            let fast = links
                .iter()
                .fold(most, |least, link| link.nearest(&pose, least, distance));
            let all = points.iter().map(|(_, point)| distance(&(pose * point)));
            let plain = all.fold(f64::INFINITY, f64::min);
            assert_eq!(fast.to_bits(), plain.min(most).to_bits(), "trial {trial}");
            for least in [most, plain + 1e-6, plain] {
                let is_nearer = links
                    .iter()
                    .any(|link| link.is_nearer(&pose, least, distance));
                assert_eq!(is_nearer, plain < least, "trial {trial}");
            }
        }
    }
}
