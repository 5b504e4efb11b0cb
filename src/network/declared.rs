//! What an ONNX file declares of its inputs, and freeing it of that.
//!
//! Convolutions take images of any size, but ONNX Runtime holds a network to the size that its file declares.

use std::collections::HashSet;

use rten_onnx::onnx::{Dimension, GraphProto, ModelProto, ValueInfoProto};

/// A network whose input and outputs may have any size.
pub(super) struct Freed {
    /// The rows and columns that the file declared for its input.
    pub declared: [usize; 2],
    /// The file without that.
    pub model: Vec<u8>,
}

impl Freed {
    /// Frees a network of one input, an image of three channels; or says why not.
    pub fn new(model: &[u8]) -> Result<Self, String> {
        let mut model = ModelProto::parse_buf(model).map_err(|error| error.to_string())?;
        let graph = model.graph.as_mut().ok_or("it has no graph")?;
        let mut inputs = inputs_of(graph);
        let (Some(input), None) = (inputs.next(), inputs.next()) else {
            return Err("it does not take exactly one input".to_owned());
        };
        let (name, sides) = (input.name.clone(), sides_of(input));
        drop(inputs);
        let &[_, Some(3), Some(rows), Some(columns)] = sides.as_slice() else {
            return Err(format!("its input is declared as {sides:?}, expected a size: 1 x 3 x rows x columns"));
        };
        let declared = [rows, columns];
        graph.input.iter_mut().filter(|input| input.name == name).for_each(free);
        graph.output.iter_mut().for_each(free);
        graph.value_info.clear();
        let model = model.write_buf().map_err(|error| error.to_string())?;
        Ok(Self { declared, model })
    }
}

/// The inputs that a file does not hold itself: weights may be listed as inputs as well.
pub(super) fn inputs_of(graph: &GraphProto) -> impl Iterator<Item = &ValueInfoProto> {
    let held: HashSet<Option<&str>> = graph.initializer.iter().map(|tensor| tensor.name.as_deref()).collect();
    graph.input.iter().filter(move |input| !held.contains(&input.name.as_deref()))
}

/// What is declared of the sides of a value; `None` for a side that is free.
pub(super) fn sides_of(value: &ValueInfoProto) -> Vec<Option<usize>> {
    let tensor = value.r#type.as_ref().and_then(|kind| kind.tensor_type.as_ref());
    let sides = tensor.and_then(|tensor| tensor.shape.as_ref()).map_or(&[][..], |shape| &shape.dim);
    sides.iter().map(|side| side.dim_value.and_then(|length| usize::try_from(length).ok())).collect()
}

/// Declares rows and columns no longer.
fn free(value: &mut ValueInfoProto) {
    let tensor = value.r#type.as_mut().and_then(|kind| kind.tensor_type.as_mut());
    let shape = tensor.and_then(|tensor| tensor.shape.as_mut());
    shape.into_iter().flat_map(|shape| &mut shape.dim).skip(2).for_each(|side| *side = Dimension::default());
}
