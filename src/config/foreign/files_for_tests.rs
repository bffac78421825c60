//! Texts of models, and the folders with them that tests read.

use std::f64::consts::PI;

/// A folder with these files, all of them inside another folder if it is not `""`.
pub(crate) fn folder<T: AsRef<str>>(inside: &str, files: &[(&str, T)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("there is room");
    for (path, text) in files {
        let path = folder.path().join(inside).join(path);
        std::fs::create_dir_all(path.parent().expect("it is in a folder")).expect("it is new");
        std::fs::write(path, text.as_ref()).expect("there is room");
    }
    folder
}

pub(crate) fn sdf(inside: &str) -> String {
    format!("<sdf version=\"1.11\">{inside}</sdf>")
}

/// A file with the model `thing`.
pub(crate) fn sdf_model(inside: &str) -> String {
    sdf(&format!("<model name=\"thing\">{inside}</model>"))
}

/// Points that are spread evenly on a ball with the radius 1.
pub(crate) fn ball(n_points: u32) -> Vec<[f64; 3]> {
    let golden = PI * (3.0 - 5.0_f64.sqrt());
    let point = |idx: u32| {
        let z = 1.0 - 2.0 * (f64::from(idx) + 0.5) / f64::from(n_points);
        let (across, angle) = ((1.0 - z * z).sqrt(), golden * f64::from(idx));
        [across * angle.cos(), across * angle.sin(), z]
    };
    (0..n_points).map(point).collect()
}
