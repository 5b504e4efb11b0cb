//! What an ONNX file declares of its input, and freeing it of that.
//!
//! Convolutions take images of any size, but ONNX Runtime holds a network to the size that its file declares.

use rten_onnx::onnx::{Dimension, ModelProto, ValueInfoProto};

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
        // Weights may be listed as inputs as well.
        let weights: Vec<Option<String>> = graph.initializer.iter().map(|tensor| tensor.name.clone()).collect();
        let mut inputs = graph.input.iter_mut().filter(|input| !weights.contains(&input.name));
        let (Some(input), None) = (inputs.next(), inputs.next()) else {
            return Err("it does not take exactly one input".to_owned());
        };
        let sides: Vec<Option<i64>> = dimensions(input).into_iter().flatten().map(|side| side.dim_value).collect();
        let &[_, Some(3), Some(rows), Some(columns)] = sides.as_slice() else {
            return Err(format!("its input is declared as {sides:?}, expected a size: 1 x 3 x rows x columns"));
        };
        let declared = [rows, columns].map(|side| usize::try_from(side).unwrap_or_default());
        graph.input.iter_mut().filter(|input| !weights.contains(&input.name)).for_each(free);
        graph.output.iter_mut().for_each(free);
        graph.value_info.clear();
        let model = model.write_buf().map_err(|error| error.to_string())?;
        Ok(Self { declared, model })
    }
}

/// What is declared of the sides of a value.
fn dimensions(value: &mut ValueInfoProto) -> Option<&mut Vec<Dimension>> {
    let tensor = value.r#type.as_mut()?.tensor_type.as_mut()?;
    tensor.shape.as_mut().map(|shape| &mut shape.dim)
}

/// Declares rows and columns no longer.
fn free(value: &mut ValueInfoProto) {
    dimensions(value).into_iter().flatten().skip(2).for_each(|side| *side = Dimension::default());
}
