//! XML elements with their spans, on top of `roxmltree`.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use crate::foreign::frames::Included;
use actcheck_base::{Diagnostic, Diagnostics, Source, SourceSpan, Span, check_xml, did_you_mean};

/// Roots of files that other MJCF files include, and that are not elements of URDF or SDF.
const MJCF_PARTS: [&str; 15] = [
    "mujocoinclude",
    "worldbody",
    "body",
    "default",
    "asset",
    "actuator",
    "sensor",
    "contact",
    "tendon",
    "equality",
    "compiler",
    "option",
    "keyframe",
    "geom",
    "site",
];

/// Longest text of a model, robot or world; meshes have files of their own. Unit: bytes.
pub(crate) const LONGEST_MODEL: usize = 16 << 20;
/// Largest number of elements of one of the kinds in [`PARTS`]: each is simulated, or compared with
/// all others.
pub(crate) const MOST_PARTS: usize = 1_000;
/// Kinds of elements that models and worlds consist of.
const PARTS: [&str; 6] = ["link", "joint", "collision", "include", "model", "frame"];
/// Largest number of errors, and of warnings, that are reported for one file.
const MOST_FAULTS: usize = 200;

/// An element of a document.
pub(crate) type Node<'a> = roxmltree::Node<'a, 'a>;

/// The allowed range of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Bound {
    Finite,
    NotNegative,
    /// A mass, or a side of the ground: see [`LARGEST`].
    Positive,
    /// A length of a body: as [`Bound::Positive`], but see [`LONGEST`].
    Length,
    /// A position, or a moment of inertia: either sign, and as [`Bound::Positive`].
    Within,
    /// A mass that may be missing: 0 or as [`Bound::Positive`].
    Mass,
}

/// Largest mass of a body and largest side of the ground: no scene of a robot has a thousand tonnes
/// or a thousand kilometres, and the physics engine can't calculate with much larger numbers.
/// Units: kilograms, metres.
const LARGEST: f64 = 1e6;
/// Largest length of a body: a larger one is most likely in millimetres. Unit: metres.
pub(crate) const LONGEST: f64 = 1e3;

impl Bound {
    fn holds(self, number: f64) -> bool {
        number.is_finite()
            && match self {
                Self::Finite => true,
                Self::NotNegative => number >= 0.0,
                Self::Positive | Self::Length => number > 0.0 && number <= LARGEST,
                Self::Within => number.abs() <= LARGEST,
                Self::Mass => (0.0..=LARGEST).contains(&number),
            }
    }

    fn in_words(self) -> &'static str {
        match self {
            Self::Finite => "finite",
            Self::NotNegative => "at least 0",
            Self::Positive | Self::Length => "above 0 and at most 1000000",
            Self::Within => "between -1000000 and 1000000",
            Self::Mass => "at least 0 and at most 1000000",
        }
    }
}

/// Parses the document of a text: that of the source, or its
/// [`repaired`](crate::foreign::lenient::repaired) text.
///
/// # Errors
/// W031 at the first syntax error; W055 if parsing could exhaust time or memory.
pub(crate) fn parse<'t>(
    source: &Source,
    text: &'t str,
) -> Result<roxmltree::Document<'t>, Diagnostics> {
    check_xml(source, "W055")?;
    roxmltree::Document::parse(text).map_err(|error| {
        let place = error.pos();
        let at = offset(&source.text, place.row as usize, place.col as usize);
        // The library's message ends with the position, which our diagnostics print before the
        // message.
        let said = error.to_string();
        let said = said
            .rsplit_once(" at ")
            .map_or(said.as_str(), |(what, _)| what);
        Diagnostic::error("W031", format!("this is not XML: {said}"))
            .at(source, at..at)
            .help("check that every element is closed and that every `<` in text is written `&lt;`")
            .into()
    })
}

/// Parses the document of a model, a robot or a world.
///
/// # Errors
/// As [`parse`]; W055 also if it has more parts than can be simulated.
pub(crate) fn parse_model<'t>(
    source: &Source,
    text: &'t str,
) -> Result<roxmltree::Document<'t>, Diagnostics> {
    let refused = |message: String, at: Span| {
        Diagnostic::error("W055", message)
            .at(source, at)
            .help("use fewer and simpler parts; meshes have files of their own")
    };
    if source.text.len() > LONGEST_MODEL {
        return Err(refused(
            format!("this model is longer than {} MiB", LONGEST_MODEL >> 20),
            0..0,
        )
        .into());
    }
    let document = parse(source, text)?;
    for part in PARTS {
        let mut all = document
            .descendants()
            .filter(|node| node.is_element() && node.tag_name().name() == part);
        if let Some(next) = all.nth(MOST_PARTS) {
            return Err(refused(
                format!("this model has more than {MOST_PARTS} `<{part}>`"),
                span(next),
            )
            .into());
        }
    }
    Ok(document)
}

