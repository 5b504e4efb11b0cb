//! Training of the matching head: a head learns a made set, goes on where it was stopped, and runs here as in training.

#[path = "network/message.rs"]
mod message;
#[path = "network/siamese.rs"]
mod siamese;
#[path = "support/venv.rs"]
mod venv;

use std::fs;
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Arc, Mutex};

use image::{Rgb, RgbImage, imageops};
use long_term_tracker::appearance::matching::Matcher;
use long_term_tracker::crop::{Cropper, Patch};
use long_term_tracker::loader::{Request, Runner};
use long_term_tracker::network::{
    Engine, MatchingNetwork, NetworkSettings, SharedMatching, TRUNK_OUTPUTS, TRUNK_SIDE, locked,
};
use long_term_tracker::params::Inference;
use long_term_tracker::{Encoding, Frame, Rect};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use venv::run;

const WIDTH: u32 = 240;
const HEIGHT: u32 = 180;
/// Recordings, the last of which is left out of training; and frames of each.
const RECORDINGS: u64 = 6;
const FRAMES: u64 = 8;
/// Pairs, and passes through them.
const PAIRS: &str = "400";
const EPOCHS: &str = "5";
/// Steps after which the training is stopped, and from one kept state to the next.
const STOPPED: &str = "20";
/// What is added to the logits in the file: `LIFT` of `export.py`.
const LIFT: f32 = 4.0;
/// How far an answer may be from that in training: weights are rounded in the file, and sums are of another order.
const MOST_OFF: f32 = 0.01;
const MOST_OFF_PIXELS: f32 = 0.1;

/// A Python that has PyTorch beside the packages of the script. Where `TORCH_PYTHON` names none with PyTorch, `None`
/// and a line that tells of the test as skipped.
fn python() -> Option<PathBuf> {
    if let Some(base) = std::env::var_os("TORCH_PYTHON") {
        return Some(venv::python("training", "assets/matching/requirements.txt", Some(Path::new(&base))));
    }
    let test = std::thread::current();
    // Whether it can be told is not what is tested.
    let _ = writeln!(std::io::stderr(), "{}: skipped: no TORCH_PYTHON", test.name().unwrap_or_default());
    None
}

/// Cells of random colours, as large as `grain` pixels.
fn texture(seed: u64, width: u32, height: u32, grain: u32, colours: std::ops::Range<u8>) -> RgbImage {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let columns = width.div_ceil(grain);
    let cells: Vec<[u8; 3]> =
        (0..columns * height.div_ceil(grain)).map(|_| [(); 3].map(|()| rng.random_range(colours.clone()))).collect();
    RgbImage::from_fn(width, height, |x, y| Rgb(cells[(y / grain * columns + x / grain) as usize]))
}

/// The target of a recording in a frame.
fn target(recording: u64, frame: u64) -> Rect {
    let (size, step) = (32 + 4 * recording, 6 * frame);
    Rect::new((60 + step) as f64, (40 + 10 * recording - step / 2) as f64, size as f64, (size + 8) as f64)
}

/// A frame: a target of bold colours before a dull ground.
fn picture(recording: u64, frame: u64) -> RgbImage {
    let mut image = texture(100 + recording, WIDTH, HEIGHT, 12, 90..140);
    let Rect { x, y, w, h } = target(recording, frame);
    imageops::replace(&mut image, &texture(recording, w as u32, h as u32, 8, 0..255), x as i64, y as i64);
    image
}

fn write_recordings(folder: &Path) {
    for recording in 0..RECORDINGS {
        let folder = folder.join(recording.to_string());
        fs::create_dir_all(folder.join("img")).unwrap();
        let rows = (0..FRAMES).map(|frame| {
            picture(recording, frame).save(folder.join(format!("img/{frame:02}.png"))).unwrap();
            let Rect { x, y, w, h } = target(recording, frame);
            format!("{x},{y},{w},{h}\n")
        });
        fs::write(folder.join("groundtruth_rect.txt"), rows.collect::<String>()).unwrap();
    }
}

