//! The scripts and the style, each file with one idea, in the order in which they stand in the page.

/// What is drawn with.
pub(super) const STYLE: [&str; 1] = [include_str!("web/style.css")];

/// What runs. All of it shares one scope.
pub(super) const SCRIPT: [&str; 3] =
    [include_str!("web/dom.js"), include_str!("web/unpack.js"), include_str!("web/main.js")];

/// The frame of the page, with places for the rest.
pub(super) const SHELL: &str = include_str!("web/page.html");

/// three.js, which draws in 3D: its two modules. (MIT; licence beside them and at their beginning.)
pub(super) const THREE: [(&str, &str); 2] = [
    ("three-core", include_str!("vendor/three/three.core.min.js")),
    ("three-module", include_str!("vendor/three/three.module.min.js")),
];
