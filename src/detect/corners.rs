//! Corners that can be followed (Shi and Tomasi, *Good features to track*, CVPR 1994): where the gradients of a small
//! window point in different directions, the smaller eigenvalue of their second moments is large.
//!
//! (imageproc's corners are FAST ones, which are no measure of how well a window can be followed.)

/// Pixels on each side of the middle of the window over which gradients are summed.
const RADIUS: usize = 2;
const SIDE: usize = 2 * RADIUS + 1;
/// A corner has at least this share of the largest eigenvalue in the picture. (OpenCV's usual `qualityLevel`.)
const QUALITY: f32 = 0.01;
/// Nor is it below this, in squared intensities: the noise of a camera has no corners.
const LEAST: f32 = 30.0;

/// Finds corners, with scratch that is reused from picture to picture.
#[derive(Clone, Debug, Default)]
pub struct CornerFinder {
    /// Second moments of the gradients, `[xx, xy, yy]`, summed over the columns of the windows' rows.
    moments: Vec<[f32; 3]>,
    line: Vec<[f32; 3]>,
    /// The smaller eigenvalues, `height x width`.
    values: Vec<f32>,
    /// The tops of the values.
    tops: Vec<(f32, usize)>,
    /// For squares of half the least distance: 1 where there is a corner.
    taken: Vec<u8>,
}

impl CornerFinder {
    /// Fills `corners` with the places `[x, y]` of at most `count` corners of a plane, row-major `height x width`, best
    /// first, none nearer than `margin` pixels to the border or than about `distance` to each other.
    pub fn find(
        &mut self,
        plane: &[u8],
        width: usize,
        margin: usize,
        count: usize,
        distance: f64,
        corners: &mut Vec<[f64; 2]>,
    ) {
        corners.clear();
        let height = plane.len() / width.max(1);
        if width.min(height) < SIDE + 2 {
            return;
        }
        self.eigenvalues(plane, width, height);
        self.tops(width, height, margin.max(1));
        self.spread(width, height, count, distance, corners);
    }

    fn eigenvalues(&mut self, plane: &[u8], width: usize, height: usize) {
        self.values.clear();
        self.values.resize(width * height, 0.0);
        self.moments.clear();
        self.moments.resize(width, [0.0; 3]);
        self.line.resize(width, [0.0; 3]);
        for y in 1..height - 1 {
            self.add(plane, width, y, 1.0);
            if y > SIDE {
                self.add(plane, width, y - SIDE, -1.0);
            }
            if y >= SIDE {
                let line = &mut self.values[(y - RADIUS) * width..][..width];
                for (value, window) in line[RADIUS..].iter_mut().zip(self.moments.windows(SIDE)) {
                    let [xx, xy, yy] = window.iter().fold([0.0; 3], |s, m| [s[0] + m[0], s[1] + m[1], s[2] + m[2]]);
                    *value = smaller([xx, xy, yy].map(|sum| sum / (SIDE * SIDE) as f32));
                }
            }
        }
    }

    /// Adds the gradients of a row to the sums of the columns, or takes them out.
    fn add(&mut self, plane: &[u8], width: usize, y: usize, sign: f32) {
        let row = |y: usize| &plane[y * width..(y + 1) * width];
        let (here, up, down) = (row(y), row(y - 1), row(y + 1));
        for x in 1..width - 1 {
            let [dx, dy] = gradient(here[x - 1], here[x + 1], up[x], down[x]);
            let moments = &mut self.moments[x];
            // Gradients are halves of integers, so that sums are exact and nothing is left behind.
            *moments = [moments[0] + sign * dx * dx, moments[1] + sign * dx * dy, moments[2] + sign * dy * dy];
        }
    }

    /// Values that are no smaller than their eight neighbours', best first.
    fn tops(&mut self, width: usize, height: usize, margin: usize) {
        self.tops.clear();
        let best = self.values.iter().fold(0.0f32, |best, v| best.max(*v));
        let least = LEAST.max(QUALITY * best);
        for y in margin..height.saturating_sub(margin) {
            for x in margin..width.saturating_sub(margin) {
                let at = y * width + x;
                let value = self.values[at];
                if value < least {
                    continue;
                }
                let around = |row: usize| self.values[row + x - 1..=row + x + 1].iter();
                let rows = [at - x - width, at - x, at - x + width];
                if rows.into_iter().flat_map(around).all(|other| *other <= value) {
                    self.tops.push((value, at));
                }
            }
        }
        self.tops.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    }

