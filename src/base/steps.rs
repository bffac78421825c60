//! Integers over time that stay encoded until they are read.

use std::ops::{Deref, DerefMut, Range};
use std::sync::{Arc, OnceLock};

use crate::varint::{ByteReader, put_varint, unzigzag, zigzag};

/// Maximum number of values of one series: limits the memory that a corrupt file can request. A
/// long run has under a million.
const MOST_VALUES: usize = 1 << 26;

const CONSTANT: u8 = 0;
const VARYING: u8 = 1;

/// Samples of one quantity, as numbers of steps of its resolution.
///
/// It is used as a slice. Samples of a stored run stay encoded until they are first read, because
/// rules read few of the series of a run.
#[derive(Debug, Default)]
pub struct Steps {
    encoded: Option<Encoded>,
    values: OnceLock<Vec<i32>>,
}

/// Values as they are in the file of a run: a part of bytes that all series of the run share.
#[derive(Debug, Clone)]
struct Encoded {
    count: usize,
    bytes: Arc<Vec<u8>>,
    part: Range<usize>,
}

impl Steps {
    /// Appends a value.
    pub fn push(&mut self, value: i32) {
        self.vec_mut().push(value);
    }

    /// Appends the encoded values to `out`: each as its difference from a prediction.
    pub fn encode(&self, out: &mut Vec<u8>) {
        if let Some(Encoded { bytes, part, .. }) = &self.encoded {
            return out.extend(&bytes[part.clone()]);
        }
        if let [first, rest @ ..] = &**self
            && rest.iter().all(|value| value == first)
        {
            out.push(CONSTANT);
            return put_varint(out, zigzag(i64::from(*first)));
        }
        out.push(VARYING);
        let (mut last, mut step) = (0i64, 0i64);
        for value in self.iter().copied().map(i64::from) {
            // Bodies move smoothly: the prediction repeats the last step.
            put_varint(out, zigzag(value - (last + step)));
            (last, step) = (value, value - last);
        }
    }

    /// Returns the `count` values that [`Steps::encode`] wrote at a position of `bytes`, and the
    /// position after them. Returns `None` if there are too few bytes for as many values.
    pub fn encoded(count: usize, bytes: &Arc<Vec<u8>>, at: usize) -> Option<(Self, usize)> {
        if count > MOST_VALUES {
            return None;
        }
        let mut rest = ByteReader {
            bytes: bytes.get(at..)?,
        };
        let numbers = if rest.byte()? == CONSTANT { 1 } else { count };
        rest.skip_varints(numbers)?;
        let end = bytes.len() - rest.bytes.len();
        let encoded = Encoded {
            count,
            bytes: Arc::clone(bytes),
            part: at..end,
        };
        Some((
            Self {
                encoded: Some(encoded),
                values: OnceLock::new(),
            },
            end,
        ))
    }

    fn vec_mut(&mut self) -> &mut Vec<i32> {
        if self.encoded.is_some() || self.values.get().is_none() {
            let values = std::mem::take(&mut self.values).into_inner();
            let values = values
                .or_else(|| Some(self.encoded.take()?.decoded()))
                .unwrap_or_default();
            *self = Self::from(values);
        }
        self.values.get_mut().expect("it has values")
    }
}

impl Encoded {
    /// Decodes the values. The file's checksum was checked when it was read: numbers that can't be
    /// encoded values become zero.
    fn decoded(&self) -> Vec<i32> {
        let mut rest = ByteReader {
            bytes: &self.bytes[self.part.clone()],
        };
        let kind = rest.byte();
        let mut next = || rest.varint().map_or(0, unzigzag);
        let narrow = |value: i64| i32::try_from(value).unwrap_or(0);
        if kind == Some(CONSTANT) {
            return vec![narrow(next()); self.count];
        }
        let (mut last, mut step) = (0i64, 0i64);
        let values = (0..self.count).map(|_| {
            let value = last.wrapping_add(step).wrapping_add(next());
            (last, step) = (value, value.wrapping_sub(last));
            narrow(value)
        });
        values.collect()
    }
}

impl Deref for Steps {
    type Target = [i32];

    fn deref(&self) -> &[i32] {
        self.values.get_or_init(|| {
            self.encoded
                .as_ref()
                .map_or_else(Vec::new, Encoded::decoded)
        })
    }
}

impl DerefMut for Steps {
    fn deref_mut(&mut self) -> &mut [i32] {
        self.vec_mut()
    }
}

impl Clone for Steps {
    /// Encoded values stay encoded: their bytes are shared.
    fn clone(&self) -> Self {
        match &self.encoded {
            Some(encoded) => Self {
                encoded: Some(encoded.clone()),
                values: OnceLock::new(),
            },
            None => Self::from(self.to_vec()),
        }
    }
}

impl PartialEq for Steps {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl From<Vec<i32>> for Steps {
    fn from(values: Vec<i32>) -> Self {
        Self {
            encoded: None,
            values: OnceLock::from(values),
        }
    }
}

impl FromIterator<i32> for Steps {
    fn from_iter<T: IntoIterator<Item = i32>>(values: T) -> Self {
        Self::from(values.into_iter().collect::<Vec<i32>>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_read_back_from_their_bytes() {
        let all = [
            vec![],
            vec![7; 900],
            vec![i32::MIN, i32::MAX, 0, -1, i32::MIN],
            (0..1300).map(|idx| idx * idx / 50 - 700).collect(),
        ];
        let mut bytes = vec![9, 9];
        all.iter()
            .for_each(|values| Steps::from(values.clone()).encode(&mut bytes));
        let bytes = Arc::new(bytes);
        let mut at = 2;
        for values in all {
            let steps;
            let start = at;
            (steps, at) = Steps::encoded(values.len(), &bytes, at).expect("it was just encoded");
            assert_eq!(*steps, *values);
            let mut again = Vec::new();
            steps.clone().encode(&mut again);
            assert_eq!(again, bytes[start..at]);
            let mut longer = steps.clone();
            longer.push(3);
            assert_eq!(*longer, [values.as_slice(), &[3]].concat());
            for end in start..at {
                let cut = Arc::new(bytes[..end].to_vec());
                assert!(
                    values.is_empty() || Steps::encoded(values.len(), &cut, start).is_none(),
                    "{end}"
                );
            }
        }
        assert_eq!(at, bytes.len());
        assert!(Steps::encoded(usize::MAX, &Arc::new(vec![CONSTANT, 0]), 0).is_none());
    }

    #[test]
    fn corrupt_bytes_give_other_numbers_without_a_panic() {
        let mut bytes = Vec::new();
        Steps::from_iter((0..50).map(|idx| idx * idx)).encode(&mut bytes);
        for at in 0..bytes.len() {
            for flip in [0xff, 0x80, 0x7f] {
                let mut bytes = bytes.clone();
                bytes[at] ^= flip;
                if let Some((steps, _)) = Steps::encoded(50, &Arc::new(bytes), 0) {
                    assert_eq!(steps.len(), 50);
                }
            }
        }
        let long = Arc::new([vec![VARYING], vec![0xff; 30], vec![1, 1, 1]].concat());
        let (steps, _) = Steps::encoded(3, &long, 0).expect("three numbers end there");
        assert_eq!(steps.len(), 3);
    }
}
