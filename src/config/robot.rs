//! Robot profiles: the roles of a URDF's joints and links.

use actcheck_base::{Diagnostic, Diagnostics, Digest, Files, Source, digest_of};
use actcheck_data::{
    LinkFrame, RobotCore, RobotProfile, SeenLink, StatedFingers, StatedHand, StatedRobot,
};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::foreign::robot::RobotFile;
use crate::foreign::{self, Lookup};
use crate::paths::resolve_path;
use crate::robot_cup::{OF_FINGERS, exclude_fingers, read_suction};
use crate::robot_place::{read_base, read_place};
use crate::robot_roles::Roles;
use crate::xacro::{self, Inputs, Unexpanded};
use crate::{Located, Table};

/// Number of folders above the URDF that are searched for `package://`. `PACKAGE/robots/FILE.urdf`
/// needs two.
const PACKAGE_LEVELS: usize = 4;

/// Required keys of a profile. The others are found on the model, when its meshes are known.
const REQUIRED: [&str; 1] = ["urdf"];

/// Keys that most profiles have.
const USUAL: [&str; 7] = [
    "arm_joints",
    "finger_joints",
    "finger_links",
    "grasp_link",
    "camera_link",
    "max_opening_m",
    "home",
];

/// Most joints whose motors move the fingers.
const MOST_FINGER_JOINTS: usize = 8;

/// Keys that depend on another key.
const DEPENDENT: [(&str, &str); 11] = [
    ("suction_force_n", "suction_radius_m"),
    ("suction_radius_m", "suction_force_n"),
    ("suction_friction", "suction_force_n"),
    ("suction_force_n", "grasp_link"),
    ("grasp_turned_rad", "grasp_link"),
    ("grasp_offset_m", "grasp_link"),
    ("camera_turned_rad", "camera_link"),
    ("camera_offset_m", "camera_link"),
    ("home", "arm_joints"),
    ("postures", "arm_joints"),
    ("postures", "home"),
];

/// Rotation of the camera's frame relative to a link whose name contains `optical`, if the profile
/// has none: by ROS's convention, z points forwards and y down in the frame of such a link. Unit:
/// radians.
pub const OPTICAL_TURNED_RAD: [f64; 3] = [
    std::f64::consts::FRAC_PI_2,
    -std::f64::consts::FRAC_PI_2,
    0.0,
];

/// Reads a profile with the meshes around its URDF: [`read_with`] without further folders.
///
/// # Errors
/// As [`read_with`].
pub fn read(files: &Files, path: &Path) -> Result<StatedRobot, Diagnostics> {
    read_with(files, path, &[])
}

/// Reads a profile, its URDF (relative to the profile) and the URDF's meshes. `package://NAME/…` is
/// looked up in the profile's `package_dirs`, in `packages`, and around the URDF. xacro is
/// expanded.
///
/// # Errors
/// All faults of both texts: those of the table reader (`C…`), an unreadable file (W010), a list of
/// the wrong length (W011), a failed xacro expansion (W012), an argument for xacro that is not a
/// value (W013), faults of the URDF and its meshes (W031 to W037, W051), and roles that the URDF's
/// joints and links can't fill (W050 to W054).
pub fn read_with(
    files: &Files,
    path: &Path,
    packages: &[PathBuf],
) -> Result<StatedRobot, Diagnostics> {
    read_telling(files, path, packages).map(|(profile, _)| profile)
}

