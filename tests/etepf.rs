//! ETEPF in a session, on scenes made here: what a user of the node meets.

use long_term_tracker::network::Networks;
use long_term_tracker::params::{Phase, Range, Value, descriptors};
use long_term_tracker::trace::{Event, Trace};
use long_term_tracker::{Encoding, Frame, Output, Params, ParamsError, Rect, Session, State, Target};

const WIDTH: usize = 240;
const HEIGHT: usize = 160;
const SIDE: f64 = 32.0;

/// A scene of boxes with patterns of their own over noise.
struct Scene {
    /// Each with the number of its pattern; later ones hide earlier ones.
    boxes: Vec<(Rect, usize)>,
    colour: bool,
}

impl Scene {
    fn paint(&self) -> Vec<u8> {
        let noise = |x: usize, y: usize| ((x * 7919 + y * 104_729 + (x * y) % 97 * 31) % 61) as u8;
        let mut data = Vec::with_capacity(WIDTH * HEIGHT * 3);
        for (y, x) in (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (y, x))) {
            let (u, v) = (x as f64 + 0.5, y as f64 + 0.5);
            let within = |r: &Rect| u >= r.x && u < r.x + r.w && v >= r.y && v < r.y + r.h;
            let pixel = match self.boxes.iter().rev().find(|(rect, _)| within(rect)) {
                Some((rect, pattern)) => {
                    let (i, j) = ((u - rect.x) as usize, (v - rect.y) as usize);
                    let value = 40 + ((i / 4 * 53 + j / 5 * 91) % 200) as u8;
                    [[value, value / 2, 30], [30, value / 2, value], [90, 90, 90]][*pattern]
                }
                None => [60 + noise(x, y), 120 + noise(x, y), 60 + noise(x, y)],
            };
            if self.colour {
                data.extend(pixel);
            } else {
                data.push((pixel.iter().map(|&p| u32::from(p)).sum::<u32>() / 3) as u8);
            }
        }
        data
    }
}

/// The target moves to the right by 2 px a frame.
fn target(frame: usize) -> Rect {
    Rect::new(30.0 + 2.0 * frame as f64, 60.0, SIDE, SIDE)
}

fn scene(frame: usize) -> Vec<u8> {
    Scene { boxes: vec![(target(frame), 0)], colour: true }.paint()
}

fn rgb(data: &[u8]) -> Frame<'_> {
    Frame::new(data, WIDTH as u32, HEIGHT as u32, 3 * WIDTH, Encoding::Rgb8, None).unwrap()
}

fn params(changes: &[(&str, Value)]) -> Params {
    let algorithm = Value::String("etepf".into());
    let changes = changes.iter().map(|(name, value)| (*name, value));
    Params::default().with([("algorithm", &algorithm)].into_iter().chain(changes), Phase::StartUp).unwrap()
}

fn session(changes: &[(&str, Value)]) -> Session {
    Session::new(params(changes)).unwrap()
}

fn step(session: &mut Session, frame: &Frame) -> Target {
    session.step(frame, &mut ()).targets[0].clone()
}

#[test]
fn a_target_is_followed_in_colour_and_in_grey() {
    for colour in [true, false] {
        let mut session = session(&[]);
        for n in 0..60 {
            let data = Scene { boxes: vec![(target(n), 0)], colour }.paint();
            let (encoding, step) = if colour { (Encoding::Rgb8, 3) } else { (Encoding::Mono8, 1) };
            let frame = Frame::new(&data, WIDTH as u32, HEIGHT as u32, step * WIDTH, encoding, None).unwrap();
            if n == 0 {
                session.start(&frame, target(0), &mut ()).unwrap();
                continue;
            }
            let said = session.step(&frame, &mut ()).targets[0].clone();
            assert!(said.rect.iou(&target(n)) > 0.5, "colour {colour}, frame {n}: {}", said.rect);
            assert_ne!(said.state, State::Lost, "colour {colour}, frame {n}");
        }
        let [x, y] = session.output().targets[0].velocity;
        assert!((x - 2.0).abs() < 1.5 && y.abs() < 1.5, "{x} {y}");
    }
}

