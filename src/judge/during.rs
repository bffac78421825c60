//! Reads the events during an action.

use std::collections::BTreeMap;

use actcheck_base::{did_you_mean, names};
use actcheck_data::{
    ActionEnd, ActionReport, ActionTrace, Clearance, ContactEpisode, Extremes, HeldCourse,
    Interval, IntervalKind, JointCourse, Look, Perceived, PerceivedPlane, PerceivedThing, Percept,
    Phase, RobotCourse, SelfCollision, SelfPress,
};

use crate::Value;
use crate::course::{self, Course, still};
use crate::lacks::{BASE_PATH, CONTACTS, LOOK, Lacks, PERCEIVED, SELF_CONTACTS};
use crate::reader::{At, Table};
use crate::snapshot::{State, read_pose};

/// The events during an action, with the facts that they lack.
#[derive(Debug, Clone)]
pub(crate) struct During {
    pub(crate) action: ActionTrace,
    pub(crate) course: RobotCourse,
    pub(crate) lacks: Lacks,
}

const DURING: [&str; 16] = [
    "report",
    "ended",
    "duration",
    "contacts",
    "extremes",
    "percepts",
    "perceived",
    "base_path",
    "phases",
    "joints",
    "self_contacts",
    "held",
    "clearances",
    "holds",
    "motions",
    "samples",
];

/// Reads the events of an action between two states.
pub(crate) fn read(at: &At<'_>, before: &State, after: &State) -> During {
    let mut during = During {
        action: ActionTrace {
            end: ActionEnd::Completed,
            ..ActionTrace::not_reached("", &BTreeMap::new())
        },
        course: RobotCourse::default(),
        lacks: Lacks::default(),
    };
    let nothing = Value::Map(Vec::new());
    let without = at.with(&nothing);
    let at = if at.is_none() { &without } else { at };
    let table = at.table(&DURING);
    let samples = table
        .get("samples")
        .and_then(|at| course::read(&at, before));
    during.read_action(&table, samples.as_ref());
    during.read_contacts(&table, before);
    during.read_perception(&table);
    during.read_extremes(&table, [before, after], samples.as_ref());
    during.read_robot(&table, before);
    during.read_intervals(&table, before, samples.as_ref());
    match samples.filter(|samples| samples.count > 0) {
        Some(mut samples) => {
            // Without contacts, no force acted.
            let contacts = table.get("contacts");
            samples.forces |= contacts.is_some_and(|_| during.action.contacts.is_empty());
            samples.note_missing(before, &mut during.lacks);
            during.course.samples = samples.samples();
        }
        None => during.lacks.add(&["samples"]),
    }
    during
}

impl During {
    fn read_action(&mut self, table: &Table<'_>, samples: Option<&Course>) {
        match table.get("report") {
            None => self.lacks.add(&["reported", "message"]),
            Some(at) => self.action.report = read_report(&at),
        }
        if let Some(at) = table.get("ended") {
            self.action.end = read_end(&at).unwrap_or(ActionEnd::Completed);
        }
        let duration = table.get("duration").map(|at| at.amount());
        let sampled = samples
            .filter(|samples| samples.count > 0)
            .map(|samples| (samples.count - 1) as f64 * samples.period_secs);
        match duration.map_or(sampled, |given| given) {
            Some(secs) => self.action.duration_secs = secs,
            None => self.lacks.add(&["duration"]),
        }
        match table.get("phases") {
            None => self.lacks.add(&["phaseName", "phase", "samples/phase"]),
            Some(at) => {
                for at in at.list("phases") {
                    let table = at.table(&["name", "start"]);
                    let name = table.required("name").and_then(|at| at.text());
                    let start = table.required("start").and_then(|at| at.amount());
                    if let (Some(name), Some(start_secs)) = (name, start) {
                        self.action.phases.push(Phase {
                            name: name.to_owned(),
                            start_secs,
                        });
                    }
                }
            }
        }
        match table.get("base_path") {
            None => self.lacks.add(BASE_PATH),
            Some(at) if at.is_none() => {}
            Some(at) => {
                let corners: Option<Vec<[f64; 2]>> =
                    at.list("two corners").iter().map(At::vector).collect();
                self.action.base = corners.and_then(|corners| corners.try_into().ok());
                if self.action.base.is_none() {
                    at.wrong("the lowest and the highest x and y");
                }
            }
        }
    }

