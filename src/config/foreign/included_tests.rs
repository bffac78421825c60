//! Models that include others: circles and growth are refused, and nothing of an included model is
//! lost.

use crate::foreign::files_for_tests::{folder, sdf, sdf_model as model};
use crate::foreign::folder::Found;
use crate::foreign::lookup::Lookup;
use crate::foreign::{read, robot, world};
use actcheck_base::{Diagnostics, Files, Source};
use actcheck_data::{ModelTree, ObjectModel};

const SOLID: &str =
    "<collision name=\"c\"><geometry><box><size>0.1 0.1 0.1</size></box></geometry></collision>";

/// A folder of files, with the models in `m`.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new(files: &[(&str, String)]) -> Self {
        Self(folder("m", files))
    }

    fn lookup(&self) -> Lookup<'static> {
        Lookup::new(&Files::Disk, vec![self.0.path().join("m")])
    }

    /// Reads the object of a file, with its warnings.
    fn object(&self, file: &str) -> Result<(ObjectModel, String), String> {
        let found = Found {
            name: "thing".to_owned(),
            path: self.0.path().join("m").join(file),
        };
        let read = read(&found, &self.lookup()).map_err(|faults| faults.to_string())?;
        Ok((read.model, read.warnings.to_string()))
    }

    /// Reads the robot of a file, with its faults.
    fn robot(&self, file: &str) -> (Option<ModelTree>, String) {
        let path = self.0.path().join("m").join(file);
        let source = Files::Disk.read(&path).expect("it is readable");
        let mut found = Diagnostics::new();
        let robot = robot::read(&source, &path, &self.lookup(), &mut found);
        let robot = robot.filter(|_| !found.has_errors());
        (robot.map(|robot| robot.tree), found.to_string())
    }

    /// Reads a world of a text, with its faults. Its models are known by no name.
    fn world(&self, name: &str, text: &str) -> (Option<world::World>, String) {
        let included = world::WorldModels {
            models: &Default::default(),
            posed: &Default::default(),
            lookup: &self.lookup(),
        };
        let path = self.0.path().join("m/worlds").join(name);
        let source = Source::new(name, text.to_owned());
        let (world, found) = world::read("w", &source, &path, &included);
        (world, found.to_string())
    }
}

fn link(name: &str) -> String {
    format!("<link name=\"{name}\">{SOLID}</link>")
}

fn include(uri: &str, inside: &str) -> String {
    format!("<include><uri>{uri}</uri>{inside}</include>")
}

fn joint(kind: &str, [parent, child]: [&str; 2], axis: &str) -> String {
    format!(
        "<joint name=\"{child}_joint\" type=\"{kind}\"><parent>{parent}</parent><child>{child}</child>\
         <axis><xyz>0 0 1</xyz>{axis}</axis></joint>"
    )
}

/// Two links, the second of which turns about the first.
fn hinged() -> String {
    link("a") + &link("b") + &joint("revolute", ["a", "b"], "")
}

/// A file that includes itself, or frames that refer in a circle, end in a fault and not never.
#[test]
fn circles_end() {
    for (files, said) in [
        (
            vec![("a/model.sdf", model(&include("model://a", "")))],
            "includes itself",
        ),
        (
            vec![
                ("a/model.sdf", model(&include("model://b", ""))),
                ("b/model.sdf", model(&include("model://a", ""))),
            ],
            "includes itself",
        ),
    ] {
        let folder = Folder::new(&files);
        let found = folder.object("a/model.sdf").expect_err("it is a circle");
        assert!(found.contains(said), "{found}");
        let (robot, found) = folder.robot("a/model.sdf");
        assert!(robot.is_none() && found.contains(said), "{found}");
        let (world, found) = folder.world(
            "w",
            &sdf(&format!("<world name=\"w\">{}</world>", include("a", ""))),
        );
        assert!(world.is_none() && found.contains(said), "{found}");
    }
    let nameless = "<model></model>";
    let inner = |inside: &str| format!("<model name=\"n\">{inside}</model>");
    for inside in [
        nameless.repeat(3),
        "<model name=\"__model__\"/>".repeat(3),
        format!("<model name=\"x\">{}</model>", nameless.repeat(3)),
        inner("<frame name=\"f\" attached_to=\"f\"/>").replace("\"n\"", "\"n\" canonical_link=\"f\""),
        inner("<frame name=\"f\" attached_to=\"g\"/><frame name=\"g\" attached_to=\"f\"/>")
            .replace("\"n\"", "\"n\" placement_frame=\"f\""),
        "<model name=\"a\" placement_frame=\"b\"><model name=\"b\" placement_frame=\"c\"><pose relative_to=\"b\"/>\
         <frame name=\"c\" attached_to=\"c\"/></model></model>"
            .to_owned(),
        "<model name=\"a\"><pose relative_to=\"b\"/></model><model name=\"b\"><pose relative_to=\"a\"/></model>"
            .to_owned(),
        "<model name=\"a\"><pose relative_to=\"b::f\"/><frame name=\"f\"/></model>\
         <model name=\"b\"><pose relative_to=\"a::f\"/><frame name=\"f\"/></model>"
            .to_owned(),
    ] {
        // A joint looks for the links that carry frames.
        let text = format!("{inside}{}", joint("revolute", ["a", "__model__"], ""));
        let folder = Folder::new(&[("a/model.sdf", model(&text)), ("b/model.sdf", model(&include("a", "")))]);
        for file in ["a/model.sdf", "b/model.sdf"] {
            assert!(folder.object(file).is_err(), "{inside}");
            assert!(folder.robot(file).0.is_none(), "{inside}");
        }
        let world = sdf(&format!("<world name=\"w\">{inside}{}</world>", include("a", "")));
        folder.world("w", &world);
    }
}

