//! The picture that all is computed on: what is seen, what moves in it, in which blobs, and whose each moving pixel is.

use crate::crop::{Cropper, Patch};
use crate::detect::background::{Background, BackgroundSettings};
use crate::detect::blobs::{Blob, BlobFinder, Morphology};
use crate::detect::camera::{CameraMotion, warp};
use crate::detect::stabilisation::Stabiliser;
use crate::frame::Frame;
use crate::geometry::Rect;
use crate::params::MaptrackParams;

/// Of moving pixels that are no target's.
pub(super) const NOBODY: u8 = 0;
/// The window of the view follows the camera when the picture has left it by this share of a side.
const ASTRAY: f64 = 0.1;
/// Gaussians of a pixel of the background.
const GAUSSIANS: usize = 4;
/// A camera that has turned by more than this, in radians, is taken for one that starts anew.
const TURNED: f64 = 0.2;

/// The picture of a frame, with its motion image. Coordinates are in its pixels, as everywhere in this tracker.
pub(super) struct SceneView {
    cropper: Cropper,
    stabiliser: Stabiliser,
    /// From the picture as it came to the view: what the camera did, less where the window is.
    motion: CameraMotion,
    /// Where the window of the view is in the scene, in whole pixels from where it began.
    origin: [f64; 2],
    /// The picture as it came, where it is stabilised, and which pixels of the view it covers.
    unsteady: Patch,
    covered: Vec<u8>,
    background: Background,
    morphology: Morphology,
    finder: BlobFinder,
    patch: Patch,
    /// The motion image, row-major: 1 where something moves, 0 elsewhere.
    moving: Vec<u8>,
    /// Whether the motion image tells anything.
    believed: bool,
    /// Whose a moving pixel is: a number from 1 on, or nobody's.
    owners: Vec<u8>,
    /// How well a moving pixel suits its owner.
    suits: Vec<f32>,
    blobs: Vec<Blob>,
    /// Scratch: the motion image without what is explained.
    rest: Vec<u8>,
    /// Pixels of the frame in a pixel of the view, across and down.
    factors: [f64; 2],
}

impl SceneView {
    pub(super) fn new(params: &MaptrackParams) -> Self {
        Self {
            cropper: Cropper::default(),
            stabiliser: Stabiliser::default(),
            motion: CameraMotion::none(0, 0),
            origin: [0.0; 2],
            unsteady: Patch::default(),
            covered: Vec::new(),
            background: Background::new(settings(params)),
            morphology: Morphology::default(),
            finder: BlobFinder::default(),
            patch: Patch::default(),
            moving: Vec::new(),
            believed: false,
            owners: Vec::new(),
            suits: Vec::new(),
            blobs: Vec::new(),
            rest: Vec::new(),
            factors: [1.0; 2],
        }
    }

    /// Learns the background anew, by another model.
    pub(super) fn forget_background(&mut self, params: &MaptrackParams) {
        self.background = Background::new(settings(params));
    }

    /// Whether it has never looked for motion.
    pub(super) fn is_fresh(&self) -> bool {
        self.background.frames() == 0
    }

    /// Sees a frame without looking for motion: the motion image tells nothing. The camera is taken to be where it was.
    pub(super) fn see(&mut self, frame: &Frame, params: &MaptrackParams) {
        let (width, height) = (f64::from(frame.width()), f64::from(frame.height()));
        let scale = (params.image.pixels as f64 / (width * height)).sqrt().min(1.0);
        let [w, h] = [width, height].map(|side| (side * scale).round().max(1.0));
        self.factors = [width / w, height / h];
        let (w, h) = (w as usize, h as usize);
        if !params.stabilisation.enabled || self.size() != [w, h] {
            (self.motion, self.origin) = (CameraMotion::none(w, h), [0.0; 2]);
            self.stabiliser.clear();
        }
        let seen = if params.stabilisation.enabled { &mut self.unsteady } else { &mut self.patch };
        self.cropper.crop(frame, &frame.bounds(), w, h, seen);
        self.steady(params);
        self.believed = false;
    }

    /// Warps the picture into the view (section 3.1, step 4).
    fn steady(&mut self, params: &MaptrackParams) {
        if params.stabilisation.enabled {
            warp(&self.unsteady, &self.motion, &mut self.patch, &mut self.covered);
        } else {
            self.covered.clear();
        }
    }

