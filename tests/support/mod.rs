//! Shared helpers: the built program, and temporary folders.

pub mod checkout;
pub mod chromium;
pub mod expected;
pub mod exported;
pub mod foreign;
pub mod judge_values;
pub mod left_out;
pub mod line;
pub mod look;
pub mod made_up;
pub mod mutations;
pub mod nulls;
pub mod paged;
pub mod planted;
pub mod server;
pub mod triple_store;
pub mod urdf;

use std::collections::BTreeMap;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Arc, Mutex, OnceLock};

use actcheck::config::Campaign;
use actcheck::data::RobotProfile;
use actcheck::world;

/// The checkout's root.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The complete robot of a campaign; its model has no meshes.
pub fn robot_of(campaign: &Campaign) -> Arc<RobotProfile> {
    let completed = world::complete(&campaign.robot).unwrap();
    Arc::new(completed.profile)
}

/// Runs the built program in a folder.
pub fn actcheck(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_actcheck"))
        .args(arguments)
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .output()
        .unwrap()
}

/// Starts actcheck in a folder, without waiting for its end and without its output.
pub fn started(folder: &Path, args: &[&str]) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_actcheck"));
    command
        .args(args)
        .current_dir(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

/// Folders in `/proc` of the processes whose working directory is a folder, which must be
/// canonical.
pub fn processes_in(folder: &Path) -> Vec<PathBuf> {
    let processes = std::fs::read_dir("/proc")
        .unwrap()
        .flatten()
        .map(|entry| entry.path());
    processes
        .filter(|process| std::fs::read_link(process.join("cwd")).is_ok_and(|at| at == folder))
        .collect()
}

/// Sends a signal, such as `INT`, to a process, with the shell's builtin `kill`: minimal systems
/// have no other.
pub fn signal(process: u32, name: &str) {
    let sent = Command::new("sh")
        .args(["-c", &format!("kill -s {name} {process}")])
        .status()
        .unwrap();
    assert!(sent.success(), "process {process} is gone");
}

/// The output stream as text.
pub fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// The error stream as text.
pub fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// A copy of the shipped project with coarse physics in its configurations, for tests that are
/// about campaigns.
pub fn project() -> tempfile::TempDir {
    project_with(COARSE)
}

/// A copy of the shipped project with other physics in its configurations, such as [`COARSEST`].
pub fn project_with(physics: &str) -> tempfile::TempDir {
    let folder = shipped_project();
    for entry in std::fs::read_dir(folder.path().join("configs")).unwrap() {
        let file = entry.unwrap().path();
        let text = std::fs::read_to_string(&file).unwrap();
        std::fs::write(&file, text.replace("[physics]\n", physics)).unwrap();
    }
    folder
}

/// A copy of the shipped project: configurations, ontology, rules and models. For tests of the
/// robot's performance.
pub fn shipped_project() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in ["configs", "ontology", "rules", "models"] {
        copy(&root().join(name), &folder.path().join(name));
    }
    folder
}

/// Copies a folder without histories in it. An open history has the same content as one whose owner
/// was killed.
pub fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target: PathBuf = to.join(entry.file_name());
        if entry.file_name() == ".actcheck" {
            continue;
        }
        if entry.path().is_dir() {
            copy(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// Writes an executable file.
pub fn script(path: &Path, text: &str) {
    std::fs::write(path, text).unwrap();
    std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o755)).unwrap();
}

/// Replaces a part of a file; the part must exist.
pub fn edit(file: &Path, from: &str, to: &str) {
    let text = std::fs::read_to_string(file).unwrap();
    assert!(text.contains(from), "{} has no `{from}`", file.display());
    std::fs::write(file, text.replacen(from, to, 1)).unwrap();
}

/// Physics at a third of the cost, for tests that are not about physics: objects still stay in the
/// hand.
pub const COARSE: &str = "[physics]\nsteps_per_second = 120\niterations = 2\n";

/// The coarsest physics, for tests that do not need the robot to succeed: a held object slips out
/// of the hand.
pub const COARSEST: &str = "[physics]\nsteps_per_second = 60\niterations = 1\n";

/// A private copy of a history of four runs: only one process at a time may open a history.
pub fn made_history() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    copy_made_history(folder.path());
    folder
}

/// Copies a history of four simulated runs into a folder. The runs are made once.
pub fn copy_made_history(to: &Path) {
    static MADE: OnceLock<PathBuf> = OnceLock::new();
    let made = MADE.get_or_init(|| {
        // Statics are never dropped: a temporary folder would not be removed.
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("made-history");
        let _ = std::fs::remove_dir_all(&folder);
        let name = folder.display().to_string();
        let output = actcheck(
            root(),
            &[
                "run",
                "configs/quick.toml",
                "--runs",
                "4",
                "--jobs",
                "2",
                "--history",
                &name,
            ],
        );
        assert!(
            output.status.code().is_some_and(|code| code < 2),
            "{}",
            stderr(&output)
        );
        folder
    });
    copy(made, to);
}

/// A shipped campaign that was run completely.
pub struct Shipped {
    pub code: Option<i32>,
    /// The printed output.
    pub text: String,
    /// A project with the history in `h`.
    folder: PathBuf,
}

impl Shipped {
    /// A private copy of the folder: only one process at a time may open a history.
    pub fn copied(&self) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        copy(&self.folder, folder.path());
        folder
    }
}

/// A shipped campaign, run once for all tests.
pub fn shipped(name: &'static str) -> &'static Shipped {
    static MADE: Mutex<BTreeMap<&str, &OnceLock<Shipped>>> = Mutex::new(BTreeMap::new());
    let made = *MADE
        .lock()
        .unwrap()
        .entry(name)
        .or_insert_with(|| Box::leak(Box::default()));
    made.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("shipped-{name}"));
        let _ = std::fs::remove_dir_all(&folder);
        copy(shipped_project().path(), &folder);
        let output = actcheck(
            &folder,
            &[
                "run",
                &format!("configs/{name}.toml"),
                "--jobs",
                "2",
                "--history",
                "h",
            ],
        );
        assert!(
            output.status.code().is_some_and(|code| code < 2),
            "{}",
            stderr(&output)
        );
        Shipped {
            code: output.status.code(),
            text: stdout(&output),
            folder,
        }
    })
}
