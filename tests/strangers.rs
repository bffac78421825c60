//! Files from others: a history, a case, a model or an ontology can't write outside of its folder,
//! start a program unasked, or exhaust time or memory.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use actcheck::base::{Diagnostics, Files, Source};
use actcheck::config::{self, Overrides};
use actcheck::history::{CampaignRecord, History};
use actcheck::ontology;

use crate::fuzz_corpus::entrances::frames;
use crate::history::{sample_campaign, sample_run};
use crate::support::{actcheck, copy, script, signal, stderr, stdout};

/// The diagnostics of a program that refuses its input.
fn refused(folder: &Path, arguments: &[&str]) -> String {
    let output = actcheck(folder, arguments);
    assert_eq!(
        output.status.code(),
        Some(2),
        "{arguments:?}: {}{}",
        stdout(&output),
        stderr(&output)
    );
    stderr(&output)
        .split_whitespace()
        .filter(|word| *word != "│")
        .collect::<Vec<_>>()
        .join(" ")
}

/// Every file below a folder, sorted.
fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path))
        } else {
            found.push(path)
        }
    }
    found.sort();
    found
}

/// Gives a campaign another id of the same length: the name of its folder, and the text in its
/// record if it is there. Returns whether anything has changed.
fn rename_campaign(history: &Path, from: &str, to: &str) -> bool {
    let campaigns = history.join("campaigns");
    let file = campaigns.join(from).join("campaign");
    let bytes = std::fs::read(&file).unwrap();
    assert_eq!(from.len(), to.len());
    let renamed: Vec<Vec<u8>> = frames::contents(&bytes)
        .iter()
        .map(|content| {
            let mut content = content.to_vec();
            for at in 0..content.len().saturating_sub(from.len() - 1) {
                if content[at..].starts_with(from.as_bytes()) {
                    content[at..at + to.len()].copy_from_slice(to.as_bytes());
                }
            }
            content
        })
        .collect();
    let written = frames::file(&bytes, &renamed);
    let has_id = written != bytes;
    std::fs::write(&file, written).unwrap();
    // A name with a slash can't be that of a folder.
    if !to.contains('/') {
        std::fs::rename(campaigns.join(from), campaigns.join(to)).unwrap();
    }
    has_id || !to.contains('/')
}

/// `merge` named a run's file after the campaign's id in the source, wherever that led.
#[test]
fn an_id_of_a_foreign_history_does_not_lead_out_of_a_folder() {
    let made = tempfile::tempdir().unwrap();
    {
        let history = History::open(&made.path().join("theirs")).unwrap();
        history
            .begin_campaign(&sample_campaign("campaignxx", 1))
            .unwrap();
        history.commit(&sample_run("campaignxx", 0)).unwrap();
        for id in ["../../../x", "..", ".", "", "a/b", "a b", "a\u{0}"] {
            let odd = CampaignRecord {
                id: id.to_owned(),
                ..sample_campaign("c2", 2)
            };
            let found = history.begin_campaign(&odd).unwrap_err();
            assert!(found.to_string().contains("H026"), "{found}");
        }
    }
    // The record names another folder than its own; a folder has a name that is not an id.
    for id in ["../../../x", "campaign y", "..campaign", "\u{1b}[2Jmpaign"] {
        let folder = tempfile::tempdir().unwrap();
        let inside = folder.path().join("in/side");
        copy(made.path(), &inside);
        if !rename_campaign(&inside.join("theirs"), "campaignxx", id) {
            continue;
        }
        let before: Vec<PathBuf> = files(folder.path())
            .into_iter()
            .filter(|file| !file.starts_with(&inside))
            .collect();
        let run = format!("{id}-1");
        for arguments in [
            &["merge", "theirs", "--into", "ours"][..],
            &["list", "--history", "theirs"],
            &["analyse", "--history", "theirs"],
            &["report", "--history", "theirs", "--html", "r.html"],
            &[
                "export",
                "run",
                &run,
                "-o",
                "case.toml",
                "--history",
                "theirs",
            ],
            &["run", "--resume", "--history", "theirs"],
            &["recheck", "--history", "theirs"],
        ] {
            let said = refused(&inside, arguments);
            // A record that names another folder may be damage.
            let is_refused = said.contains("H026") || id.contains('/') && said.contains("H007");
            let is_named = said.contains(id) || id.contains('\u{1b}');
            assert!(is_refused && is_named, "{id:?} {arguments:?}: {said}");
        }
        let after: Vec<PathBuf> = files(folder.path())
            .into_iter()
            .filter(|file| !file.starts_with(&inside))
            .collect();
        assert_eq!(before, after);
    }
}

