//! The picture that all is computed on: what is seen, what moves in it, in which blobs, and whose each moving pixel is.

use crate::crop::{Cropper, Patch};
use crate::detect::background::{Background, BackgroundSettings};
use crate::detect::blobs::{Blob, BlobFinder, Morphology};
use crate::frame::Frame;
use crate::geometry::Rect;
use crate::params::MaptrackParams;

/// Of moving pixels that are no target's.
pub(super) const NOBODY: u8 = 0;

/// The picture of a frame, with its motion image. Coordinates are in its pixels, as everywhere in this tracker.
pub(super) struct View {
    cropper: Cropper,
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

impl View {
    pub(super) fn new(params: &MaptrackParams) -> Self {
        Self {
            cropper: Cropper::default(),
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

    /// Forgets the background where changed parameters ask for another model.
    pub(super) fn retune(&mut self, params: &MaptrackParams) {
        if *self.background.settings() != settings(params) {
            self.background = Background::new(settings(params));
        }
    }

    /// Whether it has never looked for motion.
    pub(super) fn is_fresh(&self) -> bool {
        self.background.frames() == 0
    }

    /// Sees a frame without looking for motion: the motion image tells nothing.
    pub(super) fn see(&mut self, frame: &Frame, params: &MaptrackParams) {
        let (width, height) = (f64::from(frame.width()), f64::from(frame.height()));
        let scale = (params.image.pixels as f64 / (width * height)).sqrt().min(1.0);
        let [w, h] = [width, height].map(|side| (side * scale).round().max(1.0));
        self.factors = [width / w, height / h];
        self.cropper.crop(frame, &frame.bounds(), w as usize, h as usize, &mut self.patch);
        self.believed = false;
    }

    /// Sees the next frame, what moves in it (section 3.2, the difference image) and in which blobs.
    pub(super) fn look(&mut self, frame: &Frame, params: &MaptrackParams) {
        self.see(frame, params);
        self.background.apply(&self.patch, &mut self.moving);
        let [width, height] = self.size();
        self.morphology.open_close(&mut self.moving, width, height, params.find.lambda as usize);
        let count = self.moving.iter().map(|&m| u32::from(m)).sum::<u32>();
        self.believed = f64::from(count) <= params.background.believed * (width * height) as f64;
        self.blobs.clear();
        if self.believed {
            self.finder.find(&self.moving, width, &mut self.blobs);
        }
        self.owners.clear();
        self.owners.resize(width * height, NOBODY);
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
    pub(super) fn shows(&self, _x: usize, _y: usize) -> bool {
        true
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

    /// A box of the frame in the view's pixels.
    pub(super) fn into_view(&self, rect: &Rect) -> Rect {
        let [x, y] = self.factors;
        Rect::new(rect.x / x, rect.y / y, rect.w / x, rect.h / y)
    }

    /// A box of the view in the frame's pixels.
    pub(super) fn into_frame(&self, rect: &Rect) -> Rect {
        let [x, y] = self.factors;
        Rect::new(rect.x * x, rect.y * y, rect.w * x, rect.h * y)
    }
}

fn settings(params: &MaptrackParams) -> BackgroundSettings {
    let background = &params.background;
    BackgroundSettings {
        gaussians: background.gaussians as usize,
        window: background.window as usize,
        share: background.share,
        deviations: background.deviations,
        least_deviation: background.least_deviation,
        shadow: background.shadow,
        ..BackgroundSettings::default()
    }
}
