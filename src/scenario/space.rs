//! The abstract space of scenes that a configuration describes, checked against the ontology.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use crate::surroundings::Surroundings;
use crate::{placement, step_values};
use actcheck_base::{Diagnostics, did_you_mean, names, nearest};
use actcheck_config as config;
use actcheck_config::{Campaign, OtherCounts, Step, WorldMap};
use actcheck_data::{KnownKind, Location, ObjectModel, Physics, RobotProfile, Sensing, Surface};
use actcheck_ontology::Ontology;

/// Designators with a meaning for scene generation, whether or not an ontology declares them.
const SPECIAL: [&str; 6] = [
    "world",
    "objectLocation",
    "objectSurface",
    "placeSurface",
    "pickObject",
    "surfaceObjects",
];

/// The action that drives to a location: in tests that begin with it, the robot starts somewhere
/// else.
const DRIVING: &str = "MoveTo";

/// The validated space from which scenes are drawn.
#[derive(Debug, Clone)]
pub struct Space {
    pub(super) tests: usize,
    /// For each test and each of its actions, the values that it gives to designators.
    pub(super) steps: Vec<Vec<BTreeMap<String, String>>>,
    /// For each test, the position of its first driving action, from 0; `None` if it has none.
    pub(super) drives: Vec<Option<usize>>,
    pub(super) surfaces: Vec<Arc<ObjectModel>>,
    pub(super) targets: Vec<Arc<ObjectModel>>,
    pub(super) others: Vec<Arc<ObjectModel>>,
    pub(super) other_counts: OtherCounts,
    /// Worlds; empty if scenes are on an empty floor.
    pub(super) worlds: Vec<Surroundings>,
    /// Names of the worlds' surfaces that may carry the target.
    pub(super) surface_names: Vec<String>,
    /// Surfaces on which the target may be placed: names of the worlds' surfaces, and models.
    pub(super) place_names: Vec<String>,
    pub(super) places: Vec<Arc<ObjectModel>>,
    /// Models of obstacles for the base, and their number.
    pub(super) obstacles: Vec<Arc<ObjectModel>>,
    pub(super) obstacle_count: u32,
    /// Whether obstacles may be on locations and close paths.
    pub(super) may_block: bool,
    /// Ranges of x, y and heading for the start of the base; `None` if it starts in front of the
    /// surface.
    pub(super) start: Option<[(f64, f64); 3]>,
    /// Shares of targets and of other objects that are placed on their side.
    pub(super) lying: (f64, f64),
    /// Candidates of designators whose values are names instead of objects.
    pub(super) names: BTreeMap<String, Vec<String>>,
    pub(super) robot: Arc<RobotProfile>,
    pub(super) knows: Arc<[KnownKind]>,
    pub(super) physics: Physics,
    pub(super) sensing: Sensing,
}

impl Space {
    /// Creates the space of a configuration's scenes.
    ///
    /// # Errors
    /// All faults at once, each with its place in the configuration: a test names an action that
    /// the ontology lacks (S001) or that has no success properties (S002), a required designator
    /// has no candidates (S003), a table has no designator of its name (S004), a model's category
    /// is not a class of the ontology (S005), a model has no surface (S006), an object does not fit
    /// on a surface (S007), objects have no surface (S008), or a world lacks all named surfaces or
    /// locations (S009), or an action of a test can't have a designator (S011) or its value (S012).
    pub fn new(
        campaign: &Campaign,
        ontology: &Ontology,
        robot: &Arc<RobotProfile>,
    ) -> Result<Self, Diagnostics> {
        let worlds = checked(campaign, ontology)?;
        let names = campaign
            .candidates
            .iter()
            .filter(|(name, _)| !is_of_objects(name));
        Ok(Self {
            tests: campaign.tests.len(),
            steps: campaign
                .tests
                .iter()
                .map(|test| test.iter().map(|step| step.values.clone()).collect())
                .collect(),
            drives: drives(campaign),
            surfaces: models(campaign, "objectSurface"),
            targets: models(campaign, "pickObject"),
            others: others(campaign),
            other_counts: campaign.other_counts,
            worlds,
            surface_names: candidates(campaign, "objectSurface"),
            place_names: candidates(campaign, "placeSurface"),
            places: models(campaign, "placeSurface"),
            obstacles: campaign
                .nav_obstacles
                .iter()
                .filter_map(|name| campaign.models.get(name).cloned())
                .collect(),
            obstacle_count: campaign.nav_obstacle_count,
            may_block: campaign.nav_may_block,
            start: campaign.start,
            lying: campaign.lying,
            names: names
                .map(|(name, values)| (name.clone(), values.clone()))
                .collect(),
            robot: Arc::clone(robot),
            knows: known_kinds(campaign),
            physics: campaign.physics.clone(),
            sensing: campaign.sensing.clone(),
        })
    }

