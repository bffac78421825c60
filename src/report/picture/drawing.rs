//! Vector drawings: a list of shapes and text, independent of the output format.

use tiny_skia::Pixmap;

use crate::picture::font;

/// A rectangle. Unit: pixels, y down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rect {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) width: f64,
    pub(super) height: f64,
}

impl Rect {
    pub(super) fn right(&self) -> f64 {
        self.left + self.width
    }

    pub(super) fn bottom(&self) -> f64 {
        self.top + self.height
    }

    pub(super) fn middle(&self) -> [f64; 2] {
        [self.left + self.width / 2.0, self.top + self.height / 2.0]
    }

    /// Corners in order around the rectangle.
    pub(super) fn corners(&self) -> Vec<[f64; 2]> {
        vec![
            [self.left, self.top],
            [self.right(), self.top],
            [self.right(), self.bottom()],
            [self.left, self.bottom()],
        ]
    }

    pub(super) fn grown(&self, by: f64) -> Self {
        Self {
            left: self.left - by,
            top: self.top - by,
            width: self.width + 2.0 * by,
            height: self.height + 2.0 * by,
        }
    }

    /// The smallest rectangle around this one and a point.
    pub(super) fn with(&self, [x, y]: [f64; 2]) -> Self {
        let (left, top) = (self.left.min(x), self.top.min(y));
        Self {
            left,
            top,
            width: self.right().max(x) - left,
            height: self.bottom().max(y) - top,
        }
    }

    /// Area of the intersection of two rectangles.
    pub(super) fn shared(&self, other: &Self) -> f64 {
        let across = self.right().min(other.right()) - self.left.max(other.left);
        let down = self.bottom().min(other.bottom()) - self.top.max(other.top);
        across.max(0.0) * down.max(0.0)
    }

    /// The part of a rectangle that is in another one; a point or line at its edge if it is outside.
    pub(super) fn within(&self, other: &Self) -> Self {
        let inside = |value: f64, low: f64, high: f64| value.max(low).min(high);
        let left = inside(self.left, other.left, other.right());
        let top = inside(self.top, other.top, other.bottom());
        Self {
            left,
            top,
            width: inside(self.right(), other.left, other.right()) - left,
            height: inside(self.bottom(), other.top, other.bottom()) - top,
        }
    }

    pub(super) fn holds(&self, other: &Self) -> bool {
        self.left <= other.left
            && self.top <= other.top
            && self.right() >= other.right()
            && self.bottom() >= other.bottom()
    }
}

/// A colour (0xRRGGBB) and its opacity from 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Paint {
    pub(super) rgb: u32,
    pub(super) opacity: f64,
}

impl Paint {
    pub(super) const fn new(rgb: u32, opacity: f64) -> Self {
        Self { rgb, opacity }
    }

    pub(super) const fn solid(rgb: u32) -> Self {
        Self::new(rgb, 1.0)
    }
}

/// Stroke style. Unit: pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Line {
    pub(super) paint: Paint,
    pub(super) width: f64,
    /// Lengths of dashes and gaps; `None` for a solid line.
    pub(super) dash: Option<[f64; 2]>,
}

impl Line {
    pub(super) const fn new(paint: Paint, width: f64) -> Self {
        Self {
            paint,
            width,
            dash: None,
        }
    }

    pub(super) const fn dashed(paint: Paint, width: f64, dash: [f64; 2]) -> Self {
        Self {
            paint,
            width,
            dash: Some(dash),
        }
    }
}

/// Fill and stroke of a shape.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Style {
    pub(super) fill: Option<Paint>,
    pub(super) line: Option<Line>,
}

impl Style {
    pub(super) const fn line(line: Line) -> Self {
        Self {
            fill: None,
            line: Some(line),
        }
    }

    pub(super) const fn fill(paint: Paint) -> Self {
        Self {
            fill: Some(paint),
            line: None,
        }
    }

    pub(super) const fn both(fill: Paint, line: Line) -> Self {
        Self {
            fill: Some(fill),
            line: Some(line),
        }
    }
}

