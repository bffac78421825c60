//! Compact encoding of the motion of all bodies: column by column, each value as its difference
//! from a prediction.
//!
//! The encoding is lossless (except that a negative zero becomes zero). Columns whose values are
//! multiples of one of the [`GRAINS`], to which a recorder may round, take about one byte per
//! value, constant columns take nothing, and all others about three bytes.

use actcheck_base::{ByteReader, put_varint, unzigzag, zigzag};

/// Steps of rounded values, coarse ones first. The last is a power of two, which `f32` represents
/// exactly.
const GRAINS: [f64; 3] = [2e-4, 1e-4, 1.0 / 8192.0];
/// Maximum number of values of one run: limits the memory that a corrupt file can request. A long
/// run has under a million.
const MOST_VALUES: usize = 1 << 26;
/// Maximum number of rows, for the same reason: 19 hours of 60 pictures a second.
const MOST_ROWS: usize = 1 << 22;

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
        encode_column(
            &rows.iter().map(|row| row[column]).collect::<Vec<f32>>(),
            &mut out,
        );
    }
    out
}

/// Decodes the rows that [`encode`] encoded. Returns `None` if the bytes are corrupt.
#[cfg(test)]
fn decode(bytes: &[u8]) -> Option<Vec<Vec<f32>>> {
    decode_next(bytes).map(|(rows, _)| rows)
}

/// Decodes the rows that [`encode`] encoded at the start of `bytes`, and returns them with the
/// remaining bytes. Returns `None` if the bytes are corrupt.
pub(super) fn decode_next(bytes: &[u8]) -> Option<(Vec<Vec<f32>>, &[u8])> {
    let mut rest = ByteReader { bytes };
    let rows = read(&mut rest)?;
    Some((rows, rest.bytes))
}

/// Skips the rows that [`encode`] encoded at the start of `bytes`, and returns the remaining bytes.
/// Returns `None` if the bytes are corrupt.
pub(super) fn skip_next(bytes: &[u8]) -> Option<&[u8]> {
    let mut rest = ByteReader { bytes };
    let kind = rest.byte()?;
    let height = rest.size()?;
    if kind == RAGGED {
        for _ in 0..height {
            let width = rest.size()?;
            rest.take(width.checked_mul(4)?)?;
        }
        return Some(rest.bytes);
    }
    let width = if height == 0 {
        rest.size().map(|_| 0)?
    } else {
        rest.size()?
    };
    for _ in 0..width {
        match rest.byte()? {
            CONSTANT => drop(rest.take(4)?),
            BITS => drop(rest.take(height.checked_mul(4)?)?),
            kind if usize::from(kind - IN_GRAINS) < GRAINS.len() => rest.skip_varints(height)?,
            _ => return None,
        }
    }
    Some(rest.bytes)
}

fn read(rest: &mut ByteReader<'_>) -> Option<Vec<Vec<f32>>> {
    let kind = rest.byte()?;
    let height = rest.size()?;
    if kind == RAGGED {
        return (0..height)
            .map(|_| {
                let width = rest.size()?;
                (0..width)
                    .map(|_| rest.bits().map(f32::from_bits))
                    .collect()
            })
            .collect();
    }
    let width = rest.size()?;
    if height.checked_mul(width)? > MOST_VALUES || height > MOST_ROWS {
        return None;
    }
    // Not `vec![…; height]`: copies of a vector have no room.
    let mut rows: Vec<Vec<f32>> = (0..height).map(|_| Vec::with_capacity(width)).collect();
    for _ in 0..width {
        for (row, value) in rows.iter_mut().zip(decode_column(height, rest)?) {
            row.push(value);
        }
    }
    Some(rows)
}

fn encode_column(values: &[f32], out: &mut Vec<u8>) {
    let Some(first) = values.first() else { return };
    if values
        .iter()
        .all(|value| value.to_bits() == first.to_bits())
    {
        out.push(CONSTANT);
        out.extend(first.to_bits().to_le_bytes());
    } else if let Some((kind, counts)) = counts_of(values) {
        out.push(IN_GRAINS + kind);
        let (mut last, mut step) = (0i64, 0i64);
        for count in counts.into_iter().map(i64::from) {
            // Bodies move smoothly: the prediction repeats the last step.
            put_varint(out, zigzag(count - (last + step)));
            (last, step) = (count, count - last);
        }
    } else {
        out.push(BITS);
        encode_bits(values, out);
    }
}

