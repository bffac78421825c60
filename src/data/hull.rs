//! The convex hull of points in a plane.

/// Returns the corners of the convex hull, counter-clockwise if y is to the left of x. Points that
/// are not finite are ignored; points on a side are not corners.
///
/// Source: Andrew's monotone chain algorithm (1979).
pub fn convex_hull(points: impl IntoIterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
    let finite = points
        .into_iter()
        .filter(|point| point.iter().all(|value| value.is_finite()));
    let mut points: Vec<[f64; 2]> = finite.collect();
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    // Each chain ends where the other begins.
    let mut hull = chain(points.iter().copied());
    hull.pop();
    hull.extend(chain(points.iter().rev().copied()));
    hull.pop();
    hull
}

/// One chain: the points from one end to the other that all turn left.
fn chain(points: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
    let mut chain: Vec<[f64; 2]> = Vec::new();
    for point in points {
        while let [.., a, b] = chain[..]
            && turn(a, b, point) <= 0.0
        {
            chain.pop();
        }
        chain.push(point);
    }
    chain
}

/// Positive if the path through three points turns left.
fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hull_has_neither_inner_points_nor_points_on_its_sides() {
        let square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        let inside = [[1.0, 1.0], [1.0, 0.0], [0.5, 1.5], [2.0, 2.0]];
        assert_eq!(convex_hull(square.into_iter().chain(inside)), square);
    }

    #[test]
    fn few_points_are_their_own_hull() {
        assert_eq!(convex_hull([]), Vec::<[f64; 2]>::new());
        assert_eq!(
            convex_hull([[f64::NAN, 0.0], [1.0, 1.0], [1.0, 1.0]]),
            [[1.0, 1.0]]
        );
        assert_eq!(
            convex_hull([[2.0, 2.0], [0.0, 0.0], [1.0, 1.0]]),
            [[0.0, 0.0], [2.0, 2.0]]
        );
    }
}
