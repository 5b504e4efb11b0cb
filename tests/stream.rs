//! What changes in mid-stream, and marks on frames that have passed.

use long_term_tracker::params::{Phase, Value};
use long_term_tracker::trace::{Event, Trace};
use long_term_tracker::{Encoding, Frame, Params, Rect, Session, StartError, State, Target};

const WIDTH: usize = 240;
const HEIGHT: usize = 160;
/// A frame period in nanoseconds.
const PERIOD: i64 = 33_000_000;

fn target(frame: usize) -> Rect {
    Rect::new(40.0 + 2.0 * frame as f64, 44.0 + frame as f64, 40.0, 32.0)
}

/// A patterned box on its way over noise, RGB.
fn scene(frame: usize) -> Vec<u8> {
    drawn(target(frame))
}

/// The pattern in a box of any size over the noise, RGB.
fn drawn(at: Rect) -> Vec<u8> {
    let noise = |x: usize, y: usize| ((x * 7919 + y * 104_729 + (x * y) % 97 * 31) % 61) as u8;
    // Where in the pattern a pixel lies, if it does.
    let within = |pixel: usize, from: f64, side: f64, whole: f64| {
        let share = (pixel as f64 - from.floor()) / side;
        (0.0..1.0).contains(&share).then_some((share * whole) as usize)
    };
    let mut data = Vec::with_capacity(WIDTH * HEIGHT * 3);
    for (y, x) in (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (y, x))) {
        let value = match (within(x, at.x, at.w, 40.0), within(y, at.y, at.h, 32.0)) {
            (Some(u), Some(v)) => 40 + ((u / 4 * 53 + v / 5 * 91) % 200) as u8,
            _ => 80 + noise(x, y),
        };
        data.extend([value, value / 2, 255 - value]);
    }
    data
}

/// Each pixel becomes a block of `across` x `down`.
fn enlarged(data: &[u8], across: usize, down: usize) -> Vec<u8> {
    let row = |y: usize| (0..WIDTH * across).flat_map(move |x| &data[3 * (y / down * WIDTH + x / across)..][..3]);
    (0..HEIGHT * down).flat_map(row).copied().collect()
}

fn frame(data: &[u8], stamp: Option<i64>) -> Frame<'_> {
    Frame::new(data, WIDTH as u32, HEIGHT as u32, 3 * WIDTH, Encoding::Rgb8, stamp).unwrap()
}

fn stretched(rect: Rect, x: f64, y: f64) -> Rect {
    Rect::new(x * rect.x, y * rect.y, x * rect.w, y * rect.h)
}

fn session(most: i64) -> Session {
    let (most, network) = (Value::Integer(most), Value::Bool(false));
    let changes = [("max_targets", &most), ("lcmht.cnn.enabled", &network)];
    Session::new(Params::default().with(changes, Phase::StartUp).unwrap()).unwrap()
}

fn scenes(count: usize) -> Vec<Vec<u8>> {
    (0..count).map(scene).collect()
}

/// The search window, and the columns of its response map.
#[derive(Default)]
struct Window(Rect, usize);

impl Trace for Window {
    fn event(&mut self, event: Event) {
        if let Event::Response(map) = event {
            (self.0, self.1) = (map.window, map.cols);
        }
    }
}

fn set(session: &mut Session, name: &str, value: Value) {
    let changed = session.params().with([(name, &value)], Phase::Running).unwrap();
    session.retune(changed, session.networks());
}

#[test]
fn a_target_is_held_while_parameters_change() {
    let mut session = session(1);
    session.start(&frame(&scene(0), Some(0)), target(0), &mut ()).unwrap();
    let changes = [
        ("lcmht.filter.learning_rate", Value::Double(0.05)),
        ("lcmht.filter.cells", Value::Integer(40)),
        ("lcmht.filter.window", Value::Double(3.0)),
        ("lcmht.layers.hog_weight", Value::Double(0.7)),
        ("lcmht.scale.area", Value::Double(1024.0)),
        ("lcmht.scale.enabled", Value::Bool(false)),
        ("lcmht.scale.enabled", Value::Bool(true)),
        ("lcmht.svm.scan_extent", Value::Double(5.0)),
        ("lcmht.svm.opinion", Value::Double(0.2)),
        ("lcmht.augment.enabled", Value::Bool(false)),
        ("lcmht.filter.kind", Value::String("kernelised".into())),
        ("lcmht.filter.kind", Value::String("masked".into())),
        ("lcmht.motion.form", Value::String("aspect_height".into())),
    ];
    for n in 1..56 {
        if let Some((name, value)) = (n % 4 == 0).then(|| &changes[n / 4 - 1]) {
            set(&mut session, name, value.clone());
        }
        let said = session.step(&frame(&scene(n), Some(n as i64 * PERIOD)), &mut ()).targets[0].clone();
        assert!(said.state == State::Tracking && said.rect.iou(&target(n)) > 0.6, "{n}: {said:?}");
        assert_eq!(said.age, n as u32);
        // What is known of its motion stays, but where the model of motion itself is another.
        let ratio = said.velocity[0] / (2.0 * 1e9 / PERIOD as f64);
        assert!(!(6..52).contains(&n) || (0.5..1.5).contains(&ratio), "{n}: {ratio}");
    }
}

