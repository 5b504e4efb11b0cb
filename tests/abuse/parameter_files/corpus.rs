//! The cases: texts that show one thing each, and texts made at random from what such files hold.

use std::fs;
use std::path::Path;

use rand::{RngExt as _, SeedableRng, seq::IndexedRandom as _};
use rand_chacha::ChaCha8Rng;

/// How many files are made at random.
pub const RANDOM: usize = 300;

/// One start of a node: its namespace and what would follow `--ros-args`.
pub type Case = Vec<String>;

/// The text as the parameters of every node.
fn every(parameters: &str) -> String {
    format!("/**:\n  ros__parameters:\n    {}\n", parameters.replace('\n', "\n    "))
}

/// Texts of files that show one thing each.
fn by_kind() -> Vec<String> {
    let parameters = [
        "a: off\nb: no\nc: on\nd: yes\ne: Y\nf: n\ng: yEs\nh: TRUE",
        "a: 007\nb: 0x1F\nc: 08\nd: 0o7\ne: 0b1\nf: -010\ng: +5\nh: 1_000",
        "a: 18446744073709551615\nb: 9223372036854775807\nc: -9223372036854775808\nd: 9223372036854775808",
        "a: 1e5\nb: 1.\nc: .5\nd: 1e999\ne: 1e-320\nf: 0x1p3\ng: -0x.8P-1\nh: 1e\ni: 4.9e-324\n\
         j: 2.2250738585072014e-308",
        "a: .nan\nb: .inf\nc: -.INF\nd: nan\ne: Infinity\nf: +.nan\ng: inf\nh: -inf\ni: nan(1)",
        "a: 'on'\nb: \"7\"\nc: ''\nd: \"\\0\"\ne: \"x\\0y\"\nf: \"\\u00e9\\x41\\n\"",
        "a: !!str 5\nb: !!int '5'\nc: ! 5\nd: !!float 1\ne: !<tag:yaml.org,2002:str> on\nf: !!binary aGk=",
        "a: |\n  7\nb: |-\n  7\nc: >-\n  1.5\nd: >\n  a\n  b\ne: |+\n  x\n",
        "a: ~\nb: null\nc: Null",
        "a:",
        "a: ''\n'': 1",
        "a: 2026-01-01\nb: 12:30:00\nc: a b\nd: 'it''s'\ne: x#y\nf: 1 # c",
        "a: []\nb: [1]\nc: [1, 2,]\nd: [a, 'b']\ne: [yes, no]\nf: [1.0, 2.5]",
        "a: [1, 2.0]",
        "a: [true, 1]",
        "a: [1, x]",
        "a: [a, ~]",
        "a: [[1, 2]]",
        "a: [[1], [2]]",
        "a: [1, [2, 3]]",
        "a: [{b: 1}]",
        "a: [1, {b: 2}]",
        "a: [{b: 1}, {c: 2}]",
        "a: [b: 1]",
        "a:\n- 1\n- 2",
        "a:\n  - 1\n  - - 2",
        "a: {}",
        "a: {}\nb: 1",
        "a: {b: {c: 1}, d: 2}\ne: 3",
        "a: {b.c: {d: 1}, e: 2}",
        "a.b: {c: 1}\na: {b: {c: 2}}\na.b.c: 3",
        "a: 1\na: 2",
        "a: true\na: 5",
        "a: text\na: 1.5",
        "a: [1]\na: 1\na: [x]",
        "a: [1, 2]\na: [3]",
        "x: {c: 1}\nx: {c: 2}\nx.c: 3",
        "a: 5\na: {b: 1}",
        "a: {b: 1}\na: 5",
        "0: {0: {name: left}, 1: {name: right}}\n1.5: x\ntrue: y\n~: z",
        "<<: {a: 1}",
        "a: &x 1\nb: *x",
        "base: &b {a: 1}\nother:\n  <<: *b",
        "a: &x [1, &y 2]",
        "? a\n: 1",
        "? [a]\n: 1",
        "? {a: b}\n: 1",
        "a: {b}",
        "a: {b:}",
        "a b: 1\né: 2\n/p: 3\na/b: 4\n'a:b': 5",
        "ros__parameters: 1",
        "qos_overrides./image.subscription.depth: 3",
        "a: \"\\q\"",
        "a: 'open",
        "a: [1",
        "a: @x",
        "a: `x`",
        "a: %x",
        "a: b: c",
        "\ta: 1",
        "a:\t1",
        "a: 1\n  b: 2",
        "a: 1\r\nb: 2\r",
        "a: x\u{2028}y\nb: \u{1f600}",
        "a: \u{7}",
        "a: \u{85}b",
    ];
    let whole = [
        "",
        "# nothing\n",
        "just words",
        "- a\n- b",
        "5: {6: 7}",
        "{}",
        "---\n...\n---\n",
        "ros__parameters: {a: 1}",
        "/**: {a: 1}",
        "/**: {ros__parameters: 5}",
        "/**: {ros__parameters: [1]}",
        "/**: {ros__parameters: }",
        "/**: {ros__parameters: {}}",
        "/**: {ros__parametersX: {a: 1}}",
        "/**: {'ros__parameters': {a: 1}}",
        "/**: {ros__parameters: {a: 1}}\n/**: {ros__parameters: 5}",
        "/**: {ros__parameters: {a: 1}, b: 2}",
        "/**: {ros__parameters: {a: 1}, sub: {ros__parameters: {a: 2}}}",
        "/**: {ros__parameters: {a: 1}}\n/**: {ros__parameters: {b: 2, a: 3}}",
        "---\n/**: {ros__parameters: {a: 1}}\n---\n/**: {ros__parameters: {b: 2}}",
        "%YAML 1.1\n---\n/**: {ros__parameters: {a: 1}}",
        "%TAG ! tag:yaml.org,2002:\n---\n/**: {ros__parameters: {a: !str 1}}",
        "tracker: {ros__parameters: {a: 1}}\n/**: {ros__parameters: {a: 2}}",
        "/**: {ros__parameters: {a: 2}}\n/tracker: {ros__parameters: {a: 1}}",
        "other: {ros__parameters: {a: [1, 2]}}",
        "/*: {ros__parameters: {a: 1}}\n'**': {ros__parameters: {b: 1}}\n'*': {ros__parameters: {c: 1}}",
        "/**/tracker: {ros__parameters: {a: 1}}\n/ns/**: {ros__parameters: {b: 1}}\n\
         /*/tracker: {ros__parameters: {c: 1}}",
        "/track*: {ros__parameters: {a: 1}}",
        "track-er: {ros__parameters: {a: 1}}",
        "1a: {ros__parameters: {a: 1}}",
        "a//b: {ros__parameters: {a: 1}}",
        "/: {ros__parameters: {a: 1}}",
        "a/: {ros__parameters: {a: 1}}",
        "ns: {tracker: {ros__parameters: {a: 1}}, other: {ros__parameters: {a: 2}}}",
        "/ns/: {tracker: {ros__parameters: {a: 1}}}",
        "a/b: {c: {ros__parameters: {a: 1}}}\ntracker: {ros__parameters: {a: 2}}",
        "/**: &x {ros__parameters: {a: 1}}\nb: *x",
        "[a]: {ros__parameters: {a: 1}}",
        "/**:\n  ros__parameters:\n    a: |\n      7",
        "/**:\n  ros__parameters:\n    a: |-\n      7",
        "/**:\n  ros__parameters:\n    a: \"\\",
        "/**:\n ros__parameters:\n  a: 1\n b:\n  ros__parameters:\n   c: 2\n",
    ];
    parameters.iter().map(|text| every(text)).chain(whole.map(str::to_owned)).collect()
}

