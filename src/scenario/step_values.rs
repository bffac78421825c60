//! The values that a test gives to the designators of single actions.

use std::collections::{BTreeMap, BTreeSet};

use crate::draw::{Discard, SceneBuilder};
use actcheck_base::{Diagnostics, did_you_mean};
use actcheck_config::{Campaign, Step};
use actcheck_data::{ChoiceName, ObjectModel, Role, SceneObject};
use actcheck_ontology::{Action, Ontology};

const OBJECT: &str = "pickObject";
const OTHERS: &str = "surfaceObjects";
const LOCATION: &str = "objectLocation";
const SURFACES: [&str; 2] = ["objectSurface", "placeSurface"];
/// Designators that are those of the whole scene.
const OF_SCENE: [&str; 2] = ["world", OTHERS];
/// The object to pick of the scene.
const TARGET: &str = "target";
/// An object beside the target that no earlier action of the test handles.
const OTHER: &str = "other";

/// Checks the values of one action of a test: S011 it can't have such a designator, S012 no scene
/// can have such a value. `key`: of the action.
pub(super) fn check(
    campaign: &Campaign,
    ontology: &Ontology,
    (action, step): (&Action, &Step),
    key: &str,
    found: &mut Diagnostics,
) {
    for (designator, value) in &step.values {
        let place = format!("{key}.{designator}");
        if OF_SCENE.contains(&designator.as_str()) && ontology.designators.contains(designator) {
            let message = format!("`{designator}` is the same for all actions of a scene");
            let help = format!("set its candidates in the table `[{designator}]`");
            found.push(campaign.fault("S011", &place, message).help(help));
            continue;
        }
        if !action.parameters.contains(designator) {
            let message = format!(
                "the action `{}` has no designator `{designator}`",
                step.action
            );
            let known = action
                .parameters
                .iter()
                .map(String::as_str)
                .filter(|name| !OF_SCENE.contains(name));
            found.push(
                campaign
                    .fault("S011", &place, message)
                    .help(did_you_mean(designator, known)),
            );
            continue;
        }
        let known = known_values(campaign, designator);
        if !known.contains(value) && !is_id_of(value, &known) {
            let message = format!("no scene has `{value}` as the value of `{designator}`");
            let help = if value == OTHER && designator == OBJECT {
                "add `[surfaceObjects]` with `model_list` and a `count` above 0".to_owned()
            } else {
                did_you_mean(value, known.iter().map(String::as_str))
            };
            found.push(campaign.fault("S012", &place, message).help(help));
        }
    }
}

/// Whether it is the id of an object of one of these models, such as `glass_2`.
fn is_id_of(value: &str, models: &BTreeSet<String>) -> bool {
    value.rsplit_once('_').is_some_and(|(model, number)| {
        models.contains(model)
            && number
                .parse()
                .is_ok_and(|number: u32| number > 0 && format!("{number}").len() <= 3)
    })
}

/// The values of a designator in any scene: roles, models, and names of places.
fn known_values(campaign: &Campaign, designator: &str) -> BTreeSet<String> {
    let of = |table: &str| campaign.candidates.get(table).cloned().unwrap_or_default();
    let mut known = BTreeSet::new();
    match designator {
        OBJECT => {
            known.extend(of(OBJECT));
            known.insert(TARGET.to_owned());
            if campaign.other_counts.beside_target.1 > 0 && !of(OTHERS).is_empty() {
                known.extend(of(OTHERS));
                known.insert(OTHER.to_owned());
            }
        }
        LOCATION => {
            known.extend(of(LOCATION));
            let locations = campaign.worlds.values().flat_map(|world| &world.locations);
            known.extend(locations.map(|location| location.name.clone()));
        }
        _ if SURFACES.contains(&designator) => {
            for table in SURFACES {
                let names = of(table);
                if !names.is_empty() {
                    known.insert(table.to_owned());
                    known.extend(names);
                }
            }
            let has_surface = |model: &str| {
                campaign
                    .models
                    .get(model)
                    .is_some_and(|model| model.surface.is_some())
            };
            let furniture = campaign.worlds.values().flat_map(|world| &world.furniture);
            known.extend(
                furniture
                    .filter(|piece| has_surface(&piece.model))
                    .map(|piece| piece.name.clone()),
            );
        }
        _ => known.extend(of(designator)),
    }
    known
}

