//! Mutated files from others: ontologies, models, robots, cases and histories are read or refused,
//! without a panic, a hang, or memory beyond bounds, and every diagnostic can be shown. Mutated
//! messages of a program and mutated outputs of xacro are tested in their crates.
//!
//! `ACTCHECK_FUZZ_MINUTES=10 cargo test --release --locked --test all fuzz_strangers::ontologies --
//! --nocapture`

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use actcheck::analysis::Mirror;
use actcheck::base::{Diagnostics, Files, Source};
use actcheck::campaign::Env;
use actcheck::config::{self, Overrides};
use actcheck::history::merge::{MergeOptions, carry_out, plan};
use actcheck::history::{History, RunFilter, RunRecord};
use actcheck::ontology;
use actcheck::world;
use base64::Engine;

use crate::fuzz_corpus::entrances::{frames, histories};
use crate::history::{sample_campaign, sample_run};
use crate::support::mutations::{Mutations, cases};
use crate::support::{actcheck, copy, stderr};

/// Renders diagnostics as the program prints them: the first 200.
fn show(found: &Diagnostics) {
    let handler = miette::GraphicalReportHandler::new_themed(miette::GraphicalTheme::none());
    for fault in found.iter().take(200) {
        assert!(
            fault.message.chars().count() <= 20_001,
            "a message of {} bytes",
            fault.message.len()
        );
        let mut out = String::new();
        handler.render_report(&mut out, fault).unwrap();
        assert!(
            fault.span.is_none() || !out.contains("Failed to read"),
            "{out}"
        );
    }
}

/// Words of XML and of the vocabularies in it.
const XML: [&str; 22] = [
    "<!DOCTYPE a [",
    "<!ENTITY x \"&x;&x;\">",
    "]>",
    "&x;",
    "&#x41;",
    " xmlns:a=\"b\"",
    " xmlns=\"\"",
    " a=\"b\"",
    "<a>",
    "</a>",
    "<a/>",
    "<![CDATA[",
    "]]>",
    "<!--",
    "-->",
    "<?x",
    " rdf:about=\"..\"",
    " rdf:nodeID=\"n\"",
    " rdf:parseType=\"Collection\"",
    "<rdf:Description>",
    " xml:base=\"x\"",
    "file:///dev/zero",
];

#[test]
fn ontologies() {
    const TURTLE: [&str; 12] = [
        "[",
        "]",
        "(",
        ")",
        " ;",
        " .",
        "<../../../x>",
        "<file:///dev/zero>",
        "@prefix a: <b> .",
        "owl:imports",
        "\"\"\"",
        "^^xsd:integer",
    ];
    let folder = tempfile::tempdir().unwrap();
    let seeds = [
        "tests/data/pick.owl",
        "tests/data/kinds_of_pick.ttl",
        "ontology/actions.ttl",
    ];
    let texts = seeds.map(|name| {
        (
            name.rsplit('.').next().unwrap(),
            std::fs::read(name).unwrap(),
        )
    });
    let others: Vec<&[u8]> = texts.iter().map(|(_, text)| text.as_slice()).collect();
    cases("ontologies", 60, |mut random| {
        let (ending, text) = random.pick(&texts);
        let tokens = if *ending == "owl" {
            &XML[..]
        } else {
            &TURTLE[..]
        };
        let path = folder.path().join(format!("o.{ending}"));
        std::fs::write(&path, random.text(text, tokens, &others)).unwrap();
        if let Err(found) = ontology::load(&Files::Disk, &path) {
            show(&found);
        }
    });
}

/// A folder with a model that uses the mesh `m.ENDING`, and the mesh.
fn with_mesh(folder: &Path, ending: &str, mesh: &[u8]) -> PathBuf {
    let model = folder.join("models/objects/lamp");
    std::fs::create_dir_all(&model).unwrap();
    let text = format!(
        "<sdf version=\"1.6\"><model name=\"lamp\"><link name=\"l\"><collision name=\"c\"><geometry><mesh><uri>m.{ending}</uri>\
         </mesh></geometry></collision></link></model></sdf>"
    );
    std::fs::write(model.join("model.sdf"), text).unwrap();
    std::fs::write(model.join(format!("m.{ending}")), mesh).unwrap();
    model
}

