//! Foreign projects, with links, pipes, devices and bombs in any place: no command changes a file
//! outside, waits for ever, or fills the memory.

use std::collections::BTreeMap;
use std::os::unix::fs::{MetadataExt as _, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use actcheck::base::names;
use actcheck::history::{History, NewestJudgements, Recheck, RunFilter};

use crate::fuzz_corpus::entrances::frames;
use crate::history::{sample_campaign, sample_run};
use crate::support::{actcheck, copy, copy_made_history, project_with, stderr, stdout};

/// Time limit of one command. Unit: seconds.
const MOST_SECS: u64 = 180;
/// Memory limit of one command. Unit: kilobytes.
const MOST_KB: u64 = 4_000_000;
/// A small campaign, in which the robot need not succeed.
const CONFIG: &str = "tests = [[\"Pick\"]]\ntest_count = 1\n[physics]\nsteps_per_second = 60\niterations = 1\n\
                      [objectSurface]\nobject_surfaces = [\"coffee_table\"]\n[pickObject]\nmodel_list = [\"glass\"]\n";
/// Commands that read or write the history of a project, which they find themselves.
const COMMANDS: [&[&str]; 13] = [
    &["list"],
    &["show", "@last"],
    &["analyse"],
    &["query", "--named", "failure-rates"],
    &["report", "--html", "out/r.html"],
    &["report", "--allure", "out/allure"],
    &["export", "tables", "out/csv", "--csv"],
    &["export", "rdf", "all.nq"],
    &["health", "--integrity"],
    &["merge", "configs/.actcheck", "--into", "out/all"],
    &["recheck"],
    &["check", "configs/c.toml"],
    &["run", "configs/c.toml", "--runs", "1", "-q"],
];

/// Runs a command with limits on time and memory. Returns `None` if it takes too long.
fn limited(folder: &Path, arguments: &[&str]) -> Option<Output> {
    let mut command = Command::new("sh");
    command.args([
        "-c",
        "ulimit -v \"$0\"; exec \"$@\"",
        &MOST_KB.to_string(),
        env!("CARGO_BIN_EXE_actcheck"),
    ]);
    command
        .args(arguments)
        .current_dir(folder)
        .env("NO_COLOR", "1")
        .stdin(Stdio::null());
    let mut child = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let started = Instant::now();
    // The output of these commands fits into a pipe.
    while child.try_wait().unwrap().is_none() {
        if started.elapsed() > Duration::from_secs(MOST_SECS) {
            child.kill().unwrap();
            child.wait().unwrap();
            return None;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    Some(child.wait_with_output().unwrap())
}

/// A command that ends in time, without a crash.
fn ended(folder: &Path, arguments: &[&str], place: &str) -> Output {
    let output =
        limited(folder, arguments).unwrap_or_else(|| panic!("{place}: {arguments:?} does not end"));
    let said = stderr(&output);
    assert!(
        output.status.code().is_some_and(|code| code <= 2),
        "{place}: {arguments:?}: {:?} {said}",
        output.status
    );
    assert!(!said.contains("panicked"), "{place}: {arguments:?}: {said}");
    output
}

/// Everything below a folder: content, or the target of a link; permissions, and the time of the
/// last change.
fn state(folder: &Path) -> BTreeMap<PathBuf, (Vec<u8>, u32, i64)> {
    let mut found = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let (path, data) = (entry.path(), entry.metadata().unwrap());
        if data.is_dir() {
            found.extend(state(&path));
        }
        let content = match data.file_type() {
            kind if kind.is_symlink() => std::fs::read_link(&path)
                .unwrap()
                .into_os_string()
                .into_encoded_bytes(),
            kind if kind.is_file() => std::fs::read(&path).unwrap(),
            _ => Vec::new(),
        };
        found.insert(path, (content, data.mode(), data.mtime_nsec()));
    }
    found
}

/// A project with a history, and a folder outside of it with precious files.
struct Stranger {
    folder: tempfile::TempDir,
}

impl Stranger {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let stranger = Self { folder };
        for part in ["proj/configs", "outside/inner", "outside/k"] {
            std::fs::create_dir_all(stranger.folder.path().join(part)).unwrap();
        }
        std::fs::write(stranger.project().join("configs/c.toml"), CONFIG).unwrap();
        for name in [
            "precious",
            "photo.tmp",
            "0001.runs",
            "0002.states",
            "campaign",
            "k/campaign",
            "k/0001.runs",
            "alive",
            "inner/mine",
            "old.parquet",
        ] {
            std::fs::write(stranger.outside().join(name), "precious").unwrap();
        }
        stranger
    }

    fn project(&self) -> PathBuf {
        self.folder.path().join("proj")
    }

    fn outside(&self) -> PathBuf {
        self.folder.path().join("outside")
    }

    fn history(&self) -> PathBuf {
        self.project().join("configs/.actcheck")
    }

    /// Puts a link in the place of a file or a folder of the project.
    fn link(&self, place: &str, target: &str) {
        let path = self.project().join(place);
        if path.is_dir() {
            std::fs::remove_dir_all(&path).unwrap();
        } else if path.exists() {
            std::fs::remove_file(&path).unwrap();
        }
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        symlink(self.outside().join(target), path).unwrap();
    }

    /// Checks that commands leave everything outside as it was. Returns their output.
    fn unchanged(&self, commands: &[&[&str]], place: &str) -> Vec<String> {
        let before = state(&self.outside());
        let said = commands.iter().map(|arguments| {
            let output = ended(&self.project(), arguments, place);
            assert_eq!(
                state(&self.outside()),
                before,
                "{place}: {arguments:?}: {}",
                stderr(&output)
            );
            format!(
                "{:?} {}{}",
                output.status.code(),
                stdout(&output),
                stderr(&output)
            )
        });
        said.collect()
    }
}

fn fifo(path: &Path) {
    let _ = std::fs::remove_file(path);
    assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
}

/// The first file below a folder whose name ends so.
fn named(folder: &Path, ending: &str) -> PathBuf {
    let found = all(folder).into_iter();
    let mut found = found.filter(|path| path.to_string_lossy().ends_with(ending));
    found
        .next()
        .unwrap_or_else(|| panic!("{} has no {ending}", folder.display()))
}

/// All files below a folder, sorted.
fn all(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        if entry.file_type().unwrap().is_dir() {
            found.extend(all(&entry.path()))
        } else {
            found.push(entry.path())
        }
    }
    found.sort();
    found
}

