//! What a library that runs networks must do.

use std::borrow::Cow;

use crate::features::FeatureMap;

/// The bytes of a network's file.
pub type Model = Cow<'static, [u8]>;

/// A network that a library has loaded.
pub(super) trait Backend: Send {
    /// The declared shape of the input; `None` for a side that is free. Empty where nothing is declared.
    fn input(&self) -> Vec<Option<usize>>;

    /// Runs an image, `1 x 3 x side x side`, and fills the map of each output that was asked for; or says why not.
    fn run(&mut self, image: &[f32], side: usize, maps: &mut [FeatureMap]) -> Result<(), RunError>;
}

/// Why a library does not load a network.
pub(super) enum Refusal {
    /// It is no network it can run.
    Format(String),
    /// It has no such output, but these.
    Output { name: String, known: Vec<String> },
    /// It takes so many inputs.
    Inputs(usize),
}

/// Why a network does not run on an image.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum RunError {
    /// The library fails, in its words.
    #[error("{why}")]
    Library { why: String },
    /// An output is of another type.
    #[error("an output holds no floats")]
    NoFloats,
    /// An output is no map of features; `known` are the first of its sides.
    #[error("an output has {sides} sides, {known:?}, expected [1, channels, rows, columns]")]
    Shape { sides: usize, known: [usize; 4] },
}

/// Takes on what an output of shape `1 x channels x rows x columns` holds, or says what is wrong with its shape.
pub(super) fn fill(
    map: &mut FeatureMap,
    shape: impl ExactSizeIterator<Item = usize>,
    data: &[f32],
) -> Result<(), RunError> {
    let (sides, mut known) = (shape.len(), [0; 4]);
    known.iter_mut().zip(shape).for_each(|(known, side)| *known = side);
    match known {
        [1, channels, rows, cols] if sides == known.len() && !data.is_empty() => {
            map.resize(rows, cols, channels);
            map.data.copy_from_slice(data);
            Ok(())
        }
        _ => Err(RunError::Shape { sides, known }),
    }
}
