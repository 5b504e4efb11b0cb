//! Debug drawing: what a tracker saw and thought, on the frame it saw. Used by `track --annotate`, by the node's
//! debug images and by the demo; the core never comes here.
//!
//! [`Scene`] is the [`Trace`] that keeps what one step shows; [`annotated`] and [`response`] draw it.

use std::ops::Range;
use std::sync::LazyLock;

use ab_glyph::FontRef;
use image::{Rgb, RgbImage};
use imageproc::drawing::{draw_filled_rect_mut, draw_text_mut, text_size};

use crate::frame::Frame;
use crate::geometry::Rect;
use crate::trace::{Proposal, ResponseMap, Trace};
use crate::tracker::{Output, State, Target};

/// Colour of a box by what the tracker says of it.
const TRACKING: Rgb<u8> = Rgb([60, 220, 90]);
const UNCERTAIN: Rgb<u8> = Rgb([255, 190, 0]);
const LOST: Rgb<u8> = Rgb([255, 70, 60]);
const SEARCH_WINDOW: Rgb<u8> = Rgb([90, 170, 255]);
const PREDICTION: Rgb<u8> = Rgb([255, 255, 255]);
const PROPOSAL: Rgb<u8> = Rgb([240, 90, 240]);
/// Behind text, and outside the border of lines, so that they stand out from any background.
const DARK: Rgb<u8> = Rgb([16, 16, 20]);

/// The larger side of an image over the height of its text, and over the thickness of its lines.
const SIDE_TO_TEXT: f64 = 32.0;
const SIDE_TO_LINE: f64 = 400.0;
/// Below, text cannot be read.
const MIN_TEXT: f64 = 13.0;
/// Length of a dash, in line thicknesses.
const DASH: f64 = 5.0;

/// What remains of the frame around a response map, and, as grey, below it.
const DIMMED: f64 = 0.4;
const BELOW_MAP: f64 = 0.25;
/// The colours of a response map span 0 to its peak, but at least this much: the map of a target that is not
/// there stays dark.
const MIN_SPAN: f32 = 0.3;
/// Viridis (Smith and van der Walt, released as CC0) at eight equal steps: lightness grows evenly with the value.
const VIRIDIS: [[u8; 3]; 9] = [
    [68, 1, 84],
    [71, 45, 123],
    [59, 82, 139],
    [44, 114, 142],
    [33, 145, 140],
    [40, 174, 128],
    [94, 201, 98],
    [173, 220, 48],
    [253, 231, 37],
];

static FONT: LazyLock<FontRef<'static>> = LazyLock::new(|| {
    FontRef::try_from_slice(epaint_default_fonts::HACK_REGULAR).expect("the font that is built in can be read")
});

/// What one step shows of itself, of all targets. Clear it before each step; its buffers are reused.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    search_windows: Vec<Rect>,
    predictions: Vec<Rect>,
    proposals: Vec<Proposal>,
    maps: Vec<MapShape>,
    /// Of all maps, one after the other.
    values: Vec<f32>,
}

#[derive(Clone, Debug)]
struct MapShape {
    rows: usize,
    cols: usize,
    window: Rect,
    /// Where its values are.
    values: Range<usize>,
}

impl Scene {
    /// Forgets the last step.
    pub fn clear(&mut self) {
        self.search_windows.clear();
        self.predictions.clear();
        self.proposals.clear();
        self.maps.clear();
        self.values.clear();
    }
}

impl Trace for Scene {
    fn search_window(&mut self, window: Rect) {
        self.search_windows.push(window);
    }

    fn prediction(&mut self, rect: Rect) {
        self.predictions.push(rect);
    }

    fn response(&mut self, map: &ResponseMap) {
        let first = self.values.len();
        self.values.extend_from_slice(map.values);
        let values = first..self.values.len();
        self.maps.push(MapShape { rows: map.rows, cols: map.cols, window: map.window, values });
    }

    fn proposals(&mut self, proposals: &[Proposal]) {
        self.proposals.extend_from_slice(proposals);
    }
}

/// The frame with the search window (thin, blue), the prediction (dashed, white), the proposals (magenta) and the
/// box of each target (green: tracking, amber: uncertain, red: lost) with a line that gives its state, confidence
/// and id. Thickness and text grow with the frame.
pub fn annotated(frame: &Frame, output: &Output, scene: &Scene) -> RgbImage {
    let mut image = rgb(frame);
    let pen = Pen::for_image(&image);
    for window in &scene.search_windows {
        pen.thin().outline(&mut image, window, SEARCH_WINDOW);
    }
    for proposal in &scene.proposals {
        pen.thin().outline(&mut image, &proposal.rect, PROPOSAL);
    }
    for prediction in &scene.predictions {
        pen.thin().dashed(&mut image, prediction, PREDICTION);
    }
    for target in &output.targets {
        pen.outline(&mut image, &target.rect, colour(target.state));
    }
    for target in &output.targets {
        pen.label(&mut image, &target.rect, &caption(target), colour(target.state));
    }
    image
}

