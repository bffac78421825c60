//! The values of one property in a file of outlines: nodes of the run itself, or a list of distinct
//! values with codes.

use std::cmp::Ordering;

use oxigraph::model::vocab::xsd;
use oxigraph::model::{Literal, Term};

use crate::journal::{Written, read_term, written};
use actcheck_base::{ByteReader, put_varint, unzigzag, zigzag};

/// Kinds of columns: nodes of the same run, and values that are all doubles, all integers, or any.
const NODES: u8 = 0;
const DOUBLES: u8 = 1;
const INTEGERS: u8 = 2;
const TERMS: u8 = 3;
/// Bytes of a double.
const WIDTH: usize = 8;

/// A value that is not a node of its run.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) enum Value {
    /// The bits of a double.
    Double(u64),
    Integer(i64),
    Boolean(bool),
    /// Any other term.
    Term(Term),
}

impl Value {
    /// The value of a term, from which the same term can be made.
    pub(crate) fn of(term: &Term) -> Self {
        if let Term::Literal(literal) = term
            && literal.language().is_none()
        {
            let text = literal.value();
            let value = match literal.datatype() {
                xsd::DOUBLE => text
                    .parse::<f64>()
                    .ok()
                    .map(|number| Self::Double(number.to_bits())),
                xsd::INTEGER => text.parse().ok().map(Self::Integer),
                xsd::BOOLEAN => text.parse().ok().map(Self::Boolean),
                _ => None,
            };
            if let Some(value) = value.filter(|value| value.term() == *term) {
                return value;
            }
        }
        Self::Term(term.clone())
    }

    /// An order of IRIs, integers and doubles; all others are equal.
    pub(super) fn rough_order(&self, other: &Self) -> Ordering {
        let rank = |value: &Self| match value {
            Self::Term(Term::NamedNode(_)) => 0,
            Self::Integer(_) => 1,
            Self::Double(_) => 2,
            Self::Boolean(_) | Self::Term(_) => 3,
        };
        match (self, other) {
            (Self::Term(Term::NamedNode(one)), Self::Term(Term::NamedNode(other))) => {
                one.as_str().cmp(other.as_str())
            }
            (Self::Integer(one), Self::Integer(other)) => one.cmp(other),
            (Self::Double(one), Self::Double(other)) => {
                f64::from_bits(*one).total_cmp(&f64::from_bits(*other))
            }
            _ => rank(self).cmp(&rank(other)),
        }
    }

    /// Its term.
    pub(crate) fn term(&self) -> Term {
        match self {
            Self::Double(bits) => Literal::from(f64::from_bits(*bits)).into(),
            Self::Integer(number) => Literal::from(*number).into(),
            Self::Boolean(value) => Literal::from(*value).into(),
            Self::Term(term) => term.clone(),
        }
    }
}

/// The values of one property, in the order of the statements.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Column {
    /// Nodes of the run itself, by their numbers in the file.
    Nodes(Vec<u32>),
    /// Values, some of which may be equal, and the code of each statement's value.
    Values { values: Vec<Value>, codes: Vec<u32> },
}

impl Column {
    /// Encodes it; `subjects` has the subject of each statement.
    pub(super) fn encode(&self, subjects: &[u32]) -> Result<Vec<u8>, String> {
        let mut out = Vec::new();
        match self {
            Self::Nodes(nodes) => {
                out.push(NODES);
                for (node, subject) in nodes.iter().zip(subjects) {
                    put_varint(&mut out, zigzag(i64::from(*node) - i64::from(*subject)));
                }
            }
            Self::Values { values, codes } => {
                encode_values(values, &mut out)?;
                let in_order = codes.iter().copied().eq(0..values.len() as u32);
                out.push(u8::from(in_order));
                if !in_order {
                    codes
                        .iter()
                        .for_each(|code| put_varint(&mut out, u64::from(*code)));
                }
            }
        }
        Ok(out)
    }

    /// Decodes it. Returns `None` if the bytes are damaged. `nodes`: number of nodes in the file.
    pub(super) fn decode(bytes: &[u8], subjects: &[u32], nodes: u32) -> Option<Self> {
        let mut reader = ByteReader { bytes };
        let kind = reader.byte()?;
        let count = subjects.len();
        if kind == NODES {
            let of = |subject: &u32| {
                let node = i64::from(*subject).checked_add(unzigzag(reader.varint()?))?;
                u32::try_from(node).ok().filter(|node| *node < nodes)
            };
            return Some(Self::Nodes(subjects.iter().map(of).collect::<Option<_>>()?));
        }
        let values = decode_values(kind, &mut reader)?;
        let most = values.len() as u64;
        let codes = match reader.byte()? {
            1 => (count == values.len()).then(|| (0..count as u32).collect())?,
            _ => (0..count)
                .map(|_| {
                    reader
                        .varint()
                        .filter(|code| *code < most)
                        .map(|code| code as u32)
                })
                .collect::<Option<_>>()?,
        };
        Some(Self::Values { values, codes })
    }
}