/// As [`read_with`], with the warnings of the URDF (W036).
///
/// # Errors
/// As [`read_with`].
pub(crate) fn read_telling(
    files: &Files,
    path: &Path,
    packages: &[PathBuf],
) -> Result<(StatedRobot, Diagnostics), Diagnostics> {
    let source = files.read(path).map_err(|reason| {
        Diagnostic::error(
            "W010",
            format!("cannot read the robot profile {}: {reason}", path.display()),
        )
        .help("a profile is a TOML file that names a URDF and its joints")
    })?;
    let mut table = Table::parse(&source)?;
    table.require(&REQUIRED);
    let has_cup = table.has("suction_force_n") || table.has("suction_radius_m");
    if has_cup {
        exclude_fingers(&mut table);
    }
    let usual: Vec<&str> = USUAL
        .into_iter()
        .filter(|key| !(has_cup && OF_FINGERS.contains(key)))
        .collect();
    table.expect(&usual);
    let mut found = Diagnostics::new();
    let (urdf, lookup) = find_urdf(files, path, packages, &mut table);
    for (key, of) in DEPENDENT {
        if let (Some(span), false) = (table.key_span(key), table.has(of)) {
            let help = if key.starts_with("suction") {
                "a suction cup needs `suction_force_n`, `suction_radius_m`, and a `grasp_link` at its lip".to_owned()
            } else {
                format!("write `{of}` too, or leave out both: then they are found on the model")
            };
            table.fault(
                "W011",
                span,
                format!("`{key}` depends on `{of}`, which is missing"),
                help,
            );
        }
    }
    let read = urdf
        .as_ref()
        .and_then(|(text, path)| foreign::robot::read(text, path, &lookup, &mut found));
    let mut roles = Roles::default();
    let profile = read_table(&mut table, read.as_ref(), &mut roles, &mut found);
    if let Some(read) = &read {
        roles.check(&read.tree, &mut table);
    }
    table.finish(&mut found);
    let warnings = found.clone();
    found.or(())?;
    // Every missing or wrong key was reported above, so this error only occurs together with
    // another.
    let incomplete = || {
        Diagnostic::error("W010", "the robot profile is incomplete")
            .in_source(&source)
            .into()
    };
    profile
        .map(|profile| (profile, warnings))
        .ok_or_else(incomplete)
}

/// Returns a robot with the links and joints of another URDF instead of its own; its meshes stay.
/// Shapes and masses are not checked.
///
/// # Errors
/// Faults of the text: W031 to W036, W051, W055.
pub fn with_urdf(core: RobotCore, urdf: Source) -> Result<RobotCore, Diagnostics> {
    let tree = foreign::robot::tree_of_urdf(&urdf)?;
    Ok(RobotCore {
        urdf,
        tree: Arc::new(tree),
        ..core
    })
}

/// Reads the appearance of the links of a profile's robot, by the names in its file. Faults are
/// warnings, and the links with faults have their collision shapes. Returns nothing if the profile
/// can't be read: [`read_with`] reports the reason.
pub(crate) fn seen(
    files: &Files,
    path: &Path,
    packages: &[PathBuf],
    found: &mut Diagnostics,
) -> BTreeMap<String, SeenLink> {
    let table = files.read(path).ok().map(|source| Table::parse(&source));
    let Some(Ok(mut table)) = table else {
        return BTreeMap::new();
    };
    let without = values(table.strings("no_collision_links").unwrap_or_default());
    match find_urdf(files, path, packages, &mut table) {
        (Some((urdf, path)), lookup) => {
            foreign::robot::seen(&urdf, &path, &lookup, &without, found)
        }
        (None, _) => BTreeMap::new(),
    }
}

/// A URDF with moments of inertia that a body can have, where its own are impossible (W034, W036).
#[derive(Debug, Clone, PartialEq)]
pub struct MendedUrdf {
    /// The file that was mended: the URDF, or the xacro that was expanded.
    pub original: PathBuf,
    /// The mended text.
    pub text: String,
    /// Each change as a sentence without a full stop.
    pub changes: Vec<String>,
}

/// Mends the URDF of a profile. Returns `None` if it has no moments of inertia to mend, or can't be
/// read: [`read_with`] reports the reason.
pub fn mended(files: &Files, path: &Path, packages: &[PathBuf]) -> Option<MendedUrdf> {
    let source = files.read(path).ok()?;
    let mut table = Table::parse(&source).ok()?;
    let (urdf, lookup) = find_urdf(files, path, packages, &mut table);
    let (urdf, original) = urdf?;
    let mut mends = foreign::robot::read(&urdf, &original, &lookup, &mut Diagnostics::new())?.mends;
    if mends.is_empty() {
        return None;
    }
    // From the last place to the first, so that the others stay valid.
    mends.sort_by_key(|mend| std::cmp::Reverse(mend.span.start));
    let mut text = urdf.text.to_string();
    for mend in &mends {
        text.replace_range(mend.span.clone(), &mend.text);
    }
    Some(MendedUrdf {
        original,
        text,
        changes: mends.into_iter().rev().map(|mend| mend.change).collect(),
    })
}

