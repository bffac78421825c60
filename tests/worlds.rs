//! Worlds: the shipped ones are valid, scenes are inside them, rules see their maps, and faults are
//! reported.
//!
//! A wrong world is a case of `WRONG` below: a text, and its diagnostics.

use std::f64::consts::PI;
use std::path::Path;

use actcheck::base::{Diagnostics, Source, Term, names};
use actcheck::campaign::Env;
use actcheck::config::{self, Campaign, Overrides};
use actcheck::data::{Choices, Part, Pose, Role, Scene, bounds};
use actcheck::rules::Budget;
use actcheck::scenario::{FloorPlan, Solid, draw};

use crate::support::{actcheck, root, stderr};

const TABLES: &str = "[pickObject]\nmodel_list = [\"glass\", \"mug\"]\n[surfaceObjects]\nmodel_list = [\"can\", \"bowl\"]\ncount = [1, 3]\n";

fn campaign(folder: &Path, text: &str) -> Result<Campaign, Diagnostics> {
    let text = format!("tests = [[\"Pick\"]]\ntest_count = 1\n{text}");
    config::load_text(Source::new("c.toml", text), folder, &Overrides::default())
}

fn env(text: &str) -> (tempfile::TempDir, Env) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c.toml");
    std::fs::write(
        &path,
        format!("tests = [[\"Pick\"]]\ntest_count = 2\n{text}"),
    )
    .unwrap();
    let env = Env::prepare_within(&path, &Overrides::default(), Budget::default())
        .unwrap_or_else(|found| panic!("{found}"));
    (folder, env)
}

fn scenes(env: &Env, n: u64) -> Vec<Scene> {
    let drawn: Vec<Scene> = (0..n)
        .filter_map(|index| draw(&env.space, 0, &mut Choices::random(7, index)).ok())
        .collect();
    assert!(
        drawn.len() as u64 > n / 2,
        "more than half of the scenes are discarded: {} of {n} are left",
        drawn.len()
    );
    drawn
}

const EVERYWHERE: &str = "[world]\nworlds = [\"apartment\", \"lab\"]\n[objectSurface]\nobject_surfaces = [\"dining_table\", \
    \"coffee_table\", \"side_table\", \"kitchen_cabinet\", \"left_bench\", \"right_bench\", \"assembly_table\"]\n";

/// Furniture and walls do not overlap, and a robot fits at every location.
#[test]
fn shipped_worlds_have_free_space() {
    for (name, surface) in [
        ("apartment", "dining_table"),
        ("lab", "left_bench"),
        ("empty_room", "table"),
        ("kitchen", "kitchen_table"),
    ] {
        let (_folder, env) = env(&format!(
            "[world]\nworlds = [\"{name}\"]\n[objectSurface]\nobject_surfaces = [\"{surface}\"]\n{TABLES}"
        ));
        let mut scene = draw(&env.space, 0, &mut Choices::recorded(&[])).unwrap();
        scene.objects.retain(|object| object.role == Role::Platform);
        let walls = |object: &&actcheck::data::SceneObject| object.model.name == "wall";
        let solids: Vec<(String, Solid)> = scene
            .objects
            .iter()
            .filter(|o| !walls(o))
            .map(|o| (o.id.clone(), Solid::new(&o.model, &o.pose)))
            .collect();
        for (idx, (id, solid)) in solids.iter().enumerate() {
            for (other_id, other) in &solids[idx + 1..] {
                assert!(
                    !solid.is_in_the_way_of(other),
                    "{name}: {id} overlaps {other_id}"
                );
            }
            for wall in scene.objects.iter().filter(walls) {
                assert!(
                    !solid.is_in_the_way_of(&Solid::new(&wall.model, &wall.pose)),
                    "{name}: {id} overlaps {}",
                    wall.id
                );
            }
        }
        for location in &env.campaign.worlds[name].locations {
            for object in &scene.objects {
                let local = object.pose.to_isometry().inverse()
                    * nalgebra::Point3::new(location.at[0], location.at[1], 0.0);
                let gap = (local.x.abs() - object.model.size_m[0] / 2.0)
                    .max(local.y.abs() - object.model.size_m[1] / 2.0);
                assert!(
                    gap > 0.35,
                    "{name}: {} is {gap} m from {}",
                    location.name,
                    object.id
                );
            }
        }
    }
    let campaign = campaign(Path::new(""), "[world]\nworlds = [\"apartment\"]\n").unwrap();
    let kinds: Vec<&str> = campaign.worlds["apartment"]
        .furniture
        .iter()
        .map(|piece| piece.model.as_str())
        .collect();
    for kind in [
        "table",
        "shelf",
        "sofa",
        "cabinet",
        "coffee_table",
        "mini_coffee_table",
    ] {
        assert!(kinds.contains(&kind), "{kinds:?}");
    }
}

/// A project with a configuration for `MoveTo`, prepared to draw its scenes.
fn driving(folder: &Path, text: &str) -> Env {
    let path = folder.join("c.toml");
    std::fs::write(
        &path,
        format!("tests = [[\"MoveTo\"]]\ntest_count = 2\n{text}"),
    )
    .unwrap();
    Env::prepare_within(&path, &Overrides::default(), Budget::default())
        .unwrap_or_else(|found| panic!("{found}"))
}

