//! JPEG data made ready for the decoder: what it will take is known from the headers, and what cameras leave out is put
//! in.
//!
//! The segments are those of ITU-T T.81, Annex B: a marker of two bytes, for most a length of two bytes that counts
//! itself, and what it says. The coded data of a scan follow its header, up to the next marker.

use std::borrow::Cow;

use super::ready::Ready;
use super::tables;

const START: [u8; 2] = [0xff, START_CODE];
const START_CODE: u8 = 0xd8;
const END: [u8; 2] = [0xff, END_CODE];
const END_CODE: u8 = 0xd9;
const HUFFMAN: u8 = 0xc4;
const SCAN: u8 = 0xda;
/// The first segment for applications: says that the data are a frame of an AVI file, and which of its fields.
const APPLICATION_0: u8 = 0xe0;
/// The one that says how colours are meant.
const APPLICATION_14: u8 = 0xee;
const AVI: &[u8] = b"AVI1";
/// Bytes of a marker with its length.
const SEGMENT_HEADER: usize = 4;
/// Samples along a side of a block.
const BLOCK: u64 = 8;
/// Bytes that the decoder holds of each block where a scan does not have all of the image: 64 coefficients of 16 bits.
const BLOCK_BYTES: u64 = 128;
/// Scans that are decoded at most: each costs time, and encoders write some ten.
const MOST_SCANS: usize = 64;

/// What is wrong with JPEG data, after "the JPEG data".
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum JpegError {
    /// The file ends too early.
    #[error("are truncated after {len} bytes")]
    CutOff { len: usize },
    /// Something else stands between two segments.
    #[error("have {found:#04x} at {at}, where a marker is expected")]
    Marker { found: u8, at: usize },
    /// The end without an image before it.
    #[error("end before the first scan")]
    NoScan,
    /// Nothing tells how large the image is.
    #[error("have no frame header before the first scan")]
    NoHeader,
    /// A header that does not hold what it must.
    #[error("have a frame header of {len} bytes")]
    Header { len: usize },
    /// Components whose sizes make no sense, across and down.
    #[error("have sampling factors {factors:?}, expected 1 to 4")]
    Sampling { factors: Vec<[u64; 2]> },
    /// So many that decoding would take for ever.
    #[error("have more than {most} scans")]
    Scans { most: usize },
    /// Two pictures of half the rows.
    #[error("hold two fields of an interlaced frame, which is not supported")]
    Interlaced,
}

/// The header of the image.
#[derive(Debug)]
struct Frame {
    baseline: bool,
    /// Blocks of each component.
    blocks: Vec<u64>,
}

/// The parts of the data.
#[derive(Debug, Default)]
struct Parts {
    frame: Option<Frame>,
    /// Where the segments that the decoder needs are, before the first scan.
    kept: Vec<std::ops::Range<usize>>,
    has_tables: bool,
    /// Where the header of the first scan begins, and where what it codes.
    scan: [usize; 2],
    /// Components in the first scan.
    scanned: usize,
    scans: usize,
    /// Behind the mark at the end.
    end: Option<usize>,
    /// Whether the data are one field of a frame of two.
    is_field: bool,
}

/// Looks through the data, or says what is wrong with them. The tables that the standard proposes (Annex K.3) are put
/// in where there are none: motion JPEG leaves them out. Segments that mean nothing to the picture are left out.
pub(super) fn ready(bytes: &[u8]) -> Result<Ready<'_>, JpegError> {
    let parts = parts(bytes)?;
    let Parts { frame: Some(frame), scan: [header, coded], .. } = &parts else {
        return Err(JpegError::NoHeader);
    };
    if parts.scans > MOST_SCANS {
        return Err(JpegError::Scans { most: MOST_SCANS });
    }
    // Two bits for each block at least, one where those of higher frequencies come in later scans.
    let bits = frame.blocks.iter().max().copied().unwrap_or(0) << u64::from(frame.baseline);
    let len = bytes.len() - coded;
    let too_short = (len as u64).saturating_mul(8) < bits;
    if let Some(end) = parts.end.filter(|_| parts.is_field)
        && bytes[end..].windows(2).any(|pair| pair == START)
    {
        return Err(JpegError::Interlaced);
    }
    let at_once = frame.baseline && parts.scanned == frame.blocks.len();
    if parts.end.is_none() && !at_once {
        return Err(cut_off(bytes));
    }
    let working = if at_once { 0 } else { frame.blocks.iter().sum::<u64>() * BLOCK_BYTES };
    let insert = if parts.has_tables || !frame.baseline { &[][..] } else { tables::HUFFMAN };
    let kept: usize = parts.kept.iter().map(ExactSizeIterator::len).sum();
    let bytes = if insert.is_empty() && START.len() + kept == *header {
        Cow::Borrowed(bytes)
    } else {
        let segments = parts.kept.iter().map(|segment| &bytes[segment.clone()]);
        let all = std::iter::once(&START[..]).chain(segments).chain([insert, &bytes[*header..]]);
        Cow::Owned(all.collect::<Vec<_>>().concat())
    };
    Ok(Ready { bytes, working, too_short: too_short.then_some(len), ended: parts.end.is_some() })
}