const VALUES: [&str; 34] = [
    "1",
    "007",
    "0x1F",
    "-5",
    "1.5",
    "1e5",
    "off",
    "Yes",
    "null",
    "'q'",
    "\"q\\n\"",
    "hello world",
    "[]",
    "[1, 2]",
    "[yes, no]",
    "[a, 'b']",
    "[[1]]",
    "[{a: 1}]",
    "{a: 1}",
    "{a: {b: 2}, c: 3}",
    "&x 1",
    "!!str 5",
    "! 5",
    "|\n      text",
    "|-\n      7",
    ">\n      a\n      b",
    "''",
    ".nan",
    "-.INF",
    "18446744073709551615",
    "12:30",
    "1 # c",
    "{b: [1.5]}",
    "é",
];
const ODD_VALUES: [&str; 12] =
    ["", "*x", "[1, 2.0]", "[[1],[2]]", "a: b", "{}", "@a", "{a}", "[true, ~]", "[1, [2, 3], 4]", "- 1", "%"];
const KEYS: [&str; 10] = ["a", "b", "a.b", "c", "x.y.z", "0", "/p", "é", "a b", "a:b"];
const ODD_KEYS: [&str; 8] = ["''", "[k]", "{k: v}", "*x", "<<", "\"a\\0b\"", "ros__parameters", "!!str a"];
const NODES: [&str; 9] = ["/**", "/*", "tracker", "/tracker", "other", "/a/b", "/**/tracker", "/ns/**", "**"];
const ODD_NODES: [&str; 7] = ["/track*", "1a", "a//b", "{x}", "ns/", "ns:\n  tracker", "5"];
const NAMESPACES: [&str; 4] = ["/", "/", "/ns", "/a/b"];
const ARGUMENTS: [&str; 12] =
    ["a", "b", "a.b", "tracker:a", "other:b", "/a", "x/y", "a..b", "1", "__a", "a:b:c", "q./t.depth"];
