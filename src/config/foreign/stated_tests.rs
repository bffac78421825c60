//! Objects and worlds of SDF and URDF have the values that their files state, or are refused.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::Point3;

use crate::foreign::files_for_tests::{folder, sdf_model as sdf};
use crate::foreign::folder::Read;
use crate::foreign::world::{self, WorldModels};
use crate::foreign::{Lookup, find, read};
use actcheck_base::{Files, Source};
use actcheck_data::{ObjectModel, Part, Pose, bounds};

const BOX: &str = "<geometry><box><size>0.05 0.05 0.1</size></box></geometry>";

/// Reads the models of a folder by their names, each with its warnings.
fn models(lookup: &Lookup) -> BTreeMap<String, Result<Read, String>> {
    let found = lookup.folders.iter().flat_map(|at| find(lookup.files, at));
    found
        .map(|found| {
            let model = read(&found, lookup).map_err(|faults| faults.to_string());
            (found.name, model)
        })
        .collect()
}

fn lookup(folder: &tempfile::TempDir) -> Lookup<'static> {
    Lookup::new(
        &Files::Disk,
        ["m", "m/objects"].map(|at| folder.path().join(at)).into(),
    )
}

/// Reads the object `thing` of a file. Returns it with the warnings.
fn object(files: &[(&str, &str)]) -> Result<(ObjectModel, String), String> {
    let folder = folder("m", files);
    let thing = models(&lookup(&folder)).remove("thing");
    let read = thing.expect("its file is found")?;
    Ok((read.model, read.warnings.to_string()))
}

/// Loads an object that is one link in SDF.
fn link(inside: &str) -> Result<(ObjectModel, String), String> {
    model(&format!("<link name=\"l\">{inside}</link>"))
}

fn model(inside: &str) -> Result<(ObjectModel, String), String> {
    object(&[("thing.sdf", &sdf(inside))])
}

fn urdf(inside: &str) -> Result<(ObjectModel, String), String> {
    let text = format!("<robot name=\"thing\">{inside}</robot>");
    object(&[("thing.urdf", &text)])
}

/// The furniture of the world `thing`, each with the middle of its bounding box and its size, and
/// the warnings.
fn furniture(files: &[(&str, &str)], inside: &str) -> Result<(Vec<String>, String), String> {
    let text = format!("<sdf version=\"1.9\"><world name=\"w\">{inside}</world></sdf>");
    let folder = folder("m", files);
    let lookup = lookup(&folder);
    let read = models(&lookup).into_iter();
    let read: Vec<(String, Read)> = read
        .map(|(name, read)| Ok((name, read?)))
        .collect::<Result<_, String>>()?;
    let posed = read
        .iter()
        .filter(|(_, read)| read.has_pose)
        .map(|(name, _)| name.clone());
    let included = WorldModels {
        posed: &posed.collect(),
        models: &read
            .into_iter()
            .map(|(name, read)| (name, Arc::new(read.model)))
            .collect(),
        lookup: &lookup,
    };
    let path = folder.path().join("m/worlds/thing.sdf");
    let source = Source::new("thing.sdf", text);
    let (world, found) = world::read("thing", &source, &path, &included);
    let world = world.ok_or_else(|| found.to_string())?;
    let pieces = world.map.furniture.iter().map(|piece| {
        let at = piece.pose.to_isometry();
        let placed = |part: &Part| Part {
            pose: Pose::from_isometry(&(at * part.pose.to_isometry())),
            shape: part.shape.clone(),
        };
        let own = world.models.iter().find(|model| model.name == piece.model);
        let model = own.unwrap_or_else(|| &included.models[&piece.model]);
        let (low, high) = bounds(&model.parts.iter().map(placed).collect::<Vec<_>>());
        let words = |numbers: [f64; 3]| {
            numbers
                .map(|number| format!("{:.3}", number + 0.0).replace("-0.000", "0.000"))
                .join(" ")
        };
        let (middle, size) = ((low + high) / 2.0, high - low);
        format!(
            "{}: {} | {}",
            piece.name,
            words(middle.into()),
            words(size.into())
        )
    });
    Ok((pieces.collect(), found.to_string()))
}

