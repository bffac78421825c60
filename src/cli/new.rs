//! `actcheck new`

use std::path::Path;

use crate::base::{Diagnostic, Diagnostics, Files, did_you_mean};
use crate::cli::args::{NewArgs, NewKind, NewPropertyArgs};
use crate::cli::{output, written};
use crate::ontology::{self, property_template};

/// Writes what is new.
pub fn new(args: &NewArgs) -> Result<(), Diagnostics> {
    match &args.kind {
        NewKind::Property(args) => property(args),
    }
}

/// Writes a rule file and its entry in the ontology, ready to edit.
fn property(args: &NewPropertyArgs) -> Result<(), Diagnostics> {
    let known = ontology::load(&Files::Disk, &args.ontology)?;
    let Some(action) = known.actions.get(&args.action) else {
        let names = known.actions.keys().map(String::as_str);
        return Err(Diagnostic::error("X011", format!("{} has no action `{}`", args.ontology.display(), args.action))
            .help(did_you_mean(&args.action, names))
            .into());
    };
    let iri = crate::base::names::act(&args.name);
    let fits = args.name.starts_with(|c: char| c.is_ascii_uppercase()) && args.name.chars().all(char::is_alphanumeric);
    if !fits {
        return Err(Diagnostic::error("X011", format!("`{}` is no name for a property", args.name))
            .help("begin with a capital and use letters and digits only, such as `StaysUpright`")
            .into());
    }
    if known.vocabulary.terms.contains_key(&iri) {
        return Err(Diagnostic::error("X011", format!("the ontology has a `{}` already", args.name))
            .help("choose another name, or edit what is there")
            .into());
    }
    // The example speaks of a thing that is handled: `pickObject` rather than a surface or a place.
    let things = action.parameters.iter().find(|name| name.ends_with("Object"));
    let designator = things.or(action.parameters.first()).map_or("pickObject", String::as_str);
    let template = property_template(&args.name, &args.action, designator, "../rules/");
    let folder = args.ontology.parent().and_then(Path::parent).unwrap_or(Path::new(""));
    let rule = folder.join("rules").join(&template.rule_file);
    if rule.exists() {
        return Err(Diagnostic::error("X011", format!("{} is there already", rule.display()))
            .help("choose another name, or edit that file")
            .into());
    }
    let text = Files::Disk
        .read(&args.ontology)
        .map_err(|why| {
            written::unwritten(&args.ontology, why)
                .help("name an ontology in a folder that may be written, with `--ontology FILE`")
        })?
        .text;
    written::write(&rule, &template.rule_text)?;
    written::write(
        &args.ontology,
        format!("{}{}", text.trim_end(), template.ontology_entry.replacen('\n', "\n\n", 1)),
    )?;
    output::print(&format!(
        "wrote {} and an entry in {}: edit both, then `actcheck check CONFIG`\n",
        rule.display(),
        args.ontology.display()
    ));
    Ok(())
}
