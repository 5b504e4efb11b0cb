use super::*;

use std::sync::Mutex;

use crate::appearance::filters::{FIRST_STEPS, LOOK_STEPS};
use crate::appearance::settings::{LookSettings, NetworkFilterSettings};
use crate::frame::Encoding;
use crate::geometry::distance;
use crate::loader::Request;
use crate::network::locked;
use crate::params::Params;

const WIDTH: usize = 200;
const HEIGHT: usize = 160;
const TARGET: Rect = Rect::new(80.0, 50.0, 30.0, 50.0);

/// Texture, each pixel of it a mean over so many across.
fn scene(blur: usize) -> Vec<u8> {
    let texture = |x: usize, y: usize| (x / 5 * 7919 + y / 4 * 104_729 + x / 5 * (y / 4) * 31) % 251;
    let mean = |x: usize, y: usize| (0..blur).map(|i| texture(x + i, y)).sum::<usize>() / blur;
    (0..WIDTH * HEIGHT).map(|i| mean(i % WIDTH, i / WIDTH) as u8).collect()
}

/// The highest response to a scene that is blurred or not, relative to that of the first frame.
fn answer(looks: Option<LookSettings>, blur: usize) -> f64 {
    let settings = AppearanceSettings { looks, ..AppearanceSettings::default() };
    let [first, then] = [scene(1), scene(blur)];
    let frame = |data| Frame::new(data, WIDTH as u32, HEIGHT as u32, WIDTH, Encoding::Mono8, None).unwrap();
    let mut cropper = Cropper::default();
    let [first, then] = [frame(&first), frame(&then)];
    let (mut correlator, trained) = Correlator::new(&settings, None, &first, &mut cropper, &TARGET);
    let highest = |correlator: &mut Correlator, frame: &Frame| {
        correlator.look(frame, &mut Cropper::default(), TARGET.centre(), TARGET.size(), 0.0);
        correlator.highest().response
    };
    assert!((highest(&mut correlator, &first) - trained).abs() < 1e-6);
    learn_looks(&mut correlator, &mut cropper);
    highest(&mut correlator, &then) / highest(&mut correlator, &first)
}

#[test]
fn a_filter_that_learned_altered_looks_answers_better_to_a_blurred_target() {
    let [without, with] = [answer(None, 7), answer(Some(LookSettings::default()), 7)];
    assert!(with > 1.1 * without, "{with} {without}");
}

#[test]
fn a_target_that_turned_is_found_and_learned_where_it_is_by_a_picture_turned_back() {
    const DEGREES: f64 = 20.0;
    let settings = AppearanceSettings::default();
    let first = scene(1);
    let [x, y] = TARGET.centre();
    let place = [x + 9.0, y - 6.0];
    let pixel = |i: usize| {
        let offset = [(i % WIDTH) as f64 + 0.5 - place[0], (i / WIDTH) as f64 + 0.5 - place[1]];
        let [dx, dy] = turned(offset, -DEGREES.to_radians());
        let [column, row] = [(x + dx, WIDTH), (y + dy, HEIGHT)].map(|(v, n)| v.clamp(0.0, n as f64 - 1.0) as usize);
        first[row * WIDTH + column]
    };
    let then: Vec<u8> = (0..first.len()).map(pixel).collect();
    let frame = |data| Frame::new(data, WIDTH as u32, HEIGHT as u32, WIDTH, Encoding::Mono8, None).unwrap();
    let mut cropper = Cropper::default();
    let (mut correlator, _) = Correlator::new(&settings, None, &frame(&first), &mut cropper, &TARGET);
    learn_looks(&mut correlator, &mut cropper);
    correlator.look(&frame(&then), &mut cropper, TARGET.centre(), TARGET.size(), 0.0);
    let upright = correlator.highest();
    // Turned farther the same way, it answers worse, and the look before stays.
    assert!(!correlator.look_turned(&frame(&then), &mut cropper, DEGREES, |r| r > upright.response));
    assert_eq!((correlator.turn(), correlator.highest().response), (0.0, upright.response));
    assert!(correlator.look_turned(&frame(&then), &mut cropper, -DEGREES, |r| r > 1.2 * upright.response));
    assert_eq!(correlator.turn(), -DEGREES);
    assert!(distance(correlator.highest().centre, place) < 1.5, "{:?}", correlator.highest());
    correlator.learn(&frame(&then), &mut cropper, place, TARGET.size());
    correlator.respond();
    // The sample learned has the target in its middle.
    assert!(distance(correlator.highest().centre, TARGET.centre()) < 1.5, "{:?}", correlator.highest());
}