fn near(found: f64, expected: f64) {
    assert!(
        (found - expected).abs() <= 1e-9 * expected.abs().max(1e-3),
        "{found} is not {expected}"
    );
}

#[test]
fn a_mass_follows_from_volumes_and_densities_where_the_file_asks_for_it() {
    let collision = |density: &str, pose: &str| {
        format!("<collision name=\"c\">{pose}{density}{BOX}</collision>")
    };
    let density = "<density>2700</density>";
    let raised = "<pose>0 0 0.1 0 0 0</pose>";
    for (inertial, collisions, kg, height) in [
        (
            "<inertial auto=\"true\"/>",
            collision(density, ""),
            0.675,
            0.05,
        ),
        ("<inertial auto=\"True\"/>", collision("", ""), 0.25, 0.05),
        (
            "<inertial auto=\"1\"><density>800</density></inertial>",
            collision("", ""),
            0.2,
            0.05,
        ),
        (
            "<inertial auto=\"true\"><density>800</density></inertial>",
            collision(density, "") + &collision("", raised),
            0.875,
            (0.675 * 0.05 + 0.2 * 0.15) / 0.875,
        ),
        // A stated mass scales the computed moments.
        (
            "<inertial auto=\"true\"><mass>1.5</mass></inertial>",
            collision(density, ""),
            1.5,
            0.05,
        ),
        (
            "<inertial auto=\"false\"><mass>0.3</mass></inertial>",
            collision("", ""),
            0.3,
            0.05,
        ),
    ] {
        let (model, warnings) = link(&format!("{inertial}{collisions}")).expect(inertial);
        assert_eq!(warnings, "", "{inertial}");
        near(model.mass_kg, kg);
        let Some(inertia) = model.inertia else {
            assert!(inertial.contains("false"), "{inertial}");
            continue;
        };
        near(inertia.com_m[2], height);
        if collisions.len() < 200 {
            near(inertia.about_com[2][2], kg * 0.05 * 0.05 / 6.0);
            near(
                inertia.about_com[0][0],
                kg * (0.05 * 0.05 + 0.1 * 0.1) / 12.0,
            );
        }
    }
    // Without moments, the stated centre is used with those of the shapes.
    let heavy_below = "<inertial><mass>0.3</mass><pose>0 0 -0.04 0 0 0</pose></inertial>";
    let (model, _) = link(&format!("{heavy_below}{}", collision("", ""))).expect("it has a mass");
    let inertia = model.inertia.expect("it has a centre");
    near(inertia.com_m[2], 0.01);
    near(inertia.about_com[2][2], 0.3 * 0.05 * 0.05 / 6.0);
    let (round, _) = link(
        "<inertial auto=\"true\"/><collision name=\"c\"><geometry><ellipsoid><radii>0.03 0.03 0.05</radii></ellipsoid>\
         </geometry></collision>",
    )
    .expect("it is an ellipsoid");
    near(
        round.mass_kg,
        4000.0 / 3.0 * std::f64::consts::PI * 0.03 * 0.03 * 0.05,
    );
    let (_, warnings) = link(&collision(density, "")).expect("a density may be there");
    assert!(warnings.contains("`<density>` has no effect"), "{warnings}");
}

