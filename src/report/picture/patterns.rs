//! Draws patterns: scatter plots of runs over two scene parameters, with failures as crosses and
//! the range of the pattern marked.

use crate::FindingsSummary;
use crate::picture::drawing::{Drawing, Line, Paint, Rect, Style, Words};
use crate::picture::{font, paint};
use crate::summary::quantity_name;
use actcheck_analysis::{Condition, Parameter, Pattern, PatternInput};

/// Width of a picture. Unit: pixels.
const WIDTH_PX: f64 = 1200.0;
/// Margin, and distance between panels. Unit: pixels.
const GAP_PX: f64 = 18.0;
/// Height of a panel. Unit: pixels.
const PANEL_PX: f64 = 300.0;
/// Space for axis numbers, to the left of and below a panel. Unit: pixels.
const NUMBERS_PX: [f64; 2] = [46.0, 34.0];
/// Font size. Unit: pixels.
const SIZE_PX: f64 = 12.0;
/// Line height. Unit: pixels.
const LINE_PX: f64 = 16.0;
/// Half the size of a run's symbol. Unit: pixels.
const RUN_PX: f64 = 2.6;
/// Maximum number of passed runs drawn in a panel, to limit overplotting. If there are more, every
/// n-th is drawn.
const MOST_PASSED: usize = 3000;
/// Margin around all runs, relative to the range.
const ROOM: f64 = 0.04;
/// Parameters that complete the axes of a pattern with fewer than two ranges.
const USUAL: [&str; 6] = [
    "surface_x_m",
    "surface_y_m",
    "robot_distance_m",
    "target_turned_rad",
    "target_friction",
    "target_mass_kg",
];
const PASSED: u32 = 0x1a_8a6a;

/// Draws all confirmed patterns, in the order of `actcheck analyse`. Returns `None` if no pattern
/// can be drawn.
pub fn patterns_picture(findings: &FindingsSummary) -> Option<Drawing> {
    let mut drawing = Drawing::new(WIDTH_PX);
    let width = (WIDTH_PX - 3.0 * GAP_PX) / 2.0;
    let (mut top, mut lowest, mut drawn) = (GAP_PX, GAP_PX, 0);
    let confirmed = findings.properties.iter().flat_map(|report| {
        report
            .findings
            .patterns
            .confirmed()
            .map(move |pattern| (report, pattern))
    });
    for (report, pattern) in confirmed {
        let Some(plane) = Plane::of(&report.findings.input, pattern) else {
            continue;
        };
        let left = GAP_PX + (width + GAP_PX) * f64::from(drawn % 2);
        if drawn % 2 == 0 {
            top = lowest;
        }
        drawn += 1;
        let words = words(&mut drawing, &report.sentence(pattern), [left, top], width);
        let panel = Rect {
            left: left + NUMBERS_PX[0],
            top: words + 8.0,
            width: width - NUMBERS_PX[0],
            height: PANEL_PX - NUMBERS_PX[1],
        };
        plane.draw(&mut drawing, panel, &report.findings.input, pattern);
        lowest = lowest.max(panel.bottom() + NUMBERS_PX[1] + GAP_PX);
    }
    drawing.height = lowest;
    (drawn > 0).then_some(drawing)
}

/// Writes a sentence from its upper left corner and returns its lower end.
fn words(drawing: &mut Drawing, text: &str, [left, top]: [f64; 2], width: f64) -> f64 {
    font::wrapped(text, SIZE_PX, true, width)
        .into_iter()
        .fold(top, |y, text| {
            let paint = Paint::solid(paint::INK);
            drawing.words(Words {
                text,
                at: [left, y + LINE_PX - 3.0],
                size: SIZE_PX,
                bold: true,
                paint,
                rim: false,
            });
            y + LINE_PX
        })
}

/// One of the two parameters of a panel.
struct Axis<'a> {
    parameter: &'a Parameter,
    numbers: &'a [f64],
    /// Range that contains all runs, with a margin.
    range: [f64; 2],
    /// Bounds of the pattern's condition.
    asked: [Option<f64>; 2],
}