/// Regression: without a surface for objects, locations in front of furniture were never chosen,
/// and each drive failed: "no place was named to drive to".
#[test]
fn a_robot_is_sent_to_any_of_the_locations_if_no_surface_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let names = ["dining_table_front", "side_table_front"];
    let text =
        format!("[world]\nworlds = [\"apartment\"]\n[objectLocation]\nlocation_list = {names:?}\n");
    let env = driving(folder.path(), &text);
    let sent: std::collections::BTreeSet<String> = scenes(&env, 20)
        .iter()
        .map(|scene| scene.designators["objectLocation"][0].clone())
        .collect();
    assert_eq!(sent.into_iter().collect::<Vec<_>>(), names);
}

/// A static model of a world, with one shape.
fn static_model(name: &str, at: &str, geometry: &str) -> String {
    format!(
        "<model name=\"{name}\"><static>true</static><pose>{at} 0 0 0</pose><link name=\"l\"><collision name=\"c\">\
         <geometry>{geometry}</geometry></collision></link></model>"
    )
}

/// A robot drives over a carpet: as a piece of furniture, it would be in the way.
#[test]
fn carpets_are_part_of_the_floor() {
    let folder = tempfile::tempdir().unwrap();
    let worlds = folder.path().join("models/worlds");
    std::fs::create_dir_all(&worlds).unwrap();
    let corners = "v -1 -1 0\nv 1 -1 0\nv 1 1 0.0005\nv -1 1 0.0005\nf 1 2 3 4\n";
    std::fs::write(worlds.join("carpet.obj"), corners).unwrap();
    let pieces = [
        static_model("carpet", "2 0 0.001", "<mesh><uri>carpet.obj</uri></mesh>"),
        static_model(
            "marking",
            "0 2 0.001",
            "<box><size>1 0.1 0.002</size></box>",
        ),
        static_model("table", "4 0 0.3", "<box><size>0.8 0.8 0.6</size></box>"),
    ];
    let text = format!(
        "<sdf version=\"1.6\"><world name=\"house\">{}</world></sdf>",
        pieces.concat()
    );
    std::fs::write(worlds.join("house.world"), text).unwrap();
    let text = "model_dir = \"models\"\n[world]\nworlds = [\"house\"]\n[objectLocation]\nlocation_list = [\"table_front\"]\n";
    let env = driving(folder.path(), text);
    let said = env.campaign.warnings.to_string();
    for name in ["carpet", "marking"] {
        assert!(
            said.contains(&format!("`{name}` rises less than 5 mm")),
            "{said}"
        );
    }
    let scene = draw(&env.space, 0, &mut Choices::recorded(&[])).unwrap();
    let ids: Vec<&str> = scene
        .objects
        .iter()
        .map(|object| object.id.as_str())
        .collect();
    assert_eq!(ids, ["table"]);
}

/// The walls of a house as one mesh: 8 m by 4 m, 0.2 m thick and 2.5 m high, with a gap of 1 m in
/// the south wall.
fn house_mesh() -> String {
    let outer = [
        [0.5, -2.0],
        [4.0, -2.0],
        [4.0, 2.0],
        [-4.0, 2.0],
        [-4.0, -2.0],
        [-0.5, -2.0],
    ];
    let inner = [
        [-0.5, -1.8],
        [-3.8, -1.8],
        [-3.8, 1.8],
        [3.8, 1.8],
        [3.8, -1.8],
        [0.5, -1.8],
    ];
    let corners = [outer, inner].concat();
    let vertices = [0.0, 2.5].map(|z| {
        corners
            .iter()
            .map(|[x, y]| format!("v {x} {y} {z}\n"))
            .collect::<String>()
    });
    let tops = [
        [0, 1, 10, 11],
        [1, 2, 9, 10],
        [2, 3, 8, 9],
        [3, 4, 7, 8],
        [4, 5, 6, 7],
    ];
    let above = tops.iter().map(|ring| ring.map(|idx| idx + 12));
    let below = tops.iter().map(|[a, b, c, d]| [*d, *c, *b, *a]);
    let sides = (0..12).map(|idx| [idx, (idx + 1) % 12, (idx + 1) % 12 + 12, idx + 12]);
    let faces = above
        .chain(below)
        .chain(sides)
        .map(|[a, b, c, d]| format!("f {} {} {} {}\n", a + 1, b + 1, c + 1, d + 1));
    vertices.concat() + &faces.collect::<String>()
}

