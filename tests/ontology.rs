//! Ontologies: what is read from them, and what a wrong one is told.

use std::path::Path;

use actcheck::base::Files;
use actcheck::ontology;

#[test]
fn dbg() {
    match ontology::load(&Files::Disk, Path::new("ontology/actions.ttl")) {
        Ok(o) => { println!("{:#?}", o.actions); println!("{:?}", o.triples.iter().take(30).collect::<Vec<_>>()); println!("{:#?}", o.superclasses.get("http://actions#Glass"));
            println!("{:#?}", o.vocabulary.terms.get("https://w3id.org/actcheck/world#vx")); println!("{}", o.digest); },
        Err(d) => println!("{d}"),
    }
}
