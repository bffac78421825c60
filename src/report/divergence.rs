//! The moment at which two runs of the same scene begin to differ.

use std::collections::BTreeMap;

use actcheck_data::Trace;

/// Bodies that are farther apart than this are at different places. Unit: metres.
const APART_M: f64 = 0.001;
/// The grippers are compared so long after the runs began to differ. Unit: seconds.
const LATER_SECS: f64 = 1.0;

/// The moment at which two runs begin to differ.
#[derive(Debug, Clone, PartialEq)]
pub struct Divergence {
    /// Time since the runs began. Unit: seconds.
    pub secs: f64,
    /// Action and phase in each run at that time; `None` after its last action.
    pub phases: [Option<String>; 2],
    /// The body that is farthest from its place in the other run then: id of an object, or
    /// `robot/LINK`. `None` if one run only goes on for longer.
    pub body: Option<String>,
    /// Position of the second run's gripper relative to the first one's, so long after that time.
    /// Units: seconds; metres, in the world's frame.
    pub gripper: Option<(f64, [f64; 3])>,
}

/// Returns the moment at which two runs begin to differ; `None` if all bodies move alike.
pub fn divergence(first: &Trace, second: &Trace) -> Option<Divergence> {
    let (rows, others) = (&first.frames.rows, &second.frames.rows);
    let slots: BTreeMap<&str, usize> = second
        .frames
        .names
        .iter()
        .map(String::as_str)
        .zip(0..)
        .collect();
    let names = first.frames.names.iter().enumerate();
    let common: Vec<(&str, usize, usize)> = names
        .filter_map(|(slot, name)| Some((name.as_str(), slot, *slots.get(name.as_str())?)))
        .collect();
    let farthest = |row: &[f32], other: &[f32]| {
        let apart = common.iter().map(|(name, slot, other_slot)| {
            let [at, there] =
                [(row, slot), (other, other_slot)].map(|(row, slot)| place(row, *slot));
            (*name, distance(at, there))
        });
        apart.max_by(|a, b| a.1.total_cmp(&b.1))
    };
    let differing = rows
        .iter()
        .zip(others)
        .enumerate()
        .find_map(|(idx, (row, other))| {
            let (name, apart) = farthest(row, other)?;
            (apart > APART_M).then(|| (idx, Some(name.to_owned())))
        });
    let shorter = rows.len().min(others.len());
    let (idx, body) =
        differing.or_else(|| (rows.len() != others.len()).then_some((shorter, None)))?;
    let secs = idx as f64 * first.frames.period_secs;
    let later = secs + LATER_SECS;
    let grippers = gripper(first, later).zip(gripper(second, later));
    Some(Divergence {
        secs,
        phases: [phase(first, secs), phase(second, secs)],
        body,
        gripper: grippers.map(|(a, b)| (later, [0, 1, 2].map(|axis| b[axis] - a[axis]))),
    })
}

fn place(row: &[f32], slot: usize) -> [f64; 3] {
    [0, 1, 2].map(|axis| row.get(7 * slot + axis).copied().map_or(0.0, f64::from))
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
    libm::sqrt(squares.sum::<f64>())
}

/// When each action began. Unit: seconds since the run began.
fn starts(trace: &Trace) -> impl Iterator<Item = f64> + '_ {
    let begin = trace.snapshots.first().map_or(0.0, |state| state.time_secs);
    trace
        .snapshots
        .iter()
        .map(move |state| state.time_secs - begin)
}

/// The action and its phase at a time.
fn phase(trace: &Trace, secs: f64) -> Option<String> {
    let mut actions = trace.actions.iter().zip(starts(trace));
    let (action, start) =
        actions.find(|(action, start)| secs >= *start && secs < start + action.duration_secs)?;
    let begun = action
        .phases
        .iter()
        .rfind(|phase| start + phase.start_secs <= secs);
    Some(match begun {
        Some(phase) => format!("{} {}", action.action, phase.name),
        None => action.action.clone(),
    })
}

/// The position of the gripper at a time; its last one after the end. Unit: metres. Frame: world.
fn gripper(trace: &Trace, secs: f64) -> Option<[f64; 3]> {
    let courses = trace.robot_courses.iter().zip(starts(trace));
    let (course, start) = courses
        .filter(|(course, start)| course.samples.count > 0 && *start <= secs)
        .last()?;
    let samples = &course.samples;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a number of samples"
    )]
    let idx =
        (((secs - start) / samples.period_secs).round().max(0.0) as usize).min(samples.count - 1);
    let along = |quantity: &str| {
        let series = samples.series.iter();
        let mut of_it = series.filter(|one| one.thing == "gripper" && one.quantity == quantity);
        of_it.next()?.values().nth(idx)
    };
    Some([along("x")?, along("y")?, along("z")?])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made_up::snapshot;
    use actcheck_data::{ActionEnd, ActionTrace, Frames, Phase, RobotCourse, Samples, Series};

    /// A run of 4 s in which the hand rises from the given time on, at 0.1 m/s.
    fn run(rises_at: Option<f64>, n_frames: usize) -> Trace {
        let height = |secs: f64| rises_at.map_or(0.0, |from| 0.1 * (secs - from).max(0.0));
        let row = |idx: usize| {
            vec![
                0.0,
                0.0,
                height(0.1 * idx as f64) as f32,
                0.0,
                0.0,
                0.0,
                1.0,
            ]
        };
        let mut z = Series::recorded("gripper", "", "z");
        (0..240).for_each(|idx| z.push(height(f64::from(idx) / 60.0)));
        let flat = |quantity| {
            let mut series = Series::recorded("gripper", "", quantity);
            (0..240).for_each(|_| series.push(0.0));
            series
        };
        let phases = [("approach", 0.0), ("release", 2.0)].map(|(name, start_secs)| Phase {
            name: name.to_owned(),
            start_secs,
        });
        Trace {
            snapshots: vec![snapshot(5.0), snapshot(9.0)],
            actions: vec![ActionTrace {
                end: ActionEnd::Completed,
                duration_secs: 4.0,
                phases: phases.into(),
                ..ActionTrace::not_reached("Place", &BTreeMap::new())
            }],
            frames: Frames {
                period_secs: 0.1,
                names: vec!["robot/hand".to_owned()],
                rows: (0..n_frames).map(row).collect(),
            },
            robot_courses: vec![RobotCourse {
                samples: Samples {
                    period_secs: 1.0 / 60.0,
                    count: 240,
                    series: vec![flat("x"), flat("y"), z],
                },
                ..RobotCourse::default()
            }],
            ..Trace::default()
        }
    }

    #[test]
    fn the_first_difference_has_its_phase_and_the_way_of_the_gripper() {
        let found = divergence(&run(None, 40), &run(Some(2.0), 40)).expect("they differ");
        assert!((found.secs - 2.1).abs() < 1e-9, "{found:?}");
        let phase = Some("Place release".to_owned());
        assert_eq!(found.phases, [phase.clone(), phase]);
        assert_eq!(found.body.as_deref(), Some("robot/hand"));
        let (secs, [x, y, z]) = found.gripper.expect("both have one");
        assert!((secs - 3.1).abs() < 1e-9 && x == 0.0 && y == 0.0);
        assert!((z - 0.11).abs() < 1e-3, "{z}");
    }

    #[test]
    fn runs_that_only_differ_in_length_differ_at_the_end_of_the_shorter_one() {
        assert_eq!(divergence(&run(None, 40), &run(None, 40)), None);
        let found = divergence(&run(None, 30), &run(None, 40)).expect("one is longer");
        assert!((found.secs - 3.0).abs() < 1e-9 && found.body.is_none());
    }
}
