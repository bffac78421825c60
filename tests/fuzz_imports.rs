//! Damaged files of every import format: each is refused with a place or read as a whole, without a
//! panic, and within its limits.
//!
//! A few files of each format, or as many as fit into `ACTCHECK_FUZZ_MINUTES` if that is set. A
//! file is a function of its number.

use actcheck::data::Choices;

use crate::fuzz_corpus::entrances::imports::{FORMATS, import};

/// Files without a fault, by the format's name.
const TABLE: &str = "1,a\n-2.5e3,\"b \"\"c\"\", d\"\n\n\"\",<http://x#y>\n\"\"\"t\"\"@en\",é\r\n99999999999999999999,\"two\nlines\"\n";
const TYPED: &str = "id,name,size\n1,\"a, b\",2.5\n-2,c,1e-05\n";
const LINES: &str = "<http://x#a> <http://x#p> \"t\\u00e9\\n\"@en .\n# c\n_:b <http://x#p> _:c1 .\n<http://x#a> <http://x#q> \"1.50\"^^<http://www.w3.org/2001/XMLSchema#decimal> .\n";
const QUADS: &str = "<http://x#a> <http://x#p> \"t\" <http://x#g> .\n_:b <http://x#p> _:b _:g .\n<http://x#a> <http://x#p> <http://x#b> .\n";
const TURTLE: &str = "@prefix x: <http://x#> .\n@base <http://y/> .\nx:a a x:B ; x:p 1, -2.5, 1e3, true, \"\"\"long\n\"t\" \"\"\", 't'@en-GB ; <q> [ x:p ( x:a [] _:b ) ] .\nPREFIX z: <z#>\nz:a z:b z:c .\n";
const TRIG: &str = "@prefix x: <http://x#> .\nx:g { x:a x:p x:b ; x:q [ x:p 1 ] . _:b x:p ( 1 2 ) }\nGRAPH _:g { x:a x:p \"t\" }\nx:a x:p x:c .\n{ x:d x:p x:e }\n";
const JSON: &str = "{\"a\": [1, -2.5e3, true, null, {\"é\": \"t\\u00e9\\ud83e\\udd80\\n\\\"\"}],\n \"b\": {\"c\": [[], {}, \"\"], \"d\": 99999999999999999999}}\n";
const XML: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<!DOCTYPE rdf:RDF [\n <!ENTITY x \"http://x#\">\n <!ENTITY y \"&x;y\">\n]>\n<!-- c -->\n<rdf:RDF xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\" xmlns:x=\"&x;\" xml:base=\"http://z/\">\n <x:A rdf:about=\"&y;\" x:p='v'>\n  <x:q rdf:datatype=\"&x;d\">t &lt; &#233; &y;</x:q>\n  <x:r xml:lang=\"en\"><![CDATA[<b>]]></x:r>\n  <x:s rdf:parseType=\"Literal\"><i>é</i></x:s>\n  <x:t rdf:parseType=\"Collection\"><x:B rdf:nodeID=\"n\"/><x:B/></x:t>\n  <x:u rdf:resource=\"#f\"/>\n </x:A>\n</rdf:RDF>\n";

/// Parts of the formats' syntax, which damage inserts.
const PIECES: [&[u8]; 36] = [
    b"\"",
    b"\"\"",
    b"'",
    b",",
    b";",
    b".",
    b"\n",
    b"\r",
    b"\t",
    b"\0",
    b"<",
    b">",
    b"&",
    b"&x;",
    b"&y;",
    b"<!--",
    b"-->",
    b"]]>",
    b"/>",
    b"</",
    b"<![CDATA[",
    b"<!DOCTYPE",
    b"<!ENTITY z \"&y;&y;&y;\">",
    b"[",
    b"]",
    b"(",
    b")",
    b"{",
    b"}",
    b"_:b",
    b"\\u",
    b"@",
    b"\xff\xfe",
    b"\xef\xbb\xbf",
    b"\xc3",
    b"xmlns:x='",
];

/// The valid file of a format, compressed if its ending says so.
fn valid(format: usize) -> Vec<u8> {
    let (name, ending, options) = FORMATS[format];
    let text = match name {
        "csv" if options.contains("headers") => TYPED.to_owned(),
        "csv" => TABLE.to_owned(),
        "dsv" => "1;a\n2;\"b\n".to_owned(),
        "tsv" => TABLE
            .replace(',', "\t")
            .replace("\"b \"\"c\"\"\t d\"", "\"b\tc\""),
        "ntriples" => LINES.to_owned(),
        "nquads" => QUADS.to_owned(),
        "turtle" => TURTLE.to_owned(),
        "trig" => TRIG.to_owned(),
        "json" => JSON.to_owned(),
        _ => XML.to_owned(),
    };
    if ending.ends_with("gz") {
        packed(text.as_bytes())
    } else {
        text.into_bytes()
    }
}

fn packed(bytes: &[u8]) -> Vec<u8> {
    let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut packer, bytes).unwrap();
    packer.finish().unwrap()
}

