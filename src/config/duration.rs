//! Parses durations such as `10m`.

use jiff::SignedDuration;

/// The longest accepted duration: a year. Unit: seconds.
const LONGEST_SECS: f64 = 366.0 * 86_400.0;

/// Parses a duration such as `90s`, `10m`, `2h` or `1h30m` into seconds.
///
/// # Errors
/// A message if the text is not a duration, or not above zero and at most a year.
pub fn duration_secs(text: &str) -> Result<f64, String> {
    let duration: SignedDuration = text
        .trim()
        .parse()
        .map_err(|_| format!("`{text}` is not a duration such as 90s, 10m or 2h"))?;
    let secs = duration.as_secs_f64();
    if secs > 0.0 && secs <= LONGEST_SECS {
        Ok(secs)
    } else {
        Err(format!("`{text}` must be above zero and at most a year"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_have_several_spellings() {
        for (text, secs) in [
            ("90s", 90.0),
            ("10m", 600.0),
            ("2h", 7200.0),
            ("1h30m", 5400.0),
            ("1.5s", 1.5),
            (" 1 h ", 3600.0),
        ] {
            assert_eq!(duration_secs(text), Ok(secs), "{text}");
        }
        for text in ["", "10", "0s", "-5s", "ten minutes", "1e9h", "500000h"] {
            assert!(duration_secs(text).is_err(), "{text}");
        }
    }
}
