//! Robots, objects and worlds of MJCF have the values that MuJoCo 3.3.1 gives them, or are refused.

use std::f64::consts::FRAC_PI_6;
use std::path::Path;

use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};

use crate::foreign::files_for_tests::{ball, folder};
use crate::foreign::lookup::Lookup;
use crate::foreign::{mjcf, mjcf_world};
use actcheck_base::{Diagnostics, Files, Source};
use actcheck_data::{ModelTree, Shape, TreeGeometry, TreeJoint, TreeMotion};

type Read = Result<(ModelTree, Diagnostics), String>;

/// Calls a reader with the first of these files.
fn with_first<T>(
    files: &[(&str, &str)],
    read: impl FnOnce(&Source, &Path, &Lookup) -> Result<T, Diagnostics>,
) -> Result<T, String> {
    let folder = folder("", files);
    let lookup = Lookup::new(&Files::Disk, Vec::new());
    let source = Source::new(files[0].0, files[0].1.to_owned());
    read(&source, &folder.path().join(files[0].0), &lookup).map_err(|faults| faults.to_string())
}

/// Reads the first of these files as a robot.
fn robot(files: &[(&str, &str)]) -> Read {
    with_first(files, |source, path, lookup| {
        mjcf::robot(source, path, lookup).map(|(tree, _, said)| (tree, said))
    })
}

fn object(files: &[(&str, &str)]) -> Read {
    with_first(files, |source, path, lookup| {
        mjcf::object(source, path, lookup).map(|(tree, _, said)| (tree, said))
    })
}

/// A file in radians with these bodies, and other sections.
fn file(bodies: &str, more: &str) -> String {
    format!("<mujoco><compiler angle=\"radian\"/><worldbody>{bodies}</worldbody>{more}</mujoco>")
}

fn text(bodies: &str, more: &str) -> Read {
    robot(&[("a.xml", &file(bodies, more))])
}

fn tree(bodies: &str, more: &str) -> Result<ModelTree, String> {
    text(bodies, more).map(|(tree, _)| tree)
}

fn tree_of(files: &[(&str, &str)]) -> Result<ModelTree, String> {
    robot(files).map(|(tree, _)| tree)
}

/// A file that has the model `h` of another one, with attributes of its `<compiler>`.
fn attaching(compiler: &str, other: &str, bodies: &str, more: &str) -> String {
    format!(
        "<mujoco><compiler {compiler}/><asset><model name=\"h\" file=\"{other}\"/></asset>\
         <worldbody>{bodies}</worldbody>{more}</mujoco>"
    )
}

/// A body with a joint and a ball, and attributes of both.
fn part(joint: &str, geom: &str) -> String {
    format!("<body name=\"b\"><joint name=\"j\" {joint}/><geom size=\"0.1\" {geom}/></body>")
}

fn joint<'t>(tree: &'t ModelTree, name: &str) -> &'t TreeJoint {
    tree.joint(name)
        .unwrap_or_else(|| panic!("there is no joint {name}"))
}

/// Another rotation than a quaternion decides, even if it is that of the class; an inner class
/// replaces that of an outer one.
#[test]
fn the_right_one_of_several_rotations_is_used() {
    let all = [
        ("quat=\"0 1 0 0\"", [0.0, 1.0, 0.0, 0.0]),
        ("axisangle=\"1 0 0 0.5\"", [0.969, 0.247, 0.0, 0.0]),
        ("euler=\"0 0.6 0\"", [0.955, 0.0, 0.296, 0.0]),
        ("xyaxes=\"0 1 0 -1 0 0\"", [0.707, 0.0, 0.0, 0.707]),
        ("zaxis=\"0 1 1\"", [0.924, -0.383, 0.0, 0.0]),
    ];
    let turned = |own: &str, class: &str, inner: &str| {
        let defaults = format!(
            "<default><geom {class}/><default class=\"c\"><geom {inner}/></default></default>"
        );
        text(&part("", &format!("class=\"c\" {own}")), &defaults)
            .map(|(tree, _)| tree.link("b").expect("it is there").solids[0].pose.rotation)
    };
    let near = |found: Result<UnitQuaternion<f64>, String>, [w, x, y, z]: [f64; 4]| {
        let expected = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        assert!(found.expect("it is valid").angle_to(&expected) < 2e-3);
    };
    for (own, of_own) in all {
        for (class, of_class) in all.into_iter().filter(|(class, _)| *class != own) {
            let expected = if own == all[0].0 { of_class } else { of_own };
            near(turned(own, class, ""), expected);
            near(turned("", class, own), expected);
            let said = turned(&format!("{own} {class}"), "", "").expect_err("it is unclear");
            assert!(said.contains("W034") && said.contains("twice"), "{said}");
        }
    }
    near(turned("zaxis=\"0 0 -1\"", "", ""), [0.0, 1.0, 0.0, 0.0]);
    for wrong in [
        "quat=\"0 0 0 0\"",
        "axisangle=\"0 0 0 1\"",
        "zaxis=\"0 0 0\"",
        "xyaxes=\"1 0 0 2 0 0\"",
    ] {
        assert!(
            turned(wrong, "", "").is_err_and(|said| said.contains("W034")),
            "{wrong}"
        );
    }
}

