//! The debug thread: draws what the tracker saw and did, and publishes it, raw and as JPEG, while somebody looks.

use std::io::Cursor;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

use image::codecs::jpeg::JpegEncoder;
use image::imageops::thumbnail;
use image::{ImageError, RgbImage};
use log::warn;
use ros2_client::{Node, Publisher};

use super::convert::Received;

use super::endpoints::Endpoints;
use super::fault::Fault;
use super::messages::{CompressedImage, Header, Image};
use crate::draw::{self, Scene};
use crate::params::Debug;
use crate::tracker::Output;

/// A frame to draw, with all that is known of it.
pub struct Job {
    /// The image.
    pub frame: Arc<Received>,
    /// What was said of it.
    pub output: Output,
    /// What happened inside the tracker.
    pub scene: Scene,
    /// How to publish it.
    pub debug: Debug,
}

struct Slot {
    /// Waits to be drawn.
    job: Option<Job>,
    /// The one scene there is, while no frame is recorded or drawn in it.
    scene: Option<Scene>,
    closed: bool,
}

struct Shared {
    slot: Mutex<Slot>,
    changed: Condvar,
    image: View,
    response: View,
    node: Arc<Node>,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Slot> {
        self.slot.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A picture and its two topics.
pub struct View {
    raw: Publisher<Image>,
    compressed: Publisher<CompressedImage>,
}

impl View {
    /// Makes the topics `name` and `name/compressed`.
    pub fn new(endpoints: &mut Endpoints, name: &str) -> Result<Self, Fault> {
        Ok(Self {
            raw: endpoints.image_publisher(name)?,
            compressed: endpoints.image_publisher(&format!("{name}/compressed"))?,
        })
    }

    /// Whether somebody subscribes to the raw and to the compressed topic.
    fn wanted(&self, node: &Node) -> [bool; 2] {
        [self.raw.get_subscription_count(node) > 0, self.compressed.get_subscription_count(node) > 0]
    }

    fn publish(&self, picture: &RgbImage, wanted: [bool; 2], header: &Header, debug: &Debug) -> Result<(), String> {
        let [raw, compressed] = wanted;
        if raw {
            let message = raw_image(picture, header, debug.max_side as u32);
            self.raw.publish(message).map_err(|e| e.to_string())?;
        }
        if compressed {
            let message = jpeg(picture, header, debug.jpeg_quality as u8).map_err(|e| e.to_string())?;
            self.compressed.publish(message).map_err(|e| e.to_string())?;
        }
        Ok(())
    }
}

/// The way to the debug thread.
#[derive(Clone)]
pub struct Feed(Arc<Shared>);

impl Feed {
    /// A feed for the two pictures.
    pub fn new(node: Arc<Node>, image: View, response: View) -> Self {
        let slot = Slot { job: None, scene: Some(Scene::default()), closed: false };
        Self(Arc::new(Shared { slot: Mutex::new(slot), changed: Condvar::new(), image, response, node }))
    }

    /// A scene to record the next frame in, if somebody looks and the thread has drawn the last one.
    pub fn scene(&self) -> Option<Scene> {
        let Shared { image, response, node, .. } = &*self.0;
        let looked_at = [image, response].into_iter().any(|view| view.wanted(node) != [false; 2]);
        looked_at.then(|| self.0.lock().scene.take()).flatten().map(|mut scene| {
            scene.clear();
            scene
        })
    }

    /// Gives back a scene in which nothing was recorded.
    pub fn keep(&self, scene: Scene) {
        self.0.lock().scene = Some(scene);
    }

    /// Hands over a recorded frame.
    pub fn submit(&self, job: Job) {
        self.0.lock().job = Some(job);
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
            if let Err(why) = self.draw(&job) {
                warn!("debug image not published: {why}");
            }
            self.keep(job.scene);
        }
    }

    fn wait(&self) -> Option<Job> {
        let idle = |slot: &mut Slot| !slot.closed && slot.job.is_none();
        let mut slot = self.0.changed.wait_while(self.0.lock(), idle).unwrap_or_else(PoisonError::into_inner);
        if slot.closed { None } else { slot.job.take() }
    }

    fn draw(&self, job: &Job) -> Result<(), String> {
        let Shared { image, response, node, .. } = &*self.0;
        let (frame, header) = (job.frame.frame(), job.frame.header());
        let wanted = image.wanted(node);
        if wanted != [false; 2] {
            image.publish(&draw::annotated(&frame, &job.output, &job.scene), wanted, header, &job.debug)?;
        }
        let wanted = response.wanted(node);
        if wanted != [false; 2] {
            response.publish(&draw::response(&frame, &job.scene), wanted, header, &job.debug)?;
        }
        Ok(())
    }
}

/// The picture as bgr8, scaled down where a side is longer than `max_side`.
fn raw_image(picture: &RgbImage, header: &Header, max_side: u32) -> Image {
    let longest = picture.width().max(picture.height());
    let scaled = (longest > max_side).then(|| {
        let side = |s: u32| (u64::from(s) * u64::from(max_side) / u64::from(longest)).max(1) as u32;
        thumbnail(picture, side(picture.width()), side(picture.height()))
    });
    let picture = scaled.as_ref().unwrap_or(picture);
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

fn jpeg(picture: &RgbImage, header: &Header, quality: u8) -> Result<CompressedImage, ImageError> {
    let mut data = Cursor::new(Vec::new());
    picture.write_with_encoder(JpegEncoder::new_with_quality(&mut data, quality))?;
    Ok(CompressedImage { header: header.clone(), format: "jpeg".to_owned(), data: data.into_inner() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture() -> RgbImage {
        RgbImage::from_fn(64, 16, |x, _| image::Rgb([10, 20, if x < 32 { 30 } else { 200 }]))
    }

    #[test]
    fn raw_images_fit_the_largest_side_and_are_bgr() {
        let message = raw_image(&picture(), &Header::default(), 32);
        assert_eq!((message.width, message.height, message.step), (32, 8, 96));
        assert_eq!(&message.data[..3], [30, 20, 10]);
        assert_eq!(message.data.len(), 32 * 8 * 3);
        assert_eq!(raw_image(&picture(), &Header::default(), 64).width, 64, "no larger than it is");
        assert_eq!(raw_image(&picture(), &Header::default(), 2).height, 1, "no side vanishes");
    }

    #[test]
    fn jpegs_read_back_at_full_size() {
        let message = jpeg(&picture(), &Header::default(), 90).unwrap();
        let back = image::load_from_memory(&message.data).unwrap().to_rgb8();
        assert_eq!(back.dimensions(), (64, 16));
        assert!(back.get_pixel(60, 8)[2].abs_diff(200) < 12);
    }
}
