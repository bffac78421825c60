//! Facts: the contents of a trace in the world vocabulary, complete for the rules.

use std::collections::{BTreeMap, BTreeSet};

use actcheck::base::{RunFacts, Term, TermId, names};
use actcheck::data::{
    ActionEnd, ActionReport, ActionTrace, BodyState, Choices, ContactEpisode, Extremes, Frames,
    JointState, LinkState, Look, Percept, Phase, Pose, RobotState, Snapshot, Trace,
};
use actcheck::facts::{extract, extract_complete};

/// A number in single precision, as the physics engine has it.
fn single(choices: &mut Choices, low: f64, high: f64) -> f64 {
    f64::from(choices.real("x".into(), low, high, 0.0) as f32)
}

fn three(choices: &mut Choices, low: f64, high: f64) -> [f64; 3] {
    [0; 3].map(|_| single(choices, low, high))
}

fn strings(ids: &[&str]) -> Vec<String> {
    ids.iter().map(|id| (*id).to_owned()).collect()
}

/// Ids of a scene of typical size: a table, the target and five others.
pub const BODIES: [&str; 7] = [
    "coffee_table_1",
    "glass_1",
    "mug_1",
    "bottle_1",
    "can_1",
    "salt_shaker_1",
    "plate_1",
];

fn body(id: &str, asleep: bool, choices: &mut Choices) -> BodyState {
    let fixed = id == "coffee_table_1";
    let position = three(choices, -1.0, 1.0);
    let velocity = if asleep || fixed {
        [0.0; 3]
    } else {
        three(choices, -0.1, 0.1)
    };
    BodyState {
        id: id.to_owned(),
        model: id[..id.len() - 2].to_owned(),
        category: names::act("Glass"),
        fixed,
        pose: Pose::upright(position, single(choices, -3.0, 3.0)),
        linear_velocity: velocity,
        angular_velocity: velocity,
        aabb_min: position.map(|x| x - 0.05),
        aabb_max: position.map(|x| x + 0.05),
        mass_kg: single(choices, 0.1, 0.5),
        friction: single(choices, 0.5, 1.0),
        restitution: 0.3,
        touches: strings(if fixed {
            &["floor"]
        } else {
            &["coffee_table_1"]
        }),
        rests_on: strings(if fixed {
            &["floor"]
        } else {
            &["coffee_table_1"]
        }),
        asleep,
        size_m: three(choices, 0.05, 0.2),
        grasp_distance_m: (!fixed).then(|| single(choices, -0.01, 1.0)),
        part: None,
        left_world: false,
    }
}

fn joint(name: &str, choices: &mut Choices) -> JointState {
    JointState {
        name: name.to_owned(),
        position: single(choices, -1.0, 1.0),
        velocity: single(choices, -0.1, 0.1),
        lower: -2.0,
        upper: 2.0,
        max_velocity: 1.5,
        max_effort: 100.0,
    }
}

const JOINTS: [&str; 12] = [
    "base_x",
    "base_y",
    "base_yaw",
    "torso_lift",
    "arm_lift",
    "arm_flex",
    "arm_roll",
    "wrist_flex",
    "wrist_roll",
    "finger_left",
    "finger_right",
    "head_tilt",
];

fn snapshot(
    time_secs: f64,
    bodies: Vec<BodyState>,
    holding: bool,
    choices: &mut Choices,
) -> Snapshot {
    Snapshot {
        time_secs,
        bodies,
        robot: RobotState {
            base_true: three(choices, -1.0, 1.0),
            base_believed: three(choices, -1.0, 1.0),
            joints: JOINTS.iter().map(|name| joint(name, choices)).collect(),
            gripper: Pose::upright(three(choices, 0.0, 1.0), 0.4),
            gripper_opening_m: single(choices, 0.0, 0.1),
            left_touches: strings(if holding { &["glass_1"] } else { &[] }),
            right_touches: strings(if holding { &["glass_1"] } else { &[] }),
            links: vec![LinkState {
                name: "hand".to_owned(),
                pose: Pose::upright(three(choices, 0.0, 1.0), 0.4),
            }],
            cup: None,
        },
    }
}

