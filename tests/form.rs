//! What rustfmt leaves alone: comments and literals keep to its width too.

use std::fs;
use std::path::{Path, PathBuf};

/// `max_width` of rustfmt.toml, in characters.
const WIDTH: usize = 120;
const FOLDERS: [&str; 5] = ["src", "tests", "benches", "examples", "patches"];

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// Rows of tables stay whole: those in comments, and those of parameters, `NAME: TYPE = DEFAULT; "DESCRIPTION"`.
fn is_row(line: &str) -> bool {
    let line = line.trim();
    line.starts_with("//! |")
        || line.split_once("; \"").is_some_and(|(row, _)| row.contains(" = ") && line.ends_with('"'))
}

#[test]
fn lines_keep_to_the_width() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let settings = fs::read_to_string(root.join("rustfmt.toml")).unwrap();
    assert!(settings.contains(&format!("max_width = {WIDTH}\n")), "{settings}");
    let mut files = Vec::new();
    FOLDERS.iter().for_each(|folder| sources(&root.join(folder), &mut files));
    let mut long = Vec::new();
    for path in &files {
        let text = fs::read_to_string(path).unwrap();
        for (i, line) in text.lines().enumerate().filter(|(_, line)| line.chars().count() > WIDTH && !is_row(line)) {
            let name = path.strip_prefix(root).unwrap().display();
            long.push(format!("{name}:{}: {} characters", i + 1, line.chars().count()));
        }
    }
    assert!(long.is_empty(), "{}", long.join("\n"));
}
