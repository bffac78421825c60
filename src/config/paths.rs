//! Paths that a configuration names.

use std::path::{Path, PathBuf};

/// Resolves a path of a configuration relative to `folder`, without `..` where removing it does not change the target.
pub fn resolve_path(folder: &Path, written: &str) -> PathBuf {
    let (mut base, mut rest) = (folder.to_path_buf(), Path::new(written));
    while let Ok(shorter) = rest.strip_prefix("..") {
        if base.file_name().is_none() || base.is_symlink() || !base.pop() {
            break;
        }
        rest = shorter;
    }
    let path = base.join(rest);
    // An empty path is the current directory.
    if path.as_os_str().is_empty() { PathBuf::from(".") } else { path }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_relative_to_the_configuration() {
        assert_eq!(resolve_path(Path::new("no-such"), "../models"), Path::new("models"));
        assert_eq!(resolve_path(Path::new(""), "../models"), Path::new("../models"));
        assert_eq!(resolve_path(Path::new("a/b"), "../../../m"), Path::new("../m"));
        assert_eq!(resolve_path(Path::new("a"), "/m"), Path::new("/m"));
        assert_eq!(resolve_path(Path::new("a"), ".."), Path::new("."));
    }
}
