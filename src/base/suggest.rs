//! "Did you mean": the known name nearest to a mistyped one, or the one with the same meaning.

use crate::meaning;

/// Longest name that is compared: the time for it grows with the square of its length. Unit: bytes.
const LONGEST: usize = 200;

/// Returns the candidate that was probably meant by `name`: the one that means the same in the
/// words of the field, or the most similar one if it is similar enough for a likely typing error,
/// or one with common words. Returns `None` if there is none.
pub fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let fits = |candidate: &&str| name.len() <= LONGEST && candidate.len() <= LONGEST;
    let candidates: Vec<&str> = candidates.into_iter().filter(fits).collect();
    let all = || candidates.iter().copied();
    meaning::same(name, all())
        .or_else(|| misspelt(name, all()))
        .or_else(|| meaning::similar(name, all()))
}

/// Returns the candidate most similar to `name`, or `None` if none is similar enough for a likely
/// typing error.
pub fn misspelt<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    candidates
        .into_iter()
        .filter(|candidate| name.len() <= LONGEST && candidate.len() <= LONGEST)
        .map(|candidate| (similarity(name, candidate), candidate))
        // 0.75: "freind" finds "friend", "mass" does not find "glass_1".
        .filter(|(similarity, _)| *similarity >= 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0).then_with(|| b.1.cmp(a.1)))
        .map(|(_, candidate)| candidate)
}

fn similarity(a: &str, b: &str) -> f64 {
    let (a, b) = (a.to_lowercase(), b.to_lowercase());
    strsim::jaro_winkler(&a, &b).max(strsim::normalized_damerau_levenshtein(&a, &b))
}

/// Returns a help text: the nearest known name, or a list of the known names.
pub fn did_you_mean<'a>(
    name: &str,
    candidates: impl IntoIterator<Item = &'a str> + Clone,
) -> String {
    match nearest(name, candidates.clone()) {
        Some(found) => format!("did you mean `{found}`?"),
        None => {
            let mut known: Vec<&str> = candidates.into_iter().collect();
            known.sort_unstable();
            known.dedup();
            if known.is_empty() {
                return "no names are known here".to_owned();
            }
            format!("known names: {}", known.join(", "))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_typing_error_gets_a_suggestion_and_an_unrelated_word_none() {
        let names = ["pickObject", "surfaceObjects", "world"];
        assert_eq!(nearest("pickOject", names), Some("pickObject"));
        assert_eq!(nearest("banana", names), None);
        assert_eq!(misspelt("pickOject", names), Some("pickObject"));
        assert!(did_you_mean("banana", names).contains("surfaceObjects"));
    }

    #[test]
    fn a_word_of_the_field_gets_the_name_that_means_the_same() {
        let names = ["pickObject", "surfaceObjects", "world"];
        assert_eq!(nearest("clutter", names), Some("surfaceObjects"));
        assert_eq!(nearest("environment", names), Some("world"));
        assert_eq!(misspelt("clutter", names), None);
    }
}
