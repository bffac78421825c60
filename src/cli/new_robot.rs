//! `actcheck new robot`

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;

use crate::new_files::NewFiles;
use crate::{hand_gap, output};
use actcheck_base::{Diagnostics, Files, ShellLine, Source};
use actcheck_campaign::{Proposal, proposed_robot};
use actcheck_config::quoted;
use actcheck_config::robot;
use actcheck_data::{Hand, LinkFrame};

/// Folder of the cache of convex meshes: the usual history beside a configuration.
const HISTORY: &str = ".actcheck";

/// `actcheck new robot`
#[derive(Debug, Args)]
pub struct NewRobotArgs {
    /// The robot's model: URDF, xacro (FILE.xacro), MJCF or SDF
    #[arg(value_name = "FILE")]
    pub model: PathBuf,
    /// Folders in which `package://NAME` and `$(find NAME)` look for packages, besides those around
    /// the model
    #[arg(long = "packages", value_name = "DIR")]
    pub package_dirs: Vec<PathBuf>,
    /// An argument of the xacro file, such as `gripper:=robotiq_2f_85`
    #[arg(long = "xacro-arg", value_name = "NAME:=VALUE")]
    pub xacro_args: Vec<String>,
    /// Of several hands, the one with TEXT in the name of a link or joint of its arm: `left`, for
    /// example
    #[arg(long, value_name = "TEXT")]
    pub hand: Option<String>,
    /// The profile to write [default: the model's name with the extension .toml, in this folder]
    #[arg(long, value_name = "PROFILE")]
    pub out: Option<PathBuf>,
}

/// Writes a profile proposed for a robot's model; with a gap for the hand if no gripper was found.
///
/// # Errors
/// Faults of the model (W…), W024 after a profile with a gap was written, X015 if the profile
/// exists, X007 if it can't be written.
pub fn robot(args: &NewRobotArgs) -> Result<(), Diagnostics> {
    let bare = robot::bare(
        &Files::Disk,
        &args.model,
        &args.package_dirs,
        &args.xacro_args,
    )?;
    let name = bare.name.clone();
    let out = args
        .out
        .clone()
        .unwrap_or_else(|| PathBuf::from(format!("{name}.toml")));
    let folder = out.parent().unwrap_or(Path::new(""));
    let proposal = proposed_robot(bare, &folder.join(HISTORY), args.hand.as_deref())?;
    let text = text(&proposal, args, folder);
    let mut files = NewFiles::default();
    files.add(&out, text.as_bytes());
    files.write("name another file with `--out PROFILE`, or delete it")?;
    output::print_prose(&written(&proposal, &out));
    match &proposal.hand {
        Ok(_) => Ok(()),
        Err(gap) => Err(hand_gap::fault(gap, &Source::new(out.display().to_string(), text)).into()),
    }
}

/// The message about a written profile.
fn written(proposal: &Proposal, out: &Path) -> String {
    let gripper = match &proposal.hand {
        Ok(Hand {
            suction: Some(cup),
            grasp,
            ..
        }) => format!(
            "a suction cup of {:.0} mm at {}",
            cup.radius_m * 2e3,
            grasp.link
        ),
        Ok(hand) => {
            let [left, right] = &hand.finger_links;
            format!(
                "fingers {left} and {right} that open {:.0} mm",
                hand.max_opening_m * 1e3
            )
        }
        Err(_) => "no gripper yet".to_owned(),
    };
    let next = match proposal.hand {
        Ok(_) => "",
        Err(_) => "fill in the gap in this file, then ",
    };
    let mut message = format!(
        "wrote {}: {} with an arm of {} joints, {gripper}, camera {}\n\
         next: {next}name it as `profile` in `[robot]` of a configuration, then `actcheck check CONFIG`\n",
        out.display(),
        if proposal.core.base_joints.is_some() {
            "a mobile robot"
        } else {
            "a fixed robot"
        },
        proposal.arm_joints.len(),
        proposal.camera.link,
    );
    if !proposal.other_hands.is_empty() {
        let others = proposal.other_hands.join("`, `");
        message.push_str(&format!(
            "this robot has another hand at `{others}`: `--hand TEXT` proposes a profile for it\n"
        ));
    }
    message
}

/// The profile as TOML, with a comment for each guess. The keys that the program finds on the model
/// whenever it reads the profile are comments too.
fn text(proposal: &Proposal, args: &NewRobotArgs, folder: &Path) -> String {
    let command = ShellLine::default()
        .fixed("actcheck new robot")
        .file(&args.model);
    let title = format!("# Proposed by `{command}`: check each guess.\n");
    let stated = lines(&stated(proposal, args, folder), &proposal.notes);
    let gap = proposal.hand.as_ref().err();
    let gap = gap.map(hand_gap::text).unwrap_or_default();
    let found = lines(&found(proposal), &proposal.notes)
        .lines()
        .map(commented)
        .collect::<String>();
    format!(
        "{title}\n{stated}{gap}\n# Found on the model whenever this profile is read. To change a line, remove its `# `, and those of \
         all lines\n# about the same link.\n{found}"
    )
}

