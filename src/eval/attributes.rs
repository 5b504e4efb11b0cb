//! What makes a sequence hard, by rules, for the data says nothing of it: from the true boxes, from how much of them is
//! hidden, and from the light on the target.
//!
//! The attributes are those of the object tracking benchmark (Wu, Lim and Yang, CVPR 2013, table 2) that can be
//! computed; where it names a threshold, that is taken. Each but out of view must hold in 5 % of the frames, so that
//! one jump of a box does not put a sequence among the fast ones.

use serde::Serialize;

use super::dataset::Sequence;
use crate::crop::{Cropper, Patch};
use crate::frame::Frame;
use crate::geometry::{Rect, distance};
use crate::params::Limits;
use crate::replay::{self, ReplayError};

/// Share of the frames in which the rule must hold.
pub const LEAST_SHARE: f64 = 0.05;
/// Hidden share of the box from which the target is occluded.
pub const OCCLUDED: f64 = 0.5;
/// Pixels from frame to frame above which motion is fast (the benchmark's).
pub const FAST_PIXELS: f64 = 20.0;
/// Target sizes from frame to frame above which it is fast as well, for small targets.
pub const FAST_SIZES: f64 = 0.25;
/// Ratio of areas to that of the first box, or its inverse, above which the scale varies (the benchmark's).
pub const SCALE_RATIO: f64 = 2.0;
/// Ratio of the mean luma in the box to that of the first, or its inverse, above which the light varies.
pub const LIGHT_RATIO: f64 = 1.5;
/// The light is looked at in every so many frames.
pub const LIGHT_STRIDE: usize = 5;
/// The box is resampled to so many columns and rows for its mean luma.
const LIGHT_SAMPLES: usize = 16;

/// What makes a sequence hard.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Attribute {
    /// Half of the box is hidden; only of sequences of which that is known.
    Occlusion,
    /// The centre moves by more than 20 px, or than a quarter of the target's size, from frame to frame.
    FastMotion,
    /// The area is more than twice, or less than half, that of the first box.
    ScaleVariation,
    /// The mean luma in the box is more than 1.5 times, or less than 1/1.5, that in the first; where less than half
    /// of it is hidden.
    LightVariation,
    /// The target is not in view, be it on one frame.
    OutOfView,
}

impl Attribute {
    /// All, in the order of tables.
    pub const ALL: [Self; 5] =
        [Self::Occlusion, Self::FastMotion, Self::ScaleVariation, Self::LightVariation, Self::OutOfView];

    /// What tables call it.
    pub const fn label(self) -> &'static str {
        match self {
            Self::Occlusion => "occlusion",
            Self::FastMotion => "fast motion",
            Self::ScaleVariation => "scale variation",
            Self::LightVariation => "illumination variation",
            Self::OutOfView => "out of view",
        }
    }

    /// The rule, for people.
    pub fn rule(self) -> String {
        let share = LEAST_SHARE * 100.0;
        match self {
            Self::Occlusion => {
                format!("at least {OCCLUDED} of the box occluded in {share} % of the frames, where known")
            }
            Self::FastMotion => format!(
                "moves by more than {FAST_PIXELS} px or {FAST_SIZES} target sizes per frame in {share} % of the frames"
            ),
            Self::ScaleVariation => {
                format!("area more than {SCALE_RATIO} times the first, or its inverse, in {share} % of the frames")
            }
            Self::LightVariation => format!(
                "mean luma in the box more than {LIGHT_RATIO} times the first, or its inverse, in {share} % of the \
                 frames"
            ),
            Self::OutOfView => "not in view in at least one frame".to_owned(),
        }
    }
}

/// The attributes of the first `limit` frames of a sequence. Reads every fifth frame, for the light.
pub fn of(sequence: &Sequence, limit: usize) -> Result<Vec<Attribute>, ReplayError> {
    let frames = sequence.truth.len().min(limit);
    let light = light(sequence, frames)?;
    let holds = |attribute| holds(attribute, &sequence.truth[..frames], sequence.hidden.as_deref(), &light);
    Ok(Attribute::ALL.into_iter().filter(|&a| holds(a)).collect())
}

/// Whether the rule of an attribute holds, with the mean lumas in the boxes that were looked at.
fn holds(attribute: Attribute, truth: &[Option<Rect>], hidden: Option<&[f64]>, light: &[f64]) -> bool {
    let often = |hits: usize, of: usize| of > 0 && hits as f64 >= LEAST_SHARE * of as f64;
    let beyond = |ratio: f64, limit: f64| ratio > limit || ratio < 1.0 / limit;
    let boxes = || truth.iter().flatten();
    match attribute {
        Attribute::Occlusion => {
            let shares = hidden.map_or(&[][..], |h| &h[..truth.len()]);
            let known = || shares.iter().zip(truth).filter(|(_, t)| t.is_some());
            often(known().filter(|(share, _)| **share >= OCCLUDED).count(), known().count())
        }
        Attribute::FastMotion => {
            let pairs = || truth.windows(2).filter_map(|w| Some((w[0]?, w[1]?)));
            let is_fast = |(a, b): &(Rect, Rect)| {
                let moved = distance(a.centre(), b.centre());
                moved > FAST_PIXELS || moved > FAST_SIZES * a.scale()
            };
            often(pairs().filter(is_fast).count(), pairs().count())
        }
        Attribute::ScaleVariation => {
            let first = boxes().next().map_or(1.0, Rect::area);
            often(boxes().filter(|b| beyond(b.area() / first, SCALE_RATIO)).count(), boxes().count())
        }
        Attribute::LightVariation => {
            let first = light.first().copied().unwrap_or_default().max(1.0);
            often(light.iter().filter(|v| beyond(**v / first, LIGHT_RATIO)).count(), light.len())
        }
        Attribute::OutOfView => truth.iter().any(Option::is_none),
    }
}