/// The fused response maps in colour, each in its place over the darkened frame, with the values of their peaks. Where
/// the step made none, the darkened frame alone.
pub fn response(frame: &Frame, scene: &Scene) -> RgbImage {
    let mut image = rgb(frame);
    for value in image.iter_mut() {
        *value = (f64::from(*value) * DIMMED) as u8;
    }
    let maps = || scene.maps.iter().filter(|m| m.rows > 0 && m.cols > 0 && m.window.area() > 0.0);
    for map in maps() {
        paint(&mut image, frame, map, &scene.values[map.values.clone()]);
    }
    let pen = Pen::for_image(&image);
    for map in maps() {
        pen.thin().outline(&mut image, &map.window, SEARCH_WINDOW);
        let peak = highest(&scene.values[map.values.clone()]);
        pen.label(&mut image, &map.window, &format!("peak {peak:.2}"), PREDICTION);
    }
    image
}

fn highest(values: &[f32]) -> f32 {
    values.iter().copied().fold(0.0, f32::max)
}

/// Lays one map over the frame.
fn paint(image: &mut RgbImage, frame: &Frame, map: &MapShape, values: &[f32]) {
    let span = highest(values).max(MIN_SPAN);
    let inside = map.window.intersection(&frame.bounds());
    for y in inside.y.round() as u32..(inside.y + inside.h).round() as u32 {
        let row = (f64::from(y) + 0.5 - map.window.y) / map.window.h * map.rows as f64 - 0.5;
        for x in inside.x.round() as u32..(inside.x + inside.w).round() as u32 {
            let col = (f64::from(x) + 0.5 - map.window.x) / map.window.w * map.cols as f64 - 0.5;
            let colour = viridis(bilinear(values, map, row, col) / span);
            let below = frame.rgb(x as usize, y as usize).iter().map(|&v| f64::from(v)).sum::<f64>() / 3.0;
            let mix = |c: u8| (BELOW_MAP * below + (1.0 - BELOW_MAP) * f64::from(c)) as u8;
            image.put_pixel(x, y, Rgb(colour.map(mix)));
        }
    }
}

/// Writes a line of text in the top-left corner.
pub fn heading(image: &mut RgbImage, text: &str) {
    Pen::for_image(image).label(image, &Rect::default(), text, PREDICTION);
}

/// The frame as RGB, whatever its encoding and step.
fn rgb(frame: &Frame) -> RgbImage {
    RgbImage::from_fn(frame.width(), frame.height(), |x, y| Rgb(frame.rgb(x as usize, y as usize)))
}

fn colour(state: State) -> Rgb<u8> {
    match state {
        State::Tracking => TRACKING,
        State::Uncertain => UNCERTAIN,
        State::Lost => LOST,
    }
}

fn caption(target: &Target) -> String {
    let found = if target.reacquired { " found" } else { "" };
    format!("{}{found} {:.2} #{}", target.state.name(), target.confidence, target.id)
}

/// The map's value at a fractional cell; beyond the centres of the outermost cells it stays constant.
fn bilinear(values: &[f32], map: &MapShape, row: f64, col: f64) -> f32 {
    let split = |at: f64, count: usize| {
        let at = at.clamp(0.0, (count - 1) as f64);
        let low = at as usize;
        (low, (low + 1).min(count - 1), (at - low as f64) as f32)
    };
    let (r0, r1, fr) = split(row, map.rows);
    let (c0, c1, fc) = split(col, map.cols);
    let along = |r: usize| {
        let (a, b) = (values[r * map.cols + c0], values[r * map.cols + c1]);
        a + fc * (b - a)
    };
    let (top, bottom) = (along(r0), along(r1));
    top + fr * (bottom - top)
}

/// The colour of a value in 0 to 1; what lies outside takes the colour of the nearer end.
fn viridis(value: f32) -> [u8; 3] {
    let steps = VIRIDIS.len() - 1;
    let at = value.clamp(0.0, 1.0) * steps as f32;
    let low = (at as usize).min(steps - 1);
    let share = at - low as f32;
    [0, 1, 2].map(|c| {
        let (a, b) = (f32::from(VIRIDIS[low][c]), f32::from(VIRIDIS[low + 1][c]));
        (a + share * (b - a)).round() as u8
    })
}

/// Line thickness and text height, in pixels.
#[derive(Clone, Copy)]
struct Pen {
    line: i32,
    text: f64,
}

