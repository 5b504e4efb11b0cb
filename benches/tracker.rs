//! Time of the parts of a step at the sizes that the default parameters meet, and of whole steps.

use std::hint::black_box;
use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use long_term_tracker::appearance::layers::{Extractor, Feature, LayerSource, LayerSpec};
use long_term_tracker::crop::{Cropper, Patch};
use long_term_tracker::dcf::fft::Fft2;
use long_term_tracker::dcf::masked::{MaskedFilter, MaskedSettings};
use long_term_tracker::dcf::sample::Sample;
use long_term_tracker::dcf::window::{label, mask};
use long_term_tracker::features::FeatureMap;
use long_term_tracker::features::colour_names;
use long_term_tracker::features::hog::Hog;
use long_term_tracker::loader::Request;
use long_term_tracker::params::{Inference, Phase, Value};
use long_term_tracker::trace::{Event, Trace};
use long_term_tracker::{Encoding, Frame, Params, Rect, Session, State};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rustix::time::{ClockId, Timespec, clock_gettime};

const WIDTH: usize = 640;
const HEIGHT: usize = 480;
/// Pixels along the side of a texture's squares.
const GRAIN: usize = 4;
/// Weight of a new sample.
const RATE: f32 = 0.03;
/// The target's path repeats after so many frames.
const PERIOD: usize = 120;
/// Steps after a mark in which something is left to learn of it, and more.
const AFTER_MARK: usize = 20;

/// A person's size: 40 x 80 px.
fn target(frame: usize) -> Rect {
    let angle = std::f64::consts::TAU * (frame % PERIOD) as f64 / PERIOD as f64;
    Rect::around([320.0 + 100.0 * angle.cos(), 240.0 + 60.0 * angle.sin()], [40.0, 80.0])
}

/// A texture of squares, RGB.
fn texture(seed: u64, width: usize, height: usize) -> Vec<u8> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let cols = width.div_ceil(GRAIN);
    let cells: Vec<[u8; 3]> = (0..cols * height.div_ceil(GRAIN)).map(|_| rng.random()).collect();
    (0..width * height).flat_map(|i| cells[i / width / GRAIN * cols + i % width / GRAIN]).collect()
}

/// The frames of a textured target on its way around a textured ground.
fn video() -> Vec<Vec<u8>> {
    let ground = texture(1, WIDTH, HEIGHT);
    let figure = texture(2, 40, 80);
    let place = |k: usize| [target(k).x, target(k).y].map(|v| v.round() as usize);
    (0..PERIOD).map(|k| drawn(&ground, WIDTH, &figure, 40, place(k))).collect()
}

/// A figure, `side` wide, over a ground, `width` wide, with its top left corner at `[x, y]`.
fn drawn(ground: &[u8], width: usize, figure: &[u8], side: usize, [x, y]: [usize; 2]) -> Vec<u8> {
    let mut data = ground.to_vec();
    for (row, line) in figure.chunks_exact(3 * side).enumerate() {
        let at = 3 * ((y + row) * width + x);
        data[at..at + line.len()].copy_from_slice(line);
    }
    data
}

fn frame(data: &[u8]) -> Frame<'_> {
    Frame::new(data, WIDTH as u32, HEIGHT as u32, 3 * WIDTH, Encoding::Rgb8, None).expect("the layout fits")
}

fn features(c: &mut Criterion) {
    let data = texture(1, WIDTH, HEIGHT);
    let frame = frame(&data);
    let window = Rect::around(target(0).centre(), [226.0; 2]);
    for side in [128, 192] {
        let (mut cropper, mut patch) = (Cropper::default(), Patch::default());
        c.bench_function(&format!("crop/{side}"), |b| {
            b.iter(|| cropper.crop(black_box(&frame), &window, side, side, &mut patch))
        });
        let (mut hog, mut map) = (Hog::default(), FeatureMap::default());
        c.bench_function(&format!("hog/{side}"), |b| b.iter(|| hog.compute(black_box(&patch), &mut map)));
        c.bench_function(&format!("colour_names/{side}"), |b| {
            b.iter(|| colour_names::compute(black_box(&patch), &mut map))
        });
    }
}

