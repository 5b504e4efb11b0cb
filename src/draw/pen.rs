//! Lines, text and fills on an image, as thick as its size asks for.

use std::sync::LazyLock;

use ab_glyph::FontRef;
use image::{Rgb, RgbImage};
use imageproc::drawing::{draw_filled_rect_mut, draw_text_mut, text_size};

use crate::geometry::Rect;

/// Behind text, and outside the border of lines, so that they stand out from any background.
pub(super) const DARK: Rgb<u8> = Rgb([16, 16, 20]);

/// The larger side of an image over the height of its text, and over the thickness of its lines.
const SIDE_TO_TEXT: f64 = 32.0;
const SIDE_TO_LINE: f64 = 400.0;
/// Below, text cannot be read.
const MIN_TEXT: f64 = 13.0;
/// Length of a dash, in line thicknesses.
const DASH: f64 = 5.0;

static FONT: LazyLock<FontRef<'static>> = LazyLock::new(|| {
    FontRef::try_from_slice(epaint_default_fonts::HACK_REGULAR).expect("the font that is built in can be read")
});

/// Line thickness and text height, in pixels.
#[derive(Clone, Copy)]
pub(super) struct Pen {
    line: i32,
    text: f64,
}

impl Pen {
    pub(super) fn for_image(image: &RgbImage) -> Self {
        let side = f64::from(image.width().max(image.height()));
        Self { line: ((side / SIDE_TO_LINE).round() as i32).max(1) + 1, text: (side / SIDE_TO_TEXT).max(MIN_TEXT) }
    }

    /// Half as thick.
    pub(super) fn thin(self) -> Self {
        Self { line: (self.line / 2).max(1), ..self }
    }

    /// The four sides of a box, around its border.
    pub(super) fn outline(&self, image: &mut RgbImage, rect: &Rect, colour: Rgb<u8>) {
        self.sides(rect, |x, y, w, h| fill(image, x, y, w, h, colour));
    }

    /// The same, in dashes.
    pub(super) fn dashed(&self, image: &mut RgbImage, rect: &Rect, colour: Rgb<u8>) {
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

    /// A square of so many line thicknesses in the middle of a box.
    pub(super) fn dot(&self, image: &mut RgbImage, rect: &Rect, size: i32, colour: Rgb<u8>) {
        let [x, y] = rect.centre();
        let side = size * self.line;
        fill(image, pixel(x) - side / 2, pixel(y) - side / 2, side, side, colour);
    }

    /// A line of text above the box, below where there is no room, and always inside the image.
    pub(super) fn label(&self, image: &mut RgbImage, rect: &Rect, text: &str, colour: Rgb<u8>) {
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
