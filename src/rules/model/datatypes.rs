//! Literals by value, as OWL 2 compares them: <https://www.w3.org/TR/owl2-syntax/#Datatype_Maps>.

use crate::model::datetime;
use crate::model::values::{decimal, text_len};
use actcheck_base::{Term, names};

/// The integer types with their least and greatest values.
const INTEGERS: [(&str, Option<i128>, Option<i128>); 13] = [
    ("integer", None, None),
    ("nonNegativeInteger", Some(0), None),
    ("positiveInteger", Some(1), None),
    ("nonPositiveInteger", None, Some(0)),
    ("negativeInteger", None, Some(-1)),
    ("long", Some(i64::MIN as i128), Some(i64::MAX as i128)),
    ("int", Some(i32::MIN as i128), Some(i32::MAX as i128)),
    ("short", Some(i16::MIN as i128), Some(i16::MAX as i128)),
    ("byte", Some(i8::MIN as i128), Some(i8::MAX as i128)),
    ("unsignedLong", Some(0), Some(u64::MAX as i128)),
    ("unsignedInt", Some(0), Some(u32::MAX as i128)),
    ("unsignedShort", Some(0), Some(u16::MAX as i128)),
    ("unsignedByte", Some(0), Some(u8::MAX as i128)),
];

/// The other types of XML Schema in OWL 2.
const OTHERS: [&str; 16] = [
    "decimal",
    "float",
    "double",
    "boolean",
    "string",
    "normalizedString",
    "token",
    "language",
    "Name",
    "NCName",
    "NMTOKEN",
    "hexBinary",
    "base64Binary",
    "anyURI",
    "dateTime",
    "dateTimeStamp",
];

/// Longer literals are compared as they are. Unit: bytes.
const LONGEST: usize = 1 << 20;

/// Returns the term that represents a literal's value: equal values have equal terms. Returns
/// `None` if the literal is ill-typed or its datatype is unknown.
pub(crate) fn canonical(term: &Term) -> Option<Term> {
    match term {
        Term::Iri(_) | Term::Blank(_) => None,
        Term::LangString(text, tag) => Some(Term::LangString(
            text.clone(),
            tag.to_ascii_lowercase().into(),
        )),
        Term::Decimal(text) => number(text),
        Term::Literal(text, _) if text.len() > LONGEST => None,
        Term::Literal(text, datatype) => match local(datatype)? {
            Local::Xsd(name) => of_schema(text, name),
            Local::PlainLiteral => Some(match text.rsplit_once('@') {
                Some((text, "")) => Term::string(text),
                Some((text, tag)) => Term::LangString(text.into(), tag.to_ascii_lowercase().into()),
                None => return None,
            }),
            Local::XmlLiteral => Some(term.clone()),
            Local::LangString | Local::Any => None,
        },
        Term::String(_) | Term::Integer(_) | Term::Double(_) | Term::Boolean(_) => {
            Some(term.clone())
        }
    }
}

/// Returns whether the value of a literal belongs to a datatype. Returns `None` if either datatype
/// is unknown.
pub(crate) fn belongs(term: &Term, datatype: &str) -> Option<bool> {
    let wanted = local(datatype)?;
    let Some(value) = canonical(term) else {
        let Term::Literal(text, own) = term else {
            return None;
        };
        // An ill-typed literal has no value.
        return (local(own).is_some() && text.len() <= LONGEST).then_some(false);
    };
    let name = match wanted {
        Local::Any => return Some(true),
        Local::PlainLiteral => {
            return Some(matches!(value, Term::String(_) | Term::LangString(..)));
        }
        Local::LangString => return Some(matches!(value, Term::LangString(..))),
        Local::XmlLiteral => {
            return Some(
                matches!(&value, Term::Literal(_, own) if matches!(local(own), Some(Local::XmlLiteral))),
            );
        }
        Local::Xsd(name) => name,
    };
    Some(match &value {
        Term::Integer(value) => name == "decimal" || in_range(i128::from(*value), name),
        Term::Decimal(_) => name == "decimal",
        Term::Double(_) => name == "double",
        Term::Boolean(_) => name == "boolean",
        Term::String(text) => of_string(text, name),
        Term::Literal(text, own) => match own.strip_prefix(names::XSD) {
            Some("integer") => name == "decimal" || beyond(text, name),
            Some("dateTime") => {
                name == "dateTime" || (name == "dateTimeStamp" && datetime::has_zone(text))
            }
            Some(own) => name == own,
            None => false,
        },
        _ => false,
    })
}

