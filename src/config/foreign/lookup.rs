//! Resolves the URIs in models to files.

use std::path::{Path, PathBuf};

use actcheck_base::Files;

/// Folders in which `model://NAME/…` and `package://NAME/…` are looked up, in order.
pub(crate) struct Lookup<'a> {
    pub(crate) files: &'a Files,
    pub(crate) folders: Vec<PathBuf>,
}

impl Lookup<'_> {
    /// Returns the path of a URI in a file. A URI without a scheme is relative to that file.
    ///
    /// # Errors
    /// A lower-case message if the file does not exist or the scheme is not supported.
    pub(crate) fn resolve(&self, uri: &str, file: &Path) -> Result<PathBuf, String> {
        let beside = file.parent().unwrap_or(Path::new(""));
        match uri.split_once("://") {
            None => Ok(beside.join(uri)),
            Some(("file", path)) => Ok(PathBuf::from(path)),
            Some(("model" | "package", path)) => self.find(path).ok_or_else(|| {
                let folders: Vec<String> = self.folders.iter().map(|folder| folder.display().to_string()).collect();
                format!("there is no `{path}` in {}", folders.join(" or "))
            }),
            Some((scheme, _)) => Err(format!("`{scheme}://` is not supported")),
        }
    }

    fn find(&self, path: &str) -> Option<PathBuf> {
        let places = self.folders.iter().map(|folder| folder.join(path));
        places.into_iter().find(|place| self.files.list(place.parent().unwrap_or(place)).contains(place))
    }
}
