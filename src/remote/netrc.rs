//! Reads netrc files: names and passwords by server.

/// The name and password of a server; without an entry of its own, those of the entry `default`.
/// Unknown words are skipped, as other programs do.
pub(crate) fn netrc_entry(text: &str, host: &str) -> Option<(String, String)> {
    let mut words = words(text).into_iter();
    let (mut default, mut own): (Option<Entry>, Option<Entry>) = (None, None);
    let mut current = Place::Elsewhere;
    while let Some(word) = words.next() {
        match word.as_str() {
            "machine" => {
                let is_own = words
                    .next()
                    .is_some_and(|name| name.eq_ignore_ascii_case(host))
                    && own.is_none();
                current = if is_own { Place::Own } else { Place::Elsewhere };
            }
            "default" => current = Place::Default,
            "login" | "password" => {
                let value = words.next()?;
                let entry = match current {
                    Place::Own => own.get_or_insert_default(),
                    Place::Default => default.get_or_insert_default(),
                    Place::Elsewhere => continue,
                };
                let part = if word == "login" {
                    &mut entry.user
                } else {
                    &mut entry.password
                };
                *part = Some(value);
            }
            _ => {}
        }
    }
    let entry = own.or(default)?;
    Some((entry.user?, entry.password.unwrap_or_default()))
}

#[derive(Clone, Copy)]
enum Place {
    Own,
    Default,
    Elsewhere,
}

#[derive(Default)]
struct Entry {
    user: Option<String>,
    password: Option<String>,
}

/// The words of a file without its comments and macros. A word in quotes may have spaces.
fn words(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut is_macro = false;
    for line in text.lines() {
        let line = line.trim();
        if is_macro {
            is_macro = !line.is_empty();
            continue;
        }
        let mut chars = line.chars().peekable();
        while let Some(first) = chars.next() {
            if first.is_whitespace() {
                continue;
            }
            if first == '#' {
                break;
            }
            let mut word = String::new();
            let end = if first == '"' { '"' } else { ' ' };
            if end == ' ' {
                word.push(first);
            }
            while let Some(next) = chars.next() {
                match next {
                    '"' if end == '"' => break,
                    '\\' if end == '"' => word.extend(chars.next()),
                    next if end == ' ' && next.is_whitespace() => break,
                    next => word.push(next),
                }
            }
            found.push(word);
        }
        if found.iter().rev().take(2).any(|word| word == "macdef") {
            is_macro = true;
            found.retain(|word| word != "macdef");
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(text: &str, host: &str) -> Option<(String, String)> {
        netrc_entry(text, host)
    }

    #[test]
    fn entries_are_found_by_server_and_default() {
        let text = "# mine\nmachine a.org login me password x#1\nmachine b.org\n  login \"two words\"\n  password \"q\\\"\"\n\
                    macdef init\n  machine c.org login no\n\ndefault login anyone password p";
        let pair = |user: &str, password: &str| Some((user.to_owned(), password.to_owned()));
        assert_eq!(entry(text, "A.org"), pair("me", "x#1"));
        assert_eq!(entry(text, "b.org"), pair("two words", "q\""));
        assert_eq!(entry(text, "c.org"), pair("anyone", "p"));
        assert_eq!(entry("machine a login me", "a"), pair("me", ""));
        assert_eq!(entry("machine a password me", "a"), None);
        assert_eq!(entry("machine a login", "a"), None);
        assert_eq!(entry("", "a"), None);
    }
}
