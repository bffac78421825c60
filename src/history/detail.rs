//! Reads all details of one run.

use std::collections::BTreeMap;

use oxigraph::model::{GraphNameRef, NamedNode, Term};
use oxigraph::store::StorageError;

use crate::quad_source::QuadSource;
use crate::read::{Node, id_of, subjects, text_of};
use crate::statements::iri;
use crate::write_scene::NOISE_TERMS;
use crate::{ActionDetail, ObjectDetail, Repetition, RunDetail, RunRow, RunStatus};
use actcheck_base::{Judgement, Outcome, names};
use actcheck_data::Role;

/// The objects of a run's scene and its actions with their outcomes. None of these depends on the
/// time that the run took.
pub(super) type Parts = (Vec<ObjectDetail>, Vec<ActionDetail>);

/// Reads an existing run.
pub(super) fn read(store: &impl QuadSource, run: &NamedNode) -> Result<RunDetail, StorageError> {
    read_with(store, run, parts(store, run)?)
}

/// Reads the objects and the actions of a run.
pub(super) fn parts(store: &impl QuadSource, run: &NamedNode) -> Result<Parts, StorageError> {
    Ok((objects(store, run)?, actions(store, run)?))
}

/// Reads an existing run, whose objects and actions are known.
pub(super) fn read_with(
    store: &impl QuadSource,
    run: &NamedNode,
    (objects, actions): Parts,
) -> Result<RunDetail, StorageError> {
    let node = Node::read(store, run)?;
    Ok(RunDetail {
        row: row(run, &node),
        seed: node.count("act:seed").unwrap_or_default(),
        reason: node.text("act:reason"),
        program_output: node.text("act:programOutput"),
        discards: discards(store, run, &node)?,
        wall_secs: node.number("act:wallSeconds").unwrap_or_default(),
        elapsed_secs: node.number("act:elapsedSeconds").unwrap_or_default(),
        world: node.text("act:worldName").unwrap_or_default(),
        program_version: version(&node),
        robot_base: ["w:baseX", "w:baseY", "w:baseYaw"]
            .map(|property| node.number(property).unwrap_or_default()),
        noise: noise(&node),
        designators: designators(&node),
        objects,
        actions,
    })
}

fn row(run: &NamedNode, node: &Node) -> RunRow {
    RunRow {
        run: id_of(&run.clone().into()),
        campaign: node
            .all("act:campaign")
            .first()
            .map(id_of)
            .unwrap_or_default(),
        index: node.count("act:index").unwrap_or_default(),
        repetition: node
            .count("act:sceneNumber")
            .zip(node.count("act:repetition"))
            .map(|(scene, number)| Repetition { scene, number }),
        weight: node.number("act:weight"),
        test: node.text("act:test").unwrap_or_default(),
        status: status(node.text("act:status").as_deref()),
        score: node.number("act:score").unwrap_or_default(),
        trace_hash: node.text("act:traceHash").unwrap_or_default(),
        started: node.text("prov:startedAtTime").unwrap_or_default(),
    }
}

/// Reasons of the discards before a run, in order.
pub(super) fn discards(
    store: &impl QuadSource,
    run: &NamedNode,
    node: &Node,
) -> Result<Vec<String>, StorageError> {
    if node.count("act:discards").unwrap_or_default() == 0 {
        return Ok(Vec::new());
    }
    let mut found: Vec<(u64, String)> = of_run(store, run, "act:Discard")?
        .iter()
        .map(|(_, node)| {
            (
                node.count("act:attempt").unwrap_or_default(),
                node.text("act:reason").unwrap_or_default(),
            )
        })
        .collect();
    found.sort();
    Ok(found.into_iter().map(|(_, reason)| reason).collect())
}

/// Parses a status. Any other word is `Broken`, so that it never counts as a success.
pub(super) fn status(word: Option<&str>) -> RunStatus {
    word.and_then(RunStatus::from_word)
        .unwrap_or(RunStatus::Broken)
}

/// Parses an outcome. Any other word is `Broken`, so that it never counts as a success.
pub(super) fn outcome(word: Option<&str>) -> Outcome {
    word.and_then(Outcome::from_word).unwrap_or(Outcome::Broken)
}

/// The version from the text `actcheck VERSION`.
pub(super) fn version(node: &Node) -> String {
    let program = node.text("act:program").unwrap_or_default();
    program.rsplit(' ').next().unwrap_or_default().to_owned()
}

fn noise(node: &Node) -> BTreeMap<String, f64> {
    NOISE_TERMS
        .into_iter()
        .filter_map(|name| Some((name.to_owned(), node.number(&names::act(name))?)))
        .collect()
}

