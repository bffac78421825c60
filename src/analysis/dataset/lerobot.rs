//! Export of runs as a LeRobotDataset of version 3: an episode for each run, with its images as PNG
//! in the tables.
//!
//! Source: LeRobot's documentation, "LeRobotDataset v3.0".

use std::path::{Path, PathBuf};

use polars::prelude::{
    AnyValue, Column, DataFrame, DataType, NamedFrom as _, ParquetWriter, PolarsError, Series,
};
use serde_json::{Value, json};

use crate::dataset::images::{DatasetImage, DrawImages, moments};
use crate::dataset::write::DatasetRuns;
use crate::tables::{new_text, unwritten};
use actcheck_base::{Below, Diagnostic, Diagnostics, Outcome};
use actcheck_data::Trace;
use actcheck_history::RunDetail;

/// Version of the format.
const VERSION: &str = "v3.0";
/// Size at which a data file is full. Unit: bytes.
const FILE_BYTES: usize = 100 << 20;
/// Number of files in a folder.
const FILES_PER_CHUNK: usize = 1000;
/// Every so many images, one counts for the statistics of the pixels.
const SAMPLED: usize = 10;
/// The columns that are numbers of rows and episodes.
const INDICES: [&str; 4] = ["frame_index", "episode_index", "index", "task_index"];
const STATE: &str = "observation.state";
const ACTION: &str = "action";
const IMAGE: &str = "observation.images.camera";

/// A written LeRobotDataset.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct LerobotDataset {
    /// Number of episodes.
    pub episodes: usize,
    /// Number of frames of all episodes.
    pub frames: usize,
    /// Number of runs that are left out: their motion is not kept or the camera can't be drawn.
    pub left_out: usize,
}

/// Writes runs as a LeRobotDataset into a folder, creating it if needed. States are the joints'
/// positions and the gap between the fingers; actions are their commanded values.
///
/// # Errors
/// `A001` if it can't be written or the folder holds a dataset already; errors of reading the
/// history or a trace.
pub fn export_lerobot(
    runs: &DatasetRuns<'_>,
    folder: &Path,
    draw: &mut DrawImages<'_>,
) -> Result<LerobotDataset, Diagnostics> {
    if folder.join("meta").exists() || folder.join("data").exists() {
        let message = format!("{} holds a dataset already", folder.display());
        return Err(Diagnostic::error("A001", message)
            .help("name another folder, or delete this one")
            .into());
    }
    let mut written = LerobotDataset::default();
    let mut export = Export::new(folder);
    for (campaign, ids) in runs.history.run_ids()? {
        for run in ids.iter().filter(|_| runs.filter.takes_campaign(&campaign)) {
            let detail = runs.history.newest_run(run)?;
            let is_early = |since: &String| detail.row.started < *since;
            if runs.filter.since.as_ref().is_some_and(is_early) {
                continue;
            }
            let trace = runs.history.traces().whole_if_allowed(run)?;
            let is_added = match trace {
                Some(trace) => export.add(&detail, &trace, draw)?,
                None => false,
            };
            written.left_out += usize::from(!is_added);
        }
    }
    export.finish()?;
    (written.episodes, written.frames) = (export.episodes.len(), export.n_frames);
    Ok(written)
}

/// A row of the data.
struct EpisodeFrame {
    state: Vec<f32>,
    action: Vec<f32>,
    png: Vec<u8>,
    episode: usize,
    number: usize,
    task: usize,
    is_last: bool,
    succeeded: bool,
}

/// An episode in the table of episodes.
struct Episode {
    task: usize,
    first: usize,
    length: usize,
    file: usize,
}

struct Export<'a> {
    folder: &'a Path,
    tasks: Vec<String>,
    episodes: Vec<Episode>,
    /// Rows of the present file.
    frames: Vec<EpisodeFrame>,
    bytes: usize,
    file: usize,
    n_frames: usize,
    fps: f64,
    /// Joints of the episodes and the size of their images; `None` before the first.
    robot: Option<(Vec<String>, [usize; 2])>,
    states: Statistics,
    actions: Statistics,
    pixels: Statistics,
}

impl<'a> Export<'a> {
    fn new(folder: &'a Path) -> Self {
        Self {
            folder,
            tasks: Vec::new(),
            episodes: Vec::new(),
            frames: Vec::new(),
            bytes: 0,
            file: 0,
            n_frames: 0,
            fps: 0.0,
            robot: None,
            states: Statistics::default(),
            actions: Statistics::default(),
            pixels: Statistics::default(),
        }
    }

