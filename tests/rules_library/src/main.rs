//! Judges the state of a kitchen by rules, and explains the outcome.

use actcheck_rules::{Facts, Rules};

const RULES: &str = r#"
@prefix ex: <http://example.org/> .

% Stacked objects support each other.
above(?a, ?b) :- after(?a, ex:on, ?b) .
above(?a, ?c) :- above(?a, ?b), after(?b, ex:on, ?c) .

% Every glass is above the table.
violation(?glass) :- after(?glass, rdf:type, ex:Glass), ~above(?glass, ex:table) .
"#;

const FACTS: &str = r#"
@prefix ex: <http://example.org/> .
ex:glass1 a ex:Glass ; ex:on ex:tray .
ex:glass2 a ex:Glass ; ex:on ex:floor .
ex:tray ex:on ex:table .
"#;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let rules = Rules::parse(RULES)?;
    let facts = Facts::from_turtle(FACTS)?;
    let decision = rules.judge(&facts);
    println!("{}: {}", decision.outcome, decision.witness()[0]);
    println!("{}", rules.why(&facts)?);
    println!("{}", rules.why_not(&facts, "above(ex:glass2, ex:table)")?);
    Ok(())
}
