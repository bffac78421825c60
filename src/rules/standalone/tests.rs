//! Small programs at the edges of the language, with the tuples that they derive.

use std::path::Path;

use crate::Budget;
use crate::standalone::{Engine, Loading, Program, run};
use actcheck_base::Source;

fn load(text: &str) -> Program {
    Program::load(&Source::new("edge.rls", text), Path::new(""))
        .unwrap_or_else(|faults| panic!("{faults}\n{text}"))
}

/// Evaluates a program with both engines. Returns the tuples of a predicate, as text.
fn derived(text: &str, predicate: &str) -> String {
    let program = load(text);
    let [fast, naive] = [Engine::Fast, Engine::Naive].map(|engine| {
        let closure = program
            .close(engine, &Budget::default())
            .unwrap_or_else(|fault| panic!("{fault}\n{text}"));
        let tuples = closure.tuples(predicate);
        let row = |tuple: &Vec<_>| {
            tuple
                .iter()
                .map(ToString::to_string)
                .collect::<Vec<_>>()
                .join(" ")
        };
        tuples.iter().map(row).collect::<Vec<_>>().join(", ")
    });
    assert_eq!(fast, naive, "{text}");
    fast
}

#[test]
fn a_rule_with_several_heads_applies_as_a_whole_or_not_at_all() {
    let facts = "e(1) . e(\"x\") .";
    for (rule, q) in [
        ("p(?v + 1), q(?v) :- e(?v) .", "1"),
        ("q(?v), p(?v + 1) :- e(?v) .", "1"),
        ("q(?v), p(?v), r(ABS(?v), UCASE(?v)) :- e(?v) .", ""),
        ("p(?v + 1, !n), q(?v, !n) :- e(?v) .", "1 _:0"),
        // Texts of f-strings always have a value.
        ("p(f\"{?v}!\"), q(?v) :- e(?v) .", "\"x\", 1"),
        ("p(#count(?v)), q(?v + 1) :- e(?v) .", "2"),
        ("p(?v + 1), q(#count(?v)) :- e(?v) .", "1"),
    ] {
        assert_eq!(derived(&format!("{facts} {rule}"), "q"), q, "{rule}");
    }
}

#[test]
fn faults_of_a_rule_with_several_heads_are_reported_once() {
    let text = "p(?w + 1), q(?v), r(ABSS(?v)) :- e(?v) .";
    let faults = Program::load(&Source::new("edge.rls", text), Path::new(""))
        .expect_err("it has two faults");
    let mut codes: Vec<_> = faults.iter().map(|fault| fault.code).collect();
    codes.sort_unstable();
    assert_eq!(codes, ["R021", "R027"], "{faults}");
}

#[test]
fn a_sum_is_right_or_an_error_whatever_the_order_of_the_facts() {
    let facts = ["v(9223372036854775807) .", "v(1) .", "v(-2) ."];
    for order in [
        [0, 1, 2],
        [0, 2, 1],
        [1, 0, 2],
        [1, 2, 0],
        [2, 0, 1],
        [2, 1, 0],
    ] {
        let facts: String = order.map(|idx| facts[idx]).concat();
        assert_eq!(
            derived(&format!("{facts} s(#sum(?x)) :- v(?x) ."), "s"),
            "9223372036854775806"
        );
    }
    let program = load("v(9223372036854775807) . v(1) . s(#sum(?x)) :- v(?x) .");
    for engine in [Engine::Fast, Engine::Naive] {
        let fault = program
            .close(engine, &Budget::default())
            .expect_err("the sum does not fit");
        assert!(
            fault
                .to_string()
                .contains("the sum 9223372036854775808 does not fit in 64 bits"),
            "{fault}"
        );
    }
}

