//! Pictures of the moments of a sequence that are worth looking at, as `data:` addresses that a page can hold.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use image::RgbImage;
use image::codecs::jpeg::JpegEncoder;
use serde::Serialize;

use crate::draw;
use crate::eval::answer::Answer;
use crate::eval::attributes::visit;
use crate::eval::dataset::Sequence;
use crate::frame::Frame;
use crate::geometry::Rect;
use crate::replay::ReplayError;

/// Pixels of a picture, width and height.
const SIZE: [u32; 2] = [320, 240];
const QUALITY: u8 = 78;
/// A picture shows so many target sizes, so that the target and its surroundings can be made out.
const EXTENT: f64 = 4.5;
/// Room around boxes that are further apart.
const MARGIN: f64 = 1.3;

/// A frame worth looking at.
#[derive(Clone, Debug, Serialize)]
pub struct Moment {
    /// Its number; the first frame is 1.
    pub frame: usize,
    /// Overlap with the true box; `None` where there is none.
    pub overlap: Option<f64>,
    /// What the tracker said.
    pub state: &'static str,
    /// How sure it was.
    pub confidence: Option<f64>,
    /// JPEG, as a `data:` address.
    pub picture: String,
}

/// The moments of a run on these frames, in rising order.
pub fn moments(sequence: &Sequence, answers: &[Answer], frames: &[usize]) -> Result<Vec<Moment>, ReplayError> {
    let mut found = Vec::with_capacity(frames.len());
    visit(sequence, frames, |i, frame| {
        let (answer, truth) = (&answers[i], sequence.truth[i]);
        // Where the target is not in view, what matters is where it was last.
        let about = truth.or_else(|| sequence.truth[..i].iter().rev().copied().flatten().next());
        let window = window(frame, &about.unwrap_or(answer.rect), &answer.rect);
        let picture = draw::moment(frame, &window, SIZE, truth, &answer.rect, answer.state);
        found.push(Moment {
            frame: i + 1,
            overlap: truth.map(|t| t.iou(&answer.rect)),
            state: answer.state.name(),
            confidence: answer.confidence,
            picture: address(&picture),
        });
    })?;
    Ok(found)
}

/// What to show: the target and, as far as it lies in the image, the tracker's box, in the shape of the picture and
/// inside the image where that is large enough.
fn window(frame: &Frame, target: &Rect, rect: &Rect) -> Rect {
    let bounds = frame.bounds();
    let inside = rect.intersection(&bounds);
    let both = if inside.area() > 0.0 { hull(target, &inside) } else { *target };
    let shape = f64::from(SIZE[0]) / f64::from(SIZE[1]);
    let wanted = (EXTENT * target.scale() * shape.sqrt()).max(MARGIN * both.w).max(MARGIN * both.h * shape);
    let width = wanted.min(bounds.w.max(bounds.h * shape));
    let height = width / shape;
    let [x, y] = both.centre();
    let place = |centre: f64, length: f64, limit: f64| {
        let start = centre - length / 2.0;
        if length < limit { start.clamp(0.0, limit - length) } else { (limit - length) / 2.0 }
    };
    Rect::new(place(x, width, bounds.w), place(y, height, bounds.h), width, height)
}

/// The smallest box around both.
fn hull(a: &Rect, b: &Rect) -> Rect {
    let (x, y) = (a.x.min(b.x), a.y.min(b.y));
    Rect::new(x, y, (a.x + a.w).max(b.x + b.w) - x, (a.y + a.h).max(b.y + b.h) - y)
}

/// The picture as JPEG in a `data:` address.
fn address(picture: &RgbImage) -> String {
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, QUALITY)
        .encode_image(picture)
        .expect("a picture of this size can be encoded into memory");
    format!("data:image/jpeg;base64,{}", STANDARD.encode(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Encoding;
    use crate::tracker::State;

    #[test]
    fn the_window_holds_both_boxes_and_stays_in_the_image() {
        let data = vec![0; 400 * 300];
        let frame = Frame::new(&data, 400, 300, 400, Encoding::Mono8, None).unwrap();
        let target = Rect::new(20.0, 30.0, 20.0, 40.0);
        let near = window(&frame, &target, &target);
        assert_eq!((near.x, near.y), (0.0, 0.0), "moved into the image: {near}");
        assert!((near.w / near.h - 4.0 / 3.0).abs() < 1e-9 && near.w > 100.0 && near.w < 200.0, "{near}");
        let far = window(&frame, &target, &Rect::new(300.0, 200.0, 20.0, 40.0));
        assert_eq!(hull(&far, &Rect::new(20.0, 30.0, 300.0, 210.0)), far, "{far}");
        let outside = window(&frame, &target, &Rect::new(900.0, 200.0, 20.0, 40.0));
        assert_eq!(outside, near);
    }

    #[test]
    fn moments_tell_what_happened_and_show_it() {
        let dir = tempfile::tempdir().unwrap();
        for i in 0..4 {
            RgbImage::from_pixel(64, 48, image::Rgb([90; 3])).save(dir.path().join(format!("{i}.png"))).unwrap();
        }
        let target = Rect::new(10.0, 10.0, 10.0, 10.0);
        let truth = vec![Some(target), None, Some(target), Some(target)];
        let sequence = Sequence { name: "a".to_owned(), path: dir.path().to_owned(), truth, hidden: None };
        let answer =
            Answer { rect: target.shifted(5.0, 0.0), confidence: Some(0.5), state: State::Lost, reacquired: false };
        let found = moments(&sequence, &[answer; 4], &[1, 3]).unwrap();
        let told: Vec<_> = found.iter().map(|m| (m.frame, m.overlap, m.state, m.confidence)).collect();
        assert_eq!(told, [(2, None, "lost", Some(0.5)), (4, Some(1.0 / 3.0), "lost", Some(0.5))]);
        let bytes = STANDARD.decode(found[1].picture.strip_prefix("data:image/jpeg;base64,").unwrap()).unwrap();
        let picture = image::load_from_memory(&bytes).unwrap();
        assert_eq!((picture.width(), picture.height()), (SIZE[0], SIZE[1]));
    }
}
