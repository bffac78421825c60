//! Shadows of a distant light: the surfaces that are nearest to it.

use nalgebra::{Isometry3, Point3, Rotation3, Vector3};

use crate::render::buffer::{Buffer, ScreenCorner};

/// Cells of the map in each direction.
const CELLS: usize = 1024;
/// Room around the points that receive shadows. Unit: cells.
const RIM: f64 = 4.0;
/// Smallest extent of the map. Unit: metres.
const LEAST_M: f64 = 0.3;
/// Distance by which a point is moved away from its own surface. Unit: cells.
const OFFSET: f64 = 1.5;

/// A map of the surfaces nearest to the light.
pub(super) struct Shadows {
    /// Turns the world so that z points to the light.
    turned: Rotation3<f64>,
    /// Lower corner of the map. Unit: metres.
    low: [f64; 2],
    /// Size of a cell. Unit: metres.
    cell_m: f64,
    map: Buffer,
}

impl Shadows {
    /// An empty map for some points that receive shadows. Frame: world.
    pub(super) fn of(towards: &Vector3<f64>, points: impl Iterator<Item = Point3<f64>>) -> Self {
        let aside = if towards.z.abs() > 0.9 {
            Vector3::x()
        } else {
            Vector3::z()
        };
        let turned = Rotation3::look_at_rh(&-towards, &aside);
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for point in points {
            let seen = turned * point;
            for axis in 0..2 {
                low[axis] = low[axis].min(seen[axis]);
                high[axis] = high[axis].max(seen[axis]);
            }
        }
        let size = (high[0] - low[0]).max(high[1] - low[1]).max(LEAST_M);
        let cell_m = size / (CELLS as f64 - 2.0 * RIM);
        Self {
            turned,
            low: low.map(|at| {
                if at.is_finite() {
                    at - RIM * cell_m
                } else {
                    0.0
                }
            }),
            cell_m,
            map: Buffer::new(CELLS, CELLS),
        }
    }

    /// Returns the corner of a triangle in the map. Frame of the point: world.
    pub(super) fn corner(&self, point: &Point3<f64>) -> ScreenCorner {
        let seen = self.turned * point;
        [
            (seen.x - self.low[0]) / self.cell_m,
            (seen.y - self.low[1]) / self.cell_m,
            seen.z,
        ]
    }

    /// Adds a triangle that throws a shadow.
    pub(super) fn add(&mut self, corners: [ScreenCorner; 3]) {
        self.map.fill(corners, 0);
    }

    /// The share of the light that reaches a point on a surface with a normal. Frame of both: that
    /// of a body with this pose.
    pub(super) fn lit(
        &self,
        pose: &Isometry3<f64>,
        point: &Point3<f64>,
        normal: &Vector3<f64>,
    ) -> f64 {
        let away = normal * (OFFSET * self.cell_m);
        let [x, y, near] = self.corner(&(pose * (point + away)));
        let reaches = |column: f64, row: f64| {
            let inside = |at: f64| at >= 0.0 && at < CELLS as f64;
            if !inside(column) || !inside(row) {
                return 1.0;
            }
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "inside of the map"
            )]
            let cell = row as usize * CELLS + column as usize;
            let is_lit = f64::from(self.map.nearness[cell]) <= near + self.cell_m;
            f64::from(u8::from(is_lit))
        };
        // Between the centres of four cells, so that the border of a shadow is soft.
        let [left, top] = [x, y].map(|at| (at - 0.5).floor());
        let [right, down] = [x - 0.5 - left, y - 0.5 - top];
        let line = |row: f64| reaches(left, row) * (1.0 - right) + reaches(left + 1.0, row) * right;
        line(top) * (1.0 - down) + line(top + 1.0) * down
    }
}
