//! MAPTrack in a session, on scenes made here: what a user of the node meets.

use long_term_tracker::crop::{Cropper, Patch};
use long_term_tracker::detect::camera::{CameraMotion, warp};
use long_term_tracker::network::Networks;
use long_term_tracker::params::{Phase, Value};
use long_term_tracker::trace::{Event, Trace};
use long_term_tracker::{Encoding, Frame, Params, Rect, Session, State};

const WIDTH: usize = 240;
const HEIGHT: usize = 160;

/// A walker: where it is on a frame, and its colour.
type Walker = (Rect, [u8; 3]);

const RED: [u8; 3] = [200, 40, 30];
const BLUE: [u8; 3] = [30, 60, 210];

/// Walkers over a ground with noise that changes from frame to frame; later ones hide earlier ones.
fn picture(frame: usize, walkers: &[Walker]) -> Vec<u8> {
    let hash = |i: usize| (i.wrapping_mul(2_654_435_761) >> 7) % 7;
    let mut data = Vec::with_capacity(3 * WIDTH * HEIGHT);
    for (y, x) in (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (y, x))) {
        let (u, v) = (x as f64 + 0.5, y as f64 + 0.5);
        let within = |r: &Rect| u >= r.x && u < r.x + r.w && v >= r.y && v < r.y + r.h;
        let texture = (40 * (x / 12 + y / 9) % 80) as u8;
        let colour = walkers.iter().rev().find(|(rect, _)| within(rect)).map_or([90 + texture; 3], |walker| walker.1);
        let noise = hash(x + WIDTH * (y + HEIGHT * frame)) as u8;
        data.extend(colour.map(|c| c + noise));
    }
    data
}

fn rgb(data: &[u8]) -> Frame<'_> {
    Frame::new(data, WIDTH as u32, HEIGHT as u32, 3 * WIDTH, Encoding::Rgb8, None).unwrap()
}

fn session(changes: &[(&str, Value)]) -> Session {
    let algorithm = Value::String("maptrack".into());
    let changes = changes.iter().map(|(name, value)| (*name, value));
    let params = Params::default().with([("algorithm", &algorithm)].into_iter().chain(changes), Phase::StartUp);
    Session::new(params.unwrap()).unwrap()
}

fn walker(x: f64, y: f64) -> Rect {
    Rect::new(x, y, 16.0, 40.0)
}

/// Frames of the empty ground, so that the background is known.
const QUIET: usize = 10;

/// Runs `count` frames of these walkers after the quiet ones; calls `check` after each.
fn run(
    session: &mut Session,
    count: usize,
    walkers: impl Fn(usize) -> Vec<Walker>,
    mut check: impl FnMut(usize, &Session),
) {
    for n in 0..QUIET + count {
        let walkers = n.checked_sub(QUIET).map_or(Vec::new(), &walkers);
        session.step(&rgb(&picture(n, &walkers)), &mut ());
        if n >= QUIET {
            check(n - QUIET, session);
        }
    }
}

fn ids(session: &Session) -> Vec<&str> {
    session.output().targets.iter().map(|target| &*target.id).collect()
}

#[test]
fn what_moves_is_found_without_a_mark_and_followed_under_one_id() {
    let mut session = session(&[]);
    let way = |n: usize| walker(5.0 + 3.0 * n as f64, 60.0);
    run(
        &mut session,
        60,
        |n| vec![(way(n), RED)],
        |n, session| {
            let targets = &session.output().targets;
            if n < 4 {
                assert!(targets.is_empty(), "five frames in a row make a target (eq 1): frame {n}");
            } else if n > 6 {
                assert_eq!(ids(session), ["0"], "frame {n}");
                assert!(targets[0].rect.iou(&way(n)) > 0.6, "frame {n}: {}", targets[0].rect);
                assert_eq!(targets[0].state, State::Tracking, "frame {n}");
            }
        },
    );
    let [x, y] = session.output().targets[0].velocity;
    assert!((x - 3.0).abs() < 0.5 && y.abs() < 0.5, "{x} {y}");
}

#[test]
fn an_empty_scene_has_no_targets() {
    let mut session = session(&[]);
    run(&mut session, 60, |_| Vec::new(), |n, session| assert!(session.output().targets.is_empty(), "frame {n}"));
}

