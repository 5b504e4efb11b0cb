//! Boxes for image viewers: Foxglove and its kin draw `foxglove_msgs/msg/ImageAnnotations` over the image of the same
//! stamp.

use crate::draw::{caption, colour};
use crate::messages::{Color, ImageAnnotations, Point2, PointsAnnotation, TextAnnotation, Time};
use crate::tracker::{Output, Target};

/// Line width, px.
const THICKNESS: f64 = 2.0;
/// Height of letters, px.
const FONT_SIZE: f64 = 13.0;
/// Behind letters.
const BACKGROUND: Color = Color { r: 0.0, g: 0.0, b: 0.0, a: 0.6 };

/// A box and a line of text for each target, coloured by its state.
pub fn annotations(stamp: &Time, output: &Output) -> ImageAnnotations {
    ImageAnnotations {
        circles: Vec::new(),
        points: output.targets.iter().map(|t| outline(stamp, t)).collect(),
        texts: output.targets.iter().map(|t| label(stamp, t)).collect(),
    }
}

fn outline(stamp: &Time, target: &Target) -> PointsAnnotation {
    let r = target.rect;
    let (right, bottom) = (r.x + r.w, r.y + r.h);
    let corners = [(r.x, r.y), (right, r.y), (right, bottom), (r.x, bottom)];
    PointsAnnotation {
        timestamp: stamp.clone(),
        r#type: PointsAnnotation::LINE_LOOP,
        points: corners.map(|(x, y)| Point2 { x, y }).to_vec(),
        outline_color: ink(target),
        outline_colors: Vec::new(),
        fill_color: Color::default(),
        thickness: THICKNESS,
    }
}

fn label(stamp: &Time, target: &Target) -> TextAnnotation {
    TextAnnotation {
        timestamp: stamp.clone(),
        position: Point2 { x: target.rect.x, y: target.rect.y },
        text: caption(target),
        font_size: FONT_SIZE,
        text_color: ink(target),
        background_color: BACKGROUND,
    }
}

fn ink(target: &Target) -> Color {
    let [r, g, b] = colour(target.state).0.map(|channel| f64::from(channel) / 255.0);
    Color { r, g, b, a: 1.0 }
}