/// A datatype of OWL 2.
enum Local<'a> {
    /// By its name in XML Schema.
    Xsd(&'a str),
    PlainLiteral,
    XmlLiteral,
    LangString,
    /// `rdfs:Literal`
    Any,
}

/// Returns a datatype of OWL 2, or `None` for another one.
fn local(datatype: &str) -> Option<Local<'_>> {
    if let Some(name) = datatype.strip_prefix(names::XSD) {
        let known = OTHERS.contains(&name) || INTEGERS.iter().any(|(known, ..)| *known == name);
        return known.then_some(Local::Xsd(name));
    }
    match (
        datatype.strip_prefix(names::RDF),
        datatype.strip_prefix(names::RDFS),
    ) {
        (Some("PlainLiteral"), _) => Some(Local::PlainLiteral),
        (Some("XMLLiteral"), _) => Some(Local::XmlLiteral),
        (Some("langString"), _) => Some(Local::LangString),
        (_, Some("Literal")) => Some(Local::Any),
        _ => None,
    }
}

/// Returns the value of a lexical form. Returns `None` if the form is invalid.
fn of_schema(text: &str, name: &str) -> Option<Term> {
    let typed = |text: String, name: &str| {
        Term::Literal(text.into(), format!("{}{name}", names::XSD).into())
    };
    let collapsed = collapse(text);
    match name {
        "string" => Some(Term::string(text)),
        "normalizedString" => Some(Term::string(text.replace(['\t', '\n', '\r'], " "))),
        "token" | "language" | "Name" | "NCName" | "NMTOKEN" => {
            of_string(&collapsed, name).then(|| Term::string(collapsed))
        }
        "boolean" => match collapsed.as_str() {
            "true" | "1" => Some(Term::Boolean(true)),
            "false" | "0" => Some(Term::Boolean(false)),
            _ => None,
        },
        "decimal" => number(&collapsed),
        "double" => float(&collapsed).map(Term::Double),
        "float" => float(&collapsed)
            .and_then(|_| match collapsed.as_str() {
                "INF" | "+INF" => Some(f32::INFINITY),
                "-INF" => Some(f32::NEG_INFINITY),
                // Rounded once, not by way of a double.
                text => text.parse().ok(),
            })
            .map(|value: f32| typed(value.to_string(), name)),
        "hexBinary" => {
            let valid = collapsed.len().is_multiple_of(2)
                && collapsed.bytes().all(|byte| byte.is_ascii_hexdigit());
            valid.then(|| typed(collapsed.to_ascii_uppercase(), name))
        }
        "base64Binary" => base64(&collapsed).map(|text| typed(text, name)),
        "anyURI" => (!collapsed.contains(' ')).then(|| typed(collapsed, name)),
        "dateTime" | "dateTimeStamp" => {
            let moment = datetime::canonical(&collapsed)?;
            (name == "dateTime" || datetime::has_zone(&moment)).then(|| typed(moment, "dateTime"))
        }
        _ => {
            let value = (!collapsed.contains('.'))
                .then(|| number(&collapsed))
                .flatten()?;
            let fits = match &value {
                Term::Integer(value) => in_range(i128::from(*value), name),
                Term::Literal(text, _) => beyond(text, name),
                _ => false,
            };
            fits.then_some(value)
        }
    }
}

/// Returns the value of a decimal; whole numbers are integers of any length.
fn number(text: &str) -> Option<Term> {
    let canonical = decimal(text)?;
    Some(match canonical.parse() {
        Ok(value) => Term::Integer(value),
        Err(_) if canonical.contains('.') => Term::Decimal(canonical.into()),
        Err(_) => Term::Literal(canonical.into(), format!("{}integer", names::XSD).into()),
    })
}

/// Returns whether an integer belongs to an integer type; `false` for other types.
fn in_range(value: i128, name: &str) -> bool {
    INTEGERS.iter().any(|(known, least, most)| {
        *known == name
            && least.is_none_or(|least| least <= value)
            && most.is_none_or(|most| value <= most)
    })
}

