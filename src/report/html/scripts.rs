//! The scripts and style sheets, in the order in which they are in the page.

/// Style sheets: colours of both themes, the page, outcomes and plots, the list and the run view,
/// the side of a program.
pub(super) const STYLE: [&str; 7] = [
    include_str!("web/colours.css"),
    include_str!("web/page.css"),
    include_str!("web/parts.css"),
    include_str!("web/runs.css"),
    include_str!("web/skill.css"),
    include_str!("web/film.css"),
    include_str!("web/review.css"),
];

/// Scripts. All share one scope; the last one starts the program.
pub(super) const SCRIPT: [&str; 39] = [
    include_str!("web/dom.js"),
    include_str!("web/sorted.js"),
    include_str!("web/unpack.js"),
    include_str!("web/served.js"),
    include_str!("web/words.js"),
    include_str!("web/outcomes.js"),
    include_str!("web/runs.js"),
    include_str!("web/address.js"),
    include_str!("web/filter.js"),
    include_str!("web/list.js"),
    include_str!("web/plots.js"),
    include_str!("web/scatter.js"),
    include_str!("web/outline.js"),
    include_str!("web/overview.js"),
    include_str!("web/properties.js"),
    include_str!("web/modes.js"),
    include_str!("web/patterns.js"),
    include_str!("web/collisions.js"),
    include_str!("web/map.js"),
    include_str!("web/trends.js"),
    include_str!("web/theme.js"),
    include_str!("web/three.js"),
    include_str!("web/solids.js"),
    include_str!("web/course.js"),
    include_str!("web/closest.js"),
    include_str!("web/labels.js"),
    include_str!("web/orbit.js"),
    include_str!("web/views.js"),
    include_str!("web/stage.js"),
    include_str!("web/signals.js"),
    include_str!("web/quantities.js"),
    include_str!("web/chooser.js"),
    include_str!("web/film.js"),
    include_str!("web/skill.js"),
    include_str!("web/timeline.js"),
    include_str!("web/player.js"),
    include_str!("web/run.js"),
    include_str!("web/pair.js"),
    include_str!("web/main.js"),
];

/// Scripts of the page of a comparison, in the same way.
pub(super) const REVIEW_SCRIPT: [&str; 26] = [
    include_str!("web/dom.js"),
    include_str!("web/sorted.js"),
    include_str!("web/unpack.js"),
    include_str!("web/words.js"),
    include_str!("web/outcomes.js"),
    include_str!("web/address.js"),
    include_str!("web/plots.js"),
    include_str!("web/scatter.js"),
    include_str!("web/theme.js"),
    include_str!("web/three.js"),
    include_str!("web/solids.js"),
    include_str!("web/course.js"),
    include_str!("web/closest.js"),
    include_str!("web/labels.js"),
    include_str!("web/orbit.js"),
    include_str!("web/views.js"),
    include_str!("web/stage.js"),
    include_str!("web/signals.js"),
    include_str!("web/quantities.js"),
    include_str!("web/chooser.js"),
    include_str!("web/film.js"),
    include_str!("web/skill.js"),
    include_str!("web/timeline.js"),
    include_str!("web/player.js"),
    include_str!("web/run.js"),
    include_str!("web/review.js"),
];

/// Template of the page, with placeholders.
pub(super) const SHELL: &str = include_str!("web/page.html");

/// The two modules of three.js, which draws in 3D. (MIT; the licence is in their folder and
/// header.)
pub(super) const THREE: [(&str, &str); 2] = [
    ("three-core", include_str!("vendor/three/three.core.min.js")),
    (
        "three-module",
        include_str!("vendor/three/three.module.min.js"),
    ),
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Functions that parse text as markup or run it.
    const PARSERS: [&str; 10] = [
        "innerHTML",
        "outerHTML",
        "insertAdjacentHTML",
        "document.write",
        "DOMParser",
        "createContextualFragment",
        "srcdoc",
        "eval(",
        "new Function",
        "javascript:",
    ];

    #[test]
    fn scripts_never_parse_text_as_markup() {
        for script in SCRIPT.iter().chain(&REVIEW_SCRIPT) {
            for parser in PARSERS {
                assert!(
                    !script.contains(parser),
                    "{parser} in {}",
                    script.lines().next().unwrap_or_default()
                );
            }
            // It would end the script element.
            assert!(!script.to_lowercase().contains("</script"));
        }
    }

    #[test]
    fn the_page_has_no_external_addresses() {
        for text in SCRIPT
            .iter()
            .chain(&REVIEW_SCRIPT)
            .chain(&STYLE)
            .chain([&SHELL])
        {
            let hosts: Vec<&str> = text
                .split("://")
                .skip(1)
                .map(|rest| rest.split(['/', '"']).next().unwrap_or_default())
                .collect();
            // The SVG namespace is a name, not an address.
            assert!(hosts.iter().all(|host| *host == "www.w3.org"), "{hosts:?}");
        }
    }

    #[test]
    fn the_library_has_its_licence() {
        let licence = include_str!("vendor/three/LICENSE");
        assert!(licence.contains("MIT License") && licence.contains("three.js authors"));
        assert!(
            THREE
                .iter()
                .all(|(_, text)| text.contains("SPDX-License-Identifier: MIT"))
        );
    }
}
