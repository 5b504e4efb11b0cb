//! What becomes of each parameter's change while targets are followed is what its row in the table says.

#[path = "network/message.rs"]
mod message;
#[path = "network/onnx.rs"]
mod onnx;
#[path = "network/siamese.rs"]
mod siamese;

use std::io::Write as _;

use long_term_tracker::loader::{Loaded, MatchingRequest, Request};
use long_term_tracker::params::{Descriptor, Need, Phase, Value, descriptors};
use long_term_tracker::trace::{Event, Trace};
use long_term_tracker::{Encoding, Frame, Output, Params, ParamsError, Rect, Session, State};
use onnx::{Convolution, network};

const WIDTH: usize = 160;
const HEIGHT: usize = 120;
/// Frames before the one in which the target hides and a parameter changes, and frames after that.
const BEFORE: usize = 6;
const AFTER: usize = 6;
/// Far beyond the image.
const HIDDEN: f64 = 1000.0;

fn target(frame: usize) -> Rect {
    Rect::new(30.0 + 2.0 * frame as f64, 44.0, 40.0, 32.0)
}

/// A patterned box over noise, RGB.
fn scene(at: Rect) -> Vec<u8> {
    let noise = |x: usize, y: usize| ((x * 7919 + y * 104_729 + (x * y) % 97 * 31) % 61) as u8;
    let mut data = Vec::with_capacity(WIDTH * HEIGHT * 3);
    for (y, x) in (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (y, x))) {
        let (u, v) = (x as f64 - at.x, y as f64 - at.y);
        let inside = (0.0..at.w).contains(&u) && (0.0..at.h).contains(&v);
        if inside {
            let value = 40 + ((u as usize / 4 * 53 + v as usize / 5 * 91) % 200) as u8;
            data.extend([value, value / 2, 30]);
        } else {
            data.extend([60 + noise(x, y), 120 + noise(x, y), 60 + noise(x, y)]);
        }
    }
    data
}

/// What was made anew.
#[derive(Default)]
struct Made(Vec<Need>);

impl Trace for Made {
    fn event(&mut self, event: Event) {
        if let Event::MadeAnew(what) = event {
            self.0.push(what);
        }
    }
}

/// Another value that the parameter may have.
fn other(d: &Descriptor, now: &Value) -> Value {
    let fits = |value: &Value| value != now && d.range.is_none_or(|range| range.contains(value));
    let candidates = match now {
        Value::Bool(v) => vec![Value::Bool(!v)],
        Value::Integer(v) => vec![Value::Integer(v + 1), Value::Integer(v - 1)],
        Value::Double(v) => [1.1 * v, 0.9 * v, v + 0.1, v - 0.1].map(Value::Double).to_vec(),
        Value::String(_) if d.choices.is_empty() => vec![Value::String("other".into())],
        Value::String(_) => d.choices.iter().map(|choice| Value::String((*choice).to_owned())).collect(),
        Value::DoubleArray(v) => vec![Value::DoubleArray(v.iter().map(|v| 0.9 * v + 0.05).collect())],
        Value::IntegerArray(v) => vec![Value::IntegerArray(v.iter().map(|v| v + 1).collect())],
        Value::StringArray(v) => vec![Value::StringArray(v.iter().rev().cloned().collect())],
        Value::BoolArray(_) => vec![],
    };
    candidates.into_iter().find(fits).unwrap_or_else(|| panic!("{} may be nothing but {now}", d.name))
}

/// What a change has made anew in the very next frame, in which the target is hidden, and what once it is certain
/// again.
fn expected(need: Need) -> [Vec<Need>; 2] {
    match need {
        Need::Network => [vec![Need::Runtime], vec![need]],
        _ if need.waits() => [vec![], vec![need]],
        _ if need.makes_anew() => [vec![need], vec![]],
        _ => [vec![], vec![]],
    }
}

/// Follows a target, and changes parameters in the frame in which it hides. Gives what was made anew in that frame and
/// afterwards, and what was said from then on.
fn follow(from: &Params, to: Option<Params>) -> ([Vec<Need>; 2], Vec<Output>) {
    let mut session = Session::new(from.clone()).unwrap();
    let (mut at_once, mut later, mut said) = (Made::default(), Made::default(), Vec::new());
    for n in 0..BEFORE + 1 + AFTER {
        let data = scene(if n == BEFORE { target(n).shifted(HIDDEN, 0.0) } else { target(n) });
        let frame = Frame::new(&data, WIDTH as u32, HEIGHT as u32, 3 * WIDTH, Encoding::Rgb8, None).unwrap();
        if n == 0 {
            session.start(&frame, target(0), &mut ()).unwrap();
        } else if n < BEFORE {
            session.step(&frame, &mut ());
        } else if n == BEFORE {
            if let Some(to) = &to {
                let is_other =
                    Request::of(to) != Request::of(from) || MatchingRequest::of(to) != MatchingRequest::of(from);
                let networks = if is_other { Loaded::new(to).unwrap().networks() } else { session.networks() };
                session.retune(to.clone(), networks);
                assert_eq!(session.params(), to);
            }
            said.push(session.step(&frame, &mut at_once).clone());
        } else {
            said.push(session.step(&frame, &mut later).clone());
        }
    }
    ([at_once.0, later.0], said)
}