/// Sites have their pose from two points, too; axis z points to the first.
#[test]
fn sites_between_two_points_are_there() {
    let sites = "<site name=\"s\" type=\"capsule\" size=\"0.01\" fromto=\"0 0 0 1 0 0\"/>\
                 <geom type=\"box\" size=\"0.1\" fromto=\"0 0 0 1 0.3 0\"/>";
    let (tree, _) = text(sites, "").expect("it is valid");
    let at = joint(&tree, "s_fixed").origin;
    assert!((at.translation.vector - Vector3::new(0.5, 0.0, 0.0)).norm() < 1e-9);
    assert!((at.rotation * Vector3::z() + Vector3::x()).norm() < 1e-9);
    let found = tree.links[0].solids[0].pose.rotation;
    let expected = Quaternion::new(std::f64::consts::FRAC_1_SQRT_2, 0.20319, -0.67729, 0.0);
    assert!(found.angle_to(&UnitQuaternion::from_quaternion(expected)) < 1e-4);
    let said = text("<site name=\"s\" fromto=\"0 0 0 1 0 0\"/>", "").expect_err("it is a ball");
    assert!(said.contains("W034"), "{said}");
}

#[test]
fn words_for_numbers_are_faults() {
    for (joint, geom) in [
        ("", "friction=\"x\""),
        ("", "friction=\"nan 0 0\""),
        ("", "density=\"-5\""),
        ("", "density=\"inf\""),
        ("", "mass=\"nan\""),
        ("", "mass=\"1 kg\""),
        ("", "group=\"x\""),
        ("", "contype=\"1.5\""),
        ("", "contype=\"4294967295\""),
        ("damping=\"x\"", ""),
        ("ref=\"x\"", ""),
        ("stiffness=\"x\"", ""),
        ("limited=\"maybe\"", ""),
        ("limited=\"true\"", ""),
        ("range=\"0 0\" limited=\"true\"", ""),
    ] {
        let said = text(&part(joint, geom), "").expect_err("it is not a number");
        assert!(
            said.contains("W034") && said.contains("a.xml:1:"),
            "{joint} {geom}: {said}"
        );
    }
    for size in ["0.1 x", "nan", "inf", "-1", "0", "1e9"] {
        let said = text(&format!("<geom size=\"{size}\"/>"), "").expect_err("it is not a size");
        assert!(said.contains("W034"), "{size}: {said}");
    }
    for sequence in ["xy", "abc", ""] {
        let said = text("", &format!("<compiler eulerseq=\"{sequence}\"/>"));
        assert!(said.is_err_and(|said| said.contains("W034")), "{sequence}");
    }
}

/// An empty range is not a limit, and one that is switched off does not count.
#[test]
fn ranges_are_limits_as_in_mujoco() {
    let motion = |joint_says: &str, more: &str| {
        let (tree, _) = text(&part(joint_says, ""), more).expect("it is valid");
        let joint = joint(&tree, "j");
        (joint.motion == TreeMotion::Revolute).then_some([joint.lower, joint.upper])
    };
    assert_eq!(motion("range=\"0 0\"", ""), None);
    assert_eq!(motion("range=\"1 1\"", ""), None);
    assert_eq!(motion("range=\"0 1\"", ""), Some([0.0, 1.0]));
    assert_eq!(motion("range=\"0 1\" limited=\"false\"", ""), None);
    assert_eq!(
        motion("range=\"0 1\" limited=\"auto\"", ""),
        Some([0.0, 1.0])
    );
    let servo = |says: &str| format!("<actuator><position joint=\"j\" {says}/></actuator>");
    assert_eq!(motion("", &servo("ctrlrange=\"-1 2\"")), Some([-1.0, 2.0]));
    assert_eq!(
        motion("", &servo("ctrlrange=\"-1 2\" ctrllimited=\"false\"")),
        None
    );
    assert_eq!(motion("", &servo("ctrlrange=\"0 0\"")), None);
    assert_eq!(
        motion("", &servo("ctrlrange=\"-1 2\" gear=\"-1\"")),
        Some([-2.0, 1.0])
    );
    let said = text(
        &part("range=\"0 1\"", ""),
        "<compiler autolimits=\"false\"/>",
    );
    assert!(said.is_err_and(|said| said.contains("W034")));
    let effort = |says: &str| {
        let more = format!("<actuator><motor joint=\"j\" {says}/></actuator>");
        let (tree, _) = text(&part("", ""), &more).expect("it is valid");
        joint(&tree, "j").effort
    };
    assert_eq!(effort("ctrlrange=\"-3 3\""), 3.0);
    assert_eq!(effort("ctrlrange=\"0 0\""), 100.0);
    assert_eq!(effort("ctrlrange=\"-3 3\" ctrllimited=\"false\""), 100.0);
}

