//! Charts of the signals that decided failed properties about time.

use crate::html::Explained;
use crate::picture::drawing::{Drawing, Line, Paint, Rect, Style, Words};
use crate::picture::{font, paint};
use actcheck_base::{DecidingSignal, names};

/// Maximum number of charts; a picture is not a report.
const MOST: usize = 6;
/// Height of a chart without its title and its axis. Unit: pixels.
const HEIGHT_PX: f64 = 84.0;
/// Height of the title, and of the axis below. Unit: pixels.
const LINE_PX: f64 = 18.0;
/// Width to the left of a chart, for its values. Unit: pixels.
const VALUES_PX: f64 = 58.0;
/// Font size. Unit: pixels.
const SIZE_PX: f64 = 11.0;
const CURVE: Line = Line::new(Paint::solid(paint::TARGET), 1.4);
const LIMIT: Line = Line::dashed(Paint::solid(paint::FAILED), 1.3, [5.0, 3.0]);
const MOMENT: Line = Line::new(Paint::solid(paint::FAILED), 1.2);
const VIOLATED: Style = Style::fill(Paint::new(paint::FAILED, 0.12));

/// A signal with the property that it decided.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Position of the action in the test, from 1, and name of the property.
    pub title: String,
    /// The signal.
    pub signal: DecidingSignal,
}

impl Chart {
    /// The charts of explained failures.
    pub fn all_of(explained: &[Explained]) -> Vec<Self> {
        let of_one = |why: &Explained| {
            let title = format!("{}. {}", why.step, names::local(&why.property));
            why.deciding
                .iter()
                .map(move |signal| Self {
                    title: title.clone(),
                    signal: signal.clone(),
                })
                .collect()
        };
        explained
            .iter()
            .flat_map(|why| -> Vec<Self> { of_one(why) })
            .take(MOST)
            .collect()
    }
}

/// Draws charts in two columns, from an upper end on. Returns their lower end.
pub(super) fn draw(drawing: &mut Drawing, charts: &[Chart], area: Rect, gap: f64) -> f64 {
    let width = (area.width - gap) / 2.0;
    let each = HEIGHT_PX + 2.0 * LINE_PX + 8.0;
    for (idx, chart) in charts.iter().enumerate() {
        let (row, column) = (idx / 2, idx % 2);
        let left = area.left + column as f64 * (width + gap);
        let top = area.top + row as f64 * each;
        let plot = Rect {
            left: left + VALUES_PX,
            top: top + LINE_PX,
            width: width - VALUES_PX,
            height: HEIGHT_PX,
        };
        one(drawing, chart, plot, left);
    }
    area.top + charts.len().div_ceil(2) as f64 * each
}

fn one(drawing: &mut Drawing, chart: &Chart, plot: Rect, left: f64) {
    let signal = &chart.signal;
    let [low, high] = signal.range();
    let (low, high) = if high > low {
        (low.min(0.0), high)
    } else {
        (low - 0.5, high + 0.5)
    };
    let duration = signal.values.len().saturating_sub(1).max(1) as f64 * signal.period_secs;
    let x = |secs: f64| plot.left + secs / duration * plot.width;
    let y = |value: f64| plot.bottom() - 4.0 - (value - low) / (high - low) * (plot.height - 8.0);
    drawing.polygon(plot.corners(), paint::BACKGROUND);
    let [from, to] = signal.interval_secs().map(x);
    let shade = Rect {
        left: from,
        width: (to - from).max(2.0),
        ..plot
    };
    drawing.polygon(shade.corners(), VIOLATED);
    let points = |values: &[f64]| -> Vec<[f64; 2]> {
        values
            .iter()
            .enumerate()
            .map(|(idx, value)| [x(idx as f64 * signal.period_secs), y(*value)])
            .collect()
    };
    drawing.line(points(&signal.limit), LIMIT);
    drawing.line(points(&signal.values), CURVE);
    let at = signal.at_secs();
    drawing.line(vec![[x(at), plot.top], [x(at), plot.bottom()]], MOMENT);
    if let Some(value) = signal.values.get(signal.at) {
        drawing.circle([x(at), y(*value)], 3.5, Style::line(MOMENT));
    }
    labels(drawing, chart, plot, left, [low, high]);
    // The moment below the axis, at most as far right as the chart.
    let text = format!("{} s", rounded(at));
    let wide = font::width(&text, SIZE_PX, true);
    let start = (x(at) - wide / 2.0).clamp(plot.left, plot.right() - wide);
    write(
        drawing,
        text,
        [start, plot.bottom() + 13.0],
        (paint::FAILED, true),
    );
    for (secs, text) in [
        (0.0, "0 s".to_owned()),
        (duration, format!("{} s", rounded(duration))),
    ] {
        let own = font::width(&text, SIZE_PX, false);
        let place = (x(secs) - own / 2.0).clamp(plot.left, plot.right() - own);
        if place + own + 6.0 < start || start + wide + 6.0 < place {
            write(
                drawing,
                text,
                [place, plot.bottom() + 13.0],
                (paint::GREY, false),
            );
        }
    }
}

