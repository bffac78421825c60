//! Bounding balls.

use nalgebra::Point3;

use actcheck_data::Part;

/// A ball around the solids of a body, in the body's frame.
#[derive(Debug, Clone, Copy)]
pub struct Ball {
    /// Its middle.
    pub middle: Point3<f64>,
    /// Unit: metres.
    pub radius: f64,
}

impl Ball {
    /// Returns a ball around solids: that around their bounding box. Returns `None` if there are
    /// none.
    pub fn around(solids: &[Part]) -> Option<Self> {
        let mut low = [f64::INFINITY; 3];
        let mut high = [f64::NEG_INFINITY; 3];
        for solid in solids {
            let (lower, upper) = solid.bounds();
            for axis in 0..3 {
                low[axis] = low[axis].min(lower[axis]);
                high[axis] = high[axis].max(upper[axis]);
            }
        }
        let (low, high) = (Point3::from(low), Point3::from(high));
        let ball = Self {
            middle: nalgebra::center(&low, &high),
            radius: (high - low).norm() / 2.0,
        };
        (!solids.is_empty()).then_some(ball)
    }
}
