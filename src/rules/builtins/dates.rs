//! Parts of dates and times: <https://www.w3.org/TR/sparql11-query/#func-date-time>.

use crate::builtins::Value;
use crate::model::datetime;
use crate::model::values::literal;
use actcheck_base::{Term, names};

/// The parts of a moment, as text; empty if its datatype has none.
struct DateParts {
    date: String,
    time: String,
    /// `Z`, `+02:00`, or empty.
    zone: String,
}

/// Returns the parts of an `xsd:dateTime`, `xsd:date` or `xsd:time`.
fn parts(term: &Term) -> Option<DateParts> {
    let Term::Literal(text, datatype) = term else {
        return None;
    };
    let kind = datatype.strip_prefix(names::XSD)?;
    let whole = match kind {
        "dateTime" | "dateTimeStamp" => text.to_string(),
        "date" => {
            // A negative year begins with the sign.
            let zone = text
                .char_indices()
                .skip(8)
                .find(|(_, c)| "Z+-".contains(*c) && text.len() > 10);
            let zone = zone
                .filter(|(at, c)| *c != '-' || text[*at..].contains(':'))
                .map_or(text.len(), |(at, _)| at);
            format!("{}T00:00:00{}", &text[..zone], &text[zone..])
        }
        "time" => format!("2000-01-01T{text}"),
        _ => return None,
    };
    let whole = datetime::canonical(&whole)?;
    let (date, time) = whole.split_once('T')?;
    let (time, zone) = time.split_at(time.find(['Z', '+', '-']).unwrap_or(time.len()));
    let of = |wanted: bool, part: &str| {
        if wanted {
            part.to_owned()
        } else {
            String::new()
        }
    };
    Some(DateParts {
        date: of(kind != "time", date),
        time: of(kind != "date", time),
        zone: zone.to_owned(),
    })
}

/// Returns a part of the date, counted from its end.
fn of_date(args: &[Value<'_>], from_end: usize) -> Option<Term> {
    let date = parts(&args[0])?.date;
    let mut parts = date.rsplit('-');
    let found = parts.nth(from_end)?.parse::<i64>().ok()?;
    // Only a negative year leaves an empty part before it.
    Some(Term::Integer(if from_end == 2 && parts.next().is_some() {
        -found
    } else {
        found
    }))
}

pub(super) fn year(args: &[Value<'_>]) -> Option<Term> {
    of_date(args, 2)
}

pub(super) fn month(args: &[Value<'_>]) -> Option<Term> {
    of_date(args, 1)
}

pub(super) fn day(args: &[Value<'_>]) -> Option<Term> {
    of_date(args, 0)
}

/// Returns a part of the time, as a decimal.
fn of_time(args: &[Value<'_>], at: usize) -> Option<Term> {
    let time = parts(&args[0])?.time;
    let part = time.split(':').nth(at).filter(|part| !part.is_empty())?;
    Some(literal(part, &format!("{}decimal", names::XSD)))
}

pub(super) fn hours(args: &[Value<'_>]) -> Option<Term> {
    of_time(args, 0)
}

pub(super) fn minutes(args: &[Value<'_>]) -> Option<Term> {
    of_time(args, 1)
}

pub(super) fn seconds(args: &[Value<'_>]) -> Option<Term> {
    of_time(args, 2)
}

/// Returns the time zone as in the text; empty without one.
pub(super) fn tz(args: &[Value<'_>]) -> Option<Term> {
    parts(&args[0]).map(|parts| Term::string(parts.zone))
}

/// Returns the time zone as a duration.
pub(super) fn timezone(args: &[Value<'_>]) -> Option<Term> {
    let zone = parts(&args[0])?.zone;
    let (sign, hours, minutes) = match zone.split_at_checked(1)? {
        ("Z", _) => ("", 0, 0),
        (sign, rest) => {
            let (hours, minutes) = rest.split_once(':')?;
            (
                if sign == "-" { "-" } else { "" },
                hours.parse::<u8>().ok()?,
                minutes.parse::<u8>().ok()?,
            )
        }
    };
    let text = match (hours, minutes) {
        (0, 0) => "PT0S".to_owned(),
        (hours, 0) => format!("{sign}PT{hours}H"),
        (0, minutes) => format!("{sign}PT{minutes}M"),
        (hours, minutes) => format!("{sign}PT{hours}H{minutes}M"),
    };
    Some(literal(&text, &format!("{}dayTimeDuration", names::XSD)))
}
