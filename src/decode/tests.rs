//! JPEG data as cameras send them, against the same with all that the standard asks for.

use std::io::Cursor;

use image::codecs::jpeg::JpegEncoder;
use image::{GrayImage, ImageFormat, Luma, Rgb, RgbImage};

use super::*;

const MOST: u64 = 1_000_000;

fn colours() -> RgbImage {
    RgbImage::from_fn(61, 43, |x, y| Rgb([(x * 4) as u8, (y * 5) as u8, (x * y) as u8]))
}

fn jpeg(image: &RgbImage) -> Vec<u8> {
    let mut out = Vec::new();
    image.write_with_encoder(JpegEncoder::new_with_quality(&mut out, 90)).unwrap();
    out
}

fn read(bytes: &[u8]) -> Result<FrameBuffer, String> {
    decode(bytes, None, MOST).map_err(|e| e.to_string())
}

/// The segments before the first scan, and what follows.
fn split(jpeg: &[u8]) -> (Vec<&[u8]>, &[u8]) {
    let mut segments = Vec::new();
    let mut at = 2;
    while jpeg[at + 1] != 0xda {
        let next = at + 2 + usize::from(u16::from_be_bytes([jpeg[at + 2], jpeg[at + 3]]));
        segments.push(&jpeg[at..next]);
        at = next;
    }
    (segments, &jpeg[at..])
}

fn joined(segments: &[&[u8]], rest: &[u8]) -> Vec<u8> {
    [&[0xff, 0xd8][..], &segments.concat(), rest].concat()
}

fn without_tables(jpeg: &[u8]) -> Vec<u8> {
    let (segments, rest) = split(jpeg);
    let kept: Vec<_> = segments.into_iter().filter(|segment| segment[1] != 0xc4).collect();
    joined(&kept, rest)
}

/// The tables in segments, by class and number.
fn tables_in(segments: &[&[u8]]) -> Vec<Vec<u8>> {
    let mut tables = Vec::new();
    for segment in segments.iter().filter(|segment| segment[1] == 0xc4) {
        let mut rest = &segment[4..];
        while !rest.is_empty() {
            let symbols: usize = rest[1..17].iter().map(|&n| usize::from(n)).sum();
            let (table, more) = rest.split_at(17 + symbols);
            tables.push(table.to_vec());
            rest = more;
        }
    }
    tables.sort();
    tables
}

#[test]
fn the_tables_put_in_are_those_that_encoders_write() {
    let whole = jpeg(&colours());
    let written = tables_in(&split(&whole).0);
    assert_eq!(written.len(), 4);
    assert_eq!(tables_in(&[tables::HUFFMAN]), written);
}

#[test]
fn without_tables_the_picture_is_the_same() {
    let whole = jpeg(&colours());
    let expected = read(&whole).unwrap();
    let bare = without_tables(&whole);
    assert!(bare.len() < whole.len() - 400);
    assert_eq!(read(&bare), Ok(expected.clone()));
    let (segments, rest) = split(&bare);
    // As in AVI files, not a field; and with all that may be said in between.
    let avi = [&[0xff, 0xe0, 0, 16][..], b"AVI1\0", &[0; 9]].concat();
    let talk = [&[0xff, 0xe1, 0, 8][..], b"Exif\0\0", &[0xff, 0xfe, 0, 4], b"hi"].concat();
    for more in [vec![&avi[..]], vec![&talk], vec![&avi, &talk, &[0xff]]] {
        assert_eq!(read(&joined(&[more, segments.clone()].concat(), rest)), Ok(expected.clone()));
    }
    let mut grey = Vec::new();
    let image = GrayImage::from_fn(33, 17, |x, y| Luma([(7 * x + y) as u8]));
    image.write_with_encoder(JpegEncoder::new(&mut grey)).unwrap();
    assert_eq!(read(&without_tables(&grey)), read(&grey));
}

#[test]
fn what_lies_behind_the_end_does_not_count_and_a_second_field_is_told() {
    let whole = jpeg(&colours());
    let expected = read(&whole).unwrap();
    let other = jpeg(&RgbImage::new(8, 8));
    for behind in [&[0; 100][..], &[0xff; 7], b"\xff\xda\xff\xd8", &other] {
        assert_eq!(read(&[&whole, behind].concat()), Ok(expected.clone()));
    }
    let (segments, rest) = split(&whole);
    let field = [&[0xff, 0xe0, 0, 16][..], b"AVI1\x01", &[0; 9]].concat();
    let field = joined(&[vec![&field[..]], segments].concat(), rest);
    assert_eq!(read(&field), Ok(expected));
    let why = read(&[&field[..], &field].concat()).unwrap_err();
    assert!(why.contains("two fields of an interlaced frame"), "{why}");
}

#[test]
fn the_mark_at_the_end_may_be_missing_and_nothing_else() {
    let whole = jpeg(&colours());
    let expected = read(&whole).unwrap();
    let unmarked = &whole[..whole.len() - 2];
    assert_eq!(read(unmarked), Ok(expected.clone()));
    let mut refused = 0;
    for len in (split(&whole).1.len()..unmarked.len()).step_by(7).chain(unmarked.len() - 30..unmarked.len()) {
        match read(&whole[..len]) {
            Err(why) => refused += usize::from(why.contains("truncated")),
            Ok(frame) => assert!(frame == expected && len + 4 > unmarked.len(), "{len} of {}", whole.len()),
        }
    }
    assert!(refused > 30);
}

#[test]
fn what_an_image_takes_is_known_before_it_is_decoded() {
    let whole = jpeg(&colours());
    let needed = 61 * 43 * 3;
    assert!(decode(&whole, None, needed).is_ok());
    let expected = DecodeError::TooLarge { width: 61, height: 43, needed, most: needed - 1 };
    assert_eq!(decode(&whole, None, needed - 1), Err(expected.clone()));
    let mut png = Vec::new();
    colours().write_to(&mut Cursor::new(&mut png), ImageFormat::Png).unwrap();
    assert!(decode(&png, None, needed).is_ok());
    assert_eq!(decode(&png, None, needed - 1), Err(expected));
    // A header alone.
    assert_eq!(read(&whole[..4]).unwrap_err(), "cannot be decoded: the JPEG data are truncated after 4 bytes");
    assert!(read(&png[..20]).is_err());
}
