//! Converts depth pictures to points in the world.

use nalgebra::{Isometry3, Point3, Vector3};

use actcheck_world::DepthImage;

/// The points seen by all pixels with a depth. `camera` is the pose of the camera; the points are
/// in its parent frame.
pub fn points(image: &DepthImage, camera: &Isometry3<f64>) -> Vec<Point3<f64>> {
    let pixels =
        (0..image.height).flat_map(|row| (0..image.width).map(move |column| (column, row)));
    pixels
        .filter_map(|(column, row)| image.point(column, row))
        .map(|point| camera * point)
        .collect()
}

/// Downsamples points to one per occupied cube of a grid: their mean, in the order of the cubes.
/// Unit of the edge: metres.
pub fn thinned(points: &[Point3<f64>], edge: f64) -> Vec<Point3<f64>> {
    let mut by_cube: Vec<([i64; 3], usize)> = points
        .iter()
        .enumerate()
        .map(|(idx, point)| (cube_of(point, edge), idx))
        .collect();
    by_cube.sort_unstable();
    let cubes = by_cube.chunk_by(|(a, _), (b, _)| a == b);
    cubes
        .map(|cube| {
            let sum: Vector3<f64> = cube.iter().map(|(_, idx)| points[*idx].coords).sum();
            Point3::from(sum / cube.len() as f64)
        })
        .collect()
}

/// The grid cube that contains a point.
pub fn cube_of(point: &Point3<f64>, edge: f64) -> [i64; 3] {
    [point.x, point.y, point.z].map(|along| {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "a few metres of millimetres"
        )]
        let idx = (along / edge).floor() as i64;
        idx
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_become_points_in_the_world_frame() {
        // One row of two pixels, a metre away, half a metre to either side; the camera looks along
        // y.
        let image = DepthImage {
            width: 2,
            height: 1,
            focal_px: 1.0,
            depths: vec![1.0, 0.0],
        };
        let camera = Isometry3::new(
            Vector3::new(1.0, 2.0, 3.0),
            Vector3::z() * std::f64::consts::FRAC_PI_2,
        );
        let points = points(&image, &camera);
        assert_eq!(points.len(), 1);
        assert!(
            (points[0] - Point3::new(0.5, 3.0, 3.0)).norm() < 1e-9,
            "{}",
            points[0]
        );
    }

    #[test]
    fn a_voxel_keeps_the_mean_of_its_points() {
        let points = [
            [0.1, 0.1, 0.1],
            [1.5, 0.5, 0.5],
            [0.3, 0.5, 0.7],
            [-0.1, 0.1, 0.1],
        ]
        .map(Point3::from);
        let kept = thinned(&points, 1.0);
        let expected = [[-0.1, 0.1, 0.1], [0.2, 0.3, 0.4], [1.5, 0.5, 0.5]].map(Point3::from);
        assert_eq!(kept.len(), 3);
        assert!(
            kept.iter()
                .zip(expected)
                .all(|(kept, expected)| (kept - expected).norm() < 1e-12),
            "{kept:?}"
        );
    }
}
