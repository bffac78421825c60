//! Imports of standalone programs: nothing of a file is lost in silence, and each stays within its
//! limits.

use std::path::Path;

use actcheck::base::{Diagnostics, Severity, Source, Term};
use actcheck::rules::Budget;
use actcheck::rules::standalone::{Closure, Engine, Loading, Program, run, run_as};
use tempfile::TempDir;

fn folder(files: &[(&str, &[u8])]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    folder
}

fn load(
    text: &str,
    folder: &Path,
    loading: &Loading,
) -> Result<(Closure, Diagnostics), Diagnostics> {
    let program = Program::load_as(&Source::new("p.rls", text), folder, loading)?;
    let closure = program.close(Engine::Fast, &Budget::default()).unwrap();
    Ok((closure, program.warnings))
}

fn lenient() -> Loading {
    Loading {
        lenient: true,
        ..Loading::default()
    }
}

fn shown(found: &Diagnostics) -> String {
    found
        .iter()
        .map(|d| format!("{} {}\n", d.code, d.message))
        .collect()
}

/// Imports `bytes` as `p` in strict mode, where it must fail with all of `words`, and in lenient
/// mode, where `rows` rows are left and a warning has the same words.
#[track_caller]
fn fails(name: &str, options: &str, bytes: &[u8], words: &[&str], rows: usize) {
    let folder = folder(&[(name, bytes)]);
    let format = match name.rsplit('.').next().unwrap() {
        "csv" => "csv",
        "tsv" => "tsv",
        _ => "rdf",
    };
    let text = format!("@import p :- {format}{{resource = \"{name}\"{options}}} .");
    let strict = load(&text, folder.path(), &Loading::default()).unwrap_err();
    let (closure, warnings) =
        load(&text, folder.path(), &lenient()).unwrap_or_else(|found| panic!("{found}"));
    assert_eq!(closure.count("p"), rows, "{}", shown(&warnings));
    for found in [&strict, &warnings] {
        let text = shown(found);
        for word in words.iter().chain(&["R074"]) {
            assert!(text.contains(word), "no {word:?} in: {text}");
        }
    }
    assert!(
        warnings
            .iter()
            .all(|found| found.severity == Severity::Warning)
    );
}

const ANY: &str = ", format = (any, any)";
const RDF: &str =
    "<rdf:RDF xmlns:rdf='http://www.w3.org/1999/02/22-rdf-syntax-ns#' xmlns='http://x#'>\n";

#[test]
fn faults_of_tables_are_errors_with_their_place() {
    fails(
        "t.csv",
        ANY,
        b"a,b\n\"c,d\ne,f\n",
        &[
            "t.csv:2:1: the quote that begins here has no end",
            "line 2 on",
        ],
        1,
    );
    fails(
        "t.csv",
        ANY,
        b"a,b\nc\nd,e,f\ng,h\n",
        &[
            "2 faults",
            "t.csv:2:1: 1 field instead of 2",
            "t.csv:3:5: 3",
        ],
        2,
    );
    fails(
        "t.csv",
        ANY,
        b"a,\"b\"@en\n",
        &["t.csv:1:3: text follows the closing quote of `b@en`"],
        1,
    );
    fails(
        "t.csv",
        ANY,
        b"\xe9,\"b\"\na,b\n",
        &["t.csv:1:1: the field is not UTF-8 text"],
        1,
    );
    fails(
        "t.csv",
        ", format = (int, double)",
        "1,2\né,3\n4,inf\n".as_bytes(),
        &["t.csv:2:1: `é` is not an int", "t.csv:3:3: `inf`"],
        1,
    );
    fails(
        "t.tsv",
        ", format = (any, skip)",
        b"a\tb\nc\n",
        &["t.tsv:2:1"],
        1,
    );
    fails(
        "t.csv",
        ANY,
        &b"a\n".repeat(9),
        &["9 faults", "t.csv:3:1", "and 6 more"],
        0,
    );
}

