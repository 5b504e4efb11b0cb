//! Depthwise convolutions: of each channel by its own kernel.
//!
//! A channel is laid out with its padding, and so that what one tap meets lies side by side. All outputs are one long
//! row then; the few of it that begin in the padding are computed and left out.

use multiversion::multiversion;
use rayon::prelude::*;
use rten::Value;
use rten_tensor::prelude::*;
use rten_tensor::{NdTensor, TensorView};

use super::backend::RunError;
use super::stages::{Limits, Separate};

/// Outputs that are summed at once.
const BLOCK: usize = 32;

/// A convolution of each channel by its own kernel. Pairs are of rows and columns.
#[derive(Clone, Debug)]
pub(super) struct Depthwise {
    kernel: [usize; 2],
    stride: [usize; 2],
    /// Zeros before the first and behind the last pixel.
    padding: [[usize; 2]; 2],
    /// Channels x rows x columns.
    kernels: Vec<f32>,
    /// One for each channel.
    biases: Vec<f32>,
    /// The least and the highest value that is made.
    limits: [f32; 2],
}

impl Depthwise {
    /// What a file tells of, with the values that it holds: kernels, channels x 1 x rows x columns, biases and limits.
    /// `None` if it is no depthwise convolution of floats.
    pub fn new(told: &Separate, value: impl Fn(&str) -> Option<Value>) -> Option<Self> {
        let kernels = value(&told.kernels)?;
        let kernels = kernels.as_tensor_view::<f32>()?;
        let &[channels, 1, rows, cols] = kernels.shape() else { return None };
        let biases = match &told.biases {
            Some(biases) => value(biases)?.as_tensor_view::<f32>()?.to_vec(),
            None => vec![0.0; channels],
        };
        let number = |name: &String| value(name)?.as_tensor_view::<f32>()?.item().copied();
        let limits = match &told.limits {
            Limits::None => [f32::NEG_INFINITY, f32::INFINITY],
            Limits::Positive => [0.0, f32::INFINITY],
            Limits::Held([least, most]) => [number(least)?, number(most)?],
        };
        let fits = told.groups == channels && biases.len() == channels && rows > 0 && cols > 0;
        let Separate { stride, padding, .. } = *told;
        fits.then(|| Self { kernel: [rows, cols], stride, padding, kernels: kernels.to_vec(), biases, limits })
    }

    /// Convolves an image, 1 x channels x rows x columns, on the threads of the pool that it is called in.
    ///
    /// # Errors
    /// It is another shape.
    pub fn run(&self, image: TensorView<f32>) -> Result<NdTensor<f32, 4>, RunError> {
        let channels = self.biases.len();
        let sides = match *image.shape() {
            [1, all, rows, cols] if all == channels => self.sides([rows, cols]),
            _ => None,
        };
        let Some((input, output)) = sides else {
            let why = format!("a convolution of {channels} channels is given {:?}", image.shape());
            return Err(RunError::Library { why });
        };
        let image = image.to_contiguous();
        let [plane, taps, area] = [input, self.kernel, output].map(|[rows, cols]| rows * cols);
        let mut outputs = vec![0.0; channels * area];
        // A few runs of channels for each thread.
        let run = channels.div_ceil(4 * rayon::current_num_threads());
        let planes = image.data().par_chunks(run * plane).zip(self.kernels.par_chunks(run * taps));
        let planes = planes.zip(self.biases.par_chunks(run));
        outputs.par_chunks_mut(run * area).zip(planes).for_each(|(outputs, ((planes, kernels), biases))| {
            self.convolve(input, output, planes, kernels, biases, outputs);
        });
        Ok(NdTensor::from_data([1, channels, output[0], output[1]], outputs))
    }

    /// Rows and columns of an image and of what is made of it; `None` if the kernel does not fit into it.
    fn sides(&self, input: [usize; 2]) -> Option<([usize; 2], [usize; 2])> {
        let mut output = [0; 2];
        for i in 0..2 {
            let room = (input[i] + self.padding[0][i] + self.padding[1][i]).checked_sub(self.kernel[i])?;
            output[i] = room / self.stride[i] + 1;
        }
        (input[0] * input[1] > 0).then_some((input, output))
    }