/// Returns the byte offset of a line and a column, both 1-based, the column in characters.
fn offset(text: &str, row: usize, column: usize) -> usize {
    let start: usize = text
        .split_inclusive('\n')
        .take(row.saturating_sub(1))
        .map(str::len)
        .sum();
    let line = text.get(start..).unwrap_or_default();
    start
        + line
            .char_indices()
            .nth(column.saturating_sub(1))
            .map_or(0, |(at, _)| at)
}

/// Returns the span of an element's start tag up to the end of its name.
pub(crate) fn span(node: Node) -> Span {
    let start = node.range().start;
    start..start + 1 + node.tag_name().name().len()
}

/// Returns the span of the start tag of an element up to the end of its name.
pub(crate) fn tag(place: &SourceSpan) -> Span {
    let text = place.source.text.get(place.span.clone());
    let name = text
        .unwrap_or_default()
        .find(|letter: char| letter.is_whitespace() || letter == '/' || letter == '>');
    place.span.start..name.map_or(place.span.end, |name| place.span.start + name)
}

/// Returns the place of an element's start tag up to the end of its name.
pub(crate) fn at_tag(place: &SourceSpan) -> SourceSpan {
    SourceSpan {
        source: place.source.clone(),
        span: tag(place),
    }
}

/// Returns the first child element.
pub(crate) fn first(node: Node<'_>) -> Option<Node<'_>> {
    node.children().find(Node::is_element)
}

/// Returns the first child element with this name. Returns `None` if there is no such child.
pub(crate) fn child<'a>(node: Node<'a>, name: &str) -> Option<Node<'a>> {
    children(node, name).next()
}

/// Returns all child elements with this name.
pub(crate) fn children<'a>(node: Node<'a>, name: &str) -> impl Iterator<Item = Node<'a>> {
    let name = name.to_owned();
    node.children()
        .filter(move |child| child.is_element() && child.tag_name().name() == name)
}

/// Returns an element's text without surrounding whitespace.
pub(crate) fn text<'a>(node: Node<'a>) -> &'a str {
    node.text().map_or("", str::trim)
}

/// A text that is made of several files: the start of each piece in it, and the place of the piece
/// in its own file. The first piece starts at 0.
pub(crate) type Pieces = Vec<(usize, Source, usize)>;

/// A file being read, and the faults found in it.
pub(crate) struct Reader<'a> {
    pub(crate) source: &'a Source,
    /// The pieces of the text; empty if it is one file.
    pub(crate) pieces: Pieces,
    pub(crate) found: Diagnostics,
    /// Frames of included models that have been read, by the offset of their `<include>`.
    pub(crate) included: BTreeMap<usize, Included>,
    n_errors: usize,
    n_warnings: usize,
}

impl<'a> Reader<'a> {
    pub(crate) fn new(source: &'a Source) -> Self {
        Self {
            source,
            pieces: Vec::new(),
            found: Diagnostics::new(),
            included: BTreeMap::new(),
            n_errors: 0,
            n_warnings: 0,
        }
    }

    /// Calls a function whose faults are not reported but returned with its result.
    pub(crate) fn aside<T>(&mut self, read: impl FnOnce(&mut Self) -> T) -> (T, Diagnostics) {
        let mut apart = Self {
            pieces: self.pieces.clone(),
            included: std::mem::take(&mut self.included),
            ..Self::new(self.source)
        };
        let result = read(&mut apart);
        self.included = apart.included;
        (result, apart.found)
    }

    /// Returns the place of an element, in the file that contains it.
    pub(crate) fn place(&self, node: Node) -> SourceSpan {
        self.located(node.range())
    }

    /// Returns a place in the text, in the file that contains it.
    pub(crate) fn located(&self, span: Span) -> SourceSpan {
        let after = self
            .pieces
            .partition_point(|(start, ..)| *start <= span.start);
        let Some((start, source, own)) = after.checked_sub(1).map(|idx| &self.pieces[idx]) else {
            return SourceSpan {
                source: self.source.clone(),
                span,
            };
        };
        let moved = |at: usize| (at - start + own).min(source.text.len());
        SourceSpan {
            source: source.clone(),
            span: moved(span.start)..moved(span.end),
        }
    }