#[test]
fn faults_of_statements_are_errors_with_their_place() {
    let [one, two, three, four] =
        [1, 2, 3, 4].map(|n| format!("<http://x#a> <http://x#b> <http://x#c{n}>"));
    let lines = format!("{one} .\n{two}\n{three} .\nx\n");
    // Only the dot is missing in line 2, so its statement is read.
    fails(
        "t.nt",
        "",
        lines.as_bytes(),
        &["2 faults", "t.nt:3:1", "t.nt:4:1"],
        3,
    );
    fails(
        "t.nq",
        "",
        format!("{one} <http://g> .\n{two} <http://g").as_bytes(),
        &["2 faults", "t.nq:2:"],
        1,
    );
    let statements = format!("{one} .\n{two}, .\n{three}, 1.5 .\n{four}");
    fails(
        "t.ttl",
        "",
        statements.as_bytes(),
        &["2 faults", "t.ttl:2:", "t.ttl:4:"],
        3,
    );
    fails(
        "t.ttl",
        "",
        format!("{one} .\n<a> <http://x#b> 1 .").as_bytes(),
        &["t.ttl:2:1", "IRI"],
        1,
    );
    // The rest of the graph would be read as part of the default graph.
    let graph = format!("<http://x#g> {{ {one} .\n{two}, . \n {three}, 2 . }}");
    fails(
        "t.trig",
        "",
        graph.as_bytes(),
        &["t.trig:2:", "nothing is read from line 2 on"],
        2,
    );
    fails(
        "t.trig",
        "",
        format!("<http://x#g> {{ {one} .\n").as_bytes(),
        &["1 fault", "t.trig:"],
        1,
    );
}

#[test]
fn faults_of_xml_are_errors_with_their_place() {
    let node = "<rdf:Description rdf:about='http://x#a'>\n<b>1</b>\n</rdf:Description>\n";
    let words = [
        "nothing is read from",
        "the file ends inside `<rdf:RDF>` of line 1",
        "t.rdf:5:1",
    ];
    fails("t.rdf", "", format!("{RDF}{node}").as_bytes(), &words, 1);
    fails(
        "t.rdf",
        "",
        format!("{RDF}{node}<rdf:Desc").as_bytes(),
        &["t.rdf:5:2: the file ends inside a tag"],
        1,
    );
    fails(
        "t.rdf",
        "",
        format!("{RDF}{node}</rdf:X>").as_bytes(),
        &["t.rdf:5:2"],
        1,
    );
    fails(
        "t.rdf",
        "",
        format!("{RDF}{node}<b c='&no;'/></rdf:RDF>").as_bytes(),
        &["t.rdf:5:2"],
        1,
    );
    fails("t.rdf", "", b"", &["no XML element"], 0);
    let namespaces: String = (0..2000)
        .map(|n| format!(" xmlns:n{n}='http://x#'"))
        .collect();
    fails(
        "t.rdf",
        "",
        format!("<rdf:RDF{namespaces}/>").as_bytes(),
        &["t.rdf:1:2", "256"],
        0,
    );
    let bomb: String = (1..10)
        .map(|n| format!("<!ENTITY e{n} \"{}\">", format!("&e{};", n - 1).repeat(10)))
        .collect();
    let bomb = format!("<!DOCTYPE a [<!ENTITY e0 \"ha\">{bomb}]>\n{RDF}<b>&e9;</b></rdf:RDF>");
    fails(
        "t.rdf",
        "",
        bomb.as_bytes(),
        &[
            "t.rdf:1:2",
            "the entity `e4` expands to more than 65536 bytes",
        ],
        0,
    );
}

