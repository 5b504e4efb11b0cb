//! The colours of a target and of what is around it (eqs 2 to 4): histograms of red, green and blue, 32 bins each.

/// Bins of each colour; a bin is 8 intensities wide.
const SIDE: usize = 32;
/// Bits of an intensity that do not count.
const SHIFT: u32 = 8 - SIDE.ilog2();
/// All bins.
const BINS: usize = SIDE * SIDE * SIDE;

/// The bin of a colour: red, then green, then blue counts most.
pub(super) fn bin(rgb: [u8; 3]) -> u16 {
    rgb.iter().fold(0, |bin, &value| bin * SIDE as u16 + u16::from(value >> SHIFT))
}

/// The cumulative histograms H_fg and H_bg.
pub(super) struct Colours {
    foreground: Vec<f32>,
    background: Vec<f32>,
    /// Frames learned from: n of eq 3, before it is cut.
    frames: f64,
}

impl Colours {
    /// Of a target that nothing is known of.
    pub(super) fn new() -> Self {
        Self { foreground: vec![0.0; BINS], background: vec![0.0; BINS], frames: 0.0 }
    }

    /// Learns a frame (eqs 2 and 3) from pixels with their bins and what they are of: 1 for the target, -1 for the
    /// background, 0 for neither. The background counts as much as the target in all. Where one of the two has no
    /// pixels nothing is learned: both would have no magnitude then, as the paper says of a target that stands still.
    pub(super) fn learn(&mut self, bins: &[u16], sides: &[i8], longest: f64) {
        let count = |side: i8| sides.iter().filter(|&&s| s == side).count() as f32;
        let (foreground, background) = (count(1), count(-1));
        if foreground == 0.0 || background == 0.0 {
            return;
        }
        self.frames += 1.0;
        let n = self.frames.min(longest.max(1.0)) as f32;
        let kept = (n - 1.0) / n;
        self.foreground.iter_mut().chain(&mut self.background).for_each(|h| *h *= kept);
        for (&bin, &side) in bins.iter().zip(sides) {
            match side {
                1 => self.foreground[usize::from(bin)] += 1.0 / n,
                -1 => self.background[usize::from(bin)] += foreground / background / n,
                _ => {}
            }
        }
    }

    /// The probability that a pixel of this colour is the target's (eq 4), whose share of all pixels is `prior`
    /// (avgFG). A colour that was never seen tells nothing.
    pub(super) fn probability(&self, bin: u16, prior: f32) -> f32 {
        let target = self.foreground[usize::from(bin)] * prior;
        let around = self.background[usize::from(bin)] * (1.0 - prior);
        if target + around > 0.0 { target / (target + around) } else { prior }
    }

    /// How alike the target's colours are to those of another: the Bhattacharyya coefficient, 0 to 1.
    pub(super) fn likeness(&self, other: &Self) -> f64 {
        let sum = |h: &[f32]| h.iter().map(|&v| f64::from(v)).sum::<f64>();
        let shared: f64 = self.foreground.iter().zip(&other.foreground).map(|(&a, &b)| f64::from(a * b).sqrt()).sum();
        let sizes = (sum(&self.foreground) * sum(&other.foreground)).sqrt();
        if sizes > 0.0 { shared / sizes } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: [u8; 3] = [200, 10, 10];
    const GREEN: [u8; 3] = [10, 200, 10];
    const GREY: [u8; 3] = [90, 90, 90];

    /// So many pixels of each colour, and what they are of.
    fn pixels(counts: &[([u8; 3], i8, usize)]) -> (Vec<u16>, Vec<i8>) {
        counts.iter().flat_map(|&(rgb, side, count)| vec![(bin(rgb), side); count]).unzip()
    }

    #[test]
    fn a_bin_is_eight_intensities_of_each_colour() {
        assert_eq!((bin([7, 7, 7]), bin([8, 0, 0]), bin([0, 8, 0]), bin([0, 0, 8])), (0, 1024, 32, 1));
        assert_eq!(bin([255; 3]), (BINS - 1) as u16);
    }

    /// Frame 1: 4 target pixels (3 red, 1 grey), 8 around (green), which are weighed by 4 / 8. Frame 2: 2 target pixels
    /// (red), 2 around (1 red, 1 grey).
    #[test]
    fn histograms_are_running_averages_of_equal_magnitude() {
        let mut colours = Colours::new();
        let (bins, sides) = pixels(&[(RED, 1, 3), (GREY, 1, 1), (GREEN, -1, 8), (GREEN, 0, 5)]);
        colours.learn(&bins, &sides, 10.0);
        let at = |c: &Colours, rgb| (c.foreground[usize::from(bin(rgb))], c.background[usize::from(bin(rgb))]);
        assert_eq!([at(&colours, RED), at(&colours, GREY), at(&colours, GREEN)], [(3.0, 0.0), (1.0, 0.0), (0.0, 4.0)]);
        let (bins, sides) = pixels(&[(RED, 1, 2), (RED, -1, 1), (GREY, -1, 1)]);
        colours.learn(&bins, &sides, 10.0);
        assert_eq!([at(&colours, RED), at(&colours, GREY), at(&colours, GREEN)], [(2.5, 0.5), (0.5, 0.5), (0.0, 2.0)]);
        // Eq 4 by hand: 2.5 x 0.2 / (2.5 x 0.2 + 0.5 x 0.8).
        assert!((colours.probability(bin(RED), 0.2) - 0.5 / 0.9).abs() < 1e-6);
        assert_eq!(colours.probability(bin(GREEN), 0.2), 0.0);
        assert_eq!(colours.probability(bin([1, 2, 250]), 0.2), 0.2, "a colour that was never seen");
    }

    #[test]
    fn the_average_becomes_exponential_and_a_target_without_motion_teaches_nothing() {
        let mut colours = Colours::new();
        let (red, green) = (pixels(&[(RED, 1, 4), (GREY, -1, 4)]), pixels(&[(GREEN, 1, 4), (GREY, -1, 4)]));
        (0..10).for_each(|_| colours.learn(&red.0, &red.1, 2.0));
        colours.learn(&green.0, &green.1, 2.0);
        assert_eq!(colours.foreground[usize::from(bin(GREEN))], 2.0, "half of all, however many frames came before");
        let before = colours.foreground.clone();
        let (bins, sides) = pixels(&[(GREY, -1, 9)]);
        colours.learn(&bins, &sides, 2.0);
        assert_eq!(colours.foreground, before);
    }

    #[test]
    fn likeness_is_one_of_the_same_colours_and_none_of_others() {
        let learned = |target| {
            let mut colours = Colours::new();
            let (bins, sides) = pixels(&[(target, 1, 4), (GREY, 1, 4), (GREEN, -1, 3)]);
            colours.learn(&bins, &sides, 9.0);
            colours
        };
        let (a, b) = (learned(RED), learned(GREEN));
        assert!((a.likeness(&a) - 1.0).abs() < 1e-6 && (a.likeness(&b) - 0.5).abs() < 1e-6);
        assert_eq!(a.likeness(&Colours::new()), 0.0);
    }
}
