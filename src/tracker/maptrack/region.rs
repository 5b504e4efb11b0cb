//! A target's region of interest and its images: motion, colour, position, and what they make together (eqs 4, 7 and 9
//! to 11). Every region has the same number of cells, whatever its size in pixels, so that the images of a target lie
//! over each other from frame to frame. All images are row-major `SIDE x SIDE`, row 0 at the top.

use super::colours::{self, Colours};
use super::history::{CELLS, PositionHistory, SIDE};
use super::view::SceneView;
use crate::geometry::Rect;

/// A pixel is the target's where its colour is more likely so than not (eq 4).
const LIKELY: f32 = 0.5;
/// Positional probability at the edges of the region (min of eq 7).
const EDGE: f64 = 0.0;
/// Weights of motion, colour and position together, of colour and position, and of position alone (sigma 1 to 3 of eq
/// 9, which the paper does not give).
const MOTION_WEIGHT: f32 = 1.0;
const COLOUR_WEIGHT: f32 = 0.3;
const POSITION_WEIGHT: f32 = 0.02;

/// The images of a region, reused from target to target.
pub(super) struct Region {
    /// Where it is, in pixels of the view.
    pub(super) window: Rect,
    /// The colour's bin of each cell.
    pub(super) bins: Vec<u16>,
    /// Whether a cell lies in the picture.
    pub(super) inside: Vec<bool>,
    /// M: 1 where something moves that is not another target's, 0 elsewhere.
    pub(super) motion: Vec<f32>,
    /// C: 1 where the colour is the target's, 0 elsewhere.
    pub(super) colour: Vec<f32>,
    /// P: the cone (eq 7).
    pub(super) position: Vec<f32>,
    /// CPI: the composite (eq 9).
    pub(super) composite: Vec<f32>,
    /// Scratch: of M times C.
    both: Vec<f32>,
}

/// What the images hold in all.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Sums {
    /// occval (eq 11): how well the target is seen, 0 to 1.
    pub(super) visibility: f64,
    /// The left side of eq 14: how much of the target moves where it is expected.
    pub(super) moving: f64,
    /// Share of the remembered target that moves, that has its colours, and that does one of the two.
    pub(super) motion: f64,
    pub(super) colour: f64,
    pub(super) seen: f64,
}

impl Default for Region {
    fn default() -> Self {
        let zeros = || vec![0.0; CELLS];
        Self {
            window: Rect::default(),
            bins: vec![0; CELLS],
            inside: vec![false; CELLS],
            motion: zeros(),
            colour: zeros(),
            position: cone(EDGE),
            composite: zeros(),
            both: zeros(),
        }
    }
}

impl Region {
    /// Looks at a window of the view: M, as far as it is nobody's or `owner`'s, the colours, and P.
    pub(super) fn look(&mut self, view: &SceneView, window: Rect, owner: u8) {
        self.window = window;
        let [width, height] = view.size();
        let pixel = |origin: f64, length: f64, cell: usize, limit: usize| {
            let at = origin + (cell as f64 + 0.5) * length / SIDE as f64;
            (at >= 0.0 && at < limit as f64).then_some(at as usize)
        };
        let columns: [Option<usize>; SIDE] = std::array::from_fn(|i| pixel(window.x, window.w, i, width));
        for row in 0..SIDE {
            let y = pixel(window.y, window.h, row, height);
            for (col, x) in columns.iter().enumerate() {
                let cell = row * SIDE + col;
                let seen = x.zip(y).filter(|&(x, y)| view.shows(x, y));
                self.inside[cell] = seen.is_some();
                self.bins[cell] = seen.map_or(0, |(x, y)| colours::bin(view.rgb(x, y)));
                let moves = seen.is_some_and(|(x, y)| view.moves(x, y, owner));
                self.motion[cell] = f32::from(u8::from(moves));
            }
        }
    }

    /// Computes C and CPI (eqs 4 and 9).
    pub(super) fn compose(&mut self, colours: &Colours, history: &PositionHistory) {
        let prior = history.share() as f32;
        for (cell, shape) in history.image().iter().enumerate() {
            let is_own = self.inside[cell] && colours.probability(self.bins[cell], prior) > LIKELY;
            let (c, p) = (f32::from(u8::from(is_own)), self.position[cell]);
            self.colour[cell] = c;
            self.both[cell] = self.motion[cell] * c;
            let together = self.both[cell] * p * MOTION_WEIGHT;
            self.composite[cell] = together.max(c * shape * COLOUR_WEIGHT).max(p * POSITION_WEIGHT);
        }
    }

    /// M times C of eq 8.
    pub(super) fn moving_and_alike(&self) -> &[f32] {
        &self.both
    }

    /// From the middle of the region to the centre of mass of CPI (eq 10), in pixels.
    pub(super) fn shift(&self) -> [f64; 2] {
        let [mut sum, mut across, mut down] = [0.0; 3];
        for (row, line) in self.composite.chunks_exact(SIDE).enumerate() {
            let of_row: f32 = line.iter().sum();
            sum += of_row;
            down += of_row * (row as f32 + 0.5);
            across += line.iter().enumerate().map(|(col, v)| v * (col as f32 + 0.5)).sum::<f32>();
        }
        if sum <= 0.0 {
            return [0.0; 2];
        }
        let side = SIDE as f32;
        [f64::from(across / sum / side - 0.5) * self.window.w, f64::from(down / sum / side - 0.5) * self.window.h]
    }