#[test]
fn materials_of_sdf_are_read_or_refused() {
    let of = |surface: &str| {
        link(&format!(
            "<collision name=\"c\">{BOX}<surface>{surface}</surface></collision>"
        ))
    };
    let friction = |inside: &str| format!("<friction>{inside}</friction>");
    for (surface, friction, restitution) in [
        (friction("<ode><mu>0.3</mu><mu2>0.3</mu2></ode>"), 0.3, 0.0),
        (friction("<bullet><friction>0.4</friction></bullet>"), 0.4, 0.0),
        (
            friction("<ode><mu>0.3</mu><slip1>0</slip1><fdir1>0 0 0</fdir1></ode><torsional><coefficient>1</coefficient></torsional>"),
            0.3,
            0.0,
        ),
        (
            "<bounce><restitution_coefficient>0.5</restitution_coefficient><threshold>0.01</threshold></bounce>".to_owned(),
            1.0,
            0.5,
        ),
        (
            "<bounce><restitution_coefficient>0.5</restitution_coefficient><threshold>1e6</threshold></bounce>".to_owned(),
            1.0,
            0.0,
        ),
        (
            "<contact><collide_bitmask>0x01</collide_bitmask><collide_without_contact>False</collide_without_contact></contact>".to_owned(),
            1.0,
            0.0,
        ),
    ] {
        let (model, warnings) = of(&surface).expect(&surface);
        assert_eq!(warnings, "", "{surface}");
        assert_eq!((model.friction, model.restitution), (friction, restitution), "{surface}");
    }
    let drake = link(&format!(
        "<collision name=\"c\">{BOX}<drake:proximity_properties><drake:mu_dynamic>0.7</drake:mu_dynamic>\
         </drake:proximity_properties></collision>"
    ));
    assert_eq!(drake.map(|(model, _)| model.friction), Ok(0.7));
    for (surface, expected) in [
        (friction("<ode><mu>0.3</mu><mu2>0.5</mu2></ode>"), "depend on the direction"),
        (friction("<bullet><rolling_friction>0.1</rolling_friction></bullet>"), "`<rolling_friction>` of 0.1"),
        (
            friction("<torsional><coefficient>0.5</coefficient><patch_radius>0.01</patch_radius></torsional>"),
            "torsional friction of 0.5",
        ),
        ("<contact><collide_without_contact>TRUE</collide_without_contact></contact>".to_owned(), "without contact forces"),
        ("<contact><collide_bitmask>0</collide_bitmask></contact>".to_owned(), "touches nothing"),
        (
            "<bounce><restitution_coefficient>0.5</restitution_coefficient><threshold>1</threshold></bounce>".to_owned(),
            "bouncing only from 1 m/s",
        ),
    ] {
        let said = of(&surface).expect_err(&surface);
        assert!(said.contains("W035") && said.contains(expected), "{said}");
    }
}

#[test]
fn materials_of_urdf_are_read_or_refused() {
    let of = |contact: &str, gazebo: &str| {
        urdf(&format!(
            "<link name=\"l\">{contact}<inertial><mass value=\"0.12\"/><inertia ixx=\"8e-5\" ixy=\"0\" ixz=\"0\" iyy=\"4e-5\" \
             iyz=\"0\" izz=\"9e-5\"/></inertial><collision><geometry><box size=\"0.05 0.08 0.04\"/></geometry></collision>\
             </link>{gazebo}"
        ))
    };
    let pybullet = |inside: &str| format!("<contact>{inside}</contact>");
    let gazebo = |inside: &str| format!("<gazebo reference=\"l\">{inside}</gazebo>");
    for (contact, extra, friction, restitution) in [
        (
            pybullet("<lateral_friction value=\"0.2\"/><rolling_friction value=\"0\"/>"),
            String::new(),
            0.2,
            0.0,
        ),
        (
            pybullet("<restitution value=\"0.4\"/>"),
            String::new(),
            1.0,
            0.4,
        ),
        (
            String::new(),
            gazebo("<mu1>0.3</mu1><mu2>0.3</mu2><turnGravityOff>FALSE</turnGravityOff>"),
            0.3,
            0.0,
        ),
        (
            String::new(),
            gazebo(
                "<collision><surface><friction><ode><mu>0.6</mu></ode></friction></surface></collision>",
            ),
            0.6,
            0.0,
        ),
    ] {
        let (model, warnings) = of(&contact, &extra).expect(&contact);
        assert_eq!(warnings, "");
        assert_eq!(
            (model.friction, model.restitution, model.fixed),
            (friction, restitution, false)
        );
    }
    let drake = urdf(
        "<link name=\"l\" xmlns:drake=\"d\"><collision><geometry><box size=\"0.05 0.08 0.04\"/></geometry><drake:proximity_properties>\
         <drake:mu_dynamic value=\"0.7\"/></drake:proximity_properties></collision></link>",
    );
    assert_eq!(drake.map(|(model, _)| model.friction), Ok(0.7));
    let (scaled, _) = of(&pybullet("<inertia_scaling value=\"3\"/>"), "").expect("it has moments");
    near(
        scaled.inertia.expect("they are stated").about_com[0][0],
        2.4e-4,
    );
    let (still, _) = of("", "<gazebo><static>True</static></gazebo>").expect("it is static");
    assert!(still.fixed);
    for (contact, extra, expected) in [
        (
            pybullet("<rolling_friction value=\"0.01\"/>"),
            String::new(),
            "`<rolling_friction>` of 0.01",
        ),
        (
            pybullet("<spinning_friction value=\"0.01\"/>"),
            String::new(),
            "`<spinning_friction>` of 0.01",
        ),
        (
            String::new(),
            gazebo("<mu1>0.3</mu1><mu2>0.5</mu2>"),
            "depend on the direction",
        ),
        (
            String::new(),
            gazebo("<gravity>0</gravity>"),
            "without gravity",
        ),
        (
            String::new(),
            gazebo("<dampingFactor>0.1</dampingFactor>"),
            "no air drag",
        ),
    ] {
        let said = of(&contact, &extra).expect_err(expected);
        assert!(said.contains("W035") && said.contains(expected), "{said}");
    }
}