/// Encodes differences of the bit patterns as four planes of bytes: those of the high bytes are
/// nearly constant, so they compress well.
fn encode_bits(values: &[f32], out: &mut Vec<u8>) {
    let mut last = 0u32;
    let mut differences = Vec::with_capacity(values.len());
    for value in values {
        let bits = value.to_bits();
        let difference = bits.wrapping_sub(last).cast_signed();
        differences.push(
            ((difference << 1) ^ (difference >> 31))
                .cast_unsigned()
                .to_le_bytes(),
        );
        last = bits;
    }
    for plane in 0..4 {
        out.extend(differences.iter().map(|bytes| bytes[plane]));
    }
}

fn decode_column(height: usize, rest: &mut ByteReader<'_>) -> Option<Vec<f32>> {
    if height == 0 {
        return Some(Vec::new());
    }
    match rest.byte()? {
        CONSTANT => Some(vec![f32::from_bits(rest.bits()?); height]),
        BITS => decode_bits(height, rest),
        kind => decode_counts(*GRAINS.get(usize::from(kind - IN_GRAINS))?, height, rest),
    }
}

fn decode_counts(grain: f64, height: usize, rest: &mut ByteReader<'_>) -> Option<Vec<f32>> {
    let (mut last, mut step) = (0i64, 0i64);
    // A value takes at least one byte: a damaged file can't ask for much more memory than it has
    // bytes.
    let mut values = Vec::with_capacity(height.min(rest.bytes.len()));
    for _ in 0..height {
        let count = last
            .checked_add(step)?
            .checked_add(unzigzag(rest.varint()?))?;
        (last, step) = (count, count.checked_sub(last)?);
        values.push(of_grains(i32::try_from(count).ok()?, grain));
    }
    Some(values)
}

fn decode_bits(height: usize, rest: &mut ByteReader<'_>) -> Option<Vec<f32>> {
    let planes = [
        rest.take(height)?,
        rest.take(height)?,
        rest.take(height)?,
        rest.take(height)?,
    ];
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

/// Returns the values as counts of the first grain of which all are multiples, with the index of
/// that grain.
fn counts_of(values: &[f32]) -> Option<(u8, Vec<i32>)> {
    (0u8..).zip(GRAINS).find_map(|(kind, grain)| {
        let counts = values
            .iter()
            .map(|value| in_grains(*value, grain))
            .collect::<Option<Vec<i32>>>()?;
        Some((kind, counts))
    })
}

/// Returns a value as a count of grains, or `None` if it is not an exact multiple.
fn in_grains(value: f32, grain: f64) -> Option<i32> {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a value that does not round-trip is rejected below"
    )]
    let count = (f64::from(value) / grain).round() as i32;
    (of_grains(count, grain) == value).then_some(count)
}

#[expect(clippy::cast_possible_truncation, reason = "values are `f32`")]
fn of_grains(count: i32, grain: f64) -> f32 {
    (f64::from(count) * grain) as f32
}

fn put(out: &mut Vec<u8>, value: usize) {
    put_varint(out, value as u64);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bits(rows: &[Vec<f32>]) -> Vec<Vec<u32>> {
        rows.iter()
            .map(|row| row.iter().map(|value| value.to_bits()).collect())
            .collect()
    }

    #[test]
    fn encoding_is_lossless() {
        let wild = [
            f32::NAN,
            f32::INFINITY,
            -0.0,
            f32::MIN,
            1e-40,
            0.1,
            -7.25,
            3.0e38,
        ];
        let tables = [
            Vec::new(),
            vec![Vec::new(); 3],
            (0..50)
                .map(|i| {
                    vec![
                        i as f32 * 0.125,
                        0.5,
                        (i as f32).sin(),
                        wild[i % 8],
                        i as f32 * 1e-4,
                    ]
                })
                .collect(),
            vec![vec![1.0], vec![1.0, 2.0], Vec::new()],
        ];
        for rows in tables {
            assert_eq!(
                bits(&decode(&encode(&rows)).expect("it was just encoded")),
                bits(&rows)
            );
            let followed = [encode(&rows), vec![9]].concat();
            assert_eq!(skip_next(&followed), Some([9].as_slice()));
        }
    }

    #[test]
    fn corrupt_data_is_rejected_or_decodes_without_panic() {
        let rows: Vec<Vec<f32>> = (0..50)
            .map(|i| vec![i as f32 * 0.125, (i as f32).sin()])
            .collect();
        let bytes = encode(&rows);
        for end in 0..bytes.len() {
            assert!(
                decode(&bytes[..end]).is_none() && skip_next(&bytes[..end]).is_none(),
                "{end}"
            );
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
            let rows: Vec<Vec<f32>> = (0..400)
                .map(|i| vec![round((f64::from(i) * 0.02).sin())])
                .collect();
            assert!(encode(&rows).len() < 450, "{}", encode(&rows).len());
            assert_eq!(decode(&encode(&rows)).expect("it was just encoded"), rows);
        }
    }
}
