//! Where small windows of one picture are in another (Lucas and Kanade, IJCAI 1981), from coarse to fine over a pyramid
//! (Bouguet, *Pyramidal implementation of the Lucas Kanade feature tracker*, 2000).
//!
//! The gradients are those of the first picture (inverse compositional: Baker and Matthews, IJCV 2004), so that all
//! that they need is worked out once for as many pictures as follow. A window may be looked for turned by a known
//! angle; what is solved for is where its middle is. The means of both windows are taken out, so that light may change.

/// Pixels on each side of a window's middle.
pub const RADIUS: usize = 5;
const SIDE: usize = 2 * RADIUS + 1;
const AREA: usize = SIDE * SIDE;
/// Levels of a pyramid, each half as wide and high as the one before: windows are found some 30 pixels off.
pub const LEVELS: usize = 4;
/// Steps at one level, at most, and the length in pixels below which a step is the last.
const STEPS: usize = 10;
const STILL: f64 = 0.02;
/// The smaller eigenvalue of a window's second moments of gradients below which it cannot be followed at a level, in
/// squared intensities.
const FLAT: f64 = 2.0;

/// A picture at each level, as floats.
#[derive(Clone, Debug, Default)]
pub struct Pyramid {
    levels: Vec<Level>,
}

/// Row-major `height x width`. A place `p` of the picture is `p / 2^l` here.
#[derive(Clone, Debug, Default)]
struct Level {
    width: usize,
    height: usize,
    values: Vec<f32>,
}

impl Pyramid {
    /// Takes a plane, row-major `height x width`.
    pub fn build(&mut self, plane: &[u8], width: usize) {
        self.levels.resize_with(LEVELS, Level::default);
        let first = &mut self.levels[0];
        (first.width, first.height) = (width, plane.len() / width.max(1));
        first.values.clear();
        first.values.extend(plane.iter().map(|v| f32::from(*v)));
        for l in 1..LEVELS {
            let (finer, coarser) = self.levels.split_at_mut(l);
            coarser[0].halve(&finer[l - 1]);
        }
    }
}

impl Level {
    /// The mean of each four pixels of a finer level.
    fn halve(&mut self, finer: &Self) {
        (self.width, self.height) = (finer.width / 2, finer.height / 2);
        self.values.resize(self.width * self.height, 0.0);
        if self.values.is_empty() {
            return;
        }
        let pairs = finer.values.chunks_exact(2 * finer.width);
        for (out, rows) in self.values.chunks_exact_mut(self.width).zip(pairs) {
            let (up, down) = rows.split_at(finer.width);
            let (up, down) = (up.as_chunks::<2>().0, down.as_chunks::<2>().0);
            out.iter_mut().zip(up.iter().zip(down)).for_each(|(o, (u, d))| *o = 0.25 * (u[0] + u[1] + d[0] + d[1]));
        }
    }

    /// Fills `window`, `side x side`, with the values on a grid of steps `along` and its perpendicular around a place;
    /// `false` where some lie beyond the pixels' centres.
    fn sample(&self, [x, y]: [f64; 2], along: [f64; 2], side: usize, window: &mut [f32]) -> bool {
        let (cos, sin) = (along[0], along[1]);
        let reach = side as f64 / 2.0 * (cos.abs() + sin.abs()) + 0.5;
        let inside = |v: f64, limit: usize| v - reach >= 0.0 && v + reach < limit as f64;
        if !inside(x, self.width) || !inside(y, self.height) {
            return false;
        }
        let middle = (side / 2) as f64;
        // Pixels' centres lie at halves.
        let (left, top) = (x - 0.5 - middle * (cos - sin), y - 0.5 - middle * (sin + cos));
        let (cos, sin) = (cos as f32, sin as f32);
        for (j, row) in window.chunks_exact_mut(side).enumerate() {
            let (x0, y0) = (left as f32 - j as f32 * sin, top as f32 + j as f32 * cos);
            for (i, value) in row.iter_mut().enumerate() {
                let (x, y) = (x0 + i as f32 * cos, y0 + i as f32 * sin);
                let (column, line) = (x as usize, y as usize);
                let (u, v) = (x - column as f32, y - line as f32);
                let at = line * self.width + column;
                let (up, down) = (&self.values[at..at + 2], &self.values[at + self.width..at + self.width + 2]);
                let (a, b) = (up[0] + u * (up[1] - up[0]), down[0] + u * (down[1] - down[0]));
                *value = a + v * (b - a);
            }
        }
        true
    }
}

