//! Resolves the URIs in models to files.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use actcheck_base::{Diagnostics, Files};

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
    /// The faults of visual shapes if these are to be read, too.
    pub(crate) looks: Option<RefCell<Diagnostics>>,
}

impl<'a> Lookup<'a> {
    /// Looks up files of models that are simulated: visual shapes are not read.
    pub(crate) fn new(files: &'a Files, folders: Vec<PathBuf>) -> Self {
        Self {
            files,
            folders,
            looks: None,
        }
    }

    /// Returns the path of a URI in a file. A URI without a scheme is relative to that file or, if
    /// nothing is there, to one of the folders. If the path as written does not exist, its other
    /// [`spellings`] are tried.
    ///
    /// # Errors
    /// [`UriFault`] if the file does not exist or the scheme is not supported.
    pub(crate) fn resolve(&self, uri: &str, file: &Path) -> Result<PathBuf, UriFault> {
        let written = self.resolve_spelling(uri, file);
        if written.as_ref().is_ok_and(|path| self.exists(path)) {
            return written;
        }
        spellings(uri)
            .iter()
            .skip(1)
            .filter_map(|spelling| self.resolve_spelling(spelling, file).ok())
            .find(|path| self.exists(path))
            .map_or(written, Ok)
    }

    fn resolve_spelling(&self, uri: &str, file: &Path) -> Result<PathBuf, UriFault> {
        let (scheme, path) = split(uri);
        match scheme.to_ascii_lowercase().as_str() {
            "" => Ok(self.of_path(path, file)),
            "file" => Ok(self
                .find_beside(Path::new(path))
                .or_else(|| self.find_end(path))
                .unwrap_or_else(|| PathBuf::from(path))),
            "model" | "package" => self.find(path).ok_or_else(|| {
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
            _ => Err(UriFault::Scheme(scheme.to_owned())),
        }
    }

    /// The path of a URI without a scheme.
    fn of_path(&self, path: &str, file: &Path) -> PathBuf {
        let beside = file.parent().unwrap_or(Path::new(""));
        // PyBullet's models write paths from the folder of the file as if they were absolute.
        let inside = beside.join(path.trim_start_matches('/'));
        if path.starts_with('/') && !self.exists(Path::new(path)) && self.exists(&inside) {
            return inside;
        }
        let place = beside.join(path);
        if path.starts_with('/') {
            return self.find_end(path).unwrap_or(place);
        }
        match self.exists(&place) {
            true => place,
            false => self.find(path).unwrap_or(place),
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
        exists(self.files, place)
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

/// Returns the scheme of a URI and the path after it. A path has the scheme "", and so has one that
/// begins with the letter of a drive, which is removed: the drive is that of another machine.
fn split(uri: &str) -> (&str, &str) {
    let Some((scheme, rest)) = uri.split_once(':') else {
        return ("", uri);
    };
    let is_file = scheme.eq_ignore_ascii_case("file");
    let is_drive = scheme.len() == 1 && rest.starts_with('/');
    match rest.strip_prefix("//") {
        _ if is_drive => ("", rest),
        Some(path) if is_file && path.starts_with("localhost/") => {
            (scheme, &path["localhost".len()..])
        }
        Some(path) => (scheme, path),
        None if is_file => (scheme, rest),
        None => ("", uri),
    }
}

/// Returns the spellings of a path or URI in which it may name a file, as written first: with the
/// backslashes of Windows as slashes, with percent-encoded characters decoded, and with both.
pub(crate) fn spellings(written: &str) -> Vec<String> {
    let slashed = written.replace('\\', "/");
    let mut spellings = vec![written.to_owned()];
    for other in [
        slashed.clone(),
        percent_decoded(written),
        percent_decoded(&slashed),
    ] {
        if !spellings.contains(&other) {
            spellings.push(other);
        }
    }
    spellings
}

/// Returns the path of a file that another file in this folder names: of its [`spellings`] the
/// first that exists, or else as written.
pub(crate) fn beside(files: &Files, folder: &Path, written: &str) -> PathBuf {
    let spelled = spellings(written)
        .into_iter()
        .map(|path| folder.join(path))
        .find(|place| exists(files, place));
    spelled.unwrap_or_else(|| folder.join(written))
}

fn exists(files: &Files, place: &Path) -> bool {
    files
        .list(place.parent().unwrap_or(place))
        .iter()
        .any(|known| known == place)
}

/// Decodes percent-encoded characters in each part of a path. A part stays as it is if it would
/// become another path: `%2F` and `%5C` do not separate folders, and `%2E%2E` is a name.
fn percent_decoded(path: &str) -> String {
    let parts = path.split('/').map(|part| {
        let decoded = decoded_part(part)
            .filter(|decoded| !decoded.contains(['/', '\\', '\0']))
            .filter(|decoded| !matches!(decoded.as_str(), "" | "." | ".."));
        decoded.unwrap_or_else(|| part.to_owned())
    });
    parts.collect::<Vec<_>>().join("/")
}

/// Decodes `%20` and the like; a `%` that begins no two hexadecimal digits stays. Returns `None` if
/// the result is not UTF-8.
fn decoded_part(part: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(part.len());
    let mut rest = part.as_bytes();
    while let Some((first, behind)) = rest.split_first() {
        let digit = |at: usize| char::from(*behind.get(at)?).to_digit(16);
        let code = (*first == b'%').then(|| Some(16 * digit(0)? + digit(1)?));
        match code.flatten().and_then(|code| u8::try_from(code).ok()) {
            Some(code) => {
                bytes.push(code);
                rest = &behind[2..];
            }
            None => {
                bytes.push(*first);
                rest = behind;
            }
        }
    }
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percent_encoded_characters_are_decoded_but_separate_no_folders() {
        for (path, decoded) in [
            ("my%20meshes/f%201.stl", "my meshes/f 1.stl"),
            ("package://a%20b/%C3%A9.stl", "package://a b/é.stl"),
            ("100%.stl", "100%.stl"),
            ("50%25 %zz.stl", "50% %zz.stl"),
            ("a%2Fb/c%5cd.stl", "a%2Fb/c%5cd.stl"),
            ("%2e%2E/a.stl", "%2e%2E/a.stl"),
            ("../%2e/a.stl", "../%2e/a.stl"),
            ("%2e%2e%2fa.stl", "%2e%2e%2fa.stl"),
            ("a%00.stl", "a%00.stl"),
            ("%e9.stl", "%e9.stl"),
            ("%252e%252e/a", "%2e%2e/a"),
            ("é%", "é%"),
        ] {
            assert_eq!(percent_decoded(path), decoded);
        }
    }

    /// Every way to write a path leads to the file, and the path as written comes first.
    #[test]
    fn paths_are_found_in_all_spellings() {
        let folder = tempfile::tempdir().expect("a folder");
        let root = folder.path();
        let (written, outside) = (root.join("robot/arm.urdf"), root.join("secret.stl"));
        for file in [
            "robot/my meshes/f 1.stl",
            "robot/my meshes/g%201.stl",
            "robot/my meshes/g 1.stl",
            "robot/plain.stl",
            "secret.stl",
        ] {
            let path = root.join(file);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
            std::fs::write(path, "").expect("a file");
        }
        let lookup = Lookup::new(&Files::Disk, vec![root.to_path_buf()]);
        let found = |uri: &str| {
            lookup
                .resolve(uri, &written)
                .map(|path| (path.is_file(), path))
        };
        let absolute = root.join("robot/plain.stl").display().to_string();
        for uri in [
            "my meshes/f 1.stl",
            "my%20meshes/f%201.stl",
            "my meshes\\f 1.stl",
            ".\\my%20meshes\\f 1.stl",
            "..\\robot\\my meshes\\\\f 1.stl",
            "package://robot/my%20meshes/f%201.stl",
            "package://robot\\my meshes\\f 1.stl",
            "package:\\\\robot\\my meshes\\f 1.stl",
            "model://robot/my%20meshes\\f%201.stl",
            "file://robot/plain.stl",
            "FILE://robot/plain.stl",
            "file:robot/plain.stl",
            "C:\\ws\\src\\robot\\my meshes\\f 1.stl",
            "file:///C:/ws/robot/plain.stl",
            &format!("file://{absolute}"),
            &format!("file:{absolute}"),
            &format!("file://localhost{absolute}"),
            &absolute,
        ] {
            assert!(found(uri).is_ok_and(|(exists, _)| exists), "{uri}");
        }
        let as_written = found("my meshes/g%201.stl").expect("it exists").1;
        assert!(as_written.ends_with("g%201.stl"), "{as_written:?}");
        for uri in [
            "%2e%2e/secret.stl",
            "..%2fsecret.stl",
            "..%5Csecret.stl",
            "package://robot/%2e%2e/secret.stl",
            "plain.stl%00.txt",
        ] {
            assert!(
                found(uri).is_ok_and(|(exists, _)| !exists) || found(uri).is_err(),
                "{uri}"
            );
        }
        assert!(outside.is_file());
        assert_eq!(
            found("https://a/b.stl").map(|(_, path)| path),
            Err(UriFault::Scheme("https".to_owned()))
        );
    }
}
