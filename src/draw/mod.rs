//! Debug drawing: what a tracker saw and thought, on the frame it saw. Used by `track --annotate`, by the node's
//! debug images and by the demo; the core never comes here.
//!
//! [`Scene`] is the [`Trace`](crate::trace::Trace) that keeps what one step shows; [`annotated`] and [`response`] draw
//! it.

mod cues;
mod pen;
mod scene;

use image::{Rgb, RgbImage};

pub use scene::Scene;

use crate::crop::{Cropper, Patch};
use crate::frame::{Frame, Plane};
use crate::geometry::Rect;
use crate::trace::ResponseMap;
use crate::tracker::{Output, State, Target};
use pen::Pen;

/// Colour of a box by what the tracker says of it.
const TRACKING: Rgb<u8> = Rgb([60, 220, 90]);
const UNCERTAIN: Rgb<u8> = Rgb([255, 190, 0]);
const LOST: Rgb<u8> = Rgb([255, 70, 60]);
const SEARCH_WINDOW: Rgb<u8> = Rgb([90, 170, 255]);
const PREDICTION: Rgb<u8> = Rgb([255, 255, 255]);
const PROPOSAL: Rgb<u8> = Rgb([240, 90, 240]);
const NEIGHBOUR: Rgb<u8> = Rgb([170, 120, 255]);
const PARTICLE: Rgb<u8> = Rgb([0, 230, 255]);
/// Side of the dot of a particle, in line thicknesses: of one without weight, and of the heaviest.
const LIGHT_DOT: f64 = 1.0;
const HEAVY_DOT: f64 = 4.0;

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

/// The frame with the search windows (thin, blue), the mode of each if there are modes, the predictions (dashed,
/// white), the proposals (magenta), what looks like a target (violet, dashed), the particles (dots, the larger the
/// heavier) and the box of each target (green: tracking, amber: uncertain, red: lost) with a line that gives its state,
/// confidence and id. Thickness and text grow with the picture, of which no side is longer than `max_side` pixels.
pub fn annotated(frame: &Frame, output: &Output, scene: &Scene, max_side: u32) -> RgbImage {
    let mut image = picture(frame, max_side);
    let place = placing(frame, &image);
    let pen = Pen::for_image(&image);
    for window in &scene.search_windows {
        pen.thin().outline(&mut image, &place(window), SEARCH_WINDOW);
    }
    for proposal in &scene.proposals {
        pen.thin().outline(&mut image, &place(&proposal.rect), PROPOSAL);
    }
    for neighbour in &scene.neighbours {
        pen.thin().dashed(&mut image, &place(neighbour), NEIGHBOUR);
    }
    for prediction in &scene.predictions {
        pen.thin().dashed(&mut image, &place(prediction), PREDICTION);
    }
    let heaviest = scene.particles.iter().map(|p| p.1).fold(f64::MIN_POSITIVE, f64::max);
    for (rect, weight) in &scene.particles {
        let size = LIGHT_DOT + (HEAVY_DOT - LIGHT_DOT) * weight / heaviest;
        pen.thin().dot(&mut image, &place(rect), size.round() as i32, PARTICLE);
    }
    for (name, window) in &scene.modes {
        pen.label(&mut image, &place(window), name, SEARCH_WINDOW);
    }
    for target in &output.targets {
        pen.outline(&mut image, &place(&target.rect), colour(target.state));
    }
    for target in &output.targets {
        pen.label(&mut image, &place(&target.rect), &caption(target), colour(target.state));
    }
    image
}