/// A campaign of one run, with the program `launcher`, or the reference skills if it is empty.
fn campaign(folder: &Path, launcher: &str, more: &str) {
    let launcher = if launcher.is_empty() {
        String::new()
    } else {
        format!("test_launcher = \"{launcher}\"\n")
    };
    let text = format!(
        "tests = [[\"Pick\"]]\ntest_count = 1\n{launcher}[physics]\nsteps_per_second = 60\niterations = 1\n\
         [objectSurface]\nobject_surfaces = [\"coffee_table\"]\n[pickObject]\nmodel_list = [\"glass\"]\n{more}"
    );
    std::fs::write(folder.join("c.toml"), text).unwrap();
}

/// A folder with a campaign, and a program that leaves a mark when it is started.
fn with_marker() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    script(
        &folder.path().join("mark.sh"),
        "#!/bin/sh\ntouch \"$(dirname \"$0\")/mark\"\n",
    );
    std::fs::create_dir(folder.path().join("regressions")).unwrap();
    folder
}

/// A pull request with a file below `regressions/` ran its program on the machine that tests the
/// request.
#[test]
fn a_case_starts_the_program_that_it_names_only_alone_and_with_consent() {
    let folder = with_marker();
    let (here, mark) = (folder.path(), folder.path().join("mark"));
    campaign(here, "../mark.sh", "[case]\nchoices = {}\n");
    std::fs::rename(here.join("c.toml"), here.join("regressions/theirs.toml")).unwrap();
    let alone = ["run", "regressions/theirs.toml", "--history", "h"];
    let said = refused(here, &alone);
    let place = "regressions/theirs.toml:3:1";
    assert!(
        said.contains("X059")
            && said.contains(place)
            && said.contains("mark.sh")
            && said.contains("--trust"),
        "{said}"
    );
    // As a regression it is performed by the campaign's own skills, whatever it names.
    script(
        &here.join("other.sh"),
        "#!/bin/sh\ntouch \"$(dirname \"$0\")/other\"\n",
    );
    for own in ["", "./other.sh"] {
        campaign(here, own, "");
        let checked = actcheck(here, &["check", "c.toml"]);
        assert_eq!(checked.status.code(), Some(0), "{}", stderr(&checked));
        for more in [&[][..], &["--trust"]] {
            let output = actcheck(here, &[&["run", "c.toml", "--history", "h"], more].concat());
            assert!(
                stdout(&output).contains("regressions: 1 ran"),
                "{}{}",
                stdout(&output),
                stderr(&output)
            );
        }
    }
    assert!(here.join("other").exists() && !mark.exists());
    let output = actcheck(here, &[&alone[..], &["--trust"]].concat());
    assert!(
        mark.exists() && !stderr(&output).contains("X059"),
        "{}",
        stderr(&output)
    );
}

/// The configuration in a history names a program too, which `replay` and `shrink` start.
#[test]
fn a_program_of_a_history_without_its_configuration_needs_consent() {
    let folder = with_marker();
    let (here, mark) = (folder.path(), folder.path().join("mark"));
    campaign(here, "./mark.sh", "");
    let output = actcheck(
        here,
        &["run", "c.toml", "--history", "h", "--format", "csv"],
    );
    let run = stdout(&output)
        .lines()
        .nth(1)
        .unwrap()
        .split(',')
        .next()
        .unwrap()
        .to_owned();
    std::fs::remove_file(&mark).unwrap();
    // The same program in the configuration.
    actcheck(here, &["replay", &run, "--history", "h"]);
    assert!(mark.exists());
    std::fs::remove_file(&mark).unwrap();
    campaign(here, "", "");
    for command in ["replay", "shrink"] {
        let said = refused(here, &[command, &run, "--history", "h"]);
        assert!(
            said.contains("X059") && said.contains("mark.sh"),
            "{command}: {said}"
        );
    }
    assert!(!mark.exists());
    actcheck(
        here,
        &["replay", &run, "--history", "h", "--config", "c.toml"],
    );
    assert!(!mark.exists());
    actcheck(here, &["replay", &run, "--history", "h", "--trust"]);
    assert!(mark.exists());
}

