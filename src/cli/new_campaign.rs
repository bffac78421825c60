//! `actcheck new campaign`

use std::path::Path;

use clap::{Args, ValueEnum};

use crate::new_files::NewFiles;
use crate::output;
use actcheck_base::{Diagnostic, Diagnostics, Files, ShellLine};
use actcheck_config::{CampaignTemplate, campaign_template};
use actcheck_ontology as ontology;

/// The example of a skill in Python.
const SKILL: &str = include_str!("shipped/pick.py");
/// Its path in a new project.
const SKILL_FILE: &str = "skills/pick.py";
/// The ontology's path in a project.
const ONTOLOGY: &str = "ontology/actions.ttl";

/// `actcheck new campaign`
#[derive(Debug, Args)]
pub struct NewCampaignArgs {
    /// Name of the configuration: letters, digits, `_` and `-`. The file is NAME.toml in this
    /// folder
    #[arg(default_value = "pick")]
    pub name: String,
    /// Also write these, and make the configuration use them
    #[arg(long, value_name = "PART", value_enum, value_delimiter = ',')]
    pub with: Vec<Part>,
}

/// Parts of a project besides its configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Part {
    /// Folder `ontology`: actions, properties, object categories. Includes `rules`, which it links
    Ontology,
    /// Folder `rules`: a file for each property. Includes `ontology`, which links them
    Rules,
    /// `skills/pick.py`: a skill in Python that performs the pick
    Skill,
    /// Folder `models`: objects, robots and worlds
    Model,
}

/// Writes a configuration and the parts that it uses.
pub fn campaign(args: &NewCampaignArgs) -> Result<(), Diagnostics> {
    check_name(&args.name)?;
    let has = |part: Part| args.with.contains(&part);
    let copies_ontology = has(Part::Ontology) || has(Part::Rules);
    let finds_ontology = !copies_ontology && is_usable(Path::new(ONTOLOGY));
    let template = CampaignTemplate {
        name: &args.name,
        ontology: copies_ontology || finds_ontology,
        models: has(Part::Model),
        skill: has(Part::Skill).then_some(SKILL_FILE),
    };
    let mut files = NewFiles::default();
    if copies_ontology {
        files.add_shipped("ontology")?;
        files.add_shipped("rules")?;
    }
    if has(Part::Model) {
        files.add_shipped("models")?;
    }
    if has(Part::Skill) {
        files.add(SKILL_FILE, SKILL);
    }
    let config = format!("{}.toml", args.name);
    files.add(&config, campaign_template(&template));
    files.write("give the campaign another name, or omit existing parts from `--with`")?;

    let mut text = format!("wrote {}\n", files.in_words());
    if finds_ontology {
        text.push_str(&format!(
            "{config} uses {ONTOLOGY}, which already existed\n"
        ));
    }
    if has(Part::Skill) {
        text.push_str(&format!("{SKILL_FILE} needs Python with the package `actcheck` (in actcheck's wheel, and in its sources in clients/python)\n"));
    }
    text.push_str(&format!(
        "next: {}\n",
        ShellLine::default().fixed("actcheck run").file(&config)
    ));
    output::print_prose(&text);
    Ok(())
}

/// Returns X011 unless a name is valid as a file name without quotation marks or folders.
fn check_name(name: &str) -> Result<(), Diagnostics> {
    let fits = |c: char| c.is_alphanumeric() || c == '_' || c == '-';
    if !name.is_empty() && name.chars().all(fits) {
        return Ok(());
    }
    Err(Diagnostic::error("X011", format!("`{name}` can't be the name of a campaign"))
        .help("use letters, digits, `_` and `-`, such as `actcheck new campaign my_pick`; the file gets the extension `.toml`")
        .into())
}

/// Whether the template can use an ontology: it exists, is well-formed, and has the template's
/// action.
fn is_usable(ontology: &Path) -> bool {
    ontology::load(&Files::Disk, ontology).is_ok_and(|known| known.actions.contains_key("Pick"))
}