/// What is put into texts.
const SCRAPS: [&str; 24] = [
    "[", "]", "{", "}", ":", ",", "-", "?", "!", "&", "*", "'", "\"", "|", ">", "%", "@", "#", "\n", " ", "\t", ".",
    "é", "~",
];

/// Mostly of the first, now and then of the second.
fn pick(random: &mut ChaCha8Rng, usual: &[&'static str], odd: &[&'static str]) -> &'static str {
    let from = if random.random_bool(0.03) { odd } else { usual };
    from.choose(random).copied().unwrap_or_default()
}

fn random_parameters(random: &mut ChaCha8Rng, indent: usize) -> String {
    let mut text = String::new();
    for _ in 0..random.random_range(1..4) {
        let key = pick(random, &KEYS, &ODD_KEYS);
        let value = match indent < 8 && random.random_bool(0.2) {
            true => format!("\n{}", random_parameters(random, indent + 2)),
            false => format!(" {}\n", pick(random, &VALUES, &ODD_VALUES)),
        };
        text += &format!("{}{key}:{value}", " ".repeat(indent));
    }
    text
}

fn random_file(random: &mut ChaCha8Rng) -> String {
    let mut text = String::new();
    for _ in 0..random.random_range(1..4) {
        text += pick(random, &["", "", "", "---\n", "# c\n"], &["foo\n", "- a\n", "--- {}\n", "...\n"]);
        let node = pick(random, &NODES, &ODD_NODES);
        let indent = 2 + 2 * node.matches('\n').count();
        let parameters = random_parameters(random, indent + 2);
        text += &format!("{node}:\n{}ros__parameters:\n{parameters}", " ".repeat(indent));
    }
    if random.random_bool(0.15) {
        for _ in 0..random.random_range(1..4) {
            let places: Vec<usize> = text.char_indices().map(|(at, _)| at).collect();
            let Some(at) = places.choose(random).copied() else { break };
            if random.random_bool(0.5) {
                text.remove(at);
            } else {
                text.insert_str(at, pick(random, &SCRAPS, &SCRAPS));
            }
        }
    }
    text
}

