//! What the three images say of a target (table 1).

/// The inferred state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Inferred {
    /// Nothing speaks for it.
    LostTrack,
    /// It is where it is expected, but neither moves nor shows its colours.
    Occlusion,
    /// Something else is there.
    WrongObject,
    /// It stands still.
    Stopped,
    /// It moves.
    Moving,
}

impl Inferred {
    /// The row of the table.
    pub(super) const fn of(motion: bool, colour: bool, position: bool) -> Self {
        match (motion, colour, position) {
            (false, false, false) => Self::LostTrack,
            (false, false, true) => Self::Occlusion,
            (false, true, true) => Self::Stopped,
            (true, true, true) => Self::Moving,
            (false, true, false) | (true, _, _) => Self::WrongObject,
        }
    }

    /// The name in debug images.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::LostTrack => "lost track",
            Self::Occlusion => "occlusion",
            Self::WrongObject => "wrong object",
            Self::Stopped => "stopped",
            Self::Moving => "moving",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Inferred::{self, *};

    #[test]
    fn the_table_is_the_papers() {
        let rows = [LostTrack, Occlusion, WrongObject, Stopped, WrongObject, WrongObject, WrongObject, Moving];
        for (i, want) in rows.into_iter().enumerate() {
            assert_eq!(Inferred::of(i & 4 != 0, i & 2 != 0, i & 1 != 0), want, "row {i}");
        }
    }
}