fn frame(image: &RgbImage) -> Frame<'_> {
    let [width, height] = [image.width(), image.height()];
    Frame::new(image.as_raw(), width, height, 3 * width as usize, Encoding::Rgb8, None).unwrap()
}

/// The head in a file, on the embedded network, both by RTen.
fn network(head: &Path) -> SharedMatching {
    let settings = NetworkSettings {
        side: TRUNK_SIDE,
        mean: [127.0; 3],
        scale: [128.0; 3],
        bgr: false,
        outputs: TRUNK_OUTPUTS.map(str::to_owned).to_vec(),
        threads: 1,
    };
    let runner = Runner { inference: Inference::Builtin, library: None };
    let trunk = Request { file: None, most: u64::MAX, runner, settings }.load().unwrap();
    let (trunk, head) = (Arc::new(Mutex::new(trunk)), fs::read(head).unwrap());
    Arc::new(Mutex::new(MatchingNetwork::on_trunk("made", trunk, head.into(), 1, &Engine::Builtin).unwrap()))
}

/// The word after `name` in a text, as a number.
fn told(text: &str, name: &str) -> f64 {
    let mut words = text.split([' ', ',', '\n']).skip_while(|word| *word != name);
    words.nth(1).and_then(|word| word.parse().ok()).unwrap_or_else(|| panic!("no {name} in: {text}"))
}

/// Overlap of a box that shows the target, after as short a training as this one.
const FOUND: f64 = 0.3;

/// The folder of a training, and how its script is called.
struct Training {
    python: PathBuf,
    folder: tempfile::TempDir,
}

