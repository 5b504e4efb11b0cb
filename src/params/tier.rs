//! Who meets a parameter: another column of the table, by which lists and documents are divided.

/// How likely a user is to want another value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Tier {
    /// Most users look at these first.
    Basic,
    /// For a camera or a scene that the defaults do not fit.
    Advanced,
    /// For comparison with the paper, or with the tracker as it is without one of its parts. No other value is better.
    Ablation,
}

impl Tier {
    /// All of them, in the order in which they are listed.
    pub const ALL: [Self; 3] = [Self::Basic, Self::Advanced, Self::Ablation];

    /// The word in lists.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Basic => "basic",
            Self::Advanced => "advanced",
            Self::Ablation => "ablation",
        }
    }

    /// What they are for.
    pub const fn about(self) -> &'static str {
        match self {
            Self::Basic => "the ones to look at first",
            Self::Advanced => "for cameras and scenes the defaults do not fit",
            Self::Ablation => {
                "for comparison with the papers, or to switch off one part of a tracker; no other value is better"
            }
        }
    }
}
