//! The frames of a history's files, apart from the program's own code: writes files with other
//! contents, whose checksums are right.
//!
//! A file begins with eight bytes that name its format and its column. A frame has a header of
//! twelve bytes (the size of its content, the checksum of its content, and the checksum of its
//! place, size and content's checksum; each lowest byte first), then its content.

/// Size of a file's first bytes. Unit: bytes.
pub const HEAD: usize = 8;
/// Size of a frame's header. Unit: bytes.
pub const HEADER: usize = 12;

/// The contents of the frames of a file, whatever their checksums are. A frame that goes beyond the
/// end of the file has the rest.
pub fn contents(bytes: &[u8]) -> Vec<&[u8]> {
    let mut rest = bytes.get(HEAD..).unwrap_or_default();
    let mut found = Vec::new();
    while let (Some(size), Some(after)) = (rest.first_chunk::<4>(), rest.get(HEADER..)) {
        let size = u32::from_le_bytes(*size) as usize;
        let (content, further) = after.split_at(size.min(after.len()));
        found.push(content);
        rest = further;
    }
    found
}

/// Offsets at which the frames of an intact file end. Unit: bytes.
pub fn ends(bytes: &[u8]) -> Vec<usize> {
    let mut end = HEAD;
    let sizes = contents(bytes).into_iter().map(<[u8]>::len);
    sizes
        .map(|size| {
            end += HEADER + size;
            end
        })
        .collect()
}

/// A file with the first bytes of another, and frames of these contents.
pub fn file(like: &[u8], contents: &[impl AsRef<[u8]>]) -> Vec<u8> {
    let mut bytes = like.get(..HEAD).unwrap_or(like).to_vec();
    for content in contents {
        let (offset, content) = (bytes.len() as u64, content.as_ref());
        let header = [content.len() as u32, crc(&[content])].map(u32::to_le_bytes);
        let sum = crc(&[&offset.to_le_bytes(), &header[0], &header[1]]);
        bytes.extend(header.concat());
        bytes.extend(sum.to_le_bytes());
        bytes.extend(content);
    }
    bytes
}

/// The file of runs after another column has changed from `old` to `new`, frame by frame. A run has
/// the place of its frame in each column: offset, size and checksum, as variable-length integers.
pub fn repointed(runs: &[u8], old: &[u8], new: &[u8]) -> Vec<u8> {
    let (old, new) = (places(old), places(new));
    let repointed = |row: &&[u8]| {
        let mut row = row.to_vec();
        for (old, new) in old.iter().zip(&new) {
            // A run ends with its places.
            let at = (0..=row.len().saturating_sub(old.len()))
                .rev()
                .find(|at| row[*at..].starts_with(old));
            if let Some(at) = at {
                row.splice(at..at + old.len(), new.iter().copied());
                break;
            }
        }
        row
    };
    let rows: Vec<Vec<u8>> = contents(runs).iter().map(repointed).collect();
    file(runs, &rows)
}

/// The places of the frames of a file, as runs have them.
fn places(bytes: &[u8]) -> Vec<Vec<u8>> {
    let mut offset = HEAD as u64;
    let place = |content: &[u8]| {
        let mut place = Vec::new();
        for number in [offset, content.len() as u64, crc(&[content]).into()] {
            put_varint(&mut place, number);
        }
        offset += (HEADER + content.len()) as u64;
        place
    };
    contents(bytes).into_iter().map(place).collect()
}

/// Writes an integer with seven bits in each byte, low bits first.
pub fn put_varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// The checksum CRC-32 of parts one after another.
pub fn crc(parts: &[&[u8]]) -> u32 {
    let bytes = parts.iter().flat_map(|part| part.iter());
    !bytes.fold(!0_u32, |sum, byte| {
        (0..8).fold(sum ^ u32::from(*byte), |sum, _| {
            if sum & 1 == 1 {
                (sum >> 1) ^ 0xedb8_8320
            } else {
                sum >> 1
            }
        })
    })
}