/// Joins by equal and by computed values: facts, rule, and the tuples of `q`.
#[test]
fn joins_by_equal_values_derive_the_same_as_nested_loops() {
    let facts = "r(1) . r(2) . r(1.0) . r(\"1\") . r(x) . r(-3) . s(2) . s(3) . s(2.0) . s(\"1\") . s(1) . s(x) .
        s(9223372036854775807) . r(9223372036854775807) . t(1, 2) . t(2, 3) . t(2, 4) . t(3, 4) . t(1.0, 2.0) . t(2, x) .";
    for rule in [
        "q(?a, ?b) :- r(?a), s(?b), ?a = ?b .",
        "q(?a, ?b) :- r(?a), s(?b), EQUALITY(?a, ?b) .",
        "q(?a, ?b) :- r(?a), s(?b), ?b = ?a + 1 .",
        "q(?a, ?b) :- r(?a), s(?b), ?a = ?b - 1 .",
        "q(?a, ?b) :- r(?a), s(?b), ?b - 1 = ?a * 1 .",
        "q(?a, ?b) :- r(?a), s(?b), STR(?a) = STR(?b) .",
        "q(?a, ?b) :- r(?a), s(?b), DATATYPE(?a) = DATATYPE(?b), ?a != ?b .",
        "q(?a, ?a) :- r(?a), s(?a + 1) .",
        "q(?a, ?b) :- r(?a), s(?b), ?n = ?a + 1, ?n = ?b .",
        "q(?a, ?b) :- r(?a), s(?b), ?n = ?a + 1, ?n = ?b * 1 .",
        "q(?a, ?c) :- t(?a, ?b), t(?c, ?d), ?d = ?b + 1 .",
        "q(?a, ?d) :- t(?a, ?b), t(?b, ?d), ?d = ?a + 2 .",
        "q(?a, ?d) :- t(?a, ?b), t(?a, ?d), ?d * 2 = ?b + ?b .",
        "q(?a, ?b) :- t(?a, ?b), r(?c), ?c + 1 = ?a + ?b - 1 .",
        "q(?a, ?b) :- t(?a, ?b), ?a = 2, UCASE(STR(?b)) = \"X\" .",
        "q(?a, #count(?b)) :- r(?a), s(?b), ?a = ?b .",
        "q(?a, ?b) :- r(?a), s(?b), ?a = ?b, ~t(?a, ?b + 1) .",
        "q(1, 1) . q(?b, ?j) :- q(?i, ?a), ?j = ?i + 1, s(?j), ?b = ?a + 1, ?b < 6 .",
        "q(1, 0) . q(?b, ?a) :- q(?a, _), t(?c, ?b), ?c = ?a * 1 .",
        "q(1, 2) . q(?a, ?d) :- q(?a, ?b), q(?c, ?d), ?b = ?c * 1 . q(?a, ?b) :- t(?a, ?b), r(?a) .",
        "q(1, 2) . q(?d, ?b) :- q(?a, ?b), q(?c, ?d), ?d = ?b + 1, t(?a, ?c - 0) . q(?a, ?b) :- t(?a, ?b) .",
    ] {
        let text = format!("{facts} {rule}");
        derived(&text, "q");
    }
}

