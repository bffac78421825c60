//! The build scripts on incomplete machines: made-up search paths, and an apt-get that records its
//! arguments.

use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::PathBuf;
use std::process::Command;

use tempfile::TempDir;

use crate::support::root;

/// Commands that the scripts and the compiler call, as they are on this machine.
const TOOLS: [&str; 21] = [
    "as", "awk", "cat", "cut", "df", "dirname", "env", "grep", "head", "id", "ld", "ln", "mkdir",
    "mktemp", "rm", "sed", "sort", "tail", "touch", "tr", "uname",
];

/// A machine with only the given tools, on its own search path.
struct Machine {
    folder: TempDir,
}

impl Machine {
    /// With Rust and a C compiler, and an apt-get that has no packages.
    fn new() -> Self {
        let machine = Self::bare();
        machine.has("cc");
        machine.command("cargo", "exit 0");
        machine.command(
            "rustc",
            "echo 'rustc 1.95.0 (59807616e 2026-04-14)'; echo 'host: x86_64-unknown-linux-gnu'",
        );
        machine.command("apt-get", "echo \"$@\" >> \"$MACHINE/apt\"");
        machine
    }

    fn bare() -> Self {
        let machine = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        for folder in ["bin", "target"] {
            std::fs::create_dir_all(machine.path(folder)).unwrap();
        }
        TOOLS.iter().for_each(|tool| machine.has(tool));
        machine
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Links a command of the real machine.
    fn has(&self, name: &str) {
        let folders = std::env::var_os("PATH").unwrap();
        let found = std::env::split_paths(&folders)
            .map(|folder| folder.join(name))
            .find(|path| path.is_file());
        symlink(
            found.unwrap_or_else(|| panic!("this machine has no `{name}`")),
            self.path("bin").join(name),
        )
        .unwrap();
    }

    /// A made-up command.
    fn command(&self, name: &str, script: &str) {
        let path = self.path("bin").join(name);
        let _ = std::fs::remove_file(&path);
        std::fs::write(&path, format!("#!/bin/sh\n{script}\n")).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    }

    fn lacks(&self, name: &str) {
        std::fs::remove_file(self.path("bin").join(name)).unwrap();
    }

    /// Runs a script of `.ci`, with arguments after its name. Returns its exit code and its error
    /// stream.
    fn run(&self, script: &str, variables: &[(&str, &str)]) -> (i32, String) {
        let mut words = script.split(' ');
        let output = Command::new("/bin/sh")
            .arg(root().join(".ci").join(words.next().unwrap()))
            .args(words)
            .env_clear()
            .env("PATH", self.path("bin"))
            .env("HOME", self.path("home"))
            .env("MACHINE", self.folder.path())
            .env("CARGO_TARGET_DIR", self.path("target"))
            .envs(variables.iter().copied())
            .output()
            .unwrap();
        (
            output.status.code().unwrap(),
            String::from_utf8(output.stderr).unwrap(),
        )
    }

    /// The arguments of apt-get.
    fn installed(&self) -> String {
        std::fs::read_to_string(self.path("apt")).unwrap_or_default()
    }
}

/// The end of the arguments of apt-get that install a C compiler.
const INSTALLS_A_COMPILER: &str = "install -y -qq --no-install-recommends gcc libc6-dev\n";

#[test]
fn a_complete_machine_needs_no_package() {
    let machine = Machine::new();
    assert_eq!(machine.run("system", &[]), (0, String::new()));
    assert_eq!(machine.installed(), "");
}

#[test]
fn without_a_compiler_one_is_installed() {
    let machine = Machine::new();
    machine.lacks("cc");
    let (code, printed) = machine.run("system", &[]);
    assert_eq!(code, 2, "{printed}");
    assert!(
        machine.installed().ends_with(INSTALLS_A_COMPILER),
        "{}",
        machine.installed()
    );
    assert!(
        printed.contains("actcheck needs gcc libc6-dev: 'gcc libc6-dev' is installed, but"),
        "{printed}"
    );

    // The same, if apt-get installs it.
    machine.has("cc");
    std::fs::rename(machine.path("bin/cc"), machine.path("cc")).unwrap();
    machine.command(
        "apt-get",
        "case $1 in install) ln -s \"$MACHINE/cc\" \"$MACHINE/bin/cc\" ;; esac",
    );
    assert_eq!(
        machine.run("system", &[]),
        (0, "installing from the system: gcc libc6-dev\n".to_owned())
    );
}

/// `gcc` only recommends the C library's headers and start files.
#[test]
fn a_compiler_must_link_a_program() {
    let machine = Machine::new();
    machine.command("cc", "echo 'ld: cannot find Scrt1.o' >&2; exit 1");
    let (code, printed) = machine.run("system", &[]);
    assert_eq!(code, 2, "{printed}");
    assert!(
        machine.installed().ends_with(INSTALLS_A_COMPILER),
        "{}",
        machine.installed()
    );
    assert!(
        printed.ends_with("is installed, but ld: cannot find Scrt1.o\n"),
        "{printed}"
    );
}

#[test]
fn a_wrong_cc_is_named() {
    let machine = Machine::new();
    let (code, printed) = machine.run("system", &[("CC", "/nowhere/cc")]);
    assert_eq!(code, 2, "{printed}");
    assert!(
        printed.starts_with(
            "actcheck needs a C compiler, but CC=/nowhere/cc can't link a program: unset CC, or set it to a C compiler. "
        ),
        "{printed}"
    );
    assert_eq!(
        machine.installed(),
        "",
        "installing packages would not help"
    );
    assert_eq!(
        machine.run("system", &[("CC", "cc -O2")]),
        (0, String::new())
    );
}

#[test]
fn without_apt_the_packages_are_named() {
    let machine = Machine::new();
    machine.lacks("cc");
    machine.lacks("apt-get");
    let (code, printed) = machine.run("system", &[]);
    assert_eq!(code, 2);
    let expected = "actcheck needs gcc libc6-dev: install them with this system's package manager (the names are Debian's), then run this \
                    again\n";
    assert_eq!(printed, expected);
}

#[test]
fn optional_packages_may_be_missing() {
    let machine = Machine::new();
    machine.command(
        "apt-get",
        "echo 'E: Unable to locate package' >&2; exit 100",
    );
    let (code, printed) = machine.run("system tests", &[]);
    assert_eq!(code, 0, "{printed}");
    for package in ["chromium", "python3", "python3-venv"] {
        assert!(
            printed.contains(&format!(
                "missing, but optional: {package} (apt-get could not install it)\n"
            )),
            "{printed}"
        );
    }
}

#[test]
fn only_a_wheel_needs_python() {
    let machine = Machine::new();
    assert_eq!(machine.run("system", &[]), (0, String::new()));
    // Python is missing, then it lacks its module venv.
    for python in [None, Some("exit 1")] {
        python
            .iter()
            .for_each(|script| machine.command("python3", script));
        let (code, printed) = machine.run("system wheel", &[]);
        let asked = machine.installed();
        assert!(
            asked.ends_with("install -y -qq --no-install-recommends python3 python3-venv\n"),
            "{asked}"
        );
        let expected = "installing from the system: python3 python3-venv\nactcheck needs python3 python3-venv: 'python3 python3-venv' is \
                        installed, but python3 can't make environments with venv\n";
        assert_eq!((code, printed.as_str()), (2, expected));
    }
    machine.command("python3", "exit 0");
    assert_eq!(machine.run("system wheel", &[]), (0, String::new()));
    let makefile = std::fs::read_to_string(root().join("Makefile")).unwrap();
    assert!(
        makefile.contains("\nwheel:\n\t@sh .ci/system wheel\n"),
        "{makefile}"
    );
}

#[test]
fn rust_is_checked_before_anything_else() {
    let machine = Machine::new();
    machine.command("rustc", "echo 'rustc 1.70.0 (90c541806 2023-05-31)'");
    let wanted = env!("CARGO_PKG_RUST_VERSION");
    let (code, printed) = machine.run("system", &[]);
    let expected = format!(
        "actcheck needs Rust {wanted} or later, but this is 1.70.0: run 'rustup update stable'\n"
    );
    assert_eq!((code, printed), (2, expected));
    machine.lacks("cargo");
    let (code, printed) = machine.run("system", &[]);
    assert_eq!(code, 2);
    assert!(
        printed.starts_with(&format!(
            "actcheck needs the Rust toolchain, version {wanted} or later"
        )),
        "{printed}"
    );
}

#[test]
fn a_target_folder_that_cannot_be_written_is_named() {
    let machine = Machine::new();
    let (code, printed) = machine.run("build", &[("CARGO_TARGET_DIR", "/dev/null/target")]);
    assert_eq!(code, 2);
    assert!(
        printed.contains(
            "actcheck was not built: /dev/null/target can't be written; set CARGO_TARGET_DIR"
        ),
        "{printed}"
    );
}

#[test]
fn a_full_disk_is_named_before_and_after() {
    let machine = Machine::new();
    machine.command("df", "echo head; echo 'disk 1 1 204800 1 /'");
    let (code, printed) = machine.run("build", &[]);
    assert_eq!(code, 2);
    assert!(
        printed.contains("actcheck was not built: it needs 3000 MB in "),
        "{printed}"
    );
    assert!(
        printed
            .contains("but only 200 MB are free; free some space, or set CARGO_TARGET_DIR to a folder on another disk"),
        "{printed}"
    );
    // The disk fills up while crates compile.
    machine.command("df", "[ -e \"$MACHINE/full\" ] && free=0 || free=9000000; echo head; echo \"disk 1 1 $free 1 /\"");
    machine.command(
        "cargo",
        "[ \"$1\" = fetch ] || { touch \"$MACHINE/full\"; exit 101; }",
    );
    let (code, printed) = machine.run("build", &[]);
    assert_eq!(code, 2);
    assert!(
        printed.contains("actcheck was not built: no space is left in "),
        "{printed}"
    );
}

#[test]
fn a_missing_network_is_named() {
    let machine = Machine::new();
    machine.command(
        "cargo",
        "[ \"$1\" != fetch ] || { echo 'error: failed to download' >&2; exit 101; }",
    );
    let (code, printed) = machine.run("build", &[]);
    assert_eq!(code, 2);
    assert!(printed.contains("error: failed to download"), "{printed}");
    assert!(
        printed.contains(
            "actcheck was not built: its crates can't be downloaded: see cargo's message above"
        ),
        "{printed}"
    );
}

/// A fault of the code itself is reported by cargo.
#[test]
fn a_failed_build_keeps_its_exit_code() {
    let machine = Machine::new();
    machine.command("cargo", "[ \"$1\" = fetch ] || exit 101");
    let (code, printed) = machine.run("build", &[]);
    assert_eq!(code, 101, "{printed}");
    assert!(
        printed.contains("The first build compiles the dependencies"),
        "{printed}"
    );
}