/// Regression: the box around the house was an obstacle on the robot's map, as were its ceiling and
/// the slab below it. Every drive inside failed.
#[test]
fn a_robot_drives_in_a_house_of_one_mesh() {
    let folder = tempfile::tempdir().unwrap();
    let worlds = folder.path().join("models/worlds");
    std::fs::create_dir_all(&worlds).unwrap();
    std::fs::write(worlds.join("walls.obj"), house_mesh()).unwrap();
    let pieces = [
        static_model("slab", "0 0 0.02", "<box><size>10 6 0.06</size></box>"),
        static_model(
            "house",
            "0 0 0.05",
            "<mesh><uri>file://models/worlds/walls.obj</uri></mesh>",
        ),
        static_model("ceiling", "0 0 2.6", "<box><size>8 4 0.1</size></box>"),
        static_model(
            "table",
            "-3.3 0 0.35",
            "<box><size>0.8 0.8 0.6</size></box>",
        ),
        static_model(
            "niche",
            "3.4 1.4 0.35",
            "<box><size>0.8 0.8 0.6</size></box>",
        ),
        static_model("lost", "0 0 34358.2", "<box><size>0.8 0.8 0.6</size></box>"),
    ];
    let text = format!(
        "<sdf version=\"1.6\"><world name=\"home\">{}</world></sdf>",
        pieces.concat()
    );
    std::fs::write(worlds.join("home.world"), text).unwrap();
    let text = "model_dir = \"models\"\n[world]\nworlds = [\"home\"]\n[objectLocation]\n\
                location_list = [\"table_front\"]\n";
    let env = driving(folder.path(), text);
    let said = env.campaign.warnings.to_string();
    for expected in [
        "`slab` is the floor: the world is moved down by 5.0 cm",
        "`lost` at (0.0, 0.0, 34357.8) is",
        "no location: `niche`\n",
    ] {
        assert!(said.contains(expected), "{said}");
    }
    for scene in scenes(&env, 5) {
        let plan = FloorPlan::of(&scene);
        let is_free = |x: f64, y: f64| {
            plan.outlines.iter().all(|outline| {
                let local = outline.pose.to_isometry().inverse() * nalgebra::Point3::new(x, y, 0.0);
                (0..2).any(|axis| local[axis].abs() > outline.size_m[axis] / 2.0 + 0.36)
            })
        };
        assert!(
            is_free(0.0, -1.9)
                && is_free(2.0, 0.0)
                && is_free(0.0, 0.0)
                && !is_free(2.0, -1.9)
                && !is_free(-3.9, 0.0)
        );
        let location = plan
            .locations
            .iter()
            .find(|location| location.name == "table_front")
            .unwrap();
        let [x, y, heading] = location.at;
        assert!(
            (x + 3.3 - 0.4 - 0.69).abs() < 1e-6
                && y.abs() < 1e-6
                && (heading.abs() - PI).abs() < 1e-6,
            "{location:?}"
        );
        let table = scene
            .objects
            .iter()
            .find(|object| object.id == "table")
            .unwrap();
        assert!(table.pose.position[2].abs() < 1e-6, "{table:?}");
    }
    let done = actcheck(folder.path(), &["run", "c.toml", "--history", "h"]);
    assert_eq!(done.status.code(), Some(0), "{}", stderr(&done));
}

/// Objects are on the drawn surface, anywhere in the world, and the robot faces it.
#[test]
fn scenes_match_their_world() {
    let (_folder, env) = env(&format!("{EVERYWHERE}{TABLES}"));
    let scenes = scenes(&env, 60);
    let mut surfaces = std::collections::BTreeSet::new();
    for scene in &scenes {
        let platform = &scene.objects[0];
        assert_eq!(
            scene.designators["objectSurface"],
            std::slice::from_ref(&platform.id)
        );
        surfaces.insert(platform.id.clone());
        let surface = platform.model.surface.unwrap();
        for object in scene
            .objects
            .iter()
            .filter(|object| matches!(object.role, Role::Target | Role::Other))
        {
            let local = platform.pose.to_isometry().inverse()
                * nalgebra::Point3::from(object.pose.position);
            assert!(
                local.x.abs() < surface.size_m[0] / 2.0 && local.y.abs() < surface.size_m[1] / 2.0,
                "{}",
                object.id
            );
            assert!((local.z - surface.height_m).abs() < 1e-9);
        }
        let [x, y, heading] = scene.robot.base;
        let local = platform.pose.to_isometry().inverse() * nalgebra::Point3::new(x, y, 0.0);
        assert!(
            local.x < -surface.size_m[0] / 2.0 - 0.5 && local.y.abs() < 0.06,
            "{local}"
        );
        assert!((heading - platform.pose.yaw()).abs() < 0.06);
        assert!(!scene.map.is_empty());
    }
    assert!(surfaces.len() >= 6, "{surfaces:?}");
}

