//! Exports an explanation as a Graphviz graph.

use std::fmt::Write as _;

use crate::explain::model::{Explanation, Failure, Miss, Premise, Proof, Support};

impl Explanation {
    /// Returns a graph in Graphviz's DOT language: statements are boxes, facts are grey, missing
    /// conditions are dashed.
    pub fn to_dot(&self) -> String {
        let mut drawing = Drawing::default();
        let title = match (&self.findings, self.holds()) {
            (None, false) => format!("{}: is not derived", self.title),
            _ => self.title.clone(),
        };
        let root = drawing.node(&title, "shape=oval");
        for proof in &self.proofs {
            let node = drawing.proof(proof);
            drawing.edge(root, node);
        }
        if let Some(miss) = &self.miss {
            let node = drawing.miss(miss);
            drawing.edge(root, node);
        }
        format!(
            "digraph why {{\n  rankdir=LR;\n  node [shape=box, fontname=\"sans-serif\"];\n{}}}\n",
            drawing.text
        )
    }
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
        if let Support::Rule { premises, .. } | Support::Aggregate { premises, .. } = &proof.support
        {
            for premise in premises {
                let child = match premise {
                    Premise::Proof(proof) => self.proof(proof),
                    Premise::Absent(text) => {
                        self.node(&format!("no match for {text}"), "style=dotted")
                    }
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
        let failed = self.node(
            &format!("missing: {}", miss.failed),
            "style=dashed, color=red",
        );
        self.edge(node, failed);
        match &miss.failure {
            Failure::NoMatch {
                because: Some(inner),
                ..
            } => {
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
