//! Reduces a failing list of choices: first fewer objects, then values nearer to nominal.

use std::collections::BTreeMap;

use crate::shrink::list::{
    find, has, ids, is_nominal, spread, with_choice, with_nominal, with_value,
};
use crate::shrink::{Id, TrialSearch};
use actcheck_data::{Choice, ChoiceGroup, ChoiceKind, ChoiceName};

/// Maximum number of halvings of a value towards nominal; below a quarter, further tries are not
/// worthwhile.
const HALVINGS: usize = 2;

/// The meaning of the choices for the shrinker.
pub struct ShrinkPlan<'a> {
    /// Choices that each remove one object; the object most likely to be needed comes first.
    pub removals: Vec<Choice>,
    /// Choices that remove the last actions; each removes more than the next.
    pub ends: Vec<Choice>,
    /// Group of a choice. The choices of a group become nominal together if possible, the lowest
    /// group first. `None` for choices that stay unchanged.
    pub group: &'a dyn Fn(&[Choice], &ChoiceName) -> Option<ChoiceGroup>,
}

/// Returns the smallest failing list found within the search's limits, and whether it is minimal:
/// no object can be removed and no value made nominal.
///
/// `list` must fail. `on_better` is called with each smaller list.
pub fn reduce(
    search: &mut TrialSearch<'_>,
    list: Vec<Choice>,
    plan: &ShrinkPlan<'_>,
    on_better: &mut dyn FnMut(&[Choice]),
) -> (Vec<Choice>, bool) {
    let mut reducer = Reducer {
        search,
        best: list,
        plan,
        on_better,
    };
    reducer.cut_end();
    reducer.take_away();
    reducer.normalise();
    reducer.lower();
    reducer.round();
    let done = reducer.one_by_one();
    (reducer.best, done)
}

struct Reducer<'a, 's> {
    search: &'a mut TrialSearch<'s>,
    best: Vec<Choice>,
    plan: &'a ShrinkPlan<'a>,
    on_better: &'a mut dyn FnMut(&[Choice]),
}

impl Reducer<'_, '_> {
    /// Adopts the first failing list and returns its position.
    fn first(&mut self, lists: &[Vec<Choice>]) -> Option<usize> {
        let (at, made) = self.search.first(lists)?;
        self.best = made;
        (self.on_better)(&self.best);
        Some(at)
    }

    /// Choices that are not nominal and may become nominal, with their groups.
    fn special(&self) -> Vec<(ChoiceGroup, Id)> {
        let choices = ids(&self.best)
            .into_iter()
            .filter(|(_, choice)| !is_nominal(choice));
        choices
            .filter_map(|(id, _)| Some(((self.plan.group)(&self.best, &id.name)?, id)))
            .collect()
    }

    fn cut_end(&mut self) {
        let lists: Vec<Vec<Choice>> = self
            .plan
            .ends
            .iter()
            .map(|end| with_choice(self.best.clone(), end))
            .collect();
        self.first(&lists);
    }

    /// Keeps only the most important objects, doubling their number until the list fails; then
    /// removes single objects.
    fn take_away(&mut self) {
        let there: Vec<&Choice> = self
            .plan
            .removals
            .iter()
            .filter(|removal| !has(&self.best, removal))
            .collect();
        let mut kept = vec![0];
        while let Some(more) = kept
            .last()
            .map(|last| (last * 2).max(1))
            .filter(|more| *more < there.len())
        {
            kept.push(more);
        }
        if there.is_empty() {
            return;
        }
        let without = |best: &[Choice], from: usize| {
            there[from..]
                .iter()
                .fold(best.to_vec(), |list, removal| with_choice(list, removal))
        };
        let lists: Vec<Vec<Choice>> = kept.iter().map(|kept| without(&self.best, *kept)).collect();
        let left = self.first(&lists).map_or(there.len(), |at| kept[at]);
        let mut rest: &[&Choice] = &there[..left];
        // The least important first.
        while !rest.is_empty() {
            let lists: Vec<Vec<Choice>> = rest
                .iter()
                .rev()
                .map(|removal| with_choice(self.best.clone(), removal))
                .collect();
            match self.first(&lists) {
                Some(at) => rest = &rest[..rest.len() - 1 - at],
                None => return,
            }
        }
    }

