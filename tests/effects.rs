//! Effects of an action: events and errors during it, from its trace.

use actcheck::analysis::{ActionEffects, FirstContact, Surrounding, TableRun, perceived_sentences};
use actcheck::base::Outcome::Failed;
use actcheck::base::names;
use actcheck::data::{ContactEpisode, Form, Look, Phase, Pose, Trace};
use actcheck::history::RunDetail;

use crate::facts::sample_trace;
use crate::support::made_up;
use crate::support::planted::Dice;

/// A failed pick of `glass_1`, which is 1 m ahead of the robot at the origin, on the far side of a
/// table's edge.
fn pick() -> (RunDetail, Trace) {
    let mut detail = made_up::run("k", 0, &mut Dice::new(1), &["Pick"], |_, _, _| {
        vec![("InHand", Failed), ("Near", Failed)]
    });
    detail.objects[1].id = "glass_1".to_owned();
    detail.actions[0]
        .parameters
        .insert("pickObject".to_owned(), vec!["glass_1".to_owned()]);
    let mut trace = sample_trace(3);
    trace.forms = ["glass_1", "robot/base_link", "robot/hand"]
        .map(form)
        .to_vec();
    for state in &mut trace.snapshots {
        (state.robot.base_true, state.robot.base_believed) = ([0.0; 3], [0.2, 0.0, 0.0]);
        for body in &mut state.bodies {
            let (category, middle) = match body.id.as_str() {
                "coffee_table_1" => ("CoffeeTable", [1.1, 0.0, 0.35]),
                "glass_1" => ("Glass", [1.0, 0.0, 0.7]),
                "mug_1" => ("Mug", [1.1, 0.1, 0.7]),
                _ => ("Bottle", [1.0, -0.3, 0.7]),
            };
            let half = if category == "CoffeeTable" {
                [0.3, 0.5, 0.35]
            } else {
                [0.04; 3]
            };
            body.category = names::act(category);
            body.pose = Pose::upright(middle, 0.0);
            body.aabb_min = std::array::from_fn(|axis| middle[axis] - half[axis]);
            body.aabb_max = std::array::from_fn(|axis| middle[axis] + half[axis]);
        }
    }
    let action = &mut trace.actions[0];
    action.phases = [("drive", 0.0), ("approach", 2.0), ("close", 4.5)]
        .map(|(name, start_secs)| Phase {
            name: name.to_owned(),
            start_secs,
        })
        .to_vec();
    action.contacts = vec![
        contact("floor", "robot/base_link", 0.0, 400.0),
        contact("coffee_table_1", "robot/base_link", 1.0, 300.0),
        contact("robot/hand", "robot/head", 1.5, 50.0),
        contact("can_1", "robot/hand", 2.5, 0.5),
        contact("mug_1", "robot/hand", 3.0, 5.0),
        contact("mug_1", "robot/hand", 3.5, 8.0),
        contact("glass_1", "robot/hand", 4.0, 20.0),
        contact("bottle_1", "glass_1", 5.0, 3.0),
        contact("coffee_table_1", "glass_1", 0.0, 2.0),
    ];
    let percept = &mut action.percepts[0];
    // In the believed frame: 3 cm farther and 5 cm to the right.
    (percept.pose, percept.look) = (Pose::upright([1.23, -0.05, 0.7], 0.0), None);
    (detail, trace)
}

fn form(name: &str) -> Form {
    Form {
        name: name.to_owned(),
        parts: Vec::new(),
    }
}

fn contact(a: &str, b: &str, start_secs: f64, max_force_n: f64) -> ContactEpisode {
    let pair = [a.to_owned(), b.to_owned()];
    ContactEpisode {
        pair,
        start_secs,
        end_secs: start_secs + 0.5,
        max_force_n,
        point_m: [0.8, 0.0, 0.35],
    }
}

fn effects(detail: RunDetail, trace: &Trace) -> ActionEffects {
    TableRun::new(detail, &[], trace).effects.remove(0)
}