/// Nine files of which each includes the next one five times would be five million files.
#[test]
fn inclusions_that_grow_are_bounded() {
    let names = ["m0", "m1", "m2", "m3", "m4", "m5", "m6", "m7"];
    let file = |idx: usize| {
        let twin = |twin: usize| {
            include(
                &format!("model://m{}", idx + 1),
                &format!("<name>n{twin}</name>"),
            )
        };
        model(&(0..5).map(twin).collect::<String>())
    };
    let paths: Vec<String> = names
        .iter()
        .map(|name| format!("{name}/model.sdf"))
        .collect();
    let mut files: Vec<(&str, String)> =
        (0..8).map(|idx| (paths[idx].as_str(), file(idx))).collect();
    files.push(("m8/model.sdf", model(&link("l"))));
    let folder = Folder::new(&files);
    let found = folder.object("m0/model.sdf").expect_err("it is too much");
    assert!(found.contains("more than 1000 models"), "{found}");
    let (robot, found) = folder.robot("m0/model.sdf");
    assert!(robot.is_none() && found.contains("W055"), "{found}");
    let world = sdf(&format!("<world name=\"w\">{}</world>", include("m1", "")));
    let (world, found) = folder.world("w", &world);
    assert!(
        world.is_none() && found.contains("more than 1000 models"),
        "{found}"
    );
}

#[test]
fn models_with_too_many_links_are_refused() {
    let many: String = (0..600)
        .map(|idx| format!("<link name=\"l{idx}\"/>"))
        .collect();
    let twice = include("model://many", "") + &include("model://many", "<name>b</name>");
    let folder = Folder::new(&[
        ("many/model.sdf", model(&many)),
        ("a/model.sdf", model(&twice)),
    ]);
    let found = folder.object("a/model.sdf").expect_err("it is too much");
    assert!(
        found.contains("W055") && found.contains("more than 1000 links"),
        "{found}"
    );
    let (robot, found) = folder.robot("a/model.sdf");
    assert!(robot.is_none() && found.contains("W055"), "{found}");
}

/// Moving parts got the usual friction of 1.
#[test]
fn the_parts_of_an_mjcf_object_have_their_own_friction() {
    let text = "<mujoco><worldbody><body name=\"box\"><geom type=\"box\" size=\".1 .1 .1\" friction=\"0.4\"/>\
                <body name=\"lid\" pos=\"0 0 .15\"><joint type=\"hinge\" axis=\"0 1 0\" range=\"0 1\"/>\
                <geom type=\"box\" size=\".1 .1 .02\" friction=\"0.2\"/></body></body></worldbody></mujoco>";
    let folder = Folder::new(&[("thing.xml", text.to_owned())]);
    let (model, warnings) = folder.object("thing.xml").expect("it is an object");
    assert!((model.friction - 0.4).abs() < 1e-12);
    assert!((model.moving[0].model.friction - 0.2).abs() < 1e-12);
    assert!(!warnings.contains("friction"), "{warnings}");
}

