//! Writes a pair of matching networks with the sizes of published ones: a backbone of one convolution, and a head that
//! correlates the features of a template with those of a window and takes the target's sides for known.

use super::message::{Message, integers, model, tensor, value, weights};

/// Channels of the features.
const CHANNELS: usize = 12;
/// Cells along a side of template, window and answer.
const TEMPLATE: usize = 8;
const WINDOW: usize = 16;
pub const ANSWER: usize = 15;
/// Pixels along a side of the kernel, and from a cell to the next.
const KERNEL: usize = 15;
const STRIDE: usize = 16;
/// 64-bit integers, as the type of a tensor.
const INTEGER: u64 = 7;

/// One operation.
fn node(kind: &str, inputs: &[&str], output: &str, attributes: &[Message]) -> Message {
    let node = inputs.iter().fold(Message::default(), |node, input| node.text(1, input));
    let node = node.text(2, output).text(4, kind);
    attributes.iter().fold(node, |node, attribute| node.message(5, attribute.clone()))
}

fn shape(name: &str, sides: &[i64]) -> Message {
    let raw: Vec<u8> = sides.iter().flat_map(|side| side.to_le_bytes()).collect();
    tensor(name, &[sides.len()], INTEGER, &raw)
}

/// The backbone: `1 x 3 x window x window` as declared, features of `CHANNELS` channels. Kernels are of blocks, so that
/// they change little from a pixel to the next, and sum to zero, so that what is of one colour has no features.
pub fn backbone(window: usize, noise: impl Fn(usize) -> Vec<f32>) -> Vec<u8> {
    const BLOCKS: usize = 3;
    let blocks = noise(CHANNELS * 3 * BLOCKS * BLOCKS);
    let at = |side: usize| side * BLOCKS / KERNEL;
    let weight = |i: usize| {
        let (kernel, y, x) = (i / (KERNEL * KERNEL), i / KERNEL % KERNEL, i % KERNEL);
        blocks[(kernel * BLOCKS + at(y)) * BLOCKS + at(x)]
    };
    let mut kernels: Vec<f32> = (0..CHANNELS * 3 * KERNEL * KERNEL).map(weight).collect();
    for kernel in kernels.chunks_exact_mut(KERNEL * KERNEL) {
        let mean = kernel.iter().sum::<f32>() / kernel.len() as f32;
        kernel.iter_mut().for_each(|v| *v = (*v - mean) * 4e-5);
    }
    let attributes = [integers("kernel_shape", &[KERNEL; 2]), integers("strides", &[STRIDE; 2])];
    let graph = Message::default()
        .text(2, "backbone")
        .message(1, node("Conv", &["image", "kernels"], "features", &attributes))
        .message(5, weights("kernels", &[CHANNELS, 3, KERNEL, KERNEL], &kernels))
        .message(11, value("image", &[1, 3, window, window]))
        .message(12, value("features", &[1, CHANNELS, WINDOW, WINDOW]));
    model(graph)
}

/// The head. The logits are how much the window is like the template: each pixel of the template is correlated with the
/// window, the maps are added up as the template lies, twice, and half of what the window has there in squares is taken
/// away. The sides of the target are `sides` pixels of the window from its middle.
pub fn head(sides: [f32; 4]) -> Vec<u8> {
    let pixels = TEMPLATE * TEMPLATE;
    // Of the one logit with the other sign.
    let mut placed = vec![0.0; 2 * pixels * pixels];
    for (sign, kernel) in [-1.0, 1.0].into_iter().zip(placed.chunks_exact_mut(pixels * pixels)) {
        (0..pixels).for_each(|pixel| kernel[pixel * pixels + pixel] = 2.0 * sign);
    }
    let energy: Vec<f32> = [0.5, -0.5].into_iter().flat_map(|sign| vec![sign; CHANNELS * pixels]).collect();
    let padded = [integers("kernel_shape", &[TEMPLATE; 2]), integers("pads", &[3; 4])];
    let graph = Message::default()
        .text(2, "head")
        .message(1, node("Reshape", &["template", "flat"], "columns", &[]))
        .message(1, node("Transpose", &["columns"], "rows", &[integers("perm", &[0, 2, 1])]))
        .message(1, node("Reshape", &["window", "flat"], "cells", &[]))
        .message(1, node("MatMul", &["rows", "cells"], "correlations", &[]))
        .message(1, node("Reshape", &["correlations", "maps"], "planes", &[]))
        .message(1, node("Conv", &["planes", "placed"], "near", &padded))
        .message(1, node("Mul", &["window", "window"], "squares", &[]))
        .message(1, node("Conv", &["squares", "energy"], "far", &padded))
        .message(1, node("Add", &["near", "far"], "logits", &[]))
        .message(1, node("Conv", &["planes", "nothing", "sides"], "distances", &padded))
        .message(5, shape("flat", &[1, CHANNELS as i64, -1]))
        .message(5, shape("maps", &[1, pixels as i64, WINDOW as i64, WINDOW as i64]))
        .message(5, weights("placed", &[2, pixels, TEMPLATE, TEMPLATE], &placed))
        .message(5, weights("energy", &[2, CHANNELS, TEMPLATE, TEMPLATE], &energy))
        .message(5, weights("nothing", &[4, pixels, TEMPLATE, TEMPLATE], &vec![0.0; 4 * pixels * pixels]))
        .message(5, weights("sides", &[4], &sides))
        .message(11, value("template", &[1, CHANNELS, TEMPLATE, TEMPLATE]))
        .message(11, value("window", &[1, CHANNELS, WINDOW, WINDOW]))
        .message(12, value("logits", &[1, 2, ANSWER, ANSWER]))
        .message(12, value("distances", &[1, 4, ANSWER, ANSWER]));
    model(graph)
}

/// A pair that finds targets of half the template's side, in files.
pub fn files() -> [tempfile::NamedTempFile; 2] {
    let noise = |count: usize| {
        let mut state = 7u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 23) as f32 - 1.0
        };
        (0..count).map(|_| next()).collect()
    };
    [backbone(255, noise), head([32.0; 4])].map(|bytes| {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), bytes).unwrap();
        file
    })
}