/// Walks all parameters whose names `wanted` takes.
fn walk(from: &Params, wanted: impl Fn(&str) -> bool) {
    let (made, unchanged) = follow(from, None);
    assert_eq!(made, [vec![], vec![]]);
    assert!(unchanged[0].targets[0].state != State::Tracking, "{unchanged:?}");
    for d in descriptors().iter().filter(|d| wanted(d.name)) {
        let value = other(d, &from.get(d.name).unwrap());
        let changed = from.with([(d.name, &value)], Phase::Running);
        if d.need == Need::Restart {
            assert!(matches!(changed, Err(ParamsError::ReadOnly { .. })), "{} = {value}", d.name);
            assert!(from.with([(d.name, &value)], Phase::StartUp).is_ok(), "{} = {value}", d.name);
            continue;
        }
        let changed = changed.unwrap_or_else(|why| panic!("{} = {value}: {why}", d.name));
        let (made, said) = follow(from, Some(changed));
        assert_eq!(made, expected(d.need), "{} = {value}, {:?}", d.name, d.need);
        assert!(d.need != Need::Start || said == unchanged, "{} = {value}", d.name);
    }
}

fn params(changes: &[(&str, Value)]) -> Params {
    Params::default().with(changes.iter().map(|(name, value)| (*name, value)), Phase::StartUp).unwrap()
}

fn text(value: &str) -> Value {
    Value::String(value.to_owned())
}

#[test]
fn what_becomes_of_a_change_is_what_the_table_says() {
    let params = params(&[("lcmht.cnn.enabled", Value::Bool(false))]);
    let elsewhere = ["lcmht.cnn.", "lcmht.matching.", "etepf.", "maptrack."];
    walk(&params, |name| !elsewhere.iter().any(|prefix| name.starts_with(prefix)));
}

#[test]
fn what_becomes_of_a_change_of_the_network_is_what_the_table_says() {
    const NEAR: [usize; 2] = [3, 4];
    const FAR: [usize; 2] = [4, 5];
    let layer = |name, [inputs, outputs]: [usize; 2]| {
        let weights = (0..inputs * outputs * 9).map(|i| ((i * 7919 + 13) % 101) as f32 / 50.0 - 1.0).collect();
        Convolution { name, stride: 2, inputs, outputs, weights }
    };
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(&network(&[1, 3, 0, 0], &[layer("near", NEAR), layer("far", FAR)])).unwrap();
    let params = params(&[
        ("lcmht.cnn.file", text(file.path().to_str().unwrap())),
        ("lcmht.cnn.outputs", Value::StringArray(["near", "far"].map(str::to_owned).into())),
        ("lcmht.cnn.components", Value::IntegerArray(vec![2, 2])),
        ("lcmht.cnn.side", Value::Integer(32)),
        ("lcmht.cnn.inference", text("builtin")),
    ]);
    walk(&params, |name| name.starts_with("lcmht.cnn."));
}

#[test]
fn what_becomes_of_a_change_of_the_matching_networks_is_what_the_table_says() {
    let [backbone, head] = siamese::files();
    let file = |file: &tempfile::NamedTempFile| text(file.path().to_str().unwrap());
    for enabled in [true, false] {
        let params = params(&[
            ("lcmht.cnn.enabled", Value::Bool(false)),
            ("lcmht.cnn.inference", text("builtin")),
            ("lcmht.matching.enabled", Value::Bool(enabled)),
            ("lcmht.matching.backbone", file(&backbone)),
            ("lcmht.matching.head", file(&head)),
        ]);
        walk(&params, |name| name.starts_with("lcmht.matching.") && (enabled || name.ends_with("enabled")));
    }
}

#[test]
fn what_becomes_of_a_change_of_etepf_is_what_the_table_says() {
    walk(&params(&[("algorithm", text("etepf"))]), |name| name.starts_with("etepf."));
}

#[test]
fn what_becomes_of_a_change_of_maptrack_is_what_the_table_says() {
    walk(&params(&[("algorithm", text("maptrack"))]), |name| name.starts_with("maptrack."));
}
