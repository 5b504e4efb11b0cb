//! JPEG and PNG files, and messages that hold such, as frames.

use image::{DynamicImage, ImageFormat};

use crate::error::FrameError;
use crate::frame::{Encoding, FrameBuffer, Stamp};

/// Why the bytes of an image file do not become a frame.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DecodeError {
    /// Neither JPEG nor PNG, or a broken one.
    #[error("cannot be decoded: {0}")]
    Image(String),
    /// The image was decoded but cannot be tracked on.
    #[error(transparent)]
    Frame(#[from] FrameError),
}

/// Decodes the bytes of a JPEG or PNG file. Grey stays grey, of 8 or 16 bits; colours of 16 bits become 8; transparency
/// is ignored.
pub fn decode(bytes: &[u8], stamp: Stamp) -> Result<FrameBuffer, DecodeError> {
    let broken = DecodeError::Image;
    let format =
        image::guess_format(bytes).map_err(|_| broken(format!("{} bytes are neither JPEG nor PNG", bytes.len())))?;
    if format == ImageFormat::Jpeg && !is_whole_jpeg(bytes) {
        return Err(broken(format!("the JPEG data is cut off after {} bytes", bytes.len())));
    }
    let image = image::load_from_memory_with_format(bytes, format).map_err(|e| broken(e.to_string()))?;
    let (width, height) = (image.width(), image.height());
    let (data, encoding) = match image {
        DynamicImage::ImageRgb8(pixels) => (pixels.into_raw(), Encoding::Rgb8),
        DynamicImage::ImageRgba8(pixels) => (pixels.into_raw(), Encoding::Rgba8),
        grey @ (DynamicImage::ImageLuma16(_) | DynamicImage::ImageLumaA16(_)) => {
            (grey.into_luma16().iter().flat_map(|v| v.to_le_bytes()).collect(), Encoding::Mono16)
        }
        grey if !grey.color().has_color() => (grey.into_luma8().into_raw(), Encoding::Mono8),
        other => (other.into_rgb8().into_raw(), Encoding::Rgb8),
    };
    let step = width as usize * encoding.bytes();
    Ok(FrameBuffer::new(data, width, height, step, encoding, stamp)?)
}

/// Whether an end marker follows the last start of a scan. The decoder would fill what is missing with grey.
fn is_whole_jpeg(bytes: &[u8]) -> bool {
    const SCAN: [u8; 2] = [0xff, 0xda];
    const END: [u8; 2] = [0xff, 0xd9];
    let end = bytes.windows(2).rposition(|w| w == END);
    end.is_some_and(|end| !bytes[end..].windows(2).any(|w| w == SCAN))
}