/// The fused response maps in colour, each in its place over the darkened frame, with the values of their peaks. Where
/// the step made none, the darkened frame alone. Where a target showed the images that its response is made of, they
/// are below, one beside the other after the target's region. No side is longer than `max_side` pixels.
pub fn response(frame: &Frame, scene: &Scene, max_side: u32) -> RgbImage {
    let mut image = picture(frame, max_side);
    let place = placing(frame, &image);
    let dimmed: [u8; 256] = std::array::from_fn(|v| (v as f64 * DIMMED) as u8);
    let maps: Vec<_> = scene.maps().map(|map| ResponseMap { window: place(&map.window), ..map }).collect();
    image.iter_mut().for_each(|value| *value = dimmed[usize::from(*value)]);
    maps.iter().for_each(|map| paint(&mut image, map));
    let pen = Pen::for_image(&image);
    for map in &maps {
        pen.thin().outline(&mut image, &map.window, SEARCH_WINDOW);
        pen.label(&mut image, &map.window, &format!("peak {:.2}", highest(map)), PREDICTION);
    }
    if let Some(cues) = &scene.cues {
        cues::strip(&mut image, frame, cues);
    }
    image
}

/// What `window`, in pixels of the frame, shows, as a picture of `size` (width, height): with the true box, if there is
/// one, in dashes of white on dark, and the tracker's box in the colour of its state.
pub fn moment(
    frame: &Frame,
    window: &Rect,
    size: [u32; 2],
    truth: Option<Rect>,
    rect: &Rect,
    state: State,
) -> RgbImage {
    let mut patch = Patch::default();
    Cropper::default().crop(frame, window, size[0] as usize, size[1] as usize, &mut patch);
    let mut image = RgbImage::from_fn(size[0], size[1], |x, y| Rgb(patch.rgb(x as usize, y as usize)));
    let (across, down) = (f64::from(size[0]) / window.w, f64::from(size[1]) / window.h);
    let place = |r: &Rect| Rect::new((r.x - window.x) * across, (r.y - window.y) * down, r.w * across, r.h * down);
    let pen = Pen::for_image(&image);
    if let Some(truth) = truth {
        pen.outline(&mut image, &place(&truth), pen::DARK);
        pen.dashed(&mut image, &place(&truth), PREDICTION);
    }
    pen.outline(&mut image, &place(rect), colour(state));
    image
}

fn highest(map: &ResponseMap) -> f32 {
    map.values.iter().copied().fold(0.0, f32::max)
}

/// Lays one map over the darkened picture.
fn paint(image: &mut RgbImage, map: &ResponseMap) {
    let span = highest(map).max(MIN_SPAN);
    let bounds = Rect::new(0.0, 0.0, image.width().into(), image.height().into());
    let inside = map.window.intersection(&bounds);
    for y in inside.y.round() as u32..(inside.y + inside.h).round() as u32 {
        let row = (f64::from(y) + 0.5 - map.window.y) / map.window.h * map.rows as f64 - 0.5;
        for x in inside.x.round() as u32..(inside.x + inside.w).round() as u32 {
            let col = (f64::from(x) + 0.5 - map.window.x) / map.window.w * map.cols as f64 - 0.5;
            let colour = viridis(bilinear(map, row, col) / span);
            let below = image.get_pixel(x, y).0.map(f64::from).iter().sum::<f64>() / 3.0;
            let mix = |c: u8| (BELOW_MAP / DIMMED * below + (1.0 - BELOW_MAP) * f64::from(c)) as u8;
            image.put_pixel(x, y, Rgb(colour.map(mix)));
        }
    }
}

/// Writes a line of text in the top-left corner.
pub fn heading(image: &mut RgbImage, text: &str) {
    Pen::for_image(image).label(image, &Rect::default(), text, PREDICTION);
}

/// The frame as RGB, whatever its encoding and step, scaled down where a side is longer than `max_side` pixels.
pub fn picture(frame: &Frame, max_side: u32) -> RgbImage {
    let longest = frame.width().max(frame.height());
    if longest <= max_side {
        return whole(frame);
    }
    let side = |side: u32| (u64::from(side) * u64::from(max_side) / u64::from(longest)).max(1) as u32;
    let (width, height) = (side(frame.width()), side(frame.height()));
    let mut patch = Patch::default();
    Cropper::default().crop(frame, &frame.bounds(), width as usize, height as usize, &mut patch);
    RgbImage::from_fn(width, height, |x, y| Rgb(patch.rgb(x as usize, y as usize)))
}