/// The mean luma in the true box of every fifth frame, where it is known and less than half hidden.
fn light(sequence: &Sequence, frames: usize) -> Result<Vec<f64>, ReplayError> {
    let is_clear = |i: usize| sequence.hidden.as_ref().is_none_or(|h| h[i] < OCCLUDED);
    let wanted: Vec<usize> = (0..frames).step_by(LIGHT_STRIDE).filter(|&i| is_clear(i)).collect();
    let mut found = Vec::new();
    visit(sequence, &wanted, |i, frame| {
        found.extend(sequence.truth[i].and_then(|rect| luma(frame, &rect)));
    })?;
    Ok(found)
}

/// Shows those frames of a sequence, in rising order, as far as there are.
pub(super) fn visit(
    sequence: &Sequence,
    wanted: &[usize],
    mut show: impl FnMut(usize, &Frame),
) -> Result<(), ReplayError> {
    let mut source = replay::open(&sequence.path, None, &Limits::default())?;
    let mut at = 0;
    for &index in wanted {
        while at < index && source.skip_frame()? {
            at += 1;
        }
        let Some(buffer) = source.next_frame()? else { break };
        show(index, &buffer.frame());
        at += 1;
    }
    Ok(())
}

/// The mean luma, 0 to 255, of the part of a box that lies in the image; `None` where none does.
fn luma(frame: &Frame, rect: &Rect) -> Option<f64> {
    let inside = rect.intersection(&frame.bounds());
    if inside.area() <= 0.0 {
        return None;
    }
    let mut patch = Patch::default();
    Cropper::default().crop_luma(frame, &inside, LIGHT_SAMPLES, LIGHT_SAMPLES, &mut patch);
    let values = &patch.planes()[0];
    Some(values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Encoding;

    const FRAMES: usize = 100;
    const BOX: Rect = Rect::new(10.0, 10.0, 40.0, 40.0);

    /// A hundred frames of which so many are not as the first.
    fn truth(odd: usize, of: impl Fn(usize) -> Option<Rect>) -> Vec<Option<Rect>> {
        (0..FRAMES).map(|i| if i >= FRAMES - odd { of(i) } else { Some(BOX) }).collect()
    }

    #[test]
    fn each_rule_must_hold_in_a_twentieth_of_the_frames() {
        let scaled = |odd| holds(Attribute::ScaleVariation, &truth(odd, |_| Some(BOX.scaled(1.5))), None, &[]);
        assert_eq!((scaled(4), scaled(5)), (false, true));
        let smaller = holds(Attribute::ScaleVariation, &truth(50, |_| Some(BOX.scaled(0.75))), None, &[]);
        assert!(!smaller, "more than half the area");
        let moved = |odd, step: f64| {
            let boxes = truth(odd, |i| Some(BOX.shifted(step * i as f64, 0.0)));
            holds(Attribute::FastMotion, &boxes, None, &[])
        };
        assert!(moved(8, 10.5) && !moved(8, 9.5), "10 px are a quarter of its size");
        assert!(!moved(3, 10.5));
        let hidden = |odd| {
            let shares: Vec<f64> = (0..FRAMES).map(|i| if i < odd { 0.5 } else { 0.4 }).collect();
            holds(Attribute::Occlusion, &truth(0, |_| None), Some(&shares), &[])
        };
        assert_eq!((hidden(4), hidden(5)), (false, true));
        assert!(!holds(Attribute::Occlusion, &truth(0, |_| None), None, &[]), "nothing is known of it");
        let lit = |value: f64| holds(Attribute::LightVariation, &[], None, &[100.0, 100.0, value]);
        assert!(lit(151.0) && lit(66.0) && !lit(149.0) && !lit(67.0));
        let gone = |odd| holds(Attribute::OutOfView, &truth(odd, |_| None), None, &[]);
        assert_eq!((gone(0), gone(1)), (false, true));
    }

    #[test]
    fn the_light_is_that_in_the_box() {
        let (width, height) = (32, 24);
        let data: Vec<u8> = (0..width * height).map(|i| if i % width < 16 { 40 } else { 200 }).collect();
        let frame = Frame::new(&data, width as u32, height as u32, width, Encoding::Mono8, None).unwrap();
        let of = |x, w| luma(&frame, &Rect::new(x, 4.0, w, 8.0)).map(f64::round);
        assert_eq!((of(2.0, 10.0), of(20.0, 8.0), of(8.0, 16.0)), (Some(40.0), Some(200.0), Some(120.0)));
        assert_eq!((of(28.0, 20.0), of(-20.0, 25.0), of(-20.0, 10.0)), (Some(200.0), Some(40.0), None));
    }

    #[test]
    fn attributes_are_told_of_files_as_they_are() {
        let dir = tempfile::tempdir().unwrap();
        for i in 0..11u8 {
            let grey = if i < 6 { 100 } else { 200 };
            let image = image::GrayImage::from_pixel(64, 64, image::Luma([grey]));
            image.save(dir.path().join(format!("{i}.png"))).unwrap();
        }
        let sequence = |truth: Vec<Option<Rect>>| Sequence {
            name: "a".to_owned(),
            path: dir.path().to_owned(),
            hidden: Some(vec![0.0; truth.len()]),
            truth,
        };
        let mut truth = vec![Some(BOX); 11];
        assert_eq!(of(&sequence(truth.clone()), usize::MAX).unwrap(), [Attribute::LightVariation]);
        assert_eq!(of(&sequence(truth.clone()), 10).unwrap(), [], "the eleventh frame is the third looked at");
        truth[3] = None;
        assert_eq!(of(&sequence(truth), 10).unwrap(), [Attribute::OutOfView]);
    }
}
