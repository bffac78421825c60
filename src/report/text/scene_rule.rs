//! Converts a pattern to a rule that generates more such scenes (`[scene] require` of a
//! configuration).

use std::fmt::Write as _;

use actcheck_analysis::{Condition, Parameter};
use actcheck_base::names;

/// Maps each numeric table parameter to the facts of a scene: the body of a rule for `value(?v)`,
/// where `?o` is the target, `?s` its surface and `?n` any other object that is not a platform.
/// `ontology/world.ttl` and `ontology/history.ttl` define the terms.
const NUMBERS: [(&str, &str); 35] = [
    ("target_friction", "target(?o), before(?o, w:friction, ?v)"),
    ("target_mass_kg", "target(?o), before(?o, w:mass, ?v)"),
    (
        "target_restitution",
        "target(?o), before(?o, w:restitution, ?v)",
    ),
    ("target_x_m", "target(?o), before(?o, w:x, ?v)"),
    ("target_y_m", "target(?o), before(?o, w:y, ?v)"),
    ("target_z_m", "target(?o), before(?o, w:z, ?v)"),
    ("target_yaw_rad", "target(?o), before(?o, w:yaw, ?v)"),
    ("base_x_m", "before(w:robot, w:baseX, ?v)"),
    ("base_y_m", "before(w:robot, w:baseY, ?v)"),
    ("base_yaw_rad", "before(w:robot, w:baseYaw, ?v)"),
    (
        "robot_distance_m",
        "target(?o), from_base(?o, ?x, ?y), ?v = SQRT(?x * ?x + ?y * ?y)",
    ),
    (
        "target_ahead_m",
        "target(?o), from_base(?o, ?x, ?y), before(w:robot, w:baseYaw, ?a), ?v = COS(?a) * ?x + SIN(?a) * ?y",
    ),
    (
        "target_left_m",
        "target(?o), from_base(?o, ?x, ?y), before(w:robot, w:baseYaw, ?a), ?v = COS(?a) * ?y - SIN(?a) * ?x",
    ),
    (
        "target_turned_rad",
        "target(?o), before(?o, w:yaw, ?b), before(w:robot, w:baseYaw, ?a), ?v = ATAN2(SIN(?b - ?a), COS(?b - ?a))",
    ),
    (
        "surface_x_m",
        "on_surface(?x, ?y, ?a), ?v = COS(?a) * ?x + SIN(?a) * ?y",
    ),
    (
        "surface_y_m",
        "on_surface(?x, ?y, ?a), ?v = COS(?a) * ?y - SIN(?a) * ?x",
    ),
    ("neighbour_distance_m", "nearest(?v)"),
    (
        "neighbour_direction_rad",
        "nearest(?d), target(?o), away(?n, ?dx, ?dy, ?d), from_base(?o, ?x, ?y), ?b = ATAN2(?dy, ?dx) - ATAN2(0.0 - ?y, 0.0 - ?x), \
         ?v = ATAN2(SIN(?b), COS(?b))",
    ),
    ("others", "number_of(\"other\", ?v)"),
    ("place_others", "number_of(\"place-other\", ?v)"),
    ("obstacles", "number_of(\"obstacle\", ?v)"),
    ("obstacle_distance_m", "obstacle_distance(?v)"),
    ("position_noise_m", "before(_, act:positionNoise, ?v)"),
    ("height_noise_m", "before(_, act:heightNoise, ?v)"),
    ("yaw_noise_rad", "before(_, act:yawNoise, ?v)"),
    ("size_noise_m", "before(_, act:sizeNoise, ?v)"),
    (
        "localisation_noise_m",
        "before(_, act:localisationNoise, ?v)",
    ),
    ("heading_noise_rad", "before(_, act:headingNoise, ?v)"),
    ("gripper_noise_m", "before(_, act:gripperNoise, ?v)"),
    ("range_noise_m", "before(_, act:rangeNoise, ?v)"),
    ("odometry_drift", "before(_, act:odometryDrift, ?v)"),
    (
        "heading_drift_rad",
        "before(_, act:odometryHeadingDrift, ?v)",
    ),
    ("landmark_every_m", "before(_, act:landmarkDistance, ?v)"),
    ("landmark_noise_m", "before(_, act:landmarkNoise, ?v)"),
    (
        "landmark_noise_rad",
        "before(_, act:landmarkHeadingNoise, ?v)",
    ),
];

/// Maps each parameter with a name as its value to the body of a rule for `named(?t)`.
const NAMES: [(&str, &str); 4] = [
    ("world", "before(_, act:worldName, ?t)"),
    ("target_model", "target(?o), before(?o, act:model, ?t)"),
    (
        "surface_model",
        "parameter(act:objectSurface, ?s), before(?s, act:model, ?t)",
    ),
    (
        "neighbour_model",
        "nearest(?d), away(?n, _, _, ?d), before(?n, act:model, ?t)",
    ),
];

/// Maps each parameter with a class as its value to the body of a rule for `thing(?t)`.
const KINDS: [(&str, &str); 3] = [
    ("target_category", "target(?t)"),
    ("surface_category", "parameter(act:objectSurface, ?t)"),
    ("neighbour_category", "nearest(?d), away(?t, _, _, ?d)"),
];

/// Auxiliary predicates that the rules above use.
const DEFINITIONS: &str = r#"target(?o) :- parameter(act:pickObject, ?o) .
role(?n, ?r) :- before(?n, act:role, ?r) .
loose(?n) :- role(?n, ?r), ?r != "platform" .
from_base(?o, ?x, ?y) :- before(?o, w:x, ?ox), before(?o, w:y, ?oy), before(w:robot, w:baseX, ?bx), before(w:robot, w:baseY, ?by),
    ?x = ?ox - ?bx, ?y = ?oy - ?by .