/// Masks have 32 bits and a sign, and a `<pair>` collides whatever they and `<exclude>` say.
#[test]
fn pairs_collide_whatever_the_masks_say() {
    let bodies = |one: &str, other: &str| {
        format!(
            "<body name=\"a\"><geom name=\"g\" size=\"0.1\" {one}/></body>\
             <body name=\"b\"><geom name=\"h\" size=\"0.1\" {other}/></body>"
        )
    };
    let pass = |one: &str, other: &str, contact: &str| {
        let more = format!("<contact>{contact}</contact>");
        let (tree, _) = text(&bodies(one, other), &more).expect("it is valid");
        !tree.passing.is_empty()
    };
    let (pair, exclude) = (
        "<pair geom1=\"h\" geom2=\"g\"/>",
        "<exclude body1=\"a\" body2=\"b\"/>",
    );
    let (high, low) = (
        "contype=\"2\" conaffinity=\"2\"",
        "contype=\"1\" conaffinity=\"1\"",
    );
    assert!(pass(high, low, ""));
    assert!(pass("", "", exclude));
    assert!(!pass("", "", ""));
    assert!(!pass(high, low, pair));
    assert!(!pass("", "", &format!("{exclude}{pair}")));
    assert!(!pass("contype=\"0\" conaffinity=\"0\"", low, pair));
    assert!(!pass("contype=\"-1\" conaffinity=\"0\"", high, ""));
}

/// The outer file drives, couples and separates the joints and bodies of an attached model.
#[test]
fn attached_joints_are_driven_from_outside() {
    let outer = |more: &str| {
        let bodies = "<body name=\"a\"><joint name=\"k\"/><geom size=\"0.05\"/>\
                      <frame><attach model=\"h\" body=\"h\" prefix=\"p_\"/></frame></body>";
        attaching("angle=\"radian\"", "sub/h.xml", bodies, more)
    };
    let inner = "<mujoco><compiler angle=\"radian\"/><worldbody><body name=\"h\">\
                 <joint name=\"j\" ref=\"0.25\"/><geom size=\"0.01\" contype=\"4\" conaffinity=\"4\"/></body></worldbody></mujoco>";
    let read = |more: &str| robot(&[("a.xml", &outer(more)), ("sub/h.xml", inner)]);
    let more = "<equality><joint joint1=\"p_j\" joint2=\"k\" polycoef=\"0 2 0 0 0\"/></equality>\
                <actuator><position joint=\"p_j\" forcerange=\"-7 7\" ctrlrange=\"-1 1\"/></actuator>";
    let (tree, _) = read(more).expect("it is valid");
    let driven = joint(&tree, "p_j");
    assert_eq!(
        (driven.effort, driven.lower, driven.upper),
        (7.0, -1.0, 1.0)
    );
    let mimic = driven.mimic.as_ref().expect("it follows");
    assert_eq!(
        (mimic.leader.as_str(), mimic.factor, mimic.offset),
        ("k", 2.0, 0.25)
    );
    assert_eq!(tree.passing, [["a".to_owned(), "p_h".to_owned()]]);
    for wrong in [
        "<equality><joint joint1=\"p_x\" joint2=\"k\"/></equality>",
        "<equality><joint joint1=\"k\" joint2=\"p_x\"/></equality>",
        "<actuator><motor joint=\"p_x\"/></actuator>",
    ] {
        let said = read(wrong).expect_err("there is no such joint");
        assert!(said.contains("W051") && said.contains("p_x"), "{said}");
    }
    let open = "<equality><connect body1=\"a\" body2=\"p_h\" anchor=\"0 0 0\"/></equality>";
    let (_, said) = read(open).expect("it is valid");
    assert!(said.to_string().contains("left open"), "{said}");
}

/// Two models with different attached models are different, even in their texts.
#[test]
fn the_text_of_a_model_has_that_of_attached_ones() {
    let outer = attaching("", "h.xml", "<attach model=\"h\" prefix=\"p_\"/>", "");
    let read = |size: &str| {
        let inner = file(&format!("<body><geom size=\"{size}\"/></body>"), "");
        with_first(
            &[("a.xml", &outer), ("h.xml", &inner)],
            |source, path, lookup| {
                mjcf::robot(source, path, lookup).map(|(_, text, _)| text.text.to_string())
            },
        )
    };
    assert!(read("0.123").is_ok_and(|text| text.contains("0.123")));
}

