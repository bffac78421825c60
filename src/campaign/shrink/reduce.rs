//! From a failing list of choices to a smaller one: fewer things first, then values nearer to nominal.

use std::collections::BTreeMap;

use crate::base::{Choice, ChoiceKind};
use crate::campaign::shrink::list::{find, has, ids, is_nominal, spread, with_choice, with_nominal, with_value};
use crate::campaign::shrink::{Id, Search};

/// A value is halved towards nominal at most so often: what a quarter does not need is not worth more tries.
const HALVINGS: usize = 2;

/// What the shrinker is told of the choices.
pub struct Plan<'a> {
    /// Choices that each take one thing away, the thing that is most likely needed first.
    pub removals: Vec<Choice>,
    /// Choices of which each takes more of an end away than the next.
    pub ends: Vec<Choice>,
    /// Group of a choice of a list: choices of a group become nominal together if they can, the lowest group first.
    /// Nothing for those that are left as they are.
    pub group: &'a dyn Fn(&[Choice], &str) -> Option<u8>,
}

/// The smallest list that is found within the search's limits, and whether nothing can be taken from it: no thing, and
/// no value back to nominal.
///
/// `list` must fail. `on_better` hears of each smaller list.
pub fn reduce(
    search: &mut Search<'_>,
    list: Vec<Choice>,
    plan: &Plan<'_>,
    on_better: &mut dyn FnMut(&[Choice]),
) -> (Vec<Choice>, bool) {
    let mut reducer = Reducer { search, best: list, plan, on_better };
    reducer.cut_end();
    reducer.take_away();
    reducer.normalise();
    reducer.lower();
    reducer.round();
    let done = reducer.one_by_one();
    (reducer.best, done)
}

struct Reducer<'a, 's> {
    search: &'a mut Search<'s>,
    best: Vec<Choice>,
    plan: &'a Plan<'a>,
    on_better: &'a mut dyn FnMut(&[Choice]),
}

impl Reducer<'_, '_> {
    /// Takes over the first list that fails.
    fn first(&mut self, lists: &[Vec<Choice>]) -> Option<usize> {
        let (at, made) = self.search.first(lists)?;
        self.best = made;
        (self.on_better)(&self.best);
        Some(at)
    }

    /// Choices that are not nominal and may become so.
    fn special(&self) -> Vec<(u8, Id)> {
        let choices = ids(&self.best).into_iter().filter(|(_, choice)| !is_nominal(choice));
        choices.filter_map(|(id, _)| Some(((self.plan.group)(&self.best, &id.name)?, id))).collect()
    }

    fn cut_end(&mut self) {
        let lists: Vec<Vec<Choice>> = self.plan.ends.iter().map(|end| with_choice(self.best.clone(), end)).collect();
        self.first(&lists);
    }

    /// Keeps the fewest of the most important things, doubling their number until it fails; then one by one.
    fn take_away(&mut self) {
        let there: Vec<&Choice> = self.plan.removals.iter().filter(|removal| !has(&self.best, removal)).collect();
        let mut kept = vec![0];
        while let Some(more) = kept.last().map(|last| (last * 2).max(1)).filter(|more| *more < there.len()) {
            kept.push(more);
        }
        if there.is_empty() {
            return;
        }
        let without = |best: &[Choice], from: usize| {
            there[from..].iter().fold(best.to_vec(), |list, removal| with_choice(list, removal))
        };
        let lists: Vec<Vec<Choice>> = kept.iter().map(|kept| without(&self.best, *kept)).collect();
        let left = self.first(&lists).map_or(there.len(), |at| kept[at]);
        let mut rest: &[&Choice] = &there[..left];
        // The least important first.
        while !rest.is_empty() {
            let lists: Vec<Vec<Choice>> =
                rest.iter().rev().map(|removal| with_choice(self.best.clone(), removal)).collect();
            match self.first(&lists) {
                Some(at) => rest = &rest[..rest.len() - 1 - at],
                None => return,
            }
        }
    }

    /// Everything nominal at once, or group by group, or half by half.
    fn normalise(&mut self) {
        let mut groups: BTreeMap<u8, Vec<Id>> = BTreeMap::new();
        for (group, id) in self.special() {
            groups.entry(group).or_default().push(id);
        }
        let all: Vec<Id> = groups.values().flatten().cloned().collect();
        if self.first(&[with_nominal(self.best.clone(), &all)]).is_none() {
            groups.values().for_each(|group| self.normalise_some(group));
        }
    }

    fn normalise_some(&mut self, some: &[Id]) {
        let special = |id: &&Id| find(&self.best, id).is_some_and(|choice| !is_nominal(choice));
        let some: Vec<Id> = some.iter().filter(special).cloned().collect();
        if some.is_empty() || self.first(&[with_nominal(self.best.clone(), &some)]).is_some() || some.len() == 1 {
            return;
        }
        let (front, back) = some.split_at(some.len() / 2);
        self.normalise_some(front);
        self.normalise_some(back);
    }

    /// What has to be special need not be as special as it is.
    fn lower(&mut self) {
        for (_, id) in self.special() {
            for _ in 0..HALVINGS {
                let Some(choice) = find(&self.best, &id).filter(|choice| !is_index(choice)) else { break };
                let half = (choice.value + choice.kind.nominal()) / 2.0;
                if self.first(&[with_value(self.best.clone(), &id, half)]).is_none() {
                    break;
                }
            }
        }
    }

    /// Numbers that people can read, if it fails with them as well.
    fn round(&mut self) {
        let special = self.special();
        let rounded = special.iter().fold(self.best.clone(), |list, (_, id)| match find(&list, id) {
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

    /// Takes away and normalises single choices until none is left that is not needed. False where limits ended it.
    fn one_by_one(&mut self) -> bool {
        let mut from = 0;
        let mut size = usize::MAX;
        loop {
            let removals = self.plan.removals.iter().filter(|removal| !has(&self.best, removal));
            let mut lists: Vec<Vec<Choice>> = removals.map(|removal| with_choice(self.best.clone(), removal)).collect();
            lists.extend(self.special().into_iter().map(|(_, id)| with_nominal(self.best.clone(), &[id])));
            if lists.len() >= size {
                // What was made is not smaller than what it was made from: going on could turn in a circle.
                return true;
            }
            size = lists.len();
            from = from.min(size);
            // After a success those behind it come first: those before it have just been tried.
            lists.rotate_left(from);
            match self.first(&lists) {
                Some(at) => from = (from + at) % lists.len().max(1),
                None => return !self.search.spent(),
            }
        }
    }
}

fn is_index(choice: &Choice) -> bool {
    matches!(choice.kind, ChoiceKind::Index { .. })
}

/// The value to a hundredth of its spread or finer, in decimal digits.
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