impl Training {
    /// With pairs of made recordings. The seeded networks are the teacher.
    fn new(python: PathBuf) -> Self {
        let made = Self { python, folder: tempfile::tempdir().unwrap() };
        write_recordings(&made.path("recordings"));
        let mut pairs = made.script("pairs", &["pairs"]);
        pairs.arg("--video").arg(made.path("recordings")).args(["--count", PAIRS, "--teacher"]);
        run(pairs.args(siamese::files().each_ref().map(|file| file.path())));
        made
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// A command of the script, with paths in the folder.
    fn script(&self, command: &str, paths: &[&str]) -> Command {
        let mut script = Command::new(&self.python);
        script.arg("-B").arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/train_matching.py")).arg(command);
        script.args(paths.iter().map(|path| self.path(path)));
        script
    }

    fn train(&self, head: &str) -> Command {
        let mut train = self.script("train", &[head]);
        let left_out = (RECORDINGS - 1).to_string();
        train.arg("--pairs").arg(self.path("pairs")).args(["--seed", "3", "--epochs", EPOCHS, "--every", STOPPED]);
        train.args(["--check", &left_out]);
        train
    }

    /// Trains, and kills the script once it has kept a state.
    fn train_and_kill(&self, head: &str) {
        let mut child = self.train(head).stdout(Stdio::piped()).spawn().unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let step = lines.find(|line| line.as_ref().unwrap().starts_with(&format!("step {STOPPED},")));
        child.kill().unwrap();
        child.wait().unwrap();
        assert!(step.is_some(), "it ended before step {STOPPED}");
        assert!(!self.path(head).exists(), "it was to be stopped before its end");
    }
}

#[test]
fn a_head_learns_a_made_set_and_runs_here_as_in_training() {
    let Some(python) = python() else { return };
    let training = Training::new(python);
    let log = run(&mut training.train("whole.onnx"));
    let losses: Vec<f64> = log.lines().filter(|line| line.starts_with("step ")).map(|l| told(l, "loss")).collect();
    assert!(losses.last() < losses.first().map(|first| 0.9 * first).as_ref(), "{log}");
    let (hit, overlap) = (told(&log, "hit"), told(&log, "overlap"));
    assert!(hit > 0.9 && overlap > 0.5, "{log}");

    training.train_and_kill("stopped.onnx");
    let log = run(&mut training.train("stopped.onnx"));
    assert!(log.contains(&format!("steps from {STOPPED},")), "{log}");
    let [whole, stopped] = ["whole.onnx", "stopped.onnx"].map(|head| fs::read(training.path(head)).unwrap());
    assert!(whole == stopped, "a training that was stopped ends with another head");
    let other = training.train("whole.onnx").args(["--seed", "4"]).output().unwrap();
    assert!(!other.status.success(), "another run's state is no state to go on from");

    finds_the_target(&training);
    gives_what_it_gave_in_training(&training);
}

/// In the recording that was left out: here, and by the script.
fn finds_the_target(training: &Training) {
    let network = network(&training.path("whole.onnx"));
    let recording = RECORDINGS - 1;
    let (first, marked) = (picture(recording, 0), target(recording, 0));
    let mut cropper = Cropper::default();
    let mut matcher = Matcher::new(network, &frame(&first), &mut cropper, &marked);
    for k in 1..FRAMES {
        let (image, before) = (picture(recording, k), target(recording, k - 1));
        matcher.look(&frame(&image), &mut cropper, before.centre(), before.size(), None);
        let best = matcher.matches().iter().max_by(|a, b| a.score.total_cmp(&b.score)).unwrap();
        let overlap = best.rect.iou(&target(recording, k));
        assert!(overlap > FOUND, "frame {k}: {best:?}, overlap {overlap}");
    }
    let mut follow = training.script("follow", &["whole.onnx", "boxes"]);
    follow.arg("--video").arg(training.path("recordings")).args(["--sequences", &recording.to_string()]);
    run(&mut follow);
    let boxes = fs::read_to_string(training.path(&format!("boxes/{recording}.txt"))).unwrap();
    assert_eq!(boxes.lines().count() as u64, FRAMES, "{boxes}");
    for (k, row) in boxes.lines().enumerate() {
        let at: Vec<f64> = row.split(',').map(|v| v.parse().unwrap()).collect();
        let overlap = Rect::new(at[0], at[1], at[2], at[3]).iou(&target(recording, k as u64));
        assert!(overlap > FOUND, "frame {k}: {row}, overlap {overlap}");
    }
}

/// The trained head itself, on the same patches.
fn gives_what_it_gave_in_training(training: &Training) {
    let [template, window] = [(TRUNK_SIDE / 2, 0), (TRUNK_SIDE, 3)].map(|(side, k)| {
        let (image, mut patch) = (picture(0, k), Patch::default());
        let seen = Rect::around(target(0, k).centre(), [side as f64; 2]);
        Cropper::default().crop(&frame(&image), &seen, side, side, &mut patch);
        let pixels = RgbImage::from_fn(side as u32, side as u32, |x, y| Rgb(patch.rgb(x as usize, y as usize)));
        pixels.save(training.path(&format!("{side}.png"))).unwrap();
        patch
    });
    let mut answers = Command::new(&training.python);
    answers.arg("-B").arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/network/head_answers.py"));
    let paths = ["whole.state".to_owned(), format!("{}.png", TRUNK_SIDE / 2), format!("{TRUNK_SIDE}.png")];
    let said = run(answers.args(paths.map(|path| training.path(&path))));
    let expected: Vec<f32> = said.split_whitespace().map(|value| value.parse().unwrap()).collect();

    let network = network(&training.path("whole.onnx"));
    let mut network = locked(&network);
    let template = network.learn(&template);
    network.compare(&template, &window);
    let (logits, sides) = (network.logits(), network.sides());
    let lifted = logits.plane(1).iter().map(|logit| logit - LIFT);
    let got: Vec<f32> = lifted.chain(sides.data.iter().copied()).collect();
    assert_eq!(got.len(), expected.len());
    let cells = logits.cells();
    for (i, (got, expected)) in got.iter().zip(&expected).enumerate() {
        let most = if i < cells { MOST_OFF } else { MOST_OFF_PIXELS };
        assert!((got - expected).abs() < most, "value {i}: {got}, in training {expected}");
    }
}
