//! JPEG and PNG files, and messages that hold such, as frames.
//!
//! What an image will take is known from its headers, before anything is made for it.

mod jpeg;
mod png;
mod ready;
mod tables;

use std::io::Cursor;

use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

pub use self::jpeg::JpegError;
use self::ready::Ready;
use crate::error::FrameError;
use crate::frame::{Encoding, FrameBuffer, MAX_SIDE, Stamp};

/// Why the bytes of an image file do not become a frame.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum DecodeError {
    /// Another kind of file.
    #[error("cannot be decoded: {len} bytes are neither JPEG nor PNG")]
    Kind { len: usize },
    /// A JPEG file that is broken, or of a kind that is not read.
    #[error("cannot be decoded: the JPEG data {0}")]
    Jpeg(#[from] JpegError),
    /// A PNG file that does not tell its size.
    #[error("cannot be decoded: the PNG data do not begin with a header")]
    PngHeader,
    /// What the decoder says of a broken file.
    #[error("cannot be decoded: {why}")]
    Broken { why: String },
    /// More than may be taken.
    #[error("image of {width} x {height} takes {} MB to decode, limits.image_mb is {}", megabytes(*needed), most / MB)]
    TooLarge { width: u32, height: u32, needed: u64, most: u64 },
    /// Less than the pixels take however they are coded.
    #[error("cannot be decoded: {len} bytes are too few for {width} x {height} pixels: the data are truncated")]
    TooShort { width: u32, height: u32, len: usize },
    /// The image was decoded but cannot be tracked on.
    #[error(transparent)]
    Frame(#[from] FrameError),
}

/// Bytes.
const MB: u64 = 1_000_000;

/// Rounded up.
fn megabytes(bytes: u64) -> u64 {
    bytes.div_ceil(MB)
}

/// Decodes the bytes of a JPEG or PNG file whose pixels, with what the decoder needs besides, take `most` bytes at
/// most. Grey stays grey, of 8 or 16 bits; colours of 16 bits become 8; transparency is ignored.
pub fn decode(bytes: &[u8], stamp: Stamp, most: u64) -> Result<FrameBuffer, DecodeError> {
    let format = image::guess_format(bytes).map_err(|_| DecodeError::Kind { len: bytes.len() })?;
    let ready = match format {
        ImageFormat::Jpeg => jpeg::ready(bytes)?,
        ImageFormat::Png => png::ready(bytes).ok_or(DecodeError::PngHeader)?,
        _ => Ready { bytes: bytes.into(), working: 0, too_short: None, ended: true },
    };
    if ready.ended {
        return frame(pixels(&ready, format, most)?, stamp);
    }
    // The decoder would fill what is missing with grey.
    let [one, other] = jpeg::completed(&ready.bytes);
    let decode = |bytes: Vec<u8>| pixels(&Ready { bytes: bytes.into(), ..ready }, format, most);
    let decoded = decode(one)?;
    if decode(other)? == decoded { frame(decoded, stamp) } else { Err(jpeg::cut_off(bytes).into()) }
}

/// Decodes what takes no more than it may.
fn pixels(ready: &Ready, format: ImageFormat, most: u64) -> Result<DynamicImage, DecodeError> {
    let broken = |error: image::ImageError| DecodeError::Broken { why: error.to_string() };
    let mut reader = ImageReader::with_format(Cursor::new(&*ready.bytes), format);
    let mut limits = Limits::default();
    limits.max_alloc = Some(most);
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(broken)?;
    let (width, height) = decoder.dimensions();
    if width > MAX_SIDE || height > MAX_SIDE {
        return Err(FrameError::TooLarge { width, height, limit: MAX_SIDE }.into());
    }
    let needed = decoder.total_bytes().saturating_add(ready.working);
    if needed > most {
        return Err(DecodeError::TooLarge { width, height, needed, most });
    }
    if let Some(len) = ready.too_short {
        return Err(DecodeError::TooShort { width, height, len });
    }
    DynamicImage::from_decoder(decoder).map_err(broken)
}

/// Takes the pixels as they are, or as the nearest that frames know.
fn frame(image: DynamicImage, stamp: Stamp) -> Result<FrameBuffer, DecodeError> {
    let (width, height) = (image.width(), image.height());
    let (data, encoding) = match image {
        DynamicImage::ImageRgb8(pixels) => (pixels.into_raw(), Encoding::Rgb8),
        DynamicImage::ImageRgba8(pixels) => (pixels.into_raw(), Encoding::Rgba8),
        grey @ (DynamicImage::ImageLuma16(_) | DynamicImage::ImageLumaA16(_)) => {
            let values = grey.into_luma16().into_raw();
            let mut bytes = Vec::with_capacity(2 * values.len());
            values.into_iter().for_each(|v| bytes.extend_from_slice(&v.to_le_bytes()));
            (bytes, Encoding::Mono16)
        }
        grey if !grey.color().has_color() => (grey.into_luma8().into_raw(), Encoding::Mono8),
        other => (other.into_rgb8().into_raw(), Encoding::Rgb8),
    };
    let step = width as usize * encoding.bytes();
    Ok(FrameBuffer::new(data, width, height, step, encoding, stamp)?)
}

#[cfg(test)]
mod tests;
