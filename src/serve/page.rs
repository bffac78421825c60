//! The query page. It works without scripts too: then the form is sent to the endpoint.

use std::fmt::Write as _;

use quick_xml::escape::escape;

use actcheck_base::names;

/// The stylesheet.
pub(super) const STYLE: &str = include_str!("web/style.css");
/// The script that shows answers as tables and downloads them.
pub(super) const SCRIPT: &str = include_str!("web/query.js");

/// An example query of the page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ExampleQuery {
    /// Its name.
    pub name: String,
    /// Title, one line.
    pub title: String,
    /// Description of its answer.
    pub description: String,
    /// Its text.
    pub query: String,
}

/// Renders the page.
pub(super) fn page(history: &str, examples: &[ExampleQuery]) -> String {
    let mut options = String::new();
    for example in examples {
        // Writing to a string does not fail.
        let _ = write!(
            options,
            "<option value=\"{}\" data-about=\"{}\" data-query=\"{}\">{}</option>",
            escape(&example.name),
            escape(&example.description),
            escape(&example.query),
            escape(&example.title),
        );
    }
    let prefixes: String = names::PREFIXES
        .iter()
        .map(|(prefix, namespace)| {
            let (prefix, namespace) = (escape(*prefix), escape(*namespace));
            format!(
                "<li data-prefix=\"{prefix}\" data-namespace=\"{namespace}\"><code>{prefix}: {namespace}</code></li>"
            )
        })
        .collect();
    let first = "SELECT ?property ?outcome (COUNT(*) AS ?runs) WHERE {\n  ?assertion earl:test ?property ; earl:result/act:outcome ?outcome\n} GROUP BY ?property ?outcome ORDER BY ?property ?outcome";
    let (history, first) = (escape(history), escape(first));
    format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <title>Query {history}</title><link rel=\"stylesheet\" href=\"/style.css\"><script src=\"/query.js\" defer></script></head><body>\
         <header><h1>Query the history <code>{history}</code></h1><a href=\"/\">Report</a></header>\
         <main><p>Read-only SPARQL 1.1; endpoint: <code>/sparql</code>. The prefixes below are predefined.</p>\
         <form id=\"form\" action=\"/sparql\" method=\"post\">\
         <label for=\"example\">Examples</label><select id=\"example\"><option value=\"\">choose an example …</option>{options}</select>\
         <p id=\"about\" aria-live=\"polite\"></p>\
         <label for=\"query\">Query</label><textarea id=\"query\" name=\"query\" spellcheck=\"false\" required>{first}</textarea>\
         <div class=\"row\"><button type=\"submit\">Run</button><span class=\"faint\">or Ctrl+Enter</span></div></form>\
         <div id=\"said\" role=\"status\"></div><div class=\"row\" id=\"downloads\"></div><div class=\"wide\" id=\"answer\" tabindex=\"0\" role=\"group\" aria-label=\"Answer\"></div>\
         <details><summary>Prefixes</summary><ul id=\"prefixes\">{prefixes}</ul></details></main></body></html>\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shown_text_is_escaped() {
        let nasty = "\"><script>alert('1')</script>&".to_owned();
        let example = ExampleQuery {
            name: nasty.clone(),
            title: nasty.clone(),
            description: nasty.clone(),
            query: nasty.clone(),
        };
        let page = page(&nasty, &[example]);
        assert!(
            !page.contains("<script>")
                && !page.contains("'1'")
                && page.matches("<script").count() == 1,
            "{page}"
        );
    }
}
