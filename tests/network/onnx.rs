//! Writes small ONNX networks: chains of convolutions.

use super::message::{Message, integers, model, value, weights};

/// A convolution of 3 x 3 with a border of 1.
pub struct Convolution {
    /// Name of its output.
    pub name: &'static str,
    pub stride: usize,
    /// `outputs x inputs x 3 x 3`.
    pub weights: Vec<f32>,
    pub outputs: usize,
    pub inputs: usize,
}

/// A network of convolutions, one after the other, whose outputs are those of all of them. `shape` is that of its
/// input, named `image`; a 0 is a side that is free.
pub fn network(shape: &[usize], convolutions: &[Convolution]) -> Vec<u8> {
    let mut graph = Message::default().text(2, "test");
    let mut present = "image";
    for convolution in convolutions {
        let name = format!("{}.weights", convolution.name);
        let node = Message::default()
            .text(1, present)
            .text(1, &name)
            .text(2, convolution.name)
            .text(4, "Conv")
            .message(5, integers("kernel_shape", &[3, 3]))
            .message(5, integers("pads", &[1; 4]))
            .message(5, integers("strides", &[convolution.stride; 2]));
        let kernel = weights(&name, &[convolution.outputs, convolution.inputs, 3, 3], &convolution.weights);
        let output = value(convolution.name, &[1, convolution.outputs, 0, 0]);
        graph = graph.message(1, node).message(5, kernel).message(12, output);
        present = convolution.name;
    }
    model(graph.message(11, value("image", shape)))
}