/// A damaged file.
fn damaged(valid: &[u8], number: u64) -> Vec<u8> {
    let mut choices = Choices::random(number, 0);
    let mut pick = |below: usize| choices.index("damage".into(), below.max(1));
    let mut bytes = valid.to_vec();
    for _ in 0..=pick(4) {
        let at = pick(bytes.len() + 1);
        let end = (at + pick(24)).min(bytes.len());
        match pick(7) {
            0 => drop(bytes.drain(at..end)),
            1 => bytes.truncate(at),
            2 => {
                let copy = bytes[at..end].to_vec();
                let to = pick(bytes.len() + 1);
                bytes.splice(to..to, copy);
            }
            3 if at < bytes.len() => bytes[at] ^= 1 << pick(8),
            4 => {
                let many = bytes[at..end].repeat(1 << pick(9));
                bytes.splice(at..at, many);
            }
            _ => drop(bytes.splice(at..at, PIECES[pick(PIECES.len())].iter().copied())),
        }
    }
    bytes
}

#[test]
fn valid_files_of_all_formats_have_no_fault() {
    for (format, names) in FORMATS.iter().enumerate() {
        let file = [&[u8::try_from(format).unwrap()], valid(format).as_slice()].concat();
        assert!(import(&file), "{names:?}");
    }
}

#[test]
fn damaged_files_of_all_formats_are_refused_or_read() {
    let (mut all, mut whole) = (0, 0);
    for (format, names) in FORMATS.iter().enumerate() {
        let valid = valid(format);
        let mut count = 0;
        for number in numbers() {
            let file = [
                &[u8::try_from(format).unwrap()],
                changed(format, &valid, number).as_slice(),
            ]
            .concat();
            match std::panic::catch_unwind(|| import(&file)) {
                Ok(fine) => whole += u64::from(fine),
                Err(_) => {
                    let text = String::from_utf8_lossy(&file[1..]);
                    panic!("file {number} of {names:?} causes a panic: {text:?}");
                }
            }
            count += 1;
        }
        println!("{names:?}: {count} files");
        all += count;
    }
    println!("{all} files, {whole} of them without a fault");
    assert!(0 < whole && whole < all);
}

/// The numbers of the files of one format: a few, or as many as fit into its part of
/// `ACTCHECK_FUZZ_MINUTES`.
fn numbers() -> Box<dyn Iterator<Item = u64>> {
    let Ok(text) = std::env::var("ACTCHECK_FUZZ_MINUTES") else {
        return Box::new(0..40);
    };
    let minutes: f64 = text
        .parse()
        .unwrap_or_else(|_| panic!("ACTCHECK_FUZZ_MINUTES is not a number: {text}"));
    let (start, share) = (
        std::time::Instant::now(),
        minutes * 60.0 / FORMATS.len() as f64,
    );
    Box::new((0..).take_while(move |_| start.elapsed().as_secs_f64() < share))
}

/// The damaged file of a number. Half of the compressed ones are damaged before their compression.
fn changed(format: usize, valid: &[u8], number: u64) -> Vec<u8> {
    let (name, ending, _) = FORMATS[format];
    if !ending.ends_with("gz") || number % 2 == 1 {
        return damaged(valid, number);
    }
    let text = if name == "csv" { TABLE } else { XML };
    packed(&damaged(text.as_bytes(), number))
}