/// Reads a configuration with the models of a folder.
fn read(folder: &Path, more: &str) {
    let text = format!("tests = [[\"Pick\"]]\ntest_count = 1\nmodel_dir = \"models\"\n{more}");
    let source = Source::new(folder.join("c.toml").display().to_string(), text);
    match config::load_text(source, folder, &Overrides::default()) {
        Ok(campaign) => show(&campaign.warnings),
        Err(found) => show(&found),
    }
}

const DAE: &str = "<COLLADA><asset><unit meter=\"0.01\"/><up_axis>Z_UP</up_axis></asset><library_geometries><geometry id=\"g\"><mesh>\
    <source id=\"s\"><float_array count=\"12\">0 0 0 1 0 0 0 1 0 0 0 1</float_array><technique_common><accessor stride=\"3\"/>\
    </technique_common></source><vertices id=\"v\"><input semantic=\"POSITION\" source=\"#s\"/></vertices><triangles count=\"4\">\
    <input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><input semantic=\"NORMAL\" source=\"#n\" offset=\"1\"/>\
    <p>0 0 2 0 1 0 0 0 1 0 3 0 0 0 3 0 2 0 1 0 2 0 3 0</p></triangles><polylist><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/>\
    <vcount>4 3</vcount><p>0 1 2 3 1 2 3</p></polylist></mesh></geometry></library_geometries><library_nodes><node id=\"n\">\
    <instance_geometry url=\"#g\"/></node></library_nodes><library_visual_scenes><visual_scene id=\"x\"><node><matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</matrix>\
    <rotate>0 0 1 90</rotate><instance_node url=\"#n\"/><instance_geometry url=\"#g\"/></node></visual_scene></library_visual_scenes>\
    <scene><instance_visual_scene url=\"#x\"/></scene></COLLADA>";
const OBJ: &str = "o cube\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvn 0 0 1\nvt 0 0\ng a\nusemtl m\nf 1/1/1 3/1/1 2/1/1\nf 1//1 2//1 4//1\n\
    f -4 -1 -2\nf 2 3 4\n";
const GLTF: &str = "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"children\":[1],\"scale\":[1,2,3]},\
    {\"mesh\":0,\"rotation\":[0,0,0,1],\"translation\":[1,2,3]}],\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":1},\
    {\"attributes\":{\"POSITION\":0},\"mode\":5}]}],\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\",\
    \"sparse\":{\"count\":1,\"indices\":{\"bufferView\":1,\"byteOffset\":3,\"componentType\":5121},\"values\":{\"bufferView\":0}}},\
    {\"bufferView\":1,\"componentType\":5121,\"count\":12,\"type\":\"SCALAR\"}],\"bufferViews\":[{\"buffer\":0,\"byteLength\":48,\"byteStride\":12},\
    {\"buffer\":0,\"byteOffset\":48,\"byteLength\":12}],\"buffers\":[{\"byteLength\":60,\"uri\":\"data:;base64,\
    AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAIBAAEDAAMCAQID\"}]}";
const STL: &str = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nfacet normal 0 0 1\n\
    outer loop\nvertex 0 0 0\nvertex 0 0 1\nvertex 1 0 0\nendloop\nendfacet\nendsolid a\n";

/// The same triangles in binary.
fn binary_stl() -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend(2_u32.to_le_bytes());
    for corners in [
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0_f32, 0.0]],
    ] {
        bytes.extend([0_u8; 12]);
        corners
            .iter()
            .flatten()
            .for_each(|x| bytes.extend(x.to_le_bytes()));
        bytes.extend([0_u8; 2]);
    }
    bytes
}

