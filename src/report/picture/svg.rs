//! Writes a drawing as SVG.

use std::fmt::Write as _;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use tiny_skia::Pixmap;

use crate::picture::drawing::{DENSITY, Drawing, Line, Mark, Paint, Rect, Style, Words};
use crate::picture::font;
use crate::xml;

impl Drawing {
    /// Formats the drawing as SVG.
    pub fn to_svg(&self) -> String {
        let (width, height) = (self.width, self.height);
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" \
             height=\"{height:.0}\" font-family=\"'DejaVu Sans', Verdana, sans-serif\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n"
        );
        let mut clip = None;
        for (idx, (within, mark)) in self.marks.iter().enumerate() {
            if *within != clip {
                change_clip(&mut out, clip, *within, idx);
                clip = *within;
            }
            match mark {
                Mark::Shape {
                    lines,
                    closed,
                    style,
                } => shape(&mut out, lines, *closed, style),
                Mark::Words(words) => text(&mut out, words),
                Mark::Image {
                    pixels,
                    at,
                    opacity,
                } => image(&mut out, pixels, *at, *opacity),
            }
        }
        change_clip(&mut out, clip, None, 0);
        out.push_str("</svg>\n");
        out
    }
}

fn change_clip(out: &mut String, old: Option<Rect>, new: Option<Rect>, number: usize) {
    if old.is_some() {
        out.push_str("</g>\n");
    }
    if let Some(Rect {
        left,
        top,
        width,
        height,
    }) = new
    {
        let _ = writeln!(
            out,
            "<clipPath id=\"c{number}\"><rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" \
             height=\"{height:.1}\"/></clipPath>\n<g clip-path=\"url(#c{number})\">"
        );
    }
}

fn shape(out: &mut String, lines: &[Vec<[f64; 2]>], closed: bool, style: &Style) {
    let mut path = String::new();
    for line in lines {
        for (idx, [x, y]) in line.iter().enumerate() {
            let _ = write!(path, "{}{x:.1},{y:.1}", if idx == 0 { "M" } else { " " });
        }
        path.push_str(if closed { "Z" } else { "" });
    }
    let fill = match style.fill {
        Some(paint) => paints("fill", paint),
        None => " fill=\"none\"".to_owned(),
    };
    let _ = writeln!(
        out,
        "<path d=\"{path}\"{fill}{}/>",
        style.line.map_or_else(String::new, stroke)
    );
}

/// Writes pixels as an embedded file of PNG.
fn image(out: &mut String, pixels: &Pixmap, [x, y]: [f64; 2], opacity: f64) {
    let Ok(png) = pixels.encode_png() else {
        // Only an image too large for memory can't be encoded.
        return;
    };
    let [width, height] =
        [pixels.width(), pixels.height()].map(|pixels| f64::from(pixels) / DENSITY);
    let _ = writeln!(
        out,
        "<image x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" opacity=\"{opacity}\" \
         href=\"data:image/png;base64,{}\"/>",
        BASE64_STANDARD.encode(png)
    );
}

fn stroke(line: Line) -> String {
    let dash = line.dash.map_or_else(String::new, |[dash, gap]| {
        format!(" stroke-dasharray=\"{dash} {gap}\"")
    });
    format!(
        "{} stroke-width=\"{}\" stroke-linejoin=\"round\"{dash}",
        paints("stroke", line.paint),
        line.width
    )
}

fn paints(what: &str, Paint { rgb, opacity }: Paint) -> String {
    let opacity = if opacity < 1.0 {
        format!(" {what}-opacity=\"{opacity}\"")
    } else {
        String::new()
    };
    format!(" {what}=\"#{rgb:06x}\"{opacity}")
}

fn text(out: &mut String, words: &Words) {
    let [x, y] = words.at;
    // A viewer without our font needs more or less room for the same letters.
    let width = font::width(&words.text, words.size, words.bold);
    let weight = if words.bold {
        " font-weight=\"bold\""
    } else {
        ""
    };
    let rim = if words.rim {
        " stroke=\"#ffffff\" stroke-width=\"3\" paint-order=\"stroke\""
    } else {
        ""
    };
    let _ = writeln!(
        out,
        "<text x=\"{x:.1}\" y=\"{y:.1}\" font-size=\"{}\" textLength=\"{width:.1}\" \
         lengthAdjust=\"spacingAndGlyphs\"{weight}{}{rim}>{}</text>",
        words.size,
        paints("fill", words.paint),
        xml::text(&words.text)
    );
}