#[test]
fn obstacles_are_on_the_floor_and_clear_of_the_base_and_objects() {
    for text in [
        format!(
            "nav_obstacle_list = [\"box\", \"bottle\"]\nnav_obstacle_count = 4\n{EVERYWHERE}{TABLES}"
        ),
        format!(
            "nav_obstacle_list = [\"box\"]\nnav_obstacle_count = 3\n[objectSurface]\nobject_surfaces = [\"table\"]\n{TABLES}"
        ),
    ] {
        let (_folder, env) = env(&text);
        for scene in scenes(&env, 20) {
            let obstacles: Vec<_> = scene
                .objects
                .iter()
                .filter(|object| object.role == Role::Obstacle)
                .collect();
            assert!(obstacles.len() >= 3);
            for obstacle in obstacles {
                assert_eq!(obstacle.pose.position[2], 0.0);
                let solid = Solid::new(&obstacle.model, &obstacle.pose);
                for other in scene.objects.iter().filter(|other| other.id != obstacle.id) {
                    assert!(
                        !solid.is_in_the_way_of(&Solid::new(&other.model, &other.pose)),
                        "{} and {}",
                        obstacle.id,
                        other.id
                    );
                }
                let [x, y, _] = scene.robot.base;
                assert!((x - obstacle.pose.position[0]).hypot(y - obstacle.pose.position[1]) > 0.4);
            }
        }
    }
}

/// Other objects are placed on the goal surface too, in a world and without one, and only if the
/// configuration requests them.
#[test]
fn the_goal_surface_can_be_cluttered() {
    let others = "[surfaceObjects]\nmodel_list = [\"mug\", \"bottle\"]\ncount = 2\n[pickObject]\nmodel_list = [\"can\"]\n";
    for world in [
        "[world]\nworlds = [\"apartment\"]\n[objectSurface]\nobject_surfaces = [\"dining_table\"]\n[placeSurface]\nplace_object_surfaces = [\"side_table\", \"coffee_table\"]\n",
        "[objectSurface]\nobject_surfaces = [\"table\"]\n[placeSurface]\nplace_object_surfaces = [\"coffee_table\"]\n",
    ] {
        let at_place = |scene: &Scene| -> Vec<actcheck::data::SceneObject> {
            scene
                .objects
                .iter()
                .filter(|object| object.role == Role::PlaceOther)
                .cloned()
                .collect()
        };
        let (_folder, bare) = env(&format!("{world}{others}"));
        assert!(
            scenes(&bare, 10)
                .iter()
                .all(|scene| at_place(scene).is_empty())
        );
        let (_folder, env) = env(&format!("{world}count = [1, 4]\n{others}"));
        let mut counts = std::collections::BTreeSet::new();
        for scene in scenes(&env, 40) {
            let standing = at_place(&scene);
            counts.insert(standing.len());
            let place = &scene.designators["placeSurface"][0];
            let platform = scene
                .objects
                .iter()
                .find(|object| object.id == *place)
                .unwrap();
            let surface = platform.model.surface.unwrap();
            for object in &standing {
                let local = platform.pose.to_isometry().inverse()
                    * nalgebra::Point3::from(object.pose.position);
                assert!(
                    local.x.abs() < surface.size_m[0] / 2.0
                        && local.y.abs() < surface.size_m[1] / 2.0
                );
                assert!(
                    (local.z - surface.height_m).abs() < 1e-9,
                    "{} is not on {place}",
                    object.id
                );
                assert!(!scene.designators["surfaceObjects"].contains(&object.id));
                assert_eq!(
                    scene
                        .objects
                        .iter()
                        .filter(|other| other.id == object.id)
                        .count(),
                    1
                );
            }
        }
        assert_eq!(counts, [1, 2, 3, 4].into());
    }
}

/// Sizes, lying objects and the start of the base are drawn if the configuration says so.
#[test]
fn scenes_use_every_parameter() {
    let text = format!(
        "[objectSurface]\nobject_surfaces = [\"table\"]\n[placeSurface]\nplace_object_surfaces = [\"coffee_table\"]\n{}\
         lying = 0.5\n[physics]\nsize_scale = [0.95, 1.05]\n[robot]\nstart_x_m = [-2.5, -2.0]\nstart_y_m = [-1, 1]\nstart_heading_rad = [0, 1]\n",
        TABLES.replace("\"bowl\"", "\"bottle\"")
    );
    let (_folder, env) = env(&text);
    let scenes = scenes(&env, 40);
    let others: Vec<_> = scenes
        .iter()
        .flat_map(|scene| &scene.objects)
        .filter(|object| object.role == Role::Other)
        .collect();
    let lying = others
        .iter()
        .filter(|object| object.pose.tilt() > 1.5)
        .count();
    assert!(
        lying > others.len() / 5 && lying < others.len() * 4 / 5,
        "{lying} of {}",
        others.len()
    );
    for scene in &scenes {
        let [x, y, heading] = scene.robot.base;
        assert!(
            (-2.5..=-2.0).contains(&x)
                && (-1.0..=1.0).contains(&y)
                && (0.0..=1.0).contains(&heading)
        );
        let target = scene
            .objects
            .iter()
            .find(|object| object.role == Role::Target)
            .unwrap();
        let scale = target.model.size_m[2] / env.campaign.models[&target.model.name].size_m[2];
        assert!((0.95..=1.05).contains(&scale) && scale != 1.0, "{scale}");
        assert_eq!(scene.designators["placeSurface"], ["coffee_table_1"]);
    }
    // A lying object stays in place: its lowest point is on the table.
    let bottle = others
        .iter()
        .find(|object| object.model.name == "bottle" && object.pose.tilt() > 1.5)
        .unwrap();
    let low = bottle.model.parts.iter().map(|part| {
        let at = bottle.pose.to_isometry() * part.pose.to_isometry();
        actcheck::data::Part {
            pose: actcheck::data::Pose::from_isometry(&at),
            shape: part.shape.clone(),
        }
        .bounds()
        .0[2]
    });
    let lowest = low.fold(f64::INFINITY, f64::min);
    assert!((lowest - 0.74).abs() < 0.005, "{lowest}");
}

