//! One image as it came in: borrowed bytes with their layout, checked once.
//!
//! Images are not converted as a whole: what is looked at is read out of the bytes as they are. `encoding.rs` holds
//! what there is, `pixels.rs` reads it.

mod encoding;
mod pixels;

pub use encoding::Encoding;
pub use pixels::Plane;

use crate::error::{FrameError, StartError};
use crate::geometry::Rect;

/// The largest side a frame may have, in pixels.
pub const MAX_SIDE: u32 = 1 << 15;
/// The shortest side of a target, in pixels: below, HOG has less than one cell.
pub const MIN_TARGET_SIDE: f64 = 4.0;
/// The longest a target may be in units of its shorter side; a search window of a few target sizes does not
/// hold anything thinner.
pub const MAX_TARGET_ASPECT: f64 = 12.0;
/// The share of a marked box that must lie inside the image.
const MIN_VISIBLE_SHARE: f64 = 0.5;

/// When an image was taken: nanoseconds since an epoch of the source's choosing. `None` where the source
/// knows no time (a folder of images).
pub type Stamp = Option<i64>;

/// A borrowed image whose layout has been checked: all code behind it may index without further tests.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    data: &'a [u8],
    width: u32,
    height: u32,
    /// Width and height in which coordinates count.
    extent: [u32; 2],
    step: usize,
    encoding: Encoding,
    levels: Levels,
    stamp: Stamp,
}

/// The values of 16-bit images that are black and white; what lies between is grey in proportion. The two differ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Levels {
    /// What is taken for black.
    pub black: u16,
    /// What is taken for white.
    pub white: u16,
}

impl Default for Levels {
    fn default() -> Self {
        Self { black: 0, white: u16::MAX }
    }
}

impl<'a> Frame<'a> {
    /// Checks the layout: `height` rows of `step` bytes, of which the first `width` pixels count, and the rows of
    /// colour that some encodings have below them. The last row may end after its last pixel.
    pub fn new(
        data: &'a [u8],
        width: u32,
        height: u32,
        step: usize,
        encoding: Encoding,
        stamp: Stamp,
    ) -> Result<Self, FrameError> {
        if width == 0 || height == 0 {
            return Err(FrameError::Empty { width, height });
        }
        if width > MAX_SIDE || height > MAX_SIDE {
            return Err(FrameError::TooLarge { width, height, limit: MAX_SIDE });
        }
        let [columns, rows] = encoding.block();
        if !width.is_multiple_of(columns) || !height.is_multiple_of(rows) {
            return Err(FrameError::Block { width, height, encoding: encoding.name(), columns, rows });
        }
        let row = width as usize * encoding.bytes();
        if step < row {
            return Err(FrameError::Step { step, width, encoding: encoding.name(), row });
        }
        let rows = height + encoding.colour_rows(height);
        let needed = step.saturating_mul(rows as usize - 1).saturating_add(row);
        if data.len() < needed {
            return Err(FrameError::Data { len: data.len(), height: rows, step, needed });
        }
        Ok(Self::checked(data, width, height, step, encoding, stamp))
    }

    /// Borrows bytes whose layout has been checked.
    fn checked(data: &'a [u8], width: u32, height: u32, step: usize, encoding: Encoding, stamp: Stamp) -> Self {
        Self { data, width, height, extent: [width, height], step, encoding, levels: Levels::default(), stamp }
    }

    /// The same picture as if it had that width and height: coordinates count in its pixels, whatever the bytes hold.
    pub fn seen_as(&self, extent: [u32; 2]) -> Self {
        Self { extent, ..*self }
    }

    /// The same picture, its values read between these levels if they have 16 bits.
    pub fn with_levels(&self, levels: Levels) -> Self {
        Self { levels, ..*self }
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.extent[0]
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.extent[1]
    }

    /// Columns and rows of the bytes: width and height, unless the frame is seen as one of another size.
    pub fn grid(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// Layout of a pixel.
    pub fn encoding(&self) -> Encoding {
        self.encoding
    }

    /// When the image was taken.
    pub fn stamp(&self) -> Stamp {
        self.stamp
    }

    /// The whole image as a box.
    pub fn bounds(&self) -> Rect {
        Rect::new(0.0, 0.0, f64::from(self.width()), f64::from(self.height()))
    }

    /// Whether a point lies in the image.
    pub fn holds(&self, [x, y]: [f64; 2]) -> bool {
        (0.0..f64::from(self.width())).contains(&x) && (0.0..f64::from(self.height())).contains(&y)
    }

    /// The point of the image that is nearest to `point`.
    pub fn nearest(&self, point: [f64; 2]) -> [f64; 2] {
        [point[0].clamp(0.0, f64::from(self.width())), point[1].clamp(0.0, f64::from(self.height()))]
    }

    /// Checks that a target of this box can be followed from this frame on.
    pub fn check_target(&self, rect: &Rect) -> Result<(), StartError> {
        if !rect.is_finite() {
            return Err(StartError::NotFinite(*rect));
        }
        if rect.w < MIN_TARGET_SIDE || rect.h < MIN_TARGET_SIDE {
            return Err(StartError::TooSmall { rect: *rect, min: MIN_TARGET_SIDE });
        }
        let ratio = (rect.w / rect.h).max(rect.h / rect.w);
        if ratio > MAX_TARGET_ASPECT {
            return Err(StartError::TooThin { rect: *rect, ratio, max: MAX_TARGET_ASPECT });
        }
        let (width, height) = (self.width(), self.height());
        if rect.w > f64::from(width) || rect.h > f64::from(height) {
            return Err(StartError::TooLarge { rect: *rect, width, height });
        }
        let visible = rect.intersection(&self.bounds()).area() / rect.area();
        if visible < MIN_VISIBLE_SHARE {
            return Err(StartError::Outside {
                rect: *rect,
                width,
                height,
                visible: 100.0 * visible,
                min: 100.0 * MIN_VISIBLE_SHARE,
            });
        }
        Ok(())
    }
}

/// An image that owns its bytes. Its layout has been checked.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameBuffer {
    data: Vec<u8>,
    width: u32,
    height: u32,
    step: usize,
    encoding: Encoding,
    stamp: Stamp,
}