/// An actuator and an equality of a joint count for all its copies.
#[test]
fn copies_of_joints_are_driven_too() {
    let bodies = "<body name=\"a\"><replicate count=\"2\"><body name=\"b\"><joint name=\"j\"/><geom size=\"0.1\"/>\
                  <body name=\"c\"><joint name=\"k\"/><geom size=\"0.1\"/></body></body></replicate></body>";
    let more = "<equality><joint joint1=\"k\" joint2=\"j\"/></equality>\
                <actuator><motor joint=\"j\" ctrlrange=\"-4 4\"/></actuator>";
    let (tree, _) = text(bodies, more).expect("it is valid");
    for (leader, follower) in [("j0", "k0"), ("j1", "k1")] {
        assert_eq!(joint(&tree, leader).effort, 4.0);
        let mimic = joint(&tree, follower).mimic.as_ref();
        assert_eq!(mimic.map(|mimic| mimic.leader.as_str()), Some(leader));
    }
}

/// A mesh of an attached model is in the folder of its own file, and an absolute path is itself.
#[test]
fn meshes_are_named_from_the_right_folder() {
    let bodies = "<body name=\"a\"><geom size=\"0.05\"/><attach model=\"h\" body=\"h\" prefix=\"p_\"/></body>";
    let outer = attaching("meshdir=\"other\"", "sub\\h.xml", bodies, "");
    let inner = "<mujoco><compiler meshdir=\"meshes\"/><asset><mesh name=\"m\" file=\"t.stl\"/><mesh name=\"n\" file=\"/far/t.stl\"/>\
                 </asset><worldbody><body name=\"h\"><geom type=\"mesh\" mesh=\"m\" mass=\"0\"/>\
                 <geom type=\"mesh\" mesh=\"n\" mass=\"0\"/><inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"1 1 1\"/></body></worldbody></mujoco>";
    let (tree, _) = robot(&[("a.xml", &outer), ("sub/h.xml", inner)]).expect("it is valid");
    let files: Vec<&str> = tree
        .link("p_h")
        .expect("it is attached")
        .solids
        .iter()
        .filter_map(|solid| match &solid.geometry {
            TreeGeometry::Mesh { file, .. } => Some(file.as_str()),
            _ => None,
        })
        .collect();
    assert_eq!(files, ["sub/meshes/t.stl", "/far/t.stl"]);
}

/// Reading numbers whose products are not finite ends with a fault or a model.
#[test]
fn huge_numbers_end() {
    let mesh = |vertex: &str| {
        format!(
            "<asset><mesh name=\"m\" vertex=\"{vertex}\"/></asset><compiler boundmass=\"1\" boundinertia=\"1\"/>"
        )
    };
    let bodies = "<body name=\"b\"><joint/><geom type=\"mesh\" mesh=\"m\"/><geom type=\"box\" mesh=\"m\"/></body>";
    for vertex in [
        "0 0 0 1e200 0 0 0 1e200 0 0 0 1e200",
        "0 0 0 1e308 0 0 0 1e308 0 0 0 -1e308",
        "0 0 0 1e-200 0 0 0 1e-200 0 0 0 1e-200",
        "0 0 0 nan 0 0 0 1 0 0 0 inf",
    ] {
        let said = text(bodies, &mesh(vertex));
        assert!(said.is_err() || vertex.contains("1e-200"), "{vertex}");
    }
    for moments in ["1e308", "1e200", "-1e308"] {
        let body = format!(
            "<body><joint/><inertial pos=\"0 0 0\" mass=\"1\" fullinertia=\"{}\"/></body>",
            [moments; 6].join(" ")
        );
        let _ = text(
            &body,
            "<compiler boundmass=\"1\" boundinertia=\"1\" balanceinertia=\"true\"/>",
        );
    }
}

/// An attached model has the angles of its own file.
#[test]
fn attached_angles_are_those_of_their_file() {
    let bodies = "<attach model=\"h\" prefix=\"p_\"/>";
    let outer = attaching("angle=\"degree\" eulerseq=\"xyz\"", "h.xml", bodies, "");
    let inner = "<mujoco><compiler angle=\"radian\" eulerseq=\"zyx\"/><worldbody><body name=\"h\">\
                 <site name=\"s\" euler=\"0.3 0.5 0.7\"/></body></worldbody></mujoco>";
    let (tree, _) = robot(&[("a.xml", &outer), ("h.xml", inner)]).expect("it is valid");
    let found = joint(&tree, "p_s_fixed").origin.rotation;
    let expected = Quaternion::new(0.91263, 0.29378, 0.27944, 0.05213);
    assert!(found.angle_to(&UnitQuaternion::from_quaternion(expected)) < 1e-4);
}

