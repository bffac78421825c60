//! Records the part of a program in a run: what it printed, commanded and asked, at simulated times.

use std::fmt;
use std::sync::Arc;

use actcheck_actions::Controls;
use actcheck_data::{
    AnsweredQuestion, CommandStretch, CommandTarget, SkillDeed, SkillEntry, SkillLog, TargetKind,
};

/// Number of printed lines that are kept from the beginning of a run, and from its end.
pub const LINES_OF_AN_END: usize = 100;
/// Number of other entries that are kept from the beginning of a run, and from its end.
const OTHERS_OF_AN_END: usize = 200;

/// The first and the last `HALF` of many values.
#[derive(Debug)]
pub struct Ends<T, const HALF: usize> {
    kept: Vec<T>,
    left_out: u64,
}

impl<T, const HALF: usize> Default for Ends<T, HALF> {
    fn default() -> Self {
        Self {
            kept: Vec::new(),
            left_out: 0,
        }
    }
}

impl<T, const HALF: usize> Ends<T, HALF> {
    /// Adds a value; the first one after the first `HALF` makes room for it.
    pub fn push(&mut self, value: T) {
        if self.kept.len() == 2 * HALF {
            self.kept.remove(HALF);
            self.left_out += 1;
        }
        self.kept.push(value);
    }

    /// The kept values, and the number of those that were left out.
    pub fn take(&mut self) -> (Vec<T>, u64) {
        (
            std::mem::take(&mut self.kept),
            std::mem::take(&mut self.left_out),
        )
    }
}

/// Receives each line that a program prints, at once.
#[derive(Clone)]
pub struct LineSink(Arc<SinkFn>);

/// Called with the run's id and the line.
type SinkFn = dyn Fn(&str, &str) + Send + Sync;

impl LineSink {
    /// Calls a function with the run's id and each line.
    pub fn new(print: impl Fn(&str, &str) + Send + Sync + 'static) -> Self {
        Self(Arc::new(print))
    }
}

impl fmt::Debug for LineSink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("LineSink")
    }
}

/// An entry with its position in the order of all entries.
type Numbered = (u64, SkillEntry);

/// The log of a run that is being written.
#[derive(Debug, Default)]
pub struct LogWriter {
    /// Id of the run.
    run: String,
    sink: Option<LineSink>,
    /// The present. Unit: simulated seconds since the scene was built.
    time_secs: f64,
    lines: Ends<Numbered, LINES_OF_AN_END>,
    others: Ends<Numbered, OTHERS_OF_AN_END>,
    /// Number of entries so far.
    count: u64,
    /// Whether a command can continue the last stretch.
    in_stretch: bool,
}

impl LogWriter {
    /// An empty log of a run, from a moment on.
    pub fn begin(run: &str, sink: Option<LineSink>, time_secs: f64) -> Self {
        Self {
            run: run.to_owned(),
            sink,
            time_secs,
            ..Self::default()
        }
    }

    /// Begins an action: commands before it and in it are separate entries.
    pub fn begin_action(&mut self, time_secs: f64) {
        self.time_secs = time_secs;
        self.in_stretch = false;
    }

    /// Records lines. `left_out` others among them are not known any more.
    pub fn print(&mut self, (lines, left_out): (Vec<String>, u64)) {
        for line in lines {
            if let Some(sink) = &self.sink {
                (sink.0)(&self.run, &line);
            }
            let entry = self.numbered(SkillDeed::Printed(line));
            self.lines.push(entry);
            self.in_stretch = false;
        }
        self.lines.left_out += left_out;
    }

    /// Records a question.
    pub fn ask(&mut self, question: AnsweredQuestion) {
        let entry = self.numbered(SkillDeed::Asked(question));
        self.others.push(entry);
        self.in_stretch = false;
    }

    /// Records a command that was carried out from the present until `end_secs`, which is then the
    /// present. `names` are those of the joints.
    pub fn command(&mut self, controls: &Controls, names: &[String], end_secs: f64) {
        let targets = targets(controls, names);
        match self.others.kept.last_mut() {
            Some((
                _,
                SkillEntry {
                    deed: SkillDeed::Commanded(stretch),
                    ..
                },
            )) if self.in_stretch && are_alike(&stretch.targets, &targets) => {
                stretch.end_secs = end_secs;
                stretch.commands = stretch.commands.saturating_add(1);
                stretch.targets = targets;
            }
            _ => {
                let stretch = CommandStretch {
                    end_secs,
                    commands: 1,
                    targets,
                };
                let entry = self.numbered(SkillDeed::Commanded(stretch));
                self.others.push(entry);
                self.in_stretch = true;
            }
        }
        self.time_secs = end_secs;
    }

    /// The log so far; the writer is then empty.
    pub fn finish(&mut self) -> SkillLog {
        let (lines, lines_left_out) = self.lines.take();
        let (others, others_left_out) = self.others.take();
        let mut all: Vec<Numbered> = lines.into_iter().chain(others).collect();
        all.sort_by_key(|(number, _)| *number);
        self.in_stretch = false;
        SkillLog {
            entries: all.into_iter().map(|(_, entry)| entry).collect(),
            lines_left_out,
            others_left_out,
        }
    }

