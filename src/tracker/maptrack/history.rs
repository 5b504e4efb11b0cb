//! The motion history image (eq 8): what of its region a target has filled of late, so its shape and size.

/// Cells across and down a region.
pub(super) const SIDE: usize = 48;
/// All cells of a region.
pub(super) const CELLS: usize = SIDE * SIDE;

/// The image, and how much it has learned.
pub(super) struct PositionHistory {
    /// Per cell of the region, 0 to 1.
    image: Vec<f32>,
    /// The sum of all weights, cut at N (historysize).
    size: f64,
}

impl PositionHistory {
    /// One that begins with this image, which weighs as much as a frame that shows it whole.
    pub(super) fn new(image: &[f32]) -> Self {
        Self { image: image.to_vec(), size: share(image) }
    }

    /// The image, row-major as all of a region.
    pub(super) fn image(&self) -> &[f32] {
        &self.image
    }

    /// The share of the region that the target fills (avgFG of eq 4).
    pub(super) fn share(&self) -> f64 {
        share(&self.image)
    }

    /// Learns what moves and has the target's colours (MC). The more that is, the more it counts.
    pub(super) fn learn(&mut self, seen: &[f32], longest: f64) {
        let weight = share(seen);
        if weight <= 0.0 {
            return;
        }
        let (old, new) = (self.size as f32, weight as f32);
        for (history, seen) in self.image.iter_mut().zip(seen) {
            *history = (*history * old + seen * new) / (old + new);
        }
        self.size = (self.size + weight).min(longest);
    }
}

/// The mean of an image.
fn share(image: &[f32]) -> f64 {
    image.iter().map(|&v| f64::from(v)).sum::<f64>() / CELLS as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An image whose first cells are 1.
    fn filled(count: usize) -> Vec<f32> {
        (0..CELLS).map(|i| if i < count { 1.0 } else { 0.0 }).collect()
    }

    /// By hand: a history of weight 1/4 and a frame of weight 1/2 make 1/3 of one and 2/3 of the other.
    #[test]
    fn frames_count_as_much_as_moves_in_them() {
        let mut history = PositionHistory::new(&filled(CELLS / 4));
        assert_eq!(history.share(), 0.25);
        history.learn(&filled(CELLS / 2), 10.0);
        assert!((history.image[0] - 1.0).abs() < 1e-6 && (history.image[CELLS / 2 - 1] - 2.0 / 3.0).abs() < 1e-6);
        assert_eq!((history.image[CELLS - 1], history.size), (0.0, 0.75));
        history.learn(&filled(0), 10.0);
        assert_eq!(history.size, 0.75, "nothing moved");
    }

    #[test]
    fn what_is_long_ago_is_forgotten() {
        let mut history = PositionHistory::new(&filled(CELLS));
        (0..50).for_each(|_| history.learn(&filled(CELLS / 2), 2.0));
        assert_eq!(history.size, 2.0);
        assert!(history.image[CELLS - 1] < 0.01 && history.image[0] > 0.99);
    }
}
