//! Finds the class of an object from its name.

use crate::Ontology;
use actcheck_base::names;

impl Ontology {
    /// Returns the IRI of the class whose label or local name matches the longest suffix of the
    /// name's words. Digits are ignored: `coke_can_2` is a can, `CoffeeTable` a coffee table.
    /// Returns `None` if no class matches.
    pub fn class_called(&self, name: &str) -> Option<&str> {
        let words = words(name);
        (0..words.len()).find_map(|start| {
            let wanted = words[start..].concat();
            self.superclasses.keys().map(String::as_str).find(|class| {
                let label = self
                    .vocabulary
                    .terms
                    .get(*class)
                    .and_then(|term| term.label.as_deref());
                [Some(names::local(class)), label]
                    .into_iter()
                    .flatten()
                    .any(|called| letters(called) == wanted)
            })
        })
    }
}

/// Splits a name into lower-case words, at non-letters and before capitals.
fn words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut was_lower = false;
    for letter in name.chars() {
        if !letter.is_alphabetic() || (letter.is_uppercase() && was_lower) {
            words.push(String::new());
        }
        if letter.is_alphabetic() {
            words
                .last_mut()
                .expect("there is a first word")
                .extend(letter.to_lowercase());
        }
        was_lower = letter.is_lowercase();
    }
    words.retain(|word| !word.is_empty());
    words
}

fn letters(name: &str) -> String {
    name.chars()
        .filter(|letter| letter.is_alphabetic())
        .flat_map(char::to_lowercase)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_split_into_words() {
        assert_eq!(words("coke_can_2"), ["coke", "can"]);
        assert_eq!(words("MiniCoffeeTable"), ["mini", "coffee", "table"]);
        assert_eq!(words("__7"), [""; 0]);
        assert_eq!(letters("salt shaker"), "saltshaker");
    }
}