/// A hull of many points is found once, however many geoms have it.
#[test]
fn large_meshes_are_read_once() {
    let start = std::time::Instant::now();
    let words = |[x, y, z]: [f64; 3]| format!("{x:.6} {y:.6} {z:.6}");
    let points: Vec<String> = ball(30_000).into_iter().map(words).collect();
    let asset = format!(
        "<asset><mesh name=\"m\" inertia=\"convex\" vertex=\"{}\"/></asset>",
        points.join(" ")
    );
    let bodies = "<body name=\"b\"><joint/><replicate count=\"100\"><geom type=\"mesh\" mesh=\"m\"/></replicate></body>";
    let (tree, _) = text(bodies, &asset).expect("it is valid");
    let kg = tree
        .link("b")
        .and_then(|link| link.inertial.as_ref())
        .map(|stated| stated.kg);
    let ball = 4.0 / 3.0 * std::f64::consts::PI * 1000.0;
    assert!(
        kg.is_some_and(|kg| (kg / (100.0 * ball) - 1.0).abs() < 1e-3),
        "{kg:?}"
    );
    assert!(
        start.elapsed().as_secs_f64() < 20.0,
        "{:?}",
        start.elapsed()
    );
}

/// Attached bodies are pieces of a world, soft bodies are refused, and a body that moves freely is
/// found however its joint is written.
#[test]
fn worlds_have_all_their_pieces() {
    let world = |bodies: &str| {
        let outer = file(
            bodies,
            "<default><default class=\"f\"><joint type=\"free\"/></default></default>\
             <asset><model name=\"h\" file=\"h.xml\"/></asset>",
        );
        let inner = file(&part("type=\"free\"", ""), "");
        with_first(&[("a.xml", &outer), ("h.xml", &inner)], mjcf_world::read).map(|(pieces, ..)| {
            let pieces = pieces.into_iter();
            let shown = pieces.map(|piece| {
                let n_solids: usize = piece.tree.links.iter().map(|link| link.solids.len()).sum();
                format!("{} {n_solids} {}", piece.name, piece.moves)
            });
            shown.collect::<Vec<_>>()
        })
    };
    let free = "<body name=\"x\"><joint class=\"f\"/><geom size=\"0.1\"/></body>\
                <body name=\"y\"><frame><freejoint/></frame><geom size=\"0.1\"/></body>\
                <body name=\"z\"><geom size=\"0.1\"/></body>";
    assert_eq!(
        world(free),
        Ok(["x 1 true", "y 1 true", "z 1 false"]
            .map(str::to_owned)
            .into())
    );
    let attached = "<frame pos=\"1 0 0\"><attach model=\"h\" body=\"b\" prefix=\"p_\"/></frame>\
                    <attach model=\"h\" prefix=\"q_\"/>";
    assert_eq!(
        world(attached),
        Ok(["p_b 1 true", "q_h 1 true"].map(str::to_owned).into())
    );
    let soft = world("<flexcomp name=\"s\" type=\"grid\"/>");
    assert!(soft.is_err_and(|said| said.contains("W035")));
}

/// A feature that would change the model is an error, and one that the model works without is a
/// warning.
#[test]
fn features_that_are_not_simulated_are_reported() {
    let robots = [
        ("<bodyy/>", "", "W035"),
        ("", "<contacts/>", "W036"),
        (
            "<geom size=\"0.1\" frictoin=\"1\"/>",
            "",
            "did you mean `friction`",
        ),
        (
            "<body gravcomp=\"1\"><geom size=\"0.1\"/></body>",
            "",
            "W036",
        ),
        ("<body mocap=\"true\"/>", "", "W036"),
        ("", "<option gravity=\"0 0 0\"/>", "W036"),
        ("", "<option><flag gravity=\"disable\"/></option>", "W036"),
        (
            "<body name=\"a\"/>",
            "<equality><weld body1=\"a\"/></equality>",
            "W035",
        ),
        (
            "<body name=\"a\"/><body name=\"m\" mocap=\"true\"/>",
            "<equality><weld body1=\"m\" body2=\"a\"/></equality>",
            "`<weld>` to a body",
        ),
        (&part("stiffness=\"2\"", ""), "", "W036"),
        (
            "<body name=\"a\"><geom type=\"sdf\" mesh=\"m\"/></body>",
            "",
            "W035",
        ),
        (
            "",
            "<contact><exclude body1=\"x\" body2=\"y\"/></contact>",
            "no body `x`",
        ),
        (
            "",
            "<contact><pair geom1=\"x\" geom2=\"y\"/></contact>",
            "no geom `x`",
        ),
        ("", "<compiler angle=\"grad\"/>", "W034"),
        (
            &part("", ""),
            "<actuator><motor joint=\"j\" gear=\"x\" ctrlrange=\"-1 1\"/></actuator>",
            "W034",
        ),
        (&part("type=\"hunge\"", ""), "", "W035"),
        (
            &part("", ""),
            "<equality><joint joint1=\"j\"/></equality>",
            "W035",
        ),
    ];
    for (bodies, more, code) in robots {
        let said = match text(bodies, more) {
            Ok((_, said)) => said.to_string(),
            Err(said) => said,
        };
        assert!(said.contains(code), "{bodies} {more}: {said}");
    }
    for (bodies, more) in [
        ("<geom type=\"hfield\"/>".to_owned(), ""),
        (part("stiffness=\"2\"", ""), ""),
        (
            part("", ""),
            "<equality><connect body1=\"b\" anchor=\"0 0 0\"/></equality>",
        ),
        (
            "<body gravcomp=\"1\"><geom size=\"0.1\"/></body>".to_owned(),
            "",
        ),
    ] {
        let said = object(&[("a.xml", &file(&bodies, more))]).expect_err("it is another object");
        assert!(said.contains("W035"), "{said}");
    }
    let (_, said) =
        text(&part("", ""), "<visual><x/></visual><size nconmax=\"9\"/>").expect("it is valid");
    assert!(said.is_empty(), "{said}");
}

