//! The encodings of XML texts: that of a byte-order mark, or that of the XML declaration.

use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE};

use crate::FileFault;

/// Byte-order marks and first bytes of `<` in encodings that are recognised without a declaration;
/// the longer ones first, because some begin with others.
///
/// Source: Extensible Markup Language (XML) 1.0, appendix F.
const BEGINNINGS: [(&[u8], Begun); 10] = [
    (b"\xff\xfe\0\0", Begun::Unsupported("UTF-32")),
    (b"\0\0\xfe\xff", Begun::Unsupported("UTF-32")),
    (b"<\0\0\0", Begun::Unsupported("UTF-32")),
    (b"\0\0\0<", Begun::Unsupported("UTF-32")),
    (b"\x4c\x6f\xa7\x94", Begun::Unsupported("EBCDIC")),
    (b"\xef\xbb\xbf", Begun::Marked(UTF_8)),
    (b"\xff\xfe", Begun::Marked(UTF_16LE)),
    (b"\xfe\xff", Begun::Marked(UTF_16BE)),
    (b"<\0", Begun::Unmarked(UTF_16LE)),
    (b"\0<", Begun::Unmarked(UTF_16BE)),
];

/// The meaning of the first bytes of a text.
#[derive(Clone, Copy)]
enum Begun {
    /// A byte-order mark of this encoding.
    Marked(&'static Encoding),
    /// A `<` in this encoding.
    Unmarked(&'static Encoding),
    Unsupported(&'static str),
}

/// Decodes a text: XML from the encoding that its byte-order mark or its declaration states, all
/// others from UTF-8. XML loses its byte-order mark.
///
/// Lines and columns of the result are those of the file. If the text was in another encoding than
/// UTF-8, spaces replace the `encoding` of its declaration, which would be wrong for a copy.
///
/// ```
/// let latin = b"<?xml version='1.0' encoding='ISO-8859-1'?><a b='\xe9'/>".to_vec();
/// let text = actcheck_base::xml_text(latin).expect("it is Latin");
/// assert_eq!(text, "<?xml version='1.0'                      ?><a b='é'/>");
/// ```
///
/// # Errors
/// [`FileFault::Encoding`] if the encoding is unknown, [`FileFault::NotInEncoding`] at the first
/// bytes that are not in the encoding of an XML text, [`FileFault::NotText`] for others.
pub fn xml_text(bytes: Vec<u8>) -> Result<String, FileFault> {
    let begun = BEGINNINGS
        .iter()
        .find(|(beginning, _)| bytes.starts_with(beginning));
    let (rest, encoding) = match begun {
        Some((_, Begun::Unsupported(name))) => return Err(FileFault::Encoding((*name).to_owned())),
        Some((mark, Begun::Marked(encoding))) => (&bytes[mark.len()..], Some(*encoding)),
        Some((_, Begun::Unmarked(encoding))) => (&bytes[..], Some(*encoding)),
        None => (&bytes[..], None),
    };
    let is_wide = encoding.is_some_and(|encoding| encoding != UTF_8);
    if !begins_with_element(rest, is_wide) {
        return String::from_utf8(bytes).map_err(|_| FileFault::NotText);
    }
    let (encoding, name) = match encoding {
        Some(encoding) => (encoding, encoding.name().to_owned()),
        None => declared_encoding(rest)?,
    };
    if encoding == UTF_8 {
        let text = match rest.len() == bytes.len() {
            true => String::from_utf8(bytes),
            false => String::from_utf8(rest.to_vec()),
        };
        return text.map_err(|error| not_in(&name, encoding, error.as_bytes()));
    }
    let Some(text) = encoding.decode_without_bom_handling_and_without_replacement(rest) else {
        return Err(not_in(&name, encoding, rest));
    };
    let mut text = text.into_owned();
    if text.as_bytes() != rest
        && let Some((start, end, _)) = declaration(&text)
    {
        text.replace_range(start..end, &" ".repeat(text[start..end].chars().count()));
    }
    Ok(text)
}

/// Whether the first character that is not white space is `<`. Characters of wide encodings, of
/// which all of these have one byte 0, have two bytes.
fn begins_with_element(bytes: &[u8], is_wide: bool) -> bool {
    let mut first = bytes
        .iter()
        .filter(|byte| !(is_wide && **byte == 0))
        .skip_while(|byte| byte.is_ascii_whitespace());
    first.next() == Some(&b'<')
}

/// Returns the encoding of a text whose first character has one byte, with its name.
///
/// # Errors
/// [`FileFault::Encoding`] if the encoding is unknown, [`FileFault::NotInEncoding`] if the text is
/// declared as ASCII and is neither ASCII nor UTF-8.
fn declared_encoding(bytes: &[u8]) -> Result<(&'static Encoding, String), FileFault> {
    let start = bytes.trim_ascii_start();
    let end = start.iter().position(|byte| *byte == b'>');
    let first = String::from_utf8_lossy(&start[..end.unwrap_or(0)]);
    let Some((_, _, name)) = declaration(&first).filter(|(_, _, name)| !name.is_empty()) else {
        return Ok((UTF_8, "UTF-8".to_owned()));
    };
    let name = name.to_owned();
    let Some(encoding) = Encoding::for_label_no_replacement(name.as_bytes()) else {
        return Err(FileFault::Encoding(name));
    };
    if [UTF_16LE, UTF_16BE].contains(&encoding) {
        // The declaration itself is not in that encoding: a program wrote a text that it had in
        // memory, where it was.
        return Ok((UTF_8, "UTF-8".to_owned()));
    }
    // The web reads this name as windows-1252, XML does not. UTF-8 is a superset of ASCII.
    let is_ascii = ["ASCII", "US-ASCII", "ANSI_X3.4-1968"]
        .iter()
        .any(|ascii| name.eq_ignore_ascii_case(ascii));
    Ok((if is_ascii { UTF_8 } else { encoding }, name))
}

/// Returns the place of `encoding="…"` in the XML declaration with which a text begins, and the
/// name in it. Unit: bytes.
fn declaration(text: &str) -> Option<(usize, usize, &str)> {
    let inside = text.trim_start().strip_prefix("<?xml")?;
    let inside = &inside[..inside.find("?>").unwrap_or(inside.len())];
    let before = text.find("<?xml")? + "<?xml".len();
    let start = inside.match_indices("encoding").find_map(|(at, _)| {
        let is_word = inside[..at].ends_with(|letter: char| letter.is_ascii_whitespace());
        is_word.then_some(at)
    })?;
    let value = inside[start + "encoding".len()..].trim_start();
    let value = value.strip_prefix('=')?.trim_start();
    let quote = value.chars().next().filter(|one| "\"'".contains(*one))?;
    let (name, rest) = value[1..].split_once(quote)?;
    let end = inside.len() - rest.len();
    Some((before + start, before + end, name.trim()))
}

/// The fault of bytes that are not in this encoding.
fn not_in(name: &str, encoding: &'static Encoding, bytes: &[u8]) -> FileFault {
    let (text, _) = encoding.decode_without_bom_handling(bytes);
    let before = text.split('\u{fffd}').next().unwrap_or_default();
    FileFault::NotInEncoding {
        encoding: name.to_owned(),
        line: before.matches('\n').count() + 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn utf16(text: &str, bytes_of: fn(u16) -> [u8; 2]) -> Vec<u8> {
        text.encode_utf16().flat_map(bytes_of).collect()
    }

    #[test]
    fn declared_encodings_are_decoded() {
        for (name, bytes, text) in [
            ("ISO-8859-1", &b"\xe9"[..], "é"),
            ("latin1", b"\xe9", "é"),
            ("windows-1252", b"\x80", "€"),
            ("ISO-8859-15", b"\xa4", "€"),
            ("ISO-8859-2", b"\xb3", "ł"),
            ("windows-1251", b"\xc6", "Ж"),
            ("GB2312", b"\xc4\xa3", "模"),
            ("Shift_JIS", b"\x83\x8d", "ロ"),
            ("ISO-2022-JP", b"\x1b$B%m\x1b(B", "ロ"),
            ("US-ASCII", b"e", "e"),
            ("us-ascii", b"\xc3\xa9", "é"),
            ("utf-8", b"\xc3\xa9", "é"),
            ("utf-16", b"\xc3\xa9", "é"),
        ] {
            for quote in ["'", "\""] {
                let head = format!("<?xml version='1.0' encoding = {quote}{name}{quote} ?>\n");
                let mut file = head.clone().into_bytes();
                file.extend(b"<a>");
                file.extend(bytes);
                let read = xml_text(file).unwrap_or_else(|fault| panic!("{name}: {fault}"));
                let (first, rest) = read.split_once('\n').expect("it has two lines");
                assert_eq!(rest, format!("<a>{text}"), "{name}");
                assert_eq!(first.len() + 1, head.len(), "{name}");
            }
        }
    }

    #[test]
    fn byte_order_marks_and_first_letters_decide() {
        let declared = "<?xml version=\"1.0\" encoding=\"utf-16\"?><é/>";
        let decoded = "<?xml version=\"1.0\"                  ?><é/>";
        for bytes_of in [u16::to_le_bytes, u16::to_be_bytes] {
            for mark in ["", "\u{feff}"] {
                let file = utf16(&format!("{mark}{declared}"), bytes_of);
                assert_eq!(xml_text(file).as_deref(), Ok(decoded));
                let file = utf16(&format!("{mark}<é/>"), bytes_of);
                assert_eq!(xml_text(file).as_deref(), Ok("<é/>"));
            }
            let spaced = utf16("\u{feff}\n <é/>", bytes_of);
            assert_eq!(xml_text(spaced).as_deref(), Ok("\n <é/>"));
        }
        let marked = "\u{feff}<?xml version='1.0' encoding='ISO-8859-1'?><é/>";
        assert_eq!(
            xml_text(marked.as_bytes().to_vec()).as_deref(),
            Ok(&marked[3..])
        );
    }

    #[test]
    fn texts_that_are_not_xml_are_utf_8() {
        for text in ["", "a = 1", "\u{feff}a = 1", "é <b/>"] {
            assert_eq!(xml_text(text.as_bytes().to_vec()).as_deref(), Ok(text));
        }
        for bytes in [
            &b"\xe9"[..],
            b"\xff\xfea\0",
            b"\x7fELF\x01\xff",
            b"\xff\xfe",
        ] {
            assert_eq!(xml_text(bytes.to_vec()), Err(FileFault::NotText));
        }
    }

    #[test]
    fn other_encodings_and_wrong_bytes_are_faults() {
        for (bytes, said) in [
            (
                &b"<?xml version='1.0' encoding='klingon'?><a/>"[..],
                "its encoding, `klingon`, is unknown",
            ),
            (b"\xff\xfe\0\0<\0\0\0", "its encoding, `UTF-32`, is unknown"),
            (
                b"\x4c\x6f\xa7\x94\x93",
                "its encoding, `EBCDIC`, is unknown",
            ),
            (
                b"<?xml version='1.0'?>\n<!-- \xe9 -->",
                "line 2 is not in its encoding, UTF-8",
            ),
            (
                b"<?xml version='1.0' encoding='us-ascii'?>\n\n<!-- \xe9 -->",
                "line 3 is not in its encoding, us-ascii",
            ),
            (
                b"<?xml version='1.0' encoding='gbk'?><!-- \xff -->",
                "line 1 is not in its encoding, gbk",
            ),
            (
                b"\xff\xfe<\0a\0/\0>\0\n",
                "line 1 is not in its encoding, UTF-16LE",
            ),
        ] {
            let fault = xml_text(bytes.to_vec()).expect_err(said);
            assert!(fault.to_string().starts_with(said), "{fault}");
        }
    }

    #[test]
    fn cut_texts_do_not_panic() {
        let declared = "<?xml version='1.0' encoding='ISO-8859-1'?><é/>";
        for file in [
            declared.as_bytes().to_vec(),
            utf16(&format!("\u{feff}{declared}"), u16::to_le_bytes),
        ] {
            for end in 0..file.len() {
                let _ = xml_text(file[..end].to_vec());
            }
        }
    }
}
