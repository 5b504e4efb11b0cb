//! Depthwise convolutions for tract, whose own take nearly half the time of the embedded network: it computes an output
//! row by itself, and its ends, or all of it where the stride is not one, without vectors.
//!
//! Here a channel is laid out with its padding, and so that what one tap meets lies side by side. All outputs are one
//! long row then; the few of it that begin in the padding are computed and left out.

use multiversion::multiversion;
use tract_linalg::multithread::par_chunks_mut;
use tract_onnx::prelude::*;
use tract_onnx::tract_core::ops::cnn::conv::{Conv, KernelFormat};
use tract_onnx::tract_core::ops::nn::DataFormat;
use tract_onnx::tract_hir::internal::*;

/// Outputs that are summed at once.
const BLOCK: usize = 32;

/// A convolution of each channel by its own kernel. Inputs: an image of channels x rows x columns, maybe with a first
/// axis of one; kernels, channels x 1 x rows x columns; a bias for each channel. Pairs here are of rows and columns.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Depthwise {
    input: [usize; 2],
    kernel: [usize; 2],
    stride: [usize; 2],
    /// Zeros before the first pixel.
    padding: [usize; 2],
    output: [usize; 2],
}

/// Puts such operations in the place of tract's where they do the same, and counts them.
pub(super) fn replace(model: &mut TypedModel) -> TractResult<usize> {
    let found: Vec<(usize, Depthwise)> =
        model.nodes.iter().filter_map(|node| Some((node.id, Depthwise::of(model, node)?))).collect();
    let count = found.len();
    for (id, operation) in found {
        let node = model.node(id);
        TypedModelPatch::replace_single_op(model, node, &node.inputs, operation)?.apply(model)?;
    }
    Ok(count)
}

impl Depthwise {
    /// What does the same as a node, if that is a depthwise convolution without dilation.
    fn of(model: &TypedModel, node: &TypedNode) -> Option<Self> {
        let conv = node.op_as::<Conv>()?;
        let pool = &conv.pool_spec;
        let facts = node.inputs.iter().map(|input| model.outlet_fact(*input)).collect::<TractResult<TVec<_>>>().ok()?;
        let shapes = facts.iter().map(|fact| fact.shape.as_concrete()).collect::<Option<TVec<_>>>()?;
        let &[&[ref batch @ .., channels, rows, cols], kernels, biases] = shapes.as_slice() else { return None };
        let &[kernel_rows, kernel_cols] = pool.kernel_shape.as_slice() else { return None };
        let same = facts.iter().all(|fact| fact.datum_type == f32::datum_type())
            && conv.q_params.is_none()
            && conv.kernel_fmt == KernelFormat::OIHW
            && matches!(pool.data_format, DataFormat::NCHW | DataFormat::CHW)
            && batch.iter().all(|&images| images == 1)
            && kernels == [channels, 1, kernel_rows, kernel_cols]
            && biases == [channels]
            && conv.group == channels
            && pool.dilations().iter().all(|&dilation| dilation == 1);
        let sides = pool.computed_padding(&[rows, cols]);
        (same && sides.iter().all(|side| side.convoluted > 0)).then(|| Self {
            input: [rows, cols],
            kernel: [kernel_rows, kernel_cols],
            stride: [pool.stride(0), pool.stride(1)],
            padding: [sides[0].pad_before, sides[1].pad_before],
            output: [sides[0].convoluted, sides[1].convoluted],
        })
    }

    /// Convolves some channels: their pixels, their kernels, their biases.
    fn convolve(&self, planes: &[f32], kernels: &[f32], biases: &[f32], outputs: &mut [f32]) {
        let layout = Layout::new(self);
        let taps = layout.taps(self.kernel);
        let mut pixels = vec![0.0; layout.size()];
        let mut sums = vec![0.0; (self.output[0] * layout.phase[1]).next_multiple_of(BLOCK)];
        let channels = planes.chunks_exact(self.input[0] * self.input[1]).zip(kernels.chunks_exact(taps.len()));
        let outputs = outputs.chunks_exact_mut(self.output[0] * self.output[1]);
        for (((plane, kernel), &bias), output) in channels.zip(biases).zip(outputs) {
            for (row, values) in plane.chunks_exact(self.input[1]).enumerate() {
                layout.put(row + self.padding[0], self.padding[1], values, &mut pixels);
            }
            correlate(&pixels, &taps, kernel, bias, &mut sums);
            for (output, sums) in output.chunks_exact_mut(self.output[1]).zip(sums.chunks(layout.phase[1])) {
                output.copy_from_slice(&sums[..output.len()]);
            }
        }
    }
}