#[test]
fn an_included_model_keeps_its_collisions_with_itself() {
    let outer = model(&include("inner", ""));
    for (switch, is_refused) in [("true", true), ("false", false)] {
        let inner = model(&format!(
            "<self_collide>{switch}</self_collide>{}",
            hinged()
        ));
        let files = [("inner/model.sdf", inner), ("a/model.sdf", outer.clone())];
        match Folder::new(&files).object("a/model.sdf") {
            Ok(_) => assert!(!is_refused),
            Err(said) => assert!(
                is_refused && said.contains("collide with each other"),
                "{said}"
            ),
        }
    }
}

#[test]
fn infinite_limits_are_none() {
    for [lower, upper] in [
        ["-inf", "inf"],
        ["-1e16", "1e16"],
        ["-Inf", "1e16"],
        ["-INFINITY", "+inf"],
    ] {
        let limit = format!("<limit><lower>{lower}</lower><upper>{upper}</upper></limit>");
        let text = model(&hinged().replace("</axis>", &format!("{limit}</axis>")));
        let (model, _) = Folder::new(&[("a.sdf", text)])
            .object("a.sdf")
            .expect(lower);
        assert_eq!(
            model.moving[0].joint.range,
            [f64::NEG_INFINITY, f64::INFINITY]
        );
    }
}

/// A URI without a scheme was only looked up in the folders of models, or only beside the file.
#[test]
fn uris_without_a_scheme_are_relative_to_the_file_first() {
    let big = model(&link("l").replace("0.1 0.1 0.1", "0.3 0.3 0.3"));
    let small = model(&link("l"));
    let cube =
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n".to_owned();
    let mesh = link("l").replace(
        "<box><size>0.1 0.1 0.1</size></box>",
        "<mesh><uri>shapes/cube.obj</uri></mesh>",
    );
    let files = [
        ("part/model.sdf", big),
        ("a/part/model.sdf", small.clone()),
        ("worlds/part/model.sdf", small),
        ("a/model.sdf", model(&include("part", ""))),
        ("b/model.sdf", model(&include("part", ""))),
        ("shapes/cube.obj", cube),
        ("c/model.sdf", model(&mesh)),
    ];
    let folder = Folder::new(&files);
    for (file, side) in [
        ("a/model.sdf", 0.1),
        ("b/model.sdf", 0.3),
        ("c/model.sdf", 1.0),
    ] {
        let (model, _) = folder.object(file).expect(file);
        assert!(
            (model.size_m[0] - side).abs() < 1e-6,
            "{file}: {:?}",
            model.size_m
        );
        assert!(folder.robot(file).0.is_some(), "{file}");
    }
    let world = sdf(&format!(
        "<world name=\"w\">{}</world>",
        include("part", "")
    ));
    let (world, said) = folder.world("w.sdf", &world);
    let world = world.unwrap_or_else(|| panic!("{said}"));
    assert!((world.models[0].size_m[0] - 0.1).abs() < 1e-6);
}

#[test]
fn plugins_of_an_include_are_read_or_named() {
    let coupling = "<plugin name=\"p\" filename=\"f\"><joint>k</joint><mimicJoint>j</mimicJoint><multiplier>2</multiplier></plugin>";
    let other = "<plugin name=\"q\" filename=\"f\"/>";
    let inner = format!(
        "{}{}{}",
        hinged().replace("b_joint", "k"),
        link("c"),
        joint("revolute", ["a", "c"], "").replace("c_joint", "j")
    );
    let outer = |plugin: &str| model(&include("inner", &format!("<name>i</name>{plugin}")));
    let folder = Folder::new(&[
        ("inner/model.sdf", model(&inner)),
        ("a/model.sdf", outer(coupling)),
        ("b/model.sdf", outer(other)),
    ]);
    let (robot, said) = folder.robot("a/model.sdf");
    let robot = robot.unwrap_or_else(|| panic!("{said}"));
    let mimic = robot.joint("i::j").and_then(|joint| joint.mimic.as_ref());
    let mimic = mimic.unwrap_or_else(|| panic!("{said}"));
    assert_eq!((mimic.leader.as_str(), mimic.factor), ("i::k", 2.0));
    assert!(!said.contains("plugin"), "{said}");
    let (_, said) = folder.robot("b/model.sdf");
    assert_eq!(said.matches("the plugin is not run").count(), 1, "{said}");
    for file in ["a/model.sdf", "b/model.sdf"] {
        let (_, warnings) = folder.object(file).expect(file);
        assert_eq!(
            warnings.matches("the plugin is not run").count(),
            1,
            "{warnings}"
        );
    }
}

