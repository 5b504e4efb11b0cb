//! Networks run by ONNX Runtime, from the package for Python: the same features and the same refusals as by the
//! built-in library; and VGG-19, the paper's own network, end to end.

#![cfg(feature = "onnxruntime")]

#[path = "network/message.rs"]
mod message;
#[path = "network/onnx.rs"]
mod onnx;
#[path = "network/python.rs"]
mod python;

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use long_term_tracker::crop::Cropper;
use long_term_tracker::features::FeatureMap;
use long_term_tracker::loader::{Request, Runner};
use long_term_tracker::network::NetworkSettings;
use long_term_tracker::params::{Inference, NodeName, Phase, Value, file};
use long_term_tracker::{Encoding, Frame, Params, Rect, Session};
use onnx::{Convolution, network};

/// How far the two may differ, as a share of a map's root mean square.
const TOLERANCE: f32 = 1e-4;

static LIBRARY: LazyLock<PathBuf> = LazyLock::new(python::onnxruntime);
/// VGG-19 with random weights.
static VGG: LazyLock<PathBuf> = LazyLock::new(|| {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("vgg19-seeded.onnx");
    python::script("assets/export_vgg19.py", &["--seed", "7", path.to_str().expect("a path in UTF-8")]);
    path
});

const BACK_ENDS: [Inference; 2] = [Inference::Builtin, Inference::OnnxRuntime];

fn request(file: Option<&Path>, side: usize, outputs: &[&str], inference: Inference) -> Request {
    Request {
        file: file.map(Path::to_owned),
        most: u64::MAX,
        runner: Runner { inference, library: Some(LIBRARY.clone()) },
        settings: NetworkSettings {
            side,
            mean: [127.0; 3],
            scale: [128.0; 3],
            bgr: false,
            outputs: outputs.iter().map(|&name| name.to_owned()).collect(),
            threads: 1,
        },
    }
}

/// An image of patches of random colours, as the background of the one that moves.
fn scene(width: usize, height: usize, moved: usize) -> Vec<u8> {
    let colour = |x: usize, y: usize, seed: u32, channel: usize| {
        let factors = [(x / 8, 374_761_393u32), (y / 8, 668_265_263), (channel, 2_246_822_519)];
        let mut v = factors.iter().fold(seed, |v, &(n, factor)| v ^ (n as u32).wrapping_mul(factor));
        v = (v ^ (v >> 13)).wrapping_mul(1_274_126_177);
        (v >> 24) as u8
    };
    let mut data = Vec::with_capacity(width * height * 3);
    for y in 0..height {
        for x in 0..width {
            let inside = (60 + moved..100 + moved).contains(&x) && (40..100).contains(&y);
            let (u, seed) = if inside { (x - moved + 4, 77) } else { (x, 0) };
            data.extend((0..3).map(|channel| colour(u, y, seed, channel)));
        }
    }
    data
}

fn maps(request: &Request) -> Vec<FeatureMap> {
    let data = scene(160, 120, 0);
    let frame = Frame::new(&data, 160, 120, 480, Encoding::Rgb8, None).unwrap();
    let mut cnn = request.load().unwrap();
    let mut maps = Vec::new();
    cnn.compute(&frame, &Rect::new(20.0, 10.0, 100.0, 100.0), &mut Cropper::default(), &mut maps).unwrap();
    maps
}

#[test]
fn both_give_the_same_features() {
    let cases: [(Option<&Path>, usize, &[&str]); 2] =
        [(None, 128, &["block4", "block10"]), (Some(&VGG), 96, &["conv4_4", "conv5_4"])];
    for (file, side, outputs) in cases {
        let [built_in, by_runtime] = BACK_ENDS.map(|inference| maps(&request(file, side, outputs, inference)));
        for (a, b) in built_in.iter().zip(&by_runtime) {
            assert_eq!([a.rows, a.cols, a.channels], [b.rows, b.cols, b.channels]);
            let size = (a.data.iter().map(|v| v * v).sum::<f32>() / a.data.len() as f32).sqrt();
            let worst = a.data.iter().zip(&b.data).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(size > 0.0 && worst < TOLERANCE * size, "{file:?}: {worst} of {size}");
        }
    }
}

