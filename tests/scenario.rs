//! Scenes: no overlaps, determinism, and reports of objects that can't be placed.

use std::path::Path;

use actcheck::config::{self, Overrides};
use actcheck::data::{Choices, ObjectModel, Pose, Role, Scene, SceneObject, Shape};
use actcheck::ontology;
use actcheck::scenario::{self, CLEARANCE_M, Discard, Solid, Space};
use parry3d::math::{Pose as ParryPose, Rotation, Vector};
use parry3d::query;
use parry3d::shape::{Cuboid, Cylinder, Shape as ParryShape};

use crate::support::robot_of;

fn space_of(path: &Path) -> Space {
    let campaign =
        config::load(path, &Overrides::default()).unwrap_or_else(|found| panic!("{found}"));
    let ontology = ontology::load(&campaign.ontology.0, &campaign.ontology.1)
        .unwrap_or_else(|found| panic!("{found}"));
    Space::new(&campaign, &ontology, &robot_of(&campaign)).unwrap_or_else(|found| panic!("{found}"))
}

/// The space of a configuration that varies only the objects.
fn space(targets: &str, others: &str, count: &str, surfaces: &str) -> Space {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c.toml");
    let text = format!(
        "tests = [[\"Pick\"]]\ntest_count = 1\n[objectSurface]\nobject_surfaces = {surfaces}\n\
         [pickObject]\nmodel_list = {targets}\n[surfaceObjects]\nmodel_list = {others}\ncount = {count}\n"
    );
    std::fs::write(&path, text).unwrap();
    space_of(&path)
}

const ALL: &str =
    r#"["mug", "bottle", "can", "bowl", "plate", "box", "salt_shaker", "spoon", "fork", "glass"]"#;

fn crowded() -> Space {
    space(
        r#"["glass", "mug", "spoon"]"#,
        ALL,
        "[0, 7]",
        r#"["coffee_table", "table", "mini_coffee_table"]"#,
    )
}

/// The parts of a scene that must be equal in equal scenes, to the last bit.
fn shown(scene: &Scene) -> String {
    let objects: Vec<String> = scene
        .objects
        .iter()
        .map(|o| {
            format!(
                "{} {:?} {:?} {:?} {:?} {:?}",
                o.id, o.role, o.pose, o.mass_kg, o.friction, o.restitution
            )
        })
        .collect();
    format!(
        "{} {objects:?} {:?} {:?}",
        scene.world, scene.robot.base, scene.designators
    )
}

/// Parry's own shapes, built independently from the parts of the model.
fn shapes(object: &SceneObject) -> Vec<(ParryPose, Box<dyn ParryShape>)> {
    let solids = object.model.solids();
    let build = |pose: &Pose, shape: &Shape| -> (ParryPose, Box<dyn ParryShape>) {
        let at = object.pose.to_isometry() * pose.to_isometry();
        let q = at.rotation.coords.map(|c| c as f32);
        let t = at.translation.vector.map(|c| c as f32);
        let mut rotation = Rotation::from_xyzw(q.x, q.y, q.z, q.w);
        let shape: Box<dyn ParryShape> = match *shape {
            Shape::Box { size: [x, y, z] } => {
                Box::new(Cuboid::new(Vector::new(x as f32, y as f32, z as f32) / 2.0))
            }
            Shape::Cylinder { radius, height } => {
                rotation *= Rotation::from_rotation_x(std::f32::consts::FRAC_PI_2);
                Box::new(Cylinder::new(height as f32 / 2.0, radius as f32))
            }
            _ => panic!("no shipped model has other solids"),
        };
        (
            ParryPose::from_parts(Vector::new(t.x, t.y, t.z), rotation),
            shape,
        )
    };
    solids
        .iter()
        .map(|part| build(&part.pose, &part.shape))
        .collect()
}

fn overlap(a: &SceneObject, b: &SceneObject) -> bool {
    let (a, b) = (shapes(a), shapes(b));
    a.iter().any(|(at, shape)| {
        b.iter().any(|(other_at, other)| {
            query::intersection_test(at, shape.as_ref(), other_at, other.as_ref())
                .unwrap()
                .intersecting
        })
    })
}

