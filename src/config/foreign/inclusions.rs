//! The models that one document includes, directly or through others, and their bounds.

use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use crate::foreign::xml::{LONGEST_MODEL, MOST_PARTS, Node, Reader};
use actcheck_base::Source;

/// Deepest inclusion of models.
const DEEPEST: usize = 8;
/// Most models that a document may include, with those in them: a few files that include each other
/// twice would otherwise be read thousands of times.
const MOST: usize = 1_000;

/// The files around the one that is being read, and the size of all files that their document includes.
#[derive(Clone, Default)]
pub(crate) struct Inclusions {
    /// The included files, from the outermost one to this one.
    files: Vec<PathBuf>,
    n_read: Rc<Cell<usize>>,
    n_bytes: Rc<Cell<usize>>,
    /// Whether the document is a world, of which only the inclusions in its models count: a world
    /// may have many models.
    is_world: bool,
}

impl Inclusions {
    /// Those of a world.
    pub(crate) fn of_world() -> Self {
        Self {
            is_world: true,
            ..Self::default()
        }
    }

    /// Whether the file is one that another file includes.
    pub(crate) fn is_inside(&self) -> bool {
        !self.files.is_empty()
    }

    /// Returns `Some` if another file may be included. Otherwise reports W055.
    pub(crate) fn check_room(&self, uri: Node, reader: &mut Reader) -> Option<()> {
        if self.n_read.get() < MOST && self.n_bytes.get() <= LONGEST_MODEL {
            return Some(());
        }
        let message = format!(
            "this includes more than {MOST} models or {} MiB, with those in them",
            LONGEST_MODEL >> 20
        );
        let help = "include fewer models: each file counts as often as it is included";
        reader.error("W055", uri, message, help);
        None
    }

    /// Enters a file that an element of another file includes. Reports a file that includes itself
    /// or is too deep (W035), and returns `None`.
    pub(crate) fn enter(
        &self,
        outer: &Path,
        path: &Path,
        text: &Source,
        uri: Node,
        reader: &mut Reader,
    ) -> Option<Self> {
        if path == outer || self.files.iter().any(|file| file == path) {
            let message = "this model includes itself".to_owned();
            reader.error("W035", uri, message, "remove the `<include>`");
            return None;
        }
        if self.files.len() >= DEEPEST {
            let message = format!("models are included more than {DEEPEST} levels deep");
            let help = "include the innermost models directly";
            reader.error("W035", uri, message, help);
            return None;
        }
        if self.is_inside() || !self.is_world {
            self.n_read.set(self.n_read.get() + 1);
            self.n_bytes.set(self.n_bytes.get() + text.text.len());
        }
        let mut inner = self.clone();
        inner.files.push(path.to_path_buf());
        Some(inner)
    }
}

/// Reports a model that has too many links together with those that it includes (W055): each link
/// is compared with all others. `at`: the `<include>`. Returns `None` then.
pub(crate) fn check_size(n_links: usize, at: Node, reader: &mut Reader) -> Option<()> {
    if n_links <= MOST_PARTS {
        return Some(());
    }
    let message = format!("with its included models, this model has more than {MOST_PARTS} links");
    reader.error("W055", at, message, "include fewer or simpler models");
    None
}