#[test]
fn booleans_are_read_as_gazebo_does() {
    let collision = format!("<collision name=\"c\">{BOX}</collision>");
    for (written, is_static) in [
        ("true", true),
        ("True", true),
        (" TRUE ", true),
        ("1", true),
        ("False", false),
        ("0", false),
    ] {
        let text = format!("<static>{written}</static><link name=\"l\">{collision}</link>");
        assert_eq!(
            model(&text).map(|(model, _)| model.fixed),
            Ok(is_static),
            "{written}"
        );
    }
    let turned =
        format!("<link name=\"l\"><pose degrees=\"TRUE\">0 0 0 90 0 0</pose>{collision}</link>");
    near(model(&turned).expect("it is turned").0.size_m[2], 0.05);
    let said = model(&format!(
        "<static>yes</static><link name=\"l\">{collision}</link>"
    ));
    assert!(said.is_err_and(|said| said.contains("W034")));
}

/// The middle of each part of a model, sorted, in the frame of the first.
fn middles(model: &ObjectModel) -> Vec<[f64; 3]> {
    let first = model.parts[0].pose.to_isometry();
    let middles = model.parts.iter().map(|part| {
        let [x, y, z] = part.pose.position;
        let local = first.inverse() * Point3::new(x, y, z);
        [local.x, local.y, local.z].map(|number| (number * 1e6).round() / 1e6 + 0.0)
    });
    middles.collect()
}

