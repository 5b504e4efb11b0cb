//! Networks from files: what they compute, and what is said of those that cannot be used.

#[path = "network/message.rs"]
mod message;
#[path = "network/onnx.rs"]
mod onnx;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;

use long_term_tracker::crop::Cropper;
use long_term_tracker::features::FeatureMap;
use long_term_tracker::loader::{Loaded, Request, Runner};
use long_term_tracker::network::NetworkSettings;
use long_term_tracker::params::{Inference, Phase, Value};
use long_term_tracker::{Encoding, Frame, NetworkError, Params, Rect, Session};
use onnx::{Convolution, network};

/// Rows and columns of the input.
const SIDE: usize = 32;
/// Largest difference of a value computed by another order of sums, in units of the map's root mean square.
const TOLERANCE: f32 = 1e-4;

/// Repeatable values in -1..1.
fn noise(seed: u32, count: usize) -> Vec<f32> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1 << 23) as f32 - 1.0
    };
    (0..count).map(|_| next()).collect()
}

fn pixels(width: usize, height: usize) -> Vec<u8> {
    noise(5, width * height * 3).iter().map(|v| (127.5 + 127.5 * v) as u8).collect()
}

fn convolution(name: &'static str, stride: usize, inputs: usize, outputs: usize) -> Convolution {
    Convolution { name, stride, inputs, outputs, weights: noise(inputs as u32, outputs * inputs * 9) }
}

/// Two layers, at strides 2 and 4.
fn two_layers() -> Vec<Convolution> {
    vec![convolution("near", 2, 3, 4), convolution("far", 2, 4, 5)]
}

fn request(file: Option<&Path>, outputs: &[&str]) -> Request {
    Request {
        file: file.map(Path::to_owned),
        most: u64::MAX,
        runner: Runner { inference: Inference::Builtin, library: None },
        settings: NetworkSettings {
            side: SIDE,
            mean: [127.0, 100.0, 90.0],
            scale: [128.0, 64.0, 32.0],
            bgr: false,
            outputs: outputs.iter().map(|&name| name.to_owned()).collect(),
            threads: 1,
        },
    }
}

fn maps(request: &Request, frame: &Frame) -> Vec<FeatureMap> {
    let mut cnn = request.load().unwrap();
    let mut maps = Vec::new();
    cnn.compute(frame, &frame.bounds(), &mut Cropper::default(), &mut maps).unwrap();
    maps
}

