//! The images of a target's region in a row: what is seen there, and what the tracker makes of it.

use image::{Rgb, RgbImage};

use super::pen::Pen;
use super::scene::KeptCues;
use super::{PREDICTION, viridis};
use crate::crop::{Cropper, Patch};
use crate::frame::Frame;
use crate::geometry::Rect;

/// Height of the row, as a share of the picture's.
const HEIGHT: f64 = 0.25;

/// Draws the row along the foot of the picture, spread over its width: the region as the frame shows it, then its
/// images, each under its name.
pub(super) fn strip(image: &mut RgbImage, frame: &Frame, cues: &KeptCues) {
    let count = cues.images.len() as f64 + 1.0;
    let (width, height) = (f64::from(image.width()), f64::from(image.height()));
    // As high as the row or, where they would not all fit, as wide as they may be.
    let scale = (HEIGHT * height / cues.window.h).min(width / count / cues.window.w);
    let side = |length: f64| (length * scale).round().max(1.0);
    let (w, h) = (side(cues.window.w), side(cues.window.h));
    let panel = |index: usize| Rect::new((index as f64 * width / count).round(), height - h, w, h);
    let mut patch = Patch::default();
    Cropper::default().crop(frame, &cues.window, w as usize, h as usize, &mut patch);
    fill(image, &panel(0), |x, y| patch.rgb(x, y));
    for (i, (_, values)) in cues.images.iter().enumerate() {
        let cell = |at: usize, count: usize, side: f64| (at as f64 / side * count as f64) as usize;
        fill(image, &panel(i + 1), |x, y| {
            viridis(
                values[cell(y, cues.rows, h).min(cues.rows - 1) * cues.cols + cell(x, cues.cols, w).min(cues.cols - 1)],
            )
        });
    }
    let pen = Pen::for_image(image);
    let names = std::iter::once(cues.caption.as_str()).chain(cues.images.iter().map(|image| image.0));
    for (i, name) in names.enumerate() {
        pen.label(image, &panel(i), name, PREDICTION);
    }
}

/// Fills the pixels of a panel that lie in the picture; `colour` takes their places in the panel.
fn fill(image: &mut RgbImage, panel: &Rect, colour: impl Fn(usize, usize) -> [u8; 3]) {
    let size = [image.width() as usize, image.height() as usize];
    let [columns, rows] = panel.pixels(size);
    let (left, top) = (columns.start, rows.start);
    for (x, y) in rows.flat_map(|y| columns.clone().map(move |x| (x, y))) {
        image.put_pixel(x as u32, y as u32, Rgb(colour(x - left, y - top)));
    }
}
