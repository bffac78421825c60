//! Commands that are printed for people to copy into a shell.

use std::ffi::OsStr;
use std::fmt::{self, Display, Write as _};

/// A command line that a POSIX shell splits into the same words again, whatever they contain.
///
/// Control characters and marks of the direction of writing become escapes in `$'…'`, so that the
/// line is a single one and a terminal shows it as it is.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ShellLine(String);

impl ShellLine {
    /// A line that begins with fixed words of this program, such as `actcheck show`, or with a
    /// program's path.
    pub fn new(program: &str) -> Self {
        Self::default().word(program)
    }

    /// Appends words that are written in the source as they are, such as `show` or `--failed`.
    pub fn fixed(mut self, words: &'static str) -> Self {
        self.separate();
        self.0.push_str(words);
        self
    }

    /// Appends one word.
    pub fn word(mut self, word: impl AsRef<OsStr>) -> Self {
        self.separate();
        self.0.push_str(&one_word(&word.as_ref().to_string_lossy()));
        self
    }

    /// Appends the path of a file. If it begins with a dash, `./` is put before it, since it would
    /// be taken as an option.
    pub fn file(self, path: impl AsRef<OsStr>) -> Self {
        let path = path.as_ref().to_string_lossy();
        // A single dash is a stream.
        if path.starts_with('-') && path.len() > 1 {
            self.word(format!("./{path}"))
        } else {
            self.word(&*path)
        }
    }

    /// Appends an option, such as `--history`, with its value.
    pub fn option(self, name: &'static str, value: impl AsRef<OsStr>) -> Self {
        let value = value.as_ref().to_string_lossy();
        if value.starts_with('-') {
            let mut line = self;
            line.separate();
            let _ = write!(line.0, "{name}={}", one_word(&value));
            return line;
        }
        self.fixed(name).word(&*value)
    }

    /// Appends one word of a script, which is not shown: control characters stay as they are, since
    /// `$'…'` is not known to each shell.
    pub fn in_script(mut self, word: impl AsRef<OsStr>) -> Self {
        self.separate();
        let word = word.as_ref().to_string_lossy();
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,%@+".contains(c);
        if word.is_empty() || !word.chars().all(is_plain) {
            let _ = write!(self.0, "'{}'", word.replace('\'', r"'\''"));
        } else {
            self.0.push_str(&word);
        }
        self
    }

    /// Appends words that are quoted already, such as those of another line.
    pub fn quoted(mut self, words: &str) -> Self {
        if !words.is_empty() {
            self.separate();
            self.0.push_str(words);
        }
        self
    }

    fn separate(&mut self) {
        if !self.0.is_empty() {
            self.0.push(' ');
        }
    }
}

impl<T: AsRef<OsStr>> FromIterator<T> for ShellLine {
    fn from_iter<I: IntoIterator<Item = T>>(words: I) -> Self {
        words.into_iter().fold(Self::default(), Self::word)
    }
}

impl Display for ShellLine {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(&self.0)
    }
}

/// One word of a shell.
fn one_word(word: &str) -> String {
    let is_hidden = |c: char| {
        c.is_control()
            || matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    if !word.contains(is_hidden)
        && let Ok(quoted) = shlex::try_quote(word)
    {
        return quoted.into_owned();
    }
    let mut out = "$'".to_owned();
    for c in word.chars() {
        match c {
            '\n' => out.push_str("\\n"),
            '\t' => out.push_str("\\t"),
            '\'' | '\\' => out.extend(['\\', c]),
            // Octal escapes have at most three digits, so a digit may follow.
            c if is_hidden(c) => c
                .to_string()
                .bytes()
                .for_each(|byte| out.push_str(&format!("\\{byte:03o}"))),
            c => out.push(c),
        }
    }
    out.push('\'');
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_quoted_where_a_shell_would_change_them() {
        for (word, expected) in [
            ("configs/.actcheck", "configs/.actcheck"),
            ("", "''"),
            ("a b", "'a b'"),
            ("h; touch PWNED #", "'h; touch PWNED #'"),
            ("$(id)`id`", "'$(id)`id`'"),
            ("~", "'~'"),
            ("a\nb\u{1b}[2J", "$'a\\nb\\033[2J'"),
            ("it's\t\\\u{202e}", "$'it\\'s\\t\\\\\\342\\200\\256'"),
        ] {
            assert_eq!(ShellLine::new(word).to_string(), expected);
        }
    }

    #[test]
    fn a_value_with_a_leading_dash_is_not_an_option() {
        let line = ShellLine::new("actcheck").fixed("show").word("k7f3-1");
        assert_eq!(
            line.clone().option("--history", "h").to_string(),
            "actcheck show k7f3-1 --history h"
        );
        assert_eq!(
            line.clone().option("--history", "-h x").to_string(),
            "actcheck show k7f3-1 --history='-h x'"
        );
        assert_eq!(
            line.file("-c.toml").file("-").to_string(),
            "actcheck show k7f3-1 ./-c.toml -"
        );
    }

    #[test]
    fn a_shell_gets_the_same_words() {
        let words = [
            "",
            " ",
            "-n",
            "a'b\"c",
            "x\ny\r\t",
            "\u{7}\u{9b}1m9",
            "$HOME `ls` $(ls) !! * ? [a] {b,c} ~ # ; & |",
            "ü\u{202e}\\n",
            "=x",
        ];
        let line = ShellLine::new("printf")
            .word("%s\\0")
            .word("")
            .chain_all(&words);
        let output = std::process::Command::new("bash")
            .args(["-c", &line.to_string()])
            .output()
            .expect("a shell");
        let expected: String = std::iter::once("")
            .chain(words)
            .map(|word| format!("{word}\0"))
            .collect();
        assert_eq!(String::from_utf8_lossy(&output.stdout), expected, "{line}");
        assert_eq!(line.to_string().lines().count(), 1);
    }

    impl ShellLine {
        fn chain_all(self, words: &[&str]) -> Self {
            words.iter().fold(self, |line, word| line.word(*word))
        }
    }
}
