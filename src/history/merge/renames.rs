//! Renames campaigns, and with them their runs and all nodes below them.

use std::collections::BTreeMap;

use oxigraph::model::{BlankNode, GraphName, Literal, NamedNode, NamedOrBlankNode, Quad, Term};

use crate::FAILED_AGAIN;
use crate::read::text_of;
use crate::statements::iri;
use crate::write_run::unique;
use actcheck_base::names;

/// New ids of the campaigns of one history.
#[derive(Debug, Clone, Default)]
pub(super) struct Renames {
    new_ids: BTreeMap<String, String>,
}

impl Renames {
    /// Creates renames from pairs of an old and a new id.
    pub(super) fn new(pairs: impl IntoIterator<Item = (String, String)>) -> Self {
        Self {
            new_ids: pairs.into_iter().filter(|(old, new)| old != new).collect(),
        }
    }

    /// Returns the new id of a run.
    pub(super) fn run(&self, id: &str) -> String {
        let renamed = id
            .rsplit_once('-')
            .and_then(|(old, number)| Some(format!("{}-{number}", self.new_ids.get(old)?)));
        renamed.unwrap_or_else(|| id.to_owned())
    }

    /// Renames the IRI of a campaign or run, or of a node below one. Returns other IRIs unchanged.
    fn iri(&self, text: &str) -> String {
        let of = |namespace: &str, new: &dyn Fn(&str) -> Option<String>| {
            let rest = text.strip_prefix(namespace)?;
            let (id, below) = rest.split_at(rest.find('/').unwrap_or(rest.len()));
            Some(format!("{namespace}{}{below}", new(id)?))
        };
        of(names::RUN, &|id| Some(self.run(id)))
            .or_else(|| of(names::CAMPAIGN, &|id| self.new_ids.get(id).cloned()))
            .unwrap_or_else(|| text.to_owned())
    }

    /// Renames the quads of a run or campaign, as if it had been created with its new id.
    pub(super) fn apply(&self, quads: Vec<Quad>) -> Vec<Quad> {
        if self.new_ids.is_empty() {
            return quads;
        }
        let labels = Labels::read(self, &quads);
        quads
            .into_iter()
            .map(|quad| self.quad(&quad, &labels))
            .collect()
    }

    fn quad(&self, quad: &Quad, labels: &Labels) -> Quad {
        let named = |node: &NamedNode| NamedNode::new_unchecked(self.iri(node.as_str()));
        let subject = match &quad.subject {
            NamedOrBlankNode::NamedNode(node) => NamedOrBlankNode::from(named(node)),
            NamedOrBlankNode::BlankNode(node) => labels.of(node).into(),
        };
        let object = match &quad.object {
            Term::NamedNode(node) => Term::from(named(node)),
            Term::BlankNode(node) => labels.of(node).into(),
            Term::Literal(literal) if quad.predicate == iri("rdfs:label") => {
                self.label(literal).into()
            }
            other => other.clone(),
        };
        let graph = match &quad.graph_name {
            GraphName::NamedNode(node) => GraphName::from(named(node)),
            other => other.clone(),
        };
        Quad::new(subject, quad.predicate.clone(), object, graph)
    }

    /// Renames a campaign's label, which may end in the id of a shrunk run, or of a campaign whose
    /// failed runs were run again.
    fn label(&self, literal: &Literal) -> Literal {
        if let Some(new) = literal
            .value()
            .strip_prefix(FAILED_AGAIN)
            .and_then(|old| self.new_ids.get(old))
        {
            return Literal::new_simple_literal(format!("{FAILED_AGAIN}{new}"));
        }
        match literal.value().rsplit_once(' ') {
            Some((words, run)) => Literal::new_simple_literal(format!("{words} {}", self.run(run))),
            None => literal.clone(),
        }
    }
}

/// New labels of the blank nodes of a run. Labels are digests that include the run's id, so they
/// change with it.
#[derive(Default)]
struct Labels {
    new: BTreeMap<String, BlankNode>,
}