fn encode_values(values: &[Value], out: &mut Vec<u8>) -> Result<(), String> {
    let doubles: Option<Vec<[u8; WIDTH]>> = values
        .iter()
        .map(|value| {
            if let Value::Double(bits) = value {
                Some(bits.to_be_bytes())
            } else {
                None
            }
        })
        .collect();
    let integers: Option<Vec<i64>> = values
        .iter()
        .map(|value| {
            if let Value::Integer(number) = value {
                Some(*number)
            } else {
                None
            }
        })
        .collect();
    if let Some(doubles) = doubles {
        out.push(DOUBLES);
        put_varint(out, doubles.len() as u64);
        // The first bytes of all numbers are alike, the last ones are not.
        (0..WIDTH).for_each(|at| out.extend(doubles.iter().map(|bytes| bytes[at])));
    } else if let Some(integers) = integers {
        out.push(INTEGERS);
        put_varint(out, integers.len() as u64);
        let mut last = 0i64;
        for number in integers {
            put_varint(out, zigzag(number.wrapping_sub(last)));
            last = number;
        }
    } else {
        out.push(TERMS);
        let terms: Vec<Term> = values.iter().map(Value::term).collect();
        let terms: Vec<Written<'_>> = terms.iter().map(|term| written(term.as_ref())).collect();
        let bytes = postcard::to_stdvec(&terms).map_err(|error| error.to_string())?;
        put_varint(out, bytes.len() as u64);
        out.extend(bytes);
    }
    Ok(())
}

fn decode_values(kind: u8, reader: &mut ByteReader<'_>) -> Option<Vec<Value>> {
    let size = reader.size()?;
    match kind {
        DOUBLES => {
            let planes = reader.take(size.checked_mul(WIDTH)?)?;
            let double = |at: usize| {
                u64::from_be_bytes(std::array::from_fn(|plane| planes[plane * size + at]))
            };
            Some((0..size).map(|at| Value::Double(double(at))).collect())
        }
        INTEGERS => {
            if size > reader.bytes.len() {
                return None;
            }
            let mut last = 0i64;
            let mut next = || {
                last = last.wrapping_add(unzigzag(reader.varint()?));
                Some(Value::Integer(last))
            };
            (0..size).map(|_| next()).collect()
        }
        TERMS => {
            let terms: Vec<Written<'_>> = postcard::from_bytes(reader.take(size)?).ok()?;
            Some(
                terms
                    .into_iter()
                    .map(|term| Value::of(&read_term(term)))
                    .collect(),
            )
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use oxigraph::model::NamedNode;

    fn sample() -> Vec<Column> {
        let values = |terms: Vec<Term>, codes: Vec<u32>| Column::Values {
            values: terms.iter().map(Value::of).collect(),
            codes,
        };
        let typed = |text: &str, datatype| Term::from(Literal::new_typed_literal(text, datatype));
        vec![
            Column::Nodes(vec![4, 0, 2]),
            values(
                vec![Literal::from(0.1).into(), Literal::from(f64::NAN).into()],
                vec![1, 0, 0],
            ),
            values(
                (0..3)
                    .map(|n| Literal::from(f64::from(n) / 7.0).into())
                    .collect(),
                vec![0, 1, 2],
            ),
            values(
                vec![
                    Literal::from(i64::MIN).into(),
                    Literal::from(i64::MAX).into(),
                ],
                vec![0, 0, 1],
            ),
            values(
                vec![
                    NamedNode::new_unchecked("http://a").into(),
                    typed("1.0", xsd::DOUBLE),
                    typed("+1", xsd::INTEGER),
                    Literal::from(true).into(),
                    Literal::from(1.0).into(),
                    Literal::new_language_tagged_literal_unchecked("Glas", "de").into(),
                ],
                vec![5, 1, 2],
            ),
            values(Vec::new(), Vec::new()),
        ]
    }

    #[test]
    fn columns_are_decoded_as_they_were() {
        for column in sample() {
            let subjects: &[u32] = if matches!(&column, Column::Values { codes, .. } if codes.is_empty())
            {
                &[]
            } else {
                &[1, 2, 3]
            };
            let bytes = column.encode(subjects).expect("it can be encoded");
            assert_eq!(Column::decode(&bytes, subjects, 5), Some(column));
        }
    }

    #[test]
    fn damaged_columns_do_not_panic() {
        for column in sample() {
            let bytes = column.encode(&[1, 2, 3]).expect("it can be encoded");
            for at in 0..bytes.len() {
                drop(Column::decode(&bytes[..at], &[1, 2, 3], 5));
                for flipped in [1u8, 0x80, 0xff] {
                    let mut bytes = bytes.clone();
                    bytes[at] ^= flipped;
                    drop(Column::decode(&bytes, &[1, 2, 3], 5));
                }
            }
        }
    }
}