/// They walk through each other twice as fast as one alone; the blue one is in front.
#[test]
fn targets_that_cross_keep_their_ids() {
    let ways = |n: usize| [walker(20.0 + 2.5 * n as f64, 60.0), walker(204.0 - 2.5 * n as f64, 64.0)];
    let mut session = session(&[]);
    let mut first = Vec::new();
    let walkers = |n: usize| vec![(ways(n)[0], RED), (ways(n)[1], BLUE)];
    run(&mut session, 75, walkers, |n, session| {
        if n == 12 {
            first = session.output().targets.clone();
            assert_eq!(first.len(), 2);
        }
    });
    let last = &session.output().targets;
    assert_eq!(ids(&session), ["0", "1"]);
    for (before, after) in first.iter().zip(last) {
        let which = usize::from(before.rect.iou(&ways(12)[1]) > 0.5);
        assert!(
            before.rect.iou(&ways(12)[which]) > 0.5 && after.rect.iou(&ways(74)[which]) > 0.5,
            "{before:?} {after:?}"
        );
    }
}

/// A pillar, part of the ground, hides the walker as a whole for some frames.
#[test]
fn a_target_behind_a_pillar_is_held_and_comes_out_under_its_id() {
    let pillar = Rect::new(100.0, 0.0, 36.0, HEIGHT as f64);
    let way = |n: usize| walker(5.0 + 3.0 * n as f64, 60.0);
    let mut session = session(&[]);
    let mut hidden = 0;
    for n in 0..QUIET + 65 {
        let mut walkers = n.checked_sub(QUIET).map_or(Vec::new(), |n| vec![(way(n), RED)]);
        walkers.push((pillar, [60, 70, 60]));
        session.step(&rgb(&picture(n, &walkers)), &mut ());
        let n = n.saturating_sub(QUIET);
        let is_behind = way(n).x >= pillar.x && way(n).x + 16.0 <= pillar.x + pillar.w;
        if let [target] = session.output().targets.as_slice() {
            hidden += usize::from(target.state != State::Tracking);
            assert!(!is_behind || target.state != State::Tracking, "frame {n}: {target:?}");
            assert!(
                !is_behind || target.rect.iou(&way(n)) > 0.25,
                "held where it would be, frame {n}: {}",
                target.rect
            );
        }
    }
    assert!(hidden > 3, "{hidden}");
    assert_eq!(ids(&session), ["0"]);
    let target = &session.output().targets[0];
    assert!(target.rect.iou(&way(64)) > 0.5 && target.state == State::Tracking, "{target:?}");
}

#[test]
fn a_target_that_stands_still_stays() {
    let way = |n: usize| walker(20.0 + 3.0 * n.min(30) as f64, 60.0);
    let mut session = session(&[("maptrack.background.window", Value::Integer(60))]);
    run(
        &mut session,
        120,
        |n| vec![(way(n), RED)],
        |n, session| {
            assert!(n < 8 || ids(session) == ["0"], "frame {n}: {:?}", session.output());
        },
    );
    assert!(session.output().targets[0].rect.iou(&way(119)) > 0.5, "{:?}", session.output());
}

#[test]
fn a_target_that_leaves_ends() {
    let mut session = session(&[]);
    let way = |n: usize| walker(150.0 + 4.0 * n as f64, 60.0);
    run(&mut session, 40, |n| vec![(way(n), RED)], |_, _| {});
    assert!(session.output().targets.is_empty(), "{:?}", session.output());
}

#[test]
fn marks_and_found_targets_share_one_numbering() {
    let ways = |n: usize| [walker(20.0 + 2.0 * n as f64, 20.0), walker(20.0 + 2.0 * n as f64, 90.0)];
    let mut session = session(&[]);
    let walkers = |n: usize| ways(n).map(|rect| (rect, RED));
    // Numbers are those of targets that nobody named: a named one takes none, but its name is taken.
    for n in 0..QUIET + 20 {
        let frame = n.checked_sub(QUIET).map_or(Vec::new(), |n| walkers(n).to_vec());
        session.step(&rgb(&picture(n, &frame)), &mut ());
        if n == QUIET + 1 {
            session.start_as(Some("0"), &rgb(&picture(n, &frame)), ways(1)[0], &mut ()).unwrap();
        }
    }
    let frame = picture(QUIET + 19, &walkers(19));
    assert_eq!(ids(&session), ["0", "1"]);
    session.start(&rgb(&frame), Rect::new(150.0, 100.0, 20.0, 20.0), &mut ()).unwrap();
    assert_eq!(ids(&session), ["1", "2"], "a mark takes the place of the last mark, and of no target that was found");
    assert!(session.stop_target("1") && !session.stop_target("1"));
    assert_eq!(ids(&session), ["2"]);
}

#[test]
fn after_a_stop_nothing_is_found_until_a_mark_or_a_restart() {
    let mut session = session(&[]);
    let way = |n: usize| walker(5.0 + 3.0 * n as f64, 60.0);
    run(&mut session, 10, |n| vec![(way(n), RED)], |_, _| {});
    assert!(session.is_active() && ids(&session) == ["0"]);
    session.stop();
    assert!(!session.is_active() && session.output().targets.is_empty());
    run(&mut session, 10, |n| vec![(way(n), RED)], |_, session| assert!(session.output().targets.is_empty()));
    session.restart(&rgb(&picture(0, &[])), &mut ()).unwrap();
    run(&mut session, 10, |n| vec![(way(n), RED)], |_, _| {});
    assert_eq!(ids(&session), ["1"]);
}