/// Finds the URDF of a profile, with its path, and the folders of its meshes.
fn find_urdf<'a>(
    files: &'a Files,
    profile: &Path,
    packages: &[PathBuf],
    table: &mut Table,
) -> (Option<(Source, PathBuf)>, Lookup<'a>) {
    let folder = profile.parent().unwrap_or(Path::new(""));
    let own = values(table.strings("package_dirs").unwrap_or_default());
    let arguments = table.strings("xacro_args").unwrap_or_default();
    let mut folders: Vec<PathBuf> = own
        .into_iter()
        .map(|written| resolve_path(folder, &written))
        .collect();
    let Some(written) = table.string("urdf") else {
        return (None, Lookup::new(files, folders));
    };
    let path = resolve_path(folder, &written.value);
    folders.extend(around(&path, packages));
    let refused: Vec<_> = arguments
        .iter()
        .filter_map(|written| Some((written.span.clone(), xacro::refusal(&written.value)?)))
        .collect();
    if !refused.is_empty() {
        for (span, Unexpanded { message, help }) in refused {
            table.fault("W013", span, message, help);
        }
        return (None, Lookup::new(files, folders));
    }
    let arguments = values(arguments);
    let urdf = match text_of(
        files,
        &path,
        Inputs {
            arguments: &arguments,
            folders: &folders,
        },
    ) {
        Ok(urdf) => Some((urdf, path)),
        Err(Unread { code, fault }) => {
            table.fault(code, written.span, fault.message, fault.help);
            None
        }
    };
    (urdf, Lookup::new(files, folders))
}

/// The words of the command that reading a profile starts: of `xacro`, if its URDF is to be
/// expanded.
pub(crate) fn expansion(files: &Files, profile: &Path) -> Option<Vec<OsString>> {
    let source = files.read(profile).ok()?;
    let mut table = Table::parse(&source).ok()?;
    let arguments = values(table.strings("xacro_args").unwrap_or_default());
    let path = resolve_path(
        profile.parent().unwrap_or(Path::new("")),
        &table.string("urdf")?.value,
    );
    xacro::is_xacro(&path).then(|| xacro::words(&path, &arguments))
}

/// Folders in which the packages of a robot's file are looked up: those given, then those around
/// the file.
fn around(path: &Path, packages: &[PathBuf]) -> Vec<PathBuf> {
    let above = path
        .ancestors()
        .skip(1)
        .take(PACKAGE_LEVELS)
        .map(Path::to_path_buf);
    packages.iter().cloned().chain(above).collect()
}

/// Reads a robot's file without a profile: its model, meshes and name, with no roles assigned.
///
/// # Errors
/// As [`read_with`], without the faults of roles.
pub fn bare(
    files: &Files,
    path: &Path,
    packages: &[PathBuf],
    arguments: &[String],
) -> Result<RobotCore, Diagnostics> {
    let folders = around(path, packages);
    if let Some(refused) = arguments
        .iter()
        .find_map(|argument| xacro::refusal(argument))
    {
        return Err(Unread {
            code: "W013",
            fault: refused,
        }
        .faults());
    }
    let urdf = text_of(
        files,
        path,
        Inputs {
            arguments,
            folders: &folders,
        },
    )
    .map_err(Unread::faults)?;
    let mut found = Diagnostics::new();
    let read = foreign::robot::read(&urdf, path, &Lookup::new(files, folders), &mut found);
    found.or(())?;
    let incomplete = || Diagnostic::error("W010", "the robot has no links").in_source(&urdf);
    let read = read.ok_or_else(incomplete)?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    Ok(RobotCore {
        name: name.split('.').next().unwrap_or_default().to_owned(),
        digest: read.digest_with(digest_of(&read.text.text)),
        urdf: read.urdf,
        tree: Arc::new(read.tree),
        base_joints: None,
        planar_base: false,
        mount_height_m: 0.0,
        mount_turned_rad: 0.0,
        on_surface: false,
        reach_m: None,
        head_joints: Vec::new(),
        other_joints: Vec::new(),
        parked: Vec::new(),
        no_collision_links: Vec::new(),
        meshes: read.meshes,
        surfaces: BTreeMap::new(),
    })
}