/// The title with the comparison, and the smallest and the largest value.
fn labels(drawing: &mut Drawing, chart: &Chart, plot: Rect, left: f64, [low, high]: [f64; 2]) {
    let signal = &chart.signal;
    let unit = if signal.unit.is_empty() {
        String::new()
    } else {
        format!(" {}", signal.unit)
    };
    let limit = match (signal.constant_limit(), signal.limit.is_empty()) {
        (_, true) => String::new(),
        (Some(limit), _) => format!(" {} {}{unit}", signal.symbol, rounded(limit)),
        (None, _) => format!(" {} the dashed limit{unit}", signal.symbol),
    };
    let title = format!("{}: {}{limit}", chart.title, signal.quantity);
    let mut lines = font::wrapped(&title, SIZE_PX, true, plot.right() - left - 12.0);
    let more = lines.len() > 1;
    let line = lines.drain(..).next().unwrap_or_default() + if more { " …" } else { "" };
    write(drawing, line, [left, plot.top - 6.0], (paint::INK, true));
    for (value, y) in [(high, plot.top + 10.0), (low, plot.bottom() - 2.0)] {
        // A value that is as good as 0 in the chart is 0.
        let value = if value.abs() < 1e-3 * (high - low) {
            0.0
        } else {
            value
        };
        let text = format!("{}{unit}", rounded(value));
        let start = plot.left - 6.0 - font::width(&text, SIZE_PX, false);
        write(drawing, text, [start.max(left), y], (paint::GREY, false));
    }
}

fn write(drawing: &mut Drawing, text: String, at: [f64; 2], (rgb, bold): (u32, bool)) {
    drawing.words(Words {
        text,
        at,
        size: SIZE_PX,
        bold,
        paint: Paint::solid(rgb),
        rim: false,
    });
}

/// Formats a number with three significant digits.
fn rounded(value: f64) -> String {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "from 0 to 6"
    )]
    let digits = if value == 0.0 {
        0
    } else {
        (2.0 - value.abs().log10().floor()).clamp(0.0, 6.0) as usize
    };
    let text = format!("{value:.digits$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(at: usize, limit: Vec<f64>) -> Chart {
        let signal = DecidingSignal {
            quantity: "tilt(cup)".to_owned(),
            unit: "rad",
            symbol: "<",
            period_secs: 0.1,
            values: (0..=20).map(|idx| f64::from(idx) / 20.0).collect(),
            limit,
            interval: [at, 20],
            at,
        };
        Chart {
            title: "1. KeptUpright".to_owned(),
            signal,
        }
    }

    fn words(chart: Chart) -> Vec<(String, f64, f64)> {
        let mut drawing = Drawing::new(1200.0);
        let area = Rect {
            left: 10.0,
            top: 10.0,
            width: 1180.0,
            height: 0.0,
        };
        assert!(draw(&mut drawing, &[chart], area, 18.0) > 100.0);
        let texts = drawing.marks.iter().filter_map(|(_, mark)| match mark {
            crate::picture::drawing::Mark::Words(words) => Some(words),
            _ => None,
        });
        let place = |words: &Words| {
            (
                words.text.clone(),
                words.at[0],
                words.at[0] + font::width(&words.text, SIZE_PX, words.bold),
            )
        };
        texts.map(place).collect()
    }

    #[test]
    fn a_chart_names_quantity_limit_unit_and_moment() {
        let texts: Vec<String> = words(chart(10, vec![0.5; 21]))
            .into_iter()
            .map(|(text, ..)| text)
            .collect();
        assert_eq!(
            texts,
            [
                "1. KeptUpright: tilt(cup) < 0.5 rad",
                "1 rad",
                "0 rad",
                "1 s",
                "0 s",
                "2 s"
            ]
        );
    }

    #[test]
    fn the_times_below_a_chart_never_overlap() {
        for at in 0..=20 {
            let mut times: Vec<_> = words(chart(at, vec![]))
                .into_iter()
                .filter(|(text, ..)| text.ends_with(" s"))
                .collect();
            times.sort_by(|a, b| a.1.total_cmp(&b.1));
            assert!(
                times.windows(2).all(|pair| pair[0].2 < pair[1].1),
                "{times:?}"
            );
        }
    }
}
