//! The encodings of images, named as in `sensor_msgs/image_encodings`.

use crate::error::FrameError;

/// How the bytes of an image stand for its pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// 8-bit red, green, blue.
    Rgb8,
    /// 8-bit blue, green, red.
    Bgr8,
    /// 8-bit red, green, blue, alpha (ignored).
    Rgba8,
    /// 8-bit blue, green, red, alpha (ignored).
    Bgra8,
    /// 8-bit grey.
    Mono8,
    /// 16-bit grey, the low byte first; [`Levels`](super::Levels) say what is black and white.
    Mono16,
    /// 16-bit grey, the high byte first.
    Mono16Be,
    /// 4:2:2, two pixels as U, Y, V, Y.
    Uyvy,
    /// 4:2:2, two pixels as Y, U, Y, V.
    Yuyv,
    /// 4:2:0, rows of Y, then half as many of U and V in turn.
    Nv12,
    /// 4:2:0, rows of Y, then half as many of V and U in turn.
    Nv21,
    /// Mosaic of red, green / green, blue.
    BayerRggb8,
    /// Mosaic of blue, green / green, red.
    BayerBggr8,
    /// Mosaic of green, blue / red, green.
    BayerGbrg8,
    /// Mosaic of green, red / blue, green.
    BayerGrbg8,
}

use Encoding::*;

/// Each with its names; the first is the one that is told.
const NAMES: [(Encoding, &[&str]); 15] = [
    (Rgb8, &["rgb8"]),
    (Bgr8, &["bgr8", "8UC3"]),
    (Rgba8, &["rgba8"]),
    (Bgra8, &["bgra8", "8UC4"]),
    (Mono8, &["mono8", "8UC1"]),
    (Mono16, &["mono16", "16UC1"]),
    (Mono16Be, &["mono16"]),
    (Uyvy, &["uyvy", "yuv422"]),
    (Yuyv, &["yuyv", "yuv422_yuy2"]),
    (Nv12, &["nv12"]),
    (Nv21, &["nv21"]),
    (BayerRggb8, &["bayer_rggb8"]),
    (BayerBggr8, &["bayer_bggr8"]),
    (BayerGbrg8, &["bayer_gbrg8"]),
    (BayerGrbg8, &["bayer_grbg8"]),
];

impl Encoding {
    /// The encoding of that name; values of two bytes have the high one first where `is_bigendian`.
    pub fn parse(name: &str, is_bigendian: bool) -> Result<Self, FrameError> {
        let found = NAMES.iter().find(|(_, names)| names.contains(&name));
        match found.ok_or_else(|| FrameError::Encoding { name: name.to_owned(), known: Self::names() })?.0 {
            Mono16 if is_bigendian => Ok(Mono16Be),
            encoding => Ok(encoding),
        }
    }

    /// The name of the encoding on the wire.
    pub fn name(self) -> &'static str {
        let known = NAMES.iter().find(|(encoding, _)| *encoding == self);
        known.map_or("", |(_, names)| names[0])
    }

    /// All names, in the order of the declaration.
    pub fn names() -> Vec<&'static str> {
        let told = NAMES.iter().filter(|(encoding, _)| *encoding != Mono16Be);
        told.flat_map(|(_, names)| names.iter().copied()).collect()
    }

    /// Bytes of a row by its pixels.
    pub const fn bytes(self) -> usize {
        match self {
            Rgb8 | Bgr8 => 3,
            Rgba8 | Bgra8 => 4,
            Mono16 | Mono16Be | Uyvy | Yuyv => 2,
            Mono8 | Nv12 | Nv21 | BayerRggb8 | BayerBggr8 | BayerGbrg8 | BayerGrbg8 => 1,
        }
    }

    /// Whether each pixel holds one colour of a mosaic.
    pub const fn is_mosaic(self) -> bool {
        matches!(self, BayerRggb8 | BayerBggr8 | BayerGbrg8 | BayerGrbg8)
    }

    /// Whether the encoding holds colour at all.
    pub const fn is_colour(self) -> bool {
        !matches!(self, Mono8 | Mono16 | Mono16Be)
    }

    /// Columns and rows of pixels that share their colour: the sides of an image are multiples of these.
    pub(super) const fn block(self) -> [u32; 2] {
        match self {
            Uyvy | Yuyv => [2, 1],
            Nv12 | Nv21 | BayerRggb8 | BayerBggr8 | BayerGbrg8 | BayerGrbg8 => [2, 2],
            _ => [1, 1],
        }
    }

    /// Rows of colour below an image of so many rows.
    pub(super) const fn colour_rows(self, height: u32) -> u32 {
        if matches!(self, Nv12 | Nv21) { height / 2 } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_of_an_encoding_leads_to_it_and_back() {
        for (encoding, names) in NAMES {
            let is_bigendian = encoding == Mono16Be;
            names.iter().for_each(|name| assert_eq!(Encoding::parse(name, is_bigendian).unwrap(), encoding));
            assert_eq!(encoding.name(), names[0]);
        }
        assert_eq!(Encoding::parse("16UC1", true).unwrap(), Mono16Be);
        assert_eq!(Encoding::parse("rgb8", true).unwrap(), Rgb8, "single bytes have no order");
        assert_eq!(Encoding::names().iter().filter(|name| **name == "mono16").count(), 1);
    }
}
