//! Made-up runs in the form of a history's records, as a replacement for long simulations.

use std::collections::BTreeMap;

use actcheck::base::{Judgement, Outcome};
use actcheck::data::Role;
use actcheck::history::{ActionDetail, ObjectDetail, RunDetail, RunRow, RunStatus};

use super::planted::Dice;

/// Classes of objects with their weights.
pub const CLASSES: [&str; 6] = ["Bottle", "Bowl", "Box", "Can", "Glass", "Mug"];

/// A run of a campaign with one target on a table and up to four objects around it; `judge` gives
/// the outcomes of each of its actions.
pub fn run(
    campaign: &str,
    index: u64,
    dice: &mut Dice,
    actions: &[&str],
    judge: impl Fn(&ObjectDetail, usize, &mut Dice) -> Vec<(&'static str, Outcome)>,
) -> RunDetail {
    let id = format!("{campaign}-{}", index + 1);
    let mut objects = vec![object(
        "table_1",
        "Table",
        Role::Platform,
        [1.0, 0.0, 0.7],
        dice,
    )];
    let class = CLASSES[dice.below(CLASSES.len() as u64) as usize];
    let place = [0.7 + 0.5 * dice.share(), 0.8 * dice.share() - 0.4, 0.75];
    objects.push(object(
        &format!("{}_1", class.to_lowercase()),
        class,
        Role::Target,
        place,
        dice,
    ));
    for number in 0..dice.below(5) {
        let place = [0.7 + 0.5 * dice.share(), 0.8 * dice.share() - 0.4, 0.75];
        objects.push(object(
            &format!("mug_{}", number + 2),
            "Mug",
            Role::Other,
            place,
            dice,
        ));
    }
    let target = objects[1].clone();
    let robot_base = [0.0, 0.1 * dice.share(), 0.2 * dice.share()];
    let actions = actions
        .iter()
        .enumerate()
        .map(|(step, action)| ActionDetail {
            step: step as u32 + 1,
            action: format!("http://actions#{action}"),
            score: 1.0,
            reported: Some(true),
            message: Some("done".to_owned()),
            duration_secs: 5.0 + dice.share(),
            end: "completed".to_owned(),
            parameters: BTreeMap::from([
                ("pickObject".to_owned(), vec![target.id.clone()]),
                ("objectLocation".to_owned(), vec!["kitchen".to_owned()]),
            ]),
            judgements: judge(&target, step, dice)
                .into_iter()
                .map(|(name, outcome)| judgement(name, outcome))
                .collect(),
        });
    RunDetail {
        episode: None,
        row: RunRow {
            run: id.clone(),
            campaign: campaign.to_owned(),
            index,
            repetition: None,
            weight: None,
            test: "Pick Place".to_owned(),
            status: RunStatus::Completed,
            score: 1.0,
            trace_hash: format!("hash of {id}"),
            started: format!("2026-01-{:02}T00:00:00Z", 1 + index % 28),
        },
        seed: 7,
        reason: None,
        program_output: None,
        discards: Vec::new(),
        wall_secs: 1.0,
        elapsed_secs: 1.0,
        world: "lab".to_owned(),
        program_version: "0.1.0".to_owned(),
        robot_base,
        noise: BTreeMap::from([("positionNoise".to_owned(), 0.025)]),
        designators: BTreeMap::new(),
        actions: actions.collect(),
        objects,
    }
}

fn judgement(name: &str, outcome: Outcome) -> Judgement {
    Judgement {
        property: format!("http://actions#{name}"),
        outcome,
        margin: match outcome {
            Outcome::Passed => Some(0.02),
            Outcome::Failed => Some(-0.01),
            _ => None,
        },
        witness: String::new(),
        rule_digest: String::new(),
        held_before: None,
        vacuous: None,
    }
}

fn object(id: &str, class: &str, role: Role, [x, y, z]: [f64; 3], dice: &mut Dice) -> ObjectDetail {
    ObjectDetail {
        id: id.to_owned(),
        model: class.to_lowercase(),
        category: format!("http://actions#{class}"),
        role,
        x,
        y,
        z,
        yaw: 6.0 * dice.share() - 3.0,
        mass_kg: 0.2 + 0.5 * dice.share(),
        friction: 0.2 + 0.8 * dice.share(),
        restitution: 0.1 * dice.share(),
        robot_distance_m: x.hypot(y),
        neighbour_distance_m: None,
        target_distance_m: None,
        displacement_m: Some(0.001),
        max_tilt_rad: Some(0.0),
    }
}
