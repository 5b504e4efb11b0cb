//! Image files and compressed images of a camera.

use std::io::Cursor;

use image::codecs::jpeg::JpegEncoder;
use image::{ImageFormat, RgbImage};
use tempfile::TempDir;

use super::bytes::{claiming, png, progressive, without_tables, zlib_zeros};
use super::{INIT, REFUSED, Ran, fifo, scene, track};
#[cfg(feature = "ros")]
use crate::support::scenario;

fn jpeg(image: &RgbImage) -> Vec<u8> {
    let mut out = Vec::new();
    image.write_with_encoder(JpegEncoder::new_with_quality(&mut out, 92)).unwrap();
    out
}

fn folder(files: &[(&str, &[u8])]) -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    files.iter().for_each(|(name, bytes)| std::fs::write(dir.path().join(name), bytes).unwrap());
    dir
}

fn follow(name: &str, bytes: &[u8]) -> Ran {
    track(folder(&[(name, bytes)]).path(), &INIT)
}

#[test]
fn an_image_that_claims_to_be_large_is_refused_by_its_header() {
    let small = jpeg(&RgbImage::new(16, 16));
    assert!(small.len() < 700);
    for (size, words) in [
        ([20000, 8000], &["image of 20000 x 8000 takes 480 MB", "limits.image_mb is 300"][..]),
        ([65500, 65500], &["image of 65500 x 65500 is larger than 32768 on a side"]),
        ([9000, 9000], &["are too few for 9000 x 9000 pixels"]),
    ] {
        follow("1.jpg", &claiming(&small, size)).refused(words, REFUSED);
    }
    // Half a megabyte that is 900 MB of pixels, and less that is a fourth of the limit's.
    let bomb = png([20000, 15000], 8, 2, &[], &zlib_zeros(20000 * 15000 * 3));
    follow("1.png", &bomb).refused(&["image of 20000 x 15000 takes 900 MB", "limits.image_mb is 300"], REFUSED);
    follow("1.png", &png([9000, 9000], 16, 6, &[], &[0; 100])).refused(&["takes 648 MB"], REFUSED);
    follow("1.png", &png([9000, 9000], 8, 2, &[], &[0; 100])).refused(&["too few for 9000 x 9000"], REFUSED);
}

#[test]
fn the_limit_is_the_users() {
    let image = scene(0);
    let dir = folder(&[("1.jpg", &jpeg(&RgbImage::new(1000, 400)))]);
    track(dir.path(), &[&INIT[..], &["-p", "limits.image_mb:=1"]].concat())
        .refused(&["image of 1000 x 400 takes 2 MB to decode, limits.image_mb is 1"], REFUSED);
    let ran = track(folder(&[("1.jpg", &jpeg(&image))]).path(), &[&INIT[..], &["-p", "limits.image_mb:=1"]].concat());
    assert_eq!(ran.code, Some(0), "{}", ran.err);
}

#[test]
fn what_takes_the_decoder_long_is_refused() {
    follow("1.jpg", &progressive([8000, 8000], 5000)).refused(&["more than 64 scans"], REFUSED);
    // Progressive images are held in coefficients beside their pixels.
    let large = progressive([16000, 10000], 10);
    follow("1.jpg", &large).refused(&["image of 16000 x 10000 takes 480 MB"], REFUSED);
}