#[test]
fn programs_of_current_nemo_are_understood() {
    for (text, expected) in [
        ("n(3) . q(INVERTSIGN(?x), SUBTRACTION(?x, 1)) :- n(?x) .", "-3 2"),
        ("q(.05) . q(-.5e1) . q(1.5).", "-5 0.05 1.5"),
        ("<http://a/b>(1) . q(?x) :- <http://a/b>(?x) .", "1"),
        ("@prefix e: <http://e/> . e:p(<http://x>) . q(?x) :- <http://e/p>(?x), ~<http://e/none>(?x) .", "<http://x>"),
        ("p(\"a1b22\") . q(REPLACE(?x, \"([0-9]+)\", \"<$1>\"), REPLACE(?x, \"A\", \"\", \"i\")) :- p(?x) .", "\"a<1>b<22>\" \"1b22\""),
        ("p(\"a\\nB\") . q(?x) :- p(?x), REGEX(?x, \"a.b\", \"si\"), ~r(?x) .", "\"a\\nB\""),
        ("p(\" a \") . q(TRIM(?x), LTRIM(?x), RTRIM(?x)) :- p(?x) .", "\"a\" \"a \" \" a\""),
        ("p(\"7\") . q(STRDT(?x, xsd:integer), STRDT(?x, xsd:byte)) :- p(?x) .", "7 7"),
        ("p(\"a\"@en-GB) . q(LANGMATCHES(LANG(?x), \"EN\"), langMatches(LANG(?x), \"e\")) :- p(?x) .", "true false"),
        (
            "p(\"2024-02-29T23:05:09.5+02:00\"^^xsd:dateTime) .
             q(YEAR(?x), MONTH(?x), DAY(?x), HOURS(?x), MINUTES(?x), SECONDS(?x), TZ(?x), STR(TIMEZONE(?x))) :- p(?x) .",
            "2024 2 29 23 5 9.5 \"+02:00\" \"PT2H\"",
        ),
        ("p(\"-0044-03-15\"^^xsd:date) . q(YEAR(?x), DAY(?x)) :- p(?x) .", "-44 15"),
        ("p(\"2024-03-15-05:00\"^^xsd:date) . q(DAY(?x), TZ(?x)) :- p(?x) .", "15 \"-05:00\""),
        ("p(\"abc\") . q(MD5(?x), SHA1(?x)) :- p(?x) .", "\"900150983cd24fb0d6963f7d28e17f72\" \"a9993e364706816aba3e25717850c26c9cd0d89d\""),
        ("p(\"abc\") . q(SUBSTR(SHA256(?x), 1, 8), SUBSTR(SHA512(?x), 1, 8)) :- p(?x) .", "\"ba7816bf\" \"ddaf35a1\""),
        ("year(2024) . q(?y) :- year(?y) .", "2024"),
    ] {
        let text = format!("@prefix xsd: <http://www.w3.org/2001/XMLSchema#> . {text}");
        assert_eq!(derived(&text, "q").replace(", ", " "), expected, "{text}");
    }
}

/// Runs a program in a folder of its own. Returns its files with their texts.
fn exported(text: &str) -> Vec<(String, String)> {
    let folder = tempfile::tempdir().expect("there is a folder for temporary files");
    let program = folder.path().join("p.rls");
    std::fs::write(&program, text).expect("the folder is writable");
    let out = folder.path().join("out");
    let summary =
        run(&program, &out, &Budget::default()).unwrap_or_else(|faults| panic!("{faults}\n{text}"));
    let read = |path: &std::path::PathBuf| {
        let bytes = std::fs::read(path).expect("it was written");
        let mut text = String::new();
        if path.extension().is_some_and(|extension| extension == "gz") {
            #[cfg(feature = "gzip")]
            std::io::Read::read_to_string(
                &mut flate2::read::GzDecoder::new(bytes.as_slice()),
                &mut text,
            )
            .expect("it is compressed");
        } else {
            text = String::from_utf8(bytes).expect("it is text");
        }
        let name = path
            .strip_prefix(&out)
            .expect("exports are below the folder")
            .display()
            .to_string();
        let warnings: String = summary
            .warnings
            .iter()
            .map(|warning| format!("{} ", warning.code))
            .collect();
        (name, format!("{warnings}{text}"))
    };
    summary.written.iter().map(|(path, _)| read(path)).collect()
}

