//! The matching networks: alone they give the boxes of the published tracker, in the tracker they do what they are for.

use std::path::Path;
use std::sync::{Arc, Mutex};

use long_term_tracker::appearance::layers::SeenByNetwork;
use long_term_tracker::appearance::matching::{Matcher, ShortTerm};
use long_term_tracker::crop::Cropper;
use long_term_tracker::geometry::distance;
use long_term_tracker::loader::{Loaded, MatchingRequest};
use long_term_tracker::network::{Framing, MatchingForm, Networks, SharedMatching, locked};
use long_term_tracker::params::{Params, Phase, Value};
use long_term_tracker::replay;
use long_term_tracker::{Encoding, Frame, Rect, Session, State};

#[path = "network/message.rs"]
mod message;
#[path = "support/models.rs"]
mod models;
#[path = "support/sequences.rs"]
mod sequences;
#[path = "network/siamese.rs"]
mod siamese;

/// Sequences on which the networks alone are held against the published tracker.
const TWINS: [&str; 10] = [
    "Couple",
    "Crossing",
    "DAVIS-bmx-trees",
    "DAVIS-camel",
    "DAVIS-libby",
    "DTB-Surfing06",
    "Deer",
    "Football1",
    "OTB-KiteSurf",
    "OTB-Man",
];

fn boxes(file: &Path) -> Vec<Rect> {
    let text = std::fs::read_to_string(file).unwrap();
    let rect = |line: &str| {
        let v: Vec<f64> = line.split(',').take(4).map(|v| v.trim().parse().unwrap()).collect();
        Rect::new(v[0], v[1], v[2], v[3])
    };
    text.lines().map(rect).collect()
}

/// Parameters that name these files. The filter has hand-crafted layers alone.
fn params([backbone, head]: [&Path; 2], inference: &str, enabled: bool) -> Params {
    let text = |path: &Path| Value::String(path.display().to_string());
    let changes = [
        ("lcmht.cnn.enabled", Value::Bool(false)),
        ("lcmht.matching.enabled", Value::Bool(enabled)),
        ("lcmht.matching.backbone", text(backbone)),
        ("lcmht.matching.head", text(head)),
        ("lcmht.cnn.inference", Value::String(inference.to_owned())),
    ];
    Params::default().with(changes.iter().map(|(name, value)| (*name, value)), Phase::StartUp).unwrap()
}

/// The networks in these files.
fn networks(files: [&Path; 2], inference: &str) -> SharedMatching {
    Arc::new(Mutex::new(MatchingRequest::of(&params(files, inference, true)).unwrap().load(None).unwrap()))
}

/// The boxes of the short-term tracker that the networks are published with, each from the published box of the frame
/// before.
fn alone(network: &SharedMatching, sequence: &Path, published: &[Rect]) -> Vec<Rect> {
    let mut source = replay::open(sequence, None, &Params::default().limits).unwrap();
    let (mut cropper, mut boxes) = (Cropper::default(), Vec::new());
    let mut matcher = None;
    for k in 0..published.len() {
        let buffer = source.next_frame().unwrap().unwrap();
        let frame = buffer.frame();
        match &mut matcher {
            None => matcher = Some(Matcher::new(network.clone(), &frame, &mut cropper, &published[0])),
            Some(matcher) => {
                let shift = if k == 1 { 0.0 } else { HALF_A_PIXEL };
                let before = published[k - 1].shifted(shift, shift);
                boxes.push(ShortTerm::NANOTRACK_V3.step(matcher, &frame, &mut cropper, &before));
            }
        }
    }
    boxes
}

/// The published tracker counts from the centres of pixels, and gives the corner of a box as if it counted from their
/// corners.
const HALF_A_PIXEL: f64 = 0.5;

/// Share of the frames in which a box must lie within a pixel of the published one. JPEG decoders differ by a level of
/// intensity or so, which now and then lets another cell be the best.
const WITHIN: f64 = 0.95;