    /// Convolves some channels: their pixels, their kernels, their biases.
    fn convolve(
        &self,
        input: [usize; 2],
        output: [usize; 2],
        planes: &[f32],
        kernels: &[f32],
        biases: &[f32],
        outputs: &mut [f32],
    ) {
        let layout = Phases::new(self, output);
        let taps = layout.taps(self.kernel);
        let mut pixels = vec![0.0; layout.size()];
        let mut sums = vec![0.0; (output[0] * layout.phase[1]).next_multiple_of(BLOCK)];
        let channels = planes.chunks_exact(input[0] * input[1]).zip(kernels.chunks_exact(taps.len()));
        let outputs = outputs.chunks_exact_mut(output[0] * output[1]);
        for (((plane, kernel), &bias), target) in channels.zip(biases).zip(outputs) {
            for (row, values) in plane.chunks_exact(input[1]).enumerate() {
                layout.put(row + self.padding[0][0], self.padding[0][1], values, &mut pixels);
            }
            correlate(&pixels, &taps, kernel, bias, self.limits, &mut sums);
            for (target, sums) in target.chunks_exact_mut(output[1]).zip(sums.chunks(layout.phase[1])) {
                target.copy_from_slice(&sums[..target.len()]);
            }
        }
    }
}

/// How a channel with its padding lies in memory: as phases, which are the pixels that are a stride apart, row after
/// row.
struct Phases {
    stride: [usize; 2],
    /// Sides of a phase.
    phase: [usize; 2],
}