fn contact(a: &str, b: &str, start_secs: f64, max_force_n: f64) -> ContactEpisode {
    let pair = [a.to_owned(), b.to_owned()];
    ContactEpisode {
        pair,
        start_secs,
        end_secs: start_secs + 0.5,
        max_force_n,
        point_m: [0.1, start_secs, 0.7],
    }
}

fn contacts(choices: &mut Choices) -> Vec<ContactEpisode> {
    let mut contacts: Vec<ContactEpisode> = BODIES[1..]
        .iter()
        .map(|id| contact("coffee_table_1", id, 0.0, single(choices, 1.0, 5.0)))
        .collect();
    for (link, time) in [
        ("robot/finger_left", 6.1),
        ("robot/finger_right", 6.2),
        ("robot/hand", 6.3),
    ] {
        for episode in 0..5 {
            contacts.push(contact(
                "glass_1",
                link,
                time + f64::from(episode),
                single(choices, 0.0, 20.0),
            ));
        }
    }
    contacts
}

fn frames(choices: &mut Choices, seconds: f64) -> Frames {
    let names: Vec<String> = BODIES[1..]
        .iter()
        .map(|id| (*id).to_owned())
        .chain(JOINTS.iter().map(|joint| format!("robot/{joint}")))
        .collect();
    let phase = single(choices, 0.0, 1.0);
    let moving = |slot: usize| slot == 0 || slot >= BODIES.len() - 1;
    let row = |time: f64| {
        (0..names.len() * 7)
            .map(|column| {
                if moving(column / 7) {
                    ((time + phase) * 0.4 + column as f64).sin() as f32
                } else {
                    0.25
                }
            })
            .collect()
    };
    Frames {
        period_secs: 0.1,
        rows: (0..(seconds * 10.0) as usize)
            .map(|i| row(i as f64 * 0.1))
            .collect(),
        names,
    }
}

/// A typical pick: 25 seconds, seven bodies, chattering contacts.
pub fn sample_trace(seed: u64) -> Trace {
    let mut choices = Choices::random(seed, 0);
    let before: Vec<BodyState> = BODIES
        .iter()
        .map(|id| body(id, true, &mut choices))
        .collect();
    let mut after = before.clone();
    after[1] = body("glass_1", false, &mut choices);
    after[1].touches = strings(&["robot"]);
    after[1].rests_on = strings(&["robot"]);
    let first = snapshot(1.0, before, false, &mut choices);
    let last = snapshot(26.0, after, true, &mut choices);
    let extremes = BODIES.iter().map(|id| Extremes {
        id: (*id).to_owned(),
        max_tilt_rad: single(&mut choices, 0.0, 0.1),
        max_speed: single(&mut choices, 0.0, 0.2),
        max_rise_m: single(&mut choices, 0.0, 0.2),
        max_displacement_m: single(&mut choices, 0.0, 0.3),
    });
    let action = ActionTrace {
        action: "Pick".to_owned(),
        parameters: BTreeMap::from([
            ("pickObject".to_owned(), strings(&["glass_1"])),
            ("objectLocation".to_owned(), strings(&["living room"])),
        ]),
        end: ActionEnd::Completed,
        report: Some(ActionReport {
            succeeded: true,
            message: "the object is held".to_owned(),
        }),
        duration_secs: 25.0,
        extremes: extremes.collect(),
        contacts: contacts(&mut choices),
        percepts: vec![Percept {
            id: "glass_1".to_owned(),
            pose: Pose::upright([0.1, 0.2, 0.7], 0.3),
            size_m: [0.09, 0.09, 0.15],
            look: Some(Look {
                time_secs: 1.5,
                base_true: [0.1, 0.2, 0.3],
                base_believed: [0.11, 0.19, 0.31],
                camera: Pose::upright([0.1, 0.2, 1.1], 0.3),
            }),
        }],
        perceived: None,
        base: None,
        phases: vec![Phase {
            name: "approach".to_owned(),
            start_secs: 2.0,
        }],
    };
    let hash = format!("{seed:032x}");
    Trace {
        snapshots: vec![first, last],
        actions: vec![action],
        frames: frames(&mut choices, 25.0),
        hash,
        ..Trace::default()
    }
}