/// Why data that end too early are not decoded.
pub(super) fn cut_off(bytes: &[u8]) -> JpegError {
    JpegError::CutOff { len: bytes.len() }
}

/// Walks over the segments and the scans.
fn parts(bytes: &[u8]) -> Result<Parts, JpegError> {
    let cut_off = || cut_off(bytes);
    let mut parts = Parts::default();
    let mut at = START.len();
    loop {
        let Some(&[first, code]) = bytes.get(at..at + 2) else {
            return if parts.scans == 0 { Err(cut_off()) } else { Ok(parts) };
        };
        if first != 0xff {
            return Err(JpegError::Marker { found: first, at });
        }
        match code {
            // A byte that fills up.
            0xff => at += 1,
            START_CODE | 0x01 | 0xd0..=0xd7 => at += 2,
            END_CODE if parts.scans == 0 => return Err(JpegError::NoScan),
            END_CODE => {
                parts.end = Some(at + 2);
                return Ok(parts);
            }
            _ => {
                let length = bytes.get(at + 2..at + SEGMENT_HEADER).map(|l| u16::from_be_bytes([l[0], l[1]]).into());
                let Some(length @ 2..) = length else { return Err(cut_off()) };
                let next = at + 2 + length;
                let Some(body) = bytes.get(at + SEGMENT_HEADER..next) else {
                    return if parts.scans == 0 { Err(cut_off()) } else { Ok(parts) };
                };
                parts.segment(code, body, at..next)?;
                at = if code == SCAN { next + coded(&bytes[next..]) } else { next };
                if parts.scans > MOST_SCANS {
                    return Ok(parts);
                }
            }
        }
    }
}

impl Parts {
    fn segment(&mut self, code: u8, body: &[u8], place: std::ops::Range<usize>) -> Result<(), JpegError> {
        match code {
            SCAN => {
                if self.scans == 0 {
                    self.scan = [place.start, place.end];
                    self.scanned = body.first().copied().unwrap_or(0).into();
                }
                self.scans += 1;
                return Ok(());
            }
            HUFFMAN if self.scans == 0 => self.has_tables = true,
            // Of them, those that are decoded: baseline, extended, progressive.
            0xc0..=0xc2 if self.frame.is_none() => self.frame = Some(Frame::of(code, body)?),
            APPLICATION_0 if body.starts_with(AVI) => {
                self.is_field = body.get(AVI.len()).is_some_and(|&field| field > 0)
            }
            _ => {}
        }
        // What applications and people say to each other, which may be long.
        let is_talk = matches!(code, 0xe1..=0xef | 0xfe) && code != APPLICATION_14;
        if self.scans == 0 && !is_talk {
            self.kept.push(place);
        }
        Ok(())
    }
}

impl Frame {
    fn of(code: u8, body: &[u8]) -> Result<Self, JpegError> {
        let wrong = || JpegError::Header { len: body.len() };
        let &[_, h1, h0, w1, w0, count, ref components @ ..] = body else { return Err(wrong()) };
        if count == 0 || components.len() != 3 * usize::from(count) {
            return Err(wrong());
        }
        let [width, height] = [[w1, w0], [h1, h0]].map(|pair| u32::from(u16::from_be_bytes(pair)));
        let sampling: Vec<[u64; 2]> =
            components.chunks_exact(3).map(|c| [u64::from(c[1] >> 4), u64::from(c[1] & 0xf)]).collect();
        if sampling.iter().flatten().any(|factor| !(1..=4).contains(factor)) {
            return Err(JpegError::Sampling { factors: sampling });
        }
        let most = |side: usize| sampling.iter().map(|s| s[side]).max().unwrap_or(1);
        let units = [u64::from(width).div_ceil(BLOCK * most(0)), u64::from(height).div_ceil(BLOCK * most(1))];
        // A single component has blocks as if its factors were one.
        let blocks = if sampling.len() == 1 {
            vec![u64::from(width).div_ceil(BLOCK) * u64::from(height).div_ceil(BLOCK)]
        } else {
            sampling.iter().map(|[h, v]| units[0] * h * units[1] * v).collect()
        };
        Ok(Self { baseline: code != 0xc2, blocks })
    }
}

/// How many bytes lie before the next marker that is no part of coded data.
fn coded(bytes: &[u8]) -> usize {
    let mut at = 0;
    while let Some(found) = bytes[at..].iter().position(|&byte| byte == 0xff) {
        at += found;
        match bytes.get(at + 1) {
            // A stuffed byte, or a mark to set in at again.
            Some(0 | 0xd0..=0xd7) => at += 2,
            Some(0xff) => at += 1,
            Some(_) => return at,
            None => break,
        }
    }
    bytes.len()
}

/// Data without their mark at the end, with bits of two kinds behind them. Where the picture is the same with both, all
/// of it was there.
pub(super) fn completed(bytes: &[u8]) -> [Vec<u8>; 2] {
    /// More than what any code takes.
    const BITS: usize = 64;
    [0x00, 0xa9].map(|fill| [bytes, &[fill; BITS], &END].concat())
}