#[test]
fn what_is_no_part_of_the_picture_costs_nothing() {
    let image = scene(0);
    let mut whole = Vec::new();
    image.write_to(&mut Cursor::new(&mut whole), ImageFormat::Png).unwrap();
    let at = whole.windows(4).position(|kind| kind == b"IDAT").unwrap();
    let len = u32::from_be_bytes(whole[at - 4..at].try_into().unwrap()) as usize;
    let zeros = zlib_zeros(250_000_000);
    let profile = [b"p\0\0", &zeros[..]].concat();
    let text = [b"k\0\0", &zeros[..]].concat();
    let utf8 = [b"k\0\x01\0\0\0", &zeros[..]].concat();
    let others = [(b"iCCP", &profile[..]), (b"zTXt", &text), (b"iTXt", &utf8)];
    let bomb = png([96, 72], 8, 2, &others, &whole[at + 4..at + 4 + len]);
    let plain = follow("1.png", &whole);
    let ran = follow("1.png", &bomb);
    assert_eq!((ran.code, &ran.out), (Some(0), &plain.out), "{}", ran.err);
    assert!(ran.peak < plain.peak + REFUSED, "{} kB, {} kB without", ran.peak, plain.peak);
    // A JPEG with thousands of parts of an XMP packet that never is whole.
    let part = [b"http://ns.adobe.com/xmp/extension/\0", &[b'a'; 32][..], &[0, 0xff, 0, 0, 0, 0, 0, 0, b'x']].concat();
    let part = [&[0xff, 0xe1][..], &(2 + part.len() as u16).to_be_bytes(), &part].concat();
    let whole = jpeg(&image);
    let bomb = [&whole[..2], &part.repeat(40_000), &whole[2..]].concat();
    assert_eq!(follow("1.jpg", &bomb).out, follow("1.jpg", &whole).out);
}

#[test]
fn files_that_never_end_or_begin_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    fifo(&dir.path().join("1.png"));
    track(dir.path(), &INIT).refused(&["1.png", "it is a FIFO, expected a regular file"], REFUSED);
    let dir = tempfile::tempdir().unwrap();
    std::os::unix::fs::symlink("/dev/zero", dir.path().join("1.png")).unwrap();
    track(dir.path(), &INIT).refused(&["1.png", "it is a device"], REFUSED);
    let dir = tempfile::tempdir().unwrap();
    std::fs::File::create(dir.path().join("1.png")).unwrap().set_len(1 << 40).unwrap();
    track(dir.path(), &INIT).refused(&["1.png", "it has 1099511627776 bytes"], REFUSED);
    let dir = folder(&[("1.jpg", &jpeg(&scene(0)))]);
    fifo(&dir.path().join("groundtruth_rect.txt"));
    track(dir.path(), &INIT[2..]).refused(&["groundtruth_rect.txt", "it is a FIFO"], REFUSED);
}

/// As many cameras send them by USB: the tables are those of the standard.
#[test]
fn jpeg_without_huffman_tables_gives_the_same_boxes() {
    let write = |change: &dyn Fn(&[u8]) -> Vec<u8>| {
        let dir = tempfile::tempdir().unwrap();
        for n in 0..4 {
            std::fs::write(dir.path().join(format!("{n}.jpg")), change(&jpeg(&scene(2 * n)))).unwrap();
        }
        track(dir.path(), &INIT)
    };
    let whole = write(&<[u8]>::to_vec);
    assert_eq!((whole.code, whole.out.lines().count()), (Some(0), 5), "{}", whole.err);
    let bare = write(&without_tables);
    assert_eq!((bare.code, bare.out), (Some(0), whole.out), "{}", bare.err);
}

/// Bombs, at a rate at which one is always being refused or decoded, cost no good image that comes after them.
#[cfg(feature = "ros")]
#[test]
fn good_images_arrive_among_bad_ones() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(dir.path().join(name), bytes).unwrap();
    write("claims.jpg", &claiming(&jpeg(&RgbImage::new(16, 16)), [20000, 8000]));
    // The last rows are missing, so that all others are decoded in vain.
    write("bomb.png", &png([6000, 6000], 8, 2, &[], &zlib_zeros((1 + 6000 * 3) * 5900)));
    write("scans.jpg", &progressive([8000, 8000], 5000));
    let args = ["--ros-args", "-p", "image_transport:=compressed", "-p", "lcmht.cnn.enabled:=false"];
    let args = [&args[..], &["-r", "image:=/camera/image_raw"]].concat();
    let log = scenario("bombs", &[dir.path().to_str().unwrap()], &args);
    assert!(log.contains("image of 20000 x 8000 takes 480 MB to decode, limits.image_mb is 300"), "{log}");
}
