//! Marks on what cannot be followed, and targets whose picture becomes such: a box that creeps there would turn a
//! camera.

use std::path::Path;

use long_term_tracker::geometry::distance;
use long_term_tracker::params::{self, NodeName, Phase, Value};
use long_term_tracker::{Encoding, Frame, Params, Rect, Session, StartError, State, Target};

const WIDTH: usize = 320;
const HEIGHT: usize = 240;
/// Frames that a picture shows nothing.
const COVERED: usize = 40;
/// How far a box may go meanwhile, in pixels.
const STILL: f64 = 1.0;
/// Frames in which a target must be found again once it is to be seen.
const PROMPT: usize = 10;

/// Each way to follow a mark: name, file of parameters, and what differs from it.
const TRACKERS: [(&str, &str); 5] = [
    ("default", "default"),
    ("fast", "fast"),
    // Without its network, which is no part of the package.
    ("paper without its network", "paper"),
    ("etepf", "etepf"),
    ("maptrack", "maptrack"),
];

fn session(preset: &str) -> Session {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("params/{preset}.yaml"));
    let mut table = params::file(&path, &NodeName::default()).unwrap();
    if preset == "paper" {
        table.push(("lcmht.cnn.enabled".into(), Value::Bool(false)));
        table.push(("lcmht.layers.hog_weight".into(), Value::Double(1.0)));
    }
    let table = table.iter().map(|(name, value)| (name.as_str(), value));
    Session::new(Params::default().with(table, Phase::StartUp).unwrap()).unwrap()
}

/// A picture by its pixels.
fn picture(pixel: impl Fn(usize, usize) -> [f64; 3]) -> Vec<u8> {
    (0..WIDTH * HEIGHT).flat_map(|i| pixel(i % WIDTH, i / WIDTH).map(|v| v.round().clamp(0.0, 255.0) as u8)).collect()
}

fn frame(data: &[u8]) -> Frame<'_> {
    Frame::new(data, WIDTH as u32, HEIGHT as u32, 3 * WIDTH, Encoding::Rgb8, None).unwrap()
}

/// A number in `0..1` that three numbers make.
fn random(a: usize, b: usize, seed: usize) -> f64 {
    let factors = [(a, 374_761_393u32), (b, 668_265_263), (seed, 2_246_822_519)];
    let mut v = factors.iter().fold(17, |v: u32, &(n, factor)| v ^ (n as u32).wrapping_mul(factor));
    v = (v ^ (v >> 13)).wrapping_mul(1_274_126_177);
    v = (v ^ (v >> 16)).wrapping_mul(2_246_822_519);
    f64::from((v ^ (v >> 13)) >> 8) / f64::from(1u32 << 24)
}

/// Noise of so many levels up and down.
fn noise(x: usize, y: usize, seed: usize, levels: f64) -> f64 {
    (2.0 * random(x, y, seed) - 1.0) * levels
}

/// Where the target of [`scene`] is in its `k`th frame: it goes to the right and then stands.
fn target(k: usize) -> Rect {
    Rect::new(100.0 + (k.min(30)) as f64, 90.0, 40.0, 52.0)
}

/// A target of coloured patches on a ground of dimmer ones.
fn scene(k: usize) -> Vec<u8> {
    let place = target(k);
    picture(|x, y| {
        let (u, v) = (x as f64 - place.x, y as f64 - place.y);
        let inside = (0.0..place.w).contains(&u) && (0.0..place.h).contains(&v);
        let [a, b, seed, from, to] =
            if inside { [u as usize / 6, v as usize / 7, 3, 40, 250] } else { [x / 9, y / 8, 8, 70, 150] };
        std::array::from_fn(|c| from as f64 + (to - from) as f64 * random(a, b, seed + c))
    })
}

#[test]
fn a_mark_on_nothing_is_refused_with_the_reason() {
    let plain = |value: [f64; 3]| picture(|_, _| value);
    let noisy = |levels: f64| picture(move |x, y| [0, 1, 2].map(|seed| 128.0 + noise(x, y, seed, levels)));
    let pictures = [
        ("black", plain([0.0; 3])),
        ("grey", plain([128.0; 3])),
        ("white", plain([255.0; 3])),
        ("red", plain([200.0, 30.0, 40.0])),
        ("a level of noise", noisy(1.0)),
        ("two levels of noise", noisy(2.0)),
        ("a shade", picture(|x, _| [60.0 + x as f64 / 2.0; 3])),
        ("a shade aslant", picture(|x, y| [20.0 + (x + y) as f64 / 3.0; 3])),
        ("an edge without end", picture(|_, y| [if y < 116 { 40.0 } else { 210.0 }; 3])),
    ];
    let seen = scene(0);
    for (name, preset) in TRACKERS {
        let mut session = session(preset);
        for (what, data) in &pictures {
            let why = session.start(&frame(data), target(0), &mut ()).unwrap_err();
            assert!(matches!(why, StartError::Blank { .. }), "{name} on {what}: {why}");
            assert!(why.to_string().contains("shows nothing to follow"), "{why}");
            assert!(session.step(&frame(data), &mut ()).targets.is_empty(), "{name} on {what}");
        }
        // Nor does it end what is followed; and a mark on something is taken.
        session.start_as(Some("a"), &frame(&seen), target(0), &mut ()).unwrap();
        assert!(session.start_as(Some("a"), &frame(&pictures[0].1), target(0), &mut ()).is_err());
        let went_on = session.step(&frame(&seen), &mut ()).targets[0].clone();
        assert!(went_on.state == State::Tracking && went_on.rect.iou(&target(0)) > 0.5, "{name}: {went_on:?}");
    }
}

