//! Decompression of many small parts, each of which is about as large as the decompressor's state.

use std::cell::RefCell;
use std::io::Read as _;

use flate2::read::GzDecoder;
use flate2::{Crc, Decompress, FlushDecompress, Status};

/// A header of this program: magic bytes, the method, no optional fields. Time and system, which follow, do not matter.
const HEADER: [u8; 4] = [0x1f, 0x8b, 8, 0];
/// Length of a header without optional fields. Unit: bytes.
const HEADER_LENGTH: usize = 10;

thread_local! {
    /// Kept for the next part: memory that is given back and fetched again with each part costs as much as
    /// decompressing, and threads wait for each other there.
    static STATE: RefCell<Decompress> = RefCell::new(Decompress::new(false));
}

/// Returns the content of the gzip member at the start of `bytes`.
///
/// # Errors
/// A message, if it is damaged.
pub(super) fn expanded(bytes: &[u8]) -> Result<Vec<u8>, String> {
    if let Some(whole) = quickly(bytes) {
        return Ok(whole);
    }
    let mut out = Vec::new();
    GzDecoder::new(bytes).read_to_end(&mut out).map_err(|error| error.to_string())?;
    Ok(out)
}

/// The content, or `None` if the member is damaged or not of this program.
fn quickly(bytes: &[u8]) -> Option<Vec<u8>> {
    let body = bytes.get(HEADER_LENGTH..).filter(|_| bytes.starts_with(&HEADER))?;
    // The motion of bodies expands three to five times.
    let mut out = Vec::with_capacity(4 * bytes.len());
    let read = STATE.with_borrow_mut(|state| {
        state.reset(false);
        loop {
            let read = usize::try_from(state.total_in()).ok()?;
            let status = state.decompress_vec(body.get(read..)?, &mut out, FlushDecompress::None).ok()?;
            match status {
                Status::StreamEnd => return usize::try_from(state.total_in()).ok(),
                _ if out.len() == out.capacity() => out.reserve(out.len().max(HEADER_LENGTH)),
                // It needs more bytes than there are.
                _ if state.total_in() == body.len() as u64 => return None,
                _ => {}
            }
        }
    })?;
    let (sum, length) = body.get(read..)?.split_first_chunk::<4>()?;
    let length = length.first_chunk::<4>()?;
    let mut crc = Crc::new();
    crc.update(&out);
    let is_whole = crc.sum() == u32::from_le_bytes(*sum) && crc.amount() == u32::from_le_bytes(*length);
    is_whole.then_some(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace_file::compressed;

    /// Bytes that repeat more or less often.
    fn content(length: usize, period: usize) -> Vec<u8> {
        (0..length).map(|idx| ((idx % period) * (idx / 97) % 251) as u8).collect()
    }

    #[test]
    fn parts_of_all_sizes_come_back_with_and_without_bytes_after_them() {
        for length in [0, 1, 9, 1000, 70_000, 1 << 20] {
            for period in [1, 7, 5000] {
                let content = content(length, period);
                let mut bytes = compressed(&content).unwrap();
                assert_eq!(quickly(&bytes).as_ref(), Some(&content), "{length} {period}");
                bytes.extend(b"more");
                assert_eq!(quickly(&bytes).as_ref(), Some(&content), "{length} {period}");
                assert_eq!(expanded(&bytes), Ok(content), "{length} {period}");
            }
        }
    }

    #[test]
    fn a_member_with_a_name_is_read() {
        let mut encoder = flate2::GzBuilder::new().filename("trace").write(Vec::new(), flate2::Compression::fast());
        std::io::Write::write_all(&mut encoder, b"content").unwrap();
        let bytes = encoder.finish().unwrap();
        assert_eq!((quickly(&bytes), expanded(&bytes)), (None, Ok(b"content".to_vec())));
    }

    #[test]
    fn every_damage_is_an_error_and_the_next_part_is_whole() {
        let (content, other) = (content(3000, 50), content(100, 3));
        let (whole, next) = (compressed(&content).unwrap(), compressed(&other).unwrap());
        for place in 0..whole.len() {
            let mut damaged = whole.clone();
            damaged[place] ^= 0x55;
            let read = expanded(&damaged);
            // Time and system do not matter.
            assert!(read.is_err() || (read.as_ref() == Ok(&content) && (4..10).contains(&place)), "{place}");
            assert!(expanded(&whole[..place]).is_err(), "{place}");
            assert_eq!(expanded(&next).as_ref(), Ok(&other), "{place}");
        }
    }
}