/// The folder of the only campaign of a history, relative to it.
fn campaign_of(history: &Path) -> String {
    let mut entries = std::fs::read_dir(history.join("campaigns")).unwrap();
    let name = entries.next().unwrap().unwrap().file_name();
    format!("campaigns/{}", name.to_string_lossy())
}

/// A history with every file of a campaign: a history of made runs, with a later judgement.
fn with_judgements(history: &Path) {
    copy_made_history(history);
    let history = History::open(history).unwrap();
    let judged = history.outcomes(&RunFilter::default()).unwrap().remove(0);
    let (run, property) = (judged.run, judged.property);
    let before = NewestJudgements::of(&history)
        .read(&run, judged.step, std::slice::from_ref(&property))
        .unwrap()
        .remove(0);
    let mut now = before.judgement.clone();
    now.rule_digest.push('2');
    let recheck = Recheck {
        run,
        step: 1,
        action: names::act("Pick"),
        before: Some(before),
        now,
    };
    history
        .commit_rechecks(&[recheck], "2026-08-09T00:00:00Z")
        .and_then(|()| history.finish_rechecks())
        .unwrap();
}

/// A pull request with a link in its history made `run` delete every file of the folder that it led
/// to.
#[test]
fn no_command_follows_a_link_of_a_history() {
    let made = tempfile::tempdir().unwrap();
    with_judgements(made.path());
    let campaign = campaign_of(made.path());
    let mut places = vec!["configs/.actcheck".to_owned()];
    let folders = ["campaigns", &campaign, "tables", "hulls", "sent"];
    places.extend(folders.map(|name| format!("configs/.actcheck/{name}")));
    for place in &places {
        let stranger = Stranger::new();
        copy(made.path(), &stranger.history());
        stranger.link(place, "");
        let said = stranger.unchanged(&COMMANDS, place);
        let code = if place.ends_with(".actcheck") {
            "H028"
        } else {
            "H027"
        };
        assert!(said[0].contains(code), "{place}: {}", said[0]);
    }
    let mut files = vec!["VERSION".to_owned(), "lock".to_owned()];
    files.extend(
        [
            "campaign",
            "0001.runs",
            "0001.details",
            "0001.states",
            "0001.motion",
        ]
        .map(|name| format!("{campaign}/{name}")),
    );
    files.push(relative(&named(made.path(), ".judgements"), made.path()));
    for name in &files {
        let stranger = Stranger::new();
        copy(made.path(), &stranger.history());
        assert!(stranger.history().join(name).exists(), "{name}");
        stranger.link(&format!("configs/.actcheck/{name}"), "precious");
        let said = stranger.unchanged(&COMMANDS, name);
        assert!(said[0].contains("H027"), "{name}: {}", said[0]);
    }
    // A folder of its own, with nothing but a version and links, as in a small pull request.
    let stranger = Stranger::new();
    std::fs::create_dir(stranger.history()).unwrap();
    std::fs::write(stranger.history().join("VERSION"), "actcheck history 7\n").unwrap();
    stranger.link("configs/.actcheck/campaigns", "");
    assert!(stranger.unchanged(&COMMANDS, "only campaigns")[12].contains("H027"));
}