    fn read_contacts(&mut self, table: &Table<'_>, state: &State) {
        let Some(at) = table.get("contacts") else {
            self.lacks.add(CONTACTS);
            return;
        };
        for at in at.list("contacts") {
            let table = at.table(&["bodies", "start", "end", "max_force", "point"]);
            let pair = table.required("bodies").and_then(|at| {
                let pair = at.pair()?;
                known_pair(&at, &pair, state);
                Some(pair)
            });
            let start = table.required("start").and_then(|at| at.number());
            let end = table.required("end").and_then(|at| at.number());
            let point = table.required("point").and_then(|at| at.vector());
            let force = table.get("max_force");
            if force.is_none() {
                self.lacks.add(&["maxForce"]);
            }
            let force = force.map_or(Some(0.0), |at| at.amount());
            if let (
                Some(pair),
                Some(start_secs),
                Some(end_secs),
                Some(max_force_n),
                Some(point_m),
            ) = (pair, start, end, force, point)
            {
                self.action.contacts.push(ContactEpisode {
                    pair,
                    start_secs,
                    end_secs,
                    max_force_n,
                    point_m,
                });
            }
        }
    }

    fn read_perception(&mut self, table: &Table<'_>) {
        match table.get("percepts") {
            None => {
                self.lacks.add(&["ofObject"]);
                self.lacks.add(LOOK);
            }
            Some(at) => {
                for at in at.list("percepts") {
                    let percept = read_percept(&at, &mut self.lacks);
                    self.action.percepts.extend(percept);
                }
            }
        }
        match table.get("perceived") {
            None => {
                self.lacks.add(PERCEIVED);
                self.lacks.add(LOOK);
            }
            Some(at) if at.is_none() => {}
            Some(at) => self.action.perceived = Some(read_perceived(&at, &mut self.lacks)),
        }
    }

    fn read_extremes(
        &mut self,
        table: &Table<'_>,
        [before, after]: [&State; 2],
        samples: Option<&Course>,
    ) {
        let given = table.get("extremes");
        let entries = given.iter().flat_map(|at| at.named("extremes by body"));
        let given: BTreeMap<&str, At<'_>> = entries.collect();
        for (id, at) in &given {
            if !before.snapshot.bodies.iter().any(|body| body.id == *id) {
                unknown_body(at, id, before);
            }
        }
        for (idx, body) in before.snapshot.bodies.iter().enumerate() {
            let (mut found, mut known) = samples.map_or_else(
                || (still(&body.id), [false; 3]),
                |samples| samples.extremes(&body.id),
            );
            let later = after
                .snapshot
                .bodies
                .iter()
                .find(|later| later.id == body.id);
            // A fixed body that ends where it was did not move.
            if body.fixed && later.is_some_and(|later| later.pose == body.pose) {
                known = [known[0] || before.known[idx].rotation, true, true];
                found.max_tilt_rad = found.max_tilt_rad.max(body.pose.tilt());
            }
            if let Some(at) = given.get(body.id.as_str()) {
                read_extreme(at, &mut found, &mut known);
            }
            for (is_known, facts) in known.into_iter().zip([
                &["maxTilt"] as &[&str],
                &["maxSpeed"],
                &["maxRise", "maxDisplacement"],
            ]) {
                if !is_known {
                    self.lacks.add(facts);
                }
            }
            self.action.extremes.push(found);
        }
    }

    fn read_robot(&mut self, table: &Table<'_>, state: &State) {
        match table.get("joints") {
            None => self
                .lacks
                .add(&["maxExcess", "maxSpeedShare", "overloadTime"]),
            Some(at) => {
                for (name, at) in at.named("joints by their names") {
                    let course = read_joint(name, &at, &mut self.lacks);
                    self.course.joints.push(course);
                }
            }
        }
        match table.get("self_contacts") {
            None => self.lacks.add(SELF_CONTACTS),
            Some(at) => {
                let found = at.list("contacts of links");
                let found = found.iter().filter_map(read_self_contact);
                self.course.self_contacts.extend(found);
            }
        }
        match table.get("clearances") {
            None => self.lacks.add(&["clearance"]),
            Some(at) => {
                for (id, at) in at.named("distances by body") {
                    if !state.is_thing(id) {
                        unknown_body(&at, id, state);
                    }
                    if let Some(smallest_m) = at.number() {
                        let id = id.to_owned();
                        self.course.clearances.push(Clearance { id, smallest_m });
                    }
                }
            }
        }
        match table.get("held") {
            None => self.lacks.add(&["heldTime", "heldTilt"]),
            Some(at) => {
                for (id, at) in at.named("holds by body") {
                    if !state.is_thing(id) {
                        unknown_body(&at, id, state);
                    }
                    let table = at.table(&["time", "max_tilt"]);
                    let held = table.required("time").and_then(|at| at.amount());
                    let tilt = table.required("max_tilt").and_then(|at| at.amount());
                    if let (Some(held_secs), Some(max_tilt_rad)) = (held, tilt) {
                        self.course.held.push(HeldCourse {
                            id: id.to_owned(),
                            held_secs,
                            max_tilt_rad,
                        });
                    }
                }
            }
        }
    }