impl Phases {
    /// That holds all that the outputs of a convolution are made of.
    fn new(Depthwise { kernel, stride, .. }: &Depthwise, output: [usize; 2]) -> Self {
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

/// For each output the bias and the sum of the pixels that the taps meet, within limits; there are whole blocks of
/// outputs.
#[multiversion(targets("x86_64+avx2+fma"))]
fn correlate(pixels: &[f32], taps: &[usize], kernel: &[f32], bias: f32, [least, most]: [f32; 2], outputs: &mut [f32]) {
    for (block, outputs) in outputs.chunks_exact_mut(BLOCK).enumerate() {
        let pixels = &pixels[block * BLOCK..];
        let mut sums = [bias; BLOCK];
        for (&tap, weight) in taps.iter().zip(kernel) {
            let met = &pixels[tap..tap + BLOCK];
            sums.iter_mut().zip(met).for_each(|(sum, pixel)| *sum += weight * pixel);
        }
        for (output, &sum) in outputs.iter_mut().zip(&sums) {
            // What is no number stays none.
            let above = if sum < least { least } else { sum };
            *output = if above > most { most } else { above };
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;
    use rten::ThreadPool;

    use super::*;

    /// What values are limited to.
    const LIMITS: [f32; 2] = [-0.5, 1.0];

    /// A convolution of an image.
    #[derive(Clone, Copy, Debug)]
    struct Case {
        channels: usize,
        rows: usize,
        cols: usize,
        kernel: [usize; 2],
        stride: [usize; 2],
        padding: [[usize; 2]; 2],
    }

    impl Case {
        fn convolution(&self) -> Depthwise {
            let Case { channels, kernel, stride, padding, .. } = *self;
            let kernels = noise(channels * kernel[0] * kernel[1], 1);
            Depthwise { kernel, stride, padding, kernels, biases: noise(channels, 2), limits: LIMITS }
        }

        fn image(&self) -> Vec<f32> {
            noise(self.channels * self.rows * self.cols, 3)
        }

        /// By the definition, with sums of 64 bits: the outputs, and rows and columns of a channel.
        fn by_definition(&self) -> (Vec<f32>, [usize; 2]) {
            let Case { channels, rows, cols, kernel, stride, padding } = *self;
            let sides = [[rows, kernel[0], stride[0]], [cols, kernel[1], stride[1]]];
            let mut count = [0; 2];
            for (i, [side, taps, step]) in sides.into_iter().enumerate() {
                count[i] = (side + padding[0][i] + padding[1][i] - taps) / step + 1;
            }
            let (image, convolution) = (self.image(), self.convolution());
            let mut outputs = Vec::new();
            for (channel, row, col) in places(channels, count) {
                let mut sum = f64::from(convolution.biases[channel]);
                for (y, x) in (0..kernel[0]).flat_map(|y| (0..kernel[1]).map(move |x| (y, x))) {
                    let at = [row * stride[0] + y, col * stride[1] + x];
                    let Some(pixel_row) = at[0].checked_sub(padding[0][0]).filter(|&r| r < rows) else { continue };
                    let Some(pixel_col) = at[1].checked_sub(padding[0][1]).filter(|&c| c < cols) else { continue };
                    let weight = convolution.kernels[(channel * kernel[0] + y) * kernel[1] + x];
                    sum += f64::from(weight) * f64::from(image[(channel * rows + pixel_row) * cols + pixel_col]);
                }
                outputs.push((sum as f32).clamp(LIMITS[0], LIMITS[1]));
            }
            (outputs, count)
        }
    }

    /// Every channel, row and column, in this order.
    fn places(channels: usize, [rows, cols]: [usize; 2]) -> impl Iterator<Item = (usize, usize, usize)> {
        (0..channels * rows * cols).map(move |i| (i / (rows * cols), i / cols % rows, i % cols))
    }

    /// Numbers from -1 to 1, which seem random.
    fn noise(count: usize, seed: u32) -> Vec<f32> {
        let number = |i: u32| (i * 2 + seed).wrapping_mul(0x9E37_79B1).rotate_left(13).wrapping_mul(0x85EB_CA6B);
        (0..count as u32).map(|i| number(i) as i32 as f32 / i32::MAX as f32).collect()
    }

    const CASE: Case =
        Case { channels: 3, rows: 12, cols: 13, kernel: [3, 3], stride: [1, 1], padding: [[1, 1], [1, 1]] };

    #[test]
    fn does_what_the_definition_says() {
        let cases = [
            CASE,
            Case { kernel: [5, 5], padding: [[2, 2], [2, 2]], ..CASE },
            Case { kernel: [5, 3], padding: [[2, 0], [1, 2]], rows: 40, cols: 70, ..CASE },
            Case { stride: [2, 2], padding: [[0, 0], [1, 1]], rows: 48, cols: 48, ..CASE },
            Case { stride: [2, 2], kernel: [5, 5], padding: [[1, 1], [2, 2]], rows: 24, ..CASE },
            Case { stride: [2, 3], kernel: [2, 5], padding: [[0, 0], [0, 0]], ..CASE },
            Case { stride: [3, 2], kernel: [1, 1], padding: [[0, 0], [0, 0]], ..CASE },
            Case { stride: [1, 3], kernel: [1, 1], padding: [[3, 4], [5, 2]], ..CASE },
            Case { stride: [4, 4], kernel: [2, 2], padding: [[1, 1], [0, 0]], rows: 9, cols: 2, ..CASE },
            Case { rows: 1, cols: 1, channels: 1, ..CASE },
            // Enough of it for several threads.
            Case { channels: 96, rows: 96, cols: 96, ..CASE },
        ];
        cases.iter().for_each(agrees);
    }

    fn agrees(case: &Case) {
        let (expected, [rows, cols]) = case.by_definition();
        let image = case.image();
        let image = || TensorView::from_data(&[1, case.channels, case.rows, case.cols], image.as_slice());
        for threads in [1, 2] {
            let made = ThreadPool::with_num_threads(threads).run(|| case.convolution().run(image())).unwrap();
            assert_eq!(made.shape(), [1, case.channels, rows, cols], "{case:?}");
            // Sums of at most 26 numbers up to 1.
            let is_near = |(a, b): (&f32, &f32)| (a - b).abs() < 4e-6;
            assert!(made.to_vec().iter().zip(&expected).all(is_near), "{case:?}");
        }
    }

    prop_compose! {
        /// Any geometry in which the kernel fits into the image with its padding.
        fn cases()(
            channels in 1usize..6,
            [rows, cols] in prop::array::uniform2(1usize..24),
            kernel in prop::array::uniform2(1usize..6),
            stride in prop::array::uniform2(1usize..5),
            padding in prop::array::uniform2(prop::array::uniform2(0usize..5)),
        ) -> Case {
            let least = |axis: usize| kernel[axis].saturating_sub(padding[0][axis] + padding[1][axis]);
            let (rows, cols) = (rows.max(least(0)), cols.max(least(1)));
            Case { channels, rows, cols, kernel, stride, padding }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            rng_seed: RngSeed::Fixed(1), failure_persistence: None, ..ProptestConfig::with_cases(64)
        })]

        #[test]
        fn does_what_the_definition_says_of_any_geometry(case in cases()) {
            agrees(&case);
        }
    }

    #[test]
    fn an_image_that_does_not_fit_is_an_error() {
        let convolution = CASE.convolution();
        for shape in [[1, 2, 8, 8], [2, 3, 8, 8], [1, 3, 0, 8]] {
            let image = vec![0.0; shape.iter().product()];
            let error = convolution.run(TensorView::from_data(&shape, image.as_slice())).unwrap_err();
            assert_eq!(error.to_string(), format!("a convolution of 3 channels is given {shape:?}"));
        }
    }
}
