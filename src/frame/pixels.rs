//! Reads intensities out of the bytes of a frame.
//!
//! YUV is of BT.601 with the range of video, 16 to 235, as OpenCV and so `cv_bridge` read it. The colour of a mosaic
//! is that of the block of 2 x 2 sites which the pixel is in, green as the mean of two: half the sensor's resolution,
//! shifted by no more than half a pixel. 16 bits are read between the frame's levels.

use super::{Encoding, Frame, Levels};

/// Weights of red, green and blue in luma (ITU-R BT.601).
const LUMA: [f32; 3] = [0.299, 0.587, 0.114];
/// YUV of video range to intensities: of Y less 16, and for red, green and blue of U and V less 128 (ITU-R BT.601).
const Y_SCALE: f32 = 255.0 / 219.0;
const UV_SCALES: [[f32; 2]; 3] = [[0.0, 1.596], [-0.392, -0.813], [2.017, 0.0]];

/// Which intensity of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plane {
    /// Red.
    Red,
    /// Green.
    Green,
    /// Blue.
    Blue,
    /// The weighted sum of the three.
    Luma,
}

impl Plane {
    /// Those of a colour image.
    pub const COLOURS: [Self; 3] = [Self::Red, Self::Green, Self::Blue];

    /// How much of red, green and blue is in it.
    const fn weights(self) -> [f32; 3] {
        match self {
            Self::Red => [1.0, 0.0, 0.0],
            Self::Green => [0.0, 1.0, 0.0],
            Self::Blue => [0.0, 0.0, 1.0],
            Self::Luma => LUMA,
        }
    }

    /// Which of red, green and blue it is alone.
    const fn channel(self) -> Option<usize> {
        match self {
            Self::Red => Some(0),
            Self::Green => Some(1),
            Self::Blue => Some(2),
            Self::Luma => None,
        }
    }
}

impl Frame<'_> {
    /// Fills `out` with the intensities, 0 to 255, of the pixels of row `y` from column `left` on. Every plane of an
    /// image without colour is its grey.
    pub fn line(&self, y: usize, left: usize, plane: Plane, out: &mut [f32]) {
        let row = &self.data[y * self.step..];
        match self.encoding {
            Encoding::Mono8 => fill(out, &row[left..], |[v]| f32::from(v)),
            Encoding::Mono16 => fill(out, &row[2 * left..], between(self.levels, u16::from_le_bytes)),
            Encoding::Mono16Be => fill(out, &row[2 * left..], between(self.levels, u16::from_be_bytes)),
            Encoding::Rgb8 => interleaved::<3>(out, &row[3 * left..], [0, 1, 2], plane),
            Encoding::Bgr8 => interleaved::<3>(out, &row[3 * left..], [2, 1, 0], plane),
            Encoding::Rgba8 => interleaved::<4>(out, &row[4 * left..], [0, 1, 2], plane),
            Encoding::Bgra8 => interleaved::<4>(out, &row[4 * left..], [2, 1, 0], plane),
            Encoding::Uyvy => self.yuv(y, left, plane, out, |x| [2 * x + 1, 4 * (x / 2), 4 * (x / 2) + 2]),
            Encoding::Yuyv => self.yuv(y, left, plane, out, |x| [2 * x, 4 * (x / 2) + 1, 4 * (x / 2) + 3]),
            Encoding::Nv12 => self.two_planes(y, left, plane, out, [0, 1]),
            Encoding::Nv21 => self.two_planes(y, left, plane, out, [1, 0]),
            Encoding::BayerRggb8 => self.mosaic(y, left, plane, out, [0, 0]),
            Encoding::BayerBggr8 => self.mosaic(y, left, plane, out, [1, 1]),
            Encoding::BayerGbrg8 => self.mosaic(y, left, plane, out, [0, 1]),
            Encoding::BayerGrbg8 => self.mosaic(y, left, plane, out, [1, 0]),
        }
    }

    /// Red, green and blue of the pixel in column `x` of row `y`; grey thrice for mono.
    pub fn rgb(&self, x: usize, y: usize) -> [u8; 3] {
        Plane::COLOURS.map(|plane| {
            let mut value = [0.0];
            self.line(y, x, plane, &mut value);
            value[0].round() as u8
        })
    }

    /// A row of YUV; `places` gives those of Y, U and V within the row by column.
    fn yuv(&self, y: usize, left: usize, plane: Plane, out: &mut [f32], places: impl Fn(usize) -> [usize; 3]) {
        let row = &self.data[y * self.step..];
        let mix = Mix::new(plane);
        for (i, value) in out.iter_mut().enumerate() {
            *value = mix.of(places(left + i).map(|at| row[at]));
        }
    }

    /// A row of Y, with the row of pairs of colour that belongs to it; `order` gives the places of U and V in a pair.
    fn two_planes(&self, y: usize, left: usize, plane: Plane, out: &mut [f32], order: [usize; 2]) {
        let luma = &self.data[y * self.step..];
        let colour = &self.data[(self.height as usize + y / 2) * self.step..];
        let mix = Mix::new(plane);
        for (x, value) in (left..).zip(out) {
            let pair = x & !1;
            *value = mix.of([luma[x], colour[pair + order[0]], colour[pair + order[1]]]);
        }
    }

    /// A row of a mosaic whose blocks have red in this column and row, blue opposite, green in the two others.
    fn mosaic(&self, y: usize, left: usize, plane: Plane, out: &mut [f32], red: [usize; 2]) {
        let [r, g, b] = plane.weights();
        let top = (y & !1) * self.step;
        let rows = [&self.data[top..], &self.data[top + self.step..]];
        let [across, down] = red;
        for (x, value) in (left..).zip(out) {
            let block = x & !1;
            let site = |i: usize, j: usize| f32::from(rows[j][block + i]);
            let green = 0.5 * (site(1 - across, down) + site(across, 1 - down));
            *value = r * site(across, down) + g * green + b * site(1 - across, 1 - down);
        }
    }
}