impl Pen {
    fn for_image(image: &RgbImage) -> Self {
        let side = f64::from(image.width().max(image.height()));
        Self { line: ((side / SIDE_TO_LINE).round() as i32).max(1) + 1, text: (side / SIDE_TO_TEXT).max(MIN_TEXT) }
    }

    /// Half as thick.
    fn thin(self) -> Self {
        Self { line: (self.line / 2).max(1), ..self }
    }

    /// The four sides of a box, around its border.
    fn outline(&self, image: &mut RgbImage, rect: &Rect, colour: Rgb<u8>) {
        self.sides(rect, |x, y, w, h| fill(image, x, y, w, h, colour));
    }

    /// The same, in dashes.
    fn dashed(&self, image: &mut RgbImage, rect: &Rect, colour: Rgb<u8>) {
        let dash = (DASH * f64::from(self.line)) as i32;
        self.sides(rect, |x, y, w, h| {
            for along in (0..w.max(h)).step_by(2 * dash as usize) {
                let length = dash.min(w.max(h) - along);
                if w > h {
                    fill(image, x + along, y, length, h, colour);
                } else {
                    fill(image, x, y + along, w, length, colour);
                }
            }
        });
    }

    /// Calls `side` with x, y, width, height of each side of the border.
    fn sides(&self, rect: &Rect, mut side: impl FnMut(i32, i32, i32, i32)) {
        let t = self.line;
        let (x0, y0) = (pixel(rect.x) - t / 2, pixel(rect.y) - t / 2);
        let (x1, y1) = (pixel(rect.x + rect.w) - t / 2, pixel(rect.y + rect.h) - t / 2);
        side(x0, y0, x1 - x0 + t, t);
        side(x0, y1, x1 - x0 + t, t);
        side(x0, y0, t, y1 - y0 + t);
        side(x1, y0, t, y1 - y0 + t);
    }

    /// A line of text above the box, below where there is no room, and always inside the image.
    fn label(&self, image: &mut RgbImage, rect: &Rect, text: &str, colour: Rgb<u8>) {
        let scale = self.text as f32;
        let pad = (self.text / 6.0) as i32;
        let (w, h) = text_size(scale, &*FONT, text);
        let (w, h) = (w as i32 + 2 * pad, h as i32 + pad);
        let (width, height) = (image.width() as i32, image.height() as i32);
        let above = pixel(rect.y) - h - self.line;
        let y = if above >= 0 { above } else { pixel(rect.y + rect.h) + self.line };
        let x = (pixel(rect.x) - self.line / 2).min(width - w).max(0);
        let y = y.min(height - h).max(0);
        fill(image, x, y, w, h, DARK);
        draw_text_mut(image, colour, x + pad, y + pad / 2, scale, &*FONT, text);
    }
}

/// The nearest pixel border; far outside any image where the coordinate is.
fn pixel(v: f64) -> i32 {
    const FAR: f64 = 1e6;
    v.clamp(-FAR, FAR).round() as i32
}

