//! The appearance of links and objects, by the files of each format.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::prelude::BASE64_STANDARD;

use crate::foreign::files_for_tests::{folder, sdf, sdf_model};
use crate::foreign::lookup::Lookup;
use crate::foreign::{Found, robot, seen_object};
use actcheck_base::{Diagnostics, Files, Severity};
use actcheck_data::{Colour, SeenLink, SeenPart, Shape};

const RED: Colour = Colour([255, 0, 0]);
const BLUE: Colour = Colour([0, 0, 255]);

/// A tetrahedron whose first face is red; the others are blue.
const OBJ: &str = "mtllib t.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl red\nf 1 3 2\nusemtl blue\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
const MTL: &str = "newmtl red\nKd 1 0 0\n\nnewmtl blue\nKd 0 0 1\n";
/// As [`OBJ`], without files of materials.
const PLAIN_OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
/// A red face, bound by the scene, and three blue ones.
const DAE: &str = r##"<COLLADA><library_effects>
  <effect id="e1"><profile_COMMON><technique><phong><diffuse><color>1 0 0 1</color></diffuse></phong></technique></profile_COMMON></effect>
  <effect id="e2"><profile_COMMON><technique><lambert><diffuse><color>0 0 1 1</color></diffuse></lambert></technique></profile_COMMON></effect>
</library_effects><library_materials>
  <material id="m1"><instance_effect url="#e1"/></material><material id="m2"><instance_effect url="#e2"/></material>
</library_materials><library_geometries><geometry id="g"><mesh>
  <source id="s"><float_array id="a" count="12">0 0 0 1 0 0 0 1 0 0 0 1</float_array>
    <technique_common><accessor source="#a" count="4" stride="3"/></technique_common></source>
  <vertices id="v"><input semantic="POSITION" source="#s"/></vertices>
  <triangles count="1" material="one"><input semantic="VERTEX" source="#v" offset="0"/><p>0 2 1</p></triangles>
  <triangles count="3" material="two"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 3 0 3 2 1 2 3</p></triangles>
</mesh></geometry></library_geometries><library_visual_scenes><visual_scene id="vs"><node>
  <instance_geometry url="#g"><bind_material><technique_common>
    <instance_material symbol="one" target="#m1"/><instance_material symbol="two" target="#m2"/>
  </technique_common></bind_material></instance_geometry>
</node></visual_scene></library_visual_scenes><scene><instance_visual_scene url="#vs"/></scene></COLLADA>"##;

/// The same in glTF.
fn gltf() -> String {
    let positions: [f32; 12] = [0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1.];
    let mut data: Vec<u8> = positions.iter().flat_map(|x| x.to_le_bytes()).collect();
    data.extend([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]);
    let data = BASE64_STANDARD.encode(data);
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1,"material":0}},
        {{"attributes":{{"POSITION":0}},"indices":2,"material":1}}]}}],
        "materials":[{{"pbrMetallicRoughness":{{"baseColorFactor":[1,0,0,1]}}}},{{"pbrMetallicRoughness":{{"baseColorFactor":[0,0,1,1]}}}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}},
        {{"bufferView":1,"componentType":5121,"count":3,"type":"SCALAR"}},{{"bufferView":1,"byteOffset":3,"componentType":5121,"count":9,"type":"SCALAR"}}],
        "bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":12}}],
        "buffers":[{{"byteLength":60,"uri":"data:application/octet-stream;base64,{data}"}}]}}"#
    )
}

/// The appearance of the links of a robot, and the messages of the warnings.
fn seen(files: &[(&str, String)], main: &str) -> (BTreeMap<String, SeenLink>, Diagnostics) {
    let folder = folder("", files);
    let path = folder.path().join(main);
    let source = Files::Disk.read(&path).expect("it was written");
    let mut found = Diagnostics::new();
    let lookup = Lookup::new(&Files::Disk, Vec::new());
    let links = robot::seen(&source, &path, &lookup, &[], &mut found);
    (links, found)
}

/// Colours of the parts, with the number of triangles; 0 for primitives.
fn colours(parts: &[SeenPart]) -> Vec<(Option<Colour>, usize)> {
    let triangles = |seen: &SeenPart| match &seen.part.shape {
        Shape::Mesh { mesh } => mesh.triangles.len(),
        _ => 0,
    };
    parts
        .iter()
        .map(|seen| (seen.colour, triangles(seen)))
        .collect()
}

fn urdf(inside: &str) -> String {
    format!("<robot name=\"r\">{inside}</robot>")
}

