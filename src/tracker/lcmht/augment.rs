//! Altered looks at the target in the first frame, which the filter is trained on as well: data augmentation.
//!
//! A single look teaches a filter what the target is down to its noise. Altered looks, blurred as by motion, nearer and
//! farther, teach it what stays when the target moves and turns (in the manner of Bhat et al., *Unveiling the Power of
//! Deep Tracking*, ECCV 2018).

use crate::geometry::Rect;
use crate::params::LcmhtAugment;

/// How an altered look differs from the true one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Look {
    /// How far it is blurred to either side, across and down, in pixels.
    pub(super) blur: [f64; 2],
    /// How much larger the target is.
    pub(super) scale: f64,
}

/// The altered looks at the target in `rect`.
pub(super) fn looks(settings: &LcmhtAugment, rect: &Rect) -> Vec<Look> {
    let mut looks = Vec::new();
    if settings.enabled && settings.blur > 0.0 {
        let reach = settings.blur * rect.scale();
        looks.extend([[reach, 0.0], [0.0, reach]].map(|blur| Look { blur, scale: 1.0 }));
    }
    if settings.enabled && settings.scale > 1.0 {
        looks.extend([settings.scale, 1.0 / settings.scale].map(|scale| Look { blur: [0.0; 2], scale }));
    }
    looks
}

/// The rate at which the `i`th of so many altered looks is learned after the true one, so that at last they weigh alike
/// and together as much as that.
pub(super) fn rate(i: usize, looks: usize) -> f32 {
    1.0 / (looks + i + 1) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::Params;

    #[test]
    fn looks_are_blurred_across_and_down_and_of_other_sizes() {
        let settings = LcmhtAugment { blur: 0.1, scale: 1.25, ..Params::default().lcmht.augment };
        let rect = Rect::new(3.0, 4.0, 20.0, 45.0);
        let look = |blur, scale| Look { blur, scale };
        let sharp = [look([0.0, 0.0], 1.25), look([0.0, 0.0], 0.8)];
        let blurred = [look([3.0, 0.0], 1.0), look([0.0, 3.0], 1.0)];
        assert_eq!(looks(&settings, &rect), [blurred, sharp].concat());
        assert_eq!(looks(&LcmhtAugment { blur: 0.0, ..settings.clone() }, &rect), sharp);
        assert_eq!(looks(&LcmhtAugment { scale: 1.0, ..settings.clone() }, &rect), blurred);
        assert_eq!(looks(&LcmhtAugment { enabled: false, ..settings }, &rect), []);
    }

    #[test]
    fn altered_looks_weigh_alike_and_together_as_much_as_the_true_one() {
        let mut weights = vec![1.0f32];
        for i in 0..4 {
            weights.iter_mut().for_each(|w| *w *= 1.0 - rate(i, 4));
            weights.push(rate(i, 4));
        }
        for (weight, wanted) in weights.iter().zip([0.5, 0.125, 0.125, 0.125, 0.125]) {
            assert!((weight - wanted).abs() < 1e-6, "{weights:?}");
        }
    }
}
