//! Files of parameters must say what the table says. `REGENERATE=1` rewrites those that are made from it.

use std::path::Path;
use std::process::Command;

use long_term_tracker::params::{self, NodeName, Params, Phase};

const BEGIN: &str = "<!-- parameters: begin -->\n";
const END: &str = "<!-- parameters: end -->";

/// Compares a file with what it should hold, which is made from what it holds.
fn check(file: &str, wanted: impl FnOnce(&str) -> String) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
    let text = std::fs::read_to_string(&path).unwrap_or_default();
    let wanted = wanted(&text);
    if std::env::var_os("REGENERATE").is_some() {
        std::fs::write(&path, wanted).unwrap();
        return;
    }
    assert!(text == wanted, "{file} is out of date: run REGENERATE=1 cargo test --release --test generated");
}

#[test]
fn the_docs_hold_the_table_of_parameters() {
    check("docs/parameters.md", |text| {
        let (before, rest) = text.split_once(BEGIN).expect("the mark where the table begins");
        let (_, after) = rest.split_once(END).expect("the mark where the table ends");
        format!("{before}{BEGIN}{}{END}{after}", params::markdown())
    });
}

#[test]
fn the_default_preset_holds_the_defaults() {
    check("params/default.yaml", |_| params::preset(&Params::default(), "Every parameter with its default."));
}

/// What the programs hold of others, with every cargo feature that adds to it.
const LINKED: [&str; 12] = [
    "tree",
    "--locked",
    "--no-default-features",
    "--features=lyrical,onnxruntime,viewer",
    "--target=x86_64-unknown-linux-gnu",
    "--edges=normal,no-proc-macro",
    "--prefix=none",
    "--no-dedupe",
    "--charset=utf8",
    "--color=never",
    "--format",
    "{p}|{l}|{r}",
];
const THIRD_PARTY: &str = "# Linked crates

The crates that the programs link to on x86-64, with the licences that their authors offer. The texts are in the sources
of each crate, which cargo downloads. `NOTICE` lists data by others.

| crate | version | licence | source |
|---|---|---|---|
";

#[test]
fn the_list_of_linked_crates_is_that_of_the_lock_file() {
    check("THIRD_PARTY.md", |_| {
        let mut cargo = Command::new(env!("CARGO"));
        let output = cargo.current_dir(env!("CARGO_MANIFEST_DIR")).args(LINKED).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let tree = String::from_utf8(output.stdout).unwrap();
        let own = ["long_term_tracker", "yaml_events"];
        let mut rows: Vec<String> = tree.lines().filter_map(|line| linked(line, &own)).collect();
        rows.sort();
        rows.dedup();
        format!("{THIRD_PARTY}{}", rows.concat())
    });
}

/// The row of `NAME vVERSION [(PATH)]|LICENCE|SOURCE`, unless the crate is one of `own`.
fn linked(line: &str, own: &[&str]) -> Option<String> {
    let [package, licence, source] = line.split('|').collect::<Vec<_>>().try_into().ok()?;
    let (name, version) = package.split_once(" v").expect("a name and a version");
    let version = version.split_whitespace().next().unwrap_or_default();
    assert!(!licence.is_empty(), "{name} has no licence");
    (!own.contains(&name)).then(|| format!("| {name} | {version} | {licence} | {source} |\n"))
}

#[test]
fn every_preset_is_a_set_of_parameters() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("params");
    let mut names: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    names.sort();
    assert_eq!(names.len(), 7, "{names:?}");
    for path in names {
        let changes = params::file(&path, &NodeName::default()).unwrap();
        let changed = Params::default().with(changes.iter().map(|(n, v)| (n.as_str(), v)), Phase::StartUp).unwrap();
        let is_default = path.ends_with("default.yaml");
        assert_eq!(changed == Params::default(), is_default, "{}", path.display());
    }
}