    /// Takes the best that keep their distance.
    fn spread(&mut self, width: usize, height: usize, count: usize, distance: f64, corners: &mut Vec<[f64; 2]>) {
        let cell = (distance / 2.0).max(1.0);
        let [columns, rows] = [width, height].map(|n| (n as f64 / cell) as usize + 1);
        self.taken.clear();
        self.taken.resize(columns * rows, 0);
        for (_, at) in &self.tops {
            let [x, y] = [(at % width) as f64 + 0.5, (at / width) as f64 + 0.5];
            let [column, row] = [(x / cell) as usize, (y / cell) as usize];
            let near = |row: usize| {
                let line = &self.taken[row * columns..(row + 1) * columns];
                line[column.saturating_sub(1)..(column + 2).min(columns)].contains(&1)
            };
            if !(row.saturating_sub(1)..(row + 2).min(rows)).any(near) {
                self.taken[row * columns + column] = 1;
                corners.push([x, y]);
                if corners.len() >= count {
                    break;
                }
            }
        }
    }
}

/// Half the differences of the neighbours.
fn gradient(left: u8, right: u8, up: u8, down: u8) -> [f32; 2] {
    [(f32::from(right) - f32::from(left)) / 2.0, (f32::from(down) - f32::from(up)) / 2.0]
}

/// The smaller eigenvalue of a symmetric matrix `[xx, xy, yy]`.
fn smaller([xx, xy, yy]: [f32; 3]) -> f32 {
    let half = 0.5 * (xx - yy);
    0.5 * (xx + yy) - (half * half + xy * xy).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 90;
    const HEIGHT: usize = 70;

    fn find(plane: &[u8], count: usize, distance: f64) -> Vec<[f64; 2]> {
        let mut corners = vec![[0.0; 2]];
        CornerFinder::default().find(plane, WIDTH, 6, count, distance, &mut corners);
        corners
    }

    fn paint(value: impl Fn(usize, usize) -> u8) -> Vec<u8> {
        (0..WIDTH * HEIGHT).map(|i| value(i % WIDTH, i / WIDTH)).collect()
    }

    #[test]
    fn a_box_has_four_corners_and_its_edges_have_none() {
        let plane = paint(|x, y| if (20..60).contains(&x) && (15..50).contains(&y) { 200 } else { 50 });
        let mut corners = find(&plane, 20, 10.0);
        corners.sort_by(|a, b| (a[1] + 0.1 * a[0]).total_cmp(&(b[1] + 0.1 * b[0])));
        let want = [[20.0, 15.0], [60.0, 15.0], [20.0, 50.0], [60.0, 50.0]];
        assert_eq!(corners.len(), want.len(), "{corners:?}");
        assert!(corners.iter().zip(want).all(|(c, w)| (c[0] - w[0]).hypot(c[1] - w[1]) < 3.0), "{corners:?}");
        assert!(find(&paint(|x, _| 2 * x as u8), 9, 10.0).is_empty());
        assert!(find(&paint(|_, y| if y < 30 { 0 } else { 255 }), 9, 10.0).is_empty());
    }

    #[test]
    fn values_agree_with_nested_loops() {
        let plane = paint(|x, y| ((x * x * 7 + y * x * 13 + y * 31) % 251) as u8);
        let mut finder = CornerFinder::default();
        finder.eigenvalues(&plane, WIDTH, HEIGHT);
        let at = |x: usize, y: usize| f64::from(plane[y * WIDTH + x]);
        for y in RADIUS + 1..HEIGHT - RADIUS - 1 {
            for x in RADIUS + 1..WIDTH - RADIUS - 1 {
                let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
                for v in y - RADIUS..=y + RADIUS {
                    for u in x - RADIUS..=x + RADIUS {
                        let (dx, dy) = ((at(u + 1, v) - at(u - 1, v)) / 2.0, (at(u, v + 1) - at(u, v - 1)) / 2.0);
                        (xx, xy, yy) = (xx + dx * dx / 25.0, xy + dx * dy / 25.0, yy + dy * dy / 25.0);
                    }
                }
                // The smaller root of the characteristic polynomial.
                let want = (xx + yy) / 2.0 - ((xx + yy) * (xx + yy) / 4.0 - (xx * yy - xy * xy)).max(0.0).sqrt();
                let got = f64::from(finder.values[y * WIDTH + x]);
                assert!((got - want).abs() < 1e-4 * (xx + yy), "{x} {y}: {got} {want}");
            }
        }
    }

    #[test]
    fn corners_keep_their_distance_the_best_come_first_and_no_more_than_wanted() {
        let plane = paint(|x, y| ((x * x * 7 + y * x * 13 + y * 31) % 251) as u8);
        let corners = find(&plane, 1000, 12.0);
        assert!(corners.len() > 10, "{}", corners.len());
        for (i, a) in corners.iter().enumerate() {
            assert!(corners[..i].iter().all(|b| (a[0] - b[0]).hypot(a[1] - b[1]) > 6.0));
            assert!((6.0..84.0).contains(&a[0]) && (6.0..64.0).contains(&a[1]), "{a:?}");
        }
        assert_eq!(find(&plane, 5, 12.0), corners[..5]);
    }
}
