//! Results of testing the oracles, with the names needed to print them.

use actcheck_analysis::{Notice, OracleCell, OracleGap, OracleMatrix, OracleRow};
use actcheck_base::{Diagnostic, Diagnostics};

/// Result of testing the oracles of a configuration.
#[derive(Debug, Clone, PartialEq)]
pub struct OracleSummary {
    /// The configuration, as the user named it.
    pub config: String,
    /// Seed of the scenes.
    pub seed: u64,
    /// Number of planned runs without a fault, and with each fault.
    pub planned: u64,
    /// Name and description of each fault, in row order.
    pub faults: Vec<(String, String)>,
    /// Name of each property, in column order.
    pub names: Vec<String>,
    /// The results.
    pub matrix: OracleMatrix,
    /// Gaps that the results show.
    pub gaps: Vec<OracleGap>,
}

impl OracleSummary {
    /// 0: every fault is noticed and every property notices a fault. 1: there is a gap.
    pub fn exit_code(&self) -> u8 {
        u8::from(!self.gaps.is_empty())
    }

    /// The gaps as warnings with help.
    pub fn warnings(&self) -> Diagnostics {
        let mut found = Diagnostics::new();
        for gap in &self.gaps {
            found.push(self.warning(gap));
        }
        found
    }

    pub(crate) fn warning(&self, gap: &OracleGap) -> Diagnostic {
        match gap {
            OracleGap::FaultUnnoticed(fault) => Diagnostic::warning(
                "V001",
                format!("no property notices the fault `{fault}`: {}", self.what(fault)),
            )
            .help("add a property that fails with this fault (`actcheck new property`), or tighten one that should"),
            OracleGap::PropertyNoticesNothing(property) => {
                let name = self.name(property);
                Diagnostic::warning("V002", format!("the property `{name}` notices no fault")).help(
                    "it passes with every fault as it does without: check whether its rule is too weak or its threshold too wide",
                )
            }
            OracleGap::FaultTooRare(fault, scenes) => Diagnostic::warning(
                "V003",
                format!("the fault `{fault}` took effect in {scenes} of {} scenes: too few to judge", self.planned),
            )
            .help("run more scenes (`--runs`), or scenes in which the action succeeds more often"),
            OracleGap::PropertyTooRare(property, passed) => {
                let (name, scenes) = (self.name(property), self.matrix.scenes);
                Diagnostic::warning(
                    "V004",
                    format!("the property `{name}` passed in {passed} of {scenes} scenes without a fault: too few to judge which faults it notices"),
                )
                .help("run more scenes (`--runs`), or scenes in which it passes more often")
            }
            OracleGap::NothingPasses(fault, scenes) => Diagnostic::warning(
                "V005",
                format!("an action passes with the fault `{fault}` in {scenes} scenes: {}", self.what(fault)),
            )
            .help("add a property that checks the action's effect on the world"),
        }
    }

    fn what(&self, fault: &str) -> &str {
        self.faults
            .iter()
            .find(|(name, _)| name == fault)
            .map_or("", |(_, what)| what)
    }

    fn name<'a>(&'a self, property: &'a str) -> &'a str {
        let place = self
            .matrix
            .properties
            .iter()
            .position(|(iri, ..)| iri == property);
        place
            .and_then(|idx| self.names.get(idx))
            .map_or(property, String::as_str)
    }

    pub(crate) fn cells(&self) -> impl Iterator<Item = (&OracleRow, &str, &OracleCell)> {
        self.matrix.rows.iter().flat_map(|row| {
            self.names
                .iter()
                .zip(&row.cells)
                .map(move |(name, cell)| (row, name.as_str(), cell))
        })
    }
}

/// The word for a notice.
pub(crate) fn notice_word(notice: Notice) -> &'static str {
    match notice {
        Notice::Noticed => "noticed",
        Notice::Unnoticed => "unnoticed",
        Notice::TooFew => "too few",
    }
}