/// Fills the part of a box that lies inside the image.
fn fill(image: &mut RgbImage, x: i32, y: i32, w: i32, h: i32, colour: Rgb<u8>) {
    if w > 0 && h > 0 {
        draw_filled_rect_mut(image, imageproc::rect::Rect::at(x, y).of_size(w as u32, h as u32), colour);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Encoding;

    const SIZE: (u32, u32) = (200, 120);

    fn grey() -> Vec<u8> {
        vec![100; (SIZE.0 * SIZE.1) as usize]
    }

    fn frame(data: &[u8]) -> Frame<'_> {
        Frame::new(data, SIZE.0, SIZE.1, SIZE.0 as usize, Encoding::Mono8, None).unwrap()
    }

    fn output(rect: Rect, state: State) -> Output {
        let target = Target {
            id: "0".into(),
            rect,
            velocity: [0.0; 2],
            confidence: 0.5,
            response: 0.5,
            state,
            reacquired: false,
            age: 1,
            lost_for: 0,
        };
        Output { targets: vec![target] }
    }

    /// Centre and extent of the pixels of a colour.
    fn extent(image: &RgbImage, colour: Rgb<u8>) -> Option<Rect> {
        let at: Vec<_> = image.enumerate_pixels().filter(|p| *p.2 == colour).map(|p| (p.0, p.1)).collect();
        let (x0, x1) = (at.iter().map(|p| p.0).min()?, at.iter().map(|p| p.0).max()?);
        let (y0, y1) = (at.iter().map(|p| p.1).min()?, at.iter().map(|p| p.1).max()?);
        Some(Rect::new(f64::from(x0), f64::from(y0), f64::from(x1 - x0 + 1), f64::from(y1 - y0 + 1)))
    }

    #[test]
    fn each_state_has_its_colour_around_the_box() {
        let data = grey();
        let rect = Rect::new(90.0, 60.0, 30.0, 40.0);
        for (state, colour) in [(State::Tracking, TRACKING), (State::Uncertain, UNCERTAIN), (State::Lost, LOST)] {
            let image = annotated(&frame(&data), &output(rect, state), &Scene::default());
            assert_eq!(*image.get_pixel(90, 80), colour);
            assert_eq!(*image.get_pixel(105, 80), Rgb([100; 3]), "the target stays visible");
        }
    }

    #[test]
    fn what_the_step_showed_is_drawn_and_clearing_forgets_it() {
        let data = grey();
        let mut scene = Scene::default();
        let window = Rect::new(40.0, 10.0, 100.0, 100.0);
        scene.search_window(window);
        scene.prediction(Rect::new(80.0, 50.0, 20.0, 20.0));
        scene.proposals(&[Proposal { rect: Rect::new(60.0, 80.0, 20.0, 20.0), score: 1.0 }]);
        let image = annotated(&frame(&data), &Output::default(), &scene);
        for colour in [SEARCH_WINDOW, PREDICTION, PROPOSAL] {
            assert!(extent(&image, colour).is_some());
        }
        let drawn = extent(&image, SEARCH_WINDOW).unwrap();
        assert!(drawn.iou(&window) > 0.9, "{drawn}");
        scene.clear();
        assert_eq!(annotated(&frame(&data), &Output::default(), &scene), rgb(&frame(&data)));
    }

    #[test]
    fn the_peak_of_the_map_shows_at_its_place_in_the_frame() {
        let data = grey();
        let mut scene = Scene::default();
        // The cell in row 1, column 3 covers 20 x 20 px at (80, 30).
        let mut values = [0.0; 16];
        values[4 + 3] = 0.9;
        let window = Rect::new(20.0, 10.0, 80.0, 80.0);
        scene.response(&ResponseMap { values: &values, rows: 4, cols: 4, window });
        let image = response(&frame(&data), &scene);
        let yellow = |x, y| i32::from(image.get_pixel(x, y)[0]) - i32::from(image.get_pixel(x, y)[2]);
        let best = (0..SIZE.0).flat_map(|x| (40..SIZE.1 - 20).map(move |y| (x, y))).max_by_key(|p| yellow(p.0, p.1));
        let (x, y) = best.unwrap();
        assert!((80..100).contains(&x) && (30..50).contains(&y), "({x}, {y})");
        assert_eq!(*image.get_pixel(150, 100), Rgb([40; 3]), "around the map the frame is darkened");
        scene.clear();
        assert_eq!(*response(&frame(&data), &scene).get_pixel(50, 50), Rgb([40; 3]));
    }

    #[test]
    fn a_weak_map_stays_dark() {
        let data = grey();
        let mut scene = Scene::default();
        let bright = |peak: f32| {
            scene.response(&ResponseMap { values: &[peak; 4], rows: 2, cols: 2, window: frame(&data).bounds() });
            response(&frame(&data), &scene).get_pixel(100, 100)[1]
        };
        let greens = [0.05, 0.2, 0.5].map(bright);
        assert!(greens[0] < greens[1] && greens[1] < greens[2], "{greens:?}");
    }

    #[test]
    fn boxes_and_maps_beyond_the_border_are_clipped() {
        let data = grey();
        for rect in [
            Rect::new(-50.0, -30.0, 60.0, 40.0),
            Rect::new(190.0, 110.0, 900.0, 900.0),
            Rect::new(-1e12, 1e12, 1.0, 1.0),
            Rect::new(50.0, 50.0, 0.0, 0.0),
        ] {
            let mut scene = Scene::default();
            scene.search_window(rect);
            scene.prediction(rect);
            scene.response(&ResponseMap { values: &[1.0; 6], rows: 2, cols: 3, window: rect });
            let image = annotated(&frame(&data), &output(rect, State::Lost), &scene);
            assert!(extent(&image, DARK).is_some(), "the label always shows");
            assert_eq!(response(&frame(&data), &scene).dimensions(), SIZE);
        }
    }

    #[test]
    fn the_colour_map_grows_lighter_throughout() {
        let light = |v: f32| viridis(v).iter().zip([0.2126, 0.7152, 0.0722]).map(|(&c, w)| f32::from(c) * w).sum();
        let values: Vec<f32> = (0..=100).map(|i| light(i as f32 / 100.0)).collect();
        assert!(values.windows(2).all(|w| w[1] > w[0] - 0.5) && values[100] > values[0] + 150.0);
        assert_eq!((viridis(f32::NEG_INFINITY), viridis(2.0)), (VIRIDIS[0], VIRIDIS[8]));
    }
}