/// A path relative to a folder, as text.
fn relative(path: &Path, folder: &Path) -> String {
    path.strip_prefix(folder).unwrap().display().to_string()
}

/// Files that are read one by one, and those that writers create, replace or append to.
#[test]
fn links_in_place_of_single_files_are_neither_followed_nor_written_through() {
    let made = tempfile::tempdir().unwrap();
    with_judgements(made.path());
    let campaign = campaign_of(made.path());
    let of_campaign = |name: &str| format!("{campaign}/{name}");
    for (place, target) in [
        // Segments that the next processes would create, and another campaign.
        (of_campaign("0002.runs"), "0001.runs"),
        (of_campaign("0002.states"), "0002.states"),
        (of_campaign("0003.runs"), "precious"),
        (of_campaign("0003.details"), "precious"),
        (of_campaign("0003.judgements"), "precious"),
        (of_campaign("0009.motion"), "precious"),
        (of_campaign("campaign.1-1.tmp"), "photo.tmp"),
        ("campaigns/link".to_owned(), "k"),
        ("campaigns/k/campaign".to_owned(), "campaign"),
        ("tables/FILES".to_owned(), "precious"),
        ("tables/SCHEMA".to_owned(), "precious"),
        ("tables/RECHECKED".to_owned(), "precious"),
        ("tables/k.000000.x.parquet".to_owned(), "old.parquet"),
        ("hulls/x.hulls".to_owned(), "precious"),
        ("campaigns.link".to_owned(), "inner"),
    ] {
        let stranger = Stranger::new();
        copy(made.path(), &stranger.history());
        stranger.link(&format!("configs/.actcheck/{place}"), target);
        stranger.unchanged(&COMMANDS, &place);
    }
}

/// The folder of a history may be a link if the user says so.
#[test]
fn a_link_that_the_user_names_is_followed() {
    let stranger = Stranger::new();
    copy_made_history(&stranger.folder.path().join("elsewhere"));
    symlink("../../elsewhere", stranger.history()).unwrap();
    let said = actcheck(&stranger.project(), &["list"]);
    assert!(
        stderr(&said).contains("H028") && stderr(&said).contains("--history configs/.actcheck"),
        "{}",
        stderr(&said)
    );
    let said = actcheck(
        &stranger.project(),
        &["list", "--history", "configs/.actcheck"],
    );
    assert_eq!(said.status.code(), Some(0), "{}", stderr(&said));
    let run = [
        "run",
        "configs/c.toml",
        "--runs",
        "1",
        "--history",
        "configs/.actcheck",
        "-q",
    ];
    assert!(
        actcheck(&stranger.project(), &run)
            .status
            .code()
            .is_some_and(|code| code < 2)
    );
    // A folder on the way, named by the configuration.
    let stranger = Stranger::new();
    std::fs::write(
        stranger.project().join("configs/c.toml"),
        format!("{CONFIG}[history]\ndir = \"../deep/h\"\n"),
    )
    .unwrap();
    stranger.link("deep", "");
    let said = stranger.unchanged(&[&["run", "configs/c.toml", "--runs", "1", "-q"]], "deep");
    assert!(
        said[0].contains("H028") && said[0].contains("`deep` is a link"),
        "{}",
        said[0]
    );
}

