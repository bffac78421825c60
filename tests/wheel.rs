//! The wheel, installed into a new environment: there the program runs without a checkout and
//! without Rust, and so do Python skills.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::support::{COARSE, foreign, root, script, stderr, stdout};

/// The path of the wheel to test, such as one of `make wheel`. Without it the tests pack the
/// program that they were built with.
const WHEEL: &str = "ACTCHECK_WHEEL";

/// The size limit of PyPI and of this project.
const MAX_BYTES: u64 = 30_000_000;

/// An environment with the wheel and its dependencies, outside the checkout.
struct Installed {
    folder: tempfile::TempDir,
    wheel: PathBuf,
}

impl Installed {
    fn bin(&self) -> PathBuf {
        self.folder.path().join("venv/bin")
    }

    /// Runs the installed program in a folder, with only its environment and a shell on the path.
    fn actcheck(&self, folder: &Path, arguments: &[&str]) -> Output {
        let shell = self.folder.path().join("shell");
        if !shell.exists() {
            std::fs::create_dir(&shell).unwrap();
            std::os::unix::fs::symlink("/bin/sh", shell.join("sh")).unwrap();
        }
        Command::new(self.bin().join("actcheck"))
            .args(arguments)
            .current_dir(folder)
            .env_clear()
            .env("PATH", std::env::join_paths([self.bin(), shell]).unwrap())
            .env("HOME", self.folder.path())
            .env("NO_COLOR", "1")
            .output()
            .unwrap()
    }
}

fn installed() -> Installed {
    let (python, needs) = foreign::maturin()
        .unwrap_or_else(|why| panic!("the wheel can't be made or installed: {why}"));
    let folder = tempfile::tempdir().unwrap();
    let wheel = match std::env::var_os(WHEEL) {
        Some(named) => root().join(named),
        None => packed(&python, folder.path()),
    };
    let venv = folder.path().join("venv");
    foreign::run(
        Command::new(&python)
            .args(["-m", "venv", "--without-pip"])
            .arg(&venv),
    )
    .unwrap();
    let mut pip = Command::new(&python);
    pip.args(["-m", "pip", "--python"])
        .arg(venv.join("bin/python"));
    pip.args([
        "install",
        "--quiet",
        "--disable-pip-version-check",
        "--no-index",
        "--find-links",
    ])
    .arg(needs);
    foreign::run(pip.arg(&wheel)).unwrap();
    Installed { folder, wheel }
}

/// Packs a wheel with maturin from the already built program. Instead of cargo, maturin calls a
/// script that builds nothing and names a copy of the program: building again would take minutes,
/// and maturin moves the program.
fn packed(python: &Path, folder: &Path) -> PathBuf {
    let (source, program, cargo) = (
        folder.join("source"),
        folder.join("actcheck"),
        folder.join("cargo"),
    );
    foreign::run(Command::new(root().join("clients/wheel/stage")).arg(&source)).unwrap();
    std::fs::copy(env!("CARGO_BIN_EXE_actcheck"), &program).unwrap();
    let built = serde_json::json!({
        "reason": "compiler-artifact",
        "package_id": format!("path+file://{}#actcheck@{}", source.display(), env!("CARGO_PKG_VERSION")),
        "manifest_path": source.join("Cargo.toml"),
        "target": {
            "kind": ["bin"], "crate_types": ["bin"], "name": "actcheck", "src_path": source.join("src/main.rs"),
            "edition": "2024", "doc": false, "doctest": false, "test": true,
        },
        "profile": {
            "opt_level": "3", "debuginfo": 0, "debug_assertions": false, "overflow_checks": true, "test": false,
        },
        "features": [],
        "filenames": [&program],
        "executable": &program,
        "fresh": true,
    });
    script(&cargo, &format!("#!/bin/sh\necho '{built}'\n"));
    let wheels = folder.join("wheels");
    let mut maturin = Command::new(python.with_file_name("maturin"));
    maturin
        .args([
            "build",
            "--release",
            "--compatibility",
            "linux",
            "--compression-level",
            "1",
            "--out",
        ])
        .arg(&wheels);
    foreign::run(maturin.current_dir(&source).env("CARGO", &cargo)).unwrap();
    let mut made = std::fs::read_dir(&wheels)
        .unwrap()
        .map(|entry| entry.unwrap().path());
    made.next().unwrap()
}

/// The shipped pick with two cheap runs, in an otherwise empty folder.
fn config(folder: &Path, name: &str, launcher: &str) {
    let pick = std::fs::read_to_string(root().join("configs/pick.toml")).unwrap();
    let alone: Vec<&str> = pick
        .lines()
        .filter(|line| !line.starts_with("ontology =") && !line.starts_with("model_dir ="))
        .collect();
    let text = alone
        .join("\n")
        .replacen("test_count = 15", "test_count = 2", 1)
        .replacen(
            "test_launcher = \"reference\"",
            &format!("test_launcher = {launcher:?}"),
            1,
        )
        .replacen("[physics]\n", COARSE, 1);
    std::fs::write(folder.join(name), text).unwrap();
}