    /// Makes all choices nominal at once, else group by group, else by halves.
    fn normalise(&mut self) {
        let mut groups: BTreeMap<ChoiceGroup, Vec<Id>> = BTreeMap::new();
        for (group, id) in self.special() {
            groups.entry(group).or_default().push(id);
        }
        let all: Vec<Id> = groups.values().flatten().cloned().collect();
        if self
            .first(&[with_nominal(self.best.clone(), &all)])
            .is_none()
        {
            groups.values().for_each(|group| self.normalise_some(group));
        }
    }

    fn normalise_some(&mut self, some: &[Id]) {
        let special = |id: &&Id| find(&self.best, id).is_some_and(|choice| !is_nominal(choice));
        let some: Vec<Id> = some.iter().filter(special).cloned().collect();
        if some.is_empty()
            || self
                .first(&[with_nominal(self.best.clone(), &some)])
                .is_some()
            || some.len() == 1
        {
            return;
        }
        let (front, back) = some.split_at(some.len() / 2);
        self.normalise_some(front);
        self.normalise_some(back);
    }

    /// Moves the remaining values towards nominal.
    fn lower(&mut self) {
        for (_, id) in self.special() {
            for _ in 0..HALVINGS {
                let Some(choice) = find(&self.best, &id).filter(|choice| !is_index(choice)) else {
                    break;
                };
                let half = (choice.value + choice.kind.nominal()) / 2.0;
                if self
                    .first(&[with_value(self.best.clone(), &id, half)])
                    .is_none()
                {
                    break;
                }
            }
        }
    }

    /// Rounds the values to readable numbers if the list still fails.
    fn round(&mut self) {
        let special = self.special();
        let rounded =
            special
                .iter()
                .fold(self.best.clone(), |list, (_, id)| match find(&list, id) {
                    Some(choice) if !is_index(choice) => {
                        let value = readable(choice);
                        with_value(list, id, value)
                    }
                    _ => list,
                });
        if rounded != self.best {
            self.first(&[rounded]);
        }
    }

    /// Removes objects and normalises choices one at a time until all are needed. Returns `false`
    /// if limits ended it.
    fn one_by_one(&mut self) -> bool {
        let mut from = 0;
        let mut size = usize::MAX;
        loop {
            let removals = self
                .plan
                .removals
                .iter()
                .filter(|removal| !has(&self.best, removal));
            let mut lists: Vec<Vec<Choice>> = removals
                .map(|removal| with_choice(self.best.clone(), removal))
                .collect();
            lists.extend(
                self.special()
                    .into_iter()
                    .map(|(_, id)| with_nominal(self.best.clone(), &[id])),
            );
            if lists.len() >= size {
                // The adopted list is not smaller than its predecessor: continuing might never end.
                return true;
            }
            size = lists.len();
            from = from.min(size);
            // After a success, continue behind it: the candidates before it have just been tried.
            lists.rotate_left(from);
            match self.first(&lists) {
                Some(at) => from = (from + at) % lists.len().max(1),
                None => return !self.search.spent(),
            }
        }
    }
}

fn is_index(choice: &Choice) -> bool {
    matches!(
        choice.kind,
        ChoiceKind::Index { .. } | ChoiceKind::Candidate { .. }
    )
}

/// Rounds the value to a power of ten that is at most a hundredth of its spread.
fn readable(choice: &Choice) -> f64 {
    let spread = spread(&choice.kind);
    if spread <= 0.0 {
        return choice.value;
    }
    let per_unit = libm::exp10(libm::ceil(2.0 - libm::log10(spread)));
    let rounded = libm::round(choice.value * per_unit) / per_unit;
    match choice.kind {
        ChoiceKind::Real { low, high, .. } => rounded.clamp(low, high),
        _ => rounded,
    }
}
