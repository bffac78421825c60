//! The file of a run: its choices and its trace, so that the run can be judged again, drawn and
//! replayed.
//!
//! It has two compressed parts: first the data from which facts are extracted, then the motion of
//! all bodies, which only pictures and replay need.

use std::io::Write;
use std::sync::Arc;

use flate2::Compression;
use flate2::write::GzEncoder;

use crate::frames;
use crate::inflate::{expanded, most_expanded};
use actcheck_base::Steps;
use actcheck_data::{
    ActionTrace, Choice, Form, Frames, RobotCourse, Samples, SceneMap, Series, Snapshot, Trace,
};

/// First bytes of each file of any format.
const TITLE: &[u8] = b"actrace";
/// Format of the file, which follows the title. It changes whenever a type of the trace changes.
const FORMAT: u8 = b'5';

/// Maximum number of samples of an action: limits the memory that a corrupt file can request, whose
/// constant series take a byte. A long action has some million.
const MOST_SAMPLES: usize = 1 << 26;

/// First part: choices, states, actions, time between frames, names of tracks, hash, map, forms of
/// bodies, and the courses of the robot.
type Head = (
    Vec<Choice>,
    Vec<Snapshot>,
    Vec<ActionTrace>,
    f64,
    Vec<String>,
    String,
    SceneMap,
    Vec<Form>,
    Vec<RobotCourse>,
);

/// Encodes a run's file.
///
/// # Errors
/// A message, if a part can't be encoded. (The current types never cause this.)
pub(super) fn encode(choices: &[Choice], trace: &Trace) -> Result<Vec<u8>, String> {
    let head = compressed(&encode_head(choices, trace)?)?;
    let course =
        compressed(&[frames::encode(&trace.frames.rows), encode_motions(trace)?].concat())?;
    let length =
        u32::try_from(head.len()).map_err(|_| "its trace is larger than 4 GB".to_owned())?;
    Ok([TITLE, &[FORMAT], &length.to_le_bytes(), &head, &course].concat())
}

/// Encodes the choices and the data from which facts are extracted.
///
/// # Errors
/// As [`encode`].
pub(super) fn encode_head(choices: &[Choice], trace: &Trace) -> Result<Vec<u8>, String> {
    let frames = &trace.frames;
    let head = (
        choices,
        &trace.snapshots,
        &trace.actions,
        frames.period_secs,
        &frames.names,
        &trace.hash,
        &trace.map,
        &trace.forms,
        &trace.robot_courses,
    );
    postcard::to_stdvec(&head).map_err(|error| error.to_string())
}

/// Decodes the choices and the whole trace.
///
/// # Errors
/// A message that names the damaged part.
pub(super) fn decode(bytes: &[u8]) -> Result<(Vec<Choice>, Trace), String> {
    let (head, course) = parts(bytes)?;
    let (choices, mut trace) = decode_head(&expanded(head)?)?;
    let course = Arc::new(expanded(course)?);
    let (rows, rest) =
        frames::decode_next(&course).ok_or("the motion of the bodies can't be read")?;
    trace.frames.rows = rows;
    read_motions(
        &course,
        course.len() - rest.len(),
        &mut trace,
        decode_motion,
    )
    .ok_or("the motion of the robot can't be read")?;
    Ok((choices, trace))
}

/// Encodes the robot's measurements and commands, which follow the motion of the bodies: joints and
/// rows for each action, then the samples of each.
fn encode_motions(trace: &Trace) -> Result<Vec<u8>, String> {
    let mut out = Vec::new();
    for course in &trace.robot_courses {
        out.extend(postcard::to_stdvec(&course.motion.joints).map_err(|error| error.to_string())?);
        out.extend(frames::encode(&course.motion.rows));
    }
    for course in &trace.robot_courses {
        encode_samples(&course.samples, &mut out)?;
    }
    Ok(out)
}

/// The stored description of a series, before its steps: thing, second thing, quantity, steps per
/// unit.
type SeriesHead = (String, String, String, u32);

fn encode_samples(samples: &Samples, out: &mut Vec<u8>) -> Result<(), String> {
    let heads: Vec<SeriesHead> = samples
        .series
        .iter()
        .map(|series| {
            (
                series.thing.clone(),
                series.other.clone(),
                series.quantity.clone(),
                series.steps_per_unit,
            )
        })
        .collect();
    let head = (samples.period_secs, samples.count as u64, heads);
    out.extend(postcard::to_stdvec(&head).map_err(|error| error.to_string())?);
    samples
        .series
        .iter()
        .for_each(|series| series.steps.encode(out));
    Ok(())
}

/// Decodes the samples of one action at a position of the expanded bytes, and returns the position
/// after them.
fn decode_samples(bytes: &Arc<Vec<u8>>, at: usize) -> Option<(Samples, usize)> {
    let ((period_secs, count, heads), rest): ((f64, u64, Vec<SeriesHead>), &[u8]) =
        postcard::take_from_bytes(bytes.get(at..)?).ok()?;
    let count = usize::try_from(count).ok()?;
    if count.checked_mul(heads.len())? > MOST_SAMPLES {
        return None;
    }
    let mut at = bytes.len() - rest.len();
    let mut series = Vec::with_capacity(heads.len());
    for (thing, other, quantity, steps_per_unit) in heads {
        let steps;
        (steps, at) = Steps::encoded(count, bytes, at)?;
        series.push(Series {
            thing,
            other,
            quantity,
            steps_per_unit,
            steps,
        });
    }
    Some((
        Samples {
            period_secs,
            count,
            series,
        },
        at,
    ))
}

