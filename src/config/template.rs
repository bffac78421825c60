//! The template of new configurations: `configs/pick.toml` without the paths of a checkout.

use crate::Table;
use actcheck_base::Source;

/// The configuration that new ones are derived from.
const PICK: &str = include_str!("shipped/pick.toml");

/// The uncommented `ontology` line of a new configuration.
const ONTOLOGY_LINE: &str = "ontology = \"ontology/actions.ttl\"";
/// The uncommented `model_dir` line of a new configuration.
const MODELS_LINE: &str = "model_dir = \"models\"";

/// The lines of `configs/pick.toml` that name files of a checkout.
const PATHS: &str = "\
# Actions, properties and the rule files that decide them; and models of objects and robots.
ontology = \"../ontology/actions.ttl\"
model_dir = \"../models\"
";
/// The lines of `configs/pick.toml` that name the skill.
const LAUNCHER: &str = "\
# The program that performs the actions: \"reference\" is the skill that comes with actcheck.
test_launcher = \"reference\"
";

/// Choices for a new configuration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CampaignTemplate<'a> {
    /// The configuration's name, without `.toml`.
    pub name: &'a str,
    /// Uses `ontology/actions.ttl` next to the configuration instead of the shipped ontology.
    pub ontology: bool,
    /// Uses the folder `models` next to the configuration instead of the shipped models.
    pub models: bool,
    /// The program that performs the actions, as a path from the configuration; the reference skill
    /// if `None`.
    pub skill: Option<&'a str>,
}

/// Returns the text of a new configuration. It runs unchanged if the files that it names exist.
pub fn campaign_template(new: &CampaignTemplate<'_>) -> String {
    replacements(new)
        .into_iter()
        .fold(PICK.to_owned(), |text, (from, to)| {
            text.replacen(from, &to, 1)
        })
}

/// Returns the pieces of `configs/pick.toml` to replace, each with its replacement.
fn replacements(new: &CampaignTemplate<'_>) -> Vec<(&'static str, String)> {
    let name = new.name;
    let mut pieces = vec![
        (
            "The first use case of the paper: a robot",
            "A robot".to_owned(),
        ),
        (
            "actcheck run configs/pick.toml",
            format!("actcheck run {name}.toml"),
        ),
        (
            "`actcheck check` finds",
            format!("`actcheck check {name}.toml` finds"),
        ),
        (PATHS, paths(new)),
    ];
    if let Some(skill) = new.skill {
        let launcher = format!(
            "# The program that performs the actions; \"reference\" is the skill that comes with actcheck.\n\
             test_launcher = \"{skill}\"\n"
        );
        pieces.push((LAUNCHER, launcher));
    }
    pieces
}

/// Returns the lines of `ontology` and `model_dir`, commented out unless their files are used.
fn paths(new: &CampaignTemplate<'_>) -> String {
    let [ontology, models] =
        [(new.ontology, ONTOLOGY_LINE), (new.models, MODELS_LINE)].map(|(is_used, line)| {
            match is_used {
                true => line.to_owned(),
                false => commented(line),
            }
        });
    format!(
        "# Actions, properties and the rule files that decide them. Without this line: those that come with actcheck.\n\
         # `actcheck new property NAME --for ACTION` copies them into this folder and activates the line.\n\
         {ontology}\n\n\
         # Models of objects and robots, to edit or extend. Without this line: those that come with actcheck.\n\
         # `actcheck new campaign NAME --with model` writes a copy and a configuration that uses it.\n\
         {models}\n"
    )
}

fn commented(line: &str) -> String {
    format!("# {line}")
}

/// The result of [`link_ontology`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum LinksOntology {
    /// It names one.
    Already,
    /// Its text with the template's line uncommented.
    Now(String),
    /// It names none and does not have the template's line.
    No,
}

/// Uncomments the `ontology` line of [`campaign_template`].
pub fn link_ontology(config: &str) -> LinksOntology {
    let names_one =
        |text: &str| Table::parse(&Source::new("", text)).is_ok_and(|table| table.has("ontology"));
    if names_one(config) {
        return LinksOntology::Already;
    }
    let text = config.replacen(&commented(ONTOLOGY_LINE), ONTOLOGY_LINE, 1);
    // Below a table header the line would be a key of that table; within a comment it would remain
    // a comment.
    if names_one(&text) {
        LinksOntology::Now(text)
    } else {
        LinksOntology::No
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAIN: CampaignTemplate<'_> = CampaignTemplate {
        name: "mine",
        ontology: false,
        models: false,
        skill: None,
    };

    #[test]
    fn every_replaced_text_occurs_once_in_the_shipped_configuration() {
        let all = CampaignTemplate {
            skill: Some("skills/pick.py"),
            ..PLAIN
        };
        for (from, to) in replacements(&all) {
            assert_eq!(
                PICK.matches(from).count(),
                1,
                "configs/pick.toml no longer has `{from}`"
            );
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
        let all = CampaignTemplate {
            ontology: true,
            models: true,
            skill: Some("s.py"),
            ..PLAIN
        };
        for (key, value) in [
            ("ontology", "ontology/actions.ttl"),
            ("model_dir", "models"),
            ("test_launcher", "s.py"),
        ] {
            shipped.insert(key.to_owned(), value.into());
        }
        assert_eq!(parsed(&campaign_template(&all)), shipped);
    }

    #[test]
    fn a_template_can_be_linked_to_an_ontology_later() {
        let plain = campaign_template(&PLAIN);
        let with_ontology = campaign_template(&CampaignTemplate {
            ontology: true,
            ..PLAIN
        });
        assert_eq!(
            link_ontology(&plain),
            LinksOntology::Now(with_ontology.clone())
        );
        assert_eq!(link_ontology(&with_ontology), LinksOntology::Already);
        assert_eq!(link_ontology("tests = [[\"Pick\"]]\n"), LinksOntology::No);
        assert_eq!(
            link_ontology("[robot]\n# ontology = \"ontology/actions.ttl\"\n"),
            LinksOntology::No
        );
        let crlf = "# ontology = \"ontology/actions.ttl\"\r\nseed = 1\r\n";
        assert_eq!(
            link_ontology(crlf),
            LinksOntology::Now("ontology = \"ontology/actions.ttl\"\r\nseed = 1\r\n".to_owned())
        );
    }
}
