//! Two that look alike cross: the box must stay with its own.

use long_term_tracker::params::{Params, Phase, Value};
use long_term_tracker::{Encoding, Frame, Rect, Session};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const WIDTH: usize = 240;
const HEIGHT: usize = 160;
/// A figure's size.
const FIGURE: [usize; 2] = [24, 48];
const FRAMES: usize = 60;

/// A texture of squares of 4 px, grey.
fn texture(seed: u64, width: usize, height: usize) -> Vec<u8> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let cells: Vec<u8> = (0..width * height / 16).map(|_| rng.random()).collect();
    (0..width * height).map(|i| cells[i / width / 4 * (width / 4) + i % width / 4]).collect()
}

/// Where the target is, which stands and then goes to the right.
fn target(k: usize) -> Rect {
    let x = 60.0 + 2.0 * k as f64;
    Rect::new(x, 50.0, FIGURE[0] as f64, FIGURE[1] as f64)
}

/// Its double, that comes from the right, a little lower and in front.
fn double(k: usize) -> Rect {
    let x = 180.0 - 2.0 * k as f64;
    Rect::new(x, 66.0, FIGURE[0] as f64, FIGURE[1] as f64)
}

/// The frames; the double hides what it passes.
fn video() -> Vec<Vec<u8>> {
    let ground: Vec<u8> = texture(1, WIDTH, HEIGHT).iter().map(|v| 100 + v / 8).collect();
    let own = texture(2, FIGURE[0], FIGURE[1]);
    // Alike but for a part.
    let mut other = own.clone();
    other[..FIGURE[0] * 16].copy_from_slice(&texture(3, FIGURE[0], 16));
    let paste = |data: &mut [u8], figure: &[u8], at: Rect| {
        for (row, line) in figure.chunks_exact(FIGURE[0]).enumerate() {
            let start = (at.y as usize + row) * WIDTH + at.x as usize;
            data[start..start + line.len()].copy_from_slice(line);
        }
    };
    (0..FRAMES)
        .map(|k| {
            let mut data = ground.clone();
            paste(&mut data, &own, target(k));
            paste(&mut data, &other, double(k));
            data
        })
        .collect()
}

/// The overlap with the target and with its double at the end.
fn follow(neighbours: bool) -> [f64; 2] {
    let (on, off) = (Value::Bool(neighbours), Value::Bool(false));
    let changes = [("lcmht.neighbours.enabled", &on), ("lcmht.cnn.enabled", &off)];
    let mut session = Session::new(Params::default().with(changes, Phase::StartUp).unwrap()).unwrap();
    let mut rect = Rect::default();
    for (k, data) in video().iter().enumerate() {
        let frame = Frame::new(data, WIDTH as u32, HEIGHT as u32, WIDTH, Encoding::Mono8, None).unwrap();
        if k == 0 {
            session.start(&frame, target(0), &mut ()).unwrap();
        } else {
            rect = session.step(&frame, &mut ()).targets[0].rect;
        }
    }
    [rect.iou(&target(FRAMES - 1)), rect.iou(&double(FRAMES - 1))]
}

#[test]
fn the_box_stays_with_the_target_when_its_double_passes() {
    let [own, double] = follow(true);
    assert!(own > 0.6 && double < 0.1, "{own} {double}");
}

#[test]
fn it_would_change_hands_if_doubles_were_not_followed() {
    let [own, double] = follow(false);
    assert!(own < 0.1 && double > 0.6, "{own} {double}");
}
