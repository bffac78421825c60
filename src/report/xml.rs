//! Text of XML documents, escaped by quick-xml.

use quick_xml::escape::escape;

/// Escapes the text of an element. XML 1.0 can't represent most control characters; they become
/// U+FFFD.
pub(crate) fn text(raw: &str) -> String {
    let printable = |letter| match letter {
        '\t' | '\n' | '\r' => letter,
        '\u{0}'..='\u{1f}' | '\u{fffe}' | '\u{ffff}' => char::REPLACEMENT_CHARACTER,
        _ => letter,
    };
    escape(raw.chars().map(printable).collect::<String>()).replace('\r', "&#13;")
}

/// Escapes an attribute's value. Tabs and line ends are written as character references, because
/// parsers normalise them otherwise.
pub(crate) fn attribute(raw: &str) -> String {
    text(raw).replace('\t', "&#9;").replace('\n', "&#10;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_models_are_escaped() {
        assert_eq!(text("a<b>&\u{1}\r\n"), "a&lt;b&gt;&amp;\u{fffd}&#13;\n");
        assert_eq!(attribute("\"'\n]]>"), "&quot;&apos;&#10;]]&gt;");
    }
}