fn visual(geometry: &str, material: &str) -> String {
    format!("<visual><geometry>{geometry}</geometry>{material}</visual>")
}

const COLLISION: &str = "<collision><geometry><box size=\"1 2 3\"/></geometry></collision>";

#[test]
fn meshes_of_each_format_have_their_colours() {
    for (name, text) in [
        ("t.obj", OBJ.to_owned()),
        ("t.dae", DAE.to_owned()),
        ("t.gltf", gltf()),
    ] {
        let link = format!(
            "<link name=\"l\">{}{COLLISION}</link>",
            visual(&format!("<mesh filename=\"{name}\" scale=\"2 2 2\"/>"), "")
        );
        let files = [
            (name, text),
            ("t.mtl", MTL.to_owned()),
            ("r.urdf", urdf(&link)),
        ];
        let (links, found) = seen(&files, "r.urdf");
        assert!(links["l"].has_look, "{name}");
        let mut parts = colours(&links["l"].parts);
        parts.sort();
        assert_eq!(parts, [(Some(BLUE), 3), (Some(RED), 1)], "{name}");
        let (low, high) = links["l"].parts[0].part.bounds();
        assert_eq!((low, high), ([0.0; 3], [2.0; 3]), "{name}");
        assert!(
            found
                .iter()
                .all(|fault| fault.severity == Severity::Warning
                    && fault.message.contains("y as up")),
            "{found:?}"
        );
    }
}