/// The gripper of an included URDF has only shapes to be seen, of which one has a fault.
#[test]
fn faults_of_shapes_of_an_included_urdf_are_named_there() {
    let visual =
        |size: &str| format!("<visual><geometry><box size=\"{size}\"/></geometry></visual>");
    let urdf = format!(
        "<robot name=\"g\"><link name=\"hand\">{}</link>\n<link name=\"finger\">{}</link>\
         <joint name=\"finger_joint\" type=\"prismatic\"><parent link=\"hand\"/><child link=\"finger\"/>\
         <limit lower=\"0\" upper=\"1\" effort=\"1\" velocity=\"1\"/></joint></robot>",
        visual("1 1 1"),
        visual("1 1")
    );
    let folder = Folder::new(&[
        ("grip/grip.urdf", urdf),
        ("a/model.sdf", model(&include("grip", ""))),
    ]);
    let (robot, said) = folder.robot("a/model.sdf");
    assert!(robot.is_none(), "{said}");
    assert!(
        said.contains("grip.urdf:2:") && said.contains("3 numbers"),
        "{said}"
    );
}

/// `--mend` writes a copy of a URDF only.
#[test]
fn impossible_moments_are_mended_in_the_words_of_their_format() {
    let inertial = "<inertial><mass>1</mass><inertia><ixx>1</ixx><iyy>0</iyy><izz>0</izz></inertia></inertial>";
    let heavy = link("b").replace("<collision", &format!("{inertial}<collision"));
    let text = model(&format!(
        "{}{heavy}{}",
        link("a"),
        joint("revolute", ["a", "b"], "")
    ));
    let (_, said) = Folder::new(&[("a.sdf", text)]).robot("a.sdf");
    assert!(said.contains("W034") && said.contains("<ixx>"), "{said}");
    assert!(!said.contains("--mend"), "{said}");
    let mjcf = "<mujoco><worldbody><body name=\"a\"><geom type=\"sphere\" size=\"1\"/><body name=\"b\"><joint type=\"hinge\"/>\
                <inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"1 0.1 0.1\"/><geom type=\"sphere\" size=\".1\"/></body></body>\
                </worldbody></mujoco>";
    let (_, said) = Folder::new(&[("a.xml", mjcf.to_owned())]).robot("a.xml");
    assert!(
        !said.contains("--mend") && !said.contains("<inertia "),
        "{said}"
    );
}

#[test]
fn urdf_has_cones_and_names_geometries_that_it_lacks() {
    let with = |geometry: &str| {
        format!(
            "<robot name=\"r\"><link name=\"a\"><collision><geometry>{geometry}</geometry></collision></link></robot>"
        )
    };
    let cone = with("<cone radius=\"0.1\" length=\"0.3\"/>");
    let folder = Folder::new(&[("a.urdf", cone), ("b.urdf", with("<torus radius=\"1\"/>"))]);
    let (robot, said) = folder.robot("a.urdf");
    let robot = robot.unwrap_or_else(|| panic!("{said}"));
    assert_eq!(robot.inline_meshes.len(), 1);
    assert!(folder.object("a.urdf").is_ok());
    for said in [
        folder.robot("b.urdf").1,
        folder.object("b.urdf").expect_err("it is not a cone"),
    ] {
        assert!(said.contains("`<torus>`"), "{said}");
    }
}

/// The height of a root `<include>` was said to be left out, but the robot hung in the air.
#[test]
fn a_robot_that_is_only_included_has_the_pose_of_a_scene() {
    let arm = hinged();
    let placed = format!("<pose>1 2 0.5 0 0.3 0</pose>{arm}");
    let folder = Folder::new(&[
        ("arm/model.sdf", model(&arm)),
        ("placed/model.sdf", model(&placed)),
        (
            "r1.sdf",
            sdf(&include("arm", "<pose>1 2 0.5 0 0.3 0</pose>")),
        ),
        ("r2.sdf", sdf(&include("placed", ""))),
    ]);
    for file in ["r1.sdf", "r2.sdf"] {
        let (robot, said) = folder.robot(file);
        let robot = robot.unwrap_or_else(|| panic!("{said}"));
        let names: Vec<&str> = robot.links.iter().map(|link| link.name.as_str()).collect();
        assert_eq!(names, ["a", "b"], "{said}");
        assert!(
            said.contains("the height and tilt of the whole robot are left out"),
            "{said}"
        );
    }
}

