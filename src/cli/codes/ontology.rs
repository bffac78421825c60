//! Codes of ontologies.

use super::{Area, Code, code};

/// Codes that begin with `O`.
pub(super) const ONTOLOGY: Area = Area {
    letter: 'O',
    title: "Ontologies",
    codes: CODES_O,
};

const CODES_O: &[Code] = &[
    code(
        "O001",
        "the ontology can't be read",
        "the path is wrong",
        "name a Turtle (.ttl) or RDF/XML (.owl, .rdf, .xml) file",
    ),
    code(
        "O002",
        "a file of the ontology has a syntax error",
        "a statement has no final dot, a tag is not closed, or a prefix is not declared",
        "correct the marked place",
    ),
    code(
        "O003",
        "an imported ontology can't be read",
        "the path in `owl:imports` is wrong",
        "correct it; it is relative to the importing file",
    ),
    code(
        "O004",
        "an action names something that is not a property",
        "the name is misspelt, or the property is not declared",
        "take the suggested name, or declare the property",
    ),
    code(
        "O005",
        "no rule verifies a property",
        "the property has no `act:verifiedBy`",
        "link its rule file, such as `act:verifiedBy <../rules/moved_object.rls>`",
    ),
    code(
        "O006",
        "several rules verify one property",
        "`act:verifiedBy` is stated more than once",
        "keep one of them; for two rules, declare two properties",
    ),
    code(
        "O007",
        "an action lacks a parameter that one of its properties needs",
        "the action does not declare it",
        "add the parameter to the action, or remove the property",
    ),
    code(
        "O008",
        "a parameter is not declared",
        "its name is misspelt",
        "take the suggested name, or declare it",
    ),
    code(
        "O009",
        "a rule file can't be read",
        "the path in `act:verifiedBy` is wrong",
        "correct it; it is relative to the ontology file",
    ),
    code(
        "O010",
        "a rule file has the wrong extension",
        "the extension determines the language",
        "name it `.rls` for Datalog or `.rq` for SPARQL; libraries must end in `.rls`",
    ),
    code(
        "O011",
        "the path of a rule file is not relative",
        "it is an absolute IRI",
        "name it relative to the ontology file, such as `<../rules/moved_object.rls>`",
    ),
    code(
        "O012",
        "the ontology has no action",
        "it declares none and imports none",
        "declare one, such as `act:Pick a act:Action`, or import an ontology that does",
    ),
    code(
        "O013",
        "an ontology exceeds a limit of its structure",
        "a damaged or malicious file: entities that grow, hundreds of attributes or namespaces, thousands of levels, millions of statements",
        "don't use the file; keep data in files that `actcheck datalog` imports",
    ),
    code(
        "O014",
        "a predicate of our namespaces does not exist",
        "its name is misspelt, so that the statement has no effect: a property that is never judged, for example",
        "take the suggested name",
    ),
    code(
        "O015",
        "something other than an action has success properties or preconditions",
        "the name of the action is misspelt, or the action is not declared, so that the properties are never judged",
        "take the suggested name, or declare the action; a class may have properties if an action is of that class",
    ),
    code(
        "O016",
        "no action has a property",
        "the property is declared and has a rule, but no `act:successProperty` or `act:precondition` names it, so that it is never judged",
        "state it of an action, such as `act:Pick act:successProperty act:MyProperty`, or remove it",
    ),
    code(
        "O017",
        "no ontology links a rule file",
        "the file lies beside linked rule files, but neither `act:verifiedBy` nor `act:ruleLibrary` names it, so that it has no effect",
        "link it with `act:verifiedBy` or `act:ruleLibrary`, or remove it",
    ),
    code(
        "O018",
        "an import of the ontology is not read",
        "`owl:imports` names an absolute path or a web address; nothing is downloaded",
        "keep a copy beside the ontology, and import it by its relative path",
    ),
];
