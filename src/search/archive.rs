//! What is known so far: the points and what each property said of them.

use super::space::Space;

/// What one property said of one point.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Told {
    /// Whether it failed.
    pub failed: bool,
    /// How far it was from failing (or, negative, from passing), where it says; any unit.
    pub margin: Option<f64>,
}

/// A point that was tried.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Tried {
    pub point: Vec<f64>,
    pub told: Vec<Told>,
    /// For the property that a guided point was made for.
    pub focus: Option<usize>,
}

impl Tried {
    /// The margin of a property, made to agree with whether it failed; nothing where it is not known.
    pub fn margin(&self, property: usize) -> Option<f64> {
        let told = self.told.get(property)?;
        match told.margin.filter(|margin| margin.is_finite()) {
            Some(margin) if told.failed => Some(margin.min(0.0)),
            Some(margin) => Some(margin.max(0.0)),
            None => None,
        }
    }

    pub fn failed(&self, property: usize) -> bool {
        self.told.get(property).is_some_and(|told| told.failed)
    }
}

/// A ball that has been looked into enough.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Closed {
    pub property: usize,
    pub centre: Vec<f64>,
    pub radius: f64,
}

/// All that was tried, in order, and where not to look again.
#[derive(Debug, Clone, Default)]
pub(crate) struct Archive {
    pub tried: Vec<Tried>,
    pub closed: Vec<Closed>,
}

impl Archive {
    /// Properties that were ever told of.
    pub fn properties(&self) -> usize {
        self.tried.iter().map(|tried| tried.told.len()).max().unwrap_or(0)
    }

    /// Whether the margins of a property differ at all, so that there is something to learn from.
    pub fn says_something(&self, property: usize) -> bool {
        let mut margins = self.tried.iter().filter_map(|tried| tried.margin(property));
        margins.next().is_some_and(|first| margins.any(|margin| margin != first))
    }

    /// The points of a property with their margins, lowest first, but those in closed balls.
    pub fn open(&self, space: &Space, property: usize) -> Vec<(&[f64], f64)> {
        let closed: Vec<&Closed> = self.closed.iter().filter(|closed| closed.property == property).collect();
        let mut found: Vec<(&[f64], f64)> = self
            .tried
            .iter()
            .filter_map(|tried| Some((tried.point.as_slice(), tried.margin(property)?)))
            .filter(|(point, _)| closed.iter().all(|ball| space.distance(&ball.centre, point) > ball.radius))
            .collect();
        found.sort_by(|a, b| a.1.total_cmp(&b.1));
        found
    }
}