#[test]
fn utf_16_is_refused_and_a_byte_order_mark_of_utf_8_is_not_data() {
    let utf_16 = |text: &str| {
        text.encode_utf16()
            .flat_map(u16::to_le_bytes)
            .collect::<Vec<u8>>()
    };
    for (name, text) in [
        ("t.csv", "a,b\n"),
        ("t.nt", "<http://x> <http://y> <http://z> .\n"),
        ("t.rdf", RDF),
    ] {
        for bytes in [utf_16(text), utf_16(&format!("\u{feff}{text}"))] {
            let folder = folder(&[(name, &bytes)]);
            let text = match name {
                "t.csv" => {
                    "@import p :- csv{resource = \"t.csv\", format = (any, any)} .".to_owned()
                }
                _ => format!("@import p :- rdf{{resource = \"{name}\"}} ."),
            };
            let found = shown(&load(&text, folder.path(), &lenient()).unwrap_err());
            assert!(
                found.contains("R072") && found.contains("UTF-16"),
                "{found}"
            );
        }
    }
    let folder = folder(&[
        ("t.csv", "\u{feff}a,b\r\n".as_bytes()),
        (
            "t.nt",
            "\u{feff}<http://x> <http://y> <http://z> .".as_bytes(),
        ),
    ]);
    let text =
        "@import p :- csv{resource = \"t.csv\"} .\n@import q :- ntriples{resource = \"t.nt\"} .";
    let (closure, _) =
        load(text, folder.path(), &Loading::default()).unwrap_or_else(|found| panic!("{found}"));
    assert_eq!(closure.tuples("p"), [[Term::iri("a"), Term::iri("b")]]);
    assert_eq!(closure.count("q"), 1);
}

#[test]
fn options_that_do_not_exist_or_cannot_be_are_refused() {
    let folder = folder(&[("t.csv", b"1,2\n"), ("t.nt", b"")]);
    for (import, words) in [
        (
            "csv{resource = \"t.csv\", delimitre = \";\"}",
            "unknown option `delimitre`",
        ),
        (
            "csv{resource = \"t.csv\", base = \"http://x\"}",
            "an import of `csv` has no option `base`",
        ),
        (
            "ntriples{resource = \"t.nt\", delimiter = \";\"}",
            "an import of `ntriples` has no option `delimiter`",
        ),
        (
            "ntriples{resource = \"t.nt\", format = (any, any, any)}",
            "has no option `format`",
        ),
        (
            "csv{resource = \"t.csv\", limit = 1, limit = 2}",
            "`limit` is given twice",
        ),
        (
            "csv{resource = \"t.csv\", limit = -1}",
            "`limit` must be a number of rows, but is -1",
        ),
        (
            "csv{resource = \"t.csv\", limit = \"many\"}",
            "`limit` must be a number of rows",
        ),
        (
            "csv{resource = \"t.csv\", quoting = 1}",
            "`quoting` must be `true` or `false`, but is 1",
        ),
        (
            "csv{resource = \"t.csv\", ignore_headers = (true, false)}",
            "`ignore_headers` must be",
        ),
        (
            "csv{resource = \"t.csv\", delimiter = \"::\"}",
            "`delimiter` must be one character",
        ),
        (
            "csv{resource = \"t.csv\", delimiter = \"\"}",
            "`delimiter` must be one character",
        ),
        (
            "csv{resource = \"t.csv\", delimiter = \"§\"}",
            "`delimiter` must be one character",
        ),
        ("dsv{resource = \"t.csv\"}", "needs a `delimiter`"),
        (
            "csv{resource = \"t.csv\", compression = \"zip\"}",
            "unknown compression `zip`",
        ),
        (
            "csv{resource = \"t.csv\", format = (any, itn)}",
            "unknown column format `itn`",
        ),
        (
            "csv{resource = \"t.csv\", format = (skip, skip)}",
            "all columns are skipped",
        ),
        ("csv{resource = 7}", "`resource` must be a text, but is 7"),
        (
            "turtle{resource = \"t.nt\", base = \"no iri\"}",
            "`no iri` is not a base IRI",
        ),
        (
            "ntriples{resource = \"t.nt\", base = \"http://x\"}",
            "an import of `ntriples` has no option `base`",
        ),
    ] {
        let found = shown(
            &load(
                &format!("@import p :- {import} ."),
                folder.path(),
                &lenient(),
            )
            .unwrap_err(),
        );
        assert!(
            found.contains("R071") && found.contains(words),
            "{import}: {found}"
        );
    }
    for (export, words) in [
        (
            "@export p :- csv{quoting = false}",
            "an export to `csv` has no option `quoting`",
        ),
        (
            "@export p :- csv{delimiter = \"ab\"}",
            "`delimiter` must be one character",
        ),
        ("@export p :- dsv{}", "needs a `delimiter`"),
        (
            "@export p :- csv{} . @export q :- csv{resource = \"./p.csv\"}",
            "`p.csv` is the file of `q` and of `p`",
        ),
        (
            "@export q :- csv{resource = \"p.csv\"} . @output p, q",
            "`p.csv` is the file of `p` and of `q`",
        ),
    ] {
        let program = folder.path().join("p.rls");
        std::fs::write(&program, format!("p(1) . q(2) . {export} .")).unwrap();
        let found =
            shown(&run(&program, &folder.path().join("out"), &Budget::default()).unwrap_err());
        assert!(found.contains(words), "{export}: {found}");
        assert!(!folder.path().join("out").exists(), "{export}");
    }
}

