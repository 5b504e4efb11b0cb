//! Altered looks at the target in the first frame, which the filters are trained on as well: data augmentation.
//!
//! A single look teaches a filter what the target is down to its noise. Altered looks, blurred as by motion, nearer and
//! farther, mirrored and turned, teach it what stays when the target moves (in the manner of Bhat et al., *Unveiling
//! the Power of Deep Tracking*, ECCV 2018). As there, the strongest alterations are for the features of a network
//! alone: gradients and colours tell where the target is, and know it less well when it may be turned.

use super::settings::LookSettings;
use crate::crop::Alteration;
use crate::geometry::Rect;

/// How an altered look differs from the true one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Look {
    /// What is done to the picture.
    pub(super) alteration: Alteration,
    /// How much larger the target is.
    pub(super) scale: f64,
}

/// The altered looks at the target in `rect`; the strong ones, mirrored and turned, where those are wanted.
pub(super) fn looks(settings: &LookSettings, rect: &Rect, strong: bool) -> Vec<Look> {
    let mut looks = Vec::new();
    let altered = |alteration| Look { alteration, scale: 1.0 };
    if settings.blur > 0.0 {
        let reach = settings.blur * rect.scale();
        looks.extend([[reach, 0.0], [0.0, reach]].map(|blur| altered(Alteration { blur, ..Alteration::default() })));
    }
    if settings.scale > 1.0 {
        let scaled = |scale| Look { alteration: Alteration::default(), scale };
        looks.extend([settings.scale, 1.0 / settings.scale].map(scaled));
    }
    if strong && settings.mirror {
        looks.push(altered(Alteration { mirrored: true, ..Alteration::default() }));
    }
    if strong && settings.turn > 0.0 {
        let turned = |share: f64| altered(Alteration { turn: share * settings.turn, ..Alteration::default() });
        looks.extend([0.5, -0.5, 1.0, -1.0].map(turned));
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

    #[test]
    fn looks_are_blurred_and_of_other_sizes_and_the_strong_ones_mirrored_and_turned() {
        let settings = LookSettings { blur: 0.1, scale: 1.25, mirror: true, turn: 30.0 };
        let rect = Rect::new(3.0, 4.0, 20.0, 45.0);
        let look = |blur, mirrored, turn, scale| Look { alteration: Alteration { blur, mirrored, turn }, scale };
        let sharp = [1.25, 0.8].map(|scale| look([0.0; 2], false, 0.0, scale));
        let blurred = [[3.0, 0.0], [0.0, 3.0]].map(|blur| look(blur, false, 0.0, 1.0));
        let mirrored = [look([0.0; 2], true, 0.0, 1.0)];
        let turned = [15.0, -15.0, 30.0, -30.0].map(|turn| look([0.0; 2], false, turn, 1.0));
        let weak = [blurred, sharp].concat();
        assert_eq!(looks(&settings, &rect, false), weak);
        let all = looks(&settings, &rect, true);
        assert_eq!(all, [&weak[..], &mirrored, &turned].concat());
        assert_eq!(looks(&LookSettings { blur: 0.0, ..settings.clone() }, &rect, false), sharp);
        assert_eq!(looks(&LookSettings { scale: 1.0, ..settings.clone() }, &rect, false), blurred);
        let unturned = LookSettings { turn: 0.0, ..settings.clone() };
        assert_eq!(looks(&unturned, &rect, true), [&weak[..], &mirrored].concat());
        let upright = LookSettings { mirror: false, ..settings };
        assert_eq!(looks(&upright, &rect, true), [&weak[..], &turned].concat());
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
