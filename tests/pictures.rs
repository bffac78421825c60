//! Pictures of real runs, with the built program: PNG pixels, well-formed SVG, and refusal of other file extensions.

use std::io::Read;
use std::path::Path;

use crate::support::{actcheck, edit, project, stderr, stdout};

/// A decoded PNG. Shape of the pixels: height × width × red, green, blue.
struct Pixels {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
}

/// Decodes our own PNGs: eight bits a channel, one filter, one chunk. Verifies every checksum.
fn decode(file: &[u8]) -> Pixels {
    let mut rest = file.strip_prefix(b"\x89PNG\r\n\x1a\n").expect("it begins as PNG does");
    let (mut sides, mut data) = ([0; 2], Vec::new());
    while !rest.is_empty() {
        let length = u32::from_be_bytes(rest[..4].try_into().unwrap()) as usize;
        let (body, sum) = (&rest[4..8 + length], &rest[8 + length..12 + length]);
        let mut crc = flate2::Crc::new();
        crc.update(body);
        assert_eq!(crc.sum().to_be_bytes(), sum);
        match &body[..4] {
            b"IHDR" => {
                sides = [4, 8].map(|at| u32::from_be_bytes(body[at..at + 4].try_into().unwrap()) as usize);
                assert_eq!(body[12..], [8, 2, 0, 0, 0]);
            }
            b"IDAT" => data = body[4..].to_vec(),
            kind => assert_eq!(kind, b"IEND"),
        }
        rest = &rest[12 + length..];
    }
    let [width, height] = sides;
    let mut rows = Vec::new();
    flate2::read::ZlibDecoder::new(data.as_slice()).read_to_end(&mut rows).unwrap();
    let mut pixels = Vec::new();
    for row in rows.chunks(width * 3 + 1) {
        assert_eq!(row[0], 1);
        let begin = pixels.len();
        for (idx, byte) in row[1..].iter().enumerate() {
            let left = if idx < 3 { 0 } else { pixels[begin + idx - 3] };
            pixels.push(byte.wrapping_add(left));
        }
    }
    assert_eq!(pixels.len(), width * height * 3);
    Pixels { width, height, pixels }
}

impl Pixels {
    /// Pixels of exactly a colour.
    fn count(&self, rgb: [u8; 3]) -> usize {
        self.pixels.chunks(3).filter(|pixel| *pixel == rgb).count()
    }
}

/// The id of the first run of a new campaign.
fn first_run(folder: &Path, config: &str) -> String {
    let output = actcheck(folder, &["run", config, "--runs", "1", "--history", "h", "--format", "csv"]);
    assert!(output.status.code() < Some(2), "{}", stderr(&output));
    stdout(&output).lines().nth(1).unwrap().split(',').next().unwrap().to_owned()
}

fn draw(folder: &Path, run: &str, file: &str) -> Vec<u8> {
    let output = actcheck(folder, &["show", run, "--history", "h", "--picture", file]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    std::fs::read(folder.join(file)).unwrap()
}

#[test]
fn a_pick_is_drawn_as_png_and_svg() {
    let project = project();
    let run = first_run(project.path(), "configs/pick.toml");
    let picture = decode(&draw(project.path(), &run, "pick.PNG"));
    assert!(picture.width == 2400 && picture.height > 1200, "{} × {}", picture.width, picture.height);
    // Text, percepts, and the path of the hand.
    assert!(picture.count([0x1c, 0x24, 0x30]) > 1000);
    assert!(picture.count([0xa0, 0x2c, 0x9a]) > 1000);
    assert!(picture.pixels.chunks(3).filter(|p| p[0] > 200 && p[1] < 120 && p[2] < 60).count() > 1000);

    let lines = String::from_utf8(draw(project.path(), &run, "pick.svg")).unwrap();
    let tree = roxmltree::Document::parse(&lines).unwrap();
    let words: Vec<&str> = tree.descendants().filter_map(|node| node.text()).collect();
    for word in ["glass_1", "coffee_table_1", "robot", "before, from above   x → y ↑"] {
        assert!(words.contains(&word), "{word}: {words:?}");
    }
    assert!(words.iter().any(|word| word.starts_with(&format!("{run} · Pick"))), "{words:?}");
    // The same run gives the same picture.
    assert_eq!(draw(project.path(), &run, "again.svg"), lines.as_bytes());
}

#[test]
fn a_world_is_drawn_with_its_rooms_places_and_walls() {
    let project = project();
    let config = project.path().join("configs/perceive.toml");
    edit(
        &config,
        "[objectSurface]\nobject_surfaces = [\"coffee_table\", \"mini_coffee_table\", \"table\"]",
        "[world]\nworlds = [\"apartment\"]\n[objectSurface]\nobject_surfaces = [\"dining_table\"]",
    );
    let run = first_run(project.path(), "configs/perceive.toml");
    let lines = String::from_utf8(draw(project.path(), &run, "world.svg")).unwrap();
    let tree = roxmltree::Document::parse(&lines).unwrap();
    let words: Vec<&str> = tree.descendants().filter_map(|node| node.text()).collect();
    for word in
        ["kitchen", "living_room", "passage", "sofa", "dining_table", "before, the whole world from above   x → y ↑"]
    {
        assert!(words.contains(&word), "{word}: {words:?}");
    }
    assert!(words.iter().any(|word| word.starts_with("seen: ")), "{words:?}");
}

#[test]
fn other_file_extensions_are_refused_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    for file in ["run.jpg", "run", "run.png.gz"] {
        let output = actcheck(folder.path(), &["show", "abcd-1", "--history", "h", "--picture", file]);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2));
        assert!(said.contains("X012") && said.contains(".png or .svg"), "{said}");
    }
}
