//! The part of a user's program in a run, for the terminal: its output, commands and questions, and
//! the motion of the robot's joints.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::text::{Page, fitted, ruled};
use actcheck_base::names;
use actcheck_data::{
    AnsweredQuestion, CommandStretch, CommandTarget, Motion, SkillDeed, SkillEntry, TargetKind,
    Trace,
};

/// Most entries that are shown; of more, the first and the last ones.
const MOST_SHOWN: usize = 80;
/// Angles and distances below this do not count as motion of a joint. Units: metres or radians.
const LEAST_MOTION: f32 = 1e-3;

/// The log of a run's program, and the motion of the joints as far as the trace has it. Empty if no
/// program took part.
pub fn skill_text(trace: &Trace, page: Page) -> String {
    let log = &trace.skill;
    if log.is_empty() {
        return String::new();
    }
    let begin_secs = trace.snapshots.first().map_or(0.0, |state| state.time_secs);
    let mut out = String::from("\nthe program's side, at simulated seconds since the run began:\n");
    let shown = |entry: &SkillEntry, out: &mut String| {
        let start = entry.time_secs - begin_secs;
        let line = match &entry.deed {
            SkillDeed::Printed(line) => format!("│ {line}"),
            SkillDeed::Commanded(stretch) => commanded(stretch, start, begin_secs),
            SkillDeed::Asked(question) => asked(question),
        };
        let _ = writeln!(out, "  {start:7.2}  {line}");
    };
    let entries = &log.entries;
    let (first, last) = if entries.len() > MOST_SHOWN {
        let half = MOST_SHOWN / 2;
        (&entries[..half], &entries[entries.len() - half..])
    } else {
        (entries.as_slice(), &[][..])
    };
    first.iter().for_each(|entry| shown(entry, &mut out));
    if !last.is_empty() {
        let hidden = entries.len() - first.len() - last.len();
        let _ = writeln!(out, "        …  {hidden} more: `--format json` has them");
    }
    last.iter().for_each(|entry| shown(entry, &mut out));
    let left_out = [
        (log.lines_left_out, "printed lines"),
        (log.others_left_out, "commands and questions"),
    ];
    for (count, noun) in left_out.into_iter().filter(|(count, _)| *count > 0) {
        let _ = writeln!(
            out,
            "  {count} {noun} in the middle of the run are not kept"
        );
    }
    out.push_str(&joints(trace, page));
    page.set(&out)
}

/// A stretch of commands, in words: `96 commands until 2.10: arm_lift_joint 0.3`.
fn commanded(stretch: &CommandStretch, start: f64, begin_secs: f64) -> String {
    let end = stretch.end_secs - begin_secs;
    let targets = targets(&stretch.targets);
    let words = match (stretch.commands, targets.is_empty()) {
        (1, true) => "waits".to_owned(),
        (several, true) => format!("{several} commands without new targets"),
        (1, false) => format!("commands {targets}"),
        (several, false) => format!("{several} commands, at last {targets}"),
    };
    format!("{words}, {:.2} s", end - start)
}

/// Targets in words: `opening 8 cm, force 20 N, arm_lift_joint 0.3`.
fn targets(targets: &[CommandTarget]) -> String {
    let words = targets.iter().map(|target| match target.kind {
        TargetKind::Position => format!("{} {}", target.joint, number(target.value)),
        TargetKind::Velocity => format!("{} {}/s", target.joint, number(target.value)),
        TargetKind::Effort => format!("effort of {} {}", target.joint, number(target.value)),
        TargetKind::Forwards => format!("forwards {} m/s", number(target.value)),
        TargetKind::Left => format!("left {} m/s", number(target.value)),
        TargetKind::Turning => format!("turning {} rad/s", number(target.value)),
        TargetKind::Opening => format!("opening {} cm", number(target.value * 100.0)),
        TargetKind::Force => format!("force {} N", number(target.value)),
    });
    words.collect::<Vec<_>>().join(", ")
}

/// A question and its answer, in words.
fn asked(question: &AnsweredQuestion) -> String {
    let of = question
        .of
        .as_ref()
        .map_or_else(String::new, |of| format!(" of {of}"));
    let noun = match (question.what.as_str(), question.count) {
        ("cloud", _) => "points",
        ("objects", 1) => "object",
        ("objects", _) => "objects",
        _ => "pixels",
    };
    let mut answer = format!("{} {noun}", question.count);
    if question.bytes > 0 {
        let _ = write!(answer, ", {} kB", question.bytes.div_ceil(1000));
    }
    let objects: Vec<String> = question
        .objects
        .iter()
        .map(|object| {
            let [x, y, z] = object.position_m;
            format!("{} at ({x:.3}, {y:.3}, {z:.3}) m", object.id)
        })
        .collect();
    if !objects.is_empty() {
        let _ = write!(answer, ": {}", objects.join(", "));
    }
    format!("asks for {}{of} → {answer}", question.what)
}

