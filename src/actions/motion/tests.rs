//! Paths of the fixed arm around a wall between two places on a table.

use std::path::Path;
use std::sync::Arc;

use crate::motion::{ArmClearance, ArmSpace, Samples, way};
use crate::route::{Block, Pillar};
use actcheck_base::Files;
use actcheck_data::{Pose, RobotStart};
use actcheck_world::{Kinematics, Layout, Sighting, geometry};

const LEAST: ArmClearance = ArmClearance {
    furniture_m: 0.01,
    things_m: 0.01,
};

fn arm() -> (Kinematics, Layout, Vec<f64>) {
    let path = Path::new("models/robots/fixed_arm.toml");
    let profile = actcheck_config::robot::read(&Files::Shipped, path)
        .expect("the shipped robot is valid")
        .complete()
        .expect("it states all roles");
    let start = RobotStart {
        profile: Arc::new(profile),
        base: [0.0; 3],
        root_height_m: 0.0,
        knows: Arc::new([]),
    };
    geometry(&start).expect("the shipped robot is valid")
}

fn seen(position: [f64; 3], size_m: [f64; 3], furniture: bool) -> Sighting {
    Sighting {
        id: "x".to_owned(),
        pose: Pose::upright(position, 0.0),
        size_m,
        furniture,
        angular: false,
    }
}

#[test]
fn an_arm_plans_a_path_around_a_wall() {
    let (kinematics, layout, home) = arm();
    let mut from = home.clone();
    for (idx, value) in layout
        .arm
        .iter()
        .zip([-0.9, 0.7, 0.0, 1.59, 0.0, 0.85, 0.0])
    {
        from[*idx] = value;
    }
    let mut to = from.clone();
    to[layout.arm[0]] = 0.9;
    let table = [Block::new(&seen([0.55, 0.0, 0.0], [0.6, 1.2, 0.7], true))];
    let wall = [Pillar::new(&seen(
        [0.6, 0.0, 0.7],
        [0.12, 0.12, 0.5],
        false,
    ))];
    let right = [home];
    let space = ArmSpace::new(&kinematics, &layout, &table, &wall, &right);
    assert!(space.is_free(&from, LEAST) && space.is_free(&to, LEAST));
    assert!(
        !space.is_way_free(&from, &to, LEAST),
        "the test needs something in the way"
    );
    assert!(
        way(
            &space.among(&[]),
            &from,
            &to,
            LEAST,
            &mut Samples::new(0.0, 0)
        )
        .is_some_and(|way| way.len() == 1)
    );
    assert_eq!(
        way(&space, &from, &to, LEAST, &mut Samples::new(0.0, 0)),
        None
    );
    let mut lengths = Vec::new();
    for start in [0.1, 0.3, 0.5, 0.7, 0.9] {
        let find = || way(&space, &from, &to, LEAST, &mut Samples::new(start, 2000));
        let found = find().expect("there is a path above the wall");
        assert_eq!(
            Some(&found),
            find().as_ref(),
            "the same samples give the same path"
        );
        assert_eq!(found.last(), Some(&to));
        let legs: Vec<(&Vec<f64>, &Vec<f64>)> =
            std::iter::once(&from).chain(&found).zip(&found).collect();
        assert!(legs.iter().all(|(a, b)| space.is_way_free(a, b, LEAST)));
        lengths.push(legs.iter().map(|(a, b)| space.span(a, b)).sum::<f64>());
    }
    let straight = space.span(&from, &to);
    assert!(
        lengths.iter().all(|length| *length < 4.0 * straight),
        "{lengths:?} instead of {straight}"
    );
}

#[test]
fn an_arm_folded_into_its_own_mast_is_in_collision() {
    let (kinematics, layout, home) = arm();
    let right = [home.clone()];
    let space = ArmSpace::new(&kinematics, &layout, &[], &[], &right);
    let nowhere = ArmClearance {
        furniture_m: f64::NEG_INFINITY,
        things_m: f64::NEG_INFINITY,
    };
    assert!(space.is_free(&home, nowhere));
    let mut folded = home;
    for (idx, value) in layout.arm.iter().zip([1.69, 1.3, 0.0, 0.6, 0.0, 0.0, 0.0]) {
        folded[*idx] = value;
    }
    assert!(
        !space.is_free(&folded, nowhere),
        "the forearm goes through the mast"
    );
}
