//! What a library that runs networks must do.

use std::borrow::Cow;

use crate::features::FeatureMap;

/// The bytes of a network's file.
pub type Model = Cow<'static, [u8]>;

/// What a network is given at one of its inputs: `1 x channels x rows x columns`, row-major.
#[derive(Clone, Copy)]
pub(super) struct Input<'a> {
    pub shape: [usize; 4],
    pub data: &'a [f32],
}

impl<'a> Input<'a> {
    /// A square image of three channels.
    pub fn image(side: usize, data: &'a [f32]) -> Self {
        Self { shape: [1, 3, side, side], data }
    }

    /// A map of features.
    pub fn map(map: &'a FeatureMap) -> Self {
        Self { shape: [1, map.channels, map.rows, map.cols], data: &map.data }
    }
}

/// A network that a library has loaded.
pub(super) trait Backend: Send {
    /// The declared shape of each input; `None` for a side that is free. Empty where nothing is declared.
    fn inputs(&self) -> Vec<Vec<Option<usize>>>;

    /// Runs what is given at each input, in their order, and fills the map of each output that was asked for; or says
    /// why not.
    fn run(&mut self, inputs: &[Input], maps: &mut [FeatureMap]) -> Result<(), RunError>;
}

/// Which outputs of a network are wanted.
#[derive(Clone, Copy)]
pub(super) enum Outputs<'a> {
    /// So many, whatever their names.
    All(usize),
    /// Those of these names, in this order.
    Named(&'a [String]),
}

impl Outputs<'_> {
    /// Their names, of those that there are.
    pub fn among(self, known: &[String]) -> Result<Vec<String>, Refusal> {
        match self {
            Self::All(count) if known.len() == count => Ok(known.to_vec()),
            Self::All(_) => Err(Refusal::Outputs(known.len())),
            Self::Named(names) => match names.iter().find(|name| !known.contains(name)) {
                Some(name) => Err(Refusal::Output { name: name.clone(), known: known.to_vec() }),
                None => Ok(names.to_vec()),
            },
        }
    }
}

/// Why a library does not load a network.
pub(super) enum Refusal {
    /// It is no network it can run.
    Format(String),
    /// It has no such output, but these.
    Output { name: String, known: Vec<String> },
    /// It gives so many outputs.
    Outputs(usize),
}

/// Why a network does not run on an image.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum RunError {
    /// The library fails, in its words.
    #[error("{why}")]
    Library { why: String },
    /// An output is of another type.
    #[error("an output does not hold floats")]
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