/// A single line of text. Unit: pixels.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Words {
    pub(super) text: String,
    /// Left end of the baseline.
    pub(super) at: [f64; 2],
    pub(super) size: f64,
    pub(super) bold: bool,
    pub(super) paint: Paint,
    /// Whether to draw a light outline for contrast with the background.
    pub(super) rim: bool,
}

/// A drawn element.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Mark {
    /// Polygons (if closed) or polylines, drawn as one shape.
    Shape {
        lines: Vec<Vec<[f64; 2]>>,
        closed: bool,
        style: Style,
    },
    Words(Words),
    /// Pixels with [`DENSITY`] for each of the drawing, and their opacity.
    Image {
        pixels: Pixmap,
        /// Upper left corner.
        at: [f64; 2],
        opacity: f64,
    },
}

/// Pixels of a file per pixel of the drawing, so that small text stays sharp when zoomed in.
pub(super) const DENSITY: f64 = 2.0;

/// A picture: shapes and text, drawn in order. Unit: pixels; origin at the upper left, y down.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawing {
    pub(super) width: f64,
    pub(super) height: f64,
    /// Marks, each with its clipping rectangle.
    pub(super) marks: Vec<(Option<Rect>, Mark)>,
    clip: Option<Rect>,
}

/// Coordinates are limited to this distance, because unstable simulations can place bodies
/// anywhere. Unit: pixels.
const FAR_PX: f64 = 20_000.0;
/// Least distance of a text from the right edge. Unit: pixels.
const EDGE_PX: f64 = 2.0;

impl Drawing {
    pub(super) fn new(width: f64) -> Self {
        Self {
            width,
            height: 0.0,
            marks: Vec::new(),
            clip: None,
        }
    }

    /// Sets the clipping rectangle of later marks; `None` removes it.
    pub(super) fn clip(&mut self, within: Option<Rect>) {
        self.clip = within;
    }

    pub(super) fn polygon(&mut self, points: Vec<[f64; 2]>, style: Style) {
        self.shape(vec![points], true, style);
    }

    pub(super) fn line(&mut self, points: Vec<[f64; 2]>, line: Line) {
        self.shape(vec![points], false, Style::line(line));
    }

    pub(super) fn circle(&mut self, [x, y]: [f64; 2], radius: f64, style: Style) {
        let turn = std::f64::consts::TAU / 28.0;
        let points = (0..28).map(|idx| turn * f64::from(idx));
        self.polygon(
            points
                .map(|a| [x + radius * libm::cos(a), y + radius * libm::sin(a)])
                .collect(),
            style,
        );
    }

    /// Draws polygons or lines as one shape, so that translucent fills do not add up where they
    /// overlap.
    pub(super) fn shape(&mut self, lines: Vec<Vec<[f64; 2]>>, closed: bool, style: Style) {
        let near = |point: &[f64; 2]| point.iter().all(|value| value.abs() < FAR_PX);
        let lines: Vec<Vec<[f64; 2]>> = lines
            .into_iter()
            .filter(|line| line.len() > 1 && line.iter().all(near))
            .collect();
        if !lines.is_empty() {
            self.marks.push((
                self.clip,
                Mark::Shape {
                    lines,
                    closed,
                    style,
                },
            ));
        }
    }

    /// Draws pixels over the drawing so far.
    pub(super) fn image(&mut self, pixels: Pixmap, at: [f64; 2], opacity: f64) {
        self.marks.push((
            self.clip,
            Mark::Image {
                pixels,
                at,
                opacity,
            },
        ));
    }

    /// Writes a line of text; the end of one that would run out of the picture becomes an ellipsis.
    pub(super) fn words(&mut self, words: Words) {
        if words.at.iter().any(|value| value.abs() >= FAR_PX) {
            return;
        }
        let end = self
            .clip
            .map_or(self.width, |clip| clip.right().min(self.width));
        let room = end - EDGE_PX - words.at[0];
        let text = font::shortened(&words.text, words.size, words.bold, room);
        if !text.is_empty() {
            self.marks
                .push((self.clip, Mark::Words(Words { text, ..words })));
        }
    }
}
