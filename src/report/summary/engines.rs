//! The same runs in two physics engines, ready to print.

use actcheck_analysis::EngineComparison;
use actcheck_history::CrossCheck;

/// Runs of a campaign that MuJoCo played, too.
#[derive(Debug, Clone, PartialEq)]
pub struct EngineSummary {
    /// Id of the campaign.
    pub campaign: String,
    /// Version of MuJoCo.
    pub version: String,
    /// Id of the campaign with MuJoCo's courses.
    pub imported: Option<String>,
    /// Whether the skill ran in MuJoCo, too, instead of MuJoCo playing its setpoints from here.
    pub closed_loop: bool,
    /// Factor by which the friction of the fingers is wrong on purpose.
    pub finger_friction: f64,
    /// The comparison.
    pub comparison: EngineComparison,
    /// CPU time of MuJoCo in the setting of the exported files. Unit: seconds.
    pub plain_secs: f64,
}

impl EngineSummary {
    /// 0: all properties agree in all runs. 1: some do not.
    pub fn exit_code(&self) -> u8 {
        let agreement = self.comparison.agreement();
        u8::from(agreement.agree < agreement.of)
    }

    /// The part that a history keeps.
    pub fn record(&self) -> CrossCheck {
        let runs = self.comparison.runs.iter();
        CrossCheck {
            campaign: self.campaign.clone(),
            engine: format!("MuJoCo {}", self.version),
            imported: self.imported.clone(),
            runs: runs.map(|run| (run.run.clone(), run.contested())).collect(),
        }
    }

    /// How the runs were made in MuJoCo, in words.
    pub(crate) fn way(&self) -> &'static str {
        if self.closed_loop {
            "where the skill ran anew"
        } else {
            "with the same setpoints"
        }
    }

    /// A setting of MuJoCo in words.
    pub(crate) fn setting(&self, name: &str) -> String {
        let friction = self.finger_friction;
        match name {
            _ if name == self.comparison.plain && friction == 1.0 => "as exported".to_owned(),
            _ if name == self.comparison.plain => {
                format!("finger friction × {friction}, wrong on purpose")
            }
            "impratio" => "impratio 1 instead of 10".to_owned(),
            "cone" => "pyramidal friction cones".to_owned(),
            "noslip" => "5 steps of noslip".to_owned(),
            "finger-friction" if friction == 1.0 => "finger friction × 1.1".to_owned(),
            "finger-friction" => format!("finger friction × {:.3}", 1.0 / friction),
            other => other.to_owned(),
        }
    }
}