    /// Checks a configuration whose robot is not known.
    ///
    /// # Errors
    /// As [`Space::new`].
    pub fn check(campaign: &Campaign, ontology: &Ontology) -> Result<(), Diagnostics> {
        checked(campaign, ontology).map(drop)
    }

    /// Number of tests.
    pub fn tests(&self) -> usize {
        self.tests
    }
}

/// The worlds of a configuration without faults.
fn checked(campaign: &Campaign, ontology: &Ontology) -> Result<Vec<Surroundings>, Diagnostics> {
    let mut found = Diagnostics::new();
    check_tests(campaign, ontology, &mut found);
    check_tables(campaign, ontology, &mut found);
    let surfaces = models(campaign, "objectSurface");
    let targets = models(campaign, "pickObject");
    check_categories(campaign, ontology, &mut found);
    check_surfaces(campaign, &mut found);
    let has_platform = !surfaces.is_empty() || !campaign.worlds.is_empty();
    let has_objects = !targets.is_empty() || !others(campaign).is_empty();
    if has_objects && !has_platform {
        let key = if targets.is_empty() {
            "surfaceObjects"
        } else {
            "pickObject"
        };
        let message = "there are objects, but no surface to place them on";
        found.push(
            campaign
                .fault("S008", key, message)
                .help("add `[objectSurface]` with `object_surfaces = [\"coffee_table\"]`"),
        );
    }
    let named_worlds = campaign.candidates.get("world").into_iter().flatten();
    let worlds: Vec<Surroundings> = named_worlds
        .filter_map(|name| campaign.worlds.get(name))
        .map(|map| Surroundings::new(map, &campaign.models))
        .collect();
    check_tops(campaign, &surfaces, &worlds, &mut found);
    check_worlds(campaign, &worlds, &mut found);
    config::in_order_of_place(found).or(worlds)
}

/// Position of the first driving action of each test, if the robot can drive.
fn drives(campaign: &Campaign) -> Vec<Option<usize>> {
    let mobile = campaign.robot.core.base_joints.is_some();
    let first = |test: &Vec<Step>| {
        test.iter()
            .position(|step| mobile && step.action == DRIVING)
    };
    campaign.tests.iter().map(first).collect()
}

/// All models except platforms, sorted by name.
fn known_kinds(campaign: &Campaign) -> Arc<[KnownKind]> {
    let models = campaign
        .models
        .values()
        .filter(|model| model.surface.is_none());
    models.map(|model| KnownKind::of(model)).collect()
}

fn is_of_objects(designator: &str) -> bool {
    [
        "objectSurface",
        "placeSurface",
        "pickObject",
        "surfaceObjects",
    ]
    .contains(&designator)
}

/// The models of a designator's candidates. The configuration has been checked, so no model is
/// missing.
fn models(campaign: &Campaign, designator: &str) -> Vec<Arc<ObjectModel>> {
    let names = campaign.candidates.get(designator).into_iter().flatten();
    names
        .filter_map(|name| campaign.models.get(name).cloned())
        .collect()
}

/// The models of other objects, if there are any in a scene.
fn others(campaign: &Campaign) -> Vec<Arc<ObjectModel>> {
    match campaign.other_counts.any() {
        true => models(campaign, "surfaceObjects"),
        false => Vec::new(),
    }
}

fn candidates(campaign: &Campaign, designator: &str) -> Vec<String> {
    campaign
        .candidates
        .get(designator)
        .cloned()
        .unwrap_or_default()
}

/// Checks that every world has one of the configuration's surfaces, and one of its locations in
/// front of it (S009).
fn check_worlds(campaign: &Campaign, worlds: &[Surroundings], found: &mut Diagnostics) {
    let surfaces = candidates(campaign, "objectSurface");
    for world in worlds
        .iter()
        .filter(|world| world.surfaces().next().is_some())
    {
        let idx = candidates(campaign, "world")
            .iter()
            .position(|name| *name == world.map.name)
            .unwrap_or(0);
        let key = format!("world.{idx}");
        let there: Vec<&str> = world
            .surfaces()
            .map(|surface| surface.id.as_str())
            .collect();
        for (designator, what) in [
            ("objectSurface", "objects may be on"),
            ("placeSurface", "the object may be placed on"),
        ] {
            let wanted = candidates(campaign, designator);
            if !wanted.is_empty() && !wanted.iter().any(|name| there.contains(&name.as_str())) {
                let message = format!(
                    "the world `{}` has none of the surfaces that {what}",
                    world.map.name
                );
                let help = format!("its surfaces are {}", there.join(", "));
                found.push(campaign.fault("S009", &key, message).help(help));
            }
        }
        let named: Vec<&String> = surfaces
            .iter()
            .filter(|name| there.contains(&name.as_str()))
            .collect();
        for surface in named {
            check_location(campaign, &world.map, surface, found);
        }
    }
}

