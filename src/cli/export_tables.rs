//! `actcheck export tables`

use std::path::{Path, PathBuf};

use clap::Args;

use crate::camera_images::CameraImages;
use crate::chosen::{self, ChosenRuns};
use crate::trust::TrustArgs;
use crate::{output, restore};
use actcheck_analysis::{
    Dataset, DatasetRuns, DrawImages, LerobotDataset, Mirror, export_csv, export_dataset,
    export_facts, export_lerobot, export_parquet,
};
use actcheck_base::Diagnostics;
use actcheck_data::Trace;
use actcheck_history::RunDetail;

/// `actcheck export tables`
#[derive(Debug, Args)]
pub struct ExportTablesArgs {
    /// The folder to write
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
    /// Write the outcomes as CSV instead of Parquet: `outcomes.csv`
    #[arg(long)]
    pub csv: bool,
    /// Also the tables from which outcomes follow: `actions`, `percepts`, `planes`, `states`,
    /// `bodies`, `links`, `contacts`, `self_contacts`, `extremes`, `intervals`, `joint_extremes`,
    /// `shapes` and `places`
    #[arg(long, conflicts_with = "csv")]
    pub complete: bool,
    /// All tables of `--complete`, and the motion to learn from: `joints` and `robot` (observations
    /// and commands over time), `objects` (ground truth)
    #[arg(long, conflicts_with_all = ["csv", "complete"])]
    pub dataset: bool,
    /// The tables of `--dataset`, and the course of each action at the control rate (60 Hz), from
    /// which properties about time can be judged: `course_bodies` (poses, velocities, holds),
    /// `course_robot` (gripper and base), `course_joints`, `course_forces` (between pairs of
    /// bodies) and `phases`. The folder is then five to six times as large
    #[arg(long, conflicts_with_all = ["csv", "complete"])]
    pub course: bool,
    /// Also the colour images of the camera, one a second: `images`
    #[arg(long, conflicts_with_all = ["csv", "complete"])]
    pub images: bool,
    /// A LeRobotDataset (v3.0) instead: an episode for each run, ten frames a second, with the
    /// joints, their commanded values, and the camera's images as PNG
    #[arg(long, conflicts_with_all = ["csv", "complete", "dataset", "course", "images"])]
    pub lerobot: bool,
    /// The runs in the tables, and their history.
    #[command(flatten)]
    pub chosen: ChosenRuns,
    /// The consent to start programs.
    #[command(flatten)]
    pub trust: TrustArgs,
}

/// Writes tables of the chosen runs.
pub fn tables(args: &ExportTablesArgs) -> Result<(), Diagnostics> {
    let history = args.chosen.open()?;
    restore::allow(&history, args.trust.trust);
    let filter = args.chosen.filter(&history)?;
    let hierarchy = chosen::hierarchy(&args.chosen.ontology()?);
    let (mirror, _) = Mirror::update(&history)?;
    let runs = DatasetRuns {
        history: &history,
        mirror: &mirror,
        filter: &filter,
        hierarchy: &hierarchy,
    };
    let folder: &Path = &args.folder;
    let mut camera = CameraImages::new(&history, args.trust.trust);
    let mut draw =
        |run: &RunDetail, trace: &Trace, frames: &[usize]| camera.draw(run, trace, frames);
    if args.lerobot {
        print_lerobot(&export_lerobot(&runs, folder, &mut draw)?, folder);
    } else if args.dataset || args.course || args.images {
        let images: Option<&mut DrawImages<'_>> = match args.images {
            true => Some(&mut draw),
            false => None,
        };
        print_dataset(&export_dataset(&runs, folder, args.course, images)?);
    } else if args.complete {
        print_dataset(&export_facts(&runs, folder)?);
    } else {
        let write = if args.csv { export_csv } else { export_parquet };
        let (files, rows) = write(&mirror, &filter, &hierarchy, folder)?;
        if let [table, schema] = files.as_slice() {
            output::print(&format!(
                "{} holds {rows} rows, {} describes their columns\n",
                table.display(),
                schema.display()
            ));
        }
    }
    Ok(())
}

fn print_lerobot(written: &LerobotDataset, folder: &Path) {
    output::print_prose(&format!(
        "{} holds {} episodes with {} frames\n",
        folder.display(),
        written.episodes,
        written.frames
    ));
    if written.left_out > 0 {
        output::print_prose(&format!(
            "{} runs are left out: their motion is not kept, their camera can't be drawn, or it has another size\n",
            written.left_out
        ));
    }
}

fn print_dataset(dataset: &Dataset) {
    for (table, rows) in &dataset.tables {
        output::print_prose(&format!("{} holds {rows} rows\n", table.display()));
    }
    let runs = dataset.runs;
    output::print_prose(&format!(
        "{} describes the columns of these tables of {runs} runs\n",
        dataset.schema.display()
    ));
    if dataset.withheld > 0 {
        output::print_prose(&format!(
            "{} of {runs} runs have no rows in the tables of motion\n",
            dataset.withheld
        ));
    }
}