#[test]
fn both_refuse_the_same_networks() {
    let folder = tempfile::tempdir().unwrap();
    let layer = |weight: f32| Convolution { name: "a", stride: 2, inputs: 3, outputs: 1, weights: vec![weight; 27] };
    let cases: [(&str, Vec<u8>, &str); 5] = [
        ("words.onnx", b"no network at all".to_vec(), "expected an ONNX network that takes an image"),
        ("size.onnx", network(&[1, 3, 48, 48], &[layer(1.0)]), "takes 1 x 3 x 48 x 48, expected one image"),
        ("batch.onnx", network(&[2, 3, 0, 0], &[layer(1.0)]), "takes 2 x 3 x ? x ?, expected one image"),
        ("nan.onnx", network(&[1, 3, 0, 0], &[layer(f32::NAN)]), "non-finite values at output 'a'"),
        (
            "name.onnx",
            network(&[1, 3, 0, 0], &[Convolution { name: "b", ..layer(1.0) }]),
            "no output 'a', expected one of b",
        ),
    ];
    for (name, bytes, why) in cases {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        for inference in BACK_ENDS {
            let said = request(Some(&path), 32, &["a"], inference).load().expect_err("a refusal").to_string();
            assert!(said.contains(why) && said.contains(name), "{inference:?}: {said}");
            assert_eq!(said.lines().count(), 1, "{said}");
        }
    }
}

#[test]
fn a_library_that_is_named_and_is_none_is_an_error() {
    let library = Some(PathBuf::from("/no/such/libonnxruntime.so"));
    for inference in [Inference::Auto, Inference::OnnxRuntime] {
        let runner = Runner { inference, library: library.clone() };
        let request = Request { runner, ..request(None, 64, &["block4"], inference) };
        let said = request.load().expect_err("a refusal").to_string();
        assert!(
            said.starts_with("ONNX Runtime cannot be used") && said.contains("/no/such/libonnxruntime.so"),
            "{said}"
        );
    }
    let runner = Runner { inference: Inference::Builtin, library };
    let unasked = Request { runner, ..request(None, 64, &["block4"], Inference::Builtin) };
    assert!(unasked.load().is_ok());
}

/// The preset `paper` with a network of VGG-19's architecture. Its weights are random, so that the features tell little
/// of where a target is; but a target that stands still matches in all three layers, whose responses then add up to the
/// sum of their weights, and both back ends see the same in one that moves.
#[test]
fn vgg19_runs_in_the_paper_preset() {
    let preset = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/paper.yaml");
    let mut rows = file(&preset, &NodeName::default()).unwrap();
    let text = |path: &Path| Value::String(path.to_str().unwrap().to_owned());
    rows.push(("lcmht.cnn.file".to_owned(), text(&VGG)));
    rows.push(("lcmht.cnn.library".to_owned(), text(&LIBRARY)));
    let [built_in, by_runtime] = ["builtin", "onnxruntime"].map(|inference| {
        rows.push(("lcmht.cnn.inference".to_owned(), Value::String(inference.to_owned())));
        let params = Params::default().with(rows.iter().map(|(n, v)| (n.as_str(), v)), Phase::StartUp).unwrap();
        assert_eq!(params.lcmht.cnn.side, 224);
        let weights = params.lcmht.layers.hog_weight + params.lcmht.cnn.weights.iter().sum::<f64>();
        let truth = Rect::new(60.0, 40.0, 40.0, 60.0);
        let mut session = Session::new(params).unwrap();
        let mut seen = Vec::new();
        for (step, moved) in [0, 0, 8].into_iter().enumerate() {
            let data = scene(240, 160, moved);
            let frame = Frame::new(&data, 240, 160, 720, Encoding::Rgb8, None).unwrap();
            let output = match step {
                0 => session.start(&frame, truth, &mut ()).unwrap(),
                _ => session.step(&frame, &mut ()),
            };
            seen.push((output.targets[0].rect, output.targets[0].response));
        }
        assert_eq!(seen[1].0, truth, "{inference}");
        assert!((f64::from(seen[1].1) - weights).abs() < 0.05, "{inference}: {} of {weights}", seen[1].1);
        assert!(seen[2].1 < 0.95 * seen[1].1, "{inference}: {seen:?}");
        seen
    });
    for (a, b) in built_in.iter().zip(&by_runtime) {
        assert!(a.0 == b.0 && (a.1 - b.1).abs() < 1e-3, "{a:?} {b:?}");
    }
}

/// The script that exports VGG-19 reads weights as torchvision and as Keras store them.
#[test]
fn vgg19_is_exported_as_its_weights_say() {
    let said = python::script("tests/network/check_vgg19.py", &[]);
    assert_eq!(said.matches("relative error").count(), 4, "{said}");
}