/// Faults of the bodies of a world in MJCF were at its root.
#[test]
fn a_body_of_an_mjcf_world_is_named_at_its_place() {
    let text = "<mujoco><worldbody>\n<body name=\"a\" pos=\"0 0 1\"><freejoint/><geom type=\"box\" size=\".2 .2 .2\"/></body>\
                \n<body name=\"b\" pos=\"40 0 1\"><geom type=\"box\" size=\".2 .2 .2\"/></body></worldbody></mujoco>";
    let (_, said) = Folder::new(&[]).world("w.xml", text);
    let at = |words: &str| {
        said.lines()
            .find(|line| line.contains(words))
            .map(str::to_owned)
    };
    assert!(
        at("can move").is_some_and(|line| line.contains("w.xml:2:1")),
        "{said}"
    );
    assert!(
        at("beyond the end").is_some_and(|line| line.contains("w.xml:3:1")),
        "{said}"
    );
}

#[test]
fn fixed_joints_follow_no_other() {
    let mimic = "<mimic joint=\"b_joint\"><multiplier>1</multiplier></mimic>";
    let text = hinged() + &link("c") + &joint("fixed", ["b", "c"], mimic);
    let urdf = "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"/><joint name=\"j\" type=\"fixed\"><parent link=\"a\"/>\
                <child link=\"b\"/><mimic joint=\"k\"/></joint></robot>";
    let folder = Folder::new(&[("a.sdf", model(&text)), ("b.urdf", urdf.to_owned())]);
    for file in ["a.sdf", "b.urdf"] {
        let (robot, said) = folder.robot(file);
        assert!(robot.is_some(), "{said}");
        assert!(
            said.contains("W036") && said.contains("it follows no other"),
            "{said}"
        );
    }
}

#[test]
fn loose_links_and_loops_are_all_reported_at_once() {
    let hinge = |ends: [&str; 2]| joint("revolute", ends, "");
    let links: String = ["a", "b", "c", "d", "e", "f"].map(link).concat();
    let loose = format!("{links}{}{}", hinge(["a", "b"]), hinge(["c", "d"]));
    let twice = format!(
        "{links}{}{}{}",
        ["b", "c", "d", "e", "f"]
            .map(|child| hinge(["a", child]))
            .concat(),
        hinge(["b", "c"]).replace("c_joint", "k"),
        hinge(["d", "e"]).replace("e_joint", "l")
    );
    let folder = Folder::new(&[("a.sdf", model(&loose)), ("b.sdf", model(&twice))]);
    let said = folder.object("a.sdf").expect_err("they are loose");
    assert_eq!(said.matches("no joint connects").count(), 3, "{said}");
    assert!(said.contains("`c` and the link joined to it"), "{said}");
    let said = folder.object("b.sdf").expect_err("it has loops");
    assert_eq!(
        said.matches("two joints move the same links").count(),
        2,
        "{said}"
    );
    let (_, said) = folder.robot("b.sdf");
    assert_eq!(said.matches("closes a loop").count(), 2, "{said}");
    let mut urdf: String = ["a", "b", "c", "d"]
        .map(|name| format!("<link name=\"{name}\"/>"))
        .concat();
    for [parent, child] in [["c", "d"], ["d", "c"]] {
        urdf.push_str(&format!(
            "<joint name=\"{child}_joint\" type=\"fixed\"><parent link=\"{parent}\"/><child link=\"{child}\"/></joint>"
        ));
    }
    let folder = Folder::new(&[("a.urdf", format!("<robot name=\"r\">{urdf}</robot>"))]);
    let (_, said) = folder.robot("a.urdf");
    assert!(
        said.contains("is its own ancestor") && said.contains("`a`, `b`"),
        "{said}"
    );
}

