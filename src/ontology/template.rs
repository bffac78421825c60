//! A new property, ready to edit: the text of its rule file and its entry in the ontology.

/// The two texts of a new property.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Template {
    /// The rule file's name, such as `stays_upright.rls`.
    pub rule_file: String,
    /// The rule file's text.
    pub rule_text: String,
    /// What to append to the ontology (Turtle). It needs the prefixes `act:` and `rdfs:`.
    pub ontology_entry: String,
}

/// Texts for a property `name` (`StaysUpright`) of an action (`Pick`), whose rule file lies at `rule_iri` seen from the
/// ontology file. `designator` is the one whose object the example speaks of.
pub fn property_template(name: &str, action: &str, designator: &str, rules_folder: &str) -> Template {
    let rule_file = format!("{}.rls", snake_case(name));
    let words = snake_case(name).replace('_', " ");
    let rule_text = format!(
        "% {name}: write here in one sentence what must hold for {action} to count as a success.\n\
         %\n\
         % The example below says: the object did not tilt by more than 0.5 rad (29 degrees) on the way. Change it.\n\
         % What can be asked: before(s, p, o), after(s, p, o), during(s, p, o), parameter(designator, value), ontology(s, p, o),\n\
         % and what the libraries in rules/lib derive. The terms of w: are described in ontology/world.ttl.\n\n\
         @prefix act: <http://actions#> .\n\
         @prefix w: <https://w3id.org/actcheck/world#> .\n\n\
         % Passed means that some success(…) was derived. For \"for all\" write violation(…) instead: passed then means that none was.\n\
         success(?object, ?tilt) :- parameter(act:{designator}, ?object), during(?object, w:maxTilt, ?tilt), ?tilt < 0.5 .\n\n\
         % How far the outcome was from flipping, in the unit that the ontology gives; positive on the side of passed.\n\
         margin(?m) :- parameter(act:{designator}, ?object), during(?object, w:maxTilt, ?tilt), ?m = 0.5 - ?tilt .\n\n\
         % What people read.\n\
         because(?text) :- parameter(act:{designator}, ?object), during(?object, w:maxTilt, ?tilt),\n    \
         ?text = CONCAT(STRAFTER(STR(?object), \"object/\"), \" tilted by \", STR(ROUND(?tilt * 100) / 100), \" rad, may tilt by 0.5 rad\") .\n"
    );
    let ontology_entry = format!(
        "\nact:{name} a act:Property ;\n    rdfs:label \"{words}\" ;\n    rdfs:comment \"Write here what must hold.\" ;\n    \
         act:needsParameter act:{designator} ;\n    act:unit \"rad\" ;\n    act:verifiedBy <{rules_folder}{rule_file}> .\n\
         act:{action} act:successProperty act:{name} .\n"
    );
    Template { rule_file, rule_text, ontology_entry }
}

/// `StaysUpright` as `stays_upright`.
fn snake_case(name: &str) -> String {
    let mut out = String::new();
    for (idx, c) in name.chars().enumerate() {
        if c.is_uppercase() && idx > 0 && !out.ends_with('_') {
            out.push('_');
        }
        out.extend(c.to_lowercase());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_files() {
        assert_eq!(snake_case("StaysUpright"), "stays_upright");
        let template = property_template("StaysUpright", "Pick", "pickObject", "../rules/");
        assert_eq!(template.rule_file, "stays_upright.rls");
        assert!(template.ontology_entry.contains("act:verifiedBy <../rules/stays_upright.rls>"));
        assert!(template.rule_text.contains("parameter(act:pickObject, ?object)"));
    }
}