/// Rules can query locations: the map is part of every state.
#[test]
fn the_map_is_part_of_the_facts() {
    let text = "[world]\nworlds = [\"apartment\"]\n[objectLocation]\nlocation_list = [\"dining_table_front\"]\n[objectSurface]\n\
        object_surfaces = [\"dining_table\"]\n";
    let (_folder, env) = env(&format!("{text}{TABLES}"));
    let scene = scenes(&env, 1).remove(0);
    let trace = actcheck::data::Trace {
        snapshots: vec![actcheck::world::build(&scene).unwrap().snapshot()],
        map: scene.map.clone(),
        ..actcheck::data::Trace::default()
    };
    let facts = actcheck::facts::extract(&trace);
    let holds = |subject: &str, property: &str, object: Term| {
        facts.snapshots[0].iter().any(|[s, p, o]| {
            *facts.terms.term(*s) == Term::iri(names::w(subject))
                && *facts.terms.term(*p) == Term::iri(names::w(property))
                && *facts.terms.term(*o) == object
        })
    };
    assert!(holds(
        "location/dining_table_front",
        "ofSurface",
        Term::iri(names::obj("dining_table"))
    ));
    assert!(holds(
        "location/dining_table_front",
        "inRoom",
        Term::iri(names::w("room/kitchen"))
    ));
    assert!(holds("room/kitchen", "highX", Term::Double(4.0)));
    for [_, property, _] in &facts.snapshots[0] {
        let Term::Iri(property) = facts.terms.term(*property) else {
            panic!("properties are IRIs")
        };
        let known = env.ontology.vocabulary.terms.contains_key(&**property)
            || !property.starts_with(names::W);
        assert!(known, "{property} is not in ontology/world.ttl");
    }
}

/// A fault of a world: the text of `models/worlds/wrong.toml`, and the beginnings of all its
/// diagnostics.
const WRONG: [(&str, &[&str]); 12] = [
    (
        "rooms = 3",
        &["C004 m/worlds/wrong.toml:1:9: `rooms` must be a list of tables"],
    ),
    (
        "[[wals]]\nfrom_m = [0, 0]",
        &["C003 m/worlds/wrong.toml:1:3: unknown key `wals`"],
    ),
    (
        "[[walls]]\nfrom_m = [0, 0]",
        &["C005 m/worlds/wrong.toml:1:1: `walls[1].to_m` is missing"],
    ),
    (
        "[[walls]]\nfrom_m = [1, 1]\nto_m = [1, 1]",
        &["W044 m/worlds/wrong.toml:1:1: the wall has no length"],
    ),
    (
        "[[walls]]\nfrom_m = [1, 1]\nto_m = [1, 99]",
        &["C006 m/worlds/wrong.toml:3:12: `walls[1].to_m` is 99"],
    ),
    (
        "[[rooms]]\nname = \"r\"\nlow_m = [1, 1]\nhigh_m = [0, 2]",
        &["W044 m/worlds/wrong.toml:1:1: the room has no area"],
    ),
    (
        "[[furniture]]\nname = \"t\"\nmodel = \"tabel\"\nat_m = [0, 0]",
        &["W040 m/worlds/wrong.toml:3:9: there is no usable model `tabel`"],
    ),
    (
        "[[furniture]]\nname = \"t\"\nmodel = \"table\"\nat_m = [0, 0, 0]",
        &["C004 m/worlds/wrong.toml:4:8: `furniture[1].at_m` must be a list of 2 numbers"],
    ),
    (
        "[[furniture]]\nname = \"t\"\nmodel = \"table\"\nat_m = [0, 0]\n[[furniture]]\nname = \"t\"\nmodel = \"table\"\nat_m = [3, 0]",
        &["W041 m/worlds/wrong.toml:6:8: there are two `t`"],
    ),
    (
        "[[locations]]\nname = \"l\"\nat_m = [0, 0]\nsurface = \"t\"",
        &["W042 m/worlds/wrong.toml:4:11: the world has no surface `t`"],
    ),
    (
        "[[furniture]]\nname = \"t\"\nmodel = \"table\"\nat_m = [0, 0]\n[[locations]]\nname = \"l\"\nat_m = [0.5, 0]\nsurface = \"t\"",
        &["W043 m/worlds/wrong.toml:7:1: the location is inside `t`"],
    ),
    (
        "name = [",
        &["C002 m/worlds/wrong.toml:1:9: this is not TOML"],
    ),
];

