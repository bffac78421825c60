//! Other people's tools, for tests that hold our files and our server to them. Where one is not to be had, the test says so in one
//! line, which also a test that passes shows, and ends.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use super::root;

/// Says that a part of a test was left out, and why.
pub fn left_out(what: &str, why: &str) {
    // The test program shows what is written to the stream itself.
    let _ = writeln!(std::io::stderr(), "LEFT OUT {what}: {why}");
}

/// Python with the packages of `tests/foreign/requirements.txt`, in an environment that is kept beside what was compiled.
pub fn python() -> Option<&'static Path> {
    static PYTHON: OnceLock<Option<PathBuf>> = OnceLock::new();
    PYTHON
        .get_or_init(|| {
            environment("python", "requirements.txt").map_err(|why| left_out("what needs Python's packages", &why)).ok()
        })
        .as_deref()
}

/// Python with our client, installed by pip from its folder into an environment that has only what it needs and its tests need.
/// The client is ours: where this can't be made, its tests fail, and say why.
pub fn client_python() -> &'static Path {
    static PYTHON: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    let made = PYTHON.get_or_init(|| {
        let python = environment("python_client", "python_client.txt")?;
        // As it is today. What builds it is in the environment already, so that this needs no network.
        let install = ["install", "--quiet", "--disable-pip-version-check", "--no-build-isolation", "--no-deps"];
        let client = root().join("clients/python");
        run(Command::new(&python).args(["-m", "pip"]).args(install).arg("--force-reinstall").arg(client))?;
        Ok(python)
    });
    made.as_deref().unwrap_or_else(|why| panic!("clients/python can't be installed for its tests: {why}"))
}

/// Python with maturin, and a folder with what the package needs from PyPI: wheels are made and installed without a network from then on.
pub fn maturin() -> Result<(PathBuf, PathBuf), String> {
    let python = environment("maturin", "../../clients/wheel/maturin.txt")?;
    let needs = Path::new(env!("CARGO_TARGET_TMPDIR")).join("package-needs");
    let versions = root().join("tests/foreign/python_client.txt");
    kept(&needs, &versions, |needs| {
        let download =
            ["-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--only-binary", ":all:", "numpy"];
        run(Command::new(&python).args(download).arg("--constraint").arg(&versions).arg("--dest").arg(needs))
    })?;
    Ok((python, needs))
}

/// An environment with the packages that a file in `tests/foreign` names, kept beside what was compiled: its Python.
fn environment(name: &str, packages: &str) -> Result<PathBuf, String> {
    let wanted = root().join("tests/foreign").join(packages);
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    kept(&folder, &wanted, |folder| {
        run(Command::new("python3").args(["-m", "venv", "--clear"]).arg(folder))?;
        let mut pip = Command::new(folder.join("bin/python"));
        run(pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r"]).arg(&wanted))
    })?;
    Ok(folder.join("bin/python"))
}

/// Allure's own generator from npm, as `tests/foreign/package.json` pins it, kept beside what was compiled.
pub fn allure() -> Option<&'static Path> {
    static ALLURE: OnceLock<Option<PathBuf>> = OnceLock::new();
    ALLURE
        .get_or_init(|| {
            let wanted = root().join("tests/foreign/package.json");
            let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("allure");
            kept(&folder, &wanted, |folder| {
                std::fs::create_dir_all(folder).map_err(|error| error.to_string())?;
                std::fs::copy(&wanted, folder.join("package.json")).map_err(|error| error.to_string())?;
                let mut npm = Command::new("npm");
                run(npm.args(["install", "--no-audit", "--no-fund", "--loglevel=error"]).current_dir(folder))
            })
            .map_err(|why| left_out("what needs Allure's generator from npm", &why))
            .ok()?;
            Some(folder.join("node_modules/.bin/allure"))
        })
        .as_deref()
}

/// Whether a program of the system is there.
pub fn has(program: &str) -> bool {
    Command::new(program).arg("--version").output().is_ok_and(|output| output.status.success())
}

/// A folder that is made once for each text of what is wanted in it.
fn kept(folder: &Path, wanted: &Path, make: impl FnOnce(&Path) -> Result<(), String>) -> Result<(), String> {
    let (text, made) = (std::fs::read_to_string(wanted).unwrap(), folder.join("made-of"));
    if std::fs::read_to_string(&made).is_ok_and(|before| before == text) {
        return Ok(());
    }
    make(folder)?;
    std::fs::write(&made, text).map_err(|error| error.to_string())
}

/// Runs a command to its end; its last line of errors if it fails.
pub fn run(command: &mut Command) -> Result<(), String> {
    let program = command.get_program().to_string_lossy().into_owned();
    let output = command.output().map_err(|error| format!("{program} can't be started: {error}"))?;
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let last = said.lines().rfind(|line| !line.trim().is_empty()).unwrap_or_default().to_owned();
    if output.status.success() { Ok(()) } else { Err(format!("{program}: {last}")) }
}
