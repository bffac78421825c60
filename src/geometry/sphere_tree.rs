//! Things in space as a tree of bounding spheres, so that those far away are skipped together.

use std::ops::Range;

use nalgebra::Point3;

/// A sphere. Unit: metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sphere {
    /// Its centre.
    pub middle: Point3<f64>,
    /// Its radius.
    pub radius: f64,
}

/// Things that are near each other.
#[derive(Debug, Clone, PartialEq)]
pub struct Cluster {
    /// A sphere around them.
    pub around: Sphere,
    /// Indices of the things; none if the cluster has two halves, which then follow it.
    pub things: Range<usize>,
    /// Index of the cluster after it and its halves.
    pub next: usize,
}

impl Sphere {
    /// Returns the sphere around others with its centre at the mean of their centres.
    fn around(others: &[Self]) -> Self {
        let sum = others
            .iter()
            .fold(Point3::origin(), |sum, other| sum + other.middle.coords);
        let middle = sum / others.len().max(1) as f64;
        let farthest = |other: &Self| (other.middle - middle).norm() + other.radius;
        Self {
            middle,
            radius: others.iter().map(farthest).fold(0.0, f64::max),
        }
    }
}

/// Returns the clusters of things, each before its halves. Sorts the things so that those of a
/// cluster are next to each other. A cluster of at most `most` things has no halves.
pub fn sphere_tree<T>(
    things: &mut [T],
    most: usize,
    sphere: impl Fn(&T) -> Sphere,
) -> Vec<Cluster> {
    let mut found = Vec::new();
    split(things, 0, most.max(1), &sphere, &mut found);
    found
}

/// Splits things along the longest side of the box around their centres. `first`: the index of the
/// first one.
fn split<T>(
    things: &mut [T],
    first: usize,
    most: usize,
    sphere: &impl Fn(&T) -> Sphere,
    found: &mut Vec<Cluster>,
) {
    let spheres: Vec<Sphere> = things.iter().map(sphere).collect();
    let (idx, n_things) = (found.len(), things.len());
    found.push(Cluster {
        around: Sphere::around(&spheres),
        things: first..first,
        next: 0,
    });
    if n_things <= most {
        found[idx].things = first..first + n_things;
    } else {
        let side = |axis: &usize| {
            let along = || spheres.iter().map(|sphere| sphere.middle[*axis]);
            along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
        };
        let longest = (0..3)
            .max_by(|a, b| side(a).total_cmp(&side(b)))
            .unwrap_or(0);
        things.sort_by(|a, b| sphere(a).middle[longest].total_cmp(&sphere(b).middle[longest]));
        let (lower, upper) = things.split_at_mut(n_things / 2);
        split(lower, first, most, sphere, found);
        split(upper, first + n_things / 2, most, sphere, found);
    }
    found[idx].next = found.len();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_thing_is_in_one_cluster_and_in_all_spheres_above_it() {
        let at = |n: u32| libm::sin(f64::from(n * n) * 12.9898);
        for n_things in 0..70 {
            let mut things: Vec<(u32, Sphere)> = (0..n_things)
                .map(|n| {
                    (
                        n,
                        Sphere {
                            middle: Point3::new(at(n), at(n + 99), 0.1),
                            radius: at(n).abs() * 0.1,
                        },
                    )
                })
                .collect();
            let clusters = sphere_tree(&mut things, 4, |(_, sphere)| *sphere);
            let mut n_found = 0;
            for (idx, cluster) in clusters.iter().enumerate() {
                assert!(
                    cluster.things.len() <= 4
                        && cluster.next > idx
                        && cluster.next <= clusters.len()
                );
                n_found += cluster.things.len();
                for (_, thing) in clusters[idx..cluster.next]
                    .iter()
                    .flat_map(|inner| &things[inner.things.clone()])
                {
                    let far = (thing.middle - cluster.around.middle).norm() + thing.radius;
                    assert!(far <= cluster.around.radius + 1e-12, "{far} of {n_things}");
                }
            }
            assert_eq!(n_found, things.len());
            things.sort_by_key(|(n, _)| *n);
            assert!(
                things
                    .iter()
                    .zip(0..)
                    .all(|((n, _), expected)| *n == expected)
            );
        }
    }
}
