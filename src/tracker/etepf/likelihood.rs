//! The likelihood image (eq 5) of the part of a frame in which the target may be, and what it and the colours there say
//! of a box (eqs 3, 4, 7 and 8).

use crate::crop::{Cropper, Patch};
use crate::detect::mean_shift::Map;
use crate::features::colour_histogram::{self, Histogram};
use crate::features::contrast::{self, AROUND};
use crate::features::pixelwise::{FEATURES, Pixelwise};
use crate::frame::Frame;
use crate::geometry::Rect;
use crate::learn::adaboost::{Ensemble, Votes};
use crate::params::EtepfFeatures;
use crate::trace::{Event, ResponseMap, Trace};

/// Reach of the neighbourhood whose gradients describe a pixel: 5 x 5, as in the paper.
const RADIUS: usize = 2;

/// A part of a frame in the tracker's pixels: those of the frame or, where the target is large, coarser ones.
#[derive(Default)]
pub(super) struct LikelihoodView {
    patch: Patch,
    pixelwise: Pixelwise,
    votes: Votes,
    /// Likelihoods, row-major `height x width`.
    values: Vec<f32>,
    /// Bins of the colours, likewise.
    bins: Vec<u8>,
    /// What is seen, in pixels of the frame.
    window: Rect,
    /// Pixels of the view in a pixel of the frame, across and down.
    zoom: [f64; 2],
}

impl LikelihoodView {
    /// Looks at the part of the frame that `area` covers, or at what is nearest to it, as finely as is fit for a target
    /// of this size.
    pub(super) fn look(
        &mut self,
        frame: &Frame,
        cropper: &mut Cropper,
        area: &Rect,
        size: [f64; 2],
        features: &EtepfFeatures,
    ) {
        let bounds = frame.bounds();
        // Whole pixels, at least one.
        let span = |low: f64, length: f64, limit: f64| {
            let first = low.floor().clamp(0.0, limit - 1.0);
            (first, (low + length).ceil().clamp(first + 1.0, limit) - first)
        };
        let ((x, w), (y, h)) = (span(area.x, area.w, bounds.w), span(area.y, area.h, bounds.h));
        self.window = Rect::new(x, y, w, h);
        let zoom = (features.pixels as f64 / (size[0] * size[1])).sqrt().min(1.0);
        let [width, height] = [w, h].map(|side| (side * zoom).round().max(1.0));
        self.zoom = [width / w, height / h];
        cropper.crop(frame, &self.window, width as usize, height as usize, &mut self.patch);
        colour_histogram::bins(&self.patch, &mut self.bins);
    }

    /// Makes the likelihood image of what is looked at: step 1 of the algorithm.
    pub(super) fn judge(&mut self, ensemble: &Ensemble<FEATURES>) {
        let Self { patch, pixelwise, votes, values, .. } = self;
        let width = patch.width;
        values.resize(width * patch.height, 0.0);
        pixelwise.rows(patch, RADIUS, |y, planes| {
            ensemble.likelihoods(planes, votes, &mut values[y * width..(y + 1) * width]);
        });
    }

    /// Calls `each` with the features of every pixel that is looked at, and the place of its centre in the frame.
    pub(super) fn pixels(&mut self, mut each: impl FnMut([f64; 2], [f32; FEATURES])) {
        let Self { patch, pixelwise, window, zoom, .. } = self;
        let width = patch.width;
        pixelwise.rows(patch, RADIUS, |y, planes| {
            for x in 0..width {
                let at = [window.x + (x as f64 + 0.5) / zoom[0], window.y + (y as f64 + 0.5) / zoom[1]];
                each(at, std::array::from_fn(|feature| planes[feature * width + x]));
            }
        });
    }

    /// Whether there is anything that a target of this size could be told from.
    pub(super) fn shows_anything(&self, size: [f64; 2]) -> bool {
        let side = |axis: usize| (AROUND * size[axis] * self.zoom[axis]).round() as usize;
        contrast::shows_anything(&self.patch, [side(0), side(1)])
    }

