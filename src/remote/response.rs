//! Answers of servers.

use std::io::{self, Read};
use std::time::Duration;

use ureq::Body;
use ureq::http::Response as HttpResponse;

/// Longest text of a refusal that is kept. Unit: bytes.
const MOST_OF_REFUSAL: u64 = 4096;
/// Most lines of a refusal that are shown, and the longest of them. Unit: characters.
const SHOWN_LINES: usize = 6;
const SHOWN_CHARS: usize = 300;
/// Longest rest of an answer that is read so that the connection can be used again. Unit: bytes.
const MOST_OF_REST: u64 = 1 << 16;

/// An answer whose status is known, and whose body is not read yet.
pub(crate) struct Response {
    pub status: u16,
    response: HttpResponse<Body>,
}

impl Response {
    pub fn new(response: HttpResponse<Body>) -> Self {
        Self {
            status: response.status().as_u16(),
            response,
        }
    }

    /// The value of a header, without spaces around it. Returns `None` if there is none, or if it
    /// is not text.
    pub fn header(&self, name: &str) -> Option<&str> {
        self.response
            .headers()
            .get(name)?
            .to_str()
            .ok()
            .map(str::trim)
    }

    /// Its media type in lower case, without parameters; empty if the server did not name one.
    pub fn media_type(&self) -> String {
        let named = self.header("content-type").unwrap_or_default();
        named
            .split(';')
            .next()
            .unwrap_or_default()
            .trim()
            .to_ascii_lowercase()
    }

    /// The wait that the server asks for.
    pub fn retry_after(&self) -> Option<Duration> {
        self.header("retry-after")?
            .parse()
            .ok()
            .map(Duration::from_secs)
    }

    /// The body as a stream.
    pub fn into_reader(self) -> impl Read + Send + 'static {
        self.response
            .into_body()
            .into_with_config()
            .limit(u64::MAX)
            .reader()
    }

    /// Reads a short rest of the body.
    pub fn finish(self) {
        // A body that can't be read costs only the connection.
        let _ = io::copy(&mut self.into_reader().take(MOST_OF_REST), &mut io::sink());
    }

    /// The first lines of the body, for a message.
    pub fn words(self) -> String {
        let is_html = self.media_type().contains("html");
        let mut bytes = Vec::new();
        // The part before an error is shown.
        let _ = self
            .into_reader()
            .take(MOST_OF_REFUSAL)
            .read_to_end(&mut bytes);
        let text = String::from_utf8_lossy(&bytes);
        first_lines(&if is_html {
            without_tags(&text)
        } else {
            text.into_owned()
        })
    }
}

/// The first lines of a text that are not empty, each shortened.
fn first_lines(text: &str) -> String {
    let lines = text
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty())
        .take(SHOWN_LINES);
    let shortened = lines.map(|line| match line.char_indices().nth(SHOWN_CHARS) {
        Some((end, _)) => format!("{}…", &line[..end]),
        None => line.to_owned(),
    });
    shortened.collect::<Vec<String>>().join("\n")
}

/// The text of an HTML page, roughly: servers answer errors with pages.
fn without_tags(page: &str) -> String {
    let mut text = String::new();
    let mut is_tag = false;
    for letter in page.chars() {
        match letter {
            '<' => is_tag = true,
            '>' if is_tag => {
                is_tag = false;
                text.push('\n');
            }
            letter if !is_tag => text.push(letter),
            _ => {}
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusals_are_shortened_to_readable_lines() {
        let long = "x".repeat(1000);
        let shown = first_lines(&format!("\n  one\n\n{long}\n3\n4\n5\n6\n7"));
        assert_eq!(shown.lines().count(), 6);
        assert!(
            shown.starts_with("one\nxxx") && shown.contains('…') && shown.ends_with('6'),
            "{shown}"
        );
        let page = "<html><head><title>Error 400</title></head><body><h1>Bad query</h1>line 3</body></html>";
        assert_eq!(
            first_lines(&without_tags(page)),
            "Error 400\nBad query\nline 3"
        );
    }
}
