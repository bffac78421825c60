//! How far one model in MJCF may grow by copies, included files and attached models: a short text
//! can ask for billions of bodies.

use std::cell::Cell;

use crate::foreign::xml::{self, Node, Reader};

/// Most bodies of a model, with those of all copies and attached models: each is simulated, or
/// compared with all others.
const MOST_BODIES: usize = 1_000;
/// Most elements in its bodies, counted in the same way.
const MOST_ELEMENTS: usize = 10_000;
/// Most frames and copies inside each other, and most bodies: they are read by functions that call
/// themselves.
const DEEPEST_FRAME: usize = 100;
const DEEPEST_BODY: usize = 200;
/// Most included and attached files, each as often as it is read.
const MOST_FILES: usize = 1_000;

/// The size of a model and of all models attached to it, as far as they have been read.
#[derive(Debug, Default)]
pub(super) struct Budget {
    bodies: Cell<usize>,
    /// Bodies that have been entered and not left.
    depth: Cell<usize>,
    elements: Cell<usize>,
    files: Cell<usize>,
    /// Length of the texts of all files.
    bytes: Cell<usize>,
    /// Whether a limit was exceeded, and the model is refused.
    is_spent: Cell<bool>,
}

impl Budget {
    /// Counts a body, which is to be left by [`Budget::leave`]. Returns false if there are too many;
    /// the first time, it reports W055.
    pub(super) fn enter(&self, node: Node, reader: &mut Reader) -> bool {
        if self.depth.get() >= DEEPEST_BODY {
            return self.refuse(
                &format!("{DEEPEST_BODY} bodies in each other"),
                node,
                reader,
            );
        }
        let what = format!("{MOST_BODIES} bodies");
        let is_entered = self.counts(&self.bodies, MOST_BODIES, &what, node, reader);
        self.depth.set(self.depth.get() + usize::from(is_entered));
        is_entered
    }

    pub(super) fn leave(&self) {
        self.depth.set(self.depth.get().saturating_sub(1));
    }

    /// Counts an element in a body, or a copy, in so many frames. Returns false if there are too
    /// many; the first time, it reports W055.
    pub(super) fn element(&self, depth: usize, node: Node, reader: &mut Reader) -> bool {
        if depth > DEEPEST_FRAME {
            let what = format!("{DEEPEST_FRAME} frames in each other");
            return self.refuse(&what, node, reader);
        }
        let what = format!("{MOST_ELEMENTS} elements");
        self.counts(&self.elements, MOST_ELEMENTS, &what, node, reader)
    }

    /// Counts a file and the length of its text.
    ///
    /// # Errors
    /// A message with the exceeded limit.
    pub(super) fn file(&self, n_bytes: usize) -> Result<(), String> {
        self.files.set(self.files.get() + 1);
        self.bytes.set(self.bytes.get() + n_bytes);
        // The first file is the model itself.
        let what = if self.files.get() > MOST_FILES + 1 {
            format!("this model includes and attaches more than {MOST_FILES} files")
        } else if self.bytes.get() > xml::LONGEST_MODEL {
            let most = xml::LONGEST_MODEL >> 20;
            format!(
                "with all files that it includes and attaches, this model is longer than {most} MiB"
            )
        } else {
            return Ok(());
        };
        self.is_spent.set(true);
        Err(what)
    }

    fn counts(
        &self,
        count: &Cell<usize>,
        most: usize,
        what: &str,
        node: Node,
        reader: &mut Reader,
    ) -> bool {
        count.set(count.get() + 1);
        if count.get() > most {
            return self.refuse(what, node, reader);
        }
        !self.is_spent.get()
    }

    fn refuse(&self, what: &str, node: Node, reader: &mut Reader) -> bool {
        if !self.is_spent.replace(true) {
            let message = format!("with all its copies, this model has more than {what}");
            let help = "use fewer and simpler parts, and fewer copies";
            reader.error("W055", node, message, help);
        }
        false
    }
}
