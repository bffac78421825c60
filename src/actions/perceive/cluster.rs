//! Groups points by proximity.

use std::collections::BTreeMap;

use nalgebra::Point3;

use crate::perceive::cloud::cube_of;

/// Groups in which each point has another at most `reach` away; by index, in the order of their
/// first points.
pub fn clusters(points: &[Point3<f64>], reach: f64) -> Vec<Vec<usize>> {
    let mut grid: BTreeMap<[i64; 3], Vec<usize>> = BTreeMap::new();
    for (idx, point) in points.iter().enumerate() {
        grid.entry(cube_of(point, reach)).or_default().push(idx);
    }
    let mut taken = vec![false; points.len()];
    let mut found = Vec::new();
    for first in 0..points.len() {
        if std::mem::replace(&mut taken[first], true) {
            continue;
        }
        let mut cluster = vec![first];
        let mut next = 0;
        while let Some(from) = cluster.get(next).copied() {
            next += 1;
            for idx in around(&grid, cube_of(&points[from], reach)) {
                if !taken[idx] && (points[idx] - points[from]).norm_squared() <= reach * reach {
                    taken[idx] = true;
                    cluster.push(idx);
                }
            }
        }
        cluster.sort_unstable();
        found.push(cluster);
    }
    found
}

/// Points of a cube and of its neighbours.
fn around(
    grid: &BTreeMap<[i64; 3], Vec<usize>>,
    [x, y, z]: [i64; 3],
) -> impl Iterator<Item = usize> {
    let columns = (-1..=1).flat_map(move |dx| (-1..=1).map(move |dy| (x + dx, y + dy)));
    columns.flat_map(move |(x, y)| {
        grid.range([x, y, z - 1]..=[x, y, z + 1])
            .flat_map(|(_, idxs)| idxs.iter().copied())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points on a line at a fixed spacing.
    fn line(from: f64, to: f64, step: f64, height: f64) -> Vec<Point3<f64>> {
        let count = ((to - from) / step).round() as usize;
        (0..=count)
            .map(|idx| Point3::new(from + step * idx as f64, 0.0, height))
            .collect()
    }

    #[test]
    fn a_gap_wider_than_the_limit_separates_two_clusters() {
        let near = [line(0.0, 0.1, 0.005, 0.0), line(0.119, 0.2, 0.005, 0.0)].concat();
        assert_eq!(clusters(&near, 0.02).len(), 1);
        let apart = [line(0.0, 0.1, 0.005, 0.0), line(0.121, 0.2, 0.005, 0.0)].concat();
        let found = clusters(&apart, 0.02);
        assert_eq!(found.iter().map(Vec::len).collect::<Vec<_>>(), [21, 17]);
        assert_eq!(
            clusters(
                &[line(0.0, 0.1, 0.005, 0.0), line(0.0, 0.1, 0.005, 0.03)].concat(),
                0.02
            )
            .len(),
            2
        );
    }

    #[test]
    fn every_point_is_in_exactly_one_cluster() {
        let stream = actcheck_data::Stream::new(2);
        let points: Vec<Point3<f64>> = (0..600)
            .map(|i| {
                Point3::new(
                    stream.unit(3 * i),
                    stream.unit(3 * i + 1),
                    stream.unit(3 * i + 2),
                )
            })
            .collect();
        let found = clusters(&points, 0.07);
        let mut all: Vec<usize> = found.iter().flatten().copied().collect();
        all.sort_unstable();
        assert_eq!(all, (0..600).collect::<Vec<_>>());
        let of = |idx: usize| found.iter().position(|cluster| cluster.contains(&idx));
        for a in 0..600 {
            for b in 0..a {
                assert!((points[a] - points[b]).norm() > 0.07 || of(a) == of(b));
            }
        }
    }
}