fn filter(c: &mut Criterion) {
    let data = video().swap_remove(0);
    let frame = frame(&data);
    let window = Rect::around(target(0).centre(), [226.0; 2]);
    let specs = [
        LayerSpec::scaled(LayerSource::Cells(vec![Feature::Hog]), Some(16), 1.0),
        LayerSpec::scaled(LayerSource::Cells(vec![Feature::ColourNames]), Some(10), 0.5),
    ];
    for cells in [32, 48] {
        let mut cropper = Cropper::default();
        let mut fft = Fft2::new(cells, cells);
        let mut extractor = Extractor::fit(&specs, None, cells, cells, &frame, &window, &mut cropper);
        let mut sample = Sample::default();
        extractor.extract(&frame, &window, &mut cropper, &mut fft, &mut sample);
        c.bench_function(&format!("extract/{cells}"), |b| {
            b.iter(|| extractor.extract(black_box(&frame), &window, &mut cropper, &mut fft, &mut sample))
        });
        let scale = cells as f64 / window.w;
        let (w, h) = (40.0 * scale, 80.0 * scale);
        let y = label(cells, cells, 0.1 * (w * h).sqrt());
        let m = mask(cells, cells, 1.2 * w, 1.2 * h);
        let settings = MaskedSettings { looks: 5, memory: 20, first_weight: 0.1, regularisation: 0.05 };
        let mut filter = MaskedFilter::new(settings, &mut fft, 0..extractor.channels(), &y, &m);
        for _ in 0..settings.memory {
            filter.learn(&mut fft, &sample, RATE, 1);
        }
        c.bench_function(&format!("filter/learn/{cells}"), |b| {
            b.iter(|| filter.learn(&mut fft, black_box(&sample), RATE, 3))
        });
        let mut response = vec![0.0; cells * cells];
        c.bench_function(&format!("filter/respond/{cells}"), |b| {
            b.iter(|| filter.respond(&mut fft, black_box(&sample), &mut response))
        });
    }
}

/// The embedded network. `ORT_DYLIB_PATH` names ONNX Runtime's library; without it, only the built-in library runs.
fn network(c: &mut Criterion) {
    let data = video().swap_remove(0);
    let frame = frame(&data);
    let window = Rect::around(target(0).centre(), [226.0; 2]);
    for (name, inference) in [("builtin", Inference::Builtin), ("onnxruntime", Inference::OnnxRuntime)] {
        for side in [128, 192, 224] {
            let mut request = Request::new(&Params::default().lcmht.cnn, u64::MAX);
            (request.settings.side, request.runner.inference) = (side, inference);
            let Ok(mut cnn) = request.load() else { continue };
            let (mut cropper, mut maps) = (Cropper::default(), Vec::new());
            c.bench_function(&format!("network/{name}/{side}"), |b| {
                b.iter(|| cnn.compute(black_box(&frame), &window, &mut cropper, &mut maps))
            });
        }
    }
}

fn step(c: &mut Criterion) {
    let video = video();
    let mut session = Session::new(Params::default()).expect("the default parameters name no file");
    session.start(&frame(&video[0]), target(0), &mut ()).expect("the target is in view");
    let mut k = 0;
    c.bench_function("step", |b| {
        b.iter(|| {
            k += 1;
            session.step(&frame(&video[k % PERIOD]), &mut ()).targets[0].rect
        })
    });
    let found = &session.output().targets[0];
    assert!(found.state == State::Tracking && found.rect.iou(&target(k)) > 0.5, "{found:?} was not on the target");
}

/// Looks inside every step, which keeps the targets in order.
struct Watching;

impl Trace for Watching {
    fn event(&mut self, _: Event) {}
}

/// Steps of several targets, followed at once and one after the other: with the built-in network and without.
fn several(c: &mut Criterion) {
    let video = video();
    let (most, inference) = (Value::Integer(4), Value::String("builtin".into()));
    for (name, network) in [("builtin", true), ("none", false)] {
        let network = Value::Bool(network);
        let changes = [("max_targets", &most), ("lcmht.cnn.inference", &inference), ("lcmht.cnn.enabled", &network)];
        let params = Params::default().with(changes, Phase::StartUp).expect("values in range");
        for count in [1, 2, 4] {
            for order in ["at_once", "in_order"] {
                let trace: &mut dyn Trace = if order == "at_once" { &mut () } else { &mut Watching };
                let mut session = Session::new(params.clone()).expect("the default parameters name no file");
                for id in 0..count {
                    let id = id.to_string();
                    session.start_as(Some(&id), &frame(&video[0]), target(0), trace).expect("the target is in view");
                }
                let mut k = 0;
                c.bench_function(&format!("several/{name}/{count}/{order}"), |b| {
                    b.iter(|| {
                        k += 1;
                        session.step(&frame(&video[k % PERIOD]), trace).targets.len()
                    })
                });
            }
        }
    }
}

/// A mark, and the steps in which altered looks at the first frame are learned, in processor time: of the default by
/// either library, and of it without the network.
fn start(c: &mut Criterion) {
    let video = video();
    let text = |v: &str| Value::String(v.into());
    let cases = [
        ("builtin", ("lcmht.cnn.inference", text("builtin"))),
        ("onnxruntime", ("lcmht.cnn.inference", text("onnxruntime"))),
        ("fast", ("lcmht.cnn.enabled", Value::Bool(false))),
    ];
    for (name, (parameter, value)) in cases {
        let params = Params::default().with([(parameter, &value)], Phase::StartUp).expect("the parameter is known");
        // ONNX Runtime may be missing.
        let Ok(mut session) = Session::new(params) else { continue };
        let mark = |session: &mut Session| {
            let begun = clock_gettime(ClockId::ProcessCPUTime);
            session.start(&frame(&video[0]), target(0), &mut ()).expect("the target is in view");
            processor_time_since(begun)
        };
        c.bench_function(&format!("start/{name}"), |b| b.iter_custom(|n| (0..n).map(|_| mark(&mut session)).sum()));
        // The dearest of the steps after a mark.
        c.bench_function(&format!("start/{name}/dearest_step"), |b| {
            b.iter_custom(|n| {
                let mut dearest = |_| {
                    mark(&mut session);
                    let step = |k: usize| {
                        let begun = clock_gettime(ClockId::ProcessCPUTime);
                        session.step(&frame(&video[k]), &mut ());
                        processor_time_since(begun)
                    };
                    (1..AFTER_MARK).map(step).max().unwrap_or_default()
                };
                (0..n).map(&mut dearest).sum()
            })
        });
    }
}