#[test]
fn without_finding_it_waits_for_marks() {
    let mut session = session(&[("maptrack.find.most", Value::Integer(0))]);
    let way = |n: usize| walker(5.0 + 3.0 * n as f64, 60.0);
    run(&mut session, 20, |n| vec![(way(n), RED)], |_, session| assert!(session.output().targets.is_empty()));
    assert!(!session.is_active());
    session.start(&rgb(&picture(50, &[(way(20), RED)])), way(20), &mut ()).unwrap();
    for n in 21..50 {
        session.step(&rgb(&picture(50 + n, &[(way(n), RED)])), &mut ());
        assert_eq!(ids(&session), ["0"]);
    }
    assert!(session.output().targets[0].rect.iou(&way(49)) > 0.5, "{:?}", session.output());
}

/// With the pattern and with the paper's images alone.
#[test]
fn a_mark_is_followed_on_a_frame_that_has_passed_and_when_colour_goes() {
    for pattern in [true, false] {
        let changes = [("maptrack.find.most", Value::Integer(0)), ("maptrack.pattern.enabled", Value::Bool(pattern))];
        let mut session = session(&changes);
        let way = |n: usize| walker(5.0 + 3.0 * n as f64, 60.0);
        let pictures: Vec<Vec<u8>> = (0..20).map(|n| picture(n, &[(way(n), RED)])).collect();
        let frames: Vec<Frame> = pictures.iter().map(|data| rgb(data)).collect();
        session.start_from(None, &frames[0], &frames[1..15], way(0), &mut ()).unwrap();
        assert!(session.output().targets[0].rect.iou(&way(14)) > 0.5, "pattern {pattern}: {:?}", session.output());
        frames[15..].iter().for_each(|frame| _ = session.step(frame, &mut ()));
        assert_eq!(session.output().targets[0].age, 19);
        let grey: Vec<u8> = pictures[19].chunks_exact(3).map(|p| p[0]).collect();
        let grey = Frame::new(&grey, WIDTH as u32, HEIGHT as u32, WIDTH, Encoding::Mono8, None).unwrap();
        assert!(session.step(&grey, &mut ()).targets[0].rect.is_finite());
    }
}

#[test]
fn every_parameter_may_change_while_targets_are_followed() {
    let mut session = session(&[]);
    let changes = [
        ("maptrack.image.pixels", Value::Integer(10_000)),
        ("maptrack.background.window", Value::Integer(300)),
        ("maptrack.find.lambda", Value::Integer(5)),
        ("maptrack.occlusion.begin", Value::Double(0.2)),
        ("maptrack.find.start", Value::Double(30.0)),
        ("maptrack.groups.share", Value::Bool(false)),
        ("maptrack.pattern.enabled", Value::Bool(false)),
        ("maptrack.find.most", Value::Integer(0)),
    ];
    let way = |n: usize| walker(5.0 + 2.0 * n as f64, 60.0);
    for n in 0..80 {
        let frame = picture(n, &[(way(n), RED)]);
        if let Some((name, value)) = changes.get(n / 8).filter(|_| n % 8 == 7) {
            let changed = session.params().with([(*name, value)], Phase::Running).unwrap();
            session.retune(changed, Networks::default());
        }
        session.step(&rgb(&frame), &mut ());
        assert!(session.output().targets.iter().all(|t| t.rect.is_finite() && (0.0..=1.0).contains(&t.confidence)));
    }
}

#[test]
fn the_smallest_images_do_no_harm() {
    for (w, h) in [(1u32, 1u32), (4, 4), (60, 5), (1000, 6)] {
        let mut session = session(&[]);
        for n in 0..20 {
            let data: Vec<u8> = (0..w * h).map(|i| ((i * i * 31 + i * 17 + n * 40) % 251) as u8).collect();
            session.step(&Frame::new(&data, w, h, w as usize, Encoding::Mono8, None).unwrap(), &mut ());
            assert!(session.output().targets.iter().all(|target| target.rect.is_finite()));
        }
    }
}

