//! The frames of models, as elements of other files name them.

use std::collections::BTreeMap;

use nalgebra::Isometry3;

/// The name of a model's own frame.
pub(crate) const OWN: &str = "__model__";

/// A frame that other elements can name.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Frame {
    /// Frame: that of the model.
    pub(crate) pose: Isometry3<f64>,
    /// The link that carries it; `None` in a model without links.
    pub(crate) link: Option<String>,
}

/// The pose and the frames of an included model, as its own file states them.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Included {
    pub(crate) name: String,
    /// The `<pose>` of the model: that of its placement frame.
    pub(crate) stated: Isometry3<f64>,
    /// Its placement frame. Frame: that of the model.
    pub(crate) placement: Isometry3<f64>,
    /// Whether its frames are those of the model that includes it.
    pub(crate) merged: bool,
    /// All frames by name, with that of the model itself.
    pub(crate) frames: BTreeMap<String, Frame>,
}