impl<'a> Axis<'a> {
    /// Returns `None` if the parameter has fewer than two distinct numbers.
    fn of(parameter: &'a Parameter, asked: [Option<f64>; 2]) -> Option<Self> {
        let numbers = parameter.values.numbers()?;
        let known = || numbers.iter().copied().filter(|number| number.is_finite());
        let (low, high) = (
            known().min_by(f64::total_cmp)?,
            known().max_by(f64::total_cmp)?,
        );
        let room = (high - low) * ROOM;
        (low < high).then_some(Self {
            parameter,
            numbers,
            range: [low - room, high + room],
            asked,
        })
    }

    /// Position in the panel, from 0 to 1.
    fn share(&self, value: f64) -> f64 {
        (value - self.range[0]) / (self.range[1] - self.range[0])
    }

    /// The bands in which the condition holds: two for an arc through ±π, whose lower bound is
    /// above its upper bound.
    fn bands(&self) -> Vec<[f64; 2]> {
        let [first, last] = self.range;
        match self.asked {
            [Some(from), Some(to)] if from > to => vec![[first, to], [from, last]],
            [low, high] => vec![[low.unwrap_or(first), high.unwrap_or(last)]],
        }
    }

    fn name(&self) -> String {
        let unit = self.parameter.unit.as_deref();
        let name = quantity_name(&self.parameter.name, unit);
        match unit {
            Some(unit) if unit != "1" => format!("{name} ({unit})"),
            _ => name,
        }
    }

    /// About five round numbers.
    fn ticks(&self) -> Vec<f64> {
        let rough = (self.range[1] - self.range[0]) / 5.0;
        let power = libm::exp10(libm::floor(libm::log10(rough)));
        let step = [1.0, 2.0, 5.0, 10.0]
            .map(|times| times * power)
            .into_iter()
            .find(|step| *step >= rough);
        let step = step.unwrap_or(rough);
        let first = libm::ceil(self.range[0] / step);
        (0..10)
            .map(|at| (first + f64::from(at)) * step)
            .filter(|value| *value <= self.range[1])
            .collect()
    }
}

/// The axes of a panel: across and up.
struct Plane<'a> {
    axes: [Axis<'a>; 2],
}

impl<'a> Plane<'a> {
    /// Chooses the axes: the ranges of a pattern first, then the usual parameters. Returns `None`
    /// if there are fewer than two.
    fn of(input: &'a PatternInput, pattern: &Pattern) -> Option<Self> {
        let ranges = pattern
            .conditions
            .iter()
            .filter_map(|condition| match condition {
                Condition::Range {
                    parameter,
                    low,
                    high,
                } => Axis::of(input.parameters.get(*parameter)?, [*low, *high]),
                Condition::Arc {
                    parameter,
                    from,
                    to,
                } => Axis::of(input.parameters.get(*parameter)?, [Some(*from), Some(*to)]),
                Condition::Kind { .. } => None,
            });
        let mut axes: Vec<Axis<'a>> = ranges.take(2).collect();
        for name in USUAL {
            let known = axes.iter().any(|axis| axis.parameter.name == name);
            let parameter = input
                .parameters
                .iter()
                .find(|parameter| parameter.name == name && !known);
            axes.extend(parameter.and_then(|parameter| Axis::of(parameter, [None, None])));
        }
        axes.truncate(2);
        Some(Self {
            axes: <[Axis<'a>; 2]>::try_from(axes).ok()?,
        })
    }

    fn pixel(&self, panel: Rect, [x, y]: [f64; 2]) -> [f64; 2] {
        let [across, up] = &self.axes;
        [
            panel.left + across.share(x) * panel.width,
            panel.bottom() - up.share(y) * panel.height,
        ]
    }

    fn draw(&self, drawing: &mut Drawing, panel: Rect, input: &PatternInput, pattern: &Pattern) {
        drawing.polygon(panel.corners(), paint::BACKGROUND);
        self.numbers(drawing, panel);
        drawing.clip(Some(panel));
        self.asked(drawing, panel);
        // If the pattern has conditions on kinds, only draw runs of these kinds.
        let kinds = pattern
            .conditions
            .iter()
            .filter(|condition| matches!(condition, Condition::Kind { .. }));
        let kinds: Vec<Vec<bool>> = kinds.map(|condition| condition.holds(input)).collect();
        let shown = |run: &usize| kinds.iter().all(|holds| holds[*run]);
        let place = |run: usize| {
            let at = [self.axes[0].numbers[run], self.axes[1].numbers[run]];
            at.iter()
                .all(|value| value.is_finite())
                .then(|| self.pixel(panel, at))
        };
        let of = |failed: bool| -> Vec<[f64; 2]> {
            (0..input.len())
                .filter(shown)
                .filter(|run| input.failed[*run] == failed)
                .filter_map(place)
                .collect()
        };
        let passed = of(false);
        let every = passed.len().div_ceil(MOST_PASSED).max(1);
        let dots = passed
            .iter()
            .step_by(every)
            .map(|at| corners(*at, [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]]));
        drawing.shape(dots.collect(), true, Style::fill(Paint::new(PASSED, 0.55)));
        let crosses = of(true).into_iter().flat_map(|at| {
            [
                corners(at, [[-1.0, -1.0], [1.0, 1.0]]),
                corners(at, [[1.0, -1.0], [-1.0, 1.0]]),
            ]
        });
        drawing.shape(
            crosses.collect(),
            false,
            Style::line(Line::new(Paint::new(paint::FAILED, 0.85), 1.5)),
        );
        drawing.clip(None);
    }

