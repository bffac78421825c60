//! `actcheck new`

use clap::{Args, Subcommand};

use crate::completions::{self, CompletionsArgs};
use crate::groups;
use crate::man::{self, ManArgs};
use crate::new_campaign::{self, NewCampaignArgs};
use crate::new_property::{self, NewPropertyArgs};
use crate::new_robot::{self, NewRobotArgs};
use crate::schema::{self, SchemaArgs};
use actcheck_base::Diagnostics;

/// `actcheck new`
#[derive(Debug, Args)]
pub struct NewArgs {
    /// The kind of thing to create.
    #[command(subcommand)]
    pub kind: NewKind,
}

/// Things that can be created.
#[derive(Debug, Subcommand)]
pub enum NewKind {
    /// A campaign configuration that runs as it is, explained line by line
    ///
    /// It uses the shipped ontology, rules and models, and needs no other file. `--with` copies
    /// them into this folder for editing, and the configuration uses the copies. Existing files are
    /// never overwritten.
    #[command(
        after_help = "Examples:\n  actcheck new campaign\n  actcheck new campaign crowded --with ontology,skill,model"
    )]
    Campaign(NewCampaignArgs),
    /// A success property: its rule file and its entry in the ontology
    ///
    /// If this folder has no ontology, the shipped one is written first, with its rules, and
    /// configurations from `actcheck new campaign` use it from then on.
    #[command(after_help = "Example:\n  actcheck new property StaysUpright --for Pick")]
    Property(NewPropertyArgs),
    /// A robot's profile, proposed from its model
    ///
    /// Finds base, arm, gripper, grasp frame, opening, camera, head and postures by the kinematics
    /// and the names in a URDF or xacro file, and writes them with a comment for each guess.
    /// Existing files are never overwritten.
    #[command(after_help = "Example:\n  actcheck new robot models/robots/fixed_arm.urdf")]
    Robot(NewRobotArgs),
    /// The JSON schema of configurations, for completion and validation in editors
    ///
    /// Editors that use taplo, such as VS Code with Even Better TOML, read it if a configuration
    /// begins with the line `#:schema campaign.schema.json`. Only `actcheck check` checks model
    /// names and relations between keys.
    #[command(
        after_help = "Examples:\n  actcheck new schema > campaign.schema.json\n  actcheck new schema --markdown > configuration.md"
    )]
    Schema(SchemaArgs),
    /// A shell completion script for commands and options
    ///
    /// Save it where the shell finds it: `~/.local/share/bash-completion/completions/actcheck` for
    /// bash, `_actcheck` in a folder of `$fpath` for zsh,
    /// `~/.config/fish/completions/actcheck.fish` for fish.
    #[command(
        after_help = "Examples:\n  actcheck new completions bash > actcheck.bash\n  . ./actcheck.bash"
    )]
    Completions(CompletionsArgs),
    /// The manual as a man page, or one page for each command
    #[command(
        after_help = "Examples:\n  actcheck new man | man -l -\n  actcheck new man --out man1"
    )]
    Man(ManArgs),
}

/// Creates a configuration, a property or a profile, or prints a file for editors and shells.
pub fn new(args: &NewArgs) -> Result<(), Diagnostics> {
    match &args.kind {
        NewKind::Campaign(args) => new_campaign::campaign(args),
        NewKind::Property(args) => new_property::property(args),
        NewKind::Robot(args) => new_robot::robot(args),
        NewKind::Schema(args) => {
            schema::schema(args);
            Ok(())
        }
        NewKind::Completions(args) => {
            completions::completions(args, groups::command_tree());
            Ok(())
        }
        NewKind::Man(args) => man::man(args, groups::command_tree()),
    }
}