#[test]
fn exports_are_tables_or_rdf() {
    let facts = "@prefix e: <http://e/> . t(e:a, e:p, \"x\") . t(e:a, e:p, 2) . t(_:b, e:p, e:a) .
        m(1, \"a,b\", 2.5) . m(2, b, 1.5) . m(\"3\", \"c\", 1.5) .";
    for (export, name, text) in [
        (
            "@export t :- ntriples{} .",
            "t.nt",
            "<http://e/a> <http://e/p> \"x\" .\n\
             <http://e/a> <http://e/p> \"2\"^^<http://www.w3.org/2001/XMLSchema#integer> .\n\
             _:b <http://e/p> <http://e/a> .\n",
        ),
        (
            "@export t :- rdf{resource = \"o.nt\", limit = 1} .",
            "o.nt",
            "<http://e/a> <http://e/p> \"x\" .\n",
        ),
        (
            "@export g :- nquads{} . g(e:g, ?s, ?p, ?o) :- t(?s, ?p, ?o), isString(?o) .",
            "g.nq",
            "<http://e/a> <http://e/p> \"x\" <http://e/g> .\n",
        ),
        (
            "@export w :- ntriples{} . w(?s, ?p, ?o) :- t(?o, ?p, ?s), isIri(?p) .",
            "w.nt",
            "R075 <http://e/a> <http://e/p> _:b .\n",
        ),
        (
            "@export m :- csv{format = (int, string, skip)} .",
            "m.csv",
            "1,\"a,b\"\n",
        ),
        (
            "@export m :- tsv{format = (skip, skip, double), limit = 2} .",
            "m.tsv",
            "1.5\n2.5\n",
        ),
        #[cfg(feature = "gzip")]
        (
            "@export m :- csv{compression = \"gzip\", format = (int, any, any), limit = 1} .",
            "m.csv.gz",
            "1,\"\"\"a,b\"\"\",\"\"\"2.5\"\"^^<http://www.w3.org/2001/XMLSchema#double>\"\n",
        ),
        #[cfg(feature = "gzip")]
        (
            "@export n :- csv{resource = \"x/n.csv.gz\"} . n(?x) :- m(?x, _, _), isInteger(?x) .",
            "x/n.csv.gz",
            "1\n2\n",
        ),
    ] {
        let found = exported(&format!("{facts} {export}"));
        assert_eq!(found, [(name.to_owned(), text.to_owned())], "{export}");
    }
    for export in ["turtle{}", "trig{}", "rdfxml{}"] {
        let facts = facts.replace("_:b", "e:b");
        let quads = if export == "trig{}" {
            "g(e:g, ?s, ?p, ?o) :- t(?s, ?p, ?o) . @export g"
        } else {
            "@export t"
        };
        let (name, text) = exported(&format!("{facts} {quads} :- {export} .")).remove(0);
        let folder = tempfile::tempdir().expect("there is a folder for temporary files");
        std::fs::write(folder.path().join(&name), text).expect("the folder is writable");
        let back = format!("@import t :- rdf{{resource = \"{name}\"}} .");
        let program = Program::load(&Source::new("back.rls", back), folder.path())
            .expect("the export is valid");
        let closure = program
            .close(Engine::Fast, &Budget::default())
            .expect("it is small");
        assert_eq!(closure.count("t"), 3, "{name}");
    }
}

#[test]
fn wrong_exports_are_reported() {
    for (export, code) in [
        ("@export m :- turtle{} . m(1, 2) .", "R071"),
        (
            "@export m :- rdf{resource = \"m.abc\"} . m(1, 2, 3) .",
            "R070",
        ),
        ("@export m :- csv{format = (int)} . m(1, 2) .", "R071"),
        (
            "@export m :- csv{compression = \"zip\"} . m(1, 2) .",
            "R071",
        ),
        (
            "@export m :- ntriples{delimiter = \";\"} . m(1, 2, 3) .",
            "R071",
        ),
    ] {
        let folder = tempfile::tempdir().expect("there is a folder for temporary files");
        let program = folder.path().join("p.rls");
        std::fs::write(&program, export).expect("the folder is writable");
        let found = run(&program, folder.path(), &Budget::default()).expect_err(export);
        assert!(
            found.iter().any(|fault| fault.code == code),
            "{export}: {found}"
        );
    }
}

#[test]
fn parameters_have_the_values_that_the_caller_gives() {
    let load = |text: &str, values: &[(&str, &str)]| {
        let parameters = values
            .iter()
            .map(|(name, value)| ((*name).to_owned(), (*value).to_owned()))
            .collect();
        let loading = Loading {
            parameters,
            ..Loading::default()
        };
        Program::load_as(&Source::new("edge.rls", text), Path::new(""), &loading)
    };
    let text = "@parameter $limit . @parameter $twice = $limit * 2 . q($limit, $twice) .";
    let closure = load(text, &[("limit", "-3")])
        .expect("it is set")
        .close(Engine::Fast, &Budget::default());
    assert_eq!(
        closure.expect("it is small").tuples("q"),
        [[
            actcheck_base::Term::Integer(-3),
            actcheck_base::Term::Integer(-6)
        ]]
    );
    let text = "@parameter $name = \"a\" . q($name) .";
    let closure = load(text, &[("name", "\"b\"")])
        .expect("it is set")
        .close(Engine::Fast, &Budget::default());
    assert_eq!(
        closure.expect("it is small").tuples("q"),
        [[actcheck_base::Term::string("b")]]
    );
    for values in [
        &[("names", "1")][..],
        &[("name", "")],
        &[("name", "?x")],
        &[("name", "1) . p(2")],
        &[("name", "1, 2")],
    ] {
        let found = load(text, values).expect_err("it is wrong");
        assert!(
            found
                .iter()
                .all(|fault| ["R036", "R020"].contains(&fault.code)),
            "{found}"
        );
    }
    assert!(load("@parameter $limit . q($limit) .", &[]).is_err());
    assert!(
        load("q($limit) .", &[("limit", "2")]).is_ok(),
        "a parameter needs no declaration"
    );
}

#[test]
#[cfg(feature = "gzip")]
fn imports_end_at_the_budget_also_for_texts_without_facts() {
    use std::io::Write as _;
    let folder = tempfile::tempdir().expect("there is a folder for temporary files");
    let pack = |name: &str, parts: &mut dyn Iterator<Item = String>| {
        let file = std::fs::File::create(folder.path().join(name)).expect("the folder is writable");
        let mut packed = flate2::write::GzEncoder::new(file, flate2::Compression::fast());
        parts.for_each(|part| packed.write_all(part.as_bytes()).expect("there is room"));
        packed.finish().expect("there is room");
    };
    let many = |text: &str| std::iter::repeat_n(text.repeat(10_000), 300);
    pack(
        "brackets.ttl.gz",
        &mut std::iter::once("<a:a> <a:b> ".to_owned()).chain(many("(")),
    );
    pack(
        "lists.ttl.gz",
        &mut std::iter::once("<a:a> <a:b> ".to_owned()).chain(many("(1 ")),
    );
    pack(
        "prefixes.ttl.gz",
        &mut (0..2_000_000).map(|n| format!("@prefix p{n}: <a:{n}> .\n")),
    );
    pack("row.csv.gz", &mut many(",,,,,,,,,,"));
    pack(
        "list.ttl.gz",
        &mut std::iter::once("<a:a> <a:b> (".to_owned()).chain(many("1 2 3 ")),
    );
    for (format, name, code) in [
        ("turtle", "brackets.ttl.gz", "R072"),
        ("turtle", "lists.ttl.gz", "R072"),
        ("turtle", "prefixes.ttl.gz", "R090"),
        ("csv", "row.csv.gz", "R090"),
        ("turtle", "list.ttl.gz", "R090"),
    ] {
        let columns = if format == "csv" {
            ", format = (any, any)"
        } else {
            ""
        };
        let text = format!("@import t :- {format}{{resource = \"{name}\"{columns}}} .");
        let loading = Loading::within(&Budget {
            bytes: 64 << 20,
            secs: 60.0,
            ..Budget::default()
        });
        let found =
            Program::load_as(&Source::new("p.rls", text), folder.path(), &loading).expect_err(name);
        assert!(
            found.iter().all(|fault| fault.code == code),
            "{name}: {found}"
        );
    }
}