/// `launch` emptied the files that `lock` and `locks/N` led to, and appended to those of
/// `logs/N.log`.
#[test]
fn launch_follows_no_link() {
    let launch: &[&str] = &[
        "launch",
        "configs/c.toml",
        "--shards",
        "2",
        "--runs",
        "2",
        "-q",
    ];
    for (place, target) in [
        ("", ""),
        ("/lock", "precious"),
        ("/plan.json", "precious"),
        ("/job.json", "precious"),
        ("/locks", "inner"),
        ("/locks/1", "precious"),
        ("/logs", "inner"),
        ("/logs/2.log", "precious"),
        ("/done/1", "precious"),
        ("/faults", "inner"),
        ("/shards", "inner"),
        ("/shards/1", "inner"),
        ("/shards/1/campaigns", "inner"),
    ] {
        let stranger = Stranger::new();
        stranger.link(&format!("configs/.actcheck.launch{place}"), target);
        let said = stranger.unchanged(&[launch], place);
        assert!(
            said[0].contains("X073") || said[0].contains("H027"),
            "{place}: {}",
            said[0]
        );
    }
    // The remains of a launch that was killed at its end: only its own files go.
    let stranger = Stranger::new();
    let merged = stranger.project().join("configs/.actcheck.launch.merged");
    std::fs::create_dir_all(merged.join("logs")).unwrap();
    std::fs::write(merged.join("logs/1.log"), "").unwrap();
    std::fs::write(merged.join("mine.txt"), "mine").unwrap();
    stranger.link("configs/.actcheck.launch.merged/link", "inner");
    let said = stranger.unchanged(&[launch], "merged");
    assert!(
        said[0].contains("X073") && said[0].contains("remain"),
        "{}",
        said[0]
    );
    assert!(merged.join("mine.txt").exists() && !merged.join("logs").exists());
    assert!(!stranger.project().join("configs/.actcheck.launch").exists());
}

/// Files that others have put into a folder of a history stay.
#[test]
fn only_files_of_the_program_are_deleted() {
    let stranger = Stranger::new();
    copy_made_history(&stranger.history());
    let campaign = campaign_of(&stranger.history());
    let mine = [
        "notes.txt".to_owned(),
        format!("{campaign}/notes.txt"),
        format!("{campaign}/notes.tmp"),
        format!("{campaign}/notes.runs"),
        "tables/mine.parquet".to_owned(),
        "tables/notes.tmp".to_owned(),
    ];
    for name in &mine {
        let path = stranger.history().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, "mine").unwrap();
    }
    for arguments in [COMMANDS[12], COMMANDS[6], COMMANDS[10], COMMANDS[2]] {
        ended(&stranger.project(), arguments, "mine");
    }
    for name in &mine {
        assert_eq!(
            std::fs::read_to_string(stranger.history().join(name)).unwrap(),
            "mine",
            "{name}"
        );
    }
}

/// Output folders may be prepared by others, too: with links under the names of the files that will
/// be written.
#[test]
fn files_in_output_folders_are_not_written_through_links() {
    let stranger = Stranger::new();
    copy_made_history(&stranger.history());
    for name in [
        "out/outcomes.csv",
        "out/schema.json",
        "out.schema.json",
        "out/actcheck.1",
        "out/outcomes.parquet",
        "out/actions.parquet",
    ] {
        stranger.link(name, "precious");
    }
    let said = stranger.unchanged(
        &[
            &["export", "tables", "out", "--csv"],
            &["export", "tables", "out", "--dataset"],
            &["new", "man", "--out", "out"],
            &["export", "tables", "out"],
        ],
        "out",
    );
    assert!(
        said[0].starts_with("Some(0)") && said[2].starts_with("Some(0)"),
        "{said:?}"
    );
    assert!(
        stranger
            .project()
            .join("out/outcomes.csv")
            .symlink_metadata()
            .unwrap()
            .is_file()
    );
    // A folder of results that leads elsewhere.
    stranger.link("tables/outcomes", "inner");
    stranger.link("regressions", "inner");
    stranger.link("configs/regressions", "inner");
    stranger.link("rules", "inner");
    stranger.link("ontology/actions.ttl", "precious");
    let said = stranger.unchanged(
        &[
            &["export", "tables", "tables"],
            &["new", "property", "Upright", "--for", "Pick"],
            &["new", "campaign", "mine", "--with", "ontology"],
            &["export", "run", "@last", "--regression"],
        ],
        "folders",
    );
    // The history names a configuration elsewhere.
    assert!(said[3].contains("X084"), "{}", said[3]);
    std::fs::remove_dir_all(stranger.project().join("ontology")).unwrap();
    // The user may name a link as the file itself.
    std::fs::write(stranger.project().join("r.html"), "old").unwrap();
    symlink("r.html", stranger.project().join("link.html")).unwrap();
    let said = actcheck(&stranger.project(), &["report", "--html", "link.html"]);
    let written = std::fs::read_to_string(stranger.project().join("r.html")).unwrap();
    assert!(written.contains("<html"), "{}", stderr(&said));
}