/// All pixels of the frame as RGB, read row by row.
fn whole(frame: &Frame) -> RgbImage {
    let mut image = RgbImage::new(frame.width(), frame.height());
    let mut line = vec![0.0; frame.width() as usize];
    for (y, row) in image.chunks_exact_mut(3 * line.len()).enumerate() {
        for (channel, plane) in Plane::COLOURS.into_iter().enumerate() {
            frame.line(y, 0, plane, &mut line);
            // To the nearest; a cast alone would cut off.
            row.iter_mut().skip(channel).step_by(3).zip(&line).for_each(|(to, from)| *to = (from + 0.5) as u8);
        }
    }
    image
}

/// From boxes in the frame to boxes in a picture of it.
fn placing(frame: &Frame, image: &RgbImage) -> impl Fn(&Rect) -> Rect + use<> {
    let x = f64::from(image.width()) / f64::from(frame.width());
    let y = f64::from(image.height()) / f64::from(frame.height());
    move |rect| Rect::new(rect.x * x, rect.y * y, rect.w * x, rect.h * y)
}

/// The colour of a target's box: green, amber, red.
pub fn colour(state: State) -> Rgb<u8> {
    match state {
        State::Tracking => TRACKING,
        State::Uncertain => UNCERTAIN,
        State::Lost => LOST,
    }
}

/// State, confidence and id in a short line.
pub fn caption(target: &Target) -> String {
    let found = if target.reacquired { " found" } else { "" };
    format!("{}{found} {:.2} #{}", target.state.name(), target.confidence, target.id)
}