    fn numbered(&mut self, deed: SkillDeed) -> Numbered {
        self.count += 1;
        let time_secs = self.time_secs;
        (self.count, SkillEntry { time_secs, deed })
    }
}

/// Whether two commands set the same quantities.
fn are_alike(some: &[CommandTarget], others: &[CommandTarget]) -> bool {
    let key = |target: &CommandTarget| (target.kind, target.joint.clone());
    some.iter().map(key).eq(others.iter().map(key))
}

/// All targets of a command.
fn targets(controls: &Controls, names: &[String]) -> Vec<CommandTarget> {
    use TargetKind::{Effort, Force, Forwards, Left, Opening, Position, Turning, Velocity};
    #[expect(
        clippy::cast_possible_truncation,
        reason = "seven digits are enough to read a target"
    )]
    let target = |kind, joint: &str, value: f64| CommandTarget {
        kind,
        joint: joint.to_owned(),
        value: value as f32,
    };
    let of_joints = [
        (Position, &controls.positions),
        (Velocity, &controls.velocities),
        (Effort, &controls.efforts),
    ];
    let of_joints = of_joints.into_iter().flat_map(|(kind, list)| {
        list.iter()
            .filter_map(move |(joint, value)| Some(target(kind, names.get(*joint)?, *value)))
    });
    let of_base = controls.base_velocity.into_iter().flat_map(|velocity| {
        [Forwards, Left, Turning]
            .into_iter()
            .zip(velocity)
            .map(move |(kind, value)| target(kind, "", value))
    });
    let of_hand = [(Opening, controls.opening_m), (Force, controls.force_n)]
        .into_iter()
        .filter_map(|(kind, value)| Some(target(kind, "", value?)));
    of_joints.chain(of_base).chain(of_hand).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names() -> Vec<String> {
        vec!["lift".to_owned(), "wrist".to_owned()]
    }

    fn lift(value: f64) -> Controls {
        Controls {
            positions: vec![(0, value)],
            ..Controls::default()
        }
    }

    #[test]
    fn commands_with_the_same_targets_are_one_entry() {
        let mut log = LogWriter::begin("a-1", None, 2.0);
        for tick in 1..=60 {
            let secs = f64::from(tick) / 60.0;
            log.command(&lift(secs), &names(), 2.0 + secs);
        }
        log.print((vec!["closes".to_owned()], 0));
        log.command(&lift(0.5), &names(), 3.5);
        log.command(
            &Controls {
                opening_m: Some(0.0),
                ..Controls::default()
            },
            &names(),
            4.0,
        );
        log.begin_action(5.0);
        log.command(&Controls::default(), &names(), 5.5);
        let log = log.finish();
        let stretches: Vec<(f64, f64, u32, usize)> = log
            .entries
            .iter()
            .filter_map(|entry| match &entry.deed {
                SkillDeed::Commanded(stretch) => Some((
                    entry.time_secs,
                    stretch.end_secs,
                    stretch.commands,
                    stretch.targets.len(),
                )),
                _ => None,
            })
            .collect();
        assert_eq!(
            stretches,
            [
                (2.0, 3.0, 60, 1),
                (3.0, 3.5, 1, 1),
                (3.5, 4.0, 1, 1),
                (5.0, 5.5, 1, 0)
            ]
        );
        assert_eq!(log.lines().collect::<Vec<_>>(), [(3.0, "closes")]);
        let SkillDeed::Commanded(first) = &log.entries[0].deed else {
            panic!("{log:?}")
        };
        assert_eq!(
            (first.targets[0].joint.as_str(), first.targets[0].value),
            ("lift", 1.0)
        );
    }

    /// The batches in which lines arrive depend on the machine, so the kept lines must not.
    #[test]
    fn the_kept_lines_do_not_depend_on_the_batches() {
        let lines: Vec<String> = (0..1000).map(|number| format!("line {number}")).collect();
        let kept = |batch: usize| {
            let mut log = LogWriter::begin("a-1", None, 0.0);
            for lines in lines.chunks(batch) {
                let mut arrived = Ends::<String, LINES_OF_AN_END>::default();
                lines.iter().cloned().for_each(|line| arrived.push(line));
                log.print(arrived.take());
            }
            log.finish()
        };
        let one_by_one = kept(1);
        assert_eq!(
            (one_by_one.entries.len(), one_by_one.lines_left_out),
            (200, 800)
        );
        assert_eq!(one_by_one.lines().nth(99), Some((0.0, "line 99")));
        assert_eq!(one_by_one.lines().nth(100), Some((0.0, "line 900")));
        for batch in [7, 150, 333, 1000] {
            assert_eq!(kept(batch), one_by_one, "{batch}");
        }
    }
}