impl FrameBuffer {
    /// Takes the bytes; the layout is as in [`Frame::new`], and so are the errors.
    pub fn new(
        data: Vec<u8>,
        width: u32,
        height: u32,
        step: usize,
        encoding: Encoding,
        stamp: Stamp,
    ) -> Result<Self, FrameError> {
        Frame::new(&data, width, height, step, encoding, stamp)?;
        Ok(Self { data, width, height, step, encoding, stamp })
    }

    /// The same bytes read in another encoding.
    pub fn read_as(self, encoding: Encoding) -> Result<Self, FrameError> {
        Self::new(self.data, self.width, self.height, self.step, encoding, self.stamp)
    }

    /// How many bytes it holds.
    pub fn bytes(&self) -> usize {
        self.data.len()
    }

    /// The image, borrowed.
    pub fn frame(&self) -> Frame<'_> {
        Frame::checked(&self.data, self.width, self.height, self.step, self.encoding, self.stamp)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mono(data: &[u8], width: u32, height: u32, step: usize) -> Result<Frame<'_>, FrameError> {
        Frame::new(data, width, height, step, Encoding::Mono8, None)
    }

    #[test]
    fn layouts_that_do_not_hold_their_pixels_are_refused_with_the_values() {
        let data = [0u8; 64];
        assert_eq!(mono(&data, 0, 4, 4).unwrap_err(), FrameError::Empty { width: 0, height: 4 });
        assert!(matches!(mono(&data, 1 << 20, 1, 1 << 20), Err(FrameError::TooLarge { .. })));
        assert_eq!(
            mono(&data, 8, 8, 7).unwrap_err().to_string(),
            "step of 7 bytes is shorter than a row of 8 mono8 pixels (8 bytes)"
        );
        assert_eq!(
            mono(&data, 8, 9, 8).unwrap_err().to_string(),
            "data of 64 bytes is shorter than 9 rows of 8 bytes (at least 72)"
        );
        assert!(mono(&data, 8, 8, usize::MAX).is_err());
        // The last row need not be padded.
        assert!(mono(&data[..60], 4, 8, 8).is_ok());
        let nv12 = |width, height, len| Frame::new(&data[..len], width, height, 4, Encoding::Nv12, None).err();
        assert_eq!((nv12(4, 4, 24), nv12(4, 4, 23).is_some()), (None, true));
        assert_eq!(
            nv12(4, 3, 24).unwrap().to_string(),
            "image of 4 x 3 cannot be nv12: its sides must be multiples of 2 and 2"
        );
        assert!(Encoding::parse("rgb9", false).unwrap_err().to_string().contains("rgb8, bgr8"));
    }

    #[test]
    fn boxes_that_cannot_be_followed_are_refused() {
        let data = vec![0u8; 640 * 480];
        let frame = mono(&data, 640, 480, 640).unwrap();
        assert_eq!([[-3.0, 20.0], [700.0, 481.0]].map(|point| frame.nearest(point)), [[0.0, 20.0], [640.0, 480.0]]);
        let check = |x, y, w, h| frame.check_target(&Rect::new(x, y, w, h));
        assert!(check(10.0, 10.0, 40.0, 80.0).is_ok());
        assert!(check(-19.0, 10.0, 40.0, 80.0).is_ok());
        assert!(matches!(check(f64::NAN, 0.0, 9.0, 9.0), Err(StartError::NotFinite(_))));
        assert!(matches!(check(5.0, 5.0, 0.0, 0.0), Err(StartError::TooSmall { .. })));
        assert!(matches!(check(5.0, 5.0, 500.0, 3.0), Err(StartError::TooSmall { .. })));
        assert!(matches!(check(5.0, 5.0, 500.0, 30.0), Err(StartError::TooThin { .. })));
        assert!(matches!(check(0.0, 0.0, 700.0, 400.0), Err(StartError::TooLarge { .. })));
        assert!(matches!(check(630.0, 10.0, 40.0, 80.0), Err(StartError::Outside { .. })));
    }
}