/// A window of a picture at one level.
#[derive(Clone, Copy, Debug)]
struct PyramidView {
    /// Less their mean, as the gradients.
    values: [f32; AREA],
    gradients: [[f32; AREA]; 2],
    /// The inverse of the gradients' second moments, `[xx, xy, yy]`; `None` where it cannot be followed.
    inverse: Option<[f64; 3]>,
}

impl PyramidView {
    const NONE: Self = Self { values: [0.0; AREA], gradients: [[0.0; AREA]; 2], inverse: None };

    fn take(&mut self, level: &Level, place: [f64; 2]) {
        const WIDE: usize = SIDE + 2;
        self.inverse = None;
        let mut window = [0.0; WIDE * WIDE];
        if !level.sample(place, [1.0, 0.0], WIDE, &mut window) {
            return;
        }
        let mut moments = [0.0; 3];
        for i in 0..AREA {
            let at = (i / SIDE + 1) * WIDE + i % SIDE + 1;
            let (dx, dy) = (0.5 * (window[at + 1] - window[at - 1]), 0.5 * (window[at + WIDE] - window[at - WIDE]));
            self.values[i] = window[at];
            (self.gradients[0][i], self.gradients[1][i]) = (dx, dy);
        }
        // A change of the mean says nothing: neither do the gradients' means.
        centre(&mut self.values);
        self.gradients.iter_mut().for_each(centre);
        let [gx, gy] = &self.gradients;
        for (dx, dy) in gx.iter().zip(gy) {
            let (dx, dy) = (f64::from(*dx), f64::from(*dy));
            moments = [moments[0] + dx * dx, moments[1] + dx * dy, moments[2] + dy * dy];
        }
        let [xx, xy, yy] = moments;
        let smaller = 0.5 * (xx + yy) - (0.5 * (xx - yy)).hypot(xy);
        if smaller >= FLAT * AREA as f64 {
            let determinant = xx * yy - xy * xy;
            self.inverse = Some([yy / determinant, -xy / determinant, xx / determinant]);
        }
    }
}

fn centre(values: &mut [f32; AREA]) {
    let mean = values.iter().sum::<f32>() / AREA as f32;
    values.iter_mut().for_each(|v| *v -= mean);
}

/// Windows of one picture, to be looked for in others.
#[derive(Clone, Debug, Default)]
pub struct Windows {
    places: Vec<[f64; 2]>,
    /// Of each window all levels, the finest first.
    views: Vec<PyramidView>,
}

/// Where a window was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// Its middle in the other picture.
    pub place: [f64; 2],
    /// The share of the window's variance that remains as difference: 0 where all is the same.
    pub residual: f64,
}

impl Windows {
    /// Takes the windows around these places of a picture.
    pub fn take(&mut self, picture: &Pyramid, places: &[[f64; 2]]) {
        self.places.clear();
        self.places.extend(places);
        self.views.resize(places.len() * LEVELS, PyramidView::NONE);
        for (views, place) in self.views.chunks_exact_mut(LEVELS).zip(places) {
            for (l, (view, level)) in views.iter_mut().zip(&picture.levels).enumerate() {
                view.take(level, scaled(*place, l));
            }
        }
    }

    /// The places of the windows.
    pub fn places(&self) -> &[[f64; 2]] {
        &self.places
    }

    /// Looks for window `i` in another picture, in which it is turned by `angle` from x towards y, near `guess`.
    pub fn find(&self, i: usize, picture: &Pyramid, guess: [f64; 2], angle: f64) -> Option<Found> {
        let (sin, cos) = angle.sin_cos();
        let mut place = guess;
        let mut window = [0.0; AREA];
        let views = &self.views[i * LEVELS..(i + 1) * LEVELS];
        for (l, (view, level)) in views.iter().zip(&picture.levels).enumerate().rev() {
            let Some(inverse) = view.inverse else { continue };
            let mut here = scaled(place, l);
            for _ in 0..STEPS {
                if !level.sample(here, [cos, sin], SIDE, &mut window) {
                    break;
                }
                let [x, y] = step(view, &window, inverse);
                here = [here[0] - (cos * x - sin * y), here[1] - (sin * x + cos * y)];
                if x.hypot(y) < STILL {
                    break;
                }
            }
            place = here.map(|v| v * f64::from(1 << l));
        }
        let (finest, level) = (&views[0], &picture.levels[0]);
        if finest.inverse.is_none() || !level.sample(place, [cos, sin], SIDE, &mut window) {
            return None;
        }
        centre(&mut window);
        let (mut left, mut all) = (0.0, 0.0);
        for (now, then) in window.iter().zip(&finest.values) {
            left += (now - then) * (now - then);
            all += then * then;
        }
        Some(Found { place, residual: f64::from(left / all) })
    }
}