#[test]
fn a_wheel_needs_no_checkout_and_no_rust() {
    let installed = installed();
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let version = stdout(&installed.actcheck(folder, &["--version"]));
    assert_eq!(
        version.trim(),
        format!("actcheck {}", env!("CARGO_PKG_VERSION"))
    );

    config(folder, "pick.toml", "reference");
    let ran = installed.actcheck(folder, &["run", "pick.toml"]);
    assert!(
        ran.status.code().is_some_and(|code| code < 2),
        "{}",
        stderr(&ran)
    );
    assert!(stdout(&ran).contains("over 2 runs"), "{}", stdout(&ran));

    let report = installed.actcheck(folder, &["report", "--html", "report.html"]);
    assert!(report.status.success(), "{}", stderr(&report));
    assert!(
        std::fs::read_to_string(folder.join("report.html"))
            .unwrap()
            .contains("</html>")
    );

    // A skill that imports the package from the wheel.
    let example = root().join("clients/python/examples/pick.py");
    std::fs::copy(&example, folder.join("my_pick.py")).unwrap();
    config(folder, "skill.toml", "my_pick.py");
    let ran = installed.actcheck(
        folder,
        &[
            "run",
            "skill.toml",
            "--format",
            "json",
            "--history",
            "skill",
        ],
    );
    let printed: serde_json::Value =
        serde_json::from_slice(&ran.stdout).unwrap_or_else(|_| panic!("{}", stderr(&ran)));
    for run in printed["runs"].as_array().unwrap() {
        assert_eq!(run["status"], "completed", "{run:#}");
    }

    // Skill authors get the package's types.
    let cache = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mypy-of-wheel");
    let mut mypy = Command::new(foreign::client_python());
    mypy.args(["-m", "mypy", "--strict", "--cache-dir"])
        .arg(cache)
        .arg("--python-executable");
    let mypy = mypy
        .arg(installed.bin().join("python"))
        .arg("my_pick.py")
        .current_dir(folder)
        .output()
        .unwrap();
    assert!(mypy.status.success(), "{}", stdout(&mypy));

    if std::env::var_os(WHEEL).is_some() {
        let judge = "import actcheck; print(*actcheck.Judge().actions)";
        let mut python = Command::new(installed.bin().join("python"));
        let judge = python
            .args(["-c", judge])
            .current_dir(folder)
            .output()
            .unwrap();
        assert!(stdout(&judge).contains("Pick"), "{}", stderr(&judge));
        let name = installed.wheel.file_name().unwrap().to_string_lossy();
        assert!(name.contains("-py3-none-manylinux_2_28_"), "{name}");
        let size = std::fs::metadata(&installed.wheel).unwrap().len();
        assert!(size <= MAX_BYTES, "{size}");
    }
}

/// The package can also be installed alone, from its folder: both must agree.
#[test]
fn the_package_and_the_program_agree_on_version_and_dependencies() {
    let read = |file: &str| std::fs::read_to_string(root().join(file)).unwrap();
    let line = |text: &str, key: &str| {
        text.lines()
            .find(|line| line.starts_with(key))
            .unwrap()
            .to_owned()
    };
    let (package, wheel) = (
        read("clients/python/pyproject.toml"),
        read("clients/wheel/pyproject.toml"),
    );
    assert_eq!(
        line(&package, "version"),
        format!("version = \"{}\"", env!("CARGO_PKG_VERSION"))
    );
    for key in ["requires-python", "license =", "dependencies"] {
        assert_eq!(line(&package, key), line(&wheel, key));
    }
}

/// Files included by source files from other folders are in the tree that wheel and source
/// distribution are built from: otherwise they would not compile.
#[test]
fn the_source_distribution_has_every_included_file() {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("source");
    foreign::run(Command::new(root().join("clients/wheel/stage")).arg(&source)).unwrap();
    let (mut folders, mut found) = (vec![source.join("src")], 0);
    while let Some(folder) = folders.pop() {
        for path in std::fs::read_dir(&folder)
            .unwrap()
            .map(|entry| entry.unwrap().path())
        {
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ending| ending == "rs") {
                let text = std::fs::read_to_string(&path).unwrap();
                for behind in text.split("include_").skip(1) {
                    let Some((_, name)) = behind
                        .split_once("!(\"")
                        .filter(|(kind, _)| ["str", "bytes"].contains(kind))
                    else {
                        continue;
                    };
                    let name = name.split('"').next().unwrap();
                    assert!(
                        folder.join(name).is_file(),
                        "{} includes {name}",
                        path.display()
                    );
                    found += 1;
                }
            }
        }
    }
    assert!(found > 30, "{found}");
}