/// Links of sensors without shape and mass, and slipping wheels, were reasons to refuse a model.
#[test]
fn spare_links_and_slip_are_left_out_with_a_warning() {
    let slip = "<surface><friction><ode><mu>0.5</mu><slip1>0.1</slip1></ode><torsional><ode><slip>0.2</slip></ode>\
                </torsional></friction><soft_contact/></surface></collision>";
    let arm = format!(
        "{}{}{}",
        link("a"),
        link("b").replace("</collision>", slip),
        joint("revolute", ["a", "b"], "")
    );
    let massless = "<link name=\"lens\"><inertial><mass>0</mass></inertial></link>";
    let held = joint("fixed", ["a", "lens"], "");
    let folder = Folder::new(&[
        ("a.sdf", model(&format!("<link name=\"lens\"/>{arm}"))),
        ("b.sdf", model(&format!("{arm}{massless}"))),
        ("c.sdf", model(&format!("{arm}{massless}{held}"))),
    ]);
    for (file, is_left_out) in [("a.sdf", true), ("b.sdf", true), ("c.sdf", false)] {
        let (robot, said) = folder.robot(file);
        let robot = robot.unwrap_or_else(|| panic!("{file}: {said}"));
        assert_eq!(robot.link("lens").is_none(), is_left_out, "{said}");
        assert_eq!(said.contains("`lens` is left out"), is_left_out, "{said}");
        for ignored in [
            "`<slip1>` of 0.1 is ignored",
            "`<slip>` of 0.2 is ignored",
            "`<soft_contact>`",
        ] {
            assert!(said.contains(ignored), "{said}");
        }
    }
    for file in ["b.sdf", "c.sdf"] {
        let (_, said) = folder.object(file).expect(file);
        assert!(said.contains("`<slip1>` of 0.1 is ignored"), "{said}");
        assert_eq!(
            said.contains("`lens` is left out"),
            file == "b.sdf",
            "{said}"
        );
    }
}

/// A link that does not state its mass has 1 kg in SDF, and moments of 1 kg·m².
#[test]
fn defaults_of_masses_are_named_at_each_link() {
    let of = |name: &str, inertial: &str| {
        link(name).replace("<collision", &format!("{inertial}<collision"))
    };
    let moments = "<inertia><ixx>1e-3</ixx><iyy>1e-3</iyy><izz>1e-3</izz></inertia>";
    let links = [
        of("a", ""),
        of("b", "<inertial><mass>2</mass></inertial>"),
        of("c", &format!("<inertial>{moments}</inertial>")),
        of(
            "d",
            &format!("<inertial><mass>2</mass>{moments}</inertial>"),
        ),
        of("e", "<inertial auto=\"true\"/>"),
    ];
    let joints = ["b", "c", "d", "e"].map(|child| joint("revolute", ["a", child], "") + "\n");
    let text = model(&format!("{}\n{}", links.join("\n"), joints.concat()));
    let (robot, said) = Folder::new(&[("a.sdf", text)]).robot("a.sdf");
    let robot = robot.unwrap_or_else(|| panic!("{said}"));
    assert_eq!(
        robot
            .link("c")
            .and_then(|link| link.inertial.as_ref())
            .map(|own| own.kg),
        Some(1.0)
    );
    let stated: Vec<&str> = said
        .lines()
        .filter(|line| line.contains("the default of SDF"))
        .collect();
    assert_eq!(stated.len(), 3, "{said}");
    for (line, (place, words)) in stated.iter().zip([
        ("a.sdf:1:", "no mass and no moments"),
        ("a.sdf:2:1", "no moments of inertia: 1 kg·m²"),
        ("a.sdf:3:1", "no mass: 1 kg"),
    ]) {
        assert!(line.contains(place) && line.contains(words), "{said}");
    }
}

/// A mesh in millimetres was measured before its scale was used.
#[test]
fn meshes_in_millimetres_are_measured_in_metres() {
    let mesh = |size: i32| {
        format!(
            "v 0 0 0\nv {size} 0 0\nv 0 {size} 0\nv 0 0 {size}\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
        )
    };
    let urdf = |scale: &str| {
        format!(
            "<robot name=\"r\"><link name=\"a\"><collision><geometry><mesh filename=\"m.obj\" scale=\"{scale}\"/>\
             </geometry></collision></link></robot>"
        )
    };
    let (small, large) = ("0.001 0.001 0.001", "1 1 1");
    let folder = Folder::new(&[
        ("m.obj", mesh(1500)),
        ("a.urdf", urdf(small)),
        ("b.urdf", urdf(large)),
    ]);
    assert!(folder.robot("a.urdf").0.is_some());
    assert!(folder.object("a.urdf").is_ok());
    for said in [
        folder.robot("b.urdf").1,
        folder.object("b.urdf").expect_err("it is large"),
    ] {
        assert!(said.contains("reaches 1500 m"), "{said}");
    }
}

