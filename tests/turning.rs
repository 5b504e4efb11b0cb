//! A target turns in the image plane: its search window turns with it.

use long_term_tracker::params::{Params, Phase, Value};
use long_term_tracker::{Encoding, Frame, Rect, Session, State};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const WIDTH: usize = 240;
const HEIGHT: usize = 160;
/// The target's side: a disc, so that its box is the same however it is turned.
const SIDE: f64 = 40.0;
const FRAMES: usize = 60;
/// Degrees a frame.
const TURN: f64 = 12.0;
/// Pixels along a square of the textures.
const SQUARE: f64 = 5.0;

/// A texture of squares, grey, seen at a place in squares.
struct Texture(Vec<u8>);

impl Texture {
    const SQUARES: usize = 64;

    fn new(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        Self((0..Self::SQUARES * Self::SQUARES).map(|_| rng.random()).collect())
    }

    fn at(&self, x: f64, y: f64) -> u8 {
        let [column, row] = [x, y].map(|v| v.floor().rem_euclid(Self::SQUARES as f64) as usize);
        self.0[row * Self::SQUARES + column]
    }
}

/// Where the target is: it goes to and fro.
fn target(k: usize) -> Rect {
    Rect::around([120.5 + 40.0 * (0.3 * k as f64).sin(), 80.5], [SIDE; 2])
}

/// The target turned by `TURN` a frame, in front of a ground of the same kind.
fn image(k: usize) -> Vec<u8> {
    let (own, ground) = (Texture::new(2), Texture::new(1));
    let (sin, cos) = (TURN * k as f64).to_radians().sin_cos();
    let [x, y] = target(k).centre();
    let pixel = |i: usize| {
        let (column, row) = ((i % WIDTH) as f64 + 0.5, (i / WIDTH) as f64 + 0.5);
        let (dx, dy) = (column - x, row - y);
        if dx.hypot(dy) < SIDE / 2.0 {
            own.at((cos * dx + sin * dy) / SQUARE, (cos * dy - sin * dx) / SQUARE)
        } else {
            ground.at(column / SQUARE, row / SQUARE)
        }
    };
    (0..WIDTH * HEIGHT).map(pixel).collect()
}

/// The frames in which the box has most of the target and is said to, after the first.
fn followed(turns: bool) -> usize {
    let (turns, off) = (Value::Bool(turns), Value::Bool(false));
    let changes = [("lcmht.turn.enabled", &turns), ("lcmht.cnn.enabled", &off)];
    let mut session = Session::new(Params::default().with(changes, Phase::StartUp).unwrap()).unwrap();
    let mut count = 0;
    for k in 0..FRAMES {
        let data = image(k);
        let frame = Frame::new(&data, WIDTH as u32, HEIGHT as u32, WIDTH, Encoding::Mono8, None).unwrap();
        if k == 0 {
            session.start(&frame, target(0), &mut ()).unwrap();
        } else {
            let found = &session.step(&frame, &mut ()).targets[0];
            count += usize::from(found.state == State::Tracking && found.rect.iou(&target(k)) > 0.5);
        }
    }
    count
}

#[test]
fn a_target_that_turns_is_followed() {
    let frames = followed(true);
    assert!(frames > 50, "{frames}");
}

#[test]
fn it_would_be_lost_if_its_window_did_not_turn() {
    let frames = followed(false);
    assert!(frames < 30, "{frames}");
}