    /// Adds a run. Returns `false` if it has no images, or other joints or another size of images
    /// than the first.
    fn add(
        &mut self,
        run: &RunDetail,
        trace: &Trace,
        draw: &mut DrawImages<'_>,
    ) -> Result<bool, Diagnostics> {
        let taken: Vec<_> = moments(trace)
            .into_iter()
            .filter(|moment| moment.row > 0 || moment.action == 0)
            .collect();
        let numbers: Vec<usize> = taken.iter().map(|moment| moment.frame).collect();
        let images = draw(run, trace, &numbers)?;
        let motions = trace.robot_courses.iter().map(|course| &course.motion);
        let motions: Vec<Vec<_>> = motions.map(|motion| motion.moments().collect()).collect();
        let (Some(first), Some(image)) = (trace.robot_courses.first(), images.first()) else {
            return Ok(false);
        };
        let robot = (first.motion.joints.clone(), [image.height, image.width]);
        if images.len() != taken.len() || *self.robot.get_or_insert_with(|| robot.clone()) != robot
        {
            return Ok(false);
        }
        if self.bytes > FILE_BYTES {
            self.write_data()?;
        }
        self.fps = (1.0 / trace.frames.period_secs).round();
        let task = self.task(&run.row.test);
        let mut judgements = run.actions.iter().flat_map(|action| &action.judgements);
        let succeeded = judgements.all(|judgement| matches!(judgement.outcome, Outcome::Passed));
        let episode = self.episodes.len();
        let first = self.n_frames;
        for (number, (moment, image)) in taken.iter().zip(images).enumerate() {
            let row = motions
                .get(moment.action)
                .and_then(|rows| rows.get(moment.row));
            let Some(row) = row else { continue };
            let joints = || row.joints();
            let frame = EpisodeFrame {
                state: joints()
                    .map(|joint| joint.position)
                    .chain([row.opening_m])
                    .collect(),
                action: joints()
                    .map(|joint| joint.target)
                    .chain([row.commanded_opening_m])
                    .collect(),
                episode,
                number,
                task,
                is_last: number + 1 == taken.len(),
                succeeded,
                png: self.counted(image),
            };
            self.states.add(&frame.state);
            self.actions.add(&frame.action);
            self.bytes += frame.png.len();
            self.n_frames += 1;
            self.frames.push(frame);
        }
        self.episodes.push(Episode {
            task,
            first,
            length: self.n_frames - first,
            file: self.file,
        });
        Ok(true)
    }

    /// Adds an image to the statistics of the pixels. Returns its file.
    fn counted(&mut self, image: DatasetImage) -> Vec<u8> {
        if self.n_frames.is_multiple_of(SAMPLED) {
            for pixel in image.rgb.chunks_exact(3) {
                let shares: [f32; 3] = [0, 1, 2].map(|at| f32::from(pixel[at]) / 255.0);
                self.pixels.add(&shares);
            }
        }
        image.png
    }

    /// The number of a task.
    fn task(&mut self, name: &str) -> usize {
        let known = self.tasks.iter().position(|task| task == name);
        known.unwrap_or_else(|| {
            self.tasks.push(name.to_owned());
            self.tasks.len() - 1
        })
    }

