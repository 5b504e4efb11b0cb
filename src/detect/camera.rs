//! How a camera has moved between two pictures, as a rotation and a translation of the picture, and pictures put back
//! to where they were.

use multiversion::multiversion;

use crate::crop::Patch;
use crate::geometry::turned;

/// Takes places of the current picture to those of the reference: turned by `angle` about the middle of the picture,
/// then moved by `shift`. A camera that pans to the right sees things go to the left; its shift grows to the right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraMotion {
    /// From the x axis towards the y axis, in radians.
    pub angle: f64,
    /// In pixels, `[x, y]`.
    pub shift: [f64; 2],
    /// The middle of the picture, about which it turns.
    pub centre: [f64; 2],
}

impl CameraMotion {
    /// No motion of a picture of this size.
    pub fn none(width: usize, height: usize) -> Self {
        Self { angle: 0.0, shift: [0.0; 2], centre: [width as f64 / 2.0, height as f64 / 2.0] }
    }

    /// Where a place of the current picture is in the reference.
    pub fn apply(&self, place: [f64; 2]) -> [f64; 2] {
        let turned = turned([place[0] - self.centre[0], place[1] - self.centre[1]], self.angle);
        std::array::from_fn(|i| turned[i] + self.centre[i] + self.shift[i])
    }

    /// The motion from the reference to the current picture.
    pub fn inverse(&self) -> Self {
        let back = turned(self.shift, -self.angle);
        Self { angle: -self.angle, shift: back.map(|v| -v), centre: self.centre }
    }

    /// First this motion, then another about the same middle.
    pub fn then(&self, next: &Self) -> Self {
        let moved = turned(self.shift, next.angle);
        let shift = std::array::from_fn(|i| moved[i] + next.shift[i]);
        Self { angle: self.angle + next.angle, shift, centre: self.centre }
    }

    /// How far a place of the picture goes at most, in pixels.
    pub fn reach(&self) -> f64 {
        let turn = 2.0 * (0.5 * self.angle).sin().abs() * self.centre[0].hypot(self.centre[1]);
        self.shift[0].hypot(self.shift[1]) + turn
    }
}

/// Pixels of a row that [`warp`] works on together.
const STRETCH: usize = 64;
/// Along a line and down, weights of 8 bits are as fine as the values that they mix; together they make a whole.
const ONE: u32 = 256;
const WHOLE: u32 = ONE * ONE;

/// Fills `out`, of the same size, with what the current picture shows of the reference's places, interpolated linearly,
/// and `covered`, row-major, with 1 where it shows them. Elsewhere the picture's border goes on.
pub fn warp(current: &Patch, motion: &CameraMotion, out: &mut Patch, covered: &mut Vec<u8>) {
    let (width, height) = (current.width, current.height);
    out.resize(width, height, current.planes().len());
    covered.resize(width * height, 0);
    if width < 2 || height < 2 {
        // There is nothing to interpolate.
        out.planes_mut().iter_mut().zip(current.planes()).for_each(|(out, plane)| out.copy_from_slice(plane));
        covered.fill(1);
        return;
    }
    let back = motion.inverse();
    let (sin, cos) = back.angle.sin_cos();
    let mut sources = Sources { at: [0; STRETCH], weights: [[0; STRETCH]; 4] };
    for y in 0..height {
        let row = y * width..(y + 1) * width;
        for (i, covered) in covered[row.clone()].chunks_mut(STRETCH).enumerate() {
            // Places counted from the first pixel's centre.
            let first = back.apply([(i * STRETCH) as f64 + 0.5, y as f64 + 0.5]).map(|v| (v - 0.5) as f32);
            sources.locate(first, [cos as f32, sin as f32], [width, height], covered);
            let stretch = row.start + i * STRETCH..row.start + i * STRETCH + covered.len();
            for (plane, from) in out.planes_mut().iter_mut().zip(current.planes()) {
                sources.mix(from, width, &mut plane[stretch.clone()]);
            }
        }
    }
}

/// For each pixel of a stretch the first of the four pixels that it lies between, and their weights: the first's, its
/// right neighbour's, and those of the two below.
struct Sources {
    at: [u32; STRETCH],
    weights: [[u32; STRETCH]; 4],
}

impl Sources {
    /// The sources of pixels in a line from a first place on.
    fn locate(&mut self, first: [f32; 2], step: [f32; 2], [width, height]: [usize; 2], covered: &mut [u8]) {
        let mut inside = [0; STRETCH];
        locate(self, first, step, width as u32, height as u32, &mut inside);
        covered.copy_from_slice(&inside[..covered.len()]);
    }

