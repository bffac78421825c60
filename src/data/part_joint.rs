//! The joints of objects: of drawers, doors and lids.

/// The joint of a part of an object. It has no motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PartJoint {
    /// Whether the part slides along the axis; otherwise it turns about it.
    pub slides: bool,
    /// Direction of the axis: a unit vector.
    pub axis: [f64; 3],
    /// A point on the axis. Unit: metres.
    pub anchor_m: [f64; 3],
    /// Smallest and largest position; infinite without a stop. Units: metres or radians.
    pub range: [f64; 2],
    /// Viscous friction. Units: N·s/m or N·m·s.
    pub damping: f64,
    /// Friction that does not depend on the speed. Units: newtons or newton metres.
    pub friction: f64,
}

impl PartJoint {
    /// Returns the joint of a part that is scaled uniformly.
    #[must_use]
    pub fn scaled(self, by: f64) -> Self {
        let range = if self.slides {
            self.range.map(|end| end * by)
        } else {
            self.range
        };
        Self {
            anchor_m: self.anchor_m.map(|x| x * by),
            range,
            ..self
        }
    }
}