    /// The sums of the images, with the target's shape.
    pub(super) fn sums(&self, history: &PositionHistory) -> Sums {
        let [mut squares, mut alike, mut alike_there] = [0.0f32; 3];
        let [mut moving, mut whole] = [0.0f32; 2];
        let [mut mass, mut motion, mut seen] = [0.0f32; 3];
        for (cell, &shape) in history.image().iter().enumerate() {
            let (m, c, p) = (self.motion[cell], self.colour[cell], self.position[cell]);
            squares += c * shape * c * shape;
            alike_there += c * shape;
            alike += c;
            moving += m * c * p;
            whole += shape * p;
            mass += shape;
            motion += m * shape;
            seen += m.max(c) * shape;
        }
        let ratio = |a: f32, b: f32| if b > 0.0 { f64::from(a / b) } else { 0.0 };
        Sums {
            visibility: ratio(squares, alike),
            moving: ratio(moving, whole) * ratio(alike_there, alike),
            motion: ratio(motion, mass),
            colour: ratio(alike_there, mass),
            seen: ratio(seen, mass),
        }
    }
}

/// The positional image (eq 7): 1 in the middle, `edge` at the middle of each side, less towards the corners, never
/// below 0.
fn cone(edge: f64) -> Vec<f32> {
    let middle = SIDE as f64 / 2.0;
    let from_middle = |i: usize| (i as f64 + 0.5 - middle) / middle;
    let value = |i: usize| 1.0 - (1.0 - edge) * from_middle(i % SIDE).hypot(from_middle(i / SIDE));
    (0..CELLS).map(|i| value(i).max(0.0) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: [u8; 3] = [200, 10, 10];
    const GREEN: [u8; 3] = [10, 200, 10];

    /// Red in the left half of the region, which moves in its upper half; green on the right.
    fn halves() -> (Region, Colours, PositionHistory) {
        let mut region = Region { window: Rect::new(100.0, 50.0, 96.0, 48.0), ..Region::default() };
        let left = |cell: usize| cell % SIDE < SIDE / 2;
        for cell in 0..CELLS {
            region.inside[cell] = true;
            region.bins[cell] = colours::bin(if left(cell) { RED } else { GREEN });
            region.motion[cell] = if cell < CELLS / 2 { 1.0 } else { 0.0 };
        }
        let mut colours = Colours::new();
        let sides: Vec<i8> = (0..CELLS).map(|cell| if left(cell) { 1 } else { -1 }).collect();
        colours.learn(&region.bins, &sides, 10.0);
        let shape: Vec<f32> = (0..CELLS).map(|cell| if left(cell) { 0.5 } else { 0.0 }).collect();
        (region, colours, PositionHistory::new(&shape))
    }

    #[test]
    fn the_cone_is_highest_in_the_middle_and_least_at_the_edges() {
        for edge in [0.0, 0.4] {
            let cone = cone(edge);
            let at = |row: usize, col: usize| f64::from(cone[row * SIDE + col]);
            assert!(at(SIDE / 2, SIDE / 2) > 0.97, "{}", at(SIDE / 2, SIDE / 2));
            // Half a cell from the edge, by hand.
            let want = 1.0 - (1.0 - edge) * (23.5f64 / 24.0).hypot(0.5 / 24.0);
            assert!((at(SIDE / 2, 0) - want).abs() < 1e-6 && (at(0, SIDE / 2) - want).abs() < 1e-6);
            assert!(at(0, 0) <= edge);
        }
    }

    #[test]
    fn the_composite_takes_the_strongest_of_what_agrees() {
        let (mut region, colours, history) = halves();
        region.compose(&colours, &history);
        for (cell, name) in
            [(10 * SIDE + 20, "MCP"), (40 * SIDE + 20, "CP"), (10 * SIDE + 40, "P"), (40 * SIDE + 40, "P")]
        {
            let p = region.position[cell];
            let want = match name {
                "MCP" => (MOTION_WEIGHT * p).max(COLOUR_WEIGHT * 0.5),
                "CP" => COLOUR_WEIGHT * 0.5,
                _ => POSITION_WEIGHT * p,
            };
            assert!((region.composite[cell] - want).abs() < 1e-6, "{name}: {} {want}", region.composite[cell]);
        }
    }

    #[test]
    fn the_centre_of_mass_is_told_in_pixels_from_the_middle() {
        let (mut region, ..) = halves();
        region.composite.fill(0.0);
        assert_eq!(region.shift(), [0.0, 0.0]);
        // Cells of 2 x 1 px; the middle of cell 36 is 12.5 cells to the right, that of row 12 is 11.5 above.
        region.composite[12 * SIDE + 36] = 0.3;
        let [x, y] = region.shift();
        assert!((x - 25.0).abs() < 1e-4 && (y + 11.5).abs() < 1e-4, "{x} {y}");
    }

    /// The left half has the colours and, at 0.5 throughout, the shape; the upper half of it moves.
    #[test]
    fn sums_are_those_of_equations_11_and_14() {
        let (mut region, colours, history) = halves();
        region.compose(&colours, &history);
        let sums = region.sums(&history);
        let close = |a: f64, b: f64| (a - b).abs() < 1e-4;
        assert!(close(sums.visibility, 0.25), "the sum of 0.5 squared over that of 1: {sums:?}");
        // Motion of matching colour is half of the shape's cells, each with 1 where the shape has 0.5: 1 in all. Of all
        // that matches, 0.5 is where the target is remembered.
        assert!(close(sums.moving, 1.0 * 0.5), "{sums:?}");
        assert!(close(sums.motion, 0.5) && close(sums.colour, 1.0) && close(sums.seen, 1.0), "{sums:?}");
        region.inside.fill(false);
        region.motion.fill(0.0);
        region.compose(&colours, &history);
        assert_eq!(region.sums(&history), Sums::default());
    }
}