    /// The values of a plane between its pixels.
    fn mix(&self, plane: &[u8], width: usize, out: &mut [u8]) {
        let [a, b, c, d] = &self.weights;
        for (i, value) in out.iter_mut().enumerate() {
            let at = self.at[i] as usize;
            let (upper, lower) = (&plane[at..at + 2], &plane[at + width..at + width + 2]);
            let upper = u32::from(upper[0]) * a[i] + u32::from(upper[1]) * b[i];
            let lower = u32::from(lower[0]) * c[i] + u32::from(lower[1]) * d[i];
            *value = ((upper + lower + WHOLE / 2) / WHOLE) as u8;
        }
    }
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn locate(
    sources: &mut Sources,
    [x, y]: [f32; 2],
    [across, down]: [f32; 2],
    width: u32,
    height: u32,
    inside: &mut [u8; STRETCH],
) {
    let (right, bottom) = ((width - 1) as f32, (height - 1) as f32);
    for i in 0..STRETCH {
        let (u, v) = (x + i as f32 * across, y + i as f32 * down);
        inside[i] = u8::from((u >= 0.0) & (u <= right) & (v >= 0.0) & (v <= bottom));
        let (u, v) = (u.clamp(0.0, right), v.clamp(0.0, bottom));
        // The last pixel of a line is the right one of a pair.
        let (column, row) = ((u as i32).min(width as i32 - 2), (v as i32).min(height as i32 - 2));
        sources.at[i] = (row * width as i32 + column) as u32;
        let along = ((u - column as f32) * ONE as f32) as i32 as u32;
        let down = ((v - row as f32) * ONE as f32) as i32 as u32;
        let [a, b, c, d] = &mut sources.weights;
        (a[i], b[i]) = ((ONE - down) * (ONE - along), (ONE - down) * along);
        (c[i], d[i]) = (down * (ONE - along), down * along);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crop::Cropper;
    use crate::frame::{Encoding, Frame};

    fn near(a: [f64; 2], b: [f64; 2]) -> bool {
        (a[0] - b[0]).abs() < 1e-9 && (a[1] - b[1]).abs() < 1e-9
    }

    fn motion(degrees: f64, shift: [f64; 2]) -> CameraMotion {
        CameraMotion { angle: degrees.to_radians(), shift, ..CameraMotion::none(60, 40) }
    }

    #[test]
    fn motions_turn_about_the_middle_and_can_be_undone_and_joined() {
        let quarter = motion(90.0, [3.0, 0.0]);
        assert!(near(quarter.apply([30.0, 20.0]), [33.0, 20.0]), "the middle is only moved");
        assert!(near(quarter.apply([40.0, 20.0]), [33.0, 30.0]), "x goes to y");
        let other = motion(-20.0, [-5.0, 7.5]);
        for place in [[0.0, 0.0], [17.0, 33.0], [60.0, 40.0]] {
            assert!(near(other.inverse().apply(other.apply(place)), place));
            assert!(near(quarter.then(&other).apply(place), other.apply(quarter.apply(place))));
        }
        assert!((motion(0.0, [3.0, 4.0]).reach() - 5.0).abs() < 1e-12);
        assert!((motion(180.0, [0.0; 2]).reach() - 60f64.hypot(40.0)).abs() < 1e-9);
    }

    #[test]
    fn warping_agrees_with_interpolation_in_double_precision() {
        let (width, height) = (60, 40);
        let data: Vec<u8> = (0..width * height * 3).map(|i| (i * i * 7 % 251) as u8).collect();
        let frame = Frame::new(&data, 60, 40, 180, Encoding::Rgb8, None).unwrap();
        let mut patch = Patch::default();
        Cropper::default().crop(&frame, &frame.bounds(), width, height, &mut patch);
        let (mut out, mut covered) = (Patch::default(), Vec::new());
        for motion in
            [motion(0.0, [0.0; 2]), motion(0.0, [2.0, -3.0]), motion(7.0, [4.3, 1.8]), motion(-100.0, [0.0; 2])]
        {
            warp(&patch, &motion, &mut out, &mut covered);
            assert_eq!((out.width, out.height, out.planes().len()), (width, height, 3));
            for (i, covered) in covered.iter().enumerate() {
                let (x, y) = (i % width, i / width);
                let [u, v] = motion.inverse().apply([x as f64 + 0.5, y as f64 + 0.5]).map(|v| v - 0.5);
                let [high, low] = [1e-3, -1e-3]
                    .map(|e| u >= e && v >= e && u <= (width - 1) as f64 - e && v <= (height - 1) as f64 - e);
                assert!(*covered == u8::from(high) || *covered == u8::from(low), "{motion:?} {x} {y}");
                let (u, v) = (u.clamp(0.0, (width - 1) as f64), v.clamp(0.0, (height - 1) as f64));
                for plane in 0..3 {
                    let at = |x: f64, y: f64| {
                        f64::from(patch.rgb((x as usize).min(width - 1), (y as usize).min(height - 1))[plane])
                    };
                    let (a, b) = (u.fract(), v.fract());
                    let up = at(u, v) * (1.0 - a) + at(u + 1.0, v) * a;
                    let want = up * (1.0 - b) + (at(u, v + 1.0) * (1.0 - a) + at(u + 1.0, v + 1.0) * a) * b;
                    let got = f64::from(out.rgb(x, y)[plane]);
                    // Weights are cut to 8 bits.
                    assert!((got - want).abs() < 2.6, "{motion:?} {x} {y}: {got} {want}");
                }
            }
        }
    }
}
