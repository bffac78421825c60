//! The rule engine as a library: a program outside the workspace uses it.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Returns the target folder of this test program, in which the compiled dependencies can be
/// reused.
fn target() -> PathBuf {
    let program = std::env::current_exe().unwrap();
    // `<target>/release/deps/all-…`
    program.ancestors().nth(3).unwrap().to_path_buf()
}

#[test]
fn a_program_outside_the_workspace_judges_and_explains() {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/rules_library/Cargo.toml");
    let run = Command::new(env!("CARGO"))
        .args(["run", "--quiet", "--locked", "--offline", "--manifest-path"])
        .arg(&manifest)
        .env("CARGO_TARGET_DIR", target())
        // `.ci/timed` sets it for the test program. Build scripts would notice it and rebuild
        // dependencies, here and in the next build.
        .env_remove("RUSTC_BOOTSTRAP")
        .output()
        .unwrap();
    let (out, err) = (
        String::from_utf8_lossy(&run.stdout),
        String::from_utf8_lossy(&run.stderr),
    );
    assert!(run.status.success(), "{err}");
    let expected = "\
failed: violation(glass = <http://example.org/glass2>)
rules: does not hold
  violation(<http://example.org/glass2>)  by rules.rls:9: Every glass is above the table.
    after(<http://example.org/glass2>, rdf:type, <http://example.org/Glass>)  (fact)
    no match for above(<http://example.org/glass2>, <http://example.org/table>)

above(ex:glass2, ex:table): is not derived
";
    assert!(out.starts_with(expected), "{out}");
    assert!(out.contains("missing "), "{out}");
}