/// Why a robot's file can't be read.
struct Unread {
    code: &'static str,
    fault: Unexpanded,
}

impl Unread {
    fn faults(self) -> Diagnostics {
        Diagnostic::error(self.code, self.fault.message)
            .help(self.fault.help)
            .into()
    }
}

/// Returns the text of a robot's file; that of xacro after expansion.
fn text_of(files: &Files, path: &Path, inputs: Inputs<'_>) -> Result<Source, Unread> {
    let text = files.read(path).map_err(|reason| {
        let message = format!("cannot read the robot {}: {reason}", path.display());
        Unread {
            code: "W010",
            fault: Unexpanded {
                message,
                help: "the path is relative to the profile".to_owned(),
            },
        }
    })?;
    if xacro::is_xacro(path) {
        return xacro::expand(path, inputs).map_err(|fault| Unread {
            code: "W012",
            fault,
        });
    }
    Ok(text)
}

fn read_table(
    table: &mut Table,
    read: Option<&RobotFile>,
    roles: &mut Roles,
    found: &mut Diagnostics,
) -> Option<StatedRobot> {
    let file_stem = Path::new(&*table.source().name)
        .file_stem()
        .map(|stem| stem.to_string_lossy().into_owned());
    let name = table
        .string("name")
        .map(|name| name.value)
        .or(file_stem)
        .unwrap_or_default();
    let base = read_base(table, roles);
    let arm_joints = table.non_empty_strings("arm_joints");
    roles
        .joints
        .push(("arm_joints", arm_joints.clone().unwrap_or_default()));
    let finger_joints = finger_joints(table, roles);
    let finger_links = names(table, "finger_links", roles);
    let head_joints = table.strings("head_joints").unwrap_or_default();
    roles.joints.push(("head_joints", head_joints.clone()));
    let other_joints = table.strings("other_joints").unwrap_or_default();
    roles.joints.push(("other_joints", other_joints.clone()));
    let (parked_span, has_parked) = (table.key_span("parked_joints"), table.has("parked"));
    let parked_joints = table.strings("parked_joints").unwrap_or_default();
    roles.joints.push(("parked_joints", parked_joints.clone()));
    let parked = posture(
        table,
        "parked",
        ("parked_joints", parked_joints.len()),
        roles,
    )
    .unwrap_or_default();
    if let (Some(span), false) = (parked_span, has_parked) {
        let message = "`parked_joints` needs `parked`: the position of each of them".to_owned();
        table.fault(
            "W011",
            span,
            message,
            "give one position for each joint, in metres or radians",
        );
    }
    let no_collision_links = table.strings("no_collision_links").unwrap_or_default();
    roles.links.push(no_collision_links.clone());
    let (grasp_link, camera_link) = (table.string("grasp_link"), table.string("camera_link"));
    // A camera that is fixed in the world is on no link.
    let in_world = camera_link
        .as_ref()
        .is_some_and(|link| link.value == RobotProfile::MAP);
    let of_robot = camera_link.iter().filter(|_| !in_world);
    roles
        .links
        .push(grasp_link.iter().chain(of_robot).cloned().collect());
    let grasp_turned_rad = table.numbers("grasp_turned_rad", ..).unwrap_or([0.0; 3]);
    let grasp_offset_m = table
        .numbers("grasp_offset_m", -1.0..=1.0)
        .unwrap_or([0.0; 3]);
    let camera_turned_rad = table.numbers("camera_turned_rad", ..).unwrap_or_else(|| {
        let is_optical = camera_link
            .as_ref()
            .is_some_and(|link| link.value.contains("optical"));
        if is_optical {
            OPTICAL_TURNED_RAD
        } else {
            [0.0; 3]
        }
    });
    let farthest_m = if in_world { 100.0 } else { 1.0 };
    let camera_offset_m = table
        .numbers("camera_offset_m", -farthest_m..=farthest_m)
        .unwrap_or([0.0; 3]);
    let mount_height_m = table.number("mount_height_m", 0.0..=3.0).unwrap_or(0.0);
    let (on_surface, reach_m) = read_place(
        table,
        base.as_ref().is_some_and(|(joints, _)| joints.is_some()),
    );
    let mount_turned_rad = table
        .number(
            "mount_turned_rad",
            -std::f64::consts::TAU..=std::f64::consts::TAU,
        )
        .unwrap_or(0.0);
    let opening_span = table.key_span("max_opening_m");
    let max_opening_m = table.number("max_opening_m", 0.001..=1.0);
    roles.opening = opening_span.zip(max_opening_m);
    let finger_friction = table.number("finger_friction", 0.0..=2.0);
    let grip_force_n = table.number("grip_force_n", 0.1..=1000.0);
    let suction = read_suction(table);
    let n_arm_joints = arm_joints.as_ref().map_or(0, Vec::len);
    let home = posture(table, "home", ("arm_joints", n_arm_joints), roles);
    let postures = table
        .tables("postures")
        .into_iter()
        .filter_map(|mut posture_table| {
            let arm = posture(
                &mut posture_table,
                "arm",
                ("arm_joints", n_arm_joints),
                roles,
            );
            posture_table.finish(found);
            arm
        });
    let postures: Vec<Vec<f64>> = postures.collect();
    let (base_joints, planar_base) = base?;
    let read = read?;
    let mut digest = Digest::new();
    digest.update(table.source().text.as_bytes());
    digest.update(read.text.text.as_bytes());
    let digest = read.digest_with(digest.finish());
    let core = RobotCore {
        name,
        urdf: read.urdf.clone(),
        tree: Arc::new(read.tree.clone()),
        base_joints,
        planar_base,
        mount_height_m,
        mount_turned_rad,
        on_surface,
        reach_m,
        head_joints: values(head_joints),
        other_joints: values(other_joints),
        parked: values(parked_joints).into_iter().zip(parked).collect(),
        no_collision_links: values(no_collision_links),
        meshes: read.meshes.clone(),
        surfaces: BTreeMap::new(),
        digest,
    };
    let grasp = grasp_link.map(|link| LinkFrame {
        link: link.value,
        offset_m: grasp_offset_m,
        turned_rad: grasp_turned_rad,
    });
    let camera = camera_link.map(|link| LinkFrame {
        link: link.value,
        offset_m: camera_offset_m,
        turned_rad: camera_turned_rad,
    });
    let hand = match suction {
        Some(cup) => StatedHand::Cup { grasp: grasp?, cup },
        None => StatedHand::Fingers(StatedFingers {
            grasp,
            finger_joints,
            finger_links,
            max_opening_m,
            finger_friction,
            grip_force_n,
        }),
    };
    Some(StatedRobot {
        core,
        arm_joints: arm_joints.map(values),
        hand,
        camera,
        home,
        postures,
    })
}

