//! Verdicts beside people's labels, ready to print.

use crate::MarginBound;
use actcheck_analysis::{Calibration, FittedLimit};

/// The properties with labels.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelSummary {
    /// By name.
    pub properties: Vec<LabelledProperty>,
}

/// A property beside its labels.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelledProperty {
    /// Its local name.
    pub property: String,
    /// The comparison.
    pub found: Calibration,
    /// The limit from which its rule measures its margin; `None` if it has none, or several.
    pub limit: Option<MarginBound>,
}

impl LabelSummary {
    /// 0: all labels agree with the verdicts. 1: some do not.
    pub fn exit_code(&self) -> u8 {
        let agree = |one: &LabelledProperty| one.found.agreement.agree == one.found.agreement.of;
        u8::from(!self.properties.iter().all(agree))
    }
}

impl LabelledProperty {
    /// The limit with which the property passes from the fitted margin on; `None` if its rule has
    /// no limit.
    pub(crate) fn fitted_limit(&self, fitted: &FittedLimit) -> Option<f64> {
        self.limit.map(|limit| {
            if limit.below {
                limit.at - fitted.margin
            } else {
                limit.at + fitted.margin
            }
        })
    }
}

/// The word for a label.
pub(crate) fn label_word(passes: bool) -> &'static str {
    if passes { "pass" } else { "fail" }
}