fn file(folder: &tempfile::TempDir, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

/// A convolution by its definition, over `channels x side x side`.
fn convolve(image: &[f32], side: usize, layer: &Convolution) -> Vec<f32> {
    let count = side / layer.stride;
    let mut out = Vec::new();
    for o in 0..layer.outputs {
        for row in 0..count {
            for col in 0..count {
                let mut sum = 0.0f64;
                for i in 0..layer.inputs {
                    for (k, &weight) in layer.weights[(o * layer.inputs + i) * 9..][..9].iter().enumerate() {
                        let (y, x) = (row * layer.stride + k / 3, col * layer.stride + k % 3);
                        if (1..=side).contains(&y) && (1..=side).contains(&x) {
                            sum += f64::from(weight) * f64::from(image[(i * side + y - 1) * side + x - 1]);
                        }
                    }
                }
                out.push(sum as f32);
            }
        }
    }
    out
}

fn assert_close(got: &[f32], want: &[f32]) {
    assert_eq!(got.len(), want.len());
    let size = (want.iter().map(|v| v * v).sum::<f32>() / want.len() as f32).sqrt();
    for (i, (g, w)) in got.iter().zip(want).enumerate() {
        assert!((g - w).abs() < TOLERANCE * size, "value {i}: {g}, expected {w}; they are about {size}");
    }
}

#[test]
fn maps_are_what_the_network_computes_of_the_normalised_window() {
    let folder = tempfile::tempdir().unwrap();
    let layers = two_layers();
    let path = file(&folder, "two.onnx", &network(&[1, 3, 0, 0], &layers));
    let data = pixels(SIDE, SIDE);
    for (encoding, bgr) in [(Encoding::Rgb8, false), (Encoding::Rgb8, true), (Encoding::Bgr8, false)] {
        let frame = Frame::new(&data, SIDE as u32, SIDE as u32, 3 * SIDE, encoding, None).unwrap();
        let mut request = request(Some(&path), &["far", "near"]);
        request.settings.bgr = bgr;
        let NetworkSettings { mean, scale, .. } = request.settings;
        let mut image = vec![0.0; 3 * SIDE * SIDE];
        for (i, value) in image.iter_mut().enumerate() {
            let (channel, y, x) = (i / (SIDE * SIDE), i / SIDE % SIDE, i % SIDE);
            let colour = frame.rgb(x, y)[if bgr { 2 - channel } else { channel }];
            *value = (f32::from(colour) - mean[channel]) / scale[channel];
        }
        let near = convolve(&image, SIDE, &layers[0]);
        let far = convolve(&near, SIDE / 2, &layers[1]);
        let got = maps(&request, &frame);
        assert_eq!(got.iter().map(|m| [m.channels, m.rows, m.cols]).collect::<Vec<_>>(), [[5, 8, 8], [4, 16, 16]]);
        assert_close(&got[0].data, &far);
        assert_close(&got[1].data, &near);
    }
}

#[test]
fn frames_without_colour_are_grey() {
    let grey: Vec<u8> = pixels(SIDE, SIDE)[..SIDE * SIDE].to_vec();
    let colour: Vec<u8> = grey.iter().flat_map(|&v| [v; 3]).collect();
    let side = SIDE as u32;
    let grey = Frame::new(&grey, side, side, SIDE, Encoding::Mono8, None).unwrap();
    let colour = Frame::new(&colour, side, side, 3 * SIDE, Encoding::Rgb8, None).unwrap();
    let embedded = request(None, &["block4", "block10"]);
    assert_eq!(maps(&embedded, &grey), maps(&embedded, &colour));
}

#[test]
fn the_embedded_network_has_the_strides_and_channels_it_is_said_to_have() {
    let data = pixels(64, 64);
    let frame = Frame::new(&data, 64, 64, 192, Encoding::Rgb8, None).unwrap();
    let mut request = request(None, &["block4", "block10"]);
    request.settings.side = 128;
    let shapes: Vec<_> = maps(&request, &frame).iter().map(|m| [m.channels, m.rows, m.cols]).collect();
    assert_eq!(shapes, [[40, 16, 16], [112, 8, 8]]);
}

/// Each fault, and what is said of it.
#[test]
fn a_network_that_cannot_be_used_is_refused_with_its_name_and_what_was_expected() {
    let folder = tempfile::tempdir().unwrap();
    let good = || network(&[1, 3, 0, 0], &two_layers());
    let mut nan = two_layers();
    nan[1].weights[7] = f32::NAN;
    let cases: [(&str, Vec<u8>, &str); 6] = [
        ("words.onnx", b"no network at all".to_vec(), "expected an ONNX network that takes an image"),
        ("cut.onnx", good()[..200].to_vec(), "expected an ONNX network that takes an image"),
        ("empty.onnx", Vec::new(), "expected an ONNX network that takes an image"),
        (
            "size.onnx",
            network(&[1, 3, 48, 48], &two_layers()),
            "takes 1 x 3 x 48 x 48, expected one image of 1 x 3 x 32 x 32",
        ),
        (
            "grey.onnx",
            network(&[1, 1, 0, 0], &[convolution("far", 2, 1, 4)]),
            "takes 1 x 1 x ? x ?, expected one image of 1 x 3 x 32 x 32",
        ),
        ("nan.onnx", network(&[1, 3, 0, 0], &nan), "non-finite values at output 'far', expected weights without NaN"),
    ];
    for (name, bytes, why) in cases {
        let path = file(&folder, name, &bytes);
        let said = refusal(&request(Some(&path), &["far"]));
        assert!(said.contains(why) && said.contains(&path.display().to_string()), "{name}: {said}");
        assert_eq!(said.lines().count(), 1, "{said}");
    }
    let path = file(&folder, "good.onnx", &good());
    let said = refusal(&request(Some(&path), &["far", "fat"]));
    assert!(said.ends_with("has no output 'fat', expected one of near, far"), "{said}");
    let said = refusal(&request(Some(Path::new("/no/such.onnx")), &["far"]));
    assert!(said.starts_with("network /no/such.onnx cannot be read"), "{said}");
}

fn refusal(request: &Request) -> String {
    request.load().expect_err("a refusal").to_string()
}

/// The parameters with these changed.
fn params(changes: &[(&str, Value)]) -> Params {
    Params::default().with(changes.iter().map(|(name, value)| (*name, value)), Phase::StartUp).unwrap()
}

#[test]
fn a_change_to_a_bad_file_is_refused_and_the_track_goes_on() {
    let data = pixels(160, 120);
    let frame = Frame::new(&data, 160, 120, 480, Encoding::Rgb8, None).unwrap();
    let network = |file: &str| {
        params(&[
            ("lcmht.cnn.enabled", Value::Bool(true)),
            ("lcmht.cnn.inference", Value::String("builtin".into())),
            ("lcmht.cnn.file", Value::String(file.into())),
        ])
    };
    let mut steady = Session::new(network("")).unwrap();
    let mut disturbed = Session::new(network("")).unwrap();
    for session in [&mut steady, &mut disturbed] {
        session.start(&frame, Rect::new(60.0, 40.0, 30.0, 40.0), &mut ()).unwrap();
    }
    let refused = Loaded::new(&network("/no/such.onnx"));
    assert!(matches!(refused, Err(NetworkError::Unreadable { .. })), "{refused:?}");
    assert_eq!(disturbed.params().lcmht.cnn.file, "");
    for _ in 0..3 {
        assert_eq!(steady.step(&frame, &mut ()), disturbed.step(&frame, &mut ()));
    }
    assert!(Session::new(network("/no/such.onnx")).is_err());
}

#[test]
fn the_network_can_be_switched_while_a_target_is_followed() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(&folder, "two.onnx", &network(&[1, 3, 0, 0], &two_layers()));
    let data = pixels(160, 120);
    let frame = Frame::new(&data, 160, 120, 480, Encoding::Rgb8, None).unwrap();
    let with = |enabled: bool, file: &str, outputs: [&str; 2]| {
        params(&[
            ("lcmht.cnn.enabled", Value::Bool(enabled)),
            ("lcmht.cnn.inference", Value::String("builtin".into())),
            ("lcmht.cnn.file", Value::String(file.into())),
            ("lcmht.cnn.outputs", Value::StringArray(outputs.map(String::from).to_vec())),
            ("lcmht.cnn.weights", Value::DoubleArray(vec![0.5, 1.0])),
            ("lcmht.cnn.components", Value::IntegerArray(vec![0, 3])),
        ])
    };
    let mut session = Session::new(with(false, "", ["block4", "block10"])).unwrap();
    let rect = Rect::new(60.0, 40.0, 30.0, 40.0);
    session.start(&frame, rect, &mut ()).unwrap();
    for change in [
        with(true, "", ["block4", "block10"]),
        with(true, path.to_str().unwrap(), ["near", "far"]),
        with(false, "", ["block4", "block10"]),
    ] {
        let network = Loaded::new(&change).unwrap().networks();
        session.retune(change, network);
        for _ in 0..2 {
            assert!(session.step(&frame, &mut ()).targets[0].rect.iou(&rect) > 0.8);
        }
    }
}