/// As in RViz, the colour of a URDF is that of parts without one in their mesh file.
#[test]
fn materials_of_a_urdf_may_be_defined_once() {
    let named = "<material name=\"m\"/>";
    let own = "<material name=\"own\"><color rgba=\"0 0 1 1\"/></material>";
    let mesh = |file: &str| format!("<mesh filename=\"{file}\"/>");
    let text = urdf(&format!(
        "<material name=\"m\"><color rgba=\"1 0 0 1\"/></material>\
         <link name=\"named\">{}</link><link name=\"own\">{}</link><link name=\"mesh\">{}</link>\
         <link name=\"plain\">{}</link><link name=\"clear\">{}{COLLISION}</link>\
         <link name=\"collides\">{COLLISION}</link>",
        visual("<sphere radius=\"1\"/>", named),
        visual("<sphere radius=\"1\"/>", own),
        visual(&mesh("t.obj"), named),
        visual(&mesh("p.obj"), named),
        visual(
            "<sphere radius=\"1\"/>",
            "<material name=\"c\"><color rgba=\"1 1 1 0\"/></material>"
        ),
    ));
    let files = [
        ("t.obj", OBJ.to_owned()),
        ("t.mtl", MTL.to_owned()),
        ("p.obj", PLAIN_OBJ.to_owned()),
        ("r.urdf", text),
    ];
    let (links, found) = seen(&files, "r.urdf");
    let of = |name: &str| colours(&links[name].parts);
    assert_eq!(of("named"), [(Some(RED), 0)]);
    assert_eq!(of("own"), [(Some(BLUE), 0)]);
    assert_eq!(of("mesh").len(), 2);
    assert_eq!(of("plain"), [(Some(RED), 4)]);
    assert_eq!(of("clear"), []);
    assert_eq!(of("collides"), [(None, 0)]);
    assert!(!links["collides"].has_look && links["named"].has_look);
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn a_visual_mesh_that_is_missing_is_one_warning_at_its_place() {
    let bad = visual("<mesh filename=\"missing.stl\"/>", "");
    let text = urdf(&format!(
        "<link name=\"a\">{bad}{COLLISION}</link><link name=\"b\">{bad}{COLLISION}</link>"
    ));
    let (links, found) = seen(&[("r.urdf", text.clone())], "r.urdf");
    let found: Vec<_> = found.iter().collect();
    let [fault] = found.as_slice() else {
        panic!("{found:?}")
    };
    assert_eq!((fault.code, fault.severity), ("W037", Severity::Warning));
    let span = fault.span.clone().expect("it has a place");
    assert_eq!(&text[span], "<mesh", "{fault:?}");
    assert!(fault.message.contains("missing.stl"), "{fault:?}");
    for name in ["a", "b"] {
        let [seen] = links[name].parts.as_slice() else {
            panic!("{:?}", links[name])
        };
        assert_eq!(
            seen.part.shape,
            Shape::Box {
                size: [1.0, 2.0, 3.0]
            }
        );
        assert!(!links[name].has_look);
    }
}

#[test]
fn materials_of_an_obj_that_are_missing_are_reported() {
    let text = urdf(&format!(
        "<link name=\"l\">{}</link>",
        visual("<mesh filename=\"t.obj\"/>", "")
    ));
    let (links, found) = seen(&[("t.obj", OBJ.to_owned()), ("r.urdf", text)], "r.urdf");
    assert_eq!(colours(&links["l"].parts), [(None, 4)]);
    let codes: Vec<_> = found.iter().map(|fault| fault.code).collect();
    assert_eq!(codes, ["W036"], "{found:?}");
}

#[test]
fn a_robot_in_sdf_has_the_colours_of_its_diffuse_light() {
    let visual = |file: &str, material: &str| {
        format!(
            "<visual name=\"v\"><geometry><mesh><uri>{file}</uri></mesh></geometry>{material}</visual>"
        )
    };
    let text = sdf_model(&format!(
        "<link name=\"own\">{}</link><link name=\"mesh\">{}</link>\
         <joint name=\"j\" type=\"fixed\"><parent>own</parent><child>mesh</child></joint>",
        visual("t.obj", "<material><diffuse>1 0 0 1</diffuse></material>"),
        visual("t.obj", ""),
    ));
    let files = [
        ("t.obj", OBJ.to_owned()),
        ("t.mtl", MTL.to_owned()),
        ("r.sdf", text),
    ];
    let (links, found) = seen(&files, "r.sdf");
    assert_eq!(colours(&links["own"].parts), [(Some(RED), 4)], "{found:?}");
    assert_eq!(colours(&links["mesh"].parts).len(), 2);
    assert!(found.is_empty(), "{found:?}");
}

#[test]
fn a_robot_in_mjcf_has_the_colours_of_its_geoms() {
    let text = r#"<mujoco><asset><material name="m" rgba="1 0 0 1"/><mesh name="t" file="t.obj"/></asset>
      <worldbody><body name="a"><geom type="mesh" mesh="t" material="m" contype="0" conaffinity="0" mass="1"/>
        <geom type="box" size="1 1 1" rgba="0 1 0 1"/></body>
      </worldbody></mujoco>"#;
    let files = [
        ("t.obj", OBJ.to_owned()),
        ("t.mtl", MTL.to_owned()),
        ("r.xml", text.to_owned()),
    ];
    let (links, found) = seen(&files, "r.xml");
    assert_eq!(colours(&links["a"].parts), [(Some(RED), 4)], "{found:?}");
}

/// Objects are moved so that their middle is above the origin: so is their appearance.
#[test]
fn an_object_has_its_visual_meshes_in_the_frame_of_its_model() {
    let object = |inside: &str| {
        sdf(&format!(
            "<model name=\"thing\"><link name=\"l\"><pose>5 0 0 0 0 0</pose>\
             <collision name=\"c\"><geometry><box><size>1 1 1</size></box></geometry></collision>{inside}</link></model>"
        ))
    };
    let mesh = "<visual name=\"v\"><pose>-0.5 -0.5 -0.5 0 0 0</pose><geometry><mesh><uri>t.obj</uri></mesh></geometry></visual>";
    let missing =
        "<visual name=\"v\"><geometry><mesh><uri>missing.obj</uri></mesh></geometry></visual>";
    let read = |inside: &str| {
        let files = [
            ("t.obj", OBJ.to_owned()),
            ("t.mtl", MTL.to_owned()),
            ("thing.sdf", object(inside)),
        ];
        let folder = folder("", &files);
        let found = Found {
            name: "thing".to_owned(),
            path: folder.path().join("thing.sdf"),
        };
        let mut faults = Diagnostics::new();
        let folders: [PathBuf; 1] = [Path::new(folder.path()).to_path_buf()];
        let parts = seen_object(&found, &Files::Disk, &folders, &mut faults);
        let codes: Vec<_> = faults.iter().map(|fault| fault.code).collect();
        (parts, codes)
    };
    let (parts, codes) = read(mesh);
    let parts = parts.expect("it has a look");
    assert_eq!(colours(&parts).len(), 2);
    let (low, high) = actcheck_data::bounds(
        &parts
            .iter()
            .map(|seen| seen.part.clone())
            .collect::<Vec<_>>(),
    );
    let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
    assert!(near(low.x, -0.5) && near(high.x, 0.5) && near(low.z, 0.0) && near(high.z, 1.0));
    assert_eq!(codes, [""; 0]);
    assert_eq!(read(missing), (None, vec!["W037"]));
    assert_eq!(read(""), (None, vec![]));
}
