//! Points in time on the command line.

use crate::clock;
use crate::option_fault::OptionFault;
use actcheck_config::duration_secs;

/// Parses a day, a point in time or a duration before now. Returns the time as histories store it
/// (RFC 3339, in UTC).
///
/// # Errors
/// The text is none of these.
pub fn parse(text: &str) -> Result<String, OptionFault> {
    let written = |moment: jiff::Timestamp| format!("{moment:.3}");
    if let Ok(moment) = text.parse::<jiff::Timestamp>() {
        return Ok(written(moment));
    }
    // A date is also parsed from a longer text, which would lose its time of day.
    if let Some(day) = text
        .parse::<jiff::civil::Date>()
        .ok()
        .filter(|_| !text.contains([':', 'T', 't', ' ']))
    {
        return Ok(format!("{day}T00:00:00.000Z"));
    }
    let ago = duration_secs(text)
        .ok()
        .and_then(|secs| jiff::SignedDuration::try_from_secs_f64(secs).ok());
    let then = ago.and_then(|ago| clock::timestamp().checked_sub(ago).ok());
    then.map(written).ok_or_else(|| {
        "must be a day (2026-11-21), a time (2026-11-21T18:00:00Z) or a duration before now (90s, 10m, 12h)".into()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_formatted_as_in_histories() {
        assert_eq!(
            parse("2026-11-21").as_deref(),
            Ok("2026-11-21T00:00:00.000Z")
        );
        assert_eq!(
            parse("2026-11-21T18:00:00+02:00").as_deref(),
            Ok("2026-11-21T16:00:00.000Z")
        );
        assert!(parse("12h").is_ok_and(|then| then.ends_with('Z') && then.starts_with("20")));
        for wrong in ["yesterday", "", "2026-13-01", "-5m", "2026-11-21T18:00:00"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