#[derive(Default)]
struct Seen {
    cues: Vec<(String, &'static str)>,
}

impl Trace for Seen {
    fn event(&mut self, event: Event) {
        let Event::Cues(cues) = event else { return };
        for (name, values) in cues.images {
            assert_eq!(values.len(), cues.rows * cues.cols, "{name}");
            assert!(values.iter().all(|v| (0.0..=1.0).contains(v)), "{name}");
        }
        let [motion, .., composite] = cues.images.map(|(_, values)| values.iter().sum::<f32>());
        assert!(motion > 0.0 && composite > 0.0);
        self.cues.push((cues.id.to_owned(), cues.name));
    }
}

#[test]
fn a_step_shows_the_images_of_the_oldest_target() {
    let ways = |n: usize| [walker(20.0 + 2.0 * n as f64, 20.0), walker(20.0 + 2.0 * n as f64, 90.0)];
    let walkers = |n: usize| ways(n).map(|rect| (rect, BLUE)).to_vec();
    let mut session = session(&[]);
    run(&mut session, 20, walkers, |_, _| {});
    let mut seen = Seen::default();
    session.step(&rgb(&picture(QUIET + 20, &walkers(20))), &mut seen);
    assert_eq!((ids(&session).len(), seen.cues), (2, vec![("0".to_owned(), "moving")]));
}

/// A real frame, and a part of it as a camera shows it that shakes, turns and pans: the picture, without its margins.
struct Shaken {
    still: Patch,
    seen: Patch,
    covered: Vec<u8>,
    bytes: Vec<u8>,
}

/// What is cut off at each side, so that the camera never looks beyond the frame.
const MARGIN: usize = 50;

impl Shaken {
    fn new() -> Self {
        let image = long_term_tracker::replay::folder::read(
            std::path::Path::new("assets/demo/img/000.jpg"),
            &Default::default(),
        )
        .unwrap();
        let frame = image.frame();
        let (width, height) = (frame.width() as usize / 2, frame.height() as usize / 2);
        let mut still = Patch::default();
        Cropper::default().crop(&frame, &frame.bounds(), width, height, &mut still);
        Self { still, seen: Patch::default(), covered: Vec::new(), bytes: Vec::new() }
    }

    fn frame(&mut self, n: usize) -> Frame<'_> {
        let t = n as f64;
        let (width, height) = (self.still.width, self.still.height);
        let none = CameraMotion::none(width, height);
        let shift = [4.0 * (1.7 * t).sin() + 0.08 * t, 4.0 * (2.3 * t).cos() - 0.05 * t];
        warp(
            &self.still,
            &CameraMotion { angle: 0.03 * (0.9 * t).sin(), shift, ..none },
            &mut self.seen,
            &mut self.covered,
        );
        self.bytes.clear();
        for y in 0..height {
            self.bytes.extend((0..width).flat_map(|x| self.seen.rgb(x, y)));
        }
        let data = &self.bytes[3 * (MARGIN * width + MARGIN)..];
        let [w, h] = [width, height].map(|side| (side - 2 * MARGIN) as u32);
        Frame::new(data, w, h, 3 * width, Encoding::Rgb8, None).unwrap()
    }
}

#[test]
fn a_camera_that_shakes_turns_and_pans_makes_no_target_of_a_still_scene() {
    let mut shaken = Shaken::new();
    let found = |enabled: bool, shaken: &mut Shaken| {
        let mut session = session(&[("maptrack.stabilisation.enabled", Value::Bool(enabled))]);
        (0..300).map(|n| session.step(&shaken.frame(n), &mut ()).targets.len()).sum::<usize>()
    };
    assert_eq!(found(true, &mut shaken), 0);
    assert!(found(false, &mut shaken) > 0, "without it the scene is full of them");
}

/// The mark stays on what it was set on, in the pixels of the frame.
#[test]
fn boxes_of_a_stabilised_stream_are_those_of_the_frame() {
    let mut shaken = Shaken::new();
    let changes =
        [("maptrack.stabilisation.enabled", Value::Bool(true)), ("maptrack.pattern.enabled", Value::Bool(false))];
    let mut session = session(&changes);
    let (width, height) = (shaken.still.width, shaken.still.height);
    let place = |n: usize, shaken: &Shaken| {
        let t = n as f64;
        let shift = [4.0 * (1.7 * t).sin() + 0.08 * t, 4.0 * (2.3 * t).cos() - 0.05 * t];
        let motion = CameraMotion {
            angle: 0.03 * (0.9 * t).sin(),
            shift,
            ..CameraMotion::none(shaken.still.width, shaken.still.height)
        };
        let [x, y] = motion.apply([width as f64 / 2.0, height as f64 / 2.0]);
        Rect::around([x - MARGIN as f64, y - MARGIN as f64], [24.0, 40.0])
    };
    let mark = place(0, &shaken);
    session.start(&shaken.frame(0), mark, &mut ()).unwrap();
    for n in 1..60 {
        let rect = session.step(&shaken.frame(n), &mut ()).targets[0].rect;
        let want = place(n, &shaken);
        assert!(rect.iou(&want) > 0.6, "frame {n}: {rect}, {want}");
    }
}
