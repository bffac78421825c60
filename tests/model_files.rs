//! Files of models as programs of others write them: XML in any encoding, paths of Windows and of
//! web addresses, and meshes in glTF.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::Arc;

use actcheck::base::{Diagnostics, Source};
use actcheck::config::{self, Campaign, Overrides};
use actcheck::data::ObjectModel;

use crate::support::{copy, root};

/// How a program writes an XML text that begins without a declaration.
type Written = fn(&str) -> Vec<u8>;

const ENCODINGS: [(&str, Written); 7] = [
    ("UTF-8 with a mark", |text| {
        format!("\u{feff}{text}").into_bytes()
    }),
    ("ISO-8859-1", |text| latin("ISO-8859-1", text)),
    ("windows-1252", |text| latin("windows-1252", text)),
    ("US-ASCII", |text| {
        latin("US-ASCII", &text.replace('é', "e"))
    }),
    ("UTF-16LE", |text| {
        utf16(&format!("\u{feff}{text}"), u16::to_le_bytes)
    }),
    ("UTF-16BE", |text| {
        utf16(&format!("\u{feff}{text}"), u16::to_be_bytes)
    }),
    ("UTF-16 without a mark", |text| {
        let declaration = "<?xml version=\"1.0\" encoding=\"UTF-16\"?>";
        utf16(&format!("{declaration}{text}"), u16::to_le_bytes)
    }),
];

/// A text whose characters are all in Latin-1, with a declaration on its first line.
fn latin(name: &str, text: &str) -> Vec<u8> {
    let declared = format!("<?xml version=\"1.0\" encoding=\"{name}\"?>{text}");
    let letters = declared.chars().map(|letter| u32::from(letter) as u8);
    letters.collect()
}

fn utf16(text: &str, bytes_of: fn(u16) -> [u8; 2]) -> Vec<u8> {
    text.encode_utf16().flat_map(bytes_of).collect()
}

/// Writes all XML files of a folder in another encoding, each with a letter that is not ASCII.
fn recode(folder: &Path, written: Written) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            recode(&path, written);
            continue;
        }
        let ending = path.extension().unwrap().to_str().unwrap();
        if ["config", "sdf", "urdf", "xml", "dae", "world"].contains(&ending) {
            let text = fs::read_to_string(&path).unwrap();
            let undeclared = match text.strip_prefix("<?xml") {
                Some(rest) => rest.split_once("?>").unwrap().1,
                None => &text,
            };
            fs::write(&path, written(&format!("<!-- modélé -->{undeclared}"))).unwrap();
        }
    }
}

fn campaign(folder: &Path, text: &str) -> Result<Campaign, Diagnostics> {
    let text = format!("tests = [[\"Pick\"]]\ntest_count = 1\n{text}");
    config::load_text(
        Source::new(folder.join("c.toml").display().to_string(), text),
        folder,
        &Overrides::default(),
    )
}

/// The models of a folder with their sizes and masses.
fn models(folder: &Path) -> BTreeMap<String, ([f64; 3], f64)> {
    let campaign = campaign(folder, "model_dir = \"models\"\n").unwrap();
    let value = |model: &Arc<ObjectModel>| (model.size_m, model.mass_kg);
    let all = campaign.models.iter();
    all.map(|(name, model)| (name.clone(), value(model)))
        .collect()
}

fn gazebo() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    copy(
        &root().join("tests/models/gazebo"),
        &folder.path().join("models"),
    );
    folder
}

#[test]
fn models_in_any_encoding_are_the_same() {
    let original = models(gazebo().path());
    assert_eq!(original.len(), 4);
    for (name, written) in ENCODINGS {
        let folder = gazebo();
        recode(folder.path(), written);
        assert_eq!(models(folder.path()), original, "{name}");
    }
}

/// The diagnostics of a robot in `robot.toml`, without the parts that quote its file.
fn said_of_robot(folder: &Path) -> String {
    campaign(folder, "[robot]\nprofile = \"robot.toml\"\n")
        .map_or_else(|found| found.to_string(), |_| String::new())
}

#[test]
fn robots_in_any_encoding_are_the_same_and_places_are_those_of_the_file() {
    for crane in ["crane", "crane_mjcf", "crane_sdf"] {
        for (name, written) in ENCODINGS {
            let folder = tempfile::tempdir().unwrap();
            copy(&root().join("tests/models").join(crane), folder.path());
            recode(folder.path(), written);
            assert_eq!(said_of_robot(folder.path()), "", "{crane}: {name}");
        }
    }
    let urdf = fs::read_to_string(root().join("tests/models/crane/robot.urdf")).unwrap();
    let faulty = urdf.replacen("<mass value=\"3\"/>", "<!-- é --><mass value=\"3 kg\"/>", 1);
    assert_ne!(faulty, urdf);
    for (name, written) in ENCODINGS {
        let folder = tempfile::tempdir().unwrap();
        copy(&root().join("tests/models/crane"), folder.path());
        fs::write(folder.path().join("robot.urdf"), written(&faulty)).unwrap();
        let said = said_of_robot(folder.path());
        let column = urdf.lines().nth(9).unwrap().find("<mass").unwrap() + 11;
        assert!(
            said.contains(&format!("robot.urdf:10:{column}")),
            "{name}: {said}"
        );
    }
}