    /// Sees the next frame, what moves in it (section 3.2, the difference image) and in which blobs. Returns by how
    /// much the window of the view has moved over the scene, in whole pixels.
    pub(super) fn look(&mut self, frame: &Frame, params: &MaptrackParams) -> [f64; 2] {
        self.see(frame, params);
        let moved = if params.stabilisation.enabled { self.stabilise(params) } else { [0.0; 2] };
        self.background.apply(&self.patch, &mut self.moving);
        let [width, height] = self.size();
        self.moving.iter_mut().zip(&self.covered).for_each(|(moving, covered)| *moving &= covered);
        self.morphology.open_close(&mut self.moving, width, height, params.find.lambda as usize);
        let count = self.moving.iter().map(|&m| u32::from(m)).sum::<u32>();
        self.believed = f64::from(count) <= params.background.believed * (width * height) as f64;
        self.blobs.clear();
        if self.believed {
            self.finder.find(&self.moving, width, &mut self.blobs);
        }
        self.owners.clear();
        self.owners.resize(width * height, NOBODY);
        moved
    }

    /// Takes out the camera's motion (section 3.1). Where it goes far the window of the view goes along, and what is
    /// known of the background moves with it; where nothing tells its motion, or it has turned far, the background is
    /// learned anew.
    fn stabilise(&mut self, params: &MaptrackParams) -> [f64; 2] {
        let [width, height] = [self.unsteady.width, self.unsteady.height];
        let moved: [f64; 2];
        match self.stabiliser.step(&self.unsteady) {
            Some(motion) if motion.angle.abs() < TURNED => {
                let limits = [width, height].map(|side| ASTRAY * side as f64);
                moved = [0, 1].map(|i| {
                    let astray = motion.shift[i] - self.origin[i];
                    if astray.abs() > limits[i] { astray.round() } else { 0.0 }
                });
                if moved != [0.0; 2] {
                    self.background.shift(-moved[0] as i64, -moved[1] as i64);
                    self.origin = [0, 1].map(|i| self.origin[i] + moved[i]);
                }
                let shift = [0, 1].map(|i| motion.shift[i] - self.origin[i]);
                self.motion = CameraMotion { shift, ..motion };
            }
            _ => {
                self.background.clear();
                self.stabiliser.clear();
                moved = self.motion.shift.map(|shift| -shift);
                (self.motion, self.origin) = (CameraMotion::none(width, height), [0.0; 2]);
            }
        }
        self.steady(params);
        moved
    }

    /// Width and height.
    pub(super) fn size(&self) -> [usize; 2] {
        [self.patch.width, self.patch.height]
    }

    /// The whole picture as a box.
    pub(super) fn bounds(&self) -> Rect {
        Rect::new(0.0, 0.0, self.patch.width as f64, self.patch.height as f64)
    }

    /// The colour of a pixel.
    pub(super) fn rgb(&self, x: usize, y: usize) -> [u8; 3] {
        self.patch.rgb(x, y)
    }

    /// Whether the frame shows anything there.
    pub(super) fn shows(&self, x: usize, y: usize) -> bool {
        self.covered.is_empty() || self.covered[y * self.patch.width + x] != 0
    }

    /// Whether the motion image tells anything.
    pub(super) fn is_believed(&self) -> bool {
        self.believed
    }

    /// Whether something moves in a pixel that may be `owner`'s. Where motion tells nothing, all may move.
    pub(super) fn moves(&self, x: usize, y: usize, owner: u8) -> bool {
        let at = y * self.patch.width + x;
        !self.believed || (self.moving[at] != 0 && (self.owners[at] == NOBODY || self.owners[at] == owner))
    }

    /// What moves together.
    pub(super) fn blobs(&self) -> &[Blob] {
        &self.blobs
    }

    /// Nobody's pixels are claimed any more.
    pub(super) fn open_claims(&mut self) {
        self.suits.clear();
        self.suits.resize(self.owners.len(), 0.0);
    }

    /// Gives the moving pixels of a window to `owner` where they suit it better than whoever has them. `suit` takes the
    /// place in the window, 0 to 1 across and down, and the colour.
    pub(super) fn claim(&mut self, window: &Rect, owner: u8, suit: impl Fn([f64; 2], [u8; 3]) -> f32) {
        if !self.believed {
            return;
        }
        let [columns, rows] = window.pixels(self.size());
        for y in rows {
            let down = (y as f64 + 0.5 - window.y) / window.h;
            for x in columns.clone() {
                let at = y * self.patch.width + x;
                if self.moving[at] == 0 {
                    continue;
                }
                let suits = suit([(x as f64 + 0.5 - window.x) / window.w, down], self.patch.rgb(x, y));
                if suits > self.suits[at] {
                    (self.suits[at], self.owners[at]) = (suits, owner);
                }
            }
        }
    }

    /// The blobs of what moves outside of these boxes.
    pub(super) fn unexplained(&mut self, boxes: impl Iterator<Item = Rect>, lambda: i64, blobs: &mut Vec<Blob>) {
        blobs.clear();
        if !self.believed {
            return;
        }
        let [width, height] = self.size();
        self.rest.clone_from(&self.moving);
        for rect in boxes {
            let [columns, rows] = rect.pixels([width, height]);
            rows.for_each(|y| self.rest[y * width..][columns.clone()].fill(0));
        }
        self.morphology.open_close(&mut self.rest, width, height, lambda as usize);
        self.finder.find(&self.rest, width, blobs);
    }