/// Objects in URDF had a reader of their own, which knew less of trees than that of robots.
#[test]
fn objects_in_urdf_are_read_as_trees() {
    let solid = "<collision><geometry><box size=\"0.1 0.1 0.1\"/></geometry></collision>";
    let link = |name: &str, inside: &str| format!("<link name=\"{name}\">{inside}</link>");
    let joint = |kind: &str, child: &str, inside: &str| {
        format!(
            "<joint name=\"{child}_joint\" type=\"{kind}\"><parent link=\"a\"/><child link=\"{child}\"/>{inside}</joint>"
        )
    };
    let mass = |kg: f64| format!("<inertial><mass value=\"{kg}\"/></inertial>");
    let limit = |lower: &str, upper: &str| {
        format!("<limit lower=\"{lower}\" upper=\"{upper}\" effort=\"inf\" velocity=\"1\"/>")
    };
    let of = |inside: &str| {
        let text = format!(
            "<robot name=\"r\">{}{inside}</robot>",
            link("a", &(mass(2.0) + solid))
        );
        Folder::new(&[("a.urdf", text)]).object("a.urdf")
    };
    let hinged = |lower: &str, upper: &str| {
        link("b", &(mass(1.0) + solid)) + &joint("revolute", "b", &limit(lower, upper))
    };
    let (model, _) = of(&hinged("-inf", "inf")).expect("it turns");
    assert_eq!(
        model.moving[0].joint.range,
        [f64::NEG_INFINITY, f64::INFINITY]
    );
    let (model, _) = of(&hinged("0", "0")).expect("it is fixed");
    assert_eq!((model.moving.len(), model.parts.len()), (0, 2));
    assert!((model.mass_kg - 3.0).abs() < 1e-12);
    // The link of a sensor, without a mass.
    let lens = link("lens", &mass(0.0)) + &joint("fixed", "lens", "");
    let (model, warnings) = of(&lens).expect("it has a lens");
    assert!(
        (model.mass_kg - 2.0).abs() < 1e-12 && warnings.is_empty(),
        "{warnings}"
    );
    for (inside, said) in [
        (link("b", solid), "the links form 2 trees"),
        (
            link("b", "") + &joint("fixed", "c", ""),
            "the model has no link `c`",
        ),
        (link("a", solid), "there are two links `a`"),
        (
            link("b", &(mass(0.0) + solid)) + &joint("fixed", "b", ""),
            "collides but has a mass of 0",
        ),
        (
            link("b", solid) + &joint("revolute", "b", &(limit("0", "1") + "<mimic joint=\"c\"/>")),
            "`<mimic>`",
        ),
        (
            link("b", solid) + &joint("planar", "b", ""),
            "of the type planar",
        ),
    ] {
        let found = of(&inside).expect_err(said);
        assert!(found.contains(said), "{said}: {found}");
    }
}

/// Only the bodies of an included URDF had names in the model around it.
#[test]
fn links_of_an_included_urdf_can_be_named() {
    let solid = "<collision><geometry><box size=\"0.1 0.1 0.1\"/></geometry></collision>";
    let urdf = format!(
        "<robot name=\"tool\"><link name=\"holder\">{solid}</link><link name=\"tip\">{solid}</link>\
         <joint name=\"j\" type=\"fixed\"><parent link=\"holder\"/><child link=\"tip\"/><origin xyz=\"0 0 0.5\"/></joint></robot>"
    );
    for end in ["tool::holder", "tool::tip"] {
        let tag = link("tag").replace(
            "<collision",
            &format!("<pose relative_to=\"{end}\">0 1 0 0 0 0</pose><collision"),
        );
        let text = format!(
            "{tag}{}{}",
            include("tool", "<name>tool</name>"),
            joint("fixed", ["tag", end], "").replace(&format!("{end}_joint"), "j")
        );
        let folder = Folder::new(&[("tool.urdf", urdf.clone()), ("a/model.sdf", model(&text))]);
        let (model, _) = folder.object("a/model.sdf").expect(end);
        assert_eq!((model.parts.len(), model.moving.len()), (3, 0));
        let raised = model.parts[0].pose.position[2] - model.parts[1].pose.position[2];
        let expected = if end == "tool::tip" { 0.5 } else { 0.0 };
        assert!((raised - expected).abs() < 1e-9, "{end}: {raised}");
    }
}
