//! Finds the largest level plane among points: the guess with the most inliers, then a fit to those
//! inliers.

use nalgebra::{Point3, Unit, Vector3};

use actcheck_data::Stream;

/// Prior knowledge about the plane.
#[derive(Debug, Clone)]
pub struct Prior {
    /// Height range of its points, which excludes the floor and overhead shelves. Unit: metres.
    pub heights_m: (f64, f64),
    /// Largest angle from the level. Unit: radians.
    pub tilt_rad: f64,
    /// Largest distance of an inlier. Unit: metres.
    pub off_m: f64,
}

/// A plane with an upper side.
#[derive(Debug, Clone, PartialEq)]
pub struct Plane {
    /// A point of the plane: the mean of the points it was fitted to.
    pub point: Point3<f64>,
    /// Normal of its upper side.
    pub normal: Unit<Vector3<f64>>,
}

/// Number of guesses. If a third of the points are inliers, one guess in 27 is right, and all are
/// wrong once in 10¹⁶ times.
const N_GUESSES: u64 = 1000;
/// Number of points used to score a guess.
const N_JUDGES: usize = 500;
/// Fewest points that make a plane.
const LEAST_POINTS: usize = 100;
/// Rounds of refitting to the points near the last fit. The result no longer changes after two.
const N_FITS: usize = 3;

impl Plane {
    /// Height of a point above the plane, along its normal. Unit: metres.
    pub fn above(&self, point: &Point3<f64>) -> f64 {
        (point - self.point).dot(&self.normal)
    }

    /// Angle from the level. Unit: radians.
    pub fn tilt(&self) -> f64 {
        libm::acos(self.normal.z.clamp(-1.0, 1.0))
    }

    /// The plane through three points. Returns `None` if they are collinear.
    fn through(a: &Point3<f64>, b: &Point3<f64>, c: &Point3<f64>) -> Option<Self> {
        let normal = (b - a).cross(&(c - a));
        let upwards = if normal.z < 0.0 { -normal } else { normal };
        Unit::try_new(upwards, 1e-6).map(|normal| Self { point: *a, normal })
    }

    /// The plane with the least sum of squared vertical distances. (For a nearly level plane this
    /// is as good as distances along the normal.)
    fn fitted(points: &[Point3<f64>]) -> Option<Self> {
        let middle = Point3::from(
            points
                .iter()
                .map(|point| point.coords)
                .sum::<Vector3<f64>>()
                / points.len() as f64,
        );
        let [mut xx, mut xy, mut yy, mut xz, mut yz] = [0.0; 5];
        for point in points {
            let d = point - middle;
            (xx, xy, yy) = (xx + d.x * d.x, xy + d.x * d.y, yy + d.y * d.y);
            (xz, yz) = (xz + d.x * d.z, yz + d.y * d.z);
        }
        let det = xx * yy - xy * xy;
        let (slope_x, slope_y) = ((xz * yy - yz * xy) / det, (yz * xx - xz * xy) / det);
        let normal = Unit::try_new(Vector3::new(-slope_x, -slope_y, 1.0), 1e-6)?;
        (det > 1e-12 && slope_x.is_finite() && slope_y.is_finite()).then_some(Self {
            point: middle,
            normal,
        })
    }
}

/// The plane with the most inliers, and their indices. Returns `None` if there are too few points
/// or inliers, or the plane is tilted too far. The same seed makes the same guesses.
pub fn find(points: &[Point3<f64>], prior: &Prior, seed: u64) -> Option<(Plane, Vec<usize>)> {
    let (low, high) = prior.heights_m;
    let within: Vec<usize> = (0..points.len())
        .filter(|idx| (low..=high).contains(&points[*idx].z))
        .collect();
    if within.len() < LEAST_POINTS {
        return None;
    }
    let mut plane = guess(points, &within, prior, seed)?;
    let near = |plane: &Plane| -> Vec<usize> {
        within
            .iter()
            .copied()
            .filter(|idx| plane.above(&points[*idx]).abs() <= prior.off_m)
            .collect()
    };
    for _ in 0..N_FITS {
        let some: Vec<Point3<f64>> = near(&plane).into_iter().map(|idx| points[idx]).collect();
        plane = Plane::fitted(&some)?;
    }
    let inliers = near(&plane);
    (inliers.len() >= LEAST_POINTS && plane.tilt() <= prior.tilt_rad).then_some((plane, inliers))
}