/// Each value from the bytes of its pixel.
fn fill<const N: usize>(out: &mut [f32], bytes: &[u8], of: impl Fn([u8; N]) -> f32) {
    let (pixels, _) = bytes.as_chunks::<N>();
    out.iter_mut().zip(pixels).for_each(|(value, pixel)| *value = of(*pixel));
}

/// The intensity of 16-bit values.
fn between(levels: Levels, value: impl Fn([u8; 2]) -> u16) -> impl Fn([u8; 2]) -> f32 {
    let black = f32::from(levels.black);
    let scale = 255.0 / (f32::from(levels.white) - black);
    move |bytes| ((f32::from(value(bytes)) - black) * scale).clamp(0.0, 255.0)
}

/// Pixels of `N` bytes with red, green and blue in these places.
fn interleaved<const N: usize>(out: &mut [f32], bytes: &[u8], places: [usize; 3], plane: Plane) {
    match plane.channel() {
        Some(channel) => {
            let at = places[channel];
            fill::<N>(out, bytes, |pixel| f32::from(pixel[at]));
        }
        None => {
            let weights = plane.weights();
            fill::<N>(out, bytes, |pixel| weights.iter().zip(places).map(|(w, at)| w * f32::from(pixel[at])).sum());
        }
    }
}

/// The weights by which Y, U and V make an intensity.
struct Mix {
    u: f32,
    v: f32,
}

impl Mix {
    fn new(plane: Plane) -> Self {
        let weighted = |i: usize| plane.weights().iter().zip(UV_SCALES).map(|(w, scales)| w * scales[i]).sum();
        Self { u: weighted(0), v: weighted(1) }
    }