#[test]
fn the_networks_alone_give_the_boxes_of_the_published_tracker() {
    let Some(files) = models::nanotrack(3) else { return };
    let network = networks(files.each_ref().map(|file| file.as_path()), "auto");
    for name in TWINS {
        let Some(sequence) = sequences::sequence(name) else { return };
        let wanted = boxes(&sequence.parent().unwrap().join("_peers/NanoTrackV3").join(format!("{name}.txt")));
        let got = alone(&network, &sequence, &wanted);
        let off = |(a, b): (&Rect, &Rect)| {
            let off = [a.x - b.x - HALF_A_PIXEL, a.y - b.y - HALF_A_PIXEL, a.w - b.w, a.h - b.h];
            off.iter().fold(0.0f64, |most, d| most.max(d.abs()))
        };
        let mut offs: Vec<f64> = got.iter().zip(&wanted[1..]).map(off).collect();
        offs.sort_by(f64::total_cmp);
        let share = |share: f64| offs[(share * offs.len() as f64) as usize];
        assert!(share(0.5) < 0.25 && share(0.9) < 0.5 && share(WITHIN) <= 1.0, "{name}: {offs:.2?}");
    }
}

#[test]
fn both_published_versions_tell_their_sizes() {
    let sizes = [(2, 16), (3, 15)];
    for (version, cells) in sizes {
        let Some(files) = models::nanotrack(version) else { return };
        let network = networks(files.each_ref().map(|file| file.as_path()), "builtin");
        assert_eq!(
            *locked(&network).form(),
            MatchingForm { framing: Framing::Context, template: 127, window: 255, stride: 16, cells }
        );
    }
}

const WIDTH: usize = 320;
const HEIGHT: usize = 240;

/// A square with a texture of its own before a ground of one colour.
fn scene(target: &Rect) -> Vec<u8> {
    let [columns, rows] = target.pixels([WIDTH, HEIGHT]);
    let mut data = vec![110u8; WIDTH * HEIGHT * 3];
    for (y, row) in rows.clone().enumerate() {
        for (x, column) in columns.clone().enumerate() {
            for channel in 0..3 {
                let value = (x / 16 * 73 + y / 16 * 151 + channel * 97) % 256;
                data[(row * WIDTH + column) * 3 + channel] = value as u8;
            }
        }
    }
    data
}

fn frame(data: &[u8]) -> Frame<'_> {
    Frame::new(data, WIDTH as u32, HEIGHT as u32, 3 * WIDTH, Encoding::Rgb8, None).unwrap()
}

/// The place of the best match is where the target went, in the box that the head tells.
#[test]
fn a_seeded_pair_finds_a_target_where_it_went() {
    let files = siamese::files();
    let network = networks(files.each_ref().map(|file| file.path()), "builtin");
    let form = *locked(&network).form();
    let framing = Framing::Context;
    assert_eq!(form, MatchingForm { framing, template: 127, window: 255, stride: 16, cells: siamese::ANSWER });
    let mut cropper = Cropper::default();
    let target = Rect::new(140.0, 100.0, 48.0, 48.0);
    let mut matcher = Matcher::new(network, &frame(&scene(&target)), &mut cropper, &target);
    // A cell is 16 px of a window of 255 that shows 4 target sizes: 12 px here.
    for shift in [[0.0, 0.0], [24.0, 0.0], [-36.0, 24.0], [12.0, -48.0]] {
        let there = target.shifted(shift[0], shift[1]);
        matcher.look(&frame(&scene(&there)), &mut cropper, target.centre(), target.size(), None);
        let best = matcher.matches().iter().max_by(|a, b| a.score.total_cmp(&b.score)).unwrap();
        let off = distance(best.rect.centre(), there.centre());
        assert!(off < 3.0, "{shift:?}: {} is {off} px from {there}", best.rect);
        assert!((best.rect.w - 48.0).abs() < 1.0 && (best.rect.h - 48.0).abs() < 1.0, "{}", best.rect);
    }
}