/// The cases, whose files are written to the folder; those by kind come first.
pub fn cases(folder: &Path) -> (usize, Vec<Case>) {
    let mut files = 0;
    let mut file = |bytes: &[u8]| {
        files += 1;
        let path = folder.join(format!("{files}.yaml"));
        fs::write(&path, bytes).expect("a parameter file written");
        ["--params-file".to_owned(), path.to_str().expect("a path of text").to_owned()]
    };
    let at = |namespace: &str, parts: &[[String; 2]]| {
        std::iter::once(namespace.to_owned()).chain(parts.concat()).collect::<Case>()
    };
    let argument = |text: &str| ["-p".to_owned(), text.to_owned()];
    let mut all = Vec::new();
    for text in by_kind() {
        let part = file(text.as_bytes());
        all.push(at("/", std::slice::from_ref(&part)));
        all.push(at("/ns", &[part]));
    }
    let one = every("a: 1\nb: é\nc: \u{1f600}");
    let utf16 = |unit: fn(u16) -> [u8; 2]| format!("\u{feff}{one}").encode_utf16().flat_map(unit).collect::<Vec<u8>>();
    for bytes in [
        format!("\u{feff}{one}").into_bytes(),
        utf16(u16::to_le_bytes),
        utf16(u16::to_be_bytes),
        [one.as_bytes(), b"\xff"].concat(),
        b"\xff\xfea".to_vec(),
        [one.as_bytes(), b"\0"].concat(),
    ] {
        all.push(at("/", &[file(&bytes)]));
    }
    for text in [
        "a:=off",
        "a:=007",
        "a:=",
        "a:=''",
        "a:=[1, 2]",
        "a:=[]",
        "a:=[[1],[2]]",
        "a:={b: 1}",
        "a:=x: y",
        "a:=*x",
        "a:=&x 5",
        "a:=# c",
        "a:=1 2",
        "a:=b:=c",
        "a:=5 # x",
        "a:=1\n---\n2",
        "a:=- 1\n- 2",
        "a:=!!str 5",
        "a:=\"",
        "tracker:a:=1",
        "other:a:=1",
        "/tracker:a:=1",
        "/**:a:=1",
        "**:a:=1",
        "a:b:c:=1",
        ":a:=1",
        "a",
        "a.b:=1",
        "a..b:=1",
        ".a:=1",
        "a.:=1",
        "a/b:=1",
        "/a:=1",
        "a/.b:=1",
        "1a:=1",
        "a.1:=1",
        "__a:=1",
        "a__b:=1",
        "a-b:=1",
        "a b:=1",
        "a*:=1",
        "ä:=1",
        "~/a:=1",
        "qos_overrides./image.subscription.depth:=3",
    ] {
        all.push(at("/", &[argument(text)]));
    }
    let (first, second) = (file(every("a: 1\nb: 2").as_bytes()), file(b"tracker: {ros__parameters: {a: 3.5}}"));
    all.push(at("/", &[first.clone(), second.clone(), argument("b:=x")]));
    all.push(at("/", &[second, argument("a:=true"), first]));
    all.push(at("/", &[["--params-file".to_owned(), "/no/such.yaml".to_owned()]]));
    let made = all.len();
    let mut random = ChaCha8Rng::seed_from_u64(20);
    for _ in 0..RANDOM {
        let namespace = pick(&mut random, &NAMESPACES, &NAMESPACES);
        let mut parts = vec![file(random_file(&mut random).as_bytes())];
        if random.random_bool(0.15) {
            let name = pick(&mut random, &ARGUMENTS[..7], &ARGUMENTS);
            parts.push(argument(&format!("{name}:={}", pick(&mut random, &VALUES, &ODD_VALUES))));
        }
        all.push(at(namespace, &parts));
    }
    (made, all)
}
