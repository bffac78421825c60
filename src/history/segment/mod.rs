//! Segments: the runs that one process added to a campaign, in append-only files with checksums.
//!
//! A segment has a file for each kind of values. A run is stored when its frame in the column of
//! runs is, which is written last.

mod frame;
mod judgements;
mod packed;
mod reader;
mod row;
mod writer;

pub(crate) use frame::{FrameFault, Frames, HEAD, ReadFault, SegmentColumn, WholeFrames, put};
pub(crate) use judgements::{JudgementWriter, LaterJudgement, read_judgements, salvage_judgements};
pub(crate) use packed::{packed, unpacked};
pub(crate) use reader::{Segment, indices_after, whole_length};
pub(crate) use row::RunEntry;
pub(crate) use writer::{RunContent, SegmentWriter, copy_column};

#[cfg(test)]
mod tests {
    use std::io;
    use std::path::Path;

    use super::*;
    use crate::stored_run::tests::sample;
    use actcheck_base::{Below, ScratchFolder};

    fn states(index: u64) -> Vec<u8> {
        (0..13_000u64)
            .map(|n| {
                if n % 50 == 7 {
                    (n * index % 251) as u8
                } else {
                    (n % 97) as u8
                }
            })
            .collect()
    }

    fn motion(index: u64) -> Option<Vec<u8>> {
        index.is_multiple_of(2).then(|| vec![index as u8; 100])
    }

    /// A segment with runs, of which every second one is kept whole.
    fn written(count: u64) -> (ScratchFolder, Below) {
        let folder = ScratchFolder::create().expect("a temporary folder");
        let below = Below::new(folder.path());
        let mut writer = SegmentWriter::create(&below, folder.path(), 1).expect("it is new");
        for index in 0..count {
            let (run, states) = (sample(index), states(index));
            let motion = motion(index).map(|bytes| packed(&bytes).expect("it is small"));
            let content = RunContent {
                run: &run,
                states: &states,
                motion: motion.as_deref(),
            };
            writer.append(&content).expect("there is room");
        }
        writer.sync().expect("it is on a disk");
        (folder, below)
    }

    fn path(folder: &Path, column: SegmentColumn) -> std::path::PathBuf {
        folder.join(format!("0001.{}", column.extension()))
    }

    fn checked(segment: &Segment) -> Result<(), ReadFault> {
        for row in segment.rows() {
            let index = row.index;
            let stored = segment.run(row)?;
            assert_eq!(stored, sample(index));
            assert!(segment.agrees(row, &stored));
            assert_eq!(row.scene(), sample(index).scene_digest());
            assert_eq!(segment.states(row)?, states(index));
            assert_eq!(segment.motion(row)?, motion(index));
            assert_eq!(segment.as_run(row, "k"), sample(index).row("k"));
        }
        Ok(())
    }

    /// Reads everything. Returns the number of runs, or the fault.
    fn opened(folder: &Path, below: &Below) -> Result<usize, ReadFault> {
        let segment = Segment::open(below, folder, 1, u64::MAX)?;
        checked(&segment)?;
        Ok(segment.rows().len())
    }

    #[test]
    fn runs_are_read_as_they_were_written() {
        let (folder, below) = written(300);
        assert_eq!(opened(folder.path(), &below).expect("it is whole"), 300);
        let again = SegmentWriter::create(&below, folder.path(), 1);
        let fault = again.err().expect("it is there");
        assert_eq!(fault.kind(), io::ErrorKind::AlreadyExists);
    }

    #[test]
    fn runs_that_are_alike_take_few_bytes() {
        let (folder, _) = written(40);
        let size = |column| {
            let file = path(folder.path(), column);
            file.metadata().expect("it is there").len() / 40
        };
        let sizes = [
            SegmentColumn::Runs,
            SegmentColumn::Details,
            SegmentColumn::States,
        ]
        .map(size);
        assert!(sizes.iter().sum::<u64>() < 1_500, "{sizes:?} bytes a run");
    }

    /// Damage of every file, wherever it is, changes no value, and loses only the runs that have
    /// it.
    #[test]
    fn flipped_bits_are_found() {
        let (folder, below) = written(4);
        for column in SegmentColumn::OF_RUNS {
            let file = path(folder.path(), column);
            let whole = std::fs::read(&file).expect("it is there");
            for at in (0..whole.len()).step_by(1 + whole.len() / 150) {
                let mut damaged = whole.clone();
                damaged[at] ^= 1 << (at % 8);
                std::fs::write(&file, damaged).expect("it can be written");
                let found = opened(folder.path(), &below);
                // The first bytes of columns whose frames are found by their place are not read.
                let is_head = column != SegmentColumn::Runs && at < HEAD;
                assert!(found.is_err() || is_head, "byte {at} of {}", file.display());
                let salvaged = Segment::salvage(&below, folder.path(), 1);
                let (segment, lost) = salvaged.expect("it can be read").expect("it has runs");
                let is_rebuilt = [SegmentColumn::Runs, SegmentColumn::Motion].contains(&column);
                assert_eq!(segment.rows().len() + lost.len(), 4, "byte {at}");
                assert!(
                    lost.is_empty() || !is_rebuilt,
                    "byte {at} of {}",
                    file.display()
                );
            }
            std::fs::write(&file, whole).expect("it can be written");
        }
    }

    /// A process that is killed leaves each file cut anywhere, but never a run without its parts.
    #[test]
    fn the_runs_before_a_kill_are_whole() {
        let (folder, below) = written(4);
        let file = path(folder.path(), SegmentColumn::Runs);
        let whole = std::fs::read(&file).expect("it is there");
        for length in 0..whole.len() {
            std::fs::write(&file, &whole[..length]).expect("it can be written");
            let found = opened(folder.path(), &below).expect("it is only cut");
            assert!(found < 4);
            let cut = whole_length(&below, &file).expect("it is only cut");
            assert!(cut <= length as u64);
            let after = Segment::open(&below, folder.path(), 1, cut).expect("it is whole");
            assert_eq!(after.rows().len(), found);
            let end = after.rows().last().map(|row| row.places.details.end());
            let rest = indices_after(&below, folder.path(), 1, end).expect("it is whole");
            assert_eq!(rest, (found as u64..4).collect::<Vec<_>>());
        }
    }
}