/// Writes a model whose shape is the mesh at a URI, and returns the diagnostics of reading it.
fn said_of_mesh(folder: &Path, uri: &str) -> String {
    let model = folder.join("models/objects/lamp");
    std::fs::create_dir_all(&model).unwrap();
    let text = format!(
        "<sdf version=\"1.6\"><model name=\"lamp\"><link name=\"l\"><collision name=\"c\"><geometry><mesh><uri>{uri}</uri>\
         </mesh></geometry></collision></link></model></sdf>"
    );
    std::fs::write(model.join("model.sdf"), text).unwrap();
    said_of_config(
        folder,
        "model_dir = \"models\"\n[pickObject]\nmodel_list = [\"lamp\"]\n",
    )
}

fn said_of_config(folder: &Path, more: &str) -> String {
    let text = format!("tests = [[\"Pick\"]]\ntest_count = 1\n{more}");
    config::load_text(
        Source::new(folder.join("c.toml").display().to_string(), text),
        folder,
        &Overrides::default(),
    )
    .map_or_else(|found| found.to_string(), |_| String::new())
}

fn fifo(path: &Path) {
    let made = Command::new("mkfifo").arg(path).status().unwrap();
    assert!(made.success());
}

/// `file:///dev/zero` as a mesh took all memory, and a pipe waited for a writer for ever.
#[test]
fn devices_and_pipes_are_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe.stl");
    fifo(&pipe);
    for uri in ["file:///dev/zero", &format!("file://{}", pipe.display())] {
        let said = said_of_mesh(folder.path(), uri);
        assert!(
            said.contains("W037") && said.contains("it is a device or a pipe"),
            "{uri}: {said}"
        );
    }
    for (key, code) in [
        ("ontology", "C012"),
        ("[scene]\nrequire", "C022"),
        ("[robot]\nprofile", "C011"),
    ] {
        for file in ["/dev/zero", "pipe"] {
            let ending = if key.contains("require") {
                ".rls"
            } else {
                ".toml"
            };
            let path = folder.path().join(format!("odd{ending}"));
            let _ = std::fs::remove_file(&path);
            if file == "pipe" {
                fifo(&path)
            } else {
                std::os::unix::fs::symlink(file, &path).unwrap()
            }
            let said = said_of_config(folder.path(), &format!("{key} = \"odd{ending}\"\n"));
            assert!(
                said.contains(code) && said.contains("it is a device or a pipe"),
                "{key} {file}: {said}"
            );
        }
    }
    let history = folder.path().join("h");
    std::fs::create_dir(&history).unwrap();
    std::os::unix::fs::symlink("/dev/zero", history.join("VERSION")).unwrap();
    assert!(refused(folder.path(), &["list", "--history", "h"]).contains("H027"));
    let found = ontology::load(&Files::Disk, Path::new("/dev/zero"))
        .map(drop)
        .unwrap_err();
    assert!(
        found.to_string().contains("O001")
            && found.to_string().contains("it is a device or a pipe"),
        "{found}"
    );
}

/// Declarations of an entity that expands to 10⁹ words.
fn laughs() -> String {
    let mut text = "<!DOCTYPE a [<!ENTITY l0 \"lol\">".to_owned();
    for level in 1..10 {
        write!(
            text,
            "<!ENTITY l{level} \"{}\">",
            format!("&l{};", level - 1).repeat(10)
        )
        .unwrap();
    }
    text + "]>"
}

/// A tag with many attributes: parsers compare each with all others, or keep each as a namespace.
fn crowded(tag: &str, attribute: &str) -> String {
    let attributes: String = (0..30_000)
        .map(|number| format!(" {attribute}{number}=\"urn:x\""))
        .collect();
    format!("<{tag}{attributes}>")
}

