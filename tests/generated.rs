//! Files of parameters must say what the table says. `REGENERATE=1` rewrites those that are made from it.

use std::path::Path;

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
fn the_readme_holds_the_table_of_parameters() {
    check("README.md", |text| {
        let (before, rest) = text.split_once(BEGIN).expect("README.md has the mark where the table begins");
        let (_, after) = rest.split_once(END).expect("README.md has the mark where the table ends");
        format!("{before}{BEGIN}{}{END}{after}", params::markdown())
    });
}

#[test]
fn the_default_preset_holds_the_defaults() {
    check("params/default.yaml", |_| params::preset(&Params::default(), "The defaults of every parameter."));
}

#[test]
fn every_preset_is_a_set_of_parameters() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("params");
    let mut names: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    names.sort();
    assert_eq!(names.len(), 6, "{names:?}");
    for path in names {
        let changes = params::file(&path, &NodeName::default()).unwrap();
        let changed = Params::default().with(changes.iter().map(|(n, v)| (n.as_str(), v)), Phase::StartUp).unwrap();
        let is_default = path.ends_with("default.yaml");
        assert_eq!(changed == Params::default(), is_default, "{}", path.display());
    }
}
