//! Exports an explanation as JSON (feature `json`).

use serde_json::{Value, json};

use crate::explain::model::{Explanation, Failure, Miss, Premise, Proof, RuleRef, Support};

impl Explanation {
    /// Returns the explanation as JSON.
    pub fn to_json(&self) -> Value {
        json!({
            "title": self.title,
            "holds": self.holds(),
            "applicable": self.findings.as_ref().map(|findings| findings.applicable),
            "margin": self.findings.as_ref().and_then(|findings| findings.margin),
            "because": self.findings.as_ref().map(|findings| findings.because.clone()),
            "proofs": self.proofs.iter().map(proof).collect::<Vec<_>>(),
            "miss": self.miss.as_ref().map(miss),
            "unknown": self.unknown.iter().map(|term| &term.text).collect::<Vec<_>>(),
            "notes": self.notes,
        })
    }
}

fn rule(rule: &RuleRef) -> Value {
    json!({ "name": rule.name, "comment": rule.comment, "place": rule.place, "text": rule.text })
}

fn proof(of: &Proof) -> Value {
    let (kind, cited, matches, premises) = match &of.support {
        Support::Fact => ("fact", Value::Null, Value::Null, &[][..]),
        Support::Cut => ("cut", Value::Null, Value::Null, &[][..]),
        Support::Omitted => ("omitted", Value::Null, Value::Null, &[][..]),
        Support::Rule {
            rule: cited,
            premises,
        } => ("rule", rule(cited), Value::Null, premises.as_slice()),
        Support::Aggregate {
            rule: cited,
            matches,
            premises,
        } => (
            "aggregate",
            rule(cited),
            json!(matches),
            premises.as_slice(),
        ),
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