impl SceneBuilder<'_> {
    /// Finds the values that are in force in each action of a test: those of the scene, until an
    /// action gives another one.
    pub(super) fn set_steps(
        &mut self,
        test: usize,
    ) -> Result<Vec<BTreeMap<String, Vec<String>>>, Discard> {
        let given = self.space.steps.get(test).map_or(&[][..], Vec::as_slice);
        let mut values = self.designators.clone();
        let mut handled: Vec<String> = values.get(OBJECT).into_iter().flatten().cloned().collect();
        let mut steps = Vec::with_capacity(given.len());
        for (number, given) in (1..).zip(given) {
            for (designator, value) in given {
                let found = self
                    .value_of(number, designator, value, &handled)
                    .ok_or_else(|| Discard::NoValue {
                        number,
                        designator: designator.clone(),
                        value: value.clone(),
                    })?;
                if designator == OBJECT {
                    values.insert(OTHERS.to_owned(), self.things_beside(&found));
                    handled.push(found.clone());
                }
                values.insert(designator.clone(), vec![found]);
            }
            steps.push(values.clone());
        }
        Ok(steps)
    }

    /// The id or name that a written value means in this scene; `None` if the scene has no such
    /// thing.
    fn value_of(
        &mut self,
        number: usize,
        designator: &str,
        value: &str,
        handled: &[String],
    ) -> Option<String> {
        match designator {
            OBJECT if value == TARGET => self.designators.get(OBJECT)?.first().cloned(),
            OBJECT if value == OTHER => {
                let others = self.designators.get(OTHERS).into_iter().flatten();
                let free: Vec<String> =
                    others.filter(|id| !handled.contains(id)).cloned().collect();
                let number = u32::try_from(number).ok()?;
                let name = ChoiceName::Step {
                    number,
                    designator: designator.to_owned(),
                };
                (!free.is_empty()).then(|| free[self.choices.candidate(name, free.clone())].clone())
            }
            OBJECT => self.thing(value, |object| {
                matches!(object.role, Role::Target | Role::Other)
            }),
            LOCATION => {
                let world = self.space.worlds.iter().find(|world| {
                    self.designators
                        .get("world")
                        .and_then(|names| names.first())
                        == Some(&world.map.name)
                });
                let named = world.map_or(&[][..], |world| &world.map.locations);
                let is_known =
                    named.is_empty() || named.iter().any(|location| location.name == value);
                is_known.then(|| value.to_owned())
            }
            _ if SURFACES.contains(&value) => self.designators.get(value)?.first().cloned(),
            _ if SURFACES.contains(&designator) => self.thing(value, |object| {
                object.role == Role::Platform && object.model.surface.is_some()
            }),
            _ => Some(value.to_owned()),
        }
    }

    /// The object with this id, or else the first one of this model.
    fn thing(&self, name: &str, serves: impl Fn(&SceneObject) -> bool) -> Option<String> {
        let serving = || self.objects.iter().filter(|object| serves(object));
        let is_of = |model: &ObjectModel| model.name == name;
        let of_id = serving().find(|object| object.id == name);
        of_id
            .or_else(|| serving().find(|object| is_of(&object.model)))
            .map(|object| object.id.clone())
    }

    /// The objects on the surface of the target, except one.
    fn things_beside(&self, id: &str) -> Vec<String> {
        let there = [OBJECT, OTHERS]
            .into_iter()
            .filter_map(|designator| self.designators.get(designator))
            .flatten();
        there.filter(|other| *other != id).cloned().collect()
    }
}