#[test]
fn wrong_worlds_are_reported_with_their_places() {
    for (text, expected) in WRONG {
        let folder = tempfile::tempdir().unwrap();
        let models = folder.path().join("m");
        std::fs::create_dir_all(models.join("worlds")).unwrap();
        crate::support::copy(&root().join("models/objects"), &models.join("objects"));
        std::fs::write(models.join("worlds/wrong.toml"), text).unwrap();
        let found = campaign(
            folder.path(),
            "model_dir = \"m\"\n[world]\nworlds = [\"wrong\"]\n",
        )
        .unwrap_err();
        let said = found
            .to_string()
            .replace(&format!("{}/", folder.path().display()), "");
        for part in expected {
            assert!(
                said.contains(part),
                "{text}\n-- expected\n{part}\n-- said\n{said}"
            );
        }
        assert_eq!(
            said.matches("  help: ").count(),
            said.lines().count() / 2,
            "each fault has its help:\n{said}"
        );
    }
}

/// Configurations that refer to missing places.
#[test]
fn unknown_place_names_are_reported() {
    let said = |text: &str| match campaign(Path::new(""), text) {
        Err(found) => found.to_string(),
        Ok(campaign) => {
            let ontology =
                actcheck::ontology::load(&campaign.ontology.0, &campaign.ontology.1).unwrap();
            actcheck::scenario::Space::check(&campaign, &ontology)
                .map_or_else(|found| found.to_string(), |()| String::new())
        }
    };
    for (text, expected) in [
        (
            "[world]\nworlds = [\"apartement\"]\n",
            "C020 c.toml:4:11: there is no world `apartement`\n  help: did you mean `apartment`?",
        ),
        (
            "[world]\nworlds = [\"lab\"]\n[objectSurface]\nobject_surfaces = [\"left_bank\"]\n",
            "C021 c.toml:6:20: no world of the configuration has a surface `left_bank`\n  help: did you mean `left_bench`?",
        ),
        (
            "[world]\nworlds = [\"lab\"]\n[objectLocation]\nlocation_list = [\"dor\"]\n",
            "C021 c.toml:6:18: no world of the configuration has a location `dor`",
        ),
        (
            "[world]\nworlds = [\"lab\", \"apartment\"]\n[objectSurface]\nobject_surfaces = [\"left_bench\"]\n[pickObject]\nmodel_list = [\"glass\"]\n",
            "S009 c.toml:4:18: the world `apartment` has none of the surfaces",
        ),
        (
            "[world]\nworlds = [\"lab\"]\n[objectLocation]\nlocation_list = [\"right_bench_front\"]\n[objectSurface]\nobject_surfaces = [\"left_bench\"]\n[pickObject]\nmodel_list = [\"glass\"]\n",
            "S009 c.toml:5:2: none of the locations is in front of `left_bench`",
        ),
        (
            "[robot]\nstart_x_m = [0, 1]\n",
            "C005 c.toml:3:2: `robot.start_y_m` is missing",
        ),
        (
            "[physics]\nsize_scale = [0, 1]\n",
            "C006 c.toml:4:15: `physics.size_scale` is 0",
        ),
        (
            "[pickObject]\nmodel_list = [\"glass\"]\nlying = 2\n",
            "C006 c.toml:5:9: `pickObject.lying` is 2",
        ),
    ] {
        let said = said(text);
        assert!(
            said.contains(expected),
            "{text}\n-- expected\n{expected}\n-- said\n{said}"
        );
    }
}

/// A Gazebo world with included models works unchanged; unsupported elements are reported.
#[test]
fn a_gazebo_world_gets_its_included_models() {
    let folder = tempfile::tempdir().unwrap();
    let models = folder.path().join("m");
    crate::support::copy(&root().join("tests/models/gazebo"), &models);
    std::fs::create_dir_all(models.join("worlds")).unwrap();
    let include = |name: &str, pose: &str| {
        format!(
            "<include><uri>model://cafe_table</uri><name>{name}</name><pose>{pose}</pose></include>"
        )
    };
    let world = |inside: &str| {
        format!(
            "<sdf version=\"1.6\"><world name=\"cafe\"><include><uri>model://sun</uri></include>\
             <include><uri>model://ground_plane</uri></include><physics type=\"ode\"/>{inside}</world></sdf>"
        )
    };
    let read = |inside: &str| {
        std::fs::write(models.join("worlds/cafe.world"), world(inside)).unwrap();
        campaign(
            folder.path(),
            "model_dir = \"m\"\n[world]\nworlds = [\"cafe\"]\n",
        )
    };
    let campaign = read(&format!(
        "{}{}",
        include("near", "1 0 0 0 0 0"),
        include("far", "3 1 0 0 0 1.5707963")
    ))
    .unwrap();
    let map = &campaign.worlds["cafe"];
    let names: Vec<&str> = map
        .furniture
        .iter()
        .map(|piece| piece.name.as_str())
        .collect();
    assert_eq!(names, ["near", "far"]);
    let front = map
        .locations
        .iter()
        .find(|location| location.name == "far_front")
        .unwrap();
    assert!(
        (front.at[0] - 3.0).abs() < 1e-3 && (front.at[1] - (1.0 - 0.4 - 0.69)).abs() < 1e-3,
        "{front:?}"
    );
    for (inside, expected) in [
        (
            "<include><uri>model://sofa_bed</uri></include>".to_owned(),
            "the model `sofa_bed` is missing",
        ),
        (
            "<include><uri>model://broken_lamp</uri></include>".to_owned(),
            "the model `broken_lamp` can't be used: ",
        ),
        (
            format!(
                "{}{}",
                include("a", "0 0 0 0 0 0"),
                include("a", "3 0 0 0 0 0")
            ),
            "W041",
        ),
        (
            "<model name=\"a\"><include><uri>model://b</uri></include></model>".to_owned(),
            "the model `b` is missing",
        ),
        (
            "<model><link/></model>".to_owned(),
            "`<model>` has no attribute `name`",
        ),
    ] {
        let said = read(&inside).unwrap_err().to_string();
        assert!(said.contains(expected), "{inside}: {said}");
    }
}

