//! Ontologies: their parsed contents, and the absence of machine-specific paths.

use std::path::Path;

use actcheck::base::{Files, Term, names};
use actcheck::ontology::{self, Ontology, RuleLanguage};

fn load(path: &str) -> Ontology {
    ontology::load(&Files::Disk, Path::new(path)).unwrap_or_else(|found| panic!("{found}"))
}

fn locals(iris: &[String]) -> Vec<&str> {
    iris.iter().map(|iri| names::local(iri)).collect()
}

#[test]
fn the_shipped_ontology_has_the_five_properties_of_pick() {
    let ontology = load("ontology/actions.ttl");
    let pick = &ontology.actions["Pick"];
    let five = [
        "CloseObject",
        "ObjectGrasped",
        "NoGraspCollisions",
        "MovedObject",
        "ObjectInGripper",
    ];
    assert_eq!(locals(&pick.success_properties), five);
    assert!(pick.parameters.contains("pickObject") && pick.parameters.contains("surfaceObjects"));
    assert_eq!(
        ontology.actions.keys().collect::<Vec<_>>(),
        ["MoveTo", "PerceivePlane", "Pick", "Place"]
    );
    let moved = &ontology.properties["http://actions#MovedObject"];
    assert_eq!(
        (moved.name.as_str(), moved.unit.as_deref()),
        ("MovedObject", Some("m"))
    );
    assert_eq!(
        (moved.rule.path.as_str(), moved.rule.language),
        ("../rules/moved_object.rls", RuleLanguage::Datalog)
    );
    assert!(moved.rule.source.text.contains("success("));
    assert_eq!(
        ontology.properties["http://actions#ObjectGrasped"]
            .rule
            .language,
        RuleLanguage::Sparql
    );
    assert!(!ontology.libraries.is_empty());
}

#[test]
fn every_shipped_term_has_a_label_and_comment() {
    let ontology = load("ontology/actions.ttl");
    for (iri, term) in &ontology.vocabulary.terms {
        // The ontologies themselves may have only a label.
        if iri.starts_with(names::ACT) || iri.starts_with(names::W) {
            assert!(term.label.is_some() && term.comment.is_some(), "{iri}");
            let comment = term.comment.as_deref().unwrap();
            assert!(
                comment.ends_with('.') || comment.ends_with(')'),
                "{iri}: {comment}"
            );
        }
    }
}

/// The embedded ontology equals the repository's, and loads without any file.
#[test]
fn the_embedded_ontology_equals_the_one_on_disk() {
    let carried = ontology::load(&Files::Shipped, Path::new("ontology/actions.ttl")).unwrap();
    let on_disk = load("ontology/actions.ttl");
    assert_eq!(carried.digest, on_disk.digest);
    assert_eq!(carried.triples, on_disk.triples);
    assert_eq!(&*carried.sources[0].name, "built-in:ontology/actions.ttl");
}

#[test]
fn the_world_vocabulary_has_units() {
    let ontology = load("ontology/actions.ttl");
    for (name, unit) in [
        ("x", "m"),
        ("yaw", "rad"),
        ("vx", "m/s"),
        ("wz", "rad/s"),
        ("mass", "kg"),
        ("maxForce", "N"),
    ] {
        let term = &ontology.vocabulary.terms[&names::w(name)];
        assert!(term.is_property, "{name}");
        assert_eq!(term.unit.as_deref(), Some(unit), "{name}");
    }
    assert!(!ontology.vocabulary.terms[&names::act("Glass")].is_property);
}

#[test]
fn categories_form_a_hierarchy() {
    let ontology = load("ontology/actions.ttl");
    let act = |name| names::act(name);
    assert!(ontology.is_a(&act("Glass"), &act("Graspable")));
    assert!(ontology.is_a(&act("Glass"), &act("Glass")));
    assert!(!ontology.is_a(&act("Container"), &act("Glass")));
    assert!(ontology.is_a(&act("MiniCoffeeTable"), &act("Furniture")));
    assert!(ontology.has_class(&act("Spoon")) && !ontology.has_class(&act("Vase")));
}

#[test]
fn rdf_xml_is_read_like_turtle() {
    let ontology = load("tests/data/pick.owl");
    assert_eq!(
        locals(&ontology.actions["Pick"].success_properties),
        ["MovedObject", "ObjectGrasped"]
    );
    assert_eq!(
        ontology.properties["http://actions#MovedObject"].rule.path,
        "../../rules/moved_object.rls"
    );
}

/// The published listing of Pick names a parameter `pickOject`. It can be read, and the fault is
/// reported.
#[test]
fn a_misspelt_parameter_is_reported_with_a_suggestion() {
    let found =
        ontology::load(&Files::Disk, Path::new("tests/data/pick_misspelt.owl")).unwrap_err();
    let first = found.iter().next().unwrap();
    assert_eq!(
        (first.code, first.place().as_deref()),
        ("O008", Some("tests/data/pick_misspelt.owl:21:48"))
    );
    assert_eq!(
        first.message,
        "the action `Pick` has the parameter `pickOject`, which is not declared"
    );
    assert_eq!(first.help.as_deref(), Some("did you mean `pickObject`?"));
    // The property's own requirement is the only other fault.
    assert_eq!(
        found.iter().map(|fault| fault.code).collect::<Vec<_>>(),
        ["O008", "O007"]
    );
}

