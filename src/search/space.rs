//! The search space, a unit cube.

/// An axis of the cube.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dimension {
    /// A quantile in [0, 1). Near values have similar effects.
    Continuous,
    /// One of this many unordered values: value `i` of `k` is the interval [i/k, (i+1)/k).
    Categorical(usize),
    /// A quantile of a normal distribution about the nominal value: the middle is nominal, the ends
    /// are unusual.
    Normal,
    /// One of this many ordered values, the last of which is the hardest. Intervals are as in
    /// [`Dimension::Categorical`].
    Rising(usize),
    /// A quantile in [0, 1) of a position on the same side as the earlier axis with this index,
    /// which is the position of another object. Equal values put the two objects next to each
    /// other, which is unusual.
    Beside(usize),
    /// Like [`Dimension::Normal`], for a quantity that matters only if objects are close to each
    /// other. There are many such axes, and each seldom matters, so that no strategy learns from
    /// them.
    Aside,
}

impl Dimension {
    /// Returns the number of values of a categorical axis, and `None` for other axes.
    pub(crate) fn categories(self) -> Option<usize> {
        match self {
            Self::Categorical(count) => Some(count),
            Self::Continuous | Self::Normal | Self::Rising(_) | Self::Beside(_) | Self::Aside => {
                None
            }
        }
    }

    /// Whether strategies learn where along this axis margins are low.
    pub(crate) fn is_learnt(self) -> bool {
        self != Self::Aside
    }
}

/// The cube [0, 1)^d. Its nominal distribution is uniform.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Space {
    dimensions: Vec<Dimension>,
}

impl Space {
    /// Creates the cube with these axes. An axis without values becomes an axis with one value; an
    /// axis beside no earlier axis becomes continuous.
    pub fn new(dimensions: impl IntoIterator<Item = Dimension>) -> Self {
        let whole = |(index, dimension)| match dimension {
            Dimension::Beside(other) if other >= index => Dimension::Continuous,
            Dimension::Categorical(count) => Dimension::Categorical(count.max(1)),
            Dimension::Rising(count) => Dimension::Rising(count.max(1)),
            Dimension::Continuous | Dimension::Normal | Dimension::Beside(_) | Dimension::Aside => {
                dimension
            }
        };
        Self {
            dimensions: dimensions.into_iter().enumerate().map(whole).collect(),
        }
    }

    /// The axes, in order.
    pub fn dimensions(&self) -> &[Dimension] {
        &self.dimensions
    }

    /// Returns the root mean square distance of two points over the learnt axes. Different values
    /// of a categorical axis have distance 1.
    pub(crate) fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let (mut sum, mut count) = (0.0, 0);
        for ((dimension, a), b) in self
            .dimensions
            .iter()
            .zip(a)
            .zip(b)
            .filter(|((dimension, _), _)| dimension.is_learnt())
        {
            let gap = match dimension.categories() {
                None => a - b,
                Some(count) => f64::from(u8::from(bucket(*a, count) != bucket(*b, count))),
            };
            sum += gap * gap;
            count += 1;
        }
        libm::sqrt(sum / f64::from(count.max(1)))
    }
}

/// Returns the index of a number's interval among `count` equal intervals of [0, 1).
pub(crate) fn bucket(value: f64, count: usize) -> usize {
    ((value.max(0.0) * count as f64) as usize).min(count.saturating_sub(1))
}