#[test]
fn stated_compression_beats_the_name() {
    let folder = folder(&[("t.gz", b"1\n"), ("t.csv", b"1\n")]);
    let text = |file, compression| {
        format!(
            "@import p :- csv{{resource = \"{file}\", format = (int), compression = \"{compression}\"}} ."
        )
    };
    assert_eq!(
        load(&text("t.gz", "none"), folder.path(), &Loading::default())
            .unwrap()
            .0
            .count("p"),
        1
    );
    let found =
        shown(&load(&text("t.csv", "gzip"), folder.path(), &Loading::default()).unwrap_err());
    assert!(found.contains("R072"), "{found}");
}

/// `_:a` of one file was the same node as `_:a` of another, and nodes without a label had random
/// ones.
#[test]
fn blank_nodes_of_two_files_stay_apart() {
    let statement = "_:a <http://x#p> _:b1 . _:b1 <http://x#p> [] .";
    let folder = folder(&[
        ("a.ttl", statement.as_bytes()),
        ("b.ttl", statement.as_bytes()),
    ]);
    let text =
        "@import p :- turtle{resource = \"a.ttl\"} .\n@import q :- turtle{resource = \"b.ttl\"} .
        same(?x) :- p(?x, _, _), q(?x, _, _) .
        same(?x) :- p(_, _, ?x), q(_, _, ?x) .
        through(?y) :- p(_, _, ?x), p(?x, _, ?y) .
        through(?y) :- q(_, _, ?x), q(?x, _, ?y) .
        own(_:a) .";
    let (closure, _) =
        load(text, folder.path(), &Loading::default()).unwrap_or_else(|found| panic!("{found}"));
    assert_eq!(
        (
            closure.count("same"),
            closure.count("through"),
            closure.count("p")
        ),
        (0, 2, 2)
    );
    let again = load(text, folder.path(), &Loading::default()).unwrap().0;
    assert_eq!(
        closure.tuples("through"),
        again.tuples("through"),
        "the same in each run"
    );
}

#[test]
fn numbers_of_tables_equal_those_of_rules() {
    let folder = folder(&[("t.csv", b"1.5\n1e-05\n2.0\n-3\n.5\n+7\n1e3\n")]);
    let text = "@import t :- csv{resource = \"t.csv\", format = (any)} .
        n(1.5) . n(1e-05) . n(2.0) . n(-3) . n(0.5) . n(7) . n(1e3) .
        same(?x) :- n(?x), t(?x) .";
    let (closure, _) = load(text, folder.path(), &Loading::default()).unwrap();
    assert_eq!((closure.count("n"), closure.count("same")), (7, 7));
}

