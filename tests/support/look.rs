//! A campaign whose runs take a tenth of a second, for tests that need any campaign.

use tempfile::TempDir;

use crate::support::{edit, project};

/// A robot looks at a table with a coarse camera: in some scenes it merges two things, or misses
/// one.
const LOOK: &str = r#"
tests = [["PerceivePlane"]]
test_count = 15
seed = 3
ontology = "../ontology/actions.ttl"
model_dir = "../models"

[objectSurface]
object_surfaces = ["coffee_table"]

[pickObject]
model_list = ["glass"]

[surfaceObjects]
model_list = ["mug", "can", "box"]
count = [2, 3]

[camera]
width = 80
height = 60
range_noise_m = 0.0015
dropout = 0.02

[sensing]
localisation_noise_m = 0.005
heading_noise_rad = 0.01
"#;

/// A project with this configuration in `configs/look.toml`.
pub fn looking() -> TempDir {
    let project = project();
    std::fs::write(project.path().join("configs/look.toml"), LOOK).unwrap();
    project
}

/// The same with a camera so noisy that no look locates the table correctly: every run fails.
pub fn blurred() -> TempDir {
    let project = looking();
    edit(
        &project.path().join("configs/look.toml"),
        "range_noise_m = 0.0015",
        "range_noise_m = 0.1",
    );
    project
}