/// A file of glTF in parts: that of text without its buffer, and the buffer.
fn glb() -> Vec<u8> {
    let (before, after) = GLTF.split_once(",\"uri\":\"").unwrap();
    let (data, after) = after.split_once('"').unwrap();
    let (_, data) = data.split_once(',').unwrap();
    let data = base64::engine::general_purpose::STANDARD
        .decode(data)
        .unwrap();
    let json = format!("{before}{after}").into_bytes();
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend((28 + json.len() as u32 + data.len() as u32).to_le_bytes());
    for (kind, part) in [(b"JSON", json), (b"BIN\0", data)] {
        bytes.extend((part.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(part);
    }
    bytes
}

#[test]
fn meshes() {
    const WORDS: [&str; 24] = [
        "<instance_geometry url=\"#g\"/>",
        "<instance_node url=\"#n\"/>",
        "<node>",
        "</node>",
        " offset=\"1\"",
        " stride=\"0\"",
        " id=\"g\"",
        " url=\"#x\"",
        "<vcount>",
        "f 1 2 3\n",
        "usemtl b\n",
        "g b\n",
        "v 1 1 1\n",
        "endsolid\nsolid b\n",
        "facet normal",
        "vertex 1 1 1\n",
        "\"byteStride\":0,",
        "\"uri\":\"m.gltf\",",
        "\"mode\":6,",
        "\"children\":[0,1],",
        "{\"mesh\":0},",
        "\"extensionsRequired\":[\"A\"],",
        "\"normalized\":true,",
        "\"matrix\":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1],",
    ];
    let folder = tempfile::tempdir().unwrap();
    let binary = binary_stl();
    let glb = glb();
    let seeds: [(&str, &[u8]); 6] = [
        ("gltf", GLTF.as_bytes()),
        ("glb", &glb),
        ("dae", DAE.as_bytes()),
        ("obj", OBJ.as_bytes()),
        ("stl", STL.as_bytes()),
        ("stl", binary.as_slice()),
    ];
    cases("meshes", 300, |mut random| {
        let (ending, text) = *random.pick(&seeds);
        let mutated = random.text(text, &WORDS, &[DAE.as_bytes()]);
        with_mesh(folder.path(), ending, &mutated);
        read(folder.path(), "[pickObject]\nmodel_list = [\"lamp\"]\n");
    });
}

#[test]
fn models_and_worlds() {
    const WORDS: [&str; 25] = [
        "<link name=\"l\">",
        "</link>",
        "<frame name=\"f\" attached_to=\"l\"><pose relative_to=\"j\">0 0 1 0 0 0</pose></frame>",
        "<pose relative_to=\"f\"/>",
        "<cone><radius>1</radius><length>1</length></cone>",
        "<ellipsoid><radii>1 2 3</radii></ellipsoid>",
        "<joint name=\"j\" type=\"fixed\">",
        "<include><uri>model://lamp</uri></include>",
        "<collision name=\"c\">",
        "<geometry>",
        "<mesh><uri>file:///dev/zero</uri></mesh>",
        "<pose>0 0 1 0 0 0</pose>",
        "<box><size>1 1 1</size></box>",
        "<mass>1</mass>",
        "<inertial>",
        "<scale>0 0 0</scale>",
        "<submesh/>",
        "\n[[parts]]\n",
        "size_m = [1, 1, 1]\n",
        "fixed = true\n",
        "../../..",
        "model://",
        "%2e%2e%2F",
        "..\\..\\",
        "<?xml version='1.0' encoding='utf-16'?>",
    ];
    let folder = tempfile::tempdir().unwrap();
    let robot = std::fs::read("models/robots/fixed_arm.urdf").unwrap();
    let world = b"<sdf version=\"1.6\"><world name=\"w\"><include><uri>model://lamp</uri><pose>1 1 0 0 0 0</pose><static>true</static>\
        </include></world></sdf>";
    let model = with_mesh(folder.path(), "dae", DAE.as_bytes());
    let sdf = std::fs::read(model.join("model.sdf")).unwrap();
    let index = b"<model><name>lamp</name><sdf version=\"1.6\">model.sdf</sdf></model>";
    let (shelf, kitchen) = (
        std::fs::read("models/objects/shelf.toml").unwrap(),
        std::fs::read("models/worlds/kitchen.toml").unwrap(),
    );
    let others: [&[u8]; 3] = [&robot, &sdf, &shelf];
    let files: [(&str, &[u8]); 6] = [
        ("objects/lamp/model.sdf", &sdf),
        ("objects/lamp/model.config", index),
        ("objects/cup.urdf", &robot),
        ("objects/shelf.toml", &shelf),
        ("worlds/kitchen.toml", &kitchen),
        ("worlds/w.world", world),
    ];
    std::fs::create_dir_all(folder.path().join("models/worlds")).unwrap();
    cases("models and worlds", 100, |mut random| {
        let (name, text) = *random.pick(&files);
        let path = folder.path().join("models").join(name);
        let tokens: Vec<&str> = WORDS.iter().chain(&XML).copied().collect();
        std::fs::write(&path, random.text(text, &tokens, &others)).unwrap();
        read(
            folder.path(),
            "[pickObject]\nmodel_list = [\"lamp\", \"cup\", \"shelf\"]\n[world]\nworlds = [\"kitchen\", \"w\"]\n",
        );
        // The other files are as they were, except that most were not there.
        std::fs::remove_file(&path).unwrap();
        std::fs::write(model.join("model.sdf"), &sdf).unwrap();
    });
}

#[test]
fn robots() {
    const WORDS: [&str; 14] = [
        "<link name=\"l\"/>",
        "<joint name=\"j\" type=\"continuous\"><parent link=\"l\"/><child link=\"l\"/></joint>",
        "<mimic joint=\"j\"/>",
        "<limit lower=\"0\" upper=\"0\" effort=\"0\" velocity=\"0\"/>",
        "<axis xyz=\"0 0 0\"/>",
        "<origin xyz=\"0 0 0\" rpy=\"0 0 0\"/>",
        "<inertia ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\"/>",
        "<mass value=\"0\"/>",
        " type=\"prismatic\"",
        " multiplier=\"0\"",
        "<collision><geometry><sphere radius=\"1\"/></geometry></collision>",
        "<mesh filename=\"package://x/y.stl\"/>",
        "<robot version=\"1.2\">",
        " quat_xyzw=\"0 0 0 0\"",
    ];
    let folder = tempfile::tempdir().unwrap();
    let seeds = [
        "models/robots/fixed_arm",
        "models/robots/mobile_manipulator",
    ]
    .map(|name| {
        let read = |ending: &str| std::fs::read(format!("{name}.{ending}")).unwrap();
        (name.rsplit('/').next().unwrap(), read("toml"), read("urdf"))
    });
    cases("robots", 60, |mut random| {
        let (name, profile, urdf) = random.pick(&seeds);
        let tokens: Vec<&str> = WORDS.iter().chain(&XML).copied().collect();
        let in_profile = random.below(4) == 0;
        let profile = if in_profile {
            random.text(
                profile,
                &["\n[[postures]]\n", "package_dirs = [\"/\"]\n"],
                &[],
            )
        } else {
            profile.clone()
        };
        let urdf = if in_profile {
            urdf.clone()
        } else {
            random.text(urdf, &tokens, &[])
        };
        std::fs::write(folder.path().join("r.toml"), profile).unwrap();
        std::fs::write(folder.path().join(format!("{name}.urdf")), urdf).unwrap();
        let read = config::load_text(
            Source::new(
                "c.toml",
                "tests = [[\"Pick\"]]\ntest_count = 1\n[robot]\nprofile = \"r.toml\"\n",
            ),
            folder.path(),
            &Overrides::default(),
        );
        match read {
            Ok(campaign) => {
                if let Err(error) = world::complete(&campaign.robot)
                    .and_then(|found| world::Robot::compile(&Arc::new(found.profile)))
                    .and_then(|robot| robot.check())
                {
                    show(&error.diagnostic().into());
                }
            }
            Err(found) => show(&found),
        }
    });
}

/// A case of a campaign with clutter, as `actcheck export` writes it.
const CASE: &str = r#"
tests = [["Pick"]]
test_count = 1
[objectSurface]
object_surfaces = ["coffee_table", "table"]
[pickObject]
model_list = ["glass", "mug"]
[surfaceObjects]
model_list = ["can", "bottle"]
count = [0, 4]
[physics]
mass_scale = [0.9, 1.1]
[case]
from = "k7f3-2"
expect = ["NoGraspCollisions"]
trace = "0123456789abcdef"
[case.choices]
surface.name = "coffee_table"
target.model = "glass"
target.x = 0.1
target.y = -0.05
target.yaw = 1.5
other.count = 2
other.1.model = "can"
other.1.x = [0.0, 0.2]
other.1.y = [0.1, 0.2]
other.1.yaw = 0.0
other.1.left_out = true
other.2.model = "bottle"
other.2.x = -0.2
"#;

#[test]
fn case_files() {
    const WORDS: [&str; 16] = [
        "other.99.x = 1.0\n",
        "target.model = 7\n",
        "other.count = 4294967295\n",
        "test_launcher = \"./x\"\n",
        "[skill]\n",
        "[case.choices.other]\n",
        "[history]\ndir = \"/\"\n",
        "= [[",
        "= {",
        "}",
        "\"\"\"",
        "sensor.seed = 1\n",
        "ontology = \"/dev/zero\"\n",
        "model_dir = \"..\"\n",
        "a.b.c.d.e = 1\n",
        "[robot]\nprofile = \"/dev/zero\"\n",
    ];
    let folder = tempfile::tempdir().unwrap();
    let pick = std::fs::read("configs/pick.toml").unwrap();
    let overrides = Overrides {
        history: Some(folder.path().join("h")),
        ..Overrides::default()
    };
    cases("case files", 12, |mut random| {
        let bytes = random.text(CASE.as_bytes(), &WORDS, &[&pick]);
        let Ok(text) = String::from_utf8(bytes) else {
            return;
        };
        match Env::prepare_text(Source::new("case.toml", text), folder.path(), &overrides) {
            Ok(env) => show(&env.warnings()),
            Err(found) => show(&found),
        }
    });
}

/// Texts of a history, and others in their place, which are cut or filled to the same length: so
/// the frame can still be decoded.
const REPLACED: [(&str, &[&str]); 5] = [
    ("c1", &["..", "/x", "  ", "c2", "\u{1b}["]),
    (
        "2026-08-01T12:00:00Z",
        &["9999-99-99T99:99:99Z", "2026-08-01 12:00:00+"],
    ),
    ("Pick", &["Pi\u{1b}[", "../x", " "]),
    (
        "http://actions#",
        &["http://<>#\u{1b}[\u{7}", "https://w3id.o"],
    ),
    ("glass_1", &["../../x", "glass_2", "\"gl\\\n\t"]),
];

/// Changes some values of a history, with right checksums, and some bytes without.
fn damage(history: &Path, random: &mut Mutations) {
    let all: Vec<PathBuf> = ["c1", "c2"]
        .iter()
        .flat_map(|id| Files::Disk.list(&history.join("campaigns").join(id)))
        .collect();
    for _ in 0..=random.below(3) {
        let file = random.pick(&all);
        let bytes = std::fs::read(file).unwrap();
        let mut contents: Vec<Vec<u8>> = frames::contents(&bytes)
            .iter()
            .map(|content| content.to_vec())
            .collect();
        if contents.is_empty() {
            continue;
        }
        let number = random.below(contents.len());
        let content = &mut contents[number];
        match random.below(5) {
            0..=2 => replace(content, random),
            3 => *content = random.text(content, &["\u{0}", "\u{7f}"], &[]),
            _ => *content = random.pick(&frames::contents(&bytes)).to_vec(),
        }
        if file.ends_with("campaign") {
            // Its two copies are equal.
            let content = content.clone();
            contents.fill(content);
        }
        let written = if random.below(3) == 0 {
            random.text(&bytes, &["\u{0}", "\u{7f}"], &[])
        } else {
            frames::file(&bytes, &contents)
        };
        let runs = file.with_extension("runs");
        if runs != *file && runs.exists() && random.below(2) == 0 {
            let rows = std::fs::read(&runs).unwrap();
            std::fs::write(&runs, frames::repointed(&rows, &bytes, &written)).unwrap();
        }
        std::fs::write(file, written).unwrap();
    }
    // A campaign under the id of another one, or under one that is not an id.
    if random.below(3) == 0 {
        let name = *random.pick(&["c3", "a b", "..x", "c1-1", "\u{1b}[2J"]);
        let campaigns = history.join("campaigns");
        std::fs::rename(campaigns.join("c1"), campaigns.join(name)).unwrap();
    }
}

/// First bytes of a compressed part.
const ZSTD: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// Replaces texts of a content, also in its compressed part, unless that needs a dictionary.
fn replace(content: &mut Vec<u8>, random: &mut Mutations) {
    let at = content.windows(ZSTD.len()).position(|part| part == ZSTD);
    let expanded = at.and_then(|at| {
        let expanded = zstd::bulk::decompress(&content[at..], 4 << 20).ok()?;
        Some((at, expanded))
    });
    let Some((at, mut expanded)) = expanded else {
        replace_texts(content, random);
        return;
    };
    // The size before the compressed part remains right.
    replace_texts(&mut expanded, random);
    content.truncate(at);
    content.extend(zstd::bulk::compress(&expanded, 1).unwrap());
}

/// Replaces a text everywhere, or changes a byte.
fn replace_texts(content: &mut [u8], random: &mut Mutations) {
    if content.is_empty() {
        return;
    }
    let (from, others) = random.pick(&REPLACED);
    let other = random.pick(others).bytes().chain(std::iter::repeat(b' '));
    let other: Vec<u8> = other.take(from.len()).collect();
    let mut is_found = false;
    for at in 0..content.len().saturating_sub(from.len() - 1) {
        if content[at..].starts_with(from.as_bytes()) {
            content[at..at + from.len()].copy_from_slice(&other);
            is_found = true;
        }
    }
    if !is_found || random.below(4) == 0 {
        let at = random.below(content.len());
        content[at] ^= 1 << random.below(8);
    }
}

/// Merges a damaged history, and reads all that the result has.
fn merge(theirs: &Path, ours: &Path) -> Result<(), Diagnostics> {
    let sources = [History::open_existing(theirs)?];
    let into = History::open(ours)?;
    let options = MergeOptions {
        rename: true,
        leave_out: Vec::new(),
    };
    let plan = plan(&sources, Some(&into), &options)?;
    carry_out(&plan, &sources, &into, &AtomicBool::new(false), || ())?;
    for campaign in into.campaigns()? {
        into.campaign(&campaign.id)?;
    }
    for run in into.runs(&RunFilter::default())? {
        into.run(&run.run)?;
        // A damaged trace is refused.
        let _ = into.traces().whole(&run.run).map_err(|found| show(&found));
    }
    Ok(())
}

#[test]
fn merged_histories() {
    let folder = tempfile::tempdir().unwrap();
    let made = folder.path().join("made");
    {
        let history = History::open(&made).unwrap();
        for id in ["c1", "c2"] {
            history.begin_campaign(&sample_campaign(id, 1)).unwrap();
            (0..3).for_each(|index| history.commit(&sample_run(id, index)).unwrap());
        }
    }
    let (inner, outer) = (folder.path().join("a/b/c"), folder.path().join("a"));
    cases("merged histories", 12, |mut random| {
        let _ = std::fs::remove_dir_all(&outer);
        std::fs::create_dir_all(&inner).unwrap();
        copy(&made, &inner.join("theirs"));
        damage(&inner.join("theirs"), &mut random);
        if let Err(found) = merge(&inner.join("theirs"), &inner.join("ours")) {
            show(&found);
        }
        let around =
            [&outer, &outer.join("b")].map(|folder| std::fs::read_dir(folder).unwrap().count());
        assert_eq!(around, [1, 1], "a file was written outside of the history");
        assert_eq!(
            std::fs::read_dir(&inner).unwrap().count(),
            if inner.join("ours").exists() { 2 } else { 1 }
        );
    });
}

/// The bytes of the file of each place, after the byte that chooses it.
fn seeds(made: &Path) -> Vec<Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    copy(made, folder.path());
    let (mirror, _) = Mirror::update(&History::open_to_read(folder.path()).unwrap()).unwrap();
    let table = mirror.paths().next().unwrap().1.to_path_buf();
    let seed = |(number, place): (usize, &&str)| {
        let file = match *place {
            "tables/parquet" => table.clone(),
            place => folder.path().join(place),
        };
        let bytes = std::fs::read(&file);
        assert!(bytes.is_ok() || *place == "tables/RECHECKED", "{place}");
        Some([vec![number as u8], bytes.ok()?].concat())
    };
    histories::PLACES
        .iter()
        .enumerate()
        .filter_map(seed)
        .collect()
}

#[test]
fn history_files() {
    let folder = tempfile::tempdir().unwrap();
    let made = folder.path().join("made");
    let runs: Vec<RunRecord> = (0..6).map(|index| sample_run("k", index)).collect();
    histories::made(&made, &runs);
    let seeds = seeds(&made);
    let others: Vec<&[u8]> = seeds.iter().map(Vec::as_slice).collect();
    cases("files of histories", 36, |mut random| {
        let seed = random.pick(&seeds);
        let mut bytes = mutated(&seed[1..], &mut random, &others);
        // With right checksums, as they are, or with runs that have the places of the frames.
        let way = random.below(histories::WAYS);
        bytes.insert(0, seed[0] + (way * histories::PLACES.len()) as u8);
        if let Err(found) = histories::history(&made, &bytes) {
            show(&found);
        }
    });
    // The entry point restores the files that it replaces.
    let history = History::open_to_read(&made).unwrap();
    assert_eq!(history.runs(&RunFilter::default()).unwrap().len(), 6);
    assert!(History::examine(&made).unwrap().0.damage.is_empty());
}

/// A file with other bytes: with mutations anywhere, a flipped bit, cut, or with frames that are
/// random, repeated, of another file, or in another order.
fn mutated(bytes: &[u8], random: &mut Mutations, others: &[&[u8]]) -> Vec<u8> {
    let mut out = bytes.to_vec();
    let mut frames_of: Vec<Vec<u8>> = frames::contents(bytes)
        .iter()
        .map(|content| content.to_vec())
        .collect();
    let (one, other) = (random.below(frames_of.len()), random.below(frames_of.len()));
    match random.below(7) {
        0 if !out.is_empty() => {
            let at = random.below(out.len());
            out[at] ^= 1 << random.below(8);
        }
        1 => out.truncate(random.below(out.len())),
        2 | 3 if !frames_of.is_empty() => {
            let content = &frames_of[one];
            frames_of[one] = match random.below(2) {
                0 => random.text(content, &["\u{0}", "\u{7f}"], others),
                _ => (0..random.below(300))
                    .map(|_| random.below(256) as u8)
                    .collect(),
            };
            out = frames::file(bytes, &frames_of);
        }
        4 if !frames_of.is_empty() => {
            let spliced = frames::contents(&random.pick(others)[1..]);
            let content = match spliced.first() {
                Some(content) if random.below(2) == 0 => content.to_vec(),
                _ => frames_of[one].clone(),
            };
            frames_of.insert(other, content);
            out = frames::file(bytes, &frames_of);
        }
        5 if !frames_of.is_empty() => {
            frames_of.swap(one, other);
            out = frames::file(bytes, &frames_of);
        }
        _ => out = random.text(bytes, &["\u{0}", "\u{7f}", "PAR1"], others),
    }
    out
}

/// Folders of launches, and caches, in a project.
#[test]
fn launches_and_caches() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let config = "tests = [[\"Pick\"]]\ntest_count = 4\n[pickObject]\nmodel_list = [\"glass\"]\n";
    std::fs::write(here.join("c.toml"), config).unwrap();
    let launch = here.join(".actcheck.launch");
    let plan = "{\"id\": \"ab\", \"program\": \"x\", \"config\": \"c.toml\", \"config_digest\": \"x\", \"runs\": null, \
                \"seed\": 7, \"shards\": 2, \"jobs\": 1, \"planned\": 4}";
    cases("launches", 6, |mut random| {
        let _ = std::fs::remove_dir_all(&launch);
        for name in [
            "done",
            "faults",
            "locks",
            "logs",
            "shards/1/hulls",
            "shards/1/campaigns/k",
        ] {
            std::fs::create_dir_all(launch.join(name)).unwrap();
        }
        for name in [
            "plan.json",
            "job.json",
            "done/1",
            "faults/1",
            "logs/1.log",
            "shards/1/VERSION",
            "shards/1/hulls/x.hulls",
        ] {
            if random.below(2) == 0 {
                let text = random.text(
                    plan.as_bytes(),
                    &["18446744073709551615", "null", "{", "}"],
                    &[],
                );
                std::fs::write(launch.join(name), text).unwrap();
            }
        }
        for arguments in [
            &["launch", "c.toml", "--shards", "2", "--dry-run"][..],
            &["launch", "c.toml", "--shards", "2", "-q"],
            &["launch-task", ".actcheck.launch", "1"],
        ] {
            let output = actcheck(here, arguments);
            let said = stderr(&output);
            assert!(
                output.status.code().is_some_and(|code| code <= 2) && !said.contains("panicked"),
                "{said}"
            );
        }
    });
}
