//! Findings of the analysis, with the names needed to print them.

use actcheck_analysis::{
    Cascade, Collisions, Condition, FailureMode, FlakyScene, Interval, Parameter, Pattern,
    PatternInput, Patterns, PropertyFindings, Sampling, Strongest, Trend, TwoWay,
};
use actcheck_base::{ShellLine, names};
use actcheck_verdict::Counts;

/// The output of `actcheck analyse`.
#[derive(Debug, Clone, PartialEq)]
pub struct FindingsSummary {
    /// Path of the history, as the user named it.
    pub history: String,
    /// How the user invoked this program.
    pub program: String,
    /// Options that select the same runs again, quoted for a shell.
    pub options: String,
    /// Ids of the campaigns in order of their start.
    pub campaigns: Vec<String>,
    /// Number of runs in the table.
    pub runs: u64,
    /// Number of runs of the sample in which conditions and collisions were sought; `None` if that
    /// was all.
    pub sampled_runs: Option<u64>,
    /// How the number of runs was decided: which intervals are valid, and whether rates are biased.
    pub sampling: Sampling,
    /// Number of the runs that don't count because a later run is bit-identical.
    pub twins: u64,
    /// Outcome counts of the runs that count.
    pub counts: Counts,
    /// Failure modes: runs that share the same set of failed properties.
    pub modes: Vec<FailureMode>,
    /// Pairs of properties in which a failure is associated with a later failure.
    pub cascades: Vec<Cascade>,
    /// Collisions of each action.
    pub collisions: Vec<Collisions>,
    /// One report for each property of each action.
    pub properties: Vec<PropertyReport>,
    /// Significance level of the findings.
    pub level: f64,
}

/// One property.
#[derive(Debug, Clone, PartialEq)]
pub struct PropertyReport {
    /// Findings of the analysis.
    pub findings: PropertyFindings,
    /// Unit of its margin.
    pub unit: Option<String>,
    /// Failure rate from campaign to campaign.
    pub trend: Trend,
    /// Scenes that both passed and failed.
    pub flaky: Vec<FlakyScene>,
    /// Number of scenes that were run more than once.
    pub repeated_scenes: u64,
    /// Heat maps.
    pub maps: Vec<TwoWay>,
}

impl PropertyReport {
    /// Display name of the property.
    pub fn name(&self) -> &str {
        names::local(&self.findings.property)
    }

    /// The conditions of failures: when the property fails.
    pub fn when(&self) -> Causes<'_> {
        Causes {
            report: self,
            input: &self.findings.input,
            patterns: &self.findings.patterns,
        }
    }

    /// The effects that go with failures: how the property fails.
    pub fn how(&self) -> Causes<'_> {
        let effects = &self.findings.effects;
        Causes {
            report: self,
            input: &effects.input,
            patterns: &effects.patterns,
        }
    }

    /// Describes a pattern of conditions in one sentence.
    pub fn sentence(&self, pattern: &Pattern) -> String {
        self.when().sentence(pattern)
    }
}

/// Patterns of one kind: conditions or effects.
#[derive(Debug, Clone, Copy)]
pub struct Causes<'a> {
    report: &'a PropertyReport,
    /// The runs and their parameters.
    pub input: &'a PatternInput,
    /// The patterns.
    pub patterns: &'a Patterns,
}

impl<'a> Causes<'a> {
    /// Describes a pattern in one sentence.
    pub fn sentence(&self, pattern: &Pattern) -> String {
        let conditions = self.conditions(&pattern.conditions);
        self.compared(
            &conditions,
            pattern.rate,
            pattern.runs.len() as u64,
            pattern.elsewhere,
        )
    }

    /// Describes a pattern in a sentence without statistics: `CloseObject fails in 59 % of the runs in
    /// which the robot saw the target 3.8 cm or more beside its place, and in 0.5 % of the others`.
    pub fn plain_sentence(&self, pattern: &Pattern) -> String {
        let conditions: Vec<String> = pattern
            .conditions
            .iter()
            .map(|condition| {
                plain_condition(condition, &self.input.parameters[condition.parameter()])
            })
            .collect();
        let others = match pattern.elsewhere {
            Some(elsewhere) => format!(", and in {} of the others", percent(elsewhere.rate)),
            None => String::new(),
        };
        format!(
            "{} fails in {} of the runs in which {}{others}",
            self.report.name(),
            percent(pattern.rate.rate),
            conditions.join(" and ")
        )
    }

    /// Describes one of the strongest conditions in one sentence.
    pub fn strongest_sentence(&self, strongest: &Strongest) -> String {
        let all = strongest.all;
        let condition = self.conditions(std::slice::from_ref(&strongest.condition));
        self.compared(
            &condition,
            strongest.rate,
            all.failed_in + all.passed_in,
            Some(strongest.elsewhere),
        )
    }

    fn compared(
        &self,
        conditions: &str,
        rate: Interval,
        runs: u64,
        elsewhere: Option<Interval>,
    ) -> String {
        let elsewhere = match elsewhere {
            Some(elsewhere) => format!("; elsewhere in {}", percent(elsewhere.rate)),
            None => String::new(),
        };
        let (name, share) = (self.report.name(), percent(rate.rate));
        let [low, high] = [rate.low * 100.0, rate.high * 100.0];
        format!(
            "{name} fails in {share} [{low:.0}–{high:.0}] of {runs} runs with {conditions}{elsewhere}"
        )
    }

    /// Describes conditions in words.
    pub fn conditions(&self, conditions: &[Condition]) -> String {
        let parameters = &self.input.parameters;
        let conditions: Vec<String> = conditions
            .iter()
            .map(|condition| condition_text(condition, &parameters[condition.parameter()]))
            .collect();
        match conditions.as_slice() {
            [first @ .., last] if !first.is_empty() => format!("{} and {last}", first.join(", ")),
            all => all.join(""),
        }
    }

