//! A folder of images as a source of frames.

use std::path::{Path, PathBuf};

use super::other::{self, Tally};
use super::truth::FILE_NAME;
use super::{FrameBuffer, FrameSource, Origin, ReplayError, order};
use crate::decode::decode;
use crate::file;
use crate::params::Limits;

/// Names that images end in, in any case.
pub const EXTENSIONS: [&str; 9] = ["jpg", "jpeg", "png", "bmp", "tif", "tiff", "webp", "pgm", "ppm"];
/// The folder within a sequence's folder that holds its images.
pub const IMAGE_FOLDER: &str = "img";
/// A file of at most so many bytes may be a link in writing; no image is that small.
const MAX_LINK: u64 = 1024;

/// The images of a folder, sorted by the numbers in their names; see `order`.
#[derive(Debug)]
pub struct Folder {
    images: std::vec::IntoIter<PathBuf>,
    path: PathBuf,
    /// The last image file, as it was read.
    bytes: Vec<u8>,
    notes: Vec<String>,
    /// Bytes that an image may take.
    most: u64,
}

impl Folder {
    /// The images in `path`, or in `path/img` where there is such a folder or a link to one. None at all is an error.
    pub fn open(path: &Path, limits: &Limits) -> Result<Self, ReplayError> {
        let path = image_folder(path);
        let (mut images, others): (Vec<_>, Vec<_>) = files(&path)?.into_iter().partition(|file| is_image(file));
        if images.is_empty() {
            let advice = other::folder_advice(&path, &others);
            return Err(ReplayError::NoImages { path, advice });
        }
        let mut notes = order::sort(&mut images);
        let mut passed_over = Tally::default();
        others.iter().for_each(|file| passed_over.add(file));
        let passed_over = passed_over.strange();
        if !passed_over.is_empty() {
            notes.push(format!("ignored: {passed_over}; only {} are read", EXTENSIONS.join(", ")));
        }
        let notes = notes.into_iter().map(|note| format!("{}: {note}", path.display())).collect();
        Ok(Self { images: images.into_iter(), path, bytes: Vec::new(), notes, most: limits.image_bytes() })
    }
}

/// Whether images lie in the folder, or in the one within that would be taken.
pub fn has_images(path: &Path) -> Result<bool, ReplayError> {
    Ok(files(&image_folder(path))?.iter().any(|file| is_image(file)))
}

/// The files of a folder that are not hidden: archives leave such behind (`._0001.jpg`).
pub fn files(path: &Path) -> Result<Vec<PathBuf>, ReplayError> {
    let failed = |source| ReplayError::Io { path: path.to_owned(), source };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(path).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        if !entry.file_name().to_string_lossy().starts_with('.') && !entry.path().is_dir() {
            files.push(entry.path());
        }
    }
    Ok(files)
}

impl FrameSource for Folder {
    fn next_frame(&mut self) -> Result<Option<FrameBuffer>, ReplayError> {
        let Some(path) = self.images.next() else { return Ok(None) };
        self.bytes = load(&path, self.most)?;
        decoded(&path, &self.bytes, self.most).map(Some)
    }

    fn skip_frame(&mut self) -> Result<bool, ReplayError> {
        Ok(self.images.next().is_some())
    }

    fn origin(&self) -> Origin<'_> {
        Origin::File(&self.bytes)
    }

    fn remaining(&self) -> Option<usize> {
        Some(self.images.len())
    }

    fn truth_candidates(&self) -> Vec<PathBuf> {
        let beside = self.path.join(FILE_NAME);
        let above = self.path.parent().filter(|_| self.path.ends_with(IMAGE_FOLDER)).map(|p| p.join(FILE_NAME));
        above.into_iter().chain([beside]).collect()
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }
}

/// The folder with the images of a sequence.
fn image_folder(path: &Path) -> PathBuf {
    let inner = path.join(IMAGE_FOLDER);
    if inner.is_dir() {
        return inner;
    }
    let bytes = file::read(&inner, MAX_LINK).unwrap_or_default();
    let linked = link(&bytes).map(|link| path.join(link)).filter(|folder| folder.is_dir());
    linked.unwrap_or_else(|| path.to_owned())
}