/// Worlds as people publish them. Each line of `expected` has the name of a solid, with the lowest
/// and the highest corner of its bounding box.
#[test]
fn gazebo_worlds_have_their_solids_in_the_same_places() {
    const BOX: &str = "<link name=\"l\"><collision name=\"c\"><geometry><box><size>2 1 0.5</size></box></geometry></collision></link>";
    let model =
        |inside: &str| format!("<sdf version=\"1.5\"><model name=\"m\">{inside}</model></sdf>");
    let files = [
        ("crate", model(BOX)),
        ("raised", model(&format!("<pose>0 0 3 0 0 0</pose>{BOX}"))),
        (
            "door",
            model(&format!(
                "{BOX}<link name=\"leaf\"/><joint name=\"hinge\" type=\"revolute\"/>"
            )),
        ),
        (
            "pair",
            model(
                "<include><uri>model://crate</uri></include><include><uri>model://crate</uri><pose>0 4 0 0 0 0</pose></include>",
            ),
        ),
        ("loop", model("<include><uri>model://loop</uri></include>")),
        ("Traffic_Cone", model(BOX)),
        ("traffic_light", model(BOX)),
    ];
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let model = folder.path().join("m").join(name);
        std::fs::create_dir_all(&model).unwrap();
        std::fs::write(model.join("model.sdf"), text).unwrap();
    }
    std::fs::create_dir_all(folder.path().join("m/worlds")).unwrap();
    let solids = |version: &str, inside: &str| {
        let text = format!(
            "<!-- a -- b -->\n<?xml version=\"1.0\"?><sdf version=\"{version}\"><world name=\"w\">{inside}</world></sdf>"
        );
        std::fs::write(folder.path().join("m/worlds/w.world"), text).unwrap();
        let campaign = campaign(
            folder.path(),
            "model_dir = \"m\"\n[world]\nworlds = [\"w\"]\n",
        )
        .map_err(|found| found.to_string())?;
        let lines = campaign.worlds["w"].furniture.iter().map(|piece| {
            let place = |part: &Part| Part {
                pose: Pose::from_isometry(&(piece.pose.to_isometry() * part.pose.to_isometry())),
                shape: part.shape.clone(),
            };
            let parts: Vec<Part> = campaign.models[&piece.model]
                .parts
                .iter()
                .map(place)
                .collect();
            let (low, high) = bounds(&parts);
            let corner = |at: nalgebra::Vector3<f64>| {
                <[f64; 3]>::from(at)
                    .map(|value| format!("{value:.2}").replace("-0.00", "0.00"))
                    .join(" ")
            };
            format!("{}: {} to {}", piece.name, corner(low), corner(high))
        });
        Ok::<Vec<String>, String>(lines.collect())
    };
    let include =
        |name: &str, more: &str| format!("<include><uri>model://{name}</uri>{more}</include>");
    for (inside, expected) in [
        (format!("<model name=\"a\"><pose>1 2 0.25 0 0 0</pose>{BOX}</model>"), "a: 0.00 1.50 0.00 to 2.00 2.50 0.50"),
        (format!("<model name=\"a\"><pose>0 0 1 0 1.5707963 0</pose>{BOX}</model>"), "a: -0.25 -0.50 0.00 to 0.25 0.50 2.00"),
        (format!("<model name=\"a\"><pose>0 0 1 1.5707963 0 1.5707963</pose>{BOX}</model>"), "a: -0.25 -1.00 0.50 to 0.25 1.00 1.50"),
        (format!("<model name=\"a\"><pose>0 0 1 0 0 0</pose><model name=\"b\"><pose>5 0 0 0 0 0</pose>{BOX}</model></model>"), "a: 4.00 -0.50 0.75 to 6.00 0.50 1.25"),
        (format!("<model name=\"a\"><pose>0 0 1 0 0 0</pose>{}</model>", include("crate", "<pose>0 0 2 0 0 0</pose>")), "a: -1.00 -0.50 2.75 to 1.00 0.50 3.25"),
        (format!("<model name=\"a\">{BOX}<link name=\"k\"><gravity>0</gravity></link><joint name=\"j\" type=\"prismatic\"/></model>"), "a: -1.00 -0.50 -0.25 to 1.00 0.50 0.25"),
        ("<model name=\"a\"><link name=\"l\"><collision name=\"c\"><geometry><plane/></geometry></collision></link></model><model name=\"b\"><link name=\"l\"><visual name=\"v\"/></link></model>".to_owned(), ""),
        (include("crate", "<name>x</name><pose>0 0 0.25 0 0 0</pose>"), "x: -1.00 -0.50 0.00 to 1.00 0.50 0.50"),
        (include("crate", "<pose>0 0 1 0 1.5707963 0</pose>"), "crate: -0.25 -0.50 0.00 to 0.25 0.50 2.00"),
        (include("raised", ""), "raised: -1.00 -0.50 2.75 to 1.00 0.50 3.25"),
        (include("raised", "<pose>0 0 0.25 0 0 0</pose>"), "raised: -1.00 -0.50 0.00 to 1.00 0.50 0.50"),
        (include("door", "<pose>0 0 0.25 0 0 0</pose>"), "door: -1.00 -0.50 0.00 to 1.00 0.50 0.50"),
        (include("pair", ""), "pair: -1.00 -0.50 -0.25 to 1.00 4.50 0.25"),
        ("<include><uri>https://fuel.example.org/1.0/someone/models/Traffic Light/2</uri></include><include><uri>https://fuel.example.org/1.0/someone/models/Ground Plane</uri></include>".to_owned(), "Traffic Light: -1.00 -0.50 -0.25 to 1.00 0.50 0.25"),
        (format!("<model name=\"hut\"><pose>0 0 0.25 0 0 0</pose>{BOX}<model name=\"b\"><pose>1 4 0 0 0 1.5707963</pose>{BOX}</model></model>"), "hut_1: -1.00 -0.50 0.00 to 1.00 0.50 0.50\nhut_2: 0.50 3.00 0.00 to 1.50 5.00 0.50"),
        ("<spherical_coordinates gz:a=\"b\"/>".to_owned(), ""),
    ] {
        for version in ["1.3", "1.6", "1.12"] {
            assert_eq!(solids(version, &inside).map(|lines| lines.join("\n")), Ok(expected.to_owned()), "{inside}");
        }
    }
    let endless = solids("1.6", &include("loop", "")).unwrap_err();
    assert!(
        endless.contains("the model `loop` can't be used: ") && endless.contains("W040"),
        "{endless}"
    );
}

