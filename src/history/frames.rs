//! Compact encoding of the motion of all bodies: column by column, each value as its difference from a prediction.
//!
//! The encoding is lossless (except that a negative zero becomes zero). Columns whose values are multiples of one of
//! the [`GRAINS`], to which a recorder may round, take about one byte per value, constant columns take nothing, and all
//! others about three bytes.

/// Steps of rounded values, coarse ones first. The last is a power of two, which `f32` represents exactly.
const GRAINS: [f64; 3] = [2e-4, 1e-4, 1.0 / 8192.0];
/// Maximum number of values of one run: limits the memory that a corrupt file can request. A long run has under a
/// million.
const MOST_VALUES: usize = 1 << 26;

const RAGGED: u8 = 0;
const COLUMNS: u8 = 1;
const CONSTANT: u8 = 0;
const BITS: u8 = 1;
/// First of the kinds for [`GRAINS`]: one for each, in order.
const IN_GRAINS: u8 = 2;

/// Encodes the rows of a table of numbers.
pub(super) fn encode(rows: &[Vec<f32>]) -> Vec<u8> {
    let width = rows.first().map_or(0, Vec::len);
    let mut out = Vec::new();
    if rows.iter().any(|row| row.len() != width) {
        out.push(RAGGED);
        put(&mut out, rows.len());
        for row in rows {
            put(&mut out, row.len());
            out.extend(row.iter().flat_map(|value| value.to_bits().to_le_bytes()));
        }
        return out;
    }
    out.push(COLUMNS);
    put(&mut out, rows.len());
    put(&mut out, width);
    for column in 0..width {
        encode_column(&rows.iter().map(|row| row[column]).collect::<Vec<f32>>(), &mut out);
    }
    out
}

/// Encodes a column of integers, each as its difference from a prediction.
pub(super) fn encode_steps(values: &[i32], out: &mut Vec<u8>) {
    if let [first, rest @ ..] = values
        && rest.iter().all(|value| value == first)
    {
        out.push(CONSTANT);
        put_u64(out, zigzag(i64::from(*first)));
        return;
    }
    out.push(BITS);
    let (mut last, mut step) = (0i64, 0i64);
    for value in values.iter().copied().map(i64::from) {
        // Bodies move smoothly: the prediction repeats the last step.
        put_u64(out, zigzag(value - (last + step)));
        (last, step) = (value, value - last);
    }
}

/// Decodes the integers that [`encode_steps`] encoded at the start of `bytes`, and returns them with the remaining bytes.
/// Returns `None` if the bytes are corrupt.
pub(super) fn decode_steps(count: usize, bytes: &[u8]) -> Option<(Vec<i32>, &[u8])> {
    if count > MOST_VALUES {
        return None;
    }
    let mut rest = Reader { bytes };
    if rest.byte()? == CONSTANT {
        let value = i32::try_from(unzigzag(rest.u64()?)).ok()?;
        return Some((vec![value; count], rest.bytes));
    }
    let (mut last, mut step) = (0i64, 0i64);
    let values = (0..count).map(|_| {
        let value = last.checked_add(step)?.checked_add(unzigzag(rest.u64()?))?;
        (last, step) = (value, value.checked_sub(last)?);
        i32::try_from(value).ok()
    });
    let values = values.collect::<Option<Vec<i32>>>()?;
    Some((values, rest.bytes))
}

/// Decodes the rows that [`encode`] encoded. Returns `None` if the bytes are corrupt.
#[cfg(test)]
fn decode(bytes: &[u8]) -> Option<Vec<Vec<f32>>> {
    decode_next(bytes).map(|(rows, _)| rows)
}

/// Decodes the rows that [`encode`] encoded at the start of `bytes`, and returns them with the remaining bytes. Returns
/// `None` if the bytes are corrupt.
pub(super) fn decode_next(bytes: &[u8]) -> Option<(Vec<Vec<f32>>, &[u8])> {
    let mut rest = Reader { bytes };
    let rows = read(&mut rest)?;
    Some((rows, rest.bytes))
}

/// Skips the rows that [`encode`] encoded at the start of `bytes`, and returns the remaining bytes. Returns `None` if the
/// bytes are corrupt.
pub(super) fn skip_next(bytes: &[u8]) -> Option<&[u8]> {
    let mut rest = Reader { bytes };
    let kind = rest.byte()?;
    let height = rest.number()?;
    if kind == RAGGED {
        for _ in 0..height {
            let width = rest.number()?;
            rest.take(width.checked_mul(4)?)?;
        }
        return Some(rest.bytes);
    }
    let width = if height == 0 { rest.number().map(|_| 0)? } else { rest.number()? };
    for _ in 0..width {
        match rest.byte()? {
            CONSTANT => drop(rest.take(4)?),
            BITS => drop(rest.take(height.checked_mul(4)?)?),
            kind if usize::from(kind - IN_GRAINS) < GRAINS.len() => rest.skip_numbers(height)?,
            _ => return None,
        }
    }
    Some(rest.bytes)
}