/// Whether it is called an image, and is no folder. A pipe or a device of that name is refused when it is read.
pub fn is_image(path: &Path) -> bool {
    let hidden = path.file_name().is_some_and(|n| n.to_string_lossy().starts_with('.'));
    !hidden && EXTENSIONS.contains(&other::suffix(path).as_str()) && !path.is_dir()
}

/// Reads an image file; see [`decode`].
pub fn read(path: &Path, limits: &Limits) -> Result<FrameBuffer, ReplayError> {
    let most = limits.image_bytes();
    decoded(path, &load(path, most)?, most)
}

fn decoded(path: &Path, bytes: &[u8], most: u64) -> Result<FrameBuffer, ReplayError> {
    decode(bytes, None, most).map_err(|source| ReplayError::Decode { path: path.to_owned(), source })
}

/// The bytes of a file, or of the one it stands for. No image is larger in its file than it may be in memory.
fn load(path: &Path, most: u64) -> Result<Vec<u8>, ReplayError> {
    let get = |path: &Path| {
        file::read(path, most).map_err(|error| ReplayError::Io { path: path.to_owned(), source: error.into() })
    };
    let bytes = get(path)?;
    match (link(&bytes), path.parent()) {
        (Some(link), Some(parent)) if is_image(Path::new(link)) => get(&parent.join(link)),
        _ => Ok(bytes),
    }
}

/// What a file links to in writing, relative to its folder: archives and file systems without symbolic links keep such
/// a link as a small file that holds the path.
fn link(bytes: &[u8]) -> Option<&str> {
    let text = (bytes.len() as u64 <= MAX_LINK).then(|| std::str::from_utf8(bytes).ok()).flatten()?.trim();
    (!text.is_empty() && !text.contains(char::is_control)).then_some(text)
}

#[cfg(test)]
mod tests {
    use image::{DynamicImage, ImageBuffer, Luma, Rgb, Rgba};

    use super::*;
    use crate::frame::Encoding;

    fn gradient() -> image::RgbImage {
        image::RgbImage::from_fn(64, 48, |x, y| Rgb([4 * x as u8, 5 * y as u8, (3 * x * y) as u8]))
    }

    fn names(mut source: Folder) -> Vec<String> {
        std::iter::from_fn(|| source.images.next()).map(|p| p.file_name().unwrap().to_str().unwrap().into()).collect()
    }

