//! Patterns for names of bodies, in which `*` is any text.

/// A name in which `*` is any text, also an empty one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Pattern(String);

impl Pattern {
    pub(crate) fn new(text: &str) -> Self {
        Self(text.to_owned())
    }

    /// The pattern as written.
    pub(crate) fn text(&self) -> &str {
        &self.0
    }

    /// Whether the whole name fits.
    pub(crate) fn fits(&self, name: &str) -> bool {
        let mut parts = self.0.split('*');
        let first = parts.next().unwrap_or_default();
        let Some(mut rest) = name.strip_prefix(first) else {
            return false;
        };
        let Some(last) = parts.next_back() else {
            return rest.is_empty();
        };
        for part in parts {
            let Some(at) = rest.find(part) else {
                return false;
            };
            rest = &rest[at + part.len()..];
        }
        rest.ends_with(last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_star_is_any_text() {
        for (pattern, name, fits) in [
            ("cube_main", "cube_main", true),
            ("cube_main", "cube_main2", false),
            ("robot0_*", "robot0_link1", true),
            ("robot0_*", "robot1_link1", false),
            ("gripper0_*left*finger*", "gripper0_right_leftfinger", true),
            (
                "gripper0_*left*finger*",
                "gripper0_right_rightfinger",
                false,
            ),
            ("*", "", true),
            ("a*a", "a", false),
            ("*_tip", "left_tip", true),
        ] {
            assert_eq!(Pattern::new(pattern).fits(name), fits, "{pattern} {name}");
        }
    }
}