    /// Records an error of an element. Those after the first 200 are dropped, as are warnings.
    pub(crate) fn error(
        &mut self,
        code: &'static str,
        node: Node,
        message: String,
        help: impl Into<String>,
    ) {
        self.error_at(code, span(node), message, help);
    }

    /// Records an error about a place in the text.
    pub(crate) fn error_at(
        &mut self,
        code: &'static str,
        span: Span,
        message: String,
        help: impl Into<String>,
    ) {
        self.error_in(code, self.located(span), message, help);
    }

    /// Records an error about a place in any file.
    pub(crate) fn error_in(
        &mut self,
        code: &'static str,
        place: SourceSpan,
        message: String,
        help: impl Into<String>,
    ) {
        self.n_errors += 1;
        if self.n_errors <= MOST_FAULTS {
            let SourceSpan { source, span } = place;
            self.found.push(
                Diagnostic::error(code, message)
                    .at(&source, span)
                    .help(help),
            );
        }
    }

    /// Records a warning about an element, usually that it is ignored.
    pub(crate) fn warning(
        &mut self,
        code: &'static str,
        node: Node,
        message: String,
        help: impl Into<String>,
    ) {
        self.warning_at(code, span(node), message, help);
    }

    /// Records a warning about a place in the text.
    pub(crate) fn warning_at(
        &mut self,
        code: &'static str,
        span: Span,
        message: String,
        help: impl Into<String>,
    ) {
        self.warning_in(code, self.located(span), message, help);
    }

    /// Records a warning about a place in any file.
    pub(crate) fn warning_in(
        &mut self,
        code: &'static str,
        place: SourceSpan,
        message: String,
        help: impl Into<String>,
    ) {
        self.n_warnings += 1;
        if self.n_warnings <= MOST_FAULTS {
            let SourceSpan { source, span } = place;
            self.found.push(
                Diagnostic::warning(code, message)
                    .at(&source, span)
                    .help(help),
            );
        }
    }

    /// Returns `Some` if the root of a document has this name; otherwise reports W032.
    pub(crate) fn root(&mut self, root: Node, name: &str, help: &str) -> Option<()> {
        let found = root.tag_name().name();
        if found == name {
            return Some(());
        }
        let message = format!("the root is `<{found}>` instead of `<{name}>`");
        // A fragment has the elements of MJCF, but not a whole model.
        let help = if MJCF_PARTS.contains(&found) {
            "this is a part of an MJCF model: name the file with `<mujoco>` that includes it"
        } else {
            help
        };
        self.error("W032", root, message, help);
        None
    }

