//! Moments on the command line.

use crate::config::duration_secs;

/// A moment as histories write it (RFC 3339, in UTC): of a day, of a moment, or of how long ago it is.
///
/// # Errors
/// It is none of these.
pub fn moment(text: &str) -> Result<String, String> {
    let written = |moment: jiff::Timestamp| format!("{moment:.3}");
    if let Ok(moment) = text.parse::<jiff::Timestamp>() {
        return Ok(written(moment));
    }
    // A date is read out of a longer text too, and would lose its time of day.
    if let Some(day) = text.parse::<jiff::civil::Date>().ok().filter(|_| !text.contains([':', 'T', 't', ' '])) {
        return Ok(format!("{day}T00:00:00.000Z"));
    }
    let ago = duration_secs(text).ok().and_then(|secs| jiff::SignedDuration::try_from_secs_f64(secs).ok());
    let then = ago.and_then(|ago| jiff::Timestamp::now().checked_sub(ago).ok());
    then.map(written).ok_or_else(|| {
        "a day (2026-11-21), a moment (2026-11-21T18:00:00Z) or how long ago (90s, 10m, 12h) is needed".to_owned()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_written_as_histories_do() {
        assert_eq!(moment("2026-11-21").as_deref(), Ok("2026-11-21T00:00:00.000Z"));
        assert_eq!(moment("2026-11-21T18:00:00+02:00").as_deref(), Ok("2026-11-21T16:00:00.000Z"));
        assert!(moment("12h").is_ok_and(|then| then.ends_with('Z') && then.starts_with("20")));
        for wrong in ["yesterday", "", "2026-13-01", "-5m", "2026-11-21T18:00:00"] {
            assert!(moment(wrong).is_err(), "{wrong}");
        }
    }
}