/// A grey box lies in the way for some frames.
#[test]
fn a_hidden_target_is_lost_and_found_again_where_it_comes_out() {
    let hidden = 20..45;
    let picture = |n: usize| {
        let mut boxes = vec![(target(n), 0)];
        if hidden.contains(&n) {
            boxes.push((target(n).scaled(1.8), 2));
        }
        Scene { boxes, colour: true }.paint()
    };
    for seed in 0..5 {
        let mut session = session(&[("seed", Value::Integer(seed))]);
        session.start(&rgb(&picture(0)), target(0), &mut ()).unwrap();
        let said: Vec<Target> = (1..80).map(|n| step(&mut session, &rgb(&picture(n)))).collect();
        let lost: Vec<usize> = (1..80).filter(|n| said[n - 1].state == State::Lost).collect();
        assert!(lost.iter().filter(|n| hidden.contains(n)).count() > 15, "seed {seed}: {lost:?}");
        assert!(lost.iter().all(|n| (hidden.start..hidden.end + 10).contains(n)), "seed {seed}: {lost:?}");
        let found = said.iter().position(|t| t.reacquired).expect("found again");
        assert_eq!((said[found].lost_for, said[found - 1].lost_for > 0), (0, true));
        assert!(said[60..].iter().zip(61..).all(|(t, n)| t.rect.iou(&target(n)) > 0.5), "seed {seed}");
    }
}

#[test]
fn a_target_that_leaves_the_image_is_lost_and_found_when_it_returns() {
    // Out on the right and back again.
    let place = |n: usize| Rect::new(WIDTH as f64 - 60.0 + 3.0 * (40.0 - (n as f64 - 40.0).abs()), 60.0, SIDE, SIDE);
    let picture = |n: usize| Scene { boxes: vec![(place(n), 0)], colour: true }.paint();
    let mut session = session(&[]);
    session.start(&rgb(&picture(0)), place(0), &mut ()).unwrap();
    let said: Vec<Target> = (1..=80).map(|n| step(&mut session, &rgb(&picture(n)))).collect();
    assert!((30..50).all(|n| said[n - 1].state == State::Lost), "it is out of sight from frame 20 to 60");
    assert!(said[79].rect.iou(&place(80)) > 0.5 && said[79].state != State::Lost, "{:?}", said[79]);
    assert!(said.iter().all(|t| t.rect.is_finite()));
}

#[test]
fn the_same_seed_gives_the_same_boxes_and_another_one_others() {
    let run = |seed: i64| -> Vec<Rect> {
        let mut session = session(&[("seed", Value::Integer(seed))]);
        session.start(&rgb(&scene(0)), target(0), &mut ()).unwrap();
        (1..20).map(|n| step(&mut session, &rgb(&scene(n))).rect).collect()
    };
    assert_eq!(run(3), run(3));
    assert_ne!(run(3), run(4));
}

#[test]
fn several_targets_are_followed_each_as_if_it_were_alone() {
    let other = |n: usize| Rect::new(190.0 - 2.0 * n as f64, 110.0, SIDE, SIDE);
    let picture = |n: usize| Scene { boxes: vec![(target(n), 0), (other(n), 1)], colour: true }.paint();
    let mut both = session(&[("max_targets", Value::Integer(2))]);
    let mut alone = [session(&[]), session(&[])];
    for n in 0..30 {
        let data = picture(n);
        let frame = rgb(&data);
        for (session, rect, id) in [(0, target(0), "a"), (1, other(0), "b")] {
            if n == 0 {
                both.start_as(Some(id), &frame, rect, &mut ()).unwrap();
                alone[session].start_as(Some(id), &frame, rect, &mut ()).unwrap();
            } else {
                alone[session].step(&frame, &mut ());
            }
        }
        if n > 0 {
            both.step(&frame, &mut ());
        }
        let said: Vec<Target> = alone.iter().flat_map(|session| session.output().targets.clone()).collect();
        assert_eq!(*both.output(), Output { targets: said });
    }
    assert!(both.output().targets[1].rect.iou(&other(29)) > 0.5);
    assert!(both.stop_target("a"));
    assert_eq!(both.output().targets.len(), 1);
}

