//! `actcheck new property`

use std::path::{Path, PathBuf};

use clap::Args;

use crate::new_files::NewFiles;
use crate::{configurations, output, output_file, why};
use actcheck_base::{Diagnostic, Diagnostics, Files, did_you_mean, names};
use actcheck_config::{LinksOntology, link_ontology};
use actcheck_ontology as ontology;
use actcheck_ontology::{Ontology, Template, property_template};

/// `actcheck new property`
#[derive(Debug, Args)]
pub struct NewPropertyArgs {
    /// Name of the property, such as StaysUpright
    pub name: String,
    /// The action that gets it as a success property
    #[arg(long = "for", value_name = "ACTION")]
    pub action: String,
    /// The ontology that gets the entry; the rule file goes into `rules` beside its folder
    /// [default: ontology/actions.ttl here, which is created if missing]
    #[arg(long, value_name = "FILE")]
    pub ontology: Option<PathBuf>,
}

/// Writes a rule file and its entry in the ontology, ready to edit.
pub fn property(args: &NewPropertyArgs) -> Result<(), Diagnostics> {
    let (files, path) = why::ontology_file(args.ontology.as_deref());
    let known = ontology::load(&files, &path)?;
    let template = template(args, &known, &path)?;
    let folder = path
        .parent()
        .and_then(Path::parent)
        .unwrap_or(Path::new(""));
    let rule = folder.join("rules").join(&template.rule_file);
    match files {
        Files::Shipped => write_project(&path, &rule, &template)?,
        Files::Disk => write_property(&path, &rule, &template, args.ontology.is_some())?,
    }
    if args.ontology.is_none() {
        link_configurations(&path)?;
    }
    output::print_prose(&format!(
        "edit {} and the entry in {}, then `actcheck check CONFIG`\n",
        rule.display(),
        path.display()
    ));
    Ok(())
}

/// Creates the texts of the property, if its name and action are valid in the ontology.
fn template(
    args: &NewPropertyArgs,
    known: &Ontology,
    path: &Path,
) -> Result<Template, Diagnostics> {
    let Some(action) = known.actions.get(&args.action) else {
        let names = known.actions.keys().map(String::as_str);
        return Err(Diagnostic::error(
            "X011",
            format!("{} has no action `{}`", path.display(), args.action),
        )
        .help(did_you_mean(&args.action, names))
        .into());
    };
    let fits = args.name.starts_with(|c: char| c.is_ascii_uppercase())
        && args.name.chars().all(char::is_alphanumeric);
    if !fits {
        return Err(Diagnostic::error(
            "X011",
            format!("`{}` can't be the name of a property", args.name),
        )
        .help("begin with a capital letter and use only letters and digits, such as `StaysUpright`")
        .into());
    }
    if known.vocabulary.terms.contains_key(&names::act(&args.name)) {
        return Err(Diagnostic::error(
            "X011",
            format!("the ontology already has a term `{}`", args.name),
        )
        .help("choose another name, or edit the existing entry")
        .into());
    }
    // The example rule uses an object such as `pickObject`, rather than a surface or a place.
    let things = action
        .parameters
        .iter()
        .find(|name| name.ends_with("Object"));
    let designator = things
        .or(action.parameters.first())
        .map_or("pickObject", String::as_str);
    Ok(property_template(
        &args.name,
        &args.action,
        designator,
        "../rules/",
    ))
}

/// Appends the entry of a property to an ontology's text.
fn with_entry(ontology: &str, template: &Template) -> String {
    format!(
        "{}{}",
        ontology.trim_end(),
        template.ontology_entry.replacen('\n', "\n\n", 1)
    )
}

/// X011: the rule file exists.
fn is_there(rule: &Path) -> Diagnostics {
    Diagnostic::error("X011", format!("{} already exists", rule.display()))
        .help("choose another name, or edit that file")
        .into()
}

/// Adds a property to an ontology on disk. `is_named`: by the user.
fn write_property(
    path: &Path,
    rule: &Path,
    template: &Template,
    is_named: bool,
) -> Result<(), Diagnostics> {
    if rule.exists() {
        return Err(is_there(rule));
    }
    let text = Files::Disk.read(path).map_err(|why| {
        output_file::cannot_write(path, why)
            .help("name an ontology in a writable folder with `--ontology FILE`")
    })?;
    output_file::write_in_project(rule, &template.rule_text)?;
    let text = with_entry(&text.text, template);
    if is_named {
        output_file::write(path, text)
    } else {
        output_file::write_in_project(path, text)
    }?;
    output::print_prose(&format!(
        "wrote {} and an entry in {}\n",
        rule.display(),
        path.display()
    ));
    Ok(())
}

/// Writes the shipped ontology and rules, with the property added, into a folder without an
/// ontology.
fn write_project(path: &Path, rule: &Path, template: &Template) -> Result<(), Diagnostics> {
    if Files::Shipped.read_bytes(rule).is_ok() {
        return Err(is_there(rule));
    }
    let mut files = NewFiles::default();
    files.add_shipped("ontology")?;
    files.add_shipped("rules")?;
    let shipped = Files::Shipped
        .read(path)
        .map_err(|why| output_file::cannot_write(path, why))?;
    files.add(path, with_entry(&shipped.text, template));
    files.add(rule, template.rule_text.as_str());
    files.write(
        "this folder has no ontology/actions.ttl, so the shipped ontology and rules would be written: \
        move that file away, or name your ontology with `--ontology FILE`",
    )?;
    output::print_prose(&format!(
        "wrote {}: the shipped ontology and rules, with {} and its entry in {} added\n",
        files.in_words(),
        rule.display(),
        path.display()
    ));
    Ok(())
}

/// Makes configurations from `actcheck new campaign` use this folder's ontology, and lists those
/// that still use the shipped one.
fn link_configurations(ontology: &Path) -> Result<(), Diagnostics> {
    for file in configurations::here() {
        let Ok(source) = Files::Disk.read(&file) else {
            continue;
        };
        let folder = file
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty());
        match (link_ontology(&source.text), folder) {
            (LinksOntology::Already, _) => {}
            (LinksOntology::Now(text), None) => {
                output_file::write_in_project(&file, text)?;
                output::print_prose(&format!(
                    "{} uses {} from now on\n",
                    file.display(),
                    ontology.display()
                ));
            }
            (_, folder) => {
                let seen = folder.map_or(ontology.to_owned(), |_| Path::new("..").join(ontology));
                let line = format!("ontology = \"{}\"", seen.display());
                output::print_prose(&format!(
                    "{} uses the shipped ontology: add `{line}` to judge the property\n",
                    file.display()
                ));
            }
        }
    }
    Ok(())
}
