//! Measures text and returns its outlines.
//!
//! The fonts are subsets of DejaVu Sans, embedded so that pictures do not depend on the fonts of
//! the machine.

use std::sync::OnceLock;

use tiny_skia::{Path, PathBuilder, Point};
use ttf_parser::{Face, GlyphId, OutlineBuilder};

const REGULAR: &[u8] = include_bytes!("font/DejaVuSans.ttf");
const BOLD: &[u8] = include_bytes!("font/DejaVuSans-Bold.ttf");

/// Replacement for characters that the font lacks.
const MISSING: char = '\u{fffd}';

fn face(bold: bool) -> Option<&'static Face<'static>> {
    static FACES: [OnceLock<Option<Face<'static>>>; 2] = [OnceLock::new(), OnceLock::new()];
    let (slot, bytes) = if bold { (1, BOLD) } else { (0, REGULAR) };
    FACES[slot]
        .get_or_init(|| Face::parse(bytes, 0).ok())
        .as_ref()
}

/// Glyphs of a text with their offsets from its left end, and the total width. Unit: font units.
fn glyphs(face: &Face<'_>, text: &str) -> (Vec<(GlyphId, f32)>, f32) {
    let mut along = 0.0;
    let mut placed = Vec::new();
    for letter in text.chars() {
        let Some(glyph) = face
            .glyph_index(letter)
            .or_else(|| face.glyph_index(MISSING))
        else {
            continue;
        };
        placed.push((glyph, along));
        along += f32::from(face.glyph_hor_advance(glyph).unwrap_or(0));
    }
    (placed, along)
}

/// Width of a text. Unit: the unit of `size`.
pub(super) fn width(text: &str, size: f64, bold: bool) -> f64 {
    face(bold).map_or(0.0, |face| {
        f64::from(glyphs(face, text).1) * size / f64::from(face.units_per_em())
    })
}

/// Outline of a text whose baseline starts at a point. Returns `None` if there is nothing to draw.
/// Unit: pixels, y down.
pub(super) fn outline(text: &str, at: [f64; 2], size: f64, bold: bool) -> Option<Path> {
    let face = face(bold)?;
    #[expect(clippy::cast_possible_truncation, reason = "pixels")]
    let (size, [x, y]) = (size as f32, at.map(|value| value as f32));
    let scale = size / f32::from(face.units_per_em());
    let mut pen = Pen {
        x,
        y,
        scale,
        path: PathBuilder::new(),
    };
    for (glyph, along) in glyphs(face, text).0 {
        pen.x = x + along * scale;
        face.outline_glyph(glyph, &mut pen);
    }
    pen.path.finish()
}

/// Returns a text whose end is replaced by an ellipsis if it is wider than `most`; an empty one if
/// that leaves nothing.
pub(super) fn shortened(text: &str, size: f64, bold: bool, most: f64) -> String {
    if width(text, size, bold) <= most {
        return text.to_owned();
    }
    let mut kept = text.to_owned();
    while kept.pop().is_some() {
        let cut = format!("{}…", kept.trim_end());
        if width(&cut, size, bold) <= most {
            return if kept.is_empty() { String::new() } else { cut };
        }
    }
    String::new()
}

/// Splits a text into lines of at most the width `most`, between words if possible.
pub(super) fn wrapped(text: &str, size: f64, bold: bool, most: f64) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let mut rest = word;
        while let Some(line) = lines.last_mut() {
            let longer = if line.is_empty() {
                rest.to_owned()
            } else {
                format!("{line} {rest}")
            };
            if width(&longer, size, bold) <= most {
                *line = longer;
                break;
            }
            if line.is_empty() {
                // Break words that are wider than a line.
                let fits = rest
                    .char_indices()
                    .map(|(at, letter)| at + letter.len_utf8());
                let end = fits
                    .take_while(|end| width(&rest[..*end], size, bold) <= most)
                    .last();
                let first = rest.chars().next().map_or(rest.len(), char::len_utf8);
                let (head, tail) = rest.split_at(end.unwrap_or(first));
                line.push_str(head);
                rest = tail;
                if rest.is_empty() {
                    break;
                }
            }
            lines.push(String::new());
        }
    }
    lines
}

/// Converts the font's outlines (y up) to a path.
struct Pen {
    x: f32,
    y: f32,
    scale: f32,
    path: PathBuilder,
}

impl Pen {
    fn at(&self, x: f32, y: f32) -> Point {
        Point::from_xy(self.x + x * self.scale, self.y - y * self.scale)
    }
}

impl OutlineBuilder for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        let to = self.at(x, y);
        self.path.move_to(to.x, to.y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let to = self.at(x, y);
        self.path.line_to(to.x, to.y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let (control, to) = (self.at(x1, y1), self.at(x, y));
        self.path.quad_to(control.x, control.y, to.x, to.y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let (first, second, to) = (self.at(x1, y1), self.at(x2, y2), self.at(x, y));
        self.path
            .cubic_to(first.x, first.y, second.x, second.y, to.x, to.y);
    }

    fn close(&mut self) {
        self.path.close();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_embedded_fonts_have_glyphs_with_a_width() {
        for bold in [false, true] {
            assert!(face(bold).is_some());
            // The widest letter, relative to the size: 0.97 regular and 1.04 bold.
            assert!((0.9..1.1).contains(&(width("mm", 12.0, bold) / 24.0)));
            assert!(outline("Ä→✗", [0.0, 0.0], 12.0, bold).is_some_and(|path| path.len() > 20));
        }
        assert_eq!(
            width("\u{4e00}", 12.0, false),
            width("\u{fffd}", 12.0, false)
        );
    }

    #[test]
    fn text_is_shortened_to_its_room() {
        let text = "a_thing_with_a_long_name_1";
        assert_eq!(shortened(text, 12.0, true, 1e3), text);
        for most in [0.0, 8.0, 20.0, 60.0, 150.0] {
            let short = shortened(text, 12.0, true, most);
            assert!(width(&short, 12.0, true) <= most, "{short}");
            assert!(short.is_empty() || short.ends_with('…'), "{short}");
        }
    }

    #[test]
    fn wrapped_text_is_complete() {
        let text = "the fingers did not close on glass_1 averyveryverylongwordthatfitsnowhere ok";
        for most in [5.0, 60.0, 200.0, 5000.0] {
            let lines = wrapped(text, 12.0, false, most);
            let letters = |text: &str| {
                text.chars()
                    .filter(|letter| *letter != ' ')
                    .collect::<String>()
            };
            assert_eq!(letters(&lines.concat()), letters(text));
            assert!(
                lines
                    .iter()
                    .all(|line| width(line, 12.0, false) <= most || line.chars().count() == 1),
                "{lines:?}"
            );
        }
        assert_eq!(wrapped("", 12.0, false, 100.0), [""]);
    }
}