    fn read_intervals(&mut self, table: &Table<'_>, state: &State, samples: Option<&Course>) {
        let sampled = samples.map(|samples| (samples.samples().intervals(), samples));
        for (kind, key, fact) in [
            (IntervalKind::Hold, "holds", "heldObject"),
            (IntervalKind::Motion, "motions", "movedObject"),
        ] {
            if let Some(at) = table.get(key) {
                let found = at.list("intervals");
                let found = found.iter().filter_map(|at| read_interval(at, kind, state));
                self.course.intervals.extend(found);
                continue;
            }
            let known = sampled.as_ref().is_some_and(|(_, samples)| {
                let known = samples.intervals(state);
                known.contains(&(kind, true))
            });
            if !known {
                self.lacks.add(&[fact]);
                continue;
            }
            let of_kind = sampled.iter().flat_map(|(intervals, _)| intervals);
            let of_kind = of_kind.filter(|interval| interval.kind == kind);
            self.course.intervals.extend(of_kind.cloned());
        }
    }
}

fn known_pair(at: &At<'_>, pair: &[String; 2], state: &State) {
    for name in pair {
        if !name.starts_with("robot/") && !state.is_thing(name) {
            unknown_body(at, name, state);
        }
    }
}

fn unknown_body(at: &At<'_>, name: &str, state: &State) {
    let known = state.snapshot.bodies.iter().map(|body| body.id.as_str());
    let help = did_you_mean(name, known.collect::<Vec<&str>>());
    at.fault("J007", &format!("no body has the id `{name}`"), &help);
}

/// Reads a report: `True`, `False`, a pair of one and a message, or `None` for no report.
fn read_report(at: &At<'_>) -> Option<ActionReport> {
    match at.value() {
        Value::Null => None,
        Value::Bool(succeeded) => Some(ActionReport {
            succeeded: *succeeded,
            message: String::new(),
        }),
        Value::List(_) => {
            let values = at.list("a truth value and a message");
            let [succeeded, message] = values.as_slice() else {
                at.wrong("a truth value and a message");
                return None;
            };
            Some(ActionReport {
                succeeded: succeeded.truth()?,
                message: message.text()?.to_owned(),
            })
        }
        _ => {
            at.wrong("True, False, a pair of one and a message, or None");
            None
        }
    }
}

/// Reads how an action ended: `completed`, or a pair of `timeout` or `broken` and the reason.
fn read_end(at: &At<'_>) -> Option<ActionEnd> {
    let wanted = "`completed`, or a pair such as (\"timeout\", \"after 60 s\")";
    match at.value() {
        Value::Text(text) if text == "completed" => Some(ActionEnd::Completed),
        Value::List(_) => {
            let values = at.list(wanted);
            let [kind, reason] = values.as_slice() else {
                at.wrong(wanted);
                return None;
            };
            let reason = reason.text()?.to_owned();
            match kind.text()? {
                "timeout" => Some(ActionEnd::Timeout(reason)),
                "broken" => Some(ActionEnd::Broken(reason)),
                _ => {
                    kind.wrong("`timeout` or `broken`");
                    None
                }
            }
        }
        _ => {
            at.wrong(wanted);
            None
        }
    }
}

fn read_extreme(at: &At<'_>, found: &mut Extremes, known: &mut [bool; 3]) {
    let table = at.table(&["max_tilt", "max_speed", "max_rise", "max_displacement"]);
    let number = |key| table.get(key).and_then(|at| at.number());
    if let Some(tilt) = number("max_tilt") {
        (found.max_tilt_rad, known[0]) = (tilt, true);
    }
    if let Some(speed) = number("max_speed") {
        (found.max_speed, known[1]) = (speed, true);
    }
    if let (Some(rise), Some(way)) = (number("max_rise"), number("max_displacement")) {
        (found.max_rise_m, found.max_displacement_m, known[2]) = (rise, way, true);
    }
}