/// How a channel with its padding lies in memory: as phases, which are the pixels that are a stride apart, row after
/// row.
struct Layout {
    stride: [usize; 2],
    /// Sides of a phase.
    phase: [usize; 2],
}

impl Layout {
    /// That holds all that the outputs of a convolution are made of.
    fn new(Depthwise { kernel, stride, output, .. }: &Depthwise) -> Self {
        Self { stride: *stride, phase: std::array::from_fn(|i| output[i] + (kernel[i] - 1) / stride[i]) }
    }

    /// Numbers in it, with those that the last block of outputs meets behind the end.
    fn size(&self) -> usize {
        let [phases, numbers] = [self.stride, self.phase].map(|[rows, cols]| rows * cols);
        phases * numbers + self.phase[1] + BLOCK
    }

    /// Where a pixel lies, counted with the padding.
    fn place(&self, row: usize, col: usize) -> usize {
        let phase = row % self.stride[0] * self.stride[1] + col % self.stride[1];
        (phase * self.phase[0] + row / self.stride[0]) * self.phase[1] + col / self.stride[1]
    }

    /// Where the taps of the first output lie; those of the others lie as much further as they do.
    fn taps(&self, [rows, cols]: [usize; 2]) -> Vec<usize> {
        (0..rows).flat_map(|row| (0..cols).map(move |col| self.place(row, col))).collect()
    }

    /// Puts a row of pixels, from column `begin` on, in their places; those which no output meets have none.
    fn put(&self, row: usize, begin: usize, values: &[f32], pixels: &mut [f32]) {
        if row / self.stride[0] >= self.phase[0] {
            return;
        }
        for first in 0..self.stride[1].min(values.len()) {
            let col = begin + first;
            let place = self.place(row, col);
            let room = &mut pixels[place..place + self.phase[1].saturating_sub(col / self.stride[1])];
            match self.stride[1] {
                1 => {
                    let count = room.len().min(values.len());
                    room[..count].copy_from_slice(&values[..count]);
                }
                stride => room.iter_mut().zip(values[first..].iter().step_by(stride)).for_each(|(p, v)| *p = *v),
            }
        }
    }
}

/// For each output the bias and the sum of the pixels that the taps meet; there are whole blocks of outputs.
#[multiversion(targets("x86_64+avx2+fma"))]
fn correlate(pixels: &[f32], taps: &[usize], kernel: &[f32], bias: f32, outputs: &mut [f32]) {
    for (block, outputs) in outputs.chunks_exact_mut(BLOCK).enumerate() {
        let pixels = &pixels[block * BLOCK..];
        let mut sums = [bias; BLOCK];
        for (&tap, weight) in taps.iter().zip(kernel) {
            let met = &pixels[tap..tap + BLOCK];
            sums.iter_mut().zip(met).for_each(|(sum, pixel)| *sum += weight * pixel);
        }
        outputs.copy_from_slice(&sums);
    }
}

impl Op for Depthwise {
    fn name(&self) -> StaticName {
        "Depthwise".into()
    }

    op_as_typed_op!();
}

impl EvalOp for Depthwise {
    op_out_of_plan!();

    fn eval(&self, _: &EvalContext, inputs: TVec<TValue>) -> TractResult<TVec<TValue>> {
        let (image, kernels, biases) = args_3!(inputs);
        let shape = with_sides(image.shape().iter().copied(), self.output);
        let mut result = Tensor::zero::<f32>(&shape)?;
        let [image, kernels, biases] = [&image, &kernels, &biases].map(|input| input.try_as_plain_ram());
        let (image, kernels, biases) = (image?, kernels?, biases?);
        let (image, kernels, biases) = (image.as_slice()?, kernels.as_slice()?, biases.as_slice()?);
        let [plane, taps, area] = [self.input, self.kernel, self.output].map(|[rows, cols]| rows * cols);
        let mut outputs = result.try_as_plain_ram_mut()?;
        par_chunks_mut(outputs.as_slice_mut::<f32>()?, area, image.len(), |first, outputs| {
            let end = first + outputs.len() / area;
            let [planes, kernels] = [(image, plane), (kernels, taps)].map(|(all, each)| &all[first * each..end * each]);
            self.convolve(planes, kernels, &biases[first..end], outputs);
            Ok(())
        })?;
        Ok(tvec!(result.into_tvalue()))
    }
}

