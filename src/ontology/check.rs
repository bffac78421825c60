//! Consistency checks across actions, properties and designators.

use std::collections::{BTreeMap, BTreeSet};

use crate::Action;
use crate::graph::Graph;
use crate::read::Statement;
use actcheck_base::{
    Diagnostic, Diagnostics, Source, Span, did_you_mean, misspelt, names, nearest,
};

/// Individuals of `act:Action` or of its subclasses, and individuals of those (a special kind of
/// Pick is a Pick).
pub(super) fn action_iris(graph: &Graph) -> BTreeSet<String> {
    let mut actions = graph.individuals(&names::act("Action"));
    loop {
        let kinds: Vec<String> = graph
            .subjects()
            .filter(|s| !graph.classes_of(s).is_disjoint(&actions))
            .map(str::to_owned)
            .collect();
        let before = actions.len();
        actions.extend(kinds);
        if actions.len() == before {
            return actions;
        }
    }
}

/// Statements about an individual and about all its classes, in reading order.
pub(super) fn inherited<'a>(graph: &'a Graph, iri: &str, predicate: &str) -> Vec<&'a Statement> {
    let owners = owners(graph, iri);
    let mut statements: Vec<&Statement> = owners
        .iter()
        .flat_map(|owner| graph.stated(owner, predicate))
        .collect();
    // All statements are in one slice in reading order, so their addresses give that order.
    statements.sort_by_key(|statement| std::ptr::from_ref::<Statement>(statement));
    statements
}

/// An individual, its classes, and the classes of these.
fn owners(graph: &Graph, iri: &str) -> BTreeSet<String> {
    let mut owners: BTreeSet<String> = BTreeSet::from([iri.to_owned()]);
    let mut waiting = vec![iri.to_owned()];
    while let Some(next) = waiting.pop() {
        let above = graph.classes_of(&next);
        waiting.extend(
            above
                .iter()
                .filter(|class| !owners.contains(*class))
                .cloned(),
        );
        owners.extend(above);
    }
    owners
}

/// Local names of the predicates in the paper's namespace that have a meaning here.
const PREDICATES: [&str; 9] = [
    "successProperty",
    "precondition",
    "premise",
    "performedIn",
    "hasParameter",
    "needsParameter",
    "verifiedBy",
    "ruleLibrary",
    "unit",
];

/// Faults: predicates in the paper's namespace that the ontology does not declare and that are
/// nearly the name of a known one (O014), so that their statements have no effect.
pub(super) fn misspelt_predicates(graph: &Graph, found: &mut Diagnostics) {
    let mut reported = BTreeSet::new();
    let declared: BTreeSet<&str> = graph
        .subjects()
        .filter_map(|iri| iri.strip_prefix(names::ACT))
        .collect();
    for statement in graph.statements() {
        let Some(local) = statement.predicate.strip_prefix(names::ACT) else {
            continue;
        };
        if PREDICATES.contains(&local) || declared.contains(local) {
            continue;
        }
        if let Some(known) = misspelt(local, PREDICATES) {
            let (source, span) = graph.place(statement, &statement.predicate);
            // A statement with several objects is one for each.
            if !reported.insert((source.name.to_string(), span.start)) {
                continue;
            }
            let message = format!("unknown predicate `act:{local}`; the statement has no effect");
            found.push(
                Diagnostic::error("O014", message)
                    .at(source, span)
                    .help(format!("did you mean `act:{known}`?")),
            );
        }
    }
}

/// Fault: no rule verifies the property (O005).
pub(super) fn unverified(graph: &Graph, iri: &str) -> Diagnostic {
    let name = names::local(iri);
    let fault = Diagnostic::error("O005", format!("no rule verifies the property `{name}`"));
    let file = snake_case(name);
    at_first(graph, iri, fault).help(format!(
        "link its rule file: `act:verifiedBy <../rules/{file}.rls>`"
    ))
}

fn snake_case(name: &str) -> String {
    let mut out = String::new();
    for c in name.chars() {
        if c.is_uppercase() && !out.is_empty() {
            out.push('_');
        }
        out.extend(c.to_lowercase());
    }
    out
}

fn at_first(graph: &Graph, iri: &str, fault: Diagnostic) -> Diagnostic {
    match graph.about(iri).next() {
        Some(statement) => {
            let (source, span) = graph.place(statement, iri);
            fault.at(source, span)
        }
        None => fault,
    }
}