    /// Draws the range of the pattern.
    fn asked(&self, drawing: &mut Drawing, panel: Rect) {
        if self.axes.iter().all(|axis| axis.asked == [None, None]) {
            return;
        }
        let [across, up] = &self.axes;
        let line = Line::dashed(Paint::solid(paint::FAILED), 1.2, [5.0, 4.0]);
        let style = Style::both(Paint::new(paint::FAILED, 0.09), line);
        for [left, right] in across.bands() {
            for [low, high] in up.bands() {
                let corners = [[left, low], [right, low], [right, high], [left, high]];
                drawing.polygon(
                    corners.map(|corner| self.pixel(panel, corner)).to_vec(),
                    style,
                );
            }
        }
    }

    /// Draws the grid lines, their numbers and the axis names.
    fn numbers(&self, drawing: &mut Drawing, panel: Rect) {
        let grid = Line::new(Paint::new(paint::GREY, 0.22), 0.8);
        let write = |drawing: &mut Drawing, text: String, at: [f64; 2]| {
            let paint = Paint::solid(paint::GREY);
            drawing.words(Words {
                text,
                at,
                size: SIZE_PX - 1.5,
                bold: false,
                paint,
                rim: false,
            });
        };
        let [across, up] = &self.axes;
        for value in across.ticks() {
            let [x, _] = self.pixel(panel, [value, up.range[0]]);
            drawing.line(vec![[x, panel.top], [x, panel.bottom()]], grid);
            let text = shown(value);
            let half = font::width(&text, SIZE_PX - 1.5, false) / 2.0;
            write(drawing, text, [x - half, panel.bottom() + 13.0]);
        }
        for value in up.ticks() {
            let [_, y] = self.pixel(panel, [across.range[0], value]);
            drawing.line(vec![[panel.left, y], [panel.right(), y]], grid);
            let text = shown(value);
            let width = font::width(&text, SIZE_PX - 1.5, false);
            write(drawing, text, [panel.left - width - 5.0, y + 4.0]);
        }
        let names = format!(
            "across: {}     up: {}     × failed   ◆ passed",
            across.name(),
            up.name()
        );
        write(drawing, names, [panel.left, panel.bottom() + 28.0]);
    }
}

/// Corners of a small symbol around a pixel.
fn corners<const N: usize>([x, y]: [f64; 2], figure: [[f64; 2]; N]) -> Vec<[f64; 2]> {
    figure
        .iter()
        .map(|[right, down]| [x + RUN_PX * right, y + RUN_PX * down])
        .collect()
}

/// Formats a round number without rounding errors.
fn shown(value: f64) -> String {
    let rounded = (value * 1e6).round() / 1e6;
    format!("{}", if rounded == 0.0 { 0.0 } else { rounded })
}
