//! Which part of the image a lost target is searched for in next: all of the image in turn, some areas a frame, in the
//! target's size first, then in other sizes.

use crate::detect::online::SEARCHED;
use crate::frame::MIN_TARGET_SIDE;
use crate::geometry::Rect;

/// Sizes that a target may come back in, in units of the size that it had.
const SIZES: [f64; 3] = [1.0, 1.5, 0.67];
/// Frames in which the whole image is searched, unless that takes too many areas a frame.
const FRAMES: usize = 20;

/// Where the search has come to.
#[derive(Default)]
pub(super) struct Sweep {
    next: usize,
}

impl Sweep {
    /// Begins anew.
    pub fn restart(&mut self) {
        self.next = 0;
    }

    /// The next areas, at most so many: the box of a target of that size in the middle of each.
    pub fn areas(&mut self, image: &Rect, size: [f64; 2], most: usize) -> impl Iterator<Item = Rect> + use<> {
        let grids = SIZES.map(|factor| Areas::new(image, size.map(|side| side * factor)));
        let all: usize = grids.iter().map(Areas::count).sum();
        let count = all.div_ceil(FRAMES).min(most);
        let from = self.next;
        self.next = (from + count) % all.max(1);
        (from..from + count).filter_map(move |at| {
            let mut at = at % all;
            for grid in &grids {
                match at.checked_sub(grid.count()) {
                    None => return Some(grid.area(at)),
                    Some(rest) => at = rest,
                }
            }
            None
        })
    }
}

/// The image divided into areas for targets of one size.
struct Areas {
    size: [f64; 2],
    /// Areas in a row and in a column.
    across: usize,
    down: usize,
    /// Width and height of one, in pixels.
    step: [f64; 2],
}

impl Areas {
    fn new(image: &Rect, size: [f64; 2]) -> Self {
        let fits = size[0] >= MIN_TARGET_SIDE && size[1] >= MIN_TARGET_SIDE && size[0] <= image.w && size[1] <= image.h;
        let count = |side: f64, target: f64| if fits { (side / (SEARCHED * target)).ceil() as usize } else { 0 };
        let (across, down) = (count(image.w, size[0]), count(image.h, size[1]));
        Self { size, across, down, step: [image.w / across as f64, image.h / down as f64] }
    }

    fn count(&self) -> usize {
        self.across * self.down
    }

    fn area(&self, at: usize) -> Rect {
        let (row, col) = (at / self.across, at % self.across);
        Rect::around([(col as f64 + 0.5) * self.step[0], (row as f64 + 0.5) * self.step[1]], self.size)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const IMAGE: Rect = Rect { x: 0.0, y: 0.0, w: 640.0, h: 480.0 };

    #[test]
    fn every_place_is_searched_in_every_size_within_a_pass() {
        let mut sweep = Sweep::default();
        let size = [30.0, 50.0];
        let areas: Vec<Rect> = (0..FRAMES).flat_map(|_| sweep.areas(&IMAGE, size, 100)).collect();
        for factor in SIZES {
            for place in [[0.0, 0.0], [639.0, 479.0], [320.0, 240.0], [75.5, 300.0]] {
                let reaches = |area: &&Rect| {
                    let [x, y] = area.centre();
                    let half = size.map(|side| SEARCHED / 2.0 * side * factor);
                    (area.w - size[0] * factor).abs() < 1e-9
                        && (x - place[0]).abs() <= half[0]
                        && (y - place[1]).abs() <= half[1]
                };
                assert!(areas.iter().any(|area| reaches(&area)), "{factor} {place:?}");
            }
        }
        // The target's own size comes first.
        assert!(areas[0].w == size[0] && areas[0].h == size[1]);
    }

    #[test]
    fn no_frame_searches_more_than_it_may_and_what_fits_nowhere_is_left_out() {
        let mut sweep = Sweep::default();
        assert_eq!(sweep.areas(&IMAGE, [12.0, 12.0], 6).count(), 6);
        assert_eq!(sweep.areas(&IMAGE, [12.0, 12.0], 0).count(), 0);
        assert_eq!(sweep.areas(&IMAGE, [2000.0, 1000.0], 6).count(), 0);
        // Larger than the image in the second size only.
        let widths: Vec<f64> = (0..FRAMES).flat_map(|_| sweep.areas(&IMAGE, [500.0, 100.0], 6)).map(|a| a.w).collect();
        assert!(widths.iter().all(|w| *w <= IMAGE.w) && widths.contains(&500.0), "{widths:?}");
    }
}
