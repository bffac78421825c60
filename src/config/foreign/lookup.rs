//! Resolves the URIs in models to files.

use std::path::{Path, PathBuf};

use actcheck_base::Files;

/// Why a URI does not lead to a file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub(crate) enum UriFault {
    #[error("there is no `{path}` in {folders}")]
    NotFound {
        path: String,
        /// The folders that were searched, as text.
        folders: String,
    },
    #[error("`{0}://` is not supported")]
    Scheme(String),
}

/// Folders in which `model://NAME/…` and `package://NAME/…` are looked up, in order.
pub(crate) struct Lookup<'a> {
    pub(crate) files: &'a Files,
    pub(crate) folders: Vec<PathBuf>,
}

impl Lookup<'_> {
    /// Returns the path of a URI in a file. A URI without a scheme is relative to that file.
    ///
    /// # Errors
    /// [`UriFault`] if the file does not exist or the scheme is not supported.
    pub(crate) fn resolve(&self, uri: &str, file: &Path) -> Result<PathBuf, UriFault> {
        let beside = file.parent().unwrap_or(Path::new(""));
        match uri.split_once("://") {
            None => {
                // PyBullet's models write paths from the folder of the file as if they were
                // absolute.
                let inside = beside.join(uri.trim_start_matches('/'));
                let is_elsewhere =
                    uri.starts_with('/') && !self.exists(Path::new(uri)) && self.exists(&inside);
                Ok(if is_elsewhere {
                    inside
                } else {
                    self.find_end(uri).unwrap_or_else(|| beside.join(uri))
                })
            }
            Some(("file", path)) => {
                let found = self
                    .find_beside(Path::new(path))
                    .or_else(|| self.find_end(path));
                Ok(found.unwrap_or_else(|| PathBuf::from(path)))
            }
            Some(("model" | "package", path)) => self.find(path).ok_or_else(|| {
                let folders: Vec<String> = self
                    .folders
                    .iter()
                    .map(|folder| folder.display().to_string())
                    .collect();
                UriFault::NotFound {
                    path: path.to_owned(),
                    folders: folders.join(" or "),
                }
            }),
            Some((scheme, _)) => Err(UriFault::Scheme(scheme.to_owned())),
        }
    }

    fn find(&self, path: &str) -> Option<PathBuf> {
        let places = self.folders.iter().map(|folder| folder.join(path));
        places
            .into_iter()
            .find(|place| self.exists(place))
            .or_else(|| {
                self.find_in_package(path)
                    .filter(|place| self.exists(place))
            })
    }

    /// A relative path in a folder of models or beside it: Gazebo has a list of folders for such
    /// paths.
    fn find_beside(&self, path: &Path) -> Option<PathBuf> {
        if path.is_absolute() || self.exists(path) {
            return None;
        }
        let around = self
            .folders
            .iter()
            .flat_map(|folder| [Some(folder.as_path()), folder.parent()]);
        around
            .flatten()
            .map(|folder| folder.join(path))
            .find(|place| self.exists(place))
    }

    /// The file of an absolute path that does not exist here: its end, which begins with the name
    /// of a package, is looked up. A model that xacro wrote on another machine has the paths of
    /// that machine.
    fn find_end(&self, path: &str) -> Option<PathBuf> {
        if !path.starts_with('/') || self.exists(Path::new(path)) {
            return None;
        }
        let ends = path.match_indices('/').map(|(at, _)| &path[at + 1..]);
        ends.filter(|end| end.contains('/'))
            .find_map(|end| self.find(end))
    }

    fn exists(&self, place: &Path) -> bool {
        self.files
            .list(place.parent().unwrap_or(place))
            .iter()
            .any(|known| known == place)
    }

    /// The path in a folder that is the package itself, by its name or that in its `package.xml`.
    fn find_in_package(&self, path: &str) -> Option<PathBuf> {
        let (package, inside) = path.split_once('/')?;
        let is_named = |folder: &&PathBuf| folder.file_name().is_some_and(|name| name == package);
        let is_manifested =
            |folder: &&PathBuf| self.manifested(folder).is_some_and(|name| name == package);
        let own = self
            .folders
            .iter()
            .find(is_named)
            .or_else(|| self.folders.iter().find(is_manifested))?;
        Some(own.join(inside))
    }

    /// The name in the `package.xml` of a folder.
    fn manifested(&self, folder: &Path) -> Option<String> {
        let manifest = self.files.read(&folder.join("package.xml")).ok()?;
        let (_, rest) = manifest.text.split_once("<name>")?;
        let (name, _) = rest.split_once("</name>")?;
        Some(name.trim().to_owned())
    }
}