/// Checks the properties and parameters of all actions. Reports each fault once, where it is
/// stated.
pub(super) fn actions(graph: &Graph, actions: &BTreeMap<String, Action>, found: &mut Diagnostics) {
    if actions.is_empty() {
        let fault = Diagnostic::error("O012", "the ontology has no action")
            .help("declare one, such as `act:Pick a act:Action`, or import an ontology that does");
        found.push(match graph.sources().first() {
            Some(source) => fault.in_source(source),
            None => fault,
        });
    }
    let known = Known {
        properties: graph.individuals(&names::act("Property")),
        parameters: parameters(graph),
    };
    let mut reported: BTreeSet<(String, usize)> = BTreeSet::new();
    for (name, action) in actions {
        for fault in faults_of(graph, &known, name, action) {
            // Report a faulty inherited statement once, not for every action that inherits it.
            let ActionFault {
                diagnostic,
                of_action,
            } = fault;
            let place = diagnostic.span.as_ref().map_or(0, |span| span.start);
            let source = diagnostic
                .source
                .as_ref()
                .map_or(String::new(), |source| source.name.to_string());
            let action = if of_action { name } else { "" };
            if reported.insert((format!("{source} {} {action}", diagnostic.code), place)) {
                found.push(diagnostic);
            }
        }
    }
}

/// Warnings: properties of something that is neither an action nor a class of one (O015), and
/// properties that no action has (O016). Neither is ever judged.
pub(super) fn never_judged(
    graph: &Graph,
    actions: &BTreeMap<String, Action>,
    found: &mut Diagnostics,
) {
    let owners: BTreeSet<String> = actions
        .values()
        .flat_map(|action| owners(graph, &action.iri))
        .collect();
    let (mut reported, mut explained) = (BTreeSet::new(), BTreeSet::new());
    for statement in graph.statements() {
        let states = |predicate: &str| graph.means(&statement.predicate, &names::act(predicate));
        let kinds = [
            ("successProperty", "success properties"),
            ("precondition", "preconditions"),
            ("premise", "premises"),
        ];
        let stated = kinds.into_iter().find(|(predicate, _)| states(predicate));
        let Some((_, kind)) = stated else {
            continue;
        };
        let Some(subject) = statement
            .subject
            .as_iri()
            .filter(|subject| !owners.contains(*subject))
        else {
            continue;
        };
        explained.extend(statement.object.as_iri());
        if reported.insert((subject, kind)) {
            found.push(no_action(graph, actions, statement, subject, kind));
        }
    }
    let has = |action: &Action, iri: &String| {
        action.success_properties.contains(iri)
            || action.preconditions.contains(iri)
            || action.premises.contains(iri)
    };
    for iri in graph.individuals(&names::act("Property")) {
        if !explained.contains(iri.as_str()) && !actions.values().any(|action| has(action, &iri)) {
            found.push(of_no_action(graph, actions, &iri));
        }
    }
}

/// Warning: the subject of a success property or precondition is not an action (O015).
fn no_action(
    graph: &Graph,
    actions: &BTreeMap<String, Action>,
    statement: &Statement,
    subject: &str,
    kind: &str,
) -> Diagnostic {
    let (source, span) = graph.place(statement, subject);
    let local = names::local(subject);
    let is_class = graph
        .superclasses
        .get(subject)
        .is_some_and(|above| above.contains(&names::act("Action")));
    let help = match nearest(local, actions.keys().map(String::as_str)) {
        _ if is_class => format!(
            "declare an action of this class: `act:MyAction a {}`",
            names::shorten(subject)
        ),
        Some(found) => format!("did you mean `{found}`?"),
        None => format!("declare it: `{} a act:Action`", names::shorten(subject)),
    };
    let message = format!(
        "`{local}` is neither an action nor the class of one, so that its {kind} are never judged"
    );
    Diagnostic::warning("O015", message)
        .at(source, span)
        .help(help)
}

/// Warning: no action has a property (O016).
fn of_no_action(graph: &Graph, actions: &BTreeMap<String, Action>, iri: &str) -> Diagnostic {
    let needs: BTreeSet<&str> = graph
        .stated(iri, &names::act("needsParameter"))
        .filter_map(|statement| statement.object.as_iri().map(names::local))
        .collect();
    let fits = |action: &&Action| needs.iter().all(|name| action.parameters.contains(*name));
    let action = actions
        .values()
        .find(fits)
        .map_or("act:Pick".to_owned(), |action| names::shorten(&action.iri));
    let message = format!(
        "no action has the property `{}`, so that it is never judged",
        names::local(iri)
    );
    at_first(graph, iri, Diagnostic::warning("O016", message)).help(format!(
        "state it of an action, such as `{action} act:successProperty {}`",
        names::shorten(iri)
    ))
}

/// Declared properties and parameters, to check references against.
struct Known {
    properties: BTreeSet<String>,
    parameters: BTreeSet<String>,
}

/// Local names of all designators.
pub(super) fn parameters(graph: &Graph) -> BTreeSet<String> {
    graph
        .individuals(&names::act("PropertyParameter"))
        .iter()
        .map(|iri| names::local(iri).to_owned())
        .collect()
}

/// A fault of a statement about an action.
struct ActionFault {
    diagnostic: Diagnostic,
    /// Whether it concerns this action alone, and not each that inherits the statement.
    of_action: bool,
}

