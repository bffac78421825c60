//! Work that a search may still do, counted in steps: the same robot gets the same proposal on every
//! machine, however slow.

/// Steps of a whole proposal: about ten seconds of work.
const ALL_STEPS: u64 = 40_000_000;

/// Steps that are left for a search. A step is about the measurement of one ray at one solid.
#[derive(Debug)]
pub(super) struct Effort {
    left: u64,
    is_cut: bool,
}

impl Effort {
    /// That of a whole proposal.
    pub(super) fn whole() -> Self {
        Self::of(ALL_STEPS)
    }

    /// That of a search with this number of steps.
    pub(super) fn of(steps: u64) -> Self {
        Self {
            left: steps,
            is_cut: false,
        }
    }

    /// One of `n` equal parts of the steps that are left, for a search of its own.
    pub(super) fn part(&mut self, n: usize) -> Self {
        let part = self.left / (n.max(1) as u64);
        self.left -= part;
        Self::of(part)
    }

    /// Takes back the rest of a part.
    pub(super) fn join(&mut self, part: &Self) {
        self.left += part.left;
        self.is_cut |= part.is_cut;
    }

    /// Counts steps.
    pub(super) fn spend(&mut self, steps: u64) {
        self.left = self.left.saturating_sub(steps);
    }

    /// Whether no steps are left. The search that asks has more to do, so it is cut short.
    pub(super) fn is_spent(&mut self) -> bool {
        self.is_cut |= self.left == 0;
        self.left == 0
    }

    /// Whether a search was cut short.
    pub(super) fn is_cut(&self) -> bool {
        self.is_cut
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_take_no_more_than_the_whole() {
        let mut whole = Effort::of(10);
        let mut half = whole.part(2);
        half.spend(3);
        assert!(!half.is_spent() && !half.is_cut());
        half.spend(4);
        assert!(half.is_spent() && half.is_cut());
        whole.join(&half);
        assert!(!whole.is_spent() && whole.is_cut());
        whole.spend(5);
        assert!(whole.is_spent());
    }
}
