//! Checks of the elements that are not read, and of values that the simulation fixes: those without
//! effect on the model, and those that would change it.

use crate::foreign::xml::{self, Bound, Node, Reader};
use actcheck_base::did_you_mean;

/// Acceleration by gravity in the simulation. Unit: m/s².
const GRAVITY: [f64; 3] = [0.0, 0.0, -9.81];

/// The children that an element may have.
pub(crate) struct Children {
    pub(crate) read: &'static [&'static str],
    /// The simulated model is the same without them.
    pub(crate) harmless: &'static [&'static str],
    /// Without them it would be another model.
    pub(crate) refused: &'static [&'static str],
}

impl Children {
    /// Reports the children that are not read: those that change the model (W035), and those
    /// without effect (W036).
    pub(crate) fn check(&self, node: Node, reader: &mut Reader) {
        let inside = node.tag_name().name();
        for other in node.children().filter(Node::is_element) {
            let name = other.tag_name().name();
            // Elements with a namespace are extensions of other programs.
            if self.read.contains(&name) || other.tag_name().namespace().is_some() {
                continue;
            }
            if self.refused.contains(&name) {
                let message = format!("`<{name}>` in `<{inside}>` can't be simulated");
                let help = "the model would be another one without it: remove it if that is meant";
                reader.error("W035", other, message, help);
                continue;
            }
            let message = format!("`<{name}>` in `<{inside}>` is ignored");
            let help = if self.harmless.contains(&name) {
                "the model works without it".to_owned()
            } else {
                let known = self.read.iter().chain(self.refused).copied();
                format!(
                    "this name is unknown; {}",
                    did_you_mean(name, known.collect::<Vec<_>>())
                )
            };
            reader.warning("W036", other, message, help);
        }
    }
}

/// Reports a number that would change the model (W035) if it is not the usual one.
pub(crate) fn refuse_unless(parent: Node, name: &str, usual: f64, why: &str, reader: &mut Reader) {
    if let Some(node) = xml::child(parent, name)
        && let Some(value) = reader.number(node, Bound::Finite)
        && value != usual
    {
        let message = format!("`<{name}>` of {value} can't be simulated: {why}");
        let help = format!("remove it, or write {usual}");
        reader.error("W035", node, message, help);
    }
}

/// Warns of a number that is not read (W036), if it is not the usual one.
pub(crate) fn warn_unless(parent: Node, name: &str, usual: f64, why: &str, reader: &mut Reader) {
    if let Some(node) = xml::child(parent, name)
        && let Some(value) = reader.number(node, Bound::Finite)
        && value != usual
    {
        let message = format!("`<{name}>` of {value} is ignored: {why}");
        reader.warning(
            "W036",
            node,
            message,
            format!("write {usual} if that is meant"),
        );
    }
}

/// Reports a switch that would change the model (W035) if it is not the usual one.
pub(crate) fn refuse_switch(parent: Node, name: &str, usual: bool, why: &str, reader: &mut Reader) {
    if let Some(node) = xml::child(parent, name)
        && reader.boolean(node).is_some_and(|value| value != usual)
    {
        let help = format!("remove it, or write {usual}");
        reader.error("W035", node, why.to_owned(), help);
    }
}

/// Whether a file has the gravity of the simulation, up to a tolerance. Unit: m/s².
pub(crate) fn is_usual_gravity(found: [f64; 3], tolerance: f64) -> bool {
    let is_near = |(found, usual): (f64, f64)| (found - usual).abs() <= tolerance;
    found.into_iter().zip(GRAVITY).all(is_near)
}
