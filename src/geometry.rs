//! Boxes in the image plane, and the one convention for coordinates.
//!
//! Coordinates are continuous, in pixels, with the origin at the top-left corner of the image, x to the
//! right and y down. Pixel (column `i`, row `j`) covers `[i, i+1) x [j, j+1)`, so its centre lies at
//! `(i + 0.5, j + 0.5)`. Boxes of benchmark files are taken as they stand.

use std::ops::Range;

use serde::{Deserialize, Serialize};

/// An axis-aligned box: top-left corner and size, in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct Rect {
    /// Left edge.
    pub x: f64,
    /// Top edge.
    pub y: f64,
    /// Width.
    pub w: f64,
    /// Height.
    pub h: f64,
}

impl Rect {
    /// The box with its top-left corner at `(x, y)`.
    pub const fn new(x: f64, y: f64, w: f64, h: f64) -> Self {
        Self { x, y, w, h }
    }

    /// The box of size `size` whose centre is `centre`.
    pub fn around(centre: [f64; 2], size: [f64; 2]) -> Self {
        Self::new(centre[0] - size[0] / 2.0, centre[1] - size[1] / 2.0, size[0], size[1])
    }

    /// Centre, `[x, y]`.
    pub fn centre(&self) -> [f64; 2] {
        [self.x + self.w / 2.0, self.y + self.h / 2.0]
    }

    /// Size, `[width, height]`.
    pub fn size(&self) -> [f64; 2] {
        [self.w, self.h]
    }

    /// Area in square pixels; 0 for an empty box.
    pub fn area(&self) -> f64 {
        self.w.max(0.0) * self.h.max(0.0)
    }

    /// The side of the square of the same area.
    pub fn scale(&self) -> f64 {
        self.area().sqrt()
    }

    /// The part that both boxes cover; empty (zero size) where they do not meet.
    pub fn intersection(&self, other: &Self) -> Self {
        let (x0, y0) = (self.x.max(other.x), self.y.max(other.y));
        let x1 = (self.x + self.w).min(other.x + other.w);
        let y1 = (self.y + self.h).min(other.y + other.h);
        Self::new(x0, y0, (x1 - x0).max(0.0), (y1 - y0).max(0.0))
    }

    /// Intersection over union, in `[0, 1]`; 0 where both are empty.
    pub fn iou(&self, other: &Self) -> f64 {
        let shared = self.intersection(other).area();
        let union = self.area() + other.area() - shared;
        if union > 0.0 { shared / union } else { 0.0 }
    }

    /// The same size, moved by `(dx, dy)`.
    pub fn shifted(&self, dx: f64, dy: f64) -> Self {
        Self::new(self.x + dx, self.y + dy, self.w, self.h)
    }

    /// The same centre, both sides multiplied by `factor`.
    pub fn scaled(&self, factor: f64) -> Self {
        Self::around(self.centre(), [self.w * factor, self.h * factor])
    }

    /// The columns and rows of an image of this width and height whose pixels' centres lie in the box; both empty, or
    /// not, as there is such a pixel or not.
    pub fn pixels(&self, [width, height]: [usize; 2]) -> [Range<usize>; 2] {
        // Casts saturate, so that what lies far outside is cut as well.
        let range = |low: f64, length: f64, limit: usize| {
            let first = ((low - 0.5).ceil() as usize).min(limit);
            first..((low + length - 0.5).ceil() as usize).clamp(first, limit)
        };
        let [columns, rows] = [range(self.x, self.w, width), range(self.y, self.h, height)];
        if columns.is_empty() || rows.is_empty() { [0..0, 0..0] } else { [columns, rows] }
    }

    /// Whether all four numbers are finite.
    pub fn is_finite(&self) -> bool {
        [self.x, self.y, self.w, self.h].iter().all(|v| v.is_finite())
    }
}

impl std::fmt::Display for Rect {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // Hundredths of a pixel are more than a reader needs.
        let [w, h, x, y] = [self.w, self.h, self.x, self.y].map(|v| (v * 100.0).round() / 100.0);
        write!(f, "{w} x {h} at ({x}, {y})")
    }
}

/// Euclidean distance of two points, in pixels.
pub fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// A vector turned by `angle`, in radians, from x towards y: clockwise, as y points down.
pub fn turned([x, y]: [f64; 2], angle: f64) -> [f64; 2] {
    let (sin, cos) = angle.sin_cos();
    [cos * x - sin * y, sin * x + cos * y]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn iou_of_half_shifted_boxes_is_a_third() {
        let a = Rect::new(0.0, 0.0, 10.0, 4.0);
        assert_eq!(a.iou(&a.shifted(5.0, 0.0)), 1.0 / 3.0);
        assert_eq!(a.iou(&a), 1.0);
        assert_eq!(a.iou(&a.shifted(10.0, 0.0)), 0.0);
        assert_eq!(Rect::default().iou(&Rect::default()), 0.0);
    }

    #[test]
    fn a_box_around_its_centre_is_itself() {
        let a = Rect::new(3.0, -2.0, 7.0, 5.0);
        assert_eq!(Rect::around(a.centre(), a.size()), a);
        assert_eq!(a.scaled(2.0).centre(), a.centre());
        assert_eq!(a.scaled(2.0).area(), 4.0 * a.area());
    }

    #[test]
    fn a_box_holds_the_pixels_whose_centres_lie_in_it() {
        let pixels = |x, w| Rect::new(x, 1.0, w, 2.0).pixels([8, 4]);
        assert_eq!(pixels(2.0, 3.0), [2..5, 1..3]);
        assert_eq!(pixels(2.5, 3.0), [2..5, 1..3], "a centre on the left edge is in, one on the right edge is not");
        assert_eq!(pixels(2.6, 3.0), [3..6, 1..3]);
        assert_eq!(pixels(-5.0, 6.6), [0..2, 1..3]);
        assert_eq!(pixels(6.0, 1e30), [6..8, 1..3]);
        for (x, w) in [(-9.0, 4.0), (8.0, 4.0), (3.6, 0.2), (1e30, 1.0)] {
            assert_eq!(pixels(x, w), [0..0, 0..0]);
        }
    }
}