impl TypedOp for Depthwise {
    fn output_facts(&self, inputs: &[&TypedFact]) -> TractResult<TVec<TypedFact>> {
        let shape = with_sides(inputs[0].shape.iter().cloned(), self.output);
        Ok(tvec!(inputs[0].datum_type.fact(shape)))
    }

    as_op!();
}

/// A shape with other sides of the image.
fn with_sides<D: From<usize>>(shape: impl Iterator<Item = D>, sides: [usize; 2]) -> TVec<D> {
    let mut shape: TVec<D> = shape.collect();
    shape.truncate(shape.len() - sides.len());
    shape.extend(sides.map(D::from));
    shape
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;
    use tract_linalg::multithread::{Executor, multithread_tract_scope};
    use tract_onnx::tract_core::ops::cnn::{PaddingSpec, PoolSpec};

    use super::*;

    /// A convolution as tract has it, of images with or without a first axis.
    #[derive(Clone, Copy, Debug)]
    struct Case {
        channels: usize,
        batch: bool,
        rows: usize,
        cols: usize,
        kernel: [usize; 2],
        stride: [usize; 2],
        padding: [[usize; 2]; 2],
        dilation: usize,
    }

    impl Case {
        fn model(&self) -> TractResult<TypedModel> {
            let Case { channels, rows, cols, .. } = *self;
            let mut model = TypedModel::default();
            let batch = if self.batch { tvec!(1) } else { tvec!() };
            let shape: TVec<usize> = batch.into_iter().chain([channels, rows, cols]).collect();
            let image = model.add_source("image", f32::fact(&shape))?;
            let kernels = noise(&[channels, 1, self.kernel[0], self.kernel[1]], 1)?;
            let kernels = model.add_const("kernels", kernels)?;
            let biases = model.add_const("biases", noise(&[channels], 2)?)?;
            let [before, after] = self.padding.map(|side| TVec::from(side.as_slice()));
            let pool_spec = PoolSpec {
                data_format: if self.batch { DataFormat::NCHW } else { DataFormat::CHW },
                kernel_shape: self.kernel.as_slice().into(),
                padding: PaddingSpec::Explicit(before, after),
                dilations: Some(tvec!(self.dilation; 2)),
                strides: Some(self.stride.as_slice().into()),
                input_channels: channels,
                output_channels: channels,
            };
            let conv = Conv { pool_spec, kernel_fmt: KernelFormat::OIHW, group: channels, q_params: None };
            let output = model.wire_node("convolution", conv, &[image, kernels, biases])?;
            model.select_output_outlets(&output)?;
            Ok(model)
        }

        fn image(&self) -> TractResult<Tensor> {
            let shape = [1, self.channels, self.rows, self.cols];
            noise(&shape[usize::from(!self.batch)..], 3)
        }
    }

    /// Numbers from -1 to 1, which seem random.
    fn noise(shape: &[usize], seed: u32) -> TractResult<Tensor> {
        let count = shape.iter().product::<usize>() as u32;
        let number = |i: u32| (i * 2 + seed).wrapping_mul(0x9E37_79B1).rotate_left(13).wrapping_mul(0x85EB_CA6B);
        let values: Vec<f32> = (0..count).map(|i| number(i) as i32 as f32 / i32::MAX as f32).collect();
        Tensor::from_shape(shape, &values)
    }

    fn run(model: TypedModel, image: Tensor) -> TractResult<Tensor> {
        let outputs = model.into_optimized()?.into_runnable()?.run(tvec!(image.into_tvalue()))?;
        Ok(outputs[0].clone().into_tensor())
    }

    const CASE: Case = Case {
        channels: 3,
        batch: true,
        rows: 12,
        cols: 13,
        kernel: [3, 3],
        stride: [1, 1],
        padding: [[1, 1], [1, 1]],
        dilation: 1,
    };

    #[test]
    fn does_the_same_as_tract() -> TractResult<()> {
        let cases = [
            CASE,
            Case { batch: false, ..CASE },
            Case { kernel: [5, 5], padding: [[2, 2], [2, 2]], ..CASE },
            Case { kernel: [5, 3], padding: [[2, 0], [1, 2]], rows: 40, cols: 70, ..CASE },
            Case { stride: [2, 2], padding: [[0, 0], [1, 1]], rows: 48, cols: 48, ..CASE },
            Case { stride: [2, 2], kernel: [5, 5], padding: [[1, 1], [2, 2]], rows: 24, batch: false, ..CASE },
            Case { stride: [2, 3], kernel: [2, 5], padding: [[0, 0], [0, 0]], ..CASE },
            Case { stride: [3, 2], kernel: [1, 1], padding: [[0, 0], [0, 0]], ..CASE },
            Case { stride: [1, 3], kernel: [1, 1], padding: [[3, 4], [5, 2]], ..CASE },
            Case { stride: [4, 4], kernel: [2, 2], padding: [[1, 1], [0, 0]], rows: 9, cols: 2, ..CASE },
            Case { rows: 1, cols: 1, channels: 1, ..CASE },
            // Enough of it for several threads.
            Case { channels: 96, rows: 96, cols: 96, ..CASE },
        ];
        let threads = Executor::multithread(2);
        cases.iter().try_for_each(|case| agrees(case, &[&Executor::SingleThread, &threads], Approximation::Close))
    }

    fn agrees(case: &Case, executors: &[&Executor], nearly: Approximation) -> TractResult<()> {
        let mut model = case.model()?;
        let own = run(model.clone(), case.image()?)?;
        assert_eq!(replace(&mut model)?, 1, "{case:?}");
        for executor in executors {
            let replaced = multithread_tract_scope((*executor).clone(), || run(model.clone(), case.image()?))?;
            replaced.close_enough(&own, nearly).with_context(|| format!("{case:?}"))?;
        }
        Ok(())
    }

    /// Sums of at most 25 products of numbers up to 1, added in another order: absolute, relative, no outliers.
    const ROUNDED: Approximation = Approximation::Custom(4e-6, 1e-6, 0.0);

    prop_compose! {
        /// Any geometry in which the kernel fits into the image with its padding.
        fn cases()(
            (channels, batch) in (1usize..6, any::<bool>()),
            [rows, cols] in prop::array::uniform2(1usize..24),
            kernel in prop::array::uniform2(1usize..6),
            stride in prop::array::uniform2(1usize..5),
            padding in prop::array::uniform2(prop::array::uniform2(0usize..5)),
        ) -> Case {
            let least = |axis: usize| kernel[axis].saturating_sub(padding[0][axis] + padding[1][axis]);
            let (rows, cols) = (rows.max(least(0)), cols.max(least(1)));
            Case { channels, batch, rows, cols, kernel, stride, padding, dilation: 1 }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            rng_seed: RngSeed::Fixed(1), failure_persistence: None, ..ProptestConfig::with_cases(64)
        })]

        #[test]
        fn does_the_same_as_tract_of_any_geometry(case in cases()) {
            agrees(&case, &[&Executor::SingleThread], ROUNDED).map_err(|e| TestCaseError::fail(format!("{e:?}")))?;
        }
    }

    #[test]
    fn does_all_eleven_of_the_embedded_network() -> TractResult<()> {
        let mut file = crate::loader::EMBEDDED;
        let model = tract_onnx::onnx().model_for_read(&mut file)?;
        let mut model = model.with_input_fact(0, f32::fact([1, 3, 64, 64]).into())?.into_typed()?.into_decluttered()?;
        assert_eq!(replace(&mut model)?, 11);
        Ok(())
    }

    #[test]
    fn leaves_other_convolutions_alone() -> TractResult<()> {
        let mut dilated = Case { dilation: 2, ..CASE }.model()?;
        assert_eq!(replace(&mut dilated)?, 0);
        let mut full = TypedModel::default();
        let image = full.add_source("image", f32::fact([1, 2, 8, 8]))?;
        let kernels = full.add_const("kernels", noise(&[2, 2, 3, 3], 1)?)?;
        let biases = full.add_const("biases", noise(&[2], 2)?)?;
        let pool_spec =
            PoolSpec { kernel_shape: tvec!(3, 3), input_channels: 2, output_channels: 2, ..PoolSpec::default() };
        let conv = Conv { pool_spec, kernel_fmt: KernelFormat::OIHW, group: 1, q_params: None };
        let output = full.wire_node("convolution", conv, &[image, kernels, biases])?;
        full.select_output_outlets(&output)?;
        assert_eq!(replace(&mut full)?, 0);
        Ok(())
    }
}
