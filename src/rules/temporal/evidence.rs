//! The moment that decides a formula, with the values there.

use crate::model::universe::Universe;
use crate::syntax::TemporalOperator;
use crate::temporal::deciding::{DecidingPart, deciding_signal};
use crate::temporal::formula::{CheckedFormula, Timed};
use crate::temporal::semantics::Reader;
use crate::watch::Watch;
use actcheck_base::{DecidingSignal, Span, TermId};

/// The reason for which a formula holds or fails: as a sentence, and the signals in it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Evidence {
    pub(crate) text: String,
    pub(crate) signals: Vec<DecidingSignal>,
}

impl Timed {
    /// Describes when and by which values its first formula is decided. `source` returns the text
    /// of a span. Returns `None` if a quantity was not recorded.
    pub(crate) fn evidence(
        &self,
        binding: &[TermId],
        terms: &Universe<'_>,
        watch: &Watch,
        source: &dyn Fn(Span) -> String,
    ) -> Option<Evidence> {
        let formula = self.formulas.first()?;
        let reader = Reader::new(binding, terms, watch)?;
        let mut found = Vec::new();
        EvidenceSearch { reader: &reader }.decides(formula, reader.moment(formula), &mut found)?;
        let texts: Option<Vec<String>> =
            found.iter().map(|one| one.text(&reader, source)).collect();
        let signals = found
            .iter()
            .filter_map(|one| deciding_signal(one, &reader, source))
            .collect();
        Some(Evidence {
            text: texts?.join("; "),
            signals,
        })
    }

    /// Returns the moment that decides the formula that is nearest to failing. Unit: seconds since
    /// the action began.
    pub(super) fn moment(
        &self,
        binding: &[TermId],
        terms: &Universe<'_>,
        watch: &Watch,
    ) -> Option<f64> {
        let reader = Reader::new(binding, terms, watch)?;
        let mut nearest: Option<(f64, &CheckedFormula)> = None;
        for formula in &self.formulas {
            let robustness = reader.robustness(formula)?;
            if nearest.is_none_or(|(known, _)| robustness < known) {
                nearest = Some((robustness, formula));
            }
        }
        let (_, formula) = nearest?;
        let mut found = Vec::new();
        EvidenceSearch { reader: &reader }.decides(formula, reader.moment(formula), &mut found)?;
        let at = found.iter().find_map(|one| match one {
            DecidingPart::Atom { at, .. } => Some(*at),
            DecidingPart::Since { .. } | DecidingPart::NoTime => None,
        });
        at.map(|at| reader.secs(at))
    }
}

struct EvidenceSearch<'a> {
    reader: &'a Reader<'a>,
}

impl EvidenceSearch<'_> {
    /// Appends the values that decide a formula at a sample.
    fn decides<'f>(
        &self,
        formula: &'f CheckedFormula,
        at: usize,
        found: &mut Vec<DecidingPart<'f>>,
    ) -> Option<()> {
        match formula {
            CheckedFormula::Compare { .. } | CheckedFormula::Truth { .. } => {
                found.push(DecidingPart::Atom { at, formula });
                Some(())
            }
            CheckedFormula::Not(inner) | CheckedFormula::Consequent { formula: inner, .. } => {
                self.decides(inner, at, found)
            }
            CheckedFormula::And(parts) => {
                self.decides(self.extreme(parts, at, f64::lt)?, at, found)
            }
            CheckedFormula::Or(parts) => {
                let best = self.extreme(parts, at, f64::gt)?;
                if *self.reader.over_time(best)?.get(at)? > 0.0 {
                    return self.decides(best, at, found);
                }
                // All alternatives fail.
                parts
                    .iter()
                    .try_for_each(|part| self.decides(part, at, found))
            }
            CheckedFormula::Temporal {
                operator,
                from,
                to,
                parts,
                ..
            } => self.temporal(*operator, (*from, *to), parts, at, found),
        }
    }

    /// Returns the part with the smallest or largest robustness at a sample.
    fn extreme<'f>(
        &self,
        parts: &'f [CheckedFormula],
        at: usize,
        better: fn(&f64, &f64) -> bool,
    ) -> Option<&'f CheckedFormula> {
        let mut best: Option<(f64, &CheckedFormula)> = None;
        for part in parts {
            let value = *self.reader.over_time(part)?.get(at)?;
            if best.is_none_or(|(known, _)| better(&value, &known)) {
                best = Some((value, part));
            }
        }
        best.map(|(_, part)| part)
    }

    fn temporal<'f>(
        &self,
        operator: TemporalOperator,
        (from, to): (f64, f64),
        parts: &'f [CheckedFormula],
        at: usize,
        found: &mut Vec<DecidingPart<'f>>,
    ) -> Option<()> {
        let count = self.reader.course.count;
        let window = self.reader.window(from, to);
        let reach = window.to.unwrap_or(count);
        let times: Vec<usize> = if operator.is_past() {
            (at.saturating_sub(reach)..=at)
                .filter(|time| time + window.from <= at)
                .collect()
        } else {
            (at.saturating_add(window.from)..=at.saturating_add(reach).min(count.saturating_sub(1)))
                .collect()
        };
        if times.is_empty() {
            found.push(DecidingPart::NoTime);
            return Some(());
        }
        let decisive = parts.last()?;
        let values = self.reader.over_time(decisive)?;
        let smallest = matches!(
            operator,
            TemporalOperator::Always | TemporalOperator::Historically
        );
        let rank = |time: &usize| {
            if smallest {
                values[*time]
            } else {
                -values[*time]
            }
        };
        let chosen = times
            .into_iter()
            .min_by(|a, b| rank(a).total_cmp(&rank(b)))?;
        if smallest && values[chosen] < 0.0 {
            let since = (0..=chosen)
                .rev()
                .take_while(|time| values[*time] < 0.0)
                .last()
                .unwrap_or(chosen);
            if since < chosen {
                found.push(DecidingPart::Since { at: since });
            }
        }
        if let [first, second] = parts {
            // Until: the first part must hold up to the second, so the one that is farther from
            // holding decides.
            let held = self.reader.over_time(first)?;
            let (low, high) = if operator.is_past() {
                (chosen + 1, at + 1)
            } else {
                (at, chosen)
            };
            let worst = (low..high).min_by(|a, b| held[*a].total_cmp(&held[*b]));
            if let Some(worst) = worst.filter(|worst| held[*worst] < values[chosen]) {
                return self.decides(first, worst, found);
            }
            return self.decides(second, chosen, found);
        }
        self.decides(decisive, chosen, found)
    }
}