#[test]
fn nothing_overlaps_in_500_scenes() {
    let space = crowded();
    let mut pairs = 0;
    let mut placed = 0;
    for index in 0..500 {
        let Ok(scene) = scenario::draw(&space, 0, &mut Choices::random(11, index)) else {
            continue;
        };
        placed += 1;
        let standing: Vec<&SceneObject> = scene
            .objects
            .iter()
            .filter(|o| o.role != Role::Platform)
            .collect();
        for (idx, a) in standing.iter().enumerate() {
            for b in &standing[idx + 1..] {
                pairs += 1;
                assert!(
                    !overlap(a, b),
                    "scene {index}: {} and {}\n{:?}\n{:?}",
                    a.id,
                    b.id,
                    a.pose,
                    b.pose
                );
            }
        }
    }
    assert!(
        placed > 450 && pairs > 3000,
        "{placed} scenes, {pairs} pairs"
    );
}

#[test]
fn every_object_is_entirely_on_its_surface() {
    let space = crowded();
    for index in 0..500 {
        let Ok(scene) = scenario::draw(&space, 0, &mut Choices::random(5, index)) else {
            continue;
        };
        let surface = scene.objects[0].model.surface.unwrap();
        for object in scene.objects.iter().filter(|o| o.role != Role::Platform) {
            assert_eq!(object.pose.position[2], surface.height_m);
            for (at, shape) in shapes(object) {
                let around = shape.compute_aabb(&at);
                for (low, high, extent) in [
                    (around.mins.x, around.maxs.x, surface.size_m[0]),
                    (around.mins.y, around.maxs.y, surface.size_m[1]),
                ] {
                    let edge = extent as f32 / 2.0;
                    assert!(
                        low > -edge && high < edge,
                        "scene {index}: {} at {:?}",
                        object.id,
                        object.pose
                    );
                }
            }
        }
    }
}

#[test]
fn the_same_choices_and_their_record_give_the_same_scene() {
    let space = crowded();
    for index in 0..100 {
        let mut first = Choices::random(3, index);
        let scene = scenario::draw(&space, 0, &mut first);
        let mut second = Choices::random(3, index);
        let again = scenario::draw(&space, 0, &mut second);
        let mut recorded = Choices::recorded(first.made());
        let replayed = scenario::draw(&space, 0, &mut recorded);
        match scene {
            Ok(scene) => {
                assert_eq!(shown(&scene), shown(&again.unwrap()));
                assert_eq!(shown(&scene), shown(&replayed.unwrap()));
                assert_eq!(first.made(), recorded.made());
            }
            Err(discard) => {
                assert_eq!(
                    (&discard, &discard),
                    (&again.unwrap_err(), &replayed.unwrap_err())
                );
            }
        }
    }
}

#[test]
fn scenes_of_different_indices_differ() {
    let space = crowded();
    let scenes: std::collections::BTreeSet<String> = (0..200)
        .filter_map(|index| scenario::draw(&space, 0, &mut Choices::random(3, index)).ok())
        .map(|scene| shown(&scene))
        .collect();
    assert!(scenes.len() > 180);
}

/// The simplest scene is that of an empty record: the first models, in the middle, not rotated, and
/// no other objects.
#[test]
fn an_empty_record_is_the_simplest_scene() {
    let space = crowded();
    let scene = scenario::draw(&space, 0, &mut Choices::recorded(&[])).unwrap();
    let ids: Vec<&str> = scene
        .objects
        .iter()
        .map(|object| object.id.as_str())
        .collect();
    assert_eq!(ids, ["coffee_table_1", "glass_1"]);
    let glass = &scene.objects[1];
    assert_eq!(glass.pose, Pose::upright([0.0, 0.0, 0.705], 0.0));
    assert_eq!(
        (glass.mass_kg, glass.friction),
        (glass.model.mass_kg, glass.model.friction)
    );
    assert_eq!(scene.robot.base, [-1.0, 0.0, 0.0]);
    assert_eq!(scene.designators["pickObject"], ["glass_1"]);
    assert_eq!(scene.designators["objectSurface"], ["coffee_table_1"]);
}

/// Nominal neighbours are placed around the middle, so that simple scenes of several objects exist.
#[test]
fn the_simplest_scene_of_several_objects_has_room_for_all() {
    for count in 1..=5 {
        let space = space(
            r#"["glass"]"#,
            r#"["bottle"]"#,
            &count.to_string(),
            r#"["coffee_table"]"#,
        );
        let scene = scenario::draw(&space, 0, &mut Choices::recorded(&[])).unwrap();
        assert_eq!(scene.objects.len(), 2 + count);
        assert_eq!(scene.designators["surfaceObjects"].len(), count);
    }
}