#[test]
fn a_mark_on_a_frame_that_has_passed_gives_the_track_as_if_it_had_come_in_time() {
    let scenes: Vec<Vec<u8>> = (0..20).map(scene).collect();
    let frames: Vec<Frame> = scenes.iter().map(|data| rgb(data)).collect();
    let mut in_time = session(&[]);
    in_time.start(&frames[0], target(0), &mut ()).unwrap();
    frames[1..].iter().for_each(|frame| _ = in_time.step(frame, &mut ()));
    let mut late = session(&[]);
    late.start_from(None, &frames[0], &frames[1..15], target(0), &mut ()).unwrap();
    frames[15..].iter().for_each(|frame| _ = late.step(frame, &mut ()));
    assert_eq!(late.output(), in_time.output());
}

#[test]
fn it_goes_on_when_the_images_size_or_encoding_changes() {
    let mut session = session(&[]);
    session.start(&rgb(&scene(0)), target(0), &mut ()).unwrap();
    for n in 1..40 {
        let data = scene(n);
        if (10..20).contains(&n) {
            // Twice as large.
            let row = |y: usize| (0..2 * WIDTH).flat_map(move |x| [y / 2 * WIDTH + x / 2]);
            let at = (0..2 * HEIGHT).flat_map(row);
            let large: Vec<u8> = at.flat_map(|i| data[3 * i..3 * i + 3].to_vec()).collect();
            let (w, h) = (2 * WIDTH as u32, 2 * HEIGHT as u32);
            let said = step(&mut session, &Frame::new(&large, w, h, 3 * w as usize, Encoding::Rgb8, None).unwrap());
            let t = target(n);
            assert!(said.rect.iou(&Rect::new(2.0 * t.x, 2.0 * t.y, 2.0 * t.w, 2.0 * t.h)) > 0.5, "{n}: {}", said.rect);
        } else if (20..30).contains(&n) {
            let bgr: Vec<u8> = data.chunks_exact(3).flat_map(|p| [p[2], p[1], p[0]]).collect();
            let (w, h) = (WIDTH as u32, HEIGHT as u32);
            let said = step(&mut session, &Frame::new(&bgr, w, h, 3 * WIDTH, Encoding::Bgr8, None).unwrap());
            assert!(said.rect.iou(&target(n)) > 0.5, "{n}: {}", said.rect);
        } else {
            let said = step(&mut session, &rgb(&data));
            assert!(said.rect.iou(&target(n)) > 0.5, "{n}: {}", said.rect);
        }
    }
}

#[test]
fn the_smallest_images_and_targets_are_followed() {
    for (w, h, rect) in [
        (4u32, 4u32, Rect::new(0.0, 0.0, 4.0, 4.0)),
        (24, 16, Rect::new(10.0, 6.0, 4.0, 4.0)),
        (60, 5, Rect::new(50.0, 0.0, 12.0, 5.0)),
        (1000, 6, Rect::new(900.0, 1.0, 40.0, 4.0)),
    ] {
        let mut session = session(&[]);
        for n in 0..30 {
            let data: Vec<u8> = (0..w * h).map(|i| ((i * i * 31 + i * 17 + n * 40) % 251) as u8).collect();
            let frame = Frame::new(&data, w, h, w as usize, Encoding::Mono8, None).unwrap();
            if n == 0 {
                session.start(&frame, rect, &mut ()).unwrap();
                continue;
            }
            let said = step(&mut session, &frame);
            assert!(said.rect.is_finite() && said.rect.w >= 3.99 && said.rect.h >= 3.99, "{w} x {h}: {}", said.rect);
            assert!(
                said.rect.w <= f64::from(w) + 0.01 && said.rect.h <= f64::from(h) + 0.01,
                "{w} x {h}: {}",
                said.rect
            );
            assert!((0.0..=1.0).contains(&said.confidence) && said.velocity.iter().all(|v| v.is_finite()));
        }
    }
}

