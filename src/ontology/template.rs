//! Template of a new property: the text of its rule file and its ontology entry.

/// Rule file and ontology entry of a new property.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Template {
    /// The rule file's name, such as `stays_upright.rls`.
    pub rule_file: String,
    /// The rule file's text.
    pub rule_text: String,
    /// Turtle to append to the ontology. It uses the prefixes `act:` and `rdfs:`.
    pub ontology_entry: String,
}

/// Returns the template of a property `name` (`StaysUpright`) for an action (`Pick`).
/// `rules_folder` is the folder of the rule file relative to the ontology file, with a trailing
/// slash. `designator` names the object that the example tests.
pub fn property_template(
    name: &str,
    action: &str,
    designator: &str,
    rules_folder: &str,
) -> Template {
    let rule_file = format!("{}.rls", snake_case(name));
    let words = snake_case(name).replace('_', " ");
    let rule_text = format!(
        "% {name}: describe in one sentence the condition that must hold for {action} to count as a success.\n\
         %\n\
         % The example below requires that the object did not tilt by more than 0.5 rad (29 degrees) during the action. Change it.\n\
         % Available predicates: before(s, p, o), after(s, p, o), during(s, p, o), parameter(designator, value), ontology(s, p, o),\n\
         % and those derived by the libraries in rules/lib, such as contact(c, a, b), with both sides of each contact first once. ontology/world.ttl describes the terms of w:.\n\n\
         @prefix act: <http://actions#> .\n\
         @prefix w: <https://w3id.org/actcheck/world#> .\n\n\
         % The property passes if a success(…) fact is derived. For a \"for all\" condition, write violation(…) instead: it passes if none is derived.\n\
         success(?object, ?tilt) :- parameter(act:{designator}, ?object), during(?object, w:maxTilt, ?tilt), ?tilt < 0.5 .\n\n\
         % How far the outcome was from flipping, in the unit given in the ontology (act:unit); positive if passed.\n\
         margin(?m) :- parameter(act:{designator}, ?object), during(?object, w:maxTilt, ?tilt), ?m = 0.5 - ?tilt .\n\n\
         % The explanation that reports show.\n\
         because(?text) :- parameter(act:{designator}, ?object), during(?object, w:maxTilt, ?tilt),\n    \
         ?text = CONCAT(STRAFTER(STR(?object), \"object/\"), \" tilted by \", STR(ROUND(?tilt * 100) / 100), \" rad, may tilt by 0.5 rad\") .\n"
    );
    let ontology_entry = format!(
        "\nact:{name} a act:Property ;\n    rdfs:label \"{words}\" ;\n    rdfs:comment \"Describe the requirement here.\" ;\n    \
         act:needsParameter act:{designator} ;\n    act:unit \"rad\" ;\n    act:verifiedBy <{rules_folder}{rule_file}> .\n\
         act:{action} act:successProperty act:{name} .\n"
    );
    Template {
        rule_file,
        rule_text,
        ontology_entry,
    }
}

/// Converts `StaysUpright` to `stays_upright`.
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
    fn property_names_become_file_names() {
        assert_eq!(snake_case("StaysUpright"), "stays_upright");
        let template = property_template("StaysUpright", "Pick", "pickObject", "../rules/");
        assert_eq!(template.rule_file, "stays_upright.rls");
        assert!(
            template
                .ontology_entry
                .contains("act:verifiedBy <../rules/stays_upright.rls>")
        );
        assert!(
            template
                .rule_text
                .contains("parameter(act:pickObject, ?object)")
        );
    }
}