/// A few lines ask for billions of bodies, of files, or of attached models.
#[test]
fn models_that_explode_are_refused_at_once() {
    let said = |files: &[(&str, &str)]| {
        let start = std::time::Instant::now();
        let said = tree_of(files).expect_err("it is far too large");
        assert!(said.contains("W055"), "{said}");
        assert!(said.matches("error").count() <= 2, "{said}");
        assert!(start.elapsed().as_secs_f64() < 5.0, "{:?}", start.elapsed());
        said
    };
    let nested = |open: &str, close: &str, n: usize| {
        let inside = "<geom size=\"0.1\"/>";
        let body = format!("{}{inside}{}", open.repeat(n), close.repeat(n));
        format!("<mujoco><worldbody>{body}</worldbody></mujoco>")
    };
    let copies = "<replicate count=\"1000\">";
    let bodies = nested(&format!("{copies}<body>"), "</body></replicate>", 3);
    assert!(said(&[("a.xml", &bodies)]).contains("more than 1000 bodies"));
    let geoms = nested(copies, "</replicate>", 5);
    assert!(said(&[("a.xml", &geoms)]).contains("more than 10000 elements"));
    let frames = nested("<frame>", "</frame>", 900);
    assert!(said(&[("a.xml", &frames)]).contains("frames in each other"));
    said(&[("a.xml", &nested("<body>", "</body>", 4_000))]);

    let include = |n: usize| {
        let twice = format!("<include file=\"{}.xml\"/>", n + 1).repeat(8);
        (format!("{n}.xml"), format!("<mujoco>{twice}</mujoco>"))
    };
    let mut files: Vec<(String, String)> = (0..7).map(include).collect();
    files.push((
        "7.xml".to_owned(),
        "<mujoco><worldbody/></mujoco>".to_owned(),
    ));
    let of = |files: &[(String, String)]| -> String {
        let files: Vec<(&str, &str)> = files
            .iter()
            .map(|(name, text)| (name.as_str(), text.as_str()))
            .collect();
        said(&files)
    };
    assert!(of(&files).contains("more than 1000 files"));

    let attach = |n: usize| {
        let asset = format!("<asset><model name=\"m\" file=\"{}.xml\"/></asset>", n + 1);
        let bodies: String = (0..8)
            .map(|idx| format!("<frame><attach model=\"m\" prefix=\"{idx}_\"/></frame>"))
            .collect();
        let text = format!("<mujoco>{asset}<worldbody>{bodies}</worldbody></mujoco>");
        (format!("{n}.xml"), text)
    };
    let mut files: Vec<(String, String)> = (0..7).map(attach).collect();
    files.push((
        "7.xml".to_owned(),
        "<mujoco><worldbody/></mujoco>".to_owned(),
    ));
    assert!(of(&files).contains("more than 1000 files"));
    files[7].1 = "<mujoco><worldbody><body/></worldbody></mujoco>".to_owned();
    of(&files);
}

/// The mass of a link.
fn kg(tree: &ModelTree, link: &str) -> f64 {
    let link = tree.link(link).expect("it has the link");
    link.inertial.as_ref().map_or(0.0, |inertial| inertial.kg)
}

const BALL: &str = "<geom size=\"0.1\"/>";

