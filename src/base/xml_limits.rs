//! Limits on the structure of XML texts, checked before a parser sees them.

use crate::{Diagnostic, Diagnostics, Source, XmlGuard};

/// Checks an XML text against limits that no model and no ontology needs to exceed. Accepts texts
/// that are incomplete or not XML, which the parser reports.
///
/// # Errors
/// The diagnostic with this code, at the place where the first limit is exceeded.
pub fn check_xml(source: &Source, code: &'static str) -> Result<(), Diagnostics> {
    let (mut guard, progress) = XmlGuard::new(source.text.as_bytes());
    // The guard keeps the reason for which it stops.
    let _ = std::io::copy(&mut guard, &mut std::io::sink());
    let Some(excess) = progress.excess() else {
        return Ok(());
    };
    let end = progress.offset().min(source.text.len());
    let at = (0..=end)
        .rev()
        .find(|at| source.text.is_char_boundary(*at))
        .unwrap_or(0);
    Err(Diagnostic::error(code, format!("this XML is refused: {excess}"))
        .at(source, at..at)
        .help("such a text can exhaust memory or time; simplify it, or write it in another format")
        .into())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The message without its beginning; empty if the text is accepted.
    fn said(text: &str) -> String {
        let found = check_xml(&Source::new("a.xml", text), "W055")
            .err()
            .unwrap_or_default();
        let said: String = found.iter().map(|fault| fault.message.as_str()).collect();
        said.trim_start_matches("this XML is refused: ").to_owned()
    }

    #[test]
    fn ordinary_documents_and_texts_that_are_not_xml_are_accepted() {
        let owl = "<?xml version=\"1.0\"?>\n<!DOCTYPE rdf:RDF [\n <!ENTITY owl \"http://www.w3.org/2002/07/owl#\" >\n \
            <!ENTITY xsd 'http://www.w3.org/2001/XMLSchema#' >\n]>\n<!-- a > b, don't <i> --><r xmlns=\"&owl;\" a='>'>\
            <![CDATA[<x>]]><b/></r>";
        for text in [
            owl,
            "",
            "<",
            "<!",
            "<!--",
            "<![",
            "<?",
            "</",
            "</a>",
            "a &b; c",
            "<a b=",
            "<!DOCTYPE a [<!ENTITY",
            "<é",
        ] {
            assert_eq!(said(text), "", "{text}");
        }
    }

    #[test]
    fn excess_is_refused_at_its_place() {
        let attributes = |n: usize| (0..n).map(|i| format!(" b{i} = \"1\"")).collect::<String>();
        assert_eq!(said(&format!("<a{}/>", attributes(256))), "");
        let source = Source::new("a.xml", format!("<r>\n<é/>\n<a{}/>", attributes(257)));
        let found = check_xml(&source, "W055")
            .expect_err("it has too many attributes")
            .to_string();
        assert!(
            found.contains("this XML is refused: an element has more than 256 attributes"),
            "{found}"
        );
        assert!(found.contains("a.xml:3:"), "{found}");
    }

    /// Marks in comments, sections and instructions don't hide a tag.
    #[test]
    fn quotation_marks_outside_of_tags_hide_nothing() {
        let tag = format!(
            "<a{}/>",
            (0..300).map(|i| format!(" b{i}=\"1\"")).collect::<String>()
        );
        for before in [
            "<!-- ' \" -->",
            "<![CDATA[ ' \" ]]>",
            "<?p ' \" ?>",
            "<!DOCTYPE a [<!-- ' \" -->]>",
            "' \"",
        ] {
            assert!(
                said(&format!("{before}{tag}")).starts_with("an element has"),
                "{before}"
            );
        }
    }
}
