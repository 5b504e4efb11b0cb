//! The debug thread: draws what the tracker saw and did, and publishes it, raw and as JPEG, while somebody looks; and
//! makes the pictures of the live page.

use std::borrow::Cow;
use std::collections::VecDeque;
use std::io::Cursor;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use image::codecs::jpeg::JpegEncoder;
use image::imageops::thumbnail;
use image::{ImageError, RgbImage};
use log::warn;
use ros2_client::Publisher;

use super::convert::Received;
use super::endpoints::Endpoints;
use super::fault::Fault;
use super::graph::Watched;
use super::messages::{CompressedImage, Header, Image};
use crate::draw::{self, Scene};
use crate::frame::Levels;
use crate::params::Debug;
use crate::tracker::Output;
use crate::viewer::{Hub, View};

/// Frames that are recorded, wait or are drawn at the same time. More than one, so that one that takes long delays the
/// next instead of losing it.
const SCENES: usize = 3;
/// Larger messages overflow the receive buffer of a peer with default settings.
const MOST_BYTES: usize = 120_000;
/// JPEG quality below which a picture is of no use.
const LEAST_QUALITY: u8 = 10;

/// A frame to draw, with all that is known of it.
pub struct Job {
    /// The image.
    pub frame: Arc<Received>,
    /// What was said of it.
    pub output: Output,
    /// What happened inside the tracker.
    pub scene: Scene,
    /// How to read it.
    pub levels: Levels,
    /// How to publish it.
    pub debug: Debug,
}

#[derive(Default)]
struct Queue {
    /// What waits to be drawn: at most as many as there are scenes, and a few moments.
    jobs: VecDeque<Job>,
    /// Those of the [`SCENES`] in which no frame is recorded or drawn.
    scenes: Vec<Scene>,
    closed: bool,
}