fn terms_of(facts: &RunFacts, triples: &[[TermId; 3]]) -> BTreeSet<[Term; 3]> {
    triples
        .iter()
        .map(|triple| triple.map(|id| facts.terms.term(id).clone()))
        .collect()
}

fn w(local: &str) -> Term {
    Term::iri(names::w(local))
}

fn obj(id: &str) -> Term {
    Term::iri(names::obj(id))
}

fn values(facts: &RunFacts, triples: &[[TermId; 3]], subject: &Term, property: &str) -> Vec<Term> {
    terms_of(facts, triples)
        .into_iter()
        .filter(|[s, p, _]| s == subject && *p == w(property))
        .map(|[_, _, value]| value)
        .collect()
}

#[test]
fn a_body_is_described_with_its_own_terms() {
    let trace = sample_trace(1);
    let facts = extract(&trace);
    let after = &facts.snapshots[1];
    assert_eq!(
        values(&facts, after, &obj("glass_1"), "touches"),
        [w("robot")]
    );
    assert_eq!(
        values(&facts, after, &obj("mug_1"), "restsOn"),
        [obj("coffee_table_1")]
    );
    assert_eq!(
        values(&facts, after, &obj("mug_1"), "restitution"),
        [Term::Double(0.3)]
    );
    assert_eq!(
        values(&facts, after, &obj("coffee_table_1"), "fixed"),
        [Term::Boolean(true)]
    );
    assert_eq!(
        values(&facts, after, &w("gripper"), "leftTouches"),
        [obj("glass_1")]
    );
    assert_eq!(
        values(&facts, after, &w("joint/arm_flex"), "upper"),
        [Term::Double(2.0)]
    );
    let kind = Term::iri(format!("{}type", names::RDF));
    assert!(terms_of(&facts, after).contains(&[
        obj("glass_1"),
        kind,
        Term::iri(names::act("Glass"))
    ]));
    for property in ["x", "qw", "yaw", "tilt", "minZ", "maxX", "mass", "friction"] {
        assert_eq!(
            values(&facts, after, &obj("can_1"), property).len(),
            1,
            "{property}"
        );
    }
}

#[test]
fn only_movable_bodies_have_velocities() {
    let facts = extract(&sample_trace(1));
    assert_eq!(
        values(&facts, &facts.snapshots[1], &obj("glass_1"), "vx").len(),
        1
    );
    for still in ["mug_1", "coffee_table_1"] {
        assert!(
            values(&facts, &facts.snapshots[1], &obj(still), "vx").is_empty(),
            "{still}"
        );
    }
}

#[test]
fn events_during_the_action_are_facts() {
    let facts = extract(&sample_trace(1));
    let during = &facts.during[0];
    assert_eq!(
        values(&facts, during, &w("action"), "reported"),
        [Term::string("succeeded")]
    );
    assert_eq!(
        values(&facts, during, &w("action"), "duration"),
        [Term::Double(25.0)]
    );
    assert_eq!(
        values(&facts, during, &w("percept/1"), "ofObject"),
        [obj("glass_1")]
    );
    assert_eq!(
        values(&facts, during, &w("percept/1"), "sizeZ"),
        [Term::Double(0.15)]
    );
    assert_eq!(values(&facts, during, &obj("glass_1"), "maxTilt").len(), 1);
    let seconds: BTreeSet<Term> = (1..20)
        .flat_map(|n| values(&facts, during, &w(&format!("contact/{n}")), "second"))
        .collect();
    assert!(seconds.contains(&w("link/finger_left")), "{seconds:?}");
}

