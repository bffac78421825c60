//! `actcheck check`

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::Args;

use crate::new_files::NewFiles;
use crate::picture::Picture;
use crate::{configurations, output, regressions};
use actcheck_base::Diagnostics;
use actcheck_campaign::Env;
use actcheck_config::robot::MendedUrdf;
use actcheck_config::{Overrides, mended_robot};
use actcheck_report::robot_picture;
use actcheck_rules::Budget;

/// `actcheck check`
#[derive(Debug, Args)]
pub struct CheckArgs {
    /// The campaign's configuration (TOML) [default: configs/pick.toml]
    pub config: Option<PathBuf>,

    /// Write a copy of the robot's URDF beside it, in which impossible moments of inertia (W034,
    /// W036) are those of a box around the link
    #[arg(long)]
    pub mend: bool,

    /// Draw the robot in its postures into this file, with the frames of base, grasp and camera, as
    /// a raster (.png) or vector image (.svg)
    #[arg(long, value_name = "FILE.png")]
    pub picture: Option<PathBuf>,
}

/// Prints the parts that a campaign would use, or returns all its faults. `stop` interrupts it.
pub fn check(args: &CheckArgs, stop: &Arc<AtomicBool>) -> Result<(), Diagnostics> {
    let usual = Path::new("configs/pick.toml");
    let config = match &args.config {
        Some(config) => config.as_path(),
        None if usual.exists() => usual,
        None => return Err(configurations::none_given("check").into()),
    };
    let picture = args.picture.as_deref().map(Picture::new).transpose()?;
    let mended = if args.mend {
        mended_robot(config)
    } else {
        None
    };
    if let Some(mended) = mended {
        return write_mended(mended);
    }
    let budget = Budget {
        stop: Arc::clone(stop),
        ..Budget::default()
    };
    let env = Env::prepare_within(config, &Overrides::default(), budget.clone())?;
    let cases = if env.campaign.case.is_some() {
        Vec::new()
    } else {
        regressions::prepare(&env, &budget)?
    };
    let starts = env.starts();
    if starts.has_errors() {
        return Err(starts);
    }
    output::print_diagnostics(&env.warnings());
    output::print_diagnostics(&starts);
    output::print_diagnostics(&env.forecast());
    output::print_prose(&format!(
        "{}: {}, {}, {}; {} and {} in {}; {}; robot {}\n",
        config.display(),
        counted(env.campaign.tests.len() as u64, "test"),
        counted(env.planned_runs(), "run"),
        counted(cases.len() as u64, "regression"),
        counted(env.ontology.actions.len() as u64, "action"),
        match env.ontology.properties.len() {
            1 => "1 property".to_owned(),
            count => format!("{count} properties"),
        },
        env.ontology
            .sources
            .first()
            .map_or("", |source| &source.name),
        counted(env.campaign.models.len() as u64, "model"),
        env.campaign.robot.core.name,
    ));
    output::print(&env.masses_and_sizes());
    if !env.found_on_robot.is_empty() {
        let found = env.found_on_robot.iter();
        let found: String = found
            .map(|(key, note)| format!("  {key}: {note}\n"))
            .collect();
        output::print_prose(&format!(
            "values that the robot's profile does not state:\n{found}"
        ));
    }
    if args.mend {
        output::print_prose(
            "nothing to mend: all moments of inertia of the robot's moving links are possible\n",
        );
    }
    if let (Some(picture), Some(drawing)) = (
        picture,
        robot_picture(&env.campaign.robot.core.name, &env.robot_views()),
    ) {
        picture.write(&drawing)?;
    }
    Ok(())
}

/// Writes a mended URDF beside the original, and lists the changes.
///
/// # Errors
/// As [`NewFiles::write`].
fn write_mended(mended: MendedUrdf) -> Result<(), Diagnostics> {
    let name = mended
        .original
        .file_name()
        .unwrap_or_default()
        .to_string_lossy();
    let stem = name.trim_end_matches(".xacro").trim_end_matches(".urdf");
    let copy = mended
        .original
        .with_file_name(format!("{stem}.mended.urdf"));
    let mut files = NewFiles::default();
    files.add(&copy, mended.text);
    files
        .write("it may have been written before: name it as `urdf` in the profile, or delete it")?;
    let changes: String = mended
        .changes
        .iter()
        .map(|change| format!("- {change}\n"))
        .collect();
    output::print_prose(&format!(
        "{changes}wrote {}: name it as `urdf` in the profile of the robot\n",
        copy.display()
    ));
    Ok(())
}

fn counted(count: u64, noun: &str) -> String {
    if count == 1 {
        format!("1 {noun}")
    } else {
        format!("{count} {noun}s")
    }
}