/// What a mark costs, counted: a run of the network and a few steps for the true look, and then as much, or less,
/// for each altered one, in a frame of its own.
#[test]
fn a_mark_costs_one_run_of_the_network_and_each_later_frame_one_look_more() {
    let (settings, cnn) = (with_network(), network());
    let runs = |cnn: &Option<SharedCnn>| locked(cnn.as_ref().unwrap()).runs;
    let data = scene(1);
    let frame = Frame::new(&data, WIDTH as u32, HEIGHT as u32, WIDTH, Encoding::Mono8, None).unwrap();
    let mut cropper = Cropper::default();
    let (mut correlator, _) = Correlator::new(&settings, cnn.clone(), &frame, &mut cropper, &TARGET);
    assert_eq!((runs(&cnn), correlator.filters.steps()), (1, vec![FIRST_STEPS; 2]));
    // Blurred, and larger and smaller, for both filters; then mirrored, and turned, for the network's alone.
    const WEAK: usize = 4;
    const ALL: usize = 9;
    for look in 1..=ALL {
        correlator.learn_look(&mut cropper);
        let steps = [look.min(WEAK), look].map(|looks| FIRST_STEPS + LOOK_STEPS * looks);
        assert_eq!((runs(&cnn), correlator.filters.steps()), (1 + look, steps.to_vec()));
    }
    correlator.learn_look(&mut cropper);
    assert_eq!(runs(&cnn), 1 + ALL, "nothing is left to learn");
}

fn learn_looks(correlator: &mut Correlator, cropper: &mut Cropper) {
    while !correlator.looks.is_empty() {
        correlator.learn_look(cropper);
    }
}

/// HOG, colour names, and two outputs of the embedded network.
fn with_network() -> AppearanceSettings {
    let mut settings = AppearanceSettings::default();
    let output = |i, components, energy| LayerSpec::scaled(LayerSource::Network(i), Some(components), energy);
    settings.layers.extend([output(0, 8, 0.1), output(1, 32, 0.2)]);
    settings
}

fn network() -> Option<SharedCnn> {
    let loaded = Request::of(&Params::default()).unwrap().load().unwrap();
    Some(Arc::new(Mutex::new(loaded)))
}

/// The response map of a filter trained on the first frame, to a scene that is a little blurred.
fn responses(change: impl Fn(&mut AppearanceSettings)) -> Vec<f32> {
    let mut settings = with_network();
    change(&mut settings);
    let [first, then] = [scene(1), scene(3)];
    let frame = |data| Frame::new(data, WIDTH as u32, HEIGHT as u32, WIDTH, Encoding::Mono8, None).unwrap();
    let mut cropper = Cropper::default();
    let (mut correlator, _) = Correlator::new(&settings, network(), &frame(&first), &mut cropper, &TARGET);
    learn_looks(&mut correlator, &mut cropper);
    correlator.look(&frame(&then), &mut cropper, TARGET.centre(), TARGET.size(), 0.0);
    correlator.view.response
}

#[test]
fn a_separate_filter_of_the_network_has_its_share_of_the_response() {
    let separate = |share, regularisation| Some(NetworkFilterSettings { share, regularisation });
    let usual = NetworkFilterSettings::default().regularisation;
    let with_share = |share| responses(|settings| settings.network_filter = separate(share, usual));
    let [hand_crafted, network, both] = [0.0, 1.0, 0.3].map(with_share);
    assert_eq!(hand_crafted, responses(|settings| settings.layers.truncate(2)));
    let difference = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    let sum: Vec<f32> = hand_crafted.iter().zip(&network).map(|(h, n)| 0.7 * h + 0.3 * n).collect();
    assert!(difference(&both, &sum) < 1e-5);
    assert!(difference(&hand_crafted, &network) > 0.01);
    assert!(difference(&both, &responses(|settings| settings.network_filter = None)) > 0.01);
    // The weight of its norm, and mirrored and turned looks, are for the network alone.
    let smooth = |share| responses(|settings| settings.network_filter = separate(share, 10.0));
    assert_eq!(hand_crafted, smooth(0.0));
    let highest = |map: &[f32]| map.iter().copied().fold(0.0, f32::max);
    assert!(highest(&smooth(1.0)) < 0.9 * highest(&network));
    let upright = |share| {
        responses(|settings| {
            settings.network_filter = separate(share, usual);
            settings.looks = Some(LookSettings { mirror: false, turn: 0.0, ..LookSettings::default() });
        })
    };
    assert_eq!(hand_crafted, upright(0.0));
    assert!(difference(&network, &upright(1.0)) > 0.01);
}

#[test]
fn layers_of_a_network_that_is_not_there_are_left_out() {
    let data = scene(1);
    let frame = Frame::new(&data, WIDTH as u32, HEIGHT as u32, WIDTH, Encoding::Mono8, None).unwrap();
    let trained = |settings| Correlator::new(&settings, None, &frame, &mut Cropper::default(), &TARGET).1;
    assert_eq!(trained(with_network()), trained(AppearanceSettings::default()));
}