/// MuJoCo leaves out the contacts of pairs that the file excludes, and of geoms whose masks
/// don't meet.
#[test]
fn bodies_that_never_collide_are_named() {
    let bodies = format!(
        "<body name=\"a\">{BALL}<body name=\"b\">{BALL}</body></body><body name=\"c\">{BALL}</body>\
         <body name=\"d\"><geom size=\"0.1\" contype=\"2\" conaffinity=\"4\"/></body>"
    );
    let more = "<contact><exclude body1=\"c\" body2=\"a\"/></contact>";
    let tree = tree(&bodies, more).expect("it is valid");
    let pairs = [["a", "c"], ["a", "d"], ["b", "d"], ["c", "d"]];
    assert_eq!(tree.passing, pairs.map(|pair| pair.map(str::to_owned)));
}

/// Names of bodies and joints don't exclude each other; only a whole robot may move freely;
/// `ref` is the position at which the body is where the file puts it.
#[test]
fn joints_keep_their_names_and_positions() {
    let bodies = format!(
        "<body name=\"base\"><freejoint/>{BALL}<body name=\"jaw\" pos=\"0 0 1\">\
         <joint name=\"jaw\" axis=\"1 0 0\" ref=\"0.5\" range=\"0 1\"/>{BALL}</body></body>"
    );
    let tree = tree(&bodies, "").expect("it is valid");
    let base = tree.joint("base_free").expect("it moves freely");
    assert_eq!(base.motion, TreeMotion::Floating);
    let jaw = tree.joint("jaw").expect("it has a jaw");
    let roll_rad = jaw.origin.rotation.euler_angles().0;
    assert!((roll_rad + 0.5).abs() < 1e-9, "{roll_rad}");
}

/// The robot would lack a part, with no warning.
#[test]
fn bodies_of_unknown_models_are_refused() {
    let said = tree(
        "<body name=\"a\"><attach model=\"hand\" body=\"palm\" prefix=\"h_\"/></body>",
        "",
    );
    let said = said.expect_err("a hand is missing");
    assert!(
        said.contains("W035") && said.contains("to attach"),
        "{said}"
    );
}

/// Frames move the joints, geoms and bodies in them; a second `<worldbody>` counts as the
/// first; copies are numbered and each moves on from the one before it.
#[test]
fn frames_copies_and_further_worlds_are_tree() {
    let bodies = format!(
        "<body name=\"a\"><frame pos=\"0 0 1\" euler=\"0 0 1.5707963267948966\">\
         <joint name=\"turn\" axis=\"1 0 0\" pos=\"0.5 0 0\"/>{BALL}<body name=\"b\" pos=\"1 0 0\">{BALL}</body>\
         </frame></body></worldbody><worldbody><replicate count=\"12\" offset=\"0.5 0 0\" sep=\"_\">\
         <body name=\"c\" pos=\"0 0 2\">{BALL}</body></replicate>"
    );
    let tree = tree(&bodies, "").expect("it is valid");
    let near = |at: Isometry3<f64>, expected: [f64; 3]| {
        let off = (at.translation.vector - Vector3::from(expected)).norm();
        assert!(off < 1e-9, "{at} instead of {expected:?}");
    };
    let turn = tree.joint("turn").expect("it has the joint");
    near(turn.origin, [0.0, 0.5, 1.0]);
    assert!((turn.axis - Vector3::y()).norm() < 1e-9);
    let geom = &tree.link("a").expect("it has the body").solids[0];
    near(geom.pose, [0.0, -0.5, 0.0]);
    near(
        tree.joint("b_fixed").expect("it is fixed").origin,
        [0.0, 0.5, 0.0],
    );
    near(
        tree.joint("c_11_fixed").expect("it is a copy").origin,
        [5.5, 0.0, 2.0],
    );
    assert!(tree.link("c_12").is_none());
}

/// The masses of geoms by their own densities, of those that don't collide too, but for other
/// groups; `<general>` defaults of forces reach `<position>`.
#[test]
fn masses_and_forces_have_their_defaults() {
    let geoms = "<geom type=\"box\" size=\"0.05 0.05 0.05\" density=\"500\"/>\
                 <geom type=\"box\" size=\"0.05 0.05 0.05\" mass=\"2\" contype=\"0\" conaffinity=\"0\"/>\
                 <geom type=\"box\" size=\"0.05 0.05 0.05\" group=\"4\"/>";
    let bodies = format!("<body name=\"a\"><joint name=\"j\"/>{geoms}</body>");
    let more = "<compiler inertiagrouprange=\"0 3\"/>\
                <default><default class=\"weak\"><general forcerange=\"-4 4\"/></default></default>\
                <actuator><position class=\"weak\" joint=\"j\"/></actuator>";
    let tree = tree(&bodies, more).expect("it is valid");
    assert!((kg(&tree, "a") - 2.5).abs() < 1e-9);
    assert_eq!(tree.joint("j").map(|joint| joint.effort), Some(4.0));
}

