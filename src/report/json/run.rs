//! One stored run as JSON.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use actcheck_history::RunDetail;

/// Returns the run as JSON.
///
/// `perceived` are sentences about the perceived target, by the action's position in the test (from
/// 1).
pub fn run_json(run: &RunDetail, perceived: &BTreeMap<u32, String>) -> Value {
    let row = &run.row;
    let objects: Vec<Value> = run
        .objects
        .iter()
        .map(|o| {
            json!({
                "id": o.id, "model": o.model, "category": o.category, "role": o.role.word(),
                "x": o.x, "y": o.y, "z": o.z, "yaw": o.yaw, "mass_kg": o.mass_kg, "friction": o.friction,
                "restitution": o.restitution, "robot_distance_m": o.robot_distance_m,
                "neighbour_distance_m": o.neighbour_distance_m, "target_distance_m": o.target_distance_m,
                "displacement_m": o.displacement_m, "max_tilt_rad": o.max_tilt_rad,
            })
        })
        .collect();
    let actions: Vec<Value> = run
        .actions
        .iter()
        .map(|a| {
            json!({
                "step": a.step, "action": a.action, "score": a.score, "end": a.end, "reported": a.reported,
                "message": a.message, "perceived": perceived.get(&a.step), "duration_secs": a.duration_secs, "parameters": a.parameters,
                "outcomes": a.judgements.iter().map(|j| json!({
                    "property": j.property, "outcome": j.outcome, "margin": j.margin, "witness": j.witness,
                    "rule_digest": j.rule_digest, "held_before": j.held_before, "vacuous": j.vacuous,
                })).collect::<Vec<_>>(),
            })
        })
        .collect();
    json!({
        "run": row.run, "campaign": row.campaign, "index": row.index, "test": row.test, "status": row.status.word(),
        "scene": row.repetition.map(|repetition| repetition.scene),
        "repetition": row.repetition.map(|repetition| repetition.number), "weight": row.weight,
        "reason": run.reason, "program_output": run.program_output, "score": row.score, "trace_hash": row.trace_hash, "seed": run.seed,
        "started": row.started, "wall_secs": run.wall_secs, "program_version": run.program_version,
        "world": run.world, "robot_base": run.robot_base, "noise": run.noise, "designators": run.designators,
        "objects": objects, "actions": actions,
    })
}
