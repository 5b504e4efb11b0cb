//! Parameter files and arguments: what rcl reads is read, what it refuses is refused.

#![cfg(feature = "ros")]

mod corpus;

use std::fs;
use std::path::Path;

use long_term_tracker::params::{NodeName, Overrides, Value};
use serde_json::{Map, Value as Json, json};

use self::corpus::{Case, RANDOM, cases};
use crate::support::{Environment, Node, Peer, domain};

/// Below this many taken, the random files would show little.
const ENOUGH_TAKEN: usize = 60;

/// What our reader makes of a case, as the peer writes it.
fn ours(case: &Case) -> Result<Json, String> {
    let mut overrides = Overrides::default();
    for part in case[1..].chunks(2) {
        let read =
            if part[0] == "-p" { overrides.assign(&part[1]) } else { overrides.read(Path::new(&part[1])).map(drop) };
        read.map_err(|why| why.to_string())?;
    }
    let node = NodeName { namespace: case[0].clone(), name: "tracker".to_owned() };
    let told = |value: Option<Value>| match value {
        None => Json::Null,
        Some(Value::Bool(v)) => json!(["BOOL", v]),
        Some(Value::Integer(v)) => json!(["INTEGER", v]),
        Some(Value::Double(v)) => json!(["DOUBLE", bits(&v)]),
        Some(Value::String(v)) => json!(["STRING", v]),
        Some(Value::BoolArray(v)) => json!(["BOOL_ARRAY", v]),
        Some(Value::IntegerArray(v)) => json!(["INTEGER_ARRAY", v]),
        Some(Value::DoubleArray(v)) => json!(["DOUBLE_ARRAY", v.iter().map(bits).collect::<Vec<_>>()]),
        Some(Value::StringArray(v)) => json!(["STRING_ARRAY", v]),
    };
    Ok(overrides.of(&node).into_iter().map(|o| (o.name, told(o.value))).collect::<Map<_, _>>().into())
}

fn bits(number: &f64) -> String {
    if number.is_nan() { "nan".to_owned() } else { format!("{:016x}", number.to_bits()) }
}

#[test]
fn every_file_and_argument_is_read_as_rclpy_reads_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let (made, cases) = cases(folder.path());
    let [asked, answered] = ["cases.json", "answers.json"].map(|name| folder.path().join(name));
    fs::write(&asked, serde_json::to_string(&cases).expect("JSON")).expect("the cases written");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peer/parameter_files.py");
    let paths = [&asked, &answered].map(|path| path.to_str().expect("a path of text"));
    Peer::spawn(&mut Environment::get().python(), domain(), &script, &paths).succeed_alone();
    let answers: Vec<Json> = serde_json::from_str(&fs::read_to_string(&answered).expect("the answers")).expect("JSON");
    assert_eq!(answers.len(), cases.len());
    let mut wrong = Vec::new();
    for (case, theirs) in cases.iter().zip(&answers) {
        let same = match (ours(case), theirs) {
            (Ok(ours), theirs) => ours == *theirs,
            (Err(_), theirs) => theirs.is_string(),
        };
        if !same {
            let texts: Vec<_> =
                case[1..].iter().map(|arg| fs::read_to_string(arg).unwrap_or_else(|_| arg.clone())).collect();
            wrong.push(format!("{texts:?} in {}:\n  rclpy {theirs}\n  we    {:?}", case[0], ours(case)));
        }
    }
    assert!(wrong.is_empty(), "{} of {} differ:\n{}", wrong.len(), cases.len(), wrong.join("\n"));
    let taken = answers[made..].iter().filter(|a| a.as_object().is_some_and(|a| !a.is_empty())).count();
    assert!(taken >= ENOUGH_TAKEN, "only {taken} of {RANDOM} random files give the node anything");
}

/// The network, which has no part in this, is off.
const HEAD: &str = "/**:\n  ros__parameters:\n    lcmht.cnn.enabled: ";

#[test]
fn the_node_starts_with_what_others_start_with() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("p.yaml");
    fs::write(
        &path,
        format!(
            "---\n{HEAD}on\n    lcmht.cnn.enabled: off\n    seed: 007\n    serial: 18446744073709551615\n    \
             sensors: {{0: {{name: left}}, 1: {{name: right}}}}\n---\n/**:\n  ros__parameters:\n    max_targets: 2\n"
        ),
    )
    .expect("the file written");
    let node =
        Node::start(domain(), &["--ros-args", "--params-file", path.to_str().expect("text"), "-p", "max_targets:=03"]);
    node.wait_for("waits for images");
    let log = node.end();
    for part in ["'serial'", "'sensors.0.name'", "line 7, column"] {
        assert!(log.contains(part), "no {part} in:\n{log}");
    }
    assert!(!log.contains("error:"), "{log}");
}

#[test]
fn the_node_tells_of_a_file_that_is_not_for_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("p.yaml");
    fs::write(&path, "camera: {ros__parameters: {rate: 30}}\n").expect("the file written");
    let path = path.to_str().expect("text");
    let node = Node::start(domain(), &["--ros-args", "-p", "lcmht.cnn.enabled:=no", "--params-file", path]);
    node.wait_for(&format!("parameter file {path}: it holds nothing for /tracker; it is for camera"));
    node.wait_for("waits for images");
    node.end();
}

#[test]
fn the_node_refuses_what_others_refuse_and_says_where() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("p.yaml");
    let deep = format!("{HEAD}off\n    a: {}", "[".repeat(160_000));
    let large = format!("{HEAD}off\n#{}", "x".repeat(2_000_000));
    for (text, part) in [
        (format!("{HEAD}off\n    a: &x 1\n    <<: *x\n"), "line 5, column 9: '*x' is an alias"),
        ("/track*: {ros__parameters: {a: 1}}".to_owned(), "line 1, column 11: '/track*' does not match a node"),
        (format!("{HEAD}[1, 2.0]\n"), "the items of a list must be of one type"),
        (format!("{HEAD}0777\n"), "'lcmht.cnn.enabled' is of type bool, got integer 511"),
        (deep, "deep"),
        (large, "it has more than 1048576 bytes"),
    ] {
        fs::write(&path, text).expect("the file written");
        let name = path.to_str().expect("text");
        let (code, log) = Node::start(domain(), &["--ros-args", "--params-file", name]).finish();
        assert_eq!(code, Some(2), "{log}");
        assert!(log.contains(part) && log.contains(name), "no '{part}' in:\n{log}");
    }
    for file in ["/no/such.yaml", "/dev/zero", "/tmp"] {
        let (code, log) = Node::start(domain(), &["--ros-args", "--params-file", file]).finish();
        assert!(code == Some(2) && log.contains(&format!("parameter file {file}: ")), "{code:?}: {log}");
    }
}
