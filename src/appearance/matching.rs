//! Where a pair of networks finds the target as it was marked: crops, normalisation and decoding.
//!
//! The networks learn nothing while they are used: the template is the target of the first frame and cannot drift. They
//! answer cell by cell how much what is there looks like the target, and where its four sides are, so that they tell
//! its width and height as well (Li et al., *SiamRPN*, CVPR 2018; Xu et al., *SiamFC++*, AAAI 2020, for sides without
//! anchors). They tell the target from what surrounds it, not from its like.

use super::layers::SeenByNetwork;
use crate::crop::{Cropper, Patch};
use crate::features::FeatureMap;
use crate::frame::{Frame, Plane};
use crate::geometry::Rect;
use crate::network::{Framing, MatchingForm, SharedMatching, locked};

/// A target as one cell sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Match {
    /// The target's box, in pixels of the frame.
    pub rect: Rect,
    /// How much it looks like the target, 0 to 1.
    pub score: f64,
}

impl Match {
    /// Whether the networks told a box at all.
    pub fn is_a_box(&self) -> bool {
        self.rect.is_finite() && self.rect.w > 0.0 && self.rect.h > 0.0
    }
}

/// The target as it was marked, and where it was found last.
pub struct Matcher {
    network: SharedMatching,
    form: MatchingForm,
    template: Vec<FeatureMap>,
    /// The first frame's mean colour, which fills what lies outside of an image.
    outside: [u8; 3],
    window: Rect,
    matches: Vec<Match>,
    patch: Patch,
}

impl Matcher {
    /// Learns the target in `rect`.
    pub fn new(network: SharedMatching, frame: &Frame, cropper: &mut Cropper, rect: &Rect) -> Self {
        let form = *locked(&network).form();
        let matches = Vec::with_capacity(form.cells * form.cells);
        let outside = mean_colour(frame);
        let (template, patch) = Default::default();
        let mut made = Self { network, form, template, outside, window: *rect, matches, patch };
        made.cut(frame, cropper, rect.centre(), template_side(form.framing, rect.size()), form.template);
        made.template = locked(&made.network).learn(&made.patch);
        made
    }

    /// Goes on with what runs the same networks by now.
    pub fn use_network(&mut self, network: &SharedMatching) {
        self.network = network.clone();
    }

    /// The sizes that the networks' files tell.
    pub fn form(&self) -> &MatchingForm {
        &self.form
    }

    /// Looks for a target of size `size` around `centre`. `seen` is what a network saw in another look; where that is
    /// what would be run here, its maps serve.
    pub fn look(
        &mut self,
        frame: &Frame,
        cropper: &mut Cropper,
        centre: [f64; 2],
        size: [f64; 2],
        seen: Option<SeenByNetwork>,
    ) {
        let side = template_side(self.form.framing, size) * self.form.window as f64 / self.form.template as f64;
        let is_it = |seen: &SeenByNetwork| {
            self.form.framing == Framing::Area
                && seen.window == Rect::around(centre, [side; 2])
                && locked(&self.network).is_on(seen.cnn)
        };
        let seen = seen.filter(is_it);
        match &seen {
            Some(seen) => self.window = seen.window,
            None => self.cut(frame, cropper, centre, side, self.form.window),
        }
        let Self { network, form, matches, template, patch, .. } = self;
        let mut network = locked(network);
        match &seen {
            Some(seen) => network.compare_seen(template, seen.maps),
            None => network.compare(template, patch),
        }
        let (logits, sides) = (network.logits(), network.sides());
        // Boxes are told about the centre that was asked for: the window is rounded to pixels.
        let unit = side / form.window as f64;
        let offset = |cell: usize| (cell as f64 - (form.cells / 2) as f64) * form.stride as f64;
        matches.clear();
        for cell in 0..logits.cells() {
            let [x, y] = [offset(cell % form.cells), offset(cell / form.cells)];
            let logit = |channel: usize| f64::from(logits.plane(channel)[cell]);
            let [left, top, right, bottom] = [0, 1, 2, 3].map(|channel| f64::from(sides.plane(channel)[cell]));
            let corner = [centre[0] + (x - left) * unit, centre[1] + (y - top) * unit];
            let rect = Rect::new(corner[0], corner[1], (left + right) * unit, (top + bottom) * unit);
            let score = 1.0 / (1.0 + (logit(0) - logit(1)).exp());
            matches.push(Match { rect, score });
        }
    }