/// A shelf that includes, or nests, a handle by each way that SDF has.
#[test]
fn models_in_models_are_where_their_files_put_them() {
    const SOLID: &str = "<collision name=\"c\"><geometry><box><size>0.1 0.1 0.1</size></box></geometry></collision>";
    let handle = format!(
        "<frame name=\"grip\"><pose>0 0.2 0 0 0 0</pose></frame><frame name=\"back\" attached_to=\"bar\"><pose>0 -0.3 0 0 0 0</pose></frame>\
         <link name=\"bar\">{SOLID}</link>"
    );
    let file = |attributes: &str, pose: &str| {
        format!(
            "<sdf version=\"1.9\"><model name=\"handle\"{attributes}>{pose}{handle}</model></sdf>"
        )
    };
    let plain = file("", "<pose>0 0 0.5 0 0 0</pose>");
    let placed = file(" placement_frame=\"grip\"", "<pose>1 0 0 0 0 0</pose>");
    let fixed = |child: &str| {
        format!(
            "<joint name=\"j\" type=\"fixed\"><parent>base</parent><child>{child}</child></joint>"
        )
    };
    let base = format!(
        "<link name=\"base\">{SOLID}</link><frame name=\"side\"><pose>0 1 0 0 0 1.5707963267948966</pose></frame>"
    );
    let include = |attributes: &str, inside: &str| {
        format!("<include{attributes}><uri>model://handle</uri>{inside}</include>")
    };
    let merge = " merge=\"true\"";
    for (name, file, inside, expected) in [
        (
            "own pose",
            &plain,
            include("", "") + &fixed("handle::bar"),
            [0.0, 0.0, 0.5],
        ),
        (
            "other pose",
            &plain,
            include("", "<pose>1 0 0 0 0 0</pose>") + &fixed("handle::bar"),
            [1.0, 0.0, 0.0],
        ),
        (
            "placed by a frame",
            &plain,
            include(
                "",
                "<name>h</name><pose>1 0 0 0 0 0</pose><placement_frame>grip</placement_frame>",
            ) + &fixed("h::back"),
            [1.0, -0.2, 0.0],
        ),
        (
            "placed by its own frame",
            &placed,
            include("", "") + &fixed("handle"),
            [1.0, -0.2, 0.0],
        ),
        (
            "its own frame at another pose",
            &placed,
            include("", "<pose>0 0 2 0 0 0</pose>") + &fixed("handle::__model__"),
            [0.0, -0.2, 2.0],
        ),
        (
            "in a frame of the parent",
            &plain,
            include("", "<pose relative_to=\"side\">1 0 0 0 0 0</pose>") + &fixed("handle::bar"),
            [0.0, 2.0, 0.0],
        ),
        (
            "merged",
            &plain,
            include(merge, "<pose>1 0 0 0 0 0</pose>") + &fixed("back"),
            [1.0, 0.0, 0.0],
        ),
        (
            "nested",
            &plain,
            format!(
                "<model name=\"n\" placement_frame=\"back\"><pose relative_to=\"side\">0 0 0 0 0 0</pose>{handle}</model>"
            ) + &fixed("n::grip"),
            [-0.3, 1.0, 0.0],
        ),
    ] {
        let outer = sdf(&format!("{base}{inside}"));
        let files = [
            ("handle/model.sdf", file.as_str()),
            ("thing/model.sdf", outer.as_str()),
        ];
        let (model, warnings) = object(&files).unwrap_or_else(|said| panic!("{name}: {said}"));
        assert_eq!(warnings, "", "{name}");
        assert_eq!(middles(&model), [[0.0; 3], expected], "{name}");
    }
    // A link of the parent in a frame of an included model, and a drawer that carries a handle.
    let on_frame = format!(
        "{base}{}<link name=\"tag\"><pose relative_to=\"handle::grip\">0 0 1 0 0 0</pose>{SOLID}</link>\
         <joint name=\"t\" type=\"fixed\"><parent>handle::bar</parent><child>tag</child></joint>",
        include("", "") + &fixed("handle::bar")
    );
    let drawer = format!(
        "{base}<link name=\"drawer\"><pose>1 0 0 0 0 0</pose>{SOLID}</link>{}<joint name=\"t\" type=\"prismatic\"><parent>base</parent>\
         <child>drawer</child><axis><xyz>1 0 0</xyz><limit><lower>0</lower><upper>0.3</upper></limit></axis></joint>\
         <joint name=\"s\" type=\"fixed\"><parent>drawer</parent><child>handle::grip</child></joint>",
        include("", "<pose relative_to=\"drawer\">0.1 0 0 0 0 0</pose>")
    );
    let read = |inside: &str| {
        let outer = sdf(inside);
        object(&[
            ("handle/model.sdf", plain.as_str()),
            ("thing/model.sdf", outer.as_str()),
        ])
    };
    let (model, _) = read(&on_frame).unwrap_or_else(|said| panic!("{said}"));
    assert_eq!(
        middles(&model),
        [[0.0; 3], [0.0, 0.2, 1.5], [0.0, 0.0, 0.5]]
    );
    let (model, _) = read(&drawer).unwrap_or_else(|said| panic!("{said}"));
    assert_eq!((model.parts.len(), model.moving.len()), (1, 1));
    assert_eq!(middles(&model.moving[0].model), [[0.0; 3], [0.1, 0.0, 0.0]]);
    for (inside, expected) in [
        (
            format!("{base}{}", include("", "")),
            "no joint connects `handle::bar`",
        ),
        (
            format!("{base}{}{}", include("", ""), fixed("handle::bra")),
            "the model has no link `handle::bra`",
        ),
        (
            format!(
                "{base}{}",
                include("", "<pose/><placement_frame>gripp</placement_frame>")
            ),
            "no frame `gripp`",
        ),
        (
            format!(
                "{base}{}{}",
                include("", "<static>1</static>"),
                fixed("handle::bar")
            ),
            "static model inside",
        ),
    ] {
        let said = read(&inside).expect_err(expected);
        assert!(said.contains(expected), "{said}");
    }
}

