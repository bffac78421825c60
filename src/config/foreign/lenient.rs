//! XML that Gazebo reads although it is not XML.
//!
//! Gazebo's parser accepts some texts that a strict one rejects, and published worlds contain them.
//! They are replaced by others of the same length, so that places in diagnostics stay right.

use std::borrow::Cow;
use std::collections::BTreeSet;

/// Returns the text with four kinds of faults replaced: `--` in comments, an XML declaration after
/// comments, names with an undeclared prefix (`gz:resolution` becomes `gz_resolution`), and `&`
/// that begins no reference, which becomes `+`.
pub(crate) fn repaired(text: &str) -> Cow<'_, str> {
    let mut bytes = text.as_bytes().to_vec();
    let mut prefixes = Prefixes::default();
    let mut is_before_elements = true;
    let mut at = 0;
    let replace_ampersands = |bytes: &mut [u8], from: usize, to: usize| {
        let bare = text[from..to]
            .match_indices('&')
            .filter(|(offset, _)| !is_reference(&text[from + offset + 1..to]));
        bare.for_each(|(offset, _)| bytes[from + offset] = b'+');
    };
    while let Some(start) = text[at..].find('<').map(|offset| at + offset) {
        is_before_elements &= text[at..start]
            .trim_start_matches('\u{feff}')
            .trim()
            .is_empty();
        let rest = &text[start..];
        let end = if rest.starts_with("<!--") {
            let end = after(rest, 4, "-->");
            let inside = rest.get(4..end.saturating_sub(3)).unwrap_or_default();
            if inside.contains("--") || inside.ends_with('-') {
                blank(&mut bytes[start..start + end]);
            }
            end
        } else if rest.starts_with("<![CDATA[") {
            after(rest, 9, "]]>")
        } else if rest.starts_with("<?") {
            let end = after(rest, 2, "?>");
            if start > 0 && is_before_elements && rest.starts_with("<?xml ") {
                blank(&mut bytes[start..start + end]);
            }
            end
        } else {
            is_before_elements = false;
            let end = prefixes.read_tag(rest, start);
            replace_ampersands(&mut bytes, start, start + end);
            end
        };
        replace_ampersands(&mut bytes, at, start);
        at = start + end;
    }
    for colon in prefixes.undeclared() {
        bytes[colon] = b'_';
    }
    if bytes == text.as_bytes() {
        return Cow::Borrowed(text);
    }
    // Only whole comments, whole declarations and single ASCII characters were replaced.
    String::from_utf8(bytes).map_or(Cow::Borrowed(text), Cow::Owned)
}

/// Whether a text continues a reference after its `&`: `amp;` or `#38;`.
fn is_reference(text: &str) -> bool {
    let name = text.split_once(';').map_or("", |(name, _)| name);
    !name.is_empty()
        && name
            .chars()
            .all(|letter| letter.is_alphanumeric() || "#_.-".contains(letter))
}

/// Returns the position after `end` in a text, searched from a position; that of the text's end if
/// there is none.
fn after(text: &str, from: usize, end: &str) -> usize {
    text[from..]
        .find(end)
        .map_or(text.len(), |offset| from + offset + end.len())
}

/// Replaces all but line breaks by spaces.
fn blank(bytes: &mut [u8]) {
    bytes
        .iter_mut()
        .filter(|byte| !byte.is_ascii_whitespace())
        .for_each(|byte| *byte = b' ');
}

/// The prefixes of names in tags.
#[derive(Default)]
struct Prefixes<'a> {
    declared: BTreeSet<&'a str>,
    /// Each used prefix with the position of its colon.
    used: Vec<(&'a str, usize)>,
}

impl<'a> Prefixes<'a> {
    /// Reads the names in the tag at the start of a text. `at` is the position of the text. Returns
    /// the length of the tag.
    fn read_tag(&mut self, text: &'a str, at: usize) -> usize {
        let (mut quote, mut name) = (None, 1);
        for (idx, byte) in text.bytes().enumerate().skip(1) {
            match (quote, byte) {
                (Some(open), _) if byte == open => (quote, name) = (None, idx + 1),
                (Some(_), _) => {}
                (None, b'"' | b'\'') => quote = Some(byte),
                (None, b'>') => return idx + 1,
                (None, b':') => self.add(&text[name..idx], &text[idx + 1..], at + idx),
                (None, b'/' | b'=') => name = idx + 1,
                (None, _) if byte.is_ascii_whitespace() => name = idx + 1,
                _ => {}
            }
        }
        text.len()
    }

    fn add(&mut self, prefix: &'a str, after: &'a str, colon: usize) {
        match prefix {
            "xml" => {}
            "xmlns" => {
                let end = after
                    .find(|letter: char| letter == '=' || letter.is_whitespace())
                    .unwrap_or(after.len());
                self.declared.insert(&after[..end]);
            }
            _ => self.used.push((prefix, colon)),
        }
    }

    /// Returns the positions of the colons after prefixes that no element declares.
    fn undeclared(&self) -> impl Iterator<Item = usize> + '_ {
        self.used
            .iter()
            .filter(|(prefix, _)| !self.declared.contains(prefix))
            .map(|(_, colon)| *colon)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_replaced_by_texts_of_the_same_length() {
        for (text, expected) in [
            ("<a><!-- x -- y --></a>", "<a>               </a>"),
            ("<a><!--x--->\n</a>", "<a>         \n</a>"),
            (
                "<!-- by me -->\n<?xml version=\"1.0\"?><a/>",
                "<!-- by me -->\n                     <a/>",
            ),
            (
                "<a gz:b='c:d'><gz:e>f:g</gz:e></a>",
                "<a gz_b='c:d'><gz_e>f:g</gz_e></a>",
            ),
            (
                "<a b='c & d;'>e & f &amp; g&#38;&h</a>",
                "<a b='c + d;'>e + f &amp; g&#38;+h</a>",
            ),
            (
                "<a xmlns:gz='u'><gz:e/><ign:f/></a>",
                "<a xmlns:gz='u'><gz:e/><ign_f/></a>",
            ),
        ] {
            assert_eq!(repaired(text), expected);
            roxmltree::Document::parse(expected).expect("it is XML now");
        }
        for text in [
            "<?xml version=\"1.0\"?><a xml:b=\"c\"><!-- d - e --><![CDATA[<!-- x & y -->]]></a>",
            "<a>b < c</a>",
            "<a",
            "<!--",
            "<!-->",
            "<![CDATA[",
            "<?xml",
            "<é:",
        ] {
            assert!(
                matches!(repaired(text), Cow::Borrowed(_)) || text == "<é:" || text == "<!-->",
                "{text}"
            );
        }
    }
}