impl ActionFault {
    fn inherited(diagnostic: Diagnostic) -> Self {
        Self {
            diagnostic,
            of_action: false,
        }
    }
}

fn faults_of(graph: &Graph, known: &Known, name: &str, action: &Action) -> Vec<ActionFault> {
    let mut faults = Vec::new();
    for statement in inherited(graph, &action.iri, &names::act("hasParameter")) {
        let unknown =
            unknown_parameter(graph, known, statement, &format!("the action `{name}` has"));
        faults.extend(unknown.map(ActionFault::inherited));
    }
    for predicate in ["successProperty", "precondition", "premise"] {
        for statement in inherited(graph, &action.iri, &names::act(predicate)) {
            let Some(property) = statement.object.as_iri() else {
                continue;
            };
            if known.properties.contains(property) {
                let missing = missing_parameters(graph, known, name, action, property);
                faults.extend(missing.into_iter().map(|diagnostic| ActionFault {
                    diagnostic,
                    of_action: true,
                }));
            } else {
                let fault = no_property(graph, known, statement, property);
                faults.push(ActionFault::inherited(fault));
            }
        }
    }
    faults
}

/// Fault: a success property is not declared as a property (O004).
fn no_property(graph: &Graph, known: &Known, statement: &Statement, property: &str) -> Diagnostic {
    let (source, span) = graph.place(statement, property);
    let local = names::local(property);
    let help = match nearest(local, known.properties.iter().map(|iri| names::local(iri))) {
        Some(found) => format!("did you mean `{found}`?"),
        None => format!(
            "declare it: `{} a act:Property ; act:verifiedBy <…>`",
            names::shorten(property)
        ),
    };
    Diagnostic::error("O004", format!("`{local}` is not a property"))
        .at(source, span)
        .help(help)
}

/// Faults: parameters that a property needs but the action does not have (O007).
fn missing_parameters(
    graph: &Graph,
    known: &Known,
    name: &str,
    action: &Action,
    property: &str,
) -> Vec<Diagnostic> {
    let predicate = names::act("needsParameter");
    let needs = graph.stated(property, &predicate);
    let missing = needs.filter_map(|statement| {
        let iri = statement.object.as_iri()?;
        let parameter = names::local(iri);
        (!action.parameters.contains(parameter)).then_some((statement, iri, parameter))
    });
    missing
        .map(|(statement, iri, parameter)| {
            let (source, span) = graph.place(statement, iri);
            let message = format!(
                "the property `{}` needs the parameter `{parameter}`, which the action `{name}` does not have",
                names::local(property)
            );
            let help = if known.parameters.contains(parameter) {
                match nearest(parameter, action.parameters.iter().map(String::as_str)) {
                    Some(near) => format!("is the action's parameter `{near}` meant to be `{parameter}`?"),
                    None => format!("add `act:{name} act:hasParameter act:{parameter}`"),
                }
            } else {
                did_you_mean(parameter, action.parameters.iter().chain(&known.parameters).map(String::as_str))
            };
            Diagnostic::error("O007", message).at(source, span).help(help)
        })
        .collect()
}

/// Fault: a parameter is not declared (O008). Returns `None` if it is declared.
fn unknown_parameter(
    graph: &Graph,
    known: &Known,
    statement: &Statement,
    who: &str,
) -> Option<Diagnostic> {
    let iri = statement.object.as_iri()?;
    let parameter = names::local(iri);
    if known.parameters.contains(parameter) {
        return None;
    }
    let (source, span): (&Source, Span) = graph.place(statement, iri);
    let mentioned = mentioned_parameters(graph, parameter);
    let candidates = known
        .parameters
        .iter()
        .chain(&mentioned)
        .map(String::as_str);
    let help = match nearest(parameter, candidates) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!(
            "declare it: `{} a act:PropertyParameter`",
            names::shorten(iri)
        ),
    };
    let message = format!("{who} the parameter `{parameter}`, which is not declared");
    Some(
        Diagnostic::error("O008", message)
            .at(source, span)
            .help(help),
    )
}

/// Candidates for suggestions if declarations are missing: names used as parameters elsewhere, and
/// the standard designators.
fn mentioned_parameters(graph: &Graph, except: &str) -> BTreeSet<String> {
    let predicates = [names::act("hasParameter"), names::act("needsParameter")];
    graph
        .statements()
        .iter()
        .filter(|statement| {
            predicates
                .iter()
                .any(|predicate| *statement.predicate == **predicate)
        })
        .filter_map(|statement| {
            statement
                .object
                .as_iri()
                .map(|iri| names::local(iri).to_owned())
        })
        .chain(
            [
                "pickObject",
                "placeSurface",
                "objectSurface",
                "surfaceObjects",
                "objectLocation",
                "world",
            ]
            .map(String::from),
        )
        .filter(|name| name != except)
        .collect()
}