#[test]
fn unread_elements_that_change_an_object_are_errors() {
    let collision = format!("<collision name=\"c\">{BOX}</collision>");
    let hinged = |axis: &str, more: &str| {
        format!(
            "{more}<link name=\"a\">{collision}</link><link name=\"b\">{collision}</link><joint name=\"j\" type=\"revolute\">\
             <parent>a</parent><child>b</child><axis><xyz>1 0 0</xyz>{axis}</axis></joint>"
        )
    };
    for (inside, expected) in [
        (hinged("<mimic joint=\"k\"/>", ""), "`<mimic>`"),
        (
            hinged(
                "<dynamics><spring_stiffness>2</spring_stiffness></dynamics>",
                "",
            ),
            "no springs",
        ),
        (
            hinged("<initial_position>0.4</initial_position>", ""),
            "begins at 0",
        ),
        (
            hinged("", "<self_collide>true</self_collide>"),
            "collide with each other",
        ),
        (
            format!(
                "<link name=\"l\">{collision}<velocity_decay><linear>0.1</linear></velocity_decay></link>"
            ),
            "no air drag",
        ),
        (
            format!(
                "<link name=\"l\"><inertial><mass>1</mass><fluid_added_mass/></inertial>{collision}</link>"
            ),
            "`<fluid_added_mass>`",
        ),
    ] {
        let said = model(&inside).expect_err(expected);
        assert!(said.contains("W035") && said.contains(expected), "{said}");
    }
    for inside in [
        hinged(
            "<dynamics><spring_stiffness>0</spring_stiffness></dynamics>",
            "",
        ),
        format!(
            "<self_collide>1</self_collide><link name=\"l\">{collision}<velocity_decay><linear>0.0</linear></velocity_decay></link>"
        ),
    ] {
        assert_eq!(
            model(&inside).map(|(_, warnings)| warnings),
            Ok(String::new()),
            "{inside}"
        );
    }
    let (_, warnings) = link(&format!(
        "<pase/><sensor name=\"s\" type=\"imu\"/>{collision}"
    ))
    .expect("both are ignored");
    assert!(warnings.contains("did you mean `pose`"), "{warnings}");
    assert_eq!(
        warnings.matches("the model works without it").count(),
        1,
        "{warnings}"
    );
}

