//! The shapes of things and links, as a trace has them.

use actcheck_data::{Form, Part, Pose};
use nalgebra::Isometry3;

use crate::cast::link_name;
use crate::{Cast, Episode, Model};

/// Returns the parts of a body's shapes: those that collide, or all if none does.
pub(crate) fn parts_of(model: &Model, body: usize) -> Vec<Part> {
    let shapes = &model.bodies[body].shapes;
    let collides = shapes
        .iter()
        .any(|shape| shape.collides && shape.part.is_some());
    shapes
        .iter()
        .filter(|shape| shape.collides == collides)
        .filter_map(|shape| shape.part.clone())
        .collect()
}

/// Returns the parts of a thing. Frame: the thing's.
pub(crate) fn parts_of_thing(episode: &Episode, cast: &Cast, thing: usize) -> Vec<Part> {
    let thing = &cast.things[thing];
    let Some(first) = episode.states.first() else {
        return Vec::new();
    };
    let from_world = thing.pose(&first.poses).inverse();
    thing
        .bodies
        .iter()
        .flat_map(|body| {
            let of_body = from_world
                * first
                    .poses
                    .get(*body)
                    .map_or_else(Isometry3::identity, Pose::to_isometry);
            parts_of(&episode.model, *body)
                .into_iter()
                .map(move |part| Part {
                    pose: Pose::from_isometry(&(of_body * part.pose.to_isometry())),
                    shape: part.shape,
                })
        })
        .collect()
}

/// Returns the forms of all things and links that have shapes.
pub(crate) fn forms(episode: &Episode, cast: &Cast, things: &[Vec<Part>]) -> Vec<Form> {
    let of_things = cast.things.iter().zip(things).map(|(thing, parts)| Form {
        name: thing.id.clone(),
        parts: parts.clone(),
    });
    let of_links = cast.links.iter().map(|body| Form {
        name: link_name(&episode.model.bodies[*body].name),
        parts: parts_of(&episode.model, *body),
    });
    of_things
        .chain(of_links)
        .filter(|form| !form.parts.is_empty())
        .collect()
}
