//! Encodes the choices and the trace of a run, so that it can be judged again, drawn and replayed.
//!
//! Two parts are stored in different columns: the choices with the data from which facts are
//! extracted, and the motion of all bodies with the samples of quantities over time.

use std::sync::Arc;

use crate::frames;
use actcheck_base::Steps;
use actcheck_data::{
    ActionTrace, Choice, Form, Frames, RobotCourse, Samples, SceneMap, Series, SkillLog, Snapshot,
    Trace,
};

/// The reason why a part of a run can't be encoded or decoded.
#[derive(Debug, thiserror::Error)]
pub(super) enum CodecFault {
    /// Choices and states.
    #[error("its states can't be read: {0}")]
    States(postcard::Error),
    /// The motion of the bodies.
    #[error("the motion of the bodies can't be read")]
    Bodies,
    /// The motion of the robot, or its samples.
    #[error("the motion of the robot can't be read")]
    Robot,
    /// A value can't be encoded. (The current types never cause this.)
    #[error("it can't be encoded: {0}")]
    Encoding(postcard::Error),
}

/// Maximum number of samples of an action: limits the memory that a corrupt file can request, whose
/// constant series take a byte. A long action has some million.
const MOST_SAMPLES: usize = 1 << 26;

/// First part: choices, states, actions, time between frames, names of tracks, hash, map, forms of
/// bodies, the courses of the robot, the missing facts, and the user's program.
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
    Vec<String>,
    SkillLog,
);

/// Encodes the choices and the data from which facts are extracted.
///
/// # Errors
/// They can't be encoded.
pub(super) fn encode_head(choices: &[Choice], trace: &Trace) -> Result<Vec<u8>, CodecFault> {
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
        &trace.lacks,
        &trace.skill,
    );
    postcard::to_stdvec(&head).map_err(CodecFault::Encoding)
}

/// Encodes the motion of all bodies and the courses of the robot.
///
/// # Errors
/// They can't be encoded.
pub(super) fn encode_motion(trace: &Trace) -> Result<Vec<u8>, CodecFault> {
    Ok([frames::encode(&trace.frames.rows), encode_motions(trace)?].concat())
}

/// Adds the motion that [`encode_motion`] encoded to the trace of the same run.
///
/// # Errors
/// It is damaged.
pub(super) fn decode_motion(motion: Vec<u8>, trace: &mut Trace) -> Result<(), CodecFault> {
    let motion = Arc::new(motion);
    let (rows, rest) = frames::decode_next(&motion).ok_or(CodecFault::Bodies)?;
    trace.frames.rows = rows;
    let at = motion.len() - rest.len();
    read_motions(&motion, at, trace, decode_robot).ok_or(CodecFault::Robot)
}

/// As [`decode_motion`], but only the samples of the actions: everything from which quantities over
/// time are extracted.
///
/// # Errors
/// It is damaged.
pub(super) fn decode_samples_of(motion: Vec<u8>, trace: &mut Trace) -> Result<(), CodecFault> {
    let motion = Arc::new(motion);
    let rest = frames::skip_next(&motion).ok_or(CodecFault::Bodies)?;
    let at = motion.len() - rest.len();
    read_motions(&motion, at, trace, skip_robot).ok_or(CodecFault::Robot)
}

/// Encodes the robot's measurements and commands, which follow the motion of the bodies: joints and
/// rows for each action, then the samples of each.
fn encode_motions(trace: &Trace) -> Result<Vec<u8>, CodecFault> {
    let mut out = Vec::new();
    for course in &trace.robot_courses {
        out.extend(postcard::to_stdvec(&course.motion.joints).map_err(CodecFault::Encoding)?);
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

fn encode_samples(samples: &Samples, out: &mut Vec<u8>) -> Result<(), CodecFault> {
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
    out.extend(postcard::to_stdvec(&head).map_err(CodecFault::Encoding)?);
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
fn decode_robot<'b>(course: &mut RobotCourse, bytes: &'b [u8]) -> Option<&'b [u8]> {
    let (joints, rest) = postcard::take_from_bytes(bytes).ok()?;
    let (rows, rest) = frames::decode_next(rest)?;
    (course.motion.joints, course.motion.rows) = (joints, rows);
    Some(rest)
}

/// Skips the bytes that [`decode_robot`] decodes.
fn skip_robot<'b>(_: &mut RobotCourse, bytes: &'b [u8]) -> Option<&'b [u8]> {
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

/// Decodes the choices of a result of [`encode_head`].
///
/// # Errors
/// They are damaged.
pub(super) fn head_choices(head: &[u8]) -> Result<Vec<Choice>, CodecFault> {
    let (choices, _) = postcard::take_from_bytes(head).map_err(CodecFault::States)?;
    Ok(choices)
}

/// Decodes a result of [`encode_head`].
///
/// # Errors
/// It is damaged.
pub(super) fn decode_head(head: &[u8]) -> Result<(Vec<Choice>, Trace), CodecFault> {
    let head: Head = postcard::from_bytes(head).map_err(CodecFault::States)?;
    let (
        choices,
        snapshots,
        actions,
        period_secs,
        names,
        hash,
        map,
        forms,
        robot_courses,
        lacks,
        skill,
    ) = head;
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
        lacks,
        skill,
    };
    Ok((choices, trace))
}