/// The gain and the bias of a class of servos reach `<general>`: its signal is a position, and
/// not a force.
#[test]
fn an_actuator_has_the_kind_of_its_defaults() {
    let bodies = "<body name=\"a\"><joint name=\"j\"/><geom type=\"sphere\" size=\"0.1\"/></body>";
    let effort = |defaults: &str| {
        let more = format!(
            "<default><default class=\"c\">{defaults}</default></default>\
             <actuator><general class=\"c\" joint=\"j\" ctrlrange=\"-0.5 0.5\" gear=\"2\"/></actuator>"
        );
        let tree = tree(bodies, &more).expect("it is valid");
        tree.joint("j").map(|joint| joint.effort)
    };
    let servo = effort("<position kp=\"500\" forcerange=\"-3 3\"/>");
    assert_eq!(servo, Some(6.0));
    assert_eq!(effort("<motor forcerange=\"-3 3\"/>"), Some(1.0));
    assert_eq!(effort("<position kp=\"9\"/><motor/>"), Some(1.0));
}

/// Bodies without a mass are raised to the least one; an attached model is weighed by its own
/// rules alone, but the mass of the whole is that of all bodies. (As in MuJoCo 3.3.1.)
#[test]
fn masses_follow_the_rules_of_their_own_file() {
    let arm = |rules: &str| {
        let bodies = "<body name=\"a\"><joint/><geom size=\"0.05\"/><body name=\"empty\"><site name=\"s\"/></body>\
                      <frame><attach model=\"h\" body=\"h\" prefix=\"p_\"/></frame></body>";
        attaching(rules, "h.xml", bodies, "")
    };
    let hand = |rules: &str| {
        format!(
            "<mujoco><compiler {rules}/><worldbody><body name=\"h\"><joint/><geom size=\"0.01\"/></body>\
             </worldbody></mujoco>"
        )
    };
    for (of_arm, of_hand, masses) in [
        ("", "", [FRAC_PI_6, 0.0, 0.004_189]),
        (
            "",
            "boundmass=\"3\" boundinertia=\"0.3\"",
            [FRAC_PI_6, 0.0, 3.0],
        ),
        ("boundmass=\"7\"", "boundmass=\"3\"", [7.0, 7.0, 3.0]),
        ("boundmass=\"7\"", "", [7.0, 7.0, 0.004_189]),
        ("", "settotalmass=\"5\"", [FRAC_PI_6, 0.0, 0.004_189]),
        (
            "settotalmass=\"9\"",
            "settotalmass=\"5\"",
            [8.928_571, 0.0, 0.071_429],
        ),
    ] {
        let tree = tree_of(&[("a.xml", &arm(of_arm)), ("h.xml", &hand(of_hand))]);
        let tree = tree.expect("it is valid");
        for (link, expected) in ["a", "empty", "p_h"].into_iter().zip(masses) {
            let found = kg(&tree, link);
            assert!(
                (found - expected).abs() < 1e-5,
                "{link}: {found}, {of_arm}, {of_hand}"
            );
        }
        assert!(tree.link("s").is_some_and(|site| site.inertial.is_none()));
    }
    let said = tree_of(&[("a.xml", &hand("inertiafromgeom=\"false\""))]);
    assert!(said.is_err_and(|said| said.contains("moves and has no mass")));
    let tree = tree_of(&[("a.xml", &hand("inertiafromgeom=\"false\" boundmass=\"2\""))]);
    assert!((kg(&tree.expect("it is valid"), "h") - 2.0).abs() < 1e-9);
}

/// A box between two points is as deep as it is wide, and a mesh of vertices alone is their
/// hull.
#[test]
fn shapes_are_as_mujoco_has_them() {
    let bodies = "<body name=\"a\"><geom type=\"box\" size=\"0.02\" fromto=\"0 0 0 0 0 0.12\"/></body>\
                  <body name=\"b\"><geom type=\"mesh\" mesh=\"m\" density=\"100\"/></body>\
                  <body name=\"c\"><geom type=\"box\" mesh=\"m\"/></body>";
    let more = "<asset><mesh name=\"m\" vertex=\"0 0 0 1 0 0 0 2 0 1 2 0 0 0 3 1 0 3 0 2 3 1 2 3\"/></asset>";
    let tree = tree(bodies, more).expect("it is valid");
    let size = |link: &str| {
        let shape = tree.link(link)?.solids[0].geometry.solid()?;
        match shape {
            Shape::Box { size } => Some(size),
            _ => None,
        }
    };
    let near = |found: Option<[f64; 3]>, expected: [f64; 3]| {
        let found = found.expect("it is a box");
        let off = (Vector3::from(found) - Vector3::from(expected)).norm();
        assert!(off < 1e-9, "{found:?}");
    };
    near(size("a"), [0.04, 0.04, 0.12]);
    near(size("c"), [1.0, 2.0, 3.0]);
    assert!((kg(&tree, "b") - 600.0).abs() < 1e-9);
}