/// Values of the designators of a run or an execution.
pub(super) fn designators(node: &Node) -> BTreeMap<String, Vec<String>> {
    let mut found = BTreeMap::new();
    for designator in node.all("act:designator").iter().map(text_of) {
        let mut values: Vec<String> = node.all(&designator).iter().map(id_of).collect();
        values.sort();
        found.insert(names::local(&designator).to_owned(), values);
    }
    found
}

fn of_run(
    store: &impl QuadSource,
    run: &NamedNode,
    class: &str,
) -> Result<Vec<(Term, Node)>, StorageError> {
    let class = iri(class);
    let mut found = Vec::new();
    for subject in subjects(store, "act:ofRun", run.as_ref())? {
        let node = Node::read(store, &subject)?;
        if node
            .all("rdf:type")
            .iter()
            .any(|kind| *kind == Term::from(class.clone()))
        {
            found.push((subject.into(), node));
        }
    }
    Ok(found)
}

/// The objects of a run's scene, sorted by role, then by id.
pub(super) fn objects(
    store: &impl QuadSource,
    run: &NamedNode,
) -> Result<Vec<ObjectDetail>, StorageError> {
    let mut objects: Vec<ObjectDetail> = of_run(store, run, "act:SceneObject")?
        .iter()
        .map(|(_, node)| object(node))
        .collect();
    objects.sort_by(|a, b| (a.role, &a.id).cmp(&(b.role, &b.id)));
    Ok(objects)
}

fn object(node: &Node) -> ObjectDetail {
    let number = |property| node.number(property).unwrap_or_default();
    ObjectDetail {
        id: node
            .all("act:object")
            .first()
            .map(id_of)
            .unwrap_or_default(),
        model: node.text("act:model").unwrap_or_default(),
        category: node.text("act:category").unwrap_or_default(),
        role: node
            .text("act:role")
            .and_then(|word| Role::from_word(&word))
            .unwrap_or(Role::Other),
        x: number("w:x"),
        y: number("w:y"),
        z: number("w:z"),
        yaw: number("w:yaw"),
        mass_kg: number("w:mass"),
        friction: number("w:friction"),
        restitution: number("w:restitution"),
        robot_distance_m: number("act:robotDistance"),
        neighbour_distance_m: node.number("act:neighbourDistance"),
        target_distance_m: node.number("act:targetDistance"),
        displacement_m: node.number("act:displacement"),
        max_tilt_rad: node.number("act:maxTilt"),
    }
}

fn actions(store: &impl QuadSource, run: &NamedNode) -> Result<Vec<ActionDetail>, StorageError> {
    let mut actions = Vec::new();
    for (execution, node) in of_run(store, run, "act:ActionExecution")? {
        actions.push(ActionDetail {
            step: node
                .count("act:step")
                .and_then(|step| u32::try_from(step).ok())
                .unwrap_or_default(),
            action: node.text("act:action").unwrap_or_default(),
            score: node.number("act:score").unwrap_or_default(),
            reported: node.boolean("act:reported"),
            message: node.text("act:message"),
            duration_secs: node.number("act:duration").unwrap_or_default(),
            end: node.text("act:end").unwrap_or_default(),
            parameters: designators(&node),
            judgements: judgements(store, &execution)?,
        });
    }
    actions.sort_by_key(|action| action.step);
    Ok(actions)
}

fn judgements(store: &impl QuadSource, execution: &Term) -> Result<Vec<Judgement>, StorageError> {
    let mut judgements = Vec::new();
    for assertion in subjects(store, "earl:subject", execution.as_ref())? {
        let assertion = Node::read(store, &assertion)?;
        judgements.push(judgement(store, &assertion, GraphNameRef::DefaultGraph)?);
    }
    judgements.sort_by(|a, b| a.property.cmp(&b.property));
    Ok(judgements)
}

/// Reads the judgement of an assertion, whose result is in the same graph.
pub(super) fn judgement(
    store: &impl QuadSource,
    assertion: &Node,
    graph: GraphNameRef<'_>,
) -> Result<Judgement, StorageError> {
    let result = match assertion.all("earl:result").first() {
        Some(Term::BlankNode(result)) => Node::read_in(store, result, graph)?,
        Some(Term::NamedNode(result)) => Node::read_in(store, result, graph)?,
        _ => Node::default(),
    };
    Ok(Judgement {
        property: assertion.text("earl:test").unwrap_or_default(),
        outcome: outcome(result.text("act:outcome").as_deref()),
        margin: result.number("act:margin"),
        witness: result.text("act:witness").unwrap_or_default(),
        rule_digest: result.text("act:ruleDigest").unwrap_or_default(),
        held_before: result.boolean("act:heldBefore"),
        vacuous: result.boolean("act:vacuous"),
    })
}
