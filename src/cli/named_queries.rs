//! Named queries: the shipped ones, and those of the project.

use std::collections::BTreeMap;
use std::path::Path;

use actcheck_base::{Diagnostic, Diagnostics, Files, Source, did_you_mean};

/// Their folder, in the project and in the shipped files.
const FOLDER: &str = "ontology/queries";

/// A query with its description.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NamedQuery {
    /// The file's name without its extension.
    pub name: String,
    /// The first line of the comment that it begins with.
    pub title: String,
    /// The rest of that comment.
    pub description: String,
    /// The whole text.
    pub text: String,
}

/// All named queries. A query of the project replaces a shipped one of the same name.
///
/// # Errors
/// `X047` a file of the project can't be read.
pub fn all() -> Result<Vec<NamedQuery>, Diagnostics> {
    sources()?
        .into_iter()
        .map(|(name, source)| Ok(described(name, &source.text)))
        .collect()
}

/// Returns the query with a name.
///
/// # Errors
/// `X048` there is no such query.
pub fn named(name: &str) -> Result<Source, Diagnostics> {
    let mut known = sources()?;
    match known.remove(name) {
        Some(source) => Ok(source),
        None => {
            let fault = Diagnostic::error("X048", format!("there is no query `{name}`"));
            let help = did_you_mean(name, known.keys().map(String::as_str));
            let help = if help.ends_with('?') {
                help
            } else {
                help + ";"
            };
            Err(fault
                .help(format!(
                    "{help} `actcheck query --named` describes all of them"
                ))
                .into())
        }
    }
}

/// Whether a query has this name.
pub fn is_named(name: &str) -> bool {
    sources().is_ok_and(|known| known.contains_key(name))
}

fn sources() -> Result<BTreeMap<String, Source>, Diagnostics> {
    let mut found = BTreeMap::new();
    for files in [Files::Shipped, Files::Disk] {
        for path in files.list(Path::new(FOLDER)) {
            let (Some(stem), Some("rq")) = (
                path.file_stem(),
                path.extension().and_then(|ending| ending.to_str()),
            ) else {
                continue;
            };
            let source = files.read(&path).map_err(|why| {
                Diagnostic::error("X047", format!("{}: {why}", path.display()))
                    .help("repair or remove the file")
            })?;
            found.insert(stem.to_string_lossy().into_owned(), source);
        }
    }
    Ok(found)
}

fn described(name: String, text: &str) -> NamedQuery {
    let mut lines = text
        .lines()
        .map_while(|line| line.strip_prefix('#'))
        .map(str::trim);
    let title = lines.next().unwrap_or_default().to_owned();
    NamedQuery {
        name,
        title,
        description: lines.collect::<Vec<&str>>().join(" ").trim().to_owned(),
        text: text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn title_and_description_come_from_the_first_comment() {
        let query = described(
            "q".into(),
            "# Title\n# One line\n#  and another.\n\n# no more\nSELECT * {}",
        );
        assert_eq!(
            (query.title.as_str(), query.description.as_str()),
            ("Title", "One line and another.")
        );
        assert_eq!(described("q".into(), "ASK {}").title, "");
        let all = all().expect("the embedded queries can be read");
        assert!(
            all.len() >= 12
                && all
                    .iter()
                    .all(|query| !query.title.is_empty() && !query.description.is_empty())
        );
    }
}