/// Returns whether a canonical integer beyond 64 bits belongs to an integer type.
fn beyond(text: &str, name: &str) -> bool {
    let huge = if text.starts_with('-') {
        i128::MIN
    } else {
        i128::MAX
    };
    in_range(text.parse().unwrap_or(huge), name)
}

fn float(text: &str) -> Option<f64> {
    match text {
        "INF" | "+INF" => Some(f64::INFINITY),
        "-INF" => Some(f64::NEG_INFINITY),
        "NaN" => Some(f64::NAN),
        _ if text
            .bytes()
            .all(|byte| byte.is_ascii_digit() || b"+-.eE".contains(&byte)) =>
        {
            text.parse().ok()
        }
        _ => None,
    }
}

/// Replaces every run of spaces, tabs and line ends by one space, and removes those at both ends.
fn collapse(text: &str) -> String {
    text.split([' ', '\t', '\n', '\r'])
        .filter(|part| !part.is_empty())
        .collect::<Vec<_>>()
        .join(" ")
}

/// Returns whether a string belongs to `xsd:string` or a type derived from it; `false` for other
/// types.
fn of_string(text: &str, name: &str) -> bool {
    let first = |c: char| c.is_alphabetic() || c == '_';
    let later = |c: char| {
        c.is_alphanumeric() || "_-.\u{b7}".contains(c) || ('\u{300}'..='\u{36f}').contains(&c)
    };
    let begins = |allowed: &dyn Fn(char) -> bool| text.chars().next().is_some_and(allowed);
    match name {
        "string" => true,
        "normalizedString" => !text.contains(['\t', '\n', '\r']),
        "token" => {
            collapse(text).len() == text_len(&Term::string(text))
                && !text.contains(['\t', '\n', '\r'])
        }
        "language" => text.split('-').enumerate().all(|(idx, part)| {
            let allowed =
                |byte: u8| byte.is_ascii_alphabetic() || (idx > 0 && byte.is_ascii_digit());
            (1..=8).contains(&part.len()) && part.bytes().all(allowed)
        }),
        "NMTOKEN" => !text.is_empty() && text.chars().all(|c| later(c) || c == ':'),
        "Name" => begins(&|c| first(c) || c == ':') && text.chars().all(|c| later(c) || c == ':'),
        "NCName" => begins(&first) && text.chars().all(later),
        _ => false,
    }
}