/// How a picture comes to show nothing: what is left of the scene in the `i`th frame of it, or `None` from then on that
/// nothing is, and what is shown then.
struct Cover {
    what: &'static str,
    fading: usize,
    shows: fn(usize, usize, usize) -> [f64; 3],
}

const COVERS: [Cover; 5] = [
    Cover { what: "black", fading: 0, shows: |_, _, _| [0.0; 3] },
    Cover { what: "white", fading: 0, shows: |_, _, _| [255.0; 3] },
    Cover { what: "a fade to grey", fading: 20, shows: |_, _, _| [128.0; 3] },
    Cover { what: "a lens cap with noise", fading: 0, shows: |x, y, k| [6.0 + noise(x, y, k, 2.0); 3] },
    Cover { what: "a shade", fading: 0, shows: |x, y, _| [50.0 + x as f64 / 4.0 + y as f64 / 6.0; 3] },
];

#[test]
fn a_target_whose_picture_shows_nothing_stays_where_it_was_and_is_followed_when_it_is_back() {
    const BEFORE: usize = 40;
    let scenes: Vec<Vec<u8>> = (0..=BEFORE).map(scene).collect();
    for (name, preset) in TRACKERS {
        for Cover { what, fading, shows } in &COVERS {
            let mut session = session(preset);
            session.start(&frame(&scenes[0]), target(0), &mut ()).unwrap();
            let mut step = |data: &[u8]| session.step(&frame(data), &mut ()).targets[0].clone();
            let before = scenes[1..].iter().map(|data| step(data)).collect::<Vec<_>>().pop().unwrap();
            let is_right = |t: &Target| t.state == State::Tracking && t.rect.iou(&target(BEFORE)) > 0.5;
            assert!(is_right(&before), "{name} before {what}: {before:?}");
            let last = &scenes[BEFORE];
            for k in 1..*fading {
                let left = 1.0 - k as f64 / *fading as f64;
                step(&picture(|x, y| {
                    let cover = shows(x, y, k);
                    std::array::from_fn(|c| cover[c] + left * (f64::from(last[3 * (y * WIDTH + x) + c]) - cover[c]))
                }));
            }
            let covered: Vec<Target> = (0..COVERED).map(|k| step(&picture(|x, y| shows(x, y, k)))).collect();
            for (k, target) in covered.iter().enumerate() {
                assert_ne!(target.state, State::Tracking, "{name} under {what}, frame {k}: {target:?}");
                let way = distance(target.rect.centre(), covered[0].rect.centre());
                assert!(way <= STILL, "{name} under {what}, frame {k}: {way} px");
                assert_eq!(target.velocity, [0.0; 2], "{name} under {what}, frame {k}");
            }
            let way = distance(covered[0].rect.centre(), target(BEFORE).centre());
            assert!(way < 6.0, "{name} under {what} stays where the target was: {way} px");
            let back = (0..PROMPT).map(|_| step(last)).collect::<Vec<_>>().pop().unwrap();
            assert!(is_right(&back), "{name} after {what}: {back:?}");
        }
    }
}

/// What has little contrast, and yet some, is no nothing.
#[test]
fn small_and_faint_targets_are_taken_and_followed() {
    let place = |k: usize| Rect::new(120.0 + k as f64, 100.0, 12.0, 12.0);
    for (name, preset) in TRACKERS.into_iter().filter(|(_, preset)| *preset != "etepf") {
        let scene = |k: usize| {
            picture(|x, y| {
                let (u, v) = (x as f64 - place(k).x, y as f64 - place(k).y);
                let spot = (-((u - 5.5).powi(2) + (v - 5.5).powi(2)) / 18.0).exp();
                [100.0 + 18.0 * spot + noise(x, y, k, 1.0); 3]
            })
        };
        let mut session = session(preset);
        session.start(&frame(&scene(0)), place(0), &mut ()).unwrap_or_else(|why| panic!("{name}: {why}"));
        for k in 1..40 {
            let target = session.step(&frame(&scene(k)), &mut ()).targets[0].clone();
            assert!(target.state == State::Tracking && target.rect.iou(&place(k)) > 0.3, "{name}, {k}: {target:?}");
        }
    }
}
