//! `actcheck new`

use clap::{Args, Subcommand};

use crate::base::Diagnostics;
use crate::cli::new_campaign::{self, NewCampaignArgs};
use crate::cli::new_property::{self, NewPropertyArgs};

/// `actcheck new`
#[derive(Debug, Args)]
pub struct NewArgs {
    /// What is new.
    #[command(subcommand)]
    pub kind: NewKind,
}

/// What can be new.
#[derive(Debug, Subcommand)]
pub enum NewKind {
    /// A configuration of a campaign, explained line by line, which runs as it is
    ///
    /// It uses the ontology, the rules and the models that the program carries, and needs no other file. With `--with` they are copied
    /// into this folder, to be edited, and the configuration uses the copies. Existing files are never overwritten.
    #[command(
        after_help = "Examples:\n  actcheck new campaign\n  actcheck new campaign crowded --with ontology,skill,model"
    )]
    Campaign(NewCampaignArgs),
    /// A success property: its rule file and its entry in the ontology
    ///
    /// If this folder has no ontology, the one that the program carries is written first, with its rules, and configurations from
    /// `actcheck new campaign` use it from then on.
    #[command(after_help = "Example:\n  actcheck new property StaysUpright --for Pick")]
    Property(NewPropertyArgs),
}

/// Writes what is new.
pub fn new(args: &NewArgs) -> Result<(), Diagnostics> {
    match &args.kind {
        NewKind::Campaign(args) => new_campaign::campaign(args),
        NewKind::Property(args) => new_property::property(args),
    }
}