    #[test]
    fn images_are_sorted_by_the_numbers_in_their_names() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["f10.png", "f9.jpg", "f1.JPEG", "f100.png", "notes.txt", "._f9.jpg"] {
            std::fs::write(dir.path().join(name), b"").unwrap();
        }
        let source = Folder::open(dir.path(), &Limits::default()).unwrap();
        assert_eq!(source.remaining(), Some(4));
        assert_eq!(source.truth_candidates(), [dir.path().join(FILE_NAME)]);
        assert_eq!(names(source), ["f1.JPEG", "f9.jpg", "f10.png", "f100.png"]);
    }

    #[test]
    fn an_inner_folder_is_preferred_and_an_empty_one_named() {
        let dir = tempfile::tempdir().unwrap();
        let inner = dir.path().join(IMAGE_FOLDER);
        std::fs::create_dir(&inner).unwrap();
        let message = Folder::open(dir.path(), &Limits::default()).unwrap_err().to_string();
        let known = EXTENSIONS.join(", ");
        assert_eq!(message, format!("{}: no images ({known}) in the folder, which is empty", inner.display()));
        std::fs::write(inner.join("1.png"), b"").unwrap();
        let source = Folder::open(dir.path(), &Limits::default()).unwrap();
        assert_eq!(source.truth_candidates()[0], dir.path().join(FILE_NAME));
        assert_eq!(names(source), ["1.png"]);
    }

    #[test]
    fn pixel_layouts_are_taken_as_they_are_or_as_the_nearest_that_frames_know() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let encoding = |image: DynamicImage| {
            image.save(&path).unwrap();
            let buffer = read(&path, &Limits::default()).unwrap();
            (buffer.frame().encoding(), buffer.frame().rgb(1, 0))
        };
        let rgb: ImageBuffer<Rgb<u8>, _> = ImageBuffer::from_pixel(3, 2, Rgb([1, 2, 3]));
        assert_eq!(encoding(rgb.into()), (Encoding::Rgb8, [1, 2, 3]));
        let rgba: ImageBuffer<Rgba<u8>, _> = ImageBuffer::from_pixel(3, 2, Rgba([1, 2, 3, 0]));
        assert_eq!(encoding(rgba.into()), (Encoding::Rgba8, [1, 2, 3]));
        let grey: ImageBuffer<Luma<u8>, _> = ImageBuffer::from_pixel(3, 2, Luma([7]));
        assert_eq!(encoding(grey.clone().into()), (Encoding::Mono8, [7; 3]));
        let veiled = DynamicImage::from(grey).to_luma_alpha8();
        assert_eq!(encoding(veiled.into()), (Encoding::Mono8, [7; 3]));
        let deep: ImageBuffer<Rgb<u16>, _> = ImageBuffer::from_pixel(3, 2, Rgb([257, 514, 771]));
        assert_eq!(encoding(deep.into()), (Encoding::Rgb8, [1, 2, 3]));
        let deep: ImageBuffer<Luma<u16>, _> = ImageBuffer::from_pixel(3, 2, Luma([257]));
        assert_eq!(encoding(deep.into()), (Encoding::Mono16, [1; 3]));
    }

    #[test]
    fn frames_can_be_passed_over_unseen() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("1.png"), "no image").unwrap();
        gradient().save(dir.path().join("2.png")).unwrap();
        let mut source = Folder::open(dir.path(), &Limits::default()).unwrap();
        assert!(source.skip_frame().unwrap());
        assert_eq!(source.next_frame().unwrap(), Some(read(&dir.path().join("2.png"), &Limits::default()).unwrap()));
        assert!(!source.skip_frame().unwrap());
    }

    #[test]
    fn broken_images_are_named_wherever_they_end() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["a.jpg", "a.png"] {
            let path = dir.path().join(name);
            gradient().save(&path).unwrap();
            let whole = std::fs::read(&path).unwrap();
            assert!(read(&path, &Limits::default()).is_ok());
            for share in [0, 1, 20, 50, 90, 99] {
                std::fs::write(&path, &whole[..whole.len() * share / 100]).unwrap();
                let message = read(&path, &Limits::default()).unwrap_err().to_string();
                assert!(message.starts_with(&format!("{}: cannot be decoded: ", path.display())), "{message}");
            }
        }
        let path = dir.path().join("gone.jpg");
        assert!(read(&path, &Limits::default()).unwrap_err().to_string().contains("gone.jpg: No such file"));
    }

    #[test]
    fn a_written_link_stands_for_the_image_it_names() {
        let dir = tempfile::tempdir().unwrap();
        let (frames, img) = (dir.path().join("frames"), dir.path().join("img"));
        for folder in [&frames, &img] {
            std::fs::create_dir(folder).unwrap();
        }
        gradient().save(frames.join("1.png")).unwrap();
        std::fs::write(img.join("1.png"), "../frames/1.png\n").unwrap();
        assert_eq!(
            read(&img.join("1.png"), &Limits::default()).unwrap(),
            read(&frames.join("1.png"), &Limits::default()).unwrap()
        );
        std::fs::write(img.join("2.png"), "../frames/2.png").unwrap();
        assert!(
            read(&img.join("2.png"), &Limits::default())
                .unwrap_err()
                .to_string()
                .contains("frames/2.png: No such file")
        );

        let sequence = dir.path().join("sequence");
        std::fs::create_dir(&sequence).unwrap();
        std::fs::write(sequence.join("img"), "../frames\n").unwrap();
        assert_eq!(names(Folder::open(&sequence, &Limits::default()).unwrap()), ["1.png"]);
        std::fs::write(sequence.join("img"), "../gone").unwrap();
        assert!(Folder::open(&sequence, &Limits::default()).unwrap_err().to_string().contains("sequence"));
    }
}