    /// A box of the frame in the view's pixels. It stays upright, as the camera turns by little.
    pub(super) fn to_view(&self, rect: &Rect) -> Rect {
        let [x, y] = self.factors;
        let rect = Rect::new(rect.x / x, rect.y / y, rect.w / x, rect.h / y);
        Rect::around(self.motion.apply(rect.centre()), rect.size())
    }

    /// A box of the view in the frame's pixels.
    pub(super) fn to_frame(&self, rect: &Rect) -> Rect {
        let [x, y] = self.factors;
        let rect = Rect::around(self.motion.inverse().apply(rect.centre()), rect.size());
        Rect::new(rect.x * x, rect.y * y, rect.w * x, rect.h * y)
    }

    /// A velocity in the view in the frame's pixels.
    pub(super) fn velocity_to_frame(&self, velocity: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|i| velocity[i] * self.factors[i])
    }
}

fn settings(params: &MaptrackParams) -> BackgroundSettings {
    let background = &params.background;
    BackgroundSettings {
        gaussians: GAUSSIANS,
        window: background.window as usize,
        share: background.share,
        deviations: background.deviations,
        initial_deviation: background.initial_deviation,
        least_deviation: background.least_deviation,
        shadow: background.shadow,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Encoding;
    use crate::params::Params;

    const SIDE: u32 = 40;

    /// A white square over grey.
    fn picture(square: Option<usize>) -> Vec<u8> {
        let inside = |v: usize, from: usize| (from..from + 10).contains(&v);
        let pixel = |i: usize| square.is_some_and(|at| inside(i % SIDE as usize, at) && inside(i / SIDE as usize, 15));
        (0..(SIDE * SIDE) as usize).map(|i| if pixel(i) { 220 } else { 90 }).collect()
    }

    /// A view that has learned an empty scene and then looks at the square.
    fn view(params: &MaptrackParams, square: usize) -> SceneView {
        let mut view = SceneView::new(params);
        for n in 0..20 {
            let data = picture((n == 19).then_some(square));
            view.look(&Frame::new(&data, SIDE, SIDE, SIDE as usize, Encoding::Mono8, None).unwrap(), params);
        }
        view
    }

    #[test]
    fn what_moves_is_a_blob_and_each_of_its_pixels_is_whose_it_suits_best() {
        let params = Params::default().maptrack;
        let mut view = view(&params, 12);
        assert_eq!(view.blobs().iter().map(|blob| blob.rect).collect::<Vec<_>>(), [Rect::new(12.0, 15.0, 10.0, 10.0)]);
        assert!(view.moves(13, 16, 1) && view.moves(20, 16, 2) && !view.moves(5, 16, 1));
        view.open_claims();
        // One suits the left the better, the other the right: both by the place in their windows.
        view.claim(&Rect::new(7.0, 10.0, 20.0, 20.0), 1, |[across, _], _| 1.0 - across as f32);
        view.claim(&Rect::new(7.0, 10.0, 20.0, 20.0), 2, |[across, _], _| across as f32);
        assert!(view.moves(13, 16, 1) && !view.moves(13, 16, 2), "left of the middle");
        assert!(!view.moves(20, 16, 1) && view.moves(20, 16, 2), "right of it");
        let mut rest = Vec::new();
        view.unexplained([Rect::new(10.0, 10.0, 7.0, 30.0)].into_iter(), 3, &mut rest);
        assert_eq!(rest.iter().map(|blob| blob.rect).collect::<Vec<_>>(), [Rect::new(17.0, 15.0, 5.0, 10.0)]);
    }

    #[test]
    fn too_much_motion_is_not_believed() {
        let mut params = Params::default().maptrack;
        params.background.believed = 0.05;
        let view = view(&params, 12);
        assert!(!view.is_believed() && view.blobs().is_empty());
        assert!(view.moves(5, 16, 1), "all may move");
    }

    #[test]
    fn a_large_frame_is_seen_smaller_and_boxes_go_there_and_back() {
        let mut params = Params::default().maptrack;
        params.image.pixels = 1024;
        let mut view = SceneView::new(&params);
        let data = vec![0; 128 * 32];
        view.see(&Frame::new(&data, 128, 32, 128, Encoding::Mono8, None).unwrap(), &params);
        assert_eq!(view.size(), [64, 16]);
        let rect = Rect::new(20.0, 8.0, 10.0, 6.0);
        assert_eq!(view.to_view(&rect), Rect::new(10.0, 4.0, 5.0, 3.0));
        assert_eq!(view.to_frame(&view.to_view(&rect)), rect);
        assert_eq!(view.velocity_to_frame([1.0, 3.0]), [2.0, 6.0]);
    }
}