#[test]
fn the_size_is_told_while_the_target_moves_little() {
    // It grows by a hundredth and moves by a twentieth of itself a frame.
    let grown = |n: usize| {
        let side = 1.01f64.powi(n as i32);
        Rect::around([50.0 + 2.0 * n as f64, 60.0 + n as f64], [40.0 * side, 32.0 * side])
    };
    let mut session = session(1);
    session.start(&frame(&drawn(grown(0)), None), grown(0), &mut ()).unwrap();
    let mut width = |n: usize, max_step: f64| {
        set(&mut session, "lcmht.scale.max_step", Value::Double(max_step));
        let said = session.step(&frame(&drawn(grown(n)), None), &mut ()).targets[0].clone();
        assert!(said.state == State::Tracking && said.rect.iou(&grown(n)) > 0.6, "{n}: {said:?}");
        said.rect.w
    };
    let before = (1..=15).map(|n| width(n, 0.1)).last().unwrap();
    assert!((before / grown(15).w - 1.0).abs() < 0.04, "{before} for {}", grown(15).w);
    for n in 16..=24 {
        assert_eq!(width(n, 0.03), before, "{n}");
    }
    let after = (25..=34).map(|n| width(n, 0.1)).last().unwrap();
    assert!((after / grown(34).w - 1.0).abs() < 0.04, "{after} for {}", grown(34).w);
}

/// The target goes behind the noise in the very frame of a change that needs another filter, and stays there.
#[test]
fn parameters_that_need_another_filter_wait_for_the_target_and_others_do_not() {
    let mut session = session(1);
    session.start(&frame(&scene(0), None), target(0), &mut ()).unwrap();
    let mut seen = Window::default();
    let mut look = |session: &mut Session, n: usize| {
        let said = session.step(&frame(&scene(n), None), &mut seen).targets[0].clone();
        (said, seen.1)
    };
    (1..20).for_each(|n| _ = look(&mut session, n));
    // Far beyond the image, so that the noise alone is left.
    const HIDDEN: usize = 1000;
    set(&mut session, "lcmht.filter.cells", Value::Integer(32));
    let states: Vec<State> = (0..20).map(|_| look(&mut session, HIDDEN).0.state).collect();
    assert!(states[0] == State::Uncertain && states[19] == State::Lost, "{states:?}");
    // It is back, but no margin is enough to take it up.
    set(&mut session, "lcmht.svm.least_margin", Value::Double(100.0));
    for _ in 0..10 {
        let (said, cols) = look(&mut session, 20);
        assert_eq!((said.state, cols), (State::Lost, 48));
    }
    set(&mut session, "lcmht.svm.least_margin", Value::Double(0.0));
    let said = (0..10).map(|_| look(&mut session, 20).0).find(|said| said.reacquired).expect("it is found again");
    assert!(said.rect.iou(&target(20)) > 0.6, "{said:?}");
    for n in 21..30 {
        let (said, cols) = look(&mut session, n);
        assert!(said.state == State::Tracking && said.rect.iou(&target(n)) > 0.6, "{n}: {said:?}");
        assert_eq!(cols, 32);
    }
}