/// A history in which a file is a pipe, a device or a link to one stopped every command, or filled
/// the memory.
#[test]
fn pipes_and_devices_in_a_history_are_refused() {
    let made = tempfile::tempdir().unwrap();
    with_judgements(made.path());
    let campaign = campaign_of(made.path());
    let names = [
        "lock".to_owned(),
        "VERSION".to_owned(),
        format!("{campaign}/campaign"),
        format!("{campaign}/0001.runs"),
        format!("{campaign}/0001.details"),
        format!("{campaign}/0001.states"),
        format!("{campaign}/0001.motion"),
        relative(&named(made.path(), ".judgements"), made.path()),
    ];
    let special_file = |name: &str, special: &str| {
        let stranger = Stranger::new();
        copy(made.path(), &stranger.history());
        let path = stranger.history().join(name);
        let _ = std::fs::remove_file(&path);
        if special == "pipe" {
            fifo(&path);
        } else {
            symlink(special, &path).unwrap();
        }
        stranger
    };
    for name in &names {
        for special in ["pipe", "/dev/zero"] {
            let stranger = special_file(name, special);
            for arguments in [COMMANDS[0], COMMANDS[10], COMMANDS[8], COMMANDS[12]] {
                let output = ended(&stranger.project(), arguments, name);
                assert!(
                    stderr(&output).contains("H027"),
                    "{name} {special} {arguments:?}: {}",
                    stderr(&output)
                );
            }
        }
    }
    for ending in [".parquet", "FILES", "SCHEMA"] {
        let stranger = Stranger::new();
        copy(made.path(), &stranger.history());
        fifo(&named(&stranger.history().join("tables"), ending));
        COMMANDS
            .iter()
            .for_each(|arguments| drop(ended(&stranger.project(), arguments, ending)));
    }
    for extension in ["runs", "details", "states"] {
        let stranger = Stranger::new();
        kept_as_outcomes(&stranger.history());
        fifo(&named(&stranger.history(), extension));
        COMMANDS
            .iter()
            .for_each(|arguments| drop(ended(&stranger.project(), arguments, "outcomes")));
    }
}

/// A sparse file takes no space on a disk, and all memory when it is read.
#[test]
fn huge_sparse_files_are_refused() {
    let made = tempfile::tempdir().unwrap();
    with_judgements(made.path());
    let mut names: Vec<String> = all(&made.path().join("campaigns"))
        .iter()
        .map(|file| relative(file, made.path()))
        .collect();
    names.extend(["VERSION", "lock", "tables/FILES", "tables/RECHECKED"].map(str::to_owned));
    names.push(relative(&named(made.path(), ".parquet"), made.path()));
    for name in &names {
        let stranger = Stranger::new();
        copy(made.path(), &stranger.history());
        let file = std::fs::File::options()
            .write(true)
            .create(true)
            .truncate(false)
            .open(stranger.history().join(name))
            .unwrap();
        file.set_len(1 << 40).unwrap();
        for arguments in [COMMANDS[0], COMMANDS[2], COMMANDS[8], COMMANDS[10]] {
            ended(&stranger.project(), arguments, name);
        }
    }
    // A header that claims the largest content, and its first bytes.
    for extension in ["runs", "details", "states", "motion", "judgements"] {
        let stranger = Stranger::new();
        copy(made.path(), &stranger.history());
        let path = named(&stranger.history(), extension);
        let bytes = std::fs::read(&path).unwrap();
        let (offset, size) = (frames::HEAD as u64, 1_u32 << 30);
        let (offset, size) = (offset.to_le_bytes(), size.to_le_bytes());
        let sum = frames::crc(&[&offset, &size, &[0; 4]]).to_le_bytes();
        let head = &bytes[..frames::HEAD];
        let written = [head, &size, &[0; 4], &sum, &[1; 60]].concat();
        std::fs::write(&path, written).unwrap();
        let file = std::fs::File::options().write(true).open(&path).unwrap();
        for length in [None, Some(1 << 40)] {
            if let Some(length) = length {
                file.set_len(length).unwrap();
            }
            for arguments in [COMMANDS[0], COMMANDS[2], COMMANDS[8], COMMANDS[10]] {
                ended(&stranger.project(), arguments, extension);
            }
        }
    }
    for name in ["c.toml", "ontology.ttl"] {
        let stranger = Stranger::new();
        let config = format!("ontology = \"ontology.ttl\"\n{CONFIG}");
        std::fs::write(stranger.project().join("configs/c.toml"), config).unwrap();
        let file = std::fs::File::create(stranger.project().join("configs").join(name)).unwrap();
        file.set_len(1 << 40).unwrap();
        let output = ended(&stranger.project(), COMMANDS[11], name);
        assert!(
            stderr(&output).contains("longer than"),
            "{}",
            stderr(&output)
        );
    }
}