    /// Returns a required child; reports W033 and returns `None` if it is missing.
    pub(crate) fn required<'n>(&mut self, node: Node<'n>, name: &str) -> Option<Node<'n>> {
        let found = child(node, name);
        if found.is_none() {
            let message = format!("`<{}>` has no `<{name}>`", node.tag_name().name());
            self.error("W033", node, message, format!("add `<{name}>…</{name}>`"));
        }
        found
    }

    /// Returns a required attribute; reports W033 and returns `None` if it is missing.
    pub(crate) fn attribute<'n>(&mut self, node: Node<'n>, name: &str) -> Option<&'n str> {
        let found = node.attribute(name).map(str::trim);
        if found.is_none() {
            let message = format!("`<{}>` has no attribute `{name}`", node.tag_name().name());
            self.error(
                "W033",
                node,
                message,
                format!("write `<{} {name}=\"…\">`", node.tag_name().name()),
            );
        }
        found
    }

    /// Parses exactly `N` numbers from a text of an element; reports W034 and returns `None` if
    /// they are invalid.
    pub(crate) fn numbers<const N: usize>(
        &mut self,
        node: Node,
        text: &str,
        bound: Bound,
    ) -> Option<[f64; N]> {
        let numbers: Option<Vec<f64>> = text
            .split_whitespace()
            .map(|word| word.parse().ok())
            .collect();
        let expected = if N == 1 {
            "a number".to_owned()
        } else {
            format!("{N} numbers")
        };
        let Some(numbers) = numbers.and_then(|list| <[f64; N]>::try_from(list).ok()) else {
            let message = format!(
                "`<{}>` must contain {expected}, but this is `{}`",
                node.tag_name().name(),
                short(text)
            );
            self.error(
                "W034",
                node,
                message,
                "separate numbers by spaces, and write them like 0.25",
            );
            return None;
        };
        if numbers.iter().all(|number| bound.holds(*number)) {
            if bound == Bound::Length && numbers.iter().any(|number| *number > LONGEST) {
                let message = format!(
                    "`<{}>` is `{}`, which is beyond {LONGEST} m",
                    node.tag_name().name(),
                    short(text)
                );
                self.error(
                    "W034",
                    node,
                    message,
                    "lengths are in metres, not in millimetres",
                );
                return None;
            }
            return Some(numbers);
        }
        let message = format!(
            "`<{}>` is `{}`, but must be {}",
            node.tag_name().name(),
            short(text),
            bound.in_words()
        );
        self.error(
            "W034",
            node,
            message,
            "units are metres, kilograms and radians",
        );
        None
    }

    /// Parses the numbers of an attribute, of which there may be any number; reports W034 and returns
    /// `None` if one of them is not a finite number.
    pub(crate) fn list(&mut self, node: Node, name: &str, text: &str) -> Option<Vec<f64>> {
        let words = text.split_whitespace();
        let numbers: Option<Vec<f64>> = words
            .map(|word| word.parse().ok().filter(|number: &f64| number.is_finite()))
            .collect();
        if numbers.is_none() {
            let message = format!(
                "`{name}` must contain numbers, but this is `{}`",
                short(text)
            );
            let help = "separate numbers by spaces, and write them like 0.25";
            self.error("W034", node, message, help);
        }
        numbers
    }

    /// Parses one number from an element's text; reports W034 and returns `None` if it is invalid.
    pub(crate) fn number(&mut self, node: Node, bound: Bound) -> Option<f64> {
        self.numbers::<1>(node, text(node), bound)
            .map(|[number]| number)
    }

    /// Parses a boolean from an element's text; reports W034 and returns `None` if it is invalid.
    pub(crate) fn boolean(&mut self, node: Node) -> Option<bool> {
        self.truth(node, node.tag_name().name(), text(node))
    }

    /// Parses a boolean from an attribute; false if it is missing. Reports W034 and returns `None`
    /// if it is invalid.
    pub(crate) fn boolean_attribute(&mut self, node: Node, name: &str) -> Option<bool> {
        match node.attribute(name) {
            Some(written) => self.truth(node, name, written.trim()),
            None => Some(false),
        }
    }

    fn truth(&mut self, node: Node, name: &str, written: &str) -> Option<bool> {
        let found = truth(written);
        if found.is_none() {
            let message = format!(
                "`<{name}>` must be true or false, but this is `{}`",
                short(written)
            );
            self.error("W034", node, message, "write `true` or `false`");
        }
        found
    }

    /// Warns about every child element that is not in `known` (W036).
    pub(crate) fn warn_about_unknown_children(&mut self, node: Node, known: &[&str]) {
        for other in node.children().filter(|child| child.is_element()) {
            let name = other.tag_name().name();
            // Elements with a namespace are extensions of other programs.
            if !known.contains(&name) && other.tag_name().namespace().is_none() {
                let message = format!("`<{name}>` in `<{}>` is ignored", node.tag_name().name());
                self.warning(
                    "W036",
                    other,
                    message,
                    format!(
                        "the model works without it; {}",
                        did_you_mean(name, known.iter().copied())
                    ),
                );
            }
        }
    }
}

/// Returns a boolean of XML Schema, in upper or lower case as Gazebo reads it; `None` for other
/// text.
pub(crate) fn truth(text: &str) -> Option<bool> {
    match text.to_ascii_lowercase().as_str() {
        "true" | "1" => Some(true),
        "false" | "0" => Some(false),
        _ => None,
    }
}

/// Returns a pose from a translation and a rotation about the fixed axes x, y, z in this order.
/// Units: metres, radians.
pub(crate) fn placed([x, y, z]: [f64; 3], [roll, pitch, yaw]: [f64; 3]) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::new(x, y, z),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    )
}

/// Returns a pose from a translation and a quaternion x, y, z, w; `None` if the quaternion is zero.
pub(crate) fn turned([x, y, z]: [f64; 3], [qx, qy, qz, qw]: [f64; 4]) -> Option<Isometry3<f64>> {
    let quaternion = Quaternion::new(qw, qx, qy, qz);
    let rotation = UnitQuaternion::try_new(quaternion, 1e-9)?;
    Some(Isometry3::from_parts(
        Translation3::from(Vector3::new(x, y, z)),
        rotation,
    ))
}

/// Returns the beginning of a text, on one line.
pub(crate) fn short(text: &str) -> String {
    const MOST: usize = 60;
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    match text.char_indices().nth(MOST) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}