#[test]
fn the_tracker_follows_with_a_pair_of_networks_and_goes_on_without() {
    let files = siamese::files();
    let params = |enabled| params(files.each_ref().map(|file| file.path()), "builtin", enabled);
    // It goes by whole cells of the answer, for the seeded features tell no less.
    let target = |k: usize| Rect::new(100.0 + 12.0 * (k / 6) as f64, 90.0, 48.0, 48.0);
    let mut session = Session::new(params(true)).unwrap();
    for k in 0..40 {
        let data = scene(&target(k));
        if k == 0 {
            session.start(&frame(&data), target(k), &mut ()).unwrap();
        } else {
            session.step(&frame(&data), &mut ());
        }
        if k == 20 {
            session.retune(params(false), Networks::default());
        }
        let said = &session.output().targets[0];
        assert!(said.state == State::Tracking && said.rect.iou(&target(k)) > 0.6, "frame {k}: {said:?}");
    }
}

/// One run of the embedded network serves layers and head: the head gives what it gives after a run of its own, bit for
/// bit.
#[test]
fn maps_that_layers_are_made_of_serve_the_embedded_head_as_well() {
    for inference in ["builtin", "auto"] {
        let changes =
            [("lcmht.matching.enabled", Value::Bool(true)), ("lcmht.cnn.inference", Value::String(inference.into()))];
        let params = Params::default().with(changes.iter().map(|(name, v)| (*name, v)), Phase::StartUp).unwrap();
        let Networks { cnn, matching } = Loaded::new(&params).unwrap().networks();
        let (cnn, matching) = (cnn.unwrap(), matching.unwrap());
        assert!(locked(&matching).is_on(&cnn), "the default's layers and head share a network");
        let (target, mut cropper) = (Rect::new(140.0, 100.0, 30.0, 60.0), Cropper::default());
        let mut matcher = Matcher::new(matching, &frame(&scene(&target)), &mut cropper, &target);
        let data = scene(&target.shifted(9.0, -7.0));
        let side = 4.0 * (target.w * target.h).sqrt();
        let window = Rect::around(target.centre(), [side; 2]);
        let mut maps = Vec::new();
        locked(&cnn).compute(&frame(&data), &window, &mut cropper, &mut maps).unwrap();
        let seen = SeenByNetwork { cnn: &cnn, window, maps: &maps };
        matcher.look(&frame(&data), &mut cropper, target.centre(), target.size(), Some(seen));
        let shared = matcher.matches().to_vec();
        // Another window of the same network is of no use.
        let elsewhere = Rect::around([20.0, 20.0], [side; 2]);
        locked(&cnn).compute(&frame(&data), &elsewhere, &mut cropper, &mut maps).unwrap();
        let seen = SeenByNetwork { cnn: &cnn, window: elsewhere, maps: &maps };
        matcher.look(&frame(&data), &mut cropper, target.centre(), target.size(), Some(seen));
        assert_eq!(matcher.matches(), shared);
        let best = shared.iter().max_by(|a, b| a.score.total_cmp(&b.score)).unwrap();
        assert!(best.rect.iou(&target.shifted(9.0, -7.0)) > 0.5, "{best:?}");
    }
}

#[test]
fn files_that_are_no_such_pair_are_refused_with_what_is_wrong() {
    let [backbone, head] = siamese::files();
    let none = Path::new("");
    let missing = Path::new("/no/such.onnx");
    let refused = |backbone: &Path, head: &Path| {
        let params = params([backbone, head], "builtin", true);
        MatchingRequest::of(&params).unwrap().load(None).unwrap_err().to_string()
    };
    let cases = [
        (none, head.path(), "lcmht.matching.backbone"),
        (backbone.path(), none, "lcmht.matching.head"),
        (missing, head.path(), "/no/such.onnx"),
        // The one taken for the other.
        (head.path(), backbone.path(), "does not take exactly one input"),
        (backbone.path(), backbone.path(), "has 1 outputs"),
    ];
    for (backbone, head, part) in cases {
        let why = refused(backbone, head);
        assert!(why.contains(part) && why.lines().count() == 1, "{why}, not {part}");
    }
}