/// A history of six runs that are kept as outcomes.
fn kept_as_outcomes(history: &Path) {
    let history = History::open(history).unwrap();
    history.begin_campaign(&sample_campaign("k", 0)).unwrap();
    (0..6).for_each(|index| history.commit_outcomes(&sample_run("k", index)).unwrap());
}

/// A bomb in place of the values of a run, whose frames begin with the index of the run, and with
/// the distance to the frame that is their dictionary: 0 for none.
fn about_run(extension: &str, content: &[u8], bomb: &[u8]) -> Vec<u8> {
    if !["details", "states", "motion"].contains(&extension) {
        return bomb.to_vec();
    }
    let index = content.iter().position(|byte| byte & 0x80 == 0).unwrap();
    [&content[..=index], &[0], bomb].concat()
}

/// 262 kB of a history expanded to 8 GB.
#[test]
fn a_history_that_expands_a_thousand_times_is_refused() {
    let zeros = vec![0_u8; 256 << 20];
    let zstd = zstd::bulk::compress(&zeros, 1).unwrap();
    let mut deflated = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut deflated, &zeros).unwrap();
    let deflated = deflated.finish().unwrap();
    // The size that it has, one that is too small, one that is allowed, and none.
    let sized = |size: u64| {
        let mut bomb = Vec::new();
        frames::put_varint(&mut bomb, size);
        [bomb, zstd.clone()].concat()
    };
    let bombs = [
        sized(zeros.len() as u64),
        sized(100),
        sized(30 << 20),
        sized(u64::MAX),
        zstd.clone(),
        deflated,
    ];
    let made = tempfile::tempdir().unwrap();
    with_judgements(made.path());
    // The last run has the place of the bomb in its column, so that it is read.
    let runs_file = named(made.path(), "0001.runs");
    let runs = std::fs::read(&runs_file).unwrap();
    let rows = History::open_to_read(made.path())
        .unwrap()
        .runs(&RunFilter::default())
        .unwrap();
    for extension in [
        "details",
        "states",
        "motion",
        "judgements",
        "runs",
        "campaign",
    ] {
        let file = named(made.path(), extension);
        let bytes = std::fs::read(&file).unwrap();
        for (number, bomb) in bombs.iter().enumerate() {
            let place = format!("bomb {number} in {extension}");
            let stranger = Stranger::new();
            copy(made.path(), &stranger.history());
            let mut contents = frames::contents(&bytes);
            let count = contents.len();
            let bomb = about_run(extension, contents[count - 1], bomb);
            contents[count - 1] = &bomb;
            if extension == "campaign" {
                // It has two equal copies.
                contents = vec![bomb.as_slice(); 2];
            }
            let written = frames::file(&bytes, &contents);
            let at = |file: &Path| stranger.history().join(relative(file, made.path()));
            std::fs::write(at(&file), &written).unwrap();
            if ["details", "states", "motion"].contains(&extension) {
                let repointed = frames::repointed(&runs, &bytes, &written);
                assert!(repointed != runs, "{place}: no run has the frame's place");
                std::fs::write(at(&runs_file), repointed).unwrap();
            }
            // The tables are made again.
            let _ = std::fs::remove_dir_all(stranger.history().join("tables"));
            let project = stranger.project();
            if number == 0 {
                for arguments in [COMMANDS[0], COMMANDS[2], COMMANDS[7]] {
                    ended(&project, arguments, &place);
                }
                for row in &rows {
                    ended(&project, &["show", &row.run, "--picture", "p.svg"], &place);
                }
            }
            for arguments in [COMMANDS[6], COMMANDS[10]] {
                ended(&project, arguments, &place);
            }
            let output = ended(&project, COMMANDS[8], &place);
            let said = stdout(&output) + &stderr(&output);
            assert!(
                output.status.code() != Some(0) && said.contains(extension),
                "{place}: {said}"
            );
            // Salvaging reads columns without the list of runs.
            std::fs::write(at(&runs_file), &runs[..frames::HEAD]).unwrap();
            let salvage = ["merge", "--salvage", "configs/.actcheck", "--into", "saved"];
            ended(&project, &salvage, &place);
        }
    }
    // The first frame of a column is needed to expand the others.
    for extension in ["details", "states"] {
        let stranger = Stranger::new();
        kept_as_outcomes(&stranger.history());
        let file = named(&stranger.history(), extension);
        let bytes = std::fs::read(&file).unwrap();
        let mut contents = frames::contents(&bytes);
        let bomb = about_run(extension, contents[0], &bombs[0]);
        contents[0] = &bomb;
        let written = frames::file(&bytes, &contents);
        let runs_file = named(&stranger.history(), "runs");
        let runs = std::fs::read(&runs_file).unwrap();
        std::fs::write(&runs_file, frames::repointed(&runs, &bytes, &written)).unwrap();
        std::fs::write(&file, written).unwrap();
        for arguments in [
            COMMANDS[0],
            &["show", "k-1"],
            &["show", "k-6"],
            COMMANDS[10],
        ] {
            ended(&stranger.project(), arguments, extension);
        }
        let output = ended(&stranger.project(), COMMANDS[8], extension);
        assert_ne!(
            output.status.code(),
            Some(0),
            "{extension}: {}{}",
            stdout(&output),
            stderr(&output)
        );
    }
}

