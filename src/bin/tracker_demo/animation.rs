//! The annotated frames as a moving picture: an APNG, which browsers show wherever they show a PNG.
//!
//! The camera stands still. Each frame therefore holds only the pixels that have changed since they were last drawn;
//! the others are transparent, and what lies below them shows through.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use image::RgbImage;
use png::{BitDepth, BlendOp, ColorType, Compression, Encoder, EncodingError, Filter};

/// Difference in one colour, of 255 levels, up to which a pixel counts as unchanged: the noise of the video.
const NOISE: u8 = 32;
/// The bits of a colour that are kept, which halves the file.
const KEPT: u8 = 0xf8;
const OPAQUE: u8 = 255;

/// Writes frames of one size, so many a second, as an animation that repeats for ever.
pub fn write(frames: &[RgbImage], rate: u16, path: &Path) -> Result<(), EncodingError> {
    let Some(first) = frames.first() else { return Ok(()) };
    let (width, height) = first.dimensions();
    let mut encoder = Encoder::new(BufWriter::new(File::create(path)?), width, height);
    encoder.set_color(ColorType::Rgba);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::High);
    encoder.set_filter(Filter::NoFilter);
    encoder.set_animated(frames.len() as u32, 0)?;
    encoder.set_frame_delay(1, rate)?;
    encoder.set_blend_op(BlendOp::Over)?;
    let mut writer = encoder.write_header()?;
    let mut shown: Option<RgbImage> = None;
    for frame in frames {
        writer.write_image_data(&changes(frame, &mut shown))?;
    }
    writer.finish()
}

/// The pixels of a frame, transparent where they differ from what is shown by noise alone. What is shown goes along.
fn changes(frame: &RgbImage, shown: &mut Option<RgbImage>) -> Vec<u8> {
    let Some(shown) = shown else {
        *shown = Some(frame.clone());
        return frame.pixels().flat_map(opaque).collect();
    };
    let mut rgba = Vec::with_capacity(4 * (frame.width() * frame.height()) as usize);
    for (now, last) in frame.pixels().zip(shown.pixels_mut()) {
        if now.0.iter().zip(last.0).any(|(a, b)| a.abs_diff(b) > NOISE) {
            *last = *now;
            rgba.extend(opaque(now));
        } else {
            rgba.extend([0; 4]);
        }
    }
    rgba
}

fn opaque(pixel: &image::Rgb<u8>) -> [u8; 4] {
    let [red, green, blue] = pixel.0.map(|c| c & KEPT);
    [red, green, blue, OPAQUE]
}