#[test]
fn an_action_inherits_statements_of_its_classes() {
    let ontology = load("tests/data/kinds_of_pick.ttl");
    let of = |name: &str| locals(&ontology.actions[name].success_properties);
    assert_eq!(of("Wave"), ["Reported"]);
    assert_eq!(of("Pick"), ["Reported", "Moved", "Held"]);
    assert_eq!(of("CarefulPick"), ["Reported", "Moved", "Held"]);
    assert!(
        ontology.actions["CarefulPick"]
            .parameters
            .contains("pickObject")
    );
    assert_eq!(ontology.actions["CarefulPick"].label, "Pick with care");
    // Classes themselves are not actions.
    assert_eq!(ontology.actions.len(), 3);
    assert_eq!(ontology.sources.len(), 2);
    assert_eq!(
        ontology.vocabulary.terms[&names::w("wobble")]
            .unit
            .as_deref(),
        Some("rad")
    );
}

/// The same text gives the same statements, in any folder and at every reading.
#[test]
fn statements_are_reproducible_and_free_of_machine_paths() {
    let folder = tempfile::tempdir().unwrap();
    let copy = |from: &str, to: &str| {
        let to = folder.path().join(to);
        std::fs::create_dir_all(to.parent().unwrap()).unwrap();
        std::fs::copy(from, to).unwrap();
    };
    for name in ["kinds_of_pick.ttl", "kinds_of_pick_words.ttl"] {
        copy(&format!("tests/data/{name}"), &format!("a b/deep/{name}"));
    }
    for name in [
        "object_grasped.rq",
        "moved_object.rls",
        "object_in_gripper.rls",
    ] {
        copy(&format!("rules/{name}"), &format!("rules/{name}"));
    }
    let here = load("tests/data/kinds_of_pick.ttl");
    let there = ontology::load(
        &Files::Disk,
        &folder.path().join("a b/deep/kinds_of_pick.ttl"),
    )
    .unwrap();
    assert_eq!(here.triples, there.triples);
    assert_eq!(here.digest, there.digest);
    let paths = |ontology: &Ontology| {
        ontology
            .properties
            .values()
            .map(|p| p.rule.path.clone())
            .collect::<Vec<_>>()
    };
    assert_eq!(paths(&here), paths(&there));
    let shown = |term: &Term| term.to_string().contains(folder.path().to_str().unwrap());
    assert!(!there.triples.iter().flatten().any(shown));
}

/// Rule files may have any name, and a reference may escape characters.
#[test]
fn file_names_with_spaces_and_special_characters_are_found() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("my rules")).unwrap();
    std::fs::write(folder.path().join("my rules/50% höher.rls"), "success(1) .").unwrap();
    let text = "@prefix act: <http://actions#> .\nact:Pick a act:Action ; act:successProperty act:Up .\n\
                act:Up a act:Property ; act:verifiedBy <my%20rules/50%25%20h%C3%B6her.rls> .\n";
    let path = folder.path().join("my ontology.ttl");
    std::fs::write(&path, text).unwrap();
    let ontology = ontology::load(&Files::Disk, &path).unwrap();
    assert_eq!(
        ontology.properties["http://actions#Up"].rule.path,
        "my rules/50% höher.rls"
    );
}

/// A user's ontology adds a property to the shipped ones, in a folder outside this repository.
#[test]
fn the_embedded_ontology_can_be_imported_from_any_folder() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("quick.rls"), "success(1) .").unwrap();
    let text = "@prefix act: <http://actions#> .\n@prefix owl: <http://www.w3.org/2002/07/owl#> .\n\
                <> a owl:Ontology ; owl:imports <https://w3id.org/actcheck/ontology> .\n\
                act:Quick a act:Property ; act:verifiedBy <quick.rls> .\nact:Pick act:successProperty act:Quick .\n";
    std::fs::write(folder.path().join("mine.ttl"), text).unwrap();
    let mine = ontology::load(&Files::Disk, &folder.path().join("mine.ttl"))
        .unwrap_or_else(|found| panic!("{found}"));
    assert_eq!(mine.actions["Pick"].success_properties.len(), 6);
    let source = |name: &str| {
        mine.properties[&names::act(name)]
            .rule
            .source
            .name
            .to_string()
    };
    assert_eq!(source("MovedObject"), "built-in:rules/moved_object.rls");
    assert!(source("Quick").ends_with("quick.rls") && !source("Quick").starts_with("built-in:"));
    assert!(
        mine.libraries
            .iter()
            .all(|library| library.source.name.starts_with("built-in:rules/lib/"))
    );
}
