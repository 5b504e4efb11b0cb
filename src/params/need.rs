//! What a changed parameter needs before it has effect: one column of the table, from which the trackers, the
//! descriptors and the documents have it.

/// What must be made anew for a changed value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// Nothing.
    Nothing,
    /// The network, to be run in another way.
    Runtime,
    /// The network, and the filters with it.
    Network,
    /// The layers and the correlation filters.
    Filters,
    /// The scale filter.
    Scale,
    /// The motion filter.
    Motion,
    /// The weak classifiers.
    Classifiers,
    /// All that is learned of a target.
    Target,
    /// The model of the background.
    Background,
    /// Another mark: targets that are followed stay as they are.
    Start,
    /// Another start of the program.
    Restart,
}

impl Need {
    /// All of them, in the order of the declaration.
    pub const ALL: [Self; 11] = [
        Self::Nothing,
        Self::Runtime,
        Self::Network,
        Self::Filters,
        Self::Scale,
        Self::Motion,
        Self::Classifiers,
        Self::Target,
        Self::Background,
        Self::Start,
        Self::Restart,
    ];

    /// Whether it waits for a frame in which the target is certain, so that nothing else is learned in its place.
    pub const fn waits(self) -> bool {
        matches!(self, Self::Network | Self::Filters | Self::Scale | Self::Target)
    }

    /// Whether something is made anew for targets that are followed.
    pub const fn makes_anew(self) -> bool {
        !matches!(self, Self::Nothing | Self::Start | Self::Restart)
    }

    /// The word in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nothing => "live",
            Self::Runtime => "runtime",
            Self::Network => "network",
            Self::Filters => "filters",
            Self::Scale => "scale filter",
            Self::Motion => "motion",
            Self::Classifiers => "classifiers",
            Self::Target => "target",
            Self::Background => "background",
            Self::Start => "next start",
            Self::Restart => "fixed",
        }
    }

    /// What becomes of a change.
    pub const fn about(self) -> &'static str {
        match self {
            Self::Nothing => "takes effect on the next frame",
            Self::Runtime => "takes effect once the network has been reloaded in the background",
            Self::Network => {
                "reloads the network in the background, then rebuilds the filters once the target is TRACKING"
            }
            Self::Filters => "rebuilds the filters once the target is TRACKING",
            Self::Scale => "rebuilds the scale filter once the target is TRACKING",
            Self::Motion => "restarts the motion filter on the next frame",
            Self::Classifiers => "retrains the weak classifiers on the stored samples",
            Self::Target => "relearns the target once it is TRACKING",
            Self::Background => "relearns the background from the next frame on",
            Self::Start => "applies to targets that start later",
            Self::Restart => "is refused while the program runs",
        }
    }
}
