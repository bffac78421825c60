//! The actions of a trace as the plain values that `actcheck.Judge` gets.

use actcheck::data::{
    ActionEnd, ActionTrace, BodyState, Form, Interval, IntervalKind, Look, Part, Perceived, Pose,
    RobotCourse, RobotState, SceneMap, Shape, Snapshot, Trace,
};
use actcheck_judge::{Key, Value as Plain};
use serde_json::{Map, Value, json};

/// Returns one action of a trace, counted from 0. Keys that are pairs are joined with `|`.
pub fn action(trace: &Trace, step: usize) -> Value {
    let performed = &trace.actions[step];
    let state = |snapshot: &Snapshot| state(snapshot, &trace.forms, &trace.map);
    json!({
        "action": performed.action,
        "before": state(&trace.snapshots[step]),
        "after": state(&trace.snapshots[step + 1]),
        "during": during(performed, &trace.robot_courses[step], &trace.snapshots[step]),
        "parameters": performed.parameters,
    })
}

/// Converts plain JSON for callers in Rust.
pub fn plain(value: &Value) -> Plain {
    match value {
        Value::Null => Plain::Null,
        Value::Bool(truth) => Plain::Bool(*truth),
        Value::Number(number) => Plain::Number(number.as_f64().unwrap()),
        Value::String(text) => Plain::Text(text.clone()),
        Value::Array(values) if !values.is_empty() && values.iter().all(Value::is_number) => {
            Plain::Numbers(values.iter().map(|it| it.as_f64().unwrap()).collect())
        }
        Value::Array(values) => Plain::List(values.iter().map(plain).collect()),
        Value::Object(entries) => {
            let entries = entries.iter().map(|(key, value)| {
                let key = match key.split_once('|') {
                    Some((first, second)) => Key::Pair([first.to_owned(), second.to_owned()]),
                    None => Key::One(key.clone()),
                };
                (key, plain(value))
            });
            Plain::Map(entries.collect())
        }
    }
}

fn state(snapshot: &Snapshot, forms: &[Form], map: &SceneMap) -> Value {
    let bodies: Map<String, Value> = snapshot
        .bodies
        .iter()
        .map(|of| (of.id.clone(), body(of, forms)))
        .collect();
    let locations = map.locations.iter();
    let locations =
        locations.map(|it| json!({"name": it.name, "at": it.at, "surface": it.surface}));
    let rooms = map.rooms.iter();
    let rooms = rooms.map(|it| json!({"name": it.name, "low": it.low_m, "high": it.high_m}));
    let surfaces = map.surfaces.iter();
    let surfaces = surfaces.map(|it| json!({"id": it.id, "at": it.at, "size": it.size_m}));
    json!({
        "bodies": bodies,
        "robot": robot(&snapshot.robot),
        "time": snapshot.time_secs,
        "map": {
            "locations": locations.collect::<Vec<Value>>(),
            "rooms": rooms.collect::<Vec<Value>>(),
            "surfaces": surfaces.collect::<Vec<Value>>(),
        },
    })
}

fn body(of: &BodyState, forms: &[Form]) -> Value {
    let mut body = json!({
        "position": of.pose.position,
        "rotation": of.pose.rotation,
        "category": of.category,
        "fixed": of.fixed,
        "size": of.size_m,
        "bounding_box": [of.aabb_min, of.aabb_max],
        "mass": of.mass_kg,
        "friction": of.friction,
        "restitution": of.restitution,
        "linear_velocity": of.linear_velocity,
        "angular_velocity": of.angular_velocity,
        "touches": of.touches,
        "rests_on": of.rests_on,
        "gripper_distance": of.grasp_distance_m,
        "part": of.part.as_ref().map(|(whole, at)| json!({"of": whole, "position": at})),
        "asleep": of.asleep,
        "left_world": of.left_world,
    });
    if let Some(form) = forms.iter().find(|form| form.name == of.id) {
        body["shapes"] = form.parts.iter().map(shape).collect();
    }
    body
}

fn shape(part: &Part) -> Value {
    let mut shape = match &part.shape {
        Shape::Box { size } => json!({"kind": "box", "size": size}),
        Shape::Sphere { radius } => json!({"kind": "sphere", "radius": radius}),
        Shape::Cylinder { radius, height } => {
            json!({"kind": "cylinder", "radius": radius, "height": height})
        }
        Shape::Capsule { radius, height } => {
            json!({"kind": "capsule", "radius": radius, "height": height})
        }
        Shape::Tube {
            radius_low,
            radius_high,
            wall,
            height,
            staves,
        } => json!({
            "kind": "tube", "radius_low": radius_low, "radius_high": radius_high, "wall": wall,
            "height": height, "staves": staves,
        }),
        Shape::Hull { points, .. } => json!({"kind": "hull", "points": points}),
        Shape::Mesh { mesh } => json!({"kind": "hull", "points": mesh.vertices}),
    };
    shape["position"] = json!(part.pose.position);
    shape["rotation"] = json!(part.pose.rotation);
    shape
}

fn pose(of: &Pose) -> Value {
    json!({"position": of.position, "rotation": of.rotation})
}

/// A limit; `null` if it is infinite.
fn limit(value: f64) -> Value {
    if value.is_finite() {
        json!(value)
    } else {
        Value::Null
    }
}