    /// Writes the present data file and begins the next.
    fn write_data(&mut self) -> Result<(), Diagnostics> {
        let frames = std::mem::take(&mut self.frames);
        if frames.is_empty() {
            return Ok(());
        }
        let start = self.n_frames - frames.len();
        let lists = |of: fn(&EpisodeFrame) -> &Vec<f32>| -> Vec<Series> {
            frames
                .iter()
                .map(|frame| Series::new("".into(), of(frame)))
                .collect()
        };
        #[expect(clippy::cast_possible_truncation, reason = "times of a run in seconds")]
        let times = frames
            .iter()
            .map(|frame| (frame.number as f64 / self.fps) as f32);
        let count = |of: &dyn Fn(usize, &EpisodeFrame) -> usize| -> Vec<i64> {
            let counts = frames.iter().enumerate();
            counts.map(|(idx, frame)| signed(of(idx, frame))).collect()
        };
        let done: Vec<bool> = frames.iter().map(|frame| frame.is_last).collect();
        let success: Vec<bool> = frames
            .iter()
            .map(|frame| frame.is_last && frame.succeeded)
            .collect();
        let reward: Vec<f32> = success
            .iter()
            .map(|won| f32::from(u8::from(*won)))
            .collect();
        let columns = vec![
            self.files(&frames)?,
            Series::new(STATE.into(), lists(|frame| &frame.state)),
            Series::new(ACTION.into(), lists(|frame| &frame.action)),
            Series::new("next.reward".into(), reward),
            Series::new("next.done".into(), done),
            Series::new("next.success".into(), success),
            Series::new("timestamp".into(), times.collect::<Vec<f32>>()),
            Series::new("frame_index".into(), count(&|_, frame| frame.number)),
            Series::new("episode_index".into(), count(&|_, frame| frame.episode)),
            Series::new("index".into(), count(&|idx, _| start + idx)),
            Series::new("task_index".into(), count(&|_, frame| frame.task)),
        ];
        let path = self.folder.join("data").join(place(self.file));
        self.write(&path, frames.len(), columns)?;
        (self.bytes, self.file) = (0, self.file + 1);
        Ok(())
    }

    /// The column of images. Hugging Face's reader takes no views, which are the usual kind here.
    fn files(&self, frames: &[EpisodeFrame]) -> Result<Series, Diagnostics> {
        let files = frames.iter().map(|frame| AnyValue::Binary(&frame.png));
        let files: Vec<AnyValue<'_>> = files.collect();
        Series::from_any_values_and_dtype(IMAGE.into(), &files, &DataType::BinaryOffset, true)
            .map_err(|error| unwritten(self.folder, &error))
    }

    /// Writes the last data file, and the descriptions of the dataset.
    fn finish(&mut self) -> Result<(), Diagnostics> {
        self.write_data()?;
        let meta = self.folder.join("meta");
        let numbers: Vec<i64> = (0..self.tasks.len()).map(signed).collect();
        let columns = vec![
            Series::new("task_index".into(), numbers),
            Series::new("task".into(), &self.tasks),
        ];
        let path = meta.join("tasks.parquet");
        self.write(&path, self.tasks.len(), columns)?;
        let path = meta.join("episodes").join(place(0));
        self.write(&path, self.episodes.len(), self.episode_columns())?;
        let below = Below::new(self.folder);
        for (name, value) in [
            ("info.json", self.info()),
            ("stats.json", self.statistics()),
        ] {
            let path = meta.join(name);
            new_text(&below, &path, &format!("{value:#}\n"))?
                .finish()
                .map_err(|error| unwritten(&path, &error))?;
        }
        Ok(())
    }

    fn episode_columns(&self) -> Vec<Series> {
        let count = |of: &dyn Fn(&Episode) -> usize| -> Vec<i64> {
            let counts = self.episodes.iter().map(of);
            counts.map(signed).collect()
        };
        let zeros = vec![0_i64; self.episodes.len()];
        let numbers: Vec<i64> = (0..self.episodes.len()).map(signed).collect();
        let task = |episode: &Episode| self.tasks.get(episode.task).cloned();
        let tasks: Vec<Series> = self
            .episodes
            .iter()
            .map(|episode| Series::new("".into(), [task(episode).unwrap_or_default()]))
            .collect();
        vec![
            Series::new("episode_index".into(), numbers),
            Series::new("tasks".into(), tasks),
            Series::new("length".into(), count(&|episode| episode.length)),
            Series::new(
                "data/chunk_index".into(),
                count(&|episode| episode.file / FILES_PER_CHUNK),
            ),
            Series::new(
                "data/file_index".into(),
                count(&|episode| episode.file % FILES_PER_CHUNK),
            ),
            Series::new("dataset_from_index".into(), count(&|episode| episode.first)),
            Series::new(
                "dataset_to_index".into(),
                count(&|episode| episode.first + episode.length),
            ),
            Series::new("meta/episodes/chunk_index".into(), zeros.clone()),
            Series::new("meta/episodes/file_index".into(), zeros),
        ]
    }

    fn write(&self, path: &Path, height: usize, columns: Vec<Series>) -> Result<(), Diagnostics> {
        let write = || -> Result<(), PolarsError> {
            let columns = columns.into_iter().map(Column::from).collect();
            let mut table = DataFrame::new(height, columns)?;
            let below = Below::new(self.folder);
            below.create_folder(path.parent().unwrap_or(self.folder))?;
            let file = below.new_file(path)?;
            ParquetWriter::new(file.writer()?).finish(&mut table)?;
            Ok(file.finish()?)
        };
        write().map_err(|error| unwritten(path, &error))
    }

