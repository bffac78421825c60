//! A cube on a table, picked up.

use actcheck_base::Outcome;

use crate::{Call, Judge, Key, OwnRule, Value};

const UP: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

/// A state in which the lowest point of the cube is at this height above the table.
fn state(height: f64, held: bool) -> Value {
    let fingers = Value::texts(held.then_some("cube"));
    let cube = Value::map([
        ("position", [0.0, 0.0, 0.82 + height].into()),
        ("rotation", UP.into()),
        ("size", [0.04; 3].into()),
        ("category", "Box".into()),
        ("mass", 0.1.into()),
        ("linear_velocity", [0.0; 3].into()),
        ("angular_velocity", [0.0; 3].into()),
        (
            "touches",
            Value::texts([if held { "robot" } else { "table" }]),
        ),
        (
            "rests_on",
            Value::texts([if held { "robot" } else { "table" }]),
        ),
    ]);
    let table = Value::map([
        ("position", [0.0, 0.0, 0.4].into()),
        ("rotation", UP.into()),
        ("size", [1.0, 1.0, 0.8].into()),
        ("fixed", true.into()),
        ("category", "Table".into()),
        ("touches", Value::texts((!held).then_some("cube"))),
    ]);
    let gripper = Value::map([
        ("position", [0.0, 0.0, 0.83 + height].into()),
        ("rotation", UP.into()),
    ]);
    let robot = Value::map([
        ("base", [0.0; 3].into()),
        ("gripper", gripper),
        ("opening", 0.04.into()),
        ("left_touches", fingers.clone()),
        ("right_touches", fingers),
    ]);
    Value::map([
        ("bodies", Value::map([("cube", cube), ("table", table)])),
        ("robot", robot),
    ])
}

/// Sets a value below some keys.
fn with(value: Value, keys: &[&str], new: Value) -> Value {
    let (Value::Map(mut entries), [key, rest @ ..]) = (value, keys) else {
        return new;
    };
    let key = Key::One((*key).to_owned());
    let place = entries.iter().position(|(known, _)| *known == key);
    let old = place.map_or(Value::Null, |place| entries.remove(place).1);
    entries.push((key, with(old, rest, new)));
    Value::Map(entries)
}

fn judge() -> Judge {
    Judge::new(None, &[]).expect("it is valid")
}

fn parameters() -> Value {
    Value::map([("pickObject", "cube".into())])
}

fn report(succeeded: bool) -> Value {
    Value::map([("report", succeeded.into())])
}

fn judged(judge: &Judge, before: &Value, after: &Value, during: &Value) -> Vec<(String, Outcome)> {
    let parameters = parameters();
    let verdict = judge.judge(&Call {
        action: "Pick",
        before,
        after,
        during,
        parameters: &parameters,
    });
    let verdict = verdict.unwrap_or_else(|faults| panic!("{faults}"));
    let judgements = verdict.judgements().iter();
    judgements
        .map(|judgement| {
            let name = actcheck_base::names::local(&judgement.property);
            (name.to_owned(), judgement.outcome)
        })
        .collect()
}

fn faults(before: &Value, after: &Value, during: &Value, parameters: &Value) -> String {
    let call = Call {
        action: "Pick",
        before,
        after,
        during,
        parameters,
    };
    judge().judge(&call).expect_err("it is refused").to_string()
}

#[test]
fn a_pick_passes_and_a_lift_without_fingers_fails() {
    let judge = judge();
    let expected = |pairs: [(&str, Outcome); 5]| -> Vec<(String, Outcome)> {
        pairs
            .into_iter()
            .map(|(name, outcome)| (name.to_owned(), outcome))
            .collect()
    };
    use Outcome::{Failed, Inapplicable, Passed};
    let found = judged(&judge, &state(0.0, false), &state(0.2, true), &report(true));
    assert_eq!(
        found,
        expected([
            ("CloseObject", Passed),
            ("ObjectGrasped", Passed),
            // Nothing is known of the time between.
            ("NoGraspCollisions", Inapplicable),
            ("MovedObject", Passed),
            ("ObjectInGripper", Passed),
        ])
    );
    // The object was teleported, and the environment counts it as a success.
    let mut floating = with(
        state(0.2, false),
        &["bodies", "cube", "touches"],
        Value::List(vec![]),
    );
    floating = with(
        floating,
        &["bodies", "cube", "rests_on"],
        Value::List(vec![]),
    );
    let found = judged(&judge, &state(0.0, false), &floating, &report(true));
    assert_eq!(found[4], ("ObjectInGripper".to_owned(), Failed));
}