    /// Cuts out the square of `side` pixels around a point, as a patch of `pixels`.
    fn cut(&mut self, frame: &Frame, cropper: &mut Cropper, centre: [f64; 2], side: f64, pixels: usize) {
        match self.form.framing {
            Framing::Context => {
                self.window = whole_pixels(centre, side.round());
                cropper.crop_for_matching(frame, &self.window, pixels, self.outside, &mut self.patch);
            }
            Framing::Area => {
                self.window = Rect::around(centre, [side; 2]);
                cropper.crop(frame, &self.window, pixels, pixels, &mut self.patch);
            }
        }
    }

    /// What each cell saw in the last look, row by row.
    pub fn matches(&self) -> &[Match] {
        &self.matches
    }
}

/// The side of the square that shows a target of this size as a template, in pixels of the frame.
fn template_side(framing: Framing, [w, h]: [f64; 2]) -> f64 {
    match framing {
        Framing::Context => side_with_context([w, h]),
        Framing::Area => 2.0 * (w * h).sqrt(),
    }
}

/// The side of the square of a target with half of the mean of width and height around it on each side.
fn side_with_context([w, h]: [f64; 2]) -> f64 {
    let context = (w + h) / 2.0;
    ((w + context) * (h + context)).sqrt()
}

/// The square of whole pixels around a point.
fn whole_pixels(centre: [f64; 2], side: f64) -> Rect {
    // The middle pixel of an odd side is that which the point lies in.
    let first = |at: f64| (at - 0.5 - (side + 1.0) / 2.0 + 0.5).floor();
    Rect::new(first(centre[0]), first(centre[1]), side, side)
}

/// The mean colour of an image: red, green, blue, rounded down.
fn mean_colour(frame: &Frame) -> [u8; 3] {
    let [columns, rows] = frame.grid().map(|side| side as usize);
    let mut line = vec![0.0; columns];
    Plane::COLOURS.map(|plane| {
        let row = |y: usize| {
            frame.line(y, 0, plane, &mut line);
            line.iter().map(|&v| f64::from(v)).sum::<f64>()
        };
        ((0..rows).map(row).sum::<f64>() / (rows * columns) as f64) as u8
    })
}

/// How a target's size changes its score, and the score the size, in a short-term tracker of these networks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShortTerm {
    /// Share of the window in the score of a cell.
    pub influence: f64,
    /// How much a change of size and aspect is held against a cell.
    pub penalty: f64,
    /// Most of the size that one frame takes over.
    pub rate: f64,
}

impl ShortTerm {
    /// As NanoTrack V3 is published.
    pub const NANOTRACK_V3: Self = Self { influence: 0.455, penalty: 0.138, rate: 0.348 };

    /// The box of the target of `rect` in the frame, as the networks alone have it: the short-term tracker that they
    /// are published with. The last box stands for the search window's middle.
    pub fn step(&self, matcher: &mut Matcher, frame: &Frame, cropper: &mut Cropper, rect: &Rect) -> Rect {
        matcher.look(frame, cropper, rect.centre(), rect.size(), None);
        let cells = matcher.form.cells;
        // The window of Hann is 0 at its ends.
        let hann = |i: usize| 0.5 - 0.5 * (std::f64::consts::TAU * i as f64 / (cells - 1) as f64).cos();
        let value = |cell: usize, found: &Match| {
            let kept = found.score * size_penalty(self.penalty, rect.size(), found.rect.size());
            kept * (1.0 - self.influence) + hann(cell / cells) * hann(cell % cells) * self.influence
        };
        let best = matcher.matches.iter().enumerate().max_by(|a, b| value(a.0, a.1).total_cmp(&value(b.0, b.1)));
        let Some((_, found)) = best else { return *rect };
        let rate = self.rate * found.score * size_penalty(self.penalty, rect.size(), found.rect.size());
        let blend = |from: f64, to: f64| from + rate * (to - from);
        let most = [f64::from(frame.width()), f64::from(frame.height())];
        let size = [blend(rect.w, found.rect.w), blend(rect.h, found.rect.h)];
        // As published: at least 10 px, at most the image.
        Rect::around(frame.nearest(found.rect.centre()), [0, 1].map(|i| size[i].clamp(10.0, most[i].max(10.0))))
    }
}

/// What remains of a score where the size changes from one to the other: `exp(-k (r s - 1))`, `s` being the change of
/// size and `r` that of the aspect, either way and at least 1.
pub fn size_penalty(k: f64, from: [f64; 2], to: [f64; 2]) -> f64 {
    let change = |ratio: f64| ratio.max(1.0 / ratio);
    let size = change(side_with_context(to) / side_with_context(from));
    let aspect = change(from[0] / from[1] / (to[0] / to[1]));
    (-k * (size * aspect - 1.0)).exp()
}