fn read(rest: &mut Reader<'_>) -> Option<Vec<Vec<f32>>> {
    let kind = rest.byte()?;
    let height = rest.number()?;
    if kind == RAGGED {
        return (0..height)
            .map(|_| {
                let width = rest.number()?;
                (0..width).map(|_| rest.bits().map(f32::from_bits)).collect()
            })
            .collect();
    }
    let width = rest.number()?;
    if height.checked_mul(width)? > MOST_VALUES || height > MOST_VALUES {
        return None;
    }
    let mut rows = vec![Vec::with_capacity(width); height];
    for _ in 0..width {
        for (row, value) in rows.iter_mut().zip(decode_column(height, rest)?) {
            row.push(value);
        }
    }
    Some(rows)
}

fn encode_column(values: &[f32], out: &mut Vec<u8>) {
    let Some(first) = values.first() else { return };
    if values.iter().all(|value| value.to_bits() == first.to_bits()) {
        out.push(CONSTANT);
        out.extend(first.to_bits().to_le_bytes());
    } else if let Some((kind, counts)) = counts_of(values) {
        out.push(IN_GRAINS + kind);
        let (mut last, mut step) = (0i64, 0i64);
        for count in counts.into_iter().map(i64::from) {
            // Bodies move smoothly: the prediction repeats the last step.
            put_u64(out, zigzag(count - (last + step)));
            (last, step) = (count, count - last);
        }
    } else {
        out.push(BITS);
        encode_bits(values, out);
    }
}

/// Encodes differences of the bit patterns as four planes of bytes: those of the high bytes are nearly constant, so
/// they compress well.
fn encode_bits(values: &[f32], out: &mut Vec<u8>) {
    let mut last = 0u32;
    let mut differences = Vec::with_capacity(values.len());
    for value in values {
        let bits = value.to_bits();
        let difference = bits.wrapping_sub(last).cast_signed();
        differences.push(((difference << 1) ^ (difference >> 31)).cast_unsigned().to_le_bytes());
        last = bits;
    }
    for plane in 0..4 {
        out.extend(differences.iter().map(|bytes| bytes[plane]));
    }
}

fn decode_column(height: usize, rest: &mut Reader<'_>) -> Option<Vec<f32>> {
    if height == 0 {
        return Some(Vec::new());
    }
    match rest.byte()? {
        CONSTANT => Some(vec![f32::from_bits(rest.bits()?); height]),
        BITS => decode_bits(height, rest),
        kind => decode_counts(*GRAINS.get(usize::from(kind - IN_GRAINS))?, height, rest),
    }
}

fn decode_counts(grain: f64, height: usize, rest: &mut Reader<'_>) -> Option<Vec<f32>> {
    let (mut last, mut step) = (0i64, 0i64);
    (0..height)
        .map(|_| {
            let count = last.checked_add(step)?.checked_add(unzigzag(rest.u64()?))?;
            (last, step) = (count, count.checked_sub(last)?);
            i32::try_from(count).ok().map(|count| of_grains(count, grain))
        })
        .collect()
}

fn decode_bits(height: usize, rest: &mut Reader<'_>) -> Option<Vec<f32>> {
    let planes = [rest.take(height)?, rest.take(height)?, rest.take(height)?, rest.take(height)?];
    let mut last = 0u32;
    Some(
        (0..height)
            .map(|i| {
                let difference = u32::from_le_bytes(planes.map(|plane| plane[i]));
                last = last.wrapping_add((difference >> 1) ^ (difference & 1).wrapping_neg());
                f32::from_bits(last)
            })
            .collect(),
    )
}

/// Returns the values as counts of the first grain of which all are multiples, with the index of that grain.
fn counts_of(values: &[f32]) -> Option<(u8, Vec<i32>)> {
    (0u8..).zip(GRAINS).find_map(|(kind, grain)| {
        let counts = values.iter().map(|value| in_grains(*value, grain)).collect::<Option<Vec<i32>>>()?;
        Some((kind, counts))
    })
}

/// Returns a value as a count of grains, or `None` if it is not an exact multiple.
fn in_grains(value: f32, grain: f64) -> Option<i32> {
    #[expect(clippy::cast_possible_truncation, reason = "a value that does not round-trip is rejected below")]
    let count = (f64::from(value) / grain).round() as i32;
    (of_grains(count, grain) == value).then_some(count)
}

