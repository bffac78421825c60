//! The archive of a search: evaluated points with the results of each property.

use super::space::Space;

/// The result of one property at one point.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct PropertyResult {
    /// Whether the property failed.
    pub failed: bool,
    /// Distance from failing (or, if negative, from passing), in any unit. `None` if unknown.
    pub margin: Option<f64>,
}

/// An evaluated point.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Tried {
    pub point: Vec<f64>,
    pub results: Vec<PropertyResult>,
    /// The property for which a guided strategy chose the point.
    pub focus: Option<usize>,
}

impl Tried {
    /// Returns the margin of a property, clamped to agree with its outcome, or `None` if the margin
    /// is unknown or not finite.
    pub fn margin(&self, property: usize) -> Option<f64> {
        let result = self.results.get(property)?;
        match result.margin.filter(|margin| margin.is_finite()) {
            Some(margin) if result.failed => Some(margin.min(0.0)),
            Some(margin) => Some(margin.max(0.0)),
            None => None,
        }
    }

    pub fn failed(&self, property: usize) -> bool {
        self.results
            .get(property)
            .is_some_and(|result| result.failed)
    }
}

/// A ball that has been searched enough.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ClosedRegion {
    pub property: usize,
    pub centre: Vec<f64>,
    pub radius: f64,
}

/// All evaluated points, in order, and the regions not to search again.
#[derive(Debug, Clone, Default)]
pub(crate) struct Archive {
    pub tried: Vec<Tried>,
    pub closed: Vec<ClosedRegion>,
}

impl Archive {
    /// Number of properties with results.
    pub fn properties(&self) -> usize {
        self.tried
            .iter()
            .map(|tried| tried.results.len())
            .max()
            .unwrap_or(0)
    }

    /// Whether the margins of a property differ, so that a strategy can learn from them.
    pub fn has_informative_margins(&self, property: usize) -> bool {
        let mut margins = self.tried.iter().filter_map(|tried| tried.margin(property));
        margins
            .next()
            .is_some_and(|first| margins.any(|margin| margin != first))
    }

    /// Returns the points of a property with their margins, lowest first, without those in closed
    /// balls.
    pub fn open(&self, space: &Space, property: usize) -> Vec<(&[f64], f64)> {
        let closed: Vec<&ClosedRegion> = self
            .closed
            .iter()
            .filter(|closed| closed.property == property)
            .collect();
        let mut found: Vec<(&[f64], f64)> = self
            .tried
            .iter()
            .filter_map(|tried| Some((tried.point.as_slice(), tried.margin(property)?)))
            .filter(|(point, _)| {
                closed
                    .iter()
                    .all(|ball| space.distance(&ball.centre, point) > ball.radius)
            })
            .collect();
        found.sort_by(|a, b| a.1.total_cmp(&b.1));
        found
    }
}