#[test]
fn a_chattering_pair_keeps_its_strongest_contacts() {
    let mut trace = sample_trace(1);
    trace.actions[0].contacts = (0..50)
        .map(|i| {
            contact(
                "coffee_table_1",
                "mug_1",
                f64::from(i),
                f64::from((i * 7) % 50),
            )
        })
        .collect();
    let facts = extract(&trace);
    let mut forces: Vec<f64> = (1..60)
        .flat_map(|n| {
            values(
                &facts,
                &facts.during[0],
                &w(&format!("contact/{n}")),
                "maxForce",
            )
        })
        .filter_map(|force| force.number())
        .collect();
    forces.sort_by(f64::total_cmp);
    assert_eq!(forces, [47.0, 48.0, 49.0]);
}

#[test]
fn designators_refer_to_objects_if_these_exist() {
    let facts = extract(&sample_trace(1));
    let pairs: BTreeSet<[Term; 2]> = facts.parameters[0]
        .iter()
        .map(|pair| pair.map(|id| facts.terms.term(id).clone()))
        .collect();
    assert_eq!(
        pairs.into_iter().collect::<Vec<_>>(),
        [
            [
                Term::iri(names::act("objectLocation")),
                Term::string("living room")
            ],
            [Term::iri(names::act("pickObject")), obj("glass_1")]
        ]
    );
}

#[test]
fn the_same_trace_gives_the_same_facts_and_numbers() {
    let (a, b) = (extract(&sample_trace(4)), extract(&sample_trace(4)));
    assert_eq!(
        (&a.snapshots, &a.during, &a.parameters),
        (&b.snapshots, &b.during, &b.parameters)
    );
    assert!((0..a.terms.len()).all(|id| a.terms.term(id as TermId) == b.terms.term(id as TermId)));
    assert!(
        a.snapshots
            .iter()
            .chain(&a.during)
            .all(|list| list.is_sorted())
    );
}

#[test]
fn an_unreached_action_has_only_designators() {
    let mut trace = sample_trace(1);
    let mut unreached = trace.actions[0].clone();
    unreached.end = ActionEnd::NotReached;
    trace.actions.push(unreached);
    let facts = extract(&trace);
    assert!(facts.during[1].is_empty());
    assert_eq!(facts.parameters[1], facts.parameters[0]);
    assert!(facts.action(0).is_some() && facts.action(1).is_none());
}

#[test]
fn a_broken_world_still_has_facts() {
    let mut trace = sample_trace(1);
    trace.snapshots[1].bodies[1].pose.position = [f64::NAN, f64::INFINITY, -0.0];
    let facts = extract(&trace);
    let glass = |property| values(&facts, &facts.snapshots[1], &obj("glass_1"), property);
    assert_eq!(glass("x"), [Term::Double(f64::NAN)]);
    assert_eq!(glass("z"), [Term::Double(0.0)]);
    let empty = Trace {
        snapshots: Vec::new(),
        ..sample_trace(1)
    };
    assert!(extract(&empty).action(0).is_none());
}

#[test]
fn complete_facts_have_every_contact() {
    let trace = sample_trace(1);
    let contacts = |facts: &RunFacts| {
        let class = facts.terms.id(&Term::iri(names::w("Contact"))).unwrap();
        facts.during[0]
            .iter()
            .filter(|triple| triple[2] == class)
            .count()
    };
    assert_eq!(
        contacts(&extract_complete(&trace)),
        trace.actions[0].contacts.len()
    );
    assert!(contacts(&extract(&trace)) < trace.actions[0].contacts.len());
}

#[test]
fn every_term_of_the_facts_is_described_in_the_vocabulary() {
    let text = std::fs::read_to_string(crate::support::root().join("ontology/world.ttl")).unwrap();
    let described: BTreeSet<&str> = text
        .lines()
        .filter_map(|line| Some(line.split_once(" a ")?.0))
        .collect();
    let facts = extract_complete(&sample_trace(1));
    let named = |term: &Term| {
        term.to_string()
            .strip_prefix("w:")
            .map(|local| format!("w:{local}"))
    };
    let missing: Vec<String> = (0..facts.terms.len())
        .filter_map(|id| named(facts.terms.term(id as TermId)))
        .filter(|term| !described.contains(term.as_str()))
        .collect();
    assert!(missing.is_empty(), "not described: {missing:?}");
}
