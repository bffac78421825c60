//! The build scripts on incomplete machines: made-up roots and search paths, and an apt-get that
//! records its arguments.

use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::Command;

use tempfile::TempDir;

use crate::support::{foreign::left_out, root};

/// Commands that the scripts and the compilers call, as they are on this machine.
const TOOLS: [&str; 29] = [
    "as", "awk", "cat", "chmod", "cmp", "cp", "cut", "date", "df", "dirname", "env", "flock",
    "grep", "head", "id", "ld", "ln", "mkdir", "mktemp", "mv", "rm", "sed", "sh", "sort", "tail",
    "tee", "touch", "tr", "uname",
];

/// A machine with only the given tools: its own search path, and a root in which libclang is
/// searched.
struct Machine {
    folder: TempDir,
}

impl Machine {
    /// With Rust and compilers, and an apt-get that has no packages.
    fn new() -> Self {
        let machine = Self::bare();
        for tool in ["cc", "c++"] {
            machine.has(tool);
        }
        machine.command("clang++", "exit 0");
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
        for folder in ["bin", "root/usr/lib/llvm-14/lib", "target"] {
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

    /// A library in LLVM's folder.
    fn library(&self, name: &str, file: &Path) {
        symlink(file, self.path("root/usr/lib/llvm-14/lib").join(name)).unwrap();
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
            .env("ACTCHECK_ROOT", self.path("root"))
            .env("LLVM_CONFIG_PATH", "/nowhere")
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

/// The libclang that this program was built with, unless it was set by `LIBCLANG_PATH`.
fn libclang() -> Option<PathBuf> {
    let folders = [
        "/usr/lib/x86_64-linux-gnu",
        "/usr/lib/aarch64-linux-gnu",
        "/usr/lib64",
        "/usr/lib",
    ]
    .map(PathBuf::from);
    let llvm = std::fs::read_dir("/usr/lib")
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path());
    let llvm = llvm
        .filter(|path| path.to_string_lossy().contains("llvm-"))
        .map(|path| path.join("lib"));
    let found = llvm
        .chain(folders)
        .filter_map(|folder| std::fs::read_dir(folder).ok())
        .flatten()
        .flatten();
    let found = found.map(|entry| entry.path()).find(|path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        (name.starts_with("libclang.so") || name.starts_with("libclang-1"))
            && name.contains(".so")
            && path.is_file()
    });
    if found.is_none() {
        left_out(
            "the search for libclang",
            "libclang is in none of the usual folders",
        );
    }
    found
}

#[test]
fn libclang_cpp_is_not_mistaken_for_libclang() {
    let Some(real) = libclang() else { return };
    let machine = Machine::new();
    machine.library("libclang-cpp.so.14", &real);
    let (code, printed) = machine.run("system", &[]);
    assert_eq!(code, 2, "{printed}");
    assert!(
        machine
            .installed()
            .contains("install -y -qq --no-install-recommends clang\n"),
        "{}",
        machine.installed()
    );
    assert!(
        printed.contains("'clang' is installed, but there is no libclang"),
        "{printed}"
    );

    // The same, if apt-get installs it.
    let brings = format!(
        "case $1 in install) ln -sf '{}' \"$ACTCHECK_ROOT/usr/lib/llvm-14/lib/libclang.so.1\" ;; esac",
        real.display()
    );
    machine.command("apt-get", &brings);
    assert_eq!(
        machine.run("system", &[]),
        (0, "installing from the system: clang\n".to_owned())
    );
}

#[test]
fn a_library_of_another_architecture_is_not_accepted() {
    let machine = Machine::new();
    let other = machine.path("other");
    // The header of a 32-bit library.
    std::fs::write(&other, b"\x7fELF\x01\x01\x01").unwrap();
    machine.library("libclang.so.1", &other);
    let (code, printed) = machine.run("system", &[]);
    assert_eq!(code, 2, "{printed}");
    assert!(printed.contains("there is no libclang"), "{printed}");
}

#[test]
fn libclang_without_the_linker_name_is_enough() {
    let Some(real) = libclang() else { return };
    let machine = Machine::new();
    machine.library("libclang.so.1", &real);
    assert_eq!(machine.run("system", &[]), (0, String::new()));
    assert_eq!(machine.installed(), "");
}

#[test]
fn a_wrong_libclang_path_is_named() {
    let Some(real) = libclang() else { return };
    let machine = Machine::new();
    machine.library("libclang.so.1", &real);
    let (code, printed) = machine.run("system", &[("LIBCLANG_PATH", "/nowhere")]);
    assert_eq!(code, 2);
    let expected = "actcheck needs libclang. LIBCLANG_PATH is wrong: there is no libclang at /nowhere. Unset LIBCLANG_PATH, or set \
                    it to the folder that has it\n";
    assert_eq!(printed, expected);
    assert_eq!(
        machine.installed(),
        "",
        "installing packages would not help"
    );
    // It is accepted as a folder and as a file, wherever else libclang is installed.
    let named = machine.path("root/usr/lib/llvm-14/lib");
    let file = named.join("libclang.so.1");
    for named in [named, file] {
        assert_eq!(
            machine.run("system", &[("LIBCLANG_PATH", named.to_str().unwrap())]),
            (0, String::new())
        );
    }
}

/// As in bindgen, its extra arguments and the folders of the program clang are used.
#[test]
fn headers_are_searched_where_bindgen_searches() {
    let Some(real) = libclang() else { return };
    let machine = Machine::new();
    machine.library("libclang.so.1", &real);
    let without_own = ("BINDGEN_EXTRA_CLANG_ARGS", "-nostdinc -Wall");
    let (code, printed) = machine.run("system", &[without_own]);
    assert_eq!(code, 2, "{printed}");
    assert!(
        printed.contains("lacks clang's own headers, such as stddef.h"),
        "{printed}"
    );

    let headers = machine.path("headers");
    std::fs::create_dir(&headers).unwrap();
    for name in ["stdarg.h", "stdbool.h", "stddef.h", "stdint.h"] {
        std::fs::write(headers.join(name), "").unwrap();
    }
    let list = "echo '#include <...> search starts here:' >&2; echo \" $MACHINE/headers\" >&2; echo 'End of search list.' >&2";
    machine.command(
        "clang-14",
        &format!("[ \"$6\" = -nostdinc ] || exit 1; {list}"),
    );
    assert_eq!(machine.run("system", &[without_own]), (0, String::new()));
}

#[test]
fn without_a_compiler_one_is_installed() {
    let machine = Machine::new();
    machine.lacks("cc");
    machine.lacks("c++");
    machine.lacks("clang++");
    let (code, printed) = machine.run("system", &[]);
    assert_eq!(code, 2, "{printed}");
    assert!(
        machine
            .installed()
            .contains("install -y -qq --no-install-recommends g++ clang\n"),
        "{}",
        machine.installed()
    );
    assert!(
        printed.contains("actcheck needs g++ clang: 'g++ clang' is installed, but"),
        "{printed}"
    );
}

#[test]
fn without_apt_the_packages_are_named() {
    let machine = Machine::new();
    machine.lacks("apt-get");
    let (code, printed) = machine.run("system", &[]);
    assert_eq!(code, 2);
    let expected = "actcheck needs clang: install them with this system's package manager (the names are Debian's), then run this again\n";
    assert_eq!(printed, expected);
}

#[test]
fn optional_packages_may_be_missing() {
    let Some(real) = libclang() else { return };
    let machine = Machine::new();
    machine.library("libclang.so.1", &real);
    machine.lacks("clang++");
    machine.command(
        "apt-get",
        "echo 'E: Unable to locate package' >&2; exit 100",
    );
    let (code, printed) = machine.run("system", &[]);
    assert_eq!(code, 0, "{printed}");
    assert!(
        printed.contains("missing, but optional: clang (apt-get could not install it)"),
        "{printed}"
    );
}

#[test]
fn only_a_wheel_needs_python() {
    let Some(real) = libclang() else { return };
    let machine = Machine::new();
    machine.library("libclang.so.1", &real);
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
        printed.contains("The first build compiles RocksDB"),
        "{printed}"
    );
}