    fn info(&self) -> Value {
        let (joints, [height, width]) = self.robot.clone().unwrap_or_default();
        let mut names = joints;
        names.push("gripper_opening_m".to_owned());
        let vector = json!({"dtype": "float32", "shape": [names.len()], "names": names});
        let single = |dtype: &str| json!({"dtype": dtype, "shape": [1], "names": null});
        let mut features = json!({
            IMAGE: {"dtype": "image", "shape": [height, width, 3], "names": ["height", "width", "channels"]},
            STATE: vector,
            ACTION: vector,
            "next.reward": single("float32"),
            "next.done": single("bool"),
            "next.success": single("bool"),
            "timestamp": single("float32"),
        });
        for name in INDICES {
            features[name] = single("int64");
        }
        json!({
            "codebase_version": VERSION,
            "robot_type": null,
            "total_episodes": self.episodes.len(),
            "total_frames": self.n_frames,
            "total_tasks": self.tasks.len(),
            "chunks_size": FILES_PER_CHUNK,
            "data_files_size_in_mb": FILE_BYTES >> 20,
            "video_files_size_in_mb": 200,
            "fps": self.fps,
            "splits": {"train": format!("0:{}", self.episodes.len())},
            "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
            "video_path": null,
            "features": features,
        })
    }

    fn statistics(&self) -> Value {
        let planes = |values: &Value| -> Value {
            let values = values.as_array().into_iter().flatten();
            values.map(|value| json!([[value]])).collect()
        };
        let mut pixels = self.pixels.described();
        for name in ["min", "max", "mean", "std"] {
            pixels[name] = planes(&pixels[name]);
        }
        json!({
            STATE: self.states.described(),
            ACTION: self.actions.described(),
            IMAGE: pixels,
        })
    }
}

/// The path of a file below its folder, by its number.
fn place(number: usize) -> PathBuf {
    let (chunk, file) = (number / FILES_PER_CHUNK, number % FILES_PER_CHUNK);
    PathBuf::from(format!("chunk-{chunk:03}")).join(format!("file-{file:03}.parquet"))
}

fn signed(count: usize) -> i64 {
    i64::try_from(count).unwrap_or(i64::MAX)
}

/// Extremes, mean and spread of each element of vectors of one length.
#[derive(Debug, Default)]
struct Statistics {
    count: usize,
    low: Vec<f64>,
    high: Vec<f64>,
    sum: Vec<f64>,
    squares: Vec<f64>,
}

impl Statistics {
    fn add(&mut self, values: &[f32]) {
        if self.count == 0 {
            self.low = vec![f64::INFINITY; values.len()];
            self.high = vec![f64::NEG_INFINITY; values.len()];
            self.sum = vec![0.0; values.len()];
            self.squares = vec![0.0; values.len()];
        }
        self.count += 1;
        for (idx, value) in values.iter().map(|value| f64::from(*value)).enumerate() {
            self.low[idx] = self.low[idx].min(value);
            self.high[idx] = self.high[idx].max(value);
            self.sum[idx] += value;
            self.squares[idx] += value * value;
        }
    }

    fn described(&self) -> Value {
        let count = self.count.max(1) as f64;
        let mean: Vec<f64> = self.sum.iter().map(|sum| sum / count).collect();
        let squares = self.squares.iter().zip(&mean);
        let deviation: Vec<f64> = squares
            .map(|(square, mean)| (square / count - mean * mean).max(0.0).sqrt())
            .collect();
        json!({"min": self.low, "max": self.high, "mean": mean, "std": deviation, "count": [self.count]})
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_are_those_of_the_definition() {
        let mut all = Statistics::default();
        for values in [[1.0_f32, 4.0], [3.0, 4.0]] {
            all.add(&values);
        }
        let expected = json!({"min": [1.0, 4.0], "max": [3.0, 4.0], "mean": [2.0, 4.0], "std": [1.0, 0.0], "count": [2]});
        assert_eq!(all.described(), expected);
    }

    #[test]
    fn files_are_numbered_within_their_folder() {
        assert_eq!(place(0), Path::new("chunk-000/file-000.parquet"));
        assert_eq!(place(1001), Path::new("chunk-001/file-001.parquet"));
    }
}