#[test]
fn xml_that_grows_in_a_parser_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let rdf = "xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\" xmlns:rdfs=\"http://www.w3.org/2000/01/rdf-schema#\"";
    let bomb = format!(
        "{}<rdf:RDF {rdf}><rdf:Description rdfs:label=\"&l9;\"/></rdf:RDF>",
        laughs()
    );
    for (text, reason) in [
        (bomb, "the entity `l4` expands to more than 65536 bytes"),
        (
            crowded("rdf:RDF", "xmlns:n"),
            "more than 256 namespaces are declared around one element",
        ),
        (
            crowded("rdf:RDF", "a"),
            "an element has more than 256 attributes",
        ),
        ("<a>".repeat(100_000), "more than 10000 elements are nested"),
    ] {
        for name in ["o.owl", "o.rdf"] {
            let found = ontology::triples_of(
                &Source::new(name, format!("<?xml version=\"1.0\"?>{text}")),
                0,
            )
            .unwrap_err();
            assert!(
                found.to_string().contains("O013") && found.to_string().contains(reason),
                "{found}"
            );
        }
    }
    let objects = folder.path().join("models/objects");
    std::fs::create_dir_all(&objects).unwrap();
    let mesh = folder.path().join("m.dae");
    let uri = format!("file://{}", mesh.display());
    for (text, reason) in [
        (
            format!("{}<COLLADA>&l9;</COLLADA>", laughs()),
            "this XML is refused: the entity `l4` expands",
        ),
        (
            "<!DOCTYPE a [<!ENTITY l \"lol\">]><COLLADA>&l;</COLLADA>".to_owned(),
            "W031",
        ),
        (
            crowded("COLLADA", "a"),
            "this XML is refused: an element has more than 256 attributes",
        ),
        (
            crowded("COLLADA", "xmlns:n"),
            "this XML is refused: more than 256 namespaces",
        ),
        (
            "<COLLADA>".repeat(100_000),
            "this XML is refused: more than 10000 elements are nested",
        ),
    ] {
        std::fs::write(&mesh, &text).unwrap();
        let said = said_of_mesh(folder.path(), &uri);
        assert!(said.contains(reason), "{reason}: {said}");
        std::fs::write(objects.join("cup.urdf"), text).unwrap();
        let said = said_of_config(
            folder.path(),
            "model_dir = \"models\"\n[pickObject]\nmodel_list = [\"cup\"]\n",
        );
        assert!(said.contains(reason), "{reason}: {said}");
        std::fs::remove_file(objects.join("cup.urdf")).unwrap();
    }
    let links: String = (0..1_001)
        .map(|number| format!("<link name=\"l{number}\"/>"))
        .collect();
    std::fs::write(
        objects.join("cup.urdf"),
        format!("<robot name=\"r\">{links}</robot>"),
    )
    .unwrap();
    let said = said_of_config(
        folder.path(),
        "model_dir = \"models\"\n[pickObject]\nmodel_list = [\"cup\"]\n",
    );
    assert!(
        said.contains("W055") && said.contains("this model has more than 1000 `<link>`"),
        "{said}"
    );
}

/// A COLLADA file with one geometry, whose corners have an input at `offset`, and `instances` of
/// it.
fn collada(n_vertices: usize, n_triangles: usize, offset: &str, instances: usize) -> String {
    let positions: String = (0..3 * n_vertices)
        .map(|number| format!("{} ", (number * number) % 97))
        .collect();
    let corners: String = (0..3 * n_triangles)
        .map(|number| format!("{} ", number % n_vertices))
        .collect();
    format!(
        "<COLLADA><library_geometries><geometry id=\"g\"><mesh><source id=\"s\"><float_array>{positions}</float_array></source>\
         <vertices id=\"v\"><input semantic=\"POSITION\" source=\"#s\"/></vertices><triangles>\
         <input semantic=\"VERTEX\" source=\"#v\" offset=\"{offset}\"/><p>{corners}</p></triangles></mesh></geometry>\
         </library_geometries><library_visual_scenes><visual_scene id=\"x\"><node>{}</node></visual_scene>\
         </library_visual_scenes></COLLADA>",
        "<instance_geometry url=\"#g\"/>".repeat(instances)
    )
}

/// An offset of 2⁶⁴ − 1 overflowed, and each instance of a geometry was read and kept again.
#[test]
fn meshes_with_wrong_offsets_or_thousands_of_instances_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = folder.path().join("m.dae");
    let uri = format!("file://{}", mesh.display());
    for (text, reason) in [
        (
            collada(4, 4, "18446744073709551615", 1),
            "an `offset` must be a number from 0 to 255",
        ),
        (
            collada(4, 4, "-1", 1),
            "an `offset` must be a number from 0 to 255",
        ),
        (
            collada(3_000, 1, "0", 5_000),
            "its instances have more than 6000000 vertices",
        ),
        (
            collada(30, 1_000, "0", 5_000),
            "its instances have more than 2000000 triangles",
        ),
    ] {
        std::fs::write(&mesh, text).unwrap();
        let said = said_of_mesh(folder.path(), &uri);
        assert!(
            said.contains("W037") && said.contains(reason),
            "{reason}: {said}"
        );
    }
}