fn commented(line: &str) -> String {
    match line.starts_with('#') {
        true => format!("{line}\n"),
        false => format!("# {line}\n"),
    }
}

/// Keys with their values, each after the basis of its guess.
fn lines(keys: &[(&'static str, String)], notes: &BTreeMap<&'static str, String>) -> String {
    let of = |(key, value): &(&'static str, String)| {
        let note = notes
            .get(key)
            .map(|note| format!("# Guessed: {note}.\n"))
            .unwrap_or_default();
        format!("{note}{key} = {value}\n")
    };
    keys.iter().map(of).collect()
}

/// The keys that a profile needs, or that decide about the others.
fn stated(proposal: &Proposal, args: &NewRobotArgs, folder: &Path) -> Vec<(&'static str, String)> {
    let core = &proposal.core;
    let mut keys = vec![("urdf", quoted(&seen_from(folder, &args.model)))];
    if !args.package_dirs.is_empty() {
        let folders: Vec<String> = args
            .package_dirs
            .iter()
            .map(|packages| seen_from(folder, packages))
            .collect();
        keys.push(("package_dirs", list(&folders)));
    }
    if !args.xacro_args.is_empty() {
        keys.push(("xacro_args", list(&args.xacro_args)));
    }
    match &core.base_joints {
        Some(_) if core.planar_base => keys.push(("base", quoted("planar"))),
        Some(joints) => keys.push(("base_joints", list(joints))),
        None => {}
    }
    if core.on_surface {
        keys.push(("mount", quoted("surface")));
    }
    if core.mount_turned_rad != 0.0 {
        keys.push(("mount_turned_rad", core.mount_turned_rad.to_string()));
    }
    if let Some(reach_m) = &core.reach_m {
        keys.push(("reach_m", numbers(reach_m)));
    }
    if core.mount_height_m != 0.0 {
        keys.push(("mount_height_m", core.mount_height_m.to_string()));
    }
    keys.push(("arm_joints", list(&proposal.arm_joints)));
    if let Ok(hand) = &proposal.hand {
        match &hand.suction {
            Some(cup) => {
                keys.extend(grasp_frame(&hand.grasp));
                keys.push(("suction_force_n", cup.force_n.to_string()));
                keys.push(("suction_radius_m", cup.radius_m.to_string()));
            }
            None => {
                keys.push(("finger_joints", list(&hand.finger_joints)));
                keys.push(("finger_links", list(&hand.finger_links)));
            }
        }
    }
    if !core.head_joints.is_empty() {
        keys.push(("head_joints", list(&core.head_joints)));
    }
    if !core.parked.is_empty() {
        let (joints, positions): (Vec<String>, Vec<f64>) = core.parked.iter().cloned().unzip();
        keys.push(("parked_joints", list(&joints)));
        keys.push(("parked", numbers(&positions)));
    }
    if !core.no_collision_links.is_empty() {
        keys.push(("no_collision_links", list(&core.no_collision_links)));
    }
    keys
}

/// The keys that a profile may leave out.
fn found(proposal: &Proposal) -> Vec<(&'static str, String)> {
    let mut keys = Vec::new();
    if let Ok(hand) = &proposal.hand
        && hand.suction.is_none()
    {
        keys.extend(grasp_frame(&hand.grasp));
        keys.push(("max_opening_m", hand.max_opening_m.to_string()));
    }
    let camera = &proposal.camera;
    keys.push(("camera_link", quoted(&camera.link)));
    let usual = if camera.link.contains("optical") {
        robot::OPTICAL_TURNED_RAD
    } else {
        [0.0; 3]
    };
    if camera.turned_rad != usual {
        keys.push(("camera_turned_rad", numbers(&camera.turned_rad)));
    }
    keys.push(("home", numbers(&proposal.home)));
    keys.push(("postures", postures(&proposal.postures)));
    keys
}

fn grasp_frame(grasp: &LinkFrame) -> [(&'static str, String); 3] {
    [
        ("grasp_link", quoted(&grasp.link)),
        ("grasp_offset_m", numbers(&grasp.offset_m)),
        ("grasp_turned_rad", numbers(&grasp.turned_rad)),
    ]
}

fn postures(postures: &[Vec<f64>]) -> String {
    let each = postures
        .iter()
        .map(|arm| format!("    {{ arm = {} }},\n", numbers(arm)));
    format!("[\n{}]", each.collect::<String>())
}

/// A path as it is written in a profile in this folder.
fn seen_from(folder: &Path, path: &Path) -> String {
    match folder.as_os_str().is_empty() {
        true => path.display().to_string(),
        false => std::path::absolute(path)
            .unwrap_or_else(|_| path.to_owned())
            .display()
            .to_string(),
    }
}

fn list(names: &[String]) -> String {
    format!(
        "[{}]",
        names
            .iter()
            .map(|name| quoted(name))
            .collect::<Vec<_>>()
            .join(", ")
    )
}

/// A list of numbers in TOML.
pub(super) fn numbers(values: &[f64]) -> String {
    format!(
        "[{}]",
        values
            .iter()
            .map(f64::to_string)
            .collect::<Vec<_>>()
            .join(", ")
    )
}