/// Pipes, devices and links in place of any file of the project: configuration, ontology, rules,
/// models, regressions.
#[test]
fn a_project_of_pipes_ends_every_command() {
    let folder = project_with("[physics]\n");
    for name in [
        "configs/quick.toml",
        "ontology/actions.ttl",
        "rules/close_object.rls",
        "models/objects/glass.toml",
    ] {
        let path = folder.path().join(name);
        let text = std::fs::read(&path);
        for special in ["pipe", "/dev/zero"] {
            let _ = std::fs::remove_file(&path);
            if special == "pipe" {
                fifo(&path);
            } else {
                symlink(special, &path).unwrap();
            }
            for arguments in [
                &["check", "configs/quick.toml"][..],
                &["run", "configs/quick.toml", "--runs", "1"],
            ] {
                ended(folder.path(), arguments, name);
            }
            std::fs::remove_file(&path).unwrap();
        }
        if let Ok(text) = text {
            std::fs::write(&path, text).unwrap();
        }
    }
    std::fs::create_dir_all(folder.path().join("configs/regressions")).unwrap();
    fifo(&folder.path().join("configs/regressions/theirs.toml"));
    ended(
        folder.path(),
        &["run", "configs/quick.toml", "--runs", "1"],
        "regressions",
    );
}

/// A newest campaign that began in the future by a wrong clock remained the newest for ever.
#[test]
fn the_newest_campaign_is_the_last_one_whatever_the_clock() {
    let folder = tempfile::tempdir().unwrap();
    let history = History::open(&folder.path().join("h")).unwrap();
    let ahead = actcheck::history::CampaignRecord {
        started: "2099-01-01T00:00:00Z".to_owned(),
        ..sample_campaign("a", 0)
    };
    history.begin_campaign(&ahead).unwrap();
    history.commit(&sample_run("a", 0)).unwrap();
    history.begin_campaign(&sample_campaign("b", 1)).unwrap();
    history.commit(&sample_run("b", 1)).unwrap();
    let ids: Vec<String> = history
        .campaigns()
        .unwrap()
        .into_iter()
        .map(|row| row.id)
        .collect();
    assert_eq!(ids, ["a", "b"]);
    assert_eq!(history.resolve("@last").unwrap(), "b-2");
    drop(history);
    // Also after a merge.
    let merged = actcheck(folder.path(), &["merge", "h", "--into", "all"]);
    assert_eq!(merged.status.code(), Some(0), "{}", stderr(&merged));
    std::fs::write(folder.path().join("c.toml"), CONFIG).unwrap();
    let output = actcheck(
        folder.path(),
        &["run", "c.toml", "--history", "h", "--runs", "1", "-q"],
    );
    assert!(
        stderr(&output).contains("H032") && stderr(&output).contains("2099-01-01"),
        "{}",
        stderr(&output)
    );
    let history = History::open_to_read(&folder.path().join("h")).unwrap();
    assert_eq!(history.campaigns().unwrap().len(), 3);
    assert!(history.campaigns().unwrap()[2].started.starts_with("20"));
    assert_eq!(history.campaigns().unwrap()[0].id, "a");
}

