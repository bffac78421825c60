//! A table of wrong inputs: one folder each, with the diagnostics in `expected`.

use std::path::Path;

use actcheck::base::Files;

/// Compares the diagnostics of each input below a folder, which `say` computes from the input's name, with its file
/// `expected`. With `ACTCHECK_BLESS=1` those files are written.
///
/// Every diagnostic must end with help, and every input must have a diagnostic.
pub fn all_are_reported(folder: &str, at_least: usize, say: impl Fn(&str) -> String) {
    let bless = std::env::var_os("ACTCHECK_BLESS").is_some();
    let cases = Files::Disk.folders(Path::new(folder));
    assert!(cases.len() >= at_least, "only {} cases", cases.len());
    let mut wrong = Vec::new();
    for case in cases {
        let said = say(case.file_name().unwrap().to_str().unwrap());
        let expected_path = case.join("expected");
        if bless {
            std::fs::write(&expected_path, &said).unwrap();
        }
        let expected = std::fs::read_to_string(&expected_path).unwrap_or_default();
        if said.is_empty() || said != expected {
            wrong.push(format!("== {}\n-- expected\n{expected}-- said\n{said}", case.display()));
        }
        assert_eq!(said.matches("  help: ").count(), said.lines().count() / 2, "each fault has its help:\n{said}");
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