struct Shared {
    queue: Mutex<Queue>,
    changed: Condvar,
    image: DebugView,
    response: DebugView,
    page: Option<Hub>,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Queue> {
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A picture and its two topics.
pub struct DebugView {
    raw: (Publisher<Image>, Watched),
    compressed: (Publisher<CompressedImage>, Watched),
}

impl DebugView {
    /// Makes the topics `name` and `name/compressed`.
    pub fn new(endpoints: &mut Endpoints, name: &str) -> Result<Self, Fault> {
        Ok(Self {
            raw: endpoints.image_publisher(name)?,
            compressed: endpoints.image_publisher(&format!("{name}/compressed"))?,
        })
    }

    /// Whether somebody subscribes to the raw and to the compressed topic.
    fn wanted(&self) -> [bool; 2] {
        [self.raw.1.get(), self.compressed.1.get()]
    }

    /// Draws by `draw`, which takes the largest side of the picture, and publishes where somebody looks.
    fn publish(&self, draw: impl FnOnce(u32) -> RgbImage, header: &Header, debug: &Debug) -> Result<(), Fault> {
        let [raw, compressed] = self.wanted();
        if !raw && !compressed {
            return Ok(());
        }
        let sides = [(raw, debug.max_side), (compressed, debug.compressed_max_side)];
        let side = sides.into_iter().filter(|(wanted, _)| *wanted).map(|(_, side)| side).max().unwrap_or(0) as u32;
        let picture = draw(side);
        if raw {
            let message = raw_image(&scaled(&picture, debug.max_side as u32), header);
            self.raw.0.publish(message).map_err(|e| Fault::system("publish a debug image", e))?;
        }
        if compressed {
            let picture = scaled(&picture, debug.compressed_max_side as u32);
            let message = jpeg(&picture, header, debug.jpeg_quality as u8);
            let message = message.map_err(|e| Fault::system("compress a debug image", e))?;
            self.compressed.0.publish(message).map_err(|e| Fault::system("publish a debug image", e))?;
        }
        Ok(())
    }
}

/// The way to the debug thread.
#[derive(Clone)]
pub struct Feed(Arc<Shared>);

impl Feed {
    /// A feed for the two pictures and, where there is one, the live page.
    pub fn new(image: DebugView, response: DebugView, page: Option<Hub>) -> Self {
        let queue = Queue { scenes: vec![Scene::default(); SCENES], ..Queue::default() };
        Self(Arc::new(Shared { queue: Mutex::new(queue), changed: Condvar::new(), image, response, page }))
    }

    /// A scene to record the next frame in, if somebody looks and the thread keeps up.
    pub fn scene(&self) -> Option<Scene> {
        let Shared { image, response, page, .. } = &*self.0;
        let looked_at = [image, response].into_iter().any(|view| view.wanted() != [false; 2])
            || page.as_ref().is_some_and(Hub::wants);
        looked_at.then(|| self.0.lock().scenes.pop()).flatten().map(|mut scene| {
            scene.clear();
            scene
        })
    }

    /// Gives back a scene in which nothing was recorded; those of moments are more than are kept.
    pub fn keep(&self, scene: Scene) {
        let mut queue = self.0.lock();
        if queue.scenes.len() < SCENES {
            queue.scenes.push(scene);
        }
    }

    /// Hands over a recorded frame.
    pub fn submit(&self, job: Job) {
        self.0.lock().jobs.push_back(job);
        self.0.changed.notify_one();
    }

    /// Ends the thread.
    pub fn close(&self) {
        self.0.lock().closed = true;
        self.0.changed.notify_all();
    }

    /// Draws what is handed over until the feed is closed.
    pub fn run(self) {
        while let Some(job) = self.wait() {
            if let Err(fault) = self.draw(&job) {
                warn!("{fault}");
            }
            self.keep(job.scene);
        }
    }

    fn wait(&self) -> Option<Job> {
        let idle = |queue: &mut Queue| !queue.closed && queue.jobs.is_empty();
        let mut queue = self.0.changed.wait_while(self.0.lock(), idle).unwrap_or_else(PoisonError::into_inner);
        if queue.closed { None } else { queue.jobs.pop_front() }
    }

    fn draw(&self, job: &Job) -> Result<(), Fault> {
        let Shared { image, response, page, .. } = &*self.0;
        let Job { output, scene, debug, .. } = job;
        let (frame, header) = (job.frame.frame().with_levels(job.levels), job.frame.header());
        if let Some(page) = page {
            let view = View { frame, stamp: frame.stamp(), output, scene, quality: debug.jpeg_quality as u8 };
            page.show(&view).map_err(|e| Fault::system("make a picture for the live page", e))?;
        }
        image.publish(|side| draw::annotated(&frame, output, scene, side), header, debug)?;
        response.publish(|side| draw::response(&frame, scene, side), header, debug)
    }
}

/// The picture, smaller where a side is longer than `max_side`.
fn scaled(picture: &RgbImage, max_side: u32) -> Cow<'_, RgbImage> {
    let longest = picture.width().max(picture.height());
    if longest <= max_side {
        return Cow::Borrowed(picture);
    }
    let side = |s: u32| (u64::from(s) * u64::from(max_side) / u64::from(longest)).max(1) as u32;
    Cow::Owned(thumbnail(picture, side(picture.width()), side(picture.height())))
}

/// The picture as bgr8.
fn raw_image(picture: &RgbImage, header: &Header) -> Image {
    let data = picture.pixels().flat_map(|p| [p[2], p[1], p[0]]).collect();
    Image {
        header: header.clone(),
        height: picture.height(),
        width: picture.width(),
        encoding: "bgr8".to_owned(),
        is_bigendian: 0,
        step: 3 * picture.width(),
        data,
    }
}

/// The picture as JPEG, of less quality than asked for where it would be larger than a peer can take.
fn jpeg(picture: &RgbImage, header: &Header, mut quality: u8) -> Result<CompressedImage, ImageError> {
    loop {
        let mut data = Cursor::new(Vec::new());
        picture.write_with_encoder(JpegEncoder::new_with_quality(&mut data, quality))?;
        let data = data.into_inner();
        if data.len() <= MOST_BYTES || quality <= LEAST_QUALITY {
            return Ok(CompressedImage { header: header.clone(), format: "jpeg".to_owned(), data });
        }
        quality = (quality / 2).max(LEAST_QUALITY);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture() -> RgbImage {
        RgbImage::from_fn(64, 16, |x, _| image::Rgb([10, 20, if x < 32 { 30 } else { 200 }]))
    }

    #[test]
    fn raw_images_fit_the_largest_side_and_are_bgr() {
        let message = raw_image(&scaled(&picture(), 32), &Header::default());
        assert_eq!((message.width, message.height, message.step), (32, 8, 96));
        assert_eq!(&message.data[..3], [30, 20, 10]);
        assert_eq!(message.data.len(), 32 * 8 * 3);
        assert_eq!(raw_image(&scaled(&picture(), 64), &Header::default()).width, 64, "no larger than it is");
        assert_eq!(raw_image(&scaled(&picture(), 2), &Header::default()).height, 1, "no side vanishes");
    }

    #[test]
    fn jpegs_that_no_peer_could_take_lose_quality() {
        let noise = RgbImage::from_fn(800, 450, |x, y| {
            let hash = (x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA6B)).wrapping_mul(0xC2B2_AE35);
            image::Rgb([(hash >> 24) as u8, (hash >> 16) as u8, (hash >> 8) as u8])
        });
        let full = jpeg(&noise, &Header::default(), 10).unwrap().data.len();
        let message = jpeg(&noise, &Header::default(), 95).unwrap();
        assert!(message.data.len() <= MOST_BYTES.max(full), "{} bytes", message.data.len());
    }

    #[test]
    fn jpegs_read_back_at_full_size() {
        let message = jpeg(&picture(), &Header::default(), 90).unwrap();
        let back = image::load_from_memory(&message.data).unwrap().to_rgb8();
        assert_eq!(back.dimensions(), (64, 16));
        assert!(back.get_pixel(60, 8)[2].abs_diff(200) < 12);
    }
}
