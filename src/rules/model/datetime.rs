//! The values of `xsd:dateTime`: <https://www.w3.org/TR/xmlschema11-2/#dateTime>.

/// Returns whether a valid moment has a time zone.
pub(crate) fn has_zone(text: &str) -> bool {
    text.ends_with('Z')
        || text
            .split_once('T')
            .is_some_and(|(_, time)| time.contains(['+', '-']))
}

/// Returns the text of an identical moment without redundant digits. Two moments are identical if
/// they agree in the time zone, too. Returns `None` if the text is invalid.
pub(crate) fn canonical(text: &str) -> Option<String> {
    let (date, rest) = text.split_once('T')?;
    let (negative, date) = date
        .strip_prefix('-')
        .map_or((false, date), |date| (true, date));
    let [year, month, day] = date.split('-').collect::<Vec<_>>()[..] else {
        return None;
    };
    if year.len() < 4 || (year.len() > 4 && year.starts_with('0')) {
        return None;
    }
    let (time, zone) = rest.split_at(rest.find(['Z', '+', '-']).unwrap_or(rest.len()));
    let zone = canonical_zone(zone)?;
    let [hour, minute, second] = time.split(':').collect::<Vec<_>>()[..] else {
        return None;
    };
    let (second, fraction) = second
        .split_once('.')
        .map_or((second, None), |(whole, part)| (whole, Some(part)));
    let digits = |part: &str| part.bytes().all(|byte| byte.is_ascii_digit());
    if !digits(year) || fraction.is_some_and(|part| part.is_empty() || !digits(part)) {
        return None;
    }
    let fraction = fraction.unwrap_or("").trim_end_matches('0');
    let mut year = year.parse::<i64>().ok()? * if negative { -1 } else { 1 };
    let (mut month, mut day) = (two(month, 12)?, two(day, 31)?);
    let (mut hour, minute, second) = (two(hour, 24)?, two(minute, 59)?, two(second, 59)?);
    if month == 0 || day == 0 || day > days(year, month) {
        return None;
    }
    if hour == 24 {
        if minute > 0 || second > 0 || !fraction.is_empty() {
            return None;
        }
        (hour, day) = (0, day + 1);
        if day > days(year, month) {
            (day, month) = (1, month + 1);
        }
        if month > 12 {
            (month, year) = (1, year + 1);
        }
    }
    let (sign, year) = (if year < 0 { "-" } else { "" }, year.abs());
    let dot = if fraction.is_empty() { "" } else { "." };
    Some(format!(
        "{sign}{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}{dot}{fraction}{zone}"
    ))
}

/// Reads two digits, at most `most`.
fn two(text: &str, most: u8) -> Option<u8> {
    let valid = text.len() == 2 && text.bytes().all(|byte| byte.is_ascii_digit());
    text.parse().ok().filter(|value| valid && *value <= most)
}

fn canonical_zone(zone: &str) -> Option<String> {
    match zone {
        "" => Some(String::new()),
        "Z" | "+00:00" | "-00:00" => Some("Z".to_owned()),
        _ => {
            let (hours, minutes) = zone.get(1..)?.split_once(':')?;
            let (hours, minutes) = (two(hours, 14)?, two(minutes, 59)?);
            (!zone.starts_with('Z') && (hours < 14 || minutes == 0)).then(|| zone.to_owned())
        }
    }
}

fn days(year: i64, month: u8) -> u8 {
    match month {
        4 | 6 | 9 | 11 => 30,
        2 if year % 4 == 0 && (year % 100 != 0 || year % 400 == 0) => 29,
        2 => 28,
        _ => 31,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_valid_dates_and_times() {
        for (text, wanted) in [
            (
                "2024-02-29T12:00:00.10-05:30",
                "2024-02-29T12:00:00.1-05:30",
            ),
            ("-0044-03-15T00:00:00", "-0044-03-15T00:00:00"),
            ("2025-12-31T24:00:00Z", "2026-01-01T00:00:00Z"),
        ] {
            assert_eq!(canonical(text).as_deref(), Some(wanted));
        }
        for wrong in [
            "2025-02-29T00:00:00",
            "2025-13-01T00:00:00",
            "2025-00-01T00:00:00",
            "25-01-01T00:00:00",
            "02025-01-01T00:00:00",
            "2025-01-01T24:00:01",
            "2025-01-01T00:60:00",
            "2025-01-01T00:00:00.",
            "2025-01-01T00:00:00+15:00",
            "2025-01-01T0:00:00",
            "2025-01-01T00:00:00Zulu",
            "+025-01-01T00:00:00",
            "2025-01-01T00:00:+1",
        ] {
            assert_eq!(canonical(wrong), None, "{wrong}");
        }
    }
}
