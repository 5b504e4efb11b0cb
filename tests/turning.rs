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
/// Scenes, each with another texture of the target.
const SCENES: u64 = 12;
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
fn image(own: &Texture, ground: &Texture, k: usize) -> Vec<u8> {
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

/// In how many of the `SCENES` the target is followed to the end: the box has most of it in all but a few frames, and
/// is said to.
fn followed(turns: bool) -> usize {
    let (turns, off) = (Value::Bool(turns), Value::Bool(false));
    let changes = [("lcmht.turn.enabled", &turns), ("lcmht.cnn.enabled", &off)];
    let params = Params::default().with(changes, Phase::StartUp).unwrap();
    let ground = Texture::new(0);
    let held = |seed: u64| {
        let own = Texture::new(seed);
        let mut session = Session::new(params.clone()).unwrap();
        let mut held = 0;
        for k in 0..FRAMES {
            let data = image(&own, &ground, k);
            let frame = Frame::new(&data, WIDTH as u32, HEIGHT as u32, WIDTH, Encoding::Mono8, None).unwrap();
            if k == 0 {
                session.start(&frame, target(0), &mut ()).unwrap();
            } else {
                let found = &session.step(&frame, &mut ()).targets[0];
                held += usize::from(found.state == State::Tracking && found.rect.iou(&target(k)) > 0.5);
            }
        }
        held
    };
    (1..=SCENES).filter(|&seed| held(seed) > FRAMES - 10).count()
}

/// Chance has its share in each scene: the ground is of the same kind, and of the target the view knows each look for a
/// moment.
#[test]
fn most_targets_that_turn_are_followed() {
    let count = followed(true);
    assert!(count > 6, "{count}");
}

#[test]
fn they_would_be_lost_if_their_windows_did_not_turn() {
    let count = followed(false);
    assert!(count < 2, "{count}");
}
