//! A call of an action with its parameters.

use std::collections::BTreeMap;

/// One action with the values of its designators.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ActionCall {
    /// Name of the action, as the test lists it.
    pub action: String,
    /// Values by designator: ids of objects of the scene, or names of places.
    pub parameters: BTreeMap<String, Vec<String>>,
}

impl ActionCall {
    /// The first value of a designator. Returns `None` if the call has no such designator or it has
    /// no value.
    pub fn value(&self, designator: &str) -> Option<&str> {
        self.parameters.get(designator)?.first().map(String::as_str)
    }
}
