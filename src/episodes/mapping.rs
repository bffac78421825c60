//! Which body of an episode is which thing, and which action was performed when.

use std::collections::{BTreeMap, BTreeSet};

use actcheck_base::{Diagnostic, Diagnostics, Source, Span, did_you_mean, names};
use actcheck_config::{Located, Table};
use actcheck_data::Pose;
use nalgebra::{UnitQuaternion, Vector3};

use crate::cast::upright_in;
use crate::patterns::Pattern;
use crate::{Cast, Episode, Hand, Model, Owner, Part, Quantity, Thing};

/// A mapping: which body is the object, the gripper, the fingers, the surface, the robot; and which
/// action was performed from when to when.
///
/// Names of bodies are patterns, in which `*` is any text.
#[derive(Debug, Clone, PartialEq)]
pub struct Mapping {
    /// Its text.
    pub source: Source,
    /// Patterns of the environments that it is for; empty for any.
    environments: Vec<Pattern>,
    /// Path of the ontology, as written; `None` for the shipped one.
    pub ontology: Option<Located<String>>,
    robot: RobotNames,
    objects: Vec<ObjectNames>,
    /// The actions in order; empty if the recording program marked them.
    pub actions: Vec<Action>,
}

#[derive(Debug, Clone, Default, PartialEq)]
struct RobotNames {
    bodies: Vec<Name>,
    base: Vec<Name>,
    hand: Vec<Name>,
    fingers: [Vec<Name>; 2],
    opening: Vec<Name>,
}

/// A pattern with its place in the mapping.
#[derive(Debug, Clone, PartialEq)]
struct Name {
    pattern: Pattern,
    span: Span,
}

#[derive(Debug, Clone, PartialEq)]
struct ObjectNames {
    id: String,
    bodies: Vec<Name>,
    category: String,
    up: Option<Vector3<f64>>,
}

/// An action that was performed in the episode.
#[derive(Debug, Clone, PartialEq)]
pub struct Action {
    /// Its name, such as `Pick`.
    pub name: String,
    /// Place of the name in the mapping.
    pub span: Span,
    /// Values of the designators.
    pub parameters: BTreeMap<String, Vec<String>>,
    /// Id of the object that it handles, by which `grasp`, `top` and `release` are found.
    pub handled: Option<String>,
    /// When it begins.
    pub from: Moment,
    /// When it ends.
    pub to: Moment,
    /// Whether the environment's own success is the action's report.
    pub reports_success: bool,
}

/// A moment of an episode.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Moment {
    /// The first state.
    Start,
    /// The first state in which the things of the action are at rest; the first state if there is
    /// none.
    Settled,
    /// The last state.
    End,
    /// The first state of the longest time during which both fingers touch the object.
    Grasp,
    /// The state in which the object is highest during that time.
    Top,
    /// The first state after that time.
    Release,
    /// A time since the first state. Unit: seconds.
    At(f64),
}

/// Names of moments.
const MOMENTS: [(&str, Moment); 6] = [
    ("start", Moment::Start),
    ("settled", Moment::Settled),
    ("end", Moment::End),
    ("grasp", Moment::Grasp),
    ("top", Moment::Top),
    ("release", Moment::Release),
];

/// Designators whose value is the object that an action handles, in the order of preference.
const HANDLED: [&str; 2] = ["pickObject", "placeObject"];

/// Begins a value that the recording states itself.
const STATED: &str = "about:";

/// The class of things of which the mapping gives none.
const OBJECT: &str = "Object";

/// The class of fixed things of which the mapping gives none.
const FURNITURE: &str = "Furniture";

impl Mapping {
    /// Reads a mapping from its text.
    ///
    /// # Errors
    /// All faults of the text.
    pub fn parse(source: &Source) -> Result<Self, Diagnostics> {
        let mut table = Table::parse(source)?;
        let mut faults = Diagnostics::new();
        let environments = table.string_or_strings("environments");
        let ontology = table.string("ontology");
        let robot = table
            .table("robot")
            .map(|table| RobotNames::read(table, &mut faults));
        let objects = table
            .table("objects")
            .map(|table| objects(table, &mut faults))
            .unwrap_or_default();
        let actions = table
            .tables("actions")
            .into_iter()
            .filter_map(|table| action(table, &objects, &mut faults))
            .collect();
        table.finish(&mut faults);
        if faults.has_errors() {
            return Err(faults);
        }
        Ok(Self {
            source: source.clone(),
            environments: environments
                .iter()
                .map(|environment| Pattern::new(&environment.value))
                .collect(),
            ontology,
            robot: robot.unwrap_or_default(),
            objects,
            actions,
        })
    }