#[cfg(unix)]
#[test]
fn pipes_without_a_writer_and_endless_devices_stay_within_the_budget() {
    let folder = folder(&[]);
    let made = std::process::Command::new("mkfifo")
        .arg(folder.path().join("pipe.csv"))
        .status()
        .unwrap();
    assert!(made.success());
    let limited = |bytes, secs| {
        Loading::within(&Budget {
            bytes,
            secs,
            ..Budget::default()
        })
    };
    let text = "@import p :- csv{resource = \"pipe.csv\", format = (int)} .";
    let found = shown(&load(text, folder.path(), &limited(usize::MAX, 0.05)).unwrap_err());
    assert!(
        found.contains("R090") && found.contains("exceeded the limit of time"),
        "{found}"
    );
    let text = "@import p :- csv{resource = \"pipe.csv\"} .";
    let found = shown(&load(text, folder.path(), &limited(usize::MAX, 0.05)).unwrap_err());
    assert!(
        found.contains("number of columns") && found.contains("is unknown"),
        "{found}"
    );
    for format in ["csv", "ntriples", "turtle", "trig", "nquads", "rdfxml"] {
        let columns = if format == "csv" {
            ", format = (any)"
        } else {
            ""
        };
        let text = format!("@import p :- {format}{{resource = \"/dev/zero\"{columns}}} .");
        let found = shown(&load(&text, folder.path(), &limited(1 << 20, 1e9)).unwrap_err());
        assert!(
            found.contains("R072") && found.contains("zero byte"),
            "{found}"
        );
    }
    let text = "@import p :- csv{resource = \".\", format = (any)} .";
    assert!(
        shown(&load(text, folder.path(), &limited(1 << 20, 1.0)).unwrap_err())
            .contains("it is a folder")
    );
}

#[test]
fn facts_of_imports_stay_within_the_memory() {
    let rows: String = (0..20_000).map(|n| format!("{n}\n")).collect();
    let folder = folder(&[("t.csv", rows.as_bytes()), ("one.csv", b"1\n")]);
    let limited = |bytes| Loading {
        lenient: true,
        ..Loading::within(&Budget {
            bytes,
            ..Budget::default()
        })
    };
    let import = |file| format!("@import p :- csv{{resource = \"{file}\", format = (int)}} .\n");
    let found = shown(&load(&import("t.csv"), folder.path(), &limited(200_000)).unwrap_err());
    assert!(
        found.contains("R090") && found.contains("exceeded the limit of memory"),
        "{found}"
    );
    assert_eq!(found.lines().count(), 1);
    assert_eq!(
        load(&import("t.csv"), folder.path(), &limited(2_000_000))
            .unwrap()
            .0
            .count("p"),
        20_000
    );
    // Many texts of which none is large.
    let texts = "<b>&e;</b>".repeat(9_000);
    let node = format!("<rdf:Description rdf:about='http://x#a'>{texts}</rdf:Description>");
    let text = format!(
        "<!DOCTYPE a [<!ENTITY e \"{}\">]>\n{RDF}{node}</rdf:RDF>",
        "x".repeat(60_000)
    );
    std::fs::write(folder.path().join("t.rdf"), text).unwrap();
    let text = "@import p :- rdfxml{resource = \"t.rdf\"} .";
    let found = shown(&load(text, folder.path(), &Loading::default()).unwrap_err());
    assert!(found.contains("expand to more than 100 times"), "{found}");
}

#[test]
fn programs_run_leniently_on_request() {
    let folder = folder(&[
        ("t.csv", b"1\nx\n"),
        (
            "p.rls",
            b"@import p :- csv{resource = \"t.csv\", format = (int)} .\n@export p :- csv{} .",
        ),
    ]);
    let (program, out) = (folder.path().join("p.rls"), folder.path().join("out"));
    let found = shown(&run(&program, &out, &Budget::default()).unwrap_err());
    assert!(
        found.contains("R074") && found.contains("t.csv:2:1: `x` is not an integer"),
        "{found}"
    );
    let summary = run_as(&program, &out, &lenient()).unwrap();
    assert_eq!(
        (summary.warnings.iter().count(), summary.written[0].1),
        (1, 1)
    );
}