/// Removing choices from a record one by one gives a scene or a discard, without a crash or an
/// overlap.
#[test]
fn any_part_of_a_record_gives_a_valid_scene() {
    let space = crowded();
    let mut full = Choices::random(8, 1);
    let _ = scenario::draw(&space, 0, &mut full);
    let record = full.into_made();
    for left_out in 0..record.len() {
        let mut part = record.clone();
        part.remove(left_out);
        if let Ok(scene) = scenario::draw(&space, 0, &mut Choices::recorded(&part)) {
            let standing: Vec<&SceneObject> = scene
                .objects
                .iter()
                .filter(|o| o.role != Role::Platform)
                .collect();
            for (idx, a) in standing.iter().enumerate() {
                assert!(
                    standing[idx + 1..].iter().all(|b| !overlap(a, b)),
                    "without choice {left_out}"
                );
            }
        }
    }
}

#[test]
fn values_stay_in_their_ranges() {
    let space = space_of(Path::new("configs/pick.toml"));
    let (mut yaw, mut mass) = ((0.0_f64, 0.0_f64), (f64::INFINITY, 0.0_f64));
    for index in 0..500 {
        let Ok(scene) = scenario::draw(&space, 0, &mut Choices::random(1, index)) else {
            continue;
        };
        let target = scene
            .objects
            .iter()
            .find(|o| o.role == Role::Target)
            .unwrap();
        let turn = target.pose.yaw();
        yaw = (yaw.0.min(turn), yaw.1.max(turn));
        let scale = target.mass_kg / target.model.mass_kg;
        mass = (mass.0.min(scale), mass.1.max(scale));
        let others = scene
            .objects
            .iter()
            .filter(|o| o.role == Role::Other)
            .count();
        assert!((1..=5).contains(&others), "{others}");
        let [x, y, heading] = scene.robot.base;
        assert!((-1.1..=-0.9).contains(&x) && y.abs() <= 0.05 && heading.abs() <= 0.05);
    }
    assert!(yaw.0 < -3.0 && yaw.1 > 3.0, "the whole turn: {yaw:?}");
    assert!(
        mass.0 >= 0.7 && mass.0 < 0.71 && mass.1 <= 1.3 && mass.1 > 1.29,
        "the whole range: {mass:?}"
    );
}

/// Ids are unique and contain the model's name, also if several objects share a model.
#[test]
fn ids_are_unique() {
    let space = space(r#"["glass"]"#, r#"["glass"]"#, "3", r#"["coffee_table"]"#);
    let scene = scenario::draw(&space, 0, &mut Choices::random(1, 0)).unwrap();
    let ids: Vec<&str> = scene
        .objects
        .iter()
        .map(|object| object.id.as_str())
        .collect();
    assert_eq!(
        ids,
        ["coffee_table_1", "glass_1", "glass_2", "glass_3", "glass_4"]
    );
    assert_eq!(
        scene.designators["surfaceObjects"],
        ["glass_2", "glass_3", "glass_4"]
    );
}

#[test]
fn a_full_surface_gives_a_discard_that_names_the_unplaced_object() {
    let space = space(r#"["glass"]"#, r#"["plate"]"#, "40", r#"["coffee_table"]"#);
    let mut choices = Choices::random(1, 0);
    let discard = scenario::draw(&space, 0, &mut choices).unwrap_err();
    let Discard::NoPlace { model, name, tries } = &discard else {
        panic!("{discard}")
    };
    assert_eq!((model.as_str(), *tries), ("plate", 50));
    assert_eq!(
        discard.to_string(),
        format!("found no free place for `plate` ({name}) in 50 tries")
    );
    // Every try is recorded.
    let tries = choices
        .made()
        .iter()
        .filter(|choice| choice.name.to_string() == format!("{name}.x"))
        .count();
    assert_eq!(tries, 50);
}

/// A hollow wall counts at its true position, not as its bounding box; and the clearance is kept
/// between walls too.
#[test]
fn exact_shapes_decide_if_bounding_boxes_overlap() {
    let campaign = config::load(Path::new("configs/pick.toml"), &Overrides::default()).unwrap();
    let model = |name: &str| -> &ObjectModel { &campaign.models[name] };
    let at = |name: &str, x: f64, y: f64| Solid::new(model(name), &Pose::upright([x, y, 0.0], 0.0));
    let in_the_way = |x: f64, y: f64| at("can", 0.0, 0.0).is_in_the_way_of(&at("can", x, y));
    let diameter = 0.066;
    assert!(in_the_way(diameter + CLEARANCE_M - 0.001, 0.0));
    assert!(!in_the_way(diameter + CLEARANCE_M + 0.001, 0.0));
    // On the diagonal the boxes overlap and the cylinders do not.
    let diagonal = (diameter + CLEARANCE_M + 0.002) / 2.0_f64.sqrt();
    assert!(diagonal < diameter);
    assert!(!in_the_way(diagonal, diagonal));
}