on_surface(?x, ?y, ?a) :- target(?o), parameter(act:objectSurface, ?s), before(?o, w:x, ?ox), before(?o, w:y, ?oy),
    before(?s, w:x, ?sx), before(?s, w:y, ?sy), before(?s, w:yaw, ?a), ?x = ?ox - ?sx, ?y = ?oy - ?sy .
away(?n, ?dx, ?dy, ?d) :- target(?o), loose(?n), ?n != ?o, before(?o, w:x, ?ox), before(?o, w:y, ?oy),
    before(?n, w:x, ?nx), before(?n, w:y, ?ny), ?dx = ?nx - ?ox, ?dy = ?ny - ?oy, ?d = SQRT(?dx * ?dx + ?dy * ?dy) .
nearest(#min(?d)) :- away(_, _, _, ?d) .
counted(?r, #count(?n)) :- role(?n, ?r) .
there(?r) :- role(_, ?r) .
number_of(?r, ?v) :- counted(?r, ?v) .
number_of("other", 0) :- ~there("other") .
number_of("place-other", 0) :- ~there("place-other") .
number_of("obstacle", 0) :- ~there("obstacle") .
way(?ox, ?oy, ?x, ?y, ?share) :- target(?o), from_base(?o, ?x, ?y), role(?n, "obstacle"), from_base(?n, ?ox, ?oy),
    ?share = (?ox * ?x + ?oy * ?y) / (?x * ?x + ?y * ?y) .
from_way(?d) :- way(?ox, ?oy, _, _, ?share), ?share <= 0.0, ?d = SQRT(?ox * ?ox + ?oy * ?oy) .
from_way(?d) :- way(?ox, ?oy, ?x, ?y, ?share), ?share > 0.0, ?share < 1.0,
    ?d = ABS(?ox * ?y - ?oy * ?x) / SQRT(?x * ?x + ?y * ?y) .
from_way(?d) :- way(?ox, ?oy, ?x, ?y, ?share), ?share >= 1.0,
    ?d = SQRT((?ox - ?x) * (?ox - ?x) + (?oy - ?y) * (?oy - ?y)) .
obstacle_distance(#min(?d)) :- from_way(?d) .
kind(?t, ?c) :- before(?t, rdf:type, ?c) .
kind(?t, ?c) :- kind(?t, ?below), ontology(?below, rdfs:subClassOf, ?c) .
"#;

/// Returns the text of a rule file that a scene satisfies if all conditions hold.
///
/// # Errors
/// Returns the names of the parameters that can't be computed from the facts of a scene.
pub fn scene_rule(
    conditions: &[Condition],
    parameters: &[Parameter],
    sentence: &str,
) -> Result<String, Vec<String>> {
    let mut rules = String::new();
    let mut asked = Vec::new();
    let mut unknown = Vec::new();
    for (number, condition) in conditions.iter().enumerate() {
        let name = parameters[condition.parameter()].name.as_str();
        match asked_of(condition, name, number + 1) {
            Some((rule, literal)) => {
                rules.push_str(&rule);
                asked.push(literal);
            }
            None => unknown.push(name.to_owned()),
        }
    }
    if !unknown.is_empty() {
        return Err(unknown);
    }
    let mut text = format!("% More scenes like these: {sentence}.\n\n");
    for (prefix, namespace) in names::PREFIXES
        .iter()
        .filter(|(prefix, _)| ["act", "w", "rdf", "rdfs"].contains(prefix))
    {
        let _ = writeln!(text, "@prefix {prefix}: <{namespace}> .");
    }
    let _ = writeln!(text, "\nsuccess(w:robot) :- {} .\n", asked.join(", "));
    text.push_str(&rules);
    text.push('\n');
    text.push_str(DEFINITIONS);
    Ok(text)
}

/// The rules of one condition, and the literal that requires it. Returns `None` for an unknown
/// parameter.
fn asked_of(condition: &Condition, name: &str, number: usize) -> Option<(String, String)> {
    let known = |among: &[(&str, &'static str)]| {
        among
            .iter()
            .find(|(known, _)| *known == name)
            .map(|(_, body)| *body)
    };
    match condition {
        Condition::Kind { kind, .. } => {
            if let Some(body) = known(&NAMES) {
                let rule = format!("named_{number}(?t) :- {body} .\n");
                return Some((rule, format!("named_{number}({kind:?})")));
            }
            let body = known(&KINDS)?;
            // The tables contain the local names of classes.
            let rule = ['#', '/'].map(|mark| {
                format!(
                    "thing_{number}(?t) :- {body}, kind(?t, ?c), STRENDS(STR(?c), {:?}) .\n",
                    format!("{mark}{kind}")
                )
            });
            Some((rule.concat(), format!("thing_{number}(_)")))
        }
        Condition::Range { low, high, .. } => {
            let body = known(&NUMBERS)?;
            let rule = format!("value_{number}(?v) :- {body} .\n");
            let mut literal = format!("value_{number}(?v{number})");
            for (sign, bound) in [(">=", low), ("<", high)] {
                if let Some(bound) = bound {
                    let _ = write!(literal, ", ?v{number} {sign} {bound:?}");
                }
            }
            Some((rule, literal))
        }
        Condition::Arc { from, to, .. } => {
            let body = known(&NUMBERS)?;
            let rule = format!(
                "value_{number}(?v) :- {body} .\n\
                 within_{number}(?v) :- value_{number}(?v), ?v >= {from:?} .\n\
                 within_{number}(?v) :- value_{number}(?v), ?v < {to:?} .\n"
            );
            Some((rule, format!("within_{number}(_)")))
        }
    }
}
