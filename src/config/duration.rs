//! Parses durations such as `10m`.

use jiff::SignedDuration;

/// The longest accepted duration: a year. Unit: seconds.
const LONGEST_SECS: f64 = 366.0 * 86_400.0;

/// Why a text is not a usable duration. Each variant has the text.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum DurationFault {
    /// It has another form.
    #[error("`{0}` is not a duration such as 90s, 10m or 2h")]
    Unknown(String),
    /// It is zero, negative or too long.
    #[error("`{0}` must be above zero and at most a year")]
    OutOfRange(String),
}

/// Parses a duration such as `90s`, `10m`, `2h` or `1h30m` into seconds.
///
/// # Errors
/// [`DurationFault`] if the text is not a duration, or not above zero and at most a year.
pub fn duration_secs(text: &str) -> Result<f64, DurationFault> {
    let duration: SignedDuration = text
        .trim()
        .parse()
        .map_err(|_| DurationFault::Unknown(text.to_owned()))?;
    let secs = duration.as_secs_f64();
    if secs > 0.0 && secs <= LONGEST_SECS {
        Ok(secs)
    } else {
        Err(DurationFault::OutOfRange(text.to_owned()))
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
