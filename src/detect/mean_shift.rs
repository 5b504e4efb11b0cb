//! Mean shift (Comaniciu and Meer, PAMI 2002; Bradski, *Computer vision face tracking*, 1998): a box climbs to where a
//! map holds most, each time moving its centre to the mean of the values that it covers.

use crate::geometry::Rect;

/// A step shorter than this, in pixels of the map, ends the climb.
const STILL: f64 = 0.05;

/// A map of values that are not negative, row-major `height x width`. Each value fills its pixel evenly; what lies
/// beyond the map is 0.
#[derive(Clone, Copy, Debug)]
pub struct Map<'a> {
    /// The values.
    pub values: &'a [f32],
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl Map<'_> {
    /// The whole map as a box.
    pub fn bounds(&self) -> Rect {
        Rect::new(0.0, 0.0, self.width as f64, self.height as f64)
    }

    /// The integral of the values over a box, in pixels of the map.
    pub fn sum(&self, rect: &Rect) -> f64 {
        self.moments(rect)[0]
    }

    /// The integrals over a box of the values, and of the values times x and times y.
    fn moments(&self, rect: &Rect) -> [f64; 3] {
        let inside = rect.intersection(&self.bounds());
        let mut moments = [0.0; 3];
        if inside.area() <= 0.0 {
            return moments;
        }
        let (left, right) = (inside.x, inside.x + inside.w);
        let (top, bottom) = (inside.y, inside.y + inside.h);
        let (first, last) = (left as usize, (right.ceil() as usize - 1).min(self.width - 1));
        for row in top as usize..(bottom.ceil() as usize).min(self.height) {
            let line = &self.values[row * self.width..][first..=last];
            let (mut sum, mut along) = (0.0, 0.0);
            for (i, value) in line.iter().enumerate() {
                sum += value;
                along += value * i as f32;
            }
            // Whole pixels so far; less the parts of the outermost that the box does not cover.
            let whole = f64::from(sum);
            let parts = [(line[0], first as f64, left), (line[line.len() - 1], right, (last + 1) as f64)];
            let cut = |(value, from, to): (f32, f64, f64)| {
                let part = f64::from(value) * (to - from);
                [part, part * 0.5 * (from + to)]
            };
            let [a, b] = parts.map(cut);
            let sum = whole - a[0] - b[0];
            let along = f64::from(along) + whole * (first as f64 + 0.5) - a[1] - b[1];
            let (from, to) = (top.max(row as f64), bottom.min(row as f64 + 1.0));
            let covered = to - from;
            moments[0] += covered * sum;
            moments[1] += covered * along;
            moments[2] += covered * sum * 0.5 * (from + to);
        }
        moments
    }

    /// Where the centre of a box comes to rest, after `steps` steps at most. It stays where it covers nothing.
    pub fn climb(&self, mut rect: Rect, steps: usize) -> [f64; 2] {
        for _ in 0..steps {
            let [sum, x, y] = self.moments(&rect);
            if sum <= 0.0 {
                break;
            }
            let (from, to) = (rect.centre(), [x / sum, y / sum]);
            rect = Rect::around(to, rect.size());
            if (to[0] - from[0]).abs().max((to[1] - from[1]).abs()) < STILL {
                break;
            }
        }
        rect.centre()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 60;
    const HEIGHT: usize = 50;

    /// A bell of width 6 around a place.
    fn bell(x: f64, y: f64) -> Vec<f32> {
        let value = |i: usize| {
            let (u, v) = ((i % WIDTH) as f64 + 0.5 - x, (i / WIDTH) as f64 + 0.5 - y);
            (-0.5 * (u * u + v * v) / 36.0).exp() as f32
        };
        (0..WIDTH * HEIGHT).map(value).collect()
    }

    fn map(values: &[f32]) -> Map<'_> {
        Map { values, width: WIDTH, height: HEIGHT }
    }

    #[test]
    fn a_box_climbs_to_the_top_of_a_bell_from_all_sides() {
        let values = bell(31.3, 24.6);
        for start in [[22.0, 18.0], [40.0, 24.0], [31.0, 33.0], [25.2, 30.9]] {
            let [x, y] = map(&values).climb(Rect::around(start, [15.0, 13.0]), 100);
            assert!((x - 31.3).abs() < 0.5 && (y - 24.6).abs() < 0.5, "from {start:?} to {x}, {y}");
        }
        let [x, y] = map(&values).climb(Rect::around([22.0, 18.0], [15.0, 13.0]), 1);
        assert!(x > 22.5 && x < 30.0 && y > 18.5 && y < 24.0, "one step leads part of the way: {x}, {y}");
    }

    #[test]
    fn each_box_finds_the_top_that_is_nearest() {
        let values: Vec<f32> = bell(15.0, 25.0).iter().zip(bell(45.0, 25.0)).map(|(a, b)| a + 0.8 * b).collect();
        let top = |x: f64| map(&values).climb(Rect::around([x, 25.0], [12.0, 12.0]), 100)[0];
        assert!((top(18.0) - 15.0).abs() < 0.5 && (top(40.0) - 45.0).abs() < 0.5, "{} {}", top(18.0), top(40.0));
    }

    /// Every pixel cut into 20 x 20, and a sum over those whose centres the box covers; the box lies on that grid.
    #[test]
    fn moments_agree_with_a_sum_over_small_parts_of_all_pixels() {
        const PARTS: usize = 20;
        let values: Vec<f32> = (0..WIDTH * HEIGHT).map(|i| (i * i * 7 % 251) as f32 / 251.0).collect();
        for rect in [
            Rect::new(3.4, 7.9, 20.2, 11.0),
            Rect::new(-8.0, 40.5, 30.0, 30.0),
            Rect::new(5.25, 6.1, 0.3, 0.45),
            Rect::new(50.05, -3.0, 40.0, 60.0),
            Rect::new(70.0, 0.0, 9.0, 9.0),
        ] {
            let mut want = [0.0; 3];
            for part in 0..WIDTH * HEIGHT * PARTS * PARTS {
                let (i, k) = (part / (PARTS * PARTS), part % (PARTS * PARTS));
                let at = |pixel: usize, part: usize| pixel as f64 + (part as f64 + 0.5) / PARTS as f64;
                let (x, y) = (at(i % WIDTH, k % PARTS), at(i / WIDTH, k / PARTS));
                if x >= rect.x && x < rect.x + rect.w && y >= rect.y && y < rect.y + rect.h {
                    let value = f64::from(values[i]) / (PARTS * PARTS) as f64;
                    [1.0, x, y].iter().zip(&mut want).for_each(|(m, w)| *w += m * value);
                }
            }
            let got = map(&values).moments(&rect);
            assert!(got.iter().zip(want).all(|(g, w)| (g - w).abs() <= 1e-5 * w), "{rect}: {got:?} {want:?}");
        }
    }

    #[test]
    fn where_there_is_nothing_it_stays() {
        let values = vec![0.0; WIDTH * HEIGHT];
        assert_eq!(map(&values).climb(Rect::around([20.0, 10.0], [9.0, 9.0]), 10), [20.0, 10.0]);
        assert_eq!(map(&bell(30.0, 25.0)).climb(Rect::around([-90.0, 10.0], [9.0, 9.0]), 10), [-90.0, 10.0]);
    }
}