    fn of(&self, yuv: [u8; 3]) -> f32 {
        let [y, u, v] = yuv.map(f32::from);
        (Y_SCALE * (y - 16.0) + self.u * (u - 128.0) + self.v * (v - 128.0)).clamp(0.0, 255.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Repeatable bytes.
    fn noise(count: usize) -> Vec<u8> {
        (0..count).map(|i| ((i * i * 31 + i * 17 + 5) % 251) as u8).collect()
    }

    #[test]
    fn pixels_are_read_in_the_order_of_their_encoding() {
        let data = [1u8, 2, 3, 4, 5, 6, 7, 8];
        let at = |encoding| Frame::new(&data, 2, 1, 8, encoding, None).unwrap().rgb(1, 0);
        assert_eq!(at(Encoding::Rgb8), [4, 5, 6]);
        assert_eq!(at(Encoding::Bgr8), [6, 5, 4]);
        assert_eq!(at(Encoding::Rgba8), [5, 6, 7]);
        assert_eq!(at(Encoding::Bgra8), [7, 6, 5]);
        assert_eq!(at(Encoding::Mono8), [2, 2, 2]);
    }

    /// What the rows of an encoding mean, by its definition.
    #[test]
    fn each_encoding_is_read_as_it_is_defined() {
        const WIDTH: usize = 6;
        const HEIGHT: usize = 4;
        let close = |a: [f64; 3], b: [u8; 3]| a.iter().zip(b).all(|(a, b)| (a - f64::from(b)).abs() <= 0.51);
        let of_yuv = |y: u8, u: u8, v: u8| {
            let [y, u, v] = [f64::from(y) - 16.0, f64::from(u) - 128.0, f64::from(v) - 128.0];
            let y = 255.0 / 219.0 * y;
            [y + 1.596 * v, y - 0.392 * u - 0.813 * v, y + 2.017 * u].map(|c| c.clamp(0.0, 255.0))
        };
        for (encoding, bytes) in [
            (Encoding::Mono16, 2),
            (Encoding::Mono16Be, 2),
            (Encoding::Uyvy, 2),
            (Encoding::Yuyv, 2),
            (Encoding::Nv12, 1),
            (Encoding::Nv21, 1),
            (Encoding::BayerRggb8, 1),
            (Encoding::BayerBggr8, 1),
            (Encoding::BayerGbrg8, 1),
            (Encoding::BayerGrbg8, 1),
        ] {
            let step = WIDTH * bytes + 3;
            let data = noise(step * HEIGHT * 2);
            let frame = Frame::new(&data, WIDTH as u32, HEIGHT as u32, step, encoding, None).unwrap();
            for (x, y) in (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y))) {
                let row = |y: usize| &data[y * step..(y + 1) * step];
                let site = |name: &str, colour: u8| {
                    let sites = (0..4).filter(|i| name.as_bytes()[*i] == colour);
                    let values: Vec<f64> =
                        sites.map(|i| f64::from(row((y / 2) * 2 + i / 2)[(x / 2) * 2 + i % 2])).collect();
                    values.iter().sum::<f64>() / values.len() as f64
                };
                let mosaic = |name| [b'r', b'g', b'b'].map(|colour| site(name, colour));
                let pair = &row(y)[x / 2 * 2 * bytes..];
                let below = &row(HEIGHT + y / 2)[x / 2 * 2..];
                let want = match encoding {
                    Encoding::Mono16 => [(f64::from(row(y)[2 * x + 1]) * 256.0 + f64::from(row(y)[2 * x])) / 257.0; 3],
                    Encoding::Mono16Be => {
                        [(f64::from(row(y)[2 * x]) * 256.0 + f64::from(row(y)[2 * x + 1])) / 257.0; 3]
                    }
                    Encoding::Uyvy => of_yuv(pair[1 + 2 * (x % 2)], pair[0], pair[2]),
                    Encoding::Yuyv => of_yuv(pair[2 * (x % 2)], pair[1], pair[3]),
                    Encoding::Nv12 => of_yuv(row(y)[x], below[0], below[1]),
                    Encoding::Nv21 => of_yuv(row(y)[x], below[1], below[0]),
                    Encoding::BayerRggb8 => mosaic("rggb"),
                    Encoding::BayerBggr8 => mosaic("bggr"),
                    Encoding::BayerGbrg8 => mosaic("gbrg"),
                    _ => mosaic("grbg"),
                };
                let got = frame.rgb(x, y);
                assert!(close(want, got), "{encoding:?} at {x}, {y}: {got:?}, expected {want:?}");
                let mut luma = [0.0; WIDTH];
                frame.line(y, 0, Plane::Luma, &mut luma);
                if !encoding.is_colour() {
                    assert_eq!(luma[x].round(), f32::from(got[0]));
                } else if encoding.bytes() == 1 && encoding.block() == [2, 2] && encoding.colour_rows(2) == 0 {
                    let want: f64 = want.iter().zip(LUMA).map(|(c, w)| c * f64::from(w)).sum();
                    assert!((f64::from(luma[x]) - want).abs() < 0.01, "{encoding:?}");
                }
            }
        }
    }

    #[test]
    fn sixteen_bits_are_read_between_the_levels() {
        let values: [u16; 4] = [900, 1000, 2500, 4100];
        let little: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let big: Vec<u8> = values.iter().flat_map(|v| v.to_be_bytes()).collect();
        for (data, encoding) in [(little, Encoding::Mono16), (big, Encoding::Mono16Be)] {
            let frame = Frame::new(&data, 4, 1, 8, encoding, None).unwrap();
            let read = |frame: Frame| [0, 1, 2, 3].map(|x| frame.rgb(x, 0)[1]);
            assert_eq!(read(frame), [4, 4, 10, 16]);
            assert_eq!(read(frame.with_levels(Levels { black: 1000, white: 4000 })), [0, 0, 128, 255]);
            assert_eq!(read(frame.with_levels(Levels { black: 4000, white: 1000 })), [255, 255, 128, 0]);
        }
    }

    #[test]
    fn pure_colours_of_yuv_are_what_they_are_called() {
        // Y, U, V of red, green, blue and white in the range of video.
        for (yuv, rgb) in [
            ([81, 90, 240], [255, 0, 0]),
            ([145, 54, 34], [0, 255, 0]),
            ([41, 240, 110], [0, 0, 255]),
            ([235, 128, 128], [255, 255, 255]),
            ([16, 128, 128], [0, 0, 0]),
        ] {
            let data = [yuv[1], yuv[0], yuv[2], yuv[0]];
            let got = Frame::new(&data, 2, 1, 4, Encoding::Uyvy, None).unwrap().rgb(1, 0);
            assert!(got.iter().zip(rgb).all(|(g, w)| g.abs_diff(w) <= 2), "{got:?} for {rgb:?}");
        }
    }
}