    /// How many pixels are looked at within a box.
    pub(super) fn count(&self, rect: &Rect) -> usize {
        let [columns, rows] = self.place(rect).pixels(self.shape());
        columns.len() * rows.len()
    }

    /// The likelihood mean of a box (eq 3). What is beyond the image is not the target.
    pub(super) fn mean(&self, rect: &Rect) -> f64 {
        let place = self.place(rect);
        self.map().sum(&place) / place.area()
    }

    /// The likelihood mean around a box, within the image and within `surround` times its sides (w_bg of eq 4); 0 where
    /// not a whole pixel is around it.
    pub(super) fn mean_around(&self, rect: &Rect, surround: f64) -> f64 {
        let (inner, outer) = (self.place(rect), self.place(&rect.scaled(surround)));
        let map = self.map();
        let area = |place: &Rect| place.intersection(&map.bounds()).area();
        let around = area(&outer) - area(&inner);
        if around >= 1.0 { ((map.sum(&outer) - map.sum(&inner)) / around).clamp(0.0, 1.0) } else { 0.0 }
    }

    /// The colours of a box, as far as it is within the image. One smaller than a pixel has that of a pixel.
    pub(super) fn histogram(&self, rect: &Rect) -> Histogram {
        let place = self.place(rect);
        let place = Rect::around(place.centre(), place.size().map(|side| side.max(1.0)));
        Histogram::of(&self.bins, self.patch.width, place.pixels(self.shape()))
    }

    /// Where the centre of a box comes to rest that climbs in the likelihood image, after so many steps at most.
    pub(super) fn climb(&self, rect: &Rect, steps: i64) -> [f64; 2] {
        let [x, y] = self.map().climb(self.place(rect), steps as usize);
        [self.window.x + x / self.zoom[0], self.window.y + y / self.zoom[1]]
    }

    /// What is looked at, in pixels of the frame.
    pub(super) fn window(&self) -> Rect {
        self.window
    }

    /// Shows the likelihood image.
    pub(super) fn show(&self, trace: &mut dyn Trace) {
        trace.event(Event::SearchWindow(self.window));
        let (rows, cols) = (self.patch.height, self.patch.width);
        trace.event(Event::Response(&ResponseMap { values: &self.values, rows, cols, window: self.window }));
    }

    fn shape(&self) -> [usize; 2] {
        [self.patch.width, self.patch.height]
    }