/// Whether a process runs: it is there, and not a zombie.
fn is_running(pid: &str) -> bool {
    let state = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    !state.is_empty() && !state.contains(") Z ")
}

/// Waits until a condition holds.
fn wait_for(what: &str, holds: impl Fn() -> bool) {
    let until = Instant::now() + Duration::from_secs(20);
    while !holds() {
        assert!(Instant::now() < until, "{what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// xacro ran on for 33 minutes after actcheck had been killed.
#[test]
fn xacro_ends_when_actcheck_is_killed() {
    let folder = tempfile::tempdir().unwrap();
    let (notes, tools) = (folder.path().join("pid"), folder.path().join("tools"));
    std::fs::create_dir(&tools).unwrap();
    std::fs::create_dir(&notes).unwrap();
    // It can write nothing into files, but create them.
    script(
        &tools.join("xacro"),
        &format!(
            "#!/bin/sh\n: > '{}'/$$\nwhile :; do sleep 5; done\n",
            notes.display()
        ),
    );
    let profile = std::fs::read_to_string("models/robots/fixed_arm.toml").unwrap();
    std::fs::write(
        folder.path().join("r.toml"),
        profile.replace("fixed_arm.urdf", "r.urdf.xacro"),
    )
    .unwrap();
    std::fs::write(folder.path().join("r.urdf.xacro"), "<robot/>").unwrap();
    campaign(folder.path(), "", "[robot]\nprofile = \"r.toml\"\n");
    let path = format!("{}:{}", tools.display(), std::env::var("PATH").unwrap());
    let mut command = Command::new(env!("CARGO_BIN_EXE_actcheck"));
    command
        .args(["check", "c.toml"])
        .current_dir(folder.path())
        .env("PATH", path)
        .stdout(Stdio::null());
    let mut running = command.stderr(Stdio::null()).spawn().unwrap();
    let noted = || {
        std::fs::read_dir(&notes)
            .unwrap()
            .next()
            .map(|entry| entry.unwrap().file_name())
    };
    wait_for("xacro is started", || noted().is_some());
    let pid = noted().unwrap().into_string().unwrap();
    assert!(is_running(&pid));
    signal(running.id(), "KILL");
    running.wait().unwrap();
    wait_for("xacro ends with actcheck", || !is_running(&pid));
}

/// Thousands of faults in one ontology took seconds to print.
#[test]
fn only_the_first_faults_of_thousands_are_printed() {
    let folder = tempfile::tempdir().unwrap();
    let parameters = "act:Pick act:hasParameter act:unknown .\n".repeat(1_000);
    let text = format!("@prefix act: <http://actions#> .\nact:Pick a act:Action .\n{parameters}");
    std::fs::write(folder.path().join("o.ttl"), text).unwrap();
    campaign(folder.path(), "", "");
    let config = std::fs::read_to_string(folder.path().join("c.toml")).unwrap();
    std::fs::write(
        folder.path().join("c.toml"),
        format!("ontology = \"o.ttl\"\n{config}"),
    )
    .unwrap();
    let said = refused(folder.path(), &["check", "c.toml"]);
    assert!(
        said.matches("O008").count() <= 200 && said.contains("more are not printed"),
        "{}",
        said.len()
    );
}

/// The rest of a longer list of faults is not reported, and faults still refuse the file.
#[test]
fn a_file_with_thousands_of_faults_reports_the_first() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(folder.path().join("models/objects")).unwrap();
    let links: String = (0..900)
        .map(|number| format!("<link name=\"l{number}\"><odd{number}/><collision/></link>"))
        .collect();
    std::fs::write(
        folder.path().join("models/objects/cup.urdf"),
        format!("<robot name=\"r\">{links}</robot>"),
    )
    .unwrap();
    let more = "tests = [[\"Pick\"]]\ntest_count = 1\nmodel_dir = \"models\"\n[pickObject]\nmodel_list = [\"cup\"]\n";
    let source = Source::new(folder.path().join("c.toml").display().to_string(), more);
    let found: Diagnostics = config::load_text(source, folder.path(), &Overrides::default())
        .map(drop)
        .unwrap_err();
    assert!(
        found.has_errors() && found.iter().count() <= 410,
        "{}",
        found.iter().count()
    );
}

/// `ontology = "/etc/passwd"` printed the lines of that file into the log of a build server.
#[test]
fn the_text_of_files_outside_of_the_project_is_not_printed() {
    let folder = tempfile::tempdir().unwrap();
    let project = folder.path().join("project");
    std::fs::create_dir_all(project.join("rules")).unwrap();
    let secret = folder.path().join("secret");
    std::fs::write(
        &secret,
        "user:correct horse battery staple:0\npassword = correct-horse\n\"correct horse\n",
    )
    .unwrap();
    std::os::unix::fs::symlink("../secret", project.join("link.ttl")).unwrap();
    std::fs::copy(&secret, folder.path().join("secret.toml")).unwrap();
    std::fs::copy(&secret, folder.path().join("secret.rls")).unwrap();
    for (key, path) in [
        ("ontology", secret.display().to_string()),
        ("ontology", "../secret".to_owned()),
        ("ontology", "link.ttl".to_owned()),
        ("[scene]\nrequire", "../secret.rls".to_owned()),
        ("[robot]\nprofile", "../secret.toml".to_owned()),
    ] {
        let text = format!("tests = [[\"Pick\"]]\ntest_count = 1\n{key} = \"{path}\"\n");
        std::fs::write(project.join("c.toml"), text).unwrap();
        for (at, config) in [
            (project.as_path(), "c.toml"),
            (folder.path(), "project/c.toml"),
        ] {
            let said = refused(at, &["check", config]);
            assert!(!said.contains("horse"), "{key} = {path}: {said}");
            assert!(
                said.contains("secret") || said.contains("link.ttl"),
                "the file is named: {said}"
            );
        }
    }
    // Excerpts of the project's own files are printed.
    std::fs::copy(&secret, project.join("own.ttl")).unwrap();
    std::fs::write(
        project.join("c.toml"),
        "ontology = \"own.ttl\"\ntests = [[\"Pick\"]]\ntest_count = 1\n",
    )
    .unwrap();
    assert!(refused(&project, &["check", "c.toml"]).contains("horse"));
}

/// With few open files, an intact history was reported as damaged.
#[test]
fn too_many_open_files_are_not_damage() {
    let folder = tempfile::tempdir().unwrap();
    {
        let history = History::open(&folder.path().join("h")).unwrap();
        history.begin_campaign(&sample_campaign("k", 1)).unwrap();
        (0..20).for_each(|index| history.commit(&sample_run("k", index)).unwrap());
    }
    let mut seen = 0;
    for limit in [4, 5, 6, 7, 8, 9, 10, 12, 16, 20, 24, 32, 48, 64, 96] {
        for command in [
            "list --history h",
            "analyse --history h",
            "health --integrity --history h",
        ] {
            let line = format!(
                "ulimit -n {limit}; exec '{}' {command}",
                env!("CARGO_BIN_EXE_actcheck")
            );
            let output = Command::new("sh")
                .args(["-c", &line])
                .current_dir(folder.path())
                .output()
                .unwrap();
            let said = stderr(&output);
            assert!(
                !said.contains("H007") && !said.contains("damage") && !said.contains("panicked"),
                "{limit} {command}: {said}"
            );
            seen += usize::from(said.contains("too many files are open"));
        }
    }
    assert!(seen > 0, "a limit was low enough");
    assert!(!folder.path().join("h/damaged").exists());
}

/// Values with control characters reached a terminal through a pipe, such as that of `less -R`.
#[test]
fn tables_for_people_have_no_control_characters_in_pipes() {
    let folder = tempfile::tempdir().unwrap();
    {
        let history = History::open(&folder.path().join("h")).unwrap();
        let mut campaign = sample_campaign("k", 1);
        campaign.name = "\u{1b}]0;title\u{7}\u{1b}[2Jname\u{202e}".to_owned();
        history.begin_campaign(&campaign).unwrap();
        history.commit(&sample_run("k", 0)).unwrap();
    }
    let ask = [
        "query",
        "SELECT ?c ?name { ?c a act:Campaign ; rdfs:label ?name }",
        "--history",
        "h",
    ];
    let text = stdout(&actcheck(folder.path(), &ask));
    assert!(
        text.contains("name") && !text.contains(['\u{1b}', '\u{7}', '\u{202e}']),
        "{text:?}"
    );
    let json = stdout(&actcheck(
        folder.path(),
        &[&ask[..], &["--format", "json"]].concat(),
    ));
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json[0]["name"], "\u{1b}]0;title\u{7}\u{1b}[2Jname\u{202e}");
}
