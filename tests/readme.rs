//! Every command of the README is run, block by block, in a folder like a fresh checkout.

use crate::support::checkout::{Checkout, blocks};
use crate::support::root;

#[test]
fn every_command_of_the_readme_works() {
    let readme = std::fs::read_to_string(root().join("README.md")).unwrap();
    let checkout = Checkout::fresh();
    let blocks = blocks(&readme, "sh");
    assert!(blocks.len() >= 4, "the README has too few command blocks");
    for block in &blocks {
        checkout.run(block, &[]);
    }
}