    /// Whether the mapping is made for an environment, such as `robosuite/Lift`.
    pub fn is_for(&self, environment: &str) -> bool {
        self.environments
            .iter()
            .any(|pattern| pattern.fits(environment))
    }

    /// Returns the actions of an episode. Values of designators that begin with `about:` are taken
    /// from the metadata of its recorder, such as `about:goal_object`.
    ///
    /// # Errors
    /// E018 for each value that the recorder did not state.
    pub fn actions_of(&self, episode: &Episode) -> Result<Vec<Action>, Diagnostics> {
        let mut faults = Diagnostics::new();
        let mut stated = |value: &str, action: &Action| {
            let key = value.strip_prefix(STATED)?;
            let found = episode.about.get(key);
            if found.is_none() {
                let known = episode.about.keys().map(String::as_str);
                faults.push(
                    Diagnostic::error("E018", format!("the recording does not state `{key}`"))
                        .at(&self.source, action.span.clone())
                        .help(did_you_mean(key, known)),
                );
            }
            found.cloned()
        };
        let mut actions = self.actions.clone();
        for (action, written) in actions.iter_mut().zip(&self.actions) {
            for value in action.parameters.values_mut().flatten() {
                if let Some(found) = stated(value, written) {
                    *value = found;
                }
            }
            if let Some(handled) = &mut action.handled
                && let Some(key) = handled.strip_prefix(STATED)
                && let Some(found) = episode.about.get(key)
            {
                handled.clone_from(found);
            }
        }
        faults.or(actions)
    }

    /// Returns the things, the robot and the owners of an episode's bodies.
    ///
    /// Bodies that the mapping does not name become things of their own: those that move by their
    /// own name, the others with everything that they carry.
    ///
    /// # Errors
    /// E010 for each name that no body, site or joint has, and E022 for each body that belongs to two
    /// things.
    pub fn cast(&self, episode: &Episode) -> Result<Cast, Diagnostics> {
        let mut casting = Casting {
            mapping: self,
            model: &episode.model,
            faults: Diagnostics::new(),
        };
        let cast = casting.cast(episode);
        if casting.faults.has_errors() {
            return Err(casting.faults);
        }
        Ok(cast)
    }
}

impl RobotNames {
    fn read(mut table: Table, faults: &mut Diagnostics) -> Self {
        let mut names = |key: &str| {
            table
                .string_or_strings(key)
                .into_iter()
                .map(Name::of)
                .collect()
        };
        let robot = Self {
            bodies: names("bodies"),
            base: names("base"),
            hand: names("hand"),
            fingers: [names("left_finger"), names("right_finger")],
            opening: names("opening"),
        };
        table.finish(faults);
        robot
    }
}

impl Name {
    fn of(located: Located<String>) -> Self {
        Self {
            pattern: Pattern::new(&located.value),
            span: located.span,
        }
    }
}

fn objects(mut tables: Table, faults: &mut Diagnostics) -> Vec<ObjectNames> {
    let mut objects = Vec::new();
    for id in tables.untaken_keys() {
        let span = tables.key_span(&id).unwrap_or_default();
        let Some(mut table) = tables.table(&id) else {
            continue;
        };
        if !names::is_id(&id) {
            table.fault(
                "E011",
                span,
                format!("`{id}` can't be the id of an object"),
                "use letters, digits, `-` and `_`",
            );
        }
        table.require(&["body"]);
        let bodies = table.string_or_strings("body");
        let category = table.string("category");
        let up = table.string("up").and_then(|up| {
            let axis = axis(&up.value);
            if axis.is_none() {
                table.fault(
                    "E012",
                    up.span,
                    format!("`{}` is not an axis", up.value),
                    "write one of `x`, `y`, `z`, `-x`, `-y`, `-z`",
                );
            }
            axis
        });
        objects.push(ObjectNames {
            bodies: bodies.into_iter().map(Name::of).collect(),
            category: category.map_or_else(String::new, |category| category.value),
            id,
            up,
        });
        table.finish(faults);
    }
    tables.finish(faults);
    objects
}

fn axis(text: &str) -> Option<Vector3<f64>> {
    let (sign, name) = match text.strip_prefix('-') {
        Some(name) => (-1.0, name),
        None => (1.0, text),
    };
    let axis = match name {
        "x" => Vector3::x(),
        "y" => Vector3::y(),
        "z" => Vector3::z(),
        _ => return None,
    };
    Some(axis * sign)
}

