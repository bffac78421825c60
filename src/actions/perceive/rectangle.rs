//! The smallest rectangle around points of a plane.

use nalgebra::{Point2, Vector2};

use actcheck_data::convex_hull;

/// A rotated rectangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rectangle {
    /// Its middle.
    pub centre: Point2<f64>,
    /// Heading of its first side. Unit: radians in [−π/4, π/4).
    pub yaw: f64,
    /// Lengths of the first side and of the other. Unit: metres.
    pub size_m: [f64; 2],
}

impl Rectangle {
    /// A point in the rectangle's frame.
    pub fn local(&self, point: &Point2<f64>) -> Vector2<f64> {
        turned(point - self.centre, -self.yaw)
    }

    /// The four corners, in order around the rectangle.
    pub fn corners(&self) -> [Point2<f64>; 4] {
        let [x, y] = self.size_m.map(|side| side / 2.0);
        [(x, y), (-x, y), (-x, -y), (x, -y)]
            .map(|(x, y)| self.centre + turned(Vector2::new(x, y), self.yaw))
    }
}

/// The rectangle of the smallest area: one of its sides lies along a side of the convex hull.
/// Returns `None` without points.
pub fn smallest_around(points: &[Point2<f64>]) -> Option<Rectangle> {
    let hull: Vec<Point2<f64>> = convex_hull(points.iter().map(|point| [point.x, point.y]))
        .into_iter()
        .map(Point2::from)
        .collect();
    let ends = hull.iter().zip(hull.iter().cycle().skip(1));
    let headings = ends.map(|(a, b)| libm::atan2(b.y - a.y, b.x - a.x));
    let rectangles = headings.map(|heading| around(&hull, quarter(heading)));
    rectangles.min_by(|a, b| (a.size_m[0] * a.size_m[1]).total_cmp(&(b.size_m[0] * b.size_m[1])))
}

/// The rectangle around points with a side of this heading.
fn around(points: &[Point2<f64>], yaw: f64) -> Rectangle {
    let (mut low, mut high) = (
        Vector2::repeat(f64::INFINITY),
        Vector2::repeat(f64::NEG_INFINITY),
    );
    for point in points {
        let local = turned(point.coords, -yaw);
        (low, high) = (low.inf(&local), high.sup(&local));
    }
    Rectangle {
        centre: Point2::from(turned((low + high) / 2.0, yaw)),
        yaw,
        size_m: (high - low).into(),
    }
}

/// The heading modulo a quarter turn, in [−π/4, π/4).
pub fn quarter(heading: f64) -> f64 {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
    let turned = heading + FRAC_PI_4;
    turned - FRAC_PI_2 * (turned / FRAC_PI_2).floor() - FRAC_PI_4
}

fn turned(v: Vector2<f64>, by: f64) -> Vector2<f64> {
    let (sin, cos) = (libm::sin(by), libm::cos(by));
    Vector2::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rotated_rectangle_is_recovered() {
        for (yaw, size) in [(0.3, [0.8, 0.5]), (-0.7, [0.2, 0.6]), (0.0, [1.0, 1.0])] {
            let truth = Rectangle {
                centre: Point2::new(1.0, -2.0),
                yaw,
                size_m: size,
            };
            let [a, b, c, d] = truth.corners();
            // Corners, points on the sides, and points inside.
            let inner = [
                a + (c - a) * 0.3,
                b + (d - b) * 0.6,
                a + (b - a) * 0.5,
                truth.centre,
            ];
            let found = smallest_around(&[a, b, c, d].into_iter().chain(inner).collect::<Vec<_>>())
                .expect("points");
            assert!((found.centre - truth.centre).norm() < 1e-12);
            assert!((found.yaw - yaw).abs() < 1e-12, "{} for {yaw}", found.yaw);
            assert!(
                found
                    .size_m
                    .iter()
                    .zip(size)
                    .all(|(found, size)| (found - size).abs() < 1e-12)
            );
            assert!((found.local(&a) - Vector2::new(size[0], size[1]) / 2.0).norm() < 1e-12);
        }
    }

    #[test]
    fn few_points_have_degenerate_rectangles() {
        assert_eq!(smallest_around(&[]), None);
        let one = smallest_around(&[Point2::new(1.0, 2.0)]).expect("a point");
        assert_eq!(
            (one.centre, one.size_m),
            (Point2::new(1.0, 2.0), [0.0, 0.0])
        );
        let line = smallest_around(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]].map(Point2::from))
            .expect("points");
        assert!(
            (line.size_m[0].max(line.size_m[1]) - 8f64.sqrt()).abs() < 1e-12,
            "{line:?}"
        );
    }

    #[test]
    fn headings_are_reduced_to_a_quarter_turn() {
        for (heading, expected) in [
            (0.1, 0.1),
            (1.7, 0.129_203_673),
            (-3.0, 0.141_592_653),
            (0.8, -0.770_796_326),
        ] {
            assert!((quarter(heading) - expected).abs() < 1e-8, "{heading}");
        }
    }
}
