//! A new configuration, ready to edit: `configs/pick.toml` without the paths of a checkout.

use crate::base::Source;
use crate::config::Table;

/// The configuration that new ones are made from.
const PICK: &str = include_str!("../../configs/pick.toml");

/// The line of `ontology` in a new configuration, active.
const ONTOLOGY_LINE: &str = "ontology = \"ontology/actions.ttl\"";
/// The line of `model_dir` in a new configuration, active.
const MODELS_LINE: &str = "model_dir = \"models\"";

/// The lines of `configs/pick.toml` that name files of a checkout.
const PATHS: &str = "\
# Actions, properties and the rule files that decide them; and models of objects and robots.
ontology = \"../ontology/actions.ttl\"
model_dir = \"../models\"
";
/// The lines of `configs/pick.toml` that name the skill.
const LAUNCHER: &str = "\
# Who performs the actions: \"reference\" is the skill that comes with actcheck.
test_launcher = \"reference\"
";

/// Choices for a new configuration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CampaignTemplate<'a> {
    /// The configuration's name, without `.toml`.
    pub name: &'a str,
    /// Uses `ontology/actions.ttl` beside the configuration instead of the shipped ontology.
    pub ontology: bool,
    /// Uses the folder `models` beside the configuration instead of the shipped models.
    pub models: bool,
    /// The program that performs the actions, as a path from the configuration; the reference skill if `None`.
    pub skill: Option<&'a str>,
}

/// The text of a new configuration. It runs as it is if the files that it names exist.
pub fn campaign_template(new: &CampaignTemplate<'_>) -> String {
    replacements(new).into_iter().fold(PICK.to_owned(), |text, (from, to)| text.replacen(from, &to, 1))
}

/// Pieces of `configs/pick.toml` and what replaces each.
fn replacements(new: &CampaignTemplate<'_>) -> Vec<(&'static str, String)> {
    let name = new.name;
    let mut pieces = vec![
        ("The first use case of the paper: a robot", "A robot".to_owned()),
        ("actcheck run configs/pick.toml", format!("actcheck run {name}.toml")),
        ("`actcheck check` finds", format!("`actcheck check {name}.toml` finds")),
        (PATHS, paths(new)),
    ];
    if let Some(skill) = new.skill {
        let launcher = format!(
            "# Who performs the actions: a program, or \"reference\", the skill that comes with actcheck.\n\
             test_launcher = \"{skill}\"\n"
        );
        pieces.push((LAUNCHER, launcher));
    }
    pieces
}

/// The lines of `ontology` and `model_dir`; each is commented out unless its files are used.
fn paths(new: &CampaignTemplate<'_>) -> String {
    let [ontology, models] =
        [(new.ontology, ONTOLOGY_LINE), (new.models, MODELS_LINE)].map(|(is_used, line)| match is_used {
            true => line.to_owned(),
            false => commented(line),
        });
    format!(
        "# Actions, properties and the rule files that decide them. Without this line: those that actcheck carries.\n\
         # `actcheck new property NAME --for ACTION` copies them into this folder and activates the line.\n\
         {ontology}\n\n\
         # Models of objects and robots, to edit or to add to. Without this line: those that actcheck carries.\n\
         # `actcheck new campaign NAME --with model` writes a copy and a configuration that uses it.\n\
         {models}\n"
    )
}

fn commented(line: &str) -> String {
    format!("# {line}")
}

/// Whether a configuration names an ontology, or can be made to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum LinksOntology {
    /// It names one.
    Already,
    /// Its text with the template's line activated.
    Now(String),
    /// It names none and does not have the template's line.
    No,
}

/// Activates the line with which [`campaign_template`] names `ontology/actions.ttl`.
pub fn link_ontology(config: &str) -> LinksOntology {
    let names_one = |text: &str| Table::parse(&Source::new("", text)).is_ok_and(|table| table.has("ontology"));
    if names_one(config) {
        return LinksOntology::Already;
    }
    let text = config.replacen(&commented(ONTOLOGY_LINE), ONTOLOGY_LINE, 1);
    // Below the header of a table the line would be a key of that table, and within a comment it would still be none.
    if names_one(&text) { LinksOntology::Now(text) } else { LinksOntology::No }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAIN: CampaignTemplate<'_> = CampaignTemplate { name: "mine", ontology: false, models: false, skill: None };

    #[test]
    fn every_replaced_piece_is_in_the_shipped_configuration_once() {
        let all = CampaignTemplate { skill: Some("skills/pick.py"), ..PLAIN };
        for (from, to) in replacements(&all) {
            assert_eq!(PICK.matches(from).count(), 1, "configs/pick.toml no longer has `{from}`");
            assert!(campaign_template(&all).contains(&to), "{to}");
        }
    }

    #[test]
    fn a_template_differs_from_the_shipped_configuration_only_in_names_and_paths() {
        let parsed = |text: &str| text.parse::<toml::Table>().expect("it is TOML");
        let mut shipped = parsed(PICK);
        shipped.remove("ontology");
        shipped.remove("model_dir");
        assert_eq!(parsed(&campaign_template(&PLAIN)), shipped);
        let all = CampaignTemplate { ontology: true, models: true, skill: Some("s.py"), ..PLAIN };
        for (key, value) in [("ontology", "ontology/actions.ttl"), ("model_dir", "models"), ("test_launcher", "s.py")] {
            shipped.insert(key.to_owned(), value.into());
        }
        assert_eq!(parsed(&campaign_template(&all)), shipped);
    }

    #[test]
    fn a_template_can_be_linked_to_an_ontology_later() {
        let plain = campaign_template(&PLAIN);
        let with_ontology = campaign_template(&CampaignTemplate { ontology: true, ..PLAIN });
        assert_eq!(link_ontology(&plain), LinksOntology::Now(with_ontology.clone()));
        assert_eq!(link_ontology(&with_ontology), LinksOntology::Already);
        assert_eq!(link_ontology("tests = [[\"Pick\"]]\n"), LinksOntology::No);
        assert_eq!(link_ontology("[robot]\n# ontology = \"ontology/actions.ttl\"\n"), LinksOntology::No);
        let crlf = "# ontology = \"ontology/actions.ttl\"\r\nseed = 1\r\n";
        assert_eq!(
            link_ontology(crlf),
            LinksOntology::Now("ontology = \"ontology/actions.ttl\"\r\nseed = 1\r\n".to_owned())
        );
    }
}