/// Decodes the robot's measurements and commands of one action, and returns the remaining bytes.
fn decode_motion<'b>(course: &mut RobotCourse, bytes: &'b [u8]) -> Option<&'b [u8]> {
    let (joints, rest) = postcard::take_from_bytes(bytes).ok()?;
    let (rows, rest) = frames::decode_next(rest)?;
    (course.motion.joints, course.motion.rows) = (joints, rows);
    Some(rest)
}

/// Skips the bytes that [`decode_motion`] decodes.
fn skip_motion<'b>(_: &mut RobotCourse, bytes: &'b [u8]) -> Option<&'b [u8]> {
    let (_, rest): (Vec<String>, &[u8]) = postcard::take_from_bytes(bytes).ok()?;
    frames::skip_next(rest)
}

/// Reads the robot's motion at a position of the expanded bytes by `motion`, which returns the
/// remaining bytes, and decodes the samples.
fn read_motions(
    bytes: &Arc<Vec<u8>>,
    at: usize,
    trace: &mut Trace,
    motion: impl for<'b> Fn(&mut RobotCourse, &'b [u8]) -> Option<&'b [u8]>,
) -> Option<()> {
    let mut rest = bytes.get(at..)?;
    for course in &mut trace.robot_courses {
        rest = motion(course, rest)?;
    }
    let mut at = bytes.len() - rest.len();
    for course in &mut trace.robot_courses {
        (course.samples, at) = decode_samples(bytes, at)?;
    }
    Some(())
}

/// Decodes the choices and the trace with the samples of its actions, but without the motion of
/// bodies and joints: everything from which facts and quantities over time are extracted.
///
/// # Errors
/// A message that names the damaged part.
pub(super) fn decode_sampled(bytes: &[u8]) -> Result<(Vec<Choice>, Trace), String> {
    let (head, course) = parts(bytes)?;
    let (choices, mut trace) = decode_head(&expanded(head)?)?;
    let course = Arc::new(expanded(course)?);
    let rest = frames::skip_next(&course).ok_or("the motion of the bodies can't be read")?;
    read_motions(&course, course.len() - rest.len(), &mut trace, skip_motion)
        .ok_or("the motion of the robot can't be read")?;
    Ok((choices, trace))
}

/// Decodes the choices and the trace without the rows of its frames: everything from which facts
/// are extracted.
///
/// # Errors
/// A message that names the damaged part.
pub(super) fn decode_states(bytes: &[u8]) -> Result<(Vec<Choice>, Trace), String> {
    decode_head(&expanded(parts(bytes)?.0)?)
}

/// Decodes the choices alone: they come first.
///
/// # Errors
/// A message that names the damaged part.
pub(super) fn decode_choices(bytes: &[u8]) -> Result<Vec<Choice>, String> {
    head_choices(&expanded(parts(bytes)?.0)?)
}

/// Decodes the choices of a result of [`encode_head`].
///
/// # Errors
/// As [`decode_choices`].
pub(super) fn head_choices(head: &[u8]) -> Result<Vec<Choice>, String> {
    let (choices, _) =
        postcard::take_from_bytes(head).map_err(|error| error.to_string().to_lowercase())?;
    Ok(choices)
}

/// Decodes a result of [`encode_head`].
///
/// # Errors
/// A message that names the damaged part.
pub(super) fn decode_head(head: &[u8]) -> Result<(Vec<Choice>, Trace), String> {
    let head: Head =
        postcard::from_bytes(head).map_err(|error| error.to_string().to_lowercase())?;
    let (choices, snapshots, actions, period_secs, names, hash, map, forms, robot_courses) = head;
    let frames = Frames {
        period_secs,
        names,
        rows: Vec::new(),
    };
    let trace = Trace {
        snapshots,
        actions,
        frames,
        hash,
        map,
        forms,
        robot_courses,
    };
    Ok((choices, trace))
}

fn parts(bytes: &[u8]) -> Result<(&[u8], &[u8]), String> {
    let rest = bytes.strip_prefix(TITLE).ok_or("it is not a trace")?;
    let (format, rest) = rest.split_first().ok_or("it ends too early")?;
    if *format != FORMAT {
        return Err(format!(
            "its format is {}, this program reads format {}",
            char::from(*format).escape_default(),
            char::from(FORMAT)
        ));
    }
    let (length, rest) = rest.split_first_chunk::<4>().ok_or("it ends too early")?;
    rest.split_at_checked(u32::from_le_bytes(*length) as usize)
        .ok_or_else(|| "it ends too early".to_owned())
}

/// The bytes after the trace: the copy of its outcomes.
///
/// # Errors
/// A message that names the damaged part.
pub(super) fn after_trace(bytes: &[u8]) -> Result<&[u8], String> {
    let course = parts(bytes)?.1;
    let (mut decoder, most) = (
        flate2::bufread::GzDecoder::new(course),
        most_expanded(course.len()),
    );
    let length = std::io::copy(
        &mut std::io::Read::take(&mut decoder, most),
        &mut std::io::sink(),
    );
    match length.map_err(|error| error.to_string())? {
        length if length == most => {
            Err("its motion expands to far more than this program writes".to_owned())
        }
        _ => Ok(decoder.into_inner()),
    }
}

pub(super) fn compressed(bytes: &[u8]) -> Result<Vec<u8>, String> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
    encoder
        .write_all(bytes)
        .and_then(|()| encoder.finish())
        .map_err(|error| error.to_string())
}