fn action(mut table: Table, objects: &[ObjectNames], faults: &mut Diagnostics) -> Option<Action> {
    table.require(&["action"]);
    let name = table.string("action");
    let from = moment(&mut table, "from").unwrap_or(Moment::Start);
    let to = moment(&mut table, "to").unwrap_or(Moment::End);
    let reports_success = table.string("reported").is_some_and(|reported| {
        let is_known = reported.value == "success";
        if !is_known {
            table.fault(
                "E013",
                reported.span,
                format!("`{}` is not a kind of report", reported.value),
                "write `reported = \"success\"`: the environment's own success is the action's report",
            );
        }
        is_known
    });
    let handles = table.string("handles");
    let mut parameters = BTreeMap::new();
    for designator in table.untaken_keys() {
        let values = table.string_or_strings(&designator);
        let values: Vec<String> = values.into_iter().map(|value| value.value).collect();
        if !values.is_empty() {
            parameters.insert(designator, values);
        }
    }
    let handled = match handles {
        Some(handles) => {
            if !objects.iter().any(|object| object.id == handles.value) {
                let known = objects.iter().map(|object| object.id.as_str());
                table.fault(
                    "E014",
                    handles.span,
                    format!("the mapping has no object `{}`", handles.value),
                    did_you_mean(&handles.value, known),
                );
            }
            Some(handles.value)
        }
        None => HANDLED
            .iter()
            .find_map(|designator| parameters.get(*designator)?.first().cloned()),
    };
    table.finish(faults);
    let name = name?;
    Some(Action {
        name: name.value,
        span: name.span,
        parameters,
        handled,
        from,
        to,
        reports_success,
    })
}

/// Takes a moment: its name, or a time in seconds.
fn moment(table: &mut Table, key: &str) -> Option<Moment> {
    if table.is_number(key) {
        return table.number(key, 0.0..).map(Moment::At);
    }
    let text = table.string(key)?;
    let found = MOMENTS.iter().find(|(name, _)| *name == text.value);
    if found.is_none() {
        let known = MOMENTS.iter().map(|(name, _)| *name);
        table.fault(
            "E015",
            text.span,
            format!("`{}` is not a moment of an episode", text.value),
            format!(
                "{}; or write a time in seconds",
                did_you_mean(&text.value, known)
            ),
        );
    }
    found.map(|(_, moment)| *moment)
}

/// Assigns the bodies of a model.
struct Casting<'a> {
    mapping: &'a Mapping,
    model: &'a Model,
    faults: Diagnostics,
}