#[test]
fn a_change_that_leaves_the_network_alone_is_suited_by_the_one_there_is() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(&folder, "two.onnx", &network(&[1, 3, 0, 0], &two_layers()));
    let with = |share: f64, outputs: [&str; 2]| {
        params(&[
            ("lcmht.cnn.inference", Value::String("builtin".into())),
            ("lcmht.cnn.file", Value::String(path.to_str().unwrap().into())),
            ("lcmht.cnn.outputs", Value::StringArray(outputs.map(String::from).to_vec())),
            ("lcmht.cnn.components", Value::IntegerArray(vec![0, 3])),
            ("lcmht.cnn.share", Value::Double(share)),
        ])
    };
    let loaded = Loaded::new(&with(0.2, ["near", "far"])).unwrap();
    assert!(loaded.suits(&with(0.5, ["near", "far"])));
    // What makes another network of it is tried.
    assert!(!loaded.suits(&with(0.2, ["far", "near"])));
    std::fs::remove_file(&path).unwrap();
    let other = Loaded::new(&with(0.2, ["far", "near"]));
    assert!(matches!(other, Err(NetworkError::Unreadable { .. })), "{other:?}");
}

/// As the node does it: what takes long is done by another thread while frames go on.
#[test]
fn a_network_that_was_loaded_beside_is_taken_over_without_loading_it_again() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(&folder, "two.onnx", &network(&[1, 3, 0, 0], &two_layers()));
    let with = |outputs: [&str; 2]| {
        params(&[
            ("lcmht.cnn.inference", Value::String("builtin".into())),
            ("lcmht.cnn.file", Value::String(path.to_str().unwrap().into())),
            ("lcmht.cnn.outputs", Value::StringArray(outputs.map(String::from).to_vec())),
            ("lcmht.cnn.components", Value::IntegerArray(vec![0, 3])),
        ])
    };
    let (first, then) = (with(["near", "far"]), with(["far", "near"]));
    let data = pixels(160, 120);
    let frame = Frame::new(&data, 160, 120, 480, Encoding::Rgb8, None).unwrap();
    let mut session = Session::new(first.clone()).unwrap();
    let rect = Rect::new(60.0, 40.0, 30.0, 40.0);
    session.start(&frame, rect, &mut ()).unwrap();
    let loaded = std::thread::scope(|scope| scope.spawn(|| Loaded::new(&then)).join().unwrap()).unwrap();
    std::fs::remove_file(&path).unwrap();
    session.retune(then, loaded.networks());
    assert!(Arc::ptr_eq(&session.networks().cnn.unwrap(), &loaded.networks().cnn.unwrap()));
    for _ in 0..3 {
        assert!(session.step(&frame, &mut ()).targets[0].rect.iou(&rect) > 0.8);
    }
}

/// The offline command ends with one line that names the file, and not with success.
#[test]
fn the_command_ends_with_an_error_where_the_network_is_bad() {
    let folder = tempfile::tempdir().unwrap();
    let images = folder.path().join("images");
    std::fs::create_dir(&images).unwrap();
    image::RgbImage::from_raw(64, 64, pixels(64, 64)).unwrap().save(images.join("1.png")).unwrap();
    let path = file(&folder, "words.onnx", b"no network at all");
    let output = Command::new(env!("CARGO_BIN_EXE_track"))
        .arg(&images)
        .args(["--init", "20,20,20,20", "-p", "lcmht.cnn.enabled:=true", "-p"])
        .arg(format!("lcmht.cnn.file:={}", path.display()))
        .output()
        .unwrap();
    assert_ne!(output.status.code(), Some(0));
    let text = String::from_utf8(output.stderr).unwrap();
    let line = text.lines().find(|line| line.contains("words.onnx")).expect("a line that names the file");
    assert!(line.contains("expected an ONNX network that takes an image"), "{text}");
}