/// A file cut short showed two of seven reported runs, and passed the examination.
#[test]
fn a_list_of_runs_that_lost_its_end_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let (live, left) = (folder.path().join("live"), folder.path().join("left"));
    let history = History::open(&live).unwrap();
    history.begin_campaign(&sample_campaign("k", 0)).unwrap();
    let list = |history: &Path| history.join("campaigns/k/0001.runs");
    let size = || std::fs::metadata(list(&live)).map_or(0, |data| data.len());
    let mut ends = vec![size()];
    for index in 0..7 {
        history.commit(&sample_run("k", index)).unwrap();
        ends.push(size());
    }
    copy(&live, &left);
    let said = actcheck(folder.path(), &["list", "--history", "left"]);
    assert!(
        said.status.success() && !stderr(&said).contains("H029"),
        "{}",
        stderr(&said)
    );
    let intact = actcheck(
        folder.path(),
        &["health", "--integrity", "--history", "left"],
    );
    assert_eq!(
        intact.status.code(),
        Some(0),
        "{}{}",
        stdout(&intact),
        stderr(&intact)
    );
    // Within a frame, at the end of one, empty, and gone.
    for length in [
        Some(ends[2] + 10),
        Some(ends[7] - 1),
        Some(ends[3]),
        Some(0),
        None,
    ] {
        let cut = folder.path().join("cut");
        let _ = std::fs::remove_dir_all(&cut);
        copy(&left, &cut);
        match length {
            Some(length) => {
                std::fs::File::options()
                    .write(true)
                    .open(list(&cut))
                    .unwrap()
                    .set_len(length)
                    .unwrap();
            }
            None => std::fs::remove_file(list(&cut)).unwrap(),
        }
        let said = actcheck(folder.path(), &["list", "--history", "cut"]);
        assert!(
            stderr(&said).contains("H029"),
            "{length:?}: {}{}",
            stdout(&said),
            stderr(&said)
        );
        let said = actcheck(
            folder.path(),
            &["health", "--integrity", "--history", "cut"],
        );
        // The last run may be one that a killed process was writing, and did not report.
        let is_lost = length != Some(ends[7] - 1);
        assert!(
            said.status.code() == Some(1) || !is_lost,
            "{length:?}: {}{}",
            stdout(&said),
            stderr(&said)
        );
        assert!(
            (stdout(&said) + &stderr(&said)).contains("0001.runs"),
            "{length:?}: {}",
            stdout(&said)
        );
        // Salvaging finds the runs without the list.
        let salvage = ["merge", "--salvage", "cut", "--into", "saved"];
        let saved = actcheck(folder.path(), &salvage);
        assert!(
            saved.status.code().is_some_and(|code| code < 2),
            "{length:?}: {}",
            stderr(&saved)
        );
        let saved = folder.path().join("saved");
        assert_eq!(History::count_runs(&saved), 7, "{length:?}");
        std::fs::remove_dir_all(saved).unwrap();
        let said = actcheck(folder.path(), &["recheck", "--history", "cut"]);
        assert!(
            stderr(&said).contains("H029"),
            "{length:?}: {}",
            stderr(&said)
        );
    }
}

/// A history that was merged from shards, or whose runs are partly kept as outcomes, has its rows in
/// another order than its tables.
#[test]
fn another_order_of_rows_is_not_damage() {
    let folder = project_with("[physics]\nsteps_per_second = 60\niterations = 1\n");
    let here = folder.path();
    let text = std::fs::read_to_string(here.join("configs/pick.toml")).unwrap();
    std::fs::write(
        here.join("configs/f.toml"),
        format!("{text}\n[history]\nkeep = \"failures\"\n"),
    )
    .unwrap();
    for shard in ["1", "2"] {
        let part = format!("{shard}/2");
        let run = [
            "run",
            "configs/f.toml",
            "--runs",
            "8",
            "--shard",
            &part,
            "--history",
            shard,
            "-q",
        ];
        let output = actcheck(here, &run);
        assert!(
            output.status.code().is_some_and(|code| code < 2),
            "{}",
            stderr(&output)
        );
    }
    let merged = actcheck(here, &["merge", "1", "2", "--into", "all"]);
    assert!(
        merged.status.code().is_some_and(|code| code < 2),
        "{}",
        stderr(&merged)
    );
    for history in ["1", "2", "all"] {
        assert!(
            actcheck(here, &["analyse", "--history", history])
                .status
                .success()
        );
        let output = actcheck(here, &["health", "--integrity", "--history", history]);
        assert_eq!(
            output.status.code(),
            Some(0),
            "{history}: {}{}",
            stdout(&output),
            stderr(&output)
        );
    }
}