#[test]
fn quantities_that_are_not_given_are_missing_and_named() {
    let judge = judge();
    let (before, after) = (state(0.0, false), state(0.2, true));
    let Value::Map(entries) = after else { panic!() };
    let after = Value::Map(entries.into_iter().take(1).collect());
    let parameters = parameters();
    let verdict = judge
        .judge(&Call {
            action: "Pick",
            before: &before,
            after: &after,
            during: &Value::Null,
            parameters: &parameters,
        })
        .expect("it is valid");
    let missing = |property: &str| verdict.missing(property).expect("it is valid");
    assert_eq!(missing("ObjectGrasped"), ["message", "reported"]);
    assert!(missing("ObjectInGripper").contains(&"leftTouches"));
    assert_eq!(missing("MovedObject"), [] as [&str; 0]);
    let outcome = |idx: usize| verdict.judgements()[idx].outcome;
    assert_eq!(outcome(1), Outcome::Inapplicable);
    assert_eq!(
        verdict.judgements()[1].witness,
        "`w:message` and `w:reported` were not recorded"
    );
    assert_eq!([outcome(0), outcome(4)], [Outcome::Inapplicable; 2]);
    assert_eq!(outcome(3), Outcome::Passed);
    // One decided property passed.
    assert!(verdict.passed());
    assert_eq!(verdict.score(), 1.0);
}

#[test]
fn a_verdict_is_explained() {
    let parameters = parameters();
    let judge = judge();
    let verdict = judge
        .judge(&Call {
            action: "Pick",
            before: &state(0.0, false),
            after: &state(0.01, true),
            during: &Value::Null,
            parameters: &parameters,
        })
        .expect("it is valid");
    assert_eq!(verdict.judgements()[3].outcome, Outcome::Failed);
    assert!(!verdict.passed());
    let why = verdict.why("MovedObject").expect("it is valid");
    assert!(
        why.contains("is only 1 cm off table, needs more than 2 cm"),
        "{why}"
    );
    let why_not = verdict
        .why_not("MovedObject", "near_its_place(obj:table)")
        .expect("it is valid");
    assert!(why_not.contains("is not derived"), "{why_not}");
    let unknown = verdict
        .why("MovedObjekt")
        .expect_err("it is refused")
        .to_string();
    assert!(
        unknown.contains("J012") && unknown.contains("did you mean `MovedObject`"),
        "{unknown}"
    );
}

#[test]
fn every_fault_is_reported_with_its_place() {
    let (before, after) = (state(0.0, false), state(0.2, true));
    let wrong = with(
        after.clone(),
        &["bodies", "cube", "position"],
        [0.0, f64::NAN, 1.0].into(),
    );
    let wrong = with(
        wrong,
        &["bodies", "cube", "touchs"],
        Value::texts(["table"]),
    );
    let wrong = with(
        wrong,
        &["bodies", "table", "rests_on"],
        Value::texts(["flor"]),
    );
    let found = faults(
        &before,
        &wrong,
        &Value::map([("contact", 1.0.into())]),
        &Value::Null,
    );
    for part in [
        "J003 after[\"bodies\"][\"cube\"][\"position\"]: number 1, NaN, is not a finite number",
        "J001 after[\"bodies\"][\"cube\"]: unknown key `touchs`\n  help: did you mean `touches`?",
        "J007 after: no body has the id `flor`\n  help: did you mean `floor`?",
        "J001 during: unknown key `contact`\n  help: did you mean `contacts`?",
        "J006 parameters: `pickObject` is missing: `",
    ] {
        assert!(found.contains(part), "{part}\n{found}");
    }
    let fewer = Value::map([("bodies", Value::Map(Vec::new()))]);
    let found = faults(&before, &fewer, &Value::Null, &parameters());
    assert!(
        found.contains("J008") && found.contains("`cube`, `table`"),
        "{found}"
    );
    let named = judge()
        .properties("Pik")
        .expect_err("it is refused")
        .to_string();
    assert!(
        named.contains("J005") && named.contains("did you mean `Pick`"),
        "{named}"
    );
}