#[test]
fn a_target_is_held_while_parameters_change() {
    let mut session = session(&[]);
    session.start(&rgb(&scene(0)), target(0), &mut ()).unwrap();
    let changes = [
        ("etepf.particles.least_noise", Value::Double(4.0)),
        ("etepf.features.pixels", Value::Integer(400)),
        ("etepf.ensemble.classifiers", Value::Integer(8)),
        ("etepf.particles.count", Value::Integer(30)),
        ("etepf.particles.scale_noise", Value::Double(0.02)),
        ("etepf.particles.parts", Value::Integer(3)),
        ("etepf.particles.observation", Value::String("mean".into())),
        ("etepf.update.interval", Value::Integer(2)),
        ("etepf.modes.extent", Value::Double(6.0)),
        ("etepf.particles.count", Value::Integer(5)),
        ("etepf.particles.method", Value::String("mean_shift".into())),
        ("etepf.particles.method", Value::String("particles".into())),
    ];
    for n in 1..50 {
        if let Some((name, value)) = changes.get(n / 4).filter(|_| n % 4 == 0) {
            let changed = session.params().with([(*name, value)], Phase::Running).unwrap();
            session.retune(changed, Networks::default());
        }
        let said = step(&mut session, &rgb(&scene(n)));
        assert!(said.rect.iou(&target(n)) > 0.4, "frame {n}: {}", said.rect);
        assert_eq!(said.age, n as u32);
    }
}

/// Nothing is trained from frame to frame here.
#[test]
fn another_number_of_classifiers_takes_effect_at_once() {
    let mut session = session(&[("etepf.update.enabled", Value::Bool(false))]);
    session.start(&rgb(&scene(0)), target(0), &mut ()).unwrap();
    let mut peak = |n: usize, classifiers: i64| {
        let wanted = Value::Integer(classifiers);
        let changed = session.params().with([("etepf.ensemble.classifiers", &wanted)], Phase::Running).unwrap();
        session.retune(changed, Networks::default());
        let mut seen = Seen::default();
        session.step(&rgb(&scene(n)), &mut seen);
        seen.peak
    };
    let [five, one, again] = [peak(1, 5), peak(2, 1), peak(3, 5)];
    assert!(one < five && five == again, "the more say yes, the likelier: {one} {five} {again}");
}

/// Every part is half a pixel high.
#[test]
fn a_target_has_a_colour_in_parts_too_small_for_a_pixel() {
    let mark = Rect::new(40.0, 40.0, 12.0, 4.0);
    let pixel = |x: usize, y: usize| {
        if (40..52).contains(&x) && (40..44).contains(&y) { 200 } else { 60 + ((x * 7919 + y * 104_729) % 30) as u8 }
    };
    let data: Vec<u8> = (0..WIDTH * HEIGHT).map(|i| pixel(i % WIDTH, i / WIDTH)).collect();
    let frame = Frame::new(&data, WIDTH as u32, HEIGHT as u32, WIDTH, Encoding::Mono8, None).unwrap();
    let mut session = session(&[("etepf.particles.parts", Value::Integer(8))]);
    session.start(&frame, mark, &mut ()).unwrap();
    for n in 0..20 {
        let said = step(&mut session, &frame);
        assert!(said.state == State::Tracking && said.rect.iou(&mark) > 0.5, "{n}: {:?} {}", said.state, said.rect);
    }
}

/// A target that has faded stands out less than it did at first, until it is learned anew as it is.
#[test]
fn what_is_learned_anew_is_measured_by_itself() {
    const FADED: f64 = 0.2;
    let faded = |n: usize| -> Vec<u8> {
        let ground = Scene { boxes: vec![], colour: true }.paint();
        let mix = |(own, ground): (u8, u8)| ((1.0 - FADED) * f64::from(own) + FADED * f64::from(ground)) as u8;
        scene(n).into_iter().zip(ground).map(mix).collect()
    };
    let mut session = session(&[("etepf.update.enabled", Value::Bool(false))]);
    session.start(&rgb(&scene(0)), target(0), &mut ()).unwrap();
    (1..10).for_each(|n| _ = step(&mut session, &rgb(&scene(n))));
    let before = (10..15).map(|n| step(&mut session, &rgb(&faded(n)))).last().unwrap();
    assert!(before.state == State::Tracking && before.confidence < 0.85, "{before:?}");
    let finer = session.params().with([("etepf.features.pixels", &Value::Integer(2000))], Phase::Running);
    session.retune(finer.unwrap(), Networks::default());
    let after = (15..20).map(|n| step(&mut session, &rgb(&faded(n)))).last().unwrap();
    assert!(after.confidence > before.confidence + 0.1 && after.rect.iou(&target(19)) > 0.5, "{after:?}");
}

