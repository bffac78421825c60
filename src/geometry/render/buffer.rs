//! A buffer of the nearest triangle at each sample.

/// Number of no triangle.
pub(super) const EMPTY: u32 = u32::MAX;

/// The nearest triangle at each sample, row by row from the upper left.
pub(super) struct Buffer {
    pub(super) width: usize,
    pub(super) height: usize,
    /// How near it is: a value that is linear across a flat triangle in the image, and larger for
    /// nearer points.
    pub(super) nearness: Vec<f32>,
    /// Number of the triangle, or [`EMPTY`].
    pub(super) facets: Vec<u32>,
}

/// A corner of a triangle in the image: samples to the right and down, and its nearness.
pub(super) type ScreenCorner = [f64; 3];

impl Buffer {
    pub(super) fn new(width: usize, height: usize) -> Self {
        Self {
            width,
            height,
            nearness: vec![f32::NEG_INFINITY; width * height],
            facets: vec![EMPTY; width * height],
        }
    }

    /// Fills the samples at which a triangle is the nearest.
    pub(super) fn fill(&mut self, [a, b, c]: [ScreenCorner; 3], facet: u32) {
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if !area.is_finite() || area.abs() < 1e-12 {
            return;
        }
        // Nearness as a plane over the image.
        let slope = |of: [f64; 3], axis: usize| {
            let [p, q] = [b, c].map(|corner| corner[axis] - a[axis]);
            let [first, second] = [of[1] - of[0], of[2] - of[0]];
            [first, second, p, q]
        };
        let near = [a[2], b[2], c[2]];
        let [first, second, dx1, dx2] = slope(near, 0);
        let [_, _, dy1, dy2] = slope(near, 1);
        let across = (first * dy2 - second * dy1) / area;
        let down = (second * dx1 - first * dx2) / area;
        let edges = [[a, b], [b, c], [c, a]];
        let [top, bottom] = extent([a[1], b[1], c[1]], self.height);
        for row in top..bottom {
            let y = row as f64 + 0.5;
            let Some([left, right]) = span(&edges, y, self.width) else {
                continue;
            };
            let start = a[2] + down * (y - a[1]) + across * (0.5 - a[0]);
            let line = row * self.width;
            let samples = self.nearness[line + left..line + right]
                .iter_mut()
                .zip(&mut self.facets[line + left..line + right]);
            for (column, (nearest, number)) in (left..right).zip(samples) {
                #[expect(
                    clippy::cast_possible_truncation,
                    reason = "a rounded distance is enough to order surfaces"
                )]
                let nearness = (start + across * column as f64) as f32;
                if nearness > *nearest {
                    *nearest = nearness;
                    *number = facet;
                }
            }
        }
    }
}

/// The samples whose centres are between the least and the largest of some coordinates: the first,
/// and the one after the last.
fn extent(along: [f64; 3], most: usize) -> [usize; 2] {
    let low = along.into_iter().fold(f64::INFINITY, f64::min);
    let high = along.into_iter().fold(f64::NEG_INFINITY, f64::max);
    [low, high].map(|at| first_after(at, most))
}

/// The first sample whose centre is at a coordinate or after it.
fn first_after(at: f64, most: usize) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the samples"
    )]
    let idx = (at - 0.5).ceil().clamp(0.0, most as f64) as usize;
    idx
}

/// The samples of a row that are between the edges of a triangle; `None` if there are none.
fn span(edges: &[[ScreenCorner; 2]; 3], y: f64, width: usize) -> Option<[usize; 2]> {
    let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
    for [from, to] in edges {
        // Each edge contains its upper end only, so that a row meets two edges or none.
        if (from[1] <= y) == (to[1] <= y) {
            continue;
        }
        // Always from the same end, so that triangles that share an edge have no gap.
        let [from, to] = if from[1] < to[1] {
            [from, to]
        } else {
            [to, from]
        };
        let x = from[0] + (to[0] - from[0]) * ((y - from[1]) / (to[1] - from[1]));
        left = left.min(x);
        right = right.max(x);
    }
    let [first, last] = [left, right].map(|at| first_after(at, width));
    (first < last).then_some([first, last])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Samples of a square of two triangles are filled once each.
    #[test]
    fn triangles_that_share_an_edge_have_no_gap_and_no_overlap() {
        let square = |near: f64| {
            [[2.3, 3.1], [40.2, 7.7], [35.9, 44.4], [5.0, 41.3]].map(|[x, y]| [x, y, near])
        };
        let [a, b, c, d] = square(1.0);
        let count = |triangles: &[[ScreenCorner; 3]]| {
            let mut buffer = Buffer::new(48, 48);
            for (number, corners) in (0_u32..).zip(triangles) {
                buffer.fill(*corners, number);
            }
            buffer
                .facets
                .iter()
                .filter(|number| **number != EMPTY)
                .count()
        };
        let both = count(&[[a, b, c], [c, d, a]]);
        assert_eq!(both, count(&[[a, b, c]]) + count(&[[a, c, d]]));
        // The area of the square.
        assert!((1200..1450).contains(&both), "{both}");
        assert_eq!(both, count(&[[a, b, d], [b, c, d]]));
    }

    #[test]
    fn the_nearer_triangle_hides_the_other() {
        let triangle = |near: f64| [[0.0, 0.0, near], [20.0, 0.0, near], [0.0, 20.0, near]];
        for order in [[1.0, 2.0], [2.0, 1.0]] {
            let mut buffer = Buffer::new(16, 16);
            for (number, near) in (0_u32..).zip(order) {
                buffer.fill(triangle(near), number);
            }
            let nearest = u32::from(order[1] > order[0]);
            assert_eq!(buffer.facets[17], nearest);
            assert_eq!(buffer.nearness[17], 2.0);
        }
    }

    #[test]
    fn triangles_outside_of_the_image_and_of_numbers_are_ignored() {
        let mut buffer = Buffer::new(8, 8);
        buffer.fill([[-9.0, -9.0, 1.0], [-2.0, -9.0, 1.0], [-2.0, -1.0, 1.0]], 0);
        buffer.fill([[1e9, 0.0, 1.0], [2e9, 0.0, 1.0], [1e9, 9.0, 1.0]], 0);
        buffer.fill([[f64::NAN, 0.0, 1.0], [9.0, 0.0, 1.0], [9.0, 9.0, 1.0]], 0);
        assert!(buffer.facets.iter().all(|number| *number == EMPTY));
    }
}