#[test]
fn own_rules_judge_any_action_alone_or_besides_others() {
    const RULE: &str =
        "@prefix act: <http://actions#> . @prefix w: <https://w3id.org/actcheck/world#> .
        success(?o) :- parameter(act:pickObject, ?o), after(?o, w:tilt, ?t), ?t < 0.1 .";
    let rule = |name: &str| OwnRule {
        name: name.to_owned(),
        text: RULE.to_owned(),
    };
    let (before, after) = (state(0.0, false), state(0.2, true));
    let own = Judge::new(None, &[rule("StaysUpright")]).expect("it is valid");
    let parameters = parameters();
    let verdict = own.judge(&Call {
        action: "Lift",
        before: &before,
        after: &after,
        during: &Value::Null,
        parameters: &parameters,
    });
    let verdict = verdict.expect("it is valid");
    assert_eq!(verdict.judgements().len(), 1);
    assert!(verdict.passed());
    let path = std::path::Path::new("built-in:ontology/actions.ttl");
    let both = Judge::new(Some(path), &[rule("StaysUpright")]).expect("it is valid");
    assert_eq!(both.properties("Pick").expect("it is valid").len(), 6);
    for (name, part) in [
        ("MovedObject", "another property"),
        ("is good", "can't be the name"),
    ] {
        let found = Judge::new(Some(path), &[rule(name)])
            .expect_err("it is refused")
            .to_string();
        assert!(found.contains("J009") && found.contains(part), "{found}");
    }
    let wrong = OwnRule {
        name: "Wrong".to_owned(),
        text: "success(?x) :- aftr(?x, w:z, 1.0) .".to_owned(),
    };
    let found = Judge::new(None, &[wrong])
        .expect_err("it is refused")
        .to_string();
    assert!(found.contains("Wrong.rls:1:"), "{found}");
}

#[test]
fn contacts_say_which_bodies_touch_and_carry() {
    let contact = |first: &str, second: &str, lift: f64| {
        Value::map([
            ("bodies", Value::texts([first, second])),
            ("force", 1.0.into()),
            ("force_on_second", [0.0, 0.0, lift].into()),
            ("point", [0.0; 3].into()),
        ])
    };
    let contacts = Value::List(vec![
        contact("robot/left", "cube", 0.5),
        contact("cube", "robot/right", -0.5),
    ]);
    let links = Value::map([
        ("left", Value::texts(["robot/left"])),
        ("right", Value::texts(["robot/right"])),
    ]);
    let strip = |state: Value| {
        let Value::Map(mut entries) = state else {
            panic!()
        };
        entries.retain(|(key, _)| *key == Key::One("bodies".to_owned()));
        let Value::Map(bodies) = entries.remove(0).1 else {
            panic!()
        };
        let bodies = bodies.into_iter().map(|(id, body)| {
            let Value::Map(mut body) = body else { panic!() };
            body.retain(|(key, _)| {
                !["touches", "rests_on"]
                    .iter()
                    .any(|name| *key == Key::One((*name).to_owned()))
            });
            (id, Value::Map(body))
        });
        Value::Map(vec![(
            Key::One("bodies".to_owned()),
            Value::Map(bodies.collect()),
        )])
    };
    let after = with(strip(state(0.2, true)), &["contacts"], contacts);
    let pose = Value::map([
        ("position", [0.0, 0.0, 1.03].into()),
        ("rotation", UP.into()),
    ]);
    let robot = Value::map([("gripper", pose), ("fingers", links)]);
    let after = with(after, &["robot"], robot);
    let found = judged(&judge(), &state(0.0, false), &after, &Value::Null);
    assert_eq!(found[4], ("ObjectInGripper".to_owned(), Outcome::Passed));
}

#[test]
fn a_monitor_judges_every_step() {
    let rule = OwnRule {
        name: "WasHigh".to_owned(),
        text: "@prefix act: <http://actions#> . @prefix w: <https://w3id.org/actcheck/world#> .
            success(?o) :- parameter(act:pickObject, ?o), once(w:z(?o) > 0.95) ."
            .to_owned(),
    };
    let judge = Judge::new(None, &[rule]).expect("it is valid");
    let mut monitor = judge
        .monitor("Pick", &state(0.0, false), &parameters())
        .expect("it is valid");
    let outcomes: Vec<Outcome> = (1..=4)
        .map(|step| {
            let height = [0.0, 0.1, 0.2, 0.1, 0.0][step];
            let verdict = monitor
                .step(&state(height, true), step as f64 * 0.05, None)
                .expect("it is valid");
            verdict.judgements()[0].outcome
        })
        .collect();
    use Outcome::{Failed, Passed};
    assert_eq!(outcomes, [Failed, Passed, Passed, Passed]);
    let late = monitor
        .step(&state(0.0, true), 1.0, None)
        .expect_err("it is refused")
        .to_string();
    assert!(late.contains("J010"), "{late}");
}