#[test]
fn contacts_with_things_that_are_not_to_be_touched_are_effects() {
    let (detail, trace) = pick();
    let found = effects(detail, &trace);
    let expected = FirstContact {
        category: names::act("CoffeeTable"),
        at_secs: 1.0,
        phase: Some("drive".to_owned()),
    };
    assert_eq!(found.first_contact, Some(expected));
    let largest = found.largest_force.unwrap();
    assert_eq!(
        (largest.force_n, largest.category),
        (300.0, Some(names::act("CoffeeTable")))
    );
    assert_eq!(found.base_pressed, Some([300.0, 0.5]));
    assert_eq!(
        (
            found.target_contact_secs,
            found.target_contact_phase.as_deref()
        ),
        (Some(4.0), Some("approach"))
    );
    assert_eq!(
        (found.last_phase.as_deref(), found.goal_off_m),
        (Some("close"), None)
    );
    let off = found.localisation_off.unwrap();
    assert!((off[0] - 0.2).abs() < 1e-12 && off[1] < 1e-12, "{off:?}");
}

#[test]
fn things_around_the_target_are_placed_along_the_approach() {
    let (detail, mut trace) = pick();
    let around = |trace: &Trace| effects(detail.clone(), trace).surroundings.unwrap();
    let found = around(&trace);
    let of = |id: &str| found.iter().find(|thing| thing.object == id).unwrap();
    let place = |thing: &Surrounding| (thing.beyond_m.unwrap(), thing.left_m.unwrap());
    // Of furniture, the place of the contact counts.
    assert_eq!(place(of("coffee_table_1")), (-0.2, 0.0));
    assert_eq!(place(of("mug_1")), (0.1, 0.1));
    let mug = of("mug_1");
    assert_eq!(
        (mug.force_n, mug.at_s, mug.by.as_deref()),
        (Some(8.0), Some(3.0), Some("robot/hand"))
    );
    assert_eq!(
        (
            of("bottle_1").by.as_deref(),
            of("bottle_1").phase.as_deref()
        ),
        (Some("glass_1"), Some("close"))
    );
    assert_eq!(
        (of("can_1").force_n, of("coffee_table_1").role.as_str()),
        (None, "platform")
    );
    assert!(!found.iter().any(|thing| thing.object == "glass_1"));
    trace.actions[0].contacts[1].point_m = [0.9, -0.2, 0.5];
    let known = around(&trace);
    assert_eq!(
        place(
            known
                .iter()
                .find(|thing| thing.object == "coffee_table_1")
                .unwrap()
        ),
        (-0.1, -0.2)
    );
}

#[test]
fn the_sentence_about_perception_leaves_out_the_error_of_localisation() {
    let (detail, mut trace) = pick();
    let sentence = |trace: &Trace| perceived_sentences(&detail, trace).remove(&1);
    let expected = "glass_1 was perceived 5.0 cm right of and 3.0 cm behind where it was";
    assert_eq!(sentence(&trace).as_deref(), Some(expected));
    // By the pose of the base when the picture was taken: the error shrinks to less than 1 cm.
    trace.actions[0].percepts[0].look = Some(Look {
        time_secs: 1.0,
        base_true: [0.0; 3],
        base_believed: [0.225, -0.05, 0.0],
        camera: Pose::IDENTITY,
    });
    assert_eq!(sentence(&trace), None);
}

#[test]
fn a_drive_touches_its_target_only_if_it_holds_it() {
    let (mut detail, mut trace) = pick();
    detail.actions[0].action = names::act("MoveTo");
    let around = |trace: &Trace| effects(detail.clone(), trace).surroundings.unwrap();
    assert!(
        around(&trace)
            .iter()
            .any(|thing| thing.object == "glass_1" && thing.force_n == Some(20.0))
    );
    let held = vec!["glass_1".to_owned()];
    (
        trace.snapshots[0].robot.left_touches,
        trace.snapshots[0].robot.right_touches,
    ) = (held.clone(), held);
    assert!(!around(&trace).iter().any(|thing| thing.object == "glass_1"));
}