impl Casting<'_> {
    fn cast(&mut self, episode: &Episode) -> Cast {
        let count = self.model.bodies.len();
        let mut owners: Vec<Option<Owner>> = vec![None; count];
        if let Some(world) = owners.first_mut() {
            *world = Some(Owner::Floor);
        }
        for body in self.bodies(&self.mapping.robot.bodies, "robot.bodies") {
            if body > 0 {
                owners[body] = Some(Owner::Link(body));
            }
        }
        let mut roots: Vec<(String, usize, String, Option<Vector3<f64>>)> = Vec::new();
        for object in &self.mapping.objects {
            let key = format!("objects.{}.body", object.id);
            let bodies = self.bodies(&object.bodies, &key);
            let Some(root) = bodies.first().copied() else {
                continue;
            };
            let thing = Owner::Thing(roots.len());
            let taken = bodies.iter().find(|body| owners[**body].is_some());
            if let Some(taken) = taken.copied() {
                self.taken_twice(object, taken, owners[taken], &roots);
            }
            bodies
                .into_iter()
                .filter(|body| *body > 0)
                .for_each(|body| owners[body] = Some(thing));
            roots.push((object.id.clone(), root, object.category.clone(), object.up));
        }
        self.inherit(&mut owners, &mut roots);
        self.assemble(episode, &owners, roots)
    }

    /// E022: reports that a body already belongs to the robot, to an object or to the floor.
    fn taken_twice(
        &mut self,
        object: &ObjectNames,
        body: usize,
        owner: Option<Owner>,
        roots: &[(String, usize, String, Option<Vector3<f64>>)],
    ) {
        let of = match owner {
            Some(Owner::Thing(idx)) => format!("the object `{}`", roots[idx].0),
            Some(Owner::Link(_)) => "the robot".to_owned(),
            _ => "the floor".to_owned(),
        };
        let name = &self.model.bodies[body].name;
        let message = format!(
            "the body `{name}` can't belong to the object `{}`: it belongs to {of}",
            object.id
        );
        let fault = Diagnostic::error("E022", message)
            .help("write patterns that do not have a body in common; the first body of an episode is the floor");
        self.faults.push(match object.bodies.first() {
            Some(name) => fault.at(&self.mapping.source, name.span.clone()),
            None => fault,
        });
    }

    /// Gives an owner to every body that the mapping does not name. Bodies come after those that
    /// carry them.
    fn inherit(
        &self,
        owners: &mut [Option<Owner>],
        roots: &mut Vec<(String, usize, String, Option<Vector3<f64>>)>,
    ) {
        let mut ids: BTreeSet<String> = roots.iter().map(|(id, ..)| id.clone()).collect();
        for idx in 1..self.model.bodies.len() {
            if owners[idx].is_some() {
                continue;
            }
            let body = &self.model.bodies[idx];
            let parent = body
                .parent
                .and_then(|parent| owners.get(parent).copied().flatten());
            let has_joint = self.model.joints.iter().any(|joint| joint.body == idx);
            let is_carried = matches!(parent, Some(Owner::Thing(_) | Owner::Link(_)));
            let is_link = matches!(parent, Some(Owner::Link(_)));
            owners[idx] = match parent {
                // A rigid part of a thing, and everything that is mounted on the robot.
                Some(_) if is_carried && (!has_joint || is_link) => match parent {
                    Some(Owner::Link(_)) => Some(Owner::Link(idx)),
                    other => other,
                },
                _ => {
                    let mut id = id_of(&body.name, idx);
                    while !ids.insert(id.clone()) {
                        id.push('_');
                    }
                    roots.push((id, idx, String::new(), None));
                    Some(Owner::Thing(roots.len() - 1))
                }
            };
        }
    }

    fn assemble(
        &mut self,
        episode: &Episode,
        owners: &[Option<Owner>],
        roots: Vec<(String, usize, String, Option<Vector3<f64>>)>,
    ) -> Cast {
        let model = self.model;
        let has_shapes = |bodies: &[usize]| {
            bodies
                .iter()
                .flat_map(|body| &model.bodies[*body].shapes)
                .any(|shape| shape.collides)
        };
        let named = self.mapping.objects.len();
        let first = episode.states.first();
        // Things that nothing can touch and that the mapping does not name, such as cameras and
        // drawn targets, are left out.
        let mut kept: BTreeMap<usize, usize> = BTreeMap::new();
        let mut things = Vec::new();
        for (idx, (id, root, category, up)) in roots.into_iter().enumerate() {
            let bodies: Vec<usize> = (0..owners.len())
                .filter(|body| owners[*body] == Some(Owner::Thing(idx)))
                .collect();
            let is_seen = has_shapes(&bodies) || episode.lacks.has(Quantity::Shapes);
            if idx >= named && !is_seen {
                continue;
            }
            let fixed = !model.bodies[root].moves;
            let pose = first
                .and_then(|state| state.poses.get(root))
                .copied()
                .unwrap_or(Pose::IDENTITY);
            let category = match (category.as_str(), fixed) {
                ("", true) => names::act(FURNITURE),
                ("", false) => names::act(OBJECT),
                (category, _) if names::is_iri(category) => category.to_owned(),
                (category, _) => names::act(category),
            };
            kept.insert(idx, things.len());
            things.push(Thing {
                id,
                category,
                root,
                bodies,
                fixed,
                upright: up.map_or_else(|| upright_in(&pose), rotation_to),
                part: None,
            });
        }
        let owners: Vec<Owner> = owners
            .iter()
            .map(|owner| match owner {
                Some(Owner::Thing(idx)) => {
                    kept.get(idx).map_or(Owner::Floor, |idx| Owner::Thing(*idx))
                }
                Some(owner) => *owner,
                None => Owner::Floor,
            })
            .collect();
        self.attach(&mut things, &owners);
        let links = owners
            .iter()
            .enumerate()
            .filter(|(_, owner)| matches!(owner, Owner::Link(_)))
            .map(|(body, _)| body)
            .collect::<Vec<usize>>();
        let base = self
            .bodies(&self.mapping.robot.base, "robot.base")
            .first()
            .copied()
            .or_else(|| links.first().copied());
        Cast {
            hand: self.hand(&owners),
            things,
            links,
            base,
            owners,
        }
    }

    /// Notes which things are parts of others, by a joint with one position.
    fn attach(&self, things: &mut [Thing], owners: &[Owner]) {
        let scalar: Vec<usize> = self
            .model
            .joints
            .iter()
            .filter(|joint| joint.is_scalar())
            .map(|joint| joint.body)
            .collect();
        for thing in things {
            let parent = self.model.bodies[thing.root].parent;
            let whole = parent.and_then(|parent| owners.get(parent));
            let joint = scalar.iter().position(|body| *body == thing.root);
            if let (Some(Owner::Thing(of)), Some(joint)) = (whole, joint) {
                thing.part = Some(Part { of: *of, joint });
            }
        }
    }

    fn hand(&mut self, owners: &[Owner]) -> Option<Hand> {
        let robot = &self.mapping.robot;
        if robot.hand.is_empty() {
            return None;
        }
        let model = self.model;
        let site = robot.hand.iter().find_map(|name| {
            model
                .sites
                .iter()
                .find(|site| name.pattern.fits(&site.name))
        });
        let (body, at) = match site {
            Some(site) => (site.body, site.pose),
            None => {
                let names = model.sites.iter().map(|site| site.name.as_str());
                let body = *self
                    .bodies_or(&robot.hand, "robot.hand", &names.collect::<Vec<_>>())
                    .first()?;
                (body, Pose::IDENTITY)
            }
        };
        let keys = ["robot.left_finger", "robot.right_finger"];
        let [left, right] = [0, 1].map(|side: usize| {
            let named = self.bodies(&robot.fingers[side], keys[side]);
            // A finger is everything that it carries.
            let mut finger: BTreeSet<usize> = named.into_iter().collect();
            for (idx, body) in model.bodies.iter().enumerate() {
                if body.parent.is_some_and(|parent| finger.contains(&parent)) {
                    finger.insert(idx);
                }
            }
            finger.retain(|body| matches!(owners.get(*body), Some(Owner::Link(_))));
            finger
        });
        let scalar: Vec<&str> = model
            .joints
            .iter()
            .filter(|joint| joint.is_scalar())
            .map(|joint| joint.name.as_str())
            .collect();
        let opening = self.found(&robot.opening, "robot.opening", "joint", &scalar);
        Some(Hand {
            body,
            at,
            fingers: [left, right],
            opening,
        })
    }

    fn bodies(&mut self, names: &[Name], key: &str) -> Vec<usize> {
        self.bodies_or(names, key, &[])
    }

    /// Returns the indices of the bodies that fit some of the patterns, ascending. `others` are
    /// further names that are mentioned if none fits.
    fn bodies_or(&mut self, names: &[Name], key: &str, others: &[&str]) -> Vec<usize> {
        let known: Vec<&str> = self
            .model
            .bodies
            .iter()
            .map(|body| body.name.as_str())
            .collect();
        let kind = if others.is_empty() {
            "body"
        } else {
            "body or site"
        };
        let mut found = self.found_among(names, &known);
        if found.is_empty() && !names.is_empty() {
            let known = known.into_iter().chain(others.iter().copied());
            self.not_found(names, key, kind, &known.collect::<Vec<_>>());
        }
        found.sort_unstable();
        found
    }

    fn found(&mut self, names: &[Name], key: &str, kind: &str, known: &[&str]) -> Vec<usize> {
        let found = self.found_among(names, known);
        if found.is_empty() && !names.is_empty() {
            self.not_found(names, key, kind, known);
        }
        found
    }

    fn found_among(&self, names: &[Name], known: &[&str]) -> Vec<usize> {
        known
            .iter()
            .enumerate()
            .filter(|(_, known)| names.iter().any(|name| name.pattern.fits(known)))
            .map(|(idx, _)| idx)
            .collect()
    }

    /// Reports that none of some patterns fits: several of them are for several versions of an
    /// environment.
    fn not_found(&mut self, names: &[Name], key: &str, kind: &str, known: &[&str]) {
        let Some(first) = names.first() else {
            return;
        };
        let written = first.pattern.text();
        let message = match names.len() {
            1 => format!("no {kind} of the episode is named `{written}` (`{key}`)"),
            _ => format!("no {kind} of the episode has one of the names of `{key}`"),
        };
        let plain = written.replace('*', "");
        self.faults.push(
            Diagnostic::error("E010", message)
                .at(&self.mapping.source, first.span.clone())
                .help(did_you_mean(&plain, known.iter().copied())),
        );
    }
}

/// Returns the id of a thing that the mapping does not name: the name of its body, with `_` in the
/// place of characters that ids can't have.
pub(crate) fn id_of(name: &str, idx: usize) -> String {
    let id: String = name
        .chars()
        .map(|c| {
            if c.is_ascii_alphanumeric() || c == '-' || c == '_' {
                c
            } else {
                '_'
            }
        })
        .collect();
    if names::is_id(&id) {
        id
    } else {
        format!("body{idx}{id}")
    }
}

/// Returns a frame whose z axis is this axis.
fn rotation_to(axis: Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::rotation_between(&Vector3::z(), &axis).unwrap_or_else(|| {
        UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
    })
}