/// Checks that one of the configuration's locations, if it names any, is in front of the surface or
/// of no surface.
fn check_location(campaign: &Campaign, world: &WorldMap, surface: &str, found: &mut Diagnostics) {
    let named = candidates(campaign, "objectLocation");
    let is_of = |location: &&Location| location.surface.as_deref() == Some(surface);
    let serves = |location: &&Location| location.surface.is_none() || is_of(location);
    if named.is_empty()
        || world
            .locations
            .iter()
            .filter(serves)
            .any(|location| named.contains(&location.name))
    {
        return;
    }
    let message = format!(
        "none of the locations is in front of `{surface}` in the world `{}`",
        world.name
    );
    let names: Vec<&str> = world
        .locations
        .iter()
        .filter(is_of)
        .map(|location| location.name.as_str())
        .collect();
    let help = format!("name one in `location_list`: {}", names.join(", "));
    found.push(campaign.fault("S009", "objectLocation", message).help(help));
}

/// The candidates of a designator: key in the configuration, and model.
fn placed_models<'a>(
    campaign: &'a Campaign,
    designator: &'a str,
) -> impl Iterator<Item = (String, &'a Arc<ObjectModel>)> {
    let names = campaign
        .candidates
        .get(designator)
        .into_iter()
        .flatten()
        .enumerate();
    names.filter_map(move |(idx, name)| {
        Some((format!("{designator}.{idx}"), campaign.models.get(name)?))
    })
}

/// Checks that tests name actions with success properties, and that the required designators have
/// candidates.
fn check_tests(campaign: &Campaign, ontology: &Ontology, found: &mut Diagnostics) {
    let mut reported: BTreeSet<String> = BTreeSet::new();
    for (idx, test) in campaign.tests.iter().enumerate() {
        for (number, step) in test.iter().enumerate() {
            let (name, key) = (&step.action, format!("tests.{idx}.{number}"));
            let Some(action) = ontology.actions.get(name) else {
                let help = did_you_mean(name, ontology.actions.keys().map(String::as_str));
                found.push(
                    campaign
                        .fault("S001", &key, format!("the ontology has no action `{name}`"))
                        .help(help),
                );
                continue;
            };
            step_values::check(campaign, ontology, (action, step), &key, found);
            if !reported.insert(name.clone()) {
                continue;
            }
            if action.success_properties.is_empty() {
                let message = format!(
                    "the action `{name}` has no success properties, so there is nothing to test"
                );
                let help = format!(
                    "state at least one in the ontology: `act:{name} act:successProperty …`"
                );
                found.push(campaign.fault("S002", &key, message).help(help));
            }
            let needs = action
                .success_properties
                .iter()
                .chain(&action.preconditions);
            let needs: BTreeSet<&String> = needs
                .filter_map(|iri| ontology.properties.get(iri))
                .flat_map(|property| &property.needs)
                .collect();
            let unknown = unknown_tables(campaign, ontology);
            // A table with a name that probably means the designator is reported itself (S004).
            let is_meant = |designator: &str| {
                unknown
                    .iter()
                    .any(|table| nearest(table, [designator]).is_some())
            };
            let has = |designator: &str| {
                campaign.candidates.contains_key(designator) || is_meant(designator)
            };
            for designator in needs.into_iter().filter(|name| !has(name)) {
                let message =
                    format!("`{name}` needs a value for `{designator}`, which has no candidates");
                let help = format!("add a table with candidates: {}", example(designator));
                found.push(campaign.fault("S003", &key, message).help(help));
            }
        }
    }
}

fn example(designator: &str) -> String {
    let key = match designator {
        "world" => "worlds",
        "objectLocation" => "location_list",
        "objectSurface" => "object_surfaces",
        "placeSurface" => "place_object_surfaces",
        "pickObject" | "surfaceObjects" => "model_list",
        _ => "candidates",
    };
    format!("`[{designator}]` with `{key} = [\"…\"]`")
}

/// The tables that are named after designators.
fn known_tables(ontology: &Ontology) -> BTreeSet<&str> {
    ontology
        .designators
        .iter()
        .map(String::as_str)
        .chain(SPECIAL)
        .collect()
}

/// The tables of candidates that no designator has.
fn unknown_tables<'a>(campaign: &'a Campaign, ontology: &Ontology) -> Vec<&'a String> {
    let known = known_tables(ontology);
    campaign
        .candidates
        .keys()
        .filter(|name| !known.contains(name.as_str()))
        .collect()
}

