//! The moment at which two runs of the same scene begin to differ.

use std::collections::BTreeMap;

use actcheck_data::Trace;

/// Bodies that are farther apart than this are at different places. Unit: metres.
const APART_M: f64 = 0.001;
/// A contact that ends closer than this to the end of its run was not released. Unit: seconds.
const RELEASED_SECS: f64 = 0.2;

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
    /// The robot's first touch of a target.
    pub touch: Option<SharedEvent>,
    /// The end of its last touch of a target, if it released that.
    pub release: Option<SharedEvent>,
}

/// An event that both runs have.
#[derive(Debug, Clone, PartialEq)]
pub struct SharedEvent {
    /// Its time in each run, since the run began. Unit: seconds.
    pub secs: [f64; 2],
    /// Position of the second run's gripper relative to the first one's, each at its time. Unit: metres.
    /// Frame: world.
    pub gripper_m: [f64; 3],
}

/// Returns the moment at which two runs begin to differ; `None` if all bodies move alike. `targets` are
/// the ids of the objects that the robot is to handle.
pub fn divergence(first: &Trace, second: &Trace, targets: &[&str]) -> Option<Divergence> {
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
    let both = |event: fn(&Trace, &[&str]) -> Option<f64>| {
        let secs = [event(first, targets)?, event(second, targets)?];
        let (a, b) = (gripper(first, secs[0])?, gripper(second, secs[1])?);
        let gripper_m = [0, 1, 2].map(|axis| b[axis] - a[axis]);
        Some(SharedEvent { secs, gripper_m })
    };
    Some(Divergence {
        secs,
        phases: [phase(first, secs), phase(second, secs)],
        body,
        touch: both(touched),
        release: both(released),
    })
}

/// The contacts of the robot with targets: start and end of each. Unit: seconds since the run began.
fn touches<'a>(trace: &'a Trace, targets: &'a [&str]) -> impl Iterator<Item = [f64; 2]> + 'a {
    trace
        .actions
        .iter()
        .zip(starts(trace))
        .flat_map(move |(action, start)| {
            let of_target = action.contacts.iter().filter(|contact| {
                let mut pair = contact.pair.iter().map(String::as_str);
                contact.pair.iter().any(|body| body.starts_with("robot/"))
                    && pair.any(|body| targets.contains(&body))
            });
            of_target.map(move |contact| [start + contact.start_secs, start + contact.end_secs])
        })
}

fn touched(trace: &Trace, targets: &[&str]) -> Option<f64> {
    touches(trace, targets)
        .map(|[start, _]| start)
        .reduce(f64::min)
}

fn released(trace: &Trace, targets: &[&str]) -> Option<f64> {
    let last = touches(trace, targets)
        .map(|[_, end]| end)
        .reduce(f64::max)?;
    let end = starts(trace).last()?;
    (last < end - RELEASED_SECS).then_some(last)
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
        Some(phase) if phase.name != action.action => format!("{} {}", action.action, phase.name),
        _ => action.action.clone(),
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
    use actcheck_data::{
        ActionEnd, ActionTrace, ContactEpisode, Frames, Phase, RobotCourse, Samples, Series,
    };

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
                contacts: vec![ContactEpisode {
                    pair: ["mug_1".to_owned(), "robot/finger".to_owned()],
                    start_secs: 1.0,
                    end_secs: 3.0,
                    max_force_n: 5.0,
                    point_m: [0.0; 3],
                }],
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
        let found =
            divergence(&run(None, 40), &run(Some(2.0), 40), &["mug_1"]).expect("they differ");
        assert!((found.secs - 2.1).abs() < 1e-9, "{found:?}");
        let phase = Some("Place release".to_owned());
        assert_eq!(found.phases, [phase.clone(), phase]);
        assert_eq!(found.body.as_deref(), Some("robot/hand"));
        let touch = found.touch.expect("both touch it");
        assert_eq!((touch.secs, touch.gripper_m), ([1.0; 2], [0.0; 3]));
        let release = found.release.expect("both release it");
        assert_eq!(release.secs, [3.0; 2]);
        assert!((release.gripper_m[2] - 0.1).abs() < 1e-3, "{release:?}");
        let none = divergence(&run(None, 40), &run(Some(2.0), 40), &[]).expect("they differ");
        assert_eq!((none.touch, none.release), (None, None));
    }

    #[test]
    fn runs_that_only_differ_in_length_differ_at_the_end_of_the_shorter_one() {
        assert_eq!(divergence(&run(None, 40), &run(None, 40), &[]), None);
        let found = divergence(&run(None, 30), &run(None, 40), &[]).expect("one is longer");
        assert!((found.secs - 3.0).abs() < 1e-9 && found.body.is_none());
    }
}
