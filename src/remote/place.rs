//! Places of files: a folder, or a bucket of an object storage.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

#[cfg(feature = "object-storage")]
use crate::bucket::Bucket;
use crate::client::Client;
use actcheck_base::{Below, Diagnostic, Diagnostics, FileKind, open_regular};

/// Longest file that is read: an index of tables. Unit: bytes.
const LONGEST: u64 = 64 << 20;

/// Settings of an object storage with the interface of S3.
#[derive(Clone, Default)]
pub struct BucketSettings {
    /// Address of the storage; `None` is Amazon's.
    pub endpoint: Option<String>,
    /// Its region; `None` is `us-east-1`.
    pub region: Option<String>,
    /// Access key and secret key; `None` for public buckets.
    pub keys: Option<(String, String)>,
    /// The token of temporary keys.
    pub token: Option<String>,
}

/// A folder or the part of a bucket below a prefix. Files appear there when they are complete.
pub struct Place {
    kind: Kind,
}

enum Kind {
    Folder(PathBuf),
    #[cfg(feature = "object-storage")]
    Bucket(Box<Bucket>),
}

impl Place {
    /// Reads the name of a place: a folder, or `s3://BUCKET/PREFIX`. The folder need not exist.
    /// `client` makes the requests to an object storage, without credentials of its own.
    ///
    /// # Errors
    /// `X090` the name is not valid, or needs another build.
    pub fn parse(
        text: &str,
        settings: &BucketSettings,
        client: Client,
    ) -> Result<Self, Diagnostics> {
        match text.split_once("://") {
            None => Ok(Self {
                kind: Kind::Folder(PathBuf::from(text)),
            }),
            Some(("s3", name)) => bucket(name, settings, client),
            Some((scheme, _)) => {
                let fault = Diagnostic::error(
                    "X090",
                    format!("files can't be copied to addresses with {scheme}"),
                );
                Err(fault.help("name a folder, or `s3://BUCKET/PREFIX`").into())
            }
        }
    }

    /// The files below it with their sizes in bytes, by their names with `/`.
    ///
    /// # Errors
    /// `X091`, `X097`: it can't be read.
    pub fn list(&self) -> Result<BTreeMap<String, u64>, Diagnostics> {
        match &self.kind {
            Kind::Folder(folder) => {
                let mut found = BTreeMap::new();
                files(&Below::new(folder), folder, "", &mut found)
                    .map_err(|error| unusable(folder, &error))?;
                Ok(found)
            }
            #[cfg(feature = "object-storage")]
            Kind::Bucket(bucket) => bucket.list(),
        }
    }

    /// Copies a file into it.
    ///
    /// # Errors
    /// As [`Place::list`].
    pub fn put_file(&self, name: &str, from: &Path) -> Result<(), Diagnostics> {
        match &self.kind {
            Kind::Folder(folder) => {
                let copied = written(folder, name, |to| {
                    io::copy(&mut open_regular(from)?, to)?;
                    Ok(())
                });
                copied.map_err(|error| unusable(&folder.join(name), &error))
            }
            #[cfg(feature = "object-storage")]
            Kind::Bucket(bucket) => bucket.put_file(name, from),
        }
    }

    /// Writes a file.
    ///
    /// # Errors
    /// As [`Place::list`].
    pub fn put(&self, name: &str, bytes: &[u8]) -> Result<(), Diagnostics> {
        match &self.kind {
            Kind::Folder(folder) => {
                let written = written(folder, name, |to| to.write_all(bytes));
                written.map_err(|error| unusable(&folder.join(name), &error))
            }
            #[cfg(feature = "object-storage")]
            Kind::Bucket(bucket) => bucket.put(name, bytes),
        }
    }

    /// Reads a file. Returns `None` if there is none of this name.
    ///
    /// # Errors
    /// As [`Place::list`].
    pub fn get(&self, name: &str) -> Result<Option<Vec<u8>>, Diagnostics> {
        match &self.kind {
            Kind::Folder(folder) => match Below::new(folder).read(&folder.join(name), LONGEST) {
                Ok(bytes) => Ok(Some(bytes)),
                Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
                Err(error) => Err(unusable(&folder.join(name), &error)),
            },
            #[cfg(feature = "object-storage")]
            Kind::Bucket(bucket) => bucket.get(name),
        }
    }

    /// Removes a file, if it is there.
    ///
    /// # Errors
    /// As [`Place::list`].
    pub fn remove(&self, name: &str) -> Result<(), Diagnostics> {
        match &self.kind {
            Kind::Folder(folder) => match Below::new(folder).remove(&folder.join(name)) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => {
                    Err(unusable(&folder.join(name), &error))
                }
                _ => Ok(()),
            },
            #[cfg(feature = "object-storage")]
            Kind::Bucket(bucket) => bucket.remove(name),
        }
    }
}

#[cfg(feature = "object-storage")]
fn bucket(name: &str, settings: &BucketSettings, client: Client) -> Result<Place, Diagnostics> {
    Bucket::open(name, settings, client).map(|bucket| Place {
        kind: Kind::Bucket(Box::new(bucket)),
    })
}

#[cfg(not(feature = "object-storage"))]
fn bucket(name: &str, _settings: &BucketSettings, _client: Client) -> Result<Place, Diagnostics> {
    let fault = Diagnostic::error(
        "X090",
        format!("`s3://{name}` can't be used: this build has no object storage"),
    );
    Err(fault
        .help("build with `--features object-storage`, or copy to a folder")
        .into())
}