/// Gazebo saves the places of models, and those that were added and removed, in `<state>`.
#[test]
fn a_saved_world_is_in_its_first_state() {
    const BODY: &str = "<static>1</static><link name=\"body\"><pose>0 0 0.3 0 0 0</pose><collision name=\"c\"><geometry><box>\
        <size>0.6 1.0 0.6</size></box></geometry></collision></link>";
    let crate_file = format!("<sdf version=\"1.6\"><model name=\"crate\">{BODY}</model></sdf>");
    let files = [("crate/model.sdf", crate_file.as_str())];
    let desk = format!("<model name=\"desk\"><pose>0 0 0 0 0 0</pose>{BODY}</model>");
    let plain = "desk: 0.000 0.000 0.300 | 0.600 1.000 0.600";
    let include = "<include><uri>model://ground_plane</uri></include><include><uri>model://crate</uri><name>box</name></include>";
    let state =
        |inside: &str| format!("<state world_name=\"w\"><sim_time>12 0</sim_time>{inside}</state>");
    let of = |name: &str, pose: &str, inside: &str| {
        format!("<model name=\"{name}\"><pose>{pose}</pose>{inside}</model>")
    };
    let at_link = |pose: &str| {
        format!("<link name=\"body\"><pose>{pose}</pose><velocity>0 0 0 0 0 0</velocity></link>")
    };
    for (models, state, expected) in [
        (desk.clone(), state(""), vec![plain]),
        (
            desk.clone(),
            state(&of(
                "desk",
                "3 2 0 0 0 0",
                &format!("<scale>1 1 1</scale>{}", at_link("3 2 0.3 0 0 0")),
            )) + &state(&of("desk", "5 5 0 0 0 0", "")),
            vec!["desk: 3.000 2.000 0.300 | 0.600 1.000 0.600"],
        ),
        (
            desk.clone(),
            state(&of(
                "desk",
                "3 2 0 0 0 0",
                &at_link("4 2 0.3 0 0 1.5707963267948966"),
            )),
            vec!["desk: 4.000 2.000 0.300 | 1.000 0.600 0.600"],
        ),
        (
            desk.clone(),
            state(&of("desk", "3 2 0 0 0 0", "<scale>2 1 1</scale>")),
            vec!["desk: 3.000 2.000 0.300 | 1.200 1.000 0.600"],
        ),
        (
            include.to_owned(),
            state(
                &(of(
                    "box",
                    "3 2 0 0 0 1.5707963267948966",
                    &at_link("3 2 0.3 0 0 1.5707963267948966"),
                ) + &of("ground_plane", "0 0 0 0 0 0", "")),
            ),
            vec!["box: 3.000 2.000 0.300 | 1.000 0.600 0.600"],
        ),
        (
            include.to_owned(),
            state(&of("box", "3 2 0 0 0 0", &at_link("3 3 0.3 0 0 0"))),
            vec!["box: 3.000 3.000 0.300 | 0.600 1.000 0.600"],
        ),
        (
            format!("{desk}{include}"),
            state(&format!(
                "<deletions><name>desk</name></deletions><insertions><model name=\"new\"><pose>4 0 0 0 0 0</pose>{BODY}</model>\
                 </insertions>"
            )),
            vec![
                "box: 0.000 0.000 0.300 | 0.600 1.000 0.600",
                "new: 4.000 0.000 0.300 | 0.600 1.000 0.600",
            ],
        ),
        (
            format!(
                "<model name=\"set\"><static>1</static><model name=\"part\"><pose>1 0 0 0 0 0</pose>{BODY}</model></model>"
            ),
            state(&of(
                "set",
                "0 2 0 0 0 0",
                &of("part", "3 2 0 0 0 0", &at_link("3 2 0.3 0 0 0")),
            )),
            vec!["set: 3.000 2.000 0.300 | 0.600 1.000 0.600"],
        ),
    ] {
        let (found, warnings) = furniture(&files, &format!("{models}{state}")).expect(&state);
        assert_eq!(found, expected, "{state}");
        assert_eq!(warnings, "", "{state}");
    }
    let (_, warnings) = furniture(
        &files,
        &format!("{desk}{}", state(&of("dsk", "1 0 0 0 0 0", ""))),
    )
    .expect("Gazebo loads it, too");
    assert!(
        warnings.contains("the world has no such model"),
        "{warnings}"
    );
    for (inside, expected) in [
        (state(&of("desk", "3 2 0", "")), "6 numbers"),
        (
            state(&of("desk", "3 2 0 0 0 0", "<scale>0 1 1</scale>")),
            "`<scale>`",
        ),
        (
            "<gravity>0 0 -1.6</gravity>".to_owned(),
            "gravity of 0 0 -1.6",
        ),
        ("<population name=\"p\"/>".to_owned(), "`<population>`"),
    ] {
        let said = furniture(&files, &format!("{desk}{inside}")).expect_err(expected);
        assert!(said.contains(expected), "{said}");
    }
}