#[expect(clippy::cast_possible_truncation, reason = "values are `f32`")]
fn of_grains(count: i32, grain: f64) -> f32 {
    (f64::from(count) * grain) as f32
}

fn zigzag(value: i64) -> u64 {
    ((value << 1) ^ (value >> 63)).cast_unsigned()
}

fn unzigzag(value: u64) -> i64 {
    (value >> 1).cast_signed() ^ -(value & 1).cast_signed()
}

fn put(out: &mut Vec<u8>, value: usize) {
    put_u64(out, value as u64);
}

/// Writes a variable-length integer: seven bits per byte, low bits first.
fn put_u64(out: &mut Vec<u8>, mut value: u64) {
    loop {
        let low = (value & 0x7f) as u8;
        value >>= 7;
        out.push(if value == 0 { low } else { low | 0x80 });
        if value == 0 {
            return;
        }
    }
}

struct Reader<'a> {
    bytes: &'a [u8],
}

impl<'a> Reader<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.bytes.split_at_checked(count)?;
        self.bytes = rest;
        Some(taken)
    }

    fn byte(&mut self) -> Option<u8> {
        self.take(1).map(|bytes| bytes[0])
    }

    fn bits(&mut self) -> Option<u32> {
        self.take(4)?.try_into().ok().map(u32::from_le_bytes)
    }

    /// Skips variable-length integers: each ends with a byte below 128.
    fn skip_numbers(&mut self, count: usize) -> Option<()> {
        for _ in 0..count {
            let end = self.bytes.iter().position(|byte| *byte < 0x80)?;
            self.bytes = &self.bytes[end + 1..];
        }
        Some(())
    }

    fn u64(&mut self) -> Option<u64> {
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

    fn number(&mut self) -> Option<usize> {
        usize::try_from(self.u64()?).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bits(rows: &[Vec<f32>]) -> Vec<Vec<u32>> {
        rows.iter().map(|row| row.iter().map(|value| value.to_bits()).collect()).collect()
    }

    #[test]
    fn encoding_is_lossless() {
        let wild = [f32::NAN, f32::INFINITY, -0.0, f32::MIN, 1e-40, 0.1, -7.25, 3.0e38];
        let tables = [
            Vec::new(),
            vec![Vec::new(); 3],
            (0..50).map(|i| vec![i as f32 * 0.125, 0.5, (i as f32).sin(), wild[i % 8], i as f32 * 1e-4]).collect(),
            vec![vec![1.0], vec![1.0, 2.0], Vec::new()],
        ];
        for rows in tables {
            assert_eq!(bits(&decode(&encode(&rows)).expect("it was just encoded")), bits(&rows));
            let followed = [encode(&rows), vec![9]].concat();
            assert_eq!(skip_next(&followed), Some([9].as_slice()));
        }
    }

    #[test]
    fn integers_come_back_and_corrupt_ones_are_rejected() {
        for values in [vec![], vec![5], vec![-7; 100], vec![i32::MIN, i32::MAX, 0, 3], (0..500).collect()] {
            let mut bytes = Vec::new();
            encode_steps(&values, &mut bytes);
            let (decoded, rest) = decode_steps(values.len(), &bytes).expect("they were just encoded");
            assert_eq!((decoded, rest.len()), (values.clone(), 0));
            for end in 0..bytes.len() {
                assert!(values.is_empty() || decode_steps(values.len(), &bytes[..end]).is_none(), "{values:?} {end}");
            }
        }
        assert!(decode_steps(usize::MAX, &[CONSTANT, 0]).is_none());
    }

    #[test]
    fn corrupt_data_is_rejected_or_decodes_without_panic() {
        let rows: Vec<Vec<f32>> = (0..50).map(|i| vec![i as f32 * 0.125, (i as f32).sin()]).collect();
        let bytes = encode(&rows);
        for end in 0..bytes.len() {
            assert!(decode(&bytes[..end]).is_none() && skip_next(&bytes[..end]).is_none(), "{end}");
        }
        for at in 0..bytes.len() {
            let mut bytes = bytes.clone();
            bytes[at] ^= 0xff;
            // Decoding must only terminate: it may return another number.
            let _ = (decode(&bytes), skip_next(&bytes));
        }
    }

    #[test]
    fn rounded_values_take_about_a_byte() {
        for grain in GRAINS {
            let round = |value: f64| ((value / grain).round() * grain) as f32;
            let rows: Vec<Vec<f32>> = (0..400).map(|i| vec![round((f64::from(i) * 0.02).sin())]).collect();
            assert!(encode(&rows).len() < 450, "{}", encode(&rows).len());
            assert_eq!(decode(&encode(&rows)).expect("it was just encoded"), rows);
        }
    }
}