/// Adds the files of a folder, without those that are being written. A missing folder has none.
fn files(
    below: &Below,
    folder: &Path,
    prefix: &str,
    found: &mut BTreeMap<String, u64>,
) -> io::Result<()> {
    for (name, kind) in below.entries(folder)? {
        let path = folder.join(&name);
        let name = format!("{prefix}{}", name.to_string_lossy());
        match kind {
            FileKind::Folder => files(below, &path, &format!("{name}/"), found)?,
            FileKind::File if !name.ends_with(".tmp") => {
                found.insert(name, fs::metadata(path)?.len());
            }
            _ => {}
        }
    }
    Ok(())
}

/// Writes a file that appears when it is complete.
fn written(
    folder: &Path,
    name: &str,
    write: impl FnOnce(&mut fs::File) -> io::Result<()>,
) -> io::Result<()> {
    let (below, path) = (Below::new(folder), folder.join(name));
    below.create_folder(path.parent().unwrap_or(folder))?;
    let new = below.new_file(&path)?;
    write(&mut new.writer()?)?;
    new.finish()
}

fn unusable(path: &Path, error: &io::Error) -> Diagnostics {
    Diagnostic::error(
        "X097",
        format!("{} can't be copied: {error}", path.display()),
    )
    .help("name a folder that can be written, on a disk with free space")
    .into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Credentials;
    use actcheck_base::ScratchFolder;
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;
    use std::time::Duration;

    fn client() -> Client {
        Client::new(
            Credentials::default(),
            Duration::from_secs(10),
            Arc::new(AtomicBool::new(false)),
        )
    }

    /// Puts, lists, reads and removes files in a place that is empty.
    fn use_place(place: &Place, file: &Path) {
        assert!(place.list().expect("it can be read").is_empty());
        assert_eq!(place.get("a b/c=1/x").expect("it can be read"), None);
        place
            .put_file("a b/c=1/x", file)
            .expect("it can be written");
        place.put("y", b"12").expect("it can be written");
        place.put("y", b"345").expect("it can be written");
        let sizes = BTreeMap::from([("a b/c=1/x".to_owned(), 5), ("y".to_owned(), 3)]);
        assert_eq!(place.list().expect("it can be read"), sizes);
        assert_eq!(
            place.get("a b/c=1/x").expect("it can be read").as_deref(),
            Some(&b"hello"[..])
        );
        assert_eq!(
            place.get("y").expect("it can be read").as_deref(),
            Some(&b"345"[..])
        );
        for name in ["a b/c=1/x", "y", "z"] {
            place.remove(name).expect("it can be removed");
        }
        assert!(place.list().expect("it can be read").is_empty());
    }

    #[test]
    fn a_folder_is_a_place_of_files() {
        let scratch = ScratchFolder::create().expect("it can be created");
        let file = scratch.path().join("file");
        fs::write(&file, "hello").expect("it can be written");
        let name = scratch.path().join("place").display().to_string();
        let place =
            Place::parse(&name, &BucketSettings::default(), client()).expect("it is a folder");
        use_place(&place, &file);
        let below = format!("{}/below", file.display());
        let place =
            Place::parse(&below, &BucketSettings::default(), client()).expect("it is a path");
        assert!(place.put("a", b"").is_err());
    }

    #[test]
    fn other_addresses_are_refused() {
        for name in ["gs://a/b", "s3://", "s3:///a"] {
            assert!(
                Place::parse(name, &BucketSettings::default(), client()).is_err(),
                "{name}"
            );
        }
        let is_there = Place::parse("s3://a/b", &BucketSettings::default(), client()).is_ok();
        assert_eq!(is_there, cfg!(feature = "object-storage"));
    }

    /// A storage is used if `ACTCHECK_S3` is its address (a server of moto, for instance) and has
    /// the bucket `actcheck`.
    #[cfg(feature = "object-storage")]
    #[test]
    fn a_bucket_is_a_place_of_files() {
        let Ok(endpoint) = std::env::var("ACTCHECK_S3") else {
            return;
        };
        let scratch = ScratchFolder::create().expect("it can be created");
        let file = scratch.path().join("file");
        fs::write(&file, "hello").expect("it can be written");
        let keys = Some(("test".to_owned(), "secret".to_owned()));
        let settings = BucketSettings {
            endpoint: Some(endpoint),
            keys,
            ..BucketSettings::default()
        };
        let place =
            Place::parse("s3://actcheck/some/prefix", &settings, client()).expect("it is valid");
        use_place(&place, &file);
        let lot = 1_100;
        (0..lot).for_each(|number| {
            place
                .put(&format!("{number}"), b"1")
                .expect("it can be written")
        });
        assert_eq!(
            place.list().expect("it can be read").len(),
            lot,
            "more than one page of names"
        );
        (0..lot).for_each(|number| {
            place
                .remove(&format!("{number}"))
                .expect("it can be removed")
        });
        let missing =
            Place::parse("s3://missing-bucket/x", &settings, client()).expect("it is valid");
        assert!(
            missing
                .list()
                .expect_err("there is no such bucket")
                .iter()
                .all(|fault| fault.code == "X097")
        );
    }
}