    /// Ids of the runs of a pattern, failed runs first.
    pub fn runs(&self, pattern: &Pattern) -> Vec<&'a str> {
        let (failed, examples) = (&self.input.failed, &self.report.findings.examples);
        let of = |wanted: bool| {
            pattern
                .runs
                .iter()
                .filter(move |run| failed[**run] == wanted)
        };
        of(true)
            .chain(of(false))
            .map(|run| examples[*run].run.as_str())
            .collect()
    }
}

/// Prefix of the names of realised noise.
const DRAWN: &str = "sense_";

impl FindingsSummary {
    /// The command that writes a rule about the scenes of a property's pattern, by the pattern's
    /// number.
    pub(crate) fn scene_rule(&self, property: &str, number: usize) -> ShellLine {
        let line = ShellLine::new(&self.program)
            .fixed("analyse")
            .option("--property", property);
        line.option("--scene-rule", number.to_string())
            .quoted(&self.options)
    }
}

/// Formats a proportion, such as `71 %`; values below 10 % have one decimal.
pub(crate) fn percent(share: f64) -> String {
    let share = share * 100.0;
    if share > 0.0 && share < 9.95 {
        format!("{share:.1} %")
    } else {
        format!("{share:.0} %")
    }
}

/// A number of a condition with its unit: lengths below a metre in centimetres, with as many digits
/// as the number has.
fn quantity(value: f64, unit: Option<&str>) -> String {
    match unit {
        Some("m") if value.abs() < 1.0 => {
            let shown = format!("{:.2}", value * 100.0);
            let shown = shown.trim_end_matches('0').trim_end_matches('.');
            format!("{shown} cm")
        }
        Some(unit) => format!("{value} {unit}"),
        None => value.to_string(),
    }
}

/// Describes a condition as a clause: `the target friction is below 0.35`, or `the robot saw the
/// target 3.8 cm or more beside its place`.
fn plain_condition(condition: &Condition, parameter: &Parameter) -> String {
    let unit = parameter.unit.as_deref();
    let bare = bare_name(parameter);
    let value = |value: f64| quantity(value, unit);
    if let (Some(of), Condition::Range { low, high, .. }) = (bare.strip_prefix(DRAWN), condition) {
        let amount = match (low, high) {
            (Some(low), Some(high)) => format!("{} to {}", value(*low), value(*high)),
            (Some(low), None) => format!("{} or more", value(*low)),
            (None, Some(high)) => format!("less than {}", value(*high)),
            (None, None) => "any distance".to_owned(),
        };
        if let Some(thing) = of.strip_suffix("_xy") {
            let thing = thing.replace('_', " ");
            return format!("the robot saw the {thing} {amount} beside its place");
        }
    }
    let name = match bare.strip_prefix(DRAWN) {
        Some(of) => format!("the error of {}", of.replace('_', " ")),
        None => format!("the {}", bare.replace('_', " ")),
    };
    match condition {
        Condition::Kind { kind, .. } => {
            let thing = bare
                .strip_suffix("_category")
                .or_else(|| bare.strip_suffix("_model"))
                .unwrap_or(bare);
            format!("the {} is of the kind {kind}", thing.replace('_', " "))
        }
        Condition::Range {
            low: Some(low),
            high: Some(high),
            ..
        } => format!("{name} is from {} to {}", value(*low), value(*high)),
        Condition::Range { low: Some(low), .. } => format!("{name} is at least {}", value(*low)),
        Condition::Range {
            high: Some(high), ..
        } => format!("{name} is below {}", value(*high)),
        Condition::Range { .. } => format!("{name} has any value"),
        Condition::Arc { from, to, .. } if *from == -to => {
            format!("{name} is beyond ±{}", value(*from))
        }
        Condition::Arc { from, to, .. } => {
            format!(
                "{name} is at least {} or below {}",
                value(*from),
                value(*to)
            )
        }
    }
}

/// The name of a parameter without its unit.
fn bare_name(parameter: &Parameter) -> &str {
    match &parameter.unit {
        Some(unit) => parameter
            .name
            .strip_suffix(&format!("_{}", unit.to_lowercase()))
            .unwrap_or(&parameter.name),
        None => &parameter.name,
    }
}

/// Describes a condition, such as `target friction < 0.35`.
fn condition_text(condition: &Condition, parameter: &Parameter) -> String {
    let unit = parameter
        .unit
        .as_ref()
        .map_or_else(String::new, |unit| format!(" {unit}"));
    let bare = bare_name(parameter);
    let name = match bare.strip_prefix(DRAWN) {
        Some(of) => format!("drawn error of {}", of.replace('_', " ")),
        None => bare.replace('_', " "),
    };
    match condition {
        Condition::Kind { kind, .. } => {
            let thing = bare
                .strip_suffix("_category")
                .or_else(|| bare.strip_suffix("_model"))
                .unwrap_or(bare);
            format!("{} {kind}", thing.replace('_', " "))
        }
        Condition::Range {
            low: Some(low),
            high: Some(high),
            ..
        } => format!("{low} ≤ {name} < {high}{unit}"),
        Condition::Range { low: Some(low), .. } => format!("{name} ≥ {low}{unit}"),
        Condition::Range {
            high: Some(high), ..
        } => format!("{name} < {high}{unit}"),
        Condition::Range { .. } => format!("any {name}"),
        Condition::Arc { from, to, .. } if *from == -to => format!("{name} beyond ±{from}{unit}"),
        Condition::Arc { from, to, .. } => format!("{name} ≥ {from} or < {to}{unit}"),
    }
}