fn processor_time_since(begun: Timespec) -> Duration {
    let seconds = |t: Timespec| Duration::new(t.tv_sec as u64, t.tv_nsec as u32);
    seconds(clock_gettime(ClockId::ProcessCPUTime)) - seconds(begun)
}

/// Steps without the network: of the same target in images of any size, and of targets of any size in the same image.
/// All move by a pixel a frame.
fn sizes(c: &mut Criterion) {
    let params = Params::default().with([("lcmht.cnn.enabled", &Value::Bool(false))], Phase::StartUp);
    let params = params.expect("the network can be left out");
    let images = [[320, 240], [640, 480], [1280, 720], [1920, 1080], [3840, 2160]];
    let images = images.map(|image| (format!("image/{}x{}", image[0], image[1]), image, 40));
    let targets = [20, 40, 80, 160].map(|side| (format!("target/{side}"), [1280, 960], side));
    for (name, [width, height], side) in images.into_iter().chain(targets) {
        let (ground, figure) = (texture(1, width, height), texture(2, side, side));
        let video: Vec<Vec<u8>> = (0..8).map(|k| drawn(&ground, width, &figure, side, [40 + k, 40])).collect();
        let frame = |k: usize| {
            let data = &video[if k % 14 < 8 { k % 14 } else { 14 - k % 14 }];
            Frame::new(data, width as u32, height as u32, 3 * width, Encoding::Rgb8, None).expect("the layout fits")
        };
        let mut session = Session::new(params.clone()).expect("no file is named");
        let start = Rect::new(40.0, 40.0, side as f64, side as f64);
        session.start(&frame(0), start, &mut ()).expect("the target is in view");
        let mut k = 0;
        c.bench_function(&format!("step/{name}"), |b| {
            b.iter(|| {
                k += 1;
                session.step(&frame(k), &mut ()).targets[0].rect
            })
        });
        assert_eq!(session.output().targets[0].state, State::Tracking, "{name}");
    }
}

/// Steps of MAPTrack with ten targets, which cross a picture of 768 x 576.
fn many(c: &mut Criterion) {
    const SIZE: [usize; 2] = [768, 576];
    const COUNT: usize = 10;
    let algorithm = Value::String("maptrack".into());
    let params = Params::default().with([("algorithm", &algorithm)], Phase::StartUp).expect("the tracker is known");
    let ground: Vec<u8> = texture(1, SIZE[0], SIZE[1]).iter().map(|v| 100 + v / 8).collect();
    let figures: Vec<Vec<u8>> = (0..COUNT as u64).map(|i| texture(2 + i, 25, 50)).collect();
    // Every second one goes to the left.
    let place = |i: usize, k: usize| [if i.is_multiple_of(2) { 50 + 3 * k } else { 690 - 3 * k }, 10 + 55 * i];
    let drawn = |data: Vec<u8>, i: usize, k: usize| drawn(&data, SIZE[0], &figures[i], 25, place(i, k));
    let video: Vec<Vec<u8>> =
        (0..PERIOD).map(|k| (0..COUNT).fold(ground.clone(), |data, i| drawn(data, i, k))).collect();
    let frame = |k: usize| {
        let there_and_back = if (k / PERIOD).is_multiple_of(2) { k % PERIOD } else { PERIOD - 1 - k % PERIOD };
        Frame::new(&video[there_and_back], SIZE[0] as u32, SIZE[1] as u32, 3 * SIZE[0], Encoding::Rgb8, None)
            .expect("the layout fits")
    };
    let mut session = Session::new(params).expect("no file is named");
    session.step(
        &Frame::new(&ground, SIZE[0] as u32, SIZE[1] as u32, 3 * SIZE[0], Encoding::Rgb8, None).unwrap(),
        &mut (),
    );
    let mut k = 0;
    let mut most = 0;
    c.bench_function("maptrack/10", |b| {
        b.iter(|| {
            k += 1;
            most = most.max(session.step(&frame(k), &mut ()).targets.len());
        })
    });
    assert!(most == 0 || most >= COUNT, "{most} targets");
    eprintln!("maptrack/10: {} targets at the end, {most} at most", session.output().targets.len());
}

criterion_group!(benches, features, filter, network, step, several, start, sizes, many);
criterion_main!(benches);
