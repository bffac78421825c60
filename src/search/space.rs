//! The cube that is searched.

/// One axis of the cube.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dimension {
    /// A quantile in [0, 1): near values mean near things.
    Continuous,
    /// One of so many values, none nearer to another: value `i` of `k` is the interval [i/k, (i+1)/k).
    Categorical(usize),
    /// A quantile of something that is normally distributed about what is nominal: the middle is nominal, the ends are
    /// unusual.
    Normal,
    /// One of so many values in order, the last of which is the hardest: intervals as those of [`Dimension::Categorical`].
    Rising(usize),
    /// A quantile in [0, 1) that says where something is along the same side as the axis with this earlier index says it of
    /// another thing: equal values put the two next to each other, which is unusual.
    Beside(usize),
    /// The same as [`Dimension::Normal`] of something that matters only where things are close to each other. There are
    /// many of these, and each matters seldom: no strategy learns from them.
    Aside,
}

impl Dimension {
    /// How many values there are where none is nearer to another.
    pub(crate) fn categories(self) -> Option<usize> {
        match self {
            Self::Categorical(count) => Some(count),
            Self::Continuous | Self::Normal | Self::Rising(_) | Self::Beside(_) | Self::Aside => None,
        }
    }

    /// Whether a strategy learns where along it margins are low.
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
    /// The cube with these axes. An axis of no value counts as one of a single value, one beside no earlier axis as continuous.
    pub fn new(dimensions: impl IntoIterator<Item = Dimension>) -> Self {
        let whole = |(index, dimension)| match dimension {
            Dimension::Beside(other) if other >= index => Dimension::Continuous,
            Dimension::Categorical(count) => Dimension::Categorical(count.max(1)),
            Dimension::Rising(count) => Dimension::Rising(count.max(1)),
            Dimension::Continuous | Dimension::Normal | Dimension::Beside(_) | Dimension::Aside => dimension,
        };
        Self { dimensions: dimensions.into_iter().enumerate().map(whole).collect() }
    }

    /// The axes, in order.
    pub fn dimensions(&self) -> &[Dimension] {
        &self.dimensions
    }

    /// How far apart two points are: root mean square over the axes that are learnt; two values of a categorical axis are 1 apart.
    pub(crate) fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let (mut sum, mut count) = (0.0, 0);
        for ((dimension, a), b) in
            self.dimensions.iter().zip(a).zip(b).filter(|((dimension, _), _)| dimension.is_learnt())
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

/// Which of `count` equal intervals of [0, 1) a number is in.
pub(crate) fn bucket(value: f64, count: usize) -> usize {
    ((value.max(0.0) * count as f64) as usize).min(count.saturating_sub(1))
}
