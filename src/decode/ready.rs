//! What is known of data before the decoder is given them.

use std::borrow::Cow;

/// Data that the decoder may be given.
#[derive(Debug)]
pub(super) struct Ready<'a> {
    pub(super) bytes: Cow<'a, [u8]>,
    /// Bytes that the decoder needs beside the pixels.
    pub(super) working: u64,
    /// How many bytes code the pixels, where these are too few for them.
    pub(super) too_short: Option<usize>,
    /// Whether the mark at the end is there. Without it, the data may be cut off, or the camera leaves it out.
    pub(super) ended: bool,
}