/// The map's value at a fractional cell; beyond the centres of the outermost cells it stays constant.
fn bilinear(map: &ResponseMap, row: f64, col: f64) -> f32 {
    let split = |at: f64, count: usize| {
        let at = at.clamp(0.0, (count - 1) as f64);
        let low = at as usize;
        (low, (low + 1).min(count - 1), (at - low as f64) as f32)
    };
    let (r0, r1, fr) = split(row, map.rows);
    let (c0, c1, fc) = split(col, map.cols);
    let along = |r: usize| {
        let (a, b) = (map.values[r * map.cols + c0], map.values[r * map.cols + c1]);
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

#[cfg(test)]
mod tests {
    use super::pen::DARK;
    use super::*;
    use crate::frame::Encoding;
    use crate::trace::{Cues, Event, Proposal, Trace as _};

    const SIZE: (u32, u32) = (200, 120);
    /// Larger than any picture here.
    const FULL: u32 = 1000;

    fn grey() -> Vec<u8> {
        vec![100; (SIZE.0 * SIZE.1) as usize]
    }

    fn frame(data: &[u8]) -> Frame<'_> {
        Frame::new(data, SIZE.0, SIZE.1, SIZE.0 as usize, Encoding::Mono8, None).unwrap()
    }

    fn output(rect: Rect, state: State) -> Output {
        Output { targets: vec![Target::standing("0", rect, state)] }
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
            let image = annotated(&frame(&data), &output(rect, state), &Scene::default(), FULL);
            assert_eq!(*image.get_pixel(90, 80), colour);
            assert_eq!(*image.get_pixel(105, 80), Rgb([100; 3]), "the target stays visible");
        }
    }

    #[test]
    fn what_the_step_showed_is_drawn_and_clearing_forgets_it() {
        let data = grey();
        let mut scene = Scene::default();
        let window = Rect::new(40.0, 10.0, 100.0, 100.0);
        scene.event(Event::SearchWindow(window));
        scene.event(Event::Prediction(Rect::new(80.0, 50.0, 20.0, 20.0)));
        scene.event(Event::Proposals(&[Proposal { rect: Rect::new(60.0, 80.0, 20.0, 20.0), score: 1.0 }]));
        scene.event(Event::Neighbour(Rect::new(150.0, 80.0, 20.0, 20.0)));
        scene.event(Event::Particle { rect: Rect::new(70.0, 40.0, 20.0, 20.0), weight: 0.8 });
        scene.event(Event::Particle { rect: Rect::new(110.0, 40.0, 20.0, 20.0), weight: 0.0 });
        let image = annotated(&frame(&data), &Output::default(), &scene, FULL);
        let dots = image.enumerate_pixels().filter(|p| *p.2 == PARTICLE).map(|p| (p.0 < 100, 1));
        let [light, heavy] = dots.fold([0, 0], |mut n, (is_heavy, one)| {
            n[usize::from(is_heavy)] += one;
            n
        });
        assert!(0 < light && light < heavy, "{light} and {heavy} pixels");
        for colour in [SEARCH_WINDOW, PREDICTION, PROPOSAL, NEIGHBOUR] {
            assert!(extent(&image, colour).is_some());
        }
        let drawn = extent(&image, SEARCH_WINDOW).unwrap();
        assert!(drawn.iou(&window) > 0.9, "{drawn}");
        scene.event(Event::Mode { name: "find", window });
        let named = annotated(&frame(&data), &Output::default(), &scene, FULL);
        assert!(extent(&image, DARK).is_none() && extent(&named, DARK).is_some(), "the mode is written");
        scene.clear();
        assert_eq!(annotated(&frame(&data), &Output::default(), &scene, FULL), picture(&frame(&data), FULL));
    }

    #[test]
    fn the_peak_of_the_map_shows_at_its_place_in_the_frame() {
        let data = grey();
        let mut scene = Scene::default();
        // The cell in row 1, column 3 covers 20 x 20 px at (80, 30).
        let mut values = [0.0; 16];
        values[4 + 3] = 0.9;
        let window = Rect::new(20.0, 10.0, 80.0, 80.0);
        scene.event(Event::Response(&ResponseMap { values: &values, rows: 4, cols: 4, window }));
        let image = response(&frame(&data), &scene, FULL);
        let yellow = |x, y| i32::from(image.get_pixel(x, y)[0]) - i32::from(image.get_pixel(x, y)[2]);
        let best = (0..SIZE.0).flat_map(|x| (40..SIZE.1 - 20).map(move |y| (x, y))).max_by_key(|p| yellow(p.0, p.1));
        let (x, y) = best.unwrap();
        assert!((80..100).contains(&x) && (30..50).contains(&y), "({x}, {y})");
        assert_eq!(*image.get_pixel(150, 100), Rgb([40; 3]), "around the map the frame is darkened");
        scene.clear();
        assert_eq!(*response(&frame(&data), &scene, FULL).get_pixel(50, 50), Rgb([40; 3]));
    }

    #[test]
    fn the_images_of_a_region_stand_in_a_row_below() {
        let data = grey();
        let mut scene = Scene::default();
        // Each image is full in one more quarter of its rows.
        let values: [Vec<f32>; 4] =
            std::array::from_fn(|i| (0..64).map(|cell| f32::from(u8::from(cell < 16 * (i + 1)))).collect());
        let images = [0, 1, 2, 3].map(|i| (["a", "b", "c", "d"][i], values[i].as_slice()));
        let window = Rect::new(60.0, 20.0, 30.0, 30.0);
        scene.event(Event::Cues(&Cues { id: "7", name: "moving", window, rows: 8, cols: 8, images }));
        scene.event(Event::Cues(&Cues {
            id: "8",
            name: "moving",
            window: window.shifted(9.0, 9.0),
            rows: 8,
            cols: 8,
            images,
        }));
        let image = response(&frame(&data), &scene, FULL);
        // Panels of 30 px, one every 40 px, at the foot of the picture; the first is the region itself.
        let [low, high] = [viridis(0.0), viridis(1.0)].map(Rgb);
        assert_eq!(*image.get_pixel(15, 110), Rgb([100; 3]));
        for panel in 1..5 {
            let (x, top, foot) = (40 * panel + 28, 91, 118);
            assert_eq!(*image.get_pixel(x, top), high, "panel {panel}");
            assert_eq!(*image.get_pixel(x, foot), if panel < 4 { low } else { high }, "panel {panel}");
        }
        assert_eq!(*image.get_pixel(195, 110), Rgb([40; 3]));
    }

    #[test]
    fn a_weak_map_stays_dark() {
        let data = grey();
        let mut scene = Scene::default();
        let bright = |peak: f32| {
            scene.event(Event::Response(&ResponseMap {
                values: &[peak; 4],
                rows: 2,
                cols: 2,
                window: frame(&data).bounds(),
            }));
            response(&frame(&data), &scene, FULL).get_pixel(100, 100)[1]
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
            scene.event(Event::SearchWindow(rect));
            scene.event(Event::Prediction(rect));
            scene.event(Event::Response(&ResponseMap { values: &[1.0; 6], rows: 2, cols: 3, window: rect }));
            let image = annotated(&frame(&data), &output(rect, State::Lost), &scene, FULL);
            assert!(extent(&image, DARK).is_some(), "the label always shows");
            assert_eq!(response(&frame(&data), &scene, FULL).dimensions(), SIZE);
        }
    }

    #[test]
    fn smaller_pictures_show_the_same_in_the_same_places() {
        let data = grey();
        let rect = Rect::new(80.0, 40.0, 60.0, 40.0);
        let mut scene = Scene::default();
        scene.event(Event::SearchWindow(Rect::new(20.0, 10.0, 160.0, 90.0)));
        scene.event(Event::Response(&ResponseMap { values: &[0.0, 0.0, 0.0, 0.9], rows: 2, cols: 2, window: rect }));
        let bare = annotated(&frame(&data), &Output::default(), &scene, 100);
        assert_eq!(bare.dimensions(), (100, 60));
        let drawn = extent(&bare, SEARCH_WINDOW).unwrap();
        assert!(drawn.iou(&Rect::new(10.0, 5.0, 80.0, 45.0)) > 0.9, "{drawn}");
        let image = annotated(&frame(&data), &output(rect, State::Tracking), &scene, 100);
        assert_eq!(*image.get_pixel(40, 30), TRACKING);
        let map = response(&frame(&data), &scene, 100);
        let green = |x, y| map.get_pixel(x, y)[1];
        assert!(green(65, 37) > green(45, 25) && green(5, 55) == 40, "{} {}", green(65, 37), green(45, 25));
    }

    #[test]
    fn a_moment_shows_both_boxes_in_their_places() {
        let data = grey();
        let (truth, rect) = (Rect::new(60.0, 40.0, 20.0, 20.0), Rect::new(80.0, 50.0, 30.0, 20.0));
        let window = Rect::new(50.0, 30.0, 80.0, 60.0);
        let of = |truth| moment(&frame(&data), &window, [160, 120], truth, &rect, State::Lost);
        let image = of(Some(truth));
        assert_eq!(extent(&image, LOST).unwrap(), Rect::new(59.0, 39.0, 62.0, 42.0), "twice as large");
        assert!(extent(&image, PREDICTION).unwrap().iou(&Rect::new(20.0, 20.0, 40.0, 40.0)) > 0.8);
        assert_eq!(*image.get_pixel(5, 5), Rgb([100; 3]));
        assert_eq!(extent(&of(None), PREDICTION), None);
    }

    #[test]
    fn the_colour_map_grows_lighter_throughout() {
        let light = |v: f32| viridis(v).iter().zip([0.2126, 0.7152, 0.0722]).map(|(&c, w)| f32::from(c) * w).sum();
        let values: Vec<f32> = (0..=100).map(|i| light(i as f32 / 100.0)).collect();
        assert!(values.windows(2).all(|w| w[1] > w[0] - 0.5) && values[100] > values[0] + 150.0);
        assert_eq!((viridis(f32::NEG_INFINITY), viridis(2.0)), (VIRIDIS[0], VIRIDIS[8]));
    }
}