/// The extremes of all ranges and all choices, set in mid-track, and in force at another mark.
#[test]
fn no_value_that_a_parameter_may_have_breaks_a_track() {
    // Gone for a frame, and back.
    let scenes: Vec<Vec<u8>> = (0..11).map(|n| scene(if n == 5 { 60 } else { n })).collect();
    let extremes = descriptors().iter().filter(|d| d.name.starts_with("etepf.")).flat_map(|d| {
        let values = match d.range {
            Some(Range::Integer(low, high)) => vec![Value::Integer(low), Value::Integer(high)],
            Some(Range::Double(low, high)) => vec![Value::Double(low), Value::Double(high)],
            None if d.choices.is_empty() => vec![Value::Bool(false), Value::Bool(true)],
            None => d.choices.iter().map(|choice| Value::String((*choice).to_owned())).collect(),
        };
        values.into_iter().map(|value| (d.name, value))
    });
    let mut tried = 0;
    for (name, value) in extremes {
        let mut session = session(&[]);
        // Thresholds that would cross are refused.
        let changed = match session.params().with([(name, &value)], Phase::Running) {
            Err(ParamsError::Conflict(_)) => continue,
            changed => changed.unwrap(),
        };
        session.start(&rgb(&scenes[0]), target(0), &mut ()).unwrap();
        for n in 1..scenes.len() {
            match n {
                3 => session.retune(changed.clone(), Networks::default()),
                8 => _ = session.start(&rgb(&scenes[7]), target(7), &mut ()).unwrap(),
                _ => (),
            }
            let said = step(&mut session, &rgb(&scenes[n]));
            assert!(said.rect.is_finite() && said.rect.area() > 0.0, "{name} {value}: {}", said.rect);
            assert!((0.0..=1.0).contains(&said.confidence), "{name} {value}: {}", said.confidence);
            assert!(said.velocity.iter().all(|v| v.is_finite()), "{name} {value}: {:?}", said.velocity);
        }
        tried += 1;
    }
    assert!(tried > 25, "{tried}");
}

#[derive(Default)]
struct Seen {
    peak: f32,
    particles: usize,
    weight: f64,
    modes: Vec<&'static str>,
}

impl Trace for Seen {
    fn event(&mut self, event: Event) {
        match event {
            Event::Response(map) => {
                assert_eq!(map.values.len(), map.rows * map.cols);
                assert!(map.values.iter().all(|v| (0.0..=1.0).contains(v)));
                self.peak = map.values.iter().copied().fold(0.0, f32::max);
            }
            Event::Particle { rect, weight } => {
                assert!(rect.is_finite());
                self.particles += 1;
                self.weight += weight;
            }
            Event::Mode { name, .. } => self.modes.push(name),
            _ => {}
        }
    }
}

#[test]
fn a_step_shows_its_likelihood_image_its_particles_and_its_mode() {
    let mut session = session(&[]);
    session.start(&rgb(&scene(0)), target(0), &mut ()).unwrap();
    let mut seen = Seen::default();
    session.step(&rgb(&scene(1)), &mut seen);
    assert!(seen.peak > 0.5);
    assert_eq!((seen.particles, seen.modes.as_slice()), (20, ["track"].as_slice()));
    assert!((seen.weight - 1.0).abs() < 1e-9);
    let empty = Scene { boxes: Vec::new(), colour: true }.paint();
    let mut seen = Seen::default();
    (0..5).for_each(|_| _ = session.step(&rgb(&empty), &mut seen));
    assert_eq!(seen.modes.last(), Some(&"find"));
}