#[test]
fn a_mark_on_a_frame_that_has_passed_gives_the_track_as_if_it_had_come_in_time() {
    let scenes = scenes(20);
    let frames: Vec<Frame> = scenes.iter().zip(0..).map(|(data, n)| frame(data, Some(n * PERIOD))).collect();
    let mut in_time = session(1);
    in_time.start_as(Some("a"), &frames[2], target(2), &mut ()).unwrap();
    frames[3..].iter().for_each(|frame| _ = in_time.step(frame, &mut ()));

    let mut late = session(1);
    frames[..=12].iter().for_each(|frame| _ = late.step(frame, &mut ()));
    let caught_up = late.start_from(Some("a"), &frames[2], &frames[3..=12], target(2), &mut ()).unwrap();
    assert_eq!(caught_up.targets[0].age, 10);
    frames[13..].iter().for_each(|frame| _ = late.step(frame, &mut ()));
    assert_eq!(late.output(), in_time.output());
    assert!(late.output().targets[0].rect.iou(&target(19)) > 0.7);

    // The other targets are not touched by it.
    let mut two = session(2);
    two.start_as(Some("first"), &frames[0], target(0), &mut ()).unwrap();
    frames[1..=12].iter().for_each(|frame| _ = two.step(frame, &mut ()));
    let before = two.output().targets[0].clone();
    let both = two.start_from(Some("a"), &frames[2], &frames[3..=12], target(2), &mut ()).unwrap();
    assert_eq!((&both.targets[0], both.targets[1].rect), (&before, caught_up_rect(&frames)));
    let nowhere = Rect::new(-99.0, 0.0, 40.0, 40.0);
    assert!(two.start_from(None, &frames[2], &frames[3..=12], nowhere, &mut ()).is_err());
    assert_eq!(two.output().targets.len(), 2, "a refused mark changes nothing");
}

fn caught_up_rect(frames: &[Frame]) -> Rect {
    let mut session = session(1);
    session.start_from(Some("a"), &frames[2], &frames[3..=12], target(2), &mut ()).unwrap().targets[0].rect
}

#[test]
fn a_target_is_followed_through_a_change_of_size_in_proportion() {
    let scenes = scenes(24);
    let mut session = session(1);
    session.start(&frame(&scenes[0], Some(0)), target(0), &mut ()).unwrap();
    let mut window = Window::default();
    for (n, data) in scenes.iter().enumerate().skip(1) {
        // Twice as wide and thrice as high, and back again.
        let (x, y) = if (8..16).contains(&n) { (2, 3) } else { (1, 1) };
        let data = enlarged(data, x, y);
        let [w, h] = [WIDTH * x, HEIGHT * y];
        let stamp = Some(n as i64 * PERIOD);
        let frame = Frame::new(&data, w as u32, h as u32, 3 * w, Encoding::Rgb8, stamp).unwrap();
        let said = session.step(&frame, &mut window).targets[0].clone();
        let truth = stretched(target(n), x as f64, y as f64);
        assert!(said.state == State::Tracking && said.rect.iou(&truth) > 0.6, "{n}: {said:?}, not {truth}");
        // The velocity and what is drawn are in the pixels of this frame too.
        assert!(window.0.intersection(&said.rect).area() > 0.99 * said.rect.area(), "{n}: {}", window.0);
        if n > 4 {
            let ratio = said.velocity[0] / (2.0 * x as f64 * 1e9 / PERIOD as f64);
            assert!((0.5..1.5).contains(&ratio), "{n}: {ratio}");
        }
    }
    // A restart takes the mark along as well.
    let large = enlarged(&scenes[0], 2, 2);
    let large = Frame::new(&large, 2 * WIDTH as u32, 2 * HEIGHT as u32, 6 * WIDTH, Encoding::Rgb8, None).unwrap();
    assert_eq!(session.restart(&large, &mut ()).unwrap().targets[0].rect, stretched(target(0), 2.0, 2.0));
}

#[test]
fn a_target_is_followed_through_a_change_of_encoding() {
    let scenes = scenes(30);
    let mut session = session(1);
    session.start(&frame(&scenes[0], None), target(0), &mut ()).unwrap();
    for (n, data) in scenes.iter().enumerate().skip(1) {
        let luma = |p: &[u8]| (0.299 * f32::from(p[0]) + 0.587 * f32::from(p[1]) + 0.114 * f32::from(p[2])) as u8;
        let grey: Vec<u8> = data.chunks_exact(3).map(luma).collect();
        let swapped: Vec<u8> = data.chunks_exact(3).flat_map(|p| [p[2], p[1], p[0], 0]).collect();
        let (bytes, step, encoding) = match n / 10 {
            0 => (data, 3, Encoding::Rgb8),
            1 => (&swapped, 4, Encoding::Bgra8),
            _ => (&grey, 1, Encoding::Mono8),
        };
        let frame = Frame::new(bytes, WIDTH as u32, HEIGHT as u32, step * WIDTH, encoding, None).unwrap();
        let said = &session.step(&frame, &mut ()).targets[0];
        assert!(said.state != State::Lost && said.rect.iou(&target(n)) > 0.5, "{n} {encoding:?}: {said:?}");
    }
}

