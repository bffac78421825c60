//! Compares results with the files of data-driven cases.
//!
//! `insta::glob!` is not used: it counts failures in a list for the whole process, so that tests
//! that run in parallel get each other's, and it adds a header to each file.

use std::path::PathBuf;

/// Compares each text with its file and reports all differences. `UPDATE_EXPECT=1` writes the
/// files.
pub fn assert_expected(texts: impl IntoIterator<Item = (PathBuf, String)>) {
    let update = std::env::var_os("UPDATE_EXPECT").is_some();
    let different = texts.into_iter().filter_map(|(file, text)| {
        if update {
            std::fs::write(&file, &text).unwrap();
        }
        let expected = std::fs::read_to_string(&file).unwrap_or_default();
        (text != expected).then(|| {
            format!(
                "== {}\n-- expected\n{expected}-- got\n{text}",
                file.display()
            )
        })
    });
    let different: Vec<String> = different.collect();
    assert!(different.is_empty(), "{}", different.join("\n"));
}

/// Compares the diagnostics of wrong inputs with their files. Each input must have diagnostics, and
/// each diagnostic must have a help.
pub fn assert_diagnostics(
    at_least: usize,
    reports: impl ExactSizeIterator<Item = (PathBuf, String)>,
) {
    assert!(reports.len() >= at_least, "only {} cases", reports.len());
    assert_expected(reports.inspect(|(file, report)| {
        assert!(!report.is_empty(), "{}: no diagnostics", file.display());
        for line in report.lines().filter(|line| !line.starts_with("  help: ")) {
            assert!(line.contains(':') && !line.ends_with('.'), "{line}");
        }
        let helps = report.matches("  help: ").count();
        assert_eq!(
            helps,
            report.lines().count() / 2,
            "each fault must have a help:\n{report}"
        );
    }));
}