/// The inputs of an assertion's label.
#[derive(Default)]
struct Assertion {
    execution: String,
    property: String,
    at: Option<String>,
    supersedes: Option<String>,
    result: Option<String>,
}

impl Labels {
    fn read(renames: &Renames, quads: &[Quad]) -> Self {
        let mut assertions: BTreeMap<String, Assertion> = BTreeMap::new();
        let (subject, test, result) = (iri("earl:subject"), iri("earl:test"), iri("earl:result"));
        let (at, supersedes) = (iri("act:recheckedAt"), iri("act:supersedes"));
        for quad in quads {
            let NamedOrBlankNode::BlankNode(node) = &quad.subject else {
                continue;
            };
            let assertion = assertions.entry(node.as_str().to_owned()).or_default();
            let text = text_of(&quad.object);
            match &quad.predicate {
                known if *known == subject => assertion.execution = renames.iri(&text),
                known if *known == test => assertion.property = text,
                known if *known == result => assertion.result = Some(text),
                known if *known == at => assertion.at = Some(text),
                known if *known == supersedes => assertion.supersedes = Some(text),
                _ => {}
            }
        }
        assertions.retain(|_, assertion| !assertion.execution.is_empty());
        let mut labels = Self::default();
        // An assertion's label depends on the one it supersedes, which must come first. Cycles are
        // corrupt and keep their labels.
        loop {
            let ready: Vec<String> = assertions
                .iter()
                .filter(|(_, assertion)| {
                    assertion.supersedes.as_ref().is_none_or(|before| {
                        labels.new.contains_key(before) || !assertions.contains_key(before)
                    })
                })
                .map(|(label, _)| label.clone())
                .collect();
            if ready.is_empty() {
                return labels;
            }
            for label in ready {
                if let Some(assertion) = assertions.remove(&label) {
                    labels.add(label, assertion);
                }
            }
        }
    }

    /// Computes labels in the same way as the writers of outcomes and later judgements.
    fn add(&mut self, label: String, assertion: Assertion) {
        let Assertion {
            execution,
            property,
            at,
            supersedes,
            result,
        } = assertion;
        let [own, of_result] = match &at {
            None => ["assertion", "result"].map(|part| unique(&[&execution, &property, part])),
            Some(at) => {
                let before = supersedes
                    .map(|before| self.new.get(&before).map_or(before, ToString::to_string));
                let before = before.unwrap_or_default();
                ["recheck", "recheck result"]
                    .map(|part| unique(&[&execution, &property, part, at, &before]))
            }
        };
        self.new.insert(label, own);
        if let Some(result) = result {
            self.new.insert(result, of_result);
        }
    }

    fn of(&self, node: &BlankNode) -> BlankNode {
        self.new.get(node.as_str()).unwrap_or(node).clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_campaign_with_the_id_is_renamed() {
        let renames = Renames::new([
            ("k".to_owned(), "m".to_owned()),
            ("a".to_owned(), "a".to_owned()),
        ]);
        let run = |rest: &str| format!("{}{rest}", names::RUN);
        assert_eq!(renames.iri(&run("k-1/state/0")), run("m-1/state/0"));
        assert_eq!(renames.iri(&run("k-12")), run("m-12"));
        assert_eq!(renames.iri(&run("kk-1")), run("kk-1"));
        assert_eq!(
            renames.iri(&format!("{}k/rule/1", names::CAMPAIGN)),
            format!("{}m/rule/1", names::CAMPAIGN)
        );
        assert_eq!(renames.iri(&names::act("k-1")), names::act("k-1"));
        assert_eq!(renames.run("a-1"), "a-1");
        assert_eq!(
            renames
                .label(&Literal::new_simple_literal("shrunk k-3"))
                .value(),
            "shrunk m-3"
        );
        assert_eq!(
            renames
                .label(&Literal::new_simple_literal("failed runs of k"))
                .value(),
            "failed runs of m"
        );
        assert_eq!(
            renames.label(&Literal::new_simple_literal("pick")).value(),
            "pick"
        );
    }
}