fn read_joint(name: &str, at: &At<'_>, lacks: &mut Lacks) -> JointCourse {
    let table = at.table(&["max_excess", "max_speed_share", "overload_time"]);
    let mut number = |key, unlimited: f64, fact| match table.get(key) {
        Some(at) => at.limit(unlimited).unwrap_or(0.0),
        None => {
            lacks.add(&[fact]);
            0.0
        }
    };
    JointCourse {
        name: name.to_owned(),
        max_excess: number("max_excess", f64::NEG_INFINITY, "maxExcess"),
        max_speed_share: number("max_speed_share", 0.0, "maxSpeedShare"),
        overload_secs: number("overload_time", 0.0, "overloadTime"),
    }
}

fn read_self_contact(at: &At<'_>) -> Option<SelfCollision> {
    let table = at.table(&["links", "start", "max_depth", "max_force", "of_hand"]);
    let links = table.required("links").and_then(|at| at.pair());
    let start = table.required("start").and_then(|at| at.number());
    let depth = table.required("max_depth").and_then(|at| at.number());
    let force = table.required("max_force").and_then(|at| at.amount());
    let of_hand = table.required("of_hand").and_then(|at| at.truth());
    Some(SelfCollision {
        pair: links?,
        start_secs: start?,
        max_depth_m: depth?,
        press: SelfPress {
            max_force_n: force?,
            of_hand: of_hand?,
        },
    })
}

fn read_interval(at: &At<'_>, kind: IntervalKind, state: &State) -> Option<Interval> {
    let table = at.table(&["object", "start", "end"]);
    let object = table.required("object").and_then(|at| {
        let object = at.text()?;
        if !state.is_thing(object) {
            unknown_body(&at, object, state);
        }
        Some(object)
    });
    let start = table.required("start").and_then(|at| at.number());
    let end = table.required("end").and_then(|at| at.number());
    Some(Interval {
        kind,
        thing: object?.to_owned(),
        start_secs: start?,
        end_secs: end?,
    })
}

/// Reads the moment of perception: `None` without a picture of a camera.
fn read_look(table: &Table<'_>, lacks: &mut Lacks) -> Option<Look> {
    let Some(at) = table.get("look") else {
        lacks.add(LOOK);
        return None;
    };
    if at.is_none() {
        return None;
    }
    let table = at.table(&["time", "base", "believed_base", "camera"]);
    let time = table.required("time").and_then(|at| at.number());
    let base = table.required("base").and_then(|at| at.vector());
    let believed = table.required("believed_base").and_then(|at| at.vector());
    let camera = table.required("camera").and_then(|at| read_pose(&at));
    Some(Look {
        time_secs: time?,
        base_true: base?,
        base_believed: believed?,
        camera: camera?,
    })
}

fn read_percept(at: &At<'_>, lacks: &mut Lacks) -> Option<Percept> {
    let table = at.table(&["object", "pose", "size", "look"]);
    let object = table.required("object").and_then(|at| at.text());
    let pose = table.required("pose").and_then(|at| read_pose(&at));
    let size = table.required("size").and_then(|at| at.vector());
    let look = read_look(&table, lacks);
    Some(Percept {
        id: object?.to_owned(),
        pose: pose?,
        size_m: size?,
        look,
    })
}

fn read_perceived(at: &At<'_>, lacks: &mut Lacks) -> Perceived {
    let table = at.table(&["plane", "objects", "look"]);
    let mut perceived = Perceived {
        look: read_look(&table, lacks),
        ..Perceived::default()
    };
    if let Some(at) = table.required("plane").filter(|at| !at.is_none()) {
        let table = at.table(&["pose", "size"]);
        let pose = table.required("pose").and_then(|at| read_pose(&at));
        let size = table.required("size").and_then(|at| at.vector());
        if let (Some(pose), Some(size_m)) = (pose, size) {
            perceived.plane = Some(PerceivedPlane { pose, size_m });
        }
    }
    let objects = table.required("objects");
    for at in objects.iter().flat_map(|at| at.list("objects")) {
        let table = at.table(&["category", "pose", "size"]);
        let category = table.required("category").filter(|at| !at.is_none());
        let pose = table.required("pose").and_then(|at| read_pose(&at));
        let size = table.required("size").and_then(|at| at.vector());
        if let (Some(pose), Some(size_m)) = (pose, size) {
            perceived.things.push(PerceivedThing {
                category: category.and_then(|at| at.text()).map(names::category),
                pose,
                size_m,
            });
        }
    }
    perceived
}
