//! Rows of the camera's colour images, which the caller draws.

use crate::dataset::columns::IMAGES;
use crate::dataset::sheets::Sheets;
use crate::tables::Cell;
use actcheck_base::Diagnostics;
use actcheck_data::{Pose, Trace};
use actcheck_history::RunDetail;

/// Time between two images of the table. Unit: seconds.
const IMAGE_SECS: f64 = 1.0;

/// An image of the simulated camera.
#[derive(Debug, Clone)]
pub struct DatasetImage {
    /// Unit: pixels.
    pub width: usize,
    /// Unit: pixels.
    pub height: usize,
    /// The camera's true pose. Frame: world.
    pub camera: Pose,
    /// Red, green and blue of each pixel, row by row.
    pub rgb: Vec<u8>,
    /// The same as a PNG file.
    pub png: Vec<u8>,
}

/// Draws some frames of a run's trace, by their indices, in this order. Returns nothing if the
/// campaign can't be drawn any more.
pub type DrawImages<'a> =
    dyn FnMut(&RunDetail, &Trace, &[usize]) -> Result<Vec<DatasetImage>, Diagnostics> + 'a;

/// A moment of a run: a row of its robot's motion and the frame of the same time.
pub(super) struct Moment {
    /// Position of the action in the test, from 0.
    pub(super) action: usize,
    /// Row of the action's motion.
    pub(super) row: usize,
    /// Frame of the trace.
    pub(super) frame: usize,
}

/// The moments of a trace in order. The first of an action is the last of the previous one.
pub(super) fn moments(trace: &Trace) -> Vec<Moment> {
    let mut frame = 0;
    let mut all = Vec::new();
    for (action, course) in trace.robot_courses.iter().enumerate() {
        for row in 0..course.motion.rows.len() {
            frame += usize::from(row > 0);
            all.push(Moment { action, row, frame });
        }
    }
    all
}

/// Adds an image for each second of each action.
pub(super) fn add(
    run: &RunDetail,
    trace: &Trace,
    draw: &mut DrawImages<'_>,
    sheets: &mut Sheets,
) -> Result<(), Diagnostics> {
    let period = trace.frames.period_secs.max(1e-3);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a thousand at most"
    )]
    let every = (IMAGE_SECS / period).round().max(1.0) as usize;
    let taken: Vec<Moment> = moments(trace)
        .into_iter()
        .filter(|moment| moment.row.is_multiple_of(every))
        .collect();
    let frames: Vec<usize> = taken.iter().map(|moment| moment.frame).collect();
    for (moment, image) in taken.iter().zip(draw(run, trace, &frames)?) {
        let time = trace.robot_courses.get(moment.action).and_then(|course| {
            let row = course.motion.rows.get(moment.row)?;
            row.first().map(|secs| f64::from(*secs))
        });
        let pose = image.camera.position.into_iter();
        let row = [
            Cell::text(&run.row.run),
            Cell::count(moment.action + 1),
            Cell::Number(time),
            Cell::count(image.width),
            Cell::count(image.height),
        ];
        let pose = pose.chain(image.camera.rotation).map(Cell::number);
        sheets.push(
            &IMAGES,
            row.into_iter()
                .chain(pose)
                .chain([Cell::Bytes(Some(image.png))]),
        );
    }
    Ok(())
}
