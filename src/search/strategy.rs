//! The names of the strategies.

/// How the next points are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Strategy {
    /// Independent uniform points.
    Random,
    /// Halton's sequence with a random shift: fills the cube evenly in few dimensions.
    Halton,
    /// Each generation has one point in each of as many slices of every axis.
    LatinHypercube,
    /// Normal distributions that follow the points of the lowest margin.
    CrossEntropy,
    /// Each axis in slices, played like the arms of a bandit.
    Bandit,
    /// A quadratic model of the margin, asked for where it is least, and then for the edge of what fails.
    Boundary,
}

impl Strategy {
    /// All of them, in the order in which they are told.
    pub const ALL: [Self; 6] =
        [Self::Random, Self::Halton, Self::LatinHypercube, Self::CrossEntropy, Self::Bandit, Self::Boundary];

    /// The name that a campaign file uses.
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

    /// The strategy of a name.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|strategy| strategy.name() == name)
    }

    /// Whether it learns from margins.
    pub fn is_guided(self) -> bool {
        matches!(self, Self::CrossEntropy | Self::Bandit | Self::Boundary)
    }
}
