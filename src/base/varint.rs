//! Variable-length integers, of which the history's compact encodings consist.

/// Writes a variable-length integer: seven bits per byte, low bits first.
pub fn put_varint(out: &mut Vec<u8>, mut value: u64) {
    loop {
        let low = (value & 0x7f) as u8;
        value >>= 7;
        out.push(if value == 0 { low } else { low | 0x80 });
        if value == 0 {
            return;
        }
    }
}

/// Maps integers to unsigned ones so that those near zero stay small.
pub fn zigzag(value: i64) -> u64 {
    ((value << 1) ^ (value >> 63)).cast_unsigned()
}

/// Inverts [`zigzag`].
pub fn unzigzag(value: u64) -> i64 {
    (value >> 1).cast_signed() ^ -(value & 1).cast_signed()
}

/// Reads encoded data from its start. Every method returns `None` if the data ends too early.
#[derive(Debug, Clone, Copy)]
pub struct ByteReader<'a> {
    /// The remaining bytes.
    pub bytes: &'a [u8],
}

impl<'a> ByteReader<'a> {
    /// Takes `count` bytes.
    pub fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.bytes.split_at_checked(count)?;
        self.bytes = rest;
        Some(taken)
    }

    /// Takes one byte.
    pub fn byte(&mut self) -> Option<u8> {
        self.take(1).map(|bytes| bytes[0])
    }

    /// Takes four bytes as a little-endian number.
    pub fn bits(&mut self) -> Option<u32> {
        self.take(4)?.try_into().ok().map(u32::from_le_bytes)
    }

    /// Takes a variable-length integer. Returns `None` if it has more than 64 bits, too.
    pub fn varint(&mut self) -> Option<u64> {
        let mut value = 0u64;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }

    /// Takes a variable-length integer that is a size.
    pub fn size(&mut self) -> Option<usize> {
        usize::try_from(self.varint()?).ok()
    }

    /// Skips variable-length integers: each ends with a byte below 128.
    pub fn skip_varints(&mut self, mut count: usize) -> Option<()> {
        // Whole blocks first: counting their ends takes a few instructions, if the compiler need
        // not look for overflows.
        while let Some((block, rest)) = self.bytes.split_first_chunk::<64>() {
            let ends = block
                .iter()
                .fold(0u8, |ends, byte| ends.wrapping_add(u8::from(*byte < 0x80)));
            let ends = usize::from(ends);
            if ends >= count {
                break;
            }
            count -= ends;
            self.bytes = rest;
        }
        for _ in 0..count {
            let end = self.bytes.iter().position(|byte| *byte < 0x80)?;
            self.bytes = &self.bytes[end + 1..];
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_back_and_skipped() {
        let values: Vec<i64> = (0..300)
            .map(|idx| (i64::MAX >> (idx % 64)) * (1 - 2 * (idx % 2)))
            .collect();
        let mut bytes = Vec::new();
        values
            .iter()
            .for_each(|value| put_varint(&mut bytes, zigzag(*value)));
        let mut all = ByteReader { bytes: &bytes };
        for (idx, value) in values.iter().enumerate() {
            let mut rest = ByteReader { bytes: &bytes };
            assert_eq!(rest.skip_varints(idx), Some(()));
            assert_eq!(rest.bytes.len(), all.bytes.len(), "{idx}");
            assert_eq!(all.varint().map(unzigzag), Some(*value));
        }
        assert_eq!(
            (
                all.byte(),
                ByteReader { bytes: &bytes }.skip_varints(values.len() + 1)
            ),
            (None, None)
        );
        assert_eq!(ByteReader { bytes: &[0xff; 20] }.varint(), None);
    }
}
