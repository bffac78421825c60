//! Decompression of many small parts, each of which is about as large as the decompressor's state.

use std::cell::RefCell;
use std::io::Read;

use flate2::read::GzDecoder;
use flate2::{Crc, Decompress, FlushDecompress, Status};

/// A header of this program: magic bytes, the method, no optional fields. Time and system, which
/// follow, do not matter.
const HEADER: [u8; 4] = [0x1f, 0x8b, 8, 0];
/// Length of a header without optional fields. Unit: bytes.
const HEADER_LENGTH: usize = 10;

/// The reason why bytes are not used that expand to far more than this program compresses.
const TOO_LARGE: &str = "it expands to far more than this program writes";

thread_local! {
    /// Kept for the next part: memory that is given back and fetched again with each part costs as
    /// much as decompressing, and threads wait for each other there.
    static STATE: RefCell<Decompress> = RefCell::new(Decompress::new(false));
}

/// The most bytes that are expected from `compressed` ones. Motion expands three to five times, and
/// that of a robot at rest more; damaged or foreign bytes may expand a thousand times.
pub(super) fn most_expanded(compressed: usize) -> u64 {
    const FEW: u64 = 32 << 20;
    FEW + 64 * compressed as u64
}

/// Reads all that a decompressor makes of `compressed` bytes, and adds it to `out`.
///
/// # Errors
/// A message, if the bytes are damaged, or expand to far more than is expected.
pub(super) fn read_expanded(
    decoder: impl Read,
    compressed: usize,
    out: &mut Vec<u8>,
) -> Result<(), String> {
    let (most, before) = (most_expanded(compressed), out.len());
    decoder
        .take(most + 1)
        .read_to_end(out)
        .map_err(|error| error.to_string())?;
    if (out.len() - before) as u64 > most {
        Err(TOO_LARGE.to_owned())
    } else {
        Ok(())
    }
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
    read_expanded(GzDecoder::new(bytes), bytes.len(), &mut out)?;
    Ok(out)
}

/// The content, or `None` if the member is damaged or not of this program.
fn quickly(bytes: &[u8]) -> Option<Vec<u8>> {
    let body = bytes
        .get(HEADER_LENGTH..)
        .filter(|_| bytes.starts_with(&HEADER))?;
    // The motion of bodies expands three to five times.
    let mut out = Vec::with_capacity(4 * bytes.len());
    let most = most_expanded(bytes.len());
    let read = STATE.with_borrow_mut(|state| {
        state.reset(false);
        loop {
            let read = usize::try_from(state.total_in()).ok()?;
            let status = state
                .decompress_vec(body.get(read..)?, &mut out, FlushDecompress::None)
                .ok()?;
            match status {
                Status::StreamEnd => return usize::try_from(state.total_in()).ok(),
                _ if out.len() as u64 > most => return None,
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
    let is_whole =
        crc.sum() == u32::from_le_bytes(*sum) && crc.amount() == u32::from_le_bytes(*length);
    is_whole.then_some(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace_file::compressed;

    /// Bytes that repeat more or less often.
    fn content(length: usize, period: usize) -> Vec<u8> {
        (0..length)
            .map(|idx| ((idx % period) * (idx / 97) % 251) as u8)
            .collect()
    }

    #[test]
    fn parts_of_all_sizes_come_back_with_and_without_bytes_after_them() {
        for length in [0, 1, 9, 1000, 70_000, 1 << 20] {
            for period in [1, 7, 5000] {
                let content = content(length, period);
                let mut bytes = compressed(&content).unwrap();
                assert_eq!(
                    quickly(&bytes).as_ref(),
                    Some(&content),
                    "{length} {period}"
                );
                bytes.extend(b"more");
                assert_eq!(
                    quickly(&bytes).as_ref(),
                    Some(&content),
                    "{length} {period}"
                );
                assert_eq!(expanded(&bytes), Ok(content), "{length} {period}");
            }
        }
    }

    /// A quarter of a megabyte that expanded to gigabytes filled the memory.
    #[test]
    fn bytes_that_expand_a_thousand_times_are_refused() {
        let zeros = vec![0; 512 << 20];
        let bomb = compressed(&zeros).unwrap();
        assert!(bomb.len() < 1 << 20 && quickly(&bomb).is_none());
        assert_eq!(expanded(&bomb), Err(TOO_LARGE.to_owned()));
        let bomb = zstd::bulk::compress(&zeros, 3).unwrap();
        let read = zstd::stream::read::Decoder::new(bomb.as_slice()).unwrap();
        assert_eq!(
            read_expanded(read, bomb.len(), &mut Vec::new()),
            Err(TOO_LARGE.to_owned())
        );
    }

    #[test]
    fn a_member_with_a_name_is_read() {
        let mut encoder = flate2::GzBuilder::new()
            .filename("trace")
            .write(Vec::new(), flate2::Compression::fast());
        std::io::Write::write_all(&mut encoder, b"content").unwrap();
        let bytes = encoder.finish().unwrap();
        assert_eq!(
            (quickly(&bytes), expanded(&bytes)),
            (None, Ok(b"content".to_vec()))
        );
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
            assert!(
                read.is_err() || (read.as_ref() == Ok(&content) && (4..10).contains(&place)),
                "{place}"
            );
            assert!(expanded(&whole[..place]).is_err(), "{place}");
            assert_eq!(expanded(&next).as_ref(), Ok(&other), "{place}");
        }
    }
}