/// Three decimals at most, without zeros at the end.
fn number(value: f32) -> String {
    let text = format!("{value:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" {
        "0".to_owned()
    } else {
        text.to_owned()
    }
}

/// The course of one joint in an action.
struct JointSummary {
    from: f32,
    to: f32,
    target: f32,
    fastest: f32,
    strongest: f32,
    moved: bool,
}

/// Tables of the joints that moved, one for each action. Empty if the trace has no motion.
fn joints(trace: &Trace, page: Page) -> String {
    let mut out = String::new();
    for (action, course) in trace.actions.iter().zip(&trace.robot_courses) {
        let summaries = summaries(&course.motion);
        if summaries.is_empty() {
            continue;
        }
        let mut table = ruled();
        table.set_header([
            "joint (m or rad)",
            "from",
            "to",
            "target",
            "max velocity",
            "max effort",
        ]);
        let mut still = 0;
        for (name, joint) in &summaries {
            if !joint.moved {
                still += 1;
                continue;
            }
            table.add_row([
                (*name).to_owned(),
                number(joint.from),
                number(joint.to),
                number(joint.target),
                number(joint.fastest),
                format!("{:.1}", joint.strongest),
            ]);
        }
        let _ = writeln!(out, "\njoints in {}:", names::local(&action.action));
        if still < summaries.len() {
            out.push_str(&fitted(table, page, &["max effort", "max velocity"]));
        }
        if still > 0 {
            let joints = if still == 1 { "joint" } else { "joints" };
            let _ = writeln!(out, "{still} {joints} did not move");
        }
    }
    out
}

fn summaries(motion: &Motion) -> BTreeMap<&str, JointSummary> {
    let mut found: BTreeMap<&str, JointSummary> = BTreeMap::new();
    for moment in motion.moments() {
        for (name, joint) in motion.joints.iter().zip(moment.joints()) {
            let summary = found.entry(name).or_insert(JointSummary {
                from: joint.position,
                to: joint.position,
                target: joint.target,
                fastest: 0.0,
                strongest: 0.0,
                moved: false,
            });
            summary.moved |= (joint.position - summary.from).abs() > LEAST_MOTION;
            (summary.to, summary.target) = (joint.position, joint.target);
            summary.fastest = summary.fastest.max(joint.velocity.abs());
            summary.strongest = summary.strongest.max(joint.effort.abs());
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use actcheck_data::{ActionEnd, ActionTrace, AnsweredObject, RobotCourse, SkillLog};
    use std::collections::BTreeMap;

    #[test]
    fn the_side_of_a_program_is_readable() {
        let entry = |time_secs, deed| SkillEntry { time_secs, deed };
        let target = |kind, joint: &str, value| CommandTarget {
            kind,
            joint: joint.to_owned(),
            value,
        };
        let row = |secs: f32, lift: f32| {
            let mut row = vec![0.0; 12];
            row[0] = secs;
            row.extend([lift, 0.25, 3.0, 0.3]);
            row.extend([1.0, 0.0, 0.0, 1.0]);
            row
        };
        let motion = Motion {
            joints: vec!["lift".to_owned(), "wrist".to_owned()],
            rows: vec![row(0.0, 0.0), row(0.1, 0.299)],
        };
        let course = RobotCourse {
            motion,
            ..RobotCourse::default()
        };
        let mut snapshot = crate::made_up::snapshot(0.0);
        snapshot.time_secs = 1.0;
        let trace = Trace {
            snapshots: vec![snapshot],
            actions: vec![ActionTrace {
                end: ActionEnd::Completed,
                ..ActionTrace::not_reached("Pick", &BTreeMap::new())
            }],
            robot_courses: vec![course],
            skill: SkillLog {
                entries: vec![
                    entry(
                        1.0,
                        SkillDeed::Asked(AnsweredQuestion {
                            what: "objects".to_owned(),
                            of: Some("cup".to_owned()),
                            count: 1,
                            bytes: 0,
                            objects: vec![AnsweredObject {
                                id: "cup".to_owned(),
                                position_m: [0.5, -0.1, 0.4],
                            }],
                        }),
                    ),
                    entry(1.0, SkillDeed::Printed("sees it".to_owned())),
                    entry(
                        1.0,
                        SkillDeed::Commanded(CommandStretch {
                            end_secs: 3.0,
                            commands: 120,
                            targets: vec![
                                target(TargetKind::Position, "lift", 0.3),
                                target(TargetKind::Opening, "", 0.08),
                            ],
                        }),
                    ),
                ],
                lines_left_out: 12,
                others_left_out: 0,
            },
            ..Trace::default()
        };
        // Without the spaces that fill the last column.
        let text: String = skill_text(&trace, Page::default())
            .lines()
            .map(|line| format!("{}\n", line.trim_end()))
            .collect();
        assert_eq!(
            text,
            "\nthe program's side, at simulated seconds since the run began:
     0.00  asks for objects of cup → 1 object: cup at (0.500, -0.100, 0.400) m
     0.00  │ sees it
     0.00  120 commands, at last lift 0.3, opening 8 cm, 2.00 s
  12 printed lines in the middle of the run are not kept

joints in Pick:
 joint (m or rad)   from   to      target   max velocity   max effort
──────────────────────────────────────────────────────────────────────
 lift               0      0.299   0.3      0.25           3.0
1 joint did not move
"
        );
        assert_eq!(skill_text(&Trace::default(), Page::default()), "");
    }
}
