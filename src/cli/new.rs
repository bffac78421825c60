//! `actcheck new`

use clap::{Args, Subcommand};

use crate::new_campaign::{self, NewCampaignArgs};
use crate::new_property::{self, NewPropertyArgs};
use crate::new_robot::{self, NewRobotArgs};
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
}

/// Creates a configuration, a property or a profile.
pub fn new(args: &NewArgs) -> Result<(), Diagnostics> {
    match &args.kind {
        NewKind::Campaign(args) => new_campaign::campaign(args),
        NewKind::Property(args) => new_property::property(args),
        NewKind::Robot(args) => new_robot::robot(args),
    }
}
