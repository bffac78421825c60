//! Results as RDF that other people's tools know: outcomes in EARL, where they came from in PROV.

use std::collections::{BTreeMap, BTreeSet};

use crate::base::{Term, names};
use crate::history::{ActionDetail, CampaignRow, RdfSyntax, RunDetail, rdf_text};
use crate::verdict::Judgement;

/// Where versions of this program have their names.
const PROGRAM: &str = "https://w3id.org/actcheck/program/";

/// Statements about runs, gathered one run after the other.
///
/// A property is an `earl:TestCase`, an action that was performed the `earl:TestSubject`, the program the assertor; an assertion is
/// a `prov:Entity` that the run, a `prov:Activity`, has generated. EARL has one word, `cantTell`, for broken and timeout: ours is beside it.
#[derive(Debug, Clone, Default)]
pub struct EarlReport {
    triples: Vec<[Term; 3]>,
    properties: BTreeSet<String>,
    programs: BTreeSet<String>,
    campaigns: BTreeMap<String, String>,
}

impl EarlReport {
    /// A report without results.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a run.
    pub fn add(&mut self, run: &RunDetail) {
        let (node, agent) = (format!("{}{}", names::RUN, run.row.run), self.program(&run.program_version));
        self.campaigns.insert(run.row.campaign.clone(), agent.clone());
        let campaign = format!("{}{}", names::CAMPAIGN, run.row.campaign);
        self.link(&node, "rdf:type", "prov:Activity");
        self.link(&node, "rdf:type", "act:Run");
        self.link(&node, "act:campaign", &campaign);
        self.link(&node, "prov:wasAssociatedWith", &agent);
        self.say(&node, "prov:startedAtTime", time(&run.row.started));
        if let Some(ended) = ended(run) {
            self.say(&node, "prov:endedAtTime", time(&ended));
        }
        self.say(&node, "act:test", Term::string(&run.row.test));
        self.say(&node, "act:index", Term::Integer(i64::try_from(run.row.index).unwrap_or(i64::MAX)));
        self.say(&node, "act:status", Term::string(run.row.status.word()));
        self.say(&node, "act:score", Term::Double(run.row.score));
        for action in &run.actions {
            self.execution(&node, &agent, run, action);
        }
    }

    fn execution(&mut self, run: &str, agent: &str, of: &RunDetail, action: &ActionDetail) {
        let node = format!("{run}/{}", action.step);
        self.link(&node, "rdf:type", "earl:TestSubject");
        self.link(&node, "rdf:type", "act:ActionExecution");
        self.link(&node, "act:ofRun", run);
        self.link(&node, "act:action", &action.action);
        self.say(&node, "act:step", Term::Integer(action.step.into()));
        for judgement in &action.judgements {
            self.assertion(run, &node, agent, of, judgement);
        }
    }

    fn assertion(&mut self, run: &str, execution: &str, agent: &str, of: &RunDetail, judgement: &Judgement) {
        self.properties.insert(judgement.property.clone());
        let node = format!("{execution}/{}", names::local(&judgement.property));
        let result = format!("{node}/result");
        self.link(&node, "rdf:type", "earl:Assertion");
        self.link(&node, "rdf:type", "prov:Entity");
        self.link(&node, "earl:assertedBy", agent);
        self.link(&node, "earl:subject", execution);
        self.link(&node, "earl:test", &judgement.property);
        self.link(&node, "earl:mode", "earl:automatic");
        self.link(&node, "earl:result", &result);
        self.link(&node, "prov:wasGeneratedBy", run);
        self.link(&node, "prov:wasAttributedTo", agent);
        self.say(&node, "prov:generatedAtTime", time(&of.row.started));
        self.link(&result, "rdf:type", "earl:TestResult");
        self.link(&result, "earl:outcome", &format!("earl:{}", judgement.outcome.earl()));
        self.say(&result, "act:outcome", Term::string(judgement.outcome.word()));
        self.say(&result, "earl:info", Term::string(&judgement.witness));
        if let Some(margin) = judgement.margin {
            self.say(&result, "act:margin", Term::Double(margin));
        }
        if !judgement.rule_digest.is_empty() {
            self.say(&result, "act:ruleDigest", Term::string(&judgement.rule_digest));
        }
    }

    /// The whole file, in Turtle. Campaigns of which runs were added are described by their rows.
    pub fn text(mut self, campaigns: &[CampaignRow]) -> String {
        for property in std::mem::take(&mut self.properties) {
            self.link(&property, "rdf:type", "earl:TestCase");
            self.say(&property, "rdfs:label", Term::string(names::local(&property)));
        }
        for version in std::mem::take(&mut self.programs) {
            let agent = format!("{PROGRAM}{version}");
            self.link(&agent, "rdf:type", "earl:Software");
            self.link(&agent, "rdf:type", "prov:SoftwareAgent");
            self.say(&agent, "rdfs:label", Term::string(format!("actcheck {version}")));
        }
        let met = std::mem::take(&mut self.campaigns);
        for row in campaigns {
            let Some(agent) = met.get(&row.id) else { continue };
            let node = format!("{}{}", names::CAMPAIGN, row.id);
            self.link(&node, "rdf:type", "prov:Activity");
            self.link(&node, "rdf:type", "act:Campaign");
            self.link(&node, "prov:wasAssociatedWith", agent);
            self.say(&node, "rdfs:label", Term::string(&row.name));
            self.say(&node, "prov:startedAtTime", time(&row.started));
            if let Some(ended) = &row.ended {
                self.say(&node, "prov:endedAtTime", time(ended));
            }
        }
        self.triples.sort();
        rdf_text(&self.triples, RdfSyntax::Turtle)
    }

    /// The node of a version of this program.
    fn program(&mut self, version: &str) -> String {
        // A version has dots, digits and letters; anything else could not stand in an IRI.
        let version: String = version.chars().filter(|c| c.is_ascii_alphanumeric() || ".-+_".contains(*c)).collect();
        let agent = format!("{PROGRAM}{version}");
        self.programs.insert(version);
        agent
    }

    fn say(&mut self, subject: &str, property: &str, value: Term) {
        self.triples.push([Term::iri(subject), Term::iri(whole(property)), value]);
    }

    fn link(&mut self, subject: &str, property: &str, object: &str) {
        self.say(subject, property, Term::iri(whole(object)));
    }
}

/// The IRI of a prefixed name; what is no such name stays as it is.
fn whole(name: &str) -> String {
    let found = name.split_once(':').and_then(|(prefix, local)| {
        let (_, namespace) = names::PREFIXES.iter().find(|(known, _)| *known == prefix)?;
        Some(format!("{namespace}{local}"))
    });
    found.unwrap_or_else(|| name.to_owned())
}

fn time(moment: &str) -> Term {
    Term::Literal(moment.into(), format!("{}dateTime", names::XSD).into())
}

/// When a run ended on the clock.
fn ended(run: &RunDetail) -> Option<String> {
    let began: jiff::Timestamp = run.row.started.parse().ok()?;
    let took = jiff::SignedDuration::try_from_secs_f64(run.wall_secs.max(0.0)).ok()?;
    let ended = began.checked_add(took).ok()?;
    // Seconds, upwards: it did not end before it began.
    Some(jiff::Timestamp::from_second(ended.as_second().saturating_add(1)).ok()?.to_string())
}