/// The best of many planes through three points each.
fn guess(points: &[Point3<f64>], within: &[usize], prior: &Prior, seed: u64) -> Option<Plane> {
    let stream = Stream::new(seed);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "an index below the number of points"
    )]
    let pick = |number: u64| points[within[(stream.unit(number) * within.len() as f64) as usize]];
    let judges: Vec<Point3<f64>> = (0..N_JUDGES as u64)
        .map(|number| pick(3 * N_GUESSES + number))
        .collect();
    let mut best: Option<(usize, Plane)> = None;
    for number in 0..N_GUESSES {
        let corners = [0, 1, 2].map(|corner| pick(3 * number + corner));
        let Some(plane) = Plane::through(&corners[0], &corners[1], &corners[2]) else {
            continue;
        };
        if plane.tilt() > prior.tilt_rad {
            continue;
        }
        let agree = judges
            .iter()
            .filter(|point| plane.above(point).abs() <= prior.off_m)
            .count();
        if best.as_ref().is_none_or(|(most, _)| agree > *most) {
            best = Some((agree, plane));
        }
    }
    best.map(|(_, plane)| plane)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PRIOR: Prior = Prior {
        heights_m: (0.2, 1.3),
        tilt_rad: 0.15,
        off_m: 0.01,
    };

    /// Points on z = 0.7 + 0.05 x − 0.02 y over a square metre with 2 mm of noise, and as many
    /// anywhere above.
    fn scattered(seed: u64) -> (Vec<Point3<f64>>, Plane) {
        let stream = Stream::new(seed);
        let mut points = Vec::new();
        for number in 0..2000u64 {
            let [x, y, z] = [0, 1, 2].map(|axis| stream.unit(5 * number + axis));
            let noise = 0.002 * stream.bell(5 * number + 3);
            points.push(Point3::new(x, y, 0.7 + 0.05 * x - 0.02 * y + noise));
            points.push(Point3::new(x, y, 0.78 + 0.4 * z));
        }
        let normal = Unit::new_normalize(Vector3::new(-0.05, 0.02, 1.0));
        (
            points,
            Plane {
                point: Point3::new(0.5, 0.5, 0.715),
                normal,
            },
        )
    }

    #[test]
    fn a_noisy_plane_among_outliers_is_found_to_a_fraction_of_its_noise() {
        for seed in 0..5 {
            let (points, truth) = scattered(seed);
            let (plane, inliers) = find(&points, &PRIOR, seed).expect("a plane is found");
            assert!(
                plane.above(&truth.point).abs() < 3e-4,
                "{} m off",
                plane.above(&truth.point)
            );
            assert!(
                plane.normal.angle(&truth.normal) < 1e-3,
                "{} rad off",
                plane.normal.angle(&truth.normal)
            );
            assert_eq!(inliers.len(), 2000);
            assert_eq!(find(&points, &PRIOR, seed), Some((plane, inliers)));
        }
    }

    #[test]
    fn three_exact_points_give_the_exact_plane() {
        let points = [
            [0.0, 0.0, 1.0],
            [1.0, 0.0, 1.1],
            [0.0, 1.0, 0.8],
            [1.0, 1.0, 0.9],
        ]
        .map(Point3::from);
        let plane = Plane::fitted(&points).expect("the points are not collinear");
        assert!(points.iter().all(|point| plane.above(point).abs() < 1e-12));
        assert!((plane.tilt() - libm::atan(0.05f64.sqrt())).abs() < 1e-12);
        assert_eq!(Plane::fitted(&points[..2]), None);
    }

    #[test]
    fn walls_and_the_floor_are_not_level_surfaces() {
        let stream = Stream::new(1);
        let wall = |n: u64| Point3::new(2.0, stream.unit(2 * n), 1.2 * stream.unit(2 * n + 1));
        let floor = |n: u64| Point3::new(stream.unit(2 * n), stream.unit(2 * n + 1), 0.0);
        let points: Vec<Point3<f64>> = (0..1000).flat_map(|n| [wall(n), floor(n)]).collect();
        assert_eq!(find(&points, &PRIOR, 0), None);
        assert_eq!(find(&[], &PRIOR, 0), None);
    }
}