/// A place at a level.
fn scaled(place: [f64; 2], level: usize) -> [f64; 2] {
    place.map(|v| v / f64::from(1 << level))
}

/// How far the window as it is seen lies from the view, in the view's directions.
fn step(view: &PyramidView, window: &[f32; AREA], [xx, xy, yy]: [f64; 3]) -> [f64; 2] {
    let (mut along, mut down) = (0.0, 0.0);
    let [gx, gy] = &view.gradients;
    for i in 0..AREA {
        let difference = window[i] - view.values[i];
        along += gx[i] * difference;
        down += gy[i] * difference;
    }
    let (along, down) = (f64::from(along), f64::from(down));
    [xx * along + xy * down, xy * along + yy * down]
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 160;
    const HEIGHT: usize = 120;

    /// A smooth picture, seen by a camera that is turned and moved.
    fn picture([dx, dy]: [f64; 2], angle: f64, light: f64) -> Pyramid {
        let value = |x: f64, y: f64| {
            let waves = [(0.31, 0.12, 30.0), (-0.17, 0.27, 25.0), (0.05, -0.22, 35.0), (0.08, 0.07, 20.0)];
            128.0 + waves.iter().map(|(a, b, height)| height * (a * x + b * y + height).sin()).sum::<f64>()
        };
        let (sin, cos) = angle.sin_cos();
        let plane: Vec<u8> = (0..WIDTH * HEIGHT)
            .map(|i| {
                let (x, y) = ((i % WIDTH) as f64 + 0.5 - dx, (i / WIDTH) as f64 + 0.5 - dy);
                (value(cos * x + sin * y, cos * y - sin * x) + light).clamp(0.0, 255.0).round() as u8
            })
            .collect();
        let mut pyramid = Pyramid::default();
        pyramid.build(&plane, WIDTH);
        pyramid
    }

    #[test]
    fn windows_are_found_where_they_went() {
        let places = [[40.5, 50.5], [80.0, 60.25], [100.5, 45.5], [70.5, 80.5]];
        let mut windows = Windows::default();
        windows.take(&picture([0.0; 2], 0.0, 0.0), &places);
        for (shift, angle, light) in [([0.3, -0.6], 0.0, 0.0), ([9.7, 5.2], 0.0, 12.0), ([20.4, -14.0], 0.05, -8.0)] {
            let moved = picture(shift, angle, light);
            for (i, [x, y]) in places.into_iter().enumerate() {
                let (sin, cos) = f64::sin_cos(angle);
                let want = [cos * x - sin * y + shift[0], sin * x + cos * y + shift[1]];
                let guess = [want[0] - 0.5 * shift[0], want[1] - 0.5 * shift[1]];
                let found = windows.find(i, &moved, guess, angle).unwrap();
                let off = (found.place[0] - want[0]).hypot(found.place[1] - want[1]);
                assert!(off < 0.1 && found.residual < 0.01, "{shift:?} {angle}: {found:?} {want:?}");
            }
        }
    }

    #[test]
    fn what_is_gone_is_not_found() {
        let mut windows = Windows::default();
        windows.take(&picture([0.0; 2], 0.0, 0.0), &[[60.5, 60.5], [2.0, 60.0]]);
        let mut black = Pyramid::default();
        black.build(&vec![0; WIDTH * HEIGHT], WIDTH);
        assert!(windows.find(0, &black, [60.5, 60.5], 0.0).is_none_or(|found| found.residual > 0.9));
        assert_eq!(windows.find(0, &picture([0.0; 2], 0.0, 0.0), [-50.0, 60.0], 0.0), None);
        assert_eq!(windows.find(1, &picture([0.0; 2], 0.0, 0.0), [2.0, 60.0], 0.0), None, "it has no full window");
    }

    #[test]
    fn small_pictures_have_fewer_levels() {
        let mut pyramid = Pyramid::default();
        pyramid.build(&[7; 15], 5);
        let mut windows = Windows::default();
        windows.take(&pyramid, &[[2.0, 1.0]]);
        assert_eq!(windows.find(0, &pyramid, [2.0, 1.0], 0.0), None);
    }
}