/// A depth camera or a thermal one uses a small part of 16 bits.
#[test]
fn a_target_is_followed_in_a_small_range_of_16_bits_where_the_levels_say_which() {
    let grey = |data: &[u8]| data.chunks_exact(3).map(|p| p[0]).collect::<Vec<u8>>();
    let deep = |data: &[u8]| data.iter().flat_map(|&v| (3000 + u16::from(v)).to_be_bytes()).collect::<Vec<u8>>();
    let scenes = scenes(15);
    let follow = |black: i64, white: i64, is_deep: bool| -> Result<Vec<Target>, StartError> {
        let (black, white, network) = (Value::Integer(black), Value::Integer(white), Value::Bool(false));
        let changes = [("levels.black", &black), ("levels.white", &white), ("lcmht.cnn.enabled", &network)];
        let mut session = Session::new(Params::default().with(changes, Phase::StartUp).unwrap()).unwrap();
        let mut said = Vec::new();
        for (n, data) in scenes.iter().enumerate() {
            let grey = grey(data);
            let bytes = if is_deep { deep(&grey) } else { grey };
            let (step, encoding) = if is_deep { (2, Encoding::Mono16Be) } else { (1, Encoding::Mono8) };
            let frame = Frame::new(&bytes, WIDTH as u32, HEIGHT as u32, step * WIDTH, encoding, None).unwrap();
            let output = match n {
                0 => session.start(&frame, target(0), &mut ())?,
                _ => session.step(&frame, &mut ()),
            };
            said.push(output.targets[0].clone());
        }
        Ok(said)
    };
    let eight_bits = follow(0, 65535, false).unwrap();
    assert!(eight_bits[14].rect.iou(&target(14)) > 0.6);
    assert_eq!(follow(3000, 3255, true).unwrap(), eight_bits);
    // In the whole range it is less than a level of eight bits.
    assert!(matches!(follow(0, 65535, true), Err(StartError::Blank { .. })));
    let same = Value::Integer(7);
    let refused = Params::default().with([("levels.black", &same), ("levels.white", &same)], Phase::Running);
    assert!(refused.unwrap_err().to_string().contains("levels.black and levels.white are both 7"));
}

#[test]
fn stamps_that_jump_back_or_are_missing_do_not_disturb_the_track() {
    let scenes = scenes(24);
    let follow = |stamp: &dyn Fn(i64) -> Option<i64>| {
        let mut session = session(1);
        session.start(&frame(&scenes[0], stamp(0)), target(0), &mut ()).unwrap();
        let step = |(data, n): (&Vec<u8>, i64)| session.step(&frame(data, stamp(n)), &mut ()).targets[0].clone();
        scenes.iter().zip(0..).skip(1).map(step).collect::<Vec<_>>()
    };
    let steady = follow(&|n| Some(1_000_000_000 + n * PERIOD));
    assert!(steady.last().unwrap().rect.iou(&target(23)) > 0.7);
    // A recording that begins again, a clock that is set back by an hour, and one that stands still for a while.
    let looped = follow(&|n| Some(1_000_000_000 + (n % 10) * PERIOD));
    let set_back = follow(&|n| Some(7_200_000_000_000 + n * PERIOD - if n > 9 { 3_600_000_000_000 } else { 0 }));
    let frozen = follow(&|n| Some(1_000_000_000 + if (9..15).contains(&n) { 9 } else { n } * PERIOD));
    for (other, steady) in [&looped, &set_back].into_iter().flat_map(|others| others.iter().zip(&steady)) {
        assert_eq!((other.rect, other.state), (steady.rect, steady.state));
        // The frame rate is the mean over what is remembered, of which a step of the clock is no part.
        let differs = |i: usize| (other.velocity[i] - steady.velocity[i]).abs() > 0.25 * steady.velocity[i].abs() + 1.0;
        assert!(!differs(0) && !differs(1), "{:?} {:?}", other.velocity, steady.velocity);
    }
    assert!(frozen.last().unwrap().rect.iou(&target(23)) > 0.7, "{:?}", frozen.last());

    // Without stamps boxes are the same, and velocities are in pixels a frame.
    let unstamped = follow(&|_| None);
    for (without, with) in unstamped.iter().zip(&steady) {
        assert_eq!((without.rect, without.state), (with.rect, with.state));
    }
    let [vx, vy] = unstamped.last().unwrap().velocity;
    assert!((vx - 2.0).abs() < 0.7 && (vy - 1.0).abs() < 0.7, "{vx} {vy}");
}
