//! Exports an explanation as JSON and as a Graphviz graph.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::explain::model::{Explanation, Failure, Miss, Premise, Proof, RuleRef, Support};

impl Explanation {
    /// Returns the explanation as JSON.
    pub fn to_json(&self) -> Value {
        json!({
            "title": self.title,
            "holds": self.findings.as_ref().map(|findings| findings.holds),
            "margin": self.findings.as_ref().and_then(|findings| findings.margin),
            "because": self.findings.as_ref().map(|findings| findings.because.clone()),
            "proofs": self.proofs.iter().map(proof).collect::<Vec<_>>(),
            "miss": self.miss.as_ref().map(miss),
            "notes": self.notes,
        })
    }

    /// Returns a graph in Graphviz's DOT language: statements are boxes, facts are grey, missing conditions are dashed.
    pub fn to_dot(&self) -> String {
        let mut drawing = Drawing::default();
        let root = drawing.node(&self.title, "shape=oval");
        for proof in &self.proofs {
            let node = drawing.proof(proof);
            drawing.edge(root, node);
        }
        if let Some(miss) = &self.miss {
            let node = drawing.miss(miss);
            drawing.edge(root, node);
        }
        format!("digraph why {{\n  rankdir=LR;\n  node [shape=box, fontname=\"sans-serif\"];\n{}}}\n", drawing.text)
    }
}

fn rule(rule: &RuleRef) -> Value {
    json!({ "name": rule.name, "comment": rule.comment, "place": rule.place, "text": rule.text })
}

fn proof(of: &Proof) -> Value {
    let (kind, cited, matches, premises) = match &of.support {
        Support::Fact => ("fact", Value::Null, Value::Null, &[][..]),
        Support::Cut => ("cut", Value::Null, Value::Null, &[][..]),
        Support::Rule { rule: cited, premises } => ("rule", rule(cited), Value::Null, premises.as_slice()),
        Support::Aggregate { rule: cited, matches, premises } => {
            ("aggregate", rule(cited), json!(matches), premises.as_slice())
        }
    };
    json!({
        "statement": of.statement,
        "support": kind,
        "rule": cited,
        "matches": matches,
        "premises": premises.iter().map(premise).collect::<Vec<_>>(),
    })
}

fn premise(of: &Premise) -> Value {
    match of {
        Premise::Proof(inner) => proof(inner),
        Premise::Absent(text) => json!({ "absent": text }),
        Premise::Computed(text) => json!({ "computed": text }),
    }
}

fn miss(of: &Miss) -> Value {
    let failure = match &of.failure {
        Failure::NoMatch { nearest, because } => {
            json!({ "kind": "no match", "nearest": nearest, "because": because.as_deref().map(miss) })
        }
        Failure::Comparison { distance } => json!({ "kind": "comparison", "distance": distance }),
        Failure::Blocked(blocker) => json!({ "kind": "blocked", "by": proof(blocker) }),
        Failure::NoValue => json!({ "kind": "no value" }),
    };
    json!({
        "goal": of.goal,
        "rule": of.rule.as_ref().map(rule),
        "satisfied": of.satisfied,
        "failed": of.failed,
        "failure": failure,
    })
}

/// Writes nodes and edges.
#[derive(Default)]
struct Drawing {
    text: String,
    nodes: usize,
}

impl Drawing {
    fn node(&mut self, label: &str, style: &str) -> usize {
        self.nodes += 1;
        let label = label.replace('\\', "\\\\").replace('"', "\\\"");
        // Writing to a string can't fail.
        let _ = writeln!(self.text, "  n{} [label=\"{label}\", {style}];", self.nodes);
        self.nodes
    }

    fn edge(&mut self, from: usize, to: usize) {
        let _ = writeln!(self.text, "  n{from} -> n{to};");
    }

    fn proof(&mut self, proof: &Proof) -> usize {
        let style = match proof.support {
            Support::Fact => "style=filled, fillcolor=gray90",
            _ => "style=solid",
        };
        let node = self.node(&proof.statement, style);
        if let Support::Rule { premises, .. } | Support::Aggregate { premises, .. } = &proof.support {
            for premise in premises {
                let child = match premise {
                    Premise::Proof(proof) => self.proof(proof),
                    Premise::Absent(text) => self.node(&format!("no match for {text}"), "style=dotted"),
                    Premise::Computed(text) => self.node(text, "shape=plaintext"),
                };
                self.edge(node, child);
            }
        }
        node
    }

    fn miss(&mut self, miss: &Miss) -> usize {
        let node = self.node(&miss.goal, "style=dashed");
        for text in &miss.satisfied {
            let child = self.node(text, "style=solid");
            self.edge(node, child);
        }
        let failed = self.node(&format!("missing: {}", miss.failed), "style=dashed, color=red");
        self.edge(node, failed);
        match &miss.failure {
            Failure::NoMatch { because: Some(inner), .. } => {
                let child = self.miss(inner);
                self.edge(failed, child);
            }
            Failure::Blocked(proof) => {
                let child = self.proof(proof);
                self.edge(failed, child);
            }
            _ => {}
        }
        node
    }
}