/// Checks that tables are named after designators.
fn check_tables(campaign: &Campaign, ontology: &Ontology, found: &mut Diagnostics) {
    let known = known_tables(ontology);
    let tables = [
        "physics",
        "sensing",
        "camera",
        "robot",
        "budget",
        "history",
        "categories",
        "scene",
        "nav",
    ];
    for name in unknown_tables(campaign, ontology) {
        let message =
            format!("unknown table `{name}`: the ontology has no designator of this name");
        let help = match nearest(name, known.iter().copied().chain(tables)) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!(
                "known designators: {}",
                known.iter().copied().collect::<Vec<_>>().join(", ")
            ),
        };
        found.push(campaign.fault("S004", name, message).help(help));
    }
}

/// Checks that the categories of models are classes, which rules and analysis need.
fn check_categories(campaign: &Campaign, ontology: &Ontology, found: &mut Diagnostics) {
    let mut reported: BTreeSet<&str> = BTreeSet::new();
    for designator in SPECIAL.iter().filter(|name| is_of_objects(name)) {
        for (key, model) in placed_models(campaign, designator) {
            if ontology.has_class(&model.category) || !reported.insert(&model.name) {
                continue;
            }
            let short = names::shorten(&model.category);
            let message = format!(
                "the model `{}` has the category `{short}`, which the ontology does not have",
                model.name
            );
            let classes: BTreeSet<&str> = ontology
                .superclasses
                .keys()
                .map(|class| names::local(class))
                .collect();
            let help = match nearest(names::local(&model.category), classes) {
                Some(near) => {
                    format!("did you mean `act:{near}`? the category is set in the model's file")
                }
                None => format!(
                    "state it in the ontology: `{short} a owl:Class ; rdfs:subClassOf act:Graspable`"
                ),
            };
            found.push(campaign.fault("S005", &key, message).help(help));
        }
    }
}

fn check_surfaces(campaign: &Campaign, found: &mut Diagnostics) {
    let platforms: Vec<&str> = campaign
        .models
        .values()
        .filter(|model| model.surface.is_some())
        .map(|model| model.name.as_str())
        .collect();
    for designator in ["objectSurface", "placeSurface"] {
        for (key, model) in
            placed_models(campaign, designator).filter(|(_, model)| model.surface.is_none())
        {
            let message = format!(
                "the model `{}` can't carry objects: it has no `[surface]`",
                model.name
            );
            let help = format!("models that have one: {}", platforms.join(", "));
            found.push(campaign.fault("S006", &key, message).help(help));
        }
    }
}

/// Checks that every object fits on every surface on which it may be placed.
fn check_tops(
    campaign: &Campaign,
    surfaces: &[Arc<ObjectModel>],
    worlds: &[Surroundings],
    found: &mut Diagnostics,
) {
    let first = tops(campaign, "objectSurface", surfaces, worlds);
    for key in ["pickObject", "surfaceObjects"] {
        check_fit(campaign, key, &first, found);
    }
    if campaign.other_counts.at_place.1 > 0 {
        let mut further = tops(
            campaign,
            "placeSurface",
            &models(campaign, "placeSurface"),
            worlds,
        );
        further.retain(|(name, _)| first.iter().all(|(other, _)| other != name));
        check_fit(campaign, "surfaceObjects", &further, found);
    }
}

/// The possible surfaces of a designator, by name: those of models that are added to the scene, and
/// those of the worlds.
fn tops(
    campaign: &Campaign,
    designator: &str,
    models: &[Arc<ObjectModel>],
    worlds: &[Surroundings],
) -> Vec<(String, Surface)> {
    let named = candidates(campaign, designator);
    let of_models = models
        .iter()
        .filter_map(|model| Some((model.name.clone(), model.surface?)));
    let of_worlds = worlds
        .iter()
        .flat_map(Surroundings::surfaces)
        .filter(|object| named.contains(&object.id));
    of_models
        .chain(of_worlds.filter_map(|object| Some((object.id.clone(), object.model.surface?))))
        .collect()
}

fn check_fit(
    campaign: &Campaign,
    designator: &str,
    surfaces: &[(String, Surface)],
    found: &mut Diagnostics,
) {
    for (key, model) in placed_models(campaign, designator) {
        for (platform, surface) in surfaces
            .iter()
            .filter(|(_, surface)| !placement::fits(surface, model))
        {
            let message = format!("the model `{}` does not fit on `{platform}`", model.name);
            let [x, y] = surface.size_m;
            let [length, width, _] = model.size_m;
            let help =
                format!("it is {length:.2} × {width:.2} m, and the surface is {x:.2} × {y:.2} m");
            found.push(campaign.fault("S007", &key, message).help(help));
        }
    }
}
