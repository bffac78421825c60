//! `actcheck report --rrd`: recordings for the rerun viewer, read back by rerun's own library; and
//! the message of a program built without them.

use crate::support::{actcheck, stderr, stdout};

#[cfg(not(feature = "rerun"))]
#[test]
fn a_program_without_recordings_explains_how_to_enable_them() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let build = "cargo build --release --locked --features rerun";
    let said = |output: &std::process::Output| {
        stderr(output)
            .split_whitespace()
            .collect::<Vec<_>>()
            .join(" ")
    };
    // Checked before anything else: there is no history here.
    let refused = actcheck(here, &["report", "--rrd", "runs.rrd"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(
        said(&refused).contains("X055") && said(&refused).contains(build),
        "{}",
        stderr(&refused)
    );
    assert_eq!(
        std::fs::read_dir(here).unwrap().count(),
        0,
        "nothing is written"
    );
    let both = actcheck(here, &["report", "--rrd", "-", "--markdown"]);
    assert!(
        said(&both).contains("X058") && said(&both).contains("X055"),
        "all faults at once: {}",
        stderr(&both)
    );
    let help = stdout(&actcheck(here, &["report", "--help"]))
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ");
    assert!(
        help.contains("--rrd <FILE.rrd>") && help.contains(build),
        "{help}"
    );
}

#[cfg(feature = "rerun")]
mod with_recordings {
    use std::collections::BTreeMap;
    use std::path::Path;

    use actcheck::base::Outcome;
    use actcheck::data::{Part, Shape, Trace};
    use actcheck::history::{History, RunDetail, RunFilter};
    use actcheck::report::{Explained, Recordings};
    use re_chunk::{Chunk, ChunkId, ComponentIdentifier, RowId};
    use re_log_encoding::DecoderApp;
    use re_log_types::{EntityPath, LogMsg};
    use re_sdk_types::archetypes::{
        Boxes3D, Capsules3D, Cylinders3D, Ellipsoids3D, Mesh3D, RecordingInfo, TextDocument,
        TextLog, Transform3D,
    };
    use re_sdk_types::components::{Name, Text, TextLogLevel};

    use super::{actcheck, stderr, stdout};
    use crate::support::project;

    /// The contents of a file: chunks by the id of their recording, in order.
    fn read(bytes: &[u8]) -> BTreeMap<String, Vec<Chunk>> {
        let mut recordings: BTreeMap<String, Vec<Chunk>> = BTreeMap::new();
        for message in DecoderApp::decode_lazy(bytes) {
            match message.unwrap() {
                LogMsg::SetStoreInfo(begun) => {
                    let id = begun.info.recording_id().to_string();
                    assert!(
                        recordings.insert(id, Vec::new()).is_none(),
                        "a run is recorded twice"
                    );
                }
                LogMsg::ArrowMsg(store, message) => {
                    let chunks = recordings
                        .get_mut(store.recording_id().as_str())
                        .expect("it has begun");
                    chunks.push(Chunk::from_arrow_msg(&message).unwrap());
                }
                LogMsg::BlueprintActivationCommand(_) => panic!("the layout is left to the viewer"),
            }
        }
        recordings
    }

    /// Chunks of one entity path that are static, or those that are not.
    fn at<'a>(chunks: &'a [Chunk], path: &str, still: bool) -> Vec<&'a Chunk> {
        let path = EntityPath::parse_forgiving(path);
        chunks
            .iter()
            .filter(|chunk| *chunk.entity_path() == path && chunk.is_static() == still)
            .collect()
    }

    fn texts(chunk: &Chunk, component: ComponentIdentifier) -> Vec<String> {
        chunk
            .iter_component::<Text>(component)
            .flat_map(|texts| texts.as_slice().to_vec())
            .map(|text| text.to_string())
            .collect()
    }

    fn document(chunks: &[Chunk]) -> String {
        texts(
            at(chunks, "/outcomes", true)[0],
            TextDocument::descriptor_text().component,
        )
        .concat()
    }

    /// Times of a chunk. Unit: nanoseconds of simulated time.
    fn moments(chunk: &Chunk) -> Vec<i64> {
        assert_eq!(
            chunk.timelines().len(),
            1,
            "the only timeline is simulated time"
        );
        let times = chunk.timelines().values().next().unwrap();
        assert_eq!(times.name(), "sim_time");
        times.times_raw().to_vec()
    }

    /// Numbers of solids of each kind in a form: boxes, cylinders, capsules, balls, and whether it
    /// has a mesh.
    fn kinds(parts: &[Part]) -> [usize; 5] {
        let count = |is: fn(&Shape) -> bool| parts.iter().filter(|part| is(&part.shape)).count();
        [
            count(|shape| matches!(shape, Shape::Box { .. })),
            count(|shape| matches!(shape, Shape::Cylinder { .. })),
            count(|shape| matches!(shape, Shape::Capsule { .. })),
            count(|shape| matches!(shape, Shape::Sphere { .. })),
            count(|shape| {
                matches!(
                    shape,
                    Shape::Tube { .. } | Shape::Hull { .. } | Shape::Mesh { .. }
                )
            })
            .min(1),
        ]
    }

    fn recorded_kinds(chunk: &Chunk) -> [usize; 5] {
        let vectors = |component| {
            chunk
                .iter_slices::<[f32; 3]>(component)
                .map(<[_]>::len)
                .sum::<usize>()
        };
        let lengths = |component| {
            chunk
                .iter_slices::<f32>(component)
                .map(<[_]>::len)
                .sum::<usize>()
        };
        let corners = vectors(Mesh3D::descriptor_vertex_positions().component);
        assert_eq!(
            corners,
            vectors(Mesh3D::descriptor_vertex_normals().component)
        );
        [
            vectors(Boxes3D::descriptor_half_sizes().component),
            lengths(Cylinders3D::descriptor_lengths().component),
            lengths(Capsules3D::descriptor_lengths().component),
            vectors(Ellipsoids3D::descriptor_half_sizes().component),
            corners.min(1),
        ]
    }

    fn path(body: &str) -> String {
        if body.contains('/') {
            format!("/scene/{body}")
        } else {
            format!("/scene/objects/{body}")
        }
    }

    /// Every body is recorded once, with its solids, and with its pose in each frame.
    fn holds_the_trace(chunks: &[Chunk], trace: &Trace) {
        let frames = &trace.frames;
        for form in &trace.forms {
            let [solids] = at(chunks, &path(&form.name), true)[..] else {
                panic!("{} is not there once", form.name)
            };
            assert_eq!(recorded_kinds(solids), kinds(&form.parts), "{}", form.name);
            let course = at(chunks, &path(&form.name), false);
            let slot = frames.names.iter().position(|name| *name == form.name);
            assert_eq!(course.len(), usize::from(slot.is_some()), "{}", form.name);
            let translation = Transform3D::descriptor_translation().component;
            let (Some(slot), Some(course)) = (slot, course.first()) else {
                assert_eq!(
                    solids.iter_slices::<[f32; 3]>(translation).count(),
                    1,
                    "{} is static in some frames",
                    form.name
                );
                continue;
            };
            let period_nanos = frames.period_secs * 1e9;
            let expected: Vec<i64> = (0..frames.rows.len())
                .map(|idx| (idx as f64 * period_nanos).round() as i64)
                .collect();
            assert_eq!(moments(course), expected);
            let recorded: Vec<[f32; 3]> = course
                .iter_slices::<[f32; 3]>(translation)
                .map(|at| at[0])
                .collect();
            let traced: Vec<&[f32]> = frames
                .rows
                .iter()
                .map(|row| &row[7 * slot..7 * slot + 3])
                .collect();
            assert!(
                recorded
                    .iter()
                    .zip(&traced)
                    .all(|(recorded, traced)| recorded == traced)
                    && recorded.len() == traced.len()
            );
        }
        let bodies = chunks.iter().filter(|chunk| {
            chunk.is_static() && chunk.entity_path().to_string().starts_with("/scene/")
        });
        assert_eq!(bodies.count(), trace.forms.len());
    }

    fn holds_the_outcomes(chunks: &[Chunk], run: &RunDetail) {
        let text = document(chunks);
        let judged: Vec<_> = run
            .actions
            .iter()
            .flat_map(|action| &action.judgements)
            .collect();
        assert_eq!(
            text.lines().filter(|line| line.starts_with("- ")).count(),
            judged.len()
        );
        for outcome in Outcome::ALL
            .into_iter()
            .filter(|outcome| *outcome != Outcome::Passed)
        {
            let count = judged
                .iter()
                .filter(|judgement| judgement.outcome == outcome)
                .count();
            assert_eq!(
                text.matches(&format!(": **{}**", outcome.word())).count(),
                count,
                "{text}"
            );
        }
        let not_passed = judged
            .iter()
            .filter(|judgement| judgement.outcome != Outcome::Passed)
            .count();
        let outcomes = at(chunks, "/events/outcomes", false);
        assert_eq!(
            outcomes.iter().map(|chunk| chunk.num_rows()).sum::<usize>(),
            not_passed
        );
    }

    /// A project with a history of two runs.
    fn two_runs() -> tempfile::TempDir {
        let project = project();
        let ran = actcheck(
            project.path(),
            &[
                "run",
                "configs/quick.toml",
                "--runs",
                "2",
                "--jobs",
                "1",
                "--history",
                "h",
            ],
        );
        assert!(
            ran.status.code().is_some_and(|code| code < 2),
            "{}",
            stderr(&ran)
        );
        project
    }

    /// The runs of a history with their traces.
    fn kept(folder: &Path) -> Vec<(RunDetail, Trace)> {
        let history = History::open_existing(&folder.join("h")).unwrap();
        let rows = history.runs(&RunFilter::default()).unwrap();
        rows.iter()
            .map(|row| {
                (
                    history.run(&row.run).unwrap(),
                    history.traces().whole(&row.run).unwrap(),
                )
            })
            .collect()
    }

    #[test]
    fn a_recording_holds_the_trace_and_the_outcomes() {
        let project = two_runs();
        let here = project.path();
        let report = |arguments: &[&str]| {
            actcheck(here, &[&["report", "--history", "h"], arguments].concat())
        };
        let written = report(&["--rrd", "runs.rrd"]);
        assert_eq!(written.status.code(), Some(0), "{}", stderr(&written));
        assert!(
            stdout(&written).starts_with("runs.rrd holds 2 of 2 runs ("),
            "{}",
            stdout(&written)
        );
        assert!(
            stdout(&written).ends_with(" MB): rerun runs.rrd\n"),
            "{}",
            stdout(&written)
        );
        let bytes = std::fs::read(here.join("runs.rrd")).unwrap();
        assert_eq!(
            report(&["--rrd", "-"]).stdout,
            bytes,
            "the same history, the same bytes"
        );

        let recordings = read(&bytes);
        let kept = kept(here);
        assert_eq!(
            recordings.keys().collect::<Vec<_>>(),
            kept.iter().map(|(run, _)| &run.row.run).collect::<Vec<_>>()
        );
        for (run, trace) in &kept {
            let chunks = &recordings[&run.row.run];
            holds_the_trace(chunks, trace);
            holds_the_outcomes(chunks, run);
            let [actions] = at(chunks, "/events/actions", false)[..] else {
                panic!("actions are recorded once")
            };
            let lines = texts(actions, TextLog::descriptor_text().component);
            assert!(
                lines[0].ends_with("PerceivePlane begins") && moments(actions).is_sorted(),
                "{lines:?}"
            );
            let mut ids: Vec<ChunkId> = chunks.iter().map(Chunk::id).collect();
            let mut rows: Vec<RowId> = chunks.iter().flat_map(Chunk::row_ids).collect();
            let (all_ids, all_rows) = (ids.len(), rows.len());
            ids.sort_unstable();
            ids.dedup();
            rows.sort_unstable();
            rows.dedup();
            assert_eq!((ids.len(), rows.len()), (all_ids, all_rows), "ids differ");
        }

        // As many runs as fit, at least one; only the requested runs.
        let narrow = report(&[
            "--rrd",
            "one.rrd",
            "--replay-mb",
            "0",
            "--property",
            "MovedObject",
        ]);
        assert!(
            stdout(&narrow).starts_with("one.rrd holds 1 of 2 runs ("),
            "{}",
            stdout(&narrow)
        );
        let one = read(&std::fs::read(here.join("one.rrd")).unwrap());
        let text = document(one.values().next().unwrap());
        assert!(
            one.len() == 1 && text.matches("\n- ").count() == 1 && text.contains("- MovedObject: "),
            "{text}"
        );
    }

    /// One real run with a made-up outcome, so that no seed has to fail.
    #[test]
    fn a_recorded_failure_has_its_explanation_with_markup_escaped() {
        let project = two_runs();
        let (mut run, trace) = kept(project.path()).remove(0);
        let step = run.actions[1].step;
        let judgement = &mut run.actions[1].judgements[0];
        judgement.outcome = Outcome::Failed;
        judgement.witness = "it came [nearer](http://example.org) <b>twice</b>".to_owned();
        let property = judgement.property.clone();
        let why = Explained {
            step,
            property,
            text: "success(?o)\n  was missing".to_owned(),
            deciding: Vec::new(),
        };
        let recorded = |trace: Option<&Trace>| {
            let mut recordings = Recordings::new().unwrap();
            recordings
                .add(&run, trace, std::slice::from_ref(&why))
                .unwrap();
            assert_eq!(recordings.runs(), 1);
            let size = recordings.bytes();
            let bytes = recordings.finish().unwrap();
            assert!(size > 0 && size <= bytes.len() as u64);
            read(&bytes).remove(&run.row.run).unwrap()
        };
        let chunks = recorded(Some(&trace));
        holds_the_trace(&chunks, &trace);
        holds_the_outcomes(&chunks, &run);
        let text = document(&chunks);
        assert!(
            text.contains(": **failed**")
                && text.contains("\n      success(?o)\n        was missing\n"),
            "{text}"
        );
        assert!(
            text.contains(r"it came \[nearer\](http://example.org) &lt;b&gt;twice&lt;/b&gt;"),
            "{text}"
        );
        let [failures] = at(&chunks, "/events/outcomes", false)[..] else {
            panic!("failures are recorded once")
        };
        let levels = failures.iter_component::<TextLogLevel>(TextLog::descriptor_level().component);
        assert!(
            levels
                .flat_map(|level| level.as_slice().to_vec())
                .any(|level| level.to_string() == "ERROR")
        );
        let run_nanos =
            (trace.snapshots.last().unwrap().time_secs - trace.snapshots[0].time_secs) * 1e9;
        assert!(
            moments(failures)
                .iter()
                .all(|nanos| (0.0..=run_nanos + 1.0).contains(&(*nanos as f64)))
        );
        let name = at(&chunks, "/__properties", true)[0]
            .iter_component::<Name>(RecordingInfo::descriptor_name().component);
        assert!(
            name.flat_map(|name| name.as_slice().to_vec())
                .any(|name| name.to_string().starts_with(&run.row.run))
        );

        // Without a state there is no 3D data, and the other data is recorded.
        let untraced = recorded(None);
        assert!(
            untraced
                .iter()
                .all(|chunk| !chunk.entity_path().to_string().starts_with("/scene"))
        );
        holds_the_outcomes(&untraced, &run);
    }
}