fn robot(of: &RobotState) -> Value {
    let joints: Map<String, Value> = of
        .joints
        .iter()
        .map(|joint| {
            let is_limited = joint.lower.is_finite() && joint.upper.is_finite();
            let state = json!({
                "position": joint.position,
                "velocity": joint.velocity,
                "limits": is_limited.then_some([joint.lower, joint.upper]),
                "max_velocity": limit(joint.max_velocity),
                "max_effort": limit(joint.max_effort),
            });
            (joint.name.clone(), state)
        })
        .collect();
    json!({
        "base": of.base_true,
        "believed_base": of.base_believed,
        "gripper": pose(&of.gripper),
        "opening": of.gripper_opening_m,
        "left_touches": of.left_touches,
        "right_touches": of.right_touches,
        "joints": joints,
        "cup": of.cup.map(|cup| json!({"force": cup.force_n, "pull": cup.pull_n})),
    })
}

fn during(action: &ActionTrace, course: &RobotCourse, before: &Snapshot) -> Value {
    let contacts = action.contacts.iter().map(|it| {
        json!({
            "bodies": it.pair, "start": it.start_secs, "end": it.end_secs,
            "max_force": it.max_force_n, "point": it.point_m,
        })
    });
    let extremes = action.extremes.iter().map(|it| {
        let extremes = json!({
            "max_tilt": it.max_tilt_rad, "max_speed": it.max_speed,
            "max_rise": it.max_rise_m, "max_displacement": it.max_displacement_m,
        });
        (it.id.clone(), extremes)
    });
    let percepts = action.percepts.iter().map(|it| {
        json!({
            "object": it.id, "pose": pose(&it.pose), "size": it.size_m,
            "look": it.look.as_ref().map(look),
        })
    });
    let phases = action
        .phases
        .iter()
        .map(|it| json!({"name": it.name, "start": it.start_secs}));
    let ended = match &action.end {
        ActionEnd::Completed => json!("completed"),
        ActionEnd::Timeout(reason) | ActionEnd::Cut(reason) => json!(["timeout", reason]),
        ActionEnd::Broken(reason) => json!(["broken", reason]),
        other => panic!("{other:?}"),
    };
    let mut during = json!({
        "report": action.report.as_ref().map(|it| json!([it.succeeded, it.message])),
        "ended": ended,
        "duration": action.duration_secs,
        "contacts": contacts.collect::<Vec<Value>>(),
        "extremes": extremes.collect::<Map<String, Value>>(),
        "percepts": percepts.collect::<Vec<Value>>(),
        "perceived": action.perceived.as_ref().map(perceived),
        "base_path": action.base,
        "phases": phases.collect::<Vec<Value>>(),
    });
    of_robot(course, &mut during);
    let samples = &course.samples;
    if samples.count > 0 {
        let mut series = Map::from_iter([("period".to_owned(), json!(samples.period_secs))]);
        for it in &samples.series {
            let key = match it.other.as_str() {
                "" => it.thing.clone(),
                other => format!("{}|{other}", it.thing),
            };
            let values: Vec<f64> = it.values().collect();
            let of_thing = series.entry(key).or_insert_with(|| json!({}));
            of_thing[&it.quantity] = json!(values);
        }
        during["samples"] = Value::Object(series);
    }
    assert!(!before.bodies.is_empty());
    during
}

fn of_robot(course: &RobotCourse, during: &mut Value) {
    let joints = course.joints.iter().map(|it| {
        let joint = json!({
            "max_excess": limit(it.max_excess), "max_speed_share": it.max_speed_share,
            "overload_time": it.overload_secs,
        });
        (it.name.clone(), joint)
    });
    during["joints"] = Value::Object(joints.collect());
    let contacts = course.self_contacts.iter().map(|it| {
        json!({
            "links": it.pair, "start": it.start_secs, "max_depth": it.max_depth_m,
            "max_force": it.press.max_force_n, "of_hand": it.press.of_hand,
        })
    });
    during["self_contacts"] = contacts.collect();
    let held = course.held.iter();
    let held = held.map(|it| {
        let held = json!({"time": it.held_secs, "max_tilt": it.max_tilt_rad});
        (it.id.clone(), held)
    });
    during["held"] = Value::Object(held.collect());
    let clearances = course.clearances.iter();
    let clearances = clearances.map(|it| (it.id.clone(), json!(it.smallest_m)));
    during["clearances"] = Value::Object(clearances.collect());
    for (kind, key) in [
        (IntervalKind::Hold, "holds"),
        (IntervalKind::Motion, "motions"),
    ] {
        let of_kind = |it: &&Interval| it.kind == kind;
        let intervals = course
            .intervals
            .iter()
            .filter(of_kind)
            .map(|it| json!({"object": it.thing, "start": it.start_secs, "end": it.end_secs}));
        during[key] = intervals.collect();
    }
}

fn look(of: &Look) -> Value {
    json!({
        "time": of.time_secs, "base": of.base_true, "believed_base": of.base_believed,
        "camera": pose(&of.camera),
    })
}

fn perceived(of: &Perceived) -> Value {
    let objects = of
        .things
        .iter()
        .map(|it| json!({"category": it.category, "pose": pose(&it.pose), "size": it.size_m}));
    json!({
        "plane": of.plane.map(|it| json!({"pose": pose(&it.pose), "size": it.size_m})),
        "objects": objects.collect::<Vec<Value>>(),
        "look": of.look.as_ref().map(look),
    })
}