fn values(list: Vec<Located<String>>) -> Vec<String> {
    list.into_iter().map(|name| name.value).collect()
}

/// Reads the joints whose motors move the fingers.
fn finger_joints(table: &mut Table, roles: &mut Roles) -> Option<Vec<String>> {
    let span = table.key_span("finger_joints")?;
    let list = table.strings("finger_joints")?;
    roles.joints.push(("finger_joints", list.clone()));
    if !(1..=MOST_FINGER_JOINTS).contains(&list.len()) {
        let message = format!(
            "`finger_joints` must list 1 to {MOST_FINGER_JOINTS} names, but this list has {}",
            list.len()
        );
        let help = "name the joints with motors; joints that mimic them follow without being named";
        table.fault(
            "W011",
            span,
            message,
            with_candidates(help, list.is_empty()),
        );
        return None;
    }
    Some(values(list))
}

/// Reads a list of exactly `N` names: of links if the key ends in `_links`, else of joints.
pub(super) fn names<const N: usize>(
    table: &mut Table,
    key: &'static str,
    roles: &mut Roles,
) -> Option<[String; N]> {
    let span = table.key_span(key)?;
    let list = table.strings(key)?;
    let length = list.len();
    if key.ends_with("_links") {
        roles.links.push(list.clone());
    } else {
        roles.joints.push((key, list.clone()));
    }
    let names = <[String; N]>::try_from(values(list)).ok();
    if names.is_none() {
        let message = format!("`{key}` must list {N} names, but this list has {length}");
        let help = if key.starts_with("finger") {
            "name the links of two fingertips, left then right; one of them may be fixed"
        } else {
            "see models/robots/mobile_manipulator.toml for an example"
        };
        let is_gap = length == 0 && key.starts_with("finger");
        table.fault("W011", span, message, with_candidates(help, is_gap));
    }
    names
}