#[test]
fn an_unknown_encoding_is_named() {
    for (text, reason) in [
        (
            &b"<?xml version='1.0' encoding='klingon'?><robot name='r'/>"[..],
            "robot.urdf: its encoding, `klingon`, is unknown; save it as UTF-8",
        ),
        (
            b"<robot name='r'>\n<!-- \xe9 --></robot>",
            "robot.urdf: line 2 is not in its encoding, UTF-8",
        ),
    ] {
        let folder = tempfile::tempdir().unwrap();
        copy(&root().join("tests/models/crane"), folder.path());
        fs::write(folder.path().join("robot.urdf"), text).unwrap();
        let said = said_of_robot(folder.path());
        assert!(said.contains(reason), "{said}");
    }
}

/// Replaces a text in a file, which must have it.
fn replace(path: &Path, from: &str, to: &str) {
    let text = fs::read_to_string(path).unwrap();
    assert!(text.contains(from), "{text}");
    fs::write(path, text.replace(from, to)).unwrap();
}

#[test]
fn paths_with_backslashes_and_percent_signs_lead_to_their_files() {
    let original = models(gazebo().path());
    for uri in [
        "model://paper_cup/my%20meshes/a%20cup.obj",
        "model://paper_cup\\my meshes\\a cup.obj",
        "package://paper_cup/my%20meshes\\a cup.obj",
        "file://paper_cup\\my%20meshes\\a%20cup.obj",
        "my%20meshes/a cup.obj",
        ".\\my meshes\\a%20cup.obj",
        "C:\\models\\paper_cup\\my meshes\\a cup.obj",
    ] {
        let folder = gazebo();
        let cup = folder.path().join("models/paper_cup");
        fs::rename(cup.join("meshes"), cup.join("my meshes")).unwrap();
        fs::rename(
            cup.join("my meshes/cup.obj"),
            cup.join("my meshes/a cup.obj"),
        )
        .unwrap();
        replace(
            &cup.join("model.sdf"),
            "model://paper_cup/meshes/cup.obj",
            uri,
        );
        replace(&cup.join("model.config"), "model.sdf", ".\\model%2Esdf");
        assert_eq!(models(folder.path()), original, "{uri}");
    }
}

/// A box of 5 × 5 × 10 cm.
fn box_glb() -> Vec<u8> {
    let mut data = Vec::new();
    for corner in 0..8 {
        for (axis, half) in [(0, 0.025_f32), (1, 0.025), (2, 0.05)] {
            let sign = if corner >> axis & 1 == 1 { 1.0 } else { -1.0 };
            data.extend((sign * half).to_le_bytes());
        }
    }
    data.extend([
        0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2,
        1, 3, 7, 1, 7, 5_u8,
    ]);
    let json = "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],\
        \"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":1}]}],\
        \"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":8,\"type\":\"VEC3\"},\
        {\"bufferView\":1,\"componentType\":5121,\"count\":36,\"type\":\"SCALAR\"}],\
        \"bufferViews\":[{\"buffer\":0,\"byteLength\":96},{\"buffer\":0,\"byteOffset\":96,\"byteLength\":36}],\
        \"buffers\":[{\"byteLength\":132}]}";
    let mut file = b"glTF\x02\0\0\0".to_vec();
    let part = |kind: &[u8; 4], part: &[u8]| {
        let length = u32::try_from(part.len()).unwrap().to_le_bytes();
        [&length[..], kind, part].concat()
    };
    let parts = [part(b"JSON", json.as_bytes()), part(b"BIN\0", &data)].concat();
    file.extend(u32::try_from(12 + parts.len()).unwrap().to_le_bytes());
    file.extend(parts);
    file
}

#[test]
fn a_model_with_meshes_of_gltf_has_their_size() {
    let folder = tempfile::tempdir().unwrap();
    let model = folder.path().join("models/crate");
    fs::create_dir_all(&model).unwrap();
    fs::write(model.join("box.glb"), box_glb()).unwrap();
    let collision = |name: &str| {
        format!(
            "<collision name=\"{name}\"><geometry><mesh><uri>model://crate/box.glb</uri></mesh></geometry></collision>\n"
        )
    };
    let text = format!(
        "<sdf version=\"1.9\"><model name=\"crate\"><link name=\"l\"><inertial><mass>0.3</mass></inertial>\n{}{}</link></model></sdf>",
        collision("c"),
        collision("d"),
    );
    fs::write(model.join("model.sdf"), text).unwrap();
    let used = "model_dir = \"models\"\n[pickObject]\nmodel_list = [\"crate\"]\n";
    let read = campaign(folder.path(), used).unwrap();
    let size = read.models["crate"].size_m;
    let is_near = |(found, expected): (f64, f64)| (found - expected).abs() < 1e-6;
    assert!(
        size.into_iter().zip([0.05, 0.05, 0.1]).all(is_near),
        "{size:?}"
    );
    // One warning for all meshes of a model, where the first is named.
    let said = read.warnings.to_string();
    assert_eq!(said.matches("glTF defines y as up").count(), 1, "{said}");
    assert!(said.contains("model.sdf:2:"), "{said}");
    fs::write(model.join("box.glb"), &box_glb()[..400]).unwrap();
    let said = campaign(folder.path(), used).err().unwrap().to_string();
    assert!(
        said.contains("box.glb is unusable: it ends too early") && said.contains("model.sdf:2:"),
        "{said}"
    );
}
