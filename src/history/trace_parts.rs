//! A copy of a run's objects, actions and outcomes at the end of its trace file.
//!
//! They are read in a tenth of the time that the store takes, where each is many statements. If
//! the copy is missing or damaged, they are read from the store.

use std::io::{Read as _, Seek as _, SeekFrom};
use std::path::Path;

use crate::detail::Parts;
use crate::folder;
use crate::inflate::expanded;
use crate::trace_file::compressed;

/// Last bytes of a file that has a copy. The last one is its version; it increases whenever a type
/// of [`Parts`] changes.
const MAGIC: &[u8; 8] = b"actpart2";
/// Size of the length and the magic bytes after the copy. Unit: bytes.
const TRAILER: u64 = 12;

/// Appends the copy to the content of a trace file. `hash`: of the trace, so that a copy of another
/// run is noticed.
///
/// # Errors
/// A message, if it can't be encoded. (The current types never cause this.)
pub(super) fn appended(mut trace: Vec<u8>, hash: &str, parts: &Parts) -> Result<Vec<u8>, String> {
    let parts =
        compressed(&postcard::to_stdvec(&(hash, parts)).map_err(|error| error.to_string())?)?;
    let length =
        u32::try_from(parts.len()).map_err(|_| "it has more than 4 GB of outcomes".to_owned())?;
    trace.extend([parts.as_slice(), &length.to_le_bytes(), MAGIC].concat());
    Ok(trace)
}

/// Reads the copy and the hash of its trace. Returns `None` if the file has none that this program
/// can read; its checksum shows damage.
pub(super) fn read(file: &Path) -> Option<(String, Parts)> {
    let mut file = folder::open(file).ok()?;
    let end = file.metadata().ok()?.len().checked_sub(TRAILER)?;
    file.seek(SeekFrom::Start(end)).ok()?;
    let mut length = [0; 4];
    file.read_exact(&mut length).ok()?;
    file.seek(SeekFrom::Start(
        end.checked_sub(u32::from_le_bytes(length).into())?,
    ))
    .ok()?;
    let mut after = Vec::new();
    file.read_to_end(&mut after).ok()?;
    of_bytes(&after).ok()
}

/// Reads the copy in the bytes after a trace, and the hash of its trace.
///
/// # Errors
/// A message, if it is damaged.
pub(super) fn of_bytes(after: &[u8]) -> Result<(String, Parts), String> {
    let is_whole = || {
        let (parts, trailer) =
            after.split_at_checked(after.len().checked_sub(TRAILER as usize)?)?;
        let (length, magic) = trailer.split_first_chunk::<4>()?;
        (magic == MAGIC && u32::from_le_bytes(*length) as usize == parts.len()).then_some(parts)
    };
    let parts = is_whole().ok_or("the copy of its outcomes ends wrongly")?;
    postcard::from_bytes(&expanded(parts)?).map_err(|error| error.to_string().to_lowercase())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ActionDetail, ObjectDetail};
    use actcheck_base::{Judgement, Outcome, ScratchFolder};
    use actcheck_data::Role;

    fn sample() -> Parts {
        let object = ObjectDetail {
            id: "glass_1".to_owned(),
            model: "glass".to_owned(),
            category: "http://actions#Glass".to_owned(),
            role: Role::Target,
            x: 0.1,
            y: -0.2,
            z: 0.3,
            yaw: f64::MIN_POSITIVE,
            mass_kg: 0.2,
            friction: 0.5,
            restitution: 0.0,
            robot_distance_m: 0.7,
            neighbour_distance_m: None,
            target_distance_m: Some(0.25),
            displacement_m: Some(0.0),
            max_tilt_rad: None,
        };
        let judgement = Judgement {
            property: "http://actions#ObjectGrasped".to_owned(),
            outcome: Outcome::Failed,
            margin: Some(-0.01),
            witness: "no success was derived".to_owned(),
            rule_digest: "ab".to_owned(),
            held_before: Some(false),
            vacuous: Some(true),
        };
        let action = ActionDetail {
            step: 1,
            action: "http://actions#Pick".to_owned(),
            score: 0.5,
            reported: Some(true),
            message: None,
            duration_secs: 12.5,
            end: "completed".to_owned(),
            parameters: [("pickObject".to_owned(), vec!["glass_1".to_owned()])].into(),
            judgements: vec![judgement],
        };
        (vec![object], vec![action])
    }

    #[test]
    fn a_copy_is_read_as_it_was_written_and_damage_is_noticed() {
        let folder = ScratchFolder::create().expect("it can be created");
        let file = folder.path().join("run.trace");
        let written = appended(b"trace".to_vec(), "ab", &sample()).expect("it can be encoded");
        assert!(written.starts_with(b"trace"));
        std::fs::write(&file, &written).expect("it can be written");
        assert_eq!(read(&file), Some(("ab".to_owned(), sample())));
        assert_eq!(
            of_bytes(&written["trace".len()..]),
            Ok(("ab".to_owned(), sample()))
        );
        // The bytes of the compressed part's header that hold no content may differ.
        let after_header = b"trace".len() + 10;
        for at in after_header..written.len() {
            let mut damaged = written.clone();
            damaged[at] ^= 1;
            std::fs::write(&file, &damaged).expect("it can be written");
            assert_eq!(read(&file), None, "byte {at}");
            assert!(of_bytes(&damaged["trace".len()..]).is_err(), "byte {at}");
        }
        for length in 0..written.len() {
            std::fs::write(&file, &written[..length]).expect("it can be written");
            assert_eq!(read(&file), None, "length {length}");
        }
        assert_eq!(read(&folder.path().join("other")), None);
    }
}