/// Returns the base 64 text without spaces. Returns `None` if it is invalid.
fn base64(text: &str) -> Option<String> {
    let text: String = text.split(' ').collect();
    let digits = text.trim_end_matches('=');
    let padding = text.len() - digits.len();
    let alphabet = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let value = |byte: u8| alphabet.iter().position(|letter| *letter == byte);
    if !text.len().is_multiple_of(4)
        || padding > 2
        || !digits.bytes().all(|byte| value(byte).is_some())
    {
        return None;
    }
    // The bits of the last digit that belong to no byte are zero.
    let unused = [1, 4, 16][padding];
    let last = digits.bytes().last().and_then(value);
    last.is_none_or(|last| last % unused == 0).then_some(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn typed(text: &str, name: &str) -> Term {
        Term::Literal(text.into(), format!("{}{name}", names::XSD).into())
    }

    #[test]
    fn literals_of_equal_value_have_one_canonical_term() {
        for (a, b) in [
            (typed("a", "token"), Term::string("a")),
            (typed(" a \n b ", "token"), Term::string("a b")),
            (typed("a\tb", "normalizedString"), Term::string("a b")),
            (typed("ff", "hexBinary"), typed("FF", "hexBinary")),
            (
                typed("Zg ==", "base64Binary"),
                typed("Zg==", "base64Binary"),
            ),
            (typed("5", "int"), Term::Integer(5)),
            (typed("+05", "unsignedByte"), Term::Integer(5)),
            (Term::Decimal("2.0".into()), Term::Integer(2)),
            (typed("1.50", "decimal"), Term::Decimal("1.5".into())),
            (typed("1.0", "float"), typed("1", "float")),
            (
                typed("99999999999999999999", "integer"),
                typed("+099999999999999999999", "nonNegativeInteger"),
            ),
            (typed(" 1 ", "boolean"), Term::Boolean(true)),
            (
                typed("2026-01-02T03:04:05.500Z", "dateTime"),
                typed("2026-01-02T03:04:05.5+00:00", "dateTimeStamp"),
            ),
            (
                typed("2026-02-28T24:00:00", "dateTime"),
                typed("2026-03-01T00:00:00", "dateTime"),
            ),
            (
                Term::LangString("a".into(), "EN".into()),
                Term::LangString("a".into(), "en".into()),
            ),
            (
                Term::Literal("a@en".into(), format!("{}PlainLiteral", names::RDF).into()),
                Term::LangString("a".into(), "en".into()),
            ),
        ] {
            assert!(
                canonical(&a).is_some() && canonical(&a) == canonical(&b),
                "{a}: {:?}, {b}: {:?}",
                canonical(&a),
                canonical(&b)
            );
        }
    }

    #[test]
    fn literals_of_different_value_differ() {
        for (a, b) in [
            (Term::Integer(1), Term::Double(1.0)),
            (typed("1", "float"), Term::Double(1.0)),
            (Term::string("a"), Term::LangString("a".into(), "en".into())),
            (typed("a", "anyURI"), Term::string("a")),
            (typed("00", "hexBinary"), typed("AAAA", "base64Binary")),
            (Term::Double(0.0), Term::Double(-0.0)),
            (
                typed("2026-01-02T03:04:05Z", "dateTime"),
                typed("2026-01-02T03:04:05", "dateTime"),
            ),
        ] {
            assert!(
                canonical(&a).is_some()
                    && canonical(&b).is_some()
                    && canonical(&a) != canonical(&b),
                "{a} and {b}"
            );
        }
    }

    #[test]
    fn ill_typed_literals_have_no_value_and_belong_to_no_type() {
        for (text, name) in [
            ("300", "byte"),
            ("-1", "unsignedLong"),
            ("18446744073709551616", "unsignedLong"),
            ("1.5", "integer"),
            ("x", "decimal"),
            ("1e", "double"),
            ("yes", "boolean"),
            ("a b", "NCName"),
            (":a", "NCName"),
            ("1a", "Name"),
            ("", "NMTOKEN"),
            ("english-languages", "language"),
            ("f", "hexBinary"),
            ("Zh==", "base64Binary"),
            ("Zg=", "base64Binary"),
            ("2026-02-30T00:00:00Z", "dateTime"),
            ("2026-01-01", "dateTime"),
            ("2026-01-01T00:00:00", "dateTimeStamp"),
            ("inf", "double"),
        ] {
            let term = typed(text, name);
            assert_eq!(canonical(&term), None, "{term}");
            assert_eq!(
                belongs(&term, &format!("{}{name}", names::XSD)),
                Some(false),
                "{term}"
            );
        }
        assert_eq!(
            belongs(
                &Term::Literal("x".into(), "http://x/own".into()),
                &format!("{}string", names::XSD)
            ),
            None
        );
        assert_eq!(belongs(&Term::Integer(1), "http://x/own"), None);
    }

    #[test]
    fn values_belong_to_the_types_that_contain_them() {
        for (term, within, outside) in [
            (
                Term::Integer(200),
                "decimal integer short unsignedByte positiveInteger",
                "byte negativeInteger double string",
            ),
            (
                typed("18446744073709551615", "integer"),
                "unsignedLong decimal",
                "long unsignedInt",
            ),
            (
                Term::string("en"),
                "string token language Name NCName NMTOKEN",
                "anyURI integer",
            ),
            (Term::string(" a"), "string normalizedString", "token"),
            (Term::string("a:b"), "Name NMTOKEN", "NCName language"),
            (
                Term::LangString("a".into(), "en".into()),
                "",
                "string token",
            ),
            (
                Term::Decimal("1.5".into()),
                "decimal",
                "integer double float",
            ),
            (
                typed("2026-01-02T03:04:05Z", "dateTime"),
                "dateTime dateTimeStamp",
                "string",
            ),
            (
                typed("2026-01-02T03:04:05", "dateTime"),
                "dateTime",
                "dateTimeStamp",
            ),
        ] {
            let of = |name: &str| belongs(&term, &format!("{}{name}", names::XSD));
            assert!(
                within.split_whitespace().all(|name| of(name) == Some(true)),
                "{term}: {within}"
            );
            assert!(
                outside
                    .split_whitespace()
                    .all(|name| of(name) == Some(false)),
                "{term}: not {outside}"
            );
            assert_eq!(
                belongs(&term, &format!("{}Literal", names::RDFS)),
                Some(true)
            );
        }
    }
}