#[test]
fn a_campaign_runs_in_the_apartment_and_replays() {
    let folder = tempfile::tempdir().unwrap();
    let text = format!("tests = [[\"Pick\"]]\ntest_count = 2\n{EVERYWHERE}{TABLES}");
    std::fs::write(folder.path().join("c.toml"), text).unwrap();
    let output = actcheck(
        folder.path(),
        &["run", "c.toml", "--jobs", "1", "--format", "csv"],
    );
    assert!(
        output.status.code().is_some_and(|code| code <= 1),
        "{}",
        stderr(&output)
    );
    let listed = actcheck(folder.path(), &["list", "--format", "csv"]);
    let listed = crate::support::stdout(&listed);
    let run = listed
        .lines()
        .nth(1)
        .and_then(|line| line.split(',').next())
        .unwrap();
    let replay = actcheck(folder.path(), &["replay", run]);
    assert_eq!(
        replay.status.code(),
        Some(0),
        "{}{}",
        crate::support::stdout(&replay),
        stderr(&replay)
    );
}

/// A scene that does not satisfy the configuration's rules is discarded and counted.
#[test]
fn rules_can_select_scenes() {
    let folder = crate::support::project();
    let config = |rule: &str| {
        let text = format!(
            "tests = [[\"Pick\"]]\ntest_count = 2\n[objectSurface]\nobject_surfaces = [\"table\"]\n{TABLES}[scene]\nrequire = \"{rule}\"\n"
        );
        std::fs::write(folder.path().join("c.toml"), text).unwrap();
        actcheck(
            folder.path(),
            &["run", "c.toml", "--jobs", "1", "--format", "json"],
        )
    };
    std::fs::write(
        folder.path().join("mug.rls"),
        "@prefix act: <http://actions#> .\n@prefix w: <https://w3id.org/actcheck/world#> .\n\
         success(?o) :- parameter(act:pickObject, ?o), before(?o, w:mass, ?m), ?m > 0.33 .\n",
    )
    .unwrap();
    let output = config("mug.rls");
    assert!(
        output.status.code().is_some_and(|code| code <= 1),
        "{}",
        stderr(&output)
    );
    let ids = actcheck(
        folder.path(),
        &[
            "query",
            "--format",
            "csv",
            "SELECT ?o WHERE { ?n act:object ?o ; act:role \"target\" }",
        ],
    );
    let targets = crate::support::stdout(&ids);
    assert_eq!(targets.matches("mug_1").count(), 2, "{targets}");
    assert!(
        config("rules/scene/reachable.rls")
            .status
            .code()
            .is_some_and(|code| code <= 1)
    );
    let output = config("rules/scene/none.rls");
    assert_eq!(output.status.code(), Some(2));
    assert!(
        stderr(&output).contains("there is no such file"),
        "{}",
        stderr(&output)
    );
}
