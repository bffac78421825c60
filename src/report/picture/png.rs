//! Rasterises a drawing and encodes it as PNG.

use std::io::Write as _;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use zeno::{Command, Fill, Join, Mask, PathBuilder, Stroke, Style as Brush};

use crate::picture::drawing::{Drawing, Line, Mark, Paint, Rect};
use crate::picture::font;

/// Pixels of the file per pixel of the drawing, so that small text stays sharp when zoomed in.
const DENSITY: u8 = 2;

impl Drawing {
    /// Encodes the drawing as a PNG file, with twice its width and height in pixels.
    ///
    /// # Errors
    /// The compressor fails; it writes to memory, so it can only run out of memory.
    pub fn to_png(&self) -> std::io::Result<Vec<u8>> {
        let mut canvas = Canvas::white(self.width, self.height);
        for (clip, mark) in &self.marks {
            match mark {
                Mark::Shape { lines, closed, style } => {
                    let path = path_of(lines, *closed);
                    if let Some(paint) = style.fill {
                        canvas.draw(&path, Fill::NonZero.into(), paint, clip.as_ref());
                    }
                    if let Some(line) = style.line {
                        canvas.stroke(&path, &line, clip.as_ref());
                    }
                }
                Mark::Words(words) => {
                    let at = words.at.map(|value| value * f64::from(DENSITY));
                    let path = font::outline(&words.text, at, words.size * f64::from(DENSITY), words.bold);
                    if words.rim {
                        canvas.stroke(&path, &Line::new(Paint::solid(0xff_ffff), 3.0), clip.as_ref());
                    }
                    canvas.draw(&path, Fill::NonZero.into(), words.paint, clip.as_ref());
                }
            }
        }
        canvas.to_png()
    }
}

fn path_of(lines: &[Vec<[f64; 2]>], closed: bool) -> Vec<Command> {
    let mut path = Vec::new();
    for line in lines {
        for (idx, point) in line.iter().enumerate() {
            let to = point.map(|value| single(value * f64::from(DENSITY)));
            if idx == 0 {
                path.move_to(to);
            } else {
                path.line_to(to);
            }
        }
        if closed {
            path.close();
        }
    }
    path
}

#[expect(clippy::cast_possible_truncation, reason = "pixels")]
fn single(value: f64) -> f32 {
    value as f32
}

/// Pixels, row by row from the upper left. Shape: height × width × red, green, blue.
struct Canvas {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
}

impl Canvas {
    fn white(width: f64, height: f64) -> Self {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few thousand pixels")]
        let [width, height] = [width, height].map(|size| (size * f64::from(DENSITY)).ceil().max(1.0) as usize);
        Self { width, height, pixels: vec![0xff; width * height * 3] }
    }

    fn stroke(&mut self, path: &[Command], line: &Line, clip: Option<&Rect>) {
        let dashes = line.dash.unwrap_or_default().map(|length| single(length * f64::from(DENSITY)));
        let mut stroke = Stroke::new(single(line.width * f64::from(DENSITY)));
        stroke.join(Join::Round);
        if line.dash.is_some() {
            stroke.dash(&dashes, 0.0);
        }
        self.draw(path, stroke.into(), line.paint, clip);
    }

    /// Fills or strokes a path.
    fn draw(&mut self, path: &[Command], brush: Brush<'_>, paint: Paint, clip: Option<&Rect>) {
        let (cover, placed) = Mask::new(path).style(brush).render();
        let (columns, rows) = self.seen(clip);
        let (width, height) = (placed.width as usize, placed.height as usize);
        for row in 0..height {
            let Some(y) = usize::try_from(placed.top + row as i32).ok().filter(|y| rows.contains(y)) else { continue };
            for column in 0..width {
                let Some(x) = usize::try_from(placed.left + column as i32).ok().filter(|x| columns.contains(x)) else {
                    continue;
                };
                let share = f64::from(cover[row * width + column]) / 255.0 * paint.opacity;
                if share > 0.0 {
                    self.mix([x, y], paint.rgb, share);
                }
            }
        }
    }

    /// Columns and rows inside a clipping rectangle.
    fn seen(&self, clip: Option<&Rect>) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        let whole = Rect { left: 0.0, top: 0.0, width: f64::INFINITY, height: f64::INFINITY };
        let Rect { left, top, width, height } = *clip.unwrap_or(&whole);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the canvas")]
        let range = |from: f64, length: f64, most: usize| {
            let pixel = |at: f64| (at * f64::from(DENSITY)).round().clamp(0.0, most as f64) as usize;
            pixel(from)..pixel(from + length)
        };
        (range(left, width, self.width), range(top, height, self.height))
    }

    fn mix(&mut self, [x, y]: [usize; 2], rgb: u32, share: f64) {
        let at = (y * self.width + x) * 3;
        for (idx, channel) in self.pixels[at..at + 3].iter_mut().enumerate() {
            let [_, colour @ ..] = rgb.to_be_bytes();
            let mixed = f64::from(*channel) * (1.0 - share) + f64::from(colour[idx]) * share;
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between two bytes")]
            let mixed = mixed.round() as u8;
            *channel = mixed;
        }
    }

    /// Encodes the file: a header, the compressed pixels and an end chunk (PNG, third edition, §5 and §11.2).
    fn to_png(&self) -> std::io::Result<Vec<u8>> {
        let mut rows = Vec::with_capacity(self.height * (self.width * 3 + 1));
        for row in self.pixels.chunks(self.width * 3) {
            rows.extend(filtered(row));
        }
        let mut compressor = ZlibEncoder::new(Vec::new(), Compression::default());
        compressor.write_all(&rows)?;
        let side = |length: usize| u32::try_from(length).unwrap_or(u32::MAX).to_be_bytes();
        // Eight bits per channel, RGB, no interlacing.
        let header = [side(self.width).as_slice(), &side(self.height), &[8, 2, 0, 0, 0]].concat();
        let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
        for (kind, data) in [(b"IHDR", header), (b"IDAT", compressor.finish()?), (b"IEND", Vec::new())] {
            chunk(&mut file, kind, &data);
        }
        Ok(file)
    }
}

/// Filters a row with the `Sub` filter: the filter type, then the difference of each byte from the pixel to its left.
fn filtered(row: &[u8]) -> Vec<u8> {
    const LEFT: u8 = 1;
    let mut out = Vec::with_capacity(row.len() + 1);
    out.push(LEFT);
    out.extend(row.iter().enumerate().map(|(idx, byte)| match idx.checked_sub(3) {
        Some(left) => byte.wrapping_sub(row[left]),
        None => *byte,
    }));
    out
}

fn chunk(file: &mut Vec<u8>, kind: &[u8; 4], data: &[u8]) {
    let mut sum = flate2::Crc::new();
    sum.update(kind);
    sum.update(data);
    file.extend(u32::try_from(data.len()).unwrap_or(u32::MAX).to_be_bytes());
    file.extend(kind);
    file.extend(data);
    file.extend(sum.sum().to_be_bytes());
}
