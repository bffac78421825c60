//! The names of the strategies.

/// A strategy that chooses the next points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Strategy {
    /// Independent uniform points.
    Random,
    /// Halton's sequence with a random shift. Fills the cube evenly in low dimensions.
    Halton,
    /// Latin hypercube: each generation of n points has one point in each of n slices of every
    /// axis.
    LatinHypercube,
    /// Normal distributions fitted to the points with the lowest margins.
    CrossEntropy,
    /// A multi-armed bandit for each axis, whose arms are slices.
    Bandit,
    /// A quadratic model of the margin. Samples its minimum, and after the first failure also the
    /// boundary between pass and fail.
    Boundary,
}

impl Strategy {
    /// All strategies, in the order of help texts.
    pub const ALL: [Self; 6] = [
        Self::Random,
        Self::Halton,
        Self::LatinHypercube,
        Self::CrossEntropy,
        Self::Bandit,
        Self::Boundary,
    ];

    /// Returns the name used in config files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Random => "random",
            Self::Halton => "halton",
            Self::LatinHypercube => "latin-hypercube",
            Self::CrossEntropy => "cross-entropy",
            Self::Bandit => "bandit",
            Self::Boundary => "boundary",
        }
    }

    /// Returns the strategy of a name, or `None` if the name is unknown.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|strategy| strategy.name() == name)
    }

    /// Whether the strategy learns from margins.
    pub fn is_guided(self) -> bool {
        matches!(self, Self::CrossEntropy | Self::Bandit | Self::Boundary)
    }
}
