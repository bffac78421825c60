//! The header of a picture: the run, its actions and its failures.

use std::collections::BTreeMap;

use crate::picture::charts::Chart;
use crate::picture::drawing::{Drawing, Paint, Rect, Style, Words};
use crate::picture::{font, paint};
use crate::pressed::Pressed;
use actcheck_base::{Outcome, names};
use actcheck_data::{Appearances, Role, SeenPart};
use actcheck_history::{ActionDetail, RunDetail};

/// Maximum number of failures listed; a picture is not a report.
const MOST_FAILURES: usize = 8;
/// Maximum number of lines of an entry.
const MOST_LINES: usize = 2;
/// Line height. Unit: pixels.
const LINE_PX: f64 = 17.0;
/// Space reserved for the ellipsis of truncated text. Unit: pixels.
const ELLIPSIS_PX: f64 = 20.0;
/// Font sizes. Unit: pixels.
const SIZE_PX: f64 = 12.0;
const TITLE_PX: f64 = 17.0;

/// Text above the panels.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Caption {
    /// Run, test, status and score.
    pub title: String,
    /// One line for each action.
    pub actions: Vec<String>,
    /// One line for each failed property, preceded by the reason if the run did not complete.
    pub failures: Vec<String>,
    /// Index of the action and witness of each failed property.
    pub witnesses: Vec<(usize, String)>,
    /// The signals that decided failed properties about time.
    pub charts: Vec<Chart>,
    /// Role of each object, by id.
    pub roles: BTreeMap<String, Role>,
    /// The appearance of bodies, by the id of the object or the name of the link in traces. All others
    /// are drawn by the shapes in the trace.
    pub seen: BTreeMap<String, Vec<SeenPart>>,
}

impl Caption {
    /// Adds the appearance of the bodies of the run's campaign.
    #[must_use]
    pub fn with_appearances(self, run: &RunDetail, appearances: &Appearances) -> Self {
        let objects = run.objects.iter().filter_map(|object| {
            let parts = appearances.models.get(&object.model)?;
            Some((object.id.clone(), parts.clone()))
        });
        Self {
            seen: appearances
                .links
                .clone()
                .into_iter()
                .chain(objects)
                .collect(),
            ..self
        }
    }

    /// The caption of a stored run.
    pub fn of(run: &RunDetail) -> Self {
        let row = &run.row;
        let reason = run
            .reason
            .iter()
            .map(|reason| format!("{}: {reason}", row.status.word()));
        let failed = run.actions.iter().flat_map(|action| {
            let judged = action
                .judgements
                .iter()
                .filter(|judgement| judgement.outcome == Outcome::Failed);
            judged.map(|judgement| {
                let (action, property) = (
                    names::local(&action.action),
                    names::local(&judgement.property),
                );
                format!("{action}: {property}: {}", judgement.witness)
            })
        });
        let witnesses = run.actions.iter().enumerate().flat_map(|(idx, action)| {
            let judged = action
                .judgements
                .iter()
                .filter(|judgement| judgement.outcome == Outcome::Failed);
            judged.map(move |judgement| (idx, judgement.witness.clone()))
        });
        Self {
            title: format!(
                "{} · {} · {} · S = {:.2}",
                row.run,
                row.test,
                row.status.word(),
                row.score
            ),
            actions: run.actions.iter().map(what_was_done).collect(),
            failures: reason.chain(failed).collect(),
            witnesses: witnesses.collect(),
            charts: Vec::new(),
            seen: BTreeMap::new(),
            roles: run
                .objects
                .iter()
                .map(|object| (object.id.clone(), object.role))
                .collect(),
        }
    }
}

fn what_was_done(action: &ActionDetail) -> String {
    let report = match (action.reported, action.message.as_deref()) {
        (Some(true), _) => "reported success".to_owned(),
        (Some(false), Some(message)) => format!("reported failure: {message}"),
        (Some(false), None) => "reported failure".to_owned(),
        (None, Some(reason)) if action.end == Outcome::Inapplicable.word() => {
            format!("not performed: {reason}")
        }
        (None, _) => action.end.clone(),
    };
    let name = names::local(&action.action);
    format!(
        "{}. {name}: A = {:.2}, {:.1} s, {report}",
        action.step, action.score, action.duration_secs
    )
}

/// Draws the header into an area, from its upper end on, with the hardest contact if it is shown.
/// Returns its lower end.
pub(super) fn draw(
    drawing: &mut Drawing,
    caption: &Caption,
    pressed: Option<&Pressed>,
    area: Rect,
) -> f64 {
    let mut writer = Writer {
        drawing,
        left: area.left,
        width: area.width,
        y: area.top,
    };
    writer.title(&caption.title);
    for (idx, action) in caption.actions.iter().enumerate() {
        writer.swatch(paint::action(idx));
        writer.lines(action, 18.0, paint::INK);
    }
    for text in caption.failures.iter().take(MOST_FAILURES) {
        writer.lines(&format!("✗ {text}"), 18.0, paint::FAILED);
    }
    if caption.failures.len() > MOST_FAILURES {
        writer.lines(
            &format!("✗ and {} more", caption.failures.len() - MOST_FAILURES),
            18.0,
            paint::FAILED,
        );
    }
    if caption.failures.is_empty() && !caption.actions.is_empty() {
        writer.lines("nothing failed", 18.0, paint::GREY);
    }
    if let Some(pressed) = pressed {
        writer.lines(
            &format!("hardest contact: {}", pressed.sentence()),
            18.0,
            paint::FAILED,
        );
    }
    writer.y
}

struct Writer<'a> {
    drawing: &'a mut Drawing,
    left: f64,
    width: f64,
    y: f64,
}

impl Writer<'_> {
    fn title(&mut self, text: &str) {
        for text in font::wrapped(text, TITLE_PX, true, self.width) {
            self.y += TITLE_PX + 1.0;
            let at = [self.left, self.y];
            let paint = Paint::solid(paint::INK);
            self.drawing.words(Words {
                text,
                at,
                size: TITLE_PX,
                bold: true,
                paint,
                rim: false,
            });
        }
        self.y += 6.0;
    }

    fn lines(&mut self, text: &str, indent: f64, rgb: u32) {
        let mut lines = font::wrapped(text, SIZE_PX, false, self.width - indent - ELLIPSIS_PX);
        if lines.len() > MOST_LINES {
            lines.truncate(MOST_LINES);
            lines[MOST_LINES - 1].push_str(" …");
        }
        for line in lines {
            self.y += LINE_PX;
            let at = [self.left + indent, self.y];
            let paint = Paint::solid(rgb);
            self.drawing.words(Words {
                text: line,
                at,
                size: SIZE_PX,
                bold: false,
                paint,
                rim: false,
            });
        }
    }

    /// Draws a square in the colour of an action's paths, before the next line.
    fn swatch(&mut self, rgb: u32) {
        let square = Rect {
            left: self.left + 1.0,
            top: self.y + LINE_PX - 9.5,
            width: 10.0,
            height: 10.0,
        };
        self.drawing
            .polygon(square.corners(), Style::fill(Paint::solid(rgb)));
    }
}
