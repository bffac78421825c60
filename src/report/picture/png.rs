//! Rasterises a drawing and encodes it as PNG.

use tiny_skia::{
    FillRule, LineJoin, Mask, Path, PathBuilder, Pixmap, PixmapPaint, Stroke, StrokeDash, Transform,
};

use crate::picture::drawing::{DENSITY, Drawing, Line, Mark, Paint, Rect};
use crate::picture::font;

impl Drawing {
    /// Encodes the drawing as a PNG file, with twice its width and height in pixels.
    ///
    /// # Errors
    /// The drawing is too large for memory.
    pub fn to_png(&self) -> std::io::Result<Vec<u8>> {
        let mut canvas =
            Canvas::white(self.width, self.height).ok_or(std::io::ErrorKind::OutOfMemory)?;
        for (clip, mark) in &self.marks {
            canvas.clip(*clip);
            match mark {
                Mark::Shape {
                    lines,
                    closed,
                    style,
                } => {
                    let Some(path) = path_of(lines, *closed) else {
                        continue;
                    };
                    if let Some(paint) = style.fill {
                        canvas.fill(&path, paint);
                    }
                    if let Some(line) = style.line {
                        canvas.stroke(&path, &line);
                    }
                }
                Mark::Words(words) => {
                    let Some(path) = font::outline(&words.text, words.at, words.size, words.bold)
                    else {
                        continue;
                    };
                    if words.rim {
                        canvas.stroke(&path, &Line::new(Paint::solid(0xff_ffff), 3.0));
                    }
                    canvas.fill(&path, words.paint);
                }
                Mark::Image {
                    pixels,
                    at,
                    opacity,
                } => canvas.image(pixels, *at, *opacity),
            }
        }
        Ok(canvas.pixels.encode_png()?)
    }
}

/// Returns `None` if there is nothing to draw.
fn path_of(lines: &[Vec<[f64; 2]>], closed: bool) -> Option<Path> {
    let mut path = PathBuilder::new();
    for line in lines {
        for (idx, point) in line.iter().enumerate() {
            let [x, y] = point.map(single);
            if idx == 0 {
                path.move_to(x, y);
            } else {
                path.line_to(x, y);
            }
        }
        if closed {
            path.close();
        }
    }
    path.finish()
}

#[expect(clippy::cast_possible_truncation, reason = "pixels")]
fn single(value: f64) -> f32 {
    value as f32
}

fn scale() -> Transform {
    Transform::from_scale(single(DENSITY), single(DENSITY))
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "from 0 to 255"
)]
fn brush(Paint { rgb, opacity }: Paint) -> tiny_skia::Paint<'static> {
    let [_, red, green, blue] = rgb.to_be_bytes();
    let mut brush = tiny_skia::Paint::default();
    brush.set_color_rgba8(red, green, blue, (opacity * 255.0).round() as u8);
    brush
}

/// The pixels of a picture, with the clipping rectangle of the current mark.
struct Canvas {
    pixels: Pixmap,
    clip: Option<(Rect, Mask)>,
}

impl Canvas {
    fn white(width: f64, height: f64) -> Option<Self> {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few thousand pixels"
        )]
        let [width, height] = [width, height].map(|size| (size * DENSITY).ceil().max(1.0) as u32);
        let mut pixels = Pixmap::new(width, height)?;
        pixels.fill(tiny_skia::Color::WHITE);
        Some(Self { pixels, clip: None })
    }

    /// Limits later marks to a rectangle. Its edges are rounded to pixels.
    fn clip(&mut self, within: Option<Rect>) {
        if self.clip.as_ref().map(|(rect, _)| *rect) != within {
            self.clip = within.and_then(|rect| Some((rect, self.mask(&rect)?)));
        }
    }

    fn mask(&self, rect: &Rect) -> Option<Mask> {
        let mut mask = Mask::new(self.pixels.width(), self.pixels.height())?;
        mask.fill_path(
            &path_of(&[rect.corners()], true)?,
            FillRule::Winding,
            false,
            scale(),
        );
        Some(mask)
    }

    fn fill(&mut self, path: &Path, paint: Paint) {
        let mask = self.clip.as_ref().map(|(_, mask)| mask);
        self.pixels
            .fill_path(path, &brush(paint), FillRule::Winding, scale(), mask);
    }

    /// Draws pixels, at the nearest whole ones.
    fn image(&mut self, pixels: &Pixmap, at: [f64; 2], opacity: f64) {
        let mask = self.clip.as_ref().map(|(_, mask)| mask);
        #[expect(clippy::cast_possible_truncation, reason = "pixels")]
        let [left, top] = at.map(|along| (along * DENSITY).round() as i32);
        let paint = PixmapPaint {
            opacity: single(opacity),
            ..PixmapPaint::default()
        };
        self.pixels.draw_pixmap(
            left,
            top,
            pixels.as_ref(),
            &paint,
            Transform::identity(),
            mask,
        );
    }

    fn stroke(&mut self, path: &Path, line: &Line) {
        let dash = line
            .dash
            .and_then(|lengths| StrokeDash::new(lengths.map(single).to_vec(), 0.0));
        let stroke = Stroke {
            width: single(line.width),
            line_join: LineJoin::Round,
            dash,
            ..Stroke::default()
        };
        let mask = self.clip.as_ref().map(|(_, mask)| mask);
        self.pixels
            .stroke_path(path, &brush(line.paint), &stroke, scale(), mask);
    }
}
