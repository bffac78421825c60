//! XML elements with their places: the fence around the parser.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use crate::base::{Diagnostic, Diagnostics, Source, Span, did_you_mean};

/// An element of a document.
pub(crate) type Node<'a> = roxmltree::Node<'a, 'a>;

/// What a number has to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Bound {
    Finite,
    NotNegative,
    Positive,
}

impl Bound {
    fn holds(self, number: f64) -> bool {
        number.is_finite()
            && match self {
                Self::Finite => true,
                Self::NotNegative => number >= 0.0,
                Self::Positive => number > 0.0,
            }
    }

    fn in_words(self) -> &'static str {
        match self {
            Self::Finite => "finite",
            Self::NotNegative => "not negative",
            Self::Positive => "above 0",
        }
    }
}

/// The document of a text.
///
/// # Errors
/// W031: the text is not XML, with the place where it stops being so.
pub(crate) fn parse(source: &Source) -> Result<roxmltree::Document<'_>, Diagnostics> {
    roxmltree::Document::parse(&source.text).map_err(|error| {
        let place = error.pos();
        let at = offset(&source.text, place.row as usize, place.col as usize);
        // The library names the place in its own words at the end; ours stands before the message.
        let said = error.to_string();
        let said = said.rsplit_once(" at ").map_or(said.as_str(), |(what, _)| what);
        Diagnostic::error("W031", format!("this is not XML: {said}"))
            .at(source, at..at)
            .help("see whether every element is closed and every `<` in text is written `&lt;`")
            .into()
    })
}

/// Byte offset of a line and a column, both counted from 1, the column in characters.
fn offset(text: &str, row: usize, column: usize) -> usize {
    let start: usize = text.split_inclusive('\n').take(row.saturating_sub(1)).map(str::len).sum();
    let line = text.get(start..).unwrap_or_default();
    start + line.char_indices().nth(column.saturating_sub(1)).map_or(0, |(at, _)| at)
}

/// Where an element's name is written.
pub(crate) fn span(node: Node) -> Span {
    let start = node.range().start;
    start..start + 1 + node.tag_name().name().len()
}

/// The first child element of a name.
pub(crate) fn child<'a>(node: Node<'a>, name: &str) -> Option<Node<'a>> {
    children(node, name).next()
}

/// All child elements of a name.
pub(crate) fn children<'a>(node: Node<'a>, name: &str) -> impl Iterator<Item = Node<'a>> {
    let name = name.to_owned();
    node.children().filter(move |child| child.is_element() && child.tag_name().name() == name)
}

/// An element's text without blanks around it.
pub(crate) fn text<'a>(node: Node<'a>) -> &'a str {
    node.text().map_or("", str::trim)
}

/// A file that is being read, and what was found wrong with it.
pub(crate) struct Reader<'a> {
    pub(crate) source: &'a Source,
    pub(crate) found: Diagnostics,
}

impl<'a> Reader<'a> {
    pub(crate) fn new(source: &'a Source) -> Self {
        Self { source, found: Diagnostics::new() }
    }

    /// Notes a fault of an element.
    pub(crate) fn error(&mut self, code: &'static str, node: Node, message: String, help: impl Into<String>) {
        self.found.push(Diagnostic::error(code, message).at(self.source, span(node)).help(help));
    }

    /// Notes what is left out of a model although it says so.
    pub(crate) fn warning(&mut self, code: &'static str, node: Node, message: String, help: impl Into<String>) {
        self.found.push(Diagnostic::warning(code, message).at(self.source, span(node)).help(help));
    }

    /// A child that must be there (W033).
    pub(crate) fn required<'n>(&mut self, node: Node<'n>, name: &str) -> Option<Node<'n>> {
        let found = child(node, name);
        if found.is_none() {
            let message = format!("`<{}>` has no `<{name}>`", node.tag_name().name());
            self.error("W033", node, message, format!("add `<{name}>…</{name}>`"));
        }
        found
    }

    /// An attribute that must be there (W033).
    pub(crate) fn attribute<'n>(&mut self, node: Node<'n>, name: &str) -> Option<&'n str> {
        let found = node.attribute(name).map(str::trim);
        if found.is_none() {
            let message = format!("`<{}>` has no attribute `{name}`", node.tag_name().name());
            self.error("W033", node, message, format!("write `<{} {name}=\"…\">`", node.tag_name().name()));
        }
        found
    }

    /// Exactly `N` numbers of a text that an element holds (W034).
    pub(crate) fn numbers<const N: usize>(&mut self, node: Node, text: &str, bound: Bound) -> Option<[f64; N]> {
        let numbers: Option<Vec<f64>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
        let expected = if N == 1 { "a number".to_owned() } else { format!("{N} numbers") };
        let Some(numbers) = numbers.and_then(|list| <[f64; N]>::try_from(list).ok()) else {
            let message = format!("`<{}>` must hold {expected}, but this is `{}`", node.tag_name().name(), short(text));
            self.error("W034", node, message, "separate numbers by blanks, and write them like 0.25");
            return None;
        };
        if numbers.iter().all(|number| bound.holds(*number)) {
            return Some(numbers);
        }
        let message = format!("`<{}>` is `{}`, and must be {}", node.tag_name().name(), short(text), bound.in_words());
        self.error("W034", node, message, "units are metres, kilograms and radians");
        None
    }

    /// One number of an element's text (W034).
    pub(crate) fn number(&mut self, node: Node, bound: Bound) -> Option<f64> {
        self.numbers::<1>(node, text(node), bound).map(|[number]| number)
    }

    /// A truth value of an element's text (W034).
    pub(crate) fn boolean(&mut self, node: Node) -> Option<bool> {
        match text(node) {
            "true" | "1" => Some(true),
            "false" | "0" => Some(false),
            other => {
                let message =
                    format!("`<{}>` must be true or false, but this is `{}`", node.tag_name().name(), short(other));
                self.error("W034", node, message, "write `true` or `false`");
                None
            }
        }
    }

    /// Warns of every child element that is neither read nor known to have no bearing (W036).
    pub(crate) fn leaves_out(&mut self, node: Node, known: &[&str]) {
        for other in node.children().filter(|child| child.is_element()) {
            let name = other.tag_name().name();
            // Names with a prefix or a colon are extensions of other programs.
            if !known.contains(&name) && other.tag_name().namespace().is_none() {
                let message = format!("`<{name}>` in `<{}>` is not read", node.tag_name().name());
                self.warning(
                    "W036",
                    other,
                    message,
                    format!("the model works without it; {}", did_you_mean(name, known.iter().copied())),
                );
            }
        }
    }
}

/// A rotation about the fixed axes x, y, z in this order, behind a shift. Units: metres, radians.
pub(crate) fn placed([x, y, z]: [f64; 3], [roll, pitch, yaw]: [f64; 3]) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_euler_angles(roll, pitch, yaw))
}

/// A pose with a quaternion x, y, z, w; nothing where this has no length.
pub(crate) fn turned([x, y, z]: [f64; 3], [qx, qy, qz, qw]: [f64; 4]) -> Option<Isometry3<f64>> {
    let quaternion = Quaternion::new(qw, qx, qy, qz);
    let rotation = UnitQuaternion::try_new(quaternion, 1e-9)?;
    Some(Isometry3::from_parts(Translation3::from(Vector3::new(x, y, z)), rotation))
}

/// The beginning of a text.
fn short(text: &str) -> String {
    const MOST: usize = 60;
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    match text.char_indices().nth(MOST) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}
