//! Finds and reads the rule files that an ontology links, without parsing them.

use std::path::Path;

use crate::file_iri::{beside, path_of_plain};
use crate::graph::Graph;
use crate::read::Statement;
use crate::{RuleFile, RuleLanguage};
use actcheck_base::{Diagnostic, Diagnostics, Files, Severity, Source, Term, digest_of, nearest};

/// Reads the rule file that a statement's object names: an IRI or a string with a path relative to
/// the ontology file.
///
/// Returns `None` and adds a fault if the path is not relative (O011), its extension is unknown
/// (O010), or the file can't be read (O009). If that is a warning by `missing`, the rule is empty.
pub(super) fn read(
    graph: &Graph,
    statement: &Statement,
    missing: Severity,
    found: &mut Diagnostics,
) -> Option<RuleFile> {
    let mention = match &statement.object {
        Term::Iri(text) | Term::String(text) => text.to_string(),
        other => other.to_string(),
    };
    let (source, span) = graph.place(statement, &mention);
    let mut fault = |code, message: String, help: String| {
        found.push(
            Diagnostic::error(code, message)
                .at(source, span.clone())
                .help(help),
        );
    };
    let Some(path) = relative_path(&statement.object) else {
        let help = "name it relative to the ontology file, such as `<../rules/moved_object.rls>`, or in quotes";
        fault(
            "O011",
            format!(
                "the path of the rule file {} is not relative",
                statement.object
            ),
            help.to_owned(),
        );
        return None;
    };
    let Some(language) = language_of(&path) else {
        let help = "the extension determines the language: `.rls` is Datalog, `.rq` is SPARQL";
        fault(
            "O010",
            format!("the rule file `{path}` must end in `.rls` or `.rq`"),
            help.to_owned(),
        );
        return None;
    };
    let home = graph.home(statement);
    let place = beside(&home.folder, &path);
    match home.files.read(&place) {
        Ok(text) => {
            let digest = digest_of(&text.text);
            Some(RuleFile {
                source: text,
                language,
                path,
                digest,
                linked_at: Some((source.clone(), span.clone())),
            })
        }
        Err(reason) => {
            let message = format!("cannot read the rule file `{path}`: {reason}");
            found.push(Diagnostic {
                severity: missing,
                ..Diagnostic::error("O009", message)
                    .at(source, span.clone())
                    .help(help_for_missing(&home.files, &place))
            });
            (missing == Severity::Warning).then(|| RuleFile {
                source: Source::new(path.as_str(), ""),
                language,
                digest: digest_of(""),
                path,
                linked_at: Some((source.clone(), span)),
            })
        }
    }
}

pub(super) fn relative_path(object: &Term) -> Option<String> {
    match object {
        Term::Iri(iri) => path_of_plain(iri),
        Term::String(path) if !path.contains("://") && !Path::new(path.as_ref()).is_absolute() => {
            Some(path.to_string())
        }
        _ => None,
    }
}

pub(super) fn language_of(path: &str) -> Option<RuleLanguage> {
    match Path::new(path).extension()?.to_str()? {
        "rls" => Some(RuleLanguage::Datalog),
        "rq" => Some(RuleLanguage::Sparql),
        _ => None,
    }
}

fn help_for_missing(files: &Files, place: &Path) -> String {
    let name = |path: &Path| {
        path.file_name()
            .map_or_else(String::new, |name| name.to_string_lossy().into_owned())
    };
    let beside: Vec<String> = files
        .list(place.parent().unwrap_or(Path::new("")))
        .iter()
        .map(|path| name(path))
        .collect();
    match nearest(&name(place), beside.iter().map(String::as_str)) {
        Some(found) => format!("did you mean `{found}`?"),
        None => format!(
            "it was expected at {}: the path is relative to the ontology file",
            place.display()
        ),
    }
}