/// Frames of a world, of the models that it includes, and models that are placed by a frame.
#[test]
fn models_of_a_world_are_where_its_frames_put_them() {
    const SOLID: &str = "<static>true</static><frame name=\"top\"><pose>0 0 1 0 0 0</pose></frame><link name=\"l\"><pose>0 0 0.5 0 0 0</pose>\
        <collision name=\"c\"><geometry><box><size>0.2 0.4 1.0</size></box></geometry></collision></link>";
    let post = format!("<sdf version=\"1.8\"><model name=\"post\">{SOLID}</model></sdf>");
    let hung = format!(
        "<sdf version=\"1.8\"><model name=\"hung\" placement_frame=\"top\"><pose>1 1 3 0 0 0</pose>{SOLID}</model></sdf>"
    );
    let files = [
        ("post/model.sdf", post.as_str()),
        ("hung/model.sdf", hung.as_str()),
    ];
    let include = |model: &str, name: &str, inside: &str| {
        format!("<include><uri>model://{model}</uri><name>{name}</name>{inside}</include>")
    };
    let desk = include("post", "desk", "<pose>2 1 0 0 0 0</pose>");
    let size = "0.200 0.400 1.000";
    for (inside, expected) in [
        (
            "<frame name=\"corner\" attached_to=\"desk\"><pose>0.2 0.3 0 0 0 0</pose></frame>"
                .to_owned()
                + &include(
                    "post",
                    "b",
                    "<pose relative_to=\"corner\">1 0 0 0 0 0</pose>",
                ),
            "b: 3.200 1.300 0.500",
        ),
        (
            include(
                "post",
                "b",
                "<pose relative_to=\"desk::top\">0 0 0 0 0 0</pose>",
            ),
            "b: 2.000 1.000 1.500",
        ),
        (
            include(
                "post",
                "b",
                "<pose>4 0 2 0 0 0</pose><placement_frame>top</placement_frame>",
            ),
            "b: 4.000 0.000 1.500",
        ),
        (include("hung", "b", ""), "b: 1.000 1.000 2.500"),
        (
            include("hung", "b", "<pose>4 0 2 0 0 0</pose>"),
            "b: 4.000 0.000 1.500",
        ),
        (
            format!(
                "<model name=\"b\" placement_frame=\"top\"><pose relative_to=\"desk\">4 0 2 0 0 0</pose>{SOLID}</model>"
            ),
            "b: 6.000 1.000 1.500",
        ),
    ] {
        let (found, warnings) = furniture(&files, &format!("{desk}{inside}")).expect(&inside);
        assert_eq!(
            found,
            [
                format!("desk: 2.000 1.000 0.500 | {size}"),
                format!("{expected} | {size}")
            ]
        );
        assert_eq!(warnings, "", "{inside}");
    }
    let unknown = include(
        "post",
        "b",
        "<pose relative_to=\"desk::topp\">0 0 0 0 0 0</pose>",
    );
    let said = furniture(&files, &format!("{desk}{unknown}")).expect_err("there is none");
    assert!(
        said.contains("the world has no frame `desk::topp`"),
        "{said}"
    );
}

#[test]
fn flat_folders_hold_models_of_every_format() {
    let brick = sdf(&format!(
        "<link name=\"l\"><collision name=\"c\">{BOX}</collision></link>"
    ));
    for path in [
        "thing.sdf",
        "objects/thing.sdf",
        "thing/thing.sdf",
        "thing/model.sdf",
    ] {
        let (model, _) = object(&[(path, &brick)]).unwrap_or_else(|said| panic!("{path}: {said}"));
        near(model.mass_kg, 0.25);
    }
    for uri in [
        "model://brick",
        "model://brick.sdf",
        "model://sub/brick.sdf",
    ] {
        let outer = sdf(&format!("<include><uri>{uri}</uri></include>"));
        let files = [
            ("thing/model.sdf", outer.as_str()),
            ("brick.sdf", &brick),
            ("sub/brick.sdf", &brick),
        ];
        let (model, _) = object(&files).unwrap_or_else(|said| panic!("{uri}: {said}"));
        near(model.mass_kg, 0.25);
    }
    let world = "<sdf version=\"1.6\"><world name=\"w\"/></sdf>";
    let said = object(&[("thing.sdf", world)]).expect_err("it is a world");
    assert!(said.contains("belongs in the folder `worlds`"), "{said}");
}
