//! PNG data made ready for the decoder: nothing but the picture, whose size its header tells.
//!
//! The chunks are those of the PNG specification (third edition): a length, a type, what it says, and a checksum.

use std::borrow::Cow;

use super::ready::Ready;

const MAGIC: &[u8] = b"\x89PNG\r\n\x1a\n";
const HEADER: &[u8; 4] = b"IHDR";
const DATA: &[u8; 4] = b"IDAT";
/// The chunks that make the picture. Others, such as a colour profile or text, may hold far more than they seem to.
const KEPT: [&[u8; 4]; 5] = [HEADER, b"PLTE", b"tRNS", DATA, b"IEND"];
/// Bytes of a chunk besides what it says: length, type, checksum.
const AROUND: usize = 12;
/// Bytes that a byte of deflated data stands for at most.
const MOST_INFLATED: u64 = 1032;

/// The data without what is not needed, if they begin with a header.
pub(super) fn ready(bytes: &[u8]) -> Option<Ready<'_>> {
    let mut kept = Vec::new();
    let mut deflated = 0_usize;
    let mut pixels = None;
    let mut at = MAGIC.len();
    while let Some(&[l3, l2, l1, l0, ref kind @ ..]) = bytes.get(at..at + 8) {
        let kind: &[u8; 4] = kind.try_into().unwrap_or(&[0; 4]);
        let len = u32::from_be_bytes([l3, l2, l1, l0]) as usize;
        // A chunk that is cut off is the decoder's to complain about.
        let next = at.saturating_add(AROUND).saturating_add(len).min(bytes.len());
        match kind {
            HEADER if pixels.is_none() => pixels = bytes.get(at + 8..next).and_then(Pixels::of),
            DATA => deflated = deflated.saturating_add(len),
            _ => {}
        }
        if KEPT.contains(&kind) {
            kept.push(at..next);
        }
        at = next;
    }
    let pixels = pixels?;
    let too_short = (deflated as u64).saturating_mul(MOST_INFLATED) < pixels.bytes();
    let len: usize = kept.iter().map(ExactSizeIterator::len).sum();
    let bytes = if MAGIC.len() + len == bytes.len() {
        Cow::Borrowed(bytes)
    } else {
        let kept = kept.into_iter().map(|chunk| &bytes[chunk]);
        Cow::Owned(std::iter::once(MAGIC).chain(kept).collect::<Vec<_>>().concat())
    };
    Some(Ready { bytes, working: 0, too_short: too_short.then_some(deflated), ended: true })
}

/// What the header says.
struct Pixels {
    width: u32,
    height: u32,
    bits: u64,
}

impl Pixels {
    fn of(body: &[u8]) -> Option<Self> {
        let &[w3, w2, w1, w0, h3, h2, h1, h0, depth, colour, ..] = body else { return None };
        let channels = match colour {
            2 => 3,
            4 => 2,
            6 => 4,
            _ => 1,
        };
        let [width, height] = [[w3, w2, w1, w0], [h3, h2, h1, h0]].map(u32::from_be_bytes);
        Some(Self { width, height, bits: u64::from(depth) * channels })
    }

    /// Bytes of all rows, packed.
    fn bytes(&self) -> u64 {
        u64::from(self.height).saturating_mul((u64::from(self.width) * self.bits).div_ceil(8))
    }
}