/// The help about a list of the hand; an empty one may be a gap that `actcheck new robot` left.
fn with_candidates(help: &str, is_gap: bool) -> String {
    match is_gap {
        true => format!("{help}; `actcheck new robot` lists the candidates above such a gap"),
        false => help.to_owned(),
    }
}

/// Reads one position for each arm joint.
fn posture(
    table: &mut Table,
    key: &str,
    (joints, n_joints): (&'static str, usize),
    roles: &mut Roles,
) -> Option<Vec<f64>> {
    let span = table.key_span(key);
    let (positions, span) = (table.number_list(key, ..)?, span?);
    if positions.len() != n_joints && (n_joints > 0 || joints != "arm_joints") {
        let what = if joints == "arm_joints" {
            "arm joints"
        } else {
            "parked joints"
        };
        let message = format!(
            "`{key}` has {} positions for {n_joints} {what}",
            positions.len()
        );
        table.fault(
            "W011",
            span,
            message,
            format!("give one position for each joint of `{joints}`"),
        );
        return None;
    }
    roles.postures.push((span, joints, positions.clone()));
    Some(positions)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_or_incomplete_profile_is_refused() {
        let found =
            read(&Files::Disk, Path::new("no/such/robot.toml")).expect_err("the file is missing");
        assert_eq!(found.iter().map(|d| d.code).collect::<Vec<_>>(), ["W010"]);
        let source = Source::new(
            "r.toml",
            "name = \"r\"\nurdf = \"r.urdf\"\narm_joints = [\"a\", \"b\"]\nhome = [0]\n\
            finger_joints = []\n",
        );
        let mut table = Table::parse(&source).expect("it is TOML");
        let mut found = Diagnostics::new();
        assert!(
            find_urdf(&Files::Disk, Path::new("no/such/r.toml"), &[], &mut table,)
                .0
                .is_none()
        );
        assert!(read_table(&mut table, None, &mut Roles::default(), &mut found).is_none());
        table.finish(&mut found);
        let codes: Vec<&str> = found.iter().map(|d| d.code).collect();
        assert_eq!(
            codes.iter().filter(|code| **code == "W011").count(),
            2,
            "{found}"
        );
        assert_eq!(
            codes.iter().filter(|code| **code == "W010").count(),
            1,
            "{found}"
        );
        assert_eq!(codes.len(), 3, "{found}");
    }

    #[test]
    fn a_key_without_the_one_it_depends_on_is_refused() {
        let text = "grasp_offset_m = [0, 0, 0.1]\ncamera_turned_rad = [0, 0, 0]\ncamera_link = \"c\"\nhome = [0]\n";
        let folder = std::env::temp_dir().join(format!("actcheck-robot-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("the folder is new");
        let path = folder.join("r.toml");
        std::fs::write(&path, text).expect("the file is new");
        let found = read(&Files::Disk, &path).expect_err("three keys are missing");
        std::fs::remove_dir_all(&folder).expect("the folder exists");
        let said: Vec<String> = found
            .iter()
            .map(|d| format!("{} {}", d.code, d.message))
            .collect();
        let expected = [
            "C005 `urdf` is missing",
            "W011 `grasp_offset_m` depends on `grasp_link`, which is missing",
            "W011 `home` depends on `arm_joints`, which is missing",
        ];
        assert_eq!(said, expected, "{found}");
    }
}
