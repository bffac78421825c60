//! Formats an explanation as text.

use std::fmt::Write as _;

use crate::explain::model::{Explanation, Failure, Miss, Premise, Proof, RuleRef, Support};

impl Explanation {
    /// Formats the explanation as indented text, one statement per line.
    pub fn to_text(&self) -> String {
        let mut out = String::new();
        let verdict = match &self.findings {
            Some(findings) if !findings.applicable => "is inapplicable",
            Some(findings) if findings.holds => "holds",
            Some(_) => "does not hold",
            None if self.holds() => "is derived",
            None => "is not derived",
        };
        line(&mut out, 0, &format!("{}: {verdict}", self.title));
        for because in self.findings.iter().flat_map(|findings| &findings.because) {
            line(&mut out, 1, because);
        }
        for proof in &self.proofs {
            write_proof(&mut out, 1, proof);
        }
        if let Some(miss) = &self.miss {
            write_miss(&mut out, 1, miss);
        }
        for term in &self.unknown {
            line(
                &mut out,
                1,
                &format!(
                    "`{}` occurs neither in the rules nor in any tuple",
                    term.text
                ),
            );
        }
        for note in &self.notes {
            line(&mut out, 1, note);
        }
        out
    }
}

impl std::fmt::Display for Explanation {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.to_text())
    }
}

fn line(out: &mut String, depth: usize, text: &str) {
    // Writing to a string can't fail.
    let _ = writeln!(out, "{:width$}{text}", "", width = depth * 2);
}

fn cited(rule: &RuleRef) -> String {
    match rule.name.as_ref().or(rule.comment.as_ref()) {
        Some(words) => format!("by {}: {words}", rule.place),
        None => format!("by {}", rule.place),
    }
}

fn write_proof(out: &mut String, depth: usize, proof: &Proof) {
    match &proof.support {
        Support::Fact => line(out, depth, &format!("{}  (fact)", proof.statement)),
        Support::Cut => line(out, depth, &format!("{}  (shown above)", proof.statement)),
        Support::Omitted => line(
            out,
            depth,
            &format!("{}  (derived; its proof is too long)", proof.statement),
        ),
        Support::Rule { rule, premises } => {
            line(out, depth, &format!("{}  {}", proof.statement, cited(rule)));
            write_premises(out, depth + 1, premises);
        }
        Support::Aggregate {
            rule,
            matches,
            premises,
        } => {
            line(
                out,
                depth,
                &format!(
                    "{}  over {matches} matches {}",
                    proof.statement,
                    cited(rule)
                ),
            );
            write_premises(out, depth + 1, premises);
        }
    }
}

fn write_premises(out: &mut String, depth: usize, premises: &[Premise]) {
    for premise in premises {
        match premise {
            Premise::Proof(proof) => write_proof(out, depth, proof),
            Premise::Absent(text) => line(out, depth, &format!("no match for {text}")),
            Premise::Computed(text) => line(out, depth, text),
        }
    }
}

fn write_miss(out: &mut String, depth: usize, miss: &Miss) {
    match &miss.rule {
        Some(rule) => line(
            out,
            depth,
            &format!("{} came closest {}", miss.goal, cited(rule)),
        ),
        None => line(
            out,
            depth,
            &format!(
                "{} is not a fact, and no rule has a matching head",
                miss.goal
            ),
        ),
    }
    for text in &miss.satisfied {
        line(out, depth + 1, &format!("ok      {text}"));
    }
    if miss.rule.is_some() {
        line(out, depth + 1, &format!("missing {}", miss.failed));
    }
    match &miss.failure {
        Failure::NoMatch { nearest, because } => {
            for fact in nearest {
                line(out, depth + 2, &format!("nearest {fact}"));
            }
            if let Some(miss) = because {
                write_miss(out, depth + 2, miss);
            }
        }
        Failure::Comparison {
            distance: Some(distance),
        } => line(out, depth + 2, &format!("missed by {distance:.6}")),
        Failure::Comparison { distance: None } => {}
        Failure::Blocked(proof) => {
            line(out, depth + 2, "blocked by");
            write_proof(out, depth + 3, proof);
        }
        Failure::NoValue => line(out, depth + 2, "no value for these arguments"),
    }
}