    fn map(&self) -> Map<'_> {
        Map { values: &self.values, width: self.patch.width, height: self.patch.height }
    }

    /// A box of the frame in pixels of the view.
    fn place(&self, rect: &Rect) -> Rect {
        let ([across, down], window) = (self.zoom, &self.window);
        Rect::new((rect.x - window.x) * across, (rect.y - window.y) * down, rect.w * across, rect.h * down)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Encoding;
    use crate::learn::adaboost::Weak;

    const WIDTH: usize = 40;
    const HEIGHT: usize = 30;

    fn data() -> Vec<u8> {
        (0..WIDTH * HEIGHT * 3).map(|i| ((i * i * 31 + i * 17 + 5) % 251) as u8).collect()
    }

    fn frame(data: &[u8]) -> Frame<'_> {
        Frame::new(data, WIDTH as u32, HEIGHT as u32, 3 * WIDTH, Encoding::Rgb8, None).unwrap()
    }

    /// Takes light for the target.
    fn ensemble() -> Ensemble<FEATURES> {
        let a = std::array::from_fn(|i| if i + 3 < FEATURES { 0.1 } else { 1.0 });
        Ensemble::new(vec![Weak { a, b: -1.5, alpha: 0.8 }, Weak { a, b: -1.9, alpha: 0.5 }])
    }

    fn view(area: &Rect, pixels: i64) -> LikelihoodView {
        let features = EtepfFeatures { pixels };
        let mut view = LikelihoodView::default();
        view.look(&frame(&data()), &mut Cropper::default(), area, [8.0, 8.0], &features);
        view.judge(&ensemble());
        view
    }

    #[test]
    fn each_likelihood_is_that_of_the_features_of_its_pixel() {
        let mut view = view(&Rect::new(4.0, 3.0, 20.0, 16.0), 2500);
        let (mut index, values) = (0, view.values.clone());
        view.pixels(|at, features| {
            let want = 1.0 / (1.0 + (-2.0 * ensemble().margin(&features)).exp());
            assert!((f64::from(values[index]) - want).abs() < 1e-6);
            assert_eq!(at, [4.5 + (index % 20) as f64, 3.5 + (index / 20) as f64]);
            index += 1;
        });
        assert_eq!((index, values.len()), (20 * 16, 20 * 16));
    }

    #[test]
    fn means_are_those_over_the_pixels_of_the_frame() {
        let view = view(&frame(&data()).bounds(), 2500);
        let naive = |inside: &dyn Fn(usize, usize) -> bool| {
            let pixels = (0..WIDTH * HEIGHT).filter(|i| inside(i % WIDTH, i / WIDTH));
            let values: Vec<f64> = pixels.map(|i| f64::from(view.values[i])).collect();
            (values.iter().sum::<f64>(), values.len() as f64)
        };
        let rect = Rect::new(10.0, 8.0, 8.0, 6.0);
        let inner = |x: usize, y: usize| (10..18).contains(&x) && (8..14).contains(&y);
        let ring = |x: usize, y: usize| (6..22).contains(&x) && (5..17).contains(&y) && !inner(x, y);
        let ((inside, area), (around, ring)) = (naive(&inner), naive(&ring));
        assert!((view.mean(&rect) - inside / area).abs() < 1e-6);
        assert!((view.mean_around(&rect, 2.0) - around / ring).abs() < 1e-6);
        // Half of it is beyond the image.
        let (inside, _) = naive(&|x, y| x < 4 && (8..14).contains(&y));
        assert!((view.mean(&Rect::new(-4.0, 8.0, 8.0, 6.0)) - inside / 48.0).abs() < 1e-6);
        assert_eq!(view.mean(&Rect::new(-50.0, 8.0, 8.0, 6.0)), 0.0);
        assert_eq!(view.mean_around(&Rect::new(-50.0, 8.0, 8.0, 6.0), 2.0), 0.0);
        // Around the whole image, there is what rounding leaves.
        let whole = Rect::new(1e-13, -1e-13, WIDTH as f64 - 3e-13, HEIGHT as f64);
        assert_eq!(view.mean_around(&whole, 2.0), 0.0);
    }

    #[test]
    fn a_box_between_the_centres_of_pixels_has_the_colour_of_one() {
        let view = view(&frame(&data()).bounds(), 2500);
        for y in [8.0, 8.3, 8.6, 9.0] {
            let thin = view.histogram(&Rect::new(10.0, y, 8.0, 0.4));
            let row = |y: f64| view.histogram(&Rect::new(10.0, y, 8.0, 1.0));
            assert!(thin == row(8.0) || thin == row(9.0), "{y}");
            assert!((thin.likeness(&thin) - 1.0).abs() < 1e-6, "{y}");
        }
    }

    #[test]
    fn large_targets_are_seen_smaller_and_areas_beyond_the_image_as_its_border() {
        let half = view(&Rect::new(4.0, 3.0, 20.0, 16.0), 16);
        assert_eq!((half.shape(), half.window), ([10, 8], Rect::new(4.0, 3.0, 20.0, 16.0)));
        assert_eq!(half.place(&Rect::new(8.0, 5.0, 8.0, 4.0)), Rect::new(2.0, 1.0, 4.0, 2.0));
        for area in [Rect::new(-70.0, 5.0, 20.0, 900.0), Rect::new(70.0, 50.0, 3.0, 3.0), Rect::new(0.0, 0.0, 1e9, 1e9)]
        {
            let view = view(&area, 2500);
            let inside = view.window.intersection(&frame(&data()).bounds());
            assert!(view.window == inside && inside.w >= 1.0 && inside.h >= 1.0, "{}", view.window);
        }
    }
}
